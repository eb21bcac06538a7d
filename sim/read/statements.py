"""Statements: each value that a person reads of a run, computed once. Tables, CSV, figures and report print them."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import scipy
import xarray as xr

from sim.quantities import QUANTITIES, Form, form_of
from sim.read.dataset import MEMBERS
from sim.read.events import (
    ensemble_peaks,
    events,
    half_lives,
    peaks_after_holds,
    slips_by_phase,
)
from sim.read.statistics import Array, correlation_time, over_members, summary
from sim.units.notation import bounded, scaled, share

#: Endings of the variables of a statement beside its value.
_BESIDE = ("sem", "low", "high", "bound", "reason")


class Statement(NamedTuple):
    """One statement at one point of the sweep, in SI.

    Attributes
    ----------
    name, text, unit : str
        Name of the variable, its meaning, and its unit.
    value, error, low, high : float
        Value, standard error, and ends of the 95 % interval; nan if unknown. An end alone is a bound.
    bound, source : float, str
        Bound of an error that members do not reduce, such as that of the clock step, and
        its cause; nan if there is none.
    over : str
        Sample of the value: members, span, phase; "" of a single run.
    reason : str
        The reason if there is no value, or why it is no mean; "" else.
    at : dict
        Values of the swept keys.
    """

    name: str
    text: str
    unit: str
    value: float
    error: float
    low: float
    high: float
    bound: float
    source: str
    over: str
    reason: str
    at: dict[str, Any]

    def __str__(self) -> str:
        """Return the value with its error or bounds and unit, and the reason if there is one."""
        sizes = [
            abs(size) for size in (self.value, self.low, self.high) if np.isfinite(size)
        ]
        form = form_of(self.name, self.unit)
        factor, unit = scaled(max(sizes, default=0.0), self.unit)
        if form is not Form.PLAIN:
            factor, unit = 100.0, "%"
        text = share(self.value, self.low, self.high) if form is Form.SHARE else ""
        value, error, low, high, bound = (
            factor * number
            for number in (
                self.value,
                self.error,
                self.low,
                self.high,
                np.nan_to_num(self.bound),
            )
        )
        text = text or bounded(value, error, low, high, bound, self.source)
        return "; ".join(
            filter(None, (f"{text} {unit}".rstrip() if sizes else "", self.reason))
        )


def statistics(dataset: xr.Dataset) -> xr.Dataset:
    """Return statistics over the members of everything recorded, at each sweep value and time.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member or with statistics only.

    Returns
    -------
    xarray.Dataset
        ``…_mean``, ``…_std``, ``…_sem`` and ``…_quantile`` of every trajectory (see ``summary``), the same of
        ``area_ratio`` (A/A_JKR), of the shares of the lost area (see ``shares``), of ``fraction_detached`` and
        ``fraction_masked`` (the latter is known of statistics alone only while all contacts are closed), of what a
        whole run has once (see ``statements``), and ``correlation_time`` with its standard error. A member whose
        trajectory has stopped is left out from there on; ``fraction_detached`` counts it.
    """
    once = of_events(dataset).drop_dims("phase", errors="ignore")
    each = over_members(dataset), once, correlation_time(dataset)
    return xr.merge(each, compat="no_conflicts", join="outer", combine_attrs="override")


def of_events(dataset: xr.Dataset) -> xr.Dataset:
    """Return statistics of the events of a run over the members, with medians and rates of lifetimes.

    An event that is read off the records has a bound: the change if every second record is left out.
    """
    result = events(dataset)
    beside = result[
        [name for name in result if str(name).endswith(("_reason", "_bound"))]
    ]
    members = summary(result.drop_vars(list(beside)).assign_attrs(dataset.attrs))
    if {"pull_off_error", "pull_off_load"} <= set(dataset):
        error = abs(dataset["pull_off_error"]).assign_attrs(source="step")
        beside["pull_off_load_bound"] = error
    for name, bound in beside.items():
        if MEMBERS in bound.dims and str(name).endswith("_bound"):
            beside[name] = bound.mean(MEMBERS, keep_attrs=True)
    for further in (as_means(half_lives(dataset)), beside):
        members = members.merge(further, compat="no_conflicts", join="outer")
    phased = [peaks_after_holds(dataset)]
    if {"phase_start", "slip_time"} <= set(dataset.variables) and dataset.sizes["slip"]:
        phased.append(slips_by_phase(dataset))
    for of_phases in (values for values in phased if values):
        means = summary(of_phases.assign_attrs(dataset.attrs), quantiles=False)
        members = members.merge(
            means.rename({name: f"phase_{name}" for name in means}),
            compat="no_conflicts",
            join="outer",
        )
    return members.assign(ensemble_peaks(dataset))


def sampled(group: xr.Dataset, over: str) -> xr.Dataset:
    """Return statistics whose means have the attribute ``over``, which names their sample.

    A value that is missing without a bound or reason has the reason of the registry.
    """
    result = {}
    for key in (str(key) for key in group if str(key).endswith("_mean")):
        name = key.removesuffix("_mean")
        result[key] = group[key].assign_attrs(over=over)
        row = QUANTITIES.get(name)
        missing = group[key].isnull()
        for end in ("low", "high"):
            missing = missing & group.get(f"{name}_{end}", group[key]).isnull()
        if row is not None and row.absent and bool(missing.any()):
            reason = group.get(f"{name}_reason", xr.full_like(missing, "", object))
            is_unexplained = missing & (reason == "")
            result[f"{name}_reason"] = xr.where(is_unexplained, row.absent, reason)
    return group.assign(result)


def as_means(values: xr.Dataset) -> xr.Dataset:
    """Return values with intervals and reasons under names of means."""
    return values.rename(
        {
            n: f"{n}_mean"
            for n in values
            if not str(n).endswith(tuple(f"_{end}" for end in _BESIDE))
        }
    )


def each(group: xr.Dataset) -> Iterator[Statement]:
    """Yield the statements of a dataset of ``statements``, one for each point of the sweep."""
    for key in (str(key) for key in group if str(key).endswith("_mean")):
        name, values = key.removesuffix("_mean"), group[key]
        beside = {
            end: group[f"{name}_{end}"].broadcast_like(values)
            for end in _BESIDE
            if f"{name}_{end}" in group
        }
        text = str(values.attrs.get("long_name", name)).removeprefix(
            "ensemble mean of "
        )
        unit, over = (
            str(values.attrs.get("units", "1")),
            str(values.attrs.get("over", "")),
        )
        for place in np.ndindex(*values.shape):
            index = dict(zip(values.dims, place, strict=True))
            error, low, high, bound = (
                float(beside[end][index]) if end in beside else np.nan
                for end in _BESIDE[:4]
            )
            source = (
                beside["bound"].attrs.get("source", "") if "bound" in beside else ""
            )
            reason = str(beside["reason"][index].item()) if "reason" in beside else ""
            at = {
                str(dim): values[dim][index[dim]].item()
                for dim in values.dims
                if dim in values.coords
            }
            yield Statement(
                name,
                text,
                unit,
                float(values[index]),
                error,
                low,
                high,
                bound,
                source,
                over,
                reason,
                at,
            )


def reasons(group: xr.Dataset) -> dict[str, list[str]]:
    """Return the names of statements by the reason that they have somewhere in the sweep."""
    result: dict[str, list[str]] = {}
    for key in (str(key) for key in group if str(key).endswith("_reason")):
        for reason in filter(None, np.unique(group[key].to_numpy().astype(str))):
            result.setdefault(str(reason), []).append(key.removesuffix("_reason"))
    return result


def relaxation(dataset: xr.Dataset, name: str, start: float = 0.0) -> Statement:
    """Return the time in which a quantity relaxes by a factor of e, such as after a step of the speed.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, at one point of its sweep.
    name : str
        A recorded variable, such as ``"shear_stress"`` or ``"slider_position"``.
    start : float
        Time from which on it relaxes [s].

    Returns
    -------
    Statement
        The time T [s] with its standard error and 95 % interval, both by the jackknife over the members, which holds
        for noise of any correlation in time; none without noise. Without a value there is the ``reason``.

    Notes
    -----
    Least squares of ``end + change e^(-(t - start)/T)`` to the members' mean. The course is no exponential if the fit
    misses more than 1 % of the change and two standard errors of the mean, root mean squares over time.

    Examples
    --------
    >>> time = np.linspace(0.0, 3.0, 301)
    >>> print(relaxation(xr.Dataset({"shear_stress": ("t", 2.0 + np.exp(-time / 0.63))}, {"t": time}), "shear_stress"))
    630 ms
    """
    after = dataset[name].sel(t=slice(start, None)).transpose(..., "t")
    time, values = after["t"].to_numpy(), after.to_numpy().reshape(-1, after.sizes["t"])
    number, mean, past = (
        len(values),
        values.mean(axis=0),
        (time - time[0]) / (time[-1] - time[0]),
    )
    text, over, nan = (
        f"time in which {name} relaxes by a factor of e",
        f"{number} members" * (number > 1),
        np.nan,
    )
    result = Statement(
        f"{name}_relaxation_time", text, "s", nan, nan, nan, nan, nan, "", over, "", {}
    )
    change, is_noisy = mean[0] - mean[-1], bool(np.ptp(values, axis=0).any())
    if not (np.isfinite(mean).all() and change != 0.0):
        return result._replace(
            reason="it does not change, or is not known at all times"
        )
    courses = (
        np.array([mean, *((number * mean - values) / (number - 1) if is_noisy else ())])
        - mean[-1]
    ) / change

    def missed(numbers: Array, course: Array) -> Array:
        return np.asarray(
            numbers[0] + numbers[1] * np.exp(-past * np.exp(-numbers[2])) - course
        )

    first = 0.0, 1.0, np.log(past[np.argmax(courses[0] < 0.37)])
    fits = np.array(
        [
            scipy.optimize.least_squares(missed, first, args=(course,)).x
            for course in courses
        ]
    )
    value = (time[-1] - time[0]) * np.exp(fits[0, 2])
    _, doubt, spread = (
        np.sqrt((number - 1) * fits[1:].var(axis=0)) if is_noisy else (nan, nan, nan)
    )
    noise = np.sqrt(np.mean(values.var(axis=0)) / max(number - 1, 1)) / abs(change)
    off = np.sqrt(np.mean(missed(fits[0], courses[0]) ** 2))
    if off > 0.01 + 2.0 * noise:
        return result._replace(
            reason=f"it is not exponential: the best exponential misses {off:.1%} of the change"
        )
    is_long, is_short = value > 0.5 * (time[-1] - time[0]), value < time[1] - time[0]
    if is_long or is_short or doubt > abs(fits[0, 1]) / 3.0 or spread > 0.5:
        kind = (
            "too long for the run"
            if is_long
            else "too short for its records"
            if is_short
            else "not above the noise"
        )
        return result._replace(reason=f"about {value:.2g} s, {kind}")
    factor = np.exp(scipy.stats.t.ppf(0.975, number - 1) * spread)
    return result._replace(
        value=value, error=value * spread, low=value / factor, high=value * factor
    )
