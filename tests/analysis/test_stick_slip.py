"""Stick and slip read from a dataset: closed relaxation cycles, made-up forces, reversals, noise."""

import functools
import math

import numpy as np
import pytest
import xarray as xr
from helpers.parts import Adhesion, Bell, Clock, Force, Spring, analysis, run
from helpers.scenes import scene
from numpy.testing import assert_allclose

from sim.parts.bonds import FirstMoment, Steady, Unbroken

#: Relaxation cycles of bonds N0/(1 + V/Vc), damping 0.04, stiffness 1, speed 1, in units of 5 mN and 5 um.
FORCE, LENGTH, RECORD = 5e-3, 5e-6, 4e-3
STICKS, SLIPS, LEAST, MEAN = 0.64, 0.0546142733837, 0.36, 0.673327582372


@functools.cache
def cycles():
    """A slider that sticks and slips, in units of FORCE, LENGTH and seconds; do not change it."""
    area, stiff = scene(1).contact_area, FORCE / LENGTH
    bonds = Steady(critical_speed=LENGTH, stress=FORCE / area)
    drive = Spring(stage=LENGTH, stiffness=stiff, damping=0.04 * stiff, contact_stiffness="rigid")
    same_area = Adhesion(work=42e-3, bond_share=0.0)
    return run(scene(2, clock=Clock(duration=5.0, step=RECORD), drive=drive, bonds=bonds, adhesion=same_area))


def with_force(force, stage=1.0, step=1.0):
    """A dataset of one member with this force of the spring and speed of the stage."""
    dataset = cycles().isel(t=slice(0, len(force)), member=slice(0, 1))
    force, stage = np.asarray(force, float), np.broadcast_to(stage, len(force)).astype(float)
    way = np.concatenate([[0.0], np.cumsum(stage[1:])]) * step
    series = {"spring_force": force, "stage_speed": stage, "stage_position": way, "slider_position": way - force}
    series |= {"shear_stress": 2.0 * force, "drive_work": 0.0 * force}
    dataset = dataset.assign_coords(t=step * np.arange(len(force)))
    return dataset.assign({name: (("member", "t"), values[np.newaxis]) for name, values in series.items()})


def test_stick_slip_mean_force_statistics_and_tables_are_those_of_the_closed_cycle_to_a_record():
    result = analysis.slips(cycles())
    first, twice = 1.0, 2.0 * RECORD
    period, count = STICKS + SLIPS, 6
    assert result.sizes["slip"] == count and result["slip_time"].dims == ("member", "slip")
    assert_allclose(result["slip_time"], np.tile(first + period * np.arange(count), (2, 1)), atol=twice, rtol=0)
    assert_allclose(result["slip_duration"], SLIPS, atol=twice, rtol=0)
    assert_allclose(result["stick_duration"][:, :-1], STICKS, atol=twice, rtol=0)
    assert_allclose(result["recurrence_time"][:, :-1], period, atol=twice, rtol=0)
    assert np.isnan(result["recurrence_time"][:, -1]).all()
    # between a record and the next the stick loads the spring by K V dt, and no more
    force, drop = result["static_friction"] / FORCE, result["force_drop"] / FORCE
    assert np.all(force <= 1.0 + 1e-6) and np.all(force >= 1.0 - twice)
    assert np.all(drop <= 1.0 - LEAST + 1e-6) and np.all(drop >= 1.0 - LEAST - 2.0 * twice)
    # the body goes as far as the spring shortens and the stage moves on
    moved = drop + result["slip_duration"]
    assert_allclose(result["slip_amplitude"] / LENGTH, moved, rtol=1e-6)
    assert_allclose(result["slip_speed"], LENGTH, rtol=1e-14)
    result = analysis.stick_slip(cycles())
    begins = 1.0 + (STICKS + SLIPS) * np.arange(6)
    late = begins[begins >= 2.5]
    assert np.all(result["slip_count"] == late.size)
    # both ends lie within a record of their place in the cycle, where the force is at most 1
    error = 2.0 * RECORD / (late[-1] - late[0])
    assert_allclose(result["kinetic_friction"] / FORCE, MEAN, atol=error, rtol=0)
    assert_allclose(result["recurrence_time"], STICKS + SLIPS, atol=2.0 * RECORD / (late.size - 1), rtol=0)
    result = analysis.statistics(cycles())
    assert_allclose(result["static_friction_mean"] / FORCE, 1.0, atol=2.0 * RECORD)
    assert result["static_friction_mean"].attrs["units"] == "N"
    (row,) = analysis.highlights(cycles())
    cells = {" ".join(heading.split()): cell for heading, cell in row.items()}
    assert cells["slips"].startswith("3") and cells["kinetic friction (mN)"].startswith("3.3")
    faster = cycles().assign(stage_speed=cycles()["stage_speed"] * (1.0 + cycles()["t"]))
    rows = analysis.table(faster)
    (stage,) = (heading for heading in rows[0] if heading.startswith("stage"))
    assert_allclose(float(rows[-1][stage]), 6.0 * float(rows[0][stage]), rtol=1e-3)  # four digits are shown
    assert not any(heading.startswith("stage") for heading in analysis.table(cycles())[0])
    for dataset, is_shown in ((cycles(), True), (faster, False)):  # kinetic friction would be a mean over speeds
        assert any(heading.startswith("kinetic") for row in analysis.highlights(dataset) for heading in row) is is_shown


def test_the_mean_speed_is_that_of_the_way_and_without_slips_there_is_kinetic_friction_alone():
    dataset = cycles().isel(t=slice(0, None, 20))
    result = analysis.distribution(dataset)
    way, t = dataset["slider_position"], dataset["t"]
    late = t.size // 2
    exact = ((way[:, -1] - way[:, late]) / (t[-1] - t[late])).mean()
    assert_allclose(result["speed_mean"], exact, rtol=1e-12)
    assert result["speed_low"] < LENGTH < result["speed_high"]
    area = scene(1).contact_area
    drive = Spring(stage=LENGTH, stiffness=1e3, damping=1.0, contact_stiffness="rigid")
    dataset = run(scene(1, steps=400, clock=Clock(duration=4.0, step=0.02), drive=drive,
                        bonds=Unbroken(stress=FORCE / area)))  # fmt: skip
    result = analysis.stick_slip(dataset)
    assert result["slip_count"].item() == 0.0 and math.isnan(result["static_friction"].item())
    assert_allclose(result["kinetic_friction"], FORCE + LENGTH, rtol=1e-6)


def test_slips_follow_the_sense_of_the_stage_and_their_sizes_are_shared_out_over_all_members():
    saw = np.tile([0.0, 1.0, 2.0, 3.0, 4.0, 1.0], 3)  # falls by three after each four
    for sense in (1.0, -1.0):
        result = analysis.slips(with_force(sense * saw, sense))
        assert_allclose(result["force_drop"], [[4.0, 4.0]], rtol=1e-14)
        assert_allclose(result["static_friction"], 4.0, rtol=1e-14)
        assert_allclose(result["slip_amplitude"], 6.0, rtol=1e-14)  # the stage moves two meanwhile
        assert_allclose(result["stress_drop"], 8.0, rtol=1e-14)
    turned = with_force(saw, np.where(np.arange(18) < 9, 1.0, -1.0))
    result = analysis.stick_slip(turned.assign(drive_work=("t", 3.0 * np.arange(18.0))))
    assert_allclose(result["kinetic_friction"], 3.0, rtol=1e-14)  # over the path of the stage, not over its way
    # there and back: the force falls from 3 to -3 as the stage turns, and nothing slips
    there_and_back = np.array([0.0, 1.0, 2.0, 3.0, 3.0, 1.0, -1.0, -3.0, -3.0])
    assert analysis.slips(with_force(there_and_back, np.where(np.arange(9) < 5, 1.0, -1.0))).sizes["slip"] == 0
    saw = np.array([0.0, 4.0, 1.0, 4.0, 2.0, 4.0, 3.0, 4.0, 1.0, 2.0])
    forward, backward = (
        with_force(sense * saw, sense * np.linspace(1.0, 1.1, 10)) for sense in (1.0, -1.0)
    )  # no slip is left out
    how = {"data_vars": "minimal", "coords": "minimal", "compat": "override", "join": "override"}
    members = xr.concat([forward, backward], "member", **how)
    result = analysis.slip_sizes(members, "force_drop")
    assert_allclose(result["force_drop"], np.repeat([1.0, 2.0, 3.0], [2, 2, 4]), rtol=1e-14)
    assert_allclose(result["share_as_large"], 1.0 - np.arange(8) / 8.0, rtol=1e-14)
    amplitude = analysis.slips(forward)["slip_amplitude"][0]
    spread = analysis.stick_slip(forward)["slip_spread"]
    assert_allclose(spread, np.std(amplitude, ddof=1) / np.mean(amplitude), rtol=1e-12)
    assert math.isnan(analysis.stick_slip(with_force(saw[:4]))["slip_spread"].item())  # of one slip
    cells = [cell for cell in analysis.highlights(cycles())[0] if cell.startswith("spread")]
    assert len(cells) == 1


def test_what_is_a_slip_falls_by_the_least_after_its_last_maximum_without_ringing():
    slow = [0.0, 2.0, *np.linspace(4.0, 3.6, 9), 3.65]
    up = np.array([*slow, 1.0, 2.0, 4.0, 1.0, 2.0])
    first = analysis.slips(with_force(up)).isel(member=0, slip=0)
    begins = [float(first[name]) for name in ("slip_time", "static_friction", "force_drop")]
    assert_allclose(begins, [11.0, 3.65, 2.65], rtol=1e-12)
    speed = np.linspace(1.0, 1.1, len(up))
    back = slice(-2, None, -1)
    up_and_down = with_force(np.append(up, [*up[[14, 15, 13, 14, 15, 16]], 2.1]), np.append(speed, speed[back][:7]))
    result, slips = analysis.stick_slip(up_and_down), analysis.slips(up_and_down).isel(member=0)
    assert slips.sizes["slip"] == 4
    assert_allclose(result["slips_from"], speed[11], rtol=1e-14)
    assert_allclose(result["slips_down_to"], slips["slip_speed"][-1], rtol=1e-14)
    lone = analysis.stick_slip(with_force(up[:14], speed[:14]))
    assert lone["slip_count"].item() == 1.0 and np.isnan(lone["slips_from"]).all()  # friction beyond its maximum
    assert "slips_from" not in analysis.stick_slip(with_force(up))
    saw = np.array([0.0, 2.0, 4.0, 3.95, 4.0, 3.0, 4.0, 3.5, 4.2])
    assert analysis.slips(with_force(saw, 0.01)).sizes["slip"] == 2
    assert analysis.slips(with_force(saw, 0.01), least=0.01).sizes["slip"] == 3
    assert analysis.slips(with_force(saw, 0.01), least=0.2).sizes["slip"] == 1
    # a slip that lasts beyond the end of the run is not counted
    assert analysis.slips(with_force([0.0, 2.0, 4.0, 3.0, 2.0])).sizes["slip"] == 0
    assert np.isnan(analysis.stick_slip(with_force(np.arange(10.0)))["kinetic_friction"]).all()
    assert np.all(analysis.stick_slip(with_force(np.ones(10)))["kinetic_friction"] == 0.0)  # at no work of the stage
    saw = np.array([0.0, 2.0, 4.0, 3.0, 2.0, 3.0, 4.0, 3.0, 2.0, 3.0])
    assert analysis.slips(with_force(saw)).sizes["slip"] == 2  # the slider goes twice as far as the stage
    assert analysis.slips(with_force(saw, 1.6)).sizes["slip"] == 0  # 1.625 times, less than 1 + 2/pi
    # upon an interface that sticks the force falls while the body's swing loads the bonds
    rings = with_force(saw).assign(shear_stress=(("member", "t"), -saw[np.newaxis]))
    assert analysis.slips(rings).sizes["slip"] == 0


def test_a_runaway_has_its_time_and_force_and_slips_of_other_drives_are_refused():
    # bonds that none rebinds under a rising force: who is strong enough is held to the end
    area = scene(1).contact_area
    rupture = Bell(zero_force_rate=1.0, bell_force=4e-12)
    bonds = FirstMoment(rupture, bond_stiffness=4e-4, rebinding_rate=1.0, site_density=1e15)
    force = 1e15 * 4e-12 * area
    ramp = {"time": [0.0, 1.0, 20.0], "value": [0.1 * force, 0.2 * force, 2.0 * force]}
    drive = Force(force=ramp, contact_stiffness="rigid")
    dataset = run(scene(2, clock=Clock(duration=12.0, step=0.1), drive=drive, bonds=bonds))
    result = analysis.stick_slip(dataset)
    when = dataset["runaway_time"].isel(t=-1).values
    assert np.all(when > 1.0) and np.all(result["ran_away"] == 1.0)
    assert_allclose(result["runaway_after"], when, rtol=1e-14)
    assert_allclose(result["static_friction"], force * (0.2 + 1.8 * (when - 1.0) / 19.0), rtol=1e-9)
    assert all("–" not in row.values() for row in analysis.table(dataset)[-3:])  # none after its end
    held = run(scene(1, clock=Clock(duration=0.5, step=0.1), drive=drive, bonds=bonds))
    calm = analysis.stick_slip(held)
    assert calm["ran_away"].item() == 0.0 and np.isnan(calm["static_friction"]).all()
    cells = {" ".join(heading.split()): cell for heading, cell in analysis.highlights(dataset)[0].items()}
    assert cells["ran away, of members (%)"] == "100"
    assert not any("ran away" in heading for row in analysis.highlights(held) for heading in row)
    dataset = cycles().drop_vars(["stage_speed", "runaway_time"])
    with pytest.raises(ValueError, match="spring"):
        analysis.slips(dataset)
    assert not analysis.stick_slip(dataset)
    with pytest.raises(ValueError, match="per_member"):
        analysis.slips(cycles().rename(stage_speed="stage_speed_mean"))
