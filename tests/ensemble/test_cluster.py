"""Runs on a dask cluster: the bytes of one process, whatever dies; scenes mapped over its threads."""

import functools
import itertools
import os
import signal

import pytest
from helpers import scenes
from helpers.scenes import LOADS

import sim
from sim.ensemble import cluster, plan as plans, simulate as ensemble
from sim.ensemble.part_files import MemoryParts, Stopped
from sim.ensemble.plan import Plan
from sim.ensemble.workers import WorkerDied
from sim.units.errors import BadInput

distributed = pytest.importorskip("distributed")

sample = functools.partial(scenes.sample, sweep=LOADS)


@pytest.fixture(scope="module")
def threads():
    """A cluster of two threads of this process."""
    how = {"processes": False, "n_workers": 1, "threads_per_worker": 2, "dashboard_address": ":0"}
    with distributed.LocalCluster(**how) as made:
        yield made


def test_a_cluster_gives_the_bytes_of_one_process(tmp_path, many_parts, threads):
    alone, counted = ensemble.run(sample(), tmp_path / "alone.nc").read_bytes(), []
    how = {"scheduler": threads.scheduler_address, "progress": counted.append}
    assert ensemble.run(sample(), tmp_path / "out.nc", **how).read_bytes() == alone
    assert sum(counted) == plans.work(Plan.of(sample()))
    assert min(counted[1:]) > 0 and len(counted) > 8


def test_a_run_on_a_cluster_is_stopped_and_goes_on_anywhere(tmp_path, many_parts, threads):
    alone, path = ensemble.run(sample(members=7), tmp_path / "alone.nc").read_bytes(), tmp_path / "out.nc"
    where = itertools.cycle((threads.scheduler_address, ""))
    stops = 0
    while not path.exists():
        asked, counted = itertools.count(), []
        how = {"scheduler": next(where), "progress": counted.append}
        try:
            ensemble.run(sample(members=7), path, resume=True, stop=lambda asked=asked: next(asked) > 0, **how)
        except Stopped:
            stops += 1
    assert stops > 2
    assert sum(counted) == plans.work(Plan.of(sample(members=7)))
    assert path.read_bytes() == alone


def test_what_a_block_raises_is_raised_and_what_is_computed_stays(tmp_path, many_parts, threads, monkeypatch):
    path, real, count = tmp_path / "out.nc", ensemble.follow, itertools.count()
    monkeypatch.setattr(ensemble, "follow", lambda *given: 1 / 0 if next(count) == 5 else real(*given))
    with pytest.raises(ZeroDivisionError):
        ensemble.run(sample(), path, scheduler=threads.scheduler_address)
    assert list(path.with_name("out.nc.parts").glob("*.part"))


def test_workers_of_another_version_and_schedulers_that_do_not_answer_are_told(tmp_path, threads, monkeypatch):
    versions = iter([("ours",)])
    monkeypatch.setattr(cluster, "_code", lambda: next(versions, ("theirs",)))
    with pytest.raises(BadInput, match="another version of sim"):
        ensemble.run(sample(), tmp_path / "out.nc", scheduler=threads.scheduler_address)
    monkeypatch.setattr(cluster, "_PATIENCE", "0.1 s")
    for address in ("tcp://127.0.0.1:1", "nonsense://x", "nowhere", "tcp://127.0.0.1:x"):
        with pytest.raises(WorkerDied, match="no scheduler of dask answers at"):
            ensemble.run(sample(), tmp_path / "other.nc", replace=True, scheduler=address)


def test_no_client_is_made_for_what_is_no_address(monkeypatch):
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: pytest.fail("a client that hangs at its end"))
    for address in ("nonsense://x", "nowhere", "tcp://127.0.0.1:x"):
        with pytest.raises(WorkerDied, match=f"no scheduler of dask answers at {address}: ."):
            cluster.share_out(ensemble.advance_group, MemoryParts(), [], address, ensemble.ignore, lambda: False)


def test_scenes_are_mapped_over_a_cluster(threads):
    scenes = [sample(seed=seed) for seed in (1, 2, 3)]
    with distributed.Client(threads) as client:
        found = client.gather(client.map(sim.run, scenes))
    for dataset, one in zip(found, scenes, strict=True):
        assert dataset.identical(ensemble.run(one))


@pytest.mark.verify
def test_a_run_whose_workers_are_killed_gives_the_same_bytes(tmp_path, monkeypatch):
    monkeypatch.setattr(plans, "_GROUP", 2)
    monkeypatch.setattr(plans, "_BLOCK_SECONDS", 2e-2)
    scenario, killed, counted = sample(members=20, steps=4000), [], itertools.count()
    alone = ensemble.run(scenario, tmp_path / "alone.nc").read_bytes()
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as made:

        def kill(done):
            if next(counted) % 10 == 5 and len(killed) < 3:
                worker = next(iter(made.workers.values()))
                killed.append(worker.pid)
                os.kill(worker.pid, signal.SIGKILL)

        how = {"scheduler": made.scheduler_address, "progress": kill}
        assert ensemble.run(scenario, tmp_path / "out.nc", **how).read_bytes() == alone
    assert len(set(killed)) == 3
