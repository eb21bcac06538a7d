"""The figure of static friction: a slider that rests and starts, its stress over time, and the peaks."""

from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import engineering, setting, sweep_dims
from sim.plots import style
from sim.plots.bond_laws import start_peak, steady_laws

_MARKERS = "osD^vP"
_FINE = 300


class Start(NamedTuple):
    """One start: where in the sweep, rest [s], speed [m/s]; since it began times [s] and mean stresses [Pa]."""

    at: dict[str, int]
    rest: float
    speed: float
    fraction: float
    time: np.ndarray
    stress: np.ndarray

    @property
    def peak(self) -> int:
        """Index of the largest stress."""
        return int(np.argmax(np.abs(self.stress)))

    @property
    def seen(self) -> bool:
        """Whether the records show the peak: three lead up to it, and the next is not lower by a fifth."""
        beside = np.abs(self.stress[self.peak + 1 : self.peak + 2])
        return self.peak > 2 and beside.size == 1 and bool(beside[0] >= 0.8 * abs(self.stress[self.peak]))


def _varied(dataset: xr.Dataset) -> list[str]:
    """Dimensions of the sweep along which the rest or the speed changes."""
    dims = {*setting(dataset, "drive.rest").dims, *setting(dataset, "drive.speed").dims}
    return [name for name in sweep_dims(dataset) if name in dims]


def starts_of(dataset: xr.Dataset) -> list[Start]:
    """All starts of a sweep over rest and speed, at the first point of further swept keys."""
    rest, speed, varied = setting(dataset, "drive.rest"), setting(dataset, "drive.speed"), _varied(dataset)
    first = {name: 0 for name in sweep_dims(dataset) if name not in varied}
    values = [style.mean_of(dataset, name) for name in ("shear_stress", "bond_fraction")]
    time, found = dataset["t"].to_numpy(), []
    for where in np.ndindex(*(dataset.sizes[name] for name in varied)):
        at = first | dict(zip(varied, where, strict=True))
        still, pace = (float(number.isel(at, missing_dims="ignore")) for number in (rest, speed))
        stress, fraction = (value.isel(at, missing_dims="ignore").to_numpy() for value in values)
        slides = time > still + 1e-9 * time[-1]
        if np.any(slides):
            before = float(fraction[~slides][-1]) if not np.all(slides) else float(fraction[0])
            found.append(Start(at, still, pace, before, time[slides] - still, stress[slides]))
    return found


def start_figure(dataset: xr.Dataset) -> Figure:
    """Stress since the start at the longest rest, one line a speed; peak stress over speed, one line a rest."""
    starts = starts_of(dataset)
    unit = style.Unit.of(np.concatenate([start.stress for start in starts]), "Pa")
    longest = sorted((s for s in starts if s.rest == max(s.rest for s in starts)), key=lambda s: abs(s.speed))
    over = "speed" if len({abs(s.speed) for s in starts} - {0.0}) > 1 else "rest"
    if len({getattr(start, over) for start in starts}) == 1:
        figure = style.picture(style.COLUMN, 2.6)
        axes = [figure.subplots()]
    else:
        figure = style.picture(style.WIDE, 2.9)
        axes = list(figure.subplots(1, 2, sharey=True))
        style.letter(axes)
        _peak_panel(axes[1], dataset, starts, over, unit)
    _time_panel(axes[0], longest, unit)
    others = [name for name in sweep_dims(dataset) if name not in _varied(dataset) and dataset.sizes[name] > 1]
    after = f"after {engineering(longest[0].rest, 's')} at rest, sliding at"
    style.legend(axes[0], ", ".join([*(style.swept_value(dataset, name, 0) for name in others), after]))
    return figure


def _coloured(starts: list[Start]) -> list[tuple[Start, str]]:
    """Starts with the colours of their lines."""
    shades = mpl.colormaps["viridis"](np.linspace(0.0, 0.88, len(starts)))
    return [(start, mpl.colors.to_hex(shade)) for start, shade in zip(starts, shades, strict=True)]


def _time_panel(panel: Axes, starts: list[Start], unit: style.Unit) -> None:
    """Stress over the time since the start; a dot at each peak that was recorded."""
    several = len(starts) > 1
    length = style.Unit.of(np.concatenate([start.time for start in starts]), "s", several)
    for start, colour in _coloured(starts):
        time, stress = length.factor * start.time, unit.factor * start.stress
        panel.plot(time, stress, color=colour, label=style.rounded(start.speed, "m/s"))
        if start.seen:
            panel.plot(time[start.peak], stress[start.peak], "o", markersize=3, color=colour)
    first, last = (length.factor * float(starts[0].time[k]) for k in (0, -1))
    if several and last > first:
        style.span(panel, first, last)
    else:
        panel.set_xlim(0.0, last)
    panel.set_ylabel(unit.label(r"shear stress $\tau_0$"))
    panel.set_xlabel(length.label("time since the start"))


def _peak_panel(panel: Axes, dataset: xr.Dataset, starts: list[Start], over: str, unit: style.Unit) -> None:
    """Peak stress over speed, one line a rest; over the rest where there is one speed only.

    Beneath it what closed forms say of Bell bonds: their peak if none rebinds, and of any bonds steady sliding.
    """
    values = np.array([abs(getattr(start, over)) for start in starts])
    pace = style.Unit.of(values, "m/s" if over == "speed" else "s", logarithmic=True)
    groups = sorted({start.rest for start in starts}) if over == "speed" else [None]
    for k, rest in enumerate(groups):
        own = sorted((s for s in starts if rest in (s.rest, None)), key=lambda s: abs(getattr(s, over)))
        own = [s for s in own if getattr(s, over) != 0.0]
        shade = mpl.colors.to_hex((0.65 * (1.0 - (k + 1) / len(groups)),) * 3)
        x, y = np.array([(abs(getattr(s, over)), s.stress[s.peak]) for s in own]).T
        line: Any = {"color": shade, "marker": _MARKERS[k % len(_MARKERS)], "markersize": 3.5}
        panel.plot(pace.factor * x, unit.factor * y, label=f"{engineering(rest, 's')} at rest" if rest else "", **line)
        rising = np.array([not s.seen for s in own])
        panel.plot(pace.factor * x[rising], unit.factor * y[rising], **(line | {"linestyle": "none", "mfc": "white"}))
    if not all(start.seen for start in starts):
        panel.plot([], [], "o", color=style.REFERENCE, mfc="white", label="not resolved")
    if over == "speed":
        _closed_forms(panel, dataset, starts, pace, unit)
    panel.set_xscale("log")
    if values.max() < 100.0 * np.min(values[values > 0.0]):
        style.plain_ticks(panel.xaxis)
    panel.set_ylim(bottom=min(0.0, panel.get_ylim()[0]))
    words = "sliding speed $V$" if over == "speed" else "time at rest"
    panel.set_xlabel(pace.label(words))
    style.legend(panel, "peak of the stress")


def _closed_forms(panel: Axes, dataset: xr.Dataset, starts: list[Start], pace: style.Unit, unit: style.Unit) -> None:
    """Thin lines of what is known in closed form."""
    speeds = np.array([abs(start.speed) for start in starts if start.speed != 0.0])
    fine = np.geomspace(speeds.min(), speeds.max(), _FINE)
    thin: Any = {"color": style.REFERENCE, "linewidth": 0.7, "zorder": 1.5}
    peaks = [start_peak(dataset, start.at, fine, start.fraction) for start in {s.rest: s for s in starts}.values()]
    for peak in (peak for peak in peaks if peak is not None):
        panel.plot(pace.factor * fine, unit.factor * peak, linestyle=":", label="none rebinds", **thin)
    for law in steady_laws(dataset, starts[0].at, fine)[:1]:
        panel.plot(pace.factor * fine, unit.factor * law.stress, label="steady sliding", **thin)
