"""Bond populations without a stretch. Simple to full: none, steady, rate, counted.

Their strength is ``stress`` times the fraction of bonds; their shear stress is ± that, with the sign of the last slip.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.laws.schallamach import relax_fraction, steady_fraction, transition_probabilities
from sim.numerics.binomial import binomial_numbers
from sim.numerics.noise import Noise
from sim.parts.bonds.area import UNSEEN, Area, OverArea, kept
from sim.parts.exchange import Bonding, Motion, Setting
from sim.units.quantity import Quantity

Stress = Annotated[float, Quantity("Pa", "shear stress with all bonds of rest bound", "tau_0", at_least=0)]
CriticalSpeed = Annotated[float, Quantity("m/s", "critical speed of the bonds", "V_c", above=0)]
Rebinding = Annotated[float, Quantity("1/s", "rate at which a free site binds", "h", above=0)]
Start = Annotated[
    Literal["steady", "bonded", "empty"],
    Field(alias="start", description="bonds at the start, bonded being those of rest"),
]
Sites = Annotated[int, Quantity("1", "number of bond sites of the contact", at_least=1, at_most=10**9, whole=True)]


class Population(NamedTuple):
    """State of a population.

    Attributes
    ----------
    bound : array
        Fraction [1] or number of bonds.
    sense : array
        Sign of the last slip: 1, -1, or 0 before any.
    seen : array
        Contact radius [m] whose area the fraction refers to, nan as long as it does not matter.
    """

    bound: np.ndarray
    sense: np.ndarray
    seen: np.ndarray = UNSEEN


class _WithoutStretch:
    """Attributes of all models without a stretch: their strength is proportional to the fraction."""

    state_class: ClassVar[type[Population]] = Population
    stretched: ClassVar[bool] = False
    knows_forces: ClassVar[bool] = False
    numbers: ClassVar[int] = 1
    stress: float

    @property
    def per_member(self) -> bool:
        return False

    @property
    def feeds_back(self) -> bool:
        return False

    @property
    def carries_stress(self) -> bool:
        """Whether there is a shear stress at all."""
        return self.stress > 0.0

    def bonding(self, state: Population) -> Bonding:
        strength = self.stress * state.bound
        return Bonding(state.bound, state.sense * strength, strength)

    def copied(self, state: Population) -> Population:
        return state

    def steady(self, speed: np.ndarray) -> Bonding:
        strength = self.stress * self._steady_fraction(speed)
        return Bonding(self._steady_fraction(speed), np.sign(speed) * strength, strength)

    def _steady_fraction(self, speed: np.ndarray) -> np.ndarray:
        return np.ones(1)

    def chosen(self, area: float, forces: bool) -> Self:
        return self

    def why(self, area: float, forces: bool) -> str:
        return ""

    def followed(self, speeds: np.ndarray, step: float) -> float:
        return 0.0

    def remarks(self, setting: Setting) -> list[str]:
        return []


def _sense(motion: Motion, before: np.ndarray) -> np.ndarray:
    """Sign of the last slip at the end of a step: that of the speed, of the step's slip once it has stopped."""
    moved = np.where(motion.slip == 0.0, before, motion.slip)
    return np.sign(np.where(motion.speed == 0.0, moved, motion.speed))


_STILL = np.zeros(1)


@dataclass(frozen=True, config={"extra": "forbid"})
class Unbroken(_WithoutStretch):
    """Every bond of the contact at rest stays; the paper's uniform sliding stress."""

    stress: Stress = 0.0
    model: Literal["none"] = "none"

    start_from: ClassVar[str] = "steady"
    area: ClassVar[str] = "present"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(np.ones(1), _sense(motion, _STILL))

    def advance(self, state: Population, motion: Motion, radius: np.ndarray, noise: Noise) -> Population:
        return state._replace(sense=_sense(motion, state.sense))


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_WithoutStretch):
    """The paper's law N/N0 = 1/(1 + V/Vc), at once at every speed. Limit: none as Vc -> infinity."""

    critical_speed: CriticalSpeed
    stress: Stress = 0.0
    model: Literal["steady"] = "steady"

    start_from: ClassVar[str] = "steady"
    area: ClassVar[str] = "present"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(self._steady_fraction(motion.speed), _sense(motion, _STILL))

    def advance(self, state: Population, motion: Motion, radius: np.ndarray, noise: Noise) -> Population:
        return Population(self._steady_fraction(motion.speed), _sense(motion, state.sense))

    def _steady_fraction(self, speed: np.ndarray) -> np.ndarray:
        return np.asarray(steady_fraction(speed, self.critical_speed))


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Rate(OverArea, _WithoutStretch):
    """The rate equation dN/dt = h (N0 − N) − h (V/Vc) N. Limit: ``Steady`` as h -> infinity.

    One step is exact for the slip of the step spread evenly over it.
    """

    critical_speed: CriticalSpeed
    rebinding_rate: Rebinding
    stress: Stress = 0.0
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["rate"] = "rate"

    def start(self, motion: Motion, noise: Noise) -> Population:
        first = self.rows(noise) * _first_fraction(self.start_from, motion, self.critical_speed)
        return Population(first, _sense(motion, _STILL))

    def advance(self, state: Population, motion: Motion, radius: np.ndarray, noise: Noise) -> Population:
        bound, sense, seen = self.over(state, radius)
        bound = relax_fraction(bound, motion.path, motion.duration, self.critical_speed, self.rebinding_rate)
        return Population(np.asarray(bound), _sense(motion, sense), seen)

    def over(self, state: Population, radius: np.ndarray) -> Population:
        """The population over a contact of this radius [m], nan where it is open."""
        if self.area == "present":
            return state
        share, seen = kept(state.seen, radius)
        return state._replace(bound=state.bound * share, seen=seen)

    def bonding(self, state: Population) -> Bonding:
        bonding = super().bonding(state)
        return bonding._replace(stiffness=-self.rebinding_rate / self.critical_speed * bonding.strength)

    def _steady_fraction(self, speed: np.ndarray) -> np.ndarray:
        return np.asarray(steady_fraction(speed, self.critical_speed))


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Counted(_WithoutStretch):
    """A finite number of two-state sites with the rates of ``Rate``. Limit: ``Rate`` as sites -> infinity.

    Notes
    -----
    Over a step each bound site stays bound with probability p and each free one binds with
    probability r, both exact, so the next number is Binomial(n, p) + Binomial(sites − n, r). Each
    binomial is the inverse of its distribution function at one addressed uniform number: two
    numbers a step whatever the state, and members keep their noise across sweep values.
    """

    critical_speed: CriticalSpeed
    rebinding_rate: Rebinding
    sites: Sites
    stress: Stress = 0.0
    start_from: Start = "steady"
    model: Literal["counted"] = "counted"

    area: ClassVar[str] = "present"

    @property
    def per_member(self) -> bool:
        return True

    def bonding(self, state: Population) -> Bonding:
        return super().bonding(state._replace(bound=state.bound / self.sites))

    def start(self, motion: Motion, noise: Noise) -> Population:
        first = _first_fraction(self.start_from, motion, self.critical_speed)
        uniform = noise.uniforms(motion.step, 2)
        return Population(_binomial(uniform[:, 0], np.array([float(self.sites)]), first), _sense(motion, _STILL))

    def advance(self, state: Population, motion: Motion, radius: np.ndarray, noise: Noise) -> Population:
        stay, bind = transition_probabilities(motion.path, motion.duration, self.critical_speed, self.rebinding_rate)
        uniform = noise.uniforms(motion.step, 2)
        kept = _binomial(uniform[:, 0], state.bound, stay)
        bound = kept + _binomial(uniform[:, 1], self.sites - state.bound, bind)
        return Population(bound, _sense(motion, state.sense))

    def _steady_fraction(self, speed: np.ndarray) -> np.ndarray:
        return np.asarray(steady_fraction(speed, self.critical_speed))


def _first_fraction(start: str, motion: Motion, critical_speed: float) -> np.ndarray:
    if start == "steady":
        return np.asarray(steady_fraction(motion.speed, critical_speed))
    return np.full(1, 1.0 if start == "bonded" else 0.0)


def _binomial(uniform: np.ndarray, number: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """Binomial numbers by inversion at ``uniform`` in [0, 1), as floats of shape (members,)."""
    # a uniform of 0, whose inverse is 0 whatever the chance, counts as the smallest number above it
    return binomial_numbers(np.maximum(uniform, 2.0**-54), number, probability)
