"""``sim converge``: errors against closed forms and finer runs, the recommended combination, and refusals."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers.accuracy_scenes import BAND, ONSET, RATE, SPRING, accuracy_scene
from helpers.parts import Clock, Equilibrium, bonds, drive, shear
from helpers.scenes import BELL, BONDS, CELL, DRIVES, SHEARS, STRETCHED, scene
from numpy.testing import assert_allclose
from scipy import stats

import sim
from sim.laws.schallamach import bell_stress, first_moment_stress
from sim.parts.bonds.rupture import Bell
from sim.parts.shear.process import Slip
from sim.spectrum.families import SelfAffine
from sim.study.accuracy import students
from sim.study.converge import converge, explanation, figure, table
from sim.study.pilot import Pilots, difference, influences, of_some, shown
from sim.study.within import Comparison, Goal, NotReached

ROUGH = SelfAffine(rms=150e3, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=8e-6)
#: A jump of the speed and a reversal, under cohorts.
JUMP = {
    "bonds": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=1e-3),
    "drive": drive.Table(
        time=(0.0, 0.0123, 0.0123, 0.03, 0.04), speed=(1e-3, 1e-3, 6e-3, 6e-3, -1e-3)
    ),
}
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
#: A slider that slips three times.
SLIPS = accuracy_scene("spring") | {
    "bonds": RATE | {"stress": "0.5 MPa"},
    "drive": SPRING
    | {
        "stage": "1 mm/s",
        "stiffness": "60 N/m",
        "damping": "0.05 N s/m",
        "mass": "1 mg",
        "contact_stiffness": "rigid",
        "start": "rest",
    },
    "clock": {"duration": "2 s", "step": "1 ms", "record": "4 ms"},
}


def error(dataset, row, name):
    return float(dataset["error"].sel(row=row, name=name))


def test_a_statistic_is_the_mean_of_its_influences_and_has_its_standard_error():
    """Of normal numbers a spread has the relative standard error 1/√(2n), and a skewness √(6/n)."""
    rng, members = np.random.default_rng(3), 400
    values = 5.0 + 2.0 * rng.standard_normal((members, 4000))
    for statistic, sem in (("spread", 2.0 / 2.0**0.5), ("skewness", 6.0**0.5)):
        each = influences(values, statistic)
        spread = np.std(each.mean(axis=0)) * members**0.5
        # a standard deviation of 4000 numbers is known to 1/√8000, and the order of the next term is 1/members
        assert_allclose(spread, sem, rtol=5.0 / 8000.0**0.5 + 4.0 / members)
        assert_allclose(np.mean(each.std(axis=0)), sem, rtol=0.05)
    assert np.all(influences(np.ones((5, 2)), "spread") == 0.0)


def test_the_error_of_rates_is_its_closed_form_and_the_cheapest_within_is_chosen():
    parts = {
        "bonds": bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=3e-3),
        "drive": drive.Steady(speed=5e-3),
    }
    scenario = scene(**parts, clock=Clock(duration=0.05, step=1e-3))
    dataset = converge(scenario, 20.0, 0.01, ("shear_stress",))
    law = [
        STRETCHED[key] for key in ("bond_stiffness", "rebinding_rate", "site_density")
    ]
    exact = bell_stress(5e-3, 200.0, 4e-12, *law)
    expected = abs(first_moment_stress(5e-3, 200.0, 4e-12, *law) / exact - 1.0)
    assert_allclose(error(dataset, "rate", "shear_stress"), expected, rtol=3e-3)
    # cohorts of any tolerance have the same counted work, so that of the scene stays
    assert expected > 0.01 and "as written" in dataset.attrs["recommendation"]
    accepted = 1.1 * expected
    dataset = converge(scenario, 20.0, accepted, ("shear_stress",))
    assert "is: bonds rate" in dataset.attrs["recommendation"]
    for tolerance in (0.01, 0.003, 0.001, 0.0001, 1e-05):
        assert error(dataset, f"cohort {tolerance}", "shear_stress") <= tolerance


def test_the_spread_of_counted_sites_is_missed_by_rates_as_the_binomial_law_says():
    parts = {"bonds": BONDS["counted"], "drive": drive.Steady(speed=2e-3)}
    scenario = scene(**parts, steps=40, members=640)
    search = Comparison(scenario, Goal(0.01, ("bond_fraction:spread",)), 2048)
    share = float(BONDS["counted"].steady(np.array([2e-3])).fraction[0])
    expected = math.sqrt((1.0 - share) / (share * BONDS["counted"].sites))
    rows = {row.label: row.error[:, 0] for row in search.groups[0]}
    # a spread of n members is known to 1/√(2n); the bound adds its noise
    noise = 5.0 * expected / 4096.0**0.5
    assert abs(rows["rate"][0] - rows["rate"][1] - expected) < noise
    assert rows["counted 40"][0] == 0.0


@pytest.mark.parametrize(
    ("parts", "duration", "step"), [(JUMP, 0.04, 4e-3), (STEEP, 0.6, 0.02)]
)
def test_the_error_of_a_long_step_is_bounded_and_no_more_than_twice_as_large(
    parts, duration, step
):
    def of(length):
        clock = Clock(duration=duration, step=length, record=step)
        return scene(**parts, clock=clock)

    dataset = converge(of(step), 20.0, 0.01, ("friction_force",))
    runs = [sim.run(of(length))["friction_force"] for length in (step, step / 256)]
    off = float(abs(runs[0] - runs[1]).max() / abs(runs[1]).max())
    (own,) = dataset["row"].values[(dataset["part"] == "clock") & (dataset["own"] == 1)]
    promised = error(dataset, own, "friction_force")
    assert off <= promised <= 2.0 * off and off > 1e-3


def test_the_error_of_the_recommended_combination_is_measured_and_not_added_up():
    """It is that of two runs, of the combination and of the finest one, and the rest of the series of clock steps."""
    scenario = scene(**JUMP, clock=Clock(duration=0.04, step=1e-3, record=4e-3))
    search = Comparison(scenario, Goal(0.56, ("friction_force",)), 32)
    best, finest = search.best(), search.finest
    assert best.labels == ("bonds rate", "clock step 4 ms")
    added = next(row for row in search.choices() if row.rows == best.rows)
    runs = [sim.run(search.scene_of(row))["friction_force"] for row in (best, finest)]
    unit = float(search.written.unit.max())
    off = float(abs(runs[0] - runs[1]).max()) / unit
    assert_allclose(best.systematic, off + finest.systematic, rtol=1e-9)
    assert best.total < 0.8 * added.total


def test_all_that_the_scenes_table_shows_is_compared_slips_and_area_included():
    search = Comparison(sim.load(SLIPS), Goal(0.02, (), 30.0, shown), 32)
    names = {*search.names}
    assert {"area_ratio", "contact_radius", "friction_force"} <= names
    assert {"slip_count", "force_drop", "static_friction"} <= names
    (coarse, *_, finest), at = search.groups[-1], search.names.index("force_drop")
    unit, *drops = (
        float(sim.Run(sim.run(each)).events["force_drop"].value)
        for each in (search.scene, *map(search._scene_of, (coarse, finest)))
    )
    expected = abs(drops[0] - drops[1]) / unit + finest.error[0, at]
    assert_allclose(coarse.error[0, at], expected, rtol=1e-9)
    assert abs(drops[0] - drops[1]) > 1e-3 * unit


def test_the_area_and_the_share_of_masked_members_are_compared_and_skewness_only_if_asked():
    wide = {"shear": ONSET | {"spectrum": BAND | {"rms": "170 kPa"}}}
    scenario = sim.load(accuracy_scene("an onset") | wide)
    names = {*Comparison(scenario, Goal(0.05, (), 5.0, shown), 32).names}
    assert {"area_ratio", "fraction_masked", "contact_radius:spread"} <= names
    assert not any("skewness" in name for name in names)
    dataset = converge(
        scenario,
        5.0,
        0.05,
        ("fluctuation_energy:skewness", "fluctuation_energy:spread"),
    )
    gammas = scenario.process.gammas
    variance, third = (np.sum(gammas.shape * gammas.weight**n) for n in (2, 3))
    # without fluctuations both are lost; a spread of 32 members is known to 1/√64
    mean = np.sum(gammas.shape * gammas.weight)
    spread = error(dataset, "mean", "fluctuation_energy:spread")
    assert_allclose(spread, variance**0.5 / mean, rtol=5.0 / 64.0**0.5)
    skewness = error(dataset, "mean", "fluctuation_energy:skewness")
    assert skewness > 0.5 * 2.0 * third / variance**1.5
    fine = error(dataset, "banded 0.003", "fluctuation_energy:skewness")
    assert fine < 0.01 * skewness


@pytest.mark.parametrize(
    ("sizes", "is_shown"),
    [
        ((0.004, 0.0011), True),  # falls
        ((0.0017, 0.0024), False),  # grows, and is more than a tenth
        ((0.0007, 0.0009), True),  # grows, and is less than a tenth
        ((0.0024,), False),  # one change shows no fall
    ],
)
def test_a_last_change_of_a_tenth_of_the_accepted_error_needs_not_fall(sizes, is_shown):
    search = Comparison(
        scene(bonds=BONDS["rate"], drive=DRIVES["steady"]), Goal(0.01), 32
    )
    number = len(search.names)
    changes = [np.array([np.full(number, size), np.zeros(number)]) for size in sizes]
    assert (search._trend(changes) == "") == is_shown


def test_a_carried_area_that_fluctuates_is_not_shown_to_converge_and_its_twin_is():
    parts = {
        "shear": SHEARS["banded, slip, onset"],
        "drive": DRIVES["steady"],
        "clock": Clock(duration=0.02, step=1e-3, record=4e-3),
    }
    carried = scene(**parts, bonds=BONDS["rate, carried"], members=16)
    dataset = converge(carried, 0.5, 0.001, ("bond_fraction",))
    text = dataset.attrs["recommendation"]
    assert "No setting is recommended: convergence is not shown" in text
    assert "recommended" not in figure(dataset).axes[0].get_legend_handles_labels()[1]
    assert "recommended_work" not in dataset.attrs
    twin = scene(**parts, bonds=BONDS["rate"], members=16)
    twin = converge(twin, 0.5, 0.001, ("bond_fraction",))
    assert "the cheapest combination is" in twin.attrs["recommendation"]


def test_an_error_at_any_recorded_time_is_seen():
    """Contacts open between 0.8 and 0.9 of the run, and most are closed before or open afterwards."""
    scenario = scene(
        bonds=bonds.Unbroken(stress=3e5),
        drive=drive.Steady(speed=2e-3),
        contact=Equilibrium(load={"from": 1e-3, "to": -4e-4}),
        shear=shear.Banded(spectrum=ROUGH, cell=CELL, correlation=Slip(length=5e-6)),
        clock=Clock(duration=0.5, step=0.01),
        members=256,
    )
    search = Comparison(scenario, Goal(0.01, ("fraction_detached",), 6.0), 128)
    (own,) = (row for row in search.groups[-1] if row.is_own)
    finer = scenario.with_values(
        {"clock": {"duration": 0.5, "step": 0.01 / 16, "record": 0.01}}
    )
    runs = (sim.run(each) for each in (scenario, finer))
    shares = [dataset["in_contact"].mean("member").to_numpy() for dataset in runs]
    off = np.abs(shares[0] - shares[1])
    assert off.argmax() in range(41, 46) and off.max() > 0.1
    assert own.error[0, 0] > 0.5 * off.max()


def test_the_choice_is_the_same_on_a_machine_under_load_and_in_the_stored_dataset(
    tmp_path, monkeypatch
):
    scenario = sim.load(accuracy_scene("stretched bonds"))
    first = converge(scenario, 5.0)
    monkeypatch.setattr("time.process_time", lambda: 1e9)
    assert first.identical(converge(scenario, 5.0))
    first.to_netcdf(tmp_path / "out.nc")
    with xr.open_dataset(tmp_path / "out.nc") as read:
        assert table(read) == table(first) and explanation(read) == explanation(first)
        assert read.attrs["recommendation"] == first.attrs["recommendation"]
    (panel,) = figure(first).axes
    shown = np.concatenate([line.get_xdata() for line in panel.lines[:2]])
    assert_allclose(np.sort(shown), np.sort(first["work"]))


def test_a_budget_that_is_too_small_names_one_that_helps_and_what_does_not_fit_is_named():
    scenario = scene(**JUMP, clock=Clock(duration=0.04, step=1e-3))
    with pytest.raises(NotReached, match="--budget"):
        converge(scenario, 1e-6)
    work = Comparison(scenario, Goal(0.01), 32).pilots.needed(scenario)
    # the finest clock steps take 64 times the work of the scene's
    dataset = converge(scenario, 40.0 * work)
    assert f"{1e-3 / 256 * 1e6:.3g}" not in str(dataset["row"].values[-1])


@pytest.mark.parametrize(
    ("is_unresolved", "left_out"),
    [
        (lambda scenario: scenario.clock.step < 1e-3, "250 µs"),
        (lambda scenario: scenario.clock.step > 1e-3, "4 ms"),
        (lambda one: getattr(one.bonds, "tolerance", 1.0) < 1e-5, "cohort 1e-06"),
    ],
    ids=["finer step", "coarser step", "finer model"],
)
def test_a_setting_that_does_not_resolve_the_motion_is_left_out(
    is_unresolved, left_out, monkeypatch
):
    import sim.study.pilot as pilot

    whole = pilot.run

    def run(scenario):
        dataset = whole(scenario)
        if is_unresolved(scenario):
            dataset["unresolved_time"] = 0.0 * dataset["unresolved_time"].fillna(0.0)
        return dataset

    monkeypatch.setattr(pilot, "run", run)
    keys = {"clock.duration": "20 ms", "ensemble.members": 1}
    search = Comparison(sim.load(accuracy_scene("spring"), keys), Goal(0.05), 32)
    if left_out == "250 µs":  # then no error of the clock step is known
        with pytest.raises(NotReached):
            search.groups  # noqa: B018
        return
    labels = {row.label for group in search.groups for row in group}
    assert left_out not in labels and {"1 ms", "250 µs", "cohort 1e-05"} <= labels
    if left_out.startswith("cohort"):
        assert f"{left_out}: motion not resolved" in search.left_out
        assert search.lacks_finest


def test_a_name_that_is_not_known_is_refused():
    scenario = scene(bonds=BONDS["rate"], drive=DRIVES["steady"])
    for name in ("no_quantity", "contact_area:kurtosis"):
        with pytest.raises(sim.BadInput, match=rf"accuracy\.of: {name}"):
            converge(scenario, 1.0, of=(name,))


def test_a_number_of_some_members_is_compared_over_these_and_their_share_apart():
    """At a dead load each member that pulls off does so at this load; the clock step decides how many do."""
    scenario = {
        "clock": {"duration": "0.4 s", "step": "5 ms", "record": "20 ms"},
        "solid": {"youngs_modulus": "50 MPa"},
        "sphere": {"radius": "1 um"},
        "adhesion": {"work": "42 mJ/m^2"},
        "contact": {"model": "cohesive", "load": "-0.05 uN", "range": "1 nm"},
        "drive": {"speed": "0.3 mm/s"},
        "bonds": {"model": "steady", "stress": "0.1 MPa", "critical_speed": "1 mm/s"},
        "shear": {
            "model": "modal",
            "points": 32,
            "spectrum": {"model": "gaussian", "rms": "7 MPa", "length": "20 nm"},
            "correlation": {"model": "time", "time": "40 ms"},
        },
        "ensemble": {"members": 128},
    }
    names = "pull_off_load", "ever_detached"
    pilots = Pilots(128, names, shown, 1e3)
    coarse, fine = (
        pilots[sim.load(scenario, {"clock.step": step})] for step in ("5 ms", "1.25 ms")
    )
    shares = coarse.share[0, 0], fine.share[0, 0]
    assert_allclose(shares, [coarse.mean[1, 0], fine.mean[1, 0]], rtol=1e-12)
    assert 0.02 < shares[0] < shares[1] < 0.98
    load, share = difference(coarse, fine, fine.unit)[0]
    assert_allclose(fine.unit[0], 50e-9, rtol=1e-12)
    assert load == 0.0 and share > abs(shares[1] - shares[0]) > 0.0
    # nothing is compared with a mean of no members but their share
    none = fine._replace(mean=0.0 * fine.mean, share=0.0 * fine.share)
    none = none._replace(members=0.0 * none.members, sem=0.0 * none.sem)
    assert_allclose(difference(none, fine, fine.unit)[0, 0], shares[1], rtol=1e-9)


def test_the_noise_of_a_mean_over_some_members_is_that_of_student_for_these():
    values = np.random.default_rng(5).standard_normal((40, 1))
    values[7:] = np.nan
    influence, share = of_some(values, "")
    assert share == 7 / 40
    assert_allclose(influence.mean(), values[:7].mean(), rtol=1e-12)
    half = students(40) * influence.std(ddof=1) / 40**0.5
    few = stats.t.ppf(0.975, 6) * values[:7].std(ddof=1) / 7**0.5
    assert_allclose(half, few, rtol=1e-9)
    values[1:] = np.nan
    influence, share = of_some(values, "")
    assert not influence.any() and not share.any()
