"""Go through random scenes in two processes, and print each fault and how often the corners were reached.

``PYTHONPATH=tests:. python -m helpers.hunt corner 0 500`` goes through 500 scenes at corners. With ``random`` it goes
through those of ``random_scenes``, and with ``finer`` it compares their runs at several clock steps, too, which takes
ten times as long. A last number sets the processes. A scene whose run is foretold to take longer than ``PATIENCE`` is
counted and left out. One that takes longer is stopped, which counts as a fault. Times are those of the processor.
"""

import multiprocessing
import sys
import time
import traceback
from collections import Counter
from multiprocessing.connection import wait

import psutil

from sim.ensemble.pace import pace
from sim.ensemble.plan import Plan
from sim.ensemble.preview import forecast

#: Time of one scene with all its checks [s].
PATIENCE = 120.0


def faults_of(kind, seed):
    """Return a text for each fault of a scene, and the corners that its run reached, None if it is refused."""
    import test_total

    draw = test_total.corner_scene if kind == "corner" else test_total.random_scene
    scenario = test_total.admitted(draw(seed))
    if scenario is not None and foretold(scenario) > PATIENCE:
        return [], Counter({"foretold to take long": 1})
    try:
        faults, corners = test_total.faults_in(seed, kind == "finer", draw)
    except Exception as fault:
        return [short(fault)], Counter()
    return [short(fault) for fault in faults], corners


def foretold(scenario):
    """Return the time that ``sim check`` says that a run takes [s]."""
    plan = Plan.of(scenario)
    return forecast(plan, 1, pace(plan)).cpu


def short(fault):
    """Return a line for a fault: the rule that it broke, and its message."""
    rule = [
        frame.name
        for frame in traceback.extract_tb(fault.__traceback__)
        if frame.name.startswith("check_")
    ]
    return f"{rule[-1] if rule else type(fault).__name__}: {' '.join(str(fault).split())[:160]}"


def work(kind, pipe):
    """Answer the seeds that come through a pipe."""
    import warnings

    warnings.simplefilter("error")
    while (seed := pipe.recv()) is not None:
        start = time.process_time()
        pipe.send((*faults_of(kind, seed), time.process_time() - start))


class Worker:
    """A process that checks scenes, the seed that it is at, and the time when it began."""

    def __init__(self, kind):
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=work, args=(kind, other), daemon=True)
        self.process.start()
        self.seed, self.since = None, 0.0

    @property
    def spent(self):
        """Time of the processor since the process began [s]."""
        return (
            sum(psutil.Process(self.process.pid).cpu_times()[:2])
            if self.process.is_alive()
            else 0.0
        )

    def give(self, seed):
        self.seed, self.since = seed, self.spent
        self.pipe.send(seed)


def go_through(kind, seeds, processes=2, patience=PATIENCE, tell=print):
    """Check the scenes of seeds; return the faults by their seeds, and the counts of corners."""
    faults, counts, left = {}, Counter(), list(seeds)[::-1]
    workers = [Worker(kind) for _ in range(processes)]
    for worker in workers:
        worker.give(left.pop() if left else None)
    while busy := [worker for worker in workers if worker.seed is not None]:
        ready = wait([worker.pipe for worker in busy], timeout=1.0)
        for worker in busy:
            late = worker.spent - worker.since > patience
            if worker.pipe not in ready and not late:
                continue
            seed, ended = worker.seed, False
            try:
                texts, corners, seconds = (
                    worker.pipe.recv()
                    if worker.pipe in ready
                    else ([], Counter(), patience)
                )
            except EOFError:
                texts, corners, seconds, ended = (
                    ["the process died"],
                    Counter(),
                    0.0,
                    True,
                )
            if worker.pipe not in ready:
                texts, ended = [f"takes longer than {patience:.0f} s"], True
            if ended:
                worker.process.kill()
                worker.__init__(kind)
            counts["refused" if corners is None else "ran"] += 1
            counts["seconds"] += round(seconds, 2)
            counts += corners or Counter()
            if texts:
                faults[seed] = texts
                tell(
                    f"{kind} {seed} ({seconds:.1f} s)", *texts, sep="\n    ", flush=True
                )
            worker.give(left.pop() if left else None)
    return faults, counts


if __name__ == "__main__":
    kind, first, last = sys.argv[1], int(sys.argv[2]), int(sys.argv[3])
    faults, counts = go_through(
        kind, range(first, last), int(sys.argv[4]) if len(sys.argv) > 4 else 2
    )
    print(f"{len(faults)} of {last - first} scenes have faults: {sorted(faults)}")
    print(*(f"{name}: {count}" for name, count in sorted(counts.items())), sep="\n")
