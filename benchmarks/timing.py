"""Timing of programs that take turns, and the rows that come of it."""

import contextlib
import io
import math
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
import psutil

from sim.cli import cli

#: CPU seconds that one measurement takes at least.
_LEAST = 0.05
#: Variables of the environment that a user has not set: of the allocator, and those that keep Python from its caches.
_UNUSUAL = ("MALLOC_", "PYTHONDONTWRITE")
#: Runs a command and prints the CPU time [s] and the peak memory [kB] of it alone: a process begins with the peak of
#: the one that started it, so that a small one stands between.
_LAUNCHER = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss)
"""


@dataclass(frozen=True)
class Row:
    """One row of the table.

    ``kind`` says what ``result`` is: how many times "faster" ours is than what stands beside it, how many times "as
    long" it takes, or a unit. The result is the median over the turns between the ends of their middle half. ``goal``
    is a lower bound of what is "faster", else an upper one. ``seconds`` are median CPU times of ours and of the other.
    """

    ours: str
    beside: str
    kind: str
    goal: float | None
    result: list[float]
    seconds: list[float]
    errors: str = ""

    @property
    def met(self) -> bool | None:
        """True if the median reaches the goal; None without a goal."""
        if self.goal is None:
            return None
        return (
            self.result[1] >= self.goal
            if self.kind == "faster"
            else self.result[1] <= self.goal
        )

    @property
    def stored(self) -> dict[str, Any]:
        """The row for a file, its numbers to four digits."""
        return asdict(self) | {
            "result": _short(self.result),
            "seconds": _short(self.seconds),
        }


def _short(numbers: list[float]) -> list[float]:
    return [float(f"{number:.4g}") for number in numbers]


class Beside(NamedTuple):
    """Another program for the same work.

    ``share`` is what one call does, in units of the work that the row counts; ``goal`` is how many times faster ours
    is to be or, of a ``bound`` or a rival of its kind, how many times as long it may take; ``errors`` are those of ours
    and of this one.
    """

    name: str
    program: Callable[[], object]
    share: float = 1.0
    goal: float | None = None
    bound: bool = False
    errors: str = ""


def self_timed(program: Callable[[], float], times: int = 1) -> float:
    """Return the CPU seconds of some calls of a program that measures itself."""
    return sum(program() for _ in range(times))


def spent(program: Callable[[], object], times: int = 1) -> float:
    """CPU seconds of some calls of a program, with those of the processes that it starts and ends."""
    began = time.process_time() + sum(os.times()[2:4])
    for _ in range(times):
        program()
    return time.process_time() + sum(os.times()[2:4]) - began


@dataclass(frozen=True)
class Bench:
    """Thoroughness of timing; ``quick`` calls each program once, at small sizes: its numbers mean nothing."""

    quick: bool = False

    def of(self, full: Any, small: Any) -> Any:
        """A size: the real one, or a small one that only shows that a program works."""
        return small if self.quick else full

    def compare(
        self,
        ours: str,
        program: Callable,
        *others: Beside,
        share: float = 1.0,
        turns: int = 15,
        clock: Callable = spent,
    ) -> list[Row]:
        """Rows of a program beside others; in each turn all are timed, after two calls of each that do not count."""
        programs = [Beside(ours, program, share), *others]
        repeats = [
            1 if self.quick else self._repeats(other.program, clock)
            for other in programs
        ]
        pairs = list(zip(programs, repeats, strict=True))
        times = [
            [clock(p.program, n) / n / p.share for p, n in pairs]
            for _ in range(self.of(turns, 1))
        ]
        mine, *theirs = np.transpose(times)
        rows = []
        for other, times in zip(others, theirs, strict=True):
            kind, ratios = (
                ("as long", mine / times) if other.bound else ("faster", times / mine)
            )
            medians = [float(np.median(mine)), float(np.median(times))]
            rows.append(
                Row(
                    ours,
                    other.name,
                    kind,
                    other.goal,
                    middle(ratios),
                    medians,
                    other.errors,
                )
            )
        return rows

    def _repeats(self, program: Callable, clock: Callable) -> int:
        """Calls that take long enough to be timed; the first call may compile."""
        clock(program)
        return max(1, math.ceil(_LEAST / clock(program)))

    def command(self, *arguments: str, **environment: str) -> tuple[float, float]:
        """CPU time [s] and peak memory [MB] of ``sim`` with some arguments, as a process of its own."""
        if not self.quick:
            return child("-m", "sim", *arguments, **environment)
        with (
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(io.StringIO()),
        ):
            seconds = spent(lambda: cli(list(arguments), standalone_mode=False))
        return seconds, _peak()

    def python(self, program: str) -> float:
        """CPU time [s] of a process that runs a program of Python."""
        return spent(lambda: exec(program)) if self.quick else child("-c", program)[0]


def _peak() -> float:
    """Return the peak memory of this process [MB]."""
    if sys.platform == "win32":
        return float(psutil.Process().memory_info().peak_wset) / 2**20
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def absolute(
    ours: str, values: list[float], unit: str, goal: float | None, beside: str = "–"
) -> Row:
    """A row of measured values that stand beside nothing."""
    return Row(ours, beside, unit, goal, middle(values), [])


def child(*arguments: str, **environment: str) -> tuple[float, float]:
    """CPU time [s] and peak memory [MB] of a Python process."""
    command = [sys.executable, "-S", "-c", _LAUNCHER, sys.executable, *arguments]
    usual = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(_UNUSUAL)
    }
    printed = subprocess.run(
        command, env=usual | environment, check=True, capture_output=True, text=True
    ).stdout
    seconds, kilobytes = map(float, printed.split())
    return seconds, kilobytes / 1024.0


def middle(values: Any) -> list[float]:
    """Median of some values, between the ends of their middle half."""
    return [float(value) for value in np.quantile(values, [0.25, 0.5, 0.75])]
