"""The figure of static friction: a slider that rests and starts, its stress over time, and the peaks."""

from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import setting, sweep_dims
from sim.plots import style
from sim.plots.bond_laws import population_of, steady_laws
from sim.plots.style import number_at

_MARKERS = "osD^vP"
_FINE = 300

#: A peak is resolved if more steps than that lead up to it.
_STEPS = 3.5


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
    varied, found = _varied(dataset), []
    for where in np.ndindex(*(dataset.sizes[name] for name in varied)):
        at = dict.fromkeys(sweep_dims(dataset), 0) | dict(zip(varied, where, strict=True))
        rest, speed = (number_at(setting(dataset, f"drive.{key}"), at) for key in ("rest", "speed"))
        means = (style.mean_of(dataset, name) for name in ("shear_stress", "bond_fraction"))
        stress, fraction = (mean.isel(at, missing_dims="ignore").to_numpy() for mean in means)
        time = dataset["t"].to_numpy() - rest
        slides = time > 1e-9 * (time[-1] + rest)
        if np.any(slides):
            before = float(fraction[~slides][-1]) if not np.all(slides) else float(fraction[0])
            time, stress = time[slides], stress[slides]
            k = int(np.argmax(np.abs(stress)))
            peak, when, step = float(abs(stress[k])), float(time[k]), float(dataset["t"][1] - dataset["t"][0])
            if "peak_stress" in dataset and "member" not in dataset["peak_stress"].dims:
                peak, when, step = (number_at(dataset[name], at) for name in ("peak_stress", "peak_time", "clock_step"))
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
    panel.set_xscale("log")
    if places.max() < 100.0 * np.min(places[places > 0.0]):
        style.plain_ticks(panel.xaxis)
    panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]))
    panel.set_xlabel(pace.label("sliding speed $V$" if over_speed else "time at rest"))
    style.legend(panel, "peak of the stress")


def _closed_forms(panel: Axes, dataset: xr.Dataset, starts: list[Start], pace: float, factor: float) -> None:
    """Thin lines of what is known in closed form."""
    speeds = np.array([abs(start.speed) for start in starts if start.speed != 0.0])
    fine = np.geomspace(speeds.min(), speeds.max(), _FINE)
    thin: Any = style.GREY | {"linewidth": 0.7}
    for start in {start.rest: start for start in starts}.values():
        bonds = population_of(dataset, start.at)
        if bonds and bonds.pathway:
            peak = start.fraction * bonds.start_peak(fine)
            panel.plot(pace * fine, factor * peak, linestyle=":", label="none rebinds", **thin)
    for law in steady_laws(dataset, starts[0].at, fine)[:1]:
        panel.plot(pace * fine, factor * law.stress, label="steady sliding", **thin)
