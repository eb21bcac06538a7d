"""The dataset of a run that is not done: what is computed has the numbers of the finished one, the rest is nan."""

import functools
import itertools
import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from helpers import scenes
from helpers.scenes import CELL, LOADS, LOADS_AND_SHARES, SPECTRUM

import sim
from sim.cli import cli
from sim.ensemble import plan as plans, simulate as ensemble
from sim.ensemble.part_files import PartFiles, Stopped
from sim.ensemble.plan import Plan
from sim.parts.shear import models as shear
from sim.parts.shear.process import Slip
from sim.scenario.clock import Clock, Record

MAPPED = shear.Mapped(spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=3e-6))

pytestmark = pytest.mark.usefixtures("many_parts")
sample = functools.partial(scenes.sample, members=5, sweep=LOADS_AND_SHARES)


def stopped(scenario, path, after, **how):
    """A run that ended after some parts."""
    count = itertools.count()
    with pytest.raises(Stopped):
        ensemble.run(scenario, path, stop=lambda: next(count) == after or next(count) > 2 * after, **how)
    return path


SCENES = {
    "members": sample(),
    "pooled": sample(record=Record(per_member=False)),
    "short runs together": sample(steps=1),
    "maps": sample(shear=MAPPED, record=Record(maps=(8e-3, 1e-3), map_members=3)),
    "single precision": sample(record=Record(precision="float32")),
    "no sweep": replace(sample(), sweep=()),
    "blocks in a record": sample(clock=Clock(duration=9e-3, step=1e-3, record=9e-3)),
}


@pytest.mark.parametrize("scenario", SCENES.values(), ids=SCENES)
def test_what_is_computed_has_the_numbers_of_the_finished_run(tmp_path, scenario):
    whole = ensemble.run(scenario)
    path, some = tmp_path / "out.nc", 0
    ensemble.run(scenario, path, shard=(2, 3))
    with sim.open(path) as found:
        assert 0 < found.attrs["share_done"] < 1
        assert found.attrs["share_done"] == plans.work(Plan.of(scenario), 2, 3) / plans.work(Plan.of(scenario))
        assert set(found.variables) == set(whole.variables)
        for name, values in found.variables.items():
            wanted = whole[name].values
            if values.dtype.kind in "OUT" or name in found.coords:
                assert np.array_equal(values.values, wanted)
                continue
            there = ~np.isnan(values.values)
            assert np.array_equal(values.values[there], wanted[there].astype(values.dtype))
            some += not there.all() and there.any()
    assert some > 3 or scenario is SCENES["pooled"]
    for number in (1, 3):
        ensemble.run(scenario, path, shard=(number, 3))
    complete = sim.open(path)
    assert complete.attrs.pop("share_done") == 1
    xr.testing.assert_equal(complete, whole)
    assert complete.attrs == whole.attrs


def test_any_part_of_a_variable_is_read_alone(tmp_path, monkeypatch):
    whole, path = ensemble.run(sample()).drop_vars("speed"), tmp_path / "out.nc"
    for number in (1, 2):
        ensemble.run(sample(), path, shard=(number, 2))
    read, load = [], PartFiles.load
    monkeypatch.setattr(PartFiles, "load", lambda parts, name: read.append(name) or load(parts, name))
    found = sim.open(path).drop_vars("speed")["contact_radius"]
    assert not read
    chosen = {"contact_load": 1, "member": slice(4, 1, -2), "t": [7, 2]}
    xr.testing.assert_equal(found.isel(chosen), whole["contact_radius"].isel(chosen))
    at_once = {"contact_load": 0, "adhesion_bond_share": 1, "member": 4, "t": -1}
    read.clear()
    xr.testing.assert_equal(found.isel(at_once), whole["contact_radius"].isel(at_once))
    assert len(read) == 1


def test_tables_and_figures_of_an_unfinished_run_say_so(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ensemble.run(sample(members=4, sweep=LOADS), "out.nc", shard=(1, 2))
    for words in (["stats", "out.nc"], ["plot", "out.nc"]):
        done = CliRunner().invoke(cli, words, catch_exceptions=False)
        assert done.exit_code == 0
        assert "note: out.nc is of a run that is not done: 50 % is computed" in done.stderr
    assert sim.stats("out.nc")["contact_radius_mean"].notna().any()


def test_what_is_not_there_is_told(tmp_path):
    with pytest.raises(sim.BadInput, match="there is no such file"):
        sim.open(tmp_path / "out.nc")
    (tmp_path / "out.nc.parts").mkdir()
    with pytest.raises(sim.BadInput, match="there is no such file, nor an unfinished run of it"):
        sim.open(tmp_path / "out.nc")


DAMAGED = {
    "none": lambda text: "",
    "cut": lambda text: text[:-9],
    "list": lambda text: "[1]",
    "nested": lambda text: "[" * 100_000,
    "nested inside": lambda text: text.replace('"source": {', '"source": {"x": ' + "[" * 400 + "]" * 400 + ", "),
    "without run": lambda text: text.replace('"run":', '"ran":'),
    "another run": lambda text: text.replace('"run": {', '"run": [], "ran": {'),
    "without a scenario": lambda text: text.replace('"scenario":', '"scene":'),
    "an unknown key": lambda text: text.replace('"scenario": {', '"scenario": {"\\u001b[2J": 1, '),
    "a wrong value": lambda text: text.replace('"radius": 0.002', '"radius": -1'),
    "another source": lambda text: text.replace('"source": {', '"source": 3, "sources": {'),
    "a source of numbers": lambda text: text.replace('"files": {}, "overrides"', '"files": 3, "overrides"'),
    "another order": lambda text: text.replace('"sweep": ["contact.load", "adhesion.bond_share"]', '"sweep": []'),
    "a file": lambda text: re.sub(r'"load": [0-9.e-]+', '"load": {"file": "loads.csv"}', text),
}


@pytest.mark.parametrize("harm", DAMAGED.values(), ids=DAMAGED)
@pytest.mark.parametrize("words", [["stats", "out.nc"], ["merge", "out.nc"]], ids=["stats", "merge"])
def test_a_damaged_manifest_is_told_in_one_line(tmp_path, monkeypatch, harm, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loads.csv").write_text("time [s], load [mN]\n0, 1\n1, 2\n")
    ensemble.run(sample(steps=1), "out.nc", shard=(1, 2))
    manifest = tmp_path / "out.nc.parts" / "1-of-2" / "manifest.json"
    before = manifest.read_text()
    manifest.write_text(harm(before))
    assert manifest.read_text() != before
    with pytest.raises(sim.BadInput) as told:
        CliRunner().invoke(cli, words, catch_exceptions=False)
    assert len(told.value.problems) == 1
    assert "out.nc" in str(told.value)
    assert str(told.value).isprintable()
