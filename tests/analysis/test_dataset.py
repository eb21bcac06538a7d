"""Settings and words of the scenario in a dataset, swept or not."""

import pytest
from helpers.lens import RADIUS, scene

from sim import analysis
from sim.analysis.dataset import resolved, word
from sim.ensemble.simulate import run
from sim.parts import drive
from sim.parts.contact import Equilibrium
from sim.parts.shear import models as shear


def test_a_setting_is_found_whether_it_is_swept_or_not():
    dataset = run(scene(sweep={"contact.load": [1e-3, 4e-3]}, shear=shear.Uniform()))
    assert analysis.setting(dataset, "contact.load").to_numpy().tolist() == [1e-3, 4e-3]
    assert float(analysis.setting(dataset, "sphere.radius")) == RADIUS
    with pytest.raises(KeyError, match=r"contact\.indentation"):
        analysis.setting(dataset, "contact.indentation")


def test_a_word_is_found_whether_it_is_swept_or_not():
    contact = Equilibrium(indentation={"from": 1e-6, "to": 2e-6})
    dataset = run(scene(contact=contact, shear=shear.Uniform(), sweep={"contact.after_pull_off": ["stop", "reattach"]}))
    assert word(dataset, "contact.after_pull_off", "").to_numpy().tolist() == ["stop", "reattach"]
    assert str(word(dataset, "contact.indentation.scale", "").to_numpy()) == "linear"
    assert str(word(dataset, "contact.colour", "grey").to_numpy()) == "grey"


def test_words_that_are_alike_in_a_zipped_sweep_are_told_without_their_number():
    rows = [{"contact.after_pull_off": "reattach", "contact.load": load} for load in (1e-3, 2e-3)]
    dataset = run(scene(shear=shear.Uniform(), sweep=rows))
    assert word(dataset, "contact.after_pull_off", "").to_numpy().tolist() == ["reattach", "reattach"]


def test_a_table_that_is_swept_whole_is_known_by_its_models():
    drives = [{"model": "ramp", "from": 1e-5, "to": 1e-2}, {"model": "start", "rest": 0.1, "speed": 1e-2}]
    dataset = run(scene(shear=shear.Uniform(), sweep={"drive": drives}))
    assert word(dataset, "drive.model", "").to_numpy().tolist() == ["ramp", "start"]
    with pytest.raises(KeyError, match="swept"):
        resolved(dataset, "drive.model")


def test_a_run_is_stationary_where_neither_speed_nor_control_changes():
    steady = {"drive": drive.Steady(speed=1e-3), "shear": shear.Uniform()}
    assert analysis.is_stationary(run(scene(**steady)))
    ended = run(scene(**steady))
    ended["speed"] = ended["speed"].where(ended["t"] < ended["t"][2])  # as after a runaway
    assert analysis.is_steady(ended)
    assert not analysis.is_stationary(run(scene(shear=shear.Uniform())))
    moved = run(scene(contact=Equilibrium(load={"from": 1e-3, "to": 2e-3}), **steady))
    assert analysis.is_steady(moved) and not analysis.is_stationary(moved)
