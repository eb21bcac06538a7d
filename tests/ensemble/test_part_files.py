"""Parts of a run: killed at every file operation it goes on as if nothing had happened; files of others stay."""

import errno
import functools
import hashlib
import itertools
import os
import signal
import sys
import time
from pathlib import Path

import pytest
import xarray as xr
from helpers import scenes
from helpers.scenes import LOADS, scene

from sim.ensemble import plan as plans, simulate as ensemble
from sim.ensemble.checksums import verify
from sim.ensemble.part_files import OutputBusy, OutputExists, PartFiles, held
from sim.ensemble.plan import Plan
from sim.numerics.files import DiskFull, StoreTrouble, leased, locked
from sim.scenario.clock import Clock
from sim.units.errors import BadInput

pytestmark = pytest.mark.usefixtures("many_parts")
sample = functools.partial(scenes.sample, sweep=LOADS)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_blocks_hold_every_step_once_and_end_at_records_or_between_them(monkeypatch):
    for stride, most in itertools.product((1, 2, 5, 20), (1, 2, 3, 4, 7, 100)):
        monkeypatch.setattr(Plan, "_pieces", (2, most))
        plan = Plan.of(scene(3, clock=Clock(duration=20e-3, step=1e-3, record=stride * 1e-3)))
        blocks = plan.blocks(plan.points[0])
        assert [block.start for block in blocks] == [-1, *(block.end for block in blocks[:-1])]
        assert blocks[-1].end == 20
        assert [record for block in blocks for record in block.records] == list(range(20 // stride + 1))
        assert max(block.end - block.start for block in blocks) <= max(most, 1)
        if most >= stride:
            assert all(block.end % stride == 0 for block in blocks)


def test_a_record_that_takes_longer_than_a_block_gives_the_same_dataset(monkeypatch):
    scenario = sample(clock=Clock(duration=12e-3, step=1e-4, record=6e-3))
    many = ensemble.run(scenario)
    plan = Plan.of(scenario)
    assert plan.records_of_block(plan.points[0]) == 0
    assert len(plan.blocks(plan.points[0])) > 4
    monkeypatch.undo()
    xr.testing.assert_identical(ensemble.run(scenario), many)


def killed(operation, scenario, path, **how):
    """Run in a process of its own that is killed at one of its file operations; gives how it ended."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    count, sync = itertools.count(1), os.fsync

    def step(event, *rest):
        if event in {
            "open",
            "os.rename",
            "os.remove",
            "os.link",
            "os.mkdir",
            "os.rmdir",
            "os.scandir",
            "os.listdir",
            "sync",
        }:
            os.kill(os.getpid(), signal.SIGKILL if next(count) == operation else 0)

    status = 1
    try:
        os.fsync = lambda descriptor: (step("sync"), sync(descriptor))
        sys.addaudithook(step)
        ensemble.run(scenario, path, **how)
        status = 0
    finally:
        os._exit(status)


@pytest.mark.parametrize("some", [13, pytest.param(1, marks=pytest.mark.verify)])
def test_a_run_that_was_killed_at_a_file_operation_goes_on_to_the_same_bytes(tmp_path, monkeypatch, some):
    if some > 1:  # the last file in this process, which is quicker
        monkeypatch.setattr("sim.ensemble.netcdf.in_process", lambda work, *arguments: work(*arguments))
    scenario = sample()
    whole = ensemble.run(scenario, tmp_path / "whole.nc").read_bytes()
    path, operation, ended = tmp_path / "killed" / "out.nc", 1, -signal.SIGKILL
    path.parent.mkdir()
    while ended:
        ended = killed(operation, scenario, path)
        assert ended in (0, -signal.SIGKILL) or (some == 1 and ended == 1)  # 1: the process that writes alone
        assert not path.exists() or path.read_bytes() == whole
        kept = {part.name: part.read_bytes() for part in path.parent.glob("*/*.part")}
        again = killed(operation // 2, scenario, path, resume=True)  # and a second time
        assert again in (0, -signal.SIGKILL) or (some == 1 and again == 1)
        for part in path.parent.glob("*/*.part"):
            assert part.read_bytes() == kept.get(part.name, part.read_bytes())
        assert ensemble.run(scenario, path, resume=True).read_bytes() == whole
        assert names(path.parent) == ["out.nc", "out.nc.sha256"]
        verify(path)
        path.unlink()
        operation += some
    assert operation > 100


def stopped(scenario, path, after=2):
    """The folder of a run that ended after some parts."""
    with pytest.raises(KeyboardInterrupt), pytest.MonkeyPatch.context() as patched:
        count, save = itertools.count(), PartFiles.save

        def some(*arguments):
            if next(count) == after:
                raise KeyboardInterrupt
            save(*arguments)

        patched.setattr(PartFiles, "save", some)
        ensemble.run(scenario, path)
    return path.with_name(f"{path.name}.parts")


def test_a_run_goes_on_only_when_asked_and_only_as_it_was_begun(tmp_path):
    path = tmp_path / "out.nc"
    folder = stopped(sample(), path)
    kept = {part: part.read_bytes() for part in folder.glob("*.part")}
    assert len(kept) == 2
    with pytest.raises(OutputExists, match=r"out.nc.parts holds an unfinished run; go on with --resume"):
        ensemble.run(sample(), path)
    with pytest.raises(BadInput, match=r"is of another run: scenario.ensemble.members was 3, is 4; run what was begun"):
        ensemble.run(sample(members=4), path, resume=True)
    assert {part: part.read_bytes() for part in folder.glob("*.part")} == kept
    ensemble.run(sample(members=4), path, replace=True)
    assert not folder.exists()


def test_parts_that_are_there_are_not_computed_again(tmp_path, monkeypatch):
    path = tmp_path / "out.nc"
    stopped(sample(), path, after=3)
    done, follow = [], ensemble.follow
    monkeypatch.setattr(ensemble, "follow", lambda *given: done.append(given[3]) or follow(*given))
    counted = []
    ensemble.run(sample(), path, resume=True, progress=counted.append)
    everything = sum(counted)
    assert everything == plans.work(Plan.of(sample()))
    done_before = len(done)
    ensemble.run(sample(), tmp_path / "other.nc")
    assert len(done) - done_before == done_before + 3


def test_a_dataset_for_which_there_is_no_room_is_told_with_what_it_takes_and_its_run_goes_on(tmp_path, room):
    whole, path = ensemble.run(sample(), tmp_path / "whole.nc").read_bytes(), tmp_path / "out.nc"
    said = r"out.nc.parts: File too large; parts and dataset take \d+ kB until they are one file; make room, .*--resume"
    with room(len(whole) // 2), pytest.raises(DiskFull, match=said):  # the parts have room
        ensemble.run(sample(), path)
    assert not path.exists()
    assert ensemble.run(sample(), path, resume=True).read_bytes() == whole


def test_a_file_that_comes_during_a_run_is_not_replaced(tmp_path):
    path = tmp_path / "out.nc"
    with pytest.raises(OutputExists, match="has come during the run, which does not replace it: move it away"):
        ensemble.run(sample(), path, progress=lambda done: path.write_text("precious"))
    assert path.read_text() == "precious"
    path.rename(tmp_path / "kept")
    whole = ensemble.run(sample(), tmp_path / "whole.nc").read_bytes()
    assert ensemble.run(sample(), path, resume=True).read_bytes() == whole


def test_parts_of_other_code_are_refused(tmp_path, monkeypatch):
    stopped(sample(), tmp_path / "out.nc")
    monkeypatch.setattr("sim.ensemble.part_files.digest", lambda: b"other")
    with pytest.raises(
        BadInput, match=r"out.nc.parts is of another run: code was .*, is 6f74686572; run what was begun"
    ):
        ensemble.run(sample(), tmp_path / "out.nc", resume=True)


def test_a_finished_run_is_left_as_it_is(tmp_path):
    path = ensemble.run(sample(), tmp_path / "out.nc")
    before = path.stat()
    assert ensemble.run(sample(), path, resume=True) == path
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    with pytest.raises(BadInput, match=r"out.nc is of another run: scenario.seed was 5, is 6"):
        ensemble.run(sample(seed=6), path, resume=True)
    assert names(tmp_path) == ["out.nc", "out.nc.sha256"]


def test_a_run_that_replaces_an_output_and_is_stopped_goes_on_to_replace_it(tmp_path):
    path = ensemble.run(sample(seed=6), tmp_path / "out.nc")
    wanted = ensemble.run(sample(), tmp_path / "wanted.nc").read_bytes()
    older = path.read_bytes()
    with pytest.raises(ZeroDivisionError):
        ensemble.run(sample(), path, replace=True, progress=lambda done: 1 / 0)
    assert path.read_bytes() == older
    assert ensemble.run(sample(), path, resume=True).read_bytes() == wanted


@pytest.mark.parametrize(
    "harm", [lambda whole: whole[:-9], lambda whole: b"", lambda whole: whole[:99] + b"x" + whole[100:]]
)
def test_a_damaged_part_is_computed_anew(tmp_path, harm):
    path = tmp_path / "out.nc"
    folder = stopped(sample(), path, after=3)
    first = min(folder.glob("*.part"))
    sound = first.read_bytes()
    first.write_bytes(harm(sound))
    with pytest.raises(StoreTrouble, match=r"block000000.part is damaged; go on with --resume"):
        PartFiles(folder).load(first.stem)
    whole = ensemble.run(sample(), tmp_path / "whole.nc").read_bytes()
    assert ensemble.run(sample(), path, resume=True).read_bytes() == whole


_ODD = [b'{"a": ["|O", [1]]}\n12345678', b'{"a": ["<f8", [9]]}\n', b"[1]\n", b'{"a": 1}\n', b""]


@pytest.mark.parametrize("line", _ODD)
def test_a_part_that_no_run_has_written_is_damaged_whatever_its_sum(tmp_path, line):
    (tmp_path / "x.part").write_bytes(hashlib.sha256(line).digest() + line)
    with pytest.raises(StoreTrouble, match=r"x\.part is damaged"):
        PartFiles(tmp_path).load("x")


def test_a_folder_that_no_run_made_is_not_touched(tmp_path):
    other, path = tmp_path / "precious", tmp_path / "out.nc"
    other.mkdir()
    (other / "thesis.txt").write_text("years")
    (other / "lock").write_text("mine")
    folder = tmp_path / "out.nc.parts"
    folder.symlink_to(other)
    with pytest.raises(OutputExists, match="is not the folder of a run; move it away"):
        ensemble.run(sample(), path, replace=True)
    folder.unlink()
    other.rename(folder)
    with pytest.raises(OutputExists, match="is not the folder of a run; move it away"):
        ensemble.run(sample(), path, replace=True)
    assert {left.name: left.read_text() for left in folder.iterdir()} == {"thesis.txt": "years", "lock": "mine"}


def test_files_that_others_put_into_the_folder_stay(tmp_path):
    path = tmp_path / "out.nc"
    folder = stopped(sample(), path)
    (folder / "notes.txt").write_text("do not forget")
    ensemble.run(sample(), path, resume=True)
    assert [left.name for left in folder.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("make", [lambda lock: os.mkfifo(lock), lambda lock: lock.symlink_to("elsewhere"), Path.mkdir])
def test_a_lock_that_is_no_plain_file_is_neither_followed_nor_waited_for(tmp_path, make):
    folder = tmp_path / "out.nc.parts"
    folder.mkdir()
    make(folder / "lock")
    with pytest.raises(StoreTrouble, match="lock"):
        ensemble.run(sample(), tmp_path / "out.nc")
    assert not (folder / "elsewhere").exists()


def test_two_runs_do_not_share_an_output(tmp_path):
    path = tmp_path / "out.nc"
    with held(path, {}, {}, resume=False, replace=False, read=dict), pytest.raises(OutputBusy, match="another run"):
        ensemble.run(sample(), path)


def test_a_lock_that_its_holder_removed_is_none(tmp_path):
    folder, made = tmp_path / "run", itertools.count()

    def prepare():
        folder.mkdir(exist_ok=True)
        if next(made) == 0:  # between this and the lock another run ends, and a third begins
            real = os.open

            def late(path, *rest):
                descriptor = real(path, *rest)
                os.unlink(path)
                os.close(real(path, os.O_CREAT | os.O_WRONLY))
                patched.undo()
                return descriptor

            patched.setattr(os, "open", late)

    with pytest.MonkeyPatch.context() as patched, locked(folder / "lock", prepare) as free:
        assert free
        assert next(made) == 2
        with locked(folder / "lock", lambda: None) as second:
            assert not second


def test_where_the_file_system_has_no_locks_a_lease_stands_in(tmp_path, monkeypatch):
    def none(*arguments):
        raise OSError(errno.ENOLCK, "No locks available")

    path = tmp_path / "out.nc"
    with monkeypatch.context() as patched:
        patched.setattr("fcntl.flock", none)
        with held(path, {}, {}, resume=False, replace=False, read=dict), pytest.raises(OutputBusy, match="another run"):
            ensemble.run(sample(), path)
        whole = ensemble.run(sample(), path).read_bytes()
    assert names(tmp_path) == ["out.nc", "out.nc.sha256"]
    assert ensemble.run(sample(), path, replace=True).read_bytes() == whole


def test_a_lease_is_renewed_and_one_that_was_not_is_taken_over(tmp_path):
    lease = tmp_path / "lease"
    with leased(lease, beat=0.01) as free:
        assert free
        time.sleep(0.2)  # twenty beats
        with leased(lease, beat=0.01) as second:
            assert not second
    assert not lease.exists()
    lease.touch()
    os.utime(lease, (0.0, 0.0))
    with leased(lease) as free:
        assert free
    assert not list(tmp_path.iterdir())


def test_trouble_after_the_output_is_there_does_not_undo_it(tmp_path, monkeypatch):
    clean = PartFiles.clean

    def broken(parts, keep):
        if (tmp_path / "out.nc").exists():
            raise OSError(errno.EIO, "I/O error")
        clean(parts, keep)

    with monkeypatch.context() as patched:
        patched.setattr(PartFiles, "clean", broken)
        assert ensemble.run(sample(), tmp_path / "out.nc").exists()
    ensemble.run(sample(), tmp_path / "out.nc", resume=True)
    assert names(tmp_path) == ["out.nc", "out.nc.sha256"]
