"""What a scenario predicts for measured rows: at once by steady sliding, and by its own models with all their noise.

Steady sliding is the simplest model that answers: each row is a contact that has slid at its speed for ever, with
the mean of the fluctuations and the edge in equilibrium. It takes a fraction of a millisecond for all rows. The
scenario's own run (``asked``) has everything else: members, clock steps, histories, edges that lag.
"""

import functools
import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import fields
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from sim.engine import MemberNoise, Trajectory, balance, follow
from sim.ensemble.plan import together
from sim.ensemble.variables import VARIABLES
from sim.laws.theories import compare_at_indentation, compare_at_load
from sim.parts.exchange import Motion
from sim.scenario.scenario import Scenario
from sim.spectrum.family import Family
from sim.study.measured import Measured
from sim.units.errors import BadInput

Array = NDArray[np.float64]
#: Values of keys, by their dotted names.
Values = Mapping[str, float]

_READ = {one.name: one.read for one in VARIABLES}


def changed(scenario: Scenario, values: Values) -> Scenario:
    """A scenario with some numbers changed and nothing checked, in microseconds, for values within their bounds."""
    tree: dict[str, Any] = {}
    for key, value in values.items():
        *tables, last = key.split(".")
        table = tree
        for name in tables:
            table = table.setdefault(name, {})
        table[last] = value
    found: Scenario = _changed(scenario, tree)
    return found


def _changed(part: Any, tree: dict[str, Any]) -> Any:
    """A part with numbers changed, and tables in it."""
    own, names = _keys(cast(Hashable, type(part)))
    kept = {name: getattr(part, name) for name in own}
    for key, value in tree.items():
        name = names.get(key, key)
        kept[name] = _changed(kept[name], value) if isinstance(value, dict) else value
    made = object.__new__(type(part))
    made.__dict__.update(kept)
    return made


@functools.cache
def _keys(table: type) -> tuple[list[str], dict[str, str]]:
    """Names of a table's values, and by the key of a file where that is another one."""
    declared = getattr(table, "__pydantic_fields__", {})
    return [item.name for item in fields(table)], {one.alias: name for name, one in declared.items() if one.alias}


class Group(NamedTuple):
    """Rows of a table at which keys of the scenario are the same.

    ``scenario`` has them; ``rows`` are their places in the table, ``time`` [s] and ``speed`` [m/s] theirs, shape
    (rows, 1): the contact's course is one over ``time``.
    """

    scenario: Scenario
    rows: NDArray[np.int64]
    time: Array
    speed: Array


def groups(scenario: Scenario, table: Measured) -> list[Group]:
    """The groups of a table's rows; ``BadInput`` where a row has values that do not go together."""
    own = {key: values for key, values in table.conditions.items() if key not in ("t", "speed", "held")}
    columns = np.array([*own.values()]).reshape(len(own), table.rows)
    found = []
    for place in np.unique(columns, axis=1, return_index=True)[1] if own else [0]:
        rows = np.flatnonzero(np.all(columns == columns[:, place : place + 1], axis=0))
        try:
            one = scenario.with_values({key: float(values[place]) for key, values in own.items()})
        except BadInput as fault:
            raise BadInput([f"{table.path}: row {place + 1}: {said}" for said in fault.problems]) from None
        found.append(_group(one, table, rows))
    return found


def _group(scenario: Scenario, table: Measured, rows: NDArray[np.int64]) -> Group:
    time = np.linspace(0.0, scenario.clock.duration, len(rows))  # a course of the rows, as long as the run
    if "t" in table.conditions:
        time = table.conditions["t"][rows]
    if "held" in table.conditions:
        scenario = scenario.with_values(
            {f"contact.{scenario.contact.kind}": _course(time, table.conditions["held"][rows])}
        )
    if "speed" in table.conditions:
        speed = table.conditions["speed"][rows]
    else:
        instants = np.repeat(time, 2) if "t" in table.conditions else np.zeros(2 * len(rows))
        speed = scenario.drive.pieces(instants, scenario.clock.duration).joined.last[::2]
    return Group(scenario, rows, time[:, np.newaxis], speed[:, np.newaxis])


def _course(time: Array, values: Array) -> Any:
    """What holds the sphere at the rows: a number where that is one."""
    return float(values[0]) if np.all(values == values[0]) else {"time": time, "value": values}


def steady_course(scenario: Scenario, time: Array, speed: Array) -> Trajectory:
    """Contacts that have slid at speeds [m/s] for ever, held as the scenario has it at times [s]; shapes (rows, 1)."""
    found = scenario.population.steady(speed[:, 0])
    still = 0.0 * speed
    bonding = type(found)(*(np.reshape(values, (-1, 1)) + still for values in found))
    motion = Motion(0, time, 0.0 * time, still, still, speed, speed)  # type: ignore[arg-type]
    shear = scenario.fluctuations
    size = shear.amplitude.factor(speed, bonding.strength) ** 2
    size = bonding.frozen + bonding.varying if shear.spectrum.bond_made else size
    energy = size * _plane_energy(shear.spectrum, *scenario.solid.effective)
    terms = balance(scenario, bonding.fraction, bonding.strength, np.broadcast_to(energy, speed.shape), still)
    touch = scenario.contact.start(motion, scenario.clock.duration, terms)
    moving = time, still, speed, bonding.fraction, bonding.stress, bonding.strength, energy
    return Trajectory(*moving, np.empty((len(speed), 1, 0)), *touch)


@functools.lru_cache(maxsize=256)  # most numbers that are changed are none of the spectrum's
def _plane_energy(spectrum: Family, shear_modulus: float, poisson_ratio: float) -> float:
    return float(spectrum.surface_energy(shear_modulus, poisson_ratio))


def by_steady_sliding(group: Group, values: Values, names: list[str], theory: str = "") -> dict[str, Array]:
    """Variables at the rows of a group with some numbers changed, in steady sliding.

    ``theory`` is the name of a theory of ``sim.laws.theories`` that gives the radius in place of the contact's balance,
    at the stress of the bonds; its numbers ``"alpha"`` and ``"lambda"`` are among the ``values``.
    """
    own = {key: value for key, value in values.items() if "." in key or key in ("seed",)}
    scenario = changed(group.scenario, own)
    course = steady_course(scenario, group.time, group.speed)
    if theory:
        course = course._replace(radius=_radius_by(theory, scenario, course, values))
    return {name: np.broadcast_to(_READ[name](scenario, course), group.speed.shape)[:, 0] for name in names}


def _radius_by(theory: str, scenario: Scenario, course: Trajectory, values: Values) -> Array:
    """Contact radius by a theory, at the stress that the bonds bear and the full work of adhesion."""
    control = scenario.contact.control(course.time, scenario.clock.duration)
    load, base, _ = control.mount
    at_load = scenario.contact.kind == "load"
    compare: Callable[..., dict[str, Array]] = compare_at_load if at_load else compare_at_indentation
    numbers = {"reversible": values.get("alpha", 0.0), "mixity": values.get("lambda", 0.5)}
    rest = scenario.adhesion.work, *scenario.bodies
    return compare(np.abs(course.stress), load if at_load else base, *rest, **numbers)[theory]


class Sampled(NamedTuple):
    """Means over members of each variable at the rows of a table, and their standard errors, 0 where none differ."""

    mean: dict[str, Array]
    error: dict[str, Array]


def asked(found: list[Group], values: Values, names: list[str], by_time: bool) -> Sampled:
    """What the scenario's own models give at the rows of a table, with the noise of its seed.

    Where rows have times, or only speeds and the drive passes through these, they are read along the scenario's run;
    else each row is a run of its own at a steady speed, of the stage if there is one, of which the second half counts.

    Raises
    ------
    BadInput
        If the run does not reach the speed of a row, or passes it twice.
    """
    count = sum(len(group.rows) for group in found)
    sampled = Sampled(*({name: np.full(count, np.nan) for name in names} for _ in range(2)))
    for group in found:
        scenario = group.scenario.with_values(dict(values) | {"record": {}})
        runs: list[tuple[NDArray[np.int64], Scenario, Weights]] = []
        driven = scenario.drive.solves_motion
        if by_time or not (driven or scenario.drive.model == "steady" or scenario.contact.changes):
            runs.append((group.rows, scenario, functools.partial(_places, group, by_time)))
        else:
            runs += [(group.rows[k : k + 1], _still(scenario, group, k), _second_half) for k in range(len(group.rows))]
        for rows, point, places in runs:
            for name, members in _members(point, names, places).items():
                mean = members.mean(axis=1)
                spread = members.std(axis=1, ddof=1) if members.shape[1] > 1 else 0.0 * mean
                sampled.mean[name][rows] = mean
                sampled.error[name][rows] = spread / math.sqrt(members.shape[1])
    return sampled


def _still(scenario: Scenario, group: Group, row: int) -> Scenario:
    """The scenario at the steady speed of a row, or under its own steady stage or force, and held as it was there."""
    held = scenario.contact.course.at(group.time[row], scenario.clock.duration)
    steady = {"drive": {"model": "steady", "speed": float(group.speed[row, 0])}}
    drive = {} if scenario.drive.solves_motion else steady
    return scenario.with_values(drive | {f"contact.{scenario.contact.kind}": float(held[0])})


#: Weights of the records of a run that make the rows, shape (rows, records).
Weights = Callable[[Trajectory], Array]


def _second_half(course: Trajectory) -> Array:
    weights = (np.arange(len(course.time)) >= len(course.time) // 2).astype(float)
    return weights[np.newaxis] / weights.sum()


def _places(group: Group, by_time: bool, course: Trajectory) -> Array:
    """Weights of the two records between which a row lies, by its time or by the logarithm of its speed."""
    if by_time:
        along, at = course.time[:, 0], group.time[:, 0]
    else:
        with np.errstate(divide="ignore"):
            along, at = np.log(np.abs(course.speed[:, 0])), np.log(np.abs(group.speed[:, 0]))
    if along[0] > along[-1]:
        along, at = -along, -at
    rising, near = bool(np.all(np.diff(along) > 0.0)), 1e-9 * max(1.0, float(np.ptp(along)))
    if not rising or at.min() < along[0] - near or at.max() > along[-1] + near:
        said = "the run must pass each measured speed once"
        if rising:
            ends = (np.abs(course.speed), np.abs(group.speed))
            run, data = (f"{values.min():.3g} to {values.max():.3g}" for values in ends)
            said = f"the run goes from {run} m/s, the data from {data}"
        raise BadInput([f'drive.speed: {said}; fit with a wider drive, or with [drive] model = "steady"'])
    place = np.clip(np.searchsorted(along, at) - 1, 0, len(along) - 2)
    part = np.clip((at - along[place]) / (along[place + 1] - along[place]), 0.0, 1.0)
    weights = np.zeros((len(at), len(along)))
    rows = np.arange(len(at))
    weights[rows, place], weights[rows, place + 1] = 1.0 - part, part
    return weights


def _members(point: Scenario, names: list[str], places: Weights) -> dict[str, Array]:
    """Variables at rows by member, shape (rows, members); one member where none differ."""
    count = point.ensemble.members if any(point.varies.values()) else 1
    steps, most = range(0, point.clock.steps + 1, point.clock.stride), together(point)
    kept: dict[str, list[Array]] = {name: [] for name in names}
    for first in range(0, count, most):
        members = np.arange(first, min(first + most, count))
        _, course = follow(point, MemberNoise.of(point.seed, members), None, steps)
        weights = places(course)
        for name in names:
            values = np.broadcast_to(_READ[name](point, course), (len(steps), len(members)))
            kept[name].append(np.array([[row @ one for one in values.T] for row in weights]))
    return {name: np.concatenate(several, axis=1) for name, several in kept.items()}
