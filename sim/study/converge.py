"""Speed against error for one scene: ``sim converge``.

Every setting (``sim.study.settings``) changes one thing of the scene: the shear model, the bond model, the clock
step or the grid. Its error follows without sampling from closed forms and a march without noise
(``sim.study.exact_law``); samples check that, and stand in where there is no law. Errors of several changes add up.
"""

import importlib.metadata
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.analysis import engineering
from sim.numerics import files
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read, quantities
from sim.study.exact_law import QUANTITIES, STATISTICS, Walk, cell_gammas, memory
from sim.study.figure import figure
from sim.study.samples import Array, Estimates, affordable, coupled, estimates, fluctuates, sampled, timed
from sim.study.settings import Row, at_step, number_of_sites, plain, settings, tolerance_of
from sim.study.verdicts import explanation, recommendation, table
from sim.units.errors import BadInput

__all__ = ["carried_out", "claim", "converge", "explanation", "figure", "recommendation", "save", "table"]

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

    Raises
    ------
    BadInput
        If the drive feels the friction, or the field is a measured map.

    Notes
    -----
    Truth: all modes of the cell (of a grid eight times as fine as the finest that is tried, where the spectrum has no
    end), cohorts to 1e-6 or the linear rate equation, and the limit of short steps. Under such bonds, which any that
    keep the accepted error resemble, the clock step is halved until steps agree; the finest is taken to differ from
    the limit by the largest change so far, each halved as often as the step since, which is no less than errors of
    first order or better leave. Yardsticks are largest values over the run: of the mean for means and for the spread
    of bonds, of the spread for spreads, of the skewness for that of ΔΓ; that of the rest is not judged.
    """
    if scenario.drive.solves_motion:
        said = (
            f'drive.model is "{scenario.drive.model}", whose slider feels the noise: no law gives its truth; study the'
        )
        raise BadInput([f'{said} scene at a speed that is prescribed, such as [drive] model = "ramp"'])
    if scenario.fluctuations.measured:
        said = "shear.field is a measured map, which no simpler model stands for: study random fields of its spectrum,"
        raise BadInput([f'{said} spectrum = {{ model = "measured", file = "..." }}'])
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
        row.time, row.time_low, row.time_high = as_written if row.own else timed(row.scenario, share)
    study.sample(_SAMPLES * budget_seconds)
    return _assembled(scenario, study, accepted, left_out)


def claim(scenario: Scenario, target: Path, replace: bool) -> Path:
    """Refuse files that cannot be written or are not to be replaced; the name of the picture beside the dataset."""
    picture = target.with_suffix(".png")
    if picture == target:
        raise BadInput([f"{target}: the dataset cannot have the name of its picture; end it in .nc"])
    for path in (target, picture):
        files.claim(path, replace, files_read(scenario))
    return picture


def carried_out(
    scenario: Scenario, target: Path, replace: bool, seconds: float, tolerance: float | None
) -> tuple[list[dict[str, str]], str]:
    """Study a scene and save dataset and figure; the table to print and the text below it."""
    picture = claim(scenario, target, replace)
    found = converge(scenario, seconds, tolerance)
    save(found, target, picture)
    return table(found), f"{explanation(found)}\n\n{recommendation(found)}\n\n{target}\n{picture}"


def save(found: xr.Dataset, target: Path, picture: Path) -> None:
    """Write the dataset and its figure, each whole or not at all."""
    with files.output(target) as beside:
        found.to_netcdf(beside)
    with files.output(picture) as beside:
        figure(found).savefig(beside, format="png")


class _Study:
    """The rows of one scene and the runs without noise that they are judged by.

    ``sites`` is the number of bond sites whose noise counts, infinite if none does.
    """

    def __init__(self, base: Scenario, rows: list[Row], sites: float) -> None:
        self.base, self.sites, self.rows = base, sites, rows
        self.own_sites = Row("", "", base, "").sites
        points = [row.points for row in self.of("grid")]
        grids = [*points, 8 * max(points)] if points else []
        self.terms = [cell_gammas(base), base.process.gammas]
        self.terms += [row.scenario.process.gammas for row in self.of("shear")]
        self.terms += [cell_gammas(base, count) for count in grids]
        self.walk = Walk.of(base, self.terms)
        #: The run with exact bonds, once ``judge_bonds`` has found it.
        self.exact = self.walk
        law = self.walk.statistics(-1 if grids else 0, sites)
        #: Where there is a law of each statistic, or none is needed: the skewness is judged of ΔΓ alone.
        self.lawful: NDArray[np.bool_] = np.all(np.isfinite(law), axis=0)
        self.lawful[0] |= not self.walk.stretched
        self.lawful[[0, 1, 3], 2] = self.lawful[:, 3] = True
        self.yard = _yardsticks(_meant(law, self.walk))

    def of(self, part: str) -> list[Row]:
        """The rows that change one part."""
        return [row for row in self.rows if row.part == part]

    def _largest(self, difference: Array) -> Array:
        """Largest difference over the records in units of the yardsticks, shape (quantities, statistics)."""
        return np.max(_over(np.abs(difference), self.yard), axis=0)

    def judge_models(self) -> None:
        """Errors of shear models and of grids, by the terms of ΔΓ that they draw."""
        part: Any = self.base.fluctuations
        for which, row in enumerate(shears := self.of("shear"), 2):
            row.law = self.walk.statistics(which, self.own_sites)
            row.error = self._largest(self.walk.statistics(which, self.sites) - self.walk.statistics(0, self.sites))
            cell, own = (memory(terms, part.correlation.power) for terms in (self.terms[0], self.terms[which]))
            row.error[2, 3] = abs(own / cell - 1.0)
        for which, row in enumerate(self.of("grid"), 2 + len(shears)):
            row.error = self._largest(self.walk.statistics(which, self.sites) - self.walk.statistics(-1, self.sites))

    def judge_bonds(self) -> None:
        """Errors of bond models at the scene's clock step; the last without a number of sites is exact."""
        rows = self.of("bonds")
        walks = [self.walk if row.own else Walk.of(row.scenario, self.terms[:2])
                 for row in rows if math.isinf(row.sites)]  # fmt: skip
        if walks:
            self.exact = walks[-1]
        exact = _meant(self.exact.statistics(0, self.sites), self.exact)
        for row, walk in zip(rows, walks + [self.exact] * (len(rows) - len(walks)), strict=True):
            row.law = walk.statistics(1, row.sites)
            row.error = self._largest(_meant(walk.statistics(0, row.sites), walk) - exact)

    def judge_steps(self, tolerance: float, seconds: float) -> None:
        """Errors of clock steps: from the longest that the records allow, halved until they agree or the time is up.

        A first-order error changes by half of itself when the step is halved, more or less as a jump of the speed
        lies within a step: what is left of the finest is taken from the largest change so far.
        """
        ratios = [ratio for ratio in (4.0, 2.0) if not self.base.clock.stride % round(ratio)] + [1.0]
        found: list[tuple[Row, Array]] = []
        rest, agree, late = np.zeros(self.yard.shape), False, False
        end = time.process_time() + seconds  # what has run before may have compiled
        while ratios or not (late or (agree and len(found) > 2) or found[-1][0].ratio <= _FINEST):
            began = time.process_time()
            row = at_step(self.base, ratios.pop(0) if ratios else 0.5 * found[-1][0].ratio)
            exact = at_step(self.exact.scenario, row.ratio).scenario
            walk = self.exact if row.own else Walk.of(exact, self.terms[:2])
            found.append((row, _meant(walk.statistics(0, self.own_sites), walk)))
            if len(found) > 1:
                rest = np.fmax(0.5 * rest, self._largest(found[-1][1] - found[-2][1]))
            if row.ratio < 1.0:
                late = time.process_time() + 2.0 * (time.process_time() - began) > end
                agree = bool(np.max(rest) <= _FINE * tolerance)
        for row, statistics in found:
            row.error = self._largest(statistics - found[-1][1]) + rest
        self.rows += [row for row, _ in found]

    def sample(self, seconds: float) -> None:
        """Sample shear and bond models that fluctuate; where there is no law also clock steps, under the same noise."""
        lawless = not self.lawful[1:, 0].all()
        own = self.walk.statistics(1, self.own_sites)[:, 1:, :2]
        self.pooled = not lawless and bool(np.all(np.ptp(own, axis=0) <= 1e-9 * self.yard[1:, :2]))
        records = self.walk.steps[self.walk.steps <= _LONG_ENOUGH] if self.pooled else self.walk.steps
        count = min(_POOLED if self.pooled else _STATED, len(records) - 1)
        self.stated = np.unique(np.rint(np.linspace(len(records) - 1, 0, count, endpoint=False)).astype(int))
        steps = self.walk.steps[self.stated]
        for row in self.rows:
            row.value = row.deviation = row.standard_error = np.full((1 if self.pooled else len(steps), 4, 4), np.nan)
        shears = [row for row in self.of("shear") if lawless or fluctuates(row.scenario)]
        bonds = [row for row in self.of("bonds") if math.isfinite(row.sites)]
        coarse = [row for row in self.of("step")[::-1] if row.ratio >= _FINEST_SAMPLED]
        coarse = coarse if lawless and fluctuates(self.base) else []
        share = seconds / max(len(shears + bonds + coarse), 1)
        for rows in (shears, bonds):
            for row in rows:
                row.members = affordable(row.scenario, int(steps[-1]), share, len(steps))
            self._compare([(row, self._estimates(sampled(row.scenario, row.members, steps.tolist())))
                           for row in rows if row.members])  # fmt: skip
        if coarse:
            self._couple(coarse, share * len(coarse))

    def _estimates(self, values: Array) -> Estimates:
        """Statistics of a sample, shape (quantities, members, times): at each time, or of all times together."""
        found = estimates(values[np.newaxis] if self.pooled else np.moveaxis(values, 2, 0)[..., np.newaxis])
        return Estimates(*(np.insert(of, 3, np.nan, axis=2) for of in found))  # no correlation time

    def _compare(self, drawn: list[tuple[Row, Estimates]]) -> None:
        """Samples of one part against their laws, else against the fullest model among them."""
        if not drawn:
            return
        fullest, best = drawn[-1]
        self.yard[:, 1] = np.where(np.isnan(self.yard[:, 1]), np.fmax.reduce(best.value[..., 1]), self.yard[:, 1])
        judged = np.ones(self.yard.shape, bool)
        judged[0], judged[[0, 1, 3], 2] = self.walk.stretched, False
        for row, found in drawn:
            assert row.law is not None
            law = row.law[self.stated[: len(found.value)]]
            lawful = self.lawful & np.isfinite(law)
            apart = found.less(best) if row is not fullest else np.full((2, *law.shape), np.nan)
            pairs = zip((found.value - law, found.standard_error), apart, strict=True)
            both = (_over(np.where(judged, np.where(lawful, *pair), np.nan), self.yard) for pair in pairs)
            row.value, (row.deviation, row.standard_error) = found.value, both
            error = _sampled_error(row.deviation, row.standard_error, _SURE)
            self._take(row, error if row is not fullest else np.zeros(error.shape))

    def _take(self, row: Row, found: Array) -> None:
        """Errors of a sample and their bounds, shape (2, quantities, statistics), where no law gives them."""
        only = ~self.lawful & np.isfinite(found[1])
        for kept, new in zip((row.error, row.bound), found, strict=True):
            kept[only] = np.fmax(row.error, new)[only]

    def _couple(self, rows: Sequence[Row], seconds: float) -> None:
        """Sampled errors of clock steps, finest first, under the same fluctuations."""
        finest = rows[0]
        steps = np.rint(self.walk.steps[self.stated] / finest.ratio).astype(int)
        members = affordable(finest.scenario, int(steps[-1]), seconds / 2.0, len(rows) * len(steps))
        if not members:
            return
        found = [self._estimates(values) for values in coupled([r.scenario for r in rows], members, steps.tolist())]
        less = [each.less(found[0]) for each in found]
        errors = [_sampled_error(_over(apart, self.yard), _over(sem, self.yard), 0.0) for apart, sem in less]
        for row, error in zip(rows, errors, strict=True):
            row.members = members
            self._take(row, error + _REST * errors[1])
        for row in self.of("step"):
            if row.ratio < finest.ratio:
                self._take(row, _REST * errors[1])


def _meant(statistics: Array, walk: Walk) -> Array:
    """Statistics with means of a run without noise where they have no law."""
    mean = statistics[:, 1:, 0]
    statistics[:, 1:, 0] = np.where(np.isnan(mean), walk.means[:, 1:], mean)
    return statistics


def _over(numbers: Array, yard: Array) -> Array:
    """Numbers in units of the yardsticks; 0 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = numbers / yard
    return np.where((numbers == 0.0) & (yard == 0.0), 0.0, found)


def _sampled_error(deviation: Array, sem: Array, least: float) -> Array:
    """Largest deviation of at least so many standard errors and its bound, shape (2, quantities, statistics)."""
    size = np.abs(deviation)
    return np.stack([np.fmax.reduce(np.where(size >= least * sem, size, 0.0)), np.fmax.reduce(size + _SURE * sem)])


def _yardsticks(statistics: Array) -> Array:
    """Units of errors, shape (quantities, statistics): largest values of a run, nan of a spread that is not known."""
    yard = np.max(np.abs(statistics), axis=0)
    yard[:2, 1] = yard[:2, 0]
    yard[:, 2] = yard[2, 2] if yard[2, 2] > 0.0 else 1.0
    return yard


_LONG = ("mean shear stress", "bonds over bonds at rest", "energy of the fluctuations per area", "contact radius")
_UNITS = ("Pa", "1", "J/m^2", "m")
_DIMS = ("row", "t", "quantity", "statistic")
#: Unit and meaning of what the dataset has of each row, by attribute.
_OF_ROWS = {
    "part": ("", "what the setting changes"),
    "toml": ("", "lines of the scenario file that choose the setting"),
    "own": ("1", "1 where the scene has this setting as it is written"),
    "time": ("s", "CPU time of the scene's run, median of the repeats"),
    "time_low": ("s", "CPU time of the scene's run, least of the repeats"),
    "time_high": ("s", "CPU time of the scene's run, largest of the repeats"),
    "members": ("1", "members sampled"),
    "clock_step": ("s", "clock step"),
    "value": ("", "sampled statistic, in SI units"),
    "deviation": ("1", "sampled statistic less what is expected, in units of the yardstick"),
    "standard_error": ("1", "standard error of the deviation, in units of the yardstick"),
    "error": ("1", "largest error over the run, in units of the yardstick"),
    "bound": ("1", "what the error is at most, where it is known from samples only, in units of the yardstick"),
}


def _assembled(scenario: Scenario, study: _Study, tolerance: float, left_out: list[str]) -> xr.Dataset:
    """Everything that was found, with units and long names."""
    clock = study.base.clock
    stated = study.walk.steps[study.stated[-1:] if study.pooled else study.stated]
    variables: dict[str, Any] = {"yardstick": (_DIMS[2:], study.yard, {"long_name": "unit of errors, in SI units"})}
    for name, (unit, text) in _OF_ROWS.items():
        values = np.array([getattr(row, name) for row in study.rows])
        dims = _DIMS[:1] + _DIMS[5 - values.ndim :]
        variables[name] = (dims, values, {"long_name": text} | ({"units": unit} if unit else {}))
    coordinates = {
        "row": ("row", [row.label for row in study.rows], {"long_name": "setting"}),
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


def _point(scenario: Scenario) -> str:
    """Which point of a sweep is studied, and how to choose another."""
    if not scenario.sweep:
        return ""
    declared = quantities(scenario)
    keys = [key for axis in scenario.sweep for key in axis.keys]
    at = [f"{key} = {engineering(declared[key][1], declared[key][0].unit)}" if key in declared
          else f"{key} as its table has it" for key in keys]  # fmt: skip
    return f"{', '.join(at)}; choose another point of the sweep by --set {keys[0]}=…"
