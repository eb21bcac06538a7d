"""The contact behind a spring: closed states, thirty decades of stiffness, the fold, any input.

Tolerances: u = 2^-53. The displacement of the fold carries some ten roundings (products, pi, a cube root, the
two terms of F), at most 16 u. At a relative distance d from the fold, t = sqrt(|F_f| d/f_2), so that a
relative error e of it moves the radius by e sqrt(|F_f|/f_2)/(x_f sqrt(d)) <= 0.71 e/sqrt(d): 12 u/sqrt(d).
Elsewhere some ten roundings remain, 20 u. Wider arithmetic here is numpy's longdouble, which has room for these
bounds on some systems only, and fifty digits of mpmath on all.
"""

import math

import mpmath
import numpy as np
import pytest
from helpers.cases import some
from hypothesis import example, given, settings, strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sim.laws import jkr
from tests.laws.test_jkr import LENS, MAUGIS, STATES, U, decades

WIDE = np.longdouble
PI = WIDE("3.14159265358979323846264338327950288")


stiffer = st.floats(-15.0, 15.0).map(lambda power: 10.0**power)
distances = st.floats(-12.0, 12.0).map(lambda power: 10.0**power)


def contact_stiffness(work, sphere_radius, modulus):
    """Of the contact where fixed grips end, 4 E* a/3: the unit of the dimensionless stiffness."""
    return (
        4.0
        / 3.0
        * modulus
        * np.cbrt(math.pi * work * sphere_radius * (sphere_radius / (8.0 * modulus)))
    )


def exact(displacement, stiffness, work, sphere_radius, modulus):
    """Radius and displacement of the fold in fifty digits, solved to forty; no radius beyond the fold."""
    with mpmath.workdps(50):
        displacement, stiffness, work, sphere_radius, modulus = map(
            mpmath.mpf, (displacement, stiffness, work, sphere_radius, modulus)
        )

        def needed(x):  # the displacement of the equilibrium of radius x^2
            indentation = (
                x**4 / sphere_radius - mpmath.sqrt(2 * mpmath.pi * work / modulus) * x
            )
            load = (
                4 * modulus * x**6 / (3 * sphere_radius)
                - mpmath.sqrt(8 * mpmath.pi * work * modulus) * x**3
            )
            return indentation + load / stiffness

        def slope(x):
            indentation = 4 * x**3 / sphere_radius - mpmath.sqrt(
                2 * mpmath.pi * work / modulus
            )
            load = (
                8 * modulus * x**5 / sphere_radius
                - 3 * mpmath.sqrt(8 * mpmath.pi * work * modulus) * x**2
            )
            return indentation + load / stiffness

        def bend(x):
            load = (
                40 * modulus * x**4 / sphere_radius
                - 6 * mpmath.sqrt(8 * mpmath.pi * work * modulus) * x
            )
            return 12 * x**2 / sphere_radius + load / stiffness

        unit = mpmath.sqrt(
            mpmath.cbrt(mpmath.pi * work * sphere_radius**2 / (8 * modulus))
        )
        last = from_the_right(slope, bend, 1.5 * unit, 0)
        if needed(last) > displacement:
            return None, needed(last)
        high = 2 * last
        while needed(high) < displacement:
            high *= 4
        return from_the_right(needed, slope, high, displacement) ** 2, needed(last)


def from_the_right(function, slope, x, target):
    """Where a convex function rises to a target, by Newton's method from above, which comes down on it."""
    change = x
    while abs(change) > mpmath.mpf(10) ** -40 * x:
        change = (function(x) - target) / slope(x)
        x -= change
    return x


class Wide:
    """The sextic of a batch of contacts in wider arithmetic, and where it folds."""

    def __init__(self, displacement, stiffness, work, sphere_radius, modulus):
        displacement, k, work, sphere_radius, modulus = (
            value.astype(WIDE)
            for value in (displacement, stiffness, work, sphere_radius, modulus)
        )
        self.unit = np.cbrt(PI * work * sphere_radius * sphere_radius / (8 * modulus))
        self.depth = self.unit * self.unit / sphere_radius
        self.contact = 4 * modulus * self.unit / 3
        self.grips, self.load = 1 / (1 + self.contact / k), 1 / (1 + k / self.contact)
        self.level = self.grips * displacement / self.depth
        x = np.full(displacement.shape, 1.45, WIDE)
        for _ in range(9):  # from 3^(1/3) at most, quadratically
            slope = 4 * self.grips * (x**3 - 1) + 6 * self.load * x * x * (x**3 - 3)
            x = x - slope / (12 * self.grips * x * x + self.load * x * (30 * x**3 - 36))
        self.fold = x
        self.distance = 1 - self.level / self.of(x)

    def of(self, x):
        return self.grips * x * (x**3 - 4) + self.load * x**3 * (x**3 - 6)

    def check(self, radius, some):
        """Where ``some``: nan beyond the fold, and else the stable root, enclosed within the tolerance."""
        x = np.sqrt(radius.astype(WIDE) / self.unit)
        # of the square root of the radius
        room = 10 * U + 6 * U / np.sqrt(np.abs(self.distance))
        pulled, held = some & (self.distance < -16 * U), some & (self.distance > 16 * U)
        assert np.all(np.isnan(radius[pulled]))
        assert np.all(x[held] >= (self.fold * (1 - room))[held])
        assert np.all((self.of(x * (1 + room)) >= self.level)[held])
        assert np.all(
            (self.of(np.maximum(x * (1 - room), self.fold)) <= self.level)[held]
        )
        return np.count_nonzero(pulled), np.count_nonzero(held)


def test_the_known_states_behind_every_spring_and_the_square_root_that_leaves_the_fold():
    # stiffness, radius, load, indentation in Maugis units
    for stiffness, radius, load, indentation in [
        (0.1, 1.1158490441960518, -1.4978810906181386, -0.4798729253858034),
        (1.0, 0.9193831489469452, -1.3822142978356529, -0.7205214554932008),
        (5.0, 2.0 / 3.0, -28.0 / 27.0, -8.0 / 9.0),
        (100.0, 0.5563776200249634, -0.8443231195694288, -0.9085053764583243),
        (math.inf, 6.0 ** (-1 / 3), -5.0 / 6.0, -3.0 * 6.0 ** (-2 / 3)),
    ]:
        displacement = jkr.pull_off_displacement(stiffness, **MAUGIS)
        assert_allclose(
            displacement, indentation + load / stiffness, rtol=1e-12, atol=0
        )
        assert_allclose(
            jkr.radius_at_displacement(displacement, stiffness, **MAUGIS),
            radius,
            rtol=1e-12,
            atol=0,
        )
        assert np.isnan(
            jkr.radius_at_displacement(
                np.nextafter(displacement, -9e9), stiffness, **MAUGIS
            )
        )
    radius, load, indentation = np.transpose(STATES)
    stiffness = np.array([[1e-3], [0.1], [1.0], [5.0], [100.0], [1e6], [math.inf]])
    computed = jkr.radius_at_displacement(
        indentation + load / stiffness, stiffness, **MAUGIS
    )
    assert_allclose(computed, [radius] * 7, rtol=1e-12, atol=0)
    # the rational point (2/3, -28/27, -8/9) is the fold at stiffness 5: stable for stiffer springs only
    stiffness = np.array([5.5, 10.0, 1e3, math.inf])
    neck = jkr.radius_at_displacement(
        -8.0 / 9.0 - 28.0 / 27.0 / stiffness, stiffness, **MAUGIS
    )
    assert_allclose(neck, 2.0 / 3.0, rtol=1e-12, atol=0)
    assert (
        jkr.radius_at_displacement(-8.0 / 9.0 - 28.0 / 27.0 / 4.0, 4.0, **MAUGIS) > 0.7
    )
    distance = 10.0 ** np.arange(-12, -1, 2)
    for stiffness in [0.1, 5.0, 100.0, math.inf]:
        last = jkr.pull_off_displacement(stiffness, **MAUGIS)
        radius = float(jkr.radius_at_displacement(last, stiffness, **MAUGIS))
        wider = (
            jkr.radius_at_displacement(last * (1.0 - distance), stiffness, **MAUGIS)
            - radius
        )
        # second derivative of the displacement a^2 - 2/3 sqrt(6a) + (a^3 - sqrt(6 a^3))/k at the fold
        bend = 2.0 + math.sqrt(6.0) / 6.0 * radius**-1.5
        bend += (6.0 * radius - 0.75 * math.sqrt(6.0 / radius)) / stiffness
        # the next term is smaller by about wider/radius; the rounding of the fold by 16 U/distance
        room = 2.0 * wider / radius + 20.0 * U / distance
        assert np.all(
            np.abs(wider / np.sqrt(-2.0 * last * distance / bend) - 1.0) < room
        )


def test_an_infinite_stiffness_is_an_indentation_and_a_soft_or_no_spring_a_load():
    random = np.random.default_rng(4)
    work, sphere_radius, modulus = 10.0 ** random.uniform(-10, 10, (3, 10_000))
    last = jkr.pull_off_indentation(work, sphere_radius, modulus)
    indentation = last * (
        1.0 - random.choice([-1.0, 1.0], 10_000) * 10.0 ** random.uniform(-6, 6, 10_000)
    )
    computed = jkr.radius_at_displacement(
        indentation, math.inf, work, sphere_radius, modulus
    )
    at_grips = jkr.radius_at_indentation(indentation, work, sphere_radius, modulus)
    assert_allclose(computed, at_grips, rtol=40 * U + 24 * U * 1e3, atol=0)
    far = indentation > 0.5 * last
    assert_allclose(
        computed[far], at_grips[far], rtol=40 * U + 24 * U / math.sqrt(0.5), atol=0
    )
    assert_allclose(
        jkr.pull_off_displacement(math.inf, work, sphere_radius, modulus),
        last,
        rtol=20 * U,
        atol=0,
    )
    # kΔ kept, the indentation adds k δ/P to the load: 1e-15 of it where the spring is that soft
    load, stiffness = (
        np.array([-3.9e-4, -1e-4, 1e-4, 4e-3, 10.0]),
        1e-16 * contact_stiffness(**LENS),
    )
    computed = jkr.radius_at_displacement(load / stiffness, stiffness, **LENS)
    assert_allclose(computed, jkr.radius_at_load(load, **LENS), rtol=1e-13, atol=0)
    rest = jkr.radius_at_load(0.0, **LENS)
    displacement = np.array([-1e3, -1e-6, 0.0, 1e-6, 1e3])
    assert_allclose(
        jkr.radius_at_displacement(displacement, 0.0, **LENS), rest, rtol=20 * U, atol=0
    )
    assert_array_equal(
        jkr.radius_at_displacement(displacement, -0.0, **LENS),
        jkr.radius_at_displacement(displacement, 0.0, **LENS),
    )
    assert_array_equal(
        jkr.radius_at_displacement(displacement, 0.0, 0.0, 2e-3, 6.4e6), 0.0
    )
    assert np.isnan(jkr.radius_at_displacement(math.inf, 0.0, **LENS))
    assert jkr.pull_off_displacement(0.0, **LENS) == -math.inf


@settings(max_examples=100, deadline=None)
@given(
    distance=distances,
    soft=stiffer,
    work=decades,
    sphere_radius=decades,
    modulus=decades,
)
@example(distance=1e-12, soft=1e-15, work=0.05, sphere_radius=1e-8, modulus=1e10)
@example(distance=1e12, soft=1e15, work=0.042, sphere_radius=2e-3, modulus=6.4e6)
@example(distance=1.0, soft=1.0, work=1e-10, sphere_radius=1e10, modulus=1e10)
def test_radius_to_fifty_digits_with_half_of_them_lost_towards_the_fold(
    distance, soft, work, sphere_radius, modulus
):
    rest = {"work": work, "sphere_radius": sphere_radius, "modulus": modulus}
    stiffness = float(soft * contact_stiffness(**rest))
    last = float(jkr.pull_off_displacement(stiffness, **rest))
    displacement = last * (1.0 - distance)
    exact_radius, fold = exact(displacement, stiffness, **rest)
    assert abs(last / fold - 1) < 16 * U
    nearness = float((fold - displacement) / fold)
    if nearness < 1e-13:  # 1 - distance is rounded, too
        return
    error = float(
        abs(
            jkr.radius_at_displacement(displacement, stiffness, **rest) / exact_radius
            - 1
        )
    )
    assert error < 20 * U + 12 * U / math.sqrt(nearness)
    assert error < 1e-12 or nearness < 1e-5


def test_radius_at_no_or_negative_work_is_hertz_behind_the_spring():
    radius, stiffness = (
        np.logspace(-9, -2, 60),
        10.0 ** np.arange(-12, 19, 3)[:, np.newaxis],
    )
    displacement = radius**2 / 2e-3 + 4 * 6.4e6 * radius**3 / (6e-3 * stiffness)
    for work in [0.0, -0.0, -1e-12, -3.0, -1e10]:
        rest = stiffness, work, 2e-3, 6.4e6
        assert_allclose(
            jkr.radius_at_displacement(displacement, *rest),
            [radius] * 11,
            rtol=1e-14,
            atol=0,
        )
        assert np.all(np.isnan(jkr.radius_at_displacement(-1e-300, *rest)))
        assert np.all(jkr.radius_at_displacement(0.0, *rest) == 0.0)
        hertz = jkr.hertz_radius_at_indentation(displacement, 2e-3)
        hard = jkr.radius_at_displacement(displacement, math.inf, work, 2e-3, 6.4e6)
        assert_allclose(hard, hertz, rtol=20 * U, atol=0)
        assert jkr.pull_off_displacement(1e3, work, 2e-3, 6.4e6) == 0.0
    hertz = jkr.radius_at_displacement([1e-9, 5e-6, 1e-3], 1e3, 0.0, 2e-3, 6.4e6)
    # Hertz's is the limit of vanishing work
    for work in (1e-40, 1e-100, 1e-300, 5e-324):
        limit = jkr.radius_at_displacement([1e-9, 5e-6, 1e-3], 1e3, work, 2e-3, 6.4e6)
        assert_allclose(limit, hertz, rtol=1e-12, atol=0)
        assert np.isnan(jkr.radius_at_displacement(-1e-6, 1e3, work, 2e-3, 6.4e6))


def test_a_contact_of_any_radius_shares_displacement_and_release_rate_with_the_spring():
    random = np.random.default_rng(10)
    radius, displacement = (
        10.0 ** random.uniform(-5, -3, 1000),
        random.uniform(-1e-5, 1e-5, 1000),
    )
    stiffness = 10.0 ** random.uniform(-8, 18, 1000)
    load = jkr.load_under_displacement(radius, displacement, stiffness, 2e-3, 6.4e6)
    indentation = jkr.indentation_under_displacement(
        radius, displacement, stiffness, 2e-3, 6.4e6
    )
    scale = np.abs(displacement) + radius**2 / 2e-3
    assert (
        np.max(np.abs(indentation + load / stiffness - displacement) / scale) < 10 * U
    )
    again = jkr.load_under_indentation(radius, indentation, 2e-3, 6.4e6)
    # load and indentation are both known to some u of their terms, the load at worst of p times the depths
    assert np.max(np.abs(again - load) / (2 * 6.4e6 * radius * scale)) < 10 * U
    random = np.random.default_rng(11)
    radius, displacement = (
        10.0 ** random.uniform(-5, -3, 1000),
        random.uniform(-1e-5, -1e-8, 1000),
    )
    # a lifting displacement: no differences of equal numbers
    stiffness = 10.0 ** random.uniform(-8, 18, 1000)
    rest = 2e-3, 6.4e6
    computed = jkr.energy_release_rate_at_displacement(
        radius, displacement, stiffness, *rest
    )
    indentation = jkr.indentation_under_displacement(
        radius, displacement, stiffness, *rest
    )
    load = jkr.load_under_displacement(radius, displacement, stiffness, *rest)
    assert_allclose(
        computed, jkr.energy_release_rate(radius, load, *rest), rtol=30 * U, atol=0
    )
    at_grips = jkr.energy_release_rate_at_indentation(radius, indentation, *rest)
    assert_allclose(computed, at_grips, rtol=1e-14, atol=0)
    for of_spring, of_indentation in [
        (
            jkr.energy_release_rate_at_displacement,
            jkr.energy_release_rate_at_indentation,
        ),
        (jkr.load_under_displacement, jkr.load_under_indentation),
        (
            jkr.indentation_under_displacement,
            lambda radius, displacement, *_: displacement,
        ),
    ]:
        hard = of_spring(radius, displacement, math.inf, *rest)
        assert_array_equal(hard, of_indentation(radius, displacement, *rest))
    soft = jkr.energy_release_rate_at_displacement(radius, displacement, 0.0, *rest)
    assert_allclose(
        soft, jkr.energy_release_rate(radius, 0.0, *rest), rtol=20 * U, atol=0
    )
    assert_array_equal(
        jkr.load_under_displacement(np.append(radius, 0.0), -1e-6, 0.0, *rest), 0.0
    )


def wild_inputs(count, seed):
    """Numbers of a laboratory, of the whole range of doubles and of its edges, of either sign."""
    random = np.random.default_rng(seed)
    edges = [0.0, -0.0, math.inf, math.nan, 5e-324, 1e-310, 2.3e-308, 1.7e308, 1.0]
    inputs = []
    for low, high in ((-9, -4), (-3, 9), (-6, 2), (-9, 1), (3, 11)):
        usual, any_size = (
            10.0 ** random.uniform(low, high, count),
            10.0 ** random.uniform(-323, 308, count),
        )
        kinds = random.choice(3, count, p=[0.6, 0.25, 0.15])
        value = np.choose(kinds, [usual, any_size, random.choice(edges, count)])
        inputs.append(np.where(random.random(count) < 0.15, -value, value))
    return inputs


def within_range(*values):
    return np.all(
        [
            (np.abs(value) > 1e-280) & (np.abs(value) < 1e280) | (value == 0)
            for value in values
        ],
        axis=0,
    )


def check_wild(count, seed):
    """Nothing raises, what has no meaning is nan, and where no scale leaves the range of doubles all is right."""
    inputs = displacement, stiffness, work, sphere_radius, modulus = wild_inputs(
        count, seed
    )
    radius = jkr.radius_at_displacement(*inputs)
    assert not np.any(radius < 0.0)
    proper = (
        (stiffness >= 0.0)
        & (sphere_radius > 0.0)
        & (modulus > 0.0)
        & ~np.isnan(displacement)
        & (work < math.inf)
    )
    assert np.all(np.isnan(radius[~proper]))
    bare = proper & (work <= 0.0) & (stiffness > 0.0)
    assert np.all(np.isnan(radius[bare & (displacement < 0.0)]))
    with np.errstate(all="ignore"):
        wide = Wide(*inputs)
        reach, hard = (
            sphere_radius / modulus.astype(WIDE),
            sphere_radius * modulus.astype(WIDE),
        )
        sized = within_range(
            displacement, work, modulus, reach, wide.unit**3, wide.depth, wide.contact
        )
        sized &= within_range(
            wide.grips, wide.level, displacement / wide.depth, wide.depth / wide.grips
        )
        sized &= within_range(work * sphere_radius.astype(WIDE))
        pulled, held = wide.check(radius, proper & sized & (work > 0.0))
        share, size = 1 / (1 + hard / stiffness), sphere_radius.astype(WIDE)
        bare &= within_range(
            displacement,
            modulus,
            sphere_radius,
            hard,
            share,
            share / size,
            share * displacement / size,
        )
        needed = (
            radius * (radius / size)
            + 4 * hard / (3 * stiffness.astype(WIDE)) * radius * (radius / size) ** 2
        )
    pressed = bare & (displacement > 0.0) & ~(radius < 1e-300)
    assert_allclose(
        (needed[pressed] / displacement[pressed]).astype(float), 1.0, rtol=1e-13, atol=0
    )
    assert np.all(radius[bare & (displacement == 0.0)] == 0.0)
    assert min(pulled, held, np.count_nonzero(bare)) > count // 100


@pytest.mark.parametrize(
    ("count", "seeds"),
    some([(100_000, (13,)), (500_000, range(100, 120))], (100_000, (13,))),
)
@pytest.mark.skipif(
    np.finfo(WIDE).nmant < 63,
    reason="longdouble has no more digits than float64 on this system",
)
def test_no_input_raises_or_hangs_or_gives_a_wrong_branch(count, seeds):
    for seed in seeds:
        check_wild(count, seed)
