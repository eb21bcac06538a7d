"""Quantities of a dataset: recorded at each time, known of each scene, drawn as maps; with unit, name and symbol."""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np

from sim.engine import State, Trajectory, balance, has_stage
from sim.laws import jkr
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
from sim.parts.drive import READINGS, Driven, Force
from sim.parts.events import LATE, MOMENTS, SLIP, TURN, Slips
from sim.scenario.checks import pull_off_error, pulled, renewed
from sim.scenario.scenario import Scenario


class Variable(NamedTuple):
    """One recorded quantity, or one number of a scene.

    ``part`` names the part whose class decides whether members differ, or their control; "" for a number of the scene.
    ``read`` takes the scenario and the ``Trajectory`` of a batch, and returns an array that broadcasts to shape (times,
    members). For a quantity of the whole run it takes the final state; for a number it takes only the scenario.
    ``applies`` is True for the scenes of which it is recorded, with ``condition`` in words. A quantity of the whole run
    may have an ``axis``: a dimension beside that of the members.
    """

    name: str
    unit: str
    long_name: str
    symbol: str
    part: str
    read: Callable[..., Any]
    applies: Callable[[Scenario], bool] = lambda scene: True
    condition: str = ""
    axis: str = ""


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


def _applied_load(scene: Scenario, course: Trajectory) -> np.ndarray:
    if scene.contact.load is None:
        return np.full(course.time.shape, np.nan)
    return np.broadcast_to(
        cast(LoadControl, _control(scene, course)).load, course.time.shape
    )


def _terms(scene: Scenario, course: Trajectory) -> Balance:
    return balance(
        scene, course.fraction, course.strength, course.energy, course.position
    )


def _stored(scene: Scenario, course: Trajectory) -> np.ndarray:
    """ΔΓ, of a measured map on a disc that on the contact, per area."""
    if not scene.fluctuations.passes:
        return course.energy
    return course.energy * cast(Shares, _terms(scene, course).margin).mean(
        _radius(scene, course)
    )


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
        _control(scene, course).radius(work, np.zeros(1), 0.0, scene.bodies),
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


def _pull(column: str, pulls: Any) -> Any:
    """Return a column of largest pulls; nan for a contact that was never pulled."""
    return np.where(pulls["largest"] > 0.0, pulls[column], np.nan)


def _displaced(scene: Scenario, pulls: Any) -> Any:
    """Return the displacement of the mount at largest pulls [m]."""
    radius, time = (
        np.sqrt(_pull("area", pulls) / np.pi),
        np.nan_to_num(_pull("time", pulls)),
    )
    return scene.contact.control(time, scene.clock.duration).displacement(
        radius, scene.bodies
    )


def _at_closing(of: str) -> Callable[[Scenario, State], Any]:
    """Return the reading of a quantity of the control at the first closing."""

    def read(scene: Scenario, state: State) -> Any:
        turn = state.events.first_turn("closing")
        control = scene.contact.control(
            np.nan_to_num(turn["closing"]), scene.clock.duration
        )
        return np.where(
            np.isfinite(turn["closing"]),
            getattr(control, of)(turn["radius"], scene.bodies),
            np.nan,
        )

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


def _runaway_force(scene: Scenario, state: State) -> Any:
    drive, when = cast(Force, scene.drive), cast(Driven, state.drive).runaway_time
    return np.where(
        np.isfinite(when),
        drive.course.at(np.nan_to_num(when), scene.clock.duration),
        np.nan,
    )


def _event(
    name: str,
    unit: str,
    long_name: str,
    symbol: str,
    of: str,
    read: Callable[[Scenario, Any], Any],
    applies: Callable[[Scenario], bool] = lambda scene: True,
    condition: str = "",
) -> tuple[Variable, Variable]:
    """Return a quantity of an event of the whole run, and that of the event in each phase.

    ``read`` takes the scenario and rows of events ``of`` a kind: a largest value, or an opening or closing.
    """
    part, turns = "bonds" if of == "stress" else "contact", of in (TURN.names or ())

    def whole(scene: Scenario, state: State) -> Any:
        return read(
            scene, state.events.first_turn(of) if turns else state.events.largest(of)
        )

    def in_phases(scene: Scenario, state: State) -> Any:
        return read(scene, state.events.by_phase("contact" if turns else of))

    of_phase = (
        f"phase_{name.removeprefix('first_')}",
        unit,
        f"in a phase: {long_name}".replace("of the run", "of it"),
    )
    return (
        Variable(name, unit, long_name, symbol, part, whole, applies, condition),
        Variable(*of_phase, "", part, in_phases, applies, condition, "phase"),
    )


_TOGETHER: Any = (
    lambda scene: scene.varies["bonds"] == scene.varies["contact"],
    "members with different stresses, or one area",
)
_CHANGES: Any = (lambda scene: scene.contact.makes_load, "a load that changes")
_EVENTS = (
    _event(
        "peak_stress",
        "Pa",
        "largest magnitude of the mean shear stress of the run, of the highest start;"
        " open contacts included",
        "tau_p",
        "stress",
        _column("largest"),
    ),
    _event(
        "peak_time",
        "s",
        "time of the largest shear stress",
        "t_p",
        "stress",
        _column("time"),
    ),
    _event(
        "peak_speed",
        "m/s",
        "sliding speed at the largest shear stress",
        "",
        "stress",
        _column("speed"),
    ),
    _event(
        "peak_area",
        "m^2",
        "contact area at the largest shear stress",
        "",
        "stress",
        _column("area"),
        *_TOGETHER,
    ),
    _event(
        "peak_friction",
        "N",
        "largest magnitude of the friction force of the run, of the highest start",
        "F_p",
        "friction",
        _column("largest"),
    ),
    _event(
        "peak_friction_time",
        "s",
        "time of the largest friction force",
        "",
        "friction",
        _column("time"),
    ),
    _event(
        "peak_friction_speed",
        "m/s",
        "sliding speed at the largest friction force",
        "",
        "friction",
        _column("speed"),
    ),
    _event(
        "peak_friction_area",
        "m^2",
        "contact area at the largest friction force",
        "",
        "friction",
        _column("area"),
    ),
    _event(
        "pull_off_load",
        "N",
        "lowest normal load of the contact, a tension; nan without tension",
        "P_min",
        "pull",
        lambda scene, rows: -1.0 * _pull("largest", rows),
        *_CHANGES,
    ),
    _event(
        "pull_off_time",
        "s",
        "time of the lowest normal load",
        "t_min",
        "pull",
        lambda scene, rows: _pull("time", rows),
        *_CHANGES,
    ),
    _event(
        "pull_off_displacement",
        "m",
        "displacement of the mount at the lowest normal load",
        "",
        "pull",
        _displaced,
        *_CHANGES,
    ),
    _event(
        "first_detachment",
        "s",
        "time of the first detachment; nan if there is none",
        "t_d",
        "opening",
        lambda scene, rows: rows["opening"],
    ),
    _event(
        "first_closing",
        "s",
        "time at which an open contact first closes; nan if there is none",
        "",
        "closing",
        lambda scene, rows: rows["closing"],
    ),
)
#: Quantities of a whole run, read at its end.
LARGEST: tuple[Variable, ...] = (
    *(of_run for of_run, _ in _EVENTS),
    Variable(
        "detachments",
        "1",
        "number of detachments",
        "",
        "contact",
        _of_contact("detachments"),
    ),
    Variable(
        "closing_displacement",
        "m",
        "displacement of the mount at the first closing",
        "",
        "contact",
        _at_closing("displacement"),
    ),
    Variable(
        "closing_load",
        "N",
        "normal load after the first closing",
        "",
        "contact",
        _at_closing("normal_load"),
    ),
    Variable(
        "first_masked",
        "s",
        "time at which the contact is first masked; nan if it never is",
        "",
        "contact",
        _of_contact("masked"),
    ),
    Variable(
        "time_masked",
        "1",
        "share of the closed time in which the contact is masked",
        "",
        "contact",
        _masked_share,
    ),
    Variable(
        "runaway_force",
        "N",
        "force at which the slider lost stability; nan if it never did",
        "",
        "drive",
        _runaway_force,
        lambda scene: scene.drive.model == "force",
        'drive.model = "force"',
    ),
    Variable(
        "unresolved_time",
        "s",
        "time from which on the motion of the slider could not be resolved, so that its"
        " values are missing; nan if it was resolved to the end",
        "",
        "drive",
        lambda scene, state: cast(Driven, state.drive).unresolved_time,
        lambda scene: scene.drive.solves_motion,
        'drive.model = "spring" or "force"',
    ),
    Variable(
        "step_renewal",
        "1",
        "largest share of the variance of DeltaGamma renewed in a clock step",
        "",
        "drive",
        lambda scene, state: renewed(scene, state.events.path),
        lambda scene: scene.feels_steps,
        "an edge that lags, or tension",
    ),
    Variable(
        "pull_off_error",
        "N",
        "approximate systematic error of the pull-off load by the clock step",
        "",
        "drive",
        lambda scene, state: pull_off_error(scene, state.events.path),
        lambda scene: (
            scene.feels_steps and pulled(scene) and scene.contact.load is not None
        ),
        "fluctuations, and a negative contact.load",
    ),
)

#: Columns of slip events and moments of late ones: unit, meaning, symbol.
_SLIPS = {
    "time": (
        "s",
        "time at which a slip event begins, at the largest spring force",
        "t_s",
    ),
    "end": ("s", "time at which a slip event ends, at the smallest spring force", ""),
    "amplitude": ("m", "displacement of the slider in a slip event", "S"),
    "speed": ("m/s", "speed of the stage at the start of a slip event", ""),
    "force_before": (
        "N",
        "spring force at the start of a slip event, positive along the stage motion",
        "Q_s",
    ),
    "force_after": (
        "N",
        "spring force at the end of a slip event, positive along the stage motion",
        "",
    ),
    "stress_before": ("Pa", "largest shear stress since the previous slip event", ""),
    "stress_after": ("Pa", "smallest shear stress in a slip event", ""),
    "force_drop": ("N", "drop of the spring force in a slip event", ""),
    "recurrence": (
        "s",
        "time from the start of a slip event to the start of the next one",
        "",
    ),
}
_MOMENTS = {
    "mean": "mean",
    "std": "standard deviation",
    "least": "smallest",
    "largest": "largest",
}


def _slip(
    name: str,
    described: tuple[str, str, str],
    read: Callable[[Slips], Any],
    axis: str = "",
) -> Variable:
    """Return a quantity of slip events."""
    about = has_stage, 'drive.model = "spring"', axis
    return Variable(
        name, *described, "drive", lambda scene, state: read(state.events.slips), *about
    )


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


LARGEST += tuple(of_phase for _, of_phase in _EVENTS)
LARGEST += (
    *(
        _slip(
            f"slip_{column}",
            _SLIPS[column],
            functools.partial(Slips.column, name=column),
            "slip",
        )
        for column in SLIP.names or ()
    ),
    _slip("slip_count", ("1", "number of slip events", ""), lambda slips: slips.total),
    _slip(
        "slip_count_late",
        ("1", "number of slip events that begin in the second half of the run", ""),
        lambda slips: slips.late[:, 0, 0],
    ),
    *(
        _slip(
            f"late_{name}_{moment}",
            (
                _SLIPS[name][0],
                f"{text} over slip events that begin in the second half of the"
                f" run: {_SLIPS[name][1]}",
                "",
            ),
            _late(name, moment),
        )
        for name in LATE
        for moment, text in _MOMENTS.items()
    ),
    _slip(
        "kinetic_friction",
        (
            "N",
            "work of the stage over its path, from the first slip event in the second half of"
            " the run to the last; with fewer than two, over the whole second half",
            "F_k",
        ),
        Slips.kinetic_friction,
    ),
)

VARIABLES: tuple[Variable, ...] = (
    Variable(
        "speed",
        "m/s",
        "sliding speed",
        "V",
        "drive",
        lambda scene, course: course.speed,
    ),
    Variable(
        "slider_position",
        "m",
        "displacement of the slider",
        "X",
        "drive",
        lambda scene, course: course.position,
    ),
    Variable(
        "bond_fraction",
        "1",
        "number of bonds over that at rest",
        "N/N_0",
        "bonds",
        lambda scene, course: course.fraction,
    ),
    Variable(
        "shear_stress",
        "Pa",
        "mean shear stress at the interface",
        "tau_0",
        "bonds",
        lambda scene, course: course.stress,
    ),
    Variable(
        "fluctuation_energy",
        "J/m^2",
        "elastic energy of the shear-stress fluctuations per area",
        "DeltaGamma",
        "shear",
        _stored,
    ),
    Variable(
        "edge_energy",
        "J/m^2",
        "fluctuation energy per unit of new contact area at the edge of the disc",
        "dE/dA",
        "contact",
        _edge,
        lambda scene: scene.margin is not None,
        'shear.contact = "disc"',
    ),
    Variable(
        "work_of_adhesion",
        "J/m^2",
        "effective work of adhesion",
        "w",
        "contact",
        _until_stopped(lambda scene, course: course.work),
    ),
    Variable(
        "contact_radius", "m", "contact radius", "a", "contact", _until_stopped(_radius)
    ),
    Variable(
        "contact_area", "m^2", "contact area", "A", "contact", _until_stopped(_area)
    ),
    Variable(
        "normal_load",
        "N",
        "normal load on the sphere, compression positive",
        "P",
        "contact",
        _until_stopped(
            lambda scene, course: _control(scene, course).normal_load(
                course.radius, scene.bodies
            )
        ),
    ),
    Variable(
        "indentation",
        "m",
        "indentation of the sphere",
        "delta",
        "contact",
        _until_stopped(
            lambda scene, course: _control(scene, course).indentation(
                course.radius, scene.bodies
            )
        ),
    ),
    Variable(
        "displacement",
        "m",
        "displacement of the mount",
        "Delta",
        "contact",
        _until_stopped(
            lambda scene, course: _control(scene, course).displacement(
                course.radius, scene.bodies
            )
        ),
    ),
    Variable(
        "friction_force",
        "N",
        "friction force, shear stress times contact area",
        "F",
        "contact",
        _until_stopped(lambda scene, course: course.stress * _area(scene, course)),
    ),
    Variable(
        "in_contact",
        "1",
        "1 if the contact is closed",
        "",
        "contact",
        lambda scene, course: (course.radius > 0.0).astype(float),
    ),
    Variable(
        "masked",
        "1",
        "1 if the effective work of adhesion is not positive (a Hertz contact)",
        "",
        "contact",
        lambda scene, course: ((course.work <= 0.0) & (course.radius > 0.0)).astype(
            float
        ),
    ),
    Variable(
        "detachment_time",
        "s",
        "time of the last detachment",
        "t_d",
        "contact",
        lambda scene, course: course.detached,
    ),
    Variable(
        "dissipated_energy",
        "J",
        "energy dissipated by the edge and the jumps of the contact",
        "W",
        "contact",
        lambda scene, course: course.dissipated,
    ),
    Variable(
        "jkr_radius",
        "m",
        "equilibrium radius at the full work of adhesion, with the same mount and rule"
        " after pull-off; 0 while that contact is open",
        "a_JKR",
        "control",
        lambda scene, course: _with_work(
            scene, course, JKR, np.full(course.time.shape, scene.adhesion.work)
        ),
    ),
    Variable(
        "hertz_radius",
        "m",
        "radius without adhesion, with the same mount; 0 without compression",
        "a_H",
        "control",
        lambda scene, course: np.nan_to_num(
            _control(scene, course).radius(np.zeros(1), np.zeros(1), 0.0, scene.bodies)
        ),
    ),
    Variable(
        "bonds_radius",
        "m",
        "equilibrium radius at the work of adhesion of the bonds alone, with the same"
        " mount and rule after pull-off; 0 while that contact is open",
        "a_b",
        "bonds",
        lambda scene, course: _with_work(
            scene, course, BONDS_ONLY, _terms(scene, course).bonded
        ),
    ),
    Variable(
        "fluctuations_radius",
        "m",
        "equilibrium radius at the work of adhesion after the fluctuations and"
        " before the mean stress, with the same mount and rule after pull-off; 0 while that"
        " contact is open",
        "a_f",
        "contact",
        _stressless_radius,
        lambda scene: scene.contact.reversible > 0.0,
        "contact.reversible above 0",
    ),
    Variable(
        "equilibrium_radius",
        "m",
        "equilibrium radius at the effective work of adhesion, with the same mount"
        " and rule after pull-off; 0 while that contact is open",
        "a_e",
        "contact",
        _equilibrium_radius,
        lambda scene: scene.contact.lags,
        'contact.model = "rate_dependent"',
    ),
    Variable(
        "applied_load",
        "N",
        "load applied to the sphere, in contact or open",
        "P_a",
        "control",
        _applied_load,
        lambda scene: scene.contact.load is not None and scene.contact.changes,
        "a contact.load that changes",
    ),
)


def _driven(name: str, unit: str, long_name: str, symbol: str) -> Variable:
    """Return a quantity of a drive that solves the motion of the slider.

    Those of the stage need a spring, and stability is lost under a prescribed force only.
    """
    place = READINGS.index(name)
    described = (
        name,
        unit,
        long_name,
        symbol,
        "drive",
        lambda scene, course: course.driven[..., place],
    )
    if name.startswith("stage_"):
        return Variable(
            *described,
            lambda scene: scene.drive.model == "spring",
            'drive.model = "spring"',
        )
    if name == "runaway_time":
        return Variable(
            *described,
            lambda scene: scene.drive.model == "force",
            'drive.model = "force"',
        )
    return Variable(
        *described,
        lambda scene: scene.drive.solves_motion,
        'drive.model = "spring" or "force"',
    )


VARIABLES += (
    _driven("stage_position", "m", "displacement of the stage", "X_s"),
    _driven("stage_speed", "m/s", "speed of the stage", "V_s"),
    _driven(
        "spring_force",
        "N",
        "force of the spring on the body, or the prescribed force",
        "Q",
    ),
    _driven("drive_work", "J", "work of the stage or of the prescribed force", "W_d"),
    _driven(
        "stored_energy", "J", "energy of spring, mass, yielding contact and bonds", "U"
    ),
    _driven(
        "dissipated_by_damping",
        "J",
        "energy dissipated by the damping of the body",
        "W_c",
    ),
    _driven(
        "dissipated_by_viscosity",
        "J",
        "energy dissipated by the viscosity of the interface",
        "W_v",
    ),
    _driven(
        "dissipated_by_rupture", "J", "energy dissipated as bonds break and form", "W_b"
    ),
    _driven(
        "dissipated_by_snaps",
        "J",
        "energy dissipated in instantaneous slips, except that of the bonds:"
        " avalanches and jumps of the force",
        "W_s",
    ),
    _driven(
        "dissipated_by_area",
        "J",
        "stored energy of the area that is lost, minus that of the area gained",
        "W_A",
    ),
    _driven(
        "energy_residual",
        "J",
        "work of the drive minus the increase of stored energy and the dissipated energy",
        "W_0",
    ),
    _driven("substeps", "1", "number of sub-steps since the start", ""),
    _driven("runaway_time", "s", "time at which the slider lost stability", "t_r"),
)

#: Reading of each recorded quantity, by its name.
READ = {variable.name: variable.read for variable in VARIABLES}

#: Numbers of a scene, written for each point of the sweep.
NUMBERS = (
    Variable(
        "contact_modulus",
        "Pa",
        "contact modulus",
        "E*",
        "",
        lambda scene: scene.solid.contact_modulus,
    ),
    Variable(
        "effective_shear_modulus",
        "Pa",
        "shear modulus of the tangential compliance",
        "G",
        "",
        lambda scene: scene.solid.effective[0],
    ),
    Variable(
        "effective_poisson_ratio",
        "1",
        "Poisson ratio of the tangential compliance",
        "nu",
        "",
        lambda scene: scene.solid.effective[1],
    ),
    Variable(
        "has_noise",
        "1",
        "1 if the scenario has random parts, so that members differ",
        "",
        "",
        lambda scene: float(scene.is_random),
    ),
    Variable(
        "radius_at_rest",
        "m",
        "JKR radius at the full work of adhesion",
        "a_0",
        "",
        lambda scene: scene.rest_radius,
    ),
    Variable(
        "radius_without_adhesion",
        "m",
        "Hertz radius",
        "a_H",
        "",
        lambda scene: scene.contact.equilibrium_radius(
            np.zeros(1), scene.sphere.radius, scene.solid.contact_modulus
        )[0],
    ),
    Variable(
        "jkr_pull_off_load",
        "N",
        "load at pull-off with the full work of adhesion",
        "P_c",
        "",
        lambda scene: jkr.pull_off_load(scene.adhesion.work, scene.sphere.radius),
        lambda scene: scene.contact.load is not None,
        "contact.load",
    ),
)

#: What leaves something out, by the first word of its errors.
SOURCES = {"cell": "cell", "banded": "bands", "step": "clock step"}
#: Unit and long name of the systematic errors of a run.
SYSTEMATIC = {
    f"{name}_error_{of}": (
        "1",
        f"{words} by the {source}, at the largest error of the area",
    )
    for of, words in (
        ("area", "error of the mean A/A_JKR"),
        ("friction", "relative error of the mean friction"),
    )
    for name, source in SOURCES.items()
}
SYSTEMATIC["error_speed"] = (
    "m/s",
    "sliding speed at which systematic errors of the area are largest",
)
SYSTEMATIC["member_spread_area"] = (
    "1",
    "standard deviation of A/A_JKR between members at that speed",
)

#: Name, unit, long name and symbol of what is recorded with each stress map.
MAP = ("shear_map", "Pa", "shear-stress fluctuation", "tau_1")
