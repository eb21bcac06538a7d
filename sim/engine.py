"""The engine: in which order the parts act in one step; it holds no physics of its own.

drive → speed → bonds → fraction, stress → shear → ΔΓ → w = Δγ(fraction) − χ ΔΓ → contact → radius.
"""

from collections.abc import Iterator
from copy import deepcopy
from typing import NamedTuple, cast, get_type_hints

import numpy as np

from sim.numerics.noise import Noise
from sim.parts import extremes
from sim.parts.contact.balance import Balance
from sim.parts.exchange import NO_RESISTANCE, Array, Bonding, Indices, Sliding, Storing, Touching
from sim.scenario.scenario import Scenario

Arrays = dict[str, Array]
_NONE = np.zeros(1)


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
    contact: Touching
    extremes: extremes.Extremes


class Dice(NamedTuple):
    """The addressed noise of each part for one batch of members."""

    bonds: Noise
    shear: Noise

    @classmethod
    def of(cls, seed: int, members: Indices) -> "Dice":
        return cls(Noise(seed, "bonds", members), Noise(seed, "shear", members))


def start(scenario: Scenario, dice: Dice) -> State:
    """The state at t = 0."""
    drive, population, process, contact = scenario.parts
    slider, motion = drive.begin(scenario.times)
    bonds = population.start(motion, dice.bonds)
    bonding = population.bonding(bonds)
    shear = process.start(motion, bonding, dice.shear)
    touch = contact.start(motion, scenario.times.duration, balance(scenario, bonding, shear))
    largest = extremes.first(bonding, touch.radius, _pull(scenario, touch, 0))
    return State(0, slider, bonds, bonding, shear, touch, largest)


def advance(scenario: Scenario, state: State, dice: Dice) -> State:
    """The state one clock step later."""
    drive, population, process, contact = scenario.parts
    step, times = state.step + 1, scenario.times
    slider, motion = drive.advance(state.drive, NO_RESISTANCE, times, step)
    bonds = population.advance(state.bonds, motion, state.contact.radius, dice.bonds)
    bonding = population.bonding(bonds)
    shear = process.advance(state.shear, motion, bonding, dice.shear)
    touch = contact.advance(state.contact, motion, times.duration, balance(scenario, bonding, shear))
    ends, radii = (state.bonding, bonding), (state.contact.radius, touch.radius)
    largest = extremes.after(state.extremes, ends, radii, _pull(scenario, touch, step), motion)
    return State(step, slider, bonds, bonding, shear, touch, largest)


def march(scenario: Scenario, members: Indices, state: State | None = None, keep: bool = True) -> Iterator[State]:
    """Advance a batch of members to the end of the run, yielding the state after every step.

    Parameters
    ----------
    scenario : Scenario
        One point; its sweep is not looked at.
    members : array of int, shape (members,)
        Absolute numbers of the members, which address their noise.
    state : State, optional
        Where to go on from; without it the march starts at t = 0 and yields that state first.
    keep : bool
        Whether a state stays good after the next one is made. Without it large arrays (those of
        tracked bonds) are handed on from state to state, which saves a copy of them at each step.

    Yields
    ------
    State
        The same numbers, bit for bit, for any batch and after any restart.
    """
    dice = Dice.of(scenario.seed, members)
    if state is None:
        state = start(scenario, dice)
        yield state
    while state.step < scenario.times.steps:
        if keep and scenario.parts.bonds.in_place:
            state = state._replace(bonds=deepcopy(state.bonds))
        state = advance(scenario, state, dice)
        yield state


def balance(scenario: Scenario, bonding: Bonding, shear: Storing) -> Balance:
    """The terms of the effective work of adhesion w = Δγ(bond fraction) − χ ΔΓ − α 6τ0²a/(πE*)."""
    bonded = scenario.adhesion.work_of_bonds(bonding.fraction)
    fluctuating = scenario.fluctuations.paid_by_adhesion * shear.energy
    return Balance(bonded, fluctuating, bonding.strength, scenario.margin, scenario.bodies, scenario.adhesion.work)


def _pull(scenario: Scenario, touch: Touching, step: int) -> Array:
    """Tensile load of the contact [N], where the control makes it."""
    if not scenario.contact.makes_load:
        return _NONE
    control = scenario.contact.control(scenario.times.at(step), scenario.times.duration)
    return -control.normal_load(touch.radius, scenario.bodies)


def pack(state: State) -> Arrays:
    """A state as named arrays, ``{"bonds.bound": ...}``, from which ``unpack`` makes it again."""
    return dict(_named(state))


def _named(state: tuple[object, ...]) -> Iterator[tuple[str, Array]]:
    """The arrays of a state with their names, those of a state inside it with a dotted one."""
    for name, value in zip(get_type_hints(type(state)), state, strict=True):
        if isinstance(value, tuple):
            yield from ((f"{name}.{inner}", array) for inner, array in _named(value))
        else:
            yield name, np.array(value)


def unpack(scenario: Scenario, arrays: Arrays) -> State:
    """The state of a scenario that ``pack`` took apart."""
    kinds = {name: part.state_class for name, part in scenario.parts._asdict().items()}
    kinds |= {"bonding": Bonding, "extremes": extremes.Extremes}
    inner = {name: _assembled(kind, _within(arrays, name)) for name, kind in kinds.items()}
    return State(*cast(State, (int(arrays["step"]), *(inner[name] for name in State._fields[1:]))))


def _assembled(kind: type, arrays: Arrays) -> tuple[object, ...]:
    """A state of a part from its arrays."""
    inner = {name: (hint, _within(arrays, name)) for name, hint in get_type_hints(kind).items()}
    values = {name: _assembled(*found) if found[1] else arrays[name] for name, found in inner.items()}
    made: tuple[object, ...] = kind(**values)
    return made


def _within(arrays: Arrays, name: str) -> Arrays:
    """The arrays of what stands under a name."""
    return {key.removeprefix(f"{name}."): array for key, array in arrays.items() if key.startswith(f"{name}.")}
