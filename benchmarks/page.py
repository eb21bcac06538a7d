"""The page of the benchmarks, ``docs/speed.md``, from the rows that are stored."""

from typing import Any

from benchmarks.timing import Row

TITLE = """# Speed

`make bench` measures every row below and writes this page; `make bench ROWS="modal contact"` measures
only some groups of rows. The programs are in [benchmarks/](../benchmarks): ours beside the best simple one that a
user of numpy and scipy would write for the same work, or beside a step that no program can do without.

- **Times** are CPU times on one core. In each turn of a row all its programs run one after the other, and a ratio is
  that of one turn. The result is the median over the turns, in brackets the ends of their middle half. Absolute times
  differ between machines, and with what else they do; compare ratios. A time is that of one step of one member, of
  one field, of one set of radii or of one whole command, as the first column says; commands use one process.
- **"10 times faster"**: the other program takes 10 times our time. **"1.1 times as long"**: ours takes 1.1 times the
  other's. Ours is the slower one where a row reads "times slower", or more than 1 "times as long".
- **Goals** for fields are meant beside the textbook's program, which makes its noise by a transform; a leaner one,
  which draws no number that it does not need, stands in the next row without a goal.
- **Errors**, ours first: of the third cumulant of ΔΓ for bands, of the friction for bonds, of the position (over the
  largest) for sliders, of the radius for contacts. No error is given if both programs are exact to rounding.
- Memory that a program has freed stays with its process, for ours and the others alike: else the system's time for
  new pages decides between them. `sim` as a command runs as it does for a user.

"""
END = """
`sim converge SCENARIO.toml` shows what the models cost and err on a scene of your own.
"""
HEADINGS = ("work", "beside", "goal", "result", "met", "CPU time, ours; theirs", "errors, ours; theirs")


def text(results: dict[str, Any]) -> str:
    """The page."""
    machines = sorted({f"{group['date']}, {group['machine']}" for group in results.values()})
    lines = [TITLE, "Measured: ", "; ".join(machines), ".\n\n"]
    lines += [f"| {' | '.join(cells)} |\n" for cells in (HEADINGS, ["---"] * len(HEADINGS))]
    lines += [f"| {' | '.join(cells(row))} |\n" for row in rows_of(results)]
    return "".join([*lines, END])


def rows_of(results: dict[str, Any]) -> list[Row]:
    """All rows that are stored."""
    return [Row(**row) for group in results.values() for row in group["rows"]]


def cells(row: Row) -> tuple[str, ...]:
    """A line of the table."""
    goal = "" if row.goal is None else f"{'≥' if row.kind == 'faster' else '≤'} {number(row.goal)} {unit(row)}".strip()
    met = {None: "", True: "yes", False: "**no**"}[row.met]
    return row.ours, row.beside, goal, result(row), met, "; ".join(map(seconds, row.seconds)), row.errors


def unit(row: Row) -> str:
    """The unit of a goal."""
    return {"faster": "times faster", "as long": "times as long"}.get(row.kind, row.kind)


def result(row: Row) -> str:
    """The result in words."""
    low, middle, high = row.result
    if row.kind == "faster" and middle < 1.0:
        low, middle, high, words = 1.0 / high, 1.0 / middle, 1.0 / low, "times slower"
    else:
        words = {"faster": "times faster", "as long": "times as long"}.get(row.kind, row.kind)
    spread = "" if low == middle == high else f"({number(low)} to {number(high)})"
    return " ".join(filter(None, (number(middle), words, spread)))


def number(value: float) -> str:
    """A number to three digits."""
    return f"{float(f'{value:.3g}'):,.0f}" if abs(value) >= 100.0 else f"{value:.3g}"


def seconds(value: float) -> str:
    """A time with its unit."""
    for scale, name in ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")):
        if value >= scale:
            return f"{number(value / scale)} {name}"
    return f"{value:.1e} s"
