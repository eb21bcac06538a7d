"""The step of number and mean stretch: exact where it is linear, controlled under Bell's rate."""

import functools
import math
from itertools import product

import mpmath
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from sim.laws import schallamach as law
from sim.parts.bonds import mean_field
from sim.parts.bonds.mean_field import LOCAL_ERROR, steady
from sim.parts.bonds.rupture import RuptureRate

BELL = RuptureRate(1.0, 1.0, math.inf)
ULP = 2.0**-52
# an error of a stretch comes back in ln N multiplied by the fall of ln N, thirty at most here, and the errors of
# three sub-steps at a time are in memory
TRANSIENT = 100.0 * LOCAL_ERROR


def advance(bound, moment, slip, path, duration, rupture, rebinding):
    """The population after one step."""
    bound, moment, slip, path = (
        np.array(value, dtype=float, ndmin=1) for value in (bound, moment, slip, path)
    )
    steps = slip[np.newaxis], path[np.newaxis], np.array([float(duration)])
    bound, moment = mean_field.advance(bound, moment, *steps, rupture, rebinding)
    return bound[0], moment[0]


def resting(rupture, rebinding):
    return steady(0.0, rupture, rebinding)


def slide(state, speed, duration, rupture, rebinding, pieces=1):
    """Population after a time at constant speed, in equal steps."""
    part = duration / pieces
    for _ in range(pieces):
        state = advance(
            *state, speed * part, np.abs(speed) * part, part, rupture, rebinding
        )
    return state


@functools.cache
def propagator(slip, binding, breaking, displacement):
    """The matrix exponential of d(N, M, 1)/dt over a step as the unit of time, with 60 digits."""
    with mpmath.workdps(60):
        slip, binding, breaking, displacement = map(
            mpmath.mpf, (slip, binding, breaking, displacement)
        )
        bound = [-(binding + breaking + displacement), 0, binding]
        return mpmath.expm(
            mpmath.matrix([bound, [slip, -(breaking + 2 * displacement), 0], [0, 0, 0]])
        )


LINEAR = list(
    product(
        (0.0, 1e-9, 1e-3, 30.0, 1e9),
        (0.0, 1e-9, 1e-3, 0.02, 0.7, 1e9),
        (0.0, 1e-9, 0.7, 1e9),
    )
)


def test_a_linear_step_is_the_matrix_exponential_and_binds_no_more_than_all_sites():
    for start in [(0.0, 0.0), (0.6, 0.3), (1.0, 0.0), (1e-12, 1e-13)]:
        for rate, rebinding, displacement in LINEAR:
            slip = 0.37
            limit = slip / displacement if displacement else math.inf
            values = advance(
                *start, slip, slip, 1.0, RuptureRate(rate, 0.0, limit), rebinding
            )
            with mpmath.workdps(60):
                exact = propagator(slip, rebinding, rate, slip / limit) * mpmath.matrix(
                    [*map(mpmath.mpf, start), 1]
                )
            # an exponential of x knows x to one rounding of each term; more than 745 leaves nothing of it
            exponent = min(745.0, rebinding + rate + 2.0 * displacement)
            for value, truth in zip(values, map(float, exact[:2]), strict=True):
                if truth > 1e-290 or truth == 0.0:
                    assert_allclose(
                        value[0], truth, rtol=ULP * (16.0 + 2.0 * exponent), atol=0
                    )
                else:
                    assert 0.0 <= value[0] < 1e-289
    for exponent in np.linspace(0.01, 40.0, 3000):
        assert (
            advance(1.0, 0.0, 0.1, 0.1, 1.0, RuptureRate(0.0, 0.0, math.inf), exponent)[
                0
            ]
            <= 1.0
        )


def test_friction_of_a_cut_off_is_that_of_its_renewal_and_does_not_end_at_rest():
    # each bond lives l/V and carries l/2 on average, each free site waits 1/k_on
    limit, rebinding, speed = 2e-9, 50.0, np.array([1e-15, 1e-9, 1e-7, 1e-5])
    bound, moment = steady(speed, RuptureRate(0.0, 0.0, limit), rebinding)
    share = (limit / speed) / (limit / speed + 1.0 / rebinding)
    assert_allclose(bound, share, rtol=4 * ULP, atol=0)
    assert_allclose(moment, 0.5 * limit * share, rtol=4 * ULP, atol=0)
    rupture, speed = RuptureRate(0.0, 0.0, 2e-9), 1e-7
    state = slide(resting(rupture, 50.0), speed, 1.0, rupture, 50.0)
    held = slide(state, 0.0, 1e6, rupture, 50.0)
    assert_array_equal(held[1], state[1])
    assert_allclose(held[0], 1.0, rtol=ULP, atol=0)
    assert_allclose(
        slide(held, -1e-15, 1e9, rupture, 50.0)[1], -1e-9, rtol=1e-7, atol=0
    )
    assert steady(0.0, rupture, 50.0)[1] == 0.0
    bound, moment = advance(1.0, 1e-9, 0.0, 4e-9, 0.0, RuptureRate(0.0, 0.0, 2e-9), 5.0)
    assert_allclose(
        [bound[0], moment[0]],
        [math.exp(-2.0), 1e-9 * math.exp(-4.0)],
        rtol=4 * ULP,
        atol=0,
    )


def test_marching_comes_to_the_steady_state_of_lambert_s_w_which_any_step_keeps():
    for eps, beta in product([0.01, 1.0, 10.0, 1000.0], [0.1, 1.0, 10.0]):
        bound, moment = steady(eps, BELL, beta)
        for first, (duration, pieces) in product(
            [(np.zeros(1), np.zeros(1)), resting(BELL, beta), (bound, -moment)],
            [(100.0, 1), (60.0, 300), (1e9, 1)],
        ):
            assert_allclose(
                slide(first, eps, duration, BELL, beta, pieces),
                [bound, moment],
                rtol=1e-10,
                atol=0,
            )
    for duration, beta in product([1e-9, 1e-3, 1.0, 1e3, 1e9], [1e-6, 1.0, 1e6]):
        eps = np.array(
            [0.0, 1e-12, 9e-11, 1.1e-10, 1e-6, 0.1, 4.0, 1e3, 1e8, -1e-3, -30.0]
        )
        state = steady(eps, BELL, beta)
        # a stretch W known to one ulp leaves the rate e^W an error of W ulp
        stretch = np.max(lambertw(np.abs(eps)).real)
        assert_allclose(
            slide(state, eps, duration, BELL, beta),
            state,
            rtol=8.0 * ULP * (1.0 + stretch),
            atol=0,
        )
    for rupture in (BELL, RuptureRate(1.0, 0.0, math.inf), RuptureRate(0.0, 0.0, 1.0)):
        assert_array_equal(steady([0.0, 1.0, -2.0], rupture, 0.0), np.zeros((2, 3)))
        assert_array_equal(
            slide((np.zeros(1), np.zeros(1)), 2.0, 5.0, rupture, 0.0), np.zeros((2, 1))
        )
    eps, rate, softness = (
        np.concatenate([[0.0], 10.0 ** np.arange(-12.0, 13.0)]),
        3.0,
        2e9,
    )
    for beta in (1e-9, 1.0, 1e9):
        bound, moment = steady(
            eps * rate / softness, RuptureRate(rate, softness, math.inf), beta * rate
        )
        share = law.first_moment_fraction(eps, 1.0, 1.0, 1.0, beta) * law.rest_share(
            1.0, beta
        )
        force = law.first_moment_stress(eps, 1.0, 1.0, 1.0, beta, 1.0)
        assert_allclose([bound, softness * moment], [share, force], rtol=1e-13, atol=0)


def reference(bound, moment, speed, duration, beta):
    """ln N and the mean stretch by scipy, stopped where the stretch passes zero; another form of the equations."""

    def slope(time, state):
        fresh = beta * math.expm1(-state[0])
        return [fresh - math.exp(abs(state[1])), speed - state[1] * fresh]

    def through_zero(time, state):
        return state[1]

    through_zero.terminal = True
    state, time = [math.log(bound), moment / bound], 0.0
    while time < duration:
        watch = through_zero if state[1] * speed < 0.0 else None
        run = solve_ivp(
            slope,
            (time, duration),
            state,
            "LSODA",
            rtol=1e-11,
            atol=1e-12,
            events=watch,
        )
        time, state = run.t[-1], list(run.y[:, -1])
        if run.status == 1:
            state[1] = 0.0
    return math.exp(state[0]), math.exp(state[0]) * state[1]


def test_transients_are_those_of_an_integrator_of_another_form_from_the_first_bonds_on():
    for start, before, speed, beta, duration in [
        ("resting", 0.0, 10.0, 1.0, 1.0),
        ("resting", 0.0, 1e3, 1.0, 0.01),
        ("resting", 0.0, 1e6, 0.1, 2e-5),
        ("steady", 1e-3, 1e3, 1.0, 0.02),
        ("steady", 1e3, 1e-3, 1.0, 0.5),
        ("steady", 1e3, 0.0, 10.0, 2.0),
        ("steady", 30.0, -30.0, 3.0, 0.5),
        ("steady", 1e4, -0.01, 1.0, 3.0),
        ("steady", 0.1, -1e4, 1.0, 1e-3),
    ]:
        first = steady(before, BELL, beta) if start == "steady" else resting(BELL, beta)
        for share in (0.1, 1.0):
            exact = reference(first[0][0], first[1][0], speed, share * duration, beta)
            result = slide(first, speed, share * duration, BELL, beta)
            assert_allclose([result[0][0], result[1][0]], exact, rtol=TRANSIENT, atol=0)
    for eps in [1e-3, 1.0, 1e4]:
        beta = 2.0
        # both series to a relative error of (1 + eps) first²
        first = 1e-6 / math.sqrt(1.0 + eps)
        bound = beta * first * (1.0 - 0.5 * (beta + 1.0) * first)
        moment = eps * beta * first**2 * (0.5 - (beta + 2.0) * first / 6.0)
        duration = 3.0 / (1.0 + eps)
        exact = reference(bound, moment, eps, duration - first, beta)
        empty = np.zeros(1), np.zeros(1)
        result = slide(empty, eps, duration, BELL, beta)
        assert_allclose([result[0][0], result[1][0]], exact, rtol=TRANSIENT, atol=0)
        begun = slide(empty, eps, first, BELL, beta)
        assert_allclose(
            [begun[0][0], begun[1][0]],
            [bound, moment],
            rtol=2.0 * (beta + 2.0) ** 2 * 1e-12,
            atol=0,
        )


def test_a_step_in_two_unequal_parts_is_the_step_and_hardly_any_softness_the_constant_rate():
    random = np.random.default_rng(4)
    for _ in range(400):
        before, speed = 10.0 ** random.uniform(-12, 8, 2) * random.choice(
            [-1.0, 1.0], 2
        )
        beta, duration = 10.0 ** random.uniform(-9, 9, 2)
        kind = random.integers(4)
        speed = speed if random.random() > 0.1 else 0.0
        first = resting(BELL, beta) if kind == 0 else steady(before, BELL, beta)
        if kind == 1:
            first = np.zeros(1), np.zeros(1)
        whole = slide(first, speed, duration, BELL, beta)
        parts = slide(
            slide(first, speed, 0.3 * duration, BELL, beta),
            speed,
            0.7 * duration,
            BELL,
            beta,
        )
        assert 0.0 <= whole[0][0] <= 1.0
        assert_allclose(
            parts,
            whole,
            rtol=TRANSIENT,
            atol=0,
            err_msg=f"{kind} {before} {speed} {beta} {duration}",
        )
    first, speed = (np.full(1, 0.2), np.full(1, -0.3)), 2.0
    constant = slide(first, speed, 1.5, RuptureRate(1.0, 0.0, math.inf), 0.7)
    for softness in (1e-14, 1e-300):
        near = slide(first, speed, 1.5, RuptureRate(1.0, softness, math.inf), 0.7)
        assert_allclose(near, constant, rtol=1e-13, atol=0)


def test_one_entry_serves_all_rows_and_what_has_no_answer_is_nan():
    slip = np.array([0.1, 0.2, -5.0])
    spread = advance(
        np.full(3, 0.4), np.full(3, 0.1), slip, np.abs(slip), 0.3, BELL, 2.0
    )
    assert_array_equal(advance(0.4, 0.1, slip, np.abs(slip), 0.3, BELL, 2.0), spread)
    assert advance(0.4, 0.1, 0.2, 0.2, 0.3, BELL, 2.0)[0].shape == (1,)
    assert_array_equal(advance(0.5, 0.1, 0.2, 0.2, 0.0, BELL, 2.0), [[0.5], [0.2]])
    for bound, moment, slip in (
        (math.nan, 0.0, 1.0),
        (0.5, math.nan, 1.0),
        (0.5, 0.1, math.inf),
        (0.5, 500.0, 1.0),
    ):
        assert np.all(np.isnan(advance(bound, moment, slip, 1.0, 1.0, BELL, 1.0)))
