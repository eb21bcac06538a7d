"""Counts and central moments of values in one pass.

A file of its own, for the name of all compiled code follows from the texts that it stands among.
"""

import numpy as np

from sim.numerics.jit import kernel

#: Values that are looked at together, while they are in the processor's first cache.
_STRIP = 2048


@kernel(
    "void(Array(float64, 2, 'A', readonly=True), float64, float64[::1], float64[:,::1], "
    "float64[::1], float64[:,:], int64[::1], int64[::1], float64[:,::1])"
)
def tally(values, mean, levels, sides, moments, under, below, inside, near):
    """Add what some finite values of some rows, shape (rows, columns), are to what is known of those before.

    Parameters
    ----------
    values : array, shape (rows, columns)
        What is not finite is left out.
    mean : float
        Deviations are taken from it.
    levels : array, shape (levels,)
    sides : array, shape (levels or 0, 2)
        Below and above each level, both counted as inside.
    moments : array, shape (3,)
        Number of the values, sums of the squares and cubes of their deviations; added to.
    under : array, shape (levels, rows)
        How many values of a row are at a level or below it; added to.
    below, inside : array of int, shape (levels,)
        How many are below the lower side, and between both; added to.
    near : array, shape (levels, values.size)
        Those between both, if these differ, from ``inside`` on as it comes.
    """
    strip = np.empty(_STRIP)
    for i in range(values.shape[0]):
        for start in range(0, values.shape[1], _STRIP):
            count, squares, cubes = 0, 0.0, 0.0
            for j in range(start, min(start + _STRIP, values.shape[1])):
                value = values[i, j]
                deviation = value - mean
                strip[count] = value
                if np.isfinite(value):
                    square = deviation * deviation
                    squares += square
                    cubes += square * deviation
                    count += 1
            moments[0] += count
            moments[1] += squares
            moments[2] += cubes
            for k in range(levels.size):
                level, reached = levels[k], 0
                for j in range(count):
                    reached += strip[j] <= level
                under[k, i] += reached
            for k in range(len(sides)):
                low, high, lower, higher = sides[k, 0], sides[k, 1], 0, 0
                for j in range(count):
                    lower += strip[j] < low
                    higher += strip[j] > high
                below[k] += lower
                if low < high and lower + higher < count:
                    at = inside[k]
                    for j in range(count):
                        if low <= strip[j] <= high:
                            near[k, at] = strip[j]
                            at += 1
                inside[k] += count - lower - higher
