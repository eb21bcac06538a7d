"""Conditions that hold between the parts of a scenario."""

import math
from typing import Any

import numpy as np
from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from sim.laws import jkr
from sim.parts.bonds import Auto as AutoBonds
from sim.parts.bonds import Model as BondModel
from sim.parts.contact import Contact, RateDependent
from sim.parts.contact.bodies import Adhesion, Solid, Sphere
from sim.parts.drive import Drive, Table
from sim.parts.shear import Auto, Mean, Modal, Model, Uniform
from sim.scenario.clock import Clock, Ensemble, Record

_STEPS_A_CYCLE = 2
#: Mode pairs of a cell beyond which neither time nor memory suffices: those of a grid of 2048 × 2048.
_MOST_PAIRS = 2**21
_MOST_WAVES = 1e9


def _rest_radius(solid: Solid, sphere: Sphere, adhesion: Adhesion, contact: Contact) -> float:
    work = np.array([adhesion.work])
    return float(contact.equilibrium_radius(work, sphere.radius, solid.contact_modulus)[0])


Faults = list[tuple[tuple[str, ...], str]]


def faults_across(parts: dict[str, Any]) -> Faults:
    """What does not go together between those parts that are there, each as (place, what is wrong and the cure)."""
    if isinstance(parts.get("shear"), Auto):
        record = parts.get("record")
        try:
            chosen = parts["shear"].chosen(record is not None and bool(record.maps))
        except (PydanticCustomError, ValidationError) as fault:
            text = fault.message() if isinstance(fault, PydanticCustomError) else fault.errors()[0]["msg"]
            return [(("shear",), text)]
        parts = parts | {"shear": chosen}
    if isinstance(parts.get("bonds"), AutoBonds):
        held = [parts[name] for name in ("solid", "sphere", "adhesion", "contact") if name in parts]
        radius = _rest_radius(*held) if len(held) == 4 else math.nan
        parts = parts | {"bonds": parts["bonds"].chosen(math.pi * radius**2, _reads_forces(parts.get("shear")))}
    return [
        fault
        for reads, check in _CHECKS
        if all(name in parts for name in reads)
        for fault in check(*(parts[name] for name in reads))
    ]


def _table_too_short(drive: Drive, clock: Clock) -> Faults:
    if isinstance(drive, Table) and drive.time[-1] < clock.duration * (1 - 1e-9):
        said = f"the table ends at {drive.time[-1]:g} s, before clock.duration ({clock.duration:g} s)"
        return [(("drive",), f"{said}; add rows or shorten the run")]
    return []


def _no_adhesion(contact: Contact, adhesion: Adhesion) -> Faults:
    if isinstance(contact, RateDependent) and not adhesion.work > 0.0:
        said = "a rate-dependent edge measures its drive by the work of adhesion at rest; give a work above zero"
        return [(("adhesion", "work"), said)]
    return []


def _reads_forces(shear: Any) -> bool:
    """Whether the shear part follows the forces of the single bonds."""
    return getattr(getattr(shear, "spectrum", None), "bond_made", False)


def _control_too_short(contact: Contact, clock: Clock) -> Faults:
    if contact.course.end < clock.duration * (1 - 1e-9):
        said = f"the table ends at {contact.course.end:g} s, before clock.duration ({clock.duration:g} s)"
        return [(("contact", contact.kind), f"{said}; add rows or shorten the run")]
    if clock.steps < _STEPS_A_CYCLE * contact.course.cycles:
        said = f"fewer than {_STEPS_A_CYCLE} of the {clock.steps} clock steps for a cycle"
        return [(("contact", contact.kind, "cycles"), f"{said}; make fewer cycles or shorter steps")]
    return []


def _no_stress(shear: Model, bonds: BondModel) -> Faults:
    if shear.reads_stress and not bonds.carries_stress and not _reads_forces(shear):
        said = 'amplitude model "stress" follows the stress of the bonds, which is 0 Pa; give bonds.stress'
        return [(("shear", "amplitude"), said)]
    return []


def _no_forces(shear: Model, bonds: BondModel, solid: Solid) -> Faults:
    if not _reads_forces(shear):
        return []
    if not bonds.knows_forces:
        said = 'the spectrum that bonds make needs the force of each bond; use bonds.model = "cohort" or "tracked"'
        return [(("shear", "spectrum"), said)]
    stiffest = shear.spectrum.stiffest(*solid.effective)  # type: ignore[union-attr]
    if bonds.bond_stiffness > stiffest * (1.0 + 1e-9):  # type: ignore[union-attr]
        said = f"the half-space under a bond of this footprint yields with {stiffest:.3g} N/m, in series with the bond"
        return [(("bonds", "bond_stiffness"), f"{said}: give at most that, or a larger shear.spectrum.footprint")]
    return []


def _no_maps(record: Record, shear: Model) -> Faults:
    if record.maps and not shear.draws_maps:
        return [(("record", "maps"), 'needs shear.model = "mapped"; choose it or leave the maps out')]
    return []


def _unrecorded_maps(record: Record, clock: Clock) -> Faults:
    faults: Faults = []
    between = clock.step * clock.stride
    for time in record.maps:
        ratio = time / between
        if time > clock.duration * (1 + 1e-9) or abs(ratio - round(ratio)) > 1e-9 * max(ratio, 1.0):
            said = f"{time:g} s is none of the recorded times; choose whole multiples of {between:g} s"
            faults.append((("record", "maps"), f"{said} up to {clock.duration:g} s"))
    return faults[:1]


def _too_many_map_members(record: Record, ensemble: Ensemble) -> Faults:
    if record.map_members > ensemble.members:
        said = f"is more than ensemble.members ({ensemble.members}); lower it or add members"
        return [(("record", "map_members"), said)]
    return []


def _shear_faults(shear: Model, solid: Solid, sphere: Sphere, adhesion: Adhesion, contact: Contact) -> Faults:
    """What keeps the shear part from being built on its solid and cell."""
    if isinstance(shear, Uniform | Mean):
        return []
    radius = _rest_radius(solid, sphere, adhesion, contact)
    cell = shear.cell or math.sqrt(math.pi) * radius
    if not cell > 0.0:
        return _open_at_rest(contact, sphere, adhesion)
    if shear.contact == "disc" and shear.draws_maps and not 2.0 * radius <= cell:
        said = f"the cell of {cell:g} m does not hold the contact, which is {2.0 * radius:g} m wide at rest"
        return [(("shear", "cell"), f'{said}; give shear.cell = "{2.2e6 * radius:.3g} um" or more')]
    too_many = _too_many_modes(shear, cell)
    if too_many:
        return [(("shear",), f'{too_many}; take a smaller cell, longer waves or fewer points, or model = "mean"')]
    try:
        shear.process(*solid.effective, cell)
    except PydanticCustomError as fault:
        return [(("shear",), fault.message())]
    return []


def _open_at_rest(contact: Contact, sphere: Sphere, adhesion: Adhesion) -> Faults:
    """What holds the sphere leaves no contact at rest, which the cell is sized by."""
    name = next(name for name in ("load", "indentation", "displacement") if getattr(contact, name) is not None)
    limit = f" of {jkr.pull_off_load(adhesion.work, sphere.radius):.3g} N" if name == "load" else ""
    said = f"is beyond pull-off{limit} at the start, so that there is no contact at rest to size the cell of shear by"
    return [(("contact", name), f'{said}; hold the sphere closer, or give shear.cell such as "0.2 mm"')]


def _too_many_modes(shear: Any, cell: float) -> str | None:
    """What is too large about the smallest grid that holds the spectrum, or about the one asked for."""
    ripple = shear.spectrum.wavevector
    waves = (max(map(abs, ripple)) if ripple else shear.spectrum.support[1]) * cell / (2.0 * math.pi)
    if math.isfinite(waves) and waves > _MOST_WAVES:
        return f"the cell of {cell:g} m holds {waves:.2g} of the shortest waves along a side"
    reach = waves if shear.points is None else min(waves, (shear.points - 1) // 2)
    pairs = (2.0 * reach + 1.0) * (reach + 1.0)
    kept = isinstance(shear, Modal) and (shear.draws_maps or not ripple)
    if kept and math.isfinite(reach) and pairs > _MOST_PAIRS:
        return f"the cell of {cell:g} m has {pairs:.2g} Fourier modes, of which {_MOST_PAIRS:.2g} can be kept"
    return None


_CHECKS: tuple[tuple[tuple[str, ...], Any], ...] = (
    (("drive", "clock"), _table_too_short),
    (("contact", "clock"), _control_too_short),
    (("shear", "bonds"), _no_stress),
    (("shear", "bonds", "solid"), _no_forces),
    (("contact", "adhesion"), _no_adhesion),
    (("record", "shear"), _no_maps),
    (("record", "clock"), _unrecorded_maps),
    (("record", "ensemble"), _too_many_map_members),
    (("shear", "solid", "sphere", "adhesion", "contact"), _shear_faults),
)
#: The parts that the checks read.
CHECKED = sorted({name for reads, _ in _CHECKS for name in reads})
