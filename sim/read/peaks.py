"""Peaks of stress and friction: of a start from rest or a ramp of the speed, after a hold, and of noisy members."""

import contextlib
import math
from collections.abc import Hashable
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.read.clock_delay import of_maxima
from sim.read.correlation import LEVEL, Array
from sim.read.dataset import (
    MEMBERS,
    STATISTIC,
    ensemble_mean,
    plain,
    setting,
    speed_of,
    word,
)
from sim.read.estimate import Estimate, Estimates
from sim.read.late import observable_of
from sim.read.observables import defined, labelled, pure
from sim.units.notation import engineering

#: Relative changes below it are rounding.
_ROUNDING = 1e-6
#: Clock steps after a start from rest in which the friction of stretched bonds has risen too fast to show its peak.
_TOO_FAST = 1.5
#: Lives of a bond in steady sliding above which a clock step shows no peak of the friction after a rest.
_SHOWN = 0.5
UNRESOLVED = (
    "the friction rises within a clock step, which may hide a peak; reduce clock.step"
)
#: Peaks, each with the quantity that it is of, and the beginning of the names of its time and speed.
PEAKS = {
    "peak_stress": ("shear_stress", "peak"),
    "peak_friction": ("friction_force", "peak_friction"),
}
#: Times and speeds of peaks.
PLACES = {f"{prefix}_{at}" for _, prefix in PEAKS.values() for at in ("time", "speed")}


def differing(variable: xr.DataArray) -> list[Hashable]:
    """Return the dimensions of a variable over members or their statistics; none if the members have equal values."""
    return [dim for dim in variable.dims if dim in {MEMBERS, STATISTIC}]


def peaks(dataset: xr.Dataset) -> Estimates:
    """Return the friction peak after a start from rest, and the friction maximum of a ramp of the speed.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    dict of str to Estimate
        ``peak_stress`` [Pa], the maximum of the shear stress while sliding; ``peak_time`` [s], from where sliding
        starts; ``peak_speed`` [m/s]; and ``peak_friction`` [N], ``peak_friction_time`` and ``peak_friction_speed``, the
        same of the friction force. Empty under any other drive, and of members that differ: their largest value is that
        of the noise (see ``ensemble_peaks``).

    Notes
    -----
    Peaks are those of the clock steps, refined between them. nan where there is none: the value at the end of the run,
    or on a ramp that at its start, is as large, within the tolerance of the bonds. A start may peak at once, when the
    stress falls from what it was at rest. Stretched bonds have no stress at rest, so that a largest value at the first
    clock step of the sliding is no peak: the step is too long to show how the friction rises. The time of a peak after
    a start is known to a clock step: that of the stress of bonds that are solved exactly at a constant speed has a far
    smaller error, that of the friction, whose area is taken as linear in a step, a share of a step, and that of bonds
    that jump or break at a limit is the time of a sample.
    """
    dataset = plain(dataset)
    drive = word(dataset, "drive.model", "")
    ramp, start = drive == "ramp", drive == "start"
    if not bool((ramp | start).any()):
        return {}
    result, phased = Estimates(), "phase_start" in dataset
    last = dataset["phase_start"].count("phase") - 1 if phased else xr.DataArray(0)
    beginning = (
        dataset["phase_start"].isel(phase=last).where(start, 0.0)
        if phased
        else xr.DataArray(0.0)
    )
    step = setting(dataset, "clock.step")
    tolerance = _number_of(dataset, "bonds.tolerance", _ROUNDING).clip(_ROUNDING)
    for name, (source, prefix) in PEAKS.items():
        if not {name, source} <= {*dataset} or differing(dataset[name]):
            continue
        ends = abs(dataset[source].astype(float)).isel(t=[0, -1])
        read = [dataset[key] for key in (name, f"{prefix}_time", f"{prefix}_speed")]
        if phased:
            read = [
                dataset[f"phase_{whole.name}"].isel(phase=last).where(start, whole)
                for whole in read
            ]
        size, when, speed = read
        before, after = (
            size / (1.0 + tolerance) > ends.isel(t=k, drop=True) for k in (0, 1)
        )
        since = when - beginning
        is_hidden = start & _rises_unseen(dataset, since)
        known = (ramp | start) & after & (~ramp | before) & ~is_hidden
        reason = xr.where(is_hidden, UNRESOLVED, "")
        bounds = [step, xr.DataArray(0.0)]
        if bool(ramp.any()):
            late = _late_by_steps(dataset, when, speed)
            since = since - late.time.where(ramp, 0.0)
            speed = late.speed.where(ramp, speed)
            bounds = [
                late.time_bound.where(ramp, bounds[0]),
                late.speed_bound.where(ramp, 0.0),
            ]
        about = dataset[source].attrs
        quantity = str(about.get("long_name", source)).partition(",")[0]
        text = f"maximum of the {quantity} while sliding"
        unit = str(about.get("units", "1"))
        columns = {
            name: (size, None, unit, text),
            f"{prefix}_time": (
                since,
                bounds[0],
                "s",
                f"time from the start of sliding to the {text}",
            ),
            f"{prefix}_speed": (
                speed,
                bounds[1],
                "m/s",
                f"sliding speed at the {text}",
            ),
        }
        for key, (values, bound, *described) in columns.items():
            values = labelled(values.where(known), *described)
            one = Estimate(values, reason=reason)
            if bound is not None and bool((bound > 0.0).any()):
                bound = bound.where(known).assign_attrs(source="step")
                one = one._replace(bound=bound)
            result[key] = one.map(lambda each: each.drop_vars("phase", errors="ignore"))
    return result


def _after_rests(dataset: xr.Dataset) -> xr.DataArray:
    """Return True where a prescribed speed follows a rest."""
    drive = word(dataset, "drive.model", "")
    return (drive == "holds") | (drive == "start")


def _rises_unseen(dataset: xr.Dataset, since: xr.DataArray) -> xr.DataArray:
    """Return True if the clock step does not show how friction rises to a maximum so soon after a rest [s].

    That is so if the maximum comes within the first steps, or if bonds live for less than two steps of sliding: then
    the peak may be past before the first step ends, and another maximum may follow.
    """
    stretched = _number_of(dataset, "bonds.bond_stiffness", 0.0) > 0.0
    step = setting(dataset, "clock.step")
    return stretched & (
        (ensemble_mean(since) < _TOO_FAST * step) | (step > _SHOWN * _life(dataset))
    )


def _life(dataset: xr.Dataset) -> xr.DataArray:
    """Return the mean life of a bond at the last record of sliding [s]; nan if unknown.

    As many bonds form there as break, so that their life follows from the bond fraction and the rate of rebinding. The
    fraction is that of the bonds at rest, which are taken as all sites: where bonds break often at rest, the life that
    is returned is too long.
    """
    if not {"bond_fraction", "speed"} <= {*dataset.variables}:
        return xr.DataArray(math.nan)

    def mean(name: str) -> xr.DataArray:
        values = ensemble_mean(abs(dataset[name].astype(float)))
        return values.mean(MEMBERS) if MEMBERS in values.dims else values

    last = (
        dataset.sizes["t"]
        - 1
        - (mean("speed") > 0.0)[{"t": slice(None, None, -1)}].argmax("t")
    )
    bound = mean("bond_fraction").isel(t=last, missing_dims="ignore")
    rate = _number_of(dataset, "bonds.rebinding_rate", math.nan)
    rate = _number_of(dataset, "bonds.rebinding_rate_at_temperature", math.nan).fillna(
        rate
    )
    return (bound / ((1.0 - bound) * rate)).drop_vars("t", errors="ignore")


def _number_of(dataset: xr.Dataset, key: str, default: float) -> xr.DataArray:
    """Return a number of the scenario by its dotted key, and the default where the scenario has none."""
    with contextlib.suppress(KeyError):
        return setting(dataset, key).fillna(default)
    return xr.DataArray(default)


class Late(NamedTuple):
    """Time by which a maximum along a ramp is found late, the speed at its true time, and what may be left of both."""

    time: xr.DataArray
    speed: xr.DataArray
    time_bound: xr.DataArray
    speed_bound: xr.DataArray


def _late_by_steps(
    dataset: xr.Dataset, when: xr.DataArray, speed: xr.DataArray
) -> Late:
    """Return by how much the clock step delays a maximum found at a time [s] and a speed [m/s] of a ramp."""
    duration = setting(dataset, "clock.duration")
    is_log = word(dataset, "drive.scale", "") == "log"
    first, last = (speed_of(dataset).isel(t=k, drop=True) for k in (0, -1))
    with contextlib.suppress(KeyError):  # tables of a drive that are swept whole
        first, last = (setting(dataset, f"drive.{end}") for end in ("from", "to"))
    size = abs(speed)
    ratio = abs(last / first.where(is_log, 1.0)).where(is_log, 1.0)
    # the growth of the magnitude of the speed
    slope = (size * np.log(ratio)).where(is_log, (last - first) * np.sign(speed))
    slope = slope / duration
    change = abs(slope) / size.where(size > 0.0)
    late, bound = of_maxima(dataset, when, change)
    earlier = (size * np.exp(-slope / size * late)).where(is_log, size - slope * late)
    return Late(late + 0.0 * when, earlier, bound, change * size * bound)


def static_threshold(dataset: xr.Dataset) -> Estimates:
    """Return the static threshold: the first maximum of the friction after a start from rest, and the area at it.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive that starts from rest at a constant control of the contact.

    Returns
    -------
    dict of str to Estimate
        ``static_threshold`` [N]; ``area_at_threshold`` [1], the contact area there over JKR's at rest; and
        ``threshold_after`` [s], the time of the threshold. nan if the friction does not fall by 1 % from its first
        maximum before it exceeds the maximum again. Empty of other drives.

    Notes
    -----
    The maximum is that of the clock steps of each member, refined between them. If members differ, each has its own
    threshold. The first maximum from which noise takes 1 % may then come before the maximum of the mean, and it is
    lower. If the relative noise of the friction is of the order of 1 %, read the peak of the mean instead
    (``ensemble_peaks``).
    """
    if "static_threshold_area" not in dataset:
        return {}
    text = "first maximum of the friction force after a start from rest"
    force, when, area = (
        dataset[name].astype(float)
        for name in (
            "static_threshold",
            "static_threshold_time",
            "static_threshold_area",
        )
    )
    prescribed = _after_rests(dataset)
    if bool(prescribed.any()) and "phase_start" in dataset:
        begins = dataset["phase_start"]
        since = when - begins.where(begins <= when).max("phase")
        is_hidden = prescribed & _rises_unseen(dataset, since)
        force, when, area = (each.where(~is_hidden) for each in (force, when, area))
    at_rest = math.pi * dataset["radius_at_rest"] ** 2
    about = f"contact area at the {text} over that of JKR theory at rest"
    return {
        "static_threshold": Estimate(labelled(force, "N", text)),
        "area_at_threshold": Estimate(pure(area / at_rest, about)),
        "threshold_after": Estimate(
            labelled(when, "s", f"time of the {text}")
        )._replace(
            bound=setting(dataset, "clock.step")
            .where(when.notnull())
            .assign_attrs(source="step")
        ),
    }


def peaks_after_holds(dataset: xr.Dataset) -> xr.Dataset:
    """Return the friction peak after each hold, and the time for which the slider or the stage was held before.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive with more than one phase.

    Returns
    -------
    xarray.Dataset
        With the dimension ``phase`` last: ``peak_after_hold`` [N], the first maximum of the friction after a rest, if
        the friction then falls by 1 % before it exceeds the maximum; ``time_held`` [s] before; and the ``start`` [s] of
        the phase. All are nan in other phases, and the peak where ``hidden_after_holds`` is true. Empty if nothing
        rests before another phase.
    """
    if "phase_static_threshold" not in dataset:
        return xr.Dataset()
    start, held = dataset["phase_start"], _held(dataset)
    peak = dataset["phase_static_threshold"].astype(float)
    is_known = held.notnull() & ~hidden_after_holds(dataset)
    result = xr.Dataset(
        {
            "peak_after_hold": labelled(
                peak.where(is_known),
                "N",
                "first maximum of the friction force after a hold",
            ),
            "time_held": labelled(held, "s", "time at rest before a phase"),
            "start": labelled(start, "s", "start of a phase"),
        }
    )
    return result.transpose(..., "phase")


def _held(dataset: xr.Dataset) -> xr.DataArray:
    """Return the time at rest before each phase [s], nan without."""
    rests = dataset["phase_name"].str.contains("rest")
    return (dataset["phase_end"] - dataset["phase_start"]).where(rests).shift(phase=1)


def hidden_after_holds(dataset: xr.Dataset) -> xr.DataArray:
    """Return True for the phases after a hold in which a clock step may hide the peak of friction.

    A spring shows it, because the slider behind it moves in sub-steps.
    """
    since = dataset["phase_static_threshold_time"] - dataset["phase_start"]
    is_after = _after_rests(dataset) & _held(dataset).notnull()
    return is_after & _rises_unseen(dataset, since)


#: Decades of the time held from which on ageing is judged, and the share of the growth in the first of them above which
#: peaks still grow in the last.
_DECADES, _STILL_GROWS = 2.0, 0.1


def ageing(dataset: xr.Dataset) -> Estimates:
    """Return the growth of the peak after a hold over a decade of the time held, or the time after which it saturates.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive that slides and holds in turn.

    Returns
    -------
    dict of str to Estimate
        ``hold_growth`` [N] of each member, the slope of the peaks over the decimal logarithm of the time held by least
        squares; ``hold_saturation`` [s], the shortest of the times held after which the mean peak grows by less than a
        tenth of its growth in the first decade. Empty without peaks after holds over two decades or more.

    Notes
    -----
    Peaks still grow if the last decade adds at least a tenth of what the first one adds. Then there is a slope, else a
    saturation, never both. Both are nan if the first decade adds nothing, or if the members cannot tell: the growth in
    the first decade, or its comparison with that in the last, is less than two standard errors.
    """
    each = peaks_after_holds(dataset)
    if not {*each}:
        return {}
    peak, held = each["peak_after_hold"], each["time_held"]
    if MEMBERS not in peak.dims:
        peak = ensemble_mean(peak).expand_dims(MEMBERS)
    result = xr.apply_ufunc(
        _ageing,
        peak,
        held,
        input_core_dims=[[MEMBERS, "phase"], ["phase"]],
        output_core_dims=[[MEMBERS], [], []],
        vectorize=True,
    )
    growth, saturation, decades = result
    if not bool((decades >= _DECADES).any()):
        return {}
    if growth.sizes[MEMBERS] == 1:
        growth = growth.isel({MEMBERS: 0})
    return {
        name: Estimate(defined(name, values))
        for name, values in (("hold_growth", growth), ("hold_saturation", saturation))
    }


def _ageing(peaks: Array, held: Array) -> tuple[Array, float, float]:
    """Return slopes over a decade (members,), the time of saturation, and the decades of the holds with a peak.

    >>> held = np.array([0.1, 1.0, 10.0])
    >>> slope, saturation, _ = _ageing(np.array([[8.18, 16.15, 16.20]]), held)
    >>> print(slope, saturation)
    [nan] 1.0
    >>> slope, saturation, _ = _ageing(np.array([[1.0, 1.5, 2.0]]), held)
    >>> print(slope.round(12), saturation)
    [0.5] nan
    """
    none = np.full(len(peaks), np.nan)
    known = np.isfinite(held) & np.isfinite(peaks).all(axis=0)
    times, place = np.unique(held[known], return_inverse=True)
    if times.size < 2:
        return none, math.nan, 0.0
    # holds of the same time count once
    same = np.equal.outer(np.arange(times.size), place)
    values = peaks[:, known] @ (same / same.sum(axis=1, keepdims=True)).T
    logs = np.log10(times)
    decades = float(logs[-1] - logs[0])
    decades = round(decades, 9)
    if decades < _DECADES:
        return none, math.nan, decades
    ends = logs[[0, 0, -1, -1]] + [0.0, 1.0, -1.0, 0.0]
    weights = np.array([np.interp(ends, logs, unit) for unit in np.eye(times.size)])
    at_ends = values @ weights
    first, last = (at_ends[:, k + 1] - at_ends[:, k] for k in (0, 2))
    excess = last - _STILL_GROWS * first
    for growth in (first, excess):
        error = (
            float(growth.std(ddof=1)) / math.sqrt(len(growth))
            if len(growth) > 1
            else 0.0
        )
        if abs(growth.mean()) < _ALIKE * error:
            return none, math.nan, decades
    if not first.mean() > 0.0:
        return none, math.nan, decades
    if excess.mean() >= 0.0:
        off = logs - logs.mean()
        return values @ off / (off @ off), math.nan, decades
    mean = values.mean(axis=0)
    left = np.maximum.accumulate((mean[-1] - mean)[::-1])[::-1]
    steady = times[np.argmax(left < _STILL_GROWS * first.mean())]
    return none, float(steady), decades


# --- peaks of the mean of members with noise, with errors, or the reason for none ---

#: Chance of a peak out of noise; resampled ensembles for the error of its time; share of the records after it.
_CHANCE, _RESAMPLED, _AFTER = 0.01, 200, 8
#: Standard errors by which estimates of a peak over different numbers of records may differ.
_ALIKE = 2.0
#: Dimensions of a quantity of each member.
_EACH = [MEMBERS, "t"]
#: Records that a peak needs: an eighth of them are its end.
_FEWEST = 8


class Peak(NamedTuple):
    """Peak of the mean of members, its time, and the ends of both intervals; or the reason why there is none.

    ``sem`` and ``time_sem`` are the standard errors of both over the members. ``bound`` is that of the rise of the mean
    between two records.
    """

    reason: str
    value: float = math.nan
    sem: float = math.nan
    low: float = math.nan
    high: float = math.nan
    time: float = math.nan
    first: float = math.nan
    last: float = math.nan
    bound: float = math.nan
    time_sem: float = math.nan


def peak_of_mean(values: Array, times: Array, unit: str = "1") -> Peak:
    """Return the peak of the mean of members with noise, after the first of their records.

    Parameters
    ----------
    values : array, shape (members, records)
        All known.
    times : array, shape (records,)
        Since the first record [s], evenly spaced.
    unit : str
        Of the values, for the reason.

    Notes
    -----
    The mean must rise above the first record and above the mean over the last eighth by more than noise does in one of
    a hundred runs: by Student's law for the largest of as many values as there are records. A parabola through the
    records about the largest moving average gives value and time. Its width is doubled as long as the estimates agree
    within two of the standard errors of their differences (Lepski's rule). The error is that of the members under these
    weights; that of the time is from ensembles drawn from these members, and at least half a record.
    """
    members, records = values.shape
    mean, free, tail = values.mean(axis=0), members - 1.0, np.zeros(records)
    tail[-max(1, records // _AFTER) :] = 1.0 / max(1, records // _AFTER)
    last = records - max(1, records // _AFTER)

    def error(weights: Array) -> float:
        return (
            float(np.std(values @ weights, ddof=1)) / math.sqrt(members)
            if members > 1
            else math.nan
        )

    weights, _ = _top(mean, 0, last)
    place = int(np.argmax(weights))
    surely = float(special.stdtrit(free, 1.0 - _CHANCE / records))
    for base in (tail, np.eye(1, records)[0]):
        if not (weights - base) @ mean > surely * error(weights - base):
            most, end, when = (
                engineering(*number)
                for number in (
                    (mean[place], unit),
                    (float(tail @ mean), unit),
                    (float(times[place]), "s"),
                )
            )
            return Peak(
                "no peak is certain: before the last eighth of the records the mean is "
                f"{most} at most, after {when}, and over it {end}"
            )
    if place < 3:
        step = engineering(float(times[place]) / 4.0, "s")
        return Peak(
            f"too few records to resolve the peak: record every {step} or more often"
        )
    tried, width = [_top(mean, 0, last)], 1
    # an average about a record before the last eighth has as many after it
    while 2 * width <= min(place, records - last + 1):
        weights, at = _top(mean, width, last)
        if any(
            abs((weights - other) @ mean) > _ALIKE * error(weights - other)
            for other, _ in tried
        ):
            break
        tried, width = [*tried, (weights, at)], 2 * width
    (weights, at), width = tried[-1], width // 2
    rng = np.random.default_rng(0)  # the same interval each time
    drawn = (
        rng.multinomial(members, np.full(members, 1.0 / members), size=_RESAMPLED)
        / members
        @ values
    )
    places = [_top(each, width, last)[1] for each in drawn]
    ends = np.quantile(places, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    value, sem, records_at = float(weights @ mean), error(weights), np.arange(records)
    half = float(special.stdtrit(free, 0.5 + 0.5 * LEVEL)) * sem
    between = max(
        0.0, 0.125 * float(np.array([-1.0, 2.0, -1.0]) @ mean[place - 1 : place + 2])
    ) * (width < 2)
    time, first, stop = np.interp([at, ends[0] - 0.5, ends[1] + 0.5], records_at, times)
    # places that all are the same record have an error that the bound by the records holds
    time_sem = float(np.std(places)) * float(times[1] - times[0]) or math.nan
    return Peak(
        "",
        value,
        sem,
        value - half,
        value + half + between,
        float(time),
        float(first),
        float(stop),
        between,
        time_sem,
    )


def _top(mean: Array, width: int, last: int) -> tuple[Array, float]:
    """Return the weights of the records whose sum is the peak before the record ``last``, and its place.

    It is the largest value, or if the ``width`` is two or more records to both sides the vertex of a parabola.
    """
    sums = np.append(0.0, np.cumsum(mean))
    # of centres width, ..., last - 1
    averages = sums[2 * width + 1 : last + width] - sums[: last - width - 1]
    begin = 1 if width == 0 else 0
    place = width + begin + int(np.argmax(averages[begin:]))
    weights, at = np.zeros(len(mean)), float(place)
    if width < 2:
        weights[place] = 1.0
        return weights, at
    chosen = slice(place - width, place + width + 1)
    fit = np.linalg.pinv(np.vander(np.linspace(-1.0, 1.0, 2 * width + 1), 3))
    curvature, slope, _ = fit @ mean[chosen]
    vertex = (
        float(np.clip(-0.5 * slope / curvature, -1.0, 1.0)) if curvature < 0.0 else 0.0
    )
    weights[chosen] = np.array([vertex**2, vertex, 1.0]) @ fit
    return weights, at + vertex * width


def ensemble_peaks(dataset: xr.Dataset) -> Estimates:
    """Return the peaks of stress and friction of members with noise, while sliding after a rest or along a ramp.

    Returns
    -------
    dict of str to Estimate
        ``peak_stress`` [Pa] and ``peak_friction`` [N], with a reason without a peak, see ``peak_of_mean``; time since
        sliding starts, ``peak_time`` and ``peak_friction_time`` [s], and speed then, ``peak_speed`` and
        ``peak_friction_speed`` [m/s], with standard errors, bounds and intervals. The bounds are of the time between
        two records, and along a ramp of the clock step. Empty under any other drive, and of members that do not differ.
        Peaks of friction are of the contacts that stay closed.
    """
    dataset = plain(dataset)
    drive, result = word(dataset, "drive.model", ""), Estimates()
    is_ramp, starts = drive == "ramp", drive == "start"
    if not bool((is_ramp | starts).any()) or "speed" not in dataset:
        return result
    rest = xr.DataArray(0.0)
    if "phase_start" in dataset:  # the last phase of a start is sliding
        begins = dataset["phase_start"]
        sliding = begins.isel(phase=begins.count("phase") - 1)
        rest = sliding.drop_vars("phase", errors="ignore").where(starts, 0.0)
    times, sweep = dataset["t"], xr.zeros_like(dataset["contact_modulus"], float)
    onset = (times >= rest - 1e-6 * times[-1]).argmax("t")
    speeds = abs(speed_of(dataset)) + sweep
    for name, (quantity, prefix) in PEAKS.items():
        if quantity not in dataset or not differing(dataset[quantity]):
            continue
        unit = str(dataset[quantity].attrs.get("units", "1"))
        values = xr.DataArray(np.empty((0, times.size)), dims=_EACH)
        if MEMBERS in dataset[quantity].dims:
            values = observable_of(dataset, quantity)
        how: Any = {
            "input_core_dims": [_EACH, ["t"], [], ["t"]],
            "output_core_dims": [[]] * 16,
            "vectorize": True,
            "output_dtypes": [object, *"d" * 15],
            "kwargs": {"unit": unit},
        }
        reason, value, sem, low, high, bound, *places = xr.apply_ufunc(
            _peak_since, values, speeds, onset, times, **how
        )
        # of each the value, the ends of its interval, the standard error, and the bound by the records
        (*when, when_bound), (*at, at_bound) = places[:5], places[5:]
        source = "records"
        if bool(is_ramp.any()):
            late = _late_by_steps(dataset, when[0], at[0])
            share = (late.speed / at[0]).where(is_ramp, 1.0)
            later = late.time.where(is_ramp, 0.0)
            when[:3] = [each - later for each in when[:3]]
            at[:3] = [each * share for each in at[:3]]
            when_bound = when_bound + late.time_bound.where(is_ramp, 0.0)
            at_bound = at_bound + late.speed_bound.where(is_ramp, 0.0)
            source = "records and step"
        text = f"peak of the mean of the {quantity.replace('_', ' ')} over the members"
        reason = reason.drop_attrs(deep=False)
        found = (
            (name, (value, low, high, sem), bound, "records", unit, text),
            (
                f"{prefix}_time",
                when,
                when_bound,
                source,
                "s",
                f"time of sliding to the {text}",
            ),
            (f"{prefix}_speed", at, at_bound, source, "m/s", f"speed at the {text}"),
        )
        for key, numbers, off, cause, si, words in found:
            middle, first, last, scatter = numbers
            middle = labelled(middle, si, words).assign_attrs(definition=words)
            off = off.assign_attrs(source=cause)
            result[key] = Estimate(middle, scatter, first, last, off, reason=reason)
    return result


def _peak_since(
    values: Array, speeds: Array, first: int, times: Array, unit: str
) -> tuple[Any, ...]:
    """Return the numbers of the ``Peak`` of the members after a record, of its time, and of the speed then.

    Time and speed have the ends of their intervals, a standard error, and a bound by the records.
    """
    known, since = np.abs(values[:, first:]), times[first:] - times[first]
    known = known[np.isfinite(known).all(axis=-1)]
    if not len(values):
        cure = "[record] per_member = true"
        peak = Peak(f"the peak of members with noise needs every member: {cure}")
    elif len(known) < 2 and len(values) > 1:
        peak = Peak("fewer than two contacts stay closed")
    elif len(known) < 2 or known.shape[1] < _FEWEST:
        few = "members" if len(known) < 2 else "records"
        peak = Peak(f"there are too few {few}")
    else:
        peak = peak_of_mean(known, since, unit)
    half = 0.5 * float(since[1] - since[0]) if since.size > 1 else 0.0
    place = peak.time, peak.first, peak.last
    offs = [off for each in (peak.time_sem, half) for off in (-each, each)]
    at = np.interp([*place, *(peak.time + off for off in offs)], since, speeds[first:])
    time = *place, peak.time_sem, half
    speed = *at[:3], *(0.5 * abs(at[4::2] - at[3::2]))
    return *peak[:5], peak.bound, *time, *speed
