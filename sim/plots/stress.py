"""Figures of what bonds bear: friction over speed with its maximum, and the static peak after a rest."""

from collections.abc import Callable
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import is_steady, setting, sweep_dims
from sim.analysis.scene import word
from sim.analysis.transients import jumps
from sim.plots import style
from sim.plots.bond_laws import Steady, population_of, rest_of, steady_laws
from sim.plots.curves import Line, Scene, contact_curves, over_speed, speed_dim
from sim.plots.measured import Measured
from sim.plots.panels import Panel, stacked

#: Speeds at which a closed form is drawn.
_FINE = 600

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
    rest = rest_of(dataset)
    if rest is not None and not bool((dataset["t"] > rest).any()):
        raise ValueError("the run ends before the slider starts; make clock.duration longer than drive.rest")
    if not bool((style.recorded(dataset, "shear_stress") != 0.0).any()):
        raise ValueError('the bonds bear no shear stress; give them one, such as [bonds] stress = "0.3 MPa"')
    if bool((word(dataset, "drive.model", "") == "force").any()):
        raise ValueError("stress is drawn over the speed, and a force is prescribed; see the figure creep")
    if rest is None and is_steady(dataset) and speed_dim(dataset) is None:
        cure = 'ramp it: [drive] model = "ramp", or rest and start: [drive] model = "start"'
        raise ValueError(f"stress is drawn over the speed, which neither changes nor is swept; {cure}")


def stress_figure(dataset: xr.Dataset, data: Measured | None = None, ax: Axes | None = None) -> Figure:
    """Shear stress with its maximum, and bonds, over speed; for a start from rest the static peaks."""
    if rest_of(dataset) is not None:
        if data or ax:
            raise ValueError("starts from rest have panels of their own; draw the kind time beside data, or on an ax")
        return start_figure(dataset)
    scene = over_speed(dataset)._replace(measured=data)
    laws = {line.number: _laws_of(dataset, scene, line) for line in scene.lines}

    def thin_lines(panel: Axes, scene: Scene, values: Callable[[Steady], np.ndarray]) -> None:
        for speed, law in (law for line in scene.lines for law in laws[line.number]):
            panel.plot(scene.unit.factor * speed, values(law), label=law.words, **_LAWS[law.style])

    def stress_panel(panel: Axes, scene: Scene) -> None:
        """Shear stress of the dataset upon closed forms, with the maximum of each curve."""
        factor = style.in_unit(panel.yaxis, r"shear stress $\tau_0$", scene.extent("shear_stress_mean"), "Pa")
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
    """Closed forms over the speeds of a curve, each with the speeds [m/s]."""
    speeds = scene.speeds(line)
    low, high = float(np.min(speeds)), float(np.max(speeds))
    fine = np.linspace(low, high, _FINE)
    if scene.scale == "log":
        fine = np.geomspace(low, high, _FINE)
    elif scene.scale == "symlog":
        fine = np.append(0.0, np.geomspace(np.min(speeds[speeds > 0.0]), high, _FINE - 1))
    return [(fine, law) for law in steady_laws(dataset, line.point, fine)]


def maximum_of(speed: np.ndarray, stress: np.ndarray) -> int | None:
    """Index of the friction maximum: where the size of the stress is largest; None at the ends of the speeds.

    >>> maximum_of(np.array([1.0, 2.0, 3.0]), np.array([1.0, 4.0, 2.0]))
    1
    >>> maximum_of(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 4.0])) is None
    True
    """
    known = np.isfinite(stress)
    if not np.any(known):
        return None
    at = int(np.nanargmax(np.abs(stress)))
    size = np.abs(speed)
    inside = np.min(size[known]) < size[at] < np.max(size[known])
    return at if inside else None


def _marked(panel: Axes, scene: Scene, factor: float) -> list[Line]:
    """The curves, each with its maximum in its name; a ring marks it. Where the speed jumps there is none."""
    named = []
    for line in scene.lines:
        speed, stress = scene.speeds(line), scene.values("shear_stress_mean", line)
        steps = scene.broken and jumps(speed, True).size  # their transients have no maximum over the speed
        at = None if steps else maximum_of(speed, stress)
        words = line.label
        if at is not None:
            panel.plot(scene.x[line.number][at], factor * stress[at], color=line.colour, **_RING)
            most, fast = style.rounded(float(stress[at]), "Pa"), style.rounded(float(speed[at]), "m/s")
            words = words and f"{words}: {most} at {fast}"
        named.append(line._replace(label=words))
    return named


class Start(NamedTuple):
    """One start: where in the sweep, rest [s], speed [m/s]; since it began times [s] and mean stresses [Pa].

    ``peak`` [Pa] is the largest stress, at the time ``when`` [s]; it is ``seen`` if the stress falls again and several
    steps lead up to it.
    """

    at: dict[str, int]
    rest: float
    speed: float
    fraction: float
    time: np.ndarray
    stress: np.ndarray
    peak: float
    when: float
    seen: bool


def _varied(dataset: xr.Dataset) -> list[str]:
    """Dimensions of the sweep along which the rest or the speed changes."""
    dims = {*setting(dataset, "drive.rest").dims, *setting(dataset, "drive.speed").dims}
    return [name for name in sweep_dims(dataset) if name in dims]


def starts_of(dataset: xr.Dataset) -> list[Start]:
    """All starts of a sweep over rest and speed, at the first point of further swept keys.

    Peaks are those of the clock steps, or where members differ those of their mean over the records.
    """
    varied, found, between = _varied(dataset), [], float(dataset["t"][1] - dataset["t"][0])
    means = [style.mean_of(dataset, name) for name in ("shear_stress", "bond_fraction")]
    for where in np.ndindex(*(dataset.sizes[name] for name in varied)):
        at = dict.fromkeys(sweep_dims(dataset), 0) | dict(zip(varied, where, strict=True))
        rest, speed = (style.number_at(setting(dataset, f"drive.{key}"), at) for key in ("rest", "speed"))
        stress, fraction = (mean.isel(at, missing_dims="ignore").to_numpy() for mean in means)
        time = dataset["t"].to_numpy() - rest
        slides = time > 1e-9 * (time[-1] + rest)
        if np.any(slides):
            before = float(fraction[max(int(np.argmax(slides)) - 1, 0)])
            time, stress = time[slides], stress[slides]
            k = int(np.argmax(np.abs(stress)))
            peak, when, step = float(abs(stress[k])), float(time[k]), between
            if "peak_stress" in dataset and "member" not in dataset["peak_stress"].dims:
                names = ("peak_stress", "peak_time", "clock_step")
                peak, when, step = (style.number_at(dataset[name], at) for name in names)
                when -= rest
            seen = bool(abs(stress[-1]) < peak and when > _STEPS * step)
            found.append(Start(at, rest, speed, before, time, stress, float(np.copysign(peak, speed)), when, seen))
    return found


def start_figure(dataset: xr.Dataset) -> Figure:
    """Stress since the start at the longest rest, one line a speed; peak stress over speed, one line a rest."""
    starts = starts_of(dataset)
    rests, speeds = ({start.rest for start in starts}, {abs(start.speed) for start in starts})
    longest = sorted((s for s in starts if s.rest == max(rests)), key=lambda s: abs(s.speed))
    figure, axes = style.rows([2.15]) if len(rests) == len(speeds) == 1 else style.pairs(2.9, shared=True)
    stresses = np.concatenate([start.stress for start in starts])
    factor = style.in_unit(axes[0].yaxis, r"shear stress $\tau_0$", stresses, "Pa")
    if len(axes) > 1:
        _peak_panel(axes[1], dataset, starts, len(speeds - {0.0}) > 1, factor)
    _time_panel(axes[0], longest, factor)
    others = [name for name in style.swept(dataset) if name not in _varied(dataset)]
    after = f"after {style.text_of(longest[0].rest, 's')} at rest, sliding at"
    style.legend(axes[0], ", ".join([*(style.swept_value(dataset, name, 0) for name in others), after]))
    return figure


def _time_panel(panel: Axes, starts: list[Start], factor: float) -> None:
    """Stress over the time since the start; a dot at each peak that is resolved."""
    several = len(starts) > 1
    times = starts[0].time
    length = style.Unit.of(times, "s", several)
    for start, colour in zip(starts, mpl.colormaps["viridis"](np.linspace(0.0, 0.88, len(starts))), strict=True):
        words = style.rounded(start.speed, "m/s")
        panel.plot(length.factor * start.time, factor * start.stress, color=colour, label=words)
        if start.seen:
            panel.plot(length.factor * start.when, factor * start.peak, "o", markersize=3, color=colour)
    ends = length.factor * np.array([times[0] if several else 0.0, times[-1]])
    style.across(panel, ends, length.label("time since the start"), "log" if several else "linear")


def _peak_panel(panel: Axes, dataset: xr.Dataset, starts: list[Start], over_speed: bool, factor: float) -> None:
    """Peak stress over speed, one line a rest; over the rest where there is one speed only.

    Beneath it what closed forms say of Bell bonds: their peak if none rebinds, and of any bonds steady sliding.
    """
    places = np.array([abs(start.speed) if over_speed else start.rest for start in starts])
    order = [k for k in np.argsort(places, kind="stable") if places[k] > 0.0]
    pace = style.Unit.of(places, "m/s" if over_speed else "s", logarithmic=True)
    lines = sorted({start.rest for start in starts}) if over_speed else [0.0]
    for number, rest in enumerate(lines):
        own = [k for k in order if not over_speed or starts[k].rest == rest]
        grey = mpl.colors.to_hex((0.65 * (1.0 - (number + 1) / len(lines)),) * 3)
        look: Any = {"color": grey, "marker": _MARKERS[number % len(_MARKERS)], "markersize": 3.5}
        x, y = pace.factor * places[own], factor * np.array([starts[k].peak for k in own])
        panel.plot(x, y, label=f"{style.text_of(rest, 's')} at rest" if over_speed else "", **look)
        risen = np.array([not starts[k].seen for k in own])
        panel.plot(x[risen], y[risen], **look | {"linestyle": "none", "mfc": "white"})
    if not all(start.seen for start in starts):
        panel.plot([], [], "o", color=style.REFERENCE, mfc="white", label="not resolved")
    if over_speed:
        _closed_forms(panel, dataset, starts, pace.factor, factor)
    panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]))
    words = pace.label("sliding speed $V$" if over_speed else "time at rest")
    style.across(panel, pace.factor * places, words, "log", 0.05)
    style.legend(panel, "peak of the stress")


def _closed_forms(panel: Axes, dataset: xr.Dataset, starts: list[Start], pace: float, factor: float) -> None:
    """Thin lines of what is known in closed form."""
    speeds = np.array([abs(start.speed) for start in starts if start.speed != 0.0])
    fine = np.geomspace(speeds.min(), speeds.max(), _FEWER)
    thin: Any = style.GREY | {"linewidth": 0.7}
    for start in {start.rest: start for start in starts}.values():
        bonds = population_of(dataset, start.at)
        if bonds and bonds.pathway:
            peak = start.fraction * bonds.start_peak(fine)
            panel.plot(pace * fine, factor * peak, linestyle=":", label="none rebinds", **thin)
    for law in steady_laws(dataset, starts[0].at, fine)[:1]:
        panel.plot(pace * fine, factor * law.stress, label="steady sliding", **thin)
