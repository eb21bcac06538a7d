"""Clock by which pieces of work are timed."""

import time
from collections.abc import Callable

#: Time for which the clock of the process is watched, and its largest step, if it is used [s].
_WATCHED, _FINE = 1e-3, 1e-4


def stopwatch() -> Callable[[], float]:
    """Return the clock of this process's CPU time, or the wall clock if CPU time moves in long steps.

    CPU time does not count other processes, but on Windows it moves in steps of some 16 ms, in which a short piece of
    work takes no time at all.
    """
    before, end = time.process_time(), time.perf_counter() + _WATCHED
    while True:
        moved = time.process_time() - before
        if moved > 0.0 or time.perf_counter() > end:
            return time.process_time if 0.0 < moved < _FINE else time.perf_counter
