"""Grouping the modes of a cell into few bands, with every error known before the run.

ΔΓ is a sum over mode pairs of w ξ with ξ ~ Exp(1), each ξ forgetting with e^(−2λt). A *band* replaces
pairs of similar w and λ by one squared Ornstein-Uhlenbeck process of weight S2/S1 and 2 S1²/S2
degrees of freedom, rate Σw²λ/S2, where Sn = Σw^n: mean and variance of ΔΓ stay exact. What remains is
lower third and fourth cumulants (Cauchy) and a shorter correlation time (Jensen): all errors have one
sign, each is a sum over bands, and so the bands are split where that buys most until every error is
within the tolerance.
"""

import heapq
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.modes import grid_reach, half_lattice, modes

Array = NDArray[np.float64]

_LAGS = 120


@dataclass(frozen=True, eq=False)
class Pairs:
    """Mode pairs of a cell, many of them counted rather than listed.

    Attributes
    ----------
    weight : array, shape (entries,)
        Mean energy per area w of one pair [J/m^2].
    wavenumber : array, shape (entries,)
        |q| [rad/m].
    count : array, shape (entries,)
        How many pairs an entry stands for; 1 where they are listed singly.
    """

    weight: Array
    wavenumber: Array
    count: Array


@dataclass(frozen=True, eq=False)
class Bands:
    """Bands of mode pairs, each array of shape (bands,).

    Attributes
    ----------
    weight : array
        Weight S2/S1 of a band [J/m^2]: its energy is ½ weight X with X chi-square distributed.
    freedom : array
        Degrees of freedom 2 S1²/S2 of X, 2 at least, not whole numbers.
    wavenumber : array
        |q| at which a mode has the band's rate [rad/m].
    errors : dict
        Relative errors of the third and fourth cumulant and of the integral correlation time, and
        the largest difference of the autocorrelation, each against the sum over all pairs.
    """

    weight: Array
    freedom: Array
    wavenumber: Array
    errors: dict[str, float]

    @property
    def mean(self) -> float:
        """Mean energy of all bands [J/m^2]."""
        return float(np.sum(0.5 * self.weight * self.freedom))

    @property
    def variance(self) -> float:
        """Variance of the energy of all bands."""
        return float(np.sum(0.5 * self.weight**2 * self.freedom))


def group(pairs: Pairs, power: int, tolerance: float) -> Bands:
    """The coarsest bands whose known errors all stay within a tolerance.

    Parameters
    ----------
    pairs : Pairs
        The mode pairs.
    power : int
        Rates go with \\|q\\|^power: 0 for memories of time and slip, 1 for waves, 2 for diffusion.
    tolerance : float
        Bound of every error, between 0 and 1.

    Returns
    -------
    Bands
        As few as splitting one band after another finds; single pairs need no splitting.

    Examples
    --------
    Thousands of equal pairs are one band, without any error:

    >>> many = Pairs(np.full(5000, 2e-6), np.full(5000, 1e6), np.ones(5000))
    >>> bands = group(many, 0, 0.01)
    >>> print(len(bands.weight), f"{bands.freedom[0]:.0f} {bands.mean:.3f}")
    1 10000 0.010
    """
    scaled = _Scaled.of(pairs, power)
    live = [_Candidate.of(scaled, np.arange(scaled.weight.size), tolerance)]
    heap = [(-live[0].gain, 0)]
    alive = {0}
    while True:
        if sum(live[i].score for i in alive) < _SCORES:
            bands = _merged(scaled, [live[i].entries for i in sorted(alive)], pairs, power)
            if max(bands.errors.values()) <= tolerance:
                return bands
        gain, worst = heapq.heappop(heap)
        if gain == 0.0:
            return _merged(scaled, [live[i].entries for i in sorted(alive)], pairs, power)
        alive.remove(worst)
        for part in live[worst].parts(scaled):
            alive.add(len(live))
            live.append(_Candidate.of(scaled, part, tolerance))
            heapq.heappush(heap, (-live[-1].gain, len(live) - 1))


#: Number of errors that a candidate's score adds up, each in units of what the tolerance allows.
_SCORES = 4


@dataclass(frozen=True, eq=False)
class _Scaled:
    """Pairs in units in which nothing overflows: weights and rates at most 1."""

    weight: Array
    rate: Array
    moments: Array
    totals: Array

    @classmethod
    def of(cls, pairs: Pairs, power: int) -> "_Scaled":
        weight = pairs.weight / pairs.weight.max()
        rate = (pairs.wavenumber / pairs.wavenumber.max()) ** power
        square = pairs.count * weight**2
        moments = np.stack(
            [pairs.count * weight, square, square * weight, square * weight**2]
            + [square * rate, square / rate, square * rate**2]
        )
        return cls(weight, rate, moments, moments.sum(axis=1))

    def score(self, sums: Array, tolerance: float) -> Array:
        """The four errors of bands with these sums of moments, each over its share of the tolerance, added up."""
        s1, s2, s3, s4, by_rate, over_rate, by_rate_squared = sums
        mean = by_rate / s2
        third = (s3 - s2 * (s2 / s1)) / self.totals[2]
        fourth = (s4 - s2 * (s2 / s1) ** 2) / self.totals[3]
        time = (over_rate - s2 / mean) / self.totals[5]
        # the autocorrelation of a band with a narrow spread of rates is off by 2 e^-2 of its relative variance
        shape = 2.0 * math.exp(-2.0) * (by_rate_squared / mean**2 - s2) / self.totals[1]
        return (third + fourth + time + shape) / tolerance


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A band with what it costs in error, and what its best cut in two would gain."""

    entries: NDArray[np.int64]
    score: float
    gain: float
    along: str
    first: int

    @classmethod
    def of(cls, scaled: _Scaled, entries: NDArray[np.int64], tolerance: float) -> "_Candidate":
        moments = scaled.moments[:, entries]
        sums = moments.sum(axis=1)
        score = max(float(scaled.score(sums, tolerance)), 0.0)
        best = (0.0, "weight", 0)
        for along in ("weight", "rate"):
            values = getattr(scaled, along)[entries]
            order = np.argsort(values, kind="stable")
            steps = np.diff(values[order])
            cuts = np.flatnonzero(steps > 1e-12 * values[order][1:])
            if score < 1e-14 or not cuts.size:
                continue
            low = np.cumsum(moments[:, order], axis=1)[:, cuts]
            high = np.cumsum(moments[:, order[::-1]], axis=1)[:, ::-1][:, cuts + 1]
            left = scaled.score(low, tolerance) + scaled.score(high, tolerance)
            at = int(np.argmin(left))
            best = max(best, (score - float(left[at]), along, int(cuts[at]) + 1))
        return cls(entries, score, *best)

    def parts(self, scaled: _Scaled) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The entries on either side of the best cut."""
        order = np.argsort(getattr(scaled, self.along)[self.entries], kind="stable")
        return self.entries[order[: self.first]], self.entries[order[self.first :]]


def _merged(scaled: _Scaled, groups: list[NDArray[np.int64]], pairs: Pairs, power: int) -> Bands:
    sums = np.stack([scaled.moments[:, entries].sum(axis=1) for entries in groups], axis=1)
    s1, s2, _, _, by_rate, _, _ = sums
    rate = by_rate / s2
    wavenumber = pairs.wavenumber.max() * (rate ** (1.0 / power) if power else np.ones_like(rate))
    errors = {
        "banded_error_third_cumulant": 1.0 - float(np.sum(s2 * (s2 / s1))) / scaled.totals[2],
        "banded_error_fourth_cumulant": 1.0 - float(np.sum(s2 * (s2 / s1) ** 2)) / scaled.totals[3],
        "banded_error_correlation_time": 1.0 - float(np.sum(s2 / rate)) / scaled.totals[5],
        "banded_error_autocorrelation": _autocorrelation_error(scaled, s2, rate),
    }
    freedom = np.maximum(2.0 * s1 * (s1 / s2), 2.0)
    return Bands(pairs.weight.max() * s2 / s1, freedom, wavenumber, {k: max(float(v), 0.0) for k, v in errors.items()})


def _autocorrelation_error(scaled: _Scaled, s2: Array, rate: Array) -> float:
    """Largest difference of the autocorrelation over all lags, on lags from far below to far beyond the memory."""
    slowest = float(scaled.rate.min())
    if slowest == 1.0:
        return 0.0
    # pairs of nearly equal rate can be taken together here: 4000 classes are off by 1e-7 of the correlation
    edges = np.geomspace(slowest, 1.0 + 1e-12, 4001)
    place = np.clip(np.searchsorted(edges, scaled.rate, side="right") - 1, 0, 3999)
    square = np.bincount(place, scaled.moments[1], 4000)
    mean = np.bincount(place, scaled.moments[4], 4000) / np.where(square > 0.0, square, 1.0)
    lags = np.geomspace(1e-2, 20.0 / slowest, _LAGS)[:, np.newaxis]
    exact = np.sum(square * np.exp(-2.0 * mean * lags), axis=1)
    banded = np.sum(s2 * np.exp(-2.0 * rate * lags), axis=1)
    return float(np.max(np.abs(exact - banded))) / scaled.totals[1]


def cell_pairs(spectrum: Any, cell: float, points: int | None, shear_modulus: float, poisson_ratio: float) -> Pairs:
    """The mode pairs of a cell, listed near q = 0 where the weight sits, counted in blocks beyond.

    Parameters
    ----------
    spectrum : object
        Any family of ``sim.spectrum``.
    cell : float
        Side L of the cell [m].
    points : int, optional
        Points of the grid along a side; by default what the spectrum's shortest wave needs.
    shear_modulus, poisson_ratio : float
        G [Pa], nu [1].

    Returns
    -------
    Pairs
        All pairs singly up to a grid of 513 points. Beyond, blocks of 3 × 3 pixels, then of 9 × 9 and
        so on, each with the exact integral of the spectrum and the compliance of its centre. A block
        is narrower than 1/85 of its wavenumber: the cell's mean energy is right to 1e-7, and to 3e-4
        for a spectrum that ends sharply and has all its weight there.

    Raises
    ------
    PydanticCustomError
        As ``sim.modes.modes``.
    """
    if getattr(spectrum, "wavevector", None) is not None:
        found = modes(spectrum, cell, points)
        return Pairs(found.energies(shear_modulus, poisson_ratio), np.hypot(found.qx, found.qy), np.ones(1))
    reach, _ = grid_reach(spectrum, cell, points)
    levels, block = [], 1
    while block == 1 or _LISTED * (block // 3) + block // 6 < reach:
        levels.append(_level(spectrum, cell, reach, block, shear_modulus, poisson_ratio))
        block *= 3
    weight, wavenumber, count = (np.concatenate(parts) for parts in zip(*levels, strict=True))
    if not weight.size:
        modes(spectrum, cell, points)  # says what is wrong
    return Pairs(weight, wavenumber, count)


def _level(
    spectrum: Any, cell: float, reach: int, block: int, shear_modulus: float, poisson_ratio: float
) -> tuple[Array, Array, Array]:
    """Weight, wavenumber and count of the blocks of block² pixels around the finer ones."""
    outermost = min(_LISTED, math.ceil((reach + 0.5) / block - 0.5))
    ix, iy, share = half_lattice(spectrum, cell / block, outermost)
    farthest = np.maximum(np.abs(ix), iy)
    if block > 1:
        kept = farthest > (_LISTED - 1) // 3
        ix, iy, share = ix[kept], iy[kept], share[kept]
    inside, held = _inside(spectrum, cell, reach, block, ix, iy)
    q_x, q_y = (2.0 * math.pi * block / cell * index for index in (ix, iy))
    wavenumber = np.hypot(q_x, q_y)
    compliance = (1.0 - poisson_ratio * (q_x / wavenumber) ** 2) / (shear_modulus * wavenumber)
    count = block**2 * inside
    kept = count > 0.0
    return (compliance * share * held)[kept] / count[kept], wavenumber[kept], count[kept]


def _inside(spectrum: Any, cell: float, reach: int, block: int, ix: NDArray, iy: NDArray) -> tuple[Array, Array]:
    """Of each block, the share that holds modes, and the share of its spectrum that the grid holds."""
    if block == 1:
        return np.ones(ix.size), np.ones(ix.size)
    offsets = (np.arange(9) - 4.0) / 9.0
    x = block * (np.abs(ix)[:, np.newaxis, np.newaxis] + offsets[:, np.newaxis])
    y = block * (iy[:, np.newaxis, np.newaxis] + offsets)
    on_grid = (x < reach + 0.5) & (y < reach + 0.5)
    low, high = (limit * cell / (2.0 * math.pi) for limit in spectrum.support)
    radius = np.hypot(x, y)
    meets = on_grid & (radius <= high) & (radius >= low)
    return meets.mean(axis=(1, 2)), on_grid.mean(axis=(1, 2))


#: Largest lattice index listed singly, and of the blocks at each level: 3 × 85 + 1, so that levels join.
_LISTED = 256
