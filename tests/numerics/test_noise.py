"""Random numbers by address."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import kstest, norm

from sim.numerics.noise import BLOCK_NUMBERS, PARTS, Noise, steps_per_block


def numbers(members, step, count, seed=7, part="shear"):
    return Noise(seed, part, np.array(members)).normals(step, count)


def test_a_member_draws_the_same_alone_and_in_any_batch():
    alone = numbers([11], 5, 6)
    assert np.array_equal(numbers([3, 11, 40], 5, 6)[1:2], alone)
    assert np.array_equal(numbers([11, 3], 5, 6)[:1], alone)


def test_a_step_can_be_asked_for_in_any_order():
    noise = Noise(7, "shear", np.arange(4))
    late, early = noise.normals(90_000, 5).copy(), noise.normals(2, 5).copy()
    assert np.array_equal(late, numbers(range(4), 90_000, 5))
    assert np.array_equal(early, numbers(range(4), 2, 5))


@pytest.mark.parametrize("count", [1, 2, 3, 1000, 2**13, 2**13 + 1, 10**6])
def test_a_block_is_a_power_of_two_of_steps_and_bounded(count):
    steps = steps_per_block(count)
    assert steps & (steps - 1) == 0
    assert steps == 1 or steps * count <= BLOCK_NUMBERS


def philox(seed, part, block, member, lane, counters):
    """Words of numpy's own generator at an address, shape (4, counters)."""
    key, counter = np.array([seed, part], dtype=np.uint64), np.array([0, block, member, lane], dtype=np.uint64)
    return np.random.Philox(key=key, counter=counter).random_raw(4 * counters).reshape(-1, 4).T


def unit(words):
    return (words >> np.uint64(12)) * 2.0**-52


@pytest.mark.parametrize(("seed", "member"), [(0, 0), (7, 3), (2**64 - 1, 10**7), (2**63 + 5, 2**40)])
def test_the_words_are_those_of_numpys_philox(seed, member):
    found = Noise(seed, "bonds", np.array([member])).uniforms(7 * 2**10, 8)
    assert steps_per_block(8) == 2**10
    words = philox(seed, PARTS["bonds"], 7, member, 256 * 8 + 1, 1024)
    assert np.array_equal(found[0], unit(words).ravel()[:8])


def test_the_normals_are_box_and_mullers_of_the_words():
    count = 8192
    found = Noise(11, "shear", np.array([2])).normals(3, count)[0].reshape(2, 4, 1024)
    words = philox(11, PARTS["shear"], 3, 2, 256 * count, 2048)
    for run in range(2):
        u, v = (unit(words[first::2, run * 1024 : (run + 1) * 1024]) for first in (0, 1))
        radius = np.sqrt(-2.0 * np.log(1.0 - u))
        # a few units in the last place of the radius, which is 8.5 at the most
        assert_allclose(found[run, 0::2], radius * np.cos(2 * np.pi * v), rtol=0, atol=4e-15)
        assert_allclose(found[run, 1::2], radius * np.sin(2 * np.pi * v), rtol=0, atol=4e-15)


def test_the_normals_are_standard_normal():
    sample = Noise(5, "shear", np.arange(100)).normals(1, 20_000).ravel()
    assert kstest(sample, "norm").pvalue > 5.7e-7
    beyond = 4.0
    expected = 2 * norm.sf(beyond) * sample.size
    assert abs(np.sum(np.abs(sample) > beyond) - expected) < 5.0 * np.sqrt(expected)
    for power, moment, spread in ((2, 1.0, 2.0), (4, 3.0, 96.0), (6, 15.0, 10170.0)):
        assert abs(np.mean(sample**power) - moment) < 5.0 * np.sqrt(spread / sample.size)
    pairs = sample.reshape(100, -1)
    assert abs(np.mean(pairs[:, :1024] * pairs[:, 1024:2048])) < 5.0 / np.sqrt(100 * 1024)


def test_seeds_parts_members_and_steps_differ():
    base = numbers([1], 1, 4)
    for other in (numbers([1], 1, 4, seed=8), numbers([1], 1, 4, part="bonds"), numbers([2], 1, 4), numbers([1], 2, 4)):
        assert not np.any(np.isin(base, other))


def test_numbers_are_uncorrelated_between_members_and_steps():
    noise = Noise(1, "shear", np.arange(50))
    sample = np.stack([noise.normals(step, 8).ravel() for step in range(1, 401)])
    correlations = np.corrcoef(sample.T)[np.triu_indices(400, 1)]
    # 79,800 correlations of 400 numbers each have the standard deviation 1/20; their mean square is 1/400 on average
    assert abs(np.mean(correlations**2) * 400 - 1.0) < 5.0 * np.sqrt(2.0 / correlations.size)


def test_numbers_of_another_law_or_layout_are_others():
    noise = Noise(3, "shear", np.arange(20))
    # the first normal and the first uniforms of one step, the same words if they shared an address
    uniform = noise.uniforms(1, 8)
    for other in (noise.normals(1, 8), noise.gammas(1, np.full(8, 0.5)), noise.uniforms(1, 9)[:, :8]):
        assert abs(np.corrcoef(uniform.ravel(), np.abs(other).ravel())[0, 1]) < 5.0 / np.sqrt(160)
    assert not np.any(np.isin(noise.uniforms(1, 9), noise.uniforms(0, 8)))
