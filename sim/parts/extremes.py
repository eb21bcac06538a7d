"""Largest stress, friction and pull of a run so far, followed at every step and refined between steps."""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.exchange import Array, Bonding, Motion

#: Arrays that are read alone, as they come.
_READ = "Array(float64, 1, 'A', readonly=True), "
#: Change over a step, by the slope at one of its ends, over the value, up to which a cubic holds.
_RESOLVED = 5.0
#: Columns of a running maximum: the last value but one, the last value, the maximum so far, and its time [s].
BEFORE, LAST, LARGEST, WHEN = range(4)


class Extremes(NamedTuple):
    """Running maxima over the clock steps, each of shape (rows, 4); nan counts as 0, and of equals the first is kept.

    ``stress`` is that of the shear stress [Pa] and ``friction`` that of the friction force [N], in magnitude; ``pull``
    is that of the tensile load of a closed contact [N], followed where the control makes the load.
    """

    stress: Array
    friction: Array
    pull: Array


def first(bonding: Bonding, radius: Array, pull: Array) -> Extremes:
    """Maxima at t = 0 of the bonds' stress, of friction over a contact radius [m] and of a pull [N]."""
    stress = np.abs(bonding.stress)
    return Extremes(*(_started(np.nan_to_num(values)) for values in (stress, stress * (np.pi * radius**2), pull)))


def _started(values: Array) -> Array:
    return np.stack([np.full(values.shape, -np.inf), values, values, np.zeros(values.shape)], axis=1)


def after(
    so_far: Extremes, ends: tuple[Bonding, Bonding], radii: tuple[Array, Array], pull: Array, motion: Motion
) -> Extremes:
    """Maxima one step later, from bonds and contact radii [m] at its beginning and end, and the pull at its end.

    Notes
    -----
    The slope of the stress over time is ``stiffness`` × speed + ``relaxation``, and the area is taken as linear within
    a step. Where the slopes are known, a maximum between the ends is that of the cubic through values and slopes, of
    fourth order, if neither slope alone would change the value by more than five times its size within the step. Where
    they are not, and for the pull, a sample above its two neighbours is refined by the parabola
    through the three, of third order, if both neighbours have more than half of its value: a quantity that jumps is
    not smooth there.
    """
    (one, two), (radius_one, radius_two) = ends, radii
    rows = max(len(so_far.stress), len(two.stress))
    members = max(rows, len(so_far.friction), len(radius_two))
    stress, friction = np.empty((rows, 4)), np.empty((members, 4))
    pulled = np.empty((max(len(so_far.pull), len(pull)), 4))
    _follow(
        *so_far, one.stress, one.stiffness, one.relaxation, motion.first, radius_one,
        two.stress, two.stiffness, two.relaxation, motion.speed, radius_two,
        pull, motion.time, motion.duration, stress, friction, pulled,
    )  # fmt: skip
    return Extremes(stress, friction, pulled)


@device
def _of(values, i):
    """The value of a member, where all may share one."""
    return values[i] if len(values) > 1 else values[0]


@device
def _load(i, stress, stiffness, relaxation, speed, radius):
    """Magnitude of the stress, its slope over time, and the area."""
    value, area = _of(stress, i), math.pi * _of(radius, i) ** 2
    slope = _of(stiffness, i) * _of(speed, i) + _of(relaxation, i)
    return math.fabs(value), (slope if value > 0.0 else -slope if value < 0.0 else math.fabs(slope)), area


@kernel(f"void({3 * 'float64[:, ::1], '}{11 * _READ}float64, float64, {', '.join(3 * ['float64[:, ::1]'])})")
def _follow(
    stresses, frictions, pulls, s0, k0, r0, v0, a0, s1, k1, r1, v1, a1, pull, time, step, stress, friction, pulled
):
    for i in range(len(friction)):
        value0, slope0, area0 = _load(i, s0, k0, r0, v0, a0)
        value1, slope1, area1 = _load(i, s1, k1, r1, v1, a1)
        if i < len(stress):
            _keep(stresses[i if len(stresses) > 1 else 0], value1, slope0, slope1, time, step, stress[i])
        growth = (area1 - area0) / step
        rise, slope = area0 * slope0 + growth * value0, area1 * slope1 + growth * value1
        _keep(frictions[i if len(frictions) > 1 else 0], value1 * area1, rise, slope, time, step, friction[i])
    for i in range(len(pulled)):
        _keep(pulls[i if len(pulls) > 1 else 0], _of(pull, i), math.nan, math.nan, time, step, pulled[i])


@device
def _keep(maximum, now, rise, slope, time, step, kept):
    """Maximum after a value ``now`` at ``time``, with slopes at both ends of the step, nan where not known."""
    before, last, largest, when = maximum[BEFORE], maximum[LAST], maximum[LARGEST], maximum[WHEN]
    now = 0.0 if math.isnan(now) else now
    if now > largest:
        largest, when = now, time
    peak, back = -math.inf, 0.0
    if rise > 0.0 > slope and step * max(rise, -slope) < _RESOLVED * max(last, now):
        peak, back = _top(last, now, step * rise, step * slope)
    elif math.isnan(rise + slope) and last >= before and last > now and min(before, now) > 0.5 * last:
        back = 1.0 - 0.5 * (before - now) / (before - 2.0 * last + now)
        peak = last - 0.25 * (before - now) * (1.0 - back)
    if peak > largest:
        largest, when = peak, time - back * step
    kept[BEFORE], kept[LAST], kept[LARGEST], kept[WHEN] = last, now, largest, when


@device
def _top(last, now, rise, slope):
    """Maximum of the cubic with these values and slopes, up then down, over a unit interval; how far before its end.

    The derivative ``rise + 2 b s + c s²`` has one zero between the ends, since it changes its sign there.
    """
    b, c = 3.0 * (now - last) - 2.0 * rise - slope, 3.0 * (rise + slope) - 6.0 * (now - last)
    s = rise / (math.sqrt(max(b * b - rise * c, 0.0)) - b)
    return last + s * (rise + s * (b + s * c / 3.0)), 1.0 - s
