"""netCDF files as lazy datasets of xarray; damage that appears while numbers are read is named by its variable."""

import contextlib
import os
from pathlib import Path
from typing import Any

import xarray as xr
from xarray.backends import CachingFileManager, NetCDF4DataStore, StoreBackendEntrypoint
from xarray.backends.netCDF4_ import NetCDF4ArrayWrapper
from xarray.core.indexing import LazilyIndexedArray

from sim.numerics.files import HDF5
from sim.numerics.hdf5 import Damaged, Refused, opened, readable, write_in_memory

__all__ = ["Damaged", "Refused", "open_lazily", "save"]


class _Array(NetCDF4ArrayWrapper):
    """Numbers of one variable, read on use."""

    __slots__ = ()

    def __getitem__(self, key: Any) -> Any:
        try:
            return super().__getitem__(key)
        except (OSError, RuntimeError):
            place = f"{self.datastore.path}: variable {self.variable_name}"
            raise Damaged(f"{place} is damaged; use another copy of the file") from None


class _Store(NetCDF4DataStore):
    """A file of netCDF4 that names its damaged variables."""

    path: str | os.PathLike[str]

    def open_store_variable(self, name: str, var: Any) -> Any:
        variable = super().open_store_variable(name, var)
        for attribute in ("scale_factor", "add_offset", "_FillValue", "missing_value"):
            if (
                isinstance(variable.attrs.get(attribute), str)
                and variable.dtype.kind not in "OUS"
            ):
                raise Refused(f"holds no number in {attribute} of the variable {name}")
        return xr.Variable(
            variable.dims,
            LazilyIndexedArray(_Array(name, self)),
            variable.attrs,
            variable.encoding,
        )


def open_lazily(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open a netCDF file; its numbers are read on use.

    Raises
    ------
    OSError
        If there is no such file.
    Refused
        If it is no plain file, no netCDF file, cut short or damaged.
    Damaged
        If a coordinate is damaged; later, if a variable that is read is.
    """
    with HDF5, readable(), contextlib.ExitStack() as refused:
        file: Any = CachingFileManager(opened, os.path.abspath(path), lock=HDF5)  # type: ignore[type-var]
        # because nobody can delete or replace an open file on Windows
        refused.callback(file.close)
        store: Any = _Store(file, lock=HDF5)
        store.path = path
        dataset = xr.open_dataset(
            store,
            engine=StoreBackendEntrypoint,
            decode_times=False,
            decode_coords=False,
        )
        refused.pop_all()
    return dataset


def save(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as a netCDF file. On Windows xarray itself writes no path with a letter outside of ASCII."""
    write_in_memory(
        path, lambda file: dataset.dump_to_store(NetCDF4DataStore(file, lock=HDF5))
    )
