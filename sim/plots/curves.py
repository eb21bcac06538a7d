"""Statistics of a dataset as curves: of time, or of a swept key, one for each other point of the sweep."""

import contextlib
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sim.analysis import bond_work, is_steady, observables, settled, share_observables, summary, sweep_dims
from sim.plots.style import BOTH, LINES, REFERENCE, fill, told

#: Points up to which each carries a marker.
MARKED = 25

#: What is nothing while the contact is open: lines break there.
_OF_CONTACT = ("contact_radius", "contact_area", "area_ratio", "friction_force")

#: Markers that stand for line styles where points are not joined.
_MARKS = {"-": "o", "--": "s", "-.": "^"}

#: Line width of a curve that a later one lies upon, where there are few: a bundle shows anyway.
_UNDERNEATH, _FEW = 2.8, 3

#: Width that the curves of a category share.
_CATEGORY = 0.6


class Line(NamedTuple):
    """One curve of a panel: a point of the sweep, with what it is called."""

    number: int
    point: dict[str, int]
    label: str
    colour: str


class Scene(NamedTuple):
    """Statistics laid out for panels: along a dimension, which may be time, one curve for each other point.

    ``x`` has shape (curves, points), in the unit of the axis. Points that are categories are not ``joined``.
    """

    found: xr.Dataset
    along: str
    lines: list[Line]
    x: np.ndarray = np.empty((0, 0))
    joined: bool = True

    @property
    def single(self) -> bool:
        return len(self.lines) == 1

    def placed(self, x: np.ndarray) -> "Scene":
        """With x values: (points,) the same for all curves, or (curves, points)."""
        return self._replace(x=np.broadcast_to(x, (len(self.lines), self.found.sizes[self.along])))

    def apart(self) -> "Scene":
        """With points that are categories, the curves of each side by side."""
        shift = (np.arange(len(self.lines)) - 0.5 * (len(self.lines) - 1)) * self.category
        return self._replace(x=self.x + shift[:, None], joined=False)

    def middle(self) -> "Scene":
        """With every curve in the middle of its category, for one that stands for all."""
        return self._replace(x=np.broadcast_to(self.x.mean(axis=0), self.x.shape)) if not self.joined else self

    @property
    def category(self) -> float:
        """Width of a curve's place within a category."""
        return _CATEGORY / len(self.lines)

    def opened(self, line: Line) -> np.ndarray:
        """Where the contacts of all members are open."""
        return self.values("fraction_detached_mean", line) >= 1.0

    def values(self, name: str, line: Line) -> np.ndarray:
        """A statistic along the x axis; nan where it is not known."""
        points = self.found.sizes[self.along]
        if name not in self.found:
            return np.full(points, np.nan)
        return np.broadcast_to(self.found[name].isel(line.point, missing_dims="ignore").to_numpy(), points)

    def all(self, *names: str) -> np.ndarray:
        """Statistics of all curves, shape (statistics * curves, points)."""
        return np.stack([self.values(name, line) for name in names for line in self.lines])

    def band(self, name: str, line: Line) -> tuple[np.ndarray, np.ndarray]:
        """5 and 95 % quantiles, or one standard deviation on both sides where only that was recorded."""
        if f"{name}_quantile" in self.found:
            quantiles = self.found[f"{name}_quantile"].isel(line.point)
            return quantiles.isel(quantile=0).to_numpy(), quantiles.isel(quantile=-1).to_numpy()
        mean, spread = (self.values(f"{name}_{kind}", line) for kind in ("mean", "std"))
        return mean - spread, mean + spread

    def drawn(self, name: str, line: Line) -> list[np.ndarray]:
        """Mean, its standard error, and both sides of the band; nan where there is no contact that it is of."""
        known = [self.values(f"{name}_mean", line), self.values(f"{name}_sem", line), *self.band(name, line)]
        if name not in _OF_CONTACT:
            return known
        gone = self.opened(line)
        return [np.where(gone, np.nan, values) for values in known]

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


def scene_along(dataset: xr.Dataset, along: str) -> Scene:
    """Statistics along time (``"t"``) or along a dimension of the sweep, where they are of the second half."""
    stated = _stated(dataset)
    if along != "t":
        late = settled(stated) if is_steady(dataset) else stated.isel(t=slice(-1, None))
        stated = late.isel(t=0, drop=True)
    found = summary(stated)
    rest, hertz = dataset["radius_at_rest"], dataset["radius_without_adhesion"]
    found["radius_jkr"], found["radius_hertz"] = rest, hertz
    others = [name for name in sweep_dims(dataset) if name != along]
    return Scene(found, along, _lines_of(dataset, others))


def _lines_of(dataset: xr.Dataset, dims: list[str]) -> list[Line]:
    points = [dict(zip(dims, at, strict=True)) for at in np.ndindex(*(dataset.sizes[name] for name in dims))]
    colours = list(LINES)
    if len(points) > len(LINES):
        colours = [mpl.colors.to_hex(c) for c in mpl.colormaps["viridis"](np.linspace(0.0, 0.92, len(points)))]
    names = [", ".join(told(dataset, name, at[name]) for name in dims) for at in points]
    return [Line(k, at, name, colours[k]) for k, (at, name) in enumerate(zip(points, names, strict=True))]


def handle(scene: Scene, colour: str, text: str, style: Any = "-") -> Line2D:
    """A legend entry: a line, or a mark where points are not joined."""
    if scene.joined:
        return Line2D([], [], color=colour, linestyle=style, label=text)
    return Line2D([], [], color=colour, linestyle="none", marker=_MARKS[style], markersize=3.5, label=text)


def line_handles(scene: Scene, alone: str = "mean") -> list[Line2D]:
    """Legend entries of the curves, six at most, evenly chosen; a single one is called ``alone``."""
    if scene.single:
        return [handle(scene, BOTH, alone)]
    chosen = scene.lines
    if len(chosen) > 6:
        chosen = [chosen[k] for k in np.rint(np.linspace(0, len(chosen) - 1, 6)).astype(int)]
    return [handle(scene, line.colour, line.label) for line in chosen]


def curve(
    panel: Axes, scene: Scene, name: str, line: Line, factor: float, colour: str, style: Any = "-", wide: bool = False
) -> None:
    """The mean with its standard error, and the band of the members; ``wide`` where a later curve lies upon it."""
    x, width = scene.x[line.number], _UNDERNEATH if wide else None
    mean, sem, low, high = (factor * values for values in scene.drawn(name, line))
    band = bool(np.any(high > low))
    if not scene.joined:
        if band:
            panel.vlines(x, low, high, color=colour, alpha=0.18, linewidth=5.0)
        panel.plot(x, mean, linestyle="none", marker=_MARKS[style], markersize=3.5, color=colour)
    else:
        if band:
            fill(panel, x, low, high, colour, 0.18)
        dots: Any = {"marker": "o", "markersize": 2.6} if scene.along != "t" and len(x) <= MARKED else {}
        panel.plot(x, mean, linestyle=style, color=colour, linewidth=width, **dots)
    if scene.along == "t":
        fill(panel, x, mean - sem, mean + sem, colour, 0.45)
    elif np.any(sem > 0.0):
        panel.errorbar(x, mean, np.nan_to_num(sem), fmt="none", ecolor=colour, elinewidth=0.8, capsize=1.5)


def covered(scene: Scene, name: str, lines: list[Line]) -> list[bool]:
    """Which of a few curves a later one would hide: it is nowhere farther than a hundredth of what all span."""
    values = np.stack([scene.values(f"{name}_mean", line) for line in lines])
    if len(lines) > _FEW or not np.any(np.isfinite(values)):
        return [False] * len(lines)
    near = 0.01 * (np.nanmax(values) - np.nanmin(values))
    return [any(np.all(np.abs(later - own) <= near) for later in values[k + 1 :]) for k, own in enumerate(values)]


def last_closed(scene: Scene, line: Line) -> np.ndarray:
    """Records after which the contact comes off; none in a sweep, whose points follow no time."""
    gone = scene.opened(line)
    return np.flatnonzero(~gone[:-1] & gone[1:]) if scene.along == "t" else np.empty(0, dtype=int)


def opening_handles(scene: Scene) -> list[Line2D]:
    """A legend entry for the cross, where there is one."""
    if not any(last_closed(scene, line).size for line in scene.lines):
        return []
    colour = BOTH if scene.single else REFERENCE
    return [Line2D([], [], linestyle="none", marker="x", markersize=4, color=colour, label="comes off")]


def spread_handles(scene: Scene, name: str) -> list[Patch]:
    """A legend entry for the band, where there is one."""
    if not scene.fluctuates(name):
        return []
    of_members = "5–95 % of members" if scene.single else "5–95 % band"
    text = of_members if f"{name}_quantile" in scene.found else "± 1 std. dev."
    return [Patch(facecolor=BOTH, alpha=0.18, label=text)]


def room_of(scene: Scene) -> float:
    """Room for markers at the ends of the x axis, where there are any."""
    return 0.03 if scene.x.shape[1] <= MARKED else 0.0


def speed_dim(dataset: xr.Dataset) -> str | None:
    """The sweep's dimension along which the speed changes."""
    speed = dataset["speed"].isel(t=0)
    varying = (n for n in sweep_dims(dataset) if n in speed.dims and bool((speed != speed.isel({n: 0})).any()))
    return next(varying, None)


def swept_whole(dataset: xr.Dataset, table: str) -> bool:
    """Whether the model of a table is swept, so that the scenario's own one says nothing of the points."""
    named = (dataset[name] for name in sweep_dims(dataset))
    told_of = [key.attrs.get("long_name", "") for key in named if key.dtype.kind not in "fi"]
    return any(text.split(".")[0] == f"swept {table}" for text in told_of)
