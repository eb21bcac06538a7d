"""How fast a bond of a given stretch breaks: constant, Bell, constant with a cut-off stretch.

All three are one law of three numbers: the rupture is rate × exp(\\|x\\| softness) for a stretch below
``limit`` and infinite beyond it. The compiled helpers know nothing else.
"""

import math
from typing import Annotated, Literal, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.numerics.jit import device
from sim.units.quantity import Quantity


class RuptureRate(NamedTuple):
    """Rupture rate of a bond: ``rate`` [1/s] × exp(\\|x\\| ``softness`` [1/m]) up to the stretch ``limit`` [m]."""

    rate: float
    softness: float
    limit: float


@dataclass(frozen=True, config={"extra": "forbid"})
class Constant:
    """Bonds open by themselves at one rate, however stretched they are."""

    rate: Annotated[float, Quantity("1/s", "rupture rate of a bond", "k_0", above=0)]
    model: Literal["constant"] = "constant"

    def law(self, bond_stiffness: float) -> RuptureRate:
        """The three numbers of this rupture for bonds of a stiffness [N/m]."""
        return RuptureRate(self.rate, 0.0, math.inf)


@dataclass(frozen=True, config={"extra": "forbid"})
class Bell:
    """Force helps heat to open a bond: k = k0 exp(f/f_b) (Bell 1978). Limit: ``Constant`` as f_b -> infinity."""

    zero_force_rate: Annotated[
        float, Quantity("1/s", "rupture rate of an unstretched bond", "k_0", above=0, typical="1e4 1/s")
    ]
    bell_force: Annotated[
        float, Quantity("N", "force that multiplies the rupture rate by e", "f_b", above=0, typical="4 pN")
    ]
    model: Literal["bell"] = "bell"

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(self.zero_force_rate, bond_stiffness / self.bell_force, math.inf)


@dataclass(frozen=True, config={"extra": "forbid"})
class CutOff:
    """A bond opens by itself at one rate and breaks at a stretch for certain (after Chernyak & Leonov)."""

    stretch: Annotated[float, Quantity("m", "stretch at which a bond breaks", "l", above=0, typical="30 nm")]
    rate: Annotated[float, Quantity("1/s", "rupture rate of a bond below that stretch", "1/t_0", at_least=0)] = 0.0
    model: Literal["cut_off"] = "cut_off"

    def law(self, bond_stiffness: float) -> RuptureRate:
        return RuptureRate(self.rate, 0.0, self.stretch)


Rupture = Annotated[Constant | Bell | CutOff, Field(discriminator="model")]


@device
def rupture_integral(stretch, slip, duration, rate, softness):
    """∫k dt of a bond whose stretch goes from ``stretch`` by ``slip`` at constant speed, of any sign.

    Notes
    -----
    ``rate`` × ``duration`` × the mean of e^\\|y\\| along the way, y = stretch × softness: e^min expm1(d)/d on
    one side of zero, (expm1\\|y0\\| + expm1\\|y1\\|)/(\\|y0\\| + \\|y1\\|) across it. Nothing cancels.
    """
    whole = rate * duration
    if whole == 0.0:
        return 0.0
    before, change = stretch * softness, slip * softness
    after = before + change
    if before * after >= 0.0:
        distance = math.fabs(change)
        mean = 1.0 if distance == 0.0 else math.expm1(distance) / distance
        return whole * math.exp(min(math.fabs(before), math.fabs(after))) * mean
    before, after = math.fabs(before), math.fabs(after)
    return whole * (math.expm1(before) + math.expm1(after)) / (before + after)


@device
def time_to_rupture(stretch, speed, threshold, rate, softness, limit):
    """Time after which ∫k dt has reached ``threshold`` or the stretch its limit, at constant ``speed`` of any sign.

    Infinite where neither ever happens.
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
        time = min(time, (limit - ahead) / math.fabs(speed)) if time == time else (limit - ahead) / math.fabs(speed)
    return time
