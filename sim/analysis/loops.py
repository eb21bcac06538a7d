"""Energies of a cycled contact: the loop of load over displacement, and the dissipation of opening and closing."""

import numpy as np
import xarray as xr

from sim.analysis.scene import MEMBERS, control, setting

#: A loop below this share of what is put in and given back is nothing.
_ROUNDING = 1e-12


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
    cycles = _cycles(dataset)
    suffix = "" if "normal_load" in dataset else "_mean"
    going = dataset[f"contact_radius{suffix}"].notnull()
    held = dataset[[f"normal_load{suffix}", f"displacement{suffix}"]].astype(float).where(going)
    load, displacement = held.values()
    number = xr.DataArray(np.arange(dataset.sizes["t"]), dims="t")
    done = (0.5 * (load + load.shift(t=1)) * (displacement - displacement.shift(t=1))).where(number > 0, 0.0)
    count = int(cycles.max())
    period = setting(dataset, "clock.duration") / cycles
    put_in = done.fillna(0.0).cumsum("t")
    rounding = _ROUNDING * abs(put_in).max("t")
    missing = _per_cycle(done.isnull().cumsum("t").astype(float), period, dataset["t"], count)
    found = {}
    for name, series, text in (
        ("loop_energy", put_in, "closed integral of the load over the displacement"),
        ("loop_dissipation", dataset[f"dissipated_energy{suffix}"], "energy dissipated by opening and closing"),
    ):
        values = _per_cycle(series.astype(float), period, dataset["t"], count).where(missing == 0.0)
        values = values.where(~(abs(values) < rounding), 0.0)
        found[f"{name}{suffix}"] = values.assign_attrs(units="J", long_name=f"{text}, over a cycle", symbol="")
    cycles = xr.DataArray(np.arange(1, count + 1), dims="cycle", attrs={"long_name": "number of the cycle"})
    return xr.Dataset(found, {"cycle": cycles})


def _cycles(dataset: xr.Dataset) -> xr.DataArray:
    try:
        cycles = setting(dataset, f"contact.{control(dataset).kind}.cycles")
    except KeyError:
        cycles = xr.DataArray(0.0)
    if not bool((cycles >= 1.0).any()):
        said = 'give some, such as [contact] load = { from = "4 mN", to = "-1 mN", cycles = 2 }'
        raise ValueError(f"nothing makes cycles there and back; {said}")
    return cycles.where(cycles >= 1.0)


def _per_cycle(series: xr.DataArray, period: xr.DataArray, times: xr.DataArray, count: int) -> xr.DataArray:
    """Growth of a series in each cycle; nan beyond the last one."""
    ends = period * xr.DataArray(np.arange(count + 1), dims="end")
    ends = ends.where(ends <= times[-1] + 1e-6 * period)
    at = xr.apply_ufunc(
        np.interp, ends, times, series,
        input_core_dims=[["end"], ["t"], ["t"]], output_core_dims=[["end"]], vectorize=True,
    )  # fmt: skip
    at = at.where(ends.notnull())
    gained = at.diff("end").rename(end="cycle").assign_coords(cycle=np.arange(1, count + 1))
    return gained.transpose(..., *(name for name in (MEMBERS, "cycle") if name in gained.dims))
