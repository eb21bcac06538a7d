"""Statistics as rows: a dozen for the terminal, all of them as CSV."""

import bisect
import contextlib
import csv
import io
import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from sim.numerics.files import output
from sim.read.dataset import (
    MEMBERS,
    has_noise,
    is_stationary,
    is_steady,
    resolved,
    speed_name,
    speed_of,
    stays_held,
    steady_points,
    sweep_dims,
    word,
)
from sim.read.errors import systematic_errors
from sim.read.events import unresolved_slips, varies
from sim.read.observables import restricted, with_slips
from sim.read.over_speed import extremes, loss_speeds
from sim.read.statements import (
    BOUNDED,
    COUNTS,
    as_means,
    each,
    of_events,
    reasons,
    statements,
    statistics,
)
from sim.read.statistics import (
    FOR_TAILS,
    QUANTILES,
    WIDE,
    Array,
    averaging,
    correlation_time,
    over_members,
)
from sim.units.notation import bounded, chosen_unit, concise, engineering, scaled, share

#: Cells of columns by heading.
Columns = dict[str, list[str]]
#: The index of each row along the dimensions of sweep and time.
Points = dict[str, xr.Variable]


class _Column(NamedTuple):
    """An observable's column; it is left out where all of its values are the ``dull`` one."""

    name: str
    heading: str
    dull: float = 0.0
    # only in rows over time, of a contact whose control or of a stage whose speed changes
    changing: bool = False
    meaning: str = ""


_COLUMNS = (
    _Column("stage_speed", "stage", changing=True, meaning="speed of the stage"),
    _Column("speed", "V"),
    _Column("normal_load", "P", changing=True),
    _Column(
        "displacement",
        "Δ",
        changing=True,
        meaning="displacement of the mount, or the indentation",
    ),
    _Column("bond_fraction", "N/N0", 1.0),
    _Column("fluctuation_energy", "ΔΓ"),
    _Column(
        "edge_energy",
        "edge",
        meaning="fluctuation energy per unit of new contact area at the edge, dE/dA",
    ),
    _Column("work_of_adhesion", "w", math.nan),
    _Column("contact_radius", "a", math.nan),
    _Column(
        "area_ratio",
        "A/A_JKR",
        meaning="contact area over the JKR area at the full work of adhesion",
    ),
    _Column(
        "lost_to_bonds",
        "lost to\nbonds",
        meaning="share of A_JKR, with bonds subtracted first",
    ),
    _Column(
        "lost_to_fluctuations",
        "lost to\nfluct.",
        meaning="depends on shear.paid_by_adhesion; the paper's strict energy balance has no such loss",
    ),
    _Column(
        "lost_to_fluctuations_first",
        "fluct.\nfirst",
        meaning="lost to fluctuations if subtracted before bonds",
    ),
    _Column("lost_to_mean_stress", "lost to\nstress"),
    _Column(
        "lost_to_lag",
        "lost to\nlag",
        meaning="by the lag of the edge; negative if the edge retreats late",
    ),
    _Column("friction_force", "F"),
    _Column("fraction_detached", "open"),
    _Column(
        "fraction_masked",
        "masked",
        meaning="share of closed contacts without effective work of adhesion",
    ),
    _Column(
        "dissipated_energy",
        "W",
        changing=True,
        meaning="energy dissipated so far by opening and closing",
    ),
)

_EVENTS = (
    _Column("time_masked", "masked,\nof the time"),
    _Column("ever_detached", "detached,\nof members"),
    _Column(
        "first_detachment",
        "first\ndetached",
        meaning="mean time of the first detachment, at ends of clock steps",
    ),
    _Column(
        "half_detached",
        "half\ndetached",
        math.nan,
        meaning="time at which half of the members had detached",
    ),
    _Column(
        "detached_rate",
        "rate of\ndetaching",
        meaning="detachments per time in contact, of all members",
    ),
    _Column("first_masked", "first\nmasked", meaning="mean time of the masked members"),
    _Column(
        "half_masked",
        "half\nmasked",
        math.nan,
        meaning="time at which half of the members had been masked",
    ),
    _Column(
        "loop_energy", "∮P dΔ,\nper cycle", meaning="work done by the mount in a cycle"
    ),
    _Column("loop_dissipation", "dissipated,\nper cycle"),
    _Column("total_dissipated", "dissipated,\nin all"),
    _Column("pull_off_load", "pull-off\nload"),
    _Column(
        "pull_off_time",
        "pull-off\nafter",
        math.nan,
        meaning="end of the clock step with the pull-off",
    ),
    _Column("peak_stress", "peak of\nstress"),
    _Column("peak_speed", "at V", math.nan),
    _Column("peak_time", "after", math.nan),
    _Column("peak_friction", "peak of\nfriction"),
    _Column("peak_friction_speed", "at V ", math.nan),
    _Column("peak_friction_time", "after ", math.nan),
    _Column(
        "static_threshold",
        "static\nthreshold",
        math.nan,
        meaning="largest friction after the start",
    ),
    _Column(
        "area_at_threshold",
        "A/A0\nthere",
        1.0,
        meaning="contact area at the threshold over the area at rest",
    ),
    _Column(
        "slip_count",
        "slips",
        meaning="drops of the spring force by more than 0.3 of its maximum so far",
    ),
    _Column(
        "slips_from",
        "slips\nfrom",
        math.nan,
        meaning="stage speed at the first slip event before another",
    ),
    _Column(
        "slips_down_to",
        "slips\ndown to",
        math.nan,
        meaning="at decreasing speed: at the last after another",
    ),
    _Column("ran_away", "ran away,\nof members"),
    _Column("runaway_after", "ran away\nafter", math.nan),
    _Column(
        "static_friction",
        "static\nfriction",
        math.nan,
        meaning="force at the start of a slip event or a runaway",
    ),
    _Column(
        "kinetic_friction",
        "kinetic\nfriction",
        math.nan,
        meaning="work of the stage divided by its displacement",
    ),
    _Column("force_drop", "drop", math.nan),
    _Column("stress_drop", "drop of\nstress", math.nan),
    _Column("slip_amplitude", "slip", math.nan),
    _Column(
        "slip_spread",
        "spread\nof slips",
        math.nan,
        meaning="standard deviation of the slip over its mean",
    ),
    _Column("slip_duration", "slip\nlasts", math.nan),
    _Column("stick_duration", "stick\nlasts", math.nan),
    _Column("recurrence_time", "slip\nevery", math.nan),
)

_PHASES = (
    _Column("phase_start", "starts"),
    _Column("phase_time_held", "held\nbefore"),
    _Column("phase_slip_count", "slips"),
    _Column("phase_first_friction", "first slip\nat", math.nan),
    _Column("phase_static_friction", "static\nfriction", math.nan),
    _Column("phase_force_drop", "drop", math.nan),
    _Column("phase_recurrence_time", "slip\nevery", math.nan),
)

#: Name of such a statement, its kind, and the share.
_LOSS = re.compile(r"((\w+?)_(?:at_(.+)_percent_lost|halfway_to_hertz))_mean")
#: Headings of what is known where a share of the area is lost, and meanings.
_LOSSES = {
    "speed": ("{long} at {V}", ""),
    "steady_speed": (
        "{short}, if\nsteady, at {V}",
        "about the speed of the same loss in steady sliding",
    ),
    "lost_to_bonds": ("at {short} lost:\nto bonds", "share of A_JKR, subtracted first"),
    "lost_to_fluctuations": (
        "at {short} lost:\nto fluct.",
        "share of A_JKR, subtracted after the bonds",
    ),
    "lost_to_fluctuations_first": (
        "at {short} lost: to\nfluct. (first)",
        "share of A_JKR, subtracted before the bonds",
    ),
    "lost_to_bonds_last": (
        "at {short} lost: to\nbonds (last)",
        "share of A_JKR, subtracted after the fluctuations",
    ),
    "lost_to_mean_stress": ("at {short} lost:\nto stress", "share of A_JKR"),
    "lost_to_lag": ("at {short} lost:\nto lag", "share of A_JKR"),
}

#: Heading and meaning of the correlation time.
_MEMORY = _Column("correlation_time", "t_c", meaning="integral correlation time of ΔΓ")

#: Values of a sweep from which on an extreme inside is worth a note.
_TURNS = 3
#: Shares below it are nothing; spread over the mean below which a motion without noise has settled.
_ROUNDING, _SETTLED = 1e-13, 1e-3
#: Rows of a CSV file that are written at once.
_LINES = 2**15


def stated(
    dataset: xr.Dataset, lost: Sequence[str] = (), every: xr.Dataset | None = None
) -> xr.Dataset:
    """Return the statements that the tables print, with speeds at which shares of the area are ``lost``.

    If ``every`` statement has been computed before, they are chosen from these.
    """
    if every is None:
        return statements(dataset, [column.name for column in _COLUMNS], lost)
    printed = tuple(
        f"{column.name}_"
        for column in (*_COLUMNS, *_EVENTS, *_PHASES, *_of_losses(every))
    )
    return every.drop_vars(
        [name for name in every if not str(name).startswith(printed)]
    )


def _of_losses(stated: xr.Dataset, symbol: str = "V") -> list[_Column]:
    """Return the columns of losses of area."""
    columns = []
    for match in filter(None, map(_LOSS.fullmatch, map(str, stated))):
        name, kind, share = match.groups()
        heading, meaning = _LOSSES[kind]
        long, short = (
            (f"{share} % of area\nlost", f"{share} %")
            if share
            else ("halfway to\nHertz", "halfway")
        )
        heading = heading.format(long=long, short=short, V=symbol)
        columns.append(
            _Column(
                name, heading, math.nan if "speed" in kind else 0.0, meaning=meaning
            )
        )
    return columns


def table(
    dataset: xr.Dataset, rows: int = 12, stated: xr.Dataset | None = None
) -> list[dict[str, str]]:
    """Return the statistics in about a dozen rows for the terminal.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    stated : xarray.Dataset, optional
        Its ``statements``, if they have been computed before.
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
    held, steady = bool(stays_held(dataset).all()), is_steady(dataset)
    columns = [
        c
        for c in _COLUMNS
        if not (c.changing and (steady if c.name == "stage_speed" else held))
    ]
    means, points = _tabulated(
        dataset, rows, [column.name for column in columns], stated
    )
    one_row_each = _has_one_row_each(dataset)
    cells = _places(
        means,
        {
            name: index
            for name, index in points.items()
            if name != "t" or not one_row_each
        },
    )
    if one_row_each and any(
        name in points
        for name in dataset.coords.get("drive_speed", xr.DataArray()).dims
    ):
        # V is a column already
        columns = [column for column in columns if column.name != "speed"]
    cells |= _shown(means, points, columns)
    times, errors, below = (
        _at(means[f"correlation_time{kind}"], points) for kind in ("", "_sem", "_below")
    )
    if np.any(np.isfinite(times) | np.isfinite(below)):
        ((heading, texts),) = _cells(
            _MEMORY.heading, "s", np.where(np.isnan(times), below, times), errors
        ).items()
        cells[heading] = [
            f"<{text}" if math.isfinite(most) else text
            for text, most in zip(texts, below, strict=True)
        ]
    return _rows(cells)


def unresolved(dataset: xr.Dataset) -> str:
    """Return a sentence on the trajectories whose motion was not resolved to the end, and its cure; "" without any."""
    if "unresolved_time" in dataset:
        times = dataset["unresolved_time"]
        count, total = int(times.notnull().sum()), times.size
    elif "unresolved_time_count" in dataset:  # statistics over the members
        numbers = dataset["unresolved_time_count"]
        count, total = int(numbers.sum()), numbers.size * int(dataset.attrs["members"])
    else:
        return ""
    if not count:
        return ""
    return (
        f"{count} of {total} trajectories could not be resolved: their values are missing from unresolved_time on; set"
        " a shorter clock.step, or drive.viscosity or drive.damping, which delay a slip"
    )


def notes(
    dataset: xr.Dataset,
    rows: list[dict[str, str]],
    once: list[dict[str, str]],
    stated: xr.Dataset | None = None,
) -> list[str]:
    """Return notes on the rows of ``table`` and ``highlights``: sample of the means, number of rows,
    symbols, and reasons for missing statements.
    """
    one_row_each, points = _has_one_row_each(dataset), dataset["contact_modulus"].size
    phrases = [words] if (words := averaging(dataset, one_row_each)) else []
    if "runaway_time" in dataset and (
        gone := int(dataset["runaway_time"].isel(t=-1).notnull().sum())
    ):
        phrases.append(
            f"{gone} of {dataset['runaway_time'].isel(t=-1).size} trajectories end in a runaway: the slider lost"
            " stability"
        )
    if sentence := unresolved(dataset):
        phrases.append(sentence)
    if any("(" in cell for row in rows for cell in row.values()):
        phrases.append(
            "brackets: standard error in the last digits, larger if there are few members"
        )
    if any(
        " to " in cell for row in (*rows, *once) for cell in row.values() if "(" in cell
    ):
        phrases.append("near 0 and 100 %: 95 % interval")
    lines = ["; ".join(phrases)] if phrases else []
    for shown, total in (
        (rows, points if one_row_each else points * dataset.sizes["t"]),
        (once, points),
    ):
        if 0 < len(shown) < total:
            lines.append(
                f"{len(shown)} of {total} rows shown; see --all, --csv FILE and --where KEY=VALUE"
            )
    headings = {
        re.sub(r"[ \n]\([^()]*\)$", "", heading)
        for row in (*rows[:1], *once[:1])
        for heading in row
    }
    # not of every dataset; none where all was recorded
    with contextlib.suppress(KeyError, TypeError):
        recorded = (
            ", ".join(resolved(dataset, "record.quantities")) or "contact_radius alone"
        )
        lines.append(
            f"no columns for quantities that were not recorded; record.quantities has {recorded}"
        )
    columns = (*_COLUMNS, *_EVENTS, *_of_losses(stated or xr.Dataset()))
    headed = {c.name: " ".join(c.heading.split()) for c in columns}
    for reason, names in reasons(stated or xr.Dataset()).items():
        if shown_names := [headed[name] for name in names if name in headed]:
            lines.append(f"* {', '.join(dict.fromkeys(shown_names))}: {reason}")
    lines += [
        f"systematic error: {error}"
        for error in systematic_errors(dataset)
        if error.matters
    ]
    lines += filter(None, [unresolved_slips(dataset)])
    lines += _turning(dataset, stated) if one_row_each and stated else []
    known = [
        c for c in (*_COLUMNS, _MEMORY, *_EVENTS) if c.meaning and c.heading in headings
    ]
    if _spreads(dataset):
        over = averaging(dataset, True).removeprefix("mean over the ")
        lines.append(
            f"by quantity: over the {over}; free values: the effective number of independent values"
        )
    words = "; ".join(
        f"{' '.join(column.heading.split())}: {column.meaning}" for column in known
    )
    return [*dict.fromkeys(lines), *filter(None, [words])]


def _turning(dataset: xr.Dataset, stated: xr.Dataset) -> Iterator[str]:
    """Yield where area and friction are largest or least inside a sweep of one number: they are not monotonic."""
    swept = [name for name in sweep_dims(dataset) if dataset.sizes[name] > 1]
    if (
        len(swept) != 1
        or dataset[swept[0]].dtype.kind not in "fi"
        or dataset.sizes[swept[0]] < _TURNS
    ):
        return
    for name in (
        name for name in ("contact_area", "friction_force") if f"{name}_mean" in stated
    ):
        if bool((stated.get(f"{name}_reason", xr.DataArray("")) != "").any()):
            continue  # values at an end are no means
        curves = stated[[f"{name}_{end}" for end in ("mean", "low", "high")]]
        inside = extremes(
            curves.isel({n: 0 for n in sweep_dims(dataset) if n != swept[0]}),
            name,
            swept[0],
        )
        for extreme in ("largest", "least"):
            if math.isfinite(value := float(inside[f"{name}_{extreme}"])):
                places = (
                    inside[f"{name}_{extreme}_at{end}"] for end in ("", "_low", "_high")
                )
                at, low, high = (
                    engineering(float(place), place.units) for place in places
                )
                size = engineering(value, stated[f"{name}_mean"].attrs["units"])
                yield f"{name.replace('_', ' ')} is {extreme}, {size}, at {swept[0]} = {at} (between {low} and {high})"


def highlights(
    dataset: xr.Dataset, rows: int = 12, stated: xr.Dataset | None = None
) -> list[dict[str, str]]:
    """Return the events of each point of the sweep, in at most a dozen rows; none without events.

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
    once = of_events(dataset) if stated is None else stated
    return _once(
        once, [column for column in _EVENTS if _of_drive(dataset, column.name)], rows
    )


def losses(
    dataset: xr.Dataset, rows: int = 12, stated: xr.Dataset | None = None
) -> list[dict[str, str]]:
    """Return the speeds of losses of area, with a row for each point of the sweep of other keys."""
    speeds = as_means(loss_speeds(dataset)) if stated is None else stated
    return _once(
        speeds,
        _of_losses(speeds, "stage" if speed_name(dataset) == "stage_speed" else "V"),
        rows,
    )


def phases(
    dataset: xr.Dataset, rows: int = 12, stated: xr.Dataset | None = None
) -> list[dict[str, str]]:
    """Return the slip events in each phase of the course of a stage, with a row for each phase."""
    return _once(of_events(dataset) if stated is None else stated, _PHASES, rows)


def _once(
    stated: xr.Dataset, columns: Sequence[_Column], rows: int
) -> list[dict[str, str]]:
    """Return statements of a whole run, a row for each point of their dimensions; no rows if there are none."""
    chosen = stated[
        [
            name
            for name in stated
            if str(name).startswith(tuple(f"{c.name}_" for c in columns))
        ]
    ]
    sizes = {
        str(name): size for name, size in chosen.sizes.items() if name != "quantile"
    }
    points = _points(sizes, _thinned(sizes, rows))
    shown = _shown(chosen, points, columns)
    return _rows(_places(chosen, points) | shown) if shown else []


def key_figures(dataset: xr.Dataset, stated: xr.Dataset) -> list[dict[str, str]]:
    """Return the statements of a run without a sweep, a row each: symbol, value, and definition with the sample."""
    known = (*_COLUMNS, *_EVENTS, *_PHASES, *_of_losses(stated))
    columns = {
        c.name: c for c in known if not c.changing and _of_drive(dataset, c.name)
    }
    rows = []
    for statement in each(stated):
        column = columns.get(statement.name)
        unknown = math.isnan(statement.value) and not statement.reason
        if column is None or unknown or abs(statement.value - column.dull) < _ROUNDING:
            continue
        text, over = (
            column.meaning or statement.text,
            statement.over and f"; mean over the {statement.over}",
        )
        places = [
            f"phase {at}" if name == "phase" else str(at)
            for name, at in statement.at.items()
        ]
        heading = ", ".join([" ".join(column.heading.split()), *places])
        rows.append(
            {
                "": heading,
                "value": str(statement),
                "definition": text[:1].upper() + text[1:] + over,
            }
        )
    return rows


def _of_drive(dataset: xr.Dataset, name: str) -> bool:
    """Return True if an event is shown under this drive: the speed of a peak on a ramp, its time after a start.

    And kinetic friction of a stage at one speed, else it is a mean over speeds.
    """
    if name == "kinetic_friction" and "stage_speed" in dataset:
        return not varies(dataset)
    drives = {"speed": "ramp", "time": "start"}
    wanted = drives.get(name.rpartition("_")[2]) if name.startswith("peak_") else None
    return wanted is None or bool((word(dataset, "drive.model", "") == wanted).any())


def narrow(
    rows: list[dict[str, str]], keys: int, most: int = 10
) -> list[list[dict[str, str]]]:
    """Return a table as several of at most so many columns, each with the first ``keys`` columns of the table."""
    headings = list(rows[0]) if rows else []
    values = headings[keys:]
    count = math.ceil(len(values) / max(most - keys, 1))
    parts = [
        [str(name) for name in part]
        for part in np.array_split(np.array(values, object), max(count, 1))
    ]
    return [
        [{name: row[name] for name in (*headings[:keys], *part)} for row in rows]
        for part in parts
        if rows
    ]


def _places(places: xr.Dataset, points: Points) -> Columns:
    """Return the columns of the place in the sweep and the time of each row."""
    cells: Columns = {}
    # then long names on one line part their values
    several = len(points.keys() - {"t"}) > 1
    for name, index in points.items():
        heading = name.replace("_", "_\n", 1) if several else name
        cells |= _cells(
            heading,
            places[name].attrs.get("units", "1"),
            places[name][index].to_numpy(),
        )
    return cells


def _range(means: xr.Dataset, name: str, heading: str, points: Points) -> Columns:
    """Return the least and largest value of an event over its cycles, or the quantiles of a time over members."""
    if name == "first_detachment" and f"{name}_quantile" in means:
        low, high = (
            _at(means[f"{name}_quantile"].isel(quantile=end), points) for end in (0, -1)
        )
        count = re.match(r"\d+(?= member)", means[f"{name}_mean"].attrs.get("over", ""))
        fewest = (
            float(count[0]) * np.nanmin(_at(means["ever_detached_mean"], points))
            if count
            else math.inf
        )
        heading = "5 to 95 %\nof members" + (
            ", interpolated" if fewest < FOR_TAILS else ""
        )
    elif f"{name}_least_mean" in means:
        low, high = (
            _at(means[f"{name}_{end}_mean"], points) for end in ("least", "largest")
        )
        heading = f"{' '.join(heading.split())},\nleast to largest"
    else:
        return {}
    factor, shown = scaled(
        float(np.nanmax(np.abs([low, high]), initial=0.0)),
        means[f"{name}_mean"].attrs["units"],
    )
    ends = [[concise(factor * end, 0.0) for end in column] for column in (low, high)]
    if ends[0] == ends[1]:
        return {}
    texts = [" to ".join(pair) for pair in zip(*ends, strict=True)]
    return {f"{heading} ({shown})": texts}


def _shown(means: xr.Dataset, points: Points, columns: Iterable[_Column]) -> Columns:
    """Return the columns that are not constant at their dull value at these points."""
    cells: Columns = {}
    for column in columns:
        name, heading, dull, *_ = column
        if f"{name}_mean" not in means:
            continue
        mean, low, high = (
            _at(means.get(f"{name}_{kind}"), points) for kind in ("mean", "low", "high")
        )
        unit = means[f"{name}_mean"].attrs.get("units", "1")
        # differences of areas leave rounding behind
        if unit == "1" and name not in COUNTS:
            unit, mean = "%", np.where(np.abs(mean) < _ROUNDING, 0.0, mean)
        if not np.all(
            (mean == dull) | (np.isnan(mean) & np.isnan(low) & np.isnan(high))
        ):
            # of few members above the standard error
            error = (high - low) / (2.0 * WIDE)
            ((heading, texts),) = _cells(heading, unit, mean, error, low, high).items()
            if name in BOUNDED:
                texts = [
                    share(*ends) or text
                    for *ends, text in zip(mean, low, high, texts, strict=True)
                ]
            if f"{name}_reason" in means:
                has_reason = _at(means[f"{name}_reason"], points) != ""
                texts = [
                    f"{text}*" if marked else text
                    for text, marked in zip(texts, has_reason, strict=True)
                ]
            cells[heading] = texts
            cells |= _range(means, name, column.heading, points)
    return cells


def _at(variable: xr.DataArray | None, points: Points) -> Array:
    """Return the values of a variable at each row; nan if there is no such variable."""
    count = next(iter(points.values())).size if points else 1
    values = (
        np.nan
        if variable is None
        else variable.variable.isel(points, missing_dims="ignore").to_numpy()
    )
    return np.broadcast_to(values, count)


def _rows(cells: Columns) -> list[dict[str, str]]:
    return [
        dict(zip(cells, row, strict=True)) for row in zip(*cells.values(), strict=True)
    ]


def _tabulated(
    dataset: xr.Dataset, rows: int, names: list[str], stated: xr.Dataset | None
) -> tuple[xr.Dataset, Points]:
    """Return statistics of observables to tabulate, and the index of each row in every dimension of sweep and time."""
    memory, counts = (
        correlation_time(dataset),
        _thinned(dataset["contact_modulus"].sizes, rows),
    )
    counts["t"] = max(1, rows // math.prod(counts.values()))
    if _has_one_row_each(dataset):
        result = statements(dataset, names) if stated is None else stated
    else:
        dataset = with_slips(dataset)
        # of the records only those that are shown, none after all have ended
        if counts["t"] < dataset.sizes["t"]:
            dataset = dataset.isel(t=slice(_last(dataset) + 1))
            dataset = restricted(dataset, names).isel(
                t=_spread(dataset.sizes["t"], counts["t"])
            )
        result = over_members(dataset, names, quantiles=False)
        # it is known of open contacts too
        if "applied_load" in dataset and "normal_load_mean" in result:
            for kind in ("mean", "low", "high"):
                result[f"normal_load_{kind}"] = dataset["applied_load"].fillna(
                    result[f"normal_load_{kind}"]
                )
    return result.merge(memory, compat="no_conflicts"), _points(
        {**result.sizes, "t": result.sizes.get("t", 1)}, counts
    )


def _has_one_row_each(dataset: xr.Dataset) -> bool:
    """Return True if each point of a sweep has one row, its mean over the second half of the run."""
    return bool(sweep_dims(dataset)) and _lasts(dataset)


def _lasts(dataset: xr.Dataset) -> bool:
    """Return True if speed and control are constant and a trajectory lasts to the second half of the run."""
    return is_stationary(dataset) and _last(dataset) >= dataset.sizes["t"] // 2


def _last(dataset: xr.Dataset) -> int:
    """Return the last record of any trajectory: after it all of them have stopped."""
    radius = next(
        (
            dataset[name]
            for name in ("contact_radius", "contact_radius_mean")
            if name in dataset
        ),
        None,
    )
    last = dataset.sizes["t"] - 1
    if radius is None or bool(radius.isel(t=last).notnull().any()):
        return last
    return bisect.bisect_left(
        range(1, last), True, key=lambda at: bool(radius.isel(t=at).isnull().all())
    )


def _points(sizes: Mapping[Any, int], counts: dict[str, int]) -> Points:
    """Return the index of each row in every dimension."""
    chosen = np.meshgrid(
        *(_spread(sizes[name], count) for name, count in counts.items()), indexing="ij"
    )
    return {
        name: xr.Variable("row", index.ravel())
        for name, index in zip(counts, chosen, strict=True)
    }


def _thinned(sizes: Mapping[Any, int], rows: int) -> dict[str, int]:
    """Return numbers of values of the sweep's dimensions that make at most ``rows`` points, two of each at least."""
    counts = dict(sizes)
    while math.prod(counts.values()) > rows and max(counts.values()) > 2:
        counts[max(counts, key=counts.__getitem__)] -= 1
    return counts


def _spread(size: int, count: int) -> Array:
    """Return at most ``count`` indices evenly over ``size``, the last included."""
    count = min(size, count)
    return np.rint(np.linspace(0 if count > 1 else size - 1, size - 1, count)).astype(
        int
    )


def _cells(
    heading: str, unit: str, values: Array, errors: Any = 0.0, *ends: Array
) -> Columns:
    """Return a column's cells in the unit of its largest value, under its heading with that unit."""
    if values.dtype.kind not in "fi":
        return {heading: [str(value) for value in values]}
    sizes = np.abs(
        values if np.any(np.isfinite(values)) else np.concatenate([values, *ends])
    )
    finite = sizes[np.isfinite(sizes)]
    factor, shown = (
        (100.0, "%") if unit == "%" else scaled(finite.max(initial=0.0), unit)
    )
    texts = [
        bounded(*(factor * number for number in numbers))
        for numbers in np.broadcast(values, errors, *ends)
    ]
    gap = " " if "\n" in heading else "\n"
    return {f"{heading}{gap}({shown})" if shown else heading: texts}


def spread(
    dataset: xr.Dataset, stated: xr.Dataset | None = None
) -> list[dict[str, str]]:
    """Return the spread of each quantity over members and stationary time, a row each; no rows of a sweep."""
    if not _spreads(dataset):
        return []
    fixed = [column for column in _COLUMNS if not column.changing]
    stated = (
        statements(dataset, [column.name for column in fixed])
        if stated is None
        else stated
    )
    result = stated.isel(dict.fromkeys(sweep_dims(dataset), 0))
    fixed = [column for column in fixed if f"{column.name}_std" in result]
    least = _ROUNDING if bool(has_noise(dataset).any()) else _SETTLED
    varied = (
        c
        for c in fixed
        if result[f"{c.name}_std"] > least * abs(result[f"{c.name}_mean"])
    )
    return [_spread_of(result, column) for column in varied]


def _spreads(dataset: xr.Dataset) -> bool:
    """Return True for one stationary run of members that differ."""
    return (
        dataset["contact_modulus"].size == 1
        and MEMBERS in dataset.sizes
        and _lasts(dataset)
    )


def _spread_of(means: xr.Dataset, column: _Column) -> dict[str, str]:
    """Return a row of ``spread``."""

    def of(kind: str) -> Array:
        return means[f"{column.name}_{kind}"].to_numpy()

    unit = means[f"{column.name}_mean"].attrs.get("units", "1")
    factor, shown = (
        (100.0, "%")
        if unit == "1"
        else scaled(float(np.max(np.abs(of("quantile")))), unit)
    )
    error, *errors = (
        factor
        * np.append(of("high") - of("low"), of("quantile_high") - of("quantile_low"))
        / (2.0 * WIDE)
    )
    row = {"quantity": f"{' '.join(column.heading.split())} ({shown})"}
    row |= {
        "mean": concise(factor * float(of("mean")), error),
        "sd": f"{factor * of('std'):.3g}",
    }
    for level, value, sem in zip(
        QUANTILES, factor * of("quantile"), errors, strict=True
    ):
        row[f"{100.0 * level:.0f} %"] = concise(value, sem)
    time = float(means.get(f"{column.name}_correlation_time", math.nan))
    step, unit = scaled(time, "s")
    row["t_c"] = "–"
    if time > 0.0:
        row["t_c"] = (
            f"{concise(step * time, step * float(of('correlation_time_sem')))} {unit}"
        )
    return row | {"free values": f"{of('effective_samples'):.3g}"}


# --- a long table for other programs, and a data frame ---


_TEXTS = "quantity", "unit", "over"
#: Columns of statistics, and the endings of their names in a dataset in which each quantile is a variable.
_ENDINGS = {"mean": "mean", "error": "sem", "low": "low", "high": "high", "sd": "std"}
_ALIKE = [
    f"q{100 * level:02.0f}{end}" for level in QUANTILES for end in ("", "_low", "_high")
]
_ENDINGS |= {name: name for name in (*_ALIKE, "effective_samples", "correlation_time")}
_ENDINGS |= {"correlation_time_error": "correlation_time_sem"}


def to_csv(
    dataset: xr.Dataset,
    path: str | os.PathLike,
    wide: bool = False,
    every: bool = False,
    lost: Sequence[str] = (),
    stated: xr.Dataset | None = None,
) -> None:
    """Write all statistics as one long table, as ``tidy`` gives them, or as a wide one.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    path : path
        The file: a header, then one row for each quantity, sweep value and time. A file is there whole or, in trouble,
        as it was before.
    wide : bool
        True for a row for each point of the sweep, with a column for each statement, its error and its bounds, in the
        units of ``in_units``, else in SI.
    every : bool
        True for a wide table of a row for each record, with all statistics.
    stated : xarray.Dataset, optional
        Its ``statements``, if they have been computed before.
    """
    if wide:
        rows = in_columns(dataset, every, lost, stated)
        names = header = list(rows)
        parts = [{name: rows[name].to_numpy() for name in names}]
    else:
        names, parts = _long(dataset, lost, stated)
        units = {
            str(name): variable.attrs.get("units", "1")
            for name, variable in dataset.coords.items()
        }
        header = [
            _with_unit(name, (units | {"speed": "m/s"}).get(name, "1"))
            for name in names
        ]
    with (
        output(Path(path)) as beside,
        beside.open("w", encoding="utf-8", newline="") as file,
    ):
        file.write(",".join(_quoted(header)) + "\n")
        for part in parts:
            columns = [part.get(name, np.array(np.nan)).ravel() for name in names]
            count = max(map(len, columns), default=0)
            # because the texts of all rows together take much memory
            for start in range(0, count, _LINES):
                rows = slice(start, min(start + _LINES, count))
                fields = (
                    _texts(values[rows])
                    if len(values) == count
                    else _texts(values) * (rows.stop - start)
                    for values in columns
                )
                file.writelines(
                    f"{line}\n" for line in map(",".join, zip(*fields, strict=True))
                )


def _texts(values: Array) -> list[str]:
    """Return a column as fields of CSV, each different value written once."""
    # 0.0 and -0.0 differ
    bits = values.view(np.int64) if values.dtype == np.float64 else values
    places, alike = pd.factorize(bits, use_na_sentinel=False)
    texts = (
        _quoted(alike)
        if bits is values
        else list(map(repr, alike.view(np.float64).tolist()))
    )
    return list(map(texts.__getitem__, places.tolist()))


def _quoted(values: Iterable[Any]) -> list[str]:
    """Return values as fields of CSV, with quotation marks if they are needed."""
    fields: list[str] = []
    for value in values:
        line = io.StringIO()
        csv.writer(line, lineterminator="").writerow(
            ["nan" if pd.isna(value) else value, ""]
        )
        fields.append(line.getvalue()[:-1])
    return fields


def _with_unit(name: str, unit: str) -> str:
    return name if unit in ("1", "") else f"{name} [{unit}]"


def in_columns(
    dataset: xr.Dataset,
    every: bool = False,
    lost: Sequence[str] = (),
    stated: xr.Dataset | None = None,
) -> pd.DataFrame:
    """Return the statements of a run, a row for each point of the sweep; with ``every`` all statistics at each record.

    Returns
    -------
    pandas.DataFrame
        A column ``name [unit]`` for each swept key and statement, and if they are known ``name_error``, ``name_low``
        and ``name_high`` (95 % interval) and ``name_reason``. Units are those of ``in_units``, else SI.
    """
    stated = (
        xr.Dataset()
        if every
        else statements(dataset, lost=lost)
        if stated is None
        else stated
    )
    wanted = re.compile(
        "(?!.*_(quantile|correlation_time)).*_(mean|sem|low|high|reason)"
    )
    stated = stated.drop_dims("phase", errors="ignore")
    rows = (
        frame(dataset)
        if every
        else _framed(dataset, stated[[n for n in stated if wanted.fullmatch(str(n))]])
    )
    units, columns = rows.attrs["units"], {}
    for name in rows.replace("", np.nan).dropna(axis="columns", how="all"):
        stem, _, end = name.rpartition("_")
        exact = (
            0.0
            if end == "sem"
            else rows.get(f"{stem}_mean")
            if end in ("low", "high")
            else None
        )
        # numbers without noise have no error
        if exact is None or not np.all(rows[name] == exact):
            factor, unit = chosen_unit(units.get(name, "1")) or (
                1.0,
                units.get(name, "1"),
            )
            heading = _with_unit(
                re.sub("_sem$", "_error", name.removesuffix("_mean")), unit
            )
            columns[heading] = rows[name] if factor == 1.0 else factor * rows[name]
    return pd.DataFrame(columns)


def tidy(dataset: xr.Dataset, lost: Sequence[str] = ()) -> pd.DataFrame:
    """Return all statistics, one row for each quantity, sweep value and time, in SI.

    Returns
    -------
    pandas.DataFrame
        Columns: the swept keys; ``t`` [s], nan where a number is of the whole run or of its second half; the prescribed
        ``speed`` [m/s]; ``quantity``, its ``unit``, and what its ``mean`` is ``over``; ``error`` (standard error),
        ``low`` and ``high`` (95 % interval) of the mean; ``sd``; quantiles ``q05``, ``q50``, ``q95`` with
        the ends of their intervals; ``effective_samples``, ``correlation_time`` and ``correlation_time_error`` [s].
    """
    names, parts = _long(dataset, lost)
    wholes = (
        {n: np.broadcast_to(v, part["mean"].shape).ravel() for n, v in part.items()}
        for part in parts
    )
    return pd.concat(map(pd.DataFrame, wholes), ignore_index=True)[names]


def _long(
    dataset: xr.Dataset, lost: Sequence[str], stated: xr.Dataset | None = None
) -> tuple[list[str], list[dict[str, Array]]]:
    """Return the columns of ``tidy``, and those of each quantity over its dimensions; a text is shared by all rows."""
    places, parts, speeds = (
        [*map(str, dataset["contact_modulus"].coords), "branch", "phase", "t"],
        [],
        {},
    )
    stated, members = (
        statements(dataset, lost=lost) if stated is None else stated,
        averaging(dataset, False),
    )
    if speed_name(dataset) in dataset:
        speed = speed_of(dataset).compute()
        speeds = {
            True: speed,
            False: speed.isel(t=0, drop=True).where(steady_points(dataset)),
        }
    for group, sample in (
        (over_members(dataset), members.removeprefix("mean over the ")),
        (stated, ""),
    ):
        group, dims = _flat(group), (*sweep_dims(dataset), *places[-3:])
        known = {
            name: group.coords[name].variable for name in places if name in group.coords
        }
        # or none
        known |= {
            name: phase.astype(float)
            for name, phase in known.items()
            if phase.dtype.kind == "i"
        }
        for key in (str(key) for key in group if str(key).endswith("_mean")):
            name, mean = key.removesuffix("_mean"), group.variables[key]
            columns: dict[str, Any] = known | (
                {"speed": speeds["t" in mean.dims].variable} if speeds else {}
            )
            columns |= {
                column: group.variables.get(f"{name}_{end}")
                for column, end in _ENDINGS.items()
            }
            sizes = {dim: mean.sizes[dim] for dim in dims if dim in mean.dims}
            texts = (
                name,
                mean.attrs.get("units", "1"),
                mean.attrs.get("over", sample) or "one run",
            )
            parts.append(
                dict(
                    zip(_TEXTS, (np.array(text, object) for text in texts), strict=True)
                )
            )
            for column, values in columns.items():
                if values is not None and set(values.dims) <= sizes.keys():
                    parts[-1][column] = (
                        values.to_base_variable().set_dims(sizes).to_numpy()
                    )
    names = (*places, "speed", *_TEXTS, *_ENDINGS)
    return [name for name in names if any(name in part for part in parts)], parts


def frame(dataset: xr.Dataset) -> pd.DataFrame:
    """Return all statistics at all times and sweep values, one row each; ``attrs["units"]`` holds units by column."""
    return _framed(dataset, statistics(dataset))


def _framed(dataset: xr.Dataset, statistics: xr.Dataset) -> pd.DataFrame:
    """Return a data frame of a row for each point of the sweep and, if statistics have times, each record."""
    flat = _flat(statistics)
    dims = [name for name in (*sweep_dims(dataset), "branch", "t") if name in flat.dims]
    table = (
        flat.expand_dims("row")
        .to_dataframe(dim_order=["row", *dims])
        .reset_index()
        .drop(columns="row")
    )
    table.attrs["units"] = {
        str(name): variable.attrs.get("units", "1")
        for name, variable in flat.variables.items()
    }
    return table


def _flat(statistics: xr.Dataset) -> xr.Dataset:
    """Return statistics in which each quantile is a variable."""
    flat: dict[str, xr.Variable] = {}
    for key in map(str, statistics):
        variable, (stem, _, end) = (
            statistics.variables[key],
            key.rpartition("_quantile"),
        )
        levels = QUANTILES if "quantile" in variable.dims else ()
        flat |= {
            f"{stem}_q{100 * level:02.0f}{end}": variable.isel(quantile=k)
            for k, level in enumerate(levels)
        }
        flat |= {} if levels else {key: variable}
    return statistics.drop_vars([*statistics, "quantile"], errors="ignore").assign(flat)
