"""Figures of what bonds bear: friction over speed with its maximum, and the static peak after a rest."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import is_steady
from sim.plots.bond_laws import Steady, rest_of, steady_laws
from sim.plots.curves import Line, Scene, contact_curves, over_speed, room_of, speed_dim
from sim.plots.panels import stacked
from sim.plots.static_friction import start_figure
from sim.plots.style import REFERENCE, Unit, across, legend, recorded, rounded

#: Speeds at which a closed form is drawn.
_FINE = 600

#: Grey that shows on a black line and beside it.
_PALE = "#BBBBBB"

_RING: Any = {
    "linestyle": "none",
    "marker": "o",
    "markersize": 5.0,
    "markerfacecolor": "none",
    "markeredgewidth": 0.9,
    "zorder": 4,
}


def needs_stress(dataset: xr.Dataset) -> None:
    """Refuse a dataset without shear stress, or with one speed only."""
    rest = rest_of(dataset)
    if rest is not None and not bool((dataset["t"] > rest).any()):
        raise ValueError("the run ends before the slider starts; make clock.duration longer than drive.rest")
    if not bool((recorded(dataset, "shear_stress") != 0.0).any()):
        raise ValueError('the bonds bear no shear stress; give them one, such as [bonds] stress = "0.3 MPa"')
    if rest is None and is_steady(dataset) and speed_dim(dataset) is None:
        raise ValueError(
            'stress is drawn over the speed, which neither changes nor is swept; ramp it: [drive] model = "ramp", '
            'or rest and start: [drive] model = "start"'
        )


def stress_figure(dataset: xr.Dataset) -> Figure:
    """Shear stress with its maximum, and bonds, over speed; for a start from rest the static peaks."""
    needs_stress(dataset)
    if rest_of(dataset) is not None:
        return start_figure(dataset)
    scene, scale, unit = over_speed(dataset)
    laws = {line.number: _laws_of(dataset, scene, line, scale) for line in scene.lines}

    def stress_panel(panel: Axes, scene: Scene) -> None:
        _stress_panel(panel, scene, laws, unit.factor)

    def fraction_panel(panel: Axes, scene: Scene) -> None:
        for line in scene.lines:
            for speed, law in laws[line.number]:
                panel.plot(unit.factor * speed, law.fraction, **_thin(law.style))
        contact_curves(panel, scene, "bond_fraction", 1.0)
        panel.set_ylabel("bond fraction $N/N_0$")

    further = [(1.3, fraction_panel)] if scene.varies("bond_fraction") else []
    figure, axes = stacked(scene, [(2.1, stress_panel), *further])
    across(axes[-1], scene.x, scale, unit.label("sliding speed $V$"), room_of(scene))
    return figure


def _laws_of(dataset: xr.Dataset, scene: Scene, line: Line, scale: str) -> list[tuple[np.ndarray, Steady]]:
    """Closed forms over the speeds of a curve, each with the speeds [m/s]."""
    speeds = scene.values("speed_mean", line)
    low, high = float(np.min(speeds)), float(np.max(speeds))
    fine = np.linspace(low, high, _FINE)
    if scale == "log":
        fine = np.geomspace(low, high, _FINE)
    elif scale == "symlog":
        fine = np.append(0.0, np.geomspace(np.min(speeds[speeds > 0.0]), high, _FINE - 1))
    return [(fine, law) for law in steady_laws(dataset, line.point, fine)]


def _thin(style: str) -> dict[str, Any]:
    exact = style == "-"
    colour, height = (_PALE, 3) if exact else (REFERENCE, 1.5)
    return {"linestyle": style, "color": colour, "linewidth": 0.7, "zorder": height}


def _stress_panel(panel: Axes, scene: Scene, laws: dict[int, list[tuple[np.ndarray, Steady]]], pace: float) -> None:
    """Shear stress of the dataset upon closed forms, with the maximum of each curve."""
    unit = Unit.of(scene.all("shear_stress_mean"), "Pa")
    named = []
    for line in scene.lines:
        words = _mark_maximum(panel, scene, line, unit.factor)
        named.append(line._replace(label=f"{line.label}: {words}" if words and line.label else line.label))
    contact_curves(panel, scene._replace(lines=named), "shear_stress", unit.factor)
    for line in scene.lines:
        for speed, law in laws[line.number]:
            panel.plot(pace * speed, unit.factor * law.stress, label=law.words, **_thin(law.style))
    legend(panel, scene.title)
    panel.set_ylabel(unit.label(r"shear stress $\tau_0$"))


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


def _mark_maximum(panel: Axes, scene: Scene, line: Line, factor: float) -> str:
    """Mark the maximum with a ring; returns it in words, "" without one."""
    speed, stress = scene.values("speed_mean", line), scene.values("shear_stress_mean", line)
    at = maximum_of(speed, stress)
    if at is None:
        return ""
    panel.plot(scene.x[line.number][at], factor * stress[at], color=line.colour, **_RING)
    return f"{rounded(float(stress[at]), 'Pa')} at {rounded(float(speed[at]), 'm/s')}"
