"""JKR contact whose adhesion also pays a share alpha of the elastic energy of the mean shear stress.

A contact that grows by dA under a uniform stress tau stores ``6 tau^2 a/(pi E*) dA`` (at nu = 1/2,
``mean_stress_energy``). In Menga, Carbone & Dini (MCD) the drive supplies all of it, alpha = 0. At alpha = 1 sliding is
reversible and adhesion supplies all of it. With G the energy release rate of the normal load alone
(``jkr.energy_release_rate``) the contact obeys ``G(a) = w - alpha 6 tau^2 a/(pi E*)``.

**One crossing.** G(a) is convex in a at a load, at an indentation and behind a spring of any stiffness. At a load it is
``(X - 2P + P^2/X)/(6 pi R)`` with X = 4 E* a^3/(3R), at an indentation ``E*/(2 pi) (a^3/R^2 - 2 delta a/R +
delta^2/a)``. The right side is a straight line in a. So there are at most two crossings, and only the wider one is
stable. There G rises above the line, and the slope of the line is dw/da in the stability condition. Newton's method
from the right of it goes left and never passes it. A step that does not go left is rounding and ends the search; a
slope that is not positive means that there is no crossing.

**Never below Hertz.** The edge can pull but not push: where adhesion does not pay for the shear even at Hertz's radius,
the contact has that radius. It does so under a load or an indentation of at least zero, beyond the last adhesive state.
A contact under tension detaches there, and the result is nan.
"""

import math

from sim.laws import jkr
from sim.numerics.jit import device, law

__all__ = [
    "mean_stress_energy",
    "radius_at_displacement_reversible",
    "radius_at_indentation_reversible",
    "radius_at_load_reversible",
]


@device
def compressible(poisson_ratio):
    """Return the shear energy at a given stress and modulus E*, over that at nu = 1/2: (2 - nu)/(3 (1 - nu))."""
    return (2.0 - poisson_ratio) / (3.0 * (1.0 - poisson_ratio))


@law
def mean_stress_energy(radius, stress, modulus, poisson_ratio=0.5):
    """Return the elastic energy of the mean shear stress per area of new contact [J/m^2].

    Parameters
    ----------
    radius, stress, modulus, poisson_ratio : float or array
        a [m], tau [Pa], E* [Pa], nu [1].

    Notes
    -----
    ``2 (2 - nu)/(1 - nu) tau^2 a/(pi E*)``, 6 tau^2 a/(pi E*) at nu = 1/2: the stress times
    ``halfspace.disc_edge_mean_displacement``. Over the whole disc its mean is two thirds of it.

    Examples
    --------
    At 0.3 MPa the contact of a PDMS lens stores 77 times a work of adhesion of 42 mJ/m^2:

    >>> print(f"{mean_stress_energy(1.2e-4, 3e5, 6.4e6) / 0.042:.1f}")
    76.7
    """
    return (
        6.0
        / math.pi
        * compressible(poisson_ratio)
        * (stress * stress)
        * radius
        / modulus
    )


@device
def crossing(z, level, hard, m, s):
    """Return the largest z with missing^2/z = m + s z and the slope there, from a z right of it; nan if none.

    missing = (hard z^2 + (2/3) soft z^3 - level)/(hard + soft z), soft = 1 - hard, is a^2/R - delta behind a spring of
    stiffness 2 E* hard/soft. An indentation has hard = 1, a load hard = 0. ``level`` is where missing is 0.
    """
    slope = math.nan
    soft = 1.0 - hard
    for _ in range(100):
        square = z * z
        share = hard + soft * z
        missing = (hard * square - level + 2.0 / 3.0 * soft * square * z) / share
        over = missing / z * missing - m - s * z
        growth = 2.0 * z - soft * missing / share
        slope = missing / z * (2.0 * growth - missing / z) - s
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
def _shrunk(
    jkr,
    hertz,
    control,
    level,
    hard,
    work,
    stress,
    reversible,
    held,
    sphere_radius,
    modulus,
    poisson_ratio,
):
    """Contact radius at a load or a displacement, ``control``, of a ``level`` as in ``crossing``."""
    if (
        reversible == 0.0
        or stress == 0.0
        or work <= 0.0
        or not jkr > 0.0
        or jkr == math.inf
    ):
        return jkr
    tilt = sphere_radius / jkr
    shear = stress / modulus * tilt
    s = 12.0 * reversible * compressible(poisson_ratio) * shear * shear
    if not s >= 0.0:
        return math.nan
    m = 2.0 * math.pi * (work / modulus / jkr) * tilt * tilt
    start = min(1.0, m / s)
    if control >= 0.0 and not start * jkr > hertz:
        return hertz
    z, slope = crossing(start, level, hard, m, -s)
    if not slope >= held * s:
        return hertz if control >= 0.0 else math.nan
    return max(z * jkr, hertz) if control >= 0.0 else z * jkr


@law
def shrunk_at_load(
    jkr,
    hertz,
    load,
    work,
    stress,
    reversible,
    held,
    sphere_radius,
    modulus,
    poisson_ratio,
):
    """Return the contact radius at a load from those of JKR and Hertz; ``held`` as in ``shrunk_at_displacement``."""
    level = 0.5 * (load / modulus / jkr) * (sphere_radius / jkr / jkr)
    rest = (sphere_radius, modulus, poisson_ratio)
    return _shrunk(jkr, hertz, load, level, 0.0, work, stress, reversible, held, *rest)


@law
def shrunk_at_displacement(
    jkr,
    hertz,
    displacement,
    stiffness,
    work,
    stress,
    reversible,
    held,
    sphere_radius,
    modulus,
    poisson_ratio,
):
    """Return the contact radius at a displacement behind a spring, from those of JKR and Hertz.

    Parameters
    ----------
    jkr, hertz : float or array
        Radii at the same displacement without shear, with the work of adhesion and with none [m].
    displacement, stiffness : float or array
        Delta = delta + P/k [m], k [N/m]; k = inf prescribes the indentation.
    work, stress, reversible, sphere_radius, modulus, poisson_ratio : float or array
        As ``radius_at_load_reversible``.
    held : float
        0 if the stress stays the same as the edge moves, 4 if the tangential force does.

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
    hard = 1.0 / (1.0 + 2.0 * modulus * jkr / stiffness)
    level = hard * (displacement / jkr * (sphere_radius / jkr))
    rest = (sphere_radius, modulus, poisson_ratio)
    return _shrunk(
        jkr, hertz, displacement, level, hard, work, stress, reversible, held, *rest
    )


def radius_at_load_reversible(
    load, work, stress, reversible, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load when adhesion pays a share of the energy of the mean stress.

    Parameters
    ----------
    load : float or array
        P, compression positive [N].
    work : float or array
        w [J/m^2].
    stress : float or array
        tau [Pa], the same while the contact grows or shrinks.
    reversible : float or array
        alpha [1], at least 0; MCD's is 0.
    sphere_radius, modulus, poisson_ratio : float or array
        R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]: the wider, stable contact; bit for bit ``jkr.radius_at_load`` at alpha = 0; Hertz's radius
        where adhesion does not pay there; nan where a pulled contact has no equilibrium, or alpha < 0.

    Notes
    -----
    ``G(a) = w - alpha mean_stress_energy(a)``. As ``P(X)`` with X = 4 E* a^3/(3R) this is
    ``X - sqrt(6 pi R X (w - b a))``, convex in X, hence with one fold.

    Examples
    --------
    At 0.3 MPa a hundredth of the energy takes a sixth of the area, three hundredths all of adhesion:

    >>> a = radius_at_load_reversible(4e-3, 0.042, 3e5, [0.0, 0.01, 0.03], 2e-3, 6.4e6)
    >>> print("%.3f %.3f" % tuple((a[1:] / a[0]) ** 2))
    0.831 0.662
    """
    adhesive = jkr.radius_at_load(load, work, sphere_radius, modulus)
    hertz = jkr.hertz_radius_at_load(load, sphere_radius, modulus)
    return shrunk_at_load(
        adhesive,
        hertz,
        load,
        work,
        stress,
        reversible,
        0.0,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


def radius_at_indentation_reversible(
    indentation, work, stress, reversible, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at an indentation [m]; otherwise as ``radius_at_load_reversible``.

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
    rest = (sphere_radius, modulus, poisson_ratio)
    return radius_at_displacement_reversible(
        indentation, math.inf, work, stress, reversible, *rest
    )


def radius_at_displacement_reversible(
    displacement,
    stiffness,
    work,
    stress,
    reversible,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
):
    """Return the contact radius at a displacement behind a spring [m]; otherwise as ``radius_at_load_reversible``.

    Examples
    --------
    >>> a = radius_at_displacement_reversible(-6e-7, 1e4, 0.042, 1e5, [0.0, 0.1, 0.2], 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    3.64e-05 2.76e-05 nan
    """
    adhesive = jkr.radius_at_displacement(
        displacement, stiffness, work, sphere_radius, modulus
    )
    hertz = jkr.radius_at_displacement(
        displacement, stiffness, 0.0, sphere_radius, modulus
    )
    rest = (sphere_radius, modulus, poisson_ratio)
    return shrunk_at_displacement(
        adhesive, hertz, displacement, stiffness, work, stress, reversible, 0.0, *rest
    )
