"""``sim converge``: closed forms, sampled statistics with their errors, the plan, and what is said of them."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from helpers.scenes import BONDS, CELL, CONTACTS, DRIVES, SHEARS, SPECTRUM, scene
from numpy.testing import assert_allclose
from scipy import stats

import sim.study.converge as converge_module
from sim.engine import march
from sim.ensemble.recorded import VARIABLES
from sim.parts.bonds import models as bonds
from sim.parts.drive import prescribed as drive
from sim.parts.shear import models as shear
from sim.parts.shear.amplitude import Onset
from sim.parts.shear.banded import BandedProcess
from sim.parts.shear.correlation import Slip, Time, Wave
from sim.scenario.clock import Clock, Record
from sim.spectrum.families import Gaussian, Ripple, SelfAffine
from sim.study.converge import converge, figure, plan_members, recommendation, table
from sim.study.estimates import STATISTICS, Lags, estimates
from sim.study.exact_law import Expectation, Terms, course
from sim.study.gamma_sum import GammaSum
from sim.study.settings import settings
from sim.study.stated_times import stated_times
from sim.study.verdicts import contradicted, real, within

ROUGH = SelfAffine(rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=8e-6)
STEADY = {
    "shear": shear.Banded(spectrum=ROUGH, cell=CELL, correlation=Wave(waves=1.0)),
    "drive": drive.Steady(speed=3e-4),
    "clock": Clock(duration=0.64, step=0.01, record=0.02),
}
TENSION = {
    "shear": SHEARS["modal, slip, onset"],
    "drive": DRIVES["linear ramp"],
    "contact": CONTACTS["tension"],
    "clock": Clock(duration=0.04, step=1e-3, record=2e-3),
}


def fixed_members(monkeypatch, members):
    """Take as many members in every row, whatever this machine is worth."""
    monkeypatch.setattr(converge_module, "plan_members", lambda costs, *rest: [members] * len(costs))
    monkeypatch.setattr(converge_module, "_PILOT", 0.0)


def only(monkeypatch, *labels):
    """Leave out all settings but those whose labels begin so."""

    def some(scenario):
        found, left_out = settings(scenario)
        return [setting for setting in found if setting.label.startswith(labels)], left_out

    monkeypatch.setattr(converge_module, "settings", some)


@pytest.fixture(scope="module")
def steady():
    with pytest.MonkeyPatch.context() as patch:
        fixed_members(patch, 128)
        shares = []
        return converge(scene(**STEADY), 1.0, shares.append), shares


# closed forms


@pytest.mark.parametrize("number", [1, 2, 3, 10, 300, 10**5])
def test_the_law_of_equal_weights_is_gamma(number):
    law, exact = GammaSum(np.array([2.0]), np.array([float(number)])), stats.gamma(number, scale=2.0)
    levels = np.array([1e-3, 0.01, 0.2, 0.5, 0.9, 0.99, 1 - 1e-6])
    assert_allclose(law.cumulative(exact.ppf(levels)), levels, rtol=0, atol=1e-7)
    for level in (0.01, 0.99):
        assert_allclose(law.quantile(level), exact.ppf(level), rtol=2e-5)
    values, held = law.cells
    mean = values @ held
    assert_allclose(mean, exact.mean(), rtol=1e-4)
    assert_allclose(math.sqrt((values - mean) ** 2 @ held), exact.std(), rtol=1e-4)


def test_the_law_of_unlike_weights_is_hypoexponential():
    # partial fractions: 1 - F = Σ_i Π_{j≠i} w_i/(w_i - w_j) e^{-x/w_i}
    weight = np.array([1.0, 0.5, 0.25, 0.2])
    share = [np.prod([w / (w - v) for v in weight if v != w]) for w in weight]
    x = np.array([0.1, 0.7, 2.0, 6.0])
    exact = 1.0 - sum(a * np.exp(-x / w) for a, w in zip(share, weight, strict=True))
    assert_allclose(GammaSum(weight, np.ones(4)).cumulative(x), exact, rtol=0, atol=1e-11)


def test_a_scaled_law_is_the_law_of_scaled_weights():
    law = GammaSum(np.array([1.0, 0.3]), np.array([2.0, 5.0]), constant=0.5)
    for level in (0.01, 0.99):
        assert_allclose(law.scaled(3.0).quantile(level), 3.0 * law.quantile(level), rtol=1e-12)
    assert law.scaled(0.0).quantile(0.99) == 0.0


@pytest.mark.parametrize("name", ["modal, time, constant", "modal, slip, onset", "modal self-affine", "modal ripple"])
def test_closed_moments_are_sums_over_all_modes(name):
    scenario = scene(shear=SHEARS[name], drive=DRIVES["steady"])
    energies = scenario.process.modes.energies(*scenario.solid.effective)
    amplitude = scenario.process.amplitude.factor(np.array([2e-3]), np.zeros(1))[0]
    law = Expectation(scenario, *_terms_and_course(scenario)).energy(8)
    assert_allclose(law.mean, amplitude**2 * energies.sum(), rtol=1e-12)
    assert_allclose(law.std, amplitude**2 * math.sqrt(np.sum(energies**2)), rtol=1e-12)
    assert_allclose(law.skewness, 2.0 * np.sum(energies**3) / np.sum(energies**2) ** 1.5, rtol=1e-12)


def _terms_and_course(scenario, refine=1):
    terms = Terms.of_cell(scenario)
    return terms, course(scenario, terms, np.arange(scenario.clock.steps + 1), refine)


def test_what_is_known_of_bands_is_what_the_bands_say():
    scenario = scene(**STEADY)
    bands = scenario.process.bands
    own = Expectation(scenario, Terms.of_process(scenario.process), _terms_and_course(scenario)[1])
    truth = Expectation(scenario, *_terms_and_course(scenario))
    error = own.statistics(64, 1, 60) / truth.statistics(64, 1, 60) - 1.0
    assert np.max(np.abs(error[0, :2])) < 1e-12
    assert_allclose(error[0, 2], -bands.errors["banded_error_third_cumulant"], rtol=1e-6)
    # the sum over lags ends before all is forgotten, so a little less is missing
    assert 0.8 < -error[0, 5] / bands.errors["banded_error_correlation_time"] < 1.0


@pytest.mark.parametrize("population", ["rate", "counted"])
@pytest.mark.parametrize("name", ["modal, wave, relaxing stress", "mapped, diffusion, constant", "banded, slip, onset"])
def test_closed_forms_are_what_an_ensemble_gives(name, population):
    if "stress" in name and population == "counted":
        population = "rate"  # amplitude that follows counted bonds has no closed form
    members, steps = 2000, 8
    scenario = scene(
        shear=SHEARS[name], bonds=BONDS[population], drive=drive.Ramp(start=1e-3, stop=5e-3), contact=CONTACTS["load"]
    )
    law = Expectation(scenario, Terms.of_process(scenario.process), _terms_and_course(scenario)[1])
    exact = law.statistics(steps, 1, 4)
    read = {variable.name: variable.read for variable in VARIABLES}
    found = list(march(scenario, np.arange(members)))[steps - 4 :]
    lags = Lags([np.array([4 - j]) for j in range(1, 5)], [np.array([4])] * 4, 1e-3, pooled=False)
    for variable, expected in zip(converge_module.QUANTITIES, exact, strict=True):
        values = np.stack([read[variable](scenario, state) for state in found], axis=1)
        for one, number in zip(estimates(values, np.array([4]), lags), expected, strict=True):
            if math.isfinite(number):
                assert abs(one.value - number) <= 5.0 * one.standard_error + 1e-4 * abs(number)


def test_a_step_of_the_rate_equation_errs_in_second_order():
    scenario = scene(bonds=bonds.Rate(critical_speed=1e-2, rebinding_rate=200.0), drive=DRIVES["linear ramp"])
    terms = Terms.of_cell(scenario)
    fine = course(scenario, terms, np.array([8]), 64).fraction[0]
    errors = [abs(course(scenario, terms, np.array([8]), refine).fraction[0] - fine) for refine in (1, 2, 4)]
    assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.05)


def test_a_step_of_amplitude_that_relaxes_errs_in_second_order():
    scenario = scene(shear=SHEARS["modal self-affine"], drive=DRIVES["linear ramp"])
    terms, last = Terms.of_cell(scenario), np.array([8])
    fine = course(scenario, terms, last, 256).size[0]
    errors = [np.max(np.abs(course(scenario, terms, last, refine).size[0] - fine)) for refine in (8, 16, 32)]
    assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.05)


# sampled statistics


def test_statistics_of_exponential_draws_are_right_within_their_errors():
    draws = np.random.default_rng(11).exponential(size=(20_000, 3))
    exact = [1.0, 1.0, 2.0, -math.log(0.99), -math.log(0.01)]
    for found in (estimates(draws, np.array([1]), None), estimates(draws, np.arange(3), None)):
        for one, expected in zip(found, exact, strict=False):
            assert abs(one.value - expected) < 5.0 * one.standard_error
    single, pooled = (estimates(draws, ends, None)[0] for ends in (np.array([1]), np.arange(3)))
    assert_allclose(single.standard_error, math.sqrt(1.0 / 20_000), rtol=5.0 * math.sqrt(2.0 / 20_000))
    assert_allclose(pooled.standard_error, math.sqrt(1.0 / 60_000), rtol=5.0 * math.sqrt(2.0 / 20_000))


@pytest.mark.parametrize("pooled", [True, False])
def test_the_correlation_time_is_the_sum_over_the_lags(pooled):
    kept, members, records, window = 0.8, 4000, 30, 15
    noise, x = np.random.default_rng(3).normal(size=(members, records)), np.zeros((members, records))
    x[:, 0] = noise[:, 0]
    for k in range(1, records):
        x[:, k] = kept * x[:, k - 1] + math.sqrt(1.0 - kept**2) * noise[:, k]
    ends = np.arange(records) if pooled else np.array([records - 1])
    pairs = [(ends[ends >= lag] - lag, ends[ends >= lag]) for lag in range(1, window + 1)]
    lags = Lags([one for one, _ in pairs], [other for _, other in pairs], 0.5, pooled)
    found = estimates(x, ends, lags)[5]
    exact = 0.5 * (0.5 + sum(kept**lag for lag in range(1, window)) + 0.5 * kept**window)
    assert found.standard_error < 0.05 * exact
    assert abs(found.value - exact) < 5.0 * found.standard_error


def test_standard_errors_are_those_of_the_jackknife():
    # deleting one member after another gives the same to first order in 1/members; tails heavier than gamma's
    members, ends = 500, np.array([3])
    rng = np.random.default_rng(6)
    draws = np.empty((members, 4))
    draws[:, 0] = rng.laplace(size=members)
    for k in range(1, 4):
        draws[:, k] = 0.9 * draws[:, k - 1] + 0.4 * rng.laplace(size=members)
    lags = Lags([np.array([3 - j]) for j in (1, 2, 3)], [ends] * 3, 1.0, pooled=False)
    found = estimates(draws, ends, lags)
    left = [[one.value for one in estimates(np.delete(draws, k, axis=0), ends, lags)] for k in range(members)]
    spread = np.sqrt((members - 1.0) * np.var(left, axis=0))
    told = [0, 1, 2, 5]  # a quantile does not change smoothly enough for it
    assert_allclose([found[k].standard_error for k in told], spread[told], rtol=20.0 / members)


def test_what_does_not_fluctuate_is_certain():
    found = estimates(np.full((40, 2), 7.0), np.arange(2), None)
    assert [one.value for one in found[:2]] == [7.0, 0.0]
    assert [found[k].standard_error for k in (0, 1, 3, 4)] == [0.0] * 4
    assert math.isnan(found[2].value)


def test_rare_exceptions_have_a_mean_but_no_spread():
    values = np.zeros((4000, 1))
    values[:3] = 1.0
    found = estimates(values, np.array([0]), None)
    assert_allclose(found[0].value, 3.0 / 4000)
    assert math.isnan(found[1].value)
    assert math.isnan(found[2].value)


def test_quantiles_of_counts_are_not_more_certain_than_their_steps():
    draws = np.random.default_rng(2).poisson(30.0, size=(5000, 1)).astype(float)
    for one in estimates(draws, np.array([0]), None)[3:5]:
        assert one.standard_error >= 0.99


def test_shared_noise_shrinks_the_error_of_a_difference():
    draws = np.random.default_rng(8).normal(size=(1000, 1))
    ends = np.array([0])
    one, same, other = (estimates(values, ends, None)[1] for values in (draws, draws, 1.01 * draws[:500]))
    assert one.less(same) == (0.0, 0.0)
    apart = math.hypot(one.standard_error, other.standard_error)
    # half of the members are shared: var(a - b) = var/1000 + var/500 - 2 var/1000
    assert_allclose(one.less(other)[1] / apart, math.sqrt(1.0 / 3.0), rtol=0.05)


@pytest.mark.verify
@pytest.mark.parametrize("members", [64, 500, 3000])
def test_errors_in_units_of_their_standard_errors_are_standard_normal(members):
    weight, rng = np.array([1.0, 0.8, 0.5, 0.3, 0.2, 0.1]), np.random.default_rng(5)
    law = GammaSum(weight, np.ones(6))
    exact = np.array([law.mean, law.std, law.skewness, law.quantile(0.01), law.quantile(0.99)])
    scores = []
    for _ in range(400):
        draws = (weight * rng.exponential(size=(members, 6))).sum(axis=1, keepdims=True)
        found = estimates(draws, np.array([0]), None)[:5]
        scores.append([(one.value - v) / one.standard_error for one, v in zip(found, exact, strict=True)])
    spread = np.std(scores, axis=0)
    told = np.isfinite(spread)
    assert np.all(spread[told] > 0.6)
    assert np.all(spread[told] < 1.3)
    assert np.mean(np.abs(scores)[:, told] > 5.0) < 0.002


# the plan and the settings


def test_every_row_gets_an_equal_share_and_deeper_rows_fewer_members():
    costs, steps = [1e-6, 1e-5, 1e-4], [1000, 1000, 1000]
    members = plan_members(costs, steps, [64] * 3, [10**9] * 3, 30.0)
    spent = [m * c * s for m, c, s in zip(members, costs, steps, strict=True)]
    assert sum(spent) <= 30.0
    assert members == sorted(members, reverse=True)
    for one, cost in zip(spent, costs, strict=True):
        assert 10.0 - 64 * cost * 1000 < one <= 10.0
    assert all(m % 64 == 0 for m in members)


def test_what_a_row_cannot_use_goes_to_the_others():
    capped = plan_members([1e-6, 1e-5], [100, 100], [64, 64], [64, 10**9], 10.0)
    assert capped[0] == 64
    assert 9.9 < capped[1] * 1e-3 <= 10.0
    # nor does a row that is too dear for the budget hold any of it back
    dear = plan_members([1.0, 1e-5], [100, 100], [64, 64], [10**9, 10**9], 10.0)
    assert dear[0] == 0
    assert 9.9 < dear[1] * 1e-3 <= 10.0


def test_rows_of_the_same_noise_get_equally_many_members():
    assert len(set(plan_members([1e-5, 2e-5], [10, 10], [64, 64], [10**9] * 2, 1.0, [7, 7]))) == 1


def test_depths_tolerances_and_steps_are_tried_where_the_scene_admits_them():
    found, left_out = settings(scene(**STEADY))
    assert not left_out
    assert [s.label for s in found if s.line not in ("banded", "clock step")] == ["mean", "modal", "mapped"]
    assert {0.3, 0.01, 0.003} <= {s.tolerance for s in found if s.line == "banded"}
    assert [s.ratio for s in found if s.line == "clock step"] == [2.0, 1.0, 0.5]  # record is two steps
    relaxing = shear.Banded(
        spectrum=Ripple(amplitude=1e5, wavelength=25e-6),
        cell=CELL,
        correlation=Slip(length=5e-6),
        amplitude=Onset(speed=1e-3, width=0.3, relaxing=True),
    )
    found, left_out = settings(scene(shear=relaxing))
    assert {s.line for s in found} == {"banded", "modal", "clock step"}
    assert any(text.startswith("mean: amplitude that relaxes") for text in left_out)
    assert any(text.startswith("mapped: a map is periodic") for text in left_out)
    assert [s.label for s in found if s.line == "banded"] == ["banded 0.3 to 0.003"]  # one pair is one band
    assert next(s for s in found if s.line == "banded").tolerance == 0.01  # the scene's own


def test_grids_are_tried_where_the_spectrum_has_no_end():
    part = shear.Modal(spectrum=Gaussian(rms=1e5, length=5e-6), cell=CELL, points=32, correlation=Time(time=0.01))
    assert [s.points for s in settings(scene(shear=part))[0] if s.line == "grid"] == [16, 32, 64]
    assert not [s for s in settings(scene(**STEADY))[0] if s.line == "grid"]


def test_a_stationary_scene_is_pooled_and_a_ramp_has_stated_times():
    scenario = scene(**STEADY)
    (moment,) = stated_times(scenario, Terms.of_cell(scenario), 2)
    assert moment.pooled
    assert moment.step == 64
    assert moment.window > 4
    ramp = scene(**STEADY | {"drive": drive.Ramp(start=1e-5, stop=1e-2), "bonds": BONDS["rate"]})
    moments = stated_times(ramp, Terms.of_cell(ramp), 2)
    assert moments[-1].step == 64
    assert all(step % 2 == 0 for moment in moments for step in moment.ends)
    assert not stated_times(scene(), Terms.of_cell(scene()))[0].window


# all of it


def test_no_row_of_a_sound_scene_contradicts_what_is_known(steady):
    dataset, _ = steady
    assert not contradicted(dataset).any()
    off = np.abs(dataset["error"] - dataset["known_error"]) - 5.0 * dataset["standard_error"]
    assert float(off.max()) < 1e-4
    mean = dataset.sel(row="mean", statistic="standard deviation")
    assert_allclose(mean["error"], -1.0, rtol=0, atol=1e-12)
    assert_allclose(mean["known_error"], -1.0, rtol=0, atol=1e-12)
    assert bool(real(dataset)[0].any())


def test_the_same_noise_gives_modal_and_mapped_the_same_errors(steady):
    modal, mapped = (steady[0].sel(row=name) for name in ("modal", "mapped"))
    assert np.array_equal(modal["value"], mapped["value"], equal_nan=True)
    for name in ("error", "standard_error"):
        one, other = (row[name].sel(quantity="fluctuation_energy") for row in (modal, mapped))
        assert np.array_equal(one, other, equal_nan=True)


def test_the_shares_of_the_work_add_up_to_one(steady):
    assert_allclose(sum(steady[1]), 1.0, rtol=1e-9)


def test_the_dataset_is_described_and_survives_netcdf(steady, tmp_path):
    dataset, _ = steady
    assert dataset["error"].dims == ("row", "t", "quantity", "statistic")
    assert list(dataset["statistic"].to_numpy()) == list(STATISTICS)
    for name, variable in dataset.variables.items():
        assert variable.attrs["long_name"], name
        assert variable.dtype.kind in "OU" or variable.attrs["units"], name
    for name in ("wall_time", "cpu_time"):
        assert bool((dataset[name] > 0.0).all())
    dataset.to_netcdf(tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as read:
        assert table(read) == table(dataset)
        assert recommendation(read) == recommendation(dataset)


def test_measured_values_in_si_are_those_of_the_scene(steady):
    dataset, _ = steady
    energies = scene(**STEADY).process.bands
    found = dataset["fluctuation_energy_mean"].sel(row="modal")
    off = dataset["standard_error"].sel(row="modal", quantity="fluctuation_energy", statistic="mean")
    assert np.all(np.abs(found / energies.mean - 1.0) < 5.0 * off)


def test_the_table_has_two_lines_a_row_and_says_what_is_not_separated(steady):
    dataset, _ = steady
    rows = table(dataset)
    assert len(rows) == 2 * dataset.sizes["row"]
    assert all(list(row) == list(rows[0]) for row in rows)
    by_label = {row["setting"]: row for row in rows if row["setting"]}
    assert "real" in by_label["mean"]["verdict"]
    assert by_label["modal"]["verdict"] == "not separated"
    assert by_label["mean"]["sd\n(%)"] == "−100"


def test_the_closing_sentence_gives_lines_that_can_be_written(steady):
    dataset, _ = steady
    said = recommendation(dataset)
    assert "keeps 1 %" in said
    assert '[shear]\nmodel = "' in said
    assert "Beware" not in said


def test_the_figure_is_drawn_with_both_kinds_of_errors(steady, tmp_path):
    drawn = figure(steady[0])
    assert len(drawn.axes) == 2
    assert drawn.get_size_inches()[0] < 3.5
    labels = [text.get_text() for text in drawn.axes[0].get_legend().get_texts()]
    assert {"banded", "modal", "known before", "measured", "tolerance"} <= set(labels)
    drawn.savefig(tmp_path / "out.png")


def test_a_depth_whose_variance_is_ten_percent_off_is_found_out(monkeypatch):
    fixed_members(monkeypatch, 640)
    only(monkeypatch, "banded 0.01")

    def wrong(advance):
        def spread(self, *arguments):
            state = advance(self, *arguments)
            return state._replace(energy=self.bands.mean + math.sqrt(1.1) * (state.energy - self.bands.mean))

        return spread

    for name in ("start", "advance"):
        monkeypatch.setattr(BandedProcess, name, wrong(getattr(BandedProcess, name)))
    parts = STEADY | {"shear": replace(STEADY["shear"], correlation=Time(time=0.02))}
    dataset = converge(scene(**parts), 1.0)
    found = dataset.sel(quantity="fluctuation_energy", statistic="standard deviation").isel(row=0, t=0)
    assert float(found["error"]) > 5.0 * float(found["standard_error"])
    assert abs(float(found["error"]) - (math.sqrt(1.1) - 1.0)) < 5.0 * float(found["standard_error"])
    assert contradicted(dataset)[0, 0, 0, 1]
    assert "NOT AS KNOWN" in table(dataset)[0]["verdict"]
    assert "Beware" in recommendation(dataset)
    assert not within(dataset, 0.01).any()


def test_a_scene_that_may_open_is_judged_by_its_deepest_and_finest(monkeypatch):
    fixed_members(monkeypatch, 64)
    dataset = converge(scene(**TENSION), 1.0)
    radius = dataset.sel(quantity="contact_radius")
    assert bool(np.isnan(radius["known_error"]).all())
    same = radius.sel(row="modal", statistic="mean")
    assert_allclose(same["error"], 0.0, rtol=0, atol=1e-12)
    assert_allclose(same["standard_error"], 0.0, rtol=0, atol=1e-12)
    assert np.isnan(radius["error"].sel(row="mapped", statistic="mean")).all()  # it is the reference
    energy = dataset.sel(quantity="fluctuation_energy", statistic="mean")
    assert np.all(np.abs(energy["error"] - energy["known_error"]) < 5.0 * energy["standard_error"] + 1e-9)
    assert recommendation(dataset)


def test_a_contact_that_is_open_throughout_is_no_trouble(monkeypatch):
    fixed_members(monkeypatch, 32)
    lifted = replace(CONTACTS["tension"], load=-1.0)
    part = shear.Banded(spectrum=SPECTRUM, cell=CELL, correlation=Slip(length=5e-6))
    dataset = converge(scene(shear=part, contact=lifted, drive=DRIVES["steady"]), 1.0)
    assert float(dataset["contact_radius_mean"].max()) == 0.0
    assert not contradicted(dataset).any()
    assert table(dataset)
    assert recommendation(dataset)
    figure(dataset)


def test_without_fluctuations_and_memory_every_setting_is_exact():
    dataset = converge(scene(shear=shear.Mean(spectrum=SPECTRUM), bonds=BONDS["steady"], drive=DRIVES["log ramp"]), 0.1)
    assert float(np.abs(dataset["error"]).max()) < 1e-12
    assert float(dataset["standard_error"].max()) == 0.0
    assert "every setting gives the exact answer" in recommendation(dataset)
    figure(dataset)


def test_the_clock_step_of_the_rate_equation_is_known_without_noise():
    parts = {"bonds": bonds.Rate(critical_speed=1e-2, rebinding_rate=300.0), "drive": drive.Ramp(start=1e-3, stop=3e-2)}
    dataset = converge(scene(**parts, clock=Clock(duration=0.016, step=1e-3, record=4e-3)), 0.1)
    clocks = dataset.isel(row=dataset["line"] == "clock step", t=-1)
    error = clocks["error"].sel(quantity="contact_radius", statistic="mean")
    known = clocks["known_error"].sel(quantity="contact_radius", statistic="mean")
    assert_allclose(error, known, rtol=1e-6)
    assert_allclose((error[:-1] / error.to_numpy()[1:])[1:], 4.0, rtol=0.1)  # the coarsest is not yet of second order
    assert "Nothing fluctuates" in recommendation(dataset)


def test_counted_bonds_have_a_closed_form_of_their_own(monkeypatch):
    fixed_members(monkeypatch, 512)
    population = bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=200, start_from="empty")
    clock = Clock(duration=0.012, step=1e-3, record=2e-3)
    dataset = converge(scene(bonds=population, drive=DRIVES["steady"], clock=clock), 1.0)
    radius = dataset.sel(quantity="contact_radius")
    assert np.isfinite(radius["known_error"].sel(statistic="standard deviation")).all()
    assert not contradicted(dataset).any()


def test_a_grid_that_leaves_waves_out_is_told(monkeypatch):
    fixed_members(monkeypatch, 128)
    only(monkeypatch, "mean", "banded 0.01")
    part = shear.Banded(spectrum=Gaussian(rms=1e5, length=5e-6), cell=CELL, points=32, correlation=Time(time=0.02))
    dataset = converge(scene(shear=part, drive=DRIVES["steady"], clock=Clock(duration=0.32, step=0.01)), 1.0)
    grid = dataset.isel(row=dataset["line"] == "grid").sel(quantity="fluctuation_energy", statistic="mean")
    cell = grid["cell_error_energy"]
    assert np.all(np.diff(np.abs(grid["known_error"].isel(t=0))) < 0.0)
    # the wave at q = 0 is missing from all of them: known errors differ as the cells' do
    assert_allclose(
        (1.0 + grid["known_error"].isel(t=0)) / (1.0 + grid["known_error"].isel(t=0)[-1]),
        (1.0 + cell) / (1.0 + cell[-1]),
        rtol=1e-6,
    )
    assert "points = 64" in recommendation(dataset)


def test_maps_and_sweeps_are_left_out(monkeypatch):
    fixed_members(monkeypatch, 16)
    only(monkeypatch, "modal", "mapped")
    part = shear.Mapped(spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=5e-6))
    dataset = converge(scene(shear=part, drive=DRIVES["steady"], record=Record(maps=(2e-3,))), 1.0)
    assert list(dataset["row"].to_numpy()) == ["modal", "mapped"]


# what is said of given numbers


def told(known, error, sem, cpu, members=100):
    """A dataset of rows that have the same errors throughout, the mean radius excepted from nothing."""
    shape = (len(known), 1, 2, 6)
    full = {
        name: (("row", "t", "quantity", "statistic"), np.broadcast_to(np.reshape(row, (-1, 1, 1, 1)), shape).copy())
        for name, row in (("known_error", known), ("error", error), ("standard_error", sem))
    }
    names = [f"banded {k}" for k in range(len(known))]
    along = {
        "line": ["banded"] * len(known),
        "toml": [f'[shear]\nmodel = "banded"\ntolerance = 0.{k}' for k in range(len(known))],
        "cpu_time": cpu,
        "wall_time": cpu,
        "members": [members] * len(known),
        "clock_step": [1.0] * len(known),
        "tolerance": [0.1] * len(known),
        "points": [0] * len(known),
        "terms": [3] * len(known),
    }
    coordinates = {"row": names, "t": [1.0], "statistic": list(STATISTICS)}
    attributes = {"asked_tolerance": 0.01, "clock_step": 1.0}
    return xr.Dataset(full | {k: ("row", v) for k, v in along.items()}, coordinates, attributes)


def test_the_cheapest_row_within_the_tolerance_is_recommended():
    dataset = told([0.1, 0.008, 0.0], [0.1, 0.008, 0.0], [0.01, 0.01, 0.01], [1e-6, 2e-6, 9e-6])
    assert within(dataset, 0.01).tolist() == [False, True, True]
    said = recommendation(dataset)
    assert "“banded 1” is the cheapest setting that keeps 1 %: 2 µs" in said
    assert said.endswith('[shear]\nmodel = "banded"\ntolerance = 0.1')


def test_a_measured_error_that_sampling_cannot_explain_disqualifies():
    sound, wrong = told([0.0], [0.019], [0.005], [1e-6]), told([0.0], [0.04], [0.005], [1e-6])
    assert within(sound, 0.01).all()
    assert not within(wrong, 0.01).any()
    assert "Beware" in recommendation(wrong)
    assert "No setting keeps 1 %" in recommendation(wrong)


def test_what_is_not_known_is_said_to_be_only_as_certain_as_sampled():
    said = recommendation(told([np.nan], [0.02], [0.03], [1e-6]))
    assert "as far as sampling tells" in said
    assert "measured to 6 %" in said


def test_a_depth_is_no_better_than_the_clock_step_at_which_it_was_tried():
    nan = np.nan
    dataset = told([nan] * 3, [0.0, 0.5, nan], [0.001, 0.01, nan], [1e-6, 1e-6, 1e-6])
    dataset["line"] = "row", ["modal", "clock step", "clock step"]
    dataset["clock_step"] = "row", [1.0, 1.0, 0.5]
    assert not within(dataset, 0.01).any()  # nor does the finest step, which nothing judges, when the next is off
    dataset["error"][1] = 0.0
    assert within(dataset, 0.01).all()
    assert "measured to 2 %" in recommendation(dataset)  # two standard errors of the step, not of the depth


def test_a_row_that_no_budget_reached_is_not_recommended():
    dataset = told([0.0], [np.nan], [np.nan], [1e-6], members=0)
    assert "budget is too small" in recommendation(dataset)
    assert table(dataset)[0]["verdict"] == "over budget"
