"""Shear stress and displacement at the surface of an elastic half-space.

Stress and displacement are both along x, the sliding direction. Menga, Carbone & Dini (MCD below) treat the
incompressible half-space, nu = 1/2. Every formula here has its coefficient for any Poisson ratio, at a normal stress of
zero. For two elastic bodies the compliances add (``in_series``).

A smooth rigid sphere holds the normal displacement instead. Normal and tangential fields are coupled at nu != 1/2, and
the normal stress that develops under a wave of shear stress stiffens the surface. Every formula at zero normal stress
is then right with a larger Poisson ratio, ``held_ratio``.

A uniform mean stress tau0 on the contact disc and its fluctuation tau1 (zero mean) are separate. The mean moves the
disc, as in the functions ``disc_*``; it has no meaning on an infinite plane. The fluctuation stores the energy of
``surface_energy``. The power spectrum C_tau and every energy below therefore contain only tau1. With the mean, the
integral of G_x C_tau would diverge at q = 0.
"""

import functools
import math

import numpy as np
import scipy

from sim.numerics.grid import Grid, lattice_of
from sim.numerics.jit import device, law
from sim.numerics.special import sine_integral

# Above this parameter m the hypergeometric series loses digits near m = 1, below it Carlson's integrals
# cancel near m = 0: measured, both hold 1e-15 on their side.
_SWITCH = 0.9
#: Least 1 - m, at which the integrals are those of m = 1.
_LEAST_REST = 1e-300


@device
def _softness(cosine, poisson_ratio):
    """``G q G_x(q) = 1 - nu cos^2 theta`` [1] of the cosine between wavevector and sliding direction."""
    return 1.0 - poisson_ratio * (cosine * cosine)


@law
def compliance(qx, qy, shear_modulus, poisson_ratio=0.5):
    """Return the surface displacement along x per unit shear stress along x, at wavevector q.

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
    """Return the mean over the directions of G q G_x(q), and what multiplies cos 2 theta in it.

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
    """Return the displacement along x at (x, y) per unit force along x at the origin of the surface.

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
    return (1.0 - poisson_ratio + poisson_ratio * cosine * cosine) / (
        2.0 * math.pi * shear_modulus * r
    )


@law
def contact_modulus(shear_modulus, poisson_ratio=0.5):
    """Return the modulus of normal contact E* = E/(1 - nu^2) = 2G/(1 - nu) [Pa]; 4G at nu = 1/2.

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
    """Return the equivalent half-space of two elastic bodies in contact, whose compliances add.

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
    exactly, at every wavevector. Normal and tangential fields are coupled by ``coupling``, which vanishes if
    (1 - 2 nu)/G is the same on both sides.

    Examples
    --------
    Two equal bodies are twice as compliant as one:

    >>> print("%.1e %.2f" % in_series(2e6, 0.5, 2e6, 0.5))
    1.0e+06 0.50
    """
    inverse = 1.0 / shear_modulus_1 + 1.0 / shear_modulus_2
    share = poisson_ratio_1 / shear_modulus_1 + poisson_ratio_2 / shear_modulus_2
    return 1.0 / inverse, share / inverse


def coupling(
    shear_modulus_1, poisson_ratio_1, shear_modulus_2=math.inf, poisson_ratio_2=0.5
):
    """Return how far shear stress along its wave moves two surfaces apart, beside ``q`` and ``in_series``.

    Parameters
    ----------
    shear_modulus_1, poisson_ratio_1, shear_modulus_2, poisson_ratio_2 : float or array
        As for ``in_series``; the second body is rigid by default.

    Returns
    -------
    float or array
        ``G_e q C_tn`` [1], C_tn the relative normal displacement per shear stress.

    Notes
    -----
    ``G_e ((1 - 2 nu_1)/(2 G_1) - (1 - 2 nu_2)/(2 G_2))``. The stresses on the two bodies are opposite, so that their
    normal displacements have opposite signs and cancel between equal bodies.

    Examples
    --------
    >>> print(coupling(2e6, 0.3), coupling(2e6, 0.3, 2e6, 0.3))
    0.2 0.0
    """
    modulus, _ = in_series(
        shear_modulus_1, poisson_ratio_1, shear_modulus_2, poisson_ratio_2
    )
    first = (1.0 - 2.0 * poisson_ratio_1) / (2.0 * shear_modulus_1)
    second = (1.0 - 2.0 * poisson_ratio_2) / (2.0 * shear_modulus_2)
    return modulus * (first - second)


def held_ratio(poisson_ratio, coupling):
    """Return the Poisson ratio at which the compliance without normal stress is that at held normal displacement.

    Parameters
    ----------
    poisson_ratio, coupling : float or array
        nu [1], and ``coupling`` [1].

    Returns
    -------
    float or array
        [1], ``1/(4 (1 - nu))`` of one body, which is nu at 1/2.

    Notes
    -----
    The compliance along the wave is ``C_tt - C_tn^2/C_nn`` with ``C_tt = C_nn = (1 - nu)/(G q)``. Across the wave
    nothing is coupled.

    Examples
    --------
    The coupling stiffens a body with nu = 0.3 by 8 % along its waves:

    >>> print(f"{(1 - held_ratio(0.3, 0.2)) / (1 - 0.3):.3f}")
    0.918
    """
    return poisson_ratio + coupling * coupling / (1.0 - poisson_ratio)


def _second(m):
    """Integral of cos^2/Delta over a quarter turn, Delta = sqrt(1 - m sin^2)."""
    rest = np.maximum(1.0 - m, _LEAST_REST)
    return rest * scipy.special.elliprd(0.0, 1.0, rest) / 3.0


def _mixed(m):
    """Integral of sin^2 cos^2/Delta over a quarter turn."""
    rest = np.maximum(1.0 - m, _LEAST_REST)
    near_edge = (_second(m) - rest * scipy.special.elliprd(0.0, rest, 1.0) / 3.0) / (
        3.0 * np.maximum(m, _SWITCH)
    )
    inner = math.pi / 16.0 * scipy.special.hyp2f1(0.5, 1.5, 3.0, np.minimum(m, _SWITCH))
    return np.where(m < _SWITCH, inner, near_edge)


def disc_displacement(x, y, radius, stress, shear_modulus, poisson_ratio=0.5):
    """Return the displacement along x of a surface with a uniform shear stress on a disc.

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
    inside = (2.0 - poisson_ratio) * scipy.special.ellipe(
        m
    ) + poisson_ratio * turn * _mixed(m)
    skew = _second(m) - 2.0 * m * _mixed(m)
    outside = (
        (2.0 - poisson_ratio) * _second(m) + poisson_ratio * turn * skew
    ) / outward
    return (
        stress
        * radius
        / (math.pi * shear_modulus)
        * np.where(rho <= 1.0, inside, outside)
    )


@law
def disc_mean_displacement(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Return the mean displacement over a disc under uniform shear stress: v_m [m].

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
    return (
        4.0 / 3.0 * (2.0 - poisson_ratio) * stress * radius / (math.pi * shear_modulus)
    )


@law
def disc_edge_mean_displacement(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Return the mean displacement along the edge of a disc under uniform shear stress [m].

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
    """Return the elastic energy of a uniform shear stress on a disc: tau0 W/2 [J].

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
    return (
        2.0 / 3.0 * (2.0 - poisson_ratio) * stress * stress * radius**3 / shear_modulus
    )


@law
def edge_work(radius, stress, shear_modulus, poisson_ratio=0.5):
    """Return the change of MCD's potential per unit growth of the radius, at a uniform stress [J/m].

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
    return (
        -2.0 * (2.0 - poisson_ratio) * stress * stress * radius * radius / shear_modulus
    )


@law
def ripple_energy(amplitude, wavenumber, angle, shear_modulus, poisson_ratio=0.5):
    """Return the elastic energy per area of a sinusoidal shear stress: the surface energy of one wave.

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
    """Return the amplitude of the sinusoidal shear stress whose energy equals the work of adhesion.

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
    """Return the energy per area that white noise of a map's pixels seems to store.

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
    return (
        (2.0 - poisson_ratio)
        * math.asinh(1.0)
        / (2.0 * math.pi)
        * rms
        * rms
        * pixel
        / shear_modulus
    )


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
    """Return the displacement map w1 of a periodic shear-stress map, its mean stress removed.

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
    lattice, unit = _unit_compliance(
        _sides(cell), field.shape[-2:], float(poisson_ratio)
    )
    spectrum = (
        scipy.fft.rfft2(field)
        * unit
        / np.asarray(shear_modulus, dtype=float)[..., None, None]
    )
    return scipy.fft.irfft2(spectrum, lattice.shape)


def surface_energy(field, cell, shear_modulus, poisson_ratio=0.5):
    """Return the elastic energy per area of the fluctuation of a periodic shear-stress map.

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
    lattice, unit = _unit_compliance(
        _sides(cell), field.shape[-2:], float(poisson_ratio)
    )
    return (
        0.5
        * lattice.weighted_power(field, unit)
        / (lattice.area**2 * np.asarray(shear_modulus))
    )


# Elastic energy of a fluctuating shear stress on one finite disc of contact: of a wave, of a map.


#: Width of a soft edge, and how far it reaches [pixels].
_BLUR, _EDGE = 0.75, 4.5
# Below this argument the closed forms cancel, above it their power series do; 16 terms are exact there.
_SERIES_END = 3.0
_TERM = np.arange(16)
_MEAN_SERIES = 0.5 * np.sqrt(np.pi) * (-1.0) ** _TERM / (2 * _TERM + 1)
_MEAN_SERIES /= [math.factorial(n) * math.gamma(n + 2.5) for n in range(len(_TERM))]
_SKEW_SERIES = -0.5 * np.sqrt(np.pi) * (-1.0) ** _TERM / ((_TERM + 2) * (2 * _TERM + 3))
_SKEW_SERIES /= [math.factorial(n) * math.gamma(n + 3.5) for n in range(len(_TERM))]


def _series(x, mean_growth, skew_growth):
    """Both factors by their power series in x/2, each term raised by its share in the derivative."""
    z = 0.5 * np.minimum(x, _SERIES_END)
    mean = z * np.polynomial.polynomial.polyval(z * z, _MEAN_SERIES * mean_growth)
    skew = z**3 * np.polynomial.polynomial.polyval(z * z, _SKEW_SERIES * skew_growth)
    return mean, skew


def energy_factors(x):
    """Return the energy of a wave on a disc: its mean over directions, and the part that goes with cos 2 theta.

    Parameters
    ----------
    x : array
        2 q a [1], at least 0; inf is the infinite plane.

    Returns
    -------
    mean, skew : array
        [1] ``P`` and ``S`` of ``E/(pi a^2) = (sigma^2/(G q)) (1/pi) [(1 - nu/2) P + (nu/2) cos(2 theta) S]``, from 0 at
        x = 0 to pi/2 and -pi/2 at infinity.

    Notes
    -----
    The angular means of kernel and wave leave ``integral of A(s) J0(qs) ds = (2 a^2/q) P`` and
    ``integral of A(s) J2(qs) ds = -(2 a^2/q) S``, of which the powers of q sum to

    ``P = Si(x) + cos(x)/x - sin(x)/x^2``  and  ``S = 4/x - 3 sin(x)/x^2 - cos(x)/x - Si(x)``.

    Examples
    --------
    A wave along x with two wave halves on the diameter, and the same wave across:

    >>> mean, skew = energy_factors(2 * np.pi)
    >>> print(f"{4 / np.pi * (0.75 * mean + 0.25 * skew):.5f} {2 / np.pi * (0.75 * mean - 0.25 * skew):.5f}")
    1.20679 0.90282
    """
    x = np.asarray(x, dtype=float)
    near = _series(x, 2.0, 2.0)
    far = np.clip(x, _SERIES_END, 1e300)
    sine, cosine, integral = np.sin(far) / far, np.cos(far), sine_integral(far)
    mean = integral + (cosine - sine) / far
    skew = (4.0 - 3.0 * sine - cosine) / far - integral
    return np.where(x < _SERIES_END, near[0], mean), np.where(
        x < _SERIES_END, near[1], skew
    )


def marginal_factors(x):
    """Return the factors as of ``energy_factors`` for dE/dA, the energy of a unit of new contact at the edge.

    Parameters
    ----------
    x : array
        2 q a [1], at least 0; inf is the infinite plane.

    Returns
    -------
    mean, skew : array
        [1]

    Notes
    -----
    ``dA/da = 4 a arccos t`` gives, exactly, ``P = Si(x)`` and ``S = 2 (1 - cos x)/x - Si(x)``.

    Examples
    --------
    On whole numbers of waves the direction does not matter relative to the infinite plane:

    >>> mean, skew = marginal_factors(2 * np.pi * np.arange(1, 4))
    >>> print(np.round(mean + skew, 12) + 0.0)
    [0. 0. 0.]
    """
    x = np.asarray(x, dtype=float)
    near = _series(x, 2 * _TERM + 3.0, 2 * _TERM + 5.0)
    far = np.clip(x, _SERIES_END, 1e300)
    integral = sine_integral(far)
    skew = 4.0 * np.sin(0.5 * far) ** 2 / far - integral
    return np.where(x < _SERIES_END, near[0], integral), np.where(
        x < _SERIES_END, near[1], skew
    )


@functools.lru_cache(maxsize=8)
def _free_kernel(points, poisson_ratio):
    """Grid of ``points`` unit pixels and the transform of the kernel cut at half of it, at unit modulus.

    A sum over this periodic grid is the free-space convolution of all that fits in half of it. With J0 and J2
    integrated up to T = points/2 the transform is ``(1/q) [(1 - nu/2) j0(qT) - (nu/2) cos(2 theta) j2(qT)]``.
    """
    grid = Grid(cell=float(points), points=points)
    qx, qy = grid.wavevectors
    q = np.hypot(qx, qy)
    q[0, 0] = 1.0
    x = 0.5 * points * q
    j1, h0, h1 = (
        scipy.special.j1(x),
        scipy.special.struve(0, x),
        scipy.special.struve(1, x),
    )
    mean = x * scipy.special.j0(x) + 0.5 * math.pi * x * (
        j1 * h0 - scipy.special.j0(x) * h1
    )
    skew = (qx**2 - qy**2) / q**2 * (mean - 2.0 * j1)
    level, swing = angular_compliance(poisson_ratio)
    kernel = (level * mean + swing * skew) / q
    kernel[0, 0] = level * 0.5 * points
    kernel.flags.writeable = False
    return grid, kernel


def _padded_size(radius):
    """Side of the padded grid in pixels for a disc of ``radius`` pixels; few values, so that kernels are kept."""
    least = 2.0 * (2.0 * radius + 4.0)
    step = 2.0 ** (math.ceil(math.log2(least)) - 3)
    return max(
        16,
        scipy.fft.next_fast_len(
            2 * math.ceil(0.5 * step * math.ceil(least / step)), real=True
        ),
    )


def disc_energies_of_map(
    field, pixel, radii, shear_modulus, poisson_ratio=0.5, discs=None
):
    """Return the elastic energies per area of a shear-stress map on discs of several radii at its middle.

    Parameters
    ----------
    field : array, shape (points, points)
        tau1 along x [Pa], axis 0 is x, axis 1 is y; the middle is sample points//2. Beyond it there is no stress.
    pixel : float
        Distance of neighbouring points [m].
    radii : array, shape (discs,)
        a [m], above 0; the widest disc ends 5 pixels before the map.
    shear_modulus, poisson_ratio : float
        G [Pa], nu [1].
    discs : sequence of array, optional
        ``soft_disc`` of each radius, to be used again.

    Returns
    -------
    array, shape (discs,)
        ``1/(2 pi a^2) integral of tau1 w1`` [J/m^2], w1 the displacement by the stress on the disc alone, without
        periodic images: the kernel of free space is cut at a length beyond the diameter (Vico, Greengard & Ferrando,
        J. Comput. Phys. 323, 2016, 191), exact for every wave that the grid carries. The soft edge changes
        them by 0.16 (pixel/a)^2 for a uniform stress and by 0.65 k (pixel/a)^2 for k waves on the diameter, relative,
        and their derivatives no more.

    Examples
    --------
    >>> energies = disc_energies_of_map(np.ones((80, 80)), 1 / 32, np.array([0.5, 1.0]), 1.0)
    >>> print(np.round(energies * math.pi, 3))
    [0.5 1. ]
    """
    held = np.asarray(radii, float) / pixel
    grid, kernel = _free_kernel(
        _padded_size(np.max(held) + _EDGE), float(poisson_ratio)
    )
    energies = np.empty(held.shape)
    for place, radius in enumerate(held):
        disc = soft_disc(radius) if discs is None else discs[place]
        first = field.shape[0] // 2 - len(disc) // 2
        inside = slice(first, first + len(disc))
        energies[place] = (
            grid.weighted_power(field[inside, inside] * disc, kernel) / radius**2
        )
    return 0.5 * pixel / (math.pi * grid.points**2 * shear_modulus) * energies


def soft_disc(radius):
    """Return the weights [1] of the samples around the middle of a smoothed disc of ``radius`` pixels.

    The disc is smoothed by a Gaussian, and the second moment of the smoothing is subtracted. Sums over samples then
    equal integrals over the plane except for about 1e-5 at any radius, so they can be differentiated over the radius.
    """
    half = math.ceil(radius + _EDGE)
    place = np.arange(-half, half + 1)
    out = np.hypot(place[:, None], place) - radius
    bell = np.exp(-0.5 * (out / _BLUR) ** 2) / (_BLUR * math.sqrt(2.0 * math.pi))
    return 0.5 * (scipy.special.erfc(out / (_BLUR * math.sqrt(2.0))) - out * bell)


def free_energy_of_map(field, pixel, shear_modulus, poisson_ratio=0.5):
    """Return the elastic energy of a shear-stress map in a free half-space, per area of the map.

    Parameters
    ----------
    field : array, shape (nx, ny)
        tau1 along x [Pa]; axis 0 is x, axis 1 is y; 0 outside of the contact. Beyond the map there is no stress.
    pixel : float
        Distance of neighbouring points [m].
    shear_modulus, poisson_ratio : float
        G [Pa], nu [1].

    Returns
    -------
    float
        ``1/(2 A) integral of tau1 w1`` [J/m^2], A the area of the map, without periodic images: these would lower it
        by 0.23278 C(0)/(G L) (nu = 1/2), C(0) L^2 being the square of the force.

    Examples
    --------
    Of a disc of uniform stress, a quarter of the map wide, with pixels of 1/32 of its radius:

    >>> x = np.arange(-64, 64) / 32 + 1 / 64
    >>> disc = (np.hypot(x[:, None], x) < 1.0).astype(float)
    >>> print(f"{free_energy_of_map(disc, 1 / 32, 1.0) * 4.0**2:.1f}")
    1.0
    """
    reach = scipy.fft.next_fast_len(math.ceil(math.hypot(*field.shape)), real=True)
    grid, kernel = _free_kernel(2 * reach, float(poisson_ratio))
    power = grid.weighted_power(field, kernel)
    return 0.5 * pixel * power / (grid.points**2 * field.size * shear_modulus)


# Profiles of stress and displacement across one contact.


@law
def pressure(r, radius, indentation, sphere_radius, modulus):
    """Return the normal stress between sphere and half-space.

    Parameters
    ----------
    r : float or array
        Distance from the axis [m], at least 0.
    radius : float or array
        a [m].
    indentation : float or array
        delta [m].
    sphere_radius, modulus : float or array
        R [m], E* [Pa].

    Returns
    -------
    float or array
        p [Pa], below 0 in tension; 0 outside; at the edge itself -inf where adhesion pulls, 0 in Hertz's
        contact.

    Notes
    -----
    ``p = (2 E*/(pi R)) sqrt(a^2 - r^2) - (E*/pi) (a^2/R - delta)/sqrt(a^2 - r^2)``. Its integral is
    ``jkr.load_under_indentation``, its singularity at the edge ``-K_I/sqrt(2 pi (a - r))`` with the stress intensity
    ``K_I = E* (a^2/R - delta)/sqrt(pi a)``, and ``K_I^2/(2 E*)`` the energy release rate.

    Examples
    --------
    A contact without load presses in the middle and pulls at its edge:

    >>> p = pressure([0.0, 0.9, 1.1], 1.0, 1.0 / 3.0, 1.0, 1.0)
    >>> print("%.3f %.3f %.3f" % tuple(p))
    0.424 -0.209 0.000
    """
    if r > radius:
        return 0.0
    slant = math.sqrt(radius - r) * math.sqrt(radius + r)
    missing = radius * (radius / sphere_radius) - indentation
    hertz = 2.0 * modulus / math.pi * (slant / sphere_radius)
    return hertz if missing == 0.0 else hertz - modulus / math.pi * (missing / slant)


def normal_displacement(r, radius, indentation, sphere_radius):
    """Return the displacement of the surface of the half-space along the normal, into it.

    Parameters
    ----------
    r, radius, indentation, sphere_radius : float or array
        Distance from the axis [m], a [m], delta [m], R [m]. The modulus does not matter.

    Returns
    -------
    float or array
        u_z [m]; below 0 the surface is raised.

    Notes
    -----
    Inside ``delta - r^2/(2R)``; outside, with a/r = sin(psi),

        ``u_z = (r^2/(2 pi R)) [sin 2 psi - 2 psi cos 2 psi] + (2/pi) (delta - a^2/R) psi``

    which is Johnson's ``(1/(pi R)) [(2a^2 - r^2) asin(a/r) + a sqrt(r^2 - a^2)]`` for Hertz, in a form
    that does not cancel far away, where it tends to P/(pi E* r).

    Examples
    --------
    The neck of a lifted sphere draws the surface up:

    >>> print(f"{normal_displacement(1.0, 1.0, -0.5, 1.0):.2f} {normal_displacement(2.0, 1.0, -0.5, 1.0):.2f}")
    -1.00 -0.28
    """
    r = np.asarray(r, dtype=float)
    outside = np.maximum(r, radius)
    # the arcsine of radius/r would lose half its digits at the edge
    turn = np.arctan2(radius, np.sqrt(outside - radius) * np.sqrt(outside + radius))
    # sin 2t - 2t cos 2t without cancellation
    lever = (2.0 * turn) ** 3 / 3.0 * scipy.special.hyp0f1(2.5, -(turn**2))
    punch = indentation - radius * (radius / sphere_radius)
    free = (
        0.5 / math.pi * outside * (outside / sphere_radius) * lever
        + 2.0 / math.pi * punch * turn
    )
    return np.where(r <= radius, indentation - 0.5 * r * (r / sphere_radius), free)[()]


def gap(r, radius, indentation, sphere_radius):
    """Return the distance between the surfaces of sphere and half-space along the normal.

    Parameters
    ----------
    r, radius, indentation, sphere_radius : float or array
        Distance from the axis [m], a [m], delta [m], R [m].

    Returns
    -------
    float or array
        g [m]; 0 inside; never below 0 where delta <= a^2/R, that is where the edge pulls or is Hertz's.

    Notes
    -----
    ``r^2/(2R) - delta + u_z`` written without cancellation at the edge: with t = sqrt(r^2 - a^2)/a

        ``g = (a^2/(pi R)) [t + (t^2 - 1) atan t] + (2/pi) (a^2/R - delta) atan t``

    Beside the edge of a Hertzian contact it opens as (r - a)^(3/2), of an adhesive one as (r - a)^(1/2).

    Examples
    --------
    >>> print("%.2e %.2e" % tuple(gap(1.0001, 1.0, [1.0, 0.9], 1.0)))
    1.20e-06 9.01e-04
    """
    t = (
        np.sqrt(np.maximum(np.subtract(r, radius), 0.0))
        * np.sqrt(np.add(r, radius))
        / radius
    )
    # t + (t^2 - 1) atan t
    opening = t**2 * np.arctan(t) + t**3 / 3.0 * scipy.special.hyp2f1(
        1.0, 1.5, 2.5, -(t**2)
    )
    hertz = radius * (radius / sphere_radius)
    return hertz / math.pi * opening + 2.0 / math.pi * np.subtract(
        hertz, indentation
    ) * np.arctan(t)
