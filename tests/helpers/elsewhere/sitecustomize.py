"""Names that macOS or Windows lack are hidden on Linux, in every process that has this folder on its path.

The package of this project cannot see these names. The libraries still can, as they have their own ways on each system.

All else is as on Linux and is not seen here: files that are open elsewhere, paths and their letters, line ends, pipes,
consoles, how processes start, clocks, and the last bits of numbers. ``make windows`` shows these in a Windows Python.
Nothing shows them for macOS.
"""

import builtins
import os
import signal
import sys
import types

HIDDEN_MODULES = {"fcntl", "resource", "pwd", "grp", "termios"}
HIDDEN_NAMES = {
    os: (
        "fork",
        "sched_getaffinity",
        "O_NOFOLLOW",
        "O_NONBLOCK",
        "getuid",
        "geteuid",
        "mkfifo",
    ),
    signal: ("SIGHUP", "SIGUSR1", "SIGXCPU", "pthread_sigmask"),
}


def _package(frame):
    """Return the name of the package whose code runs in a frame."""
    return frame.f_globals.get("__name__", "").split(".")[0]


def _asks(depth):
    """True if the package asks, and not a library."""
    return _package(sys._getframe(depth + 1)) == "sim"


def _hide(module, names):
    """Hide names of a module from the package; the module itself and libraries use them."""

    class Hidden(types.ModuleType):
        def __getattribute__(self, name):
            if name in names and _asks(1):
                raise AttributeError(
                    f"module {module.__name__!r} has no attribute {name!r}"
                )
            return super().__getattribute__(name)

    module.__class__ = Hidden


def _import(name, *arguments, real=builtins.__import__, **keywords):
    if name in HIDDEN_MODULES and _asks(1):
        raise ModuleNotFoundError(f"No module named {name!r}")
    return real(name, *arguments, **keywords)


for _module, _names in HIDDEN_NAMES.items():
    _hide(_module, _names)
builtins.__import__ = _import
