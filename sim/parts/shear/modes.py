"""Fourier modes of a periodic cell, and the variance of each pair ±q.

A pair ±q stands for the pixel (2π/L)² of the wavevector plane around its lattice point. Its
variance is the spectrum *integrated* over that pixel, so that a cell's field has the spectrum's
variance but for the pixel of q = 0, even where the spectrum ends inside a pixel. Nothing is
renormalised; ``error_variance`` and ``error_energy`` are what the cell lacks.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import compliance
from sim.parts.exchange import Array, Indices
from sim.spectrum.family import Family

#: Pairs below this share of the variance are left out: all of them together would not change a bit.
_NEGLIGIBLE = 1e-22

#: Relative distance below which a wavevector counts as on the lattice, or a circle as touched only.
_TOUCH = 1e-9


@dataclass(frozen=True, eq=False)
class Modes:
    """One of each pair ±q of a periodic square cell: qy > 0, or qy = 0 and qx > 0.

    Parameters
    ----------
    spectrum : Family
        The spectrum whose modes these are.
    cell : float
        Side L of the cell [m].
    points : int
        Points of the grid along a side.
    ix, iy : array of int, shape (pairs,)
        Lattice indices: qx = 2π ix/L along sliding, qy = 2π iy/L.
    qx, qy : array, shape (pairs,)
        Wavevectors [rad/m], sorted by length.
    variance : array, shape (pairs,)
        Share of the mean square stress that each pair carries [Pa²].
    on_lattice : bool
        False where a ripple does not fit the cell; qx, qy are then its own, ix, iy the nearest.
    """

    spectrum: Family
    cell: float
    points: int
    ix: Indices
    iy: Indices
    qx: Array
    qy: Array
    variance: Array
    on_lattice: bool = True

    def energies(self, shear_modulus: float, poisson_ratio: float = 0.5) -> Array:
        """Mean energy per area of each pair [J/m²], shape (pairs,).

        Notes
        -----
        ``½ G_x(q) · variance = G_x(q) C(q) / L²`` with C averaged over the pixel and G_x by
        ``sim.laws.halfspace.compliance``. The cell's mean ΔΓ is their sum.
        """
        return 0.5 * compliance(self.qx, self.qy, shear_modulus, poisson_ratio) * self.variance

    @functools.cached_property
    def error_variance(self) -> float:
        """Relative error of the cell's variance against the spectrum's own."""
        return _relative(float(np.sum(self.variance)), self.spectrum.variance)

    def error_energy(self, shear_modulus: float = 1.0, poisson_ratio: float = 0.5) -> float:
        """Relative error of the cell's mean ΔΓ against the infinite plane's; any modulus gives the same."""
        total = float(np.sum(self.energies(shear_modulus, poisson_ratio)))
        return _relative(total, float(self.spectrum.surface_energy(shear_modulus, poisson_ratio)))

    @functools.cached_property
    def variance_spread(self) -> float:
        """Expected relative standard deviation of one realisation's mean square, Gaussian amplitudes."""
        return _spread(self.variance)

    def energy_spread(self, poisson_ratio: float = 0.5) -> float:
        """Expected relative standard deviation of one realisation's ΔΓ, Gaussian amplitudes."""
        return _spread(self.energies(1.0, poisson_ratio))


def _relative(value: float, exact: float) -> float:
    return (value - exact) / exact if exact > 0.0 else 0.0


def _spread(weights: Array) -> float:
    total = float(np.sum(weights))
    return math.sqrt(float(np.sum(weights**2))) / total if total > 0.0 else 0.0


@functools.lru_cache(maxsize=4)  # a sweep needs the same modes again and again
def modes(spectrum: Family, cell: float, points: int | None = None) -> Modes:
    """The mode pairs of a spectrum on a periodic square cell.

    Parameters
    ----------
    spectrum : Family
        The spectrum.
    cell : float
        Side L of the cell [m].
    points : int, optional
        Points of the grid along a side, odd or even. Without it the smallest even grid that holds
        all of the spectrum, which then must have a shortest wavelength.

    Returns
    -------
    Modes
        All pairs whose pixel meets the spectrum; q = 0, and the Nyquist row and column of an even
        grid, are left out.

    Raises
    ------
    PydanticCustomError
        (a ValueError) if the grid is too coarse for the shortest wavelength, if ``points`` is needed,
        or if no mode fits the cell; each names the cure.

    Examples
    --------
    One ripple is one pair; of a band whose longest wave is half the cell nothing is lost:

    >>> from sim.spectrum import Band, Ripple
    >>> modes(Ripple(2.0, 1.0), cell=4.0).variance.tolist()
    [2.0]
    >>> print(f"{abs(modes(Band(1.0, longest=2.0, shortest=0.5), cell=4.0).error_variance):.9f}")
    0.000000000
    """
    if not (math.isfinite(cell) and cell > 0.0):
        raise PydanticCustomError("bad_cell", "the cell must be a positive length", {})
    if spectrum.wavevector is not None:
        return _single(spectrum, cell, points, spectrum.wavevector)
    step = 2 * math.pi / cell
    reach, points = grid_reach(spectrum, cell, points)
    ix, iy, share = half_lattice(spectrum, cell, reach)
    if not len(ix):
        said = f"no wave of the spectrum fits the cell of {cell:g} m; make the cell longer"
        raise PydanticCustomError("no_modes", said)
    order = np.lexsort((iy, ix, ix**2 + iy**2))
    ix, iy, share = ix[order], iy[order], share[order]
    return _frozen(spectrum, cell, points, ix, iy, step * ix, step * iy, 2 * share)


def _frozen(spectrum: Family, cell: float, points: int, *arrays: NDArray, on_lattice: bool = True) -> Modes:
    """Modes whose arrays cannot be written: several callers share them."""
    for array in arrays:
        array.flags.writeable = False
    ix, iy, qx, qy, variance = arrays
    return Modes(spectrum, cell, points, ix, iy, qx, qy, variance, on_lattice)


def grid_reach(spectrum: Family, cell: float, points: int | None) -> tuple[int, int]:
    """Largest lattice index that holds modes of a spectrum, and the points of the grid; raises as ``modes``."""
    _, high = spectrum.support
    step = 2 * math.pi / cell
    return _reach(None if math.isinf(high) else math.ceil(high / step * (1 - _TOUCH) - 0.5), points)


def _reach(needed: int | None, points: int | None) -> tuple[int, int]:
    """Largest lattice index below Nyquist and the points of the grid."""
    if points is None:
        if needed is None:
            said = "the spectrum has no shortest wavelength; give points (such as points = 256)"
            raise PydanticCustomError("points_needed", said)
        points = 2 * (needed + 1)
    elif points < 3:
        raise PydanticCustomError("too_few_points", "points must be at least 3, not {points}", {"points": points})
    reach = (points - 1) // 2
    if needed is not None and needed > reach:
        said = f"the shortest wavelength needs at least {2 * needed + 1} points, not {points}; give more points or"
        cure = "leave them out, a longer shortest wavelength or a smaller cell"
        raise PydanticCustomError("grid_too_coarse", f"{said} {cure}")
    return (reach if needed is None else needed), points


def _single(spectrum: Family, cell: float, points: int | None, wavevector: tuple[float, float]) -> Modes:
    """The one pair of a ripple, at its own wavevector."""
    qx, qy = wavevector
    size = math.hypot(qx, qy)
    qx, qy = (0.0 if abs(part) < 1e-12 * size else part for part in (qx, qy))
    if qy < 0.0 or (qy == 0.0 and qx < 0.0):
        qx, qy = -qx, -qy
    exact = np.array([qx, qy]) * cell / (2 * math.pi)
    nearest = np.rint(exact).astype(np.int64)
    on_lattice = bool(np.all(np.abs(exact - nearest) <= _TOUCH * np.hypot(*exact)) and nearest.any())
    needed = nearest if on_lattice else np.ceil(np.abs(exact)).astype(np.int64)
    _, points = _reach(int(np.max(np.abs(needed))), points)
    arrays = nearest[:1], nearest[1:], np.array([qx]), np.array([qy]), np.array([spectrum.variance])
    return _frozen(spectrum, cell, points, *arrays, on_lattice=on_lattice)


def cell_variance(spectrum: Family, cell: float, points: int | None = None) -> float:
    """Variance that the modes of a cell carry together [Pa²], without listing them.

    The square of all their pixels is itself a pixel, of a lattice as much coarser; that of q = 0 is
    left out. Raises as ``modes``.
    """
    if spectrum.wavevector is not None:
        return spectrum.variance
    reach, _ = grid_reach(spectrum, cell, points)
    step = 2 * math.pi / cell
    whole, middle = (spectrum.pixels(side * step, 0)[0, 0] for side in (2 * reach + 1, 1))
    return float(whole - middle)


def half_lattice(spectrum: Family, cell: float, reach: int) -> tuple[Indices, Indices, Array]:
    """Lattice indices and pixel variance of one of each pair up to ``reach``, without q = 0 and negligible ones."""
    pixels = spectrum.pixels(2 * math.pi / cell, reach)
    ix, iy = (index.ravel() for index in np.mgrid[-reach : reach + 1, 0 : reach + 1])
    share = pixels.ravel()
    kept = ((iy > 0) | (ix > 0)) & (2 * share > _NEGLIGIBLE * spectrum.variance)
    return ix[kept], iy[kept], share[kept]
