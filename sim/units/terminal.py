"""Output on a terminal: text without control characters, tables, and the progress of a run."""

import contextlib
import logging
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import click

#: What the Python interface tells: remarks as warnings, progress as information.
LOG = logging.getLogger("sim")

#: Seconds between two lines of progress without a terminal.
_PAUSE = 30.0
#: Columns of a terminal on which no table is cut short.
_WIDE = 100_000


def one_line(text: str) -> str:
    r"""Return a text on one line, with control characters and marks of direction written out.

    >>> print(one_line(f"{chr(27)}[31m{chr(0x202E)}3 mN"))
    \x1b[31m\u202e3 mN
    """
    return "".join(c if c.isprintable() else "?" if c.isspace() else repr(c)[1:-1] for c in text)


def plain(text: str) -> str:
    """Return a text of several lines, each as ``one_line`` writes it."""
    return "\n".join(map(one_line, text.split("\n")))


def say(text: str = "", err: bool = False) -> None:
    """Print a text without control characters."""
    click.echo(plain(text), sys.stderr if err else sys.stdout)


def note(text: str) -> None:
    """Print a line to standard error; a reader that is gone is no error."""
    with contextlib.suppress(OSError):
        say(text, err=True)


class Notes(logging.Handler):
    """Prints the remarks of the package as the commands do, a note on standard error each."""

    def emit(self, record: logging.LogRecord) -> None:
        note(f"note: {record.getMessage()}")


def print_rows(rows: list[dict[str, str]]) -> None:
    """Print a table, as wide as its cells are. The keys of the rows are the headings."""
    if not rows:
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for heading in rows[0]:
        table.add_column(Text(plain(heading)), justify="right", no_wrap=True, vertical="bottom")
    for row in rows:
        table.add_row(*(Text(one_line(cell)) for cell in row.values()))
    Console(file=sys.stdout, width=_WIDE).print(table)


def print_table(rows: list[dict[str, str]], text: str) -> None:
    """Print a table and the text below it."""
    print_rows(rows)
    say(text)


@contextlib.contextmanager
def while_read() -> Iterator[None]:
    """End the program with success if the reader of its output stops early."""
    try:
        yield
    except (BrokenPipeError, SystemExit) as end:
        if not isinstance(end, BrokenPipeError) and not isinstance(end.__context__, BrokenPipeError):
            raise  # click and rich exit by themselves
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        sys.exit(0)


class Shown(NamedTuple):
    """Display of progress: ``advance`` takes the work done since its last call, ``begin`` the name of a stage."""

    advance: Callable[[int], None] = lambda done: None
    begin: Callable[[str], None] = lambda stage: None


@contextlib.contextmanager
def progress_bar(total: int, what: str = "member-steps") -> Iterator[Shown]:
    """Show the fraction of a total that is done: as a bar on a terminal, else as a line from time to time."""
    if sys.stderr.isatty() and sys.stdout.isatty():
        from rich.progress import Progress

        with Progress(transient=True) as progress:
            task = progress.add_task(what, total=total)
            yield Shown(lambda n: progress.advance(task, n), lambda stage: progress.update(task, description=stage))
        return
    yield progress_lines(total, what, note)


def progress_lines(total: int, what: str, tell: Callable[[str], None]) -> Shown:
    """Return a display that tells the fraction of a total that is done from time to time; short runs tell nothing."""
    finished, began = 0, time.monotonic()
    printed = began

    def advance(done: int) -> None:
        nonlocal finished, printed
        finished, now = finished + done, time.monotonic()
        if now - printed > _PAUSE and finished:
            printed, left = now, (now - began) * (total - finished) / finished
            tell(f"{100 * finished / total:.0f} % of {total:,} {what}, {duration(left)} left")

    def begin(stage: str) -> None:
        if stage and time.monotonic() - began > _PAUSE:
            tell(stage)

    return Shown(advance, begin)


def duration(seconds: float) -> str:
    """Return a time as text."""
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"


def signals(*names: str) -> list[signal.Signals]:
    """Return those of the named signals that this system has: schedulers stop a run by signals that Windows lacks."""
    return [getattr(signal, name) for name in names if hasattr(signal, name)]
