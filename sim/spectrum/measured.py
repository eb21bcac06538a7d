"""Spectrum estimated from measured stress maps.

Convention: ``C(q) = ∫ d²x <τ1(x) τ1(0)> e^{-iq·x}`` in Pa² m², q in rad/m (2π over the wavelength),
``<τ1²> = (1/2π) ∫ q C dq``. For a map of side L it is ``|∫ τ1 e^{-iq·x} d²x|² / L²``.
"""

import functools
import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass

from sim.numerics.files import HDF5
from sim.numerics.grid import Grid
from sim.spectrum.family import Array
from sim.spectrum.periodogram import periodogram, radial_average
from sim.spectrum.radial import PowerLaws
from sim.spectrum.tabulated import Densities, FromFile, Wavenumbers, by_name
from sim.units.quantity import Quantity
from sim.units.table import TableError, file_fault, file_path, file_text, matrix

_STRESS = Quantity("Pa", "shear stress", "τ1")
_SPACING = Quantity("m", "distance between neighbouring points of the map", "h", above=0)
#: Most numbers of a map.
_MOST = 10**8


@dataclass(frozen=True, config={"extra": "forbid"})
class Measured(FromFile):
    """The radially averaged spectrum of measured stress maps, used as a table.

    Parameters
    ----------
    file : str
        A CSV with nothing but the stresses [Pa], one row of the map per line, or a netCDF file (.nc).
    spacing : float, optional
        Distance of neighbouring points [m], the same in x and y; for netCDF taken from the
        coordinates ``x`` and ``y`` where they exist.
    window : {"none", "hann"}
        "hann" unless the map is periodic: the jump at its borders would leak into all wavenumbers.
    variable : str
        Name in a netCDF file; dimensions before the last two (or beside x, y) are averaged over.
    wavenumbers, densities : tuple of float
        The estimate, filled in on reading and not meant to be given.

    Notes
    -----
    A map that is not square is cropped to the leading square. The mean is removed. Rings of one
    lattice step 2π/L are averaged; the rows reach from π/L to the outer edge of the last ring below
    Nyquist, level in the innermost and the outermost half ring, so that waves longer than twice the
    map and the corners beyond Nyquist are not part of the spectrum.
    """

    file: Annotated[str, Field(description="the map: plain CSV in Pa, one row a line, or netCDF")]
    spacing: Annotated[float, _SPACING] | None = None
    window: Annotated[
        Literal["none", "hann"],
        Field(description='taper of the map before its transform; "hann" unless it is periodic'),
    ] = "none"
    variable: Annotated[str, Field(description="name of the map in a netCDF file")] = "shear_map"
    wavenumbers: Wavenumbers = ()
    densities: Densities = ()
    model: Literal["measured"] = "measured"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        values = by_name(values, ("file", "spacing", "window", "variable", "wavenumbers", "densities"))
        if not isinstance(values, dict):
            return values
        name, window = values.get("file"), values.get("window", "none")
        if values.get("wavenumbers") or not isinstance(name, str) or window not in ("none", "hann"):
            return values
        try:
            spacing = None if values.get("spacing") is None else _SPACING.read(values["spacing"])
        except ValueError:
            return values  # refused by the field's own check
        netcdf = name.lower().endswith((".nc", ".nc4", ".cdf"))
        source: Any = (file_path if netcdf else file_text)(name, info.context)
        try:
            if netcdf:
                maps, spacing = _read_netcdf(source, str(values.get("variable", "shear_map")), spacing)
            else:
                maps = matrix(source, _STRESS)
            q, density = _estimate(maps, spacing, window)
        except (OSError, ValueError, RuntimeError, MemoryError) as fault:
            raise file_fault(name, fault, info.context) from None
        return {**values, "spacing": spacing, "wavenumbers": q.tolist(), "densities": density.tolist()}

    @functools.cached_property
    def rows(self) -> PowerLaws:
        """The estimate as a chain of power laws."""
        return PowerLaws(np.array(self.wavenumbers), np.array(self.densities))


def _read_netcdf(path: Path, variable: str, spacing: float | None) -> tuple[Array, float | None]:
    """Maps (..., x, y) [Pa] and their spacing [m]."""
    from sim.numerics import hdf5  # heavy: only where a map is read

    try:
        dataset = hdf5.lazily(path)
    except hdf5.Refused as fault:
        raise ValueError(f"{fault}; write the map anew, as a plain variable") from None
    with HDF5, dataset:
        if variable not in dataset:
            said = f'there is no variable "{variable}"; name it by variable = "..."'
            raise TableError(said, map(str, dataset.data_vars))
        data = dataset[variable]
        if data.ndim < 2 or data.dtype.kind not in "fiu":
            raise ValueError(f'"{variable}" has no two dimensions, or no numbers; name a map by variable = "..."')
        if data.size > _MOST:
            raise ValueError(f'"{variable}" has more than {_MOST:.0e} numbers; crop the map')
        data = data.load()
    if {"x", "y"} <= set(data.dims):
        data = data.transpose(..., "x", "y")
        spacing = _coordinate_spacing(data, spacing)
    return np.asarray(data, float) * _factor(data, _STRESS), spacing


def _factor(data: Any, quantity: Quantity) -> float:
    """Factor to SI from a netCDF variable's ``units``; without the attribute it is SI."""
    unit = str(data.attrs.get("units", quantity.unit))
    return Quantity(quantity.unit, quantity.meaning).read(f"1 {unit}")


def _coordinate_spacing(data: Any, spacing: float | None) -> float | None:
    """Spacing of the coordinates [m], which must agree with the one given."""
    for axis in ("x", "y"):
        if axis not in data.coords or data.sizes[axis] < 2:
            continue
        steps = np.diff(np.asarray(data[axis], float)) * _factor(data[axis], _SPACING)
        step = float(np.mean(steps))
        uneven = not np.allclose(steps, step, rtol=1e-4, atol=0.0)
        if uneven or (spacing is not None and not math.isclose(abs(step), spacing, rel_tol=1e-4)):
            said = f"the coordinate {axis} is not spaced by one step, equal in x and y and to the key spacing"
            raise ValueError(f"{said}; interpolate the map onto a square lattice")
        spacing = abs(step) if spacing is None else spacing
    return spacing


def _estimate(maps: Array, spacing: float | None, window: str) -> tuple[Array, Array]:
    """Rows of the radial spectrum of maps (..., x, y), averaged over the leading axes."""
    points = min(maps.shape[-2:])
    if spacing is None:
        raise ValueError('the map has no coordinates; give spacing, such as "0.5 um"')
    if points < 8:
        raise ValueError(f"a map of {points} points along a side is too small; give at least 8")
    if not np.all(np.isfinite(maps)):
        raise ValueError("the map has gaps (nan or infinite); fill them or crop the map")
    field = maps[..., :points, :points].reshape(-1, points, points)
    grid = Grid(points * spacing, points)
    density = np.mean(periodogram(field, grid.cell, window), axis=0)
    ring = radial_average(density, grid)
    # the innermost ring begins at half its wavenumber and the outermost ends half a ring beyond: there they stay level
    first, last = (np.pi / grid.cell, (2 * len(ring.q) + 1) * np.pi / grid.cell)
    q = np.concatenate([[first], ring.q, [last]])
    return q, np.concatenate([ring.density[:1], ring.density, ring.density[-1:]])
