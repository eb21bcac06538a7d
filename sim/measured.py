"""Spectra from data: a table of a radial density, or an estimate from measured stress maps.

Convention: ``C(q) = ∫ d²x <τ1(x) τ1(0)> e^{-iq·x}`` in Pa² m², q in rad/m (2π over the wavelength),
``<τ1²> = (1/2π) ∫ q C dq``. Of a map of side L it is ``|∫ τ1 e^{-iq·x} d²x|² / L²``. A table in
Persson's convention, C / 4π², says so.
"""

import functools
import math
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationInfo, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs, PydanticCustomError

from sim.numerics.grid import Grid
from sim.radial import PowerLaws, Rowed
from sim.units.quantity import Quantity
from sim.units.table import TableError, columns, file_path, file_text, matrix

Array = NDArray[np.float64]

_WAVENUMBER = Quantity("rad/m", "wavenumber", "q", above=0)
_DENSITY = Quantity("Pa^2 m^2", "power spectral density of the stress", "C", at_least=0)
_STRESS = Quantity("Pa", "shear stress", "τ1")
_SPACING = Quantity("m", "distance between neighbouring points of the map", "h", above=0)

Wavenumbers = tuple[Annotated[float, _WAVENUMBER], ...]
Densities = tuple[Annotated[float, _DENSITY], ...]

#: Factor from a density in the named convention to C.
CONVENTIONS = {"menga": 1.0, "persson": 4 * math.pi**2}


def _check_rows(wavenumbers: tuple[float, ...], densities: tuple[float, ...]) -> None:
    if len(wavenumbers) != len(densities) or len(wavenumbers) < 2:
        raise PydanticCustomError(
            "table_too_short",
            "a spectrum needs at least two rows and as many densities as wavenumbers, not {q} and {c}",
            {"q": len(wavenumbers), "c": len(densities)},
        )
    falls = np.flatnonzero(np.diff(wavenumbers) <= 0.0)
    if len(falls):
        raise PydanticCustomError(
            "table_not_increasing",
            "the wavenumbers must increase from row to row, but row {row} does not exceed the one before; "
            "sort the rows and merge equal ones",
            {"row": int(falls[0]) + 2},
        )
    if not any(densities):
        raise PydanticCustomError("table_empty", "every density is zero; give a row with a positive one", {})


def _by_name(values: Any, names: tuple[str, ...]) -> Any:
    """Arguments of a direct construction as the dictionary a scenario would give."""
    if not isinstance(values, ArgsKwargs):
        return values
    if len(values.args) > len(names):
        raise TypeError(f"at most {len(names)} positional arguments: {', '.join(names)}")
    return dict(zip(names, values.args, strict=False)) | dict(values.kwargs or {})


def _file_fault(name: str, fault: ValueError) -> PydanticCustomError:
    return PydanticCustomError("bad_table", "{file}: {reason}", {"file": name, "reason": str(fault)})


@dataclass(frozen=True, config={"extra": "forbid"})
class Tabulated(Rowed):
    """A radial density given by rows: power laws between them, zero outside.

    Parameters
    ----------
    wavenumbers : tuple of float
        q [rad/m], increasing.
    densities : tuple of float
        Density at each q [Pa² m²]; next to a zero the interpolation is linear.
    convention : {"menga", "persson"}
        Convention of ``densities``: C itself, or Persson's C / 4π².
    file : str
        In a scenario instead of the rows: a CSV with the columns ``q [rad/m], C [Pa^2 m^2]``. It is
        not read where the rows are given too.

    Examples
    --------
    Two rows of equal density are a band:

    >>> table = Tabulated((1e5, 3e5), (2.0, 2.0))
    >>> print(f"{table.variance:.6e} {2.0 * (9e10 - 1e10) / (4 * np.pi):.6e}")
    1.273240e+10 1.273240e+10
    """

    wavenumbers: Wavenumbers
    densities: Densities
    convention: Literal["menga", "persson"] = "menga"
    file: str = ""
    model: Literal["tabulated"] = "tabulated"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        values = _by_name(values, ("wavenumbers", "densities", "convention", "file"))
        if not isinstance(values, dict):
            return values
        values = _plain(values)
        name = values.get("file")
        if "wavenumbers" in values or "densities" in values:
            return values
        if not name or not isinstance(name, str):
            raise PydanticCustomError("no_table", 'needs file = "psd.csv" with the columns q [rad/m], C [Pa^2 m^2]', {})
        try:
            table = columns(file_text(name, info.context), {"q": _WAVENUMBER, "C": _DENSITY})
        except TableError as fault:
            raise _file_fault(name, fault) from None
        return {**values, "wavenumbers": table["q"].tolist(), "densities": table["C"].tolist()}

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_rows(self.wavenumbers, self.densities)
        return self

    @functools.cached_property
    def rows(self) -> PowerLaws:
        """The table as a chain of power laws, in this project's convention."""
        density = CONVENTIONS[self.convention] * np.array(self.densities)
        return PowerLaws(np.array(self.wavenumbers), density)


@dataclass(frozen=True, config={"extra": "forbid"})
class Measured(Rowed):
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

    file: str
    spacing: Annotated[float, _SPACING] | None = None
    window: Literal["none", "hann"] = "none"
    variable: str = "shear_map"
    wavenumbers: Wavenumbers = ()
    densities: Densities = ()
    model: Literal["measured"] = "measured"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        values = _by_name(values, ("file", "spacing", "window", "variable", "wavenumbers", "densities"))
        if not isinstance(values, dict):
            return values
        values = _plain(values)
        name, window = values.get("file"), values.get("window", "none")
        if values.get("wavenumbers") or not isinstance(name, str) or window not in ("none", "hann"):
            return values
        try:
            spacing = None if values.get("spacing") is None else _SPACING.read(values["spacing"])
        except ValueError:
            return values  # the field's own check says what is wrong
        if name.lower().endswith((".nc", ".nc4", ".cdf")):
            maps, spacing = _read_netcdf(name, str(values.get("variable", "shear_map")), spacing, info.context)
        else:
            maps = _read_matrix(name, info.context)
        q, density = _estimate(name, maps, spacing, window)
        return {**values, "spacing": spacing, "wavenumbers": q.tolist(), "densities": density.tolist()}

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_rows(self.wavenumbers, self.densities)
        return self

    @functools.cached_property
    def rows(self) -> PowerLaws:
        """The estimate as a chain of power laws."""
        return PowerLaws(np.array(self.wavenumbers), np.array(self.densities))


def _plain(values: dict) -> dict:
    """Arrays as lists, which is what the field types accept."""
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in values.items()}


def _read_matrix(name: str, context: Any) -> Array:
    try:
        return matrix(file_text(name, context), _STRESS)
    except TableError as fault:
        raise _file_fault(name, fault) from None


def _read_netcdf(name: str, variable: str, spacing: float | None, context: Any) -> tuple[Array, float | None]:
    """Maps (..., x, y) [Pa] and their spacing [m]."""
    import xarray as xr  # heavy: only where a map is read

    path = file_path(name, context)
    try:
        with xr.open_dataset(path, decode_times=False) as dataset:
            if variable not in dataset:
                found = ", ".join(map(str, dataset.data_vars))[:80]
                raise ValueError(f'there is no variable "{variable}" (found: {found}); name it by variable = "..."')
            data = dataset[variable].load()
    except (OSError, ValueError, RuntimeError) as fault:
        raise _file_fault(name, ValueError(str(fault).splitlines()[0])) from None
    if data.ndim < 2:
        raise _file_fault(name, ValueError(f'"{variable}" has no two dimensions; name a map by variable = "..."'))
    try:
        if {"x", "y"} <= set(data.dims):
            data = data.transpose(..., "x", "y")
            spacing = _coordinate_spacing(data, spacing)
        return np.asarray(data, float) * _factor(data, _STRESS), spacing
    except ValueError as fault:
        raise _file_fault(name, fault) from None


def _factor(data: Any, quantity: Quantity) -> float:
    """Factor to SI from a netCDF variable's ``units``; without the attribute it is SI."""
    unit = data.attrs.get("units", quantity.unit)
    return Quantity(quantity.unit, quantity.meaning).read(f"1 {unit}")


def _coordinate_spacing(data: Any, spacing: float | None) -> float | None:
    """The spacing that the coordinates tell, held against the one given."""
    for axis in ("x", "y"):
        if axis not in data.coords or data.sizes[axis] < 2:
            continue
        steps = np.diff(np.asarray(data[axis], float)) * _factor(data[axis], _SPACING)
        step = float(np.mean(steps))
        uneven = not np.allclose(steps, step, rtol=1e-4, atol=0.0)
        if uneven or (spacing is not None and not math.isclose(abs(step), spacing, rel_tol=1e-4)):
            raise ValueError(
                f"the coordinate {axis} is not spaced by one step, equal in x and y and to the key spacing; "
                "interpolate the map onto a square lattice"
            )
        spacing = abs(step) if spacing is None else spacing
    return spacing


def _estimate(name: str, maps: Array, spacing: float | None, window: str) -> tuple[Array, Array]:
    """Rows of the radial spectrum of maps (..., x, y), averaged over the leading axes."""
    points = min(maps.shape[-2:])
    if spacing is None:
        raise _file_fault(name, ValueError('the map has no coordinates; give spacing, such as "0.5 um"'))
    if points < 8:
        raise _file_fault(name, ValueError(f"a map of {points} points along a side is too small; give at least 8"))
    if not np.all(np.isfinite(maps)):
        raise _file_fault(name, ValueError("the map has gaps (nan or infinite); fill them or crop the map"))
    field = maps[..., :points, :points].reshape(-1, points, points)
    grid = Grid(points * spacing, points)
    density = np.mean(periodogram(field, grid.cell, window), axis=0)
    ring = radial_average(density, grid)
    # the innermost ring begins at half its wavenumber and the outermost ends half a ring beyond: there they stay level
    first, last = (np.pi / grid.cell, (2 * len(ring.q) + 1) * np.pi / grid.cell)
    q = np.concatenate([[first], ring.q, [last]])
    return q, np.concatenate([ring.density[:1], ring.density, ring.density[-1:]])


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
