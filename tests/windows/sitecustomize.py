"""The wall clock of Windows, which moves in steps of 1/64 s, while that of Wine moves in steps of 100 ns.

The Python under Wine imports this at its start. The clock of dask reads the time again and again until two readings in
a row are equal, so that no cluster would start there (``artefacts.py`` shows it).
"""

import sys
import time

_STEP = 15_625_000  # ns
_fine = time.time_ns


def _time_ns() -> int:
    """Return the time since the epoch [ns]."""
    return _fine() // _STEP * _STEP


def _time() -> float:
    """Return the time since the epoch [s]."""
    return _time_ns() / 1e9


for _function, _name in (
    ((_time, "time"), (_time_ns, "time_ns")) if sys.platform == "win32" else ()
):
    # so that it is pickled
    _function.__module__, _function.__name__, _function.__qualname__ = (
        "time",
        _name,
        _name,
    )
    setattr(time, _name, _function)
