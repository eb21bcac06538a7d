"""Conditions that hold between the parts of a scenario."""

import inspect
import math
from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from sim.laws import jkr
from sim.parts.bonds import Cohort, Model as BondModel, Tracked
from sim.parts.contact import Contact
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import Drive, Force
from sim.parts.exchange import Setting, Times
from sim.parts.shear import Model
from sim.scenario.clock import Clock, Ensemble, Record
from sim.spectrum.families import BondMade

_STEPS_A_CYCLE = 2
#: Times between which the slip of a run is looked at.
_MOST_SLIPS = 2**16
#: Contact radius over that of the sphere above which some unit must be wrong.
_WIDEST = 10.0
_TOO_SHORT = "the table ends at {:g} s, before clock.duration ({:g} s); add rows or shorten the run"


def rest_radius(solid: Solid, sphere: Sphere, adhesion: Adhesion, contact: Contact) -> float:
    """Return the contact radius at the full work of adhesion [m]; nan without equilibrium."""
    work = np.array([adhesion.work])
    return float(contact.equilibrium_radius(work, sphere.radius, solid.contact_modulus)[0])


Faults = Iterator[tuple[tuple[str, ...], str]]


def faults_across(parts: dict[str, Any], built: bool = True) -> Faults:
    """Yield the faults between those parts that are given, each as (place, fault and cure).

    Without ``built`` the process of the shear part is not built.
    """
    if "radius" not in parts:
        held = [parts[name] for name in ("solid", "sphere", "adhesion", "contact") if name in parts]
        parts = parts | {"radius": rest_radius(*held) if len(held) == 4 else math.nan}
    parts = parts | {"built": built}
    if "shear" in parts:
        record = parts.get("record")
        try:
            chosen = parts["shear"].chosen(record is not None and bool(record.maps))
        except (PydanticCustomError, ValidationError) as fault:
            yield ("shear",), fault.message() if isinstance(fault, PydanticCustomError) else fault.errors()[0]["msg"]
            return
        parts = parts | {"shear": chosen}
    if "bonds" in parts:
        forces = "shear" in parts and parts["shear"].spectrum.bond_made
        parts = parts | {"bonds": parts["bonds"].chosen(math.pi * parts["radius"] ** 2, forces)}
    for check, reads in _CHECKS.items():
        arguments = [parts[name] for name in reads if name in parts]
        if len(arguments) == len(reads):
            yield from check(*arguments)


def _table_too_short(drive: Drive, clock: Clock) -> Faults:
    if drive.end < clock.duration * (1 - 1e-9):
        yield ("drive",), _TOO_SHORT.format(drive.end, clock.duration)


def _wider_than_the_sphere(radius: float, sphere: Sphere, contact: Contact) -> Faults:
    if radius > _WIDEST * sphere.radius:
        fault = (
            f"makes a contact of {radius:.3g} m on a sphere of {sphere.radius:.3g} m radius, for which no theory holds;"
        )
        yield ("contact", contact.kind), f"{fault} check its unit, and those of sphere, adhesion and solid"


def _reversible_under_a_drive(drive: Drive, contact: Contact) -> Faults:
    if drive.solves_motion and contact.reversible > 0.0 and drive.at_once:
        fault = "makes friction fall with the contact, which nothing delays: give drive.mass, damping or viscosity"
        yield ("contact", "reversible"), fault


def _cannot_be_driven(drive: Drive, bonds: BondModel) -> Faults:
    if not drive.solves_motion:
        return
    if not bonds.stretched:
        if drive.contact_stiffness != "rigid":
            fault = "bonds without a stretch hold interface and body together as one"
            yield ("drive", "contact_stiffness"), f'{fault}: take "rigid", or bonds with a rupture'
        if drive.at_once:
            fault = "nothing sets the speed at which bonds without a stretch slip"
            yield ("drive",), f"{fault}: give drive.damping, mass or viscosity, or bonds with a rupture"
        if not bonds.carries_stress:
            yield ("bonds", "stress"), "is 0 Pa, so that a drive would feel nothing; give the stress of the bonds"


def _off_the_map(
    shear: Model, drive: Drive, clock: Clock, contact: Contact, adhesion: Adhesion, sphere: Sphere, solid: Solid
) -> Faults:
    if not shear.passes:
        return
    if drive.solves_motion:
        fault = 'a measured map under a disc needs a slip that is known before: prescribe the speed, or give "plane"'
        yield ("shear", "contact"), fault
        return
    ends = np.linspace(0.0, clock.duration, min(clock.steps, _MOST_SLIPS) + 1)
    positions = np.cumsum(drive.pieces(ends, clock.duration).joined.integral)
    reach = min(0.0, float(positions.min())), max(0.0, float(positions.max()))
    widest = contact.largest_radius(adhesion.work, sphere.radius, solid.contact_modulus)
    faults = shear.off_the_map(reach, widest)
    yield from ((("shear", "field", *([key] if key else [])), fault) for key, fault in faults)


def _no_adhesion(contact: Contact, adhesion: Adhesion) -> Faults:
    if contact.lags and not adhesion.work > 0.0:
        fault = "a rate-dependent edge measures its drive by the work of adhesion at rest; give a work above zero"
        yield ("adhesion", "work"), fault


def _control_too_short(contact: Contact, clock: Clock) -> Faults:
    if contact.course.end < clock.duration * (1 - 1e-9):
        yield ("contact", contact.kind), _TOO_SHORT.format(contact.course.end, clock.duration)
    elif clock.steps < _STEPS_A_CYCLE * contact.course.cycles:
        fault = f"fewer than {_STEPS_A_CYCLE} of the {clock.steps} clock steps for a cycle"
        yield ("contact", contact.kind, "cycles"), f"{fault}; make fewer cycles or shorter steps"


def _no_stress(shear: Model, bonds: BondModel) -> Faults:
    if shear.reads_stress and not bonds.carries_stress and not shear.spectrum.bond_made:
        fault = 'amplitude model "stress" follows the stress of the bonds, which is 0 Pa; give bonds.stress'
        yield ("shear", "amplitude"), fault


def _no_forces(shear: Model, bonds: BondModel, solid: Solid) -> Faults:
    if not shear.spectrum.bond_made:
        return
    if not bonds.knows_forces:
        fault = 'the spectrum that bonds make needs the force of each bond; use bonds.model = "cohort" or "tracked"'
        yield ("shear", "spectrum"), fault
        return
    stiffest = cast(BondMade, shear.spectrum).stiffest(*solid.effective)
    if cast(Cohort | Tracked, bonds).bond_stiffness > stiffest * (1.0 + 1e-9):
        fault = f"the half-space under a bond of this footprint yields with {stiffest:.3g} N/m, in series with it"
        yield ("bonds", "bond_stiffness"), f"{fault}: give at most that, or a larger shear.spectrum.footprint"


def _no_maps(record: Record, shear: Model) -> Faults:
    if record.maps and not shear.draws_maps:
        yield ("record", "maps"), 'needs shear.model = "mapped"; choose it or leave the maps out'


def _unrecorded_maps(record: Record, clock: Clock) -> Faults:
    between = clock.step * clock.stride
    for time in record.maps:
        ratio = time / between
        if time > clock.duration * (1 + 1e-9) or abs(ratio - round(ratio)) > 1e-9 * max(ratio, 1.0):
            fault = f"{time:g} s is none of the recorded times; choose whole multiples of {between:g} s"
            yield ("record", "maps"), f"{fault} up to {clock.duration:g} s"
            return
    if len({round(time / between) for time in record.maps}) < len(record.maps):
        yield ("record", "maps"), "names a time twice; give each once"


def _too_many_map_members(record: Record, ensemble: Ensemble) -> Faults:
    if record.map_members > ensemble.members:
        fault = f"is more than ensemble.members ({ensemble.members}); lower it or add members"
        yield ("record", "map_members"), fault


def _shear_faults(
    shear: Model, solid: Solid, sphere: Sphere, adhesion: Adhesion, contact: Contact, radius: float, built: bool
) -> Faults:
    if not shear.side(math.sqrt(math.pi) * radius) > 0.0:
        limit = f" of {jkr.pull_off_load(adhesion.work, sphere.radius):.3g} N" if contact.kind == "load" else ""
        fault = f"is beyond pull-off{limit} at the start, so that no contact at rest gives the size of the cell"
        yield ("contact", contact.kind), f'{fault}; hold the sphere closer, or give shear.cell such as "0.2 mm"'
    elif built:
        listed = shear.faults(*solid.effective, radius)
        yield from ((("shear", key) if key else ("shear",), fault) for key, fault in listed)


#: Each check with the names of the parts that it reads.
_CHECKS: dict[Callable[..., Faults], list[str]] = {
    check: list(inspect.signature(check).parameters)
    for check in (_table_too_short, _control_too_short, _cannot_be_driven, _no_stress, _no_forces, _no_adhesion)
    + (_wider_than_the_sphere, _reversible_under_a_drive, _no_maps, _unrecorded_maps, _too_many_map_members)
    + (_shear_faults, _off_the_map)
}
#: The parts that the checks read.
CHECKED = sorted({name for reads in _CHECKS.values() for name in reads} - {"radius", "built"})

#: Rms of the fluctuations over the mean stress above which a remark is made: some 2 % of the area is reversed.
_MOST_REVERSED = 0.5
_LARGEST_STRAIN = 0.3


def remarks_between(
    bonds: BondModel, shear: Model, contact: Contact, setting: Setting, speeds: np.ndarray, varies: bool
) -> list[str]:
    """Return assumptions and limits of the parts at some ``speeds``; ``varies`` if ΔΓ differs between members."""
    remarks = []
    if varies and bonds.feeds_back and not contact.lags:
        remarks.append(
            'carried area in a contact that fluctuates has no limit of fine steps: take model = "rate_dependent"'
        )
    if contact.after_pull_off == "reattach" and bonds.stretched and not bonds.feeds_back:
        remarks.append('bonds go on sliding while the contact is open: bonds.area = "carried" starts without them')
    strength = np.broadcast_to(bonds.steady(speeds).strength, speeds.shape)
    strain = strength.max() / setting.shear_modulus
    if strain > _LARGEST_STRAIN:
        remarks.append(f"the mean stress is {strain:.2g} times the shear modulus, beyond linear elasticity")
    rms = math.sqrt(shear.spectrum.variance) * shear.amplitude.factor(speeds, strength)
    if not shear.spectrum.bond_made and np.any((rms > _MOST_REVERSED * strength) & (strength > 0.0)):
        remarks.append(
            f"the rms of the fluctuations exceeds {_MOST_REVERSED} of the mean stress: patches of reversed friction"
        )
    if varies and min(contact.course.extremes) < 0.0:
        remarks.append("under tension detachment is a first passage: take clock steps well below the correlation")
    return remarks


#: Speeds among which the largest steady stress of bonds is looked for, and that of a body above which a remark is made
#: [m/s]; times at which the force is taken.
_SPEEDS, _FAST, _INSTANTS = np.logspace(-10.0, 0.0, 51), 0.1, 1001


def remarks_on_force(drive: Drive, bonds: BondModel, area: float, times: Times) -> list[str]:
    """Return a remark if a force pulls a body without damping above the strength of a contact ``area`` [m²]."""
    body = cast(Force, drive)
    if not drive.solves_motion or body.spring or body.damping + body.viscosity > 0.0 or body.mass == 0.0:
        return []
    instants = np.linspace(0.0, times.duration, _INSTANTS)
    strength = area * float(np.max(bonds.steady(_SPEEDS).strength))
    excess = np.maximum(np.abs(body.course.at(instants, times.duration)) - strength, 0.0)
    speed = float(np.mean(excess)) * times.duration / body.mass
    if speed < _FAST:
        return []
    begin = instants[np.argmax(excess > 0.0)]
    return [
        f"from {begin:.3g} s on the force exceeds the largest steady friction, {strength:.2g} N, and nothing damps the"
        f" body: it reaches some {speed:.2g} m/s, which may take many sub-steps; give drive.damping or drive.viscosity"
    ]
