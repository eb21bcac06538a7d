"""Rows of growth: CPU time of whole runs over members, steps, records, points of a sweep and of a grid."""

import itertools
import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np

import sim
from benchmarks.compare import BANDED, LOAD, RAMP, RATE
from benchmarks.scenes import field, loaded, scene
from benchmarks.timing import Bench, Row, spent
from sim.scenario.scenario import Scenario

SWEEP = '[sweep]\n"contact.load" = {{ from = "1 mN", to = "40 mN", count = {}, scale = "linear" }}\n'
MAPS = '[record]\nmaps = ["1 ms", "2 ms", "3 ms", "4 ms", "5 ms", "6 ms", "7 ms", "8 ms", "9 ms", "10 ms"]\n'
GRID = "points of a grid"
#: A run shorter than this is repeated, and the least time taken [s].
_SHORT = 1.0


def banded(members: int, steps: int, every: int, more: str = "") -> str:
    """A scene of the lens on the grid that its spectrum needs."""
    return scene(members, steps, every, RAMP, RATE, BANDED, LOAD, more)


def on_grid(model: str, points: int, members: int, steps: int, more: str = "") -> str:
    """A scene on a grid."""
    return scene(members, steps, 1 if more else steps, RAMP, RATE, field(model, math.isqrt(points)), LOAD, more)


#: Name, unit of what grows, its values, the scene of each, and the most that the exponent may be.
GROWTHS: tuple[tuple[str, str, tuple[int, ...], Callable[[int], str], float], ...] = (
    ("100 steps, 11 records", "members", (1, 10, 100, 1000, 10_000, 100_000),
     lambda n: banded(n, 100, 10), 1.1),
    ("16 members, 11 records", "steps", (10, 100, 1000, 10_000, 100_000, 1_000_000),
     lambda n: banded(16, n, n // 10), 1.1),
    ("64 members, 10⁴ steps", "records", (1, 10, 100, 1000, 10_000),
     lambda n: banded(64, 10_000, 10_000 // n), 1.1),
    ("4 members, 10 steps", "points of a sweep", (1, 10, 100, 1000, 10_000),
     lambda n: banded(4, 10, 1, SWEEP.format(n) if n > 1 else ""), 1.1),
    ("banded, 64 members, 5000 steps", GRID, (64**2, 128**2, 256**2, 512**2, 1024**2, 2048**2),
     lambda n: on_grid("banded", n, 64, 5000), 0.1),
    ("modal, 200 steps", GRID, (64**2, 128**2, 256**2, 512**2, 1024**2),
     lambda n: on_grid("modal", n, 1, 200), 1.1),
    ("mapped, 10 steps and maps", GRID, (64**2, 128**2, 256**2, 512**2, 1024**2),
     lambda n: on_grid("mapped", n, 1, 10, MAPS), 1.1),
)  # fmt: skip


def growth(bench: Bench) -> list[Row]:
    """How the time of loading and of a run into a file grows: the exponent of the last decade, and the largest."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.nc"
        for name, unit, every, text, most in GROWTHS:
            sizes = bench.of(every, every[:2])
            if not (bench.quick and rows):
                sim.run(loaded(text(every[0])), to=file, replace=True)  # compiles
            # a spectrum of which nothing is known yet, neither in this process nor on the disk
            with mock.patch.dict(os.environ, SIM_CACHE_DIR=folder):
                times = np.array([measured(text(n).replace("hurst = 0.8", "hurst = 0.75"), file, bench) for n in sizes])
            # the modes of a cell are found once, at its start: what is held to the goal there is the run alone
            grown = times[:, 1] if unit == GRID else times.sum(axis=1)
            curves = {"sizes": list(map(float, sizes)), "load": list(times[:, 0]), "run": list(times[:, 1])}
            result = exponents(list(sizes), list(grown))
            beside = "no growth" if most < 1.0 else "linear growth"
            rows.append(Row(f"growth over {unit}: {name}", beside, "exponent", most, result, [], "", curves))
    return rows


def measured(text: str, file: Path, bench: Bench) -> tuple[float, float]:
    """CPU seconds of loading a scene, which keeps what it finds of a spectrum, and the least of running it."""
    scenes: list[Scenario] = []

    def run() -> None:
        sim.run(scenes[0], to=file, replace=True)

    load, time = spent(lambda: scenes.append(loaded(text))), spent(run)
    return load, time if time > _SHORT or bench.quick else min(time, *(spent(run) for _ in range(4)))


def exponents(sizes: list[int], times: list[float]) -> list[float]:
    """Smallest exponent between neighbours, that of the last decade by least squares, and the largest."""
    x, y = np.log(sizes), np.log(times)
    local = [(b - a) / (v - u) for (u, a), (v, b) in itertools.pairwise(zip(x, y, strict=True))]
    last = x > x[-1] - 1.01 * math.log(10.0)
    return [float(min(local)), float(np.polyfit(x[last], y[last], 1)[0]), float(max(local))]
