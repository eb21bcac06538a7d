"""Processes that share a run: the same bytes for any number, whatever dies on the way."""

import functools
import itertools
import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from helpers import scenes
from helpers.chatty import chatty
from helpers.scenes import LOADS

from sim.ensemble import plan as plans, simulate as ensemble
from sim.ensemble.part_files import PartFiles, Stopped
from sim.ensemble.plan import Plan
from sim.ensemble.workers import WorkerDied, _call, in_process, share_out

sample = functools.partial(scenes.sample, sweep=LOADS)


def code(text):
    """A task of a process."""
    return exec, (text,)


def never():
    return False


def test_tasks_are_done_once_each_by_several_processes(tmp_path):
    tasks = [code(f"import os; open({str(tmp_path / str(i))!r}, 'x').write(str(os.getpid()))") for i in range(20)]
    share_out(_call, tasks, 3, print, never)
    assert len({path.read_text() for path in tmp_path.iterdir()}) in (2, 3)
    assert len(list(tmp_path.iterdir())) == 20


def test_what_a_task_raises_is_raised_and_the_others_end():
    began = time.monotonic()
    with pytest.raises(ZeroDivisionError):
        share_out(_call, [code("1 / 0"), code("import time; time.sleep(99)")], 2, print, never)
    assert time.monotonic() - began < 60
    with pytest.raises(OSError, match="No space left"):
        in_process(exec, "raise OSError(28, 'No space left on device')")


def test_a_process_that_dies_is_replaced(tmp_path):
    def fragile(i, deaths):
        mine = str(tmp_path / f"{i}-")
        count = f"import os, glob; n = len(glob.glob({mine!r} + '*')); open({mine!r} + str(n), 'x')"
        return code(f"{count}; n < {deaths} and os.kill(os.getpid(), 9)")

    share_out(_call, [fragile(0, 2), fragile(1, 0), fragile(2, 1)], 2, print, never)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0-0", "0-1", "0-2", "1-0", "2-0", "2-1"]


def test_a_task_whose_process_dies_three_times_is_given_up_and_the_rest_is_done(tmp_path):
    last = code(f"open({str(tmp_path / 'done')!r}, 'x')")
    with pytest.raises(WorkerDied, match=r"given up after 3 times each: .*os.abort.* \(SIGABRT\); the rest is done"):
        share_out(_call, [code("import os; os.abort()"), last], 2, print, never)
    assert (tmp_path / "done").exists()
    with pytest.raises(WorkerDied, match="the process that makes the dataset ended with SIGSEGV"):
        in_process(exec, "import os; os.kill(os.getpid(), 11)")


def test_no_task_is_begun_after_a_stop(tmp_path):
    tasks = [code(f"import time; time.sleep(1); open({str(tmp_path / str(i))!r}, 'x')") for i in range(9)]
    asked = itertools.count()
    share_out(_call, tasks, 2, print, lambda: next(asked) > 1)
    assert len(list(tmp_path.iterdir())) == 2


def test_a_stop_is_heard_however_much_is_reported(tmp_path):
    heard = []
    share_out(chatty, [2000, 2000], 2, heard.append, lambda: len(heard) > 5)
    assert sum(heard) == 4000


def test_processes_import_what_this_one_would_and_nothing_of_the_present_folder(tmp_path, monkeypatch):
    for name in ("sim", "queue", "numpy"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('wrong')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path])
    share_out(_call, [code(f"open({str(tmp_path / 'done')!r}, 'x')")], 1, print, never)
    assert (tmp_path / "done").exists()


def test_a_daemon_may_run_scenes(tmp_path):
    script = "import multiprocessing as m; from sim.ensemble.workers import in_process\n"
    script += f"m.get_context('fork').Pool(1).apply(in_process, (open, {str(tmp_path / 'made')!r}, 'x'))"
    subprocess.run([sys.executable, "-c", script], check=True)
    assert (tmp_path / "made").exists()


@pytest.mark.parametrize("jobs", [2, *(pytest.param(jobs, marks=pytest.mark.verify) for jobs in (3, 5))])
def test_any_number_of_processes_gives_the_same_bytes(tmp_path, monkeypatch, jobs):
    monkeypatch.setattr(plans, "_GROUP", 2)
    alone, counted = ensemble.run(sample(), tmp_path / "alone.nc").read_bytes(), []
    assert ensemble.run(sample(), tmp_path / "out.nc", jobs=jobs, progress=counted.append).read_bytes() == alone
    assert sum(counted) == plans.work(Plan.of(sample()))
    assert sorted(path.name for path in tmp_path.glob("*.nc*")) == [
        "alone.nc",
        "alone.nc.sha256",
        "out.nc",
        "out.nc.sha256",
    ]


def test_a_run_whose_processes_are_killed_gives_the_same_bytes(tmp_path, monkeypatch):
    scenario = sample(members=40, steps=400)
    monkeypatch.setattr(plans, "_GROUP", 2)
    alone = ensemble.run(scenario, tmp_path / "alone.nc").read_bytes()
    killed = set()

    def kill(done):
        """Every twentieth time the youngest child that was not killed yet."""
        if next(times) % 20 == 5:
            found = subprocess.run(
                ["pgrep", "-n", "-P", str(os.getpid()), "-f", "serve"], capture_output=True, text=True
            )
            if found.stdout.strip() and len(killed) < 2:
                os.kill(int(found.stdout), signal.SIGKILL)
                killed.add(found.stdout)

    times = itertools.count()
    assert ensemble.run(scenario, tmp_path / "out.nc", jobs=2, progress=kill).read_bytes() == alone
    assert len(killed) > 1


def test_a_run_that_is_stopped_again_and_again_gives_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.setattr(plans, "_GROUP", 2)
    monkeypatch.setattr(plans, "_BLOCK_SECONDS", 6e-5)
    alone, path, stops = ensemble.run(sample(), tmp_path / "alone.nc").read_bytes(), tmp_path / "out.nc", 0
    while not path.exists():
        asked = itertools.count()
        try:
            ensemble.run(sample(), path, resume=True, jobs=1 + stops % 2, stop=lambda count=asked: next(count) > 1)
        except Stopped:
            stops += 1
            assert list(PartFiles(tmp_path / "out.nc.parts").folder.glob("*.part"))
    assert stops > 2
    assert path.read_bytes() == alone


def test_a_run_in_memory_may_use_several_processes(monkeypatch):
    import xarray as xr

    monkeypatch.setattr(plans, "_GROUP", 2)
    xr.testing.assert_identical(ensemble.run(sample(), jobs=2), ensemble.run(sample()))


def test_processes_need_no_guard_in_the_script_that_starts_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import sim, os\n"
        "from sim.ensemble import plan\n"
        "plan._GROUP = 1\n"
        "print('begun')\n"
        "scene = dict(clock=dict(duration='4 ms', step='1 ms'), solid=dict(shear_modulus='1 MPa'),\n"
        "    sphere=dict(radius='1 mm'), adhesion=dict(work='40 mJ/m^2'), contact=dict(load='1 mN'),\n"
        "    drive=dict(speed='1 mm/s'), bonds=dict(model='counted', critical_speed='1 mm/s', rebinding_rate='9 1/s',\n"
        "    sites=9), ensemble=dict(members=3))\n"
        "print(sim.run(scene, jobs=2).sizes['member'])\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["begun", "3"]


@pytest.fixture(params=["copy", "new process"])
def either(request, monkeypatch):
    """Work in a copy of this process, or in a new one because another thread runs here."""
    used, spawn = [], subprocess.Popen
    monkeypatch.setattr(subprocess, "Popen", lambda *given, **how: used.append(given) or spawn(*given, **how))
    if request.param == "copy":
        monkeypatch.setattr(threading, "active_count", lambda: 1)
        yield
        assert not used
    else:
        done = threading.Event()
        waiting = threading.Thread(target=done.wait)
        waiting.start()
        yield
        done.set()
        waiting.join()
        assert used


def test_work_is_done_elsewhere_and_what_it_raises_comes_back(either, tmp_path):
    in_process(os.mkdir, tmp_path / "made")
    assert (tmp_path / "made").is_dir()
    with pytest.raises(FileExistsError):
        in_process(os.mkdir, tmp_path / "made")


def test_a_crash_ends_the_other_process_alone(either):
    with pytest.raises(WorkerDied, match="SIGABRT"):
        in_process(os.abort)
    with pytest.raises(WorkerDied, match="exit status 3"):
        in_process(os._exit, 3)


def test_an_interrupt_of_the_terminal_does_not_end_it(either, tmp_path):
    made = tmp_path / "made"
    in_process(exec, f"import signal; signal.raise_signal(signal.SIGINT); open({str(made)!r}, 'x')")
    assert made.exists()
