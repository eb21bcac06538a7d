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

from sim.laws.reversible import mean_stress_energy
from sim.numerics.noise import Noise
from sim.parts.bonds import models
from sim.parts.bonds.cohorts import Cohorts, numbers_of
from sim.parts.bonds.tracked import AGAIN, Tracks
from sim.parts.contact.balance import Bodies
from sim.parts.coupled.cohorts import advance_cohorts
from sim.parts.coupled.mean_field import advance_rows
from sim.parts.coupled.mechanics import COLUMNS, ROW, Inputs, Law, Slider
from sim.parts.coupled.step_end import StepEnds
from sim.parts.coupled.tracked import advance_tracks
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
    StickEnds,
    Storing,
    Times,
)

#: Stretch by which the motion of bonds is measured that neither force nor stretch breaks, in a run without motion [m].
_STRETCH = 1e-9
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
        R [m], E* [Pa], ν [1].
    shear_modulus : float
        G [Pa] of the effective half-space.
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
    shear_modulus: float
    area: float


class Reached(NamedTuple):
    """What slider and bonds have reached after some clock steps.

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


#: Bonds that are solved together with a slider; of them those with a stretch first.
_WITH_STRETCH = models.FirstMoment | models.Cohort | models.Tracked
_SolvedBonds = (
    _WITH_STRETCH | models.Unbroken | models.Steady | models.Rate | models.Counted
)


def _units(
    drive: Force | Spring, bonds: _SolvedBonds, contact: StepContact, step: float
) -> tuple[float, float]:
    """Return the units in which a step is computed: a stretch b [m], and a force over the area at rest [N].

    The force is that of all sites at the stretch b, n κ b A0. In models without stretch it is their strength, τ A0.
    Then b is the displacement at which the strength loads the spring, or at which sliding renews the bonds.
    """
    most = max(map(abs, drive.course.extremes))
    if not isinstance(bonds, _WITH_STRETCH):
        force = bonds.stress * contact.area
        slow = drive.mass / step + drive.damping + drive.viscosity * contact.area
        shift = force / drive.spring if drive.spring else max(most, force) * step / slow
        return min(shift, _renewing(bonds)), force
    law, bears = bonds.law, bonds.site_density * bonds.bond_stiffness * contact.area
    if law.softness > 0.0:
        stretch = 1.0 / law.softness
    elif law.limit < math.inf:
        stretch = law.limit
    else:
        stretch = (
            most / (law.rate if drive.spring else bears * bonds.bound_at_rest)
            or _STRETCH
        )
    return stretch, bears * stretch


@functools.lru_cache(maxsize=16)
def _of_columns(stretch: float, force: float) -> Array:
    """Return the units of the columns of a row, from those of a stretch [m] and a force [N]."""
    scales = np.ones(COLUMNS)
    columns = scales.view(ROW)
    columns["spring_force"], columns["spread"] = force, stretch**2
    columns[_STRETCHED] = stretch
    return scales


def _renewing(bonds: _SolvedBonds) -> float:
    """Return the displacement on which sliding renews bonds of the rate equation, V_c/h [m], infinite for others."""
    return (
        bonds.critical_speed / bonds.rebinding_rate
        if isinstance(bonds, models.Rate)
        else math.inf
    )


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
    area, (yields, slope) = (
        np.pi * radius**2,
        drive.yields(contact.shear_modulus, contact.bodies.poisson_ratio),
    )
    friction = area * bonding.stress
    sheared = friction * (
        yields
        + np.divide(slope, radius, out=np.zeros(radius.shape), where=radius > 0.0)
    )
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
    drive, bonds, slider = (
        cast(Force | Spring, parts.drive),
        cast(_SolvedBonds, parts.bonds),
        cast(Driven, slider),
    )
    ends, members = (
        times.at(np.arange(steps.start - 1.0, steps.stop)),
        len(slider.speed),
    )
    units = _units(drive, bonds, contact, times.step)
    stretch, force = units
    rows = np.zeros(members, ROW)
    for name in _SHARED:
        rows[name] = getattr(slider, name)
    if steps.start == 1 and not drive.spring:  # a force acts at once
        rows["spring_force"] = 0.0
    rows["radius"], rows["parted"] = contact.radius, contact.has_parted
    rows["closed"] = (slider.radius == 0.0) & (contact.radius > 0.0) & (steps.start > 1)
    pieces, duration = drive.driven(ends, times.duration), ends[1:] - ends[:-1]
    scale = 1.0 / (stretch if drive.spring else force)
    course = np.stack(
        [
            pieces.interval,
            pieces.stop - pieces.start,
            *(scale * piece for piece in pieces[3:6]),
        ],
        axis=1,
    )
    law, shear = parts.shear.field_law, contact.shear
    rows["paid"], rows["drawn"] = contact.paid, contact.paid * shear.energy
    # others hold a contact that is rigid
    answers = isinstance(bonds, _WITH_STRETCH) and shear.expected.size
    rows["felt"] = contact.paid * (shear.expected if answers else shear.energy)
    if law.length < math.inf:
        for name, values in shear.past._asdict().items():
            rows[name] = values if values.size else law.energy
        law = law._replace(length=law.length / stretch, by_slip=law.by_slip * stretch)
    draws = step_ends.draws
    draws = draws._replace(answers=draws.answers and bool(answers))
    state = rows.view(float).reshape(members, COLUMNS)
    clock, work = _clock(contact, ends), stretch * force
    inputs = Inputs(
        state, slider.energies.copy(), course, clock, _of_columns(*units), work
    )
    columns, energies = (
        np.empty((COLUMNS, len(steps), members)),
        np.empty((len(steps), *slider.energies.shape)),
    )
    numbers = *_numbers(drive, bonds, contact, units), tuple(law)
    reached = dict(zip(_NAMES, columns, strict=True))
    loop = (
        tuple(inputs),
        numbers,
        (columns, energies),
        (tuple(draws), *step_ends[1:]),
    )
    end, bonding = _advanced(
        bonds, population, contact.radius, inputs, loop, reached, noise
    )
    stage, stage_speed = np.zeros((2, len(steps), members))
    if drive.spring:
        whole = pieces.joined
        stage[:], stage_speed[:] = (
            whole.integral[:, np.newaxis],
            whole.last[:, np.newaxis],
        )
        stage[0] += slider.stage_position
        np.add.accumulate(stage, out=stage)
    shared = {name: reached[name] for name in _SHARED}
    after = Driven(
        **shared, stage_position=stage, stage_speed=stage_speed, energies=energies
    )
    first = np.concatenate([slider.speed[np.newaxis], after.speed[:-1]])
    way = duration[:, np.newaxis], reached["slip"], reached["path"], first, after.speed
    field = FieldCourse(draws=draws)
    if law.length < math.inf:
        field = FieldCourse(Memory(*(reached[name] for name in Memory._fields)), draws)
    motions = Motion(
        steps.start,
        ends[1:, np.newaxis],
        *way,
        position=after.position,
    )
    lost = (reached["lost"] > 0.0) & contact.undisturbed
    if not isinstance(bonds, _WITH_STRETCH):
        plain = cast(models.Population, population)
        start = (
            bonds.bonding(plain).fraction
            * bonds.diluted(plain.area_radius, contact.radius)[0]
        )
        fractions = _from_start(start, bonding.fraction)
        at_ends = step_ends.radius if step_ends.follows else after.radius
        radii = np.fmax(_from_start(contact.radius, at_ends), 0.0)
        motions = motions._replace(
            stick_ends=_stick_ends(
                drive, bonds, (slider, after), motions, fractions, radii
            )
        )
    if isinstance(bonds, models.Counted):
        end, drawn = bonds.advance(
            cast(models.Population, population), motions, contact.radius, noise
        )
        strength = np.where(after.speed != 0.0, drawn.strength, np.abs(bonding.stress))
        stress = (
            bonding.stress
            if drive.mass == 0.0
            else np.where(after.speed != 0.0, drawn.stress, bonding.stress)
        )
        bonding = with_contact_stress(
            parts, Bonding(drawn.fraction, stress, strength), after.speed
        )
        bonding = bonding._replace(strength=strength)
        return Reached(after, motions, end, bonding, field, lost)
    bonding = with_contact_stress(parts, bonding, after.speed)
    return Reached(after, motions, end, bonding, field, lost)


def _from_start(start: Array, ends: Array) -> Array:
    """Return values at the start of each of some clock steps, from those at the start of the first and at each end."""
    values = np.empty_like(ends)
    values[0], values[1:] = start, ends[:-1]
    return values


def _stick_ends(
    drive: Force | Spring,
    bonds: models.Unbroken | models.Steady | models.Rate | models.Counted,
    sliders: tuple[Driven, Driven],
    motions: Motion,
    fractions: Array,
    radii: Array,
) -> StickEnds:
    """Return the ends of stick phases in some clock steps of a slider on bonds without a stretch.

    ``sliders`` are that at the start of the first step and that at the end of each, ``fractions`` and ``radii`` [m]
    those of bonds and contact at the start of each step. Pull and strength are taken as linear in time to find the end
    of the stick phase. An error of that time makes a small error of the stress, because the strength grows slowly. The
    stress is the strength of the bonds at that time, so that it never exceeds that of all bonds.
    """
    before, after = sliders
    rate = bonds.rebinding_rate if isinstance(bonds, models.Rate) else 0.0
    free, area, sense = (
        bonds.stress * (1.0 - fractions),
        np.pi * radii**2,
        np.sign(motions.slip),
    )
    forces = _from_start(before.spring_force, after.spring_force)
    growth = after.spring_force - forces
    if drive.spring:
        growth = drive.spring * (
            after.stage_position
            - _from_start(before.stage_position, after.stage_position)
        )
    lacking = area * bonds.stress * fractions - sense * forces
    gaining = sense * growth + area * free * np.expm1(-rate * motions.duration)
    share = np.divide(
        lacking,
        gaining,
        out=np.zeros(area.shape),
        where=(lacking > 0.0) & (gaining > 0.0),
    )
    time = np.minimum(share, 1.0) * motions.duration
    stress = bonds.stress * fractions - free * np.expm1(-rate * time)
    ends = (motions.first == 0.0) & (motions.path > 0.0) & (area > 0.0)
    return StickEnds(
        np.where(ends, stress, np.nan), np.where(ends, motions.duration - time, np.nan)
    )


def with_contact(
    parts: Parts, reached: Reached, contact: StepContact, radius: Array
) -> tuple[Driven, Bonding]:
    """Return slider and bonds at the end of each clock step in the contact of a ``radius`` [m] that is found there.

    In the sub-steps the contact was that of the step, and ``counted`` bonds had not been drawn. The slider answers at
    the start of the next step. A force that nothing can bear in the meantime is no friction:

    - A contact that has closed, or that was lost in the step and has an equilibrium again, bears the pull if the slider
      has neither mass nor damping, else that of its shear displacement. Bonds without a stretch bear the pull less the
      damping of a slider without mass. If a stiff contact has closed on another body that is delayed, the body bears
      the stress of the bonds; those with a stretch are unstretched.
    - A slider without mass on ``counted`` bonds bears the pull less the damping until the draw, whatever the draw adds
      to the area. After it the slider sticks if the bonds have become stronger than the pull. If they are weaker, its
      speed is that of the new balance.
    """
    drive, area = cast(Force | Spring, parts.drive), np.pi * np.fmax(radius, 0.0) ** 2
    sliders, bonding = reached.slider, reached.bonding
    closes = (area > 0.0) & ((sliders.radius == 0.0) | reached.lost)
    if closes.any():
        yields, slope = drive.yields(
            contact.shear_modulus, contact.bodies.poisson_ratio
        )
        force, is_stretched = (
            area * bonding.stress,
            isinstance(parts.bonds, _WITH_STRETCH),
        )
        if drive.mass == 0.0 and (drive.damping == 0.0 or not is_stretched):
            force = sliders.spring_force - drive.damping * sliders.speed
        elif yields + slope > 0.0:
            force = sliders.sheared / (yields + slope / radius)
        elif is_stretched:
            force = np.where(
                sliders.radius > 0.0, force, area * drive.viscosity * sliders.speed
            )
        stress = np.divide(
            force, area, out=bonding.stress + np.zeros(area.shape), where=closes
        )
        bonding = bonding._replace(stress=stress)
    if isinstance(parts.bonds, models.Counted) and drive.mass == 0.0:
        pull, sense = sliders.spring_force, np.sign(sliders.speed)
        grows = area > np.pi * sliders.radius**2
        friction = pull - drive.damping * sliders.speed
        bonding = bonding._replace(
            stress=np.divide(friction, area, out=bonding.stress.copy(), where=grows)
        )
        excess = np.maximum(
            sense * pull - area * parts.bonds.stress * bonding.fraction, 0.0
        )
        drag = drive.damping + drive.viscosity * area
        speed = np.divide(
            sense * excess,
            drag,
            out=np.where(excess > 0.0, sliders.speed, 0.0),
            where=drag > 0.0,
        )
        sliders = sliders._replace(speed=speed, body_speed=speed)
    return sliders, bonding


def _advanced(
    bonds: _SolvedBonds,
    population: tuple[object, ...],
    radius: Array,
    inputs: Inputs,
    loop: tuple[tuple, ...],
    reached: dict[str, Array],
    noise: Noise,
) -> tuple[tuple[object, ...], Bonding]:
    """Return the bonds after some clock steps and their readings at each.

    ``radius`` of the contact at the start [m]. ``loop``: arguments of
    ``advance_rows``, of which the outputs receive the rows and energies at the end of each step. ``reached`` has their
    columns by name. Bonds without a stretch have the sense of the sliding in its place.
    """
    shape, rows = loop[2][0].shape[1:], inputs.rows.view(ROW)[:, 0]
    if isinstance(bonds, models.Cohort):
        ages = cast(models.Ages, population)
        share, area_radius = bonds.diluted(ages.area_radius, radius)
        cohorts, sums = (
            Cohorts(*(array.copy() for array in ages.cohorts)),
            np.empty((5, *shape)),
        )
        rules = numbers_of(bonds.law, bonds.rebinding_rate, bonds.tolerance)
        advance_cohorts(*loop, share, rules, *cohorts, sums)
        return models.Ages(cohorts, area_radius), bonds.read(sums)
    if isinstance(bonds, models.Tracked):
        tracks = cast(Tracks, population)
        tracks = tracks._replace(frame=tracks.frame.copy())
        frames = np.empty((*shape, tracks.frame.shape[1]))
        lives = (
            (*bonds.law[:3], bonds.rebinding_rate),
            noise.seed,
            np.asarray(noise.members, dtype=np.uint64),
        )
        if advance_tracks(*loop, tuple(tracks), *lives, frames):
            raise RuntimeError(AGAIN)
        return tracks, bonds.read(frames)
    if isinstance(bonds, models.FirstMoment):
        stretches = cast(models.Stretches, population)
        share, area_radius = bonds.diluted(stretches.area_radius, radius)
        rows["bound"], rows["moment"] = (
            stretches.bound * share,
            stretches.stretch * share,
        )
    else:
        before = cast(models.Population, population)
        share, area_radius = bonds.diluted(before.area_radius, radius)
        rows["bound"] = bonds.bonding(before).fraction * share
    advance_rows(*loop)
    bound, moment = reached["bound"], reached["moment"]
    if isinstance(bonds, models.FirstMoment):
        end = models.Stretches(bound[-1].copy(), moment[-1].copy(), area_radius)
        return end, bonds.bonding(models.Stretches(bound, moment))
    stretch = float(inputs.units.view(ROW)["slip"][0])
    stress = bonds.stress / stretch * moment
    return models.Population(
        bound[-1].copy(), np.sign(stress[-1]), area_radius
    ), Bonding(bound, stress, stress)


def _numbers(
    drive: Force | Spring,
    bonds: _SolvedBonds,
    contact: StepContact,
    units: tuple[float, float],
) -> _Numbers:
    """Return the numbers of slider, bonds and contact in their units, without load and base of the mount."""
    stretch, force = units
    stiff, density = force / stretch, force / (stretch * contact.area)
    bodies = contact.bodies
    yields, slope = (
        stiff * value
        for value in drive.yields(contact.shear_modulus, bodies.poisson_ratio)
    )
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
        drive.tolerance,
    )
    if isinstance(bonds, _WITH_STRETCH):
        law, of_rest = bonds.law, bonds.bound_at_rest
        breaking = Law(
            law.rate,
            1.0 if law.softness > 0.0 else 0.0,
            stretch / law.limit,
            bonds.rebinding_rate,
            1.0,
        )
    else:
        slows = (
            stretch / bonds.critical_speed if isinstance(bonds, models.Steady) else 0.0
        )
        binding = bonds.rebinding_rate if isinstance(bonds, models.Rate) else 0.0
        breaking, of_rest = (
            Law(0.0, 0.0, stretch / _renewing(bonds), binding, 1.0, 1.0, slows),
            1.0,
        )
    mean_stress = 0.0
    if contact.reversible:
        mean_stress = contact.reversible * float(
            mean_stress_energy(1.0, density * stretch, *bodies[1:])
        )
    still = (
        contact.bare,
        0.0,
        0.0,
        0.0,
        0.0,
        float(contact.stays),
        contact.bonded / of_rest,
        mean_stress,
    )
    solid = (
        contact.mounts[0].stiffness,
        1.0 / bodies.sphere_radius,
        bodies.modulus,
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
