"""Processes: the energy of the shear-stress fluctuations in time.

A process is a model of ``parts.shear`` on a given solid and cell.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from sim.numerics.noise import Noise
from sim.parts.exchange import Array, Bonding, Gammas, Motion, Motions
from sim.parts.shear.amplitude import Amplitude
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
    """

    energy: Array
    amplitude: Array
    values: Array


@dataclass(frozen=True)
class SmoothProcess:
    """ΔΓ = g² × a given energy, without noise: the ensemble mean, or nothing at all."""

    energy: float
    amplitude: Amplitude
    pairs: ClassVar[int] = 0
    state_class: ClassVar[type[Fluctuation]] = Fluctuation

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        return Fluctuation(*self._level(motion.speed, bonding), np.empty(0))

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        energy, amplitude = self._level(motions.speed, bonding)
        return Fluctuation(energy[-1], amplitude[-1], np.empty(0)), energy

    def _level(self, speed: Array, bonding: Bonding) -> tuple[Array, Array]:
        """Energy [J/m²] and amplitude [1] of the fluctuations at a speed [m/s]."""
        amplitude = self.amplitude.factor(speed, bonding.strength)
        return amplitude**2 * self.energy, amplitude

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

    def _renew(
        self, values: Array, keep: Array, renew: Array, size: Array, step: int, noise: Noise
    ) -> tuple[Array, Array]:
        """Energy and numbers after a step that keeps a share of the numbers and renews the rest at a size."""
        raise NotImplementedError

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        amplitude = self.amplitude.factor(motion.speed, bonding.strength)
        size = amplitude if self.amplitude.relaxing else np.ones(1)
        empty = self._empty(len(noise.members))
        return self._scaled(amplitude, *self._renew(empty, np.zeros(1), np.ones(1), size, motion.step, noise))

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        energies = []
        for k, motion in enumerate(motions.each()):
            state = self.step(state, motion, bonding.at(k), noise)
            energies.append(state.energy)
        return state, np.array(energies)

    def step(self, state: Fluctuation, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        """Fluctuations after one step, at the end of which the bonds are ``bonding``."""
        amplitude = self.amplitude.factor(motion.speed, bonding.strength)
        size = _renewed_size(self.amplitude, state, motion, amplitude)
        return self._scaled(amplitude, *self._renew(state.values, *self._shares(motion), size, motion.step, noise))

    def _shares(self, motion: Motion) -> tuple[Array, Array]:
        """Shares of a number that a step keeps and renews, whose squares add up to one."""
        exponents = self.correlation.exponents(self.wavenumber, motion)
        return np.exp(-exponents), np.sqrt(-np.expm1(-2.0 * exponents))

    def _scaled(self, amplitude: Array, energy: Array, values: Array) -> Fluctuation:
        """The state of these numbers, their energy scaled at once unless the amplitude relaxes."""
        scale = np.ones(1) if self.amplitude.relaxing else amplitude
        return Fluctuation(scale**2 * energy, amplitude, values)


def _renewed_size(law: Amplitude, state: Fluctuation, motion: Motion, amplitude: Array) -> Array:
    """Amplitude of what a step renews: 1 unless it relaxes, then the mean variance of the step's two ends.

    Second order in the step. Its beginning is seen after a jump of the speed; stress has no jumps
    but under bonds that follow the speed at once.
    """
    if not law.relaxing:
        return np.ones(1)
    before = state.amplitude if law.reads_stress else law.factor(motion.first, np.zeros(1))
    return np.sqrt(0.5 * (amplitude**2 + before**2))
