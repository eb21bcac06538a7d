"""Processes that work for a run."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable
from typing import Any, BinaryIO


class ChildDied(RuntimeError):
    """A process ended without a word, as after a crash inside a library."""


def in_process(work: Callable[..., None], *arguments: Any) -> None:
    """Do some work in a Python process of its own, so that a crash ends that process alone.

    It is a copy of this process where that is safe: on Linux, without other threads that may hold a lock. A new one
    first loads what the work needs, a quarter of a second.

    Raises
    ------
    ChildDied
        If the process was killed or crashed.
    Exception
        Whatever the work raised.
    """
    copied = sys.platform == "linux" and threading.active_count() == 1
    said, code = (_in_copy if copied else _in_new)(work, arguments)
    if said:
        raise pickle.loads(said)
    if code:
        how = signal.Signals(-code).name if code < 0 else f"exit status {code}"
        raise ChildDied(f"the process that makes the dataset ended with {how}")


def _in_copy(work: Callable[..., None], arguments: tuple[Any, ...]) -> tuple[bytes, int]:
    """What a copy of this process says of its work, and its exit code."""
    reader, writer = os.pipe()
    with warnings.catch_warnings():  # the threads of numpy's BLAS, which Python warns of, survive a copy
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        try:
            with os.fdopen(writer, "wb") as answer:
                _do(work, arguments, answer)
            os._exit(0)
        finally:
            os._exit(1)
    os.close(writer)
    try:
        with os.fdopen(reader, "rb") as answer:
            said = answer.read()
    except BaseException:
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        _, status = os.waitpid(child, 0)
    return said, os.waitstatus_to_exitcode(status)


def _in_new(work: Callable[..., None], arguments: tuple[Any, ...]) -> tuple[bytes, int]:
    """What a new process says of its work, and its exit code."""
    command = [sys.executable, "-c", "from sim.ensemble.workers import serve; serve()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        try:
            said, _ = child.communicate(pickle.dumps((work, arguments)))
        except BaseException:
            child.kill()
            raise
    return said, child.returncode


def serve() -> None:
    """Do the work that standard input brings, and hand back what it raises."""
    work, arguments = pickle.load(sys.stdin.buffer)
    _do(work, arguments, sys.stdout.buffer)


def _do(work: Callable[..., None], arguments: tuple[Any, ...], answer: BinaryIO) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for this process is interrupted, too, and ends it
    try:
        work(*arguments)
    except Exception as trouble:
        pickle.dump(trouble, answer)
