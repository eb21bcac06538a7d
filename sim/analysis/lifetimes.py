"""Lifetimes of members, of which some are longer than the run: medians and rates."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.dataset import MEMBERS, is_stationary
from sim.analysis.observables import labelled
from sim.analysis.statistics import LEVEL, WIDE


class Lifetime(NamedTuple):
    """Median and rate of an event, with the ends of their 95 % intervals; nan if the runs are too short.

    ``half`` [s] is the time at which the event has occurred in half of the members. ``rate`` [1/s] is the number of
    events per exposure time.
    """

    half: float
    half_low: float
    half_high: float
    rate: float
    rate_low: float
    rate_high: float


def lifetime(times: np.ndarray, ends: np.ndarray | float, begins: np.ndarray | float = 0.0) -> Lifetime:
    """Return the median and the rate of an event that may come after a run's end.

    Parameters
    ----------
    times : array, shape (members,)
        When it happened [s]; nan where it did not.
    ends : float or array
        Until when each member was watched [s]; nan if it could not happen in a member, which then does not count.
    begins : float or array
        From when on it could happen in each member [s], such as the time at which its contact closed; nan as above.

    Notes
    -----
    Members are at risk from when on it could happen, and count only from then on (left truncation). The median is that
    of Kaplan and Meier's survival; its interval, after Brookmeyer and Crowley, holds the times at which the log-log
    interval of the survival has one half. The interval of the rate is that of a Poisson process, from chi-square.

    Examples
    --------
    Three of four members detach within 10 s:

    >>> result = lifetime(np.array([2.0, 5.0, 7.0, np.nan]), 10.0)
    >>> print(f"{result.half:.0f} s, {result.rate:.3f} /s, {result.rate_low:.2f} to {result.rate_high:.2f} /s")
    5 s, 0.125 /s, 0.03 to 0.37 /s
    """
    watched = np.where(np.isfinite(times), times, ends)
    since = np.broadcast_to(begins, watched.shape)
    counts = (watched > since) | ((since == 0.0) & ~np.isnan(watched))
    happened, watched, since = np.isfinite(times)[counts], watched[counts], since[counts]
    half = low = high = np.nan
    if np.any(happened) and np.all(np.isfinite(watched)):
        half, low, high = _halves(watched, happened, since)
    count, exposure, tail = float(happened.sum()), float(np.sum(watched - since)) or np.nan, 0.5 - 0.5 * LEVEL
    least = special.gammaincinv(count, tail) if count else 0.0
    most = special.gammaincinv(count + 1.0, 1.0 - tail)
    return Lifetime(half, low, high, count / exposure, least / exposure, most / exposure)


def _halves(watched: np.ndarray, happened: np.ndarray, begins: np.ndarray) -> list[float]:
    """Return the times at which a survival, and the ends of its interval, first are one half or less, or nan.

    The numbers are those of ``scipy.stats.ecdf``, whose import would make the start of ``sim run`` a quarter longer.
    """
    times, places, counts = np.unique(watched, return_inverse=True, return_counts=True)
    events, at_risk = np.bincount(places, happened), watched.size - np.cumsum(counts) + counts
    at_risk = at_risk - np.sum((begins > 0.0) & (begins >= times[:, np.newaxis]), axis=1)
    left = at_risk - events
    if np.any(left[:-1] <= 0):  # nobody was watched for a while
        return [np.nan] * 3
    survival = left / watched.size if np.all(happened) and not np.any(begins) else np.cumprod(left / at_risk)
    with np.errstate(divide="ignore", invalid="ignore"):  # there is no interval if the survival is 1 or 0
        logarithm = np.log(survival)
        width = WIDE * np.sqrt(np.cumsum(events / (at_risk * left))) / np.abs(logarithm)
        ends = [np.exp(-np.exp(np.log(-logarithm) + side * width)) for side in (1.0, -1.0)]
    curves = [survival, *ends] if happened.sum() > 1 else [survival]
    below = [np.flatnonzero(curve <= 0.5) for curve in curves]
    halves = [float(times[first[0]]) if first.size else np.nan for first in below]
    return halves + [np.nan] * (3 - len(halves))


def half_lives(dataset: xr.Dataset, event_times: xr.Dataset) -> xr.Dataset:
    """Return median times of first detachment and masking from ``events``, and rates if the run is stationary."""
    result = xr.Dataset()
    happened = {"first_detachment": ("detached", "detached"), "first_masked": ("masked", "had their adhesion masked")}
    for event, words in happened.items():
        result.update(lifetimes(dataset, event_times[event], *words) if event in event_times else {})
    return result if is_stationary(dataset) else result.drop_vars([name for name in result if "_rate" in str(name)])


def lifetimes(dataset: xr.Dataset, times: xr.DataArray, name: str, words: str) -> xr.Dataset:
    """Return the median and the rate of an event, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    times : xarray.DataArray
        When it first happened in each member [s], nan where it did not: ``events(dataset)["first_detachment"]``.
    name, words : str
        What the variables are named by, and what has happened: ``"detached"``, ``"detached"``.

    Returns
    -------
    xarray.Dataset
        ``half_<name>`` and ``<name>_rate``, with ``…_low`` and ``…_high``; see ``lifetime``. Members that are open from
        the start count from the time at which they close, and never if they are never in contact. Empty where
        members do not differ.
    """
    if MEMBERS not in times.dims:
        return xr.Dataset()
    start, end = (float(dataset["t"][record]) for record in (0, -1))
    begins = xr.zeros_like(times, float)
    if {"contact_radius", "first_closing"} <= dataset.keys():
        closed = dataset["contact_radius"].isel(t=0, drop=True) > 0.0
        begins = (dataset["first_closing"] - start).where(~closed, 0.0)
    how: Any = {"input_core_dims": [[MEMBERS]] * 3, "output_core_dims": [[]] * 6, "vectorize": True}
    watched = xr.full_like(times, end - start, float)
    estimates = iter(xr.apply_ufunc(lifetime, times - start, watched, begins.broadcast_like(times), **how))
    result = xr.Dataset()
    for key, unit, text in (
        (f"half_{name}", "s", f"time at which half of the members have {words}"),
        (f"{name}_rate", "1/s", f"rate at which members have {words}"),
    ):
        for side in ("", "low", "high"):
            about = f"{side} end of the 95 % interval of the {text}" if side else text
            result[f"{key}_{side}" if side else key] = labelled(next(estimates), unit, about)
    return result
