"""Statistics over members at each time, over members and stationary time, of lifetimes, and correlation times."""

import itertools
import math
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy
import xarray as xr
from scipy import special

from sim.quantities import has_mean
from sim.read.dataset import (
    MEMBERS,
    ROOM,
    has_noise,
    in_pieces,
    plain,
    steady_points,
    sweep_dims,
    word,
)
from sim.read.observables import (
    FEW_LEFT,
    KEPT,
    charges,
    chosen_observables,
    closed_observables,
    closed_only,
    is_of_contact,
    labelled,
    pure,
    reference_radii,
    restricted,
    share_observables,
)
from sim.units.errors import BadInput
from sim.units.notation import engineering, scaled, second_half
from sim.units.quantity import read_option

Array = np.ndarray
#: How many correlation times the autocorrelation is summed over: what is cut off is e^-6 of it.
_WINDOW = 6.0
#: Records that a correlation time must span: Simpson's rule is then right to (1/2)^4/180, 0.03 %.
_FEWEST = 2.0
#: How many of its standard errors the correlation of neighbouring records is below that of ``_FEWEST``.
_SURELY = 4.0
#: Members with which a member may be below 5 % of all.
FOR_TAILS = 20
#: Numbers that are transformed at once, and values that a correlation time is taken from.
_AT_ONCE, _VALUES = 2**19, 2**22
#: Records between two values at first, and at most; times the window that must be inside at first.
_LAGS, _SAFELY = (2**13, 2**16), 2.0


class IntegralTime(NamedTuple):
    """An integral correlation time and its standard error [s], or the reason for none.

    If records are too coarse, ``below`` is an upper limit [s].
    """

    time: float = math.nan
    sem: float = math.nan
    below: float = math.nan
    reason: str = ""


def integral_time(values: Array, step: float) -> IntegralTime:
    """Return the integral correlation time of stationary trajectories: the integral of the autocorrelation.

    Parameters
    ----------
    values : array, shape (members, records)
        Independent members of one process.
    step : float
        Time between records [s].

    Returns
    -------
    IntegralTime
        In seconds. nan where nothing fluctuates, where the run is shorter than the window (run longer, or
        with more members), and where the time spans less than two records, so that no sum over records
        is right: then ``below`` is two records, if the records show it beyond their noise (record more often).

    Notes
    -----
    The autocovariance is averaged over members and times, of the deviations from the ensemble mean
    at each time (unbiased; for a single member from its own mean in time). Its integral is summed up to
    the smallest W at which ``W step >= 6 T(W)`` (A. Sokal, Monte Carlo Methods in Statistical Mechanics,
    1997), which leaves out e^-6 of an exponential memory, by Simpson's rule, which adds (step/T)^4/180 of it
    (the trapezoidal rule would add (step/T)^2/12). The standard error ``T sqrt(2 (2W + 1)/n)``, n the number
    of free values, is Madras and Sokal's for a Gaussian process (J. Stat. Phys. 50 (1988) 109).

    Examples
    --------
    Values that forget a fifth from one record to the next, ``exp(-1/T) = 0.8``:

    >>> rng = np.random.default_rng(5)
    >>> x = np.zeros((64, 4000))
    >>> for k in range(1, 4000):
    ...     x[:, k] = 0.8 * x[:, k - 1] + rng.normal(size=64)
    >>> time, sem, *_ = integral_time(x, step=1.0)
    >>> print(f"{-1 / math.log(0.8):.2f} {abs(time - 4.48) < 5 * sem} {sem < 0.1}")
    4.48 True True

    Every tenth record tells only that the time is shorter than two of them:

    >>> print(integral_time(x[:, ::10], step=10.0).below)
    20.0
    """
    members, records = values.shape
    if records < 2:
        return IntegralTime(reason="a single record has none")
    if not np.isfinite(values).all():
        return IntegralTime(reason="a contact has no value at some times")
    free = max(members - 1, 1)
    common = values.mean(axis=0) if members > 1 else values.mean()
    covariance = covariance_of(values, common, free)
    if not covariance[0] > (1e-10 * np.max(np.abs(values))) ** 2:
        return IntegralTime(reason="nothing fluctuates")
    correlation, lags = covariance / covariance[0], np.arange(covariance.size)
    coarse = math.exp(-1.0 / _FEWEST)
    if correlation[1] < coarse:
        error = 1.0 / math.sqrt(free * records)
        is_sure = correlation[1] < coarse - _SURELY * error
        return IntegralTime(
            below=_FEWEST * step if is_sure else math.nan,
            reason="fewer than two records in a correlation time: reduce clock.record",
        )
    weights = np.where(lags % 2, 4.0, 2.0) / 3.0
    weights[0] /= 2.0
    sums = np.cumsum(weights * correlation)
    inside = lags >= _WINDOW * sums
    if not inside.any():
        cure = "increase clock.duration or ensemble.members"
        return IntegralTime(reason=f"the run is too short for its memory: {cure}")
    window = int(inside.argmax())
    time = step * float(sums[window])
    return IntegralTime(
        time, time * math.sqrt(2.0 * (2.0 * window + 1.0) / (free * records))
    )


def members_for_memory(members: int, records: int) -> int:
    """Return the number of members that are enough for a correlation time."""
    return min(members, max(2, _VALUES // records))


def covariance_of(values: Array, mean: Array | float, free: float) -> Array:
    """Return the mean product of deviations by the number of records between them.

    Parameters
    ----------
    values : array, shape (..., members, records)
        Series; of long ones no more than 65,536 records between two are looked at, and 8192 if the memory ends before.
    mean : float or array, shape (..., records) or (..., 1)
        Value from which deviations are taken.
    free : float
        Number of independent series.
    """
    mean, records = (
        np.broadcast_to(mean, (*values.shape[:-2], values.shape[-1])),
        values.shape[-1],
    )
    for lags in np.unique(np.minimum(records, _LAGS)):
        result = _products(values, mean, lags) / (
            free * np.arange(records, records - lags, -1)
        )
        sums = np.cumsum(result, axis=-1)
        if np.all(
            np.any(
                np.arange(lags) * result[..., :1] >= _SAFELY * _WINDOW * sums, axis=-1
            )
        ):
            break
    return result


def _products(values: Array, mean: Array, lags: int) -> Array:
    """Return the sums of products of deviations by the number of records between them."""
    *points, members, records = values.shape
    length = scipy.fft.next_fast_len(lags, real=True)
    rows = max(1, _AT_ONCE // (2 * length * math.prod(points)))
    power = np.zeros((2, *points, length + 1), complex)
    for first in range(0, members, rows):
        before = None
        # stretches; each with itself and with the one before
        for start in range(0, records, length):
            stretch = slice(start, start + length)
            some = (
                values[..., first : first + rows, stretch]
                - mean[..., np.newaxis, stretch]
            )
            spectrum = scipy.fft.rfft(some, 2 * length)
            power[0] += np.sum(spectrum.real**2 + spectrum.imag**2, axis=-2)
            if before is not None:
                power[1] += np.sum(spectrum * before.conj(), axis=-2)
            before = spectrum
    # the second is half the length later
    total = power[0] + (-1.0) ** np.arange(length + 1) * power[1]
    return scipy.fft.irfft(total, 2 * length)[..., :lags]


#: Degrees of freedom below which a single series is too short for its error: it seems to forget faster than it does,
#: and more than one interval in ten would miss the mean.
_TOO_FEW = 3.0


def inflation(covariance: Array, members: int, records: int) -> Array:
    """Return the variance of a mean over correlated records, in that of a mean over as many independent ones.

    Parameters
    ----------
    covariance : array
        As of ``covariance_of``.
    members, records : int
        Of how many members and records it is.

    Returns
    -------
    array, shape (..., 2)
        ``1 + 2 sum of the autocorrelation`` over records up to Sokal's window (see ``integral_time``), and the degrees
        of freedom of a variance that is estimated with it, ``n/(2W + 1)``; nan where there is no window, or if a single
        series spans fewer than three.

    Notes
    -----
    Of a single series the sum is corrected for the deviations being from its own mean (U. Wolff, Comput. Phys. Commun.
    156 (2004) 143).
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        sums = 2.0 * np.cumsum(covariance / covariance[..., :1], axis=-1) - 1.0
        inside = np.arange(sums.shape[-1]) >= 0.5 * _WINDOW * sums
    window = inside.argmax(axis=-1)
    wide = (2.0 * window + 1.0) / records
    ratio = np.maximum(
        np.take_along_axis(sums, window[..., np.newaxis], axis=-1)[..., 0],
        1.0 / records,
    )
    known = (covariance[..., 0] > 0.0) & inside.any(axis=-1)
    if members == 1:
        ratio, known = ratio * (1.0 + wide), known & (wide * _TOO_FEW <= 1.0)
    return np.where(
        known[..., np.newaxis],
        np.stack([ratio, max(members - 1, 1) / wide], axis=-1),
        math.nan,
    )


def correlation_time(dataset: xr.Dataset) -> xr.Dataset:
    """Return the integral correlation time of the fluctuation energy ΔΓ(t) at each point of the sweep.

    It is that of the whole run and of a stationary process: there is none if the speed
    changes during the run, and where ``integral_time`` gives none.

    Returns
    -------
    xarray.Dataset
        ``correlation_time``, ``correlation_time_sem`` and, where records are too coarse
        for a number, ``correlation_time_below`` [s], with the sweep's dimensions, and
        ``correlation_time_reason``, "" where there is a number.
    """
    energy, sweep = dataset.get("fluctuation_energy"), dataset["contact_modulus"]
    steady = (
        steady_points(dataset).broadcast_like(sweep).transpose(*sweep.dims).to_numpy()
    )
    times = np.full(sweep.shape, None, object)
    for point in np.ndindex(sweep.shape):
        if not steady[point]:
            times[point] = IntegralTime(reason="the speed changes")
        elif energy is None:
            cure = "record fluctuation_energy of each member"
            times[point] = IntegralTime(reason=cure)
        elif MEMBERS not in energy.dims:
            times[point] = IntegralTime(reason="nothing fluctuates")
        else:
            count = members_for_memory(energy.sizes[MEMBERS], energy.sizes["t"])
            series = energy.isel({MEMBERS: slice(count)})
            # a large file is read point by point
            values = series.isel(dict(zip(sweep.dims, point, strict=True)))
            step = float(dataset["t"][-1]) / max(dataset.sizes["t"] - 1, 1)
            times[point] = integral_time(
                values.transpose(MEMBERS, "t").to_numpy().astype(float), step
            )
    about = "integral correlation time of the fluctuation energy"
    texts = {
        "": about,
        "_sem": f"standard error of the {about}",
        "_below": f"upper limit of the {about}",
    }
    result = xr.Dataset()
    for place, (suffix, text) in enumerate(texts.items()):
        numbers = np.reshape([time[place] for time in times.flat], sweep.shape)
        result[f"correlation_time{suffix}"] = labelled(
            sweep.copy(data=numbers), "s", text, "" if suffix else "t_c"
        )
    reasons = np.array([time.reason for time in times.flat], object)
    result["correlation_time_reason"] = xr.DataArray(
        reasons.reshape(sweep.shape), sweep.coords, sweep.dims
    ).assign_attrs(long_name=f"reason for no {about}")
    return result


# --- members, at each time and sweep value ---


QUANTILES = (0.05, 0.5, 0.95)

#: Share of repeated ensembles whose intervals hold the truth, and half of such an interval of a normal law in errors.
LEVEL = 0.95
WIDE = float(special.ndtri(0.5 + 0.5 * LEVEL))

#: Observables that are 0 or 1 in each member: the interval of their mean is that of a share.
_COUNTED = ("fraction_detached", "fraction_masked", "ever_detached")

_OF = {
    "mean": "ensemble mean",
    "std": "standard deviation",
    "sem": "standard error of the ensemble mean",
    "low": "lower end of the 95 % interval of the ensemble mean",
    "high": "upper end of the 95 % interval of the ensemble mean",
    "effective_samples": "effective number of independent values of the mean",
    "quantile": "quantiles",
    "quantile_low": "lower end of the 95 % intervals of the quantiles",
    "quantile_high": "upper end of the 95 % intervals of the quantiles",
}

#: Units of statistics that are not in that of their observable.
_UNITS = {"effective_samples": "1"}

#: How far from a swept value, in parts of it, one may be chosen: as far as rounding to three digits.
_NEAR = 5e-3


def where(dataset: xr.Dataset, chosen: Mapping[str, Any]) -> xr.Dataset:
    """Choose values of swept keys.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    chosen : dict
        Swept keys (``"contact.load"``, or ``"load"`` where that is one only), each with a value: a number in SI,
        a text with a unit (``"4 mN"``) or a name. The nearest swept value, within half a percent.

    Returns
    -------
    xarray.Dataset
        The dataset at these values; their dimensions stay, of length one.

    Raises
    ------
    BadInput
        If a key is not swept, or has no such value; the message lists those there are.
    """
    for key, value in chosen.items():
        dims = sweep_dims(dataset)
        full = key.replace(".", "_")
        fitting = [n for n in dims if n == full] or [
            n for n in dims if n.endswith(f"_{full}")
        ]
        if len(fitting) != 1:
            raise BadInput(
                [f"{key} is not swept; swept: {', '.join(dims) or 'nothing'}"]
            )
        name = fitting[0]
        swept = dataset[name]
        if swept.dtype.kind in "fi":
            unit = swept.attrs.get("units", "1")
            wanted = read_option(value, key, unit)
            off = np.abs(swept.to_numpy() - wanted)
            places = np.flatnonzero(off <= min(off.min(), _NEAR * abs(wanted)))
            known = [
                engineering(float(f"{number:.4g}"), unit) for number in swept.to_numpy()
            ]
        else:
            known = [str(text) for text in swept.to_numpy()]
            places = np.flatnonzero([text == value for text in known])
        if not places.size:
            raise BadInput(
                [f"{key} has no value {value}; there are: {', '.join(known)}"]
            )
        dataset = dataset.isel({name: places[:1]})
    return dataset


def averaging(dataset: xr.Dataset, late: bool) -> str:
    """Return in words the sample of a mean: the second half of the run if ``late``, and members that differ."""
    over = ["second half of the run"] if late and dataset.sizes["t"] > 2 else []
    members = dataset.sizes.get(MEMBERS, dataset.attrs.get("members", 1))
    differ = MEMBERS in dataset.sizes or any(
        str(name).endswith("_sem") for name in dataset.data_vars
    )
    over += [f"{members} members"] if differ and members > 1 else []
    return f"mean over the {' and '.join(over)}" if over else ""


def summary(trajectories: xr.Dataset, quantiles: bool = True) -> xr.Dataset:
    """Return mean, spread and quantiles over the members, each mean and quantile with its error.

    Parameters
    ----------
    trajectories : xarray.Dataset
        Observables. One without the dimension ``member`` is the same for all members: its
        spread is 0. Variables that are statistics already (``…_mean``, ``…_std``, ``…_sem``) pass.
    quantiles : bool
        Whether quantiles are wanted, which take most of the time.

    Returns
    -------
    xarray.Dataset
        For each observable ``…_mean``, ``…_std`` (standard deviation), ``…_sem`` (standard error of the mean),
        ``…_low`` and ``…_high`` (95 % interval of the mean), and ``…_quantile``, ``…_quantile_low``,
        ``…_quantile_high`` (with the dimension ``quantile``: 5, 50, 95 %). The errors of a single member are nan. A
        member that has no value (the indentation of an open contact) is left out.

    Notes
    -----
    The interval of a mean is Student's, that of a share of the members Wilson's (J. Am. Stat. Assoc. 22 (1927) 209).
    That of a quantile lies between order statistics, with linear interpolation, and holds for any law; where so few
    members have none (a 5 % quantile of less than 59), it is nan.
    """
    result: dict[str, xr.DataArray] = {}
    members: Any = float(trajectories.attrs.get("members", 1))
    for key, variable in trajectories.data_vars.items():
        name = str(key)
        stem, _, kind = name.rpartition("_")
        if kind in KEPT:
            result[name] = variable
            if kind == "mean" and f"{stem}_sem" in trajectories:
                count = members
                if is_of_contact(stem) and "fraction_detached_mean" in trajectories:
                    count = np.rint(
                        members
                        * (1.0 - trajectories["fraction_detached_mean"].to_numpy())
                    )
                ends = interval(
                    stem,
                    variable.to_numpy(),
                    trajectories[f"{stem}_sem"].to_numpy(),
                    count,
                )
                for end, at in zip(("low", "high"), ends, strict=True):
                    text = f"{_OF[end]} of {variable.attrs.get('long_name', stem).removeprefix(_OF['mean'] + ' of ')}"
                    result[f"{stem}_{end}"] = variable.copy(data=at).assign_attrs(
                        long_name=text
                    )
            continue
        number = variable.astype(float)
        if variable.attrs.get("units") == "N":
            number = number.where(~(abs(number) < _NO_FORCE), 0.0)
        for kind, values in _statistics_of(number, quantiles).items():
            result[f"{name}_{kind}"] = values.assign_attrs(_attributes(kind, variable))
    return xr.Dataset(result)


def _attributes(kind: str, variable: xr.DataArray) -> dict[str, Any]:
    """Return the attributes of a statistic of an observable."""
    unit = {"units": _UNITS[kind], "symbol": ""} if kind in _UNITS else {}
    return (
        variable.attrs
        | unit
        | {
            "long_name": f"{_OF[kind]} of {variable.attrs.get('long_name', variable.name)}"
        }
    )


def _statistics_of(variable: xr.DataArray, quantiles: bool) -> dict[str, xr.DataArray]:
    if MEMBERS not in variable.dims:
        none = xr.zeros_like(variable).where(variable.notnull())
        levels = variable.expand_dims(quantile=list(QUANTILES))
        ends = ("quantile", "quantile_low", "quantile_high") if quantiles else ()
        alike = {
            "mean": variable,
            "std": none,
            "sem": none,
            "low": variable,
            "high": variable,
        }
        return alike | dict.fromkeys(ends, levels)
    values = np.moveaxis(variable.to_numpy(), variable.get_axis_num(MEMBERS), -1).copy()
    if quantiles:
        values.sort()  # nan last
    count = np.sum(~np.isnan(values), axis=-1, dtype=float)
    first_member = variable.isel({MEMBERS: 0}, drop=True)
    result = {
        kind: first_member.copy(data=data)
        for kind, data in _moments(str(variable.name), values, count).items()
    }
    if quantiles:
        levels = first_member.expand_dims(quantile=list(QUANTILES))
        result |= {
            kind: levels.copy(data=data)
            for kind, data in _quantiles(values, count).items()
        }
    return result


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
    return {"mean": mean, "std": std, "sem": error, "low": low, "high": high}


def interval(
    name: str, mean: Array, sem: Array, count: Array | float
) -> tuple[Array, Array]:
    """Return the ends of the 95 % interval of a mean over ``count`` members; nan for a single member."""
    count = np.asarray(count, float)
    if name not in _COUNTED:
        half = (
            special.stdtrit(
                np.where(count > 1.0, count - 1.0, np.nan), 0.5 + 0.5 * LEVEL
            )
            * sem
        )
        return mean - half, mean + half
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
) -> xr.Dataset:
    """Return the ``summary`` of observables at each sweep value and time, by default of all."""
    needed = restricted(dataset, names)
    return in_pieces(
        needed,
        ("t",),
        lambda piece: summary(closed_observables(piece, names), quantiles),
    )


def shares(dataset: xr.Dataset) -> xr.Dataset:
    """Return the shares of the lost contact area by mechanism.

    Returns
    -------
    xarray.Dataset
        Statistics (``…_mean``, ``…_std``, ``…_sem``, ``…_quantile``) over the members of
        ``lost_to_bonds`` and ``lost_to_fluctuations``, with ``contact.reversible`` above zero
        ``lost_to_mean_stress``, in a rate-dependent contact ``lost_to_lag``; of the other order of charging, see
        ``sim.read.observables.charges``; and ``radius_jkr``, ``radius_hertz``
        [m] and ``area_ratio_hertz`` at each sweep value, and time where what holds the sphere changes.
        nan where the contact with the full work of adhesion is open.

    Raises
    ------
    ValueError
        See ``share_observables``.

    Notes
    -----
    With A_JKR the area at the full work of adhesion, A_bonds the area at what the bonds left would give
    and A_fluct that at what the fluctuations leave of it, all held as the sphere is at that time,
    ``lost_to_bonds = (A_JKR - A_bonds)/A_JKR``, ``lost_to_fluctuations = (A_bonds - A_fluct)/A_JKR`` and
    ``lost_to_mean_stress = (A_fluct - A)/A_JKR``: in each member they and ``area_ratio`` add up to one. Where
    adhesion does not pay for the mean stress, A_fluct is the contact area A. The order is a choice: the
    area is not linear in the work, so what is taken off later weighs more.
    """
    radii = reference_radii(dataset)
    ratio = pure(
        (radii["radius_hertz"] / radii["radius_jkr"]) ** 2, "Hertz area over JKR area"
    )
    share_observables(dataset.isel(t=[0]))  # where they are not known it says why
    lost = in_pieces(
        restricted(dataset, ["lost_to_bonds"]),
        ("t",),
        lambda piece: summary(charges(closed_only(piece))),
    )
    return lost.merge(radii, compat="no_conflicts").assign(area_ratio_hertz=ratio)


# --- members and the second half of a stationary run ---


#: From so many members on the spread of their means gives the error, whatever the correlation in time: of the mean,
#: for which nothing else is needed of the members, and of the shares under quantiles.
_SEVERAL, _MANY = 4, 16
#: Change over the span, as a share of the value, above which a run without noise has not settled; and which no digit
#: that is printed shows.
_STILL, _UNSEEN = 1e-3, 1e-7
#: Records in which noise of a settled mean turns back: contacts that stay open only add up.
_ONE_WAY = 20
#: Forces below it are of rounding [N]: a bond bears a million million times as much.
_NO_FORCE = 1e-24
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
        ``mean``, ``sem``, ``low`` and ``high`` (95 % interval of the mean), ``std``, ``quantile``,
        ``quantile_low`` and ``quantile_high`` (three each), and ``effective_samples``, the number of independent
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
    >>> print(50 < result["effective_samples"] < 200, result["low"] < 0.0 < result["high"])
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
        "mean": mean,
        "std": spread,
        "sem": sem,
        "low": low,
        "high": high,
        "effective_samples": effective,
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
    size = max(1, _AT_ONCE // (2 * members * records))
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
    if again or np.any(np.diff(counts) > 0):
        return f"{again or 'some'} of {members} contacts close again in {span}"
    if (left := int(counts[-1])) <= FEW_LEFT and left < members:
        return f"{left or 'none'} of {members} contacts {'are' if left == 2 else 'is'} closed at the end of {span}"
    return ""


def distribution(
    dataset: xr.Dataset,
    names: Collection[str] | None = None,
    minus: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Return statistics of observables over the members and the second half of the run, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member; of a stationary run (see ``is_stationary``).
    names : collection of str, optional
        The observables, all by default.
    minus : dict, optional
        Values of swept keys, see ``where``: statistics are those of the differences from these points. A member has the
        same noise at all of them, so the differences are of each member, and their error is often far below the errors.

    Returns
    -------
    xarray.Dataset
        ``…_mean``, ``…_sem``, ``…_low``, ``…_high``, ``…_std``, ``…_effective_samples``,
        and with the dimension ``quantile`` ``…_quantile``, ``…_quantile_low``, ``…_quantile_high``; see ``over_time``.
        What the members have in common, and a run without noise, has no errors. What only a closed contact has (see
        ``closed_only``) is of the closed contacts.

        ``…_reason`` is "" or the reason why there is no mean. If values have not settled (see ``settlements``), the
        mean is the value at the end of the span. It is nan if some contacts have opened and at most two are left, or
        contacts close again. All else is then nan.
    """
    dataset = plain(dataset)
    late, words = _late(dataset)
    step = float(late["t"][-1] - late["t"][0]) / max(late.sizes["t"] - 1, 1)
    sweep, result = (
        dataset["contact_modulus"],
        {"quantile": xr.Variable("quantile", list(QUANTILES))},
    )
    noisy, base = (
        has_noise(dataset).to_numpy().ravel(),
        where(late, minus) if minus else None,
    )
    openings = [""] * sweep.size
    if "in_contact" in late:
        closed = rows_of(late["in_contact"].compute(), sweep) > 0.0
        if base is not None:
            closed = closed & (
                rows_of(base["in_contact"].compute(), base["contact_modulus"]) > 0.0
            )
        closed = closed.reshape(-1, *closed.shape[-2:])
        again = (closed[..., 1:] & ~closed[..., :-1]).any(axis=-1).sum(axis=-1)
        counts = (
            closed.sum(axis=1),
            itertools.repeat(closed.shape[1]),
            (str(count or "") for count in again),
        )
        openings = [_openings(*point, words) for point in zip(*counts, strict=False)]
    readers = [_reader(each, names) for each in (late, base) if each is not None]
    for name in map(
        str, chosen_observables(restricted(late, names).isel(t=[-1]), names)
    ):
        if not has_mean(name):
            continue
        variable = readers[0](name)
        differ, values = (
            noisy & (MEMBERS in variable.dims),
            _series(late, variable, step),
        )
        if base is not None:
            values = values - _series(base, readers[1](name), step)
        values = values.reshape(-1, *values.shape[-2:])
        numbers, freedom = _over_time(values, name, differ)
        states = settlements(values, numbers["sem"], freedom, differ)
        result |= _described(
            variable.rename(name), numbers, sweep, states, openings, words, differ
        )
    return xr.Dataset(result, sweep.coords)


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
    sweep: xr.DataArray,
    states: Settlement,
    openings: list[str],
    span: str,
    noisy: Array,
) -> dict[str, xr.Variable]:
    """Return statistics of an observable over the sweep, with the reasons where there is no mean.

    ``numbers`` of each statistic have the points of the sweep first.
    """
    name, unit = str(variable.name), variable.attrs.get("units", "1")
    states = _of_two(states, noisy) if span == "the run" else states
    reasons = np.array(openings if is_of_contact(name) else [""] * sweep.size, object)
    is_open = reasons != ""
    for place in np.flatnonzero(~is_open & (states.verdict != "")).tolist():
        reasons[place] = states.at(place).reason(unit, span)
    ends = np.where(is_open, np.nan, states.value)
    numbers["mean"] = np.where((reasons != "") | ~noisy, ends, numbers["mean"])
    # without noise cycles differ, if anything
    halves = np.where(noisy, math.nan, states.half)
    for kind, sign in (("low", -1.0), ("high", 1.0)):
        numbers[kind] = np.where(
            np.isnan(halves), numbers[kind], numbers["mean"] + sign * halves
        )
    result: dict[str, xr.Variable] = {}
    for kind, values in numbers.items():
        if kind != "mean":
            values[reasons != ""] = np.nan
        # one nan for all points, because large sweeps often have no noise
        if np.isnan(values).all():
            values = np.broadcast_to(np.nan, values.shape)
        dims = (*sweep.dims, "quantile")[: sweep.ndim + values.ndim - 1]
        shaped = values.reshape(sweep.shape + values.shape[1:])
        result[f"{name}_{kind}"] = xr.Variable(
            dims, shaped, _attributes(kind, variable)
        )
    text = {
        "long_name": f"reason why there is no {_OF['mean']} of {variable.attrs.get('long_name', name)}"
    }
    result[f"{name}_reason"] = xr.Variable(
        sweep.dims, reasons.reshape(sweep.shape), text
    )
    return result


def _late(dataset: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the records of the second half of the run, and words for it."""
    first, _ = second_half(dataset.sizes["t"])
    return dataset.isel(t=slice(first, None)), "the second half" if first else "the run"


def of_second_half(
    dataset: xr.Dataset, names: Collection[str] | None = None
) -> xr.Dataset:
    """Return the ``distribution`` of observables; of recorded statistics the same means with errors and reasons.

    Of those the engine records the members' means over the second half of the run.
    """
    if "contact_radius" in dataset:
        return distribution(dataset, names)
    dataset = plain(dataset)
    (late, words), sweep = _late(dataset), dataset["contact_modulus"]
    points, members = sweep.size, int(dataset.attrs["members"])
    noisy, counts = (
        has_noise(dataset).to_numpy().ravel(),
        np.full((points, late.sizes["t"]), members),
    )
    if "in_contact_mean" in late:
        counts = np.rint(
            members * rows_of(late["in_contact_mean"], sweep).reshape(counts.shape)
        ).astype(int)
    reattach = (
        (word(dataset, "contact.after_pull_off", "stop") == "reattach")
        .broadcast_like(sweep)
        .to_numpy()
        .ravel()
    )
    again = np.where(reattach & (counts.min(axis=-1) < members), "some", "")
    openings = [
        _openings(count, members, may, words)
        for count, may in zip(counts, again, strict=True)
    ]
    courses = closed_observables(late, names)
    whole, later = (
        chosen_observables(_as_last(late, with_drift), names)
        for with_drift in (False, True)
    )
    result: dict[str, xr.Variable] = {}
    for key in (str(key) for key in courses if not str(key).endswith(("_std", "_sem"))):
        name, differ = key.removesuffix("_mean"), noisy & key.endswith("_mean")
        if not has_mean(name):
            continue
        ends = [key, f"{name}_sem" if key.endswith("_mean") else key]
        (mean, sem), (after, error) = (
            [rows_of(of[end], sweep).ravel() for end in ends] for of in (whole, later)
        )
        free = (counts if is_of_contact(name) else np.full_like(counts, members)) - 1.0
        sem = np.where(differ, sem, np.nan)
        low, high = interval(name, mean, sem, free[:, 0] + 1.0)
        course = rows_of(courses[key], sweep).reshape(points, -1)
        numbers = {"mean": mean, "sem": sem, "low": low, "high": high}
        states = _settled(
            course, after - mean, error, free[:, free.shape[1] // 2], differ
        )
        result |= _described(
            courses[key].rename(name), numbers, sweep, states, openings, words, differ
        )
    return xr.Dataset(result, sweep.coords)


def _as_last(late: xr.Dataset, with_drift: bool) -> xr.Dataset:
    """Return the last record with the recorded statistics of the members' means over the second half of the run.

    ``with_drift`` their drift is added to the means, with its standard error.
    """
    last, result = late.isel(t=[-1]), {}
    names = (
        str(key).removesuffix("_mean") for key in last if str(key).endswith("_mean")
    )
    for name in (name for name in names if f"late_{name}" in last):
        mean, error, drift, drift_error = (
            last[f"late_{name}"].isel(late=k, drop=True) for k in range(4)
        )
        if with_drift:
            mean, error = mean + drift, drift_error
        for kind, values in zip(KEPT, (mean, math.nan * error, error), strict=True):
            result[f"{name}_{kind}"] = values.expand_dims(t=last["t"], axis=-1)
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
