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
from typing import Any, NamedTuple, cast

import numpy as np
from scipy import special

from sim.ensemble.dataset import scenario_json
from sim.ensemble.pace import counted
from sim.ensemble.plan import Plan, seconds_a_step, together
from sim.ensemble.simulate import run
from sim.ensemble.swept import spread
from sim.quantities import QUANTITIES, Form, has_mean
from sim.read.control_variate import control_variate
from sim.read.correlation import Array
from sim.read.dataset import MEMBERS, plain
from sim.read.observables import closed_observables
from sim.read.statistics import over_members
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
from sim.units.errors import BadInput
from sim.units.notation import engineering

#: Quantities that are compared if none are named, as far as they are recorded.
USUAL = ("contact_area", "contact_radius", "friction_force", "bond_fraction")
#: Members of the pilots, and fewest and most members of a run.
_PILOTS, _FEWEST, _MOST = (32, 128, 512, 2048), 8, 10**6
#: Clock steps over that of the scene, and the factor by which the change from one to the next falls at least: 4^p with
#: the lowest order p = 1/2.
_RATIOS, _FALL = tuple(4.0**power for power in range(2, -5, -1)), 2.0
#: Change of the last clock step over the accepted error that is small enough, and points of a sweep that are tried.
_SMALL, _POINTS = 0.1, 16
#: Models without noise, of which the last that a scene admits stands for a random one.
_NOISELESS = ("mean", "rate", "cohort")
#: Work of a run over that of its pilots beyond which larger pilots may find a cheaper run.
_WORTH_MORE = 4.0
#: Chance that the noise of a pilot is larger than estimated.
_UNSURE = 0.2
#: Errors below this are roundings.
_ROUNDING = 1e-12


class NotReached(RuntimeError):
    """An accuracy that is not reached within the budget."""

    exit_code = 1


@dataclass(frozen=True)
class Goal:
    """Accepted error of some quantities, and the counted work [s] that may be spent to reach it.

    ``of`` without names stands for the ``USUAL`` ones that the scene records.
    """

    within: float
    of: tuple[str, ...] = ()
    budget: float = 60.0


class Sample(NamedTuple):
    """Means over the members of a pilot, at all points and times that are compared.

    Attributes
    ----------
    mean, sem : array, shape (quantities, numbers)
        Means and standard errors, at the known mean of ΔΓ where that is used; the errors are 0 without noise.
    members : array, shape (quantities, members, numbers)
        Values of each member.
    energy : array, shape (members, numbers)
        ΔΓ/⟨ΔΓ⟩ − 1 of each member, 0 where the mean of ΔΓ is not known.
    """

    mean: Array
    sem: Array
    members: Array
    energy: Array


class Setting(NamedTuple):
    """One setting of a part, with its error and its counted work.

    Attributes
    ----------
    label : str
        Name, "" for that of the scene.
    values : dict
        Keys of the scenario that choose it.
    error : array, shape (quantities,)
        Bound of its systematic error [1].
    batch, each : float
        Counted work of a step of a batch, and of each member in it [s].
    random : set of str
        Parts in which members differ, of shear and bonds.
    ratio : float
        Clock step over that of the scene.
    """

    label: str
    values: dict[str, Any]
    error: Array
    batch: float
    each: float
    random: frozenset[str] = frozenset()
    ratio: float = 1.0


class Choice(NamedTuple):
    """A combination of settings with its members, its counted work [s] and its error.

    Attributes
    ----------
    labels : tuple of str
        Names of the settings that differ from the scene's.
    values : dict
        Keys of the scenario that choose them, and the members.
    members : int
        Members of the run.
    work : float
        Counted work of the run [s].
    systematic, noise : array, shape (quantities,)
        Bounds of the systematic part and of the noise [1].
    """

    labels: tuple[str, ...]
    values: dict[str, Any]
    members: int
    work: float
    systematic: Array
    noise: Array

    @property
    def total(self) -> float:
        """The largest error of a quantity [1]."""
        return float(np.max(self.systematic + self.noise))


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
        self.goal, self.spent, self.pilot = goal, spent, pilot
        self.sweep = {"sweep": written_sweep(scenario.sweep)} if scenario.sweep else {}
        self.scene = self._with(scenario, _without_auto(scenario) | {"accuracy": None})
        self.names = [*goal.of]
        self._samples = dict[str, Sample]()
        sample = self._sample(self.scene)
        if sample is None:
            needed = engineering(10.0 * self._needed(self.scene), "s")
            raise NotReached(f'a pilot exceeds the budget; give --budget "{needed}"')
        self.written = sample
        by_point = np.abs(sample.mean).reshape(len(self.names), self.points, -1)
        unit = np.broadcast_to(by_point.max(axis=2, keepdims=True), by_point.shape)
        is_share = [QUANTITIES[name].form is Form.SHARE for name in self.names]
        #: Largest mean at each point of the sweep, at all its numbers; 1 for shares.
        self.unit = np.where(
            np.array(is_share)[:, np.newaxis], 1.0, unit.reshape(sample.mean.shape)
        )
        free = self.pilot - 1.0
        unsure = math.sqrt(free / float(special.chdtri(free, 1.0 - _UNSURE)))
        #: Standard error of a single member, as large as the pilot allows [1].
        self.of_one = (
            self._in_units(sample.sem).max(axis=1) * math.sqrt(self.pilot) * unsure
        )

    def _with(self, scenario: Scenario, values: dict[str, Any]) -> Scenario:
        """Return a scenario with some keys changed, with its sweep."""
        return scenario.with_values(self.sweep | values, built=False)

    def _pilots(self, scenario: Scenario) -> list[Scenario]:
        """Return the pilots of a scene: some points of its sweep, with few members that are all recorded."""
        changes = {
            "ensemble.members": self.pilot,
            "record.per_member": True,
            "record.maps": (),
            "record.quantities": None,
        }
        points = spread(scenario.points(), _POINTS)
        return [point.with_values(changes, built=False) for point in points]

    def _needed(self, scenario: Scenario) -> float:
        """Return the counted work of the pilot of a scene [s]."""
        return sum(counted(Plan.of(pilot)) for pilot in self._pilots(scenario))

    def _sample(self, scenario: Scenario) -> Sample | None:
        """Return the pilot of a scene, run once; None if its work does not fit into the budget."""
        pilots = self._pilots(scenario)
        key = "".join(map(scenario_json, pilots))
        if key not in self._samples:
            work = sum(counted(Plan.of(pilot)) for pilot in pilots)
            if self.spent + work > self.goal.budget:
                return None
            self.spent += work
            samples = map(self._sample_at, pilots)
            self._samples[key] = Sample(
                *(np.concatenate(arrays, -1) for arrays in zip(*samples, strict=True))
            )
        return self._samples[key]

    def _sample_at(self, pilot: Scenario) -> Sample:
        """Return the sample of a pilot without a sweep."""
        dataset = plain(run(pilot))
        pilot.release()
        known = closed_observables(dataset, None)
        possible = [str(name) for name in known if has_mean(str(name))]
        self.names = self.names or [name for name in USUAL if name in possible]
        if unknown := {*self.names} - {*possible}:
            names = ", ".join(sorted(possible))
            raise BadInput(
                [f"accuracy.of: {min(unknown)} has no mean over time; known: {names}"]
            )
        estimates = over_members(dataset, self.names, quantiles=False)
        late = slice(dataset.sizes["t"] // 2 * pilot.drive.solves_motion, None)
        rows = list[tuple[Array, Array, Array]]()
        for name in self.names:
            one, values = estimates[name], known[name].astype(float)
            if MEMBERS not in values.dims:
                values = values.expand_dims({MEMBERS: self.pilot})
            each = np.nan_to_num(values.transpose(MEMBERS, "t").to_numpy())
            mean, sem = (
                np.nan_to_num(np.zeros(each.shape[1]) if part is None else part)
                for part in (one.value, one.sem)
            )
            if pilot.drive.solves_motion:
                each = each[:, late].mean(axis=1, keepdims=True)
                mean = each.mean(axis=0)
                sem = each.std(axis=0, ddof=1) / math.sqrt(self.pilot)
            rows.append((mean, sem, each))
        control, energy = control_variate(dataset), np.zeros(rows[0][2].shape)
        if control is not None and not pilot.drive.solves_motion:
            energy = control.deviation.transpose(MEMBERS, "t").to_numpy()
        mean, sem, each = map(np.array, zip(*rows, strict=True))
        return Sample(mean, sem, each, np.nan_to_num(energy))

    def difference(self, sample: Sample, reference: Sample) -> Array:
        """Return bounds of the differences of two samples, shape (quantities,), in units of the largest mean.

        Members have the same noise as far as the settings leave it, so that the differences of members may have the
        smaller error; else it is that of the two means.
        """
        paired = sample.members - reference.members
        of_pairs = paired.std(axis=1, ddof=1) / math.sqrt(self.pilot)
        apart = np.hypot(sample.sem, reference.sem)
        off = np.where(
            of_pairs < apart, paired.mean(axis=1), sample.mean - reference.mean
        )
        bound = np.abs(off) + students(self.pilot) * np.minimum(of_pairs, apart)
        return self._in_units(bound).max(axis=1)

    def _in_units(self, values: Array) -> Array:
        """Return values over the largest mean of the run at their point of the sweep; 0 for roundings."""
        result = np.divide(
            values, self.unit, out=np.zeros(values.shape), where=self.unit > 0.0
        )
        return np.where(result > _ROUNDING, result, 0.0)

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

    def settings(self) -> list[list[Setting]]:
        """Return the admissible settings of each part, with their systematic errors.

        Settings whose pilot does not fit into the budget are left out.

        Raises
        ------
        NotReached
            If the finest setting of a part, or a second clock step, does not fit into the budget.
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
        admitted = list[tuple[str, dict[str, Any], Scenario]]()
        for change in changes:
            with contextlib.suppress(ValueError):
                values = {part: changed_part(self.scene, part, change)}
                label = "" if own.items() >= change.items() else _words(part, change)
                scene = self._with(self.scene, values)
                scene.points()[0].process  # noqa: B018 - refused only when it is made
                admitted.append((label, values, scene))
        if admitted and part == "shear" and self.is_of_moment:
            return self._by_response(admitted)
        reference = self._sample(admitted[-1][2]) if admitted else None
        if reference is None and admitted:
            raise self._too_long(admitted[-1][2])
        result = list[Setting]()
        for label, values, scene in admitted:
            sample = self._sample(scene)
            if sample is not None and reference is not None:
                error = self.difference(sample, reference)
                result.append(
                    Setting(label, values, error, *_counted_step(scene), _random(scene))
                )
        return result

    @property
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
            for point in self.scene.points()
        )

    @property
    def _smooth(self) -> dict[str, Any]:
        """Return the finest models without noise of parts that are random, with which clock steps are compared."""
        result = dict[str, Any]()
        if not self.is_of_moment:
            return result
        for part, changes in alternatives(self.scene):
            if part in _random(self.scene) and changes["model"] in _NOISELESS:
                result[part] = changed_part(self.scene, part, changes)
        return result

    def _by_response(
        self, admitted: list[tuple[str, dict[str, Any], Scenario]]
    ) -> list[Setting]:
        """Return the settings of the shear model with errors by their laws of ΔΓ, without runs of their own.

        A cubic in ΔΓ/⟨ΔΓ⟩ − 1 is fitted to the values of the pilot's members at each time. Its mean differs between
        two models by the differences of their first three moments, which are known in closed form.
        """
        result = list[Setting]()
        laws = [
            [_moments(point) for point in spread(scene.points(), _POINTS)]
            for *_, scene in admitted
        ]
        for (label, values, scene), law in zip(admitted, laws, strict=True):
            off = [self._response(k, law[k] - laws[-1][k]) for k in range(len(law))]
            error = self._in_units(np.concatenate(off, axis=1)).max(axis=1)
            result.append(
                Setting(label, values, error, *_counted_step(scene), _random(scene))
            )
        return result

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
        needed = engineering(2.0 * (self.spent + 3.0 * self._needed(scene)), "s")
        return NotReached(
            "the finest models do not fit into the budget, so that no error is known; "
            f'give --budget "{needed}"'
        )

    def _of_steps(self) -> list[Setting]:
        """Return clock steps with their systematic errors, the longest first.

        Steps are quartered until the last change is a tenth of the accepted error, or until the next quarter does not
        fit into the budget. The rest of a series that falls by ``_FALL`` from quarter to quarter is its last change.
        """
        rows = list[tuple[float, dict[str, Any], Sample]]()
        scene, smooth = self.scene, self._smooth  # noise hides the errors of steps
        for ratio in _RATIOS:
            with contextlib.suppress(ValueError):
                values = {"clock": step_values(self.scene, ratio)}
                scene = self._with(self.scene, values | smooth)
                if (sample := self._sample(scene)) is None:
                    break
                rows.append((ratio, values, sample))
            if len(rows) > 1 and ratio < 1.0:
                last = self.difference(rows[-2][2], rows[-1][2])
                if last.max() <= _SMALL * self.goal.within:
                    break
        if len(rows) < 2 or rows[-1][0] >= 1.0:
            raise self._too_long(scene)
        finest = rows[-1][2]
        rest = self.difference(rows[-2][2], finest) / (_FALL - 1.0)
        cost, own = _counted_step(self.scene), _random(self.scene)
        result = list[Setting]()
        for ratio, values, sample in rows:
            step = engineering(values["clock"]["step"], "s")
            label = "" if ratio == 1.0 else f"clock step {step}"
            error = self.difference(sample, finest) + rest
            result.append(Setting(label, values, error, *cost, own, ratio))
        return result

    def choices(self) -> list[Choice]:
        """Return all combinations of one setting a part, the cheapest first. Errors add up, and so does the work.

        Of equal work, that with the fewest changes of the scene comes first. Each has the fewest members that keep the
        accepted error, or else those of the scene.
        """
        result = [self._combined(rows) for rows in itertools.product(*self.settings())]
        return sorted(result, key=lambda row: (row.work, len(row.labels), row.total))

    def _combined(self, rows: tuple[Setting, ...]) -> Choice:
        """Return a combination of settings."""
        batch, each = _counted_step(self.scene)
        own = np.array([batch, each])
        costs = [np.array([row.batch, row.each]) for row in rows]
        batch, each = np.maximum(own + sum(cost - own for cost in costs), 1e-12)
        systematic = np.sum([row.error for row in rows], axis=0)
        values = dict[str, Any]()
        for row in rows:
            values |= row.values if row.label else {}
        parts = {part for row in rows[:-1] for part in row.values}
        is_random = bool(rows[-1].random - parts) or any(
            row.random & {*row.values} for row in rows[:-1]
        )
        members, noise = self.scene.ensemble.members, np.zeros(systematic.shape)
        if is_random:
            members = self.members(self.goal.within - systematic) or members
            noise = self.noise(max(members, 2))
        advanced = members if is_random else 1
        cost = float(batch), float(each)
        return Choice(
            tuple(row.label for row in rows if row.label),
            values,
            members,
            self._work(cost, rows[-1].ratio, advanced),
            systematic,
            noise,
        )

    def _work(self, cost: tuple[float, float], ratio: float, members: int) -> float:
        """Return the counted work of a run by that of a step of a batch and of a member [s], to three digits."""
        points = self.scene.points()
        batches = -(-members // together(points[0]))
        steps = len(points) * self.scene.clock.steps / ratio
        return float(f"{steps * (batches * cost[0] + members * cost[1]):.3g}")

    def scene_of(self, choice: Choice) -> Scenario:
        """Return the plain scenario of a choice."""
        values = choice.values
        if choice.members != self.scene.ensemble.members:
            values = values | {"ensemble.members": choice.members}
        return self._with(self.scene, values)

    @property
    def points(self) -> int:
        """Return the number of points of the sweep at which settings are compared."""
        return min(_POINTS, len(self.scene.points()))

    def best(self) -> tuple[Choice, Choice]:
        """Return the cheapest choice that is measured to be within the goal, and the scene as it is written.

        Raises
        ------
        NotReached
            If none is within the goal; the message tells what is.
        """
        rows = self.choices()
        written = next(row for row in rows if not row.labels)
        members = self.scene.ensemble.members
        if written.noise.any():
            written = written._replace(
                members=members,
                work=self._work(_counted_step(self.scene), 1.0, members),
                noise=self.noise(max(members, 2)),
            )
        finest = min(rows, key=lambda row: (row.systematic.max(), row.work))
        for row in rows:
            if (
                row.total <= self.goal.within
                and self.spent + row.work <= self.goal.budget
            ):
                measured = self._measured(row, finest)
                if measured.total <= self.goal.within:
                    return measured, written
        fits = [row for row in rows if self.spent + row.work <= self.goal.budget]
        closest = min(fits or rows, key=lambda row: (row.total, row.work))
        settings = ", ".join((*closest.labels, f"{closest.members:,} members"))
        raise NotReached(
            f"{_accepted(self.goal.within)} is not reached within a budget of "
            f"{engineering(self.goal.budget, 's')}; the least bound that was found is "
            f"{_percent(closest.total)}, with {settings}; a larger --budget may find less"
        )

    def _measured(self, row: Choice, finest: Choice) -> Choice:
        """Return a choice with the error of the combination, measured against that of the finest settings.

        Its members are those that this error needs. If the pilots do not fit into the budget, the sum of the single
        errors stands.
        """
        if self.is_of_moment:  # where the sum of the errors has no noise to speak of
            return row
        sample = self._sample(self._with(self.scene, row.values))
        reference = self._sample(self._with(self.scene, finest.values))
        if sample is None or reference is None:
            return row
        systematic = self.difference(sample, reference) + finest.systematic
        members, noise = row.members, row.noise
        if noise.any():
            members = self.members(self.goal.within - systematic) or members
            noise = self.noise(max(members, 2))
        work = row.work * members / row.members
        return row._replace(
            members=members,
            work=float(f"{work:.3g}"),
            systematic=systematic,
            noise=noise,
        )


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


def _counted_step(scenario: Scenario) -> tuple[float, float]:
    """Return the counted work of a step of a batch, and of each of its members [s], as means over the sweep."""
    points = spread(scenario.points(), _POINTS)
    batch = float(np.mean([seconds_a_step(point, 0) for point in points]))
    return batch, float(np.mean([seconds_a_step(point, 1) for point in points])) - batch


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


def _words(part: str, changes: dict[str, Any]) -> str:
    return f"{part} " + " ".join(map(str, changes.values()))


def _accepted(error: float) -> str:
    """Return an accepted error as it was given."""
    return f"{100.0 * error:.6g} %"


def _percent(bound: float) -> str:
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
    search, best, written_choice = _searched(scenario, goal)
    scene = search.scene_of(best)
    parts = [
        f"{name.replace('_', ' ')} {_percent(float(bound + noise))}"
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
    as_written = _percent(written_choice.total)
    sentence = (
        f"within {_accepted(goal.within)}: errors of at most {', '.join(parts)}; "
        f"{', '.join(settings)}, {engineering(best.work, 's')} of counted work "
        f"(as written: {engineering(written_choice.work, 's')}, within {as_written})"
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


def _searched(scenario: Scenario, goal: Goal) -> tuple[Search, Choice, Choice]:
    """Return the search with its best choice, and the scene as written, by the smallest pilot that shows it.

    Raises
    ------
    NotReached
        If no pilot within the budget shows it.
    """
    spent, fault = 0.0, None
    result: tuple[Search, Choice, Choice] | None = None
    for pilot in _PILOTS:
        before = spent
        try:
            search = Search(scenario, goal, pilot, spent)
        except NotReached as too_long:
            fault = fault or too_long
            break
        try:
            best, as_written = search.best()
            if result is None or best.work < result[1].work:
                result = search, best, as_written
        except NotReached as reason:
            fault = reason
        spent = search.spent
        is_cheap = result and result[1].work < _WORTH_MORE * (spent - before)
        if is_cheap or not search.of_one.any():  # noise of pilots decides nothing more
            break
    if result is None:
        raise cast(NotReached, fault)
    return result


def _known(document: dict[str, Any]) -> dict[str, Any]:
    """Return a document without keys that have no value, which TOML cannot write."""
    return {
        key: _known(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if value is not None
    }
