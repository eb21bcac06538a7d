"""Contact radius under a tangential force by mixed-mode fracture: the edge toughens as its mode turns to shear.

With G the release rate of the normal load alone (``jkr.energy_release_rate``), G_s that of a tangential force T
in full stick, averaged around the edge as Savkoor & Briggs do, and psi the mode angle,

    ``G_s = 3 T^2/(16 pi E* a^3)`` at nu = 1/2,  ``tan^2 psi = G_s/G``,  ``G + G_s = w f(psi)``,

interfaces are described by one of three functions of a mixity lambda from 0 to 1 (Hutchinson & Suo 1992; Johnson
1997; Waters & Guduru 2010; compared by Papangelo & Ciavarella 2018):

    ``f = 1 + tan^2((1 - lambda) psi)``            scaled angle
    ``f = 1/(1 + (lambda - 1) sin^2 psi)``         shear share, which is ``G + lambda G_s = w``
    ``f = 1 + (1 - lambda) tan^2 psi``             scaled tangent

All are Savkoor & Briggs' theory at lambda = 1 and JKR's at 0. Shear is added to G as ``lambda (2 - lambda) G_s``,
``lambda G_s`` and ``lambda G_s`` to second order in T. For another Poisson ratio G_s gains the factor
(2 - nu)/(3 (1 - nu)), the coupling of normal and tangential fields being neglected.

**One search.** With y = cot psi each law is ``w/G_s = F(y)``: ``cos^2((1 - lambda) psi) (1 + y^2)``,
``y^2 + lambda`` and ``y^2 + lambda y^2/(y^2 + 1 - lambda)``. Under a given force y gives the radius,
``a^3 = T^2 F/4``, with the load ``a^3 - sqrt(3/2) T y`` and the indentation ``a^2 - sqrt(2/3) T y/a`` (in Maugis'
units: pi w R for forces, (3 pi w R^2/4 E*)^(1/3) for a, a^2/R for the indentation). The contact is stable where they
grow with y, the widest one at the largest y. For the first two laws they fall to one minimum and grow from there on:
F is convex and y F'/F grows with y. The third may have an outer and an inner stable branch when lambda is near 1.
So the search goes left from the radius of JKR by Newton's steps, none longer than a fifth of y, and looks for
a crossing wherever it has passed a minimum.
"""

import math

from sim.laws.jkr import hertz_radius_at_indentation, hertz_radius_at_load, radius_at_indentation, radius_at_load
from sim.laws.reversible import compressible
from sim.numerics.jit import device, law
from sim.numerics.special import cube_root

__all__ = [
    "scaled_angle_at_indentation",
    "scaled_angle_at_load",
    "scaled_angle_limit",
    "scaled_tangent_at_indentation",
    "scaled_tangent_at_load",
    "shear_share_at_indentation",
    "shear_share_at_load",
]

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
    return y * y * (1.0 + mixity / rest), 2.0 * y * (1.0 + mixity * (1.0 - mixity) / (rest * rest))


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
    return level, 2.0 / 3.0 * force / radius * (slope + _SHEAR / 3.0 * y * growth / toughness), cube


@device
def _sign_change(low, high, of_slope, level, force, mixity, which, control):
    """The y between two at which the level, or its slope, goes from below to above; the upper of two neighbours."""
    while True:
        y = 0.5 * (low + high)
        if not low < y < high:
            return high
        found, slope, _ = _held(y, force, mixity, which, control)
        if (slope if of_slope else found - level) > 0.0:
            high = y
        else:
            low = y


@device
def _widest(y, level, force, mixity, which, control):
    """Cube of the radius of the widest state at a level, from a y right of it; nan if there is none."""
    found, slope, cube = _held(y, force, mixity, which, control)
    for _ in range(_MOST):
        if not found > level:
            return cube
        lower = max(y - (found - level) / slope, _KEPT * y) if slope > 0.0 else _KEPT * y
        if not lower < y:
            return cube
        before = slope
        found, slope, cube = _held(lower, force, mixity, which, control)
        bottom = lower
        if found > level and slope < 0.0 < before:
            bottom = _sign_change(lower, y, True, level, force, mixity, which, control)
        if not (_held(bottom, force, mixity, which, control)[0] > level):
            y = _sign_change(bottom, y, False, level, force, mixity, which, control)
            return _held(y, force, mixity, which, control)[2]
        y = lower
    return math.nan


@law
def _radius(jkr, hertz, level, work, tangential_force, mixity, which, control, sphere_radius, modulus, poisson_ratio):
    """Contact radius at a load or an indentation from those of JKR and Hertz."""
    if not 0.0 <= mixity <= 1.0:
        return math.nan
    if tangential_force == 0.0 or mixity == 0.0 or work <= 0.0 or not jkr > 0.0 or jkr == math.inf:
        return jkr
    unit = cube_root(0.75 * math.pi * work * sphere_radius * (sphere_radius / modulus))
    scale = math.pi * work * sphere_radius
    force = abs(tangential_force) / scale * math.sqrt(compressible(poisson_ratio))
    held = level / scale if control == _LOAD else level / unit * (sphere_radius / unit)
    start = 2.0 * math.sqrt(jkr / unit) * (jkr / unit) / force  # F >= y^2: a state of JKR's radius or more
    if start > _NO_FORCE:
        return jkr
    radius = unit * cube_root(_widest(start, held, force, mixity, which, control))
    if not level >= 0.0:
        return radius
    return radius if radius > hertz else hertz


def _at_load(which, load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio):
    jkr = radius_at_load(load, work, sphere_radius, modulus)
    hertz = hertz_radius_at_load(load, sphere_radius, modulus)
    rest = (mixity, which, _LOAD, sphere_radius, modulus, poisson_ratio)
    return _radius(jkr, hertz, load, work, tangential_force, *rest)


def _at_indentation(which, indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio):
    jkr = radius_at_indentation(indentation, work, sphere_radius, modulus)
    hertz = hertz_radius_at_indentation(indentation, sphere_radius)
    rest = (mixity, which, _INDENTATION, sphere_radius, modulus, poisson_ratio)
    return _radius(jkr, hertz, indentation, work, tangential_force, *rest)


def scaled_angle_at_load(load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at a load and a tangential force by ``f = 1 + tan^2((1 - lambda) psi)``.

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
        a [m]; Hertz's radius (nan if pulled) beyond ``scaled_angle_limit``, nan for any other lambda.

    Examples
    --------
    At its limit a lightly pressed contact loses what is left of adhesion at once, one that is pressed more has lost it:

    >>> for load in (3.0, 300.0):
    ...     limit = scaled_angle_limit(load, 1.0, 0.2, 1.0)
    ...     a = [float(scaled_angle_at_load(load, 1.0, x * limit, 0.2, 1.0, 0.75)) for x in (0.0, 1.0 - 1e-9, 1.1)]
    ...     print("%.3f %.3f %.3f" % tuple(a))
    2.904 1.973 1.442
    7.276 6.694 6.694
    """
    return _at_load(_ANGLE, load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio)


def scaled_angle_at_indentation(indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at an indentation [m], with the tangential force held; otherwise as ``scaled_angle_at_load``."""
    return _at_indentation(_ANGLE, indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio)


def shear_share_at_load(load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at a load and a tangential force by ``G + lambda G_s = w`` [m], as ``scaled_angle_at_load``.

    Notes
    -----
    ``f = 1/(1 + (lambda - 1) sin^2 psi)``: Savkoor & Briggs' radius at the force ``sqrt(lambda) T``. It jumps to
    Hertz's at ``savkoor_briggs_limit/sqrt(lambda)``.
    """
    return _at_load(_SHARE, load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio)


def shear_share_at_indentation(indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at an indentation [m], with the tangential force held; otherwise as ``shear_share_at_load``."""
    return _at_indentation(_SHARE, indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio)


def scaled_tangent_at_load(load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5):
    """Contact radius at a load and a tangential force by ``f = 1 + (1 - lambda) tan^2 psi`` [m].

    Otherwise as ``scaled_angle_at_load``. However large the force, a share 1 - lambda of adhesion is left: the
    radius tends to JKR's at ``(1 - lambda) w`` and never to Hertz's, and only a contact that is pulled harder
    than that work bears comes off.

    Examples
    --------
    >>> for force in (1.0, 10.0, 1000.0):
    ...     print(f"{scaled_tangent_at_load(5.0, 1.0, force, 0.5, 1.0, 4.0):.4f}")
    1.7365
    1.6816
    1.5011
    >>> print(f"{radius_at_load(5.0, 0.5, 1.0, 4.0):.4f}")
    1.5011
    """
    return _at_load(_TANGENT, load, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio)


def scaled_tangent_at_indentation(
    indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio=0.5
):
    """Contact radius at an indentation [m], with the tangential force held; otherwise as ``scaled_tangent_at_load``."""
    return _at_indentation(_TANGENT, indentation, work, tangential_force, mixity, sphere_radius, modulus, poisson_ratio)


@device
def _fold_load(y, mixity):
    """Load at which the contact by the scaled angle jumps at y = cot psi; it falls with y, to -3/2."""
    toughness, growth = _toughness(y, mixity, _ANGLE)
    return 6.0 * (toughness - y * growth) / (growth * growth)


@law
def scaled_angle_limit(load, work, mixity, sphere_radius, poisson_ratio=0.5):
    """Largest tangential force that adhesion bears at a load by ``f = 1 + tan^2((1 - lambda) psi)`` [N].

    Parameters
    ----------
    load, work, mixity, sphere_radius, poisson_ratio : float or array
        P [N], w [J/m^2], lambda [1], R [m], nu [1]. The modulus does not matter.

    Returns
    -------
    float or array
        T [N]; nan below the pull-off load, 0 without adhesion, infinite at lambda = 0.

    Notes
    -----
    At small loads the contact jumps to Hertz's, where load and slope of the search above meet:
    ``P = 6 (F - y F')/F'^2``, ``T = 4 sqrt(3/2)/F'`` in Maugis' units. At loads of
    ``6 F(0)/F'(0)^2`` and more it reaches Hertz's smoothly, at ``T = 2 sqrt(P)/sin(pi lambda/2)``.

    Examples
    --------
    At lambda = 1 it is the limit of Savkoor & Briggs:

    >>> print(f"{scaled_angle_limit(0.0, 1.0, 1.0, 1.0) / (1.5 * math.pi):.4f}")
    1.6330
    """
    if not 0.0 <= mixity <= 1.0:
        return math.nan
    if work <= 0.0:
        return 0.0
    scale = math.pi * work * sphere_radius
    p = load / scale
    if not p >= -1.5:
        return math.nan
    if mixity == 0.0:
        return math.inf
    scale /= math.sqrt(compressible(poisson_ratio))
    if p >= _fold_load(0.0, mixity):
        return 2.0 * math.sqrt(p) / math.sin(0.5 * math.pi * mixity) * scale
    low, high = 0.0, 1.0
    while _fold_load(high, mixity) > p and high < _NO_FORCE:
        low, high = high, 2.0 * high
    while True:
        y = 0.5 * (low + high)
        if not low < y < high:
            return 4.0 * _SHEAR / _toughness(high, mixity, _ANGLE)[1] * scale
        if _fold_load(y, mixity) > p:
            low = y
        else:
            high = y
