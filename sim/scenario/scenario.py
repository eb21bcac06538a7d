"""A scenario: one of each part, a clock, and what must hold between them."""

import math
from dataclasses import fields
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import InitErrorDetails, PydanticCustomError

from sim.parts.bonds import Auto as AutoBonds
from sim.parts.bonds import Bonds, Unbroken
from sim.parts.bonds import Model as BondModel
from sim.parts.contact import Contact
from sim.parts.contact.bodies import Adhesion, Solid, Sphere
from sim.parts.contact.control import Bodies
from sim.parts.drive import Drive
from sim.parts.drive import Steady as SteadyDrive
from sim.parts.exchange import Parts, Setting, Times
from sim.parts.shear import Auto, Model, Shear, Uniform
from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.modal import ModalProcess
from sim.parts.shear.process import SmoothProcess
from sim.scenario.checks import CHECKED, _reads_forces, _rest_radius, faults_across
from sim.scenario.clock import Clock, Ensemble, Record
from sim.scenario.declared import as_html, entries, with_models
from sim.scenario.messages import in_plain_words, plain_spoken
from sim.scenario.source import Files, Source
from sim.scenario.sweep import read_sweep, set_key
from sim.spectrum.finite_contact import Margin
from sim.units.quantity import Quantity
from sim.units.refusals import BadInput

#: Columns that a part has read from its file, read anew where its table changes.
_FILE_COLUMNS = ("time", "speed", "wavenumbers", "densities")


@plain_spoken
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
    name: Annotated[str, Field(max_length=200, description="what the scenario is about, the title of its dataset")] = (
        "sliding contact"
    )
    seed: Annotated[int, Quantity("1", "seed of the run", at_least=0, at_most=2**64 - 1, whole=True)] = 0
    source: Annotated[Any, Field(exclude=True)] = Source()

    def __repr__(self) -> str:
        models = ", ".join(f"{name} {getattr(self, name).model}" for name in ("drive", "bonds", "shear", "contact"))
        points = math.prod(len(axis.values) for axis in self.sweep)
        return f'<Scenario "{self.name}": {models}; members {self.ensemble.members}, points {points}>'

    def _repr_html_(self) -> str:
        """Every key with its value, for notebooks."""
        return as_html(self.name, entries(self))

    @model_validator(mode="after")
    def _across_parts(self) -> "Scenario":
        faults = [
            InitErrorDetails(type=PydanticCustomError("across", text), loc=where, input=None)
            for where, text in faults_across({name: getattr(self, name) for name in CHECKED})
        ]
        if faults:
            raise ValidationError.from_exception_data("Scenario", faults)
        if self.source.text and not self.source.parts:
            self.source.parts.update(self._parts)
        return self

    @property
    def _parts(self) -> dict[str, Any]:
        """Everything that decides about the run, the sweep included."""
        return {item.name: getattr(self, item.name) for item in fields(self) if item.name != "source"}

    @property
    def origin(self) -> Source:
        """The file that describes this scenario; of one that was changed in Python only the files it has read."""
        source = self.source
        return source if source.describes(self._parts) else Source(path=source.path, files=source.files)

    @cached_property
    def rest_radius(self) -> float:
        """Contact radius with every bond of rest and no fluctuation [m]; nan without equilibrium."""
        return _rest_radius(self.solid, self.sphere, self.adhesion, self.contact)

    @cached_property
    def population(self) -> BondModel:
        """The bonds at their depth, chosen by their number if the scenario leaves the choice."""
        if not isinstance(self.bonds, AutoBonds):
            return self.bonds
        return self.bonds.chosen(math.pi * self.rest_radius**2, _reads_forces(self.fluctuations))

    @cached_property
    def fluctuations(self) -> Model:
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

    @cached_property
    def times(self) -> Times:
        """Clock of the run."""
        return Times(self.clock.step, self.clock.steps, self.clock.duration)

    @cached_property
    def setting(self) -> Setting:
        """Constants by which parts judge themselves."""
        strength = float(self.population.steady(np.zeros(1)).strength[0])
        return Setting(
            *self.solid.effective,
            self.solid.contact_modulus,
            self.sphere.radius,
            self.adhesion.work,
            strength,
            self.rest_radius,
            math.sqrt(math.pi) * self.rest_radius,
            self.times,
        )

    @cached_property
    def parts(self) -> Parts:
        """The parts as the engine sees them: each model fits its protocol with a class of state of its own."""
        return Parts(*cast(Parts, (self.drive, self.population, self.process, self.contact)))

    def release(self) -> None:
        """Drop the process, whose arrays may be large; it is made again when needed."""
        self.__dict__.pop("process", None)
        self.__dict__.pop("parts", None)

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
        BadInput
            If a key is unknown or a value is not admissible.
        """
        document = TypeAdapter(Scenario).dump_python(self, by_alias=True, exclude={"source", "sweep"})
        for key, value in values.items():
            set_key(document, key, value)
            _forget_file(document, key)
        document["source"] = self.origin.changed(values | ({"sweep": {}} if self.sweep else {}))
        files = Files(Path(self.source.path).parent, self.source.files)
        with in_plain_words(Scenario, document):
            return TypeAdapter(Scenario).validate_python(with_models(Scenario, document), context={"files": files})

    def points(self) -> list["Scenario"]:
        """The scenario at each point of its sweep, the last axis fastest; one point where there is none.

        Raises
        ------
        BadInput
            If values do not go together, or points would not fit into one dataset.
        """
        values: list[dict[str, Any]] = [{}]
        for axis in self.sweep:
            values = [{**point, **dict(zip(axis.keys, row, strict=True))} for point in values for row in axis.values]
        try:
            points = [self.with_values(point) for point in values]
        except BadInput as fault:
            raise BadInput([f"some values do not go together: {said}" for said in fault.problems]) from None
        for what, found in (
            ("records; give clock.record", {point.clock.records for point in points}),
            ("maps; run once for each cell and number of points", set(map(_map_size, points))),
        ):
            if len(found) > 1:
                raise BadInput([f"the points of the sweep would have different {what}"])
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
