"""Bodies in contact, and models of the contact, whose radius follows from the work of adhesion left.

The bodies are the solid, the sphere pressed on it, and their adhesion. The models are equilibrium and rate-dependent.
Each is under a load, an indentation, or a displacement of the base behind a stiffness, each a number, a course or a
table. ``sim.parts.contact.balance`` has the contact under each.
"""

import math
from collections.abc import Callable
from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple, Protocol, cast

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import coupling, in_series
from sim.laws.limits import DISTANCES
from sim.numerics.jit import kernel
from sim.parts.contact.balance import (
    AHEAD,
    BONDS_ONLY,
    CLOSED,
    OPEN,
    Balance,
    Bodies,
    Control,
    DisplacementControl,
    LoadControl,
    Shares,
    stable_radii,
)
from sim.parts.contact.front import Kinetics, follow as follow_front
from sim.parts.exchange import TURN, Array, ContactState, Flags, Motion, Setting, during
from sim.solid import ElasticSolid, HalfSpace, Layer
from sim.spectrum.radial import PLANE
from sim.units.quantity import Quantity, keyed
from sim.units.tables import Prescribed, over_time, prescribed


@keyed()
class Body:
    """An elastic body, given by one of its two moduli.

    Parameters
    ----------
    shear_modulus, youngs_modulus : float or str, one of the two
        G or E [Pa].
    poisson_ratio : float
        nu [1].
    """

    shear_modulus: (
        Annotated[float, Quantity("Pa", "shear modulus", "G", above=0)] | None
    ) = None
    youngs_modulus: (
        Annotated[float, Quantity("Pa", "Young's modulus", "E", above=0)] | None
    ) = None
    poisson_ratio: Annotated[
        float, Quantity("1", "Poisson ratio", "nu", at_least=0, at_most=0.5)
    ] = 0.5

    @model_validator(mode="after")
    def _one_modulus(self) -> "Body":
        if (self.shear_modulus is None) == (self.youngs_modulus is None):
            count = "none is" if self.shear_modulus is None else "both are"
            cure = (
                'write either shear_modulus = "1.6 MPa" or youngs_modulus = "4.8 MPa"'
            )
            raise PydanticCustomError(
                "one_modulus", f"needs exactly one modulus, but {count} given: {cure}"
            )
        return self

    @cached_property
    def own_shear_modulus(self) -> float:
        """G of this body alone [Pa]: ``shear_modulus``, or E/(2(1 + nu))."""
        if self.youngs_modulus is not None:
            return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))
        return cast(float, self.shear_modulus)  # not None, as checked above


@keyed()
class Solid(Body):
    """The elastic half-space or layer, with the body that presses on a half-space if that yields too.

    Parameters
    ----------
    shear_modulus, youngs_modulus : float or str, one of the two
        G or E [Pa].
    poisson_ratio : float
        nu [1]; the theory is that of 0.5. At other values the coupling of the mean shear stress with the pressure is
        neglected.
    counter_body : Body, optional
        An elastic sphere; without it the sphere is rigid.
    thickness : float or str, optional
        h [m] of an incompressible layer bonded to a rigid base, under a rigid sphere; without it a half-space.

    Examples
    --------
    >>> pdms = Solid(shear_modulus="1.6 MPa")
    >>> print(f"{pdms.contact_modulus:.2e}")
    6.40e+06
    >>> both = Solid(shear_modulus="1.6 MPa", counter_body={"youngs_modulus": "4.8 MPa"})
    >>> print(f"{both.contact_modulus:.2e}")
    3.20e+06
    """

    counter_body: Body | None = None
    thickness: (
        Annotated[
            float, Quantity("m", "thickness of a layer on a rigid base", "h", above=0)
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _incompressible_layer(self) -> "Solid":
        fault = ""
        if self.thickness is not None and self.counter_body is not None:
            fault = "a layer is pressed by a rigid sphere: omit counter_body, or omit thickness for a half-space"
        elif self.thickness is not None and self.poisson_ratio != 0.5:
            fault = "a layer is incompressible: omit poisson_ratio, or omit thickness for a half-space"
        if fault:
            raise PydanticCustomError("layer", fault)
        return self

    @cached_property
    def elastic(self) -> ElasticSolid:
        """The solid under a rigid sphere: the layer, or the half-space that yields as the two bodies together.

        The bodies' 1/G and nu/G add, and with them both the tangential and the normal compliance. Their couplings of
        shear stress with normal displacement subtract.
        """
        own = self.own_shear_modulus, self.poisson_ratio
        if self.thickness is not None:
            return Layer(own[0], self.thickness)
        if self.counter_body is None:
            return HalfSpace(*own)
        other = self.counter_body
        bodies = *own, other.own_shear_modulus, other.poisson_ratio
        modulus, ratio = in_series(*bodies)
        return HalfSpace(modulus, ratio, coupling(*bodies))

    @property
    def softer(self) -> Body:
        """The body of the lower shear modulus, which a stress of the interface strains most."""
        bodies = [self] if self.counter_body is None else [self, self.counter_body]
        return min(bodies, key=lambda body: body.own_shear_modulus)

    @property
    def contact_modulus(self) -> float:
        """E* of both bodies together [Pa]; 4G for one incompressible body, also for a layer of any thickness."""
        return self.elastic.contact_modulus


@keyed()
class Sphere:
    """The smooth sphere.

    Parameters
    ----------
    radius : float or str
        R [m].
    profile : str, optional
        ``parabola``, which JKR's theory takes for a sphere, is the same as none. ``circle`` is for contacts that are
        not much smaller than the sphere. It needs a rigid sphere and a half-space.
    """

    radius: Annotated[float, Quantity("m", "radius of the sphere", "R", above=0)]
    profile: Annotated[
        Literal["parabola", "circle"] | None,
        Field(description="profile of the sphere; if omitted, a parabola"),
    ] = None

    def on(self, solid: ElasticSolid) -> ElasticSolid:
        """Return a solid as the contact with this sphere feels it."""
        return solid.under_circle if self.profile == "circle" else solid


@keyed()
class Adhesion:
    """Work of adhesion, and how much of it the bonds carry.

    Parameters
    ----------
    work : float or str
        Delta gamma with all the bonds of rest [J/m^2].
    bond_share : float
        Share of it that goes with the bonds [1]; the rest (van der Waals, say) stays.

    Notes
    -----
    ``Delta gamma(phi) = work (1 - share + share phi)``. The paper gives no relation between the
    number of bonds and the work of adhesion: this line, linear in the bond fraction phi, is an
    assumption of this project.

    Examples
    --------
    >>> print(f"{Adhesion(work='42 mJ/m^2', bond_share=0.5).work_of_bonds(0.5):.4f}")
    0.0315
    """

    work: Annotated[
        float, Quantity("J/m^2", "work of adhesion at rest", "Δγ", at_least=0)
    ]
    bond_share: Annotated[
        float,
        Quantity(
            "1",
            "share of the work of adhesion carried by bonds",
            "β",
            at_least=0,
            at_most=1,
        ),
    ] = 1.0

    def work_of_bonds(self, fraction):
        """Return Delta gamma [J/m^2] at a bond fraction phi [1], a float or an array."""
        return self.work * (1.0 - self.bond_share + self.bond_share * fraction)


class _BondState(Protocol):
    """Bonds as the work of adhesion reads them."""

    @property
    def fraction(self) -> Array:
        """Bonds over bonds at rest [1]."""

    @property
    def strength(self) -> Array:
        """Magnitude of the mean shear stress [Pa]."""


class EffectiveWork(NamedTuple):
    """Work of adhesion of a scene, and what reduces it: w = Δγ(bond fraction) − χ ΔΓ − α 6τ0²a/(πE*).

    Attributes
    ----------
    adhesion : Adhesion
        Work of adhesion, and the share of it that bonds carry.
    paid : float
        χ, share of ΔΓ that adhesion pays [1].
    margin : Shares, optional
        Share of that at the edge of a finite contact.
    bodies : Bodies
        Sphere and solid.
    """

    adhesion: Adhesion
    paid: float
    margin: Shares | None
    bodies: Bodies

    def balance(self, bonds: _BondState, energy: Array, position: Array) -> Balance:
        """Return its terms with some bonds, fluctuations of an energy ΔΓ [J/m²], and a slider at a position [m]."""
        return Balance(
            self.adhesion.work_of_bonds(bonds.fraction),
            self.paid * energy,
            bonds.strength,
            None if self.margin is None else self.margin.at(position),
            self.bodies,
            self.adhesion.work,
        )


_KINDS = ("load", "indentation", "displacement")
#: Halvings of a clock step that find a moment in it down to rounding.
_HALVINGS = 48
#: Change of a closed radius in a step, over it, that may be a jump; and that of a jump at its moment.
_MAY_JUMP, _JUMPS = 0.02, 1e-3

_Load = over_time(Quantity("N", "normal load, compression positive", "P"), "load")
_Indentation = over_time(
    Quantity("m", "indentation of the sphere", "delta"), "indentation", loops=True
)
_Displacement = over_time(
    Quantity("m", "displacement of the mount", "Delta"), "displacement", loops=True
)
_Healing = Annotated[
    float,
    Quantity(
        "m/s", "speed of a healing edge; if omitted, that of opening", "v_h", above=0
    ),
]
_HealingExponent = Annotated[
    float,
    Quantity(
        "1",
        "exponent of healing; if omitted, that of opening",
        "n_h",
        above=0,
        at_most=1,
    ),
]
_Policy = Annotated[
    Literal["stay_open", "reattach", "stop"],
    Field(description="what follows a pull-off"),
]


@keyed()
class _Controlled:
    """A contact under a load, an indentation, or a displacement with a stiffness."""

    state_class: ClassVar[type[ContactState]] = ContactState
    #: True if the edge takes time to reach equilibrium.
    lags: ClassVar[bool] = False
    #: Theory of the equilibrium.
    theory: ClassVar[str] = "JKR"
    #: True if the energy of the mean stress can be charged to adhesion.
    takes_mean_stress: ClassVar[bool] = True
    #: Rough time of a step of one member if its edge lags, for estimates [s].
    edge_seconds: ClassVar[float] = 0.0

    load: _Load | None = None  # type: ignore[valid-type]
    indentation: _Indentation | None = None  # type: ignore[valid-type]
    displacement: _Displacement | None = None  # type: ignore[valid-type]
    stiffness: (
        Annotated[
            float, Quantity("N/m", "stiffness between mount and sphere", "k", above=0)
        ]
        | None
    ) = None
    reversible: Annotated[
        float,
        Quantity(
            "1",
            "share of the mean-stress energy paid by adhesion",
            "alpha",
            at_least=0,
            at_most=1,
        ),
    ] = 0.0
    after_pull_off: _Policy = "stay_open"

    @model_validator(mode="after")
    def _one_control(self) -> "_Controlled":
        kinds = [name for name in _KINDS if getattr(self, name) is not None]
        message = ""
        if not kinds:
            message = 'the sphere has no mount; give a load such as "4 mN", an indentation such as "2 um", '
            message += "or a displacement with a stiffness"
        elif len(kinds) > 1:
            names = " and ".join(
                f"an {name}" if name == "indentation" else f"a {name}" for name in kinds
            )
            message = f"{names} exclude each other; omit one of them"
        elif self.displacement is not None and self.stiffness is None:
            message = 'a displacement needs the stiffness between mount and sphere, such as "1 kN/m"'
        elif self.displacement is None and self.stiffness is not None:
            message = "a stiffness needs a displacement; give contact.displacement, or omit the stiffness"
        if message:
            raise PydanticCustomError("control", message)
        return self

    def faults(
        self, is_driven: bool, is_on_disc: bool, is_on_layer: bool
    ) -> dict[str, str]:
        """Return faults of this contact with a driven slider, with ΔΓ of a disc or on a layer, by key."""
        return {}

    def remarks(self, setting: Setting) -> list[str]:
        remarks = self._cut_short(setting)
        if not math.isnan(setting.rest_radius):
            return remarks
        never = "is open even with all its adhesion: raise contact.{} to zero, where the sphere touches"
        jumps = "begins open and jumps in where contact.{} first reaches zero"
        course = jumps if max(self.course.extremes) >= 0.0 else never
        return [f"the contact {course.format(self.kind)}", *remarks]

    def _cut_short(self, setting: Setting) -> list[str]:
        """Return a remark if the run ends before the way back of a loop."""
        lasts = self.course.lasts
        if setting.times.duration >= lasts * (1.0 - 1e-9):
            return []
        cure = f"set clock.duration to {lasts:.6g} s or more"
        return [f"the run ends before the loop of contact.{self.kind} does: {cure}"]

    @cached_property
    def kind(self) -> str:
        """Name of the prescribed quantity: load, indentation or displacement."""
        return next(name for name in _KINDS if getattr(self, name) is not None)

    @cached_property
    def course(self) -> Prescribed:
        """The load, indentation or displacement over time."""
        return prescribed(getattr(self, self.kind))

    def control(self, time: float | Array, duration: float) -> Control:
        """Return the control at a time of a run of ``duration`` [s], or at many, shape (times, 1)."""
        if not self.changes:
            return self._steady
        value = self.course.at(np.asarray(time), duration)
        return self._control(value if isinstance(time, np.ndarray) else value.item())

    @cached_property
    def _steady(self) -> Control:
        """The control if it does not change."""
        return self._control(self.course.at(np.zeros(()), 0.0).item())

    def _control(self, value: float | Array) -> Control:
        return (
            DisplacementControl(value, self.stiffness or math.inf)
            if self.load is None
            else LoadControl(value)
        )

    def mount_between(self, ends: Array, duration: float) -> tuple[Control, Control]:
        """Return the control at start and end of each interval between times of a run [s], before a jump at its end."""
        if not self.changes:
            return self._steady, self._steady
        pieces = self.course.pieces(ends, duration).joined
        return self._control(pieces.first), self._control(pieces.last)

    @property
    def makes_load(self) -> bool:
        """True if the load follows from the contact or changes in time."""
        return self.load is None or self.changes

    @property
    def can_open(self) -> bool:
        """True if the control draws the sphere away at some time."""
        return min(self.course.extremes) < 0.0

    @property
    def changes(self) -> bool:
        """True if the control changes in time."""
        return self.course.changes

    def pull_off_load(self, work: float, bodies: Bodies) -> float:
        """Return the lowest load that the contact bears under a dead load [N]."""
        return float(bodies.solid.pull_off_load(work, bodies.sphere_radius))

    def jump_in_distance(self, work: float) -> float:
        """Return the distance at which an approaching sphere jumps into contact [m]; 0 without a range of adhesion."""
        return 0.0

    def distances(self, work: float) -> tuple[float, float]:
        """Return the ends of the range of likely equilibrium distances of the attraction [m]."""
        return DISTANCES

    def equilibrium_radius(self, work: Array, bodies: Bodies) -> Array:
        """Return the JKR radius at the start for a work of adhesion; Hertz's if it is not positive; nan if open."""
        return self.control(0.0, 0.0).radius(work, bodies)

    def heights(
        self, r: Array, radius: float, work: float, bodies: Bodies
    ) -> tuple[Array, Array]:
        """Return the heights of half-space and sphere at distances from the axis of a contact at the start [m]."""
        indentation = self.control(0.0, 0.0).indentation(np.full(1, radius), bodies)[0]
        return bodies.solid.heights(r, radius, indentation, bodies.sphere_radius)

    def largest_radius(self, work: float, bodies: Bodies) -> float:
        """Return the JKR radius for a work of adhesion as the control presses most [m]; 0 without equilibrium."""
        control = self._control(max(self.course.extremes))
        radius = control.radius(np.array([work]), bodies)
        return float(np.nan_to_num(radius[0]))

    def start(self, motion: Motion, duration: float, balance: Balance) -> ContactState:
        """Return the contact at the start, in equilibrium."""
        control = self.control(motion.time, duration)
        radius = self.equilibrium(control, balance)
        phases = np.where(self._without_equilibrium(control, balance), AHEAD, CLOSED)
        unknown = np.full(radius.shape, np.nan)
        turn = np.full((*radius.shape, len(TURN.names or ())), np.nan)
        dissipated = np.zeros(radius.shape)
        return ContactState(
            self._left(radius, balance), radius, unknown, dissipated, phases, turn
        )

    def stopped(self, radius: Array, detached: Array) -> Flags:
        """True if a trajectory has ended, at the pull-off of a contact that stops then."""
        return np.isnan(radius) & ~np.isnan(detached) & (self.after_pull_off == "stop")

    def _without_equilibrium(self, control: Control, balance: Balance) -> Flags:
        """True if a reference contact has no equilibrium, shape (..., rows, 4); those not followed as the first."""
        whole = np.full((*balance.bonded.shape[:-1], 1), balance.reference)
        radii = control.radius(
            np.concatenate([whole, balance.bonded], axis=-1),
            balance.bodies,
        )
        full, bonds_only = radii[..., :1], radii[..., 1:]
        no_mean_stress = (
            self.equilibrium(control, balance.without_stress())
            if self.reversible
            else full
        )
        equilibrium = self.equilibrium(control, balance) if self.lags else full
        return np.isnan(
            np.stack(
                np.broadcast_arrays(full, bonds_only, no_mean_stress, equilibrium),
                axis=-1,
            )
        )

    def _phases(self, state: ContactState, control: Control, balance: Balance) -> Array:
        """Return the phases of the reference contacts at the end of each step, shape (steps, rows, 4)."""
        if not self.can_open:
            return during(state.phases, len(balance.bonded))
        lost = self._without_equilibrium(control, balance)
        touches = np.zeros(lost.shape, bool)
        touches[...] = np.reshape(
            control.touches(np.full(1, balance.reference)), (-1, 1, 1)
        )
        touches[..., BONDS_ONLY] = control.touches(balance.bonded)
        return self._followed(state.phases, touches, lost)

    def _followed(self, phases: Array, touches: Flags, lost: Flags) -> Array:
        """Return phases at the end of each step, shape (steps, rows, contacts).

        Open contacts close where they ``touch``, and closed ones open where they have ``lost`` their equilibrium.
        """
        after = np.empty(lost.shape)
        _follow(phases, touches, lost, self.after_pull_off == "reattach", after)
        return after

    def equilibrium(self, control: Control, balance: Balance) -> Array:
        """Return the largest stable radius in equilibrium with the work left there [m], nan without one."""
        margin, bodies = balance.margin, balance.bodies
        if margin is None and self.reversible == 0.0:
            return control.radius(balance.work(np.zeros(1)), bodies)
        # on the plane fluctuations take their whole energy at any radius
        least, shares = (
            (1.0, [PLANE]) if margin is None else (margin.least, margin.each)
        )
        load, base, stiffness = control.mount
        tilt = self.reversible * balance.tilt
        bonded, fluctuating = balance.bonded, balance.fluctuating
        most = bonded - least * fluctuating
        start = control.radius(most, bodies)
        terms = np.broadcast_arrays(start, most, bonded, fluctuating, tilt, load, base)
        contacts = np.stack(terms).reshape(len(terms), len(shares), -1)
        radius = np.empty(contacts.shape[1:])
        for k, share in enumerate(shares):
            stable_radii(
                np.ascontiguousarray(contacts[:, k]),
                stiffness,
                bodies.body,
                share,
                radius[k],
            )
        return radius.reshape(terms[0].shape)

    def _left(self, radius: Array, balance: Balance) -> Array:
        """Return the work of adhesion left at a radius; of an open contact that of a vanishing one."""
        if balance.margin is None and self.reversible == 0.0:
            return balance.work(radius)
        size = np.nan_to_num(radius, nan=0.0)
        work = balance.work(size)
        return (
            work - self.reversible * balance.reversible(size)
            if self.reversible
            else work
        )


@keyed()
class Equilibrium(_Controlled):
    """The contact is in JKR equilibrium with the work of adhesion at every step, on its stable branch.

    Without an equilibrium it pulls off. By ``after_pull_off`` the contact then stays open, or the trajectory of
    the member stops, or the contact reattaches as soon as the free sphere touches. The free sphere touches at a load or
    a displacement of zero or more, and the contact jumps into equilibrium. A contact that begins open jumps in at its
    first touch in any case.
    """

    model: Literal["equilibrium"] = "equilibrium"

    def advance(
        self, state: ContactState, motions: Motion, duration: float, balance: Balance
    ) -> ContactState:
        control = self.control(motions.time, duration)
        radius = self.equilibrium(control, balance)
        if np.isnan(radius).any() or np.isnan(state.radius).any():
            phase = np.where(
                np.isnan(state.radius),
                np.where(np.isnan(state.detached), AHEAD, OPEN),
                CLOSED,
            )
            lost = np.isnan(radius)[:, :, np.newaxis]
            touches = np.zeros(radius.shape, bool)
            touches[...] = control.touches(balance.bonded - balance.fluctuating)
            followed = self._followed(
                phase[:, np.newaxis], touches[:, :, np.newaxis], lost
            )
            radius = np.where(followed[:, :, 0] == CLOSED, radius, np.nan)
        return self.reached(state, motions, duration, balance, radius)

    def reached(
        self,
        state: ContactState,
        motions: Motion,
        duration: float,
        balance: Balance,
        radius: Array,
    ) -> ContactState:
        """Return the contact at the end of each step of a block from its radius there [m], nan where it is open."""
        control = self.control(motions.time, duration)
        detached, dissipated = (
            during(state.detached, len(radius)),
            during(state.dissipated, len(radius)),
        )
        turn = np.full((*radius.shape, len(TURN.names or ())), np.nan)
        before = np.concatenate([state.radius[np.newaxis], radius[:-1]])
        is_open, was_open = np.isnan(radius), np.isnan(before)
        has_been_open = is_open.any() or was_open.any()
        # on a layer a closed contact may have two stable radii
        leaps = np.zeros(radius.shape, bool)
        if balance.bodies.body[2] > 0.0:
            leaps = np.abs(radius - before) > _MAY_JUMP * before
        if has_been_open or leaps.any():
            opens, closes = is_open & ~was_open, was_open & ~is_open
            lost = np.zeros(radius.shape)
            left = np.concatenate(
                [
                    np.broadcast_to(state.work, radius[:1].shape),
                    self._left(radius, balance)[:-1],
                ]
            )
            if leaps.any():
                start, end = (left[leaps], before[leaps]), radius[leaps]
                course = self._within(leaps, start, motions, duration, balance)
                lost[leaps] = self._lost_in_jump(course, start[1], end)
            for happens in (opens, closes):
                if happens.any():
                    start = left[happens], before[happens]
                    turn[happens], lost[happens] = self._turns(
                        happens, start, motions, duration, balance
                    )
            dissipated = np.add.accumulate(np.concatenate([dissipated[:1], lost]))[1:]
        if has_been_open:
            opened = np.where(opens, motions.time, np.nan)
            detached = np.fmax.accumulate(np.concatenate([detached[:1], opened]))[1:]
        work, phases = (
            self._left(radius, balance),
            self._phases(state, control, balance),
        )
        return ContactState(work, radius, detached, dissipated, phases, turn)

    def _within(
        self,
        happens: Flags,
        start: tuple[Array, Array],
        motions: Motion,
        duration: float,
        balance: Balance,
    ) -> Callable[[Array], tuple[Control, Balance]]:
        """Return a function that returns control and balance at a share of some steps, shape (contacts, 1).

        ``happens`` and ``start`` are as of ``_turns``: in a step the work of adhesion changes linearly.
        """
        steps, rows = np.nonzero(happens)
        work, radius = (values[:, np.newaxis] for values in start)
        bonded, fluctuating, stress = (
            np.broadcast_to(values, happens.shape)[steps, rows][:, np.newaxis]
            for values in (balance.bonded, balance.fluctuating, balance.stress)
        )
        at_end = balance._replace(
            bonded=bonded,
            fluctuating=fluctuating,
            stress=stress,
            margin=balance.margin and balance.margin.at(motions.position[steps]),
        )
        change = self._left(radius, at_end) - work

        def at(share: Array) -> tuple[Control, Balance]:
            rest = 1.0 - share
            control = self.control(
                motions.time[steps] - rest * motions.duration[steps], duration
            )
            return control, at_end._replace(bonded=at_end.bonded - rest * change)

        return at

    def _lost_in_jump(
        self,
        at: Callable[[Array], tuple[Control, Balance]],
        before: Array,
        after: Array,
    ) -> Array:
        """Return the energy [J] that contacts lose which jump within a step from one stable radius to another.

        Both radii [m] are those at the ends of the step, and ``at`` is that of ``_within``. The moment is found by
        bisection: a jump is left there, and a smooth change is not, which loses nothing.
        """
        first, last = before[:, np.newaxis], after[:, np.newaxis]
        early, late = np.zeros(first.shape), np.ones(first.shape)
        for _ in range(_HALVINGS):
            middle = 0.5 * (early + late)
            size = self.equilibrium(*at(middle))
            is_late = np.abs(size - last) < np.abs(size - first)
            first, last = np.where(is_late, first, size), np.where(is_late, size, last)
            early, late = (
                np.where(is_late, early, middle),
                np.where(is_late, middle, late),
            )
        control, there = at(late)
        energies = [
            control.energy(
                radius,
                there.gained(radius, self.reversible),
                there.bodies,
                self._left(radius, there),
            )
            for radius in (first, last)
        ]
        jumps = np.abs(last - first) > _JUMPS * first
        lost = np.where(jumps, energies[0] - energies[1], 0.0)
        return np.maximum(lost, 0.0)[:, 0]

    def _turns(
        self,
        happens: Flags,
        start: tuple[Array, Array],
        motions: Motion,
        duration: float,
        balance: Balance,
    ) -> tuple[Array, Array]:
        """Return the rows ``TURN`` of contacts that open or that close within some steps, and the energies lost then.

        Parameters
        ----------
        happens : array, shape (steps, rows)
            True for each of them; all open, or all close.
        start : tuple of arrays, shape (contacts,)
            Their works of adhesion [J/m²] and radii [m] at the start of the step; the radii are nan if they close.
        motions, duration, balance
            As in ``advance``.

        Returns
        -------
        turns : array, shape (contacts, 3)
            Those of the last equilibrium of a contact that opens, and of the first one of a contact that closes;
            nan if it closes without work of adhesion, because a Hertz contact does not jump.
        lost : array, shape (contacts,)
            Energy that the jump at that moment dissipates [J].

        Notes
        -----
        The moment is found by bisection. In the step the control is what it is, and the work of adhesion changes
        linearly, so that the load has no error by the length of the step if the control alone opens the contact. A
        control that jumps acts on the contact as it was before.
        """
        steps, _ = np.nonzero(happens)
        at = self._within(happens, start, motions, duration, balance)
        radius = start[1][:, np.newaxis]
        opens = ~np.isnan(radius)
        before, after = np.zeros(radius.shape), np.ones(radius.shape)
        for _ in range(_HALVINGS):
            middle = 0.5 * (before + after)
            control, there = at(middle)
            size = self.equilibrium(control, there)
            touches = control.touches(there.bonded - there.fluctuating)
            turned = np.where(opens, np.isnan(size), touches)
            radius = np.where(opens & ~turned, size, radius)
            before, after = (
                np.where(turned, before, middle),
                np.where(turned, middle, after),
            )
        control, there = at(after)
        radius = np.where(opens, radius, self.equilibrium(control, there))
        work = self._left(radius, there)
        has_adhesion = work > 0.0
        load = control.normal_load(radius, there.bodies, work)
        load = np.where(has_adhesion, load, 0.0)
        turn = np.concatenate(
            [
                motions.time[steps] - (1.0 - after) * motions.duration[steps],
                load,
                control.displacement(radius, there.bodies, work),
            ],
            axis=1,
        )
        gained = there.gained(radius, self.reversible)
        energy = control.energy(radius, gained, there.bodies, work)[:, 0]
        lost = np.maximum(np.where(opens[:, 0], energy, -energy), 0.0)
        return np.where(opens | has_adhesion, turn, np.nan), lost


@keyed(kw_only=True)
class RateDependent(_Controlled):
    """The edge of the contact has a finite speed: G − w = work (v/v0)ⁿ. Limit: equilibrium as v0 -> infinity.

    The edge opens if the energy release rate G exceeds the work of adhesion w that is left. It heals, with a
    speed and an exponent of its own, if G is smaller. A clock step is integrated to 1e-8, in parts between
    which the control turns or jumps. The part of the work that depends on the radius itself (a disc, ``reversible``)
    is that at the start of the step. Under a dead load no dissipation is counted below the radius at pull-off,
    because the load falls freely then.
    """

    lags: ClassVar[bool] = True
    edge_seconds: ClassVar[float] = 1.5e-6

    front_speed: Annotated[
        float,
        Quantity(
            "m/s", "speed of an opening edge at G - w = work at rest", "v_0", above=0
        ),
    ]
    front_exponent: Annotated[
        float, Quantity("1", "exponent of the edge's speed", "n", above=0, at_most=1)
    ] = 0.6
    heal_speed: _Healing | None = None
    heal_exponent: _HealingExponent | None = None
    model: Literal["rate_dependent"] = "rate_dependent"

    def advance(
        self, state: ContactState, motions: Motion, duration: float, balance: Balance
    ) -> ContactState:
        ends = np.append(motions.time[0] - motions.duration[0], motions.time)
        stiffness = 0.0 if self.load is not None else self.stiffness or math.inf
        speed, exponent = self.front_speed, self.front_exponent
        work, radius, detached, dissipated, turn = follow_front(
            state,
            motions.duration[:, 0],
            self.course.pieces(ends, duration),
            stiffness,
            balance,
            self.reversible,
            Kinetics(
                balance.reference,
                speed,
                exponent,
                self.heal_speed or speed,
                self.heal_exponent or exponent,
            ),
            self.after_pull_off == "reattach",
        )
        phases = self._phases(state, self.control(motions.time, duration), balance)
        return ContactState(work, radius, detached, dissipated, phases, turn)


@kernel(
    "void(float64[:, :], boolean[:, :, :], boolean[:, :, :], boolean,"
    " float64[:, :, ::1])"
)
def _follow(phases, touches, lost, again, after):
    """Write the phases of contacts at the end of each step; ``phases`` are those before the steps."""
    steps, rows, contacts = after.shape
    for m in range(rows):
        for c in range(contacts):
            phase = phases[m if len(phases) > 1 else 0, c]
            for k in range(steps):
                if touches[k, m, c] and (again or phase != OPEN):
                    phase = CLOSED
                if phase == CLOSED and lost[k, m, c]:
                    phase = OPEN
                after[k, m, c] = phase
