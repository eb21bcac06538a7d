"""The dataset of ``sim converge``: every row against its reference, with units and long names."""

import importlib.metadata
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.modal import ModalProcess
from sim.scenario.scenario import Scenario
from sim.study.estimates import STATISTICS, Estimate
from sim.study.exact_law import Expectation, Terms, course
from sim.study.settings import Setting, tolerance_of
from sim.study.stated_times import MOST_WALKED, Moment

Array = NDArray[np.float64]

QUANTITIES = ("fluctuation_energy", "contact_radius")

#: Lines of settings that are not depths, and are judged among themselves where there is no closed form.
_VARIED = ("clock step", "grid")

#: Factor within which the uncertainties of two depths count as equal, so that the deeper is the reference.
_AS_GOOD = 1.5


@dataclass
class Run:
    """One scene to sample, which several settings may share."""

    scenario: Scenario
    ratio: float
    batch: int
    cost: float = 0.0
    members: int = 0
    wall: float = 0.0
    cpu: float = 0.0
    found: dict[tuple[int, int], list[list[Estimate]]] = field(default_factory=dict)


class Laws:
    """What each setting should give, by its own law and by that of what it stands for."""

    def __init__(self, base: Scenario, truth: Terms, moments: list[Moment], chosen: Sequence[Setting]) -> None:
        self._moments = moments
        self._steps = np.array(sorted(set().union(*(moment.needed for moment in moments))))
        refine = max(1, min(16, MOST_WALKED // max(int(self._steps[-1]), 1)))
        self._cell = Expectation(base, truth, course(base, truth, self._steps, refine))
        self._grid = self._cell
        finest = max((setting.points for setting in chosen if setting.line == "grid"), default=0)
        if finest:
            terms = Terms.of_cell(base, 8 * finest)
            self._grid = Expectation(base, terms, course(base, terms, self._steps, refine))
        self._own: dict[int, Expectation | None] = {}

    def reference(self, setting: Setting, number: int) -> Array:
        """Statistics of the truth, shape (2, 6)."""
        moment = self._moments[number]
        stride = moment.stride(setting.ratio)
        law = self._grid if setting.line == "grid" else self._cell
        return law.statistics(moment.step, stride, moment.lags(stride))

    def known(self, setting: Setting, number: int) -> Array:
        """Statistics of what the setting draws, shape (2, 6)."""
        moment = self._moments[number]
        stride = moment.stride(setting.ratio)
        law = self._law(setting)
        if law is None:
            return np.full((len(QUANTITIES), len(STATISTICS)), np.nan)
        step, lag = (round(count / setting.ratio) for count in (moment.step, stride))
        return law.statistics(step, lag, moment.lags(stride))

    def _law(self, setting: Setting) -> Expectation | None:
        if id(setting.scenario) not in self._own:
            terms = Terms.of_process(setting.scenario.process)
            steps = self._steps[self._steps % max(1, round(setting.ratio)) == 0]
            own = np.rint(steps / setting.ratio).astype(np.int64)
            law = None if terms is None else Expectation(setting.scenario, terms, course(setting.scenario, terms, own))
            self._own[id(setting.scenario)] = law
        return self._own[id(setting.scenario)]


@dataclass(frozen=True)
class Filled:
    """Numbers of the dataset, shape (rows, times, quantities, statistics), the first in SI."""

    measured: Array
    value: Array
    reference: Array
    error: Array
    standard_error: Array
    known_error: Array


def filled(chosen: Sequence[Setting], runs: list[Run], moments: list[Moment], laws: Laws) -> Filled:
    """All rows against their references."""
    shape = (len(chosen), len(moments), len(QUANTITIES), len(STATISTICS))
    measured, value, reference, error, sem, known = (np.full(shape, np.nan) for _ in range(6))
    for row, number in np.ndindex(shape[:2]):
        setting, place = chosen[row], (row, number)
        stride = moments[number].stride(setting.ratio)
        exact, found = laws.reference(setting, number), runs[row].found.get((number, stride))
        reference[place] = exact
        for which in np.ndindex(shape[2:]):
            one = found[which[0]][which[1]] if found else None
            peer = _peer(chosen, runs, row, (number, stride), which) if math.isnan(exact[which]) else None
            if peer is not None:
                reference[(*place, *which)] = peer.value
            if one is None:
                continue
            measured[(*place, *which)] = one.value
            if one.value == 0.0 < exact[which] and setting.scenario.varies["contact"]:
                continue  # no spread among members that differ: too few to see it
            if peer is None:
                error[(*place, *which)], sem[(*place, *which)] = one.value - exact[which], one.standard_error
            elif peer is not one:
                error[(*place, *which)], sem[(*place, *which)] = one.less(peer)
        known[place] = laws.known(setting, number) - exact
    yard = _yardsticks(reference)
    value, error, sem, known = (_over(numbers, yard) for numbers in (measured, error, sem, known))
    if not chosen[0].scenario.population.per_member:  # to first order in ΔΓ the radius remembers as long as it does
        follows = np.isfinite(known[..., 1, 0]) & np.isnan(known[..., 1, 5])
        known[..., 1, 5] = np.where(follows, known[..., 0, 5], known[..., 1, 5])
    return Filled(measured, value, _over(reference, yard), error, np.where(np.isnan(error), np.nan, sem), known)


def _peer(
    chosen: Sequence[Setting], runs: list[Run], row: int, at: tuple[int, int], which: tuple[int, ...]
) -> Estimate | None:
    """The best estimate of a statistic among settings of one kind, where there is no closed form."""
    line = chosen[row].line
    kind = [k for k, s in enumerate(chosen) if (s.line == line if line in _VARIED else s.line not in _VARIED)]
    kind = [k for k in kind if at in runs[k].found]
    if line == "clock step" and kind:
        finest = min(chosen[k].ratio for k in kind)
        kind = [k for k in kind if chosen[k].ratio == finest]
    if line == "grid" and kind:
        finest = max(chosen[k].points for k in kind)
        kind = [k for k in kind if chosen[k].points == finest]
    told = [(runs[k].found[at][which[0]][which[1]], _bound(runs[k].scenario)) for k in kind]
    told = [(one, bound) for one, bound in told if math.isfinite(one.standard_error)]
    size = max((abs(one.value) for one, _ in told), default=0.0)
    off = [math.hypot(one.standard_error, bound * size) for one, bound in told]
    good = [one for (one, _), error in zip(told, off, strict=True) if error <= _AS_GOOD * min(off)]
    return good[-1] if good else None


def _bound(scenario: Scenario) -> float:
    """The largest error that a depth is known to make; 1 where it leaves the fluctuations out."""
    process = scenario.process
    if isinstance(process, BandedProcess):
        return max(process.bands.errors.values())
    return 0.0 if isinstance(process, ModalProcess) or not hasattr(scenario.fluctuations, "spectrum") else 1.0


def _yardsticks(reference: Array) -> Array:
    """What errors are relative to, of the shape of the references."""
    yard = np.abs(reference)
    yard[..., 3] = yard[..., 4] = yard[..., 0]
    skewness = yard[..., 0, 2]
    yard[..., 2] = np.where(np.isnan(skewness), 1.0, skewness)[..., np.newaxis]
    return yard


def _over(numbers: Array, yard: Array) -> Array:
    """Numbers in units of the yardsticks; 0 where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = numbers / yard
    found[(numbers == 0.0) & (yard == 0.0)] = 0.0
    return np.where(np.isfinite(found), found, np.nan)


_SHORT = ("mean", "std", "skewness", "quantile_01", "quantile_99", "correlation_time")
_LONG = {"fluctuation_energy": "energy of the fluctuations per area", "contact_radius": "contact radius"}
_UNITS = {"fluctuation_energy": "J/m^2", "contact_radius": "m"}


def assembled(
    scenario: Scenario, chosen: Sequence[Setting], runs: list[Run], moments: list[Moment], numbers: Filled,
    left_out: list[str],
) -> xr.Dataset:  # fmt: skip
    """Everything told, with units and long names."""
    clock, dims = scenario.clock, ("row", "t", "quantity", "statistic")
    variables: dict[str, Any] = {
        name: (dims, getattr(numbers, name), {"units": "1", "long_name": f"{text}, in units of the yardstick"})
        for name, text in (
            ("value", "measured statistic"),
            ("reference", "statistic in closed form, else of the best row of its kind"),
            ("error", "measured statistic less reference"),
            ("standard_error", "standard error of the error"),
            ("known_error", "error known before the run"),
        )
    }
    for (q, quantity), (s, short) in ((q, s) for q in enumerate(QUANTITIES) for s in enumerate(_SHORT)):
        unit = {"skewness": "1", "correlation_time": "s"}.get(short, _UNITS[quantity])
        about = {"units": unit, "long_name": f"{STATISTICS[s]} of the {_LONG[quantity]}, measured"}
        variables[f"{quantity}_{short}"] = (("row", "t"), numbers.measured[:, :, q, s], about)
    process = [setting.scenario.process for setting in chosen]
    along: dict[str, tuple[list[Any], str, str]] = {
        "line": ([s.line for s in chosen], "", "what the row belongs to"),
        "toml": ([s.toml for s in chosen], "", "lines of the scenario file that choose it"),
        "wall_time": ([run.wall for run in runs], "s", "wall time per member-step of its own clock"),
        "cpu_time": ([run.cpu for run in runs], "s", "CPU time per member-step of its own clock"),
        "members": ([run.members for run in runs], "1", "members sampled; 0 where the budget was too small"),
        "clock_step": ([s.scenario.clock.step for s in chosen], "s", "clock step"),
        "tolerance": ([s.tolerance for s in chosen], "1", "tolerance of the bands"),
        "points": ([s.points for s in chosen], "1", "points of the grid along a side, 0 for the default"),
        "terms": ([_terms(p) for p in process], "1", "bands or mode pairs"),
        "cell_error_energy": (
            [p.known_errors().get("cell_error_energy", math.nan) for p in process],
            "1",
            "mean energy of the cell over that of the infinite plane, less 1: not part of the errors",
        ),
    }
    for name, (values, unit, text) in along.items():
        variables[name] = ("row", values, {"long_name": text} | ({"units": unit} if unit else {}))
    coordinates = {
        "row": ("row", [s.label for s in chosen], {"long_name": "setting"}),
        "t": ("t", [clock.time(m.step) for m in moments], {"units": "s", "long_name": "time of the statistics"}),
        "quantity": ("quantity", list(QUANTITIES), {"long_name": "quantity"}),
        "statistic": ("statistic", list(STATISTICS), {"long_name": "statistic", "comment": _YARDSTICKS}),
    }
    found = xr.Dataset(variables, coordinates, _attributes(scenario, moments, left_out))
    found["t"].encoding["_FillValue"] = None  # the conventions allow a coordinate none
    return found


_YARDSTICKS = (
    "the yardstick of mean, standard deviation and correlation time is the reference's own value, of quantiles its "
    "mean, of skewness the skewness of the energy, or 1 where that has none"
)


def _terms(process: Any) -> int:
    return int(process.bands.weight.size) if isinstance(process, BandedProcess) else int(process.pairs)


def _attributes(scenario: Scenario, moments: list[Moment], left_out: list[str]) -> dict[str, Any]:
    clock, moment = scenario.clock, moments[0]
    version = importlib.metadata.version("sliding-sim")
    said = ["standard errors by the delta method over members"]
    if moment.pooled:
        said.append(
            f"the scene is stationary: {len(moment.ends)} times up to {clock.time(moment.step):.4g} s are pooled"
        )
    if scenario.sweep:
        said.append("the sweep is left out: every value is that of its own table")
    return {
        "Conventions": "CF-1.11",
        "title": f"speed against error: {scenario.name}",
        "history": f"sim converge; sliding-sim {version}",
        "sim_version": version,
        "seed": str(scenario.seed),
        "model": scenario.shear.model,
        "asked_tolerance": tolerance_of(scenario),
        "clock_step": clock.step,
        "comment": "; ".join(said),
        "left_out": "\n".join(left_out),
    }
