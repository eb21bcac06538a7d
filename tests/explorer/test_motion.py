"""The motion that the page of ``sim explore`` plays: that of a run, which goes on while numbers change."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import sim
from sim.explorer.job import ensemble, summary
from sim.explorer.motion import Motions
from sim.explorer.page import Page
from sim.units.notation import engineering

#: Digits that are sent are six.
DIGITS = 5e-6


def whole(motions, scene, run="", step=0):
    """All columns of a motion from a step on, and its name."""
    columns, answer = {}, {"last": -1, "steps": 0}
    while answer["last"] < answer["steps"]:
        answer = motions.advance(scene, run, step)
        run, step = answer["run"], answer["last"]
        for name, values in answer["columns"].items():
            columns.setdefault(name, []).extend(values)
    return {name: np.array(x, float) for name, x in columns.items()}, run


@pytest.fixture(scope="module")
def spring():
    return sim.load("scenarios/pdms_lens_spring.toml", {"sweep": {}})


@pytest.mark.parametrize("name", ["pdms_lens_spring", "creep", "pull_off", "own_map"])
def test_a_motion_is_that_of_the_first_member_of_a_run(name):
    changes = {"sweep": {}, "ensemble.members": 1}
    scene = sim.load(f"scenarios/{name}.toml", changes)
    every = {"clock.record": scene.clock.step}
    run = sim.run(sim.load(f"scenarios/{name}.toml", changes | every))
    columns, _ = whole(Motions(), scene)
    assert_allclose(columns["t"], run["t"], rtol=DIGITS)
    for column in columns.keys() & run.keys():
        exact = np.broadcast_to(run[column].squeeze(), columns["t"].shape)
        assert_allclose(columns[column], exact, rtol=DIGITS, atol=0, err_msg=column)


def test_a_motion_goes_on_from_its_state_under_other_numbers(spring):
    motions = Motions()
    before, run = whole(motions, spring)
    heavy = spring.with_values({"contact.load": 8e-3})
    after, again = whole(motions, heavy, run, 1000)
    assert again == run and after["t"][0] == before["t"][1001]
    # the slider is where it was, and the heavier contact larger from there on
    path = before["slider_position"][1000], after["slider_position"][0]
    assert abs(path[1] - path[0]) < 1e-5
    assert after["contact_area"].min() > 1.2 * before["contact_area"].min()
    # the other way the same motion comes again, bit for bit
    same, _ = whole(motions, spring, whole(motions, spring)[1], 1000)
    for name, values in same.items():
        assert np.array_equal(values, before[name][1001:], equal_nan=True), name


def test_numbers_that_change_the_shapes_of_a_motion_begin_it_anew():
    scene = sim.load(
        "scenarios/stick_slip.toml",
        {
            "bonds": {
                "model": "tracked",
                "site_density": "1e9 1/m^2",
                "sites": 40,
                "rupture": {
                    "model": "bell",
                    "zero_force_rate": "25 1/s",
                    "bell_force": "4 pN",
                },
                "bond_stiffness": "0.8 uN/m",
                "rebinding_rate": "250 1/s",
            },
            "clock.duration": "0.1 s",
            "clock.record": "1 ms",
        },
    )
    motions = Motions()
    first = motions.advance(scene, "", 0)
    assert first["is_new"]
    more = scene.with_values({"bonds.sites": 50})
    second = motions.advance(more, first["run"], first["last"])
    assert second["is_new"] and second["first"] == 0 and second["run"] != first["run"]
    assert motions.advance(scene, "unknown", 5)["is_new"]


def test_few_motions_are_kept(spring):
    motions = Motions()
    runs = [motions.advance(spring, "", 0)["run"] for _ in range(6)]
    kept = [not motions.advance(spring, run, 0)["is_new"] for run in runs[-4:]]
    assert kept == [True] * 4
    assert motions.advance(spring, runs[0], 0)["is_new"]


def test_a_run_of_a_motion_states_the_extremes_of_its_members_with_intervals(spring):
    run = sim.run(spring)
    drawn = summary(spring, run)
    assert drawn["along"] == "t" and drawn["members"] == 4
    largest = run["spring_force"].max("t").to_numpy()
    # Student's quantile for three degrees of freedom
    half = 3.182446305284263 * largest.std(ddof=1) / 2.0
    words = f"{engineering(largest.mean(), 'N')} ± {engineering(half, 'N')}"
    assert f"largest spring force {words}" in drawn["words"]


def test_a_run_of_a_motion_has_the_extremes_of_the_motion_that_is_drawn():
    page = Page(sim.load("scenarios/stick_slip.toml"))
    columns, _ = whole(Motions(), page.read({}))
    drawn = ensemble(page.scenes({}, 2), lambda message: None)["words"]
    most, least = columns["spring_force"].max(), columns["contact_area"].min()
    assert f"largest spring force {engineering(most, 'N')} ±" in drawn
    assert f"smallest area {engineering(least, 'm^2')} ±" in drawn
    assert "at times 1 ms apart" in drawn


def test_the_speeds_of_the_stage_at_which_slip_events_begin_are_those_of_a_run():
    def words(changes):
        scene, motions = sim.load("scenarios/stick_slip.toml", changes), Motions()
        _, run = whole(motions, scene)
        # the state before the last block is kept
        last = max(step for step in range(scene.clock.steps) if step % 40 == 0)
        return motions.advance(scene, run, last)["words"], scene

    text, scene = words({})
    run = sim.run(scene)
    assert text.startswith(f"{int(run['slip_count'].item())} slip events, from")
    for name in ("onset_steady_speed", "onset_slip_speed"):
        assert engineering(run[name].item(), "m/s") in text
    assert words({"drive.stage": "1 mm/s"})[0] == "no slip event"
    creep = sim.load("scenarios/creep.toml", {"sweep": {}})
    assert Motions().advance(creep, "", 0)["words"] == ""


def test_a_run_whose_slips_are_not_resolved_says_so_and_another_one_does_not(spring):
    assert "not resolved" not in summary(spring, sim.run(spring))["words"]
    coarse = spring.with_values({"clock.record": 10e-3})
    assert "not resolved" in summary(coarse, sim.run(coarse))["words"]
