"""Stick and slip read from a dataset: closed relaxation cycles, made-up forces, reversals, noise."""

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers.driven import force, scenario, spring
from helpers.parts import Adhesion, Bell, Clock, Force, Record, Spring, read, run
from helpers.printed import lines_of, rows_of
from helpers.scenes import SHEARS, scene
from helpers.statements import statistics, values_of
from numpy.testing import assert_allclose, assert_array_equal

import sim
from sim.ensemble.dataset import moments, pooled as pooled_moments
from sim.parts.bonds.models import Cohort, FirstMoment, Steady, Tracked, Unbroken
from sim.parts.events import Slips
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
    "sweep": {"drive.stage": ["1 mm/s", "2 mm/s", "3 mm/s", "5 mm/s"]},
}
#: A lens of PDMS with a mass of 50 g on bonds with cohorts.
MACHINE = {
    "solid": {"youngs_modulus": "1.8 MPa"},
    "sphere": {"radius": "9.42 mm"},
    "adhesion": {"work": "27 mJ/m^2"},
    "contact": {"load": "0.1 N"},
    "drive": {
        "model": "spring",
        "stiffness": "2000 N/m",
        "mass": "50 g",
        "damping": "1 N s/m",
    },
    "bonds": {
        "model": "cohort",
        "rupture": {
            "model": "bell",
            "bell_force": "4 pN",
            "critical_speed": "1 mm/s",
            "stress": "0.2 MPa",
        },
        "bond_stiffness": "0.8 uN/m",
        "rebinding_ratio": 10,
    },
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


def test_stick_slip_mean_force_statistics_and_tables_are_those_of_the_closed_cycle_to_a_record():
    result = read.slips(cycles())
    first, twice = 1.0, 2.0 * RECORD
    period, count = STICKS + SLIPS, 6
    assert result.sizes["slip"] == count and result["slip_time"].dims == ("slip",)
    assert_allclose(
        result["slip_time"],
        first + period * np.arange(count),
        atol=twice,
        rtol=0,
    )
    assert_allclose(result["slip_duration"], SLIPS, atol=twice, rtol=0)
    assert_allclose(result["stick_duration"][:-1], STICKS, atol=twice, rtol=0)
    assert_allclose(result["recurrence_time"][:-1], period, atol=twice, rtol=0)
    assert np.isnan(result["recurrence_time"][-1])
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
    result = values_of(read.stick_slip(cycles()))
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
    result = statistics(cycles())
    assert_allclose(result["static_friction"].value / FORCE, 1.0, atol=2.0 * RECORD)
    assert result["static_friction"].value.attrs["units"] == "N"
    (row,) = rows_of(cycles(), read.highlights)
    cells = {" ".join(heading.split()): cell for heading, cell in row.items()}
    assert cells["slips"].startswith("3") and cells["kinetic friction (mN)"].startswith(
        "3.3"
    )
    # nothing is random, so that the only error of a mean over slip events is that of the clock step
    with_errors = [cell for cell in cells.values() if "(" in cell]
    assert with_errors and all("(step)" in cell for cell in with_errors)
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
        assert result[name].reason == "" and math.isnan(result[name].sem)
        # whole cycles, of which each end is known to a record
        assert_allclose(
            result[name].value, exact, rtol=2.0 * RECORD / (6.0 * (STICKS + SLIPS))
        )
    few = read.distribution(cycles())  # of 3.6 cycles in the second half
    assert str(few["speed"].reason.item()).startswith("too short") and math.isnan(
        few["speed"].low
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
    result = values_of(read.stick_slip(dataset))
    assert result["slip_count"].item() == 0.0 and math.isnan(
        result["static_friction"].item()
    )
    assert_allclose(result["kinetic_friction"], FORCE + LENGTH, rtol=1e-6)


def episodes(dataset, factor):
    """Own detector on dense records of a stage at one speed: starts, ends, and largest forces before.

    An episode between two samples at which the slider is slower than the stage counts if the slider is anywhere faster
    than ``factor`` stages, if the force falls by 0.3 of the largest one since the episode before, and if the slider
    went back before by less than half of its advance.
    """
    position, force = dataset["slider_position"].values, dataset["spring_force"].values
    way = dataset["stage_position"].values
    ratio = np.diff(position) / np.diff(way)
    bounds = np.flatnonzero(np.diff(np.r_[False, ratio > 1.0, False]))
    result, last, stick = [], 0, 0
    for start, stop in bounds.reshape(-1, 2):
        back, stick = position[stick] - position[start], stop
        if ratio[start:stop].max() <= factor:
            continue
        fast = max(start, start + int(np.argmax(ratio[start:stop] > factor)) - 1)
        back += position[start] - position[fast]
        top, advance = force[last : fast + 1].max(), position[stop] - position[fast]
        if force[fast] - force[stop] >= 0.3 * abs(top) and 2.0 * back <= advance:
            result.append((fast, stop, top))
            last = stop
    return result


@functools.cache
def pulled():
    """Dataset of ``PULLED`` at each clock step; do not change it."""
    return run(sim.Scenario(**PULLED | {"record": {"precision": "float64"}}))


def test_slip_events_are_those_of_an_own_detector_and_as_many_for_a_slider_3_10_or_30_times_as_fast():
    """The slider oscillates after each event: there are up to nine times as many episodes faster than three stages."""
    counts = []
    for place in range(pulled().sizes["drive_stage"]):
        each = pulled().isel(drive_stage=place)
        samples = [
            each[name].values[1:, np.newaxis]
            for name in (
                "stage_position",
                "stage_speed",
                "spring_force",
                "slider_position",
                "shear_stress",
                "drive_work",
            )
        ]
        start = Slips.none(each["stage_position"].values[:1])
        for factor in (3.0, 10.0, 30.0):
            own = episodes(each, factor)
            slips = start.after(each["t"].values[1:], np.stack(samples), 0.6, factor)
            assert int(slips.total[0]) == len(own)
            counts.append(len(own))
        own, time = episodes(each, 10.0), each["t"].values
        begins, ends, tops = (
            (np.array(column) for column in zip(*own, strict=True))
            if own
            else 3 * [np.empty(0, int)]
        )
        known = each["slip_time"].notnull().values
        assert_allclose(each["slip_time"].values[known], time[begins], rtol=1e-12)
        assert_allclose(each["slip_end"].values[known], time[ends], rtol=1e-12)
        assert_allclose(each["slip_force_before"].values[known], tops, rtol=1e-12)
    assert counts == [0, 0, 0, 8, 8, 8, 13, 13, 13, 21, 21, 21]


@pytest.mark.parametrize(
    ("stiffness", "duration", "least"), [(1.0, 2.0, 0), (0.015, 20.0, 6)]
)
def test_a_slider_that_jumps_at_each_rupture_slips_where_its_bonds_break_together(
    stiffness, duration, least
):
    """Of 100 bonds followed one by one each jumps ahead; behind a stiff spring they do so one after the other."""
    make = functools.partial(Tracked, sites=100)
    drive, steps = spring(stiffness), round(duration / 2e-3)
    dataset = run(
        replace(
            scenario(duration, steps, drive, make=make),
            record=Record(precision="float64"),
        )
    ).isel(member=0)
    ratios = np.diff(dataset["slider_position"]) / np.diff(dataset["stage_position"])
    assert ratios.max() > 3.0
    counts = [len(episodes(dataset, factor)) for factor in (3.0, 10.0)]
    assert counts[0] == counts[1] == dataset["slip_count"].item()
    assert (counts[0] >= least) if least else (counts[0] == 0)


@pytest.mark.parametrize(("mass", "is_named"), [("5 g", True), ("50 mg", False)])
def test_a_force_that_falls_while_the_slider_is_hardly_faster_than_the_stage_is_named(
    mass, is_named
):
    """A heavy body swings: the force falls to nearly nothing, at five times the speed of the stage at most."""
    drive = PULLED["drive"] | {"stage": "3 mm/s", "mass": mass}
    scene = {key: PULLED[key] for key in PULLED if key != "sweep"}
    dataset = run(sim.Scenario(**scene | {"drive": drive}))
    assert bool(dataset["slip_count"].item() > 10.0) is not is_named
    assert bool(dataset["slow_fall_count"].item() > 10.0) is is_named
    lines = lines_of(dataset)
    assert any("is no slip event" in line for line in lines) is is_named


def test_falls_that_are_no_slip_events_are_named_with_their_number_and_their_points():
    drive = PULLED["drive"] | {"stage": "3 mm/s"}
    sweep = {"drive.mass": ["5 g", "50 mg"]}
    dataset = run(sim.Scenario(**PULLED | {"drive": drive, "sweep": sweep}))
    (line,) = {line for line in lines_of(dataset) if "this is no slip event" in line}
    number = int(dataset["slow_fall_count"].max())
    assert int(dataset["slow_fall_count"].min()) == 0
    assert line.startswith(f"{number} times the spring force")
    assert line.endswith("(at drive_mass = 0.005 kg)")
    heavy = dataset.isel(drive_mass=0)
    (line,) = {line for line in lines_of(heavy) if "this is no slip event" in line}
    assert (
        line.startswith(f"{number} times the spring force") and "at drive" not in line
    )


@pytest.mark.parametrize("record", ["3.2 ms", "1.2 s"])
def test_the_records_of_a_run_do_not_change_its_slip_events(record):
    clock = PULLED["clock"] | {"record": record}
    seldom = run(sim.Scenario(**PULLED | {"clock": clock}))
    xr.testing.assert_identical(
        values_of(read.stick_slip(seldom)), values_of(read.stick_slip(pulled()))
    )


def machine(duration, **drive):
    """A machine whose linear theory has the onset of stick-slip at 0.51 mm/s."""
    return sim.Scenario(
        **MACHINE
        | {
            "clock": {"duration": duration, "step": "1 ms", "record": "10 ms"},
            "drive": MACHINE["drive"] | drive,
        }
    )


@pytest.mark.parametrize(
    ("stage", "count"), [("0.48 mm/s", 0), ("0.5 mm/s", 0), ("0.52 mm/s", 8)]
)
def test_the_slow_fall_of_friction_beyond_its_maximum_is_no_slip_event(stage, count):
    dataset = run(machine("6 s", stage=stage))
    force = dataset["spring_force"].values
    assert force.max() > 1.02 * force[-1]
    events = values_of(read.events(dataset))
    assert dataset["slip_count"].item() == count
    # friction falls from its first maximum in all of them
    assert_allclose(events["static_threshold"], 0.3227, rtol=5e-3)


def test_the_static_threshold_of_a_ramp_is_the_first_maximum_and_the_onset_lies_between_two_speeds_of_the_stage():
    """The force later rises to half as much again before slip events at higher speeds."""
    stage = {"from": "0.1 mm/s", "to": "2 mm/s", "scale": "log"}
    dataset = run(machine("8.67 s", stage=stage))
    events = values_of(read.events(dataset))
    assert_allclose(events["static_threshold"], 0.3129, rtol=1e-3)
    assert dataset["peak_friction"] > 1.2 * events["static_threshold"]
    first, second = dataset["slip_time"].values[:2]
    speeds = 1e-4 * 20.0 ** (np.array([2.0 * first - second, first]) / 8.67)
    onset = [events["onset_steady_speed"], events["onset_slip_speed"]]
    assert_allclose(onset, speeds, rtol=1e-9)
    assert 0.51e-3 < speeds[0] < speeds[1] < 1e-3
    # the stage does not get slower
    assert np.isnan(events["end_slip_speed"]) and np.isnan(events["end_steady_speed"])
    named = {row[""] for row in read.tables.key_figures(read.Run(dataset))}
    assert "slips from" in named and "slips down to" not in named


@pytest.mark.parametrize("hold", [False, True])
def test_a_stage_that_gets_faster_and_slower_has_an_onset_and_an_end_of_slips_unless_they_last(
    hold,
):
    fastest = "3 mm/s"
    ends = ["3 mm/s", "3 mm/s"] if hold else ["1 mm/s", "1 mm/s"]
    times, values = ["0 s", "1 s", "2 s", "2.4 s"], ["1 mm/s", fastest, *ends]
    drive = PULLED["drive"] | {"stage": {"time": times, "value": values}}
    clock = PULLED["clock"] | {"duration": "2.4 s"}
    scene = {key: PULLED[key] for key in PULLED if key != "sweep"}
    dataset = run(sim.Scenario(**scene | {"drive": drive, "clock": clock}))
    result = values_of(read.stick_slip(dataset))
    time = dataset["slip_time"].values
    before = 1.0 + 2.0 * np.array([2.0 * time[0] - time[1], time[0]])
    onset = [result["onset_steady_speed"], result["onset_slip_speed"]]
    assert_allclose(1e3 * np.array(onset), before, rtol=1e-9)
    last = np.array([time[-1], 2.0 * time[-1] - time[-2]])
    end = np.array([result["end_slip_speed"], result["end_steady_speed"]])
    if hold:
        assert np.isnan(end).all()
    else:
        assert 1.0 < time[-1] < 2.0
        assert_allclose(1e3 * end, 3.0 - 2.0 * (last - 1.0), rtol=1e-9)


def test_slips_that_begin_at_the_start_of_a_ramp_have_no_onset():
    drive = PULLED["drive"] | {"stage": {"from": "3 mm/s", "to": "5 mm/s"}}
    scene = {key: PULLED[key] for key in PULLED if key != "sweep"}
    result = values_of(read.stick_slip(run(sim.Scenario(**scene | {"drive": drive}))))
    assert result["slip_count"] > 10 and np.isnan(result["onset_slip_speed"])


def test_slip_events_and_peaks_after_a_hold_are_told_apart_from_those_before_whatever_the_records():
    """Own run by the rate equation: forces at the first slip, after a hold of a second, and then every 196.9 ms."""
    dataset = run(sim.Scenario(**HELD))
    assert dataset["phase_name"].values.tolist() == ["sliding", "rest", "sliding"]
    each, result = read.slips(dataset), read.slips_by_phase(dataset)
    assert_allclose(
        1e6 * each["static_friction"], [1255.0, 1158.0, *[475.0] * 5], rtol=6e-4
    )
    assert_allclose(1e3 * each["recurrence_time"][2:-1], 196.9, atol=0.11)
    assert_array_equal(result["slip_count"], [1.0, 0.0, 6.0])
    peaks = read.peaks_after_holds(dataset)
    assert_allclose(1e6 * peaks["peak_after_hold"], [NAN, NAN, 1158.0], rtol=6e-4)
    assert_array_equal(peaks["time_held"], [NAN, NAN, 1.0])
    assert_allclose(1e6 * dataset["static_threshold"], 1255.0, rtol=6e-4)
    rows = rows_of(dataset, read.phases)
    cells = [row["peak after the hold (mN)"] for row in rows]
    assert cells == ["–*", "–*", "1.158"]
    assert [row["held before (s)"] for row in rows] == ["–*", "–*", "1"]
    seldom = run(sim.Scenario(**HELD | {"clock": HELD["clock"] | {"record": "3 s"}}))
    for of in (read.slips_by_phase, read.peaks_after_holds):
        xr.testing.assert_identical(of(seldom), of(dataset))
    # it would be a mean over phases
    assert "static_friction" not in values_of(read.stick_slip(dataset))


@pytest.mark.parametrize("jump", [0.8, 0.80005, 0.80015])
@pytest.mark.parametrize("step", [2e-4, 5e-5])
def test_a_slip_that_the_jump_of_a_load_sets_off_is_in_the_phase_that_it_begins(
    jump, step
):
    """At a constant load there is no slip event; the jump to a quarter of it sets one off at once."""
    load = {"time": [0.0, jump, jump, 1.8], "value": [4e-3, 4e-3, 1e-3, 1e-3]}
    bonds = {
        "model": "cohort",
        "rupture": {"model": "bell", "zero_force_rate": 25.0, "bell_force": 4e-12},
        "bond_stiffness": 8e-7,
        "rebinding_rate": 250.0,
        "site_density": 6.5e16,
    }
    scenario = {
        "clock": {"duration": 1.8, "step": step, "record": 0.01},
        "solid": {"shear_modulus": 1.6e6},
        "sphere": {"radius": 2e-3},
        "adhesion": {"work": 42e-3},
        "contact": {"load": load},
        "drive": {"model": "spring", "stage": 2e-4, "stiffness": 500.0},
        "bonds": bonds,
    }
    dataset = sim.run(scenario)
    assert_allclose(dataset["phase_start"], [0.0, jump], rtol=1e-12)
    assert_allclose(dataset["slip_time"], jump, atol=2.0 * step)
    assert_array_equal(read.slips_by_phase(dataset)["slip_count"], [0.0, 1.0])
    held = sim.run(scenario | {"contact": {"load": 4e-3}})
    assert float(held["slip_count"]) == 0.0


@pytest.mark.parametrize(("length", "settles"), [("0.05 s", False), ("2.4 s", True)])
def test_the_kinetic_friction_is_that_of_steady_sliding_and_absent_while_the_spring_extends(
    length, settles
):
    clock = PULLED["clock"] | {"duration": length}
    scene = {key: PULLED[key] for key in PULLED if key != "sweep"}
    drive = PULLED["drive"] | {"stage": "1 mm/s"}
    dataset = run(sim.Scenario(**scene | {"drive": drive, "clock": clock}))
    friction = read.stick_slip(dataset)["kinetic_friction"]
    if settles:
        force = dataset["spring_force"].values[-1]
        assert_allclose(friction.value, force, rtol=1e-4)
        assert friction.reason == ""
    else:
        assert np.isnan(friction.value)
        assert friction.reason == "not settled"


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
    result = values_of(read.stick_slip(dataset))
    when = dataset["runaway_time"].isel(t=-1).values
    assert np.all(when > 1.0) and np.all(result["ran_away"] == 1.0)
    assert_allclose(result["runaway_after"], when, rtol=1e-14)
    assert_allclose(
        result["static_friction"], force * (0.2 + 1.8 * (when - 1.0) / 19.0), rtol=1e-12
    )
    # none after its end
    assert all("–" not in row.values() for row in rows_of(dataset)[-3:])
    ended = dataset["t"] > when.max()
    for name in ("fraction_detached", "fraction_masked"):
        shares = read.Run(dataset).statistic(name)
        missing = shares.sel(statistic="mean").isnull()
        assert bool(ended.any()) and bool((missing == ended).all())
    held = run(scene(1, clock=Clock(duration=0.5, step=0.1), drive=drive, bonds=bonds))
    calm = values_of(read.stick_slip(held))
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
    assert not values_of(read.stick_slip(dataset.drop_vars("runaway_time")))


def test_statistics_alone_have_the_means_of_slip_events_over_the_members_that_slip():
    # a field that the contact does not feel: members are random, and have equal slips
    field = replace(SHEARS["modal, time, constant"], paid_by_adhesion=0.0)
    noisy = replace(cycled(), shear=field)
    pooled = run(replace(noisy, record=Record(per_member=False)))
    each = values_of(read.stick_slip(run(noisy)))
    with pytest.raises(ValueError, match="per_member"):
        read.slips(pooled)
    result = read.Run(pooled).events
    for name in (
        "slip_count",
        "static_friction",
        "recurrence_time_largest",
        "kinetic_friction",
    ):
        assert_allclose(result[name].value, each[name].mean(), rtol=1e-12)
        assert_allclose(
            result[name].sem,
            each[name].std(ddof=1) / math.sqrt(2.0),
            rtol=1e-9,
            atol=1e-18,
        )
    values = np.array([[1.0, NAN], [2.0, NAN], [NAN, NAN]])
    groups = [moments(values[:1]), moments(values[1:]), moments(values[2:])]
    mean, _, error, count = pooled_moments(groups)
    assert_array_equal(count, [2.0, 0.0])
    assert_array_equal(mean, [1.5, NAN])
    assert_allclose(error, [0.5, NAN], rtol=1e-14)


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
    result = values_of(
        read.stick_slip(
            run(sim.Scenario(**alone | {"drive": PULLED["drive"] | {"stage": stage}}))
        )
    )
    assert result["slip_count"] > 10 and list(result) == ["slip_count"]


@pytest.mark.parametrize(("step", "is_named"), [("4 ms", True), ("0.5 ms", False)])
def test_slip_events_of_few_clock_steps_are_named_in_the_table(step, is_named):
    path = Path(sim.__file__).parents[1] / "scenarios" / "stick_slip.toml"
    dataset = run(
        sim.load(
            path, {"drive.stage": "5 mm/s", "clock.step": step, "clock.record": "20 ms"}
        )
    )
    lines = lines_of(dataset)
    assert any("of a slip event in a clock step" in line for line in lines) is is_named


def test_the_time_of_a_loss_of_stability_is_no_mean_over_the_members_that_happened_to_lose_it():
    times = np.array([[np.nan, 1.0], [np.nan, 3.0], [np.nan, np.nan]])
    members = xr.Dataset(
        {
            "runaway_time": (("member", "t"), times),
            "runaway_force": ("member", np.where(np.isnan(times[:, 1]), np.nan, 2.0)),
        }
    )
    members = members.assign(spring_force=0.0)
    all_of_them = values_of(read.stick_slip(members.isel(member=slice(2))))
    assert all_of_them["runaway_after"].mean() == 2.0
    found = read.stick_slip(members)
    some = values_of(found)
    assert some["ran_away"].mean() == 2.0 / 3.0
    assert (
        some["runaway_after"].isnull().all() and some["static_friction"].isnull().all()
    )
    assert found["runaway_after"].reason == "not every member loses stability"
