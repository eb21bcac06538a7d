"""Division of a run into points, groups of members and blocks of steps, by the scenario alone."""

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from sim.ensemble.recorded import LARGEST, VARIABLES, Variable
from sim.scenario.scenario import Scenario

_GROUP = 256
_PART_NUMBERS = 2**22
_STATE_NUMBERS = 2**23
# Rough costs of one core [s]: a step of a batch, of one where a part feeds back; of a member, of a counted population,
# an event of a bond that is followed.
_STEP, _ALONE, _OF_MEMBER, _COUNTED, _EVENT = 5e-6, 150e-6, 5e-8, 3e-7, 1e-7
#: A dataset without its trajectories [byte]; statistics of each.
_SCENARIO_BYTES, _STATISTICS = 1.2e5, 3
#: Counted work [s of one core]: of a block at most, of a run that is cut into smaller groups for several cores, and of
#: one for each process that is worth starting.
_BLOCK_SECONDS, _SHARED_SECONDS, _PROCESS_SECONDS = 5.0, 20.0, 4.0
_SMALLEST_GROUP = 16
#: What is left of trajectories by ``record.compression``, roughly, and of maps; and the largest file of trajectories
#: that nobody asked for [byte].
_LEFT, _LEFT_OF_MAPS = {"none": 1.0, "zlib": 0.4, "digits": 0.2}, 0.85
_MOST_BYTES = 20e9


class Block(NamedTuple):
    """Steps that are computed and kept as one: from after step ``start`` (-1 before a run) to ``end``."""

    start: int
    end: int
    stride: int

    @property
    def records(self) -> range:
        """Numbers of the records among the steps."""
        return range(self.start // self.stride + 1, self.end // self.stride + 1)

    def pieces(self, most: int, snapshots: list[int]) -> Iterator[range]:
        """Recorded steps, at most so many together and none after one at which maps are drawn; without any its end."""
        records, stride = self.records, self.stride
        if not records:
            yield range(self.end, self.end + 1)
        first = records.start
        while first < records.stop:
            drawn = (step // stride + 1 for step in snapshots if step >= first * stride)
            stop = min(first + most, records.stop, *drawn)
            yield range(first * stride, (stop - 1) * stride + 1, stride)
            first = stop


class Task(NamedTuple):
    """Blocks of one group of members, one after the other, at one point of a sweep or at several whose run is short.

    ``names`` are those of its parts, ``quantities`` those that are recorded; members differ in some (``each``), of
    which only moments are kept where members are ``pooled``.
    """

    points: list[Scenario]
    members: np.ndarray
    blocks: list[Block]
    names: list[str]
    quantities: list[str]
    each: set[str]
    pooled: bool

    @property
    def work(self) -> list[int]:
        """Member-steps of each block."""
        return [len(self.points) * len(self.members) * (block.end - block.start) for block in self.blocks]

    def done(self, parts: Any) -> int:
        """Member-steps of the blocks whose parts are there."""
        return sum(steps for name, steps in zip(self.names, self.work, strict=True) if name in parts)

    def __str__(self) -> str:
        first, last = self.members[0], self.members[-1]
        return f"members {first} to {last} of {self.names[0].partition('-')[0]}"


@dataclass(frozen=True)
class Plan:
    """Which parts a scenario's dataset is made of."""

    scenario: Scenario
    points: tuple[Scenario, ...]

    @classmethod
    def of(cls, scenario: Scenario) -> "Plan":
        return cls(scenario, tuple(scenario.points()))

    @cached_property
    def members(self) -> int:
        """Members that are advanced: one where no part differs between members."""
        return self.scenario.ensemble.members if any(self._vary.values()) else 1

    @cached_property
    def _vary(self) -> dict[str, bool]:
        """For each part whether members differ in it, at any point."""
        return {part: any(point.varies[part] for point in self.points) for part in self.points[0].varies}

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
    def _pieces(self) -> tuple[int, int]:
        """Members of a group and most steps of a block, by the first and the last point of the sweep."""
        ends = self.points[0], self.points[-1]
        group = min(self.members, *(together(point) for point in ends))
        if self._seconds(group) > _SHARED_SECONDS:  # smaller groups for more cores, where a batch costs little
            batch, whole = (max(seconds_a_step(point, rows) for point in ends) for rows in (0, group))
            group = min(group, max(_SMALLEST_GROUP, math.ceil(10.0 * batch * group / (whole - batch))))
        steps = min(int(_BLOCK_SECONDS / seconds_a_step(point, group)) for point in ends)
        for point in ends:
            point.release()
        return group, max(1, steps)

    def _seconds(self, group: int) -> float:
        """Counted work of the whole run in groups of so many members, as time of one core [s]."""
        runs = len(self.points) * self.members / group
        return runs * self.points[0].clock.steps * seconds_a_step(self.points[-1], group)

    def worthwhile(self) -> int:
        """Return the number of processes that are worth starting."""
        return min(len(self.packs) * len(self.groups()), 1 + int(self._seconds(self.group) / _PROCESS_SECONDS))

    @property
    def group(self) -> int:
        """Members that are advanced together and kept in one part."""
        return self._pieces[0]

    def records_of_block(self, point: Scenario) -> int:
        """Records of a block; 0 where a record's steps take longer than a block."""
        return min(self._pieces[1] // point.clock.stride, self.most_records, point.clock.records)

    @property
    def most_records(self) -> int:
        """Records of a block that bounds its numbers."""
        return max(1, _PART_NUMBERS // (self.group * len(VARIABLES)))

    def snapshots_of_block(self, point: Scenario) -> int:
        """Times at most of one block at which maps are drawn."""
        return max(1, int(8 * _PART_NUMBERS * len(point.record.maps) / map_bytes(point, self.group)))

    def blocks(self, point: Scenario) -> list[Block]:
        """Blocks of a group: of whole records, or where one takes too long, of some steps between two records.

        Where maps are large, each ends a block.
        """
        clock, longest = point.clock, self._pieces[1]
        if records := self.records_of_block(point):
            ends = {*range((records - 1) * clock.stride, clock.steps, records * clock.stride), clock.steps}
        else:
            intervals = (range(first, first + clock.stride, longest) for first in range(0, clock.steps, clock.stride))
            ends = {clock.steps, *itertools.chain(*intervals)}
        if point.map_lattice is not None:
            ends |= {*snapshots(point)[:: self.snapshots_of_block(point)]}
        stops = sorted(ends)
        return [Block(start, end, clock.stride) for start, end in zip([-1, *stops], stops, strict=False)]

    @cached_property
    def packs(self) -> list[range]:
        """Points of the sweep that are kept in one part: neighbours on its last axis whose whole runs are short."""
        first, along = self.points[0], len(self.scenario.sweep[-1].values) if self.scenario.sweep else 1
        together = 1
        alike = not first.record.maps and all(point.clock == first.clock for point in self.points)
        if alike and len(self.blocks(first)) == 1:
            by_work, by_records = self._pieces[1] // (first.clock.steps + 1), self.most_records // first.clock.records
            together = min(along, max(1, min(by_work, by_records)))
        rows = range(0, len(self.points), along)
        return [range(a, min(a + together, row + along)) for row in rows for a in range(row, row + along, together)]

    def tasks(self) -> Iterator[Task]:
        """All that is to be computed."""
        recorded = self.variables + self.largest
        quantities, each = [one.name for one in recorded], {one.name for one in recorded if self.varies(one)}
        for pack in self.packs:
            points = [self.points[number] for number in pack]
            blocks = self.blocks(points[0])
            for group, members in enumerate(self.groups()):
                names = [part_name(pack.start, group, index) for index in range(len(blocks))]
                yield Task(points, members, blocks, names, quantities, each, not self.per_member)

    def share(self, number: int, of: int) -> Iterator[Task]:
        """What one of several shards computes, each in turn."""
        return itertools.islice(self.tasks(), number - 1, None, of)

    def groups(self) -> list[np.ndarray]:
        """The members of each group."""
        return [np.arange(first, min(first + self.group, self.members)) for first in range(0, self.members, self.group)]

    @cached_property
    def bytes(self) -> float:
        """Size of all that is recorded, before compression [byte]."""
        return _SCENARIO_BYTES + self.maps + self.trajectories

    @property
    def file_bytes(self) -> float:
        """Size of the dataset, roughly [byte]."""
        return _SCENARIO_BYTES + _LEFT_OF_MAPS * self.maps + self._left * self.trajectories

    @property
    def maps(self) -> float:
        """Size of all maps, before compression [byte]."""
        return len(self.points) * map_bytes(self.points[0], self.members)

    @property
    def trajectories(self) -> float:
        """Size of all trajectories, before compression [byte]."""
        return self._trajectories(self.per_member)

    @property
    def _left(self) -> float:
        return _LEFT[self.scenario.record.compression]

    @cached_property
    def per_member(self) -> bool:
        """Whether every member is kept; where the scenario leaves it open, unless they would make too large a file."""
        record = self.scenario.record
        if record.per_member is not None:
            return record.per_member
        return self._left * self._trajectories(True) <= _MOST_BYTES

    def _trajectories(self, per_member: bool) -> float:
        """Size of the trajectories before compression [byte]."""
        each, total = 4.0 if self.scenario.record.precision == "float32" else 8.0, 0.0
        for variable in self.variables:
            rows, size = 1, each
            if self.varies(variable):
                rows, size = (self.members, each) if per_member else (_STATISTICS, 8.0)
            total += rows * size * self.points[0].clock.records * len(self.points)
        return total

    def varies(self, variable: Variable) -> bool:
        """Whether the variable has the member dimension."""
        return self._vary[variable.part]


def together(scenario: Scenario) -> int:
    """Members that are best advanced together: as many as keep their state below 64 MB, 256 at the most."""
    return min(_GROUP, max(1, _STATE_NUMBERS // state_numbers(scenario)))


def snapshots(point: Scenario) -> list[int]:
    """Clock steps at which maps are drawn."""
    clock = point.clock
    return [round(time / clock.duration * (clock.records - 1)) * clock.stride for time in sorted(point.record.maps)]


def state_numbers(point: Scenario) -> int:
    """Numbers that the state of a member holds."""
    return 2 * point.process.pairs + point.population.numbers


def seconds_a_step(point: Scenario, members: int, speeds: np.ndarray | None = None) -> float:
    """Rough time of one core for a step of a batch [s], which does not depend on the machine; on average over the run.

    Given ``speeds`` [m/s] it is that of steps at these.
    """
    bonds, batch = point.population, _STEP + _ALONE * point.by_steps + point.population.step_seconds
    member = _OF_MEMBER + point.process.pairs * point.fluctuations.pair_seconds + point.contact.edge_seconds
    if bonds.per_member and not bonds.feeds_back:
        member += _COUNTED + _EVENT * bonds.followed(point.speeds(21) if speeds is None else speeds, point.clock.step)
    return batch + members * member


def map_bytes(point: Scenario, members: int) -> float:
    """Size of the maps of some members at one point of a sweep [byte]."""
    if point.map_lattice is None:
        return 0.0
    return 8.0 * min(point.record.map_members, members) * len(point.record.maps) * math.prod(point.map_lattice.shape)


def work(plan: Plan, number: int = 1, of: int = 1) -> int:
    """Member-steps that a plan takes, or one of several shards."""
    return sum(sum(task.work) for task in plan.share(number, of))


def part_name(point: int, group: int, block: int) -> str:
    """Name of a part, the same in every run of a scenario."""
    return f"point{point:06d}-group{group:06d}-block{block:06d}"
