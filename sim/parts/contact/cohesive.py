"""Contact whose adhesion has a finite range: Maugis & Dugdale's, in equilibrium at every step.

``sim.laws.cohesive`` has the formulas. The range of the attraction or its stress is a number of the interface. That
which a scenario gives is held as the work of adhesion falls, and the other one follows from the work that is left.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import model_validator
from pydantic_core import PydanticCustomError

from sim.laws import cohesive
from sim.parts.contact.balance import Bodies, Control, DisplacementControl, LoadControl
from sim.parts.contact.models import Equilibrium
from sim.parts.exchange import Array, Flags, Mount, Setting
from sim.units.quantity import Quantity, keyed


@dataclass(frozen=True)
class Attraction:
    """Attraction of two surfaces: its equilibrium distance z0 [m], or its stress [Pa]."""

    distance: float | None
    stress: float | None

    def stress_at(self, work: Array) -> Array:
        """Return the cohesive stress at a work of adhesion [Pa]."""
        if self.distance is None:
            return np.full(1, self.stress)
        return np.asarray(cohesive.stress_of_range(work, self.distance))

    def reach(self, work: Array) -> Array:
        """Return the gap up to which the surfaces attract each other at a work of adhesion [m], 0 without any."""
        with np.errstate(invalid="ignore"):
            gap = work / self.stress_at(work)
        return np.where(work > 0.0, gap, 0.0)

    def equilibrium(self, mount: Mount, work: Array, bodies: Bodies) -> cohesive.Touch:
        """Return the stable contact on a mount; nan without one."""
        body = work, self.stress_at(work), bodies.sphere_radius, bodies.modulus
        return cohesive.equilibrium(*mount, *body)

    def last(
        self, radius: Array, mount: Mount, work: Array, bodies: Bodies
    ) -> cohesive.Touch:
        """Return the contact of a radius on a mount, that at the fold if it has been lost; nan of an open one."""
        touch = self.equilibrium(mount, work, bodies)
        is_open = np.isnan(radius)
        if np.any(np.isnan(touch.outer) & ~is_open):
            body = work, self.stress_at(work), bodies.sphere_radius, bodies.modulus
            fold = cohesive.pull_off(mount.stiffness, *body)
            touch = cohesive.Touch(
                *(
                    np.where(np.isnan(touch.outer), lost, kept)
                    for kept, lost in zip(touch, fold, strict=True)
                )
            )
        return cohesive.Touch(*(np.where(is_open, np.nan, value) for value in touch))


class _WithRange:
    """Radii of a contact whose attraction has a range, under any control."""

    attraction: Attraction
    mount: Mount

    def radius(self, work: Array, bodies: Bodies) -> Array:
        """Return the inner radius [m]: Hertz's if no work of adhesion is left, nan without an equilibrium."""
        return self.attraction.equilibrium(self.mount, work, bodies).inner

    def outer_radius(self, radius: Array, bodies: Bodies, work: Array) -> Array:
        """Return the radius within which the surfaces attract each other [m]; nan if the contact is open."""
        return self.attraction.last(radius, self.mount, work, bodies).outer


@dataclass(frozen=True, kw_only=True)
class CohesiveLoad(_WithRange, LoadControl):
    """Dead load on a sphere whose attraction has a range."""

    attraction: Attraction

    def indentation(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the indentation [m]; nan if the contact is open or the work of adhesion unknown."""
        if work is None:
            return np.full(radius.shape, np.nan)
        return self.attraction.last(radius, self.mount, work, bodies).indentation

    def displacement(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the displacement of the base [m], which is the indentation without a spring."""
        return self.indentation(radius, bodies, work)

    def energy(
        self,
        radius: Array,
        gained: Array,
        bodies: Bodies,
        work: Array | None = None,
    ) -> Array:
        """Return the energy of this contact above that of a free sphere that just touches [J]; 0 under tension."""
        radius = np.where(self.closes, radius, np.nan)
        touch = self.attraction.last(radius, self.mount, np.asarray(work), bodies)
        return np.nan_to_num(touch.energy - self.load * touch.indentation)


@dataclass(frozen=True, kw_only=True)
class CohesiveDisplacement(_WithRange, DisplacementControl):
    """Displacement behind a stiffness, of a sphere whose attraction has a range."""

    attraction: Attraction

    def touches(self, work: Array) -> bool | Flags:
        """Return True if a detached sphere comes within the reach of the attraction."""
        return np.asarray(self.base >= -self.attraction.reach(work))

    def normal_load(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the load on the sphere [N]; 0 if the contact is open."""
        touch = self.attraction.last(radius, self.mount, np.asarray(work), bodies)
        return np.nan_to_num(touch.load)

    def indentation(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the indentation [m]; if the contact is open, the displacement of the base of the unloaded spring."""
        touch = self.attraction.last(radius, self.mount, np.asarray(work), bodies)
        return np.where(np.isnan(radius), self.base, touch.indentation)

    def energy(
        self,
        radius: Array,
        gained: Array,
        bodies: Bodies,
        work: Array | None = None,
    ) -> Array:
        """Return the energy of this contact above that of an open one [J]: half-space, interface and spring."""
        touch = self.attraction.last(radius, self.mount, np.asarray(work), bodies)
        return np.nan_to_num(touch.energy + 0.5 * touch.load**2 / self.stiffness)


@keyed(kw_only=True)
class Cohesive(Equilibrium):
    """The contact is in Maugis and Dugdale's equilibrium with the work of adhesion, on its stable branch.

    The surfaces attract each other with a constant stress up to a distance. They touch within the contact radius, on
    which friction acts, and attract each other up to ``outer_radius``. Without an equilibrium the contact pulls off.
    A detached sphere jumps in as soon as it comes within reach of the attraction, or under a load of zero or more.
    Limits: ``equilibrium``, which is JKR's, for a short range. For a long one Hertz's contact under 2 π w R more.
    """

    range: (
        Annotated[
            float,
            Quantity(
                "m", "equilibrium distance of the attraction, held", "z_0", above=0
            ),
        ]
        | None
    ) = None
    cohesive_stress: (
        Annotated[
            float, Quantity("Pa", "stress of the attraction, held", "σ_0", above=0)
        ]
        | None
    ) = None
    model: Literal["cohesive"] = "cohesive"  # type: ignore[assignment]

    theory: ClassVar[str] = "Maugis-Dugdale"
    takes_mean_stress: ClassVar[bool] = False

    @model_validator(mode="after")
    def _one_attraction(self) -> "Cohesive":
        if (self.range is None) == (self.cohesive_stress is None):
            count = "none is" if self.range is None else "both are"
            cure = 'write either range = "0.3 nm" or cohesive_stress = "0.2 GPa"'
            raise PydanticCustomError(
                "attraction",
                f"needs the range of the attraction or its stress, but {count} given: {cure}",
            )
        if self.reversible > 0.0:
            raise PydanticCustomError(
                "attraction",
                'a cohesive contact has no energy of the mean stress: omit reversible, or use model = "equilibrium"',
            )
        return self

    @cached_property
    def attraction(self) -> Attraction:
        """Range or stress of the attraction."""
        return Attraction(self.range, self.cohesive_stress)

    def faults(
        self, is_driven: bool, is_on_disc: bool, is_on_layer: bool
    ) -> dict[str, str]:
        faults = {}
        if is_driven:
            faults["model"] = (
                "a cohesive contact needs a known speed: prescribe drive.speed, or use"
                ' contact.model = "equilibrium"'
            )
        elif is_on_disc:
            faults["model"] = (
                "a cohesive contact knows no fluctuations on a disc: use"
                ' shear.contact = "plane", or contact.model = "equilibrium"'
            )
        elif is_on_layer:
            faults["model"] = (
                "a cohesive contact is known on a half-space only: omit solid.thickness,"
                ' or use contact.model = "equilibrium"'
            )
        return faults

    def remarks(self, setting: Setting) -> list[str]:
        remarks = [
            "A_JKR and jkr_radius are those of the cohesive contact with the full work of adhesion"
        ]
        if math.isnan(setting.rest_radius) and self.load is None:
            comes = "the contact begins open and jumps in where the sphere comes"
            never = (
                "the contact is open even with all its adhesion: the sphere never comes"
            )
            closes = max(self.course.extremes) >= -setting.reach
            remarks.append(
                f"{comes if closes else never} within reach of the attraction"
            )
        elif math.isnan(setting.rest_radius):
            remarks += super().remarks(setting)
        elif setting.rest_radius == 0.0:
            remarks.append(
                "the sphere begins within reach of the attraction, but does not touch"
            )
        if self.load is None:
            remarks += self._cut_short(setting)
        return remarks

    def pull_off_load(self, work: float, bodies: Bodies) -> float:
        stress = self.attraction.stress_at(np.full(1, work))
        body = bodies.sphere_radius, bodies.modulus
        load = cohesive.pull_off(0.0, work, stress, *body).load
        return float(np.nan_to_num(load[0]))

    def jump_in_distance(self, work: float) -> float:
        return float(self.attraction.reach(np.full(1, work))[0])

    def distances(self, work: float) -> tuple[float, float]:
        stress = self.attraction.stress_at(np.full(1, work))[0]
        distance = self.range or cohesive.LENNARD_JONES * work / stress
        return distance, distance

    def heights(
        self, r: Array, radius: float, work: float, bodies: Bodies
    ) -> tuple[Array, Array]:
        mount = self.control(0.0, 0.0).mount
        touch = self.attraction.equilibrium(mount, np.full(1, work), bodies)
        stress = self.attraction.stress_at(np.full(1, work))[0]
        touch = cohesive.Touch(*(values[0] for values in touch))
        surface = -cohesive.normal_displacement(
            r, touch, stress, bodies.sphere_radius, bodies.modulus
        )
        return surface, r**2 / (2.0 * bodies.sphere_radius) - touch.indentation

    def _control(self, value: float | Array) -> Control:
        if self.load is not None:
            return CohesiveLoad(value, attraction=self.attraction)
        stiffness = self.stiffness or math.inf
        return CohesiveDisplacement(value, stiffness, attraction=self.attraction)
