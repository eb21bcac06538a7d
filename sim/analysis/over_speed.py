"""Observables over the sliding speed, and the speeds at which sliding has taken the contact area, with their errors."""

import math
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.analysis.dataset import (
    MEMBERS,
    answered,
    in_pieces,
    is_stationary,
    is_steady,
    speed_name,
    speed_of,
    stays_held,
    sweep_dims,
    with_trajectories,
)
from sim.analysis.observables import labelled, observables, reference_radii
from sim.analysis.statistics import LEVEL, of_second_half, over_members

#: Shares of JKR's area whose loss has a speed [%].
LOSSES = (5, 50)
#: Observables whose curves over the speed are wanted, unless others are named.
_CURVES = ("contact_area", "friction_force", "shear_stress")
#: Groups of members that are left out in turn, and means of them, at most.
_GROUPS, _MOST_MEANS = 64, 2**22
_ENDS = {"": "", "_low": "lower end of the 95 % interval of the ", "_high": "upper end of the 95 % interval of the "}
#: Within how many standard errors of a level speeds are near it.
_NEAR = 4.0
_READ = {"contact_area", "jkr_radius", "hertz_radius"}


def speed_curves(dataset: xr.Dataset, *names: str) -> xr.Dataset:
    """Return observables over the sliding speed, of a ramp or a sweep of steady speeds: A(V), F(V), τ(V) by default.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    *names : str
        Such as ``"area_ratio"``; by default ``contact_area``, ``friction_force`` and ``shear_stress``.

    Returns
    -------
    xarray.Dataset
        Mean ``…_mean`` with ``…_sem``, ``…_low``, ``…_high``, ``…_std`` and more of each, over the dimension ``speed``
        [m/s] and those of other swept keys: of a ramp over the members (see ``summary``), of steady speeds over members
        and the second half of the run (see ``distribution``). Where other keys change the ramp, ``speed`` is a
        coordinate beside ``t``.

    Raises
    ------
    ValueError
        If the speed neither changes nor is swept.
    """
    wanted, along, speed = names or _CURVES, "t", speed_of(dataset)
    if not is_steady(dataset):
        curves = over_members(dataset, wanted)
    elif is_stationary(dataset) and (swept := speed_dim(dataset)) is not None:
        along, speed, curves = swept, speed.isel(t=0, drop=True), of_second_half(dataset, wanted)
    else:
        raise ValueError("the speed neither changes nor is swept while all else stays; curves over it need one of both")
    with answered():
        curves[[f"{name}_mean" for name in wanted]]
    prefixes = tuple(f"{name}_" for name in wanted)
    chosen = [name for name in curves if str(name).startswith(prefixes)]
    for name in set(speed.dims) - {along}:
        if bool((speed == speed.isel({name: 0})).all()):
            speed = speed.isel({name: 0}, drop=True)
    curves = curves[chosen].assign_coords(speed=speed)
    return curves.swap_dims({along: "speed"}) if speed.dims == (along,) else curves


class Crossing(NamedTuple):
    """A speed, and the ends of its 95 % interval; nan what is not known."""

    speed: float
    low: float
    high: float


def crossing(speeds: np.ndarray, groups: np.ndarray, sizes: np.ndarray, level: np.ndarray | float) -> Crossing:
    """Return the speed at which the mean of a falling quantity has first fallen to a level.

    Parameters
    ----------
    speeds : array, shape (speeds,)
        Rising, above 0.
    groups : array, shape (groups, speeds)
        Means over groups of members.
    sizes : array, shape (groups,)
        How many members each is of.
    level : float or array
        The level, of shape (speeds,) where it changes with the speed.

    Notes
    -----
    A straight line over the logarithm of the speed goes through the mean at the speeds about the first one below the
    level: the two about it, and the next ones as long as they are within four standard errors of the level. The
    interval is Student's, symmetric in the logarithm, with the error of the jackknife that leaves each group out of
    the whole curve: so noise that members have in common at different speeds counts as in common.
    """
    weights, has_error = sizes / sizes.sum(), len(groups) > 1
    mean = sum(weight * group for weight, group in zip(weights, groups, strict=True)) - level
    first = int(np.argmax(mean <= 0.0))
    if not mean[0] > 0.0 >= mean[first]:
        return Crossing(math.nan, math.nan, math.nan)
    error = float(groups[:, first].std(ddof=1)) / math.sqrt(len(groups)) if has_error else 0.0
    far = np.flatnonzero(np.abs(mean) > _NEAR * error)
    window = slice(max(far[far < first - 1], default=-1) + 1, min(far[far > first], default=len(mean)))
    x, mean = np.log(speeds[window]), mean[window]
    at = float(_zero(x, mean))
    if not has_error:
        return Crossing(math.exp(at), math.nan, math.nan)
    weight, free = weights[:, None], len(groups) - 1.0
    above = groups[:, window] - np.broadcast_to(level, speeds.shape)[window]
    without = _zero(x, (mean - weight * above) / (1.0 - weight))
    half = special.stdtrit(free, 0.5 + 0.5 * LEVEL) * math.sqrt(free * float(np.var(without)))
    return Crossing(*map(math.exp, (at, at - half, at + half)))


def _zero(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the zeros of straight lines through the values along the last axis."""
    aside = x - x.mean()
    return x.mean() - y.mean(axis=-1) * np.sum(aside**2) / np.sum(aside * y, axis=-1)


def speed_dim(dataset: xr.Dataset) -> str | None:
    """Return the sweep's dimension along which the speed changes."""
    speed = speed_of(dataset).isel(t=0)
    varying = (n for n in sweep_dims(dataset) if n in speed.dims and bool((speed != speed.isel({n: 0})).any()))
    return next(varying, None)


def loss_speeds(dataset: xr.Dataset) -> xr.Dataset:
    """Return the speeds at which the mean area has lost 5 and 50 % of JKR's, and half of the way to Hertz's.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it: a ramp of the speed, or a sweep of steady speeds, then of means over the second half
        of the run.

    Returns
    -------
    xarray.Dataset
        ``speed_at_5_percent_lost``, ``speed_at_50_percent_lost``, ``speed_halfway_to_hertz`` [m/s] with ``…_low`` and
        ``…_high`` (see ``crossing``), for each point of the sweep of other keys; nan where the area
        does not get there, or is there from the lowest speed on. Empty where speeds neither rise nor are swept, what
        holds the sphere changes, or the speed, the area or its references were not recorded.
    """
    if speed_name(dataset) not in dataset or not dataset.keys() >= _READ:
        return xr.Dataset()
    speed = speed_of(dataset)
    along = str(speed_dim(dataset)) if is_steady(dataset) else "t"
    speed = speed if along == "t" else speed.isel(t=0, drop=True)
    known = along in speed.dims and bool((speed.diff(along) > 0.0).all()) and bool(stays_held(dataset).all())
    if not known or bool((speed <= 0.0).any()):
        return xr.Dataset()
    radii = reference_radii(dataset)
    hertz = (radii["radius_hertz"] / radii["radius_jkr"]) ** 2
    levels = [(f"speed_at_{k}_percent_lost", 1.0 - 0.01 * k + 0.0 * hertz, f"{k} % of JKR's") for k in LOSSES]
    levels.append(("speed_halfway_to_hertz", 0.5 * (1.0 + hertz), "half of what it can, down to Hertz's"))
    groups, sizes = _group_means(dataset, along)
    dims, result = [[along], ["group", along], ["group"], [along]], {}
    for name, level, loss in levels:
        inputs = speed, groups, sizes, level + 0.0 * speed
        crossings = xr.apply_ufunc(crossing, *inputs, input_core_dims=dims, output_core_dims=[[]] * 3, vectorize=True)
        for (end, text), speeds in zip(_ENDS.items(), crossings, strict=True):
            text = f"{text}sliding speed at which the mean contact area has lost {loss}"
            result[name + end] = labelled(speeds, "m/s", text)
    return xr.Dataset(result)


def _group_means(dataset: xr.Dataset, along: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Return means of A/A_JKR over groups of members and, at steady speeds, the second half; and sizes of groups."""
    areas, outer = with_trajectories(dataset, *_READ), (*sweep_dims(dataset), *(["t"] if along == "t" else []))
    members = dataset.sizes.get(MEMBERS, 1)
    count = min(members, _GROUPS, max(2, _MOST_MEANS // math.prod(dataset.sizes[name] for name in outer)))

    def ratios(piece: xr.Dataset) -> xr.Dataset:
        ratio = observables(piece)[["area_ratio"]]
        return ratio if along == "t" else ratio.mean("t")

    def means(ratio: xr.Dataset) -> xr.Dataset:
        ratio = ratio if MEMBERS in ratio.dims else ratio.expand_dims(MEMBERS)
        groups = [ratio.isel({MEMBERS: slice(first, None, count)}).mean(MEMBERS) for first in range(count)]
        return xr.concat(groups, "group", coords="minimal", compat="override")

    if along == "t":
        result = in_pieces(areas, ("t",), lambda piece: means(ratios(piece)))
    else:
        late = areas.isel(t=slice(dataset.sizes["t"] // 2, None))
        result = means(in_pieces(late, (*outer, MEMBERS), ratios))
    sizes = np.bincount(np.arange(members) % count).astype(float)
    return result["area_ratio"].transpose("group", *outer), xr.DataArray(sizes, dims="group")
