"""Rows of the slider behind a spring, which friction feeds back into."""

import functools
import itertools
from pathlib import Path
from typing import Any

import numpy as np

import sim
from benchmarks import bonds_plain
from benchmarks.bonds import BELL
from benchmarks.timing import Bench, Beside, Row, absolute, spent
from sim.parts.bonds.models import FirstMoment, Tracked
from sim.parts.contact import Equilibrium
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import READINGS, Spring
from sim.scenario.scenario import Clock, Scenario
from sim.step.state import MemberNoise, State, Trajectory

#: Speed of the stage in Bell's stretches a life at rest, and spring over that of all sites: half of the onset's.
SPEED, SOFT = 10.0, 0.02
#: Tolerance of ours that leads to an error of the positions of 1e-6 of the largest.
TOLERANCE = 4e-7
MEAN = FirstMoment(site_density=1.0, start_from="bonded", **BELL)


def scene(
    duration: float,
    steps: int,
    tolerance: float,
    mass: float = 0.0,
    damping: float = 0.0,
    bonds: Any = MEAN,
) -> Scenario:
    """Return a lens of constant area; stretch and life of its bonds at rest are units, and so is the force of all."""
    keys: dict[str, Any] = {
        "clock": Clock(duration=duration, step=duration / steps),
        "solid": Solid(shear_modulus=1.6e6),
        "sphere": Sphere(radius=2e-3),
        "adhesion": Adhesion(work=0.042, bond_share=0.0),
        "contact": Equilibrium(load=4e-3),
        "bonds": bonds,
    }
    area = Scenario(**keys).contact_area
    body = {
        "stiffness": SOFT * area,
        "tolerance": tolerance,
        "mass": mass * area,
        "damping": damping * area,
    }
    return Scenario(
        **keys, drive=Spring(stage=SPEED, contact_stiffness="rigid", **body)
    )


def ended(of: Scenario, members: int = 1) -> tuple[State, Trajectory]:
    """Return the state of a slider at the end, and its trajectory at each clock step."""
    noise = MemberNoise.of(of.seed, np.arange(members))
    return of.stepper.follow(noise, None, range(1, of.clock.steps + 1))


def followed(of: Scenario, members: int = 1) -> Trajectory:
    """Return the trajectory of a slider at each clock step."""
    return ended(of, members)[1]


def apart(positions: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference of positions over the largest position."""
    return float(np.max(np.abs(positions - exact)) / np.max(np.abs(exact)))


#: A lens whose contact follows ΔΓ; its speed [mm/s], members, clock steps and the goal for a member's step [µs].
LENS = Path(__file__).parent.parent / "scenarios" / "pdms_lens_spring.toml"
FEELING = (
    (2, 1, 4000, 4.0),
    (2, 4, 1000, 4.0),
    (2, 256, 100, 3.5),
    (2, 10_000, 40, 3.5),
    (3, 1, 4000, None),
    (20, 1, 4000, None),
)
#: Speeds of the lens in stick-slip [mm/s], its clock steps [ms], and tolerances of its bands; goals [µs] for its parts.
SLIPPING = tuple(itertools.product((3, 20), (1.0, 0.125), (0.01, 0.001)))
PARTS = {"a sub-step": 1.8, "a draw of ΔΓ": 0.3, "a clock step": 1.0}

#: Sliders by name: mass and damping over those of all sites, slips or as much time, and tolerances of the others.
SLIDERS: dict[str, tuple[float, float, int, dict[str, float]]] = {
    "massless": (0.0, 0.0, 100, {"LSODA": 7e-9, "pair": 1e-6}),
    "ringing": (1e-3, 0.01, 20, {"LSODA": 1e-7, "pair": 1e-5}),
    "damped": (1e-3, 1.0, 20, {"LSODA": 1e-7, "pair": 1e-5}),
    "heavy": (10.0, 0.1, 20, {"LSODA": 1e-7, "pair": 1e-5}),
}


#: A slider whose body rings about a period in a clock step of 1 ms, and draws of ΔΓ that kick it.
KICKED: dict[str, Any] = {
    "seed": 5,
    "clock": {"duration": 1.0, "step": 1e-3},
    "solid": {"shear_modulus": 1.5e6},
    "sphere": {"radius": 2.2e-3},
    "adhesion": {"work": 0.044},
    "contact": {"load": 4e-3},
    "drive": {
        "model": "spring",
        "stage": 1.2e-3,
        "stiffness": 140.0,
        "mass": 1.5e-5,
        "damping": 0.06,
        "start": "steady",
    },
    "bonds": {
        "model": "rate",
        "rupture": {"model": "bell", "zero_force_rate": 25.0, "bell_force": 4e-12},
        "bond_stiffness": 8e-7,
        "rebinding_rate": 250.0,
        "site_density": 6.5e16,
    },
}
SPECTRUM = {"model": "von_karman", "rms": 1.2e5, "length": 9e-6, "hurst": 0.5}
DRAWN = {
    "shear": {
        "model": "banded",
        "cell": 2.4e-4,
        "points": 256,
        "spectrum": SPECTRUM,
        "correlation": {"model": "slip", "length": 6e-6},
    }
}


def spring(bench: Bench) -> list[Row]:
    """Sliders beside LSODA and a compiled explicit pair, those that feel ΔΓ, and 1000 slips with 10⁵ records."""
    rows = []
    for name, (mass, damping, slips, tolerances) in SLIDERS.items():
        duration = bench.of(2.4 * slips, 1.0)
        records = bench.of(round(duration), 2)
        of, times = (
            scene(duration, records, TOLERANCE, mass, damping),
            np.linspace(0.0, duration, records + 1),
        )
        exact = followed(
            scene(duration, records, bench.of(1e-12, 1e-9), mass, damping)
        ).position[:, 0]
        ours, body, others = (
            apart(followed(of).position[:, 0], exact),
            (SOFT, SPEED, mass, damping),
            [],
        )
        for label, program in (
            (
                "scipy's LSODA, compiled slopes",
                functools.partial(bonds_plain.by_scipy, "LSODA", tolerances["LSODA"]),
            ),
            (
                "compiled Dormand–Prince (numba)",
                functools.partial(bonds_plain.dormand_prince, tolerances["pair"]),
            ),
        ):
            theirs = functools.partial(program, times, body)
            errors = f"position {ours:.0e}; {apart(theirs()[1:], exact):.0e}"
            others.append(
                Beside(label, theirs, errors=errors, bound="scipy" not in label)
            )
        work = f"{name} slider behind a spring, {slips * 2.4:.0f} records"
        rows += bench.compare(work, functools.partial(followed, of), *others, turns=7)

    lens = sim.load(LENS).points()[0]
    for stage, members, steps, goal in FEELING:
        values = {
            "drive.stage": f"{stage} mm/s",
            "clock.duration": f"{bench.of(steps, 2)} ms",
        }
        program, share = (
            functools.partial(followed, lens.with_values(values), members),
            1e6 / (members * steps),
        )
        program()  # it may compile
        microseconds = [share * spent(program) for _ in range(bench.of(7, 1))]
        work = (
            f"a member's step of 1 ms: spring lens at {stage} mm/s, members: {members}"
        )
        rows.append(absolute(work, microseconds, "µs", goal))
    rows += parts(bench, lens)
    for sites in (50, 50_000):
        tracked = Tracked(
            sites=bench.of(sites, 5), site_density=1.0, start_from="bonded", **BELL
        )
        duration = bench.of(max(6.0, 6e4 / sites), 1.0)
        program = functools.partial(
            ended, scene(duration, round(duration), 1e-4, bonds=tracked)
        )
        share = 1e6 / np.sum(program()[0].bonds.life + 1.0)
        microseconds = [share * spent(program) for _ in range(bench.of(5, 1))]
        work = f"a bond's life: slider on {sites:,} tracked bonds behind a spring"
        rows.append(absolute(work, microseconds, "µs", 1.5))

    rows += events(bench) + kicked(bench)
    long = scene(bench.of(2400.0, 1.0), bench.of(10**5, 10), TOLERANCE)
    seconds = [spent(lambda: followed(long)) for _ in range(bench.of(5, 1))]
    rows.append(
        absolute(
            "slider behind a spring through 10³ slips, 10⁵ records", seconds, "s", 5.0
        )
    )
    return rows


def events(bench: Bench) -> list[Row]:
    """Rows of an event of tracked bonds in steady sliding that carry all of the adhesion, or none of it."""
    rows = []
    for sites in (20, 200, 2000, 20_000):
        bonds = Tracked(
            sites=bench.of(sites, 5), site_density=1.0, start_from="bonded", **BELL
        )
        duration = bench.of(1e5 / sites, 1.0)
        without = scene(duration, 20, TOLERANCE, bonds=bonds)
        steady = {
            "drive.stage": 0.5 * SPEED,
            "drive.stiffness": 5.0 * SOFT * without.contact_area,
        }
        programs, counts = [], []
        for share in (1.0, 0.0):
            of = without.with_values(steady | {"adhesion.bond_share": share})
            programs.append(functools.partial(ended, of))
            counts.append(2.0 * np.sum(programs[-1]()[0].bonds.life))
        other = Beside(
            "the same bonds without adhesion",
            programs[1],
            share=counts[1],
            goal=3.0,
            bound=True,
        )
        work = f"an event: {sites:,} tracked bonds that carry the adhesion"
        rows += bench.compare(work, programs[0], other, share=counts[0], turns=7)
    return rows


def kicked(bench: Bench) -> list[Row]:
    """Row of a slider whose body rings a period in each clock step after a draw of ΔΓ, beside one without draws."""
    members, steps = 4, bench.of(1000, 2)
    clock = {"clock.duration": f"{steps} ms", "clock.record": f"{steps} ms"}
    of, still = (
        sim.load(tables, clock).points()[0] for tables in (KICKED | DRAWN, KICKED)
    )
    count = float(members * steps)
    other = Beside(
        "the same slider without fluctuations",
        functools.partial(ended, still, members),
        share=count,
        goal=3.0,
        bound=True,
    )
    work = "a member's step of 1 ms: slider kicked by draws of ΔΓ"
    program = functools.partial(ended, of, members)
    return bench.compare(work, program, other, share=count, turns=7)


def parts(bench: Bench, lens: Scenario) -> list[Row]:
    """Rows of the times of a lens in stick-slip, split by least squares over speeds, clock steps and tolerances."""
    programs, counts, steps = [], [], bench.of(20_000, 4)
    for stage, step, tolerance in SLIPPING:
        clock = {
            "clock.step": f"{step} ms",
            "clock.record": f"{step} ms",
            "clock.duration": f"{steps * step} ms",
        }
        of = lens.with_values(
            {"drive.stage": f"{stage} mm/s", "shear.tolerance": tolerance} | clock
        )
        programs.append(functools.partial(followed, of))
        substeps = programs[-1]().driven[-1, 0, READINGS.index("substeps")]
        counts.append(
            [substeps, steps * len(of.process.shapes) / len(lens.process.shapes), steps]
        )
    turns = []
    for _ in range(bench.of(7, 1)):
        seconds = np.array([spent(program) for program in programs])[:, np.newaxis]
        turns.append(
            1e6 * np.abs(np.linalg.lstsq(counts / seconds, np.ones(len(seconds)))[0])
        )
    work = f"spring lens in stick-slip, {len(lens.process.shapes)} bands"
    named = zip(PARTS.items(), np.transpose(turns), strict=True)
    return [
        absolute(f"{part}: {work}", values.tolist(), "µs", goal)
        for (part, goal), values in named
    ]
