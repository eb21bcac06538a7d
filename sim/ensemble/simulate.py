"""Running a scenario: its sweep, its members, in memory or onto the disk."""

import contextlib
import itertools
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from sim.ensemble.dataset import (
    attributes,
    attributes_of,
    identity,
    in_memory,
    moments,
    outline,
    padded,
    write,
)
from sim.ensemble.execute import compute
from sim.ensemble.plan import Block, Plan, Task, snapshots
from sim.ensemble.preview import fitting
from sim.ensemble.store import (
    WHOLE,
    Arrays,
    BlockFiles,
    Blocks,
    MemoryBlocks,
    OutputBusy,
    Shard,
    Stopped,
    Unfinished,
)
from sim.ensemble.variables import LARGEST, VARIABLES, Variable
from sim.numerics.files import DiskFull, OutputExists, explained
from sim.numerics.hdf5 import claim, located
from sim.parts.shear.maps import CarriedProcess
from sim.parts.shear.modes import ModalProcess
from sim.parts.shear.process import Fluctuation
from sim.quantities import MAP, OF_CONTACT, Mean
from sim.scenario.scenario import Scenario
from sim.scenario.schema import files_read
from sim.step.state import MemberNoise, State, Trajectory
from sim.units.notation import second_half

Progress = Callable[[int], None]


#: Shards of which a run holds the locks at once: systems limit the number of open files.
_LOCKS = 100
#: Member-steps and steps that are computed together at most; many members still take so many steps, because each call
#: has a cost.
_MEMBER_STEPS, _STEPS = 2**16, 2**10


def run(
    scenario: Scenario,
    to: str | os.PathLike | None = None,
    *,
    replace: bool = False,
    resume: bool = False,
    jobs: int = 1,
    progress: Progress = lambda done: None,
    stage: Callable[[str], None] = lambda name: None,
    stop: Callable[[], bool] = lambda: False,
    shard: Shard = WHOLE,
    scheduler: str = "",
    memory: float = math.inf,
    about: Mapping[str, str] | None = None,
) -> Any:
    """Run a scenario with its ensemble and its sweep.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    to : path, optional
        The netCDF file to make; without it everything stays in memory.
    replace : bool
        True if an existing file and an unfinished run of it may be replaced.
    resume : bool
        True to go on with an unfinished run of the same scenario; a finished one is left as it is.
    jobs : int
        Processes that share the work; the numbers are the same for any.
    progress : callable
        Called with the number of member-steps done since the last call.
    stage : callable
        Called with the name of each stage as it begins: "simulating", "writing".
    stop : callable
        True if no other block is to be begun.
    shard : (int, int)
        Number of a share of the run, from 1, and how many there are; the last one to be done makes the file. A share
        without work, of more shares than groups of members, changes nothing.
    scheduler : str
        Address of a dask scheduler, whose workers take the place of processes.
    memory : float
        Memory that all processes together may take [byte]: fewer of them share the work if it is little.
    about : mapping of str to str, optional
        Further attributes of the dataset, which decide no number.

    Returns
    -------
    xarray.Dataset or pathlib.Path
        The dataset, or the path of the file.

    Raises
    ------
    OutputExists
        If the file or an unfinished run of it is there and is neither to be replaced nor to be resumed.
    OutputBusy
        If another run holds the output, or some of its shards.
    BadInput
        If what is to be resumed is of another scenario or of other versions.
    Stopped
        If it was to end early; what is computed is kept.
    StoreTrouble
        If the disk is full or a file makes trouble; an older output stays.
    NoRoom
        If there is too little memory, before anything is computed.
    WorkerDied
        If processes died again and again at the same block.
    """
    plan = Plan.of(scenario, about)
    if to is not None and not any(plan.share(*shard)):
        return Path(to)
    jobs = fitting(plan, jobs, memory, in_memory=to is None)
    how: dict[str, Any] = {
        "progress": progress,
        "stop": stop,
        "jobs": jobs,
        "scheduler": scheduler,
    }
    stage("simulating")
    if to is None:
        import xarray  # slow to import

        with (
            contextlib.nullcontext()
            if jobs == 1 or scheduler
            else tempfile.TemporaryDirectory() as folder
        ):
            blocks = MemoryBlocks() if folder is None else BlockFiles(Path(folder))
            simulate(plan, blocks, **how)
            stage("writing")
            content = outline(plan, blocks)
            return located(
                xarray.Dataset(in_memory(content, blocks), attrs=content.attributes)
            )
    claim(Path(to), replace or resume, files_read(scenario))
    target = Path(to).resolve() if Path(to).is_symlink() else Path(to)
    if target.exists() and not target.is_file():
        raise OutputExists(f"{target} is not a regular file; name another output")
    with explained(target.parent):
        target.parent.mkdir(parents=True, exist_ok=True)
    is_done = False
    try:
        while not is_done:
            is_done = _run(plan, target, shard, resume, replace, stage, how)
            resume, replace = True, False  # of another run that published meanwhile
    except DiskFull as trouble:
        raise DiskFull(
            f"{trouble}; free some space and repeat the command with --resume"
        ) from trouble
    return target


def _run(
    plan: Plan,
    target: Path,
    shard: Shard,
    resume: bool,
    replace: bool,
    stage: Callable[[str], None],
    how: dict[str, Any],
) -> bool:
    """Compute what no other process does, and publish the output if all is there; False to begin anew."""
    order = [axis.keys[0] for axis in plan.scenario.sweep]
    folder = Unfinished(
        target,
        identity(attributes(plan)),
        order,
        lambda path: identity(attributes_of(path)),
    )
    tasks = list(plan.tasks())
    names = [name for task in tasks for name in task.names]
    names_of_shard = [name for task in plan.share(*shard) for name in task.names]
    if not (of := folder.begin(shard, resume, replace, names_of_shard)):
        return True
    wanted = list(range(1, of + 1)) if shard == WHOLE else [shard[0]]
    busy: list[int] = []
    for first in range(0, len(wanted), _LOCKS):
        some = wanted[first : first + _LOCKS]
        with folder.shards_locked(some, of) as numbers:
            if numbers is None:
                return False
            busy += [number for number in some if number not in numbers]
            for number in numbers if resume else ():
                for task in tasks[number - 1 :: of]:
                    for name in task.names:
                        folder.blocks.drop_damaged(name)
            simulate(plan, folder.blocks, of=of, shards=numbers, **how)
    if busy and (shard != WHOLE or of == 1):
        raise folder.refusal(busy[0], of)
    stage("writing")
    is_done = folder.publish(
        names, of, lambda path: write(outline(plan, folder.blocks), folder.blocks, path)
    )
    if is_done is False and shard == WHOLE:
        shards = ", ".join(f"{number}/{of}" for number in busy) or "some"
        raise OutputBusy(
            f"other processes run the shards {shards} of {target}; continue with --resume after them"
        )
    return is_done is not None


def simulate(
    plan: Plan,
    blocks: Blocks,
    progress: Progress = lambda done: None,
    stop: Callable[[], bool] = lambda: False,
    jobs: int = 1,
    scheduler: str = "",
    shards: Iterable[int] = (1,),
    of: int = 1,
) -> None:
    """Advance every group of members at every point of the sweep, or those of some shards, and save each block.

    Raises
    ------
    Stopped
        If blocks are missing at the end, since it was to stop.
    """
    missing = []
    for number in shards:
        for task in plan.share(number, of):
            lacking = [
                place for place, name in enumerate(task.names) if name not in blocks
            ]
            if len(lacking) < len(task.names):
                progress(task.done(blocks))
            if lacking:
                missing.append((task, lacking))
    compute(advance, blocks, missing, progress, stop, jobs, scheduler)
    if any(name not in blocks for task, _ in missing for name in task.names):
        raise Stopped("stopped; the results so far are kept")


def advance(task: Task, number: int, state: State | None) -> tuple[State, Arrays]:
    """Advance a group of members by one block from the state before; return the state at its end and the records."""
    result: Arrays = {}
    for place, point in enumerate(task.points):  # several only if the run is one block
        end, arrays = _record(task, point, state, task.blocks[number])
        if len(task.points) == 1:  # without a copy, as maps may be large
            return end, {key: values[np.newaxis] for key, values in arrays.items()}
        for key, values in arrays.items():
            longest = values.shape[-1]
            if not place:
                result[key] = np.full((len(task.points), *values.shape), np.nan)
            elif result[key].shape[-1] < longest:
                result[key] = padded(result[key], longest)
            result[key][place, ..., :longest] = values
    return end, result


def _record(
    task: Task, point: Scenario, state: State | None, block: Block
) -> tuple[State, dict[str, np.ndarray]]:
    """One part: every variable over a block and the maps in it; and the state at its end."""
    clock, members, records, noise = (
        point.clock,
        task.members,
        block.records,
        MemberNoise.of(point.seed, task.members),
    )
    variables = [variable for variable in VARIABLES if variable.name in task.quantities]
    rows_of = {
        name: len(members) if name in task.each else 1 for name in task.quantities
    }
    rows = {
        variable.name: np.empty((rows_of[variable.name], len(records)))
        for variable in variables
    }
    maps: dict[str, np.ndarray] = {}
    drawn, drawn_at = int(np.sum(members < point.record.map_members)), snapshots(point)
    most = max(_STEPS, _MEMBER_STEPS // len(members))
    for steps in block.pieces(max(1, most // clock.stride), drawn_at):
        state, course = point.stepper.follow(noise, state, steps)
        if steps[-1] % clock.stride == 0:
            first, last = (
                steps[0] // clock.stride - records[0],
                steps[-1] // clock.stride + 1 - records[0],
            )
            for variable in variables:
                part = rows[variable.name][:, first:last]
                part.T[:] = _read(variable, point, course)
        if drawn and steps[-1] in drawn_at:
            maps[f"{MAP.name}@{drawn_at.index(steps[-1])}"] = _maps(point, state, drawn)
    end = cast(State, state)
    if block.end == clock.steps:
        for largest in LARGEST:
            if largest.name in task.quantities:
                # at a point of a sweep without it
                unknown = np.full((1, 0) if largest.axis else 1, np.nan)
                values = largest.read(point, end) if largest.applies(point) else unknown
                rows[largest.name] = np.broadcast_to(
                    values, (rows_of[largest.name], *np.shape(values)[1:])
                )
    if task.pooled:
        each, late = (
            {name: values for name, values in rows.items() if name in task.each},
            {},
        )
        if records.stop > second_half(clock.records)[0]:
            averaged = (
                v.name
                for v in variables
                if v.name in task.each and v.definition.mean is not Mean.NONE
            )
            late = {
                f"late {name}": _late_sums(name, rows, records, clock.records)
                for name in averaged
            }
        rows |= {name: moments(values) for name, values in each.items()} | late
    return end, rows | maps


def _late_sums(
    name: str, rows: dict[str, np.ndarray], records: range, count: int
) -> np.ndarray:
    """Return sums and numbers of each member's values over the third and the last quarter of the run, of some records.

    Of ``count`` records these are in ``rows``. Values are nan where there is none, and count where the contact is
    closed if only then there is something. The shape is (members, quarters, 2).
    """
    values = rows[name]
    if name in OF_CONTACT and "in_contact" in rows:
        values = np.where(rows["in_contact"] > 0.0, values, np.nan)
    first, middle = second_half(count)
    places = np.clip(np.array([first, middle, count]) - records.start, 0, len(records))
    quarters = [values[:, slice(*ends)] for ends in itertools.pairwise(places)]
    return np.stack(
        [[np.nansum(part, axis=1), np.isfinite(part).sum(axis=1)] for part in quarters]
    ).transpose(2, 0, 1)


def _read(variable: Variable, point: Scenario, course: Trajectory) -> np.ndarray:
    """Return a recorded quantity, nan once the motion of the slider has ended.

    The flag ``in_contact`` and counts stay as they were. That of a masked contact does not, because its mean over the
    members is the share of those in motion.
    """
    values = variable.read(point, course)
    ends = (
        point.varies["drive"]
        and point.varies[variable.part]
        and (variable.definition.symbol or variable.name == "masked")
    )
    if not ends or variable.name == "runaway_time":
        return cast(np.ndarray, values)
    return np.where(np.isnan(course.position), np.nan, values)


def _maps(point: Scenario, state: State, drawn: int) -> np.ndarray:
    """Return the maps of the first members."""
    process = cast(ModalProcess | CarriedProcess, point.process)
    return process.maps(
        cast(Fluctuation, state.shear),
        np.broadcast_to(state.drive.position, drawn),
        drawn,
    )
