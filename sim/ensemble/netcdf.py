"""A netCDF file, or arrays in memory, from an outline of variables and the parts of a run, each read once.

The outline fixes names, shapes, chunks and the order of the blocks. netCDF is written only once all blocks are there: a
file that HDF5 is still writing is lost when the run is killed, a renamed block is not.
"""

import concurrent.futures
import contextlib
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import numpy as np

from sim.ensemble.execute import WorkerDied, pool
from sim.ensemble.store import Blocks
from sim.numerics.files import HDF5
from sim.numerics.hdf5 import CHUNK_CACHE, Refused, opened

#: A dataset of more bytes is not built in memory.
_IN_MEMORY = 256 * 2**20
#: How netCDF packs a variable, by ``record.compression``; six digits are within 5e-7, 20 bits and
#: the leading one, rounded to nearest, so that flags stay flags and what was equal stays so.
_ZLIB: dict[str, Any] = {"zlib": True, "complevel": 1, "shuffle": True}
_PACKED: dict[str, dict[str, Any]] = {
    "none": {},
    "zlib": _ZLIB,
    "digits": _ZLIB | {"significant_digits": 20, "quantize_mode": "BitRound"},
}


class Described(NamedTuple):
    """One variable of a dataset; ``values`` are None where the parts hold them."""

    kind: Any
    dimensions: tuple[str, ...]
    attributes: dict[str, Any]
    values: Any
    chunks: tuple[int, ...] | None
    compression: str


class Place(NamedTuple):
    """Where the numbers of a quantity go: its variables by statistic, "" for itself, and which axes they have."""

    names: dict[str, str]
    each: bool = True
    timed: bool = True

    def axes(self, piece: "Piece", rows: slice = slice(None)) -> tuple[int | slice, ...]:
        """Where the numbers of some members in a piece stand."""
        return (*piece.where, *((rows,) if self.each else ()), *((piece.times,) if self.timed else ()))


class Piece(NamedTuple):
    """Parts of one block at some points of a sweep: of which members, of which records, under which names."""

    where: tuple[int | slice, ...]
    times: slice
    members: list[slice]
    names: list[str]

    def of_sweep(self, values: np.ndarray) -> np.ndarray:
        """Values of a part, without the axis of points where nothing is swept."""
        return values if self.where else values[0]


@dataclass
class Outline:
    """All of a dataset but the numbers of the parts."""

    sizes: dict[str, int] = field(default_factory=dict)
    attributes: dict[str, Any] = field(default_factory=dict)
    variables: dict[str, Described] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    pieces: list[Piece] = field(default_factory=list)


def in_memory(outline: Outline, parts: Blocks) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, Any]]]:
    """Dimensions, values and attributes of each variable, by name."""
    arrays = {}
    for name, one in outline.variables.items():
        shape = [outline.sizes[size] for size in one.dimensions]
        arrays[name] = np.empty(shape, object if one.kind is str else one.kind)
        if one.values is not None:
            arrays[name][...] = one.values
    fill(outline, parts, arrays)
    return {name: (one.dimensions, arrays[name], one.attributes) for name, one in outline.variables.items()}


def write(outline: Outline, parts: Blocks, path: Path) -> None:
    """Write the netCDF file: from memory at once, or if it is large part by part in a process that may crash by itself.

    HDF5 crashes at some limits of the size of files if it writes part by part, and gives no reason for its trouble.
    """
    sizes = [math.prod(outline.sizes[size] for size in one.dimensions) for one in outline.variables.values()]
    try:
        if 8 * sum(sizes) <= _IN_MEMORY:
            _write(outline, parts, path, diskless=True, persist=True)
            return
        executor = pool(1)
        try:
            executor.submit(_write, outline, parts, path).result()
        except concurrent.futures.BrokenExecutor:
            raise WorkerDied(f"the process that writes {path} died: the disk may be full, or memory short") from None
        finally:
            executor.shutdown(kill_workers=True)
    except RuntimeError:
        with path.open("ab") as file:  # which raises what HDF5 does not tell
            file.write(bytes(2**20))
        raise


def _write(outline: Outline, parts: Blocks, path: Path, **how: Any) -> None:
    with HDF5, netCDF4.Dataset(path, "w", format="NETCDF4", **how) as file:
        _put(outline, parts, file)


def _put(outline: Outline, parts: Blocks, file: netCDF4.Dataset) -> None:
    for name, size in outline.sizes.items():
        file.createDimension(name, size)
    file.setncatts(outline.attributes)
    fill(outline, parts, {name: _variable(file, name, one) for name, one in outline.variables.items()})


def _variable(file: netCDF4.Dataset, name: str, one: Described) -> netCDF4.Variable:
    packed = {"fletcher32": True, **_PACKED[one.compression]} if one.dimensions and one.kind is not str else {}
    variable = file.createVariable(name, one.kind, one.dimensions, chunksizes=one.chunks, fill_value=False, **packed)
    if one.chunks:
        variable.set_var_chunk_cache(CHUNK_CACHE)
    variable.setncatts(one.attributes)
    if one.values is not None:
        variable[...] = one.values
    return variable


def fill(outline: Outline, parts: Any, variables: Mapping[str, Any]) -> None:
    """Put what the parts hold into variables, or into arrays."""
    for piece in outline.pieces:
        pools: dict[str, list[np.ndarray]] = {}
        for rows, part in zip(piece.members, piece.names, strict=True):
            for key, values in parts.load(part).items():
                name, _, snapshot = key.partition("@")
                place = outline.places.get(name)
                if place is None:
                    continue
                if snapshot:
                    drawn = slice(rows.start, rows.start + values.shape[1])
                    variables[name][(*piece.where, drawn, int(snapshot))] = piece.of_sweep(values)
                elif "" in place.names:
                    variables[name][place.axes(piece, rows)] = piece.of_sweep(values if place.each else values[:, 0])
                else:
                    pools.setdefault(name, []).append(np.moveaxis(values, 1, 0))
        for name, moments in pools.items():
            place = outline.places[name]
            for statistic, values in pooled(moments).items():
                variables[place.names[statistic]][place.axes(piece)] = piece.of_sweep(values)


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


def attributes_of(path: Path) -> dict[str, Any]:
    """Global attributes of a netCDF file; none of what is no such file, or is not read."""
    # of who reads a dataset lazily in another thread; where xarray is not imported nobody does
    reading = getattr(sys.modules.get("xarray.backends.netCDF4_"), "NETCDF4_PYTHON_LOCK", contextlib.nullcontext())
    try:
        with HDF5, reading, opened(path) as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}
    except (OSError, RuntimeError, Refused):
        return {}
