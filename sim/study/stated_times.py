"""When ``sim converge`` takes its statistics: all along a stationary scene, else at stated times of it."""

import math
from dataclasses import dataclass

import numpy as np

from sim.parts.bonds import Counted
from sim.parts.drive import Steady
from sim.scenario.scenario import Scenario
from sim.study.exact_law import Expectation, Terms, course, never_opens

#: The correlation time is summed until the correlation has fallen to this, over about so many lags.
_FORGOTTEN, _LAGS = 0.02, 24

#: Times that are looked at for the largest spread; times whose values are taken together.
_CANDIDATES, _POOLED = 48, 64

#: Steps after which a step costs what it costs in a long run: noise is drawn for hundreds of steps at once.
_LONG_ENOUGH = 256

#: Steps that are walked without noise at the most.
MOST_WALKED = 60_000


@dataclass(frozen=True)
class Moment:
    """When statistics are taken, in clock steps of the scene.

    Attributes
    ----------
    step : int
        The stated time.
    ends : tuple of int
        Steps whose values have one distribution and are taken together; only ``step`` where the scene changes.
    lag, window : int
        The correlation time is summed over ``window`` lags of ``lag`` steps; window 0 if it cannot be
        told, because the scene forgets within a step or not within the run.
    """

    step: int
    ends: tuple[int, ...]
    lag: int = 1
    window: int = 0

    @property
    def pooled(self) -> bool:
        """Whether several times are taken together."""
        return len(self.ends) > 1

    @property
    def needed(self) -> set[int]:
        """Steps to record."""
        back = set() if self.pooled else {self.step - j * self.lag for j in range(self.window + 1)}
        return {*self.ends, self.step, *back}

    def stride(self, ratio: float) -> int:
        """Steps between the lags of a run whose clock step is ``ratio`` times the scene's."""
        return math.lcm(self.lag, max(1, round(ratio)))

    def lags(self, stride: int) -> int:
        """Number of lags of a stride."""
        return self.window * self.lag // stride


def stated_times(scenario: Scenario, terms: Terms, coarsest: int = 1) -> list[Moment]:
    """When statistics are taken: all along a stationary run, else where the radius spreads most and at the end.

    Parameters
    ----------
    scenario : Scenario
        The scene.
    terms : Terms
        What its ΔΓ is made of.
    coarsest : int
        Clock steps of which all the steps must be whole multiples.
    """
    steps = scenario.clock.steps
    if is_stationary(scenario):
        lag, window = _memory(scenario, terms, min(steps, MOST_WALKED), coarsest)
        unit = math.lcm(lag, coarsest)
        wanted = max(3 * window * lag, 16 * unit, _LONG_ENOUGH) if window else _POOLED * unit
        last = unit * (min(steps, wanted) // unit)
        return [Moment(last, tuple(range(0, last + 1, lag if window else unit)), lag, window)]
    candidates = coarsest * np.unique(np.rint(np.linspace(1, steps // coarsest, _CANDIDATES)).astype(np.int64))
    law = Expectation(scenario, terms, course(scenario, terms, candidates))
    spreads = np.array([law.radius_spread(int(step)) for step in candidates])
    widest = int(candidates[np.flatnonzero(spreads >= 0.99 * spreads.max())[-1]])
    return [Moment(step, (step,), *_memory(scenario, terms, step, coarsest)) for step in sorted({widest, steps})]


def is_stationary(scenario: Scenario) -> bool:
    """Whether all has one distribution from t = 0 on: a steady speed, bonds that start steady, no way to open."""
    settled = getattr(scenario.population, "start_from", "steady") == "steady"
    return isinstance(scenario.drive, Steady) and settled and never_opens(scenario)


def _memory(scenario: Scenario, terms: Terms, end: int, coarsest: int) -> tuple[int, int]:
    """Lag and number of lags over which the correlation with a step is forgotten; no lags if that cannot be told."""
    back = np.unique(np.rint(np.geomspace(1, end, 80)).astype(np.int64)) if end > 1 else np.array([1])
    walked = course(scenario, terms, np.unique(end - np.concatenate([[0], back])))
    law = Expectation(scenario, terms, walked)
    fluctuates = scenario.fluctuations.per_member
    kept = np.array([law.correlation(end - int(k), end) if fluctuates else 0.0 for k in back])
    if isinstance(scenario.population, Counted):
        kept = np.maximum(kept, np.exp(walked.renewal[walked.steps.searchsorted(end - back)] - walked.renewal[-1]))
    if kept[0] < math.exp(-1.0) or kept[-1] > math.exp(-1.0):
        return coarsest, 0
    gone = np.flatnonzero(kept < _FORGOTTEN)
    reach = int(back[gone[0]] if gone.size else back[-1])
    lag = reach // _LAGS
    lag = max(lag, 1) if lag < 4 else 4 * (lag // 4)
    lag -= lag == 3
    return lag, reach // lag
