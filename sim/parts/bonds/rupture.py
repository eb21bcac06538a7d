"""Rupture rate of a bond of a given stretch: constant, Bell, constant with a cut-off stretch, catch.

All are one law of a few numbers, ``RuptureRate``. Compiled steps use a law through device functions alone: the
integral of the rate along a motion, the same of a fresh bond, the time to rupture.
"""

import math
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
from sim.laws.schallamach import Array, Body, Onset, SiteMoments
from sim.numerics.jit import device
from sim.numerics.special import exp
from sim.units.quantity import Quantity, keyed


class RuptureRate(NamedTuple):
    """Rupture rate of a bond of stretch x.

    ``rate`` [1/s] × exp(\\|x\\| ``softness`` [1/m]) + ``catch`` [1/s] × exp(−\\|x\\| ``relief`` [1/m]) up to the
    stretch ``limit`` [m], infinite beyond it.
    """

    rate: float
    softness: float
    limit: float
    catch: float = 0.0
    relief: float = 0.0

    @property
    def at_rest(self) -> float:
        """Rupture rate of an unstretched bond [1/s]."""
        return self.rate + self.catch

    def at(self, stretch: Array) -> Array:
        """Return the rupture rate of bonds of a stretch [m] below any limit [1/s]."""
        size = np.abs(stretch)
        rate = self.rate * np.exp(size * self.softness)
        return (
            rate + self.catch * np.exp(-size * self.relief)
            if self.catch > 0.0
            else rate
        )

    @property
    def steepness(self) -> float:
        """Largest relative change of the rate per stretch [1/m]."""
        return max(self.softness, self.relief if self.catch > 0.0 else 0.0)

    @property
    def one_pathway(self) -> bool:
        """True if all rupture is by one pathway that force opens, as Bell's."""
        return self.softness > 0.0 and self.catch == 0.0 and self.limit == math.inf


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

    ``depends_on_stretch``: true if the rupture depends on the stretch, by a limit or below it. ``separable``: true if
    ∫k dt of a bond is a factor of the bond times a common clock. The first moment and tracked bonds need this. A
    subclass has ``law``, its numbers for bonds of a stiffness [N/m], and ``closed_form``. The latter returns share
    bound [1], mean force [N] and mean square force [N²] per site in steady sliding at speeds [m/s].
    """

    depends_on_stretch: ClassVar[bool] = True
    separable: ClassVar[bool] = True
    #: Pathways of rupture as of the law ``resolved_onset``; none if force opens no pathway.
    pathways: ClassVar[tuple[tuple[float, float], ...]] = ()

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

    depends_on_stretch: ClassVar[bool] = False

    rate: Annotated[float, Quantity("1/s", "rupture rate of a bond", "k_0", above=0)]
    model: Literal["constant"] = "constant"

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(self.rate, 0.0, math.inf)

    def closed_form(
        self, speed: Array, bond_stiffness: float, rebinding_rate: float
    ) -> SiteMoments:
        return schallamach.constant_moments(
            speed, self.rate, bond_stiffness, rebinding_rate
        )


ZeroForceRate = Annotated[
    float,
    Quantity(
        "1/s", "rupture rate of an unstretched bond", "k_0", above=0, typical="1e4 1/s"
    ),
]
HalfSpeed = Annotated[
    float,
    Quantity("m/s", "speed at which half of the bonds are intact", "V_c", above=0),
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

    @property
    def pathways(self) -> tuple[tuple[float, float], ...]:  # type: ignore[override]
        return ((self.zero_force_rate, self.bell_force),)

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(
            self.zero_force_rate, bond_stiffness / self.bell_force, math.inf
        )

    def closed_form(
        self, speed: Array, bond_stiffness: float, rebinding_rate: float
    ) -> SiteMoments:
        return schallamach.bell_moments(
            speed, self.zero_force_rate, self.bell_force, bond_stiffness, rebinding_rate
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

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(self.rate, 0.0, self.stretch)

    def closed_form(
        self, speed: Array, bond_stiffness: float, rebinding_rate: float
    ) -> SiteMoments:
        return schallamach.cut_off_moments(
            speed, self.rate, self.stretch, bond_stiffness, rebinding_rate
        )


@keyed()
class Catch(_Law):
    """Force closes one pathway of rupture and opens another: k = kc exp(−f/f_c) + ks exp(f/f_s). Limit: ``Bell``."""

    separable: ClassVar[bool] = False

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

    def closed_form(
        self, speed: Array, bond_stiffness: float, rebinding_rate: float
    ) -> SiteMoments:
        law = self.catch_rate, self.catch_force, self.slip_rate, self.slip_force
        return schallamach.catch_moments(speed, *law, bond_stiffness, rebinding_rate)


Rupture = Annotated[Constant | Bell | CutOff | Catch, Field(discriminator="model")]


@device
def rate_at(stretch, law):
    """Return the rupture rate of a bond of a stretch below any limit under a ``RuptureRate``."""
    rate, softness, _, catch, relief = law
    size = math.fabs(stretch)
    return rate * exp(size * softness) + catch * exp(-size * relief)


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
        mean = 1.0 if distance == 0.0 else math.expm1(distance) / distance
        return whole * math.exp(sign * min(math.fabs(before), math.fabs(after))) * mean
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


@device
def hazard_integral(stretch, slip, duration, law):
    """Return ∫k dt under a ``RuptureRate`` of a bond whose stretch goes from ``stretch`` by ``slip``."""
    rate, softness, _, catch, relief = law
    slipping = rupture_integral(stretch, slip, duration, rate, softness)
    return (
        slipping + rupture_integral(stretch, slip, duration, catch, -relief)
        if catch > 0.0
        else slipping
    )


@device
def fresh_integral(age, speed, law):
    """Return ∫k dt of a bond born unstretched, up to an ``age``; its analytic continuation at a negative age."""
    rate, softness, _, catch, relief = law
    change = math.fabs(speed) * softness * age
    slipping = rate * age * (math.expm1(change) / change if change != 0.0 else 1.0)
    if catch == 0.0:
        return slipping
    change = -math.fabs(speed) * relief * age
    return slipping + catch * age * (
        math.expm1(change) / change if change != 0.0 else 1.0
    )


@device
def growth(stretch, slip, law):
    """Return ∫k dt of a bond over that of a fresh one for any motion along ``slip``; 0 if there is no such factor."""
    along = stretch * slip >= 0.0 and law[3] == 0.0
    return exp(min(math.fabs(stretch) * law[1], 690.0)) if along else 0.0


@device
def hazard_time(stretch, speed, threshold, law):
    """Return the time after which ∫k dt has reached ``threshold`` or the stretch its limit, at constant ``speed``.

    With a catch pathway by Newton's method within a bracket; the slip pathway alone takes longer.
    """
    rate, softness, limit, catch, _ = law
    slipping = time_to_rupture(stretch, speed, threshold, rate, softness, limit)
    if catch == 0.0:
        return slipping
    low, high = 0.0, min(slipping, 1e300)
    time = min(
        high, threshold / (rate * math.exp(math.fabs(stretch) * softness) + catch)
    )
    for _ in range(200):
        over = hazard_integral(stretch, speed * time, time, law) - threshold
        if over > 0.0:
            high = time
        else:
            low = time
        better = time - over / rate_at(stretch + speed * time, law)
        better = better if low < better < high else 0.5 * (low + high)
        if math.fabs(better - time) <= 1e-15 * time:
            break
        time = better
    return time
