"""Fits of the friction of a tip over its load, with the error of the spring constant that all loads share."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import sim
from sim.laws import cohesive, jkr
from sim.study.fit import fit
from sim.study.likelihood import Free, covariance_at, minimum, problem_of
from sim.study.measurement import Curve, Measured
from sim.study.mechanisms import draws_of
from sim.units.quantity import Quantity

RADIUS, YOUNG = 1e-7, 60e9
MODULUS = YOUNG / (1.0 - 0.1**2)
STRESS, WORK, RANGE = 0.9e9, 0.4, 0.3e-9
TIP = {
    "clock": {"duration": 1e-3, "step": 1e-3},
    "solid": {"youngs_modulus": YOUNG, "poisson_ratio": 0.1},
    "sphere": {"radius": RADIUS},
    "adhesion": {"work": 0.3},
    "bonds": {"model": "none", "stress": 0.7e9},
    "drive": {"speed": 1e-6},
}
LOADS = np.linspace(-120e-9, 400e-9, 14)
FREE = ["bonds.stress", "adhesion.work"]


def measured(radius, error):
    """Return a table of friction over the load without scatter, its errors being a share of its mean."""
    friction = STRESS * np.pi * radius**2
    errors = np.full(len(friction), error * friction.mean())
    curve = Curve("friction_force", friction, errors)
    conditions = {"speed": np.full(14, 1e-6), "mount": LOADS}
    return Measured(Path("tip.csv"), "load", conditions, (curve,))


def problem(work, data, count, **common):
    """Return the least squares of the first free numbers of the tip, which start at the truth."""
    scene = sim.load({**TIP, "adhesion": {"work": work}, "contact": {"load": 0.0}})
    free = [
        Free(key, Quantity(unit, key), start, 1e-3 * start, 1e3 * start)
        for key, unit, start in zip(FREE, ("Pa", "J/m^2"), (STRESS, WORK), strict=True)
    ]
    return problem_of(scene, [data], free[:count], common)


def test_the_error_of_the_spring_constant_is_that_of_the_work_and_two_thirds_of_it_of_the_stress():
    data = measured(jkr.radius_at_load(LOADS, WORK, RADIUS, MODULUS), 1e-6)
    # the cube of the radius goes with load and work together, so the stress hides a common factor of both
    with_spring = problem(WORK, data, 2, normal_load=0.05)
    covariance = covariance_at(with_spring, with_spring.start)
    errors = np.sqrt(np.diag(covariance))
    assert_allclose(errors, [0.05 / 1.5, 0.05, 1.0], rtol=1e-3, atol=0)
    assert covariance[0, 1] / errors[0] / errors[1] < -0.999
    without = problem(WORK, data, 2)
    assert np.all(np.diag(covariance_at(without, without.start)) < 1e-8)


def test_a_wrong_spring_constant_is_found_if_the_work_is_known():
    data = measured(jkr.radius_at_load(LOADS, WORK, RADIUS, MODULUS), 1e-5)
    wrong = data._replace(conditions={**data.conditions, "mount": 1.1 * LOADS})
    sought = problem(WORK, wrong, 1, normal_load=0.2)
    result = minimum(sought, sought.start + [0.1, 0.0])
    # all readings are ten percent too large, half of the size that is expected
    assert_allclose(np.exp(result.x[0]), STRESS, rtol=1e-6, atol=0)
    assert_allclose(result.x[1], 0.5, rtol=1e-4, atol=0)
    # the curve that is drawn is over the readings, too
    rows = "mount", np.arange(len(LOADS))
    over, drawn = sought.between(result.x, 0, "friction_force", rows)
    true = jkr.radius_at_load(over / 1.1, WORK, RADIUS, MODULUS)
    assert_allclose(drawn, STRESS * np.pi * true**2, rtol=1e-4, atol=0)


def test_a_common_error_of_an_unknown_column_and_draws_with_that_of_the_mount_are_refused():
    data = measured(jkr.radius_at_load(LOADS, WORK, RADIUS, MODULUS), 1e-5)
    with pytest.raises(sim.BadInput, match=r"--common load: .*normal_load"):
        problem(WORK, data, 1, load=0.2)
    with_spring = problem(WORK, data, 1, normal_load=0.2)
    with pytest.raises(sim.BadInput, match=r"--common normal_load: --compare"):
        next(draws_of(with_spring, data.curves[0].values, np.random.default_rng(1)))


@pytest.mark.verify
def test_stress_work_and_range_of_a_tip_are_found_and_a_fit_without_range_misses_them():
    adhesion = WORK, cohesive.stress_of_range(WORK, RANGE), RADIUS, MODULUS
    touch = cohesive.equilibrium(LOADS, 0.0, 0.0, *adhesion)
    data = measured(touch.inner, 1e-3)
    cohesive_tip = {"load": 0.0, "model": "cohesive", "range": 0.2e-9}
    scene = sim.load({**TIP, "contact": cohesive_tip})
    result = fit(scene, [data], [*FREE, "contact.range"], steady=True)
    assert_allclose([*result.values.values()], [STRESS, WORK, RANGE], rtol=1e-3, atol=0)
    without = fit(
        sim.load({**TIP, "contact": {"load": 0.0}}), [data], FREE, steady=True
    )
    assert without.values["bonds.stress"] < 0.9 * STRESS
