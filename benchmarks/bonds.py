"""Rows of the bonds: counted, tracked one by one, cohorts."""

from collections.abc import Callable
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
BELL: Any = {"rupture": Bell(zero_force_rate=1.0, bell_force=1.0), "bond_stiffness": 1.0, "rebinding_rate": 1.0}
BELL_SPEED = 10.0


def population(part: Any, members: int, steps: int, speed: float, step: float) -> Callable[[], Bonding]:
    """A program that advances bonds from their start by a block of steps of steady sliding, for a batch of members."""
    noise = Noise(1, "bonds", np.arange(members))
    first, motions = steady(speed, step, steps)
    return lambda: part.advance(part.start(first, noise), motions, np.ones(1), noise)[1]


def counted(bench: Bench) -> list[Row]:
    """10⁴ bonds, 100 members, 100 steps."""
    sites, members, steps = bench.of((10_000, 100, 100), (50, 3, 4))
    random = np.random.default_rng(1)
    stay, bind = transition_probabilities(SPEED * STEP, STEP, SPEED, RATE)

    def binomials() -> None:
        bound = np.full(members, sites // 2)
        for _ in range(steps):
            bound = random.binomial(bound, stay) + random.binomial(sites - bound, bind)

    part = bonds.Counted(critical_speed=SPEED, rebinding_rate=RATE, sites=sites)
    return bench.compare(
        "counted, 10⁴ bonds: 100 members × 100 steps",
        population(part, members, steps, SPEED, STEP),
        Beside("numpy's Generator.binomial", binomials, steps * members, goal=1.1, bound=True),
        share=steps * members,
    )


def stepped(shape: tuple[int, ...], step: float, count: int) -> Callable[[], None]:
    """A program of some of numpy's steps of stretched bonds, near their stationary state."""
    theirs = bonds_plain.TrackedNumpy(shape, 1.0, 1.0, 1.0, np.random.default_rng(1))

    def program(count: int = count) -> None:
        for _ in range(count):
            theirs.step(BELL_SPEED * step, step)

    program(round(0.5 / step))
    return program


def errors(ours: Bonding, step: float, more: str = "") -> str:
    """Of the friction, of ours over a run and of numpy's steps as they follow from their own law."""
    exact = float(bell_stress(BELL_SPEED, 1.0, 1.0, 1.0, 1.0, 1.0))
    theirs = bonds_plain.mean_stretch_in_steps(BELL_SPEED * step, step, 1.0, 1.0, 1.0)
    return f"friction {abs(np.mean(ours.stress) / exact - 1.0):.1%}; {theirs / exact - 1.0:.1%}{more}"


def tracked(bench: Bench) -> list[Row]:
    """20 members of 10⁴ bonds over ten lives at rest, eps = 10 and beta = 1, at many outputs and at few."""
    sites, members = bench.of((10_000, 20), (50, 2))
    part, rows, random = bonds.Tracked(sites=sites, site_density=1.0, **BELL), [], np.random.default_rng(1)
    for name, step, steps, fine, goal in (
        ("at 1000 steps of 0.01 lives", 0.01, 1000, 0.01, 20),
        ("at 100 steps of 0.1 lives", 0.1, 100, 0.001, 30),
    ):
        steps, per_output = bench.of(steps, 5), round(step / fine)
        ours, theirs = population(part, members, steps, BELL_SPEED, step), stepped((members, sites), fine, per_output)
        label = "numpy in the same steps" if per_output == 1 else f"numpy, {per_output} steps to each"
        rows += bench.compare(
            f"tracked, 20 members of 10⁴ bonds, {name}",
            ours,
            Beside(label, theirs, goal=goal, errors=errors(ours(), fine)),
            Beside(
                "compiled renewals (numba)",
                lambda steps=steps, step=step: bonds_plain.renewal(
                    members * sites, steps, step, BELL_SPEED, 1.0, 1.0, 1.0, random
                ),
                steps,
                goal=1.1,
                bound=True,
            ),
            share=steps,
            turns=7,
        )
    return rows


def cohorts(bench: Bench) -> list[Row]:
    """The density of stretches at a tolerance of 0.001, beside as many bonds as are no noisier than that."""
    steps, many = bench.of((100, 10**6), (3, 100))
    part = bonds.Cohort(site_density=1.0, tolerance=1e-3, **BELL)
    ours, theirs = population(part, 1, steps, BELL_SPEED, 0.01), stepped((many,), 0.01, 1)
    return bench.compare(
        "cohort at a tolerance of 0.001, a step of 0.01 lives",
        ours,
        Beside(
            "numpy's step of 10⁶ bonds, as noisy as that", theirs, errors=errors(ours(), 0.01, " and noise of 0.1%")
        ),
        share=steps,
        turns=7,
    )
