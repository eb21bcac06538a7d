"""Figures of a slider behind a spring: creep, the map of stability, and the contact area before sliding."""

import contextlib
import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import setting, sweep_dims
from sim.analysis.scene import MEMBERS, word
from sim.analysis.transients import incipient_law
from sim.laws import jkr, schallamach
from sim.laws.schallamach import Body
from sim.plots import style
from sim.plots.bond_laws import population_of
from sim.plots.curves import Scene, scene_along
from sim.plots.measured import Measured
from sim.plots.panels import Panel, series, stacked

#: Speeds of a map, and at which its boundary is drawn.
_CELLS, _FINE = 28, 200
#: Change of the bond fraction by which the growth of the area is found.
_LITTLE = 1e-4
_FRAME: Any = {"color": style.BONDS, "linewidth": 1.4}


def needs_spring(dataset: xr.Dataset) -> None:
    """Refuse a dataset without a spring."""
    if "stage_speed" not in dataset and "stage_speed_mean" not in dataset:
        raise ValueError('no stage pulls through a spring; let one: [drive] model = "spring"')


def needs_force(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force is prescribed."""
    if not bool((word(dataset, "drive.model", "") == "force").all()):
        raise ValueError('no force is prescribed; let one: [drive] model = "force"')


def creep_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Displacement and speed of the slider over time under a prescribed force; a cross ends a runaway."""
    later = dataset.isel(t=slice(1, None))
    scene = scene_along(later, "t")._replace(measured=data)
    scene = scene.placed("t", later["t"].to_numpy(), "time under the force $t$", "s", "log")
    position, speed = _run("slider_position", "displacement $x$", "m"), _run("speed", "speed $V$", "m/s")
    return stacked(scene, [(1.8, position), (1.6, speed)])[0]


def _run(name: str, words: str, si: str) -> Panel:
    """A panel of what grows, with a cross at the last record before a trajectory ends."""
    curves = series(name, words, si)

    def panel_of(panel: Axes, scene: Scene) -> None:
        curves(panel, scene)
        panel.set_yscale("log")
        for k, line in enumerate(scene.lines):
            values, drawn = scene.values(f"{name}_mean", line), np.asarray(panel.lines[k].get_ydata())
            there = np.flatnonzero(np.isfinite(values))
            if 0 < there.size < values.size:
                look: Any = {"color": line.colour, "markersize": 4, "label": "runaway"}
                panel.plot(scene.x[line.number][there[-1]], drawn[there[-1]], "x", **look)
        if name == "slider_position":
            style.legend(panel, scene.title)

    return panel_of


def needs_map(dataset: xr.Dataset) -> None:
    """Refuse a dataset that is no sweep of springs over stage speeds."""
    needs_spring(dataset)
    if style.swept(dataset) != ["drive_stiffness"] or not bool((dataset["stage_speed"].isel(t=-1) > 0.0).all()):
        cure = '[sweep] "drive.stiffness" = {from = "10 N/m", to = "1 kN/m", count = 9, scale = "log"}'
        raise ValueError(f"a map needs a sweep of the spring alone under a stage that ramps; {cure}")


def stability_figure(dataset: xr.Dataset) -> Figure:
    """Swing of the spring's force over speed and stiffness, up and down, with the theory's boundary."""
    force = style.mean_of(dataset.isel({MEMBERS: slice(0, 1)}), "spring_force").transpose(..., "t")
    speed = dataset["stage_speed"].isel({MEMBERS: 0, "drive_stiffness": 0}, missing_dims="ignore").to_numpy()
    stiffness = dataset["drive_stiffness"].to_numpy()
    turn = int(np.argmax(speed)) + 1
    legs = {"faster and faster": slice(1, turn), "slower and slower": slice(turn - 1, None)}
    legs = {words: leg for words, leg in legs.items() if speed[leg].size > _CELLS}
    edges = np.geomspace(np.min(speed[1:]), np.max(speed), _CELLS + 1)
    pace, hard = style.Unit.of(edges, "m/s", True), style.Unit.of(stiffness, "N/m", True)
    steps = np.sqrt(stiffness[1:] * stiffness[:-1])
    rows = np.concatenate([[stiffness[0] ** 2 / steps[0]], steps, [stiffness[-1] ** 2 / steps[-1]]])
    figure, axes = style.pairs(2.6, shared=True) if len(legs) > 1 else style.rows([2.6])
    fine = np.geomspace(edges[0], edges[-1], _FINE)
    boundary = _boundary(dataset, fine)
    for panel, (words, leg) in zip(axes, legs.items(), strict=True):
        swing = _swings(force.to_numpy()[:, leg], speed[leg], edges)
        grey: Any = {"vmin": 0.0, "vmax": 1.0, "cmap": "Greys", "rasterized": True}  # greys that no page turns over
        mesh = panel.pcolormesh(pace.factor * edges, hard.factor * rows, swing, **grey)
        panel.plot(pace.factor * fine, hard.factor * boundary, label="theory: unstable below", **_FRAME)
        panel.set(yscale="log", ylim=hard.factor * rows[[0, -1]])
        style.across(panel, pace.factor * edges, pace.label("speed of the stage $V$"), "log")
        style.legend(panel, words)
    axes[0].set_ylabel(hard.label("stiffness of the spring $K$"))
    bar = figure.colorbar(mesh, ax=axes, label="swing of the force over its largest", pad=0.02)
    if bar.solids is not None:
        bar.solids.set_rasterized(True)
    return figure


def _swings(force: np.ndarray, speed: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Range of each row of forces over its largest, in each cell of the speed."""
    place = np.clip(np.searchsorted(edges, speed, "right") - 1, 0, len(edges) - 2)
    found = np.full((len(force), len(edges) - 1), np.nan)
    for cell in np.unique(place):
        own = np.abs(force[:, place == cell])
        found[:, cell] = 1.0 - own.min(axis=1) / own.max(axis=1)
    return found


def _boundary(dataset: xr.Dataset, speed: np.ndarray) -> np.ndarray:
    """Stiffness below which steady sliding is unstable [N/m], for ``rate`` bonds in mean field; nan where unknown."""
    at, bonds = dict.fromkeys(sweep_dims(dataset), 0), population_of(dataset, dict.fromkeys(sweep_dims(dataset), 0))
    if bonds is None:
        return np.full(speed.shape, np.nan)
    mean_field = bool(bonds.pathway) and str(word(dataset, "bonds.model", "").item()) == "rate"
    onset = bonds.rupture.first_moment_onset if mean_field else bonds.rupture.resolved_onset
    bound = bonds.rupture.closed_form(speed, bonds.stiffness, bonds.rebinding).bound / bonds.at_rest
    if mean_field:
        bound = np.asarray(schallamach.first_moment_fraction(speed, *bonds.pathway, bonds.rebinding))
    less, area, more = (_area(dataset, at, bound * share) for share in (1.0 - _LITTLE, 1.0, 1.0 + _LITTLE))
    growth, firm, own = (more - less) / (2.0 * _LITTLE * area), np.full(speed.shape, math.inf), 0.0
    if str(word(dataset, "drive.contact_stiffness", "half_space").item()) == "half_space":
        own = 0.5
        modulus, ratio = (float(dataset[f"effective_{name}"].isel(at, missing_dims="ignore")) for name in _SOLID)
        firm = 0.75 * math.pi**2 * modulus * np.sqrt(area / math.pi) / (2.0 - ratio)
    with contextlib.suppress(KeyError):
        firm = np.full(speed.shape, style.number_at(setting(dataset, "drive.contact_stiffness"), at))
    mass, damping, viscosity = (style.number_at(setting(dataset, f"drive.{key}"), at) for key in _DELAYS)
    body = Body(area, growth, 0.0, mass, damping, viscosity, firm, own)
    return np.asarray(onset(speed, bonds.stiffness, bonds.rebinding, bonds.density, body).stiffness)


_DELAYS = ("mass", "damping", "viscosity")
_SOLID = ("shear_modulus", "poisson_ratio")


def _area(dataset: xr.Dataset, at: dict[str, int], bound: np.ndarray) -> np.ndarray:
    """Area of an equilibrium contact at a load, with these bonds over those at rest [m²]; nan under other controls."""
    try:
        keys = ("contact.load", "sphere.radius", "adhesion.work", "adhesion.bond_share")
        load, size, work, share = (style.number_at(setting(dataset, key), at) for key in keys)
    except KeyError:
        return np.full(bound.shape, np.nan)
    modulus = style.number_at(dataset["contact_modulus"], at)
    radius = jkr.radius_at_load(load, work * (1.0 - share + share * bound), size, modulus)
    return np.asarray(math.pi * np.square(radius))


def needs_pull(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force grows from rest."""
    if "spring_force" not in dataset and "spring_force_mean" not in dataset:
        raise ValueError('nothing pulls the slider; let a spring do it: [drive] model = "spring"')
    force = style.mean_of(dataset, "spring_force")
    if bool((abs(force.isel(t=0)) > 0.01 * abs(force).max("t")).any()):
        raise ValueError('the force does not begin at zero; start at rest: [drive] start = "rest"')


def incipient_figure(dataset: xr.Dataset, absolute: bool = False) -> Figure:
    """Contact area over the tangential force on the way to sliding, with A0 − αQ² beside it.

    The law is fitted by least squares up to half of the largest force.
    """
    scene = scene_along(dataset, "t")
    force, area = np.abs(scene.all("spring_force_mean")), scene.all("contact_area_mean")
    tops = [incipient_law(*own)[0] for own in zip(force, area, strict=True)]
    rises = np.arange(force.shape[1]) <= np.array(tops)[:, np.newaxis]
    unit = style.Unit.of(force, "N")
    figure, axes = style.rows([2.0, 1.8], shared=False)
    axes[0].set_ylabel("contact area $A/A_0$")
    factor = style.in_unit(axes[0].yaxis, "contact area $A$", area, "m^2") if absolute else 1.0
    for line in scene.lines:
        up = rises[line.number]
        pulled, own = force[line.number, up], area[line.number, up]
        _, alpha = incipient_law(pulled, own)
        law = alpha * pulled**2 / own[0]
        words = rf"$\alpha$ = {1e6 * alpha:.3g} mm$^2$/N$^2$"
        name = f"{line.label}: {words}" if not scene.single else words
        look = style.GREY | ({} if scene.single else {"color": line.colour})
        full = factor * own[0] if absolute else 1.0
        axes[0].plot(unit.factor * pulled, full * own / own[0], color=line.colour, label=name)
        axes[0].plot(unit.factor * pulled, full * (1.0 - law), "--", **look)
        axes[1].plot(unit.factor * pulled[1:], 1.0 - own[1:] / own[0], color=line.colour)
        axes[1].plot(unit.factor * pulled[1:], law[1:], "--", **look)
    axes[0].plot([], [], "--", label=r"$A_0 - \alpha Q^2$", **style.GREY)
    axes[1].set(ylabel="lost area $1 - A/A_0$", yscale="log")
    words, known = unit.label("tangential force $Q$"), unit.factor * force[rises]
    style.across(axes[0], known, words)
    style.across(axes[1], known[known > 0.01 * known.max()], words, "log")
    style.legend(axes[0], scene.title)
    return figure
