"""Outputs that are whole and replace nothing unasked, and file errors with their reason."""

import contextlib
import errno
import fcntl
import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from sim.units.errors import BadInput

#: What a file system without locks answers.
_NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS}
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
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


class DiskFull(StoreTrouble):
    """No room: of the disk, of a quota, or below a limit of the size of files."""


class OutputExists(FileExistsError):
    """The output, or an unfinished run of it, is there already and was not to be replaced."""

    exit_code = 73


def claim(
    path: Path, replace: bool, inputs: Iterable[Path] = (), beside: tuple[str, ...] = (),
    guard: Callable[[Path], None] = lambda path: None,
) -> None:  # fmt: skip
    """Refuse an output that would destroy what is there or cannot be written, before anything is computed.

    Parameters
    ----------
    path : Path
        The file to be. What is no plain file, such as /dev/stdout or a pipe, is written to and not replaced.
    replace : bool
        Whether an older file may be replaced; a scenario and ``inputs`` never are.
    inputs : iterable of Path
        Files that the command reads.
    beside : tuple of str
        What else is written, as ends of its name.
    guard : callable
        Other arguments: refuses older files that are never to be replaced.

    Raises
    ------
    BadInput
        If the name or what has it is not to be written to.
    OutputExists
        If there is a file that is not to be replaced.
    StoreTrouble
        If the folder or the file system refuses such a file.
    """
    try:
        str(path).encode()
        if path.is_dir():
            raise BadInput([f"{path} is a folder; name a file"])
        names = [path, *(path.with_name(path.name + end) for end in beside)]
        there = _is_there(path)
        for folder in (folder for folder in path.absolute().parents if folder.exists()):
            for name in {*path.parts, *(one.name for one in names)}:
                _is_there(folder / name)  # which refuses names that are too long
            if not path.is_relative_to("/dev"):
                _refuse_closed(path, folder)
            break
    except UnicodeEncodeError:
        shown = str(path).encode(errors="replace").decode()
        raise BadInput([f"{shown}: the name is not UTF-8 text; name another file"]) from None
    except StoreTrouble:
        raise
    except OSError as trouble:
        raise StoreTrouble(f"{path}: {trouble.strerror}") from trouble
    if any(one.exists() and each.exists() and one.samefile(each) for one in names for each in inputs):
        raise BadInput([f"{path}: the command reads what it would write; name another file"])
    if there and path.is_file() and not path.is_relative_to("/dev"):
        if not replace:
            raise OutputExists(f"{path} exists; replace it with --force or name another file")
        if path.suffix == ".toml":
            raise BadInput([f"{path} is a scenario by its name, which is never replaced; name another file"])
        guard(path)


def _refuse_closed(path: Path, folder: Path) -> None:
    """Refuse a folder in which no file can be made: its rights say nothing of /proc, or of a disk without inodes."""
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as trouble:
        said = f"{path}: no file can be made in {folder} ({trouble.strerror}); name a file in another folder"
        raise StoreTrouble(said) from trouble


def _is_there(path: Path) -> bool:
    """Whether a path leads to something."""
    try:
        os.stat(path)
    except FileNotFoundError:
        return False
    return True


@contextlib.contextmanager
def output(path: Path) -> Iterator[Path]:
    """A context with the name under which to write a file for its user, which is whole when it takes its place."""
    with explained(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists() and (not path.is_file() or path.is_relative_to("/dev")):  # such as a pipe, or /dev/stdout
            yield path
        else:
            with whole(path.resolve()) as aside:
                yield aside


@contextlib.contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A context with a name beside a file for its new content, which at the end is synced and takes its place."""
    aside = path.with_name(f".{os.urandom(8).hex()}.tmp")
    try:
        yield aside
        sync(aside)
        os.replace(aside, path)
    except BaseException:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
        raise
    with contextlib.suppress(OSError):  # the file is there, and not every file system syncs folders
        sync(path.parent)


def write_whole(path: Path, *pieces: bytes | memoryview) -> None:
    """Write a file whole or not at all."""
    with whole(path) as aside, aside.open("wb") as file:
        file.writelines(pieces)


def read_whole(path: Path) -> bytes:
    """The bytes of a plain file; a link is not followed."""
    with open(os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK), "rb") as file:
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise OSError(errno.EINVAL, "not a plain file", str(path))
        return file.read()


def sync(path: Path) -> None:
    """Flush a file to disk, or a folder, so that a rename in it survives a crash."""
    descriptor = os.open(path, os.O_RDONLY)
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
        number = trouble.errno if isinstance(trouble, OSError) else None
        reason = trouble.strerror if isinstance(trouble, OSError) and number else str(trouble)
        with contextlib.suppress(OSError):
            usage = shutil.disk_usage(folder)
            if usage.total > 0 and usage.free < 2**20:
                number, reason = errno.ENOSPC, os.strerror(errno.ENOSPC)
        raise (DiskFull if number in _FULL else StoreTrouble)(f"{folder}: {reason}") from trouble


@contextlib.contextmanager
def by_hdf5(path: Path) -> Iterator[None]:
    """A context in which HDF5 writes a file: of its trouble it gives no reason, as one more write does."""
    try:
        yield
    except _WRITE_TROUBLE:
        with contextlib.suppress(FileNotFoundError), path.open("ab") as file:
            file.write(bytes(2**20))
        raise


@contextlib.contextmanager
def locked(path: Path, prepare: Callable[[], None]) -> Iterator[bool]:
    """A context under a lock file; gives whether it was free.

    ``prepare`` makes the folder of the file. A file that its holder removed at its end is no lock: who locks it then
    begins again. Where the file system has no locks, a lease beside the file stands in.
    """
    lock = None
    while lock is None:
        prepare()
        try:
            lock = _lock(path)
        except BlockingIOError:
            yield False
            return
        except OSError as trouble:
            if trouble.errno not in _NO_LOCKS:
                raise StoreTrouble(f"{path}: {trouble.strerror}") from trouble
            with leased(path.with_name("lease")) as free:
                yield free
            return
    try:
        yield True
    finally:
        os.close(lock)


def _lock(path: Path) -> int | None:
    """The descriptor of a file under a lock; None if it was removed before it was locked."""
    with contextlib.suppress(FileNotFoundError):
        lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
        with contextlib.ExitStack() as undone:
            undone.callback(os.close, lock)
            if not stat.S_ISREG(os.fstat(lock).st_mode):
                raise OSError(errno.EINVAL, "not a plain file", str(path))
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(lock), os.stat(path, follow_symlinks=False)):
                undone.pop_all()
                return lock
    return None


@contextlib.contextmanager
def leased(path: Path, beat: float = 10.0) -> Iterator[bool]:
    """A context under a lease, a file whose time of change is renewed every ``beat`` [s]; gives whether it was free.

    A lease that was not renewed for six beats is that of a run that was killed, and is taken over.
    """
    if not _took(path, 6.0 * beat):
        yield False
        return
    ended = threading.Event()

    def renew() -> None:
        while not ended.wait(beat):
            with contextlib.suppress(OSError):  # five beats more come before the lease is taken for a dead one
                os.utime(path)

    threading.Thread(target=renew, daemon=True).start()
    try:
        yield True
    finally:
        ended.set()
        path.unlink(missing_ok=True)


def _took(path: Path, most: float) -> bool:
    """Make a lease, where there is none or one older than ``most`` [s] by the clock of its file system."""
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666))
        return True
    except FileExistsError:
        pass
    aside = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        os.close(os.open(aside, os.O_WRONLY | os.O_CREAT | os.O_NOFOLLOW, 0o666))
        os.utime(aside)
        now = os.stat(aside).st_mtime
        if now - os.stat(path).st_mtime <= most:
            return False
        os.replace(path, aside)
        if now - os.stat(aside).st_mtime <= most:  # another took it over meanwhile
            os.link(aside, path)
            return False
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666))
        return True
    except (FileNotFoundError, FileExistsError):
        return False
    finally:
        aside.unlink(missing_ok=True)
