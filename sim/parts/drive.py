"""Motion of the slider. Simple to full: steady, start, ramp, table, holds, force, spring.

A prescribed drive is a function of time, the same for all members. It gives the exact slip of a step, never the speed
times the step, so that parts that live on slip see no step error.

A force, or a stage that pulls through a spring, feels the friction. The body has a mass and a damping to the
counter-surface. Between body and interface, the contact has the stiffness k_t. The interface may have a viscosity.
Slider and bonds are solved together by ``sim.parts.coupled``.
"""

import math
from dataclasses import fields
from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from sim.parts.exchange import Array, Motion, Part, Setting, Times, record
from sim.solid import ElasticSolid
from sim.units import tables
from sim.units.quantity import Quantity, keyed

_SPEED = Quantity("m/s", "sliding speed", "V")


class Slider(NamedTuple):
    """State of a prescribed drive: displacement since the start [m] and speed [m/s]."""

    position: Array
    speed: Array


#: Steps of which the motion is made at once for those who go one by one.
_AHEAD = 1024


class _Sliding(Part):
    """Motion as a given function of time; a subclass gives ``pieces``."""

    state_class: ClassVar[type[Slider]] = Slider
    #: True if the motion follows from the friction and is solved together with the bonds.
    solves_motion: ClassVar[bool] = False
    #: Tangential forces among which is the largest of a run, if the force is prescribed and not the motion [N].
    forces: ClassVar[tuple[float, ...]] = ()
    #: Viscosity of the interface [Pa s/m], which a prescribed motion does not have.
    viscosity: ClassVar[float] = 0.0

    def faults(self, is_stretched: bool, is_reversible: bool) -> dict[str, str]:
        """Return faults of this drive, as ``_Driven.faults``: none, as it does not feel the friction."""
        return {}

    def begin(self, times: Times, members: int) -> tuple[Slider, Motion]:
        motion = self.motion(0, 0.0, 0.0, times.duration)
        return Slider(np.zeros(1), motion.speed), motion

    def advance(
        self, state: Slider, times: Times, steps: range
    ) -> tuple[Slider, Motion]:
        rows = (
            self._of_steps(times, steps)
            if len(steps) > 1
            else self._of_one(times, steps.start)
        )
        time, duration, slip, path, first, speed, unsteady = rows
        position = np.add.accumulate(
            np.concatenate([state.position[np.newaxis], slip])
        )[1:]
        motions = Motion(
            steps.start, time, duration, slip, path, first, speed, unsteady, position
        )
        return Slider(position[-1], speed[-1]), motions

    def _of_steps(self, times: Times, steps: range) -> Array:
        """Rows of ``_sums`` for a block of steps, shape (7, steps, 1)."""
        ends = times.at(np.arange(steps.start - 1.0, steps.stop))
        return np.array(self._sums(ends, times.duration))[:, :, np.newaxis]

    def _of_one(self, times: Times, step: int) -> Array:
        """Rows of ``_sums`` for a single step, computed for many steps at once."""
        before = (step - 1) // _AHEAD * _AHEAD
        if (rows := self._ahead.get((times, before))) is None:
            rows = self._of_steps(
                times, range(before + 1, min(before + _AHEAD, times.steps) + 1)
            )
            self._ahead.clear()
            self._ahead[times, before] = rows
        return rows[:, step - before - 1 : step - before]

    @cached_property
    def _ahead(self) -> dict[tuple[Times, int], Array]:
        return {}

    def readings(self, state: Slider) -> Array:
        return np.empty((1, 0))

    def stage_of(self, state: Slider) -> Array:
        return np.empty(0)

    def pieces(self, ends: Array, duration: float) -> tables.Pieces:
        """Return the speed in the intervals between some times [s], in pieces."""
        raise NotImplementedError

    def motion(self, step: int, start: float, stop: float, duration: float) -> Motion:
        """Slip, path and final speed from time ``start`` to ``stop`` of a run of ``duration`` [s]."""
        return Motion(step, *self._sums(np.array([start, stop]), duration))

    def _sums(
        self, ends: Array, duration: float
    ) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
        """Return quantities of ``Motion`` from ``time`` to ``unsteady`` in the intervals between times [s]."""
        pieces = self.pieces(ends, duration).joined
        return (
            ends[1:],
            np.diff(ends),
            pieces.integral,
            pieces.path,
            pieces.first,
            pieces.last,
            pieces.unsteady,
        )


@keyed()
class Steady(_Sliding):
    """A constant speed; zero is a contact at rest.

    >>> float(Steady(speed=1e-3).motion(1, 0.0, 2.0, 10.0).slip[0])
    0.002
    """

    speed: Annotated[float, _SPEED] = 0.0
    model: Literal["steady"] = "steady"

    end: ClassVar[float] = math.inf

    def pieces(self, ends: Array, duration: float) -> tables.Pieces:
        return tables.Number(self.speed).pieces(ends, duration)


@keyed()
class Start(_Sliding):
    """At rest for a while, then a constant speed at once: static friction and ageing.

    >>> motion = Start(rest=1.0, speed=1e-3).motion(1, 0.0, 3.0, 10.0)
    >>> print(float(motion.slip[0]), float(motion.first[0]), float(motion.speed[0]))
    0.002 0.0 0.001
    """

    rest: Annotated[
        float, Quantity("s", "time at rest before sliding", "t_w", at_least=0)
    ]
    speed: Annotated[float, _SPEED]
    model: Literal["start"] = "start"

    end: ClassVar[float] = math.inf

    def remarks(self, setting: Setting) -> list[str]:
        still = "the slider rests for the whole run: shorten drive.rest or lengthen clock.duration"
        return [still] if self.rest >= setting.times.duration else []

    def pieces(self, ends: Array, duration: float) -> tables.Pieces:
        times, speeds = (
            np.array([0.0, self.rest, self.rest]),
            np.array([0.0, 0.0, self.speed]),
        )
        return tables.table_pieces(times, speeds, ends, duration)


@keyed(kw_only=True)
class Ramp(tables.Course, _Sliding):
    """A speed that goes from one value to another over the whole run, linearly or logarithmically.

    In a scenario file the two ends are called ``from`` and ``to``.
    """

    start: Annotated[float, _SPEED, Field(alias="from")]
    stop: Annotated[float, _SPEED, Field(alias="to")]
    model: Literal["ramp"] = "ramp"


@keyed(kw_only=True)
class Table(tables.Table, _Sliding):
    """A speed tabulated over time, linear between the rows; two rows at one time are a jump.

    In a scenario, ``file`` names a CSV file with the columns ``time`` and ``speed``, each with its unit in brackets. In
    Python give the two columns [s], [m/s].
    """

    quantity: ClassVar[Quantity] = _SPEED
    column: ClassVar[str] = "speed"
    values_in: ClassVar[str] = "speed"

    speed: Annotated[tuple[Annotated[float, _SPEED], ...], tables.LISTED] = ()
    model: Literal["table"] = "table"


def _too_few_holds(course: tables.Holds, first: float, setting: Setting) -> list[str]:
    """Return a remark if a run ends before the slider has slid after the last hold of a course from a time on [s]."""
    lasts, duration = first + course.lasts, setting.times.duration
    if duration >= lasts * (1.0 - 1e-9):
        return []
    ends = "while the last hold lasts or before, so that its peak is missing"
    if duration > (lasts - course.slide) * (1.0 + 1e-9):
        ends = "while the slider slides after the last hold, whose peak is missing if it comes later"
    return [f"the run ends {ends}: set clock.duration to {lasts:.6g} s or more"]


@keyed(kw_only=True)
class Holds(tables.Holds, _Sliding):
    """Slide–hold–slide: sliding at a speed and holds at rest in turn; bonds age in the holds.

    >>> drive = Holds(speed=1e-3, slide=2.0, holds=(1.0, 10.0))
    >>> float(drive.motion(1, 0.0, 17.0, 17.0).slip[0])
    0.006
    """

    model: Literal["holds"] = "holds"

    def remarks(self, setting: Setting) -> list[str]:
        return _too_few_holds(self, 0.0, setting)


_Tolerance = Annotated[
    float,
    Quantity("1", "tolerance of the slider's motion", "", at_least=1e-12, at_most=1e-2),
]
#: Columns of ``Driven.energies``: work of the drive; lost to damping, viscosity, rupture, snaps and to the area as it
#: changes; stored now, and at the start.
ENERGY = record("work damping viscosity rupture snaps area stored first")
#: Columns of the readings of a drive that feels the friction.
READINGS = (
    "stage_position",
    "stage_speed",
    "spring_force",
    "drive_work",
    "stored_energy",
    "dissipated_by_damping",
    "dissipated_by_viscosity",
    "dissipated_by_rupture",
    "dissipated_by_snaps",
    "dissipated_by_area",
    "energy_residual",
    "substeps",
    "runaway_time",
    "unresolved_time",
)


class Driven(NamedTuple):
    """State of a driven slider; arrays of shape (members,).

    Attributes
    ----------
    position, body_speed : array
        Displacement of the body since the start [m], and its speed [m/s].
    speed : array
        Sliding speed, that of the interface [m/s].
    spring_force : array
        Force of the spring, or that prescribed [N].
    sheared : array
        Shear displacement of the contact between body and interface [m].
    stage_position, stage_speed : array
        Displacement [m] and speed [m/s] of the stage; 0 without one.
    radius : array
        Contact radius in the sub-steps [m], 0 where it is open.
    next_step : array
        Length of the next sub-step [s].
    substeps : array
        Sub-steps since the start.
    runaway_time : array
        Time at which the slider lost stability [s], nan if never.
    unresolved_time : array
        Time from which on the motion could not be resolved [s], nan if never.
    energies : array, shape (members, 8)
        Energies since the start [J], columns of ``ENERGY``.
    acceleration : array
        Acceleration of the interface in the last sub-step [m/s²], where bonds resolved by stretch use it, else 0.
    """

    position: Array
    body_speed: Array
    speed: Array
    spring_force: Array
    sheared: Array
    stage_position: Array
    stage_speed: Array
    radius: Array
    next_step: Array
    substeps: Array
    runaway_time: Array
    unresolved_time: Array
    energies: Array
    acceleration: Array

    @property
    def work(self) -> Array:
        """Work of the stage or of the force since the start [J]."""
        return self.energies[..., 0]

    def at(self, k: int) -> "Driven":
        """Return the slider at the end of step k of a block."""
        return Driven(*(values[k] for values in self))


@keyed(kw_only=True)
class _Driven(Part):
    """Keys and attributes of a drive that feels the friction."""

    state_class: ClassVar[type[Driven]] = Driven
    solves_motion: ClassVar[bool] = True
    forces: ClassVar[tuple[float, ...]] = ()

    mass: Annotated[float, Quantity("kg", "mass of the body", "m", at_least=0)] = 0.0
    damping: Annotated[
        float, Quantity("N s/m", "damping of the body", "c", at_least=0)
    ] = 0.0
    viscosity: Annotated[
        float, Quantity("Pa s/m", "viscosity of the interface", "eta", at_least=0)
    ] = 0.0
    contact_stiffness: Annotated[
        Annotated[
            float,
            Quantity("N/m", "tangential stiffness of the contact", "k_t", above=0),
        ]
        | Literal["half_space", "rigid"],
        Field(
            description='"half_space": that of the half-space, or of the layer, under a uniform stress'
        ),
    ] = "half_space"
    tolerance: _Tolerance = 1e-6

    #: Stiffness of the spring [N/m]; 0 where the force is prescribed.
    spring: ClassVar[float] = 0.0

    def faults(self, is_stretched: bool, is_reversible: bool) -> dict[str, str]:
        """Return faults of this drive by key of the scenario.

        ``is_stretched`` is true with bonds that have a stretch, ``is_reversible`` in a contact whose adhesion pays for
        the mean stress.
        """
        faults = {}
        if not is_stretched and self.contact_stiffness != "rigid":
            fault = "bonds without a stretch allow no slip between interface and body"
            faults["drive.contact_stiffness"] = (
                f'{fault}: take "rigid", or bonds with a rupture'
            )
        if self.mass + self.damping + self.viscosity > 0.0:
            return faults
        if not is_stretched:
            fault = "the slip speed of bonds without a stretch is not determined"
            faults["drive"] = (
                f"{fault}: give drive.damping, mass or viscosity, or bonds with a rupture"
            )
        if is_reversible:
            fault = "lets friction drop with the contact at once"
            faults["contact.reversible"] = (
                f"{fault}: give drive.mass, damping or viscosity"
            )
        return faults

    @property
    def in_holds(self) -> "_Driven":
        """Drive of the body while the stage holds."""
        return self

    @property
    def course(self) -> tables.Prescribed:
        """Prescribed course over time."""
        raise NotImplementedError

    @property
    def end(self) -> float:
        return self.course.end

    def begin(self, times: Times, members: int) -> tuple[Driven, Motion]:
        speed = np.full(members, self._first_speed(times.duration))
        zero = np.zeros(members)
        never = np.full(members, np.nan)
        state = Driven(*(zero for _ in Driven._fields))._replace(
            body_speed=speed,
            speed=speed,
            runaway_time=never,
            unresolved_time=never,
            energies=np.zeros((members, 8)),
        )
        return state, Motion(0, np.zeros(1), np.zeros(1), zero, zero, speed, speed)

    def first(self, duration: float) -> float:
        """Return the prescribed speed of the stage [m/s] or force [N] at the start."""
        return float(self.course.at(np.zeros(1), duration)[0])

    def _first_speed(self, duration: float) -> float:
        """Speed of the slider at the start [m/s]."""
        return 0.0

    def yields(self, solid: ElasticSolid) -> tuple[float, float]:
        """Return 1/k_t of a small contact of radius a as (constant [m/N], slope over 1/a [m²/N])."""
        if self.contact_stiffness == "half_space":
            return 0.0, float(solid.half_space.tangential_compliance(1.0))
        return (
            (0.0, 0.0)
            if self.contact_stiffness == "rigid"
            else (1.0 / float(self.contact_stiffness), 0.0)
        )

    def compliance(self, solid: ElasticSolid, radius: Array) -> Array:
        """Return 1/k_t of contacts of some radii [m] on a solid [m/N], 0 if they are rigid or open."""
        is_closed = radius > 0.0
        yields, slope = self.yields(solid)
        if slope == 0.0:
            return np.where(is_closed, yields, 0.0)
        size = np.where(is_closed, radius, 1.0)
        return np.where(is_closed, solid.tangential_compliance(size), 0.0)

    def driven(self, ends: Array, duration: float) -> tables.Pieces:
        """Return the prescribed speed of the stage or force in the intervals between some times [s]."""
        return self.course.pieces(ends, duration)

    def readings(self, state: Driven) -> Array:
        """Recorded quantities of the drive, columns ``READINGS``, as last axis."""
        work, *spent, stored, first = (
            state.energies[..., k] for k in range(state.energies.shape[-1])
        )
        residual = work - (stored - first) - sum(spent)
        stage = state.stage_position, state.stage_speed, state.spring_force
        readings = np.empty((*work.shape, len(READINGS)))
        ends = state.runaway_time, state.unresolved_time
        for k, column in enumerate(
            (*stage, work, stored, *spent, residual, state.substeps, *ends)
        ):
            readings[..., k] = column
        return readings


@keyed(kw_only=True)
class Force(_Driven):
    """A prescribed tangential force: creep, ageing under load, the static threshold. Limit: ``Spring`` as K -> 0.

    A member ends with the time of its runaway if the bonds no longer bear the force and neither mass, damping nor the
    viscosity of a closed contact limits the speed.
    """

    force: tables.over_time(Quantity("N", "tangential force on the body", "Q"), "force")  # type: ignore[valid-type]
    model: Literal["force"] = "force"

    @property
    def forces(self) -> tuple[float, ...]:  # type: ignore[override]
        return self.course.extremes

    @property
    def course(self) -> tables.Prescribed:
        return tables.prescribed(self.force)

    def pieces(self, ends: Array, duration: float) -> tables.Pieces:
        return tables.Number(0.0).pieces(ends, duration)

    def stage_of(self, state: Driven) -> Array:
        return np.empty(0)


@keyed(kw_only=True)
class StageHolds(tables.Holds):
    """Slide–hold–slide of a stage: sliding at a speed and holds in turn.

    An *unloaded* hold is that in which the spring has no force: the stage returns at its start until the spring is
    relaxed, and then follows the slider. The spring is relaxed, too, when the stage moves again.
    """

    while_held: Annotated[
        Literal["rest", "unloaded"],
        Field(
            description='"rest": the stage rests in a hold; "unloaded": it keeps the spring relaxed'
        ),
    ] = "rest"


@keyed(kw_only=True)
class Spring(_Driven):
    """A stage that pulls the body through a spring: stick-slip. Limit: the stage's own motion as K -> infinity."""

    stage: tables.over_time(  # type: ignore[valid-type]
        Quantity("m/s", "speed of the stage", "V"), "speed", StageHolds
    )
    stiffness: Annotated[
        float, Quantity("N/m", "stiffness of the spring", "K", above=0)
    ]
    start_after: Annotated[
        float, Quantity("s", "time at rest before the stage moves", "t_w", at_least=0)
    ] = 0.0
    start: Annotated[
        Literal["rest", "steady"],
        Field(
            description='"steady": moving with the stage; it remains so until disturbed, even if unstable'
        ),
    ] = "rest"
    model: Literal["spring"] = "spring"

    @property
    def spring(self) -> float:  # type: ignore[override]
        return self.stiffness

    @property
    def course(self) -> tables.Prescribed:
        return tables.prescribed(self.stage)

    @property
    def end(self) -> float:
        return self.start_after + self.course.end

    def remarks(self, setting: Setting) -> list[str]:
        if not isinstance(self.stage, StageHolds):
            return []
        return _too_few_holds(self.stage, self.start_after, setting)

    @cached_property
    def in_holds(self) -> _Driven:  # type: ignore[override]
        """This drive, or if the stage then relaxes the spring, its limit K -> 0 at no force."""
        stage = self.stage
        if not isinstance(stage, StageHolds) or stage.while_held == "rest":
            return self
        kept = {each.name: getattr(self, each.name) for each in fields(_Driven)}
        return Force(force=0.0, **kept)

    def unloaded(self, slider: Driven) -> Driven:
        """Return the slider after the stage has taken back the energy of the spring, F²/(2K)."""
        returned = 0.5 * slider.spring_force**2 / self.stiffness
        energies = slider.energies.copy()
        for name in ("work", "stored"):
            energies[..., (ENERGY.names or ()).index(name)] -= returned
        return slider._replace(
            spring_force=0.0 * slider.spring_force,
            stage_position=slider.position,
            energies=energies,
        )

    def first(self, duration: float) -> float:
        return 0.0 if self.start_after > 0.0 else super().first(duration)

    def stage_speed(self, time: Array, duration: float) -> Array:
        """Return the speed of the stage at some times after it has started, in a run of a duration [s]."""
        after = self.start_after
        return self.course.at(np.maximum(time - after, 0.0), duration - after)

    def stage_of(self, state: Driven) -> Array:
        return state.stage_position

    def _first_speed(self, duration: float) -> float:
        return self.first(duration) if self.start == "steady" else 0.0

    def driven(self, ends: Array, duration: float) -> tables.Pieces:
        return self.pieces(ends, duration)

    def pieces(self, ends: Array, duration: float) -> tables.Pieces:
        """Return the speed of the stage in the intervals between some times [s], in pieces."""
        after, still = self.start_after, tables.Number(0.0)
        if after <= ends[0]:
            return _shifted(self.course.pieces(ends - after, duration - after), after)
        if after >= ends[-1]:
            return still.pieces(ends, duration)
        rests, cut = ends[ends < after], ends[ends > after]
        moving = _shifted(
            self.course.pieces(np.append(0.0, cut - after), duration - after), after
        )
        pairs = zip(
            still.pieces(np.append(rests, after), duration), moving, strict=True
        )
        pieces = tables.Pieces(*(np.concatenate(pair) for pair in pairs))
        return pieces._replace(
            interval=np.searchsorted(ends, 0.5 * (pieces.start + pieces.stop)) - 1
        )


def _shifted(pieces: tables.Pieces, time: float) -> tables.Pieces:
    """Return pieces that begin later by a time [s]."""
    return (
        pieces._replace(start=pieces.start + time, stop=pieces.stop + time)
        if time
        else pieces
    )


Drive = Annotated[
    Steady | Start | Ramp | Table | Holds | Force | Spring, Field(discriminator="model")
]
