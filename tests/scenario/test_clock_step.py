"""Errors by the clock step where the contact feels fluctuations at clock steps alone, and the step that mends them."""

import math
from copy import deepcopy
from pathlib import Path

import numpy as np
import pytest
from helpers.scenes import follow
from numpy.testing import assert_allclose

import sim
from sim.scenario.checks import pull_off_error
from sim.step.state import MemberNoise

LENS = Path(__file__).parents[2] / "scenarios" / "pdms_lens_spring.toml"
SPECTRUM = {
    "model": "self_affine",
    "rms": "80 kPa",
    "hurst": 0.8,
    "longest": "60 um",
    "rolloff": "30 um",
}
SCENE = {
    "name": "fluctuations under tension",
    "seed": 1,
    "clock": {"duration": "2 s", "step": "2 ms", "record": "100 ms"},
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
    "drive": {"model": "steady", "speed": "1 mm/s"},
    "bonds": {"model": "steady", "stress": "0.1 MPa", "critical_speed": "1 m/s"},
    "shear": {
        "model": "banded",
        "spectrum": SPECTRUM | {"shortest": "2 um"},
        "correlation": {"model": "slip", "length": "20 um"},
    },
    "contact": {"load": {"from": "0.2 mN", "to": "-0.5 mN"}, "after_pull_off": "stop"},
    "ensemble": {"members": 1000},
}
LAGGING = {
    "model": "rate_dependent",
    "load": "4 mN",
    "front_speed": "100 um/s",
    "front_exponent": 1.0,
}


def scene(**tables):
    return sim.load(deepcopy(SCENE) | tables)


def clock(step):
    return SCENE["clock"] | {"step": step}


@pytest.mark.parametrize(
    "correlation", [{"model": "slip", "length": "20 um"}, {"model": "wave", "waves": 3}]
)
def test_the_change_in_a_step_is_that_of_the_drawn_energies(correlation):
    lens = scene(
        shear=SCENE["shear"] | {"correlation": correlation}, contact={"load": "1 mN"}
    )
    course = follow(lens, MemberNoise.of(1, np.arange(4000)), None, range(4))[1]
    exact = lens.process.change(np.array([2e-6]), 2e-3)
    changes = np.diff(course.energy, axis=0)
    assert_allclose(np.std(changes), exact, rtol=4.0 / math.sqrt(changes.size / 2.0))
    assert_allclose(
        np.std(course.energy[0]) * math.sqrt(2.0),
        lens.process.change(np.array([1.0]), 1.0),
        rtol=0.1,
    )


def test_the_error_of_a_pull_off_load_covers_what_a_finer_step_changes_and_is_no_more_than_twice_that():
    pulls, errors = [], []
    for step in ("2 ms", "0.1 ms"):
        dataset = sim.run(scene(clock=clock(step)))
        loads = dataset["pull_off_load"].to_numpy().ravel()
        pulls.append((np.mean(loads), np.var(loads) / loads.size))
        errors.append(float(dataset["pull_off_error"].max()))
        assert_allclose(
            dataset["step_renewal"],
            -math.expm1(-2.0 * float(step.split()[0]) / 20.0),
            rtol=1e-9,
        )
    change, noise = (
        abs(pulls[0][0] - pulls[1][0]),
        3.0 * math.sqrt(pulls[0][1] + pulls[1][1]),
    )
    assert (
        0.5 * (errors[0] - errors[1]) - noise < change < errors[0] + errors[1] + noise
    )
    assert noise < 0.5 * errors[0]


def test_the_radius_of_a_lagging_edge_varies_too_much_by_what_is_said():
    # an edge much slower than the fluctuations adds them up: held for steps s apart they have s/2 coth s/2 too much
    spread = []
    for step in ("2 ms", "20 ms"):
        lens = scene(
            clock=SCENE["clock"] | {"step": step, "duration": "6 s"}, contact=LAGGING
        )
        radius = sim.run(lens)["contact_radius"].sel(t=slice(1.0, None))
        spread.append(float(radius.var()))
        remarks = [text for text in lens.remarks() if "clock step" in text]
    assert "31.3%" in remarks[0] and remarks[0].endswith('clock.step = "2 ms"')
    assert_allclose(spread[1] / spread[0], 1.0 / math.tanh(1.0), rtol=0.06)


def test_the_step_that_is_given_needs_no_remark_and_a_scene_without_error_has_none():
    written = next(
        text
        for text in scene().remarks()
        if "the error of its pull-off load is up to" in text
    )
    step = written.rpartition('"')[0].rpartition('"')[2]
    for lens in (
        scene(clock=clock(step)),
        scene(contact={"load": "4 mN"}),
        scene(shear={"model": "uniform"}),
    ):
        assert not [text for text in lens.remarks() if "clock step" in text]
    dataset = sim.run(scene(contact={"load": "4 mN"}, ensemble={"members": 2}))
    assert not {"step_renewal", "pull_off_error"} & {*dataset}


def test_a_course_of_a_displacement_is_no_load():
    near, far = (
        {"displacement": {"from": "1 um", "to": to}, "stiffness": "1 kN/m"}
        for to in ("-9 um", "-9 mm")
    )
    path = np.array([2e-6])
    assert_allclose(
        *(pull_off_error(scene(contact=contact), path) for contact in (near, far)),
        rtol=1e-12,
    )


@pytest.mark.parametrize("model", [{}, LAGGING])
def test_only_the_change_of_the_load_near_a_pull_off_counts_for_its_error(model):
    errors = []
    for first in ("4 mN", "0.3 mN"):
        course = {
            "time": ["0 s", "0.1 s", "2.1 s"],
            "value": [first, "0.2 mN", "-1 mN"],
        }
        lens = scene(
            contact=model | {"load": course, "after_pull_off": "stop"},
            clock=clock("2 ms") | {"duration": "2.1 s"},
            ensemble={"members": 20},
            shear=SCENE["shear"] | {"cell": "0.4 mm"},
        )
        dataset = sim.run(lens)
        assert float(dataset["pull_off_time"].min()) > 0.11
        errors.append(float(dataset["pull_off_error"].max()))
    assert_allclose(*errors, rtol=1e-6)
    # the load changes by 1.2 uN in a clock step, and by 76 uN in the first ones
    assert 0.6e-6 < errors[0] < 10e-6


def test_a_late_detachment_costs_3_pi_r_over_2_of_a_short_range_and_2_pi_r_of_a_long_one():
    mount = {"displacement": {"from": "1 um", "to": "-9 um"}, "stiffness": "1 kN/m"}
    path, costs = np.array([2e-6]), []
    for model in (
        {},
        {"model": "cohesive", "range": "10 pm"},
        {"model": "cohesive", "range": "40 mm"},
    ):
        lens = scene(contact=mount | model)
        # ΔΓ changes by more in the smaller cell of a contact with a long range
        change = lens.process.change(path, lens.clock.step)
        costs.append(pull_off_error(lens, path) / change)
    jkr, short, long = costs
    assert_allclose(short, jkr, rtol=1e-4)
    assert_allclose(long, 4.0 / 3.0 * jkr, rtol=1e-4)


def test_behind_a_spring_the_longest_path_of_a_step_counts():
    keys = {
        "contact": LAGGING,
        "ensemble.members": 2,
        "clock": {"duration": "60 ms", "step": "1 ms"},
    }
    lens = sim.load(LENS).with_values(keys)
    dataset = sim.run(lens)
    path = dataset["slider_position"].diff("t").max("t")
    assert_allclose(dataset["step_renewal"], -np.expm1(-2.0 * path / 5e-6), rtol=1e-6)
