"""From recorded numbers to a netCDF file: immutable part files while running, one CF dataset at the end.

A part holds a fixed group of members over a fixed stretch of records. Its shape is a function of
the scenario alone, and the dataset is made from the parts in a fixed order, so equal runs give
equal bytes. netCDF is written only once all parts are there: a file that HDF5 is still writing is
lost when the run is killed, a renamed part is not.
"""

import hashlib
import importlib.metadata
import io
import json
from pathlib import Path
from typing import Any, NamedTuple, cast

import netCDF4
import numpy as np
from pydantic import TypeAdapter

from sim.ensemble.plan import Plan, part_name
from sim.ensemble.recorded import DISC_ENERGIES, KNOWN_ERRORS, MAP, NUMBERS, Variable
from sim.numerics.files import explained, write_whole
from sim.parts.shear.modal import ModalProcess
from sim.scenario.declared import quantities
from sim.scenario.scenario import Scenario
from sim.scenario.sweep import Axis, written

#: What HDF5 keeps of a variable in memory [byte]; its own 64 MiB hold every variable of a usual run whole.
_CHUNK_CACHE = 4 * 2**20
#: How netCDF packs a variable, by ``record.compression``; six digits are within 5e-7 (20 bits and the leading one).
_ZLIB: dict[str, Any] = {"zlib": True, "complevel": 1, "shuffle": True}
_PACKED: dict[str, dict[str, Any]] = {
    "none": {},
    "zlib": _ZLIB,
    "digits": _ZLIB | {"significant_digits": 6, "quantize_mode": "BitGroom"},
}
_FLAGS = "detached in_contact"
_STATISTICS = {
    "mean": "ensemble mean of",
    "std": "standard deviation over the ensemble of",
    "sem": "standard error of the ensemble mean of",
}


class MemoryParts(dict):
    """Parts kept in memory."""

    def save(self, name: str, arrays: dict[str, np.ndarray]) -> None:
        self[name] = arrays

    def load(self, name: str, beginning: str) -> dict[str, np.ndarray]:
        return {key: array for key, array in self[name].items() if key.startswith(beginning)}


class PartFiles(NamedTuple):
    """Parts kept as files of a folder: built in memory, written, synced, then renamed into place."""

    folder: Path

    def save(self, name: str, arrays: dict[str, np.ndarray]) -> None:
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        with explained(self.folder):
            write_whole(self.folder / f"{name}.npz", buffer.getbuffer())

    def load(self, name: str, beginning: str) -> dict[str, np.ndarray]:
        """The arrays whose names begin so, without reading the others."""
        with explained(self.folder), np.load(self.folder / f"{name}.npz", allow_pickle=False) as arrays:
            return {key: arrays[key] for key in arrays.files if key.startswith(beginning)}


#: Where parts are kept until the dataset is made.
Parts = MemoryParts | PartFiles


class MemoryFile:
    """A dataset in memory, filled by the calls that fill a netCDF file; no HDF5 behind it.

    ``variables`` are dimensions, values and attributes by name.
    """

    def __init__(self) -> None:
        self.sizes: dict[str, int] = {}
        self.variables: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, Any]]] = {}
        self.attributes: dict[str, Any] = {}

    def createDimension(self, name: str, size: int) -> None:
        self.sizes[name] = size

    def add(self, name: str, kind: Any, dimensions: tuple[str, ...], attributes: dict[str, Any]) -> np.ndarray:
        """Values of a new variable, to be filled."""
        values = np.empty([self.sizes[size] for size in dimensions], object if kind is str else kind)
        self.variables[name] = dimensions, values, attributes
        return values

    def setncatts(self, attributes: dict[str, Any]) -> None:
        self.attributes.update(attributes)


File = netCDF4.Dataset | MemoryFile


def write_dataset(file: File, plan: Plan, parts: Parts) -> None:
    """Fill an open netCDF file from all parts of a plan."""
    _dimensions(file, plan)
    _attributes(file, plan)
    _scenario_variables(file, plan)
    _derived_variables(file, plan)
    for variable in plan.variables + plan.largest:
        _recorded(file, plan, parts, variable)
    if plan.scenario.record.maps:
        _maps(file, plan, parts)


def _sweep_names(plan: Plan) -> tuple[str, ...]:
    return tuple(variable_name(axis.keys[0]) for axis in plan.scenario.sweep)


def variable_name(key: str) -> str:
    """Name in the dataset of a key of the scenario, swept or not, so that runs can be joined along any of them."""
    return key.replace(".", "_")


def _sweep_shape(plan: Plan) -> tuple[int, ...]:
    return tuple(len(axis.values) for axis in plan.scenario.sweep)


def _variable(
    file: File, name: str, kind: Any, dimensions: tuple[str, ...], unit: str, long_name: str,
    symbol: str = "", chunks: tuple[int, ...] | None = None, compression: str = "zlib", **more: Any,
) -> Any:  # fmt: skip
    attributes = {"units": unit, "long_name": long_name, "symbol": symbol} | more
    attributes = {key: value for key, value in attributes.items() if not isinstance(value, str) or value}
    if isinstance(file, MemoryFile):
        return file.add(name, kind, dimensions, attributes)
    packed = _PACKED[compression] if dimensions and kind is not str else {}
    variable = file.createVariable(name, kind, dimensions, chunksizes=chunks, fill_value=False, **packed)
    if chunks:
        variable.set_var_chunk_cache(_CHUNK_CACHE)
    variable.setncatts(attributes)
    return variable


def _dimensions(file: File, plan: Plan) -> None:
    scene = plan.points[0]
    for axis in plan.scenario.sweep:
        file.createDimension(variable_name(axis.keys[0]), len(axis.values))
        _sweep_coordinates(file, plan, axis)
    if plan.scenario.record.per_member and any(plan.varies(variable) for variable in plan.variables):
        file.createDimension("member", plan.members)
        described = "1", "number of the ensemble member"
        member = _variable(file, "member", "i4", ("member",), *described, standard_name="realization")
        member[:] = np.arange(plan.members)
    file.createDimension("t", scene.clock.records)
    _variable(file, "t", "f8", ("t",), "s", "time since the start", "t")[:] = scene.clock.times


def _sweep_coordinates(file: File, plan: Plan, axis: Axis) -> None:
    """The swept values as coordinates: numbers in SI, anything else as a label."""
    stride = int(np.prod([len(a.values) for a in plan.scenario.sweep[plan.scenario.sweep.index(axis) + 1 :]]))
    for position, key in enumerate(axis.keys):
        name, along = variable_name(key), (variable_name(axis.keys[0]),)
        tables = [quantities(plan.points[i * stride]) for i in range(len(axis.values))]
        if all(key in table for table in tables):
            quantity = tables[0][key][0]
            variable = _variable(file, name, "f8", along, quantity.unit, quantity.meaning, quantity.symbol)
            variable[:] = [table[key][1] for table in tables]
        else:
            variable = _variable(file, name, str, along, "", f"swept {key}")
            labels = [_label(row[position]) for row in axis.values]
            for i, label in enumerate(labels):
                variable[i] = label if labels.count(label) == 1 else f"{label} {i + 1}"


def _label(value: Any) -> str:
    if isinstance(value, dict):
        return str(value.get("model") or json.dumps(value, sort_keys=True))
    return str(value)


def scenario_json(scenario: Scenario) -> str:
    """The resolved scenario as canonical JSON: SI numbers throughout, and the sweep as it was given."""
    dumped = TypeAdapter(Scenario).dump_python(scenario, by_alias=True, exclude={"source", "sweep"}, mode="json")
    sweep = {"sweep": written(scenario.sweep)} if scenario.sweep else {}
    return json.dumps(dumped | sweep, sort_keys=True, default=str)


def _attributes(file: File, plan: Plan) -> None:
    scene, source = plan.scenario, plan.scenario.origin
    resolved = scenario_json(scene)
    digest = hashlib.sha256(resolved.encode()).hexdigest()[:16]
    versions = {name: importlib.metadata.version(name) for name in ("numpy", "scipy", "numba")}
    sim_version = importlib.metadata.version("sliding-sim")
    files = {n: {"sha256": hashlib.sha256(t.encode()).hexdigest(), "text": t} for n, t in source.files.items()}
    attributes = {
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
    file.setncatts(attributes | {f"{name}_version": version for name, version in versions.items()})


def _scenario_variables(file: File, plan: Plan) -> None:
    """Every number of the scenario that is the same at all points, as a 0-d variable."""
    tables = [quantities(point) for point in plan.points]
    swept = {key for axis in plan.scenario.sweep for key in axis.keys}
    for key, (quantity, value) in tables[0].items():
        if key not in swept and all(key in table and table[key][1] == value for table in tables):
            _variable(file, variable_name(key), "f8", (), quantity.unit, quantity.meaning, quantity.symbol)[...] = value


def _derived_variables(file: File, plan: Plan) -> None:
    """What readers of the file need beside the trajectories, at each point of the sweep."""
    described = {number.name: (number.unit, number.long_name, number.symbol) for number in NUMBERS}
    described |= {name: ("1", text, "") for name, text in KNOWN_ERRORS.items()}
    found: dict[str, list[float]] = {}
    for point in plan.points:
        own = {number.name: number.read(point) for number in NUMBERS if number.there(point)}
        for name, value in (own | point.process.known_errors()).items():
            found.setdefault(name, []).append(float(value))
        point.release()
    for name, values in found.items():
        if len(values) < len(plan.points):
            continue
        variable = _variable(file, name, "f8", _sweep_names(plan), *described[name])
        variable[...] = np.reshape(values, _sweep_shape(plan))
        if "error" in name:
            file.setncatts({name: max(values, key=abs)})


def _recorded(file: File, plan: Plan, parts: Parts, recorded: Variable) -> None:
    """A quantity at each record, or of each whole run."""
    shape, varies, whole = _sweep_shape(plan), plan.varies(recorded), recorded in plan.largest
    each = varies and plan.scenario.record.per_member
    dimensions = (*_sweep_names(plan), *(("member",) if each else ()), *(() if whole else ("t",)))
    chunks = (*np.ones(len(shape), int).tolist(), *((plan.group,) if each else ()), plan.stretch)
    variables = {}
    for statistic, of in (_STATISTICS if varies and not each else {"": ""}).items():
        kind = "f4" if plan.scenario.record.precision == "float32" and not (statistic or whole) else "f8"
        flags: dict[str, Any] = {} if whole else {"compression": plan.scenario.record.compression}
        if recorded.name == "in_contact" and not statistic:
            kind, flags = "i1", {"compression": flags["compression"].replace("digits", "zlib")}
            flags |= {"units": "", "flag_values": np.array([0, 1], "i1"), "flag_meanings": _FLAGS}
        named = "_".join(filter(None, (recorded.name, statistic)))
        described = recorded.unit, f"{of} {recorded.long_name}".strip(), recorded.symbol
        variables[statistic] = _variable(file, named, kind, dimensions, *described, None if whole else chunks, **flags)
    for number, point in enumerate(plan.points):
        where, stretches = np.unravel_index(number, shape), list(enumerate(plan.stretches(point)))
        for index, records in stretches[-1:] if whole else stretches:
            times = () if whole else (slice(records.start, records.stop),)
            names = [part_name(number, group, index) for group in range(len(plan.groups()) if varies else 1)]
            found = (parts.load(name, recorded.name)[recorded.name] for name in names)
            if each:
                for members, values in zip(plan.groups(), found, strict=True):
                    variables[""][(*where, slice(members[0], members[-1] + 1), *times)] = values
            else:
                for statistic, values in (pooled(list(found)) if varies else {"": next(found)[0]}).items():
                    variables[statistic][(*where, *times)] = values


def moments(values: np.ndarray) -> np.ndarray:
    """Count, mean and sum of squared deviations over the first axis, shape (3, records) or (3,)."""
    mean = np.ascontiguousarray(values.T).mean(axis=-1)
    squares = np.ascontiguousarray(((values - mean) ** 2).T).sum(axis=-1)
    return np.stack([np.full_like(mean, len(values)), mean, squares])


def pooled(groups: list[np.ndarray]) -> dict[str, np.ndarray]:
    """Mean, standard deviation and standard error from the ``moments`` of groups, pooled in their order."""
    count, mean, squares = groups[0]
    for other, other_mean, other_squares in groups[1:]:
        total, step = count + other, other_mean - mean
        mean = mean + step * other / total
        squares = squares + other_squares + step**2 * count * other / total
        count = total
    with np.errstate(invalid="ignore", divide="ignore"):
        deviation = np.sqrt(squares / (count - 1.0))
    return {"mean": mean, "std": deviation, "sem": deviation / np.sqrt(count)}


def _maps(file: File, plan: Plan, parts: Parts) -> None:
    scene = plan.points[0]
    process = cast(ModalProcess, scene.process)
    points, cell = process.modes.points, process.modes.cell
    count = min(scene.record.map_members, plan.members)
    file.createDimension("map_member", count)
    file.createDimension("map_time", len(scene.record.maps))
    _variable(file, "map_member", "i4", ("map_member",), "1", "member of a map")[:] = np.arange(count)
    times = sorted(scene.record.maps)
    _variable(file, "map_time", "f8", ("map_time",), "s", "time of a map", "t")[:] = times
    for axis, text in (("x", "along"), ("y", "across")):
        file.createDimension(axis, points)
        variable = _variable(file, axis, "f8", (axis,), "m", f"position {text} the sliding direction", axis)
        variable[:] = np.arange(points) * (cell / points)
    names = (*_sweep_names(plan), "map_member", "map_time", "x", "y")
    chunks = (1,) * (len(names) - 2) + (points, points)
    variables = {MAP[0]: _variable(file, MAP[0], "f8", names, *MAP[1:], chunks)}
    if all(point.margin is not None for point in plan.points):
        variables |= {one[0]: _variable(file, one[0], "f8", names[:-2], *one[1:]) for one in DISC_ENERGIES}
    for number, point in enumerate(plan.points):
        where = np.unravel_index(number, _sweep_shape(plan))
        for index in range(len(plan.stretches(point))):
            for group, members in enumerate(plan.groups()):
                for key, values in parts.load(part_name(number, group, index), "map.").items():
                    _, name, snapshot = key.split(".")
                    if name in variables:
                        rows = slice(members[0], members[0] + len(values))
                        variables[name][(*where, rows, int(snapshot))] = values
