"""Rows of the bonds: counted, and tracked one by one."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from benchmarks import bonds_plain
from benchmarks.scenes import steady
from benchmarks.timing import Bench, Beside, Row
from sim.laws.schallamach import bell_stress, transition_probabilities
from sim.numerics.noise import Noise
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell
from sim.parts.exchange import Bonding

#: Two-state bonds: V = Vc, and half a bond's life at rest a step.
SPEED, STEP, RATE = 1e-2, 1e-3, 500.0
#: Bonds with a rate at rest, a Bell force and a stiffness of 1; at a speed of 10 friction is near its maximum.
BELL: Any = {
    "rupture": Bell(zero_force_rate=1.0, bell_force=1.0),
    "bond_stiffness": 1.0,
    "rebinding_rate": 1.0,
}
BELL_SPEED = 10.0


def population(
    part: Any, members: int, steps: int, speed: float, step: float
) -> Callable[[], Bonding]:
    """A program that advances bonds from their start by a block of steps of steady sliding, for a batch of members."""
    noise = Noise(1, "bonds", np.arange(members))
    first, motions = steady(speed, step, steps)
    return lambda: part.advance(part.start(first, noise), motions, np.ones(1), noise)[1]


def counted(bench: Bench) -> list[Row]:
    """Many bonds, as of a lens, and thirty, as of a probe."""
    rows, random = [], np.random.default_rng(1)
    stay, bind = transition_probabilities(SPEED * STEP, STEP, SPEED, RATE)
    for name, full, goal in (
        ("10⁴ bonds: 100 members × 100 steps", (10_000, 100, 100), 1.1),
        ("30 bonds: 1000 members × 100 steps", (30, 1000, 100), 1.05),
    ):
        sites, members, steps = bench.of(full, (20, 3, 4))

        def binomials(
            sites: int = sites, members: int = members, steps: int = steps
        ) -> None:
            bound = np.full(members, sites // 2)
            for _ in range(steps):
                bound = random.binomial(bound, stay) + random.binomial(
                    sites - bound, bind
                )

        def compiled(
            sites: int = sites, members: int = members, steps: int = steps
        ) -> None:
            bonds_plain.binomials(members, steps, sites, stay, bind, random)

        part = bonds.Counted(critical_speed=SPEED, rebinding_rate=RATE, sites=sites)
        rows += bench.compare(
            f"counted, {name}",
            population(part, members, steps, SPEED, STEP),
            Beside(
                "numpy's Generator.binomial",
                binomials,
                steps * members,
                goal=1.1,
                bound=True,
            ),
            Beside(
                "compiled (numba), Generator.binomial",
                compiled,
                steps * members,
                goal=goal,
                bound=True,
            ),
            share=steps * members,
        )
    return rows


def stepped(shape: tuple[int, ...], step: float, count: int) -> Callable[[], float]:
    """A program of some of numpy's steps of stretched bonds, near their stationary state; their mean stretch."""
    theirs = bonds_plain.TrackedNumpy(shape, 1.0, 1.0, 1.0, np.random.default_rng(1))

    def program(count: int = count) -> float:
        return float(
            np.mean([theirs.step(BELL_SPEED * step, step)[1] for _ in range(count)])
        )

    program(round(5.0 / step))
    return program


def errors(ours: Bonding, theirs: float) -> str:
    """Errors of the friction, of ours over a run and of a mean stretch of numpy's steps."""
    exact = float(bell_stress(BELL_SPEED, 1.0, 1.0, 1.0, 1.0, 1.0))
    return f"friction {abs(np.mean(ours.stress) / exact - 1.0):.2%}; {abs(theirs / exact - 1.0):.2%}"


def tracked(bench: Bench) -> list[Row]:
    """20 members of 10⁴ bonds over ten lives at rest, eps = 10 and beta = 1, at many outputs and at few."""
    sites, members = bench.of((10_000, 20), (50, 2))
    part, rows, random = (
        bonds.Tracked(sites=sites, site_density=1.0, **BELL),
        [],
        np.random.default_rng(1),
    )
    for name, step, steps, per_output in (
        ("at 1000 steps of 0.01 lives", 0.01, 1000, 1),
        ("at 100 steps of 0.1 lives", 0.1, 100, 5),
    ):
        steps, fine = bench.of(steps, 5), step / per_output
        ours, theirs = (
            population(part, members, steps, BELL_SPEED, step),
            stepped((members, sites), fine, per_output),
        )
        law, edges = (
            (members * sites, 1.0, 1.0, 1.0, random),
            step * np.arange(steps + 1),
        )
        any_motion = partial(
            bonds_plain.renewal_in_steps, edges, np.full(steps, BELL_SPEED), *law
        )
        one_speed = partial(bonds_plain.renewal, steps, step, BELL_SPEED, *law)
        label = (
            "numpy, second order, in the same steps"
            if per_output == 1
            else "numpy, second order, steps of 0.02"
        )
        mean = float(np.mean([theirs() for _ in range(bench.of(200 // per_output, 1))]))
        rows += bench.compare(
            f"tracked, 20 members of 10⁴ bonds, {name}",
            ours,
            Beside(
                label,
                theirs,
                goal=4 if per_output == 1 else None,
                errors=errors(ours(), mean),
            ),
            Beside(
                "compiled renewals (numba), any motion",
                any_motion,
                steps,
                goal=1.1,
                bound=True,
            ),
            Beside(
                "compiled renewals (numba), only steady sliding",
                one_speed,
                steps,
                bound=True,
            ),
            share=steps,
            turns=7,
        )
    return rows
