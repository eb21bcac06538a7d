"""An artefact of Wine without the package: a library that cannot be loaded keeps its mappings; a process has 65,530.

``wine.py python FOLDER artefacts.py < /dev/null | cat`` prints the number of the load at which the reason changes from
126, a module was not found, to another one. On Windows it never changes.
"""

import ctypes
import importlib.util
from pathlib import Path


def main():
    """Load a plugin of netCDF, which lacks its libraries, until the reason for the refusal changes."""
    kernel32 = ctypes.WinDLL("kernel32", use_last_error=True)  # type: ignore[attr-defined, unused-ignore]
    plugin = Path(str(importlib.util.find_spec("netCDF4").origin)).parent / "plugins" / "__nch5blosc.dll"
    for load in range(20_000):
        assert not kernel32.LoadLibraryW(str(plugin)), "the plugin has the libraries that it needs"
        reason = ctypes.get_last_error()  # type: ignore[attr-defined, unused-ignore]
        if reason != 126:
            print(f"load {load}: error {reason}", flush=True)
            break


if __name__ == "__main__":
    main()
