"""Courses: a value prescribed over the time of a run as a number, a course from one value to another, or a table.

Sliding speeds and what holds the sphere are given in these three ways alike.
"""

import itertools
import math
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.units.quantity import Quantity
from sim.units.table import file_columns

_TIME = Quantity("s", "time", "t")
_CYCLES = Quantity("1", "cycles there and back; 0: one way", at_least=0, at_most=10**6, whole=True)
#: Times nearer than this share of the run are meant to be the same.
_SAME = 1e-9


class Piece(NamedTuple):
    """A stretch of time over which a prescribed value changes smoothly.

    ``start`` and ``stop`` are its ends [s], ``first`` and ``last`` the values there; ``integral`` is that of the value
    over time, ``path`` that of its magnitude.
    """

    start: float
    stop: float
    first: float
    last: float
    integral: float
    path: float


def linear_piece(start: float, stop: float, first: float, last: float) -> Piece:
    """A piece in which the value changes linearly."""
    integral = 0.5 * (first + last) * (stop - start)
    path = abs(integral)
    if first * last < 0.0:
        path = 0.5 * (first**2 + last**2) / abs(last - first) * (stop - start)
    return Piece(start, stop, first, last, integral, path)


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

    def at(self, time: float, duration: float) -> float:
        """The value at a time [s] of a run of ``duration`` [s]; where it jumps, that after the jump."""
        return self.value

    def pieces(self, start: float, stop: float, duration: float) -> list[Piece]:
        """The way from one time to another [s], cut where the value turns or jumps; at least one piece."""
        return [linear_piece(start, stop, self.value, self.value)]


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

    def at(self, time: float, duration: float) -> float:
        part = time / duration if duration > 0.0 else 0.0
        if self.cycles:
            turn = 2.0 * self.cycles * part % 2.0
            part = turn if turn <= 1.0 else 2.0 - turn
        if self.scale == "log":
            return self.start * (self.stop / self.start) ** part
        value = self.start + (self.stop - self.start) * part
        # a course that reaches zero but for rounding reaches it: there a free sphere touches
        return value if abs(value) > 1e-13 * max(abs(self.start), abs(self.stop)) else 0.0

    def pieces(self, start: float, stop: float, duration: float) -> list[Piece]:
        ends = [(start, self.at(start, duration)), *self._turns(start, stop, duration), (stop, self.at(stop, duration))]
        return [self.smooth(*ends[k], *ends[k + 1], duration) for k in range(len(ends) - 1)]

    def _turns(self, start: float, stop: float, duration: float) -> list[tuple[float, float]]:
        """Times strictly between two others at which the course turns back, and its values there."""
        if not self.cycles:
            return []
        half = duration / (2.0 * self.cycles)
        first, last = math.floor(start / half), math.ceil(stop / half)
        low, high = start + _SAME * duration, stop - _SAME * duration
        return [(k * half, self.stop if k % 2 else self.start) for k in range(first, last + 1) if low < k * half < high]

    def smooth(self, start: float, first: float, stop: float, last: float, duration: float) -> Piece:
        """The way between two values, in between which the course does not turn."""
        if self.scale == "linear":
            return linear_piece(start, stop, first, last)
        rate = math.log(self.stop / self.start) * max(1, 2 * self.cycles) / duration
        rate = math.copysign(rate, abs(last) - abs(first))
        integral = first * math.expm1(rate * (stop - start)) / rate if rate else first * (stop - start)
        return Piece(start, stop, first, last, integral, abs(integral))


def table_pieces(times: np.ndarray, values: np.ndarray, start: float, stop: float, duration: float) -> list[Piece]:
    """Pieces of a table that is linear between its rows and keeps its last value; two rows at one time are a jump."""
    start, stop = _snapped(times, start, duration), _snapped(times, stop, duration)
    inside = times[(times > start) & (times < stop)]
    edges: Sequence[float] = np.unique([start, *inside, stop]).tolist() if stop > start else [start, stop]
    pieces = []
    for left, right in itertools.pairwise(edges):
        row = int(np.searchsorted(times, 0.5 * (left + right), "right")) - 1
        ends = np.interp([left, right], times[row : row + 2], values[row : row + 2])
        pieces.append(linear_piece(left, right, *ends.tolist()))
    return pieces


def _snapped(times: np.ndarray, time: float, duration: float) -> float:
    """The row's time where a clock time is meant to be the same but for rounding."""
    nearest = float(times[np.argmin(np.abs(times - time))])
    return nearest if abs(nearest - time) <= _SAME * duration else time


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

    time: tuple[Annotated[float, _TIME], ...]
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
    def _rows(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.time), np.array(self.extremes)

    @property
    def end(self) -> float:
        return self.time[-1]

    def at(self, time: float, duration: float) -> float:
        return table_pieces(*self._rows, time, time, duration)[0].first

    def pieces(self, start: float, stop: float, duration: float) -> list[Piece]:
        return table_pieces(*self._rows, start, stop, duration)


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
        value: tuple[Annotated[float, unit], ...]
        file: Annotated[str, Field(description=f"CSV with the columns `time` and `{name}`, in place of these")] = ""

    number, course = Annotated[float, unit, Tag("[value]")], Annotated[_Course, Tag("[course]")]
    return Annotated[number | course | Annotated[_Table, Tag("[table]")], Discriminator(_kind)]


#: A value prescribed over a run.
Prescribed = Number | Course | Table


def prescribed(given: float | Course | Table) -> Prescribed:
    """The course in time of what a scenario gives."""
    return given if isinstance(given, Course | Table) else Number(given)
