"""Look of pictures: style, colours, units on axes, symbols, letters and legends.

Each colour has one meaning: blue for broken bonds, vermilion for shear fluctuations, black for the contact with both.
Grey lines are closed forms, such as JKR and Hertz contacts.
"""

import io
import itertools
import re
import string
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.container import ErrorbarContainer
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.ticker import LogLocator, NullFormatter

from sim.numerics.files import output
from sim.plots.layout import Layout
from sim.read import engineering, scaled, sweep_dims
from sim.read.dataset import ensemble_mean

COLUMN, WIDE = 3.4, 7.0  # inches: one column, both columns
_ON_SCREEN = 120  # dots an inch

BONDS, FLUCTUATIONS, BOTH, REFERENCE = "#0072B2", "#D55E00", "#000000", "#777777"

#: Colours of several curves.
LINES = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


#: Colours of many curves, none too light for paper.
def part_of(colours: str, first: float, last: float) -> mpl.colors.ListedColormap:
    """Return the part of a colour map between two of its places, of 0 to 1."""
    return mpl.colors.ListedColormap(
        mpl.colormaps[colours](np.linspace(first, last, 256))
    )


SHADES = part_of("viridis", 0.0, 0.92)

#: Name of bars or of a band about a mean in a legend.
ERROR = "± standard error"
#: A closed form beneath what was simulated, a line that only guides the eye, and a marker with a white face.
GREY: Any = {"color": REFERENCE, "linewidth": 0.9, "zorder": 1.5}
GUIDE: Any = {"color": REFERENCE, "linewidth": 0.5, "zorder": 1}
HOLLOW: Any = {"marker": "o", "markersize": 3.5, "mfc": "white", "linestyle": "none"}

#: Look of all legends.
LEGEND: Any = {
    "borderaxespad": 0.2,
    "handletextpad": 0.5,
    "labelspacing": 0.25,
    "alignment": "left",
    "title_fontsize": 7.0,
}

_TICKS = {"direction": "in", "labelsize": 7.5, "major.width": 0.6, "minor.width": 0.4}
STYLE: Any = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in _TICKS.items()},
    "xtick.top": True,
    "ytick.right": True,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.useoffset": False,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    "pdf.fonttype": 42,
    "svg.hashsalt": "sim",
}


class Picture(Figure):
    """A figure that is saved in the style of its drawing; equal pictures give equal bytes."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save as PNG (400 dpi), PDF or SVG, by the extension; see ``matplotlib.figure.Figure.savefig``."""
        undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(
            str(fname).rpartition(".")[2].lower()
        )
        with mpl.rc_context(STYLE):
            super().savefig(fname, **({"metadata": undated} | options))

    def _repr_png_(self) -> bytes:
        """Return the picture for a notebook."""
        shown = io.BytesIO()
        self.savefig(shown, format="png", dpi=_ON_SCREEN)
        return shown.getvalue()


def save(figure: Figure, path: Path) -> None:
    """Write a figure in the format of the path's suffix, by default PNG, whole or not at all."""
    with output(path) as beside:
        figure.savefig(beside, format=path.suffix.removeprefix(".").lower() or "png")


def rows(heights: list[float], shared: bool = True) -> tuple[Figure, list[Axes]]:
    """Return a picture of one column: lettered panels of given heights [in], with one x axis if shared."""
    size = COLUMN, 0.45 + sum(heights)
    figure, axes = _panels(
        size, (len(heights), 1), sharex=shared, height_ratios=heights
    )
    figure.align_ylabels(axes)
    return figure, axes


def pairs(height: float, shared: bool = False) -> tuple[Figure, list[Axes]]:
    """Return a picture of two columns and a height [in]: a lettered pair of panels, with one y axis if shared."""
    return _panels((WIDE, height), (1, 2), sharey=shared)


def _panels(
    size: tuple[float, float], count: tuple[int, int], **options: Any
) -> tuple[Figure, list[Axes]]:
    """Return a picture of a size [in] with its own canvas, and its panels, with letters if there are more than one."""
    figure = Picture(figsize=size, dpi=400, layout=Layout())
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(*count, squeeze=False, **options).flat)
    for panel in axes:
        panel.locator_params(axis="y", min_n_ticks=3)
    corner: Any = {
        "xycoords": "axes fraction",
        "textcoords": "offset points",
        "ha": "right",
        "va": "bottom",
    }
    for mark, panel in zip(
        string.ascii_lowercase, axes if len(axes) > 1 else (), strict=False
    ):
        panel.annotate(f"({mark})", (0.0, 1.0), (-2, 4), fontweight="bold", **corner)
    return figure, axes


def swept_value(dataset: xr.Dataset, name: str, at: int) -> str:
    """Return a swept value with its symbol and in a unit that suits it, ``P = 4 mN``."""
    coordinate = dataset[name]
    value, unit = coordinate[at].item(), coordinate.attrs.get("units", "1")
    if isinstance(value, str):
        return value
    words = symbol(coordinate)
    # the letters of pure numbers are known to few
    if not words or unit == "1":
        key = name.partition("_")[2] or name
        words = f"{key.replace('_', ' ')} {words}".strip()
    return f"{words} = {text_of(value, unit)}"


def shades(count: int) -> list[str]:
    """Return colours of some curves."""
    many = [mpl.colors.to_hex(shade) for shade in SHADES(np.linspace(0.0, 1.0, count))]
    return list(LINES[:count]) if count <= len(LINES) else many


def swept(dataset: xr.Dataset) -> list[str]:
    """Return the dimensions of the sweep with more than one value."""
    return [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]


def recorded(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable of each member, or its mean if only statistics are recorded."""
    return ensemble_mean(dataset[name]).astype(float)


def mean_of(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return the mean of a variable over the members."""
    values = recorded(dataset, name)
    return values.mean("member") if "member" in values.dims else values


def number_at(variable: xr.DataArray, at: dict[str, int]) -> float:
    """Return a number at a point of the sweep, whether it is swept or not."""
    return float(variable.isel(at, missing_dims="ignore"))


def contact_circle(panel: Axes, radius: float) -> Circle:
    """Draw the edge of the contact on a map and return it."""
    circle = Circle((0.0, 0.0), radius, fill=False, linewidth=1.2, color=BOTH)
    panel.add_patch(circle)
    return circle


def text_of(value: Any, unit: str) -> str:
    """Return a number with its unit: ``305.2 kPa``."""
    return engineering(float(value), unit).replace("-", "−")


def rounded(value: Any, unit: str) -> str:
    """Return a number with its unit in three digits: ``305 kPa``."""
    return text_of(f"{value:.3g}", unit)


_GREEK = re.compile(
    r"(?<![A-Za-z])(alpha|beta|rho|tau|nu|chi|delta|sigma|xi|theta|lambda|DeltaGamma|Delta)(?![A-Za-z])"
)


def symbol(variable: xr.DataArray) -> str:
    """Return the variable's symbol as mathematics."""
    text = variable.attrs.get("symbol", "")
    text = re.sub(r"(?<=[^\W\d_])(\d+)$", r"_\1", text)
    text = _GREEK.sub(
        lambda m: r"\Delta\Gamma" if m[1] == "DeltaGamma" else rf"\{m[1]}", text
    )
    text = re.sub(r"_(\w+)", r"_{\1}", text).replace("*", "^*")
    return f"${text}$" if text else ""


def named(variable: xr.DataArray, with_symbol: bool = True) -> str:
    """Return the meaning of a variable or of its mean, and its symbol: ``normal load $P$``."""
    words = (
        str(variable.attrs.get("long_name", variable.name))
        .removeprefix("ensemble mean of ")
        .partition(",")[0]
    )
    return f"{words} {symbol(variable)}".strip() if with_symbol else words


class Unit(NamedTuple):
    """A factor from SI and the unit that it leads to."""

    factor: float
    name: str

    def label(self, words: str) -> str:
        """Return words with the unit in brackets, if there is one."""
        return f"{words} ({self.name})" if self.name else words

    @classmethod
    def of(cls, values: Any, unit: str, logarithmic: bool = False) -> "Unit":
        """Return the chosen unit, or the unit of the largest value; on a logarithmic axis of their middle."""
        sizes = np.abs(values)
        sizes = sizes[np.isfinite(sizes) & (sizes > 0.0)]
        most = sizes.max(initial=0.0)
        return cls(
            *scaled(
                np.sqrt(sizes.min(initial=most) * most) if logarithmic else most, unit
            )
        )


def in_unit(axis: Axis, words: str, values: Any, si: str) -> float:
    """Label an axis with words and the unit that suits values [SI], and return the factor to that unit."""
    unit = Unit.of(values, si)
    axis.set_label_text(unit.label(words))
    return unit.factor


def axis_scale(values: np.ndarray) -> str:
    """Return ``log`` if positive values span a decade or more, ``symlog`` if zero is among them, else ``linear``.

    An axis with zero is linear if most values lie far from it, as those of a ramp from rest.

    >>> axis_scale(np.linspace(0.0, 1.0, 500)), axis_scale(np.array([0.0, 0.01, 0.1, 1.0]))
    ('linear', 'symlog')
    """
    above = np.sort(values[values > 0.0])
    if np.any(values < 0.0) or above.size < 2 or above[-1] < 10.0 * above[0]:
        return "linear"
    if above.size == values.size:
        return "log"
    middle = above[(above.size - 1) // 2]
    is_near_zero = above[-1] >= max(100.0 * above[0], 4.0 * middle)
    return "symlog" if is_near_zero else "linear"


def legend(
    panel: Axes,
    title: str = "",
    whole: bool = False,
    without: Collection[str] = (),
    further: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Draw a legend above a panel, each label once and none of a line without a point.

    Labels ``without`` are left out, and ``further`` ones of other panels are added.

    That of a ``whole`` figure, or of the first of panels in a column, belongs to the
    figure, so that a title of the panel has its place below it.
    """
    entries: dict[str, Any] = {}
    for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
        is_drawn = _is_drawn(handle, panel.get_yscale() == "log")
        if is_drawn and label not in without:
            entries.setdefault(label, handle)
    entries = {**further, **entries}
    if not entries and not title:
        return
    figure, spec = cast(Figure, panel.figure), panel.get_subplotspec()
    is_column = spec is not None and spec.get_gridspec().ncols == 1
    is_first = isinstance(figure, Picture) and panel is figure.axes[0]
    look = LEGEND | {"title": title or None}
    if is_first and (is_column or whole):
        for former in figure.legends:
            former.remove()
        look["loc"] = "outside upper left"
        figure.legend(entries.values(), entries, **look)
    else:
        look |= {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0)}
        panel.legend(entries.values(), entries, **look)
    # of somebody else's figure, unless that has a layout that places no legends
    if type(figure.get_layout_engine()) in (type(None), ConstrainedLayoutEngine):
        figure.set_layout_engine(Layout())


def _is_drawn(handle: Any, is_logarithmic: bool) -> bool:
    """Return True unless all points of a line, or of one with error bars, are missing or have no logarithm."""
    line = handle[0] if isinstance(handle, ErrorbarContainer) else handle
    if not isinstance(line, Line2D) or not np.size(line.get_ydata()):
        return True  # a sample of a look has no points
    x, y = (np.asarray(each, float) for each in line.get_data())
    is_shown = np.isfinite(x) & np.isfinite(y)
    return bool(np.any(is_shown & ((y > 0.0) | (not is_logarithmic))))


def head(figure: Figure, words: list[str]) -> None:
    """Write words at the top of a figure, into its first legend if it has any."""
    legends = [*figure.legends, *(panel.get_legend() for panel in figure.axes)]
    for legend in filter(None, legends):
        title = legend.get_title().get_text()
        words = [text for text in words if text not in title]
        legend.set_title("; ".join(filter(None, [", ".join(words), title])))
        return
    words = list(filter(None, [figure.get_suptitle(), *words]))
    figure.suptitle(", ".join(words), fontsize=mpl.rcParams["axes.titlesize"])


def fill(
    panel: Axes, x: np.ndarray, low: np.ndarray, high: np.ndarray, **look: Any
) -> None:
    """Draw a shaded band, one for each way back and forth, because a polygon that turns back hides itself."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    for first, last in itertools.pairwise([0, *turns, len(x) - 1]):
        part = slice(first, last + 1)
        panel.fill_between(x[part], low[part], high[part], linewidth=0, **look)


def upward(panel: Axes) -> None:
    """Let the y axis be logarithmic if each line that differs from zero has anything above it."""
    lines = [np.nan_to_num(np.asarray(line.get_ydata(), float)) for line in panel.lines]
    moving = [line for line in lines if np.any(line != 0.0)]
    if moving and all(np.any(line > 0.0) for line in moving):
        panel.set_yscale("log")


def across(
    panel: Axes, x: np.ndarray, words: str, scale: str = "linear", room: float = 0.0
) -> None:
    """Set the x axis from the least to the largest value, with some ``room`` for markers at its ends, and its label."""
    known = x[np.isfinite(x) & ((x > 0.0) | (scale != "log"))]
    # of a contact that never closes
    low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
    panel.set_xscale(
        scale, **({"linthresh": np.min(x[x > 0.0])} if scale == "symlog" else {})
    )
    if scale == "linear":
        panel.locator_params(axis="x", min_n_ticks=3)
    if scale == "log" and high >= 100.0 * low:
        # as many ticks at any width, which would else change the width
        panel.xaxis.set_major_locator(LogLocator(numticks=5))
    elif scale == "log":
        subs = (1.0, 3.0) if high >= 10.0 * low else (1.0, 2.0, 3.0, 5.0)
        panel.xaxis.set_major_locator(LogLocator(subs=subs))
        panel.xaxis.set_major_formatter("{x:g}")
        panel.xaxis.set_minor_formatter(NullFormatter())
    if scale != "symlog" and high > low:
        axis, back = (np.log, np.exp) if scale == "log" else (np.array, np.array)
        ends = axis([low, high])
        panel.set_xlim(*back(ends + np.array([-room, room]) * np.ptp(ends)))
    panel.set_xlabel(words)
