"""JKR and Hertz: closed states, twenty decades against fifty digits, the folds, the potentials.

Tolerances: u = 2^-53 is the unit roundoff. Let d be the relative distance of a load or indentation
from its fold. The fold itself carries a few u (products, pi, a cube root: at most 4 u for the load,
11 u for the indentation), which sqrt(d) turns into a relative error of the radius of
(4/3) u/sqrt(d) and 8 u/sqrt(d); elsewhere some ten roundings remain. That is below 1e-12 from
d = 1e-6 on.
"""

import itertools
import math

import mpmath
import numpy as np
from hypothesis import example, given, settings, strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from sim.laws import jkr

U = 2.0**-53
MAUGIS = {"work": 1.0 / math.pi, "sphere_radius": 1.0, "modulus": 0.75}
LENS = {"work": 0.042, "sphere_radius": 2e-3, "modulus": 6.4e6}

decades = st.floats(-10.0, 10.0).map(lambda power: 10.0**power)
magnitudes = st.tuples(decades, st.sampled_from([-1.0, 1.0])).map(math.prod)
distances = st.floats(-12.0, -2.0).map(lambda power: 10.0**power)


def exact_radius_at_load(load, work, sphere_radius, modulus):
    """Fifty digits; None where no equilibrium exists."""
    with mpmath.workdps(50):
        load, work, sphere_radius, modulus = map(
            mpmath.mpf, (load, work, sphere_radius, modulus)
        )
        c = 3 * mpmath.pi * work * sphere_radius
        if 2 * load + c < 0:
            return None
        return mpmath.cbrt(
            3
            * sphere_radius
            / (4 * modulus)
            * (load + c + mpmath.sqrt(c * (2 * load + c)))
        )


def exact_radius_at_indentation(indentation, work, sphere_radius, modulus):
    """The larger root of the quartic in sqrt(a) in fifty digits, 1e-40 at the fold; None if there is none."""
    with mpmath.workdps(50):
        indentation, work, sphere_radius, modulus = map(
            mpmath.mpf, (indentation, work, sphere_radius, modulus)
        )
        c = sphere_radius * mpmath.sqrt(2 * mpmath.pi * work / modulus)
        d = indentation * sphere_radius
        low, x = mpmath.cbrt(c / 4), mpmath.cbrt(c) + mpmath.root(abs(d), 4)
        if low**4 - c * low - d > 0:
            return None
        change = x
        # from the right of a convex curve Newton comes down on its root
        while abs(change) > mpmath.mpf(10) ** -40 * x:
            change = (x**4 - c * x - d) / (4 * x**3 - c)
            x -= change
        return x**2


STATES = [  # radius, load, indentation in Maugis units
    (6.0 ** (1 / 3), 0.0, 6.0 ** (2 / 3) / 3.0),
    ((8.0 / 3.0) ** (1 / 3), -4.0 / 3.0, 0.0),
    (1.5, -9.0 / 8.0, 0.25),
    (8.0 / 3.0, 224.0 / 27.0, 40.0 / 9.0),
    (6.0, 180.0, 32.0),
]
FOLD_AT_LOAD = (1.5 ** (1 / 3), -1.5, -(1.5 ** (2 / 3)) / 3.0)
FOLD_AT_GRIPS = (6.0 ** (-1 / 3), -5.0 / 6.0, -3.0 * 6.0 ** (-2 / 3))
ONLY_AT_GRIPS = (2.0 / 3.0, -28.0 / 27.0, -8.0 / 9.0)


def test_radius_load_indentation_and_fold_of_the_known_states():
    radius, load, indentation = np.transpose(STATES)
    assert_allclose(jkr.radius_at_load(load, **MAUGIS), radius, rtol=1e-12, atol=0)
    assert_allclose(
        jkr.radius_at_indentation(indentation, **MAUGIS), radius, rtol=1e-12, atol=0
    )
    # a neck that no load holds is stable at an indentation
    radius, load, indentation = ONLY_AT_GRIPS
    assert_allclose(
        jkr.radius_at_indentation(indentation, **MAUGIS), radius, rtol=1e-12, atol=0
    )
    assert jkr.radius_at_load(load, **MAUGIS) > 1.1 * radius
    for solve, fold, (radius, *levels) in [
        (jkr.radius_at_load, jkr.pull_off_load(MAUGIS["work"], 1.0), FOLD_AT_LOAD),
        (jkr.radius_at_indentation, jkr.pull_off_indentation(**MAUGIS), FOLD_AT_GRIPS),
    ]:
        assert_allclose(
            fold, levels[solve is jkr.radius_at_indentation], rtol=1e-12, atol=0
        )
        assert_allclose(solve(fold, **MAUGIS), radius, rtol=1e-12, atol=0)
        assert np.isnan(solve(np.nextafter(fold, -9.0), **MAUGIS))
    radius, load, indentation = np.transpose(
        [*STATES, FOLD_AT_LOAD, FOLD_AT_GRIPS, ONLY_AT_GRIPS]
    )
    # atol: zero load and zero indentation are differences of numbers of order one
    assert_allclose(jkr.load_at_radius(radius, **MAUGIS), load, rtol=1e-12, atol=1e-14)
    assert_allclose(
        jkr.indentation_at_radius(radius, **MAUGIS), indentation, rtol=1e-12, atol=1e-14
    )


@settings(max_examples=300, deadline=None)
@given(
    level=magnitudes,
    distance=distances,
    work=decades,
    sphere_radius=decades,
    modulus=decades,
)
@example(level=5e-4, distance=1e-12, work=0.042, sphere_radius=2e-3, modulus=6.4e6)
@example(level=-1e-10, distance=1e-12, work=0.05, sphere_radius=1e-8, modulus=1e10)
@example(level=1e10, distance=1e-12, work=1e-10, sphere_radius=1e10, modulus=1e10)
@example(level=1e-10, distance=1e-12, work=1e10, sphere_radius=1e10, modulus=1e-10)
def test_radii_over_twenty_decades_with_half_of_the_digits_lost_near_the_fold(
    level, distance, work, sphere_radius, modulus
):
    rest = {"work": work, "sphere_radius": sphere_radius, "modulus": modulus}
    for solve, exact_radius, fold, amplification in [
        (
            jkr.radius_at_load,
            exact_radius_at_load,
            -1.5 * math.pi * work * sphere_radius,
            2.0,
        ),
        (
            jkr.radius_at_indentation,
            exact_radius_at_indentation,
            float(jkr.pull_off_indentation(**rest)),
            8.0,
        ),
    ]:
        for at in (level, fold * (1.0 - distance)):
            computed, exact = float(solve(at, **rest)), exact_radius(at, **rest)
            nearness = max(abs((at - fold) / fold), 1e-300)
            if nearness < 1e-13:
                continue
            if exact is None:
                assert math.isnan(computed)
            else:
                assert abs(
                    computed / exact - 1
                ) < 20.0 * U + amplification * U / math.sqrt(nearness)


def test_the_solution_releases_the_work_is_stable_and_has_two_views_of_one_contact():
    load, indentation, work, sphere_radius, modulus = random_states()
    for solve, release, level in [
        (jkr.radius_at_load, jkr.energy_release_rate, load),
        (
            jkr.radius_at_indentation,
            jkr.energy_release_rate_at_indentation,
            indentation,
        ),
    ]:
        radius = solve(level, work, sphere_radius, modulus)
        # P_H - P and a^2/R - delta are small beside their terms by up to (beyond)^(1/2) and ^(3/4)
        assert_allclose(
            release(radius, level, sphere_radius, modulus), work, rtol=1e-12, atol=0
        )
        assert np.all(
            release(radius * (1.0 + 1e-4), level, sphere_radius, modulus) > work
        )
        assert np.all(
            release(radius * (1.0 - 1e-4), level, sphere_radius, modulus) < work
        )
        assert np.all(
            radius[level > 0.0]
            >= solve(level, 0.0, sphere_radius, modulus)[level > 0.0]
        )
    load, _, work, sphere_radius, modulus = random_states()
    a = jkr.radius_at_load(load, work, sphere_radius, modulus)
    indentation = jkr.indentation_under_load(a, load, sphere_radius, modulus)
    scale = a**2 / sphere_radius
    gap = jkr.indentation_at_radius(a, work, sphere_radius, modulus) - indentation
    assert np.max(np.abs(gap / scale)) < 1e-12
    back = jkr.load_under_indentation(a, indentation, sphere_radius, modulus)
    assert np.max(np.abs((back - load) / (modulus * a * scale))) < 1e-12
    assert_allclose(
        jkr.energy_release_rate_at_indentation(a, indentation, sphere_radius, modulus),
        work,
        rtol=1e-11,
        atol=0,
    )


def random_states(count=200, seed=8):
    """Works, spheres and moduli over twenty decades, with stable loads and indentations."""
    rng = np.random.default_rng(seed)
    work, sphere_radius, modulus = 10.0 ** rng.uniform(-10, 10, (3, count))
    beyond = rng.choice([-1.0, 1.0], count) * 10.0 ** rng.uniform(-2, 3, count)
    beyond = np.maximum(beyond, -0.9)
    load = -jkr.pull_off_load(work, sphere_radius) * beyond
    indentation = -jkr.pull_off_indentation(work, sphere_radius, modulus) * beyond
    return load, indentation, work, sphere_radius, modulus


def test_hertz_is_the_radius_at_vanishing_no_or_negative_work():
    work, load, a = (
        np.array([[0.0], [-0.0], [-1e-12], [-3.0], [-1e10]]),
        np.array([0.0, 1e-12, 1.0, 1e12]),
        1e-4,
    )
    at_load = jkr.radius_at_load(load, work, 2e-3, 6.4e6)
    assert_array_equal(at_load, [jkr.hertz_radius_at_load(load, 2e-3, 6.4e6)] * 5)
    at_indentation = jkr.radius_at_indentation(load, work, 2e-3, 6.4e6)
    assert_array_equal(
        at_indentation, [jkr.hertz_radius_at_indentation(load, 2e-3)] * 5
    )
    assert np.all(at_load[:, 0] == 0.0)
    assert np.all(np.isnan(jkr.radius_at_load(-1e-12, work, 2e-3, 6.4e6)))
    assert np.all(np.isnan(jkr.radius_at_indentation(-1e-12, work, 2e-3, 6.4e6)))
    assert np.all(jkr.pull_off_load(work, 2e-3) == 0.0)
    assert np.all(jkr.pull_off_indentation(work, 2e-3, 6.4e6) == 0.0)
    assert_allclose(
        jkr.load_at_radius(a, work, 2e-3, 6.4e6),
        4 * 6.4e6 * a**3 / 6e-3,
        rtol=1e-14,
        atol=0,
    )
    assert_allclose(
        jkr.indentation_at_radius(a, work, 2e-3, 6.4e6), a**2 / 2e-3, rtol=1e-14, atol=0
    )
    load, indentation = 4e-3, 5e-6
    hertz = (
        jkr.hertz_radius_at_load(load, 2e-3, 6.4e6),
        jkr.hertz_radius_at_indentation(indentation, 2e-3),
    )
    assert_allclose(
        hertz, [(3 * load * 2e-3 / (4 * 6.4e6)) ** (1 / 3), 1e-4], rtol=1e-14, atol=0
    )
    for work in (1e-30, 1e-100, 1e-300, 5e-324):
        assert_allclose(
            jkr.radius_at_load(load, work, 2e-3, 6.4e6), hertz[0], rtol=1e-12, atol=0
        )
        assert_allclose(
            jkr.radius_at_indentation(indentation, work, 2e-3, 6.4e6),
            hertz[1],
            rtol=1e-12,
            atol=0,
        )
    # to first order the radius exceeds Hertz's by the square root of the work
    small = jkr.radius_at_indentation(indentation, 1e-14, 2e-3, 6.4e6) / hertz[1] - 1.0
    first_order = math.sqrt(2 * math.pi * 1e-14 * 1e-4 / 6.4e6) * 2e-3 / (2 * 1e-4**2)
    assert_allclose(small, first_order, rtol=2.0 * first_order, atol=0)


def test_no_input_raises_or_hangs():
    special = [0.0, -1.0, 1.0, math.inf, -math.inf, math.nan, 1e-300, 1e300, 5e-324]
    cases = np.array(list(itertools.product(special, repeat=4)))
    decisive = np.isnan(cases[:, :2]).any(axis=1)
    for solve in (jkr.radius_at_load, jkr.radius_at_indentation):
        assert np.all(np.isnan(solve(*cases.T)[decisive]))
        assert solve(math.inf, 0.042, 2e-3, 6.4e6) == math.inf
        assert np.all(np.isnan(solve([-math.inf, 1.0], 0.042, 2e-3, [6.4e6, math.nan])))


POTENTIAL = {"stress": 0.7, "work": 0.9, "sphere_radius": 1.7, "modulus": 1.3}
NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)


def integral(function, low, high):
    """Gauss-Legendre: exact for the polynomials here, converged for the inverse powers."""
    middle, half = (low + high) / 2, (high - low) / 2
    return half * np.sum(WEIGHTS * function(middle + half * NODES))


def test_the_potentials_are_legendre_transforms_with_their_slopes_and_forces():
    for potential, slope, control in [
        (jkr.potential_at_indentation, jkr.potential_slope_at_indentation, -0.8),
        (jkr.potential_at_indentation, jkr.potential_slope_at_indentation, 0.3),
        (jkr.potential_at_load, jkr.potential_slope_at_load, -2.1),
        (jkr.potential_at_load, jkr.potential_slope_at_load, 1.4),
    ]:
        gained = integral(lambda a: slope(control, radius=a, **POTENTIAL), 0.8, 1.9)
        difference = potential(control, radius=1.9, **POTENTIAL) - potential(
            control, radius=0.8, **POTENTIAL
        )
        assert_allclose(gained, difference, rtol=1e-12, atol=0)
    # the potential is quadratic in s: its mid-slope is exact
    middle, low, high = 0.1, -0.6, 0.8
    force = -jkr.load_under_indentation(
        1.2, -middle, POTENTIAL["sphere_radius"], POTENTIAL["modulus"]
    )
    gained = jkr.potential_at_indentation(
        high, radius=1.2, **POTENTIAL
    ) - jkr.potential_at_indentation(low, radius=1.2, **POTENTIAL)
    assert_allclose(force * (high - low), gained, rtol=1e-12, atol=0)
    for force in [-2.0, 0.4]:
        radius = np.linspace(0.5, 2.0, 7)
        separation = -jkr.indentation_under_load(
            radius, -force, POTENTIAL["sphere_radius"], POTENTIAL["modulus"]
        )
        at_grips = jkr.potential_at_indentation(separation, radius=radius, **POTENTIAL)
        at_load = jkr.potential_at_load(force, radius=radius, **POTENTIAL)
        scale = np.abs(at_grips) + np.abs(force * separation)
        assert np.max(np.abs(at_load - (at_grips - force * separation)) / scale) < 1e-12


def test_a_uniform_stress_of_any_size_leaves_the_jkr_contact():
    for stress in [0.0, 1e5, 1e7]:
        load, indentation = 2e-3, 3e-6
        for slope, control, radius in (
            (jkr.potential_slope_at_load, -load, jkr.radius_at_load(load, **LENS)),
            (
                jkr.potential_slope_at_indentation,
                -indentation,
                jkr.radius_at_indentation(indentation, **LENS),
            ),
        ):
            done = -12.0 * stress**2 * radius**2 / LENS["modulus"]
            scale = abs(done) + 2.0 * math.pi * LENS["work"] * radius
            assert abs(slope(control, stress, radius, **LENS) - done) / scale < 1e-12
