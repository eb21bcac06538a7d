"""Binomial numbers: exact chances and the law of many draws."""

import math

import mpmath
import numpy as np
import pytest
from helpers.draws import FIVE_SIGMA, binomials, fits, log_chances
from numpy.testing import assert_allclose
from scipy.stats import binom, poisson

from sim.numerics.noise import Noise

#: Rounding of a logarithm of a chance, whose eleven terms are up to 40, each good to two units of 2^-53.
CLOSE = 2 * 11 * 40 * 2.0**-53


def drawn(trials, chance, draws, seed=2):
    return binomials(trials, chance, Noise(seed, "bonds", np.arange(draws // 100)).at(3), 100).ravel()


def exact_log_chance(number, trials, chance):
    """Logarithm of the binomial chance in sixty digits."""
    with mpmath.workdps(60):
        p, n, k = mpmath.mpf(chance), mpmath.mpf(trials), mpmath.mpf(number)
        ways = mpmath.loggamma(n + 1) - mpmath.loggamma(k + 1) - mpmath.loggamma(n - k + 1)
        return float(ways + k * mpmath.log(p) + (n - k) * mpmath.log(1 - p))


def test_logarithms_of_chances_to_sixty_digits():
    for chance in [1e-9, 0.01, 0.3, 0.5]:
        for trials in [1, 2, 15, 16, 17, 60, 1100]:
            number = sorted({0, 1, trials // 3, trials // 2, trials - 1, trials})
            exact = [exact_log_chance(k, trials, chance) for k in number]
            # far out a logarithm is large, and good to its own last places
            assert_allclose(log_chances(number, trials, chance), exact, rtol=1e-15, atol=CLOSE)
    for chance in [1e-4, 0.1, 0.5]:
        for trials in [10**6, 10**9]:
            spread = math.sqrt(trials * chance * (1.0 - chance))
            number = [int(trials * chance + z * spread) for z in (-6, -0.3, 0, 2, 8)]
            exact = [exact_log_chance(k, trials, chance) for k in number]
            assert_allclose(log_chances(number, trials, chance), exact, rtol=0, atol=CLOSE)


LAWS = [(1, 0.5), (7, 0.3), (12, 0.35), (19, 0.5), (20, 0.5), (21, 0.5), (22, 0.53), (1000, 0.0099), (1000, 0.0101)]
LAWS += [(1000, 0.3), (3000, 0.97), (10**4, 0.8), (10**6, 1e-5), (10**9, 0.25), (10**9, 3e-9), (10**9, 1 - 1e-7)]


@pytest.mark.parametrize(("trials", "chance"), LAWS)
@pytest.mark.parametrize("draws", [3 * 10**5, pytest.param(3 * 10**7, marks=pytest.mark.verify)])
def test_many_numbers_have_the_binomial_law_to_its_tails(trials, chance, draws):
    law, sample = binom(trials, chance), drawn(float(trials), chance, draws)
    inner = law.ppf(np.concatenate([[1e-5, 1e-4, 1e-3], np.linspace(0.005, 0.995, 397), [0.999, 0.9999, 0.99999]]))
    levels = np.unique(inner)
    counts = np.bincount(np.searchsorted(levels, sample), minlength=len(levels) + 1)
    fits(counts, draws * np.diff(np.concatenate([[0.0], law.cdf(levels), [1.0]])))
    for share in (1e-6, 1e-5, 1e-4):
        low, high = law.ppf(share), law.isf(share)
        for count, tail in ((np.sum(sample <= low), law.cdf(low)), (np.sum(sample >= high), law.sf(high - 1.0))):
            mean = draws * tail
            assert min(poisson.cdf(count, mean), poisson.sf(count - 1, mean)) > 0.5 * FIVE_SIGMA
    assert abs(sample.mean() - law.mean()) < 5.0 * law.std() / math.sqrt(draws)


def test_certain_and_empty_draws_and_any_batch_or_small_change_of_the_chance():
    for trials, chance, number in ((0.0, 0.5, 0.0), (5.0, 0.0, 0.0), (5.0, -1.0, 0.0), (5.0, 1.0, 5.0), (5.0, 2, 5.0)):
        assert np.all(drawn(trials, chance, 100) == number)
    for trials, chance in ((np.nan, 0.5), (5.0, np.nan)):
        assert np.all(np.isnan(drawn(trials, chance, 100)))
    # members share their noise across the values of a sweep; the first number of each stream
    for trials, chance in ((1e4, 0.3), (50.0, 0.1)):
        before, after = (drawn(trials, p, 10_000)[::100] for p in (chance, chance * 1.001))
        assert np.var(after - before) < 0.1 * np.var(before)
    batch = binomials(1e6, 0.3, Noise(2, "bonds", np.arange(64)).at(3))
    alone = [binomials(1e6, 0.3, Noise(2, "bonds", np.array([m])).at(3)) for m in range(64)]
    assert np.array_equal(np.vstack(alone), batch)
