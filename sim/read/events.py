"""Events of a run: slips, onset of sliding, detachment, masking, friction peaks, cycles, lifetimes of members."""

import contextlib
import math
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.quantities import QUANTITIES, SLIP_EVENT
from sim.read.dataset import (
    MEMBERS,
    answered,
    control,
    in_pieces,
    is_stationary,
    plain,
    setting,
    speed_of,
    sweep_dims,
    where_recorded,
    with_trajectories,
    word,
)
from sim.read.observables import ENDINGS, labelled, pure
from sim.read.statistics import LEVEL, WIDE, Array, observable_of, summary
from sim.units.notation import engineering

#: Relative changes below it are rounding, also of records with six digits (``record.compression = "digits"``).
_ROUNDING = 1e-6
#: Path of the stage in a clock step over the advance in a slip event, above which the event is not resolved.
_COARSE = 0.02
#: Properties of slip events and the quantities of late ones of which the engine records moments.
_LATE = {
    "static_friction": "force_before",
    "force_drop": "force_drop",
    "slip_amplitude": "amplitude",
    "recurrence_time": "recurrence",
}
#: Speeds of the stage at which slip events set in and end.
_ONSET = "onset_steady_speed", "onset_slip_speed", "end_slip_speed", "end_steady_speed"
#: Change of the kinetic friction over it up to which steady sliding and whole cycles have settled: the ends of a cycle
#: are known to a clock step. Beside that the change in standard errors of members with noise.
_SETTLED, _SETTLED_CYCLES, _SURELY = 1e-3, 1e-2, 3.0
#: Half of a 95 % interval of a normal law in standard errors.
_WIDE = 1.96


def slips(dataset: xr.Dataset) -> xr.Dataset:
    """Return the slip events of a slider that a stage pulls through a spring, one by one.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``spring`` with each member recorded.

    Returns
    -------
    xarray.Dataset
        With the dimension ``slip`` last, nan beyond a member's last: ``slip_time``, ``slip_duration``,
        ``stick_duration`` until the next one, ``recurrence_time`` [s], ``slip_amplitude`` [m], ``slip_speed`` of
        the stage [m/s], ``static_friction`` and ``force_drop`` [N], ``stress_drop`` [Pa].

    Raises
    ------
    ValueError
        If no stage pulls, or only statistics were recorded.

    Notes
    -----
    The engine sees slip events at its clock steps. A slip event is an episode in which the slider is faster than ten
    times the stage; ``sim.parts.events.Slips`` has the whole definition. Forces and displacements are taken in the
    sense in which the stage moves. ``force_drop`` is the static friction minus the force at the end of the event. A
    member has at most 1,000 of them here; ``stick_slip`` counts all.
    """
    if "slip_count_mean" in dataset:
        raise ValueError(
            "slip events need every member; record them: [record] per_member = true"
        )
    if not bool((word(dataset, "drive.model", "") == "spring").any()):
        raise ValueError(
            'slips need a stage that pulls through a spring: [drive] model = "spring"'
        )
    event = {name: dataset[f"slip_{name}"].astype(float) for name in SLIP_EVENT}
    begins, ends, following = event["time"], event["end"], event["time"].shift(slip=-1)
    drop, fall = (
        event["force_before"] - event["force_after"],
        event["stress_before"] - event["stress_after"],
    )
    columns = {
        "slip_time": (begins, "s", "time at which a slip event begins"),
        "slip_duration": (ends - begins, "s", "duration of a slip event"),
        "stick_duration": (following - ends, "s", "duration of a stick phase"),
        "recurrence_time": (
            following - begins,
            "s",
            "time between the starts of two slip events",
        ),
        "slip_amplitude": (
            event["amplitude"],
            "m",
            "displacement of the slider in a slip event",
        ),
        "slip_speed": (
            event["speed"],
            "m/s",
            "stage speed at the start of a slip event",
        ),
        "static_friction": (
            event["force_before"],
            "N",
            "largest spring force in the stick phase before a slip event",
        ),
        "force_drop": (drop, "N", "drop of the spring force by a slip event"),
        "stress_drop": (fall, "Pa", "drop of the shear stress in a slip event"),
    }
    result = xr.Dataset({name: labelled(*column) for name, column in columns.items()})
    return result.transpose(..., "slip")


def stick_slip(dataset: xr.Dataset) -> xr.Dataset:
    """Return the mean stick and slip of each member, static and kinetic friction.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        Under a stage ``slip_count``, and the means over the slip events of what ``slips`` has of each; of a stage at
        one speed those that begin in the second half of the run, with ``…_least`` and ``…_largest`` of
        ``static_friction``, ``force_drop``, ``slip_amplitude`` and ``recurrence_time``. ``slip_spread`` [1]: the
        standard deviation of their displacements over its mean. ``kinetic_friction`` [N] with
        ``kinetic_friction_reason``: see ``kinetic_friction``.

        Of a stage that gets faster ``onset_steady_speed`` and ``onset_slip_speed`` [m/s]: its speed at the first slip
        event, and the speed one recurrence time earlier, when another event would have come if the slider had already
        stuck and slipped. Of a stage that gets slower ``end_slip_speed`` and ``end_steady_speed``: its speed at the
        last slip event, and one recurrence time later. They are nan with fewer than two slip events, or if slip events
        begin at the start or last to the end of such a phase.

        Under a prescribed force see ``runaways``. Empty for other drives. Where only statistics were recorded, those of
        the means over late slip events.
    """
    if "stage_speed" not in dataset and {"runaway_time", "spring_force"} <= set(
        dataset
    ):
        return runaways(dataset)
    at_one_speed = any(f"slip_count_late{ending}" in dataset for ending in ENDINGS)
    sources = {"slip_count": "slip_count_late" if at_one_speed else "slip_count"}
    sources |= {name: f"late_{quantity}_mean" for name, quantity in _LATE.items()}
    sources |= {
        f"{name}_{kind}": f"late_{of}_{kind}"
        for name, of in _LATE.items()
        for kind in ("least", "largest")
    }
    sources |= {name: name for name in _ONSET}
    result = xr.Dataset(
        {
            name + ending: dataset[source + ending].astype(float)
            for ending in ENDINGS
            for name, source in sources.items()
            if source + ending in dataset
        }
    )
    if "slip_time" not in dataset or not result:
        return result.merge(kinetic_friction(dataset), compat="no_conflicts")
    if not is_stationary(dataset):
        count = pure(dataset["slip_count"].astype(float), "number of slip events")
        return result[[n for n in _ONSET if n in result]].assign(slip_count=count)
    result = result.merge(kinetic_friction(dataset), compat="no_conflicts")
    text = "standard deviation of slip displacements over their mean"
    result["slip_spread"] = pure(
        dataset["late_amplitude_std"] / dataset["late_amplitude_mean"], text
    )
    late_half = dataset["slip_time"] >= 0.5 * float(dataset["t"][-1])
    each = slips(dataset).where(late_half)[
        ["slip_duration", "stick_duration", "stress_drop"]
    ]
    result = result.merge(each.mean("slip", keep_attrs=True), compat="no_conflicts")
    bounds, source = _of_late_slips(dataset, result), "step"
    # of one random member there is no other error than the scatter between slip events,
    # and of the stress the bound of a clock step is not known
    if dataset.sizes.get(MEMBERS, 1) == 1:
        is_random = MEMBERS in dataset.sizes
        source = "slip events and step" if is_random else "step"
        events, squares = (
            each.count("slip"),
            ((each - each.mean("slip")) ** 2).sum("slip"),
        )
        errors = {
            str(n): (squares[n] / events[n] / (events[n] - 1).where(events[n] > 1))
            ** 0.5
            for n in each
        }
        errors |= {
            name: dataset[f"late_{of}_std"] / dataset["slip_count_late"] ** 0.5
            for name, of in _LATE.items()
        }
        for name in errors if is_random else ("stress_drop",):
            bounds[name] = _WIDE * errors[name] + bounds.get(name, 0.0)
    return result.assign(
        {
            f"{name}_bound": bound.assign_attrs(source=source)
            for name, bound in bounds.items()
            if name in result
        }
    )


def _of_late_slips(dataset: xr.Dataset, means: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return bounds of the errors of means over slip events by the clock steps at which these begin and end.

    Within a step the stage extends the spring by its displacement. A slip event and a stick phase begin and end
    at clock steps, and so does the span over which the stage does work against friction.
    """
    step = setting(dataset, "clock.step")
    path = abs(speed_of(dataset)).max("t") * step
    rise = setting(dataset, "drive.stiffness") * path
    of_each = step + 0.0 * means["recurrence_time"]
    intervals = (dataset["slip_count_late"] - 1.0).where(
        dataset["slip_count_late"] > 1.0
    )
    span = intervals * means["recurrence_time"]
    return {
        "static_friction": rise + 0.0 * means["static_friction"],
        "force_drop": 2.0 * rise + 0.0 * means["force_drop"],
        "slip_amplitude": path + 0.0 * means["slip_amplitude"],
        "slip_duration": of_each,
        "stick_duration": of_each,
        "recurrence_time": step / intervals,
        "kinetic_friction": means["force_drop"] * step / span,
    }


def unresolved_slips(dataset: xr.Dataset) -> list[str]:
    """Return remarks on falls of the force that are no slip events, and on slip events that are hardly resolved."""
    remarks = []
    for ending in ("", "_mean"):
        if bool(
            (dataset.get(f"slow_fall_count{ending}", xr.DataArray(0.0)) > 0.0).any()
        ):
            remarks.append(
                "the spring force falls by 0.3 or more while the slider is less than ten "
                "times as fast as the stage, which is no slip event: it oscillates, or a "
                "smaller clock.step shows that it is faster"
            )
    # of a run without slips, or without single ones
    with contextlib.suppress(ValueError, KeyError):
        each, step = slips(dataset), setting(dataset, "clock.step")
        share = (each["slip_speed"] * step / each["slip_amplitude"]).median()
        if bool((share > _COARSE).any()):
            remarks.append(
                f"the stage moves by more than {100.0 * _COARSE:g} % of a slip event in "
                "a clock step: the drop of the spring force is off by about as much; "
                "reduce clock.step"
            )
    return remarks


def kinetic_friction(dataset: xr.Dataset) -> xr.Dataset:
    """Return the mean friction force of sliding or of whole stick-slip cycles, if the motion has settled to them.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``spring`` with a stage at one speed.

    Returns
    -------
    xarray.Dataset
        ``kinetic_friction`` [N] of each member, the work of the stage over its path from the first slip event in the
        second half of the run to the last, and without slip events over the second half. ``kinetic_friction_reason``
        is "" or, at each point of the sweep, the reason why there is none. Empty for other drives.

    Notes
    -----
    While a spring still extends, the work of the stage is stored in part. The motion has therefore settled only if the
    mean over members changes little from one part of the path to the next: by at most 0.1 % in steady sliding, and by
    1 % in cycles, whose ends are known to a clock step. Three standard errors of the change are added if members
    differ. With slip events, each part must have a whole cycle.
    """
    names = "kinetic_friction", "kinetic_friction_change", "slip_count_late"
    stated = dataset
    if {*names} <= set(dataset):
        stated = summary(dataset[[*names]], quantiles=False)
    if not {f"{name}_mean" for name in names} <= set(stated):
        return xr.Dataset()
    mean, change, late = (stated[f"{name}_mean"].astype(float) for name in names)
    error = stated.get(f"{names[1]}_sem", xr.zeros_like(change)).fillna(0.0)
    share = xr.where(late > 0.0, _SETTLED_CYCLES, _SETTLED)
    has_settled = abs(change) <= share * abs(mean) + _SURELY * error
    reasons = xr.where(change.isnull(), "no two parts of whole cycles", "not settled")
    result = xr.Dataset(
        {
            f"{names[0]}{ending}": dataset[f"{names[0]}{ending}"]
            .astype(float)
            .where(has_settled)
            for ending in ENDINGS
            if f"{names[0]}{ending}" in dataset
        }
    )
    result[f"{names[0]}_reason"] = xr.where(has_settled, "", reasons).assign_attrs(
        long_name="reason for no kinetic friction"
    )
    return result.reset_coords(drop=True)


def slips_by_phase(dataset: xr.Dataset) -> xr.Dataset:
    """Return the means over the slip events in each phase of a stage that stops, turns or changes its speed.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``spring`` with each member recorded and more than one phase.

    Returns
    -------
    xarray.Dataset
        With the dimension ``phase`` last: ``slip_count``, the means ``static_friction``, ``force_drop`` [N],
        ``slip_amplitude`` [m] and ``recurrence_time`` [s], and the ``start`` [s] of the phase.
    """
    each, start, end = slips(dataset), dataset["phase_start"], dataset["phase_end"]
    inside = (each["slip_time"] >= start) & (each["slip_time"] < end)
    each["recurrence_time"] = each["recurrence_time"].where(
        each["slip_time"] + each["recurrence_time"] < end
    )
    result = each[list(_LATE)].where(inside).mean("slip", keep_attrs=True)
    result["slip_count"] = pure(
        inside.sum("slip").astype(float), "number of slip events in a phase"
    )
    result["start"] = labelled(start, "s", "start of a phase")
    return result.drop_vars("slip", errors="ignore").transpose(..., "phase")


def peaks_after_holds(dataset: xr.Dataset) -> xr.Dataset:
    """Return the friction peak after each hold, and the time for which the slider or the stage was held before.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive with more than one phase.

    Returns
    -------
    xarray.Dataset
        With the dimension ``phase`` last: ``peak_after_hold`` [N], the first maximum of the friction after a rest, if
        the friction then falls by 1 % before it exceeds the maximum; ``time_held`` [s] before; and the ``start`` [s] of
        the phase. All are nan in other phases. Empty if nothing rests before another phase.
    """
    if "phase_static_threshold" not in dataset:
        return xr.Dataset()
    start, rests = dataset["phase_start"], dataset["phase_name"].str.contains("rest")
    held = (dataset["phase_end"] - start).where(rests).shift(phase=1)
    peak = dataset["phase_static_threshold"].astype(float)
    result = xr.Dataset(
        {
            "peak_after_hold": labelled(
                peak.where(held.notnull()),
                "N",
                "first maximum of the friction force after a hold",
            ),
            "time_held": labelled(held, "s", "time at rest before a phase"),
            "start": labelled(start, "s", "start of a phase"),
        }
    )
    return result.transpose(..., "phase")


def runaways(dataset: xr.Dataset) -> xr.Dataset:
    """Return which members a prescribed force sets off, when, and at which force.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``force`` with each member recorded.

    Returns
    -------
    xarray.Dataset
        ``ran_away``, 1 if the slider lost stability; ``runaway_after`` [s] and ``static_friction`` [N], the force at
        that time. Both are nan, with a reason, if some members are held to the end: a mean over the others would grow
        with the length of the run.
    """
    when = dataset["runaway_time"].isel(t=-1, drop=True).astype(float)
    force, has_gone = dataset["runaway_force"].astype(float), when.notnull()
    result = xr.Dataset(
        {
            "ran_away": pure(has_gone.astype(float), "members that lost stability"),
            "runaway_after": labelled(when, "s", "time of the loss of stability"),
            "static_friction": labelled(
                force, "N", "force at which the slider lost stability"
            ),
        }
    )
    if MEMBERS in when.dims:
        of_all, of_some = has_gone.all(MEMBERS), has_gone.any(MEMBERS)
        reason = xr.where(of_some & ~of_all, "not every member loses stability", "")
        for name in ("runaway_after", "static_friction"):
            result[name] = result[name].where(of_all)
            result[f"{name}_reason"] = reason
    return result


def _growth(
    series: xr.DataArray, times: xr.DataArray, ends: xr.DataArray
) -> xr.DataArray:
    """Return the growth of a series between neighbouring times ``ends``, which have the dimension ``end``."""
    dims: Any = {
        "input_core_dims": [["end"], ["t"], ["t"]],
        "output_core_dims": [["end"]],
        "vectorize": True,
    }
    return (
        xr.apply_ufunc(np.interp, ends, times, series.astype(float), **dims)
        .where(ends.notnull())
        .diff("end")
    )


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


# --- all events of a run, once per member ---


#: Records that a cycle needs so that every second one still shows its course.
_RECORDS = 16
#: A loop below this share of what is put in and given back is nothing.
_NOTHING = 1e-12
#: Names of a peak, the quantity that it is of, and its unit.
_PEAKS = (
    ("peak_stress", "shear_stress", "Pa"),
    ("peak_friction", "friction_force", "N"),
)
#: Quantities at turns of the contact, and shares of the members that have had an event, with its time and meaning.
_TURNS = (
    "detachments",
    "time_masked",
    *(f"pull_off_{name}" for name in ("load", "time", "displacement")),
    *(f"lowest_load{name}" for name in ("", "_time", "_displacement")),
    *(f"jump_in_{name}" for name in ("load", "time", "displacement")),
)
_EVER = {
    "ever_detached": ("first_detachment", "contacts that detached"),
    "ever_masked": ("first_masked", "contacts that were masked at some time"),
}


def events(dataset: xr.Dataset) -> xr.Dataset:
    """Return the events of a run, once per member, or once for all if the members agree.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        Without the dimension ``t``; what a scene cannot have is left out.

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
        - ``total_dissipated`` [J]: by opening and closing, to the end of the run.
        - ``loop_energy``, ``loop_dissipation`` [J]: means over the cycles there and back; see ``loop_energy``.
        - ``peak_stress`` [Pa], ``peak_time`` [s], ``peak_speed`` [m/s], and ``peak_friction`` [N] with
          ``peak_friction_time``, ``peak_friction_speed``: of a start or a ramp; see ``peaks``.
        - ``slip_count``, ``static_friction``, ``kinetic_friction`` [N], ``slip_amplitude`` [m] and more, of a slider
          behind a spring, ``ran_away`` and ``runaway_after`` [s] of one under a force; see ``stick_slip``.
        - ``static_threshold`` [N] and ``area_at_threshold``, of a pull from rest; see ``static_threshold``.

        Where only statistics were recorded, those of them that follow, as ``…_mean``.
    """
    dataset = plain(dataset)
    result = dataset[
        [
            f"{name}{end}"
            for name in _TURNS
            for end in ENDINGS
            if f"{name}{end}" in dataset
        ]
    ].astype(float)
    for name, (first, words) in _EVER.items():
        if first in dataset:
            result[name] = pure(dataset[first].notnull().astype(float), words)
        elif f"{first}_count" in dataset:
            share = dataset[f"{first}_count"] / dataset.attrs["members"]
            result[f"{name}_mean"] = pure(share, words)
    result = result.drop_vars(MEMBERS, errors="ignore").reset_coords(drop=True)
    for name in ("pull_off_time", "jump_in_time"):
        if name in result and MEMBERS in result[name].dims:
            is_known = result[name].notnull()
            of_all, of_some = is_known.all(MEMBERS), is_known.any(MEMBERS)
            reason = f"{QUANTITIES[name].absent} in every member"
            result[f"{name}_reason"] = xr.where(of_some & ~of_all, reason, "")
            result[name] = result[name].where(of_all)
        elif f"{name}_mean" in result:
            is_of_all = dataset[f"{name}_count"] == dataset.attrs["members"]
            result[f"{name}_mean"] = result[f"{name}_mean"].where(is_of_all)
    result = result.assign(_over_pull_offs(dataset))
    for part in (peaks, stick_slip, static_threshold):
        with where_recorded():
            result = result.merge(part(dataset), compat="no_conflicts")
    for suffix in ENDINGS:
        if f"dissipated_energy{suffix}" in dataset:
            lost = (
                dataset[f"dissipated_energy{suffix}"]
                .isel(t=-1, drop=True)
                .astype(float)
            )
            text = "total energy dissipated by opening and closing"
            result[f"total_dissipated{suffix}"] = labelled(lost, "J", text, "W")
    with contextlib.suppress(KeyError):
        result = result.assign(_of_late_jumps(dataset))
    with contextlib.suppress(ValueError), answered():
        loops = _with_bounds(
            loop_energy(dataset).mean("cycle", keep_attrs=True), dataset
        )
        if {"total_dissipated_bound", "loop_dissipation_bound"} <= {*result, *loops}:
            late = result["total_dissipated_bound"] / cycles_of(dataset)
            loops["loop_dissipation_bound"] += late
            loops["loop_dissipation_bound"].attrs["source"] = "step"
        result = result.merge(loops, compat="no_conflicts")
    return result


def _of_late_jumps(dataset: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the bound of the energy that jumps of the contact dissipate [J]; nothing if it is not known.

    The stepper opens and closes a contact at the end of a clock step, after the mount has moved on by up to its
    displacement in a step. It does at most the work of the lowest load over that displacement. A contact closes
    at most once more than it opens. Under a load a contact that opens dissipates nothing.
    """
    needed = {"dissipated_energy", "detachments", "lowest_load"}
    needed |= {"displacement", "in_contact", "first_closing"}
    is_equilibrium = word(dataset, "contact.model", "equilibrium") == "equilibrium"
    if not needed <= dataset.keys() or not bool(is_equilibrium.all()):
        return {}
    if dataset.sizes["t"] < 2 or control(dataset).kind == "load":
        return {}
    records = float(dataset["t"][1] - dataset["t"][0]) / setting(dataset, "clock.step")
    moved = abs(dataset["displacement"].astype(float).diff("t")).max("t") / records
    closes = dataset["first_closing"].notnull()
    starts_open = dataset["in_contact"].isel(t=0, drop=True) == 0.0
    closings = (dataset["detachments"] + starts_open).where(closes, 0.0)
    jumps = dataset["detachments"] + closings
    bound = jumps * abs(dataset["lowest_load"]).fillna(0.0) * moved
    return {"total_dissipated_bound": bound.assign_attrs(source="step")}


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


def _over_pull_offs(dataset: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the means over the pull-offs of a member, and their number; empty if no member has several."""
    if "phase_pull_off_load" not in dataset:
        return {}
    each = pull_offs(dataset)
    load, count = each["pull_off_load"], each["pull_off_load"].count("phase")
    if bool((count <= 1).all()):
        return {}
    text = "of the loads over the pull-offs of a member"
    return {
        "pull_off_load": labelled(load.mean("phase"), "N", f"mean {text}"),
        "pull_off_displacement": each["pull_off_displacement"].mean(
            "phase", keep_attrs=True
        ),
        "pull_offs": pure(count.astype(float), "number of phases with a pull-off"),
        "pull_off_load_least": labelled(load.min("phase"), "N", f"least {text}"),
        "pull_off_load_largest": labelled(load.max("phase"), "N", f"largest {text}"),
    }


def peaks(dataset: xr.Dataset) -> xr.Dataset:
    """Return the friction peak after a start from rest, and the friction maximum of a ramp of the speed.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        ``peak_stress`` [Pa], the largest magnitude of the shear stress while sliding; ``peak_time`` [s], from
        where sliding starts; ``peak_speed`` [m/s]; and ``peak_friction`` [N], ``peak_friction_time`` and
        ``peak_friction_speed``, the same of the friction force. Empty under any other drive, and of members that
        differ: their largest value is that of the noise.

    Notes
    -----
    Peaks are those of the clock steps, refined between them. nan where there is none: the value at the end of the run,
    or on a ramp that at its start, is as large. A start may peak at once, when the stress falls from what it was at
    rest.
    """
    dataset = plain(dataset)
    drive = word(dataset, "drive.model", "")
    ramp, start = drive == "ramp", drive == "start"
    if not bool((ramp | start).any()):
        return xr.Dataset()
    result, phased = {}, "phase_start" in dataset
    last = dataset["phase_start"].count("phase") - 1 if phased else xr.DataArray(0)
    beginning = (
        dataset["phase_start"].isel(phase=last).where(start, 0.0)
        if phased
        else xr.DataArray(0.0)
    )
    for name, source, unit in _PEAKS:
        if (
            name not in dataset
            or source not in dataset
            or MEMBERS in dataset[name].dims
        ):
            continue
        prefix, ends = (
            name.removesuffix("_stress"),
            abs(dataset[source].astype(float)).isel(t=[0, -1]),
        )
        read = {
            key: dataset[key] for key in (name, f"{prefix}_time", f"{prefix}_speed")
        }
        if phased:
            read = {
                key: dataset[f"phase_{key}"].isel(phase=last).where(start, whole)
                for key, whole in read.items()
            }
        size, when, speed = read.values()
        before, after = (
            size / (1.0 + _ROUNDING) > ends.isel(t=k, drop=True) for k in (0, 1)
        )
        known = (ramp | start) & after & (~ramp | before)
        text = f"largest {dataset[source].attrs.get('long_name', source)} while sliding"
        described = {
            name: (size, unit, text),
            f"{prefix}_time": (
                when - beginning,
                "s",
                f"time from the start of sliding to the {text}",
            ),
            f"{prefix}_speed": (speed, "m/s", f"sliding speed at the {text}"),
        }
        if bool(ramp.any()):
            late = _late_by_steps(dataset, when, speed)
            described[f"{prefix}_time"] = (
                when - beginning - late.time.where(ramp, 0.0),
                *described[f"{prefix}_time"][1:],
            )
            described[f"{prefix}_speed"] = (
                late.speed.where(ramp, speed),
                *described[f"{prefix}_speed"][1:],
            )
            described[f"{prefix}_time_bound"] = late.time_bound, "s", ""
            described[f"{prefix}_speed_bound"] = late.speed_bound, "m/s", ""
        for key, (values, *about) in described.items():
            result[key] = labelled(
                values.where(known).drop_vars("phase", errors="ignore"), *about
            ).assign_attrs({"source": "step"} if key.endswith("_bound") else {})
    return xr.Dataset(result)


#: Relaxation rate times half a clock step from which on bonds have forgotten the step before.
_FORGOTTEN = 10.0


class Late(NamedTuple):
    """Time by which a maximum along a ramp is found late, the speed at its true time, and what may be left of both."""

    time: xr.DataArray
    speed: xr.DataArray
    time_bound: xr.DataArray
    speed_bound: xr.DataArray


def _late_by_steps(
    dataset: xr.Dataset, when: xr.DataArray, speed: xr.DataArray
) -> Late:
    """Return by how much the clock step makes a maximum late that is found at a time [s] and a speed [m/s] of a ramp.

    Notes
    -----
    During a clock step dt bonds have the mean speed of the step, which is that at its
    middle, but time and speed of a sample are those at its end. Bonds without a memory
    are therefore found dt/2 late. Bonds that relax exponentially at a rate k have the
    delay ``dt/2 coth(x)`` with ``x = k dt/2`` in place of 1/k. They are found L(x) dt/2
    late, with Langevin's function ``L(x) = coth(x) - 1/x``. The rate k is that of
    rebinding over the share of bonds that is left, as in a rate equation.

    Two errors remain. In other models k may differ by a factor, which changes the delay
    by about 1/k. The maximum between samples is that of a parabola, whose vertex is off
    by dt² f'''/(6 f''). Over the logarithm of the speed the third derivative of the stress
    is at most about three times the second, and a linear ramp adds three. With the
    relative change h of the speed in a step the vertex is therefore off by at most h dt.
    Bonds that remember a step (x < 10) are sought by their slopes at the speed of the
    samples, and their maximum is only known to a step.
    """
    step, duration = setting(dataset, "clock.step"), setting(dataset, "clock.duration")
    is_log = word(dataset, "drive.scale", "") == "log"
    first, last = (speed_of(dataset).isel(t=k, drop=True) for k in (0, -1))
    with contextlib.suppress(KeyError):  # tables of a drive that are swept whole
        first, last = (setting(dataset, f"drive.{end}") for end in ("from", "to"))
    size = abs(speed)
    ratio = abs(last / first.where(is_log, 1.0)).where(is_log, 1.0)
    # the growth of the magnitude of the speed
    slope = (size * np.log(ratio)).where(is_log, (last - first) * np.sign(speed))
    slope = slope / duration
    memory = xr.DataArray(math.inf)
    with contextlib.suppress(KeyError):
        memory = setting(dataset, "bonds.rebinding_rate")
        if "bond_fraction" in dataset and MEMBERS not in dataset["bond_fraction"].dims:
            at = when.fillna(0.0)
            left = dataset["bond_fraction"].sel(t=at, method="nearest").drop_vars("t")
            memory = memory / left
    half = 0.5 * memory * step
    with np.errstate(over="ignore", divide="ignore"):
        exact = 1.0 / np.tanh(half) - 1.0 / half
        langevin = xr.where(half > 1e-3, exact, half / 3.0)
    late = 0.5 * step * langevin
    change = abs(slope) / size.where(size > 0.0)
    bound = (step * step * change + 1.0 / memory).where(half >= _FORGOTTEN, step)
    earlier = (size * np.exp(-slope / size * late)).where(is_log, size - slope * late)
    return Late(late + 0.0 * when, earlier, bound, change * size * bound)


def static_threshold(dataset: xr.Dataset) -> xr.Dataset:
    """Return the static threshold: the first maximum of the friction after a start from rest, and the area at it.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive that starts from rest at a constant control of the contact.

    Returns
    -------
    xarray.Dataset
        ``static_threshold`` [N]; ``area_at_threshold`` [1], the contact area there over that at rest; and
        ``threshold_after`` [s], the time of the threshold. nan if the friction does not fall by 1 % from its first
        maximum before it exceeds the maximum again. Empty of other drives.

    Notes
    -----
    The maximum is that of the clock steps of each member, refined between them. If members differ, each has its own
    threshold. The first maximum from which noise takes 1 % may then come before the maximum of the mean, and it is
    lower. If the relative noise of the friction is of the order of 1 %, read the peak of the mean instead
    (``ensemble_peaks``).
    """
    area = dataset.get("static_threshold_area")
    if area is None:
        return xr.Dataset()
    text = "first maximum of the friction force after a start from rest"
    share = area.astype(float) / dataset["contact_area"].isel(t=0, drop=True)
    return xr.Dataset(
        {
            "static_threshold": labelled(
                dataset["static_threshold"].astype(float), "N", text
            ),
            "area_at_threshold": pure(
                share, f"contact area at the {text} over that at rest"
            ),
            "threshold_after": labelled(
                dataset["static_threshold_time"].astype(float),
                "s",
                f"time of the {text}",
            ),
        }
    )


def loop_energy(dataset: xr.Dataset) -> xr.Dataset:
    """Return the work put into the contact in each cycle, and the energy dissipated in it.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a scene whose load, indentation or displacement makes cycles.

    Returns
    -------
    xarray.Dataset
        ``loop_energy`` and ``loop_dissipation`` [J], with the dimension ``cycle`` (1, 2, ...) last: per member,
        or ``…_mean`` where only statistics were recorded. nan in a cycle in which the load's place is not
        known, as when a sphere at a load flies off, or the trajectory stops.

    Raises
    ------
    ValueError
        If nothing makes cycles.

    Notes
    -----
    ``loop_energy`` is the closed integral of P dΔ with Δ the displacement of the base (the indentation,
    where that or a load is prescribed), by the trapezoidal rule over the records. A jump between two records is
    drawn as a straight line, so each costs up to half its load times the displacement of one record;
    elsewhere the error falls with the square of the time between records.

    ``loop_dissipation`` is the growth of ``dissipated_energy``. Where the work of adhesion stays what it is and the
    contact follows equilibrium it is the whole loop: all the work is dissipated in jumps. With
    bonds that break and heal, or fluctuations, the work of adhesion itself does work over a cycle.
    """
    cycles = cycles_of(dataset)
    if not bool((cycles >= 1.0).any()):
        cure = 'give some, such as [contact] load = { from = "4 mN", to = "-1 mN", cycles = 2 }'
        raise ValueError(f"neither load nor position moves in cycles; {cure}")
    count = int(cycles.max())
    suffix = "" if "normal_load" in dataset else "_mean"
    read = (
        f"{name}{suffix}"
        for name in (
            "contact_radius",
            "normal_load",
            "displacement",
            "dissipated_energy",
        )
    )
    dims = (*sweep_dims(dataset), MEMBERS)
    return in_pieces(
        with_trajectories(dataset, *read),
        dims,
        lambda piece: _loops(piece, suffix, count),
    )


def _loops(dataset: xr.Dataset, suffix: str, count: int) -> xr.Dataset:
    """Return ``loop_energy`` and ``loop_dissipation`` in each of ``count`` cycles."""
    cycles = cycles_of(dataset)
    going = dataset[f"contact_radius{suffix}"].notnull()
    load, displacement = (
        dataset[[f"normal_load{suffix}", f"displacement{suffix}"]]
        .astype(float)
        .where(going)
        .values()
    )
    number = xr.DataArray(np.arange(dataset.sizes["t"]), dims="t")
    done = (
        0.5 * (load + load.shift(t=1)) * (displacement - displacement.shift(t=1))
    ).where(number > 0, 0.0)
    period = setting(dataset, "clock.duration") / cycles.where(cycles >= 1.0)
    put_in = done.fillna(0.0).cumsum("t")
    rounding = _NOTHING * abs(put_in).max("t")
    ends = period * xr.DataArray(np.arange(count + 1), dims="end")
    ends = ends.where(ends <= float(dataset["t"][-1]) + 1e-6 * period)
    series = done.isnull().cumsum("t"), put_in, dataset[f"dissipated_energy{suffix}"]
    missing, *gained = (
        _growth(values, dataset["t"], ends).rename(end="cycle") for values in series
    )
    texts = {"loop_energy": "closed integral of the load over the displacement"}
    texts["loop_dissipation"] = "energy dissipated by opening and closing"
    result = {}
    for (name, text), values in zip(texts.items(), gained, strict=True):
        values = values.where(~(abs(values) < rounding), 0.0).where(missing == 0.0)
        values = values.transpose(..., MEMBERS, "cycle", missing_dims="ignore")
        result[f"{name}{suffix}"] = values.assign_attrs(
            units="J", long_name=f"{text}, over a cycle", symbol=""
        )
    return xr.Dataset(
        result,
        {
            "cycle": (
                "cycle",
                np.arange(1, count + 1),
                {"long_name": "number of the cycle"},
            )
        },
    )


def _with_bounds(loops: xr.Dataset, dataset: xr.Dataset) -> xr.Dataset:
    """Return means over cycles with bounds, or with a reason if the records are too few.

    The bound is the sum of the changes if every second and every fourth record is left:
    one change alone may vanish by chance. A contact that opens or closes adds half of the
    load times the displacement between its two records.
    """
    cycles = cycles_of(dataset)
    is_fine = dataset.sizes["t"] > _RECORDS * cycles
    result = loops.where(is_fine)
    if "loop_energy" not in loops:
        return result
    last = dataset.sizes["t"] - 1  # the end of a cycle, which stays
    thinned = [
        loop_energy(dataset.isel(t=[*range(0, last, step), last])).mean("cycle")
        for step in (2, 4)
    ]
    bounds = abs(loops - xr.concat(thinned, "step")).sum("step", skipna=False)
    read = ("normal_load", "displacement", "in_contact")
    load, displacement, closed = dataset[[*read]].astype(float).diff("t").values()
    boxes = abs(load * displacement).where(closed != 0.0, 0.0)
    bounds["loop_energy"] = bounds["loop_energy"] + 0.5 * boxes.sum("t") / cycles
    reason = f"fewer than {_RECORDS} records in a cycle"
    for name, bound in bounds.items():
        result[f"{name}_bound"] = bound.where(is_fine).assign_attrs(source="records")
        result[f"{name}_reason"] = xr.where(is_fine, "", reason)
    return result


def cycles_of(dataset: xr.Dataset) -> xr.DataArray:
    """Return the number of cycles of the control of the contact, with the sweep's dimensions; 0 if there are none."""
    with contextlib.suppress(KeyError):
        return setting(dataset, f"contact.{control(dataset).kind}.cycles")
    return xr.DataArray(0.0)


# --- peaks of the mean of members with noise, with errors, or the reason for none ---

#: Quantities whose peak is stated, with the beginnings of the names of its time and speed.
_PEAKS_OF_MEAN = {
    "peak_stress": ("shear_stress", "peak"),
    "peak_friction": ("friction_force", "peak_friction"),
}
#: Chance of a peak out of noise; resampled ensembles for the error of its time; share of the records after it.
_CHANCE, _RESAMPLED, _AFTER = 0.01, 200, 8
#: Standard errors by which estimates of a peak over different numbers of records may differ.
_ALIKE = 2.0
#: Dimensions of a quantity of each member.
_EACH = [MEMBERS, "t"]
#: Records that a peak needs: an eighth of them are its end.
_FEWEST = 8


class Peak(NamedTuple):
    """Peak of the mean of members, its standard error, time, and the ends of both intervals; or why there is none."""

    reason: str
    value: float = math.nan
    sem: float = math.nan
    low: float = math.nan
    high: float = math.nan
    time: float = math.nan
    first: float = math.nan
    last: float = math.nan


def peak_of_mean(values: Array, times: Array, unit: str = "1") -> Peak:
    """Return the peak of the mean of members with noise, after the first of their records.

    Parameters
    ----------
    values : array, shape (members, records)
        All known.
    times : array, shape (records,)
        Since the first record [s], evenly spaced.
    unit : str
        Of the values, for the reason.

    Notes
    -----
    The mean must rise above the first record and above the mean over the last eighth by more than noise does in one of
    a hundred runs: by Student's law for the largest of as many values as there are records. A parabola through the
    records about the largest moving average gives value and time. Its width is doubled as long as the estimates agree
    within two of the standard errors of their differences (Lepski's rule). The error is that of the members under these
    weights; that of the time is from ensembles drawn from these members, and at least half a record.
    """
    members, records = values.shape
    mean, free, tail = values.mean(axis=0), members - 1.0, np.zeros(records)
    tail[-max(1, records // _AFTER) :] = 1.0 / max(1, records // _AFTER)
    last = records - max(1, records // _AFTER)

    def error(weights: Array) -> float:
        return (
            float(np.std(values @ weights, ddof=1)) / math.sqrt(members)
            if members > 1
            else math.nan
        )

    weights, _ = _top(mean, 0, last)
    place = int(np.argmax(weights))
    surely = float(special.stdtrit(free, 1.0 - _CHANCE / records))
    for base in (tail, np.eye(1, records)[0]):
        if not (weights - base) @ mean > surely * error(weights - base):
            most, end, when = (
                engineering(*number)
                for number in (
                    (mean[place], unit),
                    (float(tail @ mean), unit),
                    (float(times[place]), "s"),
                )
            )
            return Peak(
                f"no peak above the noise: at most {most} after {when}, {end} at the end"
            )
    if place < 3:
        step = engineering(float(times[place]) / 4.0, "s")
        return Peak(
            f"too few records to resolve the peak: record every {step} or more often"
        )
    tried, width = [_top(mean, 0, last)], 1
    # an average about a record before the last eighth has as many after it
    while 2 * width <= min(place, records - last + 1):
        weights, at = _top(mean, width, last)
        if any(
            abs((weights - other) @ mean) > _ALIKE * error(weights - other)
            for other, _ in tried
        ):
            break
        tried, width = [*tried, (weights, at)], 2 * width
    (weights, at), width = tried[-1], width // 2
    rng = np.random.default_rng(0)  # the same interval each time
    drawn = (
        rng.multinomial(members, np.full(members, 1.0 / members), size=_RESAMPLED)
        / members
        @ values
    )
    ends = np.quantile(
        [_top(each, width, last)[1] for each in drawn],
        [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL],
    )
    value, sem, records_at = float(weights @ mean), error(weights), np.arange(records)
    half = float(special.stdtrit(free, 0.5 + 0.5 * LEVEL)) * sem
    between = max(
        0.0, 0.125 * float(np.array([-1.0, 2.0, -1.0]) @ mean[place - 1 : place + 2])
    ) * (width < 2)
    time, first, stop = np.interp([at, ends[0] - 0.5, ends[1] + 0.5], records_at, times)
    return Peak(
        "",
        value,
        sem,
        value - half,
        value + half + between,
        float(time),
        float(first),
        float(stop),
    )


def _top(mean: Array, width: int, last: int) -> tuple[Array, float]:
    """Return the weights of the records whose sum is the peak before the record ``last``, and its place.

    It is the largest value, or if the ``width`` is two or more records to both sides the vertex of a parabola.
    """
    sums = np.append(0.0, np.cumsum(mean))
    # of centres width, ..., last - 1
    averages = sums[2 * width + 1 : last + width] - sums[: last - width - 1]
    begin = 1 if width == 0 else 0
    place = width + begin + int(np.argmax(averages[begin:]))
    weights, at = np.zeros(len(mean)), float(place)
    if width < 2:
        weights[place] = 1.0
        return weights, at
    chosen = slice(place - width, place + width + 1)
    fit = np.linalg.pinv(np.vander(np.linspace(-1.0, 1.0, 2 * width + 1), 3))
    curvature, slope, _ = fit @ mean[chosen]
    vertex = (
        float(np.clip(-0.5 * slope / curvature, -1.0, 1.0)) if curvature < 0.0 else 0.0
    )
    weights[chosen] = np.array([vertex**2, vertex, 1.0]) @ fit
    return weights, at + vertex * width


def ensemble_peaks(dataset: xr.Dataset) -> xr.Dataset:
    """Return the peaks of stress and friction of members with noise, while sliding after a rest or along a ramp.

    Returns
    -------
    xarray.Dataset
        ``peak_stress_mean`` [Pa] and ``peak_friction_mean`` [N] with ``…_sem``, ``…_low``, ``…_high`` and ``…_reason``,
        see ``peak_of_mean``; time since sliding starts, ``peak_time_mean`` and ``peak_friction_time_mean`` [s], and
        speed then, ``peak_speed_mean`` and ``peak_friction_speed_mean`` [m/s], with ``…_low``, ``…_high``. Empty under
        any other drive, and of members that do not differ. Peaks of friction are of the contacts that stay closed.
    """
    dataset = plain(dataset)
    drive, result = word(dataset, "drive.model", ""), xr.Dataset()
    if (
        not bool(((drive == "ramp") | (drive == "start")).any())
        or "speed" not in dataset
    ):
        return result
    rest = xr.DataArray(0.0)
    if "phase_start" in dataset:  # the last phase of a start is sliding
        starts = dataset["phase_start"]
        sliding = starts.isel(phase=starts.count("phase") - 1)
        rest = sliding.drop_vars("phase", errors="ignore").where(drive == "start", 0.0)
    times, sweep = dataset["t"], xr.zeros_like(dataset["contact_modulus"], float)
    onset, speeds = (
        (times >= rest - 1e-6 * times[-1]).argmax("t"),
        abs(speed_of(dataset)) + sweep,
    )
    for name, (source, prefix) in _PEAKS_OF_MEAN.items():
        is_recorded = source in dataset
        if f"{source}_mean" not in dataset and not (
            is_recorded and MEMBERS in dataset[source].dims
        ):
            continue
        unit = dataset[source if is_recorded else f"{source}_mean"].attrs.get(
            "units", "1"
        )
        values = (
            observable_of(dataset, source)
            if is_recorded
            else xr.DataArray(np.empty((0, times.size)), dims=_EACH)
        )
        how: Any = {
            "input_core_dims": [_EACH, ["t"], [], ["t"]],
            "output_core_dims": [[]] * 11,
            "vectorize": True,
        }
        how |= {"output_dtypes": [object, *"dddddddddd"], "kwargs": {"unit": unit}}
        reason, *numbers = xr.apply_ufunc(
            _peak_since, values, speeds, onset, times, **how
        )
        when, at = numbers[4:7], numbers[7:]
        is_ramp = drive == "ramp"
        if bool(is_ramp.any()):
            late = _late_by_steps(dataset, when[0], at[0])
            share = (late.speed / at[0]).where(is_ramp, 1.0)
            when = [each - late.time.where(is_ramp, 0.0) for each in when]
            numbers[4:] = [*when, *(each * share for each in at)]
        text = f"peak of the mean of the {source.replace('_', ' ')}"
        described: dict[str, Any] = {
            f"{name}_{kind}": (unit, text) for kind in ("mean", "sem", "low", "high")
        }
        for of, *about in (
            ("time", "s", f"time of sliding to the {text}"),
            ("speed", "m/s", f"speed at the {text}"),
        ):
            described |= {
                f"{prefix}_{of}_{end}": about for end in ("mean", "low", "high")
            }
        for (key, about), column in zip(described.items(), numbers, strict=True):
            result[key] = labelled(column, *about)
        result[f"{name}_reason"] = reason.drop_attrs(deep=False).assign_attrs(
            long_name=f"reason for no {text}"
        )
    return result


def _peak_since(
    values: Array, speeds: Array, first: int, times: Array, unit: str
) -> tuple[Any, ...]:
    """Return the fields of the ``Peak`` of the members after a record, and the speed at its time and interval."""
    if not len(values):
        return *Peak(
            "the peak of members with noise needs every member: [record] per_member = true"
        ), *[math.nan] * 3
    known, since = np.abs(values[:, first:]), times[first:] - times[first]
    known = known[np.isfinite(known).all(axis=-1)]
    is_enough = len(known) > 1 and known.shape[1] >= _FEWEST
    peak = (
        peak_of_mean(known, since, unit)
        if is_enough
        else Peak("too few records or members")
    )
    return *peak, *np.interp(peak[-3:], since, speeds[first:])


# --- lifetimes of members, of which some are longer than the run: medians and rates ---


class Lifetime(NamedTuple):
    """Median and rate of an event, with the ends of their 95 % intervals; nan if the runs are too short.

    ``half`` [s] is the time at which the event has occurred in half of the members. ``rate`` [1/s] is the number of
    events per exposure time.
    """

    half: float
    half_low: float
    half_high: float
    rate: float
    rate_low: float
    rate_high: float


def lifetime(
    times: Array, ends: Array | float, begins: Array | float = 0.0
) -> Lifetime:
    """Return the median and the rate of an event that may come after a run's end.

    Parameters
    ----------
    times : array, shape (members,)
        When it happened [s]; nan where it did not.
    ends : float or array
        Until when each member was watched [s]; nan if it could not happen in a member, which then does not count.
    begins : float or array
        From when on it could happen in each member [s], such as the time at which its contact closed; nan as above.

    Notes
    -----
    Members are at risk from when on it could happen, and count only from then on (left truncation). The median is that
    of Kaplan and Meier's survival; its interval, after Brookmeyer and Crowley, holds the times at which the log-log
    interval of the survival has one half. The interval of the rate is that of a Poisson process, from chi-square.

    Examples
    --------
    Three of four members detach within 10 s:

    >>> result = lifetime(np.array([2.0, 5.0, 7.0, np.nan]), 10.0)
    >>> print(f"{result.half:.0f} s, {result.rate:.3f} /s, {result.rate_low:.2f} to {result.rate_high:.2f} /s")
    5 s, 0.125 /s, 0.03 to 0.37 /s
    """
    watched = np.where(np.isfinite(times), times, ends)
    since = np.broadcast_to(begins, watched.shape)
    counts = (watched > since) | ((since == 0.0) & ~np.isnan(watched))
    happened, watched, since = (
        np.isfinite(times)[counts],
        watched[counts],
        since[counts],
    )
    half = low = high = np.nan
    if np.any(happened) and np.all(np.isfinite(watched)):
        times, *curves = _kaplan_meier(watched, happened, since)
        below = [np.flatnonzero(curve <= 0.5) for curve in curves]
        half, low, high = (times[one[0]] if one.size else np.nan for one in below)
    count, exposure, tail = (
        float(happened.sum()),
        float(np.sum(watched - since)) or np.nan,
        0.5 - 0.5 * LEVEL,
    )
    if np.isnan(low) and watched.size and not np.any(since):
        going = watched.size - count
        if going and special.betaincinv(going, count + 1.0, tail) > 0.5:
            low = float(np.min(watched[~happened]))
    least = special.gammaincinv(count, tail) if count else 0.0
    most = special.gammaincinv(count + 1.0, 1.0 - tail)
    return Lifetime(
        half, low, high, count / exposure, least / exposure, most / exposure
    )


def _kaplan_meier(watched: Array, happened: Array, begins: Array) -> list[Array]:
    """Return the times of events and ends, Kaplan and Meier's survival then, and the ends of its 95 % interval.

    The numbers are those of ``scipy.stats.ecdf``, which takes no left truncation, and whose import would make the start
    of ``sim run`` a quarter longer. They are nan if nobody was watched for a while.
    """
    times, places, counts = np.unique(watched, return_inverse=True, return_counts=True)
    events, at_risk = (
        np.bincount(places, happened),
        watched.size - np.cumsum(counts) + counts,
    )
    at_risk = at_risk - np.sum(
        (begins > 0.0) & (begins >= times[:, np.newaxis]), axis=1
    )
    left = at_risk - events
    if np.any(left[:-1] <= 0):  # nobody was watched for a while
        return [times, *np.full((3, times.size), np.nan)]
    survival = (
        left / watched.size
        if np.all(happened) and not np.any(begins)
        else np.cumprod(left / at_risk)
    )
    # there is no interval if the survival is 1 or 0
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.log(survival)
        width = WIDE * np.sqrt(np.cumsum(events / (at_risk * left))) / np.abs(logarithm)
        ends = [
            np.exp(-np.exp(np.log(-logarithm) + side * width)) for side in (1.0, -1.0)
        ]
    if happened.sum() < 2:
        ends = [np.full(times.size, np.nan)] * 2
    return [times, survival, *ends]


def survival(dataset: xr.Dataset, event: str) -> xr.Dataset:
    """Return the share of the members that an event has not reached yet, over time.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, with each member recorded.
    event : str
        Name of the time of the event: ``"first_masked"`` or ``"first_detachment"``.

    Returns
    -------
    xarray.Dataset
        ``survival`` with the ends ``low`` and ``high`` of its 95 % interval [1], over the dimension ``time`` [s] since
        the start of the run: the times of the event in all members and points of the sweep, and the end of the run.
        The estimate is that of Kaplan and Meier with log-log intervals, because the run ends before the event has
        reached all members (censoring). Members count from the time at which their contact closes. The numbers are nan
        after the last member is gone.
    """
    times = dataset[event].astype(float)
    begins, end = _at_risk_from(dataset, times), float(dataset["t"][-1])
    grid = np.unique(np.append(times.to_numpy()[np.isfinite(times.to_numpy())], end))

    def curves(times: Array, begins: Array) -> Array:
        watched = np.where(np.isfinite(times), times, end)
        counts = (watched > begins) | ((begins == 0.0) & ~np.isnan(watched))
        result = np.full((3, grid.size), np.nan)
        if not counts.any():
            return result
        places, *values = _kaplan_meier(
            watched[counts], np.isfinite(times)[counts], begins[counts]
        )
        before = np.searchsorted(places, grid, side="right") - 1
        start = np.array([1.0, np.nan, np.nan])[:, np.newaxis]
        return np.where(before < 0, start, np.array(values)[:, before])

    how: Any = {
        "input_core_dims": [[MEMBERS]] * 2,
        "output_core_dims": [["estimate", "time"]],
        "vectorize": True,
    }
    result = xr.apply_ufunc(curves, times, begins.broadcast_like(times), **how)
    words = dataset[event].attrs.get("long_name", event)
    texts = {
        "survival": f"share of the members before the {words}",
        "low": "lower end of its 95 % interval",
        "high": "upper end of its 95 % interval",
    }
    return xr.Dataset(
        {
            name: pure(result.isel(estimate=k), text)
            for k, (name, text) in enumerate(texts.items())
        },
        {"time": ("time", grid, {"units": "s", "long_name": "time since the start"})},
    )


def _at_risk_from(dataset: xr.Dataset, times: xr.DataArray) -> xr.DataArray:
    """Return the times from which on members are in contact [s], nan if they never are."""
    if not {"contact_radius", "first_closing"} <= dataset.keys():
        return xr.zeros_like(times, float)
    closed = dataset["contact_radius"].isel(t=0, drop=True) > 0.0
    start = float(dataset["t"][0])
    return (dataset["first_closing"] - start).where(~closed, 0.0)


def half_lives(dataset: xr.Dataset) -> xr.Dataset:
    """Return median times of first detachment and masking, and rates if the run is stationary."""
    result = xr.Dataset()
    happened = {
        "first_detachment": ("detached", "detached"),
        "first_masked": ("masked", "had their adhesion masked"),
    }
    for event, words in happened.items():
        if event not in dataset:
            continue
        lives = lifetimes(dataset, dataset[event].astype(float), *words)
        # an event that no scene of the sweep knows is not waited for
        if not bool(dataset[event].notnull().any()):
            lives = lives.drop_vars([name for name in lives if "half_" in str(name)])
        result.update(lives)
    return (
        result
        if is_stationary(dataset)
        else result.drop_vars([name for name in result if "_rate" in str(name)])
    )


def lifetimes(
    dataset: xr.Dataset, times: xr.DataArray, name: str, words: str
) -> xr.Dataset:
    """Return the median and the rate of an event, at each point of the sweep.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    times : xarray.DataArray
        When it first happened in each member [s], nan where it did not: ``events(dataset)["first_detachment"]``.
    name, words : str
        What the variables are named by, and what has happened: ``"detached"``, ``"detached"``.

    Returns
    -------
    xarray.Dataset
        ``half_<name>`` and ``<name>_rate``, with ``…_low`` and ``…_high``; see ``lifetime``. Members that are open from
        the start count from the time at which they close, and never if they are never in contact. Empty where
        members do not differ.
    """
    if MEMBERS not in times.dims:
        return xr.Dataset()
    start, end = (float(dataset["t"][record]) for record in (0, -1))
    begins = _at_risk_from(dataset, times)
    how: Any = {
        "input_core_dims": [[MEMBERS]] * 3,
        "output_core_dims": [[]] * 6,
        "vectorize": True,
    }
    watched = xr.full_like(times, end - start, float)
    estimates = iter(
        xr.apply_ufunc(
            lifetime, times - start, watched, begins.broadcast_like(times), **how
        )
    )
    result = xr.Dataset()
    for key, unit, text in (
        (f"half_{name}", "s", f"time at which half of the members have {words}"),
        (f"{name}_rate", "1/s", f"rate at which members have {words}"),
    ):
        for side in ("", "low", "high"):
            about = f"{side} end of the 95 % interval of the {text}" if side else text
            result[f"{key}_{side}" if side else key] = labelled(
                next(estimates), unit, about
            )
    return result
