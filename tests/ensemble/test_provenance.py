"""The scenario that a dataset holds is the one that was run, whatever was changed in Python since it was read."""

import json
from dataclasses import replace
from pathlib import Path

import xarray as xr
from helpers.scenes import scene
from pydantic import TypeAdapter

from sim.ensemble.dataset import scenario_json
from sim.ensemble.simulate import run
from sim.parts.contact.models import Adhesion
from sim.scenario.reader import load
from sim.scenario.scenario import Scenario, read_sweep

LENS = Path(__file__).parents[2] / "scenarios" / "pdms_lens.toml"
SHORT = {"clock": {"duration": "2 ms", "step": "1 ms"}, "ensemble.members": 2}


def reread(dataset, folder):
    """The scenario that the text and the overrides of a dataset give."""
    (folder / "again.toml").write_text(dataset.attrs["scenario_toml"], encoding="utf-8")
    return load(folder / "again.toml", json.loads(dataset.attrs["scenario_overrides"]))


def test_text_and_overrides_give_the_scenario_that_was_run(tmp_path):
    lens = load(LENS, SHORT)
    twice = lens.with_values({"contact.load": 1e-3}).with_values({"contact": {"load": 2e-3}})
    for scenario in (lens, lens.with_values({"adhesion.work": 0.03}), twice):
        dataset = run(scenario)
        assert dataset.attrs["scenario_toml"] == LENS.read_text(encoding="utf-8")
        assert scenario_json(reread(dataset, tmp_path)) == scenario_json(scenario)


def test_a_point_of_a_sweep_is_described_without_the_sweep(tmp_path):
    swept = load(LENS, SHORT | {"sweep": {"contact.load": ["1 mN", "4 mN"]}})
    point = swept.points()[1]
    again = reread(run(point), tmp_path)
    assert (again.contact.load, again.sweep) == (4e-3, ())


def test_what_no_file_describes_has_no_text_but_the_whole_resolved_scenario():
    lens = load(LENS, SHORT)
    part_replaced = replace(lens, adhesion=Adhesion(work=0.03))
    swept = replace(lens, sweep=read_sweep({"contact.load": [1e-3, 2e-3]}))
    for scenario in (part_replaced.with_values({"contact.load": 1e-3}), swept, scene(members=2)):
        dataset = run(scenario)
        assert (dataset.attrs["scenario_toml"], dataset.attrs["scenario_overrides"]) == ("", "{}")
        again = TypeAdapter(Scenario).validate_python(json.loads(dataset.attrs["scenario_resolved"]))
        assert again.sweep == scenario.sweep
        xr.testing.assert_identical(run(again), dataset)


def test_a_zipped_sweep_is_in_the_resolved_scenario():
    rows = [{"contact.load": "1 mN", "sphere.radius": "1 mm"}, {"contact.load": "4 mN", "sphere.radius": "2 mm"}]
    scenario = replace(scene(members=2), sweep=read_sweep(rows))
    assert json.loads(scenario_json(scenario))["sweep"] == rows
