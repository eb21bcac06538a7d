"""The figure of a loop: load and contact radius over the displacement of what holds the sphere, and the energy lost."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from sim.analysis import control, loop_energy, setting
from sim.analysis.scene import stays_held
from sim.laws import jkr
from sim.plots.curves import Line, Scene, last_closed, line_handles, scene_along, spread_handles
from sim.plots.style import BOTH, REFERENCE, Unit, across, fill, label, legend, rows

#: Radii at which the equilibrium curve is evaluated.
_FINE = 600

#: Load at the fold of fixed grips over that at the fold of a dead load: 5/6 pi w R over 3/2 pi w R.
_GRIPS = 5.0 / 9.0


#: Height of a name, in that of the panel.
_NAME = 0.08


class Held(NamedTuple):
    """How the sphere is held, as far as the dataset tells: ``kind`` is "" where it does not."""

    kind: str
    stiffness: xr.DataArray

    @property
    def symbol(self) -> str:
        """What stands on the axis: the displacement, or the indentation where there is no machine."""
        return r"\Delta" if self.kind in ("displacement", "") else r"\delta"

    @property
    def words(self) -> str:
        names = {"displacement": "displacement", "": "displacement, or indentation,"}
        return f"{names.get(self.kind, 'indentation')} ${self.symbol}$"


class Theory(NamedTuple):
    """JKR's contact at rest as one curve of the figure has it: its equilibria and the loads of its folds."""

    work: float
    sphere_radius: float
    modulus: float
    stiffness: float

    def equilibria(self, largest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Travel [m], load [N] and radius [m] of all equilibria, stable or not, up to a radius [m]."""
        radius = largest * np.linspace(0.0, 1.0, _FINE) ** 2  # dense at small radii, where the slopes are infinite
        load = jkr.load_at_radius(radius, self.work, self.sphere_radius, self.modulus)
        depth = jkr.indentation_at_radius(radius, self.work, self.sphere_radius, self.modulus)
        return depth + load / self.stiffness, load, radius

    @property
    def pull_off(self) -> float:
        """Least load of any equilibrium: -3/2 pi w R [N]."""
        return float(jkr.pull_off_load(self.work, self.sphere_radius))


def needs_course(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which what holds the sphere stays.

    Raises
    ------
    ValueError
        With the cure; also for a file without the displacement.
    """
    if bool(stays_held(dataset).all()):
        cure = '[contact] indentation = { from = "2 um", to = "-12 um", cycles = 1 }'
        raise ValueError(f"what holds the sphere stays the same, so that there is no loop; move it: {cure}")
    if not any(name in dataset for name in ("displacement", "displacement_mean")):
        raise ValueError("the dataset does not hold the displacement; run the scenario again")


def _held(dataset: xr.Dataset) -> Held:
    try:
        found = control(dataset)
    except KeyError:  # the whole table is swept
        return Held("", xr.DataArray(np.nan))
    return Held(found.kind, found.stiffness)


def _theory(dataset: xr.Dataset, held: Held, line: Line) -> Theory:
    """What JKR says of a curve; a machine that a load stands for, or none, yields nothing."""
    work, size = setting(dataset, "adhesion.work"), setting(dataset, "sphere.radius")
    numbers = (work, size, dataset["contact_modulus"], held.stiffness)
    return Theory(*(float(found.isel(line.point, missing_dims="ignore")) for found in numbers))


def loop_figure(dataset: xr.Dataset) -> Figure:
    """Load and contact radius over displacement, or over indentation where there is no machine.

    A line is broken while the contact is open; there the load is a thin line at zero. Grey is JKR's contact at
    the full work of adhesion: every equilibrium, the unstable ones as well, and the loads at which a dead load and
    fixed grips lose it.
    """
    held, scene = _held(dataset), scene_along(dataset, "t")
    displacement = scene.all("displacement_mean")
    unit = Unit.of(displacement, "m")
    scene = scene.placed(unit.factor * displacement)
    theories = [_theory(dataset, held, line) for line in scene.lines]
    entries = _entries(dataset, scene, held)
    figure, (loads, radii) = rows([2.3, 1.6])
    force, length = Unit.of(scene.all("normal_load_mean"), "N"), Unit.of(scene.all("contact_radius_mean"), "m")
    for line in scene.lines:
        _cycle(loads, scene, "normal_load", line, force.factor, held)
        _cycle(radii, scene, "contact_radius", line, length.factor, held)
    known = _equilibria(loads, radii, scene, theories, (unit.factor, force.factor, length.factor))
    _levels(loads, theories, force.factor)
    loads.set_ylabel(label("normal load $P$", force.name))
    radii.set_ylabel(label("contact radius $a$", length.name))
    radii.set_ylim(bottom=0.0)
    loads.legend(
        handles=entries, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2, handletextpad=0.5,
        labelspacing=0.25, title=_title(dataset, held), title_fontsize=7.0, alignment="left",
    )  # fmt: skip
    closing = [*_signs(scene, held, known), *spread_handles(scene, "contact_radius")]
    if closing:
        legend(radii, closing)
    across(radii, scene.x, "linear", held.words, unit.name, 0.03)
    return figure


def _closings(scene: Scene, line: Line) -> np.ndarray:
    """Records at which an open contact has closed."""
    gone = scene.opened(line)
    return np.flatnonzero(gone[:-1] & ~gone[1:]) + 1


def _cycle(panel: Axes, scene: Scene, name: str, line: Line, factor: float, held: Held) -> None:
    """One curve with its jumps: a cross where the contact comes off, a ring where it jumps in."""
    x, gone = scene.x[line.number], scene.opened(line)
    mean, _, low, high = (np.where(gone, np.nan, factor * values) for values in scene.drawn(name, line))
    if np.any(high > low):
        fill(panel, x, low, high, line.colour, 0.18)
    panel.plot(x, mean, color=line.colour)
    if name == "normal_load":
        colour = line.colour if scene.single else REFERENCE  # the open spheres of all curves lie on each other
        panel.plot(x, np.where(gone, 0.0, np.nan), color=colour, linewidth=0.4)
    off, on = last_closed(scene, line), _closings(scene, line)
    if held.kind != "load":  # under a dead load the sphere leaves: no place to draw a jump to
        jumps = np.concatenate([off, on])
        panel.vlines(x[jumps], 0.0, mean[jumps], colors=line.colour, linestyles="dotted", linewidth=0.8)
    marks: Any = {"linestyle": "none", "markersize": 4, "color": line.colour, "zorder": 3}
    panel.plot(x[off], mean[off], marker="x", **marks)
    panel.plot(x[on], mean[on], marker="o", mfc="white", mew=0.8, **marks | {"markersize": 3.5})


def _equilibria(
    loads: Axes, radii: Axes, scene: Scene, theories: list[Theory], factors: tuple[float, float, float]
) -> bool:  # fmt: skip
    """JKR's equilibria, each different curve once, as far as its contacts reached; whether there is any."""
    reached: dict[Theory, float] = {}
    for line, theory in zip(scene.lines, theories, strict=True):
        most = float(np.nanmax(np.nan_to_num(scene.values("contact_radius_mean", line))))
        reached[theory] = max(reached.get(theory, 0.0), most)
    drawn = {theory: most for theory, most in reached.items() if most > 0.0 and not np.isnan(theory.stiffness)}
    for theory, most in drawn.items():
        displacement, load, radius = (f * v for f, v in zip(factors, theory.equilibria(most), strict=True))
        for panel, values in ((loads, load), (radii, radius)):
            panel.plot(displacement, values, "--", color=REFERENCE, linewidth=0.9, zorder=1.5)
    return bool(drawn)


def _levels(panel: Axes, theories: list[Theory], factor: float) -> None:
    """Loads at which a dead load and fixed grips lose JKR's contact, named where they are the same for all curves."""
    pulls = dict.fromkeys(theory.pull_off for theory in theories if theory.pull_off < 0.0)
    for pull in pulls:
        for share in (1.0, _GRIPS):
            panel.axhline(factor * share * pull, color=REFERENCE, linewidth=0.5, zorder=1)
    if len(pulls) != 1:
        return
    (pull,) = pulls
    panel.margins(y=0.1)  # a name stands below the lowest line
    dead, grips = r"$-\frac{3}{2}\pi wR$", r"$-\frac{5}{6}\pi wR$"
    low, high = panel.get_ylim()
    near = -factor * _GRIPS * pull < _NAME * (high - low)
    names = [(1.0, f"{grips}, {dead}", "top")] if near else [(1.0, dead, "top"), (_GRIPS, grips, "bottom")]
    for share, text, side in names:  # on the left, where spheres are open
        panel.annotate(
            text, (0.0, factor * share * pull), (3, 1.5 if side == "bottom" else -1.5), ha="left", va=side,
            xycoords=panel.get_yaxis_transform(), textcoords="offset points", color=REFERENCE, fontsize=7,
        )  # fmt: skip


def _cycles(dataset: xr.Dataset, held: Held) -> xr.DataArray | None:
    """Trips there and back; None where something else is made, they are not known, or a run stopped on the way."""
    try:
        cycles = setting(dataset, f"contact.{held.kind}.cycles")
    except KeyError:
        return None
    radius = dataset["contact_radius" if "contact_radius" in dataset else "contact_radius_mean"]
    whole = bool((cycles >= 1.0).all()) and bool(radius.isel(t=-1).notnull().all())
    return cycles if whole else None


def lost_energy(dataset: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray | None]:
    """Energy that opening and closing dissipate, and the closed integral of load over displacement, per cycle [J].

    Means over the members, with the sweep's dimensions. Where no cycles are made the energy is that of the
    whole run, and there is no integral.
    """
    suffix = "" if "dissipated_energy" in dataset else "_mean"
    spent = dataset[f"dissipated_energy{suffix}"].astype(float)
    known = spent.notnull().cumsum("t").argmax("t")  # the last record of those that stop
    spent = spent.isel(t=known).drop_vars("t")
    spent = spent.mean("member") if "member" in spent.dims else spent
    cycles = _cycles(dataset, _held(dataset))
    if cycles is None:
        return spent, None
    loops = loop_energy(dataset)
    loop = loops["loop_energy" if "loop_energy" in loops else "loop_energy_mean"].mean("cycle")
    return spent / cycles, loop.mean("member") if "member" in loop.dims else loop


def _title(dataset: xr.Dataset, held: Held) -> str:
    if _cycles(dataset, held) is None:
        return "dissipated in all: $W$"
    return "per cycle: dissipated $W$, and the loop enclosed"


def _entries(dataset: xr.Dataset, scene: Scene, held: Held) -> list[Line2D]:
    """Legend entries of the curves, each with its energies."""
    spent, loop = lost_energy(dataset)
    entries, lines = line_handles(scene, "simulated"), {line.label: line for line in scene.lines}
    unit = Unit.of(np.append(spent, [] if loop is None else loop), "J")
    integral = rf"$\oint\,P\,\mathrm{{d}}{held.symbol}$"
    for entry in entries:
        line = scene.lines[0] if scene.single else lines[str(entry.get_label())]
        told = []
        for words, energies in (("$W$", spent), (integral, loop)):
            value = np.nan if energies is None else float(energies.isel(line.point, missing_dims="ignore"))
            told += [f"{words} = {unit.factor * value:.3g} {unit.name}".replace("-", "−")] if np.isfinite(value) else []
        entry.set_label(f"{entry.get_label()}: {', '.join(told)}")
    return entries


def _signs(scene: Scene, held: Held, known: bool) -> list[Line2D]:
    """Legend entries of what is the same for all curves."""
    colour, signs = BOTH if scene.single else REFERENCE, []
    if known:
        signs.append(Line2D([], [], color=REFERENCE, linestyle="--", linewidth=0.9, label="JKR at rest"))
    if any(last_closed(scene, line).size for line in scene.lines):
        signs.append(Line2D([], [], linestyle="none", marker="x", markersize=4, color=colour, label="comes off"))
    if any(_closings(scene, line).size for line in scene.lines):
        ring: Any = {"linestyle": "none", "marker": "o", "markersize": 3.5, "mfc": "white", "mew": 0.8}
        signs.append(Line2D([], [], color=colour, label="jumps in", **ring))
    return signs
