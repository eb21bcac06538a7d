"""Events of a run: detachment, masking, loops and friction peaks."""

import json
import math

import numpy as np
import pytest
from helpers import lens
from helpers.lens import scene

from sim import analysis
from sim.ensemble.simulate import run
from sim.laws import jkr
from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.bonds.rupture import Bell
from sim.parts.contact import Equilibrium
from sim.parts.shear import models as shear
from sim.scenario.clock import Clock, Ensemble, Record

NAN = math.nan


@pytest.fixture(scope="module", name="ramp")
def _ramp():
    return lens.ramp()


def per_member(dataset, **values):
    """The dataset with these numbers per member and time, and no maxima of others."""
    dataset = dataset.drop_vars(["peak_stress", "peak_friction", "peak_time"])
    shape = (dataset.sizes["member"], dataset.sizes["t"])
    return dataset.assign({name: (("member", "t"), np.broadcast_to(v, shape)) for name, v in values.items()})


# -- detachment and masking ------------------------------------------------------------------------


def test_first_detachment_is_told_of_those_members_that_detached(ramp):
    """One of six opens twice, two once, three never."""
    times = np.full((6, 21), NAN)
    times[0, 4:], times[0, 9:] = 0.07, 0.18  # the last one so far is what is recorded
    times[1, 10:], times[2, 15:] = 0.19, 0.3
    result = analysis.statistics(per_member(ramp, detachment_time=times))
    np.testing.assert_allclose(result["ever_detached_mean"], 0.5, rtol=1e-14)
    np.testing.assert_allclose(result["ever_detached_sem"], math.sqrt(0.25 / 5.0), rtol=1e-13)
    np.testing.assert_allclose(result["first_detachment_mean"], (0.07 + 0.19 + 0.3) / 3.0, rtol=1e-13)
    deviation = np.std([0.07, 0.19, 0.3], ddof=1)
    np.testing.assert_allclose(result["first_detachment_sem"], deviation / math.sqrt(3.0), rtol=1e-13)
    np.testing.assert_allclose(result["first_detachment_quantile"], [0.082, 0.19, 0.289], rtol=1e-13)


def test_detachment_of_none_is_unknown_and_not_shown(ramp):
    result = analysis.statistics(ramp)
    assert float(result["ever_detached_mean"]) == 0.0 and math.isnan(result["first_detachment_mean"])
    assert not any("detached" in heading for row in analysis.highlights(ramp) for heading in row)


def test_time_masked_is_the_share_of_the_records_after_the_first(ramp):
    masked = np.zeros((6, 21))
    masked[:, 0] = 1.0  # no time has passed
    masked[1, 11:] = 1.0
    result = analysis.events(per_member(ramp, masked=masked, in_contact=1))["time_masked"]
    np.testing.assert_allclose(result, [0.0, 0.5, 0.0, 0.0, 0.0, 0.0], rtol=1e-14)
    area = ramp["contact_area"].copy()
    area[1, 16:] = NAN
    scenario = json.loads(ramp.attrs["scenario_resolved"])
    scenario["contact"]["after_pull_off"] = "stop"
    stopped = per_member(ramp, masked=masked, in_contact=1).assign(contact_area=area)
    result = analysis.events(stopped.assign_attrs(scenario_resolved=json.dumps(scenario)))["time_masked"]
    np.testing.assert_allclose(result[1], 5.0 / 15.0, rtol=1e-14)


def test_the_first_masking_is_told_of_those_members_that_were_masked(ramp):
    masked = np.zeros((6, 21))
    masked[1, 11:], masked[2, 4], masked[2, 7:] = 1.0, 1.0, 1.0
    dataset, t = per_member(ramp, masked=masked, in_contact=1), ramp["t"].to_numpy()
    np.testing.assert_array_equal(analysis.events(dataset)["first_masked"], [NAN, t[11], t[4], NAN, NAN, NAN])
    (row,) = analysis.highlights(dataset)
    assert row["first\nmasked (ms)"] == "200(500)" and "half\nmasked (ms)" not in row
    masked[3:, 9] = 1.0
    (row,) = analysis.highlights(per_member(ramp, masked=masked, in_contact=1))
    assert row["half\nmasked (ms)"] == "180"


def test_times_of_a_pulled_ensemble_are_within_its_run():
    """Fluctuations open a lifted contact at random times; the file and the statistics agree."""
    lifted = Equilibrium(indentation=-0.4e-6)
    dataset = run(scene(contact=lifted, drive=drive.Steady(speed=3e-3), ensemble=Ensemble(members=24)))
    result, opened = analysis.statistics(dataset), dataset["in_contact"] == 0
    np.testing.assert_allclose(result["ever_detached_mean"], float(opened.any("t").mean()), rtol=1e-14)
    first = dataset["t"].to_numpy()[opened.argmax("t")][opened.any("t").to_numpy()]
    np.testing.assert_allclose(result["first_detachment_mean"], first.mean(), rtol=1e-12)
    assert 2 <= len(first) < 24
    (row,) = analysis.highlights(dataset)
    share = 100.0 * len(first) / 24.0
    assert row["detached,\nof members (%)"].startswith(f"{share:.0f}(") and "5 to 95 %\nof members (ms)" in row


# -- loops -----------------------------------------------------------------------------------------


def cycled(cycles=2, steps=400, **held):
    kind = next(iter(held))
    at_rest = {"drive": drive.Steady(speed=0.0), "bonds": bonds.Unbroken(), "shear": shear.Uniform()}
    course = {kind: {**held[kind], "cycles": cycles}} | {name: value for name, value in held.items() if name != kind}
    part = Equilibrium(**course, after_pull_off="reattach")
    return run(scene(contact=part, clock=Clock(duration=1.0, step=1.0 / steps), **at_rest))


def test_loop_of_a_circle_is_its_area():
    dataset = cycled(steps=800, indentation={"from": 1e-6, "to": 2e-6})
    angle = 2.0 * math.pi * 2.0 * dataset["t"]
    drawn = dataset.assign(normal_load=np.cos(angle), displacement=np.sin(angle))
    # a polygon of 400 corners
    result = analysis.loop_energy(drawn)["loop_energy"]
    np.testing.assert_allclose(result, 200.0 * math.sin(2.0 * math.pi / 400.0), rtol=1e-12)
    assert result["cycle"].to_numpy().tolist() == [1, 2] and result.attrs["units"] == "J"


@pytest.mark.parametrize(
    "held",
    [
        {"indentation": {"from": 2e-6, "to": -0.3e-6}},
        {"load": {"from": 4e-3, "to": -0.2e-3}},
        {"displacement": {"from": 3e-6, "to": -0.3e-6}, "stiffness": 2e3},
    ],
    ids=["indentation", "load", "displacement"],
)
def test_a_contact_that_never_opens_gives_all_back(held):
    dataset = cycled(**held)
    stored = np.trapezoid(dataset["normal_load"][:101], dataset["displacement"][:101])
    result = analysis.loop_energy(dataset)
    assert abs(stored) > 1e-12  # J, given back on the way up
    np.testing.assert_array_equal(result["loop_energy"], 0.0)
    np.testing.assert_array_equal(result["loop_dissipation"], 0.0)
    assert not any("cycle" in heading for row in analysis.highlights(dataset) for heading in row)


@pytest.mark.parametrize("held", [{"indentation": {"from": 1e-6, "to": -2e-6}},
                                  {"displacement": {"from": 1e-6, "to": -3e-6}, "stiffness": 500.0}],
                         ids=["indentation", "displacement"])  # fmt: skip
def test_the_loop_is_what_its_jumps_dissipate(held):
    """Up to the two jumps, each drawn over one record: half of their loads times the displacement of a record."""
    errors = []
    for steps in (600, 2400):
        dataset = cycled(steps=steps, **held)
        result = analysis.loop_energy(dataset)
        step = 2.0 * abs(held[next(iter(held))]["to"] - 1e-6) * 2 / steps
        most = 1.5 * 2 * np.abs(dataset["normal_load"].where(dataset["displacement"] < 0.2e-6)).max() * step
        lost = result["loop_dissipation"]
        assert float(lost.min()) > 10.0 * float(most) and bool((result["loop_energy"] > 0.0).all())
        assert bool((np.abs(result["loop_energy"] - lost) < most).all())
        errors.append(float(np.abs(result["loop_energy"] - lost).max()))
        np.testing.assert_allclose(lost.sum(), dataset["dissipated_energy"][-1], rtol=1e-12)
    assert errors[1] < 0.5 * errors[0]
    headings = set(analysis.highlights(dataset)[0])
    assert {heading.partition("\n")[0] for heading in headings} >= {"∮P dΔ,", "dissipated,", "detached,"}


def test_a_sphere_that_flies_off_has_no_loop():
    dataset = cycled(cycles=2, load={"from": 4e-3, "to": -1e-3})
    assert bool(analysis.loop_energy(dataset)["loop_energy"].isnull().all())


def test_a_stopped_trajectory_has_the_loops_before_its_end():
    dataset = cycled(cycles=4, indentation={"from": 2e-6, "to": 1e-6})
    stopped = dataset["contact_radius"].where(dataset["t"] < 0.6)
    result = analysis.loop_energy(dataset.assign(contact_radius=stopped))
    assert result["loop_energy"].isnull().to_numpy().tolist() == [False, False, True, True]


def test_loops_of_a_swept_course_are_those_of_its_points():
    course = Equilibrium(indentation={"from": 1e-6, "to": -2e-6, "cycles": 1}, after_pull_off="reattach")
    sweep = {"contact.indentation.cycles": [1, 2], "adhesion.work": [2e-2, 4e-2]}
    swept = scene(contact=course, sweep=sweep, bonds=bonds.Unbroken(), shear=shear.Uniform())
    together = analysis.loop_energy(run(swept))
    for k, point in enumerate(swept.points()):
        alone, where = analysis.loop_energy(run(point)), divmod(k, 2)
        for name in alone:
            values = together[name].isel(contact_indentation_cycles=where[0], adhesion_work=where[1])
            np.testing.assert_array_equal(values[: alone.sizes["cycle"]], alone[name])
            assert bool(values[alone.sizes["cycle"] :].isnull().all())


def test_loops_of_statistics_alone_are_the_members_mean():
    held = {"contact": Equilibrium(indentation={"from": 2e-6, "to": 0.5e-6, "cycles": 2})}
    few, members = run(scene(record=Record(per_member=False), **held)), run(scene(**held))
    result = analysis.statistics(few)["loop_energy_mean"]
    # the loop is a small difference of what is put in and given back
    stored = float(np.abs(members["normal_load"]).max() * np.ptp(members["displacement"].to_numpy()))
    expected = analysis.loop_energy(members)["loop_energy"].mean()
    np.testing.assert_allclose(result, expected, rtol=1e-12, atol=1e-13 * stored)


def test_without_trips_there_is_no_loop(ramp):
    with pytest.raises(ValueError, match="cycles = 2"):
        analysis.loop_energy(ramp)
    assert "loop_energy_mean" not in analysis.statistics(ramp)


# -- friction peaks --------------------------------------------------------------------------------


def test_friction_maximum_of_a_ramp_has_its_speed(ramp):
    heights = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])[:, None]
    shape = 1e5 * (1.0 - (np.arange(21) - 12.0) ** 2 / 400.0)
    result = analysis.statistics(per_member(ramp, shear_stress=heights * shape, friction_force=-heights * shape))
    np.testing.assert_allclose(result["peak_stress_mean"], 3.5e5, rtol=1e-14)
    np.testing.assert_allclose(result["peak_stress_sem"], 1e5 * math.sqrt(3.5 / 6.0), rtol=1e-13)
    np.testing.assert_allclose(result["peak_friction_mean"], 3.5e5, rtol=1e-14)  # its size: sliding back it is negative
    for name in ("peak_speed_mean", "peak_friction_speed_mean"):
        np.testing.assert_allclose(result[name], ramp["speed"][12], rtol=1e-14)
    np.testing.assert_allclose(result["peak_time_mean"], ramp["t"][12], rtol=1e-14)


@pytest.mark.parametrize("shape", ["level", "rising", "falling", "rounding"])
def test_a_ramp_without_a_maximum_inside_has_no_peak(ramp, shape):
    n = np.arange(21.0)
    shape = {"level": 0 * n + 1, "rising": n, "falling": n[::-1], "rounding": 1 + 1e-14 * np.sin(n)}[shape]
    result = analysis.events(per_member(ramp, shear_stress=shape, friction_force=shape))
    assert all(bool(result[name].isnull().all()) for name in result if str(name).startswith("peak"))


def test_noise_makes_no_maximum(ramp):
    noise = np.random.default_rng(3).normal(1e5, 1e3, size=(6, 21))
    result = analysis.events(per_member(ramp, shear_stress=noise))
    assert bool(result["peak_stress"].isnull().all())
    hump = noise + 1e5 * np.exp(-((np.arange(21) - 12.0) ** 2) / 8.0)
    assert bool(analysis.events(per_member(ramp, shear_stress=hump))["peak_stress"].notnull().all())


@pytest.fixture(scope="module")
def started():
    """Bonds that are stretched together after a rest of a tenth of a second; the rest is swept."""
    stretched = bonds.Cohort(
        rupture=Bell(zero_force_rate=5.0, bell_force=4e-12), bond_stiffness=4e-4, rebinding_rate=5.0, site_density=9e16,
        start_from="empty", tolerance=1e-3,
    )  # fmt: skip
    part = drive.Start(rest=0.1, speed=5e-6)
    return run(scene(drive=part, bonds=stretched, shear=shear.Uniform(), clock=Clock(duration=0.5, step=2e-3),
                     sweep={"drive.rest": [0.1, 0.2]}))  # fmt: skip


def test_static_peak_is_timed_from_the_start_of_sliding(started):
    result = analysis.events(started)
    for k, rest in enumerate((0.1, 0.2)):
        stress, t = started["shear_stress"][k].to_numpy(), started["t"].to_numpy()
        at = int(np.argmax(stress))
        assert stress[at] > 1.5 * stress[-1] and t[at] > rest
        # between two records it is higher, but below the lines through its neighbours: it is concave there
        assert stress[at] <= float(result["peak_stress"][k]) < 2.0 * stress[at] - min(stress[at - 1], stress[at + 1])
        assert abs(float(result["peak_time"][k]) - (t[at] - rest)) < 2e-3
    assert float(result["peak_stress"][1]) > float(result["peak_stress"][0])  # more bonds after a longer rest
    rows = analysis.highlights(started)
    assert [row["drive_rest\n(ms)"] for row in rows] == ["100", "200"]
    assert {"peak of\nstress (kPa)", "peak of\nfriction (mN)", "after\n(ms)"} < set(rows[0])
    assert not any(heading.startswith("at V") for heading in rows[0])


def test_the_static_peak_is_found_among_steps_not_records():
    """With a record in fifty steps it is that of every step; between steps a cubic."""
    rupture = Bell(zero_force_rate=5.0, bell_force=4e-12)
    stretched = bonds.Cohort(rupture=rupture, bond_stiffness=4e-4, rebinding_rate=5.0, site_density=9e16)

    def peak(step, record):
        clock = Clock(duration=0.5, step=step, record=record)
        dataset = run(
            scene(drive=drive.Start(rest=0.1, speed=5e-6), bonds=stretched, shear=shear.Uniform(), clock=clock)
        )
        return float(dataset["peak_stress"]), float(dataset["peak_time"])

    assert peak(2e-3, 2e-3) == peak(2e-3, 0.1)
    coarse, half, fine = (peak(step, 0.1)[0] for step in (2.5e-3, 1.25e-3, 2.5e-4))
    assert max(abs(coarse / fine - 1.0), abs(half / fine - 1.0)) < 1e-4  # the cohorts' tolerance


def test_the_lowest_load_of_a_retraction_is_that_of_pull_off():
    contact = Equilibrium(displacement={"from": 1e-6, "to": -3e-5}, stiffness=50.0)
    dataset = run(scene(contact=contact, drive=drive.Steady(), clock=Clock(duration=1.0, step=1e-3, record=0.1)))
    exact = float(jkr.pull_off_load(float(dataset["adhesion_work"]), float(dataset["sphere_radius"])))
    assert not dataset["in_contact"].isel(t=-1).any()
    np.testing.assert_allclose(dataset["pull_off_load"], exact, rtol=2e-3)


def test_a_start_may_peak_at_once():
    """Bonds without a stretch bear most at the first slip: the first record after it, two lives of the transient on."""
    part = drive.Start(rest=0.1, speed=1e-2)
    dataset = run(
        scene(drive=part, bonds=bonds.Rate(critical_speed=1e-2, rebinding_rate=50.0, stress=3e5), shear=shear.Uniform())
    )
    result = analysis.events(dataset)
    np.testing.assert_allclose(result["peak_stress"], 3e5 * (0.5 + 0.5 * np.exp(-2.0)), rtol=1e-12)
    np.testing.assert_allclose(result["peak_time"], 0.02, rtol=1e-12)


def test_peaks_of_statistics_alone_are_those_of_the_mean():
    stretched = bonds.Tracked(
        rupture=Bell(zero_force_rate=5.0, bell_force=4e-12), bond_stiffness=4e-4, rebinding_rate=5.0, site_density=9e16,
        sites=200,
    )  # fmt: skip
    parts = {"bonds": stretched, "shear": shear.Uniform(), "drive": drive.Start(rest=0.1, speed=5e-6)}
    few, members = run(scene(record=Record(per_member=False), **parts)), run(scene(**parts))
    result, mean = analysis.statistics(few), members["shear_stress"].mean("member")
    np.testing.assert_allclose(result["peak_stress_mean"], mean.max(), rtol=1e-12)
    at = int(np.argmax(mean.to_numpy()))
    error = members["shear_stress"][:, at].std(ddof=1) / math.sqrt(6.0)
    np.testing.assert_allclose(result["peak_stress_sem"], error, rtol=1e-10)
    np.testing.assert_allclose(result["peak_time_mean"], members["t"][at] - 0.1, rtol=1e-12)


def test_other_drives_have_no_peak():
    dataset = run(scene(drive=drive.Steady(speed=1e-3)))
    assert not any(str(name).startswith("peak") for name in analysis.events(dataset))
