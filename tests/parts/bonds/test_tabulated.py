"""Rupture laws without closed integrals: their tables, and populations against the survival of a bond by quadrature."""

import functools
import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from sim.numerics.table import ERROR
from sim.parts.bonds import cohorts, tracked
from sim.parts.bonds.rupture import (
    RuptureRate,
    hazard_integral,
    hazard_time,
    rate_at,
    tabulated,
)

#: Rates over the stretch in units of a scale: two stretched exponentials, and one that falls before it rises.
RATES = {
    "square": lambda x: 3.0 * np.exp(np.square(x)),
    "three halves": lambda x: 3.0 * np.exp(np.power(x, 1.5)),
    "falls first": lambda x: 3.0 * np.exp(0.5 * x) / (1.0 + np.square(x)),
}
SCALE, REBINDING = 2e-9, 5.0


@functools.cache
def law_of(name):
    return tabulated(lambda stretch: RATES[name](stretch / SCALE), SCALE)


def integral(name, stretch, slip, duration):
    """∫k dt along a way at constant speed, by adaptive quadrature on both sides of zero stretch."""
    start, way = stretch / SCALE, slip / SCALE
    at_zero = [-start / way] if way and 0.0 < -start / way < 1.0 else None
    mean, _ = quad(
        lambda part: RATES[name](abs(start + part * way)),
        0.0,
        1.0,
        points=at_zero,
        epsabs=0.0,
        epsrel=1e-13,
        limit=200,
    )
    return duration * mean


def survival(name, age, speed):
    return math.exp(-integral(name, 0.0, speed * age, age))


def lived(name, speed, power):
    """∫ age^power S d(age) of fresh bonds, S the share that survives, over pieces of the life."""
    last = hazard_time(0.0, speed, 40.0, law_of(name).numbers)
    edges = np.linspace(0.0, last, 21)
    return sum(
        quad(
            lambda age: age**power * survival(name, age, speed),
            *ends,
            epsabs=0.0,
            epsrel=1e-11,
        )[0]
        for ends in itertools.pairwise(edges)
    )


@pytest.mark.parametrize("name", RATES)
def test_a_table_has_the_rate_and_its_integral_along_any_way(name):
    numbers = law_of(name).numbers
    for size in np.geomspace(1e-6, 4.0, 60):
        assert_allclose(
            rate_at(-size * SCALE, numbers), RATES[name](size), rtol=ERROR, atol=0
        )
    for stretch in (0.0, 1e-7, 0.3, 2.7):
        for slip in (0.0, 1e-12, 3e-5, -1e-3, -1.0, 0.7, 2.0, -5.0):
            way = stretch * SCALE, slip * SCALE, 0.2
            exact = integral(name, *way)
            assert_allclose(hazard_integral(*way, numbers), exact, rtol=ERROR, atol=0)


@pytest.mark.parametrize("name", RATES)
def test_a_bond_breaks_when_the_integral_of_a_table_reaches_its_threshold(name):
    numbers = law_of(name).numbers
    for stretch, pace in [(0.0, 0.0), (0.0, 3.0), (2.0, -3.0), (-1.0, 1e4), (0.5, 0.1)]:
        for threshold in (1e-6, 1.0, 30.0):
            speed = pace * SCALE
            time = hazard_time(stretch * SCALE, speed, threshold, numbers)
            reached = integral(name, stretch * SCALE, speed * time, time)
            assert_allclose(reached, threshold, rtol=1e-9, atol=0)
            cut = numbers._replace(limit=2.5 * SCALE)
            bounded = hazard_time(stretch * SCALE, speed, threshold, cut)
            ahead = stretch * math.copysign(1.0, pace)
            last = (2.5 - ahead) / abs(pace) if pace else math.inf
            assert_allclose(bounded, min(time, last), rtol=1e-14)


def test_a_rate_with_a_kink_has_no_table():
    with pytest.raises(ValueError, match="must be smooth"):
        tabulated(lambda stretch: np.maximum(1.0, np.exp(stretch - 1.1)), 1.0)


def test_cohorts_and_tracked_bonds_of_a_table_have_the_moments_of_steady_sliding():
    name, sites, members = "square", 2000, 10
    law = law_of(name)
    for pace in (0.5, -40.0):
        speed = pace * SCALE
        life, lag = (lived(name, speed, power) for power in (0, 1))
        cycle = life + 1.0 / REBINDING
        share, stretch = life / cycle, speed * lag / cycle
        sums = cohorts.moments(cohorts.steady(law, REBINDING, speed, 1e-5), law, 1e-5)
        assert_allclose(sums[:2, 0], (share, stretch), rtol=1e-9)
        speeds, addresses = np.full(1, speed), (7, np.arange(members))
        assert_allclose(tracked.mean_life(speeds, law), life, rtol=1e-9)
        state = tracked.start(law, REBINDING, sites, speeds, "steady", *addresses)
        step = 0.3 * life
        _, later = tracked.advance(
            state,
            np.full((4, 1), speed * step),
            np.full(4, step),
            law,
            REBINDING,
            *addresses,
        )
        square = speed**2 * lived(name, speed, 2) / cycle
        for frames in (state.frame, later[0], later[-1]):
            bound, mean, _ = tracked.moments(frames, sites)
            number = members * sites
            spread = math.sqrt(share * (1.0 - share) / number)
            assert abs(bound.mean() - share) < 5.0 * spread
            spread = math.sqrt((square - stretch**2) / number)
            assert abs(mean.mean() - stretch) < 5.0 * spread


@pytest.mark.parametrize("name", ["square", "three halves"])
def test_bonds_of_a_table_that_are_pulled_to_and_fro_survive_as_by_quadrature(name):
    law, sites, members = law_of(name), 2000, 10
    slips, durations = (
        SCALE * np.array([[1.2], [-2.0], [-0.4], [1.7]]),
        np.full(4, 0.05),
    )
    places = np.concatenate([[0.0], np.cumsum(slips)])[:-1]
    spent = np.cumsum(
        [
            integral(name, *way)
            for way in zip(places, slips[:, 0], durations, strict=True)
        ]
    )
    first = cohorts.unstretched(law, 1e-5, 1.0)
    _, sums = cohorts.advance(first, slips, durations, law, 0.0, 1e-5, np.ones(1))
    assert_allclose(sums[0, :, 0], np.exp(-spent), rtol=1e-9)
    addresses = 3, np.arange(members)
    bonds = tracked.start(law, 0.0, sites, np.zeros(1), "bonded", *addresses)
    _, frames = tracked.advance(bonds, slips, durations, law, 0.0, *addresses)
    shares = tracked.moments(frames, sites)[0].mean(axis=1)
    errors = np.sqrt(np.exp(-spent) * -np.expm1(-spent) / (members * sites))
    assert np.all(np.abs(shares - np.exp(-spent)) < 5.0 * errors)


def test_cohorts_of_bells_rate_in_a_table_are_those_of_its_closed_form():
    bell = RuptureRate(3.0, 1.0 / SCALE, math.inf)
    law, steps, tolerance = tabulated(bell.at, SCALE), 40, 1e-6
    slips = SCALE * 0.3 * np.sign(np.sin(np.arange(steps) / 6.0 + 0.1))[:, np.newaxis]
    durations = np.full(steps, 0.03)
    closed, table = (
        cohorts.advance(
            cohorts.unstretched(each, tolerance, 1.0),
            slips,
            durations,
            each,
            REBINDING,
            tolerance,
            np.ones(1),
        )[1][:2, :, 0]
        for each in (bell, law)
    )
    largest = np.abs(closed).max(axis=1, keepdims=True)
    # each is good to the tolerance in a step
    assert np.all(np.abs(table - closed) < 2.0 * tolerance * steps * largest)
