"""Spectra from data: tables of wavenumbers and densities, estimates from measured stress maps, and these maps.

Convention: ``C(q) = ∫ d²x <τ1(x) τ1(0)> e^{-iq·x}`` in Pa² m², q in rad/m (2π over the wavelength),
``<τ1²> = (1/2π) ∫ q C dq``. For a map of side L it is ``|∫ τ1 e^{-iq·x} d²x|² / L²``. Maps are read from CSV, npy
without pickled objects, or netCDF; declared sizes are not trusted.
"""

import functools
import hashlib
import math
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, Field, PlainSerializer, Strict, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import compliance, free_energy_of_map
from sim.numerics.files import HDF5
from sim.numerics.grid import Lattice, lattice_of
from sim.spectrum.family import Array, Weight
from sim.spectrum.radial import LinearRows, Lines, PowerLaws, Rowed, Rows
from sim.units.quantity import Quantity, keyed
from sim.units.tables import (
    LISTED,
    FromFile,
    blamed,
    file_columns,
    file_path,
    file_text,
    matrix,
)

_WAVENUMBER = Quantity("rad/m", "wavenumber", "q", above=0)
_HEIGHTS = 'it is a spectrum of heights; give a density of stress over the plane, in "Pa^2 m^2"'
_LINE = 'it is the spectrum of a line; give the density over the plane, in "Pa^2 m^2"'
_MISTAKEN = (("m^4", _HEIGHTS), ("m^3", _HEIGHTS), ("m^2", _HEIGHTS), ("Pa^2 m", _LINE))
_DENSITY = Quantity(
    "Pa^2 m^2",
    "power spectral density of the stress",
    "C",
    at_least=0,
    mistaken=_MISTAKEN,
)
Wavenumbers = Annotated[tuple[Annotated[float, _WAVENUMBER], ...], LISTED]
Densities = Annotated[tuple[Annotated[float, _DENSITY], ...], LISTED]
Rescaled = Annotated[
    float, Quantity("Pa", "root mean square of the shear stress", "σ", above=0)
]
_WHERE = "4π² in the integral, <τ1²> = ∫ d²q C / 4π², or in the density, <τ1²> = ∫ d²q C (Persson)"
_Normalization = Annotated[
    Literal["in_integral", "in_density"], Field(description=_WHERE)
]
#: Factor from a density to C: the 4π² stands in the integral ⟨τ1²⟩ = ∫ d²q C / 4π², or already in the density.
NORMALIZATIONS = {"in_integral": 1.0, "in_density": 4 * math.pi**2}
#: How near 2π the ratio of two rms is taken for that of the normalizations.
_NEAR = 0.05
#: Exponent of q below which a table is flat at its first row, and the part of the mean energy that matters.
_FLAT, _PART = 0.5, 0.01


class RowsFromFile(FromFile, Rowed):
    """Base of spectra whose rows may be read from a file."""

    file: str
    wavenumbers: Wavenumbers
    densities: Densities
    rms: Rescaled | None

    def read_file(self, context: Any) -> dict[str, Any]:
        """Return the wavenumbers and densities of the file; ``context`` is that of the validation."""
        raise NotImplementedError

    @property
    def normalization(self) -> str:
        """Place of the 4π², a key of ``NORMALIZATIONS``."""
        return "in_integral"

    def read_keys(self, context: Any) -> dict[str, Any]:
        if self.wavenumbers or self.densities:
            return {}
        with blamed(self.file):
            return self.read_file(context)

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse rows that are no spectrum."""
        rows, steps = (
            (len(self.wavenumbers), len(self.densities)),
            np.diff(self.wavenumbers),
        )
        falls = np.flatnonzero((-steps if self._falling else steps) <= 0.0)
        if rows[0] != rows[1] or rows[0] < 2:
            text = "a spectrum needs at least two rows and one density per wavenumber"
            raise PydanticCustomError(
                "table_too_short", f"{text}, not {rows[0]} and {rows[1]}"
            )
        if len(falls):
            text = f"the wavenumbers must be monotonic, but row {falls[0] + 2} reverses the order of the rows"
            raise PydanticCustomError(
                "table_not_increasing",
                f"{text} before; sort the rows and merge equal ones",
            )
        if not any(self.densities):
            raise PydanticCustomError(
                "table_empty",
                "every density is zero; give a row with a positive one",
                {},
            )
        return self

    @staticmethod
    def _variance(chain: Rows) -> float:
        """Return the variance of rows between which the density is as in this model [Pa²]."""
        return PowerLaws(chain).variance

    @property
    def _falling(self) -> bool:
        return len(self.wavenumbers) > 1 and self.wavenumbers[0] > self.wavenumbers[-1]

    def _chain(self, factor: float) -> Rows:
        """The rows with a factor of the density, rising."""
        order = slice(None, None, -1 if self._falling else 1)
        return Rows(
            np.array(self.wavenumbers[order]), factor * np.array(self.densities[order])
        )

    @functools.cached_property
    def rows(self) -> Rows:  # type: ignore[override]
        """The rows with the 4π² in the integral, at the rms that is given."""
        chain = self._chain(NORMALIZATIONS[self.normalization])
        return (
            chain
            if self.rms is None
            else Rows(chain.q, chain.density * (self.rms**2 / self._variance(chain)))
        )


@keyed()
class Tabulated(RowsFromFile):
    """A radial density given by rows: power laws between them, zero outside.

    Parameters
    ----------
    wavenumbers : tuple of float
        q [rad/m], all rising or all falling.
    densities : tuple of float
        Density at each q [Pa² m²]; next to a zero, which may stand at either end, the interpolation is linear.
    normalization : {"in_integral", "in_density"}
        Where the 4π² stands. "in_integral": the densities are C, and ``<τ1²> = ∫ d²q C / 4π²``. "in_density":
        they are C / 4π², as in Persson's papers, and ``<τ1²> = ∫ d²q`` of them.
    file : str
        In a scenario instead of the rows: a CSV with the columns ``q [rad/m], C [Pa^2 m^2]``. It is
        not read if the rows are given too.
    header : str
        Names of the columns of a file without a header.
    rms : float, optional
        Root mean square [Pa] to which the densities are scaled.

    Examples
    --------
    Two rows of equal density are a band:

    >>> table = Tabulated((1e5, 3e5), (2.0, 2.0))
    >>> print(f"{table.variance:.6e} {2.0 * (9e10 - 1e10) / (4 * np.pi):.6e}")
    1.273240e+10 1.273240e+10
    """

    wavenumbers: Wavenumbers = ()
    densities: Densities = ()
    normalization: _Normalization = "in_integral"
    file: Annotated[
        str,
        Field(
            description="CSV file with the columns q [rad/m], C [Pa^2 m^2], instead of rows"
        ),
    ] = ""
    header: Annotated[
        str,
        Field(
            description="header for a file without one, such as q [cycles/um], C [Pa^2 m^2]"
        ),
    ] = ""
    rms: Rescaled | None = None
    model: Literal["tabulated"] = "tabulated"

    def read_file(self, context: Any) -> dict[str, Any]:
        """Return the columns q and C of the file."""
        if not self.file:
            raise PydanticCustomError(
                "no_table",
                'needs file = "psd.csv" with the columns q [rad/m], C [Pa^2 m^2]',
                {},
            )
        table = file_columns(
            self.file, context, {"q": _WAVENUMBER, "C": _DENSITY}, self.header
        )
        return {"wavenumbers": table["q"], "densities": table["C"]}

    @model_validator(mode="after")
    def _no_gaps(self) -> Self:
        """Refuse zeros between positive rows, which are empty bins and no density."""
        full = np.flatnonzero(self.densities)
        gaps = np.setdiff1d(np.arange(full[0], full[-1]), full) if full.size else full
        if gaps.size:
            text = f"row {gaps[0] + 1} is zero between positive rows, like an empty bin of an average"
            raise PydanticCustomError(
                "table_gaps", f"{text}: its energy would be lost; remove such rows"
            )
        return self

    @property
    def remarks(self) -> tuple[str, ...]:  # type: ignore[override]
        """Remarks on the normalization and on the first row."""
        return self._normalized() + self._cut_plateau()

    def _normalized(self) -> tuple[str, ...]:
        """Remark on the rms that the table has under the other normalization."""
        chains = {
            where: self._chain(factor) for where, factor in NORMALIZATIONS.items()
        }
        rms = {
            where: math.sqrt(PowerLaws(chain).variance)
            for where, chain in chains.items()
        }
        other = next(where for where in NORMALIZATIONS if where != self.normalization)
        words = {where: where.replace("_", " the ") for where in NORMALIZATIONS}
        if self.rms is not None and abs(math.log(self.rms / rms[other])) < _NEAR:
            text = f"the table has the rms of {self.rms:.3g} Pa with the 4π² {words[other]}, to which it is scaled:"
            return (f'{text} normalization = "{other}" may be meant',)
        if self.rms is None and self.file:
            text = f"the table is read with the 4π² {words[self.normalization]}, rms {rms[self.normalization]:.3g} Pa;"
            text += f" {words[other]} it would be {rms[other]:.3g} Pa, and the energy 39.5 times as"
            more = "large" if rms[other] > rms[self.normalization] else "small"
            return (
                f"{text} {more}: shear.spectrum.normalization chooses, rms fixes it",
            )
        return ()

    def _cut_plateau(self) -> tuple[str, ...]:
        """Remark on the energy below a first row at which the density is flat; the mean energy goes as ∫ C dq."""
        (q, *_), (density, *_) = self.rows.q, self.rows.density
        flat = density > 0.0 and abs(
            math.log(self.rows.density[1] / density)
        ) < _FLAT * math.log(self.rows.q[1] / q)
        if not (flat and self.file) or q * density < _PART * self.line_integral:
            return ()
        more, condition = q * density / self.line_integral, ""
        # the plateau takes its part of the variance from the rest
        if self.rms is not None:
            more = (1.0 + more) / (
                1.0 + density * q**2 / (4.0 * math.pi * self.rms**2)
            ) - 1.0
            condition = ", the rms kept"
        text = f"the table is flat at its first row and zero before: below {q:.3g} rad/m a plateau down to 0 would add"
        return (
            f"{text} {more:.0%} to the mean energy{condition}; add a row where it ends",
        )


# Files of measured stress maps: CSV, npy without pickled objects, netCDF. Declared sizes are not trusted.


STRESS = Quantity("Pa", "shear stress", "τ1")
SPACING = Quantity("m", "distance between neighbouring points of the map", "d", above=0)
#: Most numbers of a map, and least along a side.
_MOST, LEAST = 10**8, 8


class MapFile(NamedTuple):
    """Contents of a file: stresses (..., rows, columns) [Pa], or (..., x, y) where the file names its axes.

    ``spacings`` are those of its coordinates x and y [m], None without.
    """

    values: Array
    has_axes: bool = False
    spacings: tuple[float | None, float | None] = (None, None)


def checked_unit(unit: str) -> str:
    """Return a unit of stress, "" for that of the file; raise ValueError for any other."""
    STRESS.scaled(1.0, unit)
    return unit


_UNIT = "unit of a CSV, npy or netCDF file that does not name one; Pa if it is omitted"
MapUnit = Annotated[str, AfterValidator(checked_unit), Field(description=_UNIT)]


def read_map(
    name: str, context: Any, variable: str, gaps: bool = False, unit: str = ""
) -> MapFile:
    """Read a map from a file that a scenario names, by the ending of its name.

    Parameters
    ----------
    name : str
        Path relative to the scenario: .nc, .nc4 or .cdf is netCDF, .npy an array of numpy, all else CSV.
    context : dict or None
        The validation's context, as of ``sim.units.tables.file_text``.
    variable : str
        Name of the map in a netCDF file.
    gaps : bool
        Whether points may be nan.
    unit : str
        The stresses' unit, if the file names none.

    Raises
    ------
    ValueError
        If it cannot be read as a map, is too small or has gaps; within ``blamed`` a fault of the file.
    """
    if name.lower().endswith((".nc", ".nc4", ".cdf")):
        map_file = _from_netcdf(file_path(name, context), variable, unit)
    elif name.lower().endswith(".npy"):
        map_file = MapFile(STRESS.scaled(_from_npy(file_path(name, context)), unit))
    else:
        map_file = MapFile(matrix(file_text(name, context), STRESS, gaps, unit))
    values = map_file.values
    if values.ndim < 2 or values.size == 0:
        raise ValueError("the map does not have two dimensions; give rows and columns")
    if (points := min(values.shape[-2:])) < LEAST:
        raise ValueError(
            f"a map of {points} points along a side is too small; give at least {LEAST}"
        )
    if not np.all(np.isfinite(values) | (np.isnan(values) & gaps)):
        raise ValueError(
            "the map has gaps (nan or infinite); fill them or crop the map"
        )
    for value in (
        (np.nanmin(values), np.nanmax(values)) if np.isfinite(values).any() else ()
    ):
        STRESS.read(value)
    return map_file


def _from_npy(path: Path) -> Array:
    """Return the numbers of an array that numpy has saved."""
    # the file holds as many numbers as its header says
    values = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(values, np.ndarray) or values.dtype.kind not in "fiu":
        raise ValueError(
            "it does not hold real numbers; save a map of numbers, such as numpy.save of a float array"
        )
    if values.size > _MOST:
        raise ValueError(f"it has more than {_MOST:.0e} numbers; crop the map")
    return np.array(values, float)


def _from_netcdf(path: Path, variable: str, unit: str) -> MapFile:
    """Maps and their spacings in a netCDF file."""
    # imports xarray, which only maps need here
    from sim.numerics.lazy import Refused, open_lazily

    try:
        dataset = open_lazily(path)
    except Refused as fault:
        raise ValueError(f"{fault}; write the map again, as a plain variable") from None
    with HDF5, dataset:
        if variable not in dataset:
            raise ValueError(
                f'there is no variable "{variable}"; name it by variable = "..."'
            )
        data = dataset[variable]
        if data.ndim < 2 or data.dtype.kind not in "fiu":
            raise ValueError(
                f'"{variable}" is not an array of numbers in two dimensions; give variable = "..."'
            )
        if data.size > _MOST:
            raise ValueError(
                f'"{variable}" has more than {_MOST:.0e} numbers; crop the map'
            )
        data = data.load()
    has_axes = {"x", "y"} <= set(data.dims)
    if has_axes:
        data = data.transpose(..., "x", "y")
    spacings = _spacing(data, "x"), _spacing(data, "y")
    steps = [
        np.ptp(np.asarray(data[axis], float)) / (data.sizes[axis] - 1)
        for axis in ("x", "y")
        if has_axes
    ]
    if has_axes and None in spacings and not math.isclose(*steps, rel_tol=1e-4):
        raise ValueError(
            "x and y have other steps but no units; give both coordinates the attribute units, such as um"
        )
    factor, of_key = _factor(data, STRESS, unit), STRESS.scaled(1.0, unit)
    if unit and not math.isclose(factor, of_key):
        raise ValueError(
            f'"{variable}" is in {data.attrs["units"]}, not in {unit} as the key unit has it; leave unit out'
        )
    return MapFile(
        np.asarray(data, float) * factor,
        has_axes,
        spacings if has_axes else (None, None),
    )


def spacings_of(
    map_file: MapFile, along: float | None, across: float | None, key: str
) -> tuple[float, float]:
    """Return the distances of points along x and y [m], of the ``key`` of a scenario or the file, which must agree."""
    across = along if across is None else across
    for step, spacing in zip((along, across), map_file.spacings, strict=True):
        if (
            step is not None
            and spacing is not None
            and not math.isclose(step, spacing, rel_tol=1e-4)
        ):
            raise ValueError(
                f"the points are {spacing:g} m apart, not {step:g} m as in {key}; omit {key}"
            )
    along = along or map_file.spacings[0]
    across = across or map_file.spacings[1] or along
    if along is None or across is None:
        raise ValueError(
            f'the map has no coordinates with units; give {key}, such as "0.5 um"'
        )
    return along, across


def _factor(data: Any, quantity: Quantity, unit: str = "") -> float:
    """Factor to SI from a netCDF variable's ``units``; without the attribute from a unit, or it is SI."""
    written = str(data.attrs.get("units", unit or quantity.unit))
    return Quantity(quantity.unit, quantity.meaning).read(f"1 {written}")


def _spacing(data: Any, axis: str) -> float | None:
    """Spacing of a coordinate [m]; None without it or its unit."""
    if axis not in data.indexes or data.sizes[axis] < 2:
        return None
    steps = np.diff(np.asarray(data[axis], float)) * _factor(data[axis], SPACING)
    step = float(np.mean(steps))
    if not np.allclose(steps, step, rtol=1e-4, atol=0.0):
        raise ValueError(
            f"the coordinate {axis} is not spaced by one step; interpolate the map onto a square lattice"
        )
    return abs(step) if "units" in data[axis].attrs else None


# Power spectral density of a stress map on a grid, and its radial average.


def periodogram(
    field: Array, cell: float | tuple[float, float], window: str = "none"
) -> Array:
    """Return the power spectral density of maps, on the half spectrum of their lattice.

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
    >>> total = np.sum(grid.multiplicity * periodogram(field, 2.0)) / 2.0**2
    >>> print(f"{float(total / np.var(field)):.12f}")
    1.000000000000
    """
    lattice = lattice_of(cell, field.shape[-2:])
    transform = lattice.forward(tapered(field, window))
    transform[..., 0, 0] = 0.0  # what rounding left of the mean
    return (transform.real**2 + transform.imag**2) / lattice.area


def tapered(field: Array, window: str) -> Array:
    """Maps less their mean under a window, times the window, whose mean square is one; arguments of ``periodogram``."""
    if window not in ("none", "hann"):
        raise ValueError(f'window must be "none" or "hann", not {window!r}')
    along, across = (
        np.ones(points)
        if window == "none"
        else 1.0 - np.cos(2 * np.pi * (np.arange(points) + 0.5) / points)
        for points in field.shape[-2:]
    )
    taper = along[:, None] * across
    mean = np.mean(field * taper, axis=(-2, -1), keepdims=True) / np.mean(taper)
    return (field - mean) * (taper / math.sqrt(np.mean(taper**2)))


class RadialAverage(NamedTuple):
    """Means over rings of the wavevector lattice, each array of shape (rings,)."""

    q: Array  #: mean wavenumber of the ring [rad/m]
    density: Array  #: mean density [Pa² m²]
    standard_error: Array  #: of that mean, from the scatter within the ring [Pa² m²]
    pairs: Array  #: independent modes ±q in the ring


def side_of_rings(lattice: Lattice) -> float:
    """Return the length L whose wavenumber 2π/L is the width of a ring: the side of a square of the same area [m]."""
    first, second = lattice.sides
    return first if first == second else math.sqrt(lattice.area)


def radial_average(density: Array, grid: Lattice) -> RadialAverage:
    """Average a density over rings of q L/2π in [k - ½, k + ½), k = 1, 2, ... below Nyquist.

    Parameters
    ----------
    density : array, shape (nx, ny // 2 + 1)
        On the half spectrum of ``grid``.
    grid : Lattice
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
    rings = min(
        (points - 1) // 2 if side == length else int((points - 1) / 2 * length / side)
        for points, side in zip(grid.shape, grid.sides, strict=True)
    )
    inside = (ring > 0) & (ring <= rings)
    # the first column holds both q and -q
    share = np.broadcast_to(grid.multiplicity / 2, q.shape)[inside]
    place = ring[inside] - 1

    def total(values: Array) -> Array:
        return np.asarray(np.bincount(place, share * values, rings), float)

    pairs = total(np.ones(len(place)))
    mean = total(density[inside]) / pairs
    scatter = total((density[inside] - mean[place]) ** 2) / np.maximum(pairs - 1, 1)
    return RadialAverage(
        total(q[inside]) / pairs, mean, np.sqrt(scatter / pairs), pairs
    )


# Spectrum estimated from measured stress maps.


@keyed()
class Measured(RowsFromFile, LinearRows):
    """The radially averaged spectrum of measured stress maps, used as a table that is linear between its rows.

    Parameters
    ----------
    file : str
        A CSV with nothing but the stresses [Pa], one row of the map per line, an array that numpy has saved
        (.npy), or a netCDF file (.nc).
    spacing : float, optional
        Distance of neighbouring points [m], the same in x and y; for netCDF taken from the
        coordinates ``x`` and ``y`` where they exist.
    window : {"none", "hann"}
        "hann" unless the map is periodic: the jump at its borders would leak into all wavenumbers.
    variable : str
        Name in a netCDF file; dimensions before the last two (or beside x, y) are averaged over.
    unit : str
        Unit of the numbers of a file that does not name it.
    wavenumbers, densities : tuple of float
        The estimate, filled in on reading and not meant to be given.
    rms : float, optional
        Root mean square [Pa] to which the spectrum is scaled.

    Notes
    -----
    The mean is removed. The spectrum has the variance of the map and the energy that its waves store at a mean over
    directions, both exactly, see ``estimate``. Of a map under a window these are the sums of the tapered map, which
    has the mean square of the map only on average over the places at which it may be cut out. Waves in the corners
    beyond Nyquist count, and no wave is longer than about 2.4 times the longest side.

    A direction in which waves are stronger than in others is lost, and with it up to some 30 % of the energy:
    ``StressMap`` keeps the very map.

    Examples
    --------
    A single wave becomes a triangle about its wavenumber, which keeps its variance and its energy:

    >>> wave = np.cos(2 * np.pi * 5 * np.arange(32) / 32)[:, None] * np.ones(32)
    >>> q, density = estimate(wave[None], 2 * np.pi, "none")
    >>> print([f"{k:.0f}" for k in q[density > 1e-9]])
    ['5']
    >>> spectrum = Measured("", wavenumbers=tuple(q), densities=tuple(density))
    >>> print(f"{spectrum.variance:.12f} {spectrum.over_wavenumber[0] * 5:.12f}")
    0.500000000000 0.500000000000
    """

    file: Annotated[
        str,
        Field(description="the map: plain CSV in Pa, one row a line, npy or netCDF"),
    ]
    spacing: Annotated[float, SPACING] | None = None
    window: Annotated[
        Literal["none", "hann"],
        Field(
            description='taper of the map before its transform; "hann" unless it is periodic'
        ),
    ] = "none"
    variable: Annotated[str, Field(description="name of the map in a netCDF file")] = (
        "shear_map"
    )
    unit: MapUnit = ""
    wavenumbers: Wavenumbers = ()
    densities: Densities = ()
    rms: Rescaled | None = None
    model: Literal["measured"] = "measured"

    @staticmethod
    def _variance(chain: Rows) -> float:
        """Return the variance of rows between which the density is linear [Pa²]."""
        return Lines(chain).variance

    @property
    def rms_of_map(self) -> float:  # type: ignore[override]
        return math.sqrt(self.variance) if self.rms is None else math.nan

    def read_file(self, context: Any) -> dict[str, Any]:
        """Return the spacing and the rows of the estimate from the maps of the file."""
        map_file = read_map(self.file, context, self.variable, unit=self.unit)
        along, across = spacings_of(map_file, self.spacing, None, "spacing")
        if not math.isclose(along, across, rel_tol=1e-4):
            raise ValueError(
                "x and y are not spaced by one step; interpolate the map onto a square lattice"
            )
        maps = map_file.values.reshape(-1, *map_file.values.shape[-2:])
        q, density = estimate(
            maps, (maps.shape[1] * along, maps.shape[2] * along), self.window
        )
        return {"spacing": along, "wavenumbers": q, "densities": density}


def estimate(
    maps: Array, cell: float | tuple[float, float], window: str
) -> tuple[Array, Array]:
    """Return the rows of the radial spectrum of maps, averaged over them.

    Parameters
    ----------
    maps : array, shape (maps, nx, ny)
        Stress [Pa].
    cell : float or (float, float)
        Sides of a map along x and y [m].
    window : {"none", "hann"}
        As of ``periodogram``.

    Returns
    -------
    (array, array)
        Wavenumbers [rad/m] and densities [Pa² m²], between which the density is linear.

    Notes
    -----
    The rows are the multiples of w = 2π/L, L the longest side. A wave of variance P at the wavenumber q has the share
    P/q of ``∫ C dq / 2π``, to which the energy is proportional. This share is divided linearly between the two rows
    beside q. The triangle of the density about a row kw has the mean wavenumber kw, so that both ``Σ P/q`` and, by
    their mean wavenumbers, ``Σ P`` are kept for any map. Below the first row the density is level, over the length
    w/√3 for which the mean wavenumber is w.

    The division smooths: a density ∝ q^-α is about α(α + 1)/(12k²) too large at the row k. For the slopes of rough
    surfaces, α ≤ 4, this is less than the scatter 1/√(πk) of 2πk random waves from the third row on. The number of
    lattice points near a row is not quite 2πk, which changes its density by up to 0.1/√k, and the first one by a sixth.
    """
    lattice = lattice_of(cell, maps.shape[-2:])
    step = 2 * np.pi / max(lattice.sides)
    power = lattice.multiplicity * np.mean(periodogram(maps, cell, window), axis=0)
    q = np.hypot(*lattice.wavevectors) / step
    is_wave = q > 0.0
    q, power = q[is_wave], power[is_wave] / lattice.area
    share = power / (q * step)
    # rounding brings the longest wave below the first row
    q = np.maximum(q, 1.0)
    row = np.floor(q).astype(int)
    above = q - row
    count = int(row.max()) + 1
    sums = np.bincount(row - 1, share * (1.0 - above), count)
    sums += np.bincount(row, share * above, count)
    level = 1.0 / math.sqrt(3.0)
    widths = np.ones(count)
    widths[0] = level + 0.5
    density = 2 * np.pi * sums / (widths * step)
    rows = np.concatenate([[1.0 - level], np.arange(1.0, count + 2.0)])
    return rows * step, np.concatenate([density[:1], density, [0.0]])


# A measured map of the shear stress, used as it is: its file, its mean, and the energy that it stores. x is the
# direction of sliding. The elastic response differs along x and y, so that a map with exchanged axes stores up to twice
# or half as much.

_START = Quantity(
    "m",
    "first position of a disc along x of the map; if omitted, the middle",
    "x_0",
    at_least=0,
)
_NOISE = Quantity(
    "Pa",
    "rms of the white measurement noise per pixel, which is reported",
    "s",
    at_least=0,
)
_WINDOW = 'taper of a map that is not periodic; "none" on a disc'
_ROWS = "axis from row to row of a CSV or npy file; netCDF names its axes"
_MASK = "true: nan marks points outside the contact, without stress"


_DIGEST = PlainSerializer(
    lambda values: hashlib.sha256(values).hexdigest(), return_type=str, when_used="json"
)
_Values = Annotated[bytes, Strict(), SkipJsonSchema(), _DIGEST]
_Shape = Annotated[tuple[int, int], SkipJsonSchema()]


@keyed()
class StressMap(FromFile):
    """A measured map of the shear stress itself, with its phases and directions.

    Parameters
    ----------
    file : str
        A CSV with nothing but the stresses [Pa], one row of the map per line, an array that numpy has saved (.npy),
        or a netCDF file (.nc).
    pixel : float, optional
        Distance of neighbouring points along x, the direction of sliding [m]; for netCDF taken from the coordinates
        ``x`` and ``y`` where they exist.
    pixel_y : float, optional
        Distance along y [m], where it is another one.
    window : {"none", "hann"}
        "hann" tapers the edge of a map that is not periodic, at the same rms.
    rows : {"y", "x"}
        What changes from row to row of a CSV or npy: as in a picture y, along a row x. The first row and column are
        the lowest y and x.
    mask : bool
        Whether nan marks what lies outside of the contact.
    noise : float
        rms [Pa] of white noise in a pixel: what energy it seems to store is reported, not subtracted.
    start : float, optional
        Place along x at which the middle of a disc begins [m], without it the middle of the map. The pattern passes
        the contact in +x, so that sliding in +x brings lower x under the disc.
    variable : str
        Name in a netCDF file.
    unit : str
        Unit of the numbers of a file that does not name it.
    values, shape : bytes, (int, int)
        The numbers, filled in on reading and not meant to be given.

    Examples
    --------
    A ripple along x stores τ²/(8Gq), whatever its mean:

    >>> from sim.solid import HalfSpace
    >>> ripple = 5.0 + np.cos(2 * np.pi * np.arange(16) / 16)[:, None] * np.ones(8)
    >>> stress = StressMap(file="", pixel=1 / 16, values=ripple.tobytes(), shape=(16, 8))
    >>> print(f"{stress.mean:.1f} {HalfSpace(1.0).stored_energy(stress) * 16 * np.pi:.3f}")
    5.0 1.000
    """

    file: Annotated[
        str, Field(description="the map: CSV in Pa, one row a line, npy, or netCDF")
    ]
    pixel: Annotated[float, SPACING] | None = None
    pixel_y: Annotated[float, SPACING] | None = None
    window: Annotated[Literal["none", "hann"], Field(description=_WINDOW)] = "none"
    rows: Annotated[Literal["y", "x"], Field(description=_ROWS)] = "y"
    mask: Annotated[bool, Field(description=_MASK)] = False
    noise: Annotated[float, _NOISE] = 0.0
    start: Annotated[float, _START] | None = None
    variable: Annotated[str, Field(description="name of the map in a netCDF file")] = (
        "shear_map"
    )
    unit: MapUnit = ""
    values: _Values = Field(default=b"", repr=False)
    shape: _Shape = (0, 0)

    @model_validator(mode="after")
    def _goes_together(self) -> Self:
        if self.mask and self.window != "none":
            message = (
                "a window would taper the stress inside the contact; omit it with mask"
            )
            raise PydanticCustomError("window", message, {})
        if self.mask and not self.square:
            raise PydanticCustomError(
                "pixels",
                "a masked map needs square pixels; interpolate it onto them",
                {},
            )
        return self

    def read_keys(self, context: Any) -> dict[str, Any]:
        if self.values:
            return {}
        with blamed(self.file):
            return self._read_file(context)

    def _read_file(self, context: Any) -> dict[str, Any]:
        map_file = read_map(
            self.file, context, self.variable, gaps=True, unit=self.unit
        )
        values = _one_map(map_file, self.rows)
        if not self.mask and np.isnan(values).any():
            raise ValueError(
                "the map has gaps (nan); with mask = true they mark points outside the contact"
            )
        if not np.nanmax(values, initial=-math.inf) > np.nanmin(
            values, initial=math.inf
        ):
            raise ValueError(
                "the stress is uniform, so there are no fluctuations; check the file"
            )
        pixel, pixel_y = spacings_of(map_file, self.pixel, self.pixel_y, "pixel")
        return {
            "pixel": pixel,
            "pixel_y": pixel_y,
            "values": values.tobytes(),
            "shape": values.shape,
        }

    @property
    def pixels(self) -> tuple[float, float]:
        """Distances of neighbouring points along x and y [m]."""
        pixel = self.pixel or 1.0
        return pixel, self.pixel_y or pixel

    @property
    def square(self) -> bool:
        """True if a pixel is as wide as it is high."""
        return math.isclose(*self.pixels, rel_tol=1e-4)

    @property
    def middle(self) -> float:
        """Place of the middle of the map along x [m]."""
        return self.shape[0] // 2 * self.pixels[0]

    @property
    def begin(self) -> float:
        """Place along x at which the middle of a disc begins [m]."""
        return self.middle if self.start is None else self.start

    @functools.cached_property
    def lattice(self) -> Lattice:
        """The map as a periodic cell."""
        (nx, ny), (along, across) = self.shape, self.pixels
        return lattice_of((nx * along, ny * across), self.shape)

    @functools.cached_property
    def _measured(self) -> Array:
        """Stress [Pa], shape (nx, ny), nan outside of the contact."""
        return np.frombuffer(self.values).reshape(self.shape)

    @functools.cached_property
    def inside(self) -> float:
        """Share of the map that lies inside of the contact."""
        return 1.0 - float(np.isnan(self._measured).mean())

    @functools.cached_property
    def mean(self) -> float:
        """Mean stress inside of the contact [Pa], which is no part of the field."""
        return float(np.nanmean(self._measured))

    @functools.cached_property
    def field(self) -> Array:
        """Fluctuation τ1 [Pa], shape (nx, ny): less its mean, tapered by the window, 0 outside of the contact."""
        fluctuation = np.nan_to_num(self._measured - self.mean, nan=0.0)
        fluctuation = (
            fluctuation
            if self.window == "none"
            else tapered(self._measured, self.window)
        )
        fluctuation.flags.writeable = False
        return fluctuation

    @functools.cached_property
    def rms(self) -> float:
        """Root mean square of the fluctuation inside of the contact [Pa]."""
        return math.sqrt(float(np.mean(self.field**2)) / self.inside)

    @functools.cached_property
    def spectrum(self) -> Measured:
        """The radially averaged spectrum, of which random fields can be drawn."""
        q, density = estimate(self.field[np.newaxis], self.lattice.sides, "none")
        return Measured(
            self.file, wavenumbers=tuple(q), densities=tuple(density / self.inside)
        )

    @functools.cached_property
    def over_wavenumber(self) -> tuple[float, float]:
        """Integrals of C/\\|q\\| and of C cos 2θ/\\|q\\| over d²q/4π² [Pa² m], per area of the contact.

        Without a mask those of the periodic map, else those of a map without any stress around it.
        """

        def twice_energy(poisson_ratio: float) -> float:
            if self.mask:
                pixel = self.pixels[0]
                energy = free_energy_of_map(self.field, pixel, 1.0, poisson_ratio)
                return 2.0 * float(energy) / self.inside
            return self.total(lambda qx, qy: compliance(qx, qy, 1.0, poisson_ratio))

        mean = twice_energy(0.0)
        return mean, mean - 2.0 * twice_energy(1.0)

    def total(self, weight: Weight) -> float:
        """Return the sum of the power of the periodic map times a weight, per area of the contact."""
        weights = weight(*self.lattice.wavevectors)
        power = self.lattice.weighted_power(self.field, weights)
        return float(power) / (self.lattice.area**2 * self.inside)


def _one_map(map_file: MapFile, rows: str) -> Array:
    """The only map of a file, shape (nx, ny)."""
    if math.prod(map_file.values.shape[:-2]) != 1:
        many = math.prod(map_file.values.shape[:-2])
        raise ValueError(f"it holds {many} maps; save the wanted map on its own")
    values = map_file.values.reshape(map_file.values.shape[-2:])
    return np.ascontiguousarray(
        values if map_file.has_axes or rows == "x" else values.T
    )
