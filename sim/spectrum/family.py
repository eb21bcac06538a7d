"""What every power spectrum of the shear stress offers: the contract of the families."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
#: Shares of a wave's energy that a disc holds as a function of x = 2qa, see ``sim.laws.halfspace``.
Factors = Callable[[Array], tuple[Array, Array]]


class Family(Protocol):
    """Power spectral density C of the fluctuating shear stress [Pa² m²] over wavevectors q [rad/m]; frozen."""

    def __hash__(self) -> int: ...

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²]."""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on what is assumed of the spectrum, for ``sim check``."""

    @property
    def support(self) -> tuple[float, float]:
        """Wavenumbers between which the density may differ from zero [rad/m]."""

    @property
    def wavevector(self) -> tuple[float, float] | None:
        """(qx, qy) of the one pair ±q that holds all of the power [rad/m]; None where there is a density."""

    @property
    def bond_made(self) -> bool:
        """True if bonds make the field: C is then that of n <f²> = 1 N²/m², and the bonds set its size."""

    def density(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Power spectral density C at wavevector (qx, qy) [Pa² m²]; raises ValueError for a single wave."""

    def surface_energy(self, shear_modulus: ArrayLike, poisson_ratio: ArrayLike = 0.5) -> Array:
        """Mean elastic energy per area of an infinite half-space [J/m²] under this stress."""

    def pixels(self, step: float, reach: int) -> Array:
        """Variance in each pixel around the points of a square wavevector lattice [Pa²], its side ``step`` in rad/m.

        Shape (2 reach + 1, reach + 1): rows ix = -reach ... reach, columns iy = 0 ... reach; q = 0 included.
        """

    def on_disc(self, factors: Factors, radii: Array) -> tuple[Array, Array]:
        """Integrals ∫ C0 P dq and ∫ C2 S dq over discs of given radii [Pa² m], see ``sim.spectrum.finite_contact``."""
