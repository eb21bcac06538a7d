"""Fourier modes of a periodic cell, each an Ornstein-Uhlenbeck process, and maps of the field.

A pair ±q stands for the pixel (2π/L)² of the wavevector plane around its lattice point. Its
variance is the spectrum *integrated* over that pixel. So a cell's field has the spectrum's
variance but for the pixel of q = 0, even if the spectrum ends inside a pixel. Nothing is
renormalised; ``Modes.errors`` gives the variance and energy that the cell lacks.

The fluctuations that bonds make have a frozen part and one that the bonds' lives renew. Sites are fixed on the slider.
Their mean force f̄ makes a pattern that never changes but in size, with the power n f̄². The deviations of the forces
from the mean, n Var f, are forgotten as bonds break and rebind. Both follow the moments of the population in time, so
no rms is prescribed. Amplitudes are Gaussian, as for many sites in the cell: the spread of ΔΓ lacks the shot noise of
few sites.
"""

import functools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic_core import PydanticCustomError

from sim.numerics.grid import Grid
from sim.numerics.jit import kernel
from sim.numerics.noise import Noise, normal, stream
from sim.parts.exchange import (
    NOT_FOLLOWED,
    Array,
    Bonding,
    FieldCourse,
    Gammas,
    Indices,
    Motion,
)
from sim.parts.shear.process import (
    Amplitude,
    Correlation,
    Fluctuation,
    Renewing,
    SmoothProcess,
)
from sim.solid import ElasticSolid
from sim.spectrum.family import Family

#: Pairs below this share of the variance are left out: all of them together would not change a bit.
_NEGLIGIBLE = 1e-22

#: Relative distance below which a wavevector counts as on the lattice, or a circle as touched only.
_TOUCH = 1e-9


@dataclass(frozen=True, eq=False)
class Modes:
    """One of each pair ±q of a periodic square cell: qy > 0, or qy = 0 and qx > 0.

    Parameters
    ----------
    spectrum : Family
        The spectrum whose modes these are.
    cell : float
        Side L of the cell [m].
    points : int
        Points of the grid along a side.
    ix, iy : array of int, shape (pairs,)
        Lattice indices: qx = 2π ix/L along sliding, qy = 2π iy/L.
    qx, qy : array, shape (pairs,)
        Wavevectors [rad/m], sorted by length.
    variance : array, shape (pairs,)
        Share of the mean square stress that each pair carries [Pa²].
    on_lattice : bool
        False if a ripple does not fit the cell. Then qx, qy are those of the ripple, ix, iy the nearest.
    """

    spectrum: Family
    cell: float
    points: int
    ix: Indices
    iy: Indices
    qx: Array
    qy: Array
    variance: Array
    on_lattice: bool = True

    def energies(self, solid: ElasticSolid) -> Array:
        """Return the mean energy per area of each pair [J/m²], shape (pairs,).

        Notes
        -----
        ``½ G_x(q) · variance = G_x(q) C(q) / L²`` with C averaged over the pixel and G_x the
        compliance of the solid. The cell's mean ΔΓ is their sum.
        """
        return 0.5 * solid.compliance(self.qx, self.qy) * self.variance

    def errors(self, solid: ElasticSolid) -> dict[str, float]:
        """Return the relative errors of the cell against the infinite plane, and the spreads of one realisation.

        The errors are those of the variance and of the mean ΔΓ. The spreads are the expected relative standard
        deviations of the mean square and of ΔΓ for Gaussian amplitudes.
        """
        energies = self.energies(solid)
        infinite = solid.stored_energy(self.spectrum)
        return {
            "cell_error_variance": relative_error(
                float(np.sum(self.variance)), self.spectrum.variance
            ),
            "cell_error_energy": relative_error(float(np.sum(energies)), infinite),
            "member_spread_variance": _spread(self.variance),
            "member_spread_energy": _spread(energies),
        }


def relative_error(value: float, exact: float) -> float:
    """Return the error of a value beside an exact one that is not negative; 0 if that is 0."""
    return (value - exact) / exact if exact > 0.0 else 0.0


def _spread(weights: Array) -> float:
    total = float(np.sum(weights))
    return math.sqrt(float(np.sum(weights**2))) / total if total > 0.0 else 0.0


@functools.lru_cache(maxsize=4)  # a sweep needs the same modes again and again
def modes(spectrum: Family, cell: float, points: int | None = None) -> Modes:
    """Return the mode pairs of a spectrum on a periodic square cell.

    Parameters
    ----------
    spectrum : Family
        The spectrum.
    cell : float
        Side L of the cell [m].
    points : int, optional
        Points of the grid along a side, odd or even. Without it the smallest even grid that holds
        all of the spectrum, which then must have a shortest wavelength.

    Returns
    -------
    Modes
        All pairs whose pixel meets the spectrum; q = 0, and the Nyquist row and column of an even
        grid, are left out.

    Raises
    ------
    PydanticCustomError
        (a ValueError) if the grid is too coarse for the shortest wavelength, if ``points`` is needed,
        or if no mode fits the cell; each names the cure.

    Examples
    --------
    One ripple is one pair; of a band whose longest wave is half the cell nothing is lost:

    >>> from sim.solid import HalfSpace
    >>> from sim.spectrum import Band, Ripple
    >>> modes(Ripple(2.0, 1.0), cell=4.0).variance.tolist()
    [2.0]
    >>> pairs = modes(Band(1.0, longest=2.0, shortest=0.5), 4.0)
    >>> print(f"{abs(pairs.errors(HalfSpace(1.0))['cell_error_variance']):.9f}")
    0.000000000
    """
    if not (math.isfinite(cell) and cell > 0.0):
        raise PydanticCustomError("bad_cell", "the cell must be a positive length", {})
    if spectrum.wavevector is not None:
        return _single(spectrum, cell, points, spectrum.wavevector)
    step = 2 * math.pi / cell
    reach, points = grid_reach(spectrum, cell, points)
    ix, iy, share = half_lattice(spectrum, cell, reach)
    if not len(ix):
        message = f"no wave of the spectrum fits in the cell of {cell:g} m; make the cell longer"
        raise PydanticCustomError("no_modes", message)
    order = np.lexsort((iy, ix, ix**2 + iy**2))
    ix, iy, share = ix[order], iy[order], share[order]
    return _frozen(spectrum, cell, points, ix, iy, step * ix, step * iy, 2 * share)


def _frozen(
    spectrum: Family,
    cell: float,
    points: int,
    *arrays: NDArray,
    on_lattice: bool = True,
) -> Modes:
    """Return modes with read-only arrays, because callers share them."""
    for array in arrays:
        array.flags.writeable = False
    ix, iy, qx, qy, variance = arrays
    return Modes(spectrum, cell, points, ix, iy, qx, qy, variance, on_lattice)


def grid_reach(spectrum: Family, cell: float, points: int | None) -> tuple[int, int]:
    """Return the largest lattice index of modes of a spectrum, and the points of the grid; raise as ``modes``."""
    _, high = spectrum.support
    step = 2 * math.pi / cell
    return _reach(
        None if math.isinf(high) else math.ceil(high / step * (1 - _TOUCH) - 0.5),
        points,
    )


def _reach(needed: int | None, points: int | None) -> tuple[int, int]:
    """Return the largest lattice index below Nyquist and the points of the grid."""
    if points is None:
        if needed is None:
            message = "the spectrum has no shortest wavelength; give points (such as points = 256)"
            raise PydanticCustomError("points_needed", message)
        points = 2 * (needed + 1)
    elif points < 3:
        raise PydanticCustomError(
            "too_few_points",
            "points must be at least 3, not {points}",
            {"points": points},
        )
    reach = (points - 1) // 2
    if needed is not None and needed > reach:
        message = f"the shortest wavelength needs at least {2 * needed + 1} points, not {points}"
        cure = "give more points or omit points, a longer shortest wavelength or a smaller cell"
        raise PydanticCustomError("grid_too_coarse", f"{message}; {cure}")
    return (reach if needed is None else needed), points


def _single(
    spectrum: Family, cell: float, points: int | None, wavevector: tuple[float, float]
) -> Modes:
    """Return the single pair of a ripple, at the wavevector of the ripple."""
    qx, qy = wavevector
    size = math.hypot(qx, qy)
    # as for the lattice below, because a half spectrum holds a wave along x at a positive index only
    qx, qy = (0.0 if abs(part) <= _TOUCH * size else part for part in (qx, qy))
    if qy < 0.0 or (qy == 0.0 and qx < 0.0):
        qx, qy = -qx, -qy
    exact = np.array([qx, qy]) * cell / (2 * math.pi)
    nearest = np.rint(exact).astype(np.int64)
    on_lattice = bool(
        np.all(np.abs(exact - nearest) <= _TOUCH * np.hypot(*exact)) and nearest.any()
    )
    needed = nearest if on_lattice else np.ceil(np.abs(exact)).astype(np.int64)
    _, points = _reach(int(np.max(np.abs(needed))), points)
    arrays = (
        nearest[:1],
        nearest[1:],
        np.array([qx]),
        np.array([qy]),
        np.array([spectrum.variance]),
    )
    return _frozen(spectrum, cell, points, *arrays, on_lattice=on_lattice)


def cell_variance(spectrum: Family, cell: float, points: int | None = None) -> float:
    """Return the variance that the modes of a cell carry together [Pa²], without listing them; raise as ``modes``.

    The square of all their pixels is a pixel of a coarser lattice; that of q = 0 is left out.
    """
    if spectrum.wavevector is not None:
        return spectrum.variance
    reach, _ = grid_reach(spectrum, cell, points)
    step = 2 * math.pi / cell
    whole, middle = (
        spectrum.pixels(side * step, 0)[0, 0] for side in (2 * reach + 1, 1)
    )
    return float(whole - middle)


def half_lattice(
    spectrum: Family, cell: float, reach: int
) -> tuple[Indices, Indices, Array]:
    """Return lattice indices and pixel variance of each pair up to ``reach``, without q = 0 and negligible pairs."""
    pixels = spectrum.pixels(2 * math.pi / cell, reach)
    ix, iy = (index.ravel() for index in np.mgrid[-reach : reach + 1, 0 : reach + 1])
    share = pixels.ravel()
    counted = ((iy > 0) | (ix > 0)) & (2 * share > _NEGLIGIBLE * spectrum.variance)
    return ix[counted], iy[counted], share[counted]


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
    solid: ElasticSolid
    correlation: Correlation
    amplitude: Amplitude

    @property
    def pairs(self) -> int:
        """Number of mode pairs."""
        return self.modes.qx.size

    @cached_property
    def weights(self) -> Array:
        """Energy of each pair for a unit normal in each component, shape (pairs,) [J/m^2]."""
        return 0.5 * self.modes.energies(self.solid)

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

    def _renew(
        self,
        values: Array,
        keep: Array,
        renew: Array,
        size: Array,
        step: int,
        noise: Noise,
    ) -> Array:
        energy = np.empty((len(keep), len(values)))
        renew_modes(values, keep, renew, size, self.weights, noise.at(step), energy)
        return energy

    def _standard(self, state: Fluctuation) -> tuple[Array, Array]:
        """Return real and imaginary parts, shape (members, 2, pairs), and their size in units of the deviation."""
        return state.values, 0.5 * (
            np.ones(1) if self.amplitude.relaxing else state.amplitude
        )

    def maps(self, state: Fluctuation, position: Array, members: int) -> Array:
        """Return stress maps τ1(x, y) of the first ``members``, shape (members, points, points) [Pa].

        The pattern passes the contact: at ``position`` X [m] of the slider a mode e^{iqx} has
        become e^{iq(x − X)}.
        """
        first = state._replace(values=state.values[:members])
        if len(state.amplitude) > 1:
            first = first._replace(amplitude=state.amplitude[:members])
        parts, size = self._standard(first)
        points, shift = self.modes.points, 2.0 * np.pi / self.modes.cell * position
        maps, shifts, sizes = (
            np.empty((members, points, points)),
            *(np.broadcast_to(a, members) for a in (shift, size)),
        )
        try:
            half = self._spare.pop()
        except IndexError:  # the first map, or another thread has it
            half = np.empty((points, points // 2 + 1), dtype=complex)
        for part, shift, amplitude, field in zip(
            parts, shifts, sizes, maps, strict=True
        ):
            spread_modes(part, amplitude, self.deviation, *self._places, shift, half)
            self.lattice.superpose(half, field)
        self._spare.append(half)
        return maps

    @cached_property
    def lattice(self) -> Grid:
        """The lattice of the maps."""
        return Grid(self.modes.cell, self.modes.points)

    @cached_property
    def _places(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Row of each pair in a half spectrum and its place there, counted row by row; short, as reading takes time."""
        rows = self.modes.ix % self.modes.points
        places = rows * (self.modes.points // 2 + 1) + self.modes.iy
        return rows.astype(np.int32), places.astype(np.int32)

    @cached_property
    def _spare(self) -> list[Array]:
        """Work arrays for half spectra that are not in use."""
        return []

    @property
    def gammas(self) -> Gammas:
        return Gammas(2.0 * self.weights, np.ones(self.pairs), self.wavenumber)

    def known_errors(self) -> dict[str, float]:
        return self.modes.errors(self.solid)


@kernel(
    "void(float64[:,:,::1], float64[:,:,:], float64[:,:,:], float64[:,:], float64[::1],"
    " Tuple((uint64, uint64, uint64[::1], int64)), float64[:,::1])"
)
def renew_modes(values, keep, renew, size, weights, address, energy):
    """Advance all modes of all members in place by Ornstein-Uhlenbeck steps, and write the energy after each step.

    The amplitudes of a member are in its first two rows. ``address``: that of the first step, as of ``Noise.at``.
    """
    (seed, part, members, step), many = address, keep.shape[2] > 1
    for m in range(members.size):
        step_row = m if keep.shape[1] > 1 else 0
        for s in range(len(keep)):
            numbers = stream(seed, part, members[m], step + s, 0)
            total, unit = 0.0, size[s, m if size.shape[1] > 1 else 0]
            keeping, kick = keep[s, step_row, 0], renew[s, step_row, 0] * unit
            for k in range(weights.size):
                first, numbers = normal(numbers)
                second, numbers = normal(numbers)
                if many:
                    keeping, kick = keep[s, step_row, k], renew[s, step_row, k] * unit
                x = keeping * values[m, 0, k] + kick * first
                y = keeping * values[m, 1, k] + kick * second
                values[m, 0, k], values[m, 1, k] = x, y
                total += weights[k] * (x * x + y * y)
            energy[s, m] = total


@kernel(
    "void(float64[:,::1], float64, float64[::1], int32[::1], int32[::1], float64, complex128[:,::1])"
)
def spread_modes(parts, size, deviation, rows, places, shift, half):
    """Write a half spectrum that has the amplitudes of mode pairs at their places, each turned by exp(−i ix shift)."""
    points = len(half)
    turns, flat = np.empty(points, np.complex128), half.reshape(-1)
    for j in range(points // 2 + 1):
        turn = complex(math.cos(j * shift), -math.sin(j * shift))
        turns[-j], turns[j] = turn.conjugate(), turn
    half[:] = 0.0
    for k in range(places.size):
        turn, unit = turns[np.uint64(rows[k])], size * deviation[k]
        x, y = unit * parts[0, k], unit * parts[1, k]
        flat[np.uint64(places[k])] = complex(
            x * turn.real - y * turn.imag, x * turn.imag + y * turn.real
        )
    for j in range(1, (points + 1) // 2):  # the first column holds both of a pair
        half[points - j, 0] = half[j, 0].conjugate()


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
        whole, energy = (
            (np.zeros((1, 1, 1)), np.ones((1, 1, 1))),
            np.empty((1, len(parts))),
        )
        renew_modes(
            parts, *whole, np.ones((1, 1)), self.weights, noise.at(motion.step), energy
        )
        _renew_sites(parts, *whole, sizes, self.weights, noise.at(motion.step), energy)
        return Fluctuation(energy[0], sizes[:, 0].T, parts, expected=energy[0])

    def advance(
        self,
        state: Fluctuation,
        motions: Motion,
        bonding: Bonding,
        noise: Noise,
        course: FieldCourse = NOT_FOLLOWED,
    ) -> tuple[Fluctuation, Array]:
        parts, sizes = state.values.copy(), _sizes(bonding)
        energy = np.empty((len(motions.time), len(parts)))
        _renew_sites(
            parts,
            *self._shares(motions),
            sizes,
            self.weights,
            noise.at(motions.step),
            energy,
        )
        expected = state.energy if self.correlation.by_slip > 0.0 else energy[-1]
        return Fluctuation(energy[-1], sizes[:, -1].T, parts, expected=expected), energy

    def _standard(self, state: Fluctuation) -> tuple[Array, Array]:
        frozen, varying = state.amplitude.T[:, :, np.newaxis, np.newaxis]
        return frozen * state.values[:, :2] + varying * state.values[:, 2:], np.array(
            [0.5]
        )


def _sizes(bonding: Bonding) -> Array:
    """Return the sizes of frozen and renewed part, shape (2, steps, 1) or (2, steps, members), or of a single step."""
    sizes = np.sqrt(
        np.stack([np.atleast_2d(bonding.frozen), np.atleast_2d(bonding.varying)])
    )
    sizes[0] *= np.where(bonding.stress < 0.0, -1.0, 1.0)
    return sizes


@kernel(
    "void(float64[:,:,::1], float64[:,:,:], float64[:,:,:], float64[:,:,:], float64[::1],"
    " Tuple((uint64, uint64, uint64[::1], int64)), float64[:,::1])"
)
def _renew_sites(parts, keep, renew, sizes, weights, address, energy):
    """Advance Y of all modes of all members in place by Ornstein-Uhlenbeck steps, and write the energy after each.

    Z is in the first two rows of a member, Y in the others, of which the first is the lane of its numbers.
    """
    (seed, part, members, step), many = address, keep.shape[2] > 1
    for m in range(members.size):
        row = m % keep.shape[1]
        for s in range(len(keep)):
            numbers, total = stream(seed, part, members[m], step + s, 2), 0.0
            frozen, varying = sizes[:, s % sizes.shape[1], m % sizes.shape[2]]
            for k in range(weights.size):
                first, numbers = normal(numbers)
                second, numbers = normal(numbers)
                i = k if many else 0
                parts[m, 2, k] = (
                    keep[s, row, i] * parts[m, 2, k] + renew[s, row, i] * first
                )
                parts[m, 3, k] = (
                    keep[s, row, i] * parts[m, 3, k] + renew[s, row, i] * second
                )
                x = frozen * parts[m, 0, k] + varying * parts[m, 2, k]
                y = frozen * parts[m, 1, k] + varying * parts[m, 3, k]
                total += weights[k] * (x * x + y * y)
            energy[s, m] = total
