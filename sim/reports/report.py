"""One page of HTML of a whole run: its figures as SVG, tables, measured points, a fit, errors, and the scenario."""

import contextlib
import copy
import io
import itertools
import json
import math
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from sim.numerics import hdf5
from sim.numerics.files import output
from sim.plots import kinds
from sim.plots.kinds import Choices
from sim.plots.measured import Measured
from sim.plots.style import STYLE
from sim.read import is_stationary, is_steady, speed_of
from sim.read.dataset import claim, speed_name
from sim.read.errors import remarks, systematic_errors
from sim.read.run import Run
from sim.read.statistics import averaging, over_members
from sim.read.tables import Table, highlights, key_figures, losses, notes, phases, table
from sim.scenario.files import toml
from sim.units.errors import naming
from sim.units.terminal import plain

#: Measured points: a CSV table, or columns in SI by name.
Data = Path | str | Mapping[str, Any]

#: Hint of how to read a figure of each kind.
HINTS = {
    "loop": "The area of a closed loop is the energy lost in a cycle.",
    "theories": "Measured areas distinguish theories where their curves separate.",
    "stress": "A pale line is steady sliding by the model of the bonds.",
    "stability": "In red cells the force varies most. Below the line, steady sliding is unstable in theory.",
    "creep": "A displacement that grows in proportion to time is sliding at constant speed.",
    "friction": "The area of the friction loop is the work of friction.",
    "curve": "Blue, or above a dash-dotted line: lost to broken bonds. Vermilion, or below it: lost to fluctuations.",
    "sweep": "Each point is a separate run.",
    "time": "Grey lines are the contacts of JKR and of Hertz.",
    "incipient": "A curve ends at the largest force before the first fall of the force by 2 %.",
    "map": "The circle is the edge of the contact.",
}
#: Kinds that are drawn wherever they can be, beside those that fit.
_ALSO = ("stress", "incipient", "map")
#: Different speeds at which a run that changes between them has transients rather than a curve over speed, at most.
_SPEEDS = 4
#: Inks of figures that follow the page from light to dark.
_INKS = {"#000000": "currentColor", "#ffffff": "var(--paper)"}
#: Text of matplotlib's SVG that a page lacks: the head with its namespaces and style, comments, space between elements.
_LEFT_OUT = {
    r"\A.*</style>\s*</defs>": "",
    "<!--.*?-->": "",
    r">\s+<": "><",
    r"\s+": " ",
    "xlink:": "",
}
_COORDINATES, _NUMBER = re.compile(r' (?:d|x|y)="[^"]*"'), re.compile(r"\d+\.\d{3,}")
_REFERENCE = re.compile(r'(\bid="|href="#|url\(#)')


class Drawing(NamedTuple):
    """A figure of a page: its kind, its caption, a hint, and its SVG or the reason why it has none.

    ``measured`` holds the measured points that it shows.
    """

    kind: str
    caption: str
    hint: str
    svg: str = ""
    lacks: str = ""
    measured: Measured | None = None


def drawings(dataset: xr.Dataset, data: Data | None = None) -> list[Drawing]:
    """Return the figures of a dataset: the one that fits it best, then others that show more of it.

    Measured points are in the one in which ``sim plot`` draws them, and in others that have their variables.

    Raises
    ------
    ValueError
        If measured points cannot be drawn there.
    """
    points = None if data is None else Measured(data, dataset)
    best, of_points = kinds.default(dataset), kinds.default(dataset, points)
    could = kinds.drawable(dataset)
    speeds = (
        speed_of(dataset).to_numpy() if speed_name(dataset) in dataset else np.zeros(1)
    )
    moves = (
        bool(np.all(speeds > 0.0) or np.all(speeds < 0.0))
        and np.unique(speeds).size > _SPEEDS
    )
    others = [
        kind
        for kind in could
        if kind in _ALSO
        or kinds.KINDS[kind].fits(dataset)
        or (kind == "curve" and moves)
    ]
    # theories have an axis of their own; the end of a run that is on its way says little, and over the speed a sweep
    # is a curve already; only bonds with a rupture law have a maximum of the stress, which transients after steps
    # between few speeds do not show, nor many springs upon each other
    lasts = is_stationary(dataset)
    varies = speed_name(dataset) in dataset and not is_steady(dataset)
    steps = varies and np.unique(speeds).size <= _SPEEDS
    has_peak = any(str(name).startswith("bonds_rupture") for name in dataset.variables)
    less = {
        "sweep": best in ("theories", "curve") or not lasts,
        "friction": best in ("creep", "stability"),
    }
    less["curve"] = best == "creep"  # whose speed nothing sets
    less["stress"] = best != "stress" and (best == "stability" or steps or not has_peak)
    # time is no more than another axis for a speed that rises or for creep, and nothing happens in it where a run lasts
    less["time"] = best in ("curve", "creep", "stability") or (
        best != "time" and lasts and "incipient" not in could
    )
    shown = [best, *(kind for kind in others if not less.get(kind, False))]
    if points is not None and of_points not in shown:
        shown.insert(0, of_points)
    numbered = enumerate(dict.fromkeys(shown))
    return [
        _drawing(dataset, kind, f"f{number}-", points, kind == of_points)
        for number, kind in numbered
    ]


def _drawing(
    dataset: xr.Dataset, kind: str, prefix: str, points: Measured | None, needed: bool
) -> Drawing:
    """Return a figure, with measured points if it can show them; raise ValueError if it cannot and they are needed."""
    drawing = Drawing(kind, kinds.KINDS[kind].shows, HINTS.get(kind, ""))
    if points is not None and "data" in kinds.KINDS[kind].takes:
        measured = copy.copy(points)
        measured.forget()
        with contextlib.nullcontext() if needed else contextlib.suppress(ValueError):
            svg = svg_of(kinds.draw(dataset, kind, Choices(data=measured)), prefix)
            return drawing._replace(
                hint=f"{drawing.hint} Rings are measured points.",
                svg=svg,
                measured=measured,
            )
    try:
        return drawing._replace(svg=svg_of(kinds.draw(dataset, kind), prefix))
    except ValueError as fault:  # a fault that only the drawing of the kind detects
        return drawing._replace(lacks=str(fault))


def svg_of(figure: Figure, prefix: str) -> str:
    """Return a figure as an SVG element for a page of HTML.

    All ids begin with ``prefix``. The element has no script, no namespaces and no address outside of itself. Black and
    white are the page's ink and paper.
    """
    content, fineness = io.BytesIO(), figure.dpi
    figure.dpi = 72.0  # that of SVG
    FigureCanvasSVG(figure)
    # here, as saving would draw the figure twice
    if layout := figure.get_layout_engine():
        with mpl.rc_context(STYLE):
            layout.execute(figure)
        figure.set_layout_engine(None)
    # of images within it
    figure.savefig(content, format="svg", transparent=True, dpi=fineness)
    text = content.getvalue().decode()
    for pattern, replacement in _LEFT_OUT.items():
        text = re.sub(pattern, replacement, text, flags=re.DOTALL)
    text = _COORDINATES.sub(
        lambda match: _NUMBER.sub(lambda number: f"{float(number[0]):.2f}", match[0]),
        text,
    )
    text = _REFERENCE.sub(rf"\1{prefix}", text)
    for ink, colour in _INKS.items():
        text = text.replace(ink, colour)
    width, height = 72.0 * figure.get_size_inches()
    style = f"min-width: {0.9 * width:.0f}px; max-width: {1.9 * width:.0f}px"
    return f'<svg viewBox="0 0 {width:g} {height:g}" role="img" fill="currentColor" style="{style}">{text}'


Rows = list[dict[str, str]]

# -- the page -------------------------------------------------------------------------------


#: Rows of a table.
_ROWS = 24
#: Largest dataset that is read whole into memory [byte].
_WHOLE = 2**29
#: Standard error that counts as zero.
_ROUNDING = 1e-12
#: Attributes on where a dataset comes from, in the page's words.
_PROVENANCE = {
    "source": "written by",
    "history": "scenario and versions",
    "seed": "seed",
    "members": "members",
    "joined": "of several runs or some members, but the scenario describes one run",
    "references": "references",
    "Conventions": "conventions of the file",
}


def written(
    dataset: xr.Dataset,
    source: Path,
    path: Path | None,
    replace: bool,
    data: Path | None = None,
    lost: Sequence[str] = (),
) -> Path:
    """Write the page of a dataset, by default beside its file, and return the path of the page.

    Raises
    ------
    BadInput
        If the page is not to be written there.
    OutputExists
        If there is a file that is not to be replaced.
    """
    target = path or source.with_suffix(".html")
    claim(dataset, source, target, replace, *filter(None, [data]))
    with naming(source):
        text = html(dataset, source, data, lost)
    with output(target) as beside:
        beside.write_text(text, encoding="utf-8")
    return target


def html(
    dataset: xr.Dataset,
    source: Path | str = "OUT.nc",
    data: Data | None = None,
    lost: Sequence[float | str] = (),
) -> str:
    """Return the page of a run as one text of HTML.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it; ``sim.read.where`` chooses values of its sweep.
    source : path
        The file that it is of: its name is in the commands that repeat the run.
    data : path or dict of str to array, optional
        Measured points, a CSV table or columns in SI by name, as ``sim plot --data`` takes them.
    lost : sequence of float or str, optional
        Shares of JKR's area whose loss has a speed, such as ``["10 %"]``.

    Returns
    -------
    str
        A page without scripts or anything outside of itself. What comes from the file is escaped.
    """
    # heavy: for this command alone
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    if dataset.nbytes <= _WHOLE:
        dataset = dataset.load()
    figures = drawings(dataset, data)
    points = [figure.measured for figure in figures if figure.measured]
    run = Run(dataset, lost)
    shown = [table(run, _ROWS, ["all"])]
    if run.sweep:
        shown += [of(run, _ROWS) for of in (highlights, losses, phases)]
    remarks_on_numbers = notes(run, [each for each in shown if each.rows])
    stem = Path(source).stem
    page = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        # values marked as HTML stay as they are, texts lose control characters
        finalize=lambda value: plain(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return page.get_template("page.html").render(
        question=dict(zip(("name", "text", "more"), question(dataset), strict=True)),
        measured="; ".join(filter(None, [points[0].source, points[0].assumed]))
        if points
        else "",
        averaged=averaging(dataset, is_stationary(dataset)),
        drawings=figures,
        swept=bool(run.sweep),
        key_figures=[] if run.sweep else key_figures(run),
        tables=[part for each in shown for part in narrow(each)],
        remarks=remarks(dataset),
        notes=[note for group in remarks_on_numbers for note in group],
        known=known(dataset),
        scenario=scenario(dataset),
        changes=changes(dataset),
        files=list(hdf5.tables(dataset.attrs.get("scenario_files"))),
        commands="\n".join(commands(dataset, stem)),
        provenance={
            words: str(dataset.attrs[key])
            for key, words in _PROVENANCE.items()
            if key in dataset.attrs
        },
        version=str(dataset.attrs["sim_version"]),
        source=str(source),
        saved=f"{stem}.toml" if dataset.attrs.get("scenario_toml") else f"{stem}.json",
    )


def narrow(table: Table, most: int = 10) -> list[Rows]:
    """Return a table as several of at most so many columns, each with the columns of its place."""
    if not table.rows:
        return []
    headings = list(table.rows[0])
    keys = headings[: min(table.keys, 3)]
    values = np.array(headings[len(keys) :], object)
    count = max(math.ceil(len(values) / max(most - len(keys), 1)), 1)
    return [
        [{name: row[name] for name in (*keys, *part)} for row in table.rows]
        for part in np.array_split(values, count)
    ]


def question(dataset: xr.Dataset) -> tuple[str, str, list[str]]:
    """Return the name of a scenario, its question, and further paragraphs of its first comment.

    The question is the first paragraph of the comment, else the name.
    """
    text, name = (
        str(dataset.attrs.get("scenario_toml", "")),
        str(dataset.attrs.get("title", "")) or "A run of sim",
    )
    comment = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    lines = [line[1:].strip() for line in comment]
    question, *more = [
        " ".join(part.split())
        for part in "\n".join(lines).split("\n\n")
        if part.strip()
    ] or [name]
    return name, question, more


def changes(dataset: xr.Dataset) -> dict[str, str]:
    """Return the values that replace the scenario's, by key, as TOML."""
    return {
        key: toml(value)
        for key, value in hdf5.tables(dataset.attrs.get("scenario_overrides")).items()
    }


def scenario(dataset: xr.Dataset) -> str:
    """Return the scenario's text; for a scenario from Python all of its keys, as JSON."""
    text = str(dataset.attrs.get("scenario_toml", ""))
    if not text:
        text = json.dumps(
            hdf5.tables(dataset.attrs["scenario_resolved"]),
            indent=2,
            ensure_ascii=False,
        )
    return text.expandtabs(4)


def commands(dataset: xr.Dataset, stem: str) -> list[str]:
    """Return the commands that repeat a run of ``<stem>.toml``, or of ``<stem>.json`` for a scenario from Python."""
    if not dataset.attrs.get("scenario_toml"):
        return [f'sim.run(json.load(open("{stem}.json")), to="{stem}.nc")']
    words = [
        f"--set {shlex.quote(f'{key}={value}')}"
        for key, value in changes(dataset).items()
    ]
    name, output = (shlex.quote(f"{stem}.{ending}") for ending in ("toml", "nc"))
    return [
        " ".join(["sim run", name, "-o", output, *words]),
        f"sim stats {output}",
        f"sim report {output}",
    ]


def known(dataset: xr.Dataset) -> Rows:
    """Return the systematic errors that are estimated before the run, and the largest standard error in it."""
    rows = [
        {"error": str(each), "size": "systematic"}
        for each in systematic_errors(dataset)
    ]
    times = np.unique(np.linspace(0, dataset.sizes["t"] - 1, _ROWS).round().astype(int))
    ratios = over_members(dataset.isel(t=times), ["area_ratio"], quantiles=False)
    errors = ratios["area_ratio"].sem if "area_ratio" in ratios else None
    if errors is not None and (error := float(errors.max())) > _ROUNDING:
        words = (
            f"largest standard error of the mean area over JKR's, of {times.size} times"
        )
        rows.append({"error": words, "size": f"{100.0 * error:.3g} %"})
    return rows
