"""Power spectral density of the fluctuating shear stress: families, tables, measured maps, finite contacts."""

from sim.spectrum.families import (
    AnisotropicGaussian,
    Band,
    BondMade,
    Gaussian,
    Ripple,
    SelfAffine,
    Spectrum,
    VonKarman,
)
from sim.spectrum.measured import Measured, Tabulated, periodogram, radial_average
from sim.spectrum.radial import disc_energy, marginal_energy

__all__ = [
    "AnisotropicGaussian",
    "Band",
    "BondMade",
    "Gaussian",
    "Measured",
    "Ripple",
    "SelfAffine",
    "Spectrum",
    "Tabulated",
    "VonKarman",
    "disc_energy",
    "marginal_energy",
    "periodogram",
    "radial_average",
]


def __dir__() -> list[str]:
    return __all__
