"""Output on a terminal: texts from wherever, of which it takes nothing for a command, and tables."""

import io
import sys

import click


def one_line(text: str) -> str:
    r"""A text on one line, its control characters and marks of direction written out, so that none reaches a terminal.

    >>> print(one_line(f"{chr(27)}[31m{chr(0x202E)}3 mN"))
    \x1b[31m\u202e3 mN
    """
    return "".join(c if c.isprintable() else "?" if c.isspace() else repr(c)[1:-1] for c in text)


def plain(text: str) -> str:
    """A text of several lines, each as ``one_line`` writes it."""
    return "\n".join(map(one_line, text.split("\n")))


def say(text: str = "", err: bool = False) -> None:
    """Print a text, cleaned."""
    click.echo(plain(text), sys.stderr if err else sys.stdout)


def usage(fault: click.ClickException) -> str:
    """Words on a command that cannot be understood."""
    shown = io.StringIO()
    fault.show(shown)
    return shown.getvalue().rstrip("\n")


def replace_unknown() -> None:
    """Let letters that the terminal's encoding lacks be replaced instead of ending the command."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")


def print_rows(rows: list[dict[str, str]]) -> None:
    """Print a table, its headings the keys of the rows."""
    from rich.console import Console  # heavy: not for `sim check`
    from rich.table import Table

    shown = Table(box=None, header_style="bold", pad_edge=False)
    for heading in rows[0] if rows else ():
        shown.add_column(plain(heading), justify="right", no_wrap=True)
    for row in rows:
        shown.add_row(*map(plain, row.values()))
    console = Console(highlight=False, markup=False, emoji=False)
    wide = console.options.update(max_width=10_000)
    console.width = max(console.width, console.measure(shown, options=wide).maximum)  # no number is cut short
    console.print(shown)


def print_table(rows: list[dict[str, str]], text: str) -> None:
    """Print a table and the text below it."""
    print_rows(rows)
    say(text)
