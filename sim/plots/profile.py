"""The figure that everyone draws: pressure, surfaces and tangential displacement across the contact."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sim.analysis import setting
from sim.laws import halfspace, jkr
from sim.plots import style

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
        return np.asarray(halfspace.pressure(r, self.radius, self.indentation, self.sphere_radius, self.modulus))

    def surfaces(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights of half-space and sphere at distances from the axis [m]."""
        given = r, self.radius, self.indentation, self.sphere_radius
        low = -np.asarray(halfspace.normal_displacement(*given))
        return low, low + np.asarray(halfspace.gap(*given))

    def distances(self, reach: float) -> np.ndarray:
        """Distances on both sides of the axis, crowded on both sides of the edge and with the edge itself [m]."""
        near = np.geomspace(1e-6, 0.5, 200)
        r = np.concatenate([np.linspace(0.0, reach, _POINTS), self.radius * (1.0 - near), self.radius * (1.0 + near)])
        r = np.unique(np.append(r[r <= reach], self.radius))
        return np.append(-r[:0:-1], r)


def _member(dataset: xr.Dataset, name: str, at: dict[str, int]) -> np.ndarray:
    """An observable of the first member over time, or its mean where only that was recorded."""
    return style.recorded(dataset, name).isel({"member": 0} | at, missing_dims="ignore").to_numpy()


#: Contacts with the look of their lines.
_Shown = list[tuple[Shape, dict[str, Any]]]


def shapes_of(dataset: xr.Dataset, time: float | None = None) -> tuple[_Shown, float, float]:
    """Contacts of the first member at the first point of the sweep: the last closed one, and any at rest.

    In place of the last one that of the record nearest to a time [s]. Also the time [s] and speed [m/s] of the former.

    Raises
    ------
    ValueError
        If the member is never in contact, or not at that time.
    """
    at = style.first_point(dataset)[0]
    names = ("contact_radius", "indentation", "shear_stress", "speed")
    radius, depth, stress, speed = (_member(dataset, name, at) for name in names)
    if not np.any(radius > 0.0):
        raise ValueError("the contact that would be drawn is never closed; raise the load or the indentation")
    k = int(np.flatnonzero(radius > 0.0)[-1] if time is None else np.abs(dataset["t"].to_numpy() - time).argmin())
    if not radius[k] > 0.0:
        raise ValueError(
            f"the contact is open at t = {style.text_of(float(dataset['t'][k]), 's')}; choose another time"
        )
    sphere, work = (style.number_at(setting(dataset, key), at) for key in ("sphere.radius", "adhesion.work"))
    moduli = ("contact_modulus", "effective_shear_modulus", "effective_poisson_ratio")
    bodies = (sphere, *(style.number_at(dataset[name], at) for name in moduli))
    last = Shape(float(radius[k]), float(depth[k]), float(stress[k]), *bodies)
    full = float(np.ravel(dataset["radius_at_rest"].isel(at))[0])
    shown: _Shown = [(last, {"color": style.BOTH})]
    if full > 0.0:
        rest = Shape(full, float(jkr.indentation_at_radius(full, work, sphere, bodies[1])), 0.0, *bodies)
        shown.append((rest, style.GREY | {"linestyle": "--", "label": "at rest (JKR)"}))
    return shown, float(dataset["t"][k]), float(speed[k])


def profile_figure(dataset: xr.Dataset, at: float | None = None) -> Figure:
    """Pressure, surfaces and tangential displacement across the contact at the last time, or another.

    The surfaces are cut along the axis of the sphere; heights are not to the scale of the lengths. The
    shear stress is the mean one, uniform over the contact; without any its displacement is left out.
    """
    shown, time, speed = shapes_of(dataset, at)
    last, reach = shown[0][0], _REACH * max(shape.radius for shape, _ in shown)
    length = style.Unit.of(np.array([reach]), "m")
    count = 2 if last.stress != 0.0 else 1
    figure, axes = style.pairs(0.35 + 2.4 * count, count)
    _pressure_panel(axes[0], shown, reach, length)
    _surface_panel(axes[1], shown, reach, length)
    radial = "distance from the axis $r$"
    for panel, words in zip(axes, (radial, radial, "distance from the axis"), strict=False):
        style.across(panel, length.factor * np.array([-reach, reach]), length.label(words))
    if count == 2:
        _displacement_panel(axes[2], last, reach, length)
        _map_panel(figure, axes[3], last, reach, length)
    told = [style.first_point(dataset)[1], f"$t$ = {style.text_of(time, 's')}"]
    if "$V$" not in told[0]:
        told.append(f"$V$ = {style.text_of(speed, 'm/s')}")
    axes[0].lines[0].set_label(", ".join(filter(None, told)))
    style.legend(axes[0])
    return figure


def _pressure_panel(panel: Axes, shown: _Shown, reach: float, length: style.Unit) -> None:
    middle = max((float(shape.pressure(np.zeros(1))[0]) for shape, _ in shown), key=abs)
    factor = style.in_unit(panel.yaxis, "normal pressure $p$", np.array([middle]), "Pa")
    for shape, line in shown:
        x = shape.distances(reach)
        r = np.abs(x)
        pressure = np.where(r == shape.radius, np.nan, shape.pressure(r))  # tension has no bound at the edge
        panel.plot(length.factor * x, factor * pressure, **line)
    panel.axhline(0.0, **style.GUIDE)
    size = factor * abs(middle)
    panel.set_ylim((-1.6 * size, 1.15 * size) if middle > 0.0 else (-4.0 * size, 0.5 * size))


def _surface_panel(panel: Axes, shown: _Shown, reach: float, length: style.Unit) -> None:
    """Sphere and half-space, cut along the axis; between them the gap."""
    x = [shape.distances(reach) for shape, _ in shown]
    heights = [shape.surfaces(np.abs(own)) for (shape, _), own in zip(shown, x, strict=True)]
    factor = style.in_unit(panel.yaxis, "height $z$", np.concatenate([upper for _, upper in heights]), "m")
    for (_, line), own, surfaces in zip(shown, x, heights, strict=True):
        panel.plot(length.factor * own, factor * np.transpose(surfaces), **line)
    low, ball = factor * np.array(heights[0])
    bottom = float(np.min(ball)) - 0.35 * float(np.ptp(ball))
    panel.fill_between(length.factor * x[0], bottom, low, color=style.LINES[6], alpha=0.18, linewidth=0)
    panel.set_ylim(bottom, float(np.max(ball)))
    panel.text(0.5, 0.8, "sphere", transform=panel.transAxes, ha="center", fontsize=7)
    panel.text(0.5, 0.06, "half-space", transform=panel.transAxes, ha="center", fontsize=7)


def _displacement_panel(panel: Axes, shape: Shape, reach: float, length: style.Unit) -> None:
    """Tangential displacement along and across the sliding direction; the edge as thin lines."""
    distance = reach * np.linspace(-1.0, 1.0, 801)
    bodies = shape.shear_modulus, shape.poisson_ratio
    found = halfspace.tangential_profiles(distance, shape.radius, shape.stress, *bodies)
    factor = style.in_unit(panel.yaxis, "tangential displacement $u_x$", np.concatenate(found), "m")
    for values, line, words in zip(found, ("-", "--"), ("along $x$, the sliding", "across, along $y$"), strict=True):
        panel.plot(length.factor * distance, factor * values, line, color=style.BOTH, label=words)
    for edge in (-shape.radius, shape.radius):
        panel.axvline(length.factor * edge, **style.GUIDE)
    style.legend(panel)


def _map_panel(figure: Figure, panel: Axes, shape: Shape, reach: float, length: style.Unit) -> None:
    """Tangential displacement of the surface around the contact circle."""
    bodies = shape.shear_modulus, shape.poisson_ratio
    x, moved = halfspace.tangential_map(shape.radius, shape.stress, *bodies, points=_MAP, extent=reach / shape.radius)
    unit = style.Unit.of(moved, "m")
    x, moved = length.factor * x, unit.factor * moved.T
    side = x[-1] + 0.5 * (x[1] - x[0])
    image = panel.imshow(moved, cmap="viridis", origin="lower", extent=(-side, side, -side, side))
    levels = MaxNLocator(7).tick_values(np.min(moved), np.max(moved))
    lines = panel.contour(x, x, moved, levels, colors="white", linewidths=0.4, linestyles="-")
    panel.clabel(lines, fmt="%g", fontsize=5)
    figure.colorbar(image, ax=panel, pad=0.02).set_label(unit.label("displacement along $x$, $u_x$"))
    style.contact_circle(panel, length.factor * shape.radius)
    panel.set_xlabel(length.label("$x$"))
    panel.set_ylabel(length.label("$y$"))
