"""Measured curves as a scenario predicts them.

Steady sliding is computed for all rows in a fraction of a millisecond. Each row is a contact in steady sliding at its
speed, with the mean of the fluctuations and the edge in equilibrium. The scenario's own run has everything else:
members, clock steps, histories, edges that lag.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.ensemble.plan import together
from sim.ensemble.steady import Values, history_at_rest, steady_course
from sim.ensemble.variables import READ
from sim.laws import theories
from sim.laws.incipient import Incipient
from sim.laws.theories import compare_at_indentation, compare_at_load
from sim.parts.drive import Driven
from sim.parts.exchange import Array
from sim.scenario.scenario import Clock, Scenario
from sim.scenario.schema import changed
from sim.step.state import MemberNoise, Trajectory
from sim.study.measurement import COURSES, Measured
from sim.units.errors import BadInput


class Group(NamedTuple):
    """Rows of a table at which keys of the scenario are the same.

    ``scenario`` has them; ``rows`` are their places in the table, ``time`` [s] and ``speed`` [m/s] theirs, shape
    (rows, 1): the contact's course is one over ``time``. If ``has_mount``, the mount was measured at the rows. If
    ``has_history``, its course is a history, which the contact follows from the first row on. ``scale`` is the true
    value of the mount over its reading. ``force`` is the tangential force of contacts that do not slide [N], of the
    shape of ``time``, None if they slide.
    """

    scenario: Scenario
    rows: NDArray[np.int64]
    time: Array
    speed: Array
    elapsed: Array
    has_mount: bool
    has_history: bool
    scale: float = 1.0
    force: Array | None = None


def groups_of(scenario: Scenario, table: Measured) -> list[Group]:
    """The groups of a table's rows; ``BadInput`` where a row has values that do not go together."""
    keyed = {
        key: values for key, values in table.conditions.items() if key not in COURSES
    }
    columns = np.array([np.zeros(table.rows), *keyed.values()])
    columns, result = columns[:, table.baseline :], []
    for place in np.unique(columns, axis=1, return_index=True)[1]:
        rows = np.flatnonzero(np.all(columns == columns[:, [place]], axis=0))
        rows += table.baseline
        try:
            numbers = {key: float(values[rows[0]]) for key, values in keyed.items()}
            item = scenario.with_values(numbers, built=False)
        except BadInput as fault:
            row = f"{table.path}: row {rows[0] + 1}"
            raise BadInput([f"{row}: {text}" for text in fault.problems]) from None
        conditions = {name: values[rows] for name, values in table.conditions.items()}
        duration, count = item.clock.duration, len(rows)
        # a course of the rows, as long as the run
        time = conditions.get("t", np.linspace(0.0, duration, count))
        if table.has_history:
            time = time - time[0]
            duration = float(time[-1])
            clock = {"duration": duration, "step": duration}
            item = changed(item, {"clock": Clock(**clock)})
        if (mount := conditions.get("mount")) is not None:
            course: Any = {"time": time, "value": mount}
            if np.all(mount == mount[0]) and not table.has_history:
                course = float(mount[0])
            item = item.with_values({f"contact.{table.mount}": course}, built=False)
        instants = np.repeat(conditions.get("t", np.zeros(count)), 2)
        speed = conditions.get(
            "speed", item.drive.pieces(instants, duration).joined.last[::2]
        )
        force = conditions.get("tangential_force")
        result.append(
            Group(
                scenario=item,
                rows=rows,
                time=time[:, np.newaxis],
                speed=speed[:, np.newaxis],
                elapsed=table.elapsed[rows],
                has_mount=mount is not None,
                has_history=table.has_history,
                force=None if force is None else force[:, np.newaxis],
            )
        )
    return result


def by_steady_sliding(
    group: Group, values: Values, names: list[str], theory: str = ""
) -> dict[str, Array]:
    """Variables at the rows of a group with some numbers changed, in steady sliding.

    ``theory`` is the name of a theory of ``sim.laws.theories``. It then gives the radius instead of the contact
    balance, at the stress of the bonds and the full work of adhesion. Its numbers ``"alpha"`` and ``"lambda"`` are
    among the ``values``.
    """
    scenario = changed(
        group.scenario, {key: value for key, value in values.items() if "." in key}
    )
    zero = scenario.zero
    if group.has_mount:
        off = 0.0 if zero is None else zero.at(scenario.contact.kind, group.elapsed)
        scenario = _at_true_mount(scenario, off, group.scale)
    course = (
        history_at_rest(scenario, group.time)
        if group.has_history
        else steady_course(scenario, group.time, group.speed)
    )
    if group.force is not None:
        radius = _pulled(scenario, course, group.force, values, theory)
        course = course._replace(radius=radius)
    elif theory:
        load, base, _ = scenario.contact.control(
            course.time, scenario.clock.duration
        ).mount
        at_load = scenario.contact.kind == "load"
        compare: Callable[..., dict[str, Array]] = (
            compare_at_load if at_load else compare_at_indentation
        )
        numbers = {
            "reversible": values.get("alpha", 0.0),
            "mixity": values.get("lambda", 0.5),
        }
        rest = scenario.adhesion.work, *scenario.bodies.numbers
        radii = compare(
            np.abs(course.stress),
            load if at_load else base,
            *rest,
            **numbers,
            only=(theory,),
        )
        course = course._replace(radius=radii[theory])
    result = {
        name: np.broadcast_to(READ[name](scenario, course), group.speed.shape)[:, 0]
        for name in names
    }
    if zero is None:
        return result
    return {name: x + zero.at(name, group.elapsed) for name, x in result.items()}


#: Theories of a contact under a tangential force that does not slide, each by the radius at a load and at an
#: indentation; of mixed-mode fracture the mixity comes after the force.
AT_FORCE: dict[str, tuple[Callable[..., Array], Callable[..., Array]]] = {
    "savkoor_briggs": (
        theories.savkoor_briggs_at_load,
        theories.savkoor_briggs_at_indentation,
    ),
    "reversible_force": (
        theories.reversible_force_at_load,
        theories.reversible_force_at_indentation,
    ),
    "scaled_angle": (
        theories.scaled_angle_at_load,
        theories.scaled_angle_at_indentation,
    ),
    "shear_share": (theories.shear_share_at_load, theories.shear_share_at_indentation),
    "scaled_tangent": (
        theories.scaled_tangent_at_load,
        theories.scaled_tangent_at_indentation,
    ),
}


def _pulled(
    scenario: Scenario, course: Trajectory, force: Array, values: Values, theory: str
) -> Array:
    """Return the radii of contacts at rest under a tangential force, by the empirical law or a theory [m]."""
    at_rest = course.radius
    if theory == "jkr":
        return at_rest
    if not theory:
        law = cast(Incipient, scenario.incipient)
        return np.asarray(np.sqrt(law.area_at(np.pi * at_rest**2, force) / np.pi))
    load, base, _ = scenario.contact.control(course.time, scenario.clock.duration).mount
    is_load = scenario.contact.kind == "load"
    radius = AT_FORCE[theory][0 if is_load else 1]
    own = [values["lambda"]] if "lambda" in values else []
    held = load if is_load else base
    rest = scenario.adhesion.work, *scenario.bodies.numbers
    return radius(held, rest[0], force, *own, *rest[1:])


def _at_true_mount(scenario: Scenario, off: ArrayLike, scale: float) -> Scenario:
    """Return a scenario with the true mount: readings less those at the instrument's zero, times a scale."""
    if scale == 1.0 and not np.any(off):
        return scenario
    contact = scenario.contact
    key, value = f"contact.{contact.kind}", getattr(contact, contact.kind)
    if isinstance(value, float):
        return changed(scenario, {key: scale * (value - float(np.ravel(off)[0]))})
    values = scale * (np.array(value.value) - off)
    return changed(scenario, {f"{key}.value": tuple(values.tolist())})


def by_runs(
    groups: list[Group], values: Values, names: list[str], by_time: bool
) -> Array:
    """Return means and standard errors by the scenario's own models, with the noise of its seed: (2, names, rows).

    Rows with times are read along the scenario's run. Otherwise each row is a run at its steady speed, or of the steady
    stage, whose second half counts.
    """
    result = np.empty((2, len(names), sum(len(group.rows) for group in groups)))
    for group in groups:
        scenario = group.scenario.with_values(dict(values) | {"record": {}})
        scenario = _at_true_mount(scenario, 0.0, group.scale)
        runs = [(group.rows, scenario)]
        if not by_time:
            stills = (_still(scenario, group, k) for k in range(len(group.rows)))
            runs = list(zip(group.rows[:, np.newaxis], stills, strict=True))
        for rows, point in runs:
            time, records = _records(point, names)
            members = records[..., len(time) // 2 :].mean(axis=-1, keepdims=True)
            if by_time:
                at = group.time[:, 0]
                members = np.array(
                    [[np.interp(at, time, row) for row in rows] for rows in records]
                )
            count = members.shape[1]
            spread = members.std(axis=1, ddof=min(count - 1, 1))
            result[..., rows] = members.mean(axis=1), spread / math.sqrt(count)
        if not group.scenario.drive.solves_motion:
            alone = by_steady_sliding(group, values, names)
            result[0][:, group.rows] += [*alone.values()]
    return result


def _still(scenario: Scenario, group: Group, row: int) -> Scenario:
    """Return the scenario at the steady speed of a row, or its own steady stage or force, with the mount there."""
    mount = scenario.contact.course.at(group.time[row], scenario.clock.duration)
    steady = {"drive": {"model": "steady", "speed": float(group.speed[row, 0])}}
    drive = {} if scenario.drive.solves_motion else steady
    return scenario.with_values(
        drive | {f"contact.{scenario.contact.kind}": float(mount[0])}
    )


def _records(point: Scenario, names: list[str]) -> tuple[Array, Array]:
    """Return times of the records of a run, and variables, shape (names, members, records).

    There is one member if none differ.

    If the speed is prescribed, the variables are the differences from steady sliding. A run that adds nothing has no
    error between its records.
    """
    count = point.ensemble.members if point.is_random else 1
    steps = range(0, point.clock.steps + 1, point.clock.stride)
    batches = np.array_split(
        np.arange(count, dtype=np.int64), -(-count // together(point))
    )
    runs = [_recorded(point, batch, steps, ["speed", *names]) for batch in batches]
    speeds, *values = np.concatenate(runs, axis=1)
    times = point.times.at(np.array(steps))
    if not point.drive.solves_motion:
        alone = steady_course(point, times[:, np.newaxis], speeds[:1].T)
        values = [
            members - READ[name](point, alone)[:, 0]
            for name, members in zip(names, values, strict=True)
        ]
    return times, np.array(values)


class Unresolved(RuntimeError):
    """A motion that is not resolved: its missing values are no numbers to compare."""

    exit_code = 1


def _recorded(
    point: Scenario, members: NDArray[np.int64], steps: range, names: Sequence[str]
) -> Array:
    """Return variables of some members at some clock steps, shape (names, members, steps)."""
    noise = MemberNoise.of(point.seed, members)
    state, course = point.stepper.follow(noise, None, steps)
    if point.drive.solves_motion:
        unresolved = np.isfinite(cast(Driven, state.drive).unresolved_time)
        if unresolved.any():
            raise Unresolved(
                f"with clock.step = {point.clock.step:.3g} s some members could not be resolved; "
                "set drive.viscosity or a shorter clock.step"
            )
    shape = len(steps), len(members)
    return np.array(
        [np.broadcast_to(READ[name](point, course), shape).T for name in names]
    )
