"""Largest stress, friction and pull of a run so far, followed at every step and refined between steps."""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.exchange import Array, Bonding, Motion, during, record

#: Arrays that are read alone, as they come.
_READ = "Array(float64, 2, 'A', readonly=True), "
#: What a stress and its slope follow from.
_OF_THE_STRESS = "stress", "stiffness", "relaxation"
#: Change over a step, by the slope at one of its ends, over the value, up to which a cubic holds.
_RESOLVED = 5.0
#: Row of a running maximum: the last value but one, the last value, the maximum so far, and its time [s].
MAXIMUM = record("before last largest time")


class Events(NamedTuple):
    """Running maxima over the clock steps, rows of ``MAXIMUM``; NaN counts as 0; ties keep the first.

    ``stress`` is that of the shear stress [Pa] and ``friction`` that of the friction force [N], in magnitude; ``pull``
    is that of the tensile load of a closed contact [N], followed where the control makes the load. ``path`` is the
    longest path within a step [m], shape (1,) or (members,).
    """

    stress: Array
    friction: Array
    pull: Array
    path: Array


def first(bonding: Bonding, radius: Array, pull: Array) -> Events:
    """Maxima at t = 0 of the bonds' stress, of friction over a contact radius [m] and of a pull [N]."""
    stress = np.abs(bonding.stress)
    maxima = (_started(np.nan_to_num(values)) for values in (stress, stress * (np.pi * radius**2), pull))
    return Events._make([*maxima, np.zeros(1)])


def column(name: str, maxima: Array) -> Array:
    """Return a column of running maxima by its name in ``MAXIMUM``."""
    values: Array = maxima.view(MAXIMUM)[:, 0][name]
    return values


def _started(values: Array) -> Array:
    return np.stack([np.full(values.shape, -np.inf), values, values, np.zeros(values.shape)], axis=1)


def after(
    so_far: Events, before: tuple[Bonding, Array], bonding: Bonding, radius: Array, pull: Array, motions: Motion,
    with_path: bool = False,
) -> Events:  # fmt: skip
    """Maxima a block of steps later, from the bonds, contact radius [m] and pull [N] at the end of each.

    ``before`` are bonds and contact radius at its start. The path is followed only ``with_path``.

    Notes
    -----
    The slope of the stress over time is ``stiffness`` × speed + ``relaxation``, and the area is taken as linear within
    a step. Where the slopes are known, a maximum between the ends is that of the cubic through values and slopes, of
    fourth order, if neither slope alone would change the value by more than five times its size within the step. Where
    they are not, and for the pull, a sample above its two neighbours is refined by the parabola
    through the three, of third order, if both neighbours have more than half of its value: a quantity that jumps is
    not smooth there.
    """
    start, radius_before = before
    stress, stiffness, relaxation = (
        _with_start(getattr(start, name), getattr(bonding, name), len(radius)) for name in _OF_THE_STRESS
    )
    radii = _with_start(radius_before, radius, len(radius))
    rows = max(len(so_far.stress), stress.shape[1])
    members = max(rows, len(so_far.friction), radii.shape[1])
    counts = rows, members, max(len(so_far.pull), pull.shape[1])
    largest = [values + np.zeros((count, 1)) for values, count in zip(so_far[:-1], counts, strict=True)]
    ends = motions.first, motions.speed, motions.time[:, 0], motions.duration[:, 0]
    _follow(stress, stiffness, relaxation, radii, pull, *ends, *largest)
    path = np.maximum(so_far.path, motions.path.max(axis=0)) if with_path else so_far.path
    return Events._make([*largest, path])


def _with_start(before: Array, values: Array, steps: int) -> Array:
    """Values at the start of a block and at the end of each step, shape (steps + 1, rows)."""
    if values.ndim == 1:
        return during(values, steps + 1)
    return np.concatenate([before[np.newaxis], values])


@device
def _of(values, k, i):
    """Return the value of a member at a time; all members may share a column."""
    return values[k, i if values.shape[1] > 1 else 0]


@device
def _load(k, i, stress, stiffness, relaxation, speed, radius):
    """Magnitude of the stress, its slope over time at a speed, and the area."""
    value, area = _of(stress, k, i), math.pi * _of(radius, k, i) ** 2
    slope = _of(stiffness, k, i) * speed + _of(relaxation, k, i)
    return math.fabs(value), (slope if value > 0.0 else -slope if value < 0.0 else math.fabs(slope)), area


@kernel(f"void({7 * _READ}{2 * 'float64[:], '}{', '.join(3 * ['float64[:, ::1]'])})")
def _follow(stresses, stiffness, relaxation, radii, pulls, first, speed, times, steps, stress, friction, pull):
    bonds = stresses, stiffness, relaxation
    for k in range(len(times)):
        time, step = times[k], steps[k]
        for i in range(len(friction)):
            value0, slope0, area0 = _load(k, i, *bonds, _of(first, k, i), radii)
            value1, slope1, area1 = _load(k + 1, i, *bonds, _of(speed, k, i), radii)
            if i < len(stress):
                _keep(value1, slope0, slope1, time, step, stress[i])
            growth = (area1 - area0) / step
            rise, slope = area0 * slope0 + growth * value0, area1 * slope1 + growth * value1
            _keep(value1 * area1, rise, slope, time, step, friction[i])
        for i in range(len(pull)):
            _keep(_of(pulls, k, i), math.nan, math.nan, time, step, pull[i])


@device
def _keep(now, rise, slope, time, step, maximum):
    """Replace a maximum by that after a value ``now`` at ``time``; slopes at both ends of the step, nan if unknown."""
    before, last, largest, when = (
        maximum[0],
        maximum[1],
        maximum[2],
        maximum[3],
    )  # numbers, as a view of a record for each costs twice the time
    now = 0.0 if math.isnan(now) else now
    if now > largest:
        largest, when = now, time
    peak, back = -math.inf, 0.0
    steepest, larger = rise if rise > -slope else -slope, last if last > now else now  # max compiles for long
    if rise > 0.0 > slope and step * steepest < _RESOLVED * larger:
        peak, back = _top(last, now, step * rise, step * slope)
    elif math.isnan(rise + slope) and last >= before and last > now and before > 0.5 * last and now > 0.5 * last:
        back = 1.0 - 0.5 * (before - now) / (before - 2.0 * last + now)
        peak = last - 0.25 * (before - now) * (1.0 - back)
    if peak > largest:
        largest, when = peak, time - back * step
    maximum[0], maximum[1], maximum[2], maximum[3] = last, now, largest, when


@device
def _top(last, now, rise, slope):
    """Maximum of the cubic with these values and slopes, up then down, over a unit interval; how far before its end.

    The derivative ``rise + 2 b s + c s²`` has one zero between the ends, since it changes its sign there.
    """
    b, c = 3.0 * (now - last) - 2.0 * rise - slope, 3.0 * (rise + slope) - 6.0 * (now - last)
    square = b * b - rise * c
    s = rise / (math.sqrt(0.0 if square < 0.0 else square) - b)
    return last + s * (rise + s * (b + s * c / 3.0)), 1.0 - s
