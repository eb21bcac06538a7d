"""Drive and bonds inside clock steps, where the friction feeds back into the motion.

The two are solved together in sub-steps (``radau``, ``cohorts``, ``tracked``) that depend on the member alone. The
radius of an equilibrium contact follows the bonds within them, and the conditional mean of fluctuations ΔΓ that
remember the sliding. Other fluctuations, a ``rate_dependent`` edge and the share of ΔΓ that a disc pays stay as they
were at the start of the clock step.
"""

import functools
import math
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from sim.numerics.noise import Noise
from sim.parts.contact.balance import Bodies
from sim.parts.coupled.mechanics import COLUMNS, ROW, Inputs, Slider
from sim.parts.coupled.population import Loop, Population, from_start, population_of
from sim.parts.coupled.step_end import StepEnds
from sim.parts.drive import ENERGY, Driven, Force, Spring
from sim.parts.exchange import (
    Array,
    Bonding,
    FieldCourse,
    Flags,
    Memory,
    Motion,
    Mount,
    Parts,
    Sliding,
    Storing,
    Times,
)
from sim.units.tables import Pieces

_NAMES = ROW.names or ()
#: Fields of the state of a slider that are columns of a row.
_SHARED = [name for name in Driven._fields if name in _NAMES]
#: Columns of a row that are measured by a stretch.
_STRETCHED = [
    "body_speed",
    "sheared",
    "moment",
    "speed",
    "position",
    "slip",
    "path",
    "acceleration",
    "mean",
    "recalled",
]
#: Numbers of slider, bonds, contact and fluctuations.
_Numbers = tuple[tuple[float, ...], ...]


class StepContact(NamedTuple):
    """Contact and half-space around slider and bonds during some clock steps.

    Attributes
    ----------
    radius : array
        Contact radius at their start [m], nan where it is open.
    has_parted : array
        True if it has pulled off before.
    bare : float
        Work of adhesion without bonds and fluctuations [J/m²].
    paid : float or array
        Share of ΔΓ that adhesion pays [1].
    shear : Storing
        Fluctuations.
    bonded : float
        Work of adhesion of the bonds of rest [J/m²].
    reversible : float
        Share of the mean stress's energy that adhesion pays [1].
    mounts : tuple of Mount
        Mount of the sphere at the start and at the end of each step.
    stays : bool
        True if the radius stays during a step.
    undisturbed : bool
        True if fluctuations never change the contact.
    bodies : Bodies
        Sphere and solid.
    area : float
        Area at rest, by which forces are measured [m²].
    """

    radius: Array
    has_parted: Flags
    bare: float
    paid: float | Array
    shear: Storing
    bonded: float
    reversible: float
    mounts: tuple[Mount, Mount]
    stays: bool
    undisturbed: bool
    bodies: Bodies
    area: float


class Reached(NamedTuple):
    """Slider, bonds and field after some clock steps.

    Attributes
    ----------
    slider : Driven
        The slider at the end of each step.
    motions : Motion
        Its motion.
    population : tuple
        The bonds at the end of the last step.
    bonding : Bonding
        What others read of the bonds at the end of each step.
    field : FieldCourse
        Fluctuations as the loop has followed them.
    lost : array, shape (steps, members)
        True if a contact that follows the bonds alone lost its equilibrium within a step.
    """

    slider: Driven
    motions: Motion
    population: tuple[object, ...]
    bonding: Bonding
    field: FieldCourse
    lost: Flags


@functools.lru_cache(maxsize=16)
def _of_columns(stretch: float, force: float) -> Array:
    """Return the units of the columns of a row, from those of a stretch [m] and a force [N]."""
    scales = np.ones(COLUMNS)
    columns = scales.view(ROW)
    columns["spring_force"], columns["spread"] = force, stretch**2
    columns[_STRETCHED] = stretch
    return scales


def load(
    parts: Parts,
    slider: Sliding,
    bonding: Bonding,
    contact: StepContact,
    duration: float,
) -> Driven:
    """Return the slider at t = 0, with its spring loaded for its motion, and the stored energy."""
    drive, slider = cast(Force | Spring, parts.drive), cast(Driven, slider)
    speed, radius = slider.speed, np.fmax(contact.radius, 0.0)
    area = np.pi * radius**2
    friction = area * bonding.stress
    sheared = friction * drive.compliance(contact.bodies.solid, radius)
    first = drive.first(duration)
    pull = friction + drive.damping * speed if drive.spring else first + 0.0 * friction
    ahead, stage = (
        (pull / drive.spring, first + 0.0 * pull)
        if drive.spring
        else (0.0 * pull, 0.0 * pull)
    )
    energies = np.zeros((len(speed), 1), ENERGY)
    stored = (
        0.5 * (ahead * pull + drive.mass * speed**2 + sheared * friction)
        + area * bonding.stored
    )
    energies["stored"] = energies["first"] = stored[:, np.newaxis]
    loaded = {
        "spring_force": pull,
        "sheared": sheared,
        "stage_position": ahead,
        "stage_speed": stage,
    }
    return slider._replace(**loaded, energies=energies.view(float))


def with_contact_stress(parts: Parts, bonding: Bonding, speed: Array) -> Bonding:
    """Return bonds whose strength is their actual stress, with the viscous stress added to their stress."""
    viscosity = cast(Force | Spring, parts.drive).viscosity
    return bonding._replace(
        stress=bonding.stress + viscosity * speed, strength=np.abs(bonding.stress)
    )


def advance(
    parts: Parts,
    slider: Sliding,
    population: tuple[object, ...],
    contact: StepContact,
    times: Times,
    steps: range,
    noise: Noise,
    step_ends: StepEnds,
) -> Reached:
    """Return what slider and bonds have reached after some clock steps.

    The contact is in equilibrium with the bonds within the steps, and at their ends with the fluctuations there, if
    ``step_ends`` follow it; else it is that at the start. ``counted`` bonds stay as they were at the start of a step:
    they are drawn at its end, with the slip in it.
    """
    drive, slider = cast(Force | Spring, parts.drive), cast(Driven, slider)
    bonds, members = population_of(parts), len(slider.speed)
    ends = times.at(np.arange(steps.start - 1.0, steps.stop))
    units = bonds.units(drive, contact.area, times.step)
    stretch, force = units
    pieces, law = drive.driven(ends, times.duration), parts.shear.field_law
    # others hold a contact that is rigid
    answers = bool(bonds.bonds.stretched and contact.shear.expected.size)
    is_pulled, begins = bool(drive.spring), steps.start == 1
    rows = _rows_at_start(slider, contact, begins, is_pulled, answers)
    if law.length < math.inf:
        for name, values in contact.shear.past._asdict().items():
            rows[name] = values if values.size else law.energy
        law = law._replace(length=law.length / stretch, by_slip=law.by_slip * stretch)
    draws = step_ends.draws
    draws = draws._replace(answers=draws.answers and answers)
    course = _course(pieces, 1.0 / (stretch if drive.spring else force))
    inputs = Inputs(
        rows.view(float).reshape(members, COLUMNS),
        slider.energies.copy(),
        course,
        _clock(contact, ends),
        _of_columns(*units),
        stretch * force,
    )
    columns, energies = (
        np.empty((COLUMNS, len(steps), members)),
        np.empty((len(steps), *slider.energies.shape)),
    )
    numbers = *_numbers(drive, bonds, contact, units), tuple(law)
    reached = dict(zip(_NAMES, columns, strict=True))
    arguments = (
        tuple(inputs),
        numbers,
        (columns, energies),
        (tuple(draws), *step_ends[1:]),
    )
    end, bonding = bonds.advance(
        population, contact.radius, Loop(inputs, arguments, reached), noise
    )
    if bonds.bonds.feeds_back:
        bonding = bonding.carried(contact.radius)
    stage = stage_speed = np.zeros((len(steps), members))
    if drive.spring:
        stage, stage_speed = _stage(slider, pieces)
    shared = {name: reached[name] for name in _SHARED}
    after = Driven(
        **shared, stage_position=stage, stage_speed=stage_speed, energies=energies
    )
    field = FieldCourse(draws=draws)
    if law.length < math.inf:
        field = FieldCourse(Memory(*(reached[name] for name in Memory._fields)), draws)
    first = np.concatenate([slider.speed[np.newaxis], after.speed[:-1]])
    duration = (ends[1:] - ends[:-1])[:, np.newaxis]
    way = duration, reached["slip"], reached["path"], first, after.speed
    motions = Motion(steps.start, ends[1:, np.newaxis], *way, position=after.position)
    at_ends = step_ends.radius if step_ends.follows else after.radius
    radii = np.fmax(from_start(contact.radius, at_ends), 0.0)
    stick_ends = bonds.stick_ends(
        drive, (slider, after), motions, (population, bonding), radii
    )
    motions = motions._replace(stick_ends=stick_ends)
    end, bonding = bonds.drawn(
        drive, population, (end, bonding), motions, contact.radius, noise
    )
    viscous = drive.viscosity * after.speed
    bonding = bonding._replace(stress=bonding.stress + viscous)
    lost = (reached["lost"] > 0.0) & contact.undisturbed
    return Reached(after, motions, end, bonding, field, lost)


def _rows_at_start(
    slider: Driven, contact: StepContact, begins: bool, is_pulled: bool, answers: bool
) -> NDArray[np.void]:
    """Return the rows from which sliders go on; ``begins``: at t = 0, where a force acts at once.

    A slider ``is_pulled`` by a spring, which takes it along. If it ``answers`` to what was drawn, it feels the mean of
    the field until then.
    """
    rows = np.zeros(len(slider.speed), ROW)
    for name in _SHARED:
        rows[name] = getattr(slider, name)
    if begins and not is_pulled:
        rows["spring_force"] = 0.0
    rows["radius"], rows["parted"] = contact.radius, contact.has_parted
    rows["closed"] = (slider.radius == 0.0) & (contact.radius > 0.0) & (not begins)
    shear = contact.shear
    rows["paid"], rows["drawn"] = contact.paid, contact.paid * shear.energy
    rows["felt"] = contact.paid * (shear.expected if answers else shear.energy)
    return rows


def _course(pieces: Pieces, scale: float) -> Array:
    """Return the pieces of what is prescribed, a row each: interval, duration, and values times a scale."""
    values = (scale * piece for piece in pieces[3:6])
    return np.stack([pieces.interval, pieces.stop - pieces.start, *values], axis=1)


def _stage(slider: Driven, pieces: Pieces) -> tuple[Array, Array]:
    """Return the positions [m] and speeds [m/s] of the stages at the end of each clock step."""
    whole, members = pieces.joined, len(slider.speed)
    moved, speed = (
        np.repeat(values[:, np.newaxis], members, axis=1)
        for values in (whole.integral, whole.last)
    )
    moved[0] += slider.stage_position
    return np.add.accumulate(moved), speed


def with_contact(
    parts: Parts, reached: Reached, contact: StepContact, radius: Array
) -> tuple[Driven, Bonding]:
    """Return slider and bonds at the end of each clock step in the contact of a ``radius`` [m] that is found there.

    In the sub-steps the contact was that of the step. A contact that has closed, or that was lost in the step and has
    an equilibrium again, bears the pull or its shear displacement, by the population of the bonds. The slider answers
    at the start of the next step.
    """
    drive, area = cast(Force | Spring, parts.drive), np.pi * np.fmax(radius, 0.0) ** 2
    sliders, bonding, population = (
        reached.slider,
        reached.bonding,
        population_of(parts),
    )
    closes = (area > 0.0) & ((sliders.radius == 0.0) | reached.lost)
    if closes.any():
        compliance = drive.compliance(contact.bodies.solid, radius)
        elastic = None
        if sum(drive.yields(contact.bodies.solid)) > 0.0:
            elastic = sliders.sheared / np.where(area > 0.0, compliance, 1.0)
        force = population.closing_force(
            drive, sliders, area * bonding.stress, area, elastic
        )
        stress = np.divide(
            force, area, out=bonding.stress + np.zeros(area.shape), where=closes
        )
        bonding = bonding._replace(stress=stress)
    return population.with_draw(drive, sliders, bonding, area)


def _numbers(
    drive: Force | Spring,
    bonds: Population,
    contact: StepContact,
    units: tuple[float, float],
) -> _Numbers:
    """Return the numbers of slider, bonds and contact in their units, without load and base of the mount."""
    stretch, force = units
    stiff, density = force / stretch, force / (stretch * contact.area)
    bodies = contact.bodies
    yields, slope = (stiff * value for value in drive.yields(bodies.solid))
    body = (
        drive.spring / stiff,
        drive.mass / stiff,
        drive.damping / stiff,
        drive.viscosity / density,
    )
    slider = Slider(
        0.0,
        0.0,
        0.0,
        0.0,
        *body,
        0.0 if drive.spring else 1.0,
        yields,
        slope,
        bodies.solid.inverse_thickness,
        drive.tolerance,
    )
    breaking = bonds.law(stretch)
    mean_stress = 0.0
    if contact.reversible:
        mean_stress = contact.reversible * float(
            bodies.solid.half_space.mean_stress_energy(1.0, density * stretch)
        )
    still = (
        contact.bare,
        0.0,
        0.0,
        0.0,
        0.0,
        float(contact.stays),
        contact.bonded / bonds.bound_at_rest,
        mean_stress,
    )
    solid = (
        contact.mounts[0].stiffness,
        *bodies.body,
        contact.area,
    )
    return tuple(slider), tuple(breaking), (*still, *solid)


def _clock(contact: StepContact, ends: Array) -> Array:
    """Return the beginning of each step, its load and base, each with its rate, and its length; shape (steps, 6)."""
    duration = ends[1:] - ends[:-1]
    (load, base, _), last = contact.mounts
    clock = np.empty((len(duration), 6))
    clock[:, 0], clock[:, 1], clock[:, 3], clock[:, 5] = ends[:-1], load, base, duration
    clock[:, 2], clock[:, 4] = (
        (last.load - load) / duration,
        (last.base - base) / duration,
    )
    return clock
