"""Phases of a run: intervals in which no prescribed course turns, stops, starts or jumps."""

import math
from typing import Any, NamedTuple, cast

import numpy as np

from sim.parts.contact import Contact
from sim.parts.drive import Drive
from sim.parts.exchange import Times
from sim.units.tables import Pieces

#: Phases of a run that are told apart at most.
_MOST_PHASES = 1000
#: Times nearer than this share of the run, and values nearer than this share of the largest, are the same.
_SAME = 1e-9


class Phases(NamedTuple):
    """Phases of a run: their starts [s], names, and the first clock step of each.

    ``slows`` is True for each phase in which the prescribed motion gets slower, or begins slower than before or in the
    other direction. ``jumps`` has the names of the courses that jump where a phase starts, ``drive`` and ``mount``.
    """

    starts: tuple[float, ...]
    names: tuple[str, ...]
    steps: tuple[int, ...]
    slows: tuple[bool, ...]
    jumps: tuple[frozenset[str], ...]

    @property
    def rests(self) -> tuple[bool, ...]:
        """True for each phase in which the slider or the stage rests."""
        return tuple("rest" in name.split(", ") for name in self.names)


def phases(drive: Drive, contact: Contact, times: Times) -> Phases:
    """Return the phases of a run: maximal intervals in which no prescribed course turns, stops, starts or jumps.

    The speed of a drive keeps its sign, too. A phase that is shorter than a clock step is none.
    """
    whole = np.array([0.0, times.duration])
    slider, kind = cast(Any, drive), contact.kind
    forced = slider.solves_motion and not slider.spring
    course = slider.driven if slider.solves_motion else slider.pieces
    moved = _turns(course(whole, times.duration), signed=True)
    pressed = _turns(contact.course.pieces(whole, times.duration), signed=False)
    steady, words = ("constant force", "force") if forced else ("sliding", "speed")
    of_drive = {0.0: steady, 1.0: f"increasing {words}", -1.0: f"decreasing {words}"}
    of_contact = {0.0: f"constant {kind}", 1.0: "approach", -1.0: "retraction"}
    starts = sorted({*moved, *pressed})
    result: dict[int, tuple[float, str, bool, frozenset[str]]] = {}
    for start in starts:
        place = [max(at for at in course if at <= start) for course in (moved, pressed)]
        now = moved[place[0]]
        names = [
            "rest" if now.sense == 0.0 else of_drive[now.trend],
            of_contact[pressed[place[1]].trend],
        ]
        shown = [
            name
            for name, course in zip(names, (moved, pressed), strict=True)
            if len(course) > 1
        ]
        # the first whose middle is later
        step = math.floor(start / times.step + 0.5) + 1
        if step <= times.steps:
            slows = now.trend < 0.0 or (start in moved and now.gain < 0.0)
            of = zip(("drive", "mount"), (moved, pressed), strict=True)
            jumps = frozenset(
                name for name, course in of if start in course and course[start].jumps
            )
            result[step] = start, ", ".join(shown or names[:1]), slows, jumps
    steps = sorted(result)[:_MOST_PHASES]
    columns: Any = zip(*(result[step] for step in steps), strict=True)
    begins, titles, slowing, jumping = columns
    return Phases(begins, titles, tuple(steps), slowing, jumping)


class _Turn(NamedTuple):
    """Sense and trend of a course from a time on, and its change at that time, if it ``jumps``.

    The sense of a course that is not signed is 1; the trend of one that is that of its magnitude. The ``gain`` is how
    much the value at the start exceeds the one before, in the sense of the latter.
    """

    sense: float
    trend: float
    gain: float
    jumps: bool


def _turns(pieces: Pieces, signed: bool) -> dict[float, _Turn]:
    """Return the starts of intervals [s] in which a course keeps its sense and its trend."""
    largest = max(np.abs(pieces.first).max(), np.abs(pieces.last).max())
    result: dict[float, _Turn] = {}
    before, value = (math.nan, math.nan), math.nan
    for start, stop, first, last in zip(*pieces[1:5], strict=True):
        crossing = (
            start + (stop - start) * first / (first - last)
            if signed and first * last < 0.0
            else stop
        )
        parts = (
            ((start, first, 0.0), (crossing, 0.0, last))
            if crossing < stop
            else ((start, first, last),)
        )
        for at, low, high in parts:
            sense = float(np.sign(low + high)) if signed else 1.0
            change = (high - low) * sense
            now = (
                sense,
                float(np.sign(change)) if abs(change) > _SAME * largest else 0.0,
            )
            jumps = abs(low - value) > _SAME * largest
            if now != before or jumps:
                gain = (low - value) * before[0] if jumps else 0.0
                result[float(at)] = _Turn(*now, gain, bool(jumps))
            before, value = now, high
    return result
