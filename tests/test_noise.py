"""Random numbers by address."""

import numpy as np
import pytest

from sim.noise import BLOCK_NUMBERS, Noise, steps_per_block


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


@pytest.mark.parametrize("count", [1, 2, 3, 1000, 2**15, 2**15 + 1, 10**6])
def test_a_block_is_a_power_of_two_of_steps_and_bounded(count):
    steps = steps_per_block(count)
    assert steps & (steps - 1) == 0
    assert steps == 1 or steps * count <= BLOCK_NUMBERS


def test_a_block_is_numpys_philox_at_its_address():
    count, member, seed = 3, 9, 2**63 + 5
    block, row = divmod(20_000, steps_per_block(count))
    generator = np.random.Generator(
        np.random.Philox(key=np.array([seed, 2], dtype=np.uint64), counter=np.array([0, block, member, 0], np.uint64))
    )
    expected = generator.standard_normal((steps_per_block(count), count))[row]
    assert np.array_equal(numbers([member], 20_000, count, seed)[0], expected)


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
