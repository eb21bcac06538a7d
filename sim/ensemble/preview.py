"""Statements about a run before it starts: models, quantities, error estimates, time, memory and file."""

import html
import itertools
import math
import os
import re
import tomllib
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from sim.ensemble.diagnosis import (
    COMPUTED,
    SEARCHED,
    Stability,
    Worst,
    diagnosis,
    distinct_speeds,
    error_in_words,
    remarks,
    stability,
    worst_of_sweep,
)
from sim.ensemble.pace import counted, pace as pace_of
from sim.ensemble.plan import IN_MEMORY, Plan, map_bytes, state_numbers, work
from sim.ensemble.swept import grouped, places, spread
from sim.laws.limits import JKR_FROM
from sim.parts.drive import Spring
from sim.parts.exchange import Parts
from sim.parts.shear.modes import ModalProcess
from sim.quantities import SOURCES
from sim.scenario.scenario import Record, Scenario
from sim.scenario.schema import Entry, distinct, entries
from sim.units.notation import engineering
from sim.units.notebook import table
from sim.units.quantity import read_option
from sim.units.terminal import duration

# Rough costs of one core [s]: a start with its table, a process that shares the work; a byte of the dataset that
# is compressed; a point of a sweep; a mode pair that is made.
_START, _WORKER = 1.2, 1.2
_BYTE = 48e-9
_POINT, _MODE = 1e-3, 5e-6
# Rough memory [byte]: a process with its libraries, more of it for a table; a mode pair while it is made and while it
# is used. Copies of a part while it is computed, of a dataset while it is written or read, of one that stays in memory.
_PROCESS, _TABLE, _OF_MODE_MADE, _OF_MODE = 160e6, 100e6, 520.0, 160.0
_COPIES_OF_PART, _COPIES, _COPIES_IN_MEMORY = 3.0, 2.0, 3.0
#: Largest trajectories that are read back for a table [byte].
_MOST_TABULATED = 1e8

_MOST_WORDS = 6
#: Estimate [s] of a run that is announced.
_LONG = 10.0
#: Spread of the relative area over members below which it is rounding [1].
_ROUNDING = 1e-12
#: Keys that are listed elsewhere than among the quantities.
_ELSEWHERE = ("name", "sweep", *(f"{part}.model" for part in Parts._fields))
Rows = list[tuple[str, ...]]


class NoRoom(RuntimeError):
    """A run needs more memory than there is."""

    exit_code = 1


class Forecast(NamedTuple):
    """Estimated needs of a run: time of all cores and by the clock [s], memory and dataset [byte]."""

    cpu: float
    clock: float
    memory: float
    file: float


def forecast(
    plan: Plan, jobs: int, pace: float = 1.0, shares: int = 1, left: float = 1.0
) -> Forecast:
    """Estimate the needs of a run, or of one of some shares of it.

    ``pace`` is the measured time of some steps over their counted time, ``left`` the fraction of steps that are not
    done yet. A share makes no dataset.
    """
    modes = _MODE * max(_mode_pairs(point) for point in spread(plan.points, 2))
    steps, whole = left * pace * counted(plan) / shares, shares == 1
    alone = _START + modes + len(plan.points) * _POINT + whole * plan.bytes * _BYTE
    started = _WORKER + modes if jobs > 1 else 0.0
    cpu, clock = alone + jobs * started + steps, alone + started + steps / jobs
    return Forecast(cpu, clock, memory(plan, jobs), plan.file_bytes)


def tabulated(plan: Plan) -> bool:
    """True if a run ends with a table of its dataset, for which the dataset is read as a whole."""
    return plan.trajectories <= _MOST_TABULATED


def memory(plan: Plan, jobs: int) -> float:
    """Estimate the largest memory of all processes together [byte]: libraries, and blocks or the dataset."""
    block = max(_block(plan, point) for point in spread(plan.points, 2))
    dataset = _COPIES * min(plan.bytes, IN_MEMORY) + (
        _TABLE if tabulated(plan) else 0.0
    )
    return (jobs + 1 if jobs > 1 else 1) * _PROCESS + max(jobs * block, dataset)


def _mode_pairs(point: Scenario) -> int:
    return point.process.pairs if point.fluctuations.keeps_modes else 0


def _block(plan: Plan, point: Scenario) -> float:
    """Return the memory of a block while it is computed [byte]: modes, states, and copies of its part."""
    numbers = (
        plan.group
        * max(1, plan.records_of_block(point))
        * len(plan.variables)
        * len(plan.packs[0])
    )
    drawn = (
        min(1.0, plan.snapshots_of_block(point) / len(point.record.maps))
        if point.record.maps
        else 0.0
    )
    part, pairs = (
        8.0 * numbers + drawn * map_bytes(point, plan.group),
        _mode_pairs(point),
    )
    states = 16.0 * plan.group * state_numbers(point)
    return max(
        _OF_MODE_MADE * pairs, _OF_MODE * pairs + states + _COPIES_OF_PART * part
    )


def memory_limit() -> tuple[float, str]:
    """Return the memory that a run may take [byte], and the source of this limit.

    It is that of ``SIM_MAX_MEMORY``, else that of a job of SLURM, else the memory that is free.
    """
    import psutil

    if text := os.environ.get("SIM_MAX_MEMORY"):
        return read_option(
            text, "SIM_MAX_MEMORY", "byte", above=0, typical="4 GB"
        ), "are allowed (SIM_MAX_MEMORY)"
    processors = int(os.environ.get("SLURM_CPUS_ON_NODE") or cores())
    for name, count in (("SLURM_MEM_PER_NODE", 1), ("SLURM_MEM_PER_CPU", processors)):
        if megabytes := int(os.environ.get(name) or 0):  # 0 stands for all memory
            return 2.0**20 * megabytes * count, f"are allowed ({name})"
    return (
        psutil.virtual_memory().available + psutil.Process().memory_info().rss,
        "are free",
    )


def fitting(
    plan: Plan, jobs: int, most: float = math.inf, in_memory: bool = False
) -> int:
    """Return the number of processes, at most ``jobs``, for which ``most`` [byte] of memory are enough.

    If ``most`` is infinite, the limit is ``memory_limit``. A dataset that stays ``in_memory`` counts.

    Raises
    ------
    NoRoom
        If memory is too small for one process; the message says how much the run takes.
    """
    limit, source = (
        (most, "are allowed (--max-memory)") if most < math.inf else memory_limit()
    )
    dataset = _COPIES_IN_MEMORY * plan.bytes if in_memory else 0.0
    for count in range(jobs, 0, -1):
        if memory(plan, count) + dataset <= limit:
            return count
    cure = "reduce modes, maps, records or points of a sweep (see `sim check`)"
    needed = size(memory(plan, 1) + dataset)
    raise NoRoom(
        f"the run needs at least {needed} of memory, but {size(limit)} {source}; {cure}"
    )


def size(count: float) -> str:
    """Return a number of bytes as text of two digits."""
    units = ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)
    unit, factor = next((row for row in units if count >= row[1]), ("byte", 1.0))
    return f"{float(f'{count / factor:.2g}'):g} {unit}"


def cores() -> int:
    """Return the number of processors that this process may use."""
    import loky  # takes as long to import as a short run to compute

    return int(loky.cpu_count())


def usual_jobs(plan: Plan) -> int:
    """Return the default number of processes: one a core if the work is worth it."""
    wanted = plan.worthwhile()
    return min(wanted, cores()) if wanted > 1 else 1


def processes(
    plan: Plan,
    jobs: int | None,
    most: float,
    shard: tuple[int, int] = (1, 1),
    parts: Any = (),
) -> tuple[int, list[str]]:
    """Return the number of processes of a run and the lines that are printed before it.

    There are at most ``jobs`` processes and no more than ``most`` [byte] of memory hold. The lines of a long run, or
    of one of several processes, say how much it takes beside the ``parts`` that are done. Missing kernels are compiled
    for these lines, before the processes need them.
    """
    wanted, lines = jobs or usual_jobs(plan), list[str]()
    if (jobs := fitting(plan, wanted, most)) < wanted:
        lines.append(f"note: the memory is enough for {jobs} of {wanted} processes")
    if not tabulated(plan):
        lines.append("note: the dataset is large; `sim stats` prints its table")
    left = (
        1.0 - sum(task.done(parts) for task in plan.share(*shard)) / work(plan, *shard)
        if parts
        else 1.0
    )
    if jobs > 1 or left * counted(plan) > _LONG:
        needs = forecast(plan, jobs, pace_of(plan), shard[1], left)
        if jobs > 1 or needs.clock > _LONG:
            lines.append(
                f"{_times(needs, jobs)}, {size(needs.memory)} of memory, a file of {size(needs.file)}"
            )
    return jobs, lines


def _times(needs: Forecast, jobs: int) -> str:
    """Return CPU time and time by the clock as text."""
    clock = (
        f", {duration(needs.clock)} of wall time in {jobs} processes"
        if jobs > 1
        else ""
    )
    return f"about {duration(needs.cpu)} of CPU time{clock}"


class Preview(str):
    """Description of a run as text, which a notebook shows as tables."""

    blocks: dict[str, Rows]

    __repr__ = str.__str__

    def _repr_html_(self) -> str:
        name, *_ = self.splitlines()
        texts = [f"<b>{html.escape(name)}</b>"]
        for title, rows in self.blocks.items():
            cells = [
                {str(place): cell for place, cell in enumerate(row)} for row in rows
            ]
            texts.append(f"<p>{title}</p>{table(cells, headed=False)}")
        return "".join(texts)


def preview(scenario: Scenario) -> Preview:
    """Describe a run: models, quantities in SI, error estimates, and the time, memory and file that it takes.

    Parameters
    ----------
    scenario : Scenario
        As ``sim.load`` returns it; every point of a sweep counts.

    Returns
    -------
    Preview
        Several lines for a terminal.
    """
    plan = Plan.of(scenario)
    some, most = spread(plan.points), worst_of_sweep(plan.points)
    blocks: dict[str, Rows] = {
        "models": _models(plan),
        "quantities in SI": _quantities(plan.points),
        "contact at rest": _contact(plan.points),
        "limits of the theory": _limits(spread(plan.points, SEARCHED)),
        "fluctuations": _fluctuations(some),
        "errors of the result": _errors(plan, most),
        "slider": _slider(plan),
        "diagnosis": [(text,) for text in diagnosis(plan)],
        "notes": [(text,) for text in remarks(plan, most)],
        "the run": _run(plan),
    }
    blocks = {title: rows for title, rows in blocks.items() if rows}
    texts = (f"{title}\n{_aligned(rows)}" for title, rows in blocks.items())
    result = Preview("\n\n".join([scenario.name, *texts]))
    result.blocks = blocks
    return result


def _aligned(rows: Rows) -> str:
    """Return rows as text in columns, each as wide as its longest cell."""
    widths = [
        max(map(len, column)) for column in itertools.zip_longest(*rows, fillvalue="")
    ]
    lines = (
        "  ".join(
            cell.ljust(width) for cell, width in zip(row, widths, strict=False)
        ).rstrip()
        for row in rows
    )
    return "\n".join(f"  {line}" for line in lines)


def _span(values: Sequence[float], unit: str = "", digits: str = ".4g") -> str:
    """Return a number, or the range of several, as text."""
    low, high = format(min(values), digits), format(max(values), digits)
    return f"{low if low == high else f'{low} to {high}'} {unit}".strip()


def _models(plan: Plan) -> Rows:
    """Return the model of each part, its origin, and its description."""
    source = plan.scenario.origin
    origins = dict.fromkeys(
        Parts._fields, "omitted: the simplest" if source.text else "given"
    )
    origins |= dict.fromkeys(tomllib.loads(source.text), "in the file")
    origins |= {
        key.partition(".")[0]: "changed by an override" for key in source.overrides
    }
    origins |= {key: "swept" for axis in plan.scenario.sweep for key in axis.keys}
    rows: Rows = []
    for place, name in enumerate(Parts._fields):
        models: dict[str, tuple[str, ...]] = {}
        for point in plan.points:
            part = getattr(point, name)
            models.setdefault(
                part.model, (name, part.model, origins[name], _meaning(part))
            )
            if name in point.why:
                chosen = f"→ {point.chosen[place].model}"
                models[chosen] = ("", chosen, "chosen", point.why[name])
        rows += models.values()
    differ = ", ".join(plan.differing)
    text = (
        f"differ in {differ}"
        if differ
        else "nothing is random, so one member is enough"
    )
    return [*rows, ("members", f"{plan.members:,}", text)]


def _meaning(part: Any) -> str:
    """Return the first sentence of a part's description."""
    line = (type(part).__doc__ or "").strip().partition("\n")[0].partition(". Limit")[0]
    return re.sub(r"[`\\]", "", line).rstrip(".")


def _quantities(points: Sequence[Scenario]) -> Rows:
    """Return every number and choice of a scenario, with its range if a sweep changes it."""
    columns: dict[str, tuple[str, str, list[Any]]] = {}
    tables = (entries(part, f"{name}.") for name, part in distinct(points))
    plain = (entry for entry in entries(points[0]) if "." not in entry.key)
    derived = (
        Entry(key, value, quantity)
        for point in points
        for key, (quantity, value) in point.derived.items()
    )
    for key, value, quantity in itertools.chain(*tables, derived, plain):
        unrecorded = key.startswith("record.") and points[0].record == Record()
        if value in (None, "", ()) or key in _ELSEWHERE or unrecorded:
            continue
        unit = "" if quantity is None or quantity.unit == "1" else quantity.unit
        meaning = (
            ""
            if quantity is None or key.endswith(quantity.meaning)
            else quantity.meaning
        )
        if isinstance(value, tuple):
            value = f"{len(value)} values" + (
                f", {_span(value, unit)}" if quantity else ""
            )
        columns.setdefault(key, (unit, meaning, []))[2].append(
            str(value).lower() if isinstance(value, bool) else value
        )
    order = list(dict.fromkeys(key.partition(".")[0] for key in columns))
    rows: Rows = []
    for key in sorted(columns, key=lambda key: order.index(key.partition(".")[0])):
        unit, meaning, values = columns[key]
        different = list(dict.fromkeys(values))
        if isinstance(different[0], str):
            shown = ", ".join(different[:_MOST_WORDS]) + (
                ", ..." if len(different) > _MOST_WORDS else ""
            )
        else:
            shown = _span(
                different, unit, ".6g" if isinstance(different[0], float) else ""
            )
        rows.append(
            (
                key,
                shown,
                f"{meaning} ({len(different)} values)"
                if len(different) > 1
                else meaning,
            )
        )
    return rows


def _contact(points: Sequence[Scenario]) -> Rows:
    """Return radius and pull-off load of the contact with all its bonds and without fluctuations."""
    closed = [point.rest_radius for point in points if math.isfinite(point.rest_radius)]
    lost, loaded = (
        len(points) - len(closed),
        [point for point in points if point.contact.load is not None],
    )
    loads = [
        point.contact.pull_off_load(point.adhesion.work, point.bodies)
        for point in loaded
    ]
    theory = points[0].contact.theory
    rows: Rows = [(f"{theory} radius", _span(closed, "m"))] if closed else []
    if lost:
        rows.append(("open", f"beyond pull-off at {lost} of {len(points)} points"))
    if loads:
        rows.append(("pull-off load", _span(loads, "N")))
    gaps = [point.contact.jump_in_distance(point.adhesion.work) for point in points]
    if max(gaps) > 0.0:
        rows.append(("jump into contact", f"at a distance of {_span(gaps, 'm')}"))
    return rows


def _limits(points: Sequence[Scenario]) -> Rows:
    """Return the numbers that tell if the scenes lie within the theory, each with its meaning."""
    known = [point.limits for point in points]
    ends = [
        1e9 * distance
        for point in points
        for distance in point.contact.distances(point.adhesion.work)
    ]
    of_range = f"{max(ends):.3g}"
    if min(ends) < max(ends):
        of_range += f" to {min(ends):.3g}"
    rows: Rows = []
    if tabor := [number for row in known for number in row.tabor if number > 0.0]:
        meaning = f"for z0 = {of_range} nm; JKR's theory holds above about {JKR_FROM:g}"
        rows.append(("Tabor number", _span(tabor, digits=".3g"), meaning))
    if slopes := [row.slope for row in known if row.slope > 0.0]:
        squeezed = [row.squeeze for row in known if row.squeeze > 0.0]
        meaning = (
            "strain of the solid" if not squeezed else "slope of the sphere at the edge"
        )
        off = [row.parabola for row in known if math.isfinite(row.parabola)]
        if off:
            share = f"{100.0 * max(off):.2g} %"
            meaning += f"; the area of a parabola is up to {share} larger than that of a sphere"
        rows.append(("a/R", _span(slopes, digits=".3g"), meaning))
        if squeezed:
            meaning = "about the shear strain at the base of a layer that is thinner than the contact"
            rows.append(("a³/(4√3 R h²)", _span(squeezed, digits=".3g"), meaning))
    if strains := [row.strain for row in known if row.strain > 0.0]:
        meaning = "shear strain of the surface; finite strains reduce the area from about 0.1 on"
        rows.append(("tau0/G", _span(strains, digits=".3g"), meaning))
    tensions = [tension for row in known for tension in row.tensions]
    low, high = (engineering(end(tensions), "N/m") for end in (min, max))
    lengths = [length for row in known for length in row.capillary]
    meaning = (
        f"for gamma = {low} to {high} (half the work of adhesion, water); surface tension"
        " shapes contacts of about this length"
    )
    shares = [
        row.capillary[1] / point.widest
        for row, point in zip(known, points, strict=True)
        if point.widest > 0.0
    ]
    if shares:
        times = float(f"{1.0 / max(shares):.2g}")
        meaning += f", and the radius is at least {times:,.6g} times as large"
    rows.append(("gamma/E", _span(lengths, "m", ".3g"), meaning))
    return rows


def _fluctuations(points: Sequence[Scenario]) -> Rows:
    """Return the size of the fluctuations on the infinite plane, and the errors of the cell."""
    fields = [
        (_power(point), point.fluctuations.spectrum, point.elastic) for point in points
    ]
    if not any(spectrum.variance > 0.0 for _, spectrum, _ in fields):
        return []
    rms = [math.sqrt(power * spectrum.variance) for power, spectrum, _ in fields]
    energies = [
        power * solid.stored_energy(spectrum) for power, spectrum, solid in fields
    ]
    settled = any(spectrum.bond_made for _, spectrum, _ in fields)
    when = "in steady sliding at the last speed" if settled else "at amplitude 1"
    rows = {"rms of the stress": f"{_span(rms, 'Pa')} {when}"}
    rows["stored energy"] = f"{_span(energies, 'J/m^2')} {when}, on the infinite plane"
    cells = {point.fluctuations.side(point.setting.cell): point for point in points}
    if sides := [side for side in cells if math.isfinite(side)]:
        ratios = [
            side / point.rest_radius
            for side, point in cells.items()
            if point.rest_radius > 0.0
        ]
        rows["cell"] = _span(sides, "m") + (
            f", {_span(ratios)} times the JKR radius" if ratios else ""
        )
    # a map that is the field has an rms and an energy of its own
    rows |= dict(
        detail
        for point in points[::-1]
        for detail in point.fluctuations.details(point.setting)
    )
    if modes := [
        cast(ModalProcess, point.process).modes
        for point in points
        if point.fluctuations.keeps_modes
    ]:
        pairs, grid = (
            _span([each.qx.size for each in modes], "", ","),
            _span([each.points for each in modes], "", ","),
        )
        rows["modes"] = f"{pairs} pairs on a grid of {grid} points a side"
    return [*rows.items()]


def _power(point: Scenario) -> float:
    """Return the factor of the spectrum's variance: n E[f²] in steady sliding if bonds make the field, else 1."""
    if not point.fluctuations.spectrum.bond_made:
        return 1.0
    settled = point.population.steady(point.speeds(2)[1:])
    return float(settled.frozen[0] + settled.varying[0])


def _errors(plan: Plan, most: Worst | None) -> Rows:
    """Return the systematic errors of area and friction where they are largest, beside the standard error."""
    if most is None:
        return []
    (point, errors), rows, members = (
        most,
        list[tuple[str, ...]](),
        plan.scenario.ensemble.members,
    )
    for name, words in SOURCES.items():
        area, friction = (
            100.0 * errors[f"{name}_error_{of}"] for of in ("area", "friction")
        )
        rows.append(
            (words, f"{area:+.2g} points of A/A_JKR, {friction:+.2g} % of the friction")
        )
    spread = errors["member_spread_area"]
    # masked members differ by rounding alone
    noise = 100.0 * spread / math.sqrt(members) if spread > _ROUNDING else 0.0
    rows.append(
        (
            "standard error",
            f"{noise:.2g} points of A/A_JKR, of {members} members at one time",
        )
    )
    return [*rows, ("largest at", error_in_words(plan, point, errors))]


def _slider(plan: Plan) -> Rows:
    """Return the stiffness of the contact, and the springs and speeds at which steady sliding is unstable."""
    examined = places(len(plan.points), COMPUTED)
    points = [plan.points[place] for place in examined]
    driven = [point for point in points if point.drive.solves_motion]
    compliances = []
    for point in driven:
        radius = np.asarray(math.sqrt(point.contact_area / math.pi))
        drive = cast(Spring, point.drive)
        compliances.append(float(drive.compliance(point.elastic, radius)))
    rows: Rows = []
    if compliances:
        stiffnesses = [1.0 / each if each else math.inf for each in compliances]
        rows.append(("contact k_t", _span(stiffnesses, "N/m")))
    sprung = {
        id(point): stability(point)
        for point in driven
        if cast(Spring, point.drive).spring
    }
    if not sprung:
        return rows
    drives = [cast(Spring, point.drive) for point in driven if id(point) in sprung]
    if frequencies := [
        math.sqrt(drive.spring / drive.mass) / (2.0 * math.pi)
        for drive in drives
        if drive.mass > 0.0
    ]:
        rows.append(
            ("natural frequency", f"{_span(frequencies)} Hz, of mass and spring")
        )
    if known := [each for each in sprung.values() if not math.isnan(each.stiffness)]:
        most = max(known, key=lambda each: each.stiffness)
        text = f"{_span([each.stiffness for each in known])} N/m of the spring"
        speeds_of_run = [
            speed for point in driven for speed in distinct_speeds(point).tolist()
        ]
        if most.stiffness > 0.0:
            any_spring = " (inf: with any spring)" * math.isinf(most.stiffness)
            text += f"{any_spring}, at {engineering(most.speed, 'm/s')}"
            # no spring has the frequency of an infinite stiffness
            if most.frequency > 0.0 and not any_spring:
                text += f" with {most.frequency:.4g} Hz"
        elif speeds_of_run:
            text += f": with no spring, at {_span(speeds_of_run, 'm/s')}"
        rows.append(("oscillates below", text))

    def speeds(point: Scenario) -> list[str]:
        return [_unstable(sprung[id(point)])] if id(point) in sprung else []

    return rows + [("steady sliding", text) for text in grouped(plan, examined, speeds)]


def _unstable(sliding: Stability) -> str:
    """Return ranges of unstable speeds in words."""
    ranges = sliding.unstable
    if math.isnan(sliding.stiffness):
        return "no closed form says whether it is stable behind this spring"
    if not ranges:
        return "stable at any speed behind this spring"
    words = []
    for low, high in ranges:
        above = f"above {engineering(low, 'm/s')}" if low > 0.0 else "if slow"
        again = f", and stable again above {engineering(high, 'm/s')}"
        words.append(above + (again if high < math.inf else ""))
    return f"unstable {', unstable '.join(words)}, behind this spring"


def _run(plan: Plan) -> Rows:
    """Return the size of a run: steps, members, time, memory and file."""
    scene, clock, jobs = plan.scenario, plan.points[0].clock, usual_jobs(plan)
    rows: Rows = [
        (
            "time",
            f"{clock.steps:,} step{'s' if clock.steps > 1 else ''}, {clock.records:,} records",
        )
    ]
    rows.append(("members", f"{plan.members:,}"))
    if scene.sweep:
        axes = " × ".join(f"{len(axis.values)} {axis.keys[0]}" for axis in scene.sweep)
        rows.append(
            (
                "sweep",
                f"{axes} = {len(plan.points):,} points"
                if len(scene.sweep) > 1
                else axes,
            )
        )
    needs, (limit, source) = forecast(plan, jobs, pace_of(plan)), memory_limit()
    short = f", but {size(limit)} {source}" if memory(plan, 1) > limit else ""
    before = (
        ""
        if scene.record.compression == "none"
        else f", {size(plan.bytes)} before compression"
    )
    return [
        *rows,
        ("work", f"{work(plan):,} member-steps, {_times(needs, jobs)}"),
        (
            "memory",
            f"about {size(needs.memory)}{', all processes together' if jobs > 1 else ''}{short}",
        ),
        ("file", f"about {size(needs.file)}{before}"),
    ]
