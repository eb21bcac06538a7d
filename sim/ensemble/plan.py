"""Division of a run into points, groups of members and stretches of time."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.ensemble.recorded import LARGEST, VARIABLES, Variable
from sim.scenario.scenario import Scenario

_GROUP = 256
_PART_NUMBERS = 2**22
_STATE_NUMBERS = 2**23


@dataclass(frozen=True)
class Plan:
    """Which parts a scenario's dataset is made of."""

    scenario: Scenario
    points: tuple[Scenario, ...]

    @classmethod
    def of(cls, scenario: Scenario) -> "Plan":
        return cls(scenario, tuple(scenario.points()))

    @property
    def members(self) -> int:
        """Members that are advanced: one where no part differs between members."""
        varies = any(any(point.varies.values()) for point in self.points)
        return self.scenario.ensemble.members if varies else 1

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Quantities that are recorded at each record."""
        return self._there(VARIABLES)

    @cached_property
    def largest(self) -> tuple[Variable, ...]:
        """Quantities that are recorded of each whole run."""
        return self._there(LARGEST)

    def _there(self, variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        kept = [one for one in variables if self.scenario.record.keeps(one.name)]
        return tuple(one for one in kept if any(one.there(point) for point in self.points))

    @cached_property
    def group(self) -> int:
        """Members of one part."""
        some = self.points[:: max(1, len(self.points) // 4)]
        most = min(together(point) for point in some)
        for point in some:
            point.release()
        return min(self.members, most)

    @property
    def stretch(self) -> int:
        """Records of one part."""
        most = max(1, _PART_NUMBERS // (self.group * len(VARIABLES)))
        return min(self.points[0].clock.records, most)

    def groups(self) -> list[np.ndarray]:
        """The members of each group."""
        return [np.arange(first, min(first + self.group, self.members)) for first in range(0, self.members, self.group)]

    def stretches(self, point: Scenario) -> list[range]:
        """The records of each stretch."""
        records = point.clock.records
        return [range(first, min(first + self.stretch, records)) for first in range(0, records, self.stretch)]

    def varies(self, variable: Variable) -> bool:
        """Whether the variable has the member dimension."""
        return any(point.varies[variable.part] for point in self.points)


def together(scenario: Scenario) -> int:
    """Members that are best advanced together: as many as keep their state below 64 MB, 256 at the most."""
    return min(_GROUP, max(1, _STATE_NUMBERS // (2 * scenario.process.pairs + scenario.population.numbers)))


def work(plan: Plan) -> int:
    """Member-steps that a plan takes."""
    return sum(plan.members * (point.clock.steps + 1) for point in plan.points)


def part_name(point: int, group: int, stretch: int) -> str:
    """Name of a part, the same in every run of a scenario."""
    return f"point{point:06d}-group{group:06d}-stretch{stretch:06d}"
