"""Spectrum of the stress field of independent bonds, the force of each spread over a small disc."""

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike
from pydantic.dataclasses import dataclass

from sim.laws.halfspace import energy_factors
from sim.spectrum.family import Array, Factors
from sim.spectrum.finite_contact import disc_sums
from sim.spectrum.radial import Isotropic
from sim.units.quantity import Quantity

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(80)
_PHASE, _WEIGHTS = 0.25 * math.pi * (1 + _NODES), 0.25 * math.pi * _WEIGHTS


@dataclass(frozen=True, config={"extra": "forbid"})
class BondMade(Isotropic):
    """Field of bonds at random places, each pulling on a disc of radius ``footprint``; its size follows the bonds.

    Parameters
    ----------
    footprint : float
        b [m].

    Notes
    -----
    With n sites per area and a mean square force E[f²] per site ``C = n E[f²] (2 J1(qb)/(qb))²``: here for
    n E[f²] = 1 N²/m², so that the variance is 1/(πb²) and ``ΔΓ = (2 − ν) n E[f²]/(1.5 π² G b)``, which is
    n E[f²]/(π² G b) for an incompressible half-space. That is the energy stored under the bonds themselves: a
    force f moves its disc by 2f/(π²Gb).

    Examples
    --------
    Bonds of 10 pN that make 1 MPa (1e17 per m²) on discs of 1 nm:

    >>> print(f"{1e17 * 1e-22 * 1e3 * BondMade(footprint=1e-9).surface_energy(1.6e6):.2f} mJ/m^2")
    0.63 mJ/m^2
    """

    footprint: Annotated[float, Quantity("m", "radius of the disc that a bond pulls on", "b", above=0, typical="1 nm")]
    model: Literal["bonds"] = "bonds"

    bond_made: ClassVar[bool] = True

    def stiffest(self, shear_modulus: float, poisson_ratio: float = 0.5) -> float:
        """Stiffness of the half-space under one bond [N/m], π²Gb/2 for an incompressible one.

        A bond's own stiffness is in series with it, so the two together cannot be stiffer.
        """
        return 0.75 * math.pi**2 * shear_modulus * self.footprint / (2.0 - poisson_ratio)

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²] for n E[f²] = 1 N²/m²."""
        return 1.0 / (math.pi * self.footprint**2)

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""
        return 16.0 / (3.0 * math.pi * self.footprint)

    def radial_density(self, q: ArrayLike) -> Array:
        """Density C at wavenumber q [rad/m], in Pa² m²."""
        x = np.asarray(q, float) * self.footprint
        return np.square(np.where(x == 0.0, 1.0, 2.0 * scipy.special.j1(x) / np.where(x == 0.0, 1.0, x)))

    def cumulative(self, q: ArrayLike) -> Array:
        """Variance within wavenumber q [Pa²]: (1 − J0² − J1²)/(πb²), by its series where that cancels."""
        x = np.square(np.asarray(q, float) * self.footprint)
        series = x * (0.25 - x * (1.0 / 32.0 - x * (5.0 / 2304.0)))
        return self.variance * np.where(x < 1e-3, series, 1.0 - self._outside(q))

    def beyond(self, q: ArrayLike) -> Array:
        """Variance beyond wavenumber q [Pa²]."""
        return self.variance * self._outside(q)

    def on_disc(self, factors: Factors, radii: Array) -> tuple[Array, Array]:
        """Integrals over discs, in real space, where the field ends: its spectrum oscillates."""
        return disc_sums(self, radii, lambda radius: (self._overlap(factors, radius), 0.0))

    def _overlap(self, factors: Factors, radius: float) -> float:
        """``∫ C0 P dq``: that of J0(qs) q C/2π over q is the autocorrelation, the overlap of two footprints."""
        least = min(self.footprint, radius)
        distance = least * np.sin(_PHASE)  # half of it; the root at the end of the overlap becomes smooth
        u, v = distance / radius, distance / self.footprint
        disc = np.arccos(u) - (u * np.sqrt(1 - u * u) if factors is energy_factors else 0.0)
        bond = np.arccos(v) - v * np.sqrt(1 - v * v)
        return 16 / self.footprint**2 * float(np.sum(disc * bond * np.cos(_PHASE) * _WEIGHTS)) * least

    def _outside(self, q: ArrayLike) -> Array:
        x = np.asarray(q, float) * self.footprint
        return scipy.special.j0(x) ** 2 + scipy.special.j1(x) ** 2
