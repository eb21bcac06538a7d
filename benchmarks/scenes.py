"""Scenes of the benchmarks: the lens of ``compare`` with other numbers, as text and as what is loaded of it."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import netCDF4
import numpy as np

import sim
from benchmarks.compare import FIELD, lens
from sim.engine import MemberNoise, follow
from sim.parts.exchange import Motion, Motions, Times
from sim.scenario.scenario import Scenario


def shortest(points: int) -> float:
    """Shortest wavelength on a grid of the cell of 0.24 mm [m]: 1 µm at 512²."""
    return 512e-6 / points


def field(model: str, points: int = 512, more: str = "") -> str:
    """The table of the fluctuations on a grid; their spectrum ends where the grid does."""
    text = FIELD.format(model=model, more=f"points = {points}\n{more}")
    return text.replace("2.5 um", f"{1e6 * shortest(points):.6f} um")


def scene(members: int, steps: int, every: int, *parts: str) -> str:
    """A scene of so many steps, each or each so-manieth of them recorded."""
    text = lens(steps, members, *parts)
    return text.replace('step = "1 ms"', f'step = "1 ms"\nrecord = "{every} ms"')


def loaded(text: str) -> Scenario:
    """The scene of a text."""
    return sim.load(tomllib.loads(text))


def followed(text: str) -> Callable[[], object]:
    """A program that advances all members of a scene to its end, as a run does."""
    of = loaded(text)
    members, end = np.arange(of.ensemble.members), of.clock.steps
    return lambda: follow(of, MemberNoise.of(of.seed, members), None, range(0, end + 1, end))


def steady(speed: float, step: float, steps: int, drive: Callable) -> tuple[Motion, Motions]:
    """Start and motion of steady sliding, in steps of a length [s]."""
    times = Times(step, steps, step * steps)
    slider, first = drive(speed=speed).begin(times, 1)
    return first, drive(speed=speed).advance(slider, times, range(1, steps + 1))[1]


def tiled(source: Path, target: Path, times: int) -> None:
    """A dataset whose records come again and again, made of the chunks of another one, each of all its records."""
    import h5py  # of the tests: it copies chunks as they are packed

    with netCDF4.Dataset(source) as given, netCDF4.Dataset(target, "w") as made:
        made.setncatts({name: given.getncattr(name) for name in given.ncattrs()})
        for name, size in given.dimensions.items():
            made.createDimension(name, size.size * (times if name == "t" else 1))
        for name, one in given.variables.items():
            chunks = one.chunking()
            packed = {} if chunks == "contiguous" else {"chunksizes": chunks, "zlib": True, "complevel": 1}
            copy = made.createVariable(name, one.dtype, one.dimensions, fill_value=False, **packed)
            copy.setncatts({key: one.getncattr(key) for key in one.ncattrs()})
            if "t" not in one.dimensions:
                copy[...] = one[...]
            elif name == "t":
                copy[:] = np.arange(len(copy)) * float(one[1] - one[0])
    with h5py.File(source) as given, h5py.File(target, "r+") as made:
        for name in given.keys() - {"t"}:
            one = given[name]
            for place in range(one.id.get_num_chunks() if one.shape != made[name].shape else 0):
                *rows, first = one.id.get_chunk_info(place).chunk_offset
                _, packed = one.id.read_direct_chunk((*rows, first))
                for k in range(times):
                    made[name].id.write_direct_chunk((*rows, first + k * one.shape[-1]), packed)
