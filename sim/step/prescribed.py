"""Stepper of a prescribed motion: each part is advanced over a whole block of clock steps, one after the other."""

from sim.parts.exchange import during
from sim.step.state import MemberNoise, State, Trajectory
from sim.step.stepper import BLOCK_NUMBERS, Scene, Stepper


class Prescribed(Stepper):
    """Stepper of a slider whose motion is a given function of time.

    Clock steps are advanced one by one if bonds or fluctuations need the contact at the
    end of the step before, else in blocks.
    """

    def __init__(self, scene: Scene) -> None:
        fluctuations, bonds, _ = scene.models
        alone = bonds.feeds_back or fluctuations.passes
        super().__init__(scene, 1 if alone else BLOCK_NUMBERS)

    def start(self, noise: MemberNoise) -> State:
        scene = self.scene
        drive, population, process, contact = scene.parts
        slider, motion = drive.begin(scene.times, len(noise.bonds.members))
        bonds = population.start(motion, noise.bonds)
        bonding = population.bonding(bonds)
        shear = process.start(motion, bonding, noise.shear)
        balance = scene.work.balance(bonding, shear.energy, slider.position)
        touch = contact.start(motion, scene.times.duration, balance)
        history = self._first_events(bonding, touch, drive.stage_of(slider))
        return State(0, slider, bonds, bonding, shear, touch, history)

    def _block(
        self, state: State, noise: MemberNoise, steps: range
    ) -> tuple[State, Trajectory]:
        scene = self.scene
        drive, population, process, contact = scene.parts
        slider, motions = drive.advance(state.drive, scene.times, steps)
        bonds, bonding = population.advance(
            state.bonds, motions, state.contact.radius, noise.bonds
        )
        if population.feeds_back:
            bonding = bonding.carried(state.contact.radius)
        shear, energy = process.advance(state.shear, motions, bonding, noise.shear)
        balance = scene.work.balance(bonding, energy, motions.position)
        touch = contact.advance(state.contact, motions, scene.times.duration, balance)
        history = self._events(state, steps, motions, bonding, touch)
        end = State(
            steps[-1], slider, bonds, bonding.at(-1), shear, touch.at(-1), history
        )
        readings = during(drive.readings(slider), len(steps))
        return end, Trajectory.of(
            motions.time, motions, bonding, energy, readings, touch
        )
