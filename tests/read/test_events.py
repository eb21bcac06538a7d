"""Events of a run: detachment, masking, loops and friction peaks."""

import functools
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers.lens import FIELD, scene
from helpers.parts import (
    Band,
    Bell,
    Clock,
    Ensemble,
    Equilibrium,
    Time,
    bonds,
    drive,
    jkr,
    read,
    run,
    shear,
)
from helpers.printed import rows_of
from helpers.statements import statistics, values_of
from numpy.testing import assert_allclose, assert_array_equal
from scipy import interpolate
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import sim
from sim.laws.schallamach import bell_peak, start_up_peak
from sim.quantities import OPEN_THROUGHOUT, STAYS_CLOSED
from sim.read.events import of_events
from sim.read.peaks import ensemble_peaks, static_threshold
from sim.read.tables import key_figures, notes, tables_of
from sim.reports.report import answer
from tests.read.test_invariance import LENS, SCENES

#: Bonds that live for 14 ms at 2 mm/s.
AGED = """
solid = { shear_modulus = "1.6 MPa" }
sphere = { radius = "2 mm" }
adhesion = { work = "42 mJ/m^2" }
contact = { load = "4 mN" }
[bonds]
model = "rate"
start = "empty"
rupture = { model = "bell", zero_force_rate = "1 1/s", bell_force = "4 pN" }
bond_stiffness = "0.8 uN/m"
rebinding_rate = "5 1/s"
site_density = "6.5e16 1/m^2"
"""
NAN = math.nan


def per_member(dataset, **values):
    """The dataset with these numbers per member."""
    return dataset.assign(
        {name: dataset[name].copy(data=np.array(each)) for name, each in values.items()}
    )


def test_detached_and_masked_members_are_counted_and_the_time_of_half_is_bounded(ramp):
    # Three of six open, one of them twice: its first time counts.
    result = statistics(
        per_member(ramp, first_detachment=[0.07, 0.19, 0.3, NAN, NAN, NAN])
    )
    assert_allclose(result["ever_detached"].value, 0.5, rtol=1e-14)
    assert_allclose(result["ever_detached"].sem, math.sqrt(0.25 / 5.0), rtol=1e-13)
    result = statistics(ramp)
    assert float(result["ever_detached"].value) == 0.0
    assert "half_detached" not in result
    assert not any("_reading" in str(name) for name in result)
    assert not any(
        "detached" in heading
        for row in rows_of(ramp, read.highlights)
        for heading in row
    )
    lifted = Equilibrium(indentation=-0.4e-6)
    dataset = run(
        scene(
            contact=lifted,
            drive=drive.Steady(speed=3e-3),
            ensemble=Ensemble(members=24),
        )
    )
    result, opened = statistics(dataset), dataset["in_contact"] == 0
    assert_allclose(
        result["ever_detached"].value, float(opened.any("t").mean()), rtol=1e-14
    )
    first = dataset["t"].to_numpy()[opened.argmax("t")][opened.any("t").to_numpy()]
    assert_allclose(
        np.sort(dataset["first_detachment"])[: len(first)], np.sort(first), rtol=1e-12
    )
    assert 2 <= len(first) < 24
    (row,) = rows_of(dataset, read.highlights)
    assert row["detached, of members (%)"].startswith(
        f"{100.0 * len(first) / 24.0:.1f}("
    )
    at, masked = ramp["t"].to_numpy()[[11, 4]], [0.0, 0.5, 0.75, 0.0, 0.0, 0.0]
    (row,) = rows_of(
        per_member(ramp, time_masked=masked, first_masked=[NAN, *at, NAN, NAN, NAN]),
        read.highlights,
    )
    assert row["masked, of members (%)"].startswith("33")
    assert row["half masked (ms)"] == "> 80"
    (row,) = rows_of(
        per_member(
            ramp, time_masked=masked, first_masked=[NAN, *at, *[ramp["t"][9]] * 3]
        ),
        read.highlights,
    )
    assert row["half masked (ms)"] == "180 (> 80)"


def test_openings_closings_and_masking_are_those_of_all_clock_steps_however_seldom_is_recorded():
    clock, held = (
        Clock(duration=0.4, step=2e-3),
        Equilibrium(indentation=-0.4e-6, after_pull_off="reattach"),
    )
    moved = Equilibrium(
        load={"from": 4e-3, "to": -1e-3, "cycles": 2}, after_pull_off="reattach"
    )
    for part, count in ((held, 24), (moved, 6)):
        for policy in ("reattach", "stop"):
            contact = replace(part, after_pull_off=policy)
            parts = {
                "contact": contact,
                "drive": drive.Steady(speed=3e-3),
                "ensemble": Ensemble(members=count),
            }
            dense, seldom = (
                run(scene(clock=replace(clock, record=each), **parts))
                for each in (2e-3, 0.4)
            )
            names = [
                "first_detachment",
                "detachments",
                "first_closing",
                "jump_in_load",
                "first_masked",
                "time_masked",
            ]
            for name in names:
                assert_array_equal(seldom[name], dense[name])
            closed, t = dense["in_contact"].values == 1, dense["t"].values
            opens, closes = (
                closed[:, :-1] & ~closed[:, 1:],
                ~closed[:, :-1] & closed[:, 1:],
            )
            assert_array_equal(dense["detachments"], opens.sum(axis=1))
            for turns, name in ((opens, "first_detachment"), (closes, "first_closing")):
                first = np.where(turns.any(axis=1), t[1:][turns.argmax(axis=1)], NAN)
                assert_allclose(dense[name], first, rtol=1e-12)
            hidden = np.nansum(dense["masked"].values[:, 1:], axis=1)
            assert_allclose(
                dense["time_masked"], hidden / closed[:, 1:].sum(axis=1), rtol=1e-12
            )


def cycled(cycles=2, steps=400, **held):
    kind = next(iter(held))
    at_rest = {
        "drive": drive.Steady(speed=0.0),
        "bonds": bonds.Unbroken(),
        "shear": shear.Uniform(),
    }
    course = {kind: {**held[kind], "cycles": cycles}} | {
        name: value for name, value in held.items() if name != kind
    }
    part = Equilibrium(**course, after_pull_off="reattach")
    return run(
        scene(contact=part, clock=Clock(duration=1.0, step=1.0 / steps), **at_rest)
    )


def test_a_loop_is_what_its_jumps_dissipate_nothing_without_and_the_area_of_a_circle():
    dataset = cycled(steps=800, indentation={"from": 1e-6, "to": 2e-6})
    angle = 2.0 * math.pi * 2.0 * dataset["t"]
    drawn = dataset.assign(normal_load=np.cos(angle), displacement=np.sin(angle))
    # a polygon of 400 corners
    result = read.loop_energy(drawn)["loop_energy"]
    assert_allclose(result, 200.0 * math.sin(2.0 * math.pi / 400.0), rtol=1e-12)
    assert (
        result["cycle"].to_numpy().tolist() == [1, 2] and result.attrs["units"] == "J"
    )
    for held in [
        {"indentation": {"from": 2e-6, "to": -0.3e-6}},
        {"load": {"from": 4e-3, "to": -0.2e-3}},
        {"displacement": {"from": 3e-6, "to": -0.3e-6}, "stiffness": 2e3},
    ]:
        dataset = cycled(**held)
        stored = np.trapezoid(
            dataset["normal_load"][:101], dataset["displacement"][:101]
        )
        result = read.loop_energy(dataset)
        assert abs(stored) > 1e-12  # J, given back on the way up
        assert_array_equal(result["loop_energy"], 0.0)
        assert_array_equal(result["loop_dissipation"], 0.0)
        assert not any(
            "cycle" in heading
            for row in rows_of(dataset, read.highlights)
            for heading in row
        )
    for held in [
        {"indentation": {"from": 1e-6, "to": -2e-6}},
        {"displacement": {"from": 1e-6, "to": -3e-6}, "stiffness": 500.0},
    ]:
        errors = []
        for steps in (600, 2400):
            dataset = cycled(steps=steps, **held)
            result = read.loop_energy(dataset)
            step = 2.0 * abs(held[next(iter(held))]["to"] - 1e-6) * 2 / steps
            most = (
                1.5
                * 2
                * np.abs(
                    dataset["normal_load"].where(dataset["displacement"] < 0.2e-6)
                ).max()
                * step
            )
            lost = result["loop_dissipation"]
            assert float(lost.min()) > 10.0 * float(most) and bool(
                (result["loop_energy"] > 0.0).all()
            )
            assert bool((np.abs(result["loop_energy"] - lost) < most).all())
            errors.append(float(np.abs(result["loop_energy"] - lost).max()))
            assert_allclose(lost.sum(), dataset["dissipated_energy"][-1], rtol=1e-12)
        assert errors[1] < 0.5 * errors[0]
        headings = set(rows_of(dataset, read.highlights)[0])
        assert {heading.partition(" (")[0] for heading in headings} >= {
            "∫P dΔ, per cycle",
            "dissipated, per cycle",
            "detached, of members",
        }


def test_a_loop_has_a_bound_that_holds_its_error_by_the_records_or_a_reason():
    course = {"displacement": {"from": 1e-6, "to": -3e-6}, "stiffness": 500.0}
    # what one of 2400 records adds is below all bounds
    exact = read.loop_energy(cycled(steps=2400, **course))["loop_energy"].mean()
    stated = {}
    for steps in (24, 34, 50, 98, 200):
        loop = statistics(cycled(steps=steps, **course))
        value, bound = loop["loop_energy"].value, loop["loop_energy"].bound
        stated[steps] = float(bound)
        if steps > 32:
            assert abs(value - exact) <= bound and loop["loop_energy"].reason == ""
    assert math.isnan(stated[24])
    assert loop["loop_energy"].bound.attrs["source"] == "records"
    assert stated[200] < 0.5 * stated[50]
    few = statistics(cycled(steps=24, **course))
    assert "fewer than 16 records" in str(few["loop_energy"].reason.item())
    assert math.isnan(few["loop_energy"].value)


@pytest.mark.parametrize("stiffness", [340.0, 3.4e3, 34e3])
def test_the_bound_of_a_loop_holds_the_tension_between_two_records(stiffness):
    course = {"from": 3e-6, "to": -16e-6}
    for steps in (40, 82, 200):
        dataset = cycled(steps=steps, displacement=course, stiffness=stiffness)
        loop = statistics(dataset)
        # under a constant work of adhesion all work is dissipated by jumps, which the stepper books
        lost = loop["loop_dissipation"].value
        off = abs(loop["loop_energy"].value - lost)
        assert float(off) <= float(loop["loop_energy"].bound)


def test_loops_of_points_are_those_of_the_whole_and_there_are_none_without_trips(ramp):
    course = Equilibrium(
        indentation={"from": 1e-6, "to": -2e-6, "cycles": 1}, after_pull_off="reattach"
    )
    sweep = {"contact.indentation.cycles": [1, 2], "adhesion.work": [2e-2, 4e-2]}
    swept = scene(
        contact=course, sweep=sweep, bonds=bonds.Unbroken(), shear=shear.Uniform()
    )
    together = read.loop_energy(run(swept))
    for k, point in enumerate(swept.points()):
        alone, where = read.loop_energy(run(point)), divmod(k, 2)
        for name in alone:
            values = together[name].isel(
                contact_indentation_cycles=where[0], adhesion_work=where[1]
            )
            assert_array_equal(values[: alone.sizes["cycle"]], alone[name])
            assert bool(values[alone.sizes["cycle"] :].isnull().all())
    dataset = cycled(cycles=2, load={"from": 4e-3, "to": -1e-3})
    assert bool(read.loop_energy(dataset)["loop_energy"].isnull().all())
    dataset = cycled(cycles=4, indentation={"from": 2e-6, "to": 1e-6})
    stopped = dataset["contact_radius"].where(dataset["t"] < 0.6)
    result = read.loop_energy(dataset.assign(contact_radius=stopped))
    assert result["loop_energy"].isnull().to_numpy().tolist() == [
        False,
        False,
        True,
        True,
    ]
    with pytest.raises(ValueError, match="cycles = 2"):
        read.loop_energy(ramp)
    assert "loop_energy" not in statistics(ramp)


@pytest.fixture(scope="module")
def started():
    """Bonds that are stretched together after a rest of a tenth of a second; the rest is swept."""
    stretched = bonds.Cohort(
        rupture=Bell(zero_force_rate=5.0, bell_force=4e-12),
        bond_stiffness=4e-4,
        rebinding_rate=5.0,
        site_density=9e16,
        start_from="empty",
        tolerance=1e-3,
    )
    part = drive.Start(rest=0.1, speed=5e-6)
    return run(
        scene(
            drive=part,
            bonds=stretched,
            shear=shear.Uniform(),
            clock=Clock(duration=0.5, step=2e-3),
            sweep={"drive.rest": [0.1, 0.2]},
        )
    )


def test_a_static_peak_is_timed_from_the_start_among_steps_and_of_statistics_that_of_the_mean(
    started,
):
    result = values_of(read.events(started))
    for k, rest in enumerate((0.1, 0.2)):
        stress, t = started["shear_stress"][k].to_numpy(), started["t"].to_numpy()
        at = int(np.argmax(stress))
        assert stress[at] > 1.5 * stress[-1] and t[at] > rest
        # between two records it is higher, but below the lines through its neighbours: it is concave there
        assert (
            stress[at]
            <= float(result["peak_stress"][k])
            < 2.0 * stress[at] - min(stress[at - 1], stress[at + 1])
        )
        assert abs(float(result["peak_time"][k]) - (t[at] - rest)) < 2e-3
    # more bonds after a longer rest
    assert float(result["peak_stress"][1]) > float(result["peak_stress"][0])
    rows = rows_of(started, read.highlights)
    assert [row["drive_rest (ms)"] for row in rows] == ["100", "200"]
    assert {"peak of stress (kPa)", "peak of friction (mN)"} < set(rows[0])
    assert "peak of friction after (ms)" in rows[0]
    assert not any("at V" in heading for heading in rows[0])


def test_the_friction_maximum_and_the_static_peak_are_those_of_the_clock_steps_whatever_the_records():
    """Own quadrature: 24.40 kPa at 2.270 mm/s; own integration: 59.32 kPa after 14.37 ms; within a clock step."""
    bell = {"model": "bell", "zero_force_rate": "20 1/s", "bell_force": "4 pN"}
    parts = LENS | {
        "adhesion": {"work": "42 mJ/m^2", "bond_share": 0.0},
        "bonds": {
            "model": "cohort",
            "rupture": bell,
            "bond_stiffness": "0.4 uN/m",
            "rebinding_rate": "100 1/s",
            "site_density": "1e16 1/m^2",
        },
    }
    ramp = {"model": "ramp", "from": "1 um/s", "to": "1 m/s", "scale": "log"}
    slow = {
        "model": "rate",
        "rupture": bell | {"zero_force_rate": "1 1/s"},
        "bond_stiffness": "0.4 mN/m",
        "rebinding_rate": "1 1/s",
        "site_density": "1e16 1/m^2",
        "start": "empty",
    }
    start = {"model": "start", "rest": "1 s", "speed": "3 um/s"}
    # the first record and the last alone
    clock = {"duration": "100 s", "step": "0.1 s", "record": "100 s"}
    result = values_of(
        read.peaks(run(sim.Scenario(**parts | {"drive": ramp, "clock": clock})))
    )
    assert_allclose(result["peak_stress"], 24.40e3, rtol=2e-4)
    for name in ("peak_speed", "peak_friction_speed"):
        assert_allclose(result[name], 2.270e-3, rtol=1e6 ** (0.1 / 100.0) - 1.0)
    clock = {"duration": "2 s", "step": "0.1 ms", "record": "2 s"}
    result = values_of(
        read.peaks(
            run(sim.Scenario(**parts | {"bonds": slow, "drive": start, "clock": clock}))
        )
    )
    assert_allclose(result["peak_stress"], 59.32e3, rtol=1e-4)
    assert_allclose(result["peak_time"], 14.37e-3, atol=1e-4)
    assert_allclose(result["peak_friction_time"], result["peak_time"], rtol=1e-12)


@pytest.mark.parametrize(
    "rupture",
    [None, {"model": "cut_off", "rate": "1 1/s", "stretch": "50 nm"}],
    ids=["bell", "cut_off"],
)
def test_the_time_of_a_peak_after_a_start_is_within_its_bound_of_that_at_fine_steps(
    rupture,
):
    """Bonds carry adhesion, so that the contact area changes while the stress is at its maximum."""
    scenario = sim.load(Path(__file__).parents[2] / "scenarios/static_peak.toml")
    values = {"drive.rest": "1 s", "drive.speed": "3 um/s", "clock.duration": "1.1 s"}
    if rupture:
        values["bonds.rupture"] = rupture
    coarse, fine = (
        read.peaks(run(scenario.with_values(values | {"clock.step": step})))
        for step in ("4 ms", "0.1 ms")
    )
    for name in ("peak_time", "peak_friction_time"):
        off = abs(float(coarse[name].value) - float(fine[name].value))
        assert 1e-6 < off < float(coarse[name].bound) == 4e-3


@functools.cache
def along_a_ramp(is_peak, first):
    """Return a scenario along a ramp from a speed [nm/s], whose stress falls or has a peak, and its peaks."""
    falls = {"model": "steady", "critical_speed": "1 mm/s", "stress": "0.3 MPa"}
    bonds_of = ALONG_A_RAMP["bonds"] if is_peak else falls
    drive_of = {"model": "ramp", "to": "1 um/s", "scale": "log"}
    changes = {
        "bonds": bonds_of,
        "drive": drive_of | {"from": f"{first} nm/s"},
        "clock": {"duration": "40 s", "step": "0.4 s"},
    }
    scenario = sim.Scenario(**ALONG_A_RAMP | changes)
    return scenario, values_of(read.peaks(run(scenario)))


@pytest.mark.parametrize("rounding", ["compression", "precision"])
def test_rounded_records_make_no_peak_of_a_stress_that_falls_and_keep_a_true_one(
    rounding, tmp_path
):
    """The stress of a simple population falls along the whole ramp, that of stretched bonds has a maximum."""
    rounded = {"compression": "digits", "precision": "float32"}[rounding]
    for is_peak in (False, True):
        # many first values, of which some are rounded down
        for first in np.linspace(1.0, 2.0, 6):
            scenario, exact = along_a_ramp(is_peak, float(first))
            path = tmp_path / f"{is_peak}{first}.nc"
            sim.run(scenario.with_values({f"record.{rounding}": rounded}), path)
            with sim.open(path) as dataset:
                assert dataset["shear_stress"][0] != exact.get("peak_stress", 0.0)
                result = values_of(read.peaks(dataset))
            assert bool(result["peak_stress"].notnull()) is is_peak
            xr.testing.assert_allclose(result, exact, rtol=1e-6)


@pytest.mark.parametrize("cycles", [2, pytest.param(10, marks=pytest.mark.verify)])
def test_pull_offs_of_cycles_are_those_of_all_cycles_and_not_the_lowest(cycles):
    """Own Gillespie and JKR, 200 pull-offs: mean of the loads -364 nN."""
    scenario = sim.Scenario(**SCENES["cycles"]).with_values(
        {"contact.displacement.cycles": cycles}
    )
    clock = {"duration": 2.0 * cycles, "step": "1 ms", "record": 1.0 * cycles}
    dataset = run(scenario.with_values({"clock": clock, "ensemble.members": 20}))
    loads = read.pull_offs(dataset)["pull_off_load"]
    every = 1e9 * loads.values[np.isfinite(loads.values)]
    assert (
        every.size == 20 * cycles
        and dataset["phase_name"].values.tolist() == ["retraction", "approach"] * cycles
    )
    error = every.std(ddof=1) / math.sqrt(every.size)
    assert abs(every.mean() + 364.0) < 5.0 * error
    result = values_of(read.events(dataset))
    assert_allclose(result["pull_off_load"].mean(), 1e-9 * every.mean(), rtol=1e-12)
    assert_array_equal(result["pull_offs"], cycles)


def test_peaks_are_maxima_inside_a_ramp_or_at_once_after_a_start_and_none_is_of_noise(
    ramp,
):
    one, n = ramp.isel(member=0, drop=True), np.arange(21.0)
    shape = 1e5 * (1.0 - (n - 12.0) ** 2 / 400.0)
    shapes = {
        "level": 0 * n + 1,
        "rising": n,
        "falling": n[::-1],
        "rounding": 1 + 1e-14 * np.sin(n),
        "peak": shape,
    }
    for name, values in shapes.items():
        # its size: sliding back it is negative
        made_up = {"shear_stress": values, "friction_force": -values}
        made_up = {key: ("t", series) for key, series in made_up.items()}
        made_up |= dict.fromkeys(("peak_stress", "peak_friction"), np.abs(values).max())
        result = values_of(read.peaks(one.assign(made_up)))
        known = [bool(result[key].notnull()) for key in result]
        assert len(known) == 6 and set(known) == {name == "peak"}
    # members differ by noise
    assert not any("friction" in name for name in values_of(read.peaks(ramp)))
    # Bonds without a stretch bear most at the first slip: the first record after it, two lives of the transient on.
    part = drive.Start(rest=0.1, speed=1e-2)
    population = bonds.Rate(critical_speed=1e-2, rebinding_rate=50.0, stress=3e5)
    dataset = run(scene(drive=part, bonds=population, shear=shear.Uniform()))
    result = values_of(read.events(dataset))
    assert_allclose(result["peak_stress"], 3e5 * (0.5 + 0.5 * np.exp(-2.0)), rtol=1e-12)
    assert_allclose(result["peak_time"], 0.02, rtol=1e-12)
    dataset = run(scene(drive=drive.Steady(speed=1e-3)))
    assert not any(
        str(name).startswith("peak") for name in values_of(read.events(dataset))
    )
    contact = Equilibrium(displacement={"from": 1e-6, "to": -3e-5}, stiffness=50.0)
    dataset = run(
        scene(
            contact=contact,
            drive=drive.Steady(),
            clock=Clock(duration=1.0, step=1e-3, record=0.1),
        )
    )
    exact = float(
        jkr.pull_off_load(
            float(dataset["adhesion_work"]), float(dataset["sphere_radius"])
        )
    )
    assert not dataset["in_contact"].isel(t=-1).any()
    assert_allclose(dataset["lowest_load"], exact, rtol=2e-3)


@pytest.mark.parametrize("step", ["10 ms", "40 ms"])
def test_the_speed_of_a_friction_maximum_has_the_closed_form_in_its_interval_at_any_clock_step(
    step,
):
    point = sim.load(
        Path(sim.__file__).parents[1] / "scenarios" / "friction_maximum.toml",
        {"clock.step": step},
    )
    stated, law, rupture = (
        read.Run(run(point)).statements(),
        point.bonds,
        point.bonds.rupture,
    )
    exact = bell_peak(
        rupture.zero_force_rate,
        rupture.bell_force,
        law.bond_stiffness,
        law.rebinding_rate,
        1.0,
    ).speed
    of_speed = stated["peak_speed"]
    speed, bound = float(of_speed.value), float(of_speed.bound)
    low, high = speed - bound, speed + bound
    # seven decades in all
    assert (
        low
        < exact
        < high
        < low * 1e7 ** (1.01 * point.clock.step / point.clock.duration)
    )
    off = float(stated["peak_time"].value) - np.log(exact / 1e-7) / np.log(1e7) * 10.0
    assert abs(off) < float(stated["peak_time"].bound)


def test_a_pull_from_rest_has_a_threshold_between_its_clock_steps_and_the_area_there_unless_friction_still_grows():
    stretched = {
        "rupture": Bell(zero_force_rate=25.0, bell_force=4e-12),
        "bond_stiffness": 8e-7,
    }
    parts = {
        "bonds": bonds.FirstMoment(
            **stretched, rebinding_rate=250.0, site_density=6.5e16, start_from="steady"
        ),
        "drive": drive.Spring(stage=2e-3, stiffness=300.0),
        "shear": shear.Uniform(),
    }
    dense, seldom, short = (
        run(scene(**parts, clock=Clock(*clock)))
        for clock in ((0.2, 5e-4), (0.2, 5e-4, 0.2), (0.02, 5e-4))
    )
    force, area = (
        dense["friction_force"].to_numpy(),
        dense["contact_area"].to_numpy(),
    )
    top = int(np.argmax(force))
    assert 0 < top < len(force) - 1
    result = values_of(read.events(dense))
    # between two clock steps it is higher, but below the lines through its neighbours: it is concave there
    assert (
        force[top]
        <= result["static_threshold"].item()
        < 2.0 * force[top] - min(force[top - 1], force[top + 1])
    )
    low, high = sorted(area[[top - 1, top + 1]] / area[0])
    assert low < result["area_at_threshold"].item() < high
    xr.testing.assert_identical(
        values_of(static_threshold(seldom)), values_of(static_threshold(dense))
    )
    assert bool(values_of(static_threshold(short)).to_dataarray().isnull().all())


def test_a_clock_step_after_the_peak_of_a_start_states_no_static_threshold():
    """The first sample of 8 ms lies beyond the peak at 5.09 ms, and the friction falls from there."""
    scenario = sim.load(Path(__file__).parents[2] / "scenarios/static_peak.toml")
    values = {"sweep": {}, "drive.rest": "4 s", "drive.speed": "10 um/s"}
    values |= {"clock.duration": "4.4 s"}
    for step, is_seen in (("8 ms", False), ("0.5 ms", True)):
        dataset = run(scenario.with_values(values | {"clock.step": step}))
        for one in static_threshold(dataset).values():
            assert bool(one.value.notnull()) is is_seen
        after = of_events(dataset)["phase_peak_after_hold"].isel({"phase": 1})
        assert bool(after.value.notnull()) is is_seen


def test_recorded_statistics_of_a_threshold_keep_their_error():
    """The error is the second of the recorded statistics, which a time of members had been compared with."""
    scene = tomllib.loads(AGED)
    scene["drive"] = {"model": "start", "rest": 0.5, "speed": 2e-3}
    scene["bonds"] |= {"model": "tracked", "sites": 100}
    scene |= {"clock": {"duration": 1.0, "step": 5e-3}, "ensemble": {"members": 4}}
    each, pooled = (
        of_events(run(sim.load(scene | {"record": {"per_member": kept}})))
        for kept in (True, False)
    )
    for name in ("static_threshold", "area_at_threshold", "phase_peak_after_hold"):
        ours, theirs = (np.ravel(one[name].sem)[-1] for one in (pooled, each))
        assert ours > 0.0
        assert_allclose(ours, theirs, rtol=1e-9, err_msg=name)


@pytest.mark.parametrize("drive", ["start", "holds"])
def test_a_maximum_after_a_hidden_peak_is_no_peak(drive):
    """At 20 ms the peak of 32 mN at 11 ms is past, and friction rises again to a maximum of 2.4 mN at 40 ms."""
    scene = tomllib.loads(AGED)
    scene["drive"] = {"model": "start", "rest": 0.5, "speed": 2e-3}
    if drive == "holds":
        scene["drive"] = {"model": "holds", "speed": 2e-3, "slide": 0.5, "holds": [0.5]}
    for step, is_seen in (("20 ms", False), ("1 ms", True)):
        made = sim.load(scene | {"clock": {"duration": "1.5 s", "step": step}})
        dataset = run(made)
        after = of_events(dataset)["phase_peak_after_hold"]
        assert bool(after.value.notnull().any()) is is_seen
        # the first phase has no hold before, of which nothing is hidden
        assert "clock.step" not in str(after.reason.values.flat[0])
        peaks, threshold = read.peaks(dataset), static_threshold(dataset)
        assert bool(peaks) is (drive == "start")
        for name, one in (peaks | (threshold if peaks else {})).items():
            assert bool(one.value.notnull()) is is_seen, name


def test_a_clock_step_after_the_peak_of_a_hold_states_no_peak_and_a_cure():
    """The first sample of 8 ms lies beyond the peak of 20.3 mN at some 5 ms, and the friction falls from there."""
    scenario = sim.load(Path(__file__).parents[2] / "scenarios/static_peak.toml")
    values = {"sweep": {}, "clock.duration": "1.2 s"}
    values["drive"] = {"model": "holds", "speed": "10 um/s", "slide": "0.2 s"}
    values["drive"] |= {"holds": ["0.5 s"]}
    for step, is_seen in (("8 ms", False), ("0.5 ms", True)):
        dataset = run(scenario.with_values(values | {"clock.step": step}))
        peak = of_events(dataset)["phase_peak_after_hold"].isel({"phase": 2})
        assert bool(peak.value.notnull()) is is_seen
        assert ("clock.step" in str(peak.reason.values)) is not is_seen


@pytest.mark.parametrize(("step", "is_seen"), [(1e-5, True), (5e-2, False)])
def test_a_clock_step_that_hides_the_peak_of_a_start_states_no_peak_and_a_cure(
    step, is_seen
):
    """Bonds that have aged break within some milliseconds of sliding, of which a long step shows the end alone."""
    population = bonds.Cohort(
        rupture=Bell(zero_force_rate=25.0, bell_force=4e-12),
        bond_stiffness=8e-7,
        rebinding_rate=250.0,
        site_density=6.5e16,
    )
    made = scene(
        shear=shear.Uniform(),
        bonds=population,
        drive=drive.Start(rest=0.1, speed=20e-3),
        clock=Clock(0.3, step),
    )
    dataset = run(made)
    peak = read.peaks(dataset)["peak_stress"]
    assert bool(np.isfinite(peak.value)) is is_seen
    assert ("clock.step" in str(peak.reason.values)) is not is_seen
    stated = sim.Run(dataset)
    needed = notes(stated, tables_of(stated)).needed
    assert (
        any("peak of stress" in text and "clock.step" in text for text in needed)
        is not is_seen
    )
    cures = [text for text in made.remarks() if "rises from rest" in text]
    assert len(cures) == (not is_seen) and all("clock.step" in text for text in cures)
    if is_seen:
        # more than that of the bonds of the start alone, because some others form meanwhile
        force = start_up_peak(20e-3, 25.0, 4e-12, 8e-7).force
        alone = 6.5e16 * population.bound_at_rest * force
        assert alone < float(peak.value) < 1.1 * alone


@pytest.mark.parametrize(("peaks", "start"), [(True, "empty"), (False, "steady")])
def test_a_start_has_a_static_threshold_if_its_friction_falls_again(peaks, start):
    """Bonds that rest have become many, and sliding renews them; bonds that are as in sliding stay so."""
    stretched = {
        "rupture": Bell(zero_force_rate=25.0, bell_force=4e-12),
        "bond_stiffness": 8e-7,
    }
    made = {"rebinding_rate": 250.0, "site_density": 6.5e16, "start_from": start}
    speed = 2e-3 if peaks else 1e-6
    dataset = run(
        scene(
            shear=shear.Uniform(),
            bonds=bonds.FirstMoment(**stretched, **made),
            drive=drive.Start(rest=0.1, speed=speed),
            clock=Clock(0.3, 1e-4),
        )
    )
    result = values_of(static_threshold(dataset))
    force = dataset["friction_force"].to_numpy()
    top = int(np.argmax(force))
    assert bool(force[-1] < 0.99 * force[top]) is peaks
    if peaks:
        assert_allclose(result["static_threshold"], force[top], rtol=1e-3)
        assert_allclose(result["threshold_after"], dataset["t"][top], atol=1e-4)
        # bonds have not formed yet at the start, where the contact is smaller than that of JKR theory
        ratio = dataset["contact_area"][top] / (np.pi * dataset["jkr_radius"][0] ** 2)
        assert_allclose(result["area_at_threshold"], ratio, rtol=1e-3)
        assert (
            0.5
            < ratio
            < 1.0
            < dataset["contact_area"][top] / dataset["contact_area"][0]
        )
    else:
        assert result.to_dataarray().isnull().all()


@pytest.mark.parametrize("after", [-4e-4, 2e-4])
def test_friction_that_falls_because_the_stage_turns_or_slows_down_has_no_static_threshold(
    after,
):
    """The stage is slower than the friction maximum, so that friction rises to its steady value."""
    stretched = {
        "rupture": Bell(zero_force_rate=25.0, bell_force=4e-12),
        "bond_stiffness": 8e-7,
    }
    stage = {"time": (0.0, 0.5, 0.5, 1.0), "value": (4e-4, 4e-4, after, after)}
    dataset = run(
        scene(
            shear=shear.Uniform(),
            bonds=bonds.FirstMoment(
                **stretched, rebinding_rate=250.0, site_density=6.5e16
            ),
            drive=drive.Spring(stage=stage, stiffness=1e3),
            clock=Clock(1.0, 1e-3),
        )
    )
    force = dataset["friction_force"].to_numpy()
    assert np.abs(force).min() < 0.8 * force.max()
    assert abs(1e-3 * force.argmax() - 0.5) < 0.01
    assert np.isnan(dataset["static_threshold"]).all()


def test_a_table_of_speeds_has_a_peak_after_each_hold_and_none_after_a_faster_speed():
    stretched = {
        "rupture": Bell(zero_force_rate=25.0, bell_force=4e-12),
        "bond_stiffness": 8e-7,
    }
    made = {"rebinding_rate": 250.0, "site_density": 6.5e16, "start_from": "steady"}
    times = (0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3, 0.35, 0.35, 0.5)
    speeds = (2e-3, 2e-3, 4e-3, 4e-3, 0.0, 0.0, 4e-3, 4e-3, 2e-3, 2e-3)
    dataset = run(
        scene(
            shear=shear.Uniform(),
            bonds=bonds.FirstMoment(**stretched, **made),
            drive=drive.Table(time=times, speed=speeds),
            clock=Clock(0.5, 1e-4),
        )
    )
    result = read.peaks_after_holds(dataset)
    force, time = dataset["friction_force"].to_numpy(), dataset["t"].to_numpy()
    top = np.max(force[(time > 0.3) & (time < 0.35)])
    nothing = [np.nan] * 3
    assert_allclose(result["peak_after_hold"], [*nothing, top, np.nan], rtol=1e-3)
    assert_allclose(result["time_held"], [*nothing, 0.1, np.nan], rtol=1e-12)
    # it has not started from rest
    assert np.isnan(dataset["static_threshold"]).all()


def test_each_member_with_noise_has_its_own_threshold():
    """A fall by noise takes one per cent of few bonds at once: the threshold is then the first of them."""
    rupture = Bell(zero_force_rate=25.0, bell_force=4e-12)
    tracked = bonds.Tracked(
        rupture=rupture,
        bond_stiffness=8e-7,
        rebinding_rate=250.0,
        site_density=6.5e16,
        sites=50,
        start_from="steady",
    )
    dataset = run(
        scene(
            shear=shear.Uniform(),
            bonds=tracked,
            drive=drive.Spring(stage=2e-3, stiffness=300.0),
            clock=Clock(0.1, 1e-4),
        )
    )
    for member in range(6):
        force = dataset["friction_force"][member].to_numpy()
        fallen = force < 0.99 * np.maximum.accumulate(force)
        own = force[: int(np.argmax(fallen))].max()
        assert own <= dataset["static_threshold"][member] < 1.05 * own
    assert np.unique(dataset["static_threshold"]).size == 6


#: A lens with bonds of the mean-field model, along a ramp through the friction maximum.
ALONG_A_RAMP = {
    "solid": {"shear_modulus": "0.6 MPa"},
    "sphere": {"radius": "5 mm"},
    "adhesion": {"work": "30 mJ/m^2", "bond_share": 0.0},
    "contact": {"load": "5 mN"},
    "bonds": {
        "model": "rate",
        "rupture": {"model": "bell", "bell_force": "6 pN", "zero_force_rate": "1 1/s"},
        "bond_stiffness": "0.5 mN/m",
        "rebinding_rate": "5 1/s",
        "site_density": "1e15 1/m^2",
        "start": "steady",
    },
}


def true_maximum(speed_at, times):
    """Return the time of the largest stress along a course of the speed, by an own integration."""
    loss = 5e-4 / 6e-12

    def slopes(time, state):
        bound, stretch = state
        rebound = 5.0 * (1.0 - bound)
        rupture = np.exp(loss * stretch)
        return rebound - rupture * bound, speed_at(time) - stretch * rebound / bound

    start = fsolve(lambda state: slopes(times[0], state), (0.8, speed_at(times[0])))
    how = {"method": "LSODA", "rtol": 1e-11, "atol": [1e-12, 1e-20]}
    course = solve_ivp(slopes, times, start, dense_output=True, **how)
    stress = interpolate.PchipInterpolator(
        course.t, course.sol(course.t)[0] * course.sol(course.t)[1]
    )
    top = course.t[int(np.argmax(stress(course.t)))]
    near = np.linspace(0.9 * top, min(1.1 * top, times[1]), 200_001)
    bound, stretch = course.sol(near)
    return near[int(np.argmax(bound * stretch))]


@pytest.mark.parametrize("ends", [(1e-9, 1e-6), (1e-6, 1e-9)])
@pytest.mark.parametrize("scale", ["log", "linear"])
@pytest.mark.parametrize(
    ("duration", "steps", "most"),
    [(4.0, 400, 1.0), (40.0, 100, 1.0), (400.0, 40, 0.3), (4e4, 400, 0.03)],
)
def test_a_maximum_along_a_ramp_is_where_an_own_integration_has_it_within_its_bound(
    ends, scale, duration, steps, most
):
    """From bonds that remember a clock step to bonds without a memory in it, where half a step would be the error."""
    first, last = ends
    drive = {"model": "ramp", "from": first, "to": last, "scale": scale}
    step = duration / steps
    document = ALONG_A_RAMP | {"clock": {"duration": duration, "step": step}}
    result = read.peaks(run(sim.Scenario(**document | {"drive": drive})))

    def speed_at(time):
        share = time / duration
        if scale == "log":
            return first * (last / first) ** share
        return first + (last - first) * share

    exact = true_maximum(speed_at, (0.0, duration))
    for name, truth in (("time", exact), ("speed", speed_at(exact))):
        found = result[f"peak_{name}"]
        assert abs(float(found.value) - truth) <= float(found.bound)
    assert float(result["peak_time"].bound) <= most * step


@pytest.mark.parametrize("fluctuates", [False, True])
@pytest.mark.parametrize(
    ("indentation", "is_open"), [(-0.35e-6, True), (-0.02e-6, False)]
)
def test_a_contact_that_never_closes_has_no_event_of_a_contact(
    indentation, is_open, fluctuates
):
    """The bonds left at the start cannot hold the sphere, and nothing closes its contact again."""
    weak = FIELD | {"spectrum": Band(rms=50e3, longest=60e-6, shortest=24e-6)}
    field = shear.Modal(correlation=Time(time=0.01), **weak)
    dataset = run(
        scene(
            contact=Equilibrium(indentation=indentation, after_pull_off="reattach"),
            drive=drive.Ramp(start=2e-2, stop=-2e-2),
            bonds=bonds.Steady(critical_speed=5e-3, stress=3e5),
            clock=Clock(0.4, 5e-3),
            shear=field if fluctuates else shear.Uniform(),
        )
    )
    assert bool((dataset["in_contact"] == 0.0).all()) is is_open
    read_run = read.Run(dataset)
    names = ("pull_off_load", "jump_in_load", "peak_stress", "peak_friction")
    reasons = {
        name: str(read_run.events[name].reason.item())
        for name in names
        if bool(read_run.events[name].is_missing)
    }
    shown = [row[""] for row in key_figures(read_run)]
    first, *others = answer(read_run)
    if is_open:
        assert [*reasons] == [*names] and {*reasons.values()} == {OPEN_THROUGHOUT}
        assert "open" in first and not others
        assert not [name for name in shown if "peak" in name]
    else:
        assert reasons["pull_off_load"] == STAYS_CLOSED
        assert "peak_stress" not in reasons
        assert not [words for words in (first, *others) if "is open" in words]


def test_peaks_of_friction_that_lack_a_contact_or_records_have_their_own_reasons():
    dataset = run(
        scene(clock=Clock(0.4, 0.01), drive=drive.Ramp(start=1e-5, stop=1e-3))
    )
    force = dataset["friction_force"]
    opened = dataset.assign(friction_force=force.where(force["t"] < 0.2))
    few = dataset.isel(t=slice(None, None, 8))
    words = [
        str(ensemble_peaks(each)["peak_friction"].reason.item())
        for each in (opened, few)
    ]
    assert "closed" in words[0] and "records" in words[1]
    assert not any("or members" in each for each in words)


def test_the_peak_of_a_mean_has_the_errors_of_its_records_and_of_the_clock_step():
    """Masked contacts have Hertz's area, so that friction peaks where the stress does."""
    masks = FIELD | {"spectrum": Band(rms=2e6, longest=60e-6, shortest=24e-6)}
    dataset = run(
        scene(
            clock=Clock(2.0, 5e-3, record=20e-3),
            drive=drive.Ramp(start=5e-2, stop=2e-5, scale="log"),
            shear=shear.Modal(correlation=Time(time=0.01), **masks),
            bonds=bonds.FirstMoment(
                rupture=Bell(zero_force_rate=25.0, bell_force=4e-12),
                bond_stiffness=0.8e-6,
                rebinding_rate=250.0,
                site_density=6.5e16,
            ),
        )
    )
    assert bool(dataset["masked"].all())
    read_run = read.Run(dataset)
    stress, force = (read_run.events[f"peak_{of}"] for of in ("stress", "friction"))
    area = math.pi * dataset["hertz_radius"].isel(t=0).item() ** 2
    assert float(force.bound) > 0.0
    assert abs(float(force.value) - area * float(stress.value)) <= float(force.bound)
    for place in ("time", "speed"):
        exact = read_run.events[f"peak_{place}"]
        found = read_run.events[f"peak_friction_{place}"]
        apart = abs(float(found.value) - float(exact.value))
        assert 0.0 < apart <= float(found.bound + exact.bound)
        assert "records" in found.source and "step" in found.source
    (row,) = (row for row in key_figures(read_run) if row[""] == "peak of friction")
    assert "mean" in row["definition"] and "largest" not in row["definition"].lower()
    heading = [
        words
        for words in notes(read_run, tables_of(read_run)).headings
        if words.startswith("peak of friction:")
    ]
    assert heading and all("mean" in words for words in heading)


def test_half_of_the_members_have_had_an_event_only_if_there_are_several():
    masks = FIELD | {"spectrum": Band(rms=2e6, longest=60e-6, shortest=24e-6)}
    for count in (1, 3):
        dataset = run(
            scene(
                ensemble=Ensemble(members=count),
                shear=shear.Modal(correlation=Time(time=0.01), **masks),
            )
        )
        events = read.Run(dataset).events
        assert ("half_masked" in events) is (count > 1) and "ever_masked" in events


@pytest.mark.parametrize(
    ("work", "is_stated"), [("42 mJ/m^2", True), ("0 J/m^2", False)]
)
def test_a_contact_without_adhesion_has_none_to_mask(work, is_stated):
    """The mean stress takes 250 mJ/m²: it masks the adhesion, if there is any."""
    changes = {
        "sweep": {},
        "adhesion.work": work,
        "contact.reversible": 1,
        "bonds.stress": "100 kPa",
    }
    dataset = sim.run(sim.load("scenarios/theories.toml", changes))
    assert ("first_masked" in dataset) is is_stated
    assert ("fraction_masked" in sim.stats(dataset)) is is_stated
    if is_stated:
        assert dataset["first_masked"].item() == 0.0


@pytest.mark.parametrize("late", [0.0, 0.006, 0.014])
def test_the_peaks_of_a_phase_are_those_between_jumps_of_speed_and_load(late):
    """Steady bonds, speeds of 10, 1 and 20 µm/s and loads of 2, 1 and 3 µN: a stress by the law, an area by JKR."""
    radius, work, modulus, times = 10e-6, 0.05, 4e6 / 3.0, [1.0 + late, 2.0 + late]
    speeds, loads = np.array([1e-5, 1e-6, 2e-5]), np.array([2e-6, 1e-6, 3e-6])
    time = [0.0, *np.repeat(times, 2), 3.0]
    dataset = sim.run(
        {
            "clock": {"duration": 3.0, "step": 0.02},
            "solid": {"shear_modulus": modulus / 4.0},
            "sphere": {"radius": radius},
            "adhesion": {"work": work, "bond_share": 0.0},
            "contact": {"load": {"time": time, "value": list(np.repeat(loads, 2))}},
            "drive": {"model": "table", "time": time, "speed": [*np.repeat(speeds, 2)]},
            "bonds": {"model": "steady", "stress": 1e4, "critical_speed": 1e-5},
        }
    )
    stress = 1e4 / (1.0 + speeds / 1e-5)
    pulled = 3.0 * np.pi * work * radius
    cube = loads + pulled + np.sqrt(2.0 * pulled * loads + pulled**2)
    area = np.pi * (0.75 * radius / modulus * cube) ** (2.0 / 3.0)
    assert_allclose(dataset["phase_start"], [0.0, *times], rtol=1e-12)
    assert_allclose(dataset["phase_peak_stress"], stress, rtol=1e-12)
    assert_allclose(dataset["phase_peak_friction"], stress * area, rtol=1e-9)
    assert_allclose(dataset["phase_peak_friction_area"], area, rtol=1e-9)
    for name in ("phase_peak_time", "phase_peak_friction_time"):
        assert (dataset[name] >= dataset["phase_start"] - 1e-9).all()
        assert (dataset[name] < dataset["phase_end"]).all()


@pytest.mark.parametrize("late", [0.0, 0.006, 0.014])
@pytest.mark.parametrize("model", ["spring", "force"])
def test_the_friction_of_a_driven_slider_in_a_phase_is_that_under_its_load_and_force(
    model, late
):
    """Behind a spring it is the largest of the records between the jumps, under a force it is this force."""
    times, loads = [1.0 + late, 2.0 + late], np.array([2e-6, 1e-6, 3e-6])
    time, forces = [0.0, *np.repeat(times, 2), 3.0], np.array([1.2e-7, 6e-8, 9e-8])
    drive = {"model": "spring", "stage": 1e-6, "stiffness": 10.0, "start": "steady"}
    if model == "force":
        force = {"time": time, "value": list(np.repeat(forces, 2))}
        drive = {"model": "force", "force": force}
    dataset = sim.run(
        {
            "clock": {"duration": 3.0, "step": 0.02},
            "solid": {"shear_modulus": 0.75e6},
            "sphere": {"radius": 10e-6},
            "adhesion": {"work": 0.05},
            "contact": {"load": {"time": time, "value": list(np.repeat(loads, 2))}},
            "drive": drive | {"contact_stiffness": "rigid"},
            "bonds": {
                "model": "rate",
                "rupture": {
                    "model": "bell",
                    "zero_force_rate": 1e3,
                    "bell_force": 4e-12,
                },
                "bond_stiffness": 1e-3,
                "rebinding_rate": 1e4,
                "site_density": 1e16,
            },
        }
    )
    peaks, starts = dataset["phase_peak_friction"], dataset["phase_start"]
    assert_allclose(starts, [0.0, *times], rtol=1e-12)
    expected, records = forces, dataset["friction_force"].squeeze()
    if model == "spring":
        ends = zip([-1.0, *times], [*times, 4.0], strict=True)
        expected = [
            records.where((records.t > low + 1e-9) & (records.t < high - 1e-9)).max()
            for low, high in ends
        ]
    assert_allclose(peaks, expected, rtol=1e-3)
    assert (dataset["phase_peak_friction_time"] >= starts).all()


@pytest.mark.parametrize("late", [0.0, 0.006, 0.014])
def test_a_slider_at_rest_has_no_friction_up_to_the_moment_at_which_it_starts(late):
    """Bonds that live for a twentieth of a clock step bear their steady stress at the end of the step of the start."""
    rupture = {"model": "bell", "zero_force_rate": 1e3, "bell_force": 4e-12}
    sites = {"rebinding_rate": 1e4, "site_density": 1e16, "bond_stiffness": 1e-3}
    dataset = sim.run(
        {
            "clock": {"duration": 2.0, "step": 0.02},
            "solid": {"shear_modulus": 0.75e6},
            "sphere": {"radius": 10e-6},
            "adhesion": {"work": 0.05},
            "contact": {"load": 2e-6},
            "drive": {"model": "start", "speed": 1e-6, "rest": 1.0 + late},
            "bonds": {"model": "rate", "rupture": rupture, **sites},
        }
    )
    resting, sliding = dataset["phase_peak_friction"].values.ravel()
    assert resting == 0.0
    assert_allclose(sliding, dataset["friction_force"].max(), rtol=0.01)
