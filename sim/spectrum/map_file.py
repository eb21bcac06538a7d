"""Files of measured stress maps: CSV, npy without pickled objects, netCDF. Declared sizes are not trusted."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sim.numerics.files import HDF5
from sim.spectrum.family import Array
from sim.units.quantity import Quantity
from sim.units.table import file_path, file_text, matrix

STRESS = Quantity("Pa", "shear stress", "τ1")
SPACING = Quantity("m", "distance between neighbouring points of the map", "h", above=0)
#: Most numbers of a map, and least along a side.
_MOST, LEAST = 10**8, 8


class MapFile(NamedTuple):
    """Contents of a file: stresses (..., rows, columns) [Pa], or (..., x, y) where the file names its axes.

    ``spacings`` are those of its coordinates x and y [m], None without.
    """

    values: Array
    named: bool = False
    spacings: tuple[float | None, float | None] = (None, None)


def read_map(name: str, context: Any, variable: str, gaps: bool = False) -> MapFile:
    """Read a map from a file that a scenario names, by the ending of its name.

    Parameters
    ----------
    name : str
        Path relative to the scenario: .nc, .nc4 or .cdf is netCDF, .npy an array of numpy, all else CSV.
    context : dict or None
        The validation's context, as of ``sim.units.table.file_text``.
    variable : str
        Name of the map in a netCDF file.
    gaps : bool
        Whether points may be nan.

    Raises
    ------
    ValueError
        If it cannot be read as a map, is too small or has gaps; within ``blamed`` a fault of the file.
    """
    if name.lower().endswith((".nc", ".nc4", ".cdf")):
        found = _from_netcdf(file_path(name, context), variable)
    elif name.lower().endswith(".npy"):
        found = MapFile(_from_npy(file_path(name, context)))
    else:
        found = MapFile(matrix(file_text(name, context), STRESS, gaps))
    if found.values.ndim < 2 or min(found.values.shape) < 1:
        raise ValueError("the map has not two dimensions; give rows and columns")
    if min(found.values.shape[-2:]) < LEAST:
        points = min(found.values.shape[-2:])
        raise ValueError(f"a map of {points} points along a side is too small; give at least {LEAST}")
    if not np.all(np.isfinite(found.values) | (np.isnan(found.values) & gaps)):
        raise ValueError("the map has gaps (nan or infinite); fill them or crop the map")
    for value in (np.nanmin(found.values), np.nanmax(found.values)) if np.isfinite(found.values).any() else ():
        STRESS.read(float(value))
    return found


def _from_npy(path: Path) -> Array:
    """Return the numbers of an array that numpy has saved; its declared size must be that of the file."""
    values = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu" or values.size > _MOST:
        raise ValueError(f"it is no array of at most {_MOST:.0e} real numbers; save one by numpy.save")
    return np.array(values, float)


def _from_netcdf(path: Path, variable: str) -> MapFile:
    """Maps and their spacings in a netCDF file."""
    from sim.numerics.lazy import Refused, open_lazily  # imports xarray, which only maps need here

    try:
        dataset = open_lazily(path)
    except Refused as fault:
        raise ValueError(f"{fault}; write the map anew, as a plain variable") from None
    with HDF5, dataset:
        if variable not in dataset:
            raise ValueError(f'there is no variable "{variable}"; name it by variable = "..."')
        data = dataset[variable]
        if data.ndim < 2 or data.dtype.kind not in "fiu":
            raise ValueError(f'"{variable}" has no two dimensions, or no numbers; name a map by variable = "..."')
        if data.size > _MOST:
            raise ValueError(f'"{variable}" has more than {_MOST:.0e} numbers; crop the map')
        data = data.load()
    named = {"x", "y"} <= set(data.dims)
    if named:
        data = data.transpose(..., "x", "y")
    spacings = _spacing(data, "x"), _spacing(data, "y")
    return MapFile(np.asarray(data, float) * _factor(data, STRESS), named, spacings if named else (None, None))


def _factor(data: Any, quantity: Quantity) -> float:
    """Factor to SI from a netCDF variable's ``units``; without the attribute it is SI."""
    unit = str(data.attrs.get("units", quantity.unit))
    return Quantity(quantity.unit, quantity.meaning).read(f"1 {unit}")


def _spacing(data: Any, axis: str) -> float | None:
    """Spacing of a coordinate [m]; None without it."""
    if axis not in data.dims or axis not in data.coords or data.sizes[axis] < 2:
        return None
    steps = np.diff(np.asarray(data[axis], float)) * _factor(data[axis], SPACING)
    step = float(np.mean(steps))
    if not np.allclose(steps, step, rtol=1e-4, atol=0.0):
        raise ValueError(f"the coordinate {axis} is not spaced by one step; interpolate the map onto a square lattice")
    return abs(step)
