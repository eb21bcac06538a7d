"""Means over the second half of a stationary run: with their errors, and whether the values have settled."""

import math
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.quantities import has_mean
from sim.read.control_variate import (
    ControlVariate,
    control_variate,
    corrected,
    is_corrected,
)
from sim.read.correlation import AT_ONCE, LEVEL, WIDE, Array, covariance_of, inflation
from sim.read.dataset import (
    MEMBERS,
    ROOM,
    STATISTIC,
    ensemble_mean,
    has_noise,
    in_pieces,
    only_statistics,
    plain,
    where,
    word,
)
from sim.read.estimate import Estimate, Estimates
from sim.read.observables import (
    FEW_LEFT,
    chosen_observables,
    closed_observables,
    is_of_contact,
    restricted,
)
from sim.read.statistics import QUANTILES, interval, quantile_ranks, values_at_ranks
from sim.units.notation import scaled, second_half

#: From so many members on the spread of their means gives the error, whatever the correlation in time: of the mean,
#: for which nothing else is needed of the members, and of the shares under quantiles.
_SEVERAL, _MANY = 4, 16
#: Change over the span, as a share of the value, above which a run without noise has not settled; and which no digit
#: that is printed shows.
_STILL, _UNSEEN = 1e-3, 1e-7
#: Records in which noise of a settled mean turns back: contacts that stay open only add up.
_ONE_WAY = 20
#: Share of settled means whose drift is taken for one.
_FALSE_ALARM = 0.01
#: Whole cycles that each half of a span needs; share of a span over which its begin and its end are averaged.
_CYCLES, _ENDS_SHARE = 2, 0.125
_SHORT = "too short to show that it has settled"
#: Records of a run without noise from which on it can be said to have settled.
_FEW_RECORDS = 4
_LEVELS = np.array(QUANTILES)


def _shares(
    spreads: Array, errors: Array, freedoms: Array, surely: float
) -> tuple[Array, Array]:
    """Return the shares of the ordered values between which each quantile of the law lies, at each point of a sweep.

    The number of free values follows from the error of the share of values below the quantile. It is smaller if that
    error is not well known. There are none if the mean, which is first in each array, has too few free values. Twice as
    many are required if they are estimated by the autocorrelation, because a tail is seldom sampled.
    """
    wider = errors * special.stdtrit(freedoms, 0.5 + 0.5 * LEVEL) / WIDE
    # what does not spread is known without end
    with np.errstate(divide="ignore", invalid="ignore"):
        count = np.where(
            np.isnan(wider) & (spreads > 0.0),
            np.nan,
            np.fmin(spreads**2 / wider**2, 1e12),
        )
    none = np.isnan(quantile_ranks(surely * count[0, :, np.newaxis], _LEVELS)[0])
    low, high = np.where(none, np.nan, quantile_ranks(count[1:].T, _LEVELS)) / (
        count[1:].T - 1.0
    )
    return low, high


def over_time(values: Array, name: str = "") -> dict[str, Any]:
    """Return statistics of a stationary observable over members and records together.

    Parameters
    ----------
    values : array, shape (members, records)
        nan where there is none.
    name : str
        Of the observable; ``"fraction_detached"`` and ``"fraction_masked"`` are shares.

    Returns
    -------
    dict
        ``value``, the mean, ``sem``, ``low`` and ``high`` (95 % interval of the mean), ``std``, ``quantile``,
        ``quantile_low`` and ``quantile_high`` (three each), and ``number``, the number of independent
        values with the same error of the mean. A number that is not known is nan, as the errors of a single run that
        is shorter than its memory.

    Notes
    -----
    The error of the mean is that of the members' means in time; of fewer than four members that from the
    autocorrelation, summed over Sokal's window, where it has more degrees of freedom. The interval is Student's. The
    share of values under a quantile has such an error, too, of fewer than 16 members by the autocorrelation, and as
    many free values as have it tell between which order statistics the quantile is. Quantiles are exact.

    Examples
    --------
    A series of 2000 values that forget a tenth from one to the next tells as much as about a hundred:

    >>> rng = np.random.default_rng(3)
    >>> x = np.zeros((1, 2000))
    >>> for k in range(1, 2000):
    ...     x[:, k] = 0.9 * x[:, k - 1] + rng.normal(size=1)
    >>> result = over_time(x)
    >>> print(50 < result["number"] < 200, result["low"] < 0.0 < result["high"])
    True True
    """
    result, _ = _over_time(values[np.newaxis], name, np.array([True]))
    return {
        kind: numbers[0] if kind.startswith("quantile") else float(numbers[0])
        for kind, numbers in result.items()
    }


def _over_time(
    values: Array, name: str, noisy: Array
) -> tuple[dict[str, Array], Array]:
    """Return the statistics of ``over_time`` at each point of a sweep, and the degrees of freedom of the error.

    Values have the shape (points, members, records). There are no errors at points that are not ``noisy``.
    """
    points, members, _ = values.shape
    known = np.isfinite(values)
    counts = known.sum(axis=-1, dtype=float)
    total = counts.sum(axis=-1)
    if not known.all():
        values = np.where(known, values, np.nan)
    ordered = np.sort(values.reshape(points, -1), axis=-1)  # nan last
    levels = values_at_ranks(ordered, _LEVELS * (total[:, np.newaxis] - 1.0))
    # nan is the answer where there is nothing, or no spread
    with np.errstate(invalid="ignore", divide="ignore"):
        means = _sum(values) / counts
        mean = np.nansum(means, axis=-1) / np.isfinite(means).sum(axis=-1)
        deviations = values - mean[:, np.newaxis, np.newaxis]
        np.square(deviations, out=deviations)
        spread = np.sqrt(_sum(deviations).sum(axis=-1) / total)
        below = [
            np.sum(values <= levels[:, k, np.newaxis, np.newaxis], axis=-1) / counts
            for k in range(len(_LEVELS))
        ]
        del deviations, known
        inflated = _memory(values, levels, mean, ordered[:, [0, -1]], bool(noisy.any()))
        spreads = np.array(
            [
                spread,
                *np.broadcast_to(
                    np.sqrt(_LEVELS * (1.0 - _LEVELS)), (points, len(_LEVELS))
                ).T,
            ]
        )
        errors, freedoms = _errors(np.array([means, *below]), spreads, inflated, total)
        effective = np.where(
            errors[0] > 1e-12 * abs(mean), (spread / errors[0]) ** 2, np.nan
        )
        ends, surely = (
            np.full((2, points, len(_LEVELS)), np.nan),
            1.0 if members >= _MANY else 0.5,
        )
        ends[:, noisy] = _shares(
            spreads[:, noisy], errors[:, noisy], freedoms[:, noisy], surely
        )
        if members >= _SEVERAL:
            errors, freedoms = _errors(
                means[np.newaxis], spreads[:1], np.full((1, points, 2), np.nan), total
            )
        sem, freedom = np.where(noisy, errors[0], np.nan), freedoms[0]
        low, high = interval(name, mean, sem, freedom + 1.0)
    result = {
        "value": mean,
        "std": spread,
        "sem": sem,
        "low": low,
        "high": high,
        "number": effective,
    }
    ranks = np.where(
        (ends >= 0.0) & (ends <= 1.0), ends * (total[:, np.newaxis] - 1.0), np.nan
    )
    lowest, highest = (values_at_ranks(ordered, end) for end in ranks)
    return result | {
        "quantile": levels,
        "quantile_low": lowest,
        "quantile_high": highest,
    }, freedom


def _sum(values: Array, axis: int = -1) -> Array:
    """Return the sum over an axis of the values that are not nan."""
    sums = values.sum(axis=axis)
    return sums if np.isfinite(sums).all() else np.nansum(values, axis=axis)


def _memory(
    values: Array, levels: Array, mean: Array, extremes: Array, noisy: bool
) -> Array:
    """Return how many records count as one, for the mean and each quantile, with degrees of freedom.

    The shape is (quantities, points, 2). They are nan of many members, whose means give
    the errors; at points whose values are not all known or all equal, by their least and
    largest value; and of quantiles if nothing is ``noisy``.
    """
    (points, members, records), free = values.shape, max(values.shape[1] - 1, 1)
    inflated = np.full((1 + len(_LEVELS), points, 2), np.nan)
    changes = extremes[:, 0] < extremes[:, 1]
    if members >= _MANY or not changes.any():
        return inflated
    size = max(1, AT_ONCE // (2 * members * records))
    for start in range(0, points, size):
        part = values[at := slice(start, start + size)]
        common = part.mean(axis=1) if members > 1 else mean[at, np.newaxis]
        covariance = covariance_of(part, common, free)
        for k in range(1 + len(_LEVELS) * noisy):
            if k:
                flags, share = (
                    part <= levels[at, k - 1, np.newaxis, np.newaxis],
                    _LEVELS[k - 1],
                )
                if members > 1:
                    covariance = covariance_of(flags, flags.mean(axis=1), free)
                else:
                    off = flags.mean(axis=(1, 2)) - share
                    covariance = (
                        covariance_of(flags, share, 1.0) - off[:, np.newaxis] ** 2
                    )
            inflated[k, at] = inflation(covariance, members, records)
    inflated[:, ~changes] = np.nan
    return inflated


def _errors(
    means: Array, spreads: Array, inflated: Array, count: Array
) -> tuple[Array, Array]:
    """Return standard errors of means and their degrees of freedom, from the members' means or the autocorrelation.

    Parameters
    ----------
    means : array, shape (quantities, points, members)
    spreads : array, shape (quantities, points)
    inflated : array, shape (quantities, points, 2)
        See ``inflation``.
    count : array, shape (points,)
        Number of values.
    """
    known, (records, freedom) = np.isfinite(means), np.moveaxis(inflated, -1, 0)
    members = known.sum(axis=-1)
    free = np.where(members > 1, members - 1.0, np.nan)
    center = np.nansum(means, axis=-1, keepdims=True) / members[..., np.newaxis]
    std = np.sqrt(np.nansum((means - center) ** 2, axis=-1) / free)
    of_series = freedom > members - 1.0
    errors = np.where(
        of_series,
        spreads * np.sqrt(records / count * (1.0 + records / count)),
        std / np.sqrt(members),
    )
    return errors, np.where(of_series, freedom, free)


class Settlement(NamedTuple):
    """Answer if a mean over a span is one, with the value of the span and those at its begin and its end.

    ``verdict`` is "" if the values have settled. The value is that at the end, of cycles the mean over whole ones, and
    the mean over the span if it is too short to tell. ``half`` is half of the 95 % interval by the scatter between
    cycles, nan without cycles. All of them may be arrays over the points of a sweep.
    """

    verdict: Any
    value: Any
    begin: Any
    end: Any
    half: Any

    def at(self, place: int) -> "Settlement":
        """Return the answer at one point of a sweep."""
        return Settlement(*(column[place] for column in self))

    def reason(self, unit: str, span: str) -> str:
        """Return why a span gives no mean, with the values at its ends in a unit; "" if it does."""
        if not self.verdict:
            return ""
        factor, shown = scaled(max(abs(self.begin), abs(self.end)), unit)
        texts = [
            [f"{factor * value:.{digits}g}" for value in (self.begin, self.end)]
            for digits in (4, 7)
        ]
        begin, end = texts[0] if texts[0][0] != texts[0][1] else texts[1]
        return f"{self.verdict}: {begin} → {end} {shown}".rstrip() + f" over {span}"


def settlements(values: Array, sem: Array, freedom: Array, noisy: Array) -> Settlement:
    """Return at each point of a sweep if values have settled: if their drift over the span is not above its error.

    Parameters
    ----------
    values : array, shape (points, members, records)
        nan where there is none.
    sem, freedom : array, shape (points,)
        Standard error of the mean over all values and its degrees of freedom, see ``over_time``.
    noisy : array, shape (points,)
        False if all members are equal and only cycles fluctuate.

    Notes
    -----
    The drift is the mean over the second half of the span less that over the first. Its error is that of the members'
    drifts; of fewer than four members twice the standard error of the mean, if that has more degrees of freedom.
    One settled mean of a hundred is taken for one that drifts. Where the values cross their mean often, whole cycles
    of both halves are compared with the scatter between cycles, too. A mean of 20 records that never turns back has not
    settled. Without noise values that change by less than 0.1 % have settled.

    Examples
    --------
    >>> time, unknown = np.linspace(0.0, 1.0, 200), np.full(2, np.nan)
    >>> courses = np.stack([np.exp(-time), 2.0 + np.sin(70.0 * time)])[:, np.newaxis]
    >>> states = settlements(courses, unknown, unknown, np.array([False, False]))
    >>> states.at(0).reason("N", "the second half")
    'not settled: 1 → 0.3679 N over the second half'
    >>> states.verdict[1]
    ''
    """
    half = values.shape[-1] // 2
    with np.errstate(invalid="ignore", divide="ignore"):
        known = np.isfinite(values)
        course = _sum(values, 1) / known.sum(axis=1)
        first, second = (
            _sum(values[at]) / known[at].sum(axis=-1)
            for at in (np.s_[..., :half], np.s_[..., half:])
        )
        drifts = second - first
        count = np.isfinite(drifts).sum(axis=-1)
        drift = np.nansum(drifts, axis=-1) / count
        squares = np.nansum((drifts - drift[:, np.newaxis]) ** 2, axis=-1)
        error = np.sqrt(squares / (count - 1.0)) / np.sqrt(count)
    of_members = (count > 1) & ((count >= _SEVERAL) | ~(freedom > count - 1.0))
    error, free = (
        np.where(of_members, error, 2.0 * sem),
        np.where(of_members, count - 1.0, freedom),
    )
    return _settled(course, drift, error, free, noisy)


def _settled(
    courses: Array, drift: Array, error: Array, free: Array, noisy: Array
) -> Settlement:
    """Return the settlements of the members' means over time, with drifts, their errors and degrees of freedom.

    ``courses`` have the shape (points, records); unknown records are left out.
    """
    result = Settlement(
        np.full(len(courses), "", object), *np.full((4, len(courses)), math.nan)
    )
    known, alike = np.isfinite(courses), dict[bytes, list[int]]()
    for place in np.flatnonzero(known.any(axis=1)).tolist():
        alike.setdefault(known[place].tobytes(), []).append(place)
    for points in alike.values():
        numbers = (each[points] for each in (drift, error, free, noisy))
        states = _settled_alike(courses[points][:, known[points[0]]], *numbers)
        for column, values in zip(result, states, strict=True):
            column[points] = values
    return result


def _settled_alike(
    course: Array, drift: Array, error: Array, free: Array, noisy: Array
) -> Settlement:
    """Return the settlements of ``_settled`` of courses that are known throughout."""
    records, chance = course.shape[1], 1.0 - 0.5 * _FALSE_ALARM
    few = max(1, int(_ENDS_SHARE * records))
    begin = np.where(noisy, course[:, :few].mean(axis=1), course[:, 0])
    end = np.where(noisy, course[:, -few:].mean(axis=1), course[:, -1])
    whole, change, bound = _cycles(course)
    mean = np.where(np.isfinite(change), whole, end)
    is_still = np.ptp(course, axis=1) <= np.where(noisy, _UNSEEN, _STILL) * np.max(
        np.abs(course), axis=1
    )
    limit = np.where(
        noisy, error * special.stdtrit(free, chance), _STILL * np.abs(mean)
    )
    is_short = np.isnan(limit) | (~noisy & (records < _FEW_RECORDS))
    steps, off = np.diff(course, axis=1), course > course.mean(axis=1, keepdims=True)
    is_one_way = np.zeros(len(course), bool)
    if records >= _ONE_WAY:
        is_one_way = np.all(steps >= 0.0, axis=1) | np.all(steps <= 0.0, axis=1)
    lasts = np.where(
        noisy, (np.abs(drift) <= limit) & ~is_one_way, np.abs(change) <= limit
    )
    has_settled = ~is_short & (lasts | (np.abs(change) <= bound))
    is_short |= ~noisy & (np.count_nonzero(off[:, 1:] > off[:, :-1], axis=1) > 1)
    still = is_still | (records == 1)
    verdicts = np.select([still | has_settled, is_short], ["", _SHORT], "not settled")
    values = np.select(
        [still, has_settled, is_short], [end, mean, course.mean(axis=1)], end
    )
    half = 0.5 * bound * WIDE / float(special.ndtri(chance))
    halves = np.where(~still & has_settled & (half > 0.0), half, math.nan)
    return Settlement(verdicts, values, begin, end, halves)


def _of_two(states: Settlement, noisy: Array) -> Settlement:
    """Return the settlements of two records, the first of which is the start of the run: the values at its end."""
    unknown = (noisy | (states.verdict == _SHORT)) & (states.begin != states.end)
    verdict, value = (
        np.where(unknown, "too few records", states.verdict),
        np.where(unknown, states.end, states.value),
    )
    return states._replace(verdict=verdict, value=value)


def _cycles(course: Array) -> Array:
    """Return the mean over whole cycles, its change from the first half to the second, and the 99 % bound of that.

    ``course`` has the shape (points, records). A cycle is from one rise through the mean to the next. If either half
    has fewer than two, the mean is nan, the change is infinite, and the bound is 0.
    """
    points, records = course.shape
    average = course.mean(axis=1)
    off, middle = course - average[:, np.newaxis], 0.5 * (records - 1)
    row, up = np.nonzero((off[:, :-1] < 0.0) & (off[:, 1:] >= 0.0))
    share = off[row, up] / (off[row, up] - off[row, up + 1])
    places, sums = up + share, np.cumsum(0.5 * (off[:, 1:] + off[:, :-1]), axis=1)
    sums = np.concatenate([np.zeros((points, 1)), sums], axis=1)
    at = sums[row, up] + share * (sums[row, up + 1] - sums[row, up])

    def total(numbers: Array) -> Array:
        return np.bincount(row[:-1][pair], numbers, points)

    means, error, known = [], np.zeros(points), np.ones(points, bool)
    with np.errstate(invalid="ignore", divide="ignore"):  # without cycles
        for chosen in (places <= middle, places >= middle):
            pair = (row[1:] == row[:-1]) & chosen[1:] & chosen[:-1]
            lengths, areas, count = (
                np.diff(places)[pair],
                np.diff(at)[pair],
                total(pair[pair]),
            )
            means.append(total(areas) / total(lengths))
            rest = (
                total((areas - means[-1][row[:-1][pair]] * lengths) ** 2)
                / total(lengths) ** 2
            )
            error, known = (
                error + rest * count / (count - 1.0),
                known & (count >= _CYCLES),
            )
    first, last = (
        np.searchsorted(row, np.flatnonzero(known), side) for side in ("left", "right")
    )
    average[known] += (at[last - 1] - at[first]) / (places[last - 1] - places[first])
    bound = float(special.ndtri(1.0 - 0.5 * _FALSE_ALARM)) * np.sqrt(error)
    nothing = np.array([[np.nan], [np.inf], [0.0]])
    return np.where(known, [average, means[1] - means[0], bound], nothing)


def _openings(counts: Array, members: int, again: str, span: str) -> str:
    """Return why contacts give no mean of what only a closed one has, by their count at each record; "" if they do."""
    left, closes = int(counts[-1]), bool(again) or bool(np.any(np.diff(counts) > 0))
    if members == 1 and closes:
        return f"the contact closes again in {span}"
    if members == 1 and not left:
        return f"the contact is open at the end of {span}"
    if closes:
        return f"{again or 'some'} of {members} contacts close again in {span}"
    if left <= FEW_LEFT and left < members:
        return f"{left or 'none'} of {members} contacts {'are' if left == 2 else 'is'} closed at the end of {span}"
    return ""


def distribution(
    dataset: xr.Dataset,
    names: Collection[str] | None = None,
    minus: Mapping[str, Any] | None = None,
) -> Estimates:
    """Return statistics of observables over the members and the second half of a stationary run.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a stationary run (see ``is_stationary``).
    names : collection of str, optional
        The observables, all by default.
    minus : dict, optional
        Values of swept keys, see ``where``: statistics are those of the differences from these points. A member has the
        same noise at all of them, so the differences are of each member, and their error is often far below the errors.

    Returns
    -------
    dict of str to Estimate
        At each point of the sweep; see ``over_time``. What the members have in common, and a run without noise, has no
        errors. What only a closed contact has is of the closed contacts. Of recorded statistics over the members there
        are value, error and interval.

        If values have not settled (see ``settlements``), there is a ``reason``, and the value is that at the end of the
        span. It is nan if some contacts have opened and at most two are left, or contacts close again. All else is then
        nan.

    Raises
    ------
    ValueError
        If differences are wanted, and members were not recorded.
    """
    dataset = plain(dataset)
    if not only_statistics(dataset):
        return _of_each(dataset, names, minus)
    if minus:
        raise ValueError("differences need every member: [record] per_member = true")
    return _of_statistics(dataset, names)


class _Span(NamedTuple):
    """The second half of a run: its words, points of the sweep, where something is random, and contacts that open.

    ``openings`` are the reasons for no mean of what only a closed contact has.
    """

    words: str
    sweep: xr.DataArray
    noisy: Array
    openings: list[str]


def _of_each(
    dataset: xr.Dataset,
    names: Collection[str] | None,
    minus: Mapping[str, Any] | None,
) -> Estimates:
    """Return the ``distribution`` of recorded members."""
    late, words = _late(dataset)
    step = float(late["t"][-1] - late["t"][0]) / max(late.sizes["t"] - 1, 1)
    sweep, noisy = dataset["contact_modulus"], has_noise(dataset).to_numpy().ravel()
    parts = [late] if not minus else [late, where(late, minus)]
    openings = [""] * sweep.size
    if "in_contact" in late:
        flags = [
            rows_of(part["in_contact"].compute(), part["contact_modulus"]) > 0.0
            for part in parts
        ]
        closed = np.logical_and.reduce(np.broadcast_arrays(*flags))
        closed = closed.reshape(-1, *closed.shape[-2:])
        again = (closed[..., 1:] & ~closed[..., :-1]).any(axis=-1).sum(axis=-1)
        openings = [
            _openings(count, closed.shape[1], str(some or ""), words)
            for count, some in zip(closed.sum(axis=1), again, strict=True)
        ]
    span, result = _Span(words, sweep, noisy, openings), Estimates()
    readers = [_reader(part, names) for part in parts]
    known = chosen_observables(restricted(late, names).isel(t=[-1]), names)
    control = None if minus else control_variate(late)
    for name in filter(has_mean, map(str, known)):
        variables = [reader(name) for reader in readers]
        differ = noisy & (MEMBERS in variables[0].dims)
        values, *base = (
            _series(part, variable, step)
            for part, variable in zip(parts, variables, strict=True)
        )
        values = values - base[0] if base else values
        values = values.reshape(-1, *values.shape[-2:])
        numbers, freedom = _over_time(values, name, differ)
        states = settlements(values, numbers["sem"], freedom, differ)
        if control is not None and is_corrected(name) and MEMBERS in variables[0].dims:
            numbers |= _at_known_mean(numbers, values, control, sweep)
        variable = variables[0].rename(name)
        one = _described(variable, numbers, span, states, differ)
        if MEMBERS in variable.dims:
            least = _fewest(values).reshape(sweep.shape)
            one = one._replace(members=xr.DataArray(least, sweep.coords, sweep.dims))
        result[name] = one
    return result


def _fewest(values: Array) -> Array:
    """Return the least number of members with a value of all records that have any, at each point of a sweep.

    ``values`` have the shape (points, members, records).
    """
    counts = np.isfinite(values).sum(axis=1)
    fewest = np.where(counts > 0, counts, values.shape[1]).min(axis=-1)
    return np.where(counts.any(axis=-1), fewest, 0)


def _at_known_mean(
    plain: dict[str, Array],
    values: Array,
    control: ControlVariate,
    sweep: xr.DataArray,
) -> dict[str, Array]:
    """Return mean, error and interval at the known mean of ΔΓ, where that is used, with plain mean and bound of bias.

    ``values`` have the shape (points, members, records).
    """
    averaged = control.late()
    regressors = [
        rows_of(each.expand_dims("t", -1), sweep).reshape(values.shape[:2])
        for each in averaged[:2]
    ]
    result = corrected(values.mean(axis=-1), *regressors)
    is_used = averaged.is_used.broadcast_like(sweep).transpose(*sweep.dims)
    is_used = is_used.to_numpy().ravel() & np.isfinite(result.sem)
    low, high = interval("", result.mean, result.sem, result.freedom + 1.0)
    numbers = {"value": result.mean, "sem": result.sem, "low": low, "high": high}
    chosen = {
        kind: np.where(is_used, array, plain[kind]) for kind, array in numbers.items()
    }
    bias = np.where(is_used, result.bias, np.nan)
    return chosen | {"plain": plain["value"], "bias": bias}


def _of_statistics(dataset: xr.Dataset, names: Collection[str] | None) -> Estimates:
    """Return the ``distribution`` of recorded statistics, from those of the members' means over the second half."""
    (late, words), sweep = _late(dataset), dataset["contact_modulus"]
    points, members = sweep.size, int(dataset.attrs["members"])
    noisy = has_noise(dataset).to_numpy().ravel()
    counts = np.full((points, late.sizes["t"]), members)
    if "in_contact" in late:
        share = rows_of(ensemble_mean(late["in_contact"]), sweep).reshape(counts.shape)
        counts = np.rint(members * share).astype(int)
    may = word(dataset, "contact.after_pull_off", "stop") == "reattach"
    may_close = may.broadcast_like(sweep).to_numpy().ravel()
    again = np.where(may_close & (counts.min(axis=-1) < members), "some", "")
    openings = [
        _openings(count, members, some, words)
        for count, some in zip(counts, again, strict=True)
    ]
    span, result = _Span(words, sweep, noisy, openings), Estimates()
    whole, later = (
        chosen_observables(_as_last(late, drifts), names) for drifts in (False, True)
    )
    for name, variable in closed_observables(late, names).items():
        name = str(name)
        if not has_mean(name):
            continue
        differ = noisy & (STATISTIC in variable.dims)
        (average, sem), (after, error) = (
            [
                rows_of(of[name].isel({STATISTIC: k}, missing_dims="ignore"), sweep)
                for k in (0, -1)
            ]
            for of in (whole, later)
        )
        average, sem, after, error = (
            each.ravel() for each in (average, sem, after, error)
        )
        free = (counts if is_of_contact(name) else np.full_like(counts, members)) - 1.0
        sem = np.where(differ, sem, np.nan)
        low, high = interval(name, average, sem, free[:, 0] + 1.0)
        course = rows_of(ensemble_mean(variable), sweep).reshape(points, -1)
        numbers = {"value": average, "sem": sem, "low": low, "high": high}
        halfway = free[:, free.shape[1] // 2]
        states = _settled(course, after - average, error, halfway, differ)
        result[name] = _described(
            ensemble_mean(variable).rename(name), numbers, span, states, differ
        )
    return result


def _reader(
    dataset: xr.Dataset, names: Collection[str] | None
) -> Callable[[str], xr.DataArray]:
    """Return a function that returns an observable; all are computed at once if the dataset is small."""
    if dataset.nbytes > ROOM:
        return partial(observable_of, dataset)
    return closed_observables(dataset.compute(), names).__getitem__


def _series(dataset: xr.Dataset, variable: xr.DataArray, step: float) -> Array:
    """Return values of an observable, shape (..., members, records); the speed of a slider that may slip by its way."""
    sweep = dataset["contact_modulus"]
    # single bonds slip without duration
    fewest = 1 if "bonds_sites" in dataset.variables else 2
    if (
        variable.name == "speed"
        and {"slider_position", "spring_force"} <= set(dataset)
        and dataset.sizes["t"] > fewest
    ):
        # slips come between two records
        return np.diff(rows_of(dataset["slider_position"].compute(), sweep)) / step
    return rows_of(variable, sweep)


def _described(
    variable: xr.DataArray,
    numbers: dict[str, Array],
    span: _Span,
    states: Settlement,
    noisy: Array,
) -> Estimate:
    """Return statistics of an observable over the sweep, with the reasons where there is no mean.

    ``numbers`` of each statistic have the points of the sweep first.
    """
    sweep, unit = span.sweep, variable.attrs.get("units", "1")
    states = _of_two(states, noisy) if span.words == "the run" else states
    is_contact = is_of_contact(str(variable.name))
    reasons = np.array(span.openings if is_contact else [""] * sweep.size, object)
    is_open = reasons != ""
    for place in np.flatnonzero(~is_open & (states.verdict != "")).tolist():
        reasons[place] = states.at(place).reason(unit, span.words)
    ends = np.where(is_open, np.nan, states.value)
    numbers["value"] = np.where((reasons != "") | ~noisy, ends, numbers["value"])
    # without noise cycles differ, if anything
    halves = np.where(noisy, math.nan, states.half)
    for kind, sign in (("low", -1.0), ("high", 1.0)):
        numbers[kind] = np.where(
            np.isnan(halves), numbers[kind], numbers["value"] + sign * halves
        )

    def over_sweep(values: Array) -> xr.DataArray:
        dims = (*sweep.dims, "quantile")[: sweep.ndim + values.ndim - 1]
        shaped = values.reshape(sweep.shape + values.shape[1:])
        return xr.DataArray(shaped, sweep.coords, dims)

    fields = {}
    for kind, values in numbers.items():
        if kind != "value":
            values[reasons != ""] = np.nan
        fields[kind] = over_sweep(values)
    fields["value"].attrs = variable.attrs
    return Estimate(**fields, reason=over_sweep(reasons))


def _late(dataset: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the records of the second half of the run, and words for it."""
    first, _ = second_half(dataset.sizes["t"])
    return dataset.isel(t=slice(first, None)), "the second half" if first else "the run"


def _as_last(late: xr.Dataset, with_drift: bool) -> xr.Dataset:
    """Return the last record with the recorded statistics of the members' means over the second half of the run.

    ``with_drift`` their drift is added to the means, with its standard error.
    """
    last, result = late.isel(t=[-1]), {}
    for name in (str(name) for name in last if f"late_{name}" in last):
        average, error, drift, drift_error = last[f"late_{name}"].transpose("late", ...)
        if with_drift:
            average, error = average + drift, drift_error
        moments = [average, math.nan * error, error]
        values = xr.concat(
            moments, last[STATISTIC], coords="minimal", compat="override"
        )
        values = values.drop_vars("late", errors="ignore").expand_dims(t=last["t"])
        result[name] = values.transpose(*last[name].dims)
    return last.assign(result)


def observable_of(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return an observable of a dataset in memory."""
    if name in dataset and not is_of_contact(name):
        return dataset[name].compute()  # load would keep each variable in the dataset
    return in_pieces(
        restricted(dataset, [name]),
        ("t",),
        lambda piece: closed_observables(piece, [name]),
    )[name]


def rows_of(variable: xr.DataArray, sweep: xr.DataArray) -> Array:
    """Return values of an observable at all points of the sweep, shape (..., members, records)."""
    sizes = {
        name: sweep.sizes.get(name, 1)
        for name in (*sweep.dims, MEMBERS)
        if name not in variable.dims
    }
    rows = (
        variable.drop_vars(sizes, errors="ignore")
        .expand_dims(sizes)
        .transpose(*sweep.dims, MEMBERS, "t")
    )
    return rows.to_numpy().astype(float, copy=False)
