"""What a scenario would run, in words: for ``sim check``."""

import itertools
import math
import os
import re
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from sim.ensemble import bounds
from sim.ensemble.bounds import size, spread
from sim.ensemble.oscillations import of_slider
from sim.ensemble.plan import Block, Plan, seconds_a_step, work
from sim.ensemble.progress import duration
from sim.laws import jkr
from sim.numerics import jit
from sim.numerics.files import StoreTrouble
from sim.parts.exchange import Parts
from sim.parts.shear.modes import ModalProcess
from sim.scenario.clock import Record
from sim.scenario.declared import distinct, entries
from sim.scenario.scenario import Scenario

_MOST_WORDS = 6
#: Time for which steps are tried [s]; a run that is counted shorter [s] is not tried, or not announced.
_TRIED, _WORTH_TRYING, _LONG = 0.25, 1.0, 10.0
#: Keys that stand elsewhere than among the quantities.
_ELSEWHERE = ("name", "sweep", *(f"{part}.model" for part in Parts._fields))
_ROWS = {"cell_error": "error of the cell", "banded_error": "error of the bands", "member_spread": "spread of a member"}

Rows = list[tuple[str, ...]]


class _NotCompiledError(Exception):
    """A kernel is not in the cache."""


def preview(scenario: Scenario) -> str:
    """Models of the parts, quantities in SI, errors known before the run, and time, memory and file that it takes.

    Parameters
    ----------
    scenario : Scenario
        As ``sim.load`` returns it; of a sweep every point counts.

    Returns
    -------
    str
        Several lines for a terminal.
    """
    plan = Plan.of(scenario)
    some = spread(plan.points)
    blocks: dict[str, Rows] = {
        "models": _models(plan),
        "quantities in SI": _quantities(plan.points),
        "contact at rest": _contact(plan.points),
        "fluctuations": _fluctuations(some),
        "slider": _slider([point for point in some if point.drive.solves_motion]),
        "notes": [(text,) for text in [*remarks(plan), *_lacking(plan)]],
        "the run": _run(plan),
    }
    return "\n\n".join([scenario.name, *(f"{title}\n{_aligned(rows)}" for title, rows in blocks.items() if rows)])


def remarks(plan: Plan) -> list[str]:
    """What is to be known before a run, one sentence each."""
    found = [text for point in spread(plan.points) for text in point.remarks()]
    if plan.scenario.record.per_member is None and not plan.per_member:
        found.append(
            "every member would make a file of more than 20 GB: mean, spread and standard error are kept alone"
            " (record.per_member = true keeps every member)"
        )
    return list(dict.fromkeys(found))


def _aligned(rows: Rows) -> str:
    """Rows in columns, each as wide as its longest cell."""
    widths = [max(len(cell) for row in rows for cell in row[place : place + 1]) for place in range(len(rows[0]))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip() for row in rows)
    return "\n".join(f"  {line}" for line in lines)


def _span(values: Sequence[float], unit: str = "", digits: str = ".4g") -> str:
    """A number, or the range of several."""
    low, high = format(min(values), digits), format(max(values), digits)
    return f"{low if low == high else f'{low} to {high}'} {unit}".strip()


def _models(plan: Plan) -> Rows:
    """The model of each part, why it is that one, and what it does."""
    source = plan.scenario.origin
    named = tomllib.loads(source.text.removeprefix("\ufeff").replace("\r\n", "\n"))
    changed = {key.partition(".")[0] for key in source.overrides}
    swept = {key for axis in plan.scenario.sweep for key in axis.keys}
    rows: Rows = []
    for place, name in enumerate(Parts._fields):
        why = "in the file" if name in named else "left out, so the simplest" if source.text else "given"
        why = "swept" if name in swept else "changed by an override" if name in changed else why
        found: dict[str, tuple[str, ...]] = {}
        for point in plan.points:
            part = getattr(point, name)
            if part.model not in found:
                found[part.model] = (name, part.model, why, _meaning(part))
            if name in ("bonds", "shear") and name in point.why:
                chosen = point.chosen[place].model
                found[f"→ {chosen}"] = ("", f"→ {chosen}", "chosen", point.why[name])
        rows += found.values()
    differ = ", ".join(name for name in Parts._fields if any(point.varies[name] for point in plan.points))
    said = f"differ in {differ}" if differ else "differ in nothing, so one is computed for all"
    return [*rows, ("members", str(plan.scenario.ensemble.members), said)]


def _meaning(part: Any) -> str:
    """The first sentence of a part's description."""
    line = (type(part).__doc__ or "").strip().partition("\n")[0].partition(". Limit")[0]
    return re.sub(r"[`\\]", "", line).rstrip(".")


def _quantities(points: Sequence[Scenario]) -> Rows:
    """Every number and choice of a scenario; where a sweep changes one, its range."""
    found: dict[str, tuple[str, str, list[Any]]] = {}
    tables = (entries(part, f"{name}.") for name, part in distinct(points))
    plain = (entry for entry in entries(points[0]) if "." not in entry.key)
    for key, value, quantity in itertools.chain(*tables, plain):
        unrecorded = key.startswith("record.") and points[0].record == Record()
        if value in (None, "", ()) or key in _ELSEWHERE or unrecorded:
            continue
        unit = "" if quantity is None or quantity.unit == "1" else quantity.unit
        meaning = "" if quantity is None or key.endswith(quantity.meaning) else quantity.meaning
        if isinstance(value, tuple | bool):
            span = f", {_span(value, unit)}" if quantity and isinstance(value, tuple) else ""
            value = f"{len(value)} values{span}" if isinstance(value, tuple) else str(value).lower()
        found.setdefault(key, (unit, meaning, []))[2].append(value)
    order = list(dict.fromkeys(key.partition(".")[0] for key in found))
    rows: Rows = []
    for key in sorted(found, key=lambda key: order.index(key.partition(".")[0])):
        unit, meaning, values = found[key]
        different = list(dict.fromkeys(values))
        if all(isinstance(value, int | float) for value in different):
            shown = _span(different, unit, ".6g" if isinstance(different[0], float) else "")
        else:
            shown = ", ".join(different[:_MOST_WORDS]) + (", ..." if len(different) > _MOST_WORDS else "")
        rows.append((key, shown, f"{meaning} ({len(different)} values)" if len(different) > 1 else meaning))
    return rows


def _contact(points: Sequence[Scenario]) -> Rows:
    """What is known of the contact with all its bonds and without fluctuations."""
    rows: Rows = []
    closed = [point.rest_radius for point in points if math.isfinite(point.rest_radius)]
    if closed:
        rows.append(("JKR radius", _span(closed, "m")))
    if len(closed) < len(points):
        share = f" at {len(points) - len(closed)} of {len(points)} points" if closed else ""
        rows.append(("open", f"beyond pull-off{share}"))
    loaded = [point for point in points if point.contact.load is not None]
    if loaded:
        loads = [float(jkr.pull_off_load(point.adhesion.work, point.sphere.radius)) for point in loaded]
        rows.append(("pull-off load", _span(loads, "N")))
    return rows


def _fluctuations(points: Sequence[Scenario]) -> Rows:
    """The spectrum on the infinite plane, and how the cell compares to it."""
    spectra = [point.fluctuations.spectrum for point in points]
    if not any(spectrum.variance > 0.0 for spectrum in spectra):
        return []
    powers = [_power(point) for point in points]
    rms = [math.sqrt(power * spectrum.variance) for power, spectrum in zip(powers, spectra, strict=True)]
    plane = [float(point.fluctuations.spectrum.surface_energy(*point.solid.effective)) for point in points]
    energies = [power * energy for power, energy in zip(powers, plane, strict=True)]
    settled = any(spectrum.bond_made for spectrum in spectra)
    when = "in steady sliding at the last speed" if settled else "at amplitude 1"
    rows: Rows = [("rms of the stress", f"{_span(rms, 'Pa')} {when}")]
    rows.append(("stored energy", f"{_span(energies, 'J/m^2')} {when}, on the infinite plane"))
    cells = {point.fluctuations.side(point.setting.cell): point for point in points}
    sides = [side for side in cells if math.isfinite(side)]
    if sides:
        ratios = [side / point.rest_radius for side, point in cells.items() if point.rest_radius > 0.0]
        times = f", {_span(ratios)} times the JKR radius" if ratios else ""
        rows.append(("cell", _span(sides, "m") + times))
    errors: dict[str, list[float]] = {}
    for point in points:
        for name, value in point.process.known_errors().items():
            errors.setdefault(name, []).append(value)
    for start, title in _ROWS.items():
        found = {name.removeprefix(f"{start}_"): errors.pop(name) for name in list(errors) if name.startswith(start)}
        if found:
            each = (f"{name.replace('_', ' ')} {_percent(values)}" for name, values in found.items())
            rows.append((title, ", ".join(each)))
    rows += [(name.replace("_", " "), _span(values, "", ",.0f")) for name, values in errors.items()]
    details = dict(detail for point in points[::-1] for detail in point.fluctuations.details(point.setting))
    rows = [
        *({row[0]: row[1] for row in rows} | details).items()
    ]  # a map that is the field has an rms and an energy of its own
    modes = [cast(ModalProcess, point.process).modes for point in points if point.fluctuations.keeps_modes]
    if modes:
        pairs, grid = _span([each.qx.size for each in modes], "", ","), _span([each.points for each in modes], "", ",")
        rows.append(("modes", f"{pairs} pairs on a grid of {grid} points a side"))
    return rows


def _slider(points: Sequence[Scenario]) -> Rows:
    """Stiffness of the contact, and of the spring below which friction that falls with speed makes oscillations."""
    return [(name, f"{_span(values)} {said}" if values else said) for (name, said), values in of_slider(points).items()]


def _power(point: Scenario) -> float:
    """Factor of the spectrum's variance: 1, or n E[f²] of bonds that make the field, in steady sliding at the end."""
    if not point.fluctuations.spectrum.bond_made:
        return 1.0
    settled = point.population.steady(point.speeds(2)[1:])
    return float(settled.frozen[0] + settled.varying[0])


def _percent(values: list[float]) -> str:
    value = max(values, key=abs)
    return f"{100.0 * value:+.2g} %" if abs(value) > 1e-9 else "none"


def usual_jobs(plan: Plan) -> int:
    """Processes that a run has by itself: one a core where the work is worth it."""
    return plan.worthwhile(len(os.sched_getaffinity(0)))


def _lacking(plan: Plan) -> list[str]:
    """Memory or disk that there is not enough of for a run here."""
    said = []
    try:
        bounds.fitting(plan, 1)
    except bounds.NoRoom as trouble:
        said.append(str(trouble))
    try:
        bounds.refuse_full_disk(plan, Path("outputs") / "dataset.nc")
    except StoreTrouble as trouble:
        said.append(str(trouble))
    return said


def _run(plan: Plan) -> Rows:
    """How much there is to compute and to keep."""
    scene, clock, jobs = plan.scenario, plan.points[0].clock, usual_jobs(plan)
    alike = ", all alike, so one is computed" if scene.ensemble.members > plan.members else ""
    rows: Rows = [("time", f"{clock.steps:,} step{'s' if clock.steps > 1 else ''}, {clock.records:,} records")]
    rows.append(("members", f"{scene.ensemble.members:,}{alike}"))
    if scene.sweep:
        axes = " × ".join(f"{len(axis.values)} {axis.keys[0]}" for axis in scene.sweep)
        rows.append(("sweep", f"{axes} = {len(plan.points):,} points" if len(scene.sweep) > 1 else axes))
    pace = tried(plan)
    found = bounds.takes(plan, jobs, pace or 1.0)
    rows.append(("work", f"{work(plan):,} member-steps, {_times(found, jobs, pace is not None)}"))
    rows.append(("memory", f"about {size(found.memory)}{', all processes together' if jobs > 1 else ''}"))
    before = "" if scene.record.compression == "none" else f", {size(plan.bytes)} before compression"
    rows.append(("file", f"about {size(found.file)}{before}"))
    rows.append(("disk", f"about {size(found.disk)} while it is made"))
    return rows


def announced(
    plan: Plan, jobs: int | None, memory: float, shard: tuple[int, int] = (1, 1), kept: Any = ()
) -> tuple[int, list[str]]:
    """Processes of a run, of those wanted as many as ``memory`` [byte] holds, and what is said before it.

    Of a long run, or one of several processes, that is how much it takes beside the parts that are ``kept`` of it;
    kernels that are missing are compiled for it, before these processes need them.
    """
    wanted, said = jobs or usual_jobs(plan), [f"note: {text}" for text in remarks(plan)]
    if (jobs := bounds.fitting(plan, wanted, memory)) < wanted:
        said.append(f"note: there is memory for {jobs} of {wanted} processes")
    if not bounds.tabulated(plan):
        said.append("note: of so large a dataset `sim stats` prints the table")
    left = 1.0 - sum(task.done(kept) for task in plan.share(*shard)) / work(plan, *shard) if kept else 1.0
    if jobs > 1 or left * bounds.counted(plan) > _LONG:
        found = bounds.takes(plan, jobs, tried(plan, compiling=True) or 1.0, shard[1], left)
        if jobs > 1 or found.clock > _LONG:
            room = f"{size(found.memory)} of memory, {size(found.disk)} of disk for a file of {size(found.file)}"
            said.append(f"{_times(found, jobs)}, {room}")
    return jobs, said


def tried(plan: Plan, compiling: bool = False) -> float | None:
    """Pace of a machine: CPU time of some steps, computed as a run does, over what is counted for them.

    1 for a run that is counted short; None where kernels are not in the cache, unless ``compiling`` them is wanted.
    """

    def refuse(name: str) -> None:
        raise _NotCompiledError(name)

    if bounds.counted(plan) < _WORTH_TRYING:
        return 1.0
    before, ends = list(jit.on_compiling), spread(plan.points, 3)
    jit.on_compiling[:] = before if compiling else [refuse]
    try:
        found = [_tried(plan, point, _TRIED / len(ends)) for point in ends]
    except _NotCompiledError:
        return None
    finally:
        jit.on_compiling[:] = before
    return sum(took for took, _ in found) / sum(expected for _, expected in found)


def _tried(plan: Plan, point: Scenario, most: float) -> tuple[float, float]:
    """CPU time of some steps at one point, for ``most`` [s] altogether, and what is counted for them [s]."""
    from sim.ensemble.part_files import MemoryParts
    from sim.ensemble.simulate import advance_group, ignore

    marks: list[float] = []

    class Timed(MemoryParts):
        """Parts of which nothing is kept but when each was made."""

        def save(self, *of_part: object) -> None:
            marks.append(time.process_time())

    def late() -> bool:  # each block is twice as long as the one before
        return len(marks) > 2 and marks[-1] - marks[0] + 2.0 * (marks[-1] - marks[-2]) > most

    members = np.arange(min(plan.group, max(1, int(most / 10.0 / seconds_a_step(point, 1)))))
    steps, stride = point.clock.steps, point.clock.stride
    within = {2**k for k in range(stride.bit_length()) if 2**k < stride}  # beyond that, a block ends at a record
    ends = sorted({-1, 0, *within, *(2**k * stride for k in range((steps // stride).bit_length())), steps})
    blocks = [Block(start, end, stride) for start, end in itertools.pairwise(ends)]
    task = next(plan.tasks())._replace(points=[point], members=members, blocks=blocks, names=["tried"] * len(blocks))
    advance_group(Timed(), task, ignore, late)
    point.release()
    last = blocks[len(marks) - 1]
    return marks[-1] - marks[-2], bounds.counted_block(
        point, members, last, point.speeds(5, last.end / point.clock.steps)[2:]
    )


def _times(found: bounds.Takes, jobs: int, compiled: bool = True) -> str:
    """CPU time and time by the clock in words."""
    clock = f", {duration(found.clock)} by the clock in {jobs} processes" if jobs > 1 else ""
    compiling = "" if compiled else " by rough costs, and up to half a minute to compile, once"
    return f"about {duration(found.cpu)} of CPU time{clock}{compiling}"
