"""The figure of a loop: load and contact radius over the displacement of what holds the sphere, and the energy lost."""

from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import control, loop_energy, setting
from sim.analysis.scene import stays_held
from sim.laws import jkr
from sim.plots.curves import Line, Scene, colour_bar, mark_jumps, scene_along
from sim.plots.style import REFERENCE, Unit, across, fill, legend, mean_of, recorded, rows

#: Radii at which the equilibrium curve is evaluated.
_FINE = 600

#: Load at the fold of fixed grips over that at the fold of a dead load: 5/6 pi w R over 3/2 pi w R.
_GRIPS = 5.0 / 9.0


#: Height of a name, in that of the panel.
_NAME = 0.08


class Held(NamedTuple):
    """Control of the sphere; ``kind`` is "" where the whole table [contact] is swept."""

    kind: str
    stiffness: xr.DataArray

    @property
    def symbol(self) -> str:
        """Symbol of the axis: the displacement, or the indentation where no stiffness is between."""
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
        """Displacement [m], load [N] and radius [m] of all equilibria, stable or not, up to a radius [m]."""
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
    """JKR's contact for a curve; behind an infinite stiffness at a load or an indentation."""
    work, size = setting(dataset, "adhesion.work"), setting(dataset, "sphere.radius")
    numbers = (work, size, dataset["contact_modulus"], held.stiffness)
    return Theory(*(float(found.isel(line.point, missing_dims="ignore")) for found in numbers))


def loop_figure(dataset: xr.Dataset) -> Figure:
    """Load and contact radius over displacement or indentation, and the energy lost in a cycle.

    A line is broken while the contact is open; there the load is a thin line at zero. Grey is JKR's contact at
    the full work of adhesion: every equilibrium, the unstable ones as well, and the loads at which a dead load and
    fixed grips lose it.
    """
    held, scene = _held(dataset), scene_along(dataset, "t")
    displacement = scene.all("displacement_mean")
    unit = Unit.of(displacement, "m")
    scene = scene.placed(unit.factor * displacement)
    theories = [_theory(dataset, held, line) for line in scene.lines]
    named = scene._replace(lines=_named(dataset, scene, held))
    figure, (loads, radii) = rows([2.3, 1.6])
    force, length = Unit.of(scene.all("normal_load_mean"), "N"), Unit.of(scene.all("contact_radius_mean"), "m")
    for panel, shown, name, factor in (
        (loads, named, "normal_load", force.factor), (radii, scene, "contact_radius", length.factor)
    ):  # fmt: skip
        for line in shown.lines:
            _cycle(panel, shown, name, line, factor, held)
    _equilibria(loads, radii, scene, theories, (unit.factor, force.factor, length.factor))
    _levels(loads, theories, force.factor)
    loads.set_ylabel(force.label("normal load $P$"))
    radii.set_ylabel(length.label("contact radius $a$"))
    radii.set_ylim(bottom=0.0)
    cycled = "per cycle: dissipated $W$, and the loop enclosed, each jump a straight line between records"
    legend(loads, "dissipated in all: $W$" if _cycles(dataset, held) is None else cycled, columns=1)
    legend(radii)
    colour_bar(figure, [loads, radii], scene)
    across(radii, scene.x, "linear", unit.label(held.words), 0.03)
    return figure


def _cycle(panel: Axes, scene: Scene, name: str, line: Line, factor: float, held: Held) -> None:
    """One curve with its jumps: a cross at each pull-off, a ring at each jump-in."""
    x, gone, loads = scene.x[line.number], scene.opened(line), name == "normal_load"
    mean, _, low, high = (np.where(gone, np.nan, factor * values) for values in scene.drawn(name, line))
    if np.any(high > low):
        fill(panel, x, low, high, color=line.colour, alpha=0.18, label="" if loads else scene.spread)
    panel.plot(x, mean, color=line.colour, label=line.label if loads else "")
    if loads:
        colour = line.colour if scene.single else REFERENCE  # the open spheres of all curves lie on each other
        panel.plot(x, np.where(gone, 0.0, np.nan), color=colour, linewidth=0.4)
    if held.kind != "load":  # under a dead load the sphere leaves: no place to draw a jump to
        jumps = np.concatenate([scene.pulled_off(line), scene.jumped_in(line)])
        panel.vlines(x[jumps], 0.0, mean[jumps], colors=line.colour, linestyles="dotted", linewidth=0.8)
    mark_jumps(panel, scene, name, line, factor, named=not loads)


def _equilibria(
    loads: Axes, radii: Axes, scene: Scene, theories: list[Theory], factors: tuple[float, float, float]
) -> None:
    """JKR's equilibria, each different curve once, as far as its contacts reached."""
    reached: dict[Theory, float] = {}
    for line, theory in zip(scene.lines, theories, strict=True):
        most = float(np.nanmax(np.nan_to_num(scene.values("contact_radius_mean", line))))
        reached[theory] = max(reached.get(theory, 0.0), most)
    for theory, most in reached.items():
        if most > 0.0 and not np.isnan(theory.stiffness):
            x, load, radius = (f * v for f, v in zip(factors, theory.equilibria(most), strict=True))
            for panel, values, words in ((loads, load, ""), (radii, radius, "JKR, stable and unstable")):
                panel.plot(x, values, "--", color=REFERENCE, linewidth=0.9, zorder=1.5, label=words)


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
    """Cycles there and back; None without any, where they are not known, or where a run stopped on the way."""
    try:
        cycles = setting(dataset, f"contact.{held.kind}.cycles")
    except KeyError:
        return None
    radius = recorded(dataset, "contact_radius")
    whole = bool((cycles >= 1.0).all()) and bool(radius.isel(t=-1).notnull().all())
    return cycles if whole else None


def lost_energy(dataset: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray | None]:
    """Energy that opening and closing dissipate, and the closed integral of load over displacement, per cycle [J].

    Means over the members, with the sweep's dimensions. Where no cycles are made the energy is that of the
    whole run, and there is no integral.
    """
    spent = recorded(dataset, "dissipated_energy")
    known = spent.notnull().cumsum("t").argmax("t")  # the last record of those that stop
    spent = spent.isel(t=known).drop_vars("t")
    spent = spent.mean("member") if "member" in spent.dims else spent
    cycles = _cycles(dataset, _held(dataset))
    if cycles is None:
        return spent, None
    loops = loop_energy(dataset)
    return spent / cycles, mean_of(loops, "loop_energy").mean("cycle")


def _named(dataset: xr.Dataset, scene: Scene, held: Held) -> list[Line]:
    """The curves, each named with its energies."""
    spent, loop = lost_energy(dataset)
    unit = Unit.of(np.append(spent, [] if loop is None else loop), "J")
    named = []
    for line in scene.lines:
        parts = []
        for words, energies in (("$W$", spent), (rf"$\oint P\,\mathrm{{d}}{held.symbol}$", loop)):
            value = np.nan if energies is None else float(energies.isel(line.point, missing_dims="ignore"))
            if np.isfinite(value):
                parts.append(f"{words} = {unit.factor * value:.3g} {unit.name}".replace("-", "−"))
        named.append(line._replace(label=f"{line.label}: {', '.join(parts)}" if line.label else ""))
    return named
