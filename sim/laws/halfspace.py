"""Shear stress and displacement at the surface of an elastic half-space.

Stress and displacement are both along x, the sliding direction. Menga, Carbone & Dini (MCD below)
treat the incompressible half-space, nu = 1/2; every formula here holds its coefficient for any
Poisson ratio, with the coupling between normal and tangential fields (which vanishes at
nu = 1/2) neglected elsewhere. For two elastic bodies the compliances add (``in_series``).

A uniform mean stress tau0 on the contact disc and its fluctuation tau1 (zero mean) are kept apart:
the mean moves the disc, which ``disc_*`` describe and which has no meaning on an infinite plane;
the fluctuation stores the surface energy of ``surface_energy``. The power spectrum C_tau and every
energy below are therefore built from tau1 alone: with the mean in it, the integral of G_x C_tau
would diverge at q = 0.
"""

import functools
import math

import numpy as np
import scipy

from sim.numerics.grid import lattice_of
from sim.numerics.jit import device, law

# Above this parameter m the hypergeometric series lose digits near m = 1, below it the elliptic
# integrals cancel near m = 0: measured, both hold 1e-14 on their side.
_SWITCH = 0.9


@device
def _softness(cosine, poisson_ratio):
    """``G q G_x(q) = 1 - nu cos^2 theta`` [1] of the cosine between wavevector and sliding direction."""
    return 1.0 - poisson_ratio * (cosine * cosine)


@law
def compliance(qx, qy, shear_modulus, poisson_ratio=0.5):
    """Surface displacement along x per unit shear stress along x, at wavevector q.

    Parameters
    ----------
    qx, qy : float or array
        Wavevector components [rad/m]; broadcast against each other.
    shear_modulus : float or array
        G [Pa].
    poisson_ratio : float or array
        nu [1]; MCD treat 0.5.

    Returns
    -------
    float or array
        G_x(q) [m/Pa], even in q; zero at q = 0, where the answer depends on the size of the contact.

    Notes
    -----
    ``G_x(q) = (1 - nu qx^2/q^2) / (G q)``: MCD's ``(1 + qy^2/q^2) / (2 G q)`` at nu = 1/2.

    Examples
    --------
    A ripple along the sliding direction is stiffer than one across it:

    >>> along, across = compliance(1e4, 0.0, 1e6), compliance(0.0, 1e4, 1e6)
    >>> print(f"{along:.1e} {across:.1e}")
    5.0e-11 1.0e-10
    """
    q = math.hypot(qx, qy)
    if q == 0.0:
        return 0.0
    return _softness(qx / q, poisson_ratio) / (shear_modulus * q)


def angular_compliance(poisson_ratio=0.5):
    """Mean over the directions of G q G_x(q), and what multiplies cos 2 theta in it.

    Parameters
    ----------
    poisson_ratio : float or array
        nu [1].

    Returns
    -------
    mean, swing : float or array
        [1] of ``G_x(q) = (mean + swing cos 2 theta) / (G q)``, theta from the sliding direction: ``1 - nu/2``
        and ``-nu/2``.

    Examples
    --------
    >>> mean, swing = angular_compliance(0.5)
    >>> print(mean + swing, compliance(1.0, 0.0, 1.0))
    0.5 0.5
    """
    return 1.0 - 0.5 * poisson_ratio, -0.5 * poisson_ratio


@law
def point_displacement(x, y, shear_modulus, poisson_ratio=0.5):
    """Displacement along x at (x, y) per unit force along x at the origin of the surface.

    Parameters
    ----------
    x, y : float or array
        Position relative to the force [m]; x is the direction of the force.
    shear_modulus : float or array
        G [Pa].
    poisson_ratio : float or array
        nu [1].

    Returns
    -------
    float or array
        G_x(x, y) [m/N]; inf at the origin.

    Notes
    -----
    ``G_x(x) = (1 - nu + nu x^2/r^2) / (2 pi G r)`` (Cerruti; Johnson, Contact Mechanics, 3.6); at
    nu = 1/2 MCD's ``(1 + x^2/r^2) / (4 pi G r)``. Its transform is ``compliance``.

    Examples
    --------
    Ahead of the force the surface moves twice as far as beside it:

    >>> print(f"{point_displacement(1e-6, 0.0, 1e6) / point_displacement(0.0, 1e-6, 1e6):.3f}")
    2.000
    """
    r = math.hypot(x, y)
    if r == 0.0:
        return math.inf
    cosine = x / r
    return (1.0 - poisson_ratio + poisson_ratio * cosine * cosine) / (2.0 * math.pi * shear_modulus * r)


@law
def contact_modulus(shear_modulus, poisson_ratio=0.5):
    """Modulus of normal contact E* = E/(1 - nu^2) = 2G/(1 - nu) [Pa]; 4G at nu = 1/2.

    Parameters
    ----------
    shear_modulus : float or array
        G [Pa].
    poisson_ratio : float or array
        nu [1].

    Examples
    --------
    >>> print(f"{contact_modulus(1.6e6):.2e}")
    6.40e+06
    """
    return 2.0 * shear_modulus / (1.0 - poisson_ratio)


def in_series(shear_modulus_1, poisson_ratio_1, shear_modulus_2, poisson_ratio_2):
    """Equivalent half-space of two elastic bodies in contact, whose compliances add.

    Parameters
    ----------
    shear_modulus_1, shear_modulus_2 : float or array
        G of the two bodies [Pa]; inf is a rigid body.
    poisson_ratio_1, poisson_ratio_2 : float or array
        nu of the two bodies [1].

    Returns
    -------
    shear_modulus, poisson_ratio : float or array
        G_e [Pa] and nu_e [1] of the equivalent half-space on a rigid counter-face.

    Notes
    -----
    ``1/G_e = 1/G_1 + 1/G_2`` and ``nu_e = G_e (nu_1/G_1 + nu_2/G_2)``. Both compliances of the
    surface are linear in 1/G and nu/G: ``G_x = (1/G)/q - (nu/G) qx^2/q^3`` and ``1/E* = (1/G -
    nu/G)/2``. Adding the two numbers 1/G and nu/G of the bodies therefore adds both compliances
    exactly, at every wavevector. The coupling of normal and tangential fields of dissimilar bodies
    (Dundurs' second constant) is neglected; it vanishes if (1 - 2 nu)/G is the same on both sides.

    Examples
    --------
    Two equal bodies are twice as compliant as one:

    >>> print("%.1e %.2f" % in_series(2e6, 0.5, 2e6, 0.5))
    1.0e+06 0.50
    """
    inverse = 1.0 / shear_modulus_1 + 1.0 / shear_modulus_2
    share = poisson_ratio_1 / shear_modulus_1 + poisson_ratio_2 / shear_modulus_2
    return 1.0 / inverse, share / inverse


def _second(m):
    """Integral of cos^2/Delta over a quarter turn, Delta = sqrt(1 - m sin^2)."""
    k = scipy.special.ellipkm1(np.maximum(1.0 - m, np.finfo(float).tiny))
    near_edge = (scipy.special.ellipe(m) - (1.0 - m) * k) / np.maximum(m, _SWITCH)
    inner = 0.25 * math.pi * scipy.special.hyp2f1(0.5, 0.5, 2.0, np.minimum(m, _SWITCH))
    return np.where(m < _SWITCH, inner, near_edge)


def _mixed(m):
    """Integral of sin^2 cos^2/Delta over a quarter turn."""
    k = scipy.special.ellipkm1(np.maximum(1.0 - m, np.finfo(float).tiny))
    top = (2.0 - m) * scipy.special.ellipe(m) - 2.0 * (1.0 - m) * k
    near_edge = top / (3.0 * np.maximum(m, _SWITCH) ** 2)
    inner = math.pi / 16.0 * scipy.special.hyp2f1(0.5, 1.5, 3.0, np.minimum(m, _SWITCH))
    return np.where(m < _SWITCH, inner, near_edge)


def disc_displacement(x, y, radius, stress, shear_modulus, poisson_ratio=0.5):
    """Displacement along x of a surface with a uniform shear stress on a disc.

    Parameters
    ----------
    x, y : float or array
        Position relative to the centre of the disc [m].
    radius : float or array
        a [m], above 0.
    stress : float or array
        tau0 on the disc [Pa].
    shear_modulus : float or array
        G [Pa].
    poisson_ratio : float or array
        nu [1].

    Returns
    -------
    float or array
        v(x, y) [m]: inside, on the edge and outside of the disc.

    Notes
    -----
    The appendix of MCD (A8) convolves the point force with the disc by integrating along chords
    through the observed point. With rho = r/a, Delta^2 = 1 - m sin^2 and the integrals over a
    quarter turn E(m) of Delta, B(m) of cos^2/Delta and C(m) of sin^2 cos^2/Delta, it reads

    inside, m = rho^2:   ``v = tau0 a/(pi G) [(2 - nu) E + nu (x^2 - y^2)/a^2 C]``
    outside, m = 1/rho^2: ``v = tau0 a/(pi G rho) [(2 - nu) B + nu (x^2 - y^2)/r^2 (B - 2 m C)]``

    The first is A8 at nu = 1/2 (there ``rho^2 C = ((2 - rho^2) E - 2 (1 - rho^2) K)/(3 rho^2)``),
    written so that nothing cancels near the centre; the second follows in the same way from the
    chords that a ray from outside cuts, and is not in the paper. They meet at the edge.

    Examples
    --------
    The centre moves by 3/4 of tau0 a / G, the edge less, and more ahead than beside:

    >>> v = disc_displacement([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], 1.0, 1.0, 1.0)
    >>> print("%.6f %.6f %.6f" % tuple(v))
    0.750000 0.530516 0.424413
    """
    x, y = np.asarray(x, dtype=float) / radius, np.asarray(y, dtype=float) / radius
    rho = np.hypot(x, y)
    outward = np.maximum(rho, 1.0)
    m = np.minimum(rho, 1.0 / outward) ** 2
    turn = (x / outward) ** 2 - (y / outward) ** 2
    inside = (2.0 - poisson_ratio) * scipy.special.ellipe(m) + poisson_ratio * turn * _mixed(m)
    skew = _second(m) - 2.0 * m * _mixed(m)
    outside = ((2.0 - poisson_ratio) * _second(m) + poisson_ratio * turn * skew) / outward
    return stress * radius / (math.pi * shear_modulus) * np.where(rho <= 1.0, inside, outside)


@law
def disc_mean_displacement(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Mean displacement over a disc under uniform shear stress: v_m [m].

    Parameters
    ----------
    radius, stress, shear_modulus, poisson_ratio : float or array
        a [m], tau0 [Pa], G [Pa], nu [1].

    Notes
    -----
    ``v_m = (4/3)(2 - nu) tau0 a/(pi G)``: MCD's (A9) ``(2/pi) tau0 a/G`` at nu = 1/2. The displaced
    tangential volume is ``W = pi a^2 v_m``.

    Examples
    --------
    >>> print(f"{disc_mean_displacement(1.0, 1.0, 1.0):.6f}")
    0.636620
    """
    return 4.0 / 3.0 * (2.0 - poisson_ratio) * stress * radius / (math.pi * shear_modulus)


@law
def disc_edge_mean_displacement(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Mean displacement along the edge of a disc under uniform shear stress [m].

    Parameters
    ----------
    radius, stress, shear_modulus, poisson_ratio : float or array
        a [m], tau0 [Pa], G [Pa], nu [1].

    Notes
    -----
    ``(2 - nu) tau0 a/(pi G) = 2 (2 - nu)/(1 - nu) tau0 a/(pi E*)``: MCD's ``6 tau0 a/(pi E*)`` at
    nu = 1/2. Times the stress it is the elastic energy of the mean stress that a unit of new
    contact area stores, d(disc_tangential_energy)/dA.

    Examples
    --------
    >>> print(f"{disc_edge_mean_displacement(1.0, 1.0, 0.25) * math.pi:.3f}")
    6.000
    """
    return (2.0 - poisson_ratio) * stress * radius / (math.pi * shear_modulus)


@law
def disc_tangential_energy(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Elastic energy of a uniform shear stress on a disc: tau0 W/2 [J].

    Parameters
    ----------
    radius, stress, shear_modulus, poisson_ratio : float or array
        a [m], tau0 [Pa], G [Pa], nu [1].

    Notes
    -----
    ``(2/3)(2 - nu) tau0^2 a^3/G``: MCD's ``4 tau0^2 a^3/E*`` at nu = 1/2.

    Examples
    --------
    >>> print(f"{disc_tangential_energy(1.0, 1.0, 0.25):.3f}")
    4.000
    """
    return 2.0 / 3.0 * (2.0 - poisson_ratio) * stress * stress * radius**3 / shear_modulus


@law
def edge_work(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Change of MCD's potential per unit growth of the radius, at a uniform stress [J/m].

    Parameters
    ----------
    radius, stress, shear_modulus, poisson_ratio : float or array
        a [m], tau0 [Pa], G [Pa], nu [1].

    Notes
    -----
    ``-d(tau0 W/2)/da = -2 (2 - nu) tau0^2 a^2/G``: MCD's ``-12 tau0^2 a^2/E*`` at nu = 1/2. At
    equilibrium the potential's own slope equals this, so that the stress drops out: a uniform
    stress does not change the contact.

    Examples
    --------
    >>> print(f"{edge_work(1.0, 1.0, 0.25):.3f}")
    -12.000
    """
    return -2.0 * (2.0 - poisson_ratio) * stress * stress * radius * radius / shear_modulus


@law
def ripple_energy(amplitude, wavenumber, angle, shear_modulus, poisson_ratio=0.5):
    """Elastic energy per area of a sinusoidal shear stress: the surface energy of one wave.

    Parameters
    ----------
    amplitude : float or array
        tau1 of ``tau1 cos(q.x + phase)`` [Pa]; the rms is amplitude/sqrt(2).
    wavenumber : float or array
        q [rad/m], above 0.
    angle : float or array
        theta from the sliding direction to the wavevector [rad]: 0 varies along the sliding.
    shear_modulus : float or array
        G [Pa].
    poisson_ratio : float or array
        nu [1].

    Returns
    -------
    float or array
        Delta Gamma [J/m^2].

    Notes
    -----
    ``tau1^2 (1 - nu cos^2 theta) / (4 G q)``: at nu = 1/2 MCD's ``tau1^2/(8 G q)`` along the
    sliding direction, and twice that across it.

    Examples
    --------
    >>> print(f"{ripple_energy(1.0, 1.0, 0.0, 1.0):.3f} {ripple_energy(1.0, 1.0, math.pi / 2, 1.0):.3f}")
    0.125 0.250
    """
    slope = _softness(math.cos(angle), poisson_ratio)
    return amplitude * amplitude * slope / (4.0 * shear_modulus * wavenumber)


@law
def masking_amplitude(work, wavelength, shear_modulus, angle=0.0, poisson_ratio=0.5):
    """Amplitude of the sinusoidal shear stress whose energy equals the work of adhesion.

    Parameters
    ----------
    work : float or array
        Delta gamma [J/m^2].
    wavelength : float or array
        lambda = L/k [m]: k waves across a contact of width L.
    shear_modulus : float or array
        G [Pa].
    angle : float or array
        theta from the sliding direction to the wavevector [rad].
    poisson_ratio : float or array
        nu [1].

    Returns
    -------
    float or array
        tau1 [Pa], an amplitude, not an rms; nan for a negative work.

    Notes
    -----
    Inverts ``ripple_energy``: ``tau1 = sqrt(8 pi G w / (lambda (1 - nu cos^2 theta)))``, which is
    MCD's ``4 sqrt(pi k G w / L)`` at nu = 1/2 and theta = 0.

    Examples
    --------
    Ten waves across the 0.24 mm contact of a PDMS lens, and across the 4 mm contact of a softer one:

    >>> print(f"{masking_amplitude(0.042, 0.24e-3 / 10, 1.6e6):.6g} Pa")
    375158 Pa
    >>> print(f"{masking_amplitude(0.042, 4e-3 / 10, 0.5e6):.5g} Pa")
    51371 Pa
    """
    slope = _softness(math.cos(angle), poisson_ratio)
    return math.sqrt(8.0 * math.pi * shear_modulus * work / (wavelength * slope))


@law
def noise_energy(rms, pixel, shear_modulus, poisson_ratio=0.5):
    """Energy per area that white noise of a map's pixels seems to store.

    Parameters
    ----------
    rms : float or array
        s, root mean square of the noise [Pa], independent from pixel to pixel.
    pixel : float or array
        p, side of a square pixel [m].
    shear_modulus, poisson_ratio : float or array
        G [Pa], nu [1].

    Returns
    -------
    float or array
        Delta Gamma [J/m^2], which a measurement adds to that of the stress.

    Notes
    -----
    The density ``s^2 p^2`` over the square of wavevectors below Nyquist: ``(2 - nu) asinh(1) s^2 p/(2 pi G)``.

    Examples
    --------
    >>> print(f"{noise_energy(1.0, 1.0, 1.0):.6f}")
    0.210412
    """
    return (2.0 - poisson_ratio) * math.asinh(1.0) / (2.0 * math.pi) * rms * rms * pixel / shear_modulus


@functools.lru_cache(maxsize=4)
def _unit_compliance(cell, shape, poisson_ratio):
    """Lattice of a cell and its compliance at unit shear modulus on the half spectrum."""
    lattice = lattice_of(cell, shape)
    table = compliance(*lattice.wavevectors, 1.0, poisson_ratio)
    table.flags.writeable = False
    return lattice, table


def _sides(cell):
    """One or both sides of a cell, hashable."""
    return float(cell) if np.ndim(cell) == 0 else (float(cell[0]), float(cell[1]))


def displacement(field, cell, shear_modulus, poisson_ratio=0.5):
    """Displacement map w1 of a periodic shear-stress map, its mean stress removed.

    Parameters
    ----------
    field : array, shape (..., nx, ny)
        Shear stress along x [Pa]; axis -2 is x, axis -1 is y; odd or even numbers of points.
    cell : float or (float, float)
        Sides of the periodic cell along x and y [m], one for both if they are equal.
    shear_modulus : float or array, shape (...)
        G [Pa]; an array goes with the leading axes of the field.
    poisson_ratio : float
        nu [1].

    Returns
    -------
    array, shape of the field
        w1 [m], zero mean: ``w1(q) = G_x(q) tau1(q)``, zero at q = 0.

    Examples
    --------
    >>> x = np.arange(8) / 8.0
    >>> ripple = np.cos(2.0 * np.pi * x)[:, None] * np.ones(8)
    >>> print(f"{np.max(displacement(5.0 + ripple, 1.0, 1.0)) * 4.0 * np.pi:.3f}")
    1.000
    """
    field = np.asarray(field, dtype=float)
    lattice, unit = _unit_compliance(_sides(cell), field.shape[-2:], float(poisson_ratio))
    fields, moduli = np.broadcast_arrays(field, np.asarray(shear_modulus, dtype=float)[..., None, None])
    displaced = np.empty(fields.shape)
    for index in np.ndindex(fields.shape[:-2]):
        spectrum = scipy.fft.rfft2(fields[index])
        spectrum *= unit / (moduli[*index, 0, 0] * (lattice.shape[0] * lattice.shape[1]))
        lattice.superpose(spectrum, spectrum, displaced[index])
    return displaced


def surface_energy(field, cell, shear_modulus, poisson_ratio=0.5):
    """Elastic energy per area of the fluctuation of a periodic shear-stress map.

    Parameters
    ----------
    field, cell, shear_modulus, poisson_ratio
        As for ``displacement``.

    Returns
    -------
    float or array, shape (...)
        Delta Gamma = <tau1 w1>/2 [J/m^2].

    Notes
    -----
    By Parseval ``(1/2A^2) sum over q of G_x(q) |tau(q)|^2``, A the area of the cell, q = 0 left out: only the
    fluctuation counts, never the mean. For a stress whose spectrum is smooth through q = 0 the periodic cell holds
    less than the infinite plane by ``(2 - nu)/(8 pi) 3.900265 C(0) /
    (G L)`` (0.23278 C(0)/(G L) at nu = 1/2).

    Examples
    --------
    A ripple of unit amplitude stores 1/(8 G q), and a uniform stress on top of it nothing more:

    >>> x = np.arange(8) / 8.0
    >>> ripple = np.cos(2.0 * np.pi * x)[:, None] * np.ones(8)
    >>> print(f"{surface_energy(5.0 + ripple, 1.0, 1.0) * 16.0 * np.pi:.3f}")
    1.000
    """
    field = np.asarray(field, dtype=float)
    lattice, unit = _unit_compliance(_sides(cell), field.shape[-2:], float(poisson_ratio))
    return 0.5 * lattice.weighted_power(field, unit) / (lattice.area**2 * np.asarray(shear_modulus))
