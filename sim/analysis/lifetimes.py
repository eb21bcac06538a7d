"""Times at which something first happens in a run, known although many a run ends before it does."""

import warnings
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.observables import ordered
from sim.analysis.scene import MEMBERS, is_stationary
from sim.analysis.statistics import LEVEL


class Lifetime(NamedTuple):
    """Median and rate of an event, with the ends of their 95 % intervals; nan what the runs are too short to tell.

    ``half`` [s] is the time by which it has happened in half of the members, ``rate`` [1/s] how often it
    happened in all the time in which it could.
    """

    half: float
    half_low: float
    half_high: float
    rate: float
    rate_low: float
    rate_high: float


def lifetime(times: np.ndarray, ends: np.ndarray | float) -> Lifetime:
    """Median and rate of an event that may come after a run's end.

    Parameters
    ----------
    times : array, shape (members,)
        When it happened [s]; nan where it did not.
    ends : float or array
        How long each member was watched [s].

    Notes
    -----
    The median is that of Kaplan and Meier's survival; its interval, after Brookmeyer and Crowley, holds the times at
    which the log-log interval of the survival has one half. The interval of the rate is that of a Poisson process,
    from chi-square.

    Examples
    --------
    Three of four members detach within 10 s:

    >>> found = lifetime(np.array([2.0, 5.0, 7.0, np.nan]), 10.0)
    >>> print(f"{found.half:.0f} s, {found.rate:.3f} /s, {found.rate_low:.2f} to {found.rate_high:.2f} /s")
    5 s, 0.125 /s, 0.03 to 0.37 /s
    """
    happened = np.isfinite(times)
    watched = np.where(happened, times, ends)
    half = low = high = np.nan
    if np.any(happened) and np.all(np.isfinite(watched)):
        half, low, high = _halves(watched, happened)
    count, exposure, tail = float(happened.sum()), float(np.sum(watched)), 0.5 - 0.5 * LEVEL
    if not exposure > 0.0:
        return Lifetime(half, low, high, np.nan, np.nan, np.nan)
    least = special.gammaincinv(count, tail) if count else 0.0
    most = special.gammaincinv(count + 1.0, 1.0 - tail)
    return Lifetime(half, low, high, count / exposure, least / exposure, most / exposure)


def _halves(watched: np.ndarray, happened: np.ndarray) -> list[float]:
    """Return the times at which a survival, and the ends of its interval, first are one half or less, or nan."""
    from scipy import stats  # its import takes a second

    survival = stats.ecdf(stats.CensoredData(uncensored=watched[happened], right=watched[~happened])).sf
    curves = [survival]
    if happened.sum() > 1:
        with warnings.catch_warnings(action="ignore", category=RuntimeWarning):  # no interval if it is 1 or 0
            interval = survival.confidence_interval(LEVEL, method="log-log")
        curves += [interval.low, interval.high]
    below = [curve.quantiles[curve.probabilities <= 0.5] for curve in curves]
    halves = [float(times[0]) if times.size else np.nan for times in below]
    return halves + [np.nan] * (3 - len(halves))


def first_passage(observable: xr.DataArray, level: float) -> xr.DataArray:
    """Time at which each member first crosses a level, from whichever side it begins [s]; nan where it never does.

    Between two records that lie on both sides of it the time is interpolated; a crossing there and back between two
    records is not seen.

    Parameters
    ----------
    observable : xarray.DataArray
        With the dimension ``t``, as a variable of a dataset or one of ``observables``.
    level : float
        In the unit of the observable.
    """
    above = observable.reset_coords(drop=True).astype(float) - level
    side = np.sign(above.isel(t=0))
    crossed = (above * side <= 0.0) & (side != 0.0)
    at = crossed.argmax("t")
    before, after, times = above.isel(t=(at - 1).clip(0)), above.isel(t=at), observable["t"]
    ends = times.isel(t=(at - 1).clip(0)), times.isel(t=at)
    share = (before / (before - after).where(before != after)).drop_vars("t", errors="ignore")
    first, last = (end.drop_vars("t", errors="ignore") for end in ends)
    found = (first + share * (last - first)).where(crossed.any("t"))
    found = found.where(side != 0.0, float(times[0]))
    text = f"time at which the {observable.attrs.get('long_name', observable.name)} first crosses {level:.6g}"
    return ordered(found).assign_attrs(units="s", long_name=text)


def half_lives(dataset: xr.Dataset, found: xr.Dataset) -> xr.Dataset:
    """Median times of the first detachment and masking, in a stationary run rates, from the ``events`` of a dataset."""
    of = xr.Dataset()
    for event, name, words in (
        ("first_detachment", "detached", "detached"),
        ("first_masked", "masked", "had their adhesion masked"),
    ):
        if event in found:
            of = of.merge(lifetimes(dataset, found[event], name, words))
    return of if is_stationary(dataset) else of.drop_vars([name for name in of if "_rate" in str(name)])


def lifetimes(dataset: xr.Dataset, times: xr.DataArray, name: str, words: str) -> xr.Dataset:
    """Median and rate of an event, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    times : xarray.DataArray
        When it first happened in each member [s], nan where it did not: ``events(dataset)["first_detachment"]``, or
        of ``first_passage``.
    name, words : str
        What the variables are named by, and what has happened: ``"detached"``, ``"detached"``.

    Returns
    -------
    xarray.Dataset
        ``half_<name>`` and ``<name>_rate``, with ``…_low`` and ``…_high``; see ``lifetime``. Empty where members do
        not differ.
    """
    if MEMBERS not in times.dims:
        return xr.Dataset()
    watched = float(dataset["t"][-1] - dataset["t"][0])
    values = np.moveaxis(times.to_numpy() - float(dataset["t"][0]), times.get_axis_num(MEMBERS), -1)
    one, found = times.isel({MEMBERS: 0}, drop=True), {}
    every = np.array([lifetime(members, watched) for members in values.reshape(-1, values.shape[-1])])
    half, rate = f"time by which half of the members have {words}", f"rate at which members have {words}"
    for k, field in enumerate(Lifetime._fields):
        stem, _, end = field.partition("_")
        key = "_".join(filter(None, [f"half_{name}" if stem == "half" else f"{name}_rate", end]))
        text = f"{'' if not end else f'{end} end of the 95 % interval of the '}{half if stem == 'half' else rate}"
        about = {"units": "s" if stem == "half" else "1/s", "long_name": text}
        found[key] = one.copy(data=every[:, k].reshape(one.shape)).assign_attrs(about)
    return xr.Dataset(found)
