"""Rows of the slider behind a spring, which friction feeds back into."""

import functools
from typing import Any

import numpy as np

from benchmarks import bonds_plain
from benchmarks.bonds import BELL
from benchmarks.timing import Bench, Beside, Row, absolute, spent
from sim.engine import MemberNoise, Trajectory, follow
from sim.parts.bonds import FirstMoment
from sim.parts.contact import Equilibrium
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import Spring
from sim.scenario.clock import Clock
from sim.scenario.scenario import Scenario

#: Speed of the stage in Bell's stretches a life at rest, and spring over that of all sites: half of the onset's.
SPEED, SOFT = 10.0, 0.02
#: Tolerance of ours that leads to an error of the positions of 1e-6 of the largest.
TOLERANCE = 4e-7


def scene(duration: float, steps: int, tolerance: float) -> Scenario:
    """Return a lens of constant area; stretch and life of its bonds at rest are units."""
    keys: dict[str, Any] = {
        "clock": Clock(duration=duration, step=duration / steps),
        "solid": Solid(shear_modulus=1.6e6),
        "sphere": Sphere(radius=2e-3),
        "adhesion": Adhesion(work=0.042, bond_share=0.0),
        "contact": Equilibrium(load=4e-3),
        "bonds": FirstMoment(site_density=1.0, start_from="bonded", **BELL),
    }
    area = Scenario(**keys).contact_area
    body = {"stiffness": SOFT * area, "tolerance": tolerance}
    return Scenario(**keys, drive=Spring(stage=SPEED, contact_stiffness="rigid", **body))


def followed(of: Scenario) -> Trajectory:
    """Return the trajectory of a slider at each clock step."""
    return follow(of, MemberNoise.of(of.seed, np.arange(1)), None, range(1, of.clock.steps + 1))[1]


def apart(positions: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest difference of positions over the largest position."""
    return float(np.max(np.abs(positions - exact)) / np.max(np.abs(exact)))


def spring(bench: Bench) -> list[Row]:
    """A massless slider through 100 slips beside scipy's solvers, and through 1000 slips with 10⁵ records."""
    rows = []
    for method, tolerance, slips in (("LSODA", 7e-9, 100), ("Radau", 1e-6, 10)):
        duration = bench.of(2.4 * slips, 1.0)
        records = bench.of(round(duration), 2)
        of, times = scene(duration, records, TOLERANCE), np.linspace(0.0, duration, records + 1)
        exact = followed(scene(duration, records, bench.of(1e-12, 1e-9))).position[:, 0]
        theirs = functools.partial(bonds_plain.pulled_slider, times, SOFT, SPEED, method, tolerance)
        errors = f"position {apart(followed(of).position[:, 0], exact):.0e}; {apart(theirs()[1:], exact):.0e}"
        beside = Beside(f"scipy's solve_ivp, {method}", theirs, goal=50, errors=errors)
        work = f"slider behind a spring through {slips} slips, {slips * 2.4:.0f} records"
        rows += bench.compare(work, functools.partial(followed, of), beside, turns=7)

    long = scene(bench.of(2400.0, 1.0), bench.of(10**5, 10), TOLERANCE)
    seconds = [spent(lambda: followed(long)) for _ in range(bench.of(5, 1))]
    rows.append(absolute("slider behind a spring through 10³ slips, 10⁵ records", seconds, "s", 5.0))
    return rows
