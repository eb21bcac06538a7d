"""Load control, displacement control, or displacement behind a stiffness; and the JKR contact under each.

What is controlled is a number at one time, an array of shape (times, 1) at many.

Each control gives the stable equilibrium for a work of adhesion and, for any radius, the load, the indentation
and the energy. Radii are arrays, shape (1,) or (members,), nan where the contact is open.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim.laws import jkr
from sim.laws.reversible import (
    radius_at_displacement_reversible,
    radius_at_indentation_reversible,
    radius_at_load_reversible,
)
from sim.parts.exchange import Array, Flags, Mount


class Bodies(NamedTuple):
    """Radius R of the sphere [m], contact modulus E* [Pa] and Poisson ratio of the half-space [1]."""

    sphere_radius: float
    modulus: float
    poisson_ratio: float


def elastic_energy(radius: Array, indentation: Array, bodies: Bodies) -> Array:
    """Elastic energy of a contact of any radius a and indentation δ [J].

    ``E* (a δ² − 2 a³ δ/(3R) + a⁵/(5R²))``: its slope over δ is the load, over the area the energy release
    rate G with the sign turned (Maugis 2000).
    """
    a, curvature = radius, 1.0 / bodies.sphere_radius
    third = a**3 * curvature
    return bodies.modulus * (a * indentation**2 - 2.0 / 3.0 * third * indentation + 0.2 * third * a**2 * curvature)


@dataclass(frozen=True)
class LoadControl:
    """Dead load, compression positive [N]."""

    load: float | Array

    @property
    def mount(self) -> Mount:
        """Load and base that hold the sphere."""
        return Mount(self.load, 0.0, 0.0)

    @property
    def closes(self) -> bool | Flags:
        """True if a detached sphere comes back into contact: where the load is not tensile."""
        return self.load >= 0.0

    def radius(self, work: Array, stress: Array, reversible: float, bodies: Bodies) -> Array:
        """Largest stable equilibrium radius [m]; Hertz's where no work of adhesion is left; nan without one."""
        if reversible == 0.0:
            return np.asarray(jkr.radius_at_load(self.load, work, *bodies[:2]))
        return np.asarray(radius_at_load_reversible(self.load, work, stress, reversible, *bodies))

    def normal_load(self, radius: Array, bodies: Bodies) -> Array:
        """Load on the sphere [N]; 0 where the contact is open."""
        return np.where(np.isnan(radius), 0.0, self.load)

    def indentation(self, radius: Array, bodies: Bodies) -> Array:
        """Indentation [m]; nan where the contact is open, since a dead load does not place the sphere."""
        return np.asarray(jkr.indentation_under_load(radius, self.load, bodies.sphere_radius, bodies.modulus))

    def displacement(self, radius: Array, bodies: Bodies) -> Array:
        """Displacement of the base [m]: the indentation, without a spring between."""
        return self.indentation(radius, bodies)

    def energy(self, radius: Array, gained: Array, bodies: Bodies) -> Array:
        """Energy of this contact above that of a free sphere that just touches [J]: elastic, of the load, of adhesion.

        0 under tension, where it is not defined: the free sphere moves away.
        """
        radius = np.where(self.closes, radius, np.nan)
        indentation = self.indentation(radius, bodies)
        energy = elastic_energy(radius, indentation, bodies) - self.load * indentation - gained
        return np.where(self.closes, energy, 0.0)


@dataclass(frozen=True)
class DisplacementControl:
    """Displacement of the base [m] behind a stiffness [N/m]; an infinite stiffness makes it the indentation."""

    base: float | Array
    stiffness: float = math.inf

    @property
    def mount(self) -> Mount:
        """Load and base that hold the sphere."""
        return Mount(0.0, self.base, self.stiffness)

    @property
    def closes(self) -> bool | Flags:
        """True if a detached sphere comes back into contact: at a displacement of zero or more."""
        return self.base >= 0.0

    def radius(self, work: Array, stress: Array, reversible: float, bodies: Bodies) -> Array:
        """Largest stable equilibrium radius [m]; Hertz's where no work of adhesion is left; nan without one."""
        rigid, held = math.isinf(self.stiffness), (self.base, self.stiffness)
        if reversible == 0.0 and rigid:
            return np.asarray(jkr.radius_at_indentation(self.base, work, *bodies[:2]))
        if reversible == 0.0:
            return np.asarray(jkr.radius_at_displacement(*held, work, *bodies[:2]))
        if rigid:
            return np.asarray(radius_at_indentation_reversible(self.base, work, stress, reversible, *bodies))
        return np.asarray(radius_at_displacement_reversible(*held, work, stress, reversible, *bodies))

    def normal_load(self, radius: Array, bodies: Bodies) -> Array:
        """Load on the sphere [N]; 0 where the contact is open."""
        load = jkr.load_under_displacement(radius, self.base, self.stiffness, *bodies[:2])
        return np.where(np.isnan(radius), 0.0, load)

    def indentation(self, radius: Array, bodies: Bodies) -> Array:
        """Indentation [m]; the displacement of the base where the contact is open and the spring unloaded."""
        found = jkr.indentation_under_displacement(radius, self.base, self.stiffness, *bodies[:2])
        return np.where(np.isnan(radius), self.base, found)

    def displacement(self, radius: Array, bodies: Bodies) -> Array:
        """Displacement of the base [m]."""
        return self.base + np.zeros(radius.shape)

    def energy(self, radius: Array, gained: Array, bodies: Bodies) -> Array:
        """Energy of this contact above that of an open one [J]: elastic, of the spring, and of adhesion."""
        indentation = self.indentation(radius, bodies)
        spring = 0.0 if math.isinf(self.stiffness) else 0.5 * self.stiffness * (self.base - indentation) ** 2
        return elastic_energy(radius, indentation, bodies) + spring - gained


Control = LoadControl | DisplacementControl
