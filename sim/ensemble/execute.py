"""Blocks of a run given to workers: this process, several processes, or a dask cluster, all by one interface.

A task is the next block of one group of members at one point of the sweep. The blocks of a group form a chain: the next
is given out when the one before is done. A worker keeps its last group in memory, so modes are not computed again.
Another worker continues from the state that was stored with the previous block.
"""

import bisect
import concurrent.futures
import contextlib
import functools
import importlib
import io
import os
import pickle
import signal
import sys
import threading
import time
import uuid
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, NamedTuple

from sim.ensemble.plan import Task
from sim.ensemble.store import Arrays, Blocks
from sim.numerics import jit
from sim.numerics.disk_cache import digest
from sim.numerics.files import StoreTrouble
from sim.step.state import State, pack, unpack
from sim.units.errors import BadInput
from sim.units.terminal import progress_bar, signals

#: Broken pools after which a block is given up.
_TRIES = 3
#: Seconds after which a wait looks whether the run is to stop, and for which a scheduler may be silent.
_LOOK, _PATIENCE = 0.2, "20 s"
#: Blocks that are given out for each thread of a cluster.
_AHEAD = 2
#: Each process has one core: libraries of linear algebra are not to start threads of their own.
_ONE_THREAD = {
    f"{name}_NUM_THREADS": "1"
    for name in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA")
}
#: Signals by which a terminal or a scheduler stops a run.
_STOPPING = "SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK", "SIGUSR1", "SIGXCPU"
#: Computes a block of a task from the state before it; returns the state at its end and what is recorded.
Advance = Callable[[Task, int, State | None], tuple[State, Arrays]]


class WorkerDied(RuntimeError):
    """A process ended without an answer: it was killed, or crashed inside a library."""

    exit_code = 1


def pickled(value: object) -> bytes:
    """Return a value for another process, with the local classes that tables of a scenario have."""
    import cloudpickle
    from pydantic.dataclasses import is_pydantic_dataclass, rebuild_dataclass

    class Pickler(cloudpickle.Pickler):  # type: ignore[misc]
        def reducer_override(self, value: Any) -> Any:
            # cloudpickle sends what a local class consists of. A schema that pydantic has yet to build is built before
            # that: with pydantic up to 2.14.0 the other process ends in a RecursionError.
            is_local = "<locals>" in getattr(value, "__qualname__", "")
            if is_local and is_pydantic_dataclass(value):
                rebuild_dataclass(value)
            return super().reducer_override(value)

    target = io.BytesIO()
    Pickler(target).dump(value)
    return target.getvalue()


@dataclass
class _Chain:
    """The blocks of a task that are missing, the next one last; ``broken`` counts the pools that broke under it.

    ``fault`` is what a block raised, after which none of the task is missing any more.
    """

    key: str
    task: Task
    missing: list[int]
    state: Arrays | None = None
    broken: int = 0
    fault: Exception | None = None

    @functools.cached_property
    def pickled(self) -> bytes:
        return pickled(self.task)


@dataclass
class _Group:
    """A task in a worker, the number of its last block, and the state at the end of that block."""

    key: str
    task: Task
    number: int = -1
    state: State | None = None


class _Last(threading.local):
    """The group of which this thread computed the last block, unless that was its end."""

    group: _Group | None = None


_last = _Last()


class _Team(NamedTuple):
    """An executor with the number of blocks that it takes at once.

    ``far`` is true if it does not reach the store. It raises ``killed`` for a block whose workers died again and again.
    """

    executor: Any
    room: Callable[[], int]
    far: bool = False
    killed: tuple[type[Exception], ...] = ()


class _Here(concurrent.futures.Executor):
    """An executor that computes at once, in the process and thread that asks for it."""

    def submit(
        self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any
    ) -> Any:
        future: Any = concurrent.futures.Future()
        try:
            future.set_result(function(*arguments, **keywords))
        except Exception as trouble:
            future.set_exception(trouble)
        return future


def compute(
    advance: Advance,
    store: Blocks,
    tasks: Sequence[tuple[Task, list[int]]],
    progress: Callable[[int], None],
    stop: Callable[[], bool],
    jobs: int = 1,
    scheduler: str = "",
) -> None:
    """Compute the missing blocks of tasks and save them.

    Parameters
    ----------
    advance : callable
        Computes a block; a worker must be able to import it.
    store : MemoryBlocks or BlockFiles
        Takes the blocks; with several processes it is in files.
    tasks : sequence
        Each task with the numbers of its missing blocks.
    progress : callable
        Takes the member-steps of each block that is done.
    stop : callable
        True if no other block is to be begun.
    jobs : int
        Number of processes.
    scheduler : str
        Address of a dask scheduler, such as ``tcp://10.0.0.1:8786``, whose workers take the place of processes.

    Raises
    ------
    BadInput
        If dask is not installed here, or the workers have another version.
    WorkerDied
        If no scheduler answers, or, when all else is done, if processes died again and again at the same block.
    Exception
        As raised by a block: at once if it may concern all (disk, memory, input, cluster), else when all else is done.
    """
    run, before = uuid.uuid4().hex, _last.group
    chains = [
        _Chain(f"{run}-{place}", task, missing[::-1])
        for place, (task, missing) in enumerate(tasks)
    ]
    waiting = chains[::-1]
    if scheduler:
        with _cluster(scheduler) as team:
            _work_off(team, advance, store, waiting, progress, stop)
    elif jobs > 1 and len(tasks) > 1:
        while waiting and not stop():  # a broken pool is replaced
            with pool(min(jobs, len(tasks))) as executor:
                _work_off(
                    _Team(executor, lambda: jobs),
                    advance,
                    store,
                    waiting,
                    progress,
                    stop,
                )
    else:
        try:
            _work_off(
                _Team(_Here(), lambda: 1), advance, store, waiting, progress, stop
            )
        finally:
            _last.group = before  # of a run whose ``progress`` runs this one
    for chain in chains:
        if chain.fault:
            chain.fault.add_note(
                f"in {chain.task}; all other blocks are kept; --resume repeats these"
            )
            raise chain.fault
    if lost := [chain for chain in chains if chain.broken == _TRIES]:
        names = "; ".join(str(chain.task) for chain in lost)
        cure = "the likely reason is too little memory; all other blocks are kept; --resume repeats these"
        raise WorkerDied(
            f"stopped after repeated crashes of processes: {names}; {cure}"
        )


def _work_off(
    team: _Team,
    advance: Advance,
    store: Blocks,
    waiting: list[_Chain],
    progress: Callable[[int], None],
    stop: Callable[[], bool],
) -> None:
    """Give out the blocks of chains until none is left, a stop is asked for, or the pool breaks."""
    running: dict[Any, _Chain] = {}
    is_broken = False
    try:
        while True:
            while (
                not is_broken
                and len(running) < team.room()
                and not (waiting and stop())
            ):
                if not (chain := _taken(waiting, running.values())):
                    break
                try:
                    running[_submitted(team, advance, store, chain)] = chain
                except concurrent.futures.BrokenExecutor:
                    is_broken = True
                    # the pool broke under this chain, or does not start
                    chain.broken += not running
                    _put(waiting, chain)
            if not running:
                break
            when = (
                concurrent.futures.ALL_COMPLETED
                if is_broken
                else concurrent.futures.FIRST_COMPLETED
            )
            for future in concurrent.futures.wait(running, _LOOK, when).done:
                chain = running.pop(future)
                try:
                    result = future.result()
                except concurrent.futures.BrokenExecutor:
                    is_broken = True
                    chain.broken += 1
                except team.killed:
                    chain.broken = _TRIES
                except (
                    OSError,
                    MemoryError,
                    BadInput,
                    concurrent.futures.CancelledError,
                ):
                    raise
                except Exception as fault:
                    chain.fault = fault
                    chain.missing.clear()
                else:
                    number, chain.broken = chain.missing.pop(), 0
                    if team.far:
                        arrays, state = result
                        store.save(chain.task.names[number], arrays, state)
                        chain.state = (
                            state if number + 1 in chain.missing[-1:] else None
                        )
                    progress(chain.task.work[number])
                _put(waiting, chain)
    finally:
        for future in running:
            future.cancel()


def _taken(waiting: list[_Chain], running: Iterable[_Chain]) -> _Chain | None:
    """Take the chain whose block is given out next: at its last try a block runs alone, so that no other is blamed."""
    alone = any(chain.broken == _TRIES - 1 for chain in (*running, *waiting[-1:]))
    return waiting.pop() if waiting and not (alone and running) else None


def _put(waiting: list[_Chain], chain: _Chain) -> None:
    """Put a chain with missing blocks behind those that broke fewer pools, unless it is given up."""
    if chain.missing and chain.broken < _TRIES:
        bisect.insort(waiting, chain, key=lambda each: each.broken)


def _submitted(team: _Team, advance: Advance, store: Blocks, chain: _Chain) -> Any:
    """Give out the next block of a chain; return its future."""
    number, state = chain.missing[-1], chain.state
    task = chain.task if isinstance(team.executor, _Here) else chain.pickled
    if team.far and number and state is None:
        state = store.state(chain.task.names[number - 1])
    with warnings.catch_warnings():  # of dask: a state may be large
        warnings.filterwarnings("ignore", "Sending large graph")
        reached = None if team.far else store
        return team.executor.submit(
            _block, advance, chain.key, task, number, state, reached, _code()
        )


def _block(
    advance: Advance,
    key: str,
    task: Task | bytes,
    number: int,
    state: Arrays | None,
    store: Blocks | None,
    code: tuple[str, ...],
) -> tuple[Arrays, Arrays] | None:
    """Compute a block in a worker and save it, or return it if there is no store."""
    if code != _code():
        raise BadInput(
            [
                "a worker has another version of sim, numpy, scipy or numba; install the same versions"
            ]
        )
    group, _last.group = _last.group, None
    if group is None or group.key != key:
        group = _Group(key, pickle.loads(task) if isinstance(task, bytes) else task)
    names, points = group.task.names, group.task.points
    if group.number != number - 1:
        before = state if store is None else store.state(names[number - 1])
        group.state = unpack(points[0].parts, before or {})
    group.state, arrays = advance(group.task, number, group.state)
    group.number, is_last = number, number == len(names) - 1
    packed = {} if is_last else pack(group.state)
    if store is not None:
        store.save(names[number], arrays, packed)
    if is_last:
        for point in points:
            point.release()
    else:
        _last.group = group
    return (arrays, packed) if store is None else None


@functools.cache
def _code() -> tuple[str, ...]:
    """Return the hash of the sources and the versions, which decide the numbers."""
    return digest().hex(), *(version(name) for name in ("numpy", "scipy", "numba"))


@contextlib.contextmanager
def pool(jobs: int) -> Iterator[Any]:
    """Give an executor of new processes, which end with this one; scripts, threads and notebooks may start them.

    Raises
    ------
    WorkerDied
        If a process dies and the caller does not handle that.
    """
    import loky  # slow to import
    from loky.backend import get_context

    # the modules that this process would import, and none of the present folder beside
    environment = {
        "PYTHONPATH": os.pathsep.join(folder or os.getcwd() for folder in sys.path),
        "PYTHONSAFEPATH": "1",
    }
    environment |= _ONE_THREAD | {"LOKY_MAX_MEMORY_LEAK_SIZE": "1e18"}
    how: dict[str, Any] = {
        "initializer": _begin,
        "initargs": (os.getpid(),),
        "env": environment,
    }
    executor = None
    try:
        with _ctrl_c_ignored():
            executor = loky.ProcessPoolExecutor(
                jobs, context=get_context("loky"), **how
            )
            executor.submit(os.getpid)  # which starts all processes
        yield executor
    except concurrent.futures.BrokenExecutor:
        raise WorkerDied(
            "a process died: it was killed or crashed, or there was too little memory"
        ) from None
    finally:
        if executor is not None:
            executor.shutdown(kill_workers=True)


@contextlib.contextmanager
def _ctrl_c_ignored() -> Iterator[None]:
    """Ignore Ctrl-C in the main thread and in processes that are started meanwhile, which inherit that."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    _ignore_console(True)
    try:
        yield
    finally:
        _ignore_console(False)
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)


def _ignore_console(ignored: bool) -> None:
    """Let Windows ignore Ctrl-C or not. New processes inherit that there, but no handler of a signal."""
    if sys.platform == "win32":
        import ctypes

        ctypes.windll.kernel32.SetConsoleCtrlHandler(None, ignored)


def _begin(parent: int) -> None:
    """Prepare a process of a pool: the parent alone decides about a stop, and the process does not outlive it."""
    for order in signals(*_STOPPING):
        signal.signal(order, signal.SIG_IGN)
    threading.Thread(target=end_with, args=(parent,), daemon=True).start()


def end_with(parent: int) -> None:
    """End this process when another one is gone."""
    import psutil

    with contextlib.suppress(psutil.Error):
        process = psutil.Process(parent)
        # for which `wait` would wait
        while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
            time.sleep(_LOOK)
    os._exit(1)


@contextlib.contextmanager
def _cluster(address: str) -> Iterator[_Team]:
    """Give the workers of a dask scheduler; if the scheduler goes away, there is one message."""
    try:
        from distributed import CancelledError, Client, KilledWorker  # slow to import
        from distributed.comm import CommClosedError, resolve_address
    except ImportError:
        raise BadInput(
            [
                "--scheduler needs dask.distributed: pip install '.[cluster]' in the folder of the sources"
            ]
        ) from None
    try:
        # a client that fails at it is not closed within its patience
        resolve_address(address)
        client = Client(address, timeout=_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as trouble:
        raise WorkerDied(f"no dask scheduler answers at {address}: {trouble}") from None
    lost = WorkerDied(
        f"the scheduler at {address} does not answer any more; the results so far are kept"
    )

    def room() -> int:
        try:
            return _AHEAD * max(1, sum(client.nthreads().values()))
        except OSError:
            raise lost from None

    with client, client.as_current():
        try:
            yield _Team(
                client.get_executor(pure=False), room, far=True, killed=(KilledWorker,)
            )
        except (CancelledError, concurrent.futures.CancelledError, CommClosedError):
            raise lost from None


@contextlib.contextmanager
def orders() -> Iterator[Callable[[], bool]]:
    """Give whether a stop was ordered by a signal: the first order lets running blocks end, the second does not."""
    received: list[int] = []

    def order(number: int, frame: object) -> None:
        if received:
            raise KeyboardInterrupt
        received.append(number)
        with contextlib.suppress(OSError):  # of a terminal that is gone
            os.write(
                2, b"stopping when the running blocks end; once more stops at once\n"
            )

    before = {number: signal.signal(number, order) for number in signals(*_STOPPING)}
    try:
        yield lambda: bool(received)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


# Kernels that are compiled before a run, by the same processes.


def missing_kernels() -> list[str]:
    """Return the kernels and laws whose code is not in the cache; first those of long modules, which take longest."""
    texts = jit.sources()
    for module in texts:
        importlib.import_module(module)
    names = [name for name in jit.compiled if _module(name) in texts]
    return [
        name
        for name in sorted(names, key=lambda name: -len(texts[_module(name)]))
        if not jit.cached(name)
    ]


def compile_missing(jobs: int | None) -> str:
    """Compile what is not in the cache in some processes, by default one a core; return a text about it.

    Raises
    ------
    StoreTrouble
        If code could not be stored.
    """
    import loky  # slow to import

    lacking = missing_kernels()
    if lacking:
        processes = min(jobs or loky.cpu_count(), len(lacking))
        with (
            progress_bar(len(lacking), "kernels") as shown,
            pool(processes) as executor,
        ):
            for future in concurrent.futures.as_completed(
                [executor.submit(_compile_kernel, name) for name in lacking]
            ):
                future.result()
                shown.advance(1)
    if left := sum(not jit.cached(name) for name in lacking):
        raise StoreTrouble(
            f"{left} kernels could not be stored; set SIM_CACHE_DIR to a writable folder"
        )
    return f"{len(lacking)} of {len(jit.compiled)} kernels and laws compiled; the others are in the cache"


def _compile_kernel(name: str) -> None:
    importlib.import_module(_module(name))
    jit.compiled[name]()


def _module(name: str) -> str:
    return name.rpartition(".")[0]
