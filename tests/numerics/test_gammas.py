"""Gamma numbers: their law, and what they are independent of."""

import numpy as np
import pytest
from helpers.draws import FIVE_SIGMA, fits, gammas
from scipy.stats import gamma, poisson

from sim.numerics.noise import Noise

SHAPES = [0.5, 0.7, 1.0, 3.0, 50.0, 1e4, 1e8]


def numbers(shapes, members=(3,), step=0, seed=7, part="shear"):
    return gammas(shapes, Noise(seed, part, np.array(members)).at(step), len(shapes))


def drawn(shape, size=100_000, step=0):
    """Numbers of one shape, shape (50, numbers)."""
    return gammas([shape], Noise(3, "shear", np.arange(50)).at(step), size // 50)


def test_a_member_draws_the_same_in_any_batch_and_seeds_parts_and_steps_differ():
    alone = numbers(SHAPES, [11], step=5)
    assert np.array_equal(numbers(SHAPES, [3, 11, 40], step=5)[1:2], alone)
    assert np.array_equal(numbers(SHAPES, [11, 3], step=5)[:1], alone)
    for other in ({"members": [12]}, {"seed": 8}, {"part": "bonds"}, {"step": 1}):
        assert not np.any(np.isin(alone, numbers(SHAPES, **{"members": [11], "step": 5} | other)))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("draws", [10**6, pytest.param(5 * 10**7, marks=pytest.mark.verify)])
def test_fine_bins_and_far_tails_have_their_share(shape, draws):
    law, tails = gamma(shape), np.array([1e-6, 1e-5, 1e-4, 1e-3])
    inner = np.linspace(0.0, 1.0, 501)[1:-1]
    edges = np.concatenate([law.ppf(tails), law.ppf(inner[inner <= 0.5]), law.isf(1.0 - inner[inner > 0.5]),
                            law.isf(tails[::-1])])  # fmt: skip
    share = np.diff(np.concatenate([[0.0], tails, inner, 1.0 - tails[::-1], [1.0]]))
    counts = np.zeros(len(share))
    for step in range(draws // 10**6):
        counts += np.bincount(np.searchsorted(edges, drawn(shape, 10**6, step).ravel()), minlength=len(counts))
    fits(counts, draws * share)
    for place, tail in enumerate(tails, 1):
        for count in (counts[:place].sum(), counts[-place:].sum()):
            assert min((poisson.cdf(count, draws * tail), poisson.sf(count - 1, draws * tail))) > 0.5 * FIVE_SIGMA


def test_neighbours_of_mixed_shapes_are_uncorrelated():
    shapes = np.array([0.5, 1e3, 2.2, 0.9])
    sample = gammas(shapes, Noise(9, "shear", np.arange(40)).at(1), 4 * 500).reshape(-1, 4)
    centred = (sample - shapes) / np.sqrt(shapes)
    correlations = centred.T @ centred / len(centred)
    assert np.abs(correlations[np.triu_indices(4, 1)]).max() < 5.0 / np.sqrt(len(centred))
    centred = (drawn(0.5) - 0.5) / np.sqrt(0.5)
    for axis, shift in ((1, 1), (1, 4), (1, 250), (0, 1)):
        products = centred * np.roll(centred, shift, axis=axis)
        assert abs(products.mean()) < 5.0 / np.sqrt(products.size)
