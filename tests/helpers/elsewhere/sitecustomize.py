"""Another operating system, emulated on Linux for every process that has this folder on its path.

The package of this project cannot see the names that only some systems have; the libraries still can, as they have
their own ways on each system. Files follow the rules of Windows: no file that a process holds open is replaced or
removed, no folder is opened, and only what is open for writing is written to the disk by ``os.fsync``.
"""

import builtins
import os
import shutil
import signal
import stat
import sys
import tempfile
import types
from pathlib import Path

HIDDEN_MODULES = {"fcntl", "resource", "pwd", "grp", "termios"}
HIDDEN_NAMES = {
    os: ("fork", "sched_getaffinity", "O_NOFOLLOW", "O_NONBLOCK", "getuid", "geteuid", "mkfifo"),
    signal: ("SIGHUP", "SIGUSR1", "SIGXCPU", "pthread_sigmask"),
}


def _package(frame):
    """Return the name of the package whose code runs in a frame."""
    return frame.f_globals.get("__name__", "").split(".")[0]


def _asks(depth):
    """True if the package asks, and not a library."""
    return _package(sys._getframe(depth + 1)) == "sim"


def _is_of_a_lock():
    """True if filelock asks, which removes files of its own while it holds them open, but on Linux alone."""
    frame = sys._getframe(2)
    while frame and _package(frame) not in ("sim", "filelock"):
        frame = frame.f_back
    return bool(frame) and _package(frame) == "filelock"


def _hide(module, names):
    """Hide names of a module from the package; the module itself and libraries use them."""

    class Hidden(types.ModuleType):
        def __getattribute__(self, name):
            if name in names and _asks(1):
                raise AttributeError(f"module {module.__name__!r} has no attribute {name!r}")
            return super().__getattribute__(name)

    module.__class__ = Hidden


def _import(name, *arguments, real=builtins.__import__, **keywords):
    if name in HIDDEN_MODULES and _asks(1):
        raise ModuleNotFoundError(f"No module named {name!r}")
    return real(name, *arguments, **keywords)


def _held(path):
    """True if a process has a file open."""
    try:
        wanted = os.stat(path)
    except OSError:
        return False
    for descriptor in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            about = os.stat(descriptor)
        except OSError:
            continue
        if (about.st_dev, about.st_ino) == (wanted.st_dev, wanted.st_ino) and stat.S_ISREG(about.st_mode):
            return True
    return False


def _refusing(real, places):
    """A function of os that refuses paths, at some places of its arguments, which a process has open."""

    def refuse(*arguments, **keywords):
        for path in arguments[:places] if not _is_of_a_lock() else ():
            if keywords.get("dir_fd") is None and isinstance(path, str | os.PathLike) and _held(path):
                raise PermissionError(13, "The file is used by another process", str(path))
        return real(*arguments, **keywords)

    return refuse


def _open(path, flags, *arguments, real=os.open, **keywords):
    if isinstance(path, str | os.PathLike) and os.path.isdir(path):
        raise PermissionError(13, "Permission denied", str(path))
    return real(path, flags, *arguments, **keywords)


def _fsync(descriptor, real=os.fsync):
    number = descriptor if isinstance(descriptor, int) else descriptor.fileno()
    lines = Path(f"/proc/self/fdinfo/{number}").read_text(encoding="utf-8").splitlines()
    flags = next(line.split()[1] for line in lines
                 if line.startswith("flags"))  # fmt: skip
    if int(flags, 8) & 3 == os.O_RDONLY:
        raise OSError(9, "Bad file descriptor")
    real(descriptor)


for _module, _names in HIDDEN_NAMES.items():
    _hide(_module, _names)
builtins.__import__ = _import
os.replace, os.rename = _refusing(os.replace, 2), _refusing(os.rename, 2)
os.unlink, os.remove = _refusing(os.unlink, 1), _refusing(os.remove, 1)
os.open, os.fsync = _open, _fsync
shutil._use_fd_functions = False
tempfile.TemporaryFile = tempfile.NamedTemporaryFile  # as on Windows: no file without a name
