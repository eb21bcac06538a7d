"""Terms of the effective work of adhesion, and the phases of a contact."""

import math
from typing import NamedTuple, Protocol

import numpy as np

from sim.laws.reversible import mean_stress_energy
from sim.parts.contact.control import Bodies
from sim.parts.exchange import Array


class Shares(Protocol):
    """Share of ``fluctuating`` that a contact of finite radius pays, as ``sim.spectrum.finite_contact.Margin``."""

    def __call__(self, radius: Array) -> Array:
        """Share of new contact at the edge, at contact radii [m]."""

    def mean(self, radius: Array) -> Array:
        """Mean of the share over the area of the disc."""

    def at(self, position: Array) -> "Shares":
        """The shares at positions of the slider [m]."""

    @property
    def least(self) -> Array | float:
        """The lowest share at any radius, 0 where none is negative."""

    @property
    def each(self) -> list[tuple[tuple[float, float, float], tuple[float, float, float], Array]]:
        """Inputs of ``share_of``, one for each position or one for all."""

    @property
    def terms(self) -> tuple[tuple[float, float, float], tuple[float, float, float], Array]:
        """Those of a single position."""


class Balance(NamedTuple):
    """Inputs of the contact at one step, or at each step of a block.

    Attributes
    ----------
    bonded : array
        Work of adhesion of the bonds left, Δγ(fraction) [J/m²].
    fluctuating : array
        Energy of the shear-stress fluctuations that adhesion pays, waves being short beside the contact: χ ΔΓ [J/m²].
    stress : array
        Magnitude of the mean shear stress τ0 [Pa].
    margin : Shares, optional
        Share of ``fluctuating`` that a contact of finite radius [m] pays when it grows [1].
    bodies : Bodies
        Sphere and half-space.
    reference : float
        Work of adhesion at rest [J/m²], the unit of G − w in crack-front kinetics.
    """

    bonded: Array
    fluctuating: Array
    stress: Array
    margin: Shares | None
    bodies: Bodies
    reference: float

    def at(self, k: int) -> "Balance":
        """The terms at the end of step k of a block."""
        stress = self.stress[k] if self.stress.ndim > 1 else self.stress
        return self._replace(bonded=self.bonded[k], fluctuating=self.fluctuating[k], stress=stress)

    def without_stress(self) -> "Balance":
        """The terms without that of the mean stress."""
        return self._replace(stress=np.zeros(1))

    def work(self, radius: Array) -> Array:
        """Work of adhesion left at a radius, before the mean stress takes its share [J/m²]."""
        if self.margin is None:
            return self.bonded - self.fluctuating
        return self.bonded - self.fluctuating * self.margin(radius)

    def reversible(self, radius: Array) -> Array:
        """Energy per area that the mean stress would give back if the contact shrank [J/m²].

        6 τ0² a/(π E*) for an incompressible half-space.
        """
        _, modulus, poisson_ratio = self.bodies
        return np.asarray(mean_stress_energy(radius, self.stress, modulus, poisson_ratio))

    def gained(self, radius: Array, reversible: float) -> Array:
        """Energy that adhesion has given for the area of a contact: ∫ w dA over its radii [J]."""
        share = 1.0 if self.margin is None else self.margin.mean(radius)
        mean = 2.0 / 3.0 * reversible * self.reversible(radius)
        return math.pi * radius**2 * (self.bonded - self.fluctuating * share - mean)


#: A contact before its first touch, in touch, and after a pull-off.
AHEAD, CLOSED, OPEN = 0.0, 1.0, 2.0
#: Columns of the phases of reference contacts.
JKR, BONDS_ONLY, NO_MEAN_STRESS, EQUILIBRIUM = range(4)
