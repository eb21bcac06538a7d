"""Surface energy as a sum over bands of modes, one squared Ornstein-Uhlenbeck process each."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.numerics.jit import kernel
from sim.numerics.noise import Noise, gamma, normal, stream
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

    def _renew(self, values: Array, keep: Array, renew: Array, size: Array, step: int, noise: Noise) -> Array:
        energy = np.empty((len(keep), len(values)))
        _renew_bands(values, keep, renew, size, self.shapes, self.half_weight, *noise.at(step), energy)
        return energy

    @property
    def gammas(self) -> Gammas:
        return Gammas(self.bands.weight, 0.5 * self.bands.freedom, self.wavenumber)

    def known_errors(self) -> dict[str, float]:
        """Errors that banding adds to the cell's own mode sum, and the cell's own errors beside them."""
        return self.cell_errors | self.bands.errors | {"bands": float(self.bands.weight.size)}


@kernel(
    "void(float64[:,::1], float64[:,:,:], float64[:,:,:], float64[:,:], float64[::1], float64[::1],"
    " uint64, uint64, uint64[::1], int64, float64[:,::1])"
)
def _renew_bands(values, keep, renew, size, shapes, half_weight, seed, part, members, step, energy):
    """Exact steps of all bands of all members in place, and their energy at the end of each."""
    many = keep.shape[2] > 1
    for m in range(members.size):
        own = m % keep.shape[1]
        for s in range(len(keep)):
            numbers = stream(seed, part, members[m], step + s, 0)
            total, unit = 0.0, size[s, m % size.shape[1]]
            for k in range(shapes.size):
                i = k if many else 0
                x, share = values[m, k], renew[s, own, i]
                if share != 0.0:  # else nothing has passed: not even a rounding
                    one, numbers = normal(numbers)
                    rest, numbers = gamma(shapes[k], numbers)
                    kick = share * unit
                    moved = kick * one + keep[s, own, i] * math.sqrt(x)
                    x = moved * moved + 2.0 * kick * kick * rest
                values[m, k] = x
                total += half_weight[k] * x
            energy[s, m] = total
