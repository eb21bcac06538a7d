"""Bond populations without a stretch. Shallow to deep: none, steady, rate, counted.

``fraction`` is bonds over bonds at rest; their shear stress is ``stress`` times the fraction.
"""

from dataclasses import dataclass as plain_dataclass
from dataclasses import field, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.laws.schallamach import relax_fraction, steady_fraction, transition_probabilities
from sim.numerics.binomial import binomial_numbers
from sim.numerics.noise import Noise
from sim.parts.bonds.area import Area, OverArea
from sim.parts.exchange import Motion, Traction
from sim.units.quantity import Quantity

Stress = Annotated[float, Quantity("Pa", "shear stress with all bonds of rest bound", "tau_0", at_least=0)]
CriticalSpeed = Annotated[float, Quantity("m/s", "critical speed of the bonds", "V_c", above=0)]
Rebinding = Annotated[float, Quantity("1/s", "rate at which a free site binds", "h", above=0)]
Start = Annotated[
    Literal["steady", "bonded", "empty"],
    Field(alias="start", description="bonds at the start, bonded being those of rest"),
]
Sites = Annotated[int, Field(ge=1, le=10**9, description="number of bond sites of the contact")]


@plain_dataclass(frozen=True)
class Population:
    """State of a population: ``bound`` is a fraction [1] or a number of bonds, per member.

    ``seen`` is the contact radius [m] whose area the fraction refers to, nan as long as it does not matter.
    """

    bound: np.ndarray
    seen: np.ndarray = field(default_factory=lambda: np.full(1, np.nan))


class _WithoutStretch:
    """What all depths without a stretch share: the stress follows the fraction."""

    per_member: ClassVar[Any] = False
    knows_forces: ClassVar[bool] = False
    numbers: ClassVar[int] = 1
    stress: float

    @property
    def carries_stress(self) -> bool:
        """Whether there is a shear stress at all."""
        return self.stress > 0.0

    def fraction(self, population: Population) -> np.ndarray:
        """Bonds over bonds at rest [1]."""
        return population.bound

    def shear_stress(self, population: Population) -> np.ndarray:
        """Mean shear stress tau_0 that the bonds carry [Pa]."""
        return self.stress * self.fraction(population)

    def traction(self, population: Population) -> Traction:
        """What the shear part is told."""
        return Traction.of_stress(self.shear_stress(population))

    def settled(self, speed: np.ndarray) -> Traction:
        """What steady sliding at a speed [m/s] hands to the shear part."""
        critical_speed = getattr(self, "critical_speed", np.inf)
        return Traction.of_stress(self.stress * np.asarray(steady_fraction(speed, critical_speed)))

    def over(self, population: Population, radius: np.ndarray) -> Population:
        """The population over the contact as it is now."""
        return population


@dataclass(frozen=True, config={"extra": "forbid"})
class Unbroken(_WithoutStretch):
    """Every bond of the contact at rest stays; the paper's uniform sliding stress."""

    stress: Stress = 0.0
    model: Literal["none"] = "none"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(np.ones(1))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        return population


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_WithoutStretch):
    """The paper's law N/N0 = 1/(1 + V/Vc), at once at every speed. Limit: none as Vc -> infinity."""

    critical_speed: CriticalSpeed
    stress: Stress = 0.0
    model: Literal["steady"] = "steady"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(np.asarray(steady_fraction(motion.speed, self.critical_speed)))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        return self.start(motion, noise)


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
        return Population(self.rows(noise) * _first_fraction(self.start_from, motion, self.critical_speed))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        bound = relax_fraction(population.bound, motion.path, motion.duration, self.critical_speed, self.rebinding_rate)
        return replace(population, bound=np.asarray(bound))

    def diluted(self, population: Population, share: np.ndarray) -> Population:
        return replace(population, bound=population.bound * share)


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

    per_member: ClassVar[bool] = True

    critical_speed: CriticalSpeed
    rebinding_rate: Rebinding
    sites: Sites
    stress: Stress = 0.0
    start_from: Start = "steady"
    model: Literal["counted"] = "counted"

    def fraction(self, population: Population) -> np.ndarray:
        return population.bound / self.sites

    def start(self, motion: Motion, noise: Noise) -> Population:
        first = _first_fraction(self.start_from, motion, self.critical_speed)
        uniform = noise.uniforms(motion.step, 2)
        return Population(_binomial(uniform[:, 0], np.array([float(self.sites)]), first))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        stay, bind = transition_probabilities(motion.path, motion.duration, self.critical_speed, self.rebinding_rate)
        uniform = noise.uniforms(motion.step, 2)
        kept = _binomial(uniform[:, 0], population.bound, stay)
        return Population(kept + _binomial(uniform[:, 1], self.sites - population.bound, bind))


def _first_fraction(start: str, motion: Motion, critical_speed: float) -> np.ndarray:
    if start == "steady":
        return np.asarray(steady_fraction(motion.speed, critical_speed))
    return np.full(1, 1.0 if start == "bonded" else 0.0)


def _binomial(uniform: np.ndarray, number: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """Binomial numbers by inversion at ``uniform`` in [0, 1), as floats of shape (members,)."""
    # a uniform of 0, whose inverse is 0 whatever the chance, counts as the smallest number above it
    return binomial_numbers(np.maximum(uniform, 2.0**-54), number, probability)
