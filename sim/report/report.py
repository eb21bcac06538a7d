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
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.path import Path as Outline

from sim.analysis import is_stationary, is_steady, setting, speed_of, statements, sweep_dims
from sim.analysis.dataset import claim, speed_name
from sim.analysis.errors import remarks, systematic_errors
from sim.analysis.statistics import averaging, over_members
from sim.analysis.tables import highlights, key_figures, losses, narrow, notes, phases, table
from sim.numerics import hdf5
from sim.numerics.files import output
from sim.plots import kinds
from sim.plots.kinds import Choices
from sim.plots.measured import Measured, Residuals
from sim.plots.style import STYLE
from sim.scenario.files import toml
from sim.units.errors import BadInput
from sim.units.notation import concise, engineering, scaled
from sim.units.terminal import plain

#: Measured points: a CSV table, or columns in SI by name.
Data = Path | str | Mapping[str, Any]

#: Hint of how to read a figure of each kind.
HINTS = {
    "loop": "A cross is a pull-off (of each member). A ring is a jump into contact. The loop area is the energy lost.",
    "theories": "Measured areas distinguish theories where their curves separate.",
    "stress": "A mark is the maximum of the stress. Thin lines are closed forms.",
    "stability": "Dark cells are stick-slip. Below the line, steady sliding is unstable in theory.",
    "creep": "A line of slope one is sliding at constant speed. A line that bends upward is a runaway.",
    "friction": "The area of the friction loop is the work of friction.",
    "curve": "Blue, or above a dash-dotted line: lost to broken bonds. Vermilion, or below it: lost to fluctuations."
    " On the dotted Hertz line, adhesion is masked.",
    "sweep": "Each point is a separate run.",
    "time": "The contact radius lies between the JKR and Hertz radii.",
    "incipient": "Slip begins where the area deviates from the dashed law.",
    "map": "The circle is the edge of the contact.",
    "spectrum": "The maps follow the spectrum of the scenario.",
    "profile": "Adhesion pulls up the neck at the edge of the contact.",
}
#: Kinds that are drawn wherever they can be, beside those that fit.
_ALSO = ("stress", "incipient", "map", "spectrum")
#: Different speeds at which a run that changes between them has transients rather than a curve over speed, at most.
_SPEEDS = 4
#: Corners of a shaded band from which on some are left out.
_CORNERS = 300
#: Inks of figures that follow the page from light to dark.
_INKS = {"#000000": "currentColor", "#ffffff": "var(--paper)"}
#: Text of matplotlib's SVG that a page lacks: the head with its namespaces and style, comments, space between elements.
_LEFT_OUT = {r"\A.*</style>\s*</defs>": "", "<!--.*?-->": "", r">\s+<": "><", r"\s+": " ", "xlink:": ""}
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
    speeds = speed_of(dataset).to_numpy() if speed_name(dataset) in dataset else np.zeros(1)
    both_ways = bool(np.all(speeds > 0.0) or np.all(speeds < 0.0)) and np.unique(speeds).size > _SPEEDS
    others = [
        kind for kind in could
        if kind in _ALSO or kinds.KINDS[kind].fits(dataset) or (kind == "curve" and both_ways)
    ]  # fmt: skip
    # theories have an axis of their own; the end of a run that is on its way says little, and over the speed a sweep
    # is a curve already; only bonds with a rupture law have a maximum of the stress, which transients after steps
    # between few speeds do not show, nor many springs upon each other
    lasts = is_stationary(dataset)
    varies = speed_name(dataset) in dataset and not is_steady(dataset)
    steps = varies and np.unique(speeds).size <= _SPEEDS
    has_peak = any(str(name).startswith("bonds_rupture") for name in dataset.variables)
    less = {"sweep": best in ("theories", "curve") or not lasts, "friction": best in ("creep", "stability")}
    less["curve"] = best == "creep"  # whose speed nothing sets
    less["stress"] = best != "stress" and (best == "stability" or steps or not has_peak)
    # time is no more than another axis for a speed that rises or for creep, and nothing happens in it where a run lasts
    less["time"] = best in ("curve", "creep", "stability") or (best != "time" and lasts and "incipient" not in could)
    shown = [best, *(kind for kind in others if not less.get(kind, False))]
    if points is not None and of_points not in shown:
        shown.insert(0, of_points)
    return [
        _drawing(dataset, kind, f"f{number}-", points, kind == of_points)
        for number, kind in enumerate(dict.fromkeys(shown))
    ]


def _drawing(dataset: xr.Dataset, kind: str, prefix: str, points: Measured | None, needed: bool) -> Drawing:
    """Return a figure, with measured points if it can show them; raise ValueError if it cannot and they are needed."""
    drawing = Drawing(kind, kinds.KINDS[kind].shows, HINTS.get(kind, ""))
    if points is not None and "data" in kinds.KINDS[kind].takes:
        measured = copy.copy(points)
        measured.forget()
        with contextlib.nullcontext() if needed else contextlib.suppress(ValueError):
            svg = svg_of(kinds.draw(dataset, kind, Choices(data=measured)), prefix)
            return drawing._replace(hint=f"{drawing.hint} Rings are measured points.", svg=svg, measured=measured)
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
    if layout := figure.get_layout_engine():  # here, as saving would draw the figure twice
        with mpl.rc_context(STYLE):
            layout.execute(figure)
        figure.set_layout_engine(None)
    for panel in figure.axes:  # matplotlib simplifies lines alone
        for band in panel.collections:
            if isinstance(band, PolyCollection):
                band.set_verts([_thinned(np.asarray(path.vertices), panel) for path in band.get_paths()])
    figure.savefig(content, format="svg", transparent=True, dpi=fineness)  # of images within it
    text = content.getvalue().decode()
    for pattern, replacement in _LEFT_OUT.items():
        text = re.sub(pattern, replacement, text, flags=re.DOTALL)
    text = _COORDINATES.sub(lambda match: _NUMBER.sub(lambda number: f"{float(number[0]):.2f}", match[0]), text)
    text = _REFERENCE.sub(rf"\1{prefix}", text)
    for ink, colour in _INKS.items():
        text = text.replace(ink, colour)
    width, height = 72.0 * figure.get_size_inches()
    style = f"min-width: {0.9 * width:.0f}px; max-width: {1.9 * width:.0f}px"
    return f'<svg viewBox="0 0 {width:g} {height:g}" role="img" fill="currentColor" style="{style}">{text}'


def _thinned(corners: np.ndarray, panel: Axes) -> np.ndarray:
    """Return fewer corners of a polygon that looks the same."""
    placed = panel.transData.transform(corners)
    if len(corners) < _CORNERS or not np.all(np.isfinite(placed)):
        return corners
    fewer = Outline(placed).cleaned(simplify=True)
    drawn = np.isin(np.asarray(fewer.codes), (Outline.MOVETO, Outline.LINETO))
    return panel.transData.inverted().transform(np.asarray(fewer.vertices)[drawn])


# -- measured points and a fit --------------------------------------------------------------


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
    """Agreement of measured points with a run: one row a curve and one for all, or the reason why there is none.

    The ``remark`` counts points that are left out.
    """

    rows: Rows
    lacks: str = ""
    remark: str = ""


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
    # the residuals of each column and curve once, for curves of one branch
    once = [{(r.name, r.line.number): r for r in reversed(each.residuals) if r.branches == 1} for each in drawn]
    most = max(range(len(drawn)), key=lambda k: sum(map(_count, once[k].values())))
    measured, curves = drawn[most], list(once[most].values())[::-1]
    if not curves:
        keys = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]
        lacks = "no curve of the run covers the measured points, or the curve has several branches"
        if not all(map(measured.column, keys)):
            lacks = f"the run has several curves; give the points a column {keys[0]}, or choose one curve by --where"
        if not measured.has_errors:
            lacks = "the measured points have no errors; give them in a column such as contact_area_error"
        return Agreement([], lacks, measured.remark)
    rows = [_row(_label(dataset, curve), [curve]) for curve in curves]
    freedom = sum(map(_count, curves))
    fitted = len(fit.rows) if fit and fit.in_run and freedom - len(fit.rows) == fit.freedom else 0
    if len(curves) > 1 or fitted:
        rows.append(_row(f"all, {fitted} numbers fitted" if fitted else "all", curves, fitted))
    return Agreement(rows, "", measured.remark)


def _count(residuals: Residuals) -> int:
    return int(np.sum(np.isfinite(residuals.values)))


def _label(dataset: xr.Dataset, residuals: Residuals) -> str:
    """Return the quantity of a column with the swept values of its curve."""
    texts = []
    for name, place in residuals.line.point.items():
        value = dataset[name][place]
        number = engineering(value.item(), value.attrs.get("units", "1")) if value.dtype.kind in "fi" else value.item()
        texts += [f"{name.replace('_', ' ')} {number}"] if dataset.sizes[name] > 1 else []
    known = dataset[residuals.name].attrs if residuals.name in dataset else {}
    words = known.get("long_name", residuals.name.replace("_", " ")).partition(",")[0]
    return words + (f" ({', '.join(texts)})" if texts else "")


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
        raise BadInput([f"{path}: is not a result of `sim fit`; name the file STEM_fit.json that it wrote"]) from None


def _read(content: dict[str, Any], dataset: xr.Dataset) -> Fit:
    rows, in_run = [], []
    for key, number in content["numbers"].items():
        unit, value, error = str(number["unit"]), float(number["value"]), np.float64(number["standard_error"])
        factor, shown = scaled(value, unit)
        low, high = (_end(factor * np.float64(number[end]), bool(number[f"{end}_open"])) for end in ("low", "high"))
        run = math.nan
        with contextlib.suppress(KeyError, ValueError):  # of a scenario that has no such number, or several
            run = float(setting(dataset, key).item())
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
    notes += [] if all(in_run) else ["this run has other values than the fit: run its scenario STEM_fit.toml"]
    if not rows:
        raise ValueError
    few = correlations if len(keys) > 1 else []
    return Fit(rows, few, [*notes, *map(str, content["remarks"])], freedom, all(in_run))


def _number(value: Any) -> str:
    return "–" if value is None else f"{float(value):.2f}".replace("-", "−")


def _end(end: float, is_open: bool) -> str:
    """Return an end of an interval; "(bound)" if the bound of the key sets it, "unknown" if nothing does."""
    return "unknown" if math.isnan(end) else f"{end:.4g}" + (" (bound)" if is_open else "")


# -- the page -------------------------------------------------------------------------------


#: Rows of a table.
_ROWS = 24
#: Largest dataset that is read whole into memory [byte].
_WHOLE = 2**29
#: Standard error that counts as zero.
_ROUNDING = 1e-12
#: Attributes on where a dataset comes from, in the page's words.
_PROVENANCE = {
    "source": "written by", "history": "scenario and versions", "seed": "seed", "members": "members",
    "joined": "of several runs or some members, but the scenario describes one run",
    "references": "references", "Conventions": "conventions of the file",
}  # fmt: skip


def written(
    dataset: xr.Dataset, source: Path, path: Path | None, replace: bool,
    data: Path | None = None, fit: Path | None = None, lost: Sequence[str] = (),
) -> Path:  # fmt: skip
    """Write the page of a dataset, by default beside its file, and return the path of the page.

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
        text = html(dataset, source, data, fit, lost)
    except BadInput:
        raise
    except ValueError as fault:
        raise BadInput([f"{source}: {fault}"]) from None
    with output(target) as beside:
        beside.write_text(text, encoding="utf-8")
    return target


def html(
    dataset: xr.Dataset, source: Path | str = "OUT.nc", data: Data | None = None, fit: Path | str | None = None,
    lost: Sequence[float | str] = (),
) -> str:  # fmt: skip
    """Return the page of a run as one text of HTML.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it; ``sim.analysis.where`` chooses values of its sweep.
    source : path
        The file that it is of: its name is in the commands that repeat the run, and ``<source>.log`` says what it cost.
    data : path or dict of str to array, optional
        Measured points, a CSV table or columns in SI by name, as ``sim plot --data`` takes them.
    fit : path, optional
        The result of ``sim fit`` for this scenario, ``<stem>_fit.json``.
    lost : sequence of float or str, optional
        Shares of JKR's area whose loss has a speed, such as ``["10 %"]``.

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
    stated, swept = statements(dataset, lost=lost), sweep_dims(dataset)
    rows, whole = table(dataset, _ROWS, stated), highlights(dataset, _ROWS, stated)
    headings = [heading.replace("\n", "").partition("(")[0].strip() for heading in (rows or [{}])[0]]
    keys = sum(heading in (*swept, "t") for heading in headings)
    wide = [rows, *([whole, *(of(dataset, _ROWS, stated) for of in (losses, phases))] if swept else [])]
    stem = Path(source).stem
    page = Environment(
        loader=FileSystemLoader(Path(__file__).parent), autoescape=True, undefined=StrictUndefined,
        # values marked as HTML stay as they are, texts lose control characters
        finalize=lambda value: plain(value) if type(value) is str else value, trim_blocks=True, lstrip_blocks=True,
    )  # fmt: skip
    return page.get_template("page.html").render(
        question=dict(zip(("name", "text", "more"), question(dataset), strict=True)),
        compared=agreement(dataset, points, fitted) if points else None,
        fitted=fitted,
        measured="; ".join(filter(None, [points[0].source, points[0].assumed])) if points else "",
        averaged=averaging(dataset, is_stationary(dataset)),
        drawings=figures,
        swept=bool(swept),
        key_figures=[] if swept else key_figures(dataset, stated),
        tables=[part for each in wide for part in narrow(each, min(keys, 3))],
        remarks=remarks(dataset),
        notes=notes(dataset, rows, whole, stated),
        known=known(dataset),
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


def question(dataset: xr.Dataset) -> tuple[str, str, list[str]]:
    """Return the name of a scenario, its question, and further paragraphs of its first comment.

    The question is the first paragraph of the comment, else the name.
    """
    text, name = str(dataset.attrs.get("scenario_toml", "")), str(dataset.attrs.get("title", "")) or "A run of sim"
    comment = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    lines = [line[1:].strip() for line in comment]
    question, *more = [" ".join(part.split()) for part in "\n".join(lines).split("\n\n") if part.strip()] or [name]
    return name, question, more


def changes(dataset: xr.Dataset) -> dict[str, str]:
    """Return the values that replace the scenario's, by key, as TOML."""
    return {key: toml(value) for key, value in hdf5.tables(dataset.attrs.get("scenario_overrides")).items()}


def scenario(dataset: xr.Dataset) -> str:
    """Return the scenario's text; for a scenario from Python all of its keys, as JSON."""
    text = str(dataset.attrs.get("scenario_toml", ""))
    if not text:
        text = json.dumps(hdf5.tables(dataset.attrs["scenario_resolved"]), indent=2, ensure_ascii=False)
    return text.expandtabs(4)


def commands(dataset: xr.Dataset, stem: str) -> list[str]:
    """Return the commands that repeat a run of ``<stem>.toml``, or of ``<stem>.json`` for a scenario from Python."""
    if not dataset.attrs.get("scenario_toml"):
        return [f'sim.run(json.load(open("{stem}.json")), to="{stem}.nc")']
    words = [f"--set {shlex.quote(f'{key}={value}')}" for key, value in changes(dataset).items()]
    name, output = (shlex.quote(f"{stem}.{ending}") for ending in ("toml", "nc"))
    return [" ".join(["sim run", name, "-o", output, *words]), f"sim stats {output}", f"sim report {output}"]


def cost(log: Path) -> dict[str, str]:
    """Return the cost of the run from the last line of its log; nothing without a log."""
    try:
        entry = json.loads(log.read_text(encoding="utf-8").splitlines()[-1])
        stages = {f"of it {name}": float(seconds) for name, seconds in entry["stages"].items()}
        times = {"in all": float(entry["seconds"])} | stages
        return {"began": str(entry["began"])} | {words: f"{seconds:.3g} s" for words, seconds in times.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def known(dataset: xr.Dataset) -> Rows:
    """Return the error estimates before the run, beside the errors measured in it.

    The spread of the fluctuation energy between members is the largest over the sweep at the last record. Its standard
    error is that of the jackknife over the members.
    """
    count, rows = int(dataset.attrs["members"]), list[tuple[str, str, str]]()
    spread_measured, error_measured = _spreads(dataset)
    if "member_spread_energy" in dataset:
        spread = float(dataset["member_spread_energy"].max())
        rows.append(("relative spread of ΔΓ between members", _percent(spread), spread_measured))
        if count > 1:
            words = f"relative standard error of the mean ΔΓ of {count} members"
            rows.append((words, _percent(spread / math.sqrt(count)), error_measured))
    rows += [(str(each), "systematic", "–") for each in systematic_errors(dataset)]
    times = np.unique(np.linspace(0, dataset.sizes["t"] - 1, _ROWS).round().astype(int))
    ratios = over_members(dataset.isel(t=times), ["area_ratio"], quantiles=False)
    if "area_ratio_sem" in ratios and (error := float(ratios["area_ratio_sem"].max())) > _ROUNDING:
        rows.append((f"largest standard error of the mean A/A_JKR, of {times.size} times", "–", _percent(error)))
    return [dict(zip(("error", "estimate", "measured"), row, strict=True)) for row in rows]


def _spreads(dataset: xr.Dataset) -> tuple[str, str]:
    """Return the largest standard deviation of ΔΓ over its mean in the sweep, and that of the mean."""
    if "fluctuation_energy" not in dataset or "member" not in dataset["fluctuation_energy"].dims:
        return "–", "–"
    energy = dataset["fluctuation_energy"].isel(t=-1).astype(float).transpose(*sweep_dims(dataset), "member").to_numpy()
    rows = [row for row in energy.reshape(-1, energy.shape[-1]) if len(row) > 2 and 0.0 < np.mean(row) < np.inf]
    if not rows:
        return "–", "–"
    row = max(rows, key=lambda each: np.std(each) / np.mean(each))
    count, squares = len(row), np.sum(row**2)
    spread = np.std(row, ddof=1) / np.mean(row)
    means = (np.sum(row) - row) / (count - 1)
    each = np.sqrt(np.maximum((squares - row**2) / (count - 1) - means**2, 0.0) * (count - 1) / (count - 2)) / means
    error = math.sqrt(count - 1) * np.std(each)
    return _percent(spread, error), _percent(spread / math.sqrt(count), error / math.sqrt(count))


def _percent(value: float, error: float = 0.0) -> str:
    return f"{concise(100.0 * value, 100.0 * error)} %" if error else f"{100.0 * value:.3g} %"
