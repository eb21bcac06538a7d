"""Every Fourier mode of the stress field as an Ornstein-Uhlenbeck process, and maps of the field."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.numerics.grid import Grid
from sim.numerics.jit import kernel
from sim.numerics.noise import Noise, normal, stream
from sim.parts.exchange import Array, Bonding, Gammas, Motion, Motions
from sim.parts.shear.amplitude import Amplitude
from sim.parts.shear.correlation import Correlation
from sim.parts.shear.modes import Modes
from sim.parts.shear.process import Fluctuation, Renewing


@dataclass(frozen=True)
class ModalProcess(Renewing):
    """Every Fourier mode of the cell as a complex Ornstein-Uhlenbeck process.

    Notes
    -----
    With λ the mode's rate, a step keeps e = exp(−∫λdt) of an amplitude and adds √(1 − e²) of a new
    standard one: exact, and stationary for any step. By Parseval ΔΓ = Σ over pairs of
    ½ G_x(q) (variance of the pair) \\|a\\|², the spectral form of ½⟨τ1 w1⟩. Sliding only turns the
    phases of the modes, so ΔΓ of the periodic cell does not feel it: amplitudes are kept in the
    slider's frame and turned where a map is made.
    """

    modes: Modes
    shear_modulus: float
    poisson_ratio: float
    correlation: Correlation
    amplitude: Amplitude

    @property
    def pairs(self) -> int:
        """Number of mode pairs."""
        return self.modes.qx.size

    @cached_property
    def weights(self) -> Array:
        """Energy of each pair for a unit normal in each component, shape (pairs,) [J/m^2]."""
        return 0.5 * self.modes.energies(self.shear_modulus, self.poisson_ratio)

    @cached_property
    def deviation(self) -> Array:
        """Standard deviation of the stress of each pair, shape (pairs,) [Pa]."""
        return np.sqrt(self.modes.variance)

    @cached_property
    def wavenumber(self) -> Array:  # type: ignore[override]
        """\\|q\\| of each pair [rad/m]."""
        return np.hypot(self.modes.qx, self.modes.qy)

    def _empty(self, members: int) -> Array:
        return np.zeros((members, 2, self.pairs))

    def _renew(self, values: Array, keep: Array, renew: Array, size: Array, step: int, noise: Noise) -> Array:
        energy = np.empty((len(keep), len(values)))
        renew_modes(values, keep, renew, size, self.weights, *noise.at(step), 0, energy)
        return energy

    def _standard(self, state: Fluctuation) -> tuple[Array, Array]:
        """Real and imaginary parts, shape (members, 2, pairs), and the size that multiplies each with its deviation."""
        return state.values, 0.5 * (np.ones(1) if self.amplitude.relaxing else state.amplitude)

    def complex_amplitudes(self, state: Fluctuation) -> Array:
        """c_q of τ1(x) = Σ c_q e^{iqx} + conjugate in the slider's frame, shape (members, pairs) [Pa]."""
        parts, size = self._standard(state)
        return size[:, np.newaxis] * self.deviation * (parts[:, 0] + 1j * parts[:, 1])

    def maps(self, state: Fluctuation, position: Array, members: int) -> Array:
        """Stress maps τ1(x, y) on the grid of the first ``members``, shape (members, points, points) [Pa].

        The pattern is carried with the slider: at ``position`` X [m] a mode e^{iqx} has become
        e^{iq(x − X)}.
        """
        first = state._replace(values=state.values[:members])
        if len(state.amplitude) > 1:
            first = first._replace(amplitude=state.amplitude[:members])
        parts, size = self._standard(first)
        maps, points = np.empty((members, self.grid.points, self.grid.points)), self.grid.points
        shifts, sizes = (np.broadcast_to(values, members) for values in (2.0 * np.pi / self.grid.cell * position, size))
        try:
            half, between = self._spare.pop()
        except IndexError:  # the first map, or another thread has them
            half, between = np.zeros((2, points, points // 2 + 1), dtype=complex)
        for part, shift, one, field in zip(parts, shifts, sizes, maps, strict=True):
            spread_modes(part, one, self.deviation, self.modes.ix, self.modes.iy, shift, half)
            self.grid.superpose(half, between, field)
        self._spare.append((half, between))
        return maps

    @cached_property
    def grid(self) -> Grid:
        """The grid of the map."""
        return Grid(self.modes.cell, self.modes.points)

    @property
    def lattice(self) -> Grid:
        """The lattice of the maps."""
        return self.grid

    def centred(self, maps: Array) -> tuple[Array, float]:
        """The squares of maps around the middle of a disc, and their side [m]: the maps."""
        return maps, self.modes.cell

    @cached_property
    def _spare(self) -> list[tuple[Array, Array]]:
        """Half spectra that no map is being made of; the first of two is zero but at the modes."""
        return []

    @property
    def gammas(self) -> Gammas:
        return Gammas(2.0 * self.weights, np.ones(self.pairs), self.wavenumber)

    def known_errors(self) -> dict[str, float]:
        """The cell's own errors against the infinite plane, and the spreads of one realisation."""
        return {
            "cell_error_variance": self.modes.error_variance,
            "cell_error_energy": self.modes.error_energy(self.shear_modulus, self.poisson_ratio),
            "member_spread_variance": self.modes.variance_spread,
            "member_spread_energy": self.modes.energy_spread(self.poisson_ratio),
        }


class FixedProcess(ModalProcess):
    """Modes that keep their modulus and diffuse in phase by 2∫λdt, as the paper's ripple: ΔΓ does not fluctuate."""

    def start(self, motion: Motion, bonding: Bonding, noise: Noise) -> Fluctuation:
        past, amplitude = self.amplitude.started(motion, bonding.strength)
        phases = 2.0 * np.pi * noise.uniforms(motion.step, len(self.wavenumber))
        return Fluctuation(self._energy(amplitude), amplitude, phases, past)

    def advance(
        self, state: Fluctuation, motions: Motions, bonding: Bonding, noise: Noise
    ) -> tuple[Fluctuation, Array]:
        past, amplitude = self.amplitude.followed(state.past, motions, bonding.strength)
        phases = state.values.copy()
        turn_phases(phases, self.correlation.exponents(self.wavenumber, motions), *noise.at(motions.step))
        energy = self._energy(amplitude)
        return Fluctuation(energy[-1], amplitude[-1], phases, past), energy

    def _energy(self, amplitude: Array) -> Array:
        return amplitude**2 * (2.0 * np.sum(self.weights))

    def _standard(self, state: Fluctuation) -> tuple[Array, Array]:
        return np.stack([np.cos(state.values), np.sin(state.values)], axis=1), np.sqrt(0.5) * state.amplitude

    @property
    def gammas(self) -> Gammas:
        return Gammas(constant=2.0 * float(np.sum(self.weights)))

    def known_errors(self) -> dict[str, float]:
        fixed = {"member_spread_variance": 0.0, "member_spread_energy": 0.0}
        return super().known_errors() | fixed


@kernel(
    "void(float64[:,:,::1], float64[:,:,:], float64[:,:,:], float64[:,:], float64[::1],"
    " uint64, uint64, uint64[::1], int64, int64, float64[:,::1])"
)
def renew_modes(values, keep, renew, size, weights, seed, part, members, step, row, energy):
    """Ornstein-Uhlenbeck steps of all modes of all members in place, and the energy by Parseval at the end of each.

    The amplitudes of a member stand in two rows from ``row`` on, which is also the lane of their numbers.
    """
    many = keep.shape[2] > 1
    for m in range(members.size):
        own = m if keep.shape[1] > 1 else 0
        for s in range(len(keep)):
            numbers = stream(seed, part, members[m], step + s, row)
            total, unit = 0.0, size[s, m if size.shape[1] > 1 else 0]
            for k in range(weights.size):
                one, numbers = normal(numbers)
                other, numbers = normal(numbers)
                i = k if many else 0
                kept, kick = keep[s, own, i], renew[s, own, i] * unit
                x = kept * values[m, row, k] + kick * one
                y = kept * values[m, row + 1, k] + kick * other
                values[m, row, k], values[m, row + 1, k] = x, y
                total += weights[k] * (x * x + y * y)
            energy[s, m] = total


@kernel("void(float64[:,::1], float64[:,:,:], uint64, uint64, uint64[::1], int64)")
def turn_phases(phases, exponents, seed, part, members, step):
    """Diffusion of all phases of all members in place, by √(2∫λdt) of a normal number in each step."""
    many = exponents.shape[2] > 1
    for m in range(members.size):
        own = m % exponents.shape[1]
        for s in range(len(exponents)):
            numbers = stream(seed, part, members[m], step + s, 0)
            for k in range(phases.shape[1]):
                turn, numbers = normal(numbers)
                phases[m, k] += math.sqrt(2.0 * exponents[s, own, k if many else 0]) * turn


@kernel(
    "void(float64[:,::1], float64, float64[::1], Array(int64, 1, 'C', readonly=True),"
    " Array(int64, 1, 'C', readonly=True), float64, complex128[:,::1])"
)
def spread_modes(parts, size, deviation, ix, iy, shift, half):
    """Amplitudes of mode pairs, each turned by exp(−i ix shift), at their places in a half spectrum."""
    points = len(half)
    turns = np.empty(2 * points + 1, np.complex128)
    for j in range(turns.size):
        turns[j] = complex(math.cos((j - points) * shift), -math.sin((j - points) * shift))
    for k in range(ix.size):
        value = size * deviation[k] * complex(parts[0, k], parts[1, k]) * turns[ix[k] + points]
        half[ix[k] if ix[k] >= 0 else ix[k] + points, iy[k]] = value
        if iy[k] == 0:  # this column holds both of a pair
            half[-ix[k] if ix[k] <= 0 else points - ix[k], 0] = value.conjugate()
