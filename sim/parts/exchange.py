"""Quantities that the parts hand each other at a step, and the protocol of each part.

    drive ── slip, speed ─► bonds ── fraction, stress, … ─► shear ── energy ΔΓ ─► contact ── radius

Parts advance by blocks of clock steps: of one where the state of a part feeds back into an earlier one, else of many.
Results of a block have the step as first axis and the member as second, of length 1 if all members agree. A state, and
the results of a single step, have the member as first axis. The state of a part is a ``NamedTuple`` of arrays of its
own (or of such tuples); others read of it only what its protocol names. Sliding in +x is positive.
"""

import math
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from sim.numerics.noise import Noise
from sim.solid import ElasticSolid

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
Moment = TypeVar("Moment", float, Array)


def record(names: str) -> np.dtype[np.void]:
    """Return the type of a record of floats with these names, separated by blanks."""
    return np.dtype([(name, float) for name in names.split()])


class Times(NamedTuple):
    """Clock of a run: length of a step [s], number of steps, duration [s]."""

    step: float
    steps: int
    duration: float

    def at(self, step: Moment) -> Moment:
        """Time at the end of a step, or of each of many [s]; never accumulated."""
        return self.duration * (step / self.steps)


class Setting(NamedTuple):
    """Constants of a scene that a part may need to judge itself.

    Attributes
    ----------
    solid : ElasticSolid
        The solid under the sphere, with the counter-body if there is one.
    strength : float
        Shear stress that the bonds of rest can bear [Pa]; 0 for bonds with a stretch.
    rest_radius : float
        Contact radius with all the bonds of rest and no fluctuation [m]; nan without equilibrium.
    cell : float
        Side of the square that has the contact's area at rest [m].
    times : Times
        Clock of the run.
    by_maximum : bool
        True if the numbers of the bonds follow from a friction maximum that was given.
    reach : float
        Distance at which an approaching sphere jumps into contact with all the bonds of rest [m].
    takes_disc : bool
        True if the contact can have the energy of a disc.
    """

    solid: ElasticSolid
    strength: float
    rest_radius: float
    cell: float
    times: Times
    by_maximum: bool
    reach: float
    takes_disc: bool


def _constant(value: float) -> Array:
    array = np.full(1, value)
    array.setflags(write=False)
    return array


_NONE, UNKNOWN, _EMPTY = _constant(0.0), _constant(np.nan), np.empty(0)


class Memory(NamedTuple):
    """Earlier sliding as the fluctuations remember it: each an array of shape (1,) or (members,), empty if unused.

    Of a block of steps they have the step as first axis. With A_j = ∫ e^(−s/l) |V|^j dt, where s was slid since then,
    the first three are A0, A1/A0 and A2 − A1²/A0, whose rounding errors do not grow.

    Attributes
    ----------
    weight : array
        Weighted time A0 [s].
    mean : array
        Weighted mean of the absolute speed [m/s].
    spread : array
        Weighted integral of the squared difference from that mean [m²/s].
    renewed : array
        Variance of what was renewed since the last draw, v' = 2λ (g² − v) [1].
    energy : array
        Energy of the field [J/m²], conditional mean since the last draw; not scaled by g² unless amplitudes relax.
    """

    weight: Array = _EMPTY
    mean: Array = _EMPTY
    spread: Array = _EMPTY
    renewed: Array = _EMPTY
    energy: Array = _EMPTY


class FieldLaw(NamedTuple):
    """Numbers by which a drive that solves its motion follows the memory of the fluctuations in its sub-steps.

    Attributes
    ----------
    length : float
        Distance that the amplitude remembers [m], infinite without a memory.
    floor : float
        g² in steady sliding [1].
    by_slip, by_time : float
        Rate λ of the amplitudes over the speed [1/m], and at rest [1/s].
    relaxing : float
        1 if only what is renewed has the new size, else 0.
    energy : float
        Mean of ΔΓ at amplitude 1 [J/m²].
    follows : float
        1 if the contact follows the conditional mean of ΔΓ in the sub-steps, 0 if it has that of the last draw.
    """

    length: float = math.inf
    floor: float = 0.0
    by_slip: float = 0.0
    by_time: float = 0.0
    relaxing: float = 0.0
    energy: float = 0.0
    follows: float = 0.0


class Draws(NamedTuple):
    """Fluctuations that the loop of a drive draws at the end of each clock step, as their process does.

    Attributes
    ----------
    values : array, shape (members, bands)
        Numbers of the process, advanced in place.
    energy : array, shape (steps + 1, members)
        Energy of the field at the start and after each draw, not scaled by g² [J/m²]; the draws are written in place.
    shapes, half_weight : array, shape (bands,)
        Shape of a band's gamma number, and its energy for a number of 1 [J/m²].
    factors : array, shape (1,) or (bands,)
        Wavenumber of a band to the power of the correlation law; one if all bands have the same rate.
    by_slip, by_time : float
        Rates at which a band of factor 1 fades with the path [1/m] and with time [1/s]; one of them is 0.
    mean : float
        Mean of the energy at amplitude 1 [J/m²].
    relaxing : bool
        True if only what is renewed has the new size.
    answers : bool
        True if the interface slips at once in answer to what was drawn.
    address : tuple
        Seed, part, members and number of the first step, as of ``Noise.at``.
    """

    values: Array = np.empty((0, 0))
    energy: Array = np.empty((0, 0))
    shapes: Array = _EMPTY
    half_weight: Array = _EMPTY
    factors: Array = _EMPTY
    by_slip: float = 0.0
    by_time: float = 0.0
    mean: float = 0.0
    relaxing: bool = False
    answers: bool = False
    address: tuple[np.uint64, np.uint64, NDArray[np.uint64], int] = (
        np.uint64(0),
        np.uint64(0),
        np.empty(0, np.uint64),
        0,
    )


#: Draws where the loop of a drive draws nothing.
NO_DRAWS = Draws()


class FieldCourse(NamedTuple):
    """Fluctuations as the loop of a driven slider has followed them during some clock steps.

    Attributes
    ----------
    memory : Memory
        Memory of earlier sliding at the end of each step, empty if it was not followed.
    draws : Draws
        Fluctuations drawn in these steps, without rows if none were.
    """

    memory: Memory = Memory()
    draws: Draws = NO_DRAWS


#: Course of a prescribed motion, in which no loop follows the fluctuations.
NOT_FOLLOWED = FieldCourse()


class StickEnds(NamedTuple):
    """End of the first stick phase in each step of a slider that starts it at rest, on bonds without a stretch.

    The stress has a kink there, because it is the strength of the bonds from then on. Samples at the ends of the steps
    do not show such a maximum. Both have the shape (steps, members) and are nan in a step without such an end, or of
    the shape (1, 1) if nothing in the scene can stick.

    Attributes
    ----------
    stress : array
        Strength of the bonds then, which no stress in the stick phase exceeds [Pa].
    time : array
        Time from then to the end of the step [s].
    """

    stress: Array = UNKNOWN[np.newaxis]
    time: Array = UNKNOWN[np.newaxis]


class Motion(NamedTuple):
    """Sliding during a block of clock steps, each array of shape (steps, 1) or (steps, members).

    At the start of a run, and wherever a single step is meant, the first axis is missing.

    Attributes
    ----------
    step : int
        Number of the first step; 0 is the start, which has no duration.
    time : array
        Time at the end of each step [s].
    duration : array
        Length of each step [s].
    slip : array
        Displacement of the slider over the step, signed [m].
    path : array
        Distance slid over the step, the integral of the absolute speed [m].
    first : array
        Speed at the beginning of the step [m/s]; after a jump of the speed, the new one.
    speed : array
        Speed at the end of the step [m/s]; before a jump there, the old one.
    unsteady : array
        Integral over the step of the square of what the absolute speed differs from its mean there [m²/s].
    position : array
        Displacement of the slider since the start, at the end of each step [m].
    stick_ends : StickEnds
        Ends of stick phases, if the drive solves its motion.
    """

    step: int
    time: Array
    duration: Array
    slip: Array
    path: Array
    first: Array
    speed: Array
    unsteady: Array = _NONE[np.newaxis]
    position: Array = _NONE[np.newaxis]
    stick_ends: StickEnds = StickEnds()


def during(values: Array, steps: int) -> Array:
    """Return values that are constant during a block, with the step as first axis."""
    return (
        values[np.newaxis]
        if steps == 1
        else np.repeat(values[np.newaxis], steps, axis=0)
    )


class Bonding(NamedTuple):
    """Bonds for shear, contact, drive and recorder; arrays of shape (1,) or (members,) at the end of a step.

    Of a block of steps they have the shape (steps, 1) or (steps, members), or (1,) where a number stays.

    Attributes
    ----------
    fraction : array
        Bonds over bonds at rest [1].
    stress : array
        Mean shear stress [Pa], with its sign: that of the last slip for bonds without a stretch, that of the mean
        stretch for bonds with one.
    strength : array
        Magnitude of the stress that ΔΓ, the reversible term and the amplitude law use, slip or no slip [Pa].
    stiffness : array
        Slope of the stress over slip at frozen time [Pa/m]; negative where slip breaks more than it stretches.
    relaxation : array
        Rate of the stress at frozen slip [Pa/s], which thermal rupture makes. nan where it is not known.
    frozen : array
        n f̄² [N²/m²] for n sites per area of mean force f̄: the power of a pattern of sites fixed on the slider.
        nan where bonds carry no stretch.
    varying : array
        n Var f [N²/m²]: the power that forces add which differ from bond to bond. nan where it is not known.
    stored : array
        Elastic energy of the bonds [J/m²], for drives that balance energies; 0 where none can be solved with them.
    """

    fraction: Array
    stress: Array
    strength: Array
    stiffness: Array = _NONE
    relaxation: Array = UNKNOWN
    frozen: Array = UNKNOWN
    varying: Array = UNKNOWN
    stored: Array = _NONE

    def at(self, k: int) -> "Bonding":
        """Return the bonds at the end of step k of a block."""
        return Bonding(*(values[k] if values.ndim > 1 else values for values in self))

    def carried(self, radius: Array) -> "Bonding":
        """Return the readings of bonds that a contact carries: none after a step at whose start it was open.

        ``radius`` is that of the contact at the start of the step [m], 0 or nan if it was open.
        """
        is_closed = radius > 0.0
        if is_closed.all():
            return self
        return Bonding(*(values * is_closed for values in self))


class Gammas(NamedTuple):
    """ΔΓ at amplitude 1 as a sum of independent gamma numbers; arrays of shape (terms,), empty where none is drawn.

    Attributes
    ----------
    weight : array
        Energy of each term per unit of its gamma number [J/m²].
    shape : array
        Shape of the gamma number: how many mode pairs the term stands for.
    wavenumber : array
        \\|q\\| that sets its rate [rad/m].
    constant : float
        Energy that does not fluctuate [J/m²].
    """

    weight: Array = np.empty(0)
    shape: Array = np.empty(0)
    wavenumber: Array = np.empty(0)
    constant: float = 0.0


class Sliding(Protocol):
    """State of any drive."""

    @property
    def position(self) -> Array:
        """Displacement of the slider since the start [m]."""

    @property
    def speed(self) -> Array:
        """Speed of the slider [m/s]."""


class Storing(Protocol):
    """State of any shear process."""

    @property
    def energy(self) -> Array:
        """Elastic energy of the fluctuations per area ΔΓ [J/m²]."""

    @property
    def expected(self) -> Array:
        """Mean of ΔΓ at the end of the last step before it was drawn [J/m²]; ΔΓ if the field forgets no slip."""

    @property
    def past(self) -> Memory:
        """Memory of earlier sliding."""

    def holding(self, energy: Array) -> "Storing":
        """Return the state with another energy of the fluctuations [J/m²]."""


class Mount(NamedTuple):
    """Load [N], displacement of the base [m] and stiffness behind it [N/m] that hold the sphere; 0 if absent."""

    load: float | Array
    base: float | Array
    stiffness: float


#: Time [s], normal load [N] and displacement of the mount [m] at a pull-off or a jump into contact.
TURN = record("time load displacement")


class ContactState(NamedTuple):
    """State of a contact; of a block of steps with the step as first axis.

    Attributes
    ----------
    work : array
        Work of adhesion left at this radius, w [J/m²].
    radius : array
        Contact radius [m], nan where it is open.
    detached : array
        Time of the last pull-off [s], nan if never.
    dissipated : array
        Energy dissipated so far by the opening and closing of the contact [J].
    phases : array, shape (1, 4) or (members, 4)
        Phases (before its first touch, closed, open) of four reference contacts, in equilibrium under the same control
        and rule of ``after_pull_off``: with all adhesion, with that of the bonds, with what fluctuations leave of it
        before the mean stress takes its share (followed only where it does), and with the work left (where the edge
        lags).
    turn : array, shape (1, 3) or (members, 3)
        Time [s], normal load [N] and displacement of the mount [m] at a pull-off or a jump into contact in this
        step, as ``TURN``; nan in a step without one. A pull-off has those of the lowest load since the contact lost
        its stability, because a lagging edge needs time to open from there. A closed contact with such an edge has
        those so far, while it is unstable.
    """

    work: Array
    radius: Array
    detached: Array
    dissipated: Array
    phases: Array
    turn: Array

    def at(self, k: int) -> "ContactState":
        """Return the contact at the end of step k of a block."""
        return ContactState(*(values[k] for values in self))


State = TypeVar("State")
Terms = TypeVar("Terms", contravariant=True)


class Part(Protocol):
    """Attributes that every part of a scene declares."""

    def remarks(self, setting: Setting) -> list[str]:
        """Return sentences on what this part assumes or cannot hold in such a scene, for ``sim check``."""
        return []


class Drive(Part, Protocol[State]):
    """Motion of the slider."""

    @property
    def state_class(self) -> type[State]:
        """Class of the state, a ``NamedTuple`` with ``position`` and ``speed``."""

    def begin(self, times: Times, members: int) -> tuple[State, Motion]:
        """State and motion of some members at t = 0: no slip, and the speed with which the run begins."""

    def advance(self, state: State, times: Times, steps: range) -> tuple[State, Motion]:
        """State at the end of a block of steps and the exact motion in it, of a drive that prescribes it."""

    def readings(self, state: State) -> Array:
        """Recorded quantities of a drive that feels the friction, shape (members, quantities), else (1, 0)."""

    def stage_of(self, state: State) -> Array:
        """Position of the stage that pulls the slider through a spring [m], empty without one."""


class Bonds(Part, Protocol[State]):
    """A population of bonds between slider and half-space."""

    @property
    def state_class(self) -> type[State]:
        """Class of the state."""

    @property
    def feeds_back(self) -> bool:
        """True if the contact carries the bonds, so that a step needs the contact at the end of the step before."""

    def start(self, motion: Motion, noise: Noise) -> State:
        """Population at t = 0, as the key ``start`` has it."""

    def advance(
        self, state: State, motions: Motion, radius: Array, noise: Noise
    ) -> tuple[State, Bonding]:
        """Population after a block of steps, and what others read of it at the end of each.

        ``radius`` is that of the contact at the start of the block [m], nan where it was open.
        """

    def bonding(self, state: State) -> Bonding:
        """Everything that others read of a population."""

    def steady(self, speed: Array) -> Bonding:
        """Ensemble mean in steady sliding at speeds [m/s], arrays of their shape or (1,)."""


class Shear(Protocol[State]):
    """Process of the shear-stress fluctuations: a shear model on a given solid and cell."""

    @property
    def state_class(self) -> type[State]:
        """Class of the state, a ``NamedTuple`` with ``energy``."""

    @property
    def pairs(self) -> int:
        """Count of mode pairs that are drawn."""

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> State:
        """Stationary fluctuations at t = 0."""

    def advance(
        self,
        state: State,
        motions: Motion,
        bonding: Bonding,
        noise: Noise,
        course: FieldCourse = NOT_FOLLOWED,
    ) -> tuple[State, Array]:
        """Fluctuations after a block of steps, at the ends of which the bonds are ``bonding``; ΔΓ at each [J/m²].

        What the loop of a driven slider has followed or drawn already is in ``course``.
        """

    @property
    def field_law(self) -> FieldLaw:
        """Numbers by which sub-steps of a drive follow the memory of the fluctuations."""

    def draws(self, state: State, steps: range, noise: Noise) -> Draws:
        """Numbers by which the loop of a drive draws the fluctuations in some steps, of a model ``in_blocks``."""

    @property
    def gammas(self) -> Gammas:
        """Distribution of ΔΓ at amplitude 1, of a field that bonds make for n E[f²] = 1 N²/m²."""

    def known_errors(self) -> dict[str, float]:
        """Errors and spreads known before the run [1], by name."""


class Contact(Part, Protocol[Terms]):
    """Contact of sphere and half-space."""

    @property
    def state_class(self) -> type[ContactState]:
        """Class of the state."""

    def start(self, motion: Motion, duration: float, balance: Terms) -> ContactState:
        """Contact at the start of a run of ``duration`` [s], in equilibrium with the terms of the work of adhesion."""

    def advance(
        self, state: ContactState, motions: Motion, duration: float, balance: Terms
    ) -> ContactState:
        """Contact at the end of each step of a block, where the terms of the work of adhesion are ``balance``."""


class Parts(NamedTuple):
    """The four parts of a scene, seen by what they exchange alone; each keeps its own class of state."""

    drive: Drive[Sliding]
    bonds: Bonds[tuple[object, ...]]
    shear: Shear[Storing]
    contact: Contact[tuple[object, ...]]
