"""Stepper of a driven slider, whose motion is solved together with bonds and contact in sub-steps."""

import numpy as np

from sim.parts.coupled import coupled
from sim.parts.coupled.coupled import StepContact
from sim.parts.exchange import NO_DRAWS, Array, Draws, Storing
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
    is_undisturbed : bool
        True if fluctuations never change the contact.
    holds_contact : bool
        True if neither bonds nor the mount change the contact within a clock step.
    draws_within : bool
        True if the loop over the clock steps draws the fluctuations.
    """

    def __init__(self, scene: Scene) -> None:
        fluctuations, bonds, contact = scene.models
        work = scene.work.adhesion.work_of_bonds
        self.is_undisturbed = fluctuations.paid_by_adhesion == 0.0 or fluctuations.stays
        self.holds_contact = contact.lags or not (
            contact.changes or contact.reversible or work(1.0) != work(0.0)
        )
        # bonds that are advanced in place need a contact that stays, because a block may end early
        in_blocks = bonds.in_blocks or (
            bonds.in_place and self.is_undisturbed and self.holds_contact
        )
        in_blocks = in_blocks and (self.is_undisturbed or fluctuations.in_blocks)
        alone = contact.lags or bonds.feeds_back or fluctuations.feeds_back
        super().__init__(scene, BLOCK_NUMBERS if in_blocks and not alone else 1)
        self.draws_within = self.longest > 1 and not self.is_undisturbed

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
        around = self._around(touch.radius, shear, range(1, 2))
        slider = coupled.load(parts, slider, bonding, around, scene.times.duration)
        history = self._first_events(bonding, touch, drive.stage_of(slider))
        return State(0, slider, bonds, bonding, shear, touch, history)

    def _block(
        self, state: State, noise: MemberNoise, steps: range
    ) -> tuple[State, Trajectory]:
        scene = self.scene
        drive, _, process, contact = parts = scene.parts
        radius = state.contact.radius
        if not scene.models.contact.lags:
            radius = coupled.of_loop(state.drive, radius)
        around = self._around(radius, state.shear, steps)
        sliders, motions, bonds, bonding = coupled.advance(
            parts,
            state.drive,
            state.bonds,
            around,
            scene.times,
            steps,
            noise.bonds,
            self._draws(state.shear, noise, steps),
        )
        shear, energy = process.advance(state.shear, motions, bonding, noise.shear)
        balance = scene.work.balance(bonding, energy, motions.position)
        touch = contact.advance(state.contact, motions, scene.times.duration, balance)
        valid = coupled.steps_until_contact_changes(sliders, touch.radius)
        if valid < len(steps):
            return self._block(state, noise, steps[:valid])
        sliders, bonding = coupled.with_contact(
            parts, sliders, bonding, around, touch.radius
        )
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
            bonds,
            bonding.at(-1),
            shear,
            touch.at(-1),
            history,
        )
        readings = drive.readings(sliders)
        return end, Trajectory.of(
            motions.time, motions, bonding, energy, readings, touch
        )

    def _draws(self, shear: Storing, noise: MemberNoise, steps: range) -> Draws:
        """Return the fluctuations that the loop over some clock steps draws."""
        if not self.draws_within:
            return NO_DRAWS
        work = self.scene.work
        share = PLANE if work.margin is None else work.margin.each[0]
        draws = self.scene.parts.shear.draws(shear, steps, noise.shear)
        return draws._replace(paid=work.paid, share=share)

    def _around(self, radius: Array, shear: Storing, steps: range) -> StepContact:
        """Return contact and half-space at the start of some clock steps, at which the contact has a radius [m]."""
        scene, work, contact = self.scene, self.scene.work, self.scene.models.contact
        ends = scene.times.at(np.arange(steps.start - 1.0, steps.stop))
        first, last = contact.mount_between(ends, scene.times.duration)
        share: Array | float = 1.0
        if work.margin is not None:
            share = work.margin(np.nan_to_num(radius, nan=0.0))
        bare = work.adhesion.work_of_bonds(0.0)
        return StepContact(
            radius,
            bare,
            work.paid * share,
            shear,
            work.adhesion.work_of_bonds(1.0) - bare,
            contact.reversible,
            (first.mount, last.mount),
            self.holds_contact,
            self.is_undisturbed,
            work.bodies,
            scene.shear_modulus,
            scene.contact_area,
        )
