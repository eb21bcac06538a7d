"""Measured points over the curves of a dataset, from a CSV table, and their residuals."""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from sim.analysis import sweep_dims
from sim.analysis.dataset import plain
from sim.plots.style import BOTH, GUIDE, HOLLOW, legend
from sim.units.quantity import Quantity
from sim.units.tables import Points, measured_points, read_measured

#: Groups of names of one variable, as prescribed and as recorded.
_SAME = (
    ("speed", "drive_speed"), ("normal_load", "contact_load"), ("indentation", "contact_indentation"),
    ("displacement", "contact_displacement"),
)  # fmt: skip
#: Variables that follow from another column: its name, the power of it, and the factor.
_BY = {"contact_radius": ("contact_area", 0.5, np.pi**-0.5), "contact_area": ("contact_radius", 2.0, np.pi)}
#: Largest relative difference between a condition of a row and that of its curve.
_NEAR = 5e-3
#: Smallest distance between branches of a curve that goes back and forth, in errors.
_ALIKE = 0.01
_MARKS = "osD^v"


def _names_of(name: str) -> tuple[str, ...]:
    """Return all names of a variable."""
    return next((names for names in _SAME if name in names), (name,))


class Line(NamedTuple):
    """A curve of a panel: a point of the sweep, its name, "" if a colour bar names it, and its colour."""

    number: int
    point: dict[str, int]
    label: str
    colour: str


class Compared(NamedTuple):
    """A curve that points may lie on.

    Over ``x`` in the unit of the axis it has the mean and its standard error in that of the other axis, and JKR's area
    at the full work of adhesion [m^2].
    """

    line: Line
    x: np.ndarray
    mean: np.ndarray
    error: np.ndarray
    full: np.ndarray

    def at(self, x: np.ndarray, *along: np.ndarray) -> list[np.ndarray]:
        """Return values along each branch of the curve, from turn to turn, at other places; nan beyond its ends.

        The shape is (branches, places).
        """
        way = np.sign(np.diff(self.x))
        ends = np.flatnonzero(np.diff(way)) + 1
        spans = [(a, b + 1) for a, b in itertools.pairwise([0, *ends, len(way)]) if way[a] != 0.0]
        branches = [a + np.argsort(self.x[a:b]) for a, b in spans]
        none = [np.full(x.shape, np.nan)]
        return [
            np.array([np.interp(x, self.x[rows], curve[rows], np.nan, np.nan) for rows in branches] or none)
            for curve in along
        ]


class Residuals(NamedTuple):
    """Distances of points of the column ``name`` from a curve over another variable, in standard errors of both.

    If the curve has several ``branches``, back and forth, they are those to the nearest one, which underestimates them.
    Branches that are nowhere a hundredth of an error apart count as one.
    """

    over: str
    name: str
    line: Line
    x: np.ndarray
    values: np.ndarray
    branches: int


class Measured:
    """A table of measured points, a CSV or columns in SI by name, with a record of those that a figure shows.

    Its columns are variables of a dataset with their units and errors, as those of ``sim fit``. A column that is a
    number of the scenario, such as ``contact_load``, assigns a row to a curve of a sweep.
    """

    def __init__(self, data: Path | str | Mapping[str, Any], dataset: xr.Dataset) -> None:
        self.dataset = plain(dataset)
        self.sweep = {*sweep_dims(dataset)}
        units = {"area_ratio": "1", "contact_radius": "m", "contact_area": "m^2", "speed": "m/s", "t": "s"}
        for name, variable in self.dataset.variables.items():
            if variable.dtype.kind == "f" and "units" in variable.attrs:
                units.setdefault(str(name).removesuffix("_mean"), variable.attrs["units"])
        known = {name: Quantity(unit, name) for name, unit in units.items()}
        if isinstance(data, Path | str):
            self.source, self.table = str(data), read_measured(Path(data), known, known)
        else:
            self.source, self.table = "data", measured_points(data, known)
        self.shown: set[str] = set()
        self.residuals: list[Residuals] = []

    @property
    def has_errors(self) -> bool:
        return any(points.errors is not None for points in self.table.values())

    def column(self, name: str) -> Points | None:
        """Return a column by any of the names of its variable."""
        return next((self.table[each] for each in (name, *_names_of(name)) if each in self.table), None)

    def _rows_of(self, point: dict[str, int], over: str) -> np.ndarray:
        """True for the rows whose conditions are those of a point of the sweep."""
        rows = np.ones(len(next(iter(self.table.values())).values), bool)
        for name, points in self.table.items():
            for each in _names_of(name):
                number = self.dataset.variables.get(each)
                if number is not None and {*number.dims} <= self.sweep and over not in _names_of(name):
                    value = float(number.isel(point, missing_dims="ignore"))
                    rows &= np.abs(points.values - value) <= _NEAR * abs(value)
        return rows

    def _values(self, name: str, curve: Compared, x: np.ndarray) -> Points | None:
        """Return the measured values of a variable, or those that follow from another column, at places on the axis."""
        if (points := self.column(name)) is not None:
            return points
        if name == "area_ratio" and (area := self._values("contact_area", curve, x)) is not None:
            (branches,) = curve.at(x, curve.full)
            unique = branches[0] if len(branches) == 1 else np.full(x.shape, np.nan)
            full = curve.full[0] if np.ptp(curve.full) == 0.0 else unique
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
        """Draw points in a panel of a variable over another, each with its factor from SI, beside the curves."""
        across, (name, factor) = self.column(over[0]), shown
        if across is None:
            return
        # the column that the variable has or follows from
        source = next(
            (each for each in (name, *_names_of(name), "contact_area", "contact_radius") if each in self.table), ""
        )
        x, wide = over[1] * across.values, None if across.errors is None else over[1] * across.errors
        assigned = any(name in self.table for name in self.sweep)
        for curve in curves if assigned else curves[:1]:
            points, rows = self._values(name, curve, x), self._rows_of(curve.line.point, over[0])
            if points is None or not np.any(rows):
                continue
            y, high = factor * points.values[rows], None if points.errors is None else factor * points.errors[rows]
            line, label = curve.line if assigned else curve.line._replace(colour=BOTH), "measured"
            if high is not None and (assigned or len(curves) == 1):
                values, branches = _residuals(curve, x[rows], y, high, log)
                near = np.isfinite(values)
                if np.any(near):
                    self.residuals.append(Residuals(over[0], source, line, x[rows], values, branches))
                    label += rf", $\chi^2$ = {np.sum(values[near] ** 2):.4g} of {np.sum(near)}"
                    label += " (nearest branch)" * (branches > 1)
            look: Any = HOLLOW | {"color": line.colour, "elinewidth": 0.7, "zorder": 3}
            panel.errorbar(x[rows], y, high, None if wide is None else wide[rows], label=label, **look)
            self.shown.add(name)

    def residual_panel(self, panel: Axes, over: str) -> None:
        """Draw the residuals from curves over a variable."""
        residuals = [each for each in self.residuals if each.over == over]
        names = list(dict.fromkeys(each.name for each in residuals))
        for each in residuals:
            look = HOLLOW | {"marker": _MARKS[names.index(each.name) % len(_MARKS)], "color": each.line.colour}
            panel.plot(each.x, each.values, label=each.name.replace("_", " ") if len(names) > 1 else "", **look)
        panel.axhline(0.0, **GUIDE)
        panel.margins(y=0.15)
        panel.set_ylabel(r"residual ($\sigma$)")
        legend(panel)

    def refuse_undrawn(self, over: str) -> None:
        """Refuse a table of which nothing could be drawn.

        Raises
        ------
        ValueError
            With the axis or the columns that the table lacks.
        """
        if self.column(over) is None:
            raise ValueError(f'{self.source}: no column "{over}", over which the figure is drawn; add it or choose --x')
        if not self.shown:
            lack = "no row is of what is drawn: its columns are no variables of this figure, or its conditions differ"
            columns = ", ".join(self.table)
            raise ValueError(f"{self.source}: {lack} (columns: {columns}); choose another kind, --x or --where")


def _residuals(curve: Compared, x: np.ndarray, y: np.ndarray, errors: np.ndarray, log: bool) -> tuple[np.ndarray, int]:
    """Return the distances of points from the nearest branch in standard errors, and the number of branches."""
    if log:
        curve, x = curve._replace(x=np.log(curve.x)), np.log(x)
    means, sem = curve.at(x, curve.mean, curve.error)
    branches = (y - means) / np.hypot(errors, np.nan_to_num(sem))
    nearest = np.argmin(np.nan_to_num(np.abs(branches), nan=np.inf), axis=0)
    values = np.take_along_axis(branches, nearest[np.newaxis], 0)[0]
    known = branches[:, np.isfinite(values)]
    apart = np.nanmax(known, axis=0) - np.nanmin(known, axis=0) if known.size else np.zeros(1)
    return values, len(branches) if np.max(apart) > _ALIKE else 1
