"""Bond populations with a stretch. Simple to full: rate (first moment), cohort, tracked.

Sites of a given density are free or hold a bond that was born unstretched, goes with the slider and
breaks at a rate that depends on its stretch. Their mean force makes the shear stress, so friction
has a maximum, ages and starts with a peak; nothing of that is put in by hand.
"""

from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

import sim.parts.bonds.cohorts as cohorts
import sim.parts.bonds.first_moment as first_moment
import sim.parts.bonds.tracked as tracks
from sim.laws.schallamach import Body, Onset
from sim.numerics.noise import Noise
from sim.parts.bonds.area import UNSEEN, Area, Common, OverArea
from sim.parts.bonds.cohorts import Cohorts
from sim.parts.bonds.rupture import Rupture, RuptureRate
from sim.parts.bonds.tracked import Tracks
from sim.parts.bonds.tracked_step import CYCLES
from sim.parts.bonds.two_state import Start
from sim.parts.exchange import Array, Bonding, Motion, Motions, Setting
from sim.units.quantity import Quantity

Stiffness = Annotated[float, Quantity("N/m", "stiffness of a bond", "kappa", above=0, typical="0.4 mN/m")]
Rebinding = Annotated[float, Quantity("1/s", "rate at which a free site binds", "k_on", above=0, typical="1e5 1/s")]
Density = Annotated[float, Quantity("1/m^2", "bond sites per area", "n", above=0, typical="1e17 1/m^2")]
CohortTolerance = Annotated[float, Quantity("1", "tolerance of the cohorts", "", at_least=1e-12, below=0.1)]


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class _Stretched(Common):
    """Keys and attributes of models with a stretch; a subclass gives the moments of the stretch over all sites."""

    stretched: ClassVar[bool] = True
    knows_forces: ClassVar[bool] = True
    carries_stress: ClassVar[bool] = True

    rupture: Rupture
    bond_stiffness: Stiffness
    rebinding_rate: Rebinding
    site_density: Density

    @cached_property
    def law(self) -> RuptureRate:
        """Rupture rate of a bond of given stretch."""
        return self.rupture.law(self.bond_stiffness)

    @property
    def bound_at_rest(self) -> float:
        """Share of sites that are bound at rest [1]."""
        return self.rebinding_rate / (self.rebinding_rate + self.law.at_rest)

    def onset(self, speed: Array, body: Body) -> Onset:
        """Onset of oscillations behind a spring at speeds [m/s], nan where none is known."""
        recipe = self.bond_stiffness, self.rebinding_rate, self.site_density
        return self.rupture.resolved_onset(speed, *recipe, body)

    def amplitude(self, speed: Array) -> Array | None:
        """Growth of the oscillations beyond their onset at speeds [m/s], where a law is known of it."""
        return None

    def _bonding(self, bound: Array, stretch: Array, square: Array, breaking: Array, lost: Array) -> Bonding:
        """Readings of a population of these moments per site.

        The stress is n κ x̄; with f̄ and E[f²] per site the powers are n f̄² and n (E[f²] − f̄²). Slip stretches all
        bonds and breaks, at a limit ℓ of the stretch, the share ``breaking`` of the sites for each ℓ of slip. Thermal
        rupture takes the stretch ``lost`` per site and unit time.
        """
        frozen, scale = stretch**2, self.site_density * self.bond_stiffness**2
        varying = np.maximum(square - frozen, 0.0)  # nan stays nan
        per_stretch = self.site_density * self.bond_stiffness
        stress = per_stretch * stretch
        fraction = bound / self.bound_at_rest
        stiffness = per_stretch * (bound - breaking)
        relaxation = -per_stretch * lost
        return Bonding(fraction, stress, np.abs(stress), stiffness, relaxation, scale * frozen, scale * varying)


class Stretches(NamedTuple):
    """State of the first-moment equation: share of sites bound [1] and mean stretch per site [m]."""

    bound: Array
    stretch: Array
    seen: Array = UNSEEN


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class _Separable(_Stretched):
    """Models that rest on a rupture law whose ∫k dt has one clock for all bonds."""

    @model_validator(mode="after")
    def _one_clock(self) -> Self:
        if not self.rupture.separable:
            said = f'rupture model "{self.rupture.model}" needs the density of the stretch; use bonds.model = "cohort"'
            raise PydanticCustomError("not_separable", said)
        return self


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class FirstMoment(OverArea, _Separable):
    """Rate equations of number and mean stretch, every bond taken at the mean. Limit: ``Cohort`` at a constant rate.

    Exact in time for a constant rupture. Under Bell's it is a mean field: it overpredicts the friction
    maximum by some 27 to 47 %; ``Cohort`` has no such error.
    """

    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["rate"] = "rate"

    state_class: ClassVar[type[Stretches]] = Stretches
    knows_forces: ClassVar[bool] = False
    in_blocks: ClassVar[bool] = True

    def start(self, motion: Motion, noise: Noise) -> Stretches:
        if self.start_from == "steady":
            bound, stretch = first_moment.steady(motion.first, self.law, self.rebinding_rate)
        else:
            bound = np.full(1, self.bound_at_rest if self.start_from == "bonded" else 0.0)
            stretch = np.zeros(1)
        rows = self.rows(noise) + 0.0 * motion.first  # a drive that feels the friction has its members
        return Stretches(rows * bound, rows * stretch)

    def advance(self, state: Stretches, motions: Motions, radius: Array, noise: Noise) -> tuple[Stretches, Bonding]:
        share, seen = self.kept(state.seen, radius)
        before, slid = (
            (state.bound * share, state.stretch * share),
            (motions.slip, motions.path, motions.duration[:, 0]),
        )
        bound, stretch = first_moment.follow(*before, *slid, self.law, self.rebinding_rate)
        return Stretches(bound[-1], stretch[-1], seen), self.bonding(Stretches(bound, stretch))

    def onset(self, speed: Array, body: Body) -> Onset:
        recipe = self.bond_stiffness, self.rebinding_rate, self.site_density
        return self.rupture.first_moment_onset(speed, *recipe, body)

    def amplitude(self, speed: Array) -> Array:
        return self.rupture.first_moment_amplitude(speed, self.bond_stiffness, self.rebinding_rate)

    def remarks(self, setting: Setting) -> list[str]:
        excess = self.rupture.first_moment_excess(self.bond_stiffness, self.rebinding_rate)
        said = f'the mean stretch overpredicts the friction maximum by {excess:.0%}: bonds.model = "cohort" does not'
        return [said] if excess else []

    def bonding(self, state: Stretches) -> Bonding:
        mean = np.divide(state.stretch, state.bound, out=np.zeros(state.bound.shape), where=state.bound > 0.0)
        breaking, lost = 2.0 * np.abs(state.stretch) / self.law.limit, state.stretch * self.law.at(mean)
        stored = 0.5 * self.site_density * self.bond_stiffness * mean * state.stretch
        return self._bonding(state.bound, state.stretch, _UNKNOWN, breaking, lost)._replace(stored=stored)

    def steady(self, speed: Array) -> Bonding:
        return self.bonding(Stretches(*first_moment.steady(speed, self.law, self.rebinding_rate)))


class Ages(NamedTuple):
    """State of a cohort population."""

    cohorts: Cohorts
    seen: Array = UNSEEN


_UNKNOWN = np.full(1, np.nan)


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Cohort(OverArea, _Stretched):
    """The density of bonds over their stretch, as cohorts carried with the slider. Limit: tracked bonds without noise.

    Bonds born together stay together: their survival over a step is exact, nothing diffuses. Births
    within a step, and the merging of old cohorts that bounds the cost, are held to ``tolerance``.
    """

    tolerance: CohortTolerance = 1e-4
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["cohort"] = "cohort"

    state_class: ClassVar[type[Ages]] = Ages
    step_seconds: ClassVar[float] = 10e-6
    in_blocks: ClassVar[bool] = True

    def start(self, motion: Motion, noise: Noise) -> Ages:
        recipe = self.law, self.rebinding_rate
        if self.start_from == "steady":
            first = cohorts.steady(*recipe, float(motion.first[0]), self.tolerance)
        elif self.start_from == "bonded":
            first = cohorts.resting(*recipe, self.tolerance)
        else:
            first = cohorts.empty(self.law, self.tolerance)
        rows = max(len(self.rows(noise)), len(motion.first))  # a drive that feels the friction has its members
        return Ages(Cohorts(*(np.repeat(array, rows, axis=0) for array in first)))

    def advance(self, state: Ages, motions: Motions, radius: Array, noise: Noise) -> tuple[Ages, Bonding]:
        share, seen = self.kept(state.seen, radius)
        recipe, duration = (self.law, self.rebinding_rate, self.tolerance), motions.duration[:, 0]
        after, sums = cohorts.advance(state.cohorts, motions.slip, duration, *recipe, share=share)
        return Ages(after, seen), self.read(sums)

    def bonding(self, state: Ages) -> Bonding:
        return self.read(cohorts.moments(state.cohorts, self.law, self.tolerance))

    def read(self, sums: Array) -> Bonding:
        """Readings of populations of these ``cohorts.moments``."""
        return self._bonding(*sums)._replace(stored=0.5 * self.site_density * self.bond_stiffness * sums[2])

    def steady(self, speed: Array) -> Bonding:
        rows = [cohorts.steady(self.law, self.rebinding_rate, float(v), self.tolerance) for v in np.atleast_1d(speed)]
        found = [self.bonding(Ages(row)) for row in rows]
        return Bonding(*(np.concatenate(values) for values in zip(*found, strict=True)))


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Tracked(_Separable):
    """A finite number of sites, every bond's stretch and exact rupture time. Limit: ``Cohort`` as sites -> infinity.

    ``sites`` are followed for each member, whatever the area: the area scales the stress, not the number.
    At speeds that are constant within each step a member's bonds are the same for any clock step.
    """

    sites: Annotated[
        int, Quantity("1", "number of bond sites that are followed", at_least=1, at_most=10**6, whole=True)
    ]
    start_from: Start = "steady"
    model: Literal["tracked"] = "tracked"

    state_class: ClassVar[type[Tracks]] = Tracks
    in_place: ClassVar[bool] = True

    @property
    def per_member(self) -> bool:
        return True

    @property
    def numbers(self) -> int:
        return 3 * self.sites

    def start(self, motion: Motion, noise: Noise) -> Tracks:
        laws, address = (self.law, self.rebinding_rate), (noise.seed, noise.members)
        return tracks.start(*laws, self.sites, motion.first, self.start_from, *address)

    def advance(self, state: Tracks, motions: Motions, radius: Array, noise: Noise) -> tuple[Tracks, Bonding]:
        laws, address = (self.law, self.rebinding_rate), (noise.seed, noise.members)
        state, frames = tracks.advance(state, motions.slip, motions.duration[:, 0], *laws, *address)
        return state, self.read(frames)

    def followed(self, speeds: Array, step: float) -> float:
        lives = step / (tracks.mean_life(speeds, self.law) + 1.0 / self.rebinding_rate)
        return float(self.sites * np.mean(np.minimum(lives, CYCLES)))

    def bonding(self, state: Tracks) -> Bonding:
        return self.read(state.frame)

    def read(self, frames: Array) -> Bonding:
        """Readings of frames: one bond after the other breaks, at a limit or by itself."""
        bound, stretch, square = tracks.moments(frames, self.sites)
        stored = 0.5 * self.site_density * self.bond_stiffness * square
        return self._bonding(bound, stretch, square, np.zeros(1), _UNKNOWN)._replace(stored=stored)

    def steady(self, speed: Array) -> Bonding:
        return Cohort(self.rupture, self.bond_stiffness, self.rebinding_rate, self.site_density).steady(speed)
