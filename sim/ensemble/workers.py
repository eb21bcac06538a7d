"""Processes that work for a run."""

import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any


class ChildDied(RuntimeError):
    """A process ended without a word, as after a crash inside a library."""


def in_process(work: Callable[..., None], *arguments: Any) -> None:
    """Do some work in a Python process of its own, so that a crash ends that process alone.

    Raises
    ------
    ChildDied
        If the process was killed or crashed.
    Exception
        Whatever the work raised.
    """
    command = [sys.executable, "-c", "from sim.ensemble.workers import serve; serve()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        try:
            said, _ = child.communicate(pickle.dumps((work, arguments)))
        except BaseException:
            child.kill()
            raise
    if said:
        raise pickle.loads(said)
    if child.returncode:
        how = signal.Signals(-child.returncode).name if child.returncode < 0 else f"exit status {child.returncode}"
        raise ChildDied(f"the process that makes the dataset ended with {how}")


def serve() -> None:
    """Do the work that standard input brings, and hand back what it raises."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # whoever waits for this process is interrupted, too, and ends it
    work, arguments = pickle.load(sys.stdin.buffer)
    try:
        work(*arguments)
    except Exception as trouble:
        pickle.dump(trouble, sys.stdout.buffer)
