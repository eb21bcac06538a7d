"""The engine: in which order the parts act in one step. It knows no physics of its own.

drive → speed → bonds → fraction, stress → shear → ΔΓ → w = Δγ(fraction) − χ ΔΓ → contact → radius.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from sim.numerics.noise import Noise
from sim.parts.bonds import STATES
from sim.parts.bonds.tracked import Tracks
from sim.parts.contact.balance import Balance, Touch
from sim.parts.exchange import Motion
from sim.parts.shear.process import Fluctuation
from sim.scenario.scenario import Scenario


@dataclass(frozen=True)
class State:
    """Everything a batch of members needs to go on, at the end of one step.

    Arrays have the member as first axis, or length 1 there where all members agree.
    """

    step: int
    position: np.ndarray
    speed: np.ndarray
    bonds: Any
    shear: Fluctuation
    contact: Touch


@dataclass(frozen=True)
class Dice:
    """The addressed noise of each part for one batch of members."""

    bonds: Noise
    shear: Noise

    @classmethod
    def of(cls, seed: int, members: np.ndarray) -> "Dice":
        return cls(Noise(seed, "bonds", members), Noise(seed, "shear", members))


def start(scenario: Scenario, dice: Dice) -> State:
    """The state at t = 0."""
    motion = scenario.drive.motion(0, 0.0, 0.0, scenario.clock.duration)
    population: Any = scenario.population  # each depth knows its own state
    bonds = population.start(motion, dice.bonds)
    shear = scenario.process.start(motion, population.traction(bonds), dice.shear)
    contact = scenario.contact.start(motion, scenario.clock.duration, _balance(scenario, bonds, shear))
    return State(0, np.zeros(1), motion.speed, bonds, shear, contact)


def advance(scenario: Scenario, state: State, dice: Dice) -> State:
    """The state one clock step later."""
    motion = _motion(scenario, state.step + 1)
    population: Any = scenario.population
    over = population.over(state.bonds, state.contact.radius)
    bonds = population.advance(over, motion, dice.bonds)
    shear = scenario.process.advance(state.shear, motion, population.traction(bonds), dice.shear)
    balance = _balance(scenario, bonds, shear)
    contact = scenario.contact.advance(state.contact, motion, scenario.clock.duration, balance)
    return State(motion.step, state.position + motion.slip, motion.speed, bonds, shear, contact)


def march(scenario: Scenario, members: np.ndarray, state: State | None = None, keep: bool = True) -> Iterator[State]:
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
        Whether a state stays good after the next has been asked for. Without it large arrays (those of
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
    while state.step < scenario.clock.steps:
        state = advance(scenario, _copied(state) if keep else state, dice)
        yield state


def _copied(state: State) -> State:
    """The state with bonds of its own, so that the next step leaves those it was made from alone."""
    if not isinstance(state.bonds, Tracks):
        return state
    return replace(state, bonds=Tracks(*(getattr(state.bonds, item.name).copy() for item in fields(Tracks))))


def _motion(scenario: Scenario, step: int) -> Motion:
    clock = scenario.clock
    return scenario.drive.motion(step, clock.time(step - 1), clock.time(step), clock.duration)


def _balance(scenario: Scenario, bonds: Any, shear: Fluctuation) -> Balance:
    """What w = Δγ(bond fraction) − χ ΔΓ − α 6τ0²a/(πE*) is made of."""
    population = scenario.population
    bonded = scenario.adhesion.work_of_bonds(population.fraction(bonds))
    fluctuating = scenario.fluctuations.paid_by_adhesion * shear.energy
    stress, reference = population.shear_stress(bonds), scenario.adhesion.work
    return Balance(bonded, fluctuating, stress, scenario.margin, scenario.bodies, reference)


def pack(state: Any, prefix: str = "") -> dict[str, np.ndarray]:
    """A state as named arrays, ``{"bonds.bound": ...}``, from which ``unpack`` makes it again."""
    arrays: dict[str, np.ndarray] = {}
    for item in fields(state):
        value = getattr(state, item.name)
        if is_dataclass(value):
            arrays |= pack(value, f"{prefix}{item.name}.")
        else:
            arrays[prefix + item.name] = np.array(value)
    return arrays


def unpack(arrays: dict[str, np.ndarray]) -> State:
    """The state that ``pack`` took apart."""
    parts: dict[str, dict[str, np.ndarray]] = {"bonds": {}, "shear": {}, "contact": {}}
    for name, array in arrays.items():
        part, _, rest = name.partition(".")
        if rest:
            parts[part][rest] = array
    names = {key.partition(".")[0] for key in parts["bonds"]}
    kind = next(kind for kind in STATES if {item.name for item in fields(kind)} == names)
    return State(
        int(arrays["step"]),
        arrays["position"],
        arrays["speed"],
        _assembled(kind, parts["bonds"]),
        _assembled(Fluctuation, parts["shear"]),
        _assembled(Touch, parts["contact"]),
    )


def _assembled(kind: Any, arrays: dict[str, np.ndarray]) -> Any:
    """A state of a part from its arrays, those of a state inside it by dotted names."""
    values = {}
    for item in fields(kind):
        inner = {key.partition(".")[2]: array for key, array in arrays.items() if key.startswith(f"{item.name}.")}
        values[item.name] = _assembled(item.type, inner) if inner else arrays[item.name]
    return kind(**values)
