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
_HEIGHTS = 'it is a spectrum of heights; a stress is needed, whose density over the plane is in "Pa^2 m^2"'
_LINE = 'it is the spectrum of a line; give that of the plane, whose density is in "Pa^2 m^2"'
_MISTAKEN = (("m^4", _HEIGHTS), ("m^3", _HEIGHTS), ("m^2", _HEIGHTS), ("Pa^2 m", _LINE))
_DENSITY = Quantity("Pa^2 m^2", "power spectral density of the stress", "C", at_least=0, mistaken=_MISTAKEN)
_RMS = Quantity("Pa", "root mean square of the shear stress", "σ", above=0)
Wavenumbers = Annotated[tuple[Annotated[float, _WAVENUMBER], ...], at_once(_WAVENUMBER)]
Densities = Annotated[tuple[Annotated[float, _DENSITY], ...], at_once(_DENSITY)]
Rescaled = Annotated[float, _RMS]
_WHERE = "4π² in the integral, <τ1²> = ∫ d²q C / 4π², or in the density, <τ1²> = ∫ d²q C (Persson)"
_Normalization = Annotated[Literal["in_integral", "in_density"], Field(description=_WHERE)]
#: Factor from a density to C: the 4π² stands in the integral ⟨τ1²⟩ = ∫ d²q C / 4π², or already in the density.
NORMALIZATIONS = {"in_integral": 1.0, "in_density": 4 * math.pi**2}
#: How near 2π the ratio of two rms is taken for that of the normalizations.
_NEAR = 0.05
#: Exponent of q below which a table is flat at its first row, and the part of the mean energy that matters.
_FLAT, _PART = 0.5, 0.01


_COLUMNS = {"q": _WAVENUMBER, "C": _DENSITY}


class FromFile(Rowed, Protocol):
    """Base of spectra whose rows may be read from a file."""

    wavenumbers: Wavenumbers
    densities: Densities
    rms: Rescaled | None

    @model_validator(mode="after")
    def _check(self) -> Self:
        """Refuse rows that are no spectrum."""
        rows, steps = (len(self.wavenumbers), len(self.densities)), np.diff(self.wavenumbers)
        falls = np.flatnonzero((-steps if self._falling else steps) <= 0.0)
        if rows[0] != rows[1] or rows[0] < 2:
            said = "a spectrum needs at least two rows and as many densities as wavenumbers"
            raise PydanticCustomError("table_too_short", f"{said}, not {rows[0]} and {rows[1]}")
        if len(falls):
            said = f"the wavenumbers must all rise or all fall, but row {falls[0] + 2} does not go on from the one"
            raise PydanticCustomError("table_not_increasing", f"{said} before; sort the rows and merge equal ones")
        if not any(self.densities):
            raise PydanticCustomError("table_empty", "every density is zero; give a row with a positive one", {})
        return self

    @property
    def _falling(self) -> bool:
        return len(self.wavenumbers) > 1 and self.wavenumbers[0] > self.wavenumbers[-1]

    def _chain(self, factor: float = 1.0) -> PowerLaws:
        """The rows with a factor of the density as a chain of power laws."""
        order = slice(None, None, -1 if self._falling else 1)
        return PowerLaws(np.array(self.wavenumbers[order]), factor * np.array(self.densities[order]))

    def _scaled(self, found: PowerLaws) -> PowerLaws:
        """A chain at the rms that is given."""
        if self.rms is None:
            return found
        return PowerLaws(found.q, found.density * (self.rms**2 / float(found.cumulative(found.q[-1]))))


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

    wavenumbers: Wavenumbers
    densities: Densities
    normalization: _Normalization = "in_integral"
    file: Annotated[str, Field(description="CSV with the columns q [rad/m], C [Pa^2 m^2], in place of the rows")] = ""
    header: Annotated[str, Field(description="header of a file without one, as q [cycles/um], C [Pa^2 m^2]")] = ""
    rms: Rescaled | None = None
    model: Literal["tabulated"] = "tabulated"

    @model_validator(mode="before")
    @classmethod
    def _read_file(cls, values: Any, info: ValidationInfo) -> Any:
        values = by_name(values, ("wavenumbers", "densities", "normalization", "file", "header", "rms"))
        if not isinstance(values, dict) or "wavenumbers" in values or "densities" in values:
            return values
        name = values.get("file")
        if not name or not isinstance(name, str):
            raise PydanticCustomError("no_table", 'needs file = "psd.csv" with the columns q [rad/m], C [Pa^2 m^2]', {})
        header = values.get("header", "")
        table = file_columns(name, info.context, _COLUMNS, header if isinstance(header, str) else "")
        return {**values, "wavenumbers": table["q"], "densities": table["C"]}

    @model_validator(mode="after")
    def _no_gaps(self) -> Self:
        """Refuse zeros between positive rows, which are empty bins and no density."""
        full = np.flatnonzero(self.densities)
        gaps = np.setdiff1d(np.arange(full[0], full[-1]), full) if full.size else full
        if gaps.size:
            said = (
                f"row {gaps[0] + 1} is zero between positive ones, as an empty bin of an average is: its energy would"
            )
            raise PydanticCustomError("table_gaps", f"{said} be lost; leave such rows out")
        return self

    @functools.cached_property
    def rows(self) -> PowerLaws:
        """The table as a chain of power laws, with the 4π² in the integral."""
        return self._scaled(self._chain(NORMALIZATIONS[self.normalization]))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is to be known of the normalization and of the first row."""
        return self._normalized() + self._cut_plateau()

    def _normalized(self) -> tuple[str, ...]:
        """What the other normalization would make of the table."""
        own = {where: self._chain(factor) for where, factor in NORMALIZATIONS.items()}
        rms = {where: math.sqrt(float(chain.cumulative(chain.q[-1]))) for where, chain in own.items()}
        other = next(where for where in NORMALIZATIONS if where != self.normalization)
        words = {"in_integral": "in the integral", "in_density": "in the density"}
        if self.rms is not None and abs(math.log(self.rms / rms[other])) < _NEAR:
            said = f"the table has the rms of {self.rms:.3g} Pa with the 4π² {words[other]}, to which it is scaled:"
            return (f'{said} normalization = "{other}" may be meant',)
        if self.rms is None and self.file:
            said = f"the table is read with the 4π² {words[self.normalization]}, rms {rms[self.normalization]:.3g} Pa;"
            said += f" {words[other]} it would be {rms[other]:.3g} Pa, and the energy 39.5 times as"
            more = "large" if rms[other] > rms[self.normalization] else "small"
            return (f"{said} {more}: shear.spectrum.normalization chooses, rms fixes it",)
        return ()

    def _cut_plateau(self) -> tuple[str, ...]:
        """What a density that is flat at its first row leaves out by ending there; the mean energy goes as ∫ C dq."""
        (q, *_), (density, *_) = self.rows.q, self.rows.density
        flat = density > 0.0 and abs(math.log(self.rows.density[1] / density)) < _FLAT * math.log(self.rows.q[1] / q)
        if not (flat and self.file) or q * density < _PART * self.rows.line_integral:
            return ()
        more, kept = q * density / self.rows.line_integral, ""
        if self.rms is not None:  # the plateau takes its part of the variance from the rest
            more = (1.0 + more) / (1.0 + density * q**2 / (4.0 * math.pi * self.rms**2)) - 1.0
            kept = ", the rms kept"
        said = f"the table is flat at its first row and zero before: below {q:.3g} rad/m a plateau down to 0 would add"
        return (f"{said} {more:.0%} to the mean energy{kept}; add a row where it ends",)
