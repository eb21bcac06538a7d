"""Runs of a scene for the study: how long they take, and what their members give at some times."""

import itertools
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.engine import march
from sim.scenario.scenario import Scenario
from sim.study.exact_law import QUANTITIES, READ

Array = NDArray[np.float64]

#: Repeats of a time, and the least length of one [s].
_REPEATS, _LEAST = 5, 0.005
#: A repeat ends with a run, or after so many steps, or after so many times its length.
_MANY, _LONG = 64, 20.0
#: Members advanced together, and the numbers that their state may hold, as in a run.
_GROUP, _STATE_NUMBERS = 64, 2**25
#: Fewest members of a sample, and the most values of each quantity that it keeps.
_FEWEST, _MOST_VALUES = 16, 2**20


def fluctuates(scenario: Scenario) -> bool:
    """Whether members differ."""
    return any(scenario.varies.values())


def timed(scenario: Scenario, seconds: float) -> list[float]:
    """CPU time of the scene's run, all members [s]: median, least and largest of repeats within a time to spend [s]."""
    members = scenario.ensemble.members if fluctuates(scenario) else 1
    together = min(_group(scenario), members)
    paces = _paces(scenario, together, max(seconds / (_REPEATS + 1), _LEAST), _REPEATS)
    steps = -(-members // together) * scenario.clock.steps
    return [steps * pace for pace in (float(np.median(paces)), min(paces), max(paces))]


def affordable(scenario: Scenario, steps: int, seconds: float, times: int) -> int:
    """Members that so many steps of a scene can be sampled for within a time [s]; 0 if only a few."""
    if not fluctuates(scenario):
        return 1
    together = _group(scenario)
    pace = min(_paces(scenario, together, _LEAST, 2))
    members = int(min(seconds / (pace * (steps + 1)) * together, _MOST_VALUES // times))
    return members if members >= _FEWEST else 0


def _group(scenario: Scenario) -> int:
    numbers = 2 * scenario.process.pairs + scenario.population.numbers
    return max(1, min(_GROUP, _STATE_NUMBERS // max(numbers, 1)))


def _paces(scenario: Scenario, members: int, seconds: float, repeats: int) -> list[float]:
    """CPU times per step of a batch of members [s], each of whole runs or of a piece of one that takes long enough."""
    found = []
    states = (state for _ in itertools.count() for state in march(scenario, np.arange(members), keep=False))
    for _ in range(repeats + 1):
        steps, spent, began, whole = 0, 0.0, time.process_time(), False
        while spent < seconds or not (whole or steps >= _MANY or spent > _LONG * seconds):
            state = next(states)
            spent = time.process_time() - began
            steps += state.step > 0
            whole = state.step == scenario.clock.steps
        found.append(spent / max(steps, 1))
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
    together = _group(scenarios[0])
    for first in range(0, members, together):
        batch = np.arange(first, min(first + together, members))
        drawn = _Drawn()
        others = [march(drawn.into(scene), batch) for scene in scenarios[1:]]
        for state in march(scenarios[0], batch):
            drawn.now = state.shear
            due = zip(others, ratios[1:], strict=True)
            states = [state, *(state if state.step % ratio else next(run) for run, ratio in due)]
            if state.step in places:
                for k, (scene, now) in enumerate(zip(scenarios, states, strict=True)):
                    for q, name in enumerate(QUANTITIES):
                        kept[k, q, batch, places[state.step]] = READ[name](scene, now)
            if state.step == steps[-1]:
                break
    return kept


class _Drawn:
    """A shear process that hands on what another run has drawn."""

    now: Any = None

    def start(self, *_: Any) -> Any:
        return self.now

    advance = start

    def into(self, scenario: Scenario) -> Scenario:
        """The scene under this process."""
        found = scenario.with_values({})
        found.__dict__["process"] = self
        return found
