"""Events of a run, once per member: openings and closings of the contact, masking, peaks, slips, cycles."""

import contextlib

import numpy as np
import xarray as xr

from sim.quantities import OF_A_CONTACT, OPEN_THROUGHOUT, QUANTITIES
from sim.read.correlation import Array
from sim.read.dataset import (
    MEMBERS,
    answered,
    control,
    ensemble_mean,
    only_statistics,
    plain,
    recorded_share,
    setting,
    where_recorded,
)
from sim.read.estimate import Estimate, Estimates, explained, of_every_member
from sim.read.lifetimes import half_lives
from sim.read.loops import mean_loops
from sim.read.observables import defined, is_open_throughout, share_of_members
from sim.read.peaks import (
    UNRESOLVED,
    ageing,
    differing,
    ensemble_peaks,
    hidden_after_holds,
    peaks,
    peaks_after_holds,
    static_threshold,
)
from sim.read.slips import slips_by_phase, stick_slip
from sim.read.statistics import summary

#: Quantities at turns of the contact, and shares of the members that have had an event, with its time and meaning.
_TURNS = (
    "detachments",
    "time_masked",
    *(f"pull_off_{name}" for name in ("load", "time", "displacement")),
    *(f"lowest_load{name}" for name in ("", "_time", "_displacement")),
    *(f"jump_in_{name}" for name in ("load", "time", "displacement")),
)
_EVER = {"ever_detached": "first_detachment", "ever_masked": "first_masked"}


def events(dataset: xr.Dataset) -> Estimates:
    """Return the events of a run, once per member, or once for all if the members agree.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    dict of str to Estimate
        Values of each member, without the dimension ``t``; what a scene cannot have is left out.

        - ``ever_detached``: 1 if the contact opened; number of ``detachments``. The time is in the dataset,
          ``first_detachment``; ``survival`` and ``lifetime`` take its censoring into account, because a mean over the
          members that opened would only be as long as the run.
        - ``time_masked``: share of the time closed in which it was masked; ``ever_masked``: 1 if it ever was.
        - ``pull_off_load`` [N], ``pull_off_displacement`` [m] and ``pull_off_time`` [s], nan if the contact does not
          open, and the time also if another member does not; with several pull-offs means over them, and their number
          ``pull_offs``; see ``pull_offs``.
        - ``jump_in_load``, ``jump_in_displacement`` and ``jump_in_time``: the same of the first jump into contact.
        - ``lowest_load`` [N], ``lowest_load_displacement`` and ``lowest_load_time``: of a load that changes, nan
          without tension.
        - ``total_dissipated`` [J]: by opening and closing, to the end of the run; nan once a contact has opened under a
          load.
        - ``loop_energy``, ``loop_dissipation`` [J]: means over the cycles there and back; see ``loop_energy``.
        - ``peak_stress`` [Pa], ``peak_time`` [s], ``peak_speed`` [m/s], and ``peak_friction`` [N] with
          ``peak_friction_time``, ``peak_friction_speed``: of a start or a ramp; see ``peaks``.
        - ``slip_count``, ``static_friction``, ``kinetic_friction`` [N], ``slip_amplitude`` [m] and more, of a slider
          behind a spring, ``ran_away`` and ``runaway_after`` [s] of one under a force; see ``stick_slip``.
        - ``static_threshold`` [N] and ``area_at_threshold``, of a pull from rest; see ``static_threshold``.
        - ``hold_growth`` [N] or ``hold_saturation`` [s], of sliding and holds in turn; see ``ageing``.

        Where only statistics were recorded, those of them that follow.
    """
    dataset = plain(dataset)
    found = {
        name: Estimate(_alone(dataset[name])) for name in _TURNS if name in dataset
    }
    for name, first in _EVER.items():
        share = share_of_members(dataset, first, name)
        if share is not None:
            found[name] = Estimate(share)
        elif first in dataset:
            has_had = dataset[first].notnull().astype(float)
            found[name] = Estimate(_alone(defined(name, has_had)))
    for name in ("pull_off_time", "jump_in_time"):
        if name in found:
            reason = f"{QUANTITIES[name].absent} in every member"
            share = recorded_share(dataset, name)
            found[name] = of_every_member(found[name].value, reason, share)
    found |= _over_pull_offs(dataset)
    for part in (peaks, stick_slip, static_threshold, ageing):
        with where_recorded():
            found |= part(dataset)
    if "dissipated_energy" in dataset:
        found["total_dissipated"] = _dissipated(dataset)
    with contextlib.suppress(ValueError), answered():
        found |= mean_loops(dataset)
    if {"pull_off_error", "pull_off_load"} <= {*dataset}:
        _add_step_errors(found, dataset)
    for name, one in found.items():
        if one.bound is not None:
            # a bound that was compared with recorded statistics has one for each
            found[name] = one._replace(bound=ensemble_mean(one.bound))
    return _of_contacts(found, dataset)


def _alone(variable: xr.DataArray) -> xr.DataArray:
    """Return numbers of a variable without coordinates that are no dimensions, and without the numbers of members."""
    return (
        variable.astype(float)
        .drop_vars(MEMBERS, errors="ignore")
        .reset_coords(drop=True)
    )


def of_events(dataset: xr.Dataset, over: str = "") -> Estimates:
    """Return statistics of the events of a run over its members, the sample ``over``, with medians of lifetimes."""
    found, result = events(dataset), Estimates()
    values = xr.Dataset({name: _alone(one.value) for name, one in found.items()})
    for name, one in summary(values.assign_attrs(dataset.attrs)).items():
        bound = found[name].bound
        if bound is not None and MEMBERS in bound.dims:
            bound = bound.mean(MEMBERS, keep_attrs=True)
        share = recorded_share(dataset, name)
        if share is not None:
            one = one._replace(members=share * float(dataset.attrs["members"]))
        result[name] = one._replace(bound=bound, reason=found[name].reason)
    phased = [peaks_after_holds(dataset)]
    if {"phase_start", "slip_time"} <= {*dataset.variables} and dataset.sizes["slip"]:
        phased.append(slips_by_phase(dataset))
    for of_phases in filter(None, phased):
        means = summary(of_phases.assign_attrs(dataset.attrs), quantiles=False)
        result |= {f"phase_{name}": one for name, one in means.items()}
    if "phase_peak_after_hold" in result:
        one, is_hidden = result["phase_peak_after_hold"], hidden_after_holds(dataset)
        reason = xr.where(is_hidden.any(differing(is_hidden)), UNRESOLVED, "")
        result["phase_peak_after_hold"] = one._replace(reason=reason)
    result |= half_lives(dataset) | ensemble_peaks(dataset)
    return explained(_of_contacts(result, dataset), over)


def _of_contacts(found: Estimates, dataset: xr.Dataset) -> Estimates:
    """Return events without those of closed contacts at points of the sweep where no contact ever closes."""
    is_open = is_open_throughout(dataset)
    if not bool(is_open.any()):
        return found
    result = dict(found)
    for name, one in found.items():
        if name in QUANTITIES and QUANTITIES[name].absent in OF_A_CONTACT:
            reason = "" if one.reason is None else one.reason
            known = one._replace(reason=None).map(lambda each: each.where(~is_open))
            reason = xr.where(is_open, OPEN_THROUGHOUT, reason)
            result[name] = known._replace(reason=reason)
    return result


def _dissipated(dataset: xr.Dataset) -> Estimate:
    """Return the energy dissipated to the end of the run [J]; nan once a contact has opened under a load."""
    lost = dataset["dissipated_energy"].isel(t=-1, drop=True).astype(float)
    with contextlib.suppress(KeyError):
        if control(dataset).kind == "load":
            lost = lost.where(ensemble_mean(dataset["detachments"]) == 0.0)
    row = QUANTITIES["total_dissipated"]
    return of_every_member(defined(row.name, lost), row.absent)


def _add_step_errors(found: Estimates, dataset: xr.Dataset) -> None:
    """Add the bounds of the errors that the clock step makes at pull-offs, if the stepper has recorded one.

    The energy lost at a pull-off grows at most with the square of its load, as behind a soft spring. The relative
    error of an energy is therefore at most twice that of the load. The lowest load has the error of a pull-off that
    ends its fall, and none if the contact is stable beyond it.
    """
    error = abs(ensemble_mean(dataset["pull_off_error"])).assign_attrs(source="step")
    load = found["pull_off_load"]
    found["pull_off_load"] = load._replace(bound=error)
    if "lowest_load" in found:
        lowest = found["lowest_load"]
        ends_fall = ensemble_mean(lowest.value) == ensemble_mean(load.value)
        ends_fall = ends_fall & ~_bears_lowest_load(dataset)
        of_pull_off = error.where(ends_fall).assign_attrs(source="step")
        found["lowest_load"] = lowest._replace(bound=of_pull_off)
    for name in {"total_dissipated", "loop_dissipation"} & found.keys():
        one = found[name]
        share = error / ensemble_mean(load.value)
        bound = 2.0 * abs(share * ensemble_mean(one.value)).fillna(0.0)
        bound = bound if one.bound is None else bound + one.bound
        found[name] = one._replace(bound=bound.assign_attrs(source="step"))


def _bears_lowest_load(dataset: xr.Dataset) -> xr.DataArray:
    """Return True if a contact bears the lowest load of a prescribed course for longer than a clock step.

    That load is then known exactly, although the time of the pull-off, which comes later, has an error.
    """
    names = {"pull_off_time", "lowest_load_time"}
    with contextlib.suppress(KeyError):
        if control(dataset).kind == "load" and names <= {*dataset}:
            opens, reached = (
                ensemble_mean(dataset[name]).astype(float)
                for name in ("pull_off_time", "lowest_load_time")
            )
            return opens - reached > setting(dataset, "clock.step")
    return xr.DataArray(False)


def pull_offs(dataset: xr.Dataset) -> xr.Dataset:
    """Return the pull-offs of a run one by one, those of all cycles.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a contact that can open, with each member recorded.

    Returns
    -------
    xarray.Dataset
        ``pull_off_load`` [N], ``pull_off_time`` [s] and ``pull_off_displacement`` [m], those of the first pull-off in
        each phase, with the dimension ``phase`` last if the run has several; nan in a phase without one.
    """
    phase = "phase_" if "phase_pull_off_load" in dataset else ""
    names = (f"pull_off_{name}" for name in ("load", "time", "displacement"))
    return xr.Dataset({name: dataset[f"{phase}{name}"] for name in names})


def _over_pull_offs(dataset: xr.Dataset) -> Estimates:
    """Return the means over the pull-offs of a member, and their number; empty if no member has several."""
    if "phase_pull_off_load" not in dataset or only_statistics(dataset):
        return {}
    each = pull_offs(dataset)
    load, place = each["pull_off_load"], each["pull_off_displacement"]
    count = load.count("phase")
    if bool((count <= 1).all()):
        return {}
    columns = {
        "pull_off_load": load.mean("phase"),
        "pull_off_displacement": place.mean("phase"),
        "pull_offs": count.astype(float),
    }
    return {
        name: Estimate(_alone(defined(name, values)))
        for name, values in columns.items()
    }


# --- readings of records, for figures ---


#: A speed jumps between two records if it changes by more than this many times what it does before and after.
_JUMP = 4.0
#: Fall of a force over its largest so far with which it has passed its first maximum.
_FALL = 0.02
#: Share of the largest force up to which the law of incipient shear is fitted.
_FITTED = 0.5


def jumps(speed: Array, turns: bool = False) -> Array:
    """Return records before which the speed has jumped: its change stands out from those before and after.

    With ``turns`` also those before which it has changed its sign.

    >>> jumps(np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0]))
    array([3])
    >>> jumps(np.array([2.0, 1.0, -1.0, -2.0])), jumps(np.array([2.0, 1.0, -1.0, -2.0]), turns=True)
    (array([], dtype=int64), array([2]))
    """
    change = np.abs(np.diff(speed))
    jumped = np.append(
        False, change[1:-1] > _JUMP * np.maximum(change[:-2], change[2:])
    )
    turned = (speed[1:] * speed[:-1] < 0.0) & turns
    return np.flatnonzero(np.pad(jumped, (0, change.size - jumped.size)) | turned) + 1


def time_of_pull_off(dataset: xr.Dataset, record: int) -> float:
    """Return the time of the pull-off after a record at which a contact was last closed [s].

    Of several members it is that of the last one to open. It is the recorded ``pull_off_time`` if each detachment of
    the member has one, else the end of the clock step in which the contact opened. It is nan if neither is recorded, or
    only their statistics over members.
    """
    if only_statistics(dataset):
        return np.nan
    name = "detachment_time" if "detachment_time" in dataset else "first_detachment"
    if name not in dataset:
        return np.nan
    opened = np.ravel(dataset[name].isel(t=record + 1, missing_dims="ignore"))
    before, after = dataset["t"].to_numpy()[record : record + 2]
    is_between = (opened > before) & (opened <= after)
    if not is_between.any():
        return np.nan
    member = int(np.where(is_between, opened, -np.inf).argmax())
    time = float(opened[member])
    if not {"pull_off_time", "detachments"} <= {*dataset.variables}:
        return time
    count = np.ravel(dataset["detachments"])[member]
    each = pull_offs(dataset)["pull_off_time"].to_numpy().reshape(opened.size, -1)
    known = each[member][np.isfinite(each[member])]
    if known.size != count:
        return time
    return float(np.max(known, initial=-np.inf, where=known <= time))


def time_of_jump_in(dataset: xr.Dataset, record: int) -> float:
    """Return the time of the first jump into contact if a contact is closed again at a record, by this jump [s].

    Of several members it is that of the first one to close. It is nan for a later jump, whose time is not recorded, for
    a contact that closes without a jump, or if only statistics over members are recorded.
    """
    if only_statistics(dataset) or "jump_in_time" not in dataset:
        return np.nan
    before, after = dataset["t"].to_numpy()[record - 1 : record + 1]
    times = np.ravel(dataset["jump_in_time"])
    times = times[(times > before) & (times <= after)]
    return float(np.min(times)) if times.size else np.nan


def incipient_law(force: Array, area: Array) -> tuple[int, float]:
    """Return the record of the largest force [N] before its first fall by 2 %, and alpha of A0 - alpha Q^2 [m^2/N^2].

    That is fitted to the area [m^2] by least squares up to half of the largest force.

    >>> top, alpha = incipient_law(np.array([0.0, 1.0, 2.0, 3.0, 1.0]), np.array([8.0, 7.9, 7.6, 7.0, 7.0]))
    >>> print(top, round(alpha, 3))
    3 0.1
    """
    fallen = np.flatnonzero(force < (1.0 - _FALL) * np.fmax.accumulate(force))
    top = int(np.nanargmax(force[: fallen[0]] if fallen.size else force))
    small = np.flatnonzero(force[:top] <= _FITTED * force[top])
    with np.errstate(invalid="ignore"):  # no force at all
        alpha = np.sum(force[small] ** 2 * (area[0] - area[small])) / np.sum(
            force[small] ** 4
        )
    return top, float(alpha)
