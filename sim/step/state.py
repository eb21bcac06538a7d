"""State of a batch of members at the end of a clock step, and its trajectory over many."""

from collections.abc import Iterator
from typing import NamedTuple, cast, get_type_hints

import numpy as np

from sim.numerics.noise import Noise
from sim.parts.events import Events
from sim.parts.exchange import (
    Array,
    Bonding,
    ContactState,
    Indices,
    Parts,
    Sliding,
    Storing,
)

Arrays = dict[str, Array]


class MemberNoise(NamedTuple):
    """The addressed noise of each part for one batch of members."""

    bonds: Noise
    shear: Noise

    @classmethod
    def of(cls, seed: int, members: Indices) -> "MemberNoise":
        return cls(Noise(seed, "bonds", members), Noise(seed, "shear", members))


class State(NamedTuple):
    """Everything a batch of members needs to go on, at the end of one clock step.

    Arrays have the member as first axis, or length 1 where all members agree. ``bonding``
    is what ``bonds`` hand to the other parts, computed once a step.
    """

    step: int
    drive: Sliding
    bonds: tuple[object, ...]
    bonding: Bonding
    shear: Storing
    contact: ContactState
    events: Events


class Trajectory(NamedTuple):
    """Trajectory of a batch of members, with the time as first axis and the member as second.

    ``time`` [s], ``position`` [m] and ``speed`` [m/s] are those of the slider.
    ``fraction``, ``stress`` and ``strength`` of the bonds are as in ``Bonding``;
    ``energy`` is ΔΓ [J/m²]. ``driven`` has the readings of a drive that solves the
    motion, in columns. ``work`` and the rest are as in ``ContactState``, which has no
    course of turns.
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

    @classmethod
    def of(
        cls,
        time: Array,
        slider: Sliding,
        bonding: Bonding,
        energy: Array,
        driven: Array,
        contact: ContactState,
    ) -> "Trajectory":
        """Return the trajectory of a slider, its bonds, fluctuations and contact at some times."""
        of_bonds = bonding.fraction, bonding.stress, bonding.strength
        return cls(
            time, slider.position, slider.speed, *of_bonds, energy, driven, *contact[:5]
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


def unpack(parts: Parts, arrays: Arrays) -> State:
    """Return the state of some parts from the arrays of ``pack``."""
    kinds = {name: part.state_class for name, part in parts._asdict().items()}
    kinds |= {"bonding": Bonding, "events": Events}
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
