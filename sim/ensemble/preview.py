"""What a scenario would run, in words: for ``sim check``."""

import math
import re
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from sim.ensemble.plan import Plan, work
from sim.ensemble.recorded import VARIABLES
from sim.laws import jkr
from sim.laws.schallamach import bell_peak, first_moment_peak
from sim.parts.bonds import FirstMoment, Tracked
from sim.parts.bonds.rupture import Bell
from sim.parts.bonds.tracked import mean_life
from sim.scenario.clock import Record
from sim.scenario.declared import quantities
from sim.scenario.scenario import Scenario
from sim.scenario.source import Source
from sim.spectrum.finite_contact import marginal_energy

# Rough costs of one core, for the estimate only [s]: starting up, a step of a batch, and for each member of it
# a mode pair and a counted population; a part file.
_START, _STEP, _PAIR, _COUNTED, _PART = 1.5, 100e-6, 20e-9, 8e-6, 5e-3
_PROGRAM_BYTES = 200e6
_TOLERANCE = 0.05
#: Share of the mean stress above which the rms of the fluctuations is warned of: some 2 % of the area is reversed.
_MOST_REVERSED = 0.5
_LARGEST_SHARE = 0.3
_BANDED = 0.01
_EVENT = 1e-7
_SETTLED = "in steady sliding at the last speed"
_MOST_LATTICES = 8
_PARTS = ("drive", "bonds", "shear", "contact")
_STATISTICS = 3
_TOLD = ("name", "sweep", *(f"{part}.model" for part in _PARTS))

Rows = list[tuple[str, ...]]


def preview(scenario: Scenario) -> str:
    """Quantities in SI, the depth of each part, errors known beforehand, and what the run would take.

    Parameters
    ----------
    scenario : Scenario
        Sound, as ``sim.load`` returns it; of a sweep every point is looked at.

    Returns
    -------
    str
        Several lines for a terminal.
    """
    plan = Plan.of(scenario)
    some = _spread(plan.points, _MOST_LATTICES)
    blocks = (
        ("depths", _depths(plan)),
        ("quantities in SI", _quantities(plan.points)),
        ("contact at rest", _contact(plan.points)),
        ("fluctuations", _fluctuations(some)),
        ("to know before the run", _warnings(some)),
        ("the run", _run(plan, some)),
    )
    return "\n\n".join([scenario.name, *(f"{title}\n{_aligned(rows)}" for title, rows in blocks if rows)])


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    """Rows in columns, each as wide as its longest cell."""
    widths = [max((len(row[place]) for row in rows if len(row) > place), default=0) for place in range(len(rows[0]))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip() for row in rows)
    return "\n".join(f"  {line}" for line in lines)


def _spread(points: Sequence[Scenario], most: int) -> list[Scenario]:
    """Some of the points, first and last included."""
    places = np.unique(np.linspace(0, len(points) - 1, min(most, len(points))).round().astype(int))
    return [points[place] for place in places]


def _depths(plan: Plan) -> Rows:
    """The model of each part, why it is that one, and what it does."""
    source = plan.scenario.source
    named = set(tomllib.loads(source.text.removeprefix("\ufeff").replace("\r\n", "\n"))) if source.text else set()
    changed = {key.partition(".")[0] for key in source.overrides}
    swept = {key for axis in plan.scenario.sweep for key in axis.keys}
    rows: Rows = []
    for name in _PARTS:
        parts = {type(part): part for part in (getattr(point, name) for point in plan.points)}
        if name in swept:
            why = "swept"
        elif name in changed:
            why = "changed by --set"
        else:
            why = "in the file" if name in named or not source.text else "left out, so the shallowest"
        for part in parts.values():
            rows.append((name, part.model, why, _meaning(part)))
        rows += _chosen(plan.points, name)
    differ = [name for name in _PARTS if any(point.varies[name] for point in plan.points)]
    said = f"differ in {', '.join(differ)}" if differ else "differ in nothing, so one is computed for all"
    return [*rows, ("members", str(plan.scenario.ensemble.members), said)]


def _chosen(points: Sequence[Scenario], name: str) -> Rows:
    """The depths of a part that scenes chose which leave the choice, and why."""
    rows = {}
    for point in points:
        chosen = {"shear": point.fluctuations, "bonds": point.population}.get(name)
        if chosen is not None and chosen is not getattr(point, name):
            rows[chosen.model] = ("", f"→ {chosen.model}", "chosen", point.why[name])
    return list(rows.values())


def _meaning(part: Any) -> str:
    """The first sentence of a part's description."""
    line = (type(part).__doc__ or "").strip().partition("\n")[0].partition(". Limit")[0]
    return re.sub(r"`+", "", line).rstrip(".").replace("\\", "")


def _quantities(points: Sequence[Scenario]) -> Rows:
    """Every number and choice of a scenario; where a sweep changes one, its range."""
    found: dict[str, tuple[str, str, list[Any]]] = {}
    for point in points:
        declared = quantities(point)
        for key, value in _entries(point):
            quantity = declared[key][0] if key in declared else None
            unit = "" if quantity is None or quantity.unit == "1" else quantity.unit
            meaning = "" if quantity is None or key.endswith(quantity.meaning) else quantity.meaning
            found.setdefault(key, (unit, meaning, []))[2].append(value)
    order = ("name", "seed", "clock", "solid", "sphere", "adhesion", "contact", *_PARTS[:3], "ensemble", "record")
    rows: Rows = []
    for key in sorted(found, key=lambda key: order.index(key.partition(".")[0])):
        unit, meaning, values = found[key]
        different = len(set(values))
        swept = f" ({different} values)" if different > 1 else ""
        rows.append((key, f"{_range(values)} {unit}".strip(), (meaning + swept).strip()))
    return rows


def _entries(part: Any, prefix: str = "") -> Iterable[tuple[str, Any]]:
    """Keys and values as in a file, the model of a table first; what was left out and tells nothing is skipped."""
    for item in sorted(fields(part), key=lambda item: item.name != "model"):
        value = getattr(part, item.name)
        declared = getattr(type(part), "__pydantic_fields__", {}).get(item.name)
        key = prefix + str((declared and declared.alias) or item.name)
        if isinstance(value, Source) or value in (None, "", ()) or value == Record() or key in _TOLD:
            continue
        if is_dataclass(value):
            yield from _entries(value, f"{key}.")
        elif isinstance(value, tuple):
            yield key, f"{len(value)} values"
        else:
            yield key, str(value).lower() if isinstance(value, bool) else value


def _range(values: Sequence[Any]) -> str:
    """One value, or from where to where it goes."""
    different = list(dict.fromkeys(values))
    if len(different) == 1:
        return _number(different[0])
    if all(isinstance(value, int | float) for value in different):
        return f"{_number(min(different))} to {_number(max(different))}"
    return ", ".join(map(str, different[:6])) + (", ..." if len(different) > 6 else "")


def _number(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _about(values: Iterable[float], unit: str = "") -> str:
    """A derived value, or its range, to four digits."""
    low, high = (f"{value:.4g}" for value in (min(values), max(values)))  # type: ignore[type-var]
    return f"{low if low == high else f'{low} to {high}'} {unit}".strip()


def _counted(values: Sequence[float]) -> str:
    """A whole number, or its range."""
    low, high = (f"{value:,.0f}" for value in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def _contact(points: Sequence[Scenario]) -> Rows:
    """What is known of the contact with all its bonds and without fluctuations."""
    rows: Rows = []
    radii = [point.rest_radius for point in points]
    closed = [radius for radius in radii if math.isfinite(radius)]
    if closed:
        rows.append(("JKR radius", _about(closed, "m")))
    if len(closed) < len(radii):
        share = "" if not closed else f" at {len(radii) - len(closed)} of {len(radii)} points"
        rows.append(("open", f"beyond pull-off{share}"))
    loads = [
        jkr.pull_off_load(point.adhesion.work, point.sphere.radius)
        for point in points
        if point.contact.load is not None
    ]
    if loads:
        rows.append(("pull-off load", _about([float(load) for load in loads], "N")))
    return rows


def _fluctuations(points: Sequence[Scenario]) -> Rows:
    """The spectrum on the infinite plane, and how the cell stands to it."""
    some: list[Any] = [point for point in points if hasattr(point.shear, "spectrum")]
    if not some:
        return []
    powers = [_power(point) for point in some]
    rms = [(power * point.shear.spectrum.variance) ** 0.5 for power, point in zip(powers, some, strict=True)]
    energies = [
        power * float(point.shear.spectrum.surface_energy(*point.solid.effective))
        for power, point in zip(powers, some, strict=True)
    ]
    when = "at amplitude 1" if not any(point.shear.spectrum.bond_made for point in some) else _SETTLED
    rows: Rows = [
        ("rms of the stress", f"{_about(rms, 'Pa')} {when}"),
        ("stored energy", f"{_about(energies, 'J/m^2')} {when}, on the infinite plane"),
    ]
    celled: list[Any] = [point for point in points if hasattr(point.shear, "cell")]
    if not celled:
        return rows
    rows.append(("cell", _about([_cell(point) for point in celled], "m") + _in_radii(celled)))
    errors: dict[str, list[float]] = {}
    for point in celled:
        for name, value in point.process.known_errors().items():
            errors.setdefault(name, []).append(value)
    for title, start in (
        ("error of the cell", "cell_error_"),
        ("error of the bands", "banded_error_"),
        ("spread of a member", "member_spread_"),
    ):
        found = [(name.removeprefix(start), errors.pop(name)) for name in list(errors) if name.startswith(start)]
        if found:
            rows.append((title, ", ".join(f"{name.replace('_', ' ')} {_percent(values)}" for name, values in found)))
    rows += [(name.replace("_", " "), _counted(values)) for name, values in errors.items()]
    modes = [point.process.modes for point in celled if hasattr(point.process, "modes")]
    if modes:
        pairs, sides = _counted([each.qx.size for each in modes]), _counted([each.points for each in modes])
        rows.append(("modes", f"{pairs} pairs on a grid of {sides} points a side"))
    return rows


def _power(point: Scenario) -> float:
    """Factor of the spectrum's variance: 1, or n E[f²] of bonds that make the field, in steady sliding at the end."""
    if not point.shear.spectrum.bond_made:  # type: ignore[union-attr]
        return 1.0
    end = point.clock.duration
    settled = point.population.steady(point.drive.motion(0, end, end, end).speed)
    return float(settled.frozen[0] + settled.varying[0])


def _cell(point: Scenario) -> float:
    """Side of the periodic cell [m]."""
    return getattr(point.shear, "cell", None) or math.sqrt(math.pi) * point.rest_radius


def _in_radii(points: Sequence[Scenario]) -> str:
    ratios = [_cell(point) / point.rest_radius for point in points if point.rest_radius > 0.0]
    return f", {_about(ratios)} times the JKR radius" if ratios else ""


def _percent(values: list[float]) -> str:
    value = max(values, key=abs)
    return f"{100.0 * value:+.2g} %" if abs(value) > 1e-9 else "none"


def remarks(plan: Plan) -> list[str]:
    """What is to be known before a run, one sentence each."""
    return [text for (text,) in _warnings(_spread(plan.points, _MOST_LATTICES))]


def _warnings(points: Sequence[Scenario]) -> Rows:
    """What the theory or the cell cannot hold, and what is assumed."""
    said: list[str] = []
    for point in points:
        radius, fluctuating = point.rest_radius, hasattr(point.shear, "spectrum")
        if radius > _LARGEST_SHARE * point.sphere.radius:
            said.append(
                f"the contact exceeds {_LARGEST_SHARE} of the sphere's radius: the theory is for small contacts"
            )
        if isinstance(point.population, FirstMoment) and isinstance(point.population.rupture, Bell):
            said.append(_overprediction(point.population))
        made = getattr(getattr(point.shear, "spectrum", None), "bond_made", False)
        if made and point.shear.paid_by_adhesion > 0.0:
            said.append("friction has paid for the energy under each bond: with paid_by_adhesion it counts twice")
        jitters = point.varies["shear"] and point.contact.model == "equilibrium"
        if jitters and getattr(point.population, "area", "present") == "carried":
            said.append(
                'carried area in a contact that fluctuates has no limit of fine steps: take model = "rate_dependent"'
            )
        goes_on = getattr(point.population, "area", "present") == "present" and hasattr(point.population, "rupture")
        if point.contact.after_pull_off == "reattach" and goes_on:
            said.append('bonds go on sliding while the contact is open: bonds.area = "carried" starts without them')
        if getattr(point.drive, "rest", 0.0) >= point.clock.duration:
            said.append("the slider rests for the whole run: shorten drive.rest or lengthen clock.duration")
        if point.solid.poisson_ratio != 0.5:
            said.append("poisson_ratio is not 0.5: the normal-tangential coupling is neglected")
        if fluctuating and point.shear.paid_by_adhesion > 0.0:
            said.append("adhesion pays for the stored energy: the paper's assumption (shear.paid_by_adhesion)")
        if fluctuating and point.margin is None:
            said += _on_a_disc(point)
        if fluctuating and _reversed_friction(point) > _MOST_REVERSED:
            said.append(
                f"the rms of the fluctuations exceeds {_MOST_REVERSED} of the mean stress: patches of reversed friction"
            )
        if point.contact.course.lowest < 0.0 and point.varies["shear"]:
            said.append("under tension detachment is a first passage: take clock steps well below the correlation")
        spectrum = getattr(point.fluctuations, "spectrum", None)
        smallest = spectrum.support[0] if spectrum is not None and spectrum.wavevector is None else 0.0
        if hasattr(point.fluctuations, "cell") and 2.0 * math.pi > _cell(point) * smallest > 0.0:
            said.append("the spectrum has waves longer than the cell, which are missing: give a larger shear.cell")
        off = (abs(value) for name, value in point.process.known_errors().items() if name.startswith("cell_error"))
        if max(off, default=0.0) > _TOLERANCE:
            said.append(f"the cell is off by more than {_TOLERANCE:.0%}: a larger cell or more points bring it closer")
    return [(text,) for text in dict.fromkeys(said)]


def _on_a_disc(point: Scenario) -> list[str]:
    """By how much the plane's energy is off for a contact of this size, if that is more than the tolerance."""
    plane = float(point.shear.spectrum.surface_energy(*point.solid.effective))  # type: ignore[union-attr]
    if not (plane > 0.0 and point.rest_radius > 0.0):
        return []
    spectrum, tolerance = point.shear.spectrum, getattr(point.shear, "tolerance", _BANDED)  # type: ignore[union-attr]
    paid = float(marginal_energy(spectrum, point.rest_radius, *point.solid.effective))
    if abs(paid / plane - 1.0) <= tolerance:
        return []
    long = _longest_wave(point) > 2.0 * point.rest_radius
    what = "the longest waves exceed the contact, which" if long else "a contact of this size"
    off = f"{what} pays {paid / plane:.1%} of the plane's fluctuation energy when it grows"
    return [f'{off}: shear.contact = "disc" takes that into account']


def _overprediction(bonds: FirstMoment) -> str:
    """By how much the first-moment closure overpredicts the friction maximum under Bell's rupture."""
    recipe = bonds.rupture.zero_force_rate, bonds.rupture.bell_force, bonds.bond_stiffness, bonds.rebinding_rate  # type: ignore[union-attr]
    excess = first_moment_peak(*recipe, 1.0).stress / bell_peak(*recipe, 1.0).stress - 1.0
    return f'the mean stretch overpredicts the friction maximum by {excess:.0%}: bonds.model = "cohort" does not'


def _reversed_friction(point: Scenario) -> float:
    """Largest ratio of the rms of the fluctuations to the mean stress of the bonds over the run; 0 without a stress."""
    if not point.population.carries_stress or point.shear.spectrum.bond_made:  # type: ignore[union-attr]
        return 0.0
    rms, duration, ratios = math.sqrt(point.shear.spectrum.variance), point.clock.duration, [0.0]  # type: ignore[union-attr]
    for time in np.linspace(0.0, duration, 41):
        speed = point.drive.motion(0, float(time), float(time), duration).speed
        stress = point.population.steady(speed).strength
        size = rms * point.fluctuations.amplitude.factor(speed, stress)  # type: ignore[union-attr]
        ratios += [float(part / whole) for part, whole in np.broadcast(size, stress) if whole > 0.0]
    return max(ratios)


def _longest_wave(point: Scenario) -> float:
    """The longest wave of the fluctuations that the cell holds [m]."""
    spectrum: Any = getattr(point.shear, "spectrum", None)
    lowest = spectrum.support[0]
    longest = 2.0 * math.pi / lowest if lowest > 0.0 else math.inf
    return min(longest, _cell(point)) if hasattr(point.shear, "cell") else longest


def _tracked_seconds(point: Scenario) -> float:
    """Time that one member's tracked bonds take: their ruptures and bindings, at most 300 lives in a step."""
    bonds = point.population
    if not isinstance(bonds, Tracked):
        return 0.0
    times = np.linspace(0.0, point.clock.duration, 21)
    speeds = np.array([point.drive.motion(0, t, t, point.clock.duration).speed[0] for t in times.tolist()])
    lives = point.clock.step / (mean_life(speeds, bonds.law) + 1.0 / bonds.rebinding_rate)
    return float(_EVENT * bonds.sites * point.clock.steps * np.mean(np.minimum(lives, 300.0)))


def _run(plan: Plan, some: Sequence[Scenario]) -> Rows:
    """How much there is to compute and to keep."""
    scene, clock = plan.scenario, plan.points[0].clock
    sample = Plan(scene, tuple(some))
    pairs = max(point.process.pairs for point in some)
    bonds = max(point.population.numbers for point in some)
    batches = math.ceil(plan.members / sample.group) * len(plan.points)
    counted = _COUNTED if any(point.population.per_member for point in plan.points) else 0.0
    seconds = _START + batches * (clock.steps * _STEP + _PART) + work(plan) * (pairs * _PAIR + counted)
    seconds += plan.members * len(plan.points) / len(some) * sum(map(_tracked_seconds, some))
    held = _PROGRAM_BYTES + 8.0 * sample.group * (8.0 * pairs + bonds + 2.0 * len(VARIABLES) * sample.stretch)
    alike = ", all alike, so one is computed" if scene.ensemble.members > plan.members else ""
    rows: Rows = [
        ("time", f"{clock.steps:,} step{'s' if clock.steps > 1 else ''}, {clock.records:,} records"),
        ("members", f"{scene.ensemble.members:,}{alike}"),
    ]
    if scene.sweep:
        axes = " × ".join(f"{len(axis.values)} {axis.keys[0]}" for axis in scene.sweep)
        rows.append(("sweep", f"{axes} = {len(plan.points):,} points" if len(scene.sweep) > 1 else axes))
    return [
        *rows,
        ("work", f"{work(plan):,} member-steps, about {_duration(seconds)} on one core"),
        ("memory", f"about {_size(held)}"),
        ("file", f"{_size(_bytes(plan, some[0]))} at most, before compression"),
    ]


def _bytes(plan: Plan, point: Scenario) -> float:
    """Size of the trajectories and maps [byte]."""
    record = plan.scenario.record
    each = 4.0 if record.precision == "float32" else 8.0
    total = 2e4
    for variable in plan.variables:
        rows, size = 1, each
        if plan.varies(variable):
            rows, size = (plan.members, each) if record.per_member else (_STATISTICS, 8.0)
        total += rows * size * point.clock.records * len(plan.points)
    if record.maps:
        shown = min(record.map_members, plan.members) * len(record.maps) * len(plan.points)
        process: Any = point.process
        total += 8.0 * shown * process.modes.points**2
    return total


def _size(count: float) -> str:
    """A number of bytes to two digits, as the estimate it is."""
    unit, factor = next((row for row in (("GB", 1e9), ("MB", 1e6)) if count >= row[1]), ("kB", 1e3))
    return f"{float(f'{count / factor:.2g}'):g} {unit}"


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
