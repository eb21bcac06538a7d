"""Time, memory and disk of a run, known before it starts, and whether there is room for it."""

import contextlib
import math
import resource
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from sim.ensemble.checksums import parts_of
from sim.ensemble.plan import Block, Plan, map_bytes, seconds_a_step, snapshots, state_numbers
from sim.numerics.files import DiskFull, StoreTrouble
from sim.scenario.scenario import Scenario

# Rough costs of one core [s]: a start, the table, a process that shares the work; a byte of the table, of a part, of
# the dataset, of it packed, of a map; a point of a sweep, a part; a mode pair that is made; a record of a batch, of a
# member.
_START, _TABLE, _WORKER = 1.4, 1.1, 1.2
_READ_BYTE, _PART_BYTE, _BYTE, _PACKED_BYTE, _MAP_BYTE = 7e-9, 5e-9, 4e-9, 32e-9, 2e-9
_POINT, _PART, _MODE, _RECORD, _RECORD_OF_MEMBER = 4e-3, 2e-3, 5e-6, 5e-6, 2e-7
# Rough memory [byte]: libraries, which all processes share, and more of the table; a process beside its work, one that
# writes the dataset, one that reads the table; what is kept of a variable that is written; a byte that is read; a mode
# pair while it is made and while it is used.
_SHARED, _SHARED_BY_TABLE, _PROCESS, _WRITER, _READER = 88e6, 10e6, 70e6, 30e6, 128e6
_CACHE, _OF_BYTE, _OF_MODE_MADE, _OF_MODE = 4 * 2**20, 1.5, 520.0, 160.0
#: Copies of a part while it is made or written; bytes of a quantity's name in it.
_COPIES, _HEADER = 3.0, 300.0
#: Folder, limit and use of the memory of control groups, by their controllers in /proc: of version 2, of version 1.
_GROUPS = {
    "": ("", "memory.max", "memory.current"),
    "memory": ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes"),
}
#: A dataset of more trajectories [byte] is not read back for a table.
_MOST_TABULATED = 1e8


class NoRoom(RuntimeError):
    """A run needs more memory than there is."""

    exit_code = 1


class Takes(NamedTuple):
    """Needs of a run with some ``jobs``: time of all cores and by the clock [s], the dataset, room on disk [byte]."""

    cpu: float
    clock: float
    memory: float
    file: float
    disk: float


def takes(plan: Plan, jobs: int, pace: float = 1.0, shares: int = 1, left: float = 1.0) -> Takes:
    """Needs of a run, or of one of some shares of it, at a ``pace`` of the machine: its time over what is counted.

    Of the steps a part is ``left`` where an unfinished run goes on; the disk holds those that are done as well.
    """
    points, parts = plan.points, len(plan.packs) * len(plan.groups()) * len(plan.blocks(plan.points[0]))
    packed = plan.maps if plan.scenario.record.compression == "none" else plan.bytes
    modes = _MODE * max(_mode_pairs(point) for point in spread(points, 2))
    disk = _parts(plan)
    steps = left * (pace * counted(plan) + parts * _PART + disk * _PART_BYTE) / shares
    alone = _START + modes + len(points) * _POINT
    if shares == 1:  # a share makes no dataset
        alone += plan.bytes * _BYTE + packed * _PACKED_BYTE
        alone += _TABLE + _READ_BYTE * plan.trajectories if tabulated(plan) else 0.0
    started = _WORKER + modes if jobs > 1 else 0.0
    cpu, clock = alone + jobs * started + steps, alone + started + steps / jobs
    disk = disk + plan.file_bytes if shares == 1 else disk / shares
    return Takes(cpu, clock, memory(plan, jobs), plan.file_bytes, disk)


def tabulated(plan: Plan) -> bool:
    """True if a run ends with a table of its dataset, which is read for that as a whole."""
    return plan.trajectories <= _MOST_TABULATED


def spread(points: Sequence[Scenario], most: int = 8) -> list[Scenario]:
    """Some of the points, first and last included."""
    places = np.unique(np.linspace(0, len(points) - 1, min(most, len(points))).round().astype(int))
    return [points[place] for place in places]


def counted(plan: Plan) -> float:
    """Counted time of all steps and records on one core [s]."""
    some, groups = spread(plan.points), plan.groups()
    whole = [Block(-1, point.clock.steps, point.clock.stride) for point in some]
    first, last = (
        sum(counted_block(point, group, block) for point, block in zip(some, whole, strict=True))
        for group in (groups[0], groups[-1])
    )
    return len(plan.points) * ((len(groups) - 1) * first + last) / len(some)


def counted_block(point: Scenario, members: np.ndarray, block: Block, speeds: np.ndarray | None = None) -> float:
    """Counted time of the steps of a block, of the records and of the maps in it [s]."""
    steps = block.end - block.start
    maps = map_bytes(point, int(np.sum(members < point.record.map_members))) if point.record.maps else 0.0
    maps *= sum(block.start < step <= block.end for step in snapshots(point)) / max(1, len(point.record.maps))
    records = steps / block.stride * (_RECORD + len(members) * _RECORD_OF_MEMBER)
    return steps * seconds_a_step(point, len(members), speeds) + records + _MAP_BYTE * maps


def memory(plan: Plan, jobs: int) -> float:
    """Memory of all processes together at most [byte], while blocks are computed, written, or read for the table."""
    ends = spread(plan.points, 2)
    part, block = (max(of(plan, point) for point in ends) for of in (_part, _block))
    computed = _PROCESS + (jobs * (_PROCESS + block) if jobs > 1 else block)
    written = _PROCESS + _WRITER + min(len(plan.variables) * _CACHE, plan.bytes) + _COPIES * part
    read = _SHARED_BY_TABLE + _READER + _OF_BYTE * plan.trajectories if tabulated(plan) else 0.0
    return _SHARED + max(computed, written, read)


def _mode_pairs(point: Scenario) -> int:
    return point.process.pairs if point.fluctuations.keeps_modes else 0


def _block(plan: Plan, point: Scenario) -> float:
    """Memory of a block that is computed, beside that of its process [byte]."""
    pairs, states = _mode_pairs(point), 2.0 * 8.0 * plan.group * state_numbers(point)
    return max(_OF_MODE_MADE * pairs, _OF_MODE * pairs + states + _COPIES * _part(plan, point))


def _part(plan: Plan, point: Scenario) -> float:
    """Size of the largest part [byte]."""
    numbers = plan.group * max(1, plan.records_of_block(point)) * len(plan.variables) * len(plan.packs[0])
    drawn = min(1.0, plan.snapshots_of_block(point) / len(point.record.maps)) if point.record.maps else 0.0
    return 8.0 * numbers + drawn * map_bytes(point, plan.group)


def _parts(plan: Plan) -> float:
    """Size of all parts [byte]: what is recorded, in double precision, and the states between blocks."""
    first, groups = plan.points[0], len(plan.groups())
    blocks, each = len(plan.blocks(first)), plan.members if plan.per_member else 3 * groups
    rows = sum(each if plan.varies(one) else groups for one in plan.variables)
    states = (blocks - 1) * plan.members * state_numbers(first)
    headers = _HEADER * len(plan.packs) * groups * blocks * len(plan.variables)
    return plan.maps + headers + 8.0 * len(plan.points) * (rows * first.clock.records + states)


def fitting(plan: Plan, jobs: int, most: float = math.inf, kept: bool = False) -> int:
    """Processes, ``jobs`` at most, for which there is memory and ``most`` [byte] are enough.

    Where the dataset is ``kept`` in memory, it counts.

    Raises
    ------
    NoRoom
        If not even one has enough; the message says how much it takes.
    """
    free, own = _free_memory(), _parts(plan) + plan.bytes if kept else 0.0
    held, whose = (free, "are free") if free < most else (most, "are allowed (--max-memory)")
    for count in range(jobs, 0, -1):
        if memory(plan, count) + own <= held:
            return count
    cure = "fewer modes, maps, records or points of a sweep take less (see `sim check`)"
    raise NoRoom(
        f"the run takes {size(memory(plan, 1) + own)} of memory at least, of which {size(held)} {whose}; {cure}"
    )


def refuse_full_disk(plan: Plan, target: Path, shares: int = 1) -> None:
    """Refuse a run, or one of some shares of it, whose parts and dataset do not fit on the disk of its output.

    Raises
    ------
    StoreTrouble
        With the numbers and the cure.
    """
    folder = next(one for one in target.absolute().parents if one.is_dir())
    needed, free = takes(plan, 1, shares=shares).disk, float(shutil.disk_usage(folder).free)
    with contextlib.suppress(OSError):  # what an unfinished run has already
        free += sum(path.stat().st_size for path in parts_of(target).iterdir())
    if needed > free:
        said = f"parts and dataset take {size(needed)} until they are one file, of which {size(free)} are free"
        raise StoreTrouble(f"{folder}: {said}; fewer members, records or maps take less, as do pooled statistics")


@contextlib.contextmanager
def room_named(plan: Plan) -> Iterator[None]:
    """A context in which the message of a full disk says how much a run takes, and how it goes on."""
    try:
        yield
    except DiskFull as trouble:
        needed = size(takes(plan, 1).disk)
        cure = "make room, and the same command with --resume goes on"
        raise DiskFull(f"{trouble}; parts and dataset take {needed} until they are one file; {cure}") from trouble


def _free_memory() -> float:
    """Memory that this process and those that it starts may take [byte]: what they have, and what the machine can give.

    The least of what the system says is available, of the limits of the control groups that hold this process, and of
    the limit of its addresses.
    """
    status = _table(Path("/proc/self/status"))
    own = status.get("VmRSS", 0.0)
    limits = [own + _table(Path("/proc/meminfo")).get("MemAvailable", float("inf"))]
    limits += [own + free for free in _free_in_groups()]
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY:
        limits.append(own + limit - status.get("VmSize", 0.0))
    return min(limits)


def _table(path: Path) -> dict[str, float]:
    """Numbers of a file of the system with lines such as "VmRSS:  12 kB" [byte]."""
    found = {}
    with contextlib.suppress(OSError):
        for line in path.read_text().splitlines():
            name, _, value = line.partition(":")
            if value.endswith("kB"):
                found[name] = 1024.0 * float(value.split()[0])
    return found


def _free_in_groups(root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")) -> Iterator[float]:
    """Memory that is left to the control groups of this process, and to those that hold them [byte]."""
    lines = own.read_text().splitlines() if own.exists() else []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers not in _GROUPS:
            continue
        within, *names = _GROUPS[controllers]
        top = root / within
        group = top / path.strip("/")
        for folder in (group, *group.parents)[: len(group.relative_to(top).parts) + 1]:
            with contextlib.suppress(OSError, ValueError):  # no such file, or "max"
                limit, used = (float((folder / name).read_text()) for name in names)
                stat = dict(row.split() for row in (folder / "memory.stat").read_text().splitlines())
                yield limit - used + float(stat.get("inactive_file", 0.0))


def size(count: float) -> str:
    """A number of bytes to two digits, as the estimate it is."""
    units = ("GB", 1e9), ("MB", 1e6), ("kB", 1e3)
    unit, factor = next((row for row in units if count >= row[1]), ("byte", 1.0))
    return f"{float(f'{count / factor:.2g}'):g} {unit}"
