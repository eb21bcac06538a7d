"""netCDF files as HDF5 keeps them, opened for reading; a file that is none is refused with one reason."""

import contextlib
import ctypes
import functools
import json
import os
import stat
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import netCDF4

from sim.numerics import files
from sim.numerics.files import HDF5
from sim.units.errors import BadInput

if TYPE_CHECKING:
    import xarray

#: Reason for refusing a file that cannot be read.
BROKEN = "is not a netCDF file, or is truncated or damaged"
#: Cache of HDF5 for each variable [byte]; its default of 64 MiB holds every variable of a usual run whole.
CHUNK_CACHE = 2**20
#: Encoding of the names of files for the C library. On Windows it is the system's code page, which lacks some letters.
ENCODING = "mbcs" if os.name == "nt" else sys.getfilesystemencoding()

#: Number of an object of HDF5; those that stand for all files, and for the kind of files.
_ID, _ALL, _FILES = ctypes.c_int64, 0x1F, 0x1
#: Functions of HDF5 with the types of their arguments; each returns a size, or a number below 0.
_FUNCTIONS: dict[str, tuple[Any, ...]] = {
    "H5Fget_obj_count": (_ID, ctypes.c_uint),
    "H5Fget_obj_ids": (_ID, ctypes.c_uint, ctypes.c_size_t, ctypes.c_void_p),
    "H5Fget_name": (_ID, ctypes.c_char_p, ctypes.c_size_t),
    "H5Fget_file_image": (_ID, ctypes.c_void_p, ctypes.c_size_t),
}


class Refused(ValueError):
    """A file that is not read; the message gives the reason, not its name."""


class Damaged(RuntimeError):
    """A variable whose bytes do not match their checksum, or cannot be unpacked."""

    exit_code = 2


class File(netCDF4.Dataset):
    """A netCDF file whose name may have every letter of the system's code page."""

    def __init__(
        self, path: str | os.PathLike[str], mode: Any = "r", **how: Any
    ) -> None:
        # because a relative path may look like an address in the network
        whole = os.path.abspath(path)
        try:
            super().__init__(whole, mode, encoding=ENCODING, **how)
        except BaseException:
            if self.isopen():  # it was opened, and what it holds cannot be read
                self.close()
            raise

    def filepath(self, encoding: str | None = None) -> str:
        return str(super().filepath(encoding or ENCODING))


def claim(path: Path, replace: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse a netCDF file that cannot be written, before anything is computed; parameters as of ``files.claim``.

    Raises
    ------
    BadInput
        Also if the path has a letter that the C library cannot encode.
    """
    files.claim(path, replace, inputs)
    if reason := _unnamable(path):
        raise BadInput([f"{path}: {reason}; name a file in another folder"])


def _unnamable(path: str | os.PathLike[str]) -> str:
    """Return the reason for which the C library cannot be told a path; "" if there is none."""
    if sys.getfilesystemencoding() == ENCODING:
        return ""
    try:
        os.path.abspath(path).encode(ENCODING)
    except UnicodeEncodeError as fault:
        letters = fault.object[fault.start : fault.end]
        return f"datasets cannot have {letters} in their path, which the code page of this system lacks"
    return ""


def opened(path: str | os.PathLike[str]) -> netCDF4.Dataset:
    """Open a netCDF file for reading.

    Raises
    ------
    OSError
        If there is no such file.
    Refused
        If it is no plain file, no netCDF file, cut short or damaged.
    """
    # opening a pipe would wait for its writer
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise Refused("is no plain file")
    if reason := _unnamable(path):
        raise Refused(reason)
    with HDF5, readable():
        cache = netCDF4.get_chunk_cache()
        netCDF4.set_chunk_cache(CHUNK_CACHE)
        try:
            return File(path)
        finally:
            netCDF4.set_chunk_cache(*cache)


@contextlib.contextmanager
def readable() -> Iterator[None]:
    """Turn every error of the libraries about a damaged file into ``Refused``."""
    try:
        yield
    except (Refused, Damaged):
        raise
    except (
        OSError,
        RuntimeError,
        ValueError,
        ArithmeticError,
        AttributeError,
        LookupError,
        TypeError,
    ):
        raise Refused(BROKEN) from None


@functools.cache
def _hdf5() -> ctypes.CDLL | None:
    """Return the HDF5 library that netCDF4 uses, None if it is not found; netCDF4 itself does not give bytes of a file.

    Its own datasets in memory do not serve: they lose the order of variables, and hold the time of their making.
    """
    # where Windows has the libraries of a wheel
    beside = Path(netCDF4.__file__).parent.with_name("netCDF4.libs")
    for path in (
        str(sys.modules["netCDF4._netCDF4"].__file__),
        *map(str, sorted(beside.glob("hdf5*.dll"))),
    ):
        with contextlib.suppress(OSError, AttributeError):
            library = ctypes.CDLL(path)
            for name, arguments in _FUNCTIONS.items():
                function = getattr(library, name)
                function.argtypes, function.restype = arguments, ctypes.c_ssize_t
            return library
    return None


def hdf5_gives_bytes() -> bool:
    """True if ``bytes_of`` can be used here."""
    return _hdf5() is not None


def bytes_of(name: str) -> bytearray:
    """Return the bytes of the dataset that is open under a name, as they would be on the disk.

    Raises
    ------
    RuntimeError
        If HDF5 does not give them.
    """
    library = _hdf5()
    if library is not None:
        files = (_ID * max(0, library.H5Fget_obj_count(_ALL, _FILES)))()
        library.H5Fget_obj_ids(_ALL, _FILES, len(files), files)
        # on Windows netCDF gives HDF5 names in UTF-8
        wanted = name.encode(ENCODING), name.encode("utf-8", "replace")
        # so that a longer name is not cut to one of them
        room = max(map(len, wanted)) + 2
        for file in files:
            named = ctypes.create_string_buffer(room)
            library.H5Fget_name(file, named, len(named))
            size = (
                library.H5Fget_file_image(file, None, 0) if named.value in wanted else 0
            )
            if size > 0:
                content = bytearray(size)
                if (
                    library.H5Fget_file_image(
                        file, (ctypes.c_char * size).from_buffer(content), size
                    )
                    == size
                ):
                    return with_checksum(content)
    raise RuntimeError("HDF5 does not give the bytes of a dataset in memory")


def lookup3(key: bytes) -> int:
    """Return the hash of some bytes by which HDF5 checks its metadata.

    It is ``hashlittle`` of R. Jenkins' lookup3.c (2006, public domain) with a start of 0, named in the specification of
    the file format of HDF5.
    """
    most = 2**32 - 1

    def turned(word: int, bits: int) -> int:
        return (word << bits | word >> 32 - bits) & most

    a = b = c = (0xDEADBEEF + len(key)) & most
    for first in range(0, len(key), 12):
        block = key[first : first + 12].ljust(12, b"\0")
        words = (int.from_bytes(block[k : k + 4], "little") for k in (0, 4, 8))
        a, b, c = (
            (old + new) & most for old, new in zip((a, b, c), words, strict=True)
        )
        if first + 12 < len(key):
            for bits in (4, 6, 8, 16, 19, 4):
                a = (a - c & most) ^ turned(c, bits)
                a, b, c = b, c + b & most, a
        else:
            for bits in (14, 11, 25, 16, 4, 14, 24):
                c = (c ^ b) - turned(b, bits) & most
                a, b, c = b, c, a
            # after seven turns of three words the last result is the second
            c = b
    return c


def with_checksum(content: bytearray) -> bytearray:
    """Return the bytes of a file of HDF5 with the checksum of its first 44 bytes, the superblock.

    Some releases of HDF5 1.14 mark the file as closed in the bytes that they give, and leave the checksum of an open
    file, so that no program would read them.
    """
    if content[8] in (2, 3):  # versions of the superblock with a checksum
        content[44:48] = lookup3(bytes(content[:44])).to_bytes(4, "little")
    return content


def write_in_memory(path: Path, fill: Callable[[File], None]) -> None:
    """Build a netCDF file in memory, and write its bytes as those of any other file.

    HDF5 gives no reason if the disk fails, and netCDF crashes if that happens while it closes a file. So closing the
    file writes it only if HDF5 gives no bytes, or bytes that it cannot read.
    """
    content = _image(path, fill) if hdf5_gives_bytes() else None
    if content is not None:
        path.write_bytes(content)
        return
    name = os.path.abspath(path)
    with HDF5, File(name, "w", format="NETCDF4", diskless=True, persist=True) as file:
        fill(file)


def _image(path: Path, fill: Callable[[File], None]) -> bytearray | None:
    """Return the bytes of a file that is filled in memory, None if they cannot be read again."""
    name = os.path.abspath(path.with_name(f"{os.urandom(8).hex()}.nc"))
    with HDF5:
        with File(name, "w", format="NETCDF4", diskless=True, persist=False) as file:
            fill(file)
            file.sync()
            content = bytes_of(name)
        try:
            File(name, memory=content).close()
        except OSError:
            return None
    return content


def located(dataset: "xarray.Dataset") -> "xarray.Dataset":
    """Return a dataset whose prescribed speed is a coordinate, if its variables name it as one."""
    names = [
        name
        for name, variable in dataset.variables.items()
        if variable.attrs.get("coordinates") == "speed"
    ]
    if not names or "speed" not in dataset:
        return dataset
    result = dataset.copy().set_coords("speed")
    result.set_close(dataset._close)
    for name in names:
        # xarray writes it again when a dataset is saved
        result[name].attrs.pop("coordinates")
    return result


def tables(text: object) -> dict[str, Any]:
    """Return the tables that an attribute holds as JSON; none if the text holds no tables."""
    try:
        result = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        return {}
    return result if isinstance(result, dict) else {}
