"""``sim converge``: errors against closed forms and finer runs, the budget, and the recommendation."""

import math
import re
import time

import numpy as np
import pytest
import xarray as xr
from helpers.parts import Clock, Equilibrium, RateDependent, bonds, drive, shear
from helpers.scenes import (
    BELL,
    BONDS,
    CELL,
    CONTACTS,
    CUT_OFF,
    DRIVES,
    SHEARS,
    SPECTRUM,
    STRETCHED,
    scene,
)
from numpy.testing import assert_allclose

import sim.study.converge as study
from sim.laws.schallamach import bell_stress, first_moment_stress
from sim.parts.bonds.rupture import Bell, Constant
from sim.parts.shear.process import Onset, Slip, Stress, Time, Wave
from sim.spectrum.families import SelfAffine
from sim.study.converge import (
    QUANTITIES,
    STATISTICS,
    choices,
    chosen,
    converge,
    explanation,
    recommendation,
    table,
)

ROUGH = SelfAffine(rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=8e-6)
BANDED = shear.Banded(spectrum=ROUGH, cell=CELL, correlation=Wave(waves=1.0))
STEADY = {
    "shear": BANDED,
    "drive": drive.Steady(speed=3e-4),
    "clock": Clock(duration=0.64, step=0.01, record=0.02),
}
#: A jump of the speed and a reversal, under cohorts.
JUMP = {
    "bonds": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=1e-3),
    "drive": drive.Table(
        time=(0.0, 0.0123, 0.0123, 0.03, 0.04), speed=(1e-3, 1e-3, 6e-3, 6e-3, -1e-3)
    ),
}


class CountedTime:
    """A clock that runs only while steps are made, so that the load of the machine changes no result.

    Finer models take longer, by some ``factors`` for single ones. A run takes ``slower`` times its estimate.
    """

    models = (
        "mean",
        "steady",
        "rate",
        "banded",
        "cohort",
        "modal",
        "mapped",
        "counted",
        "tracked",
    )

    def __init__(self, monkeypatch, slower=1.0, factors=()):
        self.seconds, self.slower, self.factors, self.follow = (
            0.0,
            slower,
            dict(factors),
            study.follow,
        )
        monkeypatch.setattr(study, "stopwatch", lambda: lambda: self.seconds)
        monkeypatch.setattr(
            study, "_timed", lambda scenario, seconds: self.of_run(scenario)
        )
        monkeypatch.setattr(study, "follow", self.counted)

    def of_run(self, scenario):
        parts = scenario.shear, scenario.bonds
        rank = sum(
            self.models.index(part.model) for part in parts if part.model in self.models
        )
        digits = sum(math.log10(getattr(part, "tolerance", 1.0)) for part in parts)
        factor = math.prod(self.factors.get(part.model, 1.0) for part in parts)
        return 1e-4 * scenario.clock.steps * (1 + rank - digits) * factor

    def counted(self, scenario, noise, state, steps, process=None):
        result = self.follow(scenario, noise, state, steps, process)
        members = scenario.ensemble.members if scenario.is_random else 1
        share = (steps[-1] - (state.step if state else 0)) / scenario.clock.steps
        self.seconds += (
            self.slower
            * self.of_run(scenario)
            * share
            * len(noise.bonds.members)
            / members
        )
        return result


@pytest.fixture
def quick(monkeypatch):
    """Times that are counted, not measured."""
    return CountedTime(monkeypatch)


@pytest.fixture(scope="module")
def steady():
    with pytest.MonkeyPatch.context() as patched:
        CountedTime(patched)
        return converge(scene(**STEADY, members=64), 3.0)


def of(dataset, row, quantity, statistic="mean", name="error"):
    return float(dataset[name].sel(row=row, quantity=quantity, statistic=statistic))


@pytest.mark.parametrize(
    "parts",
    [
        {"shear": SHEARS["modal, slip, onset"], "contact": CONTACTS["tension"]},
        {
            "shear": SHEARS["modal, time, constant"],
            "contact": CONTACTS["rate_dependent"],
        },
        pytest.param(
            {"shear": SHEARS["modal self-affine"], "bonds": BONDS["tracked"]},
            marks=pytest.mark.verify,
        ),
        {
            "shear": SHEARS["mapped, diffusion, constant"],
            "bonds": BONDS["cohort, carried"],
        },
    ],
)
def test_open_and_lagging_contacts_relaxing_amplitudes_and_carried_areas_have_errors(
    parts, quick
):
    dataset = converge(scene(**parts, drive=DRIVES["linear ramp"]), 4.0)
    known = dataset["error"].sel(
        quantity=["fluctuation_energy", "contact_radius"], statistic=["mean", "spread"]
    )
    assert (
        np.all(np.isfinite(known))
        and np.all(dataset["members"] >= 1)
        and recommendation(dataset)
    )


def test_errors_of_rates_and_of_missing_sites_are_their_closed_forms_and_the_cheapest_within_is_chosen(
    quick,
):
    parts = {
        "bonds": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=3e-3),
        "drive": drive.Steady(speed=5e-3),
    }
    dataset = converge(scene(**parts, clock=Clock(duration=0.05, step=1e-3)), 20.0)
    law = [
        STRETCHED[key] for key in ("bond_stiffness", "rebinding_rate", "site_density")
    ]
    exact = bell_stress(5e-3, 200.0, 4e-12, *law)
    expected = abs(first_moment_stress(5e-3, 200.0, 4e-12, *law) / exact - 1.0)
    assert_allclose(of(dataset, "rate", "shear_stress"), expected, rtol=3e-3)
    assert (
        expected > 0.01
        and "“cohort 0.01, step 1 ms” is the fastest" in recommendation(dataset)
    )
    for tolerance in (0.01, 0.003, 0.001, 0.0001, 1e-05):
        assert of(dataset, f"cohort {tolerance}", "shear_stress") <= tolerance
    dataset = converge(
        scene(
            bonds=BONDS["counted"],
            drive=drive.Steady(speed=2e-3),
            steps=40,
            members=640,
        ),
        4.0,
    )
    share = float(BONDS["counted"].steady(np.array([2e-3])).fraction[0])
    expected = math.sqrt((1.0 - share) / (share * BONDS["counted"].sites))
    lacking, error = (
        of(dataset, "rate", "bond_fraction", "spread", name)
        for name in ("error", "standard_error")
    )
    assert abs(lacking - expected) < 5.0 * error < 0.25 * expected
    assert of(dataset, "counted 40", "bond_fraction", "spread") == 0.0
    assert "counted 40" in recommendation(
        dataset
    ) or "It is the fastest" in recommendation(dataset)
    parts = {
        "shear": shear.Mean(spectrum=SPECTRUM),
        "bonds": BONDS["steady"],
        "drive": DRIVES["log ramp"],
    }
    dataset = converge(scene(**parts), 2.0)
    assert float(
        dataset["error"].max()
    ) < 1e-12 and "scenario as written is exact" in recommendation(dataset)
    study.figure(dataset)


def run_of(scenario, members=1):
    return study.recorded(scenario, range(members), study._records(scenario))


#: Bonds that live for half a second, under a jump of the speed and a reversal within 5 ms.
STEEP = {
    "bonds": bonds.Cohort(
        rupture=Bell(zero_force_rate=2.0, bell_force=4e-12),
        **STRETCHED | {"rebinding_rate": 4.0},
        tolerance=1e-2,
    ),
    "drive": drive.Table(
        time=(0.0, 0.1, 0.1, 0.4, 0.405, 0.6),
        speed=(2e-5, 2e-5, 2e-3, 2e-3, -1e-3, 5e-4),
    ),
}


@pytest.mark.parametrize(
    ("parts", "duration", "step", "fine"),
    [
        (JUMP, 0.04, 4e-3, 4e-5),
        (STEEP, 0.6, 0.02, 4e-4),
        (STEEP, 0.6, 0.004, 4e-4),
    ],
)
def test_the_error_of_a_long_step_is_bounded_and_no_more_than_twice_as_large(
    parts, duration, step, fine, quick
):
    record = max(step, 0.02 if parts is STEEP else step)
    written = scene(**parts, clock=Clock(duration=duration, step=step, record=record))
    own = choices(converge(written, 20.0))[0]
    truth = run_of(
        scene(**parts, clock=Clock(duration=duration, step=fine, record=record))
    )[:, 0]
    off = np.abs(run_of(written)[:, 0] - truth).max(axis=1)
    promised = own.error[:, 0] * np.abs(truth).max(axis=1)
    assert np.all(off <= promised) and off[0] > 0.5 * promised[0] > 0.0


def test_runs_with_other_steps_have_the_same_fluctuations_and_an_amplitude_the_error_of_its_bonds(
    quick,
):
    scenario = scene(
        shear=SHEARS["modal, slip, onset"],
        contact=CONTACTS["rate_dependent"],
        drive=DRIVES["steady"],
    )
    rows = [study._at_step(scenario, ratio) for ratio in (0.5, 1.0)]
    fine, coarse = study._at_steps(rows, 5)
    assert_allclose(fine[2], coarse[2], rtol=1e-12)
    assert np.array_equal(fine, run_of(rows[0].scenario, 5)) and not np.array_equal(
        fine[3], coarse[3]
    )
    assert_allclose(fine[3], coarse[3], rtol=0.1)
    law = shear.Banded(
        spectrum=ROUGH,
        cell=CELL,
        correlation=Time(time=5e-3),
        amplitude=Stress(reference=1e5),
    )
    parts = JUMP | {"shear": law, "clock": Clock(duration=0.04, step=2e-3)}
    dataset = converge(scene(**parts), 3.0)
    step = dataset.sel(row="step 2 ms", statistic="mean")
    # the energy goes with the square of the stress
    assert float(step["error"].sel(quantity="fluctuation_energy")) > float(
        step["error"].sel(quantity="shear_stress")
    )
    assert float(step["standard_error"].sel(quantity="fluctuation_energy")) < 0.01


def draws(rng, members, known):
    """Energies with a lower mean and a larger spread at one setting, and radii that follow them, of four quantities."""
    energy = rng.exponential(size=(2, members))
    energy[0] = 1.0 + known[0] + (1.0 + known[1]) * (energy[0] - 1.0)
    values = np.zeros((2, len(QUANTITIES), members, 1))
    values[:, 2, :, 0] = energy
    values[:, 3, :, 0] = 10.0 - energy + 0.01 * rng.normal(size=(2, members))
    return values


def test_equal_members_cancel_and_a_known_error_of_the_energy_removes_noise_of_the_radius():
    known = np.array([-0.02, 0.05, 0.0, 0.0])
    values = draws(np.random.default_rng(3), 4000, known)
    error, deviation = study._errors(*values, known)
    assert_allclose(error[2, :2], np.abs(known[:2]), rtol=0.1)
    assert_allclose(
        error[3, 0] * 9.0, 0.02, rtol=0, atol=0.05 * 0.02 + 5.0 * 9.0 * deviation[3, 0]
    )
    assert np.all(deviation[3, :2] < 0.1 * study._errors(*values)[1][3, :2])
    same = np.array(study._errors(values[0], values[0]))
    assert np.all(same[:, :, :2] == 0.0)


@pytest.mark.verify
@pytest.mark.parametrize("corrected", [False, True])
def test_errors_in_units_of_their_standard_errors_are_standard_normal(corrected):
    rng, scores, known = np.random.default_rng(7), [], np.array([-0.1, 0.2, 0.0, 0.0])
    # mean and spread of the radius over its mean
    exact = np.array([0.1 / 9.0, 0.2 / 9.0])
    for _ in range(400):
        error, deviation = study._errors(
            *draws(rng, 400, known), known if corrected else None
        )
        scores.append((error[3, :2] - exact) / deviation[3, :2])
    assert np.all(np.abs(np.mean(scores, axis=0)) < 0.3)
    wide = np.std(scores, axis=0)
    assert np.all((wide > 0.8) & (wide < 1.25)), wide


#: Waves on a large cell in many steps, of which the modes take much longer than bands.
WIDE = STEADY | {
    "shear": shear.Banded(spectrum=ROUGH, cell=3 * CELL, correlation=Wave(waves=1.0)),
    "clock": Clock(duration=2.0, step=1e-3),
}


@pytest.mark.parametrize(("budget", "slower"), [(1.5, 1.0), (30.0, 1.0), (30.0, 2.0)])
def test_the_budget_is_kept_and_what_does_not_fit_is_named(budget, slower, monkeypatch):
    time_of_runs = CountedTime(monkeypatch, slower, {"modal": 20.0})
    dataset = converge(scene(**WIDE, members=64), budget)
    assert time_of_runs.seconds < 1.3 * budget
    fits = "modal" in dataset["row"].to_numpy()
    assert fits == (budget > 5.0) == ("Omitted: modal" not in explanation(dataset))
    assert fits or dataset.attrs["left_out"] == "modal: does not fit into the budget"


@pytest.mark.verify
@pytest.mark.parametrize("budget", [1.5, 30.0])
def test_the_budget_is_kept_in_cpu_time(budget):
    scenario = scene(**WIDE, members=64)
    scenario.process  # noqa: B018 - its library is loaded before the time counts
    began = time.process_time()
    dataset = converge(scenario, budget)
    assert time.process_time() - began < 1.3 * budget
    fits = "modal" in dataset["row"].to_numpy()
    assert fits == (budget > 5.0) == ("Omitted: modal" not in explanation(dataset))
    assert fits or dataset.attrs["left_out"] == "modal: does not fit into the budget"


#: Half of a million steps of cohorts, of which a second computes a small part.
LONG = scene(**JUMP | {"clock": Clock(duration=0.04, step=1e-7, record=1e-3)})


def missing(dataset):
    """True for each row of the scene whose error is not known."""
    own = dataset.where(dataset["own"] == 1, drop=True)
    return (own["members"] == 0).to_numpy()


def test_a_scene_that_does_not_fit_into_its_budget_has_its_cost_no_error_and_no_recommendation(
    tmp_path, quick
):
    dataset = converge(LONG, 0.5)
    assert quick.seconds < 0.65
    assert missing(dataset).all() and np.all(
        dataset["error"].sel(row=dataset["members"] == 0).isnull()
    )
    assert np.all(dataset["time"] > 0.0) and dataset.attrs["budget"] > 0.5
    text = recommendation(dataset)
    assert (
        "No setting is recommended" in text
        and "cohort 0.001, step 100 ns" in text
        and "[" not in text
    )
    assert study.engineering(dataset.attrs["budget"], "s") in text
    picture = study.figure(dataset.isel(row=dataset["members"].to_numpy() == 0))
    study.save(picture, tmp_path / "empty.png")
    assert "recommended" not in picture.axes[0].get_legend_handles_labels()[1]
    assert {
        line["stress\n(%)"] for line in table(dataset) if "*" in line["setting"]
    } == {"–"}


@pytest.mark.parametrize(
    ("budget", "slower"),
    [
        (0.3, 1.7),
        *(
            pytest.param(*case, marks=pytest.mark.verify)
            for case in ((0.3, 1.0), (1.0, 1.0), (1.0, 1.7))
        ),
    ],
)
def test_the_budget_that_is_named_answers_what_was_missing(budget, slower, monkeypatch):
    CountedTime(monkeypatch, slower)
    scenario = scene(**STEADY | {"clock": Clock(duration=4.0, step=1e-3)}, members=64)
    few = converge(scenario, budget)
    assert "does not fit" in few.attrs["left_out"] or missing(few).any()
    enough = converge(scenario, float(few.attrs["budget"]))
    assert "does not fit" not in enough.attrs["left_out"] and not missing(enough).any()
    assert np.all(enough["members"] >= few["members"].max())


def test_a_clock_that_moves_in_steps_of_sixteen_milliseconds_gives_every_setting_a_time(
    monkeypatch,
):
    fine = time.process_time
    monkeypatch.setattr(time, "process_time", lambda: 0.016 * (fine() // 0.016))
    dataset = converge(
        scene(drive=DRIVES["steady"], bonds=BONDS["rate"], shear=SHEARS["uniform"]), 0.5
    )
    assert np.all(dataset["time"] > 0.0) and recommendation(dataset)


def test_an_error_at_any_recorded_time_is_seen(quick):
    # contacts open between 0.8 and 0.9 of the run, and most are closed before or open afterwards
    ramp = Equilibrium(load={"from": 1e-3, "to": -4e-4})
    parts = {
        "bonds": bonds.Unbroken(stress=3e5),
        "drive": drive.Steady(speed=2e-3),
        "contact": ramp,
    }
    shears = shear.Banded(spectrum=ROUGH, cell=CELL, correlation=Slip(length=5e-6))
    scenario = scene(
        **parts, shear=shears, clock=Clock(duration=0.5, step=0.01), members=256
    )
    dataset = converge(scenario, 4.0)
    finer = scenario.with_values(
        {"clock": {"duration": 0.5, "step": 0.01 / 64, "record": 0.01}}
    )
    means = [
        np.nan_to_num(run_of(each, 256)[3]).mean(axis=0) for each in (scenario, finer)
    ]
    off = np.abs(means[0] - means[1])
    own = dataset.isel(row=(dataset["part"] == "step") & (dataset["own"] == 1)).sel(
        quantity="contact_radius"
    )
    assert off.argmax() in range(41, 46) and off.max() > 0.1 * means[1].max()
    assert (
        float(own["error"].sel(statistic="mean")[0]) > 0.5 * off.max() / means[1].max()
    )


def test_the_bound_of_the_largest_of_many_true_differences_holds_in_95_of_100_samples():
    rng, members, times, held_in = np.random.default_rng(11), 24, 200, 0
    truth = np.zeros(times)
    truth[37], truth[150] = 0.05, 0.08
    for _ in range(400):
        reference = 1.0 + 0.0 * rng.normal(size=(len(QUANTITIES), members, times))
        noise = rng.normal(size=reference.shape) * np.where(
            np.arange(times) == 150, 0.2, 0.01
        )
        error, deviation = study._errors(reference + truth + noise, reference)
        held_in += bool(
            error[0, 0] + study.students(members) * deviation[0, 0] >= truth.max()
        )
    assert held_in >= 0.95 * 400


def admitted_rows(scenario):
    """Settings of a scene, and the reasons for those left out."""
    budget = study.Budget(lambda: 0.0, 1.0, math.inf)
    rows = [
        study._admitted(*changes, scenario, budget)
        for changes in study.alternatives(scenario)
    ]
    return list(filter(None, rows)), budget.left_out


def admitted(**parts):
    """Labels of the settings of a scene, that of the scene marked, and the reasons for those left out."""
    rows, left_out = admitted_rows(scene(**parts))
    return [row.label + "*" * row.own for row in rows], left_out, rows


def test_what_the_scene_admits_is_tried_once_choices_and_sweeps_are_settled(quick):
    labels, left_out, _ = admitted(**STEADY)
    bands = ["banded 0.3", "banded 0.1", "banded 0.03", "banded 0.01*", "banded 0.003"]
    assert labels == ["mean", *bands, "modal"] and not left_out
    relaxing = shear.Banded(
        spectrum=ROUGH,
        cell=CELL,
        correlation=Slip(length=5e-6),
        amplitude=Onset(speed=1e-3, width=0.3, relaxing=True),
    )
    labels, left_out, _ = admitted(shear=relaxing)
    assert (
        "mean" not in labels
        and left_out[0].startswith("mean: ")
        and "relaxing" in left_out[0]
    )
    assert admitted(shear=SHEARS["mapped, diffusion, constant"])[0][-1] == "mapped*"
    # 4.5e9 sites: not followed
    cohorts = admitted(bonds=bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=3e-3))[0]
    assert cohorts == [
        "rate",
        "cohort 0.01",
        "cohort 0.003*",
        "cohort 0.001",
        "cohort 0.0001",
        "cohort 1e-05",
        "cohort 1e-06",
    ]
    labels, _, rows = admitted(bonds=BONDS["tracked"])
    assert (
        labels[-1] == "tracked 30*" and rows[-1].toml == 'model = "tracked"\nsites = 30'
    )
    assert admitted(bonds=BONDS["counted"])[0] == ["steady", "rate", "counted 40*"]
    assert admitted(bonds=BONDS["cohort, carried"])[0][-1] == "cohort 1e-06"
    parts = {
        "bonds": BONDS["auto, many sites"],
        "shear": SHEARS["auto with correlation"],
    }
    dataset = converge(
        scene(**parts, drive=DRIVES["steady"], sweep={"contact.load": [1e-3, 4e-3]}),
        1.0,
    )
    own = dataset["row"].to_numpy()[dataset["own"] == 1]
    assert [str(name).split()[0] for name in own] == ["banded", "rate", "step"]
    assert "contact.load" in explanation(dataset)


def test_errors_of_bands_are_those_known_before_the_run_in_dataset_table_and_figure(
    steady, tmp_path
):
    known = scene(**STEADY).process.bands.errors
    for statistic, name in (
        ("skewness", "third_cumulant"),
        ("correlation time", "correlation_time"),
    ):
        error = of(steady, "banded 0.01", "fluctuation_energy", statistic)
        assert_allclose(error, known[f"banded_error_{name}"], rtol=1e-6)
    assert of(steady, "banded 0.01", "fluctuation_energy", "spread") < 1e-12
    assert of(steady, "mean", "fluctuation_energy", "spread") == 1.0
    radius = steady.sel(quantity="contact_radius", statistic="mean")
    assert np.all(radius["error"] <= 5.0 * radius["standard_error"] + 2e-4)
    assert np.all(steady.isel(row=steady["part"] == "step")["error"].fillna(0.0) < 1e-9)
    assert steady["error"].dims == ("row", "quantity", "statistic")
    assert (
        tuple(steady["statistic"].to_numpy()) == STATISTICS
        and tuple(steady["quantity"].to_numpy()) == QUANTITIES
    )
    assert all(variable.attrs["long_name"] for variable in steady.data_vars.values())
    steady.to_netcdf(tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as read:
        assert (table(read), recommendation(read), explanation(read)) == (
            table(steady),
            recommendation(steady),
            explanation(steady),
        )
    lines = {line["setting"]: line for line in table(steady)}
    assert len(lines) == steady.sizes["row"]
    assert lines["mean"]["ΔΓ\n(%)"] == "100 spread" and lines["modal"]["ΔΓ\n(%)"] == "0"
    assert (
        lines["banded 0.01 *"]["members"]
        == f"{int(steady['members'].sel(row='banded 0.01')):,}"
    )
    (panel,) = study.figure(steady).axes
    shown = np.concatenate(
        [container.lines[0].get_xdata() for container in panel.containers]
    )
    assert_allclose(np.sort(shown), np.sort(steady["time"]))


def dataset_of(error, cost, part=None, own=None, noise=0.0):
    """A dataset of rows with one error throughout."""
    rows, part = len(error), part or ["shear"] * (len(error) - 1) + ["step"]
    full = np.broadcast_to(np.reshape(error, (-1, 1, 1)), (rows, len(QUANTITIES), 4))
    dims = ("row", "quantity", "statistic")
    variables = {
        "error": (dims, full),
        "standard_error": (dims, np.full(full.shape, noise)),
        "part": ("row", part),
        "own": ("row", own or [1] + [0] * (rows - 2) + [1]),
        "time": ("row", np.array(cost)),
        "toml": ("row", [f"line = {k}" for k in range(rows)]),
        "members": ("row", [100] * rows),
    }
    return xr.Dataset(
        variables, {"row": [f"row {k}" for k in range(rows)]}, {"tolerance": 0.01}
    )


def test_errors_add_up_noise_is_added_by_students_quantile_and_steps_multiply_times():
    parts = {"part": ["shear", "step", "step"], "own": [1, 1, 0]}
    dataset = dataset_of([0.004, 0.05, 0.004], [1.0, 1.0, 4.0], **parts)
    assert_allclose(choices(dataset)[0].bound, 0.054)
    assert "off by at most 5.4 %" in recommendation(dataset) and recommendation(
        dataset
    ).endswith("[clock]\nline = 2")
    assert "none is shown to be within 1 %" in recommendation(
        dataset_of([0.004, 0.05, 0.02], [1.0, 1.0, 4.0], **parts)
    )
    noisy = dataset_of([0.004, 0.05, 0.004], [1.0, 1.0, 4.0], noise=0.003, **parts)
    assert_allclose(
        choices(noisy)[1].bound, 0.008 + 1.984217 * math.sqrt(2.0) * 0.003, rtol=1e-6
    )
    assert all(
        words in recommendation(noisy)
        for words in ("About 280 members, 2.8 times", "0.84 % is noise")
    )
    parts = {
        "part": ["shear", "shear", "bonds", "bonds", "step", "step"],
        "own": [1, 0, 1, 0, 1, 0],
    }
    dataset = dataset_of([0.0] * 6, [10.0, 4.0, 10.0, 9.0, 10.0, 20.0], **parts)
    times = {choice.rows: choice.time for choice in choices(dataset)}
    assert_allclose([times[0, 2, 4], times[1, 3, 4], times[1, 3, 5]], [10.0, 3.0, 6.0])
    dataset = dataset_of([0.0, 0.1, 0.008, 0.0], [9.0, 1.0, 2.0, 9.0])
    assert chosen(choices(dataset), 0.01)[0].rows == (2, 3)
    assert "“row 2, row 3” is the fastest" in recommendation(dataset)
    assert recommendation(dataset).endswith("[shear]\nline = 2")
    assert chosen(
        choices(dataset_of([0.0, 0.008, 0.003, 0.0], [9.0, 1.0, 1.04, 9.0])), 0.01
    )[0].rows == (2, 3)


ON, LAGS = "banded, slip, onset", "rate_dependent"
#: Drive, bonds, shear and contact; the clock step matters where the edge lags.
SCENES = [
    ("table", "cohort, cut-off", ON, "load"),
    ("table", "cohort", ON, LAGS),
    ("log ramp", "counted", "uniform", "load"),
    ("linear ramp", "rate, carried", "modal, time, constant", LAGS),
    ("start", "tracked", "mean", "load"),
    ("table", "rate, bell", "banded, wave, relaxing stress", "load"),
    *(
        (part, *others)
        for part in ("spring with mass", "force")
        for others in (
            ("rate, bell", "banded, relaxing slip rate", "load"),
            ("tracked", ON, "load"),
            ("cohort, cut-off", ON, LAGS),
            ("counted", "modal, time, constant", "load"),
        )
    ),
]


def scene_of(*names):
    depths = zip(
        ("drive", "bonds", "shear", "contact"),
        (DRIVES, BONDS, SHEARS, CONTACTS),
        names,
        strict=True,
    )
    parts = {part: table[name] for part, table, name in depths}
    return scene(
        **parts, clock=Clock(duration=0.02, step=1e-3, record=4e-3), members=16
    )


def held(scenario, budget, parts=("shear", "bonds", "step")):
    """True for each setting and quantity whose error holds, against other members, finest models and 1/16 a step.

    The first column is True for clock steps.
    """
    dataset, driven, result = (
        converge(scenario, budget),
        scenario.drive.solves_motion,
        [],
    )
    bound = (
        dataset["error"]
        + study.students(dataset["members"]) * dataset["standard_error"]
    ).fillna(0.0)
    other = scenario.with_values({"seed": 99})
    tried = [row for row in admitted_rows(other)[0] if row.label in dataset["row"]]
    smooth = [
        row.scenario
        for row in tried
        if row.part == "bonds" and not hasattr(row.scenario.bonds, "sites")
    ]
    for part in parts:
        samples, rows = [], [row for row in tried if row.part == part][::-1]
        if part == "step":
            rows = [
                study._at_step(other if driven else [other, *smooth][-1], ratio)
                for ratio in (1 / 16, 1.0, 4.0)
            ]
            samples = study._at_steps(rows, 256)
        elif rows and (
            driven or part == "bonds" or other.fluctuations.amplitude.relaxing
        ):
            # else in closed form
            steps = study._records(
                max((row.scenario for row in rows), key=lambda scene: scene.is_random)
            )
            samples = [study.compared(row.scenario, range(512), steps) for row in rows]
        for row, sample in zip(rows[1:], samples[1:], strict=False):
            # the tolerance of sub-steps
            off = study._errors(sample, samples[0])[0, :, : 1 if driven else 2] - 1e-6
            holds = np.all(
                off <= bound.sel(row=row.label).to_numpy()[:, : off.shape[1]], axis=1
            )
            result += [(part == "step", each) for each in holds.tolist()]
    return [] if dataset.attrs["not_converging"] else result


@pytest.mark.verify
def test_stated_errors_hold_in_95_of_100_pairs_at_prescribed_speeds_and_behind_springs_and_forces(
    monkeypatch,
):
    monkeypatch.setattr(study, "_MOST", 64)  # fewer than in the runs that judge
    pairs = [held(scene_of(*names), 2.0) for names in SCENES]
    of_step, holds = np.array([pair for of_scene in pairs for pair in of_scene]).T
    print(
        f"{np.sum(holds)} of {len(holds)} pairs, {np.sum(holds[of_step])} of {np.sum(of_step)} of clock steps"
    )
    assert len(holds) > 400 and sum(map(bool, pairs)) > 11
    # of few members some spreads are not seen
    assert np.mean(holds) >= 0.95 and np.mean(holds[of_step]) >= 0.9


@pytest.mark.parametrize(
    ("is_unresolved", "left_out"),
    [
        (lambda scenario: scenario.clock.step < 1e-3, "step 250 µs"),
        (lambda scenario: scenario.clock.step > 1e-3, "step 4 ms"),
        (
            lambda scenario: getattr(scenario.bonds, "tolerance", 1.0) < 1e-5,
            "cohort 1e-06",
        ),
    ],
    ids=["finer step", "coarser step", "finer model"],
)
def test_a_setting_that_does_not_resolve_the_motion_is_left_out_and_named(
    is_unresolved, left_out, quick, monkeypatch
):
    def follow(scenario, *others):
        state, course = quick.counted(scenario, *others)
        if is_unresolved(scenario):
            state = state._replace(
                drive=state.drive._replace(unresolved_time=np.zeros(1))
            )
        return state, course

    monkeypatch.setattr(study, "follow", follow)
    dataset = converge(
        scene_of("spring with mass", "rate, bell", "uniform", "load"), 40.0
    )
    labels = {"step 4 ms", "step 1 ms", "step 250 µs", "cohort 1e-05", "cohort 1e-06"}
    assert labels & {*dataset["row"].to_numpy()} == labels - {left_out}
    assert (
        "could not be resolved" in dataset.attrs["left_out"]
        and not missing(dataset).any()
    )


def test_averages_behind_springs_and_under_forces_have_errors_that_hold_and_are_exact_without_noise(
    quick,
):
    # the edge lags: errors of percents
    pairs = held(scene_of(*SCENES[-2]), 1.5, ["step"])
    assert np.mean([holds for _, holds in pairs]) >= 0.9
    dataset = converge(
        scene_of("spring with mass", "rate, bell", "uniform", "load"), 1.5
    )
    assert (
        np.all(dataset["members"] == 1)
        and float(dataset["standard_error"].max()) == 0.0
    )
    largest = dataset["error"].groupby(dataset["part"]).max(...)
    assert largest.sel(part="step") < 1e-4 < 1e-2 < largest.sel(
        part="bonds"
    ) and "cohort" in recommendation(dataset)


def test_a_carried_area_that_fluctuates_is_not_shown_to_converge_and_nothing_is_recommended(
    quick,
):
    dataset = converge(scene_of("steady", "rate, carried", ON, "load"), 1.5)
    text = recommendation(dataset)
    changes = [float(number) for number in re.findall(r"[\d.]+(?=, then| %)", text)]
    # as step^(-1/2)
    assert "No setting is recommended" in text and changes[1] > 1.5 * changes[0]
    assert (
        "recommended"
        not in study.figure(dataset).axes[0].get_legend_handles_labels()[1]
    )


def random_scene(seed):
    """Any drive, bonds, shear and contact for forty steps."""
    rng = np.random.default_rng(seed)

    def pick(*options):
        return options[rng.integers(len(options))]

    times = np.sort(rng.uniform(0.0, 0.04, 3))
    speeds = rng.uniform(-1.0, 1.0, 6) * 10.0 ** rng.uniform(-3.5, -2.0, 6)
    turns = (0.0, times[0], times[0], times[1], times[2], times[2], 0.04)
    drives = (
        drive.Steady(speed=abs(speeds[0])),
        drive.Ramp(start=speeds[0], stop=speeds[1]),
        drive.Table(time=turns, speed=(*speeds[:5], *speeds[4:])),
    )
    start, rupture = (
        pick("steady", "bonded", "empty"),
        pick(BELL, CUT_OFF, Constant(rate=200.0)),
    )
    populations = (
        bonds.Rate(
            critical_speed=1e-2, rebinding_rate=300.0, stress=2e5, start_from=start
        ),
        bonds.Cohort(rupture=rupture, **STRETCHED, start_from=start),
        bonds.FirstMoment(rupture=rupture, **STRETCHED, start_from=start),
    )
    field = {
        "spectrum": ROUGH,
        "cell": CELL,
        "correlation": pick(Slip(length=1e-5), Wave(waves=1.0), Time(time=5e-3)),
        "amplitude": pick(
            Onset(speed=2e-3, width=0.3, floor=0.2), Stress(reference=1e5)
        ),
    }
    shears = (
        shear.Uniform(),
        shear.Mean(spectrum=ROUGH, amplitude=field["amplitude"]),
        shear.Banded(**field),
    )
    contacts = (
        Equilibrium(load=4e-3),
        Equilibrium(indentation={"from": 2e-6, "to": 1e-6}),
        RateDependent(load={"from": 4e-3, "to": 6e-3, "cycles": 1}, front_speed=1e-2),
    )
    clock = Clock(duration=0.04, step=1e-3, record=4e-3)
    return scene(
        drive=pick(*drives),
        bonds=pick(*populations),
        shear=pick(*shears),
        contact=pick(*contacts),
        clock=clock,
        members=64,
    )


@pytest.mark.verify
@pytest.mark.parametrize("seed", range(20))
def test_the_recommended_setting_keeps_its_bound_against_the_finest_models_and_a_hundredth_of_its_step(
    seed, monkeypatch
):
    scenario = random_scene(seed)
    dataset = converge(scenario, 10.0)
    tolerance = float(dataset.attrs["tolerance"])
    best, good = chosen(choices(dataset), tolerance)
    rows = {row.label: row for row in admitted_rows(scenario)[0]}
    labels = [str(name) for name in dataset["row"].to_numpy()[list(best.rows)]]
    parts = {
        rows[name].part: study.part_table(getattr(rows[name].scenario, rows[name].part))
        for name in labels[:-1]
    }
    finest = {
        row.part: study.part_table(getattr(row.scenario, row.part))
        for row in rows.values()
    }
    value, unit = labels[-1].split()[1:]
    step, runs = float(value) * {"s": 1.0, "ms": 1e-3, "µs": 1e-6}[unit], []
    for tables, length in ((parts, step), (finest, step / 100.0)):
        run = scenario.with_values(
            tables | {"clock": {"duration": 0.04, "step": length, "record": 4e-3}}
        )
        steps = range(0, run.clock.steps + 1, run.clock.stride)
        runs.append(study.compared(run, range(256 if run.is_random else 1), steps))
    off, deviation = study._errors(*runs)
    bound = np.fmax(best.error + best.noise, tolerance * good)
    assert np.all((off <= bound + 1e-6 + 5.0 * deviation)[:, :2]), (
        labels,
        off[:, :2],
        bound[:, :2],
    )
