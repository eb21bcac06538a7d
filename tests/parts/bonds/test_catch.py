"""Catch bonds: the law of their lives, their cohorts, and the models that cannot hold them."""

import functools
import math
from itertools import pairwise, product

import numpy as np
import pytest
from helpers.scenes import STRETCHED, Clock, bonds, drive, march, scene
from numpy.testing import assert_allclose
from scipy.integrate import quad

from sim.laws.schallamach import (
    bell_moments,
    catch_lives,
    catch_moments,
    constant_moments,
)
from sim.parts.bonds.rupture import Catch

#: Half of the bonds of rest are bound; force holds them up to some 12 pN and breaks them beyond.
CATCH = Catch(catch_rate=200.0, catch_force=3e-12, slip_rate=5.0, slip_force=6e-12)
RATES = CATCH.catch_rate, CATCH.catch_force, CATCH.slip_rate, CATCH.slip_force
STIFFNESS, BINDING = STRETCHED["bond_stiffness"], STRETCHED["rebinding_rate"]
SPEEDS = [1e-5, 1e-3, -4e-3, 2e-2, 0.3]


@functools.cache
def by_quadrature(speed):
    """Moments of a site by adaptive quadrature over ln(age), the rate integrated in closed form term by term."""
    a, b = (
        STIFFNESS * abs(speed) / CATCH.catch_force,
        STIFFNESS * abs(speed) / CATCH.slip_force,
    )

    def alive(age):
        return math.exp(
            CATCH.catch_rate * math.expm1(-a * age) / a
            - CATCH.slip_rate * math.expm1(min(b * age, 700.0)) / b
        )

    last = math.log(math.log1p(750.0 * b / CATCH.slip_rate) / b)
    cuts = list(np.linspace(last - 40.0, last, 41))

    def moment(n):
        pieces = (
            quad(
                lambda x: math.exp((n + 1) * x) * alive(math.exp(x)),
                *ends,
                epsabs=0.0,
                epsrel=1e-12,
            )
            for ends in pairwise(cuts)
        )
        return sum(piece for piece, _ in pieces)

    life, lag, square = map(moment, range(3))
    cycle, pull = life + 1.0 / BINDING, STIFFNESS * speed
    return np.array([life, pull * lag, pull**2 * square]) / cycle


def test_the_law_is_the_renewal_integral_with_bells_and_the_constant_rate_as_limits():
    for speed in SPEEDS:
        assert_allclose(
            np.array(catch_moments(speed, *RATES, STIFFNESS, BINDING)),
            by_quadrature(speed),
            rtol=1e-10,
        )
    speeds = np.array([0.0, *SPEEDS])
    bell = bell_moments(speeds, 5.0, 6e-12, STIFFNESS, BINDING)
    assert_allclose(
        catch_moments(speeds, 0.0, 3e-12, 5.0, 6e-12, STIFFNESS, BINDING),
        bell,
        rtol=1e-11,
    )
    result = catch_moments(speeds, 200.0, math.inf, 5.0, math.inf, STIFFNESS, BINDING)
    assert_allclose(
        result, constant_moments(speeds, 205.0, STIFFNESS, BINDING), rtol=1e-11
    )
    assert catch_lives(speeds, *RATES, STIFFNESS).mean.shape == speeds.shape
    bound = catch_moments(np.array([0.0, 2e-3, 1.0]), *RATES, STIFFNESS, BINDING).bound
    assert bound[1] > 1.1 * bound[0] and bound[2] < 0.5 * bound[0]


def test_cohorts_in_steady_sliding_obey_the_law_and_do_not_depend_on_the_clock_step():
    for speed, tolerance in product(SPEEDS, [1e-3, 1e-5]):
        part = bonds.Cohort(rupture=CATCH, **STRETCHED, tolerance=tolerance)
        result, (bound, force, square) = (
            part.steady(np.array([speed])),
            by_quadrature(speed),
        )
        assert_allclose(result.fraction * part.bound_at_rest, bound, rtol=tolerance)
        assert_allclose(
            result.stress, STRETCHED["site_density"] * force, rtol=tolerance
        )
        assert_allclose(
            result.frozen + result.varying,
            STRETCHED["site_density"] * square,
            rtol=10.0 * tolerance,
        )
    part = bonds.Cohort(rupture=CATCH, **STRETCHED, tolerance=1e-5)
    turning = drive.Table(
        time=(0.0, 4e-3, 4e-3, 8e-3), speed=(8e-3, 8e-3, -6e-3, -6e-3)
    )
    scenes = (
        scene(bonds=part, drive=turning, clock=Clock(duration=8e-3, step=8e-3 / n))
        for n in (8, 80)
    )
    coarse, fine = (
        np.array([state.bonding[:2] for state in march(moving, np.arange(1))])
        for moving in scenes
    )
    off = np.abs(fine[::10] - coarse).max(axis=(0, 2)) / np.abs(coarse).max(axis=(0, 2))
    # ten times the tolerance: one for each of the eight steps
    assert np.all(off < 1e-4)


def test_models_with_one_clock_for_all_bonds_refuse_catch_bonds_and_auto_takes_cohorts():
    for model in [bonds.FirstMoment, functools.partial(bonds.Tracked, sites=10)]:
        with pytest.raises(ValueError, match=r'"catch" needs .*"cohort"'):
            model(rupture=CATCH, **STRETCHED)
    assert (
        scene(bonds=bonds.Auto(rupture=CATCH, **STRETCHED, sites=20)).population.model
        == "cohort"
    )
