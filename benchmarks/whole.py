"""Rows of whole commands, as processes of their own: their start, a first run, the gallery, a large run; and files."""

import itertools
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import netCDF4
import numpy as np

import sim
from benchmarks.compare import BANDED, LOAD, RAMP, RATE, STEADY
from benchmarks.scenes import field, loaded, scene, tiled
from benchmarks.timing import Bench, Beside, Row, absolute, middle, spent, told
from sim.ensemble import preview, simulate
from sim.ensemble.plan import Plan
from sim.ensemble.store import BlockFiles, MemoryBlocks

#: What a command cannot do without now, and what else none could in 0.1.0, when the goals were set.
CHECKED, OLDER = "tomllib, click, numpy, numba, pydantic", ", scipy.special, pint"
STARTER = str(Path(sim.__file__).parent / "starter.toml")
DRAWN = '[record]\nmaps = ["5 ms", "10 ms", "15 ms", "20 ms"]\nmap_members = 2\n'
SWEPT = '[sweep]\n"contact.load" = { from = "1 mN", to = "40 mN", count = 2000, scale = "linear" }\n'
GALLERY = Path(__file__).parent.parent / "scenarios"


def commands(bench: Bench) -> list[Row]:
    """The starter scene by three commands, kernels being in the cache, beside the import of what each must have."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for words, modules, goal in (
            (("run", "--force"), f"{CHECKED}, netCDF4, xarray", 1.6),
            (("run", "--force", "--no-table"), f"{CHECKED}, netCDF4", 1.5),
            (("check",), CHECKED, 1.5),
        ):
            output = ("-o", f"{folder}/x.nc") if words[0] == "run" else ()
            rows += bench.compare(
                f"`sim {' '.join(words)}` of the starter scene",
                lambda words=words, output=output: bench.command(words[0], STARTER, *words[1:], *output)[0],
                Beside(
                    f"import {modules}{OLDER}",
                    lambda modules=modules: bench.imports(modules + OLDER),
                    goal=goal,
                    bound=True,
                ),
                Beside(f"import {modules}", lambda modules=modules: bench.imports(modules), bound=True),
                turns=9,
                clock=told,
            )
    return rows


def first(bench: Bench) -> list[Row]:
    """The starter scene where nothing is compiled yet."""
    times = []
    for _ in range(bench.of(3, 1)):
        with tempfile.TemporaryDirectory() as folder:
            output = f"{folder}/x.nc"
            times.append(bench.command("run", STARTER, "-o", output, SIM_CACHE_DIR=folder)[0])
    return [absolute("`sim run` of the starter scene, the first ever: compiles", times, "s", 6.0)]


def gallery(bench: Bench) -> list[Row]:
    """All scenes of the gallery."""
    scenes, times = sorted(GALLERY.glob("*.toml"))[bench.of(0, -1) :], {}
    with tempfile.TemporaryDirectory() as folder:
        for one in scenes:
            turns = [
                bench.command("run", str(one), "-o", f"{folder}/x.nc", "--force", "-j", "1")
                for _ in range(bench.of(3, 1))
            ]
            times[one.stem] = [seconds for seconds, _ in turns]
    slowest = max(times, key=lambda name: np.median(times[name]))
    others = ", ".join(f"{name} {np.median(one):.1f}" for name, one in times.items() if name != slowest)
    beside = f"this is {slowest}; the others [s]: {others}"
    return [absolute("`sim run` of the gallery's slowest scene", times[slowest], "s", 5.0, beside)]


def large(bench: Bench) -> list[Row]:
    """10⁷ member-steps of a banded 512² cell, with its start, into a file."""
    members, steps = bench.of((1000, 10_000), (2, 20))
    with tempfile.TemporaryDirectory() as folder:
        path, banded = Path(folder) / "large.toml", field("banded", bench.of(512, 64), "tolerance = 0.01")
        path.write_text(scene(members, steps, 10, RAMP, RATE, banded, LOAD))
        arguments = "run", str(path), "-o", f"{folder}/x.nc", "--force", "-j", "1"
        seconds, megabytes = zip(*(bench.command(*arguments) for _ in range(bench.of(3, 1))), strict=True)
    name = "`sim run`, banded at 1 %, 512²: 10⁷ member-steps, 1001 records"
    return [
        absolute(f"{name}: time", list(seconds), "s", 10.0),
        absolute(f"{name}: peak memory", list(megabytes), "MB", 500.0),
    ]


def statistics(bench: Bench) -> list[Row]:
    """The statistics of a dataset of 4 GB beside the time of reading it."""
    members, records, times = bench.of((1024, 468, 92), (2, 20, 2))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.nc"
        short = sim.run(loaded(scene(members, records - 1, 1, STEADY, RATE, BANDED, LOAD)), to=path.with_stem("short"))
        tiled(short, path, times)
        turns = [(*bench.command("stats", str(path)), spent(lambda: _read(path))) for _ in range(bench.of(3, 1))]
    ours, megabytes, plain = np.transpose(turns)
    medians = [float(np.median(ours)), float(np.median(plain))]
    name = "`sim stats` of 4 GB, 1024 members × 43,056 records"
    return [
        Row(f"{name}: time", "netCDF4 reads all of it once", "as long", 2.0, middle(ours / plain), medians),
        absolute(f"{name}: peak memory", list(megabytes), "MB", 1000.0),
    ]


def _read(path: Path) -> None:
    """Read all numbers of a dataset, some of its chunks at a time."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        for one in file.variables.values():
            lengths = one.chunking() if one.chunking() != "contiguous" else one.shape
            if lengths:
                lengths = [*lengths[:-1], lengths[-1] * max(1, 2**22 // int(np.prod(lengths)))]
            starts = (range(0, size, length) for size, length in zip(one.shape, lengths, strict=True))
            for at in itertools.product(*starts):
                one[tuple(slice(start, start + length) for start, length in zip(at, lengths, strict=True))]


def workers(bench: Bench) -> list[Row]:
    """Two processes that share a run, beside two runs of half of it side by side, by the clock."""
    half, steps = bench.of((4096, 40_000), (2, 20))
    together, apart = [], []
    with tempfile.TemporaryDirectory() as folder:
        for members in (half, 2 * half):
            (Path(folder) / f"{members}.toml").write_text(scene(members, steps, steps // 20, RAMP, RATE, BANDED, LOAD))
        arguments = sys.executable, "-m", "sim", "run", "--force", "--quiet"
        whole = [[*arguments, f"{folder}/{2 * half}.toml", "-o", f"{folder}/x.nc", "-j", "2"]]
        halves = [[*arguments, f"{folder}/{half}.toml", "-o", f"{folder}/{i}.nc", "-j", "1"] for i in range(2)]
        for _ in range(bench.of(3, 1)):
            for commands, times in ((whole, together), (halves, apart)):
                began = time.monotonic()
                for one in [subprocess.Popen(command) for command in commands]:
                    one.wait()
                times.append(time.monotonic() - began)
    medians = [float(np.median(times)) for times in (together, apart)]
    ratios = middle(np.array(together) / apart)
    ours = "`sim run -j 2` of 8,192 banded members, 40,000 steps, by the clock"
    return [Row(ours, "two runs with `-j 1` of 4,096 members each, at once", "as long", 1.11, ratios, medians)]


def parts(bench: Bench) -> list[Row]:
    """What it costs to keep on the disk what is computed, block by block."""
    rows = []
    for every in (20, 1):
        plan = Plan.of(loaded(scene(*bench.of((256, 20_000), (2, 20)), every, RAMP, RATE, BANDED, LOAD)))

        def kept(plan: Plan = plan) -> None:
            with tempfile.TemporaryDirectory() as folder:
                simulate.simulate(plan, BlockFiles(Path(folder)))

        often = "every step" if every == 1 else f"each {every}th step"
        beside = Beside(
            "the same without the disk",
            lambda plan=plan: simulate.simulate(plan, MemoryBlocks()),
            goal=1.02 if every > 1 else None,
            bound=True,
        )
        rows += bench.compare(f"blocks of 256 banded members kept as parts, {often} recorded", kept, beside, turns=7)
    return rows


def memory(bench: Bench) -> list[Row]:
    """The fixed cost of a run in memory: one step of the simplest scene."""
    one = loaded(scene(1, 1, 1, LOAD))
    sim.run(one)
    times = [1e3 * spent(lambda: sim.run(one)) for _ in range(bench.of(31, 1))]
    return [absolute("`sim.run` in memory: one step of the simplest scene", times, "ms", 25.0)]


def files(bench: Bench) -> list[Row]:
    """Size of the dataset of a gallery scene, by its compression."""
    sizes = {}
    with tempfile.TemporaryDirectory() as folder:
        for packed in ("none", "zlib", "digits"):
            changes = {"record.compression": packed, **bench.of({}, {"ensemble.members": 2})}
            file = Path(folder) / f"{packed}.nc"
            sim.run(sim.load(GALLERY / "pdms_lens.toml", changes), to=file)
            sizes[packed] = file.stat().st_size / 1e6
    beside = f"uncompressed {sizes['none']:.3g} MB, to six digits {sizes['digits']:.3g} MB"
    return [absolute("file of pdms_lens, compressed as by default", [sizes["zlib"]], "MB", None, beside)]


def estimates(bench: Bench) -> list[Row]:
    """What is known of runs before they start, beside what they then take: the gallery, and large runs of each kind."""
    large = {
        "modal, 512²": scene(8, 500, 10, RAMP, RATE, field("modal", 512), LOAD),
        "maps of 1024²": scene(2, 20, 1, RAMP, RATE, field("mapped", 1024), LOAD, DRAWN),
        "2000 points": scene(4, 10, 1, RAMP, RATE, BANDED, LOAD, SWEPT),
        "10⁶ records": scene(1, 1_000_000, 1, RAMP, RATE, BANDED, LOAD),
        "256 members × 1001 records": scene(256, 10_000, 10, RAMP, RATE, BANDED, LOAD),
        "2560 members × 1001 records": scene(2560, 10_000, 10, RAMP, RATE, BANDED, LOAD),
    }
    ratios: dict[str, dict[str, float]] = {"CPU time": {}, "memory of the largest process": {}, "size of the file": {}}
    if not bench.quick:
        bench.command("warm")
    with tempfile.TemporaryDirectory() as folder:
        for name, text in bench.of(large, {}).items():
            (Path(folder) / f"{name}.toml").write_text(text, encoding="utf-8")
        for path in [*sorted(GALLERY.glob("*.toml")), *Path(folder).glob("*.toml")][bench.of(0, -1) :]:
            output = Path(folder) / "x.nc"
            arguments = "run", str(path), "-o", str(output), "--force", "-j", "1"
            plan = Plan.of(sim.load(path))
            known = preview.forecast(plan, 1, preview.tried(plan) or 1.0)
            seconds, megabytes = bench.command(*arguments)
            found = seconds / known.cpu, 2**20 * megabytes / known.memory, output.stat().st_size / known.file
            for kind, ratio in zip(ratios.values(), found, strict=True):
                kind[path.stem] = ratio
    return [_beside_estimate(kind, each) for kind, each in ratios.items()]


def _beside_estimate(kind: str, each: dict[str, float]) -> Row:
    """Factors by which runs differ from what was known of them, up or down, with the largest three."""
    off = {name: max(ratio, 1.0 / ratio) for name, ratio in each.items()}
    worst = sorted(off, key=lambda name: -off[name])[:3]
    beside = f"{len(off)} scenes; farthest off: {', '.join(f'{name} {each[name]:.2f}' for name in worst)}"
    name = f"`sim run` beside what `sim check` says: {kind}"
    return Row(name, beside, "times off", 1.5, middle(list(off.values())), [])
