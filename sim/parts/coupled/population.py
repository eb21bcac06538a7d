"""Bonds in the loops over clock steps of a driven slider: one class for each model of bonds.

To add a population behind a spring, write its class here and enter it in ``POPULATIONS``.
"""

import math
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from sim.numerics.noise import Noise
from sim.parts.bonds import models
from sim.parts.bonds.cohorts import Cohorts, numbers_of
from sim.parts.bonds.tracked import AGAIN, Tracks, site_law
from sim.parts.coupled.cohorts import advance_cohorts
from sim.parts.coupled.mean_field import advance_rows
from sim.parts.coupled.mechanics import ROW, Inputs, Law
from sim.parts.coupled.tracked import advance_tracks
from sim.parts.drive import Driven, Force, Spring
from sim.parts.exchange import Array, Bonding, Motion, Parts, StickEnds

#: Stretch by which the motion of bonds is measured that neither force nor stretch breaks, in a run without motion [m].
_STRETCH = 1e-9


class Loop(NamedTuple):
    """Arguments of a loop over clock steps.

    Attributes
    ----------
    inputs : Inputs
        Rows, energies, and the course of the steps.
    arguments : tuple
        All arguments that the loops have in common, ``inputs`` among them.
    columns : dict of str to array, shape (steps, members)
        Columns of the rows at the end of each step, written by the loop.
    """

    inputs: Inputs
    arguments: tuple[tuple[object, ...], ...]
    columns: dict[str, Array]

    @property
    def rows(self) -> NDArray[np.void]:
        """Rows at the start, as records."""
        return self.inputs.rows.view(ROW)[:, 0]

    @property
    def stretch(self) -> float:
        """Unit of a stretch [m]."""
        return float(self.inputs.units.view(ROW)["slip"][0])


class Population:
    """Bonds of one model that are solved together with a slider.

    Parameters
    ----------
    bonds : Model
        The model of the bonds.
    """

    def __init__(self, bonds: models.Model) -> None:
        self.bonds = bonds

    @property
    def bound_at_rest(self) -> float:
        """Share of the sites that are bound at rest [1], of which the work of adhesion is a multiple."""
        return 1.0

    def units(
        self, drive: Force | Spring, area: float, step: float
    ) -> tuple[float, float]:
        """Return the units of a step of a length [s]: a stretch [m], and a force [N] of the ``area`` at rest [m²]."""
        raise NotImplementedError

    def law(self, stretch: float) -> Law:
        """Return the numbers of the bonds, lengths in units of a ``stretch`` [m]."""
        raise NotImplementedError

    def advance(
        self, state: tuple[object, ...], radius: Array, loop: Loop, noise: Noise
    ) -> tuple[tuple[object, ...], Bonding]:
        """Return the bonds after some clock steps, and their readings at each.

        ``radius`` of the contact at the start [m].
        """
        raise NotImplementedError

    def stick_ends(
        self,
        drive: Force | Spring,
        sliders: tuple[Driven, Driven],
        motions: Motion,
        bonds: tuple[tuple[object, ...], Bonding],
        radii: Array,
    ) -> StickEnds:
        """Return the ends of stick phases in some clock steps; bonds with a stretch have none.

        ``sliders`` and ``bonds`` are those at the start of the first step and at the end of each, ``radii`` [m] those
        of the contact at the start of each step.
        """
        return StickEnds()

    def drawn(
        self,
        drive: Force | Spring,
        start: tuple[object, ...],
        end: tuple[tuple[object, ...], Bonding],
        motions: Motion,
        radius: Array,
        noise: Noise,
    ) -> tuple[tuple[object, ...], Bonding]:
        """Return bonds and readings at the ``end`` of some clock steps after a draw there, if they are drawn.

        The bonds at the ``start`` are in a contact of a radius [m].
        """
        state, bonding = end
        return state, bonding._replace(strength=np.abs(bonding.stress))

    def closing_force(
        self,
        drive: Force | Spring,
        slider: Driven,
        force: Array,
        area: Array,
        elastic: Array | None,
    ) -> Array:
        """Return the force that a contact of some area [m²] bears if it has closed at the end of a clock step [N].

        ``force`` is that of the bonds, ``elastic`` that of the shear displacement of a contact that yields.
        """
        raise NotImplementedError

    def with_draw(
        self, drive: Force | Spring, slider: Driven, bonding: Bonding, area: Array
    ) -> tuple[Driven, Bonding]:
        """Return slider and readings at the end of a clock step in a contact of some area [m²], after a draw there."""
        return slider, bonding


class Stretched(Population):
    """Bonds that carry a stretch."""

    bonds: models.FirstMoment | models.Cohort | models.Tracked

    @property
    def bound_at_rest(self) -> float:
        return self.bonds.bound_at_rest

    def units(
        self, drive: Force | Spring, area: float, step: float
    ) -> tuple[float, float]:
        """Return the stretch at which bonds break [m], and the force of all sites at it, n κ b A0 [N]."""
        law, bonds = self.bonds.law, self.bonds
        bears = bonds.site_density * bonds.bond_stiffness * area
        stretch = law.scale
        if stretch == math.inf:
            most = max(map(abs, drive.course.extremes))
            slow = law.rate if drive.spring else bears * bonds.bound_at_rest
            stretch = most / slow or _STRETCH
        return stretch, bears * stretch

    def law(self, stretch: float) -> Law:
        law = self.bonds.law
        softness = 1.0 if law.softness > 0.0 else 0.0
        return Law(
            law.rate, softness, stretch / law.limit, self.bonds.rebinding_rate, 1.0
        )

    def closing_force(
        self,
        drive: Force | Spring,
        slider: Driven,
        force: Array,
        area: Array,
        elastic: Array | None,
    ) -> Array:
        """Return the pull if the slider has neither mass nor damping; a stiff contact has unstretched bonds."""
        if drive.mass == 0.0 and drive.damping == 0.0:
            # that of a slider whose motion has ended is not known
            return np.where(np.isnan(slider.speed), np.nan, slider.spring_force)
        if elastic is not None:
            return elastic
        viscous = area * drive.viscosity * slider.speed
        return np.where(slider.radius > 0.0, force, viscous)


class MeanStretch(Stretched):
    """Bonds by their number and their mean stretch."""

    bonds: models.FirstMoment

    def advance(
        self, state: tuple[object, ...], radius: Array, loop: Loop, noise: Noise
    ) -> tuple[tuple[object, ...], Bonding]:
        before = cast(models.Stretches, state)
        share, area_radius = self.bonds.diluted(before.area_radius, radius)
        loop.rows["bound"], loop.rows["moment"] = (
            before.bound * share,
            before.stretch * share,
        )
        advance_rows(*loop.arguments)
        bound, moment = loop.columns["bound"], loop.columns["moment"]
        end = models.Stretches(bound[-1].copy(), moment[-1].copy(), area_radius)
        return end, self.bonds.bonding(models.Stretches(bound, moment))


class ByCohorts(Stretched):
    """Bonds by the density of their stretch."""

    bonds: models.Cohort

    def advance(
        self, state: tuple[object, ...], radius: Array, loop: Loop, noise: Noise
    ) -> tuple[tuple[object, ...], Bonding]:
        bonds, before = self.bonds, cast(models.Ages, state)
        share, area_radius = bonds.diluted(before.area_radius, radius)
        cohorts = Cohorts(*(array.copy() for array in before.cohorts))
        sums = np.empty((5, *loop.columns["radius"].shape))
        rules = numbers_of(bonds.law, bonds.rebinding_rate, bonds.tolerance)
        advance_cohorts(*loop.arguments, share, rules, tuple(cohorts), sums)
        return models.Ages(cohorts, area_radius), bonds.read(sums)


class OneByOne(Stretched):
    """Bonds that are followed one by one."""

    bonds: models.Tracked

    def advance(
        self, state: tuple[object, ...], radius: Array, loop: Loop, noise: Noise
    ) -> tuple[tuple[object, ...], Bonding]:
        bonds, tracks = self.bonds, cast(Tracks, state)
        tracks = tracks._replace(frame=tracks.frame.copy())
        frames = np.empty((*loop.columns["radius"].shape, tracks.frame.shape[1]))
        members = np.asarray(noise.members, dtype=np.uint64)
        law = site_law(bonds.law, bonds.rebinding_rate, turns=True)
        if advance_tracks(
            *loop.arguments, tuple(tracks), law, (noise.seed, members), frames
        ):
            raise RuntimeError(AGAIN)
        return tracks, bonds.read(frames)


class WithoutStretch(Population):
    """Bonds that bear any pull up to their strength."""

    bonds: models.Unbroken | models.Steady | models.Rate | models.Counted

    @property
    def _rate(self) -> tuple[float, float]:
        """Displacement on which sliding renews bonds [m], infinite if it does not, and rate of rebinding [1/s]."""
        return math.inf, 0.0

    def units(
        self, drive: Force | Spring, area: float, step: float
    ) -> tuple[float, float]:
        """Return the displacement at which the strength loads the spring [m], and the strength τ A0 [N].

        If sliding renews the bonds on a shorter displacement, it is the unit.
        """
        force = self.bonds.stress * area
        if drive.spring:
            shift = force / drive.spring
        else:
            slow = drive.mass / step + drive.damping + drive.viscosity * area
            most = max(map(abs, drive.course.extremes))
            shift = max(most, force) * step / slow
        return min(shift, self._rate[0]), force

    def law(self, stretch: float) -> Law:
        renewing, rebinding = self._rate
        return Law(0.0, 0.0, stretch / renewing, rebinding, 1.0, 1.0, 0.0)

    def _fraction(self, state: tuple[object, ...], radius: Array) -> Array:
        """Return the share of bound sites [1] over the contact of a radius [m]."""
        plain = cast(models.Population, state)
        share, _ = self.bonds.diluted(plain.area_radius, radius)
        return self.bonds.bonding(plain).fraction * share

    def advance(
        self, state: tuple[object, ...], radius: Array, loop: Loop, noise: Noise
    ) -> tuple[tuple[object, ...], Bonding]:
        before = cast(models.Population, state)
        _, area_radius = self.bonds.diluted(before.area_radius, radius)
        loop.rows["bound"] = self._fraction(state, radius)
        advance_rows(*loop.arguments)
        bound, moment = loop.columns["bound"], loop.columns["moment"]
        stress = self.bonds.stress / loop.stretch * moment
        end = models.Population(bound[-1].copy(), np.sign(stress[-1]), area_radius)
        return end, Bonding(bound, stress, stress)

    def stick_ends(
        self,
        drive: Force | Spring,
        sliders: tuple[Driven, Driven],
        motions: Motion,
        bonds: tuple[tuple[object, ...], Bonding],
        radii: Array,
    ) -> StickEnds:
        """Return the ends of stick phases in some clock steps, as the class of all populations has it.

        Pull and strength are taken as linear in time to find the end of the stick phase. An error of that time makes a
        small error of the stress, because the strength grows slowly. The stress is the strength of the bonds at that
        time, so that it never exceeds that of all bonds.
        """
        (before, after), strength = sliders, self.bonds.stress
        fractions = from_start(self._fraction(bonds[0], radii[0]), bonds[1].fraction)
        _, rate = self._rate
        free, area = strength * (1.0 - fractions), np.pi * radii**2
        sense = np.sign(motions.slip)
        forces = from_start(before.spring_force, after.spring_force)
        growth = after.spring_force - forces
        if drive.spring:
            stage = from_start(before.stage_position, after.stage_position)
            growth = drive.spring * (after.stage_position - stage)
        lacking = area * strength * fractions - sense * forces
        gaining = sense * growth + area * free * np.expm1(-rate * motions.duration)
        share = np.divide(
            lacking,
            gaining,
            out=np.zeros(area.shape),
            where=(lacking > 0.0) & (gaining > 0.0),
        )
        time = np.minimum(share, 1.0) * motions.duration
        stress = strength * fractions - free * np.expm1(-rate * time)
        ends = (motions.first == 0.0) & (motions.path > 0.0) & (area > 0.0)
        return StickEnds(
            np.where(ends, stress, np.nan),
            np.where(ends, motions.duration - time, np.nan),
        )

    def closing_force(
        self,
        drive: Force | Spring,
        slider: Driven,
        force: Array,
        area: Array,
        elastic: Array | None,
    ) -> Array:
        """Return the pull less the damping if the slider has no mass; else it bears the force of the bonds."""
        if drive.mass == 0.0:
            return slider.spring_force - drive.damping * slider.speed
        return force if elastic is None else elastic


class BySpeed(WithoutStretch):
    """Bonds whose fraction follows the speed without delay."""

    bonds: models.Steady

    def law(self, stretch: float) -> Law:
        return super().law(stretch)._replace(slows=stretch / self.bonds.critical_speed)


class ByRate(WithoutStretch):
    """Bonds of the rate equation."""

    bonds: models.Rate

    @property
    def _rate(self) -> tuple[float, float]:
        bonds = self.bonds
        return bonds.critical_speed / bonds.rebinding_rate, bonds.rebinding_rate


class ByCount(WithoutStretch):
    """Bonds that are counted: they stay within a clock step, and are drawn at its end with the slip in it."""

    bonds: models.Counted

    def drawn(
        self,
        drive: Force | Spring,
        start: tuple[object, ...],
        end: tuple[tuple[object, ...], Bonding],
        motions: Motion,
        radius: Array,
        noise: Noise,
    ) -> tuple[tuple[object, ...], Bonding]:
        before, slides = cast(models.Population, start), motions.speed != 0.0
        state, drawn = self.bonds.advance(before, motions, radius, noise)
        stress = end[1].stress
        strength = np.where(slides, drawn.strength, np.abs(stress))
        if drive.mass > 0.0:
            stress = np.where(slides, drawn.stress, stress)
        return state, Bonding(drawn.fraction, stress, strength)

    def with_draw(
        self, drive: Force | Spring, slider: Driven, bonding: Bonding, area: Array
    ) -> tuple[Driven, Bonding]:
        """Return slider and readings after the draw.

        A slider without mass bears the pull less the damping until the draw, whatever the draw adds to the area. After
        it the slider sticks if the bonds have become stronger than the pull. If they are weaker, its speed is that of
        the new balance.
        """
        if drive.mass > 0.0:
            return slider, bonding
        pull, sense = slider.spring_force, np.sign(slider.speed)
        grows = area > np.pi * slider.radius**2
        friction = pull - drive.damping * slider.speed
        stress = np.divide(friction, area, out=bonding.stress.copy(), where=grows)
        strength = area * self.bonds.stress * bonding.fraction
        excess = np.maximum(sense * pull - strength, 0.0)
        drag = drive.damping + drive.viscosity * area
        speed = np.divide(
            sense * excess,
            drag,
            out=np.where(excess > 0.0, slider.speed, 0.0),
            where=drag > 0.0,
        )
        slider = slider._replace(speed=speed, body_speed=speed)
        return slider, bonding._replace(stress=stress)


def from_start(start: Array, ends: Array) -> Array:
    """Return values at the start of each of some clock steps, from those at the start of the first and at each end."""
    values = np.empty_like(ends)
    values[0], values[1:] = start, ends[:-1]
    return values


#: Class of the population of each model of bonds.
POPULATIONS: dict[type, type[Population]] = {
    models.Unbroken: WithoutStretch,
    models.Steady: BySpeed,
    models.Rate: ByRate,
    models.Counted: ByCount,
    models.FirstMoment: MeanStretch,
    models.Cohort: ByCohorts,
    models.Tracked: OneByOne,
}


def population_of(parts: Parts) -> Population:
    """Return the population of the bonds of a scene behind a spring or under a force."""
    return POPULATIONS[type(parts.bonds)](cast(models.Model, parts.bonds))
