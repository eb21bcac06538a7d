"""Panels of one observable each, and the figures made of them: over speed, time or a swept key, and friction loops."""

import contextlib
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import is_stationary, is_steady, setting, slips, speed_of
from sim.analysis.scene import stays_held
from sim.plots import style
from sim.plots.bond_laws import rest_of
from sim.plots.curves import Scene, colour_bar, contact_curves, curve, over, over_key, over_speed, over_time, speed_dim
from sim.plots.measured import Measured

Panel = Callable[[Axes, Scene], None]

#: Share of the largest energy below which the fluctuations' own has a panel of its own.
_SMALL = 0.02

#: Records that show a slip.
_FINE = 3

#: Opacity of the shades that show what a mechanism takes.
_SHADE = 0.35


def series(name: str, words: str, si: str) -> Panel:
    """A panel of one observable."""

    def panel_of(panel: Axes, scene: Scene) -> None:
        contact_curves(panel, scene, name, style.in_unit(panel.yaxis, words, scene.extent(f"{name}_mean"), si))

    return panel_of


friction_panel = series("friction_force", "friction $F$", "N")


def radius_panel(panel: Axes, scene: Scene) -> None:
    """Contact radius between Hertz's and JKR's."""
    radii = scene.extent("contact_radius_mean", "jkr_radius_mean")
    factor = style.in_unit(panel.yaxis, "contact radius $a$", radii, "m")
    contact_curves(panel, scene, "contact_radius", factor)
    for which, dashes in (("JKR", "--"), ("Hertz", ":")):
        _reference(panel, scene, factor * scene.all(f"{which.lower()}_radius_mean"), dashes, which)
    style.legend(panel, scene.title)


def area_panel(panel: Axes, scene: Scene) -> None:
    """Contact area between Hertz's and JKR's."""
    areas = {name: np.pi * scene.all(f"{name.lower()}_radius_mean") ** 2 for name in ("JKR", "Hertz")}
    most = np.append(scene.extent("contact_area_mean"), areas["JKR"])
    factor = style.in_unit(panel.yaxis, "contact area $A$", most, "m^2")
    contact_curves(panel, scene, "contact_area", factor)
    for (which, values), dashes in zip(areas.items(), ("--", ":"), strict=True):
        _reference(panel, scene, factor * values, dashes, which)
    style.legend(panel, scene.title)


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
    drawn = [entry for entry in _ENERGIES if np.any(np.nan_to_num(scene.extent(f"{entry[0]}_mean")))]
    if _small_fluctuations(scene):
        drawn = [entry for entry in drawn if entry[0] != "fluctuation_energy"]
    left, work = (scene.extent(f"{name}_mean") for name in ("bond_work", "work_of_adhesion"))
    # one colour for each curve leaves line styles for the energies; without fluctuations all is left to the contact
    if not scene.single or np.allclose(left, work, rtol=1e-9, atol=0.0, equal_nan=True):
        drawn = [entry for entry in drawn if entry[0] != "bond_work"]
    values = scene.extent(*(f"{name}_mean" for name, *_ in drawn))
    factor = style.in_unit(panel.yaxis, "energy per area", values, "J/m^2")
    for name, text, own, dashes in drawn:
        lines = scene.distinct(name)
        placed = scene.middle() if len(lines) == 1 else scene
        for line, hidden in zip(lines, scene.covered(name, lines), strict=True):
            colour = own if scene.single else style.REFERENCE if len(lines) == 1 else line.colour
            curve(panel, placed, name, line, factor, colour, dashes, hidden=hidden)
        panel.plot([], [], color=own if scene.single else style.REFERENCE, label=text, **scene.look(dashes))
    if np.any(values <= 0.0):
        panel.axhline(0.0, **style.GUIDE)
    style.legend(panel)


def _small_fluctuations(scene: Scene) -> bool:
    """Whether the fluctuation energy changes, but would be a line at zero beside the work left to the contact."""
    most, work = (
        float(np.max(np.nan_to_num(scene.extent(f"{n}_mean")))) for n in ("fluctuation_energy", "work_of_adhesion")
    )
    return 0.0 < most < _SMALL * work and scene.varies("fluctuation_energy")


def _fluctuation_panel(panel: Axes, scene: Scene) -> None:
    """Fluctuation energy where it is small."""
    energies = scene.extent("fluctuation_energy_mean")
    factor = style.in_unit(panel.yaxis, r"fluctuations $\Delta\Gamma$", energies, "J/m^2")
    lines = scene.distinct("fluctuation_energy")
    for line in lines:
        colour = style.FLUCTUATIONS if scene.single else style.REFERENCE if len(lines) == 1 else line.colour
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


def stacked(
    scene: Scene, panels: list[tuple[float, Panel]], room: float | None = None, ax: Axes | None = None
) -> tuple[Figure, list[Axes]]:
    """Panels of given heights [in] above each other with one x axis and its label, lettered; a colour bar if any.

    Below them are residuals of measured points, if any. The panels of the first column are returned. With ``ax`` the
    first panel alone is drawn, there.
    """
    columns = scene.columns or (("", scene.lines),)
    compared = scene.measured is not None and scene.measured.has_errors and ax is None
    if ax is None:
        heights = [height for height, _ in panels] + [0.8] * compared
        figure, axes = style.grid(heights, len(columns))
    else:
        figure, axes, panels = cast(Figure, ax.figure), np.array([[ax]]), panels[:1]
        if len(columns) > 1:
            raise ValueError(f"{len(columns)} panels side by side do not go into one; choose by where, or leave ax out")
    for number, (words, lines) in enumerate(columns):
        part = scene._replace(lines=lines)
        for panel, (_, drawing) in zip(axes[:, number], panels, strict=False):
            drawing(panel, part)
        if scene.measured and compared:
            scene.measured.residual_panel(axes[-1, number], {line.number for line in lines}, scene.over)
        edge = 0.03 if scene.marked or scene.measured else 0.0
        style.across(axes[-1, number], scene.reach, scene.words, scene.scale, edge if room is None else room)
        if words:
            axes[0, number].set_title(words)
    if scene.columns:
        style.legends_of_first(figure, axes)
    elif ax is not None:
        style.moved_legend(ax, ax, loc="best")  # above the panel there may be no room
    if scene.measured:
        scene.measured.refuse_undrawn(scene.over)
    colour_bar(figure, list(axes.flat), scene)
    return figure, list(axes[:, 0])


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


def curve_figure(
    dataset: xr.Dataset, x: str = "", absolute: bool = False, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Contact area with what each mechanism takes of it, energies and friction, over speed."""
    scene = (over(dataset, x) if x else over_speed(dataset))._replace(measured=data)
    return stacked(scene, [(1.9, area_panel if absolute else share_panel), *further_panels(scene)], ax=ax)[0]


#: What drives a contact, drawn over time where it changes.
_DRIVEN = {"speed": ("speed $V$", "m/s"), "normal_load": ("load $P$", "N"), "displacement": (r"base $\Delta$", "m")}


def time_figure(
    dataset: xr.Dataset, x: str = "", absolute: bool = False, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Contact radius, energies, friction, and speed, load and displacement that change, over time."""
    scene = (over(dataset, x) if x else over_time(dataset))._replace(measured=data)
    scene = scene._replace(heading="; ".join(filter(None, [scene.title, coarse_slips(dataset)])))
    moved = not bool(stays_held(dataset).all())
    shown = [name for name in _DRIVEN if scene.moves(name) and (name != "displacement" or moved) and name != scene.over]
    driven = [(0.8, series(name, *_DRIVEN[name])) for name in shown]
    first = area_panel if absolute else radius_panel
    return stacked(scene, [(1.6, first), *further_panels(scene), *driven], ax=ax)[0]


def coarse_slips(dataset: xr.Dataset) -> str:
    """Remark where slips last hardly longer than the time between records, with the cure; "" elsewhere."""
    with contextlib.suppress(ValueError, KeyError):
        lasting, apart = slips(dataset)["slip_duration"].median(), float(dataset["t"][1] - dataset["t"][0])
        if float(lasting) < _FINE * apart:
            key = "step" if apart < 1.5 * float(setting(dataset, "clock.step")) else "record"
            return f"slips last less than {_FINE} records, which miss part of them: a shorter clock.{key} shows them"
    return ""


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


def friction_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Friction force over time and over the slider's position: the friction loop."""
    scene = over_time(dataset)._replace(measured=data)
    figure, axes = style.rows([1.7, 2.1], shared=False)
    for panel, name, x, words, si, room in (
        (axes[0], "t", dataset["t"].to_numpy(), "time $t$", "s", 0.0),
        (axes[1], "slider_position", scene.all("slider_position_mean"), "slider position $x$", "m", 0.03),
    ):
        placed = scene.placed(name, x, words, si, broken=True)
        friction_panel(panel, placed)
        panel.axhline(0.0, **style.GUIDE)
        style.across(panel, placed.reach, placed.words, room=room)
    if data:
        data.refuse_undrawn("t")
    style.legend(axes[0], scene.title)
    colour_bar(figure, axes, scene)
    return figure


def needs_sweep(dataset: xr.Dataset) -> None:
    if not style.swept(dataset):
        raise ValueError('nothing is swept; sweep a key: [sweep] "contact.load" = ["1 mN", "4 mN"]')


def sweep_figure(
    dataset: xr.Dataset, x: str = "", absolute: bool = False, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Contact radius, energies and friction over the first swept key; further keys make curves."""
    scene = (over(dataset, x) if x else over_key(dataset, style.swept(dataset)[0]))._replace(measured=data)
    room = None if scene.joined else (0.5 * scene.category + 0.1) / max(float(np.ptp(scene.x)), 1.0)
    if not is_stationary(dataset):
        scene = scene._replace(heading=_at_the_end(dataset, scene.title))
    first = area_panel if absolute else radius_panel
    figure, axes = stacked(scene, [(1.7, first), *further_panels(scene)], room, ax)
    if not scene.joined:
        names = dataset[scene.over].to_numpy()
        axes[-1].set_xticks(range(names.size), [str(value) for value in names])
    return figure


def _at_the_end(dataset: xr.Dataset, averaged: str) -> str:
    """The last time and the speed then, which may differ between the points of the sweep, and what a mean is over."""
    words = [f"at the end: $t$ = {style.text_of(float(dataset['t'][-1]), 's')}"]
    if "speed" in dataset:
        speed = dataset["speed"].isel(t=-1)
        ends = dict.fromkeys(style.text_of(float(end), "m/s") for end in (speed.min(), speed.max()))
        words.append(f"$V$ = {' to '.join(ends)}")
    return ", ".join(filter(None, [*words, averaged]))
