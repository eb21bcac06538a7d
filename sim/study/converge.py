"""Speed against error for one scene: ``sim converge``.

Every setting (``sim.study.settings``) changes one thing of the scene: the shear model, the bond model, the clock
step or the grid. Its error follows without sampling from closed forms and a march without noise
(``sim.study.exact_law``); samples check that, and stand in where there is no law. Errors of several changes add up.
"""

import importlib.metadata
import itertools
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.analysis import engineering
from sim.scenario.declared import quantities
from sim.scenario.scenario import Scenario
from sim.study.estimates import Estimate, estimates
from sim.study.exact_law import QUANTITIES, STATISTICS, Terms, Walk
from sim.study.figure import figure
from sim.study.samples import Times, affordable, coupled, fluctuates, sampled, timed
from sim.study.settings import Setting, at_step, number_of_sites, plain, settings, tolerance_of
from sim.study.verdicts import explanation, recommendation, table

__all__ = ["converge", "explanation", "figure", "recommendation", "table"]

Array = NDArray[np.float64]

#: Shares of the budget: runs without noise, times, samples.
_WALKS, _TIMES, _SAMPLES = 0.4, 0.2, 0.4
#: Times at which a run is sampled; those of a stationary one, which are pooled, and the most steps of that.
_STATED, _POOLED, _LONG_ENOUGH = 6, 32, 512
#: Finest clock step over the scene's, and over that of coupled samples; change over tolerance that ends the halving.
_FINEST, _FINEST_SAMPLED, _FINE = 2.0**-12, 0.25, 0.1
#: Standard errors beyond which a deviation is more than chance, and by which an error may be larger than it was found.
_SURE = 2.0
#: Error of the finest sampled step over its difference from the next: of half an order, as of first passages.
_REST = 1.0 / (math.sqrt(2.0) - 1.0)


_UNTIMED = Times(math.nan, math.nan, math.nan)


@dataclass
class Row:
    """A setting and what was found of it.

    Attributes
    ----------
    setting : Setting
        What is changed.
    error : array, shape (quantities, statistics)
        Largest error over the run, in units of the yardsticks; nan where it is not known.
    bound : array, shape (quantities, statistics)
        What it is at most, where it is known from samples only; else nan.
    times : Times
        CPU time of the scene's run.
    members : int
        Members sampled; 0 where the budget was too small, or nothing is to be sampled.
    law : array, shape (records, quantities, 3)
        What a sample should give [SI].
    value, deviation, standard_error : array, shape (times, quantities, 3)
        A sample [SI], less the law or the fullest model, and the standard error of that, in units of the yardsticks.
    """

    setting: Setting
    error: Array = field(default_factory=lambda: np.full((4, 4), np.nan))
    bound: Array = field(default_factory=lambda: np.full((4, 4), np.nan))
    times: Times = _UNTIMED
    members: int = 0
    law: Array | None = None
    value: Array | None = None
    deviation: Array | None = None
    standard_error: Array | None = None


def converge(scenario: Scenario, budget_seconds: float, tolerance: float | None = None) -> xr.Dataset:
    """Run a scene at every admissible setting, and say what each costs and how far it is from the truth.

    Parameters
    ----------
    scenario : Scenario
        The scene, without its sweep: at the values that its tables give.
    budget_seconds : float
        Computing time to spend [s]. Each run without noise is made once at least.
    tolerance : float, optional
        Error that is accepted, by default that of the scene.

    Returns
    -------
    xarray.Dataset
        Along ``row``: the CPU time of the scene's run at each setting, its largest ``error`` for each ``quantity`` and
        ``statistic`` in units of the ``yardstick``, and at the stated times ``t`` the ``value`` in a sample, its
        ``deviation`` from what is expected and the ``standard_error`` of that.

    Notes
    -----
    Truth: all modes of the cell (of a grid eight times as fine as the finest that is tried, where the spectrum has no
    end), cohorts to 1e-6 or the linear rate equation, and the limit of short steps. Under such bonds, which any that
    keep the accepted error resemble, the clock step is halved until steps agree; the finest is taken to differ from
    the limit by the largest change so far, each halved as often as the step since, which is no less than errors of
    first order or better leave. Yardsticks are largest values over the run: of the mean for means and for the spread
    of bonds, of the spread for spreads, of the skewness for that of ΔΓ; that of the rest is not judged.
    """
    left_out: list[str] = []
    base = plain(scenario)
    accepted = tolerance_of(scenario) if tolerance is None else tolerance
    sites = number_of_sites(scenario)
    study = _Study(base, settings(base, left_out), sites if accepted**2 * sites < 1.0 else math.inf)
    study.judge_models()
    study.judge_bonds()
    study.judge_steps(accepted, _WALKS * budget_seconds)
    share = _TIMES * budget_seconds / len(study.rows)
    as_written = timed(base, 2.0 * share)
    for row in study.rows:
        row.times = as_written if row.setting.own else timed(row.setting.scenario, share)
    study.sample(_SAMPLES * budget_seconds)
    return _assembled(scenario, study, accepted, left_out)


class _Study:
    """The rows of one scene and the runs without noise that they are judged by.

    ``sites`` is the number of bond sites whose noise counts, infinite if none does.
    """

    def __init__(self, base: Scenario, chosen: Sequence[Setting], sites: float) -> None:
        self.base, self.sites, self.rows = base, sites, [Row(setting) for setting in chosen]
        self.own_sites = Setting("", "", base, "").sites
        points = [row.setting.points for row in self.of("grid")]
        grids = [*points, 8 * max(points)] if points else []
        self.terms = [Terms.of_cell(base), Terms.of_model(base)]
        self.terms += [Terms.of_model(row.setting.scenario) for row in self.of("shear")]
        self.terms += [Terms.of_cell(base, count) for count in grids]
        self.began = time.process_time()
        self.walk = Walk.of(base, self.terms)
        #: The run with exact bonds, once ``judge_bonds`` has found it.
        self.exact = self.walk
        law = self.walk.statistics(-1 if grids else 0, sites)
        #: Where there is a law of each statistic.
        self.lawful: NDArray[np.bool_] = np.all(np.isfinite(law), axis=0)
        self.lawful[0] |= not self.walk.stretched
        self.lawful[[0, 1, 3], 2] = True  # the skewness is judged of ΔΓ alone
        self.yard = _yardsticks(self._meant(law, self.walk))

    def of(self, part: str) -> list[Row]:
        """The rows that change one part."""
        return [row for row in self.rows if row.setting.part == part]

    def _largest(self, difference: Array) -> Array:
        """Largest difference over the records in units of the yardsticks, shape (quantities, 3)."""
        return np.max(_over(np.abs(difference), self.yard), axis=0)

    @staticmethod
    def _meant(statistics: Array, walk: Walk) -> Array:
        """Statistics with means of a run without noise where they have no law."""
        mean = statistics[:, 1:, 0]
        statistics[:, 1:, 0] = np.where(np.isnan(mean), walk.means[:, 1:], mean)
        return statistics

    def judge_models(self) -> None:
        """Errors of shear models and of grids, by the terms of ΔΓ that they draw."""
        truth = self.walk.statistics(0, self.sites)
        part: Any = self.base.fluctuations
        power = part.correlation.power if part.per_member else 0
        memory = self.terms[0].memory(power)
        rows = self.of("shear")
        for which, row in enumerate(rows, 2):
            row.law = self.walk.statistics(which, self.own_sites)
            row.error[:, :3] = self._largest(self.walk.statistics(which, self.sites) - truth)
            row.error[2, 3] = abs(self.terms[which].memory(power) / memory - 1.0)
        for which, row in enumerate(self.of("grid"), 2 + len(rows)):
            row.error[:, :3] = self._largest(
                self.walk.statistics(which, self.sites) - self.walk.statistics(-1, self.sites)
            )

    def judge_bonds(self) -> None:
        """Errors of bond models at the scene's clock step; the last without a number of sites is exact."""
        rows = self.of("bonds")
        walks = [self.walk if row.setting.own else Walk.of(row.setting.scenario, self.terms[:2])
                 for row in rows if math.isinf(row.setting.sites)]  # fmt: skip
        if walks:
            self.exact = walks[-1]
        walks += walks[-1:] * (len(rows) - len(walks))
        for row, walk in zip(rows, walks, strict=True):
            sites = row.setting.sites
            row.law = walk.statistics(1, sites)
            exact = self._meant(self.exact.statistics(0, self.sites), self.exact)
            row.error[:, :3] = self._largest(self._meant(walk.statistics(0, sites), walk) - exact)

    def judge_steps(self, tolerance: float, seconds: float) -> None:
        """Errors of clock steps: from the longest that the records allow, halved until they agree or the time is up.

        A first-order error changes by half of itself when the step is halved, more or less as a jump of the speed
        lies within a step: what is left of the finest is taken from the largest change so far.
        """
        longer = [ratio for ratio in (4.0, 2.0) if not self.base.clock.stride % round(ratio)]
        found = [*map(self._at, longer), self._at(1.0, self.exact)]
        rest = np.zeros(self.yard.shape)
        for (_, one), (_, other) in itertools.pairwise(found):
            rest = np.fmax(0.5 * rest, self._largest(other - one))
        agree = late = False
        while not (late or (agree and len(found) > 2) or found[-1][0].setting.ratio <= _FINEST):
            began = time.process_time()
            found.append(self._at(0.5 * found[-1][0].setting.ratio))
            rest = np.fmax(0.5 * rest, self._largest(found[-1][1] - found[-2][1]))
            spent = time.process_time() - began
            late = time.process_time() + 2.0 * spent > self.began + seconds
            agree = bool(np.max(rest) <= _FINE * tolerance)
        for row, statistics in found:
            row.error[:, :3] = self._largest(statistics - found[-1][1]) + rest
        self.rows += [row for row, _ in found]

    def _at(self, ratio: float, walk: Walk | None = None) -> tuple[Row, Array]:
        setting = at_step(self.base, ratio)
        walk = walk or Walk.of(at_step(self.exact.scenario, ratio).scenario, self.terms[:2])
        return Row(setting), self._meant(walk.statistics(0, self.own_sites), walk)

    def sample(self, seconds: float) -> None:
        """Sample shear and bond models that fluctuate; where there is no law also clock steps, under the same noise."""
        lawless = not self.lawful[1:, 0].all()
        own = self.walk.statistics(1, self.own_sites)[:, 1:, :2]
        pooled = not lawless and bool(np.all(np.ptp(own, axis=0) <= 1e-9 * self.yard[1:, :2]))
        records = self.walk.steps[self.walk.steps <= _LONG_ENOUGH] if pooled else self.walk.steps
        count = min(_POOLED if pooled else _STATED, len(records) - 1)
        self.stated = np.unique(np.rint(np.linspace(len(records) - 1, 0, count, endpoint=False)).astype(int))
        self.pooled = pooled
        rows = [row for row in self.rows if row.setting.part in ("shear", "bonds") and self._worth(row, lawless)]
        steps = [row for row in self.of("step")[::-1] if row.setting.ratio >= _FINEST_SAMPLED]
        steps = steps if lawless and fluctuates(self.base) else []
        share = seconds / max(len(rows) + len(steps), 1)
        drawn = [(row, self._estimates(row, share)) for row in rows]
        for part in ("shear", "bonds"):
            self._compare([(row, found) for row, found in drawn if found and row.setting.part == part])
        if steps:
            self._couple(steps, share * len(steps))

    def _worth(self, row: Row, lawless: bool) -> bool:
        if row.setting.part == "bonds":
            return math.isfinite(row.setting.sites)
        return lawless or fluctuates(row.setting.scenario)

    def _estimates(self, row: Row, seconds: float) -> list[list[list[Estimate]]]:
        """Estimates of a sample by time, quantity and statistic; none where the budget is too small."""
        scene, steps = row.setting.scenario, self.walk.steps[self.stated]
        row.members = affordable(scene, int(steps[-1]), seconds, len(steps))
        return self._of_values(sampled(scene, row.members, steps.tolist())) if row.members else []

    def _of_values(self, values: Array) -> list[list[list[Estimate]]]:
        times = [slice(None)] if self.pooled else [slice(k, k + 1) for k in range(values.shape[2])]
        return [[estimates(kept[:, now]) for kept in values] for now in times]

    def _compare(self, drawn: list[tuple[Row, list[list[list[Estimate]]]]]) -> None:
        """Samples of one part against their laws, else against the fullest model among them."""
        if not drawn:
            return
        fullest, best = drawn[-1]
        spread = np.fmax.reduce([[of[1].value for of in now] for now in best])
        self.yard[:, 1] = np.where(np.isnan(self.yard[:, 1]), spread, self.yard[:, 1])
        shape = (len(best), len(QUANTITIES), 3)
        for row, found in drawn:
            row.value, row.deviation, row.standard_error = (np.full(shape, np.nan) for _ in range(3))
            for t, q, s in np.ndindex(shape):
                one = found[t][q][s]
                assert row.law is not None
                expected = float(row.law[self.stated[t], q, s])
                row.value[t, q, s] = one.value
                if (q == 0 and not self.walk.stretched) or (q != 2 and s == 2):
                    continue
                if self.lawful[q, s] and math.isfinite(expected):
                    row.deviation[t, q, s], row.standard_error[t, q, s] = one.value - expected, one.standard_error
                elif row is not fullest:
                    row.deviation[t, q, s], row.standard_error[t, q, s] = one.less(best[t][q][s])
            row.deviation, row.standard_error = _over(row.deviation, self.yard), _over(row.standard_error, self.yard)
            if row is fullest:
                self._take(row, np.zeros((2, *shape[1:])))
            else:
                self._take(row, _sampled_error(row.deviation, row.standard_error, _SURE))

    def _take(self, row: Row, found: Array) -> None:
        """Errors of a sample and their bounds, shape (2, quantities, 3), where no law gives them."""
        only = ~self.lawful & np.isfinite(found[1])
        for kept, new in zip((row.error[:, :3], row.bound[:, :3]), found, strict=True):
            kept[only] = np.fmax(row.error[:, :3], new)[only]

    def _couple(self, rows: Sequence[Row], seconds: float) -> None:
        """Sampled errors of clock steps, finest first, under the same fluctuations."""
        finest = rows[0].setting
        steps = np.rint(self.walk.steps[self.stated] / finest.ratio).astype(int)
        members = affordable(finest.scenario, int(steps[-1]), seconds / 2.0, len(rows) * len(steps))
        if not members:
            return
        found = [self._of_values(v) for v in coupled([r.setting.scenario for r in rows], members, steps.tolist())]
        errors = []
        for one in found:
            less = np.array([[[a.less(b) for a, b in zip(x, y, strict=True)] for x, y in zip(now, then, strict=True)]
                             for now, then in zip(one, found[0], strict=True)])  # fmt: skip
            errors.append(_sampled_error(_over(less[..., 0], self.yard), _over(less[..., 1], self.yard), 0.0))
        rest = _REST * errors[1]
        for row, error in zip(rows, errors, strict=True):
            row.members = members
            self._take(row, error + rest)
        for row in self.of("step"):
            if row.setting.ratio < finest.ratio:
                self._take(row, rest)


def _over(numbers: Array, yard: Array) -> Array:
    """Numbers in units of the yardsticks; 0 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = numbers / yard
    return np.where((numbers == 0.0) & (yard == 0.0), 0.0, found)


def _sampled_error(deviation: Array, sem: Array, least: float) -> Array:
    """Largest deviation of at least so many standard errors, and what it may be at most, shape (2, quantities, 3)."""
    size = np.abs(deviation)
    return np.stack([np.fmax.reduce(np.where(size >= least * sem, size, 0.0)), np.fmax.reduce(size + _SURE * sem)])


def _yardsticks(statistics: Array) -> Array:
    """Units of errors, shape (quantities, 3): largest values of a run, nan of a spread that is not known."""
    yard = np.max(np.abs(statistics), axis=0)
    yard[:2, 1] = yard[:2, 0]
    yard[:, 2] = yard[2, 2] if yard[2, 2] > 0.0 else 1.0
    return yard


_LONG = ("mean shear stress", "bonds over bonds at rest", "energy of the fluctuations per area", "contact radius")
_UNITS = ("Pa", "1", "J/m^2", "m")


def _assembled(scenario: Scenario, study: _Study, tolerance: float, left_out: list[str]) -> xr.Dataset:
    """Everything that was found, with units and long names."""
    rows, clock = study.rows, study.base.clock
    stated = study.walk.steps[study.stated[-1:] if study.pooled else study.stated]
    empty = np.full((len(stated), len(QUANTITIES), 3), np.nan)
    along: dict[str, tuple[list[Any], str, str]] = {
        "part": ([row.setting.part for row in rows], "", "what the setting changes"),
        "toml": ([row.setting.toml for row in rows], "", "lines of the scenario file that choose the setting"),
        "own": ([int(row.setting.own) for row in rows], "1", "1 where the scene has this setting as it is written"),
        "time": ([row.times.median for row in rows], "s", "CPU time of the scene's run, median of the repeats"),
        "time_low": ([row.times.low for row in rows], "s", "CPU time of the scene's run, least of the repeats"),
        "time_high": ([row.times.high for row in rows], "s", "CPU time of the scene's run, largest of the repeats"),
        "members": ([row.members for row in rows], "1", "members sampled"),
        "clock_step": ([row.setting.scenario.clock.step for row in rows], "s", "clock step"),
    }
    variables: dict[str, Any] = {
        name: ("row", values, {"long_name": text} | ({"units": unit} if unit else {}))
        for name, (values, unit, text) in along.items()
    }
    dims = ("row", "t", "quantity", "statistic")
    for name, unit, text in (
        ("value", "", "sampled statistic, in SI units"),
        ("deviation", "1", "sampled statistic less what is expected, in units of the yardstick"),
        ("standard_error", "1", "standard error of the deviation, in units of the yardstick"),
    ):
        values = [empty if getattr(row, name) is None else getattr(row, name) for row in rows]
        variables[name] = (dims, _padded(np.array(values)), {"long_name": text} | ({"units": unit} if unit else {}))
    for name, text in (
        ("error", "largest error over the run, in units of the yardstick"),
        ("bound", "what the error is at most, where it is known from samples only, in units of the yardstick"),
    ):
        numbers = np.array([getattr(row, name) for row in rows])
        variables[name] = (("row", *dims[2:]), numbers, {"units": "1", "long_name": text})
    variables["yardstick"] = (dims[2:], _padded(study.yard), {"long_name": "unit of errors, in SI units"})
    coordinates = {
        "row": ("row", [row.setting.label for row in rows], {"long_name": "setting"}),
        "t": ("t", [clock.time(int(step)) for step in stated], {"units": "s", "long_name": "time of the statistics"}),
        "quantity": ("quantity", list(QUANTITIES), {"long_name": "; ".join(_LONG), "comment": ", ".join(_UNITS)}),
        "statistic": ("statistic", list(STATISTICS), {"long_name": "statistic"}),
    }
    version = importlib.metadata.version("sliding-sim")
    members = scenario.ensemble.members if fluctuates(study.base) else 1
    dataset = xr.Dataset(variables, coordinates, {
        "Conventions": "CF-1.11", "title": f"speed against error: {scenario.name}",
        "history": f"sim converge; sliding-sim {version}", "sim_version": version, "seed": str(scenario.seed),
        "tolerance": tolerance, "clock_step": clock.step, "steps": clock.steps,
        "members_of_run": members, "fluctuates": int(fluctuates(study.base)), "pooled": int(study.pooled),
        "sites": study.sites, "point": _point(scenario), "left_out": "\n".join(left_out),
    })  # fmt: skip
    dataset["t"].encoding["_FillValue"] = None  # the conventions allow a coordinate none
    return dataset


def _padded(numbers: Array) -> Array:
    """Room for the correlation time, which is never sampled."""
    return np.concatenate([numbers, np.full((*numbers.shape[:-1], 1), np.nan)], axis=-1)


def _point(scenario: Scenario) -> str:
    """Which point of a sweep is studied, and how to choose another."""
    if not scenario.sweep:
        return ""
    declared = quantities(scenario)
    keys = [key for axis in scenario.sweep for key in axis.keys]
    at = [f"{key} = {engineering(declared[key][1], declared[key][0].unit)}" if key in declared
          else f"{key} as its table has it" for key in keys]  # fmt: skip
    return f"{', '.join(at)}; choose another point of the sweep by --set {keys[0]}=…"
