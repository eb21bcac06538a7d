"""Answers of friction to a jump of the speed, and of the contact area to a force that grows from rest."""

import numpy as np
import pytest
import xarray as xr

from sim.analysis.events import incipient_law, speed_step, way_to_sliding

LENGTH, LEVEL, OVER = 6e-6, 12e-3, 3e-3


def recorded(**series):
    """A dataset of two members, whose second has forces of twice the first's."""
    scale = {"friction_force": [[1.0], [2.0]], "spring_force": [[1.0], [2.0]]}
    result = {
        name: (("member", "t"), np.array(scale.get(name, [[1.0], [1.0]])) * values) for name, values in series.items()
    }
    count = len(next(iter(series.values())))
    return xr.Dataset(result | {"contact_modulus": 1.0}, {"t": np.arange(count)}, {"scenario_resolved": "{}"})


def stepped(sense=1.0, quick=2e-3):
    """A slider at 0.2 mm/s whose speed jumps; friction falls back exponentially over the path."""
    time = np.arange(400.0)
    speed = np.where(time < 100.0, 2e-4, quick)
    path = np.cumsum(np.where(time < 100.0, 1e-8, LENGTH / 10.0))
    force = np.where(time < 100.0, 7e-3, LEVEL + OVER * np.exp(-(path - path[100]) / LENGTH))
    return recorded(stage_speed=sense * speed, friction_force=sense * force, slider_position=sense * path)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_jump_of_the_speed_has_the_direct_effect_and_the_length_that_friction_was_made_with(sense):
    result = speed_step(stepped(sense))
    np.testing.assert_allclose(result["direct_effect"], [LEVEL + OVER - 7e-3, 2 * (LEVEL + OVER - 7e-3)], rtol=1e-12)
    # the mean of the second half lies e^-15 of the overshoot above the level
    np.testing.assert_allclose(result["step_overshoot"], [OVER, 2 * OVER], rtol=np.exp(-15.0))
    # the slider goes a tenth of the length before the peak; a straight line between records is off by 1/800 at most
    np.testing.assert_allclose(result["step_length"], 1.1 * LENGTH, rtol=1 / 800)


def test_a_jump_down_or_to_where_friction_does_not_settle_says_nothing():
    assert not speed_step(stepped(quick=1e-4))
    dataset = stepped()
    dataset["friction_force"] = dataset["friction_force"] + 5e-3 * np.sin(np.arange(400.0))
    assert bool(speed_step(dataset).to_dataarray().isnull().all())


def pulled(threshold=5e-3, fall=0.7):
    """A force that grows to a threshold and falls, and an area that falls with its square and faster in the end."""
    force = threshold * np.append(np.linspace(0.0, 1.0, 101), np.full(50, fall))
    share = force / threshold
    area = 4e-8 * (1.0 - 0.1 * share**2 - 0.05 * np.where(share > 0.5, share - 0.5, 0.0))
    return recorded(stage_speed=np.full(151, 1e-3), spring_force=force, contact_area=area)


@pytest.mark.parametrize("then", [0.0, -4e-3])
def test_a_stage_that_stops_or_turns_is_not_faster(then):
    speed, ones = np.where(np.arange(40.0) < 20.0, 2e-3, then), np.ones(40)
    assert not speed_step(recorded(stage_speed=speed, friction_force=ones, slider_position=ones))


def test_the_way_to_sliding_has_the_threshold_the_area_there_and_what_the_law_of_the_square_gives():
    result = way_to_sliding(pulled())
    np.testing.assert_allclose(result["static_threshold"], [5e-3, 10e-3], rtol=1e-12)
    np.testing.assert_allclose(result["area_at_threshold"], 1.0 - 0.1 - 0.025, rtol=1e-12)
    np.testing.assert_allclose(result["area_by_law"], 1.0 - 0.1, rtol=1e-12)
    alpha = 0.1 * 4e-8 / 5e-3**2
    np.testing.assert_allclose(result["incipient_alpha"], [alpha, alpha / 4.0], rtol=1e-12)


def test_a_force_that_does_not_fall_or_begins_above_zero_has_no_threshold():
    assert bool(way_to_sliding(pulled(fall=1.0)).to_dataarray().isnull().all())
    assert bool(way_to_sliding(pulled().isel(t=slice(20, None))).to_dataarray().isnull().all())


@pytest.mark.parametrize("then", [-1.0, 0.5, 0.0])
def test_a_fall_of_the_force_as_the_stage_turns_or_slows_down_is_no_threshold(then):
    dataset = pulled()
    dataset["stage_speed"] = dataset["stage_speed"] * np.where(np.arange(151) > 100, then, 1.0)
    assert bool(way_to_sliding(dataset).to_dataarray().isnull().all())


def test_the_threshold_is_before_the_first_fall_though_later_forces_are_larger():
    force = np.array([0.0, 1.0, 2.0, 1.5, 3.0])
    assert incipient_law(force, 1.0 - 0.01 * force**2)[0] == 2
