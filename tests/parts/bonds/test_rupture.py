"""Hazards of a stretched bond: their integral along the way, and when it reaches a threshold."""

import math

import numpy as np
from numpy.testing import assert_allclose

from sim.parts.bonds.rupture import (
    Bell,
    Constant,
    CutOff,
    RuptureRate,
    rupture_integral,
    time_to_rupture,
)


def test_a_cut_off_ends_a_bond_and_the_models_are_one_law_of_three_numbers():
    for stretch, speed, time in (
        (0.0, 2.0, 1.0),
        (0.5, 2.0, 0.75),
        (0.5, -2.0, 1.25),
        (-0.5, -1.0, 1.5),
    ):
        assert_allclose(
            time_to_rupture(stretch, speed, 1e3, 1e-6, 0.0, 2.0),
            time,
            rtol=1e-15,
            atol=0,
        )
        assert_allclose(
            time_to_rupture(stretch, speed, 1e3, 0.0, 0.0, 2.0),
            time,
            rtol=1e-15,
            atol=0,
        )
    # the threshold comes first
    assert time_to_rupture(0.0, 2.0, 0.1, 1.0, 0.0, 2.0) == 0.1
    assert rupture_integral(1.0, 5.0, 10.0, 0.0, 2.0) == 0.0
    assert time_to_rupture(1.0, 0.0, 1.0, 0.0, 2.0, math.inf) == math.inf
    assert time_to_rupture(1.0, 0.0, 1.0, 0.0, 2.0, 3.0) == math.inf
    assert time_to_rupture(0.0, 1.0, 1.0, 0.0, 2.0, math.inf) == math.inf
    for slip in [1e4, -1e4]:
        assert rupture_integral(0.0, slip, 1.0, 1.0, 1.0) == math.inf
        assert_allclose(
            time_to_rupture(0.0, slip, 1.0, 1.0, 1.0, math.inf),
            math.log1p(1e4) / 1e4,
            rtol=1e-15,
            atol=0,
        )
    assert Constant(rate=2.0).law(7.0) == RuptureRate(2.0, 0.0, math.inf)
    assert Bell(zero_force_rate=2.0, bell_force=0.5).law(7.0) == RuptureRate(
        2.0, 14.0, math.inf
    )
    assert CutOff(stretch=3.0).law(7.0) == RuptureRate(0.0, 0.0, 3.0)
    assert np.isfinite(CutOff(stretch=3.0, rate=1.0).law(1.0).rate)
