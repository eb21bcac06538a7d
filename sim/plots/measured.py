"""Measured points over the curves of a dataset, from a CSV table, and their residuals."""

import itertools
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.plots.style import BOTH, GUIDE, HOLLOW, legend
from sim.read.dataset import plain, speed_name, sweep_dims
from sim.units.notation import engineering
from sim.units.quantity import Quantity
from sim.units.tables import Points, measured_points, names_of, read_measured

#: Variables that follow from another column: its name, the power of it, and the factor.
_BY = {
    "contact_radius": ("contact_area", 0.5, np.pi**-0.5),
    "contact_area": ("contact_radius", 2.0, np.pi),
}
#: Largest relative difference between a condition of a row and that of its curve, and that of equal numbers.
_NEAR, _ROUNDING = 5e-3, 1e-9
#: Smallest distance between branches of a curve that goes back and forth, in errors.
_ALIKE = 0.01
_MARKS = "osD^v"
#: Reasons why a row is not drawn, and why it has no residual.
_NO_CURVE, _SEVERAL = (
    "not of a curve in the figure",
    ("of several curves", "of curves with other JKR areas"),
)
_APART = (_SEVERAL[0], "beyond the curve", "without an error")
#: Most values of a condition that are named.
_MOST = 3


class Line(NamedTuple):
    """A curve of a panel: a point of the sweep, its name, "" if a colour bar names it, its colour and its style.

    A branch has only the ``shown`` part of the curve.
    """

    number: int
    point: dict[str, int]
    label: str
    colour: str
    style: str = "-"
    shown: np.ndarray | None = None

    @property
    def whole(self) -> "Line":
        return self._replace(shown=None)


class Compared(NamedTuple):
    """A curve that points may lie on.

    Over ``x`` in the unit of the axis, it has the mean and its standard error in the unit of the other axis. It also
    has the JKR area at the full work of adhesion [m^2].
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
        spans = [
            (a, b + 1)
            for a, b in itertools.pairwise([0, *ends, len(way)])
            if way[a] != 0.0
        ]
        branches = []
        for rows in (a + np.argsort(self.x[a:b]) for a, b in spans):
            inside = np.clip(x, self.x[rows[0]], self.x[rows[-1]])
            # rounding puts no point beyond an end
            placed = np.where(
                np.abs(x - inside) <= _ROUNDING * np.abs(inside), inside, x
            )
            branches.append(
                [
                    np.interp(placed, self.x[rows], curve[rows], np.nan, np.nan)
                    for curve in along
                ]
            )
        none = np.full((1, len(along), *x.shape), np.nan)
        return [*np.swapaxes(branches or none, 0, 1)]


class Residuals(NamedTuple):
    """Distances of points of the column ``name`` from a curve over another variable, in standard errors of both.

    If the curve goes back and forth, they are those to its nearest branch, which underestimates them.
    """

    over: str
    name: str
    line: Line
    x: np.ndarray
    values: np.ndarray


class Measured:
    """A table of measured points, a CSV or columns in SI by name, with a record of those that a figure shows.

    Its columns are variables of a dataset with their units and errors, as those of ``sim fit``. A column that is a
    number of the scenario, such as ``contact_load``, assigns a row to a curve of a sweep. For each column of which a
    panel has points, ``reasons`` says why a row is none of them or has no residual; "" if neither. ``assumed`` tells
    of missing units.
    """

    def __init__(
        self, data: Path | str | Mapping[str, Any], dataset: xr.Dataset
    ) -> None:
        self.dataset = plain(dataset)
        units = {
            "area_ratio": "1",
            "contact_radius": "m",
            "contact_area": "m^2",
            "speed": "m/s",
            "t": "s",
        }
        for name, variable in self.dataset.variables.items():
            if variable.dtype.kind == "f" and "units" in variable.attrs:
                units.setdefault(str(name), variable.attrs["units"])
        self.units = {
            each: unit for name, unit in units.items() for each in names_of(name)
        }
        known = {name: Quantity(unit, name) for name, unit in self.units.items()}
        self.source, self.assumed = "data", ""
        if isinstance(data, Path | str):
            self.source = str(data)
            self.table, self.assumed = read_measured(
                Path(data), known, known, gaps=True
            )
        else:
            self.table = measured_points(data, known)
        self.forget()

    def forget(self) -> None:
        """Forget what a figure has shown."""
        self.residuals: list[Residuals] = []
        self.reasons: dict[str, np.ndarray] = {}
        self.conditions: set[str] = set()
        self.over: set[str] = set()

    @property
    def has_errors(self) -> bool:
        return any(points.errors is not None for points in self.table.values())

    def column(self, name: str) -> Points | None:
        """Return a column by any of the names of its variable."""
        return next(
            (
                self.table[each]
                for each in (name, *names_of(name))
                if each in self.table
            ),
            None,
        )

    def _rows_of(self, curve: Compared, over: str, at_end: bool) -> np.ndarray:
        """True for the rows whose conditions are those all along a curve, of the last record if it is not over time."""
        rows, sweep = (
            np.ones(len(next(iter(self.table.values())).values), bool),
            {*sweep_dims(self.dataset)},
        )
        prescribed = (
            speed_name(self.dataset)
            if at_end and "drive_force" not in self.dataset
            else ""
        )
        for column in self.table:
            for name in () if over in names_of(column) else names_of(column):
                number = self.dataset.variables.get(name, xr.Variable("t", [np.nan]))
                number = number.isel(t=-1) if name == prescribed else number
                values = number.isel(curve.line.point, missing_dims="ignore").to_numpy()
                if {*number.dims} <= sweep and np.ptp(values) == 0.0:
                    rows &= np.abs(
                        self.table[column].values - values.flat[0]
                    ) <= _NEAR * np.abs(values.flat[0])
                    self.conditions.add(column)
        return rows

    def _values(self, name: str, curve: Compared, x: np.ndarray) -> Points | None:
        """Return the measured values of a variable, or those that follow from another column, at places on the axis."""
        if (points := self.column(name)) is not None:
            return points
        if (
            name == "area_ratio"
            and (area := self._values("contact_area", curve, x)) is not None
        ):
            (branches,) = curve.at(x, curve.full)
            unique = branches[0] if len(branches) == 1 else np.full(x.shape, np.nan)
            full = curve.full[0] if np.ptp(curve.full) == 0.0 else unique
            return Points(
                area.values / full, None if area.errors is None else area.errors / full
            )
        by, power, factor = _BY.get(name, ("", 1.0, 1.0))
        if by not in self.table:
            return None
        source, errors = self.table[by]
        values = factor * source**power
        return Points(
            values, None if errors is None else power * np.abs(values / source) * errors
        )

    def draw(
        self,
        panel: Axes,
        over: tuple[str, float],
        shown: tuple[str, float],
        curves: Sequence[Compared],
        log: bool,
        at_end: bool,
    ) -> None:
        """Draw points in a panel of a variable over another, each with its factor from SI, beside the curves.

        A row of one curve has its colour and a residual. A row of several curves is black if it has one place.
        """
        across, (name, factor) = self.column(over[0]), shown
        # the column that the variable has or follows from
        sizes = (*_BY,) if name in ("area_ratio", *_BY) else ()
        source = next(
            (each for each in (*names_of(name), *sizes) if each in self.table), ""
        )
        if across is None or not source:
            return
        self.over.add(over[0])
        x, wide = (
            over[1] * across.values,
            None if across.errors is None else over[1] * across.errors,
        )
        matches = np.array([self._rows_of(curve, over[0], at_end) for curve in curves])
        points = [each for curve in curves if (each := self._values(name, curve, x))]
        places = np.where(
            matches, factor * np.array([each.values for each in points]), np.nan
        )
        first, count = np.argmax(matches, axis=0), matches.sum(axis=0)
        y = np.take_along_axis(places, first[np.newaxis], 0)[0]
        differs = np.any(matches & (np.abs(places - y) > 1e-9 * np.abs(y)), axis=0)
        row_values = [self.table[each].values for each in (source, *self.conditions)]
        ends = [
            np.all(np.isnan(curve.at(x, curve.mean)[0]), axis=0) for curve in curves
        ]
        errors = self.table[source].errors
        faults = {
            "with an empty cell": ~np.all(np.isfinite([x, *row_values]), axis=0),
            _NO_CURVE: count == 0,
            _SEVERAL[1]: differs,
            "at or below 0 on a logarithmic axis": (x <= 0.0) & log,
            "without JKR's area": ~np.isfinite(y),
            _APART[0]: count > 1,
            _APART[1]: np.all(ends | ~matches, axis=0),
            _APART[2]: errors is not None and np.isnan(errors),
        }
        reasons = np.select([*faults.values()], [*faults], "")
        self.reasons[source] = np.where(
            self.reasons.get(source, reasons) == "", "", reasons
        )
        for k, curve in enumerate([*curves, curves[0]]):
            alone, line = (
                k < len(curves),
                curve.line if k < len(curves) else curve.line._replace(colour=BOTH),
            )
            rows = np.isin(reasons, ("", *_APART)) & (
                (count == 1) & (first == k) if alone else count > 1
            )
            if not np.any(rows):
                continue
            errors, label = points[k % len(curves)].errors, "measured"
            high = None if errors is None else factor * errors[rows]
            if high is not None and alone:
                values, branches = _residuals(curve, x[rows], y[rows], high, log)
                near = np.isfinite(values)
                if np.any(near):
                    self.residuals.append(
                        Residuals(over[0], source, line, x[rows], values)
                    )
                    label += rf", $\chi^2$ = {np.sum(values[near] ** 2):.4g} of {np.sum(near)}"
                    label += " (nearest branch)" * (branches > 1)
            look: Any = HOLLOW | {"color": line.colour, "elinewidth": 0.7, "zorder": 3}
            panel.errorbar(
                x[rows],
                y[rows],
                high,
                None if wide is None else wide[rows],
                label=label,
                **look,
            )

    def residual_panel(self, panel: Axes, over: str) -> None:
        """Draw the residuals from curves over a variable."""
        residuals = [each for each in self.residuals if each.over == over]
        names = list(dict.fromkeys(each.name for each in residuals))
        for each in residuals:
            look = HOLLOW | {
                "marker": _MARKS[names.index(each.name) % len(_MARKS)],
                "color": each.line.colour,
            }
            panel.plot(
                each.x,
                each.values,
                label=each.name.replace("_", " ") if len(names) > 1 else "",
                **look,
            )
        panel.axhline(0.0, **GUIDE)
        panel.margins(y=0.15)
        panel.set_ylabel(r"residual ($\sigma$)")
        legend(panel)

    @property
    def remark(self) -> str:
        """Return how many points the figure lacks or does not compare, and why; "" if there are none."""
        counts = Counter(
            sorted(np.concatenate([*self.reasons.values(), np.empty(0, str)]).tolist())
        )
        total, drawn = (
            counts.total(),
            counts.pop("", 0) + sum(counts[reason] for reason in _APART),
        )
        apart = ", ".join(
            f"{counts.pop(reason)} {self._cause(reason)}"
            for reason in _APART
            if counts[reason]
        )
        left_out = ", ".join(
            f"{count} {self._cause(reason)}"
            for reason, count in counts.items()
            if count
        )
        shown = {
            each
            for name in (*self.over, *self.reasons, *self.conditions)
            for each in names_of(name)
        }
        idle = ", ".join(name for name in self.table if name not in shown)
        parts = [
            (f"{drawn} of {total} points drawn; omitted: ", left_out),
            ("without a residual: ", apart),
        ]
        return "; ".join(
            words + text for words, text in [*parts, ("no panel of ", idle)] if text
        )

    def _cause(self, reason: str) -> str:
        """Return a reason with the conditions of rows of no curve, or with the columns that rows of several lack."""
        rows, texts = (
            np.any([each == reason for each in self.reasons.values()], axis=0),
            [],
        )
        for name in sorted(self.conditions) if reason == _NO_CURVE else ():
            values = [
                engineering(each, self.units[name])
                for each in np.unique(self.table[name].values[rows])
            ]
            texts.append(
                f"{name} {', '.join(values[:_MOST])}" + ", …" * (len(values) > _MOST)
            )
        for key in sweep_dims(self.dataset) if reason in _SEVERAL else ():
            texts += (
                [f"no column {key}"]
                if self.dataset.sizes[key] > 1 and not self.column(key)
                else []
            )
        return reason + (f" ({'; '.join(texts)})" if texts else "")

    def finish(self, figure: Figure, over: str, ax: Axes | None = None) -> None:
        """Write the remark below a figure, in foreign axes above the legend.

        Raises
        ------
        ValueError
            If nothing could be drawn, with the axis or the columns that the table lacks.
        """
        if self.column(over) is None:
            raise ValueError(
                f'{self.source}: no column "{over}", the x axis of the figure; add it or choose --x'
            )
        if not any(
            np.any(np.isin(reasons, ("", *_APART))) for reasons in self.reasons.values()
        ):
            lack = "no row fits the figure: the columns are not its variables, or the conditions differ"
            columns = self.remark or f"columns: {', '.join(self.table)}"
            raise ValueError(
                f"{self.source}: {lack} ({columns}); choose another kind, --x or --where"
            )
        text = textwrap.fill(self.remark, 64)
        if text and ax is None:
            figure.supxlabel(text, fontsize=7.0)
        elif text and ax is not None and (entries := ax.get_legend()):
            entries.set_title(text)


def _residuals(
    curve: Compared, x: np.ndarray, y: np.ndarray, errors: np.ndarray, log: bool
) -> tuple[np.ndarray, int]:
    """Return the distances of points from the nearest branch in standard errors, and the number of branches."""
    if log:
        curve, x = curve._replace(x=np.log(curve.x)), np.log(x)
    means, sem = curve.at(x, curve.mean, curve.error)
    branches = (y - means) / np.hypot(errors, np.nan_to_num(sem))
    nearest = np.argmin(np.nan_to_num(np.abs(branches), nan=np.inf), axis=0)
    values = np.take_along_axis(branches, nearest[np.newaxis], 0)[0]
    known = branches[:, np.isfinite(values)]
    apart = (
        np.nanmax(known, axis=0) - np.nanmin(known, axis=0)
        if known.size
        else np.zeros(1)
    )
    return values, len(branches) if np.max(apart) > _ALIKE else 1
