"""Correlation in time of a stationary run: integral correlation times, and the error of a mean over time."""

import math
from typing import NamedTuple

import numpy as np
import scipy
import xarray as xr

from sim.analysis.scene import MEMBERS, steady_points, sweep_dims

#: How many correlation times the autocorrelation is summed over: what is cut off is e^-6 of it.
_WINDOW = 6.0
#: Records that a correlation time must span: Simpson's rule is then right to (1/2)^4/180, 0.03 %.
_FEWEST = 2.0
#: How many of its standard errors the correlation of neighbouring records is below that of ``_FEWEST``.
_SURELY = 4.0
#: Numbers that are transformed at once, values that a correlation time is taken from, and records apart at most.
_AT_ONCE, _VALUES, _LAGS = 2**19, 2**22, 2**16


class IntegralTime(NamedTuple):
    """An integral correlation time and its standard error [s]; if records are too coarse, what it is below [s]."""

    time: float
    sem: float
    below: float = math.nan


_NOTHING = IntegralTime(math.nan, math.nan)


def integral_time(values: np.ndarray, step: float) -> IntegralTime:
    """Integral correlation time of stationary trajectories: the integral of the autocorrelation.

    Parameters
    ----------
    values : array, shape (members, records)
        Independent members of one process.
    step : float
        Time between records [s].

    Returns
    -------
    IntegralTime
        In seconds. nan where nothing fluctuates, where the run is shorter than the window (run longer, or
        with more members), and where the time spans less than two records, so that no sum over records
        is right: then ``below`` is two records, if the records show it beyond their noise (record more often).

    Notes
    -----
    The autocovariance is averaged over members and times, of the deviations from the ensemble mean
    at each time (unbiased; for a single member from its own mean in time). Its integral is summed up to
    the smallest W at which ``W step >= 6 T(W)`` (A. Sokal, Monte Carlo Methods in Statistical Mechanics,
    1997), which leaves out e^-6 of an exponential memory, by Simpson's rule, which adds (step/T)^4/180 of it
    (the trapezoidal rule would add (step/T)^2/12). The standard error ``T sqrt(2 (2W + 1)/n)``, n the number
    of free values, is Madras and Sokal's for a Gaussian process (J. Stat. Phys. 50 (1988) 109).

    Examples
    --------
    Values that forget a fifth from one record to the next, ``exp(-1/T) = 0.8``:

    >>> rng = np.random.default_rng(5)
    >>> x = np.zeros((64, 4000))
    >>> for k in range(1, 4000):
    ...     x[:, k] = 0.8 * x[:, k - 1] + rng.normal(size=64)
    >>> time, sem, _ = integral_time(x, step=1.0)
    >>> print(f"{-1 / math.log(0.8):.2f} {abs(time - 4.48) < 5 * sem} {sem < 0.1}")
    4.48 True True

    Every tenth record tells only that the time is shorter than two of them:

    >>> integral_time(x[:, ::10], step=10.0)
    IntegralTime(time=nan, sem=nan, below=20.0)
    """
    members, records = values.shape
    if records < 2 or not np.all(np.isfinite(values)):
        return _NOTHING
    return time_of(autocovariance(values), members, records, step, max(values.max(), -values.min()))


def time_of(covariance: np.ndarray, members: int, records: int, step: float, largest: float) -> IntegralTime:
    """The ``integral_time`` of an autocovariance of so many members, whose values are as large as ``largest``."""
    free, lags = max(members - 1, 1), np.arange(len(covariance))
    if records < 2 or not covariance[0] > (1e-10 * largest) ** 2:
        return _NOTHING
    correlation = covariance / covariance[0]
    coarse = math.exp(-1.0 / _FEWEST)
    if correlation[1] < coarse:
        sure = correlation[1] < coarse - _SURELY / math.sqrt(free * records)
        return IntegralTime(math.nan, math.nan, _FEWEST * step if sure else math.nan)
    weights = np.where(lags % 2, 4.0, 2.0) / 3.0
    weights[0] /= 2.0
    sums = np.cumsum(weights * correlation)
    windows = np.flatnonzero(lags >= _WINDOW * sums)
    if len(windows) == 0:
        return _NOTHING
    window = int(windows[0])
    time = step * float(sums[window])
    return IntegralTime(time, time * math.sqrt(2.0 * (2.0 * window + 1.0) / (free * records)))


def members_for_memory(members: int, records: int) -> int:
    """Return the number of members that are enough for a correlation time."""
    return min(members, max(2, _VALUES // records))


def autocovariance(values: np.ndarray) -> np.ndarray:
    """Covariance of records by the number of records between them, averaged over members and times.

    Parameters
    ----------
    values : array, shape (members, records)
        Independent members of one process. Deviations are those from the ensemble mean at each record, of a single
        member from its own mean in time; and one member less counts as free.
    """
    members = len(values)
    mean = values.mean(axis=0) if members > 1 else values.mean()
    return covariance_of(values, mean, max(members - 1.0, 1.0))


def covariance_of(values: np.ndarray, mean: np.ndarray | float, free: float) -> np.ndarray:
    """Return the mean product of deviations by the number of records between them.

    Parameters
    ----------
    values : array, shape (members, records)
        Series; of long ones no more than 65,536 records between two are looked at.
    mean : float or array, shape (records,)
        Value from which deviations are taken.
    free : float
        Number of independent series.
    """
    members, records = values.shape
    lags = min(records, _LAGS)
    length = scipy.fft.next_fast_len(lags, real=True)
    power, rows = np.zeros((2, length + 1), complex), max(1, _AT_ONCE // (2 * length))
    mean = np.broadcast_to(mean, records)
    for first in range(0, members, rows):
        before = None
        for start in range(0, records, length):  # stretches; each with itself and with the one before
            stretch = slice(start, start + length)
            spectrum = scipy.fft.rfft(values[first : first + rows, stretch] - mean[stretch], 2 * length)
            power[0] += np.sum(spectrum.real**2 + spectrum.imag**2, axis=0)
            if before is not None:
                power[1] += np.sum(spectrum * before.conj(), axis=0)
            before = spectrum
    total = power[0] + (-1.0) ** np.arange(length + 1) * power[1]  # the second is half the length later
    return scipy.fft.irfft(total, 2 * length)[:lags] / (free * np.arange(records, records - lags, -1))


class Inflation(NamedTuple):
    """How many records tell as much as one free value, and of how many free values the estimate of that is."""

    records: float
    freedom: float


def inflation(covariance: np.ndarray, members: int, records: int) -> Inflation:
    """Variance of a mean over correlated records, in that of a mean over as many independent ones.

    Parameters
    ----------
    covariance : array
        As of ``autocovariance``.
    members, records : int
        Of how many members and records it is.

    Returns
    -------
    Inflation
        ``1 + 2 sum of the autocorrelation`` over records up to Sokal's window (see ``integral_time``), and the degrees
        of freedom of a variance that is estimated with it, ``n/(2W + 1)``; nan where there is no window.

    Notes
    -----
    Of a single series the sum is corrected for the deviations being from its own mean (U. Wolff, Comput. Phys. Commun.
    156 (2004) 143).
    """
    if not covariance[0] > 0.0:
        return Inflation(math.nan, math.nan)
    sums = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    windows = np.flatnonzero(np.arange(len(sums)) >= 0.5 * _WINDOW * sums)
    if len(windows) == 0:
        return Inflation(math.nan, math.nan)
    window, free = int(windows[0]), max(members - 1, 1)
    wide = (2.0 * window + 1.0) / records
    found = max(float(sums[window]), 1.0 / records) * (1.0 + wide if members == 1 else 1.0)
    return Inflation(found, free / wide)


def correlation_time(dataset: xr.Dataset) -> xr.Dataset:
    """Integral correlation time of the fluctuation energy ΔΓ(t) at each point of the sweep.

    Defined only for a stationary process: nan wherever the speed changes during the run, and where
    ``integral_time`` gives none.

    Returns
    -------
    xarray.Dataset
        ``correlation_time``, ``correlation_time_sem`` and, where records are too coarse for a number,
        ``correlation_time_below`` [s] with the sweep's dimensions.
    """
    energy = dataset.get("fluctuation_energy")
    times = [xr.full_like(dataset["contact_modulus"], math.nan) for _ in range(3)]
    if energy is not None and MEMBERS in energy.dims and dataset.sizes["t"] > 1:
        step = float(dataset["t"][1] - dataset["t"][0])
        energy = energy.isel({MEMBERS: slice(members_for_memory(energy.sizes[MEMBERS], energy.sizes["t"]))})
        all_points = steady_points(dataset).broadcast_like(dataset["contact_modulus"])
        steady = all_points.transpose(*sweep_dims(dataset)).to_numpy()
        for point in np.ndindex(steady.shape):
            if steady[point]:
                values = energy.isel(dict(zip(sweep_dims(dataset), point, strict=True))).to_numpy()
                found_here = integral_time(values.astype(float, copy=False), step)
                for each, number in zip(times, found_here, strict=True):
                    each[point] = number
    about = "integral correlation time of the fluctuation energy"
    texts = {"": about, "_sem": f"standard error of the {about}", "_below": f"what the {about} is below"}
    found = xr.Dataset()
    for (suffix, text), numbers in zip(texts.items(), times, strict=True):
        found[f"correlation_time{suffix}"] = numbers
        found[f"correlation_time{suffix}"].attrs = {"units": "s", "long_name": text}
    found["correlation_time"].attrs["symbol"] = "t_c"
    return found
