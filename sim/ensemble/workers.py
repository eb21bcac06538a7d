"""Processes that work for a run: one that makes a file, or several that share tasks.

Those that share tasks are new interpreters, not copies (locks of libraries may be held by other threads) and not of
``multiprocessing`` (which runs the script of its caller again): notebooks, scripts and threads may all start them.
"""

import collections
import contextlib
import os
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from multiprocessing import Pipe, current_process, get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import Any, cast

#: Times that a task is begun before it is given up.
_TRIES = 3
#: Seconds after which a wait looks whether the run is to stop.
_LOOK = 0.2
#: Each process has one core: libraries of linear algebra are not to start threads of their own.
_ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM", "NUMEXPR", "NUMBA")}
#: Orders to stop, of a terminal or a scheduler.
_ORDERS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGXCPU

#: Takes a task, a callback for what was done of it since the last call, and one that says whether to stop.
Work = Callable[[Any, Callable[[int], None], Callable[[], bool]], None]


class WorkerDied(RuntimeError):
    """A process ended without a word, killed or after a crash inside a library."""

    exit_code = 1


class _Worker:
    """A process that does one task after the other; ``done`` is what it reported of the present one."""

    def __init__(self, work: Work, copied: bool = False) -> None:
        self.connection, theirs = Pipe()
        self.process: subprocess.Popen[bytes] | ForkProcess
        self.told = False
        if copied:
            self.process = get_context("fork").Process(target=_serve, args=(theirs, self.connection))
            with warnings.catch_warnings():  # the threads of numpy's BLAS, which Python warns of, survive a copy
                warnings.simplefilter("ignore", DeprecationWarning)
                self.process.start()
        else:
            command = f"from sim.ensemble.workers import serve; serve({theirs.fileno()})"
            # what this process would import, and nothing of the present folder beside
            path = {"PYTHONPATH": os.pathsep.join(folder or os.getcwd() for folder in sys.path)}
            arguments, environment = [sys.executable, "-P", "-c", command], os.environ | _ONE_THREAD | path
            before = signal.pthread_sigmask(signal.SIG_BLOCK, _ORDERS)  # until the new process ignores them
            try:
                self.process = subprocess.Popen(arguments, pass_fds=[theirs.fileno()], env=environment)
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()
        self.number, self.done = -1, 0
        self.say(work)

    def say(self, what: Any) -> None:
        with contextlib.suppress(OSError):  # of one that is dead: found when it is listened to
            self.connection.send(what)

    def begin(self, number: int, task: Any) -> None:
        self.number, self.done = number, 0
        self.say(task)

    def stop(self) -> None:
        """Let the task end that runs: said once, as nobody reads it before that."""
        if not self.told:
            self.told = True
            self.say(None)

    def end(self, patience: float = _LOOK) -> str:
        """End the process, by force if it takes longer; how it ended."""
        self.connection.close()
        if self._status(patience) is None:
            self.process.kill()
        status = cast(int, self._status(None))
        return signal.Signals(-status).name if status < 0 else f"exit status {status}"

    def _status(self, timeout: float | None) -> int | None:
        """Exit status, None while the process goes on."""
        if not isinstance(self.process, ForkProcess):
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(timeout)
            return self.process.returncode
        self.process.join(timeout)
        return self.process.exitcode


def serve(descriptor: int) -> None:
    """Do the tasks that a connection brings, in a new interpreter."""
    _serve(Connection(descriptor))


def _serve(connection: Connection, of_parent: Connection | None = None) -> None:
    """Do the tasks that a connection brings, until it is closed or brings None."""
    if of_parent is not None:
        of_parent.close()
    for order in _ORDERS:  # of a terminal or a scheduler: whoever gave the tasks decides
        signal.signal(order, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _ORDERS)
    with contextlib.suppress(EOFError, ConnectionError):
        work: Work = connection.recv()
        while (task := connection.recv()) is not None:
            try:
                work(task, connection.send, connection.poll)
                connection.send(None)
            except ConnectionError:
                raise
            except Exception as trouble:
                connection.send(trouble)


def in_process(work: Callable[..., None], *arguments: Any) -> None:
    """Do some work in a process of its own, so that a crash ends that process alone.

    It is a copy of this process where that is safe and allowed: on Linux, without other threads that may hold a lock,
    and not of a daemon. A new one first loads what the work needs, a quarter of a second.

    Raises
    ------
    WorkerDied
        If the process was killed or crashed.
    Exception
        Whatever the work raised.
    """
    alone = threading.active_count() == 1 and not current_process().daemon
    worker = _Worker(_call, copied=sys.platform == "linux" and alone)
    try:
        worker.begin(0, (work, arguments))
        trouble = worker.connection.recv()
    except EOFError:
        raise WorkerDied(f"the process that makes the dataset ended with {worker.end()}") from None
    finally:
        worker.end()
    if trouble is not None:
        raise trouble


def _call(task: tuple[Callable[..., None], tuple[Any, ...]], *_: Any) -> None:
    work, arguments = task
    work(*arguments)


def share_out(
    work: Work, tasks: Sequence[Any], jobs: int, progress: Callable[[int], None], stop: Callable[[], bool]
) -> None:
    """Do tasks in several processes; one that dies is replaced and its task begun again.

    Parameters
    ----------
    work : callable
        Called in a process; it can be imported there.
    tasks : sequence
        What to do, each begun as soon as a process is free.
    jobs : int
        Number of processes.
    progress : callable
        Takes what was done since its last call, negative where a task has to begin again.
    stop : callable
        Says whether no other task is to be begun and those that run are to stop.

    Raises
    ------
    WorkerDied
        When all other tasks are done, if the processes of one died three times.
    Exception
        What the first task that fails has raised; the others are ended.
    """
    left, tries, lost = list(range(len(tasks)))[::-1], collections.Counter[int](), list[str]()
    team = [_Worker(work) for _ in range(min(jobs, len(tasks)))]
    try:
        while True:
            stopped = stop()
            for worker in team:
                if stopped:
                    worker.stop()
                elif worker.number < 0 and left:
                    worker.begin(left[-1], tasks[left.pop()])
            busy: dict[Any, _Worker] = {worker.connection: worker for worker in team if worker.number >= 0}
            if not busy:
                break
            for connection in wait(list(busy), _LOOK):
                worker = busy[connection]
                try:
                    said = worker.connection.recv()
                except (EOFError, ConnectionError):
                    progress(-worker.done)
                    how, number = worker.end(), worker.number
                    tries[number] += 1
                    if tries[number] < _TRIES:
                        left.append(number)
                    else:
                        lost.append(f"{tasks[number]} ({how})")
                    team[team.index(worker)] = _Worker(work)
                    continue
                if isinstance(said, Exception):
                    raise said
                if said is None:
                    worker.number = -1
                else:
                    worker.done += said
                    progress(said)
    finally:
        for worker in team:
            worker.connection.close()
        for worker in team:
            worker.end(patience=_LOOK if worker.number < 0 else 0.0)
    if lost:
        raise WorkerDied(f"given up after {_TRIES} times each: {'; '.join(lost)}; the rest is done and kept")


@contextlib.contextmanager
def orders() -> Iterator[Callable[[], bool]]:
    """A context that gives whether to stop was ordered: the first order lets running blocks end, the second not."""
    came: list[int] = []

    def order(number: int, frame: object) -> None:
        if came:
            raise KeyboardInterrupt
        came.append(number)
        with contextlib.suppress(OSError):  # of a terminal that is gone
            os.write(2, b"stopping when the running blocks end; once more stops at once\n")

    before = {one: signal.signal(one, order) for one in _ORDERS}
    try:
        yield lambda: bool(came)
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
