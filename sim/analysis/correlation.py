"""How long the fluctuations of a stationary run remember: integral correlation times."""

import math
from typing import NamedTuple

import numpy as np
import scipy.fft
import xarray as xr

from sim.analysis.scene import MEMBERS, sweep_dims

#: How many correlation times the autocorrelation is summed over: what is cut off is e^-6 of it.
_WINDOW = 6.0


class IntegralTime(NamedTuple):
    """An integral correlation time and its standard error [s]."""

    time: float
    sem: float


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
        In seconds. nan where nothing fluctuates, where neighbouring records are correlated by less
        than 1/e (record more often), and where the run is shorter than the window (run longer, or
        with more members).

    Notes
    -----
    The autocovariance is averaged over members and times, of the deviations from the ensemble mean
    at each time (unbiased; for a single member from its own mean in time). Its integral
    ``T(W) = step (1/2 + sum of rho_k, k = 1 ... W)`` is cut at the smallest W >= 6 T(W)/step
    (A. Sokal, Monte Carlo Methods in Statistical Mechanics, 1997), which leaves out e^-6 of an
    exponential memory; the trapezoidal sum adds (step/T)^2/12. The standard error ``T sqrt(2 (2W +
    1)/n)``, n the number of free values, is Madras and Sokal's for a Gaussian process (J. Stat.
    Phys. 50 (1988) 109).

    Examples
    --------
    Values that forget by half from one record to the next:

    >>> rng = np.random.default_rng(5)
    >>> x = np.zeros((64, 4000))
    >>> for k in range(1, 4000):
    ...     x[:, k] = 0.5 * x[:, k - 1] + rng.normal(size=64)
    >>> time, sem = integral_time(x, step=1.0)
    >>> print(f"{0.5 + 0.5 / (1 - 0.5):.2f} {abs(time - 1.5) < 5 * sem} {sem < 0.03}")
    1.50 True True
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
    sums = 0.5 + np.concatenate([[0.0], np.cumsum(correlation[1:])])
    windows = np.flatnonzero(np.arange(records) >= _WINDOW * sums)
    if correlation[1] < math.exp(-1.0) or len(windows) == 0:
        return nothing
    window = int(windows[0])
    time = step * float(sums[window])
    return IntegralTime(time, time * math.sqrt(2.0 * (2.0 * window + 1.0) / (free * records)))


def correlation_time(dataset: xr.Dataset) -> xr.Dataset:
    """Integral correlation time of the fluctuation energy ΔΓ(t) at each point of the sweep.

    It has a meaning only while the process is stationary: it is nan wherever the speed changes
    during the run, and where ``integral_time`` says so.

    Returns
    -------
    xarray.Dataset
        ``correlation_time`` and ``correlation_time_sem`` [s] with the sweep's dimensions.
    """
    energy, speed = dataset.get("fluctuation_energy"), dataset["speed"]
    dims = sweep_dims(dataset)
    shape = tuple(dataset.sizes[name] for name in dims)
    times = np.full((2, *shape), np.nan)
    if energy is not None and MEMBERS in energy.dims and dataset.sizes["t"] > 1:
        step = float(dataset["t"][1] - dataset["t"][0])
        steady = (speed == speed.isel(t=0)).all("t").broadcast_like(dataset["contact_modulus"])
        for where in np.ndindex(shape):
            point = dict(zip(dims, where, strict=True))
            if bool(steady.isel(point)):
                member_rows = energy.isel(point).transpose(MEMBERS, "t").to_numpy().astype(float)
                times[(slice(None), *where)] = integral_time(member_rows, step)
    about = "integral correlation time of the fluctuation energy"
    coordinates = {name: dataset[name] for name in dims}
    return xr.Dataset(
        {
            "correlation_time": (dims, times[0], {"units": "s", "long_name": about, "symbol": "t_c"}),
            "correlation_time_sem": (dims, times[1], {"units": "s", "long_name": f"standard error of the {about}"}),
        },
        coordinates,
    )
