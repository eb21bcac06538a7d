"""The figure that everyone draws: pressure, surfaces and tangential displacement across the contact."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import engineering, setting
from sim.laws import jkr, profiles
from sim.plots.style import (
    BOTH,
    LINES,
    REFERENCE,
    WIDE,
    Unit,
    contact_circle,
    first_point,
    legend,
    letter,
    picture,
    recorded,
)

#: Points of a profile on one side, and how far it goes in contact radii.
_POINTS, _REACH = 1500, 2.0

#: Points on a side of the map.
_MAP = 201


class Shape(NamedTuple):
    """A contact: radius, indentation [m], shear stress [Pa], and the bodies that it is between."""

    radius: float
    indentation: float
    stress: float
    sphere_radius: float
    modulus: float
    shear_modulus: float
    poisson_ratio: float

    def pressure(self, r: np.ndarray) -> np.ndarray:
        """Normal stress at distances from the axis [Pa]."""
        return np.asarray(profiles.pressure(r, self.radius, self.indentation, self.sphere_radius, self.modulus))

    def surface(self, r: np.ndarray) -> np.ndarray:
        """Displacement of the half-space, into it [m]."""
        return np.asarray(profiles.normal_displacement(r, self.radius, self.indentation, self.sphere_radius))

    def gap(self, r: np.ndarray) -> np.ndarray:
        """Distance between the surfaces [m]."""
        return np.asarray(profiles.gap(r, self.radius, self.indentation, self.sphere_radius))


def needs_contact(dataset: xr.Dataset) -> None:
    """Refuse a dataset whose first member is never in contact."""
    if not bool(np.any(_member(dataset, "contact_radius", first_point(dataset)[0]) > 0.0)):
        raise ValueError("the contact that would be drawn is never closed; raise the load or the indentation")


def _member(dataset: xr.Dataset, name: str, at: dict[str, int]) -> np.ndarray:
    """An observable of the first member over time, or its mean where only that was recorded."""
    return recorded(dataset, name).isel({"member": 0} | at, missing_dims="ignore").to_numpy()


class _Drawn(NamedTuple):
    """The last closed contact with its time [s] and speed [m/s], and the one at rest if there is one."""

    last: Shape
    rest: Shape | None
    time: float
    speed: float


def shapes_of(dataset: xr.Dataset) -> _Drawn:
    """Contacts of the first member at the first point of the sweep: the last closed one, and at rest."""
    at = first_point(dataset)[0]
    radius, depth, stress, speed = (
        _member(dataset, name, at) for name in ("contact_radius", "indentation", "shear_stress", "speed")
    )
    k = int(np.flatnonzero(radius > 0.0)[-1])
    names = ("contact_modulus", "effective_shear_modulus", "effective_poisson_ratio")
    sphere = float(setting(dataset, "sphere.radius").isel(at, missing_dims="ignore"))
    bodies = (sphere, *(float(dataset[name].isel(at)) for name in names))
    last = Shape(float(radius[k]), float(depth[k]), float(stress[k]), *bodies)
    work = float(setting(dataset, "adhesion.work").isel(at, missing_dims="ignore"))
    full = np.ravel(dataset["radius_at_rest"].isel(at).to_numpy())[0]
    rest = None
    if full > 0.0:
        rest = Shape(float(full), float(jkr.indentation_at_radius(full, work, sphere, bodies[1])), 0.0, *bodies)
    return _Drawn(last, rest, float(dataset["t"][k]), float(speed[k]))


def profile_figure(dataset: xr.Dataset) -> Figure:
    """Pressure, surfaces and tangential displacement across the contact at the last time.

    The surfaces are cut along the axis of the sphere; heights are not to the scale of the lengths. The
    shear stress is the mean one, uniform over the contact; without any its displacement is left out.
    """
    drawn = shapes_of(dataset)
    reach = _REACH * max(shape.radius for shape in (drawn.last, drawn.rest) if shape is not None)
    length = Unit.of(np.array([reach]), "m")
    rows = 2 if drawn.last.stress != 0.0 else 1
    figure = picture(WIDE, 0.35 + 2.4 * rows)
    axes = list(figure.subplots(rows, 2, squeeze=False).ravel())
    letter(axes)
    _pressure_panel(axes[0], drawn, reach, length)
    _surface_panel(axes[1], drawn, reach, length)
    if rows == 2:
        _displacement_panel(axes[2], drawn.last, reach, length)
        _map_panel(figure, axes[3], drawn.last, reach, length)
    words = [first_point(dataset)[1], f"$t$ = {engineering(drawn.time, 's')}"]
    if "$V$" not in words[0]:
        words.append(f"$V$ = {engineering(drawn.speed, 'm/s')}")
    axes[0].plot([], [], color=BOTH, label=", ".join(filter(None, words)).replace("-", "−"))
    if drawn.rest is not None:
        axes[0].plot([], [], color=REFERENCE, linestyle="--", linewidth=0.9, label="at rest (JKR)")
    legend(axes[0])
    return figure


def _shown(drawn: _Drawn) -> list[tuple[Shape, dict[str, Any]]]:
    """Both contacts with their lines, the one at rest beneath."""
    last: list[tuple[Shape, dict[str, Any]]] = [(drawn.last, {"color": BOTH})]
    if drawn.rest is None:
        return last
    return [(drawn.rest, {"color": REFERENCE, "linestyle": "--", "linewidth": 0.9}), *last]


def radial(shape: Shape, reach: float) -> np.ndarray:
    """Distances from the axis up to ``reach`` [m], crowded on both sides of the edge and with the edge itself."""
    near = np.geomspace(1e-6, 0.5, 200)
    r = np.concatenate([np.linspace(0.0, reach, _POINTS), shape.radius * (1.0 - near), shape.radius * (1.0 + near)])
    return np.unique(np.append(r[r <= reach], shape.radius))


def _mirrored(r: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both sides of the axis."""
    return np.concatenate([-r[:0:-1], r]), np.concatenate([values[:0:-1], values])


def _pressure_panel(panel: Axes, drawn: _Drawn, reach: float, length: Unit) -> None:
    middle = max((float(shape.pressure(np.zeros(1))[0]) for shape, _ in _shown(drawn)), key=abs)
    unit = Unit.of(np.array([middle]), "Pa")
    panel.axhline(0.0, color=REFERENCE, linewidth=0.5, zorder=1)
    for shape, line in _shown(drawn):
        r = radial(shape, reach)
        values = np.where(r == shape.radius, np.nan, shape.pressure(r))  # tension has no bound at the edge
        x, p = _mirrored(r, values)
        panel.plot(length.factor * x, unit.factor * p, **line)
    size = unit.factor * abs(middle)
    panel.set_ylim((-1.6 * size, 1.15 * size) if middle > 0.0 else (-4.0 * size, 0.5 * size))
    panel.set_ylabel(unit.label("normal pressure $p$"))
    _lengthwise(panel, reach, length, "distance from the axis $r$")


def _lengthwise(panel: Axes, reach: float, length: Unit, words: str) -> None:
    panel.set_xlim(-length.factor * reach, length.factor * reach)
    panel.set_xlabel(length.label(words))


def _surface_panel(panel: Axes, drawn: _Drawn, reach: float, length: Unit) -> None:
    """Sphere and half-space, cut along the axis; between them the gap."""
    heights = []
    for shape, line in _shown(drawn):
        r = radial(shape, reach)
        heights.append((shape, line, r, -shape.surface(r), -shape.surface(r) + shape.gap(r)))
    unit = Unit.of(np.concatenate([upper for *_, upper in heights]), "m")
    for shape, line, r, lower, upper in heights:
        x, z = _mirrored(r, unit.factor * lower)
        panel.plot(length.factor * x, z, **line)
        x, ball = _mirrored(r, unit.factor * upper)
        panel.plot(length.factor * x, ball, **line)
        if shape is drawn.last:
            bottom = float(np.min(ball)) - 0.35 * float(np.ptp(ball))
            panel.fill_between(length.factor * x, bottom, z, color=LINES[6], alpha=0.18, linewidth=0)
            panel.set_ylim(bottom, float(np.max(ball)))
    panel.text(0.5, 0.8, "sphere", transform=panel.transAxes, ha="center", fontsize=7)
    panel.text(0.5, 0.06, "half-space", transform=panel.transAxes, ha="center", fontsize=7)
    panel.set_ylabel(unit.label("height $z$"))
    _lengthwise(panel, reach, length, "distance from the axis $r$")


def _displacement_panel(panel: Axes, shape: Shape, reach: float, length: Unit) -> None:
    """Tangential displacement along and across the sliding direction; the edge as thin lines."""
    distance = reach * np.linspace(-1.0, 1.0, 801)
    found = profiles.tangential_profiles(
        distance, shape.radius, shape.stress, shape.shear_modulus, shape.poisson_ratio
    )  # fmt: skip
    unit = Unit.of(np.concatenate(found), "m")
    for values, style, words in zip(found, ("-", "--"), ("along $x$, the sliding", "across, along $y$"), strict=True):
        panel.plot(length.factor * distance, unit.factor * values, style, color=BOTH, label=words)
    for edge in (-shape.radius, shape.radius):
        panel.axvline(length.factor * edge, color=REFERENCE, linewidth=0.5, zorder=1)
    legend(panel)
    panel.set_ylabel(unit.label("tangential displacement"))
    _lengthwise(panel, reach, length, "distance from the axis")


def _map_panel(figure: Figure, panel: Axes, shape: Shape, reach: float, length: Unit) -> None:
    """Tangential displacement of the surface around the contact circle."""
    extent = reach / shape.radius
    x, moved = profiles.tangential_map(
        shape.radius, shape.stress, shape.shear_modulus, shape.poisson_ratio, points=_MAP, extent=extent
    )  # fmt: skip
    unit = Unit.of(moved, "m")
    side = length.factor * (x[-1] + 0.5 * (x[1] - x[0]))
    around = (-side, side, -side, side)
    image = panel.imshow(unit.factor * moved.T, cmap="viridis", origin="lower", extent=around)
    levels = np.linspace(np.min(moved), np.max(moved), 8)[1:-1]
    at = length.factor * x
    panel.contour(at, at, unit.factor * moved.T, unit.factor * levels, colors="white", linewidths=0.4, linestyles="-")
    figure.colorbar(image, ax=panel, pad=0.02).set_label(unit.label("displacement along $x$"))
    contact_circle(panel, length.factor * shape.radius)
    panel.set_xlabel(length.label("$x$"))
    panel.set_ylabel(length.label("$y$"))
