"""Panels of one observable each, and the figures made of them: over speed, time or a swept key, and friction loops."""

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import is_stationary, is_steady, speed_of
from sim.analysis.scene import stays_held
from sim.plots import style
from sim.plots.bond_laws import rest_of
from sim.plots.curves import Scene, colour_bar, contact_curves, curve, over_speed, scene_along, speed_dim

Panel = Callable[[Axes, Scene], None]

#: Share of the largest energy below which the fluctuations' own has a panel of its own.
_SMALL = 0.02

#: Opacity of the shades that show what a mechanism takes.
_SHADE = 0.35


def series(name: str, words: str, si: str) -> Panel:
    """A panel of one observable."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        contact_curves(panel, scene, name, style.in_unit(panel.yaxis, words, scene.all(f"{name}_mean"), si))

    return panel_of


friction_panel = series("friction_force", "friction $F$", "N")


def radius_panel(panel: Axes, scene: Scene) -> None:
    """Contact radius between Hertz's and JKR's."""
    radii = scene.all("contact_radius_mean", "jkr_radius_mean")
    factor = style.in_unit(panel.yaxis, "contact radius $a$", radii, "m")
    contact_curves(panel, scene, "contact_radius", factor)
    for which, dashes in (("JKR", "--"), ("Hertz", ":")):
        _reference(panel, scene, factor * scene.all(f"{which.lower()}_radius_mean"), dashes, which)


def _reference(panel: Axes, scene: Scene, values: np.ndarray, dashes: str, name: str) -> None:
    """Lines of a closed form: one grey one where all curves have the same, else in their colours."""
    known = [_broken(own) for own in values]
    same = scene.joined and all(np.array_equal(own, known[0], equal_nan=True) for own in known)
    if not np.any(np.isfinite(known)):
        return
    for line, own in zip(scene.lines[:1] if same else scene.lines, known, strict=False):
        x, y = scene.parted(line, own)
        if not scene.joined:  # a short line for each category
            half = 0.5 * scene.category
            x, y = np.stack([x - half, x + half, x], axis=1).ravel(), np.repeat(y, 3)
            y[2::3] = np.nan
        panel.plot(x, y, dashes, **style.GREY | ({} if same else {"color": line.colour}))
    panel.plot([], [], dashes, label=name, **style.GREY)


def _broken(values: np.ndarray) -> np.ndarray:
    """Without the zeros of an open contact; one beside a closed contact is where it begins."""
    none = ~(values > 0.0)
    alone = none & np.append(True, none[:-1]) & np.append(none[1:], True)
    return np.where(alone, np.nan, values)


_ENERGIES: Any = (
    ("bond_work", r"bonds left, $\Delta\gamma(N)$", style.BONDS, "-."),
    ("fluctuation_energy", r"fluctuations, $\Delta\Gamma$", style.FLUCTUATIONS, "--"),
    ("work_of_adhesion", "left to the contact, $w$", style.BOTH, "-"),
)


def energy_panel(panel: Axes, scene: Scene) -> None:
    """Work of adhesion of the bonds left, fluctuation energy, and what both leave to the contact."""
    drawn = [entry for entry in _ENERGIES if np.any(np.nan_to_num(scene.all(f"{entry[0]}_mean")))]
    if _small_fluctuations(scene):
        drawn = [entry for entry in drawn if entry[0] != "fluctuation_energy"]
    left, work = (scene.all(f"{name}_mean") for name in ("bond_work", "work_of_adhesion"))
    # one colour for each curve leaves line styles for the energies; without fluctuations all is left to the contact
    if not scene.single or np.allclose(left, work, rtol=1e-9, atol=0.0, equal_nan=True):
        drawn = [entry for entry in drawn if entry[0] != "bond_work"]
    values = scene.all(*(f"{name}_mean" for name, *_ in drawn))
    factor = style.in_unit(panel.yaxis, "energy per area", values, "J/m^2")
    for name, text, own, dashes in drawn:
        lines = scene.distinct(name)
        placed = scene.middle() if len(lines) == 1 else scene
        for line, wide in zip(lines, scene.covered(name, lines), strict=True):
            colour = own if scene.single else style.REFERENCE if len(lines) == 1 else line.colour
            curve(panel, placed, name, line, factor, colour, dashes, wide=wide)
        panel.plot([], [], color=own if scene.single else style.REFERENCE, label=text, **scene.look(dashes))
    if np.any(values <= 0.0):
        panel.axhline(0.0, **style.GUIDE)
    style.legend(panel)


def _small_fluctuations(scene: Scene) -> bool:
    """Whether the fluctuation energy changes, but would be a line at zero beside the work left to the contact."""
    most, work = (
        float(np.max(np.nan_to_num(scene.all(f"{n}_mean")))) for n in ("fluctuation_energy", "work_of_adhesion")
    )
    return 0.0 < most < _SMALL * work and scene.varies("fluctuation_energy")


def _fluctuation_panel(panel: Axes, scene: Scene) -> None:
    """Fluctuation energy where it is small."""
    energies = scene.all("fluctuation_energy_mean")
    factor = style.in_unit(panel.yaxis, r"fluctuations $\Delta\Gamma$", energies, "J/m^2")
    for line in scene.distinct("fluctuation_energy"):
        colour = style.FLUCTUATIONS if scene.single else line.colour
        curve(panel, scene, "fluctuation_energy", line, factor, colour, "--")
    panel.set_ylim(bottom=0.0)


def share_panel(panel: Axes, scene: Scene) -> None:
    """A/A_JKR; for a single curve what each mechanism takes, stacked from JKR's line down."""
    if scene.single:
        _stacked_shares(panel, scene)
    contact_curves(panel, scene, "area_ratio", 1.0)
    panel.axhline(1.0, linestyle="--", label="JKR", **style.GREY)
    hertz, jkr = (scene.all(f"{name}_radius_mean") for name in ("hertz", "jkr"))
    _reference(panel, scene, (hertz / np.where(jkr > 0.0, jkr, np.nan)) ** 2, ":", "Hertz")
    style.legend(panel, scene.title)
    panel.set_ylabel(r"contact area $A/A_\mathrm{JKR}$")


def _stacked_shares(panel: Axes, scene: Scene) -> None:
    """What each mechanism takes of JKR's area, as stacked shades."""
    line = scene.lines[0]
    bonds, ratio = 1.0 - scene.values("lost_to_bonds_mean", line), scene.values("area_ratio_mean", line)
    x, bonds, ratio = scene.parted(line, bonds, ratio)
    steps = np.diff(x)
    if not (np.all(steps >= 0.0) or np.all(steps <= 0.0)):  # shades of there and back would lie on each other
        if scene.varies("lost_to_bonds"):
            panel.plot(x, bonds, "-.", color=style.BONDS, label="with the bonds left alone")
        return
    if scene.varies("lost_to_bonds"):
        style.fill(panel, x, bonds, np.ones_like(bonds), color=style.BONDS, alpha=_SHADE, label="lost to broken bonds")
    if scene.varies("lost_to_fluctuations"):
        style.fill(panel, x, ratio, bonds, color=style.FLUCTUATIONS, alpha=_SHADE, label="lost to fluctuations")


def stacked(scene: Scene, panels: list[tuple[float, Panel]], room: float | None = None) -> tuple[Figure, list[Axes]]:
    """Panels of given heights [in] above each other with one x axis and its label, lettered; a colour bar if any."""
    figure, axes = style.rows([height for height, _ in panels])
    for panel, (_, drawing) in zip(axes, panels, strict=True):
        drawing(panel, scene)
    colour_bar(figure, axes, scene)
    style.across(axes[-1], scene.x, scene.words, scene.scale, (0.03 if scene.marked else 0.0) if room is None else room)
    return figure, axes


def further_panels(scene: Scene) -> list[tuple[float, Panel]]:
    """Energies and friction, where they change."""
    panels: list[tuple[float, Panel]] = []
    if scene.varies("work_of_adhesion") or scene.varies("fluctuation_energy"):
        panels.append((1.6, energy_panel))
        if _small_fluctuations(scene):
            panels.append((1.2, _fluctuation_panel))
    if scene.varies("friction_force"):
        panels.append((1.2, friction_panel))
    return panels


def needs_speeds(dataset: xr.Dataset) -> None:
    if rest_of(dataset) is not None:
        raise ValueError("a rest and a start have two speeds only; draw the kind stress")
    if is_steady(dataset) and speed_dim(dataset) is None:
        raise ValueError('the speed neither changes in time nor is swept; ramp it: [drive] model = "ramp"')


def curve_figure(dataset: xr.Dataset) -> Figure:
    """Contact area with what each mechanism takes of it, energies and friction, over speed."""
    scene = over_speed(dataset)
    return stacked(scene, [(1.9, share_panel), *further_panels(scene)])[0]


#: What drives a contact, drawn over time where it changes.
_DRIVEN = {"speed": ("speed $V$", "m/s"), "normal_load": ("load $P$", "N"), "displacement": (r"base $\Delta$", "m")}


def time_figure(dataset: xr.Dataset) -> Figure:
    """Contact radius, energies, friction, and speed, load and displacement that change, over time."""
    scene = scene_along(dataset, "t").placed(dataset["t"].to_numpy(), "time $t$", "s")
    moved = not bool(stays_held(dataset).all())
    shown = [name for name in _DRIVEN if scene.moves(name) and (name != "displacement" or moved)]
    driven = [(0.8, series(name, *_DRIVEN[name])) for name in shown]
    figure, axes = stacked(scene, [(1.6, radius_panel), *further_panels(scene), *driven])
    style.legend(axes[0], scene.title)
    return figure


def turns(dataset: xr.Dataset) -> bool:
    """Whether the speed does not only rise, or only fall, in time: a curve over it would lie on itself."""
    change = speed_of(dataset).diff("t")
    return rest_of(dataset) is None and bool(((change > 0.0).any("t") & (change < 0.0).any("t")).any())


def needs_friction(dataset: xr.Dataset) -> None:
    """Refuse a dataset without friction, or whose slider does not move."""
    if not bool((style.recorded(dataset, "friction_force") != 0.0).any()):
        raise ValueError('there is no friction; give the bonds a stress, such as [bonds] stress = "0.3 MPa"')
    if not bool((dataset["slider_position"] != 0.0).any()):
        raise ValueError('the slider does not move; let it: [drive] speed = "1 mm/s"')


def friction_figure(dataset: xr.Dataset) -> Figure:
    """Friction force over time and over the slider's position: the friction loop."""
    scene = scene_along(dataset, "t")
    figure, axes = style.rows([1.7, 2.1], shared=False)
    for panel, x, words, si, room in (
        (axes[0], dataset["t"].to_numpy(), "time $t$", "s", 0.0),
        (axes[1], scene.all("slider_position_mean"), "slider position $x$", "m", 0.03),
    ):
        placed = scene.placed(x, words, si, broken=True)
        friction_panel(panel, placed)
        panel.axhline(0.0, **style.GUIDE)
        style.across(panel, placed.x, placed.words, room=room)
    style.legend(axes[0], scene.title)
    colour_bar(figure, axes, scene)
    return figure


def needs_sweep(dataset: xr.Dataset) -> None:
    if not style.swept(dataset):
        raise ValueError('nothing is swept; sweep a key: [sweep] "contact.load" = ["1 mN", "4 mN"]')


def sweep_figure(dataset: xr.Dataset) -> Figure:
    """Contact radius, energies and friction over the first swept key; further keys make curves."""
    key = dataset[style.swept(dataset)[0]]
    words = f"{key.attrs.get('long_name', key.name)} {style.symbol(key)}".strip()
    scene, room, named = scene_along(dataset, str(key.name)), None, key.dtype.kind not in "fi"
    if named:
        scene = scene.placed(np.arange(key.size, dtype=float), words, "1").apart()
        room = (0.5 * scene.category + 0.1) / max(float(np.ptp(scene.x)), 1.0)
    else:
        values = key.to_numpy().astype(float)
        scene = scene.placed(values, words, key.attrs["units"], style.axis_scale(values))
    figure, axes = stacked(scene, [(1.7, radius_panel), *further_panels(scene)], room)
    if named:
        axes[-1].set_xticks(range(key.size), [str(value) for value in key.to_numpy()])
    style.legend(axes[0], scene.title if is_stationary(dataset) else _at_the_end(dataset, scene.title))
    return figure


def _at_the_end(dataset: xr.Dataset, averaged: str) -> str:
    """The last time and the speed then, which may differ between the points of the sweep, and what a mean is over."""
    words = [f"at the end: $t$ = {style.text_of(float(dataset['t'][-1]), 's')}"]
    if "speed" in dataset:
        speed = dataset["speed"].isel(t=-1)
        ends = dict.fromkeys(style.text_of(float(end), "m/s") for end in (speed.min(), speed.max()))
        words.append(f"$V$ = {' to '.join(ends)}")
    return ", ".join(filter(None, [*words, averaged]))
