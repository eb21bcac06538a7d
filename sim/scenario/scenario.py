"""A scenario: one of each part, a clock, an ensemble and records, and what must hold between them."""

import functools
import math
from dataclasses import fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, cast

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError

from sim.laws.incipient import Incipient
from sim.numerics.grid import Lattice
from sim.parts.bonds.models import Bonds, Model as BondModel, Unbroken
from sim.parts.contact import Contact
from sim.parts.contact.balance import Bodies, Shares
from sim.parts.contact.models import Adhesion, Body, EffectiveWork, Solid, Sphere
from sim.parts.drive import Drive, Steady as SteadyDrive
from sim.parts.exchange import Parts, Setting, Times
from sim.parts.shear import Model, Process, Shear, Uniform
from sim.parts.shear.maps import CarriedProcess
from sim.parts.shear.modes import ModalProcess
from sim.parts.temperature import Temperature
from sim.quantities import RECORDED
from sim.scenario.checks import Limits, faults_across, limits, remarks_between
from sim.scenario.files import Files, Source
from sim.scenario.messages import in_plain_words, plain_spoken
from sim.scenario.schema import changed, entries, quantities, with_models
from sim.scenario.sweep import read_sweep, rows, set_key, spaced
from sim.solid import ElasticSolid
from sim.step.driven import driven
from sim.step.phases import Phases, phases
from sim.step.prescribed import Prescribed
from sim.step.stepper import Models, Scene, Stepper
from sim.units import notebook
from sim.units.errors import BadInput
from sim.units.instrument import Instrument, JumpIn, Zero
from sim.units.notation import engineering
from sim.units.quantity import Quantity

_Title = Annotated[
    str,
    Field(
        max_length=200, description="subject of the scenario and title of the dataset"
    ),
]
#: Times of a run between which its speeds are looked at for remarks.
_SPEEDS = 41
#: Points of a sweep whose shear processes are all tried.
_MOST_BUILT = 64
#: Faults of a sweep that are reported at once.
_MOST_FAULTS = 100


_T = TypeVar("_T")

#: Adapter that checks and dumps a table.
_adapter: Any = cache(TypeAdapter)


#: Columns that a part has read from its file, read anew where its table changes but for keys of their use.
_FILE_COLUMNS = (
    "time",
    "speed",
    "temperature",
    "wavenumbers",
    "densities",
    "values",
    "shape",
)
_OF_USE = ("rms", "normalization")


_Duration = Annotated[float, Quantity("s", "duration of the run", "T", above=0)]
_MOST_RECORDS = 10_000_000
_MOST_STEPS = 10**9


@dataclass(frozen=True, config={"extra": "forbid"})
class Clock:
    """Duration, clock step and time between records; the first record is t = 0."""

    duration: _Duration
    step: Annotated[float, Quantity("s", "clock step", "dt", above=0)]
    record: (
        Annotated[float, Quantity("s", "time between records", "", above=0)] | None
    ) = None

    @model_validator(mode="after")
    def _whole_multiples(self) -> "Clock":
        for name in ("record", "step"):
            if (getattr(self, name) or 0.0) > self.duration * (1.0 + 1e-9):
                message = f"{name} ({getattr(self, name):g} s) is longer than duration ({self.duration:g} s)"
                raise PydanticCustomError(
                    "clock", f"{message}; shorten it, or lengthen the run"
                )
        if self.record is not None:
            _require_multiple("record", self.record, "step", self.step)
        word = "step" if self.record is None else "record"
        _require_multiple("duration", self.duration, word, self.record or self.step)
        if self.steps > _MOST_STEPS:
            raise PydanticCustomError(
                "clock", f"has more than {_MOST_STEPS:,} steps; make step longer"
            )
        if self.records > _MOST_RECORDS:
            raise PydanticCustomError(
                "clock",
                f"has more than {_MOST_RECORDS:,} records; give a longer record",
            )
        return self

    @property
    def steps(self) -> int:
        """Return the number of clock steps."""
        return round(self.duration / self.step)

    @property
    def stride(self) -> int:
        """Return the number of clock steps from one record to the next."""
        return round((self.record or self.step) / self.step)

    @property
    def records(self) -> int:
        """Return the number of records, with that at t = 0."""
        return self.steps // self.stride + 1

    @property
    def times(self) -> np.ndarray:
        """Return the times of the records [s], shape (records,); they are never accumulated."""
        return self.duration * (self.stride * np.arange(self.records) / self.steps)


def _require_multiple(name: str, long: float, other: str, short: float) -> None:
    """Refuse a time that is no whole multiple of another."""
    ratio = long / short
    if round(ratio) >= 1 and abs(ratio - round(ratio)) <= 1e-9 * ratio:
        return
    below, above = max(math.floor(ratio), 1) * short, (math.floor(ratio) + 1) * short
    cure = f"{above:g} s" if ratio < 1.0 else f"{below:g} s or {above:g} s"
    message = f"{name} ({long:g} s) must be a whole multiple of {other} ({short:g} s)"
    raise PydanticCustomError("clock", f"{message}, such as {cure}")


@dataclass(frozen=True, config={"extra": "forbid"})
class Ensemble:
    """Independent members of the ensemble, which share everything but their noise."""

    members: Annotated[
        int,
        Quantity("1", "members of the ensemble", at_least=1, at_most=10**7, whole=True),
    ] = 1


@dataclass(frozen=True, config={"extra": "forbid"})
class Accuracy:
    """Accepted error of the means of some quantities: the run chooses the cheapest settings that keep it."""

    within: Annotated[
        float, Quantity("1", "accepted error, such as 1 %", "", above=0, below=1)
    ]
    of: Annotated[
        tuple[str, ...],
        Field(
            description="quantities with this error; if omitted: contact area and radius, friction force and bond"
            " fraction"
        ),
    ] = ()
    budget: Annotated[
        float, Quantity("s", "counted work that may be spent", "", above=0)
    ] = 60.0


def _times(value: Any) -> Any:
    """Return the times of a range, and anything else as it is."""
    return spaced(value) if isinstance(value, dict) else value


@dataclass(frozen=True, config={"extra": "forbid"})
class Record:
    """Content of the dataset: each member or the ensemble's mean, spread and standard error; maps at given times."""

    per_member: Annotated[
        bool | None,
        Field(
            description="record every member; false: mean, standard deviation and standard error; if omitted: every"
            " member, unless the file would exceed 20 GB"
        ),
    ] = None
    maps: Annotated[
        tuple[
            Annotated[
                float,
                Quantity(
                    "s",
                    "times of stress maps, a list or { from, to, count }",
                    at_least=0,
                ),
            ],
            ...,
        ],
        BeforeValidator(_times, list[float | str] | dict[str, float | str]),
    ] = ()
    map_members: Annotated[
        int,
        Quantity(
            "1", "members with recorded maps", at_least=1, at_most=10**4, whole=True
        ),
    ] = 1
    quantities: Annotated[
        tuple[Literal[RECORDED], ...] | None,  # type: ignore[valid-type]
        Field(
            description="quantities to record beside contact_radius; if omitted: all"
        ),
    ] = None
    precision: Annotated[
        Literal["float64", "float32"], Field(description="of trajectories in the file")
    ] = "float64"
    compression: Annotated[
        Literal["none", "zlib", "digits"],
        Field(description="of trajectories in the file; digits: zlib of six digits"),
    ] = "zlib"

    def keeps(self, name: str) -> bool:
        """Return True if a quantity is recorded; the contact radius and the time of an unresolved motion always are."""
        return self.quantities is None or name in (
            "contact_radius",
            "unresolved_time",
            *self.quantities,
        )


class _Built:
    """Parts and stepper that a scene has built for its steps."""

    process: Process | None = None
    stepper: Stepper | None = None


@plain_spoken
@dataclass(frozen=True, config={"extra": "forbid", "arbitrary_types_allowed": True})
class Scenario:
    """One sliding contact, ready to run. Parts left out are the simplest: at rest, unbroken bonds, uniform stress.

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
    instrument: Instrument | None = None
    zero: Zero | None = None
    jump_in: JumpIn | None = None
    temperature: Temperature | None = None
    incipient: Incipient | None = None
    accuracy: Accuracy | None = None
    sweep: Annotated[tuple[Any, ...], BeforeValidator(read_sweep)] = ()
    name: _Title = "sliding contact"
    seed: Annotated[
        int, Quantity("1", "seed of the run", at_least=0, at_most=2**64 - 1, whole=True)
    ] = 0
    source: Annotated[Any, Field(exclude=True)] = Source()

    def __repr__(self) -> str:
        parts = self.drive, self.bonds, self.shear, self.contact
        models = ", ".join(
            f"{name} {part.model}"
            for name, part in zip(Parts._fields, parts, strict=True)
        )
        points = math.prod(len(axis.values) for axis in self.sweep)
        return f'<Scenario "{self.name}": {models}; members {self.ensemble.members}, points {points}>'

    def _repr_html_(self) -> str:
        axes = {key: axis for axis in self.sweep for key in axis.keys}
        rows = []
        for key, value, quantity in entries(self):
            if value in (None, "", ()) or key == "sweep":
                continue
            text = str(value)
            if key in axes or isinstance(value, tuple):
                text = f"{len(axes[key].values if key in axes else value)} values"
            elif isinstance(value, float) and quantity is not None:
                text = engineering(value, quantity.unit)
            meaning = "" if quantity is None else quantity.meaning
            rows.append({"key": key, "value": text, "meaning": meaning})
        return notebook.table(rows)

    def __hash__(self) -> int:
        # a sweep and a source may hold dictionaries; scenarios that differ in them alone share a hash
        names = (name for name in _FIELDS if name not in ("sweep", "source"))
        return hash(tuple(getattr(self, name) for name in names))

    @model_validator(mode="after")
    def _across_parts(self, info: ValidationInfo) -> "Scenario":
        # a shear part that is ``unbuilt`` may take long to build
        across = faults_across(self, not (info.context or {}).get("unbuilt"))
        faults = [
            InitErrorDetails(
                type=PydanticCustomError("across", text), loc=at, input=None
            )
            for at, text in across
        ]
        if faults:
            raise ValidationError.from_exception_data("Scenario", faults)
        if self.source.text and not self.source.parts:
            self.source.parts.update(self._parts)
        return self

    @property
    def _parts(self) -> dict[str, Any]:
        """Return the values that decide about the run, with the sweep."""
        return {name: getattr(self, name) for name in _FIELDS if name != "source"}

    @property
    def origin(self) -> Source:
        """Return the source; of a scenario that was changed in Python only the path and the files it has read."""
        source = self.source
        described = bool(source.text) and source.parts == self._parts
        return source if described else Source(path=source.path, files=source.files)

    @cached_property
    def rest_radius(self) -> float:
        """Return the contact radius at rest, with all bonds and no fluctuation [m]; nan without equilibrium."""
        work = np.array([self.adhesion.work])
        return float(self.contact.equilibrium_radius(work, self.bodies)[0])

    @cached_property
    def elastic(self) -> ElasticSolid:
        """Return the elastic solid, at the temperature."""
        return self._solid_at_temperature.elastic

    @property
    def softer_body(self) -> Body:
        """Return the body of the lower shear modulus, at the temperature."""
        return self._solid_at_temperature.softer

    @cached_property
    def _solid_at_temperature(self) -> Solid:
        return self._at_temperature("solid", self.solid)

    @cached_property
    def contact_at_temperature(self) -> Contact:
        """Return the model of the contact, at the temperature."""
        return self._at_temperature("contact", self.contact)

    @cached_property
    def population(self) -> BondModel:
        """Return the model of the bonds, at the temperature; model = "auto" is chosen by their number."""
        return self._at_temperature("bonds", self._bonds_at_reference)

    @cached_property
    def _bonds_at_reference(self) -> BondModel:
        return self.bonds.chosen(*self._bond_conditions)

    def _at_temperature(self, name: str, part: _T) -> _T:
        """Return a part with the numbers that it has at the temperature."""
        if self.temperature is None:
            return part
        numbers = {f"{name}.{key}": x for key, (_, x) in quantities(part).items()}
        changes = self.temperature.changes(numbers)
        inside = {key.partition(".")[2]: value for key, value in changes.items()}
        return changed(part, inside) if inside else part

    @property
    def numbers(self) -> dict[str, float]:
        """Return the numbers of the scenario by key, those of the bonds of their model at the reference."""
        model = quantities(self._bonds_at_reference).items()
        numbers = {key: number for key, (_, number) in quantities(self).items()}
        return numbers | {f"bonds.{key}": number for key, (_, number) in model}

    @property
    def derived(self) -> dict[str, tuple[Quantity, float]]:
        """Return numbers that follow from others, by key: of bonds by critical speed and stress, at a temperature."""
        keys_of_file = quantities(self.bonds)
        derived = (
            quantities(self._bonds_at_reference).items()
            if "rebinding_ratio" in keys_of_file
            else ()
        )
        text = "{}, by critical_speed and stress"
        renamed = (
            (key, replace(quantity, meaning=text.format(quantity.meaning)), value)
            for key, (quantity, value) in derived
        )
        result = {
            f"bonds.{key}": (quantity, value)
            for key, quantity, value in renamed
            if key not in keys_of_file
        }
        if self.temperature is None:
            return result
        declared = quantities(self) | result
        for key, value in self.temperature.changes(self.numbers).items():
            meaning = f"{declared[key][0].meaning}, at the temperature"
            quantity = replace(declared[key][0], meaning=meaning)
            result[f"{key}_at_temperature"] = quantity, value
        return result

    @property
    def _bond_conditions(self) -> tuple[float, bool]:
        """Return the area of the contact at rest [m²], and True if the field reads the forces of the bonds."""
        return math.pi * self.rest_radius**2, self.fluctuations.spectrum.bond_made

    @cached_property
    def fluctuations(self) -> Model:
        """Return the model of the shear part; model = "auto" is chosen by the recorded maps."""
        return self.shear.chosen(bool(self.record.maps))

    @cached_property
    def why(self) -> dict[str, str]:
        """Return the reason for the model of each part with model = "auto"."""
        why = {
            "shear": self.shear.why(bool(self.record.maps)),
            "bonds": self.bonds.why(*self._bond_conditions),
        }
        return {part: reason for part, reason in why.items() if reason}

    @cached_property
    def _built(self) -> _Built:
        return _Built()

    @property
    def process(self) -> Process:
        """Return the shear part on this solid and cell; raise ``BadInput`` if it cannot be built."""
        if self._built.process is None:
            try:
                self._built.process = self.fluctuations.process(
                    self.elastic, self._square
                )
            except PydanticCustomError as fault:
                # of a point inside a long sweep, which was not tried before
                raise BadInput([f"shear: {fault.message()}"]) from None
        return self._built.process

    @cached_property
    def contact_area(self) -> float:
        """Return the area of the contact at rest [m²]; of one without equilibrium, that of radius R/100."""
        radius = (
            self.rest_radius if self.rest_radius > 0.0 else 0.01 * self.sphere.radius
        )
        return math.pi * radius**2

    @property
    def _square(self) -> float:
        """Return the side of the square with the area of the contact at rest [m]."""
        return math.sqrt(math.pi) * self.rest_radius

    @property
    def map_lattice(self) -> Lattice | None:
        """Return sides and points of the recorded maps; None without maps."""
        return (
            cast(ModalProcess | CarriedProcess, self.process).lattice
            if self.record.maps
            else None
        )

    @cached_property
    def bodies(self) -> Bodies:
        """Return the sphere and the solid as the contact sees them."""
        return Bodies(self.sphere.radius, self.sphere.on(self.elastic))

    @property
    def widest(self) -> float:
        """Return the radius that the contact can reach [m]."""
        return self.contact.largest_radius(self.adhesion.work, self.bodies)

    @cached_property
    def margin(self) -> Shares | None:
        """Return the share of ΔΓ that acts on the edge of a finite contact; None if waves are taken as short."""
        if self.fluctuations.contact == "plane":
            return None
        return self.fluctuations.margin(self.elastic, self.sphere.radius, self.widest)

    @cached_property
    def times(self) -> Times:
        """Return the clock of the run."""
        return Times(self.clock.step, self.clock.steps, self.clock.duration)

    @cached_property
    def setting(self) -> Setting:
        """Return the constants from which parts make their remarks."""
        strength = float(self.population.steady(np.zeros(1)).strength[0])
        return Setting(
            self.elastic,
            strength,
            self.rest_radius,
            self._square,
            self.times,
            "rebinding_ratio" in quantities(self.bonds),
            self.contact.jump_in_distance(self.adhesion.work),
            not self.contact.faults(
                is_driven=False, is_on_disc=True, is_on_layer=False
            ),
        )

    @cached_property
    def strengths(self) -> tuple[np.ndarray, np.ndarray]:
        """Return distinct speeds of the run [m/s], and the stress of the bonds in steady sliding at them [Pa]."""
        speeds = np.unique(self.speeds(_SPEEDS))
        strength = self.population.steady(speeds).strength
        return speeds, np.broadcast_to(strength, speeds.shape)

    @property
    def steady_stress(self) -> np.ndarray:
        """Return the shear stress in steady sliding at the speeds of ``strengths``, with the viscous one [Pa]."""
        speeds, strength = self.strengths
        return strength + self.drive.viscosity * np.abs(speeds)

    @cached_property
    def limits(self) -> Limits:
        """Return the numbers that tell if the scene lies within the theory."""
        return limits(self)

    @property
    def chosen(self) -> tuple[Drive, BondModel, Model, Contact]:
        """Return the four parts in the order in which they act, each "auto" replaced by a model."""
        return (
            self.drive,
            self.population,
            self.fluctuations,
            self.contact_at_temperature,
        )

    def speeds(self, count: int, share: float = 1.0) -> np.ndarray:
        """Return speeds [m/s] at evenly spaced times of the run, or of a first share of it, with both ends."""
        instants = np.linspace(0.0, share * self.times.duration, count)
        joined = self.drive.pieces(instants, self.times.duration).joined
        return np.append(joined.first[:1], joined.last)

    @property
    def parts(self) -> Parts:
        """Return the parts for the engine."""
        return self.stepper.scene.parts

    @cached_property
    def work(self) -> EffectiveWork:
        """Return the work of adhesion, and what reduces it."""
        paid = self.fluctuations.paid_by_adhesion
        return EffectiveWork(self.adhesion, paid, self.margin, self.bodies)

    @property
    def stepper(self) -> Stepper:
        """Return the stepper of this scene."""
        if self._built.stepper is None:
            self._built.stepper = self.stepper_with(self.process)
        return self._built.stepper

    def stepper_with(self, process: Any) -> Stepper:
        """Return a stepper of this scene with a process of the shear part that was made elsewhere."""
        models = Models(self.fluctuations, self.population, self.contact_at_temperature)
        # each model fits its protocol with its class of state
        parts = cast(
            Parts, (self.drive, self.population, process, self.contact_at_temperature)
        )
        scene = Scene(
            Parts(*parts),
            models,
            self.times,
            self.phases,
            self.work,
            self.loads_from_rest,
            self.feels_steps,
            self.varies["bonds"] == self.varies["contact"],
            self.contact_area,
        )
        return driven(scene) if self.drive.solves_motion else Prescribed(scene)

    def release(self) -> None:
        """Drop the process, whose arrays may be large; it is made again when needed."""
        self._built.process = self._built.stepper = None

    @cached_property
    def varies(self) -> dict[str, bool]:
        """Return, for each part and the control of the contact, True if each member has values of its own.

        Without a random part these values are equal.
        """
        driven, bonds, field = (
            self.drive.solves_motion,
            self.population,
            self.fluctuations,
        )
        bonded = driven or bonds.is_random or bonds.feeds_back
        reads_bonds = field.amplitude.reads_stress or field.spectrum.bond_made
        by_bonds = bonded and (reads_bonds or field.passes)
        sheared = driven or field.is_random or by_bonds
        return {
            "drive": driven,
            "bonds": bonded,
            "shear": sheared,
            "contact": bonded or sheared,
            "control": False,
        }

    @property
    def is_random(self) -> bool:
        """Return True if a part of the scene is random. Members differ only then."""
        return self.population.is_random or self.fluctuations.is_random

    @property
    def lags_behind_speed(self) -> bool:
        """Return True if the speed changes at a constant mount, and bonds or fluctuations lag behind it."""
        rates = (key.startswith("bonds.rebinding") for key in quantities(self))
        lags = any(rates) or self.fluctuations.amplitude.relaxing
        return lags and not self.contact.changes and bool(np.ptp(self.speeds(_SPEEDS)))

    @property
    def loads_from_rest(self) -> bool:
        """True if a friction force builds up after a rest: of the slider, or of the stage that pulls it."""
        drive, rests = cast(Any, self.drive), self.phases.rests
        pulled = drive.model == "spring" and drive.start == "rest"
        return (pulled and not all(rests)) or (
            drive.model != "force" and any(rests[:-1])
        )

    @cached_property
    def phases(self) -> Phases:
        """Return the phases of the run."""
        return phases(self.drive, self.contact, self.times)

    @cached_property
    def feels_steps(self) -> bool:
        """Return True if what ΔΓ does between clock steps matters: to an edge that lags, or to a pull-off."""
        varies = self.fluctuations.random_variance > 0.0
        return varies and (self.contact.lags or self.contact.can_open)

    @property
    def knows_energy(self) -> bool:
        """Return True if the law of ΔΓ at each time is known: its field feels neither the friction nor earlier sliding.

        The amplitude is then that of the moment, which all members share.
        """
        shear, law = self.fluctuations, self.fluctuations.law
        if not shear.is_random or shear.spectrum.bond_made:
            return False
        feels = self.drive.solves_motion or law.relaxing or law.remembers
        return not (feels or (law.reads_stress and self.varies["bonds"]))

    def remarks(self) -> list[str]:
        """Return one sentence for each assumption, error of the cell and implausible value."""
        remarks = [
            remark for part in self.chosen for remark in part.remarks(self.setting)
        ]
        remarks += remarks_between(self)
        if (
            (lattice := self.map_lattice)
            and not self.fluctuations.measured
            and (points := lattice.faster)
        ):
            slow = f"{lattice.shape[0]} points along a side have a large prime factor, so each map needs more time"
            remarks.append(f"{slow}: shear.points = {points}")
        if self.solid.poisson_ratio != 0.5:
            remarks.append(
                "poisson_ratio is not 0.5: the coupling of mean shear stress and pressure is neglected"
            )
        return list(dict.fromkeys(remarks))

    def with_values(self, values: dict[str, Any], built: bool = True) -> "Scenario":
        """Return this scenario without its sweep and with some keys changed, ``{"contact.load": 1e-3}``.

        Without ``built`` the process of the shear part is not tried, which may take half a second.

        Raises
        ------
        BadInput
            If a key is unknown or a value is not admissible.
        """
        document = {
            name: getattr(self, name) for name in _FIELDS if name != "sweep"
        } | self._changed(values)
        document["source"] = self.origin.changed(
            values | ({"sweep": {}} if self.sweep else {})
        )
        with in_plain_words(Scenario):
            context = {"files": self._files, "unbuilt": not built}
            return _adapter(Scenario).validate_python(
                with_models(Scenario, document), context=context
            )

    def points(self) -> list["Scenario"]:
        """Return the scenario at each point of its sweep, the last axis fastest; without a sweep the only point.

        Of a long sweep the processes of the shear part are built at both ends only, because each may take long.

        Raises
        ------
        BadInput
            If a value cannot be used, values do not go together, or points do not fit into one dataset.
        """
        return list(self._swept)

    @cached_property
    def _swept(self) -> list["Scenario"]:
        if not self.sweep:
            return [self]
        values, origin = rows(self.sweep), self.origin
        tables: dict[Any, Any] = {}
        points, faults = [], dict[str, None]()
        for place, row in enumerate(values):
            try:
                built = len(values) <= _MOST_BUILT or place in (0, len(values) - 1)
                points.append(self._point(row, origin, tables, built))
            except BadInput as fault:
                faults |= dict.fromkeys(fault.problems)
                if len(faults) >= _MOST_FAULTS:
                    break
        if faults:
            raise BadInput(list(faults))
        if len({point.clock.records for point in points}) > 1:
            raise BadInput(
                [
                    "the points of the sweep would have different records; give clock.record"
                ]
            )
        if len({point.drive.solves_motion for point in points}) > 1:
            cure = "run them apart"
            raise BadInput(
                [
                    "sweep: some drives prescribe the speed and others solve the motion of"
                    f" the slider, which record other quantities; {cure}"
                ]
            )
        if len({point.map_lattice for point in points}) > 1:
            cure = "run once for each cell and number of points"
            raise BadInput(
                [f"the points of the sweep would have different maps; {cure}"]
            )
        return points

    def _point(
        self,
        values: dict[str, Any],
        origin: Source,
        tables: dict[Any, Any],
        built: bool,
    ) -> "Scenario":
        """Return the scenario with some values; ``tables`` holds those that other points have read."""
        groups: dict[str, dict[str, Any]] = {}
        for key, value in values.items():
            groups.setdefault(key.partition(".")[0], {})[key] = value
        document = self._parts | {
            "sweep": (),
            "source": origin.changed(values | {"sweep": {}}),
        }
        for name, changes in groups.items():
            # the values live as long as the sweep
            place = (name, *map(id, changes.values()))
            if place not in tables:
                tables[place] = self._table(name, changes)
            document[name] = tables[place]
        with in_plain_words(Scenario):
            return _adapter(Scenario).validate_python(
                document, context={"unbuilt": not built}
            )

    def _table(self, name: str, changes: dict[str, Any]) -> Any:
        """Return a table with some keys changed."""
        try:
            table = with_models(Scenario, self._changed(changes))[name]
            return table_adapter(name).validate_python(
                table, context={"files": self._files}
            )
        except (ValidationError, KeyError):
            # raises BadInput with the fault
            return getattr(self.with_values(changes), name)

    @property
    def _files(self) -> Files:
        return Files(Path(self.source.path).parent, self.source.files)

    def _changed(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return the document of those tables to which some dotted keys belong, with the keys changed.

        A table that names a file reads it anew, except for a change of a key in ``_OF_USE``.
        """
        document: dict[str, Any] = {}
        for name in {key.partition(".")[0] for key in values if "." in key} & set(
            _FIELDS
        ):
            part = getattr(self, name)
            document[name] = _adapter(type(part)).dump_python(
                part, by_alias=True, exclude_none=True
            )
        for key, value in values.items():
            *above, last = key.split(".")
            set_key(document, [*above, last], value)
            table = functools.reduce(dict.__getitem__, above, document)
            if above and table.get("file") and last not in _FILE_COLUMNS + _OF_USE:
                for column in _FILE_COLUMNS:
                    table.pop(column, None)
        return document


#: The tables and values of a scenario.
_FIELDS = tuple(item.name for item in fields(Scenario))


@cache
def table_adapter(name: str) -> TypeAdapter[Any]:
    """Return the adapter that checks one table of a scenario."""
    declared = getattr(Scenario, "__pydantic_fields__", {})[name]
    kind: Any = Annotated[
        declared.annotation,
        Field(discriminator=declared.discriminator),
        *declared.metadata,
    ]
    return TypeAdapter(kind)
