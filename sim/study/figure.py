"""The figure of ``sim converge``: largest error of each setting against the time of the run."""

from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox

from sim.plots.style import BONDS, FLUCTUATIONS, LINES, REFERENCE, STYLE, legend, plain_ticks, rows
from sim.study.verdicts import PARTS, choices, chosen

#: The least error that has a place of its own; exact settings stand a decade below the least of the others.
_LEAST = 1e-8

#: Colour and marker of what a setting changes.
_LOOKS = {"shear": (FLUCTUATIONS, "o"), "bonds": (BONDS, "s"), "grid": (LINES[4], "P"), "step": (LINES[3], "^")}
#: Where a label may stand, in points from its marker.
_PLACES = (
    (5, 0, "left"), (-5, 0, "right"), (0, 6, "center"), (0, -7, "center"), (5, 6, "left"), (5, -7, "left"),
    (-5, 6, "right"), (-5, -7, "right"), (0, 13, "center"), (0, -14, "center"),
)  # fmt: skip


def figure(dataset: xr.Dataset) -> Figure:
    """Largest error of each setting against CPU time of the run, in the width of a column.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim.study.converge.converge`` gives it.

    Returns
    -------
    Figure
        One marker a setting with the range of its times, a ring around those of the scene, a star for the combination
        that is recommended. Labels that would lie on others are left out.
    """
    with mpl.rc_context(STYLE):
        drawn, (panel,) = rows([3.0])
        part, error = dataset["part"].to_numpy(), np.nan_to_num(dataset["error"].to_numpy()).max(axis=(1, 2))
        best = chosen(choices(dataset), float(dataset.attrs["tolerance"]))[0]
        shown = np.append(error, [best.off, dataset.attrs["tolerance"]])
        floor = max(0.1 * shown[shown > _LEAST].min(), _LEAST)
        height, time = np.maximum(error, floor), dataset["time"].to_numpy()
        off = [time - dataset["time_low"].to_numpy(), dataset["time_high"].to_numpy() - time]
        for name, (colour, marker) in _LOOKS.items():
            here = part == name
            style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 3.6, "linewidth": 0.6}
            panel.errorbar(time[here], height[here], xerr=np.array(off)[:, here], elinewidth=0.6, **style)
        own = dataset["own"].to_numpy() == 1
        panel.plot(time[own], height[own], "o", color="none", markeredgecolor="black", markersize=7.5)
        panel.plot([best.time], [max(best.off, floor)], "*", color="black", markersize=7.0, zorder=5)
        panel.axhline(float(dataset.attrs["tolerance"]), color=REFERENCE, linestyle="--", linewidth=0.8)
        panel.set(xscale="log", yscale="log", xlabel="CPU time of the run (s)", ylabel="largest error")
        panel.set_ylim(0.4 * floor, 2.5 * max(height.max(), float(dataset.attrs["tolerance"])))
        panel.margins(x=0.15)
        panel.yaxis.set_major_formatter(lambda y, _: "exact" if y <= 1.5 * floor else f"$10^{{{round(np.log10(y))}}}$")
        if np.ptp(np.log10(panel.get_xlim())) < 1.5:
            plain_ticks(panel.xaxis)
        legend(panel, handles=_handles([name for name in _LOOKS if name in part]))
        ends = np.stack([dataset["time_low"].to_numpy(), height, dataset["time_high"].to_numpy(), height], axis=1)
        _label(panel, dataset["row"].to_numpy(), np.stack([time, height], axis=1), ends, part, own)
    return drawn


def _label(panel: Axes, names: Any, points: Any, ends: Any, part: Any, own: Any) -> None:
    """Names beside their markers, the scene's own first, each at the first place that is free."""
    canvas: Any = panel.figure.canvas
    canvas.draw()
    renderer = canvas.get_renderer()
    pixels = panel.transData.transform(points)
    taken = [Bbox.from_bounds(x - 6.0, y - 6.0, 12.0, 12.0) for x, y in pixels]
    taken += [Bbox(panel.transData.transform(row.reshape(2, 2)) + [[0.0, -2.0], [0.0, 2.0]]) for row in ends]
    for row in sorted(range(len(names)), key=lambda row: not own[row]):
        look: Any = {"textcoords": "offset points", "va": "center", "fontsize": 6, "color": _LOOKS[part[row]][0]}
        for right, up, side in _PLACES:
            text = panel.annotate(str(names[row]), points[row], (right, up), ha=side, **look)
            box = text.get_window_extent(renderer)
            inside = panel.bbox.containsx(box.x0) and panel.bbox.containsx(box.x1) and panel.bbox.containsy(box.y0)
            if inside and panel.bbox.containsy(box.y1) and not any(box.overlaps(other) for other in taken):
                taken.append(box)
                break
            text.remove()


def _handles(names: list[str]) -> list[Line2D]:
    look: dict[str, Any] = {"markersize": 3.6, "linewidth": 0.6}
    handles = [Line2D([], [], color=_LOOKS[n][0], marker=_LOOKS[n][1], label=PARTS[n], **look) for n in names]
    alone: Any = {"linestyle": "none", "color": "black"}
    handles.append(Line2D([], [], marker="o", markerfacecolor="none", markersize=6.0, label="as written", **alone))
    handles.append(Line2D([], [], marker="*", markersize=6.0, label="recommended", **alone))
    handles.append(Line2D([], [], color=REFERENCE, linestyle="--", linewidth=0.8, label="accepted"))
    return handles
