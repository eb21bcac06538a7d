"""Competing theories of the radius of an adhesive contact under shear.

They differ in what becomes of the elastic energy of the tangential stress when the contact grows.
At nu = 1/2, with G the release rate of the normal load alone (``jkr.energy_release_rate``), T the
tangential force, tau = T/(pi a^2) the mean shear stress and E* the contact modulus:

    ``G = w``                           JKR, MCD as corrected: the drive pays, the contact feels nothing
    ``G = w + 6 tau^2 a/(pi E*)``       MCD as first published in 2018: the contact grows
    ``G + 3 T^2/(16 pi E* a^3) = w``    Savkoor & Briggs 1977: full stick at a given force
    ``G + 2 T^2/(pi^3 E* a^3) = w``     uniform stress, reversible, constant force: adhesion pays for all of it
    ``G + 6 tau^2 a/(pi E*) = w``       uniform stress, reversible, constant stress
    ``G + alpha 6 tau^2 a/(pi E*) = w`` a reversible share alpha (``sim.laws.reversible``)
    ``G + G_s = w f(psi)``              mixed-mode fracture, G_s as Savkoor & Briggs'

MCD is Menga, Carbone & Dini. The two laws at a constant force differ by 32/(3 pi^2) = 1.08 in energy. Both have the
radius of the reversible law at alpha = pi^2/32 and 1/3, but are less stable, because T is constant and not tau. For
another Poisson ratio all shear terms gain the factor (2 - nu)/(3 (1 - nu)). The coupling of normal and tangential
fields is neglected.

The terms in T^2/a^3 are convex in a, so that each theory has one stable radius at most, found and
bounded by Hertz's as in ``sim.laws.reversible``.

**Mixed-mode fracture.** The edge toughens as its mode turns to shear.
With G the release rate of the normal load alone (``jkr.energy_release_rate``), G_s that of a tangential force T
in full stick, averaged around the edge as Savkoor & Briggs do, and psi the mode angle,

    ``G_s = 3 T^2/(16 pi E* a^3)`` at nu = 1/2,  ``tan^2 psi = G_s/G``,  ``G + G_s = w f(psi)``,

interfaces are described by one of three functions of a mixity lambda from 0 to 1 (Hutchinson & Suo 1992; Johnson
1997; Waters & Guduru 2010; compared by Papangelo & Ciavarella 2018):

    ``f = 1 + tan^2((1 - lambda) psi)``            scaled angle
    ``f = 1/(1 + (lambda - 1) sin^2 psi)``         shear share, which is ``G + lambda G_s = w``
    ``f = 1 + (1 - lambda) tan^2 psi``             scaled tangent

All are Savkoor & Briggs' theory at lambda = 1 and JKR's at 0. Shear is added to G as ``lambda (2 - lambda) G_s``,
``lambda G_s`` and ``lambda G_s``, to second order in the force. For another Poisson ratio G_s gains the factor (2 -
nu)/(3 (1 - nu)). The coupling of normal and tangential fields is neglected.

**One search.** With y = cot psi each law is ``w/G_s = F(y)``. The three F(y) are ``cos^2((1 - lambda) psi) (1 + y^2)``,
``y^2 + lambda`` and ``y^2 + lambda y^2/(y^2 + 1 - lambda)``. Under a given force y gives the radius, ``a^3 = T^2 F/4``.
The load is ``a^3 - sqrt(3/2) T y`` and the indentation ``a^2 - sqrt(2/3) T y/a``. Units are those of Maugis: pi w R for
forces, (3 pi w R^2/4 E*)^(1/3) for a, a^2/R for the indentation. The contact is stable where load and indentation grow
with y, the widest one at the largest y. For the first two laws they fall to one minimum and grow from there on: F is
convex and y F'/F grows with y. The third may have an outer and an inner stable branch when lambda is near 1. So the
search goes left from the JKR radius by Newton steps, none longer than a fifth of y. After each minimum it looks for a
crossing.
"""

import math

import numpy as np

from sim.laws import jkr
from sim.laws.equilibrium import largest_radius
from sim.laws.jkr import twice_pull_off
from sim.laws.reversible import compressible, energy_per_radius, shrunk, tilt_of_stress
from sim.numerics.jit import device, law
from sim.numerics.special import cube_root

_ANGLE, _SHARE, _TANGENT = 0.0, 1.0, 2.0
_LOAD, _INDENTATION = 1.0, 0.0
_SHEAR = math.sqrt(1.5)  # of T y in the load
#: Longest step of the search, over y, and most steps: beyond them y is below the rounding of its start.
_KEPT, _MOST = 0.8, 200
_NO_FORCE = 1e100  # y at which a force changes no digit


@device
def _toughness(y, mixity, which):
    """w/G_s at the mode angle arccot y, and its slope."""
    if which == _ANGLE:
        angle = (1.0 - mixity) * math.atan2(1.0, y)
        cosine = math.cos(angle)
        slope = (1.0 - mixity) * math.sin(2.0 * angle) + 2.0 * cosine * cosine * y
        return cosine * cosine * (1.0 + y * y), slope
    if which == _SHARE:
        return y * y + mixity, 2.0 * y
    rest = y * y + (1.0 - mixity)
    return y * y * (1.0 + mixity / rest), 2.0 * y * (
        1.0 + mixity * (1.0 - mixity) / (rest * rest)
    )


@device
def _held(y, force, mixity, which, control):
    """Load or indentation of the state at y, its slope, and the cube of the radius."""
    toughness, growth = _toughness(y, mixity, which)
    cube = 0.25 * force * force * toughness
    slope = 0.25 * force * growth - _SHEAR
    if control == _LOAD:
        return cube - _SHEAR * force * y, force * slope, cube
    radius = cube_root(cube)
    level = radius * radius - 2.0 / 3.0 * _SHEAR * force * y / radius
    return (
        level,
        2.0 / 3.0 * force / radius * (slope + _SHEAR / 3.0 * y * growth / toughness),
        cube,
    )


@device
def _sign_change(low, high, of_slope, level, force, mixity, which, control):
    """The y between two at which the level, or its slope, goes from below to above; the upper of two neighbours."""
    while True:
        y = 0.5 * (low + high)
        if not low < y < high:
            return high
        value, slope, _ = _held(y, force, mixity, which, control)
        if (slope if of_slope else value - level) > 0.0:
            high = y
        else:
            low = y


@device
def _widest(y, level, force, mixity, which, control):
    """Cube of the radius of the widest state at a level, from a y right of it; nan if there is none."""
    value, slope, cube = _held(y, force, mixity, which, control)
    for _ in range(_MOST):
        if not value > level:
            return cube
        lower = (
            max(y - (value - level) / slope, _KEPT * y) if slope > 0.0 else _KEPT * y
        )
        if not lower < y:
            return cube
        before = slope
        value, slope, cube = _held(lower, force, mixity, which, control)
        bottom = lower
        if value > level and slope < 0.0 < before:
            bottom = _sign_change(lower, y, True, level, force, mixity, which, control)
        if not (_held(bottom, force, mixity, which, control)[0] > level):
            y = _sign_change(bottom, y, False, level, force, mixity, which, control)
            return _held(y, force, mixity, which, control)[2]
        y = lower
    return math.nan


@law
def _unit(work, sphere_radius, modulus):
    """Maugis' unit of the radius; nan or not positive without adhesion."""
    return cube_root(0.75 * math.pi * work * sphere_radius * (sphere_radius / modulus))


@law
def _in_units(force, work, sphere_radius, poisson_ratio=0.5):
    """A force in Maugis' unit; of a tangential one that with the same energy at nu = 1/2."""
    scale = math.pi * work * sphere_radius
    return force / scale * math.sqrt(compressible(poisson_ratio))


@law
def _depth_in_units(indentation, unit, sphere_radius):
    """An indentation in Maugis' unit."""
    return indentation / unit * (sphere_radius / unit)


@law
def _radius(jkr, hertz, held, force, mixity, which, control, unit):
    """Contact radius at a load or an indentation from those of JKR and Hertz; ``held`` and ``force`` are in units."""
    if not 0.0 <= mixity <= 1.0:
        return math.nan
    if (
        force == 0.0
        or mixity == 0.0
        or not unit > 0.0
        or not jkr > 0.0
        or jkr == math.inf
    ):
        return jkr
    # F >= y^2: a state of JKR's radius or more
    start = 2.0 * math.sqrt(jkr / unit) * (jkr / unit) / abs(force)
    if start > _NO_FORCE:
        return jkr
    radius = unit * cube_root(_widest(start, held, abs(force), mixity, which, control))
    if not held >= 0.0:
        return radius
    return radius if radius > hertz else hertz


def _mixed_at_load(
    which, load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio
):
    jkr, hertz, *_ = _at_load(load, work, sphere_radius, modulus)
    held = _in_units(load, work, sphere_radius)
    force = _in_units(tangential_force, work, sphere_radius, poisson_ratio)
    unit = _unit(work, sphere_radius, modulus)
    return _radius(jkr, hertz, held, force, mixity, which, _LOAD, unit)


def _mixed_at_depth(
    which,
    indentation,
    work,
    tangential_force,
    mixity,
    sphere_radius,
    modulus,
    poisson_ratio,
):
    jkr, hertz, *_ = _at_indentation(indentation, work, sphere_radius, modulus)
    unit = _unit(work, sphere_radius, modulus)
    held = _depth_in_units(indentation, unit, sphere_radius)
    force = _in_units(tangential_force, work, sphere_radius, poisson_ratio)
    return _radius(jkr, hertz, held, force, mixity, which, _INDENTATION, unit)


def scaled_angle_at_load(
    load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load and a tangential force by ``f = 1 + tan^2((1 - lambda) psi)``.

    Parameters
    ----------
    load, work, tangential_force : float or array
        P [N], w [J/m^2], T [N] of either sign.
    mixity : float or array
        lambda [1] from 0 (JKR) to 1 (Savkoor & Briggs).
    sphere_radius, modulus, poisson_ratio : float or array
        R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]; Hertz's radius (nan if pulled) beyond the largest force that adhesion bears, nan for any other lambda.

    Examples
    --------
    At a limit a lightly pressed contact loses what is left of adhesion at once, one that is pressed more has lost it:

    >>> for load, limit in (3.0, 22.2491), (300.0, 198.6932):
    ...     a = scaled_angle_at_load(load, 1.0, [0.0, limit, limit + 1e-3], 0.2, 1.0, 0.75)
    ...     print("%.3f %.3f %.3f" % tuple(a))
    2.904 1.973 1.442
    7.276 6.694 6.694
    """
    return _mixed_at_load(
        _ANGLE,
        load,
        work,
        tangential_force,
        mixity,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


def scaled_angle_at_indentation(
    indentation,
    work,
    tangential_force,
    mixity,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
):
    """Return the contact radius at an indentation and a tangential force [m], as ``scaled_angle_at_load``."""
    return _mixed_at_depth(
        _ANGLE,
        indentation,
        work,
        tangential_force,
        mixity,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


def shear_share_at_load(
    load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load by ``G + lambda G_s = w`` [m], as ``scaled_angle_at_load``.

    Notes
    -----
    ``f = 1/(1 + (lambda - 1) sin^2 psi)``: Savkoor & Briggs' radius at the force ``sqrt(lambda) T``. It jumps to
    Hertz's at ``savkoor_briggs_limit/sqrt(lambda)``.
    """
    return _mixed_at_load(
        _SHARE,
        load,
        work,
        tangential_force,
        mixity,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


def shear_share_at_indentation(
    indentation,
    work,
    tangential_force,
    mixity,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
):
    """Return the contact radius at an indentation and a tangential force [m], as ``shear_share_at_load``."""
    return _mixed_at_depth(
        _SHARE,
        indentation,
        work,
        tangential_force,
        mixity,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


def scaled_tangent_at_load(
    load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load and a tangential force by ``f = 1 + (1 - lambda) tan^2 psi`` [m].

    Otherwise as ``scaled_angle_at_load``. A share 1 - lambda of adhesion remains at any force. The radius therefore
    tends to the JKR radius at ``(1 - lambda) w`` and never to the Hertz radius. Only a contact with a pull beyond the
    limit of this work detaches.

    Examples
    --------
    >>> for force in (1.0, 10.0, 1000.0):
    ...     print(f"{scaled_tangent_at_load(5.0, 1.0, force, 0.5, 1.0, 4.0):.4f}")
    1.7365
    1.6816
    1.5011
    >>> print(f"{jkr.radius_at_load(5.0, 0.5, 1.0, 4.0):.4f}")
    1.5011
    """
    return _mixed_at_load(
        _TANGENT,
        load,
        work,
        tangential_force,
        mixity,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


def scaled_tangent_at_indentation(
    indentation,
    work,
    tangential_force,
    mixity,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
):
    """Return the contact radius at an indentation and a tangential force [m], as ``scaled_tangent_at_load``."""
    return _mixed_at_depth(
        _TANGENT,
        indentation,
        work,
        tangential_force,
        mixity,
        sphere_radius,
        modulus,
        poisson_ratio,
    )


# Competing theories of the radius of an adhesive contact under shear.


_STICK = 1.5  # of T^2 in the energy balance at a load: full stick,
_UNIFORM = 16.0 / math.pi**2  # and uniform stress
_AS_STICK = math.pi**2 / 32.0  # alpha at a constant stress that gives the same radii
_AS_UNIFORM = 1.0 / 3.0
# most steps to the force of a stress, every other a halving, and when it is known
_STEPS, _ROUNDING = 100, 1e-14


@device
def _largest_force(load, work, sphere_radius, share):
    """Tangential force at which the contact at a load ends: sqrt(c (2P + c)/share), c = 3 pi w R [N]."""
    pull = twice_pull_off(work, sphere_radius)
    return math.sqrt(pull) * math.sqrt(2.0 * load + pull) / math.sqrt(share)


@law
def _stuck_load(load, work, tangential_force, share, sphere_radius, poisson_ratio):
    """Load at which Hertz's contact is as wide as that with ``share`` T^2 in the energy balance at a load."""
    pull = 0.0 if work <= 0.0 else twice_pull_off(work, sphere_radius)
    if pull == 0.0:
        return load
    if tangential_force == 0.0:
        return load + pull + math.sqrt(pull) * math.sqrt(2.0 * load + pull)
    share *= compressible(poisson_ratio)
    limit = _largest_force(load, work, sphere_radius, share)
    force = abs(tangential_force)
    if force > limit:
        return load if load >= 0.0 else math.nan
    rest = math.sqrt(share) * math.sqrt(limit - force) * math.sqrt(limit + force)
    return load + pull + rest


def _stuck_at_load(
    load, work, tangential_force, share, sphere_radius, modulus, poisson_ratio
):
    """Contact radius at a load, with ``share`` T^2 in the energy balance."""
    equal = _stuck_load(
        load, work, tangential_force, share, sphere_radius, poisson_ratio
    )
    return jkr.hertz_radius_at_load(equal, sphere_radius, modulus)


@device
def _widened(
    normal, control, hard, work, stress, sphere_radius, modulus, poisson_ratio
):
    """Contact radius at a load or an indentation, ``control``, at whose size Hertz's is ``normal``."""
    adhesive = cube_root(
        2.0 * math.pi * abs(work) * sphere_radius * (sphere_radius / modulus)
    )
    tilt = energy_per_radius(stress, modulus, poisson_ratio)
    most = normal + adhesive + math.sqrt(2.0 * math.pi * tilt / modulus) * sphere_radius
    if most == 0.0 or not most < math.inf:
        return most
    mount = (0.0, control, math.inf) if hard == 1.0 else (control, 0.0, 0.0)
    body = 1.0 / sphere_radius, modulus, 0.0
    # in units of ``most`` all terms are at most 1, and the radius is at most 2.1 at a load, else 1.9
    radius, _ = largest_radius(2.1 * most, work, -tilt, mount, body)
    return max(normal, radius) if control >= 0.0 else radius


@law
def uncorrected_at_load(load, work, stress, sphere_radius, modulus, poisson_ratio=0.5):
    """Return the contact radius at a load by MCD as first published in 2018: shear widens the contact.

    Parameters
    ----------
    load, work, stress, sphere_radius, modulus, poisson_ratio : float or array
        P [N], w [J/m^2], tau [Pa], R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]; nan where a pulled contact has no equilibrium.

    Notes
    -----
    ``G = w + 6 tau^2 a/(pi E*)`` at nu = 1/2: the slope of the potential set to zero, where it should
    equal the work of the stress (the corrigendum). For comparison only. It is alpha = -1 of
    ``sim.laws.reversible``.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(uncorrected_at_load(5.0, 1.0, [0.0, 1.0], 1.0, 4.0)))
    1.7371 2.0640
    """
    normal = cube_root(0.75 * (sphere_radius / modulus) * abs(load))
    return _widened(
        normal, load, 0.0, work, stress, sphere_radius, modulus, poisson_ratio
    )


@law
def uncorrected_at_indentation(
    indentation, work, stress, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at an indentation [m]; otherwise as ``uncorrected_at_load``.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(uncorrected_at_indentation(1.0, 1.0, [0.0, 1.0], 1.0, 4.0)))
    1.6093 1.8197
    """
    normal = math.sqrt(sphere_radius) * math.sqrt(abs(indentation))
    return _widened(
        normal, indentation, 1.0, work, stress, sphere_radius, modulus, poisson_ratio
    )


def savkoor_briggs_at_load(
    load, work, tangential_force, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load and a tangential force, in full stick (Savkoor & Briggs 1977).

    Parameters
    ----------
    load, work, tangential_force, sphere_radius, modulus, poisson_ratio : float or array
        P [N], w [J/m^2], T [N] of either sign, R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]; beyond ``savkoor_briggs_limit`` the contact slides with Hertz's radius (nan if pulled).

    Notes
    -----
    ``4 E* a^3/(3R) = P + c + sqrt(c (2P + c) - (3/2) T^2)`` with c = 3 pi w R, at nu = 1/2.

    Examples
    --------
    Adhesion is peeled from the edge, and at the limit lost at once:

    >>> limit = savkoor_briggs_limit(4e-3, 0.042, 2e-3)
    >>> a = savkoor_briggs_at_load(4e-3, 0.042, limit * np.array([0.0, 1.0, 1.001]), 2e-3, 6.4e6)
    >>> print("%.3e %.3e %.3e" % tuple(a))
    1.203e-04 1.039e-04 9.787e-05
    """
    return _stuck_at_load(
        load, work, tangential_force, _STICK, sphere_radius, modulus, poisson_ratio
    )


def savkoor_briggs_at_indentation(
    indentation, work, tangential_force, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at an indentation [m]; otherwise as ``savkoor_briggs_at_load``.

    Notes
    -----
    ``E* (delta - a^2/R)^2/(2 pi a) + 3 T^2/(16 pi E* a^3) = w`` at nu = 1/2.
    """
    return shear_share_at_indentation(
        indentation, work, tangential_force, 1.0, sphere_radius, modulus, poisson_ratio
    )


@law
def savkoor_briggs_limit(load, work, sphere_radius, poisson_ratio=0.5):
    """Return the largest tangential force of a sticking contact at a load, by Savkoor & Briggs [N].

    Parameters
    ----------
    load, work, sphere_radius, poisson_ratio : float or array
        P [N], w [J/m^2], R [m], nu [1]. The modulus does not matter.

    Returns
    -------
    float or array
        T_c [N]; nan below the pull-off load, 0 without adhesion.

    Notes
    -----
    ``T_c = sqrt((8/3) P_c (P + P_c))`` at nu = 1/2, with P_c = (3/2) pi w R; the contact then has
    ``4 E* a^3/(3R) = P + 2 P_c``.

    Examples
    --------
    >>> print(f"{savkoor_briggs_limit(0.0, 1.0, 1.0) / (1.5 * math.pi):.4f}")
    1.6330
    """
    if work <= 0.0:
        return 0.0
    return _largest_force(
        load, work, sphere_radius, _STICK * compressible(poisson_ratio)
    )


@law
def savkoor_briggs_shrinkage(load, work, sphere_radius, modulus, poisson_ratio=0.5):
    """Return the coefficient alpha_SB of ``A = A0 - alpha_SB T^2`` at small forces in full stick [m^2/N^2].

    Parameters
    ----------
    load, work, sphere_radius, modulus, poisson_ratio : float or array
        P [N], w [J/m^2], R [m], E* [Pa], nu [1].

    Notes
    -----
    ``A0/(2 X0 S)`` at nu = 1/2, with A0 JKR's area, X0 = P + c + S, S = sqrt(c (2P + c)), c = 3 pi w R.

    Examples
    --------
    The softer the contact, the more it loses:

    >>> hard, soft = savkoor_briggs_shrinkage(1.0, 1.0, 1.0, [8.0, 1.0])
    >>> print(f"{soft / hard:.2f}")
    4.00
    """
    if work <= 0.0:
        return 0.0
    pull = twice_pull_off(work, sphere_radius)
    root = math.sqrt(pull) * math.sqrt(2.0 * load + pull)
    cube = load + pull + root
    radius = cube_root(0.75 * (sphere_radius / modulus) * cube)
    return (
        compressible(poisson_ratio) * 0.5 * math.pi * (radius / cube) * (radius / root)
    )


def reversible_force_at_load(
    load, work, tangential_force, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load under a uniformly spread tangential force whose energy adhesion pays.

    Parameters
    ----------
    load, work, tangential_force, sphere_radius, modulus, poisson_ratio : float or array
        P [N], w [J/m^2], T [N], R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]; Hertz's radius (nan if pulled) beyond the largest force.

    Notes
    -----
    ``4 E* a^3/(3R) = P + c + sqrt(c (2P + c) - (16/pi^2) T^2)`` with c = 3 pi w R, at nu = 1/2: the
    largest force is sqrt(3 pi^2/32) = 0.96 of Savkoor & Briggs'.

    Examples
    --------
    >>> print(f"{reversible_force_at_load(5.0, 1.0, math.pi * 1.62492**2, 1.0, 4.0):.4f}")
    1.6249
    """
    return _stuck_at_load(
        load, work, tangential_force, _UNIFORM, sphere_radius, modulus, poisson_ratio
    )


def reversible_force_at_indentation(
    indentation, work, tangential_force, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at an indentation [m]; otherwise as ``reversible_force_at_load``."""
    # the force with this energy in full stick
    sticking = math.sqrt(_UNIFORM / _STICK) * np.asarray(tangential_force)
    return shear_share_at_indentation(
        indentation, work, sticking, 1.0, sphere_radius, modulus, poisson_ratio
    )


def _at_load(load, work, sphere_radius, modulus):
    """Radii of JKR and Hertz at a load, the load and the work."""
    adhesive = jkr.radius_at_load(load, work, sphere_radius, modulus)
    return adhesive, jkr.hertz_radius_at_load(load, sphere_radius, modulus), load, work


def _at_indentation(indentation, work, sphere_radius, modulus):
    """Radii of JKR and Hertz at an indentation, the indentation and the work."""
    adhesive = jkr.radius_at_indentation(indentation, work, sphere_radius, modulus)
    return (
        adhesive,
        jkr.hertz_radius_at_indentation(indentation, sphere_radius),
        indentation,
        work,
    )


def compare_at_load(
    stress,
    load,
    work,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
    reversible=0.1,
    mixity=0.5,
    only=(),
):
    """Return the contact radius at a load and a mean shear stress by every theory.

    Parameters
    ----------
    stress, load, work, sphere_radius, modulus, poisson_ratio : float or array
        tau [Pa], P [N], w [J/m^2], R [m], E* [Pa], nu [1].
    reversible : float or array
        alpha of ``"fraction"`` [1].
    mixity : float or array
        lambda [1] of the mixed-mode theories.
    only : collection of str
        Names of theories if some are enough; ``"jkr"`` and ``"hertz"`` are always computed.

    Returns
    -------
    dict of array
        a [m] by theory: ``"jkr"``, ``"hertz"``, ``"uncorrected"`` (MCD 2018), ``"savkoor_briggs"``,
        ``"reversible_force"``, ``"reversible_stress"``, ``"fraction"`` and the mixed-mode
        ``"scaled_angle"``, ``"shear_share"`` and ``"scaled_tangent"``. Each theory's tangential force is
        ``pi a^2 tau`` with its own radius.

    Notes
    -----
    The theories at a constant force hold up to the largest force that they bear; beyond it the contact
    slides and has Hertz's radius.

    Examples
    --------
    >>> for name, a in compare_at_load([0.0, 1.0], 5.0, 1.0, 1.0, 4.0).items():
    ...     print(f"{name:17s} {a[0]:.4f} {a[1]:.4f}")
    jkr               1.7371 1.7371
    hertz             0.9787 0.9787
    uncorrected       1.7371 2.0640
    savkoor_briggs    1.7371 1.6333
    reversible_force  1.7371 1.6249
    reversible_stress 1.7371 1.3975
    fraction          1.7371 1.7036
    shear_share       1.7371 1.6854
    scaled_angle      1.7371 1.6611
    scaled_tangent    1.7371 1.6917
    """
    held = _at_load(load, work, sphere_radius, modulus)
    laws = uncorrected_at_load, scaled_angle_at_load, scaled_tangent_at_load
    rest = sphere_radius, modulus, poisson_ratio
    return _compared(held, 0.0, laws, stress, (reversible, mixity), rest, only)


def compare_at_indentation(
    stress,
    indentation,
    work,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
    reversible=0.1,
    mixity=0.5,
    only=(),
):
    """Return the contact radius at an indentation by theory [m], as ``compare_at_load``."""
    held = _at_indentation(indentation, work, sphere_radius, modulus)
    laws = (
        uncorrected_at_indentation,
        scaled_angle_at_indentation,
        scaled_tangent_at_indentation,
    )
    rest = sphere_radius, modulus, poisson_ratio
    return _compared(held, math.inf, laws, stress, (reversible, mixity), rest, only)


def _compared(held, stiffness, laws, stress, parameters, rest, only):
    """Radii by theory at a push behind a stiffness, with the theories that have a search of their own as ``laws``."""
    (jkr, hertz, push, work), (uncorrected, angle, tangent) = held, laws
    stress, (reversible, mixity) = np.asarray(stress, dtype=float), parameters
    radii = {"jkr": jkr, "hertz": hertz}
    if not only or "uncorrected" in only:
        radii["uncorrected"] = uncorrected(push, work, stress, *rest)
    # share of the energy of the mean stress, and 4 if the force is constant as the edge moves, 0 if the stress is
    shares = {
        "savkoor_briggs": (_AS_STICK, 4.0),
        "reversible_force": (_AS_UNIFORM, 4.0),
        "reversible_stress": (1.0, 0.0),
        "fraction": (reversible, 0.0),
        "shear_share": (_AS_STICK * np.asarray(mixity), 4.0),
    }
    for name, (share, of_force) in shares.items():
        if not only or name in only:
            tilt = tilt_of_stress(stress, share, *rest[1:])
            terms = push, stiffness, work, tilt, of_force, *rest[:2]
            radii[name] = shrunk(jkr, hertz, *terms)
    searched = {"scaled_angle": angle, "scaled_tangent": tangent}
    return _with_own_forces(radii, searched, held[2:], stress, mixity, rest, only)


def _with_own_forces(radii, laws, held, stress, mixity, rest, only):
    """Radii by theory, all of one shape, with those by laws at a force, each with the force of its own radius."""
    stress = np.abs(stress)
    for name, radius_at in laws.items():
        if only and name not in only:
            continue
        with np.errstate(all="ignore"):
            high = np.pi * radii["jkr"] ** 2 * stress
            low = np.zeros_like(high)
            force = 0.5 * high
            for step in range(_STEPS):
                is_wide = high - low > _ROUNDING * high
                if not is_wide.any():
                    break
                # falls as the force grows
                limit = np.pi * radius_at(*held, force, mixity, *rest) ** 2 * stress
                ends = (
                    np.fmax(low, np.fmin(limit, force)),
                    np.where(limit > force, np.fmin(high, limit), force),
                )
                low, high = (
                    np.where(is_wide, *pair)
                    for pair in zip(ends, (low, high), strict=True)
                )
                force = (
                    0.5 * (low + high)
                    if step % 2
                    else np.fmin(np.fmax(limit, low), high)
                )
        radii[name] = radius_at(*held, high, mixity, *rest)
    return dict(
        zip(
            radii,
            map(np.array, np.broadcast_arrays(*radii.values(), stress)),
            strict=False,
        )
    )
