"""The clock of pieces of work: CPU time, or wall time where CPU time moves in long steps."""

import itertools
import time

from sim.numerics.stopwatch import stopwatch


def test_cpu_time_is_used_unless_it_moves_in_long_steps(monkeypatch):
    ticks = itertools.count(0.0, 1e-6)
    monkeypatch.setattr(time, "process_time", fine := ticks.__next__)
    assert stopwatch() is time.process_time
    monkeypatch.setattr(time, "process_time", lambda: 0.016 * (fine() // 0.016))
    assert stopwatch() is time.perf_counter
    ticks = iter([1.0, 1.0, 1.016, 1.016])  # the step comes while the clock is watched
    monkeypatch.setattr(time, "process_time", lambda: next(ticks))
    assert stopwatch() is time.perf_counter
