"""Output in a notebook: tables, and the progress of a run."""

import html
import sys
import time
from collections.abc import Iterable, Mapping

from sim.units.terminal import Shown, duration, one_line

#: Seconds between two pictures of a bar.
_PAUSE = 0.2


def is_notebook() -> bool:
    """Return True if a kernel shows what is displayed."""
    package = sys.modules.get("IPython")
    return package is not None and hasattr(package.get_ipython(), "kernel")


def bar(total: int, what: str) -> Shown:
    """Display a bar of the fraction of a total that is done, and return how to move it."""
    from IPython.display import display

    finished, began, drawn = 0, time.monotonic(), 0.0

    def picture(name: str) -> dict[str, str]:
        share = f"{100 * finished / total:.0f} % of {total:,} {name}"
        if 0 < finished < total:
            left = (time.monotonic() - began) * (total - finished) / finished
            share += f", {duration(left)} left"
        text = html.escape(share)
        shown = f'<progress max="{total}" value="{finished}" aria-label="{text}">'
        return {"text/plain": share, "text/html": f"{shown}</progress> {text}"}

    handle = display(picture(what), raw=True, display_id=True)

    def advance(done: int) -> None:
        nonlocal finished, drawn
        finished, now = finished + done, time.monotonic()
        if now - drawn > _PAUSE or finished >= total:
            drawn = now
            handle.update(picture(what), raw=True)

    return Shown(advance)


def table(rows: Iterable[Mapping[str, str]], headed: bool = True) -> str:
    """Return rows as an HTML table, with their keys as headings.

    >>> print(table([{"key": "load", "value": "<4 mN"}], headed=False))
    <table><tr><td>load</td><td>&lt;4 mN</td></tr></table>
    """
    rows = list(rows)
    lines = [_row("th", row) for row in rows[:1] if headed]
    lines += [_row("td", row.values()) for row in rows]
    return f"<table>{''.join(lines)}</table>"


def _row(tag: str, cells: Iterable[str]) -> str:
    texts = (html.escape(one_line(cell)) for cell in cells)
    return f"<tr>{''.join(f'<{tag}>{text}</{tag}>' for text in texts)}</tr>"
