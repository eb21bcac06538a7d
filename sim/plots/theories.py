"""Figures of one contact beside theory: the competing theories under shear, profiles, and the loop of a JKR test."""

import contextlib
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.laws import equilibrium, jkr
from sim.laws.theories import compare_at_indentation, compare_at_load
from sim.plots import style
from sim.plots.curves import SIGNS, Scene, beside, scene_along
from sim.plots.measured import Line, Measured
from sim.read import control, is_steady, pull_offs, setting, settled
from sim.read.dataset import ensemble_mean, plain, stays_held
from sim.read.observables import thickness_of

#: Name of each theory, its colour and line style.
_THEORIES: dict[str, tuple[str, str, Any]] = {
    "jkr": ("JKR; Menga, Carbone & Dini 2019", style.REFERENCE, "--"),
    "hertz": ("Hertz", style.REFERENCE, ":"),
    "uncorrected": ("Menga et al. 2018, uncorrected", style.LINES[4], "-"),
    "savkoor_briggs": ("Savkoor & Briggs, full stick", style.LINES[1], "-"),
    "reversible_force": ("reversible, force held", style.LINES[5], "--"),
    "reversible_stress": ("reversible, stress held", style.LINES[2], "-"),
    "fraction": ("a fraction {share:.3g} reversible", style.LINES[3], "-."),
    "scaled_angle": (r"mixed mode $1+\tan^2((1-\lambda)\psi)$", "#7A4B1F", "-"),
    "shear_share": (r"mixed mode $1/(1-(1-\lambda)\sin^2\psi)$", "#6A3D9A", "--"),
    "scaled_tangent": (
        r"mixed mode $1+(1-\lambda)\tan^2\psi$, $\lambda=$ {mixity:.3g}",
        "#8A9A00",
        "-.",
    ),
}

#: Reversible fraction that is drawn where the dataset has none of its own.
_FRACTION = 0.1

#: Mixity lambda of the mixed-mode theories, halfway between JKR and Savkoor & Briggs.
_MIXITY = 0.5

#: Stresses at which theories are evaluated, those beside the end of a branch, and how
#: often these are refined; the widest area drawn, in JKR's.
_FINE, _NEAR, _REFINED, _WIDEST = 500, 30, 4, 1.1

#: Points of a dataset that are drawn at most.
_POINTS = 40

#: What areas are drawn over: in words, its unit, and the power of the area that the stress is multiplied by.
_AXES = ((r"shear stress $\tau$", "Pa", 0), (r"tangential force $T = \tau A$", "N", 1))

#: Control of the contact: the law of all theories under it, its symbol and unit.
_CONTROLS: Any = {
    "load": (compare_at_load, "$P$", "N"),
    "indentation": (compare_at_indentation, r"$\delta$", "m"),
}


class Case(NamedTuple):
    """The contact of the theories: ``held`` is "load" [N] or "indentation" [m], the others as in ``laws.theories``."""

    held: str
    value: float
    work: float
    sphere_radius: float
    modulus: float
    poisson_ratio: float
    reversible: float

    def areas(self, stress: np.ndarray) -> dict[str, np.ndarray]:
        """Return the contact area at shear stresses [Pa] by theory [m^2], nan without adhesion.

        JKR's and Hertz's areas are the same at each stress.
        """
        radii = _CONTROLS[self.held][0](stress, *self[1:], mixity=_MIXITY)
        areas = {name: np.pi * radii[name] ** 2 for name in _THEORIES}
        least = np.nan_to_num(areas["hertz"]) * (1.0 + 1e-9)
        for name in areas.keys() - {"jkr", "hertz"}:
            areas[name] = np.where(areas[name] > least, areas[name], np.nan)
        return areas

    def branches(
        self, low: float, high: float
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return stresses [Pa] and ``areas``, with many stresses at the end of each branch."""
        stress = np.geomspace(low, high, _FINE)
        for _ in range(_REFINED):
            areas = self.areas(stress)
            held = np.isfinite(list(areas.values()))
            ends = np.flatnonzero(np.any(held[:, :-1] & ~held[:, 1:], axis=0))
            near = (np.linspace(stress[end], stress[end + 1], _NEAR) for end in ends)
            stress = np.unique(np.concatenate([stress, *near]))
        return stress, self.areas(stress)

    @property
    def scale(self) -> float:
        """Stress whose whole energy is the work of adhesion at JKR's radius: sqrt(pi E* w/(6 a)) [Pa]."""
        radius = np.sqrt(self.areas(np.zeros(1))["jkr"][0] / np.pi)
        return float(np.sqrt(np.pi * self.modulus * self.work / (6.0 * radius)))


def sweeps_theories(dataset: xr.Dataset) -> bool:
    """True if the reversible fraction, on which the theories differ, is swept."""
    return np.size(dataset.get("contact_reversible", ())) > 1


def case_of(dataset: xr.Dataset) -> Case:
    """Return the contact of the theories, with the first reversible fraction that no other theory stands for.

    Raises
    ------
    ValueError
        If the sphere is not held at one load or indentation, with adhesion and in contact.
    """
    held, value = "", xr.DataArray(np.nan)
    with contextlib.suppress(KeyError):
        held = control(dataset).kind
        value = setting(dataset, f"contact.{held}")
    if held not in _CONTROLS or value.isnull().any():
        cure = 'run it with [contact] load = "4 mN", or with an indentation'
        raise ValueError(f"theories need a constant load or indentation;  {cure}")
    if "solid_thickness" in dataset:
        cure = "omit solid.thickness to compare them on a half-space"
        raise ValueError(f"the theories are not known on a layer;  {cure}")
    if not np.all(np.isinf(thickness_of(dataset))):
        cure = "omit sphere.profile to compare them on a parabola"
        raise ValueError(f"the theories are not known of a circle;  {cure}")
    settings = {
        "value": value,
        "work": setting(dataset, "adhesion.work"),
        "sphere_radius": setting(dataset, "sphere.radius"),
        "modulus": dataset["contact_modulus"],
        "poisson_ratio": dataset["effective_poisson_ratio"],
    }
    if not settings["work"].max() > 0.0:
        raise ValueError(
            "the theories differ only with adhesion; give adhesion.work above 0"
        )
    if not (dataset["radius_at_rest"] > 0.0).any():
        raise ValueError(
            "there is no contact at rest; raise the load or the indentation"
        )
    for values in settings.values():
        if values.min() < values.max():
            dim = str(values.dims[0])
            at = style.text_of(dataset[dim][0], dataset[dim].attrs["units"])
            at = at.replace("−", "-")
            cure = f'choose by --where, such as --where {dim}="{at}"'
            raise ValueError(f"theories describe a single contact; {cure}")
    fractions = np.ravel(dataset.get("contact_reversible", ()))
    shares = [float(share) for share in fractions if 0.0 < share != 1.0]
    numbers = {key: float(values.max()) for key, values in settings.items()}
    return Case(held, reversible=(shares or [_FRACTION])[0], **numbers)


def points_of(dataset: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return shear stress [Pa] and contact area [m^2] of closed contacts, means over the members.

    Of steady sliding the mean over the second half of the run at each point of the sweep, else records
    spread evenly over the run.
    """
    dataset, names = plain(dataset), ("shear_stress", "contact_area")
    means = xr.Dataset({name: style.mean_of(dataset, name) for name in names})
    if is_steady(dataset):
        means = settled(means)
    else:
        records = np.rint(np.linspace(0, dataset.sizes["t"] - 1, _POINTS)).astype(int)
        means = means.isel(t=np.unique(records))
    stress, area = (
        values.to_numpy().ravel() for values in xr.broadcast(*means.values())
    )
    closed = area > 0.0
    return np.abs(stress[closed]), area[closed]


def theories_figure(dataset: xr.Dataset) -> Figure:
    """Contact area, simulated and by each theory, over shear stress and tangential force."""
    case = case_of(dataset)
    stress, area = points_of(dataset)
    sheared = stress[stress > 0.0]
    least, most = 0.1 * case.scale, np.max(sheared, initial=0.0)
    low = max(0.01 * case.scale, 0.7 * np.min(sheared, initial=least / 0.7))
    fine, areas = case.branches(low, max(3.0 * case.scale, 1.3 * most))
    figure, axes = style.pairs(3.3, shared=True)
    full, bare = areas["jkr"][0], np.nan_to_num(areas["hertz"][0])
    mark = style.HOLLOW | {"color": style.BOTH, "zorder": 1.8, "markersize": 2.8}
    factor = style.in_unit(axes[0].yaxis, "contact area $A$", areas["jkr"], "m^2")
    for panel, (words, si, power) in zip(axes, _AXES, strict=True):
        unit = style.Unit.of(full**power * fine, si, logarithmic=True)
        for name, (text, colour, dashes) in _THEORIES.items():
            label = text.format(share=case.reversible, mixity=_MIXITY)
            look: Any = {"linestyle": dashes, "color": colour}
            x, y = unit.factor * areas[name] ** power * fine, factor * areas[name]
            if name in ("jkr", "hertz"):  # whatever the shear
                panel.axhline(y[0], label=label, **style.GREY | look)
                continue
            panel.plot(x, y, label=label, **look)
            known = np.flatnonzero(np.isfinite(y))
            if 0 < known.size < y.size:  # the branch ends
                panel.plot(x[known[-1]], y[known[-1]], "o", markersize=3, color=colour)
        x = unit.factor * stress * area**power
        panel.plot(x, factor * area, label="simulated", **mark)
        if not is_steady(dataset) and area.size:
            last = mark | {"mfc": style.BOTH, "label": "simulated, last record"}
            panel.plot(x[-1:], factor * area[-1:], **last)
        ends = unit.factor * fine[[0, -1]] * full**power
        style.across(panel, ends, unit.label(words), "log")
    # from below Hertz's area to above JKR's: the uncorrected theory goes far beyond
    bottom = min(bare - 0.3 * (full - bare), np.min(area, initial=bare))
    top = max(_WIDEST * full, 1.05 * np.max(area, initial=0.0))
    axes[0].set_ylim(factor * max(bottom, 0.0), factor * top)
    _, symbol, si = _CONTROLS[case.held]
    held = f"{symbol} = {style.text_of(case.value, si)}"
    title = f"{held}, $w$ = {style.text_of(case.work, 'J/m^2')}"
    style.legend(axes[0], title, whole=True)
    return figure


# -- loop of a JKR test --------------------------------------------------------------------


#: Radii at which the equilibrium curve is evaluated.
_RADII = 600

#: Axis of each control, in words and as a symbol; the indentation where no stiffness is between.
_DISPLACEMENTS = {
    "displacement": ("displacement", r"\Delta"),
    "": ("displacement, or indentation,", r"\Delta"),
}


def needs_course(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which the mount of the sphere does not move."""
    if stays_held(dataset).all():
        cure = '[contact] indentation = { from = "2 um", to = "-12 um", cycles = 1 }'
        raise ValueError(
            f"the mount does not move, so there is no loop; move it: {cure}"
        )


def loop_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Load and contact radius over displacement, and radius over load, with the pull-offs and JKR's equilibria.

    Load and radius are zero while the contact is open. Grey is the JKR contact at the full work of adhesion, with
    stable and unstable equilibria.
    """
    kind, stiffness = "", xr.DataArray(np.nan)
    with contextlib.suppress(KeyError):  # the whole table [contact] is swept
        kind, stiffness = control(dataset)
    words, symbol = _DISPLACEMENTS.get(kind, ("indentation", r"\delta"))
    over = "displacement" if kind in _DISPLACEMENTS else "indentation"
    base, load = "displacement", "normal_load"
    scene = scene_along(dataset, "t")._replace(measured=data)
    of_load = scene.placed(load, scene.all(load), "normal load $P$", "N")
    scene = scene.placed(over, scene.all(base), f"{words} ${symbol}$", "m")
    compared = data is not None and data.has_errors
    heights = [2.1, 1.5, 1.8] + [0.8] * compared
    figure, (loads, radii, loaded, *below) = style.rows(heights, shared=False)
    force = style.in_unit(loads.yaxis, "normal load $P$", scene.all(load), "N")
    sizes = scene.all("contact_radius")
    length = style.in_unit(radii.yaxis, "contact radius $a$", sizes, "m")
    loaded.set_ylabel(radii.get_ylabel())
    for panel, placed, name, factor in (
        (loads, scene, load, force),
        (radii, scene, "contact_radius", length),
        (loaded, of_load, "contact_radius", length),
    ):
        for line in placed.lines:
            x = placed.x[line.number]
            y = factor * np.where(placed.opened(line), 0.0, placed.values(name, line))
            panel.plot(x, y, color=line.colour, label=line.label)
        beside(panel, placed, name, factor)
        style.across(panel, placed.reach, placed.words, room=0.03)
    events = [
        point for line in scene.lines for point in _events(loads, scene, line, force)
    ]
    for panel in (loads, radii):
        reach = np.append(scene.reach, events)
        style.across(panel, reach, scene.words, room=0.03)
    _equilibria((loads, radii, loaded), scene, (force, length), stiffness)
    if data:
        along = scene if data.column(over) else of_load
        data.finish(figure, along.over)
        for panel in below:
            data.residual_panel(panel, along.over)
            style.across(panel, along.reach, along.words, room=0.03)
        style.legend(loaded)
    for panel in (radii, loaded):
        panel.set_ylim(bottom=0.0)
    loads.sharex(radii)
    style.legend(loads, scene.title)
    return figure


def _events(panel: Axes, scene: Scene, line: Line, force: float) -> np.ndarray:
    """Draw a cross at each recorded pull-off and a ring at the first jump-in of each member, or at their means.

    Return their places on the axis.
    """
    dataset, reached = scene.statistics.dataset, []
    events = ("pull_off", "jump_in")
    for event, (words, sign) in zip(events, SIGNS.items(), strict=True):
        if f"{event}_load" not in dataset:
            continue
        of_event = pull_offs(dataset) if event == "pull_off" else dataset
        names = (f"{event}_displacement", f"{event}_load")
        place, load = (
            ensemble_mean(of_event[name].isel(line.point, missing_dims="ignore"))
            .to_numpy()
            .ravel()
            for name in names
        )
        known = np.isfinite(load)
        if known.any():
            x = scene.unit.factor * place[known]
            is_one = event == "pull_off" or scene.openings(line)[1].size <= 1
            label = words if is_one else f"first {words}"
            look = sign | {"color": line.colour, "label": label}
            panel.plot(x, force * load[known], **look)
            reached.append(x)
    return np.concatenate(reached) if reached else np.empty(0)


def _equilibrium(
    radius: np.ndarray, contact: Sequence[float], thickness: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return load and indentation of contacts of some radii in equilibrium with a work of adhesion.

    ``contact``: that work, radius of the sphere and contact modulus.
    """
    if thickness == math.inf:
        load = jkr.load_at_radius(radius, *contact)
        return load, jkr.indentation_at_radius(radius, *contact)
    _, size, modulus = contact
    load = equilibrium.load_at_radius_on_layer(radius, *contact, thickness)
    body = size, modulus, thickness
    return load, equilibrium.indentation_on_layer(radius, load, 0.0, 0.0, *body)


def _equilibria(
    panels: tuple[Axes, Axes, Axes],
    scene: Scene,
    factors: tuple[float, float],
    stiffness: xr.DataArray,
) -> None:
    """Draw JKR's equilibria up to the largest contact, each different curve once."""
    dataset, (force, length) = scene.statistics.dataset, factors
    reached: dict[tuple[float, ...], float] = {}
    thickness = thickness_of(dataset)
    work, size = setting(dataset, "adhesion.work"), setting(dataset, "sphere.radius")
    for line in scene.lines:
        numbers = (work, size, dataset["contact_modulus"], thickness, stiffness)
        theory = tuple(style.number_at(number, line.point) for number in numbers)
        most = np.max(np.nan_to_num(scene.values("contact_radius", line)))
        reached[theory] = max(reached.get(theory, 0.0), most)
    loads, radii, loaded = panels
    # dense at small radii, where the slopes are infinite
    shares = np.linspace(0.0, 1.0, _RADII) ** 2
    for (*contact, layer_thickness, spring), most in reached.items():
        if most > 0.0 and not np.isnan(spring):
            radius = most * shares
            load, depth = _equilibrium(radius, contact, layer_thickness)
            displacement = scene.unit.factor * (depth + load / spring)
            look = style.GREY | {"linestyle": "--", "label": "JKR, stable and unstable"}
            loads.plot(displacement, force * load, **look)
            radii.plot(displacement, length * radius, **look)
            loaded.plot(force * load, length * radius, **look)
