"""Shear-stress fluctuations and the elastic energy they store. Shallow to deep: uniform, mean, modal, mapped.

A depth is a frozen recipe; with the solid and the cell it becomes a *process* with ``start`` and
``advance``. All the contact ever feels of it is one number a step, the stored energy per area ΔΓ.
"""

import functools
import math
from dataclasses import fields, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.parts.shear.amplitude import Amplitude, Constant
from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.bands import Bands, group
from sim.parts.shear.bond_field import MappedSiteModes, SiteMean, SiteModes
from sim.parts.shear.correlation import Correlation
from sim.parts.shear.modal import FixedProcess, MappedFixedProcess, MappedProcess, ModalProcess
from sim.parts.shear.mode_pairs import cell_pairs
from sim.parts.shear.modes import cell_variance, modes
from sim.parts.shear.process import SmoothProcess
from sim.spectrum.families import Spectrum
from sim.spectrum.family import Family
from sim.units.quantity import Quantity

_Paid = Annotated[
    float, Quantity("1", "share of the fluctuation energy paid by adhesion", "chi", at_least=0, at_most=1)
]
_Cell = Annotated[float, Quantity("m", "side of the periodic cell", "L", above=0)]
_Tolerance = Annotated[float, Quantity("1", "tolerance of the errors of banding", "", above=0, below=1)]
_Contact = Annotated[
    Literal["plane", "disc"],
    Field(description='"disc": the energy that a contact of finite size pays when it grows, instead of the plane\'s'),
]
_ModeAmplitudes = Annotated[
    Literal["gaussian", "fixed"], Field(description='"fixed": modes keep their modulus, so that the energy is constant')
]
_Points = Annotated[int, Quantity("1", "grid points along a side of the cell", at_least=2, at_most=2**14, whole=True)]


@dataclass(frozen=True, config={"extra": "forbid"})
class Uniform:
    """No fluctuation: a uniform shear stress, which stores nothing at the expense of adhesion."""

    per_member: ClassVar[bool] = False
    draws_maps: ClassVar[bool] = False
    reads_stress: ClassVar[bool] = False
    paid_by_adhesion: ClassVar[float] = 1.0

    model: Literal["uniform"] = "uniform"

    def process(self, shear_modulus: float, poisson_ratio: float, cell: float) -> SmoothProcess:
        """The process on a given solid and cell."""
        return SmoothProcess(0.0, Constant())


def _bonds_set_the_size(part: Any) -> None:
    """Refuse what a field that bonds make cannot follow."""
    if not part.spectrum.bond_made:
        return
    if not isinstance(part.amplitude, Constant):
        raise PydanticCustomError("bond_made", "the bonds set the size of the field they make; leave amplitude out")
    if getattr(part, "mode_amplitudes", "gaussian") == "fixed":
        raise PydanticCustomError("bond_made", 'bonds at random places make mode_amplitudes = "gaussian"; leave it out')


@dataclass(frozen=True, config={"extra": "forbid"})
class Mean:
    """The ensemble mean of ΔΓ on the infinite plane, in closed form. Limit: uniform as rms -> 0."""

    per_member: ClassVar[bool] = False
    draws_maps: ClassVar[bool] = False

    spectrum: Spectrum
    amplitude: Amplitude = Field(default_factory=Constant)
    paid_by_adhesion: _Paid = 1.0
    contact: _Contact = "plane"
    model: Literal["mean"] = "mean"

    @property
    def reads_stress(self) -> bool:
        """Whether the size of the field follows the bonds."""
        return self.amplitude.reads_stress or self.spectrum.bond_made

    @model_validator(mode="after")
    def _no_memory(self) -> "Mean":
        if self.amplitude.relaxing:
            raise PydanticCustomError(
                "mean_has_no_memory",
                'amplitude that relaxes needs a correlation, which "mean" has not; use model = "modal"',
            )
        _bonds_set_the_size(self)
        return self

    def process(self, shear_modulus: float, poisson_ratio: float, cell: float) -> SmoothProcess:
        kind = SiteMean if self.spectrum.bond_made else SmoothProcess
        return kind(float(self.spectrum.surface_energy(shear_modulus, poisson_ratio)), self.amplitude)


@dataclass(frozen=True, config={"extra": "forbid"})
class _Fluctuating:
    """What every depth with a periodic cell and a correlation is given.

    ``cell`` None means √π times the radius at rest, the square of the contact's area; ``points``
    None means the grid that holds the spectrum's shortest wavelength.
    """

    draws_maps: ClassVar[bool] = False

    spectrum: Spectrum
    correlation: Correlation
    amplitude: Amplitude = Field(default_factory=Constant)
    cell: _Cell | None = None
    points: _Points | None = None
    mode_amplitudes: _ModeAmplitudes = "gaussian"
    paid_by_adhesion: _Paid = 1.0
    contact: _Contact = "plane"

    @property
    def per_member(self) -> bool:
        """Whether ΔΓ differs between members: with fixed mode_amplitudes it does not."""
        return self.mode_amplitudes == "gaussian"

    @property
    def reads_stress(self) -> bool:
        """Whether the size of the field follows the bonds."""
        return self.amplitude.reads_stress or self.spectrum.bond_made

    @model_validator(mode="after")
    def _fixed_cannot_relax(self) -> "_Fluctuating":
        if self.mode_amplitudes == "fixed" and self.amplitude.relaxing:
            raise PydanticCustomError(
                "fixed_cannot_relax",
                'fixed mode_amplitudes are never renewed; use mode_amplitudes = "gaussian" or relaxing = false',
            )
        _bonds_set_the_size(self)
        return self


@dataclass(frozen=True, config={"extra": "forbid"})
class Modal(_Fluctuating):
    """ΔΓ(t) from every Fourier mode of a periodic cell. Limit: mean as the cell grows."""

    model: Literal["modal"] = "modal"

    def process(self, shear_modulus: float, poisson_ratio: float, cell: float) -> ModalProcess:
        kind = SiteModes if self.spectrum.bond_made else ModalProcess
        return self._process(kind, FixedProcess, shear_modulus, poisson_ratio, cell)

    def _process(self, gaussian: Any, fixed: Any, shear_modulus: float, poisson_ratio: float, cell: float) -> Any:
        side = cell if self.cell is None else self.cell
        kind = fixed if self.mode_amplitudes == "fixed" else gaussian
        return kind(
            modes(self.spectrum, side, self.points),
            shear_modulus,
            poisson_ratio,
            float(self.spectrum.surface_energy(shear_modulus, poisson_ratio)),
            float(self.spectrum.variance),
            self.correlation,
            self.amplitude,
        )


@dataclass(frozen=True, config={"extra": "forbid"})
class Mapped(Modal):
    """The map τ1(x, y, t) on a grid, carried with the slider. Limit: the same ΔΓ as ``Modal``, number for number.

    A map costs one inverse FFT when it is recorded; ΔΓ never needs one.
    """

    model: Literal["mapped"] = "mapped"  # type: ignore[assignment]

    draws_maps: ClassVar[bool] = True

    def process(self, shear_modulus: float, poisson_ratio: float, cell: float) -> MappedProcess:
        kind = MappedSiteModes if self.spectrum.bond_made else MappedProcess
        process = self._process(kind, MappedFixedProcess, shear_modulus, poisson_ratio, cell)
        if not process.modes.on_lattice:
            raise PydanticCustomError(
                "off_lattice",
                "a map is periodic: make the cell a whole number of wavelengths along x and along y",
            )
        return process


@dataclass(frozen=True, config={"extra": "forbid"})
class Banded(_Fluctuating):
    """ΔΓ(t) of a periodic cell with its modes grouped into bands, every error known beforehand. Limit: modal.

    ``tolerance`` bounds what banding adds to the cell's own sum over modes: relative errors of the
    third and fourth cumulant and of the integral correlation time, and the largest difference of the
    autocorrelation; under amplitude that relaxes also the error of the mean while it does. Mean and
    variance of the stationary field are exact.
    """

    tolerance: _Tolerance = 0.01
    model: Literal["banded"] = "banded"

    @model_validator(mode="after")
    def _not_of_bonds(self) -> "Banded":
        if self.spectrum.bond_made:
            raise PydanticCustomError(
                "bond_made", 'the frozen part of a field that bonds make has no bands; use model = "mean" or "modal"'
            )
        return self

    def process(self, shear_modulus: float, poisson_ratio: float, cell: float) -> BandedProcess | SmoothProcess:
        side = cell if self.cell is None else self.cell
        spectrum, size = _of_unit_size(self.spectrum)
        power, relaxing = self.correlation.power, self.amplitude.relaxing
        unit, errors = _grouped(spectrum, side, self.points, poisson_ratio, power, self.tolerance, relaxing)
        bands = replace(unit, weight=unit.weight * (size / shear_modulus))
        if self.mode_amplitudes == "fixed":
            return SmoothProcess(bands.mean, self.amplitude)
        return BandedProcess(bands, errors, self.correlation, self.amplitude)


def _of_unit_size(spectrum: Family) -> tuple[Family, float]:
    """The spectrum at an rms of 1 Pa with the factor of its density; as it is with 1 where no key sets its rms."""
    keys = {item.name for item in fields(spectrum)}  # type: ignore[arg-type]
    return (replace(spectrum, rms=1.0), spectrum.variance) if "rms" in keys else (spectrum, 1.0)  # type: ignore[type-var]


@functools.lru_cache(maxsize=20_000)  # as many as a sweep has points, each a few kilobytes
def _grouped(
    spectrum: Family, cell: float, points: int | None, poisson_ratio: float,
    power: int, tolerance: float, relaxing: bool,
) -> tuple[Bands, dict[str, float]]:  # fmt: skip
    """The bands of a cell at a shear modulus of 1 Pa, and the cell's own errors against the infinite plane."""
    pairs = cell_pairs(spectrum, cell, points, 1.0, poisson_ratio)
    energy = float(np.sum(pairs.count * pairs.weight))
    infinite = float(spectrum.surface_energy(1.0, poisson_ratio))
    spread = math.sqrt(float(np.sum(pairs.count * pairs.weight**2)))
    variance = spectrum.variance
    errors = {
        "cell_error_variance": cell_variance(spectrum, cell, points) / variance - 1.0 if variance else 0.0,
        "cell_error_energy": energy / infinite - 1.0 if infinite else 0.0,
        "member_spread_energy": spread / energy if energy else 0.0,
        "mode_pairs": float(np.sum(pairs.count)),
    }
    return group(pairs, power, tolerance, relaxing), errors


@dataclass(frozen=True, config={"extra": "forbid"})
class Auto:
    """The shallowest depth that gives what the scene records; it takes the keys of all of them."""

    spectrum: Spectrum
    correlation: Correlation | None = None
    amplitude: Amplitude = Field(default_factory=Constant)
    cell: _Cell | None = None
    points: _Points | None = None
    mode_amplitudes: _ModeAmplitudes = "gaussian"
    tolerance: _Tolerance = 0.01
    paid_by_adhesion: _Paid = 1.0
    contact: _Contact = "plane"
    model: Literal["auto"] = "auto"

    def chosen(self, maps: bool) -> "Mean | Banded | Modal":
        """The depth for a scene that records ``maps`` or does not.

        Raises
        ------
        PydanticCustomError
            If maps are recorded and no correlation is given.
        """
        common: dict[str, Any] = {
            "spectrum": self.spectrum,
            "amplitude": self.amplitude,
            "paid_by_adhesion": self.paid_by_adhesion,
            "contact": self.contact,
        }
        if self.correlation is None and maps:
            raise PydanticCustomError("maps_need_memory", "maps change in time: give shear.correlation")
        if self.correlation is None:
            return Mean(**common)
        common |= {
            "correlation": self.correlation,
            "cell": self.cell,
            "points": self.points,
            "mode_amplitudes": self.mode_amplitudes,
        }
        if maps or self.spectrum.bond_made:
            return Mapped(**common) if maps else Modal(**common)
        return Banded(**common, tolerance=self.tolerance)

    def why(self, maps: bool) -> str:
        """The reason for the choice, in words."""
        if self.correlation is None:
            return "no correlation is given, so the ensemble mean answers, exactly and without noise"
        if maps:
            return "maps are recorded"
        if self.spectrum.bond_made:
            return "the field that bonds make has a frozen part, so each mode is followed"
        return "a correlation is given and no maps are recorded: energies in time are all the contact feels"


#: A depth, chosen.
Model = Uniform | Mean | Banded | Modal | Mapped

Shear = Annotated[Uniform | Mean | Banded | Modal | Mapped | Auto, Field(discriminator="model")]
