"""Scenario of a dataset: swept keys, numbers, words, and the control of the contact, read back from the file.

A number of the scenario is a variable, a swept one a coordinate; the resolved scenario is among the attributes.
"""

import contextlib
import json
import os
import re
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args

import netCDF4
import numpy as np
import xarray as xr
from xarray.backends import CachingFileManager, NetCDF4DataStore

from sim.numerics.files import HDF5
from sim.units.recorded import Recorded
from sim.units.refusals import BadInput, refuse_old

MEMBERS = "member"
#: What is said of a file that cannot be read.
BROKEN = "is not a netCDF file, or is cut short; run the scenario again"

#: A missing variable in the words of xarray, without the ending of a statistic.
_MISSING = re.compile(r"(?:^|named ')(\w+?)(?:_mean|_std|_sem)?(?:'|$)")
_CONTROLS = ("load", "indentation", "displacement")


def open(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open the dataset of a run lazily, with named dimensions and units.

    Raises
    ------
    BadInput
        If there is no such file, or it is none of our datasets.
    """
    if not os.path.isfile(path):
        what = "is a folder" if os.path.isdir(path) else "there is no such file"
        raise BadInput([f"{path}: {what}; name a dataset"])
    try:
        with HDF5:  # as reading and closing do
            file = CachingFileManager(netCDF4.Dataset, os.path.abspath(path), mode="r", lock=HDF5)  # type: ignore[type-var]
            dataset = xr.open_dataset(NetCDF4DataStore(file, lock=HDF5))
    except (OSError, ValueError, RuntimeError):
        said = "is a scenario; name the dataset that `sim run` makes of it" if str(path).endswith(".toml") else BROKEN
        raise BadInput([f"{path}: {said}"]) from None
    if "sim_version" not in dataset.attrs:
        dataset.close()
        raise BadInput([f"{path}: was not written by `sim run`; name one of its outputs"])
    refuse_old(path, [*dataset.variables, *dataset.dims])
    return dataset


@contextlib.contextmanager
def answered() -> Iterator[None]:
    """A context in which a quantity that a dataset lacks is refused with the key that records it.

    Raises
    ------
    BadInput
        With one sentence.
    """
    try:
        yield
    except KeyError as fault:
        name = found[1] if (found := _MISSING.search(str(fault.args[0]))) else ""
        if name not in get_args(Recorded):
            raise
        raise BadInput([f'{name} was not recorded; add "{name}" to record.quantities and run again']) from None


@contextlib.contextmanager
def where_recorded() -> Iterator[None]:
    """A context that is left where a dataset lacks a quantity, without a refusal."""
    with contextlib.suppress(BadInput), answered():
        yield


def sweep_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Names of the sweep's dimensions, outermost first."""
    return tuple(str(name) for name in dataset["contact_modulus"].dims)


def steady_points(dataset: xr.Dataset) -> xr.DataArray:
    """True at the points of the sweep where the speed is constant in time; unrecorded, where the drive is steady."""
    if "speed" not in dataset:
        return word(dataset, "drive.model", "") == "steady"
    return (dataset["speed"] == dataset["speed"].isel(t=0)).all("t")


def is_steady(dataset: xr.Dataset) -> bool:
    """True if the speed is constant in time at every point of the sweep."""
    return bool(steady_points(dataset).all())


def is_stationary(dataset: xr.Dataset) -> bool:
    """True if speed and control of the contact are constant in time at every point of the sweep."""
    return is_steady(dataset) and bool(stays_held(dataset).all())


def setting(dataset: xr.Dataset, key: str) -> xr.DataArray:
    """A number of the scenario by its dotted key, with the sweep's dimensions where it is swept.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it: the key ``"contact.load"`` is the variable ``contact_load``, swept or not.
    key : str
        Such as ``"contact.load"``.

    Raises
    ------
    KeyError
        If the dataset does not hold it as a number.
    """
    name = key.replace(".", "_")
    if name in dataset.variables and dataset[name].dtype.kind == "f":
        return dataset[name]
    raise KeyError(f"the dataset does not hold {key} as a number")


def word(dataset: xr.Dataset, key: str, default: str) -> xr.DataArray:
    """A word of the scenario, such as ``"contact.after_pull_off"``, with the sweep's dimensions where it is swept.

    ``default`` where the scenario does not say it, or a table that holds it is swept whole.
    """
    table, _, last = key.rpartition(".")
    label = _label(dataset, key)
    if label is None and last == "model":
        label = _label(dataset, table)  # a table that is swept whole is labelled by its model
    if label is not None:
        # labels that would be alike carry a number
        return label.copy(data=np.array([str(text).split(" ")[0] for text in label.to_numpy()]))
    with contextlib.suppress(KeyError):
        return xr.DataArray(str(resolved(dataset, key)))
    return xr.DataArray(default)


def resolved(dataset: xr.Dataset, key: str) -> Any:
    """Value of a dotted key in the resolved scenario: a number, a word, a table as a dict, or None.

    Raises
    ------
    KeyError
        If there is no such key, or it or a table that holds it is swept: the scenario is resolved for one point only.
    """
    words = key.split(".")
    if any(_label(dataset, ".".join(words[:count])) is not None for count in range(1, len(words) + 1)):
        raise KeyError(f"{key} is swept")
    value = json.loads(dataset.attrs["scenario_resolved"])
    for name in words:
        if not isinstance(value, dict) or name not in value:
            raise KeyError(f"the scenario does not say {key}")
        value = value[name]
    return value


def _label(dataset: xr.Dataset, key: str) -> xr.DataArray | None:
    """The labels that a key is swept by, None where it is not."""
    name = key.replace(".", "_")
    swept = name in dataset.variables and dataset[name].dtype.kind in "OUST" and dataset[name].ndim == 1
    return dataset[name] if swept else None


class Control(NamedTuple):
    """Control of the contact: ``kind`` is ``"load"``, ``"indentation"`` or ``"displacement"``.

    ``stiffness`` [N/m] is that behind a displacement, with the sweep's dimensions; infinite without one.
    """

    kind: str
    stiffness: xr.DataArray


def control(dataset: xr.Dataset) -> Control:
    """Control of the contact.

    Raises
    ------
    KeyError
        If the table ``[contact]`` is swept whole, so that the dataset does not say.
    """
    table: dict[str, Any] = {}
    with contextlib.suppress(KeyError):
        table = resolved(dataset, "contact")
    for kind in _CONTROLS:
        if table.get(kind) is not None or f"contact_{kind}" in dataset:
            stiffness = setting(dataset, "contact.stiffness") if kind == "displacement" else xr.DataArray(np.inf)
            return Control(kind, stiffness)
    raise KeyError("the dataset does not say what holds the sphere: a load, an indentation or a displacement")


def stays_held(dataset: xr.Dataset) -> xr.DataArray:
    """True at the points of the sweep where the control of the contact is constant in time.

    It is not where the scenario gives one course for all points, nor where the contacts with all adhesion and with
    none change, which depend on nothing else.
    """
    radii, moves = [dataset[name] for name in ("jkr_radius", "hertz_radius") if name in dataset], False
    with contextlib.suppress(KeyError):
        moves = isinstance(resolved(dataset, f"contact.{control(dataset).kind}"), dict)
    still = xr.ones_like(dataset["contact_modulus"], bool) & (not moves)
    for radius in radii:
        still = still & (radius == radius.isel(t=0)).all("t")
    return still
