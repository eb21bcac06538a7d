"""The figure of ``sim converge``: error against time, what was known beforehand beside what was measured."""

from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter

from sim.plots.style import LINES, REFERENCE, STYLE, legend, plain_ticks, rows
from sim.study.verdicts import cost

#: Errors below this are drawn at it, with an arrow: the closed forms are not exact to more.
_FLOOR = 1e-4

#: The same for bonds.
_LEAST = 1e-8

#: Decades between two labels.
_GAP = 0.22

_COLOURS = dict(zip(("mean", "banded", "modal", "mapped", "clock step", "grid"), (
    REFERENCE, LINES[1], LINES[0], LINES[6], LINES[2], LINES[3]), strict=True))  # fmt: skip
_MARKERS = {"mean": "D", "banded": "o", "modal": "s", "mapped": "v", "clock step": "^", "grid": "P"}
_PANELS = ((r"error of $\Delta\Gamma$", 0), ("error of the radius $a$", 1))


class _Point(NamedTuple):
    """One row in one panel: where its known error is largest, known and measured; nan where there is none."""

    cost: float
    known: float
    error: float
    sem: float


def figure(dataset: xr.Dataset) -> Figure:
    """Error against CPU time per member-step, one line a depth, in the width of a column.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.converge.converge`` gives it.

    Returns
    -------
    Figure
        For ΔΓ and for the radius the statistic whose error is known to be largest, of each setting:
        open what is known beforehand, filled what was measured with its standard error; where sampling
        cannot tell it from zero, an arrow hangs from two standard errors above it. Numbers are the
        tolerances of bands and the multiples of the clock step.
    """
    with mpl.rc_context(STYLE):
        panels = [panel for panel in _PANELS if _tells(dataset, panel[1])]
        bonds = [1.9] * ("bonds_error" in dataset)
        drawn, axes = rows([1.9] * max(len(panels), 1) + bonds)
        if bonds:
            _draw_bonds(axes.pop(), dataset)
        lines = [str(line) for line in dict.fromkeys(dataset["line"].to_numpy())]
        for panel, (words, quantity) in zip(axes, panels or _PANELS[1:], strict=True):
            panel.set_xscale("log")
            panel.set_yscale("log")
            for line in lines:
                _draw_line(panel, dataset, line, quantity)
            panel.axhline(float(dataset.attrs["asked_tolerance"]), color=REFERENCE, linestyle="--", linewidth=0.8)
            panel.set_ylim(0.6 * _FLOOR, max(3.0, 1.5 * panel.get_ylim()[1]))
            panel.margins(x=0.12)
            if np.ptp(np.log10(panel.get_xlim())) < 1.5:
                plain_ticks(panel.xaxis)
            panel.yaxis.set_major_formatter(FuncFormatter(_decade))
            panel.set_ylabel(words)
        drawn.axes[-1].set_xlabel("CPU time per member-step of the scene (µs)")
        legend(axes[0], handles=_handles(lines))
    return drawn


_BOND_DEPTHS = {"steady": ("D", 4), "rate": ("s", 0), "cohort": ("o", 1), "counted": ("v", 2), "tracked": ("v", 2)}


def _draw_bonds(panel: Axes, dataset: xr.Dataset) -> None:
    """Errors of the bonds' stress, or of their fraction: of the mean without sites, else the noise of a member.

    Those below 1e-8 are drawn at it.
    """
    which = 0 if np.any(np.isfinite(dataset["bonds_error"].to_numpy()[:, 0])) else 1
    paid, sites = 1e6 * dataset["bonds_cpu_time"].to_numpy(), dataset["bonds_sites"].to_numpy()
    error = np.abs(dataset["bonds_error"].to_numpy()[:, which])
    error = np.where(sites > 0, dataset["bonds_noise"].to_numpy()[:, which], error)
    model, step = dataset["bonds_model"].to_numpy(), dataset["bonds_finer"].to_numpy() > 1
    panel.set_xscale("log")
    panel.set_yscale("log")
    for name in dict.fromkeys(model):
        marker, colour = _BOND_DEPTHS[name]
        told = (model == name) & ~step & np.isfinite(error) & np.isfinite(paid)
        words = f"{name}, noise of a member" if np.any(sites[told]) else name
        panel.plot(
            paid[told], np.maximum(error[told], _LEAST), marker, linestyle="-", linewidth=0.8, markersize=3.6,
            color=LINES[colour], label=words,
        )  # fmt: skip
    panel.axhline(float(dataset.attrs["bonds_tolerance_asked"]), color=REFERENCE, linestyle="--", linewidth=0.8)
    panel.set_ylabel("error of the bonds' " + ("stress" if which == 0 else "fraction"))
    legend(panel)


def _tells(dataset: xr.Dataset, quantity: int) -> bool:
    """Whether any row errs in a quantity."""
    known, error = (dataset[name].to_numpy()[:, :, quantity] for name in ("known_error", "error"))
    return bool(np.any(np.nan_to_num(known)) or np.any(np.nan_to_num(error)))


def _decade(value: float, _: int) -> str:
    """A power of ten; the lowest stands for all that is below it."""
    sign = r"\leq" if value <= 1.01 * _FLOOR else ""
    return f"${sign}10^{{{round(np.log10(value))}}}$"


def _draw_line(panel: Axes, dataset: xr.Dataset, line: str, quantity: int) -> None:
    colour, marker = _COLOURS.get(line, LINES[4]), _MARKERS.get(line, "o")
    rows = np.flatnonzero(dataset["line"].to_numpy() == line)
    points = [_point(dataset, int(row), quantity) for row in rows]
    known = [p for p in points if np.isfinite(p.known)]
    x, y = np.array([p.cost for p in known]), np.array([max(abs(p.known), _FLOOR) for p in known])
    panel.plot(x, y, "-", color=colour, linewidth=0.8, alpha=0.6, zorder=2)
    shown: dict[str, Any] = {"linestyle": "none", "color": colour, "marker": marker, "markeredgewidth": 0.9}
    panel.plot(x, y, markerfacecolor="white", markersize=5.0, zorder=3, **shown)
    for point in points:
        panel.plot([point.cost], [_FLOOR], alpha=0.0)  # the axes hold every row
        _draw_measured(panel, point, shown | {"markersize": 2.6})
    if line == "banded":
        _name(panel, points, [f"{value:g}" for value in dataset["tolerance"].to_numpy()[rows]], colour)
    if line == "clock step":
        multiples = dataset["clock_step"].to_numpy()[rows] / dataset.attrs["clock_step"]
        for point, multiple in list(zip(points, multiples, strict=True))[:: max(len(points) - 1, 1)]:
            place = (point.cost, max(abs(point.known), _FLOOR))
            if np.isfinite(point.known):
                panel.annotate(
                    f"×{multiple:g}", place, (0, 4), textcoords="offset points", ha="center", fontsize=6, color=colour
                )


def _name(panel: Axes, points: list[_Point], texts: list[str], colour: str) -> None:
    """Labels in a column left of a line, moved apart where they would lie on each other, each with a thin leader."""
    named = sorted((max(abs(p.known), _FLOOR), p.cost, text) for p, text in zip(points, texts, strict=True)
                   if np.isfinite(p.known))  # fmt: skip
    if not named:
        return
    if named[-1][0] < 2.0 * named[0][0]:  # one label for points that lie together
        named = [(named[0][0], min(x for _, x, _ in named), f"{texts[0]} to {texts[-1]}")]
    wanted = np.log10([y for y, _, _ in named])
    rank = _GAP * np.arange(len(named))
    places = np.maximum.accumulate(wanted - rank) + rank
    places -= np.mean(places - wanted)
    column = min(x for _, x, _ in named) / 1.5
    panel.plot([0.7 * column], [_FLOOR], alpha=0.0)  # room for the labels
    for (y, x, text), place in zip(named, places, strict=True):
        panel.annotate(
            text, (x, y), (column, 10.0**place), fontsize=6, color=colour, va="center", ha="right",
            arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.3, "shrinkA": 0.0, "shrinkB": 2.0}, zorder=1,
        )  # fmt: skip


def _draw_measured(panel: Axes, point: _Point, shown: dict[str, Any]) -> None:
    """A measured error with its standard error, or the bound that sampling sets."""
    size = abs(point.error)
    if not np.isfinite(size):
        return
    if size > 2.0 * point.sem or not point.sem > 0.0:
        low = min(point.sem, 0.95 * size)
        panel.plot([point.cost], [max(size, _FLOOR)], zorder=5, **shown)
        if point.sem > 0.0:
            panel.errorbar(
                [point.cost], [max(size, _FLOOR)], [[low], [point.sem]], fmt="none", ecolor=shown["color"],
                elinewidth=0.8, capsize=1.5, zorder=4,
            )  # fmt: skip
        return
    top = size + 2.0 * point.sem
    arrow = {"arrowstyle": "-|>", "linewidth": 0.8, "mutation_scale": 5.0, "shrinkA": 0.0, "shrinkB": 0.0}
    panel.annotate(
        "",
        (point.cost, top / 2.2),
        (point.cost, top),
        annotation_clip=True,
        arrowprops=arrow | {"color": shown["color"]},
    )
    panel.plot([point.cost], [top], marker="_", color=shown["color"], markersize=5.0, zorder=4)


def _point(dataset: xr.Dataset, row: int, quantity: int) -> _Point:
    """The statistic of a row whose error is known to be largest, where none is known the one measured largest."""
    known, error, sem = (
        dataset[name].to_numpy()[row, :, quantity] for name in ("known_error", "error", "standard_error")
    )
    by = np.abs(known) if np.any(np.isfinite(known)) else np.abs(error)
    paid = 1e6 * float(cost(dataset)[row])
    if not np.any(np.isfinite(by)):
        return _Point(paid, np.nan, np.nan, np.nan)
    place = np.unravel_index(int(np.nanargmax(by)), by.shape)
    return _Point(paid, float(known[place]), float(error[place]), float(sem[place]))


def _handles(lines: list[str]) -> list[Line2D]:
    handles = [
        Line2D([], [], color=_COLOURS.get(line, LINES[4]), marker=_MARKERS.get(line, "o"), markersize=3.6, label=line)
        for line in lines
    ]
    black: Any = {"color": "black", "linestyle": "none", "marker": "o", "markersize": 4.0}
    handles.append(Line2D([], [], **black, markerfacecolor="white", label="known before"))
    handles.append(Line2D([], [], **black, label="measured"))
    handles.append(Line2D([], [], color="black", linestyle="none", marker=r"$\downarrow$", label="not separated"))
    handles.append(Line2D([], [], color=REFERENCE, linestyle="--", linewidth=0.8, label="tolerance"))
    return handles
