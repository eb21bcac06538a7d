"""Events of a run, once per member: first pull-off, time masked, friction peak, energy dissipated."""

import contextlib
from typing import Any

import numpy as np
import xarray as xr

from sim.analysis.observables import KEPT, masks, ordered, pure
from sim.analysis.scene import (
    MEMBERS,
    answered,
    control,
    in_pieces,
    may_stop,
    plain,
    setting,
    sweep_dims,
    where_recorded,
    with_trajectories,
    word,
)
from sim.analysis.stick_slip import stick_slip
from sim.analysis.transients import speed_step, way_to_sliding

#: A maximum is one if it stands above the ends of the run by more than rounding.
_ROUNDING = 1e-9
#: And, in an ensemble, if its mean does so by more than this many standard errors.
_ERRORS = 5.0
#: A loop below this share of what is put in and given back is nothing.
_NOTHING = 1e-12
#: Names of a peak, beginning of those of its time and speed, and the quantity that it is of with its unit.
_PEAKS = (("peak_stress", "peak", "shear_stress", "Pa"), ("peak_friction", "peak_friction", "friction_force", "N"))


def events(dataset: xr.Dataset) -> xr.Dataset:
    """Events of a run, once per member, or once for all where they agree.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        Without the dimension ``t``; what a scene cannot have is left out.

        - ``ever_detached``: 1 where the contact opened; ``first_detachment`` [s], nan where it never did.
        - ``time_masked``: share of the time in which adhesion was masked; ``first_masked`` [s], nan where it never was.
        - ``total_dissipated`` [J]: by opening and closing, to the end of the run.
        - ``loop_energy``, ``loop_dissipation`` [J]: means over the cycles there and back; see ``loop_energy``.
        - ``peak_stress`` [Pa], ``peak_time`` [s], ``peak_speed`` [m/s], and ``peak_friction`` [N] with
          ``peak_friction_time``, ``peak_friction_speed``: of a start or a ramp; see ``peaks``.
        - ``slip_count``, ``static_friction``, ``kinetic_friction`` [N], ``slip_amplitude`` [m] and more, of a slider
          behind a spring, ``ran_away`` and ``runaway_after`` [s] of one under a force; see ``stick_slip``.
        - ``direct_effect`` [N], ``step_length`` [m] and more of a jump of the speed; see ``speed_step``.
        - ``static_threshold`` [N], ``area_at_threshold`` and more of a pull from rest; see ``way_to_sliding``.

        Where only statistics were recorded, those of them that follow, as ``…_mean``.
    """
    dataset = plain(dataset)
    dims, latest = (*sweep_dims(dataset), MEMBERS), with_trajectories(dataset, "detachment_time")
    if "detachment_time" in latest and bool(latest["detachment_time"].isel(t=-1).isnull().all()):
        latest = latest.isel(t=[-1])  # none was open before either
    found = in_pieces(latest, dims, _openings)
    read = ["masked", "in_contact_mean", *(f"masked_{kind}" for kind in KEPT)]
    read += ["contact_area"] if may_stop(dataset) else []
    with where_recorded():
        found = found.merge(in_pieces(with_trajectories(dataset, *read), dims, _masks))
    for part in (peaks, stick_slip, speed_step, way_to_sliding):
        with where_recorded():
            found = found.merge(part(dataset))
    for suffix in ("", "_mean", "_std", "_sem"):
        if f"dissipated_energy{suffix}" in dataset:
            lost = dataset[f"dissipated_energy{suffix}"].isel(t=-1, drop=True).astype(float)
            text = "energy dissipated by opening and closing, in all"
            found[f"total_dissipated{suffix}"] = lost.assign_attrs(units="J", long_name=text, symbol="W")
        for name in ("pull_off_load", "pull_off_time"):
            if name + suffix in dataset:
                found[name + suffix] = dataset[name + suffix].astype(float)
    with contextlib.suppress(ValueError), answered():
        found = found.merge(loop_energy(dataset).mean("cycle", keep_attrs=True))
    return found


def _openings(dataset: xr.Dataset) -> xr.Dataset:
    if "detachment_time" not in dataset:
        return xr.Dataset()
    first = dataset["detachment_time"].astype(float).fillna(np.inf).min("t")  # the latest opening so far never falls
    ever = first < np.inf
    text = "time of the first detachment, of the contacts that detached"
    first = first.where(ever).assign_attrs(units="s", long_name=text, symbol="t_d")
    return xr.Dataset({"ever_detached": pure(ever.astype(float), "contacts that detached"), "first_detachment": first})


def _masks(dataset: xr.Dataset) -> xr.Dataset:
    """Each record stands for the time since the one before; a trajectory that stopped counts up to its end."""
    suffix, found = "" if "masked" in dataset else "_mean", masks(dataset)
    masked = found[f"fraction_masked{suffix}"]
    if stops := not suffix and may_stop(dataset):
        masked = masked.where(dataset["contact_area"].notnull())
    share = masked.isel(t=slice(min(1, dataset.sizes["t"] - 1), None)).mean("t", skipna=stops)
    found = {f"time_masked{suffix}": pure(share, "share of the time in which adhesion was masked")}
    if not suffix:
        ever = masked == 1.0
        text = "time at which adhesion was first masked, of the contacts in which it was"
        first = dataset["t"].isel(t=ever.argmax("t")).drop_vars("t").where(ever.any("t"))
        found["first_masked"] = ordered(first).assign_attrs(units="s", long_name=text)
    return xr.Dataset(found)


def peaks(dataset: xr.Dataset) -> xr.Dataset:
    """The friction peak after a start from rest, and the friction maximum of a ramp of the speed.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        ``peak_stress`` [Pa], the largest magnitude of the shear stress while sliding; ``peak_time`` [s], from
        where sliding starts; ``peak_speed`` [m/s]; and ``peak_friction`` [N], ``peak_friction_time`` and
        ``peak_friction_speed``, the same of the friction force. Empty under any other drive.

    Notes
    -----
    Peaks are those of the clock steps, refined between them, where members were recorded; their speed is that of
    the highest record. nan where there is none: the stress is largest at the last record, or on a ramp at the
    first, or the members fall from the peak of their mean to those by less than five standard errors. A start may
    peak at once, when the stress falls from what it was at rest. In members with noise the largest value lies above
    the peak of their mean. Where only statistics were recorded it is the peak of the ensemble mean over the
    records, ``peak_stress_mean``, with the standard error at that time.
    """
    dataset = plain(dataset)
    drive = word(dataset, "drive.model", "")
    ramp, start = drive == "ramp", drive == "start"
    if not bool((ramp | start).any()):
        return xr.Dataset()
    found, between = {}, float(dataset["t"][-1] - dataset["t"][0]) / max(dataset.sizes["t"] - 1, 1)
    beginning = _beginning(dataset)
    slides = (ramp | start) & (dataset["t"] >= beginning - 1e-6 * between)  # the record of the start counts
    for name, prefix, source, unit in _PEAKS:
        suffix = "" if source in dataset else "_mean"
        read = dataset[[source + suffix, "contact_modulus"]].assign(slides=slides)
        largest = _maximum(read, source + suffix, ramp)
        at, known = largest["at"], largest["known"]
        stepped = not suffix and name in dataset
        when = dataset["peak_time"] if stepped and prefix == "peak" else dataset["t"].isel(t=at)
        text = f"largest {dataset[source + suffix].attrs.get('long_name', source)} while sliding"
        described = {
            name + suffix: (dataset[name] if stepped else largest["size"], unit, text),
            f"{prefix}_time": (when - beginning, "s", f"time from the start of sliding to the {text}"),
            f"{prefix}_speed": (dataset["speed"].isel(t=at), "m/s", f"sliding speed at the {text}"),
        }
        if suffix:
            error = dataset[f"{source}_sem"].isel(t=at)
            described[f"{name}_sem"] = (error, unit, error.attrs["long_name"])
        for key, (values, units, words) in described.items():
            values = values.where(known).drop_vars("t", errors="ignore")
            found[key] = ordered(values).assign_attrs(units=units, long_name=words)
    return xr.Dataset(found)


def _beginning(dataset: xr.Dataset) -> xr.DataArray:
    """When sliding starts [s]: where the scenario does not tell, at the last record before the slider moves."""
    with contextlib.suppress(KeyError):
        return setting(dataset, "drive.rest")
    first = (dataset["speed"] != 0.0).argmax("t")
    return dataset["t"].isel(t=(first - 1).clip(0)).drop_vars("t")


def _maximum(recorded: xr.Dataset, name: str, ramp: xr.DataArray) -> xr.Dataset:
    """Largest value while it ``slides``: its ``size``, the record ``at`` which it is, whether it is ``known``.

    It is one if it stands above the ends by more than rounding; and members must fall from where their mean is largest
    to the ends, in parts of it, by more than noise may.
    """

    def sizes(some: xr.Dataset) -> xr.DataArray:
        return abs(some[name].astype(float)).where(some["slides"])

    def mean(some: xr.Dataset) -> xr.Dataset:
        return xr.Dataset({"mean": sizes(some).mean(MEMBERS)})

    def each(some: xr.Dataset) -> xr.Dataset:
        values = sizes(some)
        at = values.fillna(-1.0).argmax("t")
        first, last = _ends(values)
        found = {"at": at, "size": values.isel(t=at), "first": first, "last": last}
        found |= {"peak": values.isel(t=some["top"])} if "top" in some else {}
        return xr.Dataset({name: values.drop_vars("t", errors="ignore") for name, values in found.items()})

    dims, several = sweep_dims(recorded), recorded.sizes.get(MEMBERS, 1) > 1
    if several:
        recorded = recorded.assign(top=in_pieces(recorded, ("t",), mean)["mean"].fillna(-1.0).argmax("t"))
    found = in_pieces(recorded, (*dims, MEMBERS), each)
    ends = found["first"], found["last"]
    above = [found["size"] / (1.0 + _ROUNDING) > end for end in ends]
    if several:
        drops = [1.0 - end / found["peak"].where(found["peak"] > 0.0) for end in ends]
        errors = [drop.std(MEMBERS, ddof=1) / np.sqrt(recorded.sizes[MEMBERS]) for drop in drops]
        falls = [drop.mean(MEMBERS) > _ERRORS * error for drop, error in zip(drops, errors, strict=True)]
        above = [higher & fall for higher, fall in zip(above, falls, strict=True)]
    first, last = above
    return found.assign(known=last & (~ramp | first))


def _ends(values: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """The first and the last value that is there."""
    there = values.notnull()
    first, last = there.argmax("t"), values.sizes["t"] - 1 - there.isel(t=slice(None, None, -1)).argmax("t")
    return values.isel(t=first), values.isel(t=last)


def loop_energy(dataset: xr.Dataset) -> xr.Dataset:
    """Work put into the contact in each cycle there and back, and the energy it dissipates meanwhile.

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
        said = 'give some, such as [contact] load = { from = "4 mN", to = "-1 mN", cycles = 2 }'
        raise ValueError(f"nothing makes cycles there and back; {said}")
    count = int(cycles.max())
    suffix = "" if "normal_load" in dataset else "_mean"
    read = (f"{name}{suffix}" for name in ("contact_radius", "normal_load", "displacement", "dissipated_energy"))
    dims = (*sweep_dims(dataset), MEMBERS)
    return in_pieces(with_trajectories(dataset, *read), dims, lambda some: _loops(some, suffix, count))


def _loops(dataset: xr.Dataset, suffix: str, count: int) -> xr.Dataset:
    """``loop_energy`` and ``loop_dissipation`` in each of so many cycles."""
    cycles = cycles_of(dataset)
    going = dataset[f"contact_radius{suffix}"].notnull()
    held = dataset[[f"normal_load{suffix}", f"displacement{suffix}"]].astype(float).where(going)
    load, displacement = held.values()
    number = xr.DataArray(np.arange(dataset.sizes["t"]), dims="t")
    done = (0.5 * (load + load.shift(t=1)) * (displacement - displacement.shift(t=1))).where(number > 0, 0.0)
    period = setting(dataset, "clock.duration") / cycles.where(cycles >= 1.0)
    put_in = done.fillna(0.0).cumsum("t")
    rounding = _NOTHING * abs(put_in).max("t")
    missing = _per_cycle(done.isnull().cumsum("t").astype(float), period, dataset["t"], count)
    found = {}
    for name, series, text in (
        ("loop_energy", put_in, "closed integral of the load over the displacement"),
        ("loop_dissipation", dataset[f"dissipated_energy{suffix}"], "energy dissipated by opening and closing"),
    ):
        values = _per_cycle(series.astype(float), period, dataset["t"], count).where(missing == 0.0)
        values = values.where(~(abs(values) < rounding), 0.0)
        found[f"{name}{suffix}"] = values.assign_attrs(units="J", long_name=f"{text}, over a cycle", symbol="")
    cycle = xr.DataArray(np.arange(1, count + 1), dims="cycle", attrs={"long_name": "number of the cycle"})
    return xr.Dataset(found, {"cycle": cycle})


def cycles_of(dataset: xr.Dataset) -> xr.DataArray:
    """Cycles there and back of what holds the sphere, with the sweep's dimensions; 0 where it makes none."""
    with contextlib.suppress(KeyError):
        return setting(dataset, f"contact.{control(dataset).kind}.cycles")
    return xr.DataArray(0.0)


def _per_cycle(series: xr.DataArray, period: xr.DataArray, times: xr.DataArray, count: int) -> xr.DataArray:
    """Growth of a series in each cycle; nan beyond the last one."""
    ends = period * xr.DataArray(np.arange(count + 1), dims="end")
    ends = ends.where(ends <= times[-1] + 1e-6 * period)
    dims: Any = {"input_core_dims": [["end"], ["t"], ["t"]], "output_core_dims": [["end"]]}
    at = xr.apply_ufunc(np.interp, ends, times, series, vectorize=True, **dims).where(ends.notnull())
    gained = at.diff("end").rename(end="cycle").assign_coords(cycle=np.arange(1, count + 1))
    return gained.transpose(..., *(name for name in (MEMBERS, "cycle") if name in gained.dims))
