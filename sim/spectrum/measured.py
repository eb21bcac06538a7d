"""Spectrum estimated from measured stress maps.

Convention: ``C(q) = ∫ d²x <τ1(x) τ1(0)> e^{-iq·x}`` in Pa² m², q in rad/m (2π over the wavelength),
``<τ1²> = (1/2π) ∫ q C dq``. For a map of side L it is ``|∫ τ1 e^{-iq·x} d²x|² / L²``.
"""

import functools
import math
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass

from sim.numerics.grid import lattice_of
from sim.spectrum.family import Array
from sim.spectrum.map_file import SPACING, MapFile, read_map
from sim.spectrum.periodogram import periodogram, radial_average, side_of_rings
from sim.spectrum.radial import PowerLaws
from sim.spectrum.tabulated import Densities, FromFile, Rescaled, Wavenumbers, by_name
from sim.units.table import blamed


@dataclass(frozen=True, config={"extra": "forbid"})
class Measured(FromFile):
    """The radially averaged spectrum of measured stress maps, used as a table.

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
    wavenumbers, densities : tuple of float
        The estimate, filled in on reading and not meant to be given.
    rms : float, optional
        Root mean square [Pa] to which the spectrum is scaled.

    Notes
    -----
    The mean is removed. Rings of one lattice step 2π/L are averaged, L the side, or of a map that is not square
    the side of a square as large; the rows reach from π/L to the outer edge of the last ring below
    Nyquist, level in the innermost and the outermost half ring, so that waves longer than twice the
    map and the corners beyond Nyquist are not part of the spectrum. A direction in which waves are stronger than in
    others is lost, and with it up to some 30 % of the energy: ``sim.spectrum.stress_map`` keeps the very map.
    """

    file: Annotated[str, Field(description="the map: plain CSV in Pa, one row a line, npy or netCDF")]
    spacing: Annotated[float, SPACING] | None = None
    window: Annotated[
        Literal["none", "hann"],
        Field(description='taper of the map before its transform; "hann" unless it is periodic'),
    ] = "none"
    variable: Annotated[str, Field(description="name of the map in a netCDF file")] = "shear_map"
    wavenumbers: Wavenumbers = ()
    densities: Densities = ()
    rms: Rescaled | None = None
    model: Literal["measured"] = "measured"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        values = by_name(values, ("file", "spacing", "window", "variable", "wavenumbers", "densities", "rms"))
        if not isinstance(values, dict):
            return values
        name, window = values.get("file"), values.get("window", "none")
        if values.get("wavenumbers") or not isinstance(name, str) or window not in ("none", "hann"):
            return values
        try:
            spacing = None if values.get("spacing") is None else SPACING.read(values["spacing"])
        except ValueError:
            return values  # refused by the field's own check
        with blamed(name):
            found = read_map(name, info.context, str(values.get("variable", "shear_map")))
            spacing = _one_spacing(found, spacing)
            maps = found.values.reshape(-1, *found.values.shape[-2:])
            q, density = estimate(maps, (maps.shape[1] * spacing, maps.shape[2] * spacing), window)
        return {**values, "spacing": spacing, "wavenumbers": q.tolist(), "densities": density.tolist()}

    @functools.cached_property
    def rows(self) -> PowerLaws:
        """The estimate as a chain of power laws."""
        return self._scaled(self._chain())


def _one_spacing(found: MapFile, spacing: float | None) -> float:
    """Spacing in x and y alike [m], which must agree with the one given."""
    for one in filter(None, found.spacings):
        if spacing is not None and not math.isclose(one, spacing, rel_tol=1e-4):
            said = "the coordinates are not spaced by one step, equal in x and y and to the key spacing"
            raise ValueError(f"{said}; interpolate the map onto a square lattice")
        spacing = one if spacing is None else spacing
    if spacing is None:
        raise ValueError('the map has no coordinates; give spacing, such as "0.5 um"')
    return spacing


def estimate(maps: Array, cell: float | tuple[float, float], window: str) -> tuple[Array, Array]:
    """Rows of the radial spectrum of maps (maps, x, y), averaged over them."""
    lattice = lattice_of(cell, maps.shape[-2:])
    ring = radial_average(np.mean(periodogram(maps, cell, window), axis=0), lattice)
    # the innermost ring begins at half its wavenumber and the outermost ends half a ring beyond: there they stay level
    length = side_of_rings(lattice)
    first, last = (np.pi / length, (2 * len(ring.q) + 1) * np.pi / length)
    q = np.concatenate([[first], ring.q, [last]])
    return q, np.concatenate([ring.density[:1], ring.density, ring.density[-1:]])
