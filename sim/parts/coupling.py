"""Drive and bonds inside one clock step, where the friction feeds back into the motion.

The two are solved together in sub-steps (``sim.parts.coupling_step``) that depend on the member alone. The radius of an
equilibrium contact follows the bonds within them; the fluctuations ΔΓ, a ``rate_dependent`` edge and what a disc pays
of ΔΓ stay as they were at the start of the clock step.
"""

import math
from typing import NamedTuple, cast

import numpy as np

from sim.laws.reversible import mean_stress_energy
from sim.parts import coupling_equations as columns
from sim.parts.bonds.stretched import FirstMoment, Stretches
from sim.parts.bonds.two_state import Population, Steady, Unbroken
from sim.parts.coupling_equations import Law, Resting, Slider
from sim.parts.coupling_rows import advance_rows
from sim.parts.drive.driven import FIRST, STORED, Driven, Force, Spring
from sim.parts.exchange import Array, Bonding, Motions, Parts, Sliding, Times

#: Stretch by which the motion of bonds is measured that neither force nor stretch breaks, in a run without motion [m].
_STRETCH = 1e-9


class Held(NamedTuple):
    """What holds the sphere: load [N], displacement of the base [m], stiffness behind it [N/m]; 0 what does not."""

    load: float
    base: float
    stiffness: float


class Around(NamedTuple):
    """Contact and half-space around slider and bonds during a clock step.

    Attributes
    ----------
    radius : array
        Contact radius at its start [m], nan where it is open.
    bare : array
        Work of adhesion that is left without bonds [J/m²].
    bonded : float
        Work of adhesion of the bonds of rest [J/m²].
    reversible : float
        Share of the mean stress's energy that adhesion pays [1].
    held : tuple of Held
        What holds the sphere at start and end of the step.
    stays : bool
        Whether the radius stays during the step.
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
    held: tuple[Held, Held]
    stays: bool
    sphere_radius: float
    modulus: float
    poisson_ratio: float
    shear_modulus: float
    area: float


class _Units(NamedTuple):
    """Units in which a step is made: a stretch b [m], and a force over the area at rest [N].

    That of all sites at the stretch b, n κ b A0; of bonds without a stretch their strength, τ A0.
    """

    stretch: float
    force: float


def _units(drive: Force | Spring, bonds: FirstMoment | Unbroken | Steady, around: Around, step: float) -> _Units:
    most = max(map(abs, drive.course.extremes))
    if not isinstance(bonds, FirstMoment):
        force = bonds.stress * around.area
        if drive.spring:
            return _Units(force / drive.spring, force)
        slow = drive.mass / step + drive.damping + drive.viscosity * around.area
        return _Units(max(most, force) * step / slow, force)
    law, bears = bonds.law, bonds.site_density * bonds.bond_stiffness * around.area
    if law.softness > 0.0:
        stretch = 1.0 / law.softness
    elif law.limit < math.inf:
        stretch = law.limit
    else:
        stretch = most / (law.rate if drive.spring else bears * bonds.bound_at_rest) or _STRETCH
    return _Units(stretch, bears * stretch)


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
    parts: Parts, state: tuple[Sliding, tuple[object, ...]], around: Around, times: Times, step: int
) -> tuple[Sliding, Motions, tuple[object, ...], Bonding]:
    """Slider, its motion, bonds and their readings after a clock step, from the slider and the bonds before it."""
    drive, bonds = cast(Force | Spring, parts.drive), cast(FirstMoment | Unbroken | Steady, parts.bonds)
    slider, population = cast(Driven, state[0]), state[1]
    begin, end = times.at(step - 1.0), times.at(float(step))
    units = _units(drive, bonds, around, end - begin)
    stretch, force = units
    bound, moment, seen = _population(bonds, population, slider, around, stretch)
    rows = np.zeros((len(slider.speed), columns.COLUMNS))
    of_rows = {
        columns.FORCE: slider.spring_force / force, columns.BODY: slider.body_speed / stretch,
        columns.SHEARED: slider.sheared / stretch, columns.BOUND: bound, columns.MOMENT: moment / stretch,
        columns.SPEED: slider.speed / stretch,
        columns.RADIUS: around.radius, columns.NEXT: slider.next_step, columns.ENDED: slider.runaway_time,
    }  # fmt: skip
    for column, values in of_rows.items():
        rows[:, column] = values
    energies = np.zeros(slider.energies.shape)
    energies[:, STORED] = slider.energies[:, STORED] / (stretch * force)
    pieces = drive.driven(np.array([begin, end]), times.duration)
    scale = 1.0 / (stretch if drive.spring else force)
    given = np.stack([pieces.stop - pieces.start, *(scale * np.array(pieces[3:6]))], axis=1)
    bare = around.bare + np.zeros(len(rows))
    advance_rows(rows, energies, bare, given, begin, *_numbers(drive, bonds, around, units, end - begin))
    gained = energies * (stretch * force)
    gained[:, :STORED] += slider.energies[:, :STORED]
    gained[:, FIRST] = slider.energies[:, FIRST]
    stage = (pieces.integral.sum(), pieces.last[-1]) if drive.spring else (0.0, 0.0)
    speed = rows[:, columns.SPEED] * stretch
    after = Driven(
        slider.position + rows[:, columns.POSITION] * stretch, rows[:, columns.BODY] * stretch, speed,
        rows[:, columns.FORCE] * force, rows[:, columns.SHEARED] * stretch, slider.stage_position + stage[0],
        stage[1] + 0.0 * speed, rows[:, columns.NEXT], slider.substeps + rows[:, columns.COUNT], rows[:, columns.ENDED],
        gained,
    )  # fmt: skip
    bound, moment = rows[:, columns.BOUND].copy(), rows[:, columns.MOMENT] * stretch
    time, duration = np.full((1, 1), end), np.full((1, 1), end - begin)
    slid = rows[:, columns.SLIP] * stretch, rows[:, columns.PATH] * stretch, slider.speed, speed, after.position
    motions = Motions(step, time, duration, *(values[np.newaxis] for values in slid))
    if isinstance(bonds, FirstMoment):
        bonding = bonds.bonding(Stretches(bound[np.newaxis], moment[np.newaxis]))
        return after, motions, Stretches(bound, moment, seen), felt(parts, bonding, speed)
    stress = bonds.stress / stretch * moment
    bonding = Bonding(bound[np.newaxis], stress[np.newaxis], stress[np.newaxis])
    return after, motions, Population(bound, np.sign(stress), seen), felt(parts, bonding, speed)


def _population(
    bonds: FirstMoment | Unbroken | Steady, population: tuple[object, ...], slider: Driven, around: Around, unit: float
) -> tuple[Array, Array, Array]:
    """Share of the sites that is bound, times the mean stretch [m], and the contact radius that they have seen.

    Of bonds without a stretch the share of those of rest, with the sense of the sliding in place of a stretch.
    """
    if isinstance(bonds, FirstMoment):
        stretches = cast(Stretches, population)
        share, seen = bonds.kept(stretches.seen, around.radius)
        return stretches.bound * share, stretches.stretch * share, seen
    left = cast(Population, population)
    return left.bound, left.bound * np.sign(slider.speed) * unit, left.seen


def _numbers(
    drive: Force | Spring, bonds: FirstMoment | Unbroken | Steady, around: Around, units: _Units, duration: float
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
    """The numbers of slider, bonds and contact for one step, in its units."""
    stretch, force = units
    stiff, density = force / stretch, force / (stretch * around.area)
    yields, slope = (stiff * value for value in drive.yields(around.shear_modulus, around.poisson_ratio))
    body = drive.spring / stiff, drive.mass / stiff, drive.damping / stiff, drive.viscosity / density
    slider = Slider(*body, 0.0 if drive.spring else 1.0, yields, slope, drive.tolerance)
    if isinstance(bonds, FirstMoment):
        law, of_rest = bonds.law, bonds.bound_at_rest
        breaking = Law(law.rate, 1.0 if law.softness > 0.0 else 0.0, law.limit / stretch, bonds.rebinding_rate, 1.0)
    else:
        slows = stretch / bonds.critical_speed if isinstance(bonds, Steady) else 0.0
        breaking, of_rest = Law(0.0, 0.0, math.inf, 0.0, 1.0, 1.0, slows), 1.0
    taken = 0.0
    if around.reversible:
        stress = density * stretch
        taken = around.reversible * float(mean_stress_energy(1.0, stress, around.modulus, around.poisson_ratio))
    (load, base, behind), (later, beyond, _) = around.held
    rates = (later - load) / duration, (beyond - base) / duration
    held = Resting(
        float(around.stays), around.bonded / of_rest, taken, load, rates[0], base, rates[1], behind,
        1.0 / around.sphere_radius, around.modulus, around.area,
    )  # fmt: skip
    return tuple(slider), tuple(breaking), tuple(held)
