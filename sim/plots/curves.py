"""Figures of statistics as curves over time, speed or a swept key: contact, energies and friction."""

import contextlib
import textwrap
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from sim.plots import style
from sim.plots.measured import Compared, Line, Measured
from sim.plots.style import (
    BOTH,
    HOLLOW,
    LINES,
    Unit,
    axis_scale,
    fill,
    named,
    swept_value,
)
from sim.read import (
    bond_work,
    is_stationary,
    is_steady,
    setting,
    settled,
    slips,
    sweep_dims,
)
from sim.read.correlation import Array
from sim.read.dataset import (
    MEMBERS,
    ensemble_mean,
    only_statistics,
    speed_name,
    speed_of,
    stays_held,
)
from sim.read.estimate import Estimate, Estimates
from sim.read.events import jumps
from sim.read.late import distribution
from sim.read.over_speed import speed_dim
from sim.read.run import Run
from sim.read.statistics import FOR_TAILS, averaging, over_members, summary

#: Largest number of points of a curve that carry markers.
_MARKED = 25

#: Largest number of curves of a panel: named in a legend, and along a colour bar.
_NAMED, _MOST = 10, 20

#: Variables that are zero while the contact is open: lines break there.
_OF_CONTACT = ("contact_radius", "contact_area", "area_ratio", "friction_force")

#: Markers that stand for line styles where points are not joined.
_MARKS = {"-": "o", "--": "s", "-.": "^", ":": "v"}

#: Width of the place that the curves of a category share.
_CATEGORY = 0.6

_CROSS: Any = {"marker": "x", "markersize": 4, "linestyle": "none", "zorder": 3}
_RING: Any = HOLLOW | {"mew": 0.8, "zorder": 3}


class Statistics:
    """Statistics over the members along time (``"t"``) or a dimension of the sweep, each computed when first read.

    Along the sweep they are means over the second half of a stationary run, else those of the last record, and whatever
    has been ``stated`` beside.
    """

    def __init__(self, dataset: xr.Dataset, along: str) -> None:
        self.dataset, self.along = dataset, along
        self.late = along != "t" and is_stationary(dataset)
        self._computed: dict[str, Estimate | None] = {}
        self.stated = Estimates()

    def get(self, name: str, field: str = "value") -> xr.DataArray | None:
        """Return a field of the ``Estimate`` of a quantity; None if it is not known."""
        if name not in self._computed:
            self._computed[name] = self._of(name)
        one = self._computed[name] or self.stated.get(name)
        return None if one is None else getattr(one, field)

    def _of(self, name: str) -> Estimate | None:
        """Return the statistics of an observable; None if it is not known."""
        late = self.late and name != "bond_work"
        if late and (one := distribution(self.dataset, [name]).get(name)):
            return one
        part = self.dataset if self.along == "t" else self.dataset.isel(t=[-1])
        if name == "bond_work":
            try:
                left = bond_work(self.dataset if self.late else part)
            except KeyError:
                return None
            trajectories = left.to_dataset(name=name)
            means = settled(trajectories) if self.late else trajectories
            one = summary(means)[name]
        else:
            one = over_members(part, [name]).get(name)
        if one is None or self.along == "t":
            return one
        return one.isel({"t": 0})


class Scene(NamedTuple):
    """Statistics laid out for panels, one curve for each point of the sweep.

    ``x`` has shape (curves, points) and holds the variable ``over`` in the ``unit`` of the axis, which has ``words``
    and a ``scale``. ``averaged`` and ``spread`` state the means and bands of the curves, ``left_out`` counts curves
    that are not drawn. ``bar`` is a colour bar with its label, in place of the names of many curves. ``width`` is that
    of the place of a curve's points if these are categories, else 0. If lines are ``broken``, they have a gap at each
    jump of the speed.
    """

    statistics: Statistics
    lines: list[Line]
    averaged: str
    spread: str
    left_out: str = ""
    bar: tuple[ScalarMappable, str] | None = None
    over: str = ""
    heading: str = ""
    measured: Measured | None = None
    x: Array = np.empty((0, 0))
    unit: Unit = Unit(1.0, "")
    words: str = ""
    scale: str = "linear"
    width: float = 0.0
    broken: bool = False

    @property
    def single(self) -> bool:
        return len(self.lines) == 1

    @property
    def over_time(self) -> bool:
        return self.statistics.along == "t"

    @property
    def marked(self) -> bool:
        """True if each point carries a marker: curves of few points over anything but time."""
        return (self.broken or not self.over_time) and self.x.shape[1] <= _MARKED

    @property
    def title(self) -> str:
        """The heading, or a statement of the means of several curves; the name of a single curve states its own."""
        return self.heading or (
            ""
            if self.single
            else "; ".join(filter(None, [self.averaged, self.left_out]))
        )

    def placed(
        self,
        over: str,
        x: Array,
        words: str,
        si: str,
        scale: str = "linear",
        broken: bool = False,
    ) -> "Scene":
        """Return the scene over values ``x`` [SI] of a variable, of shape (points,) or (curves, points)."""
        unit = Unit.of(x, si, scale == "log")
        x = np.broadcast_to(
            unit.factor * x,
            (len(self.lines), self.statistics.dataset.sizes[self.statistics.along]),
        )
        return self._replace(
            over=over,
            x=x,
            unit=unit,
            words=unit.label(words),
            scale=scale,
            broken=broken,
        )

    @property
    def reach(self) -> Array:
        """Places on the x axis of the curves and of the measured points."""
        points = self.measured.column(self.over) if self.measured else None
        return (
            self.x
            if points is None
            else np.append(self.x, self.unit.factor * points.values)
        )

    def opened(self, line: Line) -> Array:
        """True where the contacts of all members are open."""
        return self.values("fraction_detached", line.whole) >= 1.0

    def openings(self, line: Line) -> tuple[Array, Array]:
        """Return the records after which the contact opens, and those at which it has closed again."""
        gone = self.opened(line) & self.over_time
        return np.flatnonzero(~gone[:-1] & gone[1:]), np.flatnonzero(
            gone[:-1] & ~gone[1:]
        ) + 1

    def values(self, name: str, line: Line, field: str = "value") -> Array:
        """Return a statistic along a curve; nan where it is not known."""
        points, known = (
            self.statistics.dataset.sizes[self.statistics.along],
            self.statistics.get(name, field),
        )
        if known is None:
            return np.full(points, np.nan)
        values = np.broadcast_to(
            known.isel(line.point, missing_dims="ignore").to_numpy(), points
        )
        return values if line.shown is None else np.where(line.shown, values, np.nan)

    def all(self, *names: str) -> Array:
        """Return statistics of all curves, of shape (statistics * curves, points)."""
        return np.stack(
            [self.values(name, line) for name in names for line in self.lines]
        )

    def drawn(self, name: str, line: Line) -> list[Array]:
        """Return the mean, its standard error, and both sides of the band.

        The band is between the 5 and 95 % quantiles, or one standard deviation to both sides if only that is recorded.
        """
        mean, error, spread = (
            self.values(name, line, field) for field in ("value", "sem", "std")
        )
        low, high = mean - spread, mean + spread
        if (quantiles := self.statistics.get(name, "quantile")) is not None:
            low, _, high = (
                quantiles.isel(line.point).transpose("quantile", ...).to_numpy()
            )
        return [mean, error, low, high]

    def parted(self, line: Line, *along: Array) -> list[Array]:
        """Return the x values of a curve and values over them, with a nan at each gap of the line."""
        at = (
            jumps(self.speeds(line), self.over.endswith("speed")) if self.broken else ()
        )
        return [
            np.insert(values, at, np.nan) for values in (self.x[line.number], *along)
        ]

    def speeds(self, line: Line) -> Array:
        """Return the prescribed speed along a curve [m/s], of the stage if there is one."""
        staged = self.statistics.get("stage_speed") is not None
        return self.values("stage_speed" if staged else "speed", line.whole)

    def varies(self, name: str) -> bool:
        """True if the observable is known and changes along the axis or between the curves."""
        return _changes(self.all(name))


def _changes(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 0 and bool(np.ptp(known) > 1e-12 * np.max(np.abs(known)))


def scene_along(dataset: xr.Dataset, along: str) -> Scene:
    """Return ``Statistics`` along time (``"t"``) or a dimension of the sweep, as curves."""
    lines, bar, left_out = _lines_of(
        dataset, [name for name in sweep_dims(dataset) if name != along]
    )
    statistics = Statistics(dataset, along)
    words = averaging(dataset, statistics.late)
    if len(lines) == 1:
        lines = [lines[0]._replace(label=words or "simulated", colour=BOTH)]
    members = dataset.sizes.get(MEMBERS, 0)
    spread = (
        "± 1 std. dev. of members" if only_statistics(dataset) else "5–95 % of members"
    )
    if 0 < members < FOR_TAILS and not statistics.late:
        spread = f"5–95 %, interpolated between {members} members"
    return Scene(
        statistics,
        lines,
        words,
        f"{spread} and records" if statistics.late else spread,
        left_out,
        bar,
    )


def _lines_of(
    dataset: xr.Dataset, dims: list[str]
) -> tuple[list[Line], tuple[ScalarMappable, str] | None, str]:
    """Return the curves, one for each point of some dimensions of the sweep, evenly chosen if there are too many.

    The colour bar is that of many curves along one number; the text counts curves that are left out.
    """
    points = [
        dict(zip(dims, at, strict=True))
        for at in np.ndindex(*(dataset.sizes[name] for name in dims))
    ]
    varied = [name for name in dims if dataset.sizes[name] > 1]
    shades, bar = style.shades(len(points)), None
    if (
        len(points) > len(LINES)
        and len(varied) == 1
        and dataset[varied[0]].dtype.kind in "fi"
    ):
        bar, shades = _bar(dataset[varied[0]])
    count = min(len(points), _MOST if bar else _NAMED)
    lines = []
    for number, k in enumerate(
        np.rint(np.linspace(0, len(points) - 1, count)).astype(int)
    ):
        words = (
            ""
            if bar
            else ", ".join(
                swept_value(dataset, name, points[k][name]) for name in varied
            )
        )
        lines.append(Line(number, points[k], words, shades[k]))
    left_out = (
        f"{count} of {len(points)} curves drawn (choose others by --where)"
        if count < len(points)
        else ""
    )
    return lines, bar, left_out


def _bar(key: xr.DataArray) -> tuple[tuple[ScalarMappable, str], list[str]]:
    """Return a colour bar over the values of a swept number, and their colours."""
    values = key.to_numpy().astype(float)
    logarithmic = axis_scale(values) == "log"
    unit = Unit.of(values, key.attrs.get("units", "1"), logarithmic)
    values = unit.factor * values
    norm = (mpl.colors.LogNorm if logarithmic else mpl.colors.Normalize)(
        values.min(), values.max()
    )
    colours = ScalarMappable(norm, style.SHADES)
    return (colours, unit.label(named(key))), [
        mpl.colors.to_hex(shade) for shade in colours.to_rgba(values)
    ]


def colour_bar(figure: Figure, axes: list[Axes], scene: Scene) -> None:
    """Draw the colour bar beside panels, if the curves have one."""
    if scene.bar:
        colours, words = scene.bar
        figure.colorbar(colours, ax=axes, label=words, aspect=45, pad=0.02)


def curve(
    panel: Axes,
    scene: Scene,
    name: str,
    line: Line,
    factor: float,
    colour: str = "",
    style: str = "-",
    label: str = "",
    spread: str = "",
) -> None:
    """Draw the mean with its standard error and the band of the members."""
    colour = colour or line.colour
    x, mean, sem, low, high = scene.parted(
        line, *(factor * values for values in scene.drawn(name, line))
    )
    shade: Any = {"color": colour, "alpha": 0.18, "label": spread}
    if np.any(high > low):
        if scene.width:
            panel.vlines(x, low, high, linewidth=5.0, **shade)
        else:
            fill(panel, x, low, high, **shade)
    look: Any = (
        {"marker": "o", "markersize": 2.6} if scene.marked else {}
    ) | line_style(scene, style)
    panel.plot(
        x, mean, color=colour, label=label if np.any(np.isfinite(mean)) else "", **look
    )
    if np.any(sem > 0.0) and scene.over_time:
        fill(panel, x, mean - sem, mean + sem, color=colour, alpha=0.45)
    elif np.any(sem > 0.0):
        panel.errorbar(
            x,
            mean,
            np.nan_to_num(sem),
            fmt="none",
            ecolor=colour,
            elinewidth=0.8,
            capsize=1.5,
        )


def line_style(scene: Scene, style: str) -> dict[str, Any]:
    """Return a line style, or the marker that stands for it if points are not joined."""
    return (
        {"linestyle": "none", "marker": _MARKS[style], "markersize": 3.5}
        if scene.width
        else {"linestyle": style}
    )


def contact_curves(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Draw the curves of a contact: a cross at each pull-off of the last member in contact, a ring at each jump-in."""
    for line in scene.lines:
        curve(
            panel,
            scene,
            name,
            line,
            factor,
            style=line.style,
            label=line.label,
            spread=scene.spread,
        )
        if name in _OF_CONTACT:
            mark_jumps(panel, scene, name, line, factor)
    beside(panel, scene, name, factor)
    if name in _OF_CONTACT and all(np.all(scene.opened(line)) for line in scene.lines):
        panel.text(
            0.5,
            0.5,
            "the contact is open",
            transform=panel.transAxes,
            ha="center",
            va="center",
            fontsize=7,
        )


def beside(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Draw measured points beside the curves of a variable, if there are any."""
    if scene.measured:
        curves = []
        for line in scene.lines:
            mean, error = (
                factor * values for values in scene.drawn(name, line.whole)[:2]
            )
            full = np.pi * scene.values("jkr_radius", line) ** 2
            curves.append(Compared(line, scene.x[line.number], mean, error, full))
        over, at_end = (scene.over, scene.unit.factor), not scene.over_time
        scene.measured.draw(
            panel, over, (name, factor), curves, scene.scale == "log", at_end
        )


def mark_jumps(
    panel: Axes,
    scene: Scene,
    name: str,
    line: Line,
    factor: float,
    labelled: bool = True,
) -> None:
    """Draw a cross at each pull-off and a ring at each jump-in of a curve, at the ends of its parts."""
    x, mean = scene.x[line.number], factor * scene.values(name, line)
    known, (off, on) = np.flatnonzero(np.isfinite(mean)), scene.openings(line)
    places = np.searchsorted(known, off, "right") - 1, np.searchsorted(known, on)
    for words, place, sign in zip(
        ("pull-off", "jump-in"), places, (_CROSS, _RING), strict=True
    ):
        if place.size and known.size:
            at = known.take(place, mode="clip")
            panel.plot(
                x[at],
                mean[at],
                color=line.colour,
                label=words if labelled else "",
                **sign,
            )


#: Names of the branches of a course of the speed.
_WAYS = "increasing speed", "decreasing speed"


def over_speed(dataset: xr.Dataset) -> Scene:
    """Return statistics over the sliding speed, of a course in branches or of steady speeds in their order."""
    along = "t" if not is_steady(dataset) else str(speed_dim(dataset))
    if along != "t" and (speed := speed_of(dataset).isel(t=0)).dims == (along,):
        dataset = dataset.isel({along: np.argsort(speed.to_numpy())})
    scene = scene_along(dataset, along)
    scene = scene._replace(lines=_branches(scene)) if scene.over_time else scene
    speeds = np.stack([scene.speeds(line) for line in scene.lines])
    words = (
        "speed of the stage $V$" if "stage_speed" in dataset else "sliding speed $V$"
    )
    return scene.placed(
        speed_name(dataset),
        speeds,
        words,
        "m/s",
        axis_scale(speeds),
        broken=scene.over_time,
    )


def _branches(scene: Scene) -> list[Line]:
    """Return the curves of a course of the speed that rises and falls in two parts each, with rests after a part."""
    lines: list[Line] = []
    for line in scene.lines:
        change = np.diff(scene.speeds(line))
        if min(np.sum(change > 0.0), np.sum(change < 0.0)) < 2:
            lines.append(line)
            continue
        way = np.sign(change)[
            np.maximum.accumulate(np.where(change != 0.0, np.arange(change.size), 0))
        ]
        for name, sign, look, colour in zip(
            _WAYS, (1.0, -1.0), ("-", "--"), LINES, strict=False
        ):
            label, colour = (
                (name, colour)
                if scene.single
                else (f"{line.label}, {name}".lstrip(", "), line.colour)
            )
            shown = np.append(way == sign, False) | np.append(False, way == sign)
            lines.append(
                line._replace(label=label, colour=colour, style=look, shown=shown)
            )
    return [line._replace(number=number) for number, line in enumerate(lines)]


def over_key(dataset: xr.Dataset, name: str) -> Scene:
    """Return statistics over a swept key of numbers or categories, of courses over their rates if these differ."""
    by = name
    if (rates := dataset.get(f"{name}_rate")) is not None:
        sizes = abs(rates).assign_attrs(rates.attrs)
        if bool((sizes > 0.0).all()) and np.unique(sizes).size == sizes.size:
            by = f"{name}_rate"
            dataset = dataset.assign({by: sizes})
    dataset = dataset.sortby(by) if dataset[by].dtype.kind in "fi" else dataset
    key, scene = dataset[by], scene_along(dataset, name)
    words = named(key)
    if key.dtype.kind not in "fi":
        count = len(scene.lines)
        width = _CATEGORY / count
        shift = (np.arange(count) - 0.5 * (count - 1)) * width
        return scene.placed(
            name, np.arange(key.size) + shift[:, None], words, "1"
        )._replace(width=width)
    values = key.to_numpy().astype(float)
    return scene.placed(name, values, words, key.attrs["units"], axis_scale(values))


def over(dataset: xr.Dataset, name: str) -> Scene:
    """Return statistics over time, the speed, a swept key or any recorded variable.

    Raises
    ------
    ValueError
        If there is no such variable, with those there are.
    """
    swept = style.swept(dataset)
    keys = [
        dim
        for dim in swept
        if dim == name.replace(".", "_") or dim.endswith(f"_{name}")
    ]
    name = _PLAIN.get(name, name)
    if name == "speed":
        return over_speed(dataset)
    if len(keys) == 1:
        return over_key(dataset, keys[0])
    scene = scene_along(dataset, "t")
    if name == "t":
        return scene.placed("t", dataset["t"].to_numpy(), "time $t$", "s")
    mean = scene.statistics.get(name)
    if mean is None:
        axes = ", ".join(["t", "speed", *swept])
        raise ValueError(
            f'there is no x axis "{name[:40]}"; choose {axes} or a recorded variable'
        )
    return scene.placed(
        name, scene.all(name), named(mean), mean.attrs["units"], broken=True
    )


#: Other words for variables that figures are drawn over.
_PLAIN = {
    "time": "t",
    "load": "normal_load",
    "travel": "displacement",
    "drive.speed": "speed",
}


# -- panels and figures -------------------------------------------------------------------------

Panel = Callable[[Axes, Scene], object]

#: Share of the largest energy below which the fluctuations' own has a panel of its own.
_SMALL = 0.02

#: Quantiles that an axis shows, of records whose whole range is larger by more than a factor.
_USUAL, _FAR = (0.005, 0.995), 3.0

#: Records that show a slip.
_FINE = 3

#: Least share of the area by which a line stands apart from a curve.
_APART = 0.005

#: Opacity of the shades that show what a mechanism takes.
_SHADE = 0.35


def series(name: str, words: str, si: str, usual: bool = False) -> Panel:
    """Return a panel of one observable; if ``usual``, few records far from the others are stated and do not rule it."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        values = scene.all(name)
        factor = style.in_unit(panel.yaxis, words, values, si)
        contact_curves(panel, scene, name, factor)
        low, high = np.nanquantile(values, _USUAL) if usual else (0.0, 0.0)
        if high > low and np.nanmax(values) - np.nanmin(values) > _FAR * (high - low):
            panel.set_ylim(
                factor * (1.3 * low - 0.3 * high), factor * (1.3 * high - 0.3 * low)
            )
            text = f"largest record {style.rounded(np.nanmax(values), si)}"
            panel.text(
                0.02, 0.86, text, transform=panel.transAxes, va="top", fontsize=7
            )

    return panel_of


friction_panel = series("friction_force", "friction $F$", "N")


def _size_panel(
    name: str, words: str, si: str, of_radius: Callable[[Array], Array]
) -> Panel:
    """Return a panel of the size of the contact between Hertz's and JKR's, a function of the radius."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        sizes = np.append(scene.all(name), of_radius(scene.all("jkr_radius")))
        factor = style.in_unit(panel.yaxis, words, sizes, si)
        contact_curves(panel, scene, name, factor)
        for theory, dashes in (("JKR", "--"), ("Hertz", ":")):
            radii = [
                scene.values(f"{theory.lower()}_radius", line.whole)
                for line in scene.lines
            ]
            _reference(
                panel,
                scene,
                [factor * of_radius(radius) for radius in radii],
                dashes,
                theory,
            )

    return panel_of


radius_panel = _size_panel(
    "contact_radius", "contact radius $a$", "m", lambda radius: radius
)
area_panel = _size_panel(
    "contact_area", "contact area $A$", "m^2", lambda radius: np.pi * radius**2
)


def _same(curves: Sequence[Array]) -> bool:
    return all(np.array_equal(values, curves[0], equal_nan=True) for values in curves)


def _reference(
    panel: Axes, scene: Scene, curves: list[Array], dashes: str, name: str, **look: Any
) -> None:
    """Draw lines of a closed form: one grey line if all curves have the same, else lines in their colours."""
    known = [_broken(values) for values in curves]
    if not np.any(np.isfinite(known)):
        return
    same = not scene.width and _same(known)
    for line, values in zip(
        scene.lines[:1] if same else scene.lines, known, strict=False
    ):
        x, y = scene.parted(line, values)
        if scene.width:  # a short line for each category
            half = 0.5 * scene.width
            x, y = np.stack([x - half, x + half, x], axis=1).ravel(), np.repeat(y, 3)
            y[2::3] = np.nan
        panel.plot(
            x, y, dashes, **style.GREY | look | ({} if same else {"color": line.colour})
        )
    panel.plot([], [], dashes, label=name, **style.GREY)


def _broken(values: Array) -> Array:
    """Return values without the zeros of an open contact; a zero beside a closed contact begins a line."""
    none = ~(values > 0.0)
    alone = none & np.append(True, none[:-1]) & np.append(none[1:], True)
    return np.where(alone, np.nan, values)


_ENERGIES: Any = (
    ("bond_work", r"intact bonds, $\Delta\gamma(N)$", style.BONDS, "-."),
    ("fluctuation_energy", r"fluctuations, $\Delta\Gamma$", style.FLUCTUATIONS, "--"),
    ("edge_energy", r"at the edge, $\mathrm{d}E/\mathrm{d}A$", style.FLUCTUATIONS, ":"),
    ("work_of_adhesion", "effective, $w$", style.BOTH, "-"),
)


def energy_panel(panel: Axes, scene: Scene) -> None:
    """Draw the work of adhesion of the bonds left, the fluctuation energy, and what both leave to the contact."""
    shown = [entry for entry in _ENERGIES if np.any(np.nan_to_num(scene.all(entry[0])))]
    if _small_fluctuations(scene):
        shown = [entry for entry in shown if entry[0] != "fluctuation_energy"]
    left, work = (scene.all(name) for name in ("bond_work", "work_of_adhesion"))
    # one colour for each curve leaves line styles for the energies; without fluctuations all is left to the contact
    if not scene.single or np.allclose(left, work, rtol=1e-9, atol=0.0, equal_nan=True):
        shown = [entry for entry in shown if entry[0] != "bond_work"]
    values = scene.all(*(name for name, *_ in shown))
    factor = style.in_unit(panel.yaxis, "energy per area", values, "J/m^2")
    for name, text, colour, dashes in shown:
        same = not scene.width and _same(
            [scene.values(name, line) for line in scene.lines]
        )
        colour = colour if scene.single else style.REFERENCE
        for line in scene.lines[:1] if same else scene.lines:
            curve(
                panel,
                scene,
                name,
                line,
                factor,
                colour if same or scene.single else line.colour,
                dashes,
            )
        panel.plot([], [], color=colour, label=text, **line_style(scene, dashes))
    if np.any(values <= 0.0):
        panel.axhline(0.0, **style.GUIDE)
    style.legend(panel)


def _small_fluctuations(scene: Scene) -> bool:
    """True if the fluctuation energy changes, but is much smaller than the work left to the contact."""
    most, work = (
        np.max(np.nan_to_num(scene.all(n)))
        for n in ("fluctuation_energy", "work_of_adhesion")
    )
    return 0.0 < most < _SMALL * work and scene.varies("fluctuation_energy")


def share_panel(panel: Axes, scene: Scene) -> None:
    """Draw A/A_JKR with the share of each mechanism, stacked from JKR's line down; a line parts those of several."""
    # shades of there and back would lie on each other
    steps = np.diff(scene.parted(scene.lines[0])[0])
    if is_shaded := scene.single and bool(np.all(steps >= 0.0) or np.all(steps <= 0.0)):
        _stacked_shares(panel, scene)
    contact_curves(panel, scene, "area_ratio", 1.0)
    panel.axhline(1.0, linestyle="--", label="JKR", **style.GREY)
    # of curves that lose to both, in front of a curve without fluctuations
    if not is_shaded:
        lost = [scene.all(f"lost_to_{name}") for name in ("bonds", "fluctuations")]
        known = np.all(np.max(np.nan_to_num(lost), axis=2) > _APART, axis=0)
        bonds = list(np.where(known[:, np.newaxis], 1.0 - lost[0], np.nan))
        _reference(panel, scene, bonds, "-.", "with intact bonds only", zorder=2.5)
    ratios = []
    for line in scene.lines:
        hertz, jkr = (
            scene.values(f"{name}_radius", line.whole) for name in ("hertz", "jkr")
        )
        ratios.append((hertz / np.where(jkr > 0.0, jkr, np.nan)) ** 2)
    _reference(panel, scene, ratios, ":", "Hertz")
    panel.set_ylabel(r"contact area $A/A_\mathrm{JKR}$")


def _stacked_shares(panel: Axes, scene: Scene) -> None:
    """Draw the share of JKR's area that each mechanism takes, as stacked shades."""
    line = scene.lines[0]
    bonds, ratio = (
        1.0 - scene.values("lost_to_bonds", line),
        scene.values("area_ratio", line),
    )
    x, bonds, ratio = scene.parted(line, bonds, ratio)
    if scene.varies("lost_to_bonds"):
        style.fill(
            panel,
            x,
            bonds,
            np.ones_like(bonds),
            color=style.BONDS,
            alpha=_SHADE,
            label="lost to broken bonds",
        )
    if scene.varies("lost_to_fluctuations"):
        style.fill(
            panel,
            x,
            ratio,
            bonds,
            color=style.FLUCTUATIONS,
            alpha=_SHADE,
            label="lost to fluctuations",
        )


def stacked(
    scene: Scene, panels: Sequence[tuple[float, Panel]], ax: Axes | None = None
) -> tuple[Figure, list[Axes]]:
    """Return panels of given heights [in] above each other with one x axis, lettered, and a colour bar if there is one.

    Below them are residuals of measured points, if any. With ``ax`` the first panel alone is drawn, there.
    """
    compared = scene.measured is not None and scene.measured.has_errors and ax is None
    heights = [height for height, _ in panels] + [0.8] * compared
    figure, axes = (cast(Figure, ax.figure), [ax]) if ax else style.rows(heights)
    for panel, (_, drawing) in zip(axes, panels, strict=False):
        drawing(panel, scene)
    if scene.measured and compared:
        scene.measured.residual_panel(axes[-1], scene.over)
    style.legend(axes[0], scene.title)
    room = 0.03 if scene.marked or scene.measured else 0.0
    room = (
        (0.5 * scene.width + 0.1) / max(np.ptp(scene.x), 1.0) if scene.width else room
    )
    style.across(axes[-1], scene.reach, scene.words, scene.scale, room)
    if scene.width:
        names = scene.statistics.dataset[scene.over].to_numpy()
        axes[-1].set_xticks(range(names.size), [str(name) for name in names])
    # above the panel there may be no room
    if ax is not None and (legend := ax.get_legend()):
        legend.set_bbox_to_anchor(None)
        legend.set_loc("best")
    if scene.measured:
        scene.measured.finish(figure, scene.over, ax)
    colour_bar(figure, axes, scene)
    return figure, axes


def further_panels(scene: Scene) -> list[tuple[float, Panel]]:
    """Return panels of energies and friction that change, and of the share of open contacts if members differ."""
    panels: list[tuple[float, Panel]] = []
    if scene.varies("work_of_adhesion") or scene.varies("fluctuation_energy"):
        panels.append((1.6, energy_panel))
        if _small_fluctuations(scene):
            panels.append(
                (
                    1.2,
                    series(
                        "fluctuation_energy", r"fluctuations $\Delta\Gamma$", "J/m^2"
                    ),
                )
            )
    if scene.varies("friction_force"):
        panels.append((1.2, friction_panel))
    opened = scene.all("fraction_detached")
    if np.any((opened > 0.0) & (opened < 1.0)):
        panels.append((0.8, series("fraction_detached", "open contacts", "1")))
    return panels


def needs_speeds(dataset: xr.Dataset) -> None:
    if "drive_rest" in dataset:
        raise ValueError("a start from rest has only two speeds; draw the kind stress")
    if is_steady(dataset) and speed_dim(dataset) is None:
        raise ValueError(
            'the speed neither changes in time nor is swept; ramp it: [drive] model = "ramp"'
        )


def curve_figure(
    dataset: xr.Dataset,
    x: str = "",
    absolute: bool = False,
    data: Measured | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Contact area with the loss by each mechanism, energies and friction, over speed."""
    scene = over(dataset, x or "speed")._replace(measured=data)
    return stacked(
        scene,
        [(1.9, area_panel if absolute else share_panel), *further_panels(scene)],
        ax=ax,
    )[0]


#: What drives a contact, drawn over time where it changes.
_DRIVEN = {
    "speed": ("speed $V$", "m/s"),
    "normal_load": ("load $P$", "N"),
    "displacement": (r"base $\Delta$", "m"),
}


def time_figure(
    dataset: xr.Dataset,
    x: str = "",
    absolute: bool = False,
    data: Measured | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Contact radius, energies, friction, and changing speed, load and displacement, over time."""
    scene = over(dataset, x or "t")._replace(measured=data)
    scene = scene._replace(
        heading="; ".join(filter(None, [scene.title, coarse_slips(dataset)]))
    )
    moved = not stays_held(dataset).all()
    shown = [
        name
        for name in _DRIVEN
        if (name != "displacement" or moved) and name != scene.over
    ]
    shown = [name for name in shown if any(map(_changes, scene.all(name)))]
    driven = [(0.8, series(name, *_DRIVEN[name], usual=True)) for name in shown]
    return _with_size(scene, [*further_panels(scene), *driven], absolute, ax)


def _with_size(
    scene: Scene, panels: list[tuple[float, Panel]], absolute: bool, ax: Axes | None
) -> Figure:
    """Return panels below that of the size of the contact, which is left out if others change and the size does not."""
    size = area_panel if absolute else radius_panel
    if (
        ax is None
        and panels
        and scene.measured is None
        and not scene.varies("contact_radius")
    ):
        (_, size), *panels = panels
    return stacked(scene, [(1.6, size), *panels], ax)[0]


def coarse_slips(dataset: xr.Dataset) -> str:
    """Return a remark on slips that are hardly longer than the time between records, with the cure."""
    with contextlib.suppress(ValueError, KeyError):
        lasting, apart = (
            slips(dataset)["slip_duration"].median(),
            float(dataset["t"][1] - dataset["t"][0]),
        )
        if lasting < _FINE * apart:
            key = (
                "step"
                if apart < 1.5 * float(setting(dataset, "clock.step"))
                else "record"
            )
            return f"slip events are shorter than {_FINE} records and not resolved: reduce clock.{key}"
    return ""


def turns(dataset: xr.Dataset) -> bool:
    """True if the speed both rises and falls in time, so that a curve over it would lie on itself."""
    change = speed_of(dataset).diff("t")
    return "drive_rest" not in dataset and bool(
        ((change > 0.0).any("t") & (change < 0.0).any("t")).any()
    )


def needs_friction(dataset: xr.Dataset) -> None:
    """Refuse a dataset without friction, or whose slider does not move."""
    if not (style.recorded(dataset, "friction_force") != 0.0).any():
        raise ValueError(
            'there is no friction; give the bonds a stress, such as [bonds] stress = "0.3 MPa"'
        )
    if not (dataset["slider_position"] != 0.0).any():
        raise ValueError('the slider does not move; let it: [drive] speed = "1 mm/s"')


def friction_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Friction force over time and over the slider's position: the friction loop."""
    scene = over(dataset, "t")._replace(measured=data, broken=True)
    position = scene.all("slider_position")
    moved = scene.placed(
        "slider_position", position, "slider position $x$", "m", broken=True
    )
    figure, axes = style.rows([1.7, 2.1], shared=False)
    for panel, placed, room in zip(axes, (scene, moved), (0.0, 0.03), strict=True):
        friction_panel(panel, placed)
        panel.axhline(0.0, **style.GUIDE)
        style.across(panel, placed.reach, placed.words, room=room)
    if data:
        data.finish(figure, "t")
    style.legend(axes[0], scene.title)
    colour_bar(figure, axes, scene)
    return figure


def needs_sweep(dataset: xr.Dataset) -> None:
    if not style.swept(dataset):
        raise ValueError(
            'nothing is swept; sweep a key: [sweep] "contact.load" = ["1 mN", "4 mN"]'
        )


def sweep_figure(
    dataset: xr.Dataset,
    x: str = "",
    absolute: bool = False,
    data: Measured | None = None,
    ax: Axes | None = None,
) -> Figure:
    """Contact radius, energies and friction over the first swept key. Each value of a further key is a curve.

    If all contacts are open at the end and some pulled off, their pull-off loads.
    """
    off = dataset.get("pull_off_load")
    if (
        off is not None
        and off.notnull().any()
        and data is None
        and ax is None
        and not (style.recorded(dataset, "contact_radius").isel(t=-1) > 0.0).any()
    ):
        return statement_figure(dataset, "pull_off_load")
    scene = (
        over(dataset, x) if x else over_key(dataset, style.swept(dataset)[0])
    )._replace(measured=data)
    if not is_stationary(dataset):
        words = [f"at the end: $t$ = {style.text_of(dataset['t'][-1], 's')}"]
        if "speed" in dataset:
            speed = ensemble_mean(dataset["speed"]).isel(t=-1)
            ends = dict.fromkeys(
                style.text_of(end, "m/s") for end in (speed.min(), speed.max())
            )
            words.append(f"$V$ = {' to '.join(ends)}")
        scene = scene._replace(heading=", ".join(filter(None, [*words, scene.title])))
    return _with_size(scene, further_panels(scene), absolute, ax)


def statement_figure(dataset: xr.Dataset, name: str) -> Figure:
    """Draw a statement over the first swept key with its 95 % interval; further keys make curves.

    An arrow is a bound: the value lies beyond. Curves are sorted along numbers.
    """
    scene = over_key(dataset, style.swept(dataset)[0])
    stated = Run(scene.statistics.dataset).statements([name])
    scene.statistics.stated = stated
    over = stated[name].value.attrs["over"]
    words = f"mean over the {over}, 95 % intervals" if over else ""
    scene = scene._replace(heading="; ".join(filter(None, [words, scene.left_out])))
    return stacked(
        scene, [(2.2, lambda panel, scene: statement_curves(panel, scene, name))]
    )[0]


def statement_curves(panel: Axes, scene: Scene, name: str) -> float:
    """Draw a statement over a swept key, and return the factor to the unit of its axis."""
    mean = cast(xr.DataArray, scene.statistics.get(name))
    ends = ("value", "low", "high")
    values = np.stack(
        [scene.values(name, line, end) for end in ends for line in scene.lines]
    )
    words = "\n".join(textwrap.wrap(named(mean, with_symbol=False), 36))
    factor = style.in_unit(
        panel.yaxis, words, values, str(mean.attrs.get("units", "1"))
    )
    for line in scene.lines:
        _interval(
            panel,
            scene,
            line,
            [factor * scene.values(name, line, end) for end in ends],
        )
    panel.set_yscale(
        "log" if axis_scale(values[np.isfinite(values)]) == "log" else "linear"
    )
    return factor


def _interval(panel: Axes, scene: Scene, line: Line, curves: list[Array]) -> None:
    """Draw values with the ends of their intervals, and arrows where an end is a bound."""
    x, (mean, low, high), label = (
        scene.x[line.number],
        curves,
        "" if scene.single else line.label,
    )
    look: Any = {
        "color": line.colour,
        "elinewidth": 0.8,
        "capsize": 1.5,
        "linestyle": "none",
    }
    known = np.isfinite(mean)
    errors = np.nan_to_num([np.maximum(mean - low, 0.0), np.maximum(high - mean, 0.0)])
    panel.errorbar(x[known], mean[known], errors[:, known], **look)
    marks: Any = {"marker": "o", "markersize": 3} | line_style(scene, "-")
    panel.plot(x, mean, color=line.colour, label=label, **marks)
    for bound, other, sign in (
        (low, high, {"lolims": True}),
        (high, low, {"uplims": True}),
    ):
        alone = ~known & np.isfinite(bound) & ~np.isfinite(other)
        if alone.any():
            panel.errorbar(
                x[alone], bound[alone], 0.1 * np.abs(bound[alone]), **(look | sign)
            )
