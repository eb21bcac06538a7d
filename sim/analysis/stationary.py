"""Statistics of a stationary run over its members and its second half together, each mean and quantile with its error.

Everything is read in blocks of members, twice: first for means and a sample, then for what is known beside these.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.blocks import blocks
from sim.analysis.correlation import autocovariance, inflation, time_of
from sim.analysis.observables import readings
from sim.analysis.scene import MEMBERS, of_dataset, sweep_dims
from sim.analysis.statistics import LEVEL, QUANTILES, described, interval, quantile_ranks

#: From so many members on the spread of their means gives the error, whatever the correlation in time.
_MANY = 16
#: Values that a sample keeps at least, and how far from its level in it an exact quantile may lie.
_SAMPLE, _NEAR = 2**17, 0.01
#: Values from which a correlation time is taken: the first members that have so many, at least 16.
_TRANSFORMED = 2**23
_LEVELS = np.array(QUANTILES)


class Series:
    """Statistics of a stationary observable over members and records together, from two readings of its blocks.

    Parameters
    ----------
    members : int
        How many there are; less than 16 come in one block.
    name : str
        Of the observable, which says whether it is a share.
    step : float
        Time between records [s].
    """

    def __init__(self, members: int, name: str = "", step: float = 1.0) -> None:
        self.members, self.name, self.step = members, name, step
        self.quantiles = _Quantiles()
        self.means: list[np.ndarray] = []
        self.under: list[list[np.ndarray]] = []
        self.of_record: Any = 0.0
        self.moments = np.zeros(3)
        self.covariance: Any = 0.0
        self.transformed = 0
        self.inflated = [(np.nan, np.nan)] * len(_LEVELS)

    def first(self, values: np.ndarray) -> None:
        """Read a block of members, shape (members, records), for the first time."""
        total = values.sum(axis=-1)
        whole = bool(np.isfinite(total).all())
        self.means.append(total / values.shape[-1] if whole else _mean(values))
        self.of_record = self.of_record + values.sum(axis=0)
        self.quantiles.sample(values if whole else values[np.isfinite(values)])

    @functools.cached_property
    def mean(self) -> float:
        return float(_mean(np.concatenate(self.means)))

    @functools.cached_property
    def rough(self) -> np.ndarray:
        """The quantiles, as far as the first reading gives them."""
        return self.quantiles.at(_LEVELS)

    @property
    def whole(self) -> bool:
        """Whether there is a value everywhere."""
        return bool(np.all(np.isfinite(self.of_record)))

    def second(self, values: np.ndarray) -> None:
        """Read a block for the second time, after the first reading of all."""
        known = None if self.whole else np.isfinite(values)
        deviations = values - self.mean if known is None else values[known] - self.mean
        squares = deviations * deviations
        self.moments += [deviations.size, squares.sum(), (squares * deviations).sum()]
        del deviations, squares
        for_each = (values <= level for level in self.rough)
        flags = [flag if known is None else np.where(known, flag, np.nan) for flag in for_each]
        self.under.append([flag.mean(axis=-1) if known is None else _mean(flag) for flag in flags])
        self.quantiles.gather(values)
        if self.whole and self.members < _MANY:
            self.inflated = [inflation(autocovariance(flag.astype(float)), self.members) for flag in flags]
        rows = values[: max(0, max(_MANY, _TRANSFORMED // values.shape[-1]) - self.transformed)]
        if self.whole and len(rows):
            mean = self.of_record / self.members if self.members > 1 else np.full(1, self.mean)
            self.covariance = self.covariance + autocovariance(rows, mean) * self.members / max(self.members - 1, 1)
            self.transformed += len(rows)

    def found(self, differ: bool = True) -> dict[str, Any]:
        """The statistics, by name; see ``over_time``. What does not ``differ`` between members has no error."""
        with np.errstate(invalid="ignore", divide="ignore"):  # nan is the answer where there is nothing, or no spread
            count, squares, cubes = self.moments
            spread = float(np.sqrt(squares / count))
            spreads = [spread, *np.sqrt(_LEVELS * (1.0 - _LEVELS))]
            means = [np.concatenate(self.means), *np.concatenate(self.under, axis=1)]
            covariance, own = self.covariance / max(self.transformed, 1), (np.nan, np.nan)
            if self.whole and self.members < _MANY:
                own = inflation(covariance, self.members)
            of = zip(means, spreads, [own, *self.inflated], strict=True)
            errors, freedoms = np.transpose([_error(*one, float(count)) for one in of])
            low, high = interval(self.name, np.array(self.mean), errors[0], freedoms[0] + 1.0)
            skewness = cubes / count / spread**3 if spread > 1e-12 * abs(self.mean) else np.nan
            several = (spread / errors[0]) ** 2 if errors[0] > 1e-12 * abs(self.mean) else np.nan
        ends = {"": _LEVELS, "_low": _LEVELS, "_high": _LEVELS}
        if differ:
            ends["_low"], ends["_high"] = _shares(
                np.array(spreads), errors, freedoms, 1.0 if self.members >= _MANY else 0.5
            )
        else:
            errors[0], low, high = 0.0, np.array(self.mean), np.array(self.mean)
        found = {"mean": self.mean, "std": spread, "sem": errors[0], "low": float(low), "high": float(high)}
        found |= {"skewness": skewness, "effective_samples": several}
        if self.whole:
            time = time_of(covariance, self.transformed, self.step, self.quantiles.largest)
            found |= {"correlation_time": time.time, "correlation_time_sem": time.sem}
        return found | {f"quantile{end}": self.quantiles.at(levels) for end, levels in ends.items()}


def _shares(
    spreads: np.ndarray, errors: np.ndarray, freedoms: np.ndarray, surely: float
) -> tuple[np.ndarray, np.ndarray]:
    """Shares of the values between which those under a quantile of the law are.

    They are those of as many free values as have the error of the share of values under it, of fewer where that error
    is not well known. There are none where the mean, which is first in each array, has too few free values for any:
    twice as few where they are estimated by the autocorrelation, which sees a tail seldom.
    """
    wider = errors * special.stdtrit(freedoms, 0.5 + 0.5 * LEVEL) / special.ndtri(0.5 + 0.5 * LEVEL)
    with np.errstate(divide="ignore", invalid="ignore"):  # what does not spread is known without end
        count = np.fmin(spreads**2 / wider**2, 1e12)
    none = np.isnan(quantile_ranks(surely * count[0], _LEVELS)[0])
    low, high = np.where(none, np.nan, quantile_ranks(count[1:], _LEVELS)) / (count[1:] - 1.0)
    return low, high


def _mean(values: np.ndarray) -> np.ndarray:
    """Mean over the last axis of what is known; nan where nothing is."""
    with np.errstate(invalid="ignore"):
        return np.nansum(values, axis=-1) / np.sum(~np.isnan(values), axis=-1)


def _error(means: np.ndarray, spread: float, inflated: tuple[float, float], count: float) -> tuple[float, float]:
    """Standard error of a mean and its degrees of freedom: from the means of the members, or the autocorrelation."""
    means, (records, freedom) = means[np.isfinite(means)], inflated
    if freedom > means.size - 1:
        return spread * float(np.sqrt(records / count * (1.0 + records / count))), freedom
    if means.size < 2:
        return np.nan, np.nan
    return float(means.std(ddof=1) / np.sqrt(means.size)), means.size - 1.0


class _Quantiles:
    """Quantiles of values that come twice: a sample of the first reading tells which of the second to keep."""

    def __init__(self) -> None:
        self.some: list[np.ndarray] = []
        self.near: list[list[np.ndarray]] = [[] for _ in _LEVELS]
        self.below, self.stride, self.total = [0] * len(_LEVELS), 1, 0

    def sample(self, known: np.ndarray) -> None:
        self.total += known.size
        self.some.append(known.ravel()[:: self.stride].copy())
        kept = sum(some.size for some in self.some)
        if kept > 2 * _SAMPLE:
            self.some = [np.concatenate(self.some)[:: kept // _SAMPLE]]
            self.stride *= kept // _SAMPLE

    @property
    def largest(self) -> float:
        return float(np.max(np.abs(self.ordered), initial=0.0))

    @functools.cached_property
    def ordered(self) -> np.ndarray:
        """The sample in order."""
        return np.sort(np.concatenate(self.some))

    def gather(self, values: np.ndarray) -> None:
        """Keep what lies near each quantile of the sample, where that is not all there is."""
        if self.stride > 1:
            sides = np.clip(_LEVELS[:, None] + _NEAR * np.array([-1.0, 1.0]), 0.0, 1.0)
            for k, (low, high) in enumerate(np.quantile(self.ordered, sides)):
                self.below[k] += int(np.count_nonzero(values < low))
                self.near[k].append(values[(values >= low) & (values <= high)])

    def at(self, levels: np.ndarray) -> np.ndarray:
        """Quantiles of given levels, exact where what was kept holds them; nan beyond 0 and 1."""
        if not self.total:
            return np.full(len(levels), np.nan)
        found = np.quantile(self.ordered, np.clip(np.nan_to_num(levels), 0.0, 1.0))
        for near, below in zip(self.near, self.below, strict=True):
            values = np.sort(np.concatenate([*near, ()]))
            places = levels * (self.total - 1) - below
            held = (places >= 0.0) & (places <= values.size - 1.0)
            found[held] = np.interp(places[held], np.arange(values.size), values) if held.any() else ()
        return np.where((levels >= 0.0) & (levels <= 1.0), found, np.nan)


def over_time(values: np.ndarray, step: float = 1.0, name: str = "") -> dict[str, Any]:
    """Statistics of a stationary observable over members and records together.

    Parameters
    ----------
    values : array, shape (members, records)
        nan where there is none.
    step : float
        Time between records [s].
    name : str
        Of the observable; ``"fraction_detached"`` and ``"fraction_masked"`` are shares.

    Returns
    -------
    dict
        ``mean``, ``sem``, ``low`` and ``high`` (95 % interval of the mean), ``std``, ``skewness``, ``quantile``,
        ``quantile_low`` and ``quantile_high`` (three each), ``effective_samples``: so many independent values tell
        as much of the mean, and ``correlation_time`` with ``correlation_time_sem`` [s], see ``integral_time``. What is
        not known is nan, as the errors of a single run that is shorter than its memory.

    Notes
    -----
    The error of the mean is that of the members' means in time; of fewer than 16 members that from the autocorrelation,
    summed over Sokal's window, where it has more degrees of freedom. The interval is Student's. The share of values
    under a quantile has such an error, too, and as many free values as have it tell between which order statistics the
    quantile is. Quantiles are exact.

    Examples
    --------
    A series of 2000 values that forget a tenth from one to the next tells as much as about a hundred:

    >>> rng = np.random.default_rng(3)
    >>> x = np.zeros((1, 2000))
    >>> for k in range(1, 2000):
    ...     x[:, k] = 0.9 * x[:, k - 1] + rng.normal(size=1)
    >>> found = over_time(x)
    >>> print(50 < found["effective_samples"] < 200, found["low"] < 0.0 < found["high"])
    True True
    """
    series = Series(len(values), name, step)
    series.first(values)
    series.second(values)
    return series.found()


@of_dataset
def distribution(dataset: xr.Dataset) -> xr.Dataset:
    """Statistics of every observable over the members and the second half of the run, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member; of a stationary run (see ``is_stationary``).

    Returns
    -------
    xarray.Dataset
        ``…_mean``, ``…_sem``, ``…_low``, ``…_high``, ``…_std``, ``…_skewness``, ``…_effective_samples``,
        and with the dimension ``quantile`` ``…_quantile``, ``…_quantile_low``, ``…_quantile_high``; see ``over_time``.
        Of what is the same for all members there is no error.
    """
    late, dims = dataset.isel(t=slice(dataset.sizes["t"] // 2, None)), sweep_dims(dataset)
    step = float(dataset["t"][-1] - dataset["t"][-2]) if dataset.sizes["t"] > 1 else 0.0
    found: dict[str, xr.DataArray] = {}
    for some, observed in readings(late):
        before = set(found)
        for points in blocks(some, dims):
            for name, (variable, each) in _series(some.isel(points), observed, step, dims).items():
                for at in np.ndindex(each.shape) if f"{name}_mean" not in before else ():
                    place = tuple(points[dim].start + k for dim, k in zip(dims, at, strict=True))
                    for kind, value in each[at].found(MEMBERS in variable.dims).items():
                        key = f"{name}_{kind}"
                        found.setdefault(key, _empty(dataset, kind, variable))[place] = value
    return xr.Dataset(found)


def _series(
    group: xr.Dataset, observed: Callable[[xr.Dataset], xr.Dataset], step: float, dims: tuple[str, ...]
) -> dict[str, tuple[xr.DataArray, Any]]:
    """Each observable of some points of the sweep, with its series at each of them, read twice in blocks of members."""
    members = group.sizes.get(MEMBERS, 1)
    pieces = list(blocks(group, (MEMBERS,))) if members >= _MANY else [{}]
    found: dict[str, tuple[xr.DataArray, Any]] = {}
    for reading in (Series.first, Series.second):
        for piece in pieces:
            for key, variable in observed(group.isel(piece)).items():
                name, values = str(key), _rows(variable, dims)
                if name not in found:
                    each = np.empty(values.shape[:-2], object)
                    for at in np.ndindex(each.shape):
                        each[at] = Series(members if MEMBERS in variable.dims else 1, name, step)
                    found[name] = variable, each
                for at in np.ndindex(values.shape[:-2]):
                    reading(found[name][1][at], values[at])
    return found


def _rows(variable: xr.DataArray, dims: tuple[str, ...]) -> np.ndarray:
    """Values of an observable with all dimensions of the sweep, shape (..., members, records)."""
    missing = [name for name in (*dims, MEMBERS) if name not in variable.dims]
    return variable.expand_dims(missing).transpose(*dims, MEMBERS, "t").to_numpy().astype(float, copy=False)


def _empty(dataset: xr.Dataset, kind: str, variable: xr.DataArray) -> xr.DataArray:
    """A statistic of an observable at all points of the sweep, still unknown."""
    empty = xr.full_like(dataset["contact_modulus"], np.nan, float)
    if kind.startswith("quantile"):
        empty = empty.expand_dims(quantile=list(QUANTILES), axis=-1).copy()
    return empty.assign_attrs(described(kind, variable))
