"""Tables of measured points beside a run, and of a fit of its scenario."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sim.analysis import concise, engineering, setting, sweep_dims
from sim.plots.measured import Measured, Residuals
from sim.units.notation import scaled
from sim.units.refusals import BadInput

Rows = list[dict[str, str]]

#: Relative difference below which a number of the run equals that of the fit.
_SAME = 1e-6


class Fit(NamedTuple):
    """The result of ``sim fit`` as tables of its numbers and of their correlations, with notes.

    ``freedom`` is the number of degrees of freedom of its chi^2; ``in_run`` is true if the run has the fitted numbers.
    """

    rows: Rows
    correlations: Rows
    notes: list[str]
    freedom: int
    in_run: bool


class Agreement(NamedTuple):
    """Agreement of measured points with a run: one row a curve and one for all, or the reason why there is none."""

    rows: Rows
    lacks: str = ""


def agreement(dataset: xr.Dataset, drawn: list[Measured], fit: Fit | None = None) -> Agreement:
    """Return the agreement of measured points with the curves of the figure that shows most of them.

    Parameters
    ----------
    dataset : xarray.Dataset
        The run.
    drawn : list of Measured
        The points of each figure, at least one.
    fit : Fit, optional
        A fit. Its numbers are subtracted from the degrees of freedom if the run has them and it is of these points.

    Returns
    -------
    Agreement
        chi^2 sums the squares of the distances in standard errors of point and curve; p is the probability of a chi^2
        at least as large if only these errors separate them.
    """
    curves = max((_by_curve(measured) for measured in drawn), key=lambda curves: sum(map(_count, curves)))
    if not curves:
        keys = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]
        lacks = "no curve of the run reaches the measured points, or the curve has several branches"
        if not {*keys} <= {*drawn[0].table}:
            lacks = f"the run has several curves; give the points a column {keys[0]}, or choose one curve by --where"
        if not drawn[0].has_errors:
            lacks = "the measured points have no errors; give them in a column such as contact_area_error"
        return Agreement([], lacks)
    rows = [_row(_label(dataset, curve), [curve]) for curve in curves]
    freedom = sum(map(_count, curves))
    fitted = len(fit.rows) if fit and fit.in_run and freedom - len(fit.rows) == fit.freedom else 0
    if len(curves) > 1 or fitted:
        rows.append(_row(f"all, {fitted} numbers fitted" if fitted else "all", curves, fitted))
    return Agreement(rows)


def _by_curve(measured: Measured) -> list[Residuals]:
    """Return the residuals of each variable and curve once, for curves of one branch."""
    residuals = {(each.name, each.number): each for each in reversed(measured.residuals) if each.branches == 1}
    return list(reversed(residuals.values()))


def _count(residuals: Residuals) -> int:
    return int(np.sum(np.isfinite(residuals.values)))


def _label(dataset: xr.Dataset, residuals: Residuals) -> str:
    """Return a variable with the swept values of its curve."""
    texts = []
    for name, place in residuals.point.items():
        value = dataset[name][place]
        number = engineering(value.item(), value.attrs.get("units", "1")) if value.dtype.kind in "fi" else value.item()
        texts += [f"{name.replace('_', ' ')} {number}"] if dataset.sizes[name] > 1 else []
    return residuals.name.replace("_", " ") + (f" ({', '.join(texts)})" if texts else "")


def _row(words: str, curves: list[Residuals], fitted: int = 0) -> dict[str, str]:
    """Return a row of the table; ``fitted`` numbers are subtracted from the degrees of freedom."""
    from scipy.special import chdtrc  # heavy: for measured points alone

    square = sum(float(np.nansum(np.square(curve.values))) for curve in curves)
    freedom = sum(map(_count, curves)) - fitted
    p = f"{chdtrc(freedom, square):.2g}" if freedom > 0 else "–"
    beyond = sum(curve.values.size - _count(curve) for curve in curves)
    row = {"measured": words, "χ²": f"{square:.4g}", "degrees of\nfreedom": str(freedom), "p": p}
    return row | {"points beyond\nthe curve": str(beyond)}


def fit_of(path: Path, dataset: xr.Dataset) -> Fit:
    """Read ``<stem>_fit.json``, which ``sim fit`` wrote.

    Raises
    ------
    BadInput
        If the file cannot be read or is no such file.
    """
    try:
        return _read(json.loads(path.read_text(encoding="utf-8")), dataset)
    except OSError as fault:
        raise BadInput([f"{path}: cannot be read ({fault.strerror}); name the file STEM_fit.json"]) from None
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError):
        raise BadInput([f"{path}: is no result of `sim fit`; name the file STEM_fit.json that it wrote"]) from None


def _read(content: dict[str, Any], dataset: xr.Dataset) -> Fit:
    rows, in_run = [], []
    for key, number in content["numbers"].items():
        unit, value, error = str(number["unit"]), float(number["value"]), _known(number["standard_error"])
        factor, shown = scaled(value, unit)
        low, high = (_end(factor * _known(number[end]), bool(number[f"{end}_open"])) for end in ("low", "high"))
        run = _in_run(dataset, key)
        rows.append({
            "key": key,
            "fitted": f"{concise(factor * value, factor * error)} {shown}".rstrip(),
            f"{float(content['level']):.0%} interval": f"{low} to {high}",
            "start": engineering(float(number["start"]), unit),
            "in this run": "–" if math.isnan(run) else engineering(run, unit),
        })  # fmt: skip
        in_run.append(abs(run - value) <= _SAME * abs(value))
    keys, matrix = content["correlations"]["keys"], content["correlations"]["matrix"]
    correlations = [
        {"correlation": key, **{other: _number(matrix[k][n]) for n, other in enumerate(keys)}}
        for k, key in enumerate(keys)
    ]
    freedom, square = int(content["degrees_of_freedom"]), float(content["chi_square"])
    notes = [f"fit to {', '.join(map(str, content['data']))}: χ² {square:.4g} at {freedom} degrees of freedom"]
    notes += [] if content["converged"] is True else ["the fit has not converged"]
    notes += [] if all(in_run) else ["this run has other numbers than the fit: run its scenario STEM_fit.toml"]
    if not rows:
        raise ValueError
    few = correlations if len(keys) > 1 else []
    return Fit(rows, few, [*notes, *map(str, content["remarks"])], freedom, all(in_run))


def _in_run(dataset: xr.Dataset, key: str) -> float:
    """Return a number of the run's scenario; nan if it has none or several."""
    try:
        return float(setting(dataset, key).item())
    except (KeyError, ValueError):
        return math.nan


def _known(value: Any) -> float:
    return math.nan if value is None else float(value)


def _number(value: Any) -> str:
    return "–" if value is None else f"{float(value):.2f}".replace("-", "−")


def _end(end: float, is_open: bool) -> str:
    """Return an end of an interval; "(bound)" if the bound of the key sets it, "unknown" if nothing does."""
    return "unknown" if math.isnan(end) else f"{end:.4g}" + (" (bound)" if is_open else "")
