"""Crack-front kinetics: trajectories, limits, energy, Hertz's floor, and any input at all.

Maugis units throughout: work 1/pi, R = 1, E* = 3/4, so that K = 4E*/3 = 1, loads are in pi w R and
P(a) = a^3 - sqrt(6 a^3) in equilibrium. The inner step keeps its local error, as its embedded
method of order 3 sees it, below 1e-8 of the radius; the method itself is of order 5, and a stable
edge forgets errors, so that whole trajectories are good to some 1e-8.
"""

import itertools
import math
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad, solve_ivp

from sim.laws import jkr
from sim.numerics.jit import kernel
from sim.parts.contact.front import Kinetics, moved_edge

W = 1.0 / math.pi
REST = 6.0 ** (1.0 / 3.0)
EDGE = Kinetics(W, 1.0, 0.6, 1.0, 0.6)
SPHERE = {"sphere_radius": 1.0, "modulus": 0.75}
ONE = np.ones(1)


class Hold(NamedTuple):
    """Control during a clock step, each number linear in time: P = load + stiffness (displacement - delta)."""

    load_before: float | np.ndarray = 0.0
    load_after: float | np.ndarray = 0.0
    displacement_before: float | np.ndarray = 0.0
    displacement_after: float | np.ndarray = 0.0
    stiffness: float | np.ndarray = 0.0


class Advance(NamedTuple):
    """Radius [m], time of detachment [s] and dissipated energy [J] of each member, see ``moved_edge``."""

    radius: np.ndarray
    detached_at: np.ndarray
    dissipated: np.ndarray


@kernel("void(float64[:,::1], float64[:,::1])")
def _advance(rows, out):
    for m in range(rows.shape[0]):
        a, w0, w1, load0, load1, base0, base1, stiffness = rows[m, :8]
        (
            duration,
            scale,
            speed,
            exponent,
            heal_speed,
            heal_exponent,
            sphere_radius,
            modulus,
            least,
        ) = rows[m, 8:]
        kinetics, bodies = (
            (scale, speed, exponent, heal_speed, heal_exponent),
            (1.0 / sphere_radius, modulus, 0.0),
        )
        out[m, 0], out[m, 1], out[m, 2] = moved_edge(
            a,
            (w0, w1),
            ((load0, load1), (base0, base1), stiffness),
            duration,
            kinetics,
            bodies,
            least,
        )


def advance(
    radius, work, hold, kinetics, duration, sphere_radius, modulus, detached_below=0.0
):
    """Move the edge of each member's contact over one clock step; all broadcast against the radius."""
    radius = np.asarray(radius, dtype=float)
    columns = (
        radius,
        *work,
        *hold,
        duration,
        *kinetics,
        sphere_radius,
        modulus,
        detached_below,
    )
    rows = np.empty((radius.size, len(columns)))
    for row, column in zip(rows.T, columns, strict=True):
        row[:] = column
    out = np.empty((radius.size, 3))
    _advance(rows, out)
    return Advance(*out.T.copy())


def at_load(load):
    return Hold(load, load)


def at_indentation(indentation):
    return Hold(0.0, 0.0, indentation, indentation, math.inf)


def marched(hold_at, end, steps, radius=REST, edge=EDGE, work=W, below=0.05):
    """Radius, time of detachment, dissipated energy after clock steps; ``hold_at(t0, t1)`` and ``work`` may vary."""
    times = np.linspace(0.0, end, steps + 1)
    work_at = work if callable(work) else (lambda t: work)
    a, energy = radius * ONE, 0.0
    for t0, t1 in itertools.pairwise(times):
        out = advance(
            a,
            (work_at(t0), work_at(t1)),
            hold_at(t0, t1),
            edge,
            t1 - t0,
            **SPHERE,
            detached_below=below,
        )
        assert out.dissipated[0] >= 0.0
        a, energy = out.radius, energy + out.dissipated[0]
        if np.isnan(a[0]):
            return math.nan, t0 + out.detached_at[0], energy
    return a[0], math.nan, energy


def potential(a, load=0.0, displacement=0.0, stiffness=0.0, work=W):
    """Elastic energy of solid and spring, less the load's work, less adhesion; P = load + k (displacement - delta)."""
    if stiffness == math.inf:
        delta = displacement
    else:
        delta = (load + stiffness * displacement + 0.5 * a**3) / (stiffness + 1.5 * a)
    machine = (
        0.0
        if stiffness in (0.0, math.inf)
        else 0.5 * stiffness * (displacement - delta) ** 2
    )
    solid = 0.75 * (a * delta**2 - 2.0 / 3.0 * a**3 * delta + 0.2 * a**5)
    return solid + machine - load * delta - math.pi * work * a * a


def release(a, hold):
    """G of the textbook formula, written another way than the module's."""
    load, displacement, stiffness = (
        hold.load_before,
        hold.displacement_before,
        hold.stiffness,
    )
    delta = displacement
    if stiffness != math.inf:
        delta = (load + stiffness * displacement + 0.5 * a**3) / (stiffness + 1.5 * a)
    return 0.75 * (delta - a * a) ** 2 / (2.0 * math.pi * a)


def test_a_fixed_control_takes_the_time_of_its_quadrature_and_ramps_that_of_another_integrator():
    holds = (at_load(-1.2), 1.5), (at_load(-2.0), 1e-6), (at_indentation(-2.0), 1e-6)
    machines = (
        (Hold(0.0, 0.0, -4.0, -4.0, 3.0), 1e-6),
        (Hold(-0.5, -0.5, -1.0, -1.0, 1e3), 1.0),
    )
    for (hold, low), exponent in product(holds + machines, [0.2, 0.6, 1.0]):

        def pace(x, hold=hold, exponent=exponent):
            a = math.exp(x)
            return a / (release(a, hold) / W - 1.0) ** (1.0 / exponent)

        cuts = np.linspace(math.log(low), math.log(REST), 60)
        time = sum(
            quad(pace, *cut, epsrel=1e-13, epsabs=0.0)[0]
            for cut in itertools.pairwise(cuts)
        )
        edge = EDGE._replace(exponent=exponent)
        out = advance(
            REST * ONE, (W, W), hold, edge, 2.0 * time, **SPHERE, detached_below=low
        )
        assert_allclose(out.detached_at, time, rtol=1e-7, atol=0)
        out = advance(
            REST * ONE, (W, W), hold, edge, time, **SPHERE, detached_below=0.5 * low
        )
        assert_allclose(out.radius if low > 1e-3 else low, low, rtol=1e-7, atol=0)

    def hold(t0, t1):
        return Hold(0.3 * t0, 0.3 * t1, 0.2 - 0.5 * t0, 0.2 - 0.5 * t1, 0.7)

    def rate(t, y):
        s = release(y[0], Hold(0.3 * t, 0.0, 0.2 - 0.5 * t, 0.0, 0.7)) * math.pi - (
            1.0 - 0.4 * t
        )
        return [
            -math.copysign(abs(s) ** (1.0 / (0.6 if s > 0 else 0.4)), s)
            * (1.0 if s > 0 else 0.3)
        ]

    edge = Kinetics(W, 1.0, 0.6, 0.3, 0.4)
    for start in (0.8, REST, 3.0):
        exact = solve_ivp(
            rate, (0.0, 1.0), [start], method="DOP853", rtol=1e-12, atol=1e-13
        ).y[0, -1]
        for steps in (1, 7, 100):
            radius, _, _ = marched(
                hold, 1.0, steps, start, edge, lambda t: W * (1.0 - 0.4 * t)
            )
            assert_allclose(radius, exact, rtol=1e-7, atol=0)


def test_pull_off_force_grows_with_the_speed_of_a_hard_machine():
    for speed, path, lowest in [
        (1e-3, 2.0, -1.518359274),
        (0.1, 2.3, -1.775354520),
        (10.0, 3.9, -4.560522114),
    ]:
        # the lowest loads are those of LSODA at 1e-11; its printed four digits agree with two other integrators
        rest, count = jkr.indentation_at_radius(REST, W, **SPHERE), 2000
        displacement = rest - path * np.arange(count + 1) / count
        a, loads = REST * ONE, []
        for before, after in itertools.pairwise(displacement):
            hold = Hold(0.0, 0.0, before, after, math.inf)
            a = advance(
                a,
                (W, W),
                hold,
                EDGE,
                path / count / speed,
                **SPHERE,
                detached_below=1e-3,
            ).radius
            if np.isnan(a[0]):
                break
            loads.append(jkr.load_under_indentation(a[0], after, **SPHERE))
        # the lowest of samples is at most 1/8 of their second difference above the least value
        low = int(np.argmin(loads))
        assert (
            lowest - 1e-6
            < loads[low]
            < lowest + np.diff(loads[low - 1 : low + 2], 2)[0] / 8.0 + 1e-6
        )


def test_energy_is_balanced_at_a_fixed_control_and_along_ramps_of_displacement_and_work():
    for stiffness in [0.0, 0.02, 1.0, 50.0, math.inf]:
        for load, displacement, start in (
            (-0.8, -0.6, 2.5),
            (0.5, 0.7, 0.9),
            (-0.1, 0.1, REST),
        ):
            load = 0.0 if stiffness == math.inf else load
            hold = Hold(load, load, displacement, displacement, stiffness)
            for duration in (1e-3, 0.3, 30.0):
                radius, _, energy = marched(lambda *_, h=hold: h, duration, 1, start)
                before, after = (
                    potential(a, load, displacement, stiffness) for a in (start, radius)
                )
                assert_allclose(energy, before - after, rtol=1e-7, atol=1e-14)

    def displacement(t):
        return 0.5 - 1.2 * t

    def work(t):
        return W * (1.0 + 0.5 * t)

    def hold(t0, t1):
        return Hold(0.0, 0.0, displacement(t0), displacement(t1), 2.0)

    nodes, weights = np.polynomial.legendre.leggauss(3)
    a, energy, supplied = REST, 0.0, 0.0
    for t0, t1 in itertools.pairwise(np.linspace(0.0, 1.0, 41)):
        for node, weight in zip(nodes, weights, strict=True):
            t = 0.5 * (t0 + t1) + 0.5 * node * (t1 - t0)
            b = advance(
                a * ONE, (work(t0), work(t)), hold(t0, t), EDGE, t - t0, **SPHERE
            ).radius[0]
            delta = (2.0 * displacement(t) + 0.5 * b**3) / (2.0 + 1.5 * b)
            supplied += (
                0.5
                * (t1 - t0)
                * weight
                * (2.0 * (displacement(t) - delta) * -1.2 - math.pi * b * b * 0.5 * W)
            )
        out = advance(
            a * ONE, (work(t0), work(t1)), hold(t0, t1), EDGE, t1 - t0, **SPHERE
        )
        a, energy = out.radius[0], energy + out.dissipated[0]
    last, first = (
        potential(radius, 0.0, displacement(t), 2.0, work(t))
        for t, radius in ((1.0, a), (0.0, REST))
    )
    assert_allclose(energy, supplied - last + first, rtol=1e-7, atol=0)


def test_an_infinitely_fast_edge_is_the_jkr_equilibrium_and_lets_go_beyond_the_fold():
    for speed in [1e12, math.inf]:
        rng = np.random.default_rng(51)
        work = W * 10.0 ** rng.uniform(-1.0, 1.0, 300)
        edge = Kinetics(W, speed, 0.6, speed, 0.6)
        # wider than any of the stable branch below, so that the path ends on it
        start = 4.0
        load = rng.uniform(-0.99, 4.0, 300) * 1.5 * math.pi * work
        out = advance(
            np.full(300, start), (work, work), at_load(load), edge, 1.0, **SPHERE
        )
        assert_allclose(
            out.radius, jkr.radius_at_load(load, work, **SPHERE), rtol=1e-9, atol=0
        )
        displacement = rng.uniform(-3.0, 0.99, 300) * jkr.pull_off_indentation(
            work, **SPHERE
        )
        out = advance(
            np.full(300, start),
            (work, work),
            at_indentation(displacement),
            edge,
            1.0,
            **SPHERE,
        )
        assert_allclose(
            out.radius,
            jkr.radius_at_indentation(displacement, work, **SPHERE),
            rtol=1e-9,
            atol=0,
        )
    edge = Kinetics(W, math.inf, 0.6, math.inf, 0.6)
    gone = advance(REST * ONE, (W, W), at_load(-1.5001), edge, 1.0, **SPHERE)
    assert np.isnan(gone.radius[0])
    assert gone.detached_at[0] < 1e-9
    ramp = advance(
        REST * ONE, (W, W), Hold(0.0, -3.0), edge, 1.0, **SPHERE, detached_below=0.05
    )
    assert_allclose(ramp.detached_at, 0.5, rtol=1e-9, atol=0)
    for stiffness in [0.1, 5.0, 100.0]:
        edge = Kinetics(W, 1e12, 0.6, 1e12, 0.6)
        a = advance(
            REST * ONE,
            (W, W),
            Hold(0.0, 0.0, -0.3, -0.3, stiffness),
            edge,
            1.0,
            **SPHERE,
        ).radius[0]
        delta = jkr.indentation_at_radius(a, W, **SPHERE)
        assert_allclose(
            jkr.load_at_radius(a, W, **SPHERE),
            stiffness * (-0.3 - delta),
            rtol=1e-8,
            atol=0,
        )


def test_lag_fades_as_the_edge_speeds_up_and_a_frozen_edge_stays():
    lags = []
    for speed in 10.0 ** np.arange(0.0, 9.0):
        radius, _, _ = marched(
            lambda t0, t1: Hold(-t0, -t1),
            1.0,
            10,
            REST,
            Kinetics(W, speed, 0.6, speed, 0.6),
        )
        lags.append(radius - jkr.radius_at_load(-1.0, W, **SPHERE))
    ratios = np.array(lags[:-1]) / lags[1:]
    # a steady lag grows like (ramp/speed)^exponent
    assert_allclose(ratios[3:], 10.0**0.6, rtol=0.03, atol=0)
    for speed in (0.0, 1e-30):
        out = advance(
            REST * ONE,
            (W, 0.5 * W),
            Hold(0.0, -9.0),
            Kinetics(W, speed, 0.6, speed, 0.6),
            1.0,
            **SPHERE,
        )
        assert_array_equal(out.radius, REST)
        assert np.isnan(out.detached_at[0])


def test_an_edge_stops_at_hertz_when_it_arrives_and_pressing_carries_it_along():
    edge = Kinetics(W, 1.0, 0.6, 1.0, 0.6)
    for work in (-W, -1e-3 * W):
        for hold, hertz in (
            (at_load(0.7), 0.7 ** (1 / 3)),
            (at_indentation(0.7), 0.7**0.5),
        ):
            out = advance(REST * ONE, (work, work), hold, edge, 1e4, **SPHERE)
            assert_allclose(out.radius, hertz, rtol=1e-14, atol=0)
            assert np.isnan(out.detached_at[0])
    gone = advance(REST * ONE, (-W, -W), at_load(-0.1), edge, 1e4, **SPHERE)
    assert np.isnan(gone.radius[0]) and gone.detached_at[0] > 0.0
    slow = Kinetics(W, 1e-9, 0.6, 1e-9, 0.6)
    out = advance(np.full(1, 0.2), (W, W), Hold(0.1, 8.0), slow, 1.0, **SPHERE)
    assert_allclose(out.radius, 2.0, rtol=1e-12, atol=0)
    assert_allclose(
        out.dissipated, math.pi * W * (4.0 - 0.1 ** (2 / 3)), rtol=1e-12, atol=0
    )
    masked = advance(np.full(1, 0.2), (-W, -W), Hold(0.1, 8.0), slow, 1.0, **SPHERE)
    assert_allclose(masked.radius, 2.0, rtol=1e-12, atol=0)
    assert_array_equal(masked.dissipated, 0.0)
    back = advance(masked.radius, (-W, -W), Hold(8.0, 0.1), slow, 1.0, **SPHERE)
    assert_allclose(back.radius, 2.0, rtol=1e-6, atol=0)
    hold, hertz, works = at_indentation(0.7), 0.7**0.5, (-0.5 * W, -0.5 * W)
    pace = quad(
        lambda a: 1.0 / (release(a, hold) / W + 0.5) ** (1 / 0.6),
        hertz,
        REST,
        epsrel=1e-12,
    )[0]
    before, after = (
        advance(REST * ONE, works, hold, EDGE, share * pace, **SPHERE)
        for share in (0.999, 1.001)
    )
    assert_allclose(
        before.radius - hertz, 0.001 * pace * 0.5 ** (1 / 0.6), rtol=0.01, atol=0
    )
    assert_allclose(after.radius, hertz, rtol=1e-14, atol=0)
    start, end = (
        potential(a, 0.0, 0.7, math.inf, -0.5 * W) for a in (REST, after.radius[0])
    )
    assert_allclose(after.dissipated, start - end, rtol=1e-7, atol=0)


def test_a_narrow_contact_closes_to_the_equilibrium_and_an_open_one_stays_open():
    for hold in (at_load(1.0), Hold(0.0, 0.0, 0.4, 0.4, 1.0), at_indentation(0.3)):
        narrow, wide = (
            marched(lambda *_, h=hold: h, 1e6, 1, start)[0] for start in (0.3, 4.0)
        )
        assert_allclose(narrow, wide, rtol=1e-7, atol=0)
    # a neck narrower than the unstable equilibrium cannot be saved
    assert np.isnan(
        advance(
            np.full(1, 0.1), (W, W), at_indentation(-0.6), EDGE, 1e3, **SPHERE
        ).radius[0]
    )
    out = advance(
        np.array([math.nan, REST, 0.0]), (W, W), at_load(-1.0), EDGE, 1.0, **SPHERE
    )
    assert_array_equal(np.isnan(out.radius), [True, False, True])
    assert np.isnan(out.detached_at).all()
    assert_array_equal(out.dissipated[[0, 2]], 0.0)
    assert_array_equal(
        out.radius[1],
        advance(REST * ONE, (W, W), at_load(-1.0), EDGE, 1.0, **SPHERE).radius[0],
    )


def awkward(rng, size):
    """Rows of all arguments over many decades, with zeros, infinities and nan strewn in."""
    decades = np.zeros((17, 2))
    decades[0], decades[1:7], decades[9], decades[[10, 12]] = (
        (-2, 1),
        (-3, 1),
        (-1, 1),
        (-12, 12),
    )
    rows = 10.0 ** rng.uniform(*decades.T, (size, 17))
    rows[:, 1:7] *= rng.choice([-1.0, 0.0, 1.0], (size, 6)) * [W, W, 1.0, 1.0, 1.0, 1.0]
    rows[:, 7] = rng.choice([0.0, 1e-3, 1.0, 1e3, math.inf], size)
    rows[:, 9] *= W
    rows[:, [11, 13]] = rng.uniform(0.1, 1.0, (size, 2))
    rows[:, 15:] = 0.75, 1e-3
    strange = rng.random(rows.shape) < 0.01
    rows[strange] = rng.choice(
        [0.0, -1.0, math.inf, -math.inf, math.nan, 5e-324, 1e300], strange.sum()
    )
    return rows


@pytest.mark.parametrize("draws", [1, pytest.param(300, marks=pytest.mark.verify)])
def test_any_numbers_end_in_a_radius_an_opening_or_nan(draws):
    rng = np.random.default_rng(52)
    for _ in range(draws):
        rows = awkward(rng, 3000)
        radius, work, hold, duration, edge, bodies = np.split(rows.T, [1, 3, 8, 9, 14])
        out = advance(radius[0], work, hold, edge, duration[0], *bodies)
        assert not (out.dissipated < 0.0).any()
        assert not (out.radius <= 0.0).any() and not np.isinf(out.radius).any()
        gone = ~np.isnan(out.detached_at)
        assert np.isnan(out.radius[gone]).all()
        assert (
            (out.detached_at[gone] >= 0.0)
            & (out.detached_at[gone] <= duration[0, gone])
        ).all()
        positive = rows[:, [0, 8, 9, 11, 13, 14, 15]]
        good = np.isfinite(np.delete(rows, 7, axis=1)).all(axis=1) & (
            np.abs(rows[:, :7]) < 1e9
        ).all(axis=1)
        good &= (rows[:, [7, 10, 12, 16]] >= 0.0).all(axis=1) & (
            (positive > 1e-20) & (positive < 1e20)
        ).all(axis=1)
        assert (np.isnan(out.radius[good]) == gone[good]).all()
        assert np.isfinite(out.dissipated[good]).all()
