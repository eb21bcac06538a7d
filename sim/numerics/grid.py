"""Periodic cell, square or rectangular: coordinates, wavevectors, the Fourier pair and Parseval's sum.

Conventions, once for the whole project. A field f(x, y) is an array (..., points, points). Axis -2 is x (the sliding
direction) and axis -1 is y. Axes before them are members or times. Its spectrum is ``f(q) = integral of f(x) exp(-i
q.x) d2x`` and back ``f(x) = (1/2pi)^2 integral of f(q) exp(i q.x) d2q``. On the cell the second integral is the sum
over the lattice of wavevectors, divided by the area of the cell. Fields are real, so only the half with qy >= 0 is
stored (a *half spectrum*, array (..., points, points//2 + 1)). ``multiplicity`` is the number of wavevectors that each
column represents.
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
class Lattice:
    """Periodic cell of ``sides`` [m] along x and y with ``shape`` samples."""

    sides: tuple[float, float]
    shape: tuple[int, int]

    @property
    def area(self) -> float:
        """Area of the cell [m²]."""
        return self.sides[0] * self.sides[1]

    @property
    def pixel(self) -> float:
        """Area of a pixel [m²]."""
        return self.area / (self.shape[0] * self.shape[1])

    @property
    def faster(self) -> int:
        """Return the next number of points along x whose transform is fast; 0 if that of these points is.

        A prime factor above 50 makes transforms 1.5 to 3 times as long.
        """
        left = self.shape[0]
        for factor in range(2, 51):
            while left % factor == 0:
                left //= factor
        return int(scipy.fft.next_fast_len(self.shape[0])) if left > 1 else 0

    @cached_property
    def wavevectors(self) -> tuple[np.ndarray, np.ndarray]:
        """Components qx (points, 1) and qy (1, points//2 + 1) of the half spectrum [rad/m].

        For an even number of points the Nyquist row carries qx = -pi/spacing and the Nyquist
        column qy = +pi/spacing: only its modulus has a meaning there.
        """
        along = np.fft.ifftshift(np.arange(self.shape[0]) - self.shape[0] // 2)
        across = np.arange(self.shape[1] // 2 + 1)
        first, second = (2.0 * math.pi / side for side in self.sides)
        return _read_only(first * along[:, None]), _read_only(second * across[None, :])

    @cached_property
    def multiplicity(self) -> np.ndarray:
        """Wavevectors that a column of the half spectrum stands for, shape (points//2 + 1,).

        2 (q and -q), but 1 for the first column and, for an even number of points, the last:
        these hold both signs already.
        """
        count = np.full(self.shape[1] // 2 + 1, 2.0)
        count[[0] if self.shape[1] % 2 else [0, -1]] = 1.0
        return _read_only(count)

    def forward(self, field: np.ndarray) -> np.ndarray:
        """Half spectrum [unit of the field x m^2] of a field, over the last two axes."""
        return scipy.fft.rfft2(field) * self.pixel

    def superpose(self, amplitudes: np.ndarray, field: np.ndarray) -> None:
        """Write the sum over all wavevectors of amplitude × exp(i q.x), of a half spectrum, to ``field``.

        The amplitudes are overwritten. Arrays used again save the system's time for new ones, as long as the
        transforms themselves.
        """
        # several columns at once
        columns = scipy.fft.ifft(amplitudes, axis=0, norm="forward", overwrite_x=True)
        np.fft.irfft(columns, self.shape[1], axis=1, norm="forward", out=field)

    def weighted_power(self, fields: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Sum over all wavevectors of ``weight`` \\|f(q)\\|², for each field (..., m, n) of no more samples.

        A smaller field stands at the corner of the cell, with zeros beyond. The weight, on the half
        spectrum, is real and even. Every field is summed alone, and its spectrum is gone before the next.
        """
        # no name holds a spectrum, so that the next one takes its memory
        sums = [
            _weighted_power(
                scipy.fft.rfft2(field, s=self.shape), weight, self.multiplicity
            )
            for field in fields.reshape(-1, *fields.shape[-2:])
        ]
        return np.reshape(sums, fields.shape[:-2]) * self.pixel**2


class Grid(Lattice):
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
    >>> ripple = np.cos(2.0 * np.pi * np.arange(15) / 15)[:, None] * np.ones(15)
    >>> power = grid.multiplicity * np.abs(grid.forward(ripple)) ** 2 / grid.area**2
    >>> print(f"{np.mean(ripple**2):.6f} {power.sum():.6f}")
    0.500000 0.500000
    """

    def __init__(self, cell: float, points: int) -> None:
        super().__init__((cell, cell), (points, points))

    @property
    def cell(self) -> float:
        """Side of the cell [m]."""
        return self.sides[0]

    @property
    def points(self) -> int:
        """Samples per side."""
        return self.shape[0]

    @property
    def spacing(self) -> float:
        """Distance between neighbouring samples [m]."""
        return self.cell / self.points

    @property
    def area(self) -> float:
        """Area of the cell [m²]."""
        return self.cell**2

    @property
    def pixel(self) -> float:
        """Area of a pixel [m²]."""
        return self.spacing**2


def lattice_of(cell: float | tuple[float, float], shape: tuple[int, int]) -> Lattice:
    """The periodic cell of one or both sides [m] and a shape, a ``Grid`` where it is square."""
    first, second = (cell, cell) if isinstance(cell, int | float) else cell
    if first == second and shape[0] == shape[1]:
        return Grid(float(first), shape[0])
    return Lattice((float(first), float(second)), (shape[0], shape[1]))


@kernel(
    "float64(complex128[:, ::1], Array(float64, 2, 'C', readonly=True), Array(float64, 1, 'C', readonly=True))"
)
def _weighted_power(spectrum, weight, multiplicity):
    """Sum of weight × \\|spectrum\\|² × multiplicity, column by column: vector instructions of any width agree."""
    columns, total = np.zeros(multiplicity.size), 0.0
    for i in range(weight.shape[0]):
        for j in range(multiplicity.size):
            value = spectrum[i, j]
            columns[j] += weight[i, j] * (
                value.real * value.real + value.imag * value.imag
            )
    for j in range(multiplicity.size):
        total += multiplicity[j] * columns[j]
    return total
