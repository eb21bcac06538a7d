"""Processes of the shear-stress fluctuations: laws of their amplitude and correlation, and the energy in time.

A process is a model of ``parts.shear`` on a given solid and cell. Each correlation law gives the integral of the rate λ
of a mode over a step, in time or in slip. Amplitudes decay by the factor exp(−∫λdt), their energy by
exp(−2∫λdt).
"""

import dataclasses
import math
from functools import cached_property
from typing import Annotated, ClassVar, Literal, NamedTuple, Self, cast

import numpy as np
from pydantic import Field

from sim.numerics.jit import device, kernel, law
from sim.numerics.noise import Noise
from sim.parts.exchange import (
    NOT_FOLLOWED,
    Array,
    Bonding,
    Draws,
    FieldCourse,
    FieldLaw,
    Gammas,
    Memory,
    Motion,
)
from sim.units.quantity import Quantity, keyed

_Memory = Annotated[
    float,
    Quantity(
        "m",
        "memory length of the fluctuations, by default the correlation length",
        "l_m",
        above=0,
    ),
]
Relaxing = Annotated[
    bool,
    Field(
        description="true: the amplitude changes only as the correlation renews the field"
    ),
]
#: Memory of a law that depends on the moment alone.
NO_PAST = Memory()


class _OfTheMoment:
    """Attributes of laws that depend on speed and stress of the moment alone; a subclass gives ``factor``."""

    #: True if the amplitude depends on earlier sliding.
    remembers: ClassVar[bool] = False
    #: True if the amplitude depends on the shear stress.
    reads_stress: ClassVar[bool] = False

    def within(self, length: float) -> Self:
        """Return the law in a field with this correlation length [m]."""
        return self

    def factor(self, speed: Array, stress: Array) -> Array:
        """Return g [1] in steady sliding at a speed [m/s] and mean shear stress [Pa], in the shape of either."""
        raise NotImplementedError

    def started(self, motion: Motion, stress: Array) -> tuple[Memory, Array]:
        """Return the memory of the past at t = 0, and g [1]."""
        return NO_PAST, self.factor(motion.speed, stress)

    def followed(
        self, past: Memory, motions: Motion, stress: Array, memory: Memory = NO_PAST
    ) -> tuple[Memory, Array]:
        """Return the memory of the past after a block of steps, and g [1] at the end of each.

        ``memory`` is that at the end of each step, if a loop has followed it.
        """
        return past, self.factor(motions.speed, stress)

    def field_law(
        self, energy: float, rates: tuple[float, float] | None = (0.0, 0.0)
    ) -> FieldLaw:
        """Return the numbers of a field of this mean energy [J/m²], whose ``rates`` are None if each mode has its own.

        The rates are those of ``FieldLaw``.
        """
        return FieldLaw()


@keyed()
class Constant(_OfTheMoment):
    """The fluctuations have the spectrum's rms at every speed: g = 1."""

    relaxing: ClassVar[bool] = False

    model: Literal["constant"] = "constant"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.ones(speed.shape)


@keyed()
class Onset(_OfTheMoment):
    """A prescribed amplitude around the onset of stick-slip: g = floor + (1 − floor)/(1 + (V/V0)^(−1/width)).

    This is a stand-in without a mechanism for the paper's hypothesis that fluctuations set in near ``speed``.
    With ``relaxing`` only the part that the correlation renews has the new size; otherwise the whole field scales
    at once.
    """

    speed: Annotated[
        float, Quantity("m/s", "speed at the onset of the fluctuations", "V_0", above=0)
    ]
    width: Annotated[
        float,
        Quantity("1", "width of the onset in the logarithm of speed", "b", above=0),
    ]
    floor: Annotated[
        float,
        Quantity(
            "1", "share of the rms far below the onset", "g_0", at_least=0, at_most=1
        ),
    ] = 0.0
    relaxing: Relaxing = False
    model: Literal["onset"] = "onset"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.asarray(_onset(speed, self.speed, -1.0 / self.width, self.floor))


@law
def _onset(speed, onset, exponent, floor):
    return floor + (1.0 - floor) * (
        1.0 / (1.0 + math.pow(math.fabs(speed) / onset, exponent))
    )


@keyed()
class Stress(_OfTheMoment):
    """The fluctuations grow with the mean shear stress: g = tau_0/reference."""

    reads_stress: ClassVar[bool] = True

    reference: Annotated[
        float,
        Quantity(
            "Pa", "mean shear stress at the rms of the spectrum", "tau_ref", above=0
        ),
    ]
    relaxing: Relaxing = False
    model: Literal["stress"] = "stress"

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.abs(stress) / self.reference


@keyed()
class SlipRate(_OfTheMoment):
    """The fluctuations grow where sliding is unsteady: g² = floor² + (1 − floor²) × variance of the speed over ⟨V²⟩.

    Means are over the run so far with the weight e^(−s/l) for the distance s slid since then, where l is the
    ``memory_length``. Steady sliding has the floor; stick-slip that slides for the share d of the time has
    1 − d. Rest counts as the limit of ever slower sliding.

    Notes
    -----
    With A_j = ∫ e^(−s/l) \\|V\\|^j dt, g² = floor² + (1 − floor²)(1 − A1²/(A0 A2)). The memory holds A0, the mean speed
    A1/A0 and A2 − A1²/A0. It begins empty, because steady sliding before the run, of weight l/\\|V\\|, has no limit at
    rest. All sliding within a clock step has the mean of the weight over the step. A drive that solves its motion
    integrates the memory in its sub-steps instead.
    """

    remembers: ClassVar[bool] = True

    memory_length: _Memory | None = None
    floor: Annotated[
        float,
        Quantity(
            "1", "share of the rms in steady sliding", "g_0", at_least=0, at_most=1
        ),
    ] = 0.0
    relaxing: Relaxing = False
    model: Literal["slip_rate"] = "slip_rate"

    def within(self, length: float) -> Self:
        return (
            self
            if self.memory_length is not None
            else dataclasses.replace(self, memory_length=length)
        )

    def factor(self, speed: Array, stress: Array) -> Array:
        return np.full(speed.shape, self.floor)

    def started(self, motion: Motion, stress: Array) -> tuple[Memory, Array]:
        none = np.zeros(motion.speed.shape)
        return Memory(none, none, none, none), self.factor(motion.speed, stress)

    def followed(
        self, past: Memory, motions: Motion, stress: Array, memory: Memory = NO_PAST
    ) -> tuple[Memory, Array]:
        if memory.weight.size:
            past = Memory(*(values[-1] for values in memory))
            weight, mean, spread, *_ = memory
            unsteady = np.where(spread > 0.0, spread, 0.0) / np.where(
                spread > 0.0, spread + weight * mean * mean, 1.0
            )
        else:
            columns, unsteady = np.stack(past[:3], axis=1), np.empty(motions.path.shape)
            spread = motions.unsteady + np.zeros(motions.path.shape)
            _remember(
                columns,
                motions.path,
                motions.duration.ravel(),
                spread,
                self.memory_length,
                unsteady,
            )
            past = past._replace(**dict(zip(Memory._fields, columns.T, strict=False)))
        return past, np.sqrt(self.floor**2 + (1.0 - self.floor**2) * unsteady)

    def field_law(
        self, energy: float, rates: tuple[float, float] | None = (0.0, 0.0)
    ) -> FieldLaw:
        memory = cast(float, self.memory_length), self.floor**2
        if rates is None:
            return FieldLaw(*memory)
        return FieldLaw(
            *memory, *rates, float(self.relaxing and any(rates)), energy, 1.0
        )


@device
def unsteadiness(weight, mean, spread):
    """Return 1 − A1²/(A0 A2) of a memory."""
    return spread / (spread + weight * mean * mean) if spread > 0.0 else 0.0


@device
def remembered(memory, path, duration, unsteady, length):
    """Return the weight, mean and spread of a memory after a step; ``unsteady`` as of ``Motion``."""
    weight, mean, spread = memory
    renewed = -math.expm1(-path / length)
    share = renewed * length / path if renewed > 0.0 else 1.0
    weight, spread, gained = (
        weight * (1.0 - renewed),
        spread * (1.0 - renewed),
        duration * share,
    )
    further = path / duration - mean
    spread += share * unsteady + weight * gained / (weight + gained) * further * further
    mean += further * gained / (weight + gained)
    return weight + gained, mean, spread


@kernel(
    "void(float64[:, ::1], float64[:,:], float64[:], float64[:,:], float64, float64[:, ::1])"
)
def _remember(past, path, duration, spent, length, unsteady):
    """Update the memory of each row in place, step by step, and write the unsteadiness after each step."""
    for m in range(len(past)):
        memory = past[m, 0], past[m, 1], past[m, 2]
        for s in range(len(duration)):
            memory = remembered(memory, path[s, m], duration[s], spent[s, m], length)
            unsteady[s, m] = unsteadiness(*memory)
        past[m, 0], past[m, 1], past[m, 2] = memory


Amplitude = Annotated[
    Constant | Onset | Stress | SlipRate, Field(discriminator="model")
]


class _Renewal:
    """Attributes of correlations. Those that fade by sliding only leave the pattern of a contact at rest."""

    #: The rate goes with |q| to this power.
    power: ClassVar[int] = 0

    @property
    def by_slip(self) -> float:
        """Rate at which a mode fades with the slip, over its wavenumber to the power; 1/m for the power 0."""
        return 0.0

    @property
    def by_time(self) -> float:
        """Rate at which a mode fades with time, over its wavenumber to the power; 1/s for the power 0."""
        return 0.0


@keyed()
class Time(_Renewal):
    """Modes renew in time: λ = 1/time."""

    time: Annotated[
        float, Quantity("s", "correlation time of the fluctuations", "t_m", above=0)
    ]
    model: Literal["time"] = "time"

    @property
    def by_time(self) -> float:
        return 1.0 / self.time


@keyed()
class Slip(_Renewal):
    """Modes renew by sliding: λ = \\|V\\|/length, so a contact at rest keeps its pattern."""

    length: Annotated[
        float, Quantity("m", "correlation length of the fluctuations", "l", above=0)
    ]
    model: Literal["slip"] = "slip"

    @property
    def by_slip(self) -> float:
        return 1.0 / self.length


@keyed()
class Wave(_Renewal):
    """A mode renews after sliding ``waves`` of its own wavelengths: λ = \\|V\\| q/(2π waves)."""

    power: ClassVar[int] = 1

    waves: Annotated[
        float,
        Quantity(
            "1", "number of wavelengths after which a mode is renewed", "n_w", above=0
        ),
    ]
    model: Literal["wave"] = "wave"

    @property
    def by_slip(self) -> float:
        return 1.0 / (2.0 * np.pi * self.waves)


@keyed()
class Diffusion(_Renewal):
    """Modes diffuse away in time: λ = D q²."""

    power: ClassVar[int] = 2

    diffusivity: Annotated[
        float, Quantity("m^2/s", "diffusivity of the fluctuations", "D", above=0)
    ]
    model: Literal["diffusion"] = "diffusion"

    @property
    def by_time(self) -> float:
        return self.diffusivity


Correlation = Annotated[Time | Slip | Wave | Diffusion, Field(discriminator="model")]


def exponents(law: Correlation, wavenumber: Array, motion: Motion) -> Array:
    """Return ∫λdt over a step, shape (1, 1) or (members, 1), or (members, wavenumbers) [rad/m].

    For a block of steps the step is the first axis.
    """
    by_slip, by_time = law.by_slip, law.by_time
    passed = by_slip * motion.path if by_slip else by_time * motion.duration
    return factors(law, wavenumber) * passed[..., np.newaxis]


def factors(law: Correlation, wavenumber: Array) -> Array:
    """Return the wavenumbers [rad/m] to the power of a law, shape (1,) if all modes have one rate."""
    return wavenumber**law.power if law.power else np.ones(1)


class Fluctuation(NamedTuple):
    """State of the fluctuations.

    Attributes
    ----------
    energy : array, shape (1,) or (members,)
        Elastic energy per area ΔΓ [J/m^2].
    amplitude : array, shape (1,) or (members,)
        Amplitude factor g [1] at this time.
    values : array
        Numbers of the process: complex amplitudes (members, 2, pairs) in units of each mode's
        standard deviation; empty for a process without any.
    past : Memory
        Memory of earlier sliding in the law of the amplitude.
    expected : array, shape (1,) or (members,)
        Mean of ΔΓ at this time before it was drawn [J/m^2]; ΔΓ itself if sliding renews nothing; empty without a draw.
    """

    energy: Array
    amplitude: Array
    values: Array
    past: Memory = NO_PAST
    expected: Array = NO_PAST.energy

    def holding(self, energy: Array) -> "Fluctuation":
        """Return the state with another energy of the fluctuations [J/m²]."""
        return self._replace(energy=energy)


@dataclasses.dataclass(frozen=True)
class SmoothProcess:
    """ΔΓ = g² × a given energy, without noise: the ensemble mean, or nothing at all."""

    energy: float
    amplitude: Amplitude
    pairs: ClassVar[int] = 0
    state_class: ClassVar[type[Fluctuation]] = Fluctuation

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        past, amplitude = self.amplitude.started(motion, bonding.strength)
        return Fluctuation(
            self._level(amplitude, bonding), amplitude, np.empty(0), past
        )

    def advance(
        self,
        state: Fluctuation,
        motions: Motion,
        bonding: Bonding,
        noise: Noise,
        course: FieldCourse = NOT_FOLLOWED,
    ) -> tuple[Fluctuation, Array]:
        past, amplitude = self.amplitude.followed(
            state.past, motions, bonding.strength, course.memory
        )
        energy = self._level(amplitude, bonding)
        return Fluctuation(energy[-1], amplitude[-1], np.empty(0), past), energy

    def _level(self, amplitude: Array, bonding: Bonding) -> Array:
        """Return the energy of the fluctuations at an amplitude [J/m²]."""
        return amplitude**2 * self.energy

    @property
    def field_law(self) -> FieldLaw:
        return self.amplitude.field_law(self.energy)

    def draws(self, state: Fluctuation, steps: range, noise: Noise) -> Draws:
        """Return what a compiled loop needs to follow the energy in some ``steps``, which it does not draw."""
        members = len(noise.members)
        return Draws(
            values=np.empty((members, 0)),
            energy=np.empty((len(steps) + 1, members)),
            mean=self.energy,
            relaxing=self.amplitude.relaxing,
            address=noise.at(steps.start),
        )

    @property
    def gammas(self) -> Gammas:
        return Gammas(constant=self.energy)

    def known_errors(self) -> dict[str, float]:
        """Return errors and spreads that are known before the run."""
        return {}


class Renewing:
    """Attributes of processes that renew part of themselves at each step: the start is a whole renewal."""

    correlation: Correlation
    amplitude: Amplitude
    #: Wavenumber of a mode that has the rate of each number of the state [rad/m].
    wavenumber: Array
    state_class: ClassVar[type[Fluctuation]] = Fluctuation

    @property
    def gammas(self) -> Gammas:
        """Distribution of ΔΓ at amplitude 1."""
        raise NotImplementedError

    @cached_property
    def _forgets_by_slip(self) -> bool:
        return self.correlation.by_slip > 0.0 or self.amplitude.remembers

    @cached_property
    def mean(self) -> float:
        """Mean of ΔΓ at amplitude 1 [J/m²]."""
        return float(np.sum(self.gammas.weight * self.gammas.shape))

    @property
    def variation(self) -> float:
        """Standard deviation of ΔΓ over its mean [1]; 0 without fluctuations."""
        variance = np.sum(self.gammas.weight**2 * self.gammas.shape)
        return math.sqrt(variance) / self.mean if self.mean > 0.0 else 0.0

    def change(self, path: Array, duration: float) -> Array:
        """Return the standard deviation of the change of ΔΓ at amplitude 1 [J/m²] over paths [m] in a time [s].

        Where all is renewed it is √2 times that of ΔΓ.
        """
        terms, none = self.gammas, np.zeros(path.shape)
        motion = Motion(0, none, np.full(path.shape, duration), path, path, none, none)
        renewed = -np.expm1(
            -2.0 * exponents(self.correlation, terms.wavenumber, motion)
        )
        return np.asarray(
            np.sqrt(2.0 * np.sum(terms.shape * terms.weight**2 * renewed, axis=-1))
        )

    @cached_property
    def field_law(self) -> FieldLaw:
        law = self.correlation
        rates = None if law.power else (law.by_slip, law.by_time)
        return self.amplitude.field_law(self.mean, rates)

    def _empty(self, members: int) -> Array:
        """Return the numbers of a state without any fluctuation."""
        raise NotImplementedError

    def _renew(
        self,
        values: Array,
        keep: Array,
        renew: Array,
        size: Array,
        step: int,
        noise: Noise,
    ) -> Array:
        """Renew a share of the numbers at a size, in place, step by step, and return their energy after each step.

        Shares have the shape (steps, 1 or members, 1 or numbers of a member), sizes (steps, 1 or members), energies
        (steps, members).
        """
        raise NotImplementedError

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        past, amplitude = self.amplitude.started(motion, bonding.strength)
        size = amplitude if self.amplitude.relaxing else np.ones(1)
        values = self._empty(len(noise.members))
        energy = self._renew(
            values,
            np.zeros((1, 1, 1)),
            np.ones((1, 1, 1)),
            size[np.newaxis],
            motion.step,
            noise,
        )
        first = self._scaled(amplitude, energy[0])
        return Fluctuation(
            first, amplitude, values, past._replace(energy=energy[0]), first
        )

    def advance(
        self,
        state: Fluctuation,
        motions: Motion,
        bonding: Bonding,
        noise: Noise,
        course: FieldCourse = NOT_FOLLOWED,
    ) -> tuple[Fluctuation, Array]:
        past, amplitude = self.amplitude.followed(
            state.past, motions, bonding.strength, course.memory
        )
        size, (keep, renew) = (
            renewed_size(self.amplitude, state, motions, amplitude),
            self._shares(motions),
        )
        if (
            self.amplitude.relaxing
            and self.field_law.follows
            and course.memory.renewed.size
        ):
            renew, size = (
                np.sqrt(course.memory.renewed)[..., np.newaxis],
                np.ones((1, 1)),
            )
            keep, size = keep + np.zeros(renew.shape), size + np.zeros((len(renew), 1))
        draws = course.draws  # without rows if the loop of the drive draws nothing
        values = draws.values if len(draws.values) else state.values.copy()
        drawn = (
            draws.energy[1:]
            if len(draws.values)
            else self._renew(values, keep, renew, size, motions.step, noise)
        )
        energy = expected = self._scaled(amplitude, drawn)
        if self._forgets_by_slip:
            before = drawn[-2] if len(drawn) > 1 else state.past.energy
            if keep.shape[2] == 1:
                before = (
                    keep[-1, :, 0] ** 2 * before
                    + (renew[-1, :, 0] * size[-1]) ** 2 * self.mean
                )
            expected = self._scaled(amplitude[-1:], before[np.newaxis])
        return Fluctuation(
            energy[-1],
            amplitude[-1],
            values,
            past._replace(energy=drawn[-1]),
            expected[-1],
        ), energy

    def _shares(self, motions: Motion) -> tuple[Array, Array]:
        """Return the shares of a number that a step keeps and renews, whose squares add up to one."""
        lost = exponents(self.correlation, self.wavenumber, motions)
        keep, renew = np.empty_like(lost), np.empty_like(lost)
        _shares(lost.ravel(), keep.ravel(), renew.ravel())
        return keep, renew

    def _scaled(self, amplitude: Array, energy: Array) -> Array:
        """Return the energy of numbers, scaled at once unless the amplitude relaxes."""
        return energy if self.amplitude.relaxing else amplitude**2 * energy


def renewed_size(
    law: Amplitude, state: Fluctuation, motions: Motion, amplitude: Array
) -> Array:
    """Return the amplitude of the part that a step renews: 1 unless it relaxes.

    If it relaxes, its square is the mean of those at the two ends of the step: second order in the step. The start of
    the step is after a jump of the speed. The memory has no jumps, and stress has jumps only under bonds that follow
    the speed at once.
    """
    if not law.relaxing:
        return np.ones((len(amplitude), 1))
    before = np.concatenate([state.amplitude[np.newaxis], amplitude[:-1]])
    if not (law.reads_stress or law.remembers):
        before = law.factor(motions.first, np.zeros(1))
    return np.sqrt(0.5 * (amplitude**2 + before**2))


@device
def shares(exponent):
    """Return the shares of a number that stay and are renewed over an exponent ∫λdt; their squares add up to one."""
    lost = -math.expm1(-exponent)
    return 1.0 - lost, math.sqrt(lost * (2.0 - lost))


@kernel("void(float64[:], float64[:], float64[:])")
def _shares(exponents, keep, renew):
    """Write ``shares`` of many exponents."""
    for k in range(exponents.size):
        keep[k], renew[k] = shares(exponents[k])
