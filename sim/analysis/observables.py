"""Variables per member and time: those recorded, and those that follow from them.

The reference of every ratio and share is JKR's contact with the full work of adhesion, held as the
recorded contact is at that time.
"""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from sim.analysis.scene import MEMBERS, control, setting, stays_held, word
from sim.laws import jkr

KEPT = ("mean", "std", "sem")


def ordered(variable: xr.DataArray) -> xr.DataArray:
    """Members and time last."""
    return variable.transpose(..., *(name for name in (MEMBERS, "t") if name in variable.dims))


def pure(values: xr.DataArray, text: str, symbol: str = "") -> xr.DataArray:
    """A pure number, described."""
    return ordered(values).assign_attrs(units="1", long_name=text, symbol=symbol)


def equilibrium_radius(dataset: xr.Dataset, work: xr.DataArray | float) -> xr.DataArray:
    """Stable JKR radius for a work of adhesion under what holds the dataset's sphere.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    work : xarray.DataArray or float
        Work of adhesion [J/m^2], at most with the dimensions of the dataset's trajectories.

    Returns
    -------
    xarray.DataArray
        [m], with the dimension ``t`` where the work or what holds the sphere changes in time; Hertz's where
        there is no work; nan where there is no equilibrium.

    Raises
    ------
    KeyError
        If the dataset does not tell what holds the sphere.
    """
    held = control(dataset)
    size, modulus = setting(dataset, "sphere.radius"), dataset["contact_modulus"]
    if held.kind == "displacement":
        return xr.apply_ufunc(jkr.radius_at_displacement, held.value, held.stiffness, work, size, modulus)
    law = jkr.radius_at_load if held.kind == "load" else jkr.radius_at_indentation
    return xr.apply_ufunc(law, held.value, work, size, modulus)


def _opened(dataset: xr.Dataset, radius: xr.DataArray) -> xr.DataArray:
    """Where a contact that follows its equilibrium radius is open: none is left, or it was lost before.

    With ``after_pull_off = "reattach"`` it closes again where a free sphere would touch, else never.
    """
    held = control(dataset)
    open_now = radius.isnull() & held.value.notnull() | (radius == 0.0)
    if "t" not in radius.dims:
        return open_now
    closes = (word(dataset, "contact.after_pull_off", "stay_open") == "reattach") & (held.value >= 0.0) & ~open_now
    number = xr.DataArray(np.arange(dataset.sizes["t"]), dims="t")
    lost, found = (_latest(number.where(where, -1)) for where in (open_now, closes))
    return lost > found


def _latest(numbers: xr.DataArray) -> xr.DataArray:
    """The largest number so far."""
    dims = [["t"]]
    return xr.apply_ufunc(
        np.maximum.accumulate, numbers, input_core_dims=dims, output_core_dims=dims, kwargs={"axis": -1}
    )


def reference_radii(dataset: xr.Dataset) -> xr.Dataset:
    """Radii of the contacts with the full work of adhesion and with none, held as the sphere is.

    Returns
    -------
    xarray.Dataset
        ``radius_jkr`` and ``radius_hertz`` [m]: those at rest where what holds the sphere stays, else with the
        dimension ``t``. JKR's contact follows the same policy on detachment as the recorded one. nan
        where it is open, and where the dataset does not tell what holds the sphere.
    """
    rest, hertz = dataset["radius_at_rest"], dataset["radius_without_adhesion"]
    stays = stays_held(dataset)
    if not bool(stays.all()):
        try:
            jkr_radius = equilibrium_radius(dataset, setting(dataset, "adhesion.work"))
            jkr_radius = ordered(jkr_radius.where(~_opened(dataset, jkr_radius)))
            bare = ordered(equilibrium_radius(dataset, 0.0))
        except KeyError:
            jkr_radius, bare = rest.where(stays), hertz.where(stays)
        rest, hertz = jkr_radius.assign_attrs(rest.attrs), bare.assign_attrs(hertz.attrs)
    return xr.Dataset({"radius_jkr": rest, "radius_hertz": hertz})


def full_area(dataset: xr.Dataset) -> xr.DataArray:
    """JKR's area at the full work of adhesion [m^2]; nan where that contact is open."""
    area = np.pi * reference_radii(dataset)["radius_jkr"] ** 2
    return area.where(area > 0.0)


def bond_work(dataset: xr.Dataset) -> xr.DataArray:
    """Work of adhesion that the bonds left would give without fluctuations: Δγ(fraction) [J/m^2].

    ``work (1 - share + share * fraction)``, per member where the bonds differ between members, and
    of the mean fraction where only that was recorded.
    """
    share = setting(dataset, "adhesion.bond_share")
    fraction = dataset["bond_fraction" if "bond_fraction" in dataset else "bond_fraction_mean"]
    left = setting(dataset, "adhesion.work") * (1.0 - share + share * fraction)
    return ordered(left).assign_attrs(units="J/m^2", symbol="Δγ", long_name="work of adhesion of the bonds left")


def share_observables(dataset: xr.Dataset) -> xr.Dataset:
    """The shares of JKR's area that each mechanism takes, per member and time.

    Returns
    -------
    xarray.Dataset
        ``lost_to_bonds`` and ``lost_to_fluctuations``; with ``contact.reversible`` above zero also
        ``lost_to_mean_stress``, and with a rate-dependent contact ``lost_to_lag``. With ``area_ratio`` they
        add up to one.

    Raises
    ------
    ValueError
        If the members differ in what a share needs but only their mean was recorded, or the dataset
        does not tell what holds the sphere.

    Notes
    -----
    The mechanisms are charged in this order, each by the equilibrium area that the work of adhesion left
    after it would give. What fluctuations leave is the recorded work plus what the mean stress takes at
    the recorded radius, ``α 2(2-ν)/(1-ν) τ0² a/(π E*)``; for a disc both are those of that radius.
    """
    if "bond_fraction" not in dataset:
        raise ValueError("shares need the bonds of each member; record them: [record] per_member = true")
    try:
        levels = list(_levels(dataset))
    except KeyError as missing:
        raise ValueError(f"{missing.args[0]}; sweep its number, not its whole table") from None
    suffix = "" if "contact_area" in dataset else "_mean"
    before = full = full_area(dataset)
    found = {}
    for name, text, after in levels:
        key = name if name == "lost_to_bonds" else name + suffix
        found[key] = pure((before - after) / full, f"share of JKR's area lost to {text}")
        before = after
    if suffix:  # the bonds are the same for all members, so the spread is the area's
        for kind in ("std", "sem"):
            found[f"lost_to_fluctuations_{kind}"] = pure(dataset[f"contact_area_{kind}"] / full, "")
    return xr.Dataset(found)


def _levels(dataset: xr.Dataset) -> Iterator[tuple[str, str, xr.DataArray]]:
    """Share, what it is lost to, and the area [m^2] that is left after it."""
    area = dataset["contact_area" if "contact_area" in dataset else "contact_area_mean"].astype(float)

    def left(work: xr.DataArray) -> xr.DataArray:
        radius = equilibrium_radius(dataset, work)
        # pulled off for good: where this work alone had opened the contact, its staying open is its doing
        kept = ~(_opened(dataset, radius) & (area == 0.0))
        return (np.pi * radius.fillna(0.0) ** 2).where(kept, 0.0).where(area.notnull())

    yield "lost_to_bonds", "broken bonds, which are charged first", left(bond_work(dataset))
    alpha, lags = _reversible(dataset), word(dataset, "contact.model", "equilibrium") == "rate_dependent"
    stressed, rate_dependent = bool((alpha > 0.0).any()), bool(lags.any())
    if (stressed or rate_dependent) and "work_of_adhesion" not in dataset:
        raise ValueError(
            "shares of a contact that lags or pays for its mean stress need each member; record them:"
            " [record] per_member = true"
        )
    bearing = alpha * _mean_stress_work(dataset) if stressed else 0.0
    quasistatic = left(dataset["work_of_adhesion"]).where(lags, area) if rate_dependent else area
    fluctuating = (
        left(dataset["work_of_adhesion"] + bearing).where(alpha > 0.0, quasistatic) if stressed else quasistatic
    )
    yield "lost_to_fluctuations", "fluctuations, after the bonds", fluctuating
    if stressed:
        yield "lost_to_mean_stress", "the mean stress, after bonds and fluctuations", quasistatic
    if rate_dependent:
        yield "lost_to_lag", "the edge's lag behind equilibrium, after all else", area


def _reversible(dataset: xr.Dataset) -> xr.DataArray:
    try:
        return setting(dataset, "contact.reversible")
    except KeyError:
        return xr.DataArray(0.0)


def _mean_stress_work(dataset: xr.Dataset) -> xr.DataArray:
    """Energy per area that the mean stress gives back where the contact shrinks, at the recorded radius [J/m^2]."""
    poisson_ratio, modulus = dataset["effective_poisson_ratio"], dataset["contact_modulus"]
    coefficient = 2.0 * (2.0 - poisson_ratio) / (1.0 - poisson_ratio) / np.pi
    return coefficient * dataset["shear_stress"] ** 2 * dataset["contact_radius"] / modulus


def observables(dataset: xr.Dataset) -> xr.Dataset:
    """Every recorded trajectory, per member where members differ, and what follows from them.

    ``area_ratio`` is A/A_JKR, with the area of JKR's contact held as the sphere is at that time;
    ``fraction_detached`` is 1 where the contact is open, ``fraction_masked`` is 1 where it is closed though
    no work of adhesion is left (Hertz's contact): their ensemble means are the fractions.
    """
    found = dataset.drop_vars([n for n, v in dataset.data_vars.items() if "t" not in v.dims])
    full = full_area(dataset)
    for suffix in ("", *(f"_{kind}" for kind in KEPT)):
        if f"contact_area{suffix}" in found:
            ratio = found[f"contact_area{suffix}"].astype(float) / full
            found[f"area_ratio{suffix}"] = pure(ratio, "contact area over JKR's", "A/A_JKR")
        if f"in_contact{suffix}" in found:
            closed = found[f"in_contact{suffix}"].astype(float)
            opened = closed if suffix in ("_std", "_sem") else 1.0 - closed
            found[f"fraction_detached{suffix}"] = pure(opened, "open contacts")
    found = found.assign(masks(dataset))
    return found.drop_vars([n for n in found if str(n).startswith(("in_contact", "masked"))])


def masks(dataset: xr.Dataset) -> dict[str, xr.DataArray]:
    """``fraction_masked``; of statistics alone it is known where all contacts are closed, else nan."""
    text = "closed contacts without work of adhesion"
    if "in_contact" in dataset and ("masked" in dataset or "work_of_adhesion" in dataset):
        without = dataset["masked"] == 1 if "masked" in dataset else dataset["work_of_adhesion"] <= 0.0
        return {"fraction_masked": pure((without & (dataset["in_contact"] == 1)).astype(float), text)}
    if "masked_mean" in dataset:
        closed = dataset["in_contact_mean"] == 1.0
        return {f"fraction_masked_{kind}": pure(dataset[f"masked_{kind}"].where(closed), text) for kind in KEPT}
    return {}


def settled(trajectories: xr.Dataset) -> xr.Dataset:
    """Observables averaged over the second half of the run, one record long.

    Each member is averaged over time first, so that a standard error over members holds whatever
    the correlation in time; a trajectory that stops, over what there is of it. Where only statistics
    were recorded, their mean over time is taken: for a standard error an upper bound.
    """
    late = trajectories.isel(t=slice(trajectories.sizes["t"] // 2, None))
    averaged = late.mean("t", keep_attrs=True).expand_dims(t=late["t"][-1:], axis=-1)
    return averaged.map(ordered, keep_attrs=True)
