"""Division of a run into sweep points, groups of members and blocks of steps, by the scenario alone."""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from sim.ensemble.variables import LARGEST, VARIABLES, Variable
from sim.parts.exchange import Parts
from sim.quantities import Mean
from sim.scenario.scenario import Scenario

_GROUP = 256
_PART_NUMBERS = 2**22
_STATE_NUMBERS = 2**23
# Rough costs of one core [s]: a step of a batch, more if it is advanced step by step; of a member, of a counted
# population, an event of a bond that is followed, more behind a spring.
_STEP, _ALONE, _OF_MEMBER, _COUNTED, _EVENT, _DRIVEN_EVENT = (
    5e-6,
    150e-6,
    5e-8,
    3e-7,
    1e-7,
    3e-6,
)
#: A dataset without its trajectories [byte], and a variable over the sweep alone; number of statistics of each pooled
#: variable.
_SCENARIO_BYTES, _VARIABLE_BYTES, _STATISTICS = 1.6e5, 3.6e3, 3
#: Counted work [s of one core]: of a block at most, of a run that is cut into smaller groups for several cores, and of
#: one for each process that is worth starting.
_BLOCK_SECONDS, _SHARED_SECONDS, _PROCESS_SECONDS = 2.0, 20.0, 4.0
_SMALLEST_GROUP = 16
#: Rough ratio of compression of trajectories, by ``record.compression``, and of maps; the largest file of trajectories
#: in which every member is kept by default [byte].
_PACKED, _PACKED_MAPS = {"none": 1.0, "zlib": 0.4, "digits": 0.2}, 0.85
_MOST_BYTES = 20e9
#: A dataset of more bytes is not built in memory, where it is held twice for a moment.
IN_MEMORY = 128 * 2**20


class Block(NamedTuple):
    """Steps that are computed and stored together: from after step ``start`` (-1 before a run) to ``end``."""

    start: int
    end: int
    stride: int

    @property
    def records(self) -> range:
        """Return the numbers of the records among the steps."""
        return range(self.start // self.stride + 1, self.end // self.stride + 1)

    def pieces(self, most: int, snapshots: list[int]) -> Iterator[range]:
        """Yield ranges of recorded steps, of at most ``most`` steps; a step at which maps are drawn ends a range.

        A block without records yields its end.
        """
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
    """Blocks of one group of members, one after the other, at one point of a sweep or at neighbours with short runs.

    ``names`` are those of its parts, ``quantities`` those that are recorded. Members differ in the quantities of
    ``each``; if members are ``pooled``, only moments of these are stored.
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
        """Return the member-steps of each block."""
        return [
            len(self.points) * len(self.members) * (block.end - block.start)
            for block in self.blocks
        ]

    def done(self, parts: Any) -> int:
        """Return the member-steps of the blocks whose parts are stored."""
        return sum(
            steps
            for name, steps in zip(self.names, self.work, strict=True)
            if name in parts
        )

    def __str__(self) -> str:
        first, last = self.members[0], self.members[-1]
        return f"members {first} to {last} of {self.names[0].partition('-')[0]}"


@dataclass(frozen=True)
class Plan:
    """Parts of which the dataset of a scenario is made; ``about`` holds further attributes of the dataset."""

    scenario: Scenario
    points: tuple[Scenario, ...]
    about: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, scenario: Scenario, about: Mapping[str, str] | None = None) -> "Plan":
        return cls(scenario, tuple(scenario.points()), about or {})

    @cached_property
    def members(self) -> int:
        """Return the number of members that are advanced: one if nothing is random."""
        return self.scenario.ensemble.members if any(self._vary.values()) else 1

    @cached_property
    def _vary(self) -> dict[str, bool]:
        """Map each part to True if members differ in it at any point.

        Members behind a spring have a motion each, which differs only if a part is
        random at any point.
        """
        is_random = any(point.is_random for point in self.points)
        return {
            part: is_random and any(point.varies[part] for point in self.points)
            for part in self.points[0].varies
        }

    @property
    def differing(self) -> list[str]:
        """Return the names of the parts in which members differ."""
        return [part for part in Parts._fields if self._vary[part]]

    @cached_property
    def variables(self) -> tuple[Variable, ...]:
        """Return the quantities that are recorded at each record."""
        return self._recorded(VARIABLES)

    @cached_property
    def largest(self) -> tuple[Variable, ...]:
        """Return the quantities that are recorded once a run: slip events of members, phases if there are several."""
        axes = "", "slip" * self.per_member, "phase" * (self.phases > 1)
        return tuple(each for each in self._recorded(LARGEST) if each.axis in axes)

    @cached_property
    def phases(self) -> int:
        """Return the largest number of phases of a point."""
        return max(len(point.phases.starts) for point in self.points)

    def _recorded(self, variables: tuple[Variable, ...]) -> tuple[Variable, ...]:
        wanted = (
            variable
            for variable in variables
            if self.scenario.record.keeps(variable.name)
        )
        return tuple(
            variable for variable in wanted if any(map(variable.applies, self.points))
        )

    @cached_property
    def _pieces(self) -> tuple[int, int]:
        """Return the members of a group and the most steps of a block, by the first and the last point of the sweep."""
        ends = self.points[0], self.points[-1]
        group = min(self.members, *(together(point) for point in ends))
        # smaller groups for more cores, if a batch costs little
        if self._seconds(group) > _SHARED_SECONDS:
            batch, whole = (
                max(seconds_a_step(point, rows) for point in ends)
                for rows in (0, group)
            )
            group = min(
                group,
                max(_SMALLEST_GROUP, math.ceil(10.0 * batch * group / (whole - batch))),
            )
        steps = min(
            int(_BLOCK_SECONDS / seconds_a_step(point, group)) for point in ends
        )
        for point in ends:
            point.release()
        return group, max(1, steps)

    def _seconds(self, group: int) -> float:
        """Return the counted work of the whole run in groups of so many members, as time of one core [s]."""
        runs = len(self.points) * self.members / group
        return (
            runs * self.points[0].clock.steps * seconds_a_step(self.points[-1], group)
        )

    def worthwhile(self) -> int:
        """Return the number of processes that are worth starting."""
        return min(
            len(self.packs) * len(self.groups),
            1 + int(self._seconds(self.group) / _PROCESS_SECONDS),
        )

    @property
    def group(self) -> int:
        """Return the number of members that are advanced together and stored in one part."""
        return self._pieces[0]

    def records_of_block(self, point: Scenario) -> int:
        """Return the records of a block; 0 if the steps of a record take longer than a block."""
        return min(
            self._pieces[1] // point.clock.stride,
            self._most_records,
            point.clock.records,
        )

    @property
    def _most_records(self) -> int:
        return max(1, _PART_NUMBERS // (self.group * len(VARIABLES)))

    def snapshots_of_block(self, point: Scenario) -> int:
        """Return the largest number of times in one block at which maps are drawn."""
        return max(
            1,
            int(
                8
                * _PART_NUMBERS
                * len(point.record.maps)
                / map_bytes(point, self.group)
            ),
        )

    def blocks(self, point: Scenario) -> list[Block]:
        """Return the blocks of a group: of whole records, or of steps between two records if a record takes too long.

        Large maps end a block.
        """
        clock, longest = point.clock, self._pieces[1]
        if records := self.records_of_block(point):
            ends = {
                *range(
                    (records - 1) * clock.stride, clock.steps, records * clock.stride
                ),
                clock.steps,
            }
        else:
            intervals = (
                range(first, first + clock.stride, longest)
                for first in range(0, clock.steps, clock.stride)
            )
            ends = {clock.steps, *itertools.chain(*intervals)}
        if point.map_lattice is not None:
            ends |= {*snapshots(point)[:: self.snapshots_of_block(point)]}
        stops = sorted(ends)
        return [
            Block(start, end, clock.stride)
            for start, end in zip([-1, *stops], stops, strict=False)
        ]

    def keeps_late(self, variable: Variable) -> bool:
        """Return True if statistics of a quantity over the second half of the run are recorded, for want of members."""
        has_mean = variable.definition.mean is not Mean.NONE
        is_averaged = variable in self.variables and has_mean
        return is_averaged and self.varies(variable) and not self.per_member

    @cached_property
    def packs(self) -> list[range]:
        """Return ranges of points that are stored in one part: neighbours on the last axis with short runs."""
        first, along, together = (
            self.points[0],
            len(self.scenario.sweep[-1].values) if self.scenario.sweep else 1,
            1,
        )
        alike = not first.record.maps and all(
            point.clock == first.clock for point in self.points
        )
        if alike and len(self.blocks(first)) == 1:
            by_work, by_records = (
                self._pieces[1] // (first.clock.steps + 1),
                self._most_records // first.clock.records,
            )
            together = min(along, max(1, min(by_work, by_records)))
        rows = range(0, len(self.points), along)
        return [
            range(a, min(a + together, row + along))
            for row in rows
            for a in range(row, row + along, together)
        ]

    def tasks(self) -> Iterator[Task]:
        """Yield all tasks of the run."""
        recorded = self.variables + self.largest
        quantities = [variable.name for variable in recorded]
        each = {variable.name for variable in recorded if self.varies(variable)}
        for pack in self.packs:
            points = [self.points[number] for number in pack]
            blocks = self.blocks(points[0])
            for group, members in enumerate(self.groups):
                names = [
                    part_name(pack.start, group, index) for index in range(len(blocks))
                ]
                yield Task(
                    points,
                    np.array(members),
                    blocks,
                    names,
                    quantities,
                    each,
                    not self.per_member,
                )

    def share(self, number: int, of: int) -> Iterator[Task]:
        """Yield the tasks of one shard; the shards take turns."""
        return itertools.islice(self.tasks(), number - 1, None, of)

    @cached_property
    def groups(self) -> list[range]:
        """Return the members of each group."""
        return [
            range(first, min(first + self.group, self.members))
            for first in range(0, self.members, self.group)
        ]

    @cached_property
    def bytes(self) -> float:
        """Return the size of the dataset before compression [byte]."""
        return self._scenario_bytes + self.maps + self.trajectories

    @property
    def file_bytes(self) -> float:
        """Return the rough size of the dataset [byte]."""
        ratio = _PACKED[self.scenario.record.compression]
        return (
            self._scenario_bytes + _PACKED_MAPS * self.maps + ratio * self.trajectories
        )

    @property
    def _scenario_bytes(self) -> float:
        pooled = (
            []
            if self.per_member
            else list(filter(self.varies, self.variables + self.largest))
        )
        return _SCENARIO_BYTES + _VARIABLE_BYTES * (
            self.late + _STATISTICS * len(pooled)
        )

    @property
    def late(self) -> int:
        """Return the number of quantities of which statistics over the second half of the run are recorded."""
        return sum(map(self.keeps_late, self.variables))

    @property
    def maps(self) -> float:
        """Return the size of all maps before compression [byte]."""
        return len(self.points) * map_bytes(self.points[0], self.members)

    @property
    def trajectories(self) -> float:
        """Return the size of all trajectories before compression [byte]."""
        return self._trajectories(self.per_member)

    @cached_property
    def per_member(self) -> bool:
        """True if every member is recorded.

        That is so if they do not differ, and by default unless the file would be too
        large.
        """
        record = self.scenario.record
        if not self.differing:
            return True
        if record.per_member is not None:
            return record.per_member
        return _PACKED[record.compression] * self._trajectories(True) <= _MOST_BYTES

    def _trajectories(self, per_member: bool) -> float:
        """Return the size of the trajectories before compression [byte]."""
        each = 4.0 if self.scenario.record.precision == "float32" else 8.0
        varying = self.members * each if per_member else _STATISTICS * 8.0
        a_record = sum(
            varying if self.varies(variable) else each for variable in self.variables
        )
        return a_record * self.points[0].clock.records * len(self.points)

    def varies(self, variable: Variable) -> bool:
        """True if members differ in the variable."""
        return self._vary[variable.part]


def together(scenario: Scenario) -> int:
    """Return the members that are best advanced together: their state stays below 64 MB, and they are at most 256."""
    return min(_GROUP, max(1, _STATE_NUMBERS // state_numbers(scenario)))


def snapshots(point: Scenario) -> list[int]:
    """Return the clock steps at which maps are drawn."""
    clock = point.clock
    return [
        round(time / clock.duration * (clock.records - 1)) * clock.stride
        for time in sorted(point.record.maps)
    ]


def state_numbers(point: Scenario) -> int:
    """Return the count of numbers in the state of a member."""
    return 2 * point.process.pairs + point.population.numbers


def seconds_a_step(point: Scenario, members: int) -> float:
    """Return the rough time of one core for a step of a batch, averaged over the run [s], the same on any machine."""
    bonds, batch = (
        point.population,
        _STEP + _ALONE * (point.stepper.longest == 1) + point.population.step_seconds,
    )
    member = (
        _OF_MEMBER
        + point.process.pairs * point.fluctuations.pair_seconds
        + point.contact.edge_seconds
    )
    if bonds.is_random:
        event = _DRIVEN_EVENT if point.drive.solves_motion else _EVENT
        member += _COUNTED + event * bonds.followed(point.speeds(21), point.clock.step)
    return batch + members * member


def map_bytes(point: Scenario, members: int) -> float:
    """Return the size of the maps of some members at one point of a sweep [byte]."""
    if point.map_lattice is None:
        return 0.0
    return (
        8.0
        * min(point.record.map_members, members)
        * len(point.record.maps)
        * math.prod(point.map_lattice.shape)
    )


def work(plan: Plan, number: int = 1, of: int = 1) -> int:
    """Return the member-steps of a plan, or of one shard of it."""
    steps = (
        len(pack) * (plan.points[pack.start].clock.steps + 1) for pack in plan.packs
    )
    return sum(
        itertools.islice(
            (one * len(group) for one in steps for group in plan.groups),
            number - 1,
            None,
            of,
        )
    )


def part_name(point: int, group: int, block: int) -> str:
    """Return the name of a part, the same in every run of a scenario."""
    return f"point{point:06d}-group{group:06d}-block{block:06d}"
