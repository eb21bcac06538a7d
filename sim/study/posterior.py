"""Posterior of a fit by Markov chains: what the data leave of all free numbers together."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.study.fitting import LEVEL, Minimum, Problem
from sim.units.refusals import BadInput

try:
    import emcee
except ModuleNotFoundError:
    raise BadInput(["a posterior needs emcee, of an extra: pip install 'sliding-sim[fit]'"]) from None

Array = NDArray[np.float64]

#: Walkers for each number, autocorrelation times by which the beginning is left out, steps between looks at them, and
#: the most steps.
_WALKERS, _LEFT_OUT, _LOOK, _MOST = 8, 5.0, 500, 10_000
#: Autocorrelation times that a chain must be long for its quantiles to be trusted.
_LONG = 50.0


class Posterior(NamedTuple):
    """Samples of the free keys, shape (samples, keys) [SI], and the length of the chains in autocorrelation times."""

    keys: tuple[str, ...]
    samples: Array
    length: float

    @property
    def converged(self) -> bool:
        return self.length >= _LONG

    def quantiles(self) -> Array:
        """Ends and middle of the interval of 95 %, shape (3, keys)."""
        return np.quantile(self.samples, [0.5 - 0.5 * LEVEL, 0.5, 0.5 + 0.5 * LEVEL], axis=0)

    def document(self) -> dict[str, Any]:
        """The quantiles by key, as JSON has them."""
        low, middle, high = self.quantiles().tolist()
        numbers = {key: {"low": a, "median": b, "high": c}
                   for key, a, b, c in zip(self.keys, low, middle, high, strict=True)}  # fmt: skip
        return {"numbers": numbers, "autocorrelation_times": self.length, "converged": self.converged}


def posterior(problem: Problem, best: Minimum, seed: int, most: int = _MOST) -> Posterior:
    """Sample what is free, flat in the logarithm of what is above zero and in the rest, within the bounds.

    The chains grow until they are long in their own autocorrelation times, or have the most steps.
    """
    low, high = np.array(problem.bounds).T
    rng, count = np.random.default_rng(seed), len(best.x)
    spread = np.ones(count) if best.covariance is None else np.sqrt(np.diag(best.covariance))

    def logarithm(x: Array) -> float:
        if np.any(x < low) or np.any(x > high):
            return -math.inf
        return -0.5 * float(np.sum(problem.residuals(x) ** 2))

    walkers = max(_WALKERS * count, 2 * count + 2)
    start = np.clip(best.x + 0.1 * spread * rng.standard_normal((walkers, count)), low, high)
    sampler = emcee.EnsembleSampler(walkers, count, logarithm)
    sampler.random_state = np.random.RandomState(rng.integers(2**32)).get_state()
    steps, time = 0, math.inf
    while steps < min(_LONG * time, most):
        sampler.run_mcmc(None if steps else start, min(_LOOK, most - steps), progress=False)
        steps, time = sampler.iteration, float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
    chain = sampler.get_chain(discard=int(min(_LEFT_OUT * time, 0.5 * steps)), flat=True)
    samples = [[one.outer(x) for x in chain[:, k]] for k, one in enumerate(problem.free)]
    return Posterior(tuple(one.key for one in problem.free), np.array(samples).T, steps / time)
