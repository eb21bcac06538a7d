"""Peaks of stress and friction of members with noise: those of their mean, with errors, or the reason for none."""

import contextlib
import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.dataset import MEMBERS, plain, setting, speed_of, word
from sim.analysis.observables import labelled
from sim.analysis.statistics import LEVEL, observable_of
from sim.units.notation import engineering

#: Quantities whose peak is stated, with the beginnings of the names of its time and speed.
_PEAKS = {"peak_stress": ("shear_stress", "peak"), "peak_friction": ("friction_force", "peak_friction")}
#: Chance of a peak out of noise; resampled ensembles for the error of its time; share of the records after it.
_CHANCE, _RESAMPLED, _AFTER = 0.01, 200, 8
#: Standard errors by which estimates of a peak over different numbers of records may differ.
_ALIKE = 2.0
#: Dimensions of a quantity of each member.
_EACH = [MEMBERS, "t"]
#: Records that a peak needs: an eighth of them are its end.
_FEWEST = 8


class Peak(NamedTuple):
    """Peak of the mean of members, its standard error, time, and the ends of both intervals; or why there is none."""

    reason: str
    value: float = math.nan
    sem: float = math.nan
    low: float = math.nan
    high: float = math.nan
    time: float = math.nan
    first: float = math.nan
    last: float = math.nan


def peak_of_mean(values: np.ndarray, times: np.ndarray, unit: str = "1") -> Peak:
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

    def error(weights: np.ndarray) -> float:
        return float(np.std(values @ weights, ddof=1)) / math.sqrt(members) if members > 1 else math.nan

    weights, _ = _top(mean, 0, last)
    place = int(np.argmax(weights))
    surely = float(special.stdtrit(free, 1.0 - _CHANCE / records))
    for base in (tail, np.eye(1, records)[0]):
        if not (weights - base) @ mean > surely * error(weights - base):
            most, end, when = (engineering(*number) for number in (
                (mean[place], unit), (float(tail @ mean), unit), (float(times[place]), "s")
            ))  # fmt: skip
            return Peak(f"no peak above the noise: at most {most} after {when}, {end} at the end")
    if place < 3:
        step = engineering(float(times[place]) / 4.0, "s")
        return Peak(f"too few records to resolve the peak: record every {step} or more often")
    tried, width = [_top(mean, 0, last)], 1
    while 2 * width <= place:
        weights, at = _top(mean, width, last)
        if any(abs((weights - other) @ mean) > _ALIKE * error(weights - other) for other, _ in tried):
            break
        tried, width = [*tried, (weights, at)], 2 * width
    (weights, at), width = tried[-1], width // 2
    rng = np.random.default_rng(0)  # the same interval each time
    drawn = rng.multinomial(members, np.full(members, 1.0 / members), size=_RESAMPLED) / members @ values
    ends = np.quantile([_top(each, width, last)[1] for each in drawn], [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    value, sem, records_at = float(weights @ mean), error(weights), np.arange(records)
    half = float(special.stdtrit(free, 0.5 + 0.5 * LEVEL)) * sem
    between = max(0.0, 0.125 * float(np.array([-1.0, 2.0, -1.0]) @ mean[place - 1 : place + 2])) * (width < 2)
    time, first, stop = np.interp([at, ends[0] - 0.5, ends[1] + 0.5], records_at, times)
    return Peak("", value, sem, value - half, value + half + between, float(time), float(first), float(stop))


def _top(mean: np.ndarray, width: int, last: int) -> tuple[np.ndarray, float]:
    """Return the weights of the records whose sum is the peak before the record ``last``, and its place.

    It is the largest value, or if the ``width`` is two or more records to both sides the vertex of a parabola.
    """
    sums = np.append(0.0, np.cumsum(mean))
    averages = sums[2 * width + 1 : last + width] - sums[: last - width - 1]  # of centres width, ..., last - 1
    begin = 1 if width == 0 else 0
    place = width + begin + int(np.argmax(averages[begin:]))
    weights, at = np.zeros(len(mean)), float(place)
    if width < 2:
        weights[place] = 1.0
        return weights, at
    chosen = slice(place - width, place + width + 1)
    fit = np.linalg.pinv(np.vander(np.linspace(-1.0, 1.0, 2 * width + 1), 3))
    curvature, slope, _ = fit @ mean[chosen]
    vertex = float(np.clip(-0.5 * slope / curvature, -1.0, 1.0)) if curvature < 0.0 else 0.0
    weights[chosen] = np.array([vertex**2, vertex, 1.0]) @ fit
    return weights, at + vertex * width


def ensemble_peaks(dataset: xr.Dataset) -> xr.Dataset:
    """Return the peaks of stress and friction of members with noise, while sliding after a rest or along a ramp.

    Returns
    -------
    xarray.Dataset
        ``peak_stress_mean`` [Pa] and ``peak_friction_mean`` [N] with ``…_sem``, ``…_low``, ``…_high`` and ``…_reason``,
        see ``peak_of_mean``; time since sliding starts, ``peak_time_mean`` and ``peak_friction_time_mean`` [s], and
        speed then, ``peak_speed_mean`` and ``peak_friction_speed_mean`` [m/s], with ``…_low``, ``…_high``. Empty under
        any other drive, and of members that do not differ. Peaks of friction are of the contacts that stay closed.
    """
    dataset = plain(dataset)
    drive, result = word(dataset, "drive.model", ""), xr.Dataset()
    if not bool(((drive == "ramp") | (drive == "start")).any()) or "speed" not in dataset:
        return result
    rest = xr.DataArray(0.0)
    with contextlib.suppress(KeyError):
        rest = setting(dataset, "drive.rest").where(drive == "start", 0.0)
    times, sweep = dataset["t"], xr.zeros_like(dataset["contact_modulus"], float)
    onset, speeds = (times >= rest - 1e-6 * times[-1]).argmax("t"), abs(speed_of(dataset)) + sweep
    for name, (source, prefix) in _PEAKS.items():
        is_recorded = source in dataset
        if f"{source}_mean" not in dataset and not (is_recorded and MEMBERS in dataset[source].dims):
            continue
        unit = dataset[source if is_recorded else f"{source}_mean"].attrs.get("units", "1")
        values = observable_of(dataset, source) if is_recorded else xr.DataArray(np.empty((0, times.size)), dims=_EACH)
        how: Any = {"input_core_dims": [_EACH, ["t"], [], ["t"]], "output_core_dims": [[]] * 11, "vectorize": True}
        how |= {"output_dtypes": [object, *"dddddddddd"], "kwargs": {"unit": unit}}
        reason, *numbers = xr.apply_ufunc(_peak_since, values, speeds, onset, times, **how)
        text = f"peak of the mean of the {source.replace('_', ' ')}"
        described: dict[str, Any] = {f"{name}_{kind}": (unit, text) for kind in ("mean", "sem", "low", "high")}
        for of, *about in (("time", "s", f"time of sliding to the {text}"), ("speed", "m/s", f"speed at the {text}")):
            described |= {f"{prefix}_{of}_{end}": about for end in ("mean", "low", "high")}
        for (key, about), column in zip(described.items(), numbers, strict=True):
            result[key] = labelled(column, *about)
        result[f"{name}_reason"] = reason.drop_attrs(deep=False).assign_attrs(long_name=f"reason for no {text}")
    return result


def _peak_since(values: np.ndarray, speeds: np.ndarray, first: int, times: np.ndarray, unit: str) -> tuple[Any, ...]:
    """Return the fields of the ``Peak`` of the members after a record, and the speed at its time and interval."""
    if not len(values):
        return *Peak("the peak of members with noise needs every member: [record] per_member = true"), *[math.nan] * 3
    known, since = np.abs(values[:, first:]), times[first:] - times[first]
    known = known[np.isfinite(known).all(axis=-1)]
    is_enough = len(known) > 1 and known.shape[1] >= _FEWEST
    peak = peak_of_mean(known, since, unit) if is_enough else Peak("too few records or members")
    return *peak, *np.interp(peak[-3:], since, speeds[first:])
