"""Speed against error of one scene: ``sim converge``.

A *setting* changes one thing of the scene: the shear model, the bond model or the clock step. The scene is run at each
setting, and its difference from the finest one is the error of the setting. Errors of several changes are added to find
the cheapest combination, which is then run against the finest one: its error is measured. This is the search of
``sim run --within``, with all quantities of the scene's table, so both choose the same settings for the same names.
"""

import importlib.metadata
import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from sim.numerics import files, hdf5, lazy
from sim.plots.style import (
    BONDS,
    FLUCTUATIONS,
    LINES,
    REFERENCE,
    STYLE,
    legend,
    rows,
    save,
)
from sim.read.correlation import Array
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read
from sim.study.accuracy import part_table
from sim.study.pilot import shown
from sim.study.within import (
    Choice,
    Comparison,
    Goal,
    Result,
    Setting,
    accepted,
    in_words,
    percent,
    searched,
)
from sim.units.errors import BadInput
from sim.units.notation import engineering

#: A table to print, and the text below it.
Printed = tuple[list[dict[str, str]], str]

#: Parts by their table in the scenario: words, colour and marker.
_PARTS = {
    "shear": ("shear model", FLUCTUATIONS, "o"),
    "bonds": ("bond model", BONDS, "s"),
    "clock": ("clock step", LINES[3], "^"),
}
#: Errors below this are roundings.
_ROUNDING = 1e-9


def converge(
    scenario: Scenario,
    budget: float,
    tolerance: float | None = None,
    of: tuple[str, ...] = (),
) -> xr.Dataset:
    """Run a scene at every admissible setting, and report the cost and the error of each, and the best combination.

    Parameters
    ----------
    scenario : Scenario
        The scene, with its sweep.
    budget : float
        Counted work to spend [s]. Settings that do not fit into it are left out and named.
    tolerance : float, optional
        Accepted error, by default that of the scene's shear model, or 1 %.
    of : sequence of str, optional
        Names that are compared, such as ``contact_area`` or ``fluctuation_energy:skewness``; by default all that the
        scene's table shows, with their spreads over the members.

    Returns
    -------
    xarray.Dataset
        Along ``row``: the counted ``work`` of the scene's run at each setting, and the bound of its ``error`` for each
        ``name``, with the ``noise`` that is part of it. The attributes hold the accepted error (``tolerance``), the
        ``recommendation``, and the work and the error of the recommended combination, if there is one.

    Raises
    ------
    BadInput
        If the field is a measured map, or a name is not known.
    NotReached
        If no error is known within the budget; the message names a larger one.
    """
    own = float(part_table(scenario.shear).get("tolerance", 0.01))
    goal = Goal(tolerance or own, of, budget, shown)
    return report(searched(scenario, goal, Comparison))


def report(result: Result) -> xr.Dataset:
    """Return a search with its recommendation as a dataset; see ``converge``."""
    search = result.search
    settings = [row for group in search.groups for row in group]
    members = search.scene.ensemble.members
    written = search.as_written.rows
    works = [search.work(_changed(written, row), members) for row in settings]
    best = {}
    if result.best is not None:
        best = {"recommended_work": result.best.work}
        best["recommended_error"] = result.best.total
    meanings = {
        "part": "table of the scenario that the setting changes",
        "own": "1 if the scenario has this setting",
        "work": "counted work of the run of the scenario at this setting",
        "error": "bound of the largest difference from the finest setting",
        "noise": "noise of the pilots in the error",
    }
    columns: dict[str, Any] = {
        "part": ("row", [row.part for row in settings]),
        "own": ("row", [int(row.is_own) for row in settings]),
        "work": ("row", works, {"units": "s"}),
        "error": (("row", "name"), [row.error[0] for row in settings]),
        "noise": (("row", "name"), [row.error[1] for row in settings]),
    }
    dataset = xr.Dataset(
        columns,
        {"row": [row.label for row in settings], "name": search.names},
        {
            "Conventions": "CF-1.11",
            "title": f"speed against error: {search.scene.name}",
            "sim_version": importlib.metadata.version("sliding-sim"),
            "seed": str(search.scene.seed),
            "tolerance": search.goal.within,
            "members": search.pilot,
            "left_out": "; ".join(search.left_out),
            "recommendation": _recommendation(result),
            **best,
        },
    )
    for name, words in meanings.items():
        dataset[name].attrs |= {"long_name": words}
    return dataset


def _changed(rows: tuple[Setting, ...], row: Setting) -> tuple[Setting, ...]:
    """Return settings with one of them in place of that of its part."""
    return tuple(row if other.part == row.part else other for other in rows)


def _recommendation(result: Result) -> str:
    """Return the cheapest combination that keeps the accepted error, with the lines to write, or why there is none."""
    search, best = result.search, result.best
    written = search.as_written
    lines = [f"The scenario as written is {_off(search.names, written)}."]
    if best is None:
        return "\n".join([*lines, f"No setting is recommended: {result.reason}."])
    labels = ", ".join(best.labels) or "the settings as written"
    within = accepted(search.goal.within)
    lines.append(f"Within {within}, the cheapest combination is: {labels}.")
    against = ", ".join(search.finest.labels) or "the settings as written"
    lines.append(
        f"Its measured error, against {against}: it is {_off(search.names, best)}, "
        f"{engineering(best.work, 's')} of counted work."
    )
    changed = [row for row in best.rows if not row.is_own]
    lines += ["Write:"] * bool(changed)
    for row in changed:
        keys = (f"{key} = {json.dumps(value)}" for key, value in row.changes.items())
        lines.append("\n".join(["", f"[{row.part}]", *keys]))
    return "\n".join(lines)


def _off(names: list[str], choice: Choice) -> str:
    """Return the largest error of a combination in words."""
    worst = int(choice.systematic.argmax())
    size = float(choice.systematic[worst])
    if size <= _ROUNDING:
        return "exact"
    return f"off by at most {percent(size)} ({in_words(names[worst])})"


def table(dataset: xr.Dataset) -> list[dict[str, str]]:
    """Return a row for each setting, for the terminal; names without any error have no column."""
    lines = list[dict[str, str]]()
    work, errors = dataset["work"].to_numpy(), dataset["error"].to_numpy()
    names = dataset["name"].to_numpy()
    for k, label in enumerate(dataset["row"].to_numpy()):
        cells = {
            "changed": _PARTS[str(dataset["part"].values[k])][0],
            "setting": f"{label}{' *' * int(dataset['own'].values[k])}",
            "work": engineering(float(f"{work[k]:.2g}"), "s"),
        }
        for name, error, column in zip(names, errors[k], errors.T, strict=True):
            if column.max() > _ROUNDING:
                words = in_words(str(name)).replace(" ", "\n")
                cells[f"{words}\n(%)"] = f"{float(f'{100.0 * error:.2g}'):.4g}"
        lines.append(cells)
    return lines


def explanation(dataset: xr.Dataset) -> str:
    """Return the meaning of the table's columns, in sentences."""
    left_out = dataset.attrs["left_out"]
    exact = dataset["name"].values[dataset["error"].max("row") <= _ROUNDING]
    return (
        "Each row changes one setting (* marks the scenario as written). work: counted work of its run on one core."
        f"\n(%): bound of the largest difference from the finest setting, by {dataset.attrs['members']} members."
        + f"\nNo setting changes: {', '.join(map(in_words, exact))}." * bool(len(exact))
        + f"\nOmitted: {left_out}." * bool(left_out)
    )


def figure(dataset: xr.Dataset) -> Figure:
    """Draw the largest error of each setting against the counted work of the run, in the width of a column.

    Exact settings are drawn at a tenth of the smallest error. A ring marks the scene, a star the recommended
    combination, if there is one.
    """
    tolerance, about = float(dataset.attrs["tolerance"]), dataset.attrs
    part, work = dataset["part"].to_numpy(), dataset["work"].to_numpy()
    off: Array = dataset["error"].to_numpy().max(axis=1)
    floor = 0.1 * min([tolerance, *off[off > _ROUNDING]])
    off = np.maximum(off, floor)
    with mpl.rc_context(STYLE):
        picture, (panel,) = rows([3.0])
        for name, (words, color, marker) in _PARTS.items():
            here = part == name
            if here.any():
                look: Any = {"c": color, "marker": marker, "ms": 3.6, "lw": 0.6}
                panel.plot(work[here], off[here], label=words, **look)
        own = dataset["own"].to_numpy() == 1
        ring: Any = {"c": "none", "mec": "black", "ms": 7.5, "label": "as written"}
        panel.plot(work[own], off[own], "o", **ring)
        if "recommended_work" in about:
            star: Any = {"c": "black", "ms": 7.0, "zorder": 5, "label": "recommended"}
            error = max(float(about["recommended_error"]), floor)
            panel.plot(about["recommended_work"], error, "*", **star)
        panel.axhline(tolerance, c=REFERENCE, ls="--", lw=0.8, label="accepted")
        panel.set(xscale="log", xlabel="counted work of the run (s)")
        ends = np.log10([work.min(), work.max()])
        # whole decades, because labels between them overlap
        panel.set_xlim(0.8 * 10.0 ** np.floor(ends[0]), 1.25 * 10.0 ** np.ceil(ends[1]))
        panel.xaxis.set_minor_formatter(NullFormatter())
        panel.set(yscale="log", ylabel="largest error (bottom: exact)")
        legend(panel)
    return picture


def study(
    scenario: Scenario,
    target: Path,
    replace: bool,
    budget: float,
    tolerance: float | None,
    of: tuple[str, ...],
) -> Printed:
    """Study a scene and save dataset and figure; return the table to print and the text below it."""
    picture = target.with_suffix(".png")
    if picture == target:
        raise BadInput(
            [
                f"{target}: the dataset cannot have the name of its picture; end it in .nc"
            ]
        )
    hdf5.claim(target, replace, files_read(scenario))
    files.claim(picture, replace, files_read(scenario))
    dataset = converge(scenario, budget, tolerance, of)
    with files.output(target) as beside:
        lazy.save(dataset, beside)
    save(figure(dataset), picture)
    text = f"{explanation(dataset)}\n\n{dataset.attrs['recommendation']}"
    return table(dataset), f"{text}\n\n{target}\n{picture}"
