"""Measured points beside a run, and a fit of its scenario: tables, and a sentence on whether points and run agree."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sim.analysis import concise, engineering, setting, sweep_dims
from sim.numerics.files import read_whole
from sim.plots.measured import Measured, Residuals
from sim.plots.style import swept_value
from sim.report.figures import plain_text
from sim.report.sentences import TIE
from sim.units.notation import scaled
from sim.units.refusals import BadInput

Rows = list[dict[str, str]]

#: Probability of a chi^2 as large or larger up to which points and run do not agree, and above which they do too well.
_APART, _TOO_NEAR = 0.05, 0.999
#: Two numbers are the same within this part of them: values of a fit as its scenario has them.
_SAME = 1e-6
#: Longest file of a fit that is read [byte], most numbers that are shown of it, and longest key.
_LONGEST, _MOST, _NAME = 2**20, 20, 80


class Fitted(NamedTuple):
    """What ``sim fit`` has found: its numbers and their correlations in rows, the former in a sentence, how many.

    ``freedom`` is that of its chi^2; ``here`` is true if the run has these numbers.
    """

    rows: Rows
    correlations: Rows
    said: str
    notes: list[str]
    size: int
    freedom: int
    here: bool


class Agreement(NamedTuple):
    """How far measured points are from a run: a row for each curve and one for all, and a sentence."""

    rows: Rows
    said: str


def agreement(dataset: xr.Dataset, drawn: list[Measured], fitted: Fitted | None = None) -> Agreement:
    """Agreement of measured points with the curves of the figure that shows most of them.

    Parameters
    ----------
    dataset : xarray.Dataset
        The run.
    drawn : list of Measured
        The points as each figure has them, at least one.
    fitted : Fitted, optional
        A fit; if it is of as many points, and the run has its numbers, they are taken from the degrees of freedom.

    Returns
    -------
    Agreement
        chi^2 sums the squares of the distances in standard errors of both, points and curve; p is the probability of
        one as large or larger if they differ by these errors alone.
    """
    found = max((_by_curve(measured) for measured in drawn), key=lambda curves: sum(map(_count, curves)))
    if not found:
        several = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]
        why = "no curve of the run reaches them, or it goes there and back"
        if not {*several} <= {*drawn[0].table}:
            why = f"the run has several curves; give the points a column {several[0]}, or choose one curve by --where"
        if not drawn[0].has_errors:
            why = "they have no errors; give them in a column such as contact_area_error"
        return Agreement([], f"How far the measured points are from the run cannot be told: {why}.")
    rows = [_row(_of(dataset, one), _square(one), _count(one)) for one in found]
    square, count = sum(map(_square, found)), sum(map(_count, found))
    less = fitted.size if fitted and fitted.here and count - fitted.size == fitted.freedom else 0
    if len(found) > 1 or less:
        rows.append(_row(f"all, {less} numbers fitted" if less else "all", square, count - less))
    p = _probability(square, count - less)
    beyond = sum(one.values.size - _count(one) for one in found)
    number = f"χ² is {square:.4g} for {count - less} degrees of freedom, p{TIE}{_share(p, f'={TIE}')}"
    number += f"; {beyond} further values lie beyond the curves" if beyond else ""
    if p > _APART:
        near = ", nearer than such errors let expect: they may be too large" if p > _TOO_NEAR else ""
        return Agreement(rows, f"Measured points and simulation agree within their errors{near}: {number}.")
    worst = max(found, key=lambda one: _square(one) / _count(one))
    where = f"; farthest from it is {_of(dataset, worst)}" if len(found) > 1 else ""
    return Agreement(rows, f"Measured points and simulation do not agree: {number}{where}.")


def _by_curve(measured: Measured) -> list[Residuals]:
    """The distances of points from each curve of each variable, once, where it is of one branch."""
    found = {(one.name, one.number): one for one in reversed(measured.residuals) if one.branches == 1}
    return list(reversed(found.values()))


def _square(one: Residuals) -> float:
    return float(np.nansum(np.square(one.values)))


def _count(one: Residuals) -> int:
    return int(np.sum(np.isfinite(one.values)))


def _of(dataset: xr.Dataset, one: Residuals) -> str:
    """A variable with the point of the sweep that the curve is of, in words."""
    several = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1 and name in one.point]
    where = ", ".join(plain_text(swept_value(dataset, name, one.point[name])) for name in several)
    return f"{one.name.replace('_', ' ')}{f' ({where})' if where else ''}"


def _row(words: str, square: float, freedom: int) -> dict[str, str]:
    p = _share(_probability(square, freedom))
    return {"measured": words, "χ²": f"{square:.4g}", "degrees of\nfreedom": str(freedom), "p": p}


def _probability(square: float, freedom: int) -> float:
    """Probability of a chi^2 as large or larger."""
    from scipy.special import chdtrc  # heavy: for measured points alone

    return float(chdtrc(freedom, square)) if freedom > 0 else math.nan


def _share(p: float, sign: str = "") -> str:
    return "–" if math.isnan(p) else f"{sign}{p:.2g}" if p >= 1e-99 else "below 1e-99"


def fit_of(path: Path, dataset: xr.Dataset) -> Fitted:
    """What ``sim fit`` has written to ``<stem>_fit.json``.

    Raises
    ------
    BadInput
        If it is no such file.
    """
    try:
        if path.stat().st_size > _LONGEST:
            raise ValueError
        return _read(json.loads(read_whole(path)), dataset)
    except OSError as fault:
        raise BadInput([f"{path}: cannot be read ({fault.strerror}); name the file STEM_fit.json"]) from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
        raise BadInput([f"{path}: is no result of `sim fit`; name the file STEM_fit.json that it wrote"]) from None


def _read(told: dict[str, Any], dataset: xr.Dataset) -> Fitted:
    rows, said, here = [], [], []
    for name, one in list(told["numbers"].items())[:_MOST]:
        key = str(name)[:_NAME]
        unit, value, error = str(one["unit"]), float(one["value"]), _known(one["standard_error"])
        factor, shown = scaled(value, unit)
        text = f"{concise(factor * value, factor * error)} {shown}".rstrip()
        low, high = (_end(factor * _known(one[name]), bool(one[f"{name}_open"])) for name in ("low", "high"))
        row = {"key": key, "fitted": text, f"{float(told['level']):.0%} interval": f"{low} to {high}"}
        run = _of_run(dataset, key)
        rows.append(row | {"start": engineering(float(one["start"]), unit), "in this run": "–"})
        if not math.isnan(run):
            rows[-1]["in this run"] = engineering(run, unit)
        said.append(f"{key} = {text.replace(' ', TIE)}")
        here.append(abs(run - value) <= _SAME * abs(value))
    keys, matrix = told["correlations"]["keys"][:_MOST], told["correlations"]["matrix"]
    correlations = [
        {"correlation": str(key)[:_NAME], **{str(other)[:_NAME]: _number(matrix[k][n]) for n, other in enumerate(keys)}}
        for k, key in enumerate(keys)
    ]
    freedom, square = int(told["degrees_of_freedom"]), float(told["chi_square"])
    notes = [f"fit to {', '.join(map(str, told['data']))}: χ² {square:.4g} at {freedom} degrees of freedom"]
    notes += [] if told["converged"] is True else ["the fit has not converged"]
    notes += [] if all(here) else ["this run has other numbers than the fit: run its scenario STEM_fit.toml"]
    words = f"The fit gives {', '.join(said)}."
    few = correlations if len(keys) > 1 else []
    if not rows:
        raise ValueError
    return Fitted(rows, few, words, [*notes, *map(str, told["remarks"][:_MOST])], len(rows), freedom, all(here))


def _of_run(dataset: xr.Dataset, key: str) -> float:
    """A number of the run's scenario; nan where it has none or several."""
    try:
        return float(setting(dataset, key).item())
    except (KeyError, ValueError):
        return math.nan


def _known(value: Any) -> float:
    return math.nan if value is None else float(value)


def _number(value: Any) -> str:
    return "–" if value is None else f"{float(value):.2f}".replace("-", "−")


def _end(end: float, is_open: bool) -> str:
    """One end of an interval, which the data, a bound or nothing sets."""
    return "unknown" if math.isnan(end) else f"{end:.4g}" + (" (bound)" if is_open else "")
