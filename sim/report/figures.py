"""Figures as SVG within a page: without names that clash, in the page's colours, with values that show on hover."""

import contextlib
import io
import itertools
import re
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import Any, NamedTuple
from xml.etree import ElementTree as Tree

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path

from sim.analysis import is_stationary, is_steady, speed_of
from sim.analysis.scene import speed_name
from sim.plots import kinds
from sim.plots.bond_laws import rest_of
from sim.plots.choices import Choices
from sim.plots.measured import Measured
from sim.plots.style import STYLE
from sim.units.terminal import one_line

#: Measured points: a CSV table, or columns in SI by name.
Data = FilePath | str | Mapping[str, Any]

#: What to look at in a figure of each kind.
SEE = {
    "loop": "Going out and coming back are two curves: the area between them is energy lost in jumps, a cross where the"
    " contact comes off, a ring where it jumps in. Dashed is JKR's contact at the full work of adhesion.",
    "theories": "The simulated areas lie on the curve of the theory whose balance they have; where curves part, a"
    " measured area can tell between them.",
    "stress": "Where the stress has a maximum a mark shows it, and the legend says how large it is; thin lines are"
    " closed forms to hold the simulation to.",
    "stability": "Dark is where the slider sticks and slips, white where it slides steadily. Below the line steady"
    " sliding is unstable in theory; dark beyond it on the way back is hysteresis.",
    "creep": "A straight line of slope one is sliding at a constant speed; what bends up runs away.",
    "friction": "Above, friction over time; below, over the slider's position, where the area of the loop is the work"
    " that friction takes.",
    "curve": "From JKR's line at 1 down is the area that is lost, of a single curve blue to broken bonds and vermilion"
    " to fluctuations; the full line is what is left. Where it meets the dotted line of Hertz, adhesion is masked.",
    "sweep": "Each point is a run of its own. The contact lies between JKR's radius, with all adhesion, and Hertz's,"
    " with none.",
    "time": "The contact between JKR's radius, with all adhesion, and Hertz's, with none, and below what moves it.",
    "phase": "A closed orbit is stick-slip: the force grows while the slider rests, and falls while it is faster than"
    " the stage.",
    "incipient": "On the way to sliding the area falls with the square of the force at first; where it leaves the"
    " dashed law, slip has begun.",
    "map": "The shear stress fluctuates about its mean; the circle is the edge of the contact.",
    "spectrum": "The spectrum of the maps beside the one that the scenario asks for.",
    "profile": "The gap beyond the contact's edge: the neck is what adhesion pulls up.",
}
#: The figure of stresses after starts from rest, and what to look at in it.
_STARTS = (
    "Shear stress after the start of sliding, and its peak over speed or time at rest.",
    "A dot is a peak that the stress falls from, a ring the largest stress where that is not resolved; thin lines are"
    " closed forms: the peak if no bond rebinds, and steady sliding.",
)
#: What to look at where there are measured points with errors.
_RESIDUALS = " The lowest panel has their distances from the curve, in standard errors σ of both."
#: Kinds that are drawn wherever they can be, beside those that fit.
_ALSO = ("stress", "phase", "incipient", "map", "spectrum")
#: Different speeds at which a run that changes between them has transients rather than a curve over speed, at most.
_SPEEDS = 4
#: Points of a curve that show their values, and of a figure.
_POINTS, _MOST = 40, 800
#: Corners of a shaded band from which on some are left out.
_CORNERS = 300
#: Inks of figures that follow the page from light to dark.
_INKS = {"#000000": "currentColor", "#ffffff": "var(--paper)"}
#: Letters of mathematics in plain text.
_LETTERS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "Gamma": "Γ", "delta": "δ", "Delta": "Δ", "theta": "θ", "lambda": "λ",
    "nu": "ν", "xi": "ξ", "pi": "π", "sigma": "σ", "tau": "τ", "chi": "χ", "psi": "ψ", "oint": "∮", "langle": "⟨",
    "rangle": "⟩", "times": "×", "pm": "±", "infty": "∞",
}  # fmt: skip
_NUMBER = re.compile(r"\d+\.\d{3,}")
_REFERENCE = re.compile(r"url\(#([^)]+)\)")


class Drawing(NamedTuple):
    """A figure of a page: its kind, what it shows and what to see in it, and its SVG; without one what it lacks.

    ``measured`` is what of measured points it has drawn.
    """

    kind: str
    shows: str
    see: str
    svg: str = ""
    lacks: str = ""
    measured: Measured | None = None


def drawings(dataset: xr.Dataset, data: Data | None = None) -> list[Drawing]:
    """The figures of a dataset: the one that fits it best, then others that show more of it.

    Measured points are in those that have their variables; if there is none, in another that has.

    Raises
    ------
    ValueError
        If measured points cannot be drawn in any figure.
    """
    best = kinds.default(dataset)
    could = kinds.drawable(dataset)
    others = [kind for kind in could if kind in _ALSO or kinds.KINDS[kind].fits(dataset)]
    # theories have an axis of their own; the end of a run that is on its way says little, and over the speed a sweep
    # is a curve already; only bonds with a rupture law have a maximum of the stress, which transients after steps
    # between few speeds do not show, nor many springs upon each other
    lasts = is_stationary(dataset)
    less = {"sweep": best in ("theories", "curve") or not lasts, "friction": best in ("creep", "stability")}
    less["curve"] = best == "creep"  # whose speed nothing sets
    less["stress"] = best != "stress" and (best == "stability" or _steps(dataset) or not _rupture(dataset))
    # time is no more than another axis for a speed that rises or for creep, and nothing happens in it where a run lasts
    less["time"] = best in ("curve", "creep", "stability") or (best != "time" and lasts and "incipient" not in could)
    shown = [best, *(kind for kind in others if not less.get(kind, False))]
    found = [_drawing(dataset, kind, f"f{number}-", data) for number, kind in enumerate(dict.fromkeys(shown))]
    if data is None or any(one.measured for one in found):
        return found
    refusals = []
    for kind in (kind for kind in could if kind not in shown and "data" in kinds.KINDS[kind].takes):
        try:
            return [_with_data(dataset, kind, "f-data-", data), *found]
        except ValueError as fault:
            refusals.append(str(fault))
    for kind in (kind for kind in shown if "data" in kinds.KINDS[kind].takes):
        _with_data(dataset, kind, "", data)  # refuses it
    raise ValueError(refusals[0] if refusals else "no figure of this run can have measured points")


def _drawing(dataset: xr.Dataset, kind: str, prefix: str, data: Data | None) -> Drawing:
    """A figure, with measured points where it can have them."""
    if data is not None and "data" in kinds.KINDS[kind].takes:
        with contextlib.suppress(ValueError):
            return _with_data(dataset, kind, prefix, data)
    found = _captioned(dataset, kind)
    try:
        return found._replace(svg=svg_of(kinds.draw(dataset, kind), prefix))
    except ValueError as fault:  # such as what one kind alone finds out as it draws
        return found._replace(lacks=str(fault))


def _with_data(dataset: xr.Dataset, kind: str, prefix: str, data: Data) -> Drawing:
    """A figure with measured points; errors as of those that cannot be drawn in it."""
    measured = Measured(data, dataset)
    figure, found = kinds.draw(dataset, kind, Choices(data=measured)), _captioned(dataset, kind)
    points = f"Rings are measured points{' with their standard errors' if measured.has_errors else ''}."
    points += _RESIDUALS if measured.residuals and any("residual" in one.get_ylabel() for one in figure.axes) else ""
    return found._replace(see=f"{found.see} {points}", svg=svg_of(figure, prefix), measured=measured)


def _captioned(dataset: xr.Dataset, kind: str) -> Drawing:
    """A figure that is not drawn yet, with its caption."""
    if kind == "stress" and rest_of(dataset) is not None:
        return Drawing(kind, *_STARTS)
    return Drawing(kind, kinds.KINDS[kind].shows, SEE.get(kind, ""))


def _rupture(dataset: xr.Dataset) -> bool:
    return any(str(name).startswith("bonds_rupture") for name in dataset.variables)


def _steps(dataset: xr.Dataset) -> bool:
    """Whether the speed is one of a few in the course of a run."""
    recorded = speed_name(dataset) in dataset and not is_steady(dataset)
    return recorded and np.unique(speed_of(dataset).to_numpy()).size <= _SPEEDS


def svg_of(figure: Figure, prefix: str) -> str:
    """A figure as an SVG element for a page of HTML.

    ``prefix`` begins all its ids. It has neither script nor namespaces, nor any address outside of itself; black and
    white are the page's ink and paper, and points of curves carry their values as a ``<title>``.
    """
    content, fineness = io.BytesIO(), figure.dpi
    figure.dpi = 72.0  # that of SVG
    FigureCanvasSVG(figure)
    if layout := figure.get_layout_engine():  # here, as saving would draw the figure twice
        with mpl.rc_context(STYLE):
            layout.execute(figure)
        figure.set_layout_engine(None)
    for panel in figure.axes:
        _thin(panel)
    figure.savefig(content, format="svg", transparent=True, dpi=fineness)  # of images within it
    root = Tree.fromstring(content.getvalue())
    for parent in list(root.iter()):
        for child in [child for child in parent if child.tag.endswith(("}metadata", "}style"))]:
            parent.remove(child)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
        element.text = element.tail = None
        for key, value in list(element.attrib.items()):
            del element.attrib[key]
            name = key.rpartition("}")[2]
            if name == "id":
                value = prefix + value
            elif name == "href" and value.startswith("#"):
                value = f"#{prefix}{value[1:]}"
            elif name in ("d", "x", "y"):
                value = _NUMBER.sub(lambda found: f"{float(found[0]):.2f}", " ".join(value.split()))
            elif name in ("style", "clip-path"):
                value = _REFERENCE.sub(rf"url(#{prefix}\1)", value)
                for ink, own in _INKS.items():
                    value = value.replace(ink, own)
            element.set(name, value)
    width, height = (72.0 * inches for inches in figure.get_size_inches())
    root.attrib = {"viewBox": f"0 0 {width:g} {height:g}", "role": "img", "fill": "currentColor"}
    root.set("style", f"min-width: {0.9 * width:.0f}px; max-width: {1.9 * width:.0f}px")
    points = Tree.SubElement(root, "g", {"class": "values"})
    for x, y, words in itertools.islice(_values(figure), _MOST):
        point = Tree.SubElement(points, "circle", {"cx": f"{x:.1f}", "cy": f"{height - y:.1f}", "r": "3"})
        Tree.SubElement(point, "title").text = words
    return Tree.tostring(root, encoding="unicode")


def _thin(panel: Axes) -> None:
    """Leave out corners of shaded bands that no eye can tell apart, as matplotlib does of lines alone."""
    for band in panel.collections:
        if isinstance(band, PolyCollection):
            band.set_verts([_thinned(np.asarray(path.vertices), panel) for path in band.get_paths()])


def _thinned(corners: np.ndarray, panel: Axes) -> np.ndarray:
    """Corners of a polygon, of many fewer that look the same."""
    placed = panel.transData.transform(corners)
    if len(corners) < _CORNERS or not np.all(np.isfinite(placed)):
        return corners
    fewer = Path(placed).cleaned(simplify=True)
    drawn = np.isin(np.asarray(fewer.codes), (Path.MOVETO, Path.LINETO))
    return panel.transData.inverted().transform(np.asarray(fewer.vertices)[drawn])


def _values(figure: Figure) -> Iterator[tuple[float, float, str]]:
    """Places [pt from the lower left corner] of points of the curves, and their values in words."""
    panels = [panel for panel in figure.axes if panel.get_xlabel() or panel.lines]
    names = {_look(line): line.get_label() for panel in panels for line in panel.lines if _is_named(line)}
    for panel in panels:
        below = [other.get_xlabel() for other in panel.get_shared_x_axes().get_siblings(panel)]
        axis = panel.get_xlabel() or next(filter(None, below), "")
        for line in panel.lines:
            if line.get_transform() != panel.transData or not line.get_visible():
                continue  # a level across the whole panel
            words = plain_text(str(names.get(_look(line), "")))
            yield from _points(panel, line, figure.dpi, f"{words}: " if words else "", axis)


def _points(panel: Axes, line: Line2D, dpi: float, name: str, axis: str) -> Iterator[tuple[float, float, str]]:
    """Points of one curve within its panel."""
    data = np.column_stack([np.asarray(values, float) for values in line.get_data()])
    data = data[np.all(np.isfinite(data), axis=1)]
    data = data[np.unique(np.linspace(0, len(data) - 1, _POINTS).round().astype(int))] if len(data) else data
    for place, (x, y) in zip(panel.transData.transform(data) if len(data) else (), data, strict=True):
        if panel.bbox.padded(1.0).contains(*place):
            yield *(72.0 / dpi * place), f"{name}{_number(axis, x)}, {_number(panel.get_ylabel(), y)}"


def _look(line: Line2D) -> tuple[str, str, str]:
    return str(line.get_color()), str(line.get_linestyle()), str(line.get_marker())


def _is_named(line: Line2D) -> bool:
    return bool(line.get_label()) and not str(line.get_label()).startswith("_")


def _number(label: str, value: float) -> str:
    """A value with the words and the unit of its axis.

    >>> print(_number("sliding speed $V$ (mm/s)", -2.5))
    sliding speed V = −2.5 mm/s
    """
    words, _, unit = plain_text(label).removesuffix(")").partition(" (")
    return f"{words} = {value:.4g} {unit}".strip().replace("-", "−")


def plain_text(label: str) -> str:
    r"""A label without the marks of mathematics, on one line.

    >>> print(plain_text(r"contact area $A/A_\mathrm{JKR}$, $\tau_0$"))
    contact area A/A_JKR, τ_0
    """
    text = re.sub(r"\\([A-Za-z]+) ?", lambda found: _LETTERS.get(found[1], ""), label.replace(r"\,", " "))
    return one_line(" ".join(re.sub(r"[${}]", "", text).split()))
