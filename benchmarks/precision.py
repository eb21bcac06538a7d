"""Work–precision pictures: error over CPU time of the settings that a question of the gallery admits.

``python -m benchmarks.precision [NAME ...]`` finds the errors of all questions or some as ``sim converge`` does,
measures the CPU time of a run at each setting, draws ``docs/precision/NAME.png``, and writes ``docs/precision.md``. The
numbers are kept in ``benchmarks/precision.json``. With ``--write`` it only draws and writes. A question whose models do
not fit into the budget keeps the reason in place of numbers.
"""

import json
import sys
import time
from typing import Any

import xarray as xr
from matplotlib.figure import Figure

import sim
from benchmarks.run import ROOT
from sim.ensemble.simulate import run
from sim.plots.style import save
from sim.scenario.scenario import Scenario
from sim.study.converge import figure, report
from sim.study.within import Comparison, Goal, NotReached, searched
from sim.units.errors import BadInput

NUMBERS = ROOT / "benchmarks" / "precision.json"
PAGE, FOLDER = ROOT / "docs" / "precision.md", ROOT / "docs" / "precision"
#: Accepted error, and counted work of a search [s].
WITHIN, BUDGET = 0.01, 30.0
#: Runs of which the fastest counts.
_RUNS = 2
#: Counted work of a run that is measured with all members [s].
_LONG = 1.0
TITLE = """# Work and precision

Each picture belongs to a question of the [gallery](gallery/README.md). It shows the error of each setting over the CPU
time of a run with all members, on one core. The error is the largest one of contact area, contact radius, friction
force, bond fraction and times of events, as [State an error](within.md) defines it. A ring marks the scenario as
written, a star the combination that is recommended for 1 %. Exact settings stand at the bottom. A long run is measured
with a part of its members.

The command `python -m benchmarks.precision` measures all of them, and `python -m benchmarks.precision pdms_lens` one.

"""


def names() -> list[str]:
    """The scenarios of the gallery."""
    return sorted(json.loads((ROOT / "docs/gallery/numbers.json").read_text("utf-8")))


def seconds(scenario: Scenario, work: float) -> float:
    """CPU time of a run [s], the least of some; if its counted work is long, of a part of the members."""
    members, times = scenario.ensemble.members, []
    part = max(min(members, 8), round(members * min(1.0, _LONG / work)))
    scenario = scenario.with_values({"ensemble.members": part}, built=False)
    for _ in range(_RUNS):
        before = time.process_time()
        run(scenario)
        times.append(time.process_time() - before)
    return min(times) * members / part


def measured(scenario: Scenario) -> dict[str, Any]:
    """The errors and times of a scene, as they are kept."""
    result = searched(scenario, Goal(WITHIN, (), BUDGET), Comparison)
    search, dataset = result.search, report(result)
    settings = [row for group in search.groups for row in group]
    works = dataset["work"].to_numpy().tolist()
    dataset["work"].values[:] = [
        seconds(search._scene_of(row), work)
        for row, work in zip(settings, works, strict=True)
    ]
    if (best := result.best) is not None:
        dataset.attrs["recommended_work"] = seconds(search.scene_of(best), best.work)
    return dataset.to_dict()


def drawn(dataset: xr.Dataset) -> Figure:
    """The picture of a question."""
    picture = figure(dataset)
    (panel,) = picture.axes
    panel.set_xlabel("CPU time of the run (s)")
    return picture


def text(numbers: dict[str, Any]) -> str:
    """The page."""
    lines = [TITLE]
    for name, one in numbers.items():
        lines.append(f"## {name}\n\n")
        if "reason" in one:
            lines.append(f"Not measured: {one['reason']}.\n\n")
            continue
        advice = one["attrs"]["recommendation"].partition("\nWrite:")[0]
        lines.append(f"![Error over CPU time: {name}](precision/{name}.png)\n\n")
        lines.append(advice.replace("\n", " ") + "\n\n")
    return "".join(lines).rstrip("\n") + "\n"


def main() -> None:
    """Measure question by question, keep each, draw it, and write the page."""
    numbers = json.loads(NUMBERS.read_text("utf-8")) if NUMBERS.exists() else {}
    FOLDER.mkdir(exist_ok=True)
    for name in [] if sys.argv[1:] == ["--write"] else sys.argv[1:] or names():
        path = ROOT / "scenarios" / f"{name}.toml"
        if not path.exists():
            continue  # a question about another scenario's run
        try:
            numbers[name] = measured(sim.load(path))
        except (NotReached, BadInput) as fault:
            numbers[name] = {"reason": str(fault)}
        kept = json.dumps(dict(sorted(numbers.items())), ensure_ascii=False, indent=1)
        NUMBERS.write_text(kept + "\n", encoding="utf-8")
    numbers = dict(sorted(numbers.items()))
    PAGE.write_text(text(numbers), encoding="utf-8")
    for name, one in numbers.items():
        if "reason" not in one:
            save(drawn(xr.Dataset.from_dict(one)), FOLDER / f"{name}.png")


if __name__ == "__main__":
    main()
