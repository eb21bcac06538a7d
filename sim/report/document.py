"""The page of a run as HTML, filled from the dataset and its log."""

import json
import math
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sim.analysis import averaging, concise, highlights, is_stationary, notes, sweep_dims, table
from sim.analysis.scene import claim
from sim.analysis.statistics import over_members
from sim.numerics import hdf5
from sim.numerics.files import output
from sim.report.figures import Data, drawings
from sim.report.measured import agreement, fit_of
from sim.scenario.toml_text import toml
from sim.units.refusals import BadInput
from sim.units.terminal import plain

#: Rows of a table.
_ROWS = 24
#: Largest dataset that is read whole into memory [byte].
_WHOLE = 2**29
#: Standard error that counts as zero.
_ROUNDING = 1e-12
#: Attributes on where a dataset comes from, in the page's words.
_PROVENANCE = {
    "source": "written by", "history": "scenario and versions", "seed": "seed", "members": "members",
    "references": "references", "Conventions": "conventions of the file",
}  # fmt: skip


class Known(NamedTuple):
    """An error or a spread: in words, as known before the run, and as measured in it."""

    words: str
    before: str
    measured: str = "–"


class Question(NamedTuple):
    """Purpose of a scenario: its name, its question, and what else its first comment says, a paragraph each."""

    name: str
    asked: str
    more: list[str]


def written(
    dataset: xr.Dataset, source: Path, path: Path | None, replace: bool,
    data: Path | None = None, fit: Path | None = None,
) -> Path:  # fmt: skip
    """Write the page of the dataset of a file, by default beside it; the page's path.

    Raises
    ------
    BadInput
        If the page is not to be written there.
    OutputExists
        If there is a file that is not to be replaced.
    """
    target = path or source.with_suffix(".html")
    claim(dataset, source, target, replace, *filter(None, (data, fit)))
    try:
        text = html(dataset, source, data, fit)
    except BadInput:
        raise
    except ValueError as fault:
        raise BadInput([f"{source}: {fault}"]) from None
    with output(target) as beside:
        beside.write_text(text, encoding="utf-8")
    return target


def html(
    dataset: xr.Dataset, source: Path | str = "OUT.nc", data: Data | None = None, fit: Path | str | None = None
) -> str:
    """The page of a run as one text of HTML.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it; ``sim.analysis.where`` chooses values of its sweep.
    source : path
        The file that it is of: its name is in the commands that repeat the run, and ``<source>.log`` says what it cost.
    data : path or dict of str to array, optional
        Measured points, a CSV table or columns in SI by name, as ``sim plot --data`` takes them.
    fit : path, optional
        What ``sim fit`` has found of this scenario, ``<stem>_fit.json``.

    Returns
    -------
    str
        A page without scripts or anything outside of itself. What comes from the file is escaped.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # heavy: for this command alone

    if dataset.nbytes <= _WHOLE:
        dataset = dataset.load()
    fitted = None if fit is None else fit_of(Path(fit), dataset)
    figures = drawings(dataset, data)
    points = [figure.measured for figure in figures if figure.measured]
    rows, whole = table(dataset, _ROWS), highlights(dataset, _ROWS)
    stem = Path(source).stem
    page = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined, finalize=_cleaned,
        trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return page.get_template("page.html").render(
        question=question(dataset),
        compared=agreement(dataset, points, fitted) if points else None,
        fitted=fitted,
        measured=str(data) if isinstance(data, Path | str) else "the columns given",
        averaged=averaging(dataset, is_stationary(dataset)),
        drawings=figures,
        tables=[rows, whole],
        notes=notes(dataset, rows, whole),
        known=list(known(dataset)),
        scenario=scenario(dataset),
        changes=changes(dataset),
        files=list(hdf5.tables(dataset.attrs.get("scenario_files"))),
        commands="\n".join(commands(dataset, stem)),
        cost=cost(Path(f"{source}.log")),
        provenance={words: str(dataset.attrs[key]) for key, words in _PROVENANCE.items() if key in dataset.attrs},
        version=str(dataset.attrs["sim_version"]),
        source=str(source),
        saved=f"{stem}.toml" if dataset.attrs.get("scenario_toml") else f"{stem}.json",
    )


def _cleaned(value: Any) -> Any:
    """Return a text without control characters; values marked as HTML stay as they are."""
    return plain(value) if type(value) is str else value


def question(dataset: xr.Dataset) -> Question:
    """The question of a scenario: the first paragraph of its first comment, else its name."""
    text, name = str(dataset.attrs.get("scenario_toml", "")), str(dataset.attrs.get("title", "")) or "A run of sim"
    lines = []
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        lines.append(line[1:].strip())
    asked, *more = [" ".join(part.split()) for part in "\n".join(lines).split("\n\n") if part.strip()] or [name]
    return Question(name, asked, more)


def changes(dataset: xr.Dataset) -> dict[str, str]:
    """Values that took the place of the scenario's, by key, as TOML has them."""
    return {key: toml(value) for key, value in hdf5.tables(dataset.attrs.get("scenario_overrides")).items()}


def scenario(dataset: xr.Dataset) -> str:
    """The scenario's text; of one made in Python all of its keys, as JSON."""
    text = str(dataset.attrs.get("scenario_toml", ""))
    if not text:
        text = json.dumps(hdf5.tables(dataset.attrs["scenario_resolved"]), indent=2, ensure_ascii=False)
    return text.expandtabs(4)


def commands(dataset: xr.Dataset, stem: str) -> list[str]:
    """Commands that repeat a run, its scenario saved as ``<stem>.toml``, or ``<stem>.json`` where Python made it."""
    if not dataset.attrs.get("scenario_toml"):
        return [f'sim.run(json.load(open("{stem}.json")), to="{stem}.nc")']
    words = [f"--set {shlex.quote(f'{key}={value}')}" for key, value in changes(dataset).items()]
    name = shlex.quote(f"{stem}.toml")
    made = shlex.quote(f"{stem}.nc")
    return [" ".join(["sim run", name, "-o", made, *words]), f"sim stats {made}", f"sim report {made}"]


def cost(log: Path) -> dict[str, str]:
    """Cost of the run by its log's last line: when it began, seconds in all and of each stage; nothing without."""
    try:
        entry = json.loads(log.read_text(encoding="utf-8").splitlines()[-1])
        stages = {f"of it {name}": float(seconds) for name, seconds in entry["stages"].items()}
        times = {"in all": float(entry["seconds"])} | stages
        return {"began": str(entry["began"])} | {words: f"{seconds:.3g} s" for words, seconds in times.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def known(dataset: xr.Dataset) -> Iterator[Known]:
    """Errors known before the run, beside what the run itself says of them.

    The spread of the fluctuation energy between members is the largest over the sweep at the last record; its own
    standard error is that of the jackknife over the members.
    """
    count = int(dataset.attrs["members"])
    measured = _spreads(dataset)
    if "member_spread_energy" in dataset:
        spread = float(dataset["member_spread_energy"].max())
        yield Known("spread of ΔΓ between members, over its mean", _percent(spread), measured.get("spread", "–"))
        if count > 1:
            error = spread / math.sqrt(count)
            words = f"standard error of the mean ΔΓ of {count} members, over the mean"
            yield Known(words, _percent(error), measured.get("error", "–"))
    for name in dataset.data_vars:
        if str(name).startswith(("cell_error_", "banded_error_")):
            variable = dataset[name]
            most = float(abs(variable).max())
            if np.isfinite(most):
                yield Known(str(variable.attrs.get("long_name", name)), _percent(most))
    times = np.unique(np.linspace(0, dataset.sizes["t"] - 1, _ROWS).round().astype(int))
    found = over_members(dataset.isel(t=times), ["area_ratio"], quantiles=False)
    if "area_ratio_sem" in found and (error := float(found["area_ratio_sem"].max())) > _ROUNDING:
        yield Known(f"largest standard error of the mean area over JKR's, of {times.size} times", "–", _percent(error))


def _spreads(dataset: xr.Dataset) -> dict[str, str]:
    """Standard deviation of ΔΓ over its mean, at the point of the sweep where it is largest, and of the mean."""
    if "fluctuation_energy" not in dataset or "member" not in dataset["fluctuation_energy"].dims:
        return {}
    energy = dataset["fluctuation_energy"].isel(t=-1).astype(float).transpose(*sweep_dims(dataset), "member").to_numpy()
    rows = [row for row in energy.reshape(-1, energy.shape[-1]) if len(row) > 2 and np.all(np.isfinite(row))]
    rows = [row for row in rows if np.mean(row) > 0.0]
    if not rows:
        return {}
    row = max(rows, key=lambda one: np.std(one) / np.mean(one))
    count, total, squares = len(row), np.sum(row), np.sum(row**2)
    spread = np.std(row, ddof=1) / np.mean(row)
    means = (total - row) / (count - 1)
    each = np.sqrt(np.maximum((squares - row**2) / (count - 1) - means**2, 0.0) * (count - 1) / (count - 2)) / means
    error = np.sqrt((count - 1) / count * np.sum((each - each.mean()) ** 2))
    return {"spread": _percent(spread, error), "error": _percent(spread / math.sqrt(count), error / math.sqrt(count))}


def _percent(value: float, error: float = 0.0) -> str:
    return f"{concise(100.0 * value, 100.0 * error)} %" if error else f"{100.0 * value:.3g} %"
