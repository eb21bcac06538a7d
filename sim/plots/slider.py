"""Figures of sliding: bond stress over speed with closed forms, starts from rest, stability, creep, incipient slip."""

import contextlib
import re
from collections.abc import Callable
from typing import Any, NamedTuple, cast, get_args

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pydantic import TypeAdapter

from sim.laws import schallamach
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
from sim.read import Run, is_steady, setting, sweep_dims
from sim.read.dataset import MEMBERS, stays_held, word
from sim.read.estimate import Estimates
from sim.read.events import incipient_law, jumps
from sim.read.observables import with_slips
from sim.read.over_speed import speed_dim
from sim.units.errors import BadInput


class Steady(NamedTuple):
    """A closed form of steady sliding over speed: shear stress [Pa] and bonds over bonds at rest [1]."""

    words: str
    style: str
    stress: np.ndarray
    fraction: np.ndarray


#: Numbers of bonds that stretch in a dataset, and the beginning of those of a rupture law.
_BONDS = "bond_stiffness", "rebinding_rate", "site_density"
_PREFIX = "bonds_rupture_"


class Population(NamedTuple):
    """Bonds that stretch: their rupture law, stiffness [N/m], rebinding rate [1/s] and sites per area [1/m^2]."""

    rupture: Any
    stiffness: float
    rebinding: float
    density: float

    @property
    def pathway(self) -> tuple[float, float, float] | tuple[()]:
        """Rate [1/s], Bell force [N] and stiffness [N/m] if all rupture is by one pathway that force opens."""
        law = self.rupture.law(self.stiffness)
        return (
            (law.rate, self.stiffness / law.softness, self.stiffness)
            if law.one_pathway
            else ()
        )

    @property
    def at_rest(self) -> float:
        """Share of the sites that are bound at rest."""
        return float(
            schallamach.rest_share(
                self.rupture.law(self.stiffness).at_rest, self.rebinding
            )
        )


def population_of(point: xr.Dataset) -> Population | None:
    """Return the bonds of a dataset without a sweep; None if they do not stretch or it lacks their numbers."""
    if not (
        keys := [str(name) for name in point.variables if str(name).startswith(_PREFIX)]
    ):
        return None
    # which takes a while, and few datasets need it
    from sim.parts.bonds.rupture import Rupture

    with contextlib.suppress(KeyError, ValueError):
        numbers = {key.removeprefix(_PREFIX): float(point[key]) for key in keys}
        # any law by its numbers alone
        rupture = TypeAdapter(get_args(Rupture)[0]).validate_python(numbers)
        return Population(
            rupture, *(float(setting(point, f"bonds.{key}")) for key in _BONDS)
        )
    return None


def steady_laws(point: xr.Dataset, speed: np.ndarray) -> list[Steady]:
    """Return closed forms of the dataset's bonds in steady sliding.

    Parameters
    ----------
    point : xarray.Dataset
        As ``sim run`` writes it, at one point of its sweep.
    speed : array
        V [m/s].

    Returns
    -------
    list of Steady
        Exact, and for Bell's rupture the first-moment closure, too. None for bonds without a stretch.
    """
    bonds = population_of(point)
    if bonds is None:
        return []
    bound, force, _ = bonds.rupture.closed_form(speed, bonds.stiffness, bonds.rebinding)
    laws = [
        Steady(
            "steady sliding, exact", "-", bonds.density * force, bound / bonds.at_rest
        )
    ]
    if bonds.pathway:
        stress = schallamach.first_moment_stress(
            speed, *bonds.pathway, bonds.rebinding, bonds.density
        )
        fraction = schallamach.first_moment_fraction(
            speed, *bonds.pathway, bonds.rebinding
        )
        laws.append(Steady("mean field", "--", stress, fraction))
    return laws


# -- behind a spring, or under a force ----------------------------------------------------------

#: Speeds of a map, and at which its boundary is drawn.
_CELLS, _FINE = 28, 200
#: A file that a scenario names.
_FILE = re.compile(r'"file": *"[^"]')
_FRAME: Any = {"color": style.BONDS, "linewidth": 1.4}


def needs_force(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no force is prescribed."""
    if not (word(dataset, "drive.model", "") == "force").all():
        raise ValueError('no force is prescribed; set [drive] model = "force"')


def creep_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Displacement and speed of the slider over time under a prescribed force. A cross marks a runaway."""
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
        for line in scene.lines:
            place, values = np.transpose(
                cast(np.ndarray, panel.lines[line.number].get_xydata())
            )
            known = np.flatnonzero(np.isfinite(values))
            if 0 < known.size < values.size:
                look: Any = {"color": line.colour, "markersize": 4, "label": "runaway"}
                panel.plot(place[known[-1]], values[known[-1]], "x", **look)
    style.legend(axes[0], scene.title)
    return figure


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
    pace, hard = (
        style.Unit.of(edges, "m/s", True),
        style.Unit.of(stiffness, "N/m", True),
    )
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
    ends: Any = {"vmin": np.nanmin(swings), "vmax": np.nanmax(swings)}
    # greys that no page turns over and that show a line
    grey = style.part_of("Greys", 0.0, 0.65)
    for panel, words, swing in zip(axes, legs, swings, strict=True):
        mesh = panel.pcolormesh(
            pace.factor * edges,
            hard.factor * rows,
            swing,
            cmap=grey,
            rasterized=True,
            **ends,
        )
        panel.plot(
            pace.factor * fine,
            hard.factor * boundary,
            label="theory: unstable below",
            **_FRAME,
        )
        panel.set(yscale="log", ylim=hard.factor * rows[[0, -1]])
        style.across(
            panel, pace.factor * edges, pace.label("speed of the stage $V$"), "log"
        )
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
    """Return the stiffness below which steady sliding is unstable [N/m]; nan if the scenario cannot be read.

    No file that a dataset names is read.
    """
    from sim.ensemble.dataset import scenario_of  # heavy: for this figure alone
    from sim.ensemble.diagnosis import slider_body

    point = dataset.isel(dict.fromkeys(sweep_dims(dataset), 0))
    with contextlib.suppress(BadInput, KeyError):
        scene = scenario_of(
            {}
            if _FILE.search(str(dataset.attrs.get("scenario_resolved")))
            else dataset.attrs
        )
        scene = scene.with_values(
            {
                key: float(setting(point, key))
                for axis in scene.sweep
                for key in axis.keys
            }
        )
        return np.asarray(
            scene.population.onset(speed, slider_body(scene, speed)).stiffness
        )
    return np.full(speed.shape, np.nan)


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


def incipient_figure(dataset: xr.Dataset, absolute: bool = False) -> Figure:
    """Contact area over the tangential force before sliding, with the law A0 − αQ².

    The law is fitted by least squares up to half of the largest force.
    """
    scene = scene_along(dataset, "t")
    force, area = np.abs(scene.all("spring_force")), scene.all("contact_area")
    tops, alphas = np.transpose(
        [incipient_law(*curve) for curve in zip(force, area, strict=True)]
    )
    rises = np.arange(force.shape[1]) <= tops[:, np.newaxis]
    unit = style.Unit.of(force, "N")
    figure, axes = style.rows([2.0, 1.8], shared=False)
    axes[0].set_ylabel("contact area $A/A_0$")
    factor = (
        style.in_unit(axes[0].yaxis, "contact area $A$", area, "m^2")
        if absolute
        else 1.0
    )
    for line in scene.lines:
        up, alpha = rises[line.number], alphas[line.number]
        pulled, areas = force[line.number, up], area[line.number, up]
        law = alpha * pulled**2 / areas[0]
        words = rf"$\alpha$ = {1e6 * alpha:.3g} mm$^2$/N$^2$"
        name = f"{line.label}: {words}" if not scene.single else words
        look = style.GREY | ({} if scene.single else {"color": line.colour})
        full = factor * areas[0] if absolute else 1.0
        axes[0].plot(
            unit.factor * pulled, full * areas / areas[0], color=line.colour, label=name
        )
        axes[0].plot(unit.factor * pulled, full * (1.0 - law), "--", **look)
        axes[1].plot(
            unit.factor * pulled[1:], 1.0 - areas[1:] / areas[0], color=line.colour
        )
        axes[1].plot(unit.factor * pulled[1:], law[1:], "--", **look)
    axes[0].plot([], [], "--", label=r"$A_0 - \alpha Q^2$", **style.GREY)
    axes[1].set_ylabel("lost area $1 - A/A_0$")
    style.upward(axes[1])
    words, known = unit.label("tangential force $Q$"), unit.factor * force[rises]
    style.across(axes[0], known, words)
    style.across(axes[1], known[known > 0.01 * known.max()], words, "log")
    style.legend(axes[0], scene.title)
    return figure


# -- stress of the bonds ------------------------------------------------------------------------

#: Speeds at which a closed form is drawn.
_CURVE = 600

#: A peak is resolved if more clock steps than that lead up to it.
_STEPS = 3.5

#: Look of an exact closed form, grey that shows on a black line and beside it, and of an approximate one.
_LAWS: Any = {
    "-": {"linestyle": "-", "color": "#BBBBBB", "linewidth": 0.7, "zorder": 3},
    "--": {
        "linestyle": "--",
        "color": style.REFERENCE,
        "linewidth": 0.7,
        "zorder": 1.5,
    },
}
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
    """Shear stress with its maximum, and bonds, over speed. After a start from rest: the static peaks."""
    if "drive_rest" in dataset:
        if data or ax:
            raise ValueError(
                "starts from rest need several panels; with data or an ax, draw the kind time"
            )
        return start_figure(dataset)
    scene = over_speed(dataset)._replace(measured=data)

    def thin_lines(
        panel: Axes, scene: Scene, values: Callable[[Steady], np.ndarray]
    ) -> None:
        for line in scene.lines:
            speeds = _fine(scene, line)
            for law in steady_laws(dataset.isel(line.point), speeds):
                panel.plot(
                    scene.unit.factor * speeds,
                    values(law),
                    label=law.words,
                    **_LAWS[law.style],
                )

    def stress_panel(panel: Axes, scene: Scene) -> None:
        """Draw the shear stress upon closed forms, with the maximum of each curve."""
        factor = style.in_unit(
            panel.yaxis, r"shear stress $\tau_0$", scene.all("shear_stress"), "Pa"
        )
        contact_curves(
            panel,
            scene._replace(lines=_marked(panel, scene, factor)),
            "shear_stress",
            factor,
        )
        thin_lines(panel, scene, lambda law: factor * law.stress)

    def fraction_panel(panel: Axes, scene: Scene) -> None:
        thin_lines(panel, scene, lambda law: law.fraction)
        contact_curves(panel, scene, "bond_fraction", 1.0)
        panel.set_ylabel("bond fraction $N/N_0$")

    panels = [(2.1, stress_panel), (1.3, fraction_panel)]
    return stacked(
        scene, panels if scene.varies("bond_fraction") else panels[:1], ax=ax
    )[0]


def _fine(scene: Scene, line: Line) -> np.ndarray:
    """Return the speeds of a closed form beside a curve [m/s]."""
    speeds = scene.speeds(line)
    low, high = np.min(speeds), np.max(speeds)
    if scene.scale == "log":
        return np.geomspace(low, high, _CURVE)
    if scene.scale == "symlog":
        return np.append(
            0.0, np.geomspace(np.min(speeds[speeds > 0.0]), high, _CURVE - 1)
        )
    return np.linspace(low, high, _CURVE)


def maximum_of(speed: np.ndarray, stress: np.ndarray) -> int | None:
    """Return the index of the largest size of the stress; None if it is at an end of the speeds.

    >>> maximum_of(np.array([1.0, 2.0, 3.0]), np.array([1.0, 4.0, 2.0]))
    1
    >>> maximum_of(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 4.0])) is None
    True
    """
    if not np.any(np.isfinite(stress)):
        return None
    at, size = (
        int(np.nanargmax(np.abs(stress))),
        np.where(np.isfinite(stress), np.abs(speed), np.nan),
    )
    return at if np.nanmin(size) < size[at] < np.nanmax(size) else None


def _marked(panel: Axes, scene: Scene, factor: float) -> list[Line]:
    """Mark the maximum of each curve by a ring and return the curves with the maxima in their names."""
    labelled = []
    for line in scene.lines:
        speed, stress = scene.speeds(line), scene.values("shear_stress", line)
        # their transients have no maximum over the speed
        steps = scene.broken and jumps(speed, True).size
        at = None if steps else maximum_of(speed, stress)
        words = line.label
        if at is not None:
            panel.plot(
                scene.x[line.number][at],
                factor * stress[at],
                color=line.colour,
                **_RING,
            )
            most, fast = (
                style.rounded(stress[at], "Pa"),
                style.rounded(speed[at], "m/s"),
            )
            words = words and f"{words}: {most} at {fast}"
        labelled.append(line._replace(label=words))
    return labelled


def start_figure(dataset: xr.Dataset) -> Figure:
    """Draw the stress since the start at the longest rest, and the peak stress over the speed, or over the rest."""
    rests, speeds = (setting(dataset, f"drive.{key}") for key in ("rest", "speed"))
    longest = dataset.isel(
        {dim: np.flatnonzero(rests == rests.max()) for dim in rests.dims}
    )
    over = [str(dim) for dim in (*speeds.dims, *rests.dims) if dataset.sizes[dim] > 1]
    stated = Run(longest).statements([])
    if not over or "peak_stress" not in stated:
        figure, axes = style.rows([2.15])
    else:
        figure, axes = style.pairs(2.9)
        _peak_panel(axes[1], dataset, over_key(dataset, over[0]))
    _time_panel(axes[0], longest, float(rests.max()), stated)
    return figure


def _time_panel(
    panel: Axes, dataset: xr.Dataset, rest: float, stated: Estimates
) -> None:
    """Draw the stress over the time since the start; a dot is a stated peak."""
    slid = dataset.isel(t=np.flatnonzero(dataset["t"] > rest + 1e-9 * dataset["t"][-1]))
    scene = scene_along(slid, "t")
    scale = "linear" if scene.single else "log"
    scene = scene.placed(
        "t", slid["t"].to_numpy() - rest, "time since the start", "s", scale
    )
    factor = style.in_unit(
        panel.yaxis, r"shear stress $\tau_0$", scene.all("shear_stress"), "Pa"
    )
    contact_curves(panel, scene, "shear_stress", factor)
    for line in scene.lines if "peak_stress" in stated else ():
        when, peak = (
            style.number_at(stated[f"peak_{name}"].value, line.point)
            for name in ("time", "stress")
        )
        peak = np.copysign(peak, scene.values("shear_stress", line)[-1])
        panel.plot(
            scene.unit.factor * when,
            factor * peak,
            "o",
            markersize=3,
            color=line.colour,
        )
    style.across(panel, scene.x, scene.words, scale)
    style.legend(
        panel,
        "; ".join(
            filter(None, [f"after {style.text_of(rest, 's')} at rest", scene.title])
        ),
    )


def _peak_panel(panel: Axes, dataset: xr.Dataset, scene: Scene) -> None:
    """Draw the peak stress; a hollow one comes within few steps of the start.

    Thin lines over the speed are closed forms: the peak of Bell bonds if none rebinds, and steady sliding.
    """
    scene.statistics.stated = Run(scene.statistics.dataset).statements([])
    factor = statement_curves(panel, scene, "peak_stress")
    for line in scene.lines:
        x, peaks, when = (
            scene.x[line.number],
            *(scene.values(f"peak_{name}", line) for name in ("stress", "time")),
        )
        few = when <= _STEPS * float(dataset["clock_step"])
        look: Any = {
            "markersize": 3,
            "mfc": "white",
            "color": line.colour,
            "label": "not resolved" * bool(few.any()),
        }
        panel.plot(x[few], factor * peaks[few], "o", **look)
    for line in scene.lines if scene.over.endswith("speed") else ():
        point = dataset.isel(line.point | {scene.over: 0})
        speeds, bonds = _fine(scene, line), population_of(point)
        if bonds and bonds.pathway:
            rested = style.mean_of(point, "bond_fraction").sel(
                t=float(setting(point, "drive.rest")), method="ffill"
            )
            force = schallamach.start_up_peak(speeds, *bonds.pathway).force
            peak = factor * float(rested) * bonds.density * bonds.at_rest * force
            panel.plot(
                scene.unit.factor * speeds,
                peak,
                ":",
                label="without rebinding",
                **style.GREY,
            )
        for law in steady_laws(point, speeds)[:1]:
            panel.plot(
                scene.unit.factor * speeds,
                factor * law.stress,
                label=law.words,
                **_LAWS[law.style],
            )
    style.across(panel, scene.x, scene.words, scene.scale, 0.05)
    style.legend(panel, "peak of the stress")
