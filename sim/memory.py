"""How long the shear-stress fluctuations remember, and how large they grow with the speed.

A memory gives each mode the integral of its rate lambda over a step: amplitudes keep the share
exp(−∫λdt), their energy exp(−2∫λdt). A growth gives the factor g by which the field exceeds the
unit field that the spectrum describes.
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.motion import Motion
from sim.units.quantity import Quantity


@dataclass(frozen=True, config={"extra": "forbid"})
class Time:
    """Modes renew in time: λ = 1/time."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 0

    time: Annotated[float, Quantity("s", "memory time of the fluctuations", "t_m", above=0)]
    model: Literal["time"] = "time"

    def exponents(self, wavenumber: np.ndarray, motion: Motion) -> np.ndarray:
        """∫λdt over the step, shape (1,) or that of ``wavenumber`` [rad/m]."""
        return np.array([motion.duration / self.time])


@dataclass(frozen=True, config={"extra": "forbid"})
class Slip:
    """Modes renew by sliding: λ = \\|V\\|/length, so a contact at rest keeps its pattern."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 0

    length: Annotated[float, Quantity("m", "memory length of the fluctuations", "l", above=0)]
    model: Literal["slip"] = "slip"

    def exponents(self, wavenumber: np.ndarray, motion: Motion) -> np.ndarray:
        return motion.path / self.length


@dataclass(frozen=True, config={"extra": "forbid"})
class Wave:
    """A mode renews after sliding ``waves`` of its own wavelengths: λ = \\|V\\| q/(2π waves)."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 1

    waves: Annotated[float, Quantity("1", "own wavelengths after which a mode renews", "n", above=0)]
    model: Literal["wave"] = "wave"

    def exponents(self, wavenumber: np.ndarray, motion: Motion) -> np.ndarray:
        return wavenumber * (motion.path / (2.0 * np.pi * self.waves))


@dataclass(frozen=True, config={"extra": "forbid"})
class Diffusion:
    """Modes diffuse away in time: λ = D q²."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 2

    diffusivity: Annotated[float, Quantity("m^2/s", "diffusivity of the fluctuations", "D", above=0)]
    model: Literal["diffusion"] = "diffusion"

    def exponents(self, wavenumber: np.ndarray, motion: Motion) -> np.ndarray:
        return wavenumber**2 * (self.diffusivity * motion.duration)


Memory = Annotated[Time | Slip | Wave | Diffusion, Field(discriminator="model")]


@dataclass(frozen=True, config={"extra": "forbid"})
class Constant:
    """The fluctuations have the spectrum's rms at every speed: g = 1."""

    reads_stress: ClassVar[bool] = False
    relaxing: ClassVar[bool] = False

    model: Literal["constant"] = "constant"

    def factor(self, speed: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """g [1] at the speed [m/s] and mean shear stress [Pa], shape of the argument it reads."""
        return np.ones(1)


@dataclass(frozen=True, config={"extra": "forbid"})
class Onset:
    """A prescribed growth around the onset of stick-slip: g = floor + (1 − floor)/(1 + (V/V0)^(−1/width)).

    A stand-in: it says *that* fluctuations set in near ``speed``, as the paper supposes, not why.
    With ``relaxing`` only what the memory renews has the new size; otherwise the whole field scales
    at once.
    """

    reads_stress: ClassVar[bool] = False

    speed: Annotated[float, Quantity("m/s", "speed at the onset of the fluctuations", "V_0", above=0)]
    width: Annotated[float, Quantity("1", "width of the onset in the logarithm of speed", "b", above=0)]
    floor: Annotated[float, Quantity("1", "share of the rms far below the onset", "g_0", at_least=0, at_most=1)] = 0.0
    relaxing: bool = False
    model: Literal["onset"] = "onset"

    def factor(self, speed: np.ndarray, stress: np.ndarray) -> np.ndarray:
        with np.errstate(divide="ignore", over="ignore"):
            rise = 1.0 / (1.0 + (np.abs(speed) / self.speed) ** (-1.0 / self.width))
        return self.floor + (1.0 - self.floor) * rise


@dataclass(frozen=True, config={"extra": "forbid"})
class Stress:
    """The fluctuations grow with the mean shear stress: g = tau_0/reference."""

    reads_stress: ClassVar[bool] = True

    reference: Annotated[
        float, Quantity("Pa", "mean shear stress at which the rms is the spectrum's", "tau_ref", above=0)
    ]
    relaxing: bool = False
    model: Literal["stress"] = "stress"

    def factor(self, speed: np.ndarray, stress: np.ndarray) -> np.ndarray:
        return np.abs(stress) / self.reference


Growth = Annotated[Constant | Onset | Stress, Field(discriminator="model")]
