"""netCDF files as HDF5 keeps them, opened for reading; a file that is none is refused with one reason."""

import contextlib
import json
import os
import stat
import sys
from collections.abc import Iterable, Iterator
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


class Refused(ValueError):
    """A file that is not read; the message gives the reason, not its name."""


class File(netCDF4.Dataset):
    """A netCDF file whose name may have every letter of the system's code page."""

    def __init__(self, path: str | os.PathLike[str], mode: Any = "r", **how: Any) -> None:
        whole = os.path.abspath(path)  # because a relative path may look like an address in the network
        super().__init__(whole, mode, encoding=ENCODING, **how)

    def filepath(self, encoding: str | None = None) -> str:
        return str(super().filepath(encoding or ENCODING))


def claim(path: Path, replace: bool, inputs: Iterable[Path] = ()) -> None:
    """Refuse a netCDF file that cannot be written, before anything is computed; parameters as of ``files.claim``.

    Raises
    ------
    BadInput
        Also if the C library cannot be told the path.
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
    if not stat.S_ISREG(os.stat(path).st_mode):  # opening a pipe would wait for its writer
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
    except Refused:
        raise
    except (OSError, RuntimeError, ValueError, ArithmeticError, AttributeError, LookupError, TypeError):
        raise Refused(BROKEN) from None


def located(dataset: "xarray.Dataset") -> "xarray.Dataset":
    """Return a dataset whose prescribed speed is a coordinate, if its variables name it as one."""
    names = [name for name, variable in dataset.variables.items() if variable.attrs.get("coordinates") == "speed"]
    if not names or "speed" not in dataset:
        return dataset
    result = dataset.copy().set_coords("speed")
    result.set_close(dataset._close)
    for name in names:
        result[name].attrs.pop("coordinates")  # xarray writes it again when a dataset is saved
    return result


def tables(text: object) -> dict[str, Any]:
    """Return the tables that an attribute holds as JSON; none if the text holds no tables."""
    try:
        result = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        return {}
    return result if isinstance(result, dict) else {}
