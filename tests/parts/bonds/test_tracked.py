"""Bonds followed one by one. In units of 1/k0 and of the Bell force's stretch, so that ε = V and β = k_on."""

import copy
import math
from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import cumulative_trapezoid, quad

from sim.laws.schallamach import bell_lives, bell_moments
from sim.numerics.noise import PARTS
from sim.parts.bonds import tracked
from sim.parts.bonds.rupture import RuptureRate
from sim.parts.bonds.tracked import (
    BLOCK,
    BOUND,
    SENSE,
    SINGLY,
    SLIDER,
    STEPS,
    advance,
    mean_life,
    start,
)

BELL, CONSTANT, CUT = (
    RuptureRate(1.0, 1.0, math.inf),
    RuptureRate(1.0, 0.0, math.inf),
    RuptureRate(0.3, 0.0, 2.0),
)
BOTH = RuptureRate(1.0, 1.0, 3.0)
LAWS = {"bell": BELL, "constant": CONSTANT, "cut_off": CUT, "both": BOTH}
UNBREAKING = RuptureRate(0.0, 1.0, math.inf)


def begin(law, sites, members=1, speed=0.0, how="steady", rebinding=1.0, seed=5):
    return start(
        law, rebinding, sites, np.array([speed]), how, seed, np.arange(members)
    )


def go(tracks, slip, duration, law, rebinding=1.0, seed=5, members=None):
    members = np.arange(len(tracks.stamp)) if members is None else members
    after, frames = advance(
        tracks, np.atleast_2d(slip), np.array([duration]), law, rebinding, seed, members
    )
    assert np.array_equal(frames[-1], after.frame, equal_nan=True)
    return after


def bound(tracks):
    return tracks.frame[:, BOUND]


def mean_stretch(tracks):
    return tracked.moments(tracks.frame, tracks.due.shape[1])[1]


def mean_square_stretch(tracks):
    return tracked.moments(tracks.frame, tracks.due.shape[1])[2]


def stretches(tracks):
    """Stretch of every site, with sign, nan where it is free."""
    frame = tracks.frame[:, :, np.newaxis]
    return np.where(
        np.signbit(tracks.due),
        np.nan,
        frame[:, SENSE] * (frame[:, SLIDER] - tracks.birth),
    )


def moments(law, speed, rebinding):
    """Steady fraction bound and ⟨x^n⟩ per site, n = 1, 2, 4, by quadrature of the survival."""

    def survival(t):
        spent, _ = quad(lambda u: law.rate * math.exp(law.softness * speed * u), 0.0, t)
        return math.exp(-spent)

    end = min(
        law.limit / speed,
        60.0 / law.rate,
        (math.log1p(60.0 * speed) / speed) if law.softness else 60.0,
    )
    cycle = quad(survival, 0, end)[0] + 1.0 / rebinding
    return [
        quad(lambda t, n=n: (speed * t) ** n * survival(t), 0, end)[0] / cycle
        for n in (0, 1, 2, 4)
    ]


def has_the_law(tracks, exact):
    """The three moments, each within five of its standard errors over all sites."""
    fraction, _, second, fourth = exact
    count = tracks.due.size
    result = (
        bound(tracks).sum() / count,
        mean_stretch(tracks).mean(),
        mean_square_stretch(tracks).mean(),
    )
    for value, mean, square in zip(
        result, exact, (fraction, second, fourth), strict=False
    ):
        assert abs(value - mean) < 5.0 * math.sqrt((square - mean**2) / count)


def test_steady_sliding_reversals_and_rests_have_the_exact_moments():
    bell = product(
        [BELL],
        [
            (0.01, 1.0),
            (1.0, 0.1),
            (3.0, 1.0),
            (10.0, 1.0),
            (100.0, 10.0),
            (1000.0, 10.0),
        ],
    )
    for law, (speed, rebinding) in [
        *bell,
        *product([CONSTANT, CUT, BOTH], [(1.3, 1.0)]),
    ]:
        exact = moments(law, speed, rebinding)
        if law is BELL:
            assert_allclose(
                exact[:3],
                bell_moments(speed, 1.0, 1.0, 1.0, rebinding),
                rtol=1e-7,
                atol=0,
            )
        tracks = begin(law, 10_000, 20, speed, rebinding=rebinding)
        has_the_law(tracks, exact)
        for _ in range(60):
            tracks = go(tracks, speed * 0.05, 0.05, law, rebinding)
        has_the_law(tracks, exact)
        assert np.all(tracks.frame[:, STEPS] == 61)
    # Forth, rest, back through zero: against a trapezoid rule, whose error of some h² (k/2)² is below 2e-4.
    step, rebinding, sites = 2.5e-3, 2.0, 100_000
    speeds = np.repeat([3.0, 0.0, -4.0, 0.5], 160)
    exact = volterra(
        BELL, rebinding, np.concatenate([[0.0], np.cumsum(speeds * step)]), step
    )
    tracks = begin(BELL, sites, how="empty", rebinding=rebinding)
    for n in range(0, len(speeds), 40):
        tracks = go(tracks, speeds[n] * 40 * step, 40 * step, BELL, rebinding)
        at = n + 40
        result = (
            bound(tracks)[0] / sites,
            mean_stretch(tracks)[0],
            mean_square_stretch(tracks)[0],
        )
        # no site's stretch exceeds 3 by much: moments per site vary by less than these
        for value, moment, error in zip(result, exact, (0.5, 1.2, 3.0), strict=True):
            assert abs(value - moment[at]) < 5.0 * error / math.sqrt(sites) + 2e-4


def ramp(
    law, pieces, speeds, sites=600, rebinding=1.0, coarse=0.16, speed=1.0, members=3
):
    """States after each coarse step of constant speed, each made of so many pieces."""
    tracks, states = begin(law, sites, members, speed, rebinding=rebinding), []
    for v in speeds:
        for _ in range(pieces):
            tracks = go(tracks, v * coarse / pieces, coarse / pieces, law, rebinding)
        states.append(
            (bound(tracks), stretches(tracks), tracks.life.copy(), mean_stretch(tracks))
        )
    return states


def same_lives(first, second):
    """Same sites bound, the same number of lives, stretches equal but for rounding."""
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a[0], b[0])
        assert np.array_equal(a[2], b[2])
        assert_allclose(a[1], b[1], rtol=0, atol=1e-9)
        assert_allclose(a[3], b[3], rtol=0, atol=1e-9)


FORWARD = 10.0 ** np.linspace(-1, 1.5, 30)
BACK_AND_FORTH = 6.0 * np.sin(np.arange(40)) * (np.arange(40) % 7 > 0)


def test_the_same_motion_in_other_steps_or_a_bell_force_beyond_all_stretches_gives_the_same_lives():
    cases = [
        (law, speeds, 1.0, (2, 8, 16))
        for law, speeds in product(LAWS.values(), [FORWARD, BACK_AND_FORTH])
    ]
    # bonds asked singly, and bonds that follow
    cases.append((BELL, np.full(12, 200.0), 9.0, (16,)))
    for law, speeds, rebinding, finer in cases:
        coarse = ramp(law, 1, speeds, rebinding=rebinding)
        assert coarse[-1][2].mean() > 2.5  # sites have lived on
        for pieces in finer:
            same_lives(coarse, ramp(law, pieces, speeds, rebinding=rebinding))
    soft = ramp(RuptureRate(1.0, 1e-12, math.inf), 1, FORWARD)
    same_lives(soft, ramp(CONSTANT, 1, FORWARD))
    # whose lives are others
    assert not np.array_equal(soft[-1][2], ramp(BELL, 1, FORWARD)[-1][2])


def volterra(law, rebinding, position, step):
    """Fraction, mean and mean square stretch in time from all-empty sites, by the renewal equation on a grid."""
    count = len(position)
    rupture = law.rate * np.exp(
        law.softness * np.abs(position[np.newaxis, :] - position[:, np.newaxis])
    )
    spent = cumulative_trapezoid(rupture, dx=step, axis=1, initial=0.0)
    survival = np.triu(
        np.exp(np.minimum(np.diagonal(spent)[:, np.newaxis] - spent, 0.0))
    )
    free = np.ones(count)
    for n in range(1, count):
        weights = np.full(n + 1, step)
        weights[[0, n]] *= 0.5
        known = rebinding * np.sum(weights[:n] * free[:n] * survival[:n, n])
        free[n] = (1.0 - known) / (1.0 + rebinding * weights[n])
    born = rebinding * free * step
    born[0] *= 0.5
    stretch = position[np.newaxis, :] - position[:, np.newaxis]
    return [
        np.sum(born[:, np.newaxis] * survival * stretch**n, axis=0)
        - 0.5 * (n == 0) * born
        for n in (0, 1, 2)
    ]


LEAPS = np.concatenate([np.full(60, 3.0), [400.0, 2.0], np.full(30, 40.0)])


def test_many_steps_at_once_are_those_one_after_the_other_and_ask_singly_after_a_reversal():
    for name, speeds, shared in product(
        LAWS, [FORWARD, BACK_AND_FORTH, LEAPS], [True, False]
    ):
        law, members = LAWS[name], np.arange(3)
        # one of more than 300 lives
        duration = np.where(np.arange(len(speeds)) == 17, 700.0, 0.1)
        slip = (
            speeds[:, np.newaxis]
            * duration[:, np.newaxis]
            * (np.ones(1) if shared else np.array([1.0, -1.0, 0.3]))
        )
        for rebinding in (1.0, 40.0):
            steps = law, rebinding, 5, members
            at_once, frames = advance(
                begin(law, 100, 3, 1.0, rebinding=rebinding), slip, duration, *steps
            )
            alone = begin(law, 100, 3, 1.0, rebinding=rebinding)
            for k in range(len(speeds)):
                alone, after = advance(
                    alone, slip[k : k + 1], duration[k : k + 1], *steps
                )
                assert np.array_equal(after[0], frames[k])
            assert all(
                np.array_equal(first, second)
                for first, second in zip(at_once, alone, strict=True)
            )
            assert at_once.life.mean() > 2
    tracks = go(begin(BELL, 500, speed=1.0), -1e-3, 1e-3, BELL)
    assert tracks.frame[0, SINGLY] == 1.0
    for _ in range(400):
        tracks = go(tracks, -0.1, 0.1, BELL)
    assert tracks.frame[0, SINGLY] == 0.0
    assert np.nanmax(stretches(tracks)) <= 0.0


def test_a_state_that_has_been_advanced_is_spent_but_keeps_its_moments():
    before = begin(BELL, 1000, 2, 1.0)
    untouched = copy.deepcopy(before)
    go(before, 0.5, 0.5, BELL)
    for moment in (bound, mean_stretch, mean_square_stretch):
        assert np.array_equal(moment(before), moment(untouched))
    with pytest.raises(RuntimeError, match="already been advanced"):
        go(before, 0.5, 0.5, BELL)


def test_the_words_of_a_life_are_philoxs_at_its_address():
    seed, member, site = 2**63 + 9, 2**40 + 1, 37
    tracks = start(BELL, 2.0, 50, np.zeros(1), "empty", seed, np.array([member]))
    key = np.array([seed, PARTS["bonds"]], dtype=np.uint64)
    # numpy counts on before it draws
    counter = np.array([site, 1, member, 1], dtype=np.uint64)
    words = np.random.Philox(key=key, counter=counter).random_raw(4)
    threshold, wait = -np.log1p(-((words[1:3] >> np.uint64(12)) * 2.0**-52))
    assert_allclose(
        [tracks.birth[0, site], -tracks.due[0, site]],
        [threshold, wait / 2.0],
        rtol=1e-14,
        atol=0,
    )


def test_a_step_of_very_many_lives_ends_in_the_steady_law_of_its_speed_for_its_members_alone():
    for duration in [500.0, 1e6, 1e300]:
        tracks = begin(BELL, 10_000, 10, 1.0)
        lives = tracks.life.copy()
        speed = -3.0
        after = go(tracks, speed * duration, duration, BELL)
        fraction, first, second, fourth = moments(BELL, 3.0, 1.0)
        assert np.all(after.life == lives + 1)
        assert np.nanmax(stretches(after)) <= 0.0
        has_the_law(
            go(after, speed * 1e-9, 1e-9, BELL), [fraction, -first, second, fourth]
        )
    tracks = begin(BELL, 500, 2, 1.0)
    plain = go(copy.deepcopy(tracks), 1.0, 5.0, BELL, 1e3)
    mixed = go(tracks, np.array([1.0, 1e9]), 5.0, BELL, 1e3)
    assert np.array_equal(mixed.birth[0], plain.birth[0])
    assert not np.array_equal(mixed.birth[1], plain.birth[1])
    go(mixed, 1.0, 1.0, BELL, 1e3)


def test_no_numbers_make_a_step_endless_and_a_motion_without_an_end_is_refused():
    laws = (
        *LAWS.values(),
        UNBREAKING,
        RuptureRate(1e308, 1e300, 1e-300),
        RuptureRate(5e-324, 1.0, 5e-324),
    )
    slips, durations = (
        [0.0, 5e-324, 1e-300, -1e-12, 1e3, -1e300, 1.7e308],
        [5e-324, 1e-300, 1.0, 1e300],
    )
    for law, slip, duration, rebinding in product(
        laws, slips, durations, [0.0, 5e-324, 1.0, 1e300]
    ):
        tracks = begin(law, 33, how="bonded", rebinding=rebinding)
        try:
            tracks = go(tracks, slip, duration, law, rebinding)
        except ValueError as refusal:
            assert "stationary" in str(refusal) or "finite" in str(refusal)
            continue
        assert 0.0 <= bound(tracks)[0] <= 33.0
    with pytest.raises(ValueError, match="finite"):
        go(begin(BELL, 10), math.nan, 1.0, BELL)
    with pytest.raises(ValueError, match="never break"):
        begin(UNBREAKING, 10, speed=1.0)


def test_the_mean_life_is_the_integral_of_the_survival_and_ends_at_the_limit():
    speed = np.array([1e-12, 1e-3, 0.0199, 0.0201, 0.5, 10.0, 1e4, 1e8, 1e200])
    exact = bell_lives(speed, 1.0, 1.0, 1.0).mean
    assert_allclose(
        [mean_life(-speed[k : k + 1], BELL)[0] for k in range(9)],
        exact,
        rtol=1e-12,
        atol=0,
    )
    law = RuptureRate(0.7, 0.0, 2.0)
    assert_allclose(
        mean_life(np.array([3.0]), law),
        -math.expm1(-1.4 / 3.0) / 0.7,
        rtol=1e-14,
        atol=0,
    )
    assert_allclose(
        mean_life(np.array([3.0]), RuptureRate(0.0, 1.0, 2.0)),
        2.0 / 3.0,
        rtol=1e-15,
        atol=0,
    )
    assert_allclose(
        mean_life(np.array([3.0]), RuptureRate(1.0, 1.0, 1e9)),
        mean_life(np.array([3.0]), BELL),
        rtol=1e-12,
    )
    nearly = mean_life(np.array([3.0]), RuptureRate(0.7, 1e-9, 2.0))
    assert_allclose(nearly, mean_life(np.array([3.0]), law), rtol=1e-8, atol=0)


def test_the_kept_sums_are_those_of_the_sites_of_less_than_25_bytes():
    for sites in [1, 15, 16, 17, 1000]:
        tracks = begin(BELL, sites, 3, 2.0)
        for _ in range(300):
            tracks = go(tracks, 0.04, 0.02, BELL)
            stretch = stretches(tracks)
            assert np.array_equal(bound(tracks), np.sum(~np.isnan(stretch), axis=1))
            assert_allclose(
                mean_stretch(tracks),
                np.nansum(stretch, axis=1) / sites,
                rtol=0,
                atol=1e-12,
            )
            assert_allclose(
                mean_square_stretch(tracks),
                np.nansum(stretch**2, axis=1) / sites,
                rtol=0,
                atol=1e-11,
            )
    tracks = begin(BELL, 10**6)
    assert sum(array.nbytes for array in tracks) < 25e6
    assert tracks.frame[0, BOUND] == bound(tracks)[0]
    assert BLOCK <= 62


@pytest.mark.verify
def test_ten_million_steps_gather_no_error():
    """Steps of 1e-5 lives of a few sites: the sums and the law after 100 lives."""
    tracks = begin(BELL, 16, 1, 3.0)
    for _ in range(10**3):
        tracks, _ = advance(
            tracks,
            np.full((10**4, 1), 3e-5),
            np.full(10**4, 1e-5),
            BELL,
            1.0,
            5,
            np.zeros(1),
        )
    coarse = begin(BELL, 16, 1, 3.0)
    for _ in range(10**3):
        coarse = go(coarse, 0.3, 0.1, BELL)
    assert np.array_equal(tracks.life, coarse.life)
    assert_allclose(stretches(tracks), stretches(coarse), rtol=0, atol=1e-8)
