"""The contact radius as users of numpy and scipy would compute it, beside ours: speed and error.

``rows(compare)`` gives the rows for ``make bench``. Errors are the largest relative ones of 200 of the states,
against fifty digits.
"""

from collections.abc import Callable

import mpmath
import numpy as np
from scipy.optimize import elementwise

from sim.laws import jkr

SPHERE_RADIUS, MODULUS = 2e-3, 6.4e6


def radius_at_load(load, work, sphere_radius, modulus):
    """The closed form, with Hertz where no work is left and nan without equilibrium."""
    pull = 3 * np.pi * np.maximum(work, 0.0) * sphere_radius
    with np.errstate(invalid="ignore"):
        root = np.sqrt(pull * (2 * load + pull))
    cube = 0.75 * sphere_radius / modulus * (load + pull + root)
    return np.cbrt(np.where(cube >= 0, cube, np.nan))


def coefficients(stiffness, work, sphere_radius, modulus):
    """Of the displacement c6 x^6 + c4 x^4 - c3 x^3 - c1 x of an equilibrium, x the square root of its radius."""
    work = np.maximum(work, 0.0)
    c6, c4 = 4 * modulus / (3 * sphere_radius * stiffness), 1 / sphere_radius
    return c6, c4, np.sqrt(8 * np.pi * work * modulus) / stiffness, np.sqrt(2 * np.pi * work / modulus)


def right_of_root(displacement, stiffness, work, sphere_radius, modulus):
    """A square root of the radius that is too large: no indentation or load is below its pull-off value."""
    unit = np.cbrt(np.pi * np.maximum(work, 0.0) * sphere_radius**2 / (8 * modulus))
    load = stiffness * (displacement + 3 * unit**2 / sphere_radius)
    depth = displacement + 1.5 * np.pi * np.maximum(work, 0.0) * sphere_radius / stiffness
    at_load = np.sqrt(radius_at_load(load, work, sphere_radius, modulus))
    at_grips = np.maximum(sphere_radius * depth, 0.0) ** 0.25 + np.sqrt(unit) * 4 ** (1 / 3)
    return np.fmin(at_load, at_grips)


def radius_by_newton(displacement, stiffness, work, sphere_radius, modulus):
    """Newton's method on whole arrays from the right; nan where the slope vanishes before a root is met."""
    c6, c4, c3, c1 = coefficients(stiffness, work, sphere_radius, modulus)
    x = right_of_root(displacement, stiffness, work, sphere_radius, modulus)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(60):
            square = x * x
            quartic = x * (c6 * square + c4)
            value = x * (square * (quartic - c3) - c1) - displacement
            slope = square * (x * (6 * c6 * square + 4 * c4) - 3 * c3) - c1
            move = value / slope
            x = np.where(slope > 0, x - move, np.nan)
            if not np.any(move > 1e-15 * x):
                break
    return x * x


def radius_by_find_root(displacement, stiffness, work, sphere_radius, modulus, fold):
    """scipy's bracketing solver for arrays, from the fold, which is given to it, to the bound on the right."""

    def excess(x, displacement, c6, c4, c3, c1):
        square = x * x
        return x * (square * (x * (c6 * square + c4) - c3) - c1) - displacement

    bounds = np.sqrt(fold), right_of_root(displacement, stiffness, work, sphere_radius, modulus)
    known = (displacement, *coefficients(stiffness, work, sphere_radius, modulus))
    found = elementwise.find_root(excess, bounds, args=known)
    return found.x**2


def exact_radius(displacement, stiffness, work, sphere_radius, modulus):
    """The radius to fifty digits, by Newton's method from the right."""
    displacement, stiffness, work, sphere_radius, modulus = map(
        mpmath.mpf, map(float, (displacement, stiffness, work, sphere_radius, modulus))
    )
    c6, c4 = 4 * modulus / (3 * sphere_radius * stiffness), 1 / sphere_radius
    c3, c1 = mpmath.sqrt(8 * mpmath.pi * work * modulus) / stiffness, mpmath.sqrt(2 * mpmath.pi * work / modulus)
    x = mpmath.mpf(1)
    while True:
        value = x * (x**2 * (x * (c6 * x**2 + c4) - c3) - c1) - displacement
        lower = x - value / (x**2 * (x * (6 * c6 * x**2 + 4 * c4) - 3 * c3) - c1)
        if not lower < x * (1 - mpmath.mpf(10) ** -45):
            return x * x
        x = lower


def exact_radius_at_load(load, work, sphere_radius, modulus):
    load, work, sphere_radius, modulus = map(mpmath.mpf, map(float, (load, work, sphere_radius, modulus)))
    pull = 3 * mpmath.pi * work * sphere_radius
    return mpmath.cbrt(3 * sphere_radius / (4 * modulus) * (load + pull + mpmath.sqrt(pull * (2 * load + pull))))


def error(program: Callable, exact: Callable, *states) -> float:
    """Largest relative error of a program for the first 200 adhesive states that have an equilibrium."""
    radii = program()
    some = np.flatnonzero((states[-1] > 0) & np.isfinite(radii))[:200]
    with mpmath.workdps(50):
        return max(
            float(abs(radii[i] / exact(*[state[i] for state in states], SPHERE_RADIUS, MODULUS) - 1)) for i in some
        )


def at_load(compare: Callable) -> list:
    """The closed form at a load."""
    rows = []
    for count, repeats in ((1000, 200), (1_000_000, 1)):
        random = np.random.default_rng(1)
        states = random.uniform(-1e-4, 4e-3, count), random.uniform(-1e-3, 42e-3, count)
        known = (*states, SPHERE_RADIUS, MODULUS)
        ours = lambda known=known: jkr.radius_at_load(*known)  # noqa: E731
        plain = lambda known=known: radius_at_load(*known)  # noqa: E731
        errors = [error(program, exact_radius_at_load, *states) for program in (ours, plain)]
        names = [f"laws.jkr at a load, {count:,} radii ({errors[0]:.0e})", f"numpy closed form ({errors[1]:.0e})"]
        rows.append(compare(names[0], ours, names[1], plain, "1.5 or more", repeats))
    return rows


def behind_machine(compare: Callable) -> list:
    """A displacement behind machines from a tenth of the contact's stiffness to a hundred times."""
    rows = []
    for count, repeats in ((1000, 40), (100_000, 1)):
        random = np.random.default_rng(2)
        states = (
            random.uniform(-1e-6, 8e-6, count), 10 ** random.uniform(1, 4, count), random.uniform(-1e-3, 42e-3, count),
        )  # fmt: skip
        known = (*states, SPHERE_RADIUS, MODULUS)
        fold = jkr.pull_off_at_stiffness(*known[1:]).radius
        ours = lambda known=known: jkr.radius_at_displacement(*known)  # noqa: E731
        newton = lambda known=known: radius_by_newton(*known)  # noqa: E731
        scipys = lambda known=known, fold=fold: radius_by_find_root(*known, fold)  # noqa: E731
        mine = f"laws.jkr behind a machine, {count:,} radii ({error(ours, exact_radius, *states):.0e})"
        for name, program, promise in (
            ("numpy Newton", newton, "4 or more"),
            ("scipy find_root", scipys, "10 or more"),
        ):
            theirs = f"{name} ({error(program, exact_radius, *states):.0e})"
            rows.append(compare(mine, ours, theirs, program, promise, repeats, max(1, repeats // 10)))
    return rows


def rows(compare: Callable) -> list:
    """All comparisons; the number in brackets is the largest relative error of the radius."""
    return at_load(compare) + behind_machine(compare)
