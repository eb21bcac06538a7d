"""Shards of a run, each in a process of a job array: put together they are the file of an undivided run."""

import functools
import itertools
import os
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers import scenes
from helpers.scenes import LOADS_AND_SHARES

from sim.cli import cli
from sim.ensemble import plan as plans, simulate as ensemble
from sim.ensemble.checksums import verify
from sim.ensemble.part_files import OutputBusy, OutputExists, Stopped, held
from sim.ensemble.plan import Plan
from sim.ensemble.unfinished import merge
from sim.units.errors import BadInput

pytestmark = pytest.mark.usefixtures("many_parts")
sample = functools.partial(scenes.sample, members=7, sweep=LOADS_AND_SHARES)


@pytest.fixture
def whole(tmp_path):
    path = ensemble.run(sample(), tmp_path / "whole" / "out.nc")
    return path.read_bytes()


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("of", [1, 2, 3, 5, 20])
def test_every_task_is_in_one_shard(of):
    plan = Plan.of(sample())
    shares = [[task.names[0] for task in plan.share(number, of)] for number in range(1, of + 1)]
    assert sorted(itertools.chain(*shares)) == sorted(task.names[0] for task in plan.tasks())
    assert sum(plans.work(plan, number, of) for number in range(1, of + 1)) == plans.work(plan)
    assert plans.work(plan) == 7 * 10 * 4


def test_merged_shards_are_the_bytes_of_an_undivided_run(tmp_path, whole):
    path, done = tmp_path / "out.nc", []
    for number in (3, 1, 2):
        with pytest.raises(Stopped, match="lacks") if done else pytest.raises(BadInput, match="there are no shards"):
            merge(path)
        done.append([])
        ensemble.run(sample(), path, shard=(number, 3), jobs=1 + number // 3, progress=done[-1].append)
    assert not path.exists()
    assert [sum(one) for one in done] == [plans.work(Plan.of(sample()), number, 3) for number in (3, 1, 2)]
    assert merge(path).read_bytes() == whole
    assert names(tmp_path) == ["out.nc", "out.nc.sha256", "whole"]
    verify(path)


def test_shards_that_run_at_once_do_not_hinder_each_other(tmp_path, whole):
    path = tmp_path / "out.nc"
    parts = {"resume": False, "replace": False, "read": dict}
    with held(path, {}, {}, **parts, shard=(1, 2)), held(path, {}, {}, **parts, shard=(2, 2)):
        with pytest.raises(OutputBusy, match="another run is writing"), held(path, {}, {}, **parts, shard=(2, 2)):
            pass
        with pytest.raises(OutputBusy, match="1-of-2 is being written"):
            merge(path)
        with pytest.raises(OutputExists, match="holds shards of a run; put them together"):
            ensemble.run(sample(), path, replace=True)


def test_a_shard_does_not_begin_where_a_whole_run_is_unfinished(tmp_path, whole):
    path = tmp_path / "out.nc"
    with pytest.raises(ZeroDivisionError):
        ensemble.run(sample(), path, progress=lambda done: 1 / 0)
    for how in ({"resume": True}, {"replace": True}, {}):
        with pytest.raises(OutputExists, match="holds an unfinished run; go on by --resume without --shard"):
            ensemble.run(sample(), path, **how, shard=(1, 2))
    assert names(path.with_name("out.nc.parts")) == ["lock", "manifest.json"]
    assert ensemble.run(sample(), path, resume=True).read_bytes() == whole


def test_a_shard_that_was_stopped_goes_on_and_a_lost_or_damaged_part_is_named(tmp_path, whole):
    path, asked = tmp_path / "out.nc", itertools.count()
    with pytest.raises(Stopped):
        ensemble.run(sample(), path, shard=(1, 2), stop=lambda: next(asked) > 1)
    ensemble.run(sample(), path, shard=(2, 2))
    with pytest.raises(OutputExists, match="1-of-2 holds an unfinished run; go on with --resume"):
        ensemble.run(sample(), path, shard=(1, 2))
    with pytest.raises(BadInput, match=r"1-of-2 is of another run: scenario.ensemble.members was 7, is 8"):
        ensemble.run(sample(members=8), path, shard=(1, 2), resume=True)
    with pytest.raises(Stopped, match=r"^shard 1/2 lacks \d+ of 16 parts\nrun it with --resume, then merge again$"):
        merge(path)
    ensemble.run(sample(), path, shard=(1, 2), resume=True)
    part = min((tmp_path / "out.nc.parts" / "2-of-2").glob("*.part"))
    part.write_bytes(part.read_bytes()[:-1])
    with pytest.raises(Stopped, match=r"^shard 2/2 lacks 1 of "):
        merge(path)
    ensemble.run(sample(), path, shard=(2, 2), resume=True)
    assert merge(path).read_bytes() == whole


def test_shards_of_different_runs_are_not_put_together(tmp_path):
    path = tmp_path / "out.nc"
    ensemble.run(sample(), path, shard=(1, 2))
    ensemble.run(sample(seed=6), path, shard=(2, 2))
    with pytest.raises(BadInput, match=r"2-of-2 is of another run: scenario.seed was 6, is 5; move it away, and run"):
        merge(path)
    damaged = tmp_path / "out.nc.parts" / "2-of-2" / "manifest.json"
    damaged.write_bytes((content := damaged.read_bytes())[:-1])
    with pytest.raises(BadInput, match=r"2-of-2/manifest.json is damaged; move .*2-of-2 away and run that shard again"):
        merge(path)
    damaged.write_bytes(content)
    ensemble.run(sample(), path, shard=(2, 3))
    with pytest.raises(BadInput, match="holds shards of 2 and of 3; move away"):
        merge(path)


def test_a_sweep_in_another_order_is_another_run(tmp_path):
    path, turned = tmp_path / "out.nc", replace(sample(), sweep=sample().sweep[::-1])
    ensemble.run(sample(), path, shard=(1, 2))
    with pytest.raises(BadInput, match=r"1-of-2 is of another run: order of the sweep was \['contact.load"):
        ensemble.run(turned, path, shard=(1, 2), resume=True)


def test_an_output_that_is_there_is_replaced_only_if_asked(tmp_path, whole):
    path = tmp_path / "out.nc"
    for number in (1, 2):
        ensemble.run(sample(), path, shard=(number, 2))
    path.write_text("precious")
    with pytest.raises(OutputExists, match=r"out.nc exists; replace it with --force"):
        merge(path)
    assert path.read_text() == "precious"
    assert merge(path, replace=True).read_bytes() == whole


def test_a_merge_that_was_ended_at_any_rename_is_done_by_the_next(tmp_path, whole, monkeypatch):
    path = tmp_path / "out.nc"
    for number in (1, 2):
        ensemble.run(sample(), path, shard=(number, 2))
    move, left = os.replace, [0]

    def some(*given):
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        move(*given)

    ended = 0
    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", some)
        while not path.exists():
            left[0] = 5
            try:
                merge(path)
            except KeyboardInterrupt:
                ended += 1
    assert ended > 2
    monkeypatch.setattr(os, "replace", move)
    if path.with_name("out.nc.parts").exists():
        merge(path)
    assert path.read_bytes() == whole
    assert names(tmp_path) == ["out.nc", "out.nc.sha256", "whole"]


def test_files_of_others_in_a_shard_stay(tmp_path, whole):
    path = tmp_path / "out.nc"
    for number in (1, 2):
        ensemble.run(sample(), path, shard=(number, 2))
    note = tmp_path / "out.nc.parts" / "1-of-2" / "notes.txt"
    note.write_text("mine")
    assert merge(path).read_bytes() == whole
    assert [item.name for item in (tmp_path / "out.nc.parts").rglob("*")] == ["1-of-2", "notes.txt"]
    assert note.read_text() == "mine"


def test_a_shard_that_is_a_link_is_not_followed(tmp_path):
    path, elsewhere = tmp_path / "out.nc", tmp_path / "elsewhere"
    for number in (1, 2):
        ensemble.run(sample(), path, shard=(number, 2))
    (tmp_path / "out.nc.parts" / "2-of-2").rename(elsewhere)
    (tmp_path / "out.nc.parts" / "2-of-2").symlink_to(elsewhere)
    before = sorted(elsewhere.iterdir())
    with pytest.raises(Stopped, match="shard 2/2 lacks 16 of 16 parts"):
        merge(path)
    assert sorted(elsewhere.iterdir()) == before


TABLES = """
clock = {duration = "4 ms", step = "1 ms"}
solid = {shear_modulus = "1 MPa"}
sphere = {radius = "1 mm"}
adhesion = {work = "40 mJ/m^2"}
contact = {load = {file = "loads.csv"}}
drive = {model = "table", file = "speeds.csv"}
bonds = {model = "counted", critical_speed = "1 mm/s", rebinding_rate = "9 1/s", sites = 9}
shear.model = "modal"
shear.spectrum = {model = "tabulated", file = "psd.csv"}
shear.correlation = {model = "slip", length = "5 um"}
ensemble = {members = 6}
"""


def test_commands_in_a_job_array_with_tables(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").write_text(TABLES)
    Path("loads.csv").write_text("time [s], load [mN]\n0, 1\n4, 2\n")
    Path("speeds.csv").write_text("time [s], speed [mm/s]\n0, 0\n4, 1\n")
    Path("psd.csv").write_text("q [rad/um], C [Pa^2 m^2]\n" + "".join(f"{q / 10}, {1 / q}\n" for q in range(1, 40)))

    def sim(*words):
        return CliRunner().invoke(cli, [*words, "--quiet"] if words[0] == "run" else words, catch_exceptions=False)

    assert sim("run", "scene.toml", "--seed", "3", "-o", "whole.nc").exit_code == 0
    for number in (1, 2, 3):
        done = CliRunner().invoke(cli, ["run", "scene.toml", "--seed", "3", "-o", "out.nc", "--shard", f"{number}/3"])
        assert done.stdout == f"shard {number}/3 is done; when all are: sim merge out.nc\n"
    for name in ("scene.toml", "loads.csv", "speeds.csv", "psd.csv"):
        Path(name).unlink()  # all that the file holds is in the shards
    assert sim("merge", "out.nc").output == "out.nc\n"
    assert Path("out.nc").read_bytes() == Path("whole.nc").read_bytes()


@pytest.mark.parametrize("shard", ["0/3", "4/3", "3", "a/b", "1/3/4", "-1/3", "", f"1/{'9' * 5000}", "1/0"])
def test_a_wrong_shard_is_told(tmp_path, shard):
    (tmp_path / "scene.toml").write_text(TABLES)
    with pytest.raises(BadInput, match="--shard takes I/N with I from 1 to N, such as 3/64"):
        CliRunner().invoke(cli, ["run", str(tmp_path / "scene.toml"), "--shard", shard], catch_exceptions=False)
    assert names(tmp_path) == ["scene.toml"]


def test_a_wrong_time_is_told_with_an_example_of_its_size(tmp_path):
    (tmp_path / "scene.toml").write_text(TABLES)
    with pytest.raises(BadInput, match='; write for example "8 h"'):
        CliRunner().invoke(cli, ["run", str(tmp_path / "scene.toml"), "--max-time", "1 parsec"], catch_exceptions=False)
