"""Running a scenario: its sweep, its members, in memory or onto the disk."""

import contextlib
import datetime
import fcntl
import json
import os
import platform
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import netCDF4
import numpy as np

from sim.engine import Dice, State, follow
from sim.ensemble.netcdf import MemoryFile, MemoryParts, PartFiles, Parts, moments, write_dataset
from sim.ensemble.plan import Plan, part_name, work
from sim.ensemble.recorded import DISC_ENERGIES, MAP
from sim.laws.disc import cross_energy_of_map, disc_energy_of_map
from sim.numerics.files import HDF5, StoreTrouble, explained, sync_folder
from sim.parts.shear.modal import ModalProcess
from sim.parts.shear.process import Fluctuation
from sim.scenario.scenario import Scenario

Progress = Callable[[int], None]
#: Steps after which progress is reported, at the next record.
_STEPS = 1024


class OutputExists(FileExistsError):
    """The output is there already and was not to be replaced."""

    exit_code = 73


class OutputBusy(RuntimeError):
    """Another run is writing this output."""

    exit_code = 75


def run(
    scenario: Scenario, to: str | os.PathLike | None = None, *, replace: bool = False, progress: Progress | None = None
) -> Any:
    """Run a scenario with its ensemble and its sweep.

    Parameters
    ----------
    scenario : Scenario
        What to run.
    to : path, optional
        The netCDF file to make; without it everything stays in memory.
    replace : bool
        Whether an existing file may be replaced.
    progress : callable, optional
        Called with the number of member-steps done since the last call.

    Returns
    -------
    xarray.Dataset or pathlib.Path
        The dataset, or the path of the file.

    Raises
    ------
    OutputExists
        If the file is there and ``replace`` is False.
    OutputBusy
        If another run holds the output.
    StoreTrouble
        If the disk or a file makes trouble; what the disk holds of an older output stays.
    """
    plan = Plan.of(scenario)
    if to is None:
        import xarray  # heavy

        memory, file = MemoryParts(), MemoryFile()
        simulate(plan, memory, progress)
        write_dataset(file, plan, memory)
        return xarray.Dataset(file.variables, attrs=file.attributes)
    target = Path(to).resolve() if Path(to).is_symlink() else Path(to)
    if target.exists() and not target.is_file():
        raise OutputExists(f"{target} is no plain file; name another output")
    if target.exists() and not replace:
        raise OutputExists(f"{target} exists; replace it or name another output")
    with explained(target.parent):
        target.parent.mkdir(parents=True, exist_ok=True)
    with _held(target) as folder:
        parts = PartFiles(folder)
        simulate(plan, parts, progress)
        with explained(target.parent):
            _write_file(target, folder, plan, parts)
    return target


def simulate(plan: Plan, parts: Parts, progress: Progress | None = None) -> None:
    """Advance every group of members at every point of the sweep and save the parts."""
    for number, point in enumerate(plan.points):
        for group, members in enumerate(plan.groups()):
            dice, state = Dice.of(point.seed, members), None
            for index, records in enumerate(plan.stretches(point)):
                state, arrays = _record(plan, point, dice, state, records, progress)
                parts.save(part_name(number, group, index), arrays)
        point.release()


def _record(
    plan: Plan, point: Scenario, dice: Dice, state: State | None, records: range, progress: Progress | None
) -> tuple[State, dict[str, np.ndarray]]:
    """One part: every variable over a stretch of records and the maps in it; and the state at its end."""
    clock, members = point.clock, dice.shear.members
    rows_of = 1, len(members)
    rows = {one.name: np.empty((rows_of[plan.varies(one)], len(records))) for one in plan.variables}
    maps: dict[str, np.ndarray] = {}
    drawn = int(np.sum(members < point.record.map_members))
    snapshots = [round(time / clock.duration * (clock.records - 1)) for time in sorted(point.record.maps)]
    for some in _cut(records, snapshots, max(1, _STEPS // clock.stride)):
        before = -1 if state is None else state.step
        state, course = follow(point, dice, state, clock.steps_of(some))
        columns = slice(some[0] - records[0], some[-1] + 1 - records[0])
        for one in plan.variables:
            part = rows[one.name][:, columns]
            part[:] = np.broadcast_to(one.read(point, course), part.T.shape).T
        if drawn and some[-1] in snapshots:
            for name, values in _maps(point, state, drawn).items():
                maps[f"map.{name}.{snapshots.index(some[-1])}"] = values
        if progress is not None:
            progress(len(members) * (state.step - before))
    end, recorded = cast(State, state), plan.variables
    if records.stop == clock.records:
        recorded += plan.largest
        for largest in plan.largest:
            rows[largest.name] = np.broadcast_to(largest.read(point, end), rows_of[plan.varies(largest)])
    if not plan.scenario.record.per_member:
        rows |= {one.name: moments(rows[one.name]) for one in recorded if plan.varies(one)}
    return end, rows | maps


def _cut(records: range, ends: list[int], longest: int) -> Iterator[range]:
    """Pieces of a stretch of records, each up to one of the ``ends`` and at most so long."""
    first = records.start
    while first < records.stop:
        stop = min(first + longest, records.stop, *(end + 1 for end in ends if end >= first))
        yield range(first, stop)
        first = stop


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


def _write_file(target: Path, folder: Path, plan: Plan, parts: Parts) -> None:
    """Make the dataset beside the parts, sync it and rename it into place."""
    # of who reads a dataset lazily in another thread; where xarray is not imported nobody does
    reading = getattr(sys.modules.get("xarray.backends.netCDF4_"), "NETCDF4_PYTHON_LOCK", contextlib.nullcontext())
    beside = folder / "dataset.nc"
    with HDF5, reading, netCDF4.Dataset(beside, "w", format="NETCDF4") as file:
        write_dataset(file, plan, parts)
    with open(beside, "rb") as written:
        os.fsync(written.fileno())
    os.replace(beside, target)
    sync_folder(target.parent)


@contextlib.contextmanager
def _held(target: Path) -> Iterator[Path]:
    """The folder of an output's parts, held under a lock and removed after a run that ended well."""
    folder = target.with_name(f"{target.name}.parts")
    with explained(target.parent):
        folder.mkdir(exist_ok=True)
        lock = open(folder / "lock", "w")  # noqa: SIM115  held for the whole run
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise OutputBusy(f"another run is writing {target}; wait for it or name another output") from None
        for left in folder.glob("*.npz"):  # of a run that was killed: there is no resuming yet
            left.unlink()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def write_log(target: Path, began: float, arguments: list[str]) -> None:
    """Append to ``OUT.nc.log`` what may differ between equal runs: time, host, arguments."""
    when = datetime.datetime.fromtimestamp(began, datetime.UTC).isoformat(timespec="seconds")
    machine = {"host": platform.node(), "platform": platform.platform(), "arguments": arguments}
    entry = {"began": when, "seconds": round(time.time() - began, 2), **machine}
    with explained(target.parent), open(f"{target}.log", "a", encoding="utf-8") as log:
        log.write(json.dumps(entry) + "\n")


__all__ = ["OutputBusy", "OutputExists", "StoreTrouble", "run", "simulate", "work", "write_log"]
