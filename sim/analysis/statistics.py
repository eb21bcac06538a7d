"""Statistics over the members of an ensemble, at each time and sweep value."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.correlation import correlation_time
from sim.analysis.events import events
from sim.analysis.observables import (
    KEPT,
    charges,
    chosen_observables,
    observables,
    pure,
    reference_radii,
    restricted,
    share_observables,
)
from sim.analysis.scene import MEMBERS, in_pieces, sweep_dims
from sim.units.errors import BadInput
from sim.units.notation import engineering
from sim.units.quantity import read_option

QUANTILES = (0.05, 0.5, 0.95)

#: Share of repeated ensembles whose intervals hold the truth, and half of such an interval of a normal law in errors.
LEVEL = 0.95
WIDE = float(special.ndtri(0.5 + 0.5 * LEVEL))

#: A spread below this share of the mean is of rounding.
_ROUNDING = 1e-12

#: Observables that are 0 or 1 in each member: the interval of their mean is that of a share.
_COUNTED = ("fraction_detached", "fraction_masked", "ever_detached")

_OF = {
    "mean": "ensemble mean",
    "std": "standard deviation",
    "sem": "standard error of the ensemble mean",
    "low": "lower end of the 95 % interval of the ensemble mean",
    "high": "upper end of the 95 % interval of the ensemble mean",
    "skewness": "skewness",
    "effective_samples": "number of independent values that tell as much of the mean",
    "correlation_time": "integral correlation time",
    "correlation_time_sem": "standard error of the integral correlation time",
    "quantile": "quantiles",
    "quantile_low": "lower end of the 95 % intervals of the quantiles",
    "quantile_high": "upper end of the 95 % intervals of the quantiles",
}

#: Units of statistics that are not in that of their observable.
_UNITS = {"skewness": "1", "effective_samples": "1", "correlation_time": "s", "correlation_time_sem": "s"}

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
        fitting = [n for n in dims if n == full] or [n for n in dims if n.endswith(f"_{full}")]
        if len(fitting) != 1:
            raise BadInput([f"{key} is not swept; swept: {', '.join(dims) or 'nothing'}"])
        name = fitting[0]
        swept = dataset[name]
        if swept.dtype.kind in "fi":
            unit = swept.attrs.get("units", "1")
            wanted = read_option(value, key, unit)
            near = int(np.abs(swept.to_numpy() - wanted).argmin())
            there = abs(float(swept[near]) - wanted) <= _NEAR * abs(wanted)
            known = [engineering(float(f"{number:.4g}"), unit) for number in swept.to_numpy()]
        else:
            known = [str(text) for text in swept.to_numpy()]
            there, near = value in known, known.index(value) if value in known else 0
        if not there:
            raise BadInput([f"{key} has no value {value}; there are: {', '.join(known)}"])
        dataset = dataset.isel({name: [near]})
    return dataset


def averaging(dataset: xr.Dataset, late: bool) -> str:
    """What a mean is over, in words: the second half of the run where it is of that, and the members that differ."""
    over = ["second half of the run"] if late and dataset.sizes["t"] > 2 else []
    members = dataset.sizes.get(MEMBERS, dataset.attrs.get("members", 1))
    differ = MEMBERS in dataset.sizes or any(str(name).endswith("_sem") for name in dataset.data_vars)
    over += [f"{members} members"] if differ and members > 1 else []
    return f"mean over the {' and '.join(over)}" if over else ""


def summary(trajectories: xr.Dataset, quantiles: bool = True) -> xr.Dataset:
    """Mean, spread, quantiles and skewness over the members, each mean and quantile with its error.

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
        ``…_low`` and ``…_high`` (95 % interval of the mean), ``…_skewness``, and ``…_quantile``, ``…_quantile_low``,
        ``…_quantile_high`` (with the dimension ``quantile``: 5, 50, 95 %). The errors of a single member are nan. A
        member that has no value (the indentation of an open contact) is left out.

    Notes
    -----
    The interval of a mean is Student's, that of a share of the members Wilson's (J. Am. Stat. Assoc. 22 (1927) 209).
    That of a quantile lies between order statistics, with linear interpolation, and holds for any law; where so few
    members have none (a 5 % quantile of less than 59), it is nan. The skewness is corrected for the number of members;
    of n members of a normal law it has the standard error ``skewness_error(n)``.
    """
    found: dict[str, xr.DataArray] = {}
    members = float(trajectories.attrs.get("members", 1))
    for key, variable in trajectories.data_vars.items():
        name = str(key)
        stem, _, kind = name.rpartition("_")
        if kind in KEPT:
            found[name] = variable
            if kind == "mean" and f"{stem}_sem" in trajectories:
                ends = interval(stem, variable.to_numpy(), trajectories[f"{stem}_sem"].to_numpy(), members)
                for end, at in zip(("low", "high"), ends, strict=True):
                    text = f"{_OF[end]} of {variable.attrs.get('long_name', stem).removeprefix(_OF['mean'] + ' of ')}"
                    found[f"{stem}_{end}"] = variable.copy(data=at).assign_attrs(long_name=text)
            continue
        for kind, values in _statistics_of(variable.astype(float), quantiles).items():
            found[f"{name}_{kind}"] = values.assign_attrs(described(kind, variable))
    return xr.Dataset(found)


def described(kind: str, variable: xr.DataArray) -> dict[str, Any]:
    """Attributes of a statistic of an observable."""
    other = {"units": _UNITS[kind], "symbol": ""} if kind in _UNITS else {}
    return variable.attrs | other | {"long_name": f"{_OF[kind]} of {variable.attrs.get('long_name', variable.name)}"}


def _statistics_of(variable: xr.DataArray, quantiles: bool) -> dict[str, xr.DataArray]:
    if MEMBERS not in variable.dims:
        none = xr.zeros_like(variable).where(variable.notnull())
        levels = variable.expand_dims(quantile=list(QUANTILES))
        ends = ("quantile", "quantile_low", "quantile_high") if quantiles else ()
        alike = {"mean": variable, "std": none, "sem": none, "low": variable, "high": variable}
        return alike | {"skewness": xr.full_like(none, np.nan)} | dict.fromkeys(ends, levels)
    values = np.moveaxis(variable.to_numpy(), variable.get_axis_num(MEMBERS), -1).copy()
    if quantiles:
        values.sort()  # nan last
    count = np.sum(~np.isnan(values), axis=-1, dtype=float)
    one = variable.isel({MEMBERS: 0}, drop=True)
    found = {kind: one.copy(data=data) for kind, data in _moments(str(variable.name), values, count).items()}
    if quantiles:
        for kind, data in _quantiles(values, count).items():
            found[kind] = one.expand_dims(quantile=list(QUANTILES)).copy(data=data)
    return found


def _moments(name: str, values: np.ndarray, count: np.ndarray) -> dict[str, np.ndarray]:
    """Statistics over the last axis, of ``count`` numbers each, that need no order."""
    with np.errstate(invalid="ignore", divide="ignore"):  # nan is the answer where there are too few
        mean = np.nansum(values, axis=-1) / count
        deviations = values - mean[..., None]
        each = deviations * deviations
        squares = np.nansum(each, axis=-1)
        std = np.sqrt(squares / np.where(count > 1.0, count - 1.0, np.nan))
        error = std / np.sqrt(count)
        each *= deviations
        third = np.nansum(each, axis=-1) / count
        biased = np.where(std > _ROUNDING * abs(mean), third / (squares / count) ** 1.5, np.nan)
        skewness = np.where(count > 2.0, biased * np.sqrt(count * (count - 1.0)) / (count - 2.0), np.nan)
    low, high = interval(name, mean, error, count)
    return {"mean": mean, "std": std, "sem": error, "low": low, "high": high, "skewness": skewness}


def interval(name: str, mean: np.ndarray, sem: np.ndarray, count: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of the 95 % interval of the mean of an observable over ``count`` members; nan for a single one."""
    count = np.asarray(count, float)
    if name not in _COUNTED:
        half = special.stdtrit(np.where(count > 1.0, count - 1.0, np.nan), 0.5 + 0.5 * LEVEL) * sem
        return mean - half, mean + half
    with np.errstate(invalid="ignore", divide="ignore"):  # time averages of the members count for more than one each
        several = np.where(sem > 0.0, mean * (1.0 - mean) / sem**2, 0.0)
    count = np.where(count > 1.0, np.maximum(count, several), np.nan)
    shrunk = 1.0 + WIDE**2 / count
    middle = (mean + 0.5 * WIDE**2 / count) / shrunk
    half = WIDE / shrunk * np.sqrt(np.maximum(mean * (1.0 - mean), 0.0) / count + (0.5 * WIDE / count) ** 2)
    return middle - half, middle + half


def skewness_error(count: float) -> float:
    """Standard error of the skewness of ``count`` numbers that follow a normal law, beyond which it tells something."""
    n = count
    return float(np.sqrt(6.0 * n * (n - 1.0) / ((n - 2.0) * (n + 1.0) * (n + 3.0)))) if n > 2.0 else np.nan


def _quantiles(ordered: np.ndarray, count: np.ndarray) -> dict[str, np.ndarray]:
    """Quantiles over the last axis, whose first ``count`` numbers are in order, and both ends of their intervals."""
    levels = np.array(QUANTILES)
    counts, of = np.unique(count, return_inverse=True)
    places = {"quantile": levels * (counts[:, None] - 1.0)}
    places["quantile_low"], places["quantile_high"] = quantile_ranks(counts[:, None], levels)
    return {
        kind: np.moveaxis(values_at_ranks(ordered, place[of.reshape(count.shape)]), -1, 0)
        for kind, place in places.items()
    }


def quantile_ranks(count: np.ndarray, level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places, from 0 on and between, in ``count`` ordered numbers, that a quantile of their law lies between.

    The number of them below the quantile is binomial. Where one tail of it cannot be as small as half of what may be
    left out, the other takes the rest; nan where there is no such interval.

    >>> low, high = quantile_ranks(np.array([64.0]), np.array([0.5]))
    >>> print(f"{low[0]:.2f} {high[0]:.2f}")
    23.69 39.31
    """
    left = 1.0 - LEVEL
    lowest, highest = (1.0 - level) ** count, level**count  # chances of all numbers above the quantile, and below
    below = np.where(highest > 0.5 * left, left - highest, np.maximum(lowest, 0.5 * left))
    above = np.where(lowest > 0.5 * left, left - lowest, np.maximum(highest, 0.5 * left))
    with np.errstate(invalid="ignore"):
        low = np.where(below > lowest, special.bdtrik(below, count, level), 0.0)
        high = np.where(above > highest, special.bdtrik(1.0 - above, count, level), count - 1.0)
    none = (below < lowest) | (above < highest)
    return np.where(none, np.nan, low), np.where(none, np.nan, high)


def values_at_ranks(ordered: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Values at places along the last axis, from 0 on and between; nan where a place is."""
    known = places >= 0.0
    below = np.where(known, places, 0.0).astype(np.intp)
    above = np.minimum(below + 1, ordered.shape[-1] - 1)
    share = places - below
    low, high = (np.take_along_axis(ordered, at, axis=-1) for at in (below, above))
    return np.where(share > 0.0, low + share * (high - low), np.where(known, low, np.nan))


def statistics(dataset: xr.Dataset) -> xr.Dataset:
    """Statistics over the members of everything recorded, at each sweep value and time.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member or with statistics only.

    Returns
    -------
    xarray.Dataset
        ``…_mean``, ``…_std``, ``…_sem`` and ``…_quantile`` of every trajectory (see ``summary``), the
        same of ``area_ratio`` (A/A_JKR), ``fraction_detached`` and ``fraction_masked`` (the latter is
        known of statistics alone only while all contacts are closed), of what a whole run has once (see
        ``sim.analysis.events.events``), and ``correlation_time`` with its standard error. A member whose trajectory
        has stopped is left out from there on; ``fraction_detached`` counts it.
    """
    found = over_members(dataset)
    return found.merge(summary(events(dataset).assign_attrs(dataset.attrs))).merge(correlation_time(dataset))


def over_members(dataset: xr.Dataset, names: Collection[str] | None = None, quantiles: bool = True) -> xr.Dataset:
    """Return the ``summary`` of observables at each sweep value and time, by default of all except shares."""

    def reduce(piece: xr.Dataset) -> xr.Dataset:
        return summary(observables(piece) if names is None else chosen_observables(piece, names), quantiles)

    return in_pieces(restricted(dataset, names), ("t",), reduce)


def shares(dataset: xr.Dataset) -> xr.Dataset:
    """Which share of the lost contact area comes from which mechanism.

    Returns
    -------
    xarray.Dataset
        Statistics (``…_mean``, ``…_std``, ``…_sem``, ``…_quantile``) over the members of
        ``lost_to_bonds`` and ``lost_to_fluctuations``, with ``contact.reversible`` above zero
        ``lost_to_mean_stress``, in a rate-dependent contact ``lost_to_lag``; of the other order of charging, see
        ``sim.analysis.observables.charged_in_turn``; and ``radius_jkr``, ``radius_hertz``
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
    ratio = pure((radii["radius_hertz"] / radii["radius_jkr"]) ** 2, "Hertz's contact area over JKR's")
    share_observables(dataset.isel(t=[0]))  # where they are not known it says why
    lost = in_pieces(restricted(dataset, ["lost_to_bonds"]), ("t",), lambda piece: summary(charges(piece)))
    return lost.merge(radii).assign(area_ratio_hertz=ratio)
