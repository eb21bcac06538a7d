"""Pieces of a dataset that fit into memory, whatever the size of its file."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

#: Bytes of trajectories that are worked on at once, and that are read at once where a file packs them together.
ROOM, READ = 2**25, 2**27


def blocks(dataset: xr.Dataset, dims: Sequence[str], room: int | None = None) -> Iterator[dict[str, slice]]:
    """Slices of a dataset that take little memory each.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it, opened lazily.
    dims : sequence of str
        Dimensions to slice along, the first one first, the others where that is not enough; along none a piece of what
        a file packs together is cut before all are down to one such piece.
    room : int
        Bytes of one; ``ROOM`` by default.
    """
    timed = [variable for variable in dataset.variables.values() if "t" in variable.dims]
    lengths = {name: dataset.sizes[name] for name in dims if name in dataset.sizes}
    over = 8.0 * sum(variable.size for variable in timed) / (ROOM if room is None else room)
    for least, name in itertools.product(({n: _packed(timed, n) for n in lengths}, dict.fromkeys(lengths, 1)), lengths):
        if over > 1.0:
            size, piece = lengths[name], min(least[name], lengths[name])
            lengths[name] = max(piece, int(size / over) // piece * piece)
            over *= lengths[name] / size
    ranges = [range(0, dataset.sizes[name], length) for name, length in lengths.items()]
    for starts in itertools.product(*ranges):
        ends = (min(at + lengths[n], dataset.sizes[n]) for n, at in zip(lengths, starts, strict=True))
        yield {n: slice(at, end) for n, at, end in zip(lengths, starts, ends, strict=True)}


def keep(dataset: xr.Dataset, *names: str) -> xr.Dataset:
    """The dataset without trajectories of members but those named, for what reads no others."""
    timed = [str(n) for n, variable in dataset.data_vars.items() if {"member", "t"} <= set(variable.dims)]
    return dataset.drop_vars([name for name in timed if name not in names])


def alone(dataset: xr.Dataset, *names: str) -> xr.Dataset:
    """The dataset without trajectories but those named, those that all members have in common left out, too."""
    timed = [str(name) for name, variable in dataset.data_vars.items() if "t" in variable.dims]
    return dataset.drop_vars([name for name in timed if name not in names])


def _packed(variables: list[xr.Variable], name: str) -> int:
    """Length along a dimension of what the file packs together."""
    return max((_chunk(variable, name) for variable in variables if name in variable.dims), default=1)


def _chunk(variable: xr.Variable, name: str) -> int:
    chunks = variable.encoding.get("chunksizes") or ()
    return int(chunks[variable.dims.index(name)]) if len(chunks) == variable.ndim else 1  # of joined runs not all


def in_blocks(dataset: xr.Dataset, dims: Sequence[str], reduce: Callable[[xr.Dataset], xr.Dataset]) -> xr.Dataset:
    """What a function makes of a dataset, made of its ``blocks`` one after the other and put together.

    The function works at each value of these dimensions by itself.
    """
    found: dict[str, xr.DataArray] = {}
    for block, part in ((block, reduce(some)) for block, some in _loaded(dataset, dims)):
        if all(part.sizes.get(name, 1) == dataset.sizes.get(name, 1) for name in block):
            return part
        for key, values in part.items():
            whole = found.get(str(key))
            if whole is None:
                sizes = [dataset.sizes[name] if name in block else values.sizes[name] for name in values.dims]
                kept: dict[Any, Any] = {n: c for n, c in values.coords.items() if not set(c.dims) & set(block)}
                kept |= {n: dataset[n] for n in values.coords if n not in kept and n in dataset.coords}
                whole = xr.DataArray(np.empty(sizes, values.dtype), kept, values.dims, attrs=values.attrs)
                found[str(key)] = whole
            whole[{name: block[name] for name in values.dims if name in block}] = values.to_numpy()
    return xr.Dataset(found)


def at_records(dataset: xr.Dataset, records: np.ndarray) -> xr.Dataset:
    """A dataset at some of its records, in their order, what a file packs together read once for all of them."""
    found = dataset.isel(t=records)
    for name, variable in dataset.variables.items():
        if "t" in variable.dims and name != "t":
            values = np.empty((*variable.shape[:-1], len(records)), variable.dtype)
            pieces = records // _chunk(variable, "t")
            for piece in np.unique(pieces):
                inside = pieces == piece
                wanted = records[inside]
                read = variable[..., slice(wanted[0], wanted[-1] + 1)].to_numpy()
                values[..., inside] = read[..., wanted - wanted[0]]
            found = found.assign({name: found[name].copy(data=values)})
    return found


def _loaded(dataset: xr.Dataset, dims: Sequence[str]) -> Iterator[tuple[dict[str, slice], xr.Dataset]]:
    """Blocks of a dataset, what a file packs together read once."""
    for packed in blocks(dataset, dims, READ):
        read = dataset.isel(packed).load()
        for block in blocks(read, dims):
            places = {n: slice(packed[n].start + at.start, packed[n].start + at.stop) for n, at in block.items()}
            yield places, read.isel(block)
