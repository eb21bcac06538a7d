"""Random numbers by address: words, streams, uniforms and normals."""

import numpy as np
import pytest
from helpers.draws import FIVE_SIGMA, fits, states_at, tails, words_from
from numpy.testing import assert_allclose
from scipy.stats import binom, kstest, norm, poisson

from sim.numerics import noise
from sim.numerics.noise import PARTS, Noise


def numbers(members, step, count, seed=7, part="shear"):
    return Noise(seed, part, np.array(members)).normals(step, count)


def test_a_number_depends_on_its_address_only_and_on_all_of_it():
    for kind in ["normals", "uniforms"]:

        def drawn(members):
            return getattr(Noise(7, "shear", np.array(members)), kind)(5, 6)

        assert np.array_equal(drawn([3, 11, 40])[1:2], drawn([11]))
        assert np.array_equal(drawn([11, 3])[:1], drawn([11]))
    noise = Noise(7, "shear", np.arange(4))
    late, early = noise.normals(90_000, 5), noise.normals(2, 5)
    assert np.array_equal(late, numbers(range(4), 90_000, 5))
    assert np.array_equal(early, numbers(range(4), 2, 5))
    assert np.array_equal(numbers([3], 5, 100)[:, :7], numbers([3], 5, 7))
    base = numbers([1], 1, 4)
    for other in (numbers([1], 1, 4, seed=8), numbers([1], 1, 4, part="bonds"), numbers([2], 1, 4), numbers([1], 2, 4)):
        assert not np.any(np.isin(base, other))
    assert len(np.unique([states_at([(7, 2, 3, 4, lane)])[0, 0] for lane in range(4)])) == 4


def test_streams_begin_at_the_words_of_numpys_philox_and_go_on_as_the_authors_program():
    for seed, member in [(0, 0), (7, 3), (2**64 - 1, 10**7), (2**63 + 5, 2**40)]:
        for step, lane in [(0, 0), (1, 0), (10**9, 3)]:
            state = states_at([(seed, PARTS["bonds"], member, step, lane)])[0]
            counter = step + (member << 128) + ((256 + lane) << 192)  # which numpy raises by one before it draws
            generator = np.random.Philox(key=np.array([seed, PARTS["bonds"]], dtype=np.uint64), counter=counter - 1)
            assert np.array_equal(state, generator.random_raw(4))
    # State, and the words that follow it: published outputs of the program by Blackman & Vigna, in hexadecimal digits.
    for state, words in [
        (
            (1, 2, 3, 4),
            "2800001 3800067 cc00003800067 cc201994400b2 8012a2019ac433cd 8a69978acdee33ba c271134733154abd "
            "ac2ba09179169e97 dbf3190a8f073fd8 9105f14ab2229220",
        ),
        (
            (0, 0, 0, 1),
            "800000 800011 2200000800011 2200044000020 22000448008a1 1102100802208a0 114002284200880 402896644a64095 "
            "8a14a0a244acc891 8c88ba4680b20495",
        ),
    ]:
        assert words_from([state], 10)[0].tolist() == [int(word, 16) for word in words.split()]


def test_the_normals_have_normal_moments_and_no_correlation():
    sample = Noise(5, "shear", np.arange(100)).normals(1, 20_000)
    assert kstest(sample.ravel(), "norm").pvalue > FIVE_SIGMA
    for power, moment, spread in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0), (6, 15.0, 10170.0)):
        assert abs(np.mean(sample**power) - moment) < 5.0 * np.sqrt(spread / sample.size)
    for lag in (1, 2, 3):
        products = sample[:, lag:] * sample[:, :-lag]
        assert abs(products.mean()) < 5.0 / np.sqrt(products.size)
    source = Noise(1, "shear", np.arange(50))
    sample = np.stack([source.normals(step, 8).ravel() for step in range(1, 401)])
    correlations = np.corrcoef(sample.T)[np.triu_indices(400, 1)]
    # between members and steps: 79,800 correlations of 400 numbers have the mean square 1/400
    assert abs(np.mean(correlations**2) * 400 - 1.0) < 5.0 * np.sqrt(2.0 / correlations.size)


def test_the_layers_of_the_ziggurat_have_equal_areas_and_what_lies_beyond_the_law_of_a_tail():
    widths, heights = noise._WIDTHS, noise._HEIGHTS
    assert len(widths) == 256
    assert_allclose(heights[1:-1], np.exp(-0.5 * widths[1:] ** 2), rtol=1e-13)
    area = widths[1] * heights[1] + np.sqrt(2.0 * np.pi) * norm.sf(widths[1])
    # heights near 1 are good to 1e-16, their differences to 1e-16 of 0.01
    assert_allclose(widths * np.diff(heights), area, rtol=1e-13)
    assert heights[0] == 0.0
    assert heights[-1] == 1.0
    sample = tails(Noise(5, "shear", np.arange(200_000)).at(1))
    assert np.all(sample[::2] < 0.0)
    assert np.all(sample[1::2] > 0.0)
    assert kstest(norm.sf(np.abs(sample)) / norm.sf(noise._WIDTHS[1]), "uniform").pvalue > FIVE_SIGMA


@pytest.mark.parametrize("draws", [4 * 10**6, pytest.param(2 * 10**8, marks=pytest.mark.verify)])
def test_the_normals_have_the_normal_law_in_fine_bins_and_far_tails(draws):
    edges, source = np.round(np.arange(-6.0, 6.005, 0.01), 2), Noise(5, "shear", np.arange(1000))
    counts = np.zeros(len(edges) + 1)
    for step in range(draws // 10**6):
        counts += np.bincount(np.searchsorted(edges, source.normals(step, 1000).ravel()), minlength=len(counts))
    below = norm.cdf(-edges[edges >= 0.0])[::-1]  # of the lower half, as exact as it is small
    half = draws * np.diff(np.append(0.0, below))
    fits(counts, np.append(half, half[::-1]))
    # about the first width, 3.654, where a tail begins, and down to a probability of 1e-6 in both
    for level in (3.6, 3.66, 4.0, 4.5, 4.9):
        first = np.searchsorted(edges, level - 0.005)
        for count in (counts[first + 1 :].sum(), counts[: len(edges) - first].sum()):
            mean = draws * norm.sf(level)
            assert min(poisson.cdf(count, mean), poisson.sf(count - 1, mean)) > 0.5 * FIVE_SIGMA


NEIGHBOURS = {"seed": 0, "part": 1, "member": 2, "step": 3, "lane": 4}


@pytest.fixture(params=NEIGHBOURS)
def neighbours(request):
    """The first words of streams at addresses that differ by one in turn, shape (streams, words)."""
    addresses = np.tile(np.array([2026, 2, 7, 100, 0], dtype=np.uint64), (4096, 1))
    addresses[:, NEIGHBOURS[request.param]] += np.arange(4096, dtype=np.uint64)
    return words_from(states_at(addresses), 256)


@pytest.mark.verify
def test_bytes_of_neighbouring_streams_are_equally_frequent_and_so_are_pairs(neighbours):
    for shift in range(0, 64, 8):
        byte = ((neighbours >> np.uint64(shift)) & np.uint64(255)).astype(int)
        fits(np.bincount(byte.ravel(), minlength=256), np.full(256, byte.size / 256.0))
        # serial test: with the next word of the stream, and with the same one of the next stream
        for first, second in ((byte[:, :-1], byte[:, 1:]), (byte[:-1], byte[1:])):
            fits(np.bincount((256 * first + second).ravel(), minlength=65536), np.full(65536, first.size / 65536.0))


@pytest.mark.verify
def test_gaps_between_small_words_of_neighbouring_streams_are_geometric(neighbours):
    for order in (neighbours, neighbours.T):  # along a stream, and across them
        for high in (np.uint64(61), np.uint64(0)):  # the three highest bits, the three lowest
            gaps = np.diff(np.flatnonzero(((order.ravel() >> high) & np.uint64(7)) == 0)) - 1
            chance = 0.125 * 0.875 ** np.arange(gaps.max() + 1)
            fits(np.bincount(gaps), chance * gaps.size)


@pytest.mark.verify
def test_birthdays_of_neighbouring_streams_have_spacings_that_agree_as_often_as_by_chance(neighbours):
    # Marsaglia: m birthdays in a year of d days have about m³/4d equal spacings, a Poisson number; here 4096 in 2^32
    mean = 4096.0**3 / 2.0**34
    for low in (0, 16, 32):
        days = np.sort((neighbours >> np.uint64(low)) & np.uint64(2**32 - 1), axis=0)
        equal = np.sum(np.diff(np.sort(np.diff(days, axis=0), axis=0), axis=0) == 0, axis=0)
        fits(np.bincount(equal, minlength=30)[:30], neighbours.shape[1] * poisson.pmf(np.arange(30), mean))


@pytest.mark.verify
def test_neighbouring_streams_differ_in_half_of_their_bits(neighbours):
    for first, second in ((neighbours[:-1], neighbours[1:]), (neighbours[:, :-1], neighbours[:, 1:])):
        different = np.bitwise_count(first ^ second).ravel()
        fits(np.bincount(different, minlength=65), different.size * binom.pmf(np.arange(65), 64, 0.5))
    # each bit of a word against each of the word of the next stream: 4096 correlations
    some = np.ascontiguousarray(neighbours[:, :32])
    bits = np.unpackbits(some.view(np.uint8), axis=1).reshape(*some.shape, 64) - 0.5
    first, second = bits[:-1].reshape(-1, 64), bits[1:].reshape(-1, 64)
    correlations = 4.0 * (first.T @ second) / len(first)
    assert np.abs(correlations).max() * np.sqrt(len(first)) < norm.isf(0.5 * FIVE_SIGMA / correlations.size)
