"""The contact: its radius at the work of adhesion that is left. Simple to full: equilibrium, rate-dependent.

Every depth is held at a load, at an indentation or at a displacement behind a machine, each a number, a course
or a table; ``sim.parts.contact.control`` says what a contact is under each.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, cast

import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator
from pydantic.dataclasses import dataclass
from pydantic_core import PydanticCustomError

from sim.parts.contact.balance import AHEAD, CLOSED, OPEN, Balance, Touch
from sim.parts.contact.control import AtDisplacement, AtLoad, Bodies, Grip
from sim.parts.contact.crack_front import Hold, Kinetics
from sim.parts.contact.crack_front import advance as advance_front
from sim.parts.contact.crossing import widest_crossing
from sim.parts.exchange import Motion, Setting, Touching
from sim.units.course import Course, Piece, Prescribed, Table, held, prescribed
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
    #: Whether the edge takes time to reach equilibrium.
    lags: ClassVar[bool] = False

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

    @cached_property
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
        found = (grip.radius(work, np.zeros(1), 0.0, balance.bodies) for work in self._references(radius, balance))
        phases = (np.where(np.isnan(alone), AHEAD, CLOSED) for alone in found)
        return Touch(
            self._left(radius, balance), radius, np.full(radius.shape, np.nan), np.zeros(radius.shape), *phases
        )

    def stopped(self, touch: Touching) -> np.ndarray:
        """Whether a trajectory has ended, with the pull-off of a contact that stops there."""
        return np.isnan(touch.radius) & ~np.isnan(touch.detached) & (self.after_pull_off == "stop")

    def reference_radius(self, phase: np.ndarray, work: np.ndarray, grip: Grip, bodies: Bodies) -> np.ndarray:
        """Radius of a contact in equilibrium with another work of adhesion [m], 0 where it is open."""
        return np.where(phase == CLOSED, grip.radius(work, np.zeros(1), 0.0, bodies), 0.0)

    def _references(self, radius: np.ndarray, balance: Balance) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Works of adhesion of the contacts that are followed beside this one [J/m²]."""
        whole = np.full(1, balance.reference)
        return whole, balance.bonded, balance.work(np.nan_to_num(radius)) if self.reversible else whole

    def _phases(self, touch: Touch, grip: Grip, radius: np.ndarray, balance: Balance) -> tuple[np.ndarray, ...]:
        """Phases of these contacts after a step."""
        phases = touch.whole, touch.bonded, touch.stressless
        if self.control.lowest >= 0.0:
            return phases
        if grip.closes:
            stay_open = self.after_pull_off != "reattach"
            return tuple(np.where(stay_open & (phase == OPEN), OPEN, CLOSED) for phase in phases)
        found = (grip.radius(work, np.zeros(1), 0.0, balance.bodies) for work in self._references(radius, balance))
        return tuple(
            np.where((phase == CLOSED) & np.isnan(alone), OPEN, phase)
            for phase, alone in zip(phases, found, strict=True)
        )

    def _touching(self, touch: Touch, grip: Grip) -> np.ndarray:
        """Where an open contact closes if a free sphere touches: at its first touch, or wherever it reattaches."""
        return np.isnan(touch.radius) & (np.isnan(touch.detached) | (self.after_pull_off == "reattach")) & grip.closes

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
        open_ = np.isnan(touch.radius) & ~self._touching(touch, grip)
        if open_.all():
            radius = np.full(np.broadcast(open_, balance.bonded, balance.fluctuating).shape, np.nan)
        else:
            radius = np.where(open_, np.nan, self._equilibrium(grip, balance))
        work, phases = self._left(radius, balance), self._phases(touch, grip, radius, balance)
        opens, closes = ~np.isnan(touch.radius) & np.isnan(radius), np.isnan(touch.radius) & ~np.isnan(radius)
        dissipated = touch.dissipated
        for happens, size, sign in ((opens, touch.radius, 1.0), (closes, radius, -1.0)):
            if happens.any():
                over = grip.released(size, balance.gained(size, self.reversible), balance.bodies)
                dissipated = dissipated + np.where(happens, np.maximum(sign * over, 0.0), 0.0)
        return Touch(work, radius, np.where(opens, motion.time, touch.detached), dissipated, *phases)


@dataclass(frozen=True, kw_only=True, config={"extra": "forbid"})
class RateDependent(_Held):
    """The edge of the contact runs with a finite speed: G − w = work (v/v0)ⁿ. Limit: equilibrium as v0 -> infinity.

    It opens where the energy release rate G exceeds the work of adhesion w that is left, and heals, with a
    speed and an exponent of its own, where it falls short; within a clock step as exactly as 1e-8. What the
    work loses with the radius itself (a disc, ``reversible``) is taken at the radius of the step's start.
    Under a dead load nothing is counted as dissipated below the radius at pull-off, where the load falls.
    """

    lags: ClassVar[bool] = True

    front_speed: Annotated[float, Quantity("m/s", "speed of an opening edge at G = 2 w", "v_0", above=0)]
    front_exponent: Annotated[float, Quantity("1", "exponent of the edge's speed", "n", above=0, at_most=1)] = 0.6
    heal_speed: _Healing | None = None
    heal_exponent: _HealingExponent | None = None
    model: Literal["rate_dependent"] = "rate_dependent"

    def advance(self, touch: Touch, motion: Motion, duration: float, balance: Balance) -> Touch:
        last = self._left(touch.radius, balance)
        first = np.where(np.isnan(touch.radius), last, touch.work)
        now = touch._replace(radius=np.broadcast_to(touch.radius, np.broadcast(touch.radius, last).shape))
        pieces = self.control.pieces(motion.time - motion.duration, motion.time, duration)
        begin, span, share = pieces[0].start, pieces[-1].stop - pieces[0].start, 0.0
        for piece in pieces:
            before, share = share, (piece.stop - begin) / span
            works = [np.broadcast_to((1.0 - part) * first + part * last, now.radius.shape) for part in (before, share)]
            now = self._moved(now, piece, motion.duration * (share - before), works, balance)
        phases = self._phases(touch, self.grip(motion.time, duration), now.radius, balance)
        return Touch(self._left(now.radius, balance), now.radius, now.detached, now.dissipated, *phases)

    def _moved(
        self, touch: Touch, piece: Piece, duration: float, works: Sequence[np.ndarray], balance: Balance
    ) -> Touch:
        """The contact after a part of a clock step over which control and work change linearly.

        What is still stored where the edge opens is dissipated, and so is what a spot gains where the sphere touches.
        """
        before, after, bodies = self._held_at(piece.first), self._held_at(piece.last), balance.bodies
        spot, touching = _spot(balance), self._touching(touch, before)
        radius = np.where(touching, spot, touch.radius)
        moved = advance_front(
            radius, works, _hold(before, after), self._kinetics(balance), duration, bodies.sphere_radius,
            bodies.modulus, 0.5 * spot,
        )  # fmt: skip
        opens = ~np.isnan(radius) & np.isnan(moved.radius)
        counts = isinstance(after, AtDisplacement) | (self._held(touch.radius, works[1], after, bodies) & ~opens)
        lost = np.where(counts, moved.dissipated, 0.0)
        if touching.any():
            wide = np.fmax(spot, before.radius(np.zeros(1), np.zeros(1), 0.0, bodies))
            gained = -before.released(wide, math.pi * wide**2 * works[0], bodies)
            lost += np.where(touching, np.maximum(gained, 0.0), 0.0)
        for m in np.flatnonzero(opens & counts):
            part = moved.detached_at[m] / duration
            grip, narrow = self._held_at((1.0 - part) * piece.first + part * piece.last), np.full(1, 0.5 * spot)
            work = (1.0 - part) * works[0][m] + part * works[1][m]
            lost[m] += max(grip.released(narrow, math.pi * narrow**2 * work, bodies)[0], 0.0)
        detached = np.where(opens, piece.stop - duration + moved.detached_at, touch.detached)
        return touch._replace(radius=moved.radius, detached=detached, dissipated=touch.dissipated + lost)

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
