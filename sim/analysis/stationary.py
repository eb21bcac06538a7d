"""Statistics of a stationary run over members and its second half, each mean and quantile with its error."""

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.correlation import autocovariance, covariance_of, inflation, members_for_memory, time_of
from sim.analysis.observables import all_observables, chosen_observables, restricted, settled
from sim.analysis.scene import MEMBERS, in_pieces, plain, sweep_dims
from sim.analysis.statistics import (
    LEVEL,
    QUANTILES,
    WIDE,
    described,
    interval,
    quantile_ranks,
    summary,
    values_at_ranks,
)

#: From so many members on the spread of their means gives the error, whatever the correlation in time.
_MANY = 16
#: Records of the second half at which the displacement of a slider is read.
_PLACES = 256
_LEVELS = np.array(QUANTILES)


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
    found = _over_time(values[np.newaxis], step, name, True)
    return {kind: numbers[0] if kind.startswith("quantile") else float(numbers[0]) for kind, numbers in found.items()}


def _over_time(values: np.ndarray, step: float, name: str, differ: bool) -> dict[str, np.ndarray]:
    """Return the statistics of ``over_time`` at each point of a sweep, of values of shape (points, members, records).

    An observable that does not ``differ`` between members has no error.
    """
    points, members, _ = values.shape
    known = np.isfinite(values)
    counts = known.sum(axis=-1, dtype=float)
    total, whole = counts.sum(axis=-1), known.all(axis=(1, 2))
    if not whole.all():
        values = np.where(known, values, np.nan)
    ordered = np.sort(values.reshape(points, -1), axis=-1)  # nan last
    levels = values_at_ranks(ordered, _LEVELS * (total[:, np.newaxis] - 1.0))
    with np.errstate(invalid="ignore", divide="ignore"):  # nan is the answer where there is nothing, or no spread
        means = _sum(values) / counts
        mean = np.nansum(means, axis=-1) / np.isfinite(means).sum(axis=-1)
        deviations = values - mean[:, np.newaxis, np.newaxis]
        cubes = _sum(deviations**3).sum(axis=-1)
        np.square(deviations, out=deviations)
        spread = np.sqrt(_sum(deviations).sum(axis=-1) / total)
        below = [np.sum(values <= levels[:, k, np.newaxis, np.newaxis], axis=-1) / counts for k in range(len(_LEVELS))]
        del deviations, known
        memory = [_memory(*each, step, members) for each in zip(values, levels, mean, whole, strict=True)]
        inflated, times = (np.array(each) for each in zip(*memory, strict=True))
        spreads = np.array([spread, *np.broadcast_to(np.sqrt(_LEVELS * (1.0 - _LEVELS)), (points, len(_LEVELS))).T])
        errors, freedoms = _errors(np.array([means, *below]), spreads, np.moveaxis(inflated, -1, 0), total)
        low, high = interval(name, mean, errors[0], freedoms[0] + 1.0)
        skewness = np.where(spread > 1e-12 * abs(mean), cubes / total / spread**3, np.nan)
        effective = np.where(errors[0] > 1e-12 * abs(mean), (spread / errors[0]) ** 2, np.nan)
    ends = np.tile(_LEVELS, (2, points, 1))
    if differ:
        shares = (
            _shares(*each, 1.0 if members >= _MANY else 0.5)
            for each in zip(spreads.T, errors.T, freedoms.T, strict=True)
        )
        ends = np.stack(list(shares), axis=1)
    else:
        errors[0], low, high = 0.0, mean, mean
    result = {"mean": mean, "std": spread, "sem": errors[0], "low": low, "high": high}
    result |= {"skewness": skewness, "effective_samples": effective}
    if whole.any():
        result |= {"correlation_time": times[:, 0], "correlation_time_sem": times[:, 1]}
    ranks = ends * (total[:, np.newaxis] - 1.0)
    ranks[~((ends >= 0.0) & (ends <= 1.0))] = np.nan
    return result | {
        "quantile": levels, "quantile_low": values_at_ranks(ordered, ranks[0]),
        "quantile_high": values_at_ranks(ordered, ranks[1]),
    }  # fmt: skip


def _sum(values: np.ndarray) -> np.ndarray:
    """Return the sum over the last axis of the values that are not nan."""
    sums = values.sum(axis=-1)
    return sums if np.isfinite(sums).all() else np.nansum(values, axis=-1)


def _memory(
    values: np.ndarray, levels: np.ndarray, mean: float, whole: bool, step: float, members: int
) -> tuple[np.ndarray, tuple[float, float]]:
    """Return how many records count as one, for the mean and each quantile, with degrees of freedom; and the memory.

    nan if values are missing, and of many members, whose means give the errors.
    """
    inflated = np.full((2, 1 + len(levels)), np.nan)
    if not whole:
        return inflated, (np.nan, np.nan)
    records, free = values.shape[-1], max(members - 1, 1)
    some = members if members < _MANY else members_for_memory(members, records)
    common = values.mean(axis=0) if members > 1 else mean
    covariance = covariance_of(values[:some], common, some * free / members)
    if members < _MANY:
        inflated[:, 0] = inflation(covariance, members, records)
        for k, (level, share) in enumerate(zip(levels, _LEVELS, strict=True)):
            flags = (values <= level).astype(float)
            if members > 1:
                flag_covariance = autocovariance(flags)
            else:
                flag_covariance = covariance_of(flags, share, 1.0) - (flags.mean() - share) ** 2
            inflated[:, 1 + k] = inflation(flag_covariance, members, records)
    time = time_of(covariance, some, records, step, float(np.max(np.abs(values))))
    return inflated, (time.time, time.sem)


def _errors(
    means: np.ndarray, spreads: np.ndarray, inflated: np.ndarray, count: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return standard errors of means and their degrees of freedom, from the members' means or the autocorrelation.

    Parameters
    ----------
    means : array, shape (quantities, points, members)
    spreads : array, shape (quantities, points)
    inflated : array, shape (quantities, points, 2)
        See ``Inflation``.
    count : array, shape (points,)
        Number of values.
    """
    known, (records, freedom) = np.isfinite(means), np.moveaxis(inflated, -1, 0)
    members = known.sum(axis=-1)
    if known.all():
        std = means.std(axis=-1, ddof=1) if means.shape[-1] > 1 else np.full(spreads.shape, np.nan)
    else:
        center = np.nansum(means, axis=-1, keepdims=True) / members[..., np.newaxis]
        std = np.sqrt(np.nansum((means - center) ** 2, axis=-1) / np.where(members > 1, members - 1.0, np.nan))
    of_series = freedom > members - 1.0
    errors = np.where(of_series, spreads * np.sqrt(records / count * (1.0 + records / count)), std / np.sqrt(members))
    return errors, np.where(of_series, freedom, np.where(members > 1, members - 1.0, np.nan))


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
    dataset = plain(dataset)
    dims, late = sweep_dims(dataset), dataset.isel(t=slice(dataset.sizes["t"] // 2, None))
    step = float(dataset["t"][-1] - dataset["t"][-2]) if dataset.sizes["t"] > 1 else 0.0
    shape, found = tuple(dataset.sizes[dim] for dim in dims), dict[str, xr.DataArray]()
    for name in chosen_observables(restricted(late, names).isel(t=[-1]), names):
        variable = _observable(late, str(name))
        values = _rows(variable, dims)
        statistics = _over_time(values.reshape(-1, *values.shape[-2:]), step, str(name), MEMBERS in variable.dims)
        for kind, numbers in statistics.items():
            found[f"{name}_{kind}"] = _statistic(dataset, kind, variable, numbers.reshape((*shape, *numbers.shape[1:])))
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
    records = np.unique(np.linspace(late, last, _PLACES).astype(int)) - late
    way = dataset["slider_position"].isel(t=slice(late, None)).load().isel(t=records)
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


def _observable(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return an observable of a dataset in memory."""
    if name in dataset:
        return dataset[name].load()
    return in_pieces(restricted(dataset, [name]), ("t",), lambda piece: chosen_observables(piece, [name]))[name]


def _rows(variable: xr.DataArray, dims: tuple[str, ...]) -> np.ndarray:
    """Values of an observable with all dimensions of the sweep, shape (..., members, records)."""
    missing = [name for name in (*dims, MEMBERS) if name not in variable.dims]
    return variable.expand_dims(missing).transpose(*dims, MEMBERS, "t").to_numpy().astype(float, copy=False)


def _statistic(dataset: xr.Dataset, kind: str, variable: xr.DataArray, numbers: np.ndarray) -> xr.DataArray:
    """Return a statistic of an observable at all points of the sweep, described."""
    result = xr.full_like(dataset["contact_modulus"], np.nan, float)
    if kind.startswith("quantile"):
        result = result.expand_dims(quantile=list(QUANTILES), axis=-1)
    return result.copy(data=numbers).assign_attrs(described(kind, variable))
