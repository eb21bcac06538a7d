"""Adhesive contact of a sphere with an elastic half-space: Johnson, Kendall & Roberts, and Hertz.

A load P above 0 pushes the sphere into the half-space, so P = -F for the tractive force F of Menga, Carbone & Dini
(MCD). An indentation delta is -s for their separation s. ``modulus`` is the contact modulus E* = E/(1 - nu^2)
throughout. The contact with radius a and work of adhesion w obeys ``energy_release_rate = w``; of its two solutions
every law here returns the stable one, the wider.

The control is a load, an indentation, or a displacement ``Delta = delta + P/k`` of a base behind a spring of stiffness
k. The displacement includes both others: k = inf is an indentation, and k -> 0 at a given k Delta is a load. In names,
``_at_load`` and similar endings mean an equilibrium under that control, at a given work of adhesion. ``_under_load``
means any contact of a given radius, in equilibrium or not.

Where no equilibrium exists (pulled beyond the fold, or pulled at all without adhesion) the result
is nan. A work of zero or below, as when stress fluctuations outweigh adhesion, leaves Hertz's
contact. A nan among the numbers a result depends on makes it nan; nothing raises.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel, law
from sim.numerics.special import cube_root, rough_cube_root


@device
def twice_pull_off(work, sphere_radius):
    """Return 3 pi w R [N], twice the pull-off force."""
    return 3.0 * math.pi * work * sphere_radius


@device
def fold_radius(work, sphere_radius, modulus):
    """Return the radius at the fold of a given indentation [m], (pi w R^2 / 8 E*)^(1/3); nan for w < 0."""
    return cube_root(math.pi * work * sphere_radius * (sphere_radius / (8.0 * modulus)))


@device
def series_shares(stiffness, contact):
    """Return k/(k + b) and b/(k + b) for the stiffness k of a spring and b of the contact; nan if k < 0."""
    stiffness = stiffness + 0.0 if stiffness >= 0.0 else math.nan  # no -0
    stiffer = stiffness > contact
    high = stiffness if stiffer else contact
    low = contact if stiffer else stiffness
    larger = 1.0 / (1.0 + low / high)
    smaller = low / high * larger
    return (larger if stiffer else smaller), (smaller if stiffer else larger)


# Adhesive contact at a given load.


@law
def radius_at_load(load, work, sphere_radius, modulus):
    """Return the contact radius at a given load.

    Parameters
    ----------
    load : float or array
        P, compression positive [N].
    work : float or array
        Work of adhesion w [J/m^2].
    sphere_radius : float or array
        R [m].
    modulus : float or array
        E* [Pa].

    Returns
    -------
    float or array
        a [m]; nan below the pull-off load -3/2 pi w R; Hertz's radius where w <= 0.

    Notes
    -----
    ``a^3 = (3R/4E*) [P + c + sqrt(c (2P + c))]``, c = 3 pi w R (Johnson, Kendall & Roberts 1971; MCD
    at fixed load), with the square root of the product taken factor by factor lest it overflow.
    Towards the fold 2P + c cancels: at a relative distance d from it, a relative change e of the load
    or the work moves the radius by about e/sqrt(d).

    Examples
    --------
    A sphere of 2 mm on PDMS makes a contact without load, and pulling shrinks it by at most the
    factor (1/4)^(1/3) = 0.63:

    >>> rest = radius_at_load(0.0, 0.042, 2e-3, 6.4e6)
    >>> last = radius_at_load(pull_off_load(0.042, 2e-3), 0.042, 2e-3, 6.4e6)
    >>> print(f"{rest:.3e} {last / rest:.3f}")
    7.186e-05 0.630
    """
    # no branch but selections: the compiler turns them into vector instructions
    pull = 0.0 if work <= 0.0 else twice_pull_off(work, sphere_radius)
    root = 0.0 if pull == 0.0 else math.sqrt(pull) * math.sqrt(2.0 * load + pull)
    return cube_root(0.75 * (sphere_radius / modulus) * (load + pull + root))


@law
def load_at_radius(radius, work, sphere_radius, modulus):
    """Return the load of the equilibrium contact with a given radius [N]; Hertz's where w <= 0.

    Parameters
    ----------
    radius, work, sphere_radius, modulus : float or array
        a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``P = 4 E* a^3/(3R) - sqrt(8 pi w E* a^3)``.

    Examples
    --------
    >>> rest = radius_at_load(0.0, 0.042, 2e-3, 6.4e6)
    >>> print(f"{abs(load_at_radius(rest, 0.042, 2e-3, 6.4e6)) < 1e-15}")
    True
    """
    if not radius >= 0.0:
        return math.nan
    hertz = 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    if work <= 0.0:
        return hertz
    return hertz - radius * math.sqrt(8.0 * math.pi * work * modulus * radius)


@law
def indentation_under_load(radius, load, sphere_radius, modulus):
    """Return the indentation of any contact, in equilibrium or not, of given radius and load [m].

    Parameters
    ----------
    radius, load, sphere_radius, modulus : float or array
        a [m], P [N], R [m], E* [Pa].

    Notes
    -----
    ``delta = P/(2 E* a) + a^2/(3R)``: MCD's ``s = F/(2 E* a) - a^2/(3R)`` with delta = -s.

    Examples
    --------
    >>> print(f"{indentation_under_load(1.0, 4.0 / 3.0, 1.0, 1.0):.4f}")
    1.0000
    """
    return load / (2.0 * modulus * radius) + radius * (radius / sphere_radius) / 3.0


@law
def pull_off_load(work, sphere_radius):
    """Return the lowest load that an adhesive contact bears [N]: ``-3/2 pi w R``; 0 where w <= 0.

    Parameters
    ----------
    work, sphere_radius : float or array
        w [J/m^2], R [m]. The modulus does not matter.

    Examples
    --------
    >>> print(f"{pull_off_load(0.042, 2e-3):.3e}")
    -3.958e-04
    """
    if work <= 0.0:
        return 0.0
    return -0.5 * twice_pull_off(work, sphere_radius)


# Contact of a sphere without adhesion, after Hertz.


def hertz_radius_at_load(load, sphere_radius, modulus):
    """Return the contact radius without adhesion at a load [m]: ``(3 P R / 4 E*)^(1/3)``; nan if pulled.

    Parameters
    ----------
    load, sphere_radius, modulus : float or array
        P [N], R [m], E* [Pa].

    Examples
    --------
    >>> print(f"{hertz_radius_at_load(4.0 / 3.0, 1.0, 1.0):.3f}")
    1.000
    """
    return radius_at_load(load, 0.0, sphere_radius, modulus)


@law
def hertz_radius_at_indentation(indentation, sphere_radius):
    """Return the contact radius without adhesion at an indentation [m]: ``sqrt(R delta)``; nan if lifted.

    Parameters
    ----------
    indentation, sphere_radius : float or array
        delta [m], R [m].

    Examples
    --------
    >>> print(f"{hertz_radius_at_indentation(4e-6, 1e-2):.1e}")
    2.0e-04
    """
    return math.sqrt(indentation) * math.sqrt(sphere_radius)


# Energy release rate of the contact, and the potentials of Menga, Carbone & Dini (MCD).


@law
def energy_release_rate(radius, load, sphere_radius, modulus):
    """Return the elastic energy released per area by a shrinking contact at a load [J/m^2].

    Parameters
    ----------
    radius, load, sphere_radius, modulus : float or array
        a [m], P [N], R [m], E* [Pa].

    Notes
    -----
    ``(P_H - P)^2 / (8 pi E* a^3)`` with P_H = 4 E* a^3/(3R) the load that Hertz's contact of that
    radius needs. It equals w in equilibrium; the contact closes where it is below w, and opens
    where it is above. The sign of P_H - P is lost in the square: below P_H the edge is pulled open,
    above it the bodies would overlap at the edge.

    Examples
    --------
    >>> from sim.laws import jkr
    >>> a = jkr.radius_at_load(4e-3, 0.042, 2e-3, 6.4e6)
    >>> print(f"{energy_release_rate(a, 4e-3, 2e-3, 6.4e6):.6f}")
    0.042000
    """
    hertz = 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    missing = hertz - load
    return missing / (8.0 * math.pi * modulus * radius * radius) * (missing / radius)


def energy_release_rate_at_indentation(radius, indentation, sphere_radius, modulus):
    """Return the elastic energy released per area at an indentation [J/m^2]; otherwise as ``energy_release_rate``.

    Notes
    -----
    ``E* (delta - a^2/R)^2 / (2 pi a)``: the same number as at the load that goes with it, whatever the control.

    Examples
    --------
    >>> from sim.laws import jkr
    >>> a = jkr.radius_at_indentation(1e-6, 0.042, 2e-3, 6.4e6)
    >>> print(f"{energy_release_rate_at_indentation(a, 1e-6, 2e-3, 6.4e6):.6f}")
    0.042000
    """
    return energy_release_rate_at_displacement(
        radius, indentation, math.inf, sphere_radius, modulus
    )


@law
def potential_at_indentation(separation, stress, radius, work, sphere_radius, modulus):
    """Return MCD's potential H of the contact at a fixed separation and uniform shear stress [J].

    Parameters
    ----------
    separation, stress, radius, work, sphere_radius, modulus : float or array
        s = -delta [m], tau [Pa], a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``H = E* (a s^2 + 2 a^3 s/(3R) + a^5/(5R^2)) - 4 tau^2 a^3/E* - pi w a^2``: normal elastic
    energy, then tau W/2 - tau W (elastic energy less the Legendre term of the uniform stress, at
    nu = 1/2), then adhesion. ``dH/ds`` is the tractive force.

    Examples
    --------
    >>> print(f"{potential_at_indentation(0.0, 1.0, 1.0, 0.0, 1.0, 1.0):.2f}")
    -3.80
    """
    a, s, curvature = radius, separation, 1.0 / sphere_radius
    normal = (
        a * s * s
        + 2.0 / 3.0 * a**3 * s * curvature
        + 0.2 * a**5 * curvature * curvature
    )
    return (
        modulus * normal
        - 4.0 * stress * stress * a**3 / modulus
        - math.pi * work * a * a
    )


def potential_at_load(tractive_force, stress, radius, work, sphere_radius, modulus):
    """Return MCD's potential G at a fixed tractive force F = -P [J]; otherwise as ``potential_at_indentation``.

    Notes
    -----
    ``G = H - F s = -F^2/(4 E* a) + F a^2/(3R) + 4 E* a^5/(45 R^2) - 4 tau^2 a^3/E* - pi w a^2``.
    The sign of the second term is as the Legendre transform gives it.

    Examples
    --------
    >>> print(f"{potential_at_load(0.0, 0.0, 1.0, 0.0, 1.0, 45.0):.2f}")
    4.00
    """
    separation = -indentation_under_load(
        radius, np.negative(tractive_force), sphere_radius, modulus
    )
    whole = potential_at_indentation(
        separation, stress, radius, work, sphere_radius, modulus
    )
    return whole - tractive_force * separation


@law
def potential_slope_at_indentation(
    separation, stress, radius, work, sphere_radius, modulus
):
    """Return dH/da at fixed separation and stress [J/m]; arguments as for ``potential_at_indentation``.

    Notes
    -----
    ``E* (s + a^2/R)^2 - 12 tau^2 a^2/E* - 2 pi w a``. In equilibrium it is not zero but equals the
    work of the uniform stress, ``-12 tau^2 a^2/E*``, which leaves ``energy_release_rate = w``.

    Examples
    --------
    >>> print(f"{potential_slope_at_indentation(0.0, 1.0, 1.0, 0.0, 1.0, 1.0):.1f}")
    -11.0
    """
    missing = separation + radius * (radius / sphere_radius)
    shear = 12.0 * stress * stress * radius * radius / modulus
    return modulus * missing * missing - shear - 2.0 * math.pi * work * radius


def potential_slope_at_load(
    tractive_force, stress, radius, work, sphere_radius, modulus
):
    """Return dG/da at fixed load and stress [J/m]; arguments as for ``potential_at_load``.

    Notes
    -----
    ``(F + 4 E* a^3/(3R))^2/(4 E* a^2) - 12 tau^2 a^2/E* - 2 pi w a``.

    Examples
    --------
    >>> print(f"{potential_slope_at_load(0.0, 1.0, 1.0, 0.0, 1.0, 9.0):.4f}")
    2.6667
    """
    # with the force held, the separation changes with the radius but does no work in G
    separation = -indentation_under_load(
        radius, np.negative(tractive_force), sphere_radius, modulus
    )
    return potential_slope_at_indentation(
        separation, stress, radius, work, sphere_radius, modulus
    )


# Adhesive contact behind a spring of stiffness k: pull-off, load, indentation and energy release rate.


@device
def fold_root(grips, load):
    """Return the minimum over x > 0 of F for g = ``grips`` and 1 - g = ``load``: from 1 at grips to 3^(1/3) at a load.

    x is the root of ``2 g (x^3 - 1) + 3 (1 - g) x^2 (x^3 - 3)``. The start is a rational function with an error of
    5e-4. A step of Halley's method (1e-9) and one of Newton's follow. No branch and no call, for vector instructions.
    """
    x = (1.0001867 + load * (3.79243383 + 12.48194754 * load)) / (
        1.0 + load * (2.83851392 + 8.14055122 * load)
    )
    cube = x * x * x
    value = 2.0 * grips * (cube - 1.0) + 3.0 * load * (x * x) * (cube - 3.0)
    slope = 6.0 * grips * (x * x) + 3.0 * load * x * (5.0 * cube - 6.0)
    bend = 12.0 * grips * x + 6.0 * load * (10.0 * cube - 3.0)
    x -= 2.0 * value * slope / (2.0 * slope * slope - value * bend)
    cube = x * x * x
    value = 2.0 * grips * (cube - 1.0) + 3.0 * load * (x * x) * (cube - 3.0)
    slope = 6.0 * grips * (x * x) + 3.0 * load * x * (5.0 * cube - 6.0)
    return x - value / slope


@device
def fold_level(root, grips, load):
    """Return F at the fold: from -9 at a load to -3 at fixed grips."""
    cube = root * root * root
    return grips * root * (cube - 4.0) + load * cube * (cube - 6.0)


@device
def _fold(stiffness, work, sphere_radius, modulus):
    """x_f and a_g of the last contact, with g and 1 - g; x_f is nan for a negative stiffness, 0 where w <= 0."""
    if not stiffness >= 0.0:
        return math.nan, 1.0, 1.0, 0.0
    if work <= 0.0:
        return 0.0, 1.0, 1.0, 0.0
    unit = fold_radius(work, sphere_radius, modulus)
    grips, load = series_shares(stiffness, 4.0 / 3.0 * modulus * unit)
    return fold_root(grips, load), unit, grips, load


@law
def pull_off_displacement(stiffness, work, sphere_radius, modulus):
    """Return the lowest displacement that an adhesive contact bears behind a spring [m]; 0 where w <= 0.

    Parameters
    ----------
    stiffness, work, sphere_radius, modulus : float or array
        k [N/m], 0 to inf, w [J/m^2], R [m], E* [Pa].

    Returns
    -------
    float or array
        Delta [m], the indentation plus load/k at the last equilibrium; ``pull_off_indentation``
        at k = inf; -inf at k = 0, where no displacement can pull. ``radius_at_displacement`` is
        the radius of the last contact there, and nan just below it.

    Examples
    --------
    The softer the spring, the further the base must go back, though the contact itself ends sooner:

    >>> stiff, soft = pull_off_displacement([1e4, 100.0], 0.042, 2e-3, 6.4e6)
    >>> print(f"{stiff:.2e} {soft:.2e}")
    -7.33e-07 -4.35e-06
    """
    root, unit, grips, load = _fold(stiffness, work, sphere_radius, modulus)
    # no -0
    return fold_level(root, grips, load) * (unit * (unit / sphere_radius) / grips) + 0.0


@law
def load_under_displacement(radius, displacement, stiffness, sphere_radius, modulus):
    """Return the load of any contact, in equilibrium or not, of given radius behind a spring [N].

    Parameters
    ----------
    radius, displacement, stiffness, sphere_radius, modulus : float or array
        a [m], Delta [m], k [N/m] from 0 (no load) to inf (an indentation), R [m], E* [Pa].

    Notes
    -----
    ``P = p (Delta - a^2/(3R))/(1 + p/k)``: a contact of fixed radius is a spring of stiffness
    p = 2 E* a, in series with the other one.

    Examples
    --------
    A spring as stiff as the contact takes half of the displacement:

    >>> print(f"{load_under_displacement(1.0, 1.0, [2.0, float('inf')], 1.0, 1.0).round(4)}")
    [0.6667 1.3333]
    """
    punch = 2.0 * modulus * radius
    if not stiffness >= 0.0:
        return math.nan
    if stiffness == 0.0:
        return 0.0 * displacement * punch
    return (
        punch
        * (displacement - radius * (radius / sphere_radius) / 3.0)
        / (1.0 + punch / stiffness)
    )


@law
def indentation_under_displacement(
    radius, displacement, stiffness, sphere_radius, modulus
):
    """Return the indentation of any contact, in equilibrium or not, of given radius behind a spring [m].

    Parameters
    ----------
    radius, displacement, stiffness, sphere_radius, modulus : float or array
        a [m], Delta [m], k [N/m] from 0 to inf, R [m], E* [Pa].

    Notes
    -----
    ``delta = g Delta + (1 - g) a^2/(3R)`` with ``g = k/(k + 2 E* a)``: between the displacement and the
    depth to which an unloaded contact of that radius sinks, its value at k = 0.

    Examples
    --------
    >>> print(f"{indentation_under_displacement(1.0, 1.0, [2.0, float('inf')], 1.0, 1.0).round(4)}")
    [0.6667 1.    ]
    """
    grips, load = series_shares(stiffness, 2.0 * modulus * radius)
    return grips * displacement + load * (radius * (radius / sphere_radius) / 3.0)


@law
def energy_release_rate_at_displacement(
    radius, displacement, stiffness, sphere_radius, modulus
):
    """Return the elastic energy released per area by a shrinking contact behind a spring [J/m^2].

    Parameters
    ----------
    radius, displacement, stiffness, sphere_radius, modulus : float or array
        a [m], Delta [m], k [N/m] from 0 to inf, R [m], E* [Pa].

    Notes
    -----
    ``E* (delta - a^2/R)^2/(2 pi a)`` as at an indentation, with the indentation of that displacement:
    ``a^2/R - delta = g (a^2/R - Delta) + (1 - g) 2a^2/(3R)``, g = k/(k + 2 E* a). The energy of the
    spring is included.

    Examples
    --------
    >>> a = 1e-4
    >>> between = energy_release_rate_at_displacement(a, 1e-6, [0.0, 1e3, float("inf")], 2e-3, 6.4e6)
    >>> print("%.3f %.3f %.3f" % tuple(between))
    0.113 0.134 0.163
    """
    grips, load = series_shares(stiffness, 2.0 * modulus * radius)
    hertz = radius * (radius / sphere_radius)
    missing = grips * (hertz - displacement) + load * (2.0 / 3.0 * hertz)
    return missing * modulus / (2.0 * math.pi * radius) * missing


# Adhesive contact at a displacement behind a spring of any stiffness: one compiled solver.


@device
def _first_guess(excess, second, fourth, sixth, root, floor):
    """The root t >= 0 of F(root + t) - F(root) = excess, from 7 % too small to 12 % too large.

    The smaller of two numbers, times 0.97. The one is exact near the fold, where t^2 rules, and where t^4 does: of
    the left side f_2 t^2 + ... + f_6 t^6 it keeps the square of sqrt(f_2) t + sqrt(f_4) t^2. The other
    is right where x^6 prevails, and never below the root: x^4 - 4x is -3 at least.
    """
    level, linear, square = math.sqrt(excess), math.sqrt(second), math.sqrt(fourth)
    near = 2.0 * level / (linear + math.sqrt(second + 4.0 * square * level))
    shift = 3.0 if second > 0.0 else 0.0
    far = (
        1.0003 * rough_cube_root(shift + math.sqrt(excess + floor) / math.sqrt(sixth))
        - root
    )
    guess = 0.97 * (far if far < near else near)
    return guess if excess > 0.0 else 0.0


@device
def _sums(t, second, third, fourth, fifth, sixth):
    """f_2 t^2 + ... + f_6 t^6, and its slope times t."""
    square = t * t
    value = square * (second + t * (third + t * (fourth + t * (fifth + t * sixth))))
    slope = 2.0 * second + t * (
        3.0 * third + t * (4.0 * fourth + t * (5.0 * fifth + t * 6.0 * sixth))
    )
    return value, square * slope


@kernel(
    "void(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1])"
)
def _solve(displacements, stiffnesses, works, sphere_radii, moduli, radii):
    """Radii for flat arrays, see ``radius_at_displacement``.

    No branch but selections, no call and no loop that ends early: the compiler turns the whole body into
    vector instructions, which makes it fourteen times faster.
    """
    for i in range(radii.size):
        displacement, stiffness, work, sphere_radius, modulus = (
            displacements[i],
            stiffnesses[i],
            works[i],
            sphere_radii[i],
            moduli[i],
        )
        unit = fold_radius(work, sphere_radius, modulus)
        depth = unit * (unit / sphere_radius)
        # else adhesion is lost in rounding
        sticks = work > 0.0 and depth > 1e-300 and displacement / depth < 1e290
        unit = unit if sticks else sphere_radius
        depth = depth if sticks else sphere_radius
        contact = 4.0 / 3.0 * modulus * unit
        grips, load = series_shares(stiffness, contact)
        root = fold_root(grips, load)
        level = fold_level(root, grips, load) if sticks else 0.0
        root = root if sticks else 0.0
        last = level * (depth / grips)
        excess = (
            (displacement - last) * (grips / depth)
            if last > -1e300
            else grips * (displacement / depth) - level
        )
        cube = root * root * root
        second = 6.0 * grips * root * root + load * root * (15.0 * cube - 18.0)
        third = 4.0 * grips * root + load * (20.0 * cube - 6.0) if sticks else 0.0
        fourth = grips + 15.0 * load * root * root
        fifth = 6.0 * load * root
        # >= 0 but for rounding
        floor = level + 3.0 * grips + 9.0 * load + 1e-14 if sticks else 0.0
        t = _first_guess(excess, second, fourth, load, root, floor)
        value, slope = _sums(t, second, third, fourth, fifth, load)
        share = excess / value
        nearer = t * (
            ((slope + value) * share + (slope - value))
            / ((slope - value) * share + (slope + value))
        )
        t = nearer if nearer > 0.0 else t  # nan where t is 0 or infinite
        for _ in range(3):
            value, slope = _sums(t, second, third, fourth, fifth, load)
            nearer = t - t * ((value - excess) / slope)
            t = nearer if nearer > 0.0 else t
        known = (
            excess >= 0.0
            and stiffness >= 0.0
            and sphere_radius > 0.0
            and modulus > 0.0
            and work < math.inf
        )
        known = (
            known
            and 1e-300 < contact < math.inf
            and (excess < math.inf or displacement == math.inf)
        )
        known = known and (
            sticks or excess > 0.0 or displacement == 0.0 or stiffness == 0.0
        )
        radius = unit * (root + t) * (root + t)
        if load == 0.0 and not sticks:
            # of any size: no product leaves the numbers
            radius = math.sqrt(displacement) * math.sqrt(sphere_radius)
        radii[i] = radius if known else math.nan


def radius_at_displacement(displacement, stiffness, work, sphere_radius, modulus):
    """Return the contact radius at a prescribed displacement behind a spring of given stiffness.

    Parameters
    ----------
    displacement : float or array
        Delta = delta + P/k [m]; below 0 the base pulls.
    stiffness : float or array
        k [N/m], 0 to inf.
    work : float or array
        Work of adhesion w [J/m^2].
    sphere_radius : float or array
        R [m].
    modulus : float or array
        E* [Pa].

    Returns
    -------
    float or array
        a [m]; nan below ``pull_off_displacement`` and for a negative stiffness. At k = inf the radius at the
        indentation Delta, at k = 0 the radius without load, for no displacement can then press or pull. Where
        w <= 0 Hertz's radius, the root of ``a^2/R + 4 E* a^3/(3 R k) = Delta``.

    Notes
    -----
    The sextic ``g (x^4 - 4x) + (1 - g) (x^6 - 6x^3) = g Delta/h`` in x = sqrt(a/a_g) has a_g =
    (pi w R^2/8 E*)^(1/3), h = a_g^2/R and g = k/(k + 4 E* a_g/3). Call its left side F.

    *One fold.* ``F' = 6 (1-g) x^5 + 4 g x^3 - 18 (1-g) x^2 - 4 g`` changes sign once in its coefficients, so
    by Descartes' rule it has one root x_f > 0 (between 1 and 3^(1/3)); F falls before and grows after it.
    The stable contact is the one root right of x_f, and exists if ``excess = g Delta/h - F(x_f) >= 0``.

    *Convex beyond it.* ``F'' = 6x [5 (1-g) x^3 + 2 g x - 6 (1-g)]`` has a growing bracket, thus changes sign
    at most once, from - to +. Up to there F' falls from ``-4g <= 0``, so x_f lies right of it.

    *Newton's method never fails.* Measured from the fold, x = x_f + t, the sextic ``f_2 t^2 + ... + f_6 t^6 =
    excess`` has no negative term: a step from any t > 0 ends right of the root or on it, and from there each goes
    left and none passes it. A first guess within 12 % for any g and excess, one step of third order that is exact for
    a power of t, and three of Newton's leave less than 1e-15; their number is fixed. Towards the fold only the excess
    cancels: at a relative distance d from it, a relative change e of an input moves the radius by about e/sqrt(d).

    Where w R, R/E*, a_g^3 or a_g^2/R leave the range of numbers, adhesion is left out or the answer is nan.

    Examples
    --------
    The same displacement pulls the sphere off behind a stiff spring, not behind a soft one:

    >>> a = radius_at_displacement(-9e-7, [100.0, 1e3, float("inf")], 0.042, 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    6.68e-05 3.83e-05 nan
    """
    arguments = displacement, stiffness, work, sphere_radius, modulus
    radii = np.empty(np.broadcast(*arguments).shape)
    rows = np.empty((5, *radii.shape))
    for row, value in enumerate(arguments):
        rows[row] = value
    _solve(*rows.reshape(5, -1), radii.reshape(-1))
    return radii[()]


# Adhesive contact at a given indentation ("fixed grips").


def radius_at_indentation(indentation, work, sphere_radius, modulus):
    """Return the contact radius at a given indentation ("fixed grips").

    Parameters
    ----------
    indentation : float or array
        delta [m]; below 0 the sphere is lifted and hangs by a neck.
    work : float or array
        Work of adhesion w [J/m^2].
    sphere_radius : float or array
        R [m].
    modulus : float or array
        E* [Pa].

    Returns
    -------
    float or array
        a [m]; nan below ``pull_off_indentation``; Hertz's radius where w <= 0.

    Notes
    -----
    ``a^2/R - delta = sqrt(2 pi w a/E*)`` is a quartic in sqrt(a), ``x^4 - c x - d = 0``, with a
    double root at the fold a_f, delta_f = -3 a_f^2/R. Measured from there, sqrt(a) = (1 + t)
    sqrt(a_f) and delta = delta_f (1 - excess), it holds no other parameter:

        ``t^2 (6 + 4 t + t^2) = 3 excess``

    The wider, stable contact is its one root t >= 0, for lifted and pressed spheres alike: that of
    ``radius_at_displacement`` behind an infinite stiffness. Its accuracy ends only where the excess itself
    cancels: at a relative distance d from the fold, a relative change e of an input moves the radius by
    about e/sqrt(d).

    Examples
    --------
    A sphere lifted above the surface keeps its contact up to a point:

    >>> a = radius_at_indentation([0.0, -6e-7, -8e-7], 0.042, 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    5.48e-05 3.44e-05 nan
    """
    return radius_at_displacement(indentation, np.inf, work, sphere_radius, modulus)


@law
def indentation_at_radius(radius, work, sphere_radius, modulus):
    """Return the indentation of the equilibrium contact with a given radius [m]; Hertz's where w <= 0.

    Parameters
    ----------
    radius, work, sphere_radius, modulus : float or array
        a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``delta = a^2/R - sqrt(2 pi w a/E*)``.

    Examples
    --------
    >>> print(f"{indentation_at_radius(1e-4, 0.0, 2e-3, 6.4e6):.1e}")
    5.0e-06
    """
    if not radius >= 0.0:
        return math.nan
    hertz = radius * (radius / sphere_radius)
    if work <= 0.0:
        return hertz
    return hertz - math.sqrt(2.0 * math.pi * work * (radius / modulus))


def load_under_indentation(radius, indentation, sphere_radius, modulus):
    """Return the load of any contact, in equilibrium or not, of given radius and indentation [N].

    Parameters
    ----------
    radius, indentation, sphere_radius, modulus : float or array
        a [m], delta [m], R [m], E* [Pa].

    Notes
    -----
    ``P = 2 E* a (delta - a^2/(3R))``: MCD's ``F = E* (2 s a + 2 a^3/(3R))`` with P = -F.

    Examples
    --------
    Hertz's contact carries two thirds of what a flat punch of its radius would:

    >>> print(f"{load_under_indentation(1.0, 1.0, 1.0, 1.0):.4f}")
    1.3333
    """
    return load_under_displacement(
        radius, indentation, math.inf, sphere_radius, modulus
    )


def pull_off_indentation(work, sphere_radius, modulus):
    """Return the lowest indentation that an adhesive contact bears at fixed grips [m]; 0 where w <= 0.

    Parameters
    ----------
    work, sphere_radius, modulus : float or array
        w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``-3 a^2/R`` at ``a = (pi w R^2/(8 E*))^(1/3)``. The load there is 5/9 of the pull-off load.

    Examples
    --------
    >>> print(f"{pull_off_indentation(0.042, 2e-3, 6.4e6):.3e}")
    -7.105e-07
    """
    return pull_off_displacement(math.inf, work, sphere_radius, modulus)
