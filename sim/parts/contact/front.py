"""Crack-front kinetics: motion of the edge of an adhesive contact over a block of clock steps.

The edge of a contact of radius a moves at the speed v = -da/dt that dissipates the excess energy release rate. The law
is ``G - w = work (v/speed)^exponent sgn(v)`` (after Maugis & Barquins). The edge opens if the energy release rate G
exceeds the work of adhesion w. Otherwise it heals, with a separate speed and exponent. Unlike the form with G/w this
one stays finite and defined for w <= 0, where stress fluctuations outweigh adhesion. Limits: infinite speed is the JKR
equilibrium, zero speed a frozen edge.

One formula serves every control and solid. The sphere is pressed with ``P = load + stiffness (displacement - delta)``:
stiffness 0 is a load, an infinite one an indentation. ``sim.laws.equilibrium`` has the indentation y that is missing
from Hertz's at this radius, and G is y^2 over the sixth term of its ``punch``, E* y^2/(2 pi a) on a half-space.

Integration. Radau IIA of three stages (order 5, L-stable; Hairer & Wanner, Solving ODEs II, IV.8) takes steps of its
own choice inside the clock step. If the edge opens completely, the radius drops to zero in finite time with an infinite
slope. The same method then advances the time over -ln a, which is smooth to the end. Within a clock step the work of
adhesion changes linearly and the control piece by piece. A piece is cut where the work or the force on the bare contact
changes sign.

The contact never falls below Hertz's (y = 0): pressing alone makes that area, and linear
elasticity has no smaller one. An edge that opens with w <= 0 stops there, and one that heals more
slowly than Hertz's contact grows follows it. A contact that closes begins as a spot, and one that has shrunk to half of
the spot counts as open.

"""

import math
from collections import namedtuple
from typing import NamedTuple

import numpy as np

from sim.laws.equilibrium import (
    elastic_energy,
    largest_radius,
    load_fold,
    missing_depth,
    punch,
    stress_reach,
)
from sim.numerics.jit import device, kernel
from sim.numerics.radau import NODES, PACE, RATES, SHARES
from sim.parts.contact.balance import SHARE, Balance
from sim.parts.exchange import Array, ContactState
from sim.spectrum.radial import PLANE, share_of
from sim.units.tables import Pieces

#: Relative distance from equilibrium that rounding leaves.
ROUNDING = 1e-12
#: Share of a radius below which another one is no start for its search: Newton's first step would go far beyond.
_FAR_BELOW = 1e-3


@device
def excess(t, a, scene):
    """Return the missing indentation y, the excess s = (G - w)/work, and the slopes of s with a and with t.

    Below Hertz's radius G continues as -G: only a monotone continuation for the inner
    solver, which never ends there.
    """
    body, stiffness, load, load_rate, base, base_rate, work, work_rate, scale = scene
    terms = punch(a, body)
    mount = load + load_rate * t, base + base_rate * t, stiffness
    y, y_a = missing_depth(terms, mount)
    y_t = -base_rate
    if stiffness < math.inf:
        y_t = -(stiffness * base_rate + load_rate) / (stiffness + terms[3])
    unit = abs(y) / (terms[5] * scale)
    s = unit * y - (work + work_rate * t) / scale
    s_a = unit * (2.0 * y_a - y * (terms[6] / terms[5]))
    return y, s, s_a, 2.0 * unit * y_t - work_rate / scale


@device
def edge_speed(s, front):
    """Return da/dt at an excess s, and its slope with s.

    Closer to equilibrium than rounding resolves, the law is a straight line, because its slope would be 0 or infinite.
    """
    speed, power = (
        (front.speed, front.power) if s > 0.0 else (front.heal_speed, front.heal_power)
    )
    near = ROUNDING if power >= 1.0 else 1e3 * ROUNDING
    if abs(s) < near:
        slope = -speed * math.pow(near, power - 1.0)
        return slope * s, slope
    rate = -math.copysign(speed * math.pow(abs(s), power), s)
    return rate, rate * power / s


@device
def bare_force(t, scene):
    """Return the force on a contact of vanishing radius [N], or the indentation [m] if the stiffness is infinite."""
    base = scene.base + scene.base_rate * t
    return (
        base
        if scene.stiffness == math.inf
        else scene.load + scene.load_rate * t + scene.stiffness * base
    )


@device
def hertz_force(a, scene):
    """Return the bare force of Hertz's contact of radius a."""
    depth, _, load, _, _, _, _ = punch(a, scene.body)
    return depth if scene.stiffness == math.inf else scene.stiffness * depth + load


@device
def hertz_radius(near, t, scene):
    """Return Hertz's radius under the control at t, sought from a radius ``near`` it; 0 if the control does not press.

    A radius far below that without the mount's spring, such as 0 for an open contact, is not near.
    """
    (curvature, modulus, inverse_thickness), force = scene.body, bare_force(t, scene)
    if not force > 0.0:
        return 0.0
    if scene.stiffness == math.inf:
        start = math.sqrt(force / curvature)
        if inverse_thickness == 0.0:
            return start
    else:
        start = np.cbrt(0.75 * force / (curvature * modulus))
    start = near if near > _FAR_BELOW * start else start
    load, base = scene.load + scene.load_rate * t, scene.base + scene.base_rate * t
    mount = load, base, scene.stiffness
    return largest_radius(start, 0.0, 0.0, mount, scene.body)[0]


@device
def at_least_hertz(a, t, scene):
    """Return a radius, or Hertz's at t if that is larger."""
    if a > 0.0 and hertz_force(a, scene) >= bare_force(t, scene):
        return a
    return max(a, hertz_radius(a, t, scene))


@device
def pushed(a, t, scene, front):
    """Return True if Hertz's contact at t grows faster than the edge heals, and its radius, sought from a radius a."""
    stiffness, indenting = scene.stiffness, scene.base_rate
    a = hertz_radius(a, t, scene)
    rate, _ = edge_speed(-(scene.work + scene.work_rate * t) / scene.scale, front)
    _, growth, _, contact_stiffness, _, _, _ = punch(a, scene.body)
    if stiffness < math.inf:
        indenting = (scene.load_rate + stiffness * indenting) / (
            stiffness + contact_stiffness
        )
    return rate <= indenting / growth, a


_S6 = math.sqrt(6.0)
_C1, _C2, _ = NODES.tolist()
_B1, _B2, _B3 = SHARES.tolist()
(_I11, _I12, _I13), (_I21, _I22, _I23), (_I31, _I32, _I33) = RATES.tolist()
#: Weights of the error of the embedded method.
_E1, _E2, _E3 = -(13.0 + 7.0 * _S6) / 3.0, -(13.0 - 7.0 * _S6) / 3.0, -1.0 / 3.0

#: Local error of one inner step, relative to the radius, as the embedded method of order 3 sees it.
TOLERANCE = 1e-8
_TRIES = 3000
_TOUCH = 1e-11
_LEAST = 1e-9
_LONGEST = 0.2
#: Relative change of the radius over which the slope of the work of adhesion is taken.
_NEAR = 1e-6


class Kinetics(NamedTuple):
    """The law of the edge: G - w = work (v/speed)^exponent where it opens, with numbers of its own where it heals."""

    work: float
    speed: float
    exponent: float
    heal_speed: float
    heal_exponent: float


#: Sphere and solid as in ``punch``, stiffness; load, displacement of the base and work of adhesion at the start, each
#: with its rate; unit of the excess.
Scene = namedtuple(
    "Scene", "body stiffness load load_rate base base_rate work work_rate scale"
)
#: Speed and power of an opening edge, and of a healing one.
Front = namedtuple("Front", "speed power heal_speed heal_power")


@device
def _slope_of(running, a, known, speeds):
    """Return ``_slope`` at a radius from ``excess`` without y, ``known``, and from ``edge_speed``."""
    (s, s_a, s_t), (rate, bend) = known, speeds
    if not running:
        return rate, bend * s_a, bend * s_t, s * a
    if not rate < 0.0:
        return math.nan, 0.0, 0.0, 0.0
    pace = -a / rate
    growth = bend / rate
    return pace, -pace * growth * s_t, pace * (growth * s_a * a - 1.0), s * a * a


@device
def _slope(running, x, y, start, scene, front):
    """Return the right side of the equation to integrate, its slopes with y and with x, and s times an area.

    Normally y is the radius and x the time; ``running``, y is the time and x the logarithm
    of start/radius. The last number times \\|dy\\| (times dx, ``running``) is energy over 2 pi work.
    """
    t, a = (y, start * math.exp(-x)) if running else (x, y)
    _, s, s_a, s_t = excess(t, a, scene)
    return _slope_of(running, a, (s, s_a, s_t), edge_speed(s, front))


@device
def _solved(m11, m22, m33, r1, r2, r3):
    """Solve for the inverse matrix of the method with another diagonal, by Cramer's rule."""
    c1 = m22 * m33 - _I23 * _I32
    c2 = _I21 * m33 - _I23 * _I31
    c3 = _I21 * _I32 - m22 * _I31
    d = 1.0 / (m11 * c1 - _I12 * c2 + _I13 * c3)
    x1 = d * (r1 * c1 - _I12 * (r2 * m33 - _I23 * r3) + _I13 * (r2 * _I32 - m22 * r3))
    x2 = d * (m11 * (r2 * m33 - _I23 * r3) - r1 * c2 + _I13 * (_I21 * r3 - r2 * _I31))
    x3 = d * (m11 * (m22 * r3 - r2 * _I32) - _I12 * (_I21 * r3 - r2 * _I31) + r1 * c3)
    return x1, x2, x3


@device
def _stages(step, changes, start, scene, front):
    """Return the three stages' residuals, slopes and excesses, and the size of the residuals as a length.

    ``step`` is as in ``_radau``, ``changes`` are those of y to the stages.

    A residual counts by the change of radius that would remove it, because opening and healing may differ by
    decades in speed.
    """
    (running, x, y, h), (z1, z2, z3) = step, changes
    if not (running or (y + z1 > 0.0 and y + z2 > 0.0 and y + z3 > 0.0)):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, math.inf
    f1, j1, _, s1 = _slope(running, x + _C1 * h, y + z1, start, scene, front)
    f2, j2, _, s2 = _slope(running, x + _C2 * h, y + z2, start, scene, front)
    f3, j3, _, s3 = _slope(running, x + h, y + z3, start, scene, front)
    r1 = _I11 * z1 + _I12 * z2 + _I13 * z3 - h * f1
    r2 = _I21 * z1 + _I22 * z2 + _I23 * z3 - h * f2
    r3 = _I31 * z1 + _I32 * z2 + _I33 * z3 - h * f3
    misfit = (
        abs(r1) / (1.0 + h * abs(j1))
        + abs(r2) / (1.0 + h * abs(j2))
        + abs(r3) / (1.0 + h * abs(j3))
    )
    return r1, r2, r3, j1, j2, j3, s1, s2, s3, misfit


@device
def _radau(step, size, first, start, scene, front):
    """Return change of y, error over tolerance (nan: no solution) and energy/(2 pi work) of a step of Radau IIA.

    ``step``: true if the edge runs, x and y at its start, and its length.

    Newton's steps are halved while they do not lower the residual. The error is that of the embedded method, filtered
    by the slope at the end. The method steps over a fast layer narrower than the tolerance, but not over a turn from a
    fast edge to a slow one. The energy is the quadrature of the method, of positive weights and signs.
    """
    (running, _, _, h), (f, j, f_x) = step, first
    g1, g2, g3 = _C1 * h, _C2 * h, h
    z1 = g1 * (f + 0.5 * g1 * f_x) / (1.0 + 0.5 * g1 * abs(j))
    z2 = g2 * (f + 0.5 * g2 * f_x) / (1.0 + 0.5 * g2 * abs(j))
    z3 = g3 * (f + 0.5 * g3 * f_x) / (1.0 + 0.5 * g3 * abs(j))
    now = _stages(step, (z1, z2, z3), start, scene, front)
    if not now[9] < math.inf:
        z1 = z2 = z3 = 0.0
        now = _stages(step, (z1, z2, z3), start, scene, front)
    for _ in range(20):
        r1, r2, r3, j1, j2, j3, s1, s2, s3, residual = now
        if not residual < math.inf:
            return 0.0, math.nan, 0.0
        d1, d2, d3 = _solved(_I11 - h * j1, _I22 - h * j2, _I33 - h * j3, r1, r2, r3)
        change = max(abs(d1), abs(d2), abs(d3))
        if change <= 1e-3 * TOLERANCE * size:
            z1, z2, z3 = z1 - d1, z2 - d2, z3 - d3
            error = (h * f + _E1 * z1 + _E2 * z2 + _E3 * z3) / (PACE - h * min(0.0, j3))
            v1 = _I11 * z1 + _I12 * z2 + _I13 * z3
            v2 = _I21 * z1 + _I22 * z2 + _I23 * z3
            v3 = _I31 * z1 + _I32 * z2 + _I33 * z3
            if running:
                v1 = v2 = v3 = h
            energy = _B1 * abs(s1 * v1) + _B2 * abs(s2 * v2) + _B3 * abs(s3 * v3)
            return z3, abs(error) / (TOLERANCE * size), energy
        if not change < math.inf:
            return 0.0, math.nan, 0.0
        for _ in range(12):
            halved = z1 - d1, z2 - d2, z3 - d3
            now = _stages(step, halved, start, scene, front)
            if now[9] < residual:
                break
            d1, d2, d3 = 0.5 * d1, 0.5 * d2, 0.5 * d3
        z1, z2, z3 = z1 - d1, z2 - d2, z3 - d3
    return 0.0, math.nan, 0.0


@device
def _ride(t, a, end, least, scene, front):
    """Follow Hertz's contact from t to ``end`` at most, or until the edge leaves it; return time, radius and energy.

    The energy is that of new area against G = 0, int w a da. Gauss's three points are exact because work and force are
    linear in time. None is counted for w <= 0, because pressing pays for the area.
    """
    riding, b = pushed(a, end, scene, front)
    if not riding:
        low, high = t, end
        for _ in range(60):
            middle = 0.5 * (low + high)
            riding, b = pushed(b, middle, scene, front)
            low, high = (middle, high) if riding else (low, middle)
        end = high
        _, b = pushed(b, end, scene, front)
    if b <= least and b < a:
        b, before, after = min(a, least), bare_force(t, scene), bare_force(end, scene)
        end = t + (end - t) * min(
            max((before - hertz_force(b, scene)) / (before - after), 0.0), 1.0
        )
    energy = 0.0
    if b > a and scene.work + scene.work_rate * 0.5 * (t + end) > 0.0:
        low, span = hertz_force(a, scene), hertz_force(b, scene) - hertz_force(a, scene)
        for node, weight in (
            (-math.sqrt(0.6), 5.0 / 18.0),
            (0.0, 8.0 / 18.0),
            (math.sqrt(0.6), 5.0 / 18.0),
        ):
            c = 0.5 * (a + b) + 0.5 * node * (b - a)
            moment = t + (end - t) * (hertz_force(c, scene) - low) / span
            energy += (
                weight
                * (b - a)
                * c
                * max(0.0, scene.work + scene.work_rate * moment)
                / scene.scale
            )
    return end, b, energy


@device
def _fallback(t, a, stop, least, scene, front):
    """Return radius and energy after one implicit Euler step to ``stop``, if the adaptive steps are used up.

    The root nearest to the present radius is bracketed by stepping, then bisected.
    """
    s = excess(stop, a, scene)[1]
    rate, _ = edge_speed(s, front)
    factor, low, energy = (0.98 if s > 0.0 else 1.02), a, 0.0
    for _ in range(4000):
        if rate == 0.0 or not low > least:
            break
        high = low * factor
        s = excess(stop, high, scene)[1]
        f, _ = edge_speed(s, front)
        if (high - a - (stop - t) * f) * rate >= 0.0:
            for _ in range(60):
                middle = 0.5 * (low + high)
                f, _ = edge_speed(excess(stop, middle, scene)[1], front)
                low, high = (
                    (low, middle)
                    if (middle - a - (stop - t) * f) * rate >= 0.0
                    else (middle, high)
                )
            break
        energy += abs(s * high * (high - low))
        low = high
    return at_least_hertz(low, stop, scene), energy


@device
def _runs(a, rate, bend, s_a, s_t, left):
    """True if the edge runs open: it loses much of the radius in the time left, without slowing down soon."""
    if not -rate * left > 0.1 * a:
        return False
    growth = bend / rate
    return growth * s_a * a < 3.0 and growth * s_t * a > 0.3 * rate


@device
def _try(step, size, first, a, scene, front):
    """Return time and radius after an inner step, error over tolerance, and energy/(2 pi work).

    ``step``: as in ``_radau``, from the radius a. ``first``: ``_slope`` at its start.
    """
    (running, x, y, h), (f, j, f_x, _) = step, first
    change, error, energy = _radau(step, size, (f, j, f_x), a, scene, front)
    if running:
        return y + change, a * math.exp(-h), error, energy
    return x + h, a + change, error, energy


@device
def _piece(t, a, stop, least, tries, scene, front):
    """Advance to ``stop``; return time, radius or 0 if open, energy/(2 pi work), and tries left.

    A time below ``stop`` with a radius means that the tries are used up.
    """
    energy, h, tick = 0.0, 0.0, 0.125 * (stop - t)
    was = cross = shy = refused = False
    while t < stop and tries > 0:
        tries -= 1
        y, s, s_a, s_t = excess(t, a, scene)
        rate, bend = edge_speed(s, front)
        if y <= _TOUCH * a * a * scene.body[0] and pushed(a, t, scene, front)[0]:
            t, a, more = _ride(t, a, min(stop, t + tick), least, scene, front)
            energy, h = energy + more, 0.0
            if a <= least:
                return t, 0.0, energy, tries
            continue
        if a <= least and rate < 0.0:
            return t, 0.0, energy, tries
        running = (
            rate < 0.0
            and not shy
            and (cross or _runs(a, rate, bend, s_a, s_t, stop - t))
        )
        # first step, longest step, and size of an error that counts, in the time or, running, in the logarithm
        first, longest, reach, size = (
            min(stop - t, 0.1 * a / abs(rate)),
            stop - t,
            stop - t,
            a,
        )
        if running:
            reach, size = math.log(a / least), 1e-3 * stop - a / rate
            first, longest = 0.1, min(reach, _LONGEST)
        h = min(first if running != was or h == 0.0 else h, longest)
        was, whole = running, h == reach
        step = (running, 0.0, t, h) if running else (running, t, a, h)
        slope = _slope_of(running, a, (s, s_a, s_t), (rate, bend))
        t1, a1, error, more = _try(step, size, slope, a, scene, front)
        if not error < math.inf:
            shy, h = True, (0.0 if running else 0.25 * h)
            continue
        if error > 1.0:
            h *= 0.1 if refused else max(0.1, 0.9 * error**-0.25)
            refused = True
            continue
        refused = False
        if (
            running
            and t1 > stop
            and not (cross and whole and t1 - stop < 1e-6 * (stop - t))
        ):
            h *= 0.8 * (stop - t) / (t1 - t)
            continue
        if not running and a1 < min(least, a):
            cross = True
            continue
        y1, _, _, _ = excess(t1, a1, scene)
        edge = _TOUCH * a1 * a1 * scene.body[0]
        if y1 < -edge and y > edge:
            h *= max(1e-6, y / (y - y1))
            continue
        t, energy, shy = (
            (stop if whole and not running else min(t1, stop)),
            energy + more,
            False,
        )
        a = at_least_hertz(a1, t, scene) if y1 < edge else a1
        if running and whole:
            return t, 0.0, energy, tries
        h *= min(8.0, 0.9 * max(error, 1e-12) ** -0.25)
    return t, a, energy, tries


@device
def _member(a, duration, least, scene, front):
    """Return radius or nan, time of detachment or nan, and dissipated energy of a member after a clock step."""
    a = at_least_hertz(a, 0.0, scene)
    if not a > 0.0:
        return math.nan, math.nan, 0.0
    ends = (bare_force(0.0, scene), bare_force(duration, scene))
    first = _zero(scene.work, scene.work + scene.work_rate * duration, duration)
    second = _zero(ends[0], ends[1], duration)
    t, energy, tries = 0.0, 0.0, _TRIES
    for stop in (min(first, second), max(first, second), duration):
        if t < stop:
            t, a, more, tries = _piece(t, a, stop, least, tries, scene, front)
            energy += more
            if a > 0.0 and t < stop:
                a, more = _fallback(t, a, stop, least, scene, front)
                t, energy = stop, energy + more
                if a <= least:
                    a = 0.0
            if not a > 0.0:
                return math.nan, t, 2.0 * math.pi * scene.scale * energy
    return a, math.nan, 2.0 * math.pi * scene.scale * energy


@device
def _zero(before, after, duration):
    """Return the time at which a number that changes linearly changes sign; the end if it does not."""
    if (before < 0.0) == (after < 0.0):
        return duration
    return duration * min(max(before / (before - after), 0.0), 1.0)


@device
def scene_of(works, mount, duration, scale, bodies):
    """Return the ``Scene`` of work, load and displacement at both ends of a time; ``mount`` is as in ``moved_edge``."""
    loads, bases, stiffness = mount
    per = 1.0 / duration if duration > 0.0 else 0.0
    load, base = (
        (0.0 if stiffness == math.inf else loads[0]),
        (0.0 if stiffness == 0.0 else bases[0]),
    )
    load_rate = 0.0 if stiffness == math.inf else (loads[1] - loads[0]) * per
    base_rate = 0.0 if stiffness == 0.0 else (bases[1] - bases[0]) * per
    work_rate = (works[1] - works[0]) * per
    return Scene(
        bodies,
        stiffness,
        load,
        load_rate,
        base,
        base_rate,
        works[0],
        work_rate,
        scale,
    )


@device
def moved_edge(a, works, mount, duration, kinetics, bodies, least):
    """Return radius, time of detachment and dissipated energy of an edge after a time of linear work and control.

    Parameters
    ----------
    a : float
        Radius at the start [m]; nan or 0 for an open contact, which stays open. It is at least Hertz's.
    works : pair of floats
        Work of adhesion w of any sign [J/m^2] at start and end.
    mount : tuple
        Loads [N] and displacements of the base [m] at start and end, and the stiffness behind the base [N/m], 0 to inf.
    duration : float
        Length of the time [s].
    kinetics : Kinetics or tuple
        Reference work [J/m^2], speeds [m/s] and exponents [1] of opening and healing. A speed of 0 or infinity
        freezes the edge or leaves it in equilibrium.
    bodies : three floats
        1/R [1/m], E* [Pa], 1/h [1/m].
    least : float
        Radius at which a shrinking contact counts as open [m], at least 1e-9 of the radius at the start. Under a dead
        load the energy grows like 1/radius towards the end, because the load falls ever deeper; the time hardly
        depends on it.

    Returns
    -------
    tuple
        The radius at the end [m], nan if open; the time since the start at which it opened [s], nan if it did
        not; int \\|G - w\\| 2 pi a \\|da\\| [J] until then. If a number is nan or invalid all three are nan.

    Notes
    -----
    Exponents above 1, with an edge that is infinitely mobile at rest, are expensive and lose digits in stiff
    cases. If pressing advances the edge faster than it heals, w dA is dissipated for w > 0, and nothing for w <= 0.
    """
    scale, speed, exponent, heal_speed, heal_exponent = kinetics
    loads, bases, stiffness = mount
    scene = scene_of(works, mount, duration, scale, bodies)
    ends = abs(scene.load) + abs(scene.base) + abs(works[0]) + abs(works[1])
    ends += (0.0 if stiffness == math.inf else abs(loads[1])) + (
        0.0 if stiffness == 0.0 else abs(bases[1])
    )
    positive = min(scale, exponent, heal_exponent, bodies[0], bodies[1])
    wide = max(
        abs(a), scale, exponent, heal_exponent, bodies[0], bodies[1], duration, least
    )
    lowest = min(stiffness, duration, speed, heal_speed, least)
    if ends + wide < math.inf and positive > 0.0 and lowest >= 0.0:
        per = 1.0 / duration if duration > 0.0 else 0.0
        power, heal_power = 1.0 / exponent, 1.0 / heal_exponent
        speed = min(speed, a * per * min(ROUNDING**-power, 1e250))
        heal_speed = min(heal_speed, a * per * min(ROUNDING**-heal_power, 1e250))
        front = Front(speed, power, heal_speed, heal_power)
        end, opened, energy = _member(a, duration, max(least, _LEAST * a), scene, front)
        if energy < math.inf and end != math.inf:
            return end, opened, energy
    return math.nan, math.nan, (0.0 if math.isnan(a) or a <= 0.0 else math.nan)


#: Radius of a first touch over the length (w R²/E*)^(1/3) of adhesive contacts.
_SPOT = 1e-3
_READ = "Array(float64, 2, 'A', readonly=True)"


@device
def _left(radius, bonded, fluctuating, reversible, share, inverse_thickness):
    """Return the work of adhesion left at a radius; of an open contact that of a vanishing one."""
    size, part = (0.0 if math.isnan(radius) else radius), 1.0
    if len(share[2]) > 0:
        part = share_of(size, share[0], share[1], share[2]) if size > 0.0 else 0.0
    if reversible > 0.0:
        size, _ = stress_reach(size, inverse_thickness)
    return bonded - fluctuating * part - reversible * size


@device
def _energy(t, a, scene):
    """Return the energy of a contact above that of an open one: elastic, of the spring or the load, of adhesion."""
    body, stiffness, load, load_rate, base, base_rate, work, work_rate, _ = scene
    indentation = punch(a, body)[0] - excess(t, a, scene)[0]
    energy = elastic_energy(a, indentation, body)
    energy -= (load + load_rate * t) * indentation + math.pi * a * a * (
        work + work_rate * t
    )
    if stiffness < math.inf:
        stretch = base + base_rate * t - indentation
        energy += 0.5 * stiffness * stretch * stretch
    return energy


@device
def _moved(radius, touches, works, mount, duration, kinetics, bodies, spot):
    """Return radius or nan, time of opening or nan, and dissipated energy after a part of a clock step.

    Energy that is stored as the edge opens counts as dissipated, and so does the energy that a spot gains at a touch.
    Under a load nothing counts below the radius at pull-off, because the work of the load diverges as the radius
    vanishes.
    """
    a = spot if touches else radius
    if math.isnan(a):
        return math.nan, math.nan, 0.0
    end, opened, lost = moved_edge(
        a, works, mount, duration, kinetics, bodies, 0.5 * spot
    )
    scene = scene_of(works, mount, duration, kinetics[0], bodies)
    (loads, _, stiffness), opens = mount, math.isnan(end)
    if stiffness == 0.0:
        if opens or (loads[1] < 0.0 and radius < load_fold(works[1], bodies)):
            lost = 0.0
    elif opens:
        lost += max(_energy(opened, 0.5 * spot, scene), 0.0)
    if touches:
        lost += max(-_energy(0.0, at_least_hertz(spot, 0.0, scene), scene), 0.0)
    return end, opened, lost


@device
def _is_unstable(t, a, steepness, scene):
    """Return True if an edge at the radius a opens further by itself: if G - w falls as the contact grows.

    ``steepness`` is the slope of w over the radius [J/m^3].
    """
    y, _, s_a, _ = excess(t, a, scene)
    return y > 0.0 and scene.scale * s_a < steepness


@device
def _borne(t, a, scene):
    """Return the normal load [N] and the displacement of the mount [m] of a contact of radius a."""
    y, (depth, _, load, stiffness, _, _, _) = (
        excess(t, a, scene)[0],
        punch(a, scene.body),
    )
    if scene.stiffness == 0.0:
        return scene.load + scene.load_rate * t, depth - y
    return load - stiffness * y, scene.base + scene.base_rate * t


@device
def _weakest(turn, radii, begin, duration, steepness, scene):
    """Return the time, load and displacement of the lowest load since a contact lost its stability.

    Parameters
    ----------
    turn : tuple of floats
        Those at the start of a part of a clock step, nan if the contact was stable.
    radii : pair of floats
        Radius at start and end of this part; 0 at the end if the contact opens there.
    begin, duration : float
        Start and length of the part.
    steepness : float
        Slope of the work of adhesion over the radius.
    scene : Scene
        The part.

    Notes
    -----
    The radius is taken as linear in time, to find the place at which the contact loses its stability. A contact that
    is stable until it opens is Hertz's, which bears nothing in the end.
    """
    first, last = radii
    opens = not last > 0.0
    if not (opens or _is_unstable(duration, last, steepness, scene)):
        return math.nan, math.nan, math.nan
    time, load, displacement = turn
    if math.isnan(time):
        stable, unstable = 0.0, 1.0
        if _is_unstable(0.0, first, steepness, scene):
            unstable = 0.0
        while unstable - stable > ROUNDING:
            middle = 0.5 * (stable + unstable)
            a = first + middle * (last - first)
            if _is_unstable(middle * duration, a, steepness, scene):
                unstable = middle
            else:
                stable = middle
        t = unstable * duration
        time = begin + t
        if unstable == 1.0 and opens:
            return time, 0.0, scene.base + scene.base_rate * t
        a = first + unstable * (last - first)
        load, displacement = _borne(t, a, scene)
    if not opens:
        load_now, displacement_now = _borne(duration, last, scene)
        if load_now < load:
            return begin + duration, load_now, displacement_now
    return time, load, displacement


@kernel(
    "void(float64[:, ::1], Tuple((float64[::1], int64[::1], float64[:, ::1], float64)),"
    f" Tuple(({_READ}, {_READ}, {_READ}, {SHARE})),"
    " Tuple((UniTuple(float64, 5), UniTuple(float64, 3), float64, boolean)), float64[:, :, ::1])"
)
def _follow(state, control, terms, edge, out):
    """Write the rows of ``follow`` at the end of each step.

    ``control``: lengths of the steps, first piece of each, the pieces, and the stiffness. ``terms``: those of the work
    of adhesion. ``edge``: its kinetics, the bodies, the radius of a first touch, and true if it closes again.
    """
    durations, opening, pieces, stiffness = control
    bonded, fluctuating, reversible, share = terms
    kinetics, bodies, spot, again = edge
    for m in range(state.shape[1]):
        work, radius, detached, dissipated = (
            state[0, m],
            state[1, m],
            state[2, m],
            state[3, m],
        )
        turn = state[4, m], state[5, m], state[6, m]
        for k in range(len(durations)):
            if math.isnan(radius):
                turn = math.nan, math.nan, math.nan
            energies = bonded[k, m], fluctuating[k, m], reversible[k, m]
            last = _left(radius, *energies, share, bodies[2])
            first, end = (last if math.isnan(radius) else work), 0.0
            for p in range(opening[k], opening[k + 1]):
                begin, end = end, pieces[1, p]
                works = (
                    (1.0 - begin) * first + begin * last,
                    (1.0 - end) * first + end * last,
                )
                course, none = (pieces[2, p], pieces[3, p]), (0.0, 0.0)
                mount = (course, none, stiffness)
                if stiffness > 0.0:
                    mount = (none, course, stiffness)
                touches = (
                    math.isnan(radius)
                    and (math.isnan(detached) or again)
                    and course[0] >= 0.0
                )
                closed, duration = (
                    touches or not math.isnan(radius),
                    durations[k] * (end - begin),
                )
                first_radius = spot if touches else radius
                radius, opened, lost = _moved(
                    radius, touches, works, mount, duration, kinetics, bodies, spot
                )
                dissipated += lost
                if not closed:
                    continue
                start, steepness = pieces[0, p] - duration, 0.0
                scene = scene_of(works, mount, duration, kinetics[0], bodies)
                if reversible[k, m] > 0.0 or len(share[2]) > 0:
                    wide, narrow = (
                        (1.0 + _NEAR) * first_radius,
                        (1.0 - _NEAR) * first_radius,
                    )
                    change = _left(wide, *energies, share, bodies[2])
                    change -= _left(narrow, *energies, share, bodies[2])
                    steepness = change / (wide - narrow)
                radii = first_radius, radius
                if math.isnan(radius):
                    detached, duration = start + opened, opened
                    radii = first_radius, 0.0
                turn = _weakest(turn, radii, start, duration, steepness, scene)
            work = _left(radius, *energies, share, bodies[2])
            out[0, k, m], out[1, k, m], out[2, k, m], out[3, k, m] = (
                work,
                radius,
                detached,
                dissipated,
            )
            out[4, k, m], out[5, k, m], out[6, k, m] = turn


def follow(
    state: ContactState,
    durations: Array,
    pieces: Pieces,
    stiffness: float,
    balance: Balance,
    reversible: float,
    kinetics: Kinetics,
    again: bool,
) -> tuple[Array, ...]:
    """Return the ``ContactState`` without its phases at the end of each step of a block.

    Parameters
    ----------
    state : ContactState
        The contact before the block.
    durations : array, shape (steps,)
        Lengths of the steps [s].
    pieces : Pieces
        The control in each step: the displacement of the base behind a ``stiffness`` [N/m], infinite for an
        indentation, or for a stiffness of 0 the load.
    balance : Balance
        Terms of the work of adhesion at the end of each step, of which the mean stress takes the share
        ``reversible``. Terms that depend on the radius are those of the radius at the start of the step.
    kinetics : Kinetics
        The law of the edge.
    again : bool
        True if a contact that has pulled off closes again as the free sphere touches.
    """
    opening = np.searchsorted(pieces.interval, np.arange(len(durations) + 1))
    begin, end = pieces.start[opening[:-1]], pieces.stop[opening[1:] - 1]
    shares = (pieces.stop - begin[pieces.interval]) / (end - begin)[pieces.interval]
    of_stress = reversible * balance.tilt if reversible else np.zeros(1)
    of_steps = balance.bonded, balance.fluctuating, of_stress
    _, rows = np.broadcast_shapes(
        state.radius.shape, *((1, *values.shape)[-2:] for values in of_steps)
    )
    before = np.empty((4 + state.turn.shape[-1], rows))
    out = np.empty((len(before), len(durations), rows))
    for row, values in zip(before, [*state[:4], *state.turn.T], strict=True):
        row[:] = values
    bodies = balance.bodies
    spot = _SPOT * math.cbrt(
        balance.reference * bodies.sphere_radius**2 / bodies.modulus
    )
    course = np.array([pieces.stop, shares, pieces.first, pieces.last])
    share = PLANE if balance.margin is None else balance.margin.each[0]
    terms = (np.broadcast_to(values, out.shape[1:]) for values in of_steps)
    _follow(
        before,
        (durations, opening, course, stiffness),
        (*terms, share),
        (tuple(kinetics), bodies.body, spot, again),
        out,
    )
    return *out[:4], np.moveaxis(out[4:], 0, -1)
