"""Measured curves: CSV tables whose columns are named as variables of a dataset, with units and errors."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.ensemble.dataset import variable_name
from sim.ensemble.variables import VARIABLES
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.units.errors import BadInput
from sim.units.quantity import Quantity
from sim.units.tables import read_measured

Array = NDArray[np.float64]

#: Column of what holds the sphere, by the key of the contact that prescribes it.
HELD = {"load": "normal_load", "indentation": "indentation", "displacement": "displacement"}
#: What is recorded of a history, or is no measured number; and what is measured of a slider that feels its friction.
_NOT_MEASURED = ("in_contact", "masked", "detachment_time", "dissipated_energy", "applied_load")
#: Sizes of the contact, which are never below 0, with their units.
_SIZES = {"contact_radius": "m", "contact_area": "m^2"}
_OF_SLIDER = ("speed", "slider_position", "spring_force")


class Curve(NamedTuple):
    """What was measured of one variable in one table [SI]; its ``errors`` are standard errors, None where unknown."""

    name: str
    values: Array
    errors: Array | None

    @property
    def described(self) -> tuple[str, str, str]:
        """Unit, long name and symbol of the variable."""
        return next((one.unit, one.long_name, one.symbol) for one in VARIABLES if one.name == self.name)


class Measured(NamedTuple):
    """One table: under which conditions which curves were measured.

    ``conditions`` holds the columns ``"t"``, ``"speed"``, ``"held"`` (load, indentation or displacement) and those of
    other keys of the scenario, by the key; rows are numbered alike in all columns. ``held`` is the key of the contact
    that holds the sphere. ``ranges`` names the range of each column, for people.
    """

    path: Path
    held: str
    conditions: dict[str, Array]
    curves: tuple[Curve, ...]
    ranges: str = ""

    @property
    def rows(self) -> int:
        return len(self.curves[0].values)


def read(path: Path, scenario: Scenario) -> Measured:
    """Read a table of measured curves.

    Parameters
    ----------
    path : Path
        CSV with a header such as ``speed [mm/s], contact_area [mm^2], contact_area_error [mm^2]``: conditions,
        variables of a dataset, and beside these their standard errors, in the same dimension or in ``[%]``.
        Conditions are ``t``, ``speed``, what holds the sphere (``normal_load``, ``indentation`` or ``displacement``),
        or numbers of the scenario by their names in a dataset, such as ``solid_shear_modulus``. Of a slider behind a
        spring or under a force the speed is no condition but a curve; ``stage_speed`` is that of a steady stage.
    scenario : Scenario
        What the curves are compared with.

    Raises
    ------
    BadInput
        With one line.
    """
    at, outcomes = _conditions(scenario), _outcomes(scenario)
    known = {**{name: quantity for name, (_, quantity) in at.items()}, **outcomes}
    found = read_measured(path, known, outcomes)
    conditions = {at[name][0]: points.values for name, points in found.items() if name in at}
    curves = tuple(Curve(name, *points) for name, points in found.items() if name not in at)
    unclear = _unclear(scenario, conditions)
    unclear = unclear or _against(conditions, curves)
    if not curves:
        unclear = 'no column was measured; name one as a variable of a dataset, such as "contact_area [mm^2]"'
    nothing = [name for name, values, errors in curves if errors is None and not np.any(values)]
    if nothing:
        unclear = (
            unclear or f"{nothing[0]} is 0 in all rows, which has no scatter of its own; give errors, or leave it out"
        )
    if unclear:
        raise BadInput([f"{path}: {unclear}"])
    extremes = ((name, points.values.min(), points.values.max(), known[name].unit) for name, points in found.items())
    ranges = ", ".join(f"{name} {low:.4g} to {high:.4g} {unit}" for name, low, high, unit in extremes)
    return Measured(path, scenario.contact.kind, conditions, curves, ranges)


def _against(conditions: dict[str, Array], curves: tuple[Curve, ...]) -> str:
    """What is wrong with the signs of forces and speeds; "" for nothing."""
    for name, values, _ in curves:
        if name in ("friction_force", "shear_stress") and np.all(values * conditions.get("speed", 1.0) < 0.0):
            return f"{name} has the sign of the speed; turn the sign of one of them"
    return ""


def _conditions(scenario: Scenario) -> dict[str, tuple[str, Quantity]]:
    """Condition and declaration by the name of a column."""
    kind = scenario.contact.kind
    units = {one.name: one.unit for one in VARIABLES}
    found = {variable_name(key): (key, quantity) for key, (quantity, _) in quantities(scenario).items()}
    if not scenario.drive.solves_motion:
        found |= dict.fromkeys(("speed", "drive_speed"), ("speed", Quantity("m/s", "sliding speed")))
    elif "drive_stage" in found:
        found["stage_speed"] = found["drive_stage"]
    held = ("held", Quantity(units[HELD[kind]], f"what holds the sphere, contact.{kind}"))
    found |= dict.fromkeys((HELD[kind], f"contact_{kind}"), held)
    return found | {"t": ("t", Quantity("s", "time since the start", at_least=0, at_most=scenario.clock.duration))}


def _outcomes(scenario: Scenario) -> dict[str, Quantity]:
    """Declaration of each variable that can be measured."""
    of_slider = _OF_SLIDER if scenario.drive.solves_motion else ()
    there = (one for one in VARIABLES if (one.part != "drive" or one.name in of_slider) and one.applies(scenario))
    sizes = {name: Quantity(unit, name, at_least=0) for name, unit in _SIZES.items()}
    return {one.name: sizes.get(one.name, Quantity(one.unit, one.long_name))
            for one in there if one.name not in _NOT_MEASURED}  # fmt: skip


def _unclear(scenario: Scenario, conditions: dict[str, Array]) -> str:
    """What a table lacks to say at which speed, or under which load, its rows were measured; "" for nothing."""
    drive, contact = scenario.drive, scenario.contact
    if "t" in conditions:
        both = [name for name in ("speed", "held") if name in conditions]
        said = "times already say the speed and the load, by the scenario; leave out t, or these columns"
        return said if both else ""
    if drive.solves_motion and not {"drive.stage", "drive.force"} & quantities(scenario).keys():
        return f'what drives the slider changes during the run (drive.model = "{drive.model}"); add a column "t [s]"'
    if "speed" not in conditions and drive.model != "steady" and not drive.solves_motion:
        said = f'the speed changes during the run (drive.model = "{drive.model}")'
        return f'{said}; add a column "speed [mm/s]", or "t [s]"'
    if "held" not in conditions and contact.changes:
        return f'contact.{contact.kind} changes during the run; add a column "{HELD[contact.kind]}", or "t [s]"'
    column = "t [s]" if drive.solves_motion else "speed [mm/s]"
    return "" if conditions else f'no column says where the points were taken; add for example "{column}"'
