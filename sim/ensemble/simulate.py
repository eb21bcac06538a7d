"""Running a scenario: its sweep, its members, in memory or onto the disk."""

import contextlib
import datetime
import functools
import json
import math
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np

from sim.engine import MemberNoise, State, Trajectory, follow, pack, unpack
from sim.ensemble import cluster
from sim.ensemble.netcdf import attributes_of, in_memory, write
from sim.ensemble.outline import attributes, identity, moments, outline
from sim.ensemble.part_files import WHOLE, MemoryParts, OutputExists, PartFiles, Parts, Shard, Stopped, held
from sim.ensemble.plan import Block, Plan, Task, snapshots
from sim.ensemble.preview import fitting, refuse_full_disk
from sim.ensemble.recorded import DISC_ENERGIES, LARGEST, MAP, VARIABLES, Variable
from sim.ensemble.workers import share_out
from sim.laws.halfspace import cross_energy_of_map, disc_energy_of_map
from sim.numerics.files import DiskFull, StoreTrouble, claim, explained
from sim.numerics.hdf5 import located
from sim.parts.drive import READINGS
from sim.parts.shear.maps import CarriedProcess
from sim.parts.shear.modes import ModalProcess
from sim.parts.shear.process import Fluctuation
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read
from sim.units.terminal import note

Progress = Callable[[int], None]


def ignore(done: int) -> None:
    """No progress is shown."""


#: Ends of the names of what a run makes beside its output.
BESIDE = (".parts", ".log", ".sha256")
#: Steps after which progress is reported, at the next record.
_STEPS = 1024


def run(
    scenario: Scenario, to: str | os.PathLike | None = None, *, replace: bool = False, resume: bool = False,
    jobs: int = 1, progress: Progress = ignore, stage: Callable[[str], None] = lambda name: None,
    stop: Callable[[], bool] = lambda: False, shard: Shard = WHOLE, scheduler: str = "", memory: float = math.inf,
) -> Any:  # fmt: skip
    """Run a scenario with its ensemble and its sweep.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    to : path, optional
        The netCDF file to make; without it everything stays in memory.
    replace : bool
        Whether an existing file and an unfinished run of it may be replaced.
    resume : bool
        Whether to go on with an unfinished run of the same scenario; a finished one is left as it is.
    jobs : int
        Processes that share the work; the numbers are the same for any.
    progress : callable
        Called with the number of member-steps done since the last call.
    stage : callable
        Called with the name of each stage as it begins: "simulating", "writing".
    stop : callable
        Asked before every block of steps whether to end there.
    shard : (int, int)
        Number of a share of the run, from 1, and how many there are; ``merge`` makes the file of all.
    scheduler : str
        Address of a scheduler of dask, whose workers take the place of processes.
    memory : float
        Memory that all processes together may take [byte]: fewer of them share the work where it is little.

    Returns
    -------
    xarray.Dataset or pathlib.Path
        The dataset, or the path of the file.

    Raises
    ------
    OutputExists
        If the file or an unfinished run of it is there and is neither to be replaced nor gone on with.
    OutputBusy
        If another run holds the output.
    BadInput
        If what is to be gone on with is of another scenario or of other versions.
    Stopped
        If it was to end early; what is computed is kept.
    StoreTrouble
        If the disk has too little room or a file makes trouble; what the disk holds of an older output stays.
    NoRoom
        If there is too little memory, before anything is computed.
    WorkerDied
        If processes died at the same work three times.
    """
    plan = Plan.of(scenario)
    jobs = fitting(plan, jobs, memory, kept=to is None)
    stage("simulating")
    if to is None:
        import xarray  # heavy

        with contextlib.nullcontext() if jobs == 1 and not scheduler else tempfile.TemporaryDirectory() as folder:
            kept = MemoryParts() if folder is None else PartFiles(Path(folder))
            simulate(plan, kept, progress, jobs, stop, scheduler=scheduler)
            stage("writing")
            made = outline(plan)
            return located(xarray.Dataset(in_memory(made, kept), attrs=made.attributes))
    claim(Path(to), replace or resume, files_read(scenario), BESIDE)
    target = Path(to).resolve() if Path(to).is_symlink() else Path(to)
    if target.exists() and not target.is_file():
        raise OutputExists(f"{target} is no plain file; name another output")
    with explained(target.parent):
        target.parent.mkdir(parents=True, exist_ok=True)
    order = [axis.keys[0] for axis in scenario.sweep]
    wanted, source = identity(attributes(plan)), scenario.origin.written | {"sweep": order}
    if replace or not target.exists():
        refuse_full_disk(plan, target, shard[1])
    try:
        with held(target, wanted, source, resume, replace, lambda path: identity(attributes_of(path)), shard) as parts:
            if parts is not None:
                simulate(plan, parts, progress, jobs, stop, shard, scheduler)
            if parts is not None and shard == WHOLE:
                stage("writing")
                parts.publish(target, functools.partial(write, outline(plan), parts))
    except DiskFull as trouble:
        raise DiskFull(f"{trouble}; make room, and the same command with --resume goes on") from trouble
    return target


def simulate(
    plan: Plan, parts: Parts, progress: Progress = ignore, jobs: int = 1, stop: Callable[[], bool] = lambda: False,
    shard: Shard = WHOLE, scheduler: str = "",
) -> None:  # fmt: skip
    """Advance every group of members at every point of the sweep, and save a part for each block of steps.

    Raises
    ------
    Stopped
        If parts are missing at the end, since it was to stop.
    """
    tasks = []
    for task in plan.share(*shard):
        if all(name in parts for name in task.names):
            progress(sum(task.work))
        else:
            tasks.append(task)
    if scheduler:
        cluster.share_out(advance_group, parts, tasks, scheduler, progress, stop)
    elif jobs > 1 and len(tasks) > 1:
        share_out(functools.partial(advance_group, parts), tasks, jobs, progress, stop)
    else:
        for task in tasks:
            advance_group(parts, task, progress, stop)
            for point in task.points:
                point.release()
    if any(name not in parts for task in tasks for name in task.names):
        raise Stopped("stopped; what was computed is kept")


def advance_group(parts: Parts, task: Task, progress: Progress, stop: Callable[[], bool]) -> None:
    """Advance one group of members from the last part that is there to the end of the run, or until it is to stop."""
    state, before = None, ""
    for block, name, steps in zip(task.blocks, task.names, task.work, strict=True):
        if name in parts:
            progress(steps)
            state = None
        else:
            if stop():
                return
            if state is None and before:
                state = unpack(task.points[0], parts.state(before))
            found = []
            for point in task.points:  # several only where the run is one block
                end, arrays = _record(task, point, state, block, progress)
                found.append(arrays)
            state = end
            kept = {} if name == task.names[-1] else pack(end)
            parts.save(name, {key: _stacked([arrays[key] for arrays in found]) for key in found[0]}, kept)
        before = name


def _stacked(arrays: list[np.ndarray]) -> np.ndarray:
    """Arrays along a new first axis; one alone is not copied."""
    return np.stack(arrays) if len(arrays) > 1 else arrays[0][np.newaxis]


def _record(
    task: Task, point: Scenario, state: State | None, block: Block, progress: Progress
) -> tuple[State, dict[str, np.ndarray]]:
    """One part: every variable over a block and the maps in it; and the state at its end."""
    clock, members, records, noise = point.clock, task.members, block.records, MemberNoise.of(point.seed, task.members)
    variables = [one for one in VARIABLES if one.name in task.quantities]
    rows_of = {name: len(members) if name in task.each else 1 for name in task.quantities}
    rows = {one.name: np.empty((rows_of[one.name], len(records))) for one in variables}
    maps: dict[str, np.ndarray] = {}
    drawn, drawn_at = int(np.sum(members < point.record.map_members)), snapshots(point)
    for steps in block.pieces(max(1, _STEPS // clock.stride), drawn_at):
        before = -1 if state is None else state.step
        state, course = follow(point, noise, state, steps)
        if steps[-1] % clock.stride == 0:
            first, last = steps[0] // clock.stride - records[0], steps[-1] // clock.stride + 1 - records[0]
            for one in variables:
                part = rows[one.name][:, first:last]
                part[:] = np.broadcast_to(_read(one, point, course), part.T.shape).T
        if drawn and steps[-1] in drawn_at:
            for name, values in _maps(point, state, drawn).items():
                maps[f"{name}@{drawn_at.index(steps[-1])}"] = values
        progress(len(members) * (state.step - before))
    end = cast(State, state)
    if block.end == clock.steps:
        for largest in LARGEST:
            if largest.name in task.quantities:
                rows[largest.name] = np.broadcast_to(largest.read(point, end), rows_of[largest.name])
    if task.pooled:
        rows |= {name: moments(values) for name, values in rows.items() if name in task.each}
    return end, rows | maps


def _read(variable: Variable, point: Scenario, course: Trajectory) -> np.ndarray:
    """A recorded quantity, nan once nothing has held the body any longer; a flag or a count, without symbol, stays."""
    values = variable.read(point, course)
    ends = point.varies["drive"] and point.varies[variable.part] and variable.symbol
    if not ends or variable.name == "runaway_time":
        return cast(np.ndarray, values)
    return np.where(np.isnan(course.driven[..., READINGS.index("runaway_time")]), values, np.nan)


def _maps(point: Scenario, state: State, drawn: int) -> dict[str, np.ndarray]:
    """Maps of the first members, and in a contact of finite size the energies per area that they store on its disc.

    ½⟨τ1 w1⟩, and ⟨τ1 w0⟩ with the displacement w0 of the mean stress [J/m²], shape (maps,).
    """
    process = cast(ModalProcess | CarriedProcess, point.process)
    maps = process.maps(cast(Fluctuation, state.shear), np.broadcast_to(state.drive.position, drawn), drawn)
    if point.margin is None:
        return {MAP[0]: maps}
    solid, (square, cell) = point.solid.effective, process.centred(maps)
    found = state.contact.radius, state.bonding.stress
    radius, stress = (np.broadcast_to(values, max(len(values), drawn))[:drawn] for values in found)
    radius = np.where(2.0 * radius > cell, np.nan, radius)  # a contact that has outgrown its map
    own = disc_energy_of_map(square, cell, radius, *solid)
    cross = cross_energy_of_map(square, cell, radius, stress, *solid)
    return {MAP[0]: maps, DISC_ENERGIES[0][0]: own, DISC_ENERGIES[1][0]: cross}


def log(target: Path, began: float, stages: dict[str, float]) -> None:
    """Append to ``OUT.nc.log`` what may differ between equal runs: time, host, arguments, seconds of each stage.

    Trouble with it is a note, as it does not harm the output.
    """
    when = f"{began:.0f} s after 1970"
    with contextlib.suppress(ValueError, OverflowError, OSError):  # of a clock that is far off
        when = datetime.datetime.fromtimestamp(began, datetime.UTC).isoformat(timespec="seconds")
    machine = {"host": platform.node(), "platform": platform.platform(), "arguments": sys.argv[1:]}
    entry = {"began": when, "seconds": round(time.time() - began, 2), "stages": stages, **machine}
    how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
    try:
        with explained(target.parent), open(os.open(f"{target}.log", how, 0o666), "a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
    except StoreTrouble as trouble:
        note(f"note: {target}.log was not written: {trouble}")
