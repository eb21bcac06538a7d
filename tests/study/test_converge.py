"""``sim converge``: laws, samples with their errors, the promise that is kept, and what is said of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from helpers.scenes import BELL, BONDS, CELL, CONTACTS, CUT_OFF, DRIVES, SHEARS, SPECTRUM, STRETCHED, scene
from numpy.testing import assert_allclose

import sim.study.converge as converge_module
from sim.engine import MemberNoise, follow
from sim.laws.schallamach import bell_stress, first_moment_stress
from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell, Constant
from sim.parts.contact import Equilibrium, RateDependent
from sim.parts.shear import models as shear
from sim.parts.shear.bands import BandedProcess
from sim.parts.shear.process import Onset, Slip, Stress, Time, Wave
from sim.scenario.clock import Clock, Record
from sim.spectrum.families import Gaussian, Ripple, SelfAffine
from sim.study import samples
from sim.study.converge import converge, explanation, figure, recommendation, table
from sim.study.exact_law import QUANTITIES, READ, STATISTICS, Walk, cell_gammas, gamma_nodes, memory
from sim.study.samples import coupled, estimates, sampled
from sim.study.settings import REFERENCE, at_step, number_of_sites, plain, settings, table as keys
from sim.study.verdicts import choices, chosen, differing

ROUGH = SelfAffine(rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=8e-6)
BANDED = shear.Banded(spectrum=ROUGH, cell=CELL, correlation=Wave(waves=1.0))
STEADY = {"shear": BANDED, "drive": drive.Steady(speed=3e-4), "clock": Clock(duration=0.64, step=0.01, record=0.02)}
#: A jump of the speed and a reversal, under cohorts.
JUMP = {
    "bonds": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=1e-3),
    "drive": drive.Table(time=(0.0, 0.0123, 0.0123, 0.03, 0.04), speed=(1e-3, 1e-3, 6e-3, 6e-3, -1e-3)),
    "clock": Clock(duration=0.04, step=2e-3),
}


@pytest.fixture
def quick(monkeypatch):
    """As many members in every sample whatever this machine is worth, and times that are not measured."""

    def members(count=64):
        monkeypatch.setattr(converge_module, "affordable", lambda *_: count)
        monkeypatch.setattr(converge_module, "timed", lambda scene, _: _counted_time(scene))

    return members


def _counted_time(scenario):
    pace = (1.0 + scenario.process.pairs) * 1e-6
    return [scenario.clock.steps * pace * share for share in (1.0, 0.95, 1.05)]


@pytest.fixture(scope="module")
def steady():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(converge_module, "affordable", lambda *_: 96)
        return converge(scene(**STEADY, members=64), 0.1)


def of(dataset, row, quantity, statistic="mean", name="error"):
    found = dataset[name].sel(row=row, quantity=quantity, statistic=statistic)
    return float(found) if found.ndim == 0 else found.to_numpy()


# laws


@pytest.mark.parametrize("name", ["modal, time, constant", "modal, slip, onset", "modal self-affine", "modal ripple"])
def test_cumulants_of_the_energy_are_sums_over_all_modes(name):
    scenario = scene(shear=SHEARS[name], drive=DRIVES["steady"])
    energies = scenario.process.modes.energies(*scenario.solid.effective)
    amplitude = scenario.process.amplitude.factor(np.array([2e-3]), np.zeros(1))[0]
    for terms in (cell_gammas(scenario), scenario.process.gammas):
        mean, spread, skewness, _ = Walk.of(scenario, [terms]).statistics(0, math.inf)[-1, 2]
        assert_allclose(mean, amplitude**2 * energies.sum(), rtol=1e-12)
        assert_allclose(spread, amplitude**2 * math.sqrt(np.sum(energies**2)), rtol=1e-12)
        assert_allclose(skewness, 2.0 * np.sum(energies**3) / np.sum(energies**2) ** 1.5, rtol=1e-12)


def test_the_correlation_time_of_bands_errs_by_what_the_bands_say():
    scenario = scene(**STEADY)
    bands = scenario.process.bands
    own, cell = scenario.process.gammas, cell_gammas(scenario)
    error = memory(own, 1) / memory(cell, 1) - 1.0
    assert_allclose(-error, bands.errors["banded_error_correlation_time"], rtol=1e-6)
    assert_allclose(memory(own, 0), 1.0, rtol=1e-12)  # all modes renew alike


@pytest.mark.parametrize("skewness", [0.0, 0.3, 2.0, 2.8])
def test_nodes_have_the_moments_of_a_gamma_number(skewness):
    x, share = gamma_nodes(skewness, 281)
    # fourth cumulant 6/shape = 1.5 skewness²
    exact = [1.0, 0.0, 1.0, skewness, 3.0 + 1.5 * skewness**2]
    assert_allclose([share @ x**n for n in range(5)], exact, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("population", ["rate", "counted", "tracked"])
@pytest.mark.parametrize("name", ["modal, wave, relaxing stress", "mapped, diffusion, constant", "banded, slip, onset"])
def test_laws_are_what_an_ensemble_gives(name, population):
    scenario = scene(shear=SHEARS[name], bonds=BONDS[population], drive=drive.Ramp(start=1e-3, stop=5e-3))
    sites = float(keys(scenario.bonds).get("sites", math.inf))
    exact = Walk.of(scenario, [scenario.process.gammas]).statistics(0, sites)[-1]
    follows = "stress" in name and math.isfinite(sites)  # the amplitude follows bonds that differ between members
    assert np.isnan(exact[2, 0]) == follows
    values = sampled(scenario, 600, [8])
    found, known = estimates(values), np.isfinite(exact[:, :3])
    off = np.abs(found.value - exact[:, :3]) - 5.0 * found.standard_error - 2e-3 * np.abs(exact[:, :3])
    assert np.all((off <= 0.0) | ~known | np.isnan(found.value))


@pytest.mark.parametrize("contact", [Equilibrium(load=4e-3, reversible=0.005), CONTACTS["indentation"]])
def test_the_law_of_the_radius_is_that_of_draws_of_the_energy(contact):
    part = SHEARS["modal, time, constant"]
    scenario = scene(shear=part, bonds=BONDS["steady"], drive=DRIVES["steady"], contact=contact)
    terms = cell_gammas(scenario)
    mean, spread, *_ = Walk.of(scenario, [terms]).statistics(0, math.inf)[0, 3]
    found = estimates(sampled(scenario, 2000, [0])[3])
    assert np.all(np.abs(found.value[:2] - [mean, spread]) < 5.0 * found.standard_error[:2])


def test_a_contact_that_may_open_or_lags_has_no_law_of_its_radius():
    for contact in ("tension", "rate_dependent"):
        scenario = scene(shear=SHEARS["modal, time, constant"], drive=DRIVES["steady"], contact=CONTACTS[contact])
        assert np.isnan(Walk.of(scenario, [cell_gammas(scenario)]).statistics(0, math.inf)[:, 3]).all()
    still = scene(contact=CONTACTS["rate_dependent"])  # without noise there is one
    assert np.isfinite(Walk.of(still, [cell_gammas(still)]).statistics(0, math.inf)[:, 3, :2]).all()


def test_amplitude_that_relaxes_errs_in_second_order_of_the_step():
    scenario = scene(shear=SHEARS["modal self-affine"], drive=DRIVES["linear ramp"])
    terms = cell_gammas(scenario)
    means = [Walk.of(at_step(scenario, 2.0**-k).scenario, [terms]).means[-1, 2] for k in (1, 2, 3, 4)]
    changes = np.abs(np.diff(means))
    assert_allclose(changes[:-1] / changes[1:], 4.0, rtol=0.1)


# samples


def test_statistics_of_exponential_draws_are_right_within_their_errors():
    draws = np.random.default_rng(11).exponential(size=(20_000, 3))
    for found in (estimates(draws[:, 1:2]), estimates(draws)):
        assert np.all(np.abs(found.value - [1.0, 1.0, 2.0]) < 5.0 * found.standard_error)
    single, pooled = (estimates(values).standard_error[0] for values in (draws[:, 1:2], draws))
    assert_allclose(single, math.sqrt(1.0 / 20_000), rtol=5.0 * math.sqrt(2.0 / 20_000))
    assert_allclose(pooled, math.sqrt(1.0 / 60_000), rtol=5.0 * math.sqrt(2.0 / 20_000))


def test_standard_errors_are_those_of_the_jackknife():
    # deleting one member after another gives the same to first order in 1/members; tails heavier than gamma's
    members, rng = 500, np.random.default_rng(6)
    draws = np.empty((members, 4))
    draws[:, 0] = rng.laplace(size=members)
    for k in range(1, 4):
        draws[:, k] = 0.9 * draws[:, k - 1] + 0.4 * rng.laplace(size=members)
    left = [estimates(np.delete(draws, k, axis=0)).value for k in range(members)]
    spread = np.sqrt((members - 1.0) * np.var(left, axis=0))
    assert_allclose(estimates(draws).standard_error, spread, rtol=20.0 / members)


def test_what_does_not_fluctuate_is_certain():
    for values in (np.full((40, 2), 7.0), np.full((1, 1), 7.0)):
        found = estimates(values)
        np.testing.assert_array_equal(found.value, [7.0, 0.0, np.nan])
        np.testing.assert_array_equal(found.standard_error, [0.0, 0.0, np.nan])


def test_a_single_member_that_changes_in_time_has_no_error():
    found = estimates(np.arange(5.0)[np.newaxis])
    assert found.value[0] == 2.0
    assert np.isnan(found.standard_error).all()


def test_rare_exceptions_have_a_mean_but_no_spread():
    values = np.zeros((4000, 1))
    values[:3] = 1.0
    found = estimates(values)
    assert_allclose(found.value, [3.0 / 4000, np.nan, np.nan])


def test_shared_noise_shrinks_the_error_of_a_difference():
    draws = np.random.default_rng(8).normal(size=(1000, 1))
    one, same, other = (estimates(values) for values in (draws, draws, 1.01 * draws[:500]))
    assert np.all(np.array(one.less(same)) == 0.0)
    apart = np.hypot(one.standard_error, other.standard_error)
    # half of the members are shared: var(a - b) = var/1000 + var/500 - 2 var/1000
    assert_allclose((one.less(other)[1] / apart)[1], math.sqrt(1.0 / 3.0), rtol=0.05)


@pytest.mark.verify
@pytest.mark.parametrize("members", [64, 500, 3000])
def test_errors_in_units_of_their_standard_errors_are_standard_normal(members):
    weight, rng = np.array([1.0, 0.8, 0.5, 0.3, 0.2, 0.1]), np.random.default_rng(5)
    spread = math.sqrt(np.sum(weight**2))
    exact = np.array([weight.sum(), spread, 2.0 * np.sum(weight**3) / spread**3])
    scores = []
    for _ in range(400):
        found = estimates((weight * rng.exponential(size=(members, 6))).sum(axis=1, keepdims=True))
        scores.append((found.value - exact) / found.standard_error)
    wide = np.std(scores, axis=0)
    assert np.all((wide > 0.6) & (wide < 1.3))
    assert np.mean(np.abs(scores) > 5.0) < 0.002


def test_steps_that_are_run_together_have_the_same_fluctuations():
    scenario = scene(shear=SHEARS["modal, slip, onset"], contact=CONTACTS["rate_dependent"], drive=DRIVES["steady"])
    fine = at_step(scenario, 0.5).scenario
    values = coupled([fine, scenario], 5, [8, 16])
    assert np.array_equal(values[0, 2], values[1, 2])
    assert np.array_equal(values[0], sampled(fine, 5, [8, 16]))
    assert not np.array_equal(values[0, 3], values[1, 3])
    assert_allclose(values[0, 3], values[1, 3], rtol=0.1)


def test_a_time_is_that_of_the_whole_run(monkeypatch):
    # by a clock that a step of a member moves on by 1 ms
    clock, follow = [0.0], samples.follow

    def counted(scenario, noise, state, steps):
        clock[0] += 1e-3 * len(noise.shear.members) * len(steps)
        return follow(scenario, noise, state, steps)

    monkeypatch.setattr(samples, "follow", counted)
    monkeypatch.setattr(samples.time, "process_time", lambda: clock[0])
    scenario = scene(shear=SHEARS["modal, slip, onset"], steps=20)
    batch = samples.together(scenario)
    for members in (7, batch, 2 * batch + 1):
        found = samples.timed(replace(scenario, ensemble=replace(scenario.ensemble, members=members)), 0.05)
        of_batches = members if members <= batch else 3 * batch
        assert_allclose(found, 1e-3 * 20 * of_batches, rtol=1e-12)


# settings


def test_models_tolerances_and_sites_are_tried_where_the_scene_admits_them():
    found = settings(scene(**STEADY), left_out := [])
    assert not left_out
    assert [row.label for row in found] == ["mean", *(f"banded {t:g}" for t in (0.3, 0.1, 0.03, 0.01, 0.003)),
                                            "modal", "mapped"]  # fmt: skip
    assert [row.label for row in found if row.own] == ["banded 0.01"]
    relaxing = shear.Banded(
        spectrum=Ripple(amplitude=1e5, wavelength=25e-6),
        cell=CELL,
        correlation=Slip(length=5e-6),
        amplitude=Onset(speed=1e-3, width=0.3, relaxing=True),
    )
    found = settings(scene(shear=relaxing), left_out)
    assert [row.label for row in found] == ["banded 0.01", "banded 0.003", "modal"]  # one pair is one band
    assert [text.partition(":")[0] for text in left_out] == ["mean", "mapped"]
    assert "relaxes" in left_out[0]
    assert "whole number of wavelengths" in left_out[1]


def test_bond_models_are_those_that_the_bonds_admit():
    rows = settings(scene(bonds=bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=3e-3)), [])
    assert [row.label for row in rows if row.own] == ["cohort 0.003"]
    assert [row.scenario.bonds.model for row in rows] == ["rate"] + 6 * ["cohort"]  # 4.5e9 sites are not followed
    rows = settings(scene(bonds=BONDS["tracked"]), [])
    assert [row.label for row in rows if row.own] == ["tracked 30"]
    assert rows[-1].toml == 'model = "tracked"\nsites = 30'
    rows = settings(scene(bonds=BONDS["counted"]), [])
    assert [row.label for row in rows] == ["steady", "rate", "counted 40"]
    rows = settings(scene(bonds=BONDS["cohort, carried"]), left_out := [])
    assert {row.scenario.bonds.model for row in rows} == {"rate", "cohort"}
    assert "carried" in left_out[0]


def test_a_choice_left_to_the_program_is_settled_first():
    scenario = scene(bonds=BONDS["auto, many sites"], shear=SHEARS["auto with correlation"])
    base = plain(scenario)
    assert (base.bonds.model, base.shear.model) == ("rate", "banded")
    assert number_of_sites(scenario) == 10**6


def test_a_clock_step_keeps_the_records():
    clock = at_step(scene(**STEADY), 0.5).scenario.clock
    assert (clock.step, clock.record, clock.duration) == (0.005, 0.02, 0.64)


# the promise


def run_of(scenario, members, every=1):
    """The quantities at the records of a scene, shape (4, members, records), by the engine alone."""
    steps = range(0, scenario.clock.steps + 1, scenario.clock.stride * every)
    _, passed = follow(scenario, MemberNoise.of(scenario.seed, np.arange(members)), None, steps)
    read = (np.broadcast_to(READ[name](scenario, passed), (len(steps), members)) for name in QUANTITIES)
    return np.array([values.T for values in read])


def keeps_its_promise(scenario, budget, members, tolerance=None):
    """The recommended setting against one with a hundredth of its step and the fullest models, at all records."""
    dataset = converge(scenario, budget, tolerance)
    best, _ = chosen(choices(dataset), dataset.attrs["tolerance"])
    labels = [str(dataset["row"].to_numpy()[row]) for row in best.rows]
    base, rows = plain(scenario), {row.label: row for row in settings(plain(scenario), [])}
    parts = {rows[name].part: keys(getattr(rows[name].scenario, rows[name].part)) for name in labels[:-1]}
    step = float(dataset["clock_step"][best.rows[-1]])
    clock = {"duration": base.clock.duration, "record": base.clock.stride * base.clock.step}
    taken = base.with_values(parts | {"clock": clock | {"step": step}})
    fullest = {row.part: keys(getattr(row.scenario, row.part)) for row in rows.values()
               if row.label.startswith(("modal", "cohort 1e-06"))}  # fmt: skip
    fine = base.with_values(fullest | {"clock": clock | {"step": step / 100.0}})
    count = members if taken.varies["contact"] else 1
    found, truth = run_of(taken, count), run_of(fine, members if fine.varies["contact"] else 1)
    one, other = (estimates(np.moveaxis(values, 2, 0)[..., np.newaxis]) for values in (found, truth))
    yard, bound = dataset["yardstick"].to_numpy()[:, :3], best.bound[:, :3]
    off, chance = np.abs(one.value - other.value), 5.0 * np.hypot(one.standard_error, other.standard_error)
    judged = (yard > 0.0) & (bound >= 0.0) & np.isfinite(off)
    broken = judged & ~(off <= (bound + REFERENCE) * yard + chance)
    assert not broken.any(), (labels, [(t, QUANTITIES[q], STATISTICS[s]) for t, q, s in np.argwhere(broken)], bound)
    worst = float(np.max((off / np.where(yard > 0.0, yard, np.nan))[judged]))
    return dataset, worst


def test_the_error_that_is_promised_is_kept_over_jumps_and_reversals(quick):
    quick()
    dataset, worst = keeps_its_promise(scene(**JUMP), 20.0, 1)
    own = choices(dataset)[0]
    assert own.off > 0.01  # the scene's step rules its error
    assert "by its clock step" in recommendation(dataset).split("\n")[0]
    assert "[clock]\nstep" in recommendation(dataset)
    assert worst <= 0.01


def test_the_error_of_a_long_step_is_found(quick):
    quick()
    dataset = converge(scene(**JUMP | {"clock": Clock(duration=0.04, step=4e-3)}), 1.0)
    assert choices(dataset)[0].off > 0.02
    fine = scene(**JUMP | {"clock": Clock(duration=0.04, step=4e-5, record=4e-3)})
    own = scene(**JUMP | {"clock": Clock(duration=0.04, step=4e-3)})
    promised = choices(dataset)[0].error[:, 0] * dataset["yardstick"].to_numpy()[:, 0]
    off = np.abs(run_of(own, 1) - run_of(fine, 1))[:, 0].max(axis=1)
    assert np.all(off <= promised)
    assert off[0] > 0.5 * promised[0]  # and it is no mere bound


#: Bonds that live for half a second, under a jump of the speed and a reversal within 5 ms.
STEEP = {
    "bonds": bonds.Cohort(
        rupture=Bell(zero_force_rate=2.0, bell_force=4e-12), **STRETCHED | {"rebinding_rate": 4.0}, tolerance=1e-2
    ),
    "drive": drive.Table(time=(0.0, 0.1, 0.1, 0.4, 0.405, 0.6), speed=(2e-5, 2e-5, 2e-3, 2e-3, -1e-3, 5e-4)),
}


@pytest.fixture(scope="module")
def steep():
    return run_of(scene(**STEEP, clock=Clock(duration=0.6, step=4e-4, record=0.02)), 1)[:, 0]


@pytest.mark.parametrize("step", [0.02, 0.004])
def test_a_steep_reversal_under_coarse_cohorts_is_no_worse_than_promised(step, quick, steep):
    quick()
    written = scene(**STEEP, clock=Clock(duration=0.6, step=step, record=0.02))
    own = choices(converge(written, 1.0))[0]
    promised = own.error[:, 0] * np.max(np.abs(steep), axis=1)
    off = np.abs(run_of(written, 1)[:, 0] - steep).max(axis=1)
    assert np.all(off <= promised)
    assert off[0] > 0.5 * promised[0]


_RUPTURES = (BELL, CUT_OFF, Constant(rate=200.0))


def random_scene(seed):
    """Any drive, bonds, shear and contact for forty steps."""
    rng = np.random.default_rng(seed)
    pick = lambda *options: options[rng.integers(len(options))]  # noqa: E731
    times = np.sort(rng.uniform(0.0, 0.04, 3))
    speeds = rng.uniform(-1.0, 1.0, 6) * 10.0 ** rng.uniform(-3.5, -2.0, 6)
    drives = (
        drive.Steady(speed=abs(speeds[0])),
        drive.Start(rest=float(times[0]), speed=abs(speeds[0])),
        drive.Ramp(start=speeds[0], stop=speeds[1]),
        drive.Ramp(start=abs(speeds[0]), stop=abs(speeds[1]), scale="log"),
        drive.Table(
            time=(0.0, times[0], times[0], times[1], times[2], times[2], 0.04), speed=(*speeds[:5], *speeds[4:])
        ),
    )
    starts = pick("steady", "bonded", "empty")
    populations = (
        bonds.Rate(critical_speed=1e-2, rebinding_rate=300.0, stress=2e5, start_from=starts),
        bonds.Cohort(rupture=pick(*_RUPTURES), **STRETCHED, start_from=starts),
        bonds.FirstMoment(rupture=pick(*_RUPTURES), **STRETCHED, start_from=starts),
    )
    field = {"spectrum": ROUGH, "cell": CELL, "correlation": pick(Slip(length=1e-5), Wave(waves=1.0), Time(time=5e-3)),
             "amplitude": pick(Onset(speed=2e-3, width=0.3, floor=0.2), Stress(reference=1e5))}  # fmt: skip
    shears = (shear.Uniform(), shear.Mean(spectrum=ROUGH, amplitude=field["amplitude"]), shear.Banded(**field),
              shear.Modal(**field))  # fmt: skip
    contacts = (Equilibrium(load=4e-3), Equilibrium(indentation={"from": 2e-6, "to": 1e-6}),
                RateDependent(load={"from": 4e-3, "to": 6e-3, "cycles": 1}, front_speed=1e-2))  # fmt: skip
    return scene(
        drive=pick(*drives), bonds=pick(*populations), shear=pick(*shears), contact=pick(*contacts),
        clock=Clock(duration=0.04, step=1e-3, record=4e-3), members=64,
    )  # fmt: skip


@pytest.mark.verify
@pytest.mark.parametrize("seed", range(20))
def test_the_promise_is_kept_over_random_scenes(seed, quick):
    quick(512)
    keeps_its_promise(random_scene(seed), 20.0, 256)


# whole studies


def test_samples_of_a_sound_scene_are_what_is_expected(steady):
    assert not differing(steady).any()
    assert of(steady, "mean", "fluctuation_energy", "standard deviation") == 1.0
    assert of(steady, "mean", "contact_radius", "standard deviation") == 1.0
    bands = scene(**STEADY).process.bands
    assert_allclose(
        of(steady, "banded 0.01", "fluctuation_energy", "skewness"),
        bands.errors["banded_error_third_cumulant"],
        rtol=1e-6,
    )
    assert of(steady, "banded 0.01", "fluctuation_energy", "standard deviation") < 1e-12
    assert_allclose(
        of(steady, "banded 0.01", "fluctuation_energy", "correlation time"),
        bands.errors["banded_error_correlation_time"],
        rtol=1e-6,
    )
    assert of(steady, "modal", "fluctuation_energy", "skewness") < 1e-9


def test_a_steady_scene_has_no_error_of_its_step(steady):
    steps = steady.isel(row=steady["part"] == "step")
    assert float(steps["error"].max()) < 1e-9
    assert list(steps["row"].to_numpy()) == ["step 20 ms", "step 10 ms", "step 5 ms"]  # record is two steps


def test_the_dataset_is_described_and_survives_netcdf(steady, tmp_path):
    assert steady["error"].dims == ("row", "quantity", "statistic")
    assert steady["deviation"].dims == ("row", "t", "quantity", "statistic")
    assert tuple(steady["statistic"].to_numpy()) == STATISTICS
    assert all(variable.attrs["long_name"] for variable in steady.variables.values())
    assert bool((steady["time"] > 0.0).all())
    steady.to_netcdf(tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as read:
        assert table(read) == table(steady)
        assert recommendation(read) == recommendation(steady)
        assert explanation(read) == explanation(steady)


def test_the_table_has_a_line_a_setting_and_its_columns_are_explained(steady):
    lines = table(steady)
    assert len(lines) == steady.sizes["row"]
    by_label = {line["setting"]: line for line in lines}
    assert by_label["mean"]["ΔΓ\n(%)"] == "100 spread"
    assert by_label["modal"]["sample"] == "agrees"
    assert by_label["banded 0.01 *"]["members\nsampled"] == "96"
    said = explanation(steady)
    assert all(heading.split("\n")[0] in said for heading in lines[0] if heading not in ("changed", "setting"))
    assert "64 members, 64 steps of 10 ms" in said


def test_the_figure_has_one_panel_and_labels_apart(steady, tmp_path):
    drawn = figure(steady)
    (panel,) = drawn.axes
    renderer = panel.figure.canvas.get_renderer()
    boxes = [text.get_window_extent(renderer) for text in panel.texts]
    assert boxes
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])
    assert any(text.get_text() == "banded 0.01" for text in panel.texts)
    drawn.savefig(tmp_path / "out.png")


def test_a_model_whose_variance_is_ten_percent_off_is_found_out(monkeypatch, quick):
    quick(640)
    rows = [row for row in settings(scene(**STEADY), []) if row.own]
    monkeypatch.setattr(converge_module, "settings", lambda scenario, _: [replace(rows[0], scenario=scenario)])

    start, advance = BandedProcess.start, BandedProcess.advance

    def spread(process, state, energy):
        wider = [process.bands.mean + math.sqrt(1.1) * (one - process.bands.mean) for one in (state.energy, energy)]
        return state._replace(energy=wider[0]), wider[1]

    def wrong_start(self, *arguments):
        state = start(self, *arguments)
        return spread(self, state, state.energy)[0]

    monkeypatch.setattr(BandedProcess, "start", wrong_start)
    monkeypatch.setattr(BandedProcess, "advance", lambda self, *given: spread(self, *advance(self, *given)))
    parts = STEADY | {"shear": replace(BANDED, correlation=Time(time=0.02))}
    dataset = converge(scene(**parts), 0.1)
    off = of(dataset, "banded 0.01", "fluctuation_energy", "standard deviation", "deviation")[0]
    sem = of(dataset, "banded 0.01", "fluctuation_energy", "standard deviation", "standard_error")[0]
    assert abs(off - (math.sqrt(1.1) - 1.0)) < 5.0 * sem
    assert {line["setting"]: line["sample"] for line in table(dataset)}["banded 0.01 *"] == "DIFFERS"
    assert "Beware" in recommendation(dataset)


def test_where_a_contact_may_open_samples_stand_in_for_the_law(quick):
    quick(64)
    parts = {"drive": DRIVES["linear ramp"], "clock": Clock(duration=0.02, step=1e-3, record=2e-3)}
    dataset = converge(scene(shear=SHEARS["modal, slip, onset"], contact=CONTACTS["tension"], **parts), 0.1)
    bound = dataset["bound"].sel(quantity="contact_radius", statistic="mean")
    assert bool(np.isfinite(bound).all())
    assert of(dataset, "mapped", "contact_radius", name="bound") == 0.0  # it is the reference
    assert np.isnan(dataset["bound"].sel(quantity="fluctuation_energy", statistic="mean")).all()
    assert "samples leave errors of up to" in recommendation(dataset)
    assert any(line["radius\n(%)"].startswith("≤") for line in table(dataset))


def test_without_fluctuations_and_memory_every_setting_is_exact(quick):
    quick()
    dataset = converge(scene(shear=shear.Mean(spectrum=SPECTRUM), bonds=BONDS["steady"], drive=DRIVES["log ramp"]), 0.1)
    assert float(dataset["error"].max()) < 1e-12
    assert "exact" in recommendation(dataset)
    assert "nothing to sample" in recommendation(dataset)
    figure(dataset)


def test_a_grid_that_leaves_waves_out_is_found(quick):
    quick(0)
    part = shear.Banded(spectrum=Gaussian(rms=1e5, length=5e-6), cell=CELL, points=32, correlation=Time(time=0.02))
    dataset = converge(scene(shear=part, drive=DRIVES["steady"], clock=Clock(duration=0.32, step=0.01)), 0.1)
    grids = [f"{points} points" for points in (16, 32, 64)]
    errors = [of(dataset, label, "fluctuation_energy") for label in grids]
    energy = [cell_gammas(scene(shear=part), points) for points in (16, 32, 64, 512)]
    mean = np.array([np.sum(terms.weight * terms.shape) for terms in energy])
    assert_allclose(errors, 1.0 - mean[:3] / mean[3], rtol=1e-9)
    assert "points = 64" in recommendation(dataset)


def test_maps_and_sweeps_are_left_out_and_the_point_is_named(quick):
    quick(0)
    part = shear.Mapped(spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=5e-6))
    sweep = {"contact.load": [1e-3, 4e-3]}
    dataset = converge(scene(shear=part, drive=DRIVES["steady"], record=Record(maps=(2e-3,)), sweep=sweep), 0.1)
    assert "contact.load = 4 mN" in explanation(dataset)
    assert "--set contact.load=" in explanation(dataset)
    assert "too small for samples" in recommendation(dataset)


# bonds


@pytest.fixture(scope="module")
def cohorts():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(converge_module, "timed", lambda scene, _: _counted_time(scene))
        parts = {"bonds": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=3e-3), "drive": drive.Steady(speed=5e-3)}
        return converge(scene(**parts, clock=Clock(duration=0.05, step=1e-3)), 0.1)


_LAW = [STRETCHED[key] for key in ("bond_stiffness", "rebinding_rate", "site_density")]


def test_the_reference_of_bonds_is_the_closed_form(cohorts):
    exact = bell_stress(5e-3, 200.0, 4e-12, *_LAW)
    assert_allclose(cohorts["yardstick"].sel(quantity="shear_stress", statistic="mean"), exact, rtol=3e-3)
    assert_allclose(
        of(cohorts, "rate", "shear_stress"), first_moment_stress(5e-3, 200.0, 4e-12, *_LAW) / exact - 1.0, rtol=3e-3
    )


@pytest.mark.parametrize("tolerance", [1e-2, 3e-3, 1e-3, 1e-4, 1e-5, REFERENCE])
def test_cohorts_keep_their_tolerance(cohorts, tolerance):
    assert of(cohorts, f"cohort {tolerance:g}", "shear_stress") <= tolerance
    assert of(cohorts, f"cohort {tolerance:g}", "bond_fraction") <= tolerance


def test_a_rate_equation_is_exact_for_a_constant_rupture(quick):
    quick()
    parts = JUMP | {"bonds": bonds.FirstMoment(rupture=Constant(rate=200.0), **STRETCHED, start_from="empty")}
    found = converge(scene(**parts), 0.1)
    assert of(found, "rate", "shear_stress") < 3.0 * REFERENCE
    assert of(found, "rate", "bond_fraction") < 3.0 * REFERENCE


@pytest.mark.parametrize("name", ["counted", "tracked"])
def test_the_noise_of_sites_is_that_of_independent_ones(name, quick):
    quick(300)
    dataset = converge(scene(bonds=BONDS[name], drive=drive.Ramp(start=1e-3, stop=2e-2)), 0.1)
    assert not differing(dataset).any()
    own = next(str(row.values) for row in dataset["row"] if str(row.values).startswith(name))
    assert of(dataset, own, "bond_fraction", "standard deviation") == 0.0
    lacking = of(dataset, "rate", "bond_fraction", "standard deviation")
    assert 0.05 < lacking < 0.5  # about 1/√40 and 1/√30 of the bonds
    said = recommendation(dataset)
    assert f"“{own}" in said or "It is the cheapest" in said  # few sites are to be followed


def test_sites_of_another_law_are_found_out(monkeypatch, quick):
    quick(200)
    parts = {"bonds": BONDS["tracked"], "drive": drive.Steady(speed=5e-3)}
    softer = replace(BONDS["tracked"], rupture=Bell(zero_force_rate=200.0, bell_force=8e-12), start_from="steady")
    row = next(row for row in settings(scene(**parts), []) if row.own)
    wrong = replace(row, scenario=scene(**parts | {"bonds": softer}))
    exact = [other for other in settings(scene(**parts), []) if other.label == "cohort 1e-06"]
    monkeypatch.setattr(converge_module, "settings", lambda *_: [*exact, wrong])
    assert {line["sample"] for line in table(converge(scene(**parts), 0.1))} == {"–", "DIFFERS"}


# what is said of given numbers


def found_of(error, time, part=None, own=None, bound=None, **attributes):
    """A dataset of rows with one error throughout and times within 5 %."""
    rows = len(error)
    full = np.broadcast_to(np.reshape(error, (-1, 1, 1)), (rows, 4, 4)).copy()
    limit = np.full(full.shape, np.nan) if bound is None else np.broadcast_to(np.reshape(bound, (-1, 1, 1)), full.shape)
    dims, part = ("row", "quantity", "statistic"), part or ["shear"] * (rows - 1) + ["step"]
    variables = {
        "error": (dims, full), "bound": (dims, limit),
        "deviation": (("row", "t", *dims[1:]), np.zeros((rows, 1, 4, 4))),
        "standard_error": (("row", "t", *dims[1:]), np.full((rows, 1, 4, 4), 0.01)),
        "part": ("row", part), "own": ("row", own or [1] + [0] * (rows - 2) + [1]),
        "toml": ("row", [f"line = {k}" for k in range(rows)]),
        "time": ("row", np.array(time)), "time_low": ("row", 0.95 * np.array(time)),
        "time_high": ("row", 1.05 * np.array(time)), "members": ("row", [9] * rows),
        "clock_step": ("row", [1.0] * rows),
    }  # fmt: skip
    said = {"tolerance": 0.01, "clock_step": 1.0, "steps": 10, "members_of_run": 9, "point": "", "left_out": ""}
    coordinates = {"row": [f"row {k}" for k in range(rows)], "statistic": list(STATISTICS)}
    return xr.Dataset(variables, coordinates, said | {"fluctuates": 1, "pooled": 0} | attributes)


def test_the_cheapest_combination_within_the_tolerance_is_recommended():
    dataset = found_of([0.0, 0.1, 0.008, 0.0], [9.0, 1.0, 2.0, 9.0])
    assert chosen(choices(dataset), 0.01)[0].rows == (2, 3)
    said = recommendation(dataset)
    assert "“row 2, row 3” is the cheapest combination that keeps 1 %" in said
    assert said.endswith("[shear]\nline = 2")


def test_of_equal_times_the_most_accurate_is_taken_and_said():
    said = recommendation(found_of([0.0, 0.008, 0.003, 0.0], [9.0, 1.0, 1.05, 9.0]))
    assert "“row 2, row 3”" in said
    assert "1 more take as long within the spread of the times" in said


def test_errors_add_up_and_the_step_that_rules_is_shortened():
    parts = {"part": ["shear", "step", "step"], "own": [1, 1, 0]}
    dataset = found_of([0.004, 0.05, 0.004], [1.0, 1.0, 4.0], **parts)
    assert_allclose(choices(dataset)[0].off, 0.054)
    said = recommendation(dataset)
    assert "off by at most 5.4 %" in said
    assert "5 % by its clock step, 0.4 % by its shear model" in said
    assert said.endswith("[clock]\nline = 2")
    none = recommendation(found_of([0.004, 0.05, 0.02], [1.0, 1.0, 4.0], **parts))
    assert "No combination keeps 1 %" in none
    assert "The clock step rules: by its trend about 200 ms would do" in none


def test_times_of_changes_add_up_and_steps_multiply_them():
    parts = {"part": ["shear", "shear", "bonds", "bonds", "step", "step"], "own": [1, 0, 1, 0, 1, 0]}
    dataset = found_of([0.0] * 6, [10.0, 4.0, 10.0, 9.0, 10.0, 20.0], **parts)
    times = {choice.rows: choice.time for choice in choices(dataset)}
    assert_allclose(times[0, 2, 4], 10.0)
    assert_allclose(times[1, 3, 4], 3.0)
    assert_allclose(times[1, 3, 5], 6.0)


def test_what_samples_can_see_is_said():
    assert "below what this budget can see" in recommendation(found_of([0.0, 0.0], [1.0, 1.0]))
    said = recommendation(found_of([0.0, 0.0], [1.0, 1.0], bound=[0.06, np.nan]))
    assert "samples leave errors of up to 6 %" in said
