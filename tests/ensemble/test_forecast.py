"""Needs of a run: estimated before it starts, refused if there is no room, and bounded."""

import itertools
import json
import math
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from helpers.commands import COUNTED, LENS
from helpers.parts import Record, load, run
from helpers.printed import rows_of
from helpers.scenes import sample
from numpy.testing import assert_allclose

import sim
from benchmarks.spring import DRAWN, KICKED
from benchmarks.timing import child
from sim.ensemble import pace, plan as plans, preview
from sim.ensemble.dataset import identity
from sim.ensemble.pace import counted
from sim.ensemble.plan import Plan
from sim.ensemble.preview import fitting, forecast, memory, remarks, size
from sim.step.state import MemberNoise
from sim.step.stepper import Stepper


def test_members_are_pooled_with_a_remark_if_their_file_would_be_too_large(monkeypatch):
    default, each, pooled = (
        sample(),
        sample(record=Record(per_member=True)),
        sample(record=Record(per_member=False)),
    )
    size_of_all = 0.4 * (Plan.of(each).bytes - plans._SCENARIO_BYTES)
    for most, per_member in ((1.01 * size_of_all, True), (0.99 * size_of_all, False)):
        monkeypatch.setattr(plans, "_MOST_BYTES", most)
        dataset, alike = run(default), run(each if per_member else pooled)
        assert ("member" in dataset.dims) == per_member
        assert sum(
            "record.per_member = true" in text for text in remarks(Plan.of(default))
        ) == (not per_member)
        assert (
            json.loads(dataset.attrs["scenario_resolved"])["record"]["per_member"]
            is per_member
        )
        # so that either goes on with the other
        assert identity(dataset.attrs) == identity(alike.attrs)
        assert rows_of(dataset) == rows_of(alike) and "member" in run(each).dims


def never_begun(done):
    raise AssertionError("the run has begun")


def test_a_run_has_as_many_processes_as_memory_holds_and_is_refused_if_it_holds_none(
    monkeypatch, tmp_path
):
    plan = Plan.of(sample(8, 500))
    needed = [memory(plan, jobs) for jobs in (1, 2, 3, 4)]
    assert needed == sorted(needed)
    monkeypatch.setattr(preview, "memory_limit", lambda: (needed[2], "are free"))
    assert [fitting(plan, jobs) for jobs in (4, 2)] == [3, 2]
    assert (
        "note: the memory is enough for 3 of 4 processes"
        in preview.processes(plan, 4, needed[2])[1]
    )
    monkeypatch.setattr(preview, "memory_limit", lambda: (0.5 * needed[0], "are free"))
    assert fitting(plan, 4, needed[2]) == 3  # what is asked for counts alone
    for to in (None, tmp_path / "x.nc"):
        with pytest.raises(
            preview.NoRoom, match=f"{size(0.5 * needed[0])} are free"
        ) as refused:
            run(plan.scenario, to, jobs=2, progress=never_begun)
    assert refused.value.exit_code == 1 and not list(tmp_path.iterdir())
    assert size(0.5 * needed[0]) in preview.preview(plan.scenario)
    with pytest.raises(preview.NoRoom):
        fitting(plan, 1, needed[0], in_memory=True)


def test_the_memory_limit_is_that_of_the_variable_else_of_the_job_else_what_is_free(
    monkeypatch,
):
    for name in (
        "SIM_MAX_MEMORY",
        "SLURM_MEM_PER_NODE",
        "SLURM_MEM_PER_CPU",
        "SLURM_CPUS_ON_NODE",
    ):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(
        psutil, "virtual_memory", lambda: SimpleNamespace(available=7e9)
    )
    own = psutil.Process().memory_info().rss
    assert_allclose(preview.memory_limit()[0], 7e9 + own, rtol=0.01)
    monkeypatch.setenv("SLURM_MEM_PER_CPU", "1000")
    monkeypatch.setenv("SLURM_CPUS_ON_NODE", "4")
    assert preview.memory_limit() == (4000 * 2**20, "are allowed (SLURM_MEM_PER_CPU)")
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "6000")
    assert preview.memory_limit()[0] == 6000 * 2**20
    monkeypatch.setenv("SIM_MAX_MEMORY", "2 GB")
    assert preview.memory_limit()[0] == 2e9


def test_more_members_take_more_time_and_no_more_memory_and_steps_that_are_done_none(
    monkeypatch,
):
    record = Record(per_member=True)
    few, many = (
        Plan.of(sample(members, 20_000, record=record)) for members in (1000, 10_000)
    )
    assert not preview.tabulated(many)
    assert_allclose(forecast(many, 1).cpu, 10 * forecast(few, 1).cpu, rtol=0.1)
    assert_allclose(
        [memory(many, jobs) for jobs in (1, 4)],
        [memory(few, jobs) for jobs in (1, 4)],
        rtol=0.1,
    )
    plan = Plan.of(sample(2000, 50_000, record=Record(per_member=False)))
    monkeypatch.setattr(preview, "pace_of", lambda plan: 1.0)
    done = {name for task in itertools.islice(plan.tasks(), 3) for name in task.names}
    left = 1.0 - 3 * plan.group / plan.members
    whole, rest = (forecast(plan, 2, left=share) for share in (1.0, left))
    assert rest.cpu < 0.9 * whole.cpu
    assert preview.processes(plan, 2, math.inf)[1][-1].startswith(
        preview._times(whole, 2)
    )
    assert preview.processes(plan, 2, math.inf, parts=done)[1][-1].startswith(
        preview._times(rest, 2)
    )


def long_scene(steps, record):
    """Return the text of a scene of one member with so many steps, recorded seldom."""
    clock = f'duration = "{steps} ms"\nstep = "1 ms"\nrecord = "{record} ms"\n'
    lens = LENS.replace('duration = "1 s"\nstep = "0.1 s"\n', clock)
    return f'{lens}[drive]\nspeed = "1 mm/s"\n{COUNTED}'


@pytest.mark.verify
def test_a_slider_on_tracked_bonds_is_worth_more_than_one_process():
    # ten times as long as in the gallery, it takes some twenty seconds on one core, of which each process may have four
    assert (
        Plan.of(
            load("scenarios/motor_clutch.toml", {"clock.duration": "6000 s"})
        ).worthwhile()
        > 1
    )


@pytest.mark.parametrize(
    "steps", [4 * 10**6, pytest.param(10**8, marks=pytest.mark.verify)]
)
def test_a_member_of_very_many_steps_is_kept_in_blocks_and_goes_on_from_the_last(
    tmp_path, steps
):
    (tmp_path / "scene.toml").write_text(
        long_scene(steps, record=steps // 10), encoding="utf-8"
    )
    parts = tmp_path / "x.nc.parts"
    command = [
        sys.executable,
        "-m",
        "sim",
        "run",
        "scene.toml",
        "-o",
        "x.nc",
        "--quiet",
    ]
    early = subprocess.Popen(command, cwd=tmp_path)
    while early.poll() is None and len(list(parts.glob("point*"))) < 5:
        time.sleep(0.01)
    early.kill()
    assert early.wait() != 0
    done = {path: path.stat().st_mtime_ns for path in parts.glob("point*")}
    resumed = subprocess.Popen([*command, "--resume"], cwd=tmp_path)
    while resumed.poll() is None and len(list(parts.glob("point*"))) < len(done) + 3:
        time.sleep(0.01)
    assert {
        path: path.stat().st_mtime_ns for path in done
    } == done and resumed.wait() == 0


@pytest.mark.verify
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_the_largest_process_of_a_run_of_ten_times_the_members_is_as_large(
    tmp_path, jobs
):
    largest = []
    for members in (500, 5000):
        scene = long_scene(steps=2000, record=2) + f"[ensemble]\nmembers = {members}\n"
        (tmp_path / "scene.toml").write_text(scene, encoding="utf-8")
        files = str(tmp_path / "scene.toml"), "-o", str(tmp_path / "x.nc")
        largest.append(
            child("-m", "sim", "run", *files, "--force", "--no-table", "-j", jobs)[1]
        )
        assert 2**20 * largest[-1] < 1.5 * memory(
            Plan.of(load(tmp_path / "scene.toml")), 1
        )
    # a dataset of up to 128 MiB is built in memory
    assert largest[1] < 1.1 * largest[0] + 256.0


BELL = {"model": "bell", "zero_force_rate": 20.0, "bell_force": 2e-11}
#: Driven sliders whose clock steps take very many sub-steps each, with a rest, rupture at a cut-off, bonds that are
#: followed one by one, and a body on cohorts that grow from nothing.
LONG = {
    "a rest before fast sliding": {
        "clock": {"duration": 0.01, "step": 2e-3},
        "drive": {
            "model": "spring",
            "stage": 0.6,
            "stiffness": 7e-3,
            "start_after": 4e-3,
            "viscosity": 0.015,
            "contact_stiffness": "rigid",
        },
        "bonds": {
            "model": "cohort",
            "rupture": {"model": "cut_off", "stretch": 6e-7, "rate": 16.0},
            "tolerance": 1e-3,
            "bond_stiffness": 7e-7,
            "rebinding_rate": 2500.0,
            "site_density": 1.2e13,
        },
    },
    "tracked bonds that carry the adhesion": {
        "clock": {"duration": 2.0, "step": 0.1},
        "adhesion": {"work": 0.09, "bond_share": 1.0},
        "drive": {
            "model": "spring",
            "stage": 8e-4,
            "stiffness": 2e-3,
            "contact_stiffness": "rigid",
        },
        "bonds": {
            "model": "tracked",
            "rupture": BELL,
            "bond_stiffness": 1e-7,
            "rebinding_rate": 20.0,
            "site_density": 8e13,
            "sites": 2000,
        },
    },
    "a heavy chain of tracked bonds": {
        "clock": {"duration": 0.03, "step": 0.015},
        "drive": {
            "model": "spring",
            "stage": -4e-4,
            "stiffness": 2e-3,
            "start": "steady",
            "mass": 5e-13,
            "damping": 2e-10,
        },
        "bonds": {
            "model": "tracked",
            "rupture": BELL,
            "bond_stiffness": 1e-7,
            "rebinding_rate": 11.0,
            "site_density": 8e13,
            "sites": 300,
            "start": "steady",
        },
    },
    "a few tracked bonds of a slider that rings": KICKED
    | {
        "clock": {"duration": 10.0, "step": 1e-3},
        "bonds": KICKED["bonds"] | {"model": "tracked", "sites": 20},
    },
    "a slider that draws of the stored energy kick": KICKED | DRAWN,
    "cohorts under a force": {
        "clock": {"duration": 1e-3, "step": 1e-5},
        "contact": {"load": 1e-5},
        "drive": {
            "model": "force",
            "force": 8e-6,
            "damping": 1e-9,
            "contact_stiffness": "rigid",
        },
        "bonds": {
            "model": "cohort",
            "rupture": BELL | {"zero_force_rate": 3.6e7, "bell_force": 9e-12},
            "bond_stiffness": 6e-7,
            "rebinding_rate": 2.7e5,
            "site_density": 3e17,
            "start": "empty",
        },
    },
}


def long_run(name):
    lens = {
        "solid": {"shear_modulus": 6e6},
        "sphere": {"radius": 2e-3},
        "adhesion": {"work": 0.09},
        "seed": 3,
    }
    return Plan.of(sim.load({"contact": {"load": 1.5e-4}} | lens | LONG[name]))


_ADVANCE = Stepper.advance


class SubstepClock:
    """A clock that each sub-step moves by 3 µs, so that measured times are the same on any machine under any load."""

    def __init__(self):
        self.time = 0.0

    def advance(self, stepper, state, noise, steps):
        before = state.drive.substeps.sum()
        reached = _ADVANCE(stepper, state, noise, steps)
        self.time += 3e-6 * (reached[0].drive.substeps.sum() - before)
        return reached


@pytest.mark.parametrize("name", LONG)
def test_the_substeps_of_a_run_are_foretold_within_a_factor_of_two_so_that_its_time_is_within_three(
    name, monkeypatch
):
    plan, clock = long_run(name), SubstepClock()
    monkeypatch.setattr(
        Stepper, "advance", lambda stepper, *rest: clock.advance(stepper, *rest)
    )
    monkeypatch.setattr(pace, "stopwatch", lambda: lambda: clock.time)
    foretold = pace.pace(plan) * counted(plan)
    assert 0.0 < clock.time < 1.0
    clock.time = 0.0
    noise, steps = (
        MemberNoise.of(3, np.arange(plan.members)),
        range(plan.points[0].clock.steps + 1),
    )
    plan.points[0].stepper.follow(noise, None, steps)
    assert clock.time / 2.0 < foretold < 2.0 * clock.time
