"""Speeds at which sliding has taken the contact area, with their errors, and extremes over a sweep."""

import contextlib
import itertools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.quantities import LOST, loss_in_words
from sim.read.clock_delay import of_course
from sim.read.correlation import LEVEL, Array
from sim.read.dataset import (
    MEMBERS,
    STATISTIC,
    ensemble_mean,
    in_pieces,
    is_steady,
    resolved,
    setting,
    speed_name,
    speed_of,
    stays_held,
    sweep_dims,
    word,
)
from sim.read.estimate import Estimate, Estimates
from sim.read.observables import (
    closed_observables,
    labelled,
    radius_at_work,
    reference_radii,
    restricted,
)
from sim.units.errors import BadInput
from sim.units.notation import engineering
from sim.units.quantity import read_option

#: Shares of a loss, in both orders of charging.
_CHARGED = (
    "lost_to_bonds",
    "lost_to_fluctuations",
    "lost_to_fluctuations_first",
    "lost_to_bonds_last",
    "lost_to_mean_stress",
    "lost_to_lag",
)
#: Groups of members that are left out in turn, and means of them, at most.
_GROUPS, _MOST_MEANS = 64, 2**22
#: Within how many standard errors of a level speeds are near it.
_NEAR = 4.0
#: Standard errors beyond which a difference of two interpolations is not noise.
_SEEN = 2.0
#: Speeds to each side of a level that its interpolation needs.
_REACH = 6
#: Reasons for a bound: below the speeds, above them, and above those at which all groups are in contact.
_BEYOND = (
    "more is lost at the lowest speed",
    "less is lost at the highest speed",
    "the contacts detach before this loss",
)
#: Reasons without a contact, and for a loss between rest and the lowest speed, or one that rest has already.
_NO_CONTACT = "contacts are open, or open even at the full work of adhesion"
_FROM_REST, _AT_REST = "less is lost at rest", "as much is lost at rest"
#: Names of branches by the sign of the change of the speed.
_WAYS = {1.0: "increasing speed", -1.0: "decreasing speed"}
#: Causes of the bound of a speed: the larger part is of the interpolation, or of the clock step.
_CAUSES = ("interpolation", "step")
#: Relative lag of a speed below which it is not stated.
_UNSEEN = 1e-3
#: Share of JKR's area above which the area that must be left is all of it, within rounding.
_WHOLE = 1.0 - 1e-9


class Crossing(NamedTuple):
    """A speed, the ends of its 95 % interval, and the reason if there is no speed.

    Unknown numbers are nan: an end alone is a bound. The interval holds the standard ``error`` by the members, with
    Student's factor, and the ``bound`` of the error of interpolation. ``beside`` holds further quantities at that
    speed, each with its interval, error and bound, shape (quantities, 5).
    """

    speed: float
    low: float
    high: float
    error: float
    bound: float
    reason: str
    beside: Array


def crossing(
    speeds: Array,
    groups: Array,
    sizes: Array,
    level: float,
    beside: Array | None = None,
) -> Crossing:
    """Return the speed at which the mean of a falling quantity has first fallen to a level.

    Parameters
    ----------
    speeds : array, shape (speeds,)
        In any order; speeds that are not above 0 are left out.
    groups : array, shape (groups, speeds)
        Means over groups of members.
    sizes : array, shape (groups,)
        Number of members of each group.
    level : float
        The level.
    beside : array, shape (quantities, groups, speeds), optional
        Further quantities to be read at that speed.

    Notes
    -----
    A monotone cubic (PCHIP) over the logarithm of the speed goes through the means. Speeds so close that noise hides
    the fall between them are first merged into blocks, two of which span four standard errors to both sides of the
    level; their curvature is corrected.

    The half-width of the interval is the root of the sum of squares of two errors. The statistical one is Student's,
    with the error of the jackknife that leaves each group out of the whole curve: noise that members have in common at
    different speeds counts as in common. The interpolation error is that of leaving out every second speed, either
    half of them, less its noise. The interval ends at the next speeds that are above or below the level for sure,
    because the curve falls. If it reaches both, or a half ends there, these speeds are all that is known.

    A speed of 0 has no logarithm. If rest has lost as much already, the loss has no speed. If the level is reached
    within the noise alone, nothing is known above the speed at which it is first reached.

    Quantities ``beside`` are interpolated linearly over the fall, so shares of it add up to it; their errors are alike.
    """
    free = len(groups) - 1.0
    student = float(special.stdtrit(free, 0.5 + 0.5 * LEVEL)) if free else 0.0
    curves = np.stack([groups - level, *(beside if beside is not None else ())])
    nan, nothing = math.nan, np.full((len(curves) - 1, 5), math.nan)
    none = Crossing(nan, nan, nan, nan, nan, "", nothing)
    highest, weight = np.fmax.reduce(speeds), (sizes / sizes.sum())[:, np.newaxis]
    is_closed = np.isfinite(curves[0]).all(axis=0)
    at_rest = np.sum(weight * curves[0][:, is_closed & (speeds == 0.0)], axis=0)
    speeds, order = np.unique(np.where(is_closed, speeds, 0.0), return_index=True)
    x, curves = np.log(speeds[speeds > 0.0]), curves[..., order[speeds > 0.0]]
    if not x.size:
        return none._replace(
            reason=_NO_CONTACT if highest > 0.0 else "the speed does not change here"
        )
    whole = np.sum(weight * curves, axis=1, keepdims=True)
    if free:
        whole = np.concatenate(
            [whole, (whole - weight * curves) / (1.0 - weight)], axis=1
        )
    mean = whole[0, 0]
    if mean[0] <= 0.0 and np.any(at_rest <= 0.0):
        return none._replace(reason=_AT_REST)
    near = _merged(x, whole, max(_NEAR, student))
    reason = near.reason
    if mean[0] <= 0.0:
        reason = _FROM_REST if at_rest.size else _BEYOND[0]
    elif not np.any(mean <= 0.0):
        reason = _BEYOND[1 + bool(speeds[-1] < highest)]
    low, high = math.exp(near.low), math.exp(near.high)
    bracket = none._replace(low=low, high=high, reason=reason)
    if not 2 <= near.place <= len(near.x) - 2:
        return bracket
    return _at_level(near, student) or bracket


class _Merged(NamedTuple):
    """Means at logarithms of speeds, merged as far as noise hides their fall, and what is known of a level of 0.

    ``whole`` has the shape (quantities, 1 + groups, speeds), of which the first row is the mean, and each other one
    leaves a group out. The mean first reaches the level at ``place``; ``low`` and ``high`` are the next logarithms at
    which it is above and below for sure, nan where there are none.
    """

    x: Array
    whole: Array
    place: int
    low: float
    high: float
    reason: str


def _jackknife(rows: Array) -> Array:
    """Return the standard error of a first row by the others, each of which leaves a group out; 0 without others."""
    return np.sqrt(
        max(len(rows) - 2.0, 0.0) * np.var(rows[min(1, len(rows) - 1) :], axis=0)
    )


def _merged(x: Array, whole: Array, sure: float) -> _Merged:
    """Return means about a level of 0 in blocks of speeds, two of which span ``sure`` errors to both sides of it."""
    mean, count = whole[0, 0], len(x)
    falls, first = bool(np.any(mean <= 0.0)), int(np.argmax(mean <= 0.0))
    far = np.flatnonzero(np.abs(mean) > sure * _jackknife(whole[0])[first])
    begin = max(far[far < first - 1], default=-1) + 1
    end = min(far[far > first], default=count)
    block = max(1, (end - begin) // 2) if falls and mean[0] > 0.0 else 1
    edges = np.unique([0, *range(begin % block, count, block)])
    sizes = np.diff([*edges, count])
    x = np.add.reduceat(x, edges) / sizes
    whole = np.add.reduceat(whole, edges, axis=-1) / sizes
    if block > 1:
        whole[..., 1:-1] -= np.diff(whole, 2) / 24.0
    mean, surely = whole[0, 0], sure * _jackknife(whole[0])
    place = int(np.argmax(mean <= 0.0)) if np.any(mean <= 0.0) else len(x)
    before = place
    if place == len(x) and falls:
        # the level is reached in the noise, and nothing is known from there on
        before = int(np.searchsorted(edges, first, side="right")) - 1
    low = max(x[:before][mean[:before] > surely[:before]], default=math.nan)
    high = min(x[place:][mean[place:] < -surely[place:]], default=math.nan)
    reason = f"known only between two of {count} speeds"
    if whole.shape[1] > 1 and (math.isnan(low) or math.isnan(high)):
        reason = "hidden by the noise; add members"
    return _Merged(x, whole, place, low, high, reason)


def _at_level(near: _Merged, student: float) -> Crossing | None:
    """Return the speed at a level of 0 and the quantities there; None if its interval is no narrower than is known.

    ``student`` is the factor of the standard error.
    """
    begin = max(near.place - _REACH, 0)
    x, whole = (each[..., begin : near.place + _REACH] for each in near[:2])
    rows, k = whole[0], near.place - begin

    def errors(rows: Array, *coarser: Array) -> tuple[float, float, float]:
        """Return half of the interval, the standard error, and the bound of the interpolation."""
        off = (each - rows for each in coarser)
        bound = math.hypot(
            *(
                math.sqrt(max(0.0, d[0] ** 2 - (_SEEN * _jackknife(d)) ** 2))
                for d in off
            )
        )
        scatter = float(_jackknife(rows))
        return math.hypot(student * scatter, bound), scatter, bound

    def over_the_fall(values: Array, a: int, b: int) -> Array:
        """Return values at the level by a straight line between two places."""
        share = rows[:, a] / (rows[:, a] - rows[:, b])
        return values[:, a] + share * (values[:, b] - values[:, a])

    at = next(place for place in _places(x, rows[0], 0.0) if place >= x[k - 1])
    halves = (_interpolated(x[half::2], rows[:, half::2], at) for half in (0, 1))
    width, scatter, bound = errors(_interpolated(x, rows, at), *halves)
    above, below = (_places(x, rows[0], end) for end in (width, -width))
    low = np.fmax(near.low, max(above[above <= at], default=near.low))
    high = np.fmin(near.high, min(below[below >= at], default=near.high))
    if (low, high) == (near.low, near.high) and width > 0.0:
        return None
    intervals = []
    for values in whole[1:]:
        fine, coarse, other = (
            over_the_fall(values, k - a, k + b) for a, b in ((1, 0), (2, 0), (1, 1))
        )
        half, *parts = errors(fine, coarse, other)
        intervals.append((fine[0], fine[0] - half, fine[0] + half, *parts))
    speed, lowest, highest = (float(np.exp(place)) for place in (at, low, high))
    # the slope of the curve turns errors of the level into errors of the speed
    slope = 0.5 * (highest - lowest) / width if width > 0.0 else 0.0
    others = np.reshape(intervals, (-1, 5))
    return Crossing(speed, lowest, highest, scatter * slope, bound * slope, "", others)


def cubics(x: Array, y: Array) -> Array:
    """Return the coefficients of a monotone cubic (PCHIP) from point to point, the highest power first.

    The slopes are those of F. N. Fritsch and J. Butland (SIAM J. Sci. Stat. Comput. 5 (1984) 300), at both ends by
    three points. ``scipy.interpolate`` gives the same, but its import takes longer than the statistics of a thousand
    points, and more memory.
    """
    step, rise = np.diff(x), np.diff(y) / np.diff(x)
    (before, after), (left, right) = (
        (step[:-1], step[1:]),
        (rise[..., :-1], rise[..., 1:]),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = (
            3.0
            * (before + after)
            / ((before + 2.0 * after) / left + (2.0 * before + after) / right)
        )
    slopes = np.zeros(y.shape)
    slopes[..., 1:-1] = np.where(left * right > 0.0, inner, 0.0)
    for end, two in ((0, slice(2)), (-1, slice(-1, -3, -1))):
        (near, *_, far), first, second = (
            step[two].repeat(2),
            rise[..., two][..., 0],
            rise[..., two][..., -1],
        )
        slope = ((2.0 * near + far) * first - near * second) / (near + far)
        slope = np.where(slope * first > 0.0, slope, 0.0)
        slopes[..., end] = np.where(
            (first * second <= 0.0) & (abs(slope) > 3.0 * abs(first)),
            3.0 * first,
            slope,
        )
    left, excess = slopes[..., :-1], slopes[..., :-1] + slopes[..., 1:] - 2.0 * rise
    return np.stack(
        [excess / step**2, (rise - left - excess) / step, left, y[..., :-1]]
    )


def _interpolated(x: Array, y: Array, at: float) -> Array:
    """Return the values of ``cubics`` at a place."""
    k = int(np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2))
    return np.asarray(np.polyval(cubics(x, y)[..., k], at - x[k]))


def _places(x: Array, y: Array, level: float) -> Array:
    """Return the places at which ``cubics`` are at a level, in their order."""
    places = []
    for k in np.flatnonzero((y[:-1] - level) * (y[1:] - level) <= 0.0):
        roots = np.roots(cubics(x, y)[:, k] - [0.0, 0.0, 0.0, level])
        inside = np.clip(roots.real, 0.0, x[k + 1] - x[k])
        places += [x[k] + inside[np.argmin(abs(roots - inside))]] if roots.size else []
    return np.array(places)


def speed_dim(dataset: xr.Dataset) -> str | None:
    """Return the sweep's dimension along which the speed changes."""
    speed = speed_of(dataset).isel(t=0)
    varying = (
        n
        for n in sweep_dims(dataset)
        if n in speed.dims and bool((speed != speed.isel({n: 0})).any())
    )
    return next(varying, None)


def extremes(curve: Estimate, along: str) -> Estimates:
    """Return where a quantity is largest and least along a sweep, if that is inside: then it is not monotonic.

    Parameters
    ----------
    curve : Estimate
        As of ``distribution``.
    along : str
        The dimension, whose coordinate holds numbers.

    Returns
    -------
    dict of str to Estimate
        ``largest`` and ``least`` with their intervals; ``largest_at`` and ``least_at``, whose intervals end at the
        neighbouring values of the sweep. nan, with a reason, if the extreme differs from an end of the sweep by less
        than the errors.
    """
    curve, result = curve.map(lambda each: each.sortby(along)), Estimates()
    mean, last = curve.value, curve.value.sizes[along] - 1
    low, high = (mean if end is None else end.fillna(mean) for end in curve[2:4])
    for kind, sign, near, far in (
        ("largest", 1.0, low, high),
        ("least", -1.0, -high, -low),
    ):
        index = (sign * mean).fillna(-np.inf).argmax(along)
        inside = near.isel({along: index}) > far.isel({along: [0, last]}).max(along)
        sizes, places = [], []
        for values, step in ((mean, 0), (low, -1), (high, 1)):
            sizes.append(values.isel({along: index}, drop=True).where(inside))
            place = mean[along].isel({along: (index + step).clip(0, last)})
            places.append(place.where(inside).drop_vars(along, errors="ignore"))
        reason = xr.where(inside, "", "at an end of the sweep, within the errors")
        for name, (value, *ends), attrs in (
            (kind, sizes, mean.attrs),
            (f"{kind}_at", places, mean[along].attrs),
        ):
            value = value.assign_attrs(attrs)
            low_end, high_end = ends
            result[name] = Estimate(value, None, low_end, high_end, reason=reason)
    return result


def _least_area(dataset: xr.Dataset, hertz: xr.DataArray) -> xr.DataArray:
    """Return the least area over JKR's that can be left: Hertz's, and without fluctuations that without bonds."""
    energy = dataset.get("fluctuation_energy", xr.DataArray(math.nan))
    others = {"fluctuations_radius", "equilibrium_radius"}
    if bool((ensemble_mean(energy) != 0.0).any()) or others & dataset.keys():
        return hertz
    with contextlib.suppress(KeyError):
        left = setting(dataset, "adhesion.work") * (
            1.0 - setting(dataset, "adhesion.bond_share")
        )
        bare = radius_at_work(dataset, left) / reference_radii(dataset)["radius_jkr"]
        return (
            bare.min([name for name in bare.dims if name not in hertz.dims]) ** 2
            + 0.0 * hertz
        )
    return hertz


def _course(dataset: xr.Dataset) -> tuple[str, xr.DataArray]:
    """Return the dimension along which the area is a curve over the speed, and the speed, in branches if several.

    Raises
    ------
    BadInput
        If there is no such curve.
    """
    needed = {speed_name(dataset), "contact_area", "jkr_radius", "hertz_radius"}
    if not needed <= dataset.keys():
        raise BadInput(
            [
                "speeds of a loss need speed, contact_area, jkr_radius and hertz_radius in record.quantities"
            ]
        )
    if bool((word(dataset, "drive.model", "") == "force").any()):
        raise BadInput(
            [
                "a loss at a speed needs a prescribed speed, but a force drives the slider"
            ]
        )
    if not bool(stays_held(dataset).all()):
        raise BadInput(
            [
                "a loss at a speed needs a constant mount, but load, indentation or displacement changes"
            ]
        )
    speed = abs(speed_of(dataset))
    if is_steady(dataset) and (along := speed_dim(dataset)) is not None:
        return along, speed.isel(t=0, drop=True)
    speed = speed.transpose(..., "t")
    values, branches = speed.to_numpy(), dict[str, Array]()
    for point in np.ndindex(values.shape[:-1]):
        way, number = np.sign(np.nan_to_num(np.diff(values[point]))), {1.0: 0, -1.0: 0}
        turns = [0, *np.flatnonzero(np.diff(way)) + 1, len(way)]
        for first, last in itertools.pairwise(turns):
            if way[first] and (last - first > 1 or len(turns) == 2):
                number[way[first]] += 1
                name = f"{_WAYS[way[first]]} {number[way[first]]}".removesuffix(" 1")
                records = (*point, slice(first, last + 1))
                branches.setdefault(name, np.full(values.shape, np.nan))[records] = (
                    values[records]
                )
    if not branches:
        raise BadInput(
            [
                "the speed neither changes steadily nor is swept; a loss at a speed needs one of both"
            ]
        )
    names = xr.Variable(
        "branch",
        list(branches),
        {"long_name": "branch of increasing or decreasing speed"},
    )
    return "t", xr.concat(
        [speed.copy(data=each) for each in branches.values()], names
    ).squeeze(drop=len(branches) == 1)


def _if_steady(
    dataset: xr.Dataset, levels: Sequence[xr.DataArray], is_chosen: bool
) -> list[tuple[xr.DataArray, xr.DataArray]]:
    """Return for each share of JKR's area the speed in steady sliding [m/s], and True where that is stable.

    They are those of the scenario's own models, which the run has recorded for the default
    shares. Speeds are nan at points of a sweep whose scenario is not known: of a measured
    map, of runs that were joined, of swept models.
    """
    sweep = dataset["contact_modulus"]
    names = [
        [f"{kind}_speed_{name}" for kind in ("steady", "unstable")] for name in LOST
    ]
    if not is_chosen and {*itertools.chain(*names)} <= dataset.keys():
        pairs = ((dataset[calm], dataset[other]) for calm, other in names)
        return [(calm.fillna(other), other.isnull()) for calm, other in pairs]
    result = [(math.nan * sweep, xr.ones_like(sweep, bool)) for _ in levels]
    delays = any(str(name).startswith("bonds_rebinding") for name in dataset.variables)
    with contextlib.suppress(KeyError):
        delays = delays or bool(resolved(dataset, "shear.amplitude").get("relaxing"))
    if not delays:
        return result
    # slow to import
    from sim.ensemble.dataset import scenario_of, variable_name
    from sim.ensemble.steady_speed import speeds_of_areas

    with contextlib.suppress(BadInput, KeyError):
        scene = scenario_of(dataset.attrs)
        keys = [key for axis in scene.sweep for key in axis.keys]
        if {*sweep.dims} - {*map(variable_name, keys)}:
            return result
        for index in np.ndindex(sweep.shape):
            at = dict(zip(sweep.dims, index, strict=True))
            point = dataset.isel(at)
            values = {key: float(setting(point, key)) for key in keys}
            alone = scene.with_values(values) if keys else scene
            shares = np.array(
                [float(level.isel(at, missing_dims="ignore")) for level in levels]
            )
            for (speed, stable), *numbers in zip(
                result, *speeds_of_areas(alone, shares), strict=True
            ):
                speed[at], stable[at] = numbers
    return result


def loss_speeds(dataset: xr.Dataset, levels: Sequence[float | str] = ()) -> Estimates:
    """Return the speeds at which the mean area has lost shares of JKR's: by default 5 and 50 %, and half of all it can.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it: courses of the speed, or a sweep of steady speeds, then of means over the second half
        of the run.
    levels : sequence of float or str, optional
        Shares of JKR's area, such as ``["10 %", 0.25]``.

    Returns
    -------
    dict of str to Estimate
        For each point of the sweep of other keys ``speed_at_5_percent_lost`` and so on [m/s], by default also
        ``speed_halfway_to_hertz``; see ``crossing``. Branches of a course that rises and falls have the dimension
        ``branch``. If bonds lag behind a course, ``steady_speed_at_5_percent_lost`` is the speed at which steady
        sliding by the scenario's own models loses as much, nan where steady sliding is unstable behind the spring. With
        ``levels`` also the ``charges`` of that loss [1], such as ``lost_to_bonds_at_10_percent_lost``. Without
        ``levels`` empty if there is no curve of the area over the speed, no closed contact, or nothing to lose because
        there is no adhesion.

    Notes
    -----
    Along a course the speed is that without the delay of the bonds by the clock step, and the bound holds what is not
    known of this delay (``sim.read.clock_delay.of_course``).

    Raises
    ------
    BadInput
        If there is no such curve, with the reason, or a level is no share.
    """
    wanted = [
        read_option(level, "lost", "1", above=0, below=1, typical="10 %")
        for level in levels
    ]
    try:
        along, speed = _course(dataset)
    except BadInput:
        if wanted:
            raise
        return {}
    radii = reference_radii(dataset)
    hertz = (radii["radius_hertz"] / radii["radius_jkr"]) ** 2
    if along in hertz.dims:
        hertz = hertz.min(along)
    shares: dict[str, float | None] = LOST
    if wanted:
        shares = {f"at_{100 * k:g}_percent_lost": k for k in wanted}
    half = 0.5 * (1.0 + hertz)
    left = [half if k is None else 1.0 - k + 0.0 * hertz for k in shares.values()]
    least = _least_area(dataset, hertz)
    means, sizes, alone = _group_means(dataset, along, bool(wanted))
    can_lose = means["area_ratio"].notnull().any(["group", along]) & (least < _WHOLE)
    if not wanted and not bool(can_lose.any()):
        return {}
    lasting: Any = [None] * len(left)
    off = xr.zeros_like(speed)
    if along == "t":
        speed, off = _without_delay(dataset, speed)
        lasting = _if_steady(dataset, left, bool(wanted))
    result = Estimates()
    of = "stage" if speed_name(dataset) == "stage_speed" else "slider"
    for (name, share), level, steady in zip(shares.items(), left, lasting, strict=True):
        loss = loss_in_words(share)
        found = _crossings(along, speed, off, means, sizes, level)
        lag: list[Any] = [math.nan, True]
        if steady is not None:
            lag = _lag(found.ends, steady[0].where(can_lose), steady[1], speed)
        # the loss of a share that is all there is takes an infinite speed
        never = found.ends[0].isnull() & (level <= least)
        most = (100.0 * (1.0 - least)).clip(0.0)
        meanings = {
            key: f"{means[key].attrs.get('long_name', '')}, at the speed at which {loss} is lost"
            for key in found.beside
        }
        meanings["area_ratio"] = (
            f"speed of the {of} at which the mean contact area has lost {loss}"
        )
        result |= _stated(found, name, meanings, (never, most, *lag), alone)
        if steady is not None and bool((lag[0].notnull() & lag[1]).any()):
            text_of_steady = f"sliding speed at which steady sliding loses {loss}"
            value = labelled(lag[0].where(lag[1]), "m/s", text_of_steady)
            result[f"steady_speed_{name}"] = Estimate(value)
    return result


class _Crossings(NamedTuple):
    """Speeds of one loss over the sweep: with interval, error and bound, and the reasons without.

    ``beside`` holds the shares of the loss at that speed by their names, with the dimension "end" as ``ends``;
    ``by_steps`` is true if the clock step causes most of a bound.
    """

    ends: list[xr.DataArray]
    reason: xr.DataArray
    beside: dict[str, xr.DataArray]
    by_steps: bool


def _crossings(
    along: str,
    speed: xr.DataArray,
    off: xr.DataArray,
    means: xr.Dataset,
    sizes: xr.DataArray,
    level: xr.DataArray,
) -> _Crossings:
    """Return the speeds at which the area of groups falls to a level; ``off``: by how much the step may shift them."""
    beside = means.to_array("quantity").drop_vars("quantity")
    *ends, reason, others = xr.apply_ufunc(
        crossing,
        *(speed, means["area_ratio"], sizes, level, beside),
        input_core_dims=[
            [along],
            ["group", along],
            ["group"],
            [],
            ["quantity", "group", along],
        ],
        output_core_dims=[*[[]] * 6, ["quantity", "end"]],
        output_dtypes=[*"dddddOd"],
        vectorize=True,
    )
    late = xr.apply_ufunc(
        _read_at,
        *(ends[0], speed, off),
        input_core_dims=[[], [along], [along]],
        vectorize=True,
    )
    share = (late / ends[0]).fillna(0.0)
    ends[1], ends[2] = ends[1] * np.exp(-share), ends[2] * np.exp(share)
    ends[4] = ends[4] + late
    columns = zip(means, others.transpose("quantity", "end", ...), strict=True)
    known = {str(name): one for name, one in columns}
    return _Crossings(ends, reason, known, bool((late > 0.5 * ends[4]).any()))


def _stated(
    found: _Crossings,
    name: str,
    meanings: dict[str, str],
    why: Sequence[Any],
    alone: bool,
) -> Estimates:
    """Return the speed of a loss by its name, and the shares of the loss there, with reasons where there is none.

    ``why``: where the loss never happens, the largest loss, the speed in steady sliding and where that is stable.
    ``alone``: a single member has no error.
    """
    result, never = Estimates(), why[0]
    columns = found.beside | {"area_ratio": xr.concat(found.ends, "end")}
    of_one = found.ends[0].notnull() & alone
    for key, (value, *intervals, bound) in columns.items():
        stem, unit, source = key, "1", "interpolation"
        if key == "area_ratio":
            stem, unit, source = "speed", "m/s", _CAUSES[found.by_steps]
        low, high, error = (each.where(~never & ~of_one) for each in intervals)
        reason = xr.apply_ufunc(
            _in_words,
            found.reason,
            *why,
            of_one,
            vectorize=True,
            output_dtypes=[object],
        )
        result[f"{stem}_{name}"] = Estimate(
            labelled(value.where(~never), unit, meanings[key]),
            error,
            low,
            high,
            bound.where(~never).assign_attrs(source=source),
            reason=reason.drop_attrs(deep=False),
        )
    return result


def _without_delay(
    dataset: xr.Dataset, speed: xr.DataArray
) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the speed that the bonds feel along a course, and by how much it may be off by the clock step.

    It is a speed of the course, because bonds have felt no other before the start.
    """
    course = abs(speed_of(dataset))
    growth = course.differentiate("t") / course.where(course > 0.0)
    delay = of_course(dataset, abs(growth))
    earlier = speed * np.exp(-(growth * delay.time).fillna(0.0))
    earlier = earlier.clip(speed.min("t"), speed.max("t"), keep_attrs=True)
    return earlier, (abs(growth) * earlier * delay.bound).fillna(0.0)


def _read_at(at: float, speed: Array, values: Array) -> float:
    """Return the value at the speed of a course that is nearest to one; 0 if that is unknown."""
    if math.isnan(at):
        return 0.0
    return float(values[np.nanargmin(abs(speed - at))])


def _lag(
    ends: Sequence[xr.DataArray],
    steady: xr.DataArray,
    stable: xr.DataArray,
    speed: xr.DataArray,
) -> list[xr.DataArray]:
    """Return the speed in steady sliding where that of a course differs from it, and True where it is stable.

    ``ends`` are the speed of the course and its interval. The speed of a course that does
    not reach the loss differs if its own speeds hold the one in steady sliding. That of a
    course whose noise leaves the interval alone differs if this does not hold it.
    """
    off = abs(np.log(ends[0] / steady))
    differs = off > np.fmax(0.5 * np.log(ends[2] / ends[1]), _UNSEEN)
    moving = speed.where(speed > 0.0)
    within = (steady > moving.min("t")) & (steady < moving.max("t"))
    within = within & ~((steady >= ends[1]) & (steady <= ends[2]))
    return [steady.where(differs | (ends[0].isnull() & within)), stable]


def _in_words(
    reason: str, never: bool, most: float, steady: float, stable: bool, alone: bool
) -> str:
    """Return the reason why there is no speed or no error, from the largest loss [%] and the ``steady`` speed [m/s]."""
    if never:
        return f"never: at most {most:.3g} % of the area can be lost"
    near = reason
    if not math.isnan(steady):
        at = engineering(float(f"{steady:.3g}"), "m/s")
        near = (
            f"the course lags: {at} if steady"
            if stable
            else f"steady sliding would lose as much at {at}, but is unstable there"
        )
    words = near, "a single member has no known error" if alone else ""
    return "; ".join(filter(None, words))


def _group_means(
    dataset: xr.Dataset, along: str, charged: bool
) -> tuple[xr.Dataset, xr.DataArray, bool]:
    """Return means over groups of members and, at steady speeds, the second half; sizes of groups; and if one is alone.

    They are those of ``area_ratio`` and, if ``charged``, of shares of the loss. If only statistics were recorded,
    groups are made up that have their mean and standard error. A member is alone if its noise compares with no other.
    """
    outer = (*sweep_dims(dataset), *(["t"] if along == "t" else []))
    pooled = STATISTIC in dataset["contact_area"].dims
    members = int(dataset.attrs["members"]) if pooled else dataset.sizes.get(MEMBERS, 1)
    count = min(
        members,
        _GROUPS,
        max(2, _MOST_MEANS // math.prod(dataset.sizes[name] for name in outer)),
    )
    names = ["area_ratio", *(_CHARGED if charged and not pooled else ())]

    def values(piece: xr.Dataset) -> xr.Dataset:
        result = closed_observables(piece, names)
        return result if along == "t" else result.mean("t", keep_attrs=True)

    def means(piece: xr.Dataset) -> xr.Dataset:
        if pooled:
            average, _, error = piece["area_ratio"].transpose(STATISTIC, ...)
            apart = xr.DataArray(np.linspace(-1.0, 1.0, count), dims="group")
            factor = math.sqrt(count * (count - 1.0) / float((apart**2).sum()))
            whole = average + factor * apart * error
            whole = whole.drop_vars(STATISTIC, errors="ignore")
            return whole.to_dataset(name="area_ratio")
        piece = piece if MEMBERS in piece.dims else piece.expand_dims(MEMBERS)
        groups = [
            piece.isel({MEMBERS: slice(k, None, count)}).mean(MEMBERS, keep_attrs=True)
            for k in range(count)
        ]
        return xr.concat(
            groups, "group", data_vars="all", coords="minimal", compat="override"
        )

    areas = restricted(dataset, names)
    if along == "t":
        result = in_pieces(areas, ("t",), lambda piece: means(values(piece)))
    else:
        late = areas.isel(t=slice(dataset.sizes["t"] // 2, None))
        result = means(in_pieces(late, (*outer, MEMBERS), values))
    sizes = xr.DataArray(
        np.bincount(np.arange(members) % count).astype(float), dims="group"
    )
    return result, sizes, members == 1 and MEMBERS in dataset.sizes
