"""Statistics over members and stationary time: against exact laws, with intervals that hold what they promise."""

import math
import warnings

import numpy as np
import pytest
import xarray as xr
from helpers import lens
from helpers.draws import ornstein_uhlenbeck
from helpers.lens import FIELD, scene
from helpers.parts import (
    Adhesion,
    Clock,
    Ensemble,
    Equilibrium,
    Time,
    bonds,
    drive,
    read,
    run,
    shear,
)
from helpers.printed import rows_of
from numpy.testing import assert_allclose, assert_array_equal
from scipy import special, stats

from sim.parts.contact.models import Solid, Sphere
from sim.read.correlation import covariance_of
from sim.read.lifetimes import lifetimes
from sim.read.statistics import QUANTILES, quantile_ranks
from sim.spectrum.families import Gaussian
from sim.units.notation import concise

LEVELS = np.array(QUANTILES)
#: Ensembles that a coverage is counted over, and its bounds; five of its standard errors are 3.4 %.
ENSEMBLES, LEAST, MOST = 1000, 0.92, 0.98


LAWS = {
    "normal": (lambda values: values, stats.norm()),
    "exponential": (lambda values: -np.log(special.ndtr(-values)), stats.expon()),
    "gamma": (
        lambda values: special.gammaincinv(3.0, special.ndtr(values)),
        stats.gamma(3.0),
    ),
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
    return read.summary(numbers), law


def test_quantiles_and_intervals_of_64_members_hold_what_they_promise(ensembles):
    result, law = ensembles
    # of the k-th of n ordered numbers the exact mean share below is k/(n + 1); the place is between k's
    places = 1.0 + LEVELS * 63.0
    below = law.cdf(result["x"].quantile).mean(axis=1)
    errors = np.sqrt(LEVELS * (1.0 - LEVELS) / 64.0 / ENSEMBLES)
    assert np.all(np.abs(below - places / 65.0) < 5.0 * errors)
    assert LEAST < share_holding(result["x"].low, result["x"].high, law.mean()) < MOST
    for k, level in enumerate(LEVELS):
        low, high = (
            end.isel(quantile=k)
            for end in (result["x"].quantile_low, result["x"].quantile_high)
        )
        assert bool((low <= result["x"].quantile.isel(quantile=k)).all()) and bool(
            (low < high).all()
        )
        assert LEAST < share_holding(low, high, law.ppf(level)) < MOST, level


def test_few_members_bound_no_quantile():
    low, high = quantile_ranks(np.arange(1.0, 200.0)[:, None], LEVELS)
    known = np.isfinite(low) & np.isfinite(high)
    assert np.array_equal(known, np.isfinite(low)) and np.array_equal(
        known, np.isfinite(high)
    )
    # 0.95^59 = 0.0485 is the first power below what may be left out, and 2 (1/2)^6 = 0.03125
    assert [int(np.argmax(level)) + 1 for level in known.T] == [59, 6, 59]
    assert np.all(low[known] >= 0.0) and np.all(
        (high <= np.arange(0.0, 199.0)[:, None])[known]
    )


def test_few_members_widen_an_interval_and_those_of_shares_hold_what_they_promise():
    for members in [2, 3, 5]:
        drawn = np.random.default_rng(12).normal(size=(members, ENSEMBLES))
        result = read.summary(xr.Dataset({"x": (("member", "t"), drawn)}))
        assert LEAST < share_holding(result["x"].low, result["x"].high, 0.0) < MOST
        low, high = (result["x"].value + z * result["x"].sem for z in (-1.96, 1.96))
        assert share_holding(low, high, 0.0) < LEAST
    for detached in [0.02, 0.1, 0.5]:
        opened = (np.random.default_rng(13).random((64, ENSEMBLES)) < detached).astype(
            float
        )
        result = read.summary(
            xr.Dataset({"fraction_detached": (("member", "t"), opened)})
        )
        low, high = result["fraction_detached"].low, result["fraction_detached"].high
        assert share_holding(low, high, detached) > LEAST and float(low.min()) >= -1e-15
        none = read.summary(
            xr.Dataset({"fraction_detached": (("member",), np.zeros(64))})
        )
        # Wilson's bound of none in 64: z^2/(64 + z^2)
        assert_allclose(
            none["fraction_detached"].high,
            3.841458820694124 / 67.84145882069413,
            rtol=1e-12,
        )
        assert none["fraction_detached"].low == 0.0


def covered(law, members, length, ensembles):
    """Shares of intervals that hold the truth, and of series that have one, for the mean and each quantile."""
    of, exact = LAWS[law]
    shape = ensembles, members, 5 * length  # five records a correlation time
    drawn = of(ornstein_uhlenbeck(np.random.default_rng(14), shape, math.exp(-0.2)))
    result = [read.over_time(series) for series in drawn]
    ends = [
        np.column_stack(
            [[estimate[end], *estimate[f"quantile_{end}"]] for estimate in result]
        )
        for end in ("low", "high")
    ]
    has_interval, truth = (
        np.isfinite(ends[0]) & np.isfinite(ends[1]),
        np.array([[exact.mean(), *exact.ppf(LEVELS)]]).T,
    )
    hits = (ends[0] <= truth) & (truth <= ends[1])
    return [
        float(hit[known].mean()) if known.any() else math.nan
        for hit, known in zip(hits, has_interval, strict=True)
    ], has_interval.mean(axis=1)


@pytest.mark.verify
@pytest.mark.parametrize("law", sorted(LAWS))
@pytest.mark.parametrize("members", [1, 4])
def test_intervals_of_1000_series_of_100_correlation_times_hold_what_they_promise(
    law, members
):
    shares, has_interval = covered(law, members, 100, ENSEMBLES)
    # one series in a thousand seems to forget so fast that it states the interval of a tail, too
    assert all(
        LEAST < share < MOST
        for share, known in zip(shares, has_interval, strict=True)
        if known > 0.01
    )
    assert np.all(has_interval[[0, 2]] > 0.9)
    assert np.all(has_interval[[1, 3]] < 0.01 if members == 1 else has_interval > 0.5)


def test_a_single_series_that_is_short_for_its_memory_has_no_interval():
    for length in (1, 2, 5, 10):
        shares, has_interval = covered("exponential", 1, length, 400)
        # of all series: a true share of at most 8 %
        missed = has_interval * (1.0 - np.nan_to_num(shares))
        assert np.all(missed < 0.08 + 5.0 * math.sqrt(0.92 * 0.08 / 400.0)), (
            length,
            missed,
        )
        assert has_interval.max() < 0.1 * length


def test_correlation_times_and_free_values_are_those_of_the_law_and_of_white_noise():
    series = ornstein_uhlenbeck(np.random.default_rng(17), (64, 2000), math.exp(-0.2))
    result, memory = read.over_time(series), read.integral_time(series, step=0.1)
    assert abs(memory.time - 0.5) < 5.0 * memory.sem
    # the mean of n records has the variance (1 + k)/(1 - k)/n, its estimate from 64 means the error sqrt(2/63)
    keep = math.exp(-0.2)
    exact = 64 * 2000 * (1.0 - keep) / (1.0 + keep)
    assert abs(result["number"] / exact - 1.0) < 5.0 * math.sqrt(2.0 / 63.0)
    series = ornstein_uhlenbeck(np.random.default_rng(16), (1, 50), math.exp(-0.2))
    assert np.all(np.isnan(read.over_time(series)["quantile_low"]))
    white = np.random.default_rng(18).normal(size=(1, 20_000))
    assert abs(read.over_time(white)["number"] / 20_000 - 1.0) < 0.1
    assert math.isnan(read.integral_time(white, step=1.0).time)


NAME = "correlation_time"
STEADY = {"drive": drive.Steady(speed=4e-3), "clock": Clock(duration=0.8, step=0.01)}


def test_statistics_leave_out_missing_values_and_a_distribution_is_over_members_and_the_second_half():
    for members in [40, 3, 1]:
        values = (
            ornstein_uhlenbeck(
                np.random.default_rng(19), (members, 2000), math.exp(-0.2)
            )
            ** 2
        )
        values[0, 100:] = math.nan
        result, known = read.over_time(values), values[np.isfinite(values)]
        assert_allclose(result["quantile"], np.quantile(known, LEVELS), rtol=1e-13)
        assert_allclose(result["value"], np.nanmean(values, axis=1).mean(), rtol=1e-13)
        assert (members == 1) == math.isnan(result["sem"])
    dataset = run(
        scene(
            **STEADY,
            ensemble=Ensemble(members=20),
            sweep={"contact.load": [1e-3, 4e-3]},
        )
    )
    result = read.distribution(dataset)
    late = dataset["work_of_adhesion"].isel(t=slice(dataset.sizes["t"] // 2, None))
    assert_allclose(
        result["work_of_adhesion"].value, late.mean(("member", "t")), rtol=1e-13
    )
    assert_allclose(
        result["work_of_adhesion"].std, late.std(("member", "t")), rtol=1e-9
    )
    means = late.mean("t")
    assert_allclose(
        result["work_of_adhesion"].sem,
        means.std("member", ddof=1) / math.sqrt(20),
        rtol=1e-10,
    )
    assert_allclose(
        result["work_of_adhesion"].quantile,
        late.quantile(LEVELS, ("member", "t")).T,
        rtol=1e-13,
    )
    assert result["work_of_adhesion"].value.dims == ("contact_load",) and bool(
        result["speed"].sem.isnull().all()
    )
    assert result["work_of_adhesion"].unit == "J/m^2"


def squared_ornstein_uhlenbeck(rng, members, records, keep, pairs=5):
    """Energies of modes whose amplitudes keep a share from record to record: correlation keep^(2 lag)."""
    weights = 1.0 / np.arange(1.0, pairs + 1.0)
    return np.einsum(
        "mpct,p->mt",
        ornstein_uhlenbeck(rng, (members, pairs, 2, records), keep) ** 2,
        weights,
    )


def exact_time(keep, step):
    """Integral of keep^(2 lag)."""
    return -0.5 * step / math.log(keep)


def test_correlation_time_is_within_its_errors_or_a_bound_of_records_that_are_too_coarse():
    for members, records, keep in [
        (1, 8000, 0.9),
        (2, 4000, 0.9),
        (64, 400, 0.8),
        (16384, 60, 0.8),
    ]:
        energy = squared_ornstein_uhlenbeck(
            np.random.default_rng(7), members, records, keep
        )
        time, sem, *_ = read.integral_time(energy, step=0.01)
        assert abs(time - exact_time(keep, 0.01)) < 5.0 * sem and sem < 0.3 * time
    for records_a_time in [1.6, 2.4]:
        keep = math.exp(-0.5 / records_a_time)
        for seed in range(20):
            energy = squared_ornstein_uhlenbeck(
                np.random.default_rng(seed), 64, 400, keep
            )
            time, sem, below, _ = read.integral_time(energy, step=0.01)
            if records_a_time < 2.0:
                assert math.isnan(time) and below == 0.02
            else:
                # Simpson's rule is off by 1/(180 2.4^4) = 2e-4 and the window by e^-6, each far below the error
                assert abs(time - 0.01 * records_a_time) < 4.0 * sem and math.isnan(
                    below
                )


def test_energy_forgets_twice_as_fast_as_its_amplitudes_and_records_too_seldom_are_named():
    # Amplitudes forget over the correlation time, energies over half of it.
    field = shear.Modal(correlation=Time(time=0.02), **FIELD)
    steady = scene(
        drive=drive.Steady(speed=1e-3),
        shear=field,
        clock=Clock(duration=0.4, step=0.001),
        ensemble=Ensemble(members=128),
    )
    time = read.correlation_time(run(steady))
    assert abs(float(time.value) - 0.01) < 5.0 * float(time.sem)
    assert float(time.sem) < 1e-3
    field = shear.Banded(correlation=Time(time=0.02), **FIELD)
    coarse = run(
        scene(
            drive=drive.Steady(speed=1e-3),
            shear=field,
            clock=Clock(duration=4.0, step=0.02),
            ensemble=Ensemble(members=16),
        )
    )
    assert float(read.correlation_time(coarse).high) == 0.04
    (cell,) = (
        row["mean"]
        for row in rows_of(coarse, read.spread)
        if row["quantity"] == "t_c (ms)"
    )
    assert cell == "< 40*"


def test_a_correlation_time_is_one_number_in_table_and_csv_and_a_missing_one_has_its_reason():
    field = shear.Modal(correlation=Time(time=0.02), **FIELD)
    parts = {"drive": drive.Steady(speed=1e-3), "shear": field}
    noise = {"ensemble": Ensemble(members=32)}
    fine, seldom = Clock(0.4, 0.001), Clock(0.4, 0.001, 0.02)
    for clock, shear_part, reason in (
        (fine, field, ""),
        (seldom, field, "reduce clock.record"),
        (Clock(0.03, 0.001), field, "increase clock.duration"),
        (fine, shear.Uniform(), "nothing fluctuates"),
    ):
        dataset = run(scene(**parts | noise | {"clock": clock, "shear": shear_part}))
        result = read.correlation_time(dataset)
        energy = dataset["fluctuation_energy"].transpose(..., "t").to_numpy()
        exact = read.integral_time(np.atleast_2d(energy), clock.record or clock.step)
        assert reason in exact.reason and reason in result.reason.item()
        assert bool(exact.reason) is bool(reason) is math.isnan(exact.time)
        assert_array_equal(result.value, exact.time)
        frame = read.long(read.Run(dataset)).set_index("quantity")
        assert_array_equal(frame.loc[[NAME], "mean"], exact.time)
        assert not any(NAME in column for column in frame.columns)
    dataset = run(scene(**parts | noise | {"clock": fine}))
    time = read.correlation_time(dataset)
    expected = concise(1e3 * float(time.value), 1e3 * float(time.sem))
    assert expected in [
        row["mean"]
        for row in rows_of(dataset, read.spread)
        if row["quantity"] == "t_c (ms)"
    ]
    ramp = read.correlation_time(lens.ramp())
    assert ramp.reason.item() == "the speed changes"


def test_there_is_no_correlation_time_where_nothing_decays_visibly_or_on_a_ramp():
    for energy in [
        np.ones((4, 100)),
        np.full((4, 100), 0.1)
        * (1.0 + 1e-14 * np.random.default_rng(1).normal(size=(4, 100))),
        np.ones((4, 100)) * np.arange(1.0, 5.0)[:, None],
        np.random.default_rng(2).normal(size=(64, 1000)),
        np.ones((4, 1)),
        np.full((4, 100), math.nan),
        squared_ornstein_uhlenbeck(np.random.default_rng(3), 256, 20, 0.99),
    ]:
        assert all(math.isnan(number) for number in read.integral_time(energy, 0.1)[:2])
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(4), 2, 12, 0.1)
    assert all(math.isnan(number) for number in read.integral_time(energy, 1.0)[:3])
    assert math.isnan(read.correlation_time(lens.ramp()).value)


def test_a_covariance_is_the_mean_of_products_of_deviations_and_sees_nothing_that_members_share():
    difference = squared_ornstein_uhlenbeck(np.random.default_rng(9), 1, 2000, 0.8)[0]
    difference -= difference.mean()
    shared = np.random.default_rng(10).normal(size=2000)
    pair = np.stack([shared + difference / 2.0, shared - difference / 2.0])
    alone = read.integral_time(difference[np.newaxis], 1.0)
    assert_allclose(read.integral_time(pair, 1.0)[:3], alone[:3], rtol=1e-9)
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(8), 64, 400, 0.8)
    drift = np.linspace(0.0, 100.0, 400)
    assert_allclose(
        read.integral_time(energy + drift, 1.0)[:3],
        read.integral_time(energy, 1.0)[:3],
        rtol=1e-9,
    )


@pytest.mark.parametrize(
    ("lags", "known"), [((40, 600), 600), ((200, 600), 200), ((5000,), 2000)]
)
def test_products_are_summed_over_as_many_records_as_the_window_needs_in_stretches_and_groups(
    monkeypatch, lags, known
):
    monkeypatch.setitem(covariance_of.__globals__, "_LAGS", lags)
    # groups of less than all members
    monkeypatch.setitem(covariance_of.__globals__, "_AT_ONCE", 2000)
    # the window is 6 / 0.1 records
    values = ornstein_uhlenbeck(np.random.default_rng(12), (7, 2000), 0.9)
    off = values - values.mean(axis=0)
    products = [
        sum(member[k:] @ member[: 2000 - k] for member in off) / (6.0 * (2000 - k))
        for k in range(known)
    ]
    assert_allclose(
        covariance_of(values, values.mean(axis=0), 6.0), products, rtol=0.0, atol=1e-12
    )


def censored(rng, end, members=64):
    """Standard exponential lifetimes; nan beyond the end."""
    times = rng.exponential(size=(ENSEMBLES, members))
    return np.where(times <= end, times, math.nan)


@pytest.mark.parametrize(
    "end", [1.0, 3.0], ids=["a third goes on", "one in twenty goes on"]
)
def test_intervals_of_censored_lifetimes_hold_what_they_promise(end):
    estimates = [
        read.lifetime(times, end) for times in censored(np.random.default_rng(21), end)
    ]
    for name, truth in (("rate", 1.0), ("half", math.log(2.0))):
        low, high = (
            np.array([getattr(time, f"{name}_{side}") for time in estimates])
            for side in ("low", "high")
        )
        high[np.isnan(high)] = math.inf  # a median that may lie beyond the runs
        assert 0.92 < np.mean((low <= truth) & (truth <= high)) < 0.98, name


def test_contacts_that_close_late_count_as_long_as_they_are_closed():
    rng = np.random.default_rng(22)
    hits = {"half": [], "rate": []}
    # exponential lives do not age: a contact that closed late is like any other of then
    for _ in range(ENSEMBLES):
        begins = np.where(rng.random(64) < 0.6, rng.exponential(size=64), 0.0)
        times = begins + rng.exponential(size=64)
        estimate = read.lifetime(np.where(times <= 3.0, times, math.nan), 3.0, begins)
        hits["rate"].append(estimate.rate_low <= 1.0 <= estimate.rate_high)
        hits["half"].append(
            estimate.half_low
            <= math.log(2.0)
            <= np.nan_to_num(estimate.half_high, nan=math.inf)
        )
    assert all(LEAST < np.mean(hit) < MOST for hit in hits.values()), {
        key: np.mean(hit) for key, hit in hits.items()
    }


def test_censored_lifetimes_have_the_median_of_scipy_and_the_rate_of_chi_square():
    rng = np.random.default_rng(5)
    for size, end in ((5, 2.0), (20, 0.8), (64, 1.0), (200, 9.0)):
        times = np.round(rng.exponential(size=size), 2)  # with equal ones
        times[times > end] = math.nan
        happened = np.isfinite(times)
        survival = stats.ecdf(
            stats.CensoredData(times[happened], right=np.full(np.sum(~happened), end))
        ).sf
        with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
            interval = survival.confidence_interval(0.95, method="log-log")
        result = read.lifetime(times, end)
        # the share of members that outlast the run has a binomial interval
        outlasts = stats.binomtest(int(np.sum(~happened)), size).proportion_ci(0.95)
        beyond = {"half_low": end if outlasts.low > 0.5 else math.nan}
        for name, curve in (
            ("half", survival),
            ("half_low", interval.low),
            ("half_high", interval.high),
        ):
            below = curve.quantiles[curve.probabilities <= 0.5]
            otherwise = beyond.get(name, math.nan)
            np.testing.assert_equal(
                getattr(result, name), below[0] if below.size else otherwise, name
            )
    result = read.lifetime(
        np.array([1.0, 2.0, math.nan, math.nan]), np.array([9.0, 9.0, 3.0, 4.0])
    )
    assert_allclose(result.rate, 2.0 / 10.0, rtol=1e-15)
    # chi-square with 4 and 6 degrees of freedom
    assert_allclose(
        [result.rate_low, result.rate_high],
        [0.48441855708793 / 20, 14.4493753354 / 20],
        rtol=1e-10,
    )
    none = read.lifetime(np.full(8, math.nan), 5.0)
    assert math.isnan(none.half) and none.rate == none.rate_low == 0.0
    # if half of the members had it by then, the other five would all outlast the run once in 32 times
    bounds = [read.lifetime(np.full(n, math.nan), 5.0).half_low for n in (5, 6, 8)]
    np.testing.assert_equal(bounds, [math.nan, 5.0, 5.0])
    # nobody in 40 s: with 95 % the rate is below the 97.5 % quantile of an exponential law over 40 s
    assert_allclose(none.rate_high, -math.log(0.025) / 40.0, rtol=1e-12)
    few = read.lifetime(np.array([1.0, math.nan, math.nan, math.nan]), 5.0)
    assert math.isnan(few.half) and few.rate == 1.0 / 16.0


def test_members_that_are_never_in_contact_are_no_survivors():
    # a tension beyond the pull-off of those members whose fluctuations are large at the start
    field = {
        "spectrum": Gaussian(rms=63e3, length=15e-6),
        "points": 64,
        "correlation": Time(time=10e-3),
    }
    parts = {
        "clock": Clock(duration=0.1, step=2e-3),
        "solid": Solid(shear_modulus=1.1e6),
        "sphere": Sphere(radius=1.6e-3),
    }
    parts |= {
        "adhesion": Adhesion(work=35e-3),
        "drive": drive.Steady(),
        "bonds": bonds.Unbroken(),
    }
    contact = Equilibrium(load=-0.19e-3, after_pull_off="stop")
    dataset = run(
        scene(
            **parts,
            contact=contact,
            shear=shear.Banded(**field),
            ensemble=Ensemble(members=100),
        )
    )
    closed = (dataset["contact_radius"].isel(t=0) > 0.0).to_numpy()
    assert 20 < closed.sum() < 80
    times = dataset["first_detachment"]
    every, alone = (
        lifetimes(dataset.isel(member=who), times.isel(member=who), "detached")
        for who in (slice(None), closed)
    )
    for of_all, of_closed in zip(every, alone, strict=True):
        for kind in ("value", "low", "high"):
            xr.testing.assert_identical(
                *(getattr(o, kind) for o in (of_all, of_closed))
            )
    assert every[0].value > 0.0
