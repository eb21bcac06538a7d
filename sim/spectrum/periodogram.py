"""Power spectral density of a stress map on a grid, and its radial average."""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.grid import Grid
from sim.spectrum.family import Array


def periodogram(field: Array, cell: float, window: str = "none") -> Array:
    """Power spectral density of square maps, on the half spectrum of their grid.

    Parameters
    ----------
    field : array, shape (..., points, points)
        Stress [Pa], x along axis -2.
    cell : float
        Side of the map [m].
    window : {"none", "hann"}
        Multiplies the field by a periodic Hann window in x and y, normalised to keep the power.

    Returns
    -------
    array, shape (..., points, points // 2 + 1)
        ``|τ(q)|² / L²`` [Pa² m²] of the field less its (windowed) mean; zero at q = 0.

    Examples
    --------
    Its sum over the whole lattice / L² is the mean square (Parseval):

    >>> field = np.random.default_rng(1).normal(size=(16, 16))
    >>> grid = Grid(cell=2.0, points=16)
    >>> total = grid.mode_sum(periodogram(field, 2.0)) / 2.0**2
    >>> print(f"{float(total / np.var(field)):.12f}")
    1.000000000000
    """
    points = field.shape[-1]
    weight = np.ones(points)
    if window == "hann":
        weight = 1.0 - np.cos(2 * np.pi * (np.arange(points) + 0.5) / points)
    elif window != "none":
        raise ValueError(f'window must be "none" or "hann", not {window!r}')
    taper = weight[:, None] * weight
    mean = np.mean(field * taper, axis=(-2, -1), keepdims=True) / np.mean(taper)
    taper = taper / math.sqrt(np.mean(taper**2))
    transform = Grid(cell, points).forward((field - mean) * taper)
    transform[..., 0, 0] = 0.0  # what rounding left of the mean
    return (transform.real**2 + transform.imag**2) / cell**2


class RadialAverage(NamedTuple):
    """Means over rings of the wavevector lattice, each array of shape (rings,)."""

    q: Array  #: mean wavenumber of the ring [rad/m]
    density: Array  #: mean density [Pa² m²]
    standard_error: Array  #: of that mean, from the scatter within the ring [Pa² m²]
    pairs: Array  #: independent modes ±q in the ring


def radial_average(density: Array, grid: Grid) -> RadialAverage:
    """Average a density over rings |q| L/2π in [k - ½, k + ½), k = 1, 2, ... below Nyquist.

    Parameters
    ----------
    density : array, shape (points, points // 2 + 1)
        On the half spectrum of ``grid``.
    grid : Grid
        The periodic cell.

    Examples
    --------
    The innermost ring holds the eight neighbours of q = 0, four pairs:

    >>> grid = Grid(cell=1.0, points=16)
    >>> print(radial_average(np.ones((16, 9)), grid).pairs[0])
    4.0
    """
    q = np.hypot(*grid.wavevectors)
    ring = np.floor(q * grid.cell / (2 * np.pi) + 0.5).astype(int)
    rings = (grid.points - 1) // 2
    inside = (ring > 0) & (ring <= rings)
    share = np.broadcast_to(grid.multiplicity / 2, q.shape)[inside]  # the first column holds both q and -q
    place = ring[inside] - 1

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(place, share * values, rings), float)

    pairs = total(np.ones(len(place)))
    mean = total(density[inside]) / pairs
    scatter = total((density[inside] - mean[place]) ** 2) / (pairs - 1)
    return RadialAverage(total(q[inside]) / pairs, mean, np.sqrt(scatter / pairs), pairs)
