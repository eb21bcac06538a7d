"""Lifetimes of members, of which some are longer than the run: survival, medians and rates."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.read.correlation import LEVEL, WIDE, Array
from sim.read.dataset import MEMBERS, is_stationary
from sim.read.estimate import Estimate, Estimates
from sim.read.observables import defined, pure


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


def lifetime(
    times: Array, ends: Array | float, begins: Array | float = 0.0
) -> Lifetime:
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
    happened, watched, since = (
        np.isfinite(times)[counts],
        watched[counts],
        since[counts],
    )
    half = low = high = np.nan
    if np.any(happened) and np.all(np.isfinite(watched)):
        times, *curves = _kaplan_meier(watched, happened, since)
        below = [np.flatnonzero(curve <= 0.5) for curve in curves]
        half, low, high = (times[one[0]] if one.size else np.nan for one in below)
    count, exposure, tail = (
        float(happened.sum()),
        float(np.sum(watched - since)) or np.nan,
        0.5 - 0.5 * LEVEL,
    )
    if np.isnan(low) and watched.size and not np.any(since):
        going = watched.size - count
        if going and special.betaincinv(going, count + 1.0, tail) > 0.5:
            low = float(np.min(watched[~happened]))
    least = special.gammaincinv(count, tail) if count else 0.0
    most = special.gammaincinv(count + 1.0, 1.0 - tail)
    return Lifetime(
        half, low, high, count / exposure, least / exposure, most / exposure
    )


def _kaplan_meier(watched: Array, happened: Array, begins: Array) -> list[Array]:
    """Return the times of events and ends, Kaplan and Meier's survival then, and the ends of its 95 % interval.

    The numbers are those of ``scipy.stats.ecdf``, which takes no left truncation, and whose import would make the start
    of ``sim run`` a quarter longer. They are nan if nobody was watched for a while.
    """
    times, places, counts = np.unique(watched, return_inverse=True, return_counts=True)
    events, at_risk = (
        np.bincount(places, happened),
        watched.size - np.cumsum(counts) + counts,
    )
    at_risk = at_risk - np.sum(
        (begins > 0.0) & (begins >= times[:, np.newaxis]), axis=1
    )
    left = at_risk - events
    if np.any(left[:-1] <= 0):  # nobody was watched for a while
        return [times, *np.full((3, times.size), np.nan)]
    survival = (
        left / watched.size
        if np.all(happened) and not np.any(begins)
        else np.cumprod(left / at_risk)
    )
    # there is no interval if the survival is 1 or 0
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(survival)
        width = WIDE * np.sqrt(np.cumsum(events / (at_risk * left))) / np.abs(logarithm)
        ends = [
            np.exp(-np.exp(np.log(-logarithm) + side * width)) for side in (1.0, -1.0)
        ]
    if happened.sum() < 2:
        ends = [np.full(times.size, np.nan)] * 2
    return [times, survival, *ends]


#: Times of events that have a survival.
EVENTS = ("first_masked", "first_detachment")


def survival(dataset: xr.Dataset, event: str) -> xr.Dataset:
    """Return the share of the members that an event has not reached yet, over time.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member recorded.
    event : str
        Name of the time of the event: ``"first_masked"`` or ``"first_detachment"``.

    Returns
    -------
    xarray.Dataset
        ``survival`` with the ends ``low`` and ``high`` of its 95 % interval [1], over the dimension ``time`` [s] since
        the start of the run: 0, the times of the event in all members and points of the sweep, and the end of the run.
        The estimate is that of Kaplan and Meier with log-log intervals, because the run ends before the event has
        reached all members (censoring). A share of 1 or 0, or one event alone, has no log-log interval: there the
        interval is Clopper and Pearson's, a quantile of the Beta distribution. Members count from the time at which
        their contact closes. The numbers are nan from a time on at which no member was watched.

    Raises
    ------
    ValueError
        If there is no such event, or members were not recorded.
    """
    if event not in EVENTS:
        raise ValueError(f"{event[:40]} is no event; choose {' or '.join(EVENTS)}")
    if event not in dataset or MEMBERS not in dataset[event].dims:
        cure = "record each of several members: [record] per_member = true"
        raise ValueError(f"the survival of {event} is not known; {cure}")
    times = dataset[event].astype(float)
    begins, end = _at_risk_from(dataset, times), float(dataset["t"][-1])
    events = times.to_numpy()[np.isfinite(times.to_numpy())]
    grid = np.unique([0.0, *events, end])

    def curves(times: Array, begins: Array) -> Array:
        watched = np.where(np.isfinite(times), times, end)
        counts = (watched > begins) | ((begins == 0.0) & ~np.isnan(watched))
        result = np.full((3, grid.size), np.nan)
        if not counts.any():
            return result
        places, *values = _kaplan_meier(
            watched[counts], np.isfinite(times)[counts], begins[counts]
        )
        before = np.searchsorted(places, grid, side="right") - 1
        start = np.array([1.0, np.nan, np.nan])[:, np.newaxis]
        share, *ends = np.where(before < 0, start, np.array(values)[:, before])
        since = begins[counts][:, np.newaxis]
        exact = _exact(share, np.sum((since < grid) | (since == 0.0), axis=0))
        known = zip(ends, exact, strict=True)
        return np.stack([share, *(np.where(np.isnan(a), b, a) for a, b in known)])

    how: Any = {
        "input_core_dims": [[MEMBERS]] * 2,
        "output_core_dims": [["estimate", "time"]],
        "vectorize": True,
    }
    result = xr.apply_ufunc(curves, times, begins.broadcast_like(times), **how)
    words = dataset[event].attrs.get("long_name", event)
    texts = {
        "survival": f"share of the members before the {words}",
        "low": "lower end of its 95 % interval",
        "high": "upper end of its 95 % interval",
    }
    return xr.Dataset(
        {
            name: pure(result.isel(estimate=k), text)
            for k, (name, text) in enumerate(texts.items())
        },
        {"time": ("time", grid, {"units": "s", "long_name": "time since the start"})},
    )


def _exact(share: Array, members: Array) -> tuple[Array, Array]:
    """Return the ends of Clopper and Pearson's 95 % interval of a share of some members; nan if it is nan."""
    count, tail = share * members, 0.5 - 0.5 * LEVEL
    low = special.betaincinv(count, members - count + 1.0, tail)
    high = special.betaincinv(count + 1.0, members - count, 1.0 - tail)
    return np.where(count == 0.0, 0.0, low), np.where(count == members, 1.0, high)


def _at_risk_from(dataset: xr.Dataset, times: xr.DataArray) -> xr.DataArray:
    """Return the times from which on members are in contact [s], nan if they never are."""
    if not {"contact_radius", "first_closing"} <= dataset.keys():
        return xr.zeros_like(times, float)
    closed = dataset["contact_radius"].isel(t=0, drop=True) > 0.0
    start = float(dataset["t"][0])
    return (dataset["first_closing"] - start).where(~closed, 0.0)


def half_lives(dataset: xr.Dataset) -> Estimates:
    """Return the median times and rates of detachment and masking, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member recorded.

    Returns
    -------
    dict of str to Estimate
        ``half_detached``, ``half_masked`` [s] and, of a stationary run, ``detached_rate``, ``masked_rate`` [1/s] with
        their 95 % intervals; see ``lifetime``. Members that are open from the start count from the time at which they
        close, and never if they are never in contact. Empty where members do not differ. There is no median time of an
        event that no member has, nor of a single member; nor a rate in a scene that changes.
    """
    result = Estimates()
    happened = {"first_detachment": "detached", "first_masked": "masked"}
    is_at_rest = is_stationary(dataset)
    for event, name in happened.items():
        if event not in dataset or MEMBERS not in dataset[event].dims:
            continue
        times = dataset[event].astype(float)
        half, rate = lifetimes(dataset, times, name)
        if bool(times.notnull().any()) and times.sizes[MEMBERS] > 1:
            result[f"half_{name}"] = half
        if is_at_rest:
            result[f"{name}_rate"] = rate
    return result


def lifetimes(
    dataset: xr.Dataset, times: xr.DataArray, name: str
) -> tuple[Estimate, Estimate]:
    """Return the median time [s] and the rate [1/s] of an event, from its first ``times`` in the members [s].

    ``name`` is that of the event, ``"detached"`` or ``"masked"``. See ``lifetime``.
    """
    start, end = (float(dataset["t"][record]) for record in (0, -1))
    begins = _at_risk_from(dataset, times)
    how: Any = {
        "input_core_dims": [[MEMBERS]] * 3,
        "output_core_dims": [[]] * 6,
        "vectorize": True,
    }
    watched = xr.full_like(times, end - start, float)
    numbers = xr.apply_ufunc(
        lifetime, times - start, watched, begins.broadcast_like(times), **how
    )
    half, rate = (
        Estimate(defined(quantity, value), low=low, high=high)
        for quantity, (value, low, high) in (
            (f"half_{name}", numbers[:3]),
            (f"{name}_rate", numbers[3:]),
        )
    )
    return half, rate
