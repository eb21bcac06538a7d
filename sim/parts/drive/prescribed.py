"""Drives: how the slider moves. Shallow to deep: steady, start, ramp, table.

A prescribed drive is a function of time, the same for all members. It gives the exact slip of a
step, never the speed times the step, so that parts that live on slip see no step error.
"""

import itertools
import math
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.parts.exchange import Motion
from sim.units.quantity import Quantity
from sim.units.table import TableError, columns, file_text

_SPEED = Quantity("m/s", "sliding speed", "V")
_TIME = Quantity("s", "time", "t")


class _Piece(NamedTuple):
    """A stretch of motion: slip [m], path [m], and the speeds at its two ends [m/s]."""

    slip: float
    path: float
    first: float
    last: float


class _Prescribed:
    """A drive whose speed is a given function of time; a subclass gives ``pieces``."""

    per_member: ClassVar[bool] = False

    def pieces(self, start: float, stop: float, duration: float) -> list[_Piece]:
        """The motion from ``start`` to ``stop`` [s] in pieces."""
        raise NotImplementedError

    def motion(self, step: int, start: float, stop: float, duration: float) -> Motion:
        """Slip, path and final speed from time ``start`` to ``stop`` of a run of ``duration`` [s]."""
        pieces = self.pieces(start, stop, duration)
        return Motion(
            step=step,
            time=stop,
            duration=stop - start,
            slip=np.array([math.fsum(piece.slip for piece in pieces)]),
            path=np.array([math.fsum(piece.path for piece in pieces)]),
            first=np.array([pieces[0].first]),
            speed=np.array([pieces[-1].last]),
        )


def _linear_piece(first: float, last: float, time: float) -> _Piece:
    """A piece in which the speed changes linearly over ``time``."""
    slip = 0.5 * (first + last) * time
    if first * last >= 0.0:
        return _Piece(slip, abs(slip), first, last)
    return _Piece(slip, 0.5 * (first**2 + last**2) / abs(last - first) * time, first, last)


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_Prescribed):
    """A constant speed; zero is a contact at rest.

    >>> float(Steady(speed=1e-3).motion(1, 0.0, 2.0, 10.0).slip[0])
    0.002
    """

    speed: Annotated[float, _SPEED] = 0.0
    model: Literal["steady"] = "steady"

    def pieces(self, start: float, stop: float, duration: float) -> list[_Piece]:
        slip = self.speed * (stop - start)
        return [_Piece(slip, abs(slip), self.speed, self.speed)]


@dataclass(frozen=True, config={"extra": "forbid"})
class Start(_Prescribed):
    """At rest for a while, then a constant speed at once: static friction and ageing.

    >>> motion = Start(rest=1.0, speed=1e-3).motion(1, 0.0, 3.0, 10.0)
    >>> print(float(motion.slip[0]), float(motion.first[0]), float(motion.speed[0]))
    0.002 0.0 0.001
    """

    rest: Annotated[float, Quantity("s", "time at rest before sliding", "t_w", at_least=0)]
    speed: Annotated[float, _SPEED]
    model: Literal["start"] = "start"

    def pieces(self, start: float, stop: float, duration: float) -> list[_Piece]:
        near = [time for time in (start, stop) if abs(self.rest - time) <= 1e-9 * duration]
        rest = near[0] if near else self.rest  # a clock time meant to be the same but for rounding
        slip = self.speed * (stop - max(start, rest))
        still, sliding = _Piece(0.0, 0.0, 0.0, 0.0), _Piece(slip, abs(slip), self.speed, self.speed)
        if start >= rest:
            return [sliding]
        return [still] if stop <= rest else [still, sliding]


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Ramp(_Prescribed):
    """A speed that goes from ``start`` to ``stop`` over the whole run, linearly or logarithmically.

    In a scenario file the two ends are called ``from`` and ``to``.

    Notes
    -----
    Logarithmic: V(t) = V0 r^(t/T) with r = V1/V0, and the slip of a step is
    V(t) T/ln r (r^(dt/T) − 1), taken with expm1.
    """

    start: Annotated[float, _SPEED, Field(alias="from")]
    stop: Annotated[float, _SPEED, Field(alias="to")]
    scale: Literal["linear", "log"] = "linear"
    model: Literal["ramp"] = "ramp"

    @model_validator(mode="after")
    def _log_needs_one_sign(self) -> "Ramp":
        if self.scale == "log" and self.start * self.stop <= 0.0:
            raise PydanticCustomError(
                "log_through_zero",
                'a logarithmic ramp cannot reach or pass zero; give two speeds above zero or scale = "linear"',
            )
        return self

    def pieces(self, start: float, stop: float, duration: float) -> list[_Piece]:
        if self.scale == "linear":
            slope = (self.stop - self.start) / duration
            return [_linear_piece(self.start + slope * start, self.start + slope * stop, stop - start)]
        rate = math.log(self.stop / self.start) / duration
        before, after = (self.start * math.exp(rate * time) for time in (start, stop))
        slip = before * math.expm1(rate * (stop - start)) / rate if rate else before * (stop - start)
        return [_Piece(slip, abs(slip), before, after)]


@dataclass(frozen=True, config={"extra": "forbid"})
class Table(_Prescribed):
    """A speed tabulated over time, linear between the rows; two rows at one time are a jump.

    In a scenario file ``file`` names a CSV with the columns ``time`` and ``speed``, each with its
    unit in brackets; in Python give the two columns [s], [m/s].
    """

    time: tuple[Annotated[float, _TIME], ...]
    speed: tuple[Annotated[float, _SPEED], ...]
    file: str = ""
    model: Literal["table"] = "table"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        if not isinstance(values, dict) or not isinstance(values.get("file"), str) or "time" in values:
            return values
        try:
            text = file_text(values["file"], info.context)
            return {**values, **columns(text, {"time": _TIME, "speed": _SPEED})}
        except TableError as fault:
            raise PydanticCustomError("table", "{file}: {said}", {"file": values["file"], "said": str(fault)}) from None

    @model_validator(mode="after")
    def _rows_in_order(self) -> "Table":
        if len(self.time) != len(self.speed) or len(self.time) < 2:
            raise PydanticCustomError("short_table", "a table of speeds needs two rows or more")
        if np.any(np.diff(self.time) < 0.0) or self.time[0] > 0.0:
            raise PydanticCustomError("time_order", "times must start at 0 s or before and never decrease")
        return self

    @cached_property
    def _knots(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array(self.time), np.array(self.speed)

    def _snapped(self, time: float, duration: float) -> float:
        """The row's time where a clock time is meant to be the same but for rounding."""
        times, _ = self._knots
        nearest = float(times[np.argmin(np.abs(times - time))])
        return nearest if abs(nearest - time) <= 1e-9 * duration else time

    def _between(self, row: int, time: float) -> float:
        times, speeds = self._knots
        part = (time - times[row]) / (times[row + 1] - times[row])
        return float(speeds[row] + part * (speeds[row + 1] - speeds[row]))

    def pieces(self, start: float, stop: float, duration: float) -> list[_Piece]:
        times, _ = self._knots
        start, stop = (self._snapped(time, duration) for time in (start, stop))
        if stop == start:
            row = min(int(np.searchsorted(times, stop, "right")) - 1, len(times) - 2)
            speed = self._between(row, stop)
            return [_Piece(0.0, 0.0, speed, speed)]
        inside = times[(times > start) & (times < stop)]
        edges = np.unique(np.concatenate([[start], inside, [stop]]))
        pieces = []
        for left, right in itertools.pairwise(edges):
            row = min(int(np.searchsorted(times, 0.5 * (left + right), "right")) - 1, len(times) - 2)
            first, last = self._between(row, left), self._between(row, right)
            pieces.append(_linear_piece(first, last, right - left))
        return pieces


Drive = Annotated[Steady | Start | Ramp | Table, Field(discriminator="model")]
