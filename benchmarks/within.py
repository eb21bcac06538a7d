"""Cost of an accepted error: counted work of ``sim run --within "1 %"`` beside each scenario as it is written.

``python -m benchmarks.within`` searches the settings of all scenarios and writes ``docs/within_rows.md``. It takes
about six minutes of CPU time, and counted work is the same on each machine.
"""

import sys

import sim
from benchmarks.run import ROOT
from sim.study.within import Goal, NotReached, percent, searched
from sim.units.errors import BadInput
from sim.units.notation import engineering

PAGE = ROOT / "docs" / "within_rows.md"
#: Accepted error, and counted work that a run may take [s].
WITHIN, BUDGET = 0.01, 60.0
HEAD = """# What 1 % costs

*What does `--within "1 %"` choose for each scenario, and what does it cost beside the scenario as it is written?* The
command `python -m benchmarks.within` makes this page. Errors are bounds of the largest error of the quantities that
[Within](within.md) names by default, and work is counted as there. A scenario that is written with a larger error than
1 % needs more work; one that is written with a smaller error may need less.

| scenario | settings | work | error | work as written | error as written |
| --- | --- | --- | --- | --- | --- |
"""


def row(name: str) -> str:
    """Return the row of a scenario, or that of the reason why it is not reached."""
    try:
        result = searched(
            sim.load(ROOT / "scenarios" / f"{name}.toml"), Goal(WITHIN, budget=BUDGET)
        )
    except (NotReached, BadInput) as refused:
        return f"| {name} | {' '.join(str(refused).split())} | | | | |"
    best, written = result.best, result.search.as_written
    if best is None or result.search.lacks_finest:
        reason = result.reason or "not compared with the finest models"
        return f"| {name} | {reason} | | | | |"
    settings = [*best.labels] or ["as written"]
    if best.noise.any():
        settings.append(f"{best.members:,} members")
    numbers = [
        text
        for one in (best, written)
        for text in (engineering(one.work, "s"), percent(one.total))
    ]
    return f"| {' | '.join([name, ', '.join(settings), *numbers])} |"


def main() -> None:
    """Write the page, or print the rows of the scenarios that are named."""
    if names := sys.argv[1:]:
        print(*map(row, names), sep="\n")
        return
    paths = sorted((ROOT / "scenarios").glob("*.toml"))
    rows = [row(path.stem) for path in paths]
    PAGE.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
