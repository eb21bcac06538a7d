"""Terms of the effective work of adhesion, and the equilibrium of a contact with them.

A contact is under load control, displacement control, or displacement behind a stiffness. The control is a number at
one time, an array of shape (times, 1) at many. Each control gives the stable equilibrium for a work of adhesion. It
also gives the load, the indentation and the energy at any radius. Radii are arrays, shape (1,) or (members,), nan if
the contact is open. The work of adhesion at that radius matters to those controls alone whose adhesion has a range,
``sim.parts.contact.cohesive``.

On a disc the share of ΔΓ that the contact pays is not convex in its radius, so neither Newton's method nor a
fixed-point iteration is safe. A walk inwards starts from the radius without fluctuations. Between the two places where
the sign changes the Pegasus method goes down to rounding. If the walk meets no crossing, the least surplus along it is
searched, because two crossings may lie between two places. There are none if the surplus falls down to Hertz's radius.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from sim.laws.equilibrium import largest_radius, surplus
from sim.numerics.jit import device, kernel
from sim.parts.exchange import Array, Flags, Mount
from sim.solid import ElasticSolid
from sim.spectrum.radial import Terms, share_of


class Bodies(NamedTuple):
    """Radius R of the sphere [m], and the solid that it touches."""

    sphere_radius: float
    solid: ElasticSolid

    @property
    def modulus(self) -> float:
        """Contact modulus E* [Pa]."""
        return self.solid.contact_modulus

    @property
    def numbers(self) -> tuple[float, float, float]:
        """R [m], E* [Pa] and ν [1], as the closed forms of a sphere on a half-space take them."""
        return self.sphere_radius, self.modulus, self.solid.poisson_ratio

    @property
    def body(self) -> tuple[float, float, float]:
        """1/R [1/m], E* [Pa] and 1/h [1/m], as ``sim.laws.equilibrium.punch`` takes them."""
        return 1.0 / self.sphere_radius, self.modulus, self.solid.inverse_thickness


def elastic_energy(radius: Array, indentation: Array, bodies: Bodies) -> Array:
    """Return the elastic energy of a contact of any radius and indentation [J]."""
    return bodies.solid.contact_energy(radius, indentation, bodies.sphere_radius)


class _Holding(Protocol):
    """Attributes of both controls."""

    @property
    def mount(self) -> Mount:
        """Load and base that hold the sphere."""

    @property
    def closes(self) -> bool | Flags:
        """True if a detached sphere comes back into contact."""

    def touches(self, work: Array) -> bool | Flags:
        """Return ``closes``, whatever the work of adhesion."""
        return self.closes

    def radius(self, work: Array, bodies: Bodies) -> Array:
        """Return the radius in equilibrium [m]: Hertz's if no work of adhesion is left, nan without an equilibrium."""
        return bodies.solid.radius(self.mount, work, bodies.sphere_radius)


@dataclass(frozen=True)
class LoadControl(_Holding):
    """Dead load, compression positive [N]."""

    load: float | Array

    @property
    def mount(self) -> Mount:
        """Load and base that hold the sphere."""
        return Mount(self.load, 0.0, 0.0)

    @property
    def closes(self) -> bool | Flags:
        """True if a detached sphere comes back into contact, because the load is not tensile."""
        return self.load >= 0.0

    def normal_load(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the load on the sphere [N]; 0 if the contact is open."""
        return np.where(np.isnan(radius), 0.0, self.load)

    def indentation(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the indentation [m]; nan if the contact is open, because a dead load does not place the sphere."""
        return bodies.solid.indentation(radius, self.mount, bodies.sphere_radius)

    def displacement(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the displacement of the base [m], which is the indentation without a spring."""
        return self.indentation(radius, bodies)

    def energy(
        self,
        radius: Array,
        gained: Array,
        bodies: Bodies,
        work: Array | None = None,
    ) -> Array:
        """Return the energy of this contact above that of a free sphere that just touches [J].

        It is elastic, of the load and of adhesion. Under tension it is not defined, because the free sphere moves away,
        and 0 is returned. It is 0 for a contact of radius 0, too.
        """
        radius = np.where(self.closes & (radius > 0.0), radius, np.nan)
        indentation = self.indentation(radius, bodies)
        energy = (
            elastic_energy(radius, indentation, bodies)
            - self.load * indentation
            - gained
        )
        return np.where(np.isnan(radius), 0.0, energy)


@dataclass(frozen=True)
class DisplacementControl(_Holding):
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

    def normal_load(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the load on the sphere [N]; 0 if the contact is open."""
        load = bodies.solid.load(radius, self.mount, bodies.sphere_radius)
        return np.where(np.isnan(radius), 0.0, load)

    def indentation(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the indentation [m]; if the contact is open, the displacement of the base of the unloaded spring."""
        closed = bodies.solid.indentation(radius, self.mount, bodies.sphere_radius)
        return np.where(np.isnan(radius), self.base, closed)

    def displacement(
        self, radius: Array, bodies: Bodies, work: Array | None = None
    ) -> Array:
        """Return the displacement of the base [m]."""
        return self.base + np.zeros(radius.shape)

    def energy(
        self,
        radius: Array,
        gained: Array,
        bodies: Bodies,
        work: Array | None = None,
    ) -> Array:
        """Return the energy of this contact above that of an open one [J]: elastic, of the spring, and of adhesion."""
        indentation = self.indentation(radius, bodies)
        spring = (
            0.0
            if math.isinf(self.stiffness)
            else 0.5 * self.stiffness * (self.base - indentation) ** 2
        )
        return elastic_energy(radius, indentation, bodies) + spring - gained


Control = LoadControl | DisplacementControl


#: Type of ``Terms`` in kernels.
SHARE = "Tuple((UniTuple(float64, 3), UniTuple(float64, 3), float64[:, ::1]))"


class Shares(Protocol):
    """Share of ``fluctuating`` that a contact of finite radius pays, as ``sim.spectrum.radial.Margin``."""

    def __call__(self, radius: Array) -> Array:
        """Return the share of new contact at the edge, at contact radii [m]."""

    def mean(self, radius: Array) -> Array:
        """Return the mean of the share over the area of the disc."""

    def at(self, position: Array) -> "Shares":
        """Return the shares at positions of the slider [m]."""

    @property
    def least(self) -> Array | float:
        """The lowest share at any radius, 0 if none is negative."""

    @property
    def each(self) -> list[Terms]:
        """Inputs of ``share_of`` at each position, or once for all positions."""


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
        Sphere and solid.
    reference : float
        Work of adhesion at rest [J/m²], the unit of G − w in crack-front kinetics.
    """

    bonded: Array
    fluctuating: Array
    stress: Array
    margin: Shares | None
    bodies: Bodies
    reference: float

    def without_stress(self) -> "Balance":
        """Return the terms without that of the mean stress."""
        return self._replace(stress=np.zeros(1))

    def work(self, radius: Array) -> Array:
        """Return the work of adhesion left at a radius, before the mean stress reduces it [J/m²]."""
        if self.margin is None:
            return self.bonded - self.fluctuating
        return self.bonded - self.fluctuating * self.margin(radius)

    def reversible(self, radius: Array) -> Array:
        """Return the energy per area that the mean stress would release if the contact shrank [J/m²].

        It is 6 τ0² a/(π E*) for an incompressible half-space, and τ0² h/(2G) for a thin layer.
        """
        return self.bodies.solid.mean_stress_energy(radius, self.stress)

    @property
    def tilt(self) -> Array:
        """Energy per area that the mean stress of a contact of vanishing radius stores, over the radius [J/m³]."""
        half_space = self.bodies.solid.half_space
        return half_space.mean_stress_energy(np.ones(1), self.stress)

    def gained(self, radius: Array, reversible: float) -> Array:
        """Return the energy that adhesion has released for the area of a contact: ∫ w dA over its radii [J]."""
        share = 1.0 if self.margin is None else self.margin.mean(radius)
        mean = reversible * self.bodies.solid.mean_stress_density(radius, self.stress)
        return math.pi * radius**2 * (self.bonded - self.fluctuating * share - mean)


#: Phases of a contact: before its first touch, in touch, after a pull-off.
AHEAD, CLOSED, OPEN = 0.0, 1.0, 2.0
#: Columns of the phases of reference contacts.
JKR, BONDS_ONLY, NO_MEAN_STRESS, EQUILIBRIUM = range(4)

#: Places of the walk inwards, its end over its start, and turns that narrow an interval down to rounding.
_WALK, _NARROWEST, _TURNS = 128, 1e-4, 30
#: Distance to a neighbouring place, over the radius.
_NEXT = 1e-8


@device
def _surplus(radius, contact):
    """Return the energy release rate, negative below Hertz's radius, minus the work left at a radius [J/m²]."""
    (bonded, fluctuating, tilt), mount, body, (wave, ends, cubics) = contact
    share = share_of(radius, wave, ends, cubics)
    left = bonded - fluctuating * share - tilt * radius
    return surplus(radius, left, mount, body)


@device
def _dip(inside, outside, contact):
    """Return the radius between two others at which the surplus is least, by bisection of its slope."""
    for _ in range(_TURNS):
        middle = 0.5 * (inside + outside)
        if _surplus(middle * (1.0 + _NEXT), contact) > _surplus(middle, contact):
            outside = middle
        else:
            inside = middle
    return inside


@device
def _narrowed(inside, outside, contact):
    """Return the radius at which the surplus crosses zero between two others, to rounding: the Pegasus method."""
    low, high = _surplus(inside, contact), _surplus(outside, contact)
    for _ in range(_TURNS):
        change = high * (outside - inside) / (high - low)
        if not abs(change) > 2e-16 * outside:
            break
        place = outside - change
        over = _surplus(place, contact)
        if over * high < 0.0:
            inside, low = outside, high
        else:
            low *= high / (high + over)
        outside, high = place, over
    return outside


@device
def stable_radius(start, work, mount, body, share):
    """Return the largest stable radius of a contact [m], nan without one.

    ``start``: any radius above 0. ``work``: work of adhesion that is left at most, that of the intact bonds, and energy
    that many waves in the contact take [J/m²], and energy of the mean stress over the radius [J/m³]. ``mount`` and
    ``body`` as in ``sim.laws.equilibrium.largest_radius``. ``share``: a ``Share``, without cubics on the plane, where
    all of the energy is taken at any radius. On a disc the walk never goes below 1e-4 of its start.
    """
    most, bonded, fluctuating, tilt = work
    wide, _ = largest_radius(start, most, tilt, mount, body)
    if len(share[2]) == 0:
        return wide
    contact = (bonded, fluctuating, tilt), mount, body, share
    if not wide > 0.0 or fluctuating == 0.0 or _surplus(wide, contact) <= 0.0:
        return wide  # fluctuations do not reduce the work
    hertz, _ = largest_radius(start, 0.0, 0.0, mount, body)
    low = max(hertz if hertz > 0.0 else 0.0, _NARROWEST * wide)
    ratio = (low / wide) ** (1.0 / _WALK)
    outside, inside, least, lowest = wide, wide, math.inf, wide
    for k in range(1, _WALK + 1):
        outside, inside = inside, low if k == _WALK else inside * ratio
        value = _surplus(inside, contact)
        if value <= 0.0:
            return max(_narrowed(inside, outside, contact), low)
        if value < least:
            least, lowest = value, inside
    if lowest == low and _surplus(low * (1.0 + _NEXT), contact) >= least:
        return hertz
    dip = _dip(lowest * ratio, lowest / ratio, contact)
    if _surplus(dip, contact) <= 0.0:
        return max(_narrowed(dip, lowest / ratio, contact), low)
    return hertz


@kernel(f"void(float64[:, ::1], float64, UniTuple(float64, 3), {SHARE}, float64[::1])")
def stable_radii(contacts, stiffness, body, share, radius):
    """Write the largest stable radius of contacts to ``radius`` [m].

    Rows of ``contacts``: radius without fluctuations and mean stress [m], nan without equilibrium. Then the four of
    ``work`` in ``stable_radius``, load [N] and displacement of the base [m].
    """
    for i in range(radius.size):
        work = contacts[1, i], contacts[2, i], contacts[3, i], contacts[4, i]
        mount, start = (contacts[5, i], contacts[6, i], stiffness), contacts[0, i]
        if start > 0.0:
            radius[i] = stable_radius(start, work, mount, body, share)
        else:
            radius[i] = start
