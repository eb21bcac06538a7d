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
    """Print a table, its headings the keys of the rows, as wide as its cells are."""
    headings = [plain(heading).split("\n") for heading in (rows[0] if rows else ())]
    deep = max(map(len, headings), default=0)
    table = [list(line) for line in zip(*([""] * (deep - len(lines)) + lines for lines in headings), strict=True)]
    table += [[one_line(cell) for cell in row.values()] for row in rows]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for place, row in enumerate(table):
        line = "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
        click.echo(click.style(line, bold=True) if place < deep else line, sys.stdout)


def print_table(rows: list[dict[str, str]], text: str) -> None:
    """Print a table and the text below it."""
    print_rows(rows)
    say(text)
