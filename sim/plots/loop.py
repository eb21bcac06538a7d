"""The figure of a loop: load and contact radius over the displacement of what holds the sphere, and the energy lost."""

import contextlib
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import control, loop_energy, setting
from sim.analysis.events import cycles_of
from sim.analysis.scene import stays_held
from sim.laws import jkr
from sim.plots import style
from sim.plots.curves import Line, Scene, beside, colour_bar, mark_jumps, scene_along
from sim.plots.measured import Measured

#: Radii at which the equilibrium curve is evaluated.
_FINE = 600

#: Load at the fold of fixed grips over that at the fold of a dead load: 5/6 pi w R over 3/2 pi w R.
_GRIPS = 5.0 / 9.0

#: Line width of the cycles after the first.
_LATER = 0.6

#: Height of a name, in that of the panel.
_NAME = 0.1

#: Axis of each control, in words and as a symbol; the indentation where no stiffness is between.
_AXES = {"displacement": ("displacement", r"\Delta"), "": ("displacement, or indentation,", r"\Delta")}


class Theory(NamedTuple):
    """JKR's contact at rest as one curve of the figure has it: its equilibria and the loads of its folds."""

    work: float
    sphere_radius: float
    modulus: float
    stiffness: float

    def equilibria(self, largest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacement [m], load [N] and radius [m] of all equilibria, stable or not, up to a radius [m]."""
        radius = largest * np.linspace(0.0, 1.0, _FINE) ** 2  # dense at small radii, where the slopes are infinite
        load, depth = (law(radius, *self[:3]) for law in (jkr.load_at_radius, jkr.indentation_at_radius))
        return depth + load / self.stiffness, load, radius


def needs_course(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which what holds the sphere stays."""
    if bool(stays_held(dataset).all()):
        cure = '[contact] indentation = { from = "2 um", to = "-12 um", cycles = 1 }'
        raise ValueError(f"what holds the sphere stays the same, so that there is no loop; move it: {cure}")


def loop_figure(dataset: xr.Dataset, data: Measured | None = None) -> Figure:
    """Load and contact radius over displacement, energy lost in a cycle, and radius over load.

    A line is broken while the contact is open; there the load is a thin line at zero. Grey is JKR's contact at
    the full work of adhesion: every equilibrium, the unstable ones as well, and the loads at which a dead load and
    fixed grips lose it.
    """
    kind, stiffness, scene = "", xr.DataArray(np.nan), scene_along(dataset, "t")._replace(measured=data)
    with contextlib.suppress(KeyError):  # the whole table [contact] is swept
        kind, stiffness = control(dataset)
    words, symbol = _AXES.get(kind, ("indentation", r"\delta"))
    over = "displacement" if kind in _AXES else "indentation"
    scene = scene.placed(over, scene.all("displacement_mean"), f"{words} ${symbol}$", "m")
    work, size = setting(dataset, "adhesion.work"), setting(dataset, "sphere.radius")
    numbers = (work, size, dataset["contact_modulus"], stiffness)
    theories = [Theory(*(style.number_at(number, line.point) for number in numbers)) for line in scene.lines]
    compared = data is not None and data.has_errors
    figure, panels = style.rows([2.1, 1.5, 1.8] + [0.8] * compared, shared=False)
    loads, radii, loaded, *below = panels
    force = style.in_unit(loads.yaxis, "normal load $P$", scene.all("normal_load_mean"), "N")
    length = style.in_unit(radii.yaxis, "contact radius $a$", scene.all("contact_radius_mean"), "m")
    loaded.set_ylabel(radii.get_ylabel())
    of_load = scene.placed("normal_load", scene.all("normal_load_mean"), "normal load $P$", "N")
    (spent, loop), cycles = lost_energy(dataset), cycles_of(dataset)
    named = scene._replace(lines=_named(scene, symbol, spent, loop))
    for panel, placed, name, factor in (
        (loads, named, "normal_load", force),
        (radii, scene, "contact_radius", length),
        (loaded, of_load, "contact_radius", length),
    ):
        for line in placed.lines:
            _cycle(panel, placed, name, line, factor, kind, style.number_at(cycles, line.point))
        beside(panel, placed, name, factor)
        style.across(panel, placed.reach, placed.words, room=0.03)
    _equilibria(panels[:3], scene, theories, (scene.unit.factor, force, length))
    _levels(loads, theories, force)
    if data:
        along = scene if data.column(over) else of_load
        data.refuse_undrawn(along.over)
        for panel in below:
            data.residual_panel(panel, {line.number for line in along.lines}, along.over)
            style.across(panel, along.reach, along.words, room=0.03)
        style.legend(loaded)
    for panel in (radii, loaded):
        panel.set_ylim(bottom=0.0)
    loads.sharex(radii)
    put_in = (
        rf"$\oint\,P\,\mathrm{{d}}{symbol}$ put in, the area of the loop with each jump a straight line between records"
    )
    cycled = f"per cycle: $W$ dissipated by opening and closing; {put_in}"
    lost = "dissipated in all: $W$" if loop is None else cycled
    style.legend(loads, lost if bool((spent != 0.0).any()) else scene.title, columns=1)
    style.legend(radii)
    colour_bar(figure, panels, scene)
    return figure


def _cycle(panel: Axes, scene: Scene, name: str, line: Line, factor: float, kind: str, cycles: float) -> None:
    """One curve with its jumps: a cross at each pull-off, a ring at each jump-in; thin after its first cycle."""
    x, gone, loads = scene.x[line.number], scene.opened(line), name == "normal_load"
    mean, _, low, high = (np.where(gone, np.nan, factor * values) for values in scene.drawn(name, line))
    along_load = scene.over == "normal_load"
    if np.any(high > low) and not along_load:  # where the members' loads differ a band over their mean says nothing
        style.fill(panel, x, low, high, color=line.colour, alpha=0.18, label="" if loads else scene.spread)
    first = int(np.ceil(len(x) / max(cycles, 1.0)))
    panel.plot(x[:first], mean[:first], color=line.colour, label=line.label if loads else "")
    if first < len(x):
        later: Any = {"linewidth": _LATER, "label": "" if loads else "later cycles"}
        panel.plot(x[first - 1 :], mean[first - 1 :], color=line.colour, **later)
    if loads:
        colour = line.colour if scene.single else style.REFERENCE  # the open spheres of all curves lie on each other
        panel.plot(x, np.where(gone, 0.0, np.nan), color=colour, linewidth=0.4)
    if kind != "load" and not along_load:  # under a dead load the sphere leaves: no place to draw a jump to
        jumps = np.concatenate(scene.openings(line))
        panel.vlines(x[jumps], 0.0, mean[jumps], colors=line.colour, linestyles="dotted", linewidth=0.8)
    mark_jumps(panel, scene, name, line, factor, named=not loads)


def _equilibria(panels: list[Axes], scene: Scene, theories: list[Theory], factors: tuple[float, ...]) -> None:
    """JKR's equilibria, each different curve once, as far as its contacts reached."""
    reached: dict[Theory, float] = {}
    for line, theory in zip(scene.lines, theories, strict=True):
        most = float(np.nanmax(np.nan_to_num(scene.values("contact_radius_mean", line))))
        reached[theory] = max(reached.get(theory, 0.0), most)
    loads, radii, loaded = panels
    for theory, most in reached.items():
        if most > 0.0 and not np.isnan(theory.stiffness):
            x, load, radius = (f * v for f, v in zip(factors, theory.equilibria(most), strict=True))
            loads.plot(x, load, "--", **style.GREY)
            radii.plot(x, radius, "--", label="JKR, stable and unstable", **style.GREY)
            loaded.plot(load, radius, "--", **style.GREY)


def _levels(panel: Axes, theories: list[Theory], factor: float) -> None:
    """Loads at which a dead load and fixed grips lose JKR's contact, named where they are the same for all curves."""
    pulls = {factor * float(jkr.pull_off_load(*theory[:2])) for theory in theories if theory.work > 0.0}
    for pull in pulls:
        for share in (1.0, _GRIPS):
            panel.axhline(share * pull, **style.GUIDE)
    if len(pulls) != 1:
        return
    (pull,) = pulls
    panel.margins(y=0.15)  # a name stands below the lowest line
    dead, grips = r"$-\frac{3}{2}\pi wR$", r"$-\frac{5}{6}\pi wR$"
    low, high = panel.get_ylim()
    near = -_GRIPS * pull < _NAME * (high - low)
    names = [(1.0, f"{grips}, {dead}", "top")] if near else [(1.0, dead, "top"), (_GRIPS, grips, "bottom")]
    look: Any = {"textcoords": "offset points", "ha": "left", "color": style.REFERENCE, "fontsize": 7}
    for share, text, side in names:  # on the left, where spheres are open
        at, off = (0.0, share * pull), (3, 1.5 if side == "bottom" else -1.5)
        panel.annotate(text, at, off, va=side, xycoords=panel.get_yaxis_transform(), **look)


def lost_energy(dataset: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray | None]:
    """Energy that opening and closing dissipate, and the closed integral of load over displacement, per cycle [J].

    Means over the members, with the sweep's dimensions. Where no cycles are made, or a run stopped on the way, the
    energy is that of the whole run, and there is no integral.
    """
    spent = style.recorded(dataset, "dissipated_energy")
    spent = spent.isel(t=spent.notnull().cumsum("t").argmax("t")).drop_vars("t")  # the last record of those that stop
    spent = spent.mean("member") if "member" in spent.dims else spent
    cycles = cycles_of(dataset)
    whole = bool(style.recorded(dataset, "contact_radius").isel(t=-1).notnull().all())
    if not whole or not bool((cycles >= 1.0).all()):
        return spent, None
    return spent / cycles, style.mean_of(loop_energy(dataset), "loop_energy").mean("cycle")


def _named(scene: Scene, symbol: str, spent: xr.DataArray, loop: xr.DataArray | None) -> list[Line]:
    """The curves, each named with its energies."""
    energies = {"$W$": spent} | ({} if loop is None else {rf"$\oint\,P\,\mathrm{{d}}{symbol}$": loop})
    unit = style.Unit.of(np.concatenate([np.ravel(values) for values in energies.values()]), "J")
    named = []
    for line in scene.lines:
        known = {words: unit.factor * style.number_at(values, line.point) for words, values in energies.items()}
        known = {words: value for words, value in known.items() if value != 0.0}
        parts = [f"{words} = {value:.3g} {unit.name}" for words, value in known.items() if np.isfinite(value)]
        label = ": ".join(filter(None, [line.label, ", ".join(parts).replace("-", "−")])) if line.label else ""
        named.append(line._replace(label=label))
    return named
