"""Statements that a person reads of a run: the numbers behind all tables, and the cells of tables as numbers."""

import math
import re
import sys
from typing import NamedTuple

import numpy as np
import xarray as xr

from sim import read
from sim.read.observables import with_slips

#: The time of a number of the whole run, and of a mean over its second half.
RUN, LATE = "of the run", "over the second half"
_NUMBER = r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?"
#: A value with its standard error in the last digits and the bound of its systematic error.
_CELL = re.compile(rf"({_NUMBER})(?:\((\d+)\))?(?: ± ({_NUMBER}) \([\w ]+\))?")
_PARTS = "sem", "low", "high", "bound", "reason"


class Number(NamedTuple):
    """Value, standard error, ends of its 95 % interval, bound of its systematic error, and the reason for none."""

    value: float
    error: float
    low: float
    high: float
    bound: float
    reason: str

    @property
    def half(self):
        """Half of the interval, and the bound."""
        sizes = 0.5 * (self.high - self.low), self.bound
        return sum(size for size in sizes if not math.isnan(size))

    @property
    def is_explained(self):
        """True if a missing value has a reason, or an end that it is beyond."""
        return bool(self.reason) or math.isfinite(self.low) or math.isfinite(self.high)


def statistics(dataset):
    """Return the statistics of all observables over the members, of the events of the run, and its correlation time."""
    memory = {"correlation_time": read.correlation_time(dataset)}
    return read.over_members(dataset) | read.Run(dataset).events | memory


def shares(dataset):
    """Return the statistics over the members of the shares of the area that each mechanism takes, in both orders."""
    read.share_observables(dataset.isel(t=[0]))  # where they are not known it says why
    names = [column.name for column in read.tables.LOSSES]
    return read.over_members(dataset, [*names, "order_of_charging"])


def values_of(estimates):
    """Return the values of quantities without their errors."""
    return xr.Dataset({name: one.value for name, one in estimates.items()})


class Statement(NamedTuple):
    """A number at one point of the sweep with its name and place."""

    name: str
    at: dict
    value: float
    low: float
    high: float
    bound: float
    reason: str


def each(estimates):
    """Yield the numbers of quantities, one for each point of the sweep."""
    for name, one in estimates.items():
        for place in np.ndindex(one.value.shape):
            at = dict(zip(one.value.dims, place, strict=True))
            value, low, high, bound, reason = (
                math.nan
                if field is None
                else field.isel(at, missing_dims="ignore").item()
                for field in (one.value, one.low, one.high, one.bound, one.reason)
            )
            coords = one.value.isel(at).coords
            known = {dim: coords[dim].item() for dim in at if dim in coords}
            reason = reason if isinstance(reason, str) else ""
            yield Statement(name, known, value, low, high, bound, reason)


def statements_of(run):
    """Return the numbers behind the tables of a run by name, point of the sweep, and time or record."""
    over = [*read.tables.main_columns(run), *read.tables.LOSSES]
    once = [*read.tables.EVENTS, *read.tables.SLIPS, *read.tables.PHASES]
    groups = [(run.events, once, RUN)]
    groups.append((run.losses, read.tables.of_losses(run.losses), RUN))
    names = [column.name for column in over]
    if run.lasts:
        groups.append((run.late(names), over, LATE))
    if not run.has_one_row_each:
        groups.append(
            (read.tables.at_records(with_slips(run.dataset), names), over, RUN)
        )
    result = {}
    for group, columns, span in groups:
        for column in columns:
            if column.name in group:
                result |= _numbers_of(run, column.name, group[column.name], span)
    return result


def _numbers_of(run, name, one, span):
    """Return the numbers of one quantity; a second dimension beside sweep and time counts branches or phases."""
    mean = one.value
    parts = [
        np.full(mean.shape, "" if part == "reason" else math.nan, object)
        if getattr(one, part) is None
        else getattr(one, part).broadcast_like(mean).transpose(*mean.dims).to_numpy()
        for part in _PARTS
    ]
    result = {}
    for place, value in np.ndenumerate(mean.to_numpy()):
        at = dict(zip(mean.dims, place, strict=True))
        further = tuple(at.pop(dim) for dim in ("branch", "phase") if dim in at)
        time = at.pop("t", span)
        point = tuple(str(run.dataset[dim].to_numpy()[k]) for dim, k in at.items())
        *numbers, reason = (part[place] for part in parts)
        result[name, point, time, *further] = Number(
            float(value), *map(float, numbers), str(reason)
        )
    return result


def cells_of(run):
    """Return the SI unit, the printed unit and the texts of each column of the tables by the name of its quantity."""
    tables = read.tables_of(run, rows=sys.maxsize, show=["all"])
    result = {}
    for table in tables:
        headings = list(table.rows[0])[table.keys :]
        for column, heading in zip(table.columns, headings, strict=False):
            unit = heading.strip().removeprefix(column.heading.strip()).strip(" ()")
            texts = [row[heading].removesuffix("*") for row in table.rows]
            result[column.name] = column.definition.unit, unit, texts
    return result


def parsed(text):
    """Return value, standard error and bound of a cell, and the largest difference by rounding; None without a value.

    A value with a bracket, a bound or an end is rounded to its last digit, any other one to four.
    """
    match = _CELL.match(text)
    if match is None or " to " in text:
        return None
    value = float(match[1])
    digit = 10.0 ** -len(match[1].partition(".")[2])
    error = float(match[2]) * digit if match[2] else math.nan
    bound = float(match[3]) if match[3] else math.nan
    rounding = 0.5 * digit
    if match[2]:  # an error of many digits ends in zeros
        rounding = 0.5 * 10.0 ** (math.floor(math.log10(error) + 1e-9) - 1)
    elif not match[3] and " (" not in text:
        rounding = 6e-4 * abs(value)
    return value, error, bound, rounding
