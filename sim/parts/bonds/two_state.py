"""Bond populations without a stretch. Simple to full: none, steady, rate, counted.

Their strength is ``stress`` times the fraction of bonds; their shear stress is ± that, with the sign of the last slip.
"""

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.laws.schallamach import Body, Onset, linear_onset, steady_fraction, transition_probabilities
from sim.laws.schallamach.linear import relaxed
from sim.numerics.binomial import binomial
from sim.numerics.jit import kernel
from sim.numerics.noise import Noise, stream
from sim.parts.bonds.area import UNSEEN, Area, Common, OverArea
from sim.parts.exchange import Array, Bonding, Motion, Motions
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

    bound: Array
    sense: Array
    seen: Array = UNSEEN


class _WithoutStretch(Common):
    """Attributes of all models without a stretch: their strength is proportional to the fraction."""

    state_class: ClassVar[type[Population]] = Population
    stretched: ClassVar[bool] = False
    knows_forces: ClassVar[bool] = False
    critical_speed: float
    stress: float

    @property
    def carries_stress(self) -> bool:
        """True if there is a shear stress at all."""
        return self.stress > 0.0

    def advance(self, state: Population, motions: Motions, radius: Array, noise: Noise) -> tuple[Population, Bonding]:
        bound, seen = self._bound(state, motions, radius, noise)
        sense = np.empty(motions.slip.shape)
        _last_signs(motions.speed, motions.slip, state.sense, sense)
        return Population(bound[-1], sense[-1], seen), self.bonding(Population(bound, sense))

    def _bound(self, state: Population, motions: Motions, radius: Array, noise: Noise) -> tuple[Array, Array]:
        """Bonds at the end of each step, shape (steps, 1) or (steps, members), and the contact radius seen."""
        raise NotImplementedError

    def bonding(self, state: Population) -> Bonding:
        strength = self.stress * state.bound
        return Bonding(state.bound, state.sense * strength, strength)

    def onset(self, speed: Array, body: Body) -> Onset:
        """Onset of oscillations behind a spring at speeds [m/s], nan where none is known."""
        return Onset(*np.full((2, *speed.shape), np.nan))

    def steady(self, speed: Array) -> Bonding:
        fraction = self._steady_fraction(speed)
        return Bonding(fraction, np.sign(speed) * (self.stress * fraction), self.stress * fraction)

    def _steady_fraction(self, speed: Array) -> Array:
        return np.asarray(steady_fraction(speed, self.critical_speed))

    def _first_fraction(self, start: str, motion: Motion) -> Array:
        if start == "steady":
            return self._steady_fraction(motion.speed)
        return np.full(1, 1.0 if start == "bonded" else 0.0)


@kernel("void(float64[:, :], float64[:, :], float64[:], float64[:, ::1])")
def _last_signs(speed, slip, first, sense):
    """Sign of the last slip at the end of each step: that of the speed, of the step's slip once it has stopped."""
    for m in range(sense.shape[1]):
        last = first[m]
        for k in range(len(sense)):
            last = speed[k, m] if speed[k, m] != 0.0 else slip[k, m] if slip[k, m] != 0.0 else last
            sense[k, m] = last = np.sign(last)


@kernel("void(float64[::1], float64[:], float64[:], float64, float64, float64[:, ::1])")
def _relax(bound, path, duration, critical_speed, rebinding_rate, relaxed_bound):
    """Bond fractions at the end of each step, those before being ``bound``."""
    for k in range(len(path)):
        for m in range(len(bound)):
            before = bound[m] if k == 0 else relaxed_bound[k - 1, m]
            relaxed_bound[k, m] = relaxed(before, path[k], duration[k], critical_speed, rebinding_rate)


class _AtOnce(_WithoutStretch):
    """Bonds that are steady at every speed."""

    in_blocks: ClassVar[bool] = True

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(self._steady_fraction(motion.speed), np.sign(motion.speed))

    def _bound(self, state: Population, motions: Motions, radius: Array, noise: Noise) -> tuple[Array, Array]:
        return self._steady_fraction(motions.speed), state.seen


@dataclass(frozen=True, config={"extra": "forbid"})
class Unbroken(_AtOnce):
    """Every bond of the contact at rest stays; the paper's uniform sliding stress."""

    stress: Stress = 0.0
    model: Literal["none"] = "none"

    def _steady_fraction(self, speed: Array) -> Array:
        return np.ones(speed.shape)


@dataclass(frozen=True, config={"extra": "forbid"})
class Steady(_AtOnce):
    """The paper's law N/N0 = 1/(1 + V/Vc), at once at every speed. Limit: none as Vc -> infinity."""

    critical_speed: CriticalSpeed
    stress: Stress = 0.0
    model: Literal["steady"] = "steady"


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

    in_blocks: ClassVar[bool] = True

    def start(self, motion: Motion, noise: Noise) -> Population:
        rows = self.rows(noise) + 0.0 * motion.speed  # a drive that feels the friction has its members
        first = rows * self._first_fraction(self.start_from, motion)
        return Population(first, np.sign(motion.speed))

    def onset(self, speed: Array, body: Body) -> Onset:
        drag, strength = np.multiply(body.viscosity, body.area), self.stress * np.asarray(body.area)
        viscous = drag * np.abs(speed) / (strength * self._steady_fraction(speed))  # grows with the area, too
        recipe = self.critical_speed, self.rebinding_rate, strength, body.damping + drag
        growth = np.add(body.area_growth, body.stress_growth) * (1.0 + viscous)
        return linear_onset(speed, *recipe, body.mass, growth)

    def _bound(self, state: Population, motions: Motions, radius: Array, noise: Noise) -> tuple[Array, Array]:
        share, seen = self.kept(state.seen, radius)
        before = state.bound * share
        bound, rates = np.empty((len(motions.path), len(before))), (self.critical_speed, self.rebinding_rate)
        _relax(before, motions.path[:, 0], motions.duration[:, 0], *rates, bound)
        return bound, seen

    def bonding(self, state: Population) -> Bonding:
        bonding = super().bonding(state)
        return bonding._replace(stiffness=-self.rebinding_rate / self.critical_speed * bonding.strength)


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Counted(_WithoutStretch):
    """A finite number of two-state sites with the rates of ``Rate``. Limit: ``Rate`` as sites -> infinity.

    Notes
    -----
    Over a step each bound site stays bound with probability p and each free one binds with
    probability r, both exact, so the next number is Binomial(n, p) + Binomial(sites − n, r).
    """

    critical_speed: CriticalSpeed
    rebinding_rate: Rebinding
    sites: Sites
    stress: Stress = 0.0
    start_from: Start = "steady"
    model: Literal["counted"] = "counted"

    @property
    def per_member(self) -> bool:
        return True

    def bonding(self, state: Population) -> Bonding:
        return super().bonding(state._replace(bound=state.bound / self.sites))

    def start(self, motion: Motion, noise: Noise) -> Population:
        bound = np.zeros(len(noise.members))
        first = self._first_fraction(self.start_from, motion)[np.newaxis]
        return Population(self._counted(bound, first, first, motion.step, noise)[0], np.sign(motion.speed))

    def _bound(self, state: Population, motions: Motions, radius: Array, noise: Noise) -> tuple[Array, Array]:
        over = motions.path, motions.duration
        stay, bind = transition_probabilities(*over, self.critical_speed, self.rebinding_rate)
        return self._counted(state.bound, stay, bind, motions.step, noise), state.seen

    def _counted(self, bound: Array, stay: Array, bind: Array, step: int, noise: Noise) -> Array:
        """Bound sites at the end of each step, in which each bound and free one is bound with given probabilities.

        These have the shape (steps, 1) or (steps, members).
        """
        counted = np.empty((len(stay), len(bound)))
        _count(bound, stay, bind, self.sites, *noise.at(step), counted)
        return counted


@kernel("void(float64[:], float64[:, :], float64[:, :], float64, uint64, uint64, uint64[::1], int64, float64[:, ::1])")
def _count(bound, stay, bind, sites, seed, part, members, step, counted):
    """Bound sites of all members at the end of each step."""
    for m in range(members.size):
        before, own = bound[m], m % stay.shape[1]
        for k in range(len(stay)):
            numbers = stream(seed, part, members[m], step + k, 0)
            kept, numbers = binomial(before, stay[k, own], numbers)
            new, numbers = binomial(sites - before, bind[k, own], numbers)
            counted[k, m] = before = kept + new
