"""Courses: a value prescribed over the time of a run as a number, a course from one value to another, or a table.

Sliding speeds and what holds the sphere are given in these three ways alike.
"""

import math
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity
from sim.units.table import at_once, file_columns

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_TIME = Quantity("s", "time", "t")
_CYCLES = Quantity("1", "cycles there and back; 0: one way", at_least=0, at_most=10**6, whole=True)
#: Times nearer than this share of the run are meant to be the same.
_SAME = 1e-9


class Pieces(NamedTuple):
    """Stretches of time, one after the other, in each of which a prescribed value changes smoothly: arrays (pieces,).

    ``interval`` is the number of the interval in which a piece lies; each interval has one or more. ``start`` and
    ``stop`` are the piece's ends [s], ``first`` and ``last`` the values there; ``integral`` is that of the value over
    time, ``path`` that of its magnitude, ``unsteady`` that of the square of what the magnitude differs from its mean.
    """

    interval: Indices
    start: Array
    stop: Array
    first: Array
    last: Array
    integral: Array
    path: Array
    unsteady: Array

    @property
    def joined(self) -> "Pieces":
        """One piece for each interval, whose sums are rounded once."""
        if len(self.interval) == 1:
            return self
        opening = np.flatnonzero(np.diff(self.interval, prepend=-1))
        if len(opening) == len(self.interval):
            return self
        closing = np.append(opening[1:], len(self.interval)) - 1
        squares = self.unsteady + _steady_square(self.path, self.stop - self.start)
        integral, path, square = np.add.reduceat([self.integral, self.path, squares], opening, axis=1)
        for k in np.flatnonzero(closing - opening > 1):
            inside = slice(opening[k], closing[k] + 1)
            integral[k], path[k] = math.fsum(self.integral[inside]), math.fsum(self.path[inside])
        ends = self.start[opening], self.stop[closing], self.first[opening], self.last[closing]
        unsteady = np.maximum(square - _steady_square(path, ends[1] - ends[0]), 0.0)
        unsteady = np.where(closing > opening, unsteady, self.unsteady[opening])
        return Pieces(self.interval[opening], *ends, integral, path, unsteady)


def _steady_square(path: Array, span: Array) -> Array:
    """Integral over time of the square of a value that stays and has this integral."""
    return np.divide(path * path, span, out=np.zeros(path.shape), where=span > 0.0)


def linear_pieces(interval: Indices, start: Array, stop: Array, first: Array, last: Array) -> Pieces:
    """Pieces in which the value changes linearly."""
    integral = 0.5 * (first + last) * (stop - start)
    path, turns = np.abs(integral), first * last < 0.0
    unsteady = (last - first) ** 2 * (stop - start) / 12.0
    if turns.any():
        one, other, span = first[turns], last[turns], (stop - start)[turns]
        path[turns] = 0.5 * (one**2 + other**2) / np.abs(other - one) * span
        unsteady[turns] = (one**2 + one * other + other**2) / 3.0 * span - _steady_square(path[turns], span)
    return Pieces(interval, start, stop, first, last, integral, path, unsteady)


def _within(ends: Array, times: Array, apart: float = 0.0) -> tuple[Array, Indices]:
    """Times strictly between neighbouring ``ends``, further than ``apart`` from both; places where they belong."""
    times = times[(ends[0] < times) & (times < ends[-1])]
    places = np.searchsorted(ends, times, "right")
    inside = (ends[places - 1] + apart < times) & (times < ends[places] - apart)
    return times[inside], places[inside]


def _intervals(ends: Array, places: Indices) -> Indices:
    """The interval between ``ends`` of each piece, where times at these places cut some of them."""
    count = len(ends) - 1
    return np.repeat(np.arange(count), 1 + np.bincount(places - 1, minlength=count))


class Number(NamedTuple):
    """A value that stays.

    As of every prescribed value ``changes`` is whether it depends on time, ``cycles`` counts its ways there and back,
    and ``end`` [s] is the last time for which it is given.
    """

    value: float
    changes: bool = False
    cycles: int = 0
    end: float = math.inf

    @property
    def extremes(self) -> tuple[float, ...]:
        """Values among which are the least and the largest of the run."""
        return (self.value,)

    def at(self, time: Array, duration: float) -> Array:
        """The value at times [s] of a run of ``duration`` [s]; where it jumps, that after the jump."""
        return np.full(time.shape, self.value)

    def pieces(self, ends: Array, duration: float) -> Pieces:
        """The way through the intervals between some times [s], cut where the value turns or jumps."""
        values = self.at(ends, duration)
        return linear_pieces(np.arange(len(ends) - 1), ends[:-1], ends[1:], values[:-1], values[1:])


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid", "populate_by_name": True})
class Course:
    """From one value to another over the run, or ``cycles`` times there and back, linearly or logarithmically.

    Notes
    -----
    Logarithmic: v(t) = v0 r^(t/T) with r = v1/v0; its integral over dt is v(t) T/ln r (r^(dt/T) − 1), by expm1.
    """

    start: Annotated[float, Field(alias="from")]
    stop: Annotated[float, Field(alias="to")]
    scale: Annotated[Literal["linear", "log"], Field(description="how it goes from one end to the other")] = "linear"
    changes: ClassVar[bool] = True
    cycles: ClassVar[int] = 0
    end: ClassVar[float] = math.inf

    @model_validator(mode="after")
    def _log_needs_one_sign(self) -> "Course":
        if self.scale == "log" and self.start * self.stop <= 0.0:
            said = 'a logarithmic course cannot reach or pass zero; give two values above zero or scale = "linear"'
            raise PydanticCustomError("log_through_zero", said)
        return self

    @property
    def extremes(self) -> tuple[float, ...]:
        return self.start, self.stop

    def at(self, time: Array, duration: float) -> Array:
        part = time / duration if duration > 0.0 else np.zeros(time.shape)
        if self.cycles:
            turn = 2.0 * self.cycles * part % 2.0
            part = np.where(turn <= 1.0, turn, 2.0 - turn)
        if self.scale == "log":
            # the library's scalar power: that of numpy differs between processors
            ratio = self.stop / self.start
            return self.start * np.array([ratio**share for share in part.ravel().tolist()]).reshape(part.shape)
        value = self.start + (self.stop - self.start) * part
        # a course that reaches zero but for rounding reaches it: there a free sphere touches
        return np.where(np.abs(value) > 1e-13 * max(abs(self.start), abs(self.stop)), value, 0.0)

    def pieces(self, ends: Array, duration: float) -> Pieces:
        values, interval = self.at(ends, duration), np.arange(len(ends) - 1)
        if self.cycles:
            half = duration / (2.0 * self.cycles)
            turns = np.arange(math.floor(ends[0] / half), math.ceil(ends[-1] / half) + 1) * half
            turns, places = _within(ends, turns, _SAME * duration)
            odd = np.round(turns / half) % 2.0 == 1.0
            values, interval = np.insert(values, places, np.where(odd, self.stop, self.start)), _intervals(ends, places)
            ends = np.insert(ends, places, turns)
        pieces = linear_pieces(interval, ends[:-1], ends[1:], values[:-1], values[1:])
        if self.scale == "linear":
            return pieces
        rate = math.log(self.stop / self.start) * max(1, 2 * self.cycles) / duration
        if rate == 0.0:
            return pieces
        rates = np.copysign(rate, np.abs(pieces.last) - np.abs(pieces.first))
        span = pieces.stop - pieces.start
        growth, twice = ([math.expm1(n * share) for share in (rates * span).tolist()] for n in (1, 2))
        integral = pieces.first * np.array(growth) / rates
        square = pieces.first**2 * np.array(twice) / (2.0 * rates)
        unsteady = np.maximum(square - _steady_square(integral, span), 0.0)
        return pieces._replace(integral=integral, path=np.abs(integral), unsteady=unsteady)


def table_pieces(times: Array, values: Array, ends: Array, duration: float) -> Pieces:
    """Pieces of a table that is linear between its rows and keeps its last value; two rows at one time are a jump."""
    ends = _snapped(times, ends, duration)
    rows, places = _within(ends, np.unique(times[slice(*np.searchsorted(times, ends[[0, -1]], "right"))]))
    edges = np.insert(ends, places, rows)
    start, stop = edges[:-1], edges[1:]
    row = np.searchsorted(times, 0.5 * (start + stop), "right") - 1
    first, last = (_interpolated(times, values, row, edge) for edge in (start, stop))
    return linear_pieces(_intervals(ends, places), start, stop, first, last)


def _snapped(times: Array, ends: Array, duration: float) -> Array:
    """Clock times, those of rows where they are meant to be the same but for rounding."""
    after = np.searchsorted(times, ends).clip(max=len(times) - 1)
    left, right = times[np.maximum(after - 1, 0)], times[after]
    nearest = np.where(np.abs(left - ends) <= np.abs(right - ends), left, right)
    return np.where(np.abs(nearest - ends) <= _SAME * duration, nearest, ends)


def _interpolated(times: Array, values: Array, row: Indices, time: Array) -> Array:
    """Values on the lines from some rows to the next, and beyond the last row its value."""
    after = np.minimum(row + 1, len(times) - 1)
    span, rise = times[after] - times[row], values[after] - values[row]
    slope = np.divide(rise, span, out=np.zeros(span.shape), where=span > 0.0)
    return np.where(time >= times[after], values[after], slope * (time - times[row]) + values[row])


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
class Table:
    """Values tabulated over time, linear between the rows; two rows at one time are a jump.

    In a scenario file ``file`` names a CSV with the columns ``time`` and ``column``, each with its unit in brackets.
    A subclass declares the field ``values_in``, in which it keeps the latter.
    """

    quantity: ClassVar[Quantity]
    column: ClassVar[str]
    values_in: ClassVar[str] = "value"
    changes: ClassVar[bool] = True
    cycles: ClassVar[int] = 0

    time: Annotated[tuple[Annotated[float, _TIME], ...], at_once(_TIME)]
    file: Annotated[str, Field(description="CSV with these columns, beside the scenario, in place of them")] = ""

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, given: Any, info: ValidationInfo) -> Any:
        if not isinstance(given, dict) or not isinstance(given.get("file"), str) or "time" in given:
            return given
        found = file_columns(given["file"], info.context, {"time": _TIME, cls.column: cls.quantity})
        return {**given, "time": found["time"], cls.values_in: found[cls.column]}

    @model_validator(mode="after")
    def _rows_in_order(self) -> "Table":
        if len(self.time) != len(self.extremes):
            raise PydanticCustomError("short_table", "a table needs as many values as times")
        if len(self.time) < 2:
            raise PydanticCustomError("short_table", "a table needs two rows or more")
        if np.any(np.diff(self.time) < 0.0) or self.time[0] > 0.0:
            raise PydanticCustomError("time_order", "times must start at 0 s or before and never decrease")
        return self

    @property
    def extremes(self) -> tuple[float, ...]:
        """The column beside the times."""
        return tuple(getattr(self, self.values_in))

    @cached_property
    def _rows(self) -> tuple[Array, Array]:
        return np.array(self.time), np.array(self.extremes)

    @property
    def end(self) -> float:
        return self.time[-1]

    def at(self, time: Array, duration: float) -> Array:
        times, values = self._rows
        time = _snapped(times, time, duration)
        return _interpolated(times, values, np.searchsorted(times, time, "right") - 1, time)

    def pieces(self, ends: Array, duration: float) -> Pieces:
        return table_pieces(*self._rows, ends, duration)


def _kind(value: Any) -> str:
    if isinstance(value, Table) or (isinstance(value, dict) and ("file" in value or "time" in value)):
        return "[table]"
    return "[course]" if isinstance(value, dict | Course) else "[value]"


def held(unit: Quantity, name: str) -> Any:
    """Annotation of a prescribed quantity: a number, a course, or a table whose column has this name."""

    @dataclass(frozen=True, kw_only=True, config={"extra": "forbid", "populate_by_name": True})
    class _Course(Course):
        """From one value to another over the run, or ``cycles`` times there and back."""

        start: Annotated[float, unit, Field(alias="from")]
        stop: Annotated[float, unit, Field(alias="to")]
        cycles: Annotated[int, _CYCLES] = 0  # type: ignore[misc]

    @dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
    class _Table(Table):
        """A value tabulated over time, linear between the rows; ``file`` names the CSV."""

        quantity: ClassVar[Quantity] = unit
        column: ClassVar[str] = name
        value: Annotated[tuple[Annotated[float, unit], ...], at_once(unit)]
        file: Annotated[str, Field(description=f"CSV with the columns `time` and `{name}`, in place of these")] = ""

    number, course = Annotated[float, unit, Tag("[value]")], Annotated[_Course, Tag("[course]")]
    return Annotated[number | course | Annotated[_Table, Tag("[table]")], Discriminator(_kind)]


#: A value prescribed over a run.
Prescribed = Number | Course | Table


def prescribed(given: float | Course | Table) -> Prescribed:
    """The course in time of what a scenario gives."""
    return given if isinstance(given, Course | Table) else Number(given)
