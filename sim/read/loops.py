"""Cycles of the control of a contact: the work put into each, and the energy dissipated in it."""

import contextlib
from typing import Any

import numpy as np
import xarray as xr

from sim.read.dataset import (
    MEMBERS,
    control,
    ensemble_mean,
    in_pieces,
    only_statistics,
    setting,
    sweep_dims,
    with_trajectories,
)
from sim.read.estimate import Estimate, Estimates

#: Records that a cycle needs so that every second one still shows its course.
_RECORDS = 16
#: A loop below this share of what is put in and given back is nothing.
_NOTHING = 1e-12


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
        or of the means where only statistics were recorded. nan in a cycle in which the load's place is not
        known, as when a sphere at a load flies off, or the trajectory stops.

    Raises
    ------
    ValueError
        If nothing makes cycles.

    Notes
    -----
    ``loop_energy`` is the integral of P dΔ with Δ the displacement of the base (the indentation,
    where that or a load is prescribed), which returns to its start. The load need not return,
    because bonds and edges lag. The trapezoidal rule is used over the records. A jump between two
    records is drawn as a straight line, so each costs up to half its load times the displacement of
    one record; elsewhere the error falls with the square of the time between records.

    ``loop_dissipation`` is the growth of ``dissipated_energy``. Where the work of adhesion stays what it is and the
    contact follows equilibrium it is the whole loop: all the work is dissipated in jumps. With
    bonds that break and heal, or fluctuations, the work of adhesion itself does work over a cycle.
    """
    cycles = cycles_of(dataset)
    if not bool((cycles >= 1.0).any()):
        cure = 'give some, such as [contact] load = { from = "4 mN", to = "-1 mN", cycles = 2 }'
        raise ValueError(f"neither load nor position moves in cycles; {cure}")
    count = int(cycles.max())
    read = ("contact_radius", "normal_load", "displacement", "dissipated_energy")
    dims = (*sweep_dims(dataset), MEMBERS)
    needed = with_trajectories(dataset, *read)
    return in_pieces(needed, dims, lambda piece: _loops(piece, count))


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


def _loops(dataset: xr.Dataset, count: int) -> xr.Dataset:
    """Return ``loop_energy`` and ``loop_dissipation`` in each of ``count`` cycles."""
    cycles = cycles_of(dataset)
    going = ensemble_mean(dataset["contact_radius"]).notnull()
    load, displacement, spent = (
        ensemble_mean(dataset[name]).astype(float).where(going)
        for name in ("normal_load", "displacement", "dissipated_energy")
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
    series = done.isnull().cumsum("t"), put_in, spent
    missing, *gained = (
        _growth(values, dataset["t"], ends).rename(end="cycle") for values in series
    )
    texts = {"loop_energy": "integral of the load over the displacement in a cycle"}
    texts["loop_dissipation"] = "energy dissipated by opening and closing"
    result = {}
    for (name, text), values in zip(texts.items(), gained, strict=True):
        values = values.where(~(abs(values) < rounding), 0.0).where(missing == 0.0)
        values = values.transpose(..., MEMBERS, "cycle", missing_dims="ignore")
        result[name] = values.assign_attrs(
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


def mean_loops(dataset: xr.Dataset) -> Estimates:
    """Return the means over the cycles of ``loop_energy``, with bounds; with a reason if the records are too few.

    The bound is the sum of the changes if every second and every fourth record is left:
    one change alone may vanish by chance. A contact that opens or closes adds what its load
    between the two records may differ from a straight line.
    """
    means = loop_energy(dataset).mean("cycle", keep_attrs=True)
    cycles = cycles_of(dataset)
    is_fine = dataset.sizes["t"] > _RECORDS * cycles
    reason = xr.where(is_fine, "", f"fewer than {_RECORDS} records in a cycle")
    found = {
        str(name): Estimate(values.where(is_fine), reason=reason)
        for name, values in means.items()
    }
    if only_statistics(dataset):
        return found
    last = dataset.sizes["t"] - 1  # the end of a cycle, which stays
    thinned = [
        loop_energy(dataset.isel(t=[*range(0, last, step), last])).mean("cycle")
        for step in (2, 4)
    ]
    bounds = abs(means - xr.concat(thinned, "step")).sum("step", skipna=False)
    bounds["loop_energy"] = bounds["loop_energy"] + _of_jumps(dataset) / cycles
    for name, bound in bounds.items():
        bound = bound.where(is_fine).assign_attrs(source="records")
        found[str(name)] = found[str(name)]._replace(bound=bound)
    return found


def _of_jumps(dataset: xr.Dataset) -> xr.DataArray:
    """Return the most work that a straight line misses between records at which a contact opens or closes [J].

    The load there lies between the larger of both readings and the lowest load of the run, which the stepper records.
    """
    load = dataset["normal_load"].astype(float)
    displacement, closed = (
        dataset[name].astype(float).diff("t") for name in ("displacement", "in_contact")
    )
    before, after = (
        load.isel(t=slice(None, -1)).drop_vars("t"),
        load.isel(t=slice(1, None)),
    )
    before = before.assign_coords(t=after["t"])
    straight, largest = 0.5 * (before + after), np.fmax(before, after)
    lowest = np.fmin(np.fmin(before, after), dataset.get("lowest_load", load.min("t")))
    off = np.fmax(largest - straight, straight - lowest) * abs(displacement)
    return off.where(closed != 0.0, 0.0).sum("t")


def cycles_of(dataset: xr.Dataset) -> xr.DataArray:
    """Return the number of cycles of the control of the contact, with the sweep's dimensions; 0 if there are none."""
    with contextlib.suppress(KeyError):
        return setting(dataset, f"contact.{control(dataset).kind}.cycles")
    return xr.DataArray(0.0)
