"""Figures of what bonds bear: friction over speed with its maximum, and the static peak after a rest."""

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import is_steady
from sim.plots.bond_laws import Steady, rest_of, steady_laws
from sim.plots.curves import Line, Scene, contact_curves, over_speed, speed_dim
from sim.plots.panels import stacked
from sim.plots.static_friction import start_figure
from sim.plots.style import HOLLOW, REFERENCE, in_unit, legend, recorded, rounded

#: Speeds at which a closed form is drawn.
_FINE = 600

#: Look of an exact closed form, grey that shows on a black line and beside it, and of an approximate one.
_LAWS: Any = {
    "-": {"linestyle": "-", "color": "#BBBBBB", "linewidth": 0.7, "zorder": 3},
    "--": {"linestyle": "--", "color": REFERENCE, "linewidth": 0.7, "zorder": 1.5},
}
_RING: Any = HOLLOW | {"markersize": 5.0, "mfc": "none", "mew": 0.9, "zorder": 4}


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
    if rest_of(dataset) is not None:
        return start_figure(dataset)
    scene = over_speed(dataset)
    laws = [law for line in scene.lines for law in _laws_of(dataset, scene, line)]

    def thin_lines(panel: Axes, values: Callable[[Steady], np.ndarray]) -> None:
        for speed, law in laws:
            panel.plot(scene.unit.factor * speed, values(law), label=law.words, **_LAWS[law.style])

    def stress_panel(panel: Axes, scene: Scene) -> None:
        """Shear stress of the dataset upon closed forms, with the maximum of each curve."""
        factor = in_unit(panel.yaxis, r"shear stress $\tau_0$", scene.all("shear_stress_mean"), "Pa")
        contact_curves(panel, scene._replace(lines=_marked(panel, scene, factor)), "shear_stress", factor)
        thin_lines(panel, lambda law: factor * law.stress)
        legend(panel, scene.title)

    def fraction_panel(panel: Axes, scene: Scene) -> None:
        thin_lines(panel, lambda law: law.fraction)
        contact_curves(panel, scene, "bond_fraction", 1.0)
        panel.set_ylabel("bond fraction $N/N_0$")

    panels = [(2.1, stress_panel), (1.3, fraction_panel)]
    return stacked(scene, panels if scene.varies("bond_fraction") else panels[:1])[0]


def _laws_of(dataset: xr.Dataset, scene: Scene, line: Line) -> list[tuple[np.ndarray, Steady]]:
    """Closed forms over the speeds of a curve, each with the speeds [m/s]."""
    speeds = scene.values("speed_mean", line)
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
    """The curves, each with its maximum in its name; a ring marks it."""
    named = []
    for line in scene.lines:
        speed, stress = scene.values("speed_mean", line), scene.values("shear_stress_mean", line)
        at = maximum_of(speed, stress)
        words = line.label
        if at is not None:
            panel.plot(scene.x[line.number][at], factor * stress[at], color=line.colour, **_RING)
            words += f": {rounded(float(stress[at]), 'Pa')} at {rounded(float(speed[at]), 'm/s')}" if words else ""
        named.append(line._replace(label=words))
    return named
