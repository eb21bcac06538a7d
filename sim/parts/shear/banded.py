"""Surface energy as a sum over bands of modes, one squared Ornstein-Uhlenbeck process each."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.numerics.jit import kernel
from sim.numerics.noise import Noise
from sim.parts.exchange import Array, Gammas
from sim.parts.shear.amplitude import Amplitude
from sim.parts.shear.bands import Bands
from sim.parts.shear.correlation import Correlation
from sim.parts.shear.process import Renewing


@dataclass(frozen=True)
class BandedProcess(Renewing):
    """ΔΓ as a sum of squared Ornstein-Uhlenbeck processes, one for each band of modes.

    Notes
    -----
    A band's X is chi-square distributed with k degrees of freedom, k >= 2 and not whole. With
    e = exp(−∫λdt) and c = 1 − e² one step is exact for any dt:
    X' = (√c Z + e √X)² + 2c Γ((k − 1)/2), Z normal and Γ a standard gamma number; ΔΓ = ½ Σ weight X.
    Where amplitude relaxes, c is that of the renewed part times its g².
    """

    bands: Bands
    cell_errors: dict[str, float]
    correlation: Correlation
    amplitude: Amplitude

    @property
    def pairs(self) -> int:
        """Numbers that a state holds, half as many as for a mode pair."""
        return (self.bands.weight.size + 1) // 2

    @cached_property
    def half_weight(self) -> Array:
        """Energy of a band for X = 1, shape (bands,) [J/m^2]."""
        return 0.5 * self.bands.weight

    @cached_property
    def shapes(self) -> Array:
        """Shapes of the gamma numbers, shape (bands,)."""
        return 0.5 * (self.bands.freedom - 1.0)

    @cached_property
    def wavenumber(self) -> Array:  # type: ignore[override]
        """Wavenumber of a mode that has each band's rate [rad/m]."""
        return self.bands.wavenumber

    def _empty(self, members: int) -> Array:
        return np.zeros((members, self.bands.weight.size))

    def _renew(
        self, values: Array, keep: Array, renew: Array, size: Array, step: int, noise: Noise
    ) -> tuple[Array, Array]:
        members, bands = values.shape
        after, energy = np.empty_like(values), np.empty(members)
        drawn = noise.normals(step, bands), noise.gammas(step, self.shapes)
        shares = np.full(bands, keep), np.full(bands, renew), np.full(members, size)
        _renew_bands(values, *drawn, *shares, self.half_weight, after, energy)
        return energy, after

    @property
    def gammas(self) -> Gammas:
        return Gammas(self.bands.weight, 0.5 * self.bands.freedom, self.wavenumber)

    def known_errors(self) -> dict[str, float]:
        """Errors that banding adds to the cell's own mode sum, and the cell's own errors beside them."""
        return self.cell_errors | self.bands.errors | {"bands": float(self.bands.weight.size)}


@kernel(
    "void(float64[:,::1], float64[:,:], float64[:,:], float64[:], float64[:], float64[:], float64[::1],"
    " float64[:,::1], float64[::1])"
)
def _renew_bands(before, normals, gammas, keep, renew, size, half_weight, after, energy):
    """One exact step of all bands of all members, and their energy."""
    members, bands = before.shape
    for m in range(members):
        total = 0.0
        for k in range(bands):
            kick = renew[k] * size[m]
            moved = kick * normals[m, k] + keep[k] * math.sqrt(before[m, k])
            x = moved * moved + 2.0 * kick * kick * gammas[m, k]
            if renew[k] == 0.0:  # nothing has passed: not even a rounding
                x = before[m, k]
            after[m, k] = x
            total += half_weight[k] * x
        energy[m] = total
