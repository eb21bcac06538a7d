"""What a run takes: known before it starts, refused where there is no room, and bounded."""

import itertools
import json
import math
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from helpers.commands import COUNTED, LENS
from helpers.scenes import SHEARS, sample
from numpy.testing import assert_allclose

from benchmarks.timing import child
from sim import analysis
from sim.ensemble import bounds, plan as plans, preview, simulate
from sim.ensemble.outline import identity
from sim.ensemble.plan import Plan
from sim.ensemble.preview import remarks
from sim.ensemble.simulate import run
from sim.numerics import jit
from sim.numerics.files import StoreTrouble
from sim.scenario.clock import Clock, Record
from sim.scenario.reader import load


def test_members_whose_file_would_be_too_large_are_pooled_where_the_scenario_leaves_it_and_it_is_said(monkeypatch):
    open_, kept, pooled = sample(), sample(record=Record(per_member=True)), sample(record=Record(per_member=False))
    assert not any("per_member" in text for text in remarks(Plan.of(open_)))
    assert "member" in run(open_).dims
    bytes_of_all = 0.4 * (Plan.of(kept).bytes - plans._SCENARIO_BYTES)
    for most, each in ((1.01 * bytes_of_all, True), (0.99 * bytes_of_all, False)):
        monkeypatch.setattr(plans, "_MOST_BYTES", most)
        dataset, alike = run(open_), run(kept if each else pooled)
        assert ("member" in dataset.dims) == each == ("contact_radius" in dataset)
        assert sum("record.per_member = true" in text for text in remarks(Plan.of(open_))) == (not each)
        assert json.loads(dataset.attrs["scenario_resolved"])["record"]["per_member"] is each
        assert identity(dataset.attrs) == identity(alike.attrs)  # so that either goes on with the other
        assert analysis.table(dataset) == analysis.table(alike)
        assert "member" in run(kept).dims


def never_begun(done):
    raise AssertionError("the run has begun")


def test_a_run_has_as_many_processes_as_memory_holds_and_is_refused_where_it_holds_none(monkeypatch, tmp_path):
    plan = Plan.of(sample(8, 500))
    needed = [bounds.memory(plan, jobs) for jobs in (1, 2, 3, 4)]
    assert needed == sorted(needed)
    for free, most in ((math.inf, needed[2]), (needed[2], math.inf), (needed[2], needed[3])):
        monkeypatch.setattr(bounds, "_free_memory", lambda free=free: free)
        assert bounds.fitting(plan, 4, most) == 3
        assert bounds.fitting(plan, 2, most) == 2
    assert "note: there is memory for 3 of 4 processes" in preview.announced(plan, 4, needed[2])[1]
    monkeypatch.setattr(bounds, "_free_memory", lambda: 0.5 * needed[0])
    for to in (None, tmp_path / "x.nc"):
        with pytest.raises(bounds.NoRoom, match=f"{bounds.size(0.5 * needed[0])} are free") as refused:
            run(plan.scenario, to, jobs=2, progress=never_begun)
    assert bounds.size(needed[0]) in str(refused.value)
    assert refused.value.exit_code == 1
    assert not list(tmp_path.iterdir())
    assert any(bounds.size(needed[0]) in line for line in preview.preview(plan.scenario).splitlines())
    with pytest.raises(bounds.NoRoom, match="are allowed"):
        bounds.fitting(plan, 1, 0.4 * needed[0])


def test_what_is_kept_of_a_run_that_goes_on_is_not_counted_again(monkeypatch):
    plan = Plan.of(sample(2000, 50_000, record=Record(per_member=False)))
    monkeypatch.setattr(preview, "tried", lambda plan, compiling: 1.0)
    kept = {name for task in itertools.islice(plan.tasks(), 3) for name in task.names}
    left = 1.0 - 3 * plan.group / plan.members
    whole, rest = (bounds.takes(plan, 2, left=share) for share in (1.0, left))
    assert rest.cpu < 0.9 * whole.cpu
    assert preview._times(rest, 2) != preview._times(whole, 2)
    assert preview.announced(plan, 2, math.inf)[1][-1].startswith(preview._times(whole, 2))
    assert preview.announced(plan, 2, math.inf, kept=kept)[1][-1].startswith(preview._times(rest, 2))


def test_a_dataset_in_memory_counts(monkeypatch):
    plan = Plan.of(sample(100, 2000))
    monkeypatch.setattr(bounds, "_free_memory", lambda: bounds.memory(plan, 1) + plan.bytes)
    assert bounds.fitting(plan, 1) == 1
    with pytest.raises(bounds.NoRoom):
        bounds.fitting(plan, 1, kept=True)


@pytest.mark.parametrize(
    ("own", "top", "limit", "used"),
    [
        ("0::/jobs/mine", ".", "memory.max", "memory.current"),
        ("4:memory:/jobs/mine\n2:cpu:/", "memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
    ],
)
def test_the_least_limit_of_the_control_groups_holds_with_what_can_be_reclaimed(own, top, limit, used, tmp_path):
    (tmp_path / "own").write_text(own)
    (tmp_path / top / "jobs" / "mine").mkdir(parents=True)
    for place, most in (("jobs/mine", 900), ("jobs", 700), (".", 10**6)):
        folder = tmp_path / top / place
        (folder / limit).write_text(f"{most}\n")
        (folder / used).write_text("300\n")
        (folder / "memory.stat").write_text("cache 9\ninactive_file 50\n")
    assert sorted(bounds._free_in_groups(tmp_path, tmp_path / "own")) == [450, 650, 10**6 - 250]
    (tmp_path / top / "jobs" / limit).write_text("max\n")
    assert min(bounds._free_in_groups(tmp_path, tmp_path / "own")) == 650
    assert not list(bounds._free_in_groups(tmp_path, tmp_path / "none"))


def test_the_limit_of_addresses_holds(monkeypatch):
    status = bounds._table(Path("/proc/self/status"))
    monkeypatch.setattr(resource, "getrlimit", lambda what: (int(status["VmSize"] + 1e6), resource.RLIM_INFINITY))
    assert 0.5 * status["VmRSS"] < bounds._free_memory() < status["VmRSS"] + 1e7


def test_a_run_whose_parts_and_dataset_the_disk_does_not_hold_is_refused_and_leaves_nothing(monkeypatch, tmp_path):
    scenario, folder = sample(50, 500), tmp_path / "outputs"
    needed = bounds.takes(Plan.of(scenario), 1).disk
    monkeypatch.setattr(shutil, "disk_usage", lambda place: SimpleNamespace(total=10**12, free=0.9 * needed))
    with pytest.raises(StoreTrouble, match=bounds.size(0.9 * needed)) as refused:
        run(scenario, folder / "x.nc", progress=never_begun)
    assert refused.value.exit_code == 74
    assert bounds.size(needed) in str(refused.value)
    assert not list(folder.iterdir())
    monkeypatch.chdir(tmp_path)
    assert any(bounds.size(0.9 * needed) in line for line in preview.preview(scenario).splitlines())
    parts = folder / "x.nc.parts"
    parts.mkdir()
    (parts / "manifest.json").write_bytes(bytes(int(0.2 * needed)))  # what a run that goes on has there already
    bounds.refuse_full_disk(Plan.of(scenario), folder / "x.nc")


def test_the_room_on_disk_is_that_of_parts_and_dataset(tmp_path, monkeypatch):
    monkeypatch.setattr(plans, "_BLOCK_SECONDS", 2e-3)
    mapped = sample(5, 60, shear=SHEARS["mapped, diffusion, constant"], record=Record(maps=(1e-3, 5e-2)))
    for scenario in (sample(50, 200), sample(50, 200, record=Record(per_member=False)), mapped):
        held = {}

        def watch(stage, held=held):
            if stage == "writing":
                held["parts"] = sum(path.stat().st_size for path in (tmp_path / "x.nc.parts").iterdir())

        size = run(scenario, tmp_path / "x.nc", replace=True, stage=watch).stat().st_size
        found = bounds.takes(Plan.of(scenario), 1)
        assert found.disk / 1.5 < held["parts"] + size < 1.5 * found.disk


def test_the_pace_is_that_of_the_steps_and_nothing_is_compiled_for_it(monkeypatch):
    monkeypatch.setattr(preview, "_WORTH_TRYING", 0.0)
    plan, clock = Plan.of(sample(20, 3000, clock=Clock(duration=3.0, step=1e-3, record=0.1))), [0.0]
    follow = simulate.follow

    def slow(point, noise, state, steps):
        before = -1 if state is None else state.step
        clock[0] += 3.0 * bounds.counted_block(point, noise.shear.members, plans.Block(before, steps[-1], 100))
        return follow(point, noise, state, steps)

    monkeypatch.setattr(simulate, "follow", slow)
    monkeypatch.setattr(time, "process_time", lambda: clock[0])
    assert_allclose(preview.tried(plan), 3.0, rtol=1e-9)
    assert 0.0 < clock[0] < 0.5
    asked, own = [], [lambda name: None]
    monkeypatch.setattr(jit, "on_compiling", own[:])
    monkeypatch.setattr(simulate, "follow", lambda *of_block: asked.append(1) or jit.on_compiling[0]("a kernel"))
    assert preview.tried(plan) is None
    assert jit.on_compiling == own
    assert asked == [1]
    said = preview._times(bounds.takes(plan, 2), 2, compiled=False)
    assert "to compile" in said
    assert "in 2 processes" in said


def test_a_run_of_ten_times_the_members_takes_no_more_memory():
    few, many = (Plan.of(sample(members, 2000)) for members in (1000, 10_000))
    assert not bounds.tabulated(many)
    for jobs in (1, 4):
        assert bounds.memory(many, jobs) < 1.1 * bounds.memory(few, jobs)


# --- processes of their own ---


def long_scene(steps, record):
    """The text of a scene of one member with so many steps, recorded seldom."""
    clock = f'duration = "{steps} ms"\nstep = "1 ms"\nrecord = "{record} ms"\n'
    lens = LENS.replace('duration = "1 s"\nstep = "0.1 s"\n', clock)
    return f'{lens}[drive]\nspeed = "1 mm/s"\n{COUNTED}'


def started(folder, *arguments):
    """A run of ``scene.toml`` as a process of its own, in a folder."""
    return subprocess.Popen([sys.executable, "-m", "sim", "run", "../scene.toml", "-o", "x.nc", *arguments], cwd=folder)


@pytest.mark.verify
def test_a_member_of_a_hundred_million_steps_is_kept_in_stretches_and_goes_on_from_the_last(tmp_path):
    (tmp_path / "scene.toml").write_text(long_scene(steps=10**8, record=10**7))
    straight, killed = tmp_path / "straight", tmp_path / "killed"
    for folder in (straight, killed):
        folder.mkdir()
    whole, early = started(straight, "--quiet"), started(killed, "--quiet")
    parts = killed / "x.nc.parts"
    while early.poll() is None and len(list(parts.glob("*.part"))) < 40:
        time.sleep(0.01)
    early.kill()
    assert early.wait() == -signal.SIGKILL
    there = {path: path.stat().st_mtime_ns for path in parts.glob("*.part")}
    assert len(there) < 100  # of 107
    resumed = started(killed, "--quiet", "--resume")
    while resumed.poll() is None and len(list(parts.glob("*.part"))) < len(there) + 3:
        time.sleep(0.01)
    assert {path: path.stat().st_mtime_ns for path in there} == there
    assert (resumed.wait(), whole.wait()) == (0, 0)
    assert (killed / "x.nc").read_bytes() == (straight / "x.nc").read_bytes()


@pytest.mark.verify
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_the_largest_process_of_a_run_of_ten_times_the_members_is_as_large(tmp_path, jobs):
    """The number of processes is the same, so that the memory of all is."""
    largest = []
    for members in (500, 5000):
        (tmp_path / "scene.toml").write_text(long_scene(steps=2000, record=2) + f"[ensemble]\nmembers = {members}\n")
        run = ["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "x.nc"), "--force", "--no-table", "-j", jobs]
        largest.append(child("-m", "sim", *run)[1])
        plan = Plan.of(load(tmp_path / "scene.toml"))
        assert 2**20 * largest[-1] < 1.5 * bounds.memory(plan, 1)
    assert largest[1] < 1.1 * largest[0]


def test_sizes_are_said_in_units_that_fit():
    assert [bounds.size(count) for count in (4, 999, 4e3, 2.34e6, 5e9)] == [
        "4 byte",
        "1000 byte",
        "4 kB",
        "2.3 MB",
        "5 GB",
    ]
