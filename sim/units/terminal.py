"""Output on a terminal: text without control characters, tables, and the progress of a run."""

import codecs
import contextlib
import errno
import io
import logging
import os
import signal
import sys
import textwrap
import time
import unicodedata
from collections.abc import Callable, Iterator
from typing import NamedTuple

import click

#: What the Python interface tells: remarks as warnings, progress as information.
LOG = logging.getLogger("sim")

#: Seconds between two lines of progress without a terminal.
_PAUSE = 30.0
#: Columns of a terminal on which no table is cut short, and of an output that is none.
_WIDE, _NO_TERMINAL = 100_000, 100
#: Letters between two columns of a table, and of a heading before it is wrapped.
_GAP, _SHORTEST = 2, 9
#: Signs of formulas in ASCII, for an output whose encoding lacks them: a lost minus sign would change a number.
_SIGNS = {
    "−": "-",
    "–": "-",
    "—": "-",
    "×": "x",
    "·": "*",
    "⋅": "*",
    "±": "+-",
    "√": "sqrt",
    "½": "1/2",
    "⁄": "/",
    "°": " deg",
    "∫": "integral ",
    "→": "->",
    "►": ">",
    "─": "-",
    "≠": "!=",
    "≤": "<=",
    "≥": ">=",
    "≈": "~",
    "∝": "~",
    "∞": "inf",
    "⟨": "<",
    "⟩": ">",
    "µ": "u",
    "μ": "u",
    "“": '"',
    "”": '"',
    "’": "'",
    "ß": "ss",
}


def one_line(text: str) -> str:
    r"""Return a text on one line, with control characters and marks of direction written out.

    >>> print(one_line(f"{chr(27)}[31m{chr(0x202E)}3 mN"))
    \x1b[31m\u202e3 mN
    """

    def shown(letter: str) -> str:
        if letter.isprintable():
            return letter
        return "?" if letter.isspace() else repr(letter)[1:-1]

    return "".join(map(shown, text))


def plain(text: str) -> str:
    """Return a text of several lines, each as ``one_line`` writes it; lines of older datasets end as on Windows."""
    return "\n".join(map(one_line, text.replace("\r\n", "\n").split("\n")))


def in_ascii(text: str) -> str:
    """Return a text in ASCII: signs of formulas, Greek letters by their names, letters without accents, else "?".

    >>> print(in_ascii("N0 − N: ΔΓ = 3×10⁻² mJ/m², Größe"))
    N0 - N: DeltaGamma = 3x10^-2 mJ/m^2, Grosse
    """
    result = ""
    for place, letter in enumerate(text):
        name = unicodedata.name(letter, "").split()
        if letter.isascii() or letter in _SIGNS:
            result += _SIGNS.get(letter, letter)
        elif name[:1] == ["GREEK"] and name[2:3] == ["LETTER"]:
            word = name[3].lower()
            result += word.capitalize() if name[1] == "CAPITAL" else word
        elif not unicodedata.combining(letter):
            before = text[place - 1 : place]
            result += "^" * (_is_raised(letter) and not _is_raised(before))
            parts = unicodedata.normalize("NFKD", letter).replace("−", "-")
            result += "".join(filter(str.isascii, parts)) or "?"
    return result


def _is_raised(letters: str) -> bool:
    """Return True for a superscript."""
    return unicodedata.decomposition(letters or " ").startswith("<super>")


def _replaced(fault: UnicodeError) -> tuple[str, int]:
    """Return what an encoding writes for letters that it lacks, and the place where it goes on."""
    if not isinstance(fault, UnicodeEncodeError):
        raise fault
    return in_ascii(fault.object[fault.start : fault.end]), fault.end


codecs.register_error("sim.ascii", _replaced)


def accept_all_letters() -> None:
    """Let standard output and error write letters that their encoding lacks in ASCII, so that none ends a command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="sim.ascii")


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


def width() -> int:
    """Return the number of columns of the terminal, 100 if the output is none."""
    from rich.console import Console

    console = Console(file=sys.stdout)
    return console.width if console.is_terminal else _NO_TERMINAL


def print_rows(rows: list[dict[str, str]], keys: int = 0) -> None:
    """Print a table that is no wider than the terminal. The keys of the rows are the headings.

    Parameters
    ----------
    rows : list of dict
        Cells by heading. Headings are wrapped to the width of their cells.
    keys : int
        Number of first columns that are repeated if the table is printed in several
        parts, because it is wider than the terminal.
    """
    if not rows:
        return
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    columns, lines = dict[str, list[str]](), dict[str, list[str]]()
    sizes = dict[str, int]()
    for heading in rows[0]:
        cells = [_written(one_line(row[heading])) for row in rows]
        longest = max(_SHORTEST, *map(cell_len, cells))
        text = _written(plain(heading))
        wrapped = textwrap.wrap(text, longest, break_long_words=False)
        columns[heading], lines[heading] = cells, wrapped
        sizes[heading] = max(map(cell_len, [*wrapped, *cells])) + _GAP
    repeated, parts, room = [*sizes][:keys], list[list[str]](), 0
    for heading in [*sizes][keys:]:
        room -= sizes[heading]
        if room < 0 or not parts:
            parts.append([*repeated])
            room = width() + _GAP - sum(sizes[name] for name in repeated)
            room -= sizes[heading]
        parts[-1].append(heading)
    for number, part in enumerate(parts or [repeated]):
        table = Table(box=None, pad_edge=False, padding=(0, _GAP, 0, 0))
        for heading in part:
            title = Text("\n".join(lines[heading]))
            table.add_column(title, justify="right", no_wrap=True, vertical="bottom")
        for line in zip(*(columns[heading] for heading in part), strict=True):
            table.add_row(*map(Text, line))
        if number:
            say()
        Console(file=sys.stdout, width=_WIDE).print(table)


def _written(text: str) -> str:
    """Return a text as standard output writes it, whose letters decide how wide a column is."""
    encoding = sys.stdout.encoding or "utf-8"
    return text.encode(encoding, "sim.ascii").decode(encoding)


def print_table(rows: list[dict[str, str]], text: str, keys: int = 0) -> None:
    """Print a table, see ``print_rows``, and the text below it."""
    print_rows(rows, keys)
    say(text)


@contextlib.contextmanager
def while_read() -> Iterator[None]:
    """End the program with success if the reader of its output stops early."""
    try:
        yield
    except (OSError, SystemExit) as end:
        if not _is_unread(end) and not _is_unread(end.__context__):
            raise  # click and rich exit by themselves
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        sys.exit(0)


def _is_unread(fault: BaseException | None) -> bool:
    """Return True if the reader of the output is gone.

    Windows calls that an invalid argument, as much else, but then the text that waits cannot be written later either.
    """
    if isinstance(fault, OSError) and fault.errno == errno.EINVAL:
        try:
            sys.stdout.flush()
        except OSError:
            return True
    return isinstance(fault, BrokenPipeError)


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
            yield Shown(
                lambda n: progress.advance(task, n),
                lambda stage: progress.update(task, description=stage),
            )
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
            tell(
                f"{100 * finished / total:.0f} % of {total:,} {what}, {duration(left)} left"
            )

    def begin(stage: str) -> None:
        if stage and time.monotonic() - began > _PAUSE:
            tell(stage)

    return Shown(advance, begin)


def duration(seconds: float) -> str:
    """Return a time as text."""
    if seconds < 90.0:
        return f"{max(seconds, 1.0):.0f} s"
    return (
        f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
    )


def signals(*names: str) -> list[signal.Signals]:
    """Return those of the named signals that this system has: schedulers stop a run by signals that Windows lacks."""
    return [getattr(signal, name) for name in names if hasattr(signal, name)]
