"""Pilots: runs of a few members of a scene, whose means and spreads are compared between settings.

A *name* is that of a quantity, for its mean over the members, or that of a quantity and a statistic, such as
``contact_area:spread``. The statistics are the ``spread`` (standard deviation) and the ``skewness`` over the members.

Behind a spring or under a force single paths diverge, so means over the second half of the run are compared there.
Times of events are compared in units of the duration, and a member without the event has it at the end of the run.
Other numbers that only some members have, such as a pull-off load, are compared as means over these members. The share
of these members is a name of its own, such as ``ever_detached``.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np
import xarray as xr

from sim.ensemble.dataset import scenario_json
from sim.ensemble.pace import counted
from sim.ensemble.plan import Plan, seconds_a_step
from sim.ensemble.simulate import run
from sim.ensemble.swept import spread
from sim.quantities import QUANTITIES, Form, has_mean
from sim.read.control_variate import control_variate
from sim.read.correlation import Array
from sim.read.dataset import MEMBERS, plain
from sim.read.events import events
from sim.read.observables import closed_observables
from sim.read.run import Run
from sim.read.statistics import over_members
from sim.read.tables import highlights, table
from sim.scenario.scenario import Scenario
from sim.study.accuracy import students
from sim.units.errors import BadInput

#: Quantities that are compared if none are named, as far as they are recorded.
USUAL = ("contact_area", "contact_radius", "friction_force", "bond_fraction")
#: Times of events, which are compared in units of the duration.
TIMES = (
    "pull_off_time",
    "jump_in_time",
    "lowest_load_time",
    "peak_time",
    "peak_friction_time",
    "runaway_after",
)
#: Events that tables show by their load or speed, with the time that is compared.
_TIME_OF = {
    "pull_off_load": "pull_off_time",
    "jump_in_load": "jump_in_time",
    "lowest_load": "lowest_load_time",
    "peak_stress": "peak_time",
    "peak_friction": "peak_friction_time",
}
#: Most points of a sweep that are tried.
POINTS = 16
#: Errors below this are roundings.
ROUNDING = 1e-12
STATISTICS = ("", "spread", "skewness")
#: A function that returns the names that are compared, of the dataset of a pilot.
Names = Callable[[xr.Dataset], list[str]]


class Sample(NamedTuple):
    """Statistics over the members of a pilot, at all points and times that are compared.

    Attributes
    ----------
    mean, sem : array, shape (names, numbers)
        Statistics and standard errors, of means at the known mean of ΔΓ where that is used; the errors are 0 without
        noise.
    members : array, shape (names, members, numbers)
        Values of each member, whose mean is the statistic. Those of a spread or a skewness are its influence on it.
    unit : array, shape (names, numbers)
        The unit of errors: the largest mean of the run at this point of the sweep; of times the duration, of shares 1.
    energy : array, shape (members, numbers)
        ΔΓ/⟨ΔΓ⟩ − 1 of each member, 0 where the mean of ΔΓ is not known.
    share : array, shape (names, numbers)
        Share of the members that have a value; 0 if fewer than two have one.
    """

    mean: Array
    sem: Array
    members: Array
    unit: Array
    energy: Array
    share: Array


class Cost(NamedTuple):
    """Counted work of a run without its members and records [s].

    Attributes
    ----------
    batch, each : float
        That of a clock step of a batch, and of each member in it, as means over the sweep.
    substeps : float
        That of the sub-steps of a member in the whole run, by their number in the pilot.
    """

    batch: float
    each: float
    substeps: float = 0.0


def usual(dataset: xr.Dataset) -> list[str]:
    """Return the names that ``--within`` compares: means of a contact, and times of the events that the table shows."""
    known = possible(dataset)
    shown = {column.name for column in highlights(Run(dataset)).columns}
    times = {_TIME_OF.get(name, name) for name in shown}
    names = [*USUAL, *(name for name in TIMES if name in times)]
    return [name for name in names if name in known]


def shown(dataset: xr.Dataset) -> list[str]:
    """Return the names that ``sim converge`` compares: all columns of the scene's table, and spreads over members.

    Behind a spring or under a force a spread is that of means over time, which is that of no single moment, and is left
    out.
    """
    run_of_pilot = Run(dataset)
    over_time = [column.name for column in table(run_of_pilot).columns]
    once = [column.name for column in highlights(run_of_pilot).columns]
    known, values = possible(dataset), closed_observables(dataset, None)
    names = [name for name in over_time if name in known]
    if "substeps" not in dataset and MEMBERS in dataset.dims:
        varying = (name for name in names if MEMBERS in values[name].dims)
        names += [f"{name}:spread" for name in varying if not _is_share(name)]
    return names + [name for name in once if name in known and name not in names]


def possible(dataset: xr.Dataset) -> set[str]:
    """Return the quantities that have a mean over time or a number for each member."""
    over_time, once = map(str, closed_observables(dataset, None)), events(dataset)
    result = {name for name in over_time if has_mean(name)}
    return result | {n for n, one in once.items() if {*one.value.dims} <= {MEMBERS}}


class Pilots:
    """Pilots of a scene at its settings, each run once.

    Parameters
    ----------
    members : int
        Members of a pilot.
    names : sequence of str
        Names that are compared; without any, those that ``default`` returns of the datasets of the first pilot.
    default : callable
        ``usual`` or ``shown``.
    budget, spent : float
        Counted work that may be spent, and that is spent already [s].
    """

    def __init__(
        self,
        members: int,
        names: Iterable[str],
        default: Names,
        budget: float,
        spent: float = 0.0,
    ) -> None:
        self.members, self.names, self.default = members, [*names], default
        self.budget, self.spent = budget, spent
        self._samples = dict[str, Sample | None]()
        self._substeps = dict[str, float]()

    def __getitem__(self, scenario: Scenario) -> Sample | None:
        """Return the pilot of a scene; None if it does not fit into the budget, or if a motion is not resolved."""
        key, points = self._pilots(scenario)
        if key not in self._samples:
            if self.spent + self.needed(scenario) > self.budget:
                return None
            datasets: Iterable[xr.Dataset] = (plain(run(point)) for point in points)
            if not self._samples:
                datasets = [*datasets]
                names = [name for each in datasets for name in self.default(each)]
                self.names = self.names or [*dict.fromkeys(names)]
                _check(self.names, datasets)
            samples, substeps, is_resolved = list[Sample](), list[float](), True
            for point, dataset in zip(points, datasets, strict=True):
                samples.append(self._sample_at(point, dataset))
                number = dataset.get("substeps", xr.DataArray(0.0))
                substeps.append(float(number.max(["t"] * bool(number.dims)).mean()))
                unresolved = dataset.get("unresolved_time", xr.DataArray(math.nan))
                is_resolved = is_resolved and bool(unresolved.isnull().all())
                point.release()
            arrays = zip(*samples, strict=True)
            sample = Sample(*(np.concatenate(each, -1) for each in arrays))
            self._samples[key] = sample if is_resolved else None
            self._substeps[key] = float(np.mean(substeps))
            self.spent += self.needed(scenario)
        return self._samples[key]

    def _pilots(self, scenario: Scenario) -> tuple[str, list[Scenario]]:
        """Return the pilots of a scene: some points of its sweep, with few members that are all recorded."""
        changes = {
            "ensemble.members": self.members,
            "record.per_member": True,
            "record.maps": (),
            "record.quantities": None,
        }
        points = spread(scenario.points(), POINTS)
        pilots = [point.with_values(changes, built=False) for point in points]
        return "".join(map(scenario_json, pilots)), pilots

    def is_unresolved(self, scenario: Scenario) -> bool:
        """Return True if the pilot of a scene was run, and a motion was not resolved."""
        key, _ = self._pilots(scenario)
        return key in self._samples and self._samples[key] is None

    def needed(self, scenario: Scenario) -> float:
        """Return the counted work of the pilot of a scene [s]; before it is run, with the sub-steps of others."""
        plans = [Plan.of(pilot) for pilot in self._pilots(scenario)[1]]
        members = sum(plan.members for plan in plans)
        return sum(map(counted, plans)) + members * self.cost(scenario).substeps

    def cost(self, scenario: Scenario) -> Cost:
        """Return the counted work of a scene; before its pilot is run, with the most sub-steps of others."""
        points = spread(scenario.points(), POINTS)
        batch = float(np.mean([seconds_a_step(point, 0) for point in points]))
        both = float(np.mean([seconds_a_step(point, 1) for point in points]))
        most = max(self._substeps.values(), default=0.0)
        number = self._substeps.get(self._pilots(scenario)[0], most)
        seconds = max(point.population.substep_seconds for point in points)
        return Cost(batch, both - batch, number * seconds)

    def _sample_at(self, pilot: Scenario, dataset: xr.Dataset) -> Sample:
        """Return the sample of a pilot without a sweep."""
        known, happened = closed_observables(dataset, None), events(dataset)
        driven = pilot.drive.solves_motion
        late = slice(dataset.sizes["t"] // 2 * driven, None)
        numbers = 1 if driven else dataset.sizes["t"]
        means = [name for name in self.names if name in known and not driven]
        estimates = over_members(dataset, means, quantiles=False) if means else {}
        rows = list[tuple[Array, ...]]()
        for name in self.names:
            quantity, _, statistic = name.partition(":")
            values = xr.DataArray(math.nan)  # an event that other points have
            if quantity in known:
                values = known[quantity]
            elif quantity in happened:
                values = happened[quantity].value
            if quantity in TIMES:
                values = dataset.get(quantity, values).fillna(pilot.clock.duration)
            values = values.astype(float)
            if MEMBERS not in values.dims:
                values = values.expand_dims({MEMBERS: self.members})
            values = values.transpose(MEMBERS, ...)
            if driven and "t" in values.dims:
                values = values.isel(t=late).mean("t")
            each = values.to_numpy()
            if each.ndim == 1:
                each = np.repeat(each[:, np.newaxis], numbers, axis=1)
            largest = np.abs(of_some(each, "")[0].mean(axis=0)).max()
            if quantity in TIMES:
                largest = pilot.clock.duration
            elif statistic == "skewness" or _is_share(quantity):
                largest = 1.0
            each, share = of_some(each, statistic)
            mean, sem = each.mean(axis=0), each.std(axis=0, ddof=1)
            sem = np.where(np.ptp(each, axis=0) > 0.0, sem, 0.0)
            sem /= math.sqrt(self.members)
            if name in estimates:
                one = estimates[name]
                mean, sem = (
                    np.nan_to_num(np.zeros(numbers) if part is None else part)
                    for part in (one.value, one.sem)
                )
            rows.append((mean, sem, each, np.full(numbers, largest), share))
        control, energy = control_variate(dataset), np.zeros((self.members, numbers))
        if control is not None and not driven:
            energy = control.deviation.transpose(MEMBERS, "t").to_numpy()
        mean, sem, each, unit, share = map(np.array, zip(*rows, strict=True))
        return Sample(mean, sem, each, unit, np.nan_to_num(energy), share)


def _check(names: Iterable[str], datasets: Iterable[xr.Dataset]) -> None:
    """Raise an error if a name is compared at no point of a sweep, of which these are the datasets."""
    known = {name for dataset in datasets for name in possible(dataset)}
    for name in names:
        quantity, _, statistic = name.partition(":")
        if quantity not in known or statistic not in STATISTICS:
            raise BadInput(
                [
                    f"accuracy.of: {name} is not compared; known: "
                    f"{', '.join(sorted(known))}, alone or with :spread, :skewness"
                ]
            )


def _is_share(quantity: str) -> bool:
    return quantity in QUANTITIES and QUANTITIES[quantity].form is Form.SHARE


def influences(values: Array, statistic: str) -> Array:
    """Return the numbers of members whose mean is a statistic over them, to first order in each of them.

    Parameters
    ----------
    values : array, shape (members, numbers)
        Values of each member.
    statistic : str
        ``""`` for the mean, ``"spread"`` or ``"skewness"``.

    Notes
    -----
    These are the statistic plus the influence of each member on it. So the standard error of their mean is that of
    the statistic, and differences of two settings are paired as those of means are.

    Examples
    --------
    >>> values = np.array([[0.0], [0.0], [3.0]])
    >>> [round(float(influences(values, name).mean()), 6) for name in ("", "spread", "skewness")]
    [1.0, 1.414214, 0.707107]
    """
    if not statistic:
        return values
    off = values - values.mean(axis=0)
    size = np.sqrt(np.mean(off**2, axis=0))
    is_random = size > ROUNDING * np.abs(values).max(axis=0)
    size = np.where(is_random, size, 0.0)
    score = np.divide(off, size, out=np.zeros(off.shape), where=size > 0.0)
    if statistic == "spread":
        return np.asarray(size * 0.5 * (score**2 + 1.0))
    third = np.mean(score**3, axis=0)
    return np.asarray(score**3 - 3.0 * score - 1.5 * third * (score**2 - 1.0))


def of_some(values: Array, statistic: str) -> tuple[Array, Array]:
    """Return ``influences`` of a statistic over the members that have a value, and the share of these members.

    A member without a value (nan) has no influence. The influences are scaled so that the interval of their mean over
    all members is that of Student's law for the members with a value. Of fewer than two such members there is no known
    error, so that they count as none: the influences and the share are 0.

    Examples
    --------
    >>> influence, share = of_some(np.array([[1.0], [3.0], [np.nan], [np.nan]]), "")
    >>> print(influence.mean(), share)
    2.0 [0.5]
    """
    known = np.isfinite(values)
    members, count = len(values), known.sum(axis=0)
    if known.all():
        return influences(values, statistic), np.ones(count.shape)
    result = np.zeros(values.shape)
    for place in np.flatnonzero(count > 1):
        some, number = known[:, place], count[place]
        each = influences(values[some, place, np.newaxis], statistic)[:, 0]
        # squares are divided by members - 1, and their sum by the members
        scale = (members - 1.0) * members / ((number - 1.0) * number)
        factor = float(students(number) / students(members)) * math.sqrt(scale)
        result[:, place] = each.mean()
        result[some, place] += factor * (each - each.mean())
    return result, np.where(count > 1, count / members, 0.0)


def difference(sample: Sample, reference: Sample, unit: Array) -> Array:
    """Return bounds of the differences of two samples and the noise in them, shape (2, names), in a ``unit``.

    Members have the same noise as far as the settings leave it, so that the differences of members may have the
    smaller error; else it is that of the two means. Each bound is that at the time at which it is largest. If only one
    sample has members with a value, its mean counts by their share, because the other has no mean to compare.
    """
    count = sample.members.shape[1]
    paired = sample.members - reference.members
    of_pairs = paired.std(axis=1, ddof=1) / math.sqrt(count)
    apart = np.hypot(sample.sem, reference.sem)
    off = np.where(of_pairs < apart, paired.mean(axis=1), sample.mean - reference.mean)
    noise = students(count) * np.minimum(of_pairs, apart)
    is_in_one = (sample.share == 0.0) ^ (reference.share == 0.0)
    share = np.where(is_in_one, np.maximum(sample.share, reference.share), 1.0)
    off, noise = share * off, share * noise
    parts = in_units(np.array([np.abs(off) + noise, noise]), unit)
    at = parts[0].argmax(axis=1)
    return np.array([part[np.arange(len(at)), at] for part in parts])


def in_units(values: Array, unit: Array) -> Array:
    """Return values in a unit, 0 where the unit is; roundings are 0."""
    zeros = np.zeros(values.shape)
    result = np.divide(values, unit, out=zeros, where=unit > 0.0)
    return np.where(result > ROUNDING, result, 0.0)
