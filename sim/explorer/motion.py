"""The motion of the first member of a scenario, in blocks that go on while the numbers of the scenario change."""

import secrets
import time
from typing import Any, NamedTuple

import numpy as np

from sim.ensemble.variables import LARGEST, READ
from sim.explorer.drawing import listed
from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario
from sim.step.state import MemberNoise, State, pack
from sim.units.notation import engineering

#: Parts of a long motion that is drawn beside another one.
_PARTS = 200
#: Motions that are kept; blocks of a motion; time of an answer [s]; digits of a number.
_KEPT, _BLOCKS, _LONG, _DIGITS = 4, 100, 0.1, 6
#: Quantities that are sent, those of a slider that is driven through a spring or by a force, and of a moving mount.
_ALWAYS = (
    "contact_area",
    "contact_radius",
    "friction_force",
    "fluctuation_energy",
    "speed",
)
_DRIVEN = ("slider_position",)
_SPRING = ("stage_position", "stage_speed", "spring_force")
_MOUNT = ("normal_load", "indentation", "displacement")


class _Motion(NamedTuple):
    """States of a motion at the ends of its blocks, by their clock step."""

    states: dict[int, State]
    shapes: dict[str, tuple[int, ...]]


class Motions:
    """The motions of a page. A page keeps few, because each has many states."""

    def __init__(self) -> None:
        self._motions: dict[str, _Motion] = {}

    def advance(self, scene: Scenario, run: str, step: int) -> dict[str, Any]:
        """Advance a motion for a while under the present numbers of a scenario.

        Parameters
        ----------
        scene : Scenario
            Scenario with the present numbers.
        run : str
            Name of the motion; another name begins a new one.
        step : int
            Clock step at the end of a block, from which the motion goes on.

        Returns
        -------
        dict
            ``run``, ``first`` and ``last`` step, ``duration`` [s], ``is_new`` (True if the motion
            began anew, because it is unknown or its arrays have other shapes), ``columns`` in SI
            by name, of which ``t`` is the time, and ``words`` on the slip events since its start.
        """
        stepper, noise = scene.stepper, MemberNoise.of(scene.seed, np.arange(1))
        start = stepper.start(noise)
        shapes = {name: array.shape for name, array in pack(start).items()}
        motion = self._motions.get(run)
        is_new = motion is None or motion.shapes != shapes or step not in motion.states
        if motion is None or is_new:
            run, step = secrets.token_hex(8), 0
            motion = _Motion({0: start}, shapes)
            self._motions = dict([*self._motions.items()][1 - _KEPT :]) | {run: motion}
        if step == 0:  # the start depends on the numbers
            motion.states[0] = start
        for later in [known for known in motion.states if known > step]:
            del motion.states[later]
        whole, state, courses = scene.clock.steps, motion.states[step], []
        block, first, began = max(1, whole // _BLOCKS), step, time.perf_counter()
        while step < whole and (step == first or time.perf_counter() - began < _LONG):
            last = min(step + block, whole)
            state, course = stepper.advance(
                state, noise, range(step + bool(step), last + 1)
            )
            motion.states[last], step = state, last
            courses.append(course)
        columns = {
            name: _rounded(values) for name, values in _columns(scene, courses).items()
        }
        return {
            "run": run,
            "first": first,
            "last": step,
            "duration": scene.clock.duration,
            "steps": whole,
            "is_new": bool(is_new),
            "columns": columns,
            "words": _slip_events(scene, state),
        }


def course(scene: Scenario) -> dict[str, list[float | None]]:
    """Return the whole motion of the first member of a scene.

    Of a long one each of 200 parts keeps its first record, and the least and the largest number of each column.
    """
    stepper, noise = scene.stepper, MemberNoise.of(scene.seed, np.arange(1))
    whole = range(scene.clock.steps + 1)
    columns = _columns(scene, [stepper.advance(stepper.start(noise), noise, whole)[1]])
    kept = set[int]()
    for part in np.array_split(np.arange(len(whole)), min(_PARTS, len(whole))):
        kept.add(int(part[0]))
        for values in columns.values():
            here = np.nan_to_num(values[part])
            kept |= {int(part[here.argmin()]), int(part[here.argmax()])}
    order = sorted(kept)
    return {name: _rounded(values[order]) for name, values in columns.items()}


def _slip_events(scene: Scenario, state: State) -> str:
    """Return the number of slip events and the speeds of the stage at which they set in and end, in words.

    They are those of ``sim run``; "" if no stage pulls.
    """
    if scene.drive.model != "spring":
        return ""
    read = {row.name: row.read for row in LARGEST if row.part == "drive"}
    count = int(read["slip_count"](scene, state)[0])
    if not count:
        return "no slip event"
    words = f"{count} slip event{'s' * (count > 1)}"
    for side, *order in (
        ("from", "onset_steady_speed", "onset_slip_speed"),
        ("up to", "end_slip_speed", "end_steady_speed"),
    ):
        ends = [float(read[one](scene, state)[0]) for one in order]
        if np.isfinite(ends).all():
            between = " and ".join(engineering(end, "m/s") for end in ends)
            words += f", {side} a stage speed between {between}"
    return words


def _columns(scene: Scenario, courses: list[Any]) -> dict[str, Array]:
    """Return time and quantities of the parts of a motion, one after the other."""
    columns = {"t": np.concatenate([np.ravel(one.time) for one in courses])}
    for name in _names(scene):
        parts = [
            np.ravel(np.broadcast_to(READ[name](scene, one), one.time.shape))
            for one in courses
        ]
        columns[name] = np.concatenate(parts)
    return columns


def _names(scene: Scenario) -> list[str]:
    names = [*_ALWAYS, *(_MOUNT if scene.contact.changes else ())]
    if scene.drive.solves_motion:
        names += _DRIVEN
        names += _SPRING if scene.drive.model == "spring" else ()
    return names


def _rounded(values: Array) -> list[float | None]:
    """Return numbers of few digits as JSON has them."""
    return [
        None if value is None else float(f"{value:.{_DIGITS}g}")
        for value in listed(np.ravel(values))
    ]
