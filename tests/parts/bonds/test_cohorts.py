"""Stretch-resolved bond populations against renewal theory, Volterra equations and exact moments."""

import math
from itertools import product

import numpy as np
from hypothesis import given, settings, strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.special import lambertw

from sim.laws.schallamach import bell_moments, cut_off_moments
from sim.parts.bonds import cohorts as populations
from sim.parts.bonds.cohorts import steady, unstretched
from sim.parts.bonds.rupture import RuptureRate

BELL = RuptureRate(rate=1.0, softness=1.0, limit=math.inf)
CONSTANT = RuptureRate(rate=1.0, softness=0.0, limit=math.inf)


def moments(cohorts):
    return populations.moments(cohorts, RuptureRate(0.0, 0.0, math.inf), 1e-4)[:3, 0]


def advance(cohorts, slip, duration, *recipe, share=1.0):
    return populations.advance(
        cohorts, slip[np.newaxis], np.array([duration]), *recipe, np.full(1, share)
    )[0]


def march(cohorts, speeds, duration, rupture, rebinding, tolerance, **more):
    """Moments after each step of these speeds, shape (steps, 3), and the last state."""
    out = []
    for speed in speeds:
        cohorts = advance(
            cohorts,
            np.array([speed * duration]),
            duration,
            rupture,
            rebinding,
            tolerance,
            **more,
        )
        out.append(moments(cohorts))
    return np.array(out), cohorts


def life_of(eps):
    """Age at which 1/e of fresh Bell bonds are left, in units of 1/k0."""
    return math.log1p(eps) / eps


def worst(result, exact):
    return np.max(np.abs(result / exact - 1.0))


def test_the_steady_state_has_the_moments_of_renewal_theory_and_marching_from_rest_ends_in_it():
    # merging keeps these moments
    for beta, eps in product([0.1, 1.0, 10.0], [0.01, 1.0, 10.0, 1000.0]):
        assert_allclose(
            moments(steady(BELL, beta, eps, 1e-4)),
            bell_moments(eps, 1.0, 1.0, 1.0, beta),
            rtol=1e-10,
            atol=0,
        )
    for beta, eps in product(
        [0.01, 1.0, 1000.0], [1e-3, 1e-2, 0.1, 1.0, 10.0, 1e2, 1e4]
    ):
        # a start-up of Bell bonds rings down like a renewal process: 40 lives are enough below 1e-6 where CV > 0.15
        duration, exact = life_of(eps) * 0.23, bell_moments(eps, 1.0, 1.0, 1.0, beta)
        out, _ = march(
            steady(BELL, beta, 0.0, 1e-4), [eps] * 174, duration, BELL, beta, 1e-4
        )
        assert_allclose(out[-1], exact, rtol=1e-4, atol=0)


def test_start_up_peak_without_rebinding_is_the_lambert_formula():
    for eps in [1.0, 10.0, 100.0, 1e4]:
        w = lambertw(eps).real
        peak, time = 0.5 * w * math.exp(1.0 / eps - 1.0 / w), w / eps
        start = steady(BELL, 1.0, 0.0, 1e-4)
        many, _ = march(start, [eps] * 400, time / 200, BELL, 0.0, 1e-4)
        # no births: survival is exact
        assert_allclose(many[199, 1], peak, rtol=1e-12, atol=0)
        assert np.argmax(many[:, 1]) == 199
        assert_allclose(
            march(start, [eps], time, BELL, 0.0, 1e-4)[0][0, 1],
            peak,
            rtol=1e-13,
            atol=0,
        )


def test_constant_rupture_follows_the_exact_moments_and_births_are_third_order():
    for tolerance in [1e-3, 1e-5, 1e-7]:
        # a step h errs by h^3/72 of the moments, h = (7 tolerance)^(1/3): a tenth of the tolerance
        out, last = march(
            steady(CONSTANT, 2.0, 0.0, tolerance),
            [0.7] * 20,
            0.25,
            CONSTANT,
            2.0,
            tolerance,
        )
        time = 0.25 * np.arange(1.0, 21.0)
        second = 2.0 * 0.7**2 * (1.0 - np.exp(-time) * (1.0 + time))
        exact = 2.0 / 3.0 * np.array([np.ones(20), 0.7 * -np.expm1(-time), second])
        assert_allclose(out.T, exact, rtol=tolerance, atol=0)
        assert np.count_nonzero(last.weight) < 20
    beta, speed, end, errors = 2.0, 0.7, 1.0, []
    # from no bond at all
    number = beta / (1.0 + beta) * (1.0 - math.exp(-(1.0 + beta) * end))
    for steps in (4, 8, 16, 32, 512):
        out, _ = march(
            unstretched(CONSTANT, 0.1, 0.0),
            [speed] * steps,
            end / steps,
            CONSTANT,
            beta,
            0.1,
        )
        errors.append(abs(out[-1, 0] / number - 1.0))
    assert np.all(np.log2(np.divide(errors[:3], errors[1:4])) > 2.5)
    assert errors[-1] < 1e-9


def test_cut_off_bonds_slide_by_their_closed_form_and_without_a_rate_break_at_once():
    for tolerance in [1e-3, 1e-4]:
        rupture = RuptureRate(rate=1.0, softness=0.0, limit=1.0)
        for u, m in product((0.1, 0.730401, 5.0, 1e3), (0.1, 1.0, 10.0)):
            start, exact = (
                steady(rupture, 1.0 / m, u, tolerance),
                cut_off_moments(u, 1.0, 1.0, 1.0, 1.0 / m),
            )
            assert_allclose(moments(start), exact, rtol=1e-9, atol=0)
            out, _ = march(
                start, [u] * 50, 0.11 * min(1.0, 1.0 / u), rupture, 1.0 / m, tolerance
            )
            assert_allclose(out, np.tile(exact, (50, 1)), rtol=tolerance, atol=0)
    rupture = RuptureRate(rate=0.0, softness=0.0, limit=1.0)
    start = steady(rupture, 2.0, 0.0, 1e-4)
    out, _ = march(start, [1.0] * 30, 0.07, rupture, 2.0, 1e-4)
    time = 0.07 * np.arange(1, 31)
    assert_allclose(
        out[time < 1.0, :2], np.stack([np.ones(14), time[:14]], 1), rtol=1e-12, atol=0
    )
    after = time[(time > 1.0)] - 1.0
    after = after[after < 0.98]
    # all sites are free at slip 1: N = 1 - e^(-k_on t), the cut-off far from the new ones
    assert_allclose(
        out[14 : 14 + len(after), 0], -np.expm1(-2.0 * after), rtol=1e-4, atol=0
    )


def test_jumps_of_speed_and_any_clock_step_keep_the_number_and_the_steady_state():
    for (before, after), beta in product(
        [(1e-3, 1e3), (1e3, 1e-3), (0.0, 1e2), (1e2, 0.0), (3.0, -3.0), (10.0, -1e-4)],
        [0.1, 100.0],
    ):
        tolerance = 1e-3
        start = steady(BELL, beta, before, tolerance)
        pace = life_of(max(abs(after), 1e-6))
        coarse, state = march(start, [after] * 14, 0.1 * pace, BELL, beta, tolerance)
        fine, _ = march(start, [after] * 98, 0.1 * pace / 7.0, BELL, beta, tolerance)
        true, _ = march(
            steady(BELL, beta, before, 1e-7), [after] * 14, 0.1 * pace, BELL, beta, 1e-7
        )
        size = np.sqrt(true[:, 0] * true[:, 2])
        for out in (coarse, fine[6::7]):
            assert worst(out[:, 0], true[:, 0]) < tolerance
            assert np.max(np.abs(out[:, 1] - true[:, 1]) / size) < 1.5 * tolerance
        assert np.all(state.weight >= 0.0)
        assert 0.0 <= state.weight.sum() <= 1.0 + 1e-12
    for tolerance in [1e-3, 1e-4]:
        for eps in (0.01, 1.0, 10.0, 1e4):
            start = steady(BELL, 1.0, eps, tolerance)
            for lives in (0.01, 0.1, 0.4, 1.0, 7.0, 1e3):
                out, _ = march(
                    start, [eps] * 60, life_of(eps) * lives, BELL, 1.0, tolerance
                )
                assert worst(out, moments(start)) < tolerance, (eps, lives)


def test_ageing_at_rest_is_an_exponential_dilution_frees_sites_and_no_duration_only_stretches():
    out, _ = march(unstretched(BELL, 1e-5, 0.0), [0.0] * 40, 0.1, BELL, 2.0, 1e-5)
    time = 0.1 * np.arange(1, 41)
    assert_allclose(out[:, 0], 2.0 / 3.0 * -np.expm1(-3.0 * time), rtol=1e-5, atol=0)
    assert np.all(out[:, 1:] == 0.0)
    start = steady(BELL, 1.0, 1.0, 1e-4)
    moved = advance(start, np.array([0.5]), 0.0, BELL, 1.0, 1e-4)
    number, first, second = moments(start)
    assert_allclose(
        moments(moved),
        [number, first + 0.5 * number, second + first + 0.25 * number],
        rtol=1e-14,
        atol=0,
    )
    out, _ = march(steady(BELL, 1.0, 0.0, 1e-4), [0.0], 1.0, BELL, 1.0, 1e-4, share=0.5)
    assert_allclose(out[0, 0], 0.5 - 0.25 * math.exp(-2.0), rtol=1e-4, atol=0)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    exponents=st.tuples(*[st.floats(-9.0, 9.0)] * 3),
    kind=st.sampled_from(["bell", "constant", "cut off", "only cut off"]),
    steps=st.lists(
        st.sampled_from([1.0, -1.0, 1e3, -1e-3, 0.0]), min_size=1, max_size=3
    ),
)
def test_any_rates_and_slips_give_shares_between_zero_and_one(exponents, kind, steps):
    rate, rebinding, slip = (10.0**e for e in exponents)
    rupture = {
        "bell": RuptureRate(rate, 1.0, math.inf),
        "constant": RuptureRate(rate, 0.0, math.inf),
        "cut off": RuptureRate(rate, 0.0, 1.0),
        "only cut off": RuptureRate(0.0, 0.0, 1.0),
    }[kind]
    state = steady(rupture, rebinding, -slip, 1e-2)
    for factor in steps:
        state = advance(state, np.array([factor * slip]), 1.0, rupture, rebinding, 1e-2)
        assert np.all(state.weight >= 0.0)
        assert np.all(np.isfinite(state.stretch))
        assert np.all(state.width >= 0.0)
        assert -1e-12 <= state.weight.sum() <= 1.0 + 1e-12


def test_steps_of_extreme_length_have_their_limits():
    for fast, bind in product([1e-9, 1e9], [1e-9, 1e9]):
        rupture = RuptureRate(fast, 1.0, math.inf)
        result = advance(
            unstretched(rupture, 1e-4, 0.0), np.array([1.0]), 1.0, rupture, bind, 1e-4
        ).weight.sum()
        assert_allclose(
            result,
            -math.expm1(-bind) if fast < 1.0 else bind / (bind + fast),
            rtol=1e-4,
            atol=0,
        )


def test_cohorts_stay_few_for_ever_and_merging_keeps_four_moments():
    tolerance, rng = 1e-3, np.random.default_rng(4)
    state = steady(BELL, 1.0, 0.0, tolerance)
    capacity, most = state.weight.shape[1], 0
    for speed in rng.choice([0.1, 3.0, 30.0, -10.0], 40).repeat(250):
        state = advance(state, np.array([speed * 0.01]), 0.01, BELL, 1.0, tolerance)
        most = max(most, np.count_nonzero(state.weight))
    assert most < capacity
    assert state.weight.shape[1] == capacity
    # without rupture to speak of nothing breaks; every birth is where it was made but for merging
    slow = RuptureRate(1e-12, 1.0, math.inf)
    state = unstretched(slow, 1e-2, 0.0)
    for _ in range(300):
        state = advance(state, np.array([0.01]), 0.01, slow, 1e-3, 1e-2)
    x, w = state.stretch[0], state.weight[0]
    assert np.count_nonzero(w) < 40
    for power in range(4):
        exact = quad(
            lambda a, n=power: a**n * 1e-3 * math.exp(-1e-3 * (3.0 - a)),
            0.0,
            3.0,
            epsabs=0,
            epsrel=1e-13,
        )[0]
        # Radau's rule is exact for squares and errs by h^4/36 x^-3 of a cube, 1e-8 of the whole here; free sites
        # are 1 to 1e-16, of which 300 steps bind 3e-3
        assert_allclose(
            np.sum(w * x**power), exact, rtol=1e-10 if power < 3 else 1e-7, atol=0
        )
