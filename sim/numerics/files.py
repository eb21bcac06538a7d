"""Files that are written whole and replace nothing unasked, and file errors with their reason."""

import contextlib
import errno
import os
import shutil
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

from sim.units.errors import BadInput

_FULL = {
    getattr(errno, name)
    for name in ("ENOSPC", "EDQUOT", "EFBIG")
    if hasattr(errno, name)
}


class _Lock:
    """A reentrant lock of the process that holds xarray's too; pickled it is the lock of the process that reads it."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._entered: list[contextlib.ExitStack] = []

    def acquire(self, blocking: bool = True) -> bool:
        with contextlib.ExitStack() as entered:
            if not self._lock.acquire(blocking):
                return False
            entered.callback(self._lock.release)
            # xarray's lock is not reentrant, and without xarray there is no other reader
            module = (
                None if self._entered else sys.modules.get("xarray.backends.netCDF4_")
            )
            if lock := getattr(module, "NETCDF4_PYTHON_LOCK", None):
                if not lock.acquire(blocking):
                    return False
                entered.callback(lock.release)
            self._entered.append(entered.pop_all())
        return True

    def release(self, *trouble: object) -> None:
        self._entered.pop().close()

    __enter__, __exit__ = acquire, release

    def __reduce__(self) -> str:
        return "HDF5"


#: Held around every use of netCDF and HDF5, which crash when two threads call them at once.
HDF5 = _Lock()


class StoreTrouble(OSError):
    """Disk or file error; the message names the folder and the reason."""

    exit_code = 74


class DiskFull(StoreTrouble):
    """No room: of the disk, of a quota, or below a limit of the size of files."""


class OutputExists(FileExistsError):
    """The output, or an unfinished run of it, is there already and was not to be replaced."""

    exit_code = 73


def claim(path: Path, replace: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse an output that would destroy an existing file or cannot be written, before anything is computed.

    Parameters
    ----------
    path : Path
        The output. A pipe or a device, such as /dev/stdout, is written to and not replaced.
    replace : bool
        True if an older file may be replaced; a scenario and ``inputs`` never are.
    inputs : iterable of Path
        Files that the command reads.

    Raises
    ------
    BadInput
        If the name is unusable: a folder, an input, a scenario.
    OutputExists
        If there is a file that is not to be replaced.
    StoreTrouble
        If the folder or the file system refuses such a file.
    """
    device = path.is_relative_to("/dev")
    try:
        str(path).encode()
        if path.is_dir():
            raise BadInput([f"{path} is a folder; name a file"])
        # which HDF5 takes for the sign between folders
        if os.sep == "/" and "\\" in str(path.absolute()):
            raise BadInput(
                [
                    f"{path}: datasets cannot be read in a path with a backslash; name another file"
                ]
            )
        folder = next(folder for folder in path.absolute().parents if folder.exists())
        for name in (*path.parts, f"{path.name}.parts"):
            with contextlib.suppress(FileNotFoundError):
                os.stat(folder / name)  # which refuses names that are too long
        if not device:
            # the rights of a folder do not say that this works
            tempfile.TemporaryFile(dir=folder).close()
    except UnicodeEncodeError:
        shown = str(path).encode(errors="replace").decode()
        raise BadInput(
            [f"{shown}: the name is not UTF-8 text; name another file"]
        ) from None
    except OSError as trouble:
        raise StoreTrouble(
            f"{path}: {trouble.strerror}; name a file in another folder"
        ) from trouble
    if any(path.exists() and each.exists() and path.samefile(each) for each in inputs):
        raise BadInput([f"{path}: the command reads this file, too; name another file"])
    if path.is_file() and not device:
        if not replace:
            raise OutputExists(
                f"{path} exists; replace it with --force or name another file"
            )
        if path.suffix == ".toml":
            raise BadInput(
                [
                    f"{path} has a scenario name, which is never replaced; name another file"
                ]
            )


@contextlib.contextmanager
def output(path: Path) -> Iterator[Path]:
    """Give the name under which to write a file for its user; at the end the whole file takes its place."""
    with explained(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        # such as a pipe, or /dev/stdout
        if path.exists() and (not path.is_file() or path.is_relative_to("/dev")):
            yield path
        else:
            with whole(path.resolve()) as aside:
                yield aside


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a name beside a file for its new content, which at the end is synced and takes its place."""
    aside = path.with_name(f".{os.urandom(8).hex()}.tmp")
    try:
        yield aside
        with aside.open("r+b") as file:
            os.fsync(file.fileno())
        move(aside, path)
    except BaseException:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
        raise


def move(path: Path, target: Path) -> None:
    """Rename a file, in place of an older one."""
    try:
        os.replace(path, target)
    except PermissionError as trouble:  # Windows keeps a file that a program holds open
        raise StoreTrouble(
            f"{target} cannot be replaced: close the program in which it is open"
        ) from trouble


@contextlib.contextmanager
def explained(folder: Path) -> Iterator[None]:
    """Turn file errors into ``StoreTrouble`` with the reason, such as a full disk, which HDF5 does not give."""
    try:
        yield
    except StoreTrouble:
        raise
    except (OSError, RuntimeError) as trouble:
        # HDF5 reports trouble with its file as a RuntimeError
        number = trouble.errno if isinstance(trouble, OSError) else None
        reason = (
            trouble.strerror
            if isinstance(trouble, OSError) and number
            else str(trouble)
        )
        with contextlib.suppress(OSError):
            usage = shutil.disk_usage(folder)
            if usage.total > 0 and usage.free < 2**20:
                number, reason = errno.ENOSPC, os.strerror(errno.ENOSPC)
        raise (DiskFull if number in _FULL else StoreTrouble)(
            f"{folder}: {reason}"
        ) from trouble
