"""What ``sim fit`` prints and writes: a table, the calibrated scenario, the numbers as JSON, the figure."""

import copy
import io
import itertools
import json
import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from sim.ensemble.dataset import scenario_json
from sim.numerics import files
from sim.plots.style import in_units
from sim.scenario.files import parse, written
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read
from sim.scenario.sweep import set_key
from sim.study.fit import POOR, Fit, Found, fit
from sim.study.fit_figure import figure, refuse_units
from sim.study.fitting import LEVEL
from sim.study.measured import read
from sim.study.mechanisms import WHOLE, Verdict, compare
from sim.units.notation import concise, engineering, scaled
from sim.units.quantity import read_option

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
    found = fit(scenario, data, free, sizes, steady)
    verdict = compare(found.problem, found.best, found.scenario.seed) if judged else None
    save(scenario, found, data, outputs, verdict, units)
    shown: list[Shown] = [(_table(found), f"\n{_explanation(found)}\n")]
    if verdict is not None:
        doubt = (
            "; but even the scenario as it is lies off: perhaps none of these is true" if found.p_value <= POOR else ""
        )
        shown.append((_comparison(verdict), f"\n{verdict.words}{doubt}\n"))
    return found, [*shown, ([], "\n".join(map(str, outputs)))]


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
    """Whether a file is a scenario that a fit has made, and none that is read."""
    if not path.is_file() or any(one.exists() and path.samefile(one) for one in read):
        return False
    with path.open("rb") as file:
        return any(line.startswith(_MADE.encode()) for line in file)


def _table(fit: Fit) -> list[dict[str, str]]:
    """One row for each number found, in units that suit it."""
    rows = []
    for one in fit.numbers:
        nothing = one.interval.low_open and not one.interval.high_open and one.error > abs(one.value)
        factor, unit = scaled(one.interval.high if nothing else one.value, one.free.quantity.unit)
        shown = concise(factor * one.value, factor * one.error)
        shown = f"below {factor * one.interval.high:.3g}" if nothing else shown
        row = {"key": one.free.key, "value": f"{shown} {unit}".rstrip()}
        ends = zip(one.interval[:2], one.interval[2:], strict=True)
        low, high = (_end(factor * end, is_open) for end, is_open in ends)
        row[f"{LEVEL:.0%} interval"] = f"{low} to {high}"
        row["start"] = engineering(one.free.start, one.free.quantity.unit)
        shift = (one.value - one.steady) / one.error if one.error > 0.0 else math.nan
        alone = engineering(one.steady, one.free.quantity.unit)
        row["steady sliding alone"] = f"{alone} ({-shift:+.1f} errors)" if abs(shift) > 0.05 else alone
        rows.append(row)
    return rows


def _end(end: float, is_open: bool) -> str:
    """One end of an interval, which the data, a bound or nothing sets."""
    return "unknown" if math.isnan(end) else f"{end:.4g}" + (" (bound)" if is_open else "")


def _explanation(fit: Fit) -> str:
    """How good the fit is, and what to know of its numbers."""
    problem, best = fit.problem, fit.best
    likely = f", p = {fit.p_value:.2g}" if math.isfinite(fit.p_value) else ""
    lines = [f"chi^2 {best.chi_square:.4g} at {problem.freedom} degrees of freedom{likely}, AICc {_number(fit.aicc)}"]
    if not fit.converged:
        lines.append("the fit has not converged: start nearer, give bounds, or free fewer keys")
    tables = [f"{table.path}: {table.rows} rows, {table.ranges}" for table in problem.tables]
    return "\n".join([*lines, *fit.remarks, *tables])


def _comparison(verdict: Verdict) -> list[dict[str, str]]:
    """One row for each mechanism, the best first; p and the rejection where there is one to compare with."""
    least, rows = verdict.judged[0].aicc, []
    for one in verdict.judged:
        row = {"mechanism": one.name, "chi^2": f"{one.chi_square:.4g}", "AICc - least": f"{one.aicc - least:.3g}"}
        if len(verdict.judged) > 1:
            drawn = f"{one.p_value:.3g}" if math.isfinite(one.p_value) else "by AICc alone"
            row["p"] = "compared with" if one.name == WHOLE else drawn
            row["rejected"] = "yes" if one.rejected else ""
        rows.append(row)
    return rows


def document(fit: Fit, data: Sequence[Path], verdict: Verdict | None) -> dict[str, Any]:
    """All numbers of a fit [SI]."""
    found: dict[str, Any] = {
        "scenario": fit.scenario.source.path,
        "data": [str(path) for path in data],
        "level": LEVEL,
        "numbers": {one.free.key: _described(one) for one in fit.numbers},
        "correlations": {"keys": [one.free.key for one in fit.numbers], "matrix": fit.correlations.tolist()},
        "common_errors": _common(fit),
        "chi_square": fit.best.chi_square,
        "degrees_of_freedom": fit.problem.freedom,
        "p_value": fit.p_value,
        "aicc": fit.aicc,
        "converged": fit.converged,
        "remarks": list(fit.remarks),
    }
    if verdict is not None:
        judged = [one._asdict() for one in verdict.judged]
        found["mechanisms"] = {"sufficient": verdict.sufficient, "words": verdict.words, "judged": judged}
    return _without_nan(found)


def _described(one: Found) -> dict[str, Any]:
    ends = one.interval._asdict()
    described = {"value": one.value, "unit": one.free.quantity.unit, "standard_error": one.error, **ends}
    return described | {"start": one.free.start, "steady_sliding_alone": one.steady}


def _common(fit: Fit) -> dict[str, float]:
    """What was found of the relative errors that curves share."""
    found = fit.best.x[len(fit.problem.free) :]
    return {name: float(size * x) for (name, size), x in zip(fit.problem.common.items(), found, strict=True)}


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
        one.free.key: one.value if one.free.quantity.unit == "1" else f"{one.value:.12g} {one.free.quantity.unit}"
        for one in fit.numbers
    }
    for key, value in changed.items():
        set_key(tables, key.split("."), value)
    above = Path(source.path).parent
    if source.path and above.resolve() != folder.resolve():
        _move(tables, above, folder)
    keys = ", ".join(one.free.key for one in fit.numbers)
    comment = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    asked = "".join(f"{line}\n" for line in comment if not line.startswith(_MADE)).removesuffix("#\n")
    opening = f"{asked}#\n" if asked else ""
    return f"{opening}{_MADE}: {keys} are calibrated to measured curves.\n{written(tables)}"


def _plain(value: Any) -> Any:
    """Tables without the keys that are left out."""
    return {key: _plain(one) for key, one in value.items() if one is not None} if isinstance(value, dict) else value


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


def _number(value: float) -> str:
    return f"{value:.4g}"
