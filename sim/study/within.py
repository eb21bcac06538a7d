"""The cheapest run of a scene within an accepted error: ``sim run --within``.

The *error* of a quantity is its difference from the finest admissible models of the scene, in the limit of fine clock
steps and many members. Of a quantity over time it is the largest difference of the mean over the members, over the
largest absolute mean of the run, at each point of a sweep. Of a share it is the difference itself. The total is the
bound of the systematic part plus the bound of the noise at all recorded times together (95 %).

A *pilot* of a few members runs the scene at each setting and compares it with the finest one. Settings are chosen by
their counted work, the same on any machine, so the choice is, too. Differences of single changes are added up. Before
the run the chosen combination is compared with a finer one, because errors need not add up.

Behind a spring or under a force single paths diverge, so means over the second half of the run are compared there.
"""

import contextlib
import itertools
import json
import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import special

from sim.ensemble.dataset import scenario_json
from sim.ensemble.plan import together
from sim.ensemble.swept import spread
from sim.quantities import has_mean
from sim.read.correlation import Array
from sim.scenario.files import written
from sim.scenario.scenario import Scenario
from sim.scenario.sweep import written as written_sweep
from sim.study.accuracy import (
    alternatives,
    changed_part,
    part_table,
    step_values,
    students,
)
from sim.study.pilot import (
    POINTS,
    Cost,
    Names,
    Pilots,
    Sample,
    difference,
    in_units,
    usual,
)
from sim.units.errors import BadInput
from sim.units.notation import engineering

#: Members of the pilots, and fewest and most members of a run.
_PILOTS, _FEWEST, _MOST = (32, 128, 512, 2048), 8, 10**6
#: Clock steps over that of the scene, and the factor by which the change from one to the next falls at least: 4^p with
#: the lowest order p = 1/2.
_RATIOS, _FALL = tuple(4.0**power for power in range(2, -5, -1)), 2.0
_TOO_LONG, _UNRESOLVED = "does not fit into the budget", "motion not resolved"
#: Change of the last clock step over the accepted error that is small enough.
_SMALL = 0.1
#: Models without noise, of which the last that a scene admits stands for a random one.
_NOISELESS = ("mean", "rate", "cohort")
#: Work of a run over that of its pilots beyond which larger pilots may find a cheaper run.
_WORTH_MORE = 4.0
#: Chance that the noise of a pilot is larger than estimated.
_UNSURE = 0.2


class NotReached(RuntimeError):
    """An accuracy that is not reached within the budget."""

    exit_code = 1


@dataclass(frozen=True)
class Goal:
    """Accepted error of some quantities, and the counted work [s] that may be spent to reach it.

    ``of`` without names stands for those that ``default`` returns of a pilot.
    """

    within: float
    of: tuple[str, ...] = ()
    budget: float = 60.0
    default: Names = usual


class Setting(NamedTuple):
    """One setting of a part, with its error and its counted work.

    Attributes
    ----------
    part, label : str
        Table of the scenario that it changes, and its name.
    changes : dict
        Keys of the table that choose it.
    values : dict
        Tables of the scenario with these changes.
    error : array, shape (2, names)
        Bound of its systematic error, and the noise of the pilots in it [1].
    cost : Cost
        Counted work.
    is_own : bool
        True for that of the scene.
    random : set of str
        Parts in which members differ, of shear and bonds.
    ratio : float
        Clock step over that of the scene.
    """

    part: str
    label: str
    changes: dict[str, Any]
    values: dict[str, Any]
    error: Array
    cost: Cost
    is_own: bool
    random: frozenset[str]
    ratio: float = 1.0


class Choice(NamedTuple):
    """A combination of settings with its members, its counted work [s] and its error.

    Attributes
    ----------
    rows : tuple of Setting
        The settings, that of the clock step last.
    members : int
        Members of the run.
    work : float
        Counted work of the run [s].
    systematic, noise : array, shape (names,)
        Bounds of the systematic part and of the noise [1].
    """

    rows: tuple[Setting, ...]
    members: int
    work: float
    systematic: Array
    noise: Array

    @property
    def total(self) -> float:
        """The largest error of a name [1]."""
        return float(np.max(self.systematic + self.noise))

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the settings that differ from the scene's."""
        return tuple(_named(row) for row in self.rows if not row.is_own)

    @property
    def values(self) -> dict[str, Any]:
        """Tables of the scenario that choose the settings that differ from the scene's."""
        changed = [row.values for row in self.rows if not row.is_own]
        return {part: table for values in changed for part, table in values.items()}


class Search:
    """The search for the cheapest run of a scene within a goal.

    Parameters
    ----------
    scenario : Scenario
        The scene with its own settings.
    goal : Goal
        Accepted error.
    pilot : int
        Members of the pilot.
    spent : float
        Counted work that is spent already [s].

    Raises
    ------
    NotReached
        If not even the pilot of the scene fits into the budget.
    BadInput
        If a named quantity has no mean over time, or the field is a measured map.
    """

    def __init__(
        self, scenario: Scenario, goal: Goal, pilot: int, spent: float = 0.0
    ) -> None:
        if scenario.fluctuations.measured:
            cure = "study fields of its spectrum, shear.spectrum"
            raise BadInput([f"shear.field: a map has no simpler model; {cure}"])
        self.goal, self.pilot = goal, pilot
        self.pilots = Pilots(pilot, goal.of, goal.default, goal.budget, spent)
        #: Settings that do not fit into the budget or that the scene refuses, with the reason.
        self.left_out = list[str]()
        #: True if the finest model of a part does not fit into the budget.
        self.lacks_finest = False
        #: Quantity that does not converge as the clock step decreases, in words; else empty.
        self.trend = ""
        self.sweep = {"sweep": written_sweep(scenario.sweep)} if scenario.sweep else {}
        self.scene = self._with(scenario, _without_auto(scenario) | {"accuracy": None})
        sample = self.pilots[self.scene]
        if self.pilots.is_unresolved(self.scene):
            cure = "set drive.viscosity or a shorter clock.step"
            raise NotReached(f"some motions could not be resolved; {cure}")
        if sample is None:
            needed = engineering(10.0 * self.pilots.needed(self.scene), "s")
            raise NotReached(f'a pilot exceeds the budget; give --budget "{needed}"')
        self.written, self.names = sample, self.pilots.names
        free = self.pilot - 1.0
        unsure = math.sqrt(free / float(special.chdtri(free, 1.0 - _UNSURE)))
        #: Standard error of a single member, as large as the pilot allows [1].
        self.of_one = (
            in_units(sample.sem, sample.unit).max(axis=1)
            * math.sqrt(self.pilot)
            * unsure
        )

    @property
    def spent(self) -> float:
        """Return the counted work that is spent [s]."""
        return self.pilots.spent

    def _with(self, scenario: Scenario, values: dict[str, Any]) -> Scenario:
        """Return a scenario with some keys changed, with its sweep."""
        return scenario.with_values(self.sweep | values, built=False)

    def noise(self, members: int) -> Array:
        """Return the simultaneous bound of the noise at all compared times, shape (quantities,)."""
        factor = students(members, self.written.mean.shape[1])
        return np.asarray(factor * self.of_one / math.sqrt(members))

    def members(self, left: Array) -> int:
        """Return the fewest members whose noise is at most what is ``left`` of the accepted error; 0 for none."""
        low = high = _FEWEST
        while np.any(self.noise(high) > left):
            low, high = high, 2 * high
            if high > _MOST:
                return 0
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (
                (middle, high) if np.any(self.noise(middle) > left) else (low, middle)
            )
        return high

    @cached_property
    def groups(self) -> list[list[Setting]]:
        """The admissible settings of each part, with their systematic errors; the clock steps are last.

        Settings whose pilot does not fit into the budget are left out.

        Raises
        ------
        NotReached
            If a setting of a part that is finer than that of the scene, or a second clock step, does not fit into the
            budget.
        """
        rows = itertools.groupby(alternatives(self.scene), key=lambda row: row[0])
        groups = [
            self._of_part(part, [changes for _, changes in group])
            for part, group in rows
        ]
        return [*filter(None, groups), self._of_steps()]

    def _of_part(self, part: str, changes: list[dict[str, Any]]) -> list[Setting]:
        """Return the settings of one part, the simplest first."""
        own = part_table(getattr(self.scene, part))
        admitted = list[Setting]()
        for change in changes:
            label = " ".join(map(str, change.values()))
            try:
                values = {part: changed_part(self.scene, part, change)}
                scene = self._with(self.scene, values)
                scene.points()[0].process  # noqa: B018 - refused only when it is made
            except ValueError as fault:
                self.left_out.append(f"{label}: " + str(fault).partition("\n")[0])
                continue
            is_own = own.items() >= change.items()
            about = Cost(0.0, 0.0), is_own, _random(scene)
            row = Setting(part, label, change, values, np.zeros((2, 0)), *about)
            admitted.append(row)
        if not admitted:
            return []
        is_by_law = part == "shear" and self.is_of_moment
        errors = np.zeros((len(admitted), 2, len(self.names)))
        fits = [True] * len(admitted)
        if not is_by_law or self.is_path.any():
            # the finest first, with which the others are compared
            samples = [self._sampled(row) for row in admitted[::-1]][::-1]
            fits = [sample is not None for sample in samples]
            best = max((k for k, fit in enumerate(fits) if fit), default=-1)
            needed = next(k for k, row in enumerate(admitted) if row.is_own)
            if best < min(needed + 1, len(admitted) - 1):
                raise self._too_long(self._with(self.scene, admitted[-1].values))
            self.lacks_finest = self.lacks_finest or best < len(admitted) - 1
            for k, sample in enumerate(samples):
                if sample is not None and (reference := samples[best]) is not None:
                    errors[k] = difference(sample, reference, self.written.unit)
        if is_by_law:
            laws = [self._laws(row) for row in admitted]
            for k, law in enumerate(laws):
                of_law = self._by_law(law, laws[-1])
                errors[k] = np.where(self.is_path, errors[k], of_law)
        left_out = [row for row, fit in zip(admitted, fits, strict=True) if not fit]
        for row in left_out:
            is_unresolved = self.pilots.is_unresolved(self._scene_of(row))
            reason = _UNRESOLVED if is_unresolved else _TOO_LONG
            self.left_out.append(f"{row.label}: {reason}")
        return [
            row._replace(error=error, cost=self.pilots.cost(self._scene_of(row)))
            for row, error, fit in zip(admitted, errors, fits, strict=True)
            if fit
        ]

    def _scene_of(self, row: Setting) -> Scenario:
        """Return the scene at a setting."""
        return self._with(self.scene, row.values)

    def _sampled(self, row: Setting) -> Sample | None:
        """Return the pilot of a setting."""
        return self.pilots[self._scene_of(row)]

    @cached_property
    def is_path(self) -> Array:
        """True for each name that depends on the course of a member, not on ΔΓ at one moment alone."""
        events = [not has_mean(name.partition(":")[0]) for name in self.names]
        return np.array(events) | (not self.is_of_moment)

    @cached_property
    def is_of_moment(self) -> bool:
        """True if ΔΓ has a known law or no noise, and the motion is prescribed.

        Shear models then differ by the law of ΔΓ alone. The contact has no memory, so that random parts have no error
        in time that their means have not.
        """
        return all(
            (point.knows_energy or not point.fluctuations.is_random)
            and not (
                point.drive.solves_motion or point.contact.lags or point.feels_steps
            )
            # bonds that members differ in though nothing of them is random follow the area of the past
            and not (point.population.feeds_back and not point.population.is_random)
            for point in self.scene.points()
        )

    @cached_property
    def _smooth(self) -> dict[str, Any]:
        """Return the finest models without noise of parts that are random, with which clock steps are compared."""
        result = dict[str, Any]()
        if not self.is_of_moment:
            return result
        for part, changes in alternatives(self.scene):
            if part in _random(self.scene) and changes["model"] in _NOISELESS:
                result[part] = changed_part(self.scene, part, changes)
        return result

    def _laws(self, row: Setting) -> list[Array]:
        """Return the moments of ΔΓ of a shear model at the points of the sweep that are compared."""
        return [
            _moments(point) for point in spread(self._scene_of(row).points(), POINTS)
        ]

    def _by_law(self, law: list[Array], finest: list[Array]) -> Array:
        """Return the error of a shear model by its law of ΔΓ, without runs of its own, shape (2, names).

        A cubic in ΔΓ/⟨ΔΓ⟩ − 1 is fitted to the values of the pilot's members at each time. Its mean differs between
        two models by the differences of their first three moments, which are known in closed form. The influence on a
        spread is that on its square, so that the spread follows for any difference.
        """
        off = [self._response(k, law[k] - finest[k]) for k in range(len(law))]
        change = np.concatenate(off, axis=1)
        is_spread = np.array([name.endswith(":spread") for name in self.names])
        size = np.where(is_spread[:, np.newaxis], self.written.mean, 0.0)
        left = np.sqrt(np.maximum(size**2 - 2.0 * size * change, 0.0))
        change = np.where(is_spread[:, np.newaxis], size - left, change)
        bound = in_units(change, self.written.unit).max(axis=1)
        return np.array([bound, np.zeros(len(bound))])

    def _response(self, point: int, moments: Array) -> Array:
        """Return bounds of the change of the means by changes of the first three moments at a point of the sweep.

        They have the shape (quantities, numbers of the point).
        """
        size = self.written.mean.shape[1] // self.points
        at = slice(point * size, (point + 1) * size)
        energy, members = self.written.energy[:, at], self.written.members[:, :, at]
        changes = np.zeros(members.shape[::2])
        for k in np.flatnonzero(np.ptp(energy, axis=0) > 0.0).tolist():
            powers = energy[:, k, np.newaxis] ** np.arange(4.0)
            inverse = np.linalg.pinv(powers)
            weights = moments @ inverse[1:]
            residual = members[:, :, k] - members[:, :, k] @ (powers @ inverse).T
            spread_of = np.sqrt(np.sum(residual**2, axis=1) / (self.pilot - 4.0))
            noise = students(self.pilot - 3) * spread_of * np.linalg.norm(weights)
            changes[:, k] = np.abs(members[:, :, k] @ weights) + noise
        return changes

    def _too_long(self, scene: Scenario) -> NotReached:
        needed = engineering(2.0 * (self.spent + 3.0 * self.pilots.needed(scene)), "s")
        return NotReached(
            "the finest models do not fit into the budget, so that no error is known; "
            f'give --budget "{needed}"'
        )

    def _pair(self, values: dict[str, Any]) -> tuple[Sample, Sample] | None:
        """Return the pilots of the scene with some values without noise, where that tells more, and with noise."""
        smooth = self.pilots[self._with(self.scene, values | self._smooth)]
        noisy = smooth
        if self.is_path.any():
            noisy = self.pilots[self._with(self.scene, values)]
        return None if smooth is None or noisy is None else (smooth, noisy)

    def _apart(
        self, pair: tuple[Sample, Sample], reference: tuple[Sample, Sample]
    ) -> Array:
        """Return the differences of two pairs, shape (2, names)."""
        smooth, noisy = (
            difference(one, other, self.written.unit)
            for one, other in zip(pair, reference, strict=True)
        )
        return np.where(self.is_path, noisy, smooth)

    def _of_steps(self) -> list[Setting]:
        """Return clock steps with their systematic errors, the longest first.

        Steps are quartered until the last change is a tenth of the accepted error or not larger than its noise, or
        until the next quarter does not fit into the budget. The rest of a series that falls by ``_FALL`` from quarter
        to quarter is its last change.
        """
        rows = list[tuple[float, dict[str, Any], tuple[Sample, Sample]]]()
        scene, small = self.scene, _SMALL * self.goal.within
        changes = list[Array]()
        for ratio in _RATIOS:
            with contextlib.suppress(ValueError):
                values = {"clock": step_values(self.scene, ratio)}
                scene = self._with(self.scene, values)
                if (pair := self._pair(values)) is None:
                    if rows:
                        break
                    continue
                rows.append((ratio, values, pair))
            if len(rows) > 1 and ratio < 1.0:
                changes.append(self._apart(rows[-2][2], rows[-1][2]))
                bound, noise = changes[-1]
                if np.all((bound <= small) | (bound <= 2.0 * noise)):
                    break
        if len(rows) < 2 or rows[-1][0] >= 1.0:
            raise self._too_long(scene)
        self.trend = self._trend(changes)
        finest, rest = rows[-1][2], changes[-1] / (_FALL - 1.0)
        own = _random(self.scene)
        result = list[Setting]()
        for ratio, values, pair in rows:
            clock = values["clock"]
            lines = {key: f"{clock[key]:.12g} s" for key in ("step", "record")}
            label = engineering(clock["step"], "s")
            cost = self.pilots.cost(self._with(self.scene, values))
            error = self._apart(pair, finest) + rest
            about = error, cost, ratio == 1.0, own, ratio
            result.append(Setting("clock", label, lines, values, *about))
        return result

    def _trend(self, changes: list[Array]) -> str:
        """Return in words the largest last change that exceeds its noise and does not fall; "" without one.

        A last change of a tenth of the accepted error is small enough, even if it does not fall.
        """
        bound, noise = changes[-1]
        size, is_small = bound - noise, bound <= _SMALL * self.goal.within
        grown = np.where((size > noise) & ~is_small, size, 0.0)
        words = "and no further quarter was tried"
        if len(changes) > 1:
            before = changes[-2][0] - changes[-2][1]
            falls = before - size > np.maximum(noise, changes[-2][1])
            grown = np.where(falls, 0.0, grown)
        if not grown.any():
            return ""
        worst = int(grown.argmax())
        last = f"{100.0 * size[worst]:.2g} %"
        if len(changes) > 1:
            words = f"after {100.0 * before[worst]:.2g} % by the quarter before"
        return f"{in_words(self.names[worst])} changes by {last}, {words}"

    def choices(self) -> list[Choice]:
        """Return all combinations of one setting a part, the cheapest first. Errors add up, and so does the work.

        Of equal work, that with the fewest changes of the scene comes first. Each has the fewest members that keep the
        accepted error, or else those of the scene.
        """
        result = [self._combined(rows) for rows in itertools.product(*self.groups)]
        return sorted(result, key=lambda row: (row.work, len(row.labels), row.total))

    def _combined(self, rows: tuple[Setting, ...]) -> Choice:
        """Return a combination of settings, with the members that it needs."""
        systematic = np.sum([row.error[0] for row in rows], axis=0)
        members, noise = self.scene.ensemble.members, np.zeros(systematic.shape)
        if _is_random(rows):
            members = self.members(self.goal.within - systematic) or members
            noise = self.noise(max(members, 2))
        return Choice(rows, members, self.work(rows, members), systematic, noise)

    def work(self, rows: tuple[Setting, ...], members: int) -> float:
        """Return the counted work of a run [s], to three digits. That of several changes adds up."""
        own = np.array(self.pilots.cost(self.scene))
        costs = sum((np.array(row.cost) - own for row in rows), own)
        batch, each, substeps = np.maximum(costs, [1e-12, 1e-12, 0.0])
        members = members if _is_random(rows) else 1
        points = self.scene.points()
        batches = -(-members // together(points[0]))
        steps = self.scene.clock.steps / rows[-1].ratio
        one = steps * (batches * batch + members * each) + members * substeps
        return float(f"{len(points) * one:.3g}")

    def scene_of(self, choice: Choice) -> Scenario:
        """Return the plain scenario of a choice."""
        values = choice.values
        if choice.members != self.scene.ensemble.members:
            values = values | {"ensemble.members": choice.members}
        return self._with(self.scene, values)

    @property
    def points(self) -> int:
        """Return the number of points of the sweep at which settings are compared."""
        return min(POINTS, len(self.scene.points()))

    @cached_property
    def as_written(self) -> Choice:
        """The settings of the scene with its members."""
        row = next(row for row in self.choices() if not row.labels)
        if not row.noise.any():
            return row
        members = self.scene.ensemble.members
        return row._replace(
            members=members,
            work=self.work(row.rows, members),
            noise=self.noise(max(members, 2)),
        )

    @cached_property
    def finest(self) -> Choice:
        """The combination of the least error, with which others are compared."""
        return min(self.choices(), key=lambda row: (row.systematic.max(), row.work))

    def best(self) -> Choice:
        """Return the cheapest choice that is measured to be within the goal.

        Raises
        ------
        NotReached
            If none is within the goal, with what is, or if the result does not converge as the clock step decreases.
        """
        rows = self.choices()
        if self.trend:
            raise NotReached(
                f"convergence is not shown: with the last quarter of the clock step {self.trend}; "
                "a larger --budget may try a finer step"
            )
        fits = [row for row in rows if self.spent + row.work <= self.goal.budget]
        for row in fits:
            if row.total <= self.goal.within:
                result = self._measured(row)
                if result.total <= self.goal.within:
                    return result
        closest = min(fits or rows, key=lambda row: (row.total, row.work))
        settings = ", ".join((*closest.labels, f"{closest.members:,} members"))
        raise NotReached(
            f"{accepted(self.goal.within)} is not reached within a budget of "
            f"{engineering(self.goal.budget, 's')}; the least bound that was found is "
            f"{percent(closest.total)}, with {settings}; a larger --budget may find less"
        )

    def _measured(self, row: Choice) -> Choice:
        """Return a choice with the error of the combination, measured against that of the finest settings.

        Its members are those that this error needs. Errors by the law of ΔΓ are added. If the pilots do not fit into
        the budget, the sum of the single errors stands.
        """
        pair, reference = self._pair(row.values), self._pair(self.finest.values)
        if pair is None or reference is None:
            return row
        systematic = self._apart(pair, reference)[0] + self.finest.systematic
        for setting in row.rows:
            if setting.part in self._smooth:
                systematic += np.where(self.is_path, 0.0, setting.error[0])
        members, noise = row.members, row.noise
        if noise.any():
            members = self.members(self.goal.within - systematic) or members
            noise = self.noise(max(members, 2))
        work = self.work(row.rows, members)
        return row._replace(
            members=members, work=work, systematic=systematic, noise=noise
        )


class Comparison(Search):
    """The search for the cheapest models and clock step, with the members of the scene, whose noise is not weighed."""

    def noise(self, members: int) -> Array:
        return np.zeros(len(self.names))

    def members(self, left: Array) -> int:
        return self.scene.ensemble.members


def _without_auto(scenario: Scenario) -> dict[str, Any]:
    """Return the tables of shear and bonds with each "auto" replaced by the model it stands for."""
    swept = {key for axis in scenario.sweep for key in axis.keys}
    parts = {"shear": scenario.fluctuations, "bonds": scenario.population}
    return {
        name: part_table(part)
        for name, part in parts.items()
        if getattr(scenario, name).model == "auto"
        and not any(key.partition(".")[0] == name for key in swept)
    }


def _is_random(rows: tuple[Setting, ...]) -> bool:
    """Return True if members differ in a combination of settings."""
    parts = {row.part for row in rows[:-1]}
    return bool(rows[-1].random - parts) or any(
        row.part in row.random for row in rows[:-1]
    )


def _random(scenario: Scenario) -> frozenset[str]:
    """Return those of shear and bonds in which members differ at some point of the sweep."""
    points = scenario.points()
    flags = {
        "shear": any(point.fluctuations.is_random for point in points),
        "bonds": any(point.population.is_random for point in points),
    }
    return frozenset(part for part, is_random in flags.items() if is_random)


def _moments(point: Scenario) -> Array:
    """Return the first three moments of ΔΓ/⟨ΔΓ⟩ − 1 over the realisations, shape (3,)."""
    if not point.knows_energy:
        return np.zeros(3)
    terms = point.process.gammas
    first, second, third = (
        np.sum(terms.shape * terms.weight**power) for power in (1.0, 2.0, 3.0)
    )
    point.release()
    if not first > 0.0:
        return np.zeros(3)
    return np.array([0.0, second / first**2, 2.0 * third / first**3])


def _named(row: Setting) -> str:
    """Return a setting in words."""
    return f"{'clock step' if row.part == 'clock' else row.part} {row.label}"


def in_words(name: str) -> str:
    """Return a name that is compared in words: ``contact_area:spread`` is the spread of the contact area."""
    quantity, _, statistic = name.partition(":")
    return f"{statistic} of " * bool(statistic) + quantity.replace("_", " ")


def accepted(error: float) -> str:
    """Return an accepted error as it was given."""
    return f"{100.0 * error:.6g} %"


def percent(bound: float) -> str:
    """Return a bound with three digits, rounded up, and one that is as large as the quantity without digits."""
    percent = 100.0 * bound
    if not 0.0 < percent < 99.0:
        return f"{percent:,.0f} %"
    unit = 10.0 ** (math.floor(math.log10(percent)) - 2)
    # a bound that has three digits but for a rounding stays
    return f"{math.ceil(percent / unit - 1e-9) * unit:.3g} %"


class Answer(NamedTuple):
    """The plain scenario that reaches a goal, the sentence on it, and the attributes of its dataset."""

    scenario: Scenario
    sentence: str
    attributes: dict[str, str]


def answer(scenario: Scenario, goal: Goal) -> Answer:
    """Return the cheapest run of a scene within a goal.

    The choice rests on counted work and on random numbers of the scenario's seed, so it is the same on each machine
    and at each call.

    Raises
    ------
    NotReached
        If the goal is not reached within its budget.
    BadInput
        If a quantity has no mean over time, or the field is a measured map.
    """
    result = searched(scenario, goal)
    search, best, as_written = result.search, result.best, result.search.as_written
    if best is None or search.lacks_finest:
        left_out = "; ".join(search.left_out)
        raise NotReached(result.reason or f"not compared with {left_out}")
    scene = search.scene_of(best)
    parts = [
        f"{in_words(name)} {percent(float(bound + noise))}"
        for name, bound, noise in zip(
            search.names, best.systematic, best.noise, strict=True
        )
    ]
    settings = [*best.labels] or ["settings as written"]
    if best.noise.any():
        settings.append(f"{best.members:,} members")
    count = len(scene.points())
    if search.points < count:
        settings.append(f"judged at {search.points} of {count} points of the sweep")
    sentence = (
        f"within {accepted(goal.within)}: errors of at most {', '.join(parts)}; "
        f"{', '.join(settings)}, {engineering(best.work, 's')} of counted work "
        f"(as written: {engineering(as_written.work, 's')}, within {percent(as_written.total)})"
    )
    budget = {
        name: {"systematic": float(bound), "noise": float(noise)}
        for name, bound, noise in zip(
            search.names, best.systematic, best.noise, strict=True
        )
    }
    document = json.loads(scenario_json(scene))
    attributes = {
        "accuracy": json.dumps({"within": goal.within, "errors": budget}),
        "accuracy_sentence": sentence,
        "accuracy_scenario": written(_known(document)),
    }
    return Answer(scene, sentence, attributes)


class Result(NamedTuple):
    """A search with its best choice; None, with the reason, if the goal is not reached."""

    search: Search
    best: Choice | None
    reason: str = ""

    @property
    def work(self) -> float:
        """The counted work of the best choice [s], inf without one."""
        return math.inf if self.best is None else self.best.work


def searched(scenario: Scenario, goal: Goal, kind: type[Search] = Search) -> Result:
    """Return the search of a kind by the smallest pilot that reaches a goal, or a larger one if that pays.

    Raises
    ------
    NotReached
        If no pilot shows an error within the budget.
    """
    spent = 0.0
    results = list[Result]()
    for pilot in _PILOTS:
        before = spent
        try:
            search = kind(scenario, goal, pilot, spent)
            search.groups  # noqa: B018 - raises if no error is known
        except NotReached:
            if not results:
                raise
            break
        if results and search.lacks_finest > results[0].search.lacks_finest:
            break
        try:
            results.append(Result(search, search.best()))
        except NotReached as fault:
            results.append(Result(search, None, str(fault)))
        spent = search.spent
        is_cheap = results[-1].work < _WORTH_MORE * (spent - before)
        if is_cheap or not search.of_one.any():  # noise of pilots decides nothing more
            break
    # of results that cost the same the first, but the last of those that are none
    reached = [row for row in results if row.best]
    return min(reached, key=lambda row: row.work, default=results[-1])


def _known(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document without keys that have no value, which TOML cannot write."""
    return {
        key: _known(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if value is not None
    }
