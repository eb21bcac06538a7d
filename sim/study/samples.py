"""Runs of a scene for the study: how long they take, what their members give at some times, and estimates from them.

A statistic T of independent members changes by the mean of their *influences* when the ensemble changes a little
(the delta method, or infinitesimal jackknife): its standard error is ``sqrt(Σ influence²/(M (M − 1)))``, however
a member's own times are correlated. Two estimates that share members, and so noise, may be compared by the
influences of the shared ones.
"""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.engine import MemberNoise, follow, march, trajectory_of
from sim.ensemble.plan import together
from sim.scenario.scenario import Scenario
from sim.study.exact_law import QUANTITIES, READ

Array = NDArray[np.float64]

#: Repeats of a time, and the least length of one [s].
_REPEATS, _LEAST = 5, 0.005
#: A repeat ends with a run, or after so many steps, or after so many times its length.
_MANY, _LONG = 64, 20.0
#: Steps that are timed at once.
_PIECE = 512
#: Fewest members of a sample, and the most values of each quantity that it keeps.
_FEWEST, _MOST_VALUES = 16, 2**20
#: Independent values without which a spread is not estimated, and those of them that must differ from the most common.
_FEWEST_VALUES, _FEWEST_DIFFERING = 50.0, 10.0
#: A value that all but this share of cases have counts as certain: the rest is too rare to sample.
_RARE = 1e-3


def fluctuates(scenario: Scenario) -> bool:
    """Whether members differ."""
    return any(scenario.varies.values())


def timed(scenario: Scenario, seconds: float) -> list[float]:
    """CPU time of the scene's run, all members [s]: median, least and largest of repeats within a time to spend [s]."""
    members = scenario.ensemble.members if fluctuates(scenario) else 1
    batch = min(together(scenario), members)
    paces = _paces(scenario, batch, max(seconds / (_REPEATS + 1), _LEAST), _REPEATS)
    steps = -(-members // batch) * scenario.clock.steps
    return [steps * pace for pace in (float(np.median(paces)), min(paces), max(paces))]


def affordable(scenario: Scenario, steps: int, seconds: float, times: int) -> int:
    """Members that so many steps of a scene can be sampled for within a time [s]; 0 if only a few."""
    if not fluctuates(scenario):
        return 1
    batch = together(scenario)
    pace = min(_paces(scenario, batch, _LEAST, 2))
    members = int(min(seconds / (pace * (steps + 1)) * batch, _MOST_VALUES // times))
    return members if members >= _FEWEST else 0


def _paces(scenario: Scenario, members: int, seconds: float, repeats: int) -> list[float]:
    """CPU times per step of a batch of members [s], each of whole runs or of a piece of one that takes long enough."""
    found, piece, state, last = [], 1, None, scenario.clock.steps
    noise = MemberNoise.of(scenario.seed, np.arange(members))
    for _ in range(repeats + 1):
        steps, spent, began, whole = 0, 0.0, time.process_time(), False
        while spent < seconds or not (whole or steps >= _MANY or spent > _LONG * seconds):
            before = state.step if state is not None and state.step < last else 0
            stop = min(before + piece, last)
            state, _ = follow(scenario, noise, state if before else None, range(before + 1, stop + 1))
            spent, piece = time.process_time() - began, min(2 * piece, _PIECE)
            steps += stop - before
            whole = stop == last
        found.append(spent / steps)
    return found[1:]  # the first compiles and loads


def sampled(scenario: Scenario, members: int, steps: Sequence[int]) -> Array:
    """The ``QUANTITIES`` of members at some clock steps, shape (4, members, steps)."""
    return coupled([scenario], members, steps)[0]


def coupled(scenarios: Sequence[Scenario], members: int, steps: Sequence[int]) -> Array:
    """Scenes that differ in their clock step only, all under the fluctuations that the first one draws.

    Parameters
    ----------
    scenarios : sequence of Scenario
        The finest first; the steps of the others are whole multiples of its step.
    members : int
        Number of members.
    steps : sequence of int
        Clock steps of the first scene to keep, at which all others have one as well.

    Returns
    -------
    array, shape (scenarios, 4, members, steps)
        The ``QUANTITIES``. Fluctuations have no error in time, so those of the finest run at the ends of longer steps
        are a sample of what a run with longer steps draws: differences are of the step alone.
    """
    ratios = [round(scene.clock.step / scenarios[0].clock.step) for scene in scenarios]
    places = {step: k for k, step in enumerate(steps)}
    kept = np.empty((len(scenarios), len(QUANTITIES), members, len(steps)))
    most = together(scenarios[0])
    for first in range(0, members, most):
        batch = np.arange(first, min(first + most, members))
        drawn = _Drawn()
        others = [march(drawn.into(scene), batch) for scene in scenarios[1:]]
        for state in march(scenarios[0], batch):
            drawn.now = state.shear
            due = zip(others, ratios[1:], strict=True)
            states = [state, *(state if state.step % ratio else next(run) for run, ratio in due)]
            if state.step in places:
                for k, (scene, now) in enumerate(zip(scenarios, states, strict=True)):
                    for q, name in enumerate(QUANTITIES):
                        kept[k, q, batch, places[state.step]] = READ[name](scene, trajectory_of(scene, now))[0]
            if state.step == steps[-1]:
                break
    return kept


class _Drawn:
    """A shear process that hands on what another run has drawn."""

    now: Any = None

    def start(self, *_: Any) -> Any:
        return self.now

    def advance(self, *_: Any) -> Any:
        return self.now, self.now.energy[np.newaxis]

    def into(self, scenario: Scenario) -> Scenario:
        """The scene under this process."""
        found = scenario.with_values({})
        found.__dict__["process"] = self
        return found


class Estimates(NamedTuple):
    """Statistics, shape (..., 3), and the influence of each member on them, (..., 3, members); nan where unknown."""

    value: Array
    influence: Array

    @property
    def standard_error(self) -> Array:
        """Standard errors of the values; nan of a single member that could differ from others."""
        return np.where(np.isnan(self.value), np.nan, _error_of_mean(self.influence))

    def less(self, other: "Estimates") -> tuple[Array, Array]:
        """These values less others, and the standard error of that; members of equal number are paired."""
        one, two = (each.influence / np.sqrt(_pairs(each.influence)) for each in (self, other))
        common = min(one.shape[-1], two.shape[-1])
        shared = np.sum(one[..., :common] * two[..., :common], axis=-1)
        variance = np.sum(one * one, axis=-1) + np.sum(two * two, axis=-1) - 2.0 * shared
        difference = self.value - other.value
        return difference, np.where(np.isnan(difference), np.nan, np.sqrt(np.maximum(variance, 0.0)))


def estimates(values: Array) -> Estimates:
    """Mean, standard deviation and skewness of trajectories at times that share one distribution.

    Parameters
    ----------
    values : array, shape (..., members, times)
        Independent members.

    Returns
    -------
    Estimates
        What does not fluctuate has a certain mean, spread 0 and no skewness. Spread and skewness need fifty
        independent values, ten of them unlike the most common one and no fewer than one in a thousand.

    Notes
    -----
    With z = (x − mean)/σ the influences are σz, σ(z² − 1)/2 and z³ − 3z − γ − 3γ(z² − 1)/2 on mean, standard
    deviation and skewness γ, each averaged over a member's times. Of the last two the standard error is no less
    than that of gamma numbers as skewed, ``σ √((2 + 6/a)/4n)`` and ``√(6 (1 + 1/a)(1 + 5/a)/n)`` with
    a = 4/γ²: few values underrate it when they miss the tail.

    Examples
    --------
    >>> draws = np.random.default_rng(3).exponential(size=(40000, 1))
    >>> for value, error in zip(estimates(draws).value, estimates(draws).standard_error):
    ...     print(f"{value:.2f} {error:.3f}")
    1.00 0.005
    1.00 0.007
    1.95 0.041
    """
    center = np.mean(values, axis=(-2, -1), keepdims=True)
    deviation = values - center
    mean = np.mean(deviation, axis=-1)
    sampling = _error_of_mean(mean) ** 2
    variance = np.mean(deviation**2, axis=(-2, -1)) + sampling
    sigma = np.sqrt(variance)
    center, still = center[..., 0, 0], ~(sigma > 1e-12 * np.abs(center[..., 0, 0]))
    common = np.median(values, axis=(-2, -1), keepdims=True)
    differing = np.mean(np.abs(values - common) > 1e-9 * np.abs(common), axis=(-2, -1))
    with np.errstate(divide="ignore", invalid="ignore"):
        independent = variance / np.maximum(sampling, 1e-300)
        known = (independent >= _FEWEST_VALUES) & (differing >= np.maximum(_RARE, _FEWEST_DIFFERING / independent))
        z = deviation / sigma[..., np.newaxis, np.newaxis]
        skew = np.mean(z**3, axis=(-2, -1))
        inverse = 0.25 * skew**2  # of the shape of a gamma number as skewed
        gamma = skew[..., np.newaxis, np.newaxis]
        on_skew = np.mean(z**3 - 3.0 * z - gamma - 1.5 * gamma * (z**2 - 1.0), axis=-1)
        on_spread = 0.5 * sigma[..., np.newaxis] * (np.mean(z**2, axis=-1) - 1.0)
        least = sigma * np.sqrt((0.5 + 1.5 * inverse) / independent)
        least_of_skew = np.sqrt(6.0 * (1.0 + inverse) * (1.0 + 5.0 * inverse) / independent)
        influences = mean, _raised(on_spread, least), _raised(on_skew, least_of_skew)
    spread = np.where(still, 0.0, np.where(known, sigma, np.nan))
    value = np.stack([center, spread, np.where(known & ~still, skew, np.nan)], axis=-1)
    influence = np.stack(influences, axis=-2)
    influence = np.full(influence.shape, np.nan) if values.shape[-2] < 2 else influence
    return Estimates(value, np.where(still[..., np.newaxis, np.newaxis], 0.0, influence))


def _error_of_mean(influence: Array) -> Array:
    """Standard error of the mean of the last axis, whose own mean is 0."""
    return np.sqrt(np.sum(influence**2, axis=-1) / _pairs(influence))


def _pairs(influence: Array) -> float:
    """M (M − 1) of so many members, 1 of a single one, which has no influence."""
    count = influence.shape[-1]
    return count * max(count - 1.0, 1.0)


def _raised(influence: Array, error: Array) -> Array:
    """Influences whose standard error is raised to one given where few values underrate it together with the tail."""
    found = influence - np.mean(influence, axis=-1, keepdims=True)
    small = _error_of_mean(found)
    return found * np.where((small >= error) | (small == 0.0), 1.0, error / small)[..., np.newaxis]
