"""Tasks of a run on the workers of a dask cluster, a block of steps at a time.

What a block records comes back over the network and is kept here, so that the workers need no file system of ours.
"""

import contextlib
import pickle
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from typing import Any

from sim.ensemble.part_files import Arrays, Parts
from sim.ensemble.plan import Task
from sim.ensemble.workers import WorkerDied
from sim.numerics.disk_cache import digest
from sim.units.errors import BadInput

#: Seconds after which a wait looks whether the run is to stop, and for which a scheduler may be silent.
_LOOK, _PATIENCE = 0.2, "20 s"
#: Blocks that are given out for each thread of the cluster.
_AHEAD = 2
#: The last task of each thread, whose bands and modes serve its next block.
_kept = threading.local()

#: Takes parts, a task, a callback for what was done and one that says whether to stop.
Advance = Callable[[Any, Task, Callable[[int], None], Callable[[], bool]], None]


class _Carried:
    """Parts of a task on a worker: which are there, the state to go on from, and the block that it has computed."""

    def __init__(self, there: set[str], states: dict[str, Arrays]) -> None:
        self.there, self.states, self.made = there, states, list[tuple[str, Arrays, Arrays]]()

    def __contains__(self, name: str) -> bool:
        return name in self.there

    def save(self, name: str, arrays: Arrays, state: Arrays) -> None:
        self.made.append((name, arrays, state))

    def state(self, name: str) -> Arrays:
        return self.states[name]


def share_out(
    advance: Advance, parts: Parts, tasks: Sequence[Task], address: str, progress: Callable[[int], None],
    stop: Callable[[], bool],
) -> None:  # fmt: skip
    """Do tasks on a cluster, few at a time; the cluster begins a block again where a worker dies, three times.

    Parameters
    ----------
    advance : callable
        Computes the next blocks of a task.
    parts : Parts
        Where blocks are kept.
    tasks : sequence of Task
        What to do.
    address : str
        Of the scheduler, such as ``tcp://10.0.0.1:8786``.
    progress : callable
        Takes the member-steps of each block that is done.
    stop : callable
        Says whether no other block is to be begun.

    Raises
    ------
    BadInput
        If dask is not installed here, or the workers have another version.
    WorkerDied
        If no scheduler answers, or, when all else is done, the workers at some block died again and again.
    Exception
        What the first block that fails has raised.
    """
    left, running, lost = list(tasks)[::-1], dict[Any, Task](), list[str]()
    with _client(address) as client:
        from distributed import KilledWorker, wait

        progress(sum(task.done(parts) for task in tasks))
        try:
            while True:
                room = _AHEAD * max(1, sum(client.nthreads().values())) - len(running)
                for _ in range(0 if stop() else min(room, len(left))):
                    task = left.pop()
                    running[_submitted(client, advance, parts, task)] = task
                if not running:
                    break
                with contextlib.suppress(TimeoutError):
                    wait(list(running), timeout=_LOOK, return_when="FIRST_COMPLETED")
                for future in [future for future in running if future.done()]:
                    task = running.pop(future)
                    try:
                        name, arrays, state = future.result()
                    except KilledWorker:
                        lost.append(str(task))
                        continue
                    parts.save(name, arrays, state)
                    progress(task.work[task.names.index(name)])
                    if name != task.names[-1]:
                        left.append(task)
        finally:
            client.cancel(list(running))
    if lost:
        raise WorkerDied(f"workers died again and again at {'; '.join(lost)}; the rest is done and kept")


@contextlib.contextmanager
def _client(address: str) -> Iterator[Any]:
    """A context with the client of a scheduler, in which it is said that the scheduler went away."""
    try:
        from distributed import CancelledError, Client  # heavy
        from distributed.comm import CommClosedError, resolve_address
    except ImportError:
        raise BadInput(["--scheduler needs dask.distributed; install sliding-sim[cluster]"]) from None
    try:
        resolve_address(address)  # a client that fails at it is not closed within its patience
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as trouble:
        raise WorkerDied(f"no scheduler of dask answers at {address}: {trouble}") from None
    with client, client.as_current():
        try:
            yield client
        except (CancelledError, CommClosedError):
            raise WorkerDied(f"the scheduler at {address} went away; what is computed is kept") from None


def _submitted(client: Any, advance: Advance, parts: Parts, task: Task) -> Any:
    """The future of the next block of a task."""
    with warnings.catch_warnings():  # a state may be large
        warnings.filterwarnings("ignore", "Sending large graph")
        return client.submit(_block, advance, *_order(parts, task), _code(), pure=False)


def _order(parts: Parts, task: Task) -> tuple[bytes, set[str], dict[str, Arrays]]:
    """What a worker needs for the next block of a task: the task, names of parts that are there, the state."""
    there = {name for name in task.names if name in parts}
    next_one = next(number for number, name in enumerate(task.names) if name not in there)
    before = task.names[next_one - 1 : next_one] if next_one else []
    return pickle.dumps(task), there, {name: parts.state(name) for name in before}


def _code() -> tuple[str, ...]:
    """What decides the numbers: sources and versions."""
    return digest().hex(), *(version(name) for name in ("numpy", "scipy", "numba"))


def _block(
    advance: Advance, packed: bytes, there: set[str], states: dict[str, Arrays], code: tuple[str, ...]
) -> tuple[str, Arrays, Arrays]:
    """Compute the next block of a task on a worker; its name, what it recorded, and the state at its end."""
    if code != _code():
        raise BadInput(["a worker of the cluster has another version of sim, numpy, scipy or numba; install the same"])
    if getattr(_kept, "packed", None) != packed:
        _kept.packed, _kept.task = packed, pickle.loads(packed)
    carried = _Carried(there, states)
    advance(carried, _kept.task, lambda done: None, lambda: bool(carried.made))
    return carried.made[0]
