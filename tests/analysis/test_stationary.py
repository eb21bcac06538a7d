"""Statistics over members and stationary time: against exact laws, with intervals that hold what they promise."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers.lens import scene
from scipy import special, stats

from sim import analysis
from sim.analysis.statistics import QUANTILES, quantile_ranks
from sim.ensemble.simulate import run
from sim.parts import drive
from sim.scenario.clock import Clock, Ensemble

LEVELS = np.array(QUANTILES)
#: Ensembles that a coverage is counted over, and its bounds; five of its standard errors are 3.4 %.
ENSEMBLES, LEAST, MOST = 1000, 0.92, 0.98


def ornstein_uhlenbeck(rng, members, records, keep):
    """Standard normal series that keep a share from record to record."""
    values = np.empty((members, records))
    values[:, 0] = rng.normal(size=members)
    for k in range(1, records):
        values[:, k] = keep * values[:, k - 1] + math.sqrt(1.0 - keep**2) * rng.normal(size=members)
    return values


LAWS = {
    "normal": (lambda values: values, stats.norm()),
    "exponential": (lambda values: -np.log(special.ndtr(-values)), stats.expon()),
    "gamma": (lambda values: special.gammaincinv(3.0, special.ndtr(values)), stats.gamma(3.0)),
}


def share_holding(low, high, truth):
    """Share of intervals that hold a truth."""
    return float(np.mean((np.asarray(low) <= truth) & (truth <= np.asarray(high))))


@pytest.fixture(scope="module", params=sorted(LAWS))
def ensembles(request):
    """Statistics of a thousand ensembles of 64 members, and their law."""
    of, law = LAWS[request.param]
    drawn = of(np.random.default_rng(11).normal(size=(64, ENSEMBLES)))
    numbers = xr.Dataset({"x": (("member", "t"), drawn)})
    return analysis.summary(numbers), law


def test_intervals_of_64_members_hold_what_they_promise(ensembles):
    result, law = ensembles
    assert LEAST < share_holding(result["x_low"], result["x_high"], law.mean()) < MOST
    for k, level in enumerate(LEVELS):
        low, high = (result[f"x_quantile_{end}"].isel(quantile=k) for end in ("low", "high"))
        assert bool((low <= result["x_quantile"].isel(quantile=k)).all()) and bool((low < high).all())
        assert LEAST < share_holding(low, high, law.ppf(level)) < MOST, level


def test_quantiles_are_those_of_the_law(ensembles):
    result, law = ensembles
    # of the k-th of n ordered numbers the exact mean share below is k/(n + 1); the place is between k's
    places = 1.0 + LEVELS * 63.0
    below = law.cdf(result["x_quantile"]).mean(axis=1)
    errors = np.sqrt(LEVELS * (1.0 - LEVELS) / 64.0 / ENSEMBLES)
    assert np.all(np.abs(below - places / 65.0) < 5.0 * errors)


def test_skewness_of_a_normal_law_is_none_within_its_error():
    drawn = np.random.default_rng(15).normal(size=(64, ENSEMBLES))
    result = analysis.summary(xr.Dataset({"x": (("member", "t"), drawn)}))["x_skewness"].to_numpy()
    error = analysis.skewness_error(64)
    assert abs(result.mean()) < 5.0 * error / math.sqrt(ENSEMBLES)
    # the spread of a spread: the skewness of 64 normal numbers has an excess kurtosis of 36/64
    assert abs(result.std() / error - 1.0) < 5.0 * math.sqrt((2.0 + 36.0 / 64.0) / 4.0 / ENSEMBLES)
    np.testing.assert_allclose(result[:9], stats.skew(drawn[:, :9], axis=0, bias=False), rtol=1e-10)


@pytest.mark.parametrize("members", [2, 3, 5])
def test_few_members_widen_the_interval_of_a_mean(members):
    drawn = np.random.default_rng(12).normal(size=(members, ENSEMBLES))
    result = analysis.summary(xr.Dataset({"x": (("member", "t"), drawn)}))
    assert LEAST < share_holding(result["x_low"], result["x_high"], 0.0) < MOST
    assert (
        share_holding(result["x_mean"] - 1.96 * result["x_sem"], result["x_mean"] + 1.96 * result["x_sem"], 0.0) < LEAST
    )


def test_quantiles_that_few_members_cannot_bound_have_no_interval():
    low, high = quantile_ranks(np.arange(1.0, 200.0)[:, None], LEVELS)
    known = np.isfinite(low) & np.isfinite(high)
    assert np.array_equal(known, np.isfinite(low)) and np.array_equal(known, np.isfinite(high))
    # 0.95^59 = 0.0485 is the first power below what may be left out, and 2 (1/2)^6 = 0.03125
    assert [int(np.argmax(level)) + 1 for level in known.T] == [59, 6, 59]
    assert np.all(low[known] >= 0.0) and np.all((high <= np.arange(0.0, 199.0)[:, None])[known])


@pytest.mark.parametrize("detached", [0.02, 0.1, 0.5])
def test_intervals_of_a_share_of_members_hold_what_they_promise(detached):
    opened = (np.random.default_rng(13).random((64, ENSEMBLES)) < detached).astype(float)
    result = analysis.summary(xr.Dataset({"fraction_detached": (("member", "t"), opened)}))
    low, high = result["fraction_detached_low"], result["fraction_detached_high"]
    assert share_holding(low, high, detached) > LEAST and float(low.min()) >= -1e-15
    none = analysis.summary(xr.Dataset({"fraction_detached": (("member",), np.zeros(64))}))
    # Wilson's bound of none in 64: z^2/(64 + z^2)
    np.testing.assert_allclose(none["fraction_detached_high"], 3.841458820694124 / 67.84145882069413, rtol=1e-12)


def covered(law, members, length, ensembles):
    """Shares of intervals that hold the truth, and of series that have one, for the mean and each quantile."""
    of, exact = LAWS[law]
    shape = ensembles * members, 5 * length  # five records a correlation time
    drawn = of(ornstein_uhlenbeck(np.random.default_rng(14), *shape, math.exp(-0.2))).reshape(ensembles, members, -1)
    result = [analysis.over_time(series) for series in drawn]
    ends = [
        np.column_stack([[estimate[end], *estimate[f"quantile_{end}"]] for estimate in result])
        for end in ("low", "high")
    ]
    has_interval, truth = np.isfinite(ends[0]) & np.isfinite(ends[1]), np.array([[exact.mean(), *exact.ppf(LEVELS)]]).T
    hits = (ends[0] <= truth) & (truth <= ends[1])
    return [
        float(hit[known].mean()) if known.any() else math.nan for hit, known in zip(hits, has_interval, strict=True)
    ], has_interval.mean(axis=1)


@pytest.mark.verify
@pytest.mark.parametrize("law", sorted(LAWS))
@pytest.mark.parametrize("members", [1, 4])
def test_intervals_of_1000_series_of_100_correlation_times_hold_what_they_promise(law, members):
    shares, has_interval = covered(law, members, 100, ENSEMBLES)
    # one series in a thousand seems to forget so fast that it states the interval of a tail, too
    assert all(LEAST < share < MOST for share, known in zip(shares, has_interval, strict=True) if known > 0.01)
    assert np.all(has_interval[[0, 2]] > 0.9) and np.all(
        has_interval[[1, 3]] < 0.01 if members == 1 else has_interval > 0.5
    )


@pytest.mark.parametrize(("members", "length"), [(1, 100), (1, 10), (4, 50)])
def test_intervals_of_series_hold_what_they_promise_and_of_short_ones_widen(members, length):
    shares, _ = covered("exponential", members, length, 200)
    # 200 of a true share between 92 and 98 %: five standard errors of either
    assert LEAST - 5.0 * math.sqrt(0.92 * 0.08 / 200.0) < shares[0] and shares[0] < 1.0


def test_short_series_state_no_interval_of_a_quantile():
    series = ornstein_uhlenbeck(np.random.default_rng(16), 1, 50, math.exp(-0.2))
    assert np.all(np.isnan(analysis.over_time(series)["quantile_low"]))


def test_the_correlation_time_and_free_values_are_those_of_the_law():
    series = ornstein_uhlenbeck(np.random.default_rng(17), 64, 2000, math.exp(-0.2))
    result = analysis.over_time(series, step=0.1)
    assert abs(result["correlation_time"] - 0.5) < 5.0 * result["correlation_time_sem"]
    # the mean of n records has the variance (1 + k)/(1 - k)/n, its estimate from 64 means the error sqrt(2/63)
    keep = math.exp(-0.2)
    exact = 64 * 2000 * (1.0 - keep) / (1.0 + keep)
    assert abs(result["effective_samples"] / exact - 1.0) < 5.0 * math.sqrt(2.0 / 63.0)


def test_white_noise_tells_as_much_as_its_values():
    result = analysis.over_time(np.random.default_rng(18).normal(size=(1, 20_000)))
    assert abs(result["effective_samples"] / 20_000 - 1.0) < 0.1 and math.isnan(result["correlation_time"])


@pytest.mark.parametrize("members", [40, 3, 1])
def test_statistics_of_some_values_leave_out_those_that_are_missing(members):
    values = ornstein_uhlenbeck(np.random.default_rng(19), members, 2000, math.exp(-0.2)) ** 2
    values[0, 100:] = math.nan
    result, known = analysis.over_time(values), values[np.isfinite(values)]
    np.testing.assert_allclose(result["quantile"], np.quantile(known, LEVELS), rtol=1e-13)
    np.testing.assert_allclose(result["mean"], np.nanmean(values, axis=1).mean(), rtol=1e-13)
    assert math.isnan(result.get("correlation_time", math.nan)) and (members == 1) == math.isnan(result["sem"])


STEADY = {"drive": drive.Steady(speed=4e-3), "clock": Clock(duration=0.8, step=0.01)}


def test_a_distribution_is_over_members_and_the_second_half():
    dataset = run(scene(**STEADY, ensemble=Ensemble(members=20), sweep={"contact.load": [1e-3, 4e-3]}))
    result = analysis.distribution(dataset)
    late = dataset["contact_area"].isel(t=slice(dataset.sizes["t"] // 2, None))
    np.testing.assert_allclose(result["contact_area_mean"], late.mean(("member", "t")), rtol=1e-13)
    np.testing.assert_allclose(result["contact_area_std"], late.std(("member", "t")), rtol=1e-9)
    means = late.mean("t")
    np.testing.assert_allclose(result["contact_area_sem"], means.std("member", ddof=1) / math.sqrt(20), rtol=1e-10)
    np.testing.assert_allclose(result["contact_area_quantile"], late.quantile(LEVELS, ("member", "t")).T, rtol=1e-13)
    assert result["contact_area_mean"].dims == ("contact_load",) and float(result["speed_sem"].max()) == 0.0
    assert result["contact_area_quantile_low"].attrs["units"] == "m^2"
