"""Laws for the amplitude of the stress fluctuations."""

import math
from dataclasses import replace
from typing import Annotated, ClassVar, Literal, Self, cast

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.numerics.jit import kernel, law
from sim.parts.exchange import Array, Motion, Motions
from sim.units.quantity import Quantity

_Memory = Annotated[
    float, Quantity("m", "slip that the fluctuations remember, by default the correlation length", "l_m", above=0)
]
Relaxing = Annotated[bool, Field(description="true: only what the correlation renews has the new size")]
#: What a law that lives in the moment keeps of the past.
NO_PAST = np.empty(0)


class _OfTheMoment:
    """Attributes of laws that depend on speed and stress of the moment alone; a subclass gives ``factor``."""

    #: Whether the amplitude depends on the sliding before.
    remembers: ClassVar[bool] = False

    def within(self, length: float) -> Self:
        """The law in a field with this correlation length [m]."""
        return self

    def factor(self, speed: Array, stress: Array) -> Array:
        """g [1] in steady sliding at a speed [m/s] and mean shear stress [Pa], shape of the argument it reads."""
        raise NotImplementedError

    def started(self, motion: Motion, stress: Array) -> tuple[Array, Array]:
        """What is kept of the past at t = 0, and g [1]."""
        return NO_PAST, self.factor(motion.speed, stress)

    def followed(self, past: Array, motions: Motions, stress: Array) -> tuple[Array, Array]:
        """What is kept of the past after a block of steps, and g [1] at the end of each."""
        return past, self.factor(motions.speed, stress)


@dataclass(frozen=True, config={"extra": "forbid"})
class Constant(_OfTheMoment):
    """The fluctuations have the spectrum's rms at every speed: g = 1."""

    reads_stress: ClassVar[bool] = False
    relaxing: ClassVar[bool] = False

    model: Literal["constant"] = "constant"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.ones(speed.shape)


@dataclass(frozen=True, config={"extra": "forbid"})
class Onset(_OfTheMoment):
    """A prescribed amplitude around the onset of stick-slip: g = floor + (1 − floor)/(1 + (V/V0)^(−1/width)).

    A stand-in: that fluctuations set in near ``speed`` is the paper's supposition, without a mechanism.
    With ``relaxing`` only what the correlation renews has the new size; otherwise the whole field scales
    at once.
    """

    reads_stress: ClassVar[bool] = False

    speed: Annotated[float, Quantity("m/s", "speed at the onset of the fluctuations", "V_0", above=0)]
    width: Annotated[float, Quantity("1", "width of the onset in the logarithm of speed", "b", above=0)]
    floor: Annotated[float, Quantity("1", "share of the rms far below the onset", "g_0", at_least=0, at_most=1)] = 0.0
    relaxing: Relaxing = False
    model: Literal["onset"] = "onset"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.asarray(_onset(speed, self.speed, -1.0 / self.width, self.floor))


@law
def _onset(speed, onset, exponent, floor):
    return floor + (1.0 - floor) * (1.0 / (1.0 + math.pow(math.fabs(speed) / onset, exponent)))


@dataclass(frozen=True, config={"extra": "forbid"})
class Stress(_OfTheMoment):
    """The fluctuations grow with the mean shear stress: g = tau_0/reference."""

    reads_stress: ClassVar[bool] = True

    reference: Annotated[
        float, Quantity("Pa", "mean shear stress at which the rms is the spectrum's", "tau_ref", above=0)
    ]
    relaxing: Relaxing = False
    model: Literal["stress"] = "stress"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.abs(stress) / self.reference


@dataclass(frozen=True, config={"extra": "forbid"})
class SlipRate(_OfTheMoment):
    """The fluctuations grow where sliding is unsteady: g² = floor² + (1 − floor²) × variance of the speed over ⟨V²⟩.

    Means are over the past with the weight e^(−s/l) for the distance s slid since, l the ``memory_length``: a field
    knows the last l of sliding. Steady sliding has the floor, stick-slip that slides the share d of the time
    1 − d. Rest changes nothing until sliding resumes, then it counts as part of the past.

    Notes
    -----
    With A_j = ∫ e^(−s/l) \\|V\\|^j dt, g² = floor² + (1 − floor²)(1 − A1²/(A0 A2)). Kept are A0, the mean speed
    A1/A0, A2 − A1²/A0 and the time at rest since the last slip. Within a clock step all of its
    sliding has one weight, the mean of it over the step.
    """

    reads_stress: ClassVar[bool] = False
    remembers: ClassVar[bool] = True

    memory_length: _Memory | None = None
    floor: Annotated[float, Quantity("1", "share of the rms in steady sliding", "g_0", at_least=0, at_most=1)] = 0.0
    relaxing: Relaxing = False
    model: Literal["slip_rate"] = "slip_rate"

    def within(self, length: float) -> Self:
        return self if self.memory_length is not None else replace(self, memory_length=length)

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.full(speed.shape, self.floor)

    def started(self, motion: Motion, stress: Array) -> tuple[Array, Array]:
        speed = np.abs(motion.speed)
        past = np.zeros((len(speed), 4))
        past[:, 1] = speed
        np.divide(cast(float, self.memory_length), speed, out=past[:, 0], where=speed > 0.0)
        return past, self.factor(speed, stress)

    def followed(self, past: Array, motions: Motions, stress: Array) -> tuple[Array, Array]:
        past, unsteady = past.copy(), np.empty(motions.path.shape)
        spread = motions.unsteady + np.zeros(motions.path.shape)
        _remember(past, motions.path, motions.duration.ravel(), spread, self.memory_length, unsteady)
        return past, np.sqrt(self.floor**2 + (1.0 - self.floor**2) * unsteady)


@kernel("void(float64[:, ::1], float64[:,:], float64[:], float64[:,:], float64, float64[:, ::1])")
def _remember(past, path, duration, spent, length, unsteady):
    """What each row keeps of its past after one step after the other, in place, and how unsteady it is then."""
    for m in range(len(past)):
        weight, mean, spread, rest = past[m]
        for s in range(len(duration)):
            if path[s, m] == 0.0:
                rest += duration[s] if weight > 0.0 else 0.0
            else:
                if rest > 0.0:
                    spread += weight * rest / (weight + rest) * mean * mean
                    mean *= weight / (weight + rest)
                    weight += rest
                    rest = 0.0
                renewed = -math.expm1(-path[s, m] / length)
                share = renewed * length / path[s, m] if renewed > 0.0 else 1.0
                weight, spread, gained = weight * (1.0 - renewed), spread * (1.0 - renewed), duration[s] * share
                further = path[s, m] / duration[s] - mean
                spread += share * spent[s, m] + weight * gained / (weight + gained) * further * further
                mean += further * gained / (weight + gained)
                weight += gained
            unsteady[s, m] = spread / (spread + weight * mean * mean) if spread > 0.0 else 0.0
        past[m, 0], past[m, 1], past[m, 2], past[m, 3] = weight, mean, spread, rest


Amplitude = Annotated[Constant | Onset | Stress | SlipRate, Field(discriminator="model")]
