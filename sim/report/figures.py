"""Figures as SVG within a page, with ids that do not clash and in the page's colours."""

import contextlib
import io
import re
from collections.abc import Mapping
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
from matplotlib.path import Path

from sim.analysis import is_stationary, is_steady, speed_of
from sim.analysis.scene import speed_name
from sim.plots import kinds
from sim.plots.choices import Choices
from sim.plots.measured import Measured
from sim.plots.style import STYLE

#: Measured points: a CSV table, or columns in SI by name.
Data = FilePath | str | Mapping[str, Any]

#: Hint of how to read a figure of each kind.
HINTS = {
    "loop": "A cross is a pull-off, a ring a jump into contact; the enclosed area is energy lost.",
    "theories": "Measured areas tell theories apart where their curves separate.",
    "stress": "A mark is the maximum of the stress; thin lines are closed forms.",
    "stability": "Dark is stick-slip; below the line steady sliding is unstable in theory.",
    "creep": "A line of slope one is sliding at a constant speed; a line that bends up runs away.",
    "friction": "The area of the friction loop is the work of friction.",
    "curve": "Blue is lost to broken bonds, vermilion to fluctuations; adhesion is masked on Hertz's dotted line.",
    "sweep": "Each point is a run of its own.",
    "time": "The contact lies between JKR's radius and Hertz's.",
    "incipient": "Slip begins where the area leaves the dashed law.",
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
_NUMBER = re.compile(r"\d+\.\d{3,}")
_REFERENCE = re.compile(r"url\(#([^)]+)\)")


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
    """Return a figure, with measured points if it can show them."""
    if data is not None and "data" in kinds.KINDS[kind].takes:
        with contextlib.suppress(ValueError):
            return _with_data(dataset, kind, prefix, data)
    drawing = Drawing(kind, kinds.KINDS[kind].shows, HINTS.get(kind, ""))
    try:
        return drawing._replace(svg=svg_of(kinds.draw(dataset, kind), prefix))
    except ValueError as fault:  # a fault that only the drawing of the kind detects
        return drawing._replace(lacks=str(fault))


def _with_data(dataset: xr.Dataset, kind: str, prefix: str, data: Data) -> Drawing:
    """Return a figure with measured points; raise ValueError if it cannot show them."""
    measured = Measured(data, dataset)
    svg = svg_of(kinds.draw(dataset, kind, Choices(data=measured)), prefix)
    hint = f"{HINTS.get(kind, '')} Rings are measured points."
    return Drawing(kind, kinds.KINDS[kind].shows, hint, svg, measured=measured)


def _rupture(dataset: xr.Dataset) -> bool:
    return any(str(name).startswith("bonds_rupture") for name in dataset.variables)


def _steps(dataset: xr.Dataset) -> bool:
    """Whether the speed is one of a few in the course of a run."""
    recorded = speed_name(dataset) in dataset and not is_steady(dataset)
    return recorded and np.unique(speed_of(dataset).to_numpy()).size <= _SPEEDS


def svg_of(figure: Figure, prefix: str) -> str:
    """A figure as an SVG element for a page of HTML.

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
    width, height = 72.0 * figure.get_size_inches()
    root.attrib = {"viewBox": f"0 0 {width:g} {height:g}", "role": "img", "fill": "currentColor"}
    root.set("style", f"min-width: {0.9 * width:.0f}px; max-width: {1.9 * width:.0f}px")
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
