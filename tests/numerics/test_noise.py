"""Random numbers by address: words, streams, and the laws of normal, gamma and binomial numbers."""

import math

import mpmath
import numpy as np
import pytest
from helpers.draws import (
    binomials,
    fits,
    gammas,
    is_usual,
    log_chances,
    states_at,
    words_from,
)
from numpy.testing import assert_allclose
from scipy.stats import binom, gamma, norm

from sim.numerics.noise import PARTS, Noise

SHAPES = [0.5, 0.7, 1.0, 3.0, 50.0, 1e4, 1e8]
DRAWN = {
    "normal": lambda noise, step: noise.normals(step, 7),
    "gamma": lambda noise, step: gammas(SHAPES, noise.at(step), len(SHAPES)),
    "binomial": lambda noise, step: binomials(1e9, 0.3, noise.at(step), 7),
}


@pytest.mark.parametrize("kind", DRAWN)
def test_a_number_depends_on_its_address_only_and_on_all_of_it(kind):
    def drawn(members, step=5, seed=7, part="shear"):
        return DRAWN[kind](Noise(seed, part, np.array(members)), step)

    alone = drawn([11])
    assert np.array_equal(drawn([3, 11, 40])[1:2], alone) and np.array_equal(
        drawn([11, 3])[:1], alone
    )
    for other in ({"members": [12]}, {"seed": 8}, {"part": "bonds"}, {"step": 1}):
        assert not np.any(np.isin(alone, drawn(**{"members": [11]} | other)))


def test_streams_begin_at_the_words_of_numpys_philox_and_go_on_as_the_authors_program():
    for seed, member in [(0, 0), (7, 3), (2**64 - 1, 10**7), (2**63 + 5, 2**40)]:
        for step, lane in [(0, 0), (1, 0), (10**9, 3)]:
            state = states_at([(seed, PARTS["bonds"], member, step, lane)])[0]
            # which numpy raises by one before it draws
            counter = step + (member << 128) + ((256 + lane) << 192)
            generator = np.random.Philox(
                key=np.array([seed, PARTS["bonds"]], dtype=np.uint64),
                counter=counter - 1,
            )
            assert np.array_equal(state, generator.random_raw(4))
    assert (
        len(np.unique([states_at([(7, 2, 3, 4, lane)])[0, 0] for lane in range(4)]))
        == 4
    )
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
        assert words_from([state], 10)[0].tolist() == [
            int(word, 16) for word in words.split()
        ]


def test_the_normals_have_no_correlation():
    sample = Noise(5, "shear", np.arange(100)).normals(1, 20_000)
    for lag in (1, 2, 3):
        products = sample[:, lag:] * sample[:, :-lag]
        assert abs(products.mean()) < 5.0 / np.sqrt(products.size)
    source = Noise(1, "shear", np.arange(50))
    sample = np.stack([source.normals(step, 8).ravel() for step in range(1, 401)])
    correlations = np.corrcoef(sample.T)[np.triu_indices(400, 1)]
    # between members and steps: 79,800 correlations of 400 numbers have the mean square 1/400
    assert abs(np.mean(correlations**2) * 400 - 1.0) < 5.0 * np.sqrt(
        2.0 / correlations.size
    )


@pytest.mark.parametrize(
    "draws", [4 * 10**6, pytest.param(2 * 10**8, marks=pytest.mark.verify)]
)
def test_the_normals_have_the_normal_law_in_fine_bins_and_far_tails(draws):
    edges, source = (
        np.round(np.arange(-6.0, 6.005, 0.01), 2),
        Noise(5, "shear", np.arange(1000)),
    )
    counts = np.zeros(len(edges) + 1)
    for step in range(draws // 10**6):
        counts += np.bincount(
            np.searchsorted(edges, source.normals(step, 1000).ravel()),
            minlength=len(counts),
        )
    # of the lower half, as exact as it is small
    below = norm.cdf(-edges[edges >= 0.0])[::-1]
    half = draws * np.diff(np.append(0.0, below))
    fits(counts, np.append(half, half[::-1]))
    # about the first width, 3.654, where a tail begins, and down to a probability of 1e-6 in both
    for level in (3.6, 3.66, 4.0, 4.5, 4.9):
        first = np.searchsorted(edges, level - 0.005)
        for count in (counts[first + 1 :].sum(), counts[: len(edges) - first].sum()):
            assert is_usual(count, draws * norm.sf(level))


def drawn_gammas(shape, size=100_000, step=0):
    """Numbers of one shape, shape (50, numbers)."""
    return gammas([shape], Noise(3, "shear", np.arange(50)).at(step), size // 50)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(
    "draws", [10**6, pytest.param(5 * 10**7, marks=pytest.mark.verify)]
)
def test_the_gammas_have_their_law_in_fine_bins_and_far_tails(shape, draws):
    law, tails = gamma(shape), np.array([1e-6, 1e-5, 1e-4, 1e-3])
    inner = np.linspace(0.0, 1.0, 501)[1:-1]
    edges = np.concatenate(
        [
            law.ppf(tails),
            law.ppf(inner[inner <= 0.5]),
            law.isf(1.0 - inner[inner > 0.5]),
            law.isf(tails[::-1]),
        ]
    )
    share = np.diff(np.concatenate([[0.0], tails, inner, 1.0 - tails[::-1], [1.0]]))
    counts = np.zeros(len(share))
    for step in range(draws // 10**6):
        counts += np.bincount(
            np.searchsorted(edges, drawn_gammas(shape, 10**6, step).ravel()),
            minlength=len(counts),
        )
    fits(counts, draws * share)
    for place, tail in enumerate(tails, 1):
        for count in (counts[:place].sum(), counts[-place:].sum()):
            assert is_usual(count, draws * tail)


def test_neighbouring_gammas_of_mixed_shapes_are_uncorrelated():
    shapes = np.array([0.5, 1e3, 2.2, 0.9])
    sample = gammas(shapes, Noise(9, "shear", np.arange(40)).at(1), 4 * 500).reshape(
        -1, 4
    )
    centred = (sample - shapes) / np.sqrt(shapes)
    correlations = centred.T @ centred / len(centred)
    assert np.abs(correlations[np.triu_indices(4, 1)]).max() < 5.0 / np.sqrt(
        len(centred)
    )
    centred = (drawn_gammas(0.5) - 0.5) / np.sqrt(0.5)
    for axis, shift in ((1, 1), (1, 4), (1, 250), (0, 1)):
        products = centred * np.roll(centred, shift, axis=axis)
        assert abs(products.mean()) < 5.0 / np.sqrt(products.size)


#: Rounding of a logarithm of a chance, whose eleven terms are up to 40, each good to two units of 2^-53.
CLOSE = 2 * 11 * 40 * 2.0**-53


def drawn_binomials(trials, chance, draws, seed=2):
    return binomials(
        trials, chance, Noise(seed, "bonds", np.arange(draws // 100)).at(3), 100
    ).ravel()


def exact_log_chance(number, trials, chance):
    """Logarithm of the binomial chance in sixty digits."""
    with mpmath.workdps(60):
        p, n, k = mpmath.mpf(chance), mpmath.mpf(trials), mpmath.mpf(number)
        ways = (
            mpmath.loggamma(n + 1) - mpmath.loggamma(k + 1) - mpmath.loggamma(n - k + 1)
        )
        return float(ways + k * mpmath.log(p) + (n - k) * mpmath.log(1 - p))


def test_logarithms_of_binomial_chances_to_sixty_digits():
    for chance in [1e-9, 0.01, 0.3, 0.5]:
        for trials in [1, 2, 15, 16, 17, 60, 1100]:
            number = sorted({0, 1, trials // 3, trials // 2, trials - 1, trials})
            exact = [exact_log_chance(k, trials, chance) for k in number]
            # far out a logarithm is large, and good to its own last places
            assert_allclose(
                log_chances(number, trials, chance), exact, rtol=1e-15, atol=CLOSE
            )
    for chance in [1e-4, 0.1, 0.5]:
        for trials in [10**6, 10**9]:
            spread = math.sqrt(trials * chance * (1.0 - chance))
            number = [int(trials * chance + z * spread) for z in (-6, -0.3, 0, 2, 8)]
            exact = [exact_log_chance(k, trials, chance) for k in number]
            assert_allclose(
                log_chances(number, trials, chance), exact, rtol=0, atol=CLOSE
            )


LAWS = [
    (1, 0.5),
    (7, 0.3),
    (12, 0.35),
    (19, 0.5),
    (20, 0.5),
    (21, 0.5),
    (22, 0.53),
    (1000, 0.0099),
    (1000, 0.0101),
]
LAWS += [
    (1000, 0.3),
    (3000, 0.97),
    (10**4, 0.8),
    (10**6, 1e-5),
    (10**9, 0.25),
    (10**9, 3e-9),
    (10**9, 1 - 1e-7),
]


@pytest.mark.parametrize(("trials", "chance"), LAWS)
@pytest.mark.parametrize(
    "draws", [3 * 10**5, pytest.param(3 * 10**7, marks=pytest.mark.verify)]
)
def test_many_binomials_have_the_binomial_law_to_its_tails(trials, chance, draws):
    law, sample = binom(trials, chance), drawn_binomials(float(trials), chance, draws)
    inner = law.ppf(
        np.concatenate(
            [
                [1e-5, 1e-4, 1e-3],
                np.linspace(0.005, 0.995, 397),
                [0.999, 0.9999, 0.99999],
            ]
        )
    )
    levels = np.unique(inner)
    counts = np.bincount(np.searchsorted(levels, sample), minlength=len(levels) + 1)
    fits(counts, draws * np.diff(np.concatenate([[0.0], law.cdf(levels), [1.0]])))
    for share in (1e-6, 1e-5, 1e-4):
        low, high = law.ppf(share), law.isf(share)
        for count, tail in (
            (np.sum(sample <= low), law.cdf(low)),
            (np.sum(sample >= high), law.sf(high - 1.0)),
        ):
            assert is_usual(count, draws * tail)
    assert abs(sample.mean() - law.mean()) < 5.0 * law.std() / math.sqrt(draws)


def test_certain_and_empty_binomials_and_a_small_change_of_the_chance():
    for trials, chance, number in (
        (0.0, 0.5, 0.0),
        (5.0, 0.0, 0.0),
        (5.0, -1.0, 0.0),
        (5.0, 1.0, 5.0),
        (5.0, 2, 5.0),
    ):
        assert np.all(drawn_binomials(trials, chance, 100) == number)
    for trials, chance in ((np.nan, 0.5), (5.0, np.nan)):
        assert np.all(np.isnan(drawn_binomials(trials, chance, 100)))
    # members share their noise across the values of a sweep; the first number of each stream
    for trials, chance in ((1e4, 0.3), (50.0, 0.1)):
        before, after = (
            drawn_binomials(trials, p, 10_000)[::100] for p in (chance, chance * 1.001)
        )
        assert np.var(after - before) < 0.1 * np.var(before)
