"""Runs that are not done, by the folder of their parts: their dataset so far, what they lack, shards put together."""

from collections.abc import Iterator
from dataclasses import dataclass, replace as changed
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from sim.ensemble.checksums import MANIFEST
from sim.ensemble.netcdf import Outline, Piece, Place, fill
from sim.ensemble.outline import attributes, identity, outline
from sim.ensemble.part_files import (
    WHOLE,
    Arrays,
    Manifest,
    OutputExists,
    PartFiles,
    Shard,
    Stopped,
    folders,
    gathered,
    manifest_of,
    refuse_other,
)  # fmt: skip
from sim.ensemble.plan import Plan, work
from sim.ensemble.simulate import run
from sim.numerics.disk_cache import digest
from sim.numerics.hdf5 import located
from sim.scenario.scenario import Scenario
from sim.scenario.source import Files, Source
from sim.units.errors import BadInput


@dataclass(frozen=True)
class _Written:
    """Source of a scenario as a manifest holds it."""

    path: str
    text: str
    overrides: dict[str, Any]
    files: dict[str, str]
    sweep: list[str]


_SCENARIO = TypeAdapter(Scenario)
_SOURCE = TypeAdapter(_Written)
#: Shards that a message names.
_MOST_NAMED = 20


def merge(target: Path, replace: bool = False) -> Path:
    """Make the file of a run of which all shards are done; it is that of an undivided run.

    Raises
    ------
    OutputExists
        If the file is there and is not to be replaced.
    OutputBusy
        If a shard is being run.
    BadInput
        If there are no shards, or they are of different runs, or of other versions.
    Stopped
        If shards are not done: with what each lacks.
    """
    target = target.resolve() if target.is_symlink() else target
    with gathered(target) as (whole, shards):
        manifests = {folder: manifest_of(folder) for folder in folders(target)}
        first = next(iter(manifests.values()))
        scenario = scenario_of(next(iter(manifests)), first)
        plan = Plan.of(scenario)
        now = first | {"run": identity(attributes(plan)), "code": digest().hex()}
        for folder, manifest in manifests.items():
            refuse_other(folder, manifest, now, "move it away, and run that shard again as the others")
        if lacking := _lacking(plan, whole, shards):
            cure = "run it with --resume, then merge again"
            more = ["..."] if lacking[_MOST_NAMED:] else []
            raise Stopped("\n".join([*lacking[:_MOST_NAMED], *more, cure]))
        replace = replace or any(manifest.get("replace") for manifest in manifests.values())
        if target.exists() and not replace:
            raise OutputExists(f"{target} exists; replace it with --force")
        whole.adopt(shards.values(), replace and target.exists())
    return run(scenario, target, replace=replace, resume=True)


def dataset(target: Path) -> Any:
    """The dataset of a run that is not done, lazily, nan where parts are missing, with the attribute ``share_done``."""
    import xarray  # heavy
    from xarray.core.indexing import LazilyIndexedArray

    if not (kept := folders(target)):
        beside = target.with_name(f"{target.name}.parts")
        damaged = f", as {beside} is empty or its manifest damaged: run the scenario again" if beside.exists() else ""
        raise BadInput([f"{target}: there is no such file, nor an unfinished run of it{damaged}"])
    parts = _Found({path.stem: PartFiles(folder) for folder in kept for path in folder.glob("*.part")})
    plan = Plan.of(scenario_of(kept[0], manifest_of(kept[0])))
    made = outline(plan)
    quantities = {name: key for key, place in made.places.items() for name in place.names.values()}
    variables = {}
    for name, one in made.variables.items():
        values = one.values
        if name in quantities:
            values = LazilyIndexedArray(_lazy(made, parts, quantities[name], name))
        variables[name] = one.dimensions, values, one.attributes
    done = sum(task.done(parts) for task in plan.tasks())
    return located(xarray.Dataset(variables, attrs=made.attributes | {"share_done": done / work(plan)}))


class _Found(dict[str, PartFiles]):
    """Parts that are there, each with where it is kept."""

    def load(self, name: str) -> Arrays:
        return self[name].load(name)


class _Window:
    """What is wanted of a variable, nan until something is put there."""

    def __init__(self, shape: tuple[int, ...], key: tuple[int | slice, ...]) -> None:
        self.shape = shape
        self.wanted = [np.atleast_1d(np.arange(size)[at]) for size, at in zip(shape, key, strict=True)]
        self.values = np.full([len(wanted) for wanted in self.wanted], np.nan)

    def _places(self, axes: tuple[int | slice, ...]) -> Iterator[tuple[np.ndarray, np.ndarray, int]]:
        """Along each axis, which wanted places are in a part of the variable, where in that, and how long it is."""
        axes = (*axes, *(slice(None) for _ in self.shape[len(axes) :]))
        for size, wanted, at in zip(self.shape, self.wanted, axes, strict=True):
            span = range(size)[at] if isinstance(at, slice) else range(at, at + 1)
            inside = np.flatnonzero((wanted >= span.start) & (wanted < span.stop))
            yield inside, wanted[inside] - span.start, len(span)

    def touches(self, axes: tuple[int | slice, ...]) -> bool:
        """Whether something of a part of the variable is wanted."""
        return all(len(inside) for inside, _, _ in self._places(axes))

    def __setitem__(self, axes: tuple[int | slice, ...], values: np.ndarray) -> None:
        inside, taken, lengths = zip(*self._places(axes), strict=True)
        self.values[np.ix_(*inside)] = values.reshape(lengths)[np.ix_(*taken)]


def _lazy(made: Outline, parts: _Found, quantity: str, name: str) -> Any:
    """A variable whose numbers are read from the parts when they are called for."""
    from xarray.backends import BackendArray
    from xarray.core.indexing import IndexingSupport, explicit_indexing_adapter

    one, place = made.variables[name], made.places[quantity]

    class Lazy(BackendArray):
        """What xarray reads lazily; flags are numbers here, as nan is none."""

        dtype = np.dtype("f8" if one.kind == "i1" else one.kind)
        shape = tuple(made.sizes[size] for size in one.dimensions)

        def __getitem__(self, key: Any) -> Any:
            return explicit_indexing_adapter(key, self.shape, IndexingSupport.BASIC, self.read)

        def read(self, key: tuple[int | slice, ...]) -> np.ndarray:
            windows = {each: _Window(self.shape, key) for each in place.names.values()}
            found = windows[name]
            fill(Outline(places={quantity: place}, pieces=list(_pieces(made, parts, place, found))), parts, windows)
            return found.values.astype(self.dtype)[tuple(slice(None) if isinstance(at, slice) else 0 for at in key)]

    return Lazy()


def _pieces(made: Outline, parts: _Found, place: Place, wanted: _Window) -> Iterator[Piece]:
    """Those pieces of which something is there and wanted; of pooled members none that lacks a part."""
    drawn = any("map_time" in made.variables[name].dimensions for name in place.names.values())
    for piece in made.pieces:
        kept = [(rows, name) for rows, name in zip(piece.members, piece.names, strict=True) if name in parts]
        if "" not in place.names and len(kept) < len(piece.names):
            continue
        if place.timed or piece.times.stop == made.sizes["t"]:
            kept = [one for one in kept if drawn or wanted.touches(place.axes(piece, one[0]))]
            yield piece._replace(members=[rows for rows, _ in kept], names=[name for _, name in kept])


def scenario_of(folder: Path, manifest: Manifest) -> Scenario:
    """The scenario of a run by its manifest, which names no file that is opened but tables of a sweep.

    Raises
    ------
    BadInput
        If the manifest is damaged.
    """
    try:
        scenario = _SCENARIO.validate_python(manifest["run"]["scenario"], context={"files": _NoFiles(Path())})
        source = _SOURCE.validate_python(manifest["source"])
        # which the resolved scenario, sorted by its keys, does not hold
        axes = sorted(scenario.sweep, key=lambda axis: source.sweep.index(axis.keys[0]))
        origin = Source(source.path, source.text, source.overrides, source.files)
        return changed(scenario, sweep=tuple(axes), source=origin)
    except (KeyError, ValueError):
        cure = "move the folder away and run the scenario again"
        raise BadInput([f"{folder / MANIFEST} is damaged: what it holds is no scenario; {cure}"]) from None


class _NoFiles(Files):
    """Files that are not opened: a manifest holds what stood in them."""

    def path(self, name: str) -> Path:
        raise ValueError("a manifest names no file")


def _lacking(plan: Plan, whole: PartFiles, shards: dict[Shard, PartFiles]) -> list[str]:
    """For each shard that is not done how many of its parts are lost, damaged or not computed yet."""
    of = next(iter(shards), WHOLE)[1]
    said = []
    for number in range(1, of + 1):
        names = [name for task in plan.share(number, of) for name in task.names]
        kept = [whole, *(parts for parts in [shards.get((number, of))] if parts)]
        lost = sum(not any(parts.sound(name) for parts in kept) for name in names)
        if lost:
            said.append(f"shard {number}/{of} lacks {lost:,} of {len(names):,} parts")
    return said
