"""Figures of statistics as curves over time, speed or a swept key: contact, energies and friction."""

import contextlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.plots import style
from sim.plots.measured import Compared, Line, Measured
from sim.plots.style import Unit, axis_scale, named
from sim.read import Run, is_stationary, is_steady, setting, slips, sweep_dims
from sim.read.correlation import Array
from sim.read.dataset import (
    MEMBERS,
    all_go_on,
    number_of_members,
    only_statistics,
    reference_in_words,
    speed_name,
    speed_of,
    stays_held,
)
from sim.read.estimate import Estimate, Estimates
from sim.read.events import jumps, time_of_jump_in, time_of_pull_off
from sim.read.late import distribution
from sim.read.over_speed import speed_dim
from sim.read.statistics import FOR_TAILS, averaging, over_members, with_a_value

#: Largest number of points of a curve that carry markers.
_MARKED = 25

#: Largest number of curves of a panel.
_MOST = 10

#: Variables that only a closed contact has: lines break where it is open.
_OF_CONTACT = (
    "contact_radius",
    "contact_area",
    "area_ratio",
    "friction_force",
    "shear_stress",
)


#: Markers that stand for line styles where points are not joined.
_MARKS = {"-": "o", "--": "s", "-.": "^", ":": "v"}

#: Marks of a pull-off and of a jump-in.
SIGNS: Any = {
    "pull-off": {"marker": "x", "markersize": 4, "linestyle": "none", "zorder": 3},
    "jump-in": style.HOLLOW | {"mew": 0.8, "zorder": 3},
}

#: Variables of an x axis that go on while a contact opens or closes.
_PRESCRIBED = "t", "speed", "stage_speed", "displacement"


class Statistics:
    """Statistics over the members along time (``"t"``) or a dimension of the sweep, each computed when first read.

    Along the sweep they are means over the second half of a stationary run, else those of the last record, and whatever
    has been ``stated`` beside. Along time those of members that differ end with the first motion that ends, because a
    mean over the members that are left is another one.
    """

    def __init__(self, dataset: xr.Dataset, along: str) -> None:
        self.dataset, self.along = dataset, along
        self.late = along != "t" and is_stationary(dataset)
        self.going = all_go_on(dataset)
        self._computed: dict[str, Estimate | None] = {}
        self.stated = Estimates()

    def get(self, name: str, field: str = "value") -> xr.DataArray | None:
        """Return a field of the ``Estimate`` of a quantity; None if it is not known."""
        if name not in self._computed:
            self._computed[name] = self._of(name)
        one = self._computed[name] or self.stated.get(name)
        return None if one is None else getattr(one, field)

    def _of(self, name: str) -> Estimate | None:
        """Return the statistics of a quantity; None if it is not known."""
        if self.along == "t":
            one = over_members(self.dataset, [name]).get(name)
            if one is None or one.std is None or self.going is None:
                return one
            differs = bool((one.std > 0.0).any())
            return one.map(lambda each: each.where(self.going)) if differs else one
        if self.late and (one := distribution(self.dataset, [name]).get(name)):
            return one
        one = over_members(self.dataset.isel(t=[-1]), [name]).get(name)
        return None if one is None else one.isel({"t": 0})


class Scene(NamedTuple):
    """Statistics laid out for panels, one curve for each point of the sweep.

    ``x`` has shape (curves, points) and holds the variable ``over`` in the ``unit`` of the axis, which has ``words``
    and a ``scale``. ``averaged`` and ``spread`` state the means and bands of the curves, ``left_out`` counts curves
    that are not drawn. Points of categories are not ``joined``. If lines are ``broken``, they have a gap at each jump
    of the speed.
    """

    statistics: Statistics
    lines: list[Line]
    averaged: str
    spread: str
    left_out: str = ""
    over: str = ""
    heading: str = ""
    measured: Measured | None = None
    x: Array = np.empty((0, 0))
    unit: Unit = Unit(1.0, "")
    words: str = ""
    scale: str = "linear"
    joined: bool = True
    broken: bool = False

    @property
    def reference(self) -> str:
        """Name of the contact at the full work of adhesion."""
        return reference_in_words(self.statistics.dataset)

    @property
    def single(self) -> bool:
        return len(self.lines) == 1

    @property
    def bands(self) -> tuple[str, str]:
        """Names of the outer and the inner band of a curve."""
        return self.spread, style.ERROR

    @property
    def over_time(self) -> bool:
        return self.statistics.along == "t"

    @property
    def title(self) -> str:
        """The heading, or a statement of the means of several curves; the name of a single curve states its own."""
        averaged = "" if self.single else self.averaged
        return self.heading or "; ".join(filter(None, [averaged, self.left_out]))

    def headed(self, *words: str) -> "Scene":
        """Return the scene with words before its heading."""
        return self._replace(heading="; ".join(filter(None, [*words, self.title])))

    def placed(
        self, over: str, x: Array, words: str, si: str, scale: str = "linear"
    ) -> "Scene":
        """Return the scene over values ``x`` [SI] of a variable, of shape (points,) or (curves, points)."""
        unit = Unit.of(x, si, scale == "log")
        points = self.statistics.dataset.sizes[self.statistics.along]
        x = np.broadcast_to(unit.factor * x, (len(self.lines), points))
        words = unit.label(words)
        return self._replace(over=over, x=x, unit=unit, words=words, scale=scale)

    @property
    def reach(self) -> Array:
        """Places on the x axis of the curves and of the measured points."""
        points = self.measured.column(self.over) if self.measured else None
        if points is None:
            return self.x
        return np.append(self.x, self.unit.factor * points.values)

    def look(self, dashes: str) -> dict[str, Any]:
        """Return a line style, or the marker that stands for it if points are not joined."""
        if not self.joined:
            return {"linestyle": "none", "marker": _MARKS[dashes], "markersize": 3.5}
        few = (self.broken or not self.over_time) and self.x.shape[1] <= _MARKED
        # a marker hides the dashes in the key
        marked = {"marker": _MARKS[dashes], "markersize": 2.6} if few else {}
        return {"linestyle": dashes} | marked

    def opened(self, line: Line) -> Array:
        """True where the contacts of all members are open."""
        return self.values("fraction_detached", line.whole) >= 1.0

    def openings(self, line: Line) -> tuple[Array, Array]:
        """Return the records after which the contact opens, and those at which it has closed again."""
        change = np.diff((self.opened(line) & self.over_time).astype(int))
        return np.flatnonzero(change > 0), np.flatnonzero(change < 0) + 1

    def values(self, name: str, line: Line, field: str = "value") -> Array:
        """Return a statistic along a curve; nan where it is not known."""
        points = self.statistics.dataset.sizes[self.statistics.along]
        known = self.statistics.get(name, field)
        if known is None:
            return np.full(points, np.nan)
        values = known.isel(line.point, missing_dims="ignore").to_numpy()
        shown = np.full(points, True) if line.shown is None else line.shown
        if name == "shear_stress":
            # it is recorded of open contacts, too, on which no stress acts
            shown = shown & ~self.opened(line)
        return np.where(shown, values, np.nan)

    def all(self, *names: str) -> Array:
        """Return means of all curves, of shape (names * curves, points)."""
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
            ends = quantiles.isel(line.point).transpose("quantile", ...).to_numpy()
            # a branch has only its own part of the band
            low, high = np.where(np.isfinite(mean), ends[[0, -1]], np.nan)
        return [mean, error, low, high]

    def parted(self, line: Line, *along: Array) -> list[Array]:
        """Return the x values of a curve and values over them, with a nan at each gap of the line."""
        at = jumps(self.speeds(line), True) if self.broken else ()
        return [np.insert(each, at, np.nan) for each in (self.x[line.number], *along)]

    def speeds(self, line: Line) -> Array:
        """Return the prescribed speed along a curve [m/s], of the stage if there is one."""
        staged = self.statistics.get("stage_speed") is not None
        return self.values("stage_speed" if staged else "speed", line.whole)

    def varies(self, name: str) -> bool:
        """True if the quantity is known and changes along the axis or between the curves."""
        return _changes(self.all(name))


def _changes(values: Array) -> bool:
    known = values[np.isfinite(values)]
    return known.size > 0 and bool(np.ptp(known) > 1e-12 * np.max(np.abs(known)))


def scene_along(dataset: xr.Dataset, along: str) -> Scene:
    """Return ``Statistics`` along time (``"t"``) or a dimension of the sweep, as curves."""
    dims = [name for name in sweep_dims(dataset) if name != along]
    lines, left_out = _lines_of(dataset, dims)
    statistics = Statistics(dataset, along)
    words = averaging(dataset, statistics.late)
    if statistics.going is not None and not bool(statistics.going.all()):
        ended = with_a_value(words, number_of_members(dataset))
        words = f"{words}, until the first of them ends" if along == "t" else ended
    if len(lines) == 1:
        lines = [lines[0]._replace(label=words or "simulated", colour=style.BOTH)]
    members = dataset.sizes.get(MEMBERS, 0)
    spread = "5–95 % of members"
    if only_statistics(dataset):
        spread = "± 1 std. dev. of members"
    elif 0 < members < FOR_TAILS and not statistics.late:
        spread = f"5–95 %, interpolated between {members} members"
    spread += " and records" * statistics.late
    return Scene(statistics, lines, words, spread, left_out)


def _lines_of(dataset: xr.Dataset, dims: list[str]) -> tuple[list[Line], str]:
    """Return the curves, one for each point of some dimensions of the sweep, evenly chosen if there are too many.

    The text counts curves that are left out.
    """
    points = [
        dict(zip(dims, at, strict=True))
        for at in np.ndindex(*(dataset.sizes[name] for name in dims))
    ]
    varied = [name for name in dims if dataset.sizes[name] > 1]
    count = min(len(points), _MOST)
    chosen = np.rint(np.linspace(0, len(points) - 1, count)).astype(int)
    lines = []
    for number, (k, shade) in enumerate(zip(chosen, style.shades(count), strict=True)):
        words = (style.swept_value(dataset, name, points[k][name]) for name in varied)
        lines.append(Line(number, points[k], ", ".join(words), shade))
    left_out = f"{count} of {len(points)} curves drawn (choose others by --where)"
    return lines, left_out if count < len(points) else ""


def curve(panel: Axes, scene: Scene, name: str, line: Line, factor: float) -> None:
    """Draw the mean with its standard error and the band of the members."""
    values = (factor * each for each in scene.drawn(name, line))
    x, mean, sem, low, high = scene.parted(line, *values)
    colour = line.colour
    if np.any(high > low):
        shade: Any = {"color": colour, "alpha": 0.18, "label": scene.spread}
        if scene.joined:
            style.fill(panel, x, low, high, **shade)
        else:
            panel.vlines(x, low, high, linewidth=5.0, **shade)
    label = line.label if np.any(np.isfinite(mean)) else ""
    panel.plot(x, mean, color=colour, label=label, **scene.look(line.style))
    if np.any(sem > 0.0) and scene.over_time:
        inner: Any = {"color": colour, "alpha": 0.45, "label": style.ERROR}
        style.fill(panel, x, mean - sem, mean + sem, **inner)
    elif np.any(sem > 0.0):
        bars: Any = {"fmt": "none", "ecolor": colour, "elinewidth": 0.8, "capsize": 1.5}
        bars["label"] = style.ERROR
        panel.errorbar(x, mean, np.nan_to_num(sem), **bars)


def contact_curves(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Draw the curves of a contact: a cross at each pull-off of the last member in contact, a ring at a jump-in."""
    for line in scene.lines:
        curve(panel, scene, name, line, factor)
        if name in _OF_CONTACT:
            mark_jumps(panel, scene, name, line, factor)
    beside(panel, scene, name, factor)
    if name in _OF_CONTACT and all(np.all(scene.opened(line)) for line in scene.lines):
        place: Any = {"transform": panel.transAxes, "ha": "center", "va": "center"}
        panel.text(0.5, 0.5, "the contact is open", **place)


def beside(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Draw measured points beside the curves of a variable, if there are any."""
    if scene.measured is None:
        return
    curves = []
    for line in scene.lines:
        mean, error = (factor * each for each in scene.drawn(name, line.whole)[:2])
        full = np.pi * scene.values("jkr_radius", line) ** 2
        curves.append(Compared(line, scene.x[line.number], mean, error, full))
    over, at_end = (scene.over, scene.unit.factor), not scene.over_time
    is_log = scene.scale == "log"
    scene.measured.draw(panel, over, (name, factor), curves, is_log, at_end)


def mark_jumps(panel: Axes, scene: Scene, name: str, line: Line, factor: float) -> None:
    """Draw a cross at each pull-off and a ring at the first jump-in of a curve, at their recorded times.

    Between records the height is that of the nearest end of the curve, because none is recorded at the jump. A pull-off
    or a jump-in without a recorded time has no mark.
    """
    dataset, mean = scene.statistics.dataset, factor * scene.values(name, line)
    dataset = dataset.isel(line.point, missing_dims="ignore")
    clock, known = dataset["t"].to_numpy(), np.isfinite(mean)
    places, closed = scene.x[line.number], ~scene.opened(line)
    is_shown = np.full(clock.size, True) if line.shown is None else line.shown
    stretches = np.cumsum(np.append(False, np.diff(closed.astype(int)) > 0))
    of_some = MEMBERS in dataset.dims
    off, on = scene.openings(line)
    for records, time_of, sign, words in (
        (off, time_of_pull_off, "pull-off", "last " * of_some),
        (on, time_of_jump_in, "jump-in", "first " * (of_some or on.size > 1)),
    ):
        marks = []
        for record in records[is_shown[records]]:
            part = known & closed & (stretches == stretches[record])
            time = time_of(dataset, int(record))
            if np.isnan(time) or not part.any():
                continue
            # what is prescribed goes on between the records, anything else may jump
            is_sure = np.isfinite(places) if scene.over in _PRESCRIBED else part
            # between records along the drawn axis, as a ramp is on it
            axis, back = (
                (np.log, np.exp) if scene.scale == "log" else (np.array, np.array)
            )
            x = back(np.interp(time, clock[is_sure], axis(places[is_sure])))
            marks.append((x, np.interp(time, clock[part], mean[part])))
        if marks:
            look = SIGNS[sign] | {"color": line.colour, "label": words + sign}
            panel.plot(*np.transpose(marks), **look)


#: Names of the branches of a course of the speed.
_WAYS = "increasing speed", "decreasing speed"


def over_speed(dataset: xr.Dataset) -> Scene:
    """Return statistics over the sliding speed, of a course in branches or of steady speeds in their order."""
    along = "t" if not is_steady(dataset) else str(speed_dim(dataset))
    if along != "t":
        speed = speed_of(dataset).isel(t=0)
        others = dict.fromkeys({*speed.dims} - {along}, 0)
        order = np.argsort(speed.isel(others).to_numpy())
        dataset = dataset.isel({along: order})
    scene = scene_along(dataset, along)
    if scene.over_time:
        scene = scene._replace(lines=_branches(scene), broken=True)
    speeds = np.stack([scene.speeds(line) for line in scene.lines])
    staged = "stage_speed" in dataset
    words = "speed of the stage $V$" if staged else "sliding speed $V$"
    return scene.placed(speed_name(dataset), speeds, words, "m/s", axis_scale(speeds))


def _branches(scene: Scene) -> list[Line]:
    """Return the curves of a course of the speed that rises and falls in two parts each, with rests after a part."""
    lines: list[Line] = []
    for line in scene.lines:
        change = np.sign(np.diff(scene.speeds(line)))
        if np.ptp(change) < 2.0:
            lines.append(line)
            continue
        for k, name in enumerate(_WAYS):
            on = (1.0, -1.0)[k] * change >= 0.0
            shown = np.append(on, False) | np.append(False, on)
            label = ", ".join(filter(None, [line.label, name]))
            branch = line._replace(style=("-", "--")[k], shown=shown, label=label)
            if scene.single:
                branch = branch._replace(label=name, colour=style.LINES[k])
            lines.append(branch)
    return [line._replace(number=number) for number, line in enumerate(lines)]


def over_key(dataset: xr.Dataset, name: str) -> Scene:
    """Return statistics over a swept key of numbers or categories, of courses over their rates if these differ."""
    by = name
    if (rates := dataset.get(f"{name}_rate")) is not None:
        sizes = abs(rates).assign_attrs(rates.attrs)
        if bool((sizes > 0.0).all()) and np.unique(sizes).size == sizes.size:
            by = f"{name}_rate"
            dataset = dataset.assign({by: sizes})
    is_number = dataset[by].dtype.kind in "fi"
    dataset = dataset.sortby(by) if is_number else dataset
    key, scene = dataset[by], scene_along(dataset, name)
    if not is_number:
        scene = scene._replace(joined=False)
        return scene.placed(name, np.arange(key.size), named(key), "1")
    values = key.to_numpy().astype(float)
    return scene.placed(
        name, values, named(key), key.attrs["units"], axis_scale(values)
    )


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
        if is_steady(dataset) and speed_dim(dataset) is None:
            cure = (
                f"choose --x {swept[0].replace('_', '.', 1)}" if swept else "sweep it"
            )
            raise ValueError(f"the speed is the same at all points; {cure}")
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
    scene = scene._replace(broken=True)
    return scene.placed(name, scene.all(name), named(mean), mean.attrs["units"])


#: Other words for variables that figures are drawn over.
_PLAIN = {
    "time": "t",
    "load": "normal_load",
    "travel": "displacement",
    "drive.speed": "speed",
}


# -- panels and figures -------------------------------------------------------------------------

Panel = Callable[[Axes, Scene], object]

#: Records that show a slip.
_FINE = 3

#: Least share of the area by which a line stands apart from a curve.
_APART = 0.005
#: Share of the area below which a loss is of rounding.
_NOTHING = 1e-6


#: Quantiles that an axis shows, of records whose whole range is larger by more than a factor.
_USUAL, _FAR = (0.005, 0.995), 3.0


def series(name: str, words: str, si: str, usual: bool = False) -> Panel:
    """Return a panel of one quantity; if ``usual``, few records far from the others are stated and do not rule it."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        values = scene.all(name)
        factor = style.in_unit(panel.yaxis, words, values, si)
        contact_curves(panel, scene, name, factor)
        low, high = np.nanquantile(values, _USUAL) if usual else (0.0, 0.0)
        if high > low and np.nanmax(values) - np.nanmin(values) > _FAR * (high - low):
            ends = 1.3 * low - 0.3 * high, 1.3 * high - 0.3 * low
            panel.set_ylim(factor * ends[0], factor * ends[1])
            text = f"largest record {style.rounded(np.nanmax(values), si)}"
            place: Any = {"transform": panel.transAxes, "va": "top", "fontsize": 7}
            panel.text(0.02, 0.86, text, **place)

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
        words_of = {
            "jkr_radius": (scene.reference, "--"),
            "hertz_radius": ("Hertz", ":"),
        }
        for radius, (theory, dashes) in words_of.items():
            size = of_radius(_along(scene, radius))
            # a reference that the curves hide explains nothing, except that they are JKR's
            known, drawn = np.nan_to_num(size), np.nan_to_num(_along(scene, name))
            if theory in ("Hertz", "JKR") or not np.allclose(known, drawn, atol=0.0):
                _reference(panel, scene, factor * size, dashes, theory)

    return panel_of


radius_panel = _size_panel(
    "contact_radius", "contact radius $a$", "m", lambda radius: radius
)
area_panel = _size_panel(
    "contact_area", "contact area $A$", "m^2", lambda radius: np.pi * radius**2
)


def _along(scene: Scene, name: str) -> Array:
    """Return means of the whole of each curve, as if it had no branches."""
    return np.stack([scene.values(name, line.whole) for line in scene.lines])


def _are_alike(curves: Array) -> bool:
    first = np.broadcast_to(curves[0], curves.shape)
    return np.array_equal(curves, first, equal_nan=True)


def _reference(
    panel: Axes, scene: Scene, curves: Array, dashes: str, name: str, **look: Any
) -> None:
    """Draw lines of a closed form above zero: one grey line if all curves have the same, else in their colours."""
    known = np.where(curves > 0.0, curves, np.nan)
    if not np.any(np.isfinite(known)):
        return
    same = _are_alike(known)
    look = {**style.GREY, **scene.look(dashes), **look}
    look |= {} if not scene.joined else {"marker": "none"}
    for line, values in zip(scene.lines[: 1 if same else None], known, strict=False):
        colour = {} if same else {"color": line.colour}
        panel.plot(*scene.parted(line, values), **{**look, **colour})
    panel.plot([], [], label=name, **look)


_ENERGIES: Any = {
    "fluctuation_energy": (r"fluctuations, $\Delta\Gamma$", style.FLUCTUATIONS, "--"),
    "edge_energy": (r"at the edge, $\mathrm{d}E/\mathrm{d}A$", style.LINES[4], ":"),
    "work_of_adhesion": ("effective, $w$", style.BOTH, "-"),
}


def _work_of_intact_bonds(scene: Scene, line: Line) -> Array:
    """Return the work of adhesion that the bonds left would give without fluctuations [J/m^2]."""
    work, share = (
        setting(scene.statistics.dataset, f"adhesion.{key}")
        .isel(line.point, missing_dims="ignore")
        .to_numpy()
        for key in ("work", "bond_share")
    )
    return np.asarray(
        work * (1.0 - share * (1.0 - scene.values("bond_fraction", line)))
    )


def energy_panel(panel: Axes, scene: Scene) -> None:
    """Draw the work of adhesion of the bonds left, the fluctuation energy, and what both leave to the contact."""
    shown = [name for name in _ENERGIES if np.any(np.nan_to_num(scene.all(name)))]
    values = scene.all(*shown)
    factor = style.in_unit(panel.yaxis, "energy per area", values, "J/m^2")
    # one colour for each curve leaves line styles for the energies
    if scene.single and len(shown) > 1:
        with contextlib.suppress(KeyError):
            intact = factor * _work_of_intact_bonds(scene, scene.lines[0])
            label = r"intact bonds, $\Delta\gamma(N)$"
            look: Any = scene.look("-.") | {"color": style.BONDS, "label": label}
            panel.plot(*scene.parted(scene.lines[0], intact), **look)
    for name in shown:
        text, colour, dashes = _ENERGIES[name]
        colour = colour if scene.single else style.REFERENCE
        is_one = scene.single or _are_alike(scene.all(name))
        for line in scene.lines[: 1 if is_one else None]:
            shade = colour if is_one else line.colour
            plain = line._replace(label="", style=dashes, colour=shade)
            curve(panel, scene, name, plain, factor)
        panel.plot([], [], color=colour, label=text, **scene.look(dashes))
    if np.any(values <= 0.0):
        panel.axhline(0.0, **style.GUIDE)
    style.legend(panel, without=scene.bands)


def share_panel(panel: Axes, scene: Scene) -> None:
    """Draw A/A_JKR with the share of each mechanism, stacked from JKR's line down; a line parts those of several."""
    # shades of there and back would lie on each other
    steps = np.diff(scene.parted(scene.lines[0])[0])
    is_one_way = bool(np.all(steps >= 0.0) or np.all(steps <= 0.0))
    is_shaded = scene.single and is_one_way
    bonds = 1.0 - scene.all("lost_to_bonds")
    if is_shaded:
        ratio = scene.all("area_ratio")[0]
        x, top, bottom = scene.parted(scene.lines[0], bonds[0], ratio)
        mechanisms = {
            "bonds": (top, np.ones_like(top), style.BONDS),
            "fluctuations": (bottom, top, style.FLUCTUATIONS),
        }
        for name, (low, high, colour) in mechanisms.items():
            share = np.nan_to_num(scene.all(f"lost_to_{name}"))
            if scene.varies(f"lost_to_{name}") and np.any(np.abs(share) > _NOTHING):
                words = "lost to broken bonds" if name == "bonds" else f"lost to {name}"
                look: Any = {"color": colour, "alpha": 0.35, "label": words}
                style.fill(panel, x, low, high, **look)
    contact_curves(panel, scene, "area_ratio", 1.0)
    panel.axhline(1.0, linestyle="--", label=scene.reference, **style.GREY)
    if not is_shaded:
        # of curves that lose to both, in front of a curve without fluctuations
        lost = np.stack([1.0 - bonds, scene.all("lost_to_fluctuations")])
        known = np.all(np.max(np.nan_to_num(lost), axis=2) > _APART, axis=0)
        bonds = np.where(known[:, np.newaxis], bonds, np.nan)
        _reference(panel, scene, bonds, "-.", "with intact bonds only", zorder=2.5)
    full = _along(scene, "jkr_radius")
    ratios = (_along(scene, "hertz_radius") / np.where(full > 0.0, full, np.nan)) ** 2
    _reference(panel, scene, ratios, ":", "Hertz")
    area = r"A_\mathrm{JKR}" if scene.reference == "JKR" else r"A_\mathrm{full}"
    panel.set_ylabel(f"contact area $A/{area}$")


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
    style.legend(axes[0], scene.title, further=_bands(axes[1:], scene))
    is_marked = scene.measured or "marker" in scene.look("-")
    room = 0.03 if is_marked else 0.0
    style.across(axes[-1], scene.reach, scene.words, scene.scale, room)
    if not scene.joined:
        names = scene.statistics.dataset[scene.over].to_numpy()
        axes[-1].set_xticks(range(names.size), [str(name) for name in names])
    if scene.measured:
        scene.measured.finish(figure, scene.over, ax)
    return figure, axes


def _bands(axes: Sequence[Axes], scene: Scene) -> dict[str, Any]:
    """Return a band of each kind in some panels by its name, because the first panel may have none."""
    result: dict[str, Any] = {}
    for panel in axes:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            if label in scene.bands:
                result.setdefault(label, handle)
    return result


def further_panels(scene: Scene) -> list[tuple[float, Panel]]:
    """Return panels of energies and friction that change, and of the share of open contacts if members differ."""
    panels: list[tuple[float, Panel]] = []
    if scene.varies("work_of_adhesion") or scene.varies("fluctuation_energy"):
        panels.append((1.6, energy_panel))
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
    size = area_panel if absolute else share_panel
    return stacked(scene, [(1.9, size), *further_panels(scene)], ax)[0]


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
    scene = scene._replace(heading=scene.headed(coarse_slips(dataset)).heading)
    is_held = bool(stays_held(dataset).all())
    driven = [
        (0.8, series(name, *_DRIVEN[name], usual=True))
        for name in _DRIVEN
        if name != scene.over
        and not (name == "displacement" and is_held)
        and any(map(_changes, scene.all(name)))
    ]
    return _with_size(scene, [*further_panels(scene), *driven], absolute, ax)


def _with_size(
    scene: Scene, panels: list[tuple[float, Panel]], absolute: bool, ax: Axes | None
) -> Figure:
    """Return panels below that of the size of the contact, which is left out if others change and the size does not."""
    needs_size = ax or scene.measured or not panels or scene.varies("contact_radius")
    if needs_size:
        panels = [(1.6, area_panel if absolute else radius_panel), *panels]
    return stacked(scene, panels, ax)[0]


def coarse_slips(dataset: xr.Dataset) -> str:
    """Return a remark on slips that are hardly longer than the time between records, with the cure."""
    with contextlib.suppress(ValueError, KeyError):
        lasting = slips(dataset)["slip_duration"].median()
        apart = float(dataset["t"][1] - dataset["t"][0])
        if lasting < _FINE * apart:
            is_each = apart < 1.5 * float(setting(dataset, "clock.step"))
            key = "step" if is_each else "record"
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
    """Friction force over time and over the slider's position."""
    scene = over(dataset, "t")._replace(measured=data)
    position, words = scene.all("slider_position"), "slider position $x$"
    moved = scene.placed("slider_position", position, words, "m")
    figure, axes = style.rows([1.7, 2.1], shared=False)
    for panel, placed, room in zip(axes, (scene, moved), (0.0, 0.03), strict=True):
        friction_panel(panel, placed)
        panel.axhline(0.0, **style.GUIDE)
        style.across(panel, placed.reach, placed.words, room=room)
    if data:
        data.finish(figure, "t")
    style.legend(axes[0], scene.title)
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
    """Contact radius, energies and friction over the first swept key. Each value of a further key is a curve."""
    scene = over(dataset, x or style.swept(dataset)[0])._replace(measured=data)
    if not is_stationary(dataset):
        scene = scene.headed(f"at $t$ = {style.text_of(dataset['t'][-1], 's')}")
    return _with_size(scene, further_panels(scene), absolute, ax)


def statement_figure(
    dataset: xr.Dataset, name: str, x: str = "", ax: Axes | None = None
) -> Figure:
    """Draw a statement over a swept key or the speed with its 95 % interval; further keys make curves.

    An arrow is a bound: the value lies beyond. Curves are sorted along numbers.
    """
    scene = over(dataset, x or style.swept(dataset)[0])
    if scene.over_time:
        axes = ", ".join(["speed", *style.swept(dataset)])
        raise ValueError(f'{name} has no x axis "{x[:40]}"; choose a swept one: {axes}')
    stated = Run(scene.statistics.dataset).statements([name])
    scene.statistics.stated = stated
    sample, counts = stated[name].value.attrs["over"], stated[name].members
    members = number_of_members(dataset)
    if counts is not None and bool((counts < members).any()):
        sample = with_a_value(sample, members)
    words = f"mean over the {sample}, 95 % intervals" if sample else ""
    scene = scene._replace(heading="; ".join(filter(None, [words, scene.left_out])))
    panel = (2.2, lambda panel, scene: statement_curves(panel, scene, name))
    return stacked(scene, [panel], ax)[0]


def statement_curves(panel: Axes, scene: Scene, name: str) -> float:
    """Draw a statement over a swept key, and return the factor to the unit of its axis."""
    attrs = cast(xr.DataArray, scene.statistics.get(name))
    ends = {
        line.number: [
            scene.values(name, line, field) for field in ("value", "low", "high")
        ]
        for line in scene.lines
    }
    values, unit = np.array(list(ends.values())), str(attrs.attrs.get("units", "1"))
    words = named(attrs, with_symbol=False)
    factor = style.in_unit(panel.yaxis, words, values, unit)
    for line in scene.lines:
        curves = [factor * each for each in ends[line.number]]
        _interval(panel, scene, line, curves)
    scale = axis_scale(values[np.isfinite(values)])
    panel.set_yscale("log" if scale == "log" else "linear")
    return factor


def _interval(panel: Axes, scene: Scene, line: Line, curves: list[Array]) -> None:
    """Draw values with the ends of their intervals, and arrows where an end is a bound."""
    x, (mean, low, high) = scene.x[line.number], curves
    look: Any = {"color": line.colour, "elinewidth": 0.8, "capsize": 1.5}
    look["linestyle"] = "none"
    known = np.isfinite(mean)
    errors = np.nan_to_num([np.maximum(mean - low, 0.0), np.maximum(high - mean, 0.0)])
    panel.errorbar(x[known], mean[known], errors[:, known], **look)
    marks: Any = {"marker": "o", "markersize": 3} | scene.look("-")
    label = "" if scene.single else line.label
    panel.plot(x, mean, color=line.colour, label=label, **marks)
    for bound, other, sign in ((low, high, "lolims"), (high, low, "uplims")):
        alone = ~known & np.isfinite(bound) & ~np.isfinite(other)
        if alone.any():
            size = 0.1 * np.abs(bound[alone])
            panel.errorbar(x[alone], bound[alone], size, **look | {sign: True})
