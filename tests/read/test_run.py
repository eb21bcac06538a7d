"""The object that reads a run: facts found once, statistics of one quantity, and the columns of tables."""

import math

import numpy as np
import pytest
import scipy
from helpers.lens import scene
from helpers.parts import Ensemble, Equilibrium, bonds, drive, read, run, shear
from numpy.testing import assert_allclose, assert_array_equal

import sim


def test_a_statistic_has_the_moments_quantiles_and_students_interval_of_the_members(
    ramp,
):
    values = ramp["contact_radius"].isel(t=12).to_numpy()
    found = sim.Run(ramp).statistic("contact_radius").isel(t=12)
    count = len(values)
    error = values.std(ddof=1) / math.sqrt(count)
    half = scipy.stats.t.ppf(0.975, count - 1) * error
    expected = {
        "mean": values.mean(),
        "standard error": error,
        "low": values.mean() - half,
        "high": values.mean() + half,
        "standard deviation": values.std(ddof=1),
        "50 %": np.median(values),
        "skewness": scipy.stats.skew(values),
        "number": count,
    }
    for kind, value in expected.items():
        assert_allclose(found.sel(statistic=kind), value, rtol=1e-11, err_msg=kind)
    # the interval of an extreme quantile needs more than six members
    assert np.isnan(found.sel(statistic="5 % low"))
    assert found.attrs["units"] == "m" and found.attrs["over"] == "6 members"


def test_a_statistic_over_time_needs_a_stationary_run_and_has_its_sample(ramp):
    steady = sim.Run(run(scene(drive=drive.Steady(speed=4e-3))))
    late = steady.statistic("fluctuation_energy", late=True)
    second = steady.dataset["fluctuation_energy"].isel(t=slice(10, None))
    assert_allclose(late.sel(statistic="mean"), second.mean(), rtol=1e-12)
    assert_allclose(
        late.sel(statistic="skewness"),
        scipy.stats.skew(second.to_numpy().ravel()),
        rtol=1e-9,
    )
    assert late.attrs["over"] == "second half of the run and 6 members"
    of_time = read.distribution(steady.dataset, ["fluctuation_energy"])
    free = of_time["fluctuation_energy"].number
    assert_array_equal(late.sel(statistic="number"), free)
    with pytest.raises(sim.BadInput, match="contact_radius: speed or mount changes"):
        sim.Run(ramp).statistic("contact_radius", late=True)


def test_a_statistic_of_an_event_has_no_time_and_an_unknown_one_is_named(ramp):
    found = sim.Run(ramp).statistic("time_masked")
    assert "t" not in found.dims and found.sel(statistic="mean") > 0.0
    with pytest.raises(sim.BadInput, match=r"pull_off: is not known.*contact_area"):
        sim.Run(ramp).statistic("pull_off")


def test_facts_of_a_run_are_those_of_its_scene(ramp):
    one = sim.Run(ramp)
    assert not one.is_steady and one.is_held and not one.is_stationary
    assert one.has_noise and one.has_members and one.sweep == () and one.points == 1
    assert one.drive == {"ramp"} and one.speed_name == "speed"
    loads = {"contact.load": ["1 mN", "4 mN"]}
    still = {"drive": drive.Steady(speed=1e-3), "shear": shear.Uniform()}
    two = sim.Run(run(scene(**still, sweep=loads)))
    assert two.is_stationary and not two.has_noise and two.has_one_row_each
    assert two.sweep == ("contact_load",) and two.sample(late=False) == ""


def test_a_frame_has_the_columns_of_the_tables_in_si_and_errors_only_of_noise(ramp):
    one = sim.Run(ramp)
    frame = sim.stats(ramp)
    assert_array_equal(frame["t"], ramp["t"])
    area = one.statistic("area_ratio")
    # sums in another order differ in the last digit
    for column, kind in (("", "mean"), ("_error", "standard error")):
        values = area.sel(statistic=kind)
        assert_allclose(frame[f"area_ratio{column}"], values, rtol=1e-9, atol=1e-15)
    assert frame.attrs["units"]["friction_force"] == "N"
    # the same for all members
    assert "speed_error" not in frame and "bond_fraction_error" not in frame
    # of the whole run, so the same in all rows
    assert frame["time_masked"].nunique() == 1
    assert "lost_to_bonds" not in frame
    assert "lost_to_bonds" in sim.stats(ramp, show=["losses"])
    with pytest.raises(sim.BadInput, match="slides: is no group of columns"):
        sim.stats(ramp, show=["slides"])
    alone = run(scene(shear=shear.Uniform(), ensemble=Ensemble(members=3)))
    assert not [name for name in sim.stats(alone) if name.endswith("_error")]


@pytest.mark.parametrize("show", [(), ("losses",), ("slips",)])
def test_a_table_has_ten_columns_at_most(ramp, show):
    for table in read.tables_of(sim.Run(ramp), show=show):
        assert len(table.rows[0]) <= 10


def test_a_frame_has_the_speed_and_the_load_that_the_tables_print():
    """Single bonds slip without duration, and an open contact still has its load."""
    load = {"from": 4e-3, "to": -2e-3, "cycles": 1}
    dataset = run(
        scene(
            drive=drive.Spring(
                stage=1e-3, stiffness=100.0, damping=0.1, contact_stiffness="rigid"
            ),
            bonds=bonds.Counted(
                critical_speed=1e-2, rebinding_rate=500.0, stress=3e5, sites=40
            ),
            contact=Equilibrium(load=load, after_pull_off="stay_open"),
            shear=shear.Uniform(),
        )
    )
    frame, position = sim.stats(dataset), dataset["slider_position"].mean("member")
    moved = np.gradient(position, dataset["t"])
    assert_allclose(frame["speed"][1:], moved[1:], rtol=1e-9, atol=1e-12)
    assert_allclose(frame["normal_load"], dataset["applied_load"], rtol=1e-12)
    assert dataset["in_contact"].min() == 0.0
