"""Statistics as rows: a dozen for the terminal, all of them as CSV."""

import contextlib
import math
import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from sim.analysis.correlation import correlation_time
from sim.analysis.events import events
from sim.analysis.observables import all_observables, settled
from sim.analysis.scene import answered, is_stationary, of_dataset, resolved, stays_held, sweep_dims, word
from sim.analysis.statistics import QUANTILES, averaging, shares, statistics, summary
from sim.numerics.files import output
from sim.units.notation import concise, scaled

#: Cells of columns by heading.
Columns = dict[str, list[str]]
#: The index of each row along the dimensions of sweep and time.
Points = dict[str, xr.DataArray]


class _Column(NamedTuple):
    """An observable's column; it is left out where all of its values are the ``dull`` one."""

    name: str
    heading: str
    dull: float = 0.0
    changing: bool = False  # only in rows over time of a contact whose control changes
    meaning: str = ""


_COLUMNS = (
    _Column("speed", "V"),
    _Column("normal_load", "P", changing=True),
    _Column("displacement", "Δ", changing=True, meaning="displacement of the base, without one the indentation"),
    _Column("bond_fraction", "N/N0", 1.0),
    _Column("fluctuation_energy", "ΔΓ"),
    _Column("work_of_adhesion", "w", math.nan),
    _Column("contact_radius", "a", math.nan),
    _Column("area_ratio", "A/A_JKR", meaning="contact area over that with the full work of adhesion"),
    _Column("lost_to_bonds", "lost to\nbonds", meaning="share of A_JKR, bonds charged first"),
    _Column("lost_to_fluctuations", "lost to\nfluct."),
    _Column("lost_to_mean_stress", "lost to\nstress"),
    _Column("lost_to_lag", "lost to\nlag"),
    _Column("friction_force", "F"),
    _Column("fraction_detached", "open"),
    _Column("fraction_masked", "masked", meaning="closed contacts without any work of adhesion left"),
    _Column("dissipated_energy", "W", changing=True, meaning="energy dissipated so far by opening and closing"),
)

_EVENTS = (
    _Column("time_masked", "masked,\nof the time"),
    _Column("ever_detached", "detached,\nof members"),
    _Column("first_detachment", "first\ndetached"),
    _Column("loop_energy", "∮P dΔ,\nper cycle", meaning="work put in over a cycle"),
    _Column("loop_dissipation", "dissipated,\nper cycle"),
    _Column("total_dissipated", "dissipated,\nin all"),
    _Column("pull_off_load", "pull-off\nload"),
    _Column("pull_off_time", "pull-off\nafter", math.nan),
    _Column("peak_stress", "peak of\nstress"),
    _Column("peak_speed", "at V", math.nan),
    _Column("peak_time", "after", math.nan),
    _Column("peak_friction", "peak of\nfriction"),
    _Column("peak_friction_speed", "at V ", math.nan),
    _Column("peak_friction_time", "after ", math.nan),
    _Column(
        "slip_count", "slips", meaning="falls of the spring's force by 2 % or more, means over them; times of records"
    ),
    _Column("static_friction", "static\nfriction", math.nan, meaning="force at which a slip begins"),
    _Column("kinetic_friction", "kinetic\nfriction", math.nan, meaning="work of the stage over its way"),
    _Column("force_drop", "drop", math.nan),
    _Column("stress_drop", "drop of\nstress", math.nan),
    _Column("slip_amplitude", "slip", math.nan),
    _Column("slip_duration", "slip\nlasts", math.nan),
    _Column("stick_duration", "stick\nlasts", math.nan),
    _Column("recurrence_time", "slip\nevery", math.nan),
)

#: Heading and meaning of the correlation time.
_MEMORY = _Column("correlation_time", "t_c", meaning="integral correlation time of ΔΓ")

#: Pure numbers that are no shares of something.
_NO_SHARES = ("bond_fraction", "slip_count")
#: Shares below it are nothing.
_ROUNDING = 1e-13


@of_dataset
def table(dataset: xr.Dataset, rows: int = 12) -> list[dict[str, str]]:
    """The statistics in about a dozen rows for the terminal.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    rows : int
        How many rows at most (at least one). Where speed and control are steady each point of a sweep has
        one row, its mean over the second half of the run; else rows are spread evenly over time.

    Returns
    -------
    list of dict
        Cells by heading (of two lines, with the unit of the column): means over the members, of a swept steady run
        over its second half, too; ``averaging`` says which. A number in brackets is the standard error in the last
        digits; columns that are zero or constant throughout (no friction, no open contacts) are left out.
        "lost to bonds" and "lost to fluct." are the shares of JKR's area that each mechanism takes.
    """
    found, points = _tabulated(dataset, rows)
    whole = is_stationary(dataset) and bool(sweep_dims(dataset))
    changing = not bool(stays_held(dataset).all())
    cells = _places(found, {name: index for name, index in points.items() if name != "t" or not whole})
    speeds = dataset.get("drive_speed", xr.DataArray())
    same = whole and any(name in points for name in speeds.dims)  # V is a column already
    columns = [c for c in _COLUMNS if (changing or not c.changing) and not (same and c.name == "speed")]
    cells |= _shown(found, points, columns)
    times, errors, below = (_at(found[f"correlation_time{kind}"], points) for kind in ("", "_sem", "_below"))
    if np.any(np.isfinite(times) | np.isfinite(below)):
        ((heading, texts),) = _cells(_MEMORY.heading, "s", np.where(np.isnan(times), below, times), errors).items()
        cells[heading] = [f"<{text}" if math.isfinite(most) else text for text, most in zip(texts, below, strict=True)]
    return _rows(cells)


def notes(dataset: xr.Dataset, rows: list[dict[str, str]], once: list[dict[str, str]]) -> list[str]:
    """What stands in the rows of ``table`` and ``highlights``: means over what, how many rows, and symbols in words."""
    whole = is_stationary(dataset) and bool(sweep_dims(dataset))
    points = math.prod(dataset.sizes[name] for name in sweep_dims(dataset))
    said = [words] if (words := averaging(dataset, whole)) else []
    if "runaway_time" in dataset and (gone := int(dataset["runaway_time"].isel(t=-1).notnull().sum())):
        said.append(
            f"{gone} of {dataset['runaway_time'].isel(t=-1).size} trajectories end in a runaway: nothing held the body"
        )
    if any("(" in cell for row in rows for cell in row.values()):
        said.append("in brackets the standard error in the last digits")
    lines = ["; ".join(said)] if said else []
    for shown, total in ((rows, points if whole else points * dataset.sizes["t"]), (once, points)):
        if 0 < len(shown) < total:
            lines.append(f"{len(shown)} of {total} rows shown; all: --all, or --csv FILE; chosen: --where KEY=VALUE")
    headings = {re.sub(r"[ \n]\([^()]*\)$", "", heading) for row in (*rows[:1], *once[:1]) for heading in row}
    if (names := resolved(dataset, "record.quantities")) is not None:
        kept = ", ".join(names) or "contact_radius alone"
        lines.append(f"columns of what was not recorded are left out; record.quantities keeps {kept}")
    known = [c for c in (*_COLUMNS, _MEMORY, *_EVENTS) if c.meaning and c.heading in headings]
    words = "; ".join(f"{' '.join(column.heading.split())}: {column.meaning}" for column in known)
    return [*dict.fromkeys(lines), *filter(None, [words])]


@of_dataset
def highlights(dataset: xr.Dataset, rows: int = 12) -> list[dict[str, str]]:
    """What each point of the sweep has once in its whole run, in a dozen rows at most; none where there is nothing.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    rows : int
        How many rows at most (at least one).

    Returns
    -------
    list of dict
        Cells by heading, as those of ``table``: how long adhesion was masked, how many members detached and when
        (the mean, and the 5 and 95 % quantiles of those that did), what a cycle there and back took and
        how much it dissipated, and the friction peak of a start or a ramp.
    """
    found = summary(events(dataset))
    points = _points(dataset.sizes, _thinned(dataset, rows))
    shown = _shown(found, points, (column for column in _EVENTS if _of_drive(dataset, column.name)))
    cells = _places(dataset, points)
    for heading, texts in shown.items():
        cells[heading] = texts
        if heading.startswith("first\n") and "first_detachment_quantile" in found:
            cells |= _range(found["first_detachment_quantile"], points)
    return _rows(cells) if shown else []


def _of_drive(dataset: xr.Dataset, name: str) -> bool:
    """Whether an event is shown under this drive: the speed of a peak on a ramp, its time after a start."""
    drives = {"speed": "ramp", "time": "start"}
    wanted = drives.get(name.rpartition("_")[2]) if name.startswith("peak_") else None
    return wanted is None or bool((word(dataset, "drive.model", "") == wanted).any())


def _places(found: xr.Dataset, points: Points) -> Columns:
    """The columns that say where in the sweep and when each row is."""
    cells: Columns = {}
    for name, index in points.items():
        cells |= _cells(name, found[name].attrs.get("units", "1"), found[name][index].to_numpy())
    return cells


def _range(quantiles: xr.DataArray, points: Points) -> Columns:
    """The 5 and 95 % quantiles of a time, where there is a spread."""
    low, high = (_at(quantiles.isel(quantile=end), points) for end in (0, -1))
    if not np.any(low < high):
        return {}
    factor, shown = scaled(float(np.nanmax(high)), "s")
    texts = [f"{concise(factor * a, 0.0)} to {concise(factor * b, 0.0)}" for a, b in zip(low, high, strict=True)]
    return {f"5 to 95 %\nof members ({shown})": texts}


def _shown(found: xr.Dataset, points: Points, columns: Iterable[_Column]) -> Columns:
    """The columns that are not constant at their dull value at these points."""
    cells: Columns = {}
    for name, heading, dull, *_ in columns:
        if f"{name}_mean" not in found:
            continue
        mean, sem = (_at(found.get(f"{name}_{kind}"), points) for kind in ("mean", "sem"))
        unit = found[f"{name}_mean"].attrs.get("units", "1")
        if unit == "1" and name not in _NO_SHARES:  # differences of areas leave rounding behind
            unit, mean = "%", np.where(np.abs(mean) < _ROUNDING, 0.0, mean)
        if not np.all((mean == dull) | np.isnan(mean)):
            cells |= _cells(heading, unit, mean, sem)
    return cells


def _at(variable: xr.DataArray | None, points: Points) -> np.ndarray:
    """Values of a variable at each row; nan if there is no such variable."""
    count = next(iter(points.values())).size if points else 1
    values = np.nan if variable is None else variable.isel(points, missing_dims="ignore").to_numpy()
    return np.broadcast_to(values, count)


def _rows(cells: Columns) -> list[dict[str, str]]:
    return [dict(zip(cells, row, strict=True)) for row in zip(*cells.values(), strict=True)]


def _tabulated(dataset: xr.Dataset, rows: int) -> tuple[xr.Dataset, Points]:
    """Statistics to tabulate, and the index of each row in every dimension of sweep and time."""
    memory, counts = correlation_time(dataset), _thinned(dataset, rows)
    counts["t"] = max(1, rows // math.prod(counts.values()))
    whole = is_stationary(dataset) and bool(sweep_dims(dataset))
    if not whole:  # of the records only those that are shown
        dataset = dataset.isel(t=_spread(dataset.sizes["t"], counts["t"]))
    trajectories = all_observables(dataset)
    found = summary(settled(trajectories) if whole else trajectories, quantiles=False).merge(memory)
    if "applied_load" in dataset:  # it is known of open contacts too
        found["normal_load_mean"] = dataset["applied_load"].fillna(found["normal_load_mean"])
        found["normal_load_sem"] = found["normal_load_sem"].where(dataset["applied_load"].isnull(), 0.0)
    return found, _points(found.sizes, counts)


def _points(sizes: Mapping[Any, int], counts: dict[str, int]) -> Points:
    """The index of each row in every dimension."""
    chosen = np.meshgrid(*(_spread(sizes[name], count) for name, count in counts.items()), indexing="ij")
    return {name: xr.DataArray(index.ravel(), dims="row") for name, index in zip(counts, chosen, strict=True)}


def _thinned(dataset: xr.Dataset, rows: int) -> dict[str, int]:
    """How many values of each dimension of the sweep make at most ``rows`` points, two of each at least."""
    counts = {name: dataset.sizes[name] for name in sweep_dims(dataset)}
    while math.prod(counts.values()) > rows and max(counts.values()) > 2:
        counts[max(counts, key=lambda name: counts[name])] -= 1
    return counts


def _spread(size: int, count: int) -> np.ndarray:
    """At most ``count`` indices evenly over ``size``, the last included."""
    count = min(size, max(count, 1))
    return np.rint(np.linspace(0 if count > 1 else size - 1, size - 1, count)).astype(int)


def _cells(heading: str, unit: str, values: np.ndarray, errors: np.ndarray | float = 0.0) -> Columns:
    """A column's cells in the unit of its largest value, under its heading with that unit."""
    if values.dtype.kind not in "fi":
        return {heading: [str(value) for value in values]}
    finite = np.abs(values[np.isfinite(values)])
    factor, shown = (100.0, "%") if unit == "%" else scaled(finite.max(initial=0.0), unit)
    texts = [concise(factor * value, factor * error) for value, error in np.broadcast(values, errors)]
    gap = " " if "\n" in heading else "\n"
    return {f"{heading}{gap}({shown})" if shown else heading: texts}


def to_csv(dataset: xr.Dataset, path: str | os.PathLike) -> None:
    """Write all statistics at all times and sweep values as one long table.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    path : path
        The file: a header with SI units in brackets, then one row for each sweep value and time, with the mean,
        standard deviation, standard error and quantiles over the members at that time; what a whole run has once
        stands in all of its rows. A file is there whole or, in trouble, as it was before.
    """
    long = frame(dataset)
    units = long.attrs["units"]
    header = [name if units[name] == "1" else f"{name} [{units[name]}]" for name in long]
    text = long.to_csv(header=header, index=False, na_rep="nan", lineterminator="\n").encode()
    with output(Path(path)) as beside:
        beside.write_bytes(text)


@of_dataset
def frame(dataset: xr.Dataset) -> pd.DataFrame:
    """All statistics at all times and sweep values as a data frame, one row each; ``attrs["units"]`` by column."""
    found = statistics(dataset)
    with contextlib.suppress(ValueError), answered():  # shares are not known of every dataset
        found = found.merge(shares(dataset))
    flat: dict[str, xr.DataArray] = {}
    for key, variable in found.data_vars.items():
        if "quantile" in variable.dims:  # each is a variable of its own
            stem = str(key).removesuffix("_quantile")
            flat |= {f"{stem}_q{100 * level:02.0f}": variable.sel(quantile=level, drop=True) for level in QUANTILES}
        else:
            flat[str(key)] = variable
    long = xr.Dataset(flat)
    table = long.to_dataframe(dim_order=[*sweep_dims(dataset), "t"]).reset_index()
    table.attrs["units"] = {str(name): each.attrs.get("units", "1") for name, each in long.variables.items()}
    return table
