"""The contact: which radius follows from the work of adhesion that is left. Here: equilibrium.

Every depth of this part can be held at a load or at an indentation; ``_Held`` is where the other
controls belong.
"""

from dataclasses import dataclass as plain_dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.laws import jkr
from sim.quantity import Quantity


@plain_dataclass(frozen=True)
class Touch:
    """State of the contact: work of adhesion left [J/m^2] and radius [m], nan where it is open."""

    work: np.ndarray
    radius: np.ndarray


@dataclass(frozen=True, config={"extra": "forbid"})
class _Held:
    """What holds the sphere: a load, or an indentation; exactly one."""

    load: Annotated[float, Quantity("N", "normal load, compression positive", "P")] | None = None
    indentation: Annotated[float, Quantity("m", "indentation of the sphere", "delta")] | None = None

    @model_validator(mode="after")
    def _one_control(self) -> "_Held":
        if self.load is None and self.indentation is None:
            raise PydanticCustomError(
                "control", 'nothing holds the sphere; give a load such as "4 mN", or an indentation such as "2 um"'
            )
        if self.load is not None and self.indentation is not None:
            raise PydanticCustomError(
                "control", "a load and an indentation cannot both hold the sphere; leave one of them out"
            )
        return self

    def equilibrium_radius(self, work: np.ndarray, sphere_radius: float, modulus: float) -> np.ndarray:
        """JKR radius for a work of adhesion; Hertz where it is zero or less; nan without equilibrium."""
        if self.load is not None:
            return np.asarray(jkr.radius_at_load(self.load, work, sphere_radius, modulus))
        return np.asarray(jkr.radius_at_indentation(self.indentation, work, sphere_radius, modulus))

    def normal_load(self, radius: np.ndarray, sphere_radius: float, modulus: float) -> np.ndarray:
        """Load on the sphere, compression positive [N]; 0 where the contact is open."""
        if self.load is not None:
            return np.where(np.isnan(radius), 0.0, self.load)
        load = jkr.load_under_indentation(radius, self.indentation, sphere_radius, modulus)
        return np.where(np.isnan(radius), 0.0, load)

    def depth(self, radius: np.ndarray, sphere_radius: float, modulus: float) -> np.ndarray:
        """Indentation [m]; nan where an open contact leaves the sphere without a place."""
        if self.indentation is not None:
            return np.full(radius.shape, self.indentation)
        return np.asarray(jkr.indentation_under_load(radius, self.load, sphere_radius, modulus))


@dataclass(frozen=True, config={"extra": "forbid"})
class Equilibrium(_Held):
    """The contact is in JKR equilibrium with the work of adhesion at every step, on its stable branch.

    Where no equilibrium is left the contact detaches and stays open: nothing brings a sphere back
    that tension has pulled off.
    """

    model: Literal["equilibrium"] = "equilibrium"

    def start(self, work: np.ndarray, sphere_radius: float, modulus: float) -> Touch:
        return Touch(work, self.equilibrium_radius(work, sphere_radius, modulus))

    def advance(self, touch: Touch, work: np.ndarray, sphere_radius: float, modulus: float) -> Touch:
        radius = self.equilibrium_radius(work, sphere_radius, modulus)
        return Touch(work, np.where(np.isnan(touch.radius), np.nan, radius))


Contact = Equilibrium
