"""Stepper of a driven slider, whose motion is solved together with bonds and contact in sub-steps."""

from typing import cast

import numpy as np

from sim.parts.contact.models import Equilibrium
from sim.parts.coupled import coupled
from sim.parts.coupled.coupled import StepContact
from sim.parts.coupled.step_end import StepEnds
from sim.parts.exchange import NO_DRAWS, Array, ContactState, Storing
from sim.spectrum.radial import PLANE
from sim.step.state import MemberNoise, State, Trajectory
from sim.step.stepper import BLOCK_NUMBERS, Scene, Stepper


class Driven(Stepper):
    """Stepper of a slider that a spring or a force moves against its friction.

    Bonds, slider and an equilibrium contact are solved together within each clock step.
    Clock steps are advanced one by one if something is only known at their ends that acts
    on the next one: an edge that lags, fluctuations that the loop over the steps cannot
    draw, bonds that are drawn there.

    Attributes
    ----------
    follows_contact : bool
        True if the loop over the clock steps finds the contact at the end of each, with the
        fluctuations there.
    holds_contact : bool
        True if neither bonds nor the mount change the contact within a clock step.
    is_undisturbed : bool
        True if fluctuations never change the contact.
    """

    def __init__(self, scene: Scene) -> None:
        fluctuations, bonds, contact = scene.models
        work = scene.work.adhesion.work_of_bonds
        self.is_undisturbed = fluctuations.paid_by_adhesion == 0.0 or fluctuations.stays
        self.holds_contact = contact.lags or not (
            contact.changes or contact.reversible or work(1.0) != work(0.0)
        )
        self.follows_contact = (
            bonds.in_blocks
            and not contact.lags
            and (self.is_undisturbed or fluctuations.in_blocks)
        )
        alone = bonds.feeds_back or fluctuations.feeds_back or not self.follows_contact
        super().__init__(scene, 1 if alone else BLOCK_NUMBERS)

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

    def _block(
        self, state: State, noise: MemberNoise, steps: range
    ) -> tuple[State, Trajectory]:
        scene = self.scene
        drive, _, process, contact = parts = scene.parts
        around = self._around(state.contact, state.shear, steps)
        ends = self._ends(state, noise, steps)
        reached = coupled.advance(
            parts,
            state.drive,
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
        balance = scene.work.balance(bonding, energy, motions.position)
        if self.follows_contact:
            touch = cast(Equilibrium, scene.models.contact).reached(
                state.contact, motions, scene.times.duration, balance, ends.radius
            )
        else:
            touch = contact.advance(
                state.contact, motions, scene.times.duration, balance
            )
        sliders, bonding = coupled.with_contact(parts, reached, around, touch.radius)
        history = self._events(state, steps, motions, bonding, touch)
        stage = drive.stage_of(sliders)
        if stage.size:
            samples = np.stack(
                [
                    stage,
                    sliders.stage_speed,
                    sliders.spring_force,
                    sliders.position,
                    bonding.stress,
                    sliders.work,
                ]
            )
            late = 0.5 * scene.times.duration
            slips = history.slips.after(motions.time[:, 0], samples, late)
            history = history._replace(slips=slips)
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
        if self.follows_contact and not self.is_undisturbed:
            draws = scene.parts.shear.draws(state.shear, steps, noise.shear)
        return StepEnds(
            draws,
            self.follows_contact,
            contact.after_pull_off == "reattach",
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
