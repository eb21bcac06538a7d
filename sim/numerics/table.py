"""Tables of a positive function and of its mean from zero on, which compiled loops read."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval
from numpy.typing import NDArray

from sim.numerics.jit import device, float_at

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """Mean of a function of one number from zero on, in cells of the logarithm of the number.

    Attributes
    ----------
    values : array, shape (cells + 1, degree + 1)
        Coefficients of ln(mean/function at zero) over each cell. The first row has one over the scale, the function at
        zero and the number of the last cell.
    scale : float
        Number on which the function changes by about e.
    steepness : float
        Largest relative change of the function per number, where it is within e^20 of that at zero.
    """

    values: Array
    scale: float = 0.0
    steepness: float = 0.0

    @property
    def address(self) -> float:
        """Address of the values, by which compiled loops read them while the table exists; 0 if there are none."""
        return float(self.values.ctypes.data) if self.values.size else 0.0


#: Table of no function.
NO_TABLE = Table(np.empty((0, 1)))
#: Cells to an octave of the number over its scale, first and last octave, octave from which the steepness counts.
_CELLS, _FIRST, _LAST, _COARSE = 64, -30, 20, -2
#: Terms of a polynomial, a place between those through which it goes, these, and Gauss's rule: errors are below 1e-11.
_TERMS, _BETWEEN = 8, 0.3
_PLACES = 0.5 - 0.5 * np.cos(np.pi * (np.arange(_TERMS) + 0.5) / _TERMS)
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(8)
#: Logarithm of the largest mean in a table, and of the values whose error is tested, over the value at zero.
_MOST, _TESTED = 600.0, 20.0
#: Largest relative error of a value.
ERROR = 1e-10


def table_of(function: Callable[[Array], Array], scale: float) -> Table:
    """Return the table of a ``function``, which changes by about e on a ``scale``.

    Parameters
    ----------
    function : function
        Values at numbers of any shape, above 0 and smooth above zero.
    scale : float
        Number on which the function changes by about e.

    Raises
    ------
    ValueError
        If the table does not give the function to ``ERROR``.

    Notes
    -----
    Cells are of equal width in the logarithm of the number. Over each is a polynomial through the logarithm of the
    mean from zero on, by Gauss's rule. The function follows from its slope.

    Examples
    --------
    The function e^(x²) becomes steeper without end:

    >>> table = table_of(lambda number: np.exp(number**2), 1.0)
    >>> print(f"{table.steepness:.1f}")
    8.9
    """

    def integral(start: Array, end: Array) -> Array:
        half = 0.5 * (end - start)
        nodes = start[..., np.newaxis] + half[..., np.newaxis] * (1.0 + _GAUSS)
        return half * np.sum(_WEIGHTS * function(scale * nodes), axis=-1)

    cells = np.arange(_CELLS * _FIRST, _CELLS * _LAST)[:, np.newaxis]
    edges, places = 2.0 ** (cells / _CELLS), 2.0 ** ((cells + _PLACES) / _CELLS)
    at_zero = float(function(np.zeros(1))[0])
    with np.errstate(over="ignore", invalid="ignore"):
        before = np.cumsum(integral(np.append(0.0, edges[:-1]), edges[:, 0]))
        mean = (before[:, np.newaxis] + integral(edges, places)) / places
        logarithm = np.log(mean / at_zero)
        usable = np.all(np.abs(logarithm) < _MOST, axis=1)
    count = len(usable) if usable.all() else int(np.argmin(usable))
    terms = np.linalg.solve(np.vander(_PLACES, increasing=True), logarithm[:count].T)
    header = [1.0 / scale, at_zero, count - 1.0, *np.zeros(_TERMS - 3)]
    size = 2.0 ** ((cells[:count, 0] + _BETWEEN) / _CELLS)
    grown = np.log(function(scale * size) / at_zero)
    mean, bend = polyval(_BETWEEN, terms), polyval(_BETWEEN, polyder(terms))
    error = np.expm1(mean + np.log1p(_CELLS / math.log(2.0) * bend) - grown)
    is_tested = np.abs(grown) < _TESTED
    if not (largest := np.max(np.abs(error[is_tested]))) < ERROR:
        fault = f"the table of a function has an error of {largest:.1g}"
        raise ValueError(f"{fault}; it must be smooth above zero")
    slope = np.diff(grown) / np.diff(scale * size)
    steepness = np.abs(slope[is_tested[1:] & (size[1:] > 2.0**_COARSE)]).max()
    return Table(np.array([header, *terms.T]), scale, float(steepness))


@device
def mean_and_value(size, table):
    """Return the mean of a function from zero to a ``size``, and its value there, by the address of its table."""
    at_zero = float_at(table, 1)
    place = _CELLS * (math.log2(size * float_at(table, 0)) - _FIRST)
    if not place > 0.0:
        return at_zero, at_zero
    cell = int(min(place, float_at(table, 2)))
    within, value, slope = min(place - cell, 1.0), 0.0, 0.0
    for k in range(_TERMS - 1, -1, -1):
        slope = slope * within + value
        value = value * within + float_at(table, _TERMS * (1 + cell) + k)
    value += slope * (place - cell - within)
    mean = at_zero * math.exp(min(value, _MOST))
    return mean, mean * (1.0 + _CELLS / math.log(2.0) * slope)
