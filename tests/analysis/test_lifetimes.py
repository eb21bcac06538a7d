"""Lifetimes that runs end before: against exponential ones, with intervals that hold what they promise."""

import math
import warnings

import numpy as np
import pytest
import xarray as xr
from scipy import stats

from sim import analysis

ENSEMBLES = 1000


def censored(rng, end, members=64):
    """Standard exponential lifetimes; nan beyond the end."""
    times = rng.exponential(size=(ENSEMBLES, members))
    return np.where(times <= end, times, math.nan)


@pytest.mark.parametrize("end", [1.0, 3.0], ids=["a third goes on", "one in twenty goes on"])
def test_intervals_of_censored_lifetimes_hold_what_they_promise(end):
    estimates = [analysis.lifetime(times, end) for times in censored(np.random.default_rng(21), end)]
    for name, truth in (("rate", 1.0), ("half", math.log(2.0))):
        low, high = (np.array([getattr(time, f"{name}_{side}") for time in estimates]) for side in ("low", "high"))
        high[np.isnan(high)] = math.inf  # a median that may lie beyond the runs
        assert 0.92 < np.mean((low <= truth) & (truth <= high)) < 0.98, name


def test_the_median_of_censored_lifetimes_is_that_of_scipys_survival():
    rng = np.random.default_rng(5)
    for size, end in ((5, 2.0), (20, 0.8), (64, 1.0), (200, 9.0)):
        times = np.round(rng.exponential(size=size), 2)  # with equal ones
        times[times > end] = math.nan
        happened = np.isfinite(times)
        survival = stats.ecdf(stats.CensoredData(times[happened], right=np.full(np.sum(~happened), end))).sf
        with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
            interval = survival.confidence_interval(0.95, method="log-log")
        result = analysis.lifetime(times, end)
        for name, curve in (("half", survival), ("half_low", interval.low), ("half_high", interval.high)):
            below = curve.quantiles[curve.probabilities <= 0.5]
            np.testing.assert_equal(getattr(result, name), below[0] if below.size else math.nan, name)


def test_the_rate_counts_the_time_of_those_that_go_on():
    result = analysis.lifetime(np.array([1.0, 2.0, math.nan, math.nan]), np.array([9.0, 9.0, 3.0, 4.0]))
    np.testing.assert_allclose(result.rate, 2.0 / 10.0, rtol=1e-15)
    # chi-square with 4 and 6 degrees of freedom
    np.testing.assert_allclose(
        [result.rate_low, result.rate_high], [0.48441855708793 / 20, 14.4493753354 / 20], rtol=1e-10
    )


def test_a_median_that_the_runs_do_not_reach_is_unknown():
    none = analysis.lifetime(np.full(8, math.nan), 5.0)
    assert math.isnan(none.half) and none.rate == none.rate_low == 0.0
    # nobody in 40 s: with 95 % the rate is below the 97.5 % quantile of an exponential law over 40 s
    np.testing.assert_allclose(none.rate_high, -math.log(0.025) / 40.0, rtol=1e-12)
    few = analysis.lifetime(np.array([1.0, math.nan, math.nan, math.nan]), 5.0)
    assert math.isnan(few.half) and few.rate == 1.0 / 16.0


def test_a_first_passage_is_between_records_and_unknown_where_there_is_none():
    t = np.arange(5.0)
    paths = np.array(
        [[4.0, 3.0, 1.0, 0.0, 5.0], [0.0, 1.0, 2.0, 1.0, 0.0], [2.0, 2.0, 2.0, 2.0, 2.0], [0.0, 1.0, 1.5, 1.0, 3.5]]
    )
    paths = xr.DataArray(paths, {"t": t}, ("member", "t"), name="x")
    result = analysis.first_passage(paths, 2.0)
    np.testing.assert_allclose(result, [1.5, 2.0, 0.0, 3.4], rtol=1e-15)
    assert math.isnan(analysis.first_passage(paths, 4.5)[1]) and result.attrs["units"] == "s"
