"""Processes: the energy of the shear-stress fluctuations in time.

A process is a model of ``parts.shear`` on a given solid and cell.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from sim.numerics.jit import device, kernel
from sim.numerics.noise import Noise
from sim.parts.exchange import Array, Bonding, Gammas, Motion, Motions
from sim.parts.shear.amplitude import NO_PAST, Amplitude
from sim.parts.shear.correlation import Correlation


class Fluctuation(NamedTuple):
    """State of the fluctuations.

    Attributes
    ----------
    energy : array, shape (1,) or (members,)
        Elastic energy per area ΔΓ [J/m^2].
    amplitude : array, shape (1,) or (members,)
        Amplitude factor g [1] at this time.
    values : array
        Own numbers of the process: complex amplitudes (members, 2, pairs) in units of each mode's
        standard deviation, or phases (members, pairs) [rad]; empty where there are none.
    past : array
        What the law of the amplitude keeps of the sliding before, shape (1, 4) or (members, 4); empty of one that
        keeps nothing.
    """

    energy: Array
    amplitude: Array
    values: Array
    past: Array = NO_PAST


@dataclass(frozen=True)
class SmoothProcess:
    """ΔΓ = g² × a given energy, without noise: the ensemble mean, or nothing at all."""

    energy: float
    amplitude: Amplitude
    pairs: ClassVar[int] = 0
    state_class: ClassVar[type[Fluctuation]] = Fluctuation

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        past, amplitude = self.amplitude.started(motion, bonding.strength)
        return Fluctuation(self._level(amplitude, bonding), amplitude, np.empty(0), past)

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        past, amplitude = self.amplitude.followed(state.past, motions, bonding.strength)
        energy = self._level(amplitude, bonding)
        return Fluctuation(energy[-1], amplitude[-1], np.empty(0), past), energy

    def _level(self, amplitude: Array, bonding: Bonding) -> Array:
        """Energy of the fluctuations at an amplitude [J/m²]."""
        return amplitude**2 * self.energy

    @property
    def gammas(self) -> Gammas:
        return Gammas(constant=self.energy)

    def known_errors(self) -> dict[str, float]:
        """Errors and spreads known before the run."""
        return {}


class Renewing:
    """Attributes of processes that renew part of themselves at each step: the start is a whole renewal."""

    correlation: Correlation
    amplitude: Amplitude
    #: Where a mode has the rate of each number of the state [rad/m].
    wavenumber: Array
    state_class: ClassVar[type[Fluctuation]] = Fluctuation

    def _empty(self, members: int) -> Array:
        """Numbers of a state without any fluctuation."""
        raise NotImplementedError

    def _renew(self, values: Array, keep: Array, renew: Array, size: Array, step: int, noise: Noise) -> Array:
        """Keep a share of the numbers, in place, and renew the rest at a size, in one step after the other.

        Shares have the shape (steps, 1 or members, 1 or numbers of a member), sizes (steps, 1 or members). Returns the
        energy of the numbers at the end of each step, shape (steps, members).
        """
        raise NotImplementedError

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        past, amplitude = self.amplitude.started(motion, bonding.strength)
        size = amplitude if self.amplitude.relaxing else np.ones(1)
        values = self._empty(len(noise.members))
        energy = self._renew(values, np.zeros((1, 1, 1)), np.ones((1, 1, 1)), size[np.newaxis], motion.step, noise)
        return Fluctuation(self._scaled(amplitude, energy[0]), amplitude, values, past)

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        past, amplitude = self.amplitude.followed(state.past, motions, bonding.strength)
        values = state.values.copy()
        size = renewed_size(self.amplitude, state, motions, amplitude)
        energy = self._renew(values, *self._shares(motions), size, motions.step, noise)
        energy = self._scaled(amplitude, energy)
        return Fluctuation(energy[-1], amplitude[-1], values, past), energy

    def _shares(self, motions: Motions) -> tuple[Array, Array]:
        """Shares of a number that a step keeps and renews, whose squares add up to one."""
        exponents = self.correlation.exponents(self.wavenumber, motions)
        keep, renew = np.empty_like(exponents), np.empty_like(exponents)
        _shares(exponents.ravel(), keep.ravel(), renew.ravel())
        return keep, renew

    def _scaled(self, amplitude: Array, energy: Array) -> Array:
        """The energy of numbers, scaled at once unless the amplitude relaxes."""
        return energy if self.amplitude.relaxing else amplitude**2 * energy


def renewed_size(law: Amplitude, state: Fluctuation, motions: Motions, amplitude: Array) -> Array:
    """Amplitude of what a step renews: 1 unless it relaxes, then the mean variance of the step's two ends.

    Second order in the step. Its beginning is seen after a jump of the speed; stress has no jumps
    but under bonds that follow the speed at once, nor has what is remembered of the past.
    """
    if not law.relaxing:
        return np.ones((len(amplitude), 1))
    before = np.concatenate([state.amplitude[np.newaxis], amplitude[:-1]])
    if not (law.reads_stress or law.remembers):
        before = law.factor(motions.first, np.zeros(1))
    return np.sqrt(0.5 * (amplitude**2 + before**2))


@device
def shares(exponent):
    """Shares of a number that are kept and renewed over an ``exponent`` ∫λdt; their squares add up to one."""
    lost = -math.expm1(-exponent)
    return 1.0 - lost, math.sqrt(lost * (2.0 - lost))


@kernel("void(float64[:], float64[:], float64[:])")
def _shares(exponents, keep, renew):
    for k in range(exponents.size):
        keep[k], renew[k] = shares(exponents[k])
