"""Figures of one contact beside theory: the competing theories under shear, profiles, and the loop of a JKR test."""

import contextlib
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.laws import jkr
from sim.laws.theories import compare_at_indentation, compare_at_load
from sim.plots import style
from sim.plots.curves import Scene, beside, colour_bar, mark_jumps, scene_along
from sim.plots.measured import Line, Measured
from sim.read import Run, control, is_steady, pull_offs, setting, settled
from sim.read.dataset import ensemble_mean, only_statistics, plain, stays_held
from sim.read.loops import cycles_of
from sim.read.peaks import differ

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

#: Stresses at which theories are evaluated, and the widest area drawn, in JKR's.
_FINE, _WIDEST = 1500, 1.6

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

    def radii(self, stress: np.ndarray) -> dict[str, np.ndarray]:
        """Return the contact radius at shear stresses [Pa] by theory [m]."""
        radii = _CONTROLS[self.held][0](stress, *self[1:], mixity=_MIXITY)
        return {name: radius for name, radius in radii.items() if name in _THEORIES}

    @property
    def scale(self) -> float:
        """Stress whose whole energy is the work of adhesion at JKR's radius: sqrt(pi E* w/(6 a)) [Pa]."""
        radius = self.radii(np.zeros(1))["jkr"][0]
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
    settings: dict[str, xr.DataArray] = {}
    with contextlib.suppress(KeyError):
        held = control(dataset).kind
        settings["value"] = setting(dataset, f"contact.{held}")
    if not settings or held not in _CONTROLS:
        cure = 'run it with [contact] load = "4 mN", or with an indentation'
        raise ValueError(f"theories need a constant load or indentation;  {cure}")
    settings |= {
        "work": setting(dataset, "adhesion.work"),
        "sphere_radius": setting(dataset, "sphere.radius"),
    }
    settings |= {
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
            value = (
                style.swept_value(dataset, dim, 0).rpartition("= ")[2].replace("−", "-")
            )
            cure = f'choose by --where, such as --where {dim}="{value}"'
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
    dataset = plain(dataset)
    means = xr.Dataset(
        {
            name: style.mean_of(dataset, name)
            for name in ("shear_stress", "contact_area")
        }
    )
    if is_steady(dataset):
        means = settled(means)
    else:
        means = means.isel(
            t=np.unique(
                np.rint(np.linspace(0, dataset.sizes["t"] - 1, _POINTS)).astype(int)
            )
        )
    stress, area = (
        values.to_numpy().ravel()
        for values in xr.broadcast(means["shear_stress"], means["contact_area"])
    )
    closed = area > 0.0
    return np.abs(stress[closed]), area[closed]


def theories_figure(dataset: xr.Dataset) -> Figure:
    """Contact area, simulated and by each theory, over shear stress and tangential force."""
    case = case_of(dataset)
    stress, area = points_of(dataset)
    sheared = stress[stress > 0.0]
    low, high = (
        0.1 * case.scale,
        max(3.0 * case.scale, 1.3 * np.max(sheared, initial=0.0)),
    )
    low = max(0.01 * case.scale, 0.7 * np.min(sheared, initial=low / 0.7))
    fine = np.geomspace(low, high, _FINE)
    areas = {name: np.pi * radius**2 for name, radius in case.radii(fine).items()}
    figure, axes = style.pairs(3.3, shared=True)
    full, mark = (
        areas["jkr"][0],
        style.HOLLOW
        | {"color": style.BOTH, "zorder": 1.8, "markersize": 2.8, "mew": 0.7},
    )
    factor = style.in_unit(axes[0].yaxis, "contact area $A$", areas["jkr"], "m^2")
    for panel, (words, si, power) in zip(axes, _AXES, strict=True):
        unit = style.Unit.of(full**power * fine, si, logarithmic=True)
        along = {
            name: unit.factor * values**power * fine for name, values in areas.items()
        }
        _panel(panel, case, along, areas, factor)
        x = unit.factor * stress * area**power
        panel.plot(x, factor * area, label="simulated", **mark)
        if not is_steady(dataset) and area.size:
            panel.plot(
                x[-1:],
                factor * area[-1:],
                label="simulated, last record",
                **mark | {"mfc": style.BOTH},
            )
        style.across(
            panel,
            unit.factor * np.array([low, high]) * full**power,
            unit.label(words),
            "log",
        )
    # heights from Hertz's area, or none, to somewhat above JKR's: the uncorrected theory goes far beyond
    least = np.nan_to_num(areas["hertz"][0])
    bottom = min(least - 0.3 * (full - least), np.min(area, initial=least))
    top = max(_WIDEST * full, 1.05 * np.max(area, initial=0.0))
    axes[0].set_ylim(factor * max(bottom, 0.0), factor * top)
    _, symbol, si = _CONTROLS[case.held]
    words = f"{symbol} = {style.text_of(case.value, si)}, $w$ = {style.text_of(case.work, 'J/m^2')}"
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper left", title=words, ncols=3, **style.LEGEND
    )
    return figure


def _panel(
    panel: Axes,
    case: Case,
    along: dict[str, np.ndarray],
    areas: dict[str, np.ndarray],
    factor: float,
) -> None:
    """Draw each theory along its own x, to the end of its adhesive branch."""
    for name, (words, colour, line) in _THEORIES.items():
        values, label = (
            factor * areas[name],
            words.format(share=case.reversible, mixity=_MIXITY),
        )
        if name in ("jkr", "hertz"):  # whatever the shear
            panel.axhline(values[0], linestyle=line, label=label, **style.GREY)
            continue
        held = values > np.nan_to_num(factor * areas["hertz"]) * (1.0 + 1e-9)
        branch = np.where(held, values, np.nan)
        panel.plot(along[name], branch, linestyle=line, color=colour, label=label)
        if np.any(held) and not held[-1]:  # the branch ends at a fold
            end = np.flatnonzero(held)[-1]
            panel.plot(along[name][end], branch[end], "o", markersize=3, color=colour)


# -- loop of a JKR test --------------------------------------------------------------------


#: Radii at which the equilibrium curve is evaluated.
_RADII = 600

#: Load at the fold of fixed grips over that at the fold of a dead load: 5/6 pi w R over 3/2 pi w R.
_GRIPS = 5.0 / 9.0

#: Line width of the cycles after the first.
_LATER = 0.6

#: Axis of each control, in words and as a symbol; the indentation where no stiffness is between.
_DISPLACEMENTS = {
    "displacement": ("displacement", r"\Delta"),
    "": ("displacement, or indentation,", r"\Delta"),
}


class Theory(NamedTuple):
    """JKR's contact at rest of one curve, behind the stiffness of its mount."""

    work: float
    sphere_radius: float
    modulus: float
    stiffness: float


def needs_course(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which the mount of the sphere does not move."""
    if stays_held(dataset).all():
        cure = '[contact] indentation = { from = "2 um", to = "-12 um", cycles = 1 }'
        raise ValueError(
            f"the mount does not move, so there is no loop; move it: {cure}"
        )


def loop_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Load and contact radius over displacement with the energy lost per cycle, and radius over load.

    A line is broken while the contact is open; there the load is a thin line at zero. Grey is the JKR contact at the
    full work of adhesion, with stable and unstable equilibria. The loads of pull-off under a dead load and in fixed
    grips are also shown.
    """
    kind, stiffness, scene = (
        "",
        xr.DataArray(np.nan),
        scene_along(dataset, "t")._replace(measured=data),
    )
    with contextlib.suppress(KeyError):  # the whole table [contact] is swept
        kind, stiffness = control(dataset)
    words, symbol = _DISPLACEMENTS.get(kind, ("indentation", r"\delta"))
    over = "displacement" if kind in _DISPLACEMENTS else "indentation"
    scene = scene.placed(over, scene.all("displacement"), f"{words} ${symbol}$", "m")
    work, size = setting(dataset, "adhesion.work"), setting(dataset, "sphere.radius")
    numbers = (work, size, dataset["contact_modulus"], stiffness)
    theories = [
        Theory(*(style.number_at(number, line.point) for number in numbers))
        for line in scene.lines
    ]
    compared = data is not None and data.has_errors
    figure, panels = style.rows([2.1, 1.5, 1.8] + [0.8] * compared, shared=False)
    loads, radii, loaded, *below = panels
    force = style.in_unit(loads.yaxis, "normal load $P$", scene.all("normal_load"), "N")
    length = style.in_unit(
        radii.yaxis, "contact radius $a$", scene.all("contact_radius"), "m"
    )
    loaded.set_ylabel(radii.get_ylabel())
    of_load = scene.placed(
        "normal_load", scene.all("normal_load"), "normal load $P$", "N"
    )
    stated, cycles = Run(dataset).statements([]), cycles_of(dataset)
    integral = rf"$\oint\,P\,\mathrm{{d}}{symbol}$"
    in_cycles = "loop_energy" in stated and bool(
        stated["loop_energy"].value.notnull().all()
    )
    spent = stated["loop_dissipation" if in_cycles else "total_dissipated"].value
    energies = {"$W$": spent} | (
        {integral: stated["loop_energy"].value} if in_cycles else {}
    )
    labelled = scene._replace(lines=_labelled(scene, energies))
    for panel, placed, name, factor in (
        (loads, labelled, "normal_load", force),
        (radii, scene, "contact_radius", length),
        (loaded, of_load, "contact_radius", length),
    ):
        for line in placed.lines:
            _cycle(
                panel,
                placed,
                name,
                line,
                factor,
                kind,
                style.number_at(cycles, line.point),
            )
        beside(panel, placed, name, factor)
        style.across(panel, placed.reach, placed.words, room=0.03)
    _equilibria(panels[:3], scene, theories, (scene.unit.factor, force, length))
    _levels(loads, theories, force)
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
    put_in = f"{integral} put in, the area of the loop with each jump a straight line between records"
    cycled = f"per cycle: $W$ dissipated by opening and closing; {put_in}"
    lost = cycled if in_cycles else "dissipated in all: $W$"
    style.legend(loads, lost if (spent != 0.0).any() else scene.title, columns=1)
    style.legend(radii)
    colour_bar(figure, panels, scene)
    return figure


def _cycle(
    panel: Axes,
    scene: Scene,
    name: str,
    line: Line,
    factor: float,
    kind: str,
    cycles: float,
) -> None:
    """Draw one curve with its jumps: a cross at each pull-off, a ring at each jump-in; thin after its first cycle.

    If members differ, crosses are their own pull-offs: their mean ends where the last comes off.
    """
    x, gone, loads = scene.x[line.number], scene.opened(line), name == "normal_load"
    mean, _, low, high = (factor * values for values in scene.drawn(name, line))
    along_load = scene.over == "normal_load"
    first = int(np.ceil(len(x) / max(cycles, 1.0)))
    # a standard deviation reaches loads that none has
    known = scene.statistics.get(name, "quantile") is not None
    # a band over a mean of loads says nothing
    if known and np.any(high > low) and not along_load:
        shade: Any = {
            "color": line.colour,
            "alpha": 0.18,
            "label": "" if loads else scene.spread,
        }
        style.fill(panel, x[:first], low[:first], high[:first], **shade)
    panel.plot(
        x[:first], mean[:first], color=line.colour, label=line.label if loads else ""
    )
    if first < len(x):
        later: Any = {"linewidth": _LATER, "label": "" if loads else "later cycles"}
        panel.plot(x[first - 1 :], mean[first - 1 :], color=line.colour, **later)
    if loads:
        # the open spheres of all curves lie on each other
        colour = line.colour if scene.single else style.REFERENCE
        panel.plot(x, np.where(gone, 0.0, np.nan), color=colour, linewidth=0.4)
    off = _pull_offs(scene.statistics.dataset, line)
    if off is not None:
        if loads:
            look: Any = {
                "color": line.colour,
                "markersize": 2.5,
                "linestyle": "none",
                "alpha": 0.6,
            }
            words = (
                "mean pull-off"
                if only_statistics(scene.statistics.dataset)
                else "pull-off of each member"
            )
            panel.plot(
                scene.unit.factor * off[0], factor * off[1], "x", label=words, **look
            )
        return
    # under a dead load the sphere leaves: no place to draw a jump to
    if kind != "load" and not along_load:
        jumps = np.concatenate(scene.openings(line))
        panel.vlines(
            x[jumps],
            0.0,
            mean[jumps],
            colors=line.colour,
            linestyles="dotted",
            linewidth=0.8,
        )
    mark_jumps(panel, scene, name, line, factor, labelled=not loads)


def _pull_offs(dataset: xr.Dataset, line: Line) -> np.ndarray | None:
    """Return displacements [m] and loads [N] of the pull-offs of members, their means if no more is recorded.

    None if members agree, or without the records.
    """
    if "pull_off_load" not in dataset or not differ(dataset["pull_off_load"]):
        return None
    off = pull_offs(dataset).isel(line.point, missing_dims="ignore")
    names = ("pull_off_displacement", "pull_off_load")
    return np.stack([ensemble_mean(off[name]).to_numpy().ravel() for name in names])


def _equilibria(
    panels: list[Axes], scene: Scene, theories: list[Theory], factors: tuple[float, ...]
) -> None:
    """Draw JKR's equilibria up to the largest contact, each different curve once."""
    reached: dict[Theory, float] = {}
    for line, theory in zip(scene.lines, theories, strict=True):
        most = np.max(np.nan_to_num(scene.values("contact_radius", line)))
        reached[theory] = max(reached.get(theory, 0.0), most)
    (loads, radii, loaded), (along, force, length) = panels, factors
    for theory, most in reached.items():
        if most > 0.0 and not np.isnan(theory.stiffness):
            # dense at small radii, where the slopes are infinite
            radius = most * np.linspace(0.0, 1.0, _RADII) ** 2
            load, depth = (
                law(radius, *theory[:3])
                for law in (jkr.load_at_radius, jkr.indentation_at_radius)
            )
            displacement = along * (depth + load / theory.stiffness)
            loads.plot(displacement, force * load, "--", **style.GREY)
            radii.plot(
                displacement,
                length * radius,
                "--",
                label="JKR, stable and unstable",
                **style.GREY,
            )
            loaded.plot(force * load, length * radius, "--", **style.GREY)


def _levels(panel: Axes, theories: list[Theory], factor: float) -> None:
    """Draw the loads at which a dead load and fixed grips lose JKR's contact."""
    levels = (
        (1.0, "-.", r"JKR under a dead load, $-3\pi wR/2$"),
        (_GRIPS, ":", r"in fixed grips, $-5\pi wR/6$"),
    )
    for pull in {
        factor * jkr.pull_off_load(*theory[:2])
        for theory in theories
        if theory.work > 0.0
    }:
        for share, dashes, text in levels:
            panel.axhline(share * pull, linestyle=dashes, label=text, **style.GUIDE)


def _labelled(scene: Scene, energies: dict[str, xr.DataArray]) -> list[Line]:
    """Return the curves, each with its energies in its name."""
    labelled = []
    for line in scene.lines:
        known = {
            words: style.number_at(values, line.point)
            for words, values in energies.items()
        }
        parts = [
            f"{words} = {style.rounded(value, 'J')}"
            for words, value in known.items()
            if abs(value) > 0.0
        ]
        label = (
            ": ".join(filter(None, [line.label, ", ".join(parts)]))
            if line.label
            else ""
        )
        labelled.append(line._replace(label=label))
    return labelled
