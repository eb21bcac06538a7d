"""Integral correlation times of the fluctuations in a stationary run."""

import math
from typing import Any, NamedTuple

import numpy as np
import scipy
import xarray as xr

from sim.analysis.scene import MEMBERS, steady_points

#: How many correlation times the autocorrelation is summed over: what is cut off is e^-6 of it.
_WINDOW = 6.0
#: Records that a correlation time must span: Simpson's rule is then right to (1/2)^4/180, 0.03 %.
_FEWEST = 2.0
#: How many of its standard errors the correlation of neighbouring records is below that of ``_FEWEST``.
_SURELY = 4.0


class IntegralTime(NamedTuple):
    """An integral correlation time and its standard error [s]; if records are too coarse, what it is below [s]."""

    time: float
    sem: float
    below: float = math.nan


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
    nothing = IntegralTime(math.nan, math.nan)
    if records < 2 or not np.all(np.isfinite(values)):
        return nothing
    free = max(members - 1, 1)
    deviation = values - (values.mean(axis=0) if members > 1 else values.mean())
    size = scipy.fft.next_fast_len(2 * records, real=True)
    power = np.abs(scipy.fft.rfft(deviation, size, axis=1)) ** 2
    covariance = scipy.fft.irfft(power.sum(axis=0), size)[:records] / (free * np.arange(records, 0, -1))
    if not covariance[0] > (1e-10 * np.max(np.abs(values))) ** 2:
        return nothing
    correlation = covariance / covariance[0]
    coarse = math.exp(-1.0 / _FEWEST)
    if correlation[1] < coarse:
        sure = correlation[1] < coarse - _SURELY / math.sqrt(free * records)
        return IntegralTime(math.nan, math.nan, _FEWEST * step if sure else math.nan)
    weights = np.where(np.arange(records) % 2, 4.0, 2.0) / 3.0
    weights[0] /= 2.0
    sums = np.cumsum(weights * correlation)
    windows = np.flatnonzero(np.arange(records) >= _WINDOW * sums)
    if len(windows) == 0:
        return nothing
    window = int(windows[0])
    time = step * float(sums[window])
    return IntegralTime(time, time * math.sqrt(2.0 * (2.0 * window + 1.0) / (free * records)))


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
    times = [xr.full_like(dataset["contact_modulus"], math.nan)] * 3
    if energy is not None and MEMBERS in energy.dims and dataset.sizes["t"] > 1:
        step = float(dataset["t"][1] - dataset["t"][0])
        stationary = energy.astype(float).where(steady_points(dataset))  # nan has no correlation time
        dims: Any = {"input_core_dims": [[MEMBERS, "t"]], "output_core_dims": [[]] * 3}
        times = xr.apply_ufunc(lambda values: integral_time(values, step), stationary, vectorize=True, **dims)
    about = "integral correlation time of the fluctuation energy"
    texts = {"": about, "_sem": f"standard error of the {about}", "_below": f"what the {about} is below"}
    found = xr.Dataset()
    for (suffix, text), values in zip(texts.items(), times, strict=True):
        found[f"correlation_time{suffix}"] = values
        found[f"correlation_time{suffix}"].attrs = {"units": "s", "long_name": text}
    found["correlation_time"].attrs["symbol"] = "t_c"
    return found
