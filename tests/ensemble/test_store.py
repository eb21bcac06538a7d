"""Blocks of a run: killed at any file operation it goes on as if nothing had happened; files of others stay."""

import errno
import functools
import importlib.metadata
import itertools
import os
import shutil
import signal
import sys
import threading
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner
from helpers import scenes
from helpers.cases import posix
from helpers.parts import Clock
from helpers.scenes import LOADS, LOADS_AND_SHARES, scene

from sim.cli import cli
from sim.ensemble import plan as plans, simulate as ensemble, store
from sim.ensemble.plan import Plan
from sim.ensemble.store import BlockFiles, OutputBusy, OutputExists, Stopped, Unfinished
from sim.numerics.files import DiskFull, StoreTrouble
from sim.units.errors import BadInput

pytestmark = pytest.mark.usefixtures("many_parts")
sample = functools.partial(scenes.sample, sweep=LOADS)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def same(path, scenario=None):
    """True if a file holds the numbers of an undivided run in one process, and nothing lies beside it."""
    assert names(path.parent) == [path.name]
    with xr.open_dataset(path, decode_times=False, decode_coords=False) as dataset:
        return dataset.reset_coords().equals(
            ensemble.run(scenario or sample()).reset_coords()
        )


def stopped(path, scenario=None, after=2, **how):
    """The folder of a run that was stopped after some blocks."""
    count = itertools.count()
    with pytest.raises(Stopped):
        ensemble.run(
            scenario or sample(), path, stop=lambda: next(count) >= after, **how
        )
    return path.with_name(f"{path.name}.parts")


def test_blocks_hold_every_step_once_even_if_a_record_takes_longer_than_a_block(
    monkeypatch,
):
    scenario = sample(clock=Clock(duration=12e-3, step=1e-4, record=6e-3))
    many = ensemble.run(scenario)
    plan = Plan.of(scenario)
    assert (
        plan.records_of_block(plan.points[0]) == 0
        and len(plan.blocks(plan.points[0])) > 4
    )
    monkeypatch.undo()
    xr.testing.assert_identical(ensemble.run(scenario), many)
    monkeypatch.setattr(ensemble, "_MEMBER_STEPS", 1)
    monkeypatch.setattr(ensemble, "_STEPS", 1)  # each record alone
    xr.testing.assert_identical(ensemble.run(scenario), many)
    for stride, most in itertools.product((1, 2, 5, 20), (1, 2, 3, 4, 7, 100)):
        monkeypatch.setattr(Plan, "_pieces", (2, most))
        plan = Plan.of(
            scene(3, clock=Clock(duration=20e-3, step=1e-3, record=stride * 1e-3))
        )
        blocks = plan.blocks(plan.points[0])
        assert [block.start for block in blocks] == [
            -1,
            *(block.end for block in blocks[:-1]),
        ]
        assert blocks[-1].end == 20
        assert [record for block in blocks for record in block.records] == list(
            range(20 // stride + 1)
        )
        assert max(block.end - block.start for block in blocks) <= max(most, 1)
        if most >= stride:
            assert all(block.end % stride == 0 for block in blocks)


def killed(operation, path, **how):
    """Run in a process of its own that is killed at one of its file operations; return how it ended."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    count, events = (
        itertools.count(1),
        {"open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.scandir"},
    )

    def step(event, *rest):
        if event in events and next(count) == operation:
            os.kill(os.getpid(), signal.SIGKILL)

    status = 1
    try:
        sys.addaudithook(step)
        ensemble.run(sample(), path, **how)
        status = 0
    finally:
        os._exit(status)


@posix
@pytest.mark.parametrize("some", [11, pytest.param(1, marks=pytest.mark.verify)])
def test_a_run_that_was_killed_at_a_file_operation_goes_on_to_the_same_numbers(
    tmp_path, some
):
    path, operation, ended = tmp_path / "killed" / "out.nc", 1, -signal.SIGKILL
    path.parent.mkdir()
    while ended:
        ended = killed(operation, path)
        assert ended in (0, -signal.SIGKILL)
        kept = {block.name: block.read_bytes() for block in path.parent.glob("*/*.npz")}
        # and a second time
        assert killed(operation // 2, path, resume=True) in (0, -signal.SIGKILL)
        for block in path.parent.glob("*/*.npz"):
            assert block.read_bytes() == kept.get(block.name, block.read_bytes())
        ensemble.run(sample(), path, resume=True)
        assert same(path)
        path.unlink()
        operation += some
    assert operation > 60


def test_a_run_goes_on_only_when_asked_and_only_as_it_was_begun(tmp_path, monkeypatch):
    path = tmp_path / "out.nc"
    folder = stopped(path)
    kept = {block: block.read_bytes() for block in folder.glob("*.npz")}
    assert len(kept) == 2
    with pytest.raises(OutputExists, match="--resume"):
        ensemble.run(sample(), path)
    with pytest.raises(
        BadInput, match=r"belongs to another run: scenario.ensemble.members was 3, is 4"
    ):
        ensemble.run(sample(members=4), path, resume=True)
    with pytest.raises(
        BadInput, match=r"belongs to another run: sweep was \['contact.load"
    ):
        turned = replace(
            sample(sweep=LOADS_AND_SHARES),
            sweep=sample(sweep=LOADS_AND_SHARES).sweep[::-1],
        )
        stopped(tmp_path / "two.nc", sample(sweep=LOADS_AND_SHARES))
        ensemble.run(turned, tmp_path / "two.nc", resume=True)
    with (
        monkeypatch.context() as patched,
        pytest.raises(BadInput, match=r"code was .*, is 6f74686572"),
    ):
        patched.setattr(store, "digest", lambda: b"other")
        ensemble.run(sample(), path, resume=True)
    assert {block: block.read_bytes() for block in folder.glob("*.npz")} == kept
    ensemble.run(sample(members=4), path, replace=True)
    assert not folder.exists()
    xr.Dataset({"a": 1.0}).to_netcdf(tmp_path / "foreign.nc")
    for content in (
        b"",
        path.read_bytes()[:3000],
        (tmp_path / "foreign.nc").read_bytes(),
    ):
        path.write_bytes(content)
        with pytest.raises(
            BadInput,
            match=r"out.nc: is not a netCDF .* written by `sim run`; move it away, .*--force$",
        ):
            ensemble.run(sample(), path, resume=True)


def test_blocks_that_are_there_are_not_computed_again(tmp_path, monkeypatch):
    stopped(tmp_path / "out.nc", after=3)
    done, counted, advance = [], [], ensemble.advance
    monkeypatch.setattr(
        ensemble, "advance", lambda *given: done.append(given[1]) or advance(*given)
    )
    ensemble.run(sample(), tmp_path / "out.nc", resume=True, progress=counted.append)
    assert sum(counted) == plans.work(Plan.of(sample()))
    assert len(done) == sum(len(task.names) for task in Plan.of(sample()).tasks()) - 3


def harmed(block, how):
    """Harm a block: bytes changed or cut, a name or a shape changed, a state lost, or a block of another run."""
    content = block.read_bytes()
    with np.load(block) as file:
        arrays = dict(file)
    first, state = (
        next(iter(arrays)),
        next(key for key in arrays if key.startswith("state.")),
    )
    harms = {
        "cut": content[:-9],
        "empty": b"",
        "changed": content[:999] + b"xyz" + content[1002:],
    }
    if how == "foreign":
        other = stopped(block.parent.with_name("other.nc"), sample(seed=6))
        (other / block.name).replace(block)
        shutil.rmtree(other)
        return
    if how in harms:
        block.write_bytes(harms[how])
        return
    if how == "shape":
        arrays[first] = arrays[first][..., :-1]
    elif how == "pickle":
        arrays[first] = np.array([{}], object)
    else:
        del arrays[{"state": state, "name": first}[how]]
    np.savez(block, **arrays)


@pytest.mark.parametrize(
    "how", ["cut", "empty", "changed", "shape", "name", "state", "pickle", "foreign"]
)
def test_a_damaged_block_is_computed_anew(tmp_path, how):
    path = tmp_path / "out.nc"
    folder = stopped(path, after=3)
    first = min(folder.glob("*.npz"))
    harmed(first, how)
    if how in ("cut", "empty", "pickle"):
        with pytest.raises(StoreTrouble, match="--resume"):
            BlockFiles(folder).load(first.stem)
    ensemble.run(sample(), path, resume=True)
    assert same(path)


@pytest.mark.parametrize("apart", [71, pytest.param(23, marks=pytest.mark.verify)])
def test_no_flipped_byte_of_a_block_is_silent(tmp_path, apart):
    blocks, task = BlockFiles(tmp_path), next(Plan.of(sample()).tasks())
    ensemble.simulate(Plan.of(sample()), blocks)
    path = blocks.path(task.names[0])
    content, numbers = (
        path.read_bytes(),
        blocks.load(task.names[0]) | blocks.state(task.names[0]),
    )
    for place in range(0, len(content), apart):
        path.write_bytes(
            content[:place]
            + bytes([content[place] ^ 1 << place % 8])
            + content[place + 1 :]
        )
        blocks.drop_damaged(task.names[0])
        if task.names[0] in blocks:  # such as a flip in the time of an entry
            read = blocks.load(task.names[0]) | blocks.state(task.names[0])
            assert read.keys() == numbers.keys()
            assert all(
                np.array_equal(read[key], numbers[key], equal_nan=True)
                for key in numbers
            )


def test_a_full_disk_is_told_with_what_a_run_takes_and_the_run_goes_on(tmp_path, room):
    size = ensemble.run(sample(), tmp_path / "whole" / "out.nc").stat().st_size
    path = tmp_path / "own" / "out.nc"
    for limit in (3_000, size // 2):  # a block has no room, then the dataset alone
        with (
            room(limit),
            pytest.raises(DiskFull, match=r"out.nc.parts: File too large; .*--resume"),
        ):
            ensemble.run(sample(), path, resume=True)
        assert not path.exists()
    ensemble.run(sample(), path, resume=True)
    assert same(path)


def test_a_file_that_comes_during_a_run_is_not_replaced(tmp_path):
    path = tmp_path / "out.nc"
    with pytest.raises(OutputExists, match="appeared during the run"):
        ensemble.run(
            sample(),
            path,
            progress=lambda done: path.write_text("precious", encoding="utf-8"),
        )
    assert path.read_text(encoding="utf-8") == "precious"
    path.unlink()
    ensemble.run(sample(), path, resume=True)
    assert same(path)


def test_a_run_that_replaces_an_output_and_is_stopped_goes_on_and_a_finished_one_is_left(
    tmp_path,
):
    path = ensemble.run(sample(seed=6), tmp_path / "out.nc")
    older = path.read_bytes()
    stopped(path, replace=True)
    assert path.read_bytes() == older
    ensemble.run(sample(), path, resume=True)
    assert same(path)
    before = path.stat()
    assert (
        ensemble.run(sample(), path, resume=True) == path
        and path.stat().st_mtime_ns == before.st_mtime_ns
    )
    with pytest.raises(
        BadInput, match=r"out.nc belongs to another run: scenario.seed was 5, is 6"
    ):
        ensemble.run(sample(seed=6), path, resume=True)
    assert names(tmp_path) == ["out.nc"]


def test_runs_of_an_older_version_are_named_and_folders_of_another_format_stay(
    tmp_path, monkeypatch
):
    path = ensemble.run(sample(), tmp_path / "out.nc")
    with (
        monkeypatch.context() as patched,
        pytest.raises(BadInput, match=r"made by sim .*: finish it by that version"),
    ):
        patched.setattr("sim.ensemble.dataset._version", lambda name: "9.9")
        ensemble.run(sample(), path, resume=True)
    for folder in ("old.nc.parts", "shards.nc.parts/1-of-2"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "manifest.json").write_text(
            '{"format": "another"}', encoding="utf-8"
        )
    for name in ("old.nc", "shards.nc"):
        with pytest.raises(
            OutputExists, match="is not the folder of a run; move it away"
        ):
            ensemble.run(sample(), tmp_path / name, replace=True)
        assert list((tmp_path / f"{name}.parts").rglob("manifest.json"))


@pytest.mark.parametrize("shard", [(1, 1), (1, 2)])
def test_an_unfinished_run_of_an_older_version_is_refused_by_its_name_and_stays(
    tmp_path, monkeypatch, shard
):
    """Parts of two versions are not mixed even if scenario and code are the same: a library may have changed."""
    path, newer = tmp_path / "out.nc", "9.9"
    folder = stopped(path, after=1, shard=shard)
    kept = {file: file.read_bytes() for file in folder.iterdir()}
    assert any(file.suffix == ".npz" for file in kept)
    version = importlib.metadata.version
    with monkeypatch.context() as patched:
        patched.setattr(
            "sim.ensemble.dataset._version",
            lambda name: newer if name == "sliding-sim" else version(name),
        )
        with pytest.raises(BadInput) as refused:
            ensemble.run(sample(), path, resume=True, shard=shard)
        (message,) = refused.value.problems
        assert message.startswith(
            f"{folder} was made by sim {version('sliding-sim')}: finish it by that version"
        )
        assert {file: file.read_bytes() for file in folder.iterdir()} == kept
        done = ensemble.run(sample(), path, replace=True)
        with xr.open_dataset(done, decode_times=False) as dataset:
            assert dataset.attrs["sim_version"] == newer
    assert same(path)


@pytest.mark.parametrize("method", ["begin", "publish"])
def test_blocks_of_two_runs_do_not_mix(tmp_path, monkeypatch, method):
    """Another run replaces a run that has begun, or whose blocks are all there: the first one ends."""
    path, original = tmp_path / "out.nc", getattr(Unfinished, method)

    def replaced(self, *given):
        patched.undo()
        if method == "publish":
            stopped(path, sample(seed=6), replace=True)
        result = original(self, *given)
        if method == "begin":
            stopped(path, sample(seed=6), replace=True)
        return result

    with (
        monkeypatch.context() as patched,
        pytest.raises(BadInput, match=r"belongs to another run: scenario.seed was 6"),
    ):
        patched.setattr(Unfinished, method, replaced)
        ensemble.run(sample(), path)
    block = min((tmp_path / "out.nc.parts").glob("*.npz"))
    with pytest.raises(StoreTrouble, match="--resume"):
        BlockFiles(block.parent, "the first run").load(block.stem)
    ensemble.run(sample(seed=6), path, resume=True)
    assert same(path, sample(seed=6))


@posix
def test_a_folder_that_no_run_made_is_not_touched_nor_files_of_others_in_one(tmp_path):
    other, folder = tmp_path / "precious", tmp_path / "out.nc.parts"
    other.mkdir()
    (other / "thesis.txt").write_text("years", encoding="utf-8")
    folder.symlink_to(other)
    for _ in range(2):
        with pytest.raises(
            OutputExists, match="is not the folder of a run; move it away"
        ):
            ensemble.run(sample(), tmp_path / "out.nc", replace=True)
        assert names(folder) == ["thesis.txt"]
        if folder.is_symlink():
            folder.unlink()
            other.rename(folder)
    path = tmp_path / "out.nc"
    shutil.rmtree(folder)
    (stopped(path) / "notes.txt").write_text("do not forget", encoding="utf-8")
    ensemble.run(sample(), path, resume=True)
    assert names(folder) == ["notes.txt"]


@pytest.mark.parametrize(
    "trouble", [None, pytest.param(OSError(errno.ENOLCK, "no locks"), marks=posix)]
)
def test_two_runs_do_not_share_an_output_even_on_a_file_system_without_locks(
    tmp_path, monkeypatch, trouble
):
    path = tmp_path / "out.nc"
    with monkeypatch.context() as patched:
        if trouble:
            patched.setattr("fcntl.flock", Mock(side_effect=trouble))
        busy = (
            "another run is writing"
            if trouble is None
            else "if that process was killed .*, delete .*shard-1-of-1"
        )
        with pytest.raises(OutputBusy, match=busy):
            ensemble.run(
                sample(),
                path,
                progress=lambda done: ensemble.run(sample(), path, resume=True),
            )
        ensemble.run(sample(), path, resume=True)
    assert same(path)


def test_a_waiter_that_finds_the_folder_gone_begins_anew(tmp_path):
    path, other = tmp_path / "out.nc", []
    folder = Unfinished(path, {"scenario": {}}, [], lambda path: {})
    waiter = threading.Thread(
        target=lambda: other.append(folder.publish([], 1, Path.touch))
    )
    folder.begin((1, 1), False, False, [])

    def write(dataset):
        waiter.start()  # waits for the lock of the output, which this run holds
        dataset.touch()

    assert folder.publish([], 1, write)
    waiter.join()
    assert other == [None] and names(tmp_path) == ["out.nc"]


def test_a_folder_that_goes_just_as_a_waiter_finds_it_is_made_anew(
    tmp_path, monkeypatch
):
    path, makes, make = tmp_path / "out.nc", [], os.mkdir

    def mkdir(name, mode=0o777):
        makes.extend([name] if Path(name) != tmp_path else [])
        # the run that was done removes its folder between this answer and the next question
        if makes == [name]:
            raise FileExistsError(errno.EEXIST, "File exists", name)
        make(name, mode)

    monkeypatch.setattr(os, "mkdir", mkdir)
    assert (
        Unfinished(path, {"scenario": {}}, [], lambda path: {}).publish(
            [], 1, Path.touch
        )
        is None
    )
    assert len(makes) > 1 and not names(tmp_path)


def test_a_folder_that_windows_is_still_removing_is_made_when_it_is_gone(
    tmp_path, monkeypatch
):
    path, refusals, make = tmp_path / "out.nc", [5, 5], os.mkdir

    def mkdir(name, mode=0o777):
        if refusals and Path(name) != tmp_path:
            refusals.pop()
            raise PermissionError(errno.EACCES, "Access is denied", name)
        make(name, mode)

    monkeypatch.setattr(os, "mkdir", mkdir)
    folder = Unfinished(path, {"scenario": {}}, [], lambda path: {})
    assert folder.publish([], 1, Path.touch) is None
    assert not refusals and not names(tmp_path)


def test_a_manifest_that_another_process_reads_is_removed_when_it_has_been_read(
    tmp_path, monkeypatch
):
    path, refusals, unlink = (
        tmp_path / "out.nc",
        [PermissionError(errno.EACCES, "in use")] * 2,
        Path.unlink,
    )

    def held(file, **how):
        if file.name == "manifest.json" and refusals:
            raise refusals.pop()
        unlink(file, **how)

    monkeypatch.setattr(Path, "unlink", held)
    ensemble.run(sample(), path)
    assert same(path) and not refusals


shared = functools.partial(scenes.sample, members=7, sweep=LOADS_AND_SHARES)


def test_every_task_is_in_one_shard_and_the_last_that_is_done_publishes_the_numbers_of_an_undivided_run(
    tmp_path,
):
    for of in [1, 2, 3, 5, 20]:
        plan = Plan.of(shared())
        shares = [
            [task.names[0] for task in plan.share(number, of)]
            for number in range(1, of + 1)
        ]
        assert sorted(itertools.chain(*shares)) == sorted(
            task.names[0] for task in plan.tasks()
        )
        assert (
            sum(plans.work(plan, number, of) for number in range(1, of + 1))
            == plans.work(plan)
            == 7 * 10 * 4
        )
    path, done = tmp_path / "out.nc", []
    for number in (3, 1, 2):
        assert not path.exists()
        done.append([])
        ensemble.run(shared(), path, shard=(number, 3), progress=done[-1].append)
    assert [sum(each) for each in done] == [
        plans.work(Plan.of(shared()), number, 3) for number in (3, 1, 2)
    ]
    assert same(path, shared())
    for how in ({"shard": (2, 3)}, {}):  # all is done
        assert ensemble.run(shared(), path, resume=True, **how) == path
    before = path.stat()
    # a shard without work changes nothing
    for target in (path, tmp_path / "folder" / "other.nc"):
        assert ensemble.run(shared(), target, shard=(999, 999)) == target
    assert path.stat() == before and names(tmp_path) == ["out.nc"]


def test_a_run_without_shard_computes_what_no_shard_holds_and_names_the_others(
    tmp_path,
):
    path, refused = tmp_path / "out.nc", []
    stopped(path, shared(), after=1, shard=(1, 3))

    def others(done):
        for how, fault in (
            ()
            if refused
            else (
                ({"resume": True}, "the shards 2/3 of"),
                ({"shard": (2, 3), "resume": True}, "another run"),
                ({"shard": (2, 3)}, None),
                ({"shard": (2, 3), "replace": True}, None),
                ({}, None),
                ({"shard": (1, 2), "replace": True}, None),
            )
        ):
            with pytest.raises((OutputBusy, OutputExists), match=fault):
                ensemble.run(shared(), path, **how)
        refused.append(True)

    ensemble.run(shared(), path, shard=(2, 3), progress=others)
    assert refused and same(path, shared())


def test_a_shard_that_was_stopped_goes_on(tmp_path):
    path = tmp_path / "out.nc"
    folder = stopped(path, shared(), shard=(1, 2))
    ensemble.run(shared(), path, shard=(2, 2))
    for scenario, number in ((shared(), 1), (shared(seed=6), 2)):
        with pytest.raises(OutputExists, match="--resume"):
            ensemble.run(scenario, path, shard=(number, 2))
    with pytest.raises(BadInput, match="shards was 2, is 3"):
        ensemble.run(shared(), path, shard=(1, 3), resume=True)
    first = min(folder.glob("*.npz"))
    first.write_bytes(first.read_bytes()[:-1])
    ensemble.run(shared(), path, shard=(1, 2), resume=True)
    assert same(path, shared())


def test_the_shards_of_a_large_array_are_computed_some_at_a_time(tmp_path, monkeypatch):
    monkeypatch.setattr(ensemble, "_LOCKS", 2)
    for number in (1, 4):
        ensemble.run(shared(), tmp_path / "out.nc", shard=(number, 5))
    counted = []
    ensemble.run(shared(), tmp_path / "out.nc", resume=True, progress=counted.append)
    assert sum(counted) == plans.work(Plan.of(shared())) and same(
        tmp_path / "out.nc", shared()
    )


def test_a_shard_that_replaces_begins_only_its_own_blocks_anew(tmp_path):
    path = ensemble.run(shared(seed=6), tmp_path / "out.nc")
    for number in (1, 2, 1, 3):
        ensemble.run(shared(), path, shard=(number, 3), replace=True)
    assert same(path, shared())


@pytest.mark.parametrize("shard", ["0/3", "4/3", "3", "a/b", f"1/{'9' * 5000}"])
def test_a_wrong_shard_is_told(tmp_path, monkeypatch, shard):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadInput, match="--shard"):
        CliRunner().invoke(
            cli, ["run", "scene.toml", "--shard", shard], catch_exceptions=False
        )
