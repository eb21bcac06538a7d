"""JKR contact whose adhesion also pays the reversible share alpha of the elastic energy of the mean shear stress."""

import math

from sim.laws.jkr import hertz_radius_at_indentation, hertz_radius_at_load, radius_at_indentation, radius_at_load
from sim.numerics.jit import device, law

_STICK = 1.5  # of T^2 in the energy balance at a load: full stick,
_UNIFORM = 16.0 / math.pi**2  # and uniform stress
_AS_STICK = math.pi**2 / 32.0  # alpha at a held stress that gives the same radii
_AS_UNIFORM = 1.0 / 3.0


@device
def _compressible(poisson_ratio):
    """Shear energy at a given stress and modulus E*, relative to that at nu = 1/2."""
    return (2.0 - poisson_ratio) / (3.0 * (1.0 - poisson_ratio))


@device
def _largest_force(load, work, sphere_radius, share):
    """Tangential force at which the root below ends: sqrt(c (2P + c)/share), c = 3 pi w R [N]."""
    pull = 3.0 * math.pi * work * sphere_radius
    return math.sqrt(pull) * math.sqrt(2.0 * load + pull) / math.sqrt(share)


@device
def _crossing_at_load(z, p, m, s):
    """Largest z with (z^3 - p)^2/z^3 = m + s z and the slope there, from a z right of it; nan if none."""
    slope = math.nan
    for _ in range(100):
        cube = z * z * z
        missing = cube - p
        over = missing / cube * missing - m - s * z
        slope = 3.0 * (missing / cube) * ((cube + p) / z) - s
        if over <= 0.0:
            break
        lower = z - over / slope
        if not (slope > 0.0 and lower > 0.0):
            return math.nan, math.nan
        if not lower < z:
            break
        z = lower
    return z, slope


@device
def _crossing_at_displacement(z, q, soft, m, s, stuck):
    """Largest z with missing^2/z + stuck/z^3 = m + s z and the slope there, as at a load.

    missing = (z^2 - q + (2/3) soft z^3)/(1 + soft z) is a^2/R - delta where the displacement is q and a
    machine of stiffness 2 E*/soft yields; a stiff one, soft = 0, leaves z^2 - q.
    """
    slope = math.nan
    hard = 1.0 / (1.0 + soft)
    soft = 1.0 - hard
    for _ in range(100):
        square = z * z
        share = hard + soft * z
        missing = (hard * (square - q) + 2.0 / 3.0 * soft * square * z) / share
        over = missing / z * missing + stuck / square / z - m - s * z
        growth = 2.0 * z - soft * missing / share
        slope = missing / z * (2.0 * growth - missing / z) - s - 3.0 * stuck / square / square
        if over <= 0.0:
            break
        lower = z - over / slope
        if not (slope > 0.0 and lower > 0.0):
            return math.nan, math.nan
        if not lower < z:
            break
        z = lower
    return z, slope


@law
def _shrunk_at_load(jkr, hertz, load, work, stress, reversible, held, sphere_radius, modulus, poisson_ratio):
    """JKR's radius less what reversible shear takes; held = 0 holds the stress, 4 the force."""
    if reversible == 0.0 or stress == 0.0 or work <= 0.0 or not jkr > 0.0 or jkr == math.inf:
        return jkr
    tilt = sphere_radius / jkr
    shear = stress / modulus * tilt
    s = 27.0 * reversible * _compressible(poisson_ratio) * shear * shear
    if not s >= 0.0:
        return math.nan
    m = 4.5 * math.pi * (work / modulus / jkr) * tilt * tilt
    start = min(1.0, m / s)
    if load >= 0.0 and not start * jkr > hertz:
        return hertz
    z, slope = _crossing_at_load(start, 0.75 * (load / modulus / jkr) * (tilt / jkr), m, -s)
    if not slope >= held * s:
        return hertz if load >= 0.0 else math.nan
    return max(z * jkr, hertz) if load >= 0.0 else z * jkr


@law
def shrunk_at_displacement(
    jkr, hertz, displacement, stiffness, work, stress, reversible, held, sphere_radius, modulus, poisson_ratio
):
    """JKR's radius behind a machine stiffness, less what reversible shear takes.

    Parameters
    ----------
    jkr, hertz : float or array
        Radii of the same displacement without shear, with the work and with none [m].
    displacement, stiffness : float or array
        Delta = delta + P/k [m], k [N/m]; k = inf holds the indentation.
    work, stress, reversible, sphere_radius, modulus, poisson_ratio : float or array
        As ``radius_at_load_reversible``.
    held : float
        0 where the stress is held as the edge moves, 4 where the tangential force is.

    Returns
    -------
    float or array
        a [m]; ``jkr`` bit for bit at alpha = 0, ``hertz`` where adhesion does not pay; nan where a pulled
        contact has no equilibrium.

    Notes
    -----
    With y = a^2/R - delta and k the stiffness in units of 2 E* (a length), ``y = (k (a^2/R - Delta) +
    2 a^3/(3R))/(k + a)``, and G = E* y^2/(2 pi a) is convex in a for all k and Delta: its second derivative
    is a quadratic form in y with a discriminant of ``(k + 4a)^2 - 4 (k^2 + 4 k a + 6 a^2) < 0``, times a
    square. For a displacement of at least zero Hertz's contact exists.
    """
    if reversible == 0.0 or stress == 0.0 or work <= 0.0 or not jkr > 0.0 or jkr == math.inf:
        return jkr
    tilt = sphere_radius / jkr
    shear = stress / modulus * tilt
    s = 12.0 * reversible * _compressible(poisson_ratio) * shear * shear
    if not s >= 0.0:
        return math.nan
    m = 2.0 * math.pi * (work / modulus / jkr) * tilt * tilt
    start = min(1.0, m / s)
    if displacement >= 0.0 and not start * jkr > hertz:
        return hertz
    soft = 2.0 * modulus * jkr / stiffness
    z, slope = _crossing_at_displacement(start, displacement / jkr * tilt, soft, m, -s, 0.0)
    if not slope >= held * s:
        return hertz if displacement >= 0.0 else math.nan
    return max(z * jkr, hertz) if displacement >= 0.0 else z * jkr


def radius_at_load_reversible(load, work, stress, reversible, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at a load when adhesion pays for a fraction of the energy of the mean stress.

    Parameters
    ----------
    load : float or array
        P, compression positive [N].
    work : float or array
        w [J/m^2].
    stress : float or array
        tau, held while the contact grows or shrinks [Pa].
    reversible : float or array
        alpha [1], at least 0: MCD's 0 to 1.
    sphere_radius, modulus, poisson_ratio : float or array
        R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]: the wider, stable contact; bit for bit ``jkr.radius_at_load`` at alpha = 0; Hertz's radius
        where adhesion does not pay there; nan where a pulled contact has no equilibrium, or alpha < 0.

    Notes
    -----
    ``G(a) = w - alpha 2 (2 - nu)/(1 - nu) tau^2 a/(pi E*)``: 6 tau^2 a/(pi E*) at nu = 1/2. As ``P(X)``
    with X = 4 E* a^3/(3R) this is ``X - sqrt(6 pi R X (w - b a))``, convex in X, hence with one fold.

    Examples
    --------
    At 0.3 MPa a hundredth of the energy takes a sixth of the area, three hundredths all of adhesion:

    >>> a = radius_at_load_reversible(4e-3, 0.042, 3e5, [0.0, 0.01, 0.03], 2e-3, 6.4e6)
    >>> print("%.3f %.3f" % tuple((a[1:] / a[0]) ** 2))
    0.831 0.662
    """
    jkr = radius_at_load(load, work, sphere_radius, modulus)
    hertz = hertz_radius_at_load(load, sphere_radius, modulus)
    return _shrunk_at_load(jkr, hertz, load, work, stress, reversible, 0.0, sphere_radius, modulus, poisson_ratio)


def radius_at_indentation_reversible(indentation, work, stress, reversible, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at an indentation when adhesion pays for a fraction of the energy of the mean stress.

    Parameters
    ----------
    indentation : float or array
        delta [m].
    work, stress, reversible, sphere_radius, modulus, poisson_ratio : float or array
        As ``radius_at_load_reversible``.

    Returns
    -------
    float or array
        a [m], as ``radius_at_load_reversible``; bit for bit ``jkr.radius_at_indentation`` at alpha = 0.

    Notes
    -----
    ``delta(a) = a^2/R - sqrt(2 pi a (w - b a)/E*)`` is convex in a: a root of a concave parabola is
    subtracted. So here, too, there is one fold.

    Examples
    --------
    A lifted sphere comes off earlier:

    >>> a = radius_at_indentation_reversible(-6e-7, 0.042, 1e5, [0.0, 0.1, 0.2], 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    3.44e-05 2.57e-05 nan
    """
    jkr = radius_at_indentation(indentation, work, sphere_radius, modulus)
    hertz = hertz_radius_at_indentation(indentation, sphere_radius)
    rest = (sphere_radius, modulus, poisson_ratio)
    return shrunk_at_displacement(jkr, hertz, indentation, math.inf, work, stress, reversible, 0.0, *rest)
