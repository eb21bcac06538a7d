"""The compiled cube root, over all of the range of floats."""

import mpmath
import numpy as np
from numpy.testing import assert_array_equal

from sim.numerics.jit import law
from sim.numerics.special import cube_root


@law
def root(x):
    return cube_root(x)


def test_the_cube_root_is_right_to_one_unit_in_the_last_place():
    random = np.random.default_rng(1)
    numbers = np.concatenate([10.0 ** random.uniform(-323, 308, 3000), [5e-324, 2.3e-308, 1e-280, 1e280, 1.7e308]])
    with mpmath.workdps(40):
        exact = [mpmath.cbrt(mpmath.mpf(float(x))) for x in numbers]
        errors = [abs(float(mpmath.mpf(float(r)) / e - 1)) for r, e in zip(root(numbers), exact, strict=True)]
    assert max(errors) < 2.3e-16


def test_the_cube_root_of_special_numbers():
    assert_array_equal(root(np.array([0.0, np.inf, np.nan, -1.0, -np.inf])), [0.0, np.inf, np.nan, np.nan, np.nan])
    # a cube of a float has its root exactly; numpy's own is a unit off at 27 on some machines
    assert_array_equal(root(np.array([1.0, 8.0, 27.0, 1e-3])), [1.0, 2.0, 3.0, 0.1])
