"""What a scenario would run, in words: for ``sim check``."""

import math
import re
import tomllib
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from sim.ensemble.plan import LEFT, Plan, map_bytes, seconds_a_step, work
from sim.laws import jkr
from sim.parts.exchange import Parts
from sim.parts.shear.modal import ModalProcess
from sim.scenario.clock import Record
from sim.scenario.declared import entries
from sim.scenario.scenario import Scenario

# Rough costs of one core, for the estimate only [s]: starting up; the table, and a byte of it; a point of a sweep; a
# part file; a record of a batch, of a member; a byte.
_START, _TABLE, _TABULATED = 1.2, 0.9, 5e-9
_POINT, _PART, _RECORD, _RECORD_OF_MEMBER, _BYTE = 15e-3, 5e-3, 5e-6, 2e-7, 50e-9
_PROGRAM_BYTES = 200e6
#: A file without its trajectories [byte].
_BARE = 1e5
#: Points of a sweep whose cells are looked at.
_MOST_POINTS = 8
_MOST_WORDS = 6
#: Keys that stand elsewhere than among the quantities.
_ELSEWHERE = ("name", "sweep", *(f"{part}.model" for part in Parts._fields))
_ROWS = {"cell_error": "error of the cell", "banded_error": "error of the bands", "member_spread": "spread of a member"}

Rows = list[tuple[str, ...]]


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
    some = _spread(plan.points)
    blocks: dict[str, Rows] = {
        "models": _models(plan),
        "quantities in SI": _quantities(plan.points),
        "contact at rest": _contact(plan.points),
        "fluctuations": _fluctuations(some),
        "notes": [(text,) for text in remarks(plan)],
        "the run": _run(plan, some),
    }
    return "\n\n".join([scenario.name, *(f"{title}\n{_aligned(rows)}" for title, rows in blocks.items() if rows)])


def remarks(plan: Plan) -> list[str]:
    """What is to be known before a run, one sentence each."""
    found = [text for point in _spread(plan.points) for text in point.remarks()]
    if plan.scenario.record.per_member is None and not plan.per_member:
        found.append(
            "every member would make a file of more than 20 GB: mean, spread and standard error are kept alone"
            " (record.per_member = true keeps every member)"
        )
    return list(dict.fromkeys(found))


def _spread(points: Sequence[Scenario]) -> list[Scenario]:
    """Some of the points, first and last included."""
    places = np.unique(np.linspace(0, len(points) - 1, min(_MOST_POINTS, len(points))).round().astype(int))
    return [points[place] for place in places]


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
        why = "swept" if name in swept else "changed by --set" if name in changed else why
        found: dict[str, tuple[str, ...]] = {}
        for point in plan.points:
            part = point.given[place]
            found[part.model] = (name, part.model, why, _meaning(part))
            if name in point.why:
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
    for point in points:
        for key, value, quantity in entries(point):
            unrecorded = key.startswith("record.") and point.record == Record()
            if value in (None, "", ()) or key in _ELSEWHERE or unrecorded:
                continue
            unit = "" if quantity is None or quantity.unit == "1" else quantity.unit
            meaning = "" if quantity is None or key.endswith(quantity.meaning) else quantity.meaning
            if isinstance(value, tuple | bool):
                value = f"{len(value)} values" if isinstance(value, tuple) else str(value).lower()
            found.setdefault(key, (unit, meaning, []))[2].append(value)
    tables = list(dict.fromkeys(key.partition(".")[0] for key in found))
    rows: Rows = []
    for key in sorted(found, key=lambda key: tables.index(key.partition(".")[0])):
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
    modes = [cast(ModalProcess, point.process).modes for point in points if point.fluctuations.keeps_modes]
    if modes:
        pairs, grid = _span([each.qx.size for each in modes], "", ","), _span([each.points for each in modes], "", ",")
        rows.append(("modes", f"{pairs} pairs on a grid of {grid} points a side"))
    return rows


def _power(point: Scenario) -> float:
    """Factor of the spectrum's variance: 1, or n E[f²] of bonds that make the field, in steady sliding at the end."""
    if not point.fluctuations.spectrum.bond_made:
        return 1.0
    settled = point.population.steady(point.speeds(2)[1:])
    return float(settled.frozen[0] + settled.varying[0])


def _percent(values: list[float]) -> str:
    value = max(values, key=abs)
    return f"{100.0 * value:+.2g} %" if abs(value) > 1e-9 else "none"


def _run(plan: Plan, some: Sequence[Scenario]) -> Rows:
    """How much there is to compute and to keep."""
    scene, clock = plan.scenario, plan.points[0].clock
    sample = Plan(scene, tuple(some))
    numbers = max(8 * point.process.pairs + point.population.numbers for point in some)
    held = _PROGRAM_BYTES + 8.0 * sample.group * (numbers + 2.0 * len(plan.variables) * sample.most_records)
    held += 2.0 * map_bytes(some[0], sample.group)  # a part, and what is written of it
    alike = ", all alike, so one is computed" if scene.ensemble.members > plan.members else ""
    rows: Rows = [("time", f"{clock.steps:,} step{'s' if clock.steps > 1 else ''}, {clock.records:,} records")]
    rows.append(("members", f"{scene.ensemble.members:,}{alike}"))
    if scene.sweep:
        axes = " × ".join(f"{len(axis.values)} {axis.keys[0]}" for axis in scene.sweep)
        rows.append(("sweep", f"{axes} = {len(plan.points):,} points" if len(scene.sweep) > 1 else axes))
    rows.append(
        ("work", f"{work(plan):,} member-steps, about {_duration(_seconds(plan, some))} on one core, table included")
    )
    rows.append(("memory", f"about {_size(held)}"))
    packed = f"about {_size(_BARE + LEFT[scene.record.compression] * plan.bytes)}"
    before = "" if scene.record.compression == "none" else f", {_size(_BARE + plan.bytes)} before compression"
    return [*rows, ("file", packed + before)]


def _seconds(plan: Plan, some: Sequence[Scenario]) -> float:
    """Time of the whole run on one core, linear in the members."""
    clock, group = plan.points[0].clock, min(plan.members, Plan(plan.scenario, tuple(some)).group)
    batches, points = max(1.0, plan.members / group), len(plan.points)
    records = clock.records * (_RECORD + group * _RECORD_OF_MEMBER)
    steps = clock.steps * sum(seconds_a_step(point, group) for point in some) / len(some)
    kept = _TABLE + (_BYTE + _TABULATED) * plan.bytes
    return _START + points * (_POINT + batches * (records + steps + _PART)) + kept


def _size(count: float) -> str:
    """A number of bytes to two digits, as the estimate it is."""
    unit, factor = next((row for row in (("GB", 1e9), ("MB", 1e6)) if count >= row[1]), ("kB", 1e3))
    return f"{float(f'{count / factor:.2g}'):g} {unit}"


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
