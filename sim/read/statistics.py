"""Statistics over the members, at each sweep value and time."""

from collections.abc import Collection
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from sim.quantities import QUANTITIES, Form
from sim.read.control_variate import (
    ControlVariate,
    control_variate,
    corrected,
    is_corrected,
)
from sim.read.correlation import LEVEL, WIDE, Array
from sim.read.dataset import (
    MEMBERS,
    STATISTIC,
    ensemble_mean,
    number_of_members,
    pieces,
)
from sim.read.estimate import Estimate, Estimates, joined
from sim.read.observables import (
    closed_observables,
    is_of_contact,
    restricted,
    too_few_closed,
)

#: Members with which a member may be below 5 % of all.
FOR_TAILS = 20
QUANTILES = (0.05, 0.5, 0.95)
#: Observables that are 0 or 1 in each member: the interval of their mean is that of a share.
_COUNTED = (
    "fraction_detached",
    "fraction_masked",
    "ever_detached",
    "ever_masked",
    "ran_away",
)
#: Forces and speeds below it are of rounding, by their units: a bond bears a million million times as much.
_ROUNDING = {"N": 1e-24, "m/s": 1e-24}


def averaging(dataset: xr.Dataset, late: bool) -> str:
    """Return in words the sample of a mean: the second half of the run if ``late``, and members that differ."""
    over = ["second half of the run"] if late and dataset.sizes["t"] > 2 else []
    members = number_of_members(dataset)
    over += [f"{members} members"] if members > 1 else []
    return f"mean over the {' and '.join(over)}" if over else ""


def with_a_value(sample: str, members: int, count: int | None = None) -> str:
    """Return a sample in words of which ``count`` of all ``members`` have a value, or some of them.

    >>> print(with_a_value("second half of the run and 8 members", 8, 5))
    second half of the run and 5 of the 8 members, those that have a value
    >>> print(with_a_value("8 members", 8))
    8 members, or those of them that have a value
    """
    words = f"{members} members"
    if count is None:
        return sample.replace(words, f"{words}, or those of them that have a value")
    return sample.replace(words, f"{count} of the {words}, those that have a value")


def summary(observables: xr.Dataset, quantiles: bool = True) -> Estimates:
    """Return mean, spread and quantiles over the members, each mean and quantile with its error.

    Parameters
    ----------
    observables : xarray.Dataset
        One without the dimension ``member`` is the same for all members: its spread is 0. One with the dimension
        ``statistic`` has its statistics already.
    quantiles : bool
        Whether quantiles are wanted, which take most of the time.

    Returns
    -------
    dict of str to Estimate
        The errors of a single member are nan. A member that has no value (the indentation of an open contact) is left
        out.

    Notes
    -----
    The interval of a mean is Student's, that of a share of the members Wilson's (J. Am. Stat. Assoc. 22 (1927) 209).
    That of a quantile lies between order statistics, with linear interpolation, and holds for any law; where so few
    members have none (a 5 % quantile of less than 59), it is nan.
    """
    result = {}
    for key, variable in observables.data_vars.items():
        name, values = str(key), variable.astype(float, copy=False)
        if least := _ROUNDING.get(str(variable.attrs.get("units"))):
            values = values.where(~(abs(values) < least), 0.0)
        values = values.assign_attrs(variable.attrs)
        if STATISTIC in values.dims:
            result[name] = _recorded(values, observables)
        elif MEMBERS in values.dims:
            result[name] = _over_members(values, quantiles)
        else:
            none = xr.zeros_like(values).where(values.notnull())
            levels = values.expand_dims(quantile=list(QUANTILES)) if quantiles else None
            result[name] = Estimate(
                values, none, values, values, None, none, levels, levels, levels
            )
    return result


def _recorded(statistics: xr.DataArray, observables: xr.Dataset) -> Estimate:
    """Return the estimate of recorded statistics; only members with closed contacts count for what these alone have."""
    value, std, sem = statistics.transpose(STATISTIC, ...).drop_vars(
        STATISTIC, errors="ignore"
    )
    count: Any = float(observables.attrs.get("members", 1))
    members = None
    if is_of_contact(str(statistics.name)) and "fraction_detached" in observables:
        closed = 1.0 - ensemble_mean(observables["fraction_detached"])
        count = np.rint(count * closed).broadcast_like(value).transpose(*value.dims)
        members, count = value.copy(data=count), count.to_numpy()
    name = str(statistics.name)
    low, high = interval(name, value.to_numpy(), sem.to_numpy(), count)
    ends = value.copy(data=low), value.copy(data=high)
    return Estimate(value, sem, *ends, std=std, members=members)


def _over_members(values: xr.DataArray, quantiles: bool) -> Estimate:
    """Return the statistics over the members of a variable."""
    rows = np.moveaxis(values.to_numpy(), values.get_axis_num(MEMBERS), -1).copy()
    if quantiles:
        rows.sort()  # nan last
    count = np.sum(~np.isnan(rows), axis=-1, dtype=float)
    first_member = values.isel({MEMBERS: 0}, drop=True)
    arrays = {
        kind: first_member.copy(data=data)
        for kind, data in _moments(str(values.name), rows, count).items()
    }
    if quantiles:
        levels = first_member.expand_dims(quantile=list(QUANTILES))
        arrays |= {
            kind: levels.copy(data=data)
            for kind, data in _quantiles(rows, count).items()
        }
    return Estimate(**arrays, members=first_member.copy(data=count))


def _moments(name: str, values: Array, count: Array) -> dict[str, Array]:
    """Return the statistics over the last axis, of ``count`` numbers each, that need no order."""
    # nan is the answer where there are too few
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.nansum(values, axis=-1) / count
        deviations = values - mean[..., None]
        squares = np.nansum(deviations * deviations, axis=-1)
        std = np.sqrt(squares / np.where(count > 1.0, count - 1.0, np.nan))
        error = std / np.sqrt(count)
    low, high = interval(name, mean, error, count)
    return {"value": mean, "std": std, "sem": error, "low": low, "high": high}


def interval(
    name: str, mean: Array, sem: Array, count: Array | float
) -> tuple[Array, Array]:
    """Return the ends of the 95 % interval of a mean over ``count`` members; nan for a single member.

    No end of a share is below 0 or above 1, because no mean of shares is.
    """
    count = np.asarray(count, float)
    if name not in _COUNTED:
        half = (
            special.stdtrit(
                np.where(count > 1.0, count - 1.0, np.nan), 0.5 + 0.5 * LEVEL
            )
            * sem
        )
        low, high = mean - half, mean + half
        if name in QUANTITIES and QUANTITIES[name].form is Form.SHARE:
            return np.maximum(low, 0.0), np.minimum(high, 1.0)
        return low, high
    # time averages of the members count for more than one each
    with np.errstate(invalid="ignore", divide="ignore"):
        equivalent = np.where(sem > 0.0, mean * (1.0 - mean) / sem**2, 0.0)
    count = np.where(count > 1.0, np.maximum(count, equivalent), np.nan)
    shrunk = 1.0 + WIDE**2 / count
    middle = (mean + 0.5 * WIDE**2 / count) / shrunk
    half = (
        WIDE
        / shrunk
        * np.sqrt(
            np.maximum(mean * (1.0 - mean), 0.0) / count + (0.5 * WIDE / count) ** 2
        )
    )
    return np.maximum(middle - half, 0.0) * (mean != 0.0), np.minimum(
        middle + half, 1.0
    )


def _quantiles(ordered: Array, count: Array) -> dict[str, Array]:
    """Return quantiles of the first ``count`` numbers, which are in order, and the ends of their intervals."""
    levels = np.array(QUANTILES)
    counts, indices = np.unique(count, return_inverse=True)
    places = {"quantile": levels * (counts[:, None] - 1.0)}
    places["quantile_low"], places["quantile_high"] = quantile_ranks(
        counts[:, None], levels
    )
    return {
        kind: np.moveaxis(
            values_at_ranks(ordered, place[indices.reshape(count.shape)]), -1, 0
        )
        for kind, place in places.items()
    }


def quantile_ranks(count: Array, level: Array) -> tuple[Array, Array]:
    """Return the places in ``count`` ordered numbers between which a quantile of their law lies, from 0 on.

    The number of them below the quantile is binomial. If one tail cannot be as small as half of the excluded
    probability, the other tail has the rest. The result is nan if there is no such interval.

    >>> low, high = quantile_ranks(np.array([64.0]), np.array([0.5]))
    >>> print(f"{low[0]:.2f} {high[0]:.2f}")
    23.69 39.31
    """
    left = 1.0 - LEVEL
    # chances of all numbers above the quantile, and below
    lowest, highest = (1.0 - level) ** count, level**count
    below = np.where(
        highest > 0.5 * left, left - highest, np.maximum(lowest, 0.5 * left)
    )
    above = np.where(
        lowest > 0.5 * left, left - lowest, np.maximum(highest, 0.5 * left)
    )
    with np.errstate(invalid="ignore"):
        low = np.where(below > lowest, special.bdtrik(below, count, level), 0.0)
        high = np.where(
            above > highest, special.bdtrik(1.0 - above, count, level), count - 1.0
        )
    none = (below < lowest) | (above < highest)
    return np.where(none, np.nan, low), np.where(none, np.nan, high)


def values_at_ranks(ordered: Array, places: Array) -> Array:
    """Return the values at places along the last axis, from 0 on and between; nan where a place is nan."""
    known = places >= 0.0
    below = np.where(known, places, 0.0).astype(np.intp)
    above = np.minimum(below + 1, ordered.shape[-1] - 1)
    share = places - below
    low, high = (np.take_along_axis(ordered, at, axis=-1) for at in (below, above))
    return np.where(
        share > 0.0, low + share * (high - low), np.where(known, low, np.nan)
    )


def over_members(
    dataset: xr.Dataset, names: Collection[str] | None = None, quantiles: bool = True
) -> Estimates:
    """Return the ``summary`` of observables at each sweep value and time, by default of all.

    Means of contact area, radius, friction and lost area are those at the known mean of ΔΓ, where it is known.
    """

    def of_piece(part: xr.Dataset) -> Estimates:
        values = closed_observables(part, names)
        result, control = summary(values, quantiles), control_variate(part)
        if (reason := too_few_closed(part)) is not None:
            for name in filter(is_of_contact, result):
                why = reason.where(result[name].value.isnull(), "")
                result[name] = result[name]._replace(reason=why)
        if control is None:
            return result
        return {
            name: _at_known_mean(one, values[name], control)
            for name, one in result.items()
        }

    dim, parts = pieces(restricted(dataset, names), ("t",))
    return joined([of_piece(part) for part in parts], dim)


def _at_known_mean(
    plain: Estimate, values: xr.DataArray, control: ControlVariate
) -> Estimate:
    """Return an estimate with the mean, its error and interval at the known mean of ΔΓ, where that is used."""
    if not is_corrected(str(values.name)) or MEMBERS not in values.dims:
        return plain
    rows = [
        each.broadcast_like(values).transpose(*plain.value.dims, MEMBERS).to_numpy()
        for each in (values, *control[:2])
    ]
    result = corrected(*rows)
    is_used = control.is_used.broadcast_like(plain.value).transpose(*plain.value.dims)
    at_known_mean = is_used.to_numpy() & np.isfinite(result.sem)
    low, high = interval("", result.mean, result.sem, result.freedom + 1.0)

    def where_used(array: Array, other: Any) -> xr.DataArray:
        return plain.value.copy(data=np.where(at_known_mean, array, other))

    return plain._replace(
        value=where_used(result.mean, plain.value),
        sem=where_used(result.sem, plain.sem),
        low=where_used(low, plain.low),
        high=where_used(high, plain.high),
        plain=plain.value,
        bias=where_used(result.bias, np.nan),
    )
