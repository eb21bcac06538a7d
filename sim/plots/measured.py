"""Measured points over the curves of a dataset, from a CSV table, and how far the curves are from them."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from sim.analysis import sweep_dims
from sim.analysis.scene import plain
from sim.plots.style import BOTH, GUIDE, HOLLOW, legend
from sim.units.quantity import Quantity
from sim.units.tables import Points, measured_points, read_measured

#: Names of what is prescribed and of what is recorded of it.
_SAME = (("speed", "drive_speed"), *((name, f"contact_{name}") for name in ("indentation", "displacement")))
_SAME += (("normal_load", "contact_load"),)
#: What is measured by another column: the power of it, and the factor.
_BY = {"contact_radius": ("contact_area", 0.5, np.pi**-0.5), "contact_area": ("contact_radius", 2.0, np.pi)}
#: How far a condition of a row may be from that of a curve, in parts of it.
_NEAR = 5e-3
#: Errors by which branches of a curve that goes there and back are apart at least.
_ALIKE = 0.01
_MARKS = "osD^v"


class Compared(NamedTuple):
    """A curve that points may lie on: its number, point of the sweep and colour; over x in the unit of the axis the
    mean and its standard error in that of the other, and JKR's area at the full work of adhesion [m^2].
    """

    number: int
    point: dict[str, int]
    colour: str
    x: np.ndarray
    mean: np.ndarray
    error: np.ndarray
    full: np.ndarray

    def at(self, x: np.ndarray, *along: np.ndarray) -> list[np.ndarray]:
        """Values along each branch of the curve at other places, shape (branches, places), nan beyond its ends.

        A branch goes one way from turn to turn.
        """
        way = np.sign(np.diff(self.x))
        ends = np.flatnonzero(np.diff(way)) + 1
        branches = [slice(a, b + 1) for a, b in itertools.pairwise([0, *ends, len(way)]) if way[a] != 0.0]
        found = [[np.full(x.shape, np.nan)] for _ in along]
        for branch in branches:
            order = np.argsort(self.x[branch])
            for kept, values in zip(found, along, strict=True):
                kept.append(np.interp(x, self.x[branch][order], values[branch][order], np.nan, np.nan))
        return [np.array(kept[1:] or kept) for kept in found]


class Residuals(NamedTuple):
    """How far points are from a curve, in standard errors of both: variables over and of it, number, colour and point.

    Of a curve of several ``branches``, there and back, it is the nearest of them: less than the errors would leave.
    Branches that are nowhere a hundredth of an error apart count as one.
    """

    over: str
    name: str
    number: int
    colour: str
    x: np.ndarray
    values: np.ndarray
    point: dict[str, int]
    branches: int


class Measured:
    """A table of measured points, a CSV or columns in SI by name, and what of it a figure has drawn.

    Its columns are variables of a dataset with their units and errors, as those of ``sim fit``. A column that is a
    number of the scenario, such as ``contact_load``, says of which curve of a sweep a row is.
    """

    def __init__(self, data: Path | str | Mapping[str, Any], dataset: xr.Dataset) -> None:
        self.dataset = plain(dataset)
        self.sweep = {*sweep_dims(dataset)}
        known = {name: Quantity(units, name) for name, units in self._units().items()}
        self.named = str(data) if isinstance(data, Path | str) else "data"
        self.table = (
            read_measured(Path(data), known, known) if isinstance(data, Path | str) else measured_points(data, known)
        )
        self.shown: set[str] = set()
        self.residuals: list[Residuals] = []

    def _units(self) -> dict[str, str]:
        """Units of all numbers of the dataset that may be measured, by name."""
        numbers = ((str(name), one) for name, one in self.dataset.variables.items() if one.dtype.kind == "f")
        found = {name.removesuffix("_mean"): one.attrs["units"] for name, one in numbers if "units" in one.attrs}
        return found | {"area_ratio": "1", "contact_radius": "m", "contact_area": "m^2", "speed": "m/s", "t": "s"}

    @property
    def has_errors(self) -> bool:
        return any(points.errors is not None for points in self.table.values())

    def column(self, name: str) -> Points | None:
        """A column by any of the names of its variable."""
        same = next((names for names in _SAME if name in names), (name,))
        return next((self.table[one] for one in (name, *same) if one in self.table), None)

    def _of(self, point: dict[str, int], over: str) -> np.ndarray:
        """True for the rows whose conditions are those of a point of the sweep."""
        rows = np.ones(len(next(iter(self.table.values())).values), bool)
        for name, points in self.table.items():
            same = next((names for names in _SAME if name in names), (name,))
            numbers = [self.dataset[one] for one in same if one in self.dataset.variables]
            numbers = [number for number in numbers if {*number.dims} <= self.sweep and over not in same]
            for number in numbers:
                value = float(number.isel(point, missing_dims="ignore"))
                rows &= np.abs(points.values - value) <= _NEAR * abs(value)
        return rows

    def _values(self, name: str, curve: Compared, x: np.ndarray) -> Points | None:
        """What was measured of a variable, or what follows of it from another column, at places on the x axis."""
        if (found := self.column(name)) is not None:
            return found
        if name == "area_ratio" and (area := self._values("contact_area", curve, x)) is not None:
            (branches,) = curve.at(x, curve.full)
            several = np.full(x.shape, np.nan) if len(branches) > 1 else branches[0]
            full = curve.full[0] if np.ptp(curve.full) == 0.0 else several
            return Points(area.values / full, None if area.errors is None else area.errors / full)
        by, power, factor = _BY.get(name, ("", 1.0, 1.0))
        if by not in self.table:
            return None
        source, errors = self.table[by]
        values = factor * source**power
        return Points(values, None if errors is None else power * np.abs(values / source) * errors)

    def draw(
        self, panel: Axes, over: tuple[str, float], shown: tuple[str, float], curves: Sequence[Compared], log: bool
    ) -> None:
        """Points in a panel of a variable over another, each with its factor from SI, beside the curves there."""
        across, (name, factor) = self.column(over[0]), shown
        if across is None:
            return
        x, wide = (None if values is None else over[1] * values for values in across)
        assert x is not None
        told = any(name in self.table for name in self.sweep)
        for curve in curves if told else curves[:1]:
            points, rows = self._values(name, curve, x), self._of(curve.point, over[0])
            if points is None or not np.any(rows):
                continue
            y, high = factor * points.values[rows], None if points.errors is None else factor * points.errors[rows]
            words = ["measured"]
            if high is not None and (told or len(curves) == 1):
                placed = curve._replace(x=np.log(curve.x)) if log else curve
                at = np.log(x[rows]) if log else x[rows]
                means, errors = placed.at(at, curve.mean, curve.error)
                branches = (y - means) / np.hypot(high, np.nan_to_num(errors))
                nearest = np.argmin(np.nan_to_num(np.abs(branches), nan=np.inf), axis=0)
                off = np.take_along_axis(branches, nearest[np.newaxis], 0)[0]
                known = np.isfinite(off)
                if np.any(known):
                    apart = np.nanmax(branches[:, known], axis=0) - np.nanmin(branches[:, known], axis=0)
                    several = len(branches) if np.max(apart) > _ALIKE else 1
                    colour = curve.colour if told else BOTH
                    own = over[0], name, curve.number, colour, x[rows], off, curve.point, several
                    self.residuals.append(Residuals(*own))
                    words.append(rf"$\chi^2$ = {np.sum(off[known] ** 2):.4g} of {np.sum(known)}")
                    words[-1] += " (nearest branch)" * (several > 1)
            look: Any = HOLLOW | {"color": curve.colour if told else BOTH, "elinewidth": 0.7, "zorder": 3}
            side = None if wide is None else wide[rows]
            panel.errorbar(x[rows], y, high, side, label=", ".join(words), **look)
            self.shown.add(name)

    def residual_panel(self, panel: Axes, numbers: set[int], over: str) -> None:
        """How far the points are from curves of some numbers over a variable, in standard errors."""
        own = [one for one in self.residuals if one.number in numbers and one.over == over]
        names = list(dict.fromkeys(one.name for one in own))
        for one in own:
            look = HOLLOW | {"marker": _MARKS[names.index(one.name) % len(_MARKS)], "color": one.colour}
            panel.plot(one.x, one.values, label=one.name.replace("_", " ") if len(names) > 1 else "", **look)
        panel.axhline(0.0, **GUIDE)
        panel.margins(y=0.15)
        panel.set_ylabel(r"residual ($\sigma$)")
        legend(panel)

    def refuse_undrawn(self, over: str) -> None:
        """Refuse a table of which nothing could be drawn.

        Raises
        ------
        ValueError
            With what the figure has and the table lacks.
        """
        if self.column(over) is None:
            raise ValueError(f'{self.named}: no column "{over}", which the figure is drawn over; add it, or choose --x')
        if not self.shown:
            columns = ", ".join(self.table)
            said = "no row is of what is drawn: its columns are no variables of this figure, or its conditions others"
            raise ValueError(f"{self.named}: {said} (columns: {columns}); choose another kind, --x or --where")
