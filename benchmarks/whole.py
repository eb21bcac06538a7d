"""Rows of whole commands, as processes of their own: their start, a first run, the gallery, a large run, statistics."""

import tempfile
from pathlib import Path

import numpy as np

import sim
from benchmarks.scenes import BANDED, RATE, lens, tiled
from benchmarks.timing import Bench, Beside, Row, absolute, middle, self_timed
from sim.scenario.files import toml

#: Modules that a command cannot do without.
CHECKED = "tomllib, click, numpy, numba, pydantic, scipy.special, pint"
STARTER = str(Path(sim.__file__).parent / "starter.toml")
GALLERY = Path(__file__).parent.parent / "scenarios"


def commands(bench: Bench) -> list[Row]:
    """The starter scene by three commands, kernels being in the cache, beside the import of the modules of each."""
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
                lambda words=words, output=output: bench.command(
                    words[0], STARTER, *words[1:], *output
                )[0],
                Beside(
                    f"import {modules}",
                    lambda m=modules: bench.python(f"import {m}"),
                    goal=goal,
                    bound=True,
                ),
                turns=9,
                clock=self_timed,
            )
    return rows


def first(bench: Bench) -> list[Row]:
    """The starter scene where nothing is compiled yet."""
    times = []
    for _ in range(bench.of(3, 1)):
        with tempfile.TemporaryDirectory() as folder:
            output = f"{folder}/x.nc"
            times.append(
                bench.command("run", STARTER, "-o", output, SIM_CACHE_DIR=folder)[0]
            )
    return [
        absolute(
            "`sim run` of the starter scene, the first ever: compiles", times, "s", 6.0
        )
    ]


def gallery(bench: Bench) -> list[Row]:
    """All scenes of the gallery."""
    scenes, times = sorted(GALLERY.glob("*.toml"))[bench.of(0, -1) :], {}
    with tempfile.TemporaryDirectory() as folder:
        for path in scenes:
            arguments = "run", str(path), "-o", f"{folder}/x.nc", "--force", "-j", "1"
            turns = [bench.command(*arguments) for _ in range(bench.of(3, 1))]
            times[path.stem] = [cpu for cpu, _ in turns]
    slowest = max(times, key=lambda name: np.median(times[name]))
    others = ", ".join(
        f"{name} {np.median(seconds):.1f}"
        for name, seconds in times.items()
        if name != slowest
    )
    beside = f"this is {slowest}; the others [s]: {others}"
    return [
        absolute(
            "`sim run` of the gallery's slowest scene", times[slowest], "s", 3.5, beside
        )
    ]


def statistics(bench: Bench) -> list[Row]:
    """Statistics of many members (4 GB) and of few long ones, beside the time of loading the dataset by xarray.

    The first is not compressed, because its repeated records would be so too well; the second is as a run writes it.
    """
    rows = []
    for name, size, goal in (
        ("4 GB, 1024 members × 43,056 records", (1024, 468, 92), 3.0),
        ("4 members × 2,000,000 records", (4, 2_000_000, 1), 2.5),
    ):
        members, records, times = bench.of(size, (2, 20, min(size[2], 2)))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "long.nc"
            slow = {"model": "steady", "speed": "10 um/s"}
            scene = lens(members, records - 1, drive=slow, bonds=RATE, shear=BANDED)
            sim.run(scene, path) if times == 1 else tiled(sim.run(scene), path, times)
            load = f"import xarray; xarray.open_dataset({str(path)!r}).load()"
            turns = [
                (*bench.command("stats", str(path)), bench.python(load))
                for _ in range(bench.of(3, 1))
            ]
        ours, megabytes, plain = np.transpose(turns)
        medians = [float(np.median(ours)), float(np.median(plain))]
        name = f"`sim stats` of {name}"
        rows += [
            Row(
                f"{name}: time",
                "xarray loads all of it once",
                "as long",
                goal,
                middle(ours / plain),
                medians,
            ),
            absolute(f"{name}: peak memory", list(megabytes), "MB", 1500.0),
        ]
    return rows


def sweeps(bench: Bench) -> list[Row]:
    """Commands on large sweeps, whose time and memory grow with the points, and the help that lists the figures."""
    points, many, few = bench.of((1000, 10_000, 10), (4, 6, 2))
    with tempfile.TemporaryDirectory() as folder:

        def run(count: int, *options: str) -> tuple[float, float]:
            scene = lens(1, 20, drive={"model": "steady", "speed": 1e-3}, bonds=RATE)
            scene["sweep"] = {"drive.speed": np.geomspace(1e-5, 0.1, count).tolist()}
            path = Path(folder) / f"{count}.toml"
            path.write_text(
                "\n".join(f"{key} = {toml(value)}" for key, value in scene.items()),
                encoding="utf-8",
            )
            return bench.command(
                "run", str(path), "-o", f"{path}.nc", "--force", "-j", "1", *options
            )

        def of(command: str, count: int) -> float:
            further = {"report": ["--force"], "stats": []}.get(
                command, ["--csv", f"{folder}/out.csv", "--force"]
            )
            return bench.command(
                command.split()[0], f"{folder}/{count}.toml.nc", *further
            )[0]

        turns = range(bench.of(3, 1))
        pairs = [(run(many), run(many, "--no-table")) for _ in turns]
        growing = np.transpose(
            [
                (bare, *(run(count, "--no-table")[0] for count in (points, few)))
                for _, (bare, _) in pairs
            ]
        )
        run(points), run(few)
        each_point = [
            1e3 * abs(of("stats", many) - of("stats", few)) / (many - few)
            for _ in turns
        ]
        pages = np.transpose(
            [[of("report", count) for count in (points, few)] for _ in turns]
        )
        tables = [of("stats --csv", points) for _ in turns]
    helps = [bench.command("plot", "--help")[0] for _ in turns]
    growths, growth = (
        abs(growing[0] - growing[2]) / abs(growing[1] - growing[2]),
        "`sim run --no-table`: growth",
    )
    (tabled, megabytes), (bare, _) = np.transpose(pairs, (1, 2, 0))
    medians, name = (
        [float(np.median(tabled)), float(np.median(bare))],
        "`sim run` of a sweep of 10,000 points",
    )
    return [
        Row(
            f"{name}: time",
            "without its table",
            "as long",
            1.5,
            middle(tabled / bare),
            medians,
        ),
        absolute(f"{name}: peak memory", list(megabytes), "MB", 300.0),
        absolute(
            "`sim stats` of 10,000 points, a point",
            each_point,
            "ms",
            0.3,
            "`sim stats` of 10 points subtracted",
        ),
        absolute("`sim stats --csv` of 1,000 points", tables, "s", 2.0),
        absolute("`sim report` of 1,000 points", pages[0].tolist(), "s", 10.0),
        absolute(
            f"{growth} from 1,000 to 10,000 points",
            growths.tolist(),
            "times",
            11.0,
            "`sim run` of 10 points subtracted",
        ),
        absolute(
            "`sim report`: growth from 10 to 1,000 points",
            (pages[0] / pages[1]).tolist(),
            "times",
            100.0,
        ),
        absolute("`sim plot --help`", helps, "s", 0.1),
    ]
