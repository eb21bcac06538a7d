"""Tables of statistics for people: a few columns that the scene is about, and notes on what they hold."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sim.laws.limits import FINITE_STRAIN
from sim.quantities import OPEN_THROUGHOUT, QUANTITIES, Definition, Form
from sim.read.control_variate import control_variate, is_corrected
from sim.read.correlation import WIDE, Array
from sim.read.dataset import MEMBERS, ensemble_mean, only_statistics, recorded_share
from sim.read.errors import systematic_errors
from sim.read.estimate import Estimate, Estimates
from sim.read.observables import restricted, with_slips
from sim.read.over_speed import extremes
from sim.read.peaks import PLACES, UNRESOLVED
from sim.read.run import Run
from sim.read.slips import unresolved_slips
from sim.read.statistics import QUANTILES, over_members, with_a_value
from sim.units import notebook
from sim.units.notation import bounded, concise, engineering, scaled, share

#: Cells of columns by heading.
Cells = dict[str, list[str]]
#: The index of each row along the dimensions of sweep and time, and the values along them.
Points = dict[str, xr.Variable]
Places = Mapping[Any, xr.DataArray]

#: Columns of a table at most, those of its place included.
MOST = 10
#: Values of a sweep from which on an extreme inside is worth a note.
_TURNS = 3
#: Shares, and values over the largest of a column, below which they are of rounding; spread over the mean below
#: which a motion without noise has settled.
_ROUNDING, _SETTLED = 1e-13, 1e-3
#: Ratio of the largest value of a column to its least, above which its unit is that of their geometric mean.
_WIDE = 3e3
#: A number in a sentence, in place of which sentences are compared.
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


class Column(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    definition : Definition
        The row of its quantity in the registry.
    dull : float
        A value that says nothing: a column of it alone is left out; nan if none.
    """

    definition: Definition
    dull: float = 0.0

    @property
    def name(self) -> str:
        """The name of its quantity."""
        return self.definition.name

    @property
    def heading(self) -> str:
        """The heading of the quantity in the registry."""
        return self.definition.heading


class Reason(NamedTuple):
    """The reason of a cell that is missing or no mean: its heading, the reason, and the point of the sweep in words."""

    heading: str
    text: str
    place: str


class Sample(NamedTuple):
    """The sample of a column: its heading, the least number of members with a value in a row, and if it differs."""

    heading: str
    least: int
    differs: bool


class Table(NamedTuple):
    """A table for people: cells by heading, with the unit of the column in the heading.

    Attributes
    ----------
    rows : list of dict
        Cells by heading.
    keys : int
        Number of columns that say where a row belongs: swept keys and time.
    total : int
        Number of rows that there are, of which those of the table are a part.
    columns : tuple of Column
        The columns that are no keys.
    left_out : tuple of Column
        Columns that would make the table too wide.
    reasons : tuple of Reason
        Reasons of its cells that are missing or are no means.
    samples : tuple of Sample
        Samples of its columns, if the number of members is known.
    """

    rows: list[dict[str, str]]
    keys: int = 0
    total: int = 0
    columns: tuple[Column, ...] = ()
    left_out: tuple[Column, ...] = ()
    reasons: tuple[Reason, ...] = ()
    samples: tuple[Sample, ...] = ()

    def _repr_html_(self) -> str:
        return notebook.table(self.rows)


def _columns(*names: str, dull: float = 0.0) -> tuple[Column, ...]:
    return tuple(Column(QUANTITIES[name], dull) for name in names)


#: Columns over time or sweep.
MAIN = (
    *_columns("stage_speed", "speed", "normal_load", "displacement"),
    *_columns("bond_fraction", dull=1.0),
    *_columns("fluctuation_energy", "edge_energy"),
    *_columns("work_of_adhesion", "contact_radius", dull=math.nan),
    *_columns("area_ratio", "friction_force", "fraction_detached", "fraction_masked"),
    *_columns("dissipated_energy"),
    *_columns("correlation_time", dull=math.nan),
)
#: Those of them that are left out first, if there are too many.
_LEFT_OUT_FIRST = (
    "edge_energy",
    "dissipated_energy",
    "work_of_adhesion",
    "bond_fraction",
    "correlation_time",
    "fluctuation_energy",
    "displacement",
)
#: Shares of the JKR area by mechanism.
LOSSES = _columns(
    "lost_to_bonds",
    "lost_to_fluctuations",
    "lost_to_fluctuations_first",
    "lost_to_bonds_last",
    "lost_to_mean_stress",
    "lost_to_lag",
)
#: Groups of columns that are printed if a person asks for them, and what they hold.
GROUPS = {
    "losses": "shares of the JKR area by mechanism, in both orders",
    "slips": "further properties of slip events, and of each phase",
    "all": "all columns",
}


#: Columns of a whole run.
EVENTS = (
    *_columns("time_masked", "ever_masked"),
    *_columns("half_masked", dull=math.nan),
    *_columns("ever_detached", "half_detached", "detached_rate"),
    *_columns("loop_energy", "loop_dissipation", "total_dissipated"),
    *_columns(
        "pull_off_load", "pull_off_time", "lowest_load", "jump_in_load", dull=math.nan
    ),
    *_columns("peak_stress"),
    *_columns("peak_speed", "peak_time", dull=math.nan),
    *_columns("peak_friction"),
    *_columns("peak_friction_speed", "peak_friction_time", dull=math.nan),
    *_columns("static_threshold", "area_at_threshold", dull=math.nan),
    *_columns("hold_growth", "hold_saturation", dull=math.nan),
    *_columns("slip_count", "ran_away"),
    *_columns("onset_steady_speed", "onset_slip_speed", dull=math.nan),
    *_columns("end_slip_speed", "end_steady_speed", dull=math.nan),
    *_columns(
        "runaway_after",
        "static_friction",
        "kinetic_friction",
        "force_drop",
        "slip_amplitude",
        "recurrence_time",
        dull=math.nan,
    ),
)
#: Further columns of slip events.
SLIPS = _columns("slip_spread", "slip_duration", "stick_duration", dull=math.nan)
#: Columns of each phase.
PHASES = (
    *_columns("phase_start", "phase_time_held"),
    *_columns("phase_peak_after_hold", dull=math.nan),
    *_columns("phase_slip_count"),
    *_columns("phase_static_friction", dull=math.nan),
    *_columns("phase_force_drop", "phase_recurrence_time", dull=math.nan),
)

#: Name of such a statement, its kind, and the share.
_LOSS = re.compile(r"(\w+?)_(?:at_(.+)_percent_lost|halfway_to_hertz)")
#: Headings of what is known where a share of the area is lost.
_LOSSES = {
    "speed": "{place} at {V}",
    "steady_speed": "{place}, if steady at {V}",
    "lost_to_bonds": "{place}: to bonds",
    "lost_to_fluctuations": "{place}: to fluct.",
    "lost_to_fluctuations_first": "{place}: to fluct. (first)",
    "lost_to_bonds_last": "{place}: to bonds (last)",
    "lost_to_mean_stress": "{place}: to stress",
    "lost_to_lag": "{place}: to lag",
}


def of_losses(stated: Estimates, symbol: str = "V") -> tuple[Column, ...]:
    """Return the columns of what is known where a share of the area is lost."""
    columns = []
    for name, one in stated.items():
        match = _LOSS.fullmatch(name)
        if match is None:
            continue
        kind, level = match.groups()
        place = f"{level} % lost" if level else "halfway to Hertz"
        row = Definition(
            name,
            one.unit,
            str(one.value.attrs.get("long_name", "")),
            heading=_LOSSES[kind].format(place=place, V=symbol),
            form=Form.PERCENT,
        )
        columns.append(Column(row, math.nan if "speed" in kind else 0.0))
    return tuple(columns)


# --- the tables of a run ---


def tables_of(run: Run, rows: int = 12, show: Sequence[str] = ()) -> list[Table]:
    """Return the tables of a run: over time or sweep, of its events, phases and losses.

    Parameters
    ----------
    run : Run
        The run.
    rows : int
        Rows of a table at most.
    show : sequence of str
        Names of ``GROUPS`` that are printed, too.
    """
    result = [table(run, rows, show)]
    if {"losses", "all"} & {*show}:
        by_mechanism = _over_rows(run, LOSSES, rows, math.inf)
        # a scene without a loss has no column of it
        result += [by_mechanism] if by_mechanism.columns else []
    result += [each(run, rows, show) for each in (highlights, losses, phases)]
    result.append(spread(run))
    return [each_table for each_table in result if each_table.rows]


def table(run: Run, rows: int = 12, show: Sequence[str] = ()) -> Table:
    """Return the statistics over time or sweep.

    Parameters
    ----------
    run : Run
        The run.
    rows : int
        Rows at most (at least one). If speed and mount are steady, each point of a sweep
        has one row, its mean over the second half of the run. Else rows are spread evenly
        over time.
    show : sequence of str
        ``"all"`` for all columns that say something, else at most ten.

    Returns
    -------
    Table
        Means over the members. A number in brackets is the standard error in the last
        digits. Columns that are constant throughout (no friction, no open contacts) are
        left out.
    """
    return _over_rows(run, main_columns(run), rows, _most(show, "all"))


def main_columns(run: Run) -> tuple[Column, ...]:
    """Return the columns over time or sweep that a run of this kind can have."""
    skipped = set[str]()
    if run.is_steady:
        skipped.add("stage_speed")
    if run.is_held:
        skipped |= {"normal_load", "displacement", "dissipated_energy"}
    if not run.has_one_row_each:
        skipped.add("correlation_time")
    if run.has_one_row_each and "drive_speed" in run.dataset.coords:
        skipped.add("speed")  # it is a column of its place already
    return tuple(column for column in MAIN if column.name not in skipped)


def highlights(run: Run, rows: int = 12, show: Sequence[str] = ()) -> Table:
    """Return the events of each point of the sweep; no rows without events."""
    columns = [column for column in EVENTS if _of_drive(run, column.name)]
    if {"slips", "all"} & {*show}:
        columns += SLIPS
    most = math.inf if show else MOST
    return _once(run, run.events, columns, rows, most)


def _most(show: Sequence[str], group: str) -> float:
    """Return the number of columns that a table of a group has room for: all of them if a person asks for the group."""
    return math.inf if {group, "all"} & {*show} else MOST


def losses(run: Run, rows: int = 12, show: Sequence[str] = ()) -> Table:
    """Return the speeds of losses of area, with a row for each point of the sweep of other keys."""
    return _once(run, run.losses, _of_losses_of(run), rows, _most(show, "losses"))


def _of_losses_of(run: Run) -> tuple[Column, ...]:
    """Return the columns of losses of a run, at the speed of the slider or of the stage."""
    symbol = "stage" if run.speed_name == "stage_speed" else "V"
    return of_losses(run.losses, symbol)


def phases(run: Run, rows: int = 12, show: Sequence[str] = ()) -> Table:
    """Return slip events and peaks in each phase of a course, with a row for each phase.

    If there are several holds, phases without a hold before and without a slip event are left out.
    """
    stated = run.events
    if "phase_time_held" in stated:
        held = stated["phase_time_held"].value.notnull()
        known = held.any([dim for dim in held.dims if dim != "phase"])
        if known.sum() > 1:
            names = [c.name for c in PHASES if c.name in stated]
            if "phase_slip_count" in names:
                slips = stated["phase_slip_count"].value > 0.0
                known |= slips.any([dim for dim in slips.dims if dim != "phase"])
            stated = {name: stated[name].isel({"phase": known}) for name in names}
    return _once(run, stated, PHASES, rows, _most(show, "slips"))


def spread(run: Run) -> Table:
    """Return the spread of each quantity over members and stationary time, a row each; no rows of a sweep."""
    if not run.is_one_ensemble:
        return Table([])
    columns = main_columns(run)
    late = run.late([*(column.name for column in columns), "correlation_time"])
    at = dict.fromkeys(run.sweep, 0)
    least = _ROUNDING if run.has_noise else _SETTLED
    rows = []
    for column in (column for column in columns if column.name in late):
        one = late[column.name].isel(at)
        if one.std is not None and one.std > least * abs(one.value):
            rows.append(_spread_of(one, column.definition))
    if not rows or not run.has_noise or "fluctuation_energy" not in late:
        return Table(rows, keys=1, total=len(rows))
    first = {name: xr.Variable("row", [0]) for name in run.sweep}
    memory = _table_of({}, late, {}, first, _columns("correlation_time"))
    ((heading, cell),) = memory.rows[0].items()
    rows.append(dict.fromkeys(rows[0], "") | {"quantity": heading, "mean": cell})
    return Table(rows, keys=1, total=len(rows), reasons=memory.reasons)


def _over_rows(run: Run, columns: Sequence[Column], rows: int, most: float) -> Table:
    """Return the table of some columns over sweep and time."""
    means, points, places = _tabulated(run, rows, [column.name for column in columns])
    once = run.has_one_row_each
    placed = {n: index for n, index in points.items() if n != "t" or not once}
    known = [column for column in columns if _says_something(means, column, points)]
    kept, left_out = _fitting(known, most - len(placed))
    total = run.points if once else run.points * run.dataset.sizes["t"]
    return _table_of(places, means, placed, points, kept)._replace(
        total=total, left_out=left_out
    )


def _once(
    run: Run, stated: Estimates, columns: Sequence[Column], rows: int, most: float
) -> Table:
    """Return a table of numbers of a whole run, a row for each point; no rows if there are none."""
    known = [stated[c.name].value for c in columns if c.name in stated]
    sizes = {str(dim): size for one in known for dim, size in one.sizes.items()}
    places = {name: run.dataset[name] for name in run.sweep}
    places |= {
        name: one[name]
        for one in known
        for name in ("branch", "phase")
        if name in one.dims
    }
    points = _points(sizes, _thinned(sizes, rows))
    chosen = [
        Column(_defined(column.definition, stated[column.name]), column.dull)
        for column in columns
        if _says_something(stated, column, points)
    ]
    if not chosen:
        return Table([])
    kept, left_out = _fitting(chosen, most - len(points))
    return _table_of(places, stated, points, points, kept)._replace(
        total=math.prod(sizes.values()), left_out=left_out
    )


def _defined(row: Definition, one: Estimate) -> Definition:
    """Return the definition of a quantity with its meaning in this run, if that is another one than in the registry."""
    return row._replace(meaning=str(one.value.attrs.get("definition", row.meaning)))


def _fitting(
    columns: Sequence[Column], most: float
) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
    """Return the columns that a table has room for, and those that it leaves out."""
    kept = list(columns)
    for name in _LEFT_OUT_FIRST:
        if len(kept) > most:
            kept = [column for column in kept if column.name != name]
    kept = kept if most == math.inf else kept[: max(int(most), 1)]
    return tuple(kept), tuple(column for column in columns if column not in kept)


def _of_drive(run: Run, name: str) -> bool:
    """Return True if an event is shown under this drive: the speed of a peak on a ramp, its time after a start."""
    if name in ("peak_speed", "peak_friction_speed"):
        return "ramp" in run.drive
    if name in ("peak_time", "peak_friction_time"):
        return "start" in run.drive
    return True


# --- notes ---


class Notes(NamedTuple):
    """Notes on tables: those that qualify printed numbers, others, and the meanings of headings."""

    needed: list[str]
    further: list[str]
    headings: list[str]


def notes(run: Run, shown: Sequence[Table]) -> Notes:
    """Return notes on printed tables: sample, missing trajectories and numbers, systematic errors, headings.

    A note that qualifies a printed number is needed. All others are few: the number of
    rows, columns that are left out, and the meaning of headings.
    """
    columns = [column for each_table in shown for column in each_table.columns]
    needed = [*_samples(run, shown), *_missing(shown)]
    needed += [
        f"systematic error: {error}"
        for error in systematic_errors(run.dataset)
        # that of the load at pull-off stands beside it
        if error.matters and error.name != "pull_off_error"
    ]
    needed += [
        f"{text}{_at_points(run, at)}" for text, at in unresolved_slips(run.dataset)
    ]
    needed += _strains(run)
    further = [*_turning(run)] if run.has_one_row_each else []
    further += [
        f"{len(each_table.rows)} of {each_table.total} rows shown; see --all, --csv FILE and --where KEY=VALUE"
        for each_table in shown
        if 0 < len(each_table.rows) < each_table.total
    ]
    if left_out := [c for each_table in shown for c in each_table.left_out]:
        names = ", ".join(dict.fromkeys(column.heading for column in left_out))
        further.append(f"further columns, with --show all: {names}")
    chosen = run.chosen_quantities
    if chosen is not None:
        names = ", ".join(chosen) or "contact_radius alone"
        further.append(
            f"no columns for quantities that were not recorded; record.quantities has {names}"
        )
    meanings = {column.heading: column.definition.meaning for column in columns}
    headings = [f"{heading}: {meaning}" for heading, meaning in meanings.items()]
    return Notes([*dict.fromkeys(needed)], [*dict.fromkeys(further)], headings)


def _samples(run: Run, shown: Sequence[Table]) -> Iterator[str]:
    """Yield the sample of the means, the meaning of brackets, and trajectories that end early."""
    cells = [cell for t in shown for row in t.rows for cell in row.values()]
    phrases = []
    fewer = _fewer(run, shown)

    def sample_of(late: bool) -> str:
        sample = run.sample(late)
        some = bool(fewer) or run.loses_members
        return with_a_value(sample, run.members) if some else sample

    if sample := sample_of(run.has_one_row_each):
        phrases.append(f"mean over the {sample}")
    if any(is_corrected(column.name) for t in shown for column in t.columns) and (
        "energy_variation" in run.dataset and control_variate(run.dataset.isel(t=[0]))
    ):
        phrases.append(
            "area, radius, friction and losses at the known mean of ΔΓ (plain means: --csv-all)"
        )
    if any(re.search(r"\d\(", cell) for cell in cells):
        phrases.append("brackets: standard error in the last digits")
    if any("±" in cell for cell in cells):
        phrases.append("±: bound of an error that members do not reduce")
    if any(re.search(r"\([<>]\d", cell) for cell in cells):
        phrases.append("near 0 and 100 %: the end of the 95 % interval")
    if any(re.search(r"\([<>] ", cell) for cell in cells):
        phrases.append(
            "< or > with a blank: the only end of the 95 % interval that is known"
        )
    if any("free values" in row for each_table in shown for row in each_table.rows):
        phrases.append(
            f"by quantity: over the {sample_of(late=True)}; free values: the effective number of independent values"
        )
    if phrases:
        yield "; ".join(phrases)
    yield from fewer
    if "runaway_force" in run.dataset:
        count, total = _trajectories(run.dataset, "runaway_force")
        if count:
            yield f"{count} of {total} trajectories end because the slider lost stability"
    if only_statistics(run.dataset) and run.losses:
        yield (
            "members were not recorded: errors of losses take those at neighbouring "
            "speeds for independent, and the time of half of the members is not known"
        )
    if sentence := unresolved(run.dataset):
        yield sentence


def _fewer(run: Run, shown: Sequence[Table]) -> list[str]:
    """Return sentences on the number of members with a value in the columns in which not all have one."""
    alike: dict[tuple[int, bool], list[str]] = {}
    for sample in (sample for each_table in shown for sample in each_table.samples):
        if sample.least < run.members:
            headings = alike.setdefault((sample.least, sample.differs), [])
            headings.append(sample.heading)
    return [
        f"of the {run.members} members, {'at least ' * differs}{least} have a value of "
        + ", ".join(dict.fromkeys(headings))
        for (least, differs), headings in sorted(alike.items())
    ]


def _trajectories(dataset: xr.Dataset, event: str) -> tuple[int, int]:
    """Return the number of trajectories that have had an event, by a number that only they have, and that of all."""
    share = recorded_share(dataset, event)
    if share is None:
        values = dataset[event]
        return int(values.notnull().sum()), values.size
    members = int(dataset.attrs["members"])
    return round(float(share.sum()) * members), share.size * members


def unresolved(dataset: xr.Dataset) -> str:
    """Return a sentence on the trajectories whose motion was not resolved to the end, and its cure; "" without any."""
    if "unresolved_time" not in dataset:
        return ""
    count, total = _trajectories(dataset, "unresolved_time")
    if not count:
        return ""
    return (
        f"{count} of {total} trajectories could not be resolved: their values are missing from unresolved_time on; set"
        " a shorter clock.step, or drive.viscosity or drive.damping, which delay a slip"
    )


def _missing(shown: Sequence[Table]) -> Iterator[str]:
    """Yield the reasons of printed columns in which a number is missing or is no mean, each with its points.

    Reasons of a column that differ in their numbers only are one, with those of the first point. Columns share a line
    if text, numbers and points are the same.
    """
    alike: dict[tuple[str, str], list[Reason]] = {}
    for reason in (reason for each_table in shown for reason in each_table.reasons):
        pattern = _NUMBER.sub("#", reason.text)
        alike.setdefault((reason.heading, pattern), []).append(reason)
    affected: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for (heading, _), entries in alike.items():
        places = tuple(dict.fromkeys(reason.place for reason in entries))
        affected.setdefault((entries[0].text, places), []).append(heading)
    for (text, words), headings in affected.items():
        yield f"* {', '.join(headings)}: {text}{_first_of(words)}"


def _first_of(points: Sequence[str]) -> str:
    """Return the first of some points in words, and the number of the others, as the end of a sentence."""
    first, *others = points
    more = f", and {len(others)} more point{'s' * (len(others) > 1)}" if others else ""
    return f" (at {first}{more})" if first else ""


def _at_points(run: Run, holds: xr.DataArray) -> str:
    """Return the points of the sweep at which something holds of some member, "" if it holds at all of them."""
    holds = holds.any([dim for dim in holds.dims if dim not in run.sweep])
    if bool(holds.all()):
        return ""
    indices = np.nonzero(holds.to_numpy())
    points = {
        str(dim): xr.Variable("row", index)
        for dim, index in zip(holds.dims, indices, strict=True)
    }
    places = {name: run.dataset[name] for name in points}
    return _first_of(_in_words(places, points, len(indices[0])))


def _strains(run: Run) -> Iterator[str]:
    """Yield the largest mean stress of friction that builds up, if the strains are then not small as in the theory.

    That of steady sliding is known before the run, and ``sim check`` remarks on it.
    """
    dataset = run.dataset
    if not {"peak_stress", "static_threshold", "softer_shear_modulus"} <= {*dataset}:
        return
    largest = abs(dataset["peak_stress"].astype(float))
    if MEMBERS in largest.dims:
        largest = largest.mean(MEMBERS)
    strain = ensemble_mean(largest) / dataset["softer_shear_modulus"]
    if bool((strain > FINITE_STRAIN).any()):
        yield (
            f"the shear stress reaches {float(strain.max()):.2g} times the shear modulus"
            f"{_at_points(run, strain == strain.max())}: finite strains, which are left out, reduce the area from about"
            f" {FINITE_STRAIN} on"
        )


def _turning(run: Run) -> Iterator[str]:
    """Yield where area and friction are largest or least inside a sweep of one number: they are not monotonic."""
    swept = [name for name in run.sweep if run.dataset.sizes[name] > 1]
    if (
        len(swept) != 1
        or run.dataset[swept[0]].dtype.kind not in "fi"
        or run.dataset.sizes[swept[0]] < _TURNS
    ):
        return
    names = ("contact_area", "friction_force")
    others = {name: 0 for name in run.sweep if name != swept[0]}
    late = run.late(names)
    for name in (name for name in names if name in late):
        curve = late[name].isel(others)
        if curve.reason is not None and bool((curve.reason != "").any()):
            continue  # values at an end are no means
        inside = extremes(curve, swept[0])
        for extreme in ("largest", "least"):
            value = float(inside[extreme].value)
            if not math.isfinite(value):
                continue
            place = inside[f"{extreme}_at"]
            at, low, high = (
                engineering(float(end), place.unit)
                for end in (place.value, place.low, place.high)
                if end is not None
            )
            size = engineering(value, curve.unit)
            yield f"{name.replace('_', ' ')} is {extreme}, {size}, at {swept[0]} = {at} (between {low} and {high})"


# --- a run without a sweep in a report ---


def key_figures(run: Run) -> list[dict[str, str]]:
    """Return the numbers of a run without a sweep, a row each: symbol, value, and definition with the sample."""
    columns = {
        column.name: column
        for column in (*MAIN, *LOSSES, *EVENTS, *SLIPS, *_of_losses_of(run))
        if _of_drive(run, column.name)
    }
    late = {}
    if run.is_stationary:
        late = run.late(c.name for c in (*main_columns(run), *LOSSES))
    rows = []
    for name, one in (run.events | run.losses | late).items():
        column = columns.get(name)
        if column is None:
            continue
        row, about = _defined(column.definition, one), one.value.attrs
        for place in np.ndindex(one.value.shape):
            at = dict(zip(one.value.dims, place, strict=True))
            here = one.isel(at)
            (reason,) = _reasons_at(here, {}, row)
            if here.is_missing and _is_absent(reason, row):
                continue  # no key figure
            if abs(here.value - column.dull) < _ROUNDING:
                continue
            sample = str(about.get("over", ""))
            known = run.members if here.members is None else int(here.members)
            if here.is_missing:
                sample = ""  # the reason stands in place of a mean
            elif known < run.members:
                sample = with_a_value(sample, run.members, known)
            over = f"; mean over the {sample}" if sample else ""
            where = [
                f"phase {here.value[dim].item()}"
                if dim == "phase"
                else str(here.value[dim].item())
                for dim in at
                if dim in one.value.coords and dim not in run.sweep
            ]
            rows.append(
                {
                    "": ", ".join([row.heading, *where]),
                    "value": figure(here, row),
                    "definition": row.meaning[:1].upper() + row.meaning[1:] + over,
                }
            )
    return rows


def figure(one: Estimate, row: Definition) -> str:
    """Return a number with its errors, its unit, and the reason if it is missing or no mean."""
    unit, (text,) = _texts_of(one, {}, row)
    reason = "" if one.reason is None else str(one.reason.item())
    known = not bool(one.is_missing)
    return "; ".join(filter(None, [f"{text} {unit}".rstrip() * known, reason]))


# --- cells ---


def _places(places: Places, points: Points) -> Cells:
    """Return the columns of the place in the sweep and the time of each row."""
    cells: Cells = {}
    for name, index in points.items():
        unit = places[name].attrs.get("units", "1")
        shown, texts = _column_of(unit, places[name][index].to_numpy())
        cells[_headed(name, shown)] = texts
    return cells


def _says_something(means: Estimates, column: Column, points: Points) -> bool:
    """Return True if a column is known and not constant at its dull value at these points, or if a cause hides it."""
    if column.name not in means:
        return False
    one, row = means[column.name], column.definition
    value, low, high = (_at(field, points) for field in (one.value, one.low, one.high))
    if row.form is not Form.PLAIN:
        value = np.where(np.abs(value) < _ROUNDING, 0.0, value)
    is_missing = np.isnan(value) & np.isnan(low) & np.isnan(high)
    if not np.all((value == column.dull) | is_missing):
        return True
    reasons = _reasons_at(one, points, row)
    return UNRESOLVED in reasons or any(
        missing and not _is_absent(reason, row)
        for missing, reason in zip(is_missing, reasons, strict=True)
    )


def _is_absent(reason: str, row: Definition) -> bool:
    """Return True if a missing value is that of an event that did not happen, or the place of a peak that is none."""
    return reason in ("", row.absent, OPEN_THROUGHOUT) or row.name in PLACES


def _table_of(
    places: Places,
    means: Estimates,
    placed: Points,
    points: Points,
    columns: tuple[Column, ...],
) -> Table:
    """Return the table of some columns at points, after those of the place of each row."""
    cells = _places(places, placed)
    keys = len(cells)
    count = next(iter(points.values())).size if points else 1
    swept = {name: index for name, index in placed.items() if name != "t"}
    words = _in_words(places, swept, count)
    reasons, samples = [], []
    for column in columns:
        row, one = column.definition, means[column.name]
        counts = _at(one.members, points)[~np.isnan(_at(one.value, points))]
        if np.isfinite(counts).any():
            least, most = int(np.nanmin(counts)), int(np.nanmax(counts))
            samples.append(Sample(row.heading, least, least < most))
        shown, texts = _texts_of(one, points, row)
        for number, reason in enumerate(_reasons_at(one, points, row)):
            if reason:
                texts[number] += "*"
                reasons.append(Reason(row.heading, reason, words[number]))
        cells[_headed(row.heading, shown)] = texts
    return Table(
        _rows(cells),
        keys,
        columns=columns,
        reasons=tuple(reasons),
        samples=tuple(samples),
    )


def _in_words(places: Places, points: Points, count: int) -> list[str]:
    """Return the point of the sweep of each of so many rows in words, "" without a sweep."""
    words = [list[str]() for _ in range(count)]
    for name, index in points.items():
        unit = places[name].attrs.get("units", "1")
        for row, value in zip(words, places[name].to_numpy()[index], strict=True):
            is_number = places[name].dtype.kind == "f"
            text = engineering(float(value), unit) if is_number else str(value)
            row.append(f"{name} = {text}")
    return [", ".join(row) for row in words]


def _reasons_at(one: Estimate, points: Points, row: Definition) -> list[str]:
    """Return the reason of each row of a column whose value is missing or no mean, "" else."""
    is_missing = _at(one.is_missing, points)
    explicit = [""] * len(is_missing)
    if one.reason is not None:
        explicit = [*map(str, _at(one.reason, points))]
    return [
        reason or (row.absent if missing else "")
        for reason, missing in zip(explicit, is_missing, strict=True)
    ]


def _texts_of(one: Estimate, points: Points, row: Definition) -> tuple[str, list[str]]:
    """Return the unit in which a column is printed, and its cells."""
    value, error, low, high, bound = (_at(field, points) for field in one[:5])
    unit = one.unit
    if row.form is not Form.PLAIN and unit == "1":
        unit, value = "%", np.where(np.abs(value) < _ROUNDING, 0.0, value)
    errors = (error, low, high, np.nan_to_num(bound))
    shown, texts = _column_of(unit, value, errors, one.source)
    if row.form is Form.SHARE:
        texts = [
            share(*ends) or text
            for *ends, text in zip(value, low, high, texts, strict=True)
        ]
    return shown, texts


#: Standard error, ends of the interval and systematic error of a number without any.
_EXACT = tuple(np.array(number) for number in (0.0, math.nan, math.nan, 0.0))


def _headed(heading: str, unit: str) -> str:
    """Return a heading with a unit."""
    return f"{heading} ({unit})" if unit else heading


def _column_of(
    unit: str,
    values: Array,
    errors: Sequence[Array] = _EXACT,
    source: str = "",
) -> tuple[str, list[str]]:
    """Return the unit that suits the largest value, and the cells of a column.

    ``errors`` are standard errors, both ends of intervals, and systematic errors.
    """
    if values.dtype.kind not in "fi":
        return "", [str(value) for value in values]
    sizes = np.abs(values)
    if not np.any(np.isfinite(sizes)):
        sizes = np.abs(np.append(errors[1], errors[2]))
    largest = sizes[np.isfinite(sizes)].max(initial=0.0)
    is_rounding = sizes <= _ROUNDING * largest
    finite = sizes[np.isfinite(sizes) & ~is_rounding]
    # in a unit of the largest value the least of a wide column would be nearly nothing
    if finite.size and largest > _WIDE * finite.min():
        largest = max(float(np.sqrt(largest * finite.min())), largest / _WIDE)
    factor, shown = scaled(largest, unit)
    if unit == "%":
        factor, shown = 100.0, "%"
    if sizes.shape == values.shape:
        values = np.where(is_rounding, 0.0, values)
        scatter = np.where(errors[0] <= _ROUNDING * largest, 0.0, errors[0])
        errors = [scatter, *errors[1:]]
    texts = [
        bounded(
            factor * value,
            factor * error,
            factor * low,
            factor * high,
            factor * bound,
            source,
        )
        for value, error, low, high, bound in np.broadcast(values, *errors)
    ]
    return shown, texts


def _at(variable: xr.DataArray | None, points: Points) -> Array:
    """Return the values of a variable at each row; nan if there is no such variable."""
    count = next(iter(points.values())).size if points else 1
    values = (
        np.nan
        if variable is None
        else variable.variable.isel(points, missing_dims="ignore").to_numpy()
    )
    return np.broadcast_to(values, count)


def _rows(cells: Cells) -> list[dict[str, str]]:
    return [
        dict(zip(cells, row, strict=True)) for row in zip(*cells.values(), strict=True)
    ]


def _tabulated(
    run: Run, rows: int, names: list[str]
) -> tuple[Estimates, Points, Places]:
    """Return statistics to tabulate, the index of each row in each dimension, and the places there."""
    dataset = run.dataset
    sizes = dict(dataset["contact_modulus"].sizes)
    counts = _thinned(sizes, rows)
    counts["t"] = max(1, rows // math.prod(counts.values()))
    if run.has_one_row_each:
        return run.late(names), _points(sizes | {"t": 1}, counts), dataset
    dataset = with_slips(dataset)
    # of the records only those that are shown, none after all have ended
    if counts["t"] < dataset.sizes["t"]:
        dataset = restricted(dataset.isel(t=slice(run.last + 1)), names)
        dataset = dataset.isel(t=_spread(dataset.sizes["t"], counts["t"]))
    result = at_records(dataset, names)
    return result, _points(sizes | {"t": dataset.sizes["t"]}, counts), dataset


def at_records(dataset: xr.Dataset, names: list[str]) -> Estimates:
    """Return statistics over the members at each record; the load of an open contact is the applied one."""
    result = over_members(dataset, names, quantiles=False)
    if "applied_load" in dataset and "normal_load" in result:
        load, applied = result["normal_load"], ensemble_mean(dataset["applied_load"])
        fields = {
            kind: applied.fillna(getattr(load, kind)).assign_attrs(load.value.attrs)
            for kind in ("value", "low", "high")
        }
        if load.reason is not None:
            known = fields["value"].notnull()
            fields["reason"] = load.reason.where(~known, "")
        result["normal_load"] = load._replace(**fields, members=None)
    return result


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
    first = 0 if count > 1 else size - 1
    return np.rint(np.linspace(first, size - 1, count)).astype(int)


def _spread_of(one: Estimate, row: Definition) -> dict[str, str]:
    """Return a row of ``spread``."""
    value, error, _, _, _, std, *quantiles, number = (
        np.array(math.nan) if field is None else field.to_numpy() for field in one[:10]
    )
    levels, low, high = quantiles
    factor, shown = scaled(float(np.max(np.abs(levels))), row.unit)
    if row.form is not Form.PLAIN:
        factor, shown = 100.0, "%"
    cells = {
        "quantity": _headed(row.heading, shown),
        "mean": concise(factor * float(value), factor * float(error)),
        "sd": f"{factor * std:.3g}",
    }
    errors = (high - low) / (2.0 * WIDE)
    for level, at_level, off in zip(QUANTILES, levels, errors, strict=True):
        cells[f"{100.0 * level:.0f} %"] = concise(factor * at_level, factor * off)
    return cells | {"free values": f"{number:.3g}"}
