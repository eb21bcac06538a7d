"""Laws for the amplitude of the stress fluctuations."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.numerics.jit import law
from sim.parts.exchange import Array
from sim.units.quantity import Quantity

Relaxing = Annotated[bool, Field(description="true: only what the correlation renews has the new size")]


@dataclass(frozen=True, config={"extra": "forbid"})
class Constant:
    """The fluctuations have the spectrum's rms at every speed: g = 1."""

    reads_stress: ClassVar[bool] = False
    relaxing: ClassVar[bool] = False

    model: Literal["constant"] = "constant"

    def factor(self, speed: Array, stress: Array) -> Array:
        """g [1] at the speed [m/s] and mean shear stress [Pa], shape of the argument it reads."""
        return np.ones(speed.shape)


@dataclass(frozen=True, config={"extra": "forbid"})
class Onset:
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
class Stress:
    """The fluctuations grow with the mean shear stress: g = tau_0/reference."""

    reads_stress: ClassVar[bool] = True

    reference: Annotated[
        float, Quantity("Pa", "mean shear stress at which the rms is the spectrum's", "tau_ref", above=0)
    ]
    relaxing: Relaxing = False
    model: Literal["stress"] = "stress"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.abs(stress) / self.reference


Amplitude = Annotated[Constant | Onset | Stress, Field(discriminator="model")]
