"""Running a scenario: its sweep, its members, in memory or onto the disk."""

import datetime
import functools
import json
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np

from sim.engine import Dice, State, follow, pack as packed, unpack
from sim.ensemble.netcdf import attributes_of, in_memory, write
from sim.ensemble.outline import attributes, identity, moments, outline
from sim.ensemble.part_files import MemoryParts, OutputBusy, OutputExists, Parts, held
from sim.ensemble.plan import Block, Plan, part_name, work
from sim.ensemble.recorded import DISC_ENERGIES, MAP
from sim.laws.disc import cross_energy_of_map, disc_energy_of_map
from sim.numerics.files import StoreTrouble, explained
from sim.parts.shear.modal import ModalProcess
from sim.parts.shear.process import Fluctuation
from sim.scenario.scenario import Scenario

Progress = Callable[[int], None]
#: Steps after which progress is reported, at the next record.
_STEPS = 1024


def run(
    scenario: Scenario, to: str | os.PathLike | None = None, *, replace: bool = False, resume: bool = False,
    progress: Progress | None = None, stage: Callable[[str], None] = lambda name: None,
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
    progress : callable, optional
        Called with the number of member-steps done since the last call.
    stage : callable
        Called with the name of each stage as it begins: "simulating", "writing".

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
    StoreTrouble
        If the disk or a file makes trouble; what the disk holds of an older output stays.
    """
    plan = Plan.of(scenario)
    stage("simulating")
    if to is None:
        import xarray  # heavy

        memory = MemoryParts()
        simulate(plan, memory, progress)
        stage("writing")
        made = outline(plan)
        return xarray.Dataset(in_memory(made, memory), attrs=made.attributes)
    target = Path(to).resolve() if Path(to).is_symlink() else Path(to)
    if target.exists() and not target.is_file():
        raise OutputExists(f"{target} is no plain file; name another output")
    if target.exists() and not (replace or resume):
        raise OutputExists(f"{target} exists; replace it or name another output")
    with explained(target.parent):
        target.parent.mkdir(parents=True, exist_ok=True)
    with held(target, identity(attributes(plan)), resume, replace, lambda path: identity(attributes_of(path))) as parts:
        if parts is not None:
            simulate(plan, parts, progress)
            stage("writing")
            parts.publish(target, functools.partial(write, outline(plan), parts))
    return target


def simulate(plan: Plan, parts: Parts, progress: Progress | None = None) -> None:
    """Advance every group of members at every point of the sweep, and save a part for each block of steps."""
    for pack in plan.packs:
        for group, members in enumerate(plan.groups()):
            follow_group(plan, pack, group, members, parts, progress)
        for number in pack:
            plan.points[number].release()


def follow_group(
    plan: Plan, pack: range, group: int, members: np.ndarray, parts: Parts, progress: Progress | None
) -> None:
    """Advance one group of members at some points from the last part that is there to the end of the run."""
    points, state, before = [plan.points[number] for number in pack], None, ""
    blocks = plan.blocks(points[0])
    for index, block in enumerate(blocks):
        name = part_name(pack.start, group, index)
        if name not in parts:
            if state is None and before:
                state = unpack(points[0], parts.state(before))
            found = []
            for point in points:  # several only where the run is one block
                state, arrays = _record(plan, point, Dice.of(point.seed, members), state, block, progress)
                found.append(arrays)
                if len(points) > 1:
                    state = None
            kept = {} if block is blocks[-1] else packed(cast(State, state))
            parts.save(name, {key: np.stack([arrays[key] for arrays in found]) for key in found[0]}, kept)
        else:
            state = None
            if progress is not None:
                progress(len(points) * len(members) * (block.end - block.start))
        before = name


def _record(
    plan: Plan, point: Scenario, dice: Dice, state: State | None, block: Block, progress: Progress | None
) -> tuple[State, dict[str, np.ndarray]]:
    """One part: every variable over a block and the maps in it; and the state at its end."""
    clock, members, records = point.clock, dice.shear.members, block.records
    rows_of = 1, len(members)
    rows = {one.name: np.empty((rows_of[plan.varies(one)], len(records))) for one in plan.variables}
    maps: dict[str, np.ndarray] = {}
    drawn, snapshots = int(np.sum(members < point.record.map_members)), plan.snapshots(point)
    for steps in block.pieces(max(1, _STEPS // clock.stride), snapshots):
        before = -1 if state is None else state.step
        state, course = follow(point, dice, state, steps)
        if steps[-1] % clock.stride == 0:
            first, last = steps[0] // clock.stride - records[0], steps[-1] // clock.stride + 1 - records[0]
            for one in plan.variables:
                part = rows[one.name][:, first:last]
                part[:] = np.broadcast_to(one.read(point, course), part.T.shape).T
        if drawn and steps[-1] in snapshots:
            for name, values in _maps(point, state, drawn).items():
                maps[f"{name}@{snapshots.index(steps[-1])}"] = values
        if progress is not None:
            progress(len(members) * (state.step - before))
    end, recorded = cast(State, state), plan.variables
    if block.end == clock.steps:
        recorded += plan.largest
        for largest in plan.largest:
            rows[largest.name] = np.broadcast_to(largest.read(point, end), rows_of[plan.varies(largest)])
    if not plan.scenario.record.per_member:
        rows |= {one.name: moments(rows[one.name]) for one in recorded if plan.varies(one)}
    return end, rows | maps


def _maps(point: Scenario, state: State, drawn: int) -> dict[str, np.ndarray]:
    """Maps of the first members, and in a contact of finite size the energies per area that they store on its disc.

    ½⟨τ1 w1⟩, and ⟨τ1 w0⟩ with the displacement w0 of the mean stress [J/m²], shape (maps,).
    """
    process = cast(ModalProcess, point.process)
    maps = process.maps(cast(Fluctuation, state.shear), np.broadcast_to(state.drive.position, drawn), drawn)
    if point.margin is None:
        return {MAP[0]: maps}
    cell, solid, found = process.modes.cell, point.solid.effective, (state.contact.radius, state.bonding.stress)
    radius, stress = (np.broadcast_to(values, max(len(values), drawn))[:drawn] for values in found)
    radius = np.where(2.0 * radius > cell, np.nan, radius)  # a contact that has outgrown its map
    own = disc_energy_of_map(maps, cell, radius, *solid)
    cross = cross_energy_of_map(maps, cell, radius, stress, *solid)
    return {MAP[0]: maps, DISC_ENERGIES[0][0]: own, DISC_ENERGIES[1][0]: cross}


def write_log(target: Path, began: float, arguments: list[str], stages: dict[str, float]) -> None:
    """Append to ``OUT.nc.log`` what may differ between equal runs: time, host, arguments, seconds of each stage."""
    when = datetime.datetime.fromtimestamp(began, datetime.UTC).isoformat(timespec="seconds")
    machine = {"host": platform.node(), "platform": platform.platform(), "arguments": arguments}
    entry = {"began": when, "seconds": round(time.time() - began, 2), "stages": stages, **machine}
    with explained(target.parent), open(f"{target}.log", "a", encoding="utf-8") as log:
        log.write(json.dumps(entry) + "\n")


__all__ = ["OutputBusy", "OutputExists", "StoreTrouble", "run", "simulate", "work", "write_log"]
