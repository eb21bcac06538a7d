"""The largest stable radius of a contact with a work of adhesion that falls in proportion to the radius.

A contact of radius a balances if its energy release rate G equals the work of adhesion left, ``w - t a``. The tilt t is
zero in JKR's theory. It is above zero if adhesion pays for stored shear energy (``sim.laws.reversible``). A mount holds
the sphere: a load P, or a base of displacement Delta behind a stiffness k.

**Terms of a punch.** An axisymmetric punch on an elastic solid has Hertz's depth delta_H(a) and load P_H(a), for which
the edge neither pulls nor pushes, and a compliance C(a). For every punch ``dP_H/da = (d delta_H/da)/C`` and
``G = (P_H - P)^2/(4 pi a) |dC/da|``. With the missing depth ``y = C (P_H - P) = delta_H - delta`` the balance is

    ``y^2 = q``,  ``q = 4 pi a (w - t a)/(d(1/C)/da)``,  ``y = (k (delta_H - Delta) + P_H - P)/(k + 1/C)``

where P = 0 if k > 0. ``half_space`` has these terms for a sphere on a half-space: delta_H = a^2/R, P_H = 4 E* a^3/(3R),
1/C = 2 E* a, so that ``q = 2 pi a (w - t a)/E*``. Another solid needs another function of this kind only.

**Convexity.** On a half-space y is convex in a where it is positive: its second derivative over a is
``2/R - 2a/(R (c + a)) + 2y/(c + a)^2`` with c = k/(2 E*), and c >= 0. For t >= 0 the root of q is concave, because q is
a concave parabola, so that ``y - sqrt(q)`` and ``y^2 - q`` are convex. For t < 0 ``y^2 - q`` is convex on the right of
its largest zero, because it is G - w + t a, which is convex (``jkr.energy_release_rate``), times a multiple of a. So
there are at most two equilibria on the branch y > 0, and the wider one is stable. Newton's method from the right of it
goes left and never passes it; a slope that is not positive on the way means that there is no equilibrium. From a place
on its left with a positive slope one step leads to its right. A step that does not go left is rounding then, and ends
the search.

**Never below Hertz.** The edge can pull but not push. If no work of adhesion is left at Hertz's radius, the contact has
that radius, the zero of y. Only a mount that presses has such a contact.
"""

import math

from sim.numerics.jit import device

#: Change of the radius over it below which Newton's next step, its square, is below rounding; most steps.
_CLOSE, _MOST = 1e-14, 200
#: Change of the radius over it within which a start is the equilibrium, which is given back to its last bit.
_ROUNDING = 1e-15


@device
def half_space(radius, body):
    """Return the terms of a sphere on a half-space at a contact radius; ``body``: 1/R and E*.

    They are Hertz's depth and its slope over the radius, Hertz's load, 1/C and its slope, and the square of the missing
    depth per energy release rate, 4 pi a over the slope of 1/C, with its slope.
    """
    curvature, modulus = body
    depth, stiffness = radius * radius * curvature, 2.0 * modulus * radius
    load, toll_slope = 2.0 / 3.0 * stiffness * depth, 2.0 * math.pi / modulus
    growth = 2.0 * radius * curvature
    return (
        depth,
        growth,
        load,
        stiffness,
        2.0 * modulus,
        toll_slope * radius,
        toll_slope,
    )


@device
def missing_depth(terms, mount):
    """Return the depth that a contact with the ``terms`` of a punch lacks to Hertz's, and its slope over the radius.

    ``mount``: load, displacement of the base, and stiffness, 0 under a load.
    """
    depth, growth, hertz_load, stiffness, rise, _, _ = terms
    load, base, spring = mount
    if spring == math.inf:
        return depth - base, growth
    series = 1.0 / (spring + stiffness)
    missing = (spring * (depth - base) + hertz_load - load) * series
    return missing, growth - rise * missing * series


@device
def surplus(radius, left, mount, body):
    """Return the energy release rate, negative below Hertz's radius, minus the work of adhesion ``left``."""
    terms = half_space(radius, body)
    missing, _ = missing_depth(terms, mount)
    return missing * abs(missing) / terms[5] - left


@device
def largest_radius(start, work, tilt, mount, body):
    """Return the largest stable radius, and the slope of G over the radius there less that of the work left.

    ``start``: any radius above 0, on the right of the equilibrium if the tilt is negative. An equilibrium at the start
    is given back. ``mount`` and ``body`` as in
    ``missing_depth`` and ``half_space``. The radius is nan without an equilibrium, and 0 if nothing presses or pulls a
    contact without adhesion. The slope is inf if the contact is Hertz's, which adhesion does not move.
    """
    load, base, spring = mount
    push, limit = (base if spring > 0.0 else load), math.inf
    bare = tilt >= 0.0 and work <= 0.0
    if tilt > 0.0 and not bare:
        limit = work / tilt
        bare = push > 0.0 and missing_depth(half_space(limit, body), mount)[0] <= 0.0
        limit = math.inf if bare else limit
    if bare and not push > 0.0:
        return (0.0 if push == 0.0 else math.nan), math.inf
    if bare:
        work = tilt = 0.0
    a, is_right, steepness = min(start, limit), False, math.nan
    for _ in range(_MOST):
        terms = half_space(a, body)
        missing, growth = missing_depth(terms, mount)
        left, toll, toll_slope = work - tilt * a, terms[5], terms[6]
        over = missing * missing - toll * left
        steepness = 2.0 * missing * growth - toll_slope * left + toll * tilt
        slope = steepness
        if tilt == 0.0 or missing < 0.0:
            root = math.sqrt(toll * max(left, 0.0))
            over, slope = missing - root, growth - 0.5 * root * toll_slope / toll
        if not (slope > 0.0 and over < math.inf):
            if is_right:
                return math.nan, math.nan
            a = min(2.0 * a, limit)
            continue
        if a == start and abs(over / slope) <= _ROUNDING * a:
            break
        if is_right and over <= 0.0:
            break
        is_right = over > 0.0
        change = min(over / slope, 0.5 * a)
        a = min(a - change, limit)
        if abs(change) <= _CLOSE * a:
            break
    else:
        return math.nan, math.nan
    return a, (math.inf if bare else steepness / toll)
