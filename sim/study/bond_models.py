"""The depths that the bonds of a scene admit, and their march without anything else, for ``sim.study.bonds``."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.numerics.noise import Noise
from sim.parts.bonds import models as depths
from sim.parts.drive import Start, Steady
from sim.parts.exchange import Motion
from sim.scenario.scenario import Scenario

Array = NDArray[np.float64]

TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
#: Tolerance of the cohorts that all others are set against.
REFERENCE = 1e-6
SITES = (100, 1000, 10_000, 100_000)

#: Most steps of the march; of more, as many as needed are taken at once.
_MOST_STEPS = 5000
#: Times that a march is repeated, with new members where they differ, for the median of its cost.
_REPEATS = 3
#: Numbers of sites that a batch holds together, and its least and most members.
_BATCH_SITES, _FEWEST, _MOST = 100_000, 4, 64

_STRETCHED = ("rupture", "bond_stiffness", "rebinding_rate", "site_density", "start_from")
_PLAIN = ("critical_speed", "rebinding_rate", "stress", "start_from")


@dataclass
class BondRow:
    """One depth of the bonds and what became of it.

    Attributes
    ----------
    label, toml : str
        What it is called, and the lines of the scenario file that choose it.
    part : object
        The bonds.
    own : bool
        Whether it is what the scene asks for.
    sites : int
        Sites of a member; 0 where there is no number.
    tolerance : float
        Of cohorts; nan elsewhere.
    finer : int
        Parts in which each step is taken: 2 in the row that tells what the step costs.
    batches : list of array, each of shape (members, quantities, records)
        What was marched.
    cpu, wall : list of float
        Times per member-step [s] of each march.
    """

    label: str
    toml: str
    part: Any
    own: bool
    sites: int = 0
    tolerance: float = math.nan
    finer: int = 1
    batches: list[Array] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    wall: list[float] = field(default_factory=list)

    @property
    def members(self) -> int:
        """Members marched; one stands for all where they are equal, 0 where time was up."""
        if not self.batches:
            return 0
        return sum(len(batch) for batch in self.batches) if self.part.per_member else 1


@dataclass(frozen=True)
class Course:
    """Steps of the march: ``taken`` clock steps at once, each in ``finer`` parts; recorded after every so many."""

    scenario: Scenario
    taken: int
    every: int
    finer: int = 1

    @classmethod
    def of(cls, scenario: Scenario) -> "Course":
        clock = scenario.clock
        least = -(-clock.steps // _MOST_STEPS)
        # a divisor, where there is one, keeps the drive's turns at the ends of steps
        taken = next((n for n in range(least, 8 * least) if clock.steps % n == 0), least)
        return cls(scenario, taken, max(1, round(clock.stride / taken)))

    @property
    def steps(self) -> int:
        """Steps of the march; what does not fill the last record is left out."""
        return self.finer * (self.scenario.clock.steps // self.taken)

    def time(self, step: int) -> float:
        """Time at the end of a step [s]."""
        clock = self.scenario.clock
        return clock.duration * (step * self.taken / (self.finer * clock.steps))

    def motion(self, step: int) -> Motion:
        """The motion of a step, that of the scene's drive."""
        return self.scenario.drive.motion(
            step, self.time(max(step - 1, 0)), self.time(step), self.scenario.clock.duration
        )

    @property
    def times(self) -> Array:
        """Times of the records [s]."""
        return np.array([self.time(k) for k in range(0, self.steps + 1, self.every)])


def bond_rows(scenario: Scenario) -> list[BondRow]:
    """Every depth of the scene's bonds, shallow ones first, its own among them."""
    given: Any = scenario.population
    if not hasattr(given, "rupture"):
        shared = {name: getattr(given, name) for name in _PLAIN}
        steady = {name: shared[name] for name in ("critical_speed", "stress")}
        rows = [_row(given, depths.Steady(**steady), "steady"), _row(given, depths.Rate(**shared), "rate")]
        counts = sorted({*SITES, getattr(given, "sites", SITES[0])})
        rows += [_row(given, depths.Counted(**shared, sites=n), f"counted {n:,}", sites=n) for n in counts]
        return rows + _halved(scenario, rows[1])
    shared = {name: getattr(given, name) for name in _STRETCHED}
    rows = [_row(given, depths.FirstMoment(**shared), "rate")]
    for tolerance in sorted({*TOLERANCES, REFERENCE, getattr(given, "tolerance", REFERENCE)}, reverse=True):
        part = depths.Cohort(**shared, tolerance=tolerance)
        rows.append(_row(given, part, f"cohort {tolerance:g}", tolerance=tolerance))
    for sites in sorted({*SITES, getattr(given, "sites", SITES[0])}):
        rows.append(_row(given, depths.Tracked(**shared, sites=sites), f"tracked {sites:,}", sites=sites))
    return rows + _halved(scenario, next(row for row in rows if row.tolerance == REFERENCE))


def _row(given: Any, part: Any, label: str, sites: int = 0, tolerance: float = math.nan) -> BondRow:
    lines = ["[bonds]", f'model = "{part.model}"']
    lines += [f"sites = {sites}"] * bool(sites) + [f"tolerance = {tolerance:g}"] * math.isfinite(tolerance)
    own = type(part) is type(given) and sites in (0, getattr(given, "sites", 0))
    own = own and (math.isnan(tolerance) or tolerance == given.tolerance)
    return BondRow(label, "\n".join(lines), part, own, sites, tolerance)


def _halved(scenario: Scenario, row: BondRow) -> list[BondRow]:
    """A row in steps of half the length, where the speed may change within a step."""
    if isinstance(scenario.drive, Steady | Start):
        return []
    return [replace(row, label=f"{row.label}, half steps", own=False, finer=2, batches=[], cpu=[], wall=[])]


def _batch(row: BondRow) -> int:
    """Members marched together: as many as hold a bounded number of sites, where these cost anything."""
    if not row.part.per_member:
        return 1
    return min(max(_BATCH_SITES // row.sites, _FEWEST), _MOST) if isinstance(row.part, depths.Tracked) else _MOST


def march_all(rows: list[BondRow], course: Course, share: float) -> None:
    """March every row up to three times within its share of the time."""
    late: dict[type, int] = {}
    compiled: set[type] = set()
    for row in rows:
        kind = type(row.part)
        if kind not in compiled:
            march(row, course, np.arange(1), math.inf, 2)
            compiled.add(kind)
        if late.get(kind, row.sites) < row.sites:
            continue  # fewer sites were too many already
        batch = _batch(row)
        began = time.perf_counter()
        kept, done = march(row, course, np.arange(batch), began + share)
        if kept is None and batch * done > 2.0 * _FEWEST:
            kept, done = march(row, course, np.arange(_FEWEST), time.perf_counter() + 3.0 * share)
            batch = _FEWEST
        while kept is not None:
            row.batches.append(kept)
            spent, number = time.perf_counter() - began, len(row.batches)
            if number == _REPEATS or spent * (number + 1) / number > share:
                break
            kept, done = march(row, course, batch * number + np.arange(batch), math.inf)
        if not row.batches:
            late[kind] = row.sites


def march(
    row: BondRow, course: Course, members: Any, deadline: float, most: int | None = None
) -> tuple[Array | None, float]:
    """What each member tells at the records, shape (members, 3, records), if time allows; share of the march done."""
    course = replace(course, finer=row.finer)
    noise, kept = Noise(course.scenario.seed, "bonds", members), []
    steps = course.steps if most is None else min(most, course.steps)
    wall, cpu = time.perf_counter(), time.process_time()
    for step, state in enumerate(_states(row.part, course, noise, steps)):
        if step % (course.every * course.finer) == 0:
            kept.append(_told(row.part, state))
        if time.perf_counter() > deadline:
            return None, step / steps
    if most is None:
        count = len(members) * max(steps, 1)
        row.wall.append((time.perf_counter() - wall) / count)
        row.cpu.append((time.process_time() - cpu) / count)
    return np.stack(kept, axis=2), 1.0


def _states(part: Any, course: Course, noise: Noise, steps: int) -> Iterator[Any]:
    state = part.start(course.motion(0), noise)
    yield state
    for step in range(1, steps + 1):
        state = part.advance(state, course.motion(step), np.ones(1), noise)
        yield state


def _told(part: Any, state: Any) -> Array:
    """Shear stress, bond fraction and mean square force per site of each member, shape (members, 3)."""
    bonding = part.bonding(state)
    if not hasattr(part, "rupture"):
        return np.stack([bonding.stress, bonding.fraction, np.full(bonding.fraction.shape, np.nan)], axis=1)
    square = np.broadcast_to(part.moments(state)[2], bonding.stress.shape)
    return np.stack([bonding.stress, bonding.fraction, part.bond_stiffness**2 * square], axis=1)
