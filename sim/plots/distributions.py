"""Figures of what differs between members: a histogram, and the survival of an event."""

import contextlib
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from sim.plots import style
from sim.plots.curves import scene_along
from sim.read import is_stationary, survival
from sim.read.dataset import MEMBERS
from sim.read.observables import closed_observables, restricted

#: Quantities of a histogram, the first that differs between members.
_RANDOM = (
    "area_ratio",
    "contact_area",
    "bond_fraction",
    "friction_force",
    "fluctuation_energy",
)

#: Differences below this share of a value are rounding.
_ROUNDING = 1e-9

#: Most bars of a histogram.
_BARS = 60

#: Times of events, with the share of members that they have not reached in words.
_EVENTS = {
    "first_masked": "contacts not yet masked",
    "first_detachment": "contacts not yet detached",
}


def values_of(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a quantity of each closed contact, over the second half of a stationary run, else at its end."""
    records = dataset.sizes["t"]
    first = records // 2 if is_stationary(dataset) else records - 1
    late = dataset.isel(t=slice(first, None))
    values = closed_observables(restricted(late, [name]), [name])
    if name not in values or MEMBERS not in values[name].dims:
        raise ValueError(f"{name[:40]} does not differ between recorded members")
    result = values[name].astype(float)
    spread = (result.max() - result.min()).item()
    if not spread > _ROUNDING * float(abs(result).max()):
        raise ValueError(f"{name} is equal in all members at the end of the run")
    return result


def needs_members(dataset: xr.Dataset) -> None:
    """Refuse a dataset without recorded members that differ."""
    if dataset.sizes.get(MEMBERS, 1) < 2:
        alone = int(dataset.attrs["members"]) < 2
        cure = "record.per_member = true"
        cure = f"set ensemble.members = 64 and {cure}" if alone else f"set {cure}"
        raise ValueError(f"a distribution needs members that differ: {cure}")


def differing(dataset: xr.Dataset) -> xr.DataArray:
    """Return the first quantity that differs between members.

    Raises
    ------
    ValueError
        If none does, or members were not recorded.
    """
    needs_members(dataset)
    for name in _RANDOM:
        with contextlib.suppress(ValueError):
            return values_of(dataset, name)
    raise ValueError("the members are equal at the end of the run")


def histogram_figure(dataset: xr.Dataset, x: str = "") -> Figure:
    """Distribution of a quantity (--x) over the members, and over the second half of a stationary run."""
    scene = scene_along(dataset, "t")
    values = values_of(dataset, x) if x else differing(dataset)
    figure, (panel,) = style.rows([2.2])
    factor = style.in_unit(
        panel.xaxis, style.named(values), values.to_numpy(), values.attrs["units"]
    )
    shown = factor * values.to_numpy()
    shown = shown[np.isfinite(shown)]
    edges = np.histogram_bin_edges(shown, bins="auto")
    if len(edges) > _BARS + 1:
        edges = np.linspace(shown.min(), shown.max(), _BARS + 1)
    for line in scene.lines:
        of_line = factor * values.isel(line.point, missing_dims="ignore").to_numpy()
        of_line, label = of_line[np.isfinite(of_line)], line.label
        if not of_line.size:
            panel.plot([], color=line.colour, label=f"{label}: no value")
            continue
        counts, _ = np.histogram(of_line, edges, density=True)
        label = "" if scene.single else label
        panel.stairs(counts, edges, color=line.colour, label=label, linewidth=1.0)
    panel.set(ylabel="probability density", ylim=(0.0, None))
    sample = "second half of the run" if is_stationary(dataset) else "end of the run"
    words = f"{values.sizes[MEMBERS]} members, {sample}"
    style.legend(panel, "; ".join(filter(None, [words, scene.left_out])))
    return figure


def needs_event(dataset: xr.Dataset) -> None:
    """Refuse a dataset in which no contact is masked or detached."""
    needs_members(dataset)
    if not any(name in dataset and dataset[name].notnull().any() for name in _EVENTS):
        raise ValueError("no contact is masked or detached, so nothing has a survival")


def survival_figure(dataset: xr.Dataset, x: str = "") -> Figure:
    """Share of contacts not yet masked, or detached (--x first_detachment), over time, with 95 % intervals."""
    happened = [
        name for name in _EVENTS if name in dataset and dataset[name].notnull().any()
    ]
    event = x or happened[0]
    if event not in happened:
        raise ValueError(
            f"{event[:40]} did not happen; choose --x {', '.join(happened)}"
        )
    scene, shares = scene_along(dataset, "t"), survival(dataset, event)
    figure, (panel,) = style.rows([2.2])
    times = shares["time"].to_numpy()
    unit = style.Unit.of(times, "s")
    for line in scene.lines:
        share, low, high = (
            shares[name].isel(line.point, missing_dims="ignore").to_numpy()
            for name in ("survival", "low", "high")
        )
        look: Any = {
            "color": line.colour,
            "step": "post",
            "alpha": 0.18,
            "linewidth": 0,
        }
        panel.fill_between(
            unit.factor * times, low, high, label="95 % interval", **look
        )
        label = "" if scene.single else line.label
        panel.step(
            unit.factor * times, share, where="post", color=line.colour, label=label
        )
    panel.set(ylabel=_EVENTS[event], ylim=(0.0, 1.02))
    style.across(panel, unit.factor * times, unit.label("time $t$"))
    style.legend(panel, f"{dataset.sizes[MEMBERS]} members")
    return figure
