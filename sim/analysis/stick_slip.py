"""Stick and slip of a slider behind a spring: its slips one by one, and what each member has of them in a run."""

import itertools
import math
from typing import Any

import numpy as np
import xarray as xr

from sim.analysis.observables import ordered
from sim.analysis.scene import MEMBERS, in_pieces, is_stationary, sweep_dims, with_trajectories

#: Fall of the spring's force over its largest in the run that makes a slip.
LEAST = 0.02

#: Displacement of the slider over that of the stage above which a fall of the force is a slip.
_FASTER = 1.0 + 2.0 / math.pi
#: Speeds of a stage that gets faster or slower between which slips follow each other.
_ENDS = {
    "slips_from": "lowest speed of the stage, as it gets faster, at which a slip begins that another one follows",
    "slips_down_to": "lowest speed of the stage, as it gets slower, at which a slip begins that follows another one",
}
#: What is known of each slip: unit and meaning.
_SLIPS = {
    "slip_time": ("s", "time at which a slip begins"),
    "slip_duration": ("s", "time from the beginning of a slip to its end"),
    "stick_duration": ("s", "time from the end of a slip to the beginning of the next"),
    "recurrence_time": ("s", "time from the beginning of a slip to that of the next"),
    "slip_amplitude": ("m", "displacement of the slider in a slip"),
    "slip_speed": ("m/s", "speed of the stage at which a slip begins"),
    "static_friction": ("N", "force of the spring at which a slip begins"),
    "force_drop": ("N", "fall of the spring's force in a slip"),
    "stress_drop": ("Pa", "fall of the shear stress in a slip"),
}
_ROUNDING = 1e-9
_READ = ("spring_force", "slider_position", "stage_speed", "shear_stress")


def slips(dataset: xr.Dataset, least: float = LEAST) -> xr.Dataset:
    """Slips of a slider that a stage pulls through a spring, one by one.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``spring`` with each member recorded.
    least : float
        How much the force of the spring falls in a slip at least, over its largest in the run [1].

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
    In a slip the slider is faster than the stage, so that the spring's force falls: from a maximum to the lowest value
    before the next. It goes more than 1 + 2/π times as far as the stage, as half a cycle does of a sine that just comes
    to rest, and the stress falls, too, which it does not where the body rings upon an interface that sticks. Forces and
    displacements are taken in the sense in which the stage moves, and what its reversal unloads is no slip. Where the
    force has fallen slowly before, as beyond the maximum of friction, a slip begins at its last maximum. All times are
    those of records: let a slip last several.
    """
    if "stage_speed_mean" in dataset:
        raise ValueError("slips need each member; record them: [record] per_member = true")
    if "stage_speed" not in dataset:
        raise ValueError('slips need a stage that pulls through a spring: [drive] model = "spring"')
    outer = [name for name in (*sweep_dims(dataset), MEMBERS) if name in dataset["spring_force"].dims]
    shape = tuple(dataset.sizes[name] for name in outer)
    read = [dataset[name].astype(float).broadcast_like(dataset["spring_force"]) for name in _READ]
    series = [values.transpose(*outer, "t").to_numpy() for values in read]
    time = dataset["t"].to_numpy()
    rows = [_slips(least, time, *(values[at] for values in series)) for at in np.ndindex(*shape)]
    most = max(len(row) for row in rows)
    table = np.full((len(rows), most, len(_SLIPS)), np.nan)
    for own, row in zip(table, rows, strict=True):
        own[: len(row)] = row
    table = table.reshape(*shape, most, len(_SLIPS))
    described: dict[str, Any] = {
        name: ((*outer, "slip"), table[..., k], {"units": unit, "long_name": text})
        for k, (name, (unit, text)) in enumerate(_SLIPS.items())
    }
    number = ("slip", np.arange(1, most + 1), {"long_name": "number of the slip"})
    return xr.Dataset(described, {name: dataset[name] for name in outer} | {"slip": number})


def _slips(least: float, time: Any, force: Any, position: Any, stage: Any, stress: Any) -> np.ndarray:
    """The slips of one member, a row each, columns ``_SLIPS``."""
    from scipy.signal import find_peaks  # heavy: for sliders behind a spring alone

    there = np.isfinite(force) & np.isfinite(position)
    if not np.any(there):
        return np.empty((0, len(_SLIPS)))
    sense = _sense(stage)
    turns = np.flatnonzero(np.diff(sense)) + 1
    ends = np.unique([0, *turns[turns < there.sum()], there.sum()])
    fall = least * np.max(np.abs(force[there]))
    pulled = np.concatenate([[0.0], np.cumsum(0.5 * (stage[1:] + stage[:-1]) * np.diff(time))])
    found = []
    for start, stop in itertools.pairwise(ends):
        along = sense[start] * force[start:stop]
        moved = sense[start] * (position - _FASTER * pulled)[start:stop]
        tops = find_peaks(along, prominence=fall)[0] if fall > 0.0 else np.empty(0, int)
        until = np.append(tops, stop - start)[1:]
        lows = [top + int(np.argmin(along[top:end])) for top, end in zip(tops, until, strict=True)]
        pairs = [(top, low) for top, low in zip(tops, lows, strict=True) if along[top] - along[low] >= fall]
        if pairs and pairs[-1][1] == stop - start - 1:  # the last one has not ended
            pairs.pop()
        pairs = [(_begin(along, moved, top, low, fall), low) for top, low in pairs]
        top, low = start + np.array(pairs, int).reshape(-1, 2).T
        ahead, bears = sense[start] * (position[low] - position[top]), sense[start] * stress
        falls = np.maximum(bears[top], bears[top - 1]) - bears[low]  # as it slips at once, or in the record before
        slipped = (moved[low - start] > moved[top - start]) & (falls > 0.0)
        top, low, ahead, falls = top[slipped], low[slipped], ahead[slipped], falls[slipped]
        after = np.append(time[top], np.nan)[1:]  # when the next one begins
        found.append(np.stack([
            time[top], time[low] - time[top], after - time[low], after - time[top],
            ahead, np.abs(stage[top]), sense[start] * force[top], sense[start] * (force[top] - force[low]), falls,
        ], axis=1))  # fmt: skip
    return np.concatenate(found)


def _begin(force: np.ndarray, moved: np.ndarray, top: int, low: int, fall: float) -> int:
    """The record at which a slip begins: at the top, or where the force falls slowly from there at its last maximum.

    ``moved`` grows where the slider is as fast as in a slip.
    """
    if moved[low] > moved[top]:
        return top
    from scipy.signal import find_peaks  # heavy: for sliders behind a spring alone

    later = top + find_peaks(force[top : low + 1])[0]
    later = later[force[later] - force[low] >= fall]
    return int(later[-1]) if later.size else top


def _sense(stage: np.ndarray) -> np.ndarray:
    """Sense in which the stage moves, 1 or -1; where it rests the one before, at the beginning the one after."""
    moves = np.flatnonzero(np.nan_to_num(stage))
    if not moves.size:
        return np.ones(len(stage))
    last = np.searchsorted(moves, np.arange(len(stage)), "right") - 1
    return np.sign(stage[moves[np.maximum(last, 0)]])


def stick_slip(dataset: xr.Dataset) -> xr.Dataset:
    """Mean stick and slip of each member, static and kinetic friction.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        Under a stage ``slip_count``, and the means over the slips of what ``slips`` has of each; of a stage at one
        speed those that begin in the second half of the run. ``slip_spread`` [1]: the standard deviation of their
        displacements over its mean, see ``slip_sizes``. Of a stage at several speeds ``slips_from`` and
        ``slips_down_to`` [m/s], its lowest speed on the way up at which a slip begins that another one follows, and on
        the way down at which one begins that follows another: a single one is the fall of friction beyond its maximum.
        ``kinetic_friction`` [N] is the work of the stage over its
        path, from the beginning of the first of these slips to that of the last, without slips over that time;
        nan where the slider went less than half as far as the stage, stretching the spring.
        Under a prescribed force see ``runaways``. Empty for other drives, and where only statistics were recorded.
    """
    if "stage_speed" not in dataset and {"runaway_time", "spring_force"} <= set(dataset):
        return runaways(dataset)
    read = {*_READ, "drive_work", "stage_position"}
    if "stage_speed" not in dataset or not read <= set(dataset.variables):
        return xr.Dataset()
    half, several = _beginning(dataset), varies(dataset)
    some = with_trajectories(dataset, *read)
    return in_pieces(some, (*sweep_dims(dataset), MEMBERS), lambda piece: _means(piece, half, several))


def _means(dataset: xr.Dataset, half: float, several_speeds: bool) -> xr.Dataset:
    """What ``stick_slip`` gives, of slips that begin after a time [s]."""
    found = slips(dataset).pad(slip=(0, 1))  # where there is none, too, a mean is over something
    begins = found["slip_time"]
    counted = begins >= half
    means = found.where(counted).mean("slip", keep_attrs=True)
    apart = (found["slip_amplitude"] - means["slip_amplitude"]).where(counted)
    beyond_one = (counted.sum("slip") - 1.0).clip(0.0)
    spread = ((apart**2).sum("slip") / beyond_one.where(beyond_one > 0.0)) ** 0.5
    text = "standard deviation of the displacements in slips over their mean"
    means["slip_spread"] = (spread / means["slip_amplitude"]).assign_attrs(units="1", long_name=text)
    counts = counted.sum("slip").astype(float).assign_attrs(units="1", long_name="number of slips")
    first, last = begins.where(counted).min("slip"), begins.where(counted).max("slip")
    several = last > first
    end = dataset["t"].where(dataset["spring_force"].notnull()).max("t")
    first, last = first.where(several, half), last.where(several, end)
    path = abs(dataset["stage_position"].diff("t")).cumsum("t").reindex(t=dataset["t"], fill_value=0.0)
    slid = abs(dataset["slider_position"].astype(float).diff("t")).cumsum("t").reindex(t=dataset["t"], fill_value=0.0)
    made, gone, went = (_between(dataset, values, first, last) for values in (dataset["drive_work"], path, slid))
    kinetic = (made / gone.where(went > 0.5 * gone)).assign_attrs(
        units="N", long_name="work of the stage over its path"
    )
    every = means.drop_vars(["slip_time", "slip_speed"]).assign(slip_count=counts, kinetic_friction=kinetic)
    return every.assign(_between_speeds(dataset, found) if several_speeds else {}).map(ordered, keep_attrs=True)


def _between_speeds(dataset: xr.Dataset, found: xr.Dataset) -> dict[str, xr.DataArray]:
    """Speeds of a stage between which slips follow each other."""
    turn, later = abs(dataset["stage_speed"]).idxmax("t"), found["recurrence_time"].notnull()
    kept = later & (found["slip_time"] <= turn), later.shift(slip=1, fill_value=False) & (found["slip_time"] > turn)
    speeds = (found["slip_speed"].where(which).min("slip") for which in kept)
    ends = zip(_ENDS.items(), speeds, strict=True)
    return {name: speed.assign_attrs(units="m/s", long_name=text) for (name, text), speed in ends}


def varies(dataset: xr.Dataset) -> bool:
    """Whether the stage has several speeds in the course of a run, there and back not told apart, or rests."""
    stage = abs(dataset["stage_speed"]).where(dataset["stage_speed"] != 0.0)
    return bool((stage.max("t") > (1.0 + _ROUNDING) * stage.min("t")).any())


def slip_sizes(dataset: xr.Dataset, of: str = "slip_amplitude", least: float = LEAST) -> xr.Dataset:
    """Distribution of the sizes of slips, those of all members together.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``spring`` with each member recorded.
    of : str
        What the size is, as ``slips`` names it: ``"slip_amplitude"``, ``"force_drop"``, ``"recurrence_time"``, ...
    least : float
        How much the force of the spring falls in a slip at least, over its largest in the run [1].

    Returns
    -------
    xarray.Dataset
        The sizes, under their name and from the smallest on, with the dimension ``rank`` last (nan beyond those there
        are), and ``share_as_large`` [1], the share of slips that are as large or larger. Of a stage at one speed those
        that begin in the second half of the run.
    """
    found = slips(dataset, least)
    sizes = found[of].where(found["slip_time"] >= _beginning(dataset))
    over = [name for name in (MEMBERS, "slip") if name in sizes.dims]
    sizes = sizes.drop_vars(over, errors="ignore").stack(rank=over, create_index=False)
    ascending = sizes.copy(data=np.sort(sizes.to_numpy(), axis=-1))
    count, rank = ascending.count("rank"), xr.DataArray(np.arange(sizes.sizes["rank"]), dims="rank")
    share = (1.0 - rank / count).where(ascending.notnull())
    text = "share of the slips that are as large"
    return xr.Dataset({of: ascending, "share_as_large": share.assign_attrs(units="1", long_name=text)})


def _beginning(dataset: xr.Dataset) -> float:
    """Time from which on slips count [s]: half of the run behind a stage at one speed."""
    return float(dataset["t"][-1]) / 2.0 if is_stationary(dataset) else 0.0


def runaways(dataset: xr.Dataset) -> xr.Dataset:
    """Members that a prescribed force sets off: whether, when, and at which force.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, of a drive ``force`` with each member recorded.

    Returns
    -------
    xarray.Dataset
        ``ran_away``, 1 where nothing held the body any longer; ``runaway_after`` [s] and ``static_friction`` [N],
        the force at that time on the line through the last two records, nan where the body is held to the end.
    """
    when, time = dataset["runaway_time"].isel(t=-1).astype(float), dataset["t"]
    gone, force = when.notnull(), dataset["spring_force"].astype(float)
    last = (time < when).sum("t").clip(2) - 1
    now, before = force.isel(t=last), force.isel(t=last - 1)
    slope = (now - before) / (time.isel(t=last) - time.isel(t=last - 1))
    at = (now + slope * (when - time.isel(t=last))).drop_vars("t")
    away = gone.drop_vars("t").astype(float).assign_attrs(units="1", long_name="members that ran away", symbol="")
    when = when.drop_vars("t").assign_attrs(units="s", long_name="time of the runaway, of those that ran away")
    at = at.assign_attrs(units="N", long_name="force at which nothing held the body any longer")
    return xr.Dataset({"ran_away": away, "runaway_after": when, "static_friction": at}).map(ordered, keep_attrs=True)


def _between(dataset: xr.Dataset, values: xr.DataArray, first: xr.DataArray, last: xr.DataArray) -> xr.DataArray:
    """Growth of a quantity from one time to another."""
    values = values.astype(float).broadcast_like(dataset["spring_force"])
    dims: Any = {"input_core_dims": [[], ["t"], ["t"]], "vectorize": True}
    before, after = (xr.apply_ufunc(np.interp, time, dataset["t"], values, **dims) for time in (first, last))
    return after - before
