"""Statistics of a stationary run over its members and its second half together, each mean and quantile with its error.

Everything is read in blocks, twice: first for means and a sample, then for what is known beside these.
"""

import functools
from collections.abc import Callable, Collection, Iterator
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.blocks import at_records, blocks, keep
from sim.analysis.correlation import Covariance, inflation, seen, time_of
from sim.analysis.observables import all_observables, readings, settled
from sim.analysis.scene import MEMBERS, of_dataset, sweep_dims
from sim.analysis.statistics import LEVEL, QUANTILES, WIDE, described, interval, quantile_ranks, summary
from sim.numerics.tally import tally

#: From so many members on the spread of their means gives the error, whatever the correlation in time.
_MANY = 16
#: Values that a sample keeps at least, and how far from its level in it an exact quantile may lie.
_SAMPLE, _NEAR = 2**17, 0.01
#: Bytes of trajectories that are kept in memory from the first reading to the second.
_KEPT = 3 * 2**27
#: Records of the second half at which a slider's way is read.
_PLACES = 256
#: Values that fit into the processor's cache.
_STRIP = 2**16
_LEVELS = np.array(QUANTILES)


class Series:
    """Statistics of a stationary observable over members and records together, from two readings of its blocks.

    Parameters
    ----------
    members, records : int
        How many there are; less than 16 members come together.
    name : str
        Of the observable, which says whether it is a share.
    step : float
        Time between records [s].
    """

    def __init__(self, members: int, records: int, name: str = "", step: float = 1.0) -> None:
        self.members, self.records, self.name, self.step = members, records, name, step
        self.quantiles = _Quantiles()
        self.sums, self.counts = np.zeros(members), np.zeros(members)
        self.of_record = np.zeros(records if members > 1 else 0)
        self.under = np.zeros((len(_LEVELS), members))
        self.moments = np.zeros(3)
        few = members < _MANY
        self.seen = members if few else seen(members, records)
        self.covariance, self.flags = Covariance(records), [Covariance(records) for _ in _LEVELS] if few else []

    def first(self, values: np.ndarray, rows: slice, times: slice) -> None:
        """Read some records of some members, shape (members, records), for the first time."""
        if self.members > 1:
            self.of_record[times] += values.sum(axis=0)
        sums, counts = values.sum(axis=-1), values.shape[-1]
        if not np.isfinite(sums).all():
            known = np.isfinite(values)
            sums, counts, values = np.sum(values, axis=-1, where=known), known.sum(axis=-1), values[known]
        self.sums[rows] += sums
        self.counts[rows] += counts
        self.quantiles.sample(values)

    @functools.cached_property
    def means(self) -> np.ndarray:
        """Of each member in time."""
        with np.errstate(invalid="ignore"):  # nan is the mean of nothing
            return self.sums / self.counts

    @functools.cached_property
    def mean(self) -> float:
        return float(_mean(self.means))

    @functools.cached_property
    def rough(self) -> np.ndarray:
        """The quantiles, as far as the first reading gives them."""
        return self.quantiles.at(_LEVELS)

    @functools.cached_property
    def whole(self) -> bool:
        """Whether there is a value everywhere."""
        return bool(self.counts.sum() == self.members * self.records)

    def second(self, values: np.ndarray, rows: slice, times: slice) -> None:
        """Read some for the second time, in the order of the first, after the first reading of all."""
        several = self.members > 1
        some = values[: max(0, self.seen - rows.start)]
        if self.whole and len(some):
            self.covariance.add(some - (self.of_record[times] / self.members if several else self.mean))
        for first, strip in _strips(values, bool(self.flags)):
            at = rows.start + first
            self.quantiles.gather(strip, self.mean, self.rough, self.moments, self.under[:, at : at + len(strip)])
            for one, level, share in zip(self.flags if self.whole else (), self.rough, _LEVELS, strict=False):
                flags = strip <= level
                one.add(flags - (flags.mean(axis=0) if several else share))
        if times.stop == self.records:
            for one in (self.covariance, *self.flags):
                one.end()

    def found(self, differ: bool = True) -> dict[str, Any]:
        """The statistics, by name; see ``over_time``. What does not ``differ`` between members has no error."""
        with np.errstate(invalid="ignore", divide="ignore"):  # nan is the answer where there is nothing, or no spread
            count, squares, cubes = self.moments
            spread = float(np.sqrt(squares / count))
            spreads = [spread, *np.sqrt(_LEVELS * (1.0 - _LEVELS))]
            means = [self.means, *self.under / self.counts]
            free = max(self.members - 1, 1)
            covariance = self.covariance.over(self.seen * free / self.members)
            inflated = [(np.nan, np.nan)] * len(means)
            if self.flags and self.whole:
                aside = self.under[:, 0] / self.records - _LEVELS if self.members == 1 else np.zeros(len(_LEVELS))
                shares = [one.over(free) - off**2 for one, off in zip(self.flags, aside, strict=True)]
                inflated = [inflation(one, self.members, self.records) for one in (covariance, *shares)]
            of = zip(means, spreads, inflated, strict=True)
            errors, freedoms = np.transpose([_error(*one, float(count)) for one in of])
            low, high = interval(self.name, np.array(self.mean), errors[0], freedoms[0] + 1.0)
            skewness = cubes / count / spread**3 if spread > 1e-12 * abs(self.mean) else np.nan
            several = (spread / errors[0]) ** 2 if errors[0] > 1e-12 * abs(self.mean) else np.nan
        ends = np.tile(_LEVELS, (3, 1))
        if differ:
            surely = 1.0 if self.members >= _MANY else 0.5
            ends[1:] = _shares(np.array(spreads), errors, freedoms, surely)
        else:
            errors[0], low, high = 0.0, np.array(self.mean), np.array(self.mean)
        found = {"mean": self.mean, "std": spread, "sem": errors[0], "low": float(low), "high": float(high)}
        found |= {"skewness": skewness, "effective_samples": several}
        if self.whole:
            time = time_of(covariance, self.seen, self.records, self.step, self.quantiles.largest)
            found |= {"correlation_time": time.time, "correlation_time_sem": time.sem}
        at_ends = self.quantiles.at(ends.ravel()).reshape(ends.shape)
        return found | dict(zip(("quantile", "quantile_low", "quantile_high"), at_ends, strict=True))


def _strips(values: np.ndarray, few: bool) -> Iterator[tuple[int, np.ndarray]]:
    """Values in pieces that fit into the processor's cache: of few members of some records, else some members."""
    if few:
        length = max(1, _STRIP // len(values))
        yield from ((0, values[:, start : start + length]) for start in range(0, values.shape[1], length))
    else:
        rows = max(1, _STRIP // values.shape[1])
        yield from ((start, values[start : start + rows]) for start in range(0, len(values), rows))


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
        self.below, self.stride, self.total = np.zeros(len(_LEVELS), int), 1, 0

    def sample(self, known: np.ndarray) -> None:
        self.total += known.size
        kept = sum(some.size for some in self.some) + known.size // self.stride
        if (thinner := -(-kept // (2 * _SAMPLE))) > 1:
            self.some = [some[::thinner].copy() for some in self.some]
            self.stride *= thinner
        self.some.append(known[np.unravel_index(np.arange(0, known.size, self.stride), known.shape)])

    @property
    def largest(self) -> float:
        return float(np.max(np.abs(self.ordered), initial=0.0))

    @functools.cached_property
    def ordered(self) -> np.ndarray:
        """The sample in order."""
        return np.sort(np.concatenate(self.some))

    @functools.cached_property
    def sides(self) -> np.ndarray:
        """Between which values each quantile surely is."""
        return np.quantile(self.ordered, np.clip(_LEVELS[:, None] + _NEAR * np.array([-1.0, 1.0]), 0.0, 1.0))

    def gather(
        self, values: np.ndarray, mean: float, rough: np.ndarray, moments: np.ndarray, under: np.ndarray
    ) -> None:
        """Keep what lies near each quantile of the sample, where that is not all there is, and ``tally`` the rest."""
        sides = self.sides if self.stride > 1 else np.empty((0, 2))
        inside, near = np.zeros(len(sides), int), np.empty((len(sides), values.size))
        tally(values, mean, rough, sides, moments, under, self.below, inside, near)
        for k, (low, high) in enumerate(sides):
            self.near[k].append(near[k, : inside[k]].copy() if low < high else np.array([float(inside[k])]))

    def at(self, levels: np.ndarray) -> np.ndarray:
        """Quantiles of given levels, exact where what was kept holds them; nan beyond 0 and 1."""
        if not self.total:
            return np.full(len(levels), np.nan)
        found = np.quantile(self.ordered, np.clip(np.nan_to_num(levels), 0.0, 1.0))
        for (least, most), near, below in zip(self.sides, self.near, self.below, strict=True):
            values = np.sort(np.concatenate([*near, ()]))
            if near and least == most:  # of equal values only their number was kept
                values = np.broadcast_to(least, int(values.sum()))
            places = levels * (self.total - 1) - below
            held = (places >= 0.0) & (places <= values.size - 1.0)
            low = places[held].astype(int)
            high = np.minimum(low + 1, values.size - 1)
            found[held] = values[low] + (places[held] - low) * (values[high] - values[low])
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
    members, records = values.shape
    series, whole = Series(members, records, name, step), (slice(0, members), slice(0, records))
    series.first(values, *whole)
    series.second(values, *whole)
    return series.found()


@of_dataset
def distribution(dataset: xr.Dataset, names: Collection[str] | None = None) -> xr.Dataset:
    """Statistics of observables over the members and the second half of the run, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member; of a stationary run (see ``is_stationary``).
    names : collection of str, optional
        The observables, all by default.

    Returns
    -------
    xarray.Dataset
        ``…_mean``, ``…_sem``, ``…_low``, ``…_high``, ``…_std``, ``…_skewness``, ``…_effective_samples``,
        and with the dimension ``quantile`` ``…_quantile``, ``…_quantile_low``, ``…_quantile_high``; see ``over_time``.
        Of what is the same for all members there is no error.
    """
    dims, step = sweep_dims(dataset), 0.0
    if dataset.sizes["t"] > 1:
        step = float(dataset["t"][-1] - dataset["t"][-2])
    found: dict[str, xr.DataArray] = {}
    for some, observed in readings(dataset, names):
        done = {name.removesuffix("_mean") for name in found}
        for points in blocks(some, dims):
            group = some.isel(points)
            for name, (about, differ, each) in _series(group, observed, step, dims, names, done).items():
                for at in np.ndindex(each.shape):
                    place = tuple(points[dim].start + k for dim, k in zip(dims, at, strict=True))
                    for kind, value in each[at].found(differ).items():
                        key = f"{name}_{kind}"
                        if key not in found:
                            found[key] = _empty(dataset, kind, about)
                        found[key].values[place] = value
    if "speed_mean" in found and {"slider_position", "spring_force"} <= set(dataset):  # a slider that may slip
        for at, known in _of_the_way(dataset, dims):
            for kind, value in known.items():
                found[f"speed_{kind}"].values[at] = value
    return xr.Dataset(found)


def _of_the_way(dataset: xr.Dataset, dims: tuple[str, ...]) -> Iterator[tuple[tuple[int, ...], dict[str, float]]]:
    """Mean speed of a slider [m/s] with its error, by place in the sweep: slips come and go between two records.

    It is the way over the time, whose ends are anywhere in stick and slip: the way's spread about a steady one gives
    the error.
    """
    last, late = dataset.sizes["t"] - 1, dataset.sizes["t"] // 2
    records = np.unique(np.linspace(late, last, _PLACES).astype(int))
    way = at_records(keep(dataset, "slider_position"), records)["slider_position"]
    time, ways = way["t"].to_numpy() - float(way["t"][0]), _rows(way, dims)
    for at in np.ndindex(ways.shape[:-2]):
        if np.isnan(ways[at]).any():  # after a runaway there is none
            continue
        speeds = (ways[at][:, -1] - ways[at][:, 0]) / time[-1]
        off = np.std(ways[at] - speeds[:, np.newaxis] * time, axis=-1)
        mean, error = float(np.mean(speeds)), float(np.sqrt(2.0 * np.mean(off**2) / len(speeds)) / time[-1])
        yield at, {"mean": mean, "sem": error, "low": mean - WIDE * error, "high": mean + WIDE * error}


def of_second_half(dataset: xr.Dataset, names: Collection[str] | None = None) -> xr.Dataset:
    """The ``distribution`` of observables; of a dataset of statistics alone, those of their means over that time."""
    if "contact_radius" in dataset:
        return distribution(dataset, names)
    return summary(settled(all_observables(dataset)), quantiles=False)


def _series(
    group: xr.Dataset, observed: Callable[[xr.Dataset], xr.Dataset], step: float, dims: tuple[str, ...],
    names: Collection[str] | None, done: set[str],
) -> dict[str, tuple[xr.DataArray, bool, Any]]:  # fmt: skip
    """Each observable of some points of the sweep, whether members differ in it, and its series at each point.

    The second half of the run is read twice, in blocks of members and records.
    """
    members, records = group.sizes.get(MEMBERS, 1), group.sizes["t"]
    late, pieces = records // 2, []
    for block in blocks(group, (MEMBERS, "t") if members >= _MANY else ("t",)):
        times = slice(max(block["t"].start, late), min(block["t"].stop, records))
        if times.start < times.stop:
            pieces.append((block.get(MEMBERS, slice(0, members)), slice(times.start - late, times.stop - late)))
    half = group.isel(t=slice(late, None))
    if half.nbytes + 64 * half.sizes["t"] < _KEPT:  # the second reading is of memory; series keep records, too
        half.load()
    found: dict[str, tuple[xr.DataArray, bool, Any]] = {}
    parts: dict[str, tuple[xr.DataArray, np.ndarray]] = {}
    for reading in (Series.first, Series.second):
        for rows, times in pieces:
            if len(pieces) > 1 or not found:
                part = observed(half.isel({MEMBERS: rows, "t": times}, missing_dims="ignore").load())
                wanted = (set(part) if names is None else set(part) & set(names)) - done
                chosen = {str(key): one for key, one in part.items() if key in wanted}
                parts = {k: (v, _rows(v, dims)) for k, v in chosen.items() if rows.start == 0 or MEMBERS in v.dims}
            for name, (variable, values) in parts.items():
                if name not in found:
                    differ, each = MEMBERS in variable.dims, np.empty(values.shape[:-2], object)
                    for at in np.ndindex(each.shape):
                        each[at] = Series(members if differ else 1, records - late, name, step)
                    found[name] = xr.DataArray(0.0, attrs=variable.attrs, name=name), differ, each
                for at in np.ndindex(values.shape[:-2]):
                    reading(found[name][2][at], values[at], rows, times)
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
