"""Progress of a run: its stages, what is done of it, and the first compilation of kernels."""

import contextlib
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from sim.units import absent
from sim.units.terminal import say

#: Seconds between two lines of progress, where no bar is shown.
_PAUSE = 30.0
#: Seconds after which a stage without a bar is named.
_SLOW = 3.0


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
def progress_bar(total: int, what: str = "member-steps", each: int = 0) -> Iterator[Shown]:
    """A context that shows what is done of a total, ``each`` of a member: as a bar on a terminal, else by lines."""
    if sys.stderr.isatty() and sys.stdout.isatty():
        from rich.progress import BarColumn, Progress, TextColumn

        columns = TextColumn("{task.description}"), BarColumn(10), TextColumn("{task.fields[said]}")
        with Progress(*columns, transient=True) as progress:
            progress.add_task(what, total=total, said="")
            (task,) = progress.tasks

            def draw(done: int) -> None:
                progress.advance(task.id, done)
                progress.update(task.id, said=_said(int(task.completed), total, "", each, task.speed or 0.0))

            yield Shown(draw, lambda name: progress.update(task.id, description=name))
        return
    so_far, began = 0, time.monotonic()
    before, said = 0, began

    def advance(done: int) -> None:
        nonlocal so_far, before, said
        so_far, now = so_far + done, time.monotonic()
        if now - said > _PAUSE:
            note(_said(so_far, total, what, each, (so_far - before) / (now - said)))
            before, said = so_far, now

    def begin(stage: str) -> None:
        if stage and time.monotonic() - began > _PAUSE:  # shorter runs need no lines
            note(stage)

    yield Shown(advance, begin)


def _said(done: int, total: int, what: str, each: int, rate: float) -> str:
    """What is done, at which ``rate`` [1/s], and how long the rest takes."""
    said = [f"{100 * done / total:.0f} %{f' of {total:,} {what}' if what else ''}"]
    if each:
        said.append(f"{done // each:,} of {total // each:,} members")
    if rate > 0.0:
        said += [f"{rate:,.0f} a second", f"{duration((total - done) / rate)} left"]
    return ", ".join(said)


def duration(seconds: float) -> str:
    """A time in words."""
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


@contextlib.contextmanager
def named(stage: str, quiet: bool) -> Iterator[None]:
    """A context that names a stage once it has taken some seconds."""
    timer = threading.Timer(_SLOW, (lambda text: None) if quiet else note, [stage])
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def announce_compiling(quiet: bool = False) -> None:
    """Let the first kernel that is not in the cache be announced, since its compilation takes seconds."""
    from sim.numerics import jit

    def announce(name: str) -> None:
        jit.on_compiling.clear()
        absent.blas()
        if not quiet:
            note("compiling kernels for this scene, once: up to half a minute; `sim warm` compiles all")

    jit.on_compiling[:] = [announce]
