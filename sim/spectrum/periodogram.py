"""Power spectral density of a stress map on a grid, and its radial average."""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.grid import Lattice, lattice_of
from sim.spectrum.family import Array


def periodogram(field: Array, cell: float | tuple[float, float], window: str = "none") -> Array:
    """Power spectral density of maps, on the half spectrum of their lattice.

    Parameters
    ----------
    field : array, shape (..., nx, ny)
        Stress [Pa], x along axis -2.
    cell : float or (float, float)
        Sides of the map along x and y [m], one for both if they are equal.
    window : {"none", "hann"}
        Multiplies the field by a periodic Hann window in x and y, normalised to keep the power.

    Returns
    -------
    array, shape (..., nx, ny // 2 + 1)
        ``|τ(q)|² / A`` [Pa² m²], A the area, of the field less its (windowed) mean; zero at q = 0.

    Examples
    --------
    Its sum over the whole lattice / L² is the mean square (Parseval):

    >>> from sim.numerics.grid import Grid
    >>> field = np.random.default_rng(1).normal(size=(16, 16))
    >>> grid = Grid(cell=2.0, points=16)
    >>> total = grid.mode_sum(periodogram(field, 2.0)) / 2.0**2
    >>> print(f"{float(total / np.var(field)):.12f}")
    1.000000000000
    """
    lattice = lattice_of(cell, field.shape[-2:])
    transform = lattice.forward(tapered(field, window))
    transform[..., 0, 0] = 0.0  # what rounding left of the mean
    return np.asarray((transform.real**2 + transform.imag**2) / lattice.area)


def tapered(field: Array, window: str) -> Array:
    """Maps less their mean under a window, times the window, whose mean square is one; arguments of ``periodogram``."""
    if window not in ("none", "hann"):
        raise ValueError(f'window must be "none" or "hann", not {window!r}')
    along, across = (
        np.ones(points) if window == "none" else 1.0 - np.cos(2 * np.pi * (np.arange(points) + 0.5) / points)
        for points in field.shape[-2:]
    )
    taper = along[:, None] * across
    mean = np.mean(field * taper, axis=(-2, -1), keepdims=True) / np.mean(taper)
    return np.asarray((field - mean) * (taper / math.sqrt(np.mean(taper**2))))


class RadialAverage(NamedTuple):
    """Means over rings of the wavevector lattice, each array of shape (rings,)."""

    q: Array  #: mean wavenumber of the ring [rad/m]
    density: Array  #: mean density [Pa² m²]
    standard_error: Array  #: of that mean, from the scatter within the ring [Pa² m²]
    pairs: Array  #: independent modes ±q in the ring


def side_of_rings(lattice: Lattice) -> float:
    """Length L whose wavenumber 2π/L is the width of a ring: the side of a square of the same area [m]."""
    first, second = lattice.sides
    return first if first == second else math.sqrt(lattice.area)


def radial_average(density: Array, grid: Lattice) -> RadialAverage:
    """Average a density over rings |q| L/2π in [k - ½, k + ½), k = 1, 2, ... below Nyquist.

    Parameters
    ----------
    density : array, shape (nx, ny // 2 + 1)
        On the half spectrum of ``grid``.
    grid : Grid or Rectangle
        The periodic cell, L its side or the square root of its area; all longer waves count to the first ring.

    Examples
    --------
    The innermost ring holds the eight neighbours of q = 0, four pairs:

    >>> from sim.numerics.grid import Grid
    >>> grid = Grid(cell=1.0, points=16)
    >>> print(radial_average(np.ones((16, 9)), grid).pairs[0])
    4.0
    """
    q = np.hypot(*grid.wavevectors)
    length = side_of_rings(grid)
    ring = np.floor(q * length / (2 * np.pi) + 0.5).astype(int)
    ring[(ring == 0) & (q > 0.0)] = 1
    rings = min((points - 1) // 2 if side == length else int((points - 1) / 2 * length / side)
                for points, side in zip(grid.shape, grid.sides, strict=True))  # fmt: skip
    inside = (ring > 0) & (ring <= rings)
    share = np.broadcast_to(grid.multiplicity / 2, q.shape)[inside]  # the first column holds both q and -q
    place = ring[inside] - 1

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(place, share * values, rings), float)

    pairs = total(np.ones(len(place)))
    mean = total(density[inside]) / pairs
    scatter = total((density[inside] - mean[place]) ** 2) / np.maximum(pairs - 1, 1)
    return RadialAverage(total(q[inside]) / pairs, mean, np.sqrt(scatter / pairs), pairs)
