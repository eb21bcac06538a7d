"""Periodic square cell: coordinates, wavevectors, the Fourier pair and Parseval's sum.

Conventions, once for the whole project. A field f(x, y) is an array (..., points, points): axis -2
is x (the sliding direction), axis -1 is y, axes before them are members or times. Its spectrum is
``f(q) = integral of f(x) exp(-i q.x) d2x`` and back ``f(x) = (1/2pi)^2 integral of f(q)
exp(i q.x) d2q``; on the cell the second integral is the sum over its lattice of wavevectors divided
by the cell's area. Fields are real, so only the half with qy >= 0 is kept (a *half spectrum*, array
(..., points, points//2 + 1)); ``multiplicity`` is the number of wavevectors that each of its columns
stands for.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from sim.numerics.jit import kernel


def _read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


@dataclass(frozen=True)
class Grid:
    """Square periodic cell with points x points samples, an odd or an even number of them.

    Parameters
    ----------
    cell : float
        Side L of the cell [m].
    points : int
        Samples n per side; sample i stands at i L / n.

    Raises
    ------
    ValueError
        If the side is not a positive number or there is not at least one point.

    Examples
    --------
    A ripple of unit amplitude has the mean square 1/2, in real space and from its spectrum:

    >>> grid = Grid(cell=2.0, points=15)
    >>> ripple = np.cos(2.0 * np.pi * grid.position / grid.cell)[:, None] * np.ones(15)
    >>> print(f"{np.mean(ripple**2):.6f} {grid.mean_square(grid.forward(ripple)):.6f}")
    0.500000 0.500000
    """

    cell: float
    points: int

    def __post_init__(self) -> None:
        if not 0.0 < self.cell < math.inf:
            raise ValueError(f"cell must be a positive length, not {self.cell!r}")
        if self.points != int(self.points) or self.points < 1:
            raise ValueError(f"points must be a whole number, at least 1, not {self.points!r}")

    @property
    def spacing(self) -> float:
        """Distance between neighbouring samples [m]."""
        return self.cell / self.points

    @cached_property
    def position(self) -> np.ndarray:
        """Coordinate of the samples along one side [m], shape (points,), from 0."""
        return _read_only(np.arange(self.points) * self.spacing)

    @cached_property
    def wavevectors(self) -> tuple[np.ndarray, np.ndarray]:
        """Components qx (points, 1) and qy (1, points//2 + 1) of the half spectrum [rad/m].

        For an even number of points the Nyquist row carries qx = -pi/spacing and the Nyquist
        column qy = +pi/spacing: only its modulus has a meaning there.
        """
        step = 2.0 * math.pi / self.cell
        along = np.arange(self.points)
        along[along > (self.points - 1) // 2] -= self.points
        across = np.arange(self.points // 2 + 1)
        return _read_only(step * along[:, None]), _read_only(step * across[None, :])

    @cached_property
    def multiplicity(self) -> np.ndarray:
        """Wavevectors that a column of the half spectrum stands for, shape (points//2 + 1,).

        2 (q and -q), but 1 for the first column and, for an even number of points, the last:
        these hold both signs already.
        """
        count = np.full(self.points // 2 + 1, 2.0)
        count[0] = 1.0
        if self.points % 2 == 0:
            count[-1] = 1.0
        return _read_only(count)

    def forward(self, field: np.ndarray) -> np.ndarray:
        """Half spectrum [unit of the field x m^2] of a field, over the last two axes."""
        return scipy.fft.rfft2(field) * self.spacing**2

    def superpose(self, amplitudes: np.ndarray, between: np.ndarray, field: np.ndarray) -> None:
        """Write the sum over all wavevectors of amplitude × exp(i q.x), of a half spectrum, to ``field``.

        ``between`` has the shape of the amplitudes and is overwritten. Arrays used again save the system's time
        for new ones, as long as the transforms themselves.
        """
        np.fft.ifft(amplitudes, axis=0, norm="forward", out=between)
        np.fft.irfft(between, self.points, axis=1, norm="forward", out=field)

    def mode_sum(self, values: np.ndarray) -> np.ndarray:
        """Sum over all wavevectors of a real, even function given on the half spectrum.

        Every leading index is summed alone along one contiguous axis, so that a member's result
        keeps its bits whatever the batch it stands in.
        """
        counted = np.ascontiguousarray(values * self.multiplicity)
        return counted.reshape(*counted.shape[:-2], -1).sum(axis=-1)

    def weighted_power(self, fields: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Sum over all wavevectors of ``weight`` \\|f(q)\\|², for each field (..., m, m) of m <= points samples.

        Samples that a field lacks are 0. One field after the other, so that its spectrum stays in the cache.
        """
        shape = (self.points, self.points)
        # no name holds a spectrum, so that the next one takes its memory
        sums = [
            _weighted_power(scipy.fft.rfft2(field, s=shape), weight, self.multiplicity)
            for field in fields.reshape(-1, *fields.shape[-2:])
        ]
        return np.reshape(sums, fields.shape[:-2]) * self.spacing**4

    def mean_square(self, spectrum: np.ndarray) -> np.ndarray:
        """Mean over the cell of the squared field, from its half spectrum (Parseval)."""
        power = np.square(spectrum.real) + np.square(spectrum.imag)
        return self.mode_sum(power) / self.cell**4


@kernel("float64(complex128[:, ::1], Array(float64, 2, 'C', readonly=True), Array(float64, 1, 'C', readonly=True))")
def _weighted_power(spectrum, weight, multiplicity):
    """Sum of weight × \\|spectrum\\|² × multiplicity, column by column: vector instructions of any width agree."""
    columns, total = np.zeros(multiplicity.size), 0.0
    for i in range(weight.shape[0]):
        for j in range(multiplicity.size):
            value = spectrum[i, j]
            columns[j] += weight[i, j] * (value.real * value.real + value.imag * value.imag)
    for j in range(multiplicity.size):
        total += multiplicity[j] * columns[j]
    return total
