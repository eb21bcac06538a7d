"""Measured curves, their prediction by a scenario, and their least squares.

Curves are columns of CSV tables, named as variables of a dataset, with units and standard errors. They are predicted in
two ways. Steady sliding is computed for all rows in a fraction of a millisecond. Each row is a contact in steady
sliding at its speed, with the mean of the fluctuations and the edge in equilibrium. The scenario's own run has
everything else: members, clock steps, histories, edges that lag.

A number above zero without an upper bound is fitted in its logarithm. The sum of squares is over errors; a relative
error that curves share, or that the readings of the mount share, is one more number, known to be 0 within its size.
"""

import contextlib
import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, optimize, stats
from scipy.stats import qmc

from sim.ensemble.dataset import variable_name
from sim.ensemble.plan import together
from sim.ensemble.steady import (
    Values,
    history_at_rest,
    jump_into_contact,
    steady_course,
)
from sim.ensemble.variables import READ, VARIABLES
from sim.laws import theories
from sim.laws.incipient import Incipient
from sim.laws.theories import compare_at_indentation, compare_at_load
from sim.parts.drive import Driven
from sim.parts.exchange import Array
from sim.quantities import QUANTITIES
from sim.scenario.scenario import Clock, Scenario
from sim.scenario.schema import changed, quantities
from sim.step.state import MemberNoise, Trajectory
from sim.study.noise import FEWEST, Noise, noise_of
from sim.units.errors import BadInput
from sim.units.instrument import Instrument, Reading, Zero
from sim.units.quantity import Quantity
from sim.units.tables import names_of, read_measured

#: Column, unit and symbol of what holds the sphere, by the key of the contact that prescribes it.
MOUNT = {
    "load": ("normal_load", "N", "P"),
    "indentation": ("indentation", "m", "delta"),
    "displacement": ("displacement", "m", "Delta"),
}
#: What is recorded of a history, or is no measured number; and what is measured of a slider that feels its friction.
_NOT_MEASURED = (
    "in_contact",
    "masked",
    "detachment_time",
    "dissipated_energy",
    "applied_load",
)
#: Sizes of the contact, which are never below 0.
_SIZES = ("contact_radius", "contact_area")
_OF_SLIDER = ("speed", "slider_position", "spring_force")
#: Times of a run at which its speed is looked at.
_TRIED = 41


class Curve(NamedTuple):
    """Measured values of one variable in one table [SI]; ``errors`` are standard errors, None if they are unknown."""

    name: str
    values: Array
    errors: Array | None


#: Conditions that may change along the course of a contact; each value of another one is a scenario.
COURSES = ("t", "speed", "mount", "tangential_force")


class Measured(NamedTuple):
    """One table: under which conditions which curves were measured.

    ``conditions`` holds the columns ``"t"``, ``"speed"``, ``"mount"`` (load, indentation or displacement),
    ``"tangential_force"`` and those of other keys of the scenario. Rows have the same numbers in all columns. ``mount``
    is the key of the contact that holds the sphere. The first ``baseline`` rows were measured before the contact;
    ``noise`` is that of curves there. ``jumps`` are the readings at the jump into contact. ``remark`` states that a
    table without units was read in SI.
    """

    path: Path
    mount: str
    conditions: dict[str, Array]
    curves: tuple[Curve, ...]
    baseline: int = 0
    noise: Mapping[str, Noise] = MappingProxyType({})
    jumps: tuple[Reading, ...] = ()
    remark: str = ""

    @property
    def has_history(self) -> bool:
        """Return True if the mount moves as it was measured, over the times of the rows."""
        return {"t", "mount"} <= self.conditions.keys()

    @property
    def elapsed(self) -> Array:
        """Return the time since the first row in contact [s]; 0 without times."""
        time = self.conditions.get("t", np.zeros(self.rows))
        return time - time[self.baseline] if self.has_history else time

    @property
    def in_contact(self) -> "Measured":
        """Return this table without its baseline."""
        return self.at(np.arange(self.baseline, self.rows))._replace(baseline=0)

    def at(self, rows: NDArray[np.int64]) -> "Measured":
        """Return some rows of this table."""
        conditions = {name: values[rows] for name, values in self.conditions.items()}
        curves = tuple(
            Curve(name, values[rows], None if errors is None else errors[rows])
            for name, values, errors in self.curves
        )
        return self._replace(conditions=conditions, curves=curves)

    @property
    def stem(self) -> str:
        """Return the name of the table, which is that of its file."""
        return self.path.stem

    @property
    def rows(self) -> int:
        return len(self.curves[0].values)

    @property
    def names(self) -> list[str]:
        return [curve.name for curve in self.curves]


def read(
    path: Path,
    scenario: Scenario,
    planned: Sequence[str] = (),
    place: tuple[int, int] = (0, 1),
) -> Measured:
    """Read a table of measured curves.

    Parameters
    ----------
    path : Path
        CSV with a header such as ``speed [mm/s], contact_area [mm^2], contact_area_error [mm^2]``: conditions,
        variables of a dataset, and beside these their standard errors, in the same dimension or in ``[%]``.
        Conditions are ``t``, ``speed``, the prescribed quantity of the mount (``normal_load``, ``indentation`` or
        ``displacement``), with the table ``[incipient]`` the ``tangential_force`` of a contact that does not slide yet,
        or numbers of the scenario by their names in a dataset, such as ``solid_shear_modulus``. A
        comment such as ``# solid.shear_modulus = 1 MPa`` states a condition of all rows. The speed of a slider behind a
        spring or under a force is no condition but a curve; ``stage_speed`` is that of a steady stage.
    scenario : Scenario
        The scenario that is compared with the curves.
    planned : sequence of str
        Variables of a plan, of which a table has the errors and needs no values, which are then nan. Relative errors
        are negative numbers. A table without curves has these variables, without errors.
    place : tuple of int
        Place of the table among all tables of a fit, and their number.

    Raises
    ------
    BadInput
        With one line.
    """
    at, outcomes = conditions_of(scenario), outcomes_of(scenario)
    if planned:
        outcomes = {
            name: quantity for name, quantity in outcomes.items() if name not in at
        }
    known = {name: quantity for name, (_, quantity) in at.items()} | outcomes
    result, remark = read_measured(
        path, known, outcomes, is_planned=bool(planned), instrument=scenario.instrument
    )
    conditions = {
        at[name][0]: points.values for name, points in result.items() if name in at
    }
    curves = tuple(
        Curve(name, *points) for name, points in result.items() if name not in at
    )
    unknown = np.full(len(next(iter(result.values())).values), np.nan)
    curves = curves or tuple(Curve(name, unknown, None) for name in planned)
    for fault in faults_of(scenario, conditions, curves):
        raise BadInput([f"{path}: {fault}"])
    table = Measured(path, scenario.contact.kind, conditions, curves, remark=remark)
    try:
        if scenario.jump_in is not None:
            table = table._replace(jumps=scenario.jump_in.readings(*place))
        if scenario.instrument is not None:
            table = _stretch(table, scenario.instrument, place)
    except ValueError as fault:
        raise BadInput([f"{path}: {fault}"]) from None
    if table.jumps and table.mount == "load":
        reason = "a contact under a load closes at a load of 0, wherever the sphere is"
        cure = "prescribe contact.displacement or contact.indentation"
        raise BadInput([f"{path}: jump_in: {reason}; {cure}, or omit the table"])
    if table.jumps and not table.has_history:
        cure = "add the columns t and displacement or indentation, or omit the table"
        raise BadInput([f"{path}: jump_in: needs the history of a loop; {cure}"])
    return table


def _stretch(
    table: Measured, instrument: Instrument, place: tuple[int, int]
) -> Measured:
    """Return the rows of a table that are fitted, those of its baseline first, with the noise there."""
    stretch, baseline = (
        instrument.times(name, *place) for name in ("stretch", "baseline")
    )
    time, all_rows = table.conditions.get("t"), np.arange(table.rows)
    rows, early = all_rows, all_rows[:0]
    for name, ends in (("stretch", stretch), ("baseline", baseline)):
        if ends is None:
            continue
        if time is None:
            raise ValueError(f"instrument.{name}: needs times; add a column t [s]")
        inside = all_rows[(time >= ends[0]) & (time <= ends[1])]
        fewest = FEWEST if name == "baseline" else 2
        if len(inside) < fewest:
            reach = f"the file has {time.min():g} to {time.max():g} s"
            fault = f"{len(inside)} rows between {ends[0]:g} and {ends[1]:g} s, fewer than {fewest}"
            raise ValueError(f"instrument.{name}: {fault}; {reach}")
        rows, early = (inside, early) if name == "stretch" else (rows, inside)
    others = {*table.names} - {"normal_load", *_SIZES}
    if baseline and (not table.has_history or others or table.mount == "load"):
        cure = "it needs the columns t and displacement or indentation, and curves that are 0 without contact"
        raise ValueError(f"instrument.baseline: {cure}: normal_load, contact_radius")
    if early.size and early[-1] >= rows[0]:
        raise ValueError(
            "instrument.baseline: must end before the stretch begins; shorten one"
        )
    noise = {
        curve.name: noise_of(table.conditions["t"][early], curve.values[early])
        for curve in table.curves
        if early.size and curve.errors is None
    }
    early, rows = early[:: instrument.every], _thinned(table, rows, instrument.every)
    chosen = table.at(np.concatenate([early, rows]))
    return chosen._replace(baseline=len(early), noise=noise)


def _thinned(table: Measured, rows: NDArray[np.int64], every: int) -> NDArray[np.int64]:
    """Return every so many rows, the last one, and those at which the mount turns, because a course has its turns."""
    kept = {*rows[::every].tolist(), int(rows[-1])}
    mount = table.conditions.get("mount")
    # between two rows that are kept
    for start in range(0, len(rows) - 2 if mount is not None else 0, every):
        part = rows[start : start + every + 1]
        values = cast(Array, mount)[part]
        for extreme in (values.argmin(), values.argmax()):
            steps = np.abs(values[extreme] - values[[0, -1]])
            if np.all(steps > np.median(np.abs(np.diff(values)))):
                kept.add(int(part[extreme]))
    return np.array(sorted(kept))


def with_stated_errors(
    tables: Sequence[Measured], texts: Sequence[str]
) -> list[Measured]:
    """Return tables whose curves without errors have those of texts ``"2 %"``, ``"1 mN"``, ``"contact_area=2 %"``."""
    unused, result = dict.fromkeys(texts), []
    for table in tables:
        curves = []
        for curve in table.curves:
            for text in texts if curve.errors is None else ():
                name, _, size = text.rpartition("=")
                is_share = size.endswith("%")
                unit = "1" if is_share else QUANTITIES[curve.name].unit
                if name not in ("", curve.name):
                    continue
                with contextlib.suppress(ValueError):
                    error = Quantity(unit, "error", above=0).read(size)
                    scale = np.abs(curve.values) if is_share else np.ones(table.rows)
                    curve = curve._replace(errors=error * scale)
                    unused.pop(text, None)
            if curve.errors is not None and not np.all(curve.errors):
                cause = f"{table.path}: {curve.name} has a value of 0"
                raise BadInput([f"{cause}; give --errors in its unit"])
            curves.append(curve)
        result.append(table._replace(curves=tuple(curves)))
    if unused and all(c.errors is not None for t in tables for c in t.curves):
        raise BadInput(
            ["--errors: all curves have errors in their tables; leave it out"]
        )
    for text in unused:
        cure = 'write "2 %", a size with the unit of a curve without errors, or one of both as COLUMN=SIZE'
        raise BadInput([f"--errors {text}: no curve can have such errors; {cure}"])
    return result


def faults_of(
    scenario: Scenario, conditions: dict[str, Array], curves: tuple[Curve, ...]
) -> Iterator[str]:
    """Yield the faults of a table: missing conditions, curves without information and opposite signs."""
    if not curves:
        yield 'no column was measured; name one as a variable of a dataset, such as "contact_area [mm^2]"'
    drive, contact, known = scenario.drive, scenario.contact, quantities(scenario)
    if "tangential_force" in conditions:
        yield from _faults_of_pull(scenario, conditions, curves)
    steady = (
        {"drive.stage", "drive.force"} & known.keys()
        if drive.solves_motion
        else {"speed"} & conditions.keys()
    )
    varies = not steady and drive.model != "steady"
    time, moves = conditions.get("t"), len(conditions.keys() & {"speed", "mount"})
    if time is not None and moves and "speed" not in conditions and _at_rest(scenario):
        if (back := np.flatnonzero(np.diff(time) <= 0.0)).size:
            yield f"t does not increase at row {back[0] + 2}; give each file one loop, its rows in order of time"
    elif time is not None and not moves and time.max() > scenario.clock.duration:
        yield f"t reaches {time.max():g} s, beyond clock.duration; lengthen the run"
    elif "t" in conditions and moves:
        yield "the scenario has the speed and the load at each time; omit t, or these columns"
    elif "t" not in conditions and (
        not conditions or varies or ("mount" not in conditions and contact.changes)
    ):
        yield f'no column has the conditions of each row; add "t [s]", or "speed [mm/s]" and "{MOUNT[contact.kind][0]}"'
    for name, values, errors in curves:
        if name in ("friction_force", "shear_stress") and np.all(
            values * conditions.get("speed", 1.0) < 0.0
        ):
            yield f"{name} needs the sign of the speed; change the sign of one of them"
        if errors is None and not np.any(values):
            yield f"{name} is 0 in all rows, so it has no scatter; give errors, or omit it"


def _faults_of_pull(
    scenario: Scenario, conditions: dict[str, Array], curves: tuple[Curve, ...]
) -> Iterator[str]:
    """Yield the faults of a table of contacts under a tangential force that do not slide yet."""
    if {"t", "speed"} & conditions.keys():
        yield "tangential_force belongs to contacts that do not slide; omit t and speed"
    elif not _at_rest(scenario) or scenario.contact.kind == "displacement":
        cure = 'set [drive] model = "steady" with speed = 0, [shear] model = "uniform", and a load or an indentation'
        yield f"tangential_force needs a contact at rest that is held; {cure}"
    for name in (curve.name for curve in curves if curve.name not in _SIZES):
        yield f"{name} does not follow from tangential_force; omit it, or measure contact_area"


def _at_rest(scenario: Scenario) -> bool:
    """Return True if the slider is at rest all the time and nothing fluctuates, so that the contact has the history."""
    is_still = not scenario.drive.solves_motion and not scenario.speeds(_TRIED).any()
    return is_still and not scenario.is_random


def outcomes_of(scenario: Scenario) -> dict[str, Quantity]:
    """Return the declarations of the variables that can be measured, by name."""
    by_run = scenario.drive.solves_motion
    return {
        item.name: Quantity(
            item.definition.unit,
            item.definition.meaning,
            at_least=0 if item.name in _SIZES else -math.inf,
        )
        for item in VARIABLES
        if item.name not in _NOT_MEASURED
        and item.applies(scenario)
        and (item.part != "drive" or (by_run and item.name in _OF_SLIDER))
    }


def conditions_of(scenario: Scenario) -> dict[str, tuple[str, Quantity]]:
    """Return condition and declaration by the name of a column."""
    kind = scenario.contact.kind
    result = {
        variable_name(key): (key, quantity)
        for key, (quantity, _) in quantities(scenario).items()
    }
    if not scenario.drive.solves_motion:
        result["speed"] = result["drive_speed"] = (
            "speed",
            Quantity("m/s", "sliding speed", "V"),
        )
    elif "drive_stage" in result:
        result["stage_speed"] = result["drive_stage"]
    if "temperature_value" in result:
        result["temperature"] = result["temperature_value"]
    if scenario.incipient is not None:
        result["tangential_force"] = (
            "tangential_force",
            Quantity("N", "tangential force before sliding", "Q"),
        )
    column, unit, symbol = MOUNT[kind]
    mount = Quantity(unit, f"{column} of the sphere, contact.{kind}", symbol)
    result |= dict.fromkeys(names_of(column), ("mount", mount))
    return result | {
        "t": (
            "t",
            Quantity(
                "s",
                "time since the start",
                at_least=0,
                # an instrument counts from a time of its own
                at_most=math.inf if scenario.instrument else scenario.clock.duration,
            ),
        )
    }


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


def groups(scenario: Scenario, table: Measured) -> list[Group]:
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


#: Probability of an interval.
LEVEL = 0.95
#: Residual of a row at which the contact is open, in standard errors.
_OPEN = 1e6
#: Step of derivatives, in logarithms or shares of the range, and relative size of a direction that changes nothing.
_STEP, _NOTHING = 1e-4, 1e-5
#: The same, and the precision of a minimum, where each prediction is a run, known to the tolerance of its steps alone.
_RUN_STEP, _RUN_NOTHING, _RUN_PRECISION = 1e-3, 1e-2, 1e-6
#: Change of all rows, in standard errors and over an e-fold, that is none.
_NO_EFFECT = 1e-6
#: Speeds of a line that is drawn.
_DRAWN = 200
#: Precision of the ends of an interval, over its half width, that of the sums of squares there, and most steps to one.
_END, _END_SQUARES, _MOST = 1e-3, 1e-5, 30
#: Residual of the spring, by which an end is found, at a distance of a standard error; the share of the way to its aim
#: that may be left, and the factor by which it is made stiffer if more is left.
_STIFFNESS, _NEAR_AIM, _STIFFER = 10.0, 0.1, 3.0
#: Places of the profile of a zero, and residual at a distance of a standard error of the spring that holds it.
_PROFILED, _HELD = 8, 1e3
#: Rounds in which errors that nobody gave are found.
_ROUNDS = 4
#: Most evaluations of a minimum, for each number and one more.
_EVALUATIONS = 100
#: Spread of a number without information, in large changes of it.
_UNKNOWN = 1e3
#: Places at which the sum of squares is tried before a search: binary logarithm of their number, the range of each set
#: of them over that of the bounds, and the number of the lowest from which a search starts.
_PLACES, _RANGES, _STARTS = 8, (1.0, 0.25), 8
#: The same if each prediction is a run.
_RUN_PLACES, _RUN_RANGES, _RUN_STARTS = 3, (0.1,), 1
#: Bound of an error that all points share, over its size, and the largest one, below 1.
_MOST_COMMON, _LARGEST_COMMON = 5.0, 0.9
#: Places that are tried around a minimum, their distances from it in standard errors, and searches from the lowest.
_AROUND, _DISTANCES, _BEHIND = 128, (1.0, 4.0), 4
#: Lowest places beyond an end of an interval, and at its bound, from which another explanation is searched.
_ELSEWHERE = 2
#: Most factor between the distance of an end and that of a parabola at which no other explanation is searched.
_PARABOLIC = 1.2
#: Relative precision of a minimum, and of the sums of squares among which the lowest is chosen.
_PRECISION, _COARSE = 1e-8, 1e-3
#: Relative precision of places, if that of the sum of squares is not finer.
_FINEST = 1e-6
#: Cosine of the least angle at which a search starts.
_INSIDE = 0.998


class Free(NamedTuple):
    """A number of the scenario that is to be found between two bounds; ``start`` is the scenario's own.

    A number of one ``table`` has its name behind the key, as in ``"bonds.stress (wet)"``.
    """

    key: str
    quantity: Quantity
    start: float
    low: float
    high: float
    table: int = -1

    @property
    def name(self) -> str:
        """Return the key without the table."""
        return self.key.partition(" (")[0]

    @property
    def logarithmic(self) -> bool:
        # the place of a zero has no size
        return self.low > 0.0 and not self.name.startswith("zero.")

    @property
    def width(self) -> float:
        """Change of the number as it is fitted that is a large one: an e-fold, or its range."""
        return 1.0 if self.logarithmic else self.high - self.low

    def inner(self, value: float) -> float:
        """The number as it is fitted."""
        return math.log(value) if self.logarithmic else value

    def outer(self, x: float) -> float:
        return min(max(math.exp(x), self.low), self.high) if self.logarithmic else x


@dataclass(frozen=True)
class Problem:
    """Measured numbers beside those that a scenario predicts for them.

    ``values`` are all curves of all ``tables`` in turn, ``curve`` the number of each one's curve; ``sigma`` their
    standard errors, ``estimated`` where nobody gave them. ``shift`` is what the scenario's own models add to
    steady sliding at each of them, and ``noise`` its standard error. ``common`` are relative errors that all points
    of a variable share, that of the mount included. ``fixed`` and ``theory`` make another mechanism of the scenario.
    With ``by_run`` each prediction is a run of the scenario's own models, as steady sliding does not depend on all that
    is free. A ``spring`` is one more residual, which draws a quantity to a value. ``whitening`` has the places of
    curves with correlated errors, and the root of their correlations, by which residuals become independent.
    """

    tables: Sequence[Measured]
    groups: Sequence[list[Group]]
    free: Sequence[Free]
    common: dict[str, float]
    values: Array
    sigma: Array
    curve: NDArray[np.int64]
    estimated: NDArray[np.bool_]
    shift: Array
    noise: Array
    fixed: Values = field(default_factory=dict)
    theory: str = ""
    by_run: bool = False
    spring: Callable[[Array], float] | None = None
    whitening: tuple[tuple[slice, Array], ...] = ()

    @property
    def is_rough(self) -> bool:
        """Return True if predictions are known to the tolerance of their steps alone."""
        return self.by_run or any(table.has_history for table in self.tables)

    @property
    def start(self) -> Array:
        return np.array(
            [item.inner(item.start) for item in self.free] + [0.0] * len(self.common)
        )

    @property
    def bounds(self) -> list[tuple[float, float]]:
        ends = [(item.inner(item.low), item.inner(item.high)) for item in self.free]
        most = [min(_MOST_COMMON, _LARGEST_COMMON / x) for x in self.common.values()]
        return ends + [(-end, end) for end in most]

    @property
    def widths(self) -> Array:
        """Return the change of each number that is a large one."""
        return np.array([item.width for item in self.free] + [1.0] * len(self.common))

    def numbers(self, x: Array) -> dict[str, float]:
        """Return the values of the free keys and of those that make the mechanism."""
        return {
            item.key: item.outer(float(value))
            for item, value in zip(self.free, x, strict=False)
        } | {**self.fixed}

    def of_table(self, x: Array, table: int) -> dict[str, float]:
        """Return the values of the keys in a table, and of those that make the mechanism."""
        applied = zip(self.free, x, strict=False)
        return {
            item.name: item.outer(float(value))
            for item, value in applied
            if item.table in (-1, table)
        } | {**self.fixed}

    def groups_at(self, x: Array) -> Sequence[list[Group]]:
        """Return the groups with the common error of the mount."""
        errors = zip(self.common.items(), x[len(self.free) :], strict=False)
        of_mount = [size * e for (name, size), e in errors if name not in self.names]
        if not of_mount:
            return self.groups
        scale = 1.0 / (1.0 + of_mount[0])
        return [[item._replace(scale=scale) for item in table] for table in self.groups]

    def steady(self, x: Array, only: str = "") -> Array:
        """Return all curves in steady sliding, or by runs; or one variable at the rows of all curves."""
        if self.by_run:
            return self.sampled(x)[0]
        result, all_groups = [], self.groups_at(x)
        for k, (table, groups) in enumerate(zip(self.tables, all_groups, strict=True)):
            names = [only] * len(table.curves) if only else table.names
            numbers, columns = self.of_table(x, k), np.empty((len(names), table.rows))
            for group in groups:
                values = by_steady_sliding(group, numbers, names, self.theory)
                columns[:, group.rows] = [values[name] for name in names]
            if early := table.baseline:
                zero = changed(groups[0].scenario, numbers).zero or Zero()
                for column, name in zip(columns, names, strict=True):
                    column[:early] = zero.at(name, table.elapsed[:early])
            result.append(columns.ravel())
        return np.concatenate(result)

    def sampled(self, x: Array) -> Array:
        """Return all curves by the scenario's own models and their standard errors, shape (2, numbers)."""
        runs = [
            by_runs(groups, self.of_table(x, k), table.names, "t" in table.conditions)
            for k, (table, groups) in enumerate(
                zip(self.tables, self.groups_at(x), strict=True)
            )
        ]
        return np.concatenate([rows.reshape(2, -1) for rows in runs], axis=1)

    def predicted(self, x: Array) -> Array:
        """All curves, with the shift and the common errors."""
        result = self.steady(x) + self.shift
        for name in self.common:
            shared = self._shared(x, name)
            result = np.where(self.of(name), result * shared, result)
        return result

    def _shared(self, x: Array, name: str) -> float:
        """Return the factor of a common error on all readings of a variable."""
        errors = zip(self.common.items(), x[len(self.free) :], strict=False)
        return math.prod(1.0 + size * e for (key, size), e in errors if key == name)

    @property
    def jumps(self) -> list[tuple[int, Reading]]:
        """Return the table and the reading of each datum of a jump into contact."""
        return [
            (k, jump) for k, table in enumerate(self.tables) for jump in table.jumps
        ]

    def predicted_jumps(self, x: Array) -> Array:
        """Return the readings at the jumps into contact, by the model, the zeros and the common errors.

        The drift of a zero counts from the first row of the stretch, which the jump precedes.
        """
        result, all_groups = [], self.groups_at(x)
        for k, jump in self.jumps:
            first, kind = all_groups[k][0], self.tables[k].mount
            scenario = changed(first.scenario, self.of_table(x, k))
            zero = scenario.zero or Zero()
            displacement, load = jump_into_contact(scenario)
            if jump.name == "displacement":
                result.append(displacement / first.scale + zero.at(kind, 0.0))
            else:
                load += zero.at(jump.name, 0.0)
                result.append(load * self._shared(x, jump.name))
        return np.array(result)

    def between(
        self, x: Array, table: int, name: str, along: tuple[str, NDArray[np.int64]]
    ) -> tuple[Array, Array]:
        """Return places between sorted rows that differ in one condition alone, and their curve in steady sliding.

        ``along`` are the condition, a time, speed or mount, and the rows.
        """
        (key, rows), measured = along, self.tables[table]
        here = self.groups_at(x)[table]
        group = next(item for item in here if rows[0] in item.rows)
        known = {
            each: measured.conditions[each][rows]
            for each in COURSES
            if each in measured.conditions
        }
        first, last = known[key][[0, -1]]
        spaced = np.geomspace if first > 0.0 else np.linspace
        fine = spaced(first, last, _DRAWN)
        between = {each: np.interp(fine, known[key], known[each]) for each in known}
        curve = measured.curves[0]._replace(values=fine)
        points = measured._replace(conditions=between, curves=(curve,))
        (course,) = groups(group.scenario, points)
        course = course._replace(scale=group.scale)
        values = self.of_table(x, table)
        return fine, by_steady_sliding(course, values, [name], self.theory)[name]

    @property
    def curves(self) -> list[tuple[int, str]]:
        """Return the table and the variable of each curve."""
        return [
            (k, name) for k, table in enumerate(self.tables) for name in table.names
        ]

    @property
    def names(self) -> list[str]:
        """Return the names of all curves."""
        return [name for _, name in self.curves]

    def of(self, name: str) -> NDArray[np.bool_]:
        """Return True at the numbers of a variable."""
        return np.array(self.names)[self.curve] == name

    def place(self, number: int) -> str:
        """Return the variable and the row of one of all numbers, and its table if there are several, for people."""
        table, name = self.curves[self.curve[number]]
        row = number - int(np.argmax(self.curve == self.curve[number])) + 1
        stem = f"{self.tables[table].stem}, " * (len(self.tables) > 1)
        return f"{stem}{name}: row {row}"

    def residuals(self, x: Array) -> Array:
        """Deviations over errors, those of the jumps into contact, and the common errors over their sizes."""
        off = (self.values - self.predicted(x)) / np.hypot(self.sigma, self.noise)
        off = np.nan_to_num(off, nan=_OPEN, posinf=_OPEN, neginf=-_OPEN)
        for rows, root in self.whitening:
            off[rows] = linalg.solve_triangular(root, off[rows], lower=True)
        drawn = [] if self.spring is None else [self.spring(x)]
        return np.concatenate([off, self.off_jumps(x), x[len(self.free) :], drawn])

    @functools.cached_property
    def tried(self) -> Array:
        """Return the places of ``spread``, the one with the lowest sum of squares first."""
        places = spread(self)
        return places[
            np.argsort([_sum(self, place) for place in places], kind="stable")
        ]

    def off_jumps(self, x: Array) -> Array:
        """Return the deviations of the jumps into contact over their errors."""
        read = np.array([(jump.value, jump.error) for _, jump in self.jumps])
        values, errors = read.reshape(-1, 2).T
        return np.asarray((values - self.predicted_jumps(x)) / errors)

    @property
    def data(self) -> int:
        """Number of measured numbers, of the curves and of the jumps into contact."""
        return len(self.values) + len(self.jumps)

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return self.data - len(self.free)

    def criterion(self, chi_square: float) -> float:
        """Akaike's criterion for few points, AICc."""
        count = len(self.free) + len({*self.curve[self.estimated].tolist()})
        left = self.data - count - 1
        if left <= 0:
            return math.inf
        size = chi_square + 2.0 * float(np.sum(np.log(self.sigma[self.estimated])))
        return size + 2.0 * count * (1.0 + (count + 1) / left)

    def compared(self, x: Array) -> "Problem":
        """Return this problem with the shift from steady sliding at x to the scenario's own models there."""
        mean, noise = self.sampled(x)
        for number in np.flatnonzero(~np.isfinite(mean)):
            raise BadInput(
                [
                    f"{self.place(int(number))} has no value in a run of the fit: is the contact open there?"
                ]
            )
        return replace(self, shift=mean - self.steady(x), noise=noise)


class Minimum(NamedTuple):
    """A minimum of the sum of squares; ``converged`` if the search ended there.

    ``covariance`` is that of what is free. It is nan after a coarse search, because only the sums of squares of several
    coarse searches are compared.
    """

    x: Array
    chi_square: float
    covariance: Array
    converged: bool


def minimum(problem: Problem, start: Array, precision: float = _PRECISION) -> Minimum:
    """Return the least sum of squares near a start, to a relative precision, and the covariance if it is the finest.

    The search is that of Levenberg and Marquardt (MINPACK) for angles, whose cosines are the places between the bounds.
    An angle of 0 in the middle would make the first steps zero, because they are relative to the angles.
    """
    if not len(start):
        chi_square = float(np.sum(problem.residuals(start) ** 2))
        return Minimum(start, chi_square, np.empty((0, 0)), True)
    is_fine = precision <= _PRECISION
    precision = max(precision, _RUN_PRECISION) if problem.is_rough else precision
    low, high = np.transpose(problem.bounds)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def place(angles: Array) -> Array:
        return middle - half * np.cos(angles)

    result = optimize.least_squares(
        lambda angles: problem.residuals(place(angles)),
        # at a bound no step has an effect
        np.arccos(np.clip((middle - start) / half, -_INSIDE, _INSIDE)),
        method="lm",
        x_scale="jac",
        # a run is known to the tolerance of its steps alone
        diff_step=_RUN_STEP if problem.is_rough else None,
        ftol=precision,
        xtol=min(precision, _FINEST),
        max_nfev=_EVALUATIONS * (len(start) + 1),
    )
    x = place(result.x)
    unknown = np.full((len(x), len(x)), np.nan)
    covariance = covariance_at(problem, x) if is_fine else unknown
    return Minimum(x, 2.0 * result.cost, covariance, result.status > 0)


def covariance_at(problem: Problem, x: Array) -> Array:
    """Return the covariance of what is free at a place, finite for numbers without information, too."""
    slopes = derivatives(problem, x)
    unknown = np.diag((_UNKNOWN * problem.widths) ** -2.0)
    return np.asarray(np.linalg.inv(slopes.T @ slopes + unknown), float)


def lowest(problem: Problem) -> Minimum:
    """Return the lowest of the minima near the scenario's own values and near the lowest of many other places.

    The places fill the bounds evenly, and again a part of them around the scenario's own values. The curves have kinks
    where a contact is masked or opens, so a single search may end beside the minimum.
    """
    count = _RUN_STARTS if problem.by_run else _STARTS
    minima = [minimum(problem, problem.start, _COARSE)]
    for place in problem.tried[:count]:
        with contextlib.suppress(BadInput):
            minima.append(minimum(problem, place, _COARSE))
    best = minimum(problem, min(minima, key=lambda item: item.chi_square).x)
    if problem.by_run or not len(best.x):
        return best
    for _ in range(_ROUNDS):
        minima = [minimum(problem, place, _COARSE) for place in _beside(problem, best)]
        beside = minimum(problem, min(minima, key=lambda item: item.chi_square).x)
        if not beside.chi_square < best.chi_square:
            break
        best = beside
    return best


def _beside(problem: Problem, best: Minimum) -> Array:
    """Return places around a minimum at which the sum of squares is lowest compared with a parabola.

    They lie behind kinks, where another number of contacts is masked or open.
    """
    steps = np.random.default_rng(0).standard_normal((_AROUND, len(best.x)))
    distances = np.linspace(*_DISTANCES, _AROUND)
    steps *= (distances / np.linalg.norm(steps, axis=1))[:, np.newaxis]
    places = best.x + steps @ np.linalg.cholesky(best.covariance).T
    places = np.clip(places, *np.transpose(problem.bounds))
    sums = np.array([_sum(problem, place) for place in places])
    return places[np.argsort(sums - distances**2)[:_BEHIND]]


def _sum(problem: Problem, place: Array) -> float:
    """Return the sum of squares at a place; infinity if a run refuses its values, far from those of the scenario."""
    with contextlib.suppress(BadInput):
        return float(np.sum(problem.residuals(place) ** 2))
    return math.inf


def spread(problem: Problem) -> Array:
    """Return places that fill the bounds of a problem evenly, and a part of the bounds around the start."""
    if not len(problem.start):
        return np.empty((0, 0))
    low, high = np.transpose(problem.bounds)
    count = _RUN_PLACES if problem.by_run else _PLACES
    ranges = _RUN_RANGES if problem.by_run else _RANGES
    # scipy has the name rng since 1.15 only
    sobol = qmc.Sobol(len(low), seed=np.random.default_rng(0))
    off = qmc.scale(sobol.random_base2(count), low, high) - problem.start
    return np.concatenate([problem.start + part * off for part in ranges])


def with_errors(
    problem: Problem, start: Array | None = None
) -> tuple[Problem, Minimum]:
    """Return the minimum near a start, or the lowest, and the problem with errors of the curves that came without.

    Such an error is the scatter around the fit.
    """
    for _ in range(_ROUNDS):
        best = lowest(problem) if start is None else minimum(problem, start)
        start, off = best.x, problem.values - problem.predicted(best.x)
        if not problem.estimated.any():
            break
        sigma, share = problem.sigma.copy(), problem.freedom / problem.data
        for number in np.unique(problem.curve[problem.estimated]):
            here = problem.curve == number
            scatter = math.sqrt(float(np.sum(off[here] ** 2)) / (share * here.sum()))
            sigma[here] = max(scatter, 1e-9 * float(np.abs(problem.values[here]).max()))
        problem = replace(problem, sigma=sigma)
    return problem, best


def idle(problem: Problem) -> list[str]:
    """Free keys that have no effect on the curves."""
    if not problem.free:  # as of a mechanism that has none of the keys
        return []
    sizes = np.sqrt(
        np.sum(derivatives(problem, problem.start)[:, : len(problem.free)] ** 2, axis=0)
    )
    least = _NO_EFFECT * math.sqrt(len(problem.values))
    return [
        item.key for item, size in zip(problem.free, sizes, strict=True) if size < least
    ]


def entangled(problem: Problem) -> list[list[str]]:
    """Return sets of free keys that the curves depend on only together, as on their product."""
    start, count = problem.start, len(problem.free)
    middle = np.mean(problem.bounds, axis=1)
    for share in (0.05, 0.16):  # what holds at two places is no accident of one
        columns = derivatives(problem, start + share * (middle - start))[:, :count]
        norms = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        _, sizes, rows = np.linalg.svd(columns / norms)
        nothing = (_RUN_NOTHING if problem.by_run else _NOTHING) * sizes[0]
        if not np.any(sizes < nothing):
            return []
    return [
        [
            item.key
            for item, part in zip(problem.free, row, strict=True)
            if abs(part) > 0.1
        ]
        for row in rows[sizes < nothing]
    ]


def refuse_undetermined(problem: Problem) -> None:
    """Raise ``BadInput`` if curves do not depend on a free key, or on some only together."""
    faults, split = [], any(item.table >= 0 for item in problem.free)
    for name, _, table in (key.partition(" (") for key in idle(problem)):
        option, place = (
            ("--per-table", f" in {table[:-1]}") if table else ("--free", "")
        )
        faults.append(
            f"{option} {name}: has no effect on what was measured{place}; fix it"
        )
    for keys in [] if faults else entangled(problem):
        options = "--free" + " and --per-table" * split
        faults.append(
            f"{options} {', '.join(keys)}: the curves depend on them only together; free one of them"
        )
    if faults:
        raise BadInput(faults)


def derivatives(problem: Problem, x: Array) -> Array:
    """Return the derivatives of the residuals over what is free, a column for each."""
    columns = []
    steps = (_RUN_STEP if problem.is_rough else _STEP) * problem.widths
    for k, ((low, high), step) in enumerate(zip(problem.bounds, steps, strict=True)):
        up, down = x.copy(), x.copy()
        up[k], down[k] = min(x[k] + step, high), max(x[k] - step, low)
        columns.append(
            (problem.residuals(up) - problem.residuals(down)) / (up[k] - down[k])
        )
    return np.array(columns).T


class Interval(NamedTuple):
    """Ends of an interval of 95 %, and whether the data or a bound set each."""

    low: float
    high: float
    low_open: bool
    high_open: bool


def interval(
    problem: Problem,
    best: Minimum,
    k: int,
) -> Interval:
    """Return the 95 % interval of a free number."""
    return profile(problem, best, problem.free[k], np.eye(len(best.x))[k])


def profile(
    problem: Problem,
    best: Minimum,
    item: Free,
    weights: Array,
) -> Interval:
    """Return the interval in which the sum of squares, least over all else, stays below its bound (profile likelihood).

    If values beyond an end are not rejected either, because another explanation of the data holds there, the interval
    reaches to the last of them. Such values are searched if the sum of squares is no parabola up to the end, except if
    each prediction is a run or follows a history, because that would take too long.

    Parameters
    ----------
    problem, best : Problem, Minimum
        The fit.
    item : Free
        The quantity, with its bounds.
    weights : array
        Weights of all that is free, as it is fitted, in the quantity, as it is fitted.
    """
    rise = math.sqrt(
        stats.f.ppf(LEVEL, 1, problem.freedom)
        if problem.estimated.any()
        else stats.chi2.ppf(LEVEL, 1)
    )
    (low, low_open), (high, high_open) = (
        _end(problem, best, weights, item.inner(bound), rise)
        for bound in (item.low, item.high)
    )
    return Interval(item.outer(low), item.outer(high), low_open, high_open)


class ZeroProfile(NamedTuple):
    """The least sum of squares over a zero of the instrument, and what each zero makes of the other numbers.

    Attributes
    ----------
    key : str
        Key of the zero.
    values, chi_squares : array, shape (places,)
        Zeros [SI] and the least sum of squares at each.
    numbers : array, shape (places, keys)
        Values of all free keys there [SI].
    """

    key: str
    values: Array
    chi_squares: Array
    numbers: Array


def zero_profile(
    problem: Problem, best: Minimum, k: int, span: Interval
) -> ZeroProfile:
    """Return the profile of a free zero over its interval and half of its width beyond, and at its start.

    Parameters
    ----------
    problem, best : Problem, Minimum
        The fit.
    k : int
        Place of the zero among the free numbers.
    span : Interval
        Its interval.
    """
    item, width = problem.free[k], span.high - span.low
    places = np.linspace(span.low - 0.5 * width, span.high + 0.5 * width, _PROFILED)
    places = np.clip([*places, float(best.x[k]), item.start], item.low, item.high)
    places, result = np.unique(places), dict[float, tuple[float, Array]]()
    middle = int(np.argmin(np.abs(places - best.x[k])))
    stiffness = _HELD / min(math.sqrt(best.covariance[k, k]), item.width)
    # from the minimum outwards, each search from the place before
    for order in (range(middle, len(places)), range(middle, -1, -1)):
        start = best.x.copy()
        for place in order:
            target = float(places[place])
            start[k] = target

            def spring(x: Array, target: float = target) -> float:
                return stiffness * (float(x[k]) - target)

            held = minimum(replace(problem, spring=spring), start)
            start = held.x.copy()
            result[target] = held.chi_square - spring(held.x) ** 2, start.copy()
    sums, ends = zip(*(result[float(place)] for place in places), strict=True)
    numbers = [
        [each.outer(float(x)) for each, x in zip(problem.free, end, strict=False)]
        for end in ends
    ]
    table = np.array(numbers)
    table[:, k] = places  # to which a spring has drawn it but for rounding
    return ZeroProfile(item.key, places, np.array(sums), table)


def _end(
    problem: Problem,
    best: Minimum,
    weights: Array,
    bound: float,
    rise: float,
) -> tuple[float, bool]:
    """Return the end of an interval on the side of a bound, and True if the bound itself is the end."""
    value, start = float(weights @ best.x), best.x
    spread = math.sqrt(weights @ best.covariance @ weights)
    if abs(bound - value) <= _END * spread:
        return bound, True
    for _ in range(_MOST):
        start, is_open = _walk(problem, best, weights, bound, rise, start)
        if is_open:
            return bound, True
        end = float(weights @ start)
        precision = _END * abs(end - value)
        if abs(bound - end) < precision:
            return bound, True
        # a sum of squares that is a parabola has one minimum
        of_parabola = abs(end - value) / (rise * spread)
        if problem.is_rough or 1.0 / _PARABOLIC < of_parabola < _PARABOLIC:
            break
        beyond = _beyond(problem, weights, bound, end, spread)
        further = (float(weights @ beyond.x) - end) * math.copysign(1.0, bound - value)
        is_rejected = beyond.chi_square >= best.chi_square + rise**2
        if is_rejected or further < precision:
            break
        start = beyond.x
    return end, False


def _beyond(
    problem: Problem,
    weights: Array,
    bound: float,
    end: float,
    spread: float,
) -> Minimum:
    """Return the least of the minima between an end of an interval and a bound, searched from the lowest places there.

    A spring that acts on the wrong side of the end alone keeps the searches beyond it. It is stiff over the standard
    error of the quantity, the ``spread``.
    """
    places, side = problem.tried, math.copysign(1.0, bound - end)
    values = places @ weights
    beyond = places[side * (values - end) > 0.0][:_ELSEWHERE]
    # of all other numbers those of the lowest places, at the bound
    off = (bound - values[:_ELSEWHERE]) / (weights @ weights)
    moved = places[:_ELSEWHERE] + off[:, np.newaxis] * weights
    moved = np.clip(moved, *np.transpose(problem.bounds))
    stiffness = _HELD / min(spread, abs(bound - end))

    def spring(x: Array) -> float:
        return stiffness * min(side * (float(weights @ x) - end), 0.0)

    kept = replace(problem, spring=spring)
    minima = [minimum(kept, place, _COARSE) for place in (*beyond, *moved)]
    return min(minima, key=lambda item: item.chi_square)


def _walk(
    problem: Problem,
    best: Minimum,
    weights: Array,
    bound: float,
    rise: float,
    start: Array,
) -> tuple[Array, bool]:
    """Return the place, from a start towards a bound, at which the sum of squares has risen; True if it does nowhere.

    A spring draws the quantity to an aim while all else is fitted. The sum of squares without the spring is then the
    least one for the value that the quantity has there, so that the stiffness of the spring does not matter.
    """
    value = float(weights @ best.x)
    room = abs(bound - value)
    variance = float(weights @ best.covariance @ weights)
    spread = min(math.sqrt(variance), room)
    side, near = math.copysign(1.0, bound - value), abs(float(weights @ start) - value)
    stiffness, along = _STIFFNESS / spread, weights / (weights @ weights)

    @functools.cache
    def above(distance: float) -> float:
        """Return the root of the rise of the sum of squares beyond that of the end; 0 where it is near enough."""
        nonlocal start, stiffness
        root, step = 0.0, side * distance
        for _ in range(_MOST if distance else 0):

            def spring(x: Array, stiffness: float = stiffness) -> float:
                return stiffness * (float(weights @ x) - value - step)

            drawn = replace(problem, spring=spring)
            result = minimum(drawn, start, precision=_END_SQUARES)
            if result.chi_square - best.chi_square >= rise**2:
                # a search that the spring draws may stop on its way; another one begins at the aim
                moved = start + (value + step - float(weights @ start)) * along
                moved = np.clip(moved, *np.transpose(problem.bounds))
                other = minimum(drawn, moved, precision=_END_SQUARES)
                result = min(result, other, key=lambda item: item.chi_square)
            start = result.x
            off = spring(start)
            root = math.sqrt(max(result.chi_square - off**2 - best.chi_square, 0.0))
            if root >= rise or abs(off) < _NEAR_AIM * stiffness * distance:
                break
            stiffness *= _STIFFER
        return 0.0 if abs(root / rise - 1.0) < _END else root - rise

    if near and above(near) >= 0.0:
        return start, False
    far = min(near + rise * spread, room)
    for _ in range(_MOST):
        if (excess := above(far)) >= 0.0:
            if excess > 0.0:
                optimize.brentq(above, near, far, rtol=_END, maxiter=_MOST, disp=False)
            return start, False
        if far == room:
            break
        # the root of a parabola is a line
        further = far * min(1.1 * rise / max(rise + excess, 1e-300), 3.0)
        near, far = far, min(further, room)
    return start, True


def problem_of(
    scenario: Scenario,
    tables: Sequence[Measured],
    free: list[Free],
    common: dict[str, float],
) -> Problem:
    """Return the problem of some tables; ``BadInput`` if they hold fewer numbers than are free."""
    curves = [curve for table in tables for curve in table.curves]
    names = [curve.name for curve in curves]
    has_mount = all("mount" in table.conditions for table in tables)
    known = [*dict.fromkeys(names), *[MOUNT[scenario.contact.kind][0]] * has_mount]
    for name in common.keys() - {*known}:
        raise BadInput([f"--common {name}: no such column; known: {', '.join(known)}"])
    values = np.concatenate([curve.values for curve in curves])
    if len(values) <= len(free):
        cure = "measure more, or free fewer keys"
        raise BadInput(
            [
                f"{tables[0].path}: measured numbers: {len(values)}, free keys: {len(free)}; {cure}"
            ]
        )
    number = np.repeat(np.arange(len(curves)), [len(curve.values) for curve in curves])
    sigma, unknown = list[Array](), list[bool]()
    roots = list[tuple[slice, Array]]()
    for table in tables:
        for c in table.curves:
            noise = table.noise.get(c.name) if c.errors is None else None
            size = noise.sigma if noise else 0.01 * np.abs(c.values).max()
            if noise:
                first = sum(map(len, sigma))
                law = noise.correlation(table.conditions["t"])
                root = np.asarray(np.linalg.cholesky(law), float)
                roots.append((slice(first, first + table.rows), root))
            sigma.append(np.full_like(c.values, size) if c.errors is None else c.errors)
            unknown.append(c.errors is None and not noise)
    return Problem(
        tables=tables,
        groups=[groups(scenario, table) for table in tables],
        free=free,
        common=common,
        values=values,
        sigma=np.concatenate(sigma),
        curve=number,
        estimated=np.array(unknown)[number],
        whitening=tuple(roots),
        shift=np.zeros(len(values)),
        noise=np.zeros(len(values)),
    )
