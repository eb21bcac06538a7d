"""Motion of the slider. Simple to full: steady, start, ramp, table.

A prescribed drive is a function of time, the same for all members. It gives the exact slip of a
step, never the speed times the step, so that parts that live on slip see no step error.
"""

import itertools
import math
from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.parts.exchange import Array, Motion, Motions, Resistance, Setting, Times
from sim.units.course import Course, Number, Piece, Table as Rows, table_pieces
from sim.units.quantity import Quantity

_SPEED = Quantity("m/s", "sliding speed", "V")


class Slider(NamedTuple):
    """State of a prescribed drive: displacement since the start [m] and speed [m/s]."""

    position: Array
    speed: Array


class _Sliding:
    """Motion as a given function of time; a subclass gives ``pieces``."""

    state_class: ClassVar[type[Slider]] = Slider
    per_member: ClassVar[bool] = False
    feeds_back: ClassVar[bool] = False

    def begin(self, times: Times) -> tuple[Slider, Motion]:
        motion = self.motion(0, 0.0, 0.0, times.duration)
        return Slider(np.zeros(1), motion.speed), motion

    def advance(self, state: Slider, resistance: Resistance, times: Times, steps: range) -> tuple[Slider, Motions]:
        ends = [times.at(step) for step in range(steps.start - 1, steps.stop)]
        rows = [_sums(start, stop, pieces) for start, stop, pieces in self.each(ends, times.duration)]
        time, duration, slip, path, first, speed = np.array(rows).T[:, :, np.newaxis]
        position = np.add.accumulate(np.concatenate([state.position[np.newaxis], slip]))[1:]
        motions = Motions(steps.start, time, duration, slip, path, first, speed, position)
        return Slider(position[-1], speed[-1]), motions

    def remarks(self, setting: Setting) -> list[str]:
        return []

    def pieces(self, start: float, stop: float, duration: float) -> list[Piece]:
        """The speed from ``start`` to ``stop`` [s] in pieces."""
        raise NotImplementedError

    def each(self, ends: list[float], duration: float) -> Iterator[tuple[float, float, list[Piece]]]:
        """Start and end of each step [s], and the speed in it in pieces."""
        return ((*span, self.pieces(*span, duration)) for span in itertools.pairwise(ends))

    def motion(self, step: int, start: float, stop: float, duration: float) -> Motion:
        """Slip, path and final speed from time ``start`` to ``stop`` of a run of ``duration`` [s]."""
        time, span, *sums = _sums(start, stop, self.pieces(start, stop, duration))
        return Motion(step, time, span, *np.array(sums)[:, np.newaxis])


def _sums(start: float, stop: float, pieces: list[Piece]) -> tuple[float, ...]:
    """End and length of a step [s], slip and path in it [m], speeds at its ends [m/s]."""
    first, last = pieces[0], pieces[-1]
    slip, path = first.integral, first.path
    if len(pieces) > 1:
        slip, path = math.fsum(piece.integral for piece in pieces), math.fsum(piece.path for piece in pieces)
    return stop, stop - start, slip, path, first.first, last.last


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_Sliding):
    """A constant speed; zero is a contact at rest.

    >>> float(Steady(speed=1e-3).motion(1, 0.0, 2.0, 10.0).slip[0])
    0.002
    """

    speed: Annotated[float, _SPEED] = 0.0
    model: Literal["steady"] = "steady"

    end: ClassVar[float] = math.inf

    def pieces(self, start: float, stop: float, duration: float) -> list[Piece]:
        return Number(self.speed).pieces(start, stop, duration)


@dataclass(frozen=True, config={"extra": "forbid"})
class Start(_Sliding):
    """At rest for a while, then a constant speed at once: static friction and ageing.

    >>> motion = Start(rest=1.0, speed=1e-3).motion(1, 0.0, 3.0, 10.0)
    >>> print(float(motion.slip[0]), float(motion.first[0]), float(motion.speed[0]))
    0.002 0.0 0.001
    """

    rest: Annotated[float, Quantity("s", "time at rest before sliding", "t_w", at_least=0)]
    speed: Annotated[float, _SPEED]
    model: Literal["start"] = "start"

    end: ClassVar[float] = math.inf

    def remarks(self, setting: Setting) -> list[str]:
        still = "the slider rests for the whole run: shorten drive.rest or lengthen clock.duration"
        return [still] if self.rest >= setting.times.duration else []

    def pieces(self, start: float, stop: float, duration: float) -> list[Piece]:
        times, speeds = np.array([0.0, self.rest, self.rest]), np.array([0.0, 0.0, self.speed])
        return table_pieces(times, speeds, start, stop, duration)


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid", "populate_by_name": True})
class Ramp(Course, _Sliding):
    """A speed that goes from one value to another over the whole run, linearly or logarithmically.

    In a scenario file the two ends are called ``from`` and ``to``.
    """

    start: Annotated[float, _SPEED, Field(alias="from")]
    stop: Annotated[float, _SPEED, Field(alias="to")]
    model: Literal["ramp"] = "ramp"

    def each(self, ends: list[float], duration: float) -> Iterator[tuple[float, float, list[Piece]]]:
        speeds = [self.at(end, duration) for end in ends]
        for start, stop, first, last in zip(ends[:-1], ends[1:], speeds[:-1], speeds[1:], strict=True):
            yield start, stop, [self.smooth(start, first, stop, last, duration)]


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
class Table(Rows, _Sliding):
    """A speed tabulated over time, linear between the rows; two rows at one time are a jump.

    In a scenario file ``file`` names a CSV with the columns ``time`` and ``speed``, each with its
    unit in brackets; in Python give the two columns [s], [m/s].
    """

    quantity: ClassVar[Quantity] = _SPEED
    column: ClassVar[str] = "speed"
    values_in: ClassVar[str] = "speed"

    speed: tuple[Annotated[float, _SPEED], ...]
    model: Literal["table"] = "table"


Drive = Annotated[Steady | Start | Ramp | Table, Field(discriminator="model")]
