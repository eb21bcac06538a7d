"""Rows of the slider behind a spring, which friction feeds back into."""

import functools
from typing import Any

import numpy as np

from benchmarks import bonds_plain
from benchmarks.bonds import BELL
from benchmarks.timing import Bench, Beside, Row, absolute, spent
from sim.engine import MemberNoise, State, Trajectory, follow, march, pack, unpack
from sim.parts.bonds import FirstMoment
from sim.parts.contact import Equilibrium
from sim.parts.contact.models import Adhesion, Solid, Sphere
from sim.parts.drive import READINGS, Spring
from sim.scenario.clock import Clock, Ensemble
from sim.scenario.scenario import Scenario

#: Speed of the stage in Bell's stretches a life at rest, and spring over that of all sites: half of the onset's.
SPEED, SOFT = 10.0, 0.02
#: Error of the positions, over the largest, that all are held to, and the tolerance of ours that leads to it.
ERROR, TOLERANCE = 1e-6, 4e-7


def scene(duration: float, steps: int, tolerance: float, members: int = 1, damping: float = 0.0) -> Scenario:
    """A lens of constant area; stretch and life of its bonds at rest are units, damping is over the area."""
    keys: dict[str, Any] = {
        "clock": Clock(duration=duration, step=duration / steps),
        "solid": Solid(shear_modulus=1.6e6),
        "sphere": Sphere(radius=2e-3),
        "adhesion": Adhesion(work=0.042, bond_share=0.0),
        "contact": Equilibrium(load=4e-3),
        "bonds": FirstMoment(site_density=1.0, start_from="bonded", **BELL),
        "ensemble": Ensemble(members=members),
    }
    area = Scenario(**keys).contact_area
    body = {"stiffness": SOFT * area, "damping": damping * area, "tolerance": tolerance}
    return Scenario(**keys, drive=Spring(stage=SPEED, contact_stiffness="rigid", **body))


def followed(of: Scenario, begun: State | None = None) -> Trajectory:
    """What all members of a scene go through, at each clock step, from a state or from the start."""
    steps = range(1 if begun is None else begun.step + 1, of.clock.steps + 1)
    return follow(of, MemberNoise.of(of.seed, np.arange(of.ensemble.members)), begun, steps)[1]


def apart(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest difference of positions over the largest position."""
    return float(np.max(np.abs(found - exact)) / np.max(np.abs(exact)))


def out_of_phase(members: int, duration: float) -> tuple[Scenario, State]:
    """A scene of so many members and a state of it in which each is at another time of a cycle of slips."""
    alone = march(scene(8.0, members, TOLERANCE), np.arange(1))
    states = [pack(state) for state in alone][1:]
    of = scene(2.0 * duration, 2, TOLERANCE, members)
    arrays = {name: np.concatenate([state[name] for state in states]) for name in states[0] if name != "step"}
    return of, unpack(of, arrays | {"step": np.array(1)})


def substeps(course: Trajectory) -> float:
    """Sub-steps of all members up to the end of a course."""
    return float(np.sum(course.driven[-1, :, READINGS.index("substeps")]))


def spring(bench: Bench) -> list[Row]:
    """A massless slider through 100 slips, 256 of them out of phase, 10⁵ records, and what choosing steps saves."""
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

    one, (many, begun) = scene(bench.of(240.0, 1.0), 1, TOLERANCE), out_of_phase(bench.of(256, 4), bench.of(8.0, 0.3))
    rows += bench.compare(
        "a sub-step of 256 sliders out of phase",
        lambda: followed(many, begun),
        Beside("that of one slider", lambda: followed(one), substeps(followed(one)), goal=1.2, bound=True),
        share=substeps(followed(many, begun)) - float(np.sum(begun.drive.substeps)),
        turns=7,
    )
    long = scene(bench.of(2400.0, 1.0), bench.of(10**5, 10), TOLERANCE)
    seconds = [spent(lambda: followed(long)) for _ in range(bench.of(5, 1))]
    rows.append(absolute("slider behind a spring through 10³ slips, 10⁵ records", seconds, "s", 5.0))
    rows.append(chosen(bench))
    return rows


def chosen(bench: Bench) -> Row:
    """Sub-steps that are chosen, over steps of one length, under a damping that gives slips 1 % of their period."""
    duration, damping = bench.of(8.0, 1.0), 2e-4
    exact, own = (followed(scene(duration, 8, tolerance, damping=damping)) for tolerance in (1e-11, 1e-7))
    count, found = 8, np.inf
    while not found <= ERROR:
        count *= 2
        fixed = followed(scene(duration, count, 1e-2, damping=damping))
        found = apart(fixed.position[count // 8 - 1 :: count // 8], exact.position)
    more = f"position {apart(own.position, exact.position):.0e}; {found:.0e}"
    work = "sub-steps that a slider chooses through its slips"
    return Row(work, "steps of one length", "as many", 0.1, [substeps(own) / count] * 3, [], more)
