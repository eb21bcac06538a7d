"""Measured points over the curves of a dataset, from a CSV table, and their residuals."""

import itertools
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
_NO_CURVE, _SEVERAL = "not of a curve in the figure", "of several curves"
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
    colour: str
    x: np.ndarray
    values: np.ndarray


class Measured:
    """A table of measured points, a CSV or columns in SI by name, with a record of those that a figure shows.

    Its columns are variables of a dataset with their units and errors, as those of ``sim fit``. A column that is a
    number of the scenario, such as ``contact_load``, assigns a row to a curve of a sweep. For each column of which a
    panel has points, ``reasons`` says why a row is none of them or of no single curve; "" if neither. ``assumed`` tells
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
        rows = np.ones(len(next(iter(self.table.values())).values), bool)
        is_prescribed = at_end and "drive_force" not in self.dataset
        prescribed = speed_name(self.dataset) if is_prescribed else ""
        for column, points in self.table.items():
            for name in () if over in names_of(column) else names_of(column):
                number = self.dataset.variables.get(name, xr.Variable("t", [np.nan]))
                number = number.isel(t=-1) if name == prescribed else number
                values = number.isel(curve.line.point, missing_dims="ignore").to_numpy()
                of_sweep = {*number.dims} <= {*sweep_dims(self.dataset)}
                if of_sweep and np.ptp(values) == 0.0:
                    value = values.flat[0]
                    rows &= np.abs(points.values - value) <= _NEAR * np.abs(value)
                    self.conditions.add(column)
        return rows

    def _values(self, name: str, curve: Compared, x: np.ndarray) -> Points | None:
        """Return the measured values of a variable, or those that follow from another column, at places on the axis."""
        if (points := self.column(name)) is not None:
            return points
        if name == "area_ratio":
            area = self._values("contact_area", curve, x)
            if area is None:
                return None
            branches = curve.at(x, curve.full)[0]
            full = branches[0] if len(branches) == 1 else np.full(x.shape, np.nan)
            return scaled(
                area, 1.0 / (curve.full[0] if np.ptp(curve.full) == 0.0 else full)
            )
        by, power, factor = _BY.get(name, ("", 1.0, 1.0))
        if by not in self.table:
            return None
        values, errors = self.table[by]
        derived = factor * values**power
        if errors is not None:
            errors = power * np.abs(derived / values) * errors
        return Points(derived, errors)

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
        names = [each for each in (*names_of(name), *sizes) if each in self.table]
        if across is None or not names:
            return
        self.over.add(over[0])
        x, wide = scaled(across, over[1])
        matches = np.array([self._rows_of(curve, over[0], at_end) for curve in curves])
        points = [
            scaled(each, factor)
            for curve in curves
            if (each := self._values(name, curve, x)) is not None
        ]
        owner, count = np.argmax(matches, axis=0), matches.sum(axis=0)
        places = np.where(matches, [each.values for each in points], np.nan)
        y = np.take_along_axis(places, owner[np.newaxis], 0)[0]
        differs = np.any(matches & (np.abs(places - y) > 1e-9 * np.abs(y)), axis=0)
        row_values = [self.table[each].values for each in (names[0], *self.conditions)]
        faults = {
            "with an empty cell": ~np.all(np.isfinite([x, *row_values]), axis=0),
            _NO_CURVE: count == 0,
            "of curves with other JKR areas": differs,
            "at or below 0 on a logarithmic axis": (x <= 0.0) & log,
            "without JKR's area": ~np.isfinite(y),
            _SEVERAL: count > 1,
        }
        reasons = np.select([*faults.values()], [*faults], "")
        former = self.reasons.get(names[0], reasons)
        self.reasons[names[0]] = np.where(former == "", "", reasons)
        for k, curve in enumerate(curves):
            alone = (reasons == "") & (owner == k)
            together = (reasons == _SEVERAL) & (k == 0)
            for rows, colour in ((alone, curve.line.colour), (together, BOTH)):
                if not np.any(rows):
                    continue
                errors, label = points[k].errors, "measured"
                high = None if errors is None else errors[rows]
                if high is not None and rows is alone:
                    values, branches = _residuals(curve, x[rows], y[rows], high, log)
                    known = np.isfinite(values)
                    if np.any(known):
                        residuals = (over[0], names[0], colour, x[rows], values)
                        self.residuals.append(Residuals(*residuals))
                        total = np.sum(values[known] ** 2)
                        label += rf", $\chi^2$ = {total:.4g} of {np.sum(known)}"
                        label += " (nearest branch)" * (branches > 1)
                far = None if wide is None else wide[rows]
                look: Any = HOLLOW | {"color": colour, "elinewidth": 0.7, "zorder": 3}
                panel.errorbar(x[rows], y[rows], high, far, label=label, **look)

    def residual_panel(self, panel: Axes, over: str) -> None:
        """Draw the residuals from curves over a variable."""
        residuals = [each for each in self.residuals if each.over == over]
        names = list(dict.fromkeys(each.name for each in residuals))
        for each in residuals:
            marker = _MARKS[names.index(each.name) % len(_MARKS)]
            look = HOLLOW | {"marker": marker, "color": each.colour}
            label = each.name.replace("_", " ") if len(names) > 1 else ""
            panel.plot(each.x, each.values, label=label, **look)
        panel.axhline(0.0, **GUIDE)
        panel.margins(y=0.15)
        panel.set_ylabel(r"residual ($\sigma$)")
        legend(panel)

    @property
    def remark(self) -> str:
        """Return how many points the figure lacks, and why; "" if there are none."""
        counts = Counter(
            reason for reasons in self.reasons.values() for reason in reasons.tolist()
        )
        total, several = counts.total(), counts.pop(_SEVERAL, 0)
        drawn = counts.pop("", 0) + several
        causes = [
            f"{counts[reason]} {self._cause(reason)}" for reason in sorted(counts)
        ]
        parts = []
        if causes:
            parts.append(
                f"{drawn} of {total} points drawn; omitted: {', '.join(causes)}"
            )
        if several:
            parts.append(f"{several} {self._cause(_SEVERAL)}")
        known = [*self.over, *self.reasons, *self.conditions]
        shown = {each for name in known for each in names_of(name)}
        if idle := [name for name in self.table if name not in shown]:
            parts.append(f"no panel of {', '.join(idle)}")
        return "; ".join(parts)

    def _cause(self, reason: str) -> str:
        """Return a reason with the conditions of rows of no curve, or with the columns that other rows lack."""
        texts = []
        if reason == _NO_CURVE:
            rows = np.any([each == reason for each in self.reasons.values()], axis=0)
            for name in sorted(self.conditions):
                numbers = np.unique(self.table[name].values[rows])
                values = [engineering(each, self.units[name]) for each in numbers]
                values[_MOST:] = ["…"] * (len(values) > _MOST)
                texts.append(f"{name} {', '.join(values)}")
        elif "curves" in reason:
            texts = [
                f"no column {key}"
                for key in sweep_dims(self.dataset)
                if self.dataset.sizes[key] > 1 and not self.column(key)
            ]
        return f"{reason} ({'; '.join(texts)})" if texts else reason

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
            np.isin(each, ("", _SEVERAL)).any() for each in self.reasons.values()
        ):
            lack = "no row fits the figure: the columns are not its variables, or the conditions differ"
            columns = self.remark or f"columns: {', '.join(self.table)}"
            raise ValueError(
                f"{self.source}: {lack} ({columns}); choose another kind, --x or --where"
            )
        if self.remark and ax is None:
            figure.supxlabel(self.remark, fontsize=7.0)
        elif self.remark and ax is not None and (entries := ax.get_legend()):
            entries.set_title(self.remark)


def scaled(points: Points, factor: float | np.ndarray) -> Points:
    """Return points times a factor."""
    values, errors = points
    return Points(factor * values, None if errors is None else factor * errors)


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
    differ = known.size and np.nanmax(np.ptp(known, axis=0)) > _ALIKE
    return values, len(branches) if differ else 1
