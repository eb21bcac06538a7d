"""Two artefacts of Wine without the package: a library that cannot be loaded keeps its mappings; a clock is too fine.

``wine.py python FOLDER artefacts.py < /dev/null | cat`` prints them.
"""

import ctypes
import importlib.util
from pathlib import Path


def mappings():
    """Load a plugin of netCDF, which lacks its libraries, until the reason for the refusal changes from 126.

    On Windows the reason is always 126, a module was not found. Under Wine the process has 65,530 mappings then.
    """
    kernel32 = ctypes.WinDLL("kernel32", use_last_error=True)  # type: ignore[attr-defined, unused-ignore]
    plugin = (
        Path(str(importlib.util.find_spec("netCDF4").origin)).parent
        / "plugins"
        / "__nch5blosc.dll"
    )
    for load in range(20_000):
        assert not kernel32.LoadLibraryW(str(plugin)), (
            "the plugin has the libraries that it needs"
        )
        reason = ctypes.get_last_error()  # type: ignore[attr-defined, unused-ignore]
        if reason != 126:
            print(f"load {load}: error {reason}", flush=True)
            break


def clock():
    """Read the wall clock a hundred times, in less than a millisecond. On Windows there are one or two values."""
    kernel32 = ctypes.WinDLL("kernel32")  # type: ignore[attr-defined, unused-ignore]
    readings = [ctypes.c_uint64() for _ in range(100)]
    for reading in readings:
        kernel32.GetSystemTimeAsFileTime(ctypes.byref(reading))
    print(
        f"the wall clock has {len({reading.value for reading in readings})} values in 100 readings",
        flush=True,
    )


if __name__ == "__main__":
    clock()
    mappings()
