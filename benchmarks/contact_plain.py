"""The contact radius as a user of numpy would compute it on whole arrays, and to fifty digits."""

import mpmath
import numpy as np


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
    return (
        c6,
        c4,
        np.sqrt(8 * np.pi * work * modulus) / stiffness,
        np.sqrt(2 * np.pi * work / modulus),
    )


def right_of_root(displacement, stiffness, work, sphere_radius, modulus):
    """A square root of the radius that is too large: no indentation or load is below its pull-off value."""
    unit = np.cbrt(np.pi * np.maximum(work, 0.0) * sphere_radius**2 / (8 * modulus))
    load = stiffness * (displacement + 3 * unit**2 / sphere_radius)
    depth = (
        displacement + 1.5 * np.pi * np.maximum(work, 0.0) * sphere_radius / stiffness
    )
    at_load = np.sqrt(radius_at_load(load, work, sphere_radius, modulus))
    at_grips = np.maximum(sphere_radius * depth, 0.0) ** 0.25 + np.sqrt(unit) * 4 ** (
        1 / 3
    )
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


def exact_radius(displacement, stiffness, work, sphere_radius, modulus):
    """The radius to fifty digits, by Newton's method from the right."""
    displacement, stiffness, work, sphere_radius, modulus = map(
        mpmath.mpf, map(float, (displacement, stiffness, work, sphere_radius, modulus))
    )
    c6, c4 = 4 * modulus / (3 * sphere_radius * stiffness), 1 / sphere_radius
    c3, c1 = (
        mpmath.sqrt(8 * mpmath.pi * work * modulus) / stiffness,
        mpmath.sqrt(2 * mpmath.pi * work / modulus),
    )
    x = mpmath.mpf(1)
    while True:
        value = x * (x**2 * (x * (c6 * x**2 + c4) - c3) - c1) - displacement
        lower = x - value / (x**2 * (x * (6 * c6 * x**2 + 4 * c4) - 3 * c3) - c1)
        if not lower < x * (1 - mpmath.mpf(10) ** -45):
            return x * x
        x = lower


def exact_radius_at_load(load, work, sphere_radius, modulus):
    load, work, sphere_radius, modulus = map(
        mpmath.mpf, map(float, (load, work, sphere_radius, modulus))
    )
    pull = 3 * mpmath.pi * work * sphere_radius
    return mpmath.cbrt(
        3
        * sphere_radius
        / (4 * modulus)
        * (load + pull + mpmath.sqrt(pull * (2 * load + pull)))
    )
