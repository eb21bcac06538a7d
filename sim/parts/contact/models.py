"""The contact: its radius at the work of adhesion that is left. Simple to full: equilibrium, rate-dependent.

Every depth is held at a load, at an indentation or at a displacement behind a machine, each a number, a course
or a table; ``sim.parts.contact.control`` says what a contact is under each.
"""

import math
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.parts.contact.balance import Balance, Touch
from sim.parts.contact.control import AtDisplacement, AtLoad, Bodies, Grip
from sim.parts.contact.crack_front import Hold, Kinetics
from sim.parts.contact.crack_front import advance as advance_front
from sim.parts.contact.crossing import widest_crossing
from sim.parts.exchange import Motion, Setting
from sim.units.course import Course, Prescribed, Table, held, prescribed
from sim.units.quantity import Quantity

#: Radius of a first touch over the length (w R²/E*)^(1/3) of adhesive contacts.
_SPOT = 1e-3

_Load = held(Quantity("N", "normal load, compression positive", "P"), "load")
_Indentation = held(Quantity("m", "indentation of the sphere", "delta"), "indentation")
_Displacement = held(Quantity("m", "displacement of the machine that holds the sphere", "Delta"), "displacement")
_Stiffness = Annotated[float, Quantity("N/m", "stiffness of the machine", "k", above=0)]
_Reversible = Annotated[
    float, Quantity("1", "share of the mean stress's energy that adhesion pays", "alpha", at_least=0, at_most=1)
]
_Healing = Annotated[float, Quantity("m/s", "speed of a healing edge, left out that of opening", "v_h", above=0)]
_HealingExponent = Annotated[
    float, Quantity("1", "exponent of healing, left out that of opening", "n_h", above=0, at_most=1)
]
_Policy = Annotated[Literal["stay_open", "reattach", "stop"], Field(description="what follows a detachment")]


@dataclass(frozen=True, config={"extra": "forbid"})
class _Held:
    """What holds the sphere: a load, an indentation, or a displacement with a stiffness."""

    state_class: ClassVar[type[Touch]] = Touch
    per_member: ClassVar[bool] = False
    feeds_back: ClassVar[bool] = False

    load: _Load | None = None  # type: ignore[valid-type]
    indentation: _Indentation | None = None  # type: ignore[valid-type]
    displacement: _Displacement | None = None  # type: ignore[valid-type]
    stiffness: _Stiffness | None = None
    reversible: _Reversible = 0.0
    after_pull_off: _Policy = "stay_open"

    @model_validator(mode="after")
    def _one_control(self) -> "_Held":
        given = [name for name in ("load", "indentation", "displacement") if getattr(self, name) is not None]
        if not given:
            raise PydanticCustomError(
                "control",
                'nothing holds the sphere; give a load such as "4 mN", an indentation such as "2 um", or a displacement'
                " with a stiffness",
            )
        if len(given) > 1:
            names = " and ".join(f"an {name}" if name == "indentation" else f"a {name}" for name in given)
            raise PydanticCustomError("control", f"{names} cannot both hold the sphere; leave one of them out")
        if (self.displacement is None) != (self.stiffness is None):
            said = 'a displacement needs the stiffness of the machine, such as "1 kN/m"'
            other = "a stiffness belongs to a displacement; give contact.displacement, or leave it out"
            raise PydanticCustomError("control", said if self.stiffness is None else other)
        return self

    def remarks(self, setting: Setting) -> list[str]:
        return []

    @property
    def control(self) -> Prescribed:
        """The load, indentation or displacement over time."""
        given = next(given for given in (self.load, self.indentation, self.displacement) if given is not None)
        return prescribed(cast(float | Course | Table, given))

    def grip(self, time: float, duration: float) -> Grip:
        """How the sphere is held at a time of a run of ``duration`` [s]."""
        return self._held_at(self.control.at(time, duration))

    def _held_at(self, value: float) -> Grip:
        if self.load is not None:
            return AtLoad(value)
        return AtDisplacement(value, self.stiffness or math.inf)

    @property
    def changes(self) -> bool:
        """Whether what holds the sphere changes in time."""
        return self.control.changes

    def equilibrium_radius(self, work: np.ndarray, sphere_radius: float, modulus: float) -> np.ndarray:
        """JKR radius at the start for a work of adhesion; Hertz where it is zero or less; nan without equilibrium."""
        return self.grip(0.0, 0.0).radius(work, np.zeros(1), 0.0, Bodies(sphere_radius, modulus, 0.5))

    def start(self, motion: Motion, duration: float, balance: Balance) -> Touch:
        """The contact at the start, in equilibrium."""
        grip = self.grip(motion.time, duration)
        radius = self._equilibrium(grip, balance)
        return Touch(self._left(radius, balance), radius, np.full(radius.shape, np.nan), np.zeros(radius.shape))

    def _equilibrium(self, grip: Grip, balance: Balance) -> np.ndarray:
        """Largest stable radius [m], nan without one."""
        bodies, alpha = balance.bodies, self.reversible
        if balance.margin is None:
            return grip.radius(balance.work(np.zeros(1)), balance.stress, alpha, bodies)
        return self._on_disc(grip, balance)

    def _on_disc(self, grip: Grip, balance: Balance) -> np.ndarray:
        """Widest radius at which the pull on the edge falls to the work left: a walk inwards, then halving.

        What a disc pays is no convex function of its radius, so neither Newton's method nor going back and forth
        between radius and work is safe. The walk starts where the fluctuations take nothing.
        """
        bodies = balance.bodies
        wide = grip.radius(balance.bonded + 0.0 * balance.fluctuating, balance.stress, self.reversible, bodies)
        hertz = np.nan_to_num(grip.radius(np.zeros(1), np.zeros(1), 0.0, bodies))[:, None]

        def surplus(radius: np.ndarray) -> np.ndarray:
            column = Balance(
                balance.bonded[:, None], balance.fluctuating[:, None], balance.stress[:, None], balance.margin,
                bodies, balance.reference,
            )  # fmt: skip
            return grip.pull(radius, bodies) - self._left(radius, column)

        found, closed, at_once = widest_crossing(surplus, wide[:, None], hertz)
        edge = np.where(closed, np.maximum(found, hertz), hertz if grip.closes else np.nan)
        edge = np.where(at_once | (balance.fluctuating[:, None] == 0.0), wide[:, None], edge)  # nothing is taken
        return np.where(np.isnan(wide), np.nan, edge[:, 0])

    def _left(self, radius: np.ndarray, balance: Balance) -> np.ndarray:
        """Work of adhesion left at a radius; of an open contact that of a vanishing one."""
        if balance.margin is None and self.reversible == 0.0:
            return balance.work(radius)
        size = np.nan_to_num(radius, nan=0.0)
        work = balance.work(size)
        return work - self.reversible * balance.reversible(size) if self.reversible else work


@dataclass(frozen=True, config={"extra": "forbid"})
class Equilibrium(_Held):
    """The contact is in JKR equilibrium with the work of adhesion at every step, on its stable branch.

    Where no equilibrium is left it detaches. ``after_pull_off`` says what follows: it stays open; it reattaches as
    soon as the free sphere would touch (at a load that is not negative, at a displacement of zero or more), where it
    jumps into equilibrium; or the member's trajectory stops there.
    """

    model: Literal["equilibrium"] = "equilibrium"

    def advance(self, touch: Touch, motion: Motion, duration: float, balance: Balance) -> Touch:
        grip = self.grip(motion.time, duration)
        opened = np.isnan(touch.radius)
        if opened.all() and (self.after_pull_off != "reattach" or not grip.closes):
            shape = np.broadcast(touch.radius, balance.bonded, balance.fluctuating).shape
            radius = np.full(shape, np.nan)
        else:
            radius = self._equilibrium(grip, balance)
        if self.after_pull_off != "reattach" or not grip.closes:
            radius = np.where(opened, np.nan, radius)
        return _after(touch, radius, self._left(radius, balance), motion.time, grip, balance, self.reversible)


def _after(
    touch: Touch, radius: np.ndarray, work: np.ndarray, time: float, grip: Grip, balance: Balance, reversible: float
) -> Touch:
    """The state after a step, with what an opening or a closing at this step has dissipated."""
    opens, closes = ~np.isnan(touch.radius) & np.isnan(radius), np.isnan(touch.radius) & ~np.isnan(radius)
    dissipated = touch.dissipated
    for happens, size, sign in ((opens, touch.radius, 1.0), (closes, radius, -1.0)):
        if happens.any():
            over = grip.released(size, balance.gained(size, reversible), balance.bodies)
            dissipated = dissipated + np.where(happens, np.maximum(sign * over, 0.0), 0.0)
    return Touch(work, radius, np.where(opens, time, touch.detached), dissipated)


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
class RateDependent(_Held):
    """The edge of the contact runs with a finite speed: G − w = work (v/v0)ⁿ. Limit: equilibrium as v0 -> infinity.

    It opens where the energy release rate G exceeds the work of adhesion w that is left, and heals, with a
    speed and an exponent of its own, where it falls short; within a clock step as exactly as 1e-8. What the
    work loses with the radius itself (a disc, ``reversible``) is taken at the radius of the step's start.
    Under a dead load nothing is counted as dissipated below the radius at pull-off, where the load falls.
    """

    front_speed: Annotated[float, Quantity("m/s", "speed of an opening edge at G = 2 w", "v_0", above=0)]
    front_exponent: Annotated[float, Quantity("1", "exponent of the edge's speed", "n", above=0, at_most=1)] = 0.6
    heal_speed: _Healing | None = None
    heal_exponent: _HealingExponent | None = None
    model: Literal["rate_dependent"] = "rate_dependent"

    def advance(self, touch: Touch, motion: Motion, duration: float, balance: Balance) -> Touch:
        before, grip = self.grip(motion.time - motion.duration, duration), self.grip(motion.time, duration)
        after, bodies = self._left(touch.radius, balance), balance.bodies
        seeded = self._seeded(touch.radius, before, balance)
        radius = np.broadcast_to(seeded, np.broadcast(seeded, after).shape)
        moved = advance_front(
            radius, (np.where(np.isnan(touch.radius), after, touch.work), after), _hold(before, grip),
            self._kinetics(balance), motion.duration, bodies.sphere_radius, bodies.modulus, 0.5 * _spot(balance),
        )  # fmt: skip
        opens = ~np.isnan(radius) & np.isnan(moved.radius)
        detached = np.where(opens, motion.time - motion.duration + moved.detached_at, touch.detached)
        left = self._left(moved.radius, balance)
        counts = isinstance(grip, AtDisplacement) | (self._held(touch.radius, after, grip, bodies) & ~opens)
        lost = np.where(counts, moved.dissipated, 0.0)
        return Touch(left, moved.radius, detached, touch.dissipated + lost)

    def _held(self, radius: np.ndarray, work: np.ndarray, grip: Grip, bodies: Bodies) -> np.ndarray:
        """Whether a load still holds the contact: below the radius at pull-off a pulled sphere falls away.

        What the falling load does there grows without end as the radius vanishes; it is not counted.
        """
        size, modulus, _ = bodies
        fold = np.cbrt(9.0 * math.pi * np.maximum(work, 0.0) * size**2 / (8.0 * modulus))
        return np.asarray(grip.closes | np.isnan(radius) | (radius >= fold))

    def _kinetics(self, balance: Balance) -> Kinetics:
        heals = self.front_speed if self.heal_speed is None else self.heal_speed
        exponent = self.front_exponent if self.heal_exponent is None else self.heal_exponent
        return Kinetics(balance.reference, self.front_speed, self.front_exponent, heals, exponent)

    def _seeded(self, radius: np.ndarray, grip: Grip, balance: Balance) -> np.ndarray:
        """The radius from which an edge starts: where a free sphere touches again, a spot that heals on."""
        if self.after_pull_off != "reattach" or not grip.closes:
            return radius
        return np.where(np.isnan(radius), _spot(balance), radius)


def _spot(balance: Balance) -> float:
    """Radius [m] from which an edge heals when the sphere touches; at half of it a shrinking contact counts as open."""
    size, modulus, _ = balance.bodies
    return _SPOT * math.cbrt(balance.reference * size**2 / modulus)


def _hold(before: Grip, after: Grip) -> Hold:
    """What presses during a step."""
    if isinstance(before, AtLoad) and isinstance(after, AtLoad):
        return Hold(load_before=before.load, load_after=after.load)
    assert isinstance(before, AtDisplacement) and isinstance(
        after, AtDisplacement
    )  # one control holds for the whole run
    return Hold(displacement_before=before.place, displacement_after=after.place, stiffness=after.stiffness)


def _model(value: Any) -> Any:
    """The model of a contact; equilibrium where none is named."""
    return value.get("model", "equilibrium") if isinstance(value, dict) else getattr(value, "model", None)


Contact = Annotated[
    Annotated[Equilibrium, Tag("equilibrium")] | Annotated[RateDependent, Tag("rate_dependent")], Discriminator(_model)
]
