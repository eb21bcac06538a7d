"""The model of a measured map as the field itself, and all models of the fluctuations by their names."""

import functools
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.parts.exchange import Setting
from sim.parts.shear.amplitude import Amplitude, Constant
from sim.parts.shear.carried import CarriedProcess, Passing
from sim.parts.shear.models import Auto, Banded, Contact, Mapped, Mean, Modal, Paid, ShearModel, Uniform
from sim.spectrum.measured import Measured
from sim.spectrum.stress_map import StressMap

#: Radius up to which energies on discs are found, over the largest of the contact without fluctuations.
_BEYOND = 1.25
_passing = functools.lru_cache(maxsize=8)(lambda field, ratio, widest: Passing(field, ratio, widest, np.zeros(1)))


@dataclass(frozen=True, config={"extra": "forbid"})
class Carried(ShearModel):
    """A measured map of the stress itself, carried with the slider. Limit: ``Mapped`` as its correlation never ends.

    It is the same for all members and seeds. On the plane it is periodic; with ``contact = "disc"`` it passes under
    the sphere, without an end that meets its beginning.
    """

    per_member: ClassVar[bool] = False
    draws_maps: ClassVar[bool] = True
    given: ClassVar[bool] = True

    field: StressMap
    amplitude: Amplitude = Field(default_factory=Constant)
    paid_by_adhesion: Paid = 1.0
    contact: Contact = "plane"
    model: Literal["mapped"] = "mapped"

    @model_validator(mode="after")
    def _goes_with_the_contact(self) -> "Carried":
        if self.amplitude.relaxing:
            raise PydanticCustomError("never_renewed", "a measured map is never renewed: give relaxing = false")
        if self.contact == "disc" and (self.field.window != "none" or not self.field.square):
            said = 'a disc needs square pixels and no window; interpolate the map, or take contact = "plane"'
            raise PydanticCustomError("disc_of_map", said)
        if self.contact == "plane" and self.field.start is not None:
            raise PydanticCustomError(
                "disc_of_map", 'start is where a disc begins: give contact = "disc", or leave it out'
            )
        return self

    @property
    def passes(self) -> bool:  # type: ignore[override]
        return self.contact == "disc"

    @property
    def feeds_back(self) -> bool:  # type: ignore[override]
        return self.passes  # the contact is found at one position at a time

    @property
    def stays(self) -> bool:
        return self.amplitude.model == "constant" and not self.passes

    @property
    def spectrum(self) -> Measured:  # type: ignore[override]
        """The radially averaged spectrum of the map."""
        return self.field.spectrum

    def process(self, shear_modulus: float, poisson_ratio: float, cell: float) -> CarriedProcess:
        energy = self.field.surface_energy(shear_modulus, poisson_ratio)
        return CarriedProcess(energy, self.law, self.field, self.passes)

    def margin(self, solid: tuple[float, float], sphere_radius: float, widest: float) -> Passing:
        shorter = 0.5 * min(self.field.lattice.sides)
        return _passing(self.field, solid[1], min(_BEYOND * widest or 0.5 * shorter, shorter))

    def off_the_map(self, positions: tuple[float, float], radius: float) -> list[tuple[str, str]]:
        (low, high), (length, width), begin = positions, self.field.lattice.sides, self.field.begin
        if 2.0 * radius > width:
            return [("", f"the map is {width:g} m wide, the contact up to {2.0 * radius:g} m; give a wider map")]
        first, last = radius + high, length - radius + low
        if first <= begin <= last:
            return []
        said = f"the contact, {2.0 * radius:g} m wide, slides beyond the end of the map, which is {length:g} m long"
        if first <= last:
            return [("", f'{said}; begin elsewhere: start = "{0.5e6 * (first + last):.4g} um"')]
        return [("", f"{said}; shorten the slip to {max(length - 2.0 * radius, 0.0):.3g} m, or give a longer map")]

    def details(self, setting: Setting) -> list[tuple[str, str]]:
        found, solid = self.field, (setting.shear_modulus, setting.poisson_ratio)
        own, radial = found.surface_energy(*solid), float(found.spectrum.surface_energy(*solid))
        (nx, ny), (along, across) = found.shape, found.pixels
        size = f"{nx} × {ny} points of {along:.4g} m × {across:.4g} m along and across the sliding"
        less = f"{100.0 * abs(own / radial - 1.0):.2g} % {'more' if own > radial else 'less'}"
        mean = f"{found.mean:.4g} Pa, which is no part of the field; the bonds at rest bear {setting.strength:.4g} Pa"
        rows = [("rms of the stress", f"{found.rms:.4g} Pa at amplitude 1"), ("map", size), ("mean of the map", mean)]
        energy = f"{own:.4g} J/m^2 at amplitude 1 of the map itself, {less} than that of its radial spectrum"
        rows.append(("stored energy", energy))
        if found.mask:
            rows.append(("inside of the contact", f"{found.inside:.1%} of the map"))
        if found.noise:
            noise = found.noise_energy(*solid)
            rows.append(("noise of the map", f"seems to store {noise:.3g} J/m^2, {noise / own:.1%} of that energy"))
        return rows


def _tag(value: object) -> str | None:
    """Class of a table or a part: random maps and a measured one have one name."""
    given = value if isinstance(value, dict) else {name: getattr(value, name, None) for name in ("model", "field")}
    model = given.get("model")
    if not isinstance(model, str):
        return None
    return "mapped[field]" if model == "mapped" and given.get("field") is not None else model


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
    Discriminator(_tag),
]
