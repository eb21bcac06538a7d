"""Isotropic spectra: a radial density, the variance within a circle, the energy.

A spectrum that is given by rows (a band, a self-affine law with cut-offs, a table, a measurement)
is a chain of power laws, whose integrals are closed forms.
"""

import functools
import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.laws.halfspace import angular_compliance
from sim.spectrum.family import Array
from sim.spectrum.finite_contact import Waves
from sim.spectrum.pixels import Radial, radial_quadrant


class Isotropic(Waves, Radial, Protocol):
    """Base of the families whose density depends on the length of the wavevector only."""

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""

    def radial_density(self, q: ArrayLike) -> Array:
        """Density C at wavenumber q [rad/m], in Pa² m²; zero outside ``support``."""

    def harmonics(self, q: Array) -> tuple[Array, Array]:
        """``∫ C dθ`` and ``∫ C cos 2θ dθ`` over the directions at wavenumber q [Pa² m²]."""
        return 2 * math.pi * self.radial_density(q), np.zeros(())

    def density(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Power spectral density C at wavevector (qx, qy) [rad/m], in Pa² m²."""
        return self.radial_density(np.hypot(qx, qy))

    def surface_energy(self, shear_modulus: ArrayLike, poisson_ratio: ArrayLike = 0.5) -> Array:
        """Mean elastic energy per area [J/m²] stored by the fluctuations in an infinite half-space.

        ``ΔΓ = (2 - nu) / (8 pi G) ∫ C dq``, the angular mean of ``½ G_x C``; the normal-tangential
        coupling that exists for nu other than 1/2 is neglected.
        """
        mean, _ = angular_compliance(np.asarray(poisson_ratio, float))
        return mean / (4 * np.pi * np.asarray(shear_modulus, float)) * self.line_integral

    def pixels(self, step: float, reach: int) -> Array:
        """Variance in the pixels of a wavevector lattice [Pa²], see ``Family``."""
        quadrant = radial_quadrant(self, step, reach)
        return np.concatenate([quadrant[:0:-1], quadrant])


def _decay(x: Array) -> Array:
    """(1 - e^-x) / x for x >= 0, one at x = 0."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, -np.expm1(-safe) / safe)


@dataclass(frozen=True, eq=False)
class PowerLaws:
    """A radial density given by rows, a power law between neighbours, zero outside.

    Parameters
    ----------
    q : array, shape (rows,)
        Wavenumbers [rad/m], positive and increasing.
    density : array, shape (rows,)
        C at each row [Pa² m²], at least zero; next to a zero the interpolation is linear.

    Examples
    --------
    A flat spectrum between 1 and 2 rad/m holds (4 - 1)/(4 pi) times its level:

    >>> flat = PowerLaws(np.array([1.0, 2.0]), np.array([1.0, 1.0]))
    >>> print(round(4 * np.pi * float(flat.cumulative(9.0)), 12))
    3.0
    """

    q: Array
    density: Array

    def radial_density(self, q: ArrayLike) -> Array:
        """C(q), zero outside the rows."""
        inside = (np.asarray(q) >= self.q[0]) & (np.asarray(q) <= self.q[-1])
        return np.where(inside, self._value(*self._locate(q)), 0.0)

    def cumulative(self, q: ArrayLike) -> Array:
        """Variance within the circle of radius q: ``(1/2 pi) ∫ C q dq`` from 0 to q [Pa²]."""
        q, row = self._locate(q)
        held = np.concatenate([[0.0], np.cumsum(self._moments(1))])
        return (held[row] + self._piece(1, self.q[row], self.density[row], q, row)) / (2 * np.pi)

    def beyond(self, q: ArrayLike) -> Array:
        """Variance outside the circle of radius q [Pa²], without cancellation at large q."""
        q, row = self._locate(q)
        left = np.concatenate([np.cumsum(self._moments(1)[::-1])[::-1], [0.0]])
        return (left[row + 1] + self._piece(1, q, self._value(q, row), self.q[row + 1], row)) / (2 * np.pi)

    @functools.cached_property
    def line_integral(self) -> float:
        """∫ C dq over all q [Pa² m]."""
        return float(np.sum(self._moments(0)))

    def _moments(self, power: int) -> Array:
        """∫ q^power C dq of each piece."""
        rows = np.arange(len(self.q) - 1)
        return self._piece(power, self.q[:-1], self.density[:-1], self.q[1:], rows)

    def _locate(self, q: ArrayLike) -> tuple[Array, NDArray[np.intp]]:
        """q brought into the rows, and the piece it lies in."""
        q = np.clip(q, self.q[0], self.q[-1])
        return q, np.minimum(np.searchsorted(self.q, q, side="right") - 1, len(self.q) - 2)

    @functools.cached_property
    def _slopes(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Exponent where a piece is a power law, gradient where it is linear, and which it is."""
        linear = (self.density[1:] == 0.0) | (self.density[:-1] == 0.0)
        logs = np.log(np.where(self.density > 0.0, self.density, 1.0))
        exponent = np.where(linear, 0.0, np.diff(logs) / np.diff(np.log(self.q)))
        gradient = np.where(linear, np.diff(self.density) / np.diff(self.q), 0.0)
        return exponent, gradient, linear

    def _value(self, q: Array, row: NDArray[np.intp]) -> Array:
        """C at q by the law of its piece."""
        exponent, gradient, linear = self._slopes
        larger = row + (exponent[row] > 0.0)  # seen from there a power law only falls: no overflow
        power = self.density[larger] * np.exp(exponent[row] * np.log(q / self.q[larger]))
        straight = self.density[row] + gradient[row] * (q - self.q[row])
        return np.where(linear[row], np.maximum(straight, 0.0), power)

    def _piece(self, power: int, low: Array, level: Array, high: Array, row: NDArray[np.intp]) -> Array:
        """∫ q^power C dq from ``low``, where C = ``level``, to ``high`` in the same piece."""
        exponent, gradient, linear = self._slopes
        stretch = np.log(high / low)
        amplitude = (exponent[row] + power + 1) * stretch
        # from the end where q^(power+1) C is larger, so that steep rows cannot overflow
        lower = level * low ** (power + 1)
        upper = self._value(high, row) * high ** (power + 1)
        powered = np.where(amplitude > 0.0, upper, lower) * stretch * _decay(np.abs(amplitude))
        d, slope = high - low, gradient[row]
        straight = level * d + slope * d**2 / 2
        if power == 1:
            straight = low * straight + level * d**2 / 2 + slope * d**3 / 3
        return np.where(linear[row], straight, powered)


class Rowed(Isotropic, Protocol):
    """Base of isotropic spectra that are a chain of power laws."""

    @property
    def rows(self) -> PowerLaws:
        """The chain of power laws."""

    def radial_density(self, q: ArrayLike) -> Array:
        """Density C at wavenumber q [rad/m], in Pa² m²; zero outside ``support``."""
        return self.rows.radial_density(q)

    def cumulative(self, q: ArrayLike) -> Array:
        """Variance within wavenumber q [Pa²]."""
        return self.rows.cumulative(q)

    def beyond(self, q: ArrayLike) -> Array:
        """Variance beyond wavenumber q [Pa²]."""
        return self.rows.beyond(q)

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""
        return self.rows.line_integral

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²]."""
        return float(self.rows.cumulative(self.rows.q[-1]))

    @property
    def support(self) -> tuple[float, float]:
        """Wavenumbers [rad/m] between which the density may differ from zero."""
        return float(self.rows.q[0]), float(self.rows.q[-1])

    @property
    def breaks(self) -> Array:
        """Wavenumbers [rad/m] where the density jumps or kinks."""
        return self.rows.q
