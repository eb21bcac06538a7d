"""The panels that several figures are made of, each drawing one observable of all curves."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sim.plots.curves import (
    Line,
    Scene,
    covered,
    curve,
    handle,
    last_closed,
    line_handles,
    opening_handles,
    spread_handles,
)
from sim.plots.style import BONDS, BOTH, FLUCTUATIONS, REFERENCE, Unit, fill, label, legend, rows

#: Share of the largest energy below which the fluctuations' own is told in a panel of its own.
_SMALL = 0.02

#: Opacity of the shades that show what a mechanism takes.
_SHADE = 0.35


def _contact_curves(panel: Axes, scene: Scene, name: str, factor: float) -> None:
    """Curves of a contact: each ends with a cross where the last member has come off."""
    for line, wide in zip(scene.lines, covered(scene, name, scene.lines), strict=True):
        curve(panel, scene, name, line, factor, line.colour, wide=wide)
        last = last_closed(scene, line)
        mean = factor * scene.values(f"{name}_mean", line)
        panel.plot(
            scene.x[line.number][last], mean[last], linestyle="none", marker="x", markersize=4, color=line.colour
        )
    if all(np.all(scene.opened(line)) for line in scene.lines):
        panel.text(0.5, 0.5, "the contact is open", transform=panel.transAxes, ha="center", va="center", fontsize=7)


def radius_panel(panel: Axes, scene: Scene) -> None:
    """Contact radius between Hertz's and JKR's."""
    unit = Unit.of(scene.all("contact_radius_mean", "radius_jkr"), "m")
    _references(panel, scene, "radius", unit.factor)
    _contact_curves(panel, scene, "contact_radius", unit.factor)
    panel.set_ylabel(label("contact radius $a$", unit.name))


def _references(panel: Axes, scene: Scene, name: str, factor: float, power: int = 1) -> None:
    """JKR's and Hertz's values: grey lines, in the curves' colours where there are several."""
    for line in scene.lines:
        for which, style in (("jkr", "--"), ("hertz", ":")):
            values = _broken(factor * scene.values(f"{name}_{which}", line) ** power)
            _reference(panel, values, style, scene, line)


def _reference(panel: Axes, values: np.ndarray, style: Any, scene: Scene, line: Line) -> None:
    colour, x = REFERENCE if scene.single else line.colour, scene.x[line.number]
    if not scene.joined:  # a short line for each category
        half = 0.5 * scene.category
        x, values = np.stack([x - half, x + half, x], axis=1).ravel(), np.repeat(values, 3)
        values[2::3] = np.nan
    panel.plot(x, values, linestyle=style, color=colour, linewidth=0.9, zorder=1.5)


def _broken(values: np.ndarray) -> np.ndarray:
    """Without the zeros of an open contact; one beside a closed contact is where it begins."""
    none = ~(values > 0.0)
    alone = none & np.append(True, none[:-1]) & np.append(none[1:], True)
    return np.where(alone, np.nan, values)


def reference_handles() -> list[Line2D]:
    styles: Any = (("--", "JKR"), (":", "Hertz"))
    return [Line2D([], [], color=REFERENCE, linewidth=0.9, linestyle=style, label=label) for style, label in styles]


_ENERGIES: Any = (
    ("bond_work", r"bonds left, $\Delta\gamma(N)$", BONDS, "-."),
    ("fluctuation_energy", r"fluctuations, $\Delta\Gamma$", FLUCTUATIONS, "--"),
    ("work_of_adhesion", "left to the contact, $w$", BOTH, "-"),
)


def energy_panel(panel: Axes, scene: Scene) -> None:
    """Work of the bonds left, fluctuation energy, and what both leave to the contact."""
    drawn = [entry for entry in _ENERGIES if np.any(np.nan_to_num(scene.all(f"{entry[0]}_mean")))]
    if _small_fluctuations(scene):
        drawn = [entry for entry in drawn if entry[0] != "fluctuation_energy"]
    if not scene.single:  # one colour for each curve leaves line styles for the energies
        drawn = [entry for entry in drawn if entry[0] != "bond_work"]
    values = scene.all(*(f"{name}_mean" for name, *_ in drawn))
    unit = Unit.of(values, "J/m^2")
    handles = []
    for name, text, own, style in drawn:
        curves = _distinct(scene, f"{name}_mean")
        placed = scene.middle() if len(curves) == 1 else scene
        for line, wide in zip(curves, covered(scene, name, curves), strict=True):
            colour = own if scene.single else REFERENCE if len(curves) == 1 else line.colour
            curve(panel, placed, name, line, unit.factor, colour, style, wide)
        handles.append(handle(scene, own if scene.single else REFERENCE, text, style))
    if np.any(values <= 0.0):
        panel.axhline(0.0, color=REFERENCE, linewidth=0.5, zorder=1)
    panel.set_ylabel(label("energy per area", unit.name))
    legend(panel, handles)


def _small_fluctuations(scene: Scene) -> bool:
    """Whether the fluctuation energy changes, but would be a line at zero beside the work left to the contact."""
    most, work = (float(np.nanmax(scene.all(f"{n}_mean"))) for n in ("fluctuation_energy", "work_of_adhesion"))
    return 0.0 < most < _SMALL * work and scene.tells("fluctuation_energy")


def _fluctuation_panel(panel: Axes, scene: Scene) -> None:
    """Fluctuation energy where it is small."""
    unit = Unit.of(scene.all("fluctuation_energy_mean"), "J/m^2")
    for line in _distinct(scene, "fluctuation_energy_mean"):
        curve(
            panel, scene, "fluctuation_energy", line, unit.factor, FLUCTUATIONS if scene.single else line.colour, "--"
        )
    panel.set_ylim(bottom=0.0)
    panel.set_ylabel(label(r"fluctuations $\Delta\Gamma$", unit.name))


def _distinct(scene: Scene, name: str) -> list[Line]:
    """Curves that do not lie on an earlier one."""
    kept: list[Line] = []
    for line in scene.lines:
        values = scene.values(name, line)
        if not any(np.array_equal(values, scene.values(name, other), equal_nan=True) for other in kept):
            kept.append(line)
    return kept


def friction_panel(panel: Axes, scene: Scene) -> None:
    """Friction force."""
    unit = Unit.of(scene.all("friction_force_mean"), "N")
    _contact_curves(panel, scene, "friction_force", unit.factor)
    panel.set_ylabel(label("friction $F$", unit.name))


def area_panel(panel: Axes, scene: Scene) -> None:
    """Contact area between Hertz's and JKR's."""
    unit = Unit.of(np.pi * scene.all("radius_jkr") ** 2, "m^2")
    _references(panel, scene, "radius", np.pi * unit.factor, power=2)
    _contact_curves(panel, scene, "contact_area", unit.factor)
    panel.set_ylabel(label("contact area $A$", unit.name))


def share_panel(panel: Axes, scene: Scene) -> None:
    """A/A_JKR over speed; for a single curve what each mechanism takes, stacked from JKR's line down."""
    panel.axhline(1.0, linestyle="--", color=REFERENCE, linewidth=0.9, zorder=1.5)
    handles: list[Any] = line_handles(scene)
    if scene.single and (scene.tells("lost_to_bonds") or scene.tells("lost_to_fluctuations")):
        handles += _stacked_shares(panel, scene)
    for line in scene.lines:
        hertz = (scene.values("radius_hertz", line) / scene.values("radius_jkr", line)) ** 2
        _reference(panel, _broken(hertz), ":", scene, line)
    _contact_curves(panel, scene, "area_ratio", 1.0)
    closing = [*spread_handles(scene, "area_ratio"), *opening_handles(scene), *reference_handles()]
    legend(panel, [*handles, *closing])
    panel.set_ylabel(r"contact area $A/A_\mathrm{JKR}$")


def _stacked_shares(panel: Axes, scene: Scene) -> list[Any]:
    """What each mechanism takes of JKR's area, as stacked shades; returns their legend entries."""
    line, x = scene.lines[0], scene.x[0]
    bonds, ratio = 1.0 - scene.values("lost_to_bonds_mean", line), scene.values("area_ratio_mean", line)
    steps = np.diff(x)
    if not (np.all(steps >= 0.0) or np.all(steps <= 0.0)):  # shades of there and back would lie on each other
        panel.plot(x, bonds, "-.", color=BONDS)
        return [Line2D([], [], color=BONDS, linestyle="-.", label="with the bonds left alone")]
    fill(panel, x, bonds, np.ones_like(bonds), BONDS, _SHADE)
    fill(panel, x, ratio, bonds, FLUCTUATIONS, _SHADE)
    return [
        Patch(facecolor=BONDS, alpha=_SHADE, label="lost to broken bonds"),
        Patch(facecolor=FLUCTUATIONS, alpha=_SHADE, label="lost to fluctuations"),
    ]


def stacked(scene: Scene, panels: list[tuple[float, Callable[[Axes, Scene], None]]]) -> Figure:
    """Panels of given heights [in] above each other that share their x axis, lettered."""
    heights = [height for height, _ in panels]
    figure, axes = rows(heights)
    for panel, (_, drawing) in zip(axes, panels, strict=True):
        drawing(panel, scene)
    return figure


def further_panels(scene: Scene) -> list[tuple[float, Callable[[Axes, Scene], None]]]:
    """Energies and friction, where they have something to tell."""
    panels: list[tuple[float, Callable[[Axes, Scene], None]]] = []
    if scene.tells("work_of_adhesion") or scene.tells("fluctuation_energy"):
        panels.append((1.6, energy_panel))
        if _small_fluctuations(scene):
            panels.append((1.2, _fluctuation_panel))
    if scene.tells("friction_force"):
        panels.append((1.2, friction_panel))
    return panels
