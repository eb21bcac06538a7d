"""Slip events of made-up motions: saw-teeth, slow falls, oscillations, ruptures, stages that slow down or turn."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from sim.parts.events import LATE, Slips

#: A cycle of 40 s, with a slip of 34 to 36 path lengths of the stage in its last two.
PERIOD = 40
FACTORS = (3.0, 10.0, 30.0)


def detected(stage, slider, half=0.0, factor=10.0):
    """Slip events of positions at each second behind a spring of 1 N/m; the stress is twice the force."""
    stage, slider = (
        np.asarray(values, float)[:, np.newaxis] for values in (stage, slider)
    )
    force, speed = stage - slider, np.diff(stage, axis=0, prepend=stage[:1])
    work = np.cumsum(force * speed, axis=0)
    samples = np.stack([stage, speed, force, slider, 2.0 * force, work])
    samples = np.ascontiguousarray(samples[:, 1:])
    times = np.arange(1.0, len(stage))
    first = one = Slips.none(stage[0])
    result = first.after(times, samples, half, factor)
    for k in range(len(times)):  # sample by sample
        block = np.ascontiguousarray(samples[:, k : k + 1])
        one = one.after(times[k : k + 1], block, half, factor)
    for each, whole in zip(one, result, strict=True):
        assert_array_equal(each, whole)
    return result


def of(result, name):
    """A column of the slip events of the only member."""
    return result.column(name)[0, : int(result.total[0])]


def saw_tooth(cycles, slip=36.0):
    """Positions of a stage at unit speed, and of a slider that slips once in a cycle and else sticks."""
    stage = np.arange(1.0 + PERIOD * cycles)
    return stage, slip * np.floor(stage / PERIOD)


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("factor", FACTORS)
def test_slip_events_of_a_saw_tooth_are_exact_in_the_sense_of_the_stage(sense, factor):
    stage, slider = saw_tooth(3)
    result = detected(sense * stage, sense * slider, half=60.0, factor=factor)
    # the slip in the last step has not ended
    assert_array_equal(of(result, "time"), [39.0, 79.0])
    assert_array_equal(of(result, "end"), [40.0, 80.0])
    assert_array_equal(of(result, "force_before"), [39.0, 43.0])
    assert_array_equal(of(result, "force_after"), [4.0, 8.0])
    assert_array_equal(of(result, "amplitude"), 36.0)
    assert_array_equal(of(result, "speed"), 1.0)
    assert_array_equal(of(result, "stress_before"), [78.0, 86.0])
    assert_array_equal(of(result, "stress_after"), [8.0, 16.0])
    # one late event, no recurrence
    assert_array_equal(result.late[0, :, 0], [1.0, 1.0, 1.0, 0.0])
    assert_array_equal(result.late[0, :3, 1], [43.0, 35.0, 36.0])


def test_a_slider_that_is_not_ten_times_as_fast_as_the_stage_makes_no_slip_event():
    for slip, count in ((9.9, 0.0), (10.1, 3.0)):
        stage, _ = saw_tooth(4)
        # the mean speed is that of the stage
        rest = stage - np.floor(stage / PERIOD) * PERIOD
        slider = np.floor(stage / PERIOD) * PERIOD + rest * (PERIOD - slip) / (
            PERIOD - 1
        )
        result = detected(stage, slider)
        assert result.total[0] == count and result.state["slow"][0] == 3.0 - count


@pytest.mark.parametrize("factor", FACTORS)
def test_a_slow_fall_of_the_force_to_nothing_is_no_slip_event(factor):
    stage = np.arange(200.0)
    slider = np.where(stage < 60.0, 0.0, np.minimum(2.5 * (stage - 60.0), stage))
    assert detected(stage, slider, factor=factor).total[0] == 0.0


@pytest.mark.parametrize("factor", FACTORS)
def test_a_slider_that_oscillates_after_a_slip_has_slipped_once(factor):
    stage = 0.02 * np.arange(6001.0)
    after = np.maximum(np.arange(6001.0) - 3000.0, 0.0)
    ring = 40.0 - 40.0 * np.exp(-0.003 * after) * np.cos(0.3 * after)
    speeds = np.diff(ring) / 0.02
    swings = np.count_nonzero(np.diff((speeds > factor) * 1.0) == 1.0)
    assert swings > 3
    result = detected(stage, ring, factor=factor)
    assert_array_equal(of(result, "time"), 3000.0)


def test_ruptures_of_single_bonds_that_bear_little_of_the_force_are_no_slip_events():
    stage = 0.01 * np.arange(20_001.0)
    for share, is_event in ((0.1, False), (0.5, True)):
        # the force of 10 falls by a share at each rupture
        slider = 10.0 * share * np.floor(np.maximum(stage - 10.0, 0.0) / (10.0 * share))
        assert bool(detected(stage, slider).total[0] > 10.0) is is_event


def test_a_stage_that_slows_down_stops_or_turns_makes_no_slip_event_of_a_slider_that_lags():
    time = np.arange(400.0)
    for after in (0.0, 0.01, -1.0):
        speeds = np.where((time < 200.0) | (time > 300.0), 1.0, after)
        stage = np.cumsum(speeds)
        slider, lag = np.zeros(400), 0.0
        for k in range(1, 400):
            # viscous friction: the force relaxes in 20 s
            lag = stage[k] - slider[k - 1]
            slider[k] = slider[k - 1] + lag / 20.0
        ratio = np.diff(slider)[200:300] / max(abs(after), 1e-3)
        assert after == -1.0 or ratio.max() > 10.0
        result = detected(stage, slider)
        assert result.total[0] == 0.0 and result.state["slow"][0] == 0.0


def test_a_slip_while_the_stage_rests_is_one_and_has_no_recurrence_across_the_stop():
    stage, slider = saw_tooth(3)
    rest = np.full(30, stage[-1])
    # after the slip it creeps at half of the last speed of the stage
    creep = 30.0 + 0.5 * (np.arange(30) - 15.0)
    held = slider[-1] + np.where(np.arange(30) < 15, 0.0, creep)
    stage, slider = np.append(stage[:-1], rest), np.append(slider[:-1], held)
    result = detected(stage, slider)
    assert_array_equal(of(result, "time"), [39.0, 79.0, 119.0, 134.0])
    assert result.late[0, LATE.index("recurrence"), 0] == 2.0
    # a step beyond that of the last slip the stage rests
    assert_allclose(of(result, "amplitude"), [36.0, 36.0, 36.0, 30.0])


def test_a_member_has_a_thousand_stored_events_at_most_and_all_are_counted():
    stage, slider = saw_tooth(1101, 40.0)
    many = detected(stage, slider)
    assert many.total == 1100.0 and many.log.shape[1] == 1024
    assert np.isfinite(many.column("time")[0]).sum() == 1000


def test_a_motion_that_becomes_unknown_in_a_slip_has_no_event():
    stage, slider = saw_tooth(3)
    slider[41:] = np.nan
    assert detected(stage, slider).total == 0.0


def test_the_kinetic_friction_of_whole_cycles_is_the_mean_force_and_its_change_that_of_the_parts():
    stage, slider = saw_tooth(11, 40.0)
    mean, change = detected(stage, slider, half=220.0).kinetic_friction()
    # forces 0 to 39, and the work of each step with the force at its end
    assert_allclose(mean, 19.5, rtol=1e-13)
    assert_allclose(change, 0.0, atol=1e-12)
    # forces grow from cycle to cycle
    mean, change = detected(stage, 0.9 * slider, half=220.0).kinetic_friction()
    assert change > 0.1 * mean > 0.0
    # one event after the half, and none
    assert np.isnan(detected(stage, slider, half=390.0).kinetic_friction()).all()
    mean, change = detected(stage, 0.0 * stage, half=220.0).kinetic_friction()
    assert_allclose([mean, change], [[330.5], [110.0]], rtol=1e-14)
