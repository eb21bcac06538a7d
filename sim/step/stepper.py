"""Steppers: how the parts of a scene act in a clock step, in one order.

    drive → bonds → fraction, stress → shear → ΔΓ → w = Δγ(fraction) − χ ΔΓ → contact → radius

A scene has one stepper, ``Prescribed`` or ``Driven``, which it chooses once.
"""

import bisect
import math
from typing import NamedTuple

import numpy as np

from sim.parts import events
from sim.parts.bonds.models import Model as BondModel
from sim.parts.contact import Contact
from sim.parts.contact.models import EffectiveWork
from sim.parts.exchange import Array, Bonding, ContactState, Motion, Parts, Times
from sim.parts.shear.models import Model as FluctuationModel
from sim.step.phases import Phases
from sim.step.state import MemberNoise, State, Trajectory

#: Most numbers of one quantity in a block of steps, which then stay in the cache.
BLOCK_NUMBERS = 2**16
#: Numbers in the largest array of a block: turns of the contact have several columns.
_LARGEST_ARRAY = 2**19
#: Mode pairs of a shear process whose step takes much longer than the rest.
_MANY_PAIRS = 64
#: Share of the run by which the time of a turn may differ from that of the jump that makes it: courses jump at a time
#: that is nearer than half of it.
_SAME = 2e-9


class Models(NamedTuple):
    """Models of fluctuations, bonds and contact, as the tables of a scenario have them."""

    fluctuations: FluctuationModel
    bonds: BondModel
    contact: Contact


class Scene(NamedTuple):
    """Constants of a scene for its stepper.

    Attributes
    ----------
    parts : Parts
        Drive, bonds, shear process and contact.
    models : Models
        Models of the parts that decide what acts within a clock step.
    times : Times
        Clock of the run.
    phases : Phases
        Phases of the run; no block of steps reaches over the start of one.
    work : EffectiveWork
        Work of adhesion and what reduces it.
    loads_from_rest : bool
        True if a first maximum of the friction is looked for.
    follows_path : bool
        True if the longest path in a clock step is recorded.
    shares_area : bool
        True if all members with the same stress have the same contact area.
    contact_area : float
        Area of the contact at rest [m²], by which forces are measured.
    """

    parts: Parts
    models: Models
    times: Times
    phases: Phases
    work: EffectiveWork
    loads_from_rest: bool
    follows_path: bool
    shares_area: bool
    contact_area: float


class Stepper:
    """Base of both steppers: blocks of clock steps, the events in them, and the trajectory.

    Examples
    --------
    A run of one's own, with the states in one's hands:

    >>> import numpy as np, sim
    >>> stepper = sim.load("scenarios/pdms_lens.toml").stepper
    >>> noise = MemberNoise.of(seed=0, members=np.arange(4))
    >>> state = stepper.start(noise)
    >>> state, course = stepper.advance(state, noise, range(10, 101, 10))
    >>> course.radius.shape
    (10, 4)
    """

    #: Most clock steps that are advanced at once; 1 if a part needs the contact of the step before.
    longest: int

    def __init__(self, scene: Scene, longest: int) -> None:
        self.scene, self.longest = scene, longest
        _have_memory_kept()

    @property
    def _moves_stress(self) -> frozenset[str]:
        """Courses with which the stress jumps, see ``Phases``."""
        return self.scene.models.bonds.jumps_with

    def start(self, noise: MemberNoise) -> State:
        """Return the state of a batch of members at t = 0."""
        raise NotImplementedError

    def _block(
        self, state: State, noise: MemberNoise, steps: range
    ) -> tuple[State, Trajectory]:
        """Return the state after a block of clock steps in one phase, and the trajectory in it."""
        raise NotImplementedError

    def advance(
        self, state: State, noise: MemberNoise, steps: range
    ) -> tuple[State, Trajectory]:
        """Advance a batch of members to the last of some evenly spaced clock steps.

        Parameters
        ----------
        state : State
            The state from which to go on, at any step before the first of ``steps``. It may
            be that of another scene whose arrays have the same shapes.
        noise : MemberNoise
            Noise of the members, the same as at the start.
        steps : range
            Clock steps to be recorded. Step 0 is recorded if the state is that of the start.

        Returns
        -------
        state : State
            The state at the last of the steps.
        course : Trajectory
            The trajectory at each of them; the same numbers, bit for bit, for any spacing.
        """
        blocks = []
        if steps.start == 0 and state.step == 0:
            blocks.append(self.trajectory_of(state))
        pairs = 1 + self.scene.parts.shear.pairs // _MANY_PAIRS
        members = len(noise.shear.members)
        longest = min(self.longest, max(1, BLOCK_NUMBERS // (members * pairs)))
        starts = (*self.scene.phases.steps, self.scene.times.steps + 1)
        while state.step < steps[-1]:
            first = state.step + 1
            end_of_phase = starts[bisect.bisect_right(starts, first)] - 1
            last = min(state.step + longest, steps[-1], end_of_phase)
            state, course = self._block(state, noise, range(first, last + 1))
            recorded = slice((steps.start - first) % steps.step, None, steps.step)
            blocks.append(Trajectory(*(values[recorded] for values in course)))
        if len(blocks) == 1:
            return state, blocks[0]
        return state, Trajectory(*map(np.concatenate, zip(*blocks, strict=True)))

    def follow(
        self, noise: MemberNoise, state: State | None, steps: range
    ) -> tuple[State, Trajectory]:
        """Advance from a state as ``advance``, or from the start if there is none."""
        return self.advance(state or self.start(noise), noise, steps)

    def trajectory_of(self, state: State) -> Trajectory:
        """Return the trajectory at one state, with a time axis of length 1."""
        values = Trajectory.of(
            np.full(1, self.scene.times.at(state.step)),
            state.drive,
            state.bonding,
            state.shear.energy,
            self.scene.parts.drive.readings(state.drive),
            state.contact,
        )
        return Trajectory(*(array[np.newaxis] for array in values))

    def _first_events(
        self, bonding: Bonding, contact: ContactState, stage: Array
    ) -> events.Events:
        """Return the events at t = 0; ``stage`` has positions of stages that pull through a spring."""
        pull = self._pull(0.0, contact)
        return events.first(bonding, contact, pull, stage, self.scene.loads_from_rest)

    def _events(
        self,
        state: State,
        steps: range,
        motions: Motion,
        bonding: Bonding,
        contact: ContactState,
    ) -> events.Events:
        """Return the events after a block of clock steps."""
        scene, history, phases = self.scene, state.events, self.scene.phases
        if steps.start in phases.steps[1:]:
            phase = phases.steps.index(steps.start)
            since, jumps = self._first_turn(phase), self._phase_end(steps.start)[1]
            history = history.next_phase(since, phases.rests[phase - 1], jumps)
        end, _ = self._phase_end(steps.stop)
        followed = events.Followed(scene.follows_path, scene.shares_area, end)
        return events.after(
            history,
            (state.bonding, state.contact.radius),
            bonding,
            contact,
            self._pull(motions.time, contact),
            motions,
            followed,
        )

    def _first_turn(self, phase: int) -> float:
        """Return the time since which turns of the contact belong to a phase [s].

        A turn at its very start belongs to it only if the mount jumps there.
        """
        phases, near = self.scene.phases, _SAME * self.scene.times.duration
        start = phases.starts[phase]
        is_jump = "mount" in phases.jumps[phase]
        return start - near if is_jump else math.nextafter(start, math.inf)

    def _phase_end(self, first: int) -> tuple[events.PhaseEnd, events.Jumps]:
        """Return how a phase ends in the step before the first of another, and what jumps from the end of this on.

        A mount that jumps at the end of a step has jumped there, and a drive has not.
        """
        scene, phases = self.scene, self.scene.phases
        if first not in phases.steps[1:]:
            return events.PhaseEnd(), events.NO_JUMPS
        phase, near = phases.steps.index(first), _SAME * scene.times.duration
        late = phases.starts[phase] - scene.times.at(first - 1)
        names, share = phases.jumps[phase], min(1.0 + late / scene.times.step, 1.0)
        stress, area = bool(names & self._moves_stress), "mount" in names
        end = events.PhaseEnd(1.0 if late > -near else share, area and late <= near)
        return end, events.Jumps(stress and late > -near, area and late > near)

    def _pull(self, time: float | Array, touch: ContactState) -> Array:
        """Return the tensile load of the contact [N] if the control makes it, else nothing."""
        contact, radius = self.scene.models.contact, touch.radius
        if not contact.makes_load:
            return np.empty((*radius.shape[:-1], 0))
        control = contact.control(time, self.scene.times.duration)
        return -control.normal_load(radius, self.scene.work.bodies, touch.work)


def _have_memory_kept() -> None:
    """Have the allocator keep the memory of arrays that a block frees for the next block.

    The allocator of glibc keeps freed memory up to the size of the largest array that it has given back to the system
    (M_MMAP_THRESHOLD in mallopt(3)). Otherwise each block fetches its memory anew, page by page, for up to a quarter of
    its time. Other allocators are not changed.
    """
    np.empty(_LARGEST_ARRAY)
