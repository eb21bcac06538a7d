"""The one door through which netCDF files are read, whoever made them.

HDF5 follows what a file says: to the bytes of other files (external storage, virtual datasets, links), to sizes that
are declared and not there, to types that are no numbers. So a file is looked through before netCDF opens it, by the
calls of the same HDF5 library, which netCDF4 brings along: another one might read the file in another way.
"""

import contextlib
import ctypes
import functools
import json
import math
import mmap
import os
import stat
import struct
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

import netCDF4
import numpy as np

from sim.numerics.files import HDF5

if TYPE_CHECKING:
    import xarray


class Refused(ValueError):
    """A file that is not read; the message gives the reason, not its name."""


#: What is said of a file that cannot be read.
BROKEN = "is not a netCDF file, or is cut short or damaged"

_SIGNATURE, _CLASSIC = b"\x89HDF\r\n\x1a\n", (b"CDF\x01", b"CDF\x02", b"CDF\x05")
#: What HDF5 keeps of a variable in memory [byte]; its own 64 MiB hold every variable of a usual run whole.
CHUNK_CACHE = 4 * 2**20
#: Most variables of a file, and most attributes of each.
_MOST = 1000
#: Most bytes of an attribute, of what a scenario is kept in, and of all other attributes of a file.
_LONGEST, _ALL = 2**16, 2**24
_SCENARIO = dict.fromkeys(("scenario_toml", "scenario_overrides", "scenario_resolved"), 2**28)
_SCENARIO |= {"scenario_files": 2**30}
#: How a collection of texts and lists begins, and bytes of a file in which they are looked for.
_HEAP, _SEEN = b"GCOL\x01\0\0\0", 2**27
#: Most texts of a variable, most bytes of them all, and least that a chunk of numbers may take.
_LABELS, _WORDS, _CHUNK = 10**5, 2**26, 2**26
#: How many times smaller zlib packs numbers at best, and bytes that need not be there, as of a number never written.
_PACKED, _SMALL = 1032, 2**16
#: Attributes of HDF5 that say which dimensions a variable has; netCDF does not give them.
_INNER = {"CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates"}
_INNER |= {"_NCProperties", "_nc3_strict"}
#: Attributes that are numbers wherever the variable is.
_NUMBERS = {"scale_factor", "add_offset", "_FillValue", "missing_value", "valid_min", "valid_max", "valid_range"}
_ENCODINGS = {"utf-8", "ascii"}
#: Most tables and lists within each other.
_DEEPEST = 20

# what HDF5 calls by number: layouts, links, objects, filters (zlib, shuffle, checksums), classes of types
_CHUNKED, _VIRTUAL, _HARD, _DATASET = 2, 3, 0, 5
_ZLIB, _FILTERS = 1, {1, 2, 3}
_TEXT, _KINDS = 3, {0, 1, 3}

_ID, _SIZE, _INT, _NAME, _AT = ctypes.c_int64, ctypes.c_uint64, ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p
_BY_INDEX = (_ID, _NAME, _INT, _INT, _SIZE)
#: Result and arguments of each call of HDF5.
_CALLS: dict[str, tuple[Any, ...]] = {
    "H5Eset_auto2": (_INT, _ID, _AT, _AT),
    "H5Fopen": (_ID, _NAME, ctypes.c_uint, _ID),
    "H5Gget_info": (_INT, _ID, _AT),
    "H5Lget_name_by_idx": (_ID, *_BY_INDEX, _AT, _SIZE, _ID),
    "H5Lget_info_by_idx": (_INT, *_BY_INDEX, _AT, _ID),
    "H5Oopen_by_idx": (_ID, *_BY_INDEX, _ID),
    "H5Iget_type": (_INT, _ID),
    "H5Dget_create_plist": (_ID, _ID),
    "H5Pget_layout": (_INT, _ID),
    "H5Pget_external_count": (_INT, _ID),
    "H5Pget_nfilters": (_INT, _ID),
    "H5Pget_filter2": (_INT, _ID, ctypes.c_uint, _AT, _AT, _AT, _SIZE, _AT, _AT),
    "H5Pget_chunk": (_INT, _ID, _INT, _AT),
    "H5Dget_type": (_ID, _ID),
    "H5Dget_space": (_ID, _ID),
    "H5Dget_storage_size": (_SIZE, _ID),
    "H5Dvlen_get_buf_size": (_INT, _ID, _ID, _ID, _AT),
    "H5Sget_simple_extent_npoints": (_ID, _ID),
    "H5Tget_class": (_INT, _ID),
    "H5Tget_size": (_SIZE, _ID),
    "H5Tis_variable_str": (_INT, _ID),
    "H5Aget_num_attrs": (_INT, _ID),
    "H5Aopen_by_idx": (_ID, *_BY_INDEX, _ID, _ID),
    "H5Aget_name": (_ID, _ID, _SIZE, _AT),
    "H5Aget_type": (_ID, _ID),
    "H5Aget_space": (_ID, _ID),
    **{f"H5{kind}close": (_INT, _ID) for kind in "FOPTSA"},
}


def opened(path: str | os.PathLike[str]) -> netCDF4.Dataset:
    """A netCDF file for reading that holds nothing but its own numbers and texts.

    Parameters
    ----------
    path : path
        A plain file.

    Raises
    ------
    OSError
        If there is no such file or it cannot be read, with the reason.
    Refused
        If it is no netCDF file or is damaged; if it points at other files; if it declares what it does not hold, or
        more than can be meant; if it holds types that are neither numbers nor texts.
    """
    path, size, begins = os.path.abspath(path), *_begins(path)
    with HDF5, _damaged():
        if begins != _SIGNATURE and not begins.startswith(_CLASSIC):
            raise Refused(BROKEN)
        if begins == _SIGNATURE:
            _refuse_endless(path)
        found = _look_through(path, size) if begins == _SIGNATURE else set()
        whole = netCDF4.get_chunk_cache()
        netCDF4.set_chunk_cache(CHUNK_CACHE)
        try:
            file = netCDF4.Dataset(path)
        finally:
            netCDF4.set_chunk_cache(*whole)
        try:
            for name, one in file.variables.items():
                if not (name in found if begins == _SIGNATURE else one.size * one.dtype.itemsize <= size):
                    raise Refused(f'declares more numbers of "{name[:40]}" than it holds')
            _check_attributes(file)
        except BaseException:
            file.close()
            raise
    return file


def lazily(path: str | os.PathLike[str]) -> "xarray.Dataset":
    """An ``opened`` file whose numbers are read where they are used."""
    import xarray as xr  # heavy: a run makes its file without
    from xarray.backends import CachingFileManager, NetCDF4DataStore, StoreBackendEntrypoint

    with HDF5, _damaged():  # as reading and closing do
        file = CachingFileManager(opened, os.path.abspath(path), lock=HDF5)  # type: ignore[type-var]
        store: Any = NetCDF4DataStore(file, lock=HDF5)  # said what it is, no reader of other files is looked for
        return xr.open_dataset(store, engine=StoreBackendEntrypoint, decode_times=False, decode_coords=False)


def located(dataset: "xarray.Dataset") -> "xarray.Dataset":
    """A dataset whose prescribed speed is a coordinate, as its variables name it."""
    named = [name for name, variable in dataset.variables.items() if variable.attrs.get("coordinates") == "speed"]
    if not named or "speed" not in dataset:
        return dataset
    found = dataset.copy().set_coords("speed")
    found.set_close(dataset._close)
    for name in named:
        found[name].attrs.pop("coordinates")  # xarray writes it again where a dataset is saved
    return found


def tables(text: object) -> dict[str, Any]:
    """The tables that an attribute holds as JSON; none for what is no such text, or nests too deeply."""
    try:
        found = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        return {}
    inner = [found]
    for _ in range(_DEEPEST):
        inner = [one for outer in inner if isinstance(outer, dict | list) for one in _values(outer)]
    return found if isinstance(found, dict) and not inner else {}


def _values(outer: dict[str, Any] | list[Any]) -> Iterable[Any]:
    return outer.values() if isinstance(outer, dict) else outer


def _begins(path: str | os.PathLike[str]) -> tuple[int, bytes]:
    """Size and first bytes of a plain file; whatever else it is, it is not waited for."""
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as file:
        found = os.fstat(file.fileno())
        if not stat.S_ISREG(found.st_mode):
            raise Refused("is no plain file")
        return found.st_size, file.read(len(_SIGNATURE))


@contextlib.contextmanager
def _damaged() -> Iterator[None]:
    """A context in which whatever the libraries say of a damaged file is that it is one."""
    try:
        yield
    except Refused:
        raise
    except (OSError, RuntimeError, ValueError, ArithmeticError, AttributeError, LookupError, TypeError):
        raise Refused(BROKEN) from None


def _check_attributes(file: netCDF4.Dataset) -> None:
    """Refuse texts that are too long, and texts where numbers are due."""
    total = 0
    holders: list[Any] = [file, *file.variables.values()]
    for one in holders:
        limits = _SCENARIO if one is file else {}
        for name in one.ncattrs():
            value = one.getncattr(name)
            length = len(value) if isinstance(value, str | list) else np.size(value)
            total += 0 if name in limits else length
            if length > limits.get(name, _LONGEST) or total > _ALL:
                raise Refused(f"holds too long an attribute: {name[:40]}")
            numeric = isinstance(one, netCDF4.Variable) and one.dtype is not str and one.dtype.kind in "fiu"
            if numeric and name in _NUMBERS and np.asarray(value).dtype.kind not in "fiu":
                raise Refused(f"holds an attribute that must be a number: {name}")
            if name == "_Encoding" and str(value).lower() not in _ENCODINGS:
                raise Refused("holds texts that are not in UTF-8")


class _Calls:
    """The calls of HDF5; one that fails is a damaged file."""

    def __init__(self) -> None:
        # finds what its libraries have, too
        library = ctypes.CDLL(netCDF4._netCDF4.__file__)  # type: ignore[attr-defined]
        for name, (result, *arguments) in _CALLS.items():
            # HDF5 1.12 has two calls where 1.10 has one; what either gives begins with the kind of a link
            call = getattr(library, name, None) or getattr(library, f"{name}2", None)
            if call is None:
                raise Refused("cannot be looked through: netCDF4 hides its HDF5; take it from PyPI or conda")
            call.restype, call.argtypes = result, arguments
            call.errcheck = _succeeded
            setattr(self, name, call)
        self("Eset_auto2", 0, None, None)  # it prints nothing

    def __call__(self, name: str, *arguments: Any) -> int:
        return getattr(self, f"H5{name}")(*arguments)

    @contextlib.contextmanager
    def held(self, close: str, name: str, *arguments: Any) -> Iterator[int]:
        """A context with what a call opens."""
        one = self(name, *arguments)
        try:
            yield one
        finally:
            self(close, one)

    def type_of(self, one: int, of: str) -> tuple[int, int, int, bool]:
        """Class and bytes of the type of a variable (``of`` is "D") or attribute ("A"), how many, if texts vary."""
        with self.held("Tclose", f"{of}get_type", one) as made, self.held("Sclose", f"{of}get_space", one) as space:
            kind = self("Tget_class", made)
            varies = kind == _TEXT and self("Tis_variable_str", made) > 0
            return kind, self("Tget_size", made), self("Sget_simple_extent_npoints", space), varies


def _succeeded(result: int, call: Any, arguments: Any) -> int:
    if result < 0:
        raise Refused(BROKEN)
    return result


_calls: Callable[[], _Calls] = functools.cache(_Calls)


def _refuse_endless(path: str) -> None:
    """Refuse a file whose collections of texts and lists hold one without an end, which HDF5 reads for ever."""
    seen = min(os.path.getsize(path), _SEEN)
    with open(path, "rb") as file, mmap.mmap(file.fileno(), seen, prot=mmap.PROT_READ) as content:
        at = content.find(_HEAP, 0, seen - 16)
        while at >= 0:
            place = at + 16
            end = min(at + struct.unpack_from("<Q", content, at + 8)[0], seen)
            while place + 16 <= end:
                number, size = struct.unpack_from("<H6xQ", content, place)
                place += 16 + size + -size % 8 if number else size
                if place > end or (size < 16 and not number):
                    raise Refused(BROKEN)
            at = content.find(_HEAP, at + 8, seen - 16)


def _look_through(path: str, size: int) -> set[str]:
    """Names of the variables that are in a file of HDF5 as declared; whatever else there is in it is refused."""
    hdf5, stored, found = _calls(), 0, set()
    with hdf5.held("Fclose", "Fopen", os.fsencode(path), 0, 0) as file:
        _refuse_attributes(hdf5, file, _SCENARIO)
        links = (ctypes.c_uint64 * 8)()
        hdf5("Gget_info", file, links)
        if links[1] > _MOST:
            raise Refused(f"holds more than {_MOST} variables")
        for place in range(links[1]):
            link = (ctypes.c_int * 32)()
            hdf5("Lget_info_by_idx", file, b".", 0, 0, place, link, 0)
            if link[0] != _HARD:
                raise Refused("holds a link, which may lead into other files")
            with hdf5.held("Oclose", "Oopen_by_idx", file, b".", 0, 0, place, 0) as one:
                if hdf5("Iget_type", one) != _DATASET:
                    raise Refused("holds groups or types of its own")
                called = ctypes.create_string_buffer(1024)
                hdf5("Lget_name_by_idx", file, b".", 0, 0, place, called, len(called), 0)
                name = called.value.decode("utf-8", "replace")
                taken, whole = _stored(hdf5, one, name[:40])
                _refuse_attributes(hdf5, one, {})
            stored += taken
            if whole:
                found.add(name.removeprefix("_nc4_non_coord_"))
    if stored > size:
        raise Refused("declares more numbers than it holds")
    return found


def _stored(hdf5: _Calls, one: int, name: str) -> tuple[int, bool]:
    """Bytes that a variable takes in its file, and whether that can be all of its numbers."""
    chunk, filters = 0, []
    with hdf5.held("Pclose", "Dget_create_plist", one) as made:
        layout = hdf5("Pget_layout", made)
        if layout == _VIRTUAL or hdf5("Pget_external_count", made) > 0:
            raise Refused(f'keeps "{name}" in other files')
        for place in range(hdf5("Pget_nfilters", made)):
            flags, values, config = ctypes.c_uint(), ctypes.c_size_t(), ctypes.c_uint()
            about = ctypes.byref(flags), ctypes.byref(values), None, 0, None, ctypes.byref(config)
            filters.append(hdf5("Pget_filter2", made, place, *about))
        if layout == _CHUNKED:
            sides = (ctypes.c_uint64 * 32)()
            chunk = math.prod(sides[: hdf5("Pget_chunk", made, 32, sides)])
    if set(filters) - _FILTERS or len(set(filters)) < len(filters):
        raise Refused(f'packs "{name}" otherwise than by zlib')
    kind, width, count, varies = hdf5.type_of(one, "D")
    if kind not in _KINDS:
        raise Refused(f'holds "{name}", which is neither numbers nor texts')
    if chunk * width > max(_CHUNK, count * width):
        raise Refused(f'declares chunks of "{name}" larger than it is')
    taken = hdf5("Dget_storage_size", one)
    whole = count * width <= max(_SMALL, taken * (_PACKED if _ZLIB in filters else 1))
    if varies and (count > _LABELS or not whole):
        raise Refused(f'holds too many texts in "{name}"')
    if varies:
        with hdf5.held("Tclose", "Dget_type", one) as made, hdf5.held("Sclose", "Dget_space", one) as space:
            length = ctypes.c_uint64()
            hdf5("Dvlen_get_buf_size", one, made, space, ctypes.byref(length))
        if length.value > _WORDS:
            raise Refused(f'holds too long texts in "{name}"')
    return taken, whole


def _refuse_attributes(hdf5: _Calls, holder: int, limits: dict[str, int]) -> None:
    """Refuse attributes of a variable or of the file that are too long, or neither numbers nor one text."""
    if hdf5("Aget_num_attrs", holder) > _MOST:
        raise Refused(f"holds more than {_MOST} attributes")
    for place in range(hdf5("Aget_num_attrs", holder)):
        with hdf5.held("Aclose", "Aopen_by_idx", holder, b".", 0, 0, place, 0, 0) as one:
            called = ctypes.create_string_buffer(1024)
            hdf5("Aget_name", one, len(called), called)
            name = called.value.decode("utf-8", "replace")
            if name in _INNER:
                continue
            kind, width, count, varies = hdf5.type_of(one, "A")
        if kind not in _KINDS or (varies and count > 1):
            raise Refused(f'holds an attribute that is neither numbers nor a text: "{name[:40]}"')
        if count * width > limits.get(name, _LONGEST):
            raise Refused(f'holds too long an attribute: "{name[:40]}"')
