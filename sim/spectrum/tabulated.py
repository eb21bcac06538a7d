"""Spectrum given by a table of wavenumbers and densities, and the reading that tables from data share."""

import functools
import math
from typing import Annotated, Any, Literal, Protocol, Self

import numpy as np
from pydantic import Field, ValidationInfo, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import ArgsKwargs, PydanticCustomError

from sim.spectrum.radial import PowerLaws, Rowed
from sim.units.quantity import Quantity
from sim.units.table import at_once, file_columns

_WAVENUMBER = Quantity("rad/m", "wavenumber", "q", above=0)
_DENSITY = Quantity("Pa^2 m^2", "power spectral density of the stress", "C", at_least=0)
Wavenumbers = Annotated[tuple[Annotated[float, _WAVENUMBER], ...], at_once(_WAVENUMBER)]
Densities = Annotated[tuple[Annotated[float, _DENSITY], ...], at_once(_DENSITY)]
_WHERE = "4π² in the integral, <τ1²> = ∫ d²q C / 4π², or in the density, <τ1²> = ∫ d²q C (Persson)"
_Normalization = Annotated[Literal["in_integral", "in_density"], Field(description=_WHERE)]
#: Factor from a density to C: the 4π² stands in the integral ⟨τ1²⟩ = ∫ d²q C / 4π², or already in the density.
NORMALIZATIONS = {"in_integral": 1.0, "in_density": 4 * math.pi**2}


class FromFile(Rowed, Protocol):
    """Base of spectra whose rows may be read from a file."""

    wavenumbers: Wavenumbers
    densities: Densities

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse rows that are no spectrum."""
        rows, falls = (len(self.wavenumbers), len(self.densities)), np.flatnonzero(np.diff(self.wavenumbers) <= 0.0)
        if rows[0] != rows[1] or rows[0] < 2:
            said = "a spectrum needs at least two rows and as many densities as wavenumbers"
            raise PydanticCustomError("table_too_short", f"{said}, not {rows[0]} and {rows[1]}")
        if len(falls):
            said = f"the wavenumbers must increase from row to row, but row {falls[0] + 2} does not exceed the one"
            raise PydanticCustomError("table_not_increasing", f"{said} before; sort the rows and merge equal ones")
        if not any(self.densities):
            raise PydanticCustomError("table_empty", "every density is zero; give a row with a positive one", {})
        return self


def by_name(values: Any, names: tuple[str, ...]) -> Any:
    """Arguments of a direct construction as a dictionary, as in a scenario, arrays as lists."""
    if isinstance(values, ArgsKwargs):
        if len(values.args) > len(names):
            raise TypeError(f"at most {len(names)} positional arguments: {', '.join(names)}")
        values = dict(zip(names, values.args, strict=False)) | dict(values.kwargs or {})
    if not isinstance(values, dict):
        return values
    return {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in values.items()}


@dataclass(frozen=True, config={"extra": "forbid"})
class Tabulated(FromFile):
    """A radial density given by rows: power laws between them, zero outside.

    Parameters
    ----------
    wavenumbers : tuple of float
        q [rad/m], increasing.
    densities : tuple of float
        Density at each q [Pa² m²]; next to a zero the interpolation is linear.
    normalization : {"in_integral", "in_density"}
        Where the 4π² stands. "in_integral": the densities are C, and ``<τ1²> = ∫ d²q C / 4π²``. "in_density":
        they are C / 4π², as in Persson's papers, and ``<τ1²> = ∫ d²q`` of them.
    file : str
        In a scenario instead of the rows: a CSV with the columns ``q [rad/m], C [Pa^2 m^2]``. It is
        not read if the rows are given too.

    Examples
    --------
    Two rows of equal density are a band:

    >>> table = Tabulated((1e5, 3e5), (2.0, 2.0))
    >>> print(f"{table.variance:.6e} {2.0 * (9e10 - 1e10) / (4 * np.pi):.6e}")
    1.273240e+10 1.273240e+10
    """

    wavenumbers: Wavenumbers
    densities: Densities
    normalization: _Normalization = "in_integral"
    file: Annotated[str, Field(description="CSV with the columns q [rad/m], C [Pa^2 m^2], in place of the rows")] = ""
    model: Literal["tabulated"] = "tabulated"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        values = by_name(values, ("wavenumbers", "densities", "normalization", "file"))
        if not isinstance(values, dict) or "wavenumbers" in values or "densities" in values:
            return values
        name = values.get("file")
        if not name or not isinstance(name, str):
            raise PydanticCustomError("no_table", 'needs file = "psd.csv" with the columns q [rad/m], C [Pa^2 m^2]', {})
        table = file_columns(name, info.context, {"q": _WAVENUMBER, "C": _DENSITY})
        return {**values, "wavenumbers": table["q"], "densities": table["C"]}

    @functools.cached_property
    def rows(self) -> PowerLaws:
        """The table as a chain of power laws, with the 4π² in the integral."""
        density = NORMALIZATIONS[self.normalization] * np.array(self.densities)
        return PowerLaws(np.array(self.wavenumbers), density)
