"""A measured map of the shear stress, used as it is: its file, its mean, and the energy that it stores.

x is the direction of sliding. The elastic response differs along x and y, so that a map with exchanged axes stores up
to twice or half as much.
"""

import hashlib
import math
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, PlainSerializer, Strict, ValidationInfo, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import free_energy_of_map, noise_energy, surface_energy
from sim.numerics.grid import Lattice, lattice_of
from sim.spectrum.family import Array
from sim.spectrum.measured import SPACING, MapFile, MapUnit, Measured, estimate, read_map, spacings_of, tapered
from sim.units.quantity import Quantity, keyed
from sim.units.tables import blamed

_START = Quantity("m", "first position of a disc along x of the map; if omitted, the middle", "x_0", at_least=0)
_NOISE = Quantity("Pa", "rms of the white measurement noise per pixel, which is reported", "s", at_least=0)
_WINDOW = 'taper of a map that is not periodic; "none" on a disc'
_ROWS = "axis from row to row of a CSV or npy file; netCDF names its axes"
_MASK = "true: nan marks points outside the contact, without stress"


_DIGEST = PlainSerializer(lambda values: hashlib.sha256(values).hexdigest(), return_type=str, when_used="json")
_Values = Annotated[bytes, Strict(), SkipJsonSchema(), _DIGEST]
_Shape = Annotated[tuple[int, int], SkipJsonSchema()]


@keyed()
class StressMap:
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
        Place along x at which the middle of a disc begins [m], without it the middle of the map. As the pattern moves
        with the slider, sliding in +x brings lower x under the disc.
    variable : str
        Name in a netCDF file.
    unit : str
        Unit of the numbers of a file that does not name it.
    values, shape : bytes, (int, int)
        The numbers, filled in on reading and not meant to be given.

    Examples
    --------
    A ripple along x stores τ²/(8Gq), whatever its mean:

    >>> ripple = 5.0 + np.cos(2 * np.pi * np.arange(16) / 16)[:, None] * np.ones(8)
    >>> stress = StressMap(file="", pixel=1 / 16, values=ripple.tobytes(), shape=(16, 8))
    >>> print(f"{stress.mean:.1f} {stress.surface_energy(1.0) * 16 * np.pi:.3f}")
    5.0 1.000
    """

    file: Annotated[str, Field(description="the map: CSV in Pa, one row a line, npy, or netCDF")]
    pixel: Annotated[float, SPACING] | None = None
    pixel_y: Annotated[float, SPACING] | None = None
    window: Annotated[Literal["none", "hann"], Field(description=_WINDOW)] = "none"
    rows: Annotated[Literal["y", "x"], Field(description=_ROWS)] = "y"
    mask: Annotated[bool, Field(description=_MASK)] = False
    noise: Annotated[float, _NOISE] = 0.0
    start: Annotated[float, _START] | None = None
    variable: Annotated[str, Field(description="name of the map in a netCDF file")] = "shear_map"
    unit: MapUnit = ""
    values: _Values = Field(default=b"", repr=False)
    shape: _Shape = (0, 0)

    @model_validator(mode="after")
    def _goes_together(self, info: ValidationInfo) -> Self:
        if not self.values:
            with blamed(self.file):
                self._read_file(info.context)
        if self.mask and self.window != "none":
            message = "a window would taper the stress inside the contact; omit it with mask"
            raise PydanticCustomError("window", message, {})
        if self.mask and not self.square:
            raise PydanticCustomError("pixels", "a masked map needs square pixels; interpolate it onto them", {})
        return self

    def _read_file(self, context: Any) -> None:
        map_file = read_map(self.file, context, self.variable, gaps=True, unit=self.unit)
        values = _one_map(map_file, self.rows)
        if not self.mask and np.isnan(values).any():
            raise ValueError("the map has gaps (nan); with mask = true they mark points outside the contact")
        if not np.nanmax(values, initial=-math.inf) > np.nanmin(values, initial=math.inf):
            raise ValueError("the stress is uniform, so there are no fluctuations; check the file")
        pixel, pixel_y = spacings_of(map_file, self.pixel, self.pixel_y, "pixel")
        vars(self).update(pixel=pixel, pixel_y=pixel_y, values=values.tobytes(), shape=values.shape)

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

    @cached_property
    def lattice(self) -> Lattice:
        """The map as a periodic cell."""
        (nx, ny), (along, across) = self.shape, self.pixels
        return lattice_of((nx * along, ny * across), self.shape)

    @cached_property
    def _measured(self) -> Array:
        """Stress [Pa], shape (nx, ny), nan outside of the contact."""
        return np.frombuffer(self.values).reshape(self.shape)

    @cached_property
    def inside(self) -> float:
        """Share of the map that lies inside of the contact."""
        return 1.0 - float(np.isnan(self._measured).mean())

    @cached_property
    def mean(self) -> float:
        """Mean stress inside of the contact [Pa], which is no part of the field."""
        return float(np.nanmean(self._measured))

    @cached_property
    def field(self) -> Array:
        """Fluctuation τ1 [Pa], shape (nx, ny): less its mean, tapered by the window, 0 outside of the contact."""
        fluctuation = np.nan_to_num(self._measured - self.mean, nan=0.0)
        fluctuation = fluctuation if self.window == "none" else tapered(self._measured, self.window)
        fluctuation.flags.writeable = False
        return fluctuation

    @cached_property
    def rms(self) -> float:
        """Root mean square of the fluctuation inside of the contact [Pa]."""
        return math.sqrt(float(np.mean(self.field**2)) / self.inside)

    @cached_property
    def spectrum(self) -> Measured:
        """The radially averaged spectrum, of which random fields can be drawn."""
        q, density = estimate(self.field[np.newaxis], self.lattice.sides, "none")
        return Measured(self.file, wavenumbers=tuple(q), densities=tuple(density / self.inside))

    def surface_energy(self, shear_modulus: float, poisson_ratio: float = 0.5) -> float:
        """Elastic energy of this very map per area [J/m²].

        Without a mask that of the periodic map, else that of the stress in a free half-space, per area of the contact.
        """
        if self.mask:
            each = free_energy_of_map(self.field, self.pixels[0], shear_modulus, poisson_ratio)
            return float(each) / self.inside
        return float(surface_energy(self.field, self.lattice.sides, shear_modulus, poisson_ratio))

    def noise_energy(self, shear_modulus: float, poisson_ratio: float = 0.5) -> float:
        """Share of the energy that the measurement's noise makes [J/m²]."""
        return float(noise_energy(self.noise, math.sqrt(self.lattice.pixel), shear_modulus, poisson_ratio))


def _one_map(map_file: MapFile, rows: str) -> Array:
    """The only map of a file, shape (nx, ny)."""
    if math.prod(map_file.values.shape[:-2]) != 1:
        many = math.prod(map_file.values.shape[:-2])
        raise ValueError(f"it holds {many} maps; save the wanted map on its own")
    values = map_file.values.reshape(map_file.values.shape[-2:])
    return np.ascontiguousarray(values if map_file.has_axes or rows == "x" else values.T)
