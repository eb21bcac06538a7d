"""Workers that share a run, processes or a dask cluster: the numbers of one process, whatever dies on the way."""

import ast
import concurrent.futures
import contextlib
import functools
import itertools
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import psutil
import pytest
from click.testing import CliRunner
from helpers import deadly, scenes
from helpers.scenes import CONTACTS, LOADS

import sim
from sim.cli import cli
from sim.ensemble import execute, plan as plans, simulate as ensemble
from sim.ensemble.execute import WorkerDied, compute, pickled
from sim.ensemble.plan import Plan
from sim.ensemble.store import BlockFiles, MemoryBlocks, Stopped
from sim.numerics import jit
from sim.step.stepper import Stepper
from sim.units.errors import BadInput
from sim.units.quantity import keyed
from tests.ensemble.test_store import same

sample = functools.partial(scenes.sample, sweep=LOADS)


def never():
    return False


def workers(parent=None):
    """The processes of pools that a process has started."""
    found = []
    for child in psutil.Process(parent).children(recursive=True):
        try:
            # of POSIX, of Windows
            if any(
                "LokyProcess" in word or "popen_loky" in word
                for word in child.cmdline()
            ):
                found.append(child)
        except psutil.Error:  # one that ends now
            continue
    return found


def test_the_schema_of_a_local_class_is_built_before_it_goes_to_another_process():
    @keyed()
    class Local:
        value: float = 0.0

    assert not Local.__pydantic_complete__
    assert pickle.loads(pickled(Local))(value=2.0).value == 2.0
    assert Local.__pydantic_complete__


@pytest.mark.parametrize(
    "jobs", [2, *(pytest.param(jobs, marks=pytest.mark.verify) for jobs in (3, 5))]
)
def test_any_number_of_processes_gives_the_same_numbers_of_threads_too(
    tmp_path, many_parts, jobs
):
    counted = []
    how = {"jobs": jobs, "progress": counted.append}
    thread = threading.Thread(
        target=lambda: ensemble.run(sample(), tmp_path / "out.nc", **how)
    )
    thread.start()
    thread.join()
    assert sum(counted) == plans.work(Plan.of(sample())) and same(tmp_path / "out.nc")
    # of classes that are local
    scenario = sample(members=5, sweep=None, contact=CONTACTS["load there and back"])
    assert ensemble.run(scenario, jobs=jobs).identical(ensemble.run(scenario))


def test_a_worker_that_dies_costs_its_blocks_alone(tmp_path, many_parts):
    counted = []

    def kill(done):
        if not counted:
            workers()[0].kill()
        counted.append(done)

    scenario = sample(members=8, steps=40)
    ensemble.run(scenario, tmp_path / "out.nc", jobs=2, progress=kill)
    assert (
        sum(counted) == plans.work(Plan.of(scenario))
        and same(tmp_path / "out.nc", scenario)
        and not workers()
    )


@pytest.mark.parametrize(
    ("advance", "fault", "jobs"),
    [
        (deadly.advance, WorkerDied, 2),
        *((deadly.advance_faulty, ZeroDivisionError, jobs) for jobs in (1, 2)),
    ],
)
def test_a_block_that_raises_or_breaks_three_pools_is_given_up_and_the_others_are_kept(
    tmp_path, many_parts, advance, fault, jobs
):
    tasks = [(task, list(range(len(task.names)))) for task in Plan.of(sample()).tasks()]
    blocks, lost = BlockFiles(tmp_path), deadly.DEADLY.partition("-block")[0]
    with pytest.raises(fault) as raised:
        compute(advance, blocks, tasks, print, never, jobs)
    told = " ".join([str(raised.value), *getattr(raised.value, "__notes__", [])])
    assert "members 0 to 1 of point000001; " in told and "--resume" in told
    for name in (name for task, _ in tasks for name in task.names):
        assert (name in blocks) == (not name.startswith(lost) or name < deadly.DEADLY)
    ensemble.simulate(Plan.of(sample()), blocks)
    assert all(name in blocks for task, _ in tasks for name in task.names)
    task = next(Plan.of(sample()).tasks())
    # which may concern all blocks: the run ends at once
    with pytest.raises(OSError, match="out"):
        compute(
            ensemble.advance,
            BlockFiles(tmp_path / "out"),
            [(task, [0])] * 2,
            print,
            never,
        )
    assert not workers()


def test_a_run_within_the_progress_of_another_changes_neither(many_parts):
    inner = []
    outer = ensemble.run(
        sample(), progress=lambda done: inner.append(ensemble.run(sample(seed=6)))
    )
    assert outer.identical(ensemble.run(sample())) and inner[0].identical(
        ensemble.run(sample(seed=6))
    )


SCRIPT = """
import sys
sys.path.insert(0, {tests!r})
from helpers import scenes
import sim
from sim.ensemble import plan
plan._GROUP, plan._BLOCK_SECONDS = 2, 4.5e-5
print("begun", flush=True)
scene = scenes.sample(members={members}, steps={steps}, sweep=scenes.LOADS)
sim.run(scene, {path!r}, jobs=2, resume=True, progress=lambda done: print(done, flush=True))
"""


def script(path, members=3, steps=9):
    return SCRIPT.format(
        tests=str(Path(__file__).parents[1]),
        path=str(path),
        members=members,
        steps=steps,
    )


@pytest.mark.parametrize(
    "way",
    [
        "unguarded",
        *(
            pytest.param(way, marks=pytest.mark.verify)
            for way in ("standard input", "notebook")
        ),
    ],
)
def test_processes_need_no_guard_in_what_starts_them_and_import_nothing_of_the_present_folder(
    tmp_path, way
):
    folder, path = tmp_path / "present", tmp_path / "own" / "out.nc"
    folder.mkdir()
    for name in ("queue", "numpy", "loky"):
        (folder / f"{name}.py").write_text(
            "raise SystemExit('wrong')", encoding="utf-8"
        )
    (tmp_path / "script.py").write_text(script(path), encoding="utf-8")
    if way == "notebook":
        nbformat, nbclient = (
            pytest.importorskip(name, reason="in the extra verify")
            for name in ("nbformat", "nbclient")
        )
        cell = nbformat.v4.new_code_cell(script(path))
        nbclient.NotebookClient(
            nbformat.v4.new_notebook(cells=[cell]), timeout=300
        ).execute()
    else:
        with (tmp_path / "script.py").open() as file:
            words = [sys.executable, "-P"] + (
                [tmp_path / "script.py"] if way == "unguarded" else ["-"]
            )
            how = {
                "cwd": folder,
                "stdin": file,
                "capture_output": True,
                "text": True,
                "check": True,
            }
            assert subprocess.run(words, **how).stdout.count("begun") == 1
    assert same(path)


@pytest.mark.parametrize("kills", [2, pytest.param(50, marks=pytest.mark.verify)])
def test_a_run_whose_processes_are_killed_goes_on_to_the_same_numbers_and_leaves_none(
    tmp_path, many_parts, kills
):
    path, scenario, dice = (
        tmp_path / "out.nc",
        sample(members=8, steps=40 * kills),
        np.random.default_rng(3),
    )
    for kill in range(kills):
        command, how = (
            [sys.executable, "-c", script(path, 8, 40 * kills)],
            {"stderr": subprocess.DEVNULL, "text": True},
        )
        run = subprocess.Popen(command, stdout=subprocess.PIPE, **how)
        for _ in range(dice.integers(2, 12)):
            run.stdout.readline()
        started, parent = workers(run.pid), psutil.Process(run.pid)
        victims = [[parent], started[:1], [*started, parent]][kill % 3]
        for victim in victims:
            victim.kill()
        if parent not in victims:  # a new pool goes on
            for _ in range(2):
                run.stdout.readline()
            started += workers(run.pid)
            parent.kill()
        run.communicate()
        assert not psutil.wait_procs(started, timeout=5)[1]
    ensemble.run(scenario, path, resume=True)
    assert same(path, scenario)


@pytest.fixture(scope="module")
def threads():
    """A cluster of two threads of this process."""
    distributed = pytest.importorskip("distributed")
    how = {
        "processes": False,
        "n_workers": 1,
        "threads_per_worker": 2,
        "dashboard_address": ":0",
    }
    with distributed.LocalCluster(**how) as cluster:
        yield cluster


def test_a_run_that_is_stopped_again_and_again_goes_on_in_processes_and_on_a_cluster(
    tmp_path, many_parts, threads
):
    path, stops, scenario = tmp_path / "out.nc", 0, sample(members=7)
    ways = itertools.cycle(
        ({"scheduler": threads.scheduler_address}, {"jobs": 1}, {"jobs": 2})
    )
    while not path.exists():
        count, counted = itertools.count(), []
        how = next(ways) | {"progress": counted.append}
        try:
            ensemble.run(
                scenario,
                path,
                resume=True,
                stop=lambda count=count: next(count) > 4,
                **how,
            )
        except Stopped:
            stops += 1
    assert (
        stops > 2
        and sum(counted) == plans.work(Plan.of(scenario))
        and same(path, scenario)
    )


def test_what_a_block_raises_on_a_cluster_is_raised_and_what_is_computed_stays(
    tmp_path, many_parts, threads, monkeypatch
):
    path, advance, count = tmp_path / "out.nc", Stepper.advance, itertools.count()
    monkeypatch.setattr(
        Stepper,
        "advance",
        lambda *given: 1 / 0 if next(count) == 5 else advance(*given),
    )
    with pytest.raises(ZeroDivisionError):
        ensemble.run(sample(), path, scheduler=threads.scheduler_address)
    assert list(path.with_name("out.nc.parts").glob("*.npz"))


def test_workers_of_another_version_and_schedulers_that_do_not_answer_are_told(
    tmp_path, threads, monkeypatch
):
    ours = threading.current_thread()
    with (
        monkeypatch.context() as patched,
        pytest.raises(BadInput, match="another version of sim"),
    ):
        patched.setattr(
            execute, "_code", lambda: (str(threading.current_thread() is ours),)
        )
        ensemble.run(sample(), tmp_path / "out.nc", scheduler=threads.scheduler_address)
    monkeypatch.setattr(execute, "_PATIENCE", "0.1 s")
    for address in (
        "tcp://127.0.0.1:1",
        "nonsense://x",
        "nowhere",
        "tcp://127.0.0.1:x",
    ):
        with pytest.raises(WorkerDied, match=f"no dask scheduler answers at {address}"):
            compute(
                ensemble.advance, MemoryBlocks(), [], print, never, scheduler=address
            )


def test_a_cluster_maps_scenes(threads):
    from distributed import Client

    assert ensemble.run(sample(), scheduler=threads.scheduler_address).identical(
        ensemble.run(sample())
    )
    scenarios = [sample(seed=seed) for seed in (1, 2, 3)]
    with Client(threads) as client:
        results = client.gather(client.map(sim.run, scenarios))
    for dataset, scenario in zip(results, scenarios, strict=True):
        assert dataset.identical(ensemble.run(scenario))


@pytest.mark.verify
def test_a_cluster_whose_workers_are_killed_gives_the_same_numbers(
    tmp_path, monkeypatch
):
    from distributed import LocalCluster

    monkeypatch.setattr(plans, "_GROUP", 2)
    monkeypatch.setattr(plans, "_BLOCK_SECONDS", 2e-2)
    scenario, killed, counted = sample(members=20, steps=4000), [], itertools.count()
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0"
    ) as cluster:

        def kill(done):
            if next(counted) % 10 == 5 and len(killed) < 3:
                # a nanny whose worker dies while it starts gives up
                cluster.wait_for_workers(2, timeout=60)
                worker = next(iter(cluster.workers.values()))
                killed.append(worker.pid)
                psutil.Process(worker.pid).kill()

        ensemble.run(
            scenario,
            tmp_path / "out.nc",
            scheduler=cluster.scheduler_address,
            progress=kill,
        )
    assert len(set(killed)) == 3 and same(tmp_path / "out.nc", scenario)


@pytest.mark.verify
def test_a_scheduler_that_goes_away_is_told_and_what_is_computed_stays(
    tmp_path, many_parts, monkeypatch
):
    from distributed import LocalCluster

    monkeypatch.setattr(execute, "_PATIENCE", "2 s")
    cluster, path = (
        LocalCluster(processes=False, n_workers=1, dashboard_address=":0"),
        tmp_path / "out.nc",
    )
    with pytest.raises(WorkerDied, match="does not answer"), cluster:
        how = {
            "progress": lambda done: cluster.close(),
            "scheduler": cluster.scheduler_address,
        }
        ensemble.run(sample(members=20), path, **how)
    ensemble.run(sample(members=20), path, resume=True)
    assert same(path, sample(members=20))


def test_a_suspect_runs_alone_and_an_executor_that_does_not_start_is_no_endless_loop(
    monkeypatch, many_parts
):
    waiting = [
        execute._Chain(str(place), None, [0], broken=broken)
        for place, broken in enumerate((0, 0, 2))
    ]
    suspect, other = waiting[2], waiting[1]
    assert (
        execute._taken(waiting, [other]) is None
        and execute._taken(waiting, []) is suspect
    )
    assert execute._taken(waiting, [suspect]) is None

    class Broken(concurrent.futures.Executor):
        def submit(self, *given):
            raise concurrent.futures.BrokenExecutor

    made = []
    monkeypatch.setattr(
        execute,
        "pool",
        lambda jobs: made.append(jobs) or contextlib.nullcontext(Broken()),
    )
    tasks = [(task, [0]) for task in Plan.of(sample()).tasks()]
    with pytest.raises(WorkerDied):
        compute(ensemble.advance, MemoryBlocks(), tasks, print, never, 2)
    assert len(made) < 100


SOME = [
    "sim.laws.jkr.pull_off_load",
    "sim.laws.jkr.radius_at_load",
    "sim.numerics.special.lambert_w",
]


@pytest.fixture
def cold(tmp_path, monkeypatch):
    """An empty cache, into which compilation in other processes goes."""
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path))
    jit._cache_folder.cache_clear()
    yield tmp_path
    jit._cache_folder.cache_clear()


def test_every_kernel_and_law_of_the_sources_is_compiled_once(cold, monkeypatch):
    decorated = set()
    for module, text in jit.sources().items():
        for node in ast.parse(text).body:
            for mark in getattr(node, "decorator_list", ()):
                if getattr(
                    mark, "id", getattr(getattr(mark, "func", None), "id", "")
                ) in ("kernel", "law"):
                    decorated.add(f"{module}.{node.name}")
    assert set(execute.missing_kernels()) == decorated and len(decorated) > 50
    missing = execute.missing_kernels()
    monkeypatch.setattr(
        execute,
        "missing_kernels",
        lambda: [name for name in SOME if not jit.cached(name)],
    )
    done = CliRunner().invoke(cli, ["warm", "--jobs", "2"])
    assert done.exit_code == 0 and done.stdout.startswith(
        f"3 of {len(jit.compiled)} kernels and laws compiled"
    )
    monkeypatch.undo()
    monkeypatch.setenv("SIM_CACHE_DIR", str(cold))
    assert set(missing) - set(execute.missing_kernels()) == set(SOME)
    before = {
        path: path.stat().st_mtime_ns for path in cold.rglob("*") if path.is_file()
    }
    monkeypatch.setattr(execute, "missing_kernels", lambda: SOME)
    execute.compile_missing(1)
    assert {
        path: path.stat().st_mtime_ns for path in cold.rglob("*") if path.is_file()
    } == before


def test_a_cache_that_cannot_be_written_is_no_success(cold, monkeypatch):
    (cold / "sliding-sim").write_text("no folder", encoding="utf-8")
    monkeypatch.setattr(execute, "missing_kernels", lambda: SOME[:1])
    done = CliRunner().invoke(cli, ["warm"])
    assert done.exception.exit_code == 74 and "SIM_CACHE_DIR" in str(done.exception)
