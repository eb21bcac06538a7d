"""Bond populations with a stretch. Shallow to deep: rate (first moment), cohort, tracked.

Sites of a given density are free or hold a bond that was born unstretched, goes with the slider and
breaks with a rupture that depends on its stretch. Their mean force makes the shear stress, so friction
has a maximum, ages and starts with a peak; nothing of that is put in by hand.
"""

from dataclasses import dataclass as plain_dataclass
from dataclasses import field, fields, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

import sim.parts.bonds.cohorts as cohorts
import sim.parts.bonds.first_moment as first_moment
import sim.parts.bonds.tracked as tracks
from sim.numerics.noise import Noise
from sim.parts.bonds.area import Area, OverArea
from sim.parts.bonds.cohorts import Cohorts
from sim.parts.bonds.rupture import Rupture, RuptureRate
from sim.parts.bonds.tracked import Tracks
from sim.parts.bonds.two_state import Start
from sim.parts.exchange import Motion, Traction
from sim.units.quantity import Quantity

Stiffness = Annotated[float, Quantity("N/m", "stiffness of a bond", "kappa", above=0, typical="0.4 mN/m")]
Rebinding = Annotated[float, Quantity("1/s", "rate at which a free site binds", "k_on", above=0, typical="1e5 1/s")]
Density = Annotated[float, Quantity("1/m^2", "bond sites per area", "n", above=0, typical="1e17 1/m^2")]
CohortTolerance = Annotated[float, Quantity("1", "tolerance of the cohorts", "", at_least=1e-12, below=0.1)]


class _Stretched:
    """What depths with a stretch share; a subclass gives the moments of the stretch over all sites."""

    per_member: ClassVar[Any] = False
    knows_forces: ClassVar[bool] = True
    carries_stress: ClassVar[bool] = True
    numbers: Any = 1
    rupture: Rupture
    bond_stiffness: float
    rebinding_rate: float
    site_density: float

    def moments(self, population: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Share of sites bound [1], mean stretch [m] and mean square stretch [m²] per site, each per member."""
        raise NotImplementedError

    @cached_property
    def law(self) -> RuptureRate:
        """Rupture rate of a bond of given stretch."""
        return self.rupture.law(self.bond_stiffness)

    @property
    def bound_at_rest(self) -> float:
        """Share of sites that are bound at rest [1]."""
        return self.rebinding_rate / (self.rebinding_rate + self.law.rate)

    def fraction(self, population: Any) -> np.ndarray:
        """Bonds over bonds at rest [1]."""
        return self.moments(population)[0] / self.bound_at_rest

    def shear_stress(self, population: Any) -> np.ndarray:
        """Mean shear stress [Pa]: sites per area × stiffness × mean stretch per site."""
        return self.site_density * self.bond_stiffness * self.moments(population)[1]

    def traction(self, population: Any) -> Traction:
        """What the shear part is told: with f̄ and E[f²] per site, n f̄² and n (E[f²] − f̄²)."""
        return self._traction(*self.moments(population)[1:])

    def _traction(self, stretch: np.ndarray, square: np.ndarray) -> Traction:
        frozen, scale = stretch**2, self.site_density * self.bond_stiffness**2
        varying = np.maximum(square - frozen, 0.0)  # nan stays nan
        return Traction(self.site_density * self.bond_stiffness * stretch, scale * frozen, scale * varying)

    def over(self, population: Any, radius: np.ndarray) -> Any:
        """The population over the contact as it is now."""
        return population


@plain_dataclass(frozen=True)
class Stretches:
    """State of the first-moment equation: share of sites bound [1] and mean stretch per site [m]."""

    bound: np.ndarray
    stretch: np.ndarray
    seen: np.ndarray = field(default_factory=lambda: np.full(1, np.nan))


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class FirstMoment(OverArea, _Stretched):
    """Rate equations of number and mean stretch, every bond taken at the mean. Limit: ``Cohort`` at a constant rate.

    Exact in time for a constant rupture. Under Bell's it is a mean field: it overpredicts the friction
    maximum by some 27 to 47 %; ``Cohort`` has no such error.
    """

    rupture: Rupture
    bond_stiffness: Stiffness
    rebinding_rate: Rebinding
    site_density: Density
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["rate"] = "rate"

    knows_forces: ClassVar[bool] = False

    def start(self, motion: Motion, noise: Noise) -> Stretches:
        if self.start_from == "steady":
            bound, stretch = first_moment.steady(motion.first, self.law, self.rebinding_rate)
        else:
            bound = np.full(1, self.bound_at_rest if self.start_from == "bonded" else 0.0)
            stretch = np.zeros(1)
        rows = self.rows(noise)
        return Stretches(rows * bound, rows * stretch)

    def advance(self, population: Stretches, motion: Motion, noise: Noise) -> Stretches:
        bound, stretch = first_moment.advance(
            population.bound,
            population.stretch,
            motion.slip,
            motion.path,
            motion.duration,
            self.law,
            self.rebinding_rate,
        )
        return replace(population, bound=bound, stretch=stretch)

    def diluted(self, population: Stretches, share: np.ndarray) -> Stretches:
        return replace(population, bound=population.bound * share, stretch=population.stretch * share)

    def moments(self, population: Stretches) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return population.bound, population.stretch, np.full(1, np.nan)

    def settled(self, speed: np.ndarray) -> Traction:
        """What steady sliding at a speed [m/s] hands to the shear part."""
        _, stretch = first_moment.steady(speed, self.law, self.rebinding_rate)
        return self._traction(stretch, np.full(1, np.nan))


@plain_dataclass(frozen=True)
class Ages:
    """State of a cohort population."""

    cohorts: Cohorts
    seen: np.ndarray = field(default_factory=lambda: np.full(1, np.nan))


def _cohort_moments(population: Cohorts) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return cohorts.bound(population), cohorts.first_moment(population), cohorts.second_moment(population)


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Cohort(OverArea, _Stretched):
    """The density of bonds over their stretch, as cohorts carried with the slider. Limit: tracked bonds without noise.

    Bonds born together stay together: their survival over a step is exact, nothing diffuses. Births
    within a step, and the merging of old cohorts that bounds the cost, are held to ``tolerance``.
    """

    rupture: Rupture
    bond_stiffness: Stiffness
    rebinding_rate: Rebinding
    site_density: Density
    tolerance: CohortTolerance = 1e-4
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["cohort"] = "cohort"

    def start(self, motion: Motion, noise: Noise) -> Ages:
        recipe = self.law, self.rebinding_rate
        if self.start_from == "steady":
            first = cohorts.steady(*recipe, float(motion.first[0]), self.tolerance)
        elif self.start_from == "bonded":
            first = cohorts.resting(*recipe, self.tolerance)
        else:
            first = cohorts.empty(self.law, self.tolerance)
        rows = len(self.rows(noise))
        return Ages(Cohorts(*(np.repeat(getattr(first, item.name), rows, axis=0) for item in fields(Cohorts))))

    def advance(self, population: Ages, motion: Motion, noise: Noise) -> Ages:
        moved = cohorts.advance(
            population.cohorts, motion.slip, motion.duration, self.law, self.rebinding_rate, self.tolerance
        )
        return replace(population, cohorts=moved)

    def diluted(self, population: Ages, share: np.ndarray) -> Ages:
        return replace(population, cohorts=cohorts.diluted(population.cohorts, share))

    def moments(self, population: Ages) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return _cohort_moments(population.cohorts)

    def settled(self, speed: np.ndarray) -> Traction:
        """What steady sliding at a speed [m/s] hands to the shear part."""
        rows = [cohorts.steady(self.law, self.rebinding_rate, float(v), self.tolerance) for v in np.atleast_1d(speed)]
        _, stretch, square = np.concatenate([_cohort_moments(row) for row in rows], axis=1)
        return self._traction(stretch, square)


@dataclass(frozen=True, config={"extra": "forbid", "populate_by_name": True})
class Tracked(_Stretched):
    """A finite number of sites, every bond's stretch and exact rupture time. Limit: ``Cohort`` as sites -> infinity.

    ``sites`` are followed for each member, whatever the area: the area scales the stress, not the number.
    At speeds that are constant within each step a member's bonds are the same for any clock step.
    """

    per_member: ClassVar[bool] = True

    rupture: Rupture
    bond_stiffness: Stiffness
    rebinding_rate: Rebinding
    site_density: Density
    sites: Annotated[int, Field(ge=1, le=10**6, description="number of bond sites that are followed")]
    start_from: Start = "steady"
    model: Literal["tracked"] = "tracked"

    @property
    def numbers(self) -> int:
        """Numbers that a member's state holds."""
        return 3 * self.sites

    def start(self, motion: Motion, noise: Noise) -> Tracks:
        return tracks.start(
            self.law, self.rebinding_rate, self.sites, motion.first, self.start_from, noise.seed, noise.members
        )

    def advance(self, population: Tracks, motion: Motion, noise: Noise) -> Tracks:
        return tracks.advance(
            population, motion.slip, motion.duration, self.law, self.rebinding_rate, noise.seed, noise.members
        )

    def moments(self, population: Tracks) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        bound = tracks.bound(population) / self.sites
        return bound, tracks.mean_stretch(population), tracks.mean_square_stretch(population)

    def settled(self, speed: np.ndarray) -> Traction:
        """Ensemble mean of what steady sliding at a speed [m/s] hands to the shear part, that of the cohorts."""
        shared = {name: getattr(self, name) for name in ("rupture", "bond_stiffness", "rebinding_rate", "site_density")}
        return Cohort(**shared).settled(speed)
