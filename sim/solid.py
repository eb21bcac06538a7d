"""Elastic solids under the sphere: all that the contact, the slider and the fluctuations need of elasticity.

A solid of another kind, such as a layer, is one more class here. The parts of a scene read its members alone, so that
nothing else has to know which solid it is.
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from sim.laws import equilibrium, halfspace, jkr, layer, reversible
from sim.spectrum.family import Array, Family, Stress
from sim.spectrum.radial import Softness

#: Load on a sphere [N], displacement of the base [m] and stiffness behind it [N/m], 0 under a load.
Mount = tuple[ArrayLike, ArrayLike, float]


class ElasticSolid(Protocol):
    """Elastic solid that is isotropic along its surface; frozen and hashable, because caches use it as a key.

    All compliances are inversely proportional to the shear modulus. Shear stress and displacement are along x, the
    direction of sliding.
    """

    def __hash__(self) -> int:
        return super().__hash__()

    #: G [Pa] and nu [1] of the material.
    shear_modulus: float
    poisson_ratio: float

    @property
    def half_space(self) -> "HalfSpace":
        """The half-space that contacts and waves much smaller than any length of the solid feel."""

    @property
    def held_ratio(self) -> float:
        """Poisson ratio at which ``half_space`` without normal stress is as compliant as at held displacement [1]."""
        return self.half_space.held_ratio

    @property
    def unit(self) -> "ElasticSolid":
        """This solid at a shear modulus of 1 Pa, for results that many moduli share."""

    @property
    def under_circle(self) -> "ElasticSolid":
        """This solid under a sphere with the profile of a circle, if that is known."""
        return self

    @property
    def contact_modulus(self) -> float:
        """E* of the normal contact with a sphere [Pa]."""

    @property
    def inverse_thickness(self) -> float:
        """1/h of a layer [1/m], 0 of a half-space: the third number of a solid in compiled loops.

        It is ``equilibrium.CIRCLE`` of a half-space under the profile of a circle.
        """

    @property
    def softness(self) -> Softness:
        """Compliance of waves far shorter than any length of the solid, with which finite discs are computed."""
        return self.half_space.softness

    def radius(self, mount: Mount, work: ArrayLike, sphere_radius: float) -> Array:
        """Return the largest stable contact radius [m]: Hertz's if the work [J/m²] is not positive, nan if open."""

    def load(self, radius: ArrayLike, mount: Mount, sphere_radius: float) -> Array:
        """Return the load of any contact of a radius, in equilibrium or not [N]."""

    def indentation(
        self, radius: ArrayLike, mount: Mount, sphere_radius: float
    ) -> Array:
        """Return the indentation of any contact of a radius, in equilibrium or not [m]."""

    def contact_energy(
        self, radius: ArrayLike, indentation: ArrayLike, sphere_radius: float
    ) -> Array:
        """Return the elastic energy of a contact of any radius and indentation [J].

        Its slope over the indentation is the load. That over the area is the energy release rate, because a contact
        that shrinks releases what it stores.
        """

    def heights(
        self, r: Array, radius: float, indentation: float, sphere_radius: float
    ) -> tuple[Array, Array]:
        """Return the heights of a half-space and of the sphere at distances from the axis of a contact [m]."""
        shape = r, radius, indentation, sphere_radius
        surface = -halfspace.normal_displacement(*shape)
        return surface, surface + halfspace.gap(*shape)

    def normal_stiffness(self, radius: float) -> float:
        """Return the change of the load with the indentation of a contact of fixed radius [N/m]."""

    def pull_off_load(self, work: float, sphere_radius: float) -> float:
        """Return the lowest load that a contact bears [N]."""

    def compliance(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Return the displacement per shear stress at wavevectors [m/Pa], 0 at q = 0.

        The normal displacement is held, because the sphere is smooth and does not yield to fluctuations.
        """

    def tangential_compliance(self, radius: ArrayLike) -> Array:
        """Return 1/k_t [m/N]: the mean displacement of a disc of a radius [m] over the force of a uniform stress.

        There is no normal stress, because the sphere is free to rise.
        """

    def mean_stress_energy(self, radius: ArrayLike, stress: ArrayLike) -> Array:
        """Return the energy per new area of a disc of a radius [m] under a uniform shear stress [Pa], in J/m²."""

    def mean_stress_density(self, radius: ArrayLike, stress: ArrayLike) -> Array:
        """Return the energy of a disc of a radius [m] under a uniform shear stress [Pa] over its area, in J/m²."""

    def stored_energy(self, stress: Stress) -> float:
        """Return the mean elastic energy per area under a fluctuating shear stress on the plane [J/m²], ΔΓ."""
        return 0.5 * stress.total(self.compliance)

    def share_of_long_waves(self, spectrum: Family, wavelength: float) -> float:
        """Return the share of ``stored_energy`` that waves longer than a wavelength [m] store [1], 0 of no energy.

        Examples
        --------
        The share of a Gaussian of length ξ on a half-space is erf(πξ/λ):

        >>> from sim.spectrum import Gaussian
        >>> share = HalfSpace(1.0).share_of_long_waves(Gaussian(rms=1.0, length=1.0), 4.0)
        >>> print(f"{share:.10f} {math.erf(math.pi / 4.0):.10f}")
        0.7333114256 0.7333114256
        """
        plane, end = self.stored_energy(spectrum), 2.0 * math.pi / wavelength
        return 0.5 * spectrum.total(self.compliance, end) / plane if plane else 0.0


@dataclass(frozen=True)
class HalfSpace(ElasticSolid):
    """Elastic half-space under a rigid sphere, or the half-space that is as compliant as two elastic bodies together.

    Parameters
    ----------
    shear_modulus : float
        G [Pa].
    poisson_ratio : float
        nu [1].
    coupling : float, optional
        Relative normal displacement per shear stress along its wave, times G q [1], ``laws.halfspace.coupling``. By
        default (1 - 2 nu)/2, that of one body. At 0 nothing is coupled, as between two equal bodies.

    Notes
    -----
    ``ΔΓ = (1/8π²) ∫ d²q C (1 - ν_h qx²/q²) / (G q)`` of a spectrum C (Menga, Carbone & Dini at ν = 1/2), with the
    ``held_ratio`` ν_h = ν + coupling²/(1 - ν), because the sphere holds the normal displacement.

    Examples
    --------
    Patches of a stress of 1 MPa on a soft rubber, and a finer pattern, which stores less energy:

    >>> from sim.spectrum import Gaussian
    >>> rubber = HalfSpace(shear_modulus=1.6e6)
    >>> energies = (rubber.stored_energy(Gaussian(rms=1e6, length=size)) for size in (1e-6, 1e-8))
    >>> print(*(f"{1e3 * energy:.1f} mJ/m^2" for energy in energies))
    207.7 mJ/m^2 2.1 mJ/m^2
    """

    shear_modulus: float
    poisson_ratio: float = 0.5
    coupling: float | None = None

    @property
    def half_space(self) -> "HalfSpace":
        return self

    @property
    def held_ratio(self) -> float:
        coupling = self.coupling
        if coupling is None:
            coupling = halfspace.coupling(1.0, self.poisson_ratio)
        return halfspace.held_ratio(self.poisson_ratio, coupling)

    @property
    def under_circle(self) -> "UnderCircle":
        return UnderCircle(self.shear_modulus, self.poisson_ratio)

    @property
    def unit(self) -> "HalfSpace":
        return replace(self, shear_modulus=1.0)

    @property
    def contact_modulus(self) -> float:
        """E* = 2G/(1 - nu) [Pa]; 4G of an incompressible half-space."""
        return 2.0 * self.shear_modulus / (1.0 - self.poisson_ratio)

    @property
    def inverse_thickness(self) -> float:
        return 0.0

    def radius(self, mount: Mount, work: ArrayLike, sphere_radius: float) -> Array:
        load, base, stiffness = mount
        if stiffness == 0.0:
            return np.asarray(
                jkr.radius_at_load(load, work, sphere_radius, self.contact_modulus)
            )
        numbers = base, stiffness, work, sphere_radius, self.contact_modulus
        return np.asarray(jkr.radius_at_displacement(*numbers))

    def load(self, radius: ArrayLike, mount: Mount, sphere_radius: float) -> Array:
        load, base, stiffness = mount
        if stiffness == 0.0:
            return np.asarray(load)
        numbers = radius, base, stiffness, sphere_radius, self.contact_modulus
        return np.asarray(jkr.load_under_displacement(*numbers))

    def indentation(
        self, radius: ArrayLike, mount: Mount, sphere_radius: float
    ) -> Array:
        (load, base, stiffness), modulus = mount, self.contact_modulus
        if stiffness == 0.0:
            numbers = radius, load, sphere_radius, modulus
            return np.asarray(jkr.indentation_under_load(*numbers))
        return np.asarray(
            jkr.indentation_under_displacement(
                radius, base, stiffness, sphere_radius, modulus
            )
        )

    def contact_energy(
        self, radius: ArrayLike, indentation: ArrayLike, sphere_radius: float
    ) -> Array:
        """``E* (a δ² − 2 a³ δ/(3R) + a⁵/(5R²))`` (Maugis 2000)."""
        a, depth, curvature = (
            np.asarray(radius),
            np.asarray(indentation),
            1.0 / sphere_radius,
        )
        third = a**3 * curvature
        return self.contact_modulus * (
            a * depth**2 - 2.0 / 3.0 * third * depth + 0.2 * third * a**2 * curvature
        )

    def normal_stiffness(self, radius: float) -> float:
        return 2.0 * self.contact_modulus * radius

    def pull_off_load(self, work: float, sphere_radius: float) -> float:
        return float(jkr.pull_off_load(work, sphere_radius))

    @property
    def softness(self) -> Softness:
        """Compliance of waves of any length."""
        level, swing = halfspace.angular_compliance(self.held_ratio)
        return Softness(level / self.shear_modulus, swing / self.shear_modulus)

    def compliance(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        return np.asarray(
            halfspace.compliance(qx, qy, self.shear_modulus, self.held_ratio)
        )

    def tangential_compliance(self, radius: ArrayLike) -> Array:
        slope = (
            4.0 * (2.0 - self.poisson_ratio) / (3.0 * math.pi**2 * self.shear_modulus)
        )
        return slope / np.asarray(radius)

    def mean_stress_energy(self, radius: ArrayLike, stress: ArrayLike) -> Array:
        return np.asarray(
            reversible.mean_stress_energy(
                radius, stress, self.contact_modulus, self.poisson_ratio
            )
        )

    def mean_stress_density(self, radius: ArrayLike, stress: ArrayLike) -> Array:
        return 2.0 / 3.0 * self.mean_stress_energy(radius, stress)

    def stored_energy(self, stress: Stress) -> float:
        return float(self.softness.energy(stress))


class _Searched(ElasticSolid):
    """Solid whose contacts have no closed form: a search of ``sim.laws.equilibrium`` finds them."""

    thickness: float

    def radius(self, mount: Mount, work: ArrayLike, sphere_radius: float) -> Array:
        numbers = *mount, work, sphere_radius, self.contact_modulus, self.thickness
        return np.asarray(equilibrium.radius_on_layer(*numbers))

    def load(self, radius: ArrayLike, mount: Mount, sphere_radius: float) -> Array:
        numbers = *mount, sphere_radius, self.contact_modulus, self.thickness
        return np.asarray(equilibrium.load_on_layer(radius, *numbers))

    def indentation(
        self, radius: ArrayLike, mount: Mount, sphere_radius: float
    ) -> Array:
        numbers = *mount, sphere_radius, self.contact_modulus, self.thickness
        return np.asarray(equilibrium.indentation_on_layer(radius, *numbers))

    def contact_energy(
        self, radius: ArrayLike, indentation: ArrayLike, sphere_radius: float
    ) -> Array:
        numbers = sphere_radius, self.contact_modulus, self.thickness
        return np.asarray(equilibrium.energy_on_layer(radius, indentation, *numbers))

    def pull_off_load(self, work: float, sphere_radius: float) -> float:
        numbers = sphere_radius, self.contact_modulus, self.thickness
        return float(equilibrium.pull_off_load_on_layer(work, *numbers))


@dataclass(frozen=True)
class UnderCircle(_Searched, HalfSpace):
    """Elastic half-space under a rigid sphere that is no parabola. Limit: half-space, for contacts much smaller.

    Examples
    --------
    A sphere needs a larger load than a parabola for a contact of 0.4 of its radius:

    >>> mounts = (0.0, 0.16, math.inf), (0.0, 0.4 * math.atanh(0.4), math.inf)
    >>> solids = HalfSpace(1.0), UnderCircle(1.0)
    >>> print(*(f"{solid.load(0.4, mount, 1.0):.4f}" for solid, mount in zip(solids, mounts)))
    0.3413 0.3657
    """

    thickness: float = equilibrium.CIRCLE

    @property
    def inverse_thickness(self) -> float:
        return equilibrium.CIRCLE

    def heights(
        self, r: Array, radius: float, indentation: float, sphere_radius: float
    ) -> tuple[Array, Array]:
        """``u_z = (2/π) ∫ (δ - s artanh(s/R))/√(r² - s²) ds`` over s from 0 to r or a, Gauss's with 64 nodes."""
        nodes, weights = np.polynomial.legendre.leggauss(64)
        r = np.asarray(r, dtype=float)
        end = np.arcsin(np.minimum(radius / np.maximum(r, 1e-300), 1.0))
        along = r[..., np.newaxis] * np.sin(0.5 * end[..., np.newaxis] * (1.0 + nodes))
        depth = indentation - along * np.arctanh(along / sphere_radius)
        inside = r <= radius
        # a sphere ends at its equator
        reach = np.minimum(r / sphere_radius, 1.0)
        sphere = sphere_radius * reach**2 / (1.0 + np.sqrt(1.0 - reach**2))
        sphere -= indentation
        surface = -np.sum(weights * depth, axis=-1) * end / math.pi
        return np.where(inside, sphere, surface), sphere


@dataclass(frozen=True)
class Layer(_Searched):
    """Incompressible elastic layer bonded to a rigid base, under a rigid sphere. Limit: half-space as h -> infinity.

    Parameters
    ----------
    shear_modulus, thickness : float
        G [Pa], h [m].

    Notes
    -----
    A sphere that touches a disc of ``a`` up to 80 h is computed to 1e-10 (``laws.layer``). The compliance of waves is
    that at held normal displacement, so that waves longer than h store much less than on a half-space.

    Examples
    --------
    Patches much wider than a layer store less energy, because the base holds it:

    >>> from sim.spectrum import Gaussian
    >>> energies = (Layer(1.6e6, h).stored_energy(Gaussian(rms=1e6, length=1e-6)) for h in (1e-3, 1e-6, 1e-7))
    >>> print(*(f"{1e3 * energy:.1f} mJ/m^2" for energy in energies))
    207.6 mJ/m^2 122.7 mJ/m^2 19.3 mJ/m^2
    """

    shear_modulus: float
    thickness: float

    @property
    def poisson_ratio(self) -> float:  # type: ignore[override]
        return 0.5

    @property
    def half_space(self) -> HalfSpace:
        return HalfSpace(self.shear_modulus)

    @property
    def unit(self) -> "Layer":
        return replace(self, shear_modulus=1.0)

    @property
    def contact_modulus(self) -> float:
        """4G [Pa], E* of a layer much thicker than the contact is wide."""
        return 4.0 * self.shear_modulus

    @property
    def inverse_thickness(self) -> float:
        return 1.0 / self.thickness

    def compliance(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        return np.asarray(layer.compliance(qx, qy, self.thickness, self.shear_modulus))

    def normal_stiffness(self, radius: float) -> float:
        flat = layer.contact_function(layer.G_1, radius / self.thickness)
        return 2.0 * self.contact_modulus * radius * float(flat)

    def tangential_compliance(self, radius: ArrayLike) -> Array:
        numbers = self.shear_modulus, self.thickness
        return np.asarray(layer.tangential_compliance(radius, *numbers))

    def mean_stress_energy(self, radius: ArrayLike, stress: ArrayLike) -> Array:
        numbers = self.shear_modulus, self.thickness
        return np.asarray(layer.mean_stress_energy(radius, stress, *numbers))

    def mean_stress_density(self, radius: ArrayLike, stress: ArrayLike) -> Array:
        force = math.pi * np.asarray(radius) ** 2 * np.square(stress)
        size = np.where(force > 0.0, radius, 1.0)
        return 0.5 * force * self.tangential_compliance(size)
