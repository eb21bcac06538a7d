"""Random numbers by address: words, streams, uniforms and normals."""

import numpy as np
import pytest
from helpers.draws import FIVE_SIGMA, fits, states_at, words_from
from scipy.stats import norm, poisson

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


def test_the_normals_have_no_correlation():
    sample = Noise(5, "shear", np.arange(100)).normals(1, 20_000)
    for lag in (1, 2, 3):
        products = sample[:, lag:] * sample[:, :-lag]
        assert abs(products.mean()) < 5.0 / np.sqrt(products.size)
    source = Noise(1, "shear", np.arange(50))
    sample = np.stack([source.normals(step, 8).ravel() for step in range(1, 401)])
    correlations = np.corrcoef(sample.T)[np.triu_indices(400, 1)]
    # between members and steps: 79,800 correlations of 400 numbers have the mean square 1/400
    assert abs(np.mean(correlations**2) * 400 - 1.0) < 5.0 * np.sqrt(2.0 / correlations.size)


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
