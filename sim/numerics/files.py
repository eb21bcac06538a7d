"""Atomic writing of files, and file errors with their reason."""

import contextlib
import errno
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

# HDF5 reports trouble with its file as a RuntimeError
_WRITE_TROUBLE = (OSError, RuntimeError)


class _Lock:
    """A reentrant lock of the process; pickled it is the lock of the process that reads it."""

    def __init__(self) -> None:
        lock = threading.RLock()
        self.acquire, self.release = lock.acquire, lock.release

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *trouble: object) -> None:
        self.release()

    def __reduce__(self) -> str:
        return "HDF5"


#: Held around every use of netCDF and HDF5, which crash when two threads call them at once.
HDF5 = _Lock()


class StoreTrouble(OSError):
    """Disk or file error; the message names the folder and the reason."""

    exit_code = 74


def write_whole(path: Path, content: memoryview | bytes) -> None:
    """Write a file whole or not at all: beside its place, to disk, then renamed."""
    beside = path.with_name(f".{path.name}.tmp")
    try:
        with open(beside, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Flush a folder to disk, so that a rename in it survives a crash."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def explained(folder: Path) -> Iterator[None]:
    """Turn file errors into ``StoreTrouble`` with the reason, such as a full disk, which HDF5 does not give."""
    try:
        yield
    except StoreTrouble:
        raise
    except _WRITE_TROUBLE as trouble:
        reason = trouble.strerror if isinstance(trouble, OSError) and trouble.errno else str(trouble)
        with contextlib.suppress(OSError):
            usage = shutil.disk_usage(folder)
            if usage.total > 0 and usage.free < 2**20:
                reason = os.strerror(errno.ENOSPC)
        raise StoreTrouble(f"{folder}: {reason}") from trouble
