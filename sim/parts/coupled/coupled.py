"""Drive and bonds inside one clock step, where the friction feeds back into the motion.

The two are solved together in sub-steps (``radau``, ``cohorts``) that depend on the member alone. The radius of an
equilibrium contact follows the bonds within them; the fluctuations ΔΓ, a ``rate_dependent`` edge and what a disc pays
of ΔΓ stay as they were at the start of the clock step.
"""

import math
from typing import NamedTuple, cast

import numpy as np

from sim.laws.reversible import mean_stress_energy
from sim.numerics.noise import Noise
from sim.parts.bonds.cohorts import Cohorts, numbers_of
from sim.parts.bonds.models import (
    Ages,
    Cohort,
    Counted,
    FirstMoment,
    Population,
    Rate,
    Steady,
    Stretches,
    Tracked,
    Unbroken,
)
from sim.parts.bonds.tracked import AGAIN, Tracks
from sim.parts.coupled import row as columns
from sim.parts.coupled.cohorts import advance_cohorts
from sim.parts.coupled.mean_field import advance_rows
from sim.parts.coupled.row import Law, Resting, Slider
from sim.parts.coupled.tracked import advance_tracks
from sim.parts.drive import FIRST, STORED, Driven, Force, Spring
from sim.parts.exchange import Array, Bonding, Flags, Motions, Mount, Parts, Sliding, Times

#: Stretch by which the motion of bonds is measured that neither force nor stretch breaks, in a run without motion [m].
_STRETCH = 1e-9
#: Columns of a row that are measured by a stretch.
_STRETCHED = [
    columns.BODY,
    columns.SHEARED,
    columns.MOMENT,
    columns.SPEED,
    columns.POSITION,
    columns.SLIP,
    columns.PATH,
    columns.BEND,
]
#: Relative difference up to which two radii are the same equilibrium, found on two ways.
_SAME = 1e-9
#: What goes through clock steps: rows, energies, work of adhesion without bonds, pieces of the drive, clock and
#: contact, units of the columns and of energies.
_Rows = tuple[Array, Array, Array, Array, Array, Array, float]
#: Numbers of slider, bonds and contact.
_Numbers = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]


class Around(NamedTuple):
    """Contact and half-space around slider and bonds during some clock steps.

    Attributes
    ----------
    radius : array
        Contact radius at their start [m], nan where it is open.
    bare : array
        Work of adhesion that is left without bonds [J/m²].
    bonded : float
        Work of adhesion of the bonds of rest [J/m²].
    reversible : float
        Share of the mean stress's energy that adhesion pays [1].
    mounts : tuple of Mount
        Mount of the sphere at the start and at the end of each step.
    stays : bool
        Whether the radius stays during a step.
    sphere_radius, modulus, poisson_ratio : float
        R [m], E* [Pa], ν [1].
    shear_modulus : float
        G [Pa] of the effective half-space.
    area : float
        Area at rest, by which forces are measured [m²].
    """

    radius: Array
    bare: Array
    bonded: float
    reversible: float
    mounts: tuple[Mount, Mount]
    stays: bool
    sphere_radius: float
    modulus: float
    poisson_ratio: float
    shear_modulus: float
    area: float


#: Bonds that are solved together with a slider; those with a stretch.
_Driven = FirstMoment | Cohort | Tracked | Unbroken | Steady | Rate | Counted
_WITH_STRETCH = FirstMoment | Cohort | Tracked


class _Units(NamedTuple):
    """Units in which a step is made: a stretch b [m], and a force over the area at rest [N].

    That of all sites at the stretch b, n κ b A0; of bonds without a stretch their strength, τ A0, b being the way on
    which it loads the spring or on which sliding renews the bonds.
    """

    stretch: float
    force: float


def _units(drive: Force | Spring, bonds: _Driven, around: Around, step: float) -> _Units:
    most = max(map(abs, drive.course.extremes))
    if not isinstance(bonds, _WITH_STRETCH):
        force = bonds.stress * around.area
        slow = drive.mass / step + drive.damping + drive.viscosity * around.area
        way = force / drive.spring if drive.spring else max(most, force) * step / slow
        return _Units(min(way, _renewing(bonds)), force)
    law, bears = bonds.law, bonds.site_density * bonds.bond_stiffness * around.area
    if law.softness > 0.0:
        stretch = 1.0 / law.softness
    elif law.limit < math.inf:
        stretch = law.limit
    else:
        stretch = most / (law.rate if drive.spring else bears * bonds.bound_at_rest) or _STRETCH
    return _Units(stretch, bears * stretch)


def _renewing(bonds: _Driven) -> float:
    """Way on which sliding renews bonds of a linear rate equation, V_c/h [m], infinite for others."""
    return bonds.critical_speed / bonds.rebinding_rate if isinstance(bonds, Rate) else math.inf


def load(parts: Parts, slider: Sliding, bonding: Bonding, around: Around, duration: float) -> Driven:
    """The slider at t = 0, with the spring loaded by what its motion takes, and the energy that is stored."""
    drive, slider = cast(Force | Spring, parts.drive), cast(Driven, slider)
    speed, radius = slider.speed, np.nan_to_num(around.radius, nan=0.0)
    area, (yields, slope) = np.pi * radius**2, drive.yields(around.shear_modulus, around.poisson_ratio)
    friction = area * bonding.stress
    sheared = friction * (yields + np.divide(slope, radius, out=np.zeros(radius.shape), where=radius > 0.0))
    first = drive.first(duration)
    pull = friction + drive.damping * speed if drive.spring else first + 0.0 * friction
    ahead, stage = (pull / drive.spring, first + 0.0 * pull) if drive.spring else (0.0 * pull, 0.0 * pull)
    energies = np.zeros(slider.energies.shape)
    stored = 0.5 * (ahead * pull + drive.mass * speed**2 + sheared * friction) + area * bonding.stored
    energies[:, STORED] = energies[:, FIRST] = stored
    loaded = {"spring_force": pull, "sheared": sheared, "stage_position": ahead, "stage_speed": stage}
    return slider._replace(**loaded, energies=energies)


def felt(parts: Parts, bonding: Bonding, speed: Array) -> Bonding:
    """The readings of bonds whose strength is their actual stress, with that of a viscous interface at speeds [m/s]."""
    viscosity = cast(Force | Spring, parts.drive).viscosity
    return bonding._replace(stress=bonding.stress + viscosity * speed, strength=np.abs(bonding.stress))


def advance(
    parts: Parts, state: tuple[Sliding, tuple[object, ...]], around: Around, times: Times, steps: range, noise: Noise
) -> tuple[Driven, Motions, tuple[object, ...], Bonding]:
    """Slider at the end of each of some clock steps, its motion, the bonds after the last and their readings at each.

    The contact is that at the start, but for its equilibrium with the bonds: ``agreed`` counts the steps that stand. So
    is the number of ``counted`` bonds, drawn anew at the end of a step with the way that the slider has gone in it.
    """
    drive, bonds = cast(Force | Spring, parts.drive), cast(_Driven, parts.bonds)
    slider, population = cast(Driven, state[0]), state[1]
    ends = times.at(np.arange(steps.start - 1.0, steps.stop))
    units = _units(drive, bonds, around, times.step)
    stretch, force = units
    radius = around.radius
    if not around.stays:  # the sub-steps go on with their own
        radius = np.where(_agree(slider.radius, radius), slider.radius, radius)
    rows = np.zeros((len(slider.speed), columns.COLUMNS))
    of_rows = {
        columns.FORCE: slider.spring_force, columns.BODY: slider.body_speed, columns.SHEARED: slider.sheared,
        columns.SPEED: slider.speed, columns.POSITION: slider.position, columns.BEND: slider.acceleration,
        columns.RADIUS: radius, columns.NEXT: slider.next_step, columns.COUNT: slider.substeps,
        columns.ENDED: slider.runaway_time,
    }  # fmt: skip
    for column, values in of_rows.items():
        rows[:, column] = values
    scales = np.ones(columns.COLUMNS)
    scales[columns.FORCE], scales[_STRETCHED], scales[columns.SQUARE] = force, stretch, stretch**2
    pieces, duration = drive.driven(ends, times.duration), ends[1:] - ends[:-1]
    scale = 1.0 / (stretch if drive.spring else force)
    given = np.stack([pieces.interval, pieces.stop - pieces.start, *(scale * np.array(pieces[3:6]))], axis=1)
    clock, energies = _clock(around, ends), slider.energies.copy()
    passed, spent = np.empty((columns.COLUMNS, len(steps), len(rows))), np.empty((len(steps), *energies.shape))
    numbers = _numbers(drive, bonds, around, units)
    bare = around.bare + np.zeros(len(rows))
    at = rows, energies, bare, given, clock, scales, stretch * force
    population, bonding = _advanced(bonds, population, around.radius, at, numbers, (passed, spent), noise)
    stage, stage_speed = np.zeros((2, *passed[0].shape))
    if drive.spring:
        whole = pieces.joined
        stage[:], stage_speed[:] = whole.integral[:, np.newaxis], whole.last[:, np.newaxis]
        stage[0] += slider.stage_position
        np.add.accumulate(stage, out=stage)
    after = Driven(
        passed[columns.POSITION], passed[columns.BODY], passed[columns.SPEED], passed[columns.FORCE],
        passed[columns.SHEARED], stage, stage_speed, passed[columns.RADIUS], passed[columns.NEXT],
        passed[columns.COUNT], passed[columns.ENDED], spent, passed[columns.BEND],
    )  # fmt: skip
    first = np.concatenate([slider.speed[np.newaxis], after.speed[:-1]])
    slid, path, spans = passed[columns.SLIP], passed[columns.PATH], duration[:, np.newaxis]
    unsteady = np.maximum(passed[columns.SQUARE] - path**2 / spans, 0.0)  # what slips at once is spread over the step
    slid = slid, path, first, after.speed, after.position, unsteady
    motions = Motions(steps.start, ends[1:, np.newaxis], spans, *slid)
    if isinstance(bonds, Counted):
        population, drawn = bonds.advance(cast(Population, state[1]), motions, around.radius, noise)
        stress = np.where(after.speed != 0.0, drawn.stress, bonding.stress)
        bonding = Bonding(drawn.fraction, stress, stress)
    return after, motions, population, felt(parts, bonding, after.speed)


def _advanced(
    bonds: _Driven,
    population: tuple[object, ...],
    radius: Array,
    at: _Rows,
    numbers: _Numbers,
    passed: tuple[Array, Array],
    noise: Noise,
) -> tuple[tuple[object, ...], Bonding]:
    """Bonds after some clock steps, which the rows ``at`` their start go through, and their readings at each.

    ``radius`` of the contact at the start [m]; ``passed``: what rows and energies come to. Bonds without a stretch have
    the sense of the sliding in place of one.
    """
    rows, stretch = at[0], float(at[5][columns.SLIP])
    if isinstance(bonds, Cohort):
        ages = cast(Ages, population)
        share, area_radius = bonds.diluted(ages.area_radius, radius)
        cohorts, sums = Cohorts(*(array.copy() for array in ages.cohorts)), np.empty((5, *passed[0].shape[1:]))
        rules = numbers_of(bonds.law, bonds.rebinding_rate, bonds.tolerance, math.inf)
        advance_cohorts(*at, numbers[0], numbers[2], *passed, share, rules, *cohorts, sums)
        return Ages(cohorts, area_radius), bonds.read(sums)
    if isinstance(bonds, Tracked):
        tracks = cast(Tracks, population)
        tracks = tracks._replace(frame=tracks.frame.copy())
        frames = np.empty((*passed[0].shape[1:], tracks.frame.shape[1]))
        lives = (*bonds.law[:3], bonds.rebinding_rate), noise.seed, np.asarray(noise.members, dtype=np.uint64)
        if advance_tracks(*at, numbers[0], numbers[2], *passed, tuple(tracks), *lives, frames):
            raise RuntimeError(AGAIN)
        return tracks, bonds.read(frames)
    if isinstance(bonds, FirstMoment):
        stretches = cast(Stretches, population)
        share, area_radius = bonds.diluted(stretches.area_radius, radius)
        rows[:, columns.BOUND], rows[:, columns.MOMENT] = stretches.bound * share, stretches.stretch * share
    else:
        before = cast(Population, population)
        share, area_radius = bonds.diluted(before.area_radius, radius)
        rows[:, columns.BOUND] = bonds.bonding(before).fraction * share
    advance_rows(*at, *numbers, *passed)
    bound, moment = passed[0][columns.BOUND], passed[0][columns.MOMENT]
    if isinstance(bonds, FirstMoment):
        return Stretches(bound[-1].copy(), moment[-1].copy(), area_radius), bonds.bonding(Stretches(bound, moment))
    stress = bonds.stress / stretch * moment
    return Population(bound[-1].copy(), np.sign(stress[-1]), area_radius), Bonding(bound, stress, stress)


def agreed(passed: Driven, radius: Array) -> int:
    """Number of clock steps up to the first that ends with another contact radius [m] than its sub-steps."""
    apart = ~np.all(_agree(passed.radius, radius), axis=1)
    return int(np.argmax(apart)) + 1 if apart[:-1].any() else len(apart)


def _agree(own: Array, radius: Array) -> Flags:
    """True where two radii of a contact differ by rounding alone, or both are those of an open one."""
    size = np.fmax(radius, 0.0)
    same: Flags = np.abs(own - size) <= _SAME * size
    return same


def _numbers(drive: Force | Spring, bonds: _Driven, around: Around, units: _Units) -> _Numbers:
    """The numbers of slider, bonds and contact, but for what holds the sphere, in their units."""
    stretch, force = units
    stiff, density = force / stretch, force / (stretch * around.area)
    yields, slope = (stiff * value for value in drive.yields(around.shear_modulus, around.poisson_ratio))
    body = drive.spring / stiff, drive.mass / stiff, drive.damping / stiff, drive.viscosity / density
    slider = Slider(*body, 0.0 if drive.spring else 1.0, yields, slope, drive.tolerance)
    if isinstance(bonds, _WITH_STRETCH):
        law, of_rest = bonds.law, bonds.bound_at_rest
        breaking = Law(law.rate, 1.0 if law.softness > 0.0 else 0.0, stretch / law.limit, bonds.rebinding_rate, 1.0)
    else:
        slows = stretch / bonds.critical_speed if isinstance(bonds, Steady) else 0.0
        binding = bonds.rebinding_rate if isinstance(bonds, Rate) else 0.0
        breaking, of_rest = Law(0.0, 0.0, stretch / _renewing(bonds), binding, 1.0, 1.0, slows), 1.0
    taken = 0.0
    if around.reversible:
        stress = density * stretch
        taken = around.reversible * float(mean_stress_energy(1.0, stress, around.modulus, around.poisson_ratio))
    held = Resting(
        float(around.stays), around.bonded / of_rest, taken, 0.0, 0.0, 0.0, 0.0, around.mounts[0].stiffness,
        1.0 / around.sphere_radius, around.modulus, around.area,
    )  # fmt: skip
    return tuple(slider), tuple(breaking), tuple(held)


def _clock(around: Around, ends: Array) -> Array:
    """Beginning of each step, load and displacement of the base there, each with its rate; shape (steps, 5)."""
    duration = ends[1:] - ends[:-1]
    clock = np.zeros((len(duration), 5))
    clock[:, 0] = ends[:-1]
    for column, (first, last) in enumerate(zip(*(mount[:2] for mount in around.mounts), strict=True)):
        clock[:, 2 * column + 1], clock[:, 2 * column + 2] = first, (last - first) / duration
    return clock
