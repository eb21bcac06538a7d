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

HIDDEN_MODULES = {"fcntl", "resource", "pwd", "grp", "termios"}
HIDDEN_NAMES = {
    os: ("fork", "sched_getaffinity", "O_NOFOLLOW", "O_NONBLOCK", "getuid", "geteuid", "mkfifo"),
    signal: ("SIGHUP", "SIGUSR1", "SIGXCPU", "pthread_sigmask"),
}


def _asks(depth):
    """True if the package asks, and not a library."""
    return sys._getframe(depth + 1).f_globals.get("__name__", "").split(".")[0] == "sim"


def _hide(module, names):
    """Move names of a module out of the sight of the package."""
    values = {name: vars(module).pop(name) for name in names if hasattr(module, name)}

    def found(name):
        if name in values and not _asks(1):
            return values[name]
        raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")

    module.__getattr__ = found


def _import(name, *arguments, real=builtins.__import__, **keywords):
    if name in HIDDEN_MODULES and _asks(1):
        raise ModuleNotFoundError(f"No module named {name!r}")
    return real(name, *arguments, **keywords)


for _module, _names in HIDDEN_NAMES.items():
    _hide(_module, _names)
builtins.__import__ = _import
