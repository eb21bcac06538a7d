"""A scenario: one of each part, a clock, and what must hold between them."""

import errno
import math
from collections.abc import Iterator
from dataclasses import dataclass as plain_dataclass
from dataclasses import field, fields, is_dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError

from sim.parts.bonds import Auto as AutoBonds
from sim.parts.bonds import Bonds, Unbroken
from sim.parts.bonds import Depth as BondDepth
from sim.parts.contact import Contact, Lagging
from sim.parts.contact.bodies import Adhesion, Solid, Sphere
from sim.parts.contact.control import Bodies
from sim.parts.drive import Drive, Table
from sim.parts.drive import Steady as SteadyDrive
from sim.parts.shear import Auto, Depth, Mean, Modal, Shear, Uniform
from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.modal import ModalProcess
from sim.parts.shear.process import SmoothProcess
from sim.spectrum.families import BondMade
from sim.spectrum.finite_contact import Margin
from sim.sweep import read_sweep, set_key
from sim.units.quantity import Quantity

_Duration = Annotated[float, Quantity("s", "duration of the run", "T", above=0)]
_MOST_RECORDS = 10_000_000
_STEPS_A_TRIP = 2
_MOST_STEPS = 10**9
_MOST_BYTES = 2**28
#: Mode pairs of a cell beyond which neither time nor memory suffices: those of a grid of 2048 × 2048.
_MOST_PAIRS = 2**21
_MOST_WAVES = 1e9
#: Columns that a part has read from its file, read anew where its table changes.
_FILE_COLUMNS = ("time", "speed", "wavenumbers", "densities")


@dataclass(frozen=True, config={"extra": "forbid"})
class Clock:
    """How long, in which steps, and how often a step is recorded; the first record is t = 0."""

    duration: _Duration
    step: Annotated[float, Quantity("s", "clock step", "dt", above=0)]
    record: Annotated[float, Quantity("s", "time between records", "", above=0)] | None = None

    @model_validator(mode="after")
    def _whole_multiples(self) -> "Clock":
        if self.record is not None:
            _require_multiple("record", self.record, "step", self.step)
        word = "step" if self.record is None else "record"
        _require_multiple("duration", self.duration, word, self.record or self.step)
        if self.steps > _MOST_STEPS:
            raise PydanticCustomError("clock", f"asks for more than {_MOST_STEPS:,} steps; make step longer")
        if self.records > _MOST_RECORDS:
            raise PydanticCustomError("clock", f"asks for more than {_MOST_RECORDS:,} records; give a longer record")
        return self

    @property
    def steps(self) -> int:
        """Number of clock steps."""
        return round(self.duration / self.step)

    @property
    def stride(self) -> int:
        """Clock steps from one record to the next."""
        return round((self.record or self.step) / self.step)

    @property
    def records(self) -> int:
        """Number of records, the one at t = 0 included."""
        return self.steps // self.stride + 1

    def time(self, step: int) -> float:
        """Time at the end of a step [s]; never accumulated."""
        return self.duration * (step / self.steps)

    @property
    def times(self) -> np.ndarray:
        """Times of the records, shape (records,) [s]."""
        return np.array([self.time(k * self.stride) for k in range(self.records)])


def _require_multiple(name: str, long: float, other: str, short: float) -> None:
    """Refuse a time that is no whole multiple of another."""
    ratio = long / short
    if round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * ratio:
        return
    below, above = max(math.floor(ratio), 1) * short, (math.floor(ratio) + 1) * short
    cure = f"{above:g} s" if ratio < 1.0 else f"{below:g} s or {above:g} s"
    raise PydanticCustomError(
        "clock",
        f"{name} ({long:g} s) must be a whole multiple of {other} ({short:g} s), such as {cure}",
    )


@dataclass(frozen=True, config={"extra": "forbid"})
class Ensemble:
    """Independent members of the ensemble, which share everything but their noise."""

    members: Annotated[int, Field(ge=1, le=10**7, description="members of the ensemble")] = 1


@dataclass(frozen=True, config={"extra": "forbid"})
class Record:
    """What is kept: each member or the ensemble's mean, spread and standard error; maps at given times."""

    per_member: bool = True
    maps: tuple[Annotated[float, Quantity("s", "time of a stress map", "t", at_least=0)], ...] = ()
    map_members: Annotated[int, Field(ge=1, le=10**4, description="members whose maps are kept")] = 1
    precision: Literal["float64", "float32"] = "float64"


@plain_dataclass(frozen=True)
class Source:
    """Where a scenario came from: the file's text, what was changed on top, and every file it names."""

    path: str = ""
    text: str = ""
    overrides: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)


@plain_dataclass(frozen=True)
class Files:
    """The files that a scenario names, relative to its own folder; remembers the text of each."""

    folder: Path
    texts: dict[str, str] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """Where the file is."""
        return self.folder / name

    def text(self, name: str) -> str:
        """The file's text, kept for the dataset's provenance."""
        if name not in self.texts:
            path = self.path(name)
            if path.exists() and not path.is_file():
                raise OSError(errno.EINVAL, "it is no plain file")
            if path.stat().st_size > _MOST_BYTES:
                raise OSError(errno.EFBIG, f"it is larger than {_MOST_BYTES // 2**20} MiB")
            self.texts[name] = path.read_text(encoding="utf-8")
        return self.texts[name]


@dataclass(frozen=True, config={"extra": "forbid", "arbitrary_types_allowed": True})
class Scenario:
    """One sliding contact, ready to run. Parts left out are the shallowest: at rest, unbroken bonds, uniform stress.

    Examples
    --------
    The radius at rest of a PDMS lens under 4 mN:

    >>> from sim.parts.contact import Equilibrium
    >>> scene = Scenario(
    ...     clock=Clock(duration=1.0, step=0.1),
    ...     solid=Solid(shear_modulus=1.6e6),
    ...     sphere=Sphere(radius=2e-3),
    ...     adhesion=Adhesion(work=42e-3),
    ...     contact=Equilibrium(load=4e-3),
    ... )
    >>> print(f"{1e3 * scene.rest_radius:.4f} mm")
    0.1203 mm
    """

    clock: Clock
    solid: Solid
    sphere: Sphere
    adhesion: Adhesion
    contact: Contact
    drive: Drive = Field(default_factory=SteadyDrive)
    bonds: Bonds = Field(default_factory=Unbroken)
    shear: Shear = Field(default_factory=Uniform)
    ensemble: Ensemble = Field(default_factory=Ensemble)
    record: Record = Field(default_factory=Record)
    sweep: Annotated[tuple[Any, ...], BeforeValidator(lambda sweep: read_sweep(sweep))] = ()
    name: Annotated[str, Field(max_length=200)] = "sliding contact"
    seed: Annotated[int, Field(ge=0, le=2**64 - 1, description="seed of the run")] = 0
    source: Annotated[Any, Field(exclude=True)] = Source()

    @model_validator(mode="after")
    def _across_parts(self) -> "Scenario":
        faults = [
            InitErrorDetails(type=PydanticCustomError("across", text), loc=where, input=None)
            for where, text in faults_across({name: getattr(self, name) for name in CHECKED})
        ]
        if faults:
            raise ValidationError.from_exception_data("Scenario", faults)
        return self

    @cached_property
    def rest_radius(self) -> float:
        """Contact radius with every bond of rest and no fluctuation [m]; nan without equilibrium."""
        return _rest_radius(self.solid, self.sphere, self.adhesion, self.contact)

    @cached_property
    def population(self) -> BondDepth:
        """The bonds at their depth, chosen by their number if the scenario leaves the choice."""
        if not isinstance(self.bonds, AutoBonds):
            return self.bonds
        return self.bonds.chosen(math.pi * self.rest_radius**2, _reads_forces(self.fluctuations))

    @cached_property
    def fluctuations(self) -> Depth:
        """The shear part at its depth, chosen by what is recorded if the scenario leaves the choice."""
        return self.shear.chosen(bool(self.record.maps)) if isinstance(self.shear, Auto) else self.shear

    @cached_property
    def why(self) -> dict[str, str]:
        """Reasons for the depths that the scenario left open, by part."""
        why = {}
        if isinstance(self.shear, Auto):
            why["shear"] = self.shear.why(bool(self.record.maps))
        if isinstance(self.bonds, AutoBonds):
            why["bonds"] = self.bonds.why(math.pi * self.rest_radius**2, _reads_forces(self.fluctuations))
        return why

    @cached_property
    def process(self) -> SmoothProcess | BandedProcess | ModalProcess:
        """The shear part on this solid and cell."""
        shear_modulus, poisson_ratio = self.solid.effective
        cell = math.sqrt(math.pi) * self.rest_radius
        return self.fluctuations.process(shear_modulus, poisson_ratio, cell)

    @cached_property
    def bodies(self) -> Bodies:
        """What touches."""
        return Bodies(self.sphere.radius, self.solid.contact_modulus, self.solid.effective[1])

    @cached_property
    def margin(self) -> Margin | None:
        """Share of ΔΓ that a contact of finite radius pays when it grows; None where waves are taken as short."""
        if getattr(self.fluctuations, "contact", "plane") == "plane":
            return None
        return Margin(self.fluctuations.spectrum, *self.solid.effective, self.sphere.radius)  # type: ignore[union-attr]

    def release(self) -> None:
        """Let go of the process, whose arrays may be large; it is made again when it is asked for."""
        self.__dict__.pop("process", None)

    @cached_property
    def varies(self) -> dict[str, bool]:
        """For each part whether its values differ between members: by its class, never by looking."""
        bonded = self.population.per_member
        sheared = self.fluctuations.per_member or (self.fluctuations.reads_stress and bonded)
        return {
            "drive": self.drive.per_member,
            "bonds": bonded,
            "shear": sheared,
            "contact": bonded or sheared,
        }

    def with_values(self, values: dict[str, Any]) -> "Scenario":
        """This scenario with some keys changed, ``{"contact.load": 1e-3}``, checked anew and without its sweep.

        Raises
        ------
        pydantic.ValidationError
            If a key is unknown or a value is not admissible.
        """
        document = TypeAdapter(Scenario).dump_python(self, by_alias=True, exclude={"source", "sweep"})
        for key, value in values.items():
            set_key(document, key, value)
            _forget_file(document, key)
        document["source"] = self.source
        files = Files(Path(self.source.path).parent, self.source.files)
        return TypeAdapter(Scenario).validate_python(document, context={"files": files})

    def points(self) -> list["Scenario"]:
        """The scenario at each point of its sweep, the last axis fastest; one point where there is none.

        Raises
        ------
        ValueError
            If values do not go together, or points would not fit into one dataset.
        """
        values: list[dict[str, Any]] = [{}]
        for axis in self.sweep:
            values = [{**point, **dict(zip(axis.keys, row, strict=True))} for point in values for row in axis.values]
        points = [self.with_values(point) for point in values]
        for what, found in (
            ("records; give clock.record", {point.clock.records for point in points}),
            ("maps; run once for each cell and number of points", set(map(_map_size, points))),
        ):
            if len(found) > 1:
                raise PydanticCustomError("unlike_points", f"the points of the sweep would have different {what}")
        return points


def _map_size(scenario: Scenario) -> tuple[float, int] | None:
    """Side of the cell [m] and points of the maps that a scenario draws."""
    modes = getattr(scenario.process, "modes", None) if scenario.record.maps else None
    return None if modes is None else (modes.cell, modes.points)


def _forget_file(document: dict[str, Any], key: str) -> None:
    """Drop what a table has read from its file where one of the table's other keys was changed."""
    *tables, last = key.split(".")
    for name in tables:
        document = document[name]
    if document.get("file") and last not in _FILE_COLUMNS:
        for column in _FILE_COLUMNS:
            document.pop(column, None)


def _rest_radius(solid: Solid, sphere: Sphere, adhesion: Adhesion, contact: Contact) -> float:
    work = np.array([adhesion.work])
    return float(contact.equilibrium_radius(work, sphere.radius, solid.contact_modulus)[0])


Faults = list[tuple[tuple[str, ...], str]]


def faults_across(parts: dict[str, Any]) -> Faults:
    """What does not go together between those parts that are there, each as (place, what is wrong and the cure)."""
    if isinstance(parts.get("shear"), Auto):
        record = parts.get("record")
        try:
            chosen = parts["shear"].chosen(record is not None and bool(record.maps))
        except (PydanticCustomError, ValidationError) as fault:
            text = fault.message() if isinstance(fault, PydanticCustomError) else fault.errors()[0]["msg"]
            return [(("shear",), text)]
        parts = parts | {"shear": chosen}
    if isinstance(parts.get("bonds"), AutoBonds):
        held = [parts[name] for name in ("solid", "sphere", "adhesion", "contact") if name in parts]
        radius = _rest_radius(*held) if len(held) == 4 else math.nan
        parts = parts | {"bonds": parts["bonds"].chosen(math.pi * radius**2, _reads_forces(parts.get("shear")))}
    return [
        fault
        for reads, check in _CHECKS
        if all(name in parts for name in reads)
        for fault in check(*(parts[name] for name in reads))
    ]


def _table_too_short(drive: Drive, clock: Clock) -> Faults:
    if isinstance(drive, Table) and drive.time[-1] < clock.duration * (1 - 1e-9):
        said = f"the table ends at {drive.time[-1]:g} s, before clock.duration ({clock.duration:g} s)"
        return [(("drive",), f"{said}; add rows or shorten the run")]
    return []


def _no_adhesion(contact: Contact, adhesion: Adhesion) -> Faults:
    if isinstance(contact, Lagging) and not adhesion.work > 0.0:
        said = "a lagging edge measures its drive by the work of adhesion at rest; give a work above zero"
        return [(("adhesion", "work"), said)]
    return []


def _reads_forces(shear: Any) -> bool:
    """Whether the shear part follows the forces of the single bonds."""
    return isinstance(getattr(shear, "spectrum", None), BondMade)


def _control_too_short(contact: Contact, clock: Clock) -> Faults:
    for name in ("load", "indentation", "travel"):
        times = getattr(getattr(contact, name), "time", None)
        if times and times[-1] < clock.duration * (1 - 1e-9):
            said = f"the table ends at {times[-1]:g} s, before clock.duration ({clock.duration:g} s)"
            return [(("contact", name), f"{said}; add rows or shorten the run")]
        if clock.steps < _STEPS_A_TRIP * getattr(getattr(contact, name), "trips", 0):
            said = f"fewer than {_STEPS_A_TRIP} of the {clock.steps} clock steps for a trip"
            return [(("contact", name, "trips"), f"{said}; make fewer trips or shorter steps")]
    return []


def _no_stress(shear: Depth, bonds: BondDepth) -> Faults:
    if shear.reads_stress and not bonds.carries_stress and not _reads_forces(shear):
        said = 'growth model "stress" follows the stress of the bonds, which is 0 Pa; give bonds.stress'
        return [(("shear", "growth"), said)]
    return []


def _no_forces(shear: Depth, bonds: BondDepth, solid: Solid) -> Faults:
    if not _reads_forces(shear):
        return []
    if not bonds.knows_forces:
        said = 'the spectrum that bonds make needs the force of each bond; use bonds.model = "cohort" or "tracked"'
        return [(("shear", "spectrum"), said)]
    stiffest = shear.spectrum.stiffest(*solid.effective)  # type: ignore[union-attr]
    if bonds.bond_stiffness > stiffest * (1.0 + 1e-9):  # type: ignore[union-attr]
        said = f"the half-space under a bond of this footprint yields with {stiffest:.3g} N/m, in series with the bond"
        return [(("bonds", "bond_stiffness"), f"{said}: give at most that, or a larger shear.spectrum.footprint")]
    return []


def _no_maps(record: Record, shear: Depth) -> Faults:
    if record.maps and not shear.draws_maps:
        return [(("record", "maps"), 'needs shear.model = "mapped"; choose it or leave the maps out')]
    return []


def _unrecorded_maps(record: Record, clock: Clock) -> Faults:
    faults: Faults = []
    between = clock.step * clock.stride
    for time in record.maps:
        ratio = time / between
        if time > clock.duration * (1 + 1e-9) or abs(ratio - round(ratio)) > 1e-9 * max(ratio, 1.0):
            said = f"{time:g} s is none of the recorded times; choose whole multiples of {between:g} s"
            faults.append((("record", "maps"), f"{said} up to {clock.duration:g} s"))
    return faults[:1]


def _too_many_map_members(record: Record, ensemble: Ensemble) -> Faults:
    if record.map_members > ensemble.members:
        said = f"is more than ensemble.members ({ensemble.members}); lower it or add members"
        return [(("record", "map_members"), said)]
    return []


def _shear_faults(shear: Depth, solid: Solid, sphere: Sphere, adhesion: Adhesion, contact: Contact) -> Faults:
    """What keeps the shear part from being built on its solid and cell."""
    if isinstance(shear, Uniform | Mean):
        return []
    cell = shear.cell or math.sqrt(math.pi) * _rest_radius(solid, sphere, adhesion, contact)
    if not cell > 0.0:
        return [(("shear",), 'there is no contact at rest to set the cell by; give a cell such as cell = "0.2 mm"')]
    radius = _rest_radius(solid, sphere, adhesion, contact)
    if shear.contact == "disc" and shear.draws_maps and not 2.0 * radius <= cell:
        said = f"the cell of {cell:g} m does not hold the contact, which is {2.0 * radius:g} m wide at rest"
        return [(("shear", "cell"), f'{said}; give shear.cell = "{2.2e6 * radius:.3g} um" or more')]
    too_many = _too_many_modes(shear, cell)
    if too_many:
        return [(("shear",), f'{too_many}; take a smaller cell, longer waves or fewer points, or model = "mean"')]
    try:
        shear.process(*solid.effective, cell)
    except PydanticCustomError as fault:
        return [(("shear",), fault.message())]
    return []


def _too_many_modes(shear: Any, cell: float) -> str | None:
    """What is too large about the smallest grid that holds the spectrum, or about the one asked for."""
    ripple = getattr(shear.spectrum, "wavevector", None)
    waves = (max(map(abs, ripple)) if ripple else shear.spectrum.support[1]) * cell / (2.0 * math.pi)
    if math.isfinite(waves) and waves > _MOST_WAVES:
        return f"the cell of {cell:g} m holds {waves:.2g} of the shortest waves along a side"
    reach = waves if shear.points is None else min(waves, (shear.points - 1) // 2)
    pairs = (2.0 * reach + 1.0) * (reach + 1.0)
    kept = isinstance(shear, Modal) and (shear.draws_maps or not ripple)
    if kept and math.isfinite(reach) and pairs > _MOST_PAIRS:
        return f"the cell of {cell:g} m has {pairs:.2g} Fourier modes, of which {_MOST_PAIRS:.2g} can be kept"
    return None


_CHECKS: tuple[tuple[tuple[str, ...], Any], ...] = (
    (("drive", "clock"), _table_too_short),
    (("contact", "clock"), _control_too_short),
    (("shear", "bonds"), _no_stress),
    (("shear", "bonds", "solid"), _no_forces),
    (("contact", "adhesion"), _no_adhesion),
    (("record", "shear"), _no_maps),
    (("record", "clock"), _unrecorded_maps),
    (("record", "ensemble"), _too_many_map_members),
    (("shear", "solid", "sphere", "adhesion", "contact"), _shear_faults),
)
#: The parts that the checks read.
CHECKED = sorted({name for reads, _ in _CHECKS for name in reads})


def quantities(part: Any, prefix: str = "") -> dict[str, tuple[Quantity, float]]:
    """Every number of a scenario with its declaration, by its dotted key in a scenario file."""
    found: dict[str, tuple[Quantity, float]] = {}
    for item in fields(part):
        value = getattr(part, item.name)
        declared = getattr(type(part), "__pydantic_fields__", {}).get(item.name)
        key = prefix + ((declared and declared.alias) or item.name)
        if is_dataclass(value) and not isinstance(value, type) and not isinstance(value, Source):
            found |= quantities(value, f"{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and declared is not None:
            meaning = declared.description or item.name.replace("_", " ")
            found[key] = (declaration(declared) or Quantity("1", meaning), value)
    return found


def declaration(declared: Any) -> Quantity | None:
    """What a field of a part is declared to be, None where it is no quantity."""
    notes = (*declared.metadata, *_noted(declared.annotation))
    return next((item for item in notes if isinstance(item, Quantity)), None)


def _noted(annotation: Any) -> Iterator[Any]:
    """What the alternatives of an annotation are annotated with; a number comes before the tables it may be."""
    yield from getattr(annotation, "__metadata__", ())
    for option in getattr(annotation, "__args__", ()):
        if not is_dataclass(option):
            yield from _noted(option)
