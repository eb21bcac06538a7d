"""Motion of the slider. Simple to full: steady, start, ramp, table.

A prescribed drive is a function of time, the same for all members. It gives the exact slip of a
step, never the speed times the step, so that parts that live on slip see no step error.
"""

import math
from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.parts.exchange import Array, Motion, Motions, Setting, Times
from sim.units.course import Course, Number, Pieces, Table as Rows, table_pieces
from sim.units.quantity import Quantity
from sim.units.table import at_once

_SPEED = Quantity("m/s", "sliding speed", "V")


class Slider(NamedTuple):
    """State of a prescribed drive: displacement since the start [m] and speed [m/s]."""

    position: Array
    speed: Array


#: Steps of which the motion is made at once for those who go one by one.
_AHEAD = 1024


class _Sliding:
    """Motion as a given function of time; a subclass gives ``pieces``."""

    state_class: ClassVar[type[Slider]] = Slider
    per_member: ClassVar[bool] = False
    solves_motion: ClassVar[bool] = False
    at_once: ClassVar[bool] = False
    contact_stiffness: ClassVar[str] = "rigid"

    def begin(self, times: Times, members: int) -> tuple[Slider, Motion]:
        motion = self.motion(0, 0.0, 0.0, times.duration)
        return Slider(np.zeros(1), motion.speed), motion

    def advance(self, state: Slider, times: Times, steps: range) -> tuple[Slider, Motions]:
        found = self._of_steps(times, steps) if len(steps) > 1 else self._of_one(times, steps.start)
        time, duration, slip, path, first, speed, unsteady = found
        position = np.add.accumulate(np.concatenate([state.position[np.newaxis], slip]))[1:]
        motions = Motions(steps.start, time, duration, slip, path, first, speed, position, unsteady)
        return Slider(position[-1], speed[-1]), motions

    def _of_steps(self, times: Times, steps: range) -> Array:
        """Rows of ``_sums`` for a block of steps, shape (7, steps, 1)."""
        ends = times.at(np.arange(steps.start - 1.0, steps.stop))
        return np.array(self._sums(ends, times.duration))[:, :, np.newaxis]

    def _of_one(self, times: Times, step: int) -> Array:
        """Rows of ``_sums`` for a single step, made for many at once and kept."""
        before = (step - 1) // _AHEAD * _AHEAD
        if (known := self._kept.get((times, before))) is None:
            known = self._of_steps(times, range(before + 1, min(before + _AHEAD, times.steps) + 1))
            self._kept.clear()
            self._kept[times, before] = known
        return known[:, step - before - 1 : step - before]

    @cached_property
    def _kept(self) -> dict[tuple[Times, int], Array]:
        return {}

    def readings(self, state: Slider) -> Array:
        return np.empty((1, 0))

    def remarks(self, setting: Setting) -> list[str]:
        return []

    def pieces(self, ends: Array, duration: float) -> Pieces:
        """The speed in the intervals between some times [s], in pieces."""
        raise NotImplementedError

    def motion(self, step: int, start: float, stop: float, duration: float) -> Motion:
        """Slip, path and final speed from time ``start`` to ``stop`` of a run of ``duration`` [s]."""
        time, span, *sums = self._sums(np.array([start, stop]), duration)
        return Motion(step, time.item(), span.item(), *sums)

    def _sums(self, ends: Array, duration: float) -> tuple[Array, ...]:
        """End and length of each interval between times [s], slip and path in it [m], speeds at its ends [m/s].

        Last ``unsteady`` of ``Motion``.
        """
        pieces = self.pieces(ends, duration).joined
        return ends[1:], np.diff(ends), pieces.integral, pieces.path, pieces.first, pieces.last, pieces.unsteady


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_Sliding):
    """A constant speed; zero is a contact at rest.

    >>> float(Steady(speed=1e-3).motion(1, 0.0, 2.0, 10.0).slip[0])
    0.002
    """

    speed: Annotated[float, _SPEED] = 0.0
    model: Literal["steady"] = "steady"

    end: ClassVar[float] = math.inf

    def pieces(self, ends: Array, duration: float) -> Pieces:
        return Number(self.speed).pieces(ends, duration)


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

    def pieces(self, ends: Array, duration: float) -> Pieces:
        times, speeds = np.array([0.0, self.rest, self.rest]), np.array([0.0, 0.0, self.speed])
        return table_pieces(times, speeds, ends, duration)


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid", "populate_by_name": True})
class Ramp(Course, _Sliding):
    """A speed that goes from one value to another over the whole run, linearly or logarithmically.

    In a scenario file the two ends are called ``from`` and ``to``.
    """

    start: Annotated[float, _SPEED, Field(alias="from")]
    stop: Annotated[float, _SPEED, Field(alias="to")]
    model: Literal["ramp"] = "ramp"


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
class Table(Rows, _Sliding):
    """A speed tabulated over time, linear between the rows; two rows at one time are a jump.

    In a scenario file ``file`` names a CSV with the columns ``time`` and ``speed``, each with its
    unit in brackets; in Python give the two columns [s], [m/s].
    """

    quantity: ClassVar[Quantity] = _SPEED
    column: ClassVar[str] = "speed"
    values_in: ClassVar[str] = "speed"

    speed: Annotated[tuple[Annotated[float, _SPEED], ...], at_once(_SPEED)]
    model: Literal["table"] = "table"
