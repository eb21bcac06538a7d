"""A scenario: one of each part, a clock, and what must hold between them."""

import math
from dataclasses import dataclass as plain_dataclass
from dataclasses import field, fields, is_dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError

from sim.bodies import Adhesion, Solid, Sphere
from sim.parts.bonds import Bonds, Unbroken
from sim.parts.contact import Contact
from sim.parts.drive import Drive, Table
from sim.parts.drive import Steady as SteadyDrive
from sim.parts.shear import Mean, ModalProcess, Shear, SmoothProcess, Uniform
from sim.quantity import Quantity

#: Names that the dataset gives away itself, so that no sweep may take them.
RESERVED = frozenset(
    ["t", "realization", "snapshot", "x", "y", "map_realization", "shear_map", "name", "seed"]
    + ["speed", "slider_position", "bond_fraction", "shear_stress", "fluctuation_energy", "work_of_adhesion"]
    + ["contact_radius", "contact_area", "normal_load", "indentation", "friction_force", "in_contact"]
)

_Duration = Annotated[float, Quantity("s", "duration of the run", "T", above=0)]
_MOST_RECORDS = 10_000_000


@dataclass(frozen=True, config={"extra": "forbid"})
class Clock:
    """How long, in which steps, and how often a step is recorded; the first record is t = 0."""

    duration: _Duration
    step: Annotated[float, Quantity("s", "clock step", "dt", above=0)]
    record: Annotated[float, Quantity("s", "time between records", "", above=0)] | None = None

    @model_validator(mode="after")
    def _whole_multiples(self) -> "Clock":
        if self.record is not None and not _is_multiple(self.record, self.step):
            raise PydanticCustomError("clock", "record must be a whole multiple of step")
        if not _is_multiple(self.duration, self.record or self.step):
            word = "record" if self.record else "step"
            raise PydanticCustomError("clock", f"duration must be a whole multiple of {word}")
        if self.records > _MOST_RECORDS:
            raise PydanticCustomError("clock", f"asks for more than {_MOST_RECORDS:,} records; make record longer")
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


def _is_multiple(long: float, short: float) -> bool:
    ratio = long / short
    return math.isfinite(ratio) and round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * ratio


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
class Axis:
    """One dimension of a sweep: its ``keys`` take the rows of ``values`` together."""

    name: str
    keys: tuple[str, ...]
    values: tuple[tuple[Any, ...], ...]


@plain_dataclass(frozen=True)
class Source:
    """Where a scenario came from: the file's text, what was changed on top, and every file it names."""

    path: str = ""
    text: str = ""
    overrides: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)


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
            for where, text in self._faults()
        ]
        if faults:
            raise ValidationError.from_exception_data("Scenario", faults)
        return self

    def _faults(self) -> list[tuple[tuple[str, ...], str]]:
        """What does not go together, each as (place, what is wrong and the cure)."""
        faults: list[tuple[tuple[str, ...], str]] = []
        if isinstance(self.drive, Table) and self.drive.time[-1] < self.clock.duration * (1 - 1e-9):
            faults.append((("drive",), f"the table ends at {self.drive.time[-1]:g} s, before clock.duration; add rows"))
        if self.shear.reads_stress and not self.bonds.stress > 0.0:
            faults.append(
                (
                    ("shear", "growth"),
                    'growth "stress" follows the bonds\' stress: give bonds.stress above 0 Pa',
                )
            )
        if self.record.maps and not self.shear.draws_maps:
            faults.append((("record", "maps"), 'maps need shear.model = "mapped"'))
        for time in self.record.maps:
            ratio = time / (self.clock.step * self.clock.stride)
            if time > self.clock.duration * (1 + 1e-9) or abs(ratio - round(ratio)) > 1e-9 * max(ratio, 1.0):
                faults.append(
                    (
                        ("record", "maps"),
                        f"{time:g} s is not one of the recorded times; choose a multiple of clock.record",
                    )
                )
        if self.record.map_members > self.ensemble.members:
            faults.append((("record", "map_members"), "is more than ensemble.members"))
        return faults + self._shear_faults()

    def _shear_faults(self) -> list[tuple[tuple[str, ...], str]]:
        if isinstance(self.shear, Uniform | Mean):
            return []
        if self.shear.cell is None and not self.rest_radius > 0.0:
            return [(("shear",), "there is no contact at rest to set the cell by; give shear.cell")]
        try:
            self.process  # noqa: B018  built here so that its faults come with all others
        except PydanticCustomError as fault:
            return [(("shear",), fault.message())]
        return []

    @cached_property
    def rest_radius(self) -> float:
        """Contact radius with every bond of rest and no fluctuation [m]; nan without equilibrium."""
        work, modulus = np.array([self.adhesion.work]), self.solid.contact_modulus
        return float(self.contact.equilibrium_radius(work, self.sphere.radius, modulus)[0])

    @cached_property
    def process(self) -> SmoothProcess | ModalProcess:
        """The shear part on this solid and cell."""
        shear_modulus, poisson_ratio = self.solid.effective
        cell = math.sqrt(math.pi) * self.rest_radius
        return self.shear.process(shear_modulus, poisson_ratio, cell)

    @cached_property
    def varies(self) -> dict[str, bool]:
        """For each part whether its values differ between members: by its class, never by looking."""
        bonded = self.bonds.per_member
        sheared = self.shear.per_member or (self.shear.reads_stress and bonded)
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
        document["source"] = self.source
        return TypeAdapter(Scenario).validate_python(document, context={"files": None})

    def points(self) -> list["Scenario"]:
        """The scenario at each point of its sweep, the last axis fastest; one point where there is none."""
        points: list[dict[str, Any]] = [{}]
        for axis in self.sweep:
            points = [{**point, **dict(zip(axis.keys, row, strict=True))} for point in points for row in axis.values]
        return [self.with_values(point) for point in points]


def set_key(document: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key in a nested document, making the tables on its way."""
    *tables, last = key.split(".")
    for name in tables:
        inner = document.get(name)
        document[name] = dict(inner) if isinstance(inner, dict) else {}
        document = document[name]
    document[last] = value


def read_sweep(sweep: Any) -> tuple[Axis, ...]:
    """Axes from a table of keys (outer product) or a list of tables (zipped into one axis)."""
    if isinstance(sweep, tuple) and all(isinstance(axis, Axis) for axis in sweep):
        return sweep
    if isinstance(sweep, list) and sweep and all(isinstance(row, dict) and row for row in sweep):
        keys = tuple(sweep[0])
        if any(set(row) != set(keys) for row in sweep):
            raise PydanticCustomError("sweep", "the tables of a zipped sweep must have the same keys")
        rows = tuple(tuple(row[key] for key in keys) for row in sweep)
        return (Axis(_axis_name(keys[0], set()), keys, rows),)
    if not isinstance(sweep, dict):
        raise PydanticCustomError("sweep", 'must be a table such as {"contact.load" = ["1 mN", "4 mN"]}')
    axes: list[Axis] = []
    for key, values in sweep.items():
        name = _axis_name(key, {axis.name for axis in axes})
        axes.append(Axis(name, (key,), tuple((value,) for value in _sweep_values(key, values))))
    return tuple(axes)


def _axis_name(key: str, taken: set[str]) -> str:
    words = key.split(".")
    for count in range(1, len(words) + 1):
        name = "_".join(words[-count:])
        if name not in taken and name not in RESERVED:
            return name
    raise PydanticCustomError("sweep", "sweeps {key}, which cannot be swept", {"key": key})


def _sweep_values(key: str, values: Any) -> list[Any]:
    if isinstance(values, list) and values:
        return values
    if isinstance(values, dict) and set(values) <= {"from", "to", "count", "scale"} >= {"from"}:
        return _range(key, values)
    raise PydanticCustomError(
        "sweep",
        'the values of {key} must be a list, or {{from, to, count, scale = "linear" or "log"}}',
        {"key": key},
    )


def _range(key: str, values: dict[str, Any]) -> list[Any]:
    """Evenly spaced values, linearly or logarithmically; both ends in one unit."""
    ends = [str(values.get(end, "")).strip().partition(" ") for end in ("from", "to")]
    count, scale = values.get("count"), values.get("scale", "linear")
    try:
        first, last = (float(number) for number, _, _ in ends)
    except ValueError:
        first = last = math.nan
    sound = math.isfinite(first) and math.isfinite(last) and ends[0][2] == ends[1][2]
    if not sound or type(count) is not int or not 2 <= count <= 10**5 or scale not in ("linear", "log"):
        raise PydanticCustomError(
            "sweep",
            'the range of {key} needs from and to in the same unit, a count of 2 or more and scale "linear" or "log"',
            {"key": key},
        )
    if scale == "log" and not (first > 0.0 and last > 0.0):
        raise PydanticCustomError("sweep", "the log range of {key} needs ends above zero", {"key": key})
    spaced = np.geomspace(first, last, count) if scale == "log" else np.linspace(first, last, count)
    unit = ends[0][2].strip()
    return [f"{value!r} {unit}" if unit else value for value in spaced.tolist()]


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
            found[key] = (_declaration(declared) or Quantity("1", meaning), value)
    return found


def _declaration(declared: Any) -> Quantity | None:
    candidates = [*declared.metadata]
    for option in getattr(declared.annotation, "__args__", ()):
        candidates += getattr(option, "__metadata__", ())
    return next((item for item in candidates if isinstance(item, Quantity)), None)
