"""Figures of sliding: bond stress over speed with closed forms, starts from rest, stability, creep, incipient slip."""

import contextlib
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import is_steady, setting, sweep_dims
from sim.analysis.dataset import MEMBERS, stays_held, word
from sim.analysis.events import incipient_law, jumps
from sim.analysis.observables import with_slips
from sim.analysis.over_speed import population_of, speed_dim
from sim.laws import jkr, schallamach
from sim.laws.schallamach import Body
from sim.plots import style
from sim.plots.curves import Panel, Scene, contact_curves, over_speed, scene_along, stacked
from sim.plots.measured import Line, Measured


class Steady(NamedTuple):
    """A closed form of steady sliding over speed: shear stress [Pa] and bonds over bonds at rest [1]."""

    words: str
    style: str
    stress: np.ndarray
    fraction: np.ndarray


def steady_laws(point: xr.Dataset, speed: np.ndarray) -> list[Steady]:
    """Return closed forms of the dataset's bonds in steady sliding.

    Parameters
    ----------
    point : xarray.Dataset
        As ``sim run`` writes it, at one point of its sweep.
    speed : array
        V [m/s].

    Returns
    -------
    list of Steady
        Exact, and for Bell's rupture the first-moment closure, too. None for bonds without a stretch.
    """
    bonds = population_of(point)
    if bonds is None:
        return []
    bound, force, _ = bonds.rupture.closed_form(speed, bonds.stiffness, bonds.rebinding)
    laws = [Steady("steady sliding, exact", "-", bonds.density * force, bound / bonds.at_rest)]
    if bonds.pathway:
        stress = schallamach.first_moment_stress(speed, *bonds.pathway, bonds.rebinding, bonds.density)
        fraction = schallamach.first_moment_fraction(speed, *bonds.pathway, bonds.rebinding)
        laws.append(Steady("mean field", "--", stress, fraction))
    return laws


# -- behind a spring, or under a force ----------------------------------------------------------

#: Speeds of a map, and at which its boundary is drawn.
_CELLS, _FINE = 28, 200
#: Change of the bond fraction by which the growth of the area is found.
_LITTLE = 1e-4
_FRAME: Any = {"color": style.BONDS, "linewidth": 1.4}


def needs_force(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force is prescribed."""
    if not (word(dataset, "drive.model", "") == "force").all():
        raise ValueError('no force is prescribed; let one: [drive] model = "force"')


def creep_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Displacement and speed of the slider over time under a prescribed force; a cross ends a runaway."""
    later = with_slips(dataset).isel(t=slice(1, None))
    scene = scene_along(later, "t")._replace(measured=data)
    scene = scene.placed("t", later["t"].to_numpy(), "time under the force $t$", "s", "log")
    position, speed = _run("slider_position", "displacement $x$", "m"), _run("speed", "speed $V$", "m/s")
    return stacked(scene, [(1.8, position), (1.6, speed)])[0]


def _run(name: str, words: str, si: str) -> Panel:
    """Return a panel of a growing quantity, with a cross at the last record before a trajectory ends."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        every = scene.all(f"{name}_mean")
        factor = style.in_unit(panel.yaxis, words, every, si)
        contact_curves(panel, scene, name, factor)
        style.upward(panel)
        for line, values in zip(scene.lines, factor * every, strict=True):
            known = np.flatnonzero(np.isfinite(values))
            if 0 < known.size < values.size:
                look: Any = {"color": line.colour, "markersize": 4, "label": "runaway"}
                panel.plot(scene.x[line.number][known[-1]], values[known[-1]], "x", **look)
        if name == "slider_position":
            style.legend(panel, scene.title)

    return panel_of


def needs_map(dataset: xr.Dataset) -> None:
    """Refuse a dataset that is no sweep of springs over stage speeds."""
    if "stage_speed" not in dataset and "stage_speed_mean" not in dataset:
        raise ValueError('no stage pulls through a spring; let one: [drive] model = "spring"')
    if style.swept(dataset) != ["drive_stiffness"] or not (dataset["stage_speed"].isel(t=-1) > 0.0).all():
        cure = '[sweep] "drive.stiffness" = {from = "10 N/m", to = "1 kN/m", count = 9, scale = "log"}'
        raise ValueError(f"a map needs a sweep of the spring alone under a stage that ramps; {cure}")


def stability_figure(dataset: xr.Dataset) -> Figure:
    """Swing of the spring's force over speed and stiffness, up and down, with the theory's boundary."""
    force = style.mean_of(dataset.isel({MEMBERS: slice(0, 1)}), "spring_force").transpose(..., "t")
    speed = dataset["stage_speed"].isel({MEMBERS: 0, "drive_stiffness": 0}, missing_dims="ignore").to_numpy()
    stiffness = dataset["drive_stiffness"].to_numpy()
    turn = int(np.argmax(speed)) + 1
    legs = {"increasing speed": slice(1, turn), "decreasing speed": slice(turn - 1, None)}
    legs = {words: leg for words, leg in legs.items() if speed[leg].size > _CELLS}
    edges = np.geomspace(np.min(speed[1:]), np.max(speed), _CELLS + 1)
    pace, hard = style.Unit.of(edges, "m/s", True), style.Unit.of(stiffness, "N/m", True)
    steps = np.sqrt(stiffness[1:] * stiffness[:-1])
    rows = np.concatenate([[stiffness[0] ** 2 / steps[0]], steps, [stiffness[-1] ** 2 / steps[-1]]])
    figure, axes = style.pairs(2.6, shared=True) if len(legs) > 1 else style.rows([2.6])
    fine = np.geomspace(edges[0], edges[-1], _FINE)
    boundary = _boundary(dataset, fine)
    swings = [_swings(force.to_numpy()[:, leg], speed[leg], edges) for leg in legs.values()]
    ends: Any = {"vmin": np.nanmin(swings), "vmax": np.nanmax(swings)}
    grey = style.part_of("Greys", 0.0, 0.65)  # greys that no page turns over and that show a line
    for panel, words, swing in zip(axes, legs, swings, strict=True):
        mesh = panel.pcolormesh(pace.factor * edges, hard.factor * rows, swing, cmap=grey, rasterized=True, **ends)
        panel.plot(pace.factor * fine, hard.factor * boundary, label="theory: unstable below", **_FRAME)
        panel.set(yscale="log", ylim=hard.factor * rows[[0, -1]])
        style.across(panel, pace.factor * edges, pace.label("speed of the stage $V$"), "log")
        style.legend(panel, words)
    axes[0].set_ylabel(hard.label("stiffness of the spring $K$"))
    figure.colorbar(mesh, ax=axes, label="swing of the force over its largest", pad=0.02)
    return figure


def _swings(force: np.ndarray, speed: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the range of each row of forces over its largest, in each cell of the speed."""
    place = np.clip(np.searchsorted(edges, speed, "right") - 1, 0, len(edges) - 2)
    swings = np.full((len(force), len(edges) - 1), np.nan)
    for cell in np.unique(place):
        forces = np.abs(force[:, place == cell])
        swings[:, cell] = 1.0 - forces.min(axis=1) / forces.max(axis=1)
    return swings


def _boundary(dataset: xr.Dataset, speed: np.ndarray) -> np.ndarray:
    """Return the stiffness below which steady sliding is unstable [N/m], in mean field for ``rate`` bonds; else nan."""
    point = dataset.isel(dict.fromkeys(sweep_dims(dataset), 0))
    bonds = population_of(point)
    if bonds is None:
        return np.full(speed.shape, np.nan)
    mean_field = bool(bonds.pathway) and str(word(dataset, "bonds.model", "").item()) == "rate"
    onset = bonds.rupture.first_moment_onset if mean_field else bonds.rupture.resolved_onset
    bound = steady_laws(point, speed)[mean_field].fraction
    less, area, more = (_area(point, bound * share) for share in (1.0 - _LITTLE, 1.0, 1.0 + _LITTLE))
    growth, firm, contact_growth = (more - less) / (2.0 * _LITTLE * area), np.full(speed.shape, math.inf), 0.0
    if str(word(dataset, "drive.contact_stiffness", "half_space").item()) == "half_space":
        contact_growth = 0.5
        modulus, ratio = (float(point[f"effective_{name}"]) for name in ("shear_modulus", "poisson_ratio"))
        firm = 0.75 * math.pi**2 * modulus * np.sqrt(area / math.pi) / (2.0 - ratio)
    with contextlib.suppress(KeyError):
        firm = np.full(speed.shape, float(setting(point, "drive.contact_stiffness")))
    mass, damping, viscosity = (float(setting(point, f"drive.{key}")) for key in ("mass", "damping", "viscosity"))
    body = Body(area, growth, 0.0, mass, damping, viscosity, firm, contact_growth)
    return onset(speed, (bonds.stiffness, bonds.rebinding, bonds.density), body).stiffness


def _area(point: xr.Dataset, bound: np.ndarray) -> np.ndarray:
    """Return the area of an equilibrium contact at a load at these bond fractions [m²]; nan under other controls."""
    try:
        keys = ("contact.load", "sphere.radius", "adhesion.work", "adhesion.bond_share")
        load, size, work, share = (float(setting(point, key)) for key in keys)
    except KeyError:
        return np.full(bound.shape, np.nan)
    work_left = work * (1.0 - share + share * bound)
    radius = jkr.radius_at_load(load, work_left, size, float(point["contact_modulus"]))
    return np.asarray(math.pi * np.square(radius))


def needs_pull(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force grows from rest."""
    if "spring_force" not in dataset and "spring_force_mean" not in dataset:
        raise ValueError('nothing pulls the slider; let a spring do it: [drive] model = "spring"')
    force = style.mean_of(dataset, "spring_force")
    if (abs(force.isel(t=0)) > 0.01 * abs(force).max("t")).any():
        raise ValueError('the force does not begin at zero; start at rest: [drive] start = "rest"')
    if not bool(stays_held(dataset).all()):
        raise ValueError("the control of the contact changes its area, too: hold contact.load constant")
    if not (style.mean_of(dataset, "contact_area").isel(t=0) > 0.0).all():
        raise ValueError("the contact is open at the start, so that it has no area to lose; begin with a closed one")


def incipient_figure(dataset: xr.Dataset, absolute: bool = False) -> Figure:
    """Contact area over the tangential force on the way to sliding, with A0 − αQ² beside it.

    The law is fitted by least squares up to half of the largest force.
    """
    scene = scene_along(dataset, "t")
    force, area = np.abs(scene.all("spring_force_mean")), scene.all("contact_area_mean")
    tops, alphas = np.transpose([incipient_law(*curve) for curve in zip(force, area, strict=True)])
    rises = np.arange(force.shape[1]) <= tops[:, np.newaxis]
    unit = style.Unit.of(force, "N")
    figure, axes = style.rows([2.0, 1.8], shared=False)
    axes[0].set_ylabel("contact area $A/A_0$")
    factor = style.in_unit(axes[0].yaxis, "contact area $A$", area, "m^2") if absolute else 1.0
    for line in scene.lines:
        up, alpha = rises[line.number], alphas[line.number]
        pulled, areas = force[line.number, up], area[line.number, up]
        law = alpha * pulled**2 / areas[0]
        words = rf"$\alpha$ = {1e6 * alpha:.3g} mm$^2$/N$^2$"
        name = f"{line.label}: {words}" if not scene.single else words
        look = style.GREY | ({} if scene.single else {"color": line.colour})
        full = factor * areas[0] if absolute else 1.0
        axes[0].plot(unit.factor * pulled, full * areas / areas[0], color=line.colour, label=name)
        axes[0].plot(unit.factor * pulled, full * (1.0 - law), "--", **look)
        axes[1].plot(unit.factor * pulled[1:], 1.0 - areas[1:] / areas[0], color=line.colour)
        axes[1].plot(unit.factor * pulled[1:], law[1:], "--", **look)
    axes[0].plot([], [], "--", label=r"$A_0 - \alpha Q^2$", **style.GREY)
    axes[1].set_ylabel("lost area $1 - A/A_0$")
    style.upward(axes[1])
    words, known = unit.label("tangential force $Q$"), unit.factor * force[rises]
    style.across(axes[0], known, words)
    style.across(axes[1], known[known > 0.01 * known.max()], words, "log")
    style.legend(axes[0], scene.title)
    return figure


# -- stress of the bonds ------------------------------------------------------------------------

#: Speeds at which a closed form is drawn.
_CURVE = 600

#: Those of the closed forms of a start; a peak is resolved if more steps than that lead up to it.
_FEWER, _STEPS = 300, 3.5

_MARKERS = "osD^vP"

#: Look of an exact closed form, grey that shows on a black line and beside it, and of an approximate one.
_LAWS: Any = {
    "-": {"linestyle": "-", "color": "#BBBBBB", "linewidth": 0.7, "zorder": 3},
    "--": {"linestyle": "--", "color": style.REFERENCE, "linewidth": 0.7, "zorder": 1.5},
}
_RING: Any = style.HOLLOW | {"markersize": 5.0, "mfc": "none", "mew": 0.9, "zorder": 4}


def needs_stress(dataset: xr.Dataset) -> None:
    """Refuse a dataset without shear stress, or with one speed only."""
    rest = dataset.get("drive_rest")
    if rest is not None and not (dataset["t"] > rest).any():
        raise ValueError("the run ends before the slider starts; make clock.duration longer than drive.rest")
    if not (style.recorded(dataset, "shear_stress") != 0.0).any():
        raise ValueError('the bonds bear no shear stress; give them one, such as [bonds] stress = "0.3 MPa"')
    if (word(dataset, "drive.model", "") == "force").any():
        raise ValueError("stress is drawn over the speed, and a force is prescribed; see the figure creep")
    if rest is None and is_steady(dataset) and speed_dim(dataset) is None:
        cure = 'ramp it: [drive] model = "ramp", or rest and start: [drive] model = "start"'
        raise ValueError(f"stress is drawn over the speed, which neither changes nor is swept; {cure}")


def stress_figure(dataset: xr.Dataset, data: Measured | None = None, ax: Axes | None = None) -> Figure:
    """Shear stress with its maximum, and bonds, over speed; for a start from rest the static peaks."""
    if "drive_rest" in dataset:
        if data or ax:
            raise ValueError("starts from rest have panels of their own; draw the kind time beside data, or on an ax")
        return start_figure(dataset)
    scene = over_speed(dataset)._replace(measured=data)
    laws = {line.number: _laws_of(dataset, scene, line) for line in scene.lines}

    def thin_lines(panel: Axes, scene: Scene, values: Callable[[Steady], np.ndarray]) -> None:
        for speed, law in (law for line in scene.lines for law in laws[line.number]):
            panel.plot(scene.unit.factor * speed, values(law), label=law.words, **_LAWS[law.style])

    def stress_panel(panel: Axes, scene: Scene) -> None:
        """Draw the shear stress upon closed forms, with the maximum of each curve."""
        factor = style.in_unit(panel.yaxis, r"shear stress $\tau_0$", scene.all("shear_stress_mean"), "Pa")
        contact_curves(panel, scene._replace(lines=_marked(panel, scene, factor)), "shear_stress", factor)
        thin_lines(panel, scene, lambda law: factor * law.stress)
        style.legend(panel, scene.title)

    def fraction_panel(panel: Axes, scene: Scene) -> None:
        thin_lines(panel, scene, lambda law: law.fraction)
        contact_curves(panel, scene, "bond_fraction", 1.0)
        panel.set_ylabel("bond fraction $N/N_0$")

    panels: list[tuple[float, Panel]] = [(2.1, stress_panel), (1.3, fraction_panel)]
    return stacked(scene, panels if scene.varies("bond_fraction") else panels[:1], ax=ax)[0]


def _laws_of(dataset: xr.Dataset, scene: Scene, line: Line) -> list[tuple[np.ndarray, Steady]]:
    """Return closed forms over the speeds of a curve, each with the speeds [m/s]."""
    speeds = scene.speeds(line)
    low, high = np.min(speeds), np.max(speeds)
    fine = np.linspace(low, high, _CURVE)
    if scene.scale == "log":
        fine = np.geomspace(low, high, _CURVE)
    elif scene.scale == "symlog":
        fine = np.append(0.0, np.geomspace(np.min(speeds[speeds > 0.0]), high, _CURVE - 1))
    return [(fine, law) for law in steady_laws(dataset.isel(line.point), fine)]


def maximum_of(speed: np.ndarray, stress: np.ndarray) -> int | None:
    """Return the index of the largest size of the stress; None if it is at an end of the speeds.

    >>> maximum_of(np.array([1.0, 2.0, 3.0]), np.array([1.0, 4.0, 2.0]))
    1
    >>> maximum_of(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 4.0])) is None
    True
    """
    if not np.any(np.isfinite(stress)):
        return None
    at, size = int(np.nanargmax(np.abs(stress))), np.where(np.isfinite(stress), np.abs(speed), np.nan)
    return at if np.nanmin(size) < size[at] < np.nanmax(size) else None


def _marked(panel: Axes, scene: Scene, factor: float) -> list[Line]:
    """Mark the maximum of each curve by a ring and return the curves with the maxima in their names."""
    labelled = []
    for line in scene.lines:
        speed, stress = scene.speeds(line), scene.values("shear_stress_mean", line)
        steps = scene.broken and jumps(speed, True).size  # their transients have no maximum over the speed
        at = None if steps else maximum_of(speed, stress)
        words = line.label
        if at is not None:
            panel.plot(scene.x[line.number][at], factor * stress[at], color=line.colour, **_RING)
            most, fast = style.rounded(stress[at], "Pa"), style.rounded(speed[at], "m/s")
            words = words and f"{words}: {most} at {fast}"
        labelled.append(line._replace(label=words))
    return labelled


class Start(NamedTuple):
    """A start from rest: its point of the sweep, rest [s], speed [m/s], and since it began times [s] and stresses [Pa].

    ``fraction`` is the bond fraction before it. ``peak`` [Pa] is the largest stress, at the time ``when`` [s]; it is
    ``resolved`` if the stress falls again and more than three steps lead up to it.
    """

    point: xr.Dataset
    rest: float
    speed: float
    fraction: float
    time: np.ndarray
    stress: np.ndarray
    peak: float
    when: float
    resolved: bool


def _varied(dataset: xr.Dataset) -> list[str]:
    """Return the dimensions of the sweep along which the rest or the speed changes."""
    dims = {*setting(dataset, "drive.rest").dims, *setting(dataset, "drive.speed").dims}
    return [name for name in sweep_dims(dataset) if name in dims]


def starts_of(dataset: xr.Dataset) -> list[Start]:
    """Return all starts of a sweep, from short to long rest and slow to fast, at the first point of further swept keys.

    Peaks are those of the clock steps, or where members differ those of their mean over the records.
    """
    varied, starts, times = _varied(dataset), [], dataset["t"].to_numpy()
    for where in np.ndindex(*(dataset.sizes[name] for name in varied)):
        point = dataset.isel(dict.fromkeys(sweep_dims(dataset), 0) | dict(zip(varied, where, strict=True)))
        rest, speed = (float(setting(point, f"drive.{key}")) for key in ("rest", "speed"))
        first = int(np.searchsorted(times, rest + 1e-9 * times[-1], "right"))
        if first == times.size:
            continue
        stress, fraction = (style.mean_of(point, name).to_numpy() for name in ("shear_stress", "bond_fraction"))
        k = first + int(np.argmax(np.abs(stress[first:])))
        peak, when, step = abs(stress[k]), times[k], times[1] - times[0]
        if "peak_stress" in point and "member" not in point["peak_stress"].dims:
            peak, when, step = (float(point[name]) for name in ("peak_stress", "peak_time", "clock_step"))
        resolved = bool(abs(stress[-1]) < peak and when - rest > _STEPS * step)
        bound, peak = fraction[max(first - 1, 0)], np.copysign(peak, speed)
        course = times[first:] - rest, stress[first:]
        starts.append(Start(point, rest, speed, bound, *course, peak, when - rest, resolved))
    return sorted(starts, key=lambda start: (start.rest, abs(start.speed)))


def start_figure(dataset: xr.Dataset) -> Figure:
    """Draw the stress since the start at the longest rest, one line a speed, and the peak stress, one line a rest."""
    starts = starts_of(dataset)
    rests, speeds = ({start.rest for start in starts}, {abs(start.speed) for start in starts})
    longest = [start for start in starts if start.rest == max(rests)]
    figure, axes = style.rows([2.15]) if len(rests) == len(speeds) == 1 else style.pairs(2.9, shared=True)
    stresses = np.concatenate([start.stress for start in starts])
    factor = style.in_unit(axes[0].yaxis, r"shear stress $\tau_0$", stresses, "Pa")
    for panel in axes[1:]:
        _peak_panel(panel, starts, len(speeds - {0.0}) > 1, factor)
    _time_panel(axes[0], longest, factor)
    others = [style.swept_value(dataset, name, 0) for name in style.swept(dataset) if name not in _varied(dataset)]
    style.legend(axes[0], ", ".join([*others, f"after {style.text_of(max(rests), 's')} at rest, sliding at"]))
    return figure


def _time_panel(panel: Axes, starts: list[Start], factor: float) -> None:
    """Draw the stress over the time since the start; a dot is a peak that is resolved."""
    scale, times = "log" if len(starts) > 1 else "linear", starts[0].time
    length = style.Unit.of(times, "s", scale == "log")
    for start, colour in zip(starts, mpl.colormaps["viridis"](np.linspace(0.0, 0.88, len(starts))), strict=True):
        words = style.rounded(start.speed, "m/s")
        panel.plot(length.factor * start.time, factor * start.stress, color=colour, label=words)
        if start.resolved:
            panel.plot(length.factor * start.when, factor * start.peak, "o", markersize=3, color=colour)
    ends = times if scale == "log" else np.append(0.0, times)
    style.across(panel, length.factor * ends, length.label("time since the start"), scale)


def _peak_panel(panel: Axes, starts: list[Start], over_speed: bool, factor: float) -> None:
    """Draw the peak stress over the speed, one line a rest, or over the rest if there is only one speed.

    Thin lines over the speed are closed forms: the peak of Bell bonds if none rebinds, and steady sliding.
    """
    places = np.array([abs(start.speed) if over_speed else start.rest for start in starts])
    peaks, resolved = (np.array([getattr(start, name) for start in starts]) for name in ("peak", "resolved"))
    groups = np.array([start.rest if over_speed else 0.0 for start in starts])
    pace = style.Unit.of(places, "m/s" if over_speed else "s", logarithmic=True)
    x, y, rests = pace.factor * places, factor * peaks, np.unique(groups)
    fine = np.geomspace(places[places > 0.0].min(), places.max(), _FEWER)
    thin: Any = style.GREY | {"linewidth": 0.7}
    for number, rest in enumerate(rests):
        chosen = groups == rest
        grey = mpl.colors.to_hex((0.65 * (1.0 - (number + 1) / rests.size),) * 3)
        look: Any = {"color": grey, "marker": _MARKERS[number % len(_MARKERS)], "markersize": 3.5}
        panel.plot(x[chosen], y[chosen], label=f"{style.text_of(rest, 's')} at rest" if over_speed else "", **look)
        panel.plot(x[chosen & ~resolved], y[chosen & ~resolved], **look | {"linestyle": "none", "mfc": "white"})
    if not np.all(resolved):
        panel.plot([], [], "o", color=style.REFERENCE, mfc="white", label="not resolved")
    for start in {start.rest: start for start in starts if over_speed}.values():
        bonds = population_of(start.point)
        if bonds and bonds.pathway:
            force = schallamach.start_up_peak(fine, *bonds.pathway).force
            peak = start.fraction * (bonds.density * bonds.at_rest * force)
            panel.plot(pace.factor * fine, factor * peak, linestyle=":", label="none rebinds", **thin)
    for law in steady_laws(starts[0].point, fine)[:1] if over_speed else ():
        panel.plot(pace.factor * fine, factor * law.stress, label="steady sliding", **thin)
    panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]))
    words = pace.label("sliding speed $V$" if over_speed else "time at rest")
    style.across(panel, x, words, "log", 0.05)
    style.legend(panel, "peak of the stress")
