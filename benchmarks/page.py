"""The pages of the benchmarks, ``docs/speed.md`` and ``docs/speed_rows.md``, from the rows that are stored."""

from typing import Any

from benchmarks.timing import Row

OPENING = """# Speed

The cost of a run follows from the error that you accept. These pictures show the largest error of each setting of two
questions over the CPU time of a run on one core. A ring marks the scenario as written, a star the combination that is
recommended for 1 %:

![Error over CPU time of a lens with a friction maximum](precision/friction_maximum.png)

![Error over CPU time of a PDMS lens with fluctuations](precision/pdms_lens.png)

[Work and precision](precision.md) has those of further questions and the command that makes them. `sim converge
SCENARIO.toml` finds the error of each setting of a scenario of your own, and [`sim run --within`](within.md) takes the
cheapest one.

Beside other programs for the same work:

"""
#: Works of the rows that open the page, each with the program beside it.
CHOSEN = (
    ("banded at 1 %, 512²: run to netCDF, 1024 members × 10⁴ steps", "rfft2"),
    ("modal, 512²: a step of a run", "only pairs"),
    ("counted, 10⁴ bonds", "numpy's"),
    ("tracked, 20 members of 10⁴ bonds, at 1000 steps", "numpy"),
    ("massless slider behind a spring", "LSODA"),
)
TITLE = """# Speed, row by row

This page compares the CPU time of `sim` with that of other programs. `make bench` measures every row below and writes
the page. To measure only some groups of rows:

    make bench ROWS="modal contact"

The programs are in `benchmarks/`. Most rows compare ours with the best simple program that a user of
numpy and scipy would write for the same work. Other rows compare ours with one step that every such program needs.

- **Times** are CPU times on one core. The first column names the work: one step of one member, one field, one set of
  radii, or one whole command. Commands use one process.
- **Ratios**: in each turn of a row all its programs run one after the other, and each turn gives a ratio. The result
  is the median over the turns, with the middle half of the ratios in brackets. Compare ratios, because absolute times
  depend on the machine and its load.
- **"10 times faster"**: the other program takes 10 times our time.
- **"1.1 times as long"**: ours takes 1.1 times the time of the other program.
- **Goals** for stress fields refer to the textbook program, which makes its noise by a Fourier transform. A leaner
  program, in the next row, draws only the numbers that it needs.
- **Bands**: the factor beside programs that compute all modes is the gain of the algorithm. The rows with the same
  bands show the gain of the code alone.
- **Errors**, ours first, are those of one quantity: third cumulant of ΔΓ (bands), friction (bonds), position over its
  largest value (sliders), radius (contacts). No error is given if both programs are exact to rounding.
- **Memory** that a program has freed stays with its process, for ours and the others alike. Otherwise the time for new
  memory from the operating system would dominate the comparison. Commands of `sim` run as they do for a user, without
  this setting.

"""
END = """
[All rows, and how they are measured](speed_rows.md). `make bench` measures them.
"""
HEADINGS = (
    "work",
    "beside",
    "goal",
    "result",
    "met",
    "CPU time, ours; theirs",
    "errors, ours; theirs",
)


def opening(results: dict[str, Any]) -> str:
    """The page with which a reader begins."""
    rows = rows_of(results)
    lines = [
        next(row for row in rows if row.ours.startswith(work) and beside in row.beside)
        for work, beside in CHOSEN
    ]
    return OPENING + _table(lines) + END


def text(results: dict[str, Any]) -> str:
    """The page of all rows."""
    machines = sorted(
        {f"{group['date']}, {group['machine']}" for group in results.values()}
    )
    measured = f"Measured: {'; '.join(machines)}.\n\n"
    return TITLE + measured + _table(rows_of(results))


def _table(rows: list[Row]) -> str:
    """A table of rows."""
    lines = [HEADINGS, ["---"] * len(HEADINGS), *map(cells, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def rows_of(results: dict[str, Any]) -> list[Row]:
    """All rows that are stored."""
    return [Row(**row) for group in results.values() for row in group["rows"]]


def cells(row: Row) -> tuple[str, ...]:
    """A line of the table."""
    goal = (
        ""
        if row.goal is None
        else f"{'≥' if row.kind == 'faster' else '≤'} {number(row.goal)} {unit(row)}".strip()
    )
    met = {None: "", True: "yes", False: "**no**"}[row.met]
    return (
        row.ours,
        row.beside,
        goal,
        result(row),
        met,
        "; ".join(map(seconds, row.seconds)),
        row.errors,
    )


def unit(row: Row) -> str:
    """The unit of a goal."""
    return {"faster": "times faster", "as long": "times as long"}.get(
        row.kind, row.kind
    )


def result(row: Row) -> str:
    """The result in words."""
    low, middle, high = row.result
    if row.kind == "faster" and middle < 1.0:
        low, middle, high, words = 1.0 / high, 1.0 / middle, 1.0 / low, "times slower"
    else:
        words = {"faster": "times faster", "as long": "times as long"}.get(
            row.kind, row.kind
        )
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
