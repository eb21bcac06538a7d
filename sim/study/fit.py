"""Numbers of a scenario calibrated to measured curves: ``sim fit``.

The curves are fitted by steady sliding, which is quick (``sim.study.likelihood``). Then the scenario's own models run
once with what was found; what they add to steady sliding is added to it, with the error that their members leave, and
the fit is made anew, until it stays. The same noise is drawn each time. Where steady sliding does not depend on a key
that is free, such as the speed of an edge that lags, or what slides feels its friction, every prediction is a run.
"""

import contextlib
import copy
import difflib
import io
import itertools
import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.special import chdtrc

from sim.ensemble.dataset import scenario_json
from sim.numerics import files
from sim.plots.style import BOTH, GUIDE, HOLLOW, REFERENCE, STYLE, Unit, across, axis_scale, in_units, legend, rows
from sim.scenario.files import parse, written
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read, quantities
from sim.scenario.sweep import set_key
from sim.study.likelihood import (
    HELD,
    LEVEL,
    Free,
    Interval,
    Measured,
    Minimum,
    Problem,
    entangled,
    groups,
    idle,
    interval,
    problem_of,
    read,
    with_errors,
)
from sim.study.mechanisms import WHOLE, Verdict, compare
from sim.units.errors import BadInput
from sim.units.notation import concise, engineering, scaled
from sim.units.quantity import Quantity, read_option

Array = NDArray[np.float64]

#: Factor by which a number that is fitted in its logarithm may change at most, where no bounds are given.
_WIDE = 1e4
#: The same of bounds that are given as an example.
_USUAL = 100.0
#: Most runs of the scenario's own models, and the change of every number, over its error, that ends them.
_RUNS, _STAYS = 3, 0.1
#: Correlation beyond which the data hardly tell two numbers apart.
_ALIKE = 0.95
#: Start of another search, over an e-fold or the range of a number; and most rows that are named.
_BESIDE, _NAMED = 0.5, 3
#: Probability of a chi^2 as large below which a fit is doubted.
POOR = 0.05
#: Ratio of measured and fitted values beyond which a unit is asked for.
_OTHER_UNIT = 100.0
#: Tables of keys that are not physical.
_OTHER = ("clock", "record", "ensemble", "seed")


class Found(NamedTuple):
    """Estimate of one free number [SI]: its value, standard error and interval, and its value in steady sliding."""

    free: Free
    value: float
    error: float
    interval: Interval
    steady: float


class Fit(NamedTuple):
    """A calibrated scenario.

    ``scenario`` has the ``numbers`` found; ``problem`` and ``best`` are the curves and where they agree best;
    ``correlations`` those of the free numbers; ``remarks`` what to know of them.
    """

    scenario: Scenario
    problem: Problem
    best: Minimum
    numbers: tuple[Found, ...]
    correlations: Array
    converged: bool
    remarks: tuple[str, ...]

    @property
    def aicc(self) -> float:
        """Akaike's criterion for few points."""
        return self.problem.criterion(self.best.chi_square)

    @property
    def p_value(self) -> float:
        """Probability of a chi^2 as large or larger; nan where the errors were not measured."""
        return _likely(self.problem, self.best)

    @property
    def values(self) -> dict[str, float]:
        """Values of the free keys [SI]."""
        return {item.free.key: item.value for item in self.numbers}


def fit(
    scenario: Scenario, data: Sequence[Path], free: Iterable[str], common: dict[str, float] | None = None,
    steady: bool = False,
) -> Fit:  # fmt: skip
    """Find numbers of a scenario from measured curves.

    Parameters
    ----------
    scenario : Scenario
        Its own values are where the search starts; without its sweep.
    data : sequence of Path
        CSV tables (``sim.study.likelihood.read``), all fitted together.
    free : iterable of str
        Keys, each ``"KEY"`` or ``"KEY=LOW:HIGH"`` with bounds such as ``"1 mm/s:100 mm/s"``.
    common : dict, optional
        Relative errors that all points of a variable share, as of one lens or one camera.
    steady : bool
        Whether steady sliding is enough, so that the scenario's own models are not run.

    Raises
    ------
    BadInput
        If a key is none that can be found, a table cannot be read, or the curves depend on some keys only together.
    """
    base = scenario.with_values({"record": {}})
    chosen = [_free(base, text) for text in free]
    if len({item.key for item in chosen}) < len(chosen):
        raise BadInput(["--free: a key is there twice; give each once"])
    tables = [read(path, base) for path in data]
    problem = problem_of(tables, [groups(base, table) for table in tables], chosen, common or {})
    if steady and base.drive.solves_motion:
        raise BadInput(
            [f'--steady: drive.model = "{base.drive.model}" is answered by its own runs alone; leave it out']
        )
    if base.drive.solves_motion or (not steady and idle(problem)):
        problem = replace(problem, by_run=True).compared(problem.start)
    _refuse_entangled(problem)
    problem, best = _searched(problem)
    alone, converged = best, best.converged
    for _ in range(0 if steady or problem.by_run else _RUNS):
        before = best.x
        problem, best = with_errors(problem.compared(best.x), best.x)
        if best.covariance is None or np.all(np.abs(best.x - before) < _STAYS * np.sqrt(np.diag(best.covariance))):
            break
    else:
        converged = (steady or problem.by_run) and converged
    return _assembled(scenario, problem, best, alone, converged and best.converged)


def _searched(problem: Problem) -> tuple[Problem, Minimum]:
    """The minimum near the scenario's own values; a poor one is sought from both sides of it, by each free number, too.

    A contact that is open has no slope that would lead out of there.
    """
    minima = [with_errors(problem, problem.start)]
    if not problem.by_run and (_poor(*minima[0]) or _open(*minima[0]).size):
        for k, item in enumerate(problem.free):
            for sign in (-1.0, 1.0):
                beside = minima[0][1].x.copy()
                beside[k] += sign * _BESIDE * item.width
                minima.append(with_errors(problem, beside))
    return min(minima, key=lambda item: item[0].criterion(item[1].chi_square))


def _likely(problem: Problem, best: Minimum) -> float:
    known = problem.freedom > 0 and not problem.estimated.any()
    return float(chdtrc(problem.freedom, best.chi_square)) if known else math.nan


def _poor(problem: Problem, best: Minimum) -> bool:
    """Return True if the curves lie further off than their errors."""
    freedom = problem.freedom
    return bool(freedom > 0 and best.chi_square > freedom + 4.0 * math.sqrt(2.0 * freedom))


def _open(problem: Problem, best: Minimum) -> NDArray[np.int64]:
    """Measured numbers at which the contact is open by the fit, and was not."""
    return np.flatnonzero((problem.predicted(best.x) == 0.0) & (np.abs(problem.values) > 3.0 * problem.sigma))


def _assembled(scenario: Scenario, problem: Problem, best: Minimum, alone: Minimum, converged: bool) -> Fit:
    """The fit with its intervals, and what to know of it."""
    count = len(problem.free)
    if best.covariance is None:
        message = ("the errors could not be found: the data do not hold some of the numbers",)
        none = Interval(math.nan, math.nan, True, True)
        numbers = [Found(item, item.outer(float(best.x[k])), math.nan, none, item.outer(float(alone.x[k])))
                   for k, item in enumerate(problem.free)]  # fmt: skip
        return Fit(scenario, problem, best, tuple(numbers), np.full((count, count), np.nan), False, message)
    spread = np.sqrt(np.diag(best.covariance))
    estimates = []
    for k, item in enumerate(problem.free):
        value = item.outer(float(best.x[k]))
        error = spread[k] * (value if item.logarithmic else 1.0)
        estimates.append(Found(item, value, float(error), interval(problem, best, k), item.outer(float(alone.x[k]))))
    alike = (best.covariance / np.outer(spread, spread))[:count, :count]
    final = scenario.with_values({item.free.key: item.value for item in estimates})
    return Fit(
        final, problem, best, tuple(estimates), alike, converged, tuple(_remarks(problem, best, estimates, alike))
    )


def _remarks(problem: Problem, best: Minimum, estimates: list[Found], alike: Array) -> list[str]:
    remarks = []
    for i, item in enumerate(estimates):
        for j in range(i):
            if abs(alike[i, j]) > _ALIKE:
                pair = f"{estimates[j].free.key} and {item.free.key}"
                remarks.append(f"the data hardly tell {pair} apart (correlation {alike[i, j]:.3f})")
        ends = [*zip(("below", "above"), item.interval[:2], item.interval[2:], strict=True)]
        if bound := [word for word, end, is_open in ends if is_open and not math.isnan(end)]:
            remarks.append(
                f"{item.free.key}: the data do not bound it {' or '.join(bound)}; its bound is given instead"
            )
        if lost := [word for word, end, _ in ends if math.isnan(end)]:
            remarks.append(f"{item.free.key}: the end of its interval was not found {' or '.join(lost)}")
    if (p_value := _likely(problem, best)) <= POOR:
        remarks.append(
            f"the curves lie further off than their errors (p = {p_value:.2g}): the model lacks something, a"
        )
        remarks[-1] += (
            " number that is not free is wrong, or the errors are too small; the intervals hold for none of these"
        )
    remarks += _of_other_units(problem, best)
    if (open_there := _open(problem, best)).size:
        rows = ", ".join(map(problem.place, open_there[:_NAMED]))
        remarks.append(f"the contact is open by the fit where it was measured: {rows}")
    if problem.estimated.any():
        remarks.append("curves without errors: their scatter around the fit stands for them")
    return remarks


def _of_other_units(problem: Problem, best: Minimum) -> list[str]:
    """Return a remark on each curve whose measured and fitted values differ as if one had another unit."""
    remarks, fitted = [], np.abs(problem.predicted(best.x))
    for number in range(int(problem.curve[-1]) + 1):
        here = problem.curve == number
        size, least = float(np.median(np.abs(problem.values[here]))), float(np.median(fitted[here]))
        if min(size, least) > 0.0 and not 1.0 / _OTHER_UNIT < size / least < _OTHER_UNIT:
            name = problem.place(int(np.argmax(here))).partition(":")[0]
            remarks.append(
                f"{name} is {size / least:.2g} times what is fitted: check its unit, and those of the scenario"
            )
    return remarks


def _free(scenario: Scenario, text: str) -> Free:
    """Return the free number of a text ``KEY`` or ``KEY=LOW:HIGH``."""
    key, sign, span = text.partition("=")
    key, known = key.strip(), quantities(scenario)
    if key not in known or key.partition(".")[0] in _OTHER or known[key][0].whole:
        physical = [item for item, (quantity, _) in known.items()
                    if item.partition(".")[0] not in _OTHER and not quantity.whole]  # fmt: skip
        near = difflib.get_close_matches(key, physical, 1, 0.5)
        message = "is no physical number of the scenario" + (f'; did you mean "{near[0]}"?' if near else "")
        raise BadInput([f"--free {key[:80]}: {message or 'is not there'}"])
    quantity, start = known[key]
    low, high = max(quantity.at_least, quantity.above), min(quantity.at_most, quantity.below)
    if sign:
        low, high = _span(key, span, quantity, start)
    elif low >= 0.0 and math.isinf(high):
        if not start > 0.0:
            raise BadInput([f"--free {key}: starts at 0; give it a value in the scenario, or bounds, KEY=LOW:HIGH"])
        low, high = start / _WIDE, start * _WIDE
    elif low == quantity.above and low == 0.0:
        low = high / _WIDE**2
    if not low <= start <= high:
        shown = f"{engineering(low, quantity.unit)} to {engineering(high, quantity.unit)}"
        raise BadInput([f"--free {key}: the scenario's value does not lie within {shown}; start inside"])
    return Free(key, quantity, start, low, high)


def _span(key: str, span: str, quantity: Quantity, start: float) -> tuple[float, float]:
    """Bounds in a text ``LOW:HIGH``."""
    ends = span.split(":")
    try:
        low, high = (quantity.read(_number(end)) for end in ends)
    except ValueError as fault:
        message = str(fault) if len(ends) == 2 else "takes two bounds"
        raise BadInput(
            [f'--free {key}={span[:60]}: {message}; write KEY=LOW:HIGH, such as "{key}={_typical(quantity, start)}"']
        ) from None
    if not low < high:
        raise BadInput([f"--free {key}={span[:60]}: the bounds are in the wrong order; write the lower one first"])
    return low, high


def _number(text: str) -> str | float:
    with contextlib.suppress(ValueError):
        return float(text)
    return text.strip()


def _typical(quantity: Quantity, start: float) -> str:
    """Bounds a hundred times below and above a number, or those of the quantity where these are nearer."""
    low, high = sorted((start / _USUAL, start * _USUAL)) if start else (-1.0, 1.0)
    ends = max(low, quantity.at_least), min(high, quantity.at_most, quantity.below)
    return ":".join(engineering(end, quantity.unit) for end in ends)


def _refuse_entangled(problem: Problem) -> None:
    """Refuse keys that have no effect on the curves, or only together."""
    message = "has no effect on what was measured; fix it"
    faults = [f"--free {key}: {message}" for key in idle(problem)]
    for together in [] if faults else entangled(problem):
        names = f"{', '.join(together[:-1])} and {together[-1]}"
        faults.append(f"--free {names}: the curves depend on them only together, as on a product; free one of them")
    if faults:
        raise BadInput(faults)


#: Height of a curve's panel and of that of its residuals [in].
_CURVE, _RESIDUALS = 1.5, 0.8
#: Words and unit of a condition.
_ALONG = {"speed": ("sliding speed $V$", "m/s"), "t": ("time $t$", "s")}


def figure(problem: Problem, best: Minimum) -> Figure:
    """Each curve over what was varied, with error bars and the fit, above its residuals in standard errors.

    The lines are of many speeds where only the speed was varied, else they join the rows in the order of what was.
    Grey is steady sliding alone, where the scenario's own models add to it.
    """
    fitted, alone = problem.predicted(best.x), problem.steady(best.x)
    off = (problem.values - fitted) / np.hypot(problem.sigma, problem.noise)
    curves = [(table, curve) for table in problem.tables for curve in table.curves]
    with mpl.rc_context(STYLE):
        drawn, panels = rows([_CURVE, _RESIDUALS] * len(curves), shared=False)
        for number, (table, curve) in enumerate(curves):
            here, (upper, lower) = problem.curve == number, panels[2 * number : 2 * number + 2]
            words, si, along = _along(table)
            order, (unit, name, symbol) = np.argsort(along, kind="stable"), curve.described
            x, y = Unit.of(along, si, logarithmic=axis_scale(along) == "log"), Unit.of(curve.values, unit)
            bars: Any = HOLLOW | {"color": BOTH, "elinewidth": 0.7, "zorder": 3, "label": "measured"}
            spread = y.factor * problem.sigma[here]
            upper.errorbar(x.factor * along, y.factor * curve.values, yerr=spread, **bars)
            lines = [(fitted, BOTH, "fit")]
            if np.any(problem.shift):
                lines.append((alone, REFERENCE, "in steady sliding"))
            fine, smooth = problem.between(best.x, table, curve.name)
            for values, colour, label in lines:
                line, over = values[here][order], along[order]
                if fine.size:  # what is added to steady sliding is known at the rows
                    line, over = smooth + np.interp(fine, over, line - alone[here][order]), fine
                upper.plot(x.factor * over, y.factor * line, color=colour, linewidth=0.9, label=label,
                           zorder=2 if colour == BOTH else 1.8)  # fmt: skip
            upper.set_ylabel(y.label(f"{name.partition(',')[0]} ${symbol}$"))
            upper.tick_params(labelbottom=False)
            lower.plot(x.factor * along, off[here], color=BOTH, **HOLLOW)
            lower.axhline(0.0, **GUIDE)
            lower.margins(y=0.15)
            lower.set_ylabel("residual ($\\sigma$)")
            for panel, text in ((upper, ""), (lower, x.label(words))):
                across(panel, x.factor * along, text, axis_scale(along), 0.05)
            if not number:
                legend(upper)
    return drawn


def refuse_units(tables: Sequence[Measured], units: Sequence[str]) -> None:
    """Refuse a unit that no axis of the figure of some tables can have, before anything is fitted."""
    try:
        with in_units(units):
            for table in tables:
                _, si, along = _along(table)
                for values, unit in ((along, si), *((curve.values, curve.described[0]) for curve in table.curves)):
                    Unit.of(values, unit)
    except ValueError as fault:
        raise BadInput([f"--units: {fault}"]) from None


def _along(table: Measured) -> tuple[str, str, Array]:
    """Words, unit and values of what varies from row to row."""
    varied = [(name, values) for name, values in table.conditions.items() if np.ptp(values) > 0.0]
    if not varied:
        return "row", "1", np.arange(1.0, table.rows + 1.0)
    name, values = max(varied, key=lambda item: len(np.unique(item[1])))
    if name == "held":
        name = HELD[table.held]
        return name.replace("_", " "), "N" if table.held == "load" else "m", values
    words, unit = _ALONG.get(name, (name, "1"))
    return words, unit, values


#: First words of a line of the scenarios that are written here, by which they may be replaced.
_MADE = "# Made by sim fit"


#: A table to print, with the text below it.
Shown = tuple[list[dict[str, str]], str]


def carried_out(
    scenario: Scenario, data: Sequence[Path], free: Sequence[str], common: Sequence[str], stem: Path, replace: bool,
    steady: bool, judged: bool, units: Sequence[str] = (),
) -> tuple[Fit, list[Shown]]:  # fmt: skip
    """Fit, compare mechanisms if wanted, and write the files.

    Arguments are those of ``sim.study.fit.fit``, with ``common`` as texts ``"COLUMN=2 %"``, of ``claim`` and of the
    figure.
    """
    pairs = [pair.partition("=")[::2] for pair in common]
    sizes = {name: read_option(size, f"--common {name}", "1", above=0, below=1) for name, size in pairs}
    outputs = claim(scenario, data, stem, replace)
    refuse_units([read(path, scenario) for path in data] if units else [], units)
    result = fit(scenario, data, free, sizes, steady)
    verdict = compare(result.problem, result.best, result.scenario.seed) if judged else None
    save(scenario, result, data, outputs, verdict, units)
    shown: list[Shown] = [(_table(result), f"\n{_explanation(result)}\n")]
    if verdict is not None:
        doubt = (
            "; but even the scenario as it is lies off: perhaps none of these is true" if result.p_value <= POOR else ""
        )
        shown.append((_comparison(verdict), f"\n{verdict.words}{doubt}\n"))
    return result, [*shown, ([], "\n".join(map(str, outputs)))]


class Outputs(NamedTuple):
    """The files of a fit: scenario, numbers and figure."""

    toml: Path
    json: Path
    png: Path


def claim(scenario: Scenario, data: Sequence[Path], stem: Path, replace: bool) -> Outputs:
    """The files to be written, ``<stem>_fit.toml`` and so on; refused where they exist, unless they are replaced.

    Even then no scenario is replaced but one that a fit has made.
    """
    outputs = Outputs(*(stem.with_name(f"{stem.name}_fit.{ending}") for ending in Outputs._fields))
    read = [*files_read(scenario), *data]
    for path in outputs:
        if not (replace and path == outputs.toml and _made_here(path, read)):
            files.claim(path, replace, read)
    return outputs


def _made_here(path: Path, read: Sequence[Path]) -> bool:
    """Return True if a file is a scenario that a fit has written, and no input."""
    if not path.is_file() or any(item.exists() and path.samefile(item) for item in read):
        return False
    with path.open("rb") as file:
        return any(line.startswith(_MADE.encode()) for line in file)


def _table(fit: Fit) -> list[dict[str, str]]:
    """One row for each number found, in units that suit it."""
    rows = []
    for item in fit.numbers:
        nothing = item.interval.low_open and not item.interval.high_open and item.error > abs(item.value)
        factor, unit = scaled(item.interval.high if nothing else item.value, item.free.quantity.unit)
        shown = concise(factor * item.value, factor * item.error)
        shown = f"below {factor * item.interval.high:.3g}" if nothing else shown
        row = {"key": item.free.key, "value": f"{shown} {unit}".rstrip()}
        ends = zip(item.interval[:2], item.interval[2:], strict=True)
        low, high = (_end(factor * end, is_open) for end, is_open in ends)
        row[f"{LEVEL:.0%} interval"] = f"{low} to {high}"
        row["start"] = engineering(item.free.start, item.free.quantity.unit)
        shift = (item.value - item.steady) / item.error if item.error > 0.0 else math.nan
        alone = engineering(item.steady, item.free.quantity.unit)
        row["steady sliding alone"] = f"{alone} ({-shift:+.1f} errors)" if abs(shift) > 0.05 else alone
        rows.append(row)
    return rows


def _end(end: float, is_open: bool) -> str:
    """One end of an interval, which the data, a bound or nothing sets."""
    return "unknown" if math.isnan(end) else f"{end:.4g}" + (" (bound)" if is_open else "")


def _explanation(fit: Fit) -> str:
    """Return the quality of the fit and the remarks on its numbers."""
    problem, best = fit.problem, fit.best
    likely = f", p = {fit.p_value:.2g}" if math.isfinite(fit.p_value) else ""
    lines = [f"chi^2 {best.chi_square:.4g} at {problem.freedom} degrees of freedom{likely}, AICc {fit.aicc:.4g}"]
    if not fit.converged:
        lines.append("the fit has not converged: start nearer, give bounds, or free fewer keys")
    tables = [f"{table.path}: {table.rows} rows, {table.ranges}" for table in problem.tables]
    return "\n".join([*lines, *fit.remarks, *tables])


def _comparison(verdict: Verdict) -> list[dict[str, str]]:
    """One row for each mechanism, the best first; p and the rejection where there is one to compare with."""
    least, rows = verdict.judged[0].aicc, []
    for item in verdict.judged:
        row = {"mechanism": item.name, "chi^2": f"{item.chi_square:.4g}", "AICc - least": f"{item.aicc - least:.3g}"}
        if len(verdict.judged) > 1:
            drawn = f"{item.p_value:.3g}" if math.isfinite(item.p_value) else "by AICc alone"
            row["p"] = "compared with" if item.name == WHOLE else drawn
            row["rejected"] = "yes" if item.rejected else ""
        rows.append(row)
    return rows


def document(fit: Fit, data: Sequence[Path], verdict: Verdict | None) -> dict[str, Any]:
    """All numbers of a fit [SI]."""
    result: dict[str, Any] = {
        "scenario": fit.scenario.source.path,
        "data": [str(path) for path in data],
        "level": LEVEL,
        "numbers": {item.free.key: _described(item) for item in fit.numbers},
        "correlations": {"keys": [item.free.key for item in fit.numbers], "matrix": fit.correlations.tolist()},
        "common_errors": _common(fit),
        "chi_square": fit.best.chi_square,
        "degrees_of_freedom": fit.problem.freedom,
        "p_value": fit.p_value,
        "aicc": fit.aicc,
        "converged": fit.converged,
        "remarks": list(fit.remarks),
    }
    if verdict is not None:
        judged = [item._asdict() for item in verdict.judged]
        result["mechanisms"] = {"sufficient": verdict.sufficient, "words": verdict.words, "judged": judged}
    return _without_nan(result)


def _described(item: Found) -> dict[str, Any]:
    ends = item.interval._asdict()
    described = {"value": item.value, "unit": item.free.quantity.unit, "standard_error": item.error, **ends}
    return described | {"start": item.free.start, "steady_sliding_alone": item.steady}


def _common(fit: Fit) -> dict[str, float]:
    """Return the estimated relative errors that curves share."""
    shares = fit.best.x[len(fit.problem.free) :]
    return {name: float(size * x) for (name, size), x in zip(fit.problem.common.items(), shares, strict=True)}


def _without_nan(value: Any) -> Any:
    """A document in which a number that is not known is null, as JSON has it."""
    if isinstance(value, dict):
        return {key: _without_nan(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def scenario_text(scenario: Scenario, fit: Fit, folder: Path) -> str:
    """The scenario as it was given, its question first, with the values found, for a file in a folder."""
    source = scenario.origin
    text = source.text or written(_plain(json.loads(scenario_json(scenario))))
    tables = copy.deepcopy(parse(text, source.path))
    changed = source.overrides | {
        item.free.key: item.value if item.free.quantity.unit == "1" else f"{item.value:.12g} {item.free.quantity.unit}"
        for item in fit.numbers
    }
    for key, value in changed.items():
        set_key(tables, key.split("."), value)
    above = Path(source.path).parent
    if source.path and above.resolve() != folder.resolve():
        _move(tables, above, folder)
    keys = ", ".join(item.free.key for item in fit.numbers)
    comment = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    question = "".join(f"{line}\n" for line in comment if not line.startswith(_MADE)).removesuffix("#\n")
    opening = f"{question}#\n" if question else ""
    return f"{opening}{_MADE}: {keys} are calibrated to measured curves.\n{written(tables)}"


def _plain(value: Any) -> Any:
    """Tables without the keys that are left out."""
    return {key: _plain(item) for key, item in value.items() if item is not None} if isinstance(value, dict) else value


def _move(table: dict[str, Any], above: Path, folder: Path) -> None:
    """Name files from another folder."""
    for key, value in table.items():
        if isinstance(value, dict):
            _move(value, above, folder)
        elif key == "file" and isinstance(value, str):
            table[key] = os.path.relpath(above / value, folder)


def save(
    scenario: Scenario,
    fit: Fit,
    data: Sequence[Path],
    outputs: Outputs,
    verdict: Verdict | None,
    units: Sequence[str] = (),
) -> None:
    """Write scenario, numbers and figure, each whole."""
    picture = io.BytesIO()
    with in_units(units):
        drawn = figure(fit.problem, fit.best)
    drawn.savefig(picture, format="png")
    numbers = json.dumps(document(fit, data, verdict), indent=2, allow_nan=False) + "\n"
    texts = scenario_text(scenario, fit, outputs.toml.parent).encode(), numbers.encode(), picture.getvalue()
    for path, content in zip(outputs, texts, strict=True):
        with files.output(path) as beside:
            beside.write_bytes(content)
