"""Power spectral density of the fluctuating shear stress: families, tables, measured maps, finite contacts."""

from sim.spectrum.bond_made import BondMade
from sim.spectrum.families import AnisotropicGaussian, Band, Gaussian, Ripple, SelfAffine, Spectrum, VonKarman
from sim.spectrum.finite_contact import disc_energy, marginal_energy
from sim.spectrum.measured import Measured
from sim.spectrum.periodogram import periodogram, radial_average
from sim.spectrum.tabulated import Tabulated

__all__ = [
    "AnisotropicGaussian", "Band", "BondMade", "Gaussian", "Measured", "Ripple", "SelfAffine", "Spectrum",
    "Tabulated", "VonKarman", "disc_energy", "marginal_energy", "periodogram", "radial_average",
]  # fmt: skip


def __dir__() -> list[str]:
    return __all__
