"""Progress of a run: its stages, what is done of it, and the first compilation of kernels."""

import contextlib
import os
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from sim.units.terminal import say

#: Seconds between two lines of progress, where no bar is shown.
_PAUSE = 30.0


def note(text: str) -> None:
    """Print a line to standard error; that nobody reads it ends no run."""
    with contextlib.suppress(OSError):
        say(text, err=True)


@contextlib.contextmanager
def while_read() -> Iterator[None]:
    """A context that ends the program in silence, as done, when whoever reads what it prints has read enough."""
    try:
        yield
    except (BrokenPipeError, SystemExit) as end:
        if not isinstance(end, BrokenPipeError) and not isinstance(end.__context__, BrokenPipeError):  # rich exits
            raise
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(0)


class Shown(NamedTuple):
    """What shows progress: ``advance`` takes what was done since its last call, ``begin`` the name of a stage."""

    advance: Callable[[int], None] = lambda done: None
    begin: Callable[[str], None] = lambda stage: None


class Stages:
    """Stages of a run one after the other, and the ``seconds`` that each took."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.shown = Shown()
        self._stage, self._since = "loading", time.monotonic()

    def begin(self, stage: str) -> None:
        """End the present stage and begin another."""
        now = time.monotonic()
        self.seconds[self._stage] = round(now - self._since, 2)
        self._stage, self._since = stage, now
        self.shown.begin(stage)

    def ended(self) -> dict[str, float]:
        """End the present stage; seconds of all."""
        self.begin("")
        return self.seconds


@contextlib.contextmanager
def progress_bar(total: int, what: str = "member-steps") -> Iterator[Shown]:
    """A context that shows progress: as a bar on a terminal, else by a line every half minute."""
    if sys.stderr.isatty() and sys.stdout.isatty():
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        shown = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f}%"))
        with Progress(*shown, TimeRemainingColumn(), transient=True) as progress:
            task = progress.add_task(what, total=total)
            yield Shown(lambda done: progress.advance(task, done), lambda name: progress.update(task, description=name))
        return
    so_far, began = 0, time.monotonic()
    said = began

    def advance(done: int) -> None:
        nonlocal so_far, said
        so_far += done
        if time.monotonic() - said > _PAUSE:
            said = time.monotonic()
            note(f"{100 * so_far / total:.0f} % of {total:,} {what}")

    def begin(stage: str) -> None:
        if stage and time.monotonic() - began > _PAUSE:  # shorter runs need no lines
            note(stage)

    yield Shown(advance, begin)


def announce_compiling(quiet: bool = False) -> None:
    """Let the first kernel that is not in the cache be announced, since its compilation takes seconds."""
    from sim.numerics import jit

    def announce(name: str) -> None:
        jit.on_compiling.clear()
        if not quiet:
            note("compiling kernels for this scene, once: up to half a minute; `sim warm` compiles all")

    jit.on_compiling[:] = [announce]


def log(target: Path, began: float, seconds: dict[str, float]) -> None:
    """Write the log; trouble with it is a note, as it does not harm the output."""
    from sim.ensemble import simulate

    try:
        simulate.write_log(target, began, sys.argv[1:], seconds)
    except OSError as trouble:
        note(f"note: {target}.log was not written: {trouble}")
