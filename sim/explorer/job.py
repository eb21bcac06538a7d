"""Jobs of a page, each in a process of its own: an ensemble of the scenario's own models, and a fit."""

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import cloudpickle
import numpy as np
import xarray as xr

from sim.ensemble.execute import end_with, pickled
from sim.ensemble.plan import Plan, work
from sim.ensemble.simulate import run
from sim.explorer.drawing import listed
from sim.scenario.scenario import Scenario
from sim.units.errors import BadInput
from sim.units.notation import engineering
from sim.units.terminal import duration

#: Most points of a band that are drawn.
_DRAWN = 1000
#: Quantities that are drawn.
_NAMES = ("contact_area", "friction_force")
#: Forces of a motion in words.
_FORCES = {"spring_force": "spring force", "friction_force": "friction"}

#: Begins a job: the server alone decides about the end of it, also while its modules are imported.
_BEGIN = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN); from sim.explorer.job import main; main()"

Say = Callable[[dict[str, Any]], None]


def ensemble(
    scenes: list[Scenario], say: Say, describes: bool = False
) -> dict[str, Any]:
    """Run scenes that differ in their speed, and return what is drawn of them.

    ``say`` takes the share that is done, and the time that is left in words. If the result ``describes`` a single
    scene, it has the paragraph of methods.
    """
    whole, done = sum(work(Plan.of(scene)) for scene in scenes), 0
    shown = _clock(say)

    def progress(steps: int) -> None:
        nonlocal done
        done += steps
        shown(done, whole)

    runs = [run(scene, progress=progress) for scene in scenes]
    first, *others = [
        summary(scene, dataset) for scene, dataset in zip(scenes, runs, strict=True)
    ]
    if describes and not others:
        from sim.reports.methods import methods

        first["methods"] = str(methods(runs[0]))
    for other in others if first["along"] == "speed" else []:
        first["speed"] += other["speed"]
        for name, kinds in first["curves"].items():
            for kind in kinds:
                kinds[kind] += other["curves"][name][kind]
    return first


def _clock(say: Say) -> Callable[[int, int], None]:
    """Return a function that says the share of steps that are done, and the time that the others take."""
    began = time.monotonic()

    def progress(done: int, whole: int) -> None:
        left = (time.monotonic() - began) * (whole - done) / done
        say({"done": done / whole, "left": duration(left)})

    return progress


def planned(
    scenario: Scenario, table: Any, free: list[str], say: Say, sims: int = 100
) -> dict[str, Any]:
    """Plan a measurement at the points of a table: return what it can tell in words, and where to measure next.

    The ``sims`` simulated data sets are fewer than those of the command, for the sake of who waits at the page.
    """
    from sim.explorer.figures import rings
    from sim.study.likelihood import problem_of
    from sim.study.plan import plan

    result = plan(scenario, table, free, sims=sims, progress=_clock(say))
    further = [point.conditions for point in result.best]
    is_measured = all(np.isfinite(curve.values).all() for curve in table.curves)
    problem = problem_of(scenario, [table], [], {})
    marks = rings(problem, further) if is_measured else []
    return {"numbers": {}, "text": repr(result), "remarks": [], "marks": marks}


def fitted(scenario: Scenario, table: Any, free: list[str], say: Say) -> dict[str, Any]:
    """Fit keys of a scenario to a table; return values with 95 % intervals in SI, in words, and the band of curves."""
    from sim.explorer.figures import band
    from sim.study.fit import fit

    say({"done": 0.0})
    result = fit(scenario, [table], free)
    numbers = {
        item.free.key: {
            "value": item.value,
            "low": item.interval.low,
            "high": item.interval.high,
            "text": item.texts,
        }
        for item in result.numbers
    }
    return {
        "numbers": numbers,
        "text": repr(result),
        "remarks": result.remarks,
        "marks": band(
            result.problem, result.best.x, result.best.covariance, scenario.seed
        ),
    }


def summary(scene: Scenario, dataset: xr.Dataset) -> dict[str, Any]:
    """Return what is shown of a run [SI]: means over members with their 95 % intervals.

    Of a motion they are, in words, the means of each member's largest force and smallest area. If the speed changes,
    they are area and friction at each time; else those of the second half of the run, a single point.
    """
    force = "spring_force" if "spring_force" in dataset else "friction_force"
    names = {*_NAMES, force, "jkr_radius", "speed"}
    (data,) = xr.broadcast(dataset[sorted(names)])
    apart = float(dataset["t"][1] - dataset["t"][0]) if dataset.sizes["t"] > 1 else 0.0
    data = data if "member" in data.dims else data.expand_dims("member")
    data["area_ratio"] = data["contact_area"] / (
        np.pi * data["jkr_radius"].where(data["jkr_radius"] > 0.0) ** 2
    )
    data, speed = data.drop_vars(["jkr_radius", "speed"]), dataset["speed"]
    members = data.sizes["member"]
    if scene.drive.solves_motion or scene.contact.changes:
        words = [
            f"{name} {engineering(float(mean), unit)} ± {engineering(float(half), unit)}"
            for name, values, unit in (
                (f"largest {_FORCES[force]}", abs(data[force]).max("t"), "N"),
                ("smallest area", data["contact_area"].min("t"), "m^2"),
            )
            for mean, half in [_interval(values)]
        ]
        # heavy: for motions alone
        from sim.plots.curves import coarse_slips
        from sim.read.tables import unresolved

        words.append(f"at times {engineering(apart, 's')} apart")
        words += filter(None, [coarse_slips(dataset), unresolved(dataset)])
        return {"along": "t", "members": members, "words": ", ".join(words)}
    if float(np.ptp(speed.to_numpy())) == 0.0:
        data = data.isel(t=slice(data.sizes["t"] // 2, None)).mean("t").expand_dims("t")
        speed = speed.isel(t=slice(-1, None))
    every = slice(None, None, -(-data.sizes["t"] // _DRAWN))
    data, speed = data.isel(t=every), speed.isel(t=every)
    mean, half = _interval(data)
    sides = {"mean": mean, "low": mean - half, "high": mean + half}
    curves = {
        str(name): {kind: listed(values[name]) for kind, values in sides.items()}
        for name in mean
    }
    return {
        "along": "speed",
        "speed": listed(np.abs(speed)),
        "curves": curves,
        "members": members,
    }


def _interval(data: Any) -> tuple[Any, Any]:
    """Return means over members, and half the width of their 95 % intervals; 0 for a single member."""
    from scipy.stats import t as student

    mean, members = data.mean("member"), data.sizes["member"]
    if members == 1:
        return mean, xr.zeros_like(mean)
    quantile = float(student.ppf(0.975, members - 1))
    return mean, data.std("member", ddof=1) * quantile / members**0.5


def command(task: Callable[[Say], dict[str, Any]]) -> tuple[list[str], bytes]:
    """Return the command of a process that runs a task, and what it reads.

    A task takes a function for its messages, and returns its result. The process writes each message as a line of JSON;
    the last has ``result`` or ``fault``. It does not outlive the present process.
    """
    task_bytes = pickled(task)
    return [sys.executable, "-c", _BEGIN, str(os.getpid())], b"%d\n%s" % (
        len(task_bytes),
        task_bytes,
    )


def main() -> None:
    """Run the task that standard input has, for the process whose number is the argument.

    Nothing waits for the end of standard input, because Windows locks a pipe for as long as a thread reads of it, and
    libraries that look at standard input when they are imported would wait, too.
    """
    source, messages = sys.stdin.buffer, os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # nothing else that is printed is taken for a message
    task = cloudpickle.loads(source.read(int(source.readline())))

    def say(message: dict[str, Any]) -> None:
        try:
            messages.write(f"{json.dumps(message)}\n")
            messages.flush()
        except OSError:  # the server is gone, which is another error on each system
            os._exit(1)

    threading.Thread(target=end_with, args=(int(sys.argv[1]),), daemon=True).start()
    try:
        say({"result": task(say)})
    except (BadInput, RuntimeError, ValueError, MemoryError) as fault:
        say({"fault": str(fault) or type(fault).__name__})
