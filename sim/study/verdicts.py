"""Findings of ``sim converge`` in words: a table for the terminal, its explanation and a recommendation.

Everything is read from the dataset.
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from sim.analysis import engineering

Array = NDArray[np.float64]

#: Standard errors by which a sample differs from what is expected for a reason other than chance.
_DIFFERS = 5.0
#: Errors and differences below this are of the closed forms, which stand for distributions by a few values.
_SMALL = 2e-3
#: Errors below this are roundings.
_ROUNDING = 1e-9

_SHORT = ("mean", "spread", "skewness", "correlation time")
_CELLS = ("mean", "spread", "skew", "memory")
_SYMBOLS = ("stress", "bonds", "ΔΓ", "radius")
_OF = ("the shear stress", "the bond fraction", "ΔΓ", "the radius")


class Largest(NamedTuple):
    """The largest of some errors and what it is of; nan where none is known."""

    error: float
    quantity: int
    statistic: int

    def __str__(self) -> str:
        if not self.error > _ROUNDING:
            return "0 %"
        return f"{percent(self.error)} ({_SHORT[self.statistic]} of {_OF[self.quantity]})"


def largest(errors: Array) -> Largest:
    """The largest of errors of shape (quantities, statistics)."""
    if not np.any(np.isfinite(errors)):
        return Largest(math.nan, 0, 0)
    quantity, statistic = np.unravel_index(int(np.nanargmax(errors)), errors.shape)
    return Largest(float(errors[quantity, statistic]), int(quantity), int(statistic))


def percent(error: float) -> str:
    """Percentage of a relative error, two digits.

    >>> print(percent(0.0123), percent(2e-6), percent(0.0), percent(1.0))
    1.2 % 0.0002 % 0 % 100 %
    """
    return f"{float(f'{100.0 * error:.2g}'):.4g} %" if error > _ROUNDING else "0 %"


def differing(dataset: xr.Dataset) -> NDArray[np.bool_]:
    """True where a sample differs from what is expected, for whatever reason but chance; shape as ``deviation``."""
    off = np.abs(dataset["deviation"].to_numpy()) - _SMALL
    return off > _DIFFERS * dataset["standard_error"].to_numpy()


def _wrong(dataset: xr.Dataset) -> NDArray[np.bool_]:
    """Rows of which a sample differs from a law."""
    lawful = np.isnan(dataset["bound"].to_numpy()[:, np.newaxis])
    return np.any(differing(dataset) & lawful, axis=(1, 2, 3))


def table(dataset: xr.Dataset) -> list[dict[str, str]]:
    """A row for each setting, for the terminal; ``explanation`` says what its columns are.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.converge.converge`` gives it.

    Returns
    -------
    list of dict
        Cells by heading.
    """
    shown = np.flatnonzero(np.isfinite(dataset["error"].to_numpy()).any(axis=(0, 2)))
    rows = []
    for row, wrong in enumerate(_wrong(dataset)):
        here = dataset.isel(row=row)
        cells = {"changed": str(here["part"].values), "setting": str(here["row"].values) + " *" * int(here["own"])}
        cells["time of the run"] = _time(*(float(here[name]) for name in ("time", "time_low", "time_high")))
        for q in shown:
            cells[f"{_SYMBOLS[q]}\n(%)"] = _error_cell(here["error"].to_numpy()[q], here["bound"].to_numpy()[q])
        members = int(here["members"])
        cells["members\nsampled"] = f"{members:,}" if members else "–"
        cells["sample"] = "DIFFERS" if wrong else "agrees" if members else "–"
        rows.append(cells)
    return rows


def _error_cell(errors: Array, bounds: Array) -> str:
    """The largest error of a quantity in percent, or its bound, with its statistic unless that is the mean."""
    found = largest(np.fmax(errors, bounds)[np.newaxis])
    if math.isnan(found.error):
        return "–"
    size = percent(found.error).removesuffix(" %")
    of = "" if found.statistic == 0 or size == "0" else f" {_CELLS[found.statistic]}"
    return ("≤ " if np.isfinite(bounds[found.statistic]) and size != "0" else "") + size + of


def _time(median: float, low: float, high: float) -> str:
    """A time with the range of its repeats, all in one unit.

    >>> print(_time(0.0123, 0.012, 0.014))
    12 (12–14) ms
    """
    factor, unit = (1e3, "ms") if median < 0.1 else (1.0, "s")
    first, second, third = (f"{float(f'{factor * each:.2g}'):.4g}" for each in (median, low, high))
    return f"{first} ({second}–{third}) {unit}"


def explanation(dataset: xr.Dataset) -> str:
    """Subject of the study, and what the columns of the table are, in sentences."""
    members, steps = int(dataset.attrs["members_of_run"]), int(dataset.attrs["steps"])
    run = f"{members:,} member{'s' if members > 1 else ''}, {steps:,} steps of {_step(dataset.attrs['clock_step'])}"
    said = [f"Studied: {dataset.attrs['point']}."] if dataset.attrs["point"] else []
    said += [
        "Each row changes one thing of the scene; * is what the scene has.",
        f"time of the run: CPU time of the whole run ({run}) on one core, median and range of five repeats.",
        "stress, bonds, ΔΓ, radius: largest error over the run in percent, of the mean unless said otherwise: of means "
        "in units of the largest mean, of the spread (standard deviation) and the skewness over members in units of "
        "their own largest value, memory that of the correlation time. Most are known from closed forms and runs "
        "without noise; ≤ marks those that only samples show, with two standard errors added.",
        "sample: whether the members sampled are what is expected, within five standard errors; if one DIFFERS, the "
        "program is at fault.",
    ]
    if dataset.attrs["left_out"]:
        said.append("Left out: " + "; ".join(dataset.attrs["left_out"].split("\n")) + ".")
    return "\n".join(said)


def _step(seconds: float) -> str:
    return engineering(float(f"{seconds:.4g}"), "s")


class Choice(NamedTuple):
    """One row of each part, that of the clock step last, with the time of the run and the errors of them together."""

    rows: tuple[int, ...]
    time: float
    low: float
    high: float
    error: Array
    bound: Array

    @property
    def off(self) -> float:
        """The largest error, by which combinations are chosen."""
        return float(np.nanmax(self.error, initial=0.0))


def choices(dataset: xr.Dataset) -> list[Choice]:
    """All combinations of one setting a part, that of the scene first.

    Errors add up, and so does what each change adds to the time of a step; clock steps multiply it.
    """
    part, own = dataset["part"].to_numpy(), dataset["own"].to_numpy().astype(bool)
    error = np.nan_to_num(dataset["error"].to_numpy())
    bound = np.fmax(error, dataset["bound"].to_numpy())
    kinds = [np.flatnonzero(part == kind) for kind in ("shear", "bonds", "grid", "step")]
    groups = [sorted(rows.tolist(), key=lambda row: not own[row]) for rows in kinds if rows.size]
    median, low, high = (dataset[name].to_numpy() for name in ("time", "time_low", "time_high"))
    written, found = float(median[groups[-1][0]]), []
    for rows in itertools.product(*groups):
        *changed, step = median[list(rows)].tolist()
        summed = written + sum(time - written for time in changed)
        time = max(summed, 0.2 * min([written, *changed])) * (step / written)
        timed = [row for row in rows if not own[row]] or [rows[-1]]
        ends = float(time * np.min((low / median)[timed])), float(time * np.max((high / median)[timed]))
        found.append(Choice(rows, time, *ends, error[list(rows)].sum(axis=0), bound[list(rows)].sum(axis=0)))
    return found


def chosen(tried: list[Choice], tolerance: float) -> tuple[Choice, int]:
    """The combination to take, and of how many that take as long; the nearest and 0 where none keeps the tolerance."""
    good = [choice for choice in tried if choice.off <= tolerance * (1.0 + 1e-9)]
    if not good:
        return min(tried, key=lambda choice: choice.off), 0
    cheapest = min(good, key=lambda choice: choice.time)
    equal = [choice for choice in good if choice.low <= cheapest.high]
    return min(equal, key=lambda choice: choice.off), len(equal)


def recommendation(dataset: xr.Dataset) -> str:
    """The cheapest combination that keeps the accepted error, in words and with the lines to write.

    Of combinations whose ranges of time overlap the most accurate is taken.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.converge.converge`` gives it.
    """
    tolerance = float(dataset.attrs["tolerance"])
    tried = choices(dataset)
    own, (best, equal) = tried[0], chosen(tried, tolerance)
    named, off = f"“{', '.join(dataset['row'].values[list(best.rows)])}”", f"off by at most {largest(best.error)}"
    if equal:
        same = f"; {equal - 1} more take as long within the spread of the times, this is the most accurate"
        cost = f"{_time(best.time, best.low, best.high)} of CPU time{same if equal > 1 else ''}"
        it = "It" if best is own else named
        verdict = f"{it} is the cheapest combination that keeps {percent(tolerance)}: {off}, {cost}."
    else:
        shorter = _shorter(dataset, best, tolerance)
        verdict = f"No combination keeps {percent(tolerance)}: {named} comes nearest, {off}. {shorter}".rstrip()
    text = "\n".join([_as_written(dataset, own), verdict, _sight(dataset, best)])
    return text if best is own else f"{text}\nWrite:\n\n{_toml(dataset, best, own)}"


#: Names of what a setting changes.
PARTS = {"shear": "shear model", "bonds": "bond model", "grid": "grid", "step": "clock step"}
#: Tables of the scenario file that hold what the parts of another name change.
_TABLES = {"grid": "shear", "step": "clock"}


def _as_written(dataset: xr.Dataset, own: Choice) -> str:
    """Error of the scene as it is, and what it comes from."""
    found = largest(own.error)
    if not found.error > _ROUNDING:
        return "As it is written the scene is exact: nothing in it errs by its models, its clock step or its grid."
    shares = dataset["error"].to_numpy()[list(own.rows), found.quantity, found.statistic]
    parts = [PARTS[str(dataset["part"].values[row])] for row in own.rows]
    ordered = sorted(zip(shares, parts, strict=True), key=lambda share: -np.nan_to_num(share[0]))
    of = ", ".join(f"{percent(share)} by its {part}" for share, part in ordered if share > _ROUNDING)
    return f"As it is written the scene is off by at most {found}: {of}."


def _shorter(dataset: xr.Dataset, chosen: Choice, tolerance: float) -> str:
    """Advice on a step where the finest that was tried does not."""
    step = chosen.rows[-1]
    errors = dataset["error"].to_numpy()[step]
    if not np.nanmax(errors, initial=0.0) > 0.5 * tolerance:
        return ""
    guess = float(f"{float(dataset['clock_step'][step]) * 0.5 * tolerance / float(np.nanmax(errors)):.1g}")
    return f"The clock step rules: by its trend about {_step(guess)} would do; a larger budget tries it."


def _sight(dataset: xr.Dataset, best: Choice) -> str:
    """Resolution of the samples."""
    wrong, sem = dataset["row"].to_numpy()[_wrong(dataset)], dataset["standard_error"].to_numpy()
    if wrong.size:
        return f"Beware: samples of {', '.join(map(str, wrong))} are not what is expected: a fault of the program."
    if not np.any(np.isfinite(sem)) and not dataset.attrs["fluctuates"]:
        return "Nothing fluctuates here; there is nothing to sample."
    if not np.any(np.isfinite(sem)):
        return "The budget is too small for samples."
    open_ = largest(np.where(best.bound > best.error * (1.0 + 1e-9), best.bound, np.nan))
    if open_.error > 0.0:
        return f"Where there is no law, samples leave errors of up to {open_} open; a larger budget narrows that."
    quantity = 3 if np.any(np.isfinite(sem[:, :, 3])) else 1
    least = np.where(sem > 0.0, sem, -np.inf)[:, :, quantity].max(axis=1)
    least = np.where(least > 0.0, least, np.inf).min(axis=0)
    seen = [f"the {name} to {percent(2.0 * size)}" for name, size in zip(_SHORT, least, strict=True) if size < math.inf]
    sight = f"{_OF[quantity]} is {', '.join(seen)} in the row that was sampled best"
    return f"Measured differences are all below what this budget can see, which of {sight}."


def _toml(dataset: xr.Dataset, chosen: Choice, own: Choice) -> str:
    """Lines to write into the scenario file."""
    tables: dict[str, list[str]] = {}
    for row, before in zip(chosen.rows, own.rows, strict=True):
        if row != before:
            part = str(dataset["part"].values[row])
            tables.setdefault(_TABLES.get(part, part), []).append(str(dataset["toml"].values[row]))
    return "\n\n".join("\n".join([f"[{name}]", *lines]) for name, lines in tables.items())
