"""Few bands of modes instead of many modes, with every error known before the run, and the process of their energy.

Mean energies of the mode pairs of a cell are listed near q = 0, and counted by squares of the lattice beyond. Squares
are 3 × 3 to 27 × 27 to a block of pixels. The sum and the sum of squares of the energies are kept for each block. So
mean and variance of the cell's energy are right without a list of 10^8 pairs.

ΔΓ is a sum over mode pairs of w ξ with ξ ~ Exp(1), of autocorrelation e^(−2λt). A *band* replaces pairs of similar w
and λ by one squared Ornstein-Uhlenbeck process of weight S2/S1 and 2 S1²/S2 degrees of freedom, rate Σw²λ/S2, where Sn
= Σw^n. Mean and variance of ΔΓ are exact. The third and fourth cumulants come out low (Cauchy) and the correlation time
short (Jensen): all errors have one sign and each is a sum over bands. So the band whose splitting gains most is split
until every error is within the tolerance.
"""

import functools
import heapq
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim.numerics.jit import inlined, kernel
from sim.numerics.noise import Noise, gamma, normal, stream
from sim.parts.exchange import Array, Draws, Gammas, Indices, during
from sim.parts.shear.modes import grid_reach, half_lattice, modes
from sim.parts.shear.process import (
    Amplitude,
    Correlation,
    Fluctuation,
    Renewing,
    factors,
)
from sim.solid import ElasticSolid
from sim.spectrum.family import Family

#: Squares handled at a time.
_SQUARES = 2**18
#: Largest lattice index listed singly, and of the blocks at each level: 3 × 85 + 1, so that levels join.
_LISTED = 256


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
        How many equal pairs an entry stands for, not a whole number; 1 where they are listed singly.
    """

    weight: Array
    wavenumber: Array
    count: Array


def cell_pairs(
    spectrum: Family, cell: float, points: int | None, solid: ElasticSolid
) -> Pairs:
    """Return the mode pairs of a cell, listed near q = 0 where the weight is, counted in blocks beyond.

    Parameters
    ----------
    spectrum : Family
        The spectrum.
    cell : float
        Side L of the cell [m].
    points : int, optional
        Points of the grid along a side; by default enough for the spectrum's shortest wave.
    solid : ElasticSolid
        The solid that stores their energy.

    Returns
    -------
    Pairs
        All pairs singly up to a grid of 513 points. Beyond, blocks of 3 × 3 pixels, then of 9 × 9 and
        so on, each narrower than 1/85 of its wavenumber, with the exact integral of the spectrum. Its
        energies and their squares are summed over 3 × 3 squares, over pixels where the spectrum or the
        grid ends. The cell's mean and variance are right to 1e-6 (2e-4 where the density of a table
        falls off a cliff narrower than a few pixels); the third cumulant of a band only some pixels
        wide that lies there is up to a few per cent low.

    Raises
    ------
    PydanticCustomError
        As ``sim.parts.shear.modes.modes``.
    """
    if spectrum.wavevector is not None:
        cell_modes = modes(spectrum, cell, points)
        weight = cell_modes.energies(solid)
        return Pairs(weight, np.hypot(cell_modes.qx, cell_modes.qy), np.ones(1))
    reach, _ = grid_reach(spectrum, cell, points)
    levels, block = [], 1
    while block == 1 or _LISTED * (block // 3) + block // 6 < reach:
        levels.append(_level(spectrum, cell, reach, block, solid))
        block *= 3
    pairs = Pairs(*(np.concatenate(parts) for parts in zip(*levels, strict=True)))
    if not pairs.weight.size:
        modes(spectrum, cell, points)  # raises with the reason
    return pairs


def _level(
    spectrum: Family,
    cell: float,
    reach: int,
    block: int,
    solid: ElasticSolid,
) -> tuple[Array, Array, Array]:
    """Return weight, wavenumber and count of the blocks of block² pixels around the finer ones."""
    step = 2.0 * math.pi / cell
    outermost = min(_LISTED, math.ceil((reach + 0.5) / block - 0.5))
    ix, iy, share = half_lattice(spectrum, cell / block, outermost)
    if block == 1:
        softness = solid.compliance(step * ix, step * iy)
        return softness * share, step * np.hypot(ix, iy), np.ones(ix.size)
    farthest = np.maximum(np.abs(ix), iy)
    listed = farthest > (_LISTED - 1) // 3
    ix, iy, share, farthest = ix[listed], iy[listed], share[listed], farthest[listed]
    radius = block * np.hypot(ix, iy)
    ends = (np.abs(radius - limit / step) < block for limit in spectrum.support)
    cut = functools.reduce(np.logical_or, ends, block * farthest > reach - block)
    rows = [np.empty((3, 0))]
    for blocks, side in (
        (np.flatnonzero(~cut), 3),
        (np.flatnonzero(cut), min(block, 27)),
    ):
        for first in range(0, blocks.size, _SQUARES // side**2):
            some, size = blocks[first : first + _SQUARES // side**2], block / side
            sums = _counted(
                spectrum,
                step,
                reach,
                block * ix[some],
                block * iy[some],
                size,
                side,
                solid,
            )
            full = sums[-1] > 0.0
            stress, energy, outward, square = (values[full] for values in sums)
            count = size**2 * energy * (energy / square)
            rows.append(
                np.stack(
                    [
                        share[some][full] * (energy / stress) / count,
                        outward / energy,
                        count,
                    ]
                )
            )
    weight, wavenumber, count = np.concatenate(rows, axis=1)
    return weight, step * wavenumber, count


def _counted(
    spectrum: Family,
    step: float,
    reach: int,
    x: Indices,
    y: Indices,
    size: float,
    side: int,
    solid: ElasticSolid,
) -> tuple[Array, ...]:
    """Return sums over blocks around (x, y) [pixels]: stress, energy, energy × wavenumber, energy squared.

    A block is divided into ``side``² squares of a ``size``.
    """
    offsets = size * (np.arange(side) - 0.5 * (side - 1))
    qx = x[:, np.newaxis, np.newaxis] + offsets[:, np.newaxis]
    qy = y[:, np.newaxis, np.newaxis] + offsets
    radius = np.hypot(qx, qy)
    low, high = (limit / step for limit in spectrum.support)
    # share of a square between the ends of the spectrum, density there, and share of that on the grid
    inside = _within(high, qx, qy, radius, size) - _within(low, qx, qy, radius, size)
    scale = step * np.clip(radius, low * (1.0 + 1e-12), high * (1.0 - 1e-12)) / radius
    density = spectrum.density(scale * qx, scale * qy)
    # a spectrum that ends is all on the grid
    last = reach + 0.5 if math.isinf(high) else math.inf
    on_grid = np.clip((last - np.abs(qx)) / size + 0.5, 0.0, 1.0) * np.clip(
        (last - qy) / size + 0.5, 0.0, 1.0
    )
    energy = solid.compliance(step * qx, step * qy) * on_grid * density
    # of the pixels in a square only those on the edge are inside in part
    square = energy**2 * inside * (1.0 - (1.0 - inside) / size)
    sums = density * inside, energy * inside, energy * inside * radius, square
    return tuple(np.sum(values, axis=(1, 2)) for values in sums)


def _within(edge: float, qx: Array, qy: Array, radius: Array, size: float) -> Array:
    """Return the share of squares within a circle so wide that it is a straight line in each."""
    if math.isinf(edge):
        return np.ones_like(radius)
    along = np.maximum(np.abs(qx), np.abs(qy)) / radius
    across = np.maximum(np.minimum(np.abs(qx), np.abs(qy)) / radius, 1e-6)
    depth = (edge - radius) / size - size / (24.0 * radius)
    far, near = 0.5 * (along + across), 0.5 * (along - across)
    ramps = [np.maximum(depth + shift, 0.0) ** 2 for shift in (far, near, -near, -far)]
    return np.clip(
        (ramps[0] - ramps[1] - ramps[2] + ramps[3]) / (2.0 * along * across), 0.0, 1.0
    )


#: Lags at which the autocorrelation of bands is compared.
_LAGS = 120

#: Errors of a grouping but for that of a mean that relaxes.
_ERRORS = tuple(
    f"banded_error_{name}"
    for name in (
        "third_cumulant",
        "fourth_cumulant",
        "correlation_time",
        "autocorrelation",
    )
)

#: Number of errors that a candidate's score adds up, each in units of what the tolerance allows.
_SCORES = 5


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
        the largest difference of the autocorrelation, each against the sum over all pairs; with an
        amplitude that relaxes also the largest error of the mean while it does.
    """

    weight: Array
    freedom: Array
    wavenumber: Array
    errors: dict[str, float]

    @property
    def mean(self) -> float:
        """Mean energy of all bands [J/m^2]."""
        return float(np.sum(0.5 * self.weight * self.freedom))


def group(pairs: Pairs, power: int, tolerance: float, relaxing: bool = False) -> Bands:
    """Return the coarsest bands whose known errors all stay within a tolerance.

    Parameters
    ----------
    pairs : Pairs
        The mode pairs.
    power : int
        Rates go with \\|q\\|^power: 0 for correlations of time and slip, 1 for waves, 2 for diffusion.
    tolerance : float
        Bound of every error, between 0 and 1.
    relaxing : bool
        True if the amplitude relaxes, so that the mean energy itself follows the rates: its largest
        error while it relaxes is then bounded, too.

    Returns
    -------
    Bands
        As few as splitting one band after another gives; single pairs are never split.

    Examples
    --------
    Thousands of equal pairs are one band, without any error:

    >>> many = Pairs(np.full(5000, 2e-6), np.full(5000, 1e6), np.ones(5000))
    >>> bands = group(many, 0, 0.01)
    >>> print(len(bands.weight), f"{bands.freedom[0]:.0f} {bands.mean:.3f}")
    1 10000 0.010
    """
    if not pairs.weight.any():  # a ripple of no amplitude
        return Bands(
            np.zeros(1),
            np.full(1, 2.0),
            pairs.wavenumber[:1],
            dict.fromkeys(_ERRORS, 0.0),
        )
    scaled = _Scaled.of(pairs, power, relaxing)
    live = [_Candidate.of(scaled, np.arange(scaled.weight.size), tolerance)]
    heap = [(-live[0].gain, 0)]
    alive = {0}
    while True:
        if sum(live[i].score for i in alive) < _SCORES:
            bands = _merged(
                scaled, [live[i].entries for i in sorted(alive)], pairs, power
            )
            if max(bands.errors.values()) <= tolerance:
                return bands
        gain, worst = heapq.heappop(heap)
        if gain == 0.0:
            return _merged(
                scaled, [live[i].entries for i in sorted(alive)], pairs, power
            )
        alive.remove(worst)
        for part in live[worst].parts(scaled):
            alive.add(len(live))
            live.append(_Candidate.of(scaled, part, tolerance))
            heapq.heappush(heap, (-live[-1].gain, len(live) - 1))


@dataclass(frozen=True, eq=False)
class _Scaled:
    """Pairs in units in which nothing overflows: weights and rates at most 1."""

    weight: Array
    rate: Array
    moments: Array
    totals: Array
    relaxing: bool

    @classmethod
    def of(cls, pairs: Pairs, power: int, relaxing: bool) -> "_Scaled":
        weight = pairs.weight / pairs.weight.max()
        rate = (pairs.wavenumber / pairs.wavenumber.max()) ** power
        square = pairs.count * weight**2
        moments = np.stack(
            [pairs.count * weight, square, square * weight, square * weight**2]
            + [square * rate, square / rate, square * rate**2]
            + [pairs.count * weight * rate, pairs.count * weight * rate**2]
        )
        return cls(weight, rate, moments, moments.sum(axis=1), relaxing and power > 0)

    def score(self, sums: Array, tolerance: float) -> Array:
        """Return the sum of the four errors of bands with these sums of moments, each over its tolerance."""
        (
            s1,
            s2,
            s3,
            s4,
            by_rate,
            over_rate,
            by_rate_squared,
            once_by_rate,
            once_by_rate_squared,
        ) = sums
        mean = by_rate / s2
        third = (s3 - s2 * (s2 / s1)) / self.totals[2]
        fourth = (s4 - s2 * (s2 / s1) ** 2) / self.totals[3]
        time = (over_rate - s2 / mean) / self.totals[5]
        # the autocorrelation of a band with a narrow spread of rates is off by 2 e^-2 of its relative variance
        shape = 2.0 * math.exp(-2.0) * (by_rate_squared / mean**2 - s2) / self.totals[1]
        if self.relaxing:
            spread = once_by_rate_squared / mean**2 - 2.0 * once_by_rate / mean + s1
            shape = shape + 2.0 * math.exp(-2.0) * spread / self.totals[0]
        return (third + fourth + time + shape) / tolerance


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A band with its share of the errors, and the gain of its best cut in two."""

    entries: Indices
    score: float
    gain: float
    along: str
    first: int

    @classmethod
    def of(cls, scaled: _Scaled, entries: Indices, tolerance: float) -> "_Candidate":
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

    def parts(self, scaled: _Scaled) -> tuple[Indices, Indices]:
        """Return the entries on either side of the best cut."""
        order = np.argsort(getattr(scaled, self.along)[self.entries], kind="stable")
        return self.entries[order[: self.first]], self.entries[order[self.first :]]


def _merged(scaled: _Scaled, groups: list[Indices], pairs: Pairs, power: int) -> Bands:
    sums = np.stack(
        [scaled.moments[:, entries].sum(axis=1) for entries in groups], axis=1
    )
    s1, s2, _, _, by_rate, *_ = sums
    rate = by_rate / s2
    wavenumber = pairs.wavenumber.max() * (
        rate ** (1.0 / power) if power else np.ones_like(rate)
    )
    relative = (
        1.0 - float(np.sum(s2 * (s2 / s1))) / scaled.totals[2],
        1.0 - float(np.sum(s2 * (s2 / s1) ** 2)) / scaled.totals[3],
        1.0 - float(np.sum(s2 / rate)) / scaled.totals[5],
        _relaxation_error(scaled, 1, s2, rate),
    )
    errors = dict(zip(_ERRORS, relative, strict=True))
    if scaled.relaxing:
        errors["banded_error_relaxing_mean"] = _relaxation_error(scaled, 0, s1, rate)
    freedom = np.maximum(2.0 * s1 * (s1 / s2), 2.0)
    return Bands(
        pairs.weight.max() * s2 / s1,
        freedom,
        wavenumber,
        {k: max(float(v), 0.0) for k, v in errors.items()},
    )


def _relaxation_error(scaled: _Scaled, moment: int, sums: Array, rate: Array) -> float:
    """Return the largest difference over all times of Σ w^(n+1) e^(−2λt) over its start, where n is the ``moment``."""
    slowest = float(scaled.rate.min())
    if slowest == 1.0:
        return 0.0
    # pairs of nearly equal rate can be taken together here: 4000 classes are off by 1e-7 of the correlation
    edges = np.geomspace(slowest, 1.0 + 1e-12, 4001)
    place = np.clip(np.searchsorted(edges, scaled.rate, side="right") - 1, 0, 3999)
    part = np.bincount(place, scaled.moments[moment], 4000)
    mean = np.bincount(place, scaled.moments[moment] * scaled.rate, 4000) / np.where(
        part > 0.0, part, 1.0
    )

    def difference(lags: Array) -> Array:
        exact = np.sum(part * np.exp(-2.0 * mean * lags[:, np.newaxis]), axis=1)
        return np.abs(
            exact - np.sum(sums * np.exp(-2.0 * rate * lags[:, np.newaxis]), axis=1)
        )

    lags = np.geomspace(1e-2, 20.0 / slowest, _LAGS)
    coarse = difference(lags)
    high = np.flatnonzero(coarse >= 0.95 * coarse.max())
    near = np.linspace(
        lags[np.maximum(high - 1, 0)], lags[np.minimum(high + 1, _LAGS - 1)], 40
    )
    return (
        float(max(coarse.max(), difference(near.ravel()).max())) / scaled.totals[moment]
    )


@dataclass(frozen=True)
class BandedProcess(Renewing):
    """ΔΓ as a sum of squared Ornstein-Uhlenbeck processes, one for each band of modes.

    Notes
    -----
    A band's X is chi-square distributed with k degrees of freedom, k >= 2 and not whole. With
    e = exp(−∫λdt) and c = 1 − e² one step is exact for any dt:
    X' = (√c Z + e √X)² + 2c Γ((k − 1)/2), Z normal and Γ a standard gamma number; ΔΓ = ½ Σ weight X.
    Where amplitude relaxes, c is that of the renewed part times its g².
    """

    bands: Bands
    cell_errors: dict[str, float]
    correlation: Correlation
    amplitude: Amplitude

    @property
    def pairs(self) -> int:
        """Count of numbers in a state, half as many as for a mode pair."""
        return (self.bands.weight.size + 1) // 2

    @cached_property
    def half_weight(self) -> Array:
        """Energy of a band for X = 1, shape (bands,) [J/m^2]."""
        return 0.5 * self.bands.weight

    @cached_property
    def shapes(self) -> Array:
        """Shapes of the gamma numbers, shape (bands,)."""
        return 0.5 * (self.bands.freedom - 1.0)

    @cached_property
    def wavenumber(self) -> Array:  # type: ignore[override]
        """Wavenumber of a mode that has each band's rate [rad/m]."""
        return self.bands.wavenumber

    def _empty(self, members: int) -> Array:
        return np.zeros((members, self.bands.weight.size))

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
        _renew_bands(
            values,
            keep,
            renew,
            size,
            self.shapes,
            self.half_weight,
            noise.at(step),
            energy,
        )
        return energy

    @property
    def gammas(self) -> Gammas:
        return Gammas(self.bands.weight, 0.5 * self.bands.freedom, self.wavenumber)

    def draws(self, state: Fluctuation, steps: range, noise: Noise) -> Draws:
        law = self.correlation
        return Draws(
            values=state.values.copy(),
            energy=during(state.past.energy, len(steps) + 1),
            shapes=self.shapes,
            half_weight=self.half_weight,
            factors=factors(law, self.wavenumber),
            by_slip=law.by_slip,
            by_time=law.by_time,
            mean=self.mean,
            relaxing=self.amplitude.relaxing,
            answers=self._forgets_by_slip,
            address=noise.at(steps.start),
        )

    def known_errors(self) -> dict[str, float]:
        """Return the errors that banding adds to the mode sum of the cell, and the errors of the cell."""
        return (
            self.cell_errors
            | self.bands.errors
            | {"bands": float(self.bands.weight.size)}
        )


@inlined
def renew_band(x, keep, share, unit, shape, numbers):
    """Return X of a band after an exact step, by the shares that stay and are renewed, and the stream of numbers."""
    if share != 0.0:  # else nothing has passed: not even a rounding
        first, numbers = normal(numbers)
        rest, numbers = gamma(shape, numbers)
        kick = share * unit
        moved = kick * first + keep * math.sqrt(x)
        x = moved * moved + 2.0 * kick * kick * rest
    return x, numbers


@kernel(
    "void(float64[:,::1], float64[:,:,:], float64[:,:,:], float64[:,:], float64[::1], float64[::1],"
    " Tuple((uint64, uint64, uint64[::1], int64)), float64[:,::1])"
)
def _renew_bands(values, keep, renew, size, shapes, half_weight, address, energy):
    """Advance all bands of all members in place by exact steps, and write their energy after each step."""
    (seed, part, members, step), many = address, keep.shape[2] > 1
    for m in range(members.size):
        row = m % keep.shape[1]
        for s in range(len(keep)):
            numbers = stream(seed, part, members[m], step + s, 0)
            total, unit = 0.0, size[s, m % size.shape[1]]
            for k in range(shapes.size):
                i = k if many else 0
                x, numbers = renew_band(
                    values[m, k],
                    keep[s, row, i],
                    renew[s, row, i],
                    unit,
                    shapes[k],
                    numbers,
                )
                values[m, k] = x
                total += half_weight[k] * x
            energy[s, m] = total
