"""Stepper of a driven slider, whose motion is solved together with bonds and contact in sub-steps."""

import bisect
from typing import ClassVar, cast

import numpy as np

from sim.parts.contact.balance import Balance
from sim.parts.contact.models import Equilibrium
from sim.parts.coupled import coupled
from sim.parts.coupled.coupled import StepContact
from sim.parts.coupled.step_end import StepEnds
from sim.parts.drive import Driven as Slider, Force, Spring
from sim.parts.events import Events
from sim.parts.exchange import (
    NO_DRAWS,
    Array,
    Bonding,
    ContactState,
    Drive,
    Flags,
    Motion,
    Sliding,
    Storing,
)
from sim.spectrum.radial import PLANE
from sim.step.state import MemberNoise, State, Trajectory
from sim.step.stepper import BLOCK_NUMBERS, Scene, Stepper


class Driven(Stepper):
    """Stepper of a slider that a spring or a force moves against its friction.

    Bonds, slider and an equilibrium contact are solved together within each clock step. The
    loop over the clock steps finds the contact at the end of each, with the fluctuations
    there, so that a block has as many steps as are asked for.

    Attributes
    ----------
    holds_contact : bool
        True if neither bonds nor the mount change the contact within a clock step.
    is_undisturbed : bool
        True if fluctuations never change the contact.
    """

    #: True if the loop over the clock steps finds the contact.
    follows: ClassVar[bool] = True

    def __init__(self, scene: Scene, longest: int = BLOCK_NUMBERS) -> None:
        super().__init__(scene, longest)
        contact, work = scene.models.contact, scene.work.adhesion.work_of_bonds
        self.is_undisturbed = scene.models.fluctuations.stays
        self.holds_contact = contact.lags or not (
            contact.changes or contact.reversible or work(1.0) != work(0.0)
        )

    def start(self, noise: MemberNoise) -> State:
        scene = self.scene
        drive, population, process, contact = parts = scene.parts
        slider, motion = drive.begin(scene.times, len(noise.bonds.members))
        bonds = population.start(motion, noise.bonds)
        bonding = coupled.with_contact_stress(
            parts, population.bonding(bonds), motion.speed
        )
        shear = process.start(motion, bonding, noise.shear)
        balance = scene.work.balance(bonding, shear.energy, slider.position)
        touch = contact.start(motion, scene.times.duration, balance)
        around = self._around(touch, shear, range(1, 2))
        slider = coupled.load(parts, slider, bonding, around, scene.times.duration)
        history = self._first_events(bonding, touch, drive.stage_of(slider))
        return State(0, slider, bonds, bonding, shear, touch, history)

    @property
    def _moves_stress(self) -> frozenset[str]:
        """Courses with which the stress jumps where nothing delays the slip; the stage of a spring never jumps."""
        drive = cast(Force | Spring, self.scene.parts.drive)
        is_viscous = drive.damping + drive.viscosity > 0.0
        if drive.mass > 0.0 or (is_viscous and not self.scene.models.bonds.jumps_with):
            return frozenset()
        return frozenset({"mount"} if drive.spring else {"mount", "drive"})

    def _block(
        self, state: State, noise: MemberNoise, steps: range
    ) -> tuple[State, Trajectory]:
        scene = self.scene
        drive, _, process, _ = parts = scene.parts
        slider = cast(Slider, state.drive)
        if is_unloaded := (moved_by := self._moved_by(steps)) is not drive:
            parts = parts._replace(drive=moved_by)
            slider = cast(Spring, drive).unloaded(slider)
        around = self._around(state.contact, state.shear, steps)
        ends = self._ends(state, noise, steps)
        reached = coupled.advance(
            parts,
            slider,
            state.bonds,
            around,
            scene.times,
            steps,
            noise.bonds,
            ends,
        )
        motions, bonding = reached.motions, reached.bonding
        shear, energy = process.advance(
            state.shear, motions, bonding, noise.shear, reached.field
        )
        shear, energy = _held(state.shear, shear, energy)
        balance = scene.work.balance(bonding, energy, motions.position)
        touch = self._touch(state.contact, motions, balance, ends)
        places = np.concatenate([slider.position[np.newaxis], motions.position])
        touch = _held_contact(state.contact, touch, np.isnan(places))
        sliders, bonding = coupled.with_contact(parts, reached, around, touch.radius)
        if is_unloaded:  # the stage follows the slider
            sliders = sliders._replace(stage_position=sliders.position)
        history = self._events(state, steps, motions, bonding, touch)
        history = self._with_slips(history, motions, sliders, bonding)
        end = State(
            steps[-1],
            sliders.at(-1),
            reached.population,
            bonding.at(-1),
            shear,
            touch.at(-1),
            history,
        )
        readings = drive.readings(sliders)
        return end, Trajectory.of(
            motions.time, motions, bonding, energy, readings, touch
        )

    def _moved_by(self, steps: range) -> Drive[Sliding]:
        """Return the drive of the body in a block, which may be another one while the stage holds."""
        drive, phases = self.scene.parts.drive, self.scene.phases
        in_holds = cast(Drive[Sliding], cast(Force | Spring, drive).in_holds)
        if in_holds is drive:
            return drive
        holds = phases.rests[bisect.bisect_right(phases.steps, steps.start) - 1]
        return in_holds if holds else drive

    def _touch(
        self, before: ContactState, motions: Motion, balance: Balance, ends: StepEnds
    ) -> ContactState:
        """Return the contact at the end of each clock step, as the loop has found it."""
        contact = cast(Equilibrium, self.scene.models.contact)
        duration = self.scene.times.duration
        return contact.reached(before, motions, duration, balance, ends.radius)

    def _with_slips(
        self, history: Events, motions: Motion, sliders: Slider, bonding: Bonding
    ) -> Events:
        """Return the events with the slip events of a slider that a stage pulls."""
        stage = self.scene.parts.drive.stage_of(sliders)
        if not stage.size:
            return history
        of_stage = stage, sliders.stage_speed, sliders.spring_force
        samples = np.stack([*of_stage, sliders.position, bonding.stress, sliders.work])
        late = 0.5 * self.scene.times.duration
        slips = history.slips.after(motions.time[:, 0], samples, late)
        return history._replace(slips=slips)

    def _ends(self, state: State, noise: MemberNoise, steps: range) -> StepEnds:
        """Return what acts at the ends of some clock steps."""
        scene, contact, work = self.scene, self.scene.models.contact, self.scene.work
        members = len(noise.bonds.members)
        ends = scene.times.at(np.arange(steps.start, steps.stop, dtype=float))
        control = contact.control(ends[:, np.newaxis], scene.times.duration)
        mounts, touches = np.empty((len(steps), 2)), np.empty(len(steps), bool)
        load, base, _ = control.mount
        mounts[:, 0], mounts[:, 1] = np.ravel(load), np.ravel(base)
        touches[:] = np.ravel(control.closes)
        jumps = contact.course.jumps(ends, scene.times.duration)
        draws = NO_DRAWS
        if self.follows and not self.is_undisturbed:
            draws = scene.parts.shear.draws(state.shear, steps, noise.shear)
        return StepEnds(
            draws,
            self.follows,
            contact.after_pull_off == "reattach",
            scene.models.bonds.feeds_back,
            mounts,
            jumps,
            touches,
            state.shear.energy + np.zeros(members),
            work.paid,
            PLANE if work.margin is None else work.margin.each[0],
            np.empty((len(steps), members)),
        )

    def _around(self, touch: ContactState, shear: Storing, steps: range) -> StepContact:
        """Return contact and solid at the start of some clock steps."""
        scene, work, contact = self.scene, self.scene.work, self.scene.models.contact
        ends = scene.times.at(np.arange(steps.start - 1.0, steps.stop))
        first, last = contact.mount_between(ends, scene.times.duration)
        share: Array | float = 1.0
        if work.margin is not None:
            share = work.margin(np.nan_to_num(touch.radius, nan=0.0))
        bare = work.adhesion.work_of_bonds(0.0)
        return StepContact(
            touch.radius,
            ~np.isnan(touch.detached),
            bare,
            work.paid * share,
            shear,
            work.adhesion.work_of_bonds(1.0) - bare,
            contact.reversible,
            (first.mount, last.mount),
            self.holds_contact,
            self.is_undisturbed,
            work.bodies,
            scene.contact_area,
        )


class SingleSteps(Driven):
    """Stepper of a driven slider whose contact is found after each clock step.

    The edge lags, or something is known at the end of a clock step only that acts on the next
    one: fluctuations that the loop cannot draw, or bonds that are counted there.
    """

    follows: ClassVar[bool] = False

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, longest=1)

    def _touch(
        self, before: ContactState, motions: Motion, balance: Balance, ends: StepEnds
    ) -> ContactState:
        """Return the contact at the end of the clock step, by its model."""
        duration = self.scene.times.duration
        return self.scene.models.contact.advance(before, motions, duration, balance)


def _held(before: Storing, after: Storing, energy: Array) -> tuple[Storing, Array]:
    """Return fluctuations whose energies stay as they were where they are unknown [J/m²].

    That of a slider whose motion has ended has no speed any more, by which its amplitude would follow. If it were
    unknown, its contact would open, and a pull-off would be reported that the mount never makes.
    """
    if not np.isnan(energy).any():
        return after, energy
    held = np.concatenate([before.energy + np.zeros((1, energy.shape[1])), energy])
    for k in range(1, len(held)):
        held[k] = np.where(np.isnan(held[k]), held[k - 1], held[k])
    return after.holding(held[-1]), held[1:]


def _held_contact(
    before: ContactState, after: ContactState, ended: Flags
) -> ContactState:
    """Return the contact at the end of each step of a block, as it was wherever the motion of its slider has ended.

    ``ended`` are flags of the motion at the start of the block and at the end of each step. Bonds that break as the
    slider loses stability leave no work of adhesion, and the mount moves on. A contact that followed them would be
    masked or opened in a motion that is not solved. A contact that opens in the step in which the motion ends stays
    open, because the slider may have lost stability by that.
    """
    if not ended.any():
        return after
    held = after._replace(
        work=after.work.copy(),
        radius=after.radius.copy(),
        detached=after.detached.copy(),
        dissipated=after.dissipated.copy(),
        turn=after.turn.copy(),
    )
    last = before
    for k in range(len(held.radius)):
        opens = np.isnan(held.radius[k]) & ~np.isnan(last.radius) & ~ended[k]
        stays = ended[k + 1] & ~opens
        for values, former in (
            (held.work, last.work),
            (held.radius, last.radius),
            (held.detached, last.detached),
            (held.dissipated, last.dissipated),
        ):
            values[k] = np.where(stays, former, values[k])
        held.turn[k][stays] = np.nan
        last = held.at(k)
    return held


def driven(scene: Scene) -> Driven:
    """Return the stepper of a driven slider: the loop over the clock steps, or single steps."""
    fluctuations, bonds, contact = scene.models
    draws = fluctuations.stays or fluctuations.in_blocks
    if contact.lags or not (bonds.in_blocks and draws):
        return SingleSteps(scene)
    return Driven(scene, longest=1 if bonds.feeds_back else BLOCK_NUMBERS)
