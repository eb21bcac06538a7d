"""The fluctuations that bonds make in time: a frozen part and one that the bonds' lives renew.

Sites are fixed on the slider. Their mean force f̄ makes a pattern that never changes but in size, with
the power n f̄²; what forces differ from the mean, n Var f, is forgotten as bonds break and rebind. Both
follow the moments of the population in time, so no rms is put in by hand. Amplitudes are Gaussian, as for
many sites in the cell: the spread of ΔΓ lacks the shot noise of few.
"""

from dataclasses import dataclass

import numpy as np

from sim.numerics.jit import kernel
from sim.numerics.noise import Noise, normal, stream
from sim.parts.exchange import Array, Bonding, Motion, Motions
from sim.parts.shear.modal import ModalProcess, renew_modes
from sim.parts.shear.process import Fluctuation, SmoothProcess


@dataclass(frozen=True)
class SiteMean(SmoothProcess):
    """The ensemble mean of ΔΓ: ``energy`` is that for n E[f²] = 1 N²/m²."""

    def _level(self, amplitude: Array, bonding: Bonding) -> Array:
        return (bonding.frozen + bonding.varying) * self.energy


class SiteModes(ModalProcess):
    """Every mode of the cell as √(n f̄²) Z + √(n Var f) Y: Z a frozen standard normal, Y one that renews.

    Y keeps e^(−∫λdt) of itself in a step, λ that of ``correlation``. The state holds Z and Y, shape
    (members, 4, pairs).
    """

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        parts, sizes = np.zeros((len(noise.members), 4, self.pairs)), _sizes(bonding)
        whole, energy = (np.zeros((1, 1, 1)), np.ones((1, 1, 1))), np.empty((1, len(parts)))
        renew_modes(parts, *whole, np.ones((1, 1)), self.weights, *noise.at(motion.step), 0, energy)
        _renew_sites(parts, *whole, sizes, self.weights, *noise.at(motion.step), energy)
        return Fluctuation(energy[0], sizes[:, 0].T, parts)

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        parts, sizes = state.values.copy(), _sizes(bonding)
        energy = np.empty((len(motions.time), len(parts)))
        _renew_sites(parts, *self._shares(motions), sizes, self.weights, *noise.at(motions.step), energy)
        return Fluctuation(energy[-1], sizes[:, -1].T, parts), energy

    def _standard(self, state: Fluctuation) -> tuple[Array, Array]:
        return _combined(state.values, state.amplitude.T), np.array([0.5])


def _sizes(bonding: Bonding) -> Array:
    """Sizes of both parts, shape (2, steps, 1) or (2, steps, members), of one step where they stay."""
    sizes = np.sqrt(np.stack([np.atleast_2d(bonding.frozen), np.atleast_2d(bonding.varying)]))
    sizes[0] *= np.where(bonding.stress < 0.0, -1.0, 1.0)
    return sizes


def _combined(parts: Array, sizes: Array) -> Array:
    """The field of both parts at their sizes (2, members), shape (members, 2, pairs)."""
    frozen, varying = sizes[:, :, np.newaxis, np.newaxis]
    return frozen * parts[:, :2] + varying * parts[:, 2:]


@kernel(
    "void(float64[:,:,::1], float64[:,:,:], float64[:,:,:], float64[:,:,:], float64[::1],"
    " uint64, uint64, uint64[::1], int64, float64[:,::1])"
)
def _renew_sites(parts, keep, renew, sizes, weights, seed, part, members, step, energy):
    """Ornstein-Uhlenbeck steps of Y of all modes of all members in place, and the energy of the field after each.

    Z stands in the first two rows of a member, Y in the others, whose first is the lane of its numbers.
    """
    many = keep.shape[2] > 1
    for m in range(members.size):
        own = m % keep.shape[1]
        for s in range(len(keep)):
            numbers, total = stream(seed, part, members[m], step + s, 2), 0.0
            frozen, varying = sizes[:, s % sizes.shape[1], m % sizes.shape[2]]
            for k in range(weights.size):
                one, numbers = normal(numbers)
                other, numbers = normal(numbers)
                i = k if many else 0
                parts[m, 2, k] = keep[s, own, i] * parts[m, 2, k] + renew[s, own, i] * one
                parts[m, 3, k] = keep[s, own, i] * parts[m, 3, k] + renew[s, own, i] * other
                x = frozen * parts[m, 0, k] + varying * parts[m, 2, k]
                y = frozen * parts[m, 1, k] + varying * parts[m, 3, k]
                total += weights[k] * (x * x + y * y)
            energy[s, m] = total
