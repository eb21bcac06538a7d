"""Figures of statistics as curves over time, speed or a swept key: contact, energies and friction."""

import contextlib
import difflib
from collections.abc import Callable
from math import prod
from typing import Any, NamedTuple, cast

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from sim.analysis import averaging, bond_work, is_stationary, is_steady, setting, settled, slips, summary, sweep_dims
from sim.analysis.observables import KEPT, charged_in_turn, observables, share_observables
from sim.analysis.over_speed import speed_dim
from sim.analysis.scene import answered, speed_of, stays_held
from sim.analysis.transients import jumps
from sim.plots import style
from sim.plots.measured import Compared, Measured
from sim.plots.style import BOTH, HOLLOW, LINES, Unit, axis_scale, fill, swept_value, symbol

#: Different points up to which each carries a marker.
MARKED = 25

#: Curves that a panel holds at most: named in a legend, and along a colour bar; and columns of panels.
NAMED, MOST, COLUMNS = 10, 20, 4

#: Zero while the contact is open: lines break there.
_OF_CONTACT = ("contact_radius", "contact_area", "area_ratio", "friction_force")

#: Markers that stand for line styles where points are not joined.
_MARKS = {"-": "o", "--": "s", "-.": "^"}

#: Line width that a curve gains by each later one that lies upon it, where there are few: a bundle shows anyway.
_UNDERNEATH, _FEW = 1.0, 4

#: Width that the curves of a category share.
_CATEGORY = 0.6

_CROSS: Any = {"marker": "x", "markersize": 4, "linestyle": "none", "zorder": 3}
_RING: Any = HOLLOW | {"mew": 0.8, "zorder": 3}


class Line(NamedTuple):
    """One curve of a panel: a point of the sweep, its name, "" where a colour bar names it, and its colour."""

    number: int
    point: dict[str, int]
    label: str
    colour: str


class Statistics:
    """Statistics over the members of a dataset, each made when it is first read.

    Along time (``"t"``), or along a dimension of the sweep: then of the means over the second half of the run where
    neither speed nor control change, else of the last record.
    """

    def __init__(self, dataset: xr.Dataset, along: str) -> None:
        self.dataset, self.over_time = dataset, along == "t"
        self.late = not self.over_time and is_stationary(dataset)
        self.stated = self._at(observables(dataset))
        self._found: dict[str, xr.DataArray | None] = {}
        self._dearer = [share_observables, charged_in_turn]
        with contextlib.suppress(KeyError):
            self.stated["bond_work"] = self._at(xr.Dataset({"bond_work": bond_work(dataset)}))["bond_work"]

    def _at(self, some: xr.Dataset) -> xr.Dataset:
        if self.over_time:
            return some
        return (settled(some) if self.late else some.isel(t=slice(-1, None))).isel(t=0, drop=True)

    def get(self, name: str) -> xr.DataArray | None:
        """A statistic by its name, such as ``contact_radius_mean``; None where it is not known."""
        if name not in self._found:
            stem = name.rpartition("_")[0]
            while not (own := self._own(stem)) and self._dearer and stem.startswith(("lost_to", "order_of")):
                self._charge()
            self._found[name] = None
            self._found |= {str(key): one for key, one in summary(self.stated[own]).items()}
        return self._found[name]

    def _own(self, stem: str) -> list[str]:
        """An observable, or the statistics of it that were recorded."""
        return [name for name in (stem, *(f"{stem}_{kind}" for kind in KEPT)) if name in self.stated]

    def _charge(self) -> None:
        """Add shares of the lost area in the next order of charging, as far as they are known."""
        with contextlib.suppress(ValueError), answered():
            self.stated.update(self._at(self._dearer.pop(0)(self.dataset)))

    def names(self) -> list[str]:
        """All observables."""
        while self._dearer:
            self._charge()
        parted = (str(name).rpartition("_") for name in self.stated)
        return sorted({stem if kind in KEPT else f"{stem}{line}{kind}" for stem, line, kind in parted})


class Scene(NamedTuple):
    """Statistics laid out for panels: along time or a swept key, one curve for each other point of the sweep.

    ``x`` has shape (curves, points), in the unit of the axis, which has ``words`` and a ``scale``, and is the variable
    ``over``. Points that are categories are not ``joined``; where the speed jumps lines are ``broken``. ``averaged`` is
    what the curves are means over, in words; ``bar`` a colour bar with its label, in place of the names of many curves;
    ``columns`` the curves of each column of panels, by what they have in common.
    """

    found: Statistics
    along: str
    lines: list[Line]
    averaged: str
    spread: str
    bar: tuple[ScalarMappable, str] | None = None
    columns: tuple[tuple[str, list[Line]], ...] = ()
    over: str = ""
    heading: str = ""
    measured: Measured | None = None
    x: np.ndarray = np.empty((0, 0))
    unit: Unit = Unit(1.0, "")
    words: str = ""
    scale: str = "linear"
    joined: bool = True
    broken: bool = False

    @property
    def single(self) -> bool:
        return len(self.lines) == 1

    @property
    def marked(self) -> bool:
        """True if each point carries a marker: where curves have few, over anything but time."""
        over_time = self.along == "t" and not self.broken
        return not over_time and self.x.shape[1] <= MARKED

    @property
    def title(self) -> str:
        """A heading, or words for what several curves are means over; a single one says so itself."""
        return self.heading or ("" if self.single else self.averaged)

    def placed(
        self, over: str, x: np.ndarray, words: str, si: str, scale: str = "linear", broken: bool = False
    ) -> "Scene":
        """With values [SI] of a variable along x, (points,) for all curves or (curves, points), and the axis' words."""
        unit = Unit.of(x, si, scale == "log")
        x = np.broadcast_to(unit.factor * x, (len(self.lines), self.found.dataset.sizes[self.along]))
        return self._replace(over=over, x=x, unit=unit, words=unit.label(words), scale=scale, broken=broken)

    def apart(self) -> "Scene":
        """With points that are categories, the curves of each side by side."""
        shift = (np.arange(len(self.lines)) % self.abreast - 0.5 * (self.abreast - 1)) * self.category
        return self._replace(x=self.x + shift[:, None], joined=False)

    def middle(self) -> "Scene":
        """With every curve in the middle of its category, for one that stands for all."""
        return self._replace(x=np.broadcast_to(self.x.mean(axis=0), self.x.shape)) if not self.joined else self

    @property
    def category(self) -> float:
        """Width of a curve's place within a category."""
        return _CATEGORY / self.abreast

    @property
    def abreast(self) -> int:
        """Curves of a panel."""
        return len(self.columns[0][1] if self.columns else self.lines)

    def look(self, style: Any) -> dict[str, Any]:
        """A line style, or the marker that stands for it where points are not joined."""
        marks = {"linestyle": "none", "marker": _MARKS[style], "markersize": 3.5}
        return {"linestyle": style} if self.joined else marks

    @property
    def reach(self) -> np.ndarray:
        """Places on the x axis of all that is drawn, curves and measured points."""
        points = self.measured.column(self.over) if self.measured else None
        return self.x if points is None else np.append(self.x, self.unit.factor * points.values)

    def opened(self, line: Line) -> np.ndarray:
        """True where the contacts of all members are open."""
        return self.values("fraction_detached_mean", line) >= 1.0

    def openings(self, line: Line) -> tuple[np.ndarray, np.ndarray]:
        """Records after which the contact opens, and at which an open one has closed; none in a sweep."""
        gone = self.opened(line) & (self.along == "t")
        return np.flatnonzero(~gone[:-1] & gone[1:]), np.flatnonzero(gone[:-1] & ~gone[1:]) + 1

    def values(self, name: str, line: Line) -> np.ndarray:
        """A statistic along the x axis; nan where it is not known."""
        points, known = self.found.dataset.sizes[self.along], self.found.get(name)
        if known is None:
            return np.full(points, np.nan)
        return np.broadcast_to(known.isel(line.point, missing_dims="ignore").to_numpy(), points)

    def all(self, *names: str) -> np.ndarray:
        """Statistics of all curves, shape (statistics * curves, points)."""
        return np.stack([self.values(name, line) for name in names for line in self.lines])

    def extent(self, *names: str) -> np.ndarray:
        """Statistics of the curves of all columns of panels."""
        lines = [line for _, own in self.columns for line in own] or self.lines
        return self._replace(lines=lines).all(*names)

    def drawn(self, name: str, line: Line) -> list[np.ndarray]:
        """Mean, its standard error, and both sides of the band; nan where there is no contact that it is of.

        The band is between 5 and 95 % quantiles, or one standard deviation on both sides where only that was recorded.
        """
        mean, error, spread = (self.values(f"{name}_{kind}", line) for kind in ("mean", "sem", "std"))
        low, high = mean - spread, mean + spread
        if (quantiles := self.found.get(f"{name}_quantile")) is not None:
            low, _, high = quantiles.isel(line.point).to_numpy()
        gone = self.opened(line) if name in _OF_CONTACT else False
        return [np.where(gone, np.nan, values) for values in (mean, error, low, high)]

    def parted(self, line: Line, *several: np.ndarray) -> list[np.ndarray]:
        """The x values of a curve and values over them, with a nan in each where lines break."""
        at = jumps(self.speeds(line), self.over == "speed") if self.broken else ()
        return [np.insert(values, at, np.nan) for values in (self.x[line.number], *several)]

    def speeds(self, line: Line) -> np.ndarray:
        """The speed that is prescribed along a curve [m/s], that of the stage where it pulls through a spring."""
        staged = self.found.get("stage_speed_mean") is not None
        return self.values("stage_speed_mean" if staged else "speed_mean", line)

    def covered(self, name: str, lines: list[Line]) -> list[int]:
        """How many later curves hide each one, nowhere farther from it than a hundredth of what all span."""
        values = np.stack([self.values(f"{name}_mean", line) for line in lines])
        if len(lines) > _FEW or not np.any(np.isfinite(values)):
            return [0] * len(lines)
        near = 0.01 * (np.nanmax(values) - np.nanmin(values))
        hidden = np.all(np.abs(values[:, None] - values) <= near, axis=-1)
        return [int(np.sum(later)) for later in np.triu(hidden, 1)]

    def distinct(self, name: str) -> list[Line]:
        """Curves that do not lie on an earlier one."""
        values = [self.values(f"{name}_mean", line).tobytes() for line in self.lines]
        return [line for k, (line, own) in enumerate(zip(self.lines, values, strict=True)) if values.index(own) == k]

    def varies(self, name: str) -> bool:
        """True if the observable is there and changes along the axis or between the curves."""
        return _changes(self.extent(f"{name}_mean"))

    def moves(self, name: str) -> bool:
        """True if the observable changes along the axis."""
        return any(_changes(values) for values in self.extent(f"{name}_mean"))


def _changes(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 0 and bool(np.ptp(known) > 1e-12 * np.max(np.abs(known)))


def scene_along(dataset: xr.Dataset, along: str) -> Scene:
    """``Statistics`` along time (``"t"``), or along a dimension of the sweep, as curves."""
    columns, bar, some = _columns_of(dataset, [name for name in sweep_dims(dataset) if name != along])
    lines, found = [line for _, own in columns for line in own], Statistics(dataset, along)
    words = "; ".join(filter(None, [averaging(dataset, found.late), some]))
    if len(lines) == 1:
        lines = [lines[0]._replace(label=words or "simulated", colour=BOTH)]
    spread = "± 1 std. dev. of members" if "contact_radius_std" in dataset else "5–95 % of members"
    return Scene(found, along, lines, words, f"{spread}' means" if found.late else spread, bar, columns[1:] and columns)


def _columns_of(
    dataset: xr.Dataset, dims: list[str]
) -> tuple[tuple[tuple[str, list[Line]], ...], tuple[ScalarMappable, str] | None, str]:
    """Columns of panels, each with its curves, one for each point of some dimensions of the sweep.

    Also a colour bar where the curves are many along one number, and what is said of those that are left out. Of two
    dimensions or more with many points that of fewer values makes columns.
    """
    fixed = {name: 0 for name in dims if dataset.sizes[name] == 1}
    sizes = {name: dataset.sizes[name] for name in dims if name not in fixed}
    apart = min(sizes, key=lambda name: sizes[name]) if len(sizes) > 1 and prod(sizes.values()) > len(LINES) else ""
    places = _spread(sizes.pop(apart), COLUMNS) if apart else [0]
    points = [dict(zip(sizes, at, strict=True)) for at in np.ndindex(*sizes.values())]
    keyed = [name for name in sizes if len(sizes) == 1 and len(points) > len(LINES) and _is_number(dataset[name])]
    drawn = _spread(len(points), MOST if keyed else NAMED)
    shades, bar = list(LINES), None
    if keyed:
        bar, shades = _bar(dataset[keyed[0]])
    elif len(drawn) > len(LINES):
        shades = [mpl.colors.to_hex(shade) for shade in _shades()(np.linspace(0.0, 1.0, len(points)))]
    columns: list[tuple[str, list[Line]]] = []
    for place in places:
        common, lines = {apart: place} if apart else {}, list[Line]()
        for k in drawn:
            words = "" if keyed else ", ".join(swept_value(dataset, name, at) for name, at in points[k].items())
            lines.append(Line(len(columns) * len(drawn) + len(lines), fixed | common | points[k], words, shades[k]))
        columns.append((swept_value(dataset, apart, place) if apart else "", lines))
    left = {"columns": (len(places), dataset.sizes[apart] if apart else 1), "curves": (len(drawn), len(points))}
    some = [f"{few} of {many} {what} drawn" for what, (few, many) in left.items() if few < many]
    return tuple(columns), bar, ", ".join(some) and f"{', '.join(some)} (--where draws others)"


def _spread(count: int, most: int) -> list[int]:
    """At most so many places of a count, evenly spread from the first to the last."""
    return [int(at) for at in np.rint(np.linspace(0, count - 1, min(count, most)))]


def _is_number(key: xr.DataArray) -> bool:
    return key.dtype.kind in "fi"


def choice(dataset: xr.Dataset, dim: str) -> str:
    """The cure for too many values of a swept key."""
    value = swept_value(dataset, dim, 0).rpartition("= ")[2].replace("−", "-")
    return f'choose by --where, such as --where {dim}="{value}"'


def _bar(key: xr.DataArray) -> tuple[tuple[ScalarMappable, str], list[str]]:
    """A colour bar over the values of a swept number, and the colours of them."""
    values = key.to_numpy().astype(float)
    logarithmic = axis_scale(values) == "log"
    unit = Unit.of(values, key.attrs.get("units", "1"), logarithmic)
    values = unit.factor * values
    norm = (mpl.colors.LogNorm if logarithmic else mpl.colors.Normalize)(values.min(), values.max())
    colours = ScalarMappable(norm, _shades())
    words = f"{key.attrs.get('long_name', key.name).partition(',')[0]} {symbol(key)}".strip()
    return (colours, unit.label(words)), [mpl.colors.to_hex(shade) for shade in colours.to_rgba(values)]


def _shades() -> mpl.colors.Colormap:
    """Colours of many curves, none too light for paper."""
    return mpl.colors.ListedColormap(mpl.colormaps["viridis"](np.linspace(0.0, 0.92, 256)))


def colour_bar(figure: Figure, axes: list[Axes], scene: Scene) -> None:
    """The colour bar beside panels, where the curves have one."""
    if scene.bar:
        colours, words = scene.bar
        figure.colorbar(colours, ax=axes, label=words, aspect=45, pad=0.02)


def curve(
    panel: Axes, scene: Scene, name: str, line: Line, factor: float, colour: str = "", style: Any = "-",
    label: str = "", spread: str = "", hidden: int = 0,
) -> None:  # fmt: skip
    """The mean with its standard error, and the band of the members; the wider, the more later curves lie upon it."""
    colour = colour or line.colour
    x, mean, sem, low, high = scene.parted(line, *(factor * values for values in scene.drawn(name, line)))
    shade: Any = {"color": colour, "alpha": 0.18, "label": spread}
    spreads = np.any(high > low)
    if spreads and scene.joined:
        fill(panel, x, low, high, **shade)
    elif spreads:
        panel.vlines(x, low, high, linewidth=5.0, **shade)
    dots: Any = {"marker": "o", "markersize": 2.6} if scene.marked else {}
    width = {"linewidth": mpl.rcParams["lines.linewidth"] + hidden * _UNDERNEATH} if scene.joined else {}
    panel.plot(
        x, mean, color=colour, label=label if np.any(np.isfinite(mean)) else "", **(dots | scene.look(style) | width)
    )
    if not np.any(sem > 0.0):
        return
    if scene.along == "t":
        fill(panel, x, mean - sem, mean + sem, color=colour, alpha=0.45)
    else:
        panel.errorbar(x, mean, np.nan_to_num(sem), fmt="none", ecolor=colour, elinewidth=0.8, capsize=1.5)


def contact_curves(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Curves of a contact: a cross at each pull-off of the last member in contact, a ring at each jump-in."""
    for line, hidden in zip(scene.lines, scene.covered(name, scene.lines), strict=True):
        curve(panel, scene, name, line, factor, label=line.label, spread=scene.spread, hidden=hidden)
        if name in _OF_CONTACT:
            mark_jumps(panel, scene, name, line, factor)
    beside(panel, scene, name, factor)
    if name in _OF_CONTACT and all(np.all(scene.opened(line)) for line in scene.lines):
        panel.text(0.5, 0.5, "the contact is open", transform=panel.transAxes, ha="center", va="center", fontsize=7)


def beside(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Measured points beside the curves of a variable, if there are any."""
    if scene.measured:
        curves = [_compared(scene, name, line, factor) for line in scene.lines]
        scene.measured.draw(panel, (scene.over, scene.unit.factor), (name, factor), curves, scene.scale == "log")


def _compared(scene: Scene, name: str, line: Line, factor: float) -> Compared:
    """A curve as measured points are compared with it."""
    mean, error = (factor * values for values in scene.drawn(name, line)[:2])
    full = np.pi * scene.values("jkr_radius_mean", line) ** 2
    return Compared(line.number, line.point, line.colour, scene.x[line.number], mean, error, full)


def mark_jumps(panel: Axes, scene: Scene, name: str, line: Line, factor: float, named: bool = True) -> None:
    """A cross at each pull-off and a ring at each jump-in of a curve."""
    x, mean = scene.x[line.number], factor * scene.values(f"{name}_mean", line)
    for words, at, sign in zip(("pull-off", "jump-in"), scene.openings(line), (_CROSS, _RING), strict=True):
        if at.size:
            panel.plot(x[at], mean[at], color=line.colour, label=words if named else "", **sign)


def over_speed(dataset: xr.Dataset) -> Scene:
    """Statistics over the sliding speed, of a ramp or of steady speeds."""
    scene = scene_along(dataset, "t" if not is_steady(dataset) else str(speed_dim(dataset)))
    speeds = np.stack([scene.speeds(line) for line in scene.lines])
    words = "speed of the stage $V$" if "stage_speed" in dataset else "sliding speed $V$"
    return scene.placed("speed", speeds, words, "m/s", axis_scale(speeds), broken=scene.along == "t")


def over_time(dataset: xr.Dataset) -> Scene:
    """Statistics over time."""
    return scene_along(dataset, "t").placed("t", dataset["t"].to_numpy(), "time $t$", "s")


def over_key(dataset: xr.Dataset, name: str) -> Scene:
    """Statistics over a swept key, whose values are numbers or categories."""
    key, scene = dataset[name], scene_along(dataset, name)
    words = f"{key.attrs.get('long_name', name).partition(',')[0]} {symbol(key)}".strip()
    if not _is_number(key):
        return scene.placed(name, np.arange(key.size, dtype=float), words, "1").apart()
    values = key.to_numpy().astype(float)
    return scene.placed(name, values, words, key.attrs["units"], axis_scale(values))


def over(dataset: xr.Dataset, name: str) -> Scene:
    """Statistics over time, the speed, a swept key or anything else recorded of time.

    Raises
    ------
    ValueError
        If there is no such variable, with those there are.
    """
    swept = [dim for dim in sweep_dims(dataset) if dataset.sizes[dim] > 1]
    keys = [dim for dim in swept if dim == name.replace(".", "_") or dim.endswith(f"_{name}")]
    name = _PLAIN.get(name, name)
    if name == "speed":
        return over_speed(dataset)
    if len(keys) == 1:
        return over_key(dataset, keys[0])
    if name == "t":
        return over_time(dataset)
    scene = scene_along(dataset, "t")
    about, mean = (scene.found.get(f"{name}_{kind}") for kind in ("std", "mean"))
    if about is None or mean is None:
        known = scene.found.names()
        near = difflib.get_close_matches(name, [*known, *swept], 1, 0.6)
        cure = f'did you mean "{near[0]}"?' if near else f"choose of: t, speed, {', '.join([*swept, *known])}"
        raise ValueError(f'nothing can be drawn over "{name[:40]}"; {cure}')
    words = about.attrs.get("long_name", name).partition(" of ")[2].partition(",")[0]
    return scene.placed(
        name, scene.all(f"{name}_mean"), f"{words} {symbol(mean)}".strip(), about.attrs["units"], broken=True
    )


#: Other words for variables that figures are drawn over.
_PLAIN = {"time": "t", "load": "normal_load", "travel": "displacement", "drive.speed": "speed"}


# Panels of one observable each, and the figures made of them: over speed, time or a swept key, and friction loops.


Panel = Callable[[Axes, Scene], None]

#: Share of the largest energy below which the fluctuations' own has a panel of its own.
_SMALL = 0.02

#: Records that show a slip.
_FINE = 3

#: Opacity of the shades that show what a mechanism takes.
_SHADE = 0.35


def series(name: str, words: str, si: str) -> Panel:
    """A panel of one observable."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        contact_curves(panel, scene, name, style.in_unit(panel.yaxis, words, scene.extent(f"{name}_mean"), si))

    return panel_of


friction_panel = series("friction_force", "friction $F$", "N")


def radius_panel(panel: Axes, scene: Scene) -> None:
    """Contact radius between Hertz's and JKR's."""
    radii = scene.extent("contact_radius_mean", "jkr_radius_mean")
    factor = style.in_unit(panel.yaxis, "contact radius $a$", radii, "m")
    contact_curves(panel, scene, "contact_radius", factor)
    for which, dashes in (("JKR", "--"), ("Hertz", ":")):
        _reference(panel, scene, factor * scene.all(f"{which.lower()}_radius_mean"), dashes, which)
    style.legend(panel, scene.title)


def area_panel(panel: Axes, scene: Scene) -> None:
    """Contact area between Hertz's and JKR's."""
    areas = {name: np.pi * scene.all(f"{name.lower()}_radius_mean") ** 2 for name in ("JKR", "Hertz")}
    most = np.append(scene.extent("contact_area_mean"), areas["JKR"])
    factor = style.in_unit(panel.yaxis, "contact area $A$", most, "m^2")
    contact_curves(panel, scene, "contact_area", factor)
    for (which, values), dashes in zip(areas.items(), ("--", ":"), strict=True):
        _reference(panel, scene, factor * values, dashes, which)
    style.legend(panel, scene.title)


def _reference(panel: Axes, scene: Scene, values: np.ndarray, dashes: str, name: str) -> None:
    """Lines of a closed form: one grey one where all curves have the same, else in their colours."""
    known = [_broken(own) for own in values]
    same = scene.joined and all(np.array_equal(own, known[0], equal_nan=True) for own in known)
    if not np.any(np.isfinite(known)):
        return
    for line, own in zip(scene.lines[:1] if same else scene.lines, known, strict=False):
        x, y = scene.parted(line, own)
        if not scene.joined:  # a short line for each category
            half = 0.5 * scene.category
            x, y = np.stack([x - half, x + half, x], axis=1).ravel(), np.repeat(y, 3)
            y[2::3] = np.nan
        panel.plot(x, y, dashes, **style.GREY | ({} if same else {"color": line.colour}))
    panel.plot([], [], dashes, label=name, **style.GREY)


def _broken(values: np.ndarray) -> np.ndarray:
    """Without the zeros of an open contact; one beside a closed contact is where it begins."""
    none = ~(values > 0.0)
    alone = none & np.append(True, none[:-1]) & np.append(none[1:], True)
    return np.where(alone, np.nan, values)


_ENERGIES: Any = (
    ("bond_work", r"bonds left, $\Delta\gamma(N)$", style.BONDS, "-."),
    ("fluctuation_energy", r"fluctuations, $\Delta\Gamma$", style.FLUCTUATIONS, "--"),
    ("work_of_adhesion", "left to the contact, $w$", style.BOTH, "-"),
)


def energy_panel(panel: Axes, scene: Scene) -> None:
    """Work of adhesion of the bonds left, fluctuation energy, and what both leave to the contact."""
    drawn = [entry for entry in _ENERGIES if np.any(np.nan_to_num(scene.extent(f"{entry[0]}_mean")))]
    if _small_fluctuations(scene):
        drawn = [entry for entry in drawn if entry[0] != "fluctuation_energy"]
    left, work = (scene.extent(f"{name}_mean") for name in ("bond_work", "work_of_adhesion"))
    # one colour for each curve leaves line styles for the energies; without fluctuations all is left to the contact
    if not scene.single or np.allclose(left, work, rtol=1e-9, atol=0.0, equal_nan=True):
        drawn = [entry for entry in drawn if entry[0] != "bond_work"]
    values = scene.extent(*(f"{name}_mean" for name, *_ in drawn))
    factor = style.in_unit(panel.yaxis, "energy per area", values, "J/m^2")
    for name, text, own, dashes in drawn:
        lines = scene.distinct(name)
        placed = scene.middle() if len(lines) == 1 else scene
        for line, hidden in zip(lines, scene.covered(name, lines), strict=True):
            colour = own if scene.single else style.REFERENCE if len(lines) == 1 else line.colour
            curve(panel, placed, name, line, factor, colour, dashes, hidden=hidden)
        panel.plot([], [], color=own if scene.single else style.REFERENCE, label=text, **scene.look(dashes))
    if np.any(values <= 0.0):
        panel.axhline(0.0, **style.GUIDE)
    style.legend(panel)


def _small_fluctuations(scene: Scene) -> bool:
    """Whether the fluctuation energy changes, but would be a line at zero beside the work left to the contact."""
    most, work = (
        float(np.max(np.nan_to_num(scene.extent(f"{n}_mean")))) for n in ("fluctuation_energy", "work_of_adhesion")
    )
    return 0.0 < most < _SMALL * work and scene.varies("fluctuation_energy")


def _fluctuation_panel(panel: Axes, scene: Scene) -> None:
    """Fluctuation energy where it is small."""
    energies = scene.extent("fluctuation_energy_mean")
    factor = style.in_unit(panel.yaxis, r"fluctuations $\Delta\Gamma$", energies, "J/m^2")
    lines = scene.distinct("fluctuation_energy")
    for line in lines:
        colour = style.FLUCTUATIONS if scene.single else style.REFERENCE if len(lines) == 1 else line.colour
        curve(panel, scene, "fluctuation_energy", line, factor, colour, "--")
    panel.set_ylim(bottom=0.0)


def share_panel(panel: Axes, scene: Scene) -> None:
    """A/A_JKR; for a single curve what each mechanism takes, stacked from JKR's line down."""
    if scene.single:
        _stacked_shares(panel, scene)
    contact_curves(panel, scene, "area_ratio", 1.0)
    panel.axhline(1.0, linestyle="--", label="JKR", **style.GREY)
    hertz, jkr = (scene.all(f"{name}_radius_mean") for name in ("hertz", "jkr"))
    _reference(panel, scene, (hertz / np.where(jkr > 0.0, jkr, np.nan)) ** 2, ":", "Hertz")
    style.legend(panel, scene.title)
    panel.set_ylabel(r"contact area $A/A_\mathrm{JKR}$")


def _stacked_shares(panel: Axes, scene: Scene) -> None:
    """What each mechanism takes of JKR's area, as stacked shades."""
    line = scene.lines[0]
    bonds, ratio = 1.0 - scene.values("lost_to_bonds_mean", line), scene.values("area_ratio_mean", line)
    x, bonds, ratio = scene.parted(line, bonds, ratio)
    steps = np.diff(x)
    if not (np.all(steps >= 0.0) or np.all(steps <= 0.0)):  # shades of there and back would lie on each other
        if scene.varies("lost_to_bonds"):
            panel.plot(x, bonds, "-.", color=style.BONDS, label="with the bonds left alone")
        return
    if scene.varies("lost_to_bonds"):
        style.fill(panel, x, bonds, np.ones_like(bonds), color=style.BONDS, alpha=_SHADE, label="lost to broken bonds")
    if scene.varies("lost_to_fluctuations"):
        style.fill(panel, x, ratio, bonds, color=style.FLUCTUATIONS, alpha=_SHADE, label="lost to fluctuations")


def stacked(
    scene: Scene, panels: list[tuple[float, Panel]], room: float | None = None, ax: Axes | None = None
) -> tuple[Figure, list[Axes]]:
    """Panels of given heights [in] above each other with one x axis and its label, lettered; a colour bar if any.

    Below them are residuals of measured points, if any. The panels of the first column are returned. With ``ax`` the
    first panel alone is drawn, there.
    """
    columns = scene.columns or (("", scene.lines),)
    compared = scene.measured is not None and scene.measured.has_errors and ax is None
    if ax is None:
        heights = [height for height, _ in panels] + [0.8] * compared
        figure, axes = style.grid(heights, len(columns))
    else:
        figure, axes, panels = cast(Figure, ax.figure), np.array([[ax]]), panels[:1]
        if len(columns) > 1:
            raise ValueError(f"{len(columns)} panels side by side do not go into one; choose by where, or leave ax out")
    for number, (words, lines) in enumerate(columns):
        part = scene._replace(lines=lines)
        for panel, (_, drawing) in zip(axes[:, number], panels, strict=False):
            drawing(panel, part)
        if scene.measured and compared:
            scene.measured.residual_panel(axes[-1, number], {line.number for line in lines}, scene.over)
        edge = 0.03 if scene.marked or scene.measured else 0.0
        style.across(axes[-1, number], scene.reach, scene.words, scene.scale, edge if room is None else room)
        if words:
            axes[0, number].set_title(words)
    if scene.columns:
        style.legends_of_first(figure, axes)
    elif ax is not None:
        style.moved_legend(ax, ax, loc="best")  # above the panel there may be no room
    if scene.measured:
        scene.measured.refuse_undrawn(scene.over)
    colour_bar(figure, list(axes.flat), scene)
    return figure, list(axes[:, 0])


def further_panels(scene: Scene) -> list[tuple[float, Panel]]:
    """Energies and friction, where they change."""
    panels: list[tuple[float, Panel]] = []
    if scene.varies("work_of_adhesion") or scene.varies("fluctuation_energy"):
        panels.append((1.6, energy_panel))
        if _small_fluctuations(scene):
            panels.append((1.2, _fluctuation_panel))
    if scene.varies("friction_force"):
        panels.append((1.2, friction_panel))
    return panels


def rest_of(dataset: xr.Dataset) -> xr.DataArray | None:
    """Time at rest before the start [s], for a drive that rests and starts; else None."""
    with contextlib.suppress(KeyError):
        return setting(dataset, "drive.rest")
    return None


def needs_speeds(dataset: xr.Dataset) -> None:
    if rest_of(dataset) is not None:
        raise ValueError("a rest and a start have two speeds only; draw the kind stress")
    if is_steady(dataset) and speed_dim(dataset) is None:
        raise ValueError('the speed neither changes in time nor is swept; ramp it: [drive] model = "ramp"')


def curve_figure(
    dataset: xr.Dataset, x: str = "", absolute: bool = False, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Contact area with what each mechanism takes of it, energies and friction, over speed."""
    scene = (over(dataset, x) if x else over_speed(dataset))._replace(measured=data)
    return stacked(scene, [(1.9, area_panel if absolute else share_panel), *further_panels(scene)], ax=ax)[0]


#: What drives a contact, drawn over time where it changes.
_DRIVEN = {"speed": ("speed $V$", "m/s"), "normal_load": ("load $P$", "N"), "displacement": (r"base $\Delta$", "m")}


def time_figure(
    dataset: xr.Dataset, x: str = "", absolute: bool = False, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Contact radius, energies, friction, and speed, load and displacement that change, over time."""
    scene = (over(dataset, x) if x else over_time(dataset))._replace(measured=data)
    scene = scene._replace(heading="; ".join(filter(None, [scene.title, coarse_slips(dataset)])))
    moved = not bool(stays_held(dataset).all())
    shown = [name for name in _DRIVEN if scene.moves(name) and (name != "displacement" or moved) and name != scene.over]
    driven = [(0.8, series(name, *_DRIVEN[name])) for name in shown]
    first = area_panel if absolute else radius_panel
    return stacked(scene, [(1.6, first), *further_panels(scene), *driven], ax=ax)[0]


def coarse_slips(dataset: xr.Dataset) -> str:
    """Remark where slips last hardly longer than the time between records, with the cure; "" elsewhere."""
    with contextlib.suppress(ValueError, KeyError):
        lasting, apart = slips(dataset)["slip_duration"].median(), float(dataset["t"][1] - dataset["t"][0])
        if float(lasting) < _FINE * apart:
            key = "step" if apart < 1.5 * float(setting(dataset, "clock.step")) else "record"
            return f"slips last less than {_FINE} records, which miss part of them: a shorter clock.{key} shows them"
    return ""


def turns(dataset: xr.Dataset) -> bool:
    """Whether the speed does not only rise, or only fall, in time: a curve over it would lie on itself."""
    change = speed_of(dataset).diff("t")
    return rest_of(dataset) is None and bool(((change > 0.0).any("t") & (change < 0.0).any("t")).any())


def needs_friction(dataset: xr.Dataset) -> None:
    """Refuse a dataset without friction, or whose slider does not move."""
    if not bool((style.recorded(dataset, "friction_force") != 0.0).any()):
        raise ValueError('there is no friction; give the bonds a stress, such as [bonds] stress = "0.3 MPa"')
    if not bool((dataset["slider_position"] != 0.0).any()):
        raise ValueError('the slider does not move; let it: [drive] speed = "1 mm/s"')


def friction_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Friction force over time and over the slider's position: the friction loop."""
    scene = over_time(dataset)._replace(measured=data)
    figure, axes = style.rows([1.7, 2.1], shared=False)
    for panel, name, x, words, si, room in (
        (axes[0], "t", dataset["t"].to_numpy(), "time $t$", "s", 0.0),
        (axes[1], "slider_position", scene.all("slider_position_mean"), "slider position $x$", "m", 0.03),
    ):
        placed = scene.placed(name, x, words, si, broken=True)
        friction_panel(panel, placed)
        panel.axhline(0.0, **style.GUIDE)
        style.across(panel, placed.reach, placed.words, room=room)
    if data:
        data.refuse_undrawn("t")
    style.legend(axes[0], scene.title)
    colour_bar(figure, axes, scene)
    return figure


def needs_sweep(dataset: xr.Dataset) -> None:
    if not style.swept(dataset):
        raise ValueError('nothing is swept; sweep a key: [sweep] "contact.load" = ["1 mN", "4 mN"]')


def sweep_figure(
    dataset: xr.Dataset, x: str = "", absolute: bool = False, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Contact radius, energies and friction over the first swept key; further keys make curves."""
    scene = (over(dataset, x) if x else over_key(dataset, style.swept(dataset)[0]))._replace(measured=data)
    room = None if scene.joined else (0.5 * scene.category + 0.1) / max(float(np.ptp(scene.x)), 1.0)
    if not is_stationary(dataset):
        scene = scene._replace(heading=_at_the_end(dataset, scene.title))
    first = area_panel if absolute else radius_panel
    figure, axes = stacked(scene, [(1.7, first), *further_panels(scene)], room, ax)
    if not scene.joined:
        names = dataset[scene.over].to_numpy()
        axes[-1].set_xticks(range(names.size), [str(value) for value in names])
    return figure


def _at_the_end(dataset: xr.Dataset, averaged: str) -> str:
    """The last time and the speed then, which may differ between the points of the sweep, and what a mean is over."""
    words = [f"at the end: $t$ = {style.text_of(float(dataset['t'][-1]), 's')}"]
    if "speed" in dataset:
        speed = dataset["speed"].isel(t=-1)
        ends = dict.fromkeys(style.text_of(float(end), "m/s") for end in (speed.min(), speed.max()))
        words.append(f"$V$ = {' to '.join(ends)}")
    return ", ".join(filter(None, [*words, averaged]))
