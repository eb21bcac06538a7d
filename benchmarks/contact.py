"""Rows of the contact radius: laws for arrays."""

from collections.abc import Callable

import mpmath
import numpy as np

from benchmarks import contact_plain as plain
from benchmarks.timing import Bench, Beside, Row
from sim.laws import jkr

SPHERE_RADIUS, MODULUS = 2e-3, 6.4e6


def error(
    radii: np.ndarray, exact: Callable, states: tuple[np.ndarray, ...], some: int
) -> str:
    """Largest relative error of the first adhesive states that have an equilibrium, against fifty digits."""
    chosen = np.flatnonzero((states[-1] > 0) & np.isfinite(radii))[:some]
    with mpmath.workdps(50):
        known = [
            exact(*(state[i] for state in states), SPHERE_RADIUS, MODULUS)
            for i in chosen
        ]
        return f"{max(float(abs(radii[i] / value - 1)) for i, value in zip(chosen, known, strict=True)):.0e}"


def radii(bench: Bench) -> list[Row]:
    """JKR's radii at a load and behind stiffnesses around the contact's own."""
    rows, random, count = [], np.random.default_rng(1), bench.of(100_000, 20)
    work, load = random.uniform(-1e-3, 42e-3, count), random.uniform(-1e-4, 4e-3, count)
    depth, stiffness = (
        random.uniform(-1e-6, 8e-6, count),
        10 ** random.uniform(1, 4, count),
    )
    known = SPHERE_RADIUS, MODULUS
    for name, ours, theirs, exact, states, beside, goal in (
        (
            "at a load",
            jkr.radius_at_load,
            plain.radius_at_load,
            plain.exact_radius_at_load,
            (load, work),
            "numpy, closed form",
            1.5,
        ),
        (
            "behind a stiffness",
            jkr.radius_at_displacement,
            plain.radius_by_newton,
            plain.exact_radius,
            (depth, stiffness, work),
            "numpy, Newton",
            3.5,
        ),
    ):
        errors = [
            error(law(*states, *known), exact, states, bench.of(200, 5))
            for law in (ours, theirs)
        ]
        rows += bench.compare(
            f"`laws.jkr` {name}, 10⁵ radii",
            lambda ours=ours, states=states: ours(*states, *known),
            Beside(
                beside,
                lambda law=theirs, states=states: law(*states, *known),
                goal=goal,
                errors="; ".join(errors),
            ),
        )
    return rows
