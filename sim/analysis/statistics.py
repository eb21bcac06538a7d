"""Statistics over the members of an ensemble, at each time and sweep value."""

import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from sim.analysis.correlation import correlation_time
from sim.analysis.events import events
from sim.analysis.observables import KEPT, observables, pure, reference_radii, share_observables
from sim.analysis.scene import MEMBERS, sweep_dims
from sim.units.notation import engineering
from sim.units.quantity import Quantity
from sim.units.refusals import renamed

QUANTILES = (0.05, 0.5, 0.95)

_OF = {"mean": "ensemble mean", "std": "standard deviation", "sem": "standard error of the ensemble mean"}

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
    ValueError
        If a key is not swept, or has no such value; the message lists those there are.
    """
    for key, value in chosen.items():
        dims = sweep_dims(dataset)
        full = key.replace(".", "_")
        fitting = [n for n in dims if n == full] or [n for n in dims if n.endswith(f"_{full}")]
        if not fitting and renamed(key):
            raise ValueError(f'{key} is now called "{renamed(key)}"')
        if len(fitting) != 1:
            raise ValueError(f"{key} is not swept; swept: {', '.join(dims) or 'nothing'}")
        name = fitting[0]
        swept = dataset[name]
        if swept.dtype.kind in "fi":
            unit = swept.attrs.get("units", "1")
            wanted = Quantity(unit, key).read(value)
            near = int(np.abs(swept.to_numpy() - wanted).argmin())
            there = abs(float(swept[near]) - wanted) <= _NEAR * abs(wanted)
            known = [engineering(float(f"{number:.4g}"), unit) for number in swept.to_numpy()]
        else:
            known = [str(text) for text in swept.to_numpy()]
            there, near = value in known, known.index(value) if value in known else 0
        if not there:
            raise ValueError(f"{key} has no value {value}; there are: {', '.join(known)}")
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
    """Mean, standard deviation, standard error and quantiles over the members.

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
        For each observable ``…_mean``, ``…_std``, ``…_sem`` and ``…_quantile`` (with the dimension
        ``quantile``: 5, 50, 95 %). The standard error and deviation of a single member are nan. A
        member that has no value (the indentation of an open contact) is left out.
    """
    found: dict[str, xr.DataArray] = {}
    for key, variable in trajectories.data_vars.items():
        name = str(key)
        if name.rpartition("_")[2] in KEPT:
            found[name] = variable
            continue
        for kind, values in _statistics_of(variable.astype(float), quantiles).items():
            text = f"{_OF.get(kind, 'quantiles')} of {variable.attrs.get('long_name', name)}"
            found[f"{name}_{kind}"] = values.assign_attrs(variable.attrs, long_name=text)
    return xr.Dataset(found)


def _statistics_of(variable: xr.DataArray, quantiles: bool) -> dict[str, xr.DataArray]:
    if MEMBERS not in variable.dims:
        none = xr.zeros_like(variable).where(variable.notnull())
        levels = {"quantile": variable.expand_dims(quantile=list(QUANTILES))} if quantiles else {}
        return {"mean": variable, "std": none, "sem": none} | levels
    values, axis = variable.to_numpy(), variable.get_axis_num(MEMBERS)
    count = np.sum(~np.isnan(values), axis, dtype=float)
    with warnings.catch_warnings():  # nan is the answer where no member has a value
        warnings.filterwarnings("ignore", "Mean of empty slice|All-NaN slice", RuntimeWarning)
        mean = np.nanmean(values, axis)
        if quantiles:
            levels = (np.nanquantile if np.any(count < values.shape[axis]) else np.quantile)(values, QUANTILES, axis)
    squares = np.nansum((values - np.expand_dims(mean, axis)) ** 2, axis)
    deviation = (squares / np.where(count > 1.0, count - 1.0, np.nan)) ** 0.5
    error = deviation / np.where(count > 0.0, count, np.nan) ** 0.5
    one = variable.isel({MEMBERS: 0}, drop=True)
    found = {name: one.copy(data=data) for name, data in (("mean", mean), ("std", deviation), ("sem", error))}
    if quantiles:
        found["quantile"] = one.expand_dims(quantile=list(QUANTILES)).copy(data=levels)
    return found


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
    return summary(observables(dataset)).merge(summary(events(dataset))).merge(correlation_time(dataset))


def shares(dataset: xr.Dataset) -> xr.Dataset:
    """Which share of the lost contact area comes from which mechanism.

    Returns
    -------
    xarray.Dataset
        Statistics (``…_mean``, ``…_std``, ``…_sem``, ``…_quantile``) over the members of
        ``lost_to_bonds`` and ``lost_to_fluctuations``, with ``contact.reversible`` above zero
        ``lost_to_mean_stress``, in a rate-dependent contact ``lost_to_lag``; and ``radius_jkr``, ``radius_hertz``
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
    return summary(share_observables(dataset)).merge(radii).assign(area_ratio_hertz=ratio)
