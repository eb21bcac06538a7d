"""Bond populations: the fraction of adhesive bonds left while sliding. Shallow to deep: none, steady, rate, counted.

``fraction`` is bonds over bonds at rest. These depths carry no stretch, so their shear stress is
``stress`` times the fraction.
"""

from dataclasses import dataclass as plain_dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.laws.schallamach import relax_fraction, steady_fraction, transition_probabilities
from sim.motion import Motion
from sim.noise import Noise
from sim.quantity import Quantity

_Stress = Annotated[float, Quantity("Pa", "shear stress with all bonds of rest bound", "tau_0", at_least=0)]
_CriticalSpeed = Annotated[float, Quantity("m/s", "critical speed of the bonds", "V_c", above=0)]
_Healing = Annotated[float, Quantity("1/s", "healing rate of broken bonds", "h", above=0)]
_Start = Literal["steady", "bonded", "empty"]


@plain_dataclass(frozen=True)
class Population:
    """State of a population: ``bound`` is a fraction [1] or a number of bonds, per member."""

    bound: np.ndarray


class _WithoutStretch:
    """What all depths without a stretch share: the stress follows the fraction."""

    per_member: ClassVar[bool] = False
    stress: float

    def fraction(self, population: Population) -> np.ndarray:
        """Bonds over bonds at rest [1]."""
        return population.bound

    def shear_stress(self, population: Population) -> np.ndarray:
        """Mean shear stress tau_0 that the bonds carry [Pa]."""
        return self.stress * self.fraction(population)


@dataclass(frozen=True, config={"extra": "forbid"})
class Unbroken(_WithoutStretch):
    """Every bond of the contact at rest stays; the paper's uniform sliding stress."""

    stress: _Stress = 0.0
    model: Literal["none"] = "none"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(np.ones(1))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        return population


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_WithoutStretch):
    """The paper's law N/N0 = 1/(1 + V/Vc), at once at every speed. Limit: none as Vc -> infinity."""

    critical_speed: _CriticalSpeed
    stress: _Stress = 0.0
    model: Literal["steady"] = "steady"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(np.asarray(steady_fraction(motion.speed, self.critical_speed)))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        return self.start(motion, noise)


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Rate(_WithoutStretch):
    """The rate equation dN/dt = h (N0 − N) − h (V/Vc) N. Limit: ``Steady`` as h -> infinity.

    One step is exact for the slip of the step spread evenly over it.
    """

    critical_speed: _CriticalSpeed
    healing: _Healing
    stress: _Stress = 0.0
    start_from: Annotated[_Start, Field(alias="start")] = "steady"
    model: Literal["rate"] = "rate"

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(_first_fraction(self.start_from, motion, self.critical_speed))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        return Population(
            np.asarray(
                relax_fraction(population.bound, motion.path, motion.duration, self.critical_speed, self.healing)
            )
        )


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

    critical_speed: _CriticalSpeed
    healing: _Healing
    sites: Annotated[int, Field(ge=1, le=10**9, description="number of bond sites of the contact")]
    stress: _Stress = 0.0
    start_from: Annotated[_Start, Field(alias="start")] = "steady"
    model: Literal["counted"] = "counted"

    def fraction(self, population: Population) -> np.ndarray:
        return population.bound / self.sites

    def start(self, motion: Motion, noise: Noise) -> Population:
        first = _first_fraction(self.start_from, motion, self.critical_speed)
        uniform = noise.uniforms(motion.step, 2)
        return Population(_binomial(uniform[:, 0], np.array([float(self.sites)]), first))

    def advance(self, population: Population, motion: Motion, noise: Noise) -> Population:
        stay, bind = transition_probabilities(motion.path, motion.duration, self.critical_speed, self.healing)
        uniform = noise.uniforms(motion.step, 2)
        kept = _binomial(uniform[:, 0], population.bound, stay)
        return Population(kept + _binomial(uniform[:, 1], self.sites - population.bound, bind))


def _first_fraction(start: str, motion: Motion, critical_speed: float) -> np.ndarray:
    if start == "steady":
        return np.asarray(steady_fraction(motion.speed, critical_speed))
    return np.full(1, 1.0 if start == "bonded" else 0.0)


def _binomial(uniform: np.ndarray, number: np.ndarray, probability: np.ndarray) -> np.ndarray:
    """Binomial numbers by inversion at ``uniform`` in [0, 1), as floats of shape (members,)."""
    from scipy.stats import binom  # heavy, and only counted bonds draw

    uniform, number, probability = np.broadcast_arrays(uniform, number, probability)
    # binom.ppf(0) is -1 by convention, so a uniform of 0 counts as the smallest above it
    drawn = binom.ppf(np.maximum(uniform, 2.0**-54), number, np.clip(probability, 0.0, 1.0))
    return np.where(number > 0, np.clip(drawn, 0.0, number), 0.0)


Bonds = Annotated[Unbroken | Steady | Rate | Counted, Field(discriminator="model")]
