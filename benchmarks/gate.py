"""A gate between two trees: ``python -m benchmarks.gate REFERENCE [--scenes N]``.

The gate compares the working tree with a commit, over all scenarios of the project and over random scenes of the
tests. Both trees run the scenes of the working tree. A rebuilt stepper rounds otherwise, so numbers may differ:

- A quantity without random parts may differ by 1e-12 of its largest absolute value.
- A slider behind a spring or under a force is solved to a tolerance, so it may differ by ten times this tolerance.
  Fast slips amplify small differences. The reference therefore runs with ten times its tolerance as well: a quantity
  may differ by twice as much as it changes then, because both trees may be off by this change.
- Members of an ensemble are compared one by one first, because most changes keep their random draws. Otherwise the
  means of their quantities over time may differ by four standard errors of the difference.

A scene is printed if a difference exceeds 1e-9, so that the changelog can name it, or if it is not allowed. Scenes in
which a value exists in one tree only, such as that of a slip event, are counted as other events. Scenes with other
events or with larger differences make the exit code 1.
"""

import argparse
import functools
import io
import json
import math
import os
import pickle
import subprocess
import sys
import tarfile
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy import stats

from benchmarks import scenes

ROOT = Path(__file__).resolve().parent.parent
#: Program of the process of a tree: runs scenes, and writes the dataset of each, or why there is none.
RUN = """
import faulthandler, json, pathlib, pickle, sys
import sim
assert pathlib.Path(sim.__file__).is_relative_to(sys.argv[1]), sim.__file__
for name, (scene, changes) in json.load(sys.stdin).items():
    faulthandler.dump_traceback_later(1200, exit=True)
    try:
        result = sim.run(sim.load(scene, changes))
    except Exception as refusal:
        result = f"{type(refusal).__name__}: {refusal}"
    pathlib.Path(name).write_bytes(pickle.dumps(result))
"""
#: Members of each ensemble: enough for standard errors, few enough for bonds that are followed one by one.
MEMBERS = 8
#: Largest difference by rounding, and the least that is printed, both of the largest value of a quantity.
ROUNDING, NAMED = 1e-12, 1e-9
#: Differences that are allowed, in tolerances of a slider and in standard errors.
LOOSER, ERRORS = 10.0, 4.0
#: Dimensions within a run; all others are those of a sweep.
MEMBER_DIMENSIONS = {"member", "map_member"}
RUN_DIMENSIONS = {"t", "phase", "slip", "map_time", "x", "y"} | MEMBER_DIMENSIONS
#: Classes of a scene in the summary; the last two fail.
REFUSED, EQUAL, ROUNDED = "refused by both trees", "equal bit for bit", "within 1e-12"
WITHIN, EVENTS, OUTSIDE = "within tolerance", "other events", "outside"
#: Parts whose models are printed; a number of the solver, which says nothing about the contact.
PARTS, SUBSTEPS = ("drive", "bonds", "shear", "contact"), "substeps"

#: Dataset of a scene, or why a tree refuses it.
Result = xr.Dataset | str


class Difference(NamedTuple):
    """The difference of a quantity.

    The size refers to the largest value of the quantity. It is inf if a value exists in one tree only. ``fault`` says
    why the difference is not allowed, and is empty if it is.
    """

    quantity: str
    size: float
    fault: str = ""

    def __str__(self) -> str:
        size = f"{self.size:.1e}" if math.isfinite(self.size) else "in one tree only"
        return f"{self.quantity} {size}{self.fault and f' ({self.fault})'}"


def check_out(commit: str, folder: Path) -> Path:
    """Write the package of a commit into a folder; return the folder."""
    command = ["git", "archive", "--format=tar", commit, "sim"]
    archive = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE)
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as files:
        files.extractall(folder, filter="data")
    return folder


def run_tree(tree: Path, folder: Path, chosen: dict[str, Any]) -> dict[str, Result]:
    """Return the datasets of scenes, run with the package of a tree and written into a folder."""
    folder.mkdir()
    start = time.monotonic()
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", RUN, str(tree)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(tree)},
        input=json.dumps(chosen),
        text=True,
    )
    if ended.returncode:
        last = next(name for name in chosen if not (folder / name).exists())
        raise SystemExit(f"the process of {tree} ended in the scene {last}")
    print(f"{len(chosen)} scenes of {tree} ran in {time.monotonic() - start:.0f} s")
    return {name: pickle.loads((folder / name).read_bytes()) for name in chosen}


def loosened(chosen: dict[str, Any], datasets: dict[str, Result]) -> dict[str, Any]:
    """Return the scenes with a slider that is solved to a tolerance, with ten times this tolerance."""
    result = {}
    for name, (scene, changes) in chosen.items():
        dataset = datasets[name]
        if isinstance(dataset, xr.Dataset) and "drive_tolerance" in dataset:
            looser = LOOSER * float(dataset["drive_tolerance"].max())
            result[name] = scene, changes | {"drive.tolerance": looser}
    return result


class Comparison(NamedTuple):
    """Datasets of a scene: of both trees, and of the reference with a looser tolerance."""

    old: xr.Dataset
    new: xr.Dataset
    loose: xr.Dataset

    def differences(self) -> list[Difference]:
        """Return the quantities that are not equal bit for bit."""
        result = []
        for name, before in self.old.variables.items():
            if before.dtype.kind not in "biuf" or name == SUBSTEPS:
                continue
            after = self.new.variables.get(name)
            if after is None or after.dims != before.dims:
                result.append(Difference(name, math.inf, "has other dimensions"))
            elif not np.array_equal(before.values, after.values, equal_nan=True):
                result.append(self.judge(name))
        return result

    def judge(self, name: str) -> Difference:
        """Return the difference of a quantity, judged by the rule of its kind."""
        distance = self.distance(name, self.new)
        size, no_slider = float(distance.max()), xr.DataArray(0.0)
        own = self.old.get("drive_tolerance", no_slider)
        tolerance = max(ROUNDING, LOOSER * float(own.max()))
        if size <= tolerance or (distance <= self.uncertainty(name)).all():
            return Difference(name, size)
        before, after = self.old.variables[name], self.new.variables[name]
        if "peak_" in name and name.endswith(("_time", "_speed", "_area")):
            return Difference(name, size)  # a plateau has no place of its largest value
        if not MEMBER_DIMENSIONS & {*before.dims}:
            return Difference(name, size, OUTSIDE if math.isfinite(size) else EVENTS)
        errors = max(
            errors_between(before, after),
            errors_between(before.notnull(), after.notnull()),
        )
        far = f"means differ by {errors:.1f} standard errors"
        return Difference(name, size, far if errors > ERRORS else "")

    def uncertainty(self, name: str) -> xr.Variable:
        """Return the distance of a quantity that the tolerance of the slider explains, at each point of a sweep.

        Each of both trees may be off by as much as the reference changes with its tolerance. A value at an event is
        as uncertain as the courses over time from which it is read.
        """
        quantity = self.old.variables[name]
        is_course = "t" in quantity.dims
        alike = [] if is_course else self.courses(quantity.attrs.get("units"))
        alike.append(name)
        changes = [over_run(self.distance(one, self.loose)) for one in alike]
        return 2.0 * functools.reduce(np.fmax, changes)

    def courses(self, units: str | None) -> list[str]:
        """Return the quantities over time with given units."""
        return [
            name
            for name, variable in self.old.data_vars.items()
            if variable.attrs.get("units") == units and "t" in variable.dims
        ]

    def distance(self, name: str, other: xr.Dataset) -> xr.Variable:
        """Return the distance of each value of a quantity in another dataset; inf if only one of both has the value."""
        before = self.old.variables[name].astype(float)
        after = other.variables[name].astype(float)
        distance = (abs(after - before) / self.scale(name)).where(after != before, 0.0)
        is_aligned = before.isnull() == after.isnull()
        return distance.where(is_aligned, math.inf).fillna(0.0)

    def scale(self, name: str) -> xr.Variable:
        """Return the value that a distance of a quantity refers to, at each point of a sweep.

        It is the largest absolute value of the quantity over the run. Exceptions:

        - for a time, the duration of the run
        - for an energy, the largest energy, because a small one may be the difference of large ones
        - for a number without a unit, at least 1, because an error is the difference of such numbers
        """
        units = self.old.variables[name].attrs.get("units")
        if units == "s":
            return self.old["clock_duration"].variable
        alike = [name, *(self.courses(units) if units == "J" else ())]
        values = [self.old.variables[one] for one in alike]
        largest = [over_run(abs(one.where(np.isfinite(one)))) for one in values]
        return functools.reduce(np.fmax, largest, xr.Variable((), float(units == "1")))


def over_run(values: xr.Variable) -> xr.Variable:
    """Return the largest value of a run, at each point of a sweep."""
    return values.max([name for name in values.dims if name in RUN_DIMENSIONS])


def errors_between(before: xr.Variable, after: xr.Variable) -> float:
    """Return the difference of the means over members in standard errors, the largest over a sweep.

    The time is averaged first, because each record would be a test of its own. Welch's test counts the members: its
    probability is given as the number of standard errors that has it in a normal distribution.
    """
    members = [name for name in before.dims if name in MEMBER_DIMENSIONS]
    times = [name for name in before.dims if name in RUN_DIMENSIONS - MEMBER_DIMENSIONS]
    samples = [
        values.astype(float).mean(times).transpose(..., *members).values
        for values in (before, after)
    ]
    with warnings.catch_warnings(action="ignore"):  # members that are equal
        chance = stats.ttest_ind(*samples, axis=-1, equal_var=False, nan_policy="omit")
    errors = stats.norm.isf(0.5 * np.ma.filled(chance.pvalue, 1.0))
    return float(np.nanmax([0.0, *np.ravel(errors)]))


def compare(old: Result, new: Result, loose: Result) -> list[Difference]:
    """Return the quantities that are not equal bit for bit; ``loose`` is of the reference with a looser tolerance."""
    if isinstance(old, str) or isinstance(new, str):
        is_alike = isinstance(old, str) == isinstance(new, str)
        refusal = f"refused: {old if isinstance(old, str) else new}"
        return [] if is_alike else [Difference("scene", math.inf, refusal)]
    datasets = old, new, old if isinstance(loose, str) else loose
    if not old.sizes == new.sizes == datasets[2].sizes:
        datasets = xr.align(*datasets, join="outer")
    return Comparison(*datasets).differences()


def verdict_of(old: Result, found: list[Difference]) -> str:
    """Return the class of a scene with the given differences."""
    faults = {one.fault for one in found}
    if faults - {""}:
        return EVENTS if EVENTS in faults else OUTSIDE
    if isinstance(old, str):
        return REFUSED
    if not found:
        return EQUAL
    return ROUNDED if max(one.size for one in found) <= ROUNDING else WITHIN


def report(name: str, old: Result, found: list[Difference]) -> str:
    """Return a line about a scene: its models, what is not allowed, then the largest differences."""
    models = "refused"
    if isinstance(old, xr.Dataset):
        resolved = json.loads(old.attrs["scenario_resolved"])
        models = ", ".join(resolved[part]["model"] for part in PARTS)
    ordered = sorted(found, key=lambda one: (not one.fault, -one.size))
    shown = ", ".join(map(str, ordered[:4]))
    return (
        f"{name} ({models}): {verdict_of(old, found)}: {len(found)} quantities: {shown}"
    )


def main() -> int:
    """Print each scene with a named difference, and a summary; return 1 if any is outside."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("reference", metavar="REFERENCE", help="a commit")
    parser.add_argument("--scenes", metavar="N", type=int, default=300)
    options = parser.parse_args()
    changes = {"ensemble.members": MEMBERS}
    gathered = scenes.gathered(ROOT, options.scenes)
    chosen = {name: (scene, changes) for name, scene in gathered.items()}
    counts, sizes = Counter[str](), dict[str, list[float]]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name).resolve()
        reference = check_out(options.reference, folder / "tree")
        old = run_tree(reference, folder / "old", chosen)
        loose = run_tree(reference, folder / "loose", loosened(chosen, old))
        new = run_tree(ROOT, folder / "new", chosen)
    for scene, result in old.items():
        found = compare(result, new[scene], loose.get(scene, result))
        counts[verdict_of(result, found)] += 1
        named = [one for one in found if one.size > NAMED or one.fault]
        for one in named:
            sizes.setdefault(one.quantity, []).append(one.size)
        if named:
            print(report(scene, result, named))
    print(f"{len(chosen)} scenes compared")
    for verdict in (REFUSED, EQUAL, ROUNDED, WITHIN, EVENTS, OUTSIDE):
        print(f"{counts[verdict]:5d} {verdict}")
    for quantity, each in sorted(sizes.items(), key=lambda item: -len(item[1])):
        print(f"{quantity}: {len(each)} scenes, up to {max(each):.1e}")
    return int(counts[EVENTS] + counts[OUTSIDE] > 0)


if __name__ == "__main__":
    sys.exit(main())
