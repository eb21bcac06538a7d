"""Dataset of a run: its variables with units and names, and a netCDF file that is written once all parts are stored.

A file that HDF5 is still writing is lost when the run is killed; a renamed part is not.
"""

import functools
import hashlib
import importlib.metadata
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast

import netCDF4
import numpy as np
from pydantic import TypeAdapter

import sim.quantities as registry
from sim.ensemble.diagnosis import cure, systematic_errors, worst
from sim.ensemble.execute import pool
from sim.ensemble.plan import IN_MEMORY, Plan, part_name
from sim.ensemble.steady_speed import steady_speeds
from sim.ensemble.store import Blocks
from sim.ensemble.variables import NUMBERS, Variable
from sim.numerics.files import HDF5
from sim.numerics.grid import Lattice
from sim.numerics.hdf5 import (
    CHUNK_CACHE,
    File,
    Refused,
    opened,
    tables,
    write_in_memory,
)
from sim.scenario.files import Files
from sim.scenario.messages import in_plain_words
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.scenario.sweep import Axis, written
from sim.units.quantity import Quantity

#: Options of netCDF for each ``record.compression``. Six digits are within 5e-7: 20 bits and the leading one, rounded
#: to nearest, so that flags stay flags and equal numbers stay equal.
_ZLIB: dict[str, Any] = {"zlib": True, "complevel": 1, "shuffle": True}
_DIGITS = _ZLIB | {"significant_digits": 20, "quantize_mode": "BitRound"}
_PACKED: dict[str, dict[str, Any]] = {"none": {}, "zlib": _ZLIB, "digits": _DIGITS}
_FLAGS = "detached in_contact"
#: Version of a package, which is looked up in its files.
_version = functools.cache(importlib.metadata.version)
#: The auxiliary coordinate of all variables over time, if it is prescribed.
SPEED = "speed"
#: Statistics of the members' means over the second half of the run, and of their drift: of the last quarter less that
#: over the third. They are recorded if the members are not.
LATE = ("mean", "sem", "drift", "drift_sem")


class About(NamedTuple):
    """Unit, meaning and symbol of a variable that is neither a key of a scenario nor in the registry."""

    unit: str
    meaning: str
    symbol: str = ""


class Described(NamedTuple):
    """Description of one variable; ``values`` are None if the parts hold them."""

    kind: Any
    dimensions: tuple[str, ...]
    attributes: dict[str, Any]
    values: Any
    chunks: tuple[int, ...] | None
    compression: str


class Place(NamedTuple):
    """Axes of the variable of a quantity: of statistics or members (``each``), of time, and another one, ``axis``."""

    pooled: bool = False
    each: bool = True
    timed: bool = True
    axis: str = ""

    def axes(
        self, piece: "Piece", rows: slice = slice(None)
    ) -> tuple[int | slice, ...]:
        """Return the index of the numbers of some members, or of their statistics, in a piece."""
        return (
            *((slice(None),) if self.pooled else ()),
            *piece.where,
            *((rows,) if self.each else ()),
            *((piece.times,) if self.timed else ()),
        )


class Piece(NamedTuple):
    """Parts of one block at some points of a sweep: index of the points, records, members and names of the parts."""

    where: tuple[int | slice, ...]
    times: slice
    members: list[slice]
    names: list[str]


@dataclass
class Outline:
    """Everything of a dataset but the numbers of the parts; ``sweep`` are the sizes of the sweep's dimensions."""

    sweep: dict[str, int]
    sizes: dict[str, int] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)
    variables: dict[str, Described] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    pieces: list[Piece] = field(default_factory=list)

    def add(
        self,
        name: str,
        kind: Any,
        dimensions: tuple[str, ...],
        about: About | Quantity | registry.Definition,
        values: Any = None,
        chunks: tuple[int, ...] | None = None,
        compression: str = "zlib",
        **more: Any,
    ) -> None:
        """Add a variable; without ``values`` the parts hold them."""
        words = {
            "units": about.unit,
            "long_name": about.meaning,
            "symbol": about.symbol,
        }
        attributes = words | more
        attributes = {
            key: value
            for key, value in attributes.items()
            if not isinstance(value, str) or value
        }
        self.variables[name] = Described(
            kind, dimensions, attributes, values, chunks, compression
        )


def outline(plan: Plan, parts: Blocks) -> Outline:
    """Return the dataset of a plan without the numbers of its parts, which say how many slip events there are."""
    sweep = {
        variable_name(axis.keys[0]): len(axis.values) for axis in plan.scenario.sweep
    }
    content, shape = Outline(sweep, {**sweep}, attributes(plan)), tuple(sweep.values())
    for place, axis in enumerate(plan.scenario.sweep):
        _add_sweep_coordinates(content, plan, axis, math.prod(shape[place + 1 :]))
    if plan.per_member and any(map(plan.varies, plan.variables)):
        content.sizes["member"] = plan.members
        about, numbers = (
            About("1", "number of the ensemble member"),
            np.arange(plan.members),
        )
        content.add(
            "member", "i4", ("member",), about, numbers, standard_name="realization"
        )
    clock = plan.points[0].clock
    content.sizes["t"] = clock.records
    about = About("s", "time since the start", "t")
    content.add("t", "f8", ("t",), about, clock.times)
    _add_numbers(content, plan)
    slips = [variable.name for variable in plan.largest if variable.axis == "slip"]
    content.sizes |= {"slip": 1} if slips else {}
    if plan.phases > 1:
        _add_phases(content, plan)
    for variable in plan.variables + plan.largest:
        content.places[variable.name] = _add_recorded(content, plan, variable)
        if plan.keeps_late(variable):
            _add_late(content, variable)
    if plan.scenario.record.maps:
        _add_maps(content, plan)
    groups = plan.groups
    members = [slice(group.start, group.stop) for group in groups]
    for pack in plan.packs:
        where: tuple[int | slice, ...] = ()
        if sweep:
            *outer, along = map(int, np.unravel_index(pack.start, shape))
            where = (*outer, slice(along, along + len(pack)))
        for index, block in enumerate(plan.blocks(plan.points[pack.start])):
            names = [
                part_name(pack.start, group, index) for group in range(len(groups))
            ]
            content.pieces.append(
                Piece(
                    where,
                    slice(block.records.start, block.records.stop),
                    members,
                    names,
                )
            )
            if slips and block.end == clock.steps:
                content.sizes["slip"] = max(
                    content.sizes["slip"],
                    *(parts.load(n)[slips[0]].shape[-1] for n in names),
                )
    if slips:
        numbers = np.arange(1, content.sizes["slip"] + 1)
        about = About("1", "number of the slip event of a member")
        content.add("slip", "i4", ("slip",), about, numbers)
    return content


#: Most letters of a swept course in the long name of its key.
_WORDS = 90


def variable_name(key: str) -> str:
    """Return the variable of a key of the scenario, swept or not, so that runs can be joined along any key."""
    return key.replace(".", "_")


def _add_sweep_coordinates(
    content: Outline, plan: Plan, axis: Axis, stride: int
) -> None:
    """Add the swept values, points a stride apart, as coordinates: numbers in SI, anything else as a label."""
    along = (variable_name(axis.keys[0]),)
    points = [quantities(plan.points[i * stride]) for i in range(len(axis.values))]
    for position, key in enumerate(axis.keys):
        if all(key in numbers for numbers in points):
            values = [numbers[key][1] for numbers in points]
            content.add(variable_name(key), "f8", along, points[0][key][0], values)
        else:
            labels = [_label(key, row[position]) for row in axis.values]
            names = [
                label if labels.count(label) == 1 else f"{label} {i}"
                for i, label in enumerate(labels, 1)
            ]
            courses = [
                (name, row[position])
                for name, row in zip(names, axis.values, strict=True)
            ]
            meanings = [
                f"{name}: {_course(value)}"
                for name, value in courses
                if _is_course(value)
            ]
            words = ", ".join(filter(None, [f"swept {key}", "; ".join(meanings)]))
            listed = np.array(names, object)
            content.add(variable_name(key), str, along, About("", words), listed)
            contacts = [
                plan.points[i * stride].contact for i in range(len(axis.values))
            ]
            if all(key == f"contact.{contact.kind}" for contact in contacts):
                rates = [
                    _last_rate(contact.course, plan.points[0].clock.duration)
                    for contact in contacts
                ]
                unit = "N/s" if contacts[0].kind == "load" else "m/s"
                about = About(unit, f"rate of the last change of {key}")
                content.add(f"{variable_name(key)}_rate", "f8", along, about, rates)


def _last_rate(course: Any, duration: float) -> float:
    """Return the rate of the last ramp of a course [per s]; 0 if there is none, or if its rate is not constant."""
    pieces = course.pieces(np.array([0.0, duration]), duration)
    span, change = pieces.stop - pieces.start, pieces.last - pieces.first
    rates = np.trim_zeros(change[span > 0.0] / span[span > 0.0], "b")
    turns = np.flatnonzero(np.sign(rates) != np.sign(rates[-1:]))
    ramp = slice(turns[-1] + 1 if turns.size else 0, rates.size)
    straight = (
        np.allclose(rates[ramp], rates[-1:], 1e-9, 0.0)
        and getattr(course, "scale", "linear") == "linear"
    )
    return float(rates[-1]) if rates.size and straight else 0.0


def _is_course(value: Any) -> bool:
    """True for a course or a table, which is no model and too long for a label."""
    return isinstance(value, list) or (isinstance(value, dict) and "model" not in value)


def _label(key: str, value: Any) -> str:
    """Return a short name of a swept value that is no number: its model, or the last word of the key."""
    if _is_course(value):
        return key.rpartition(".")[2]
    return str(value["model"] if isinstance(value, dict) else value)


def _course(value: Any) -> str:
    """Return a course or a table in words, shortened."""
    parts = value.items() if isinstance(value, dict) else [("", value)]
    words = " ".join(
        f"{key} {', '.join(map(str, p)) if isinstance(p, list) else p}"
        for key, p in parts
    ).strip()
    return words if len(words) <= _WORDS else f"{words[: _WORDS - 1]}…"


def scenario_json(scenario: Scenario, per_member: bool | None = None) -> str:
    """Return the resolved scenario as canonical JSON: SI numbers throughout, and the sweep as in the scenario.

    ``per_member`` is True if every member is recorded, for a scenario that leaves this to the size of the run.
    """
    optional = "instrument", "zero", "incipient", "accuracy"
    of_fits = {name for name in optional if not getattr(scenario, name)}
    dumped = TypeAdapter(Scenario).dump_python(
        scenario, by_alias=True, exclude={"source", "sweep"} | of_fits, mode="json"
    )
    if per_member is not None:
        dumped["record"]["per_member"] = per_member
    sweep = {"sweep": written(scenario.sweep)} if scenario.sweep else {}
    return json.dumps(dumped | sweep, sort_keys=True, default=str)


def scenario_of(attributes: Mapping[str, Any]) -> Scenario:
    """Return the scenario of a dataset from its attributes.

    Raises
    ------
    BadInput
        If the attributes do not hold it: of a measured map they have the digest alone.
    """
    files = tables(attributes.get("scenario_files"))
    texts = {
        name: str(entry.get("text"))
        for name, entry in files.items()
        if isinstance(entry, dict)
    }
    with in_plain_words(Scenario):
        document, context = (
            tables(attributes.get("scenario_resolved")),
            {"files": Files(Path(), texts)},
        )
        return TypeAdapter(Scenario).validate_python(
            document, context=context, by_alias=True, by_name=False
        )


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def attributes(plan: Plan) -> dict[str, Any]:
    """Return the global attributes: the scenario and the versions that ran it."""
    scene, source = plan.scenario, plan.scenario.origin
    resolved, sim_version = (
        scenario_json(scene, plan.per_member),
        _version("sliding-sim"),
    )
    versions = {name: _version(name) for name in ("numpy", "scipy", "numba")}
    packages = ", ".join(f"{name} {version}" for name, version in versions.items())
    files = {
        name: {"sha256": _digest(text), "text": text}
        for name, text in source.files.items()
    }
    return {
        "Conventions": "CF-1.11",
        "title": scene.name,
        "source": f"sliding-sim {sim_version}, simulation of an adhesive sliding interface",
        "history": f"sim run; scenario {_digest(resolved)[:16]}; {packages}",
        "references": "N. Menga, G. Carbone, D. Dini, arXiv:1710.06506; J. Mech. Phys. Solids 112 (2018) 145 and"
        " 133 (2019) 103744 (corrigendum)",
        "scenario_toml": source.text,
        "scenario_overrides": json.dumps(source.overrides, sort_keys=True, default=str),
        "scenario_resolved": resolved,
        "scenario_files": json.dumps(files, sort_keys=True),
        "seed": str(scene.seed),
        "members": np.int32(plan.members),
        "sim_version": sim_version,
        **{f"{name}_version": version for name, version in versions.items()},
        **plan.about,
    }


def identity(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return what decides the numbers of a dataset, from its attributes: the scenario, its files, and the versions."""
    if not (scenario := tables(attributes.get("scenario_resolved"))):
        return {}
    files = tables(attributes.get("scenario_files"))
    digests = {
        name: entry.get("sha256")
        for name, entry in files.items()
        if isinstance(entry, dict)
    }
    versions = {
        key.removesuffix("_version"): attributes[key]
        for key in attributes
        if key.endswith("_version")
    }
    return {"scenario": scenario, "files": digests, "version": versions}


def _add_numbers(content: Outline, plan: Plan) -> None:
    """Add the numbers that all points have in common as 0-d variables, and derived numbers at each point."""
    points = [quantities(point) for point in plan.points]
    swept = {key for axis in plan.scenario.sweep for key in axis.keys}
    for key, (quantity, value) in points[0].items():
        if key not in swept and all(
            key in numbers and numbers[key][1] == value for numbers in points
        ):
            content.add(variable_name(key), "f8", (), quantity, value)
    described_as: dict[str, Quantity | registry.Definition] = {
        row.name: row for row in (*registry.NUMBERS, *registry.ERRORS)
    }
    derived: dict[str, list[float]] = {}
    errors = []
    for point in plan.points:
        errors.append((point, systematic_errors(point)))
        numbers = {
            number.name: number.read(point)
            for number in NUMBERS
            if number.applies(point)
        }
        for key, (quantity, value) in point.derived.items():
            described_as[variable_name(key)] = quantity
            numbers[variable_name(key)] = value
        numbers |= steady_speeds(point)
        for name, value in (numbers | errors[-1][1]).items():
            derived.setdefault(name, []).append(float(value))
        point.release()
    for name, values in derived.items():
        if name in described_as and len(values) == len(plan.points):
            array = np.reshape(values, tuple(content.sweep.values()))
            content.add(name, "f8", tuple(content.sweep), described_as[name], array)
    if (most := worst(errors)) and "cell_error_area" in content.variables:
        content.variables["cell_error_area"].attributes["cure"] = cure(*most)


def _add_recorded(content: Outline, plan: Plan, recorded: Variable) -> Place:
    """Add the variables of a quantity that is recorded at each record, or once a run."""
    record, sweep, name, whole = (
        plan.scenario.record,
        tuple(content.sweep),
        recorded.name,
        recorded in plan.largest,
    )
    varies = plan.varies(recorded)
    each, pooled = varies and plan.per_member, varies and not plan.per_member
    dimensions = (*sweep, *(["member"] if each else []), *([] if whole else ["t"]))
    dimensions += (recorded.axis,) if recorded.axis else ()
    if pooled:
        dimensions = ("statistic", *dimensions)
        _add_statistics(content)
    block = {"member": plan.group, "t": max(1, plan.records_of_block(plan.points[0]))}
    block |= dict.fromkeys(sweep[-1:], len(plan.packs[0]))
    chunks = (
        None if whole else tuple(block.get(dimension, 1) for dimension in dimensions)
    )
    prescribed = any(variable.name == SPEED for variable in plan.variables) and not any(
        point.drive.solves_motion for point in plan.points
    )
    kind = "f4" if record.precision == "float32" and not (pooled or whole) else "f8"
    compression: str = "zlib" if whole else record.compression
    more: dict[str, Any] = (
        {"coordinates": SPEED} if prescribed and not whole and name != SPEED else {}
    )
    if name == "in_contact" and not pooled:
        kind, compression = "i1", compression.replace("digits", "zlib")
        more = {
            "units": "",
            "flag_values": np.array([0, 1], "i1"),
            "flag_meanings": _FLAGS,
        }
    described = recorded.definition
    content.add(name, kind, dimensions, described, None, chunks, compression, **more)
    if pooled and whole:
        about = About("1", f"number of members with a {described.meaning}")
        content.add(f"{name}_count", "f8", dimensions[1:], about)
    return Place(pooled, each, not whole, recorded.axis)


def _add_statistics(content: Outline) -> None:
    """Add the statistics over the members that stand in place of these."""
    names = registry.STATISTICS
    content.sizes["statistic"] = len(names)
    values = np.array(names, object)
    content.add("statistic", str, ("statistic",), About("", "statistic"), values)


def _add_late(content: Outline, recorded: Variable) -> None:
    """Add statistics of the members' means over the second half of the run."""
    content.sizes["late"] = len(LATE)
    text = "statistic of the members' means over the second half of the run, and of their drift"
    content.add("late", str, ("late",), About("", text), np.array(LATE, object))
    about = About(
        recorded.definition.unit,
        f"over the second half of the run: {recorded.definition.meaning}",
        recorded.definition.symbol,
    )
    content.add(f"late_{recorded.name}", "f8", (*content.sweep, "late"), about)


def _add_phases(content: Outline, plan: Plan) -> None:
    """Add the phases of each point: start, end and name."""
    content.sizes["phase"] = plan.phases
    about, numbers = About("1", "number of the phase"), np.arange(1, plan.phases + 1)
    content.add("phase", "i4", ("phase",), about, numbers)
    shape, dims = (*content.sweep.values(), plan.phases), (*content.sweep, "phase")
    starts, ends = np.full((2, len(plan.points), plan.phases), np.nan)
    names = np.full(starts.shape, "", object)
    for k, point in enumerate(plan.points):
        count = len(point.phases.starts)
        starts[k, :count], names[k, :count] = point.phases.starts, point.phases.names
        ends[k, :count] = [*point.phases.starts[1:], point.clock.duration]
    about = About("s", "time at which a phase begins")
    content.add("phase_start", "f8", dims, about, starts.reshape(shape))
    about = About("s", "time at which a phase ends")
    content.add("phase_end", "f8", dims, about, ends.reshape(shape))
    about = About("", "course of drive and contact in a phase")
    content.add("phase_name", str, dims, about, names.reshape(shape))


def _add_maps(content: Outline, plan: Plan) -> None:
    """Add the variables of the stress maps."""
    scene = plan.points[0]
    lattice = cast(Lattice, scene.map_lattice)
    count = min(scene.record.map_members, plan.members)
    sizes = dict(zip("xy", lattice.shape, strict=True))
    content.sizes |= {"map_member": count, "map_time": len(scene.record.maps)} | sizes
    about, members = About("1", "member of a map"), np.arange(count)
    content.add("map_member", "i4", ("map_member",), about, members)
    about, times = About("s", "time of a map", "t"), sorted(scene.record.maps)
    content.add("map_time", "f8", ("map_time",), about, times)
    for axis, text, side in zip("xy", ("along", "across"), lattice.sides, strict=True):
        positions = np.arange(sizes[axis]) * (side / sizes[axis])
        about = About("m", f"position {text} the sliding direction", axis)
        content.add(axis, "f8", (axis,), about, positions)
    names = (*content.sweep, "map_member", "map_time", "x", "y")
    shape = (1,) * (len(names) - 2) + lattice.shape
    content.add(registry.MAP.name, "f8", names, registry.MAP, None, shape)
    content.places[registry.MAP.name] = Place()


def in_memory(
    outline: Outline, parts: Blocks
) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, Any]]]:
    """Return dimensions, values and attributes of each variable, by name."""
    content = {}
    for name, (kind, dimensions, attributes, values, *_) in outline.variables.items():
        array = np.empty(
            [outline.sizes[size] for size in dimensions],
            object if kind is str else kind,
        )
        if values is not None:
            array[...] = values
        content[name] = dimensions, array, attributes
    _fill(outline, parts, {name: array for name, (_, array, _) in content.items()})
    return content


def write(outline: Outline, parts: Blocks, path: Path) -> None:
    """Write the netCDF file. A large one is written part by part, in a process of its own that may crash.

    HDF5 gives no reason if the disk fails.
    """
    sizes = [
        math.prod(outline.sizes[size] for size in each.dimensions)
        for each in outline.variables.values()
    ]
    try:
        if 8 * sum(sizes) > IN_MEMORY:
            with pool(1) as executor:
                executor.submit(_write, outline, parts, path).result()
        else:
            write_in_memory(path, lambda file: _put(outline, parts, file))
    except RuntimeError:
        with path.open("ab") as file:  # which raises the reason that HDF5 does not give
            file.write(bytes(2**20))
        raise


def _write(outline: Outline, parts: Blocks, path: Path) -> None:
    """Write a netCDF file part by part."""
    with HDF5, File(path, "w", format="NETCDF4") as file:
        _put(outline, parts, file)
        # which raises an error if the disk fails, while closing the file would crash
        file.sync()


def _put(outline: Outline, parts: Blocks, file: File) -> None:
    """Put dimensions, attributes and variables into a netCDF file."""
    for name, size in outline.sizes.items():
        file.createDimension(name, size)
    file.setncatts(outline.attributes)
    _fill(
        outline,
        parts,
        {name: _variable(file, name, each) for name, each in outline.variables.items()},
    )


def _variable(
    file: netCDF4.Dataset, name: str, described: Described
) -> netCDF4.Variable:
    kind, dimensions, attributes, values, chunks, compression = described
    packed = (
        {"fletcher32": True, **_PACKED[compression]}
        if dimensions and kind is not str
        else {}
    )
    variable = file.createVariable(
        name, kind, dimensions, chunksizes=chunks, fill_value=False, **packed
    )
    if chunks:
        variable.set_var_chunk_cache(CHUNK_CACHE)
    variable.setncatts(attributes)
    if values is not None:
        variable[...] = values
    return variable


def _fill(outline: Outline, parts: Blocks, variables: Mapping[str, Any]) -> None:
    """Put the numbers of the parts into variables, or into arrays."""
    sums: dict[tuple[str, int], np.ndarray] = {}
    for piece in outline.pieces:
        pools: dict[str, list[np.ndarray]] = {}
        # the axis of members: without a sweep there is none of its points
        rank = 1 if piece.where else 0
        for rows, part in zip(piece.members, piece.names, strict=True):
            for key, stored in parts.load(part).items():
                name, _, snapshot = key.partition("@")
                place, values = outline.places.get(name), stored if rank else stored[0]
                if name.startswith("late "):
                    sums[name, rows.start] = sums.get(
                        (name, rows.start), 0.0
                    ) + np.moveaxis(values, rank, 0)
                if place is None:
                    continue
                if place.axis:
                    values = padded(values, outline.sizes[place.axis])
                if snapshot:
                    drawn = slice(rows.start, rows.start + values.shape[rank])
                    variables[name][(*piece.where, drawn, int(snapshot))] = values
                elif not place.pooled:
                    variables[name][place.axes(piece, rows)] = (
                        values if place.each else values.take(0, rank)
                    )
                else:
                    pools.setdefault(name, []).append(np.moveaxis(values, rank, 0))
        for name, groups in pools.items():
            place = outline.places[name]
            *statistics, count = pooled(groups)
            variables[name][place.axes(piece)] = np.stack(statistics)
            if f"{name}_count" in variables:
                variables[f"{name}_count"][place.axes(piece)[1:]] = count
        if piece.times.stop == outline.sizes["t"]:
            _fill_late(piece, sums, variables)
            sums = {}


def _fill_late(
    piece: Piece,
    sums: Mapping[tuple[str, int], np.ndarray],
    variables: Mapping[str, Any],
) -> None:
    """Put the statistics of the members' means over the second half into variables.

    ``sums`` are sums and counts of each member over both halves of it, by variable and group of members.
    """
    pools: dict[str, list[np.ndarray]] = {}
    for (name, _), groups in sums.items():
        with np.errstate(invalid="ignore", divide="ignore"):  # nan without a value
            first, last = (
                groups[..., half, 0] / groups[..., half, 1] for half in (0, 1)
            )
            whole = groups[..., 0].sum(axis=-1) / groups[..., 1].sum(axis=-1)
        pools.setdefault(name, []).append(
            moments(np.stack([whole, last - first], axis=-1).reshape(len(whole), -1))
        )
    for name, each in pools.items():
        mean, _, error, _ = pooled(each)
        name = name.replace(" ", "_")
        values = np.stack([mean, error], axis=-1)
        shape = variables[name][piece.where].shape
        variables[name][piece.where] = values.reshape(shape)


def padded(values: np.ndarray, length: int) -> np.ndarray:
    """Return values with a last axis of a length, nan beyond their own."""
    return np.pad(
        values,
        [(0, 0)] * (values.ndim - 1) + [(0, length - values.shape[-1])],
        constant_values=np.nan,
    )


def moments(values: np.ndarray) -> np.ndarray:
    """Return count, mean and sum of squared deviations over the first axis, shape (3, records) or (3,).

    They are those of the members that have a value: a member that has not detached yet has an infinite time of it.
    """
    rows = np.ascontiguousarray(values.T)
    known = np.isfinite(rows)
    count = known.sum(axis=-1)
    with np.errstate(invalid="ignore"):
        mean = rows.sum(axis=-1, where=known) / count
    squares = np.ascontiguousarray(((values - mean) ** 2).T).sum(axis=-1, where=known)
    return np.stack([count, mean, squares])


def pooled(groups: list[np.ndarray]) -> tuple[np.ndarray, ...]:
    """Return mean, standard deviation, standard error and count of the ``moments`` of groups, pooled in their order."""
    count, mean, squares = groups[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        for other, other_mean, other_squares in groups[1:]:
            total, step = count + other, np.where(other > 0.0, other_mean - mean, 0.0)
            mean = np.where(count > 0.0, mean + step * other / total, other_mean)
            squares = np.where(
                count > 0.0,
                squares + other_squares + step**2 * count * other / total,
                other_squares,
            )
            count = total
        deviation = np.sqrt(squares / (count - 1.0))
        return mean, deviation, deviation / np.sqrt(count), count


def attributes_of(path: Path) -> dict[str, Any]:
    """Return the global attributes of a netCDF file; none if it is no such file or is not read."""
    try:
        with HDF5, opened(path) as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    except (OSError, RuntimeError, Refused):
        return {}
