"""Random numbers of compiled loops as arrays, and whether they have a law."""

import numpy as np
from scipy.stats import chi2, poisson

from sim.numerics import noise
from sim.numerics.jit import kernel
from sim.numerics.noise import _log_chance, binomial, success

#: Two-sided probability of five standard deviations.
FIVE_SIGMA = 5.7e-7
_U = np.uint64


@kernel("void(uint64[:,::1], uint64[:,::1])")
def _words(states, drawn):
    for i in range(len(states)):
        numbers = (states[i, 0], states[i, 1], states[i, 2], states[i, 3])
        for k in range(drawn.shape[1]):
            drawn[i, k], numbers = noise.word(numbers)


@kernel("void(uint64[:,::1], uint64[:,::1])")
def _states(addresses, states):
    for i in range(len(addresses)):
        seed, part, member, step, lane = addresses[i]
        states[i, 0], states[i, 1], states[i, 2], states[i, 3] = noise.stream(
            seed, part, member, step, lane
        )


@kernel("void(float64[::1], uint64, uint64, uint64[::1], int64, float64[:,::1])")
def _gammas(shapes, seed, part, members, step, drawn):
    for m in range(members.size):
        numbers = noise.stream(seed, part, members[m], step, 0)
        for k in range(drawn.shape[1]):
            drawn[m, k], numbers = noise.gamma(shapes[k % shapes.size], numbers)


@kernel("void(float64, float64, uint64, uint64, uint64[::1], int64, float64[:,::1])")
def _binomials(trials, chance, seed, part, members, step, drawn):
    for m in range(members.size):
        numbers = noise.stream(seed, part, members[m], step, 0)
        for k in range(drawn.shape[1]):
            drawn[m, k], numbers = binomial(trials, success(chance), numbers)


@kernel("void(float64[::1], float64, float64, float64[::1])")
def _log_chances(number, trials, chance, result):
    for i in range(number.size):
        result[i] = _log_chance(number[i], trials, chance)


def words_from(states, count):
    """Words drawn from given states of the generator, shape (states, count)."""
    states = np.ascontiguousarray(states, dtype=_U)
    drawn = np.empty((len(states), count), _U)
    _words(states, drawn)
    return drawn


def states_at(addresses):
    """States of the streams at addresses (seed, part, member, step, lane), shape (addresses, 4)."""
    addresses = np.ascontiguousarray(addresses, dtype=_U)
    states = np.empty((len(addresses), 4), _U)
    _states(addresses, states)
    return states


def gammas(shapes, address, count):
    """Gamma numbers of the first stream of a step, their shapes in turn, shape (members, count)."""
    drawn = np.empty((len(address[2]), count))
    _gammas(np.array(shapes, dtype=float), *address, drawn)
    return drawn


def binomials(trials, chance, address, count=1):
    """Binomial numbers of the first stream of a step, shape (members, count)."""
    drawn = np.empty((len(address[2]), count))
    _binomials(trials, chance, *address, drawn)
    return drawn


def log_chances(number, trials, chance):
    """Logarithms of chances as rejection takes them."""
    number = np.array(number, dtype=float)
    result = np.empty(number.shape)
    _log_chances(number, trials, chance, result)
    return result


def ornstein_uhlenbeck(rng, shape, keep):
    """Standard normal series along the last axis, which keep a share from record to record."""
    values = np.empty(shape)
    values[..., 0] = rng.normal(size=shape[:-1])
    for k in range(1, shape[-1]):
        values[..., k] = keep * values[..., k - 1] + np.sqrt(
            1.0 - keep**2
        ) * rng.normal(size=shape[:-1])
    return values


def fits(counted, expected):
    """Whether counts have their expected values, by Pearson's χ²; cells of few are put together."""
    few = expected < 10.0
    counted, expected = (
        np.append(counts[~few], counts[few].sum()) for counts in (counted, expected)
    )
    if expected[-1] < 10.0:
        counted, expected = counted[:-1], expected[:-1]
    assert len(expected) > 1
    assert (
        chi2.sf(np.sum((counted - expected) ** 2 / expected), len(expected) - 1)
        > FIVE_SIGMA
    )


def is_usual(count, mean):
    """Return True if a Poisson count is no rarer than five standard deviations."""
    return min(poisson.cdf(count, mean), poisson.sf(count - 1, mean)) > 0.5 * FIVE_SIGMA
