"""Figures of a dataset, in the width of a journal's column.

``draw`` gives a matplotlib Figure with a canvas of its own: nothing here needs a display or touches
pyplot. How pictures look is in ``pictures``, what the common ones are made of in ``panels``.
"""

from collections.abc import Callable

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from sim.analysis import engineering, is_steady, sweep_dims
from sim.analysis.scene import stays_held
from sim.plots.bond_laws import rest_of
from sim.plots.curves import Scene, line_handles, opening_handles, room_of, scene_along, speed_dim, spread_handles
from sim.plots.field import map_figure, maps_of, spectrum_figure
from sim.plots.friction import friction_figure, needs_stress
from sim.plots.loop import loop_figure, needs_course
from sim.plots.panels import (
    area_panel,
    energy_panel,
    further_panels,
    radius_panel,
    reference_handles,
    share_panel,
    stacked,
)
from sim.plots.profile import needs_contact, profile_figure
from sim.plots.style import STYLE, Unit, across, axis_scale, legend, symbol
from sim.plots.theories import needs_control, theories_figure


def _needs_speeds(dataset: xr.Dataset) -> None:
    if rest_of(dataset) is not None:
        raise ValueError("a rest and a start have two speeds only; draw the kind friction")
    if is_steady(dataset) and speed_dim(dataset) is None:
        raise ValueError('the speed neither changes in time nor is swept; ramp it: [drive] model = "ramp"')


def _curve_figure(dataset: xr.Dataset) -> Figure:
    """Area, energies and friction over the sliding speed: of a ramp, or of a sweep of steady speeds."""
    scene = scene_along(dataset, "t" if not is_steady(dataset) else str(speed_dim(dataset)))
    speeds = scene.all("speed_mean")
    scale = axis_scale(speeds)
    unit = Unit.of(speeds, "m/s", scale == "log")
    scene = scene.placed(unit.factor * speeds)
    figure = stacked(scene, [(1.9, share_panel), *further_panels(scene)])
    across(figure.axes[-1], scene.x, scale, "sliding speed $V$", unit.name, room_of(scene))
    return figure


def _time_figure(dataset: xr.Dataset) -> Figure:
    """Radius, area and energies over time; JKR's and Hertz's contacts only where what holds the sphere stays."""
    unit = Unit.of(dataset["t"].to_numpy(), "s")
    stays = stays_held(dataset)
    scene = _without_rest(scene_along(dataset, "t"), stays)
    scene = scene.placed(unit.factor * dataset["t"].to_numpy())
    figure = stacked(scene, [(1.5, radius_panel), (1.3, area_panel), (1.6, energy_panel)])
    closing = [*spread_handles(scene, "contact_radius"), *opening_handles(scene)]
    closing += reference_handles() if bool(stays.any()) else []
    legend(figure.axes[0], [*line_handles(scene), *closing])
    across(figure.axes[-1], scene.x, "linear", "time $t$", unit.name)
    return figure


def _without_rest(scene: Scene, stays: xr.DataArray) -> Scene:
    """Without the radii at rest of spheres that are moved: they are those at the start only.

    One record of them stays, at the largest radius reached: a point alone draws no line, and tells the panels
    the size of their unit.
    """
    largest = scene.found["contact_radius_mean"].max("t")
    first = xr.DataArray(np.arange(scene.found.sizes["t"]) == 0, dims="t")
    moved = {name: xr.where(stays, scene.found[name], largest.where(first)) for name in ("radius_jkr", "radius_hertz")}
    return scene._replace(found=scene.found.assign(moved)) if not bool(stays.all()) else scene


def _needs_sweep(dataset: xr.Dataset) -> None:
    if not sweep_dims(dataset):
        raise ValueError('nothing is swept; sweep a key: [sweep] "contact.load" = ["1 mN", "4 mN"]')


def _sweep_figure(dataset: xr.Dataset) -> Figure:
    """Radius, energies and friction against the swept key, one curve for each value of further keys.

    Means over the second half of the run where the speed is steady, else the values at its end.
    """
    key = dataset[sweep_dims(dataset)[0]]
    labels = key.dtype.kind not in "fi"
    values = np.arange(key.size, dtype=float) if labels else key.to_numpy().astype(float)
    scale = axis_scale(values) if not labels else "linear"
    unit = Unit(1.0, "") if labels else Unit.of(values, key.attrs["units"], scale == "log")
    scene = scene_along(dataset, str(key.name)).placed(unit.factor * values)
    if labels:
        scene = scene.apart()
    figure = stacked(scene, [(1.7, radius_panel), *further_panels(scene)])
    handles = [*line_handles(scene, "simulated"), *spread_handles(scene, "contact_radius"), *reference_handles()]
    legend(figure.axes[0], handles, "" if is_steady(dataset) else _at_the_end(dataset))
    words = f"{key.attrs.get('long_name', key.name)} {symbol(key)}".strip()
    beside = (0.5 * scene.category + 0.1) / max(float(np.ptp(scene.x)), 1.0)
    across(figure.axes[-1], scene.x, scale, words, unit.name, beside if labels else room_of(scene))
    if labels:
        figure.axes[-1].set_xticks(values, [str(value) for value in key.to_numpy()])
    return figure


def _at_the_end(dataset: xr.Dataset) -> str:
    """The last time and the speed then, which may differ between the points of the sweep."""
    speed = dataset["speed" if "speed" in dataset else "speed_mean"].isel(t=-1)
    ends = dict.fromkeys(engineering(float(end), "m/s") for end in (speed.min(), speed.max()))
    words = f"at the end: $t$ = {engineering(float(dataset['t'][-1]), 's')}, $V$ = {' to '.join(ends)}"
    return words.replace("-", "−")


#: What can be drawn, by name.
KINDS: dict[str, Callable[[xr.Dataset], Figure]] = {
    "curve": _curve_figure,
    "time": _time_figure,
    "sweep": _sweep_figure,
    "map": map_figure,
    "spectrum": spectrum_figure,
    "friction": friction_figure,
    "theories": theories_figure,
    "profile": profile_figure,
    "loop": loop_figure,
}

#: What a kind needs of a dataset: each raises ValueError with the cure where it is not there.
_NEEDS: dict[str, Callable[[xr.Dataset], object]] = {
    "curve": _needs_speeds,
    "sweep": _needs_sweep,
    "map": maps_of,
    "spectrum": maps_of,
    "friction": needs_stress,
    "theories": needs_control,
    "profile": needs_contact,
    "loop": needs_course,
}


def drawable(dataset: xr.Dataset) -> list[str]:
    """Kinds of figures whose needs a dataset meets."""
    return [kind for kind in KINDS if not _missing(dataset, kind)]


def _missing(dataset: xr.Dataset, kind: str) -> str:
    """What a dataset lacks for a kind of figure, with the cure; "" for nothing."""
    try:
        if kind in _NEEDS:
            _NEEDS[kind](dataset)
    except ValueError as fault:
        return str(fault)
    return ""


def _fitting(dataset: xr.Dataset) -> str:
    """The kind of figure that fits a dataset best."""
    if not _missing(dataset, "loop"):
        return "loop"
    if rest_of(dataset) is not None and not _missing(dataset, "friction"):
        return "friction"
    if not _missing(dataset, "curve"):
        return "curve"
    return "sweep" if sweep_dims(dataset) else "time"


def draw(dataset: xr.Dataset, kind: str | None = None) -> Figure:
    """Draw a figure of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    kind : str, optional
        One of ``KINDS``: "curve" (area with what each mechanism takes, energies and friction over
        speed), "time" (radius, area and energies over time), "loop" (load and radius over the displacement of
        what holds the sphere, where that moves), "sweep" (radius, energies and friction
        against the swept key), "map" (a stress map and its displacement), "spectrum" (measured
        against asked-for spectral density), "friction" (shear stress over speed with its maximum, or
        the static peak of a slider that rests and starts), "theories" (contact area by every theory over
        the shear stress), "profile" (pressure, surfaces and displacement across the contact). Without
        it "loop" where what holds the sphere moves, "friction" for a slider that rests and starts, "curve" where
        the speed changes or is swept, else "sweep" where something is, else "time".

    Returns
    -------
    Picture
        A matplotlib Figure, one column wide, pictures of two panels side by side two; save it by its
        ``savefig``, as PNG, PDF or SVG.

    Raises
    ------
    ValueError
        For an unknown kind, or one that the dataset cannot serve, with the cure and the kinds that it can.
    """
    kind = kind or _fitting(dataset)
    if kind not in KINDS:
        raise ValueError(f'there is no figure "{kind}"; known: {", ".join(KINDS)}')
    missing = _missing(dataset, kind)
    if missing:
        raise ValueError(f"{missing}; it can be drawn as: {', '.join(drawable(dataset))}")
    with mpl.rc_context(STYLE):
        return KINDS[kind](dataset)
