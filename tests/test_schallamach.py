"""The steady bond law, the linear rate equation and its exact step."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from sim.laws.schallamach import (
    fraction_rate,
    relax_fraction,
    steady_fraction,
    transition_probabilities,
)

CRITICAL, HEALING = 1e-2, 200.0
EXPONENTS = 10.0 ** np.arange(-9, 10)  # rate x duration


def test_the_paper_s_fractions_at_one_and_ten_millimetres_per_second():
    assert_allclose(steady_fraction([1e-3, 1e-2], 1e-2), [10.0 / 11.0, 0.5], rtol=1e-15, atol=0)


def test_limits_of_the_steady_fraction():
    speed = np.array([0.0, -0.0, np.inf, -np.inf])
    assert_array_equal(steady_fraction(speed, 1e-2), [1.0, 1.0, 0.0, 0.0])
    assert steady_fraction(-3e-3, 1e-2) == steady_fraction(3e-3, 1e-2)
    assert np.isnan(steady_fraction(np.nan, 1e-2))
    assert steady_fraction(1.0, np.inf) == 1.0


@pytest.mark.parametrize("speed", [0.0, 1e-5, 1e-2, 10.0])
def test_the_steady_fraction_is_where_the_rate_vanishes(speed):
    steady = steady_fraction(speed, CRITICAL)
    flow = HEALING * (1.0 - steady) + HEALING * speed / CRITICAL * steady
    assert abs(fraction_rate(steady, speed, CRITICAL, HEALING)) <= 4e-16 * max(flow, HEALING)


@pytest.mark.parametrize("speed", [0.0, 3e-3, 0.5])
def test_the_step_solves_the_rate_equation(speed):
    duration = 4e-3
    exact = solve_ivp(
        lambda t, y: fraction_rate(y, speed, CRITICAL, HEALING), (0.0, duration), [0.3], rtol=1e-12, atol=1e-14
    )
    stepped = relax_fraction(0.3, speed * duration, duration, CRITICAL, HEALING)
    assert_allclose(stepped, exact.y[0, -1], rtol=1e-10, atol=0)


@pytest.mark.parametrize("start", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("ratio", [0.0, 1e-6, 0.2, 1e9])
def test_one_step_equals_seven_steps_of_a_seventh(start, ratio):
    duration = EXPONENTS / (HEALING * (1.0 + ratio))
    path = ratio * CRITICAL * duration
    once = relax_fraction(start, path, duration, CRITICAL, HEALING)
    parts = np.full_like(once, start)
    for _ in range(7):
        parts = relax_fraction(parts, path / 7.0, duration / 7.0, CRITICAL, HEALING)
    # nothing is left of bonds that opened e^-z ago: compare above the smallest normal number
    alive = once > 1e-300
    assert_allclose(parts[alive], once[alive], rtol=1e-12, atol=0)


@pytest.mark.parametrize("ratio", [0.0, 0.2, 1e9])
def test_a_step_keeps_the_steady_state_and_ends_in_it(ratio):
    duration = EXPONENTS / HEALING
    path = ratio * CRITICAL * duration
    steady = steady_fraction(ratio * CRITICAL, CRITICAL)
    assert_allclose(relax_fraction(steady, path, duration, CRITICAL, HEALING), steady, rtol=1e-13, atol=0)
    late = relax_fraction([0.0, 1.0], path[-1], duration[-1], CRITICAL, HEALING)
    assert_allclose(late, steady, rtol=1e-13, atol=0)


def test_a_short_step_is_the_rate_times_the_duration():
    duration = 1e-9 / HEALING
    gained = relax_fraction(0.0, 1e-3 * duration, duration, CRITICAL, HEALING)
    # the next term of the exponential is 1e-9 of the first
    assert_allclose(gained, fraction_rate(0.0, 1e-3, CRITICAL, HEALING) * duration, rtol=1e-9, atol=0)


def test_special_steps():
    assert relax_fraction(0.37, 0.0, 0.0, CRITICAL, HEALING) == 0.37
    assert relax_fraction(0.37, 1.0, 1.0, CRITICAL, 0.0) == 0.37
    jump = relax_fraction(0.5, 1e-5, 0.0, CRITICAL, HEALING)
    assert_allclose(jump, 0.5 * np.exp(-HEALING * 1e-5 / CRITICAL), rtol=1e-14, atol=0)
    assert relax_fraction(0.5, np.inf, 1.0, CRITICAL, HEALING) == 0.0
    assert np.isnan(relax_fraction(np.nan, 1e-5, 1e-3, CRITICAL, HEALING))


def test_transitions_are_those_of_the_two_state_generator():
    path, duration = 3e-5, 2e-3
    closing, opening = HEALING, HEALING * path / duration / CRITICAL
    values, vectors = np.linalg.eig(np.array([[-opening, closing], [opening, -closing]]))
    flow = (vectors * np.exp(values * duration)) @ np.linalg.inv(vectors)  # columns: from bound, from open
    stay, become = transition_probabilities(path, duration, CRITICAL, HEALING)
    assert_allclose([stay, become], flow[0], rtol=1e-12, atol=0)


def test_transitions_compose_to_the_exact_step_of_the_mean():
    stay, become = transition_probabilities(3e-5, 2e-3, CRITICAL, HEALING)
    mean = 0.3 * stay + 0.7 * become
    assert_allclose(mean, relax_fraction(0.3, 3e-5, 2e-3, CRITICAL, HEALING), rtol=1e-14, atol=0)
    for probability in transition_probabilities(EXPONENTS * CRITICAL, EXPONENTS, CRITICAL, HEALING):
        assert np.all((probability >= 0.0) & (probability <= 1.0))
