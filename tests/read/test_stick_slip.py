"""Stick and slip read from a dataset: closed relaxation cycles, made-up forces, reversals, noise."""

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers.driven import force, scenario
from helpers.parts import Adhesion, Bell, Clock, Force, Record, Spring, read, run
from helpers.printed import lines_of, rows_of
from helpers.scenes import scene
from numpy.testing import assert_allclose, assert_array_equal

import sim
from sim.ensemble.dataset import moments, pooled as pooled_moments
from sim.parts.bonds.models import Cohort, FirstMoment, Steady, Unbroken
from sim.parts.events import LATE, SLIP, Slips
from tests.read.test_invariance import LENS, SCENES, STRETCHED

NAN = math.nan
#: A slider of 5 g that sticks and slips at four speeds.
PULLED = {
    "clock": {"duration": "1.2 s", "step": "0.2 ms"},
    "solid": {"shear_modulus": "0.9 MPa"},
    "sphere": {"radius": "3 mm"},
    "adhesion": {"work": "40 mJ/m^2"},
    "contact": {"load": "3 mN"},
    "drive": SCENES["slips"]["drive"],
    "bonds": STRETCHED,
    "sweep": {"drive.stage": ["2 mm/s", "3 mm/s", "5 mm/s", "10 mm/s"]},
}
#: Slide, hold for a second, slide.
HELD = LENS | {
    "clock": {"duration": "3 s", "step": "0.1 ms"},
    "adhesion": {"work": "42 mJ/m^2", "bond_share": 0.0},
    "drive": {
        "model": "spring",
        "stiffness": "1 kN/m",
        "contact_stiffness": "rigid",
        "stage": {
            "time": ["0 s", "0.5 s", "0.5 s", "1.5 s", "1.5 s", "3 s"],
            "value": ["3 um/s", "3 um/s", "0 m/s", "0 m/s", "3 um/s", "3 um/s"],
        },
    },
    "bonds": {
        "model": "rate",
        "rupture": {"model": "bell", "zero_force_rate": "1 1/s", "bell_force": "4 pN"},
        "bond_stiffness": "0.4 mN/m",
        "rebinding_rate": "1 1/s",
        "site_density": "1e16 1/m^2",
        "start": "steady",
    },
}

#: Relaxation cycles of bonds N0/(1 + V/Vc), damping 0.04, stiffness 1, speed 1, in units of 5 mN and 5 um.
FORCE, LENGTH, RECORD = 5e-3, 5e-6, 4e-3
STICKS, SLIPS, LEAST, MEAN = 0.64, 0.0546142733837, 0.36, 0.673327582372


@functools.cache
def cycles(duration=5.0):
    """Dataset of ``cycled``; do not change it."""
    return run(cycled(duration))


def cycled(duration=5.0):
    """A slider that sticks and slips, in units of FORCE, LENGTH and seconds."""
    area, stiff = scene(1).contact_area, FORCE / LENGTH
    bonds = Steady(critical_speed=LENGTH, stress=FORCE / area)
    drive = Spring(
        stage=LENGTH, stiffness=stiff, damping=0.04 * stiff, contact_stiffness="rigid"
    )
    same_area = Adhesion(work=42e-3, bond_share=0.0)
    return scene(
        2,
        clock=Clock(duration=duration, step=RECORD),
        drive=drive,
        bonds=bonds,
        adhesion=same_area,
    )


def detected(force, stage=1.0, slid=1.0, half=0.0):
    """Slip events of a spring force, a sample a second; the interface slips a share of the slider's advance."""
    force, speed = (
        np.asarray(force, float)[:, None],
        np.broadcast_to(stage, len(force)).astype(float)[:, None],
    )
    way = np.cumsum(speed, axis=0)
    position = way - force
    slip = slid * np.diff(position, axis=0, prepend=0.0)
    slider = force, position, slip, 2.0 * force, 3.0 * np.cumsum(np.abs(speed), axis=0)
    first = one = Slips.none(way[0] - speed[0])
    result = first.after(np.arange(1.0 * len(force)), (way, speed), slider, half)
    for k in range(len(force)):  # sample by sample
        one = one.after(
            np.arange(k, k + 1.0),
            (way[[k]], speed[[k]]),
            tuple(values[[k]] for values in slider),
            half,
        )
    assert all(
        np.array_equal(a, b, equal_nan=True) for a, b in zip(one, result, strict=True)
    )
    return result


def of(result, name):
    """A column of the slip events of the only member."""
    return result.column(name)[0, : int(result.total[0])]


def test_stick_slip_mean_force_statistics_and_tables_are_those_of_the_closed_cycle_to_a_record():
    result = read.slips(cycles())
    first, twice = 1.0, 2.0 * RECORD
    period, count = STICKS + SLIPS, 6
    assert result.sizes["slip"] == count and result["slip_time"].dims == (
        "member",
        "slip",
    )
    assert_allclose(
        result["slip_time"],
        np.tile(first + period * np.arange(count), (2, 1)),
        atol=twice,
        rtol=0,
    )
    assert_allclose(result["slip_duration"], SLIPS, atol=twice, rtol=0)
    assert_allclose(result["stick_duration"][:, :-1], STICKS, atol=twice, rtol=0)
    assert_allclose(result["recurrence_time"][:, :-1], period, atol=twice, rtol=0)
    assert np.isnan(result["recurrence_time"][:, -1]).all()
    # between a record and the next the stick loads the spring by K V dt, and no more
    force, drop = result["static_friction"] / FORCE, result["force_drop"] / FORCE
    assert np.all(force <= 1.0 + 1e-6) and np.all(force >= 1.0 - twice)
    assert np.all(drop <= 1.0 - LEAST + 1e-6) and np.all(
        drop >= 1.0 - LEAST - 2.0 * twice
    )
    # the body goes as far as the spring shortens and the stage moves on
    moved = drop + result["slip_duration"]
    assert_allclose(result["slip_amplitude"] / LENGTH, moved, rtol=1e-6)
    assert_allclose(result["slip_speed"], LENGTH, rtol=1e-14)
    result = read.stick_slip(cycles())
    begins = 1.0 + (STICKS + SLIPS) * np.arange(6)
    late = begins[begins >= 2.5]
    assert np.all(result["slip_count"] == late.size)
    # both ends lie within a record of their place in the cycle, where the force is at most 1
    error = 2.0 * RECORD / (late[-1] - late[0])
    assert_allclose(result["kinetic_friction"] / FORCE, MEAN, atol=error, rtol=0)
    assert_allclose(
        result["recurrence_time"],
        STICKS + SLIPS,
        atol=2.0 * RECORD / (late.size - 1),
        rtol=0,
    )
    result = read.statistics(cycles())
    assert_allclose(result["static_friction_mean"] / FORCE, 1.0, atol=2.0 * RECORD)
    assert result["static_friction_mean"].attrs["units"] == "N"
    (row,) = rows_of(cycles(), read.highlights)
    cells = {" ".join(heading.split()): cell for heading, cell in row.items()}
    assert cells["slips"].startswith("3") and cells["kinetic friction (mN)"].startswith(
        "3.3"
    )
    faster = cycles().assign(
        stage_speed=cycles()["stage_speed"] * (1.0 + cycles()["t"])
    )
    rows = rows_of(faster)
    (stage,) = (heading for heading in rows[0] if heading.startswith("stage"))
    # four digits are shown
    assert_allclose(float(rows[-1][stage]), 6.0 * float(rows[0][stage]), rtol=1e-3)
    assert not any(heading.startswith("stage") for heading in rows_of(cycles())[0])
    # kinetic friction would be a mean over speeds
    for dataset, is_shown in ((cycles(), True), (faster, False)):
        assert (
            any(
                heading.startswith("kinetic")
                for row in rows_of(dataset, read.highlights)
                for heading in row
            )
            is is_shown
        )


def test_the_mean_speed_is_that_of_the_way_and_without_slips_there_is_kinetic_friction_alone():
    result = read.distribution(cycles(10.0))
    for name, exact in (("speed", LENGTH), ("spring_force", MEAN * FORCE)):
        assert result[f"{name}_reason"] == "" and math.isnan(result[f"{name}_sem"])
        # whole cycles, of which each end is known to a record
        assert_allclose(
            result[f"{name}_mean"], exact, rtol=2.0 * RECORD / (6.0 * (STICKS + SLIPS))
        )
    few = read.distribution(cycles())  # of 3.6 cycles in the second half
    assert str(few["speed_reason"].item()).startswith("too short") and math.isnan(
        few["speed_low"]
    )
    area = scene(1).contact_area
    drive = Spring(stage=LENGTH, stiffness=1e3, damping=1.0, contact_stiffness="rigid")
    dataset = run(
        scene(
            1,
            steps=400,
            clock=Clock(duration=4.0, step=0.02),
            drive=drive,
            bonds=Unbroken(stress=FORCE / area),
        )
    )
    result = read.stick_slip(dataset)
    assert result["slip_count"].item() == 0.0 and math.isnan(
        result["static_friction"].item()
    )
    assert_allclose(result["kinetic_friction"], FORCE + LENGTH, rtol=1e-6)


def test_slip_events_of_a_saw_tooth_are_exact_in_the_sense_of_the_stage_and_none_is_of_a_reversal_or_a_rest():
    saw = np.tile([0.0, 1.0, 2.0, 3.0, 4.0, 1.0], 3)  # falls by three after each four
    for sense in (1.0, -1.0):
        result = detected(sense * saw, sense, half=9.0)
        assert_array_equal(of(result, "time"), [4.0, 10.0, 16.0][:2])
        assert_array_equal(of(result, "end"), [6.0, 12.0])
        assert_array_equal(of(result, "force_before"), 4.0)
        assert_array_equal(of(result, "force_after"), 0.0)
        # the stage moves two meanwhile
        assert_array_equal(of(result, "amplitude"), 6.0)
        assert_array_equal(of(result, "stress_before"), 8.0)
        assert_array_equal(of(result, "stress_after"), 0.0)
        # one late event, no recurrence
        assert_array_equal(result.late[0, :, 0], [1.0, 1.0, 1.0, 0.0])
    late = detected(saw, half=0.0)
    assert_allclose(late.late[0, :, 1], [4.0, 4.0, 6.0, 6.0], rtol=1e-14)
    assert_allclose(late.kinetic_friction(), 3.0, rtol=1e-14)
    turned = np.where(np.arange(18) < 9, 1.0, -1.0)
    # over the path of the stage
    assert_allclose(detected(saw, turned, half=3.0).kinetic_friction(), 3.0, rtol=1e-14)
    # there and back: the force falls from 3 to -3 as the stage turns, and nothing slips
    there_and_back = np.array([0.0, 1.0, 2.0, 3.0, 3.0, 1.0, -1.0, -3.0, -3.0, -2.0])
    assert detected(there_and_back, np.where(np.arange(10) < 5, 1.0, -1.0)).total == 0
    # as the stage rests the force relaxes, and after it the next event has no recurrence
    rest = np.array([0.0, 2.0, 4.0, 1.0, 2.0, 4.0, 2.0, 1.0, 1.0, 2.0, 4.0, 1.0, 2.0])
    result = detected(
        rest, np.where((np.arange(13) > 5) & (np.arange(13) < 9), 0.0, 1.0)
    )
    assert_array_equal(of(result, "time"), [2.0, 10.0])
    assert result.late[0, 3, 0] == 0.0


def test_a_slip_event_falls_by_three_tenths_of_the_largest_force_so_far_and_is_no_ringing():
    saw = np.array([0.0, 4.0, 1.0, 4.0, 2.7, 3.9, 2.9, 4.0, 1.0, 2.0])
    result = detected(saw)
    # 1.3 of 4 is more than 0.3, 1.1 is less
    assert_array_equal(of(result, "time"), [1.0, 3.0, 7.0])
    moments = result.late[0, LATE.index("force_drop")]
    assert_allclose(
        moments[1:],
        [np.mean([3, 1.3, 3]), 3 * np.var([3, 1.3, 3]), 1.3, 3.0],
        rtol=1e-13,
    )
    # an oscillator that rings upon an interface that sticks, or slips less than half as far
    rings = 4.0 + 2.0 * np.cos(np.arange(60.0)) * np.exp(-0.02 * np.arange(60.0))
    counts = [detected(rings, 0.01, slid=share).total[0] for share in (0.0, 0.49, 0.51)]
    assert counts == [0.0, 0.0, 6.0]  # falls of more than 0.3 of 6
    # a slip that lasts beyond the end of the run
    assert detected([0.0, 2.0, 4.0, 3.0, 2.0]).total == 0
    assert np.isnan(detected(np.arange(10.0)).kinetic_friction())
    assert_allclose(detected(np.ones(10)).kinetic_friction(), 3.0, rtol=1e-14)
    many = detected(np.tile([0.0, 4.0], 1101))
    assert (
        many.total == 1100
        and many.log.shape[1] == 1024
        and np.isfinite(many.column("time")[0]).sum() == 1000
    )


def test_a_stage_at_many_speeds_slips_between_two():
    times = np.array([[1.0, 3.0, 5.0, NAN], [2.0, 3.0, 4.0, 7.0]])
    made_up = {f"slip_{name}": (("member", "slip"), times) for name in SLIP.names}
    dataset = (
        cycles()
        .drop_dims("slip")
        .assign(made_up | {"slip_count": ("member", [3.0, 4.0])})
    )
    t = dataset["t"]
    up_and_down = dataset.assign(
        stage_speed=dataset["stage_speed"] * (1.0 + np.minimum(t, 5.0 - t))
    )
    names = {
        "phase_name": ("phase", ["increasing speed", "decreasing speed"]),
        "phase_end": ("phase", [2.5, 5.0]),
    }
    names["phase_start"] = ("phase", [0.0, 2.5])
    seldom = up_and_down.isel(t=[0, -1]).assign(names)
    for name in ("slips_from", "slips_down_to"):
        assert_array_equal(
            read.stick_slip(seldom)[name], read.stick_slip(up_and_down)[name]
        )
    result = read.stick_slip(up_and_down)
    assert_allclose(result["slip_count"], [3.0, 4.0])
    assert_allclose(result["slips_from"], [1.0, 2.0])
    assert_allclose(result["slips_down_to"], [3.0, 3.0])


def test_the_scene_of_slips_has_the_counts_of_its_hysteresis_whatever_the_records():
    """Own counts: falls of the spring force, on all clock steps, by 0.2 to 0.4 of its largest value."""
    scenes = (
        PULLED | {"clock": PULLED["clock"] | {"record": record}}
        for record in ("0.2 ms", "3.2 ms", "1.2 s")
    )
    results = [run(sim.Scenario(**scene)) for scene in scenes]
    for result in results:
        late = 0.5 * (result["slip_time"] + result["slip_end"]) > 0.4
        assert late.sum("slip").values.ravel().tolist() == [8, 9, 12, 15]
    for each in results[1:]:
        xr.testing.assert_identical(read.stick_slip(each), read.stick_slip(results[0]))


def test_slip_events_after_a_hold_are_told_apart_from_those_before_whatever_the_records():
    """Own run by the rate equation: forces at the first slip, after a hold of a second, and then every 196.9 ms."""
    dataset = run(sim.Scenario(**HELD))
    assert dataset["phase_name"].values.tolist() == ["sliding", "rest", "sliding"]
    each, result = (
        read.slips(dataset).isel(member=0),
        read.slips_by_phase(dataset).isel(member=0),
    )
    assert_allclose(
        1e6 * each["static_friction"], [1255.0, 1158.0, *[475.0] * 5], rtol=6e-4
    )
    assert_allclose(1e3 * each["recurrence_time"][2:-1], 196.9, atol=0.11)
    assert_array_equal(result["slip_count"], [1.0, 0.0, 6.0])
    assert_allclose(1e6 * result["first_friction"], [1255.0, NAN, 1158.0], rtol=6e-4)
    assert_array_equal(result["time_held"], [NAN, NAN, 1.0])
    rows = rows_of(dataset, read.phases)
    assert [row["first slip at (mN)"] for row in rows] == ["1.255", "–*", "1.158"]
    assert [row["held before (s)"] for row in rows] == ["–*", "–*", "1"]
    seldom = run(sim.Scenario(**HELD | {"clock": HELD["clock"] | {"record": "3 s"}}))
    xr.testing.assert_identical(
        read.slips_by_phase(seldom), read.slips_by_phase(dataset)
    )
    # it would be a mean over phases
    assert "static_friction" not in read.stick_slip(dataset)


def test_a_runaway_has_its_time_and_force_and_slips_of_other_drives_are_refused():
    # bonds that none rebinds under a rising force: who is strong enough is held to the end
    area = scene(1).contact_area
    rupture = Bell(zero_force_rate=1.0, bell_force=4e-12)
    bonds = FirstMoment(
        rupture, bond_stiffness=4e-4, rebinding_rate=1.0, site_density=1e15
    )
    force = 1e15 * 4e-12 * area
    ramp = {"time": [0.0, 1.0, 20.0], "value": [0.1 * force, 0.2 * force, 2.0 * force]}
    drive = Force(force=ramp, contact_stiffness="rigid")
    dataset = run(
        scene(2, clock=Clock(duration=12.0, step=0.1), drive=drive, bonds=bonds)
    )
    result = read.stick_slip(dataset)
    when = dataset["runaway_time"].isel(t=-1).values
    assert np.all(when > 1.0) and np.all(result["ran_away"] == 1.0)
    assert_allclose(result["runaway_after"], when, rtol=1e-14)
    assert_allclose(
        result["static_friction"], force * (0.2 + 1.8 * (when - 1.0) / 19.0), rtol=1e-12
    )
    # none after its end
    assert all("–" not in row.values() for row in rows_of(dataset)[-3:])
    held = run(scene(1, clock=Clock(duration=0.5, step=0.1), drive=drive, bonds=bonds))
    calm = read.stick_slip(held)
    assert calm["ran_away"].item() == 0.0 and np.isnan(calm["static_friction"]).all()
    cells = {
        " ".join(heading.split()): cell
        for heading, cell in rows_of(dataset, read.highlights)[0].items()
    }
    assert cells["lost stability, of members (%)"] == "100"
    assert not any(
        "lost stability" in heading
        for row in rows_of(held, read.highlights)
        for heading in row
    )
    with pytest.raises(ValueError, match="spring"):
        read.slips(dataset)
    assert not read.stick_slip(dataset.drop_vars("runaway_time"))


def test_statistics_alone_have_the_means_of_slip_events_over_the_members_that_slip():
    pooled, each = (
        run(replace(cycled(), record=Record(per_member=False))),
        read.stick_slip(cycles()),
    )
    with pytest.raises(ValueError, match="per_member"):
        read.slips(pooled)
    result = read.stick_slip(pooled)
    for name in (
        "slip_count",
        "static_friction",
        "recurrence_time_largest",
        "kinetic_friction",
    ):
        assert_allclose(result[f"{name}_mean"], each[name].mean(), rtol=1e-12)
        assert_allclose(
            result[f"{name}_sem"],
            each[name].std(ddof=1) / math.sqrt(2.0),
            rtol=1e-9,
            atol=1e-18,
        )
    values = np.array([[1.0, NAN], [2.0, NAN], [NAN, NAN]])
    groups = [moments(values[:1]), moments(values[1:]), moments(values[2:])]
    result = pooled_moments(groups)
    assert_array_equal(result["count"], [2.0, 0.0])
    assert_array_equal(result["mean"], [1.5, NAN])
    assert_allclose(result["sem"], [0.5, NAN], rtol=1e-14)


def test_a_settled_creep_without_noise_has_no_spread():
    assert (
        rows_of(
            run(scenario(20.0, 60, force(0.05), make=Cohort, members=1)), read.spread
        )
        == []
    )


def test_a_stage_that_jumps_between_speeds_has_no_onset_of_slips_and_no_end():
    stage = {
        "time": ["0 s", "0.6 s", "0.6 s", "1.2 s"],
        "value": ["3 mm/s", "3 mm/s", "8 mm/s", "8 mm/s"],
    }
    alone = {key: value for key, value in PULLED.items() if key != "sweep"}
    result = read.stick_slip(
        run(sim.Scenario(**alone | {"drive": PULLED["drive"] | {"stage": stage}}))
    )
    assert (
        result["slip_count"] > 10
        and np.isnan(result["slips_from"])
        and np.isnan(result["slips_down_to"])
    )


@pytest.mark.parametrize(("step", "is_named"), [("4 ms", True), ("0.5 ms", False)])
def test_slip_events_of_few_clock_steps_are_named_in_the_table(step, is_named):
    path = Path(sim.__file__).parents[1] / "scenarios" / "stick_slip.toml"
    dataset = run(
        sim.load(
            path, {"drive.stage": "5 mm/s", "clock.step": step, "clock.record": "20 ms"}
        )
    )
    lines = lines_of(dataset)
    assert (
        any("slip events last fewer than 3 clock steps" in line for line in lines)
        is is_named
    )
