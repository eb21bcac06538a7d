"""Variables per member and time: those recorded, and those that follow from them.

The reference of every ratio and share is JKR's contact with the full work of adhesion, held as the
recorded contact is at that time.
"""

import contextlib
import itertools
import math
from collections.abc import Collection
from typing import Any

import numpy as np
import xarray as xr

from sim.laws import cohesive, equilibrium, jkr
from sim.quantities import OF_CONTACT, QUANTITIES
from sim.read.control_variate import sources
from sim.read.dataset import (
    MEMBERS,
    STATISTIC,
    all_go_on,
    control,
    ensemble_mean,
    only_statistics,
    plain,
    recorded_share,
    setting,
    stays_held,
    where_recorded,
    with_trajectories,
    word,
)

#: Shares of the area after that lost to bonds, in the order of charging, and the radius before each.
_LOSSES = {
    "lost_to_fluctuations": "bonds_radius",
    "lost_to_mean_stress": "fluctuations_radius",
    "lost_to_lag": "equilibrium_radius",
}
#: Radii that others are compared with.
_REFERENCES = ("jkr_radius", "hertz_radius")
#: So few closed contacts give no mean if others are open.
FEW_LEFT = 2
#: Trajectories from which observables of other names follow; those of shares, beside the radii of their losses.
_SOURCES = {
    "normal_load": ("normal_load", "applied_load"),
    "area_ratio": ("contact_area",),
    "fraction_detached": ("in_contact", "slider_position"),
    "fraction_masked": ("masked", "in_contact", "slider_position"),
}
#: What else only a closed contact has.
_OF_AREA = ("area_ratio", "lost_to", "order_of", "indentation", "fraction_masked")
_SOURCES_OF_SHARES = (
    "contact_area",
    "fluctuation_energy",
    "applied_load",
    "indentation",
    "displacement",
)


def ordered(variable: xr.DataArray) -> xr.DataArray:
    """Return a variable with members and time as its last dimensions."""
    return variable.transpose(..., MEMBERS, "t", missing_dims="ignore")


def labelled(
    values: xr.DataArray, unit: str, text: str, symbol: str = ""
) -> xr.DataArray:
    """Return values with members and time last, with their unit and meaning."""
    return ordered(values).assign_attrs(units=unit, long_name=text, symbol=symbol)


def defined(name: str, values: xr.DataArray) -> xr.DataArray:
    """Return values of a quantity with members and time last, with its unit and meaning in the registry."""
    row = QUANTITIES[name]
    return labelled(values, row.unit, row.meaning, row.symbol)


def pure(values: xr.DataArray, text: str, symbol: str = "") -> xr.DataArray:
    """Return pure numbers with their meaning."""
    return labelled(values, "1", text, symbol)


def reference_radii(dataset: xr.Dataset) -> xr.Dataset:
    """Return the radii of the contacts with the full work of adhesion and with none, under the same control.

    Returns
    -------
    xarray.Dataset
        ``radius_jkr`` and ``radius_hertz`` [m], without the dimension ``t`` where what holds the sphere stays at all
        points of the sweep. The former is nan where that contact is open, the latter 0.
    """
    radii = plain(dataset)[[*_REFERENCES]].rename(
        jkr_radius="radius_jkr", hertz_radius="radius_hertz"
    )
    if bool(stays_held(dataset).all()):
        radii = radii.isel(t=0, drop=True)
    radii = radii.astype(float, copy=False).map(ordered)
    return radii.assign(radius_jkr=radii["radius_jkr"].where(radii["radius_jkr"] > 0.0))


def is_of_contact(name: str) -> bool:
    """Return True for an observable that only a closed contact has."""
    return name.startswith((*OF_CONTACT, *_OF_AREA))


def with_mean(statistics: xr.DataArray, value: xr.DataArray) -> xr.DataArray:
    """Return statistics over the members with another mean; a variable of another kind is replaced."""
    if STATISTIC not in statistics.dims:
        return value
    is_mean = xr.DataArray(np.arange(statistics.sizes[STATISTIC]) == 0, dims=STATISTIC)
    return xr.where(is_mean, value, statistics).transpose(*statistics.dims, ...)


def closed_only(dataset: xr.Dataset) -> xr.Dataset:
    """Return radius, area and friction of closed contacts alone: nan while a contact is open.

    Of recorded statistics those of the closed members follow from those of all, as an open contact adds zeros.
    They are nan if some contacts are open and at most two are closed.
    """
    names = [name for name in OF_CONTACT if name in dataset]
    if "in_contact" not in dataset or not names:
        return dataset
    closed = dataset["in_contact"]
    if not only_statistics(dataset):
        is_closed = closed > 0.0
        if MEMBERS in closed.dims:
            count = is_closed.sum(MEMBERS)
            is_enough = (count > FEW_LEFT) | (count == closed.sizes[MEMBERS])
            is_closed = is_closed & is_enough
        chosen = {
            name: dataset[name].astype(float, copy=False).where(is_closed)
            for name in names
        }
        return dataset.assign(chosen)
    members, share = float(dataset.attrs["members"]), ensemble_mean(closed)
    if bool((share == 1.0).all()):
        return dataset
    stops = word(dataset, "contact.after_pull_off", "stop") == "stop"
    count = (members * share).round()
    recorded = count.where(stops, members)
    is_known = (count > FEW_LEFT) | (count == members)
    result = {}
    for name in (name for name in names if STATISTIC in dataset[name].dims):
        average, spread, _ = dataset[name]
        squares = (recorded - 1.0) * spread**2 + recorded * average**2
        average = (average * recorded / count).where(is_known)
        spread = ((squares - count * average**2) / (count - 1.0)).clip(0.0) ** 0.5
        moments = [average, spread, spread / count**0.5]
        changed = xr.concat(moments, dataset[STATISTIC], coords="minimal")
        changed = changed.transpose(*dataset[name].dims)
        result[name] = changed.assign_attrs(dataset[name].attrs)
    return dataset.assign(result)


def too_few_closed(dataset: xr.Dataset) -> xr.DataArray | None:
    """Return why closed contacts have no mean, where one or two of several are left; "" elsewhere, None without any."""
    if "in_contact" not in dataset:
        return None
    closed = dataset["in_contact"]
    if only_statistics(dataset):
        members = int(dataset.attrs["members"])
        count = (members * ensemble_mean(closed)).round()
    elif MEMBERS in closed.dims:
        members, count = closed.sizes[MEMBERS], (closed > 0.0).sum(MEMBERS)
    else:
        return None
    reason = xr.full_like(count, "", object)
    for left in range(1, min(FEW_LEFT + 1, members)):
        words = f"{left} of {members} contacts {'is' if left == 1 else 'are'} closed, too few for a mean"
        reason = xr.where(count == left, words, reason)
    return reason


def is_open_throughout(dataset: xr.Dataset) -> xr.DataArray:
    """Return True at each point of the sweep at which no contact of any member is closed at any time of the run."""
    dataset = plain(dataset)
    result = xr.zeros_like(dataset["contact_modulus"], bool)
    if "in_contact" not in dataset:
        return result

    def is_open(flags: xr.DataArray) -> xr.DataArray:
        closed = ensemble_mean(flags) > 0.0
        return ~closed.any([name for name in closed.dims if name not in result.dims])

    closed = dataset["in_contact"]
    result = result | is_open(closed.isel(t=0))
    # most contacts are closed at the start, and all records take time to read
    if not bool(result.any()):
        return result
    result = result & is_open(closed)
    for name in ("first_closing", "first_closing_count"):
        if name in dataset:
            times = ensemble_mean(dataset[name])
            counts = times.notnull() if name == "first_closing" else times
            result = result & is_open(counts)
    return result


def with_slips(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset in which the speed of a driven slider on single bonds is its displacement over the time.

    Such a slider slips without duration as bonds break, which its recorded speed leaves out.
    """
    needed = {"spring_force", "slider_position", "speed"}
    is_driven = needed <= {*dataset} and "bonds_sites" in dataset.variables
    if not is_driven or dataset.sizes["t"] < 2:
        return dataset
    position, recorded = ensemble_mean(dataset["slider_position"]), dataset["speed"]
    position = position.astype(float)
    # at the end of a motion there is no later position
    backward = position.diff("t") / dataset["t"].diff("t")
    moved = position.differentiate("t").fillna(backward)
    later = dataset["t"] > dataset["t"][0]  # at the start nothing has moved yet
    speed = moved.where(later, ensemble_mean(recorded))
    if STATISTIC in recorded.dims:
        # a mean position has a speed as long as it is that of the same members, whose spread is not known
        going = all_go_on(dataset)
        speed = speed if going is None else speed.where(going)
        is_mean = xr.DataArray(
            np.arange(recorded.sizes[STATISTIC]) == 0, dims=STATISTIC
        )
        speed = speed.where(is_mean).transpose(*recorded.dims)
    return dataset.assign(speed=speed.assign_attrs(recorded.attrs))


def share_of_members(dataset: xr.Dataset, event: str, name: str) -> xr.DataArray | None:
    """Return the statistics of a quantity that is 1 in members that have had an event and 0 in the others.

    They follow from the recorded share of these members (``recorded_share``), without which they are None.
    """
    share = recorded_share(dataset, event)
    if share is None:
        return None
    members = float(dataset.attrs["members"])
    others = members - 1.0 if members > 1.0 else math.nan
    spread = (share * (1.0 - share) * members / others) ** 0.5
    moments = [share, spread, spread / members**0.5]
    how: Any = {"coords": "minimal", "compat": "override"}
    return defined(name, xr.concat(moments, dataset[STATISTIC], **how))


def full_area(dataset: xr.Dataset) -> xr.DataArray:
    """Return JKR's area at the full work of adhesion [m^2]; nan if that contact is open."""
    return np.pi * reference_radii(dataset)["radius_jkr"] ** 2


def bond_work(dataset: xr.Dataset) -> xr.DataArray:
    """Return the work of adhesion that the bonds left would give without fluctuations: Δγ(fraction) [J/m^2].

    ``work (1 - share + share * fraction)``, per member where the bonds differ between members, and
    of the mean fraction where only that was recorded.
    """
    dataset = plain(dataset)
    share = setting(dataset, "adhesion.bond_share")
    fraction = ensemble_mean(dataset["bond_fraction"])
    left = setting(dataset, "adhesion.work") * (1.0 - share + share * fraction)
    return labelled(left, "J/m^2", "work of adhesion of the intact bonds", "Δγ")


def share_observables(dataset: xr.Dataset) -> xr.Dataset:
    """Return the shares of JKR's area that each mechanism takes, per member and time.

    Returns
    -------
    xarray.Dataset
        ``lost_to_bonds`` and ``lost_to_fluctuations``; with ``contact.reversible`` above zero also
        ``lost_to_mean_stress``, and with a rate-dependent contact ``lost_to_lag``. With ``area_ratio`` they
        add up to one. What members have in common has no dimension ``member``.

    Raises
    ------
    ValueError
        If the members differ in what a share needs but only their mean was recorded.

    Notes
    -----
    The mechanisms are subtracted in this order, each by the equilibrium area that the work of adhesion left
    after it would give: ``bonds_radius``, ``fluctuations_radius``, ``equilibrium_radius`` and ``contact_radius``,
    as recorded.
    """
    dataset = plain(dataset)
    full = full_area(dataset)
    area = dataset["contact_area"].astype(float, copy=False)
    charged = {name: radius for name, radius in _LOSSES.items() if radius in dataset}
    radii = [dataset[radius] for radius in charged.values()]
    if any(STATISTIC in radius.dims for radius in radii):
        raise ValueError(
            "shares need every member; record them: [record] per_member = true"
        )
    is_known = ensemble_mean(area).notnull()
    left = [
        (np.pi * radius.astype(float, copy=False) ** 2).where(is_known)
        for radius in radii
    ]
    names = ("lost_to_bonds", *charged)
    levels = [full, *left, ensemble_mean(area)]
    shares = {}
    for name, (before, after) in zip(names, itertools.pairwise(levels), strict=False):
        share = (before - after) / full
        # the spread is the area's; the bonds are the same for all members
        if name != "lost_to_bonds":
            share = with_mean(area / full, share)
        shares[name] = defined(name, share)
    return xr.Dataset(shares, attrs=dataset.attrs)


def thickness_of(dataset: xr.Dataset) -> xr.DataArray:
    """Return the thickness of the layer [m], inf of a half-space, and ``CIRCLE`` under the profile of a circle."""
    thickness = dataset.get("solid_thickness", xr.DataArray(math.inf))
    is_circle = word(dataset, "sphere.profile", "parabola") == "circle"
    return xr.where(is_circle, equilibrium.CIRCLE, thickness)


def radius_at_work(dataset: xr.Dataset, work: xr.DataArray) -> xr.DataArray:
    """Return the radius of a contact with a work of adhesion [J/m^2], held as the sphere is [m]; nan if it is open.

    Raises
    ------
    KeyError
        If the dataset does not hold a number that is needed.
    """
    held, sphere = (
        control(dataset),
        (work, setting(dataset, "sphere.radius"), dataset["contact_modulus"]),
    )
    thickness, load = thickness_of(dataset), xr.DataArray(0.0)
    if held.kind == "load":
        name = "applied_load" if "applied_load" in dataset else "contact_load"
        load = dataset[name]
    # an indentation is a displacement behind an infinite stiffness
    base = xr.DataArray(0.0) if held.kind == "load" else dataset[held.kind]
    spring = xr.DataArray(0.0) if held.kind == "load" else held.stiffness
    if not np.all(np.isinf(thickness)):
        on_layer = load, base, spring, *sphere, thickness
        return xr.apply_ufunc(equilibrium.radius_on_layer, *on_layer)
    if held.kind == "load":
        radius = xr.apply_ufunc(jkr.radius_at_load, load, *sphere)
    else:
        radius = xr.apply_ufunc(jkr.radius_at_displacement, base, spring, *sphere)
    has_range = word(dataset, "contact.model", "equilibrium") == "cohesive"
    if not bool(has_range.any()):
        return radius
    if "contact_range" in dataset:
        distance = setting(dataset, "contact.range")
        stress = xr.apply_ufunc(cohesive.stress_of_range, work, distance)
    else:
        stress = setting(dataset, "contact.cohesive_stress")
    attracted = xr.apply_ufunc(
        lambda *numbers: cohesive.equilibrium(*numbers).inner,
        load,
        base,
        spring,
        work,
        stress,
        *sphere[1:],
    )
    return xr.where(has_range, attracted, radius)


def _charged_first(dataset: xr.Dataset) -> xr.DataArray:
    """Return the share that fluctuations take if they are subtracted first; see ``charges``.

    Raises
    ------
    ValueError
        If members were not recorded, or the contact is on a disc of finite radius.
    """
    is_on_a_plane = (word(dataset, "shear.contact", "plane") == "plane").all()
    is_recorded = "fluctuation_energy" in dataset and not only_statistics(dataset)
    if not is_recorded or not bool(is_on_a_plane):
        raise ValueError(
            "the other order of losses needs the fluctuation energy of each member, on a plane"
        )
    energy = dataset["fluctuation_energy"].astype(float, copy=False)
    try:
        work = (
            setting(dataset, "adhesion.work")
            - setting(dataset, "shear.paid_by_adhesion") * energy
        )
        radius = radius_at_work(dataset, work)
    except KeyError as fault:
        raise ValueError(
            f"the other order of losses is not known: {fault.args[0]}"
        ) from None
    full, alone = full_area(dataset), np.pi * radius.fillna(0.0) ** 2
    alone = alone.where(dataset["contact_area"].notnull())
    return (full - alone) / full


def observables(
    dataset: xr.Dataset, names: Collection[str] | None = None
) -> xr.Dataset:
    """Return every recorded trajectory, per member if members differ, and those of ``names`` that follow from them.

    ``area_ratio`` is A/A_JKR, with the JKR area for the same mount at that time. ``fraction_detached`` is 1 if the
    contact is open. ``fraction_masked`` is 1 if a closed contact has no effective work of adhesion (a Hertz contact),
    and nan if it is open. Their ensemble means are the fractions. Both are nan once the motion of the slider has ended
    in contact, although the flag ``in_contact`` stays.
    """
    dataset = plain(dataset)
    result = dataset.drop_vars(
        [n for n, v in dataset.data_vars.items() if "t" not in v.dims]
    )

    def is_wanted(name: str, *sources: str) -> bool:
        return (names is None or name in names) and {*sources} <= {*result}

    if is_wanted("area_ratio", "contact_area", *_REFERENCES):
        area = result["contact_area"].astype(float, copy=False)
        result["area_ratio"] = defined("area_ratio", area / full_area(dataset))
    moves = ensemble_mean(dataset.get("slider_position", xr.DataArray(0.0))).notnull()
    if is_wanted("fraction_detached", "in_contact"):
        closed = result["in_contact"].astype(float, copy=False)
        opened = with_mean(closed, 1.0 - ensemble_mean(closed))
        opened = opened.where(moves | (ensemble_mean(closed) == 0.0))
        result["fraction_detached"] = defined("fraction_detached", opened)
    if is_wanted("fraction_masked", "masked"):
        masked = dataset["masked"].astype(float, copy=False)
        # an open contact of a file of version 1 has the flag 0
        if "in_contact" in dataset:
            masked = masked.where(ensemble_mean(dataset["in_contact"]) > 0.0)
        result["fraction_masked"] = defined("fraction_masked", masked.where(moves))
    return result.drop_vars(["in_contact", "masked"], errors="ignore")


def charges(dataset: xr.Dataset) -> xr.Dataset:
    """Return the shares of the lost area in both orders of subtraction, as far as they are known.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        The ``share_observables``; ``lost_to_fluctuations_first`` and ``lost_to_bonds_last``, which add up to
        ``lost_to_bonds`` and ``lost_to_fluctuations``; and ``order_of_charging``, the share by which the fluctuations
        take more if they are subtracted first. Both orders are of one member and share its noise, so the error of their
        difference is that of the members' differences.

    Notes
    -----
    Fluctuations alone leave w = Δγ(1) - χ ΔΓ. Where no equilibrium with that exists, the area is 0.
    """
    shares = xr.Dataset()
    with contextlib.suppress(ValueError), where_recorded():
        shares = share_observables(dataset)
        first, later = _charged_first(dataset), shares["lost_to_fluctuations"]
        known = {
            "lost_to_fluctuations_first": first,
            "lost_to_bonds_last": shares["lost_to_bonds"] + later - first,
            "order_of_charging": first - later,
        }
        shares = shares.assign({name: defined(name, known[name]) for name in known})
    return shares


def restricted(dataset: xr.Dataset, names: Collection[str] | None) -> xr.Dataset:
    """Return the dataset without trajectories that the observables ``names`` do not need; None stands for all."""
    if names is None:
        return dataset
    needed = {source for name in names for source in _SOURCES.get(name, (name,))} | {
        *_REFERENCES,
        *sources(names),
        "in_contact",
    }
    if _shares_among(names):
        needed |= {*_SOURCES_OF_SHARES, *_LOSSES.values()}
    return with_trajectories(dataset, *needed)


def chosen_observables(
    dataset: xr.Dataset, names: Collection[str] | None
) -> xr.Dataset:
    """Return the observables ``names``.

    If it is None, return all observables, and the shares of the lost area in both orders if they are known.
    """
    result = observables(dataset, names)
    if names is None or _shares_among(names):
        result = result.merge(charges(dataset), compat="no_conflicts")
    if names is None:
        return result
    return result[[name for name in result if name in names]]


def closed_observables(
    dataset: xr.Dataset, names: Collection[str] | None
) -> xr.Dataset:
    """Return the ``chosen_observables``; what only a closed contact has is nan if the contact is open."""
    return chosen_observables(closed_only(dataset), names)


def _shares_among(names: Collection[str]) -> bool:
    return any(name.startswith(("lost_to", "order_of")) for name in names)


def settled(trajectories: xr.Dataset) -> xr.Dataset:
    """Return observables averaged over the second half of the run, one record long.

    Each member is averaged over time first, so the standard error over members is valid for any correlation in time. A
    trajectory that stops is averaged over its recorded part. Where only statistics were recorded, their mean over time
    is taken: for a standard error an upper bound.
    """
    late = trajectories.isel(t=slice(trajectories.sizes["t"] // 2, None))
    averaged = late.mean("t", keep_attrs=True).expand_dims(t=late["t"][-1:], axis=-1)
    return averaged.map(ordered, keep_attrs=True)
