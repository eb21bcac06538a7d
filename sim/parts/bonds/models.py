"""Bond populations: the models, and the choice between them.

Simple to full: none, steady, rate, counted without a stretch; rate, cohort, tracked with one. Two rate equations
are called ``rate``: a rupture law distinguishes them.

Bonds without a stretch have a strength of ``stress`` times their fraction; their shear stress has the sign of the last
slip. Bonds with a stretch occupy sites of a given density. A bond is born unstretched, moves with the slider and breaks
at a rate that depends on its stretch. The mean force of the bonds makes the shear stress. So friction has a maximum,
ages and starts with a peak; none of this is prescribed.

By default a population is that of the present area, whatever its history: a closure. With ``area = "carried"`` the
number of bonds is carried. If the contact grows, the share of bound sites falls as the area rises. If it shrinks,
bonds leave with their area and the share stays.
"""

import math
from dataclasses import replace
from functools import cached_property
from operator import attrgetter
from typing import Annotated, ClassVar, Literal, NamedTuple, Self, TypeVar, cast

import numpy as np
from pydantic import Discriminator, Field, Tag, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

import sim.parts.bonds.cohorts as cohorts
import sim.parts.bonds.mean_field as mean_field
import sim.parts.bonds.tracked as tracks
from sim.laws import schallamach
from sim.laws.schallamach import (
    Body,
    Onset,
    linear_onset,
    relaxed,
    steady_fraction,
    transition_probabilities,
)
from sim.numerics.delay import delay_by_steps
from sim.numerics.jit import kernel
from sim.numerics.noise import Noise, binomial, stream, success
from sim.parts.bonds.cohorts import Cohorts
from sim.parts.bonds.rupture import Bell, Derivable, Rupture, RuptureRate
from sim.parts.bonds.tracked import CYCLES, Tracks
from sim.parts.exchange import UNKNOWN, Array, Bonding, Motion, Part, Setting
from sim.units.quantity import Quantity, keyed, tagged

Area = Annotated[
    Literal["present", "carried"],
    Field(description='"carried": new contact area has no bonds'),
]

#: Contact radius of a population that does not depend on the area, or has not had a contact yet.
_NO_AREA = UNKNOWN


def share_kept(before: Array, radius: Array) -> Array:
    """Return the share of bound sites that is left [1] if the contact radius goes from ``before`` to ``radius`` [m].

    A contact that was open (0) has none; the first contact (nan) keeps all.

    >>> print(share_kept(np.array([1.0, 2.0, 0.0, np.nan]), np.array([2.0, 1.0, 1.0, 1.0])))
    [0.25 1.   0.   1.  ]
    """
    grown = radius > before
    return np.where(
        grown,
        np.square(np.divide(before, radius, out=np.ones(grown.shape), where=grown)),
        1.0,
    )


class Demands(NamedTuple):
    """Demands of a scene on its bonds.

    Attributes
    ----------
    is_driven : bool
        True if the slider feels the friction.
    reads_stress : bool
        True if the amplitude of the fluctuations follows the stress.
    stiffest : float, optional
        Stiffness of the solid under a bond [N/m], if the bonds make the fluctuations.
    """

    is_driven: bool
    reads_stress: bool
    stiffest: float | None


class _BondModel(Part):
    """Attributes of all bond models; those with a stretch have a start and a rate of rebinding."""

    model: str
    start_from: str
    rebinding_rate: float
    #: True if a step needs the contact at the end of the step before. Members differ as their contacts do.
    feeds_back: ClassVar[bool] = False
    #: True if bonds break by chance, one by one.
    is_random: ClassVar[bool] = False
    #: Courses with which the stress jumps, as ``Phases`` names them.
    jumps_with: ClassVar[frozenset[str]] = frozenset()
    #: True if the population is solved through blocks of clock steps.
    in_blocks: ClassVar[bool] = True
    #: Rough time of a single step of a batch, for estimates [s].
    step_seconds: ClassVar[float] = 0.0
    #: Count of numbers in the state of a member.
    numbers: ClassVar[int] = 1

    def diluted(self, before: Array, radius: Array) -> tuple[Array, Array]:
        """Return the share of bound sites left [1] over a contact of ``radius`` [m], and the radius of their area [m].

        The radius is nan if the contact is open.
        """
        return np.ones(1), before

    def faults(self, demands: Demands) -> dict[str, str]:
        """Return faults of these bonds by key of the scenario."""
        if demands.stiffest is None:
            return {}
        cure = 'use bonds.model = "cohort" or "tracked"'
        fault = "the spectrum of the bonds needs the force of each bond"
        return {"shear.spectrum": f"{fault}; {cure}"}

    def chosen(self, area: float, forces: bool) -> Self:
        """Return this model, for any contact ``area`` [m²] and any field, reading the bonds' ``forces`` or not."""
        return self

    def why(self, area: float, forces: bool) -> str:
        return ""

    @property
    def bound_at_rest(self) -> float:
        """Share of sites bound at a bond fraction of 1 [1]."""
        return 1.0

    def delay(self, fraction: Array, step: float) -> Array:
        """Return by how much a clock step delays the bonds along a course of the speed [s], at bond fractions [1].

        They are taken to relax as by a rate equation, at the rate of rebinding over the share of sites that are bound.
        """
        bound = self.bound_at_rest * fraction
        rate = np.full(bound.shape, math.inf)
        np.divide(self.rebinding_rate, bound, out=rate, where=bound > 0.0)
        return delay_by_steps(step, rate)

    def followed(self, speeds: Array, step: float) -> float:
        """Return the mean number of bond lives that are followed in a step of one member at speeds [m/s]."""
        return 0.0

    @property
    def substep_seconds(self) -> float:
        """Rough time of a sub-step of a driven member, for estimates [s]."""
        return 1.5e-6


class _OverArea(_BondModel):
    """Attributes of models whose population may be carried with the contact area of each member."""

    area: Area

    @property
    def feeds_back(self) -> bool:  # type: ignore[override]
        return self.area == "carried"

    def rows(self, noise: Noise) -> Array:
        """Return ones, shape (populations,): a single population if all members share an area, else one each."""
        return np.ones(len(noise.members) if self.feeds_back else 1)

    def diluted(self, before: Array, radius: Array) -> tuple[Array, Array]:
        """Return the share of bound sites left [1] over a contact of ``radius`` [m], and the radius of their area [m].

        The area of a step is that at its start, so dilution follows the
        contact by one clock step and no bond is lost in between. With an equilibrium contact and fluctuating ΔΓ the
        total outward motion grows without bound as dt → 0. Each outward motion dilutes the bonds irreversibly, so the
        result does not converge in dt. With a ``rate_dependent`` edge it does.
        """
        if self.area == "present":
            return super().diluted(before, radius)
        now = np.where(np.isnan(radius), 0.0, radius)
        # an open contact has no bonds to fill
        return np.where(now > 0.0, share_kept(before, now), 0.0), now


Stress = Annotated[
    float,
    Quantity(
        "Pa", "shear stress with the bonds of the contact at rest", "tau_0", at_least=0
    ),
]
CriticalSpeed = Annotated[
    float, Quantity("m/s", "critical speed of the bonds", "V_c", above=0)
]
RebindingRate = Annotated[
    float, Quantity("1/s", "rate at which a free site binds", "k_r", above=0)
]
Start = Annotated[
    Literal["steady", "bonded", "empty"],
    Field(
        alias="start",
        description='bonds at the start; "bonded": all sites, unstretched',
    ),
]
Sites = Annotated[
    int,
    Quantity(
        "1",
        "number of bond sites of the contact",
        at_least=1,
        at_most=10**9,
        whole=True,
    ),
]


class Population(NamedTuple):
    """State of a population.

    Attributes
    ----------
    bound : array
        Fraction [1] or number of bonds.
    sense : array
        Sign of the last slip: 1, -1, or 0 before any.
    area_radius : array
        Contact radius [m] whose area the fraction refers to, nan if it does not matter.
    """

    bound: Array
    sense: Array
    area_radius: Array = _NO_AREA


class _WithoutStretch(_BondModel):
    """Attributes of all models without a stretch: their strength is proportional to the fraction."""

    state_class: ClassVar[type[Population]] = Population
    stretched: ClassVar[bool] = False
    critical_speed: float
    stress: float

    def faults(self, demands: Demands) -> dict[str, str]:
        faults = super().faults(demands)
        if demands.is_driven and not self.stress:
            faults["bonds.stress"] = (
                "is 0 Pa, so there is no friction; give the stress of the bonds"
            )
        if demands.reads_stress and not self.stress:
            faults["shear.amplitude"] = (
                'amplitude model "stress" follows the stress of the bonds, which is 0 Pa; give bonds.stress'
            )
        return faults

    def advance(
        self, state: Population, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Population, Bonding]:
        bound, area_radius = self._bound(state, motions, radius, noise)
        sense = np.empty(motions.slip.shape)
        _last_signs(motions.speed, motions.slip, state.sense, sense)
        return Population(bound[-1], sense[-1], area_radius), self.bonding(
            Population(bound, sense)
        )

    def _bound(
        self, state: Population, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Array, Array]:
        """Return the bonds at the end of each step, shape (steps, 1) or (steps, members), and their contact radius."""
        raise NotImplementedError

    def bonding(self, state: Population) -> Bonding:
        strength = self.stress * state.bound
        return Bonding(state.bound, state.sense * strength, strength)

    def onset(self, speed: Array, body: Body) -> Onset:
        """Return the onset of oscillations behind a spring at speeds [m/s], of bonds that follow the rate equation."""
        drag, strength = (
            np.multiply(body.viscosity, body.area),
            self.stress * np.asarray(body.area),
        )
        # grows with the area, too
        viscous = np.divide(
            drag * np.abs(speed),
            strength * self._steady_fraction(speed),
            out=np.full(speed.shape, np.nan),
            where=strength > 0.0,
        )
        recipe = self.critical_speed, self.rebinding_rate, strength, body.damping + drag
        growth = np.add(body.area_growth, body.stress_growth) * (1.0 + viscous)
        return linear_onset(speed, *recipe, body.mass, growth)

    def steady(self, speed: Array) -> Bonding:
        fraction = self._steady_fraction(speed)
        strength = self.stress * fraction
        return Bonding(fraction, np.sign(speed) * strength, strength)

    def _steady_fraction(self, speed: Array) -> Array:
        return np.asarray(steady_fraction(speed, self.critical_speed))

    def _first_fraction(self, start: str, motion: Motion) -> Array:
        if start == "steady":
            return self._steady_fraction(motion.speed)
        return np.full(1, 1.0 if start == "bonded" else 0.0)


@kernel("void(float64[:, :], float64[:, :], float64[:], float64[:, ::1])")
def _last_signs(speed, slip, first, sense):
    """Write the sign of the last slip at the end of each step: that of the speed, or of the slip if it has stopped."""
    for m in range(sense.shape[1]):
        last = first[m]
        for k in range(len(sense)):
            moved = speed[k, m] if speed[k, m] != 0.0 else slip[k, m]
            last = moved if moved != 0.0 else last
            sense[k, m] = last = np.sign(last)


@kernel("void(float64[::1], float64[:], float64[:], float64, float64, float64[:, ::1])")
def _relax(bound, path, duration, critical_speed, rebinding_rate, relaxed_bound):
    """Write the bond fractions at the end of each step; ``bound`` are those before the steps."""
    for k in range(len(path)):
        for m in range(len(bound)):
            before = bound[m] if k == 0 else relaxed_bound[k - 1, m]
            relaxed_bound[k, m] = relaxed(
                before, path[k], duration[k], critical_speed, rebinding_rate
            )


class _AtOnce(_WithoutStretch):
    """Attributes of models whose bonds are steady at every speed."""

    jumps_with: ClassVar[frozenset[str]] = frozenset({"drive"})

    def start(self, motion: Motion, noise: Noise) -> Population:
        return Population(self._steady_fraction(motion.speed), np.sign(motion.speed))

    def onset(self, speed: Array, body: Body) -> Onset:
        """Return the onset of oscillations behind a spring at speeds [m/s], without a frequency.

        Nothing delays the friction, so that no spring holds the slider where it falls with the speed.
        """
        area, viscosity = np.asarray(body.area), np.asarray(body.viscosity)
        growth = np.add(body.area_growth, body.stress_growth)
        strength = self.stress * self._steady_fraction(speed)
        grows = strength * (1.0 + growth) + viscosity * np.abs(speed) * growth
        falls = area * (grows * self._lost(np.abs(speed)) - viscosity)
        stiffness = np.where(falls > body.damping, math.inf, 0.0)
        stiffness = np.where(np.isnan(area), np.nan, stiffness)
        return Onset(stiffness, np.full(speed.shape, np.nan))

    def delay(self, fraction: Array, step: float) -> Array:
        return np.zeros(fraction.shape)

    def _lost(self, speed: Array) -> Array:
        """Return the share of the bound sites that is lost as the speed grows [s/m], at speeds above 0."""
        return 1.0 / (self.critical_speed + speed)

    def _bound(
        self, state: Population, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Array, Array]:
        return self._steady_fraction(motions.speed), state.area_radius


@keyed()
class Unbroken(_AtOnce):
    """Every bond of the contact at rest stays; the paper's uniform sliding stress."""

    stress: Stress = 0.0
    model: Literal["none"] = "none"

    def _lost(self, speed: Array) -> Array:
        return np.zeros(speed.shape)

    def _steady_fraction(self, speed: Array) -> Array:
        return np.ones(speed.shape)


@keyed()
class Steady(_AtOnce):
    """The paper's law N/N0 = 1/(1 + V/Vc), without delay if the speed changes. Limit: none as Vc -> infinity."""

    critical_speed: CriticalSpeed
    stress: Stress = 0.0
    model: Literal["steady"] = "steady"


@keyed()
class Rate(_OverArea, _WithoutStretch):
    """The rate equation dN/dt = h (N0 − N) − h (V/Vc) N. Limit: ``Steady`` as h -> infinity.

    One step is exact for the slip of the step spread evenly over it.
    """

    critical_speed: CriticalSpeed
    rebinding_rate: RebindingRate
    stress: Stress = 0.0
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["rate"] = "rate"

    def start(self, motion: Motion, noise: Noise) -> Population:
        # a drive that solves the motion has its members
        rows = self.rows(noise) + 0.0 * motion.speed
        return Population(
            rows * self._first_fraction(self.start_from, motion), np.sign(motion.speed)
        )

    def _bound(
        self, state: Population, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Array, Array]:
        share, area_radius = self.diluted(state.area_radius, radius)
        before, rates = state.bound * share, (self.critical_speed, self.rebinding_rate)
        bound = np.empty((len(motions.path), len(before)))
        _relax(before, motions.path[:, 0], motions.duration[:, 0], *rates, bound)
        return bound, area_radius

    def bonding(self, state: Population) -> Bonding:
        bonding = super().bonding(state)
        return bonding._replace(
            stiffness=-self.rebinding_rate / self.critical_speed * bonding.strength
        )


@keyed()
class Counted(_WithoutStretch):
    """A finite number of two-state sites with the rates of ``Rate``. Limit: ``Rate`` as sites -> infinity.

    Notes
    -----
    Over a step each bound site stays bound with probability p and each free one binds with
    probability r, both exact, so the next number is Binomial(n, p) + Binomial(sites − n, r).
    """

    critical_speed: CriticalSpeed
    rebinding_rate: RebindingRate
    sites: Sites
    stress: Stress = 0.0
    start_from: Start = "steady"
    model: Literal["counted"] = "counted"

    is_random: ClassVar[bool] = True
    in_blocks: ClassVar[bool] = False

    def bonding(self, state: Population) -> Bonding:
        return super().bonding(state._replace(bound=state.bound / self.sites))

    def start(self, motion: Motion, noise: Noise) -> Population:
        bound = np.zeros(len(noise.members))
        first = self._first_fraction(self.start_from, motion)[np.newaxis]
        return Population(
            self._counted(bound, first, first, motion.step, noise)[0],
            np.sign(motion.speed),
        )

    def _bound(
        self, state: Population, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Array, Array]:
        over = motions.path, motions.duration
        stay, bind = transition_probabilities(
            *over, self.critical_speed, self.rebinding_rate
        )
        return self._counted(
            state.bound, stay, bind, motions.step, noise
        ), state.area_radius

    def _counted(
        self, bound: Array, stay: Array, bind: Array, step: int, noise: Noise
    ) -> Array:
        """Return the bound sites at the end of each step, shape (steps, members).

        ``stay`` and ``bind`` are the chances that a bound and a free site are bound after a step, shape (steps, 1) or
        (steps, members).
        """
        counted = np.empty((len(stay), len(bound)))
        _count(bound, stay, bind, self.sites, noise.at(step), counted)
        return counted


@kernel(
    "void(float64[:], float64[:, :], float64[:, :], float64, Tuple((uint64, uint64, uint64[::1], int64)),"
    " float64[:, ::1])"
)
def _count(bound, stay, bind, sites, address, counted):
    """Write the bound sites of all members at the end of each step; ``address`` of the first one."""
    seed, part, members, step = address
    for k in range(len(stay)):
        staying, binding = success(stay[k, 0]), success(bind[k, 0])
        for m in range(members.size):
            if stay.shape[1] > 1:
                staying, binding = success(stay[k, m]), success(bind[k, m])
            before = counted[k - 1, m] if k > 0 else bound[m]
            numbers = stream(seed, part, members[m], step + k, 0)
            still_bound, numbers = binomial(before, staying, numbers)
            new, numbers = binomial(sites - before, binding, numbers)
            counted[k, m] = still_bound + new


Stiffness = Annotated[
    float, Quantity("N/m", "stiffness of a bond", "kappa", above=0, typical="0.4 mN/m")
]
Rebinding = Annotated[
    float,
    Quantity(
        "1/s", "rate at which a free site binds", "k_on", at_least=0, typical="1e5 1/s"
    ),
]
Density = Annotated[
    float,
    Quantity("1/m^2", "bond sites per area", "n_s", above=0, typical="1e17 1/m^2"),
]
Ratio = Annotated[
    float,
    Quantity("1", "rebinding_rate over zero_force_rate", "rho", above=0, typical="10"),
]
_T = TypeVar("_T", bound="_Stretched | Auto")


def _one_way(bonds: _T) -> _T:
    """Return bonds that have either their rates and site density, or a critical speed and a stress; refuse others."""
    law = cast(Rupture, bonds.rupture)
    by_rates = (*law.rate_keys, "rebinding_rate", "site_density")
    by_speed = (*law.speed_keys, "rebinding_ratio")
    keys = (*by_rates, *by_speed)
    present = [key for key in keys if attrgetter(key)(bonds) is not None]
    if set(present) <= set(by_rates):
        missing = [
            key.replace("rupture.", "rupture.bell.").split(".")
            for key in by_rates
            if key not in present
        ]
        if missing:
            errors = [
                InitErrorDetails(type="missing", loc=tuple(place), input=None)
                for place in missing
            ]
            raise ValidationError.from_exception_data("bonds", errors)
    elif not law.speed_keys or {*present} != {*by_speed}:
        words = ", ".join((*Bell.speed_keys, "rebinding_ratio"))
        ways = f"give either {', '.join(by_rates)} or, of Bell's rupture, {words}"
        raise PydanticCustomError("one_way", f"{ways}; given are {', '.join(present)}")
    return bonds


@keyed()
class _Stretched(_BondModel):
    """Keys and attributes of models with a stretch; a subclass gives the moments of the stretch over all sites."""

    stretched: ClassVar[bool] = True

    rupture: Rupture
    bond_stiffness: Stiffness
    rebinding_rate: Derivable[Rebinding] = cast(float, None)
    site_density: Derivable[Density] = cast(float, None)
    rebinding_ratio: Ratio | None = None

    #: Rates and site density of a critical speed and a stress: those of the exact density over the stretch.
    numbers_of: ClassVar = staticmethod(schallamach.bell_numbers)

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        return _one_way(self)

    @model_validator(mode="after")
    def _can_have_the_law(self) -> Self:
        law = self.rupture
        if self.model not in law.models:
            cure = " or ".join(f'"{model}"' for model in law.models)
            message = f'rupture model "{law.model}" needs the stretch of each bond'
            raise PydanticCustomError(
                "unsuitable_law", f"{message}; use bonds.model = {cure}"
            )
        return self

    def faults(self, demands: Demands) -> dict[str, str]:
        faults = super().faults(demands)
        if self.rebinding_rate == 0.0 and self.start_from != "bonded":
            faults["bonds.start"] = (
                'no site binds without rebinding: give "bonded", or a rebinding_rate above 0'
            )
        return faults

    def chosen(self, area: float, forces: bool) -> Self:
        """Return this model with all of its rates and its site density, for any contact and field."""
        if self.rebinding_ratio is None:
            return self
        bell = cast(Bell, self.rupture)
        wanted = (
            bell.critical_speed,
            bell.stress,
            bell.bell_force,
            self.bond_stiffness,
            self.rebinding_ratio,
        )
        rate, rebinding, density = map(float, self.numbers_of(*wanted))
        rupture = replace(bell, zero_force_rate=rate, critical_speed=None, stress=None)
        return replace(
            self,
            rupture=rupture,
            rebinding_rate=rebinding,
            rebinding_ratio=None,
            site_density=density,
        )

    @cached_property
    def law(self) -> RuptureRate:
        """Rupture rate as a function of the stretch of a bond."""
        return self.rupture.law(self.bond_stiffness)

    @cached_property
    def bound_at_rest(self) -> float:
        """Share of sites bound at a bond fraction of 1 [1]: that at rest, or all if no bond can form."""
        return (
            self.rebinding_rate / (self.rebinding_rate + self.law.at_rest)
            if self.rebinding_rate > 0.0
            else 1.0
        )

    def life(self, fraction: Array) -> Array:
        """Return the mean life of a bond in steady sliding at bond fractions [s], at a positive rate of rebinding."""
        bound = self.bound_at_rest * fraction
        return np.asarray(bound / (1.0 - bound) / self.rebinding_rate)

    def remarks(self, setting: Setting) -> list[str]:
        number = 1.0 / self.bound_at_rest
        times = f"{number:.3g} times the bonds at rest"
        remark = f'start = "bonded" binds all sites, {times}; adhesion.work is valid for the bonds at rest'
        return [remark] if self.start_from == "bonded" and number > 1.01 else []

    def onset(self, speed: Array, body: Body) -> Onset:
        """Return the onset of oscillations behind a spring at speeds [m/s], nan if unknown."""
        return self.rupture.resolved_onset(
            speed, (self.bond_stiffness, self.rebinding_rate, self.site_density), body
        )

    def _bonding(
        self, bound: Array, stretch: Array, square: Array, breaking: Array, lost: Array
    ) -> Bonding:
        """Return the readings of a population of these moments per site.

        The stress is n κ x̄. With f̄ and E[f²] per site the powers are n f̄² and n (E[f²] − f̄²). Slip stretches all
        bonds. At a limit ℓ of the stretch it breaks the share ``breaking`` of the sites for each ℓ of slip. Thermal
        rupture takes the stretch ``lost`` per site and unit time.
        """
        per_stretch = self.site_density * self.bond_stiffness
        frozen, scale = stretch**2, self.site_density * self.bond_stiffness**2
        varying = np.maximum(square - frozen, 0.0)  # nan stays nan
        stress, stiffness = per_stretch * stretch, per_stretch * (bound - breaking)
        powers = (
            scale * frozen,
            scale * varying,
            0.5 * self.site_density * self.bond_stiffness * square,
        )
        return Bonding(
            bound / self.bound_at_rest,
            stress,
            np.abs(stress),
            stiffness,
            -per_stretch * lost,
            *powers,
        )


class Stretches(NamedTuple):
    """State of the first-moment equation: share of sites bound [1] and mean stretch per site [m]."""

    bound: Array
    stretch: Array
    area_radius: Array = _NO_AREA


@keyed()
class FirstMoment(_OverArea, _Stretched):
    """Rate equations of number and mean stretch, every bond taken at the mean. Limit: ``Cohort`` at a constant rate.

    Exact in time for a constant rupture. Under Bell's it is a mean field: it overpredicts the friction
    maximum by some 27 to 47 %; ``Cohort`` has no such error.
    """

    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["rate"] = "rate"

    numbers_of: ClassVar = staticmethod(schallamach.first_moment_numbers)
    state_class: ClassVar[type[Stretches]] = Stretches

    def start(self, motion: Motion, noise: Noise) -> Stretches:
        if self.start_from == "steady":
            bound, stretch = mean_field.steady(
                motion.first, self.law, self.rebinding_rate
            )
        else:
            bound = np.full(1, 1.0 if self.start_from == "bonded" else 0.0)
            stretch = np.zeros(1)
        # a drive that solves the motion has its members
        rows = self.rows(noise) + 0.0 * motion.first
        return Stretches(rows * bound, rows * stretch)

    def advance(
        self, state: Stretches, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Stretches, Bonding]:
        share, area_radius = self.diluted(state.area_radius, radius)
        before, sliding = (
            (state.bound * share, state.stretch * share),
            (motions.slip, motions.path),
        )
        bound, stretch = mean_field.advance(
            *before, *sliding, motions.duration[:, 0], self.law, self.rebinding_rate
        )
        return Stretches(bound[-1], stretch[-1], area_radius), self.bonding(
            Stretches(bound, stretch)
        )

    def onset(self, speed: Array, body: Body) -> Onset:
        numbers = self.bond_stiffness, self.rebinding_rate, self.site_density
        return self.rupture.first_moment_onset(speed, numbers, body)

    def remarks(self, setting: Setting) -> list[str]:
        remarks, rebinding = super().remarks(setting), self.rebinding_rate
        excess = (
            self.rupture.first_moment_excess(self.bond_stiffness, rebinding)
            if rebinding > 0.0
            else 0.0
        )
        remark = f'the mean stretch overpredicts the friction maximum by {excess:.0%}; bonds.model = "cohort" is exact'
        return [*remarks, remark] if excess and not setting.by_maximum else remarks

    def bonding(self, state: Stretches) -> Bonding:
        mean = np.divide(
            state.stretch,
            state.bound,
            out=np.zeros(state.bound.shape),
            where=state.bound > 0.0,
        )
        breaking, lost = (
            2.0 * np.abs(state.stretch) / self.law.limit,
            state.stretch * self.law.at(mean),
        )
        stored = 0.5 * self.site_density * self.bond_stiffness * mean * state.stretch
        return self._bonding(
            state.bound, state.stretch, UNKNOWN, breaking, lost
        )._replace(stored=stored)

    def steady(self, speed: Array) -> Bonding:
        return self.bonding(
            Stretches(*mean_field.steady(speed, self.law, self.rebinding_rate))
        )


class _OfEachBond(_Stretched):
    """Attributes of models that know the force of each bond."""

    def faults(self, demands: Demands) -> dict[str, str]:
        stiffest, faults = (
            demands.stiffest,
            super().faults(demands._replace(stiffest=None)),
        )
        # a bond's own stiffness is in series with that of the solid, which stores ½ f²/k under a force f
        if stiffest is not None and self.bond_stiffness > stiffest * (1.0 + 1e-9):
            fault = f"the solid under a bond of this footprint has a stiffness of {stiffest:.3g} N/m in series"
            faults["bonds.bond_stiffness"] = (
                f"{fault}: give at most that, or a larger shear.spectrum.footprint"
            )
        return faults


class Ages(NamedTuple):
    """State of a cohort population."""

    cohorts: Cohorts
    area_radius: Array = _NO_AREA


@keyed()
class Cohort(_OverArea, _OfEachBond):
    """The density of bonds over their stretch, as cohorts carried with the slider. Limit: tracked bonds without noise.

    Bonds born together stay together: their survival over a step is exact, nothing diffuses. Births
    within a step, and the merging of old cohorts that bounds the cost, are held to ``tolerance``.
    """

    tolerance: Annotated[
        float, Quantity("1", "tolerance of the cohorts", "", at_least=1e-12, below=0.1)
    ] = 1e-4
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["cohort"] = "cohort"

    state_class: ClassVar[type[Ages]] = Ages
    step_seconds: ClassVar[float] = 10e-6

    @property
    def substep_seconds(self) -> float:
        # the number of cohorts grows as the tolerance falls
        return 1e-6 * self.tolerance**-0.3

    def start(self, motion: Motion, noise: Noise) -> Ages:
        if self.start_from == "steady":
            first = cohorts.steady(
                self.law, self.rebinding_rate, float(motion.first[0]), self.tolerance
            )
        else:
            first = cohorts.unstretched(
                self.law, self.tolerance, 1.0 if self.start_from == "bonded" else 0.0
            )
        # a drive that solves the motion has its members
        rows = max(len(self.rows(noise)), len(motion.first))
        return Ages(Cohorts(*(np.repeat(array, rows, axis=0) for array in first)))

    def advance(
        self, state: Ages, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Ages, Bonding]:
        share, area_radius = self.diluted(state.area_radius, radius)
        recipe, duration = (
            (self.law, self.rebinding_rate, self.tolerance),
            motions.duration[:, 0],
        )
        after, sums = cohorts.advance(
            state.cohorts, motions.slip, duration, *recipe, share
        )
        return Ages(after, area_radius), self.read(sums)

    def bonding(self, state: Ages) -> Bonding:
        return self.read(cohorts.moments(state.cohorts, self.law, self.tolerance))

    def read(self, sums: Array) -> Bonding:
        """Return the readings of populations of these ``cohorts.moments``."""
        return self._bonding(*sums)

    def steady(self, speed: Array) -> Bonding:
        rows = [
            cohorts.steady(self.law, self.rebinding_rate, float(v), self.tolerance)
            for v in np.atleast_1d(speed)
        ]
        readings = zip(*(self.bonding(Ages(row)) for row in rows), strict=True)
        return Bonding(*map(np.concatenate, readings))


@keyed()
class Tracked(_OfEachBond):
    """A finite number of sites, every bond's stretch and exact rupture time. Limit: ``Cohort`` as sites -> infinity.

    ``sites`` are followed for each member, whatever the area: the area scales the stress, not the number.
    At speeds that are constant within each step a member's bonds are the same for any clock step.
    """

    sites: Annotated[
        int,
        Quantity(
            "1",
            "number of bond sites in the simulation",
            at_least=1,
            at_most=10**6,
            whole=True,
        ),
    ] = Field(kw_only=True)
    start_from: Start = "steady"
    model: Literal["tracked"] = "tracked"

    state_class: ClassVar[type[Tracks]] = Tracks
    is_random: ClassVar[bool] = True

    @property
    def numbers(self) -> int:  # type: ignore[override]
        return 3 * self.sites

    def start(self, motion: Motion, noise: Noise) -> Tracks:
        laws, address = (self.law, self.rebinding_rate), (noise.seed, noise.members)
        return tracks.start(*laws, self.sites, motion.first, self.start_from, *address)

    def advance(
        self, state: Tracks, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[Tracks, Bonding]:
        laws, address = (self.law, self.rebinding_rate), (noise.seed, noise.members)
        state, frames = tracks.advance(
            state, motions.slip, motions.duration[:, 0], *laws, *address
        )
        return state, self.read(frames)

    def followed(self, speeds: Array, step: float) -> float:
        wait = 1.0 / self.rebinding_rate if self.rebinding_rate > 0.0 else math.inf
        return float(
            self.sites
            * np.mean(
                np.minimum(step / (tracks.mean_life(speeds, self.law) + wait), CYCLES)
            )
        )

    def remarks(self, setting: Setting) -> list[str]:
        number, remarks = self.site_density * setting.cell**2, super().remarks(setting)
        numbers = f"{self.sites} sites are simulated, site_density times the area at rest is {number:.3g}"
        remark = f"{numbers} ({number / self.sites:.3g} times as many); the first sets the noise, the second the force"
        return [*remarks, remark] if abs(number / self.sites - 1.0) > 0.01 else remarks

    def bonding(self, state: Tracks) -> Bonding:
        return self.read(state.frame)

    def read(self, frames: Array) -> Bonding:
        """Return the readings of frames: bonds break one after the other, at a limit or by themselves."""
        return self._bonding(*tracks.moments(frames, self.sites), np.zeros(1), UNKNOWN)

    def steady(self, speed: Array) -> Bonding:
        return Cohort(
            self.rupture, self.bond_stiffness, self.rebinding_rate, self.site_density
        ).steady(speed)


_MOST_TRACKED = 10**6
_WITHOUT = ("critical_speed", "rebinding_rate")
_WITH = ("rupture", "bond_stiffness")
_NUMBERS = (*_WITH, "rebinding_rate", "rebinding_ratio", "site_density")
_STRETCHED = ("rupture", "bond_stiffness", "rebinding_ratio", "site_density")

#: A model that can be advanced.
Model = Unbroken | Steady | Rate | Counted | FirstMoment | Cohort | Tracked


@keyed()
class Auto:
    """The simplest model that is good to ``tolerance``; it takes the keys of all of them.

    A finite number N of bonds fluctuates by 1/√N: where that is above the tolerance they are counted, or
    tracked if they have a rupture law. Otherwise it is the rate equation, or cohorts where the rupture rate depends
    on the stretch.
    """

    critical_speed: CriticalSpeed | None = None
    stress: Stress = 0.0
    rupture: Rupture | None = None
    bond_stiffness: Stiffness | None = None
    rebinding_rate: Rebinding | None = None
    rebinding_ratio: Ratio | None = None
    site_density: Density | None = None
    sites: Sites | None = None
    tolerance: Annotated[
        float, Quantity("1", "tolerated noise of the bonds", "", above=0, below=1)
    ] = 0.01
    start_from: Start = "steady"
    area: Area = "present"
    model: Literal["auto"] = "auto"

    @model_validator(mode="after")
    def _one_kind(self) -> "Auto":
        with_ = any(getattr(self, name) is not None for name in _STRETCHED)
        if (self.critical_speed is not None) == with_:
            message = f"give either {' and '.join(_WITHOUT)}, or {', '.join(_WITH)}, rebinding_rate and site_density"
            raise PydanticCustomError("one_kind", message)
        missing = [
            name
            for name in (_WITH if with_ else _WITHOUT)
            if getattr(self, name) is None
        ]
        if missing:
            are = "is" if len(missing) == 1 else "are"
            raise PydanticCustomError(
                "one_kind", f"{' and '.join(missing)} {are} missing, but required here"
            )
        if not with_ and self.rebinding_rate == 0.0:
            raise PydanticCustomError(
                "one_kind",
                "rebinding_rate must be above 0 1/s for bonds without a rupture",
            )
        if with_ and self.stress:
            raise PydanticCustomError(
                "one_kind",
                "the stress of bonds with a rupture is computed; omit stress",
            )
        return _one_way(self) if with_ else self

    def number(self, area: float) -> float:
        """Return the sites of a contact of this area [m²]: ``sites``, else by their density, else infinity."""
        if self.sites is not None:
            return self.sites
        density = self.site_density
        if self.rebinding_ratio is not None:
            density = (
                Cohort(**{name: getattr(self, name) for name in _NUMBERS})
                .chosen(area, False)
                .site_density
            )
        return (
            math.inf
            if density is None or not area > 0.0
            else max(1.0, round(density * area))
        )

    def chosen(self, area: float, forces: bool) -> Model:
        """Return the model for a contact of this ``area`` [m²]; ``forces`` is true if the field reads the forces."""
        number, start = self.number(area), self.start_from
        noisy = self.tolerance**2 * number < 1.0 and self.area == "present"
        if self.rupture is None:
            plain = {name: getattr(self, name) for name in _WITHOUT}
            if noisy:
                return Counted(
                    **plain, sites=int(number), stress=self.stress, start_from=start
                )
            return Rate(**plain, stress=self.stress, start_from=start, area=self.area)
        rest = {name: getattr(self, name) for name in _NUMBERS}
        if noisy and number <= _MOST_TRACKED and "tracked" in self.rupture.models:
            return Tracked(**rest, sites=int(number), start_from=start).chosen(
                area, forces
            )
        law = self.rupture.law(cast(float, self.bond_stiffness))
        if math.isinf(law.scale) and not forces:
            return FirstMoment(**rest, start_from=start, area=self.area)
        tolerance = max(1e-12, min(1e-4, 0.1 * self.tolerance))
        return Cohort(
            **rest, tolerance=tolerance, start_from=start, area=self.area
        ).chosen(area, forces)

    def why(self, area: float, forces: bool) -> str:
        """Return the reason for the choice, in words."""
        number, model = self.number(area), self.chosen(area, forces).model
        if math.isinf(number):
            size = "no number of sites is given"
        else:
            noise = 1.0 / math.sqrt(number)
            size = f"1/√N of {number:,.0f} site{'' if number == 1 else 's'} is {noise:.3g}, "
            size += f"{'above' if noise > self.tolerance else 'within'} the tolerance of {self.tolerance:g}"
        if model in ("counted", "tracked"):
            return size
        if self.area == "carried":
            size += "; a number of sites cannot be carried with the area"
        elif self.tolerance**2 * number < 1.0 and number > _MOST_TRACKED:
            size += f"; more than {_MOST_TRACKED:,} bonds are too many to be tracked"
        if model == "cohort":
            return f"{size}; {'the forces of the bonds are needed' if forces else 'the rupture depends on the stretch'}"
        return f"{size}; the rupture rate does not depend on the stretch"


Bonds = Annotated[
    Annotated[Unbroken, Tag("none")]
    | Annotated[Steady, Tag("steady")]
    | Annotated[Rate, Tag("rate")]
    | Annotated[FirstMoment, Tag("rate[rupture]")]
    | Annotated[Cohort, Tag("cohort")]
    | Annotated[Counted, Tag("counted")]
    | Annotated[Tracked, Tag("tracked")]
    | Annotated[Auto, Tag("auto")],
    Discriminator(tagged("rate", *_STRETCHED)),
]
