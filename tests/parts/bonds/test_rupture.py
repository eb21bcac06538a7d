"""Hazards of a stretched bond: their integral along the way, and when it reaches a threshold."""

import math
from itertools import product

import numpy as np
from numpy.testing import assert_allclose
from scipy.integrate import quad

from sim.parts.bonds.rupture import Bell, Constant, CutOff, RuptureRate, rupture_integral, time_to_rupture

#: Stretch and speed: along, against, through zero, from zero, at rest; softness from nothing to steep.
WAYS = list(product([-1.7, -0.3, 0.0, 0.2, 2.1], [-3.0, -0.4, 0.0, 0.7, 2.5], [0.0, 1e-9, 0.8, 4.0]))


def integral(stretch, slip, duration, rate, softness):
    """By quadrature, cut where the stretch passes zero."""
    cut = -stretch / slip if slip != 0.0 and 0.0 < -stretch / slip < 1.0 else 0.5
    parts = [
        quad(lambda u: rate * math.exp(softness * abs(stretch + slip * u)), *ends, epsabs=0.0, epsrel=1e-12)[0]
        for ends in ((0.0, cut), (cut, 1.0))
    ]
    return duration * sum(parts)


def test_the_integral_of_the_rupture_along_the_way_reaches_a_threshold_when_a_bond_breaks():
    for stretch, speed, softness in WAYS:
        exact = integral(stretch, speed * 1.3, 1.3, 0.6, softness)
        assert_allclose(rupture_integral(stretch, speed * 1.3, 1.3, 0.6, softness), exact, rtol=1e-12, atol=0)
    for (stretch, speed, softness), time in product(WAYS, [1e-9, 0.2, 1.1]):
        threshold = rupture_integral(stretch, speed * time, time, 0.6, softness)
        result = time_to_rupture(stretch, speed, threshold, 0.6, softness, math.inf)
        # the answer is as good as the threshold, whose rounding e^(softness x) undoes where the stretch shrinks
        worse = math.exp(softness * max(0.0, abs(stretch) - abs(stretch + speed * time)))
        assert_allclose(result, time, rtol=4e-15 * worse * (1.0 + softness * abs(stretch)), atol=0)


def test_a_cut_off_ends_a_bond_and_the_models_are_one_law_of_three_numbers():
    for stretch, speed, time in ((0.0, 2.0, 1.0), (0.5, 2.0, 0.75), (0.5, -2.0, 1.25), (-0.5, -1.0, 1.5)):
        assert_allclose(time_to_rupture(stretch, speed, 1e3, 1e-6, 0.0, 2.0), time, rtol=1e-15, atol=0)
        assert_allclose(time_to_rupture(stretch, speed, 1e3, 0.0, 0.0, 2.0), time, rtol=1e-15, atol=0)
    assert time_to_rupture(0.0, 2.0, 0.1, 1.0, 0.0, 2.0) == 0.1  # the threshold comes first
    assert rupture_integral(1.0, 5.0, 10.0, 0.0, 2.0) == 0.0
    assert time_to_rupture(1.0, 0.0, 1.0, 0.0, 2.0, math.inf) == math.inf
    assert time_to_rupture(1.0, 0.0, 1.0, 0.0, 2.0, 3.0) == math.inf
    assert time_to_rupture(0.0, 1.0, 1.0, 0.0, 2.0, math.inf) == math.inf
    for slip in [1e4, -1e4]:
        assert rupture_integral(0.0, slip, 1.0, 1.0, 1.0) == math.inf
        assert_allclose(time_to_rupture(0.0, slip, 1.0, 1.0, 1.0, math.inf), math.log1p(1e4) / 1e4, rtol=1e-15, atol=0)
    assert Constant(rate=2.0).law(7.0) == RuptureRate(2.0, 0.0, math.inf)
    assert Bell(zero_force_rate=2.0, bell_force=0.5).law(7.0) == RuptureRate(2.0, 14.0, math.inf)
    assert CutOff(stretch=3.0).law(7.0) == RuptureRate(0.0, 0.0, 3.0)
    assert np.isfinite(CutOff(stretch=3.0, rate=1.0).law(1.0).rate)
