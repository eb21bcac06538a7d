"""Figures of sliding: bond stress over speed with closed forms, starts from rest, creep, the way to sliding."""

import contextlib
import re
from typing import Any, cast

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.laws.incipient import Incipient
from sim.plots import style
from sim.plots.curves import (
    Scene,
    contact_curves,
    over_key,
    over_speed,
    scene_along,
    series,
    stacked,
    statement_curves,
)
from sim.plots.measured import Line, Measured
from sim.read import Run, control, is_steady, peaks_after_holds, setting, sweep_dims
from sim.read.dataset import MEMBERS, ensemble_mean, stays_held, word
from sim.read.events import incipient_law
from sim.read.observables import with_slips
from sim.read.over_speed import speed_dim
from sim.units.errors import BadInput

#: A file that a scenario names.
_FILE = re.compile(r'"file": *"[^"]')


def scenario_at(dataset: xr.Dataset, point: dict[str, int]) -> Any:
    """Return the scenario of a point of the sweep; None if it cannot be read.

    No file that a dataset names is read.
    """
    from sim.ensemble.dataset import scenario_of  # heavy: for closed forms alone

    if _FILE.search(str(dataset.attrs.get("scenario_resolved"))):
        return None
    with contextlib.suppress(BadInput, KeyError, ValueError, TypeError):
        scenario = scenario_of(dataset.attrs)
        chosen = dataset.isel(dict.fromkeys(sweep_dims(dataset), 0) | point)
        keys = [key for axis in scenario.sweep for key in axis.keys]
        return scenario.with_values({key: float(setting(chosen, key)) for key in keys})
    return None


def steady_law(
    dataset: xr.Dataset, point: dict[str, int], speed: np.ndarray
) -> np.ndarray:
    """Return shear stress [Pa], the viscous one included, and bond fraction [1] in steady sliding at speeds [m/s].

    The stress has the sign of the speed. Both are nan if the scenario cannot be read.
    """
    scenario = scenario_at(dataset, point)
    if scenario is None:
        return np.full((2, speed.size), np.nan)
    steady = scenario.population.steady(speed)
    stress = np.copysign(steady.strength, speed) + scenario.drive.viscosity * speed
    return np.stack([stress, steady.fraction])


# -- behind a spring, or under a force ----------------------------------------------------------

#: Speeds of a map, and at which its boundary is drawn.
_CELLS, _FINE = 28, 200


def needs_force(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force is prescribed."""
    if not (word(dataset, "drive.model", "") == "force").all():
        raise ValueError('no force is prescribed; set [drive] model = "force"')


def creep_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Displacement and speed of the slider over time under a prescribed force. A dotted line marks a runaway."""
    later = with_slips(dataset).isel(t=slice(1, None))
    scene = scene_along(later, "t")._replace(measured=data)
    scene = scene.placed(
        "t", later["t"].to_numpy(), "time under the force $t$", "s", "log"
    )
    position, speed = (
        series("slider_position", "displacement $x$", "m"),
        series("speed", "speed $V$", "m/s"),
    )
    figure, axes = stacked(scene, [(1.8, position), (1.6, speed)])
    for panel in axes[:2]:
        style.upward(panel)
        _mark_runaways(panel, scene, dataset)
    style.legend(axes[0], scene.title)
    return figure


def _mark_runaways(panel: Axes, scene: Scene, dataset: xr.Dataset) -> None:
    """Draw the time of each runaway, the first one of several members, which the stepper records between records."""
    if "runaway_time" not in dataset:
        return
    first = ensemble_mean(dataset["runaway_time"].isel(t=-1, drop=True))
    if MEMBERS in first.dims:
        first = first.min(MEMBERS)
    for line in scene.lines:
        time = scene.unit.factor * float(first.isel(line.point, missing_dims="ignore"))
        if not np.isfinite(time):
            continue
        label = "runaway" if MEMBERS not in dataset.dims else "first runaway"
        if not np.any(np.isfinite(scene.values("speed", line))):
            # a motion that ends before the second record has no curve
            label = f"{line.label}: {label}"
        panel.axvline(
            time, color=line.colour, linestyle=":", linewidth=1.0, label=label
        )
        panel.set_xlim(left=min(panel.get_xlim()[0], 0.8 * time))


def needs_map(dataset: xr.Dataset) -> None:
    """Refuse a dataset that is no sweep of springs over stage speeds."""
    if "stage_speed" not in dataset:
        raise ValueError(
            'no stage pulls through a spring; set [drive] model = "spring"'
        )
    if (
        style.swept(dataset) != ["drive_stiffness"]
        or not (dataset["stage_speed"].isel(t=-1) > 0.0).all()
    ):
        cure = '[sweep] "drive.stiffness" = {from = "10 N/m", to = "1 kN/m", count = 9, scale = "log"}'
        raise ValueError(
            f"a map needs a sweep of only the spring stiffness under a ramped stage; {cure}"
        )


def stability_figure(dataset: xr.Dataset) -> Figure:
    """Force amplitude of the spring over speed and stiffness, at increasing and decreasing speed, with theory."""
    force = style.mean_of(
        dataset.isel({MEMBERS: slice(0, 1)}, missing_dims="ignore"), "spring_force"
    ).transpose(..., "t")
    speed = (
        dataset["stage_speed"]
        .isel({MEMBERS: 0, "drive_stiffness": 0}, missing_dims="ignore")
        .to_numpy()
    )
    stiffness = dataset["drive_stiffness"].to_numpy()
    turn = int(np.argmax(speed)) + 1
    legs = {
        "increasing speed": slice(1, turn),
        "decreasing speed": slice(turn - 1, None),
    }
    legs = {words: leg for words, leg in legs.items() if speed[leg].size > _CELLS}
    edges = np.geomspace(np.min(speed[1:]), np.max(speed), _CELLS + 1)
    pace = style.Unit.of(edges, "m/s", logarithmic=True)
    hard = style.Unit.of(stiffness, "N/m", logarithmic=True)
    steps = np.sqrt(stiffness[1:] * stiffness[:-1])
    rows = np.concatenate(
        [[stiffness[0] ** 2 / steps[0]], steps, [stiffness[-1] ** 2 / steps[-1]]]
    )
    figure, axes = style.pairs(2.6, shared=True) if len(legs) > 1 else style.rows([2.6])
    fine = np.geomspace(edges[0], edges[-1], _FINE)
    boundary = _boundary(dataset, fine)
    swings = [
        _swings(force.to_numpy()[:, leg], speed[leg], edges) for leg in legs.values()
    ]
    # pale where sliding is steady, and nowhere as dark as the line of the theory
    look: Any = {"cmap": style.part_of("YlOrRd", 0.02, 0.75), "rasterized": True}
    look |= {"vmin": np.nanmin(swings), "vmax": np.nanmax(swings)}
    line: Any = {"color": style.BONDS, "linewidth": 1.4}
    line["label"] = "theory: unstable below"
    x, label = pace.factor * edges, pace.label("speed of the stage $V$")
    for panel, words, swing in zip(axes, legs, swings, strict=True):
        mesh = panel.pcolormesh(x, hard.factor * rows, swing, **look)
        panel.plot(pace.factor * fine, hard.factor * boundary, **line)
        panel.set(yscale="log", ylim=hard.factor * rows[[0, -1]])
        style.across(panel, x, label, "log")
        style.legend(panel, words)
    axes[0].set_ylabel(hard.label("stiffness of the spring $K$"))
    figure.colorbar(mesh, ax=axes, label="force amplitude (normalised)", pad=0.02)
    return figure


def _swings(force: np.ndarray, speed: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Return the range of each row of forces over its largest, in each cell of the speed."""
    from scipy.stats import binned_statistic  # heavy: for this figure alone

    def swing(forces: np.ndarray) -> float:
        return float(1.0 - np.min(forces) / np.max(forces)) if len(forces) else np.nan

    within = np.clip(speed, edges[0], edges[-1])
    return np.asarray(binned_statistic(within, np.abs(force), swing, edges).statistic)


def _boundary(dataset: xr.Dataset, speed: np.ndarray) -> np.ndarray:
    """Return the stiffness below which steady sliding is unstable [N/m], nan where it never is or nothing is known."""
    from sim.ensemble.diagnosis import slider_body  # heavy: for this figure alone

    scenario = scenario_at(dataset, {})
    if scenario is None:
        return np.full(speed.shape, np.nan)
    onset = scenario.population.onset(speed, slider_body(scenario, speed))
    return np.where(onset.stiffness > 0.0, onset.stiffness, np.nan)


def needs_pull(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force grows from rest."""
    if "spring_force" not in dataset:
        raise ValueError(
            'nothing pulls the slider; add a spring: [drive] model = "spring"'
        )
    force = style.mean_of(dataset, "spring_force")
    if (abs(force.isel(t=0)) > 0.01 * abs(force).max("t")).any():
        raise ValueError(
            'the force does not begin at zero; start at rest: [drive] start = "rest"'
        )
    if not bool(stays_held(dataset).all()):
        raise ValueError(
            "the mount also changes the contact area: set a constant contact.load"
        )
    if not (style.mean_of(dataset, "contact_area").isel(t=0) > 0.0).all():
        raise ValueError(
            "the contact is open at the start; begin with a closed contact"
        )


#: Exponents of the loss of area by the tangential force that count as a square.
_SQUARE = (1.7, 2.3)
#: Records of which each half has a slope.
_FEWEST = 4


def exponent_of(force: np.ndarray, area: np.ndarray, top: int) -> float:
    """Return the exponent p of a loss of area [m^2] that grows as Q^p, up to half of the force at a record.

    It is the slope of the logarithms. It is nan if no power describes the points: the area is not lost at each of them,
    or the slopes at smaller and at larger forces differ by more than the exponents of a square may.

    >>> force = np.linspace(0.0, 1.0, 101)
    >>> round(exponent_of(force, 2.0 - 0.1 * force**1.5, 100), 3)
    1.5
    >>> exponent_of(force, 2.0 + 0.1 * force - 0.3 * force**2, 100)
    nan
    """
    loss = area[0] - area[:top]
    small = (force[:top] <= 0.5 * force[top]) & (force[:top] > 0.0)
    if np.sum(small) < _FEWEST or not np.all(loss[small] > 0.0):
        return np.nan
    share, lost = np.log(force[:top][small]), np.log(loss[small])
    order = np.argsort(share)
    halves = np.array_split(order, 2)
    low, high = (np.polyfit(share[half], lost[half], 1)[0] for half in halves)
    if not abs(high - low) <= _SQUARE[1] - _SQUARE[0]:
        return np.nan
    return float(np.polyfit(share, lost, 1)[0])


def incipient_figure(dataset: xr.Dataset, absolute: bool = False) -> Figure:
    """Contact area over the tangential force before sliding, and the law A0 − αQ² if the loss grows as a square.

    Law and exponent are fitted by least squares up to half of the largest force, and an exponent is stated only if a
    power of the force describes the loss there. If the scenario has the table
    ``[incipient]``, its empirical law and the theory of a sticking contact under a load are drawn instead.
    """
    scene = scene_along(dataset, "t")
    force, area = np.abs(scene.all("spring_force")), scene.all("contact_area")
    unit = style.Unit.of(force, "N")
    figure, (panel,) = style.rows([2.4])
    panel.set_ylabel("contact area $A/A_0$")
    factor, known = 1.0, []
    if absolute:
        factor = style.in_unit(panel.yaxis, "contact area $A$", area, "m^2")
    for line in scene.lines:
        force_of, area_of = force[line.number], area[line.number]
        top, alpha = incipient_law(force_of, area_of)
        power = exponent_of(force_of, area_of, top)
        force_of, area_of = force_of[: top + 1], area_of[: top + 1]
        known.append(unit.factor * force_of)
        scale = factor if absolute else 1.0 / area_of[0]
        words = f"loss as $Q^{{{power:.2f}}}$" if np.isfinite(power) else ""
        stated = _stated_laws(dataset, line.point, area_of[0], force_of)
        for look, name, areas in stated:
            look = look | {"color": line.colour, "linewidth": 0.9}
            panel.plot(known[-1], scale * areas, **look)
            panel.plot([], [], **look | {"color": style.BOTH}, label=name)
        if not stated and _SQUARE[0] <= power <= _SQUARE[1]:
            words += rf", $\alpha$ = {1e6 * alpha:.3g} mm$^2$/N$^2$"
            law = scale * (area_of[0] - alpha * force_of**2)
            look = {} if scene.single else {"color": line.colour}
            panel.plot(known[-1], law, "--", **style.GREY | look)
            panel.plot([], [], "--", label=r"$A_0 - \alpha Q^2$", **style.GREY)
        label = ": ".join(filter(None, ["" if scene.single else line.label, words]))
        panel.plot(known[-1], scale * area_of, color=line.colour, label=label or None)
    forces = np.concatenate(known)
    style.across(panel, forces, unit.label("tangential force $Q$"))
    style.legend(panel, scene.title)
    return figure


def _stated_laws(
    dataset: xr.Dataset, point: dict[str, int], area: float, force: np.ndarray
) -> list[tuple[dict[str, Any], str, np.ndarray]]:
    """Return look, name and areas [m^2] of the empirical law of a scenario, and of the theory beside it.

    ``area`` [m^2] is that at rest. There are none without the table ``[incipient]``. The theory is that of full stick
    at a load.
    """
    if "incipient_shrinkage" not in dataset:
        return []
    from sim.laws import theories  # heavy: for this figure alone

    def number(key: str) -> float:
        return float(setting(dataset, key).isel(point, missing_dims="ignore"))

    keys = "shrinkage", "area", "exponent"
    law = Incipient(**{key: number(f"incipient.{key}") for key in keys})
    result: list[tuple[dict[str, Any], str, np.ndarray]] = [
        (
            {"linestyle": "--"},
            r"empirical, $A_0 - \alpha Q^2$",
            law.area_at(area, force),
        )
    ]
    if control(dataset).kind == "load" and "solid_thickness" not in dataset:
        modulus, ratio = (
            float(dataset[name].isel(point, missing_dims="ignore"))
            for name in ("contact_modulus", "effective_poisson_ratio")
        )
        work, size = number("adhesion.work"), number("sphere.radius")
        radius = theories.savkoor_briggs_at_load(
            number("contact.load"), work, force, size, modulus, ratio
        )
        look = {"linestyle": ":"}
        result.append((look, "Savkoor and Briggs, full stick", np.pi * radius**2))
    return result


# -- peaks after holds ---------------------------------------------------------------------------


def needs_holds(dataset: xr.Dataset) -> None:
    """Refuse a dataset without friction peaks after holds of different times."""
    each = peaks_after_holds(dataset)
    if "time_held" not in each or np.unique(each["time_held"]).size < 3:
        cure = '[drive] model = "holds" with holds = ["0.1 s", "1 s", "10 s"]'
        raise ValueError(f"there are no holds of different times; set {cure}")
    if each["peak_after_hold"].isnull().all():
        raise ValueError(
            "no friction peak follows a hold; make drive.slide longer, or the clock step shorter"
        )


def holds_figure(dataset: xr.Dataset) -> Figure:
    """Friction peak after a hold over the time held, with its growth per decade or the time after which it saturates.

    Bars are standard errors over the members.
    """
    run, scene = Run(dataset), scene_along(dataset, "t")
    peak, held = (
        run.events[f"phase_{name}"] for name in ("peak_after_hold", "time_held")
    )
    figure, (panel,) = style.rows([2.4])
    factor = style.in_unit(
        panel.yaxis, "friction peak after a hold $F_s$", np.ravel(peak.value), "N"
    )
    unit, has_bars = style.Unit.of(np.ravel(held.value), "s", logarithmic=True), False
    for line in scene.lines:
        peaks, errors, times = (
            np.ravel(each.isel(line.point, missing_dims="ignore"))
            for each in (
                peak.value,
                0.0 * peak.value + cast(xr.DataArray, peak.sem),
                held.value,
            )
        )
        order = np.argsort(times)[: np.isfinite(times).sum()]
        x, y = unit.factor * times[order], factor * peaks[order]
        words = _ageing_in_words(run, line)
        label = ": ".join(filter(None, ["" if scene.single else line.label, words]))
        look: Any = {"color": line.colour, "marker": "o", "markersize": 3.5}
        panel.plot(x, y, label=label or None, **look)
        bars = factor * errors[order]
        if np.any(bars > 0.0):
            name = None if has_bars else style.ERROR
            panel.errorbar(x, y, bars, fmt="none", ecolor=line.colour, label=name)
            has_bars = True
    reach = unit.factor * np.ravel(held.value)
    style.across(panel, reach, unit.label("time held $t_h$"), "log", room=0.03)
    panel.set_ylim(bottom=0.0)
    style.legend(panel, scene.title)
    return figure


def _ageing_in_words(run: Run, line: Line) -> str:
    """Return what the peaks after the holds at a point of the sweep say of ageing, "" if they say nothing."""
    if "hold_growth" not in run.events:
        return ""
    growth, saturation = (
        float(run.events[name].value.isel(line.point, missing_dims="ignore"))
        for name in ("hold_growth", "hold_saturation")
    )
    if np.isfinite(growth):
        return f"grows by {style.rounded(growth, 'N')} per decade"
    if np.isfinite(saturation):
        return f"saturates after {style.rounded(saturation, 's')}"
    return ""


# -- stress of the bonds ------------------------------------------------------------------------

#: Speeds at which a closed form is drawn.
_CURVE = 600

#: Units of the place of a peak.
_SI = {"speed": "m/s", "time": "s"}

#: Look of a closed form: grey that shows on a black line and beside it.
_LAW: Any = {"color": "#BBBBBB", "linewidth": 0.7, "zorder": 3}
_RING: Any = style.HOLLOW | {"markersize": 5.0, "mfc": "none", "mew": 0.9, "zorder": 4}


def needs_stress(dataset: xr.Dataset) -> None:
    """Refuse a dataset without shear stress, or with one speed only."""
    rest = dataset.get("drive_rest")
    if rest is not None and not (dataset["t"] > rest).any():
        raise ValueError(
            "the run ends before the slider starts; set clock.duration above drive.rest"
        )
    if not (style.recorded(dataset, "shear_stress") != 0.0).any():
        raise ValueError(
            'the bonds have no shear stress; add one, such as [bonds] stress = "0.3 MPa"'
        )
    if (word(dataset, "drive.model", "") == "force").any():
        raise ValueError(
            "a stress over speed needs a prescribed speed, but a force is given; see the figure creep"
        )
    if rest is None and is_steady(dataset) and speed_dim(dataset) is None:
        cure = 'ramp it: [drive] model = "ramp", or rest and start: [drive] model = "start"'
        raise ValueError(
            f"stress is drawn over the speed, but the speed is constant; {cure}"
        )


def stress_figure(
    dataset: xr.Dataset, data: Measured | None = None, ax: Axes | None = None
) -> Figure:
    """Shear stress and bonds over speed, with each maximum; of a start, over time."""
    if "drive_rest" in dataset:
        if data or ax:
            raise ValueError(
                "starts from rest have peaks; with data or an ax, draw the kind time"
            )
        return start_figure(dataset)
    scene = over_speed(dataset)._replace(measured=data)
    panels = [(2.1, _stress_panel), (1.3, _fraction_panel)]
    shown = panels if scene.varies("bond_fraction") else panels[:1]
    return stacked(scene, shown, ax)[0]


def _stress_panel(panel: Axes, scene: Scene) -> None:
    """Draw the shear stress upon closed forms, with the maximum of each curve."""
    words, stresses = r"shear stress $\tau_0$", scene.all("shear_stress")
    factor = style.in_unit(panel.yaxis, words, stresses, "Pa")
    scene.statistics.stated = Run(scene.statistics.dataset).events
    lines = [
        _mark_peak(panel, scene, line, factor, "speed") if line.style == "-" else line
        for line in scene.lines
    ]
    contact_curves(panel, scene._replace(lines=lines), "shear_stress", factor)
    _laws(panel, scene, 0, factor)


def _mark_peak(panel: Axes, scene: Scene, line: Line, factor: float, over: str) -> Line:
    """Mark the stated peaks of the stress, and return the curve with a single peak in its name."""
    stated = [scene.statistics.get(f"peak_{name}") for name in (over, "stress")]
    if any(each is None for each in stated):
        return line
    place, peak = (
        cast(xr.DataArray, each)
        .isel(line.point, missing_dims="ignore")
        .to_numpy()
        .ravel()
        for each in stated
    )
    stress = scene.values("shear_stress", line.whole)
    sign = np.sign(stress[np.isfinite(stress)][-1:])
    if not sign.size:
        return line
    at = scene.unit.factor * place, factor * sign * peak
    if not np.isfinite(place).any():
        return line
    panel.plot(*at, color=line.colour, **_RING)
    if place.size > 1:
        return line
    words = f"{style.rounded(peak[0], 'Pa')} at {style.rounded(place[0], _SI[over])}"
    return line._replace(label=line.label and f"{line.label}: {words}")


def _fraction_panel(panel: Axes, scene: Scene) -> None:
    _laws(panel, scene, 1, 1.0)
    contact_curves(panel, scene, "bond_fraction", 1.0)
    panel.set_ylabel("bond fraction $N/N_0$")


def _laws(panel: Axes, scene: Scene, which: int, factor: float) -> None:
    """Draw stress (0) or bond fraction (1) in steady sliding beside each curve over the speed."""
    for line in scene.lines:
        speeds = scene.speeds(line)
        low, high = np.min(speeds), np.max(speeds)
        fine = np.linspace(low, high, _CURVE)
        if scene.scale != "linear":
            fine = np.geomspace(np.min(speeds[speeds > 0.0]), high, _CURVE)
        law = factor * steady_law(scene.statistics.dataset, line.point, fine)[which]
        label = "steady sliding" if np.any(np.isfinite(law)) else ""
        panel.plot(scene.unit.factor * fine, law, label=label, **_LAW)


def start_figure(dataset: xr.Dataset) -> Figure:
    """Draw the stress since the start at the longest rest, and the peak stress over the speed, or over the rest."""
    rests, speeds = (setting(dataset, f"drive.{key}") for key in ("rest", "speed"))
    longest = dataset.isel(
        {dim: np.flatnonzero(rests == rests.max()) for dim in rests.dims}
    )
    rest, stated = float(rests.max()), Run(longest).events
    swept = [str(dim) for dim in (*speeds.dims, *rests.dims) if dataset.sizes[dim] > 1]
    has_peaks = bool(swept) and "peak_stress" in stated
    figure, axes = style.pairs(2.9) if has_peaks else style.rows([2.15])
    slid = longest.isel(t=np.flatnonzero(dataset["t"] > rest * (1.0 + 1e-9)))
    scene, times = scene_along(slid, "t"), slid["t"].to_numpy() - rest
    scale = "linear" if scene.single else "log"
    scene = scene.placed("t", times, "time since the start", "s", scale)
    words, stresses = r"shear stress $\tau_0$", scene.all("shear_stress")
    factor = style.in_unit(axes[0].yaxis, words, stresses, "Pa")
    contact_curves(axes[0], scene, "shear_stress", factor)
    scene.statistics.stated = stated
    for line in scene.lines:
        _mark_peak(axes[0], scene, line, factor, "time")
    style.across(axes[0], scene.x, scene.words, scale)
    after = f"after {style.text_of(rest, 's')} at rest"
    style.legend(axes[0], scene.headed(after).title)
    if has_peaks:
        scene = over_key(dataset, swept[0])
        scene.statistics.stated = Run(scene.statistics.dataset).events
        factor = statement_curves(axes[1], scene, "peak_stress")
        if scene.over.endswith("speed"):
            _laws(axes[1], scene, 0, factor)
        style.across(axes[1], scene.x, scene.words, scene.scale, 0.05)
        style.legend(axes[1], "peak of the stress")
    return figure
