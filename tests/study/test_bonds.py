"""``sim converge`` for bonds: depths against closed forms, noise against that of independent sites, what is said."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers.scenes import BELL, CUT_OFF, STRETCHED, scene
from numpy.testing import assert_allclose

import sim.study.bond_models as march_module
import sim.study.bonds as converge_bonds_module
from sim.laws.schallamach import bell_stress, first_moment_stress
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell, Constant
from sim.parts.drive import prescribed as drive
from sim.scenario.clock import Clock
from sim.study.bond_models import REFERENCE, Course, bond_rows
from sim.study.bond_verdicts import bond_advice, bond_table
from sim.study.bonds import converge_bonds, has_bond_depths
from sim.study.converge import converge, figure

COHORT = bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=3e-3)
STEADY = {"bonds": COHORT, "drive": drive.Steady(speed=5e-3), "clock": Clock(duration=0.05, step=1e-3)}
COUNTED = {
    "bonds": bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=40, stress=2e5, start_from="empty"),
    "drive": drive.Ramp(start=1e-3, stop=5e-2),
    "clock": Clock(duration=0.05, step=1e-3),
}


@pytest.fixture(autouse=True)
def few_sites(monkeypatch):
    monkeypatch.setattr(march_module, "SITES", (100, 1000))


@pytest.fixture(scope="module")
def steady():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(march_module, "SITES", (100, 1000))
        return converge_bonds(scene(**STEADY), 1000.0)


@pytest.fixture(scope="module")
def counted():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(march_module, "SITES", (100, 1000))
        return converge_bonds(scene(**COUNTED), 1000.0)


def of(dataset, label, name="error"):
    return dataset[f"bonds_{name}"].sel(bond_row=label).to_numpy()


def test_depths_are_those_that_the_bonds_admit_and_the_own_one_is_marked():
    rows = bond_rows(scene(**STEADY))
    assert [row.label for row in rows if row.own] == ["cohort 0.003"]
    assert [row.part.model for row in rows] == ["rate"] + 6 * ["cohort"] + 2 * ["tracked"]
    rows = bond_rows(scene(**COUNTED))
    assert [row.label for row in rows if row.own] == ["counted 40"]
    assert [row.part.model for row in rows] == ["steady", "rate"] + 3 * ["counted"] + ["rate"]
    assert rows[-1].finer == 2  # a ramp has a clock step to judge, a steady drive none
    assert not has_bond_depths(scene(bonds=bonds.Rate(critical_speed=1e-2, rebinding_rate=500.0)))


def test_the_reference_of_steady_sliding_is_the_closed_form(steady):
    exact = bell_stress(
        5e-3, 200.0, 4e-12, *(STRETCHED[k] for k in ("bond_stiffness", "rebinding_rate", "site_density"))
    )
    assert_allclose(steady["bonds_shear_stress_reference"], exact, rtol=1e-12, atol=0)
    assert "closed form" in steady.attrs["bonds_reference"]


@pytest.mark.parametrize("tolerance", [1e-2, 3e-3, 1e-3, 1e-4, 1e-5, REFERENCE])
def test_cohorts_keep_their_tolerance(steady, tolerance):
    assert np.all(np.abs(of(steady, f"cohort {tolerance:g}")) <= tolerance)


def test_the_error_of_the_mean_field_is_that_of_its_closed_form(steady):
    law = [STRETCHED[k] for k in ("bond_stiffness", "rebinding_rate", "site_density")]
    expected = first_moment_stress(5e-3, 200.0, 4e-12, *law) / bell_stress(5e-3, 200.0, 4e-12, *law) - 1.0
    assert_allclose(of(steady, "rate")[0], expected, rtol=1e-8)
    assert np.isnan(of(steady, "rate")[2])  # it knows no square


@pytest.mark.parametrize(
    ("name", "labels"), [("steady", ("tracked 100", "tracked 1,000")), ("counted", ("counted 40",))]
)
def test_the_noise_of_a_member_is_that_of_independent_sites(name, labels, request):
    dataset = request.getfixturevalue(name)
    for label in labels:
        members = int(of(dataset, label, "members"))
        noise, expected = of(dataset, label, "noise")[:2], of(dataset, label, "expected_noise")[:2]
        assert np.all(np.abs(noise / expected - 1.0) < 5.0 / math.sqrt(2.0 * (members - 1)))
        assert np.all(of(dataset, label, "score")[:2] < 5.0)
        assert np.all(of(dataset, label, "standard_error")[:2] > 0.0)


def test_a_depth_of_another_law_is_found_out(monkeypatch):
    scenario, rows = scene(**STEADY), bond_rows(scene(**STEADY))
    stiffer = bonds.Tracked(rupture=Bell(zero_force_rate=200.0, bell_force=4.4e-12), **STRETCHED, sites=1000)
    rows[-1].part = stiffer
    monkeypatch.setattr(converge_bonds_module, "bond_rows", lambda _: rows[-3:-1] + rows[-1:])
    monkeypatch.setattr(march_module, "_FEWEST", 64)
    verdicts = {line["bonds"]: line["verdict"] for line in bond_table(converge_bonds(scenario, 1000.0))}
    assert verdicts["tracked 1,000"] == "NOT NOISE ALONE"
    assert verdicts["tracked 100"] == "noise alone"


def test_the_linear_rate_equation_is_exact_and_the_steady_law_late(counted):
    assert np.all(of(counted, "rate")[:2] == 0.0)
    # the run begins without a bond, where the steady law has 1/(1 + V/Vc) of them already
    assert_allclose(of(counted, "steady")[1] * counted["bonds_bond_fraction_reference"].max(), 1.0 / 1.1, rtol=1e-12)
    table = {line["bonds"]: line["verdict"] for line in bond_table(counted)}
    assert table["rate"] == "exact"
    assert table["rate, half steps"] == "what the step costs"
    assert table["counted 40 *"] == "noise alone"


def test_what_the_step_costs_is_of_second_order():
    errors = []
    for step in (5e-4, 2.5e-4):
        parts = COUNTED | {"clock": Clock(duration=0.05, step=step, record=0.01)}
        rows = bond_rows(scene(**parts))
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(converge_bonds_module, "bond_rows", lambda _, rows=rows: [rows[1], rows[-1]])
            errors.append(of(converge_bonds(scene(**parts), 10.0), "rate, half steps")[1])
    assert_allclose(errors[0] / errors[1], 4.0, rtol=0.05)


def test_a_constant_rupture_is_judged_by_the_rate_equation():
    parts = STEADY | {
        "bonds": bonds.Cohort(rupture=Constant(rate=200.0), **STRETCHED, start_from="empty"),
        "drive": drive.Start(rest=0.01, speed=5e-3),
    }
    found = converge_bonds(scene(**parts), 100.0)
    assert "exact for a constant rupture" in found.attrs["bonds_reference"]
    assert np.all(np.abs(of(found, f"cohort {REFERENCE:g}")[:2]) < REFERENCE)


@pytest.mark.parametrize("speed", [0.0, 5e-3])
def test_bonds_with_a_cut_off_and_a_contact_at_rest_are_no_trouble(speed):
    parts = STEADY | {"bonds": bonds.FirstMoment(rupture=CUT_OFF, **STRETCHED), "drive": drive.Steady(speed=speed)}
    found = converge_bonds(scene(**parts), 100.0)
    assert abs(of(found, f"cohort {REFERENCE:g}")[1]) < 1e-5
    assert np.isnan(of(found, "rate")[0]) == (speed == 0.0)  # no stress to compare with
    assert bond_advice(found)


def test_long_runs_are_taken_in_longer_steps_which_is_said():
    parts = STEADY | {"clock": Clock(duration=12.0, step=1e-3, record=6e-3)}
    course = Course.of(scene(**parts))
    assert (course.taken, course.steps, course.every) == (3, 4000, 2)
    assert_allclose(course.times, Clock(duration=12.0, step=1e-3, record=6e-3).times, rtol=1e-14)
    prime = Course.of(scene(**STEADY | {"clock": Clock(duration=10.007, step=1e-3)}))
    assert (prime.taken, prime.steps) == (3, 3335)
    comment = converge_bonds_module._comment(prime.scenario, prime, 3e-3)
    assert "3 clock steps are taken at once, as steps of 3 ms; the run ends at 10" in comment


def test_what_no_budget_reaches_is_told_without_errors():
    found = converge_bonds(scene(**STEADY), 1e-9)
    assert np.all(found["bonds_members"] == 0)
    assert np.all(np.isnan(found["bonds_error"]))
    assert {line["verdict"] for line in bond_table(found)} == {"over budget"}
    assert "no depth" in bond_advice(found)


def test_the_cheapest_depth_within_the_tolerance_is_suggested(steady):
    dataset = steady.copy(deep=True)
    dataset["bonds_cpu_time"][:] = np.arange(1.0, 1.0 + dataset.sizes["bond_row"])
    assert "“cohort 0.01” is the cheapest depth that keeps 1 %" in bond_advice(dataset)
    assert bond_advice(dataset).endswith('[bonds]\nmodel = "cohort"\ntolerance = 0.01')
    dataset.attrs["bonds_tolerance_asked"] = 0.9
    assert "“rate”" in bond_advice(dataset)
    dataset.attrs["bonds_tolerance_asked"] = 1e-9
    assert "no depth keeps" in bond_advice(dataset)


def test_few_sites_are_to_be_followed(counted):
    said = bond_advice(counted)
    assert "40 sites of the contact fluctuate by 16 %" in said
    assert said.endswith('[bonds]\nmodel = "counted"\nsites = 40')


def test_the_whole_comparison_holds_both_and_survives_netcdf(tmp_path):
    found = converge(scene(**COUNTED), 0.5)
    found.to_netcdf(tmp_path / "c.nc")
    with xr.open_dataset(tmp_path / "c.nc") as again:
        assert again["bonds_error"].dims == ("bond_row", "bond_quantity")
        assert again["error"].dims == ("row", "t", "quantity", "statistic")
        assert all("long_name" in again[name].attrs for name in again.variables)
        assert [line["bonds"] for line in bond_table(again)] == [line["bonds"] for line in bond_table(found)]
    figure(found).savefig(tmp_path / "c.png")
    assert (tmp_path / "c.png").stat().st_size > 10_000
