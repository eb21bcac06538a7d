"""What a dataset holds: dimensions, coordinates, attributes and the variables of a plan, with units and names."""

import functools
import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
from pydantic import TypeAdapter

from sim.ensemble.netcdf import Described, Outline, Piece, Place
from sim.ensemble.plan import Plan, part_name
from sim.ensemble.recorded import DISC_ENERGIES, KNOWN_ERRORS, MAP, NUMBERS, Variable
from sim.numerics import hdf5
from sim.numerics.grid import Lattice
from sim.scenario.scenario import Scenario
from sim.scenario.schema import quantities
from sim.scenario.sweep import Axis, written

_FLAGS = "detached in_contact"
#: Version of a package, which is looked up in its files.
_version = functools.cache(importlib.metadata.version)
#: The auxiliary coordinate of all that is recorded over time, where it is prescribed.
SPEED = "speed"
_STATISTICS = {
    "mean": "ensemble mean of",
    "std": "standard deviation over the ensemble of",
    "sem": "standard error of the ensemble mean of",
}


def outline(plan: Plan) -> Outline:
    """The dataset of a plan without the numbers of its parts."""
    made = Outline(attributes=attributes(plan))
    _dimensions(made, plan)
    _scenario_variables(made, plan)
    _derived_variables(made, plan)
    for one in plan.variables + plan.largest:
        made.places[one.name] = _recorded(made, plan, one)
    if plan.scenario.record.maps:
        _maps(made, plan)
    groups = plan.groups()
    members = [slice(int(group[0]), int(group[-1]) + 1) for group in groups]
    for pack in plan.packs:
        where: tuple[int | slice, ...] = ()
        if plan.scenario.sweep:
            *outer, along = map(int, np.unravel_index(pack.start, _sweep_shape(plan)))
            where = (*outer, slice(along, along + len(pack)))
        for index, block in enumerate(plan.blocks(plan.points[pack.start])):
            times = slice(block.records.start, block.records.stop)
            names = [part_name(pack.start, group, index) for group in range(len(groups))]
            made.pieces.append(Piece(where, times, members, names))
    return made


def _sweep_names(plan: Plan) -> tuple[str, ...]:
    return tuple(variable_name(axis.keys[0]) for axis in plan.scenario.sweep)


def variable_name(key: str) -> str:
    """Name in the dataset of a key of the scenario, swept or not, so that runs can be joined along any of them."""
    return key.replace(".", "_")


def _sweep_shape(plan: Plan) -> tuple[int, ...]:
    return tuple(len(axis.values) for axis in plan.scenario.sweep)


def _add(
    made: Outline, name: str, kind: Any, dimensions: tuple[str, ...], unit: str, long_name: str, symbol: str = "",
    values: Any = None, chunks: tuple[int, ...] | None = None, compression: str = "zlib", **more: Any,
) -> None:  # fmt: skip
    """Add a variable; without ``values`` the parts hold them."""
    said = {"units": unit, "long_name": long_name, "symbol": symbol} | more
    said = {key: value for key, value in said.items() if not isinstance(value, str) or value}
    made.variables[name] = Described(kind, dimensions, said, values, chunks, compression)


def _dimensions(made: Outline, plan: Plan) -> None:
    scene = plan.points[0]
    for axis in plan.scenario.sweep:
        made.sizes[variable_name(axis.keys[0])] = len(axis.values)
        _sweep_coordinates(made, plan, axis)
    if plan.per_member and any(plan.varies(variable) for variable in plan.variables):
        made.sizes["member"] = plan.members
        described = "1", "number of the ensemble member", "", np.arange(plan.members)
        _add(made, "member", "i4", ("member",), *described, standard_name="realization")
    made.sizes["t"] = scene.clock.records
    _add(made, "t", "f8", ("t",), "s", "time since the start", "t", scene.clock.times)


def _sweep_coordinates(made: Outline, plan: Plan, axis: Axis) -> None:
    """The swept values as coordinates: numbers in SI, anything else as a label."""
    stride = int(np.prod([len(a.values) for a in plan.scenario.sweep[plan.scenario.sweep.index(axis) + 1 :]]))
    for position, key in enumerate(axis.keys):
        name, along = variable_name(key), (variable_name(axis.keys[0]),)
        tables = [quantities(plan.points[i * stride]) for i in range(len(axis.values))]
        if all(key in table for table in tables):
            quantity = tables[0][key][0]
            values = [table[key][1] for table in tables]
            _add(made, name, "f8", along, quantity.unit, quantity.meaning, quantity.symbol, values)
        else:
            labels = [_label(row[position]) for row in axis.values]
            names = [one if labels.count(one) == 1 else f"{one} {i}" for i, one in enumerate(labels, 1)]
            _add(made, name, str, along, "", f"swept {key}", "", np.array(names, object))


def _label(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("model") or json.dumps(value, sort_keys=True))
    return str(value)


def scenario_json(scenario: Scenario, per_member: bool | None = None) -> str:
    """The resolved scenario as canonical JSON: SI numbers throughout, and the sweep as it was given.

    ``per_member`` says whether every member is kept, where the scenario leaves that to the size of the run.
    """
    dumped = TypeAdapter(Scenario).dump_python(scenario, by_alias=True, exclude={"source", "sweep"}, mode="json")
    if per_member is not None:
        dumped["record"]["per_member"] = per_member
    sweep = {"sweep": written(scenario.sweep)} if scenario.sweep else {}
    return json.dumps(dumped | sweep, sort_keys=True, default=str)


def attributes(plan: Plan) -> dict[str, Any]:
    """Global attributes: what ran, by which versions."""
    scene, source = plan.scenario, plan.scenario.origin
    resolved = scenario_json(scene, plan.per_member)
    digest = hashlib.sha256(resolved.encode()).hexdigest()[:16]
    versions = {name: _version(name) for name in ("numpy", "scipy", "numba")}
    sim_version = _version("sliding-sim")
    files = {n: {"sha256": hashlib.sha256(t.encode()).hexdigest(), "text": t} for n, t in source.files.items()}
    found = {
        "Conventions": "CF-1.11",
        "title": scene.name,
        "source": f"sliding-sim {sim_version}, simulation of an adhesive sliding interface",
        "history": f"sim run; scenario {digest}; {', '.join(f'{n} {version}' for n, version in versions.items())}",
        "references": "N. Menga, G. Carbone, D. Dini, arXiv:1710.06506; J. Mech. Phys. Solids 112 (2018) 145 and"
        " 133 (2019) 103744 (corrigendum)",
        "scenario_toml": source.text,
        "scenario_overrides": json.dumps(source.overrides, sort_keys=True, default=str),
        "scenario_resolved": resolved,
        "scenario_files": json.dumps(files, sort_keys=True),
        "seed": str(scene.seed),
        "members": np.int32(scene.ensemble.members),
        "sim_version": sim_version,
    }
    return found | {f"{name}_version": version for name, version in versions.items()}


def identity(found: Mapping[str, Any]) -> dict[str, Any]:
    """What decides the numbers of a dataset, of its attributes: the scenario, its files, and the versions."""
    if not (scenario := hdf5.tables(found.get("scenario_resolved"))):
        return {}
    files = hdf5.tables(found.get("scenario_files"))
    digests = {name: entry.get("sha256") for name, entry in files.items() if isinstance(entry, dict)}
    versions = {key.removesuffix("_version"): found[key] for key in found if key.endswith("_version")}
    return {"scenario": scenario, "files": digests, "version": versions}


def _scenario_variables(made: Outline, plan: Plan) -> None:
    """Every number of the scenario that is the same at all points, as a 0-d variable."""
    tables = [quantities(point) for point in plan.points]
    swept = {key for axis in plan.scenario.sweep for key in axis.keys}
    for key, (quantity, value) in tables[0].items():
        if key not in swept and all(key in table and table[key][1] == value for table in tables):
            _add(made, variable_name(key), "f8", (), quantity.unit, quantity.meaning, quantity.symbol, value)


def _derived_variables(made: Outline, plan: Plan) -> None:
    """What readers of the file need beside the trajectories, at each point of the sweep."""
    described = {number.name: (number.unit, number.long_name, number.symbol) for number in NUMBERS}
    described |= {name: ("1", text, "") for name, text in KNOWN_ERRORS.items()}
    found: dict[str, list[float]] = {}
    for point in plan.points:
        own = {number.name: number.read(point) for number in NUMBERS if number.applies(point)}
        for name, value in (own | point.process.known_errors()).items():
            found.setdefault(name, []).append(float(value))
        point.release()
    for name, values in found.items():
        if len(values) < len(plan.points):
            continue
        _add(made, name, "f8", _sweep_names(plan), *described[name], np.reshape(values, _sweep_shape(plan)))
        if "error" in name:
            made.attributes[name] = max(values, key=abs)


def _prescribed(plan: Plan) -> bool:
    """Whether the speed is recorded and the same for all members, so that it serves as a coordinate."""
    return any(one.name == SPEED and not plan.varies(one) for one in plan.variables)


def _recorded(made: Outline, plan: Plan, recorded: Variable) -> Place:
    """Make the variables of a quantity at each record, or of each whole run."""
    shape, varies, whole = _sweep_shape(plan), plan.varies(recorded), recorded in plan.largest
    each = varies and plan.per_member
    dimensions = (*_sweep_names(plan), *(("member",) if each else ()), *(() if whole else ("t",)))
    chunks = (
        *((1,) * (len(shape) - 1) + (len(plan.packs[0]),) if shape else ()),
        *((plan.group,) if each else ()),
        max(1, plan.records_of_block(plan.points[0])),
    )
    names = {}
    for statistic, of in (_STATISTICS if varies and not each else {"": ""}).items():
        kind = "f4" if plan.scenario.record.precision == "float32" and not (statistic or whole) else "f8"
        flags: dict[str, Any] = {} if whole else {"compression": plan.scenario.record.compression}
        if not whole and recorded.name != SPEED and _prescribed(plan):
            flags["coordinates"] = SPEED
        if recorded.name == "in_contact" and not statistic:
            kind, flags = "i1", {"compression": flags["compression"].replace("digits", "zlib")}
            flags |= {"units": "", "flag_values": np.array([0, 1], "i1"), "flag_meanings": _FLAGS}
        names[statistic] = "_".join(filter(None, (recorded.name, statistic)))
        described = recorded.unit, f"{of} {recorded.long_name}".strip(), recorded.symbol
        _add(made, names[statistic], kind, dimensions, *described, None, None if whole else chunks, **flags)
    return Place(names, each, not whole)


def moments(values: np.ndarray) -> np.ndarray:
    """Count, mean and sum of squared deviations over the first axis, shape (3, records) or (3,)."""
    mean = np.ascontiguousarray(values.T).mean(axis=-1)
    squares = np.ascontiguousarray(((values - mean) ** 2).T).sum(axis=-1)
    return np.stack([np.full_like(mean, len(values)), mean, squares])


def _maps(made: Outline, plan: Plan) -> None:
    """The variables of the stress maps."""
    scene = plan.points[0]
    lattice = cast(Lattice, scene.map_lattice)
    nx, ny = lattice.shape
    count = min(scene.record.map_members, plan.members)
    made.sizes |= {"map_member": count, "map_time": len(scene.record.maps), "x": nx, "y": ny}
    _add(made, "map_member", "i4", ("map_member",), "1", "member of a map", "", np.arange(count))
    _add(made, "map_time", "f8", ("map_time",), "s", "time of a map", "t", sorted(scene.record.maps))
    for axis, text, points, side in zip("xy", ("along", "across"), lattice.shape, lattice.sides, strict=True):
        places = np.arange(points) * (side / points)
        _add(made, axis, "f8", (axis,), "m", f"position {text} the sliding direction", axis, places)
    names = (*_sweep_names(plan), "map_member", "map_time", "x", "y")
    chunks = (1,) * (len(names) - 2) + (nx, ny)
    _add(made, MAP[0], "f8", names, *MAP[1:], None, chunks)
    made.places[MAP[0]] = Place({"": MAP[0]})
    if all(point.margin is not None for point in plan.points):
        for one in DISC_ENERGIES:
            _add(made, one[0], "f8", names[:-2], *one[1:])
            made.places[one[0]] = Place({"": one[0]})
