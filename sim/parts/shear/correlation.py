"""Laws for the correlation of the stress fluctuations in time, in slip or in both.

Each law gives the integral of a mode's rate λ over a step: amplitudes keep the share exp(−∫λdt) of themselves,
their energy exp(−2∫λdt).
"""

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field
from pydantic.dataclasses import dataclass

from sim.parts.exchange import Array, Motion, Motions
from sim.units.quantity import Quantity


@dataclass(frozen=True, config={"extra": "forbid"})
class Time:
    """Modes renew in time: λ = 1/time."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 0

    time: Annotated[float, Quantity("s", "correlation time of the fluctuations", "t_m", above=0)]
    model: Literal["time"] = "time"

    def exponents(self, wavenumber: Array, motion: Motion | Motions) -> Array:
        """∫λdt over a step, shape (1, 1) or (members, 1), or with that of ``wavenumber`` [rad/m] as last axis.

        Of a block with the step as first axis.
        """
        return np.asarray(motion.duration)[..., np.newaxis] / self.time


@dataclass(frozen=True, config={"extra": "forbid"})
class Slip:
    """Modes renew by sliding: λ = \\|V\\|/length, so a contact at rest keeps its pattern."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 0

    length: Annotated[float, Quantity("m", "correlation length of the fluctuations", "l", above=0)]
    model: Literal["slip"] = "slip"

    def exponents(self, wavenumber: Array, motion: Motion | Motions) -> Array:
        return motion.path[..., np.newaxis] / self.length


@dataclass(frozen=True, config={"extra": "forbid"})
class Wave:
    """A mode renews after sliding ``waves`` of its own wavelengths: λ = \\|V\\| q/(2π waves)."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 1

    waves: Annotated[float, Quantity("1", "own wavelengths after which a mode renews", "n", above=0)]
    model: Literal["wave"] = "wave"

    def exponents(self, wavenumber: Array, motion: Motion | Motions) -> Array:
        return wavenumber * (motion.path / (2.0 * np.pi * self.waves))[..., np.newaxis]


@dataclass(frozen=True, config={"extra": "forbid"})
class Diffusion:
    """Modes diffuse away in time: λ = D q²."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 2

    diffusivity: Annotated[float, Quantity("m^2/s", "diffusivity of the fluctuations", "D", above=0)]
    model: Literal["diffusion"] = "diffusion"

    def exponents(self, wavenumber: Array, motion: Motion | Motions) -> Array:
        return wavenumber**2 * (self.diffusivity * np.asarray(motion.duration)[..., np.newaxis])


Correlation = Annotated[Time | Slip | Wave | Diffusion, Field(discriminator="model")]
