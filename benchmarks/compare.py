"""Speed of two source trees, taking turns: ``python -m benchmarks.compare OLD NEW [ROW ...]``.

Each tree has a process of its own, and the two do each row in turns; CPU time counts, so that other
work on the machine matters little. After every five turns both processes are started afresh. Of a row's
20 ratios (time of the old)/(time of the new) the median is printed with its 95 % interval, which follows
from the order of the ratios alone. The exit code is 1 if any median is below 0.95 and its whole
interval below 1.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.scenes import (
    BANDED,
    COHORT,
    COUNTED,
    RAMP,
    RATE,
    TRACKED,
    Tables,
    field,
    lens,
    written,
)

ROUNDS, TURNS = 4, 5
#: CPU seconds that one measurement takes at least.
LEAST = 0.1
MOVED = {
    "displacement": {"from": "2 um", "to": "-2 um", "cycles": 1},
    "stiffness": "2 kN/m",
    "after_pull_off": "reattach",
}
LAGGING = MOVED | {"model": "rate_dependent", "front_speed": "10 mm/s"}
SLOW = {"model": "steady", "speed": "10 um/s"}
RESTING = {"model": "bell", "zero_force_rate": "25 1/s", "bell_force": "4 pN"}
CLUTCH = {
    "rupture": RESTING,
    "bond_stiffness": "0.8 uN/m",
    "rebinding_rate": "250 1/s",
    "site_density": "6.5e16 1/m^2",
}
PULLED = {"model": "spring", "stage": "5 mm/s", "stiffness": "300 N/m"}
SLIPPING = BANDED | {"amplitude": {"model": "slip_rate", "floor": 0.05}}
UNFELT = SLIPPING | {"paid_by_adhesion": 0.0}
SPRINGS = {
    "rate": (16, CLUTCH | {"model": "rate"}),
    "cohort": (2, CLUTCH | {"model": "cohort", "tolerance": 1e-3}),
    "tracked": (2, CLUTCH | {"model": "tracked", "sites": 300}),
}

#: Scenes whose steps are made as a run makes them.
STEPS: dict[str, Tables] = {
    "banded step, 64 members": lens(64, 400, drive=RAMP, bonds=RATE, shear=BANDED),
    "modal step, 256² modes": lens(
        1, 20, drive=RAMP, bonds=RATE, shear=field("modal", 256)
    ),
    "cohort step, 64 populations": lens(
        64, 100, drive=SLOW, bonds=COHORT | {"area": "carried"}, shear=BANDED
    ),
    "tracked step, 64 members of 1000": lens(
        64, 100, drive=SLOW, bonds=TRACKED | {"sites": 1000}, shear=BANDED
    ),
    "counted step, 64 members": lens(
        64, 400, drive=RAMP, bonds=COUNTED | {"sites": 10_000}
    ),
    "equilibrium step, 64 members": lens(
        64, 400, drive=RAMP, bonds=RATE, shear=BANDED, contact=MOVED
    ),
    "rate-dependent step, 64 members": lens(
        64, 400, drive=RAMP, bonds=RATE, shear=BANDED, contact=LAGGING
    ),
} | {
    f"spring, {name}{words}": lens(members, 40, drive=PULLED, bonds=bonds, shear=shear)
    for words, shear in (
        ("", SLIPPING),
        (", energy not felt", UNFELT),
        (", constant amplitude", BANDED),
    )
    for name, (members, bonds) in SPRINGS.items()
}
MAPS = {"maps": [f"{n} ms" for n in range(1, 21)]}
MAPPED = lens(1, 20, drive=RAMP, bonds=RATE, shear=field("mapped", 256), record=MAPS)
SMALL = lens(64, 100, drive=RAMP, bonds=RATE, shear=BANDED)
#: Rows beside those of steps: a program of Python in the process of a tree, or words of a command.
PROGRAMS = {
    "mapped field with its map, 256²": "sim.run(scenes['mapped'])",
    "JKR radii, 3 of 100,000": "jkr.radius_at_load(load, work, 2e-3, 6.4e6);"
    "jkr.radius_at_indentation(depth, work, 2e-3, 6.4e6);"
    "jkr.radius_at_displacement(depth, 2e3, work, 2e-3, 6.4e6)",
    "loading a scenario": "sim.load('small.toml')",
    "whole small run": "command('run', 'small.toml', '-o', 'x.nc', '--force', '--quiet')",
    "check of a small run": "command('check', 'small.toml')",
}
ROWS = (*STEPS, *PROGRAMS)
#: Program of a process of a tree: reads scenes, then a row and a number of repeats a line; answers with CPU seconds.
SERVE = """
import json, os, subprocess, sys, time
import numpy as np
import sim
from sim.laws import jkr
scenes, programs = json.loads(sys.stdin.readline())
# an editable installation of another tree offers its modules beside those of this one
if os.path.exists(os.path.join(os.path.dirname(sim.__file__), "engine.py")):  # before version 2
    from sim.engine import MemberNoise, follow
else:
    from sim.step.state import MemberNoise
loaded = {}
random = np.random.default_rng(1)
load, work = random.uniform(0, 4e-3, 10**5), random.uniform(0, 0.04, 10**5)
depth = random.uniform(-4e-7, 2e-6, 10**5)
def spent():
    return time.process_time() + sum(os.times()[2:4])
def command(*words):
    subprocess.run([sys.executable, "-m", "sim", *words], check=True, stdout=subprocess.DEVNULL)
def step(name):
    if name not in loaded:
        loaded[name] = sim.load(scenes[name])
    members, steps = np.arange(loaded[name].ensemble.members), range(loaded[name].clock.steps + 1)
    scene, noise = loaded[name], MemberNoise.of(1, members)
    if hasattr(scene, "stepper"):
        scene.stepper.follow(noise, None, steps)
    else:
        follow(scene, noise, None, steps)
for line in sys.stdin:
    name, repeats = json.loads(line)
    began = spent()
    for _ in range(repeats):
        exec(programs[name]) if name in programs else step(name)
    print((spent() - began) / repeats, flush=True)
"""


class Tree:
    """A process that times rows in one tree."""

    def __init__(self, tree: Path, folder: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": str(tree)}
        self.process = subprocess.Popen(
            [sys.executable, "-c", SERVE],
            env=environment,
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        print(
            json.dumps([STEPS | {"mapped": MAPPED}, PROGRAMS]),
            file=self.process.stdin,
            flush=True,
        )

    def seconds(self, row: str, repeats: int = 1) -> float:
        """CPU time of a row."""
        assert self.process.stdin and self.process.stdout
        print(json.dumps([row, repeats]), file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"no answer for {row!r}")
        return float(answer)

    def close(self) -> None:
        """End the process."""
        self.process.communicate()


def interval(ratios: list[float], confidence: float = 0.95) -> tuple[float, float]:
    """The narrowest pair of order statistics that holds the median with at least this probability.

    The number of ratios below the true median is binomial with a chance of one half, whatever their law:
    of 20 the sixth and the fifteenth hold it with 95.9 %. Fewer than six ratios give the whole line.
    """
    count, left_out, outside = len(ratios), 0, 0.0
    while left_out <= count // 2:
        outside += 2.0 * math.comb(count, left_out) * 0.5**count
        if outside > 1.0 - confidence:
            break
        left_out += 1
    if left_out == 0:
        return -math.inf, math.inf
    ordered = sorted(ratios)
    return ordered[left_out - 1], ordered[count - left_out]


def slower(ratios: list[float]) -> bool:
    """True if the new tree is slower: a median below 0.95, and all of its interval below 1."""
    return float(np.median(ratios)) < 0.95 and interval(ratios)[1] < 1.0


def measured(
    old: Path, new: Path, rows: tuple[str, ...]
) -> dict[str, list[tuple[float, float]]]:
    """CPU seconds of each row in the old and the new tree, in turns."""
    times: dict[str, list[tuple[float, float]]] = {row: [] for row in rows}
    with tempfile.TemporaryDirectory() as folder:
        written(SMALL, Path(folder) / "small.toml")
        for round_ in range(ROUNDS):
            pair = Tree(old, Path(folder)), Tree(new, Path(folder))
            _measure(pair, rows, round_, times)
            for tree in pair:
                tree.close()
    return times


def _measure(
    pair: tuple[Tree, Tree], rows: tuple[str, ...], round_: int, times: dict[str, list]
) -> None:
    """Add the CPU seconds of some turns of each row in two trees."""
    for row in rows:
        for tree in pair:
            tree.seconds(row)  # compiles or loads the kernels
        repeats = max(1, math.ceil(LEAST / max(pair[0].seconds(row), 1e-4)))
        for turn in range(TURNS):
            first, second = (
                (pair[0], pair[1]) if (round_ + turn) % 2 else (pair[1], pair[0])
            )
            seconds = {tree: tree.seconds(row, repeats) for tree in (first, second)}
            times[row].append((seconds[pair[0]], seconds[pair[1]]))


def main() -> None:
    """Print a line a row; exit with 1 if any is slower."""
    old, new, *rows = sys.argv[1:]
    began, failed = time.time(), False
    for row, pairs in measured(
        Path(old).resolve(), Path(new).resolve(), tuple(rows) or ROWS
    ).items():
        ratios = [first / second for first, second in pairs]
        low, high = interval(ratios)
        failed |= slower(ratios)
        seconds = " ".join(f"{value:9.2e} s" for value in np.median(pairs, axis=0))
        print(
            f"{row:34} {np.median(ratios):6.3f}  {low:6.3f} to {high:6.3f}  {seconds}",
            "SLOWER" * slower(ratios),
        )
    print(
        f"ratio: CPU time of the old tree / of the new, median and 95 % interval; {time.time() - began:.0f} s"
    )
    sys.exit(failed)


if __name__ == "__main__":
    main()
