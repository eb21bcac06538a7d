"""One page of HTML of a run: question, answer, figure, table and limits, and all else folded."""

import contextlib
import html as markup
import io
import json
import re
import shlex
from collections.abc import Hashable, Iterable, Mapping, Sequence
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
from sim.quantities import OPEN_THROUGHOUT, QUANTITIES, Definition
from sim.read.dataset import claim
from sim.read.errors import remarks
from sim.read.estimate import Estimate
from sim.read.observables import is_open_throughout
from sim.read.run import Run
from sim.read.statistics import over_members
from sim.read.tables import figure, key_figures, notes, table, tables_of
from sim.reports.methods import errors, is_estimated, methods, rendered
from sim.scenario.files import question_of, toml
from sim.units.errors import naming
from sim.units.notation import engineering

#: Measured points: a CSV table, or columns in SI by name.
Data = Path | str | Mapping[str, Any]

#: Kinds that are drawn wherever they can be, beside those that fit.
_ALSO = ("incipient", "map")
#: Kinds that show nothing more beside the one that fits best.
_REPEATED = {
    "theories": ("sweep",),
    "curve": ("sweep", "time"),
    "creep": ("sweep", "friction", "curve", "time"),
    "stability": ("friction", "stress", "time"),
}
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
_REFERENCE = re.compile(r'(\bid="|href="#|url\(#)')


class Drawing(NamedTuple):
    """A figure of a page: its kind, its caption, its SVG, "" if it cannot be drawn, and the measured points in it."""

    kind: str
    caption: str
    svg: str = ""
    measured: Measured | None = None


def drawings(run: Run, data: Data | None = None) -> list[Drawing]:
    """Return the figures of a run: the one that fits it best, then others that show more of it.

    Measured points are in the figure in which ``sim plot`` draws them, which is then the first.

    Raises
    ------
    ValueError
        If measured points cannot be drawn there.
    """
    dataset = run.dataset
    measured = None if data is None else Measured(data, dataset)
    best = kinds.default(dataset, measured)
    # nothing happens in time where a run lasts, and its end says little where it does not
    repeated = {*_REPEATED.get(best, ()), "time" if run.is_stationary else "sweep"}
    shown = [best, kinds.default(dataset)]
    peak = run.events.get("peak_stress")
    also = _ALSO if peak is None or bool(peak.is_missing.all()) else ("stress", *_ALSO)
    for kind in kinds.drawable(dataset):
        fits = kind in also or kinds.KINDS[kind].fits(dataset)
        if fits and kind not in repeated:
            shown.append(kind)
    result = []
    for place, kind in enumerate(dict.fromkeys(shown)):
        drawing = Drawing(kind, kinds.KINDS[kind].shows)
        choices = None if place else Choices(data=measured)
        # the fault of a further figure may be a library's, whose words are not for this page
        with contextlib.suppress(ValueError) if place else contextlib.nullcontext():
            picture = kinds.draw(dataset, kind, choices)
            svg = svg_of(picture, f"f{place}-", drawing.caption)
            drawing = Drawing(*drawing[:2], svg, choices and measured)
        result.append(drawing)
    return result


def svg_of(figure: Figure, prefix: str, name: str) -> str:
    """Return a figure as an SVG element with a name for a page of HTML.

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
    text = _REFERENCE.sub(rf"\1{prefix}", text)
    for ink, colour in _INKS.items():
        text = text.replace(ink, colour)
    width, height = 72.0 * figure.get_size_inches()
    style = f"min-width: {0.9 * width:.0f}px; max-width: {1.9 * width:.0f}px"
    label = markup.escape(name)
    opening = f'<svg viewBox="0 0 {width:g} {height:g}" role="img" aria-label="{label}"'
    return f'{opening} fill="currentColor" style="{style}"><title>{label}</title>{text}'


#: Rows of a table.
_ROWS = 24
#: Largest dataset that is read whole into memory [byte].
_WHOLE = 2**29
#: First words of the lines that ``sim fit`` writes into the scenarios that it makes.
_MADE = "Made by sim fit"
#: Quantities that answer a question, events first; the speeds of losses of area are between both.
_EVENTS = (
    "pull_off_load",
    "jump_in_load",
    "loop_dissipation",
    "static_threshold",
    "onset_slip_speed",
    "end_slip_speed",
    "slip_count",
    "force_drop",
    "runaway_after",
    "peak_friction",
    "peak_stress",
)
#: What takes the area of a contact whose speed changes, in words, and a share of it that is nothing.
_SHARES = {
    "lost_to_bonds": "broken bonds",
    "lost_to_fluctuations": "fluctuations, which are subtracted after the bonds",
}
_LEAST = 1e-6
_MEANS = ("area_ratio", "friction_force", "fraction_masked")


class Page(str):
    """A page of HTML, which a notebook shows in a frame."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"<Page of {len(self):,} characters; print it, or name a file by to=>"

    def _repr_html_(self) -> str:
        frame = 'style="width: 100%; height: 40rem; border: 0" sandbox=""'
        return f'<iframe {frame} srcdoc="{markup.escape(self)}"></iframe>'


def written(
    dataset: xr.Dataset,
    source: Path,
    target: Path,
    replace: bool,
    data: Data | None = None,
    lost: Sequence[float | str] = (),
) -> Page:
    """Write the page of a dataset to a file, and return it.

    Raises
    ------
    BadInput
        If the page is not to be written there.
    OutputExists
        If there is a file that is not to be replaced.
    """
    claim(dataset, source, target, replace, *([data] if isinstance(data, Path) else []))
    with naming(source):
        page = html(dataset, source, data, lost)
    with output(target) as beside:
        beside.write_text(page, encoding="utf-8")
    return page


def html(
    dataset: xr.Dataset,
    source: Path | str = "OUT.nc",
    data: Data | None = None,
    lost: Sequence[float | str] = (),
) -> Page:
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
    Page
        A page without scripts or anything outside of itself. What comes from the file is escaped.
    """
    if dataset.nbytes <= _WHOLE:
        dataset = dataset.load()
    run = Run(dataset, lost)
    figures = drawings(run, data)
    shown = tables_of(run, _ROWS, ["all"])
    key = [] if run.sweep else key_figures(run)
    attrs = dataset.attrs
    resolved, overrides = (
        hdf5.tables(attrs.get(f"scenario_{form}")) for form in ("resolved", "overrides")
    )
    name, question, fit = headed(dataset)
    text = rendered(
        "page.html",
        name=name,
        question=question,
        fit=fit,
        answer=answer(run),
        drawings=figures,
        key_figures=key,
        main=table(run, _ROWS),
        tables=shown,
        remarks=remarks(dataset),
        notes=notes(run, shown),
        errors=errors(dataset),
        estimated=is_estimated(dataset),
        methods=methods(dataset),
        scenario=attrs.get("scenario_toml") or json.dumps(resolved, indent=2),
        changes={key: toml(value) for key, value in overrides.items()},
        files=list(hdf5.tables(attrs.get("scenario_files"))),
        quote=shlex.quote,
        attrs=attrs,
        source=str(source),
        stem=Path(source).stem,
    )
    return Page(text)


def answer(run: Run, most: int = 3) -> list[str]:
    """Return at most so many sentences on what the run tells: events, losses of area, means, and absent events."""
    losses = [name for name in run.losses if name.startswith("speed_")]
    late = run.late(_MEANS) if run.lasts else {}
    known, missing = _shares(run), list[str]()
    held = "phase_peak_after_hold" in run.events
    for group, names in ((run.events, _EVENTS), (run.losses, losses), (late, _MEANS)):
        for name in (name for name in names if name in group):
            one = group[name]
            row = QUANTITIES.get(name, Definition(name, one.unit, ""))
            is_dull = group is late and not bool(one.value.fillna(0.0).any())
            if not bool(one.is_missing.all()):
                known += [] if is_dull else [_sentence(one, row)]
            # after a hold the peak is that of a phase
            elif _never_happens(one, row) and not (held and name == "static_threshold"):
                missing.append(f"There is no {one.value.long_name} ({row.absent}).")
    return [*_open(run), *known, *missing][:most]


def _never_happens(one: Estimate, row: Definition) -> bool:
    """Return True if an event happens nowhere, for the reason of the registry alone."""
    return one.reason is not None and bool((one.reason == row.absent).all())


def _open(run: Run) -> list[str]:
    """Return a sentence on contacts that are open throughout the run, if there are any."""
    is_open = is_open_throughout(run.dataset)
    count = int(is_open.sum())
    if not count:
        return []
    sentence = OPEN_THROUGHOUT[:1].upper() + OPEN_THROUGHOUT[1:]
    where = f" at {count} of {run.points} points" * (run.points > 1)
    return [f"{sentence}{where}."]


def _shares(run: Run) -> list[str]:
    """Return a sentence on what each mechanism takes at the end of a course of the speed, if both are known."""
    # in stick-slip the end of a run is any place of a cycle
    if run.sweep or not run.losses or run.speed_name != "speed":
        return []
    last = run.dataset.isel(t=[run.last])
    found = over_members(last, _SHARES, quantiles=False)
    if found.keys() != {*_SHARES}:
        return []
    at_end = {name: one.isel({"t": 0}) for name, one in found.items()}
    taken = [
        f"{figure(one, QUANTITIES[name])} to {_SHARES[name]}"
        for name, one in at_end.items()
        if float(one.value) > _LEAST
    ]
    if not taken:
        return []
    return [
        f"At the end of the run the contact has lost, of JKR's area, {' and '.join(taken)}."
    ]


def _sentence(one: Estimate, row: Definition) -> str:
    """Return a sentence on a quantity, of a sweep at the first and last point where it is known."""
    # what a semicolon parts is for a table of meanings
    text = str(one.value.long_name).partition(";")[0]
    subject = f"The {text}{',' * (',' in text)} is"
    known = {}
    for place in np.ndindex(one.value.shape):
        at = one.isel(dict(zip(one.value.dims, place, strict=True)))
        if not bool(at.is_missing):
            known[_place(at.value, one.value.dims)] = figure(at, row)
    if len(set(known.values())) == 1 and len(known) == one.value.size:
        each = f" at each of {len(known)} points" * (len(known) > 1)
        return f"{subject} {next(iter(known.values()))}{each}."
    ends = dict.fromkeys((next(iter(known)), next(reversed(known))))
    return f"{subject} {' and '.join(f'{known[place]} at {place}' for place in ends)}."


def _place(value: xr.DataArray, dims: Iterable[Hashable]) -> str:
    """Return the point of a value along some dimensions in words."""
    words = []
    for name in dims:
        at = value[name]
        unit = at.attrs.get("units", "1")
        number = engineering(float(at), unit) if at.dtype.kind == "f" else at.item()
        words.append(f"{name} = {number}")
    return ", ".join(words)


def headed(dataset: xr.Dataset) -> tuple[str, str, list[str]]:
    """Return the name of a scenario, its question, and the lines of its first comment on the fit that made it.

    The question is the first paragraph of the comment, else the name. Lines for editors are no part of it.
    """
    text = str(dataset.attrs.get("scenario_toml", ""))
    name = str(dataset.attrs.get("title", "")) or "A run of sim"
    question, made = question_of(text, _MADE)
    return name, question or name, made
