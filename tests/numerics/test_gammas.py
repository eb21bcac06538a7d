"""Gamma numbers by address: their law, their address, and what they are independent of."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import gamma, kstest

from sim.numerics.noise import PARTS, Noise, steps_per_block

SHAPES = [0.5, 0.7, 1.0, 3.0, 50.0, 1e4, 1e8]
#: Two-sided probability of five standard deviations.
FIVE_SIGMA = 5.7e-7


def numbers(shapes, members=(3,), step=0, seed=7, part="shear"):
    return Noise(seed, part, np.array(members)).gammas(step, np.array(shapes, dtype=float))


def drawn(shape, size=100_000, seed=3):
    """Numbers of one shape from all columns of many members and steps, shape (members, numbers)."""
    noise, shapes = Noise(seed, "shear", np.arange(50)), np.full(250, shape)
    return np.hstack([noise.gammas(step, shapes).copy() for step in range(size // (50 * 250))])


@pytest.mark.parametrize("shape", SHAPES)
def test_the_numbers_follow_the_gamma_law(shape):
    sample = drawn(shape).ravel()
    assert kstest(sample, gamma(shape).cdf).pvalue > FIVE_SIGMA
    # central moments of a gamma law: variance a, third 2a, fourth 3a(a + 2); the spread of the sample's variance
    centred = sample - shape
    assert abs(centred.mean()) < 5.0 * np.sqrt(shape / sample.size)
    assert abs(np.mean(centred**2) - shape) < 5.0 * np.sqrt((3.0 * shape * (shape + 2.0) - shape**2) / sample.size)
    assert np.all(sample > 0.0)


@pytest.mark.parametrize("shape", [0.5, 3.0])
def test_far_tails_have_their_share(shape):
    sample = drawn(shape, size=1_000_000).ravel()
    for share in (1e-4, 1e-3):
        for tail in (sample < gamma(shape).ppf(share), sample > gamma(shape).isf(share)):
            assert abs(tail.mean() - share) < 5.0 * np.sqrt(share / sample.size)


@pytest.mark.parametrize("one", [0, 1])
def test_shapes_mixed_in_one_step_keep_their_laws(one):
    noise, shapes = Noise(9, "shear", np.arange(40)), np.array([0.5, 1e3, 2.2, 0.9])
    sample = np.stack([noise.gammas(step, shapes).copy() for step in range(500)])
    for column in (one, one + 2):
        assert kstest(sample[:, :, column].ravel(), gamma(shapes[column]).cdf).pvalue > FIVE_SIGMA


def test_a_member_draws_the_same_alone_and_in_any_batch():
    alone = numbers(SHAPES, [11], step=5)
    assert np.array_equal(numbers(SHAPES, [3, 11, 40], step=5)[1:2], alone)
    assert np.array_equal(numbers(SHAPES, [11, 3], step=5)[:1], alone)
    assert not np.any(np.isin(numbers(SHAPES, [12], step=5), alone))


def test_steps_can_be_asked_for_in_any_order():
    noise, shapes = Noise(7, "shear", np.arange(4)), np.array([0.5, 2.0, 8.0])
    late, early = noise.gammas(90_000, shapes).copy(), noise.gammas(2, shapes).copy()
    assert np.array_equal(late, numbers(shapes, range(4), 90_000))
    assert np.array_equal(early, numbers(shapes, range(4), 2))


def test_a_number_depends_on_its_own_shape_and_place_only():
    base, other = numbers([0.5, 2.0, 8.0, 1.0]), numbers([0.7, 2.0, 9.0, 1.0])
    assert np.array_equal(base[:, [1, 3]], other[:, [1, 3]])
    assert not np.any(np.isin(base[:, [0, 2]], other))
    swapped = numbers([2.0, 0.5, 8.0, 1.0])
    assert np.array_equal(base[:, 2:], swapped[:, 2:])
    assert not np.any(np.isin(base[:, :2], swapped))


def test_seeds_and_parts_differ():
    base = numbers(SHAPES)
    for other in (numbers(SHAPES, seed=8), numbers(SHAPES, part="bonds"), numbers(SHAPES, step=1)):
        assert not np.any(np.isin(base, other))


@pytest.mark.parametrize("kind", ["normals", "uniforms"])
@pytest.mark.parametrize("shape", [0.5, 5.0])
def test_they_are_independent_of_the_other_numbers_of_a_step(kind, shape):
    noise, count = Noise(2, "shear", np.arange(60)), 2**13
    ours = (noise.gammas(4, np.full(count, shape)) - shape) / np.sqrt(shape)
    others = getattr(noise, kind)(4, count)
    others = (others - others.mean()) / others.std()
    for power in (1, 2):
        powered = others**power - np.mean(others**power)
        # a counter makes one of our numbers and four of the others, 1024 places apart
        for shift in (0, 1, 1024, 2048, 3072):
            products = ours * np.roll(powered, -shift, axis=1)
            assert abs(products.mean()) < 5.0 * products.std() / np.sqrt(products.size)


def test_neighbours_steps_and_members_are_uncorrelated():
    sample = drawn(0.5)
    centred = (sample - 0.5) / np.sqrt(0.5)
    for axis, shift in ((1, 1), (1, 4), (1, 250), (0, 1)):
        products = centred * np.roll(centred, shift, axis=axis)
        assert abs(products.mean()) < 5.0 / np.sqrt(products.size)


def words(member, block, lane, counter, seed=7, part="shear"):
    """The four words of one counter, by numpy's own Philox."""
    key = np.array([seed, PARTS[part]], dtype=np.uint64)
    address = np.array([counter, block, member, lane], dtype=np.uint64)
    return np.random.Philox(key=key, counter=address).random_raw(4)


def by_hand(shape, member, block, place, count):
    """Marsaglia & Tsang's method on the words of a number's address, and how often it was rejected."""
    d = (shape if shape >= 1.0 else shape + 1.0) - 1.0 / 3.0
    lanes = (
        (words(member, block, 256 * count + 2 + rejected, place) >> np.uint64(12)) * 2.0**-52 for rejected in range(99)
    )
    for rejected, u in enumerate(lanes):
        if rejected == 0:
            shrunk = (1.0 - u[3]) ** (1.0 / shape) if shape < 1.0 else 1.0
        x = np.sqrt(-2.0 * np.log(1.0 - u[0])) * np.cos(2.0 * np.pi * u[1])
        v = (1.0 + x / np.sqrt(9.0 * d)) ** 3
        if v > 0.0 and np.log(1.0 - u[2]) < 0.5 * x**2 + d - d * v + d * np.log(v):
            return d * v * shrunk, rejected
    raise AssertionError("never accepted")


def test_the_numbers_are_marsaglia_and_tsangs_of_the_words_in_their_own_lanes():
    shapes, member = np.array([0.5, 0.8, 1.0, 4.5]), 2
    steps = steps_per_block(len(shapes))
    noise = Noise(7, "shear", np.array([member]))
    rejections = []
    for row in range(100):
        found = noise.gammas(3 * steps + row, shapes)[0]
        exact, rejected = zip(
            *(by_hand(shape, member, 3, row * len(shapes) + i, len(shapes)) for i, shape in enumerate(shapes)),
            strict=True,
        )
        # v is a cube and u^(1/a) a square at the most: a few units in the last place, more where v is small
        assert_allclose(found, exact, rtol=2e-13, atol=0)
        rejections += rejected
    assert max(rejections) > 0


def test_runs_longer_than_the_kernels_own_join_without_a_seam():
    shapes = np.linspace(0.5, 30.0, 2500)
    found = numbers(shapes, [2])[0]
    for place in (0, 1023, 1024, 2047, 2048, 2499):
        assert_allclose(found[place], by_hand(shapes[place], 2, 0, place, 2500)[0], rtol=2e-13, atol=0)
