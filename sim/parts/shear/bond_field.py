"""The fluctuations that bonds make in time: a frozen part and one that the bonds' lives renew.

Sites are fixed on the slider. Their mean force f̄ makes a pattern that never changes but in size, with
the power n f̄²; what forces differ from the mean, n Var f, is forgotten as bonds break and rebind. Both
follow the moments of the population in time, so no rms is put in by hand. Amplitudes are Gaussian, as for
many sites in the cell: the spread of ΔΓ lacks the shot noise of few.
"""

from dataclasses import dataclass

import numpy as np

from sim.numerics.noise import Noise
from sim.parts.exchange import Array, Bonding, Motion, Motions
from sim.parts.shear.modal import ModalProcess, renew_modes
from sim.parts.shear.process import Fluctuation, SmoothProcess, by_step


@dataclass(frozen=True)
class SiteMean(SmoothProcess):
    """The ensemble mean of ΔΓ: ``energy`` is that for n E[f²] = 1 N²/m²."""

    def _level(self, speed: Array, bonding: Bonding) -> tuple[Array, Array]:
        return (bonding.frozen + bonding.varying) * self.energy, np.ones(speed.shape)


class SiteModes(ModalProcess):
    """Every mode of the cell as √(n f̄²) Z + √(n Var f) Y: Z a frozen standard normal, Y one that renews.

    Y keeps e^(−∫λdt) of itself in a step, λ that of ``correlation``. The state holds Z and Y, shape
    (members, 4, pairs).
    """

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        parts = np.zeros((len(noise.members), 4, self.pairs))
        for row in (0, 2):
            self._renew_rows(parts, row, np.zeros((1, 1)), np.ones((1, 1)), motion.step, noise)
        return self._sized(parts, bonding)

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        return by_step(self, state, motions, bonding, noise)

    def step(self, state: Fluctuation, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        parts = state.values.copy()
        keep, renew = self._shares(motion)
        self._renew_rows(parts, 2, keep[np.newaxis], renew[np.newaxis], motion.step, noise)
        return self._sized(parts, bonding)

    def _renew_rows(self, parts: Array, row: int, keep: Array, renew: Array, step: int, noise: Noise) -> None:
        """Renew a share of Z (``row`` 0) or Y (2) in place."""
        energy = np.empty((1, len(parts)))
        renew_modes(parts, keep, renew, np.ones((1, 1)), self.weights, *noise.at(step), row, energy)

    def _sized(self, parts: Array, bonding: Bonding) -> Fluctuation:
        """The state of these parts; ``amplitude`` holds the sizes of both, shape (2, 1) or (2, members)."""
        sizes = np.sqrt(np.stack([bonding.frozen, bonding.varying]))
        sizes[0] *= np.where(bonding.stress < 0.0, -1.0, 1.0)
        field = _combined(parts, sizes)
        energy = np.sum(self.weights * np.sum(np.square(field), axis=1), axis=1)
        return Fluctuation(energy, sizes.T, parts)

    def _standard(self, state: Fluctuation) -> tuple[Array, Array]:
        return _combined(state.values, state.amplitude.T), np.array([0.5])


def _combined(parts: Array, sizes: Array) -> Array:
    """The field of both parts at their sizes (2, members), shape (members, 2, pairs)."""
    frozen, varying = sizes[:, :, np.newaxis, np.newaxis]
    return frozen * parts[:, :2] + varying * parts[:, 2:]
