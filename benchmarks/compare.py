"""Speed of two source trees, taking turns: ``python benchmarks/compare.py OLD NEW [ROW ...]``.

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
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

ROUNDS, TURNS = 4, 5
#: CPU seconds that one measurement takes at least.
LEAST = 0.1
LENS = """
name = "a lens"
seed = 1
[clock]
duration = "{duration} ms"
step = "1 ms"
[solid]
shear_modulus = "1.6 MPa"
[sphere]
radius = "2 mm"
[adhesion]
work = "42 mJ/m^2"
[ensemble]
members = {members}
"""
RAMP = '[drive]\nmodel = "ramp"\nfrom = "10 um/s"\nto = "100 mm/s"\nscale = "log"\n'
STEADY = '[drive]\nmodel = "steady"\nspeed = "10 um/s"\n'
LOAD = '[contact]\nmodel = "equilibrium"\nload = "4 mN"\n'
MOVED = """[contact]
model = "{model}"
displacement = {{ from = "2 um", to = "-2 um", cycles = 1 }}
stiffness = "2 kN/m"
after_pull_off = "reattach"
{more}
"""
RATE = '[bonds]\nmodel = "rate"\ncritical_speed = "10 mm/s"\nrebinding_rate = "500 1/s"\nstress = "0.3 MPa"\n'
COUNTED = RATE.replace('"rate"', '"counted"') + "sites = 10_000\n"
BELL = """[bonds]
model = "{model}"
rupture = {{ model = "bell", zero_force_rate = "200 1/s", bell_force = "4 pN" }}
bond_stiffness = "0.4 mN/m"
rebinding_rate = "400 1/s"
site_density = "1e17 1/m^2"
{more}
"""
FIELD = """[shear]
model = "{model}"
cell = "0.24 mm"
{more}
[shear.spectrum]
model = "self_affine"
rms = "100 kPa"
hurst = 0.8
longest = "60 um"
rolloff = "24 um"
shortest = "2.5 um"
[shear.correlation]
model = "slip"
length = "5 um"
[shear.amplitude]
model = "onset"
speed = "2.5 mm/s"
width = 0.3
floor = 0.05
"""
BANDED = FIELD.format(model="banded", more="tolerance = 0.01")
SPRING = '[drive]\nmodel = "spring"\nstage = "{stage}"\nstiffness = "{stiffness}"\n{more}\n'
CLUTCH = """[bonds]
model = "{model}"
rupture = {{ model = "bell", zero_force_rate = "25 1/s", bell_force = "4 pN" }}
bond_stiffness = "0.8 uN/m"
rebinding_rate = "250 1/s"
site_density = "6.5e16 1/m^2"
{more}
"""
ONSET = 'model = "onset"\nspeed = "2.5 mm/s"\nwidth = 0.3\nfloor = 0.05'
SLIPPING = BANDED.replace(ONSET, 'model = "slip_rate"\nfloor = 0.05')
MAPS = '[record]\nmaps = ["{}"]\n'.format('", "'.join(f"{n} ms" for n in range(1, 21)))


def lens(duration: int, members: int, *parts: str) -> str:
    """A scene of so many steps and members."""
    return LENS.format(duration=duration, members=members) + "".join(parts)


#: Scenes whose steps are made as a run makes them.
STEPS = {
    "banded step, 64 members": lens(400, 64, RAMP, RATE, BANDED, LOAD),
    "modal step, 256² modes": lens(20, 1, RAMP, RATE, FIELD.format(model="modal", more="points = 256"), LOAD),
    "cohort step, 64 populations": lens(
        100, 64, STEADY, BELL.format(model="cohort", more='tolerance = 1e-3\narea = "carried"'), BANDED, LOAD
    ),
    "tracked step, 64 members of 1000": lens(
        100, 64, STEADY, BELL.format(model="tracked", more="sites = 1000"), BANDED, LOAD
    ),
    "counted step, 64 members": lens(400, 64, RAMP, COUNTED, LOAD),
    "equilibrium step, 64 members": lens(
        400, 64, RAMP, RATE, BANDED, MOVED.format(model="equilibrium", more="")
    ),
    "rate-dependent step, 64 members": lens(
        400, 64, RAMP, RATE, BANDED, MOVED.format(model="rate_dependent", more='front_speed = "10 mm/s"')
    ),
}  # fmt: skip
#: A slider behind a spring, whose contact feels the energy of the fluctuations or not.
for _felt, _share in (("", ""), (", energy not felt", "paid_by_adhesion = 0.0\n")):
    _shear = SLIPPING.replace("tolerance = 0.01", f"tolerance = 0.01\n{_share}")
    for _name, _members, _bonds in (
        ("rate", 16, CLUTCH.format(model="rate", more="")),
        ("cohort", 2, CLUTCH.format(model="cohort", more="tolerance = 1e-3")),
        ("tracked", 2, CLUTCH.format(model="tracked", more="sites = 300")),
    ):
        _drive = SPRING.format(stage="5 mm/s", stiffness="300 N/m", more="")
        STEPS[f"spring, {_name}{_felt}"] = lens(40, _members, _drive, _bonds, _shear, LOAD)
MAPPED = lens(20, 1, RAMP, RATE, FIELD.format(model="mapped", more="points = 256"), LOAD, MAPS)
SMALL = lens(100, 64, RAMP, RATE, BANDED, LOAD)
WHOLE, CHECK = "whole small run", "check of a small run"


def programs(tree: Path, folder: Path) -> dict[str, Callable[[], object]]:
    """What is timed in a tree, by the name of its row; called in the tree's own process."""
    import sim
    from sim import engine
    from sim.laws import jkr

    assert Path(sim.__file__).is_relative_to(tree), f"{sim.__file__} is not of {tree}"
    noise = getattr(engine, "MemberNoise", None) or engine.Dice

    def written(name: str, text: str) -> Path:
        path = folder / f"{name}.toml"
        path.write_text(text)
        return path

    def steps(text: str) -> Callable[[], object]:
        scene = cache(lambda: sim.load(written("scene", text)))

        def marched() -> None:
            members = np.arange(scene().ensemble.members)
            engine.follow(scene(), noise.of(1, members), None, range(scene().clock.steps + 1))

        return marched

    random = np.random.default_rng(1)
    load, depth, work = (
        random.uniform(0, 4e-3, 10**5),
        random.uniform(-4e-7, 2e-6, 10**5),
        random.uniform(0, 0.04, 10**5),
    )

    def radii() -> None:
        jkr.radius_at_load(load, work, 2e-3, 6.4e6)
        jkr.radius_at_indentation(depth, work, 2e-3, 6.4e6)
        jkr.radius_at_displacement(depth, 2e3, work, 2e-3, 6.4e6)

    small = written("small", SMALL)
    mapped = cache(lambda: sim.load(written("mapped", MAPPED)))
    run = [sys.executable, "-m", "sim", "run", str(small), "-o", str(folder / "x.nc"), "--force", "--quiet"]
    rows: dict[str, Callable[[], object]] = {name: steps(text) for name, text in STEPS.items()}
    rows["mapped field with its map, 256²"] = lambda: sim.run(mapped())
    rows["JKR radii, 3 of 100,000"] = radii
    rows["loading a scenario"] = lambda: sim.load(small)
    rows[WHOLE] = lambda: subprocess.run(run, check=True)
    check = [sys.executable, "-m", "sim", "check", str(small)]
    rows[CHECK] = lambda: subprocess.run(check, check=True, stdout=subprocess.DEVNULL)
    return rows


ROWS = (*STEPS, "mapped field with its map, 256²", "JKR radii, 3 of 100,000", "loading a scenario", WHOLE, CHECK)


def spent() -> float:
    """CPU time of this process and of its children that have ended [s]."""
    return sum(os.times()[:4])


def serve(tree: Path) -> None:
    """Read a row and a number of repeats a line, and answer with the CPU seconds of one, children included."""
    with tempfile.TemporaryDirectory() as folder:
        known = programs(tree, Path(folder))
        for line in sys.stdin:
            name, repeats = json.loads(line)
            began = spent()
            for _ in range(repeats):
                known[name]()
            print((spent() - began) / repeats, flush=True)


class Tree:
    """A process that times rows in one tree."""

    def __init__(self, tree: Path) -> None:
        command, environment = [sys.executable, __file__, "--serve", str(tree)], {**os.environ, "PYTHONPATH": str(tree)}
        self.process = subprocess.Popen(
            command, env=environment, cwd=tree, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def seconds(self, row: str, repeats: int = 1) -> float:
        """CPU time of a row."""
        assert self.process.stdin and self.process.stdout
        print(json.dumps([row, repeats]), file=self.process.stdin, flush=True)
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"{self.process.args[-1]}: no answer for {row!r}")
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
    """Whether the new tree is slower: a median below 0.95, and all of its interval below 1."""
    return float(np.median(ratios)) < 0.95 and interval(ratios)[1] < 1.0


def measured(old: Path, new: Path, rows: tuple[str, ...]) -> dict[str, list[tuple[float, float]]]:
    """CPU seconds of each row in the old and the new tree, in turns."""
    times: dict[str, list[tuple[float, float]]] = {row: [] for row in rows}
    for round_ in range(ROUNDS):
        pair = Tree(old), Tree(new)
        for row in rows:
            for tree in pair:
                tree.seconds(row)  # compiles or loads the kernels
            repeats = max(1, math.ceil(LEAST / max(pair[0].seconds(row), 1e-4)))
            for turn in range(TURNS):
                first, second = (pair[0], pair[1]) if (round_ + turn) % 2 else (pair[1], pair[0])
                seconds = {tree: tree.seconds(row, repeats) for tree in (first, second)}
                times[row].append((seconds[pair[0]], seconds[pair[1]]))
        for tree in pair:
            tree.close()
    return times


def main() -> None:
    """Print a line a row; exit with 1 if any is slower."""
    if sys.argv[1:2] == ["--serve"]:
        serve(Path(sys.argv[2]))
        return
    old, new, *rows = sys.argv[1:]
    began, failed = time.time(), False
    for row, pairs in measured(Path(old).resolve(), Path(new).resolve(), tuple(rows) or ROWS).items():
        ratios = [one / two for one, two in pairs]
        low, high = interval(ratios)
        failed |= slower(ratios)
        seconds = " ".join(f"{value:9.2e} s" for value in np.median(pairs, axis=0))
        print(f"{row:34} {np.median(ratios):6.3f}  {low:6.3f} to {high:6.3f}  {seconds}", "SLOWER" * slower(ratios))
    print(f"ratio: CPU time of the old tree / of the new, median and 95 % interval; {time.time() - began:.0f} s")
    sys.exit(failed)


if __name__ == "__main__":
    main()
