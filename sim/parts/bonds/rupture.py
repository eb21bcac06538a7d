"""Rupture rate of a bond of a given stretch: constant, Bell, constant with a cut-off stretch, catch, or any other.

A law is a class with its rate under a force. A law of exponentials also gives the numbers of a ``RuptureRate``, whose
integrals are closed. The integrals of any other law are tabulated, because compiled loops cannot call it. Compiled
loops use a law through device functions alone: the rate, its integral along a motion, the same of a fresh bond, the
time to rupture.
"""

import math
from collections.abc import Callable
from typing import (
    TYPE_CHECKING,
    Annotated,
    ClassVar,
    Literal,
    NamedTuple,
    Optional,
    TypeVar,
    cast,
)

import numpy as np
from pydantic import Field

from sim.laws import schallamach
from sim.laws.schallamach import Array, Body, Onset
from sim.numerics.jit import device, inlined
from sim.numerics.special import exp, mean_growth
from sim.numerics.table import NO_TABLE, Table, mean_and_value, table_of
from sim.units.quantity import Quantity, keyed


class LawNumbers(NamedTuple):
    """Numbers of a rupture law in compiled loops: those of ``RuptureRate``, with the address of the table.

    A helper that takes a law reads it by these names. So any record with them is a law, as ``cohorts.Rules`` is.
    """

    rate: float
    softness: float
    limit: float
    catch: float
    relief: float
    table: float


class RuptureRate(NamedTuple):
    """Rupture rate of a bond of stretch x.

    ``rate`` [1/s] × exp(\\|x\\| ``softness`` [1/m]) + ``catch`` [1/s] × exp(−\\|x\\| ``relief`` [1/m]) up to the
    stretch ``limit`` [m], infinite beyond it. A ``table`` takes the place of the exponentials; then ``rate`` is that at
    rest.
    """

    rate: float
    softness: float
    limit: float
    catch: float = 0.0
    relief: float = 0.0
    table: Table = NO_TABLE

    @property
    def numbers(self) -> LawNumbers:
        """The law as compiled loops take it."""
        return LawNumbers(*map(float, (*self[:5], self.table.address)))

    @property
    def scale(self) -> float:
        """Stretch on which the rate changes [m], infinite for a constant rate without a limit."""
        if self.softness > 0.0:
            return 1.0 / self.softness
        return self.table.scale or self.limit

    @property
    def at_rest(self) -> float:
        """Rupture rate of an unstretched bond [1/s]."""
        return self.rate + self.catch

    def at(self, stretch: Array) -> Array:
        """Return the rate of the pathway that force opens, for bonds of a stretch [m] [1/s]."""
        return self.rate * np.exp(np.abs(stretch) * self.softness)

    @property
    def steepness(self) -> float:
        """Largest relative change of the rate per stretch [1/m]."""
        relief = self.relief if self.catch > 0.0 else 0.0
        return max(self.softness, relief, self.table.steepness)


def tabulated(rate: Callable[[Array], Array], scale: float) -> RuptureRate:
    """Return a law with a table of a ``rate`` [1/s], which changes by about e on a ``scale`` of the stretch [m]."""
    table = table_of(rate, scale)
    return RuptureRate(float(table.values[0, 1]), 0.0, math.inf, table=table)


_T = TypeVar("_T")
#: A number that a scenario may leave out because others determine it. The bonds that are ``chosen`` have it.
if TYPE_CHECKING:
    Derivable = Annotated[_T, "derivable"]
else:
    Derivable = Optional

#: Stiffness of a bond [N/m], k_on [1/s] and sites per area [1/m²].
BondNumbers = tuple[float, float, float]


class _Law:
    """Attributes of all rupture laws.

    A subclass gives ``rate_at_force``, the rate of a bond under a force, and ``force``, on which it changes by about e.
    A law of exponentials gives ``law`` instead, its numbers for bonds of a stiffness [N/m].
    """

    #: Force on which the rate changes by about e [N].
    force: float
    #: Models of bonds that can have the law. "rate" needs a rupture by one exponential, whose first moment is closed,
    #: "tracked" a rate that never falls with the force, because ages are drawn only under such a law.
    models: ClassVar[tuple[str, ...]] = "cohort", "tracked"
    #: Keys of a rate, and those that take its place if critical speed and stress of the bonds are given.
    rate_keys: ClassVar[tuple[str, ...]] = ()
    speed_keys: ClassVar[tuple[str, ...]] = ()
    #: Pathways of rupture as of the law ``resolved_onset``; none if force opens no pathway.
    pathways: ClassVar[tuple[tuple[float, float], ...]] = ()

    def rate_at_force(self, force: Array) -> Array:
        """Return the rupture rate of a bond under a force [1/s], above 0."""
        raise NotImplementedError

    def law(self, bond_stiffness: float) -> RuptureRate:
        """Return the rate as a function of the stretch of bonds of a stiffness [N/m]."""
        return tabulated(
            lambda stretch: self.rate_at_force(bond_stiffness * stretch),
            self.force / bond_stiffness,
        )

    def first_moment_excess(
        self, bond_stiffness: float, rebinding_rate: float
    ) -> float:
        """Return the relative error of the friction maximum if every bond has the mean stretch [1]."""
        return 0.0

    def first_moment_onset(self, speed: Array, bonds: BondNumbers, body: Body) -> Onset:
        """Return the onset of oscillations behind a spring at speeds [m/s], as the law ``first_moment_onset``."""
        return Onset(*np.full((2, *speed.shape), np.nan))

    def resolved_onset(self, speed: Array, bonds: BondNumbers, body: Body) -> Onset:
        """Return the onset of oscillations behind a spring of bonds resolved by stretch, as ``resolved_onset``."""
        if not self.pathways:
            return Onset(*np.full((2, *speed.shape), np.nan))
        return schallamach.resolved_onset(speed, self.pathways, *bonds, body)


@keyed()
class Constant(_Law):
    """Bonds open by themselves at one rate, however stretched they are."""

    models: ClassVar[tuple[str, ...]] = "rate", "cohort", "tracked"

    rate: Annotated[float, Quantity("1/s", "rupture rate of a bond", "k_0", above=0)]
    model: Literal["constant"] = "constant"

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(self.rate, 0.0, math.inf)


ZeroForceRate = Annotated[
    float,
    Quantity(
        "1/s", "rupture rate of an unstretched bond", "k_0", above=0, typical="1e4 1/s"
    ),
]
HalfSpeed = Annotated[
    float,
    Quantity(
        "m/s", "speed at which half of the bonds of rest are left", "V_c", above=0
    ),
]
LargestStress = Annotated[
    float, Quantity("Pa", "largest shear stress in steady sliding", "tau", above=0)
]


@keyed()
class Bell(_Law):
    """Force accelerates rupture by heat: k = k0 exp(f/f_b) (Bell 1978). Limit: ``Constant`` as f_b -> infinity.

    ``critical_speed`` and ``stress`` beside ``bonds.rebinding_ratio`` take the place of ``zero_force_rate`` beside
    ``bonds.rebinding_rate`` and ``bonds.site_density``.
    """

    bell_force: Annotated[
        float,
        Quantity(
            "N",
            "force that multiplies the rupture rate by e",
            "f_b",
            above=0,
            typical="4 pN",
        ),
    ]
    zero_force_rate: Derivable[ZeroForceRate] = cast(float, None)
    critical_speed: HalfSpeed | None = None
    stress: LargestStress | None = None
    model: Literal["bell"] = "bell"

    models: ClassVar[tuple[str, ...]] = "rate", "cohort", "tracked"
    rate_keys: ClassVar[tuple[str, ...]] = ("rupture.zero_force_rate",)
    speed_keys: ClassVar[tuple[str, ...]] = "rupture.critical_speed", "rupture.stress"

    @property
    def pathways(self) -> tuple[tuple[float, float], ...]:  # type: ignore[override]
        return ((self.zero_force_rate, self.bell_force),)

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(
            self.zero_force_rate, bond_stiffness / self.bell_force, math.inf
        )

    def first_moment_excess(
        self, bond_stiffness: float, rebinding_rate: float
    ) -> float:
        recipe = self.zero_force_rate, self.bell_force, bond_stiffness, rebinding_rate
        mean_field, exact = (
            schallamach.first_moment_peak(*recipe, 1.0),
            schallamach.bell_peak(*recipe, 1.0),
        )
        return float(mean_field.stress / exact.stress - 1.0)

    def first_moment_onset(self, speed: Array, bonds: BondNumbers, body: Body) -> Onset:
        return cast(
            Onset,
            schallamach.first_moment_onset(
                speed, self.zero_force_rate, self.bell_force, *bonds, body
            ),
        )


@keyed()
class CutOff(_Law):
    """A bond opens by itself at one rate and breaks at a stretch for certain (after Chernyak & Leonov)."""

    stretch: Annotated[
        float,
        Quantity("m", "stretch at which a bond breaks", "l", above=0, typical="30 nm"),
    ]
    rate: Annotated[
        float,
        Quantity(
            "1/s", "rupture rate of a bond below that stretch", "1/t_0", at_least=0
        ),
    ] = 0.0
    model: Literal["cut_off"] = "cut_off"

    models: ClassVar[tuple[str, ...]] = "rate", "cohort", "tracked"

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(self.rate, 0.0, self.stretch)


@keyed()
class Catch(_Law):
    """Force closes one pathway of rupture and opens another: k = kc exp(−f/f_c) + ks exp(f/f_s). Limit: ``Bell``."""

    models: ClassVar[tuple[str, ...]] = ("cohort",)

    catch_rate: Annotated[
        float,
        Quantity(
            "1/s",
            "rate of the pathway that is slowed by force",
            "k_c",
            at_least=0,
            typical="1e5 1/s",
        ),
    ]
    catch_force: Annotated[
        float,
        Quantity(
            "N",
            "force that divides the catch rate by e",
            "f_c",
            above=0,
            typical="4 pN",
        ),
    ]
    slip_rate: Annotated[
        float,
        Quantity(
            "1/s",
            "rate of the pathway that is accelerated by force",
            "k_s",
            above=0,
            typical="1e3 1/s",
        ),
    ]
    slip_force: Annotated[
        float,
        Quantity(
            "N",
            "force that multiplies the slip rate by e",
            "f_s",
            above=0,
            typical="8 pN",
        ),
    ]
    model: Literal["catch"] = "catch"

    @property
    def pathways(self) -> tuple[tuple[float, float], ...]:  # type: ignore[override]
        return (self.catch_rate, -self.catch_force), (self.slip_rate, self.slip_force)

    def law(self, bond_stiffness: float) -> RuptureRate:
        slip, catch = (
            bond_stiffness / self.slip_force,
            bond_stiffness / self.catch_force,
        )
        return RuptureRate(self.slip_rate, slip, math.inf, self.catch_rate, catch)


Rupture = Annotated[Constant | Bell | CutOff | Catch, Field(discriminator="model")]


@device
def rate_at(stretch, law):
    """Return the rupture rate of a bond of a stretch below any limit under the numbers of a ``RuptureRate``."""
    size = math.fabs(stretch)
    if law.table > 0.0:
        return mean_and_value(size, law.table)[1]
    return law.rate * exp(size * law.softness) + law.catch * exp(-size * law.relief)


@device
def rates_at(stretches, law, rates):
    """Write the rupture rates of bonds of many stretches, below any limit."""
    rate, softness, catch, relief = law.rate, law.softness, law.catch, law.relief
    if law.table > 0.0:
        for i in range(stretches.size):
            rates[i] = mean_and_value(math.fabs(stretches[i]), law.table)[1]
        return
    for i in range(stretches.size):
        size = math.fabs(stretches[i])
        rates[i] = rate * exp(size * softness) + catch * exp(-size * relief)


@device
def rupture_integral(stretch, slip, duration, rate, softness):
    """Return ∫k dt of a bond whose stretch x goes from ``stretch`` by ``slip`` at constant speed, of any sign.

    The rate is ``rate`` × e^(\\|x\\| ``softness``), the softness of either sign.

    Notes
    -----
    ``rate`` × ``duration`` × the mean of e^y along the way, y = \\|x\\| × softness: e^y0 expm1(d)/d on one side of
    zero, y0 at the smaller stretch, (expm1(y0) + expm1(y1))/(y0 + y1) across it. Nothing cancels.
    """
    whole, sign = rate * duration, math.copysign(1.0, softness)
    if whole == 0.0:
        return 0.0
    before, change = stretch * softness, slip * softness
    after = before + change
    if before * after >= 0.0:
        distance = sign * math.fabs(change)
        least = sign * min(math.fabs(before), math.fabs(after))
        return whole * math.exp(least) * mean_growth(distance)
    before, after = sign * math.fabs(before), sign * math.fabs(after)
    return whole * (math.expm1(before) + math.expm1(after)) / (before + after)


@device
def time_to_rupture(stretch, speed, threshold, rate, softness, limit):
    """Return the time after which ∫k dt has reached ``threshold`` or the stretch its limit, at constant ``speed``.

    The speed has any sign. The time is infinite if neither ever happens.
    """
    pace = math.fabs(speed) * softness
    size = math.fabs(stretch) * softness
    first = rate * math.exp(size)
    if pace == 0.0:
        time = threshold / first
    elif stretch * speed >= 0.0:
        time = math.log1p(pace * threshold / first) / pace
    else:
        spent = rate * math.expm1(size) / pace
        if threshold < spent:
            time = -math.log1p(-pace * threshold / first) / pace
        else:
            time = size / pace + math.log1p(pace * (threshold - spent) / rate) / pace
    if speed != 0.0 and limit < math.inf:
        ahead = stretch if speed > 0.0 else -stretch
        time = (
            min(time, (limit - ahead) / math.fabs(speed))
            if time == time
            else (limit - ahead) / math.fabs(speed)
        )
    return time


#: Change of the integral of a table over its size below which its difference is no longer good to 1e-10.
_SHORT = 1e-3
_NEAR, _FAR = 0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)


@device
def _table_integral(stretch, slip, duration, table):
    """Return ∫k dt of a bond under the rate of a table: over a short way by Gauss's rule, without a difference."""
    before, after = math.fabs(stretch), math.fabs(stretch + slip)
    first = math.copysign(before * mean_and_value(before, table)[0], stretch)
    last = math.copysign(after * mean_and_value(after, table)[0], stretch + slip)
    if math.fabs(last - first) > _SHORT * (math.fabs(first) + math.fabs(last)):
        return duration * (last - first) / slip
    near, far = math.fabs(stretch + _NEAR * slip), math.fabs(stretch + _FAR * slip)
    return (
        0.5
        * duration
        * (mean_and_value(near, table)[1] + mean_and_value(far, table)[1])
    )


@inlined
def hazard_integral(stretch, slip, duration, law):
    """Return ∫k dt under a ``RuptureRate`` of a bond whose stretch goes from ``stretch`` by ``slip``."""
    if law.table > 0.0:
        return _table_integral(stretch, slip, duration, law.table)
    slipping = rupture_integral(stretch, slip, duration, law.rate, law.softness)
    if law.catch == 0.0:
        return slipping
    return slipping + rupture_integral(stretch, slip, duration, law.catch, -law.relief)


@device
def fresh_integral(age, speed, law):
    """Return ∫k dt of a bond born unstretched, up to an ``age``; a smooth continuation of it at a negative age."""
    pace = math.fabs(speed)
    if law.table > 0.0:
        mean = mean_and_value(pace * math.fabs(age), law.table)[0]
        return age * (mean if age > 0.0 else law.rate * law.rate / mean)
    slipping = law.rate * age * mean_growth(pace * law.softness * age)
    if law.catch == 0.0:
        return slipping
    return slipping + law.catch * age * mean_growth(-pace * law.relief * age)


@device
def has_factor(law):
    """True if ∫k dt of a bond is that of a fresh one times a factor of its stretch, under the same motion."""
    return law.catch == 0.0 and law.table == 0.0


@device
def growth(stretch, slip, law):
    """Return ∫k dt of a bond over that of a fresh one for any motion along ``slip``; 0 if there is no such factor."""
    along = stretch * slip >= 0.0 and has_factor(law)
    return exp(min(math.fabs(stretch) * law.softness, 690.0)) if along else 0.0


@inlined
def hazard_time(stretch, speed, threshold, law):
    """Return the time after which ∫k dt has reached ``threshold`` or the stretch its limit, at constant ``speed``.

    By Newton's method within a bracket unless it is closed. The slip pathway of a catch bond alone takes longer.
    """
    rate = 0.0 if law.table > 0.0 else law.rate
    slipping = time_to_rupture(stretch, speed, threshold, rate, law.softness, law.limit)
    if has_factor(law):
        return slipping
    return _time_before(slipping, stretch, speed, threshold, law)


@device
def _time_before(latest, stretch, speed, threshold, law):
    """Return the time of ``hazard_time`` before a ``latest`` one, by Newton's method."""
    low, high = 0.0, min(1e300, latest)
    time = min(high, threshold / rate_at(stretch, law))
    for _ in range(400):
        over = hazard_integral(stretch, speed * time, time, law) - threshold
        if over > 0.0:
            high = time
        else:
            low = time
        better = time - over / rate_at(stretch + speed * time, law)
        if math.fabs(better - time) <= 1e-15 * time:
            break
        # far beyond, the integral is exponential, and Newton's steps are short
        is_near = over < 2.0 * threshold and low < better < high
        better = better if is_near else 0.5 * (low + high)
        time = better
    return time
