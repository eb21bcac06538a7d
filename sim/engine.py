"""Engine: order of the parts in one step. It holds no physics.

drive → speed → bonds → fraction, stress → shear → ΔΓ → w = Δγ(fraction) − χ ΔΓ → contact → radius.
"""

import bisect
from collections.abc import Iterator
from typing import NamedTuple, cast, get_type_hints

import numpy as np

from sim.numerics.noise import Noise
from sim.parts import events
from sim.parts.contact.balance import Balance
from sim.parts.coupled import coupled
from sim.parts.coupled.coupled import StepContact
from sim.parts.drive import Driven
from sim.parts.exchange import (
    NO_DRAWS,
    Array,
    Bonding,
    ContactState,
    Indices,
    Motion,
    Sliding,
    Storing,
    during,
)
from sim.scenario.scenario import Scenario
from sim.spectrum.radial import PLANE

Arrays = dict[str, Array]
#: Most numbers of one quantity in a block of steps: they stay in the cache.
_BLOCK_NUMBERS = 2**16
#: Member steps of the first block of a contact that follows the fluctuations. Later ones have one step more than have
#: passed since a block ended early, or of these the share of so few members in all.
_FIRST_BLOCK, _FEW_MEMBERS = 256, 64
#: Mode pairs of a process whose step takes much longer than the rest.
_MANY_PAIRS = 64


class State(NamedTuple):
    """Everything a batch of members needs to go on, at the end of one step.

    Arrays have the member as first axis, or length 1 there where all members agree. ``bonding`` is what ``bonds``
    hand to the others, computed once a step.
    """

    step: int
    drive: Sliding
    bonds: tuple[object, ...]
    bonding: Bonding
    shear: Storing
    contact: ContactState
    events: events.Events


class Trajectory(NamedTuple):
    """Trajectory of a batch of members, with the time as first axis and the member as second.

    ``time`` [s], ``position`` [m] and ``speed`` [m/s] are those of the slider. ``fraction``, ``stress`` and
    ``strength`` of the bonds are as in ``Bonding``; ``energy`` is ΔΓ [J/m²]. ``driven`` has the readings of a drive
    that solves the motion, in columns. ``work`` and the rest are as in ``ContactState``, which has no course of turns.
    """

    time: Array
    position: Array
    speed: Array
    fraction: Array
    stress: Array
    strength: Array
    energy: Array
    driven: Array
    work: Array
    radius: Array
    detached: Array
    dissipated: Array
    phases: Array


class MemberNoise(NamedTuple):
    """The addressed noise of each part for one batch of members."""

    bonds: Noise
    shear: Noise

    @classmethod
    def of(cls, seed: int, members: Indices) -> "MemberNoise":
        return cls(Noise(seed, "bonds", members), Noise(seed, "shear", members))


def start(scenario: Scenario, noise: MemberNoise) -> State:
    """Return the state at t = 0."""
    drive, population, process, contact = scenario.parts
    slider, motion = drive.begin(scenario.times, len(noise.bonds.members))
    bonds = population.start(motion, noise.bonds)
    bonding = population.bonding(bonds)
    if drive.solves_motion:
        bonding = coupled.with_contact_stress(scenario.parts, bonding, motion.speed)
    shear = process.start(motion, bonding, noise.shear)
    terms = balance(
        scenario, bonding.fraction, bonding.strength, shear.energy, slider.position
    )
    contact_state = contact.start(motion, scenario.times.duration, terms)
    if drive.solves_motion:
        step_contact = _step_contact(scenario, contact_state, shear, range(1, 2))
        slider = coupled.load(
            scenario.parts, slider, bonding, step_contact, scenario.times.duration
        )
    stage = cast(Driven, slider).stage_position if has_stage(scenario) else np.empty(0)
    history = events.first(
        bonding,
        contact_state,
        _pull(scenario, 0.0, contact_state.radius),
        stage,
        scenario.loads_from_rest,
    )
    return State(0, slider, bonds, bonding, shear, contact_state, history)


def advance(
    scenario: Scenario, state: State, noise: MemberNoise, steps: range
) -> tuple[State, Trajectory]:
    """Return the state after a block of clock steps in one phase of the run, and the trajectory in it.

    Where a drive feels the friction the block ends, perhaps earlier, where the contact opens, closes or jumps.
    """
    drive, population, process, contact = scenario.parts
    slider: Sliding
    if drive.solves_motion:
        of_loop = (
            state.contact.radius
            if scenario.contact.lags
            else coupled.of_loop(state.drive, state.contact.radius)
        )
        step_contact = _step_contact(
            scenario, state.contact._replace(radius=of_loop), state.shear, steps
        )
        draws = NO_DRAWS
        if scenario.draws_within:
            share = PLANE if scenario.margin is None else scenario.margin.each[0]
            draws = process.draws(state.shear, steps, noise.shear)
            draws = draws._replace(
                paid=scenario.fluctuations.paid_by_adhesion, share=share
            )
        sliders, motions, bonds, bonding = coupled.advance(
            scenario.parts,
            state.drive,
            state.bonds,
            step_contact,
            scenario.times,
            steps,
            noise.bonds,
            draws,
        )
        slider, driven = sliders.at(-1), drive.readings(sliders)
    else:
        slider, motions = drive.advance(state.drive, scenario.times, steps)
        bonds, bonding = population.advance(
            state.bonds, motions, state.contact.radius, noise.bonds
        )
        driven = during(drive.readings(slider), len(steps))
    shear, energy = process.advance(state.shear, motions, bonding, noise.shear)
    terms = balance(
        scenario, bonding.fraction, bonding.strength, energy, motions.position
    )
    contact_state = contact.advance(
        state.contact, motions, scenario.times.duration, terms
    )
    valid = (
        coupled.steps_until_contact_changes(sliders, contact_state.radius)
        if drive.solves_motion
        else len(steps)
    )
    if valid < len(steps):
        return advance(scenario, state, noise, steps[:valid])
    if drive.solves_motion:
        reached = sliders, bonding, step_contact, contact_state.radius
        sliders, bonding = coupled.with_contact(scenario.parts, *reached)
        slider = sliders.at(-1)
    at_start, pull = (
        (state.bonding, state.contact.radius),
        _pull(scenario, motions.time, contact_state.radius),
    )
    history, phases = state.events, scenario.phases
    if steps.start in phases.steps[1:]:
        before = phases.steps.index(steps.start) - 1
        history = history.next_phase(phases.rests[before])
    with_area = scenario.varies["bonds"] == scenario.varies["contact"]
    history = events.after(
        history,
        at_start,
        bonding,
        contact_state,
        pull,
        motions,
        scenario.feels_steps,
        with_area,
    )
    if has_stage(scenario):
        samples = np.stack(
            [
                sliders.stage_position,
                sliders.stage_speed,
                sliders.spring_force,
                sliders.position,
                bonding.stress,
                sliders.work,
            ]
        )
        late = 0.5 * scenario.times.duration
        history = history._replace(
            slips=history.slips.after(motions.time[:, 0], samples, late)
        )
    end = State(
        steps[-1], slider, bonds, bonding.at(-1), shear, contact_state.at(-1), history
    )
    return end, _trajectory(
        motions.time, motions, bonding, energy, driven, contact_state
    )


def has_stage(scenario: Scenario) -> bool:
    """Return True if a stage pulls the slider through a spring."""
    return scenario.drive.model == "spring"


def _trajectory(
    time: Array,
    motion: Motion | Sliding,
    bonding: Bonding,
    energy: Array,
    driven: Array,
    contact: ContactState,
) -> Trajectory:
    of_bonds = bonding.fraction, bonding.stress, bonding.strength
    return Trajectory(
        time, motion.position, motion.speed, *of_bonds, energy, driven, *contact[:5]
    )


def follow(
    scenario: Scenario, noise: MemberNoise, state: State | None, steps: range
) -> tuple[State, Trajectory]:
    """Advance a batch of members from a state, or from the start, to the last of some evenly spaced steps.

    Returns
    -------
    state : State
        That at the last of the ``steps``.
    course : Trajectory
        Trajectory at each of them; the same numbers, bit for bit, as a march gives.
    """
    blocks = []
    if state is None:
        state = start(scenario, noise)
        blocks += [trajectory_of(scenario, state)] if steps.start == 0 else []
    rows, numbers = len(noise.shear.members), 1 + scenario.process.pairs // _MANY_PAIRS
    longest = 1 if scenario.by_steps else max(1, _BLOCK_NUMBERS // (rows * numbers))
    # a block that ends early was computed in part in vain, which costs most with many members
    share = min(1.0, _FEW_MEMBERS / rows)
    calm = _FIRST_BLOCK // rows if scenario.draws_within else longest / share
    starts = (*scenario.phases.steps, scenario.times.steps + 1)
    while state.step < steps[-1]:
        phase = starts[bisect.bisect_right(starts, state.step + 1)] - 1
        block = range(
            state.step + 1,
            min(state.step + min(1 + int(share * calm), longest), steps[-1], phase) + 1,
        )
        state, trajectory = advance(scenario, state, noise, block)
        calm = calm + len(block) if state.step == block[-1] else 0
        wanted = slice((steps.start - block.start) % steps.step, None, steps.step)
        blocks.append(Trajectory(*(values[wanted] for values in trajectory)))
    return state, blocks[0] if len(blocks) == 1 else Trajectory(
        *map(np.concatenate, zip(*blocks, strict=True))
    )


def trajectory_of(scenario: Scenario, state: State) -> Trajectory:
    """Return the trajectory at one state, with a time axis of length 1."""
    time, driven = (
        np.full(1, scenario.times.at(state.step)),
        scenario.parts.drive.readings(state.drive),
    )
    values = _trajectory(
        time, state.drive, state.bonding, state.shear.energy, driven, state.contact
    )
    return Trajectory(*(array[np.newaxis] for array in values))


def balance(
    scenario: Scenario, fraction: Array, strength: Array, energy: Array, position: Array
) -> Balance:
    """Return the terms of the effective work of adhesion w = Δγ(bond fraction) − χ ΔΓ − α 6τ0²a/(πE*)."""
    margin = None if scenario.margin is None else scenario.margin.at(position)
    bonded, fluctuating = (
        scenario.adhesion.work_of_bonds(fraction),
        scenario.fluctuations.paid_by_adhesion * energy,
    )
    return Balance(
        bonded, fluctuating, strength, margin, scenario.bodies, scenario.adhesion.work
    )


def _step_contact(
    scenario: Scenario, contact_state: ContactState, shear: Storing, steps: range
) -> StepContact:
    """Return contact and half-space at the start of some clock steps, for a drive that feels the friction."""
    contact, times, adhesion = scenario.contact, scenario.times, scenario.adhesion
    first, last = contact.mount_between(
        times.at(np.arange(steps.start - 1.0, steps.stop)), times.duration
    )
    share = (
        1.0
        if scenario.margin is None
        else scenario.margin(np.nan_to_num(contact_state.radius, nan=0.0))
    )
    bare, paid = (
        adhesion.work_of_bonds(0.0),
        scenario.fluctuations.paid_by_adhesion * share,
    )
    bonded = adhesion.work_of_bonds(1.0) - adhesion.work_of_bonds(0.0)
    mounts = first.mount, last.mount
    bodies, shear_modulus, area = (
        scenario.bodies,
        scenario.solid.effective[0],
        scenario.contact_area,
    )
    of_contact = contact_state.radius, bare, paid, shear, bonded, contact.reversible
    fixed = scenario.holds_contact, scenario.fluctuations_leave_contact
    return StepContact(*of_contact, mounts, *fixed, bodies, shear_modulus, area)


def _pull(scenario: Scenario, time: float | Array, radius: Array) -> Array:
    """Return the tensile load of the contact [N] if the control makes it, else nothing."""
    if not scenario.contact.makes_load:
        return np.empty((*radius.shape[:-1], 0))
    return -scenario.contact.control(time, scenario.times.duration).normal_load(
        radius, scenario.bodies
    )


def pack(state: State) -> Arrays:
    """Return a state as named arrays, ``{"bonds.bound": ...}``; ``unpack`` is the inverse."""
    return dict(_named(state))


def _named(state: tuple[object, ...]) -> Iterator[tuple[str, Array]]:
    """Yield the arrays of a state with their names; names in a nested state are dotted."""
    for name, value in zip(get_type_hints(type(state)), state, strict=True):
        if isinstance(value, tuple):
            yield from ((f"{name}.{inner}", array) for inner, array in _named(value))
        else:
            yield name, np.array(value)


def unpack(scenario: Scenario, arrays: Arrays) -> State:
    """Return the state of a scenario from the arrays of ``pack``."""
    kinds = {name: part.state_class for name, part in scenario.parts._asdict().items()}
    kinds |= {"bonding": Bonding, "events": events.Events}
    inner = (_assembled(kinds[name], arrays, name) for name in State._fields[1:])
    return State(*cast(State, (int(arrays["step"]), *inner)))


def _assembled(kind: type, arrays: Arrays, path: str) -> object:
    """Return the state whose arrays have names under a dotted path."""
    hints = {f"{path}.{name}": hint for name, hint in get_type_hints(kind).items()}
    return kind(
        *(
            arrays[key] if key in arrays else _assembled(hint, arrays, key)
            for key, hint in hints.items()
        )
    )
