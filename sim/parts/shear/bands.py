"""Grouping of a cell's modes into few bands, with every error known before the run.

ΔΓ is a sum over mode pairs of w ξ with ξ ~ Exp(1), of autocorrelation e^(−2λt). A *band* replaces
pairs of similar w and λ by one squared Ornstein-Uhlenbeck process of weight S2/S1 and 2 S1²/S2
degrees of freedom, rate Σw²λ/S2, where Sn = Σw^n: mean and variance of ΔΓ stay exact. The third and fourth cumulants
come out low (Cauchy) and the correlation time short (Jensen): all errors have one sign and each is a
sum over bands, so the band whose splitting gains most is split until every error is within the
tolerance.
"""

import heapq
import math
from dataclasses import dataclass

import numpy as np

from sim.parts.exchange import Array, Indices
from sim.parts.shear.mode_pairs import Pairs

#: Lags at which the autocorrelation of bands is compared.
_LAGS = 120

#: Errors of a grouping but for that of a mean that relaxes.
_ERRORS = tuple(
    f"banded_error_{name}" for name in ("third_cumulant", "fourth_cumulant", "correlation_time", "autocorrelation")
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

    @property
    def variance(self) -> float:
        """Variance of the energy of all bands."""
        return float(np.sum(0.5 * self.weight**2 * self.freedom))


def group(pairs: Pairs, power: int, tolerance: float, relaxing: bool = False) -> Bands:
    """Coarsest bands whose known errors all stay within a tolerance.

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
        return Bands(np.zeros(1), np.full(1, 2.0), pairs.wavenumber[:1], dict.fromkeys(_ERRORS, 0.0))
    scaled = _Scaled.of(pairs, power, relaxing)
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
        """The four errors of bands with these sums of moments, each over its share of the tolerance, added up."""
        s1, s2, s3, s4, by_rate, over_rate, by_rate_squared, once_by_rate, once_by_rate_squared = sums
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
    """A band with its share of the errors, and what its best cut in two would gain."""

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
        """The entries on either side of the best cut."""
        order = np.argsort(getattr(scaled, self.along)[self.entries], kind="stable")
        return self.entries[order[: self.first]], self.entries[order[self.first :]]


def _merged(scaled: _Scaled, groups: list[Indices], pairs: Pairs, power: int) -> Bands:
    sums = np.stack([scaled.moments[:, entries].sum(axis=1) for entries in groups], axis=1)
    s1, s2, _, _, by_rate, *_ = sums
    rate = by_rate / s2
    wavenumber = pairs.wavenumber.max() * (rate ** (1.0 / power) if power else np.ones_like(rate))
    found = (
        1.0 - float(np.sum(s2 * (s2 / s1))) / scaled.totals[2],
        1.0 - float(np.sum(s2 * (s2 / s1) ** 2)) / scaled.totals[3],
        1.0 - float(np.sum(s2 / rate)) / scaled.totals[5],
        _relaxation_error(scaled, 1, s2, rate),
    )
    errors = dict(zip(_ERRORS, found, strict=True))
    if scaled.relaxing:
        errors["banded_error_relaxing_mean"] = _relaxation_error(scaled, 0, s1, rate)
    freedom = np.maximum(2.0 * s1 * (s1 / s2), 2.0)
    return Bands(pairs.weight.max() * s2 / s1, freedom, wavenumber, {k: max(float(v), 0.0) for k, v in errors.items()})


def _relaxation_error(scaled: _Scaled, moment: int, sums: Array, rate: Array) -> float:
    """Largest difference over all times of Σ w^(n+1) e^(−2λt) over its start, n the ``moment``: mean or correlation."""
    slowest = float(scaled.rate.min())
    if slowest == 1.0:
        return 0.0
    # pairs of nearly equal rate can be taken together here: 4000 classes are off by 1e-7 of the correlation
    edges = np.geomspace(slowest, 1.0 + 1e-12, 4001)
    place = np.clip(np.searchsorted(edges, scaled.rate, side="right") - 1, 0, 3999)
    part = np.bincount(place, scaled.moments[moment], 4000)
    mean = np.bincount(place, scaled.moments[moment] * scaled.rate, 4000) / np.where(part > 0.0, part, 1.0)

    def difference(lags: Array) -> Array:
        exact = np.sum(part * np.exp(-2.0 * mean * lags[:, np.newaxis]), axis=1)
        return np.abs(exact - np.sum(sums * np.exp(-2.0 * rate * lags[:, np.newaxis]), axis=1))

    lags = np.geomspace(1e-2, 20.0 / slowest, _LAGS)
    coarse = difference(lags)
    high = np.flatnonzero(coarse >= 0.95 * coarse.max())
    near = np.linspace(lags[np.maximum(high - 1, 0)], lags[np.minimum(high + 1, _LAGS - 1)], 40)
    return float(max(coarse.max(), difference(near.ravel()).max())) / scaled.totals[moment]
