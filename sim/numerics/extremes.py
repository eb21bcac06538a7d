"""Running maximum of a sampled quantity, refined between the samples."""

import math

import numpy as np

from sim.numerics.jit import kernel

#: Columns of a running maximum: the last sample but one, the last sample, the maximum so far, and its time.
BEFORE, LAST, LARGEST, WHEN = range(4)


def first(values: np.ndarray, time: float) -> np.ndarray:
    """Running maximum, shape (rows, 4), that starts with one sample of each row at a time [s]; nan counts as 0."""
    largest = np.nan_to_num(values)
    return np.stack([np.full(largest.shape, -np.inf), largest, largest, np.full(largest.shape, time)], axis=1)


def after(maximum: np.ndarray, values: np.ndarray, time: float, step: float) -> np.ndarray:
    """Running maximum one ``step`` [s] later, with samples at ``time`` [s]; nan counts as 0.

    A sample above its two neighbours is refined by the parabola through the three, if both neighbours have more
    than half of its value: a quantity that jumps is not smooth there. Of equal maxima the first is kept.
    """
    moved = np.empty((max(len(maximum), len(values)), 4))
    _after(maximum, values, time, step, moved)
    return moved


@kernel("void(float64[:, ::1], float64[::1], float64, float64, float64[:, ::1])")
def _after(maximum, values, time, step, moved):
    for i in range(len(moved)):
        row = maximum[i if len(maximum) > 1 else 0]
        now = values[i if len(values) > 1 else 0]
        now = 0.0 if math.isnan(now) else now
        before, last, largest, when = row[BEFORE], row[LAST], row[LARGEST], row[WHEN]
        if now > largest:
            largest, when = now, time
        if last >= before and last > now and min(before, now) > 0.5 * last:
            shift = 0.5 * (before - now) / (before - 2.0 * last + now)
            peak = last - 0.25 * (before - now) * shift
            if peak > largest:
                largest, when = peak, time + (shift - 1.0) * step
        moved[i, BEFORE], moved[i, LAST], moved[i, LARGEST], moved[i, WHEN] = last, now, largest, when
