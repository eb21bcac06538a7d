"""Binomial numbers by inversion: exact sums, a public library, and the law of many draws."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom, chi2

from sim.numerics.binomial import _chance, _tails, binomial_numbers
from sim.numerics.jit import kernel

# Rounding of what the parts of a probability are made of: eleven terms in its logarithm, of 40 at the most, each
# good to two units of 2^-53; likewise the exponent of the integral.
CLOSE = 2 * 11 * 40 * 2.0**-53


@kernel("void(float64, float64, float64, float64[::1])")
def write_tails(k, n, p, both):
    work = np.empty(24)
    if p <= 0.5:
        both[0], both[1] = _tails(k, n, p, _chance(k, n, p), work)
    elif k >= n:
        both[0], both[1] = 1.0, 0.0
    else:  # at most k successes are n − k failures or more
        both[1], both[0] = _tails(n - k - 1.0, n, 1.0 - p, _chance(n - k - 1.0, n, 1.0 - p), work)


def binomial_tails(number, trials, chance):
    """Probabilities of at most, and of more than, ``number`` successes."""
    both = np.empty(2)
    write_tails(float(number), float(trials), float(chance), both)
    return float(both[0]), float(both[1])


def exact_tails(number, trials, chance):
    """Both tails by whole numbers over a common denominator, without any rounding."""
    p, whole = Fraction(chance).as_integer_ratio()
    ways = sum(math.comb(trials, k) * p**k * (whole - p) ** (trials - k) for k in range(number + 1))
    total = Fraction(ways, whole**trials)
    return total, 1 - total


@pytest.mark.parametrize("chance", [1e-9, 0.01, 0.3, 0.5, 0.75, 1 - 2.0**-20])
@pytest.mark.parametrize("trials", [1, 2, 15, 16, 17, 60])
def test_tails_of_few_trials_are_those_of_exact_sums(trials, chance):
    for number in sorted({0, 1, trials // 3, trials // 2, trials - 1}):
        for found, exact in zip(
            binomial_tails(number, trials, chance), exact_tails(number, trials, chance), strict=True
        ):
            assert_allclose(found, float(exact), rtol=CLOSE, atol=0)


@pytest.mark.parametrize("chance", [0.25, 0.375, 0.5, 0.625])  # of few bits, so that the fractions stay short
def test_tails_by_the_integral_are_those_of_exact_sums(chance):
    trials = 1100  # beyond a variance of 200
    for number in (0, int(trials * chance) - 90, int(trials * chance), int(trials * chance) + 90, trials - 1):
        for found, exact in zip(
            binomial_tails(number, trials, chance), exact_tails(number, trials, chance), strict=True
        ):
            assert_allclose(found, float(exact), rtol=CLOSE, atol=0)


@pytest.mark.parametrize("chance", [1e-4, 0.1, 0.5, 0.8])
@pytest.mark.parametrize("trials", [10**6, 10**9])
def test_tails_of_a_billion_trials_are_those_of_the_beta_integral(trials, chance):
    with mpmath.workdps(30):  # ten digits are lost in the logarithms of the gamma functions
        p = mpmath.mpf(chance)
        spread = mpmath.sqrt(trials * p * (1 - p))
        for z in (-6, -0.3, 2):
            number = int(trials * chance + z * float(spread))
            scale = mpmath.loggamma(trials + 1) - mpmath.loggamma(number + 1) - mpmath.loggamma(trials - number)

            def density(t, number=number, scale=scale):
                return mpmath.exp(scale + number * mpmath.log(t) + (trials - number - 1) * mpmath.log(1 - t))

            width = spread / trials
            exact = [
                mpmath.quad(
                    density,
                    [max(p + side * k * width, 1e-30) for k in range(0, 25, 3) if p + side * k * width > -3 * width],
                    method="gauss-legendre",
                )
                for side in (1, -1)
            ]
            assert_allclose(binomial_tails(number, trials, chance), [float(abs(x)) for x in exact], rtol=CLOSE, atol=0)


def test_numbers_are_the_least_that_reach_the_uniform_one():
    random = np.random.default_rng(4)
    for trials, chance in ((7, 0.3), (40, 0.875), (900, 0.25), (1100, 0.625)):
        uniform = np.concatenate([random.random(8), [2.0**-54, 2.0**-30, 1 - 2.0**-30, 1 - 2.0**-53]])
        for u, number in zip(uniform, binomial_numbers(uniform, trials, chance), strict=True):
            k = int(number)
            assert exact_tails(k, trials, chance)[0] >= u
            assert k == 0 or exact_tails(k - 1, trials, chance)[0] < u


def test_numbers_next_to_a_step_of_the_function_fall_on_the_right_side():
    # where the expansion is least certain; tails are good to 1e-13, and numbers near 1 to 1e-16
    random = np.random.default_rng(9)
    checked = 0
    for variance in 10.0 ** random.uniform(0.0, 6.0, 4000):
        chance = float(10.0 ** random.uniform(-7.0, 0.0))
        trials = math.ceil(variance / (chance * (1.0 - chance)))
        z = random.uniform(-8.0, 3.0)
        number = round(trials * chance + z * math.sqrt(variance) + (1.0 - 2.0 * chance) * (z * z - 1.0) / 6.0)
        if not 0 <= number < trials <= 10**9:
            continue
        step, _ = binomial_tails(number, trials, chance)
        found = binomial_numbers(np.array([step * (1 - 1e-12), step * (1 + 1e-12)]), trials, chance)
        assert found.tolist() == [number, number + 1]
        checked += 1
    assert checked > 2000


@pytest.mark.parametrize("trials", [1, 2, 9, 100, 10**3, 10**5, 10**7, 10**9])
@pytest.mark.parametrize("chance", [1e-12, 1e-3, 0.1, 0.5, 0.6, 0.99, 1 - 1e-9])
def test_numbers_are_those_of_scipy(trials, chance):
    # what scipy's function is not good to at a billion trials, some 1e-11, is left out at the upper end
    uniform = np.concatenate([np.random.default_rng(8).random(300), np.geomspace(2.0**-53, 0.5, 40)])
    uniform = uniform[uniform < 1 - 1e-6]
    assert np.array_equal(binomial_numbers(uniform, float(trials), chance), binom.ppf(uniform, trials, chance))


def test_where_the_uniform_number_is_a_step_of_the_function_the_step_counts():
    # two fair coins: F = 1/4, 3/4, 1
    uniform = np.array([0.25, np.nextafter(0.25, 1), 0.75, np.nextafter(0.75, 1)])
    assert binomial_numbers(uniform, 2.0, 0.5).tolist() == [0.0, 1.0, 1.0, 2.0]
    # three chances of four: F = 1/16, 7/16, 1
    uniform = np.array([1 / 16, np.nextafter(1 / 16, 1), 7 / 16, np.nextafter(7 / 16, 1)])
    assert binomial_numbers(uniform, 2.0, 0.75).tolist() == [0.0, 1.0, 1.0, 2.0]


def test_certain_and_empty_draws():
    assert binomial_numbers([0.0, 0.3, 1.0], 5.0, 0.5).tolist() == [0.0, 2.0, 5.0]
    assert binomial_numbers(0.7, [0.0, 5.0, 5.0, 5.0], [0.5, 0.0, 1.0, 2.0]).tolist() == [0.0, 0.0, 5.0, 5.0]
    assert np.isnan(binomial_numbers([np.nan, 0.5, 0.5], [5.0, np.nan, 5.0], [0.5, 0.5, np.nan])).all()
    assert binomial_numbers(0.5, 4.0, 0.5).shape == ()


@pytest.mark.parametrize(("trials", "chance"), [(12, 0.35), (3000, 0.3), (10**9, 0.25), (10**9, 3e-9)])
def test_many_numbers_have_the_binomial_law(trials, chance):
    draws = 40_000
    found = binomial_numbers(np.random.default_rng(2).random(draws), float(trials), chance)
    levels = np.unique(binom.ppf(np.linspace(0.02, 0.98, 49), trials, chance))
    wanted = draws * np.diff(np.concatenate([[0.0], binom.cdf(levels, trials, chance), [1.0]]))
    seen = np.bincount(np.searchsorted(levels, found), minlength=len(levels) + 1)
    statistic = np.sum((seen[wanted > 0] - wanted[wanted > 0]) ** 2 / wanted[wanted > 0])
    assert chi2.sf(statistic, np.count_nonzero(wanted) - 1) > 5.7e-7  # five sigma


def test_a_number_does_not_depend_on_its_batch():
    uniform = np.random.default_rng(1).random(64)
    batch = binomial_numbers(uniform, 1e6, 0.3)
    assert [float(binomial_numbers(u, 1e6, 0.3)) for u in uniform] == batch.tolist()
