"""Correlation times: within their standard errors of exact ones, and unknown where nothing tells them."""

import math

import numpy as np
import pytest
from helpers import lens
from helpers.lens import FIELD, scene

from sim import analysis
from sim.analysis.statistics import autocovariance
from sim.ensemble.simulate import run
from sim.parts import drive
from sim.parts.shear import models as shear
from sim.parts.shear.process import Time
from sim.scenario.clock import Clock, Ensemble


def squared_ornstein_uhlenbeck(rng, members, records, keep, pairs=5):
    """Energies of modes whose amplitudes keep a share from record to record: correlation keep^(2 lag)."""
    weights = 1.0 / np.arange(1.0, pairs + 1.0)
    state, energy = rng.normal(size=(members, pairs, 2)), np.empty((members, records))
    for k in range(records):
        if k:
            state = keep * state + math.sqrt(1.0 - keep**2) * rng.normal(size=state.shape)
        energy[:, k] = np.einsum("mpc,p->m", state**2, weights)
    return energy


def exact_time(keep, step):
    """Integral of keep^(2 lag)."""
    return -0.5 * step / math.log(keep)


@pytest.mark.parametrize(
    ("members", "records", "keep"), [(1, 8000, 0.9), (2, 4000, 0.9), (64, 400, 0.8), (16384, 60, 0.8)]
)
def test_correlation_time_is_within_five_of_its_standard_errors(members, records, keep):
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(7), members, records, keep)
    time, sem, _ = analysis.integral_time(energy, step=0.01)
    assert abs(time - exact_time(keep, 0.01)) < 5.0 * sem
    assert sem < 0.3 * time


def test_two_members_tell_as_much_as_their_difference():
    difference = squared_ornstein_uhlenbeck(np.random.default_rng(9), 1, 2000, 0.8)[0]
    difference -= difference.mean()
    shared = np.random.default_rng(10).normal(size=2000)
    pair = np.stack([shared + difference / 2.0, shared - difference / 2.0])
    alone = analysis.integral_time(difference[np.newaxis], 1.0)
    np.testing.assert_allclose(analysis.integral_time(pair, 1.0), alone, rtol=1e-9)


def test_correlation_time_does_not_see_a_drift_that_members_share():
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(8), 64, 400, 0.8)
    drift = np.linspace(0.0, 100.0, 400)
    np.testing.assert_allclose(
        analysis.integral_time(energy + drift, 1.0), analysis.integral_time(energy, 1.0), rtol=1e-9
    )


@pytest.mark.parametrize(
    "energy",
    [
        np.ones((4, 100)),
        np.full((4, 100), 0.1) * (1.0 + 1e-14 * np.random.default_rng(1).normal(size=(4, 100))),
        np.ones((4, 100)) * np.arange(1.0, 5.0)[:, None],
        np.random.default_rng(2).normal(size=(64, 1000)),
        np.ones((4, 1)),
        np.full((4, 100), math.nan),
        squared_ornstein_uhlenbeck(np.random.default_rng(3), 256, 20, 0.99),
    ],
    ids=["constant", "rounding", "frozen", "white", "one record", "nan", "shorter than its memory"],
)
def test_there_is_no_correlation_time_where_nothing_decays_visibly(energy):
    assert all(math.isnan(number) for number in analysis.integral_time(energy, 0.1)[:2])


@pytest.mark.parametrize("records_a_time", [1.6, 2.4])
def test_records_that_are_too_coarse_give_a_bound_and_no_number(records_a_time):
    keep = math.exp(-0.5 / records_a_time)
    for seed in range(20):
        energy = squared_ornstein_uhlenbeck(np.random.default_rng(seed), 64, 400, keep)
        time, sem, below = analysis.integral_time(energy, step=0.01)
        if records_a_time < 2.0:
            assert math.isnan(time) and below == 0.02
        else:
            # Simpson's rule is off by 1/(180 2.4^4) = 2e-4 and the window by e^-6, each far below the error
            assert abs(time - 0.01 * records_a_time) < 4.0 * sem and math.isnan(below)


def test_few_values_tell_neither_a_time_nor_a_bound():
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(4), 2, 12, 0.1)
    assert all(math.isnan(number) for number in analysis.integral_time(energy, 1.0))


def test_a_run_recorded_too_seldom_says_so_in_its_table():
    field = shear.Banded(correlation=Time(time=0.02), **FIELD)
    coarse = run(scene(drive=drive.Steady(speed=1e-3), shear=field, clock=Clock(duration=4.0, step=0.02),
                       ensemble=Ensemble(members=16)))  # fmt: skip
    assert float(analysis.statistics(coarse)["correlation_time_below"]) == 0.04
    assert {row["t_c\n(ms)"] for row in analysis.table(coarse)} == {"<40"}


def test_energy_forgets_twice_as_fast_as_its_amplitudes():
    """Amplitudes forget over the correlation time, energies over half of it."""
    field = shear.Modal(correlation=Time(time=0.02), **FIELD)
    steady = scene(drive=drive.Steady(speed=1e-3), shear=field, clock=Clock(duration=0.4, step=0.001),
                   ensemble=Ensemble(members=128))  # fmt: skip
    result = analysis.statistics(run(steady))
    assert abs(float(result["correlation_time"]) - 0.01) < 5.0 * float(result["correlation_time_sem"])
    assert float(result["correlation_time_sem"]) < 1e-3


def test_a_ramp_has_no_correlation_time():
    assert math.isnan(analysis.correlation_time(lens.ramp())["correlation_time"])


@pytest.mark.parametrize("lags", [50, 1000])
def test_a_covariance_is_the_mean_of_the_products_of_deviations(monkeypatch, lags):
    monkeypatch.setitem(autocovariance.__globals__, "_LAGS", lags)
    values = np.random.default_rng(6).gamma(2.0, size=(3, 117))
    aside = values - values.mean(axis=0)
    exact = [np.sum(aside[:, k:] * aside[:, : 117 - k]) / (2.0 * (117 - k)) for k in range(min(lags, 117))]
    np.testing.assert_allclose(autocovariance(values), exact, rtol=0, atol=1e-13 * exact[0])


@pytest.mark.verify
def test_scores_of_the_correlation_time_are_standard_normal():
    scores = []
    for seed in range(300):
        energy = squared_ornstein_uhlenbeck(np.random.default_rng(seed), 16, 500, 0.9)
        time, sem, _ = analysis.integral_time(energy, 1.0)
        scores.append((time - exact_time(0.9, 1.0)) / sem)
    # the window cuts e^-6 off and the error is Gaussian theory: mean and spread to a third of a unit
    assert abs(np.mean(scores)) < 0.33 and 0.67 < np.std(scores) < 1.33
