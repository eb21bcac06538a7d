"""Correlation times of stationary trajectories, and the errors of means over correlated records."""

import math
from typing import NamedTuple

import numpy as np
import scipy
import xarray as xr
from scipy import special

from sim.read.dataset import MEMBERS, STATISTIC, steady_points
from sim.read.estimate import Estimate

Array = np.ndarray
#: Share of repeated ensembles whose intervals hold the truth, and half of such an interval of a normal law in errors.
LEVEL = 0.95
WIDE = float(special.ndtri(0.5 + 0.5 * LEVEL))
#: How many correlation times the autocorrelation is summed over: what is cut off is e^-6 of it.
_WINDOW = 6.0
#: Records that a correlation time must span: Simpson's rule is then right to (1/2)^4/180, 0.03 %.
_FEWEST = 2.0
#: How many of its standard errors the correlation of neighbouring records is below that of ``_FEWEST``.
_SURELY = 4.0
#: Numbers that are transformed at once, and values that a correlation time is taken from.
AT_ONCE, _VALUES = 2**19, 2**22
#: Records between two values at first, and at most; times the window that must be inside at first.
_LAGS, _SAFELY = (2**13, 2**16), 2.0


class IntegralTime(NamedTuple):
    """An integral correlation time and its standard error [s], or the reason for none.

    If records are too coarse, ``below`` is an upper limit [s].
    """

    time: float = math.nan
    sem: float = math.nan
    below: float = math.nan
    reason: str = ""


def integral_time(values: Array, step: float) -> IntegralTime:
    """Return the integral correlation time of stationary trajectories: the integral of the autocorrelation.

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
    >>> time, sem, *_ = integral_time(x, step=1.0)
    >>> print(f"{-1 / math.log(0.8):.2f} {abs(time - 4.48) < 5 * sem} {sem < 0.1}")
    4.48 True True

    Every tenth record tells only that the time is shorter than two of them:

    >>> print(integral_time(x[:, ::10], step=10.0).below)
    20.0
    """
    members, records = values.shape
    if records < 2:
        return IntegralTime(reason="a single record has none")
    if not np.isfinite(values).all():
        return IntegralTime(reason="a contact has no value at some times")
    free = max(members - 1, 1)
    common = values.mean(axis=0) if members > 1 else values.mean()
    covariance = covariance_of(values, common, free)
    if not covariance[0] > (1e-10 * np.max(np.abs(values))) ** 2:
        return IntegralTime(reason="nothing fluctuates")
    correlation, lags = covariance / covariance[0], np.arange(covariance.size)
    coarse = math.exp(-1.0 / _FEWEST)
    if correlation[1] < coarse:
        error = 1.0 / math.sqrt(free * records)
        is_sure = correlation[1] < coarse - _SURELY * error
        return IntegralTime(
            below=_FEWEST * step if is_sure else math.nan,
            reason="fewer than two records in a correlation time: reduce clock.record",
        )
    weights = np.where(lags % 2, 4.0, 2.0) / 3.0
    weights[0] /= 2.0
    sums = np.cumsum(weights * correlation)
    inside = lags >= _WINDOW * sums
    if not inside.any():
        cure = "increase clock.duration or ensemble.members"
        return IntegralTime(reason=f"the run is too short for its memory: {cure}")
    window = int(inside.argmax())
    time = step * float(sums[window])
    return IntegralTime(
        time, time * math.sqrt(2.0 * (2.0 * window + 1.0) / (free * records))
    )


def members_for_memory(members: int, records: int) -> int:
    """Return the number of members that are enough for a correlation time."""
    return min(members, max(2, _VALUES // records))


def covariance_of(values: Array, mean: Array | float, free: float) -> Array:
    """Return the mean product of deviations by the number of records between them.

    Parameters
    ----------
    values : array, shape (..., members, records)
        Series; of long ones no more than 65,536 records between two are looked at, and 8192 if the memory ends before.
    mean : float or array, shape (..., records) or (..., 1)
        Value from which deviations are taken.
    free : float
        Number of independent series.
    """
    mean, records = (
        np.broadcast_to(mean, (*values.shape[:-2], values.shape[-1])),
        values.shape[-1],
    )
    for lags in np.unique(np.minimum(records, _LAGS)):
        result = _products(values, mean, lags) / (
            free * np.arange(records, records - lags, -1)
        )
        sums = np.cumsum(result, axis=-1)
        if np.all(
            np.any(
                np.arange(lags) * result[..., :1] >= _SAFELY * _WINDOW * sums, axis=-1
            )
        ):
            break
    return result


def _products(values: Array, mean: Array, lags: int) -> Array:
    """Return the sums of products of deviations by the number of records between them."""
    *points, members, records = values.shape
    length = scipy.fft.next_fast_len(lags, real=True)
    rows = max(1, AT_ONCE // (2 * length * math.prod(points)))
    power = np.zeros((2, *points, length + 1), complex)
    for first in range(0, members, rows):
        before = None
        # stretches; each with itself and with the one before
        for start in range(0, records, length):
            stretch = slice(start, start + length)
            some = (
                values[..., first : first + rows, stretch]
                - mean[..., np.newaxis, stretch]
            )
            spectrum = scipy.fft.rfft(some, 2 * length)
            power[0] += np.sum(spectrum.real**2 + spectrum.imag**2, axis=-2)
            if before is not None:
                power[1] += np.sum(spectrum * before.conj(), axis=-2)
            before = spectrum
    # the second is half the length later
    total = power[0] + (-1.0) ** np.arange(length + 1) * power[1]
    return scipy.fft.irfft(total, 2 * length)[..., :lags]


#: Degrees of freedom below which a single series is too short for its error: it seems to forget faster than it does,
#: and more than one interval in ten would miss the mean.
_TOO_FEW = 3.0


def inflation(covariance: Array, members: int, records: int) -> Array:
    """Return the variance of a mean over correlated records, in that of a mean over as many independent ones.

    Parameters
    ----------
    covariance : array
        As of ``covariance_of``.
    members, records : int
        Of how many members and records it is.

    Returns
    -------
    array, shape (..., 2)
        ``1 + 2 sum of the autocorrelation`` over records up to Sokal's window (see ``integral_time``), and the degrees
        of freedom of a variance that is estimated with it, ``n/(2W + 1)``; nan where there is no window, or if a single
        series spans fewer than three.

    Notes
    -----
    Of a single series the sum is corrected for the deviations being from its own mean (U. Wolff, Comput. Phys. Commun.
    156 (2004) 143).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        sums = 2.0 * np.cumsum(covariance / covariance[..., :1], axis=-1) - 1.0
        inside = np.arange(sums.shape[-1]) >= 0.5 * _WINDOW * sums
    window = inside.argmax(axis=-1)
    wide = (2.0 * window + 1.0) / records
    ratio = np.maximum(
        np.take_along_axis(sums, window[..., np.newaxis], axis=-1)[..., 0],
        1.0 / records,
    )
    known = (covariance[..., 0] > 0.0) & inside.any(axis=-1)
    if members == 1:
        ratio, known = ratio * (1.0 + wide), known & (wide * _TOO_FEW <= 1.0)
    return np.where(
        known[..., np.newaxis],
        np.stack([ratio, max(members - 1, 1) / wide], axis=-1),
        math.nan,
    )


def correlation_time(dataset: xr.Dataset) -> Estimate:
    """Return the integral correlation time [s] of the fluctuation energy ΔΓ(t) at each point of the sweep.

    It is that of the whole run and of a stationary process: there is none, and the reason is given, if the speed
    changes during the run, and where ``integral_time`` gives none. Where records are too coarse for a number the upper
    end of the interval alone is known.
    """
    energy, sweep = dataset.get("fluctuation_energy"), dataset["contact_modulus"]
    steady = (
        steady_points(dataset).broadcast_like(sweep).transpose(*sweep.dims).to_numpy()
    )

    def time_at(point: tuple[int, ...]) -> IntegralTime:
        if not steady[point]:
            return IntegralTime(reason="the speed changes")
        if energy is None or STATISTIC in energy.dims:
            return IntegralTime(reason="record fluctuation_energy of each member")
        if MEMBERS not in energy.dims:
            return IntegralTime(reason="nothing fluctuates")
        count = members_for_memory(energy.sizes[MEMBERS], energy.sizes["t"])
        series = energy.isel({MEMBERS: slice(count)})
        # a large file is read point by point
        values = series.isel(dict(zip(sweep.dims, point, strict=True)))
        step = float(dataset["t"][-1]) / max(dataset.sizes["t"] - 1, 1)
        return integral_time(
            values.transpose(MEMBERS, "t").to_numpy().astype(float), step
        )

    times = [time_at(point) for point in np.ndindex(sweep.shape)]

    def over_sweep(values: list[float] | list[str]) -> xr.DataArray:
        array = np.array(values, object if isinstance(values[0], str) else float)
        return xr.DataArray(array.reshape(sweep.shape), sweep.coords, sweep.dims)

    value, error, below = (
        over_sweep([getattr(time, name) for time in times])
        for name in ("time", "sem", "below")
    )
    value.attrs = {
        "units": "s",
        "long_name": "integral correlation time of the fluctuation energy",
        "symbol": "t_c",
    }
    half = WIDE * error
    return Estimate(
        value,
        error,
        value - half,
        (value + half).fillna(below),
        reason=over_sweep([time.reason for time in times]),
    )
