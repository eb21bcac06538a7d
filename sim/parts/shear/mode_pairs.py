"""Mean energies of the mode pairs of a periodic cell: listed near q = 0, counted by squares of the lattice beyond.

Squares are 3 × 3 to 27 × 27 to a block of pixels. Of each block the sum and the sum of squares of its pairs'
energies are kept, so that mean and variance of the cell's energy are right without a list of 10^8 pairs.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from sim.laws.halfspace import compliance
from sim.parts.exchange import Array, Indices
from sim.parts.shear.modes import grid_reach, half_lattice, modes
from sim.spectrum.family import Family

#: Squares handled at a time.
_SQUARES = 2**18
#: Largest lattice index listed singly, and of the blocks at each level: 3 × 85 + 1, so that levels join.
_LISTED = 256


@dataclass(frozen=True, eq=False)
class Pairs:
    """Mode pairs of a cell, many of them counted rather than listed.

    Attributes
    ----------
    weight : array, shape (entries,)
        Mean energy per area w of one pair [J/m^2].
    wavenumber : array, shape (entries,)
        |q| [rad/m].
    count : array, shape (entries,)
        How many equal pairs an entry stands for, not a whole number; 1 where they are listed singly.
    """

    weight: Array
    wavenumber: Array
    count: Array


def cell_pairs(spectrum: Family, cell: float, points: int | None, shear_modulus: float, poisson_ratio: float) -> Pairs:
    """Mode pairs of a cell, listed near q = 0 where the weight sits, counted in blocks beyond.

    Parameters
    ----------
    spectrum : Family
        The spectrum.
    cell : float
        Side L of the cell [m].
    points : int, optional
        Points of the grid along a side; by default what the spectrum's shortest wave needs.
    shear_modulus, poisson_ratio : float
        G [Pa], nu [1].

    Returns
    -------
    Pairs
        All pairs singly up to a grid of 513 points. Beyond, blocks of 3 × 3 pixels, then of 9 × 9 and
        so on, each narrower than 1/85 of its wavenumber, with the exact integral of the spectrum. Its
        energies and their squares are summed over 3 × 3 squares, over pixels where the spectrum or the
        grid ends. The cell's mean and variance are right to 1e-6 (2e-4 where the density of a table
        falls off a cliff narrower than a few pixels); the third cumulant of a band only some pixels
        wide that lies there is up to a few per cent low.

    Raises
    ------
    PydanticCustomError
        As ``sim.parts.shear.modes.modes``.
    """
    if spectrum.wavevector is not None:
        found = modes(spectrum, cell, points)
        weight = found.energies(shear_modulus, poisson_ratio)
        return Pairs(weight, np.hypot(found.qx, found.qy), np.ones(1))
    reach, _ = grid_reach(spectrum, cell, points)
    levels, block = [], 1
    while block == 1 or _LISTED * (block // 3) + block // 6 < reach:
        levels.append(_level(spectrum, cell, reach, block, shear_modulus, poisson_ratio))
        block *= 3
    pairs = Pairs(*(np.concatenate(parts) for parts in zip(*levels, strict=True)))
    if not pairs.weight.size:
        modes(spectrum, cell, points)  # raises with the reason
    return pairs


def _level(
    spectrum: Family, cell: float, reach: int, block: int, shear_modulus: float, poisson_ratio: float
) -> tuple[Array, Array, Array]:
    """Weight, wavenumber and count of the blocks of block² pixels around the finer ones."""
    step = 2.0 * math.pi / cell
    outermost = min(_LISTED, math.ceil((reach + 0.5) / block - 0.5))
    ix, iy, share = half_lattice(spectrum, cell / block, outermost)
    if block == 1:
        softness = compliance(ix, iy, shear_modulus * step, poisson_ratio)
        return softness * share, step * np.hypot(ix, iy), np.ones(ix.size)
    farthest = np.maximum(np.abs(ix), iy)
    kept = farthest > (_LISTED - 1) // 3
    ix, iy, share, farthest = ix[kept], iy[kept], share[kept], farthest[kept]
    radius = block * np.hypot(ix, iy)
    ends = (np.abs(radius - limit / step) < block for limit in spectrum.support)
    cut = functools.reduce(np.logical_or, ends, block * farthest > reach - block)
    found = [np.empty((3, 0))]
    for blocks, side in ((np.flatnonzero(~cut), 3), (np.flatnonzero(cut), min(block, 27))):
        for first in range(0, blocks.size, _SQUARES // side**2):
            some = blocks[first : first + _SQUARES // side**2]
            squares = _Squares.of(spectrum, step, reach, block * ix[some], block * iy[some], block / side, side)
            found.append(squares.counted(share[some], poisson_ratio))
    weight, wavenumber, count = np.concatenate(found, axis=1)
    return weight / (shear_modulus * step), step * wavenumber, count


@dataclass(frozen=True, eq=False)
class _Squares:
    """Equal squares that divide blocks of the lattice, arrays of shape (blocks, side, side); lengths in pixels.

    ``held`` is the share of a square between the ends of the spectrum, ``density`` the density there,
    ``on_grid`` the share of it on the grid.
    """

    size: float
    qx: Array
    qy: Array
    radius: Array
    held: Array
    density: Array
    on_grid: Array

    @classmethod
    def of(
        cls, spectrum: Family, step: float, reach: int, x: Indices, y: Indices, size: float, side: int
    ) -> "_Squares":
        """The squares of blocks around (x, y)."""
        offsets = size * (np.arange(side) - 0.5 * (side - 1))
        qx = x[:, np.newaxis, np.newaxis] + offsets[:, np.newaxis]
        qy = y[:, np.newaxis, np.newaxis] + offsets
        radius = np.hypot(qx, qy)
        low, high = (limit / step for limit in spectrum.support)
        held = _within(high, qx, qy, radius, size) - _within(low, qx, qy, radius, size)
        inside = step * np.clip(radius, low * (1.0 + 1e-12), high * (1.0 - 1e-12)) / radius
        last = reach + 0.5 if math.isinf(high) else math.inf  # a spectrum that ends is all on the grid
        on_grid = np.clip((last - np.abs(qx)) / size + 0.5, 0.0, 1.0) * np.clip((last - qy) / size + 0.5, 0.0, 1.0)
        return cls(size, qx, qy, radius, held, spectrum.density(inside * qx, inside * qy), on_grid)

    def counted(self, share: Array, poisson_ratio: float) -> Array:
        """Rows weight, wavenumber and count of the blocks: sum and sum of squares of their energies are kept."""
        energy = compliance(self.qx, self.qy, 1.0, poisson_ratio) * self.on_grid * self.density
        # of the pixels in a square only those on the edge are held in part
        square = energy**2 * self.held * (1.0 - (1.0 - self.held) / self.size)
        values = (self.density * self.held, energy * self.held, energy * self.held * self.radius, square)
        stress, first, outward, second = (np.sum(value, axis=(1, 2)) for value in values)
        full = second > 0.0
        stress, first, outward, second = (value[full] for value in (stress, first, outward, second))
        count = self.size**2 * first * (first / second)
        return np.stack([share[full] * (first / stress) / count, outward / first, count])


def _within(edge: float, qx: Array, qy: Array, radius: Array, size: float) -> Array:
    """Share of squares within a circle so wide that it is a straight line in each."""
    if math.isinf(edge):
        return np.ones_like(radius)
    along = np.maximum(np.abs(qx), np.abs(qy)) / radius
    across = np.maximum(np.minimum(np.abs(qx), np.abs(qy)) / radius, 1e-6)
    depth = (edge - radius) / size - size / (24.0 * radius)
    far, near = 0.5 * (along + across), 0.5 * (along - across)
    ramps = [np.maximum(depth + shift, 0.0) ** 2 for shift in (far, near, -near, -far)]
    return np.clip((ramps[0] - ramps[1] - ramps[2] + ramps[3]) / (2.0 * along * across), 0.0, 1.0)
