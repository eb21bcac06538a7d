"""Shear-stress fluctuations and the elastic energy they store. Simple to full: uniform, mean, banded, modal, mapped.

A model is a frozen recipe; with the solid and the cell it becomes a *process* with ``start`` and
``advance``. The contact reads of it one number a step, the stored energy per area ΔΓ. A measured map can be the field
itself.
"""

import functools
import math
from dataclasses import astuple, fields, replace
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
import scipy
from pydantic import Discriminator, Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import noise_energy
from sim.numerics import disk_cache, jit
from sim.parts.exchange import Setting
from sim.parts.shear.bands import BandedProcess, Bands, cell_pairs, group
from sim.parts.shear.maps import CarriedProcess, DiscShares, Passing
from sim.parts.shear.modes import (
    ModalProcess,
    SiteMean,
    SiteModes,
    cell_variance,
    modes,
    relative_error,
)
from sim.parts.shear.process import Amplitude, Constant, Correlation, SmoothProcess
from sim.solid import ElasticSolid
from sim.spectrum.families import Ripple, Spectrum
from sim.spectrum.family import Family
from sim.spectrum.measured import Measured, StressMap
from sim.spectrum.radial import Margin, marginal_energy
from sim.units.quantity import Quantity, keyed, tagged

Paid = Annotated[
    float,
    Quantity(
        "1",
        "share of the fluctuation energy paid by adhesion",
        "chi",
        at_least=0,
        at_most=1,
    ),
]
_Cell = Annotated[float, Quantity("m", "side of the periodic cell", "L", above=0)]
_Tolerance = Annotated[
    float, Quantity("1", "tolerance of the errors of banding", "", above=0, below=1)
]
Contact = Annotated[
    Literal["plane", "disc"],
    Field(
        description='"disc": energy per new area of a finite contact, instead of that of the plane'
    ),
]
_Points = Annotated[
    int,
    Quantity(
        "1",
        "grid points along a side of the cell",
        at_least=2,
        at_most=2**14,
        whole=True,
    ),
]

#: Mode pairs of a cell beyond which neither time nor memory suffices: those of a grid of 2048 × 2048.
_MOST_PAIRS = 2**21
_MOST_WAVES = 1e9
#: Amplitudes that a drive can follow in its own loop: they depend on the sliding alone.
_FOLLOWED = "constant", "slip_rate"

Process = SmoothProcess | BandedProcess | ModalProcess

#: Points of a sweep that differ elsewhere share it with its spline.
_margin = functools.lru_cache(maxsize=32)(Margin)


class ShearModel:
    """Attributes of all shear models."""

    #: True if each member has fluctuations of its own.
    is_random: ClassVar[bool] = False
    #: True if the process has a list of its modes.
    keeps_modes: ClassVar[bool] = False
    #: True if all members and seeds have one measured pattern.
    measured: ClassVar[bool] = False
    #: True if a drive that solves its motion can draw the energy that the contact reads in its own loop.
    in_blocks: ClassVar[bool] = False
    #: Correlation length of the field [m]; nan if its modes have none in common.
    _memory: ClassVar[float] = math.nan
    #: Rough time that one step of a mode pair takes on one core, for estimates [s].
    pair_seconds: ClassVar[float] = 10e-9
    spectrum: Spectrum
    amplitude: Amplitude
    paid_by_adhesion: float
    contact: str
    #: Relative error of the energy on a disc that needs no remark.
    tolerance: float = 0.01

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        law = self.amplitude
        if self.spectrum.bond_made and law.model != "constant":
            raise PydanticCustomError(
                "bond_made",
                "the bonds set the amplitude of their field; omit amplitude",
            )
        if (
            law.model == "slip_rate"
            and law.memory_length is None
            and math.isnan(self._memory)
        ):
            message = 'slip_rate needs a memory distance: give memory_length, or shear.correlation.model = "slip"'
            raise PydanticCustomError("no_memory", message)
        return self

    @property
    def law(self) -> Amplitude:
        """The law of the amplitude in this field."""
        return self.amplitude.within(self._memory)

    @property
    def passes(self) -> bool:
        """True if the energy on a disc depends on the position of the slider, so that a step needs the one before."""
        return self.measured and self.contact == "disc"

    @property
    def stays(self) -> bool:
        """True if fluctuations never change the contact: they take no energy of it, or always the same."""
        if self.paid_by_adhesion == 0.0:
            return True
        changes = self.amplitude.model != "constant" or self.spectrum.bond_made
        return not (self.is_random or changes or self.contact == "disc")

    @property
    def random_variance(self) -> float:
        """Variance of fluctuations that each member has of its own [Pa²]."""
        return self.spectrum.variance if self.is_random else 0.0

    def side(self, cell: float) -> float:
        """Return the side of the periodic cell [m], by default ``cell``; infinite without a cell."""
        return math.inf

    def chosen(self, maps: bool) -> Self:
        """Return this model, for a scene with or without recorded ``maps``."""
        return self

    def why(self, maps: bool) -> str:
        """Return the reason for the choice, in words; empty without a choice."""
        return ""

    def process(self, solid: ElasticSolid, cell: float) -> Process:
        """Return the process on a solid, by default with a ``cell`` of this side [m]."""
        raise NotImplementedError

    def faults(self, solid: ElasticSolid, rest_radius: float) -> list[tuple[str, str]]:
        """Return reasons why the process cannot be built on a solid and a contact at rest, each as (key, words)."""
        return []

    def margin(
        self, solid: ElasticSolid, sphere_radius: float, widest: float
    ) -> Margin | Passing:
        """Return the share of ΔΓ that a contact of up to the ``widest`` radius [m] pays on a solid."""
        return _margin(self.spectrum, solid.unit.softness, sphere_radius)

    def off_the_map(
        self, positions: tuple[float, float], radius: float
    ) -> list[tuple[str, str]]:
        """Return reasons why a contact of a radius [m] cannot slide between two positions [m], as (key, words)."""
        return []

    def details(self, setting: Setting) -> list[tuple[str, str]]:
        """Return properties of a measured pattern, each as (name, words)."""
        return []

    @property
    def mapped(self) -> tuple[str, float, str]:
        """Key, largest stress [Pa] and statistics in words of a measured map at its own scale; nan without one."""
        size = self.spectrum.rms_of_map
        return "spectrum", size, f"rms {size:.3g} Pa"

    def remarks(self, setting: Setting) -> list[str]:
        spectrum, radius, solid = self.spectrum, setting.rest_radius, setting.solid
        plane, rms = solid.stored_energy(spectrum), math.sqrt(spectrum.variance)
        if not plane > 0.0:
            return []
        remarks = list(spectrum.remarks)
        if self.paid_by_adhesion > 0.0:
            remarks.append(
                "adhesion pays for the stored energy: the paper's assumption (shear.paid_by_adhesion)"
            )
            if spectrum.bond_made:
                twice = "with paid_by_adhesion the energy counts twice"
                remarks.append(
                    f"friction already supplies the energy under each bond: {twice}"
                )
        longest, side = (
            2.0 * math.pi / max(spectrum.support[0], 1e-300),
            self.side(setting.cell),
        )
        if spectrum.wavevector is None and side < longest < 1e300:
            remarks.append(
                "the spectrum has waves longer than the cell, which are omitted: give a larger shear.cell"
            )
        # the energy on a disc is not known on a layer
        if self.contact == "plane" and radius > 0.0 and not solid.inverse_thickness:
            share = float(marginal_energy(spectrum, radius, solid.softness)) / plane
            long = min(longest, side) > 2.0 * radius
            what = (
                "the longest waves exceed the contact, which"
                if long
                else "a contact of this size"
            )
            off = f"{what} stores {share:.1%} of the fluctuation energy of the plane per new area"
            if abs(share - 1.0) > self.tolerance:
                known = 'shear.contact = "disc" takes that into account'
                none = 'contact.model = "cohesive" leaves that out'
                remarks.append(f"{off}: {known if setting.takes_disc else none}")
        if not spectrum.bond_made and rms > solid.shear_modulus:
            times = f"{rms / solid.shear_modulus:.3g} times the shear modulus"
            remarks.append(
                f"the rms of the fluctuations is {times}, beyond linear elasticity: check shear.spectrum"
            )
        return remarks


@keyed()
class Uniform(ShearModel):
    """No fluctuation: a uniform shear stress, which takes no energy from adhesion."""

    spectrum = Ripple(amplitude=0.0, wavelength=1.0)
    amplitude = Constant()
    paid_by_adhesion = 1.0
    contact = "plane"

    model: Literal["uniform"] = "uniform"

    def process(self, solid: ElasticSolid, cell: float) -> SmoothProcess:
        return SmoothProcess(0.0, Constant())


@keyed()
class Mean(ShearModel):
    """The ensemble mean of ΔΓ on the infinite plane, in closed form. Limit: uniform as rms -> 0."""

    spectrum: Spectrum
    amplitude: Amplitude = Field(default_factory=Constant)
    paid_by_adhesion: Paid = 1.0
    contact: Contact = "plane"
    model: Literal["mean"] = "mean"

    @model_validator(mode="after")
    def _no_memory(self) -> "Mean":
        if self.amplitude.relaxing:
            message = 'a relaxing amplitude needs a correlation, which "mean" lacks; use model = "modal"'
            raise PydanticCustomError("mean_has_no_memory", message)
        return self

    @property
    def in_blocks(self) -> bool:  # type: ignore[override]
        return self.amplitude.model in _FOLLOWED and not self.spectrum.bond_made

    def process(self, solid: ElasticSolid, cell: float) -> SmoothProcess:
        kind = SiteMean if self.spectrum.bond_made else SmoothProcess
        return kind(solid.stored_energy(self.spectrum), self.law)


@keyed()
class _Fluctuating(ShearModel):
    """Keys of the models with a periodic cell and a correlation.

    ``cell`` None means √π times the radius at rest, the square of the contact's area; ``points``
    None means the grid that holds the spectrum's shortest wavelength.
    """

    is_random: ClassVar[bool] = True
    #: Mode pairs that the process can list.
    most_pairs: ClassVar[float] = math.inf

    spectrum: Spectrum
    correlation: Correlation
    amplitude: Amplitude = Field(default_factory=Constant)
    cell: _Cell | None = None
    points: _Points | None = None
    paid_by_adhesion: Paid = 1.0
    contact: Contact = "plane"

    @property
    def _memory(self) -> float:  # type: ignore[override]
        return getattr(self.correlation, "length", math.nan)  # of a correlation by slip

    def side(self, cell: float) -> float:
        return cell if self.cell is None else self.cell

    def faults(self, solid: ElasticSolid, rest_radius: float) -> list[tuple[str, str]]:
        cell = self.side(math.sqrt(math.pi) * rest_radius)
        if too_many := self.too_many_modes(cell):
            return [
                (
                    "",
                    f'{too_many}; take a smaller cell, longer waves or fewer points, or model = "mean"',
                )
            ]
        try:
            self.process(solid, cell)
        except PydanticCustomError as fault:
            return [("", fault.message())]
        return []

    def too_many_modes(self, cell: float) -> str:
        """Return the reason why the grid, or the smallest that holds the spectrum, is too large; empty if it is not."""
        ripple = self.spectrum.wavevector
        waves = (
            (max(map(abs, ripple)) if ripple else self.spectrum.support[1])
            * cell
            / (2.0 * math.pi)
        )
        if math.isfinite(waves) and waves > _MOST_WAVES:
            return f"the cell of {cell:g} m holds {waves:.2g} of the shortest waves along a side"
        reach = waves if self.points is None else min(waves, (self.points - 1) // 2)
        pairs = (2.0 * reach + 1.0) * (reach + 1.0)
        if math.isfinite(reach) and pairs > self.most_pairs:
            return f"the cell of {cell:g} m has {pairs:.2g} Fourier modes; at most {_MOST_PAIRS:.2g} are possible"
        return ""


@keyed()
class Modal(_Fluctuating):
    """ΔΓ(t) from every Fourier mode of a periodic cell. Limit: mean as the cell grows."""

    model: Literal["modal"] = "modal"

    keeps_modes: ClassVar[bool] = True

    @property
    def most_pairs(self) -> float:  # type: ignore[override]
        # a wave has one pair, however large its cell is
        return math.inf if self.spectrum.wavevector else _MOST_PAIRS

    def process(self, solid: ElasticSolid, cell: float) -> ModalProcess:
        kind = SiteModes if self.spectrum.bond_made else ModalProcess
        of_cell = modes(self.spectrum, self.side(cell), self.points)
        return kind(of_cell, solid, self.correlation, self.law)


@keyed()
class Mapped(Modal):
    """The map τ1(x, y, t) on a grid, carried with the slider. Limit: the same ΔΓ as ``Modal``, number for number.

    A map costs one inverse FFT when it is recorded; ΔΓ never needs one.
    """

    model: Literal["mapped"] = "mapped"  # type: ignore[assignment]

    most_pairs: ClassVar[float] = _MOST_PAIRS

    def faults(self, solid: ElasticSolid, rest_radius: float) -> list[tuple[str, str]]:
        cell = self.side(math.sqrt(math.pi) * rest_radius)
        if self.contact == "plane" or 2.0 * rest_radius <= cell:
            return super().faults(solid, rest_radius)
        if math.isnan(rest_radius):
            fault = "there is no contact at rest, so the size of the cell is unknown"
            cure = 'move the sphere closer by a key of [contact], or give "plane"'
            return [("contact", f"{fault}; {cure}")]
        fault = f"the cell of {cell:g} m is smaller than the contact: {2.0 * rest_radius:g} m wide at rest"
        cure = f'give shear.cell = "{2.2e6 * rest_radius:.3g} um" or more'
        return [("cell", f"{fault}; {cure}")]

    def process(self, solid: ElasticSolid, cell: float) -> ModalProcess:
        process = super().process(solid, cell)
        if not process.modes.on_lattice:
            message = "a map is periodic: make the cell a whole number of wavelengths along x and along y"
            raise PydanticCustomError("off_lattice", message)
        return process


@keyed()
class Banded(_Fluctuating):
    """ΔΓ(t) of a periodic cell with its modes grouped into bands, every error known before the run. Limit: modal.

    ``tolerance`` bounds the errors of banding relative to the sum over the modes of the cell. These are relative errors
    of the third and fourth cumulant and of the integral correlation time, and the largest difference of the
    autocorrelation. With a relaxing amplitude, the error of the mean is included. Mean and variance of the stationary
    field are exact.
    """

    pair_seconds: ClassVar[float] = 80e-9

    tolerance: _Tolerance = 0.01
    model: Literal["banded"] = "banded"

    @property
    def in_blocks(self) -> bool:  # type: ignore[override]
        return self.amplitude.model in _FOLLOWED and not (
            self.amplitude.relaxing and self.correlation.power
        )

    @model_validator(mode="after")
    def _not_of_bonds(self) -> "Banded":
        if self.spectrum.bond_made:
            message = 'the constant part of the field of bonds has no bands; use model = "mean" or "modal"'
            raise PydanticCustomError("bond_made", message)
        return self

    def process(self, solid: ElasticSolid, cell: float) -> BandedProcess:
        spectrum, size = _of_unit_size(self.spectrum)
        banding = self.correlation.power, self.tolerance, self.amplitude.relaxing
        side, points = self.side(cell), self.points
        unit, errors = _grouped(spectrum, side, points, solid.unit, banding)
        bands = replace(unit, weight=unit.weight * (size / solid.shear_modulus))
        return BandedProcess(bands, errors, self.correlation, self.law)


def _of_unit_size(spectrum: Family) -> tuple[Family, float]:
    """Return the spectrum at an rms of 1 Pa and the factor of its density, or itself and 1 if no key sets its rms."""
    keys = {item.name for item in fields(spectrum)}  # type: ignore[arg-type]
    if "rms" not in keys:
        return spectrum, 1.0
    return replace(spectrum, rms=1.0), spectrum.variance  # type: ignore[type-var]


# as many as a sweep has points, each a few kilobytes
@functools.lru_cache(maxsize=20_000)
def _grouped(
    spectrum: Family,
    cell: float,
    points: int | None,
    solid: ElasticSolid,
    banding: tuple[int, float, bool],
) -> tuple[Bands, dict[str, float]]:
    """Return ``_grouped_anew``, from the disk if an earlier run has grouped the same modes."""
    cell_of = cell, points, solid, banding
    key = jit.machine(), scipy.__version__, astuple(spectrum), cell_of  # type: ignore[call-overload]
    return disk_cache.cached(key, lambda: _grouped_anew(spectrum, *cell_of))


def _grouped_anew(
    spectrum: Family,
    cell: float,
    points: int | None,
    solid: ElasticSolid,
    banding: tuple[int, float, bool],
) -> tuple[Bands, dict[str, float]]:
    """Return the bands of a cell, and the errors of the cell against the infinite plane.

    ``banding`` are the last arguments of ``group``: power of the rates, tolerance, True if the amplitude relaxes.
    """
    pairs = cell_pairs(spectrum, cell, points, solid)
    energy = float(np.sum(pairs.count * pairs.weight))
    spread = math.sqrt(float(np.sum(pairs.count * pairs.weight**2)))
    variance = cell_variance(spectrum, cell, points)
    errors = {
        "cell_error_variance": relative_error(variance, spectrum.variance),
        "cell_error_energy": relative_error(energy, solid.stored_energy(spectrum)),
        "member_spread_energy": spread / energy if energy else 0.0,
        "mode_pairs": float(np.sum(pairs.count)),
    }
    return group(pairs, *banding), errors


@keyed()
class Auto(_Fluctuating):
    """The simplest model that gives what the scene records; it takes the keys of all of them."""

    correlation: Correlation | None = None  # type: ignore[assignment]
    tolerance: _Tolerance = 0.01
    model: Literal["auto"] = "auto"

    def chosen(self, maps: bool) -> "Mean | Banded | Modal":  # type: ignore[override]
        """Return the model for a scene with or without recorded ``maps``.

        Raises
        ------
        PydanticCustomError
            If maps are recorded and no correlation is given.
        """
        if self.correlation is None and maps:
            raise PydanticCustomError(
                "maps_need_memory", "maps change in time: give shear.correlation"
            )
        fitting = Modal if self.spectrum.bond_made else Banded
        kind: type[Mean | Banded | Modal] = Mapped if maps else fitting
        kind = Mean if self.correlation is None else kind
        return kind(
            **{
                key.name: getattr(self, key.name)
                for key in fields(kind)
                if key.name != "model"
            }
        )

    def why(self, maps: bool) -> str:
        """Return the reason for the choice, in words."""
        if self.correlation is None:
            return (
                "no correlation is given, so the ensemble mean is exact, without noise"
            )
        if maps:
            return "maps are recorded"
        if self.spectrum.bond_made:
            return (
                "the field of the bonds has a constant part, so each mode is computed"
            )
        return "a correlation is given and no maps are recorded, so the energy over time is sufficient"


#: Radius up to which energies on discs are found, over the largest of the contact without fluctuations.
_BEYOND = 1.25
_passing = functools.lru_cache(maxsize=8)(
    lambda *numbers: Passing(DiscShares(*numbers), np.zeros(1))
)


@keyed()
class Carried(ShearModel):
    """A measured map of the stress itself, carried with the slider. Limit: ``Mapped`` without decay of its correlation.

    It is the same for all members and seeds. On the plane it is periodic; with ``contact = "disc"`` it passes under
    the sphere, without an end that meets its beginning.
    """

    measured: ClassVar[bool] = True

    field: StressMap
    amplitude: Amplitude = Field(default_factory=Constant)
    paid_by_adhesion: Paid = 1.0
    contact: Contact = "plane"
    model: Literal["mapped"] = "mapped"

    @model_validator(mode="after")
    def _goes_with_the_contact(self) -> "Carried":
        if self.amplitude.relaxing:
            raise PydanticCustomError(
                "never_renewed", "a measured map does not change: give relaxing = false"
            )
        if self.contact == "disc" and (
            self.field.window != "none" or not self.field.square
        ):
            message = 'a disc needs square pixels and no window; interpolate the map, or take contact = "plane"'
            raise PydanticCustomError("disc_of_map", message)
        if self.contact == "plane" and self.field.start is not None:
            message = 'start is the first position of a disc: give contact = "disc", or omit start'
            raise PydanticCustomError("disc_of_map", message)
        return self

    @property
    def spectrum(self) -> Measured:  # type: ignore[override]
        """The radially averaged spectrum of the map."""
        return self.field.spectrum

    def process(self, solid: ElasticSolid, cell: float) -> CarriedProcess:
        energy = solid.stored_energy(self.field)
        return CarriedProcess(energy, self.law, self.field, self.passes)

    def margin(
        self, solid: ElasticSolid, sphere_radius: float, widest: float
    ) -> Passing:
        shorter = 0.5 * min(self.field.lattice.sides)
        return _passing(
            self.field, solid.unit, min(_BEYOND * widest or 0.5 * shorter, shorter)
        )

    def off_the_map(
        self, positions: tuple[float, float], radius: float
    ) -> list[tuple[str, str]]:
        (low, high), (length, width), begin = (
            positions,
            self.field.lattice.sides,
            self.field.begin,
        )
        if 2.0 * radius > width:
            return [
                (
                    "",
                    f"the map is {width:g} m wide, the contact up to {2.0 * radius:g} m; give a wider map",
                )
            ]
        first, last = radius + high, length - radius + low
        if first <= begin <= last:
            return []
        message = f"the contact, {2.0 * radius:g} m wide, slides beyond the end of the map, which is {length:g} m long"
        if first <= last:
            return [
                (
                    "",
                    f'{message}; begin elsewhere: start = "{0.5e6 * (first + last):.4g} um"',
                )
            ]
        return [
            (
                "",
                f"{message}; shorten the slip to {max(length - 2.0 * radius, 0.0):.3g} m, or give a longer map",
            )
        ]

    @property
    def mapped(self) -> tuple[str, float, str]:
        mean, rms = self.field.mean, self.field.rms
        size = max(abs(mean), rms)
        return "field", size, f"mean {mean:.3g} Pa, rms {rms:.3g} Pa"

    def details(self, setting: Setting) -> list[tuple[str, str]]:
        field, solid = self.field, setting.solid
        energy = solid.stored_energy(field)
        radial = solid.stored_energy(field.spectrum)
        (nx, ny), (along, across) = field.shape, field.pixels
        size = f"{nx} × {ny} points of {along:.4g} m × {across:.4g} m along and across the sliding"
        less = f"{100.0 * abs(energy / radial - 1.0):.2g} % {'more' if energy > radial else 'less'}"
        mean = f"{field.mean:.4g} Pa, not part of the field; bonds at rest: {setting.strength:.4g} Pa"
        rows = [
            ("rms of the stress", f"{field.rms:.4g} Pa at amplitude 1"),
            ("map", size),
            ("mean of the map", mean),
        ]
        stored = f"{energy:.4g} J/m^2 at amplitude 1 of the map itself, {less} than that of its radial spectrum"
        rows.append(("stored energy", stored))
        if field.mask:
            rows.append(("inside of the contact", f"{field.inside:.1%} of the map"))
        if field.noise:
            pixel = math.sqrt(field.lattice.pixel)
            of_solid = solid.shear_modulus, solid.held_ratio
            noise = noise_energy(field.noise, pixel, *of_solid)
            rows.append(
                (
                    "noise of the map",
                    f"seems to store {noise:.3g} J/m^2, {noise / energy:.1%} of that energy",
                )
            )
        return rows


#: A model that has a process.
Model = Uniform | Mean | Banded | Modal | Mapped | Carried

Shear = Annotated[
    Annotated[Uniform, Tag("uniform")]
    | Annotated[Mean, Tag("mean")]
    | Annotated[Banded, Tag("banded")]
    | Annotated[Modal, Tag("modal")]
    | Annotated[Mapped, Tag("mapped")]
    | Annotated[Carried, Tag("mapped[field]")]
    | Annotated[Auto, Tag("auto")],
    Discriminator(tagged("mapped", "field")),
]
