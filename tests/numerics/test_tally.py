"""Counts and moments in one pass beside the same by numpy."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from sim.numerics.tally import tally

LEVELS = np.array([-1.0, 0.0, 1.0])


@pytest.mark.parametrize("shape", [(3, 5000), (5000, 3), (1, 2048), (2, 0)])
def test_all_finite_values_are_counted_once_whatever_lies_between_them(shape):
    values = np.random.default_rng(7).normal(size=(shape[1], shape[0])).T  # columns far apart in memory
    values[:, ::7] = np.nan
    values[:, 3:4] = 0.0
    values[:, 4:5] = np.inf
    sides = np.array([[-1.1, -0.9], [0.0, 0.0], [0.9, 1.2]])
    moments, under, near = np.ones(3), np.ones((3, shape[0])), np.empty((3, values.size))
    below, inside = np.ones(3, int), np.zeros(3, int)
    tally(values, 0.25, LEVELS, sides, moments, under, below, inside, near)
    known = np.where(np.isfinite(values), values, np.nan)
    some = known[np.isfinite(known)]
    assert_allclose(
        moments, [1 + some.size, 1 + np.sum((some - 0.25) ** 2), 1 + np.sum((some - 0.25) ** 3)], rtol=1e-12
    )
    assert np.array_equal(under, [1 + np.sum(known <= level, axis=1) for level in LEVELS])
    assert np.array_equal(below, [1 + np.sum(some < low) for low, _ in sides])
    kept = [known[(known >= low) & (known <= high)] for low, high in sides]  # row by row
    assert np.array_equal(inside, [len(each) for each in kept])
    for k in (0, 2):
        assert np.array_equal(near[k, : inside[k]], kept[k])
