"""Running maximum of a sampled quantity, refined between the samples."""

import math

import numpy as np

from sim.numerics.jit import device, kernel

#: Columns of a running maximum: the last sample but one, the last sample, the maximum so far, and its time.
BEFORE, LAST, LARGEST, WHEN = range(4)


def first(values: np.ndarray, time: float) -> np.ndarray:
    """Running maximum, shape (rows, 4), that starts with one sample of each row at a time [s]; nan counts as 0."""
    largest = np.nan_to_num(values)
    return np.stack([np.full(largest.shape, -np.inf), largest, largest, np.full(largest.shape, time)], axis=1)


def after(
    maximum: np.ndarray, values: np.ndarray, time: float, step: float, rises: np.ndarray, slopes: np.ndarray
) -> np.ndarray:
    """Running maximum one ``step`` [s] later, with samples at ``time`` [s]; nan counts as 0.

    Where the slopes per time at the step's two ends are known, ``rises`` and ``slopes``, a maximum between them is
    that of the cubic through values and slopes, of fourth order. Where they are nan a sample above its two neighbours
    is refined by the parabola through the three, of third order, if both neighbours have more than half of its
    value: a quantity that jumps is not smooth there. Of equal maxima the first is kept.
    """
    rows = max(len(maximum), len(values), len(rises), len(slopes))
    moved = np.empty((rows, 4))
    _after(maximum, values, time, step, rises, slopes, moved)
    return moved


@kernel("void(float64[:, ::1], float64[::1], float64, float64, float64[::1], float64[::1], float64[:, ::1])")
def _after(maximum, values, time, step, rises, slopes, moved):
    for i in range(len(moved)):
        row = maximum[i if len(maximum) > 1 else 0]
        now = values[i if len(values) > 1 else 0]
        now = 0.0 if math.isnan(now) else now
        rise = step * rises[i if len(rises) > 1 else 0]
        slope = step * slopes[i if len(slopes) > 1 else 0]
        before, last, largest, when = row[BEFORE], row[LAST], row[LARGEST], row[WHEN]
        if now > largest:
            largest, when = now, time
        peak, back = -math.inf, 0.0
        if rise > 0.0 > slope:
            peak, back = _top(last, now, rise, slope)
        elif math.isnan(rise + slope) and last >= before and last > now and min(before, now) > 0.5 * last:
            back = 1.0 - 0.5 * (before - now) / (before - 2.0 * last + now)
            peak = last - 0.25 * (before - now) * (1.0 - back)
        if peak > largest:
            largest, when = peak, time - back * step
        moved[i, BEFORE], moved[i, LAST], moved[i, LARGEST], moved[i, WHEN] = last, now, largest, when


@device
def _top(last, now, rise, slope):
    """Maximum of the cubic with these values and slopes, up then down, over a unit interval; how far before its end.

    The derivative ``rise + 2 b s + c s²`` has one zero between the ends, since it changes its sign there.
    """
    b, c = 3.0 * (now - last) - 2.0 * rise - slope, 3.0 * (rise + slope) - 6.0 * (now - last)
    s = rise / (math.sqrt(max(b * b - rise * c, 0.0)) - b)
    return last + s * (rise + s * (b + s * c / 3.0)), 1.0 - s
