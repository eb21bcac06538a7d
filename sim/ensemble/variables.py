"""Quantities of a dataset: recorded at each time, known of each scene, drawn as maps; with unit, name and symbol."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from sim.parts.contact.balance import (
    BONDS_ONLY,
    CLOSED,
    EQUILIBRIUM,
    JKR,
    NO_MEAN_STRESS,
    Balance,
    Control,
    LoadControl,
    Shares,
)
from sim.parts.contact.cohesive import CohesiveDisplacement, CohesiveLoad
from sim.parts.drive import READINGS, Driven, Force, Spring
from sim.parts.events import LATE, MOMENTS, RISE, TURNS, Slips
from sim.parts.exchange import TURN
from sim.parts.shear.process import Renewing
from sim.quantities import (
    OF_EACH_SLIP,
    OF_SLIPS,
    QUANTITIES,
    RECORDS,
    Definition,
    in_a_phase,
)
from sim.scenario.checks import pull_off_error, renewed
from sim.scenario.scenario import Scenario
from sim.step.state import State, Trajectory


class Variable(NamedTuple):
    """The reading of a recorded quantity, or of a number of a scene.

    ``part`` names the part whose class decides whether members differ, or their
    control; it is empty for a number of the scene. ``read`` takes the scenario and the
    ``Trajectory`` of a batch, and returns an array that broadcasts to shape (times,
    members). For a quantity of the whole run it takes the final state; for a number it
    takes the scenario alone. A quantity of the whole run may have an ``axis``: a
    dimension beside that of the members.
    """

    name: str
    part: str
    read: Callable[..., Any]
    axis: str = ""

    @property
    def definition(self) -> Definition:
        """The row of the quantity in the registry."""
        return QUANTITIES[self.name]

    def applies(self, scene: Scenario) -> bool:
        """Return True if the quantity is recorded of a scene."""
        return self.definition.exists_when.holds(scene)


def _until_stopped(
    read: Callable[[Scenario, Trajectory], np.ndarray],
) -> Callable[[Scenario, Trajectory], np.ndarray]:
    """Return a reading that is nan once a member's trajectory has stopped at its pull-off."""

    def running(scene: Scenario, course: Trajectory) -> np.ndarray:
        return np.where(
            scene.contact.stopped(course.radius, course.detached),
            np.nan,
            read(scene, course),
        )

    return running


def _radius(scene: Scenario, course: Trajectory) -> np.ndarray:
    return np.nan_to_num(course.radius, nan=0.0)


def _area(scene: Scenario, course: Trajectory) -> np.ndarray:
    return np.pi * _radius(scene, course) ** 2


def _control(scene: Scenario, course: Trajectory) -> Control:
    return scene.contact.control(course.time, scene.clock.duration)


def _outer_radius(scene: Scenario, course: Trajectory) -> np.ndarray:
    control = cast(CohesiveLoad | CohesiveDisplacement, _control(scene, course))
    radius = control.outer_radius(course.radius, scene.bodies, course.work)
    return np.nan_to_num(radius)


def _applied_load(scene: Scenario, course: Trajectory) -> np.ndarray:
    if scene.contact.load is None:
        return np.full(course.time.shape, np.nan)
    return np.broadcast_to(
        cast(LoadControl, _control(scene, course)).load, course.time.shape
    )


def _terms(scene: Scenario, course: Trajectory) -> Balance:
    return scene.work.balance(course, course.energy, course.position)


def _stored(scene: Scenario, course: Trajectory) -> np.ndarray:
    """ΔΓ, of a measured map on a disc that on the contact, per area."""
    if not scene.fluctuations.passes:
        return course.energy
    return course.energy * cast(Shares, _terms(scene, course).margin).mean(
        _radius(scene, course)
    )


def _expected(scene: Scenario, course: Trajectory) -> np.ndarray:
    """Return the mean of ΔΓ over all realisations [J/m²], nan where it is not known."""
    if not scene.knows_energy:
        return np.full((1, 1), np.nan)
    size = scene.fluctuations.law.factor(course.speed, course.strength)
    return np.asarray(size**2 * cast(Renewing, scene.process).mean)


def _edge(scene: Scenario, course: Trajectory) -> np.ndarray:
    """Return χ dE/dA, that part of ΔΓ which a unit of new contact at the edge pays [J/m²]; on a plane all of it."""
    terms = _terms(scene, course)
    return terms.fluctuating * (
        1.0 if terms.margin is None else terms.margin(_radius(scene, course))
    )


def _where_closed(course: Trajectory, reference: int, radius: np.ndarray) -> np.ndarray:
    """Radius of a reference contact [m], 0 where it is open."""
    return np.where(
        course.phases[:, : radius.shape[1], reference] == CLOSED, radius, 0.0
    )


def _with_work(
    scene: Scenario, course: Trajectory, reference: int, work: np.ndarray
) -> np.ndarray:
    """Radius of a reference contact in equilibrium with a work of adhesion [m]."""
    return _where_closed(
        course,
        reference,
        _control(scene, course).radius(work, scene.bodies),
    )


def _stressless_radius(scene: Scenario, course: Trajectory) -> np.ndarray:
    if not scene.contact.reversible:
        return _equilibrium_radius(scene, course)
    terms = _terms(scene, course).without_stress()
    return _where_closed(
        course,
        NO_MEAN_STRESS,
        scene.contact.equilibrium(_control(scene, course), terms),
    )


def _equilibrium_radius(scene: Scenario, course: Trajectory) -> np.ndarray:
    if not scene.contact.lags:
        return _radius(scene, course)
    terms = _terms(scene, course)
    return _where_closed(
        course, EQUILIBRIUM, scene.contact.equilibrium(_control(scene, course), terms)
    )


def _column(name: str) -> Callable[[Scenario, Any], Any]:
    """Return the reading of a column of the largest stresses or frictions."""
    return lambda scene, rows: np.nan_to_num(rows[name])


def _column_of_turns(name: str) -> Callable[[Scenario, Any], Any]:
    """Return the reading of a column of the turns of contacts, nan without one."""
    return lambda scene, rows: rows[name]


def _first(turn: str, column: str = "") -> Callable[[Scenario, State], Any]:
    """Return the reading of a column of the first turn of a contact, by default its time."""
    return lambda scene, state: state.events.first_turn(turn)[column or turn]


def _lowest(quantity: str) -> Callable[[Scenario, State], Any]:
    """Return the reading of time, load or displacement of the mount at the lowest load, a name of ``TURN``.

    It is the lowest of those at the clock steps, at pull-offs and at jumps into contact, nan if none is a tension.
    """

    def read(scene: Scenario, state: State) -> Any:
        pulls, turns = state.events.by_phase("pull"), state.events.by_phase("contact")
        pulled = pulls["largest"] > 0.0
        radius = np.sqrt(np.where(pulled, pulls["area"], np.nan) / np.pi)
        time = np.where(pulled, pulls["time"], 0.0)
        control = scene.contact.control(time, scene.clock.duration)
        at_steps = {
            "time": time,
            "load": np.where(pulled, -pulls["largest"], 0.0),
            "displacement": control.displacement(radius, scene.bodies),
        }
        shape = np.broadcast_shapes(pulls.shape, turns.shape)

        def candidates(name: str) -> np.ndarray:
            values = at_steps[name], turns[f"pull_off_{name}"], turns[f"jump_in_{name}"]
            return np.concatenate([np.broadcast_to(one, shape) for one in values], 1)

        load = candidates("load")
        tension = np.where(load < 0.0, -load, 0.0)
        place = tension.argmax(axis=1)[:, np.newaxis]
        is_tension = np.take_along_axis(tension, place, 1) > 0.0
        values = np.take_along_axis(candidates(quantity), place, 1)
        return np.where(is_tension, values, np.nan)[:, 0]

    return read


def _of_contact(column: str) -> Callable[[Scenario, State], Any]:
    return lambda scene, state: state.events.by_phase("contact")[:, -1][column]


def _masked_share(scene: Scenario, state: State) -> Any:
    row = state.events.by_phase("contact")[:, -1]
    return np.divide(
        row["hidden"],
        row["closed"],
        out=np.full(len(row), np.nan),
        where=row["closed"] > 0.0,
    )


def _pull_off_error(scene: Scenario, state: State) -> Any:
    """Return the bound of the error of the load at a member's first pull-off [N], nan without one."""
    when = _first("pull_off_time")(scene, state)
    return np.where(
        np.isfinite(when), pull_off_error(scene, state.events.path, when), np.nan
    )


def _runaway_force(scene: Scenario, state: State) -> Any:
    drive, when = cast(Force, scene.drive), cast(Driven, state.drive).runaway_time
    return np.where(
        np.isfinite(when),
        drive.course.at(np.nan_to_num(when), scene.clock.duration),
        np.nan,
    )


def _event(
    name: str, of: str, read: Callable[[Scenario, Any], Any]
) -> tuple[Variable, Variable]:
    """Return a quantity of an event of the whole run, and that of the event in each phase.

    ``read`` takes the scenario and rows of events ``of`` a kind: a largest value, or the time of a turn.
    """
    part, turns = "bonds" if of == "stress" else "contact", of in (TURNS.names or ())

    def whole(scene: Scenario, state: State) -> Any:
        return read(
            scene, state.events.first_turn(of) if turns else state.events.largest(of)
        )

    def in_phases(scene: Scenario, state: State) -> Any:
        values = read(scene, state.events.by_phase("contact" if turns else of))
        if QUANTITIES[name].unit != "s":
            return values
        # what a phase takes over from the clock step before is its value at the start
        return np.maximum(values, scene.phases.starts[: values.shape[-1]])

    of_phase = in_a_phase(QUANTITIES[name]).name
    return Variable(name, part, whole), Variable(of_phase, part, in_phases, "phase")


def _first_maxima(scene: Scenario, state: State) -> np.ndarray:
    """Return the first maximum of the friction after each rest, as records ``RISE``, shape (rows, phases).

    It stands in the phase after the rest, whichever phase it is in before the next rest. The friction also falls where
    the prescribed motion slows down or turns back, so the first maximum must have been passed before.
    """
    phases, rows = scene.phases, len(state.events.rise)
    result = np.zeros((rows, len(phases.starts)), RISE)
    result[:] = np.nan
    drive = cast(Any, scene.drive)
    begin = 0 if drive.model == "spring" and drive.start == "rest" else None
    for phase, (rests, slows) in enumerate(
        zip(phases.rests, phases.slows, strict=True)
    ):
        if rests:
            begin = phase + 1
        elif slows:
            begin = None
        elif begin is not None:
            result[:, begin] = state.events.first_maximum(phase)
    return result


def _threshold(name: str, column: str) -> tuple[Variable, Variable]:
    """Return a quantity of the first maximum of friction after the first rest, and that after each rest."""

    def whole(scene: Scenario, state: State) -> Any:
        starts_at_rest = scene.phases.rests[0]
        return _first_maxima(scene, state)[column][:, int(starts_at_rest)]

    of_phase = in_a_phase(QUANTITIES[name]).name
    return Variable(name, "contact", whole), Variable(
        of_phase,
        "contact",
        lambda scene, state: _first_maxima(scene, state)[column],
        "phase",
    )


_EVENTS = (
    _event("peak_stress", "stress", _column("largest")),
    _event("peak_time", "stress", _column("time")),
    _event("peak_speed", "stress", _column("speed")),
    _event("peak_area", "stress", _column("area")),
    _event("peak_friction", "friction", _column("largest")),
    _event("peak_friction_time", "friction", _column("time")),
    _event("peak_friction_speed", "friction", _column("speed")),
    _event("peak_friction_area", "friction", _column("area")),
    _threshold("static_threshold", "largest"),
    _threshold("static_threshold_time", "time"),
    _threshold("static_threshold_area", "area"),
    *(
        _event(name, "pull_off_time", _column_of_turns(name))
        for name in (f"pull_off_{column}" for column in TURN.names or ())
    ),
)
#: Names of the quantities at the lowest load, by those in ``TURN``.
_AT_LOWEST = {
    "load": "lowest_load",
    "time": "lowest_load_time",
    "displacement": "lowest_load_displacement",
}


def _late(quantity: str, moment: str) -> Callable[[Slips], Any]:
    """Return the reading of a moment of late slip events; nan without events enough."""

    def read(slips: Slips) -> np.ndarray:
        row = slips.late[:, LATE.index(quantity)].view(MOMENTS)[:, 0]
        with np.errstate(invalid="ignore"):
            values = (
                np.sqrt(row["squares"] / (row["count"] - 1.0))
                if moment == "std"
                else row[moment]
            )
        return np.where(row["count"] > (moment == "std"), values, np.nan)

    return read


def _of_slips(name: str) -> Callable[[Slips], Any]:
    """Return the reading of a quantity of slip events by its name."""
    if name == "slip_count":
        return lambda slips: slips.total
    if name == "slow_fall_count":
        return lambda slips: slips.state["slow"]
    if name == "slip_count_late":
        return lambda slips: slips.late[:, 0, 0]
    if name.startswith("kinetic_friction"):
        place = int(name.endswith("_change"))
        return lambda slips: slips.kinetic_friction()[place]
    if name.startswith("late_"):
        quantity, _, moment = name.removeprefix("late_").rpartition("_")
        return _late(quantity, moment)
    return functools.partial(Slips.column, name=name.removeprefix("slip_"))


def _onset(name: str) -> Callable[[Scenario, State], Any]:
    """Return the reading of a speed of the stage between which and the next one slip events set in or end."""
    sets_in, at_slip = name.startswith("onset"), name.endswith("slip_speed")

    def read(scene: Scenario, state: State) -> np.ndarray:
        slips, phases = state.events.slips, scene.phases
        if sets_in:
            times = slips.column("time")
            if times.shape[1] < 2:
                return np.full(len(times), np.nan)
            event, before = times[:, 0], 2.0 * times[:, 0] - times[:, 1]
        else:
            event = slips.state["latest"]
            before = event + slips.state["interval"]
        starts = np.array(phases.starts)
        stops = np.append(starts[1:], scene.clock.duration)
        place = np.searchsorted(starts, np.nan_to_num(event), side="right") - 1
        trend = f"{'in' if sets_in else 'de'}creasing speed"
        within = np.array([trend in each for each in phases.names])[place]
        within &= (before >= starts[place]) & (before <= stops[place])
        at = np.where(within, event if at_slip else before, 0.0)
        speed = cast(Spring, scene.drive).stage_speed(at, scene.clock.duration)
        return np.where(within, np.abs(speed), np.nan)

    return read


def _slip(name: str) -> Variable:
    """Return a quantity of slip events; those of single events have a dimension of their own."""
    if name.startswith(("onset_", "end_")):
        return Variable(name, "drive", _onset(name))
    read = _of_slips(name)
    is_single = QUANTITIES[name] in OF_EACH_SLIP
    return Variable(
        name,
        "drive",
        lambda scene, state: read(state.events.slips),
        "slip" if is_single else "",
    )


#: Quantities of a whole run, read at its end, in the order of the registry.
LARGEST: tuple[Variable, ...] = (
    *(of_run for of_run, _ in _EVENTS),
    Variable("detachments", "contact", _of_contact("detachments")),
    *(
        Variable(name, "contact", _lowest(column))
        for column, name in _AT_LOWEST.items()
    ),
    *(
        Variable(name, "contact", _first("jump_in_time", name))
        for name in (f"jump_in_{column}" for column in TURN.names or ())
    ),
    Variable("first_detachment", "contact", _first("opening")),
    Variable("first_closing", "contact", _first("closing")),
    Variable("first_masked", "contact", _of_contact("masked")),
    Variable("time_masked", "contact", _masked_share),
    Variable("runaway_force", "drive", _runaway_force),
    Variable(
        "unresolved_time",
        "drive",
        lambda scene, state: cast(Driven, state.drive).unresolved_time,
    ),
    Variable(
        "step_renewal", "drive", lambda scene, state: renewed(scene, state.events.path)
    ),
    Variable(
        "pull_off_error",
        "contact",
        _pull_off_error,
    ),
    *(of_phase for _, of_phase in _EVENTS),
    *(_slip(row.name) for row in OF_SLIPS),
)


def _driven(name: str) -> Variable:
    """Return a quantity of a drive that solves the motion of the slider."""
    place = READINGS.index(name)
    return Variable(name, "drive", lambda scene, course: course.driven[..., place])


VARIABLES: tuple[Variable, ...] = (
    Variable("speed", "drive", lambda scene, course: course.speed),
    Variable("slider_position", "drive", lambda scene, course: course.position),
    Variable("bond_fraction", "bonds", lambda scene, course: course.fraction),
    Variable("shear_stress", "bonds", lambda scene, course: course.stress),
    Variable("fluctuation_energy", "shear", _stored),
    Variable("expected_energy", "drive", _expected),
    Variable("edge_energy", "contact", _edge),
    Variable(
        "work_of_adhesion", "contact", _until_stopped(lambda scene, course: course.work)
    ),
    Variable("contact_radius", "contact", _until_stopped(_radius)),
    Variable("outer_radius", "contact", _until_stopped(_outer_radius)),
    Variable("contact_area", "contact", _until_stopped(_area)),
    Variable(
        "normal_load",
        "contact",
        _until_stopped(
            lambda scene, course: _control(scene, course).normal_load(
                course.radius, scene.bodies, course.work
            )
        ),
    ),
    Variable(
        "indentation",
        "contact",
        _until_stopped(
            lambda scene, course: _control(scene, course).indentation(
                course.radius, scene.bodies, course.work
            )
        ),
    ),
    Variable(
        "displacement",
        "contact",
        _until_stopped(
            lambda scene, course: _control(scene, course).displacement(
                course.radius, scene.bodies, course.work
            )
        ),
    ),
    Variable(
        "friction_force",
        "contact",
        _until_stopped(lambda scene, course: course.stress * _area(scene, course)),
    ),
    Variable(
        "in_contact",
        "contact",
        lambda scene, course: (course.radius > 0.0).astype(float),
    ),
    Variable(
        "masked",
        "contact",
        lambda scene, course: np.where(course.radius > 0.0, course.work <= 0.0, np.nan),
    ),
    Variable("detachment_time", "contact", lambda scene, course: course.detached),
    Variable("dissipated_energy", "contact", lambda scene, course: course.dissipated),
    Variable(
        "jkr_radius",
        "control",
        lambda scene, course: _with_work(
            scene, course, JKR, np.full(course.time.shape, scene.adhesion.work)
        ),
    ),
    Variable(
        "hertz_radius",
        "control",
        lambda scene, course: np.nan_to_num(
            _control(scene, course).radius(np.zeros(1), scene.bodies)
        ),
    ),
    Variable(
        "bonds_radius",
        "bonds",
        lambda scene, course: _with_work(
            scene, course, BONDS_ONLY, _terms(scene, course).bonded
        ),
    ),
    Variable("fluctuations_radius", "contact", _stressless_radius),
    Variable("equilibrium_radius", "contact", _equilibrium_radius),
    Variable("applied_load", "control", _applied_load),
    *(_driven(row.name) for row in RECORDS if row.name in READINGS),
)

#: Reading of each recorded quantity, by its name.
READ = {variable.name: variable.read for variable in VARIABLES}

#: Numbers of a scene, written for each point of the sweep.
NUMBERS = (
    Variable("contact_modulus", "", lambda scene: scene.elastic.contact_modulus),
    Variable("effective_shear_modulus", "", lambda scene: scene.elastic.shear_modulus),
    Variable("effective_poisson_ratio", "", lambda scene: scene.elastic.poisson_ratio),
    Variable(
        "softer_shear_modulus", "", lambda scene: scene.softer_body.own_shear_modulus
    ),
    Variable("has_noise", "", lambda scene: float(scene.is_random)),
    Variable("radius_at_rest", "", lambda scene: scene.rest_radius),
    Variable(
        "radius_without_adhesion",
        "",
        lambda scene: scene.contact.equilibrium_radius(np.zeros(1), scene.bodies)[0],
    ),
    Variable(
        "energy_variation",
        "",
        lambda scene: scene.process.variation if scene.knows_energy else np.nan,
    ),
    Variable(
        "jkr_pull_off_load",
        "",
        lambda scene: scene.bodies.solid.pull_off_load(
            scene.adhesion.work, scene.sphere.radius
        ),
    ),
)
