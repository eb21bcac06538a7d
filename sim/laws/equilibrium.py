"""The largest stable radius of a contact with a work of adhesion that falls in proportion to the radius.

A contact of radius a balances if its energy release rate G equals the work of adhesion left, ``w - t a``. The tilt t is
zero in JKR's theory. It is above zero if adhesion pays for stored shear energy (``sim.laws.reversible``). A mount holds
the sphere: a load P, or a base of displacement Delta behind a stiffness k.

**Terms of a punch.** An axisymmetric punch on an elastic solid has Hertz's depth delta_H(a) and load P_H(a), for which
the edge neither pulls nor pushes, and a compliance C(a). For every punch ``dP_H/da = (d delta_H/da)/C`` and
``G = (P_H - P)^2/(4 pi a) |dC/da|``. With the missing depth ``y = C (P_H - P) = delta_H - delta`` the balance is

    ``y^2 = q``,  ``q = 4 pi a (w - t a)/(d(1/C)/da)``,  ``y = (k (delta_H - Delta) + P_H - P)/(k + 1/C)``

where P = 0 if k > 0. ``punch`` has these terms for a sphere. On a half-space delta_H = a^2/R, P_H = 4 E* a^3/(3R) and
1/C = 2 E* a, so that ``q = 2 pi a (w - t a)/E*``. ``sim.laws.layer`` has those on a layer, where
t a is t times ``stress_reach`` and t must not be negative.

**Profile.** These are the terms of a parabola. A sphere has the profile of a circle, with which a half-space has, for
s = a/R, ``delta_H = R s artanh s`` and ``P_H = E* R^2 ((1 + s^2) artanh s - s)`` (Segedin 1957). To the next order they
are those of the parabola times ``1 + s^2/3`` and ``1 + 2 s^2/5``. The radius is below R.

**Convexity.** On a half-space y is convex in a where it is positive: its second derivative over a is
``2/R - 2a/(R (c + a)) + 2y/(c + a)^2`` with c = k/(2 E*), and c >= 0. For t >= 0 the root of q is concave, because q is
a concave parabola, so that ``y - sqrt(q)`` and ``y^2 - q`` are convex. For t < 0 ``y^2 - q`` is convex on the right of
its largest zero, because it is G - w + t a, which is convex (``jkr.energy_release_rate``), times a multiple of a. So
there are at most two equilibria on the branch y > 0, and the wider one is stable. Newton's method from the right of it
goes left and never passes it; a slope that is not positive on the way means that there is no equilibrium. From a place
on its left with a positive slope one step leads to its right. A step that does not go left is rounding then, and ends
the search.

**On a layer** neither holds. Under a load ``y - sqrt(q)`` has one minimum at most, but behind a spring it may have two
if adhesion is strong, and the contact then has two stable radii. ``_on_layer`` keeps Newton's steps in a bracket and
looks for the minimum between two places if there is one. A search that starts on the right finds the wider contact. A
circle has the same search, because its radius has an upper end.

**Never below Hertz.** The edge can pull but not push. If no work of adhesion is left at Hertz's radius, the contact has
that radius, the zero of y. Only a mount that presses has such a contact.
"""

import math

import numpy as np

from sim.laws import layer
from sim.numerics.jit import apart, device, inlined, law

#: Change of the radius over it below which Newton's next step, its square, is below rounding; most steps.
_CLOSE, _MOST = 1e-14, 200
#: Change of the radius over it within which a start is the equilibrium, which is given back to its last bit.
_ROUNDING = 1e-15
#: Halvings that find a minimum on a layer down to rounding; step of the search for a narrower contact, and its end.
_HALVINGS, _NARROWER, _LEAST = 50, 0.8, 1e-5
#: Thickness, and inverse of it, that stand for a half-space under the profile of a circle.
CIRCLE = -1.0
#: (a/R)^2 below which Hertz's load of a circle is summed as a series, its terms, and most terms of the energy.
_SERIES_BELOW, _TERMS, _MOST_TERMS = 0.1, 16, 100_000


@device
def half_space(radius, body):
    """Return the terms of ``punch`` on a half-space."""
    curvature, modulus, _ = body
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
def circle(radius, body):
    """Return the terms of ``punch`` on a half-space under the profile of a circle; ``radius``: below R."""
    apart()
    curvature, modulus, _ = body
    share = radius * curvature
    square, turn, load = share * share, math.atanh(share), 0.0
    if square < _SERIES_BELOW:
        # (1 + s^2) artanh s - s, the sum of 4k/(4k^2 - 1) s^(2k + 1)
        for k in range(_TERMS, 0, -1):
            load = load * square + 4.0 * k / (4.0 * k * k - 1.0)
        load *= square * share
    else:
        load = (1.0 + square) * turn - share
    _, _, _, stiffness, rise, toll, toll_slope = half_space(radius, body)
    load *= modulus / (curvature * curvature)
    growth = turn + share / (1.0 - square)
    return radius * turn, growth, load, stiffness, rise, toll, toll_slope


@inlined
def punch(radius, body):
    """Return the terms of a sphere on a solid at a contact radius.

    ``body``: 1/R, E* and 1/h, 0 without a layer and ``CIRCLE`` without a layer under the profile of a circle.

    They are Hertz's depth and its slope over the radius, Hertz's load, 1/C and its slope, and the square of the missing
    depth per energy release rate, 4 pi a over the slope of 1/C, with its slope.
    """
    terms = half_space(radius, body)
    if body[2] > 0.0:
        terms = layer.sphere(radius, body[0], body[1], body[2])
    elif body[2] < 0.0:
        terms = circle(radius, body)
    return terms


@device
def _circle_energy(share):
    """Return the contact functions of ``elastic_energy`` of a circle at a share a/R below 1.

    They are ``int theta ds`` and ``int theta^2 ds`` from 0 to a, ``theta = s artanh(s/R)``, over a^3/R and a^5/R^2.
    """
    _, _, load, _, _, _, _ = circle(share, (1.0, 1.0, CIRCLE))
    mixed = (math.atanh(share) - 0.5 * load / (share * share)) / share
    # artanh^2 s is the sum of (1 + 1/3 + ... + 1/(2k - 1))/k s^(2k)
    power, odd, sphere, k = 1.0, 0.0, 0.0, 0
    while k < _MOST_TERMS:
        k += 1
        odd += 1.0 / (2.0 * k - 1.0)
        term = power * odd / (k * (2.0 * k + 3.0))
        sphere += term
        if term < 1e-17 * sphere:
            break
        power *= share * share
    return mixed, sphere


@device
def elastic_energy(radius, indentation, body):
    """Return the elastic energy of a contact of any radius and indentation on a solid; ``body`` as in ``punch``."""
    curvature, modulus, inverse_thickness = body
    flat, mixed, sphere = 1.0, 1.0 / 3.0, 0.2
    if inverse_thickness > 0.0:
        _, _, _, _, flat, mixed, sphere = layer.contact_functions(
            radius * inverse_thickness
        )
    elif inverse_thickness < 0.0 and radius > 0.0:
        mixed, sphere = _circle_energy(radius * curvature)
    hertz = radius * radius * curvature
    square = flat * indentation * indentation - 2.0 * mixed * hertz * indentation
    return modulus * radius * (square + sphere * hertz * hertz)


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
    terms = punch(radius, body)
    missing, _ = missing_depth(terms, mount)
    return missing * abs(missing) / terms[5] - left


@device
def stress_reach(radius, inverse_thickness):
    """Return what multiplies the tilt in the energy of a uniform stress, the radius on a half-space, and its slope."""
    if inverse_thickness <= 0.0:
        return radius, 1.0
    x = radius * inverse_thickness
    _, _, n, n_slope = layer.shear_functions(x)
    return radius * n, n + x * n_slope


@device
def _lack(a, work, tilt, mount, body):
    """Return y - sqrt(q) at a radius, its slope, and that of G less the work left, inf without work left.

    Without work left q is 0.
    """
    terms = punch(a, body)
    missing, growth = missing_depth(terms, mount)
    toll, toll_slope = terms[5], terms[6]
    left, falls = work, 0.0
    if tilt > 0.0:
        reach, reach_slope = stress_reach(a, body[2])
        left, falls = work - tilt * reach, tilt * reach_slope
    if not left > 0.0:
        return missing, growth, math.inf
    root, change = math.sqrt(toll * left), toll_slope * left - toll * falls
    slope = growth - 0.5 * change / root
    return missing - root, slope, (2.0 * missing * growth - change) / toll


@device
def _between(left, right, work, tilt, mount, body):
    """Return a radius between two others at which y - sqrt(q) is not positive, 0 without one.

    It is positive at both, falls at the left one and rises at the right one.
    """
    for _ in range(_HALVINGS):
        middle = 0.5 * (left + right)
        over, slope, _ = _lack(middle, work, tilt, mount, body)
        if over <= 0.0:
            return middle
        if slope > 0.0:
            right = middle
        else:
            left = middle
    return 0.0


@device
def _on_layer(start, work, tilt, mount, body):
    """Return the largest stable radius on a layer or of a circle, and the slope of the energy release rate over it.

    It lies between ``low``, where y - sqrt(q) is not positive, and ``high``, where it is; 0 and inf are not known yet.
    A circle is below its own radius.
    """
    apart()
    a, low, high = start, 0.0, math.inf
    if body[2] < 0.0:
        high = 1.0 / body[0]
        a = a if a < high else 0.5 * high
    for _ in range(_MOST):
        over, slope, steepness = _lack(a, work, tilt, mount, body)
        if not abs(over) < math.inf:
            break
        rises = slope > 0.0
        if rises and abs(over) <= _ROUNDING * a * slope:
            return a, steepness
        if over > 0.0 and not rises and low == 0.0:
            if high == math.inf:
                a *= 2.0
                continue
            dip = _between(a, high, work, tilt, mount, body)
            while dip == 0.0:  # the contact is narrower, or there is none
                high, a = a, _NARROWER * a
                if a < _LEAST * start:
                    return math.nan, math.nan
                over, slope, _ = _lack(a, work, tilt, mount, body)
                if over <= 0.0 or slope > 0.0:
                    dip = a
            a = dip
            continue
        if over > 0.0:
            high = a
        else:
            low = a
        target = a - min(over / slope, 0.5 * a) if rises else 0.5 * (low + high)
        target = min(target, 2.0 * a)
        if not low < target < high:
            target = 0.5 * (low + high)
        # of an end that is not known yet the width is no bound
        is_narrow = high < math.inf and high - low <= _ROUNDING * high
        if abs(target - a) <= _CLOSE * a or is_narrow:
            return target, steepness
        a = target
    return math.nan, math.nan


@device
def largest_radius(start, work, tilt, mount, body):
    """Return the largest stable radius, and the slope of G over the radius there less that of the work left.

    ``start``: any radius above 0, on the right of the equilibrium if the tilt is negative. An equilibrium at the start
    is given back. ``mount`` and ``body`` as in
    ``missing_depth`` and ``punch``. The radius is nan without an equilibrium, and 0 if nothing presses or pulls a
    contact without adhesion. The slope is inf if the contact is Hertz's, which adhesion does not move.
    """
    load, base, spring = mount
    push, limit = (base if spring > 0.0 else load), math.inf
    bare = tilt >= 0.0 and work <= 0.0
    if body[2] != 0.0:
        if tilt < 0.0:
            return math.nan, math.nan
        if bare and not push > 0.0:
            return (0.0 if push == 0.0 else math.nan), math.inf
        return _on_layer(start, work, 0.0 if bare else tilt, mount, body)
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


@device
def load_fold(work, body):
    """Return the radius at which an equilibrium contact bears its lowest load; 0 without work of adhesion."""
    curvature, modulus, inverse_thickness = body
    if not work > 0.0:
        return 0.0
    # on a half-space; a contact on a layer is smaller than that without a load, which is 4^(1/3) times this
    half_space = math.pow(9.0 * math.pi * work / (8.0 * modulus * curvature**2), 1 / 3)
    if inverse_thickness == 0.0:
        return half_space
    low, high = 0.0, 2.0 * half_space
    if inverse_thickness < 0.0:
        high = min(high, 1.0 / curvature)
    for _ in range(_MOST):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        _, growth, _, stiffness, rise, toll, toll_slope = punch(middle, body)
        root = math.sqrt(toll * work)
        if stiffness * (growth - 0.5 * root * toll_slope / toll) > rise * root:
            high = middle
        else:
            low = middle
    return high


# A sphere on a layer under any mount: load [N], displacement of the base [m] and stiffness behind it [N/m], 0 under a
# load. The thickness ``CIRCLE`` stands for a half-space under the profile of a circle.


@law
def radius_on_layer(load, base, spring, work, sphere_radius, modulus, thickness):
    """Return the largest stable contact radius on a bonded layer.

    Parameters
    ----------
    load, base, spring : float or array
        P [N] of a contact under a load, or displacement [m] of a base behind a stiffness [N/m]; the other is 0.
    work : float or array
        w [J/m^2].
    sphere_radius, modulus, thickness : float or array
        R [m], E* = 4G [Pa], h [m].

    Returns
    -------
    float or array
        a [m]; Hertz's where w <= 0, nan where there is no equilibrium.

    Notes
    -----
    Behind a spring two radii may be stable. The larger one is given.

    Examples
    --------
    A layer makes the contact without a load smaller, and bears a larger load under tension:

    >>> a = radius_on_layer(0.0, 0.0, 0.0, 1e-3, 1.0, 4.0, [1e9, 0.05])
    >>> pulled = pull_off_load_on_layer(1e-3, 1.0, 4.0, [1e9, 0.05])
    >>> print("%.4f %.4f, %.2e %.2e" % (*a, *pulled))
    0.1523 0.1169, -4.71e-03 -6.28e-03
    """
    body, mount = (1.0 / sphere_radius, modulus, 1.0 / thickness), (load, base, spring)
    # wider than any contact on a half-space
    scale = sphere_radius / modulus
    size = np.cbrt(
        scale * (max(load, 0.0) + 6.0 * math.pi * max(work, 0.0) * sphere_radius)
    )
    start = 2.0 * math.sqrt(sphere_radius * max(base, 0.0)) + size
    if not start > 0.0:
        start = sphere_radius
    return largest_radius(start, work, 0.0, mount, body)[0]


@law
def load_at_radius_on_layer(radius, work, sphere_radius, modulus, thickness):
    """Return the load of the equilibrium contact of a radius on a layer [N]; Hertz's where w <= 0.

    Parameters
    ----------
    radius, work, sphere_radius, modulus, thickness : float or array
        a [m], w [J/m^2], R [m], E* = 4G [Pa], h [m].

    Examples
    --------
    >>> rest = radius_on_layer(0.0, 0.0, 0.0, 1e-3, 1.0, 4.0, 0.05)
    >>> print(f"{abs(load_at_radius_on_layer(rest, 1e-3, 1.0, 4.0, 0.05)) < 1e-15}")
    True
    """
    terms = punch(radius, (1.0 / sphere_radius, modulus, 1.0 / thickness))
    return terms[2] - terms[3] * math.sqrt(terms[5] * max(work, 0.0))


@law
def load_on_layer(radius, load, base, spring, sphere_radius, modulus, thickness):
    """Return the load of any contact on a layer, in equilibrium or not [N]; as for ``radius_on_layer``.

    Notes
    -----
    ``P_H - y/C``, with y the missing depth.

    Examples
    --------
    >>> print(f"{load_on_layer(1.0, 0.0, 1.0, math.inf, 1.0, 1.0, 1e9):.4f}")
    1.3333
    """
    terms = punch(radius, (1.0 / sphere_radius, modulus, 1.0 / thickness))
    return terms[2] - terms[3] * missing_depth(terms, (load, base, spring))[0]


@law
def indentation_on_layer(radius, load, base, spring, sphere_radius, modulus, thickness):
    """Return the indentation of any contact on a layer, in equilibrium or not [m]; as for ``radius_on_layer``.

    Examples
    --------
    >>> print(f"{indentation_on_layer(1.0, 4.0 / 3.0, 0.0, 0.0, 1.0, 1.0, 1e9):.4f}")
    1.0000
    """
    terms = punch(radius, (1.0 / sphere_radius, modulus, 1.0 / thickness))
    return terms[0] - missing_depth(terms, (load, base, spring))[0]


@law
def energy_on_layer(radius, indentation, sphere_radius, modulus, thickness):
    """Return the elastic energy of a contact on a layer of any radius and indentation [J].

    Parameters
    ----------
    radius, indentation, sphere_radius, modulus, thickness : float or array
        a [m], delta [m], R [m], E* = 4G [Pa], h [m].

    Notes
    -----
    ``E* (delta^2 a g_1 - 2 delta a^3 g_2/R + a^5 g_3/R^2)`` with the contact functions of ``sim.laws.layer``.

    Examples
    --------
    A flat punch as wide as the layer is thick stores nearly four times the energy of one on a half-space:

    >>> print("%.3f %.3f" % tuple(energy_on_layer(1.0, 1.0, 1e9, 1.0, [1.0, 1e9])))
    3.619 1.000
    """
    body = 1.0 / sphere_radius, modulus, 1.0 / thickness
    return elastic_energy(radius, indentation, body)


@law
def pull_off_load_on_layer(work, sphere_radius, modulus, thickness):
    """Return the lowest load that an adhesive contact on a layer bears [N], 0 where w <= 0.

    Parameters
    ----------
    work, sphere_radius, modulus, thickness : float or array
        w [J/m^2], R [m], E* = 4G [Pa], h [m].

    Examples
    --------
    -3/2 pi w R on a thick layer:

    >>> print(f"{pull_off_load_on_layer(1e-3, 1.0, 4.0, 1e9):.6e} {-1.5e-3 * math.pi:.6e}")
    -4.712389e-03 -4.712389e-03
    """
    body = 1.0 / sphere_radius, modulus, 1.0 / thickness
    radius = load_fold(work, body)
    if radius == 0.0:
        return 0.0
    terms = punch(radius, body)
    return terms[2] - terms[3] * math.sqrt(terms[5] * work)
