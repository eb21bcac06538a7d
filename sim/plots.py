"""Figures of a dataset, in the width of a journal's column.

``draw`` gives a matplotlib Figure with a canvas of its own: nothing here needs a display or touches
pyplot. One colour means one thing throughout: blue what broken bonds do, vermilion what shear
fluctuations do, black the contact with both; grey lines are JKR's and Hertz's contacts.
"""

import contextlib
import itertools
import json
import re
import textwrap
from collections.abc import Callable
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from pydantic import TypeAdapter
from scipy.signal import resample

from sim.analysis import (
    bond_work,
    engineering,
    is_steady,
    observables,
    scaled,
    setting,
    settled,
    share_observables,
    summary,
    sweep_dims,
)
from sim.grid import Grid
from sim.laws.halfspace import displacement
from sim.measured import periodogram, radial_average
from sim.memory import Growth
from sim.modes import Modes, modes
from sim.spectrum import Spectrum

_COLUMN, _WIDE = 3.4, 7.0  # inches: one column, both columns

#: Opacity of the shades that show what a mechanism takes.
_SHADE = 0.35

#: Points up to which each carries a marker.
_MARKED = 25

#: Pixels that a cell has at least in a picture.
_PIXELS = 384

_BONDS, _FLUCTUATIONS, _BOTH, _REFERENCE = "#0072B2", "#D55E00", "#000000", "#777777"
_LINES = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")

_STYLE: Any = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 8.0,
    "axes.labelsize": 8.0,
    "axes.titlesize": 8.0,
    "legend.fontsize": 7.0,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.2,
    "axes.formatter.use_mathtext": True,
    "figure.constrained_layout.h_pad": 0.03,
    "figure.constrained_layout.w_pad": 0.03,
    "pdf.fonttype": 42,
    "svg.hashsalt": "sim",
}


class Picture(Figure):
    """A figure that is saved in the style in which it was drawn; equal pictures give equal bytes."""

    def savefig(self, fname: Any, **options: Any) -> None:
        """Save as PNG (200 dpi), PDF or SVG, by the extension; see ``matplotlib.figure.Figure.savefig``."""
        undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(str(fname).rpartition(".")[2].lower())
        with mpl.rc_context(_STYLE):
            super().savefig(fname, **({"metadata": undated} | options))


def _picture(width: float, height: float) -> Picture:
    picture = Picture(figsize=(width, height), dpi=200, layout="constrained")
    FigureCanvasAgg(picture)
    return picture


class _Line(NamedTuple):
    """One curve of a panel: a point of the sweep, with what it is called."""

    number: int
    point: dict[str, int]
    label: str
    colour: str


class _Scene(NamedTuple):
    """Statistics laid out for panels: along a dimension, which may be time, one curve for each other point.

    ``x`` has shape (curves, points), in the unit of the axis.
    """

    found: xr.Dataset
    along: str
    lines: list[_Line]
    x: np.ndarray = np.empty((0, 0))

    @property
    def single(self) -> bool:
        return len(self.lines) == 1

    def placed(self, x: np.ndarray) -> "_Scene":
        """With x values: (points,) the same for all curves, or (curves, points)."""
        return self._replace(x=np.broadcast_to(x, (len(self.lines), self.found.sizes[self.along])))

    def values(self, name: str, line: _Line) -> np.ndarray:
        """A statistic along the x axis; nan where it is not known."""
        points = self.found.sizes[self.along]
        if name not in self.found:
            return np.full(points, np.nan)
        return np.broadcast_to(self.found[name].isel(line.point, missing_dims="ignore").to_numpy(), points)

    def all(self, *names: str) -> np.ndarray:
        """Statistics of all curves, shape (statistics * curves, points)."""
        return np.stack([self.values(name, line) for name in names for line in self.lines])

    def band(self, name: str, line: _Line) -> tuple[np.ndarray, np.ndarray]:
        """5 and 95 % quantiles, or one standard deviation on both sides where only that was recorded."""
        if f"{name}_quantile" in self.found:
            quantiles = self.found[f"{name}_quantile"].isel(line.point)
            return quantiles.isel(quantile=0).to_numpy(), quantiles.isel(quantile=-1).to_numpy()
        mean, spread = (self.values(f"{name}_{kind}", line) for kind in ("mean", "std"))
        return mean - spread, mean + spread

    def fluctuates(self, name: str) -> bool:
        """Whether members differ, so that there is a band to draw."""
        return any(bool(np.any(np.diff(self.band(name, line), axis=0) > 0.0)) for line in self.lines)

    def tells(self, name: str) -> bool:
        """Whether the observable is there and changes along the axis or between the curves."""
        values = self.all(f"{name}_mean")
        known = values[np.isfinite(values)]
        return known.size > 0 and bool(np.ptp(known) > 1e-12 * np.max(np.abs(known)))


def _stated(dataset: xr.Dataset) -> xr.Dataset:
    """Observables of all panels, with the shares where they can be told."""
    found = observables(dataset)
    with contextlib.suppress(ValueError):
        found = found.merge(share_observables(dataset))
    with contextlib.suppress(KeyError):
        found["bond_work"] = bond_work(dataset)
    return found


def _scene(dataset: xr.Dataset, along: str) -> _Scene:
    """Statistics along time (``"t"``) or along a dimension of the sweep, where they are of the second half."""
    stated = _stated(dataset)
    if along != "t":
        late = settled(stated) if is_steady(dataset) else stated.isel(t=slice(-1, None))
        stated = late.isel(t=0, drop=True)
    found = summary(stated)
    found["radius_jkr"], found["radius_hertz"] = dataset["radius_at_rest"], dataset["radius_without_adhesion"]
    others = [name for name in sweep_dims(dataset) if name != along]
    return _Scene(found, along, _lines_of(dataset, others))


def _lines_of(dataset: xr.Dataset, dims: list[str]) -> list[_Line]:
    points = [dict(zip(dims, at, strict=True)) for at in np.ndindex(*(dataset.sizes[name] for name in dims))]
    colours = list(_LINES)
    if len(points) > len(_LINES):
        colours = [mpl.colors.to_hex(c) for c in mpl.colormaps["viridis"](np.linspace(0.0, 0.92, len(points)))]
    names = [", ".join(_told(dataset, name, at[name]) for name in dims) for at in points]
    return [_Line(k, at, name, colours[k]) for k, (at, name) in enumerate(zip(points, names, strict=True))]


def _told(dataset: xr.Dataset, name: str, at: int) -> str:
    """A swept value in words, in the unit of the whole axis: ``P = 4 mN``."""
    coordinate = dataset[name]
    value = coordinate[at].item()
    if isinstance(value, str):
        return value
    unit = _Unit.of(coordinate.to_numpy(), coordinate.attrs.get("units", "1"))
    number = f"{value * unit.factor:.4g} {unit.name}".strip().replace("-", "−")
    return f"{_symbol(coordinate) or name.replace('_', ' ')} = {number}"


_GREEK = re.compile(r"(?<![A-Za-z])(tau|nu|chi|delta|sigma|xi|theta|lambda|DeltaGamma)(?![A-Za-z])")


def _symbol(variable: xr.DataArray) -> str:
    """The variable's symbol as mathematics."""
    text = variable.attrs.get("symbol", "")
    text = re.sub(r"(?<=[^\W\d_])(\d+)$", r"_\1", text)
    text = _GREEK.sub(lambda m: r"\Delta\Gamma" if m[1] == "DeltaGamma" else rf"\{m[1]}", text)
    text = re.sub(r"_(\w+)", r"_{\1}", text).replace("*", "^*")
    return f"${text}$" if text else ""


def _label(words: str, unit: str) -> str:
    return f"{words} ({unit})" if unit else words


class _Unit(NamedTuple):
    """A factor from SI and the unit it leads to."""

    factor: float
    name: str

    @classmethod
    def of(cls, values: np.ndarray, unit: str, logarithmic: bool = False) -> "_Unit":
        """The unit that suits the largest of some values, on a logarithmic axis the middle of them."""
        sizes = np.abs(values[np.isfinite(values) & (values != 0.0)])
        if not sizes.size:
            return cls(*scaled(0.0, unit))
        return cls(*scaled(float(np.sqrt(sizes.min() * sizes.max()) if logarithmic else sizes.max()), unit))


def _scale(values: np.ndarray) -> str:
    """``log`` where values above zero span a decade or more, ``symlog`` where zero is among them, else ``linear``."""
    above = values[values > 0.0]
    if np.any(values < 0.0) or above.size < 2 or above.max() < 10.0 * above.min():
        return "linear"
    if above.size == values.size:
        return "log"
    return "symlog" if above.max() >= 100.0 * above.min() else "linear"


def _letter(axes: list[Axes]) -> None:
    for letter, panel in zip("abcdefg", axes, strict=False):
        panel.annotate(
            f"({letter})", (0.0, 1.0), (-2, 4), xycoords="axes fraction", textcoords="offset points",
            ha="right", va="bottom", fontweight="bold",
        )  # fmt: skip


def _legend(panel: Axes, handles: list[Any]) -> None:
    """A legend above the panel, where no data are."""
    longest = max(len(handle.get_label().replace("$", "")) for handle in handles)
    panel.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3 if longest <= 16 else 2,
        borderaxespad=0.2, handletextpad=0.5, labelspacing=0.25,
    )  # fmt: skip


def _line_handles(scene: _Scene) -> list[Line2D]:
    """Legend entries of the curves, six at most, evenly chosen."""
    chosen = scene.lines
    if len(chosen) > 6:
        chosen = [chosen[k] for k in np.rint(np.linspace(0, len(chosen) - 1, 6)).astype(int)]
    return [Line2D([], [], color=line.colour, label=line.label) for line in chosen]


def _curve(panel: Axes, scene: _Scene, name: str, line: _Line, factor: float, colour: str, style: Any = "-") -> None:
    """The mean with its standard error, and the band of the members."""
    x = scene.x[line.number]
    mean, sem = (factor * scene.values(f"{name}_{kind}", line) for kind in ("mean", "sem"))
    low, high = scene.band(name, line)
    if np.any(high > low):
        _fill(panel, x, factor * low, factor * high, colour, 0.18)
    dots: Any = {"marker": "o", "markersize": 2.6} if scene.along != "t" and len(x) <= _MARKED else {}
    panel.plot(x, mean, linestyle=style, color=colour, **dots)
    if scene.along == "t":
        _fill(panel, x, mean - sem, mean + sem, colour, 0.45)
    elif np.any(sem > 0.0):
        panel.errorbar(x, mean, np.nan_to_num(sem), fmt="none", ecolor=colour, elinewidth=0.8, capsize=1.5)


def _fill(panel: Axes, x: np.ndarray, low: np.ndarray, high: np.ndarray, colour: str, alpha: float) -> None:
    """A shaded band; there and back one for each way, as a polygon that turns back hides itself."""
    turns = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
    for first, last in itertools.pairwise([0, *turns, len(x) - 1]):
        part = slice(first, last + 1)
        panel.fill_between(x[part], low[part], high[part], color=colour, alpha=alpha, linewidth=0)


def _radius_panel(panel: Axes, scene: _Scene) -> None:
    """Contact radius between Hertz's and JKR's."""
    unit = _Unit.of(scene.all("contact_radius_mean", "radius_jkr"), "m")
    _references(panel, scene, "radius", unit.factor)
    for line in scene.lines:
        _curve(panel, scene, "contact_radius", line, unit.factor, line.colour)
    panel.set_ylabel(_label("contact radius $a$", unit.name))


def _references(panel: Axes, scene: _Scene, name: str, factor: float, power: int = 1) -> None:
    """JKR's and Hertz's values: grey lines, in the curves' colours where there are several."""
    for line in scene.lines:
        for which, style in (("jkr", "--"), ("hertz", ":")):
            values = factor * scene.values(f"{name}_{which}", line) ** power
            _reference(panel, values, style, scene, line)


def _reference(panel: Axes, values: np.ndarray, style: Any, scene: _Scene, line: _Line) -> None:
    colour = _REFERENCE if scene.single else line.colour
    panel.plot(scene.x[line.number], values, linestyle=style, color=colour, linewidth=0.9, zorder=1.5)


def _reference_handles() -> list[Line2D]:
    styles: Any = (("--", "JKR"), (":", "Hertz"))
    return [Line2D([], [], color=_REFERENCE, linewidth=0.9, linestyle=style, label=label) for style, label in styles]


def _spread_handles(scene: _Scene, name: str) -> list[Patch]:
    """A legend entry for the band, where there is one."""
    if not scene.fluctuates(name):
        return []
    of_members = "5–95 % of members" if scene.single else "5–95 % band"
    text = of_members if f"{name}_quantile" in scene.found else "± 1 std. dev."
    return [Patch(facecolor=_BOTH, alpha=0.18, label=text)]


_ENERGIES: Any = (
    ("bond_work", r"bonds left, $\Delta\gamma(N)$", _BONDS, "-."),
    ("fluctuation_energy", r"fluctuations, $\Delta\Gamma$", _FLUCTUATIONS, "--"),
    ("work_of_adhesion", "left to the contact, $w$", _BOTH, "-"),
)


def _energy_panel(panel: Axes, scene: _Scene) -> None:
    """Work of the bonds left, fluctuation energy, and what both leave to the contact."""
    drawn = [entry for entry in _ENERGIES if np.any(np.nan_to_num(scene.all(f"{entry[0]}_mean")))]
    if not scene.single:  # one colour for each curve leaves line styles for the energies
        drawn = [entry for entry in drawn if entry[0] != "bond_work"]
    values = scene.all(*(f"{name}_mean" for name, *_ in drawn))
    unit = _Unit.of(values, "J/m^2")
    handles = []
    for name, text, own, style in drawn:
        curves = _distinct(scene, f"{name}_mean")
        for line in curves:
            colour = own if scene.single else _REFERENCE if len(curves) == 1 else line.colour
            _curve(panel, scene, name, line, unit.factor, colour, style)
        handles.append(Line2D([], [], color=own if scene.single else _REFERENCE, linestyle=style, label=text))
    if np.any(values <= 0.0):
        panel.axhline(0.0, color=_REFERENCE, linewidth=0.5, zorder=1)
    panel.set_ylabel(_label("energy per area", unit.name))
    _legend(panel, handles)


def _distinct(scene: _Scene, name: str) -> list[_Line]:
    """Curves that do not lie on an earlier one."""
    kept: list[_Line] = []
    for line in scene.lines:
        values = scene.values(name, line)
        if not any(np.array_equal(values, scene.values(name, other), equal_nan=True) for other in kept):
            kept.append(line)
    return kept


def _friction_panel(panel: Axes, scene: _Scene) -> None:
    unit = _Unit.of(scene.all("friction_force_mean"), "N")
    for line in scene.lines:
        _curve(panel, scene, "friction_force", line, unit.factor, line.colour)
    panel.set_ylabel(_label("friction $F$", unit.name))


def _area_panel(panel: Axes, scene: _Scene) -> None:
    """Contact area between Hertz's and JKR's."""
    unit = _Unit.of(np.pi * scene.all("radius_jkr") ** 2, "m^2")
    _references(panel, scene, "radius", np.pi * unit.factor, power=2)
    for line in scene.lines:
        _curve(panel, scene, "contact_area", line, unit.factor, line.colour)
    panel.set_ylabel(_label("contact area $A$", unit.name))


def _share_panel(panel: Axes, scene: _Scene) -> None:
    """A/A_JKR over speed; for a single curve what each mechanism takes, stacked from JKR's line down."""
    panel.axhline(1.0, linestyle="--", color=_REFERENCE, linewidth=0.9, zorder=1.5)
    handles: list[Any] = _line_handles(scene)
    if scene.single:
        handles = [Line2D([], [], color=_BOTH, label="mean")]
        if scene.tells("lost_to_bonds") or scene.tells("lost_to_fluctuations"):
            handles += _stacked_shares(panel, scene)
    for line in scene.lines:
        hertz = (scene.values("radius_hertz", line) / scene.values("radius_jkr", line)) ** 2
        _reference(panel, hertz, ":", scene, line)
        _curve(panel, scene, "area_ratio", line, 1.0, line.colour)
    _legend(panel, [*handles, *_spread_handles(scene, "area_ratio"), *_reference_handles()])
    panel.set_ylabel(r"contact area $A/A_\mathrm{JKR}$")


def _stacked_shares(panel: Axes, scene: _Scene) -> list[Any]:
    """What each mechanism takes of JKR's area, as stacked shades; returns their legend entries."""
    line, x = scene.lines[0], scene.x[0]
    bonds, ratio = 1.0 - scene.values("lost_to_bonds_mean", line), scene.values("area_ratio_mean", line)
    steps = np.diff(x)
    if not (np.all(steps >= 0.0) or np.all(steps <= 0.0)):  # shades of there and back would lie on each other
        panel.plot(x, bonds, "-.", color=_BONDS)
        return [Line2D([], [], color=_BONDS, linestyle="-.", label="with the bonds left alone")]
    _fill(panel, x, bonds, np.ones_like(bonds), _BONDS, _SHADE)
    _fill(panel, x, ratio, bonds, _FLUCTUATIONS, _SHADE)
    return [
        Patch(facecolor=_BONDS, alpha=_SHADE, label="lost to broken bonds"),
        Patch(facecolor=_FLUCTUATIONS, alpha=_SHADE, label="lost to fluctuations"),
    ]


def _curve_figure(dataset: xr.Dataset) -> Figure:
    """Area, energies and friction over the sliding speed: of a ramp, or of a sweep of steady speeds."""
    along = "t" if not is_steady(dataset) else _speed_dim(dataset)
    if along is None:
        raise ValueError('the speed neither changes in time nor is swept; ramp it: [drive] model = "ramp"')
    scene = _scene(dataset, along)
    speeds = scene.all("speed_mean")
    scale = _scale(speeds)
    unit = _Unit.of(speeds, "m/s", scale == "log")
    scene = scene.placed(unit.factor * speeds)
    figure = _stacked(scene, [(1.9, _share_panel), *_further_panels(scene)])
    _across(figure.axes[-1], scene.x, scale, "sliding speed $V$", unit.name, _room(scene))
    return figure


def _stacked(scene: _Scene, panels: list[tuple[float, Callable[[Axes, _Scene], None]]]) -> Figure:
    """Panels of given heights [in] above each other that share their x axis, lettered."""
    heights = [height for height, _ in panels]
    figure, axes = _rows(heights)
    for panel, (_, fill) in zip(axes, panels, strict=True):
        fill(panel, scene)
    return figure


def _rows(heights: list[float]) -> tuple[Figure, list[Axes]]:
    figure = _picture(_COLUMN, 0.45 + sum(heights))
    axes = list(figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    if len(axes) > 1:
        _letter(axes)
    figure.align_ylabels(axes)
    return figure, axes


def _further_panels(scene: _Scene) -> list[tuple[float, Callable[[Axes, _Scene], None]]]:
    """Energies and friction, where they have something to tell."""
    panels: list[tuple[float, Callable[[Axes, _Scene], None]]] = []
    if scene.tells("work_of_adhesion") or scene.tells("fluctuation_energy"):
        panels.append((1.6, _energy_panel))
    if scene.tells("friction_force"):
        panels.append((1.2, _friction_panel))
    return panels


def _across(panel: Axes, x: np.ndarray, scale: str, words: str, unit: str, room: float = 0.0) -> None:
    """The x axis that the panels share, with some ``room`` for markers at its ends."""
    known = x[np.isfinite(x) & ((x > 0.0) | (scale != "log"))]
    if scale == "symlog":
        panel.set_xscale(scale, linthresh=float(np.min(x[x > 0.0])))
    else:
        panel.set_xscale(scale)
    if scale == "log" and known.max() < 100.0 * known.min():
        _plain_ticks(panel.xaxis)
    if scale != "symlog" and known.max() > known.min():
        ends = np.log([known.min(), known.max()]) if scale == "log" else np.array([known.min(), known.max()])
        ends = ends + np.array([-room, room]) * (ends[1] - ends[0])
        panel.set_xlim(*(np.exp(ends) if scale == "log" else ends))
    panel.set_xlabel("\n".join(textwrap.wrap(_label(words, unit), 64)))


def _room(scene: _Scene) -> float:
    return 0.03 if scene.x.shape[1] <= _MARKED else 0.0


def _plain_ticks(axis: Axis) -> None:
    """Numbers such as 0.1, 0.2, 0.5 on a logarithmic axis of few decades."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def _speed_dim(dataset: xr.Dataset) -> str | None:
    """The sweep's dimension along which the speed changes."""
    speed = dataset["speed"].isel(t=0)
    varying = (n for n in sweep_dims(dataset) if n in speed.dims and bool((speed != speed.isel({n: 0})).any()))
    return next(varying, None)


def _time_figure(dataset: xr.Dataset) -> Figure:
    """Radius, area and energies over time."""
    unit = _Unit.of(dataset["t"].to_numpy(), "s")
    scene = _scene(dataset, "t").placed(unit.factor * dataset["t"].to_numpy())
    figure = _stacked(scene, [(1.5, _radius_panel), (1.3, _area_panel), (1.6, _energy_panel)])
    first = [Line2D([], [], color=_BOTH, label="mean")] if scene.single else _line_handles(scene)
    _legend(figure.axes[0], [*first, *_spread_handles(scene, "contact_radius"), *_reference_handles()])
    _across(figure.axes[-1], scene.x, "linear", "time $t$", unit.name)
    return figure


def _sweep_figure(dataset: xr.Dataset) -> Figure:
    """Radius, energies and friction against the swept key, one curve for each value of further keys.

    Means over the second half of the run where the speed is steady, else the values at its end.
    """
    if not sweep_dims(dataset):
        raise ValueError('nothing is swept; sweep a key: [sweep] "contact.load" = ["1 mN", "4 mN"]')
    key = dataset[sweep_dims(dataset)[0]]
    labels = key.dtype.kind not in "fi"
    values = np.arange(key.size, dtype=float) if labels else key.to_numpy().astype(float)
    scale = _scale(values)
    unit = _Unit(1.0, "") if labels else _Unit.of(values, key.attrs["units"], scale == "log")
    scene = _scene(dataset, str(key.name)).placed(unit.factor * values)
    figure = _stacked(scene, [(1.7, _radius_panel), *_further_panels(scene)])
    first = [Line2D([], [], color=_BOTH, label="simulated")] if scene.single else _line_handles(scene)
    _legend(figure.axes[0], [*first, *_spread_handles(scene, "contact_radius"), *_reference_handles()])
    words = f"{key.attrs.get('long_name', key.name)} {_symbol(key)}".strip()
    _across(figure.axes[-1], scene.x, scale, words, unit.name, 0.15 if labels else _room(scene))
    if labels:
        figure.axes[-1].set_xticks(values, [str(value) for value in key.to_numpy()])
    return figure


def _maps_of(dataset: xr.Dataset) -> xr.DataArray:
    if "shear_map" not in dataset:
        raise ValueError('there are no stress maps; record some: [shear] model = "mapped" and [record] maps = ["1 s"]')
    return dataset["shear_map"].transpose(..., "x", "y")


def _map_figure(dataset: xr.Dataset) -> Figure:
    """The last stress map of the first member and its displacement, around the contact circle."""
    stress = _maps_of(dataset)
    at = dict.fromkeys(sweep_dims(dataset), 0)
    stress = stress.isel(at).isel(map_realization=0, snapshot=-1)
    cell = _cell_of(stress)
    modulus, ratio = (float(dataset[f"effective_{n}"].isel(at)) for n in ("shear_modulus", "poisson_ratio"))
    moved = displacement(stress.to_numpy(), cell, modulus, ratio)
    radius = _radius_of(dataset, at, stress)
    figure = _picture(_WIDE, 3.1)
    axes = figure.subplots(1, 2, sharey=True)
    length = _Unit.of(np.array([cell]), "m")
    shown = (
        (stress.to_numpy(), "Pa", r"shear stress $\tau_1$", "RdBu_r"),
        (moved, "m", "displacement $w_1$", "PuOr_r"),
    )
    speed = dataset["speed"].isel(at, missing_dims="ignore")
    speed_then = float(speed.sel(t=stress["snapshot"], method="nearest"))
    arrow = {-1.0: r"$\longleftarrow$ sliding", 0.0: "at rest", 1.0: r"sliding $\longrightarrow$"}
    for panel, (field, si, words, colours) in zip(axes, shown, strict=True):
        _draw_map(figure, panel, field, cell, radius, length, (si, words, colours))
        panel.text(
            0.04, 0.05, arrow[float(np.sign(speed_then))], transform=panel.transAxes, fontsize=7,
            bbox={"boxstyle": "round,pad=0.2", "facecolor": "white", "alpha": 0.85, "linewidth": 0},
        )  # fmt: skip
    axes[0].set_ylabel(_label("$y$", length.name))
    _letter(list(axes))
    then = f"$t$ = {engineering(float(stress['snapshot']), 's')}, $V$ = {engineering(speed_then, 'm/s')}"
    axes[0].set_title(then.replace("-", "−"))
    return figure


def _radius_of(dataset: xr.Dataset, at: dict[str, int], stress: xr.DataArray) -> float:
    """Contact radius of the map's member at the map's time [m]."""
    radius = dataset["contact_radius" if "contact_radius" in dataset else "contact_radius_mean"].isel(at)
    if "realization" in radius.dims:
        radius = radius.sel(realization=stress["map_realization"])
    return float(radius.sel(t=stress["snapshot"], method="nearest"))


def _draw_map(
    figure: Figure, panel: Axes, field: np.ndarray, cell: float, radius: float, length: _Unit, about: tuple
) -> None:
    """One field around the contact, continued periodically where the contact is wider than the cell."""
    si, words, colours = about
    field = _refined(field)
    points = field.shape[0]
    side = max(cell, 2.3 * radius) if 2.3 * radius < 3.0 * cell else cell
    half = int(np.ceil(0.5 * side / cell * points))
    index = np.arange(-half, half + 1) % points
    unit = _Unit.of(field, si)
    most = unit.factor * float(np.max(np.abs(field))) or 1.0
    reach = (half + 0.5) * cell / points * length.factor
    image = panel.imshow(
        unit.factor * field[np.ix_(index, index)].T, cmap=colours, vmin=-most, vmax=most, origin="lower",
        extent=(-reach, reach, -reach, reach), interpolation="nearest",
    )  # fmt: skip
    bar = figure.colorbar(image, cax=panel.inset_axes((1.03, 0.0, 0.045, 1.0)))
    bar.set_label(_label(words, unit.name))
    if 0.0 < radius < 1.5 * cell:
        circle = Circle((0.0, 0.0), radius * length.factor, fill=False, linewidth=1.0, color=_BOTH)
        circle.set_path_effects([withStroke(linewidth=2.4, foreground="white", alpha=0.8)])
        panel.add_patch(circle)
    limit = 0.5 * side * length.factor
    panel.set_xlim(-limit, limit)
    panel.set_ylim(-limit, limit)
    panel.set_xlabel(_label("$x$", length.name))


def _refined(field: np.ndarray) -> np.ndarray:
    """A periodic field between its samples, by its own Fourier series: nothing is smoothed."""
    fine = field.shape[0] * -(-_PIXELS // field.shape[0])
    return resample(resample(field, fine, axis=0), fine, axis=1)


class _Asked(NamedTuple):
    """The spectrum of a map as the scenario wants it, with the factor by which the speed raises its density."""

    spectrum: Any
    raised: float
    words: str


def _asked_for(dataset: xr.Dataset, stress: xr.DataArray, at: dict[str, int]) -> _Asked:
    """Spectrum and growth at a point of the sweep, rebuilt from the scenario that the dataset carries."""
    shear = json.loads(dataset.attrs["scenario_resolved"])["shear"]
    swept = [dataset[name].attrs.get("long_name", "") for name in at if dataset[name].dtype.kind not in "fi"]
    if any(text.startswith("swept shear") for text in swept):
        raise ValueError("the spectrum is swept as a whole table; run the one of interest on its own")
    for table in ("spectrum", "growth"):
        for key in shear[table]:
            with contextlib.suppress(KeyError):
                shear[table][key] = float(setting(dataset, f"shear.{table}.{key}").isel(at, missing_dims="ignore"))
    spectrum = TypeAdapter(Spectrum).validate_python(shear["spectrum"])
    if hasattr(spectrum, "wavevector"):
        raise ValueError("a ripple is a single wave and has no spectral density to compare; draw its map")
    if shear["growth"].get("relaxing"):  # the field lags behind its growth: only the shape can be compared
        cells = modes(spectrum, _cell_of(stress), stress.sizes["x"])
        return _Asked(spectrum, float(np.mean(stress.to_numpy() ** 2) / np.sum(cells.variance)), "asked, scaled")
    growth = TypeAdapter(Growth).validate_python(shear["growth"])
    time = {"t": float(stress["snapshot"])}
    names = ("speed", "shear_stress" if "shear_stress" in dataset else "shear_stress_mean")
    now = [dataset[name].isel(at, missing_dims="ignore").sel(time, method="nearest").to_numpy() for name in names]
    return _Asked(spectrum, float(np.mean(growth.factor(*now) ** 2)), "asked for")


def _cell_of(stress: xr.DataArray) -> float:
    return float(stress["x"][1] - stress["x"][0]) * stress.sizes["x"]


def _mode_density(cells: Modes, grid: Grid) -> np.ndarray:
    """Density of the cell's modes on the half spectrum of its grid [Pa^2 m^2]."""
    density = np.zeros((grid.points, grid.points // 2 + 1))
    each = 0.5 * cells.variance * grid.cell**2
    density[cells.ix % grid.points, cells.iy] = each
    edge = cells.iy == 0  # this column holds both of a pair
    density[-cells.ix[edge] % grid.points, 0] = each[edge]
    return density


def _spectrum_figure(dataset: xr.Dataset) -> Figure:
    """The radially averaged spectrum of the last maps against the one asked for, and their ratio."""
    stress = _maps_of(dataset)
    at = dict.fromkeys(sweep_dims(dataset), 0)
    stress = stress.isel(at).isel(snapshot=-1).transpose("map_realization", "x", "y")
    if not np.any(stress.to_numpy()):
        raise ValueError("the last map holds no stress; record one where fluctuations have grown")
    asked = _asked_for(dataset, stress, at)
    grid = Grid(_cell_of(stress), stress.sizes["x"])
    wanted = _mode_density(modes(asked.spectrum, grid.cell, grid.points), grid)
    expected = asked.raised * radial_average(wanted, grid).density
    rings = [radial_average(density, grid) for density in periodogram(stress.to_numpy(), grid.cell)]
    fine = np.geomspace(0.4 * rings[0].q[0], rings[0].q[-1], 2000)
    density = asked.raised * _radial_density(asked.spectrum, fine)
    least = np.min(density[density > 0.0], initial=np.max(expected))
    held = expected > max(0.2 * least, 1e-12 * np.max(expected))  # not where a ring only touches the spectrum
    q, expected = rings[0].q[held], expected[held]
    measured = np.mean([ring.density for ring in rings], axis=0)[held]
    error = np.sqrt(np.sum([ring.standard_error**2 for ring in rings], axis=0))[held] / len(rings)

    length = _Unit.of(2 * np.pi / q, "m")
    figure, (panel, below) = _rows([1.9, 1.1])
    dots: Any = {"fmt": "o", "color": _BOTH, "markersize": 2.2, "elinewidth": 0.7}
    ring: Any = {"marker": "o", "linestyle": "none", "markersize": 4.5, "markerfacecolor": "none"}
    ring |= {"color": _FLUCTUATIONS, "markeredgewidth": 0.7}
    panel.loglog(fine / length.factor, np.where(density > 0.0, density, np.nan), color=_FLUCTUATIONS)
    panel.plot(q / length.factor, expected, **ring)
    panel.errorbar(q / length.factor, measured, error, **dots)
    panel.set_ylabel("spectral density $C$ (Pa² m²)")
    if np.max(measured) < 100.0 * np.min(measured):
        _plain_ticks(panel.yaxis)
    handles = [Line2D([], [], color=_FLUCTUATIONS, label=asked.words), Line2D([], [], **ring, label="on the cell")]
    count = f"{len(rings)} map" + ("s" if len(rings) > 1 else "")
    _legend(panel, [*handles, Line2D([], [], color=_BOTH, marker="o", markersize=2.2, linewidth=0.7, label=count)])
    below.axhline(1.0, color=_FLUCTUATIONS, linewidth=1.2)
    below.errorbar(q / length.factor, measured / expected, error / expected, **dots)
    below.set_ylabel("measured/asked")
    _across(below, q / length.factor, "log", "wavenumber $q$", f"rad/{length.name}", room=0.03)
    return figure


def _radial_density(spectrum: Any, q: np.ndarray) -> np.ndarray:
    """Density averaged over directions."""
    angle = np.pi * (np.arange(64) + 0.5) / 64
    return np.mean(spectrum.density(q[:, None] * np.cos(angle), q[:, None] * np.sin(angle)), axis=1)


#: What can be drawn, by name.
KINDS: dict[str, Callable[[xr.Dataset], Figure]] = {
    "curve": _curve_figure,
    "time": _time_figure,
    "sweep": _sweep_figure,
    "map": _map_figure,
    "spectrum": _spectrum_figure,
}


def draw(dataset: xr.Dataset, kind: str | None = None) -> Figure:
    """Draw a figure of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    kind : str, optional
        One of ``KINDS``: "curve" (area with what each mechanism takes, energies and friction over
        speed), "time" (radius, area and energies over time), "sweep" (radius, energies and friction
        against the swept key), "map" (a stress map and its displacement), "spectrum" (measured
        against asked-for spectral density). Without it "curve" where the speed changes or is swept,
        else "sweep" where something is, else "time".

    Returns
    -------
    Picture
        A matplotlib Figure, one column wide, "map" two; save it by its ``savefig``, as PNG, PDF or SVG.

    Raises
    ------
    ValueError
        For an unknown kind, or one that the dataset cannot serve, with the cure.
    """
    if kind is None:
        changes = not is_steady(dataset) or _speed_dim(dataset) is not None
        kind = "curve" if changes else "sweep" if sweep_dims(dataset) else "time"
    if kind not in KINDS:
        raise ValueError(f'there is no figure "{kind}"; known: {", ".join(KINDS)}')
    with mpl.rc_context(_STYLE):
        return KINDS[kind](dataset)
