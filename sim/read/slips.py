"""Slip events of a slider behind a spring, its static and kinetic friction, and losses of stability under a force."""

import contextlib

import numpy as np
import xarray as xr

from sim.quantities import SLIP_EVENT
from sim.read.correlation import WIDE
from sim.read.dataset import (
    MEMBERS,
    ensemble_mean,
    is_stationary,
    only_statistics,
    recorded_share,
    setting,
    speed_of,
    word,
)
from sim.read.estimate import Estimate, Estimates, of_every_member
from sim.read.observables import defined, labelled, share_of_members
from sim.read.statistics import summary

#: Path of the stage in a clock step over the advance in a slip event, above which the event is not resolved.
_COARSE = 0.02
#: Share of a clock step up to which a time is one of the clock steps, because both are rounded.
_ON_STEP = 1e-3
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
        the stage [m/s], ``static_friction`` and ``force_drop`` [N].

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
    if only_statistics(dataset):
        raise ValueError(
            "slip events need every member; record them: [record] per_member = true"
        )
    if not bool((word(dataset, "drive.model", "") == "spring").any()):
        raise ValueError(
            'slips need a stage that pulls through a spring: [drive] model = "spring"'
        )
    event = {name: dataset[f"slip_{name}"].astype(float) for name in SLIP_EVENT}
    begins, ends, following = event["time"], event["end"], event["time"].shift(slip=-1)
    columns = {
        "slip_time": begins,
        "slip_duration": ends - begins,
        "stick_duration": following - ends,
        "recurrence_time": following - begins,
        "slip_amplitude": event["amplitude"],
        "slip_speed": event["speed"],
        "static_friction": event["force_before"],
        "force_drop": event["force_before"] - event["force_after"],
    }
    result = xr.Dataset({name: defined(name, each) for name, each in columns.items()})
    return result.transpose(..., "slip")


def stick_slip(dataset: xr.Dataset) -> Estimates:
    """Return the mean stick and slip of each member, static and kinetic friction.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    dict of str to Estimate
        Under a stage ``slip_count``, and the means over the slip events of what ``slips`` has of each; of a stage at
        one speed those that begin in the second half of the run, with ``…_least`` and ``…_largest`` of
        ``static_friction``, ``force_drop``, ``slip_amplitude`` and ``recurrence_time``. ``slip_spread`` [1]: the
        standard deviation of their displacements over its mean. ``kinetic_friction`` [N]: see ``kinetic_friction``.

        Of a stage that gets faster ``onset_steady_speed`` and ``onset_slip_speed`` [m/s]: its speed at the first slip
        event, and the speed one recurrence time earlier, when another event would have come if the slider had already
        stuck and slipped. Of a stage that gets slower ``end_slip_speed`` and ``end_steady_speed``: its speed at the
        last slip event, and one recurrence time later. They are nan with fewer than two slip events, or if slip events
        begin at the start or last to the end of such a phase.

        Under a prescribed force see ``runaways``. Empty for other drives. Where only statistics were recorded, those of
        the means over late slip events.
    """
    if "stage_speed" not in dataset and {"runaway_time", "spring_force"} <= {*dataset}:
        return runaways(dataset)
    at_one_speed = "slip_count_late" in dataset
    sources = {"slip_count": "slip_count_late" if at_one_speed else "slip_count"}
    sources |= {name: f"late_{quantity}_mean" for name, quantity in _LATE.items()}
    sources |= {
        f"{name}_{kind}": f"late_{of}_{kind}"
        for name, of in _LATE.items()
        for kind in ("least", "largest")
    }
    sources |= {name: name for name in _ONSET}
    found = {
        name: Estimate(dataset[source].astype(float))
        for name, source in sources.items()
        if source in dataset
    }
    has_single = "slip_time" in dataset and not only_statistics(dataset)
    if not has_single or not found:
        return found | kinetic_friction(dataset)
    if not is_stationary(dataset):
        count = defined("slip_count", dataset["slip_count"].astype(float))
        onsets = {name: found[name] for name in _ONSET if name in found}
        return onsets | {"slip_count": Estimate(count)}
    spread = dataset["late_amplitude_std"] / dataset["late_amplitude_mean"]
    found |= kinetic_friction(dataset)
    found["slip_spread"] = Estimate(defined("slip_spread", spread))
    late_half = dataset["slip_time"] >= 0.5 * float(dataset["t"][-1])
    each = slips(dataset).where(late_half)[["slip_duration", "stick_duration"]]
    means = each.mean("slip", keep_attrs=True)
    found |= {str(key): Estimate(values) for key, values in means.items()}
    bounds, source = _of_late_slips(dataset, found), "step"
    # of one random member there is no other error than the scatter between slip events
    if MEMBERS in dataset.sizes and dataset.sizes[MEMBERS] == 1:
        source = "slip events and step"
        others = each.count("slip") - 1
        squares = ((each - each.mean("slip")) ** 2).mean("slip")
        off = (squares / others.where(others > 0)) ** 0.5
        errors = {str(key): values for key, values in off.items()}
        number = dataset["slip_count_late"]
        for name, of in _LATE.items():
            errors[name] = dataset[f"late_{of}_std"] / number**0.5
        for name in errors:
            bounds[name] = WIDE * errors[name] + bounds.get(name, 0.0)
    for name, bound in bounds.items():
        if name in found:
            bound = bound.assign_attrs(source=source)
            found[name] = found[name]._replace(bound=bound)
    return found


def _of_late_slips(dataset: xr.Dataset, means: Estimates) -> dict[str, xr.DataArray]:
    """Return bounds of the errors of means over slip events by the clock steps at which these begin and end.

    Within a step the stage extends the spring by its displacement. A slip event and a stick phase begin and end
    at clock steps, in which the slider moves on at about its mean speed in the event. So does the span over which the
    stage does work against friction. A slip event is found to begin up to a step early, and to end up to two steps late
    if it ends within the step in which it begins: such an event lasts for two steps.
    """
    step = setting(dataset, "clock.step")
    path = abs(speed_of(dataset)).max("t") * step
    amplitude, duration = (means[n].value for n in ("slip_amplitude", "slip_duration"))
    # the slider moves on in the steps at both ends of an event
    moved = path + 2.0 * step * amplitude / duration
    rise = setting(dataset, "drive.stiffness") * path
    of_each = step + 0.0 * duration
    intervals = (dataset["slip_count_late"] - 1.0).where(
        dataset["slip_count_late"] > 1.0
    )
    span = intervals * means["recurrence_time"].value
    return {
        "static_friction": rise + 0.0 * means["static_friction"].value,
        "force_drop": 2.0 * rise + 0.0 * means["force_drop"].value,
        "slip_amplitude": moved,
        "slip_spread": moved / amplitude,
        "slip_duration": 2.0 * of_each,
        "stick_duration": 3.0 * of_each,
        "recurrence_time": step / intervals,
        "kinetic_friction": means["force_drop"].value * step / span,
    }


def unresolved_slips(dataset: xr.Dataset) -> list[tuple[str, xr.DataArray]]:
    """Return remarks on falls of the force that are no slip events, and on slip events that are hardly resolved.

    Each has the points of the sweep that it holds for.
    """
    remarks = []
    count = ensemble_mean(dataset.get("slow_fall_count", xr.DataArray(0.0)))
    falls = count > 0.0
    if bool(falls.any()):
        most = float(count.max())
        number = "once" if most == 1.0 else f"{most:.3g} times"
        if float(count.where(falls).min()) < most:
            number = f"up to {number}"
        text = (
            f"{number} the spring force falls by 0.3 or more of its largest value since the slip event before or the "
            "last turn of the stage, while the slider is faster than the stage, but less than ten times: this is no "
            "slip event; if the fall takes a few clock steps only, reduce clock.step"
        )
        remarks.append((text, falls))
    # of a run without slips, or without single ones
    with contextlib.suppress(ValueError, KeyError):
        each, step = slips(dataset), setting(dataset, "clock.step")
        shares = each["slip_speed"] * step / each["slip_amplitude"]
        of_slips = [dim for dim in (MEMBERS, "slip") if dim in shares.dims]
        is_coarse = shares.median(of_slips) > _COARSE
        if bool(is_coarse.any()):
            text = (
                f"the stage moves by more than {100.0 * _COARSE:g} % of a slip event in "
                "a clock step: the drop of the spring force is off by about as much; "
                "reduce clock.step"
            )
            remarks.append((text, is_coarse))
    return remarks


def kinetic_friction(dataset: xr.Dataset) -> Estimates:
    """Return the mean friction force of sliding or of whole stick-slip cycles, if the motion has settled to them.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``spring`` with a stage at one speed.

    Returns
    -------
    dict of str to Estimate
        ``kinetic_friction`` [N] of each member, the work of the stage over its path from the first slip event in the
        second half of the run to the last, and without slip events over the second half; with the
        ``reason`` if there is none at a point of the sweep. Empty for other drives.

    Notes
    -----
    While a spring still extends, the work of the stage is stored in part. The motion has therefore settled only if the
    mean over members changes little from one part of the path to the next: by at most 0.1 % in steady sliding, and by
    1 % in cycles, whose ends are known to a clock step. Three standard errors of the change are added if members
    differ. With slip events, each part must have a whole cycle.
    """
    names = "kinetic_friction", "kinetic_friction_change", "slip_count_late"
    if not {*names} <= {*dataset}:
        return {}
    stated = summary(dataset[[*names]].assign_attrs(dataset.attrs), quantiles=False)
    mean, change, late = (stated[name].value for name in names)
    error = stated[names[1]].sem
    error = xr.zeros_like(change) if error is None else error.fillna(0.0)
    share = xr.where(late > 0.0, _SETTLED_CYCLES, _SETTLED)
    has_settled = abs(change) <= share * abs(mean) + _SURELY * error
    reasons = xr.where(change.isnull(), "no two parts of whole cycles", "not settled")
    friction = dataset[names[0]].astype(float).where(has_settled)
    return {names[0]: Estimate(friction, reason=xr.where(has_settled, "", reasons))}


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

    Notes
    -----
    A slip event is found to begin up to one clock step early. If the jump of a load or a speed at the start of a phase
    sets it off, its time is that of the clock step of the jump, or that of the step before. Such an event belongs to
    the phase if it lasts beyond this start. An event that a turn of the stage ends does not.
    """
    each, start = slips(dataset), dataset["phase_start"]
    step = setting(dataset, "clock.step")
    begins, ends, jump = (
        time / step
        for time in (
            each["slip_time"],
            each["slip_time"] + each["slip_duration"],
            start,
        )
    )
    first = np.floor(jump + _ON_STEP)
    lasts = (np.rint(begins) >= first - 1.0) & (np.rint(ends) > first)
    has_begun = (begins >= jump - _ON_STEP) | lasts
    inside = has_begun & ~has_begun.shift(phase=-1, fill_value=False)
    each["recurrence_time"] = each["recurrence_time"].where(
        inside.shift(slip=-1, fill_value=False)
    )
    result = each[list(_LATE)].where(inside).mean("slip", keep_attrs=True)
    result["slip_count"] = defined("phase_slip_count", inside.sum("slip").astype(float))
    result["start"] = labelled(start, "s", "start of a phase")
    return result.drop_vars("slip", errors="ignore").transpose(..., "phase")


def runaways(dataset: xr.Dataset) -> Estimates:
    """Return which members a prescribed force sets off, when, and at which force.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``force``.

    Returns
    -------
    dict of str to Estimate
        ``ran_away``, 1 if the slider lost stability; ``runaway_after`` [s] and ``static_friction`` [N], the force at
        that time. Both are nan, with a reason, if some members are held to the end: a mean over the others would grow
        with the length of the run.
    """
    when = dataset["runaway_time"].isel(t=-1, drop=True).astype(float)
    has_gone = share_of_members(dataset, "runaway_force", "ran_away")
    if has_gone is None:
        has_gone = defined("ran_away", when.notnull().astype(float))
    after = defined("runaway_after", when)
    force = defined("static_friction", dataset["runaway_force"].astype(float))
    reason = "not every member loses stability"
    share = recorded_share(dataset, "runaway_force")
    return {
        "ran_away": Estimate(has_gone),
        "runaway_after": of_every_member(after, reason, share),
        "static_friction": of_every_member(force, reason, share),
    }
