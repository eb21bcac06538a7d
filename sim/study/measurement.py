"""Measured curves: columns of CSV tables, named as variables of a dataset, with units and standard errors."""

import contextlib
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from sim.ensemble.dataset import variable_name
from sim.ensemble.variables import VARIABLES
from sim.parts.exchange import Array
from sim.quantities import QUANTITIES
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.study.noise import FEWEST, Noise, noise_of
from sim.units.errors import BadInput
from sim.units.instrument import Instrument, Reading
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
