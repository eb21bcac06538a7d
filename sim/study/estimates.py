"""Statistics of an ensemble, each with the share that every member has in it.

A statistic T of independent members changes by the mean of their *influences* when the ensemble
changes a little (the delta method, or infinitesimal jackknife): its standard error is
``sqrt(Σ influence²/(M (M − 1)))``, however a member's own times are correlated. Two estimates that
share members, and so noise, may be compared by the influences of the shared ones.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Columns = NDArray[np.intp]

#: The statistics, in the order in which they are kept.
STATISTICS = ("mean", "standard deviation", "skewness", "1 % quantile", "99 % quantile", "correlation time")

_LOW, _HIGH = 0.01, 0.99

#: Independent values below the 1 % quantile (above the 99 %) without which it is not told.
_FEWEST_BEYOND = 10.0

#: Independent values without which a spread is not told.
_FEWEST = 50.0

#: A value that all but this share of cases have counts as certain: the rest is too rare to sample.
RARE = 1e-3

#: Share of equal values above which a quantile counts as one of a discrete distribution.
_MOST_EQUAL = 1e-3


class Lags(NamedTuple):
    """Which records the correlation time is taken from.

    ``earlier`` and ``later`` are columns of records of shape (lags, pairs) that lie 1, 2, ... times
    ``spacing`` [s] apart; ``pooled`` tells that all times have one distribution.
    """

    earlier: list[Columns]
    later: list[Columns]
    spacing: float
    pooled: bool


@dataclass(frozen=True, eq=False)
class Estimate:
    """A statistic and the influence of each member on it, shape (members,); nan where it cannot be told."""

    value: float
    influence: Array

    @property
    def standard_error(self) -> float:
        """Standard error of the value; nan of a single member."""
        count = self.influence.size
        if math.isnan(self.value) or count < 2:
            return math.nan
        return math.sqrt(float(np.sum(self.influence**2)) / (count * (count - 1.0)))

    def less(self, other: "Estimate") -> tuple[float, float]:
        """This value less another's, and the standard error of the difference; members of equal number are paired."""
        variance = self.standard_error**2 + other.standard_error**2
        if math.isnan(variance):
            return self.value - other.value, math.nan
        count, others = self.influence.size, other.influence.size
        common = min(count, others)
        shared = float(np.sum(self.influence[:common] * other.influence[:common]))
        variance -= 2.0 * shared / math.sqrt(count * (count - 1.0) * others * (others - 1.0))
        return self.value - other.value, math.sqrt(max(variance, 0.0))


_UNKNOWN = Estimate(math.nan, np.empty(0))


def estimates(values: Array, ends: Columns, lags: Lags | None) -> list[Estimate]:
    """The six ``STATISTICS`` of trajectories.

    Parameters
    ----------
    values : array, shape (members, records)
        Independent members.
    ends : array of int, shape (ends,)
        Columns whose distribution is asked for; several are taken together.
    lags : Lags, optional
        Where the correlation time is taken from; without it, and where a lag forgets all but 1/e, that is nan.

    Returns
    -------
    list of Estimate
        What does not fluctuate has its quantiles at the mean and no skewness and correlation time. Spread
        and skewness need fifty independent values, ten of them unlike the most common one and no
        fewer than one in a thousand; quantiles ten beyond them.

    Notes
    -----
    With z = (x − mean)/σ the influences are σz, σ(z² − 1)/2, z³ − 3z − γ − 3γ(z² − 1)/2 on mean,
    standard deviation and skewness γ, each averaged over a member's times; (p − [x <= q])/f(q) on a
    quantile; zz' − ρ(z² + z'²)/2 on a correlation ρ, whose trapezoidal sum over the lags is the
    correlation time.

    Of standard deviation and skewness the standard error is no less than that of gamma numbers as
    skewed, ``σ √((2 + 6/a)/4n)`` and ``√(6 (1 + 1/a)(1 + 5/a)/n)`` with a = 4/γ²: few values underrate it
    when they miss the tail. The density at a quantile is the least of those between the quantiles
    one, two and three standard errors of its level to either side (after Woodruff, J. Am. Stat. Assoc.
    47 (1952) 635); where many values are equal, as with counted bonds, the farther of the quantiles
    three away gives the standard error.

    Examples
    --------
    >>> draws = np.random.default_rng(3).exponential(size=(40000, 1))
    >>> for one in estimates(draws, np.array([0]), None)[:3]:
    ...     print(f"{one.value:.2f} {one.standard_error:.3f}")
    1.00 0.005
    1.00 0.007
    1.95 0.041
    """
    if values.shape[0] < 2:
        return [Estimate(float(values[:, ends].mean()), np.empty(0)), *[_UNKNOWN] * 5]
    chosen = values[:, ends]
    center = float(chosen.mean())
    deviation = chosen - center
    mean = Estimate(center, deviation.mean(axis=1))
    variance = float(np.mean(deviation**2)) + mean.standard_error**2
    sigma = math.sqrt(variance)
    if not sigma > 1e-12 * abs(center):
        still = np.zeros(values.shape[0])
        certain = Estimate(center, still)
        return [certain, Estimate(0.0, still), _UNKNOWN, certain, certain, _UNKNOWN]
    independent = variance / max(mean.standard_error**2, 1e-300)
    quantiles = _quantiles(chosen, independent)
    if independent < _FEWEST or _differing(chosen) < max(RARE, _FEWEST_BEYOND / independent):
        return [mean, _UNKNOWN, _UNKNOWN, *quantiles, _UNKNOWN]
    z = deviation / sigma
    square = z**2
    skew = float(np.mean(z**3))
    on_skew = (z**3 - 3.0 * z - skew - 1.5 * skew * (square - 1.0)).mean(axis=1)
    inverse = 0.25 * skew**2  # of the shape of a gamma number as skewed
    return [
        mean,
        _at_least(
            sigma, 0.5 * sigma * (square.mean(axis=1) - 1.0), sigma * math.sqrt((0.5 + 1.5 * inverse) / independent)
        ),
        _at_least(skew, on_skew, math.sqrt(6.0 * (1.0 + inverse) * (1.0 + 5.0 * inverse) / independent)),
        *quantiles,
        _correlation_time(values, lags, center, sigma) if lags is not None else _UNKNOWN,
    ]


def _at_least(value: float, influence: Array, error: float) -> Estimate:
    """An estimate whose standard error is raised where few values underrate it together with the tail."""
    found = Estimate(value, influence - influence.mean())
    small = found.standard_error
    return found if small >= error or small == 0.0 else Estimate(value, found.influence * (error / small))


def _differing(values: Array) -> float:
    """Share of values that are not the most common one."""
    middle = float(np.median(values))
    return float(np.mean(np.abs(values - middle) > 1e-9 * abs(middle)))


def _quantiles(values: Array, independent: float) -> list[Estimate]:
    """The 1 % and 99 % quantiles."""
    if independent * _LOW < _FEWEST_BEYOND:
        return [_UNKNOWN, _UNKNOWN]
    ordered = np.sort(values, axis=None)
    found = []
    for level in (_LOW, _HIGH):
        at = float(_at(ordered, level))
        share = level - (values <= at).mean(axis=1)
        share = share - share.mean()
        error = Estimate(level, share).standard_error
        slope = 0.0
        if error > 0.0 and np.count_nonzero(values == at) > _MOST_EQUAL * values.size:
            far = [abs(_at(ordered, level + k * error) - at) for k in (-3.0, 3.0)]
            slope = max(far) / error
        elif error > 0.0:
            slope = max(
                (_at(ordered, level + k * error) - _at(ordered, level - k * error)) / (2.0 * k * error)
                for k in (1, 2, 3)
            )
        found.append(Estimate(at, share * slope))
    return found


def _at(ordered: Array, level: float) -> float:
    """The quantile of sorted numbers, linear between them."""
    place = min(max(level, 0.0), 1.0) * (ordered.size - 1)
    low = min(int(place), ordered.size - 1)
    high = min(low + 1, ordered.size - 1)
    return float(ordered[low] + (place - low) * (ordered[high] - ordered[low]))


def _correlation_time(values: Array, lags: Lags, center: float, sigma: float) -> Estimate:
    """Integral of the autocorrelation over the lags, by the trapezoidal rule."""
    if lags.pooled:
        z = (values - center) / sigma
    else:
        spread = values.std(axis=0, ddof=1)
        if not np.all(spread > 1e-12 * np.abs(values).max()):
            return _UNKNOWN
        z = (values - values.mean(axis=0)) / spread
    total, influence = 0.5, np.zeros(values.shape[0])
    for number, (earlier, later) in enumerate(zip(lags.earlier, lags.later, strict=True), 1):
        before, after = z[:, earlier], z[:, later]
        product = (before * after).mean(axis=1)
        correlation = float(product.mean())
        if number == 1 and correlation < math.exp(-1.0):
            return _UNKNOWN
        rule = 0.5 if number == len(lags.earlier) else 1.0
        total += rule * correlation
        influence += rule * (product - 0.5 * correlation * (before**2 + after**2).mean(axis=1))
    return Estimate(lags.spacing * total, lags.spacing * (influence - influence.mean()))
