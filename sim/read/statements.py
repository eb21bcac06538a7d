"""Statements: each value that a person reads of a run, at one point of the sweep, as tables and report print it."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import scipy
import xarray as xr

from sim.quantities import Form, form_of
from sim.read.correlation import Array
from sim.read.estimate import Estimates
from sim.units.notation import bounded, scaled, share


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


def each(group: Estimates) -> Iterator[Statement]:
    """Yield the statements of some quantities, one for each point of the sweep."""
    for name, one in group.items():
        value, about = one.value, one.value.attrs
        text, over = str(about.get("long_name", name)), str(about.get("over", ""))
        missing = xr.full_like(value, np.nan, float)
        numbers = [
            (missing if field is None else field.broadcast_like(value)).transpose(
                *value.dims
            )
            for field in (value, one.sem, one.low, one.high, one.bound)
        ]
        reasons = xr.full_like(value, "", object) if one.reason is None else one.reason
        reasons = reasons.broadcast_like(value).transpose(*value.dims)
        for place in np.ndindex(*value.shape):
            at = {
                str(dim): value[dim][index].item()
                for dim, index in zip(value.dims, place, strict=True)
                if dim in value.coords
            }
            size, *errors = (float(field.values[place]) for field in numbers)
            error, low, high, bound = errors
            why = str(reasons.values[place])
            beside = (error, low, high, bound, one.source, over, why, at)
            yield Statement(name, text, one.unit, size, *beside)


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
