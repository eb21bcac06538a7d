"""What a dataset says about its scenario: swept keys, numbers, words, and what holds the sphere.

Everything is read from the file. A number of the scenario is a variable, a swept one a coordinate, and the
resolved scenario stands among the attributes.
"""

import json
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

MEMBERS = "member"

_CONTROLS = ("load", "indentation", "displacement")


def sweep_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Names of the sweep's dimensions, outermost first."""
    return tuple(str(name) for name in dataset["contact_modulus"].dims)


def is_steady(dataset: xr.Dataset) -> bool:
    """Whether the speed stays what it was at the start, at every point of the sweep."""
    speed = dataset["speed"]
    return bool((speed == speed.isel(t=0)).all())


def is_stationary(dataset: xr.Dataset) -> bool:
    """Whether neither the speed nor what holds the sphere changes in time, at any point of the sweep."""
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
    try:
        return xr.DataArray(str(told(dataset, key)))
    except KeyError:
        return xr.DataArray(default)


def told(dataset: xr.Dataset, key: str) -> Any:
    """What the resolved scenario says for a dotted key: a number, a word, a table as a dict, None.

    Raises
    ------
    KeyError
        If it does not say it, or the key or a table that holds it is swept: then it says it of one point only.
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
    if name in dataset.variables and dataset[name].dtype.kind in "OUST" and dataset[name].ndim == 1:
        return dataset[name]
    return None


class Control(NamedTuple):
    """What holds the sphere, at every sweep value and, where it changes, time.

    Attributes
    ----------
    kind : str
        ``"load"``, ``"indentation"`` or ``"displacement"``.
    value : xarray.DataArray
        Load [N], indentation or displacement [m]; with the dimension ``t`` where it changes. A load is nan where
        no member is in contact and the scenario does not say it for every point of the sweep.
    stiffness : xarray.DataArray
        Of the machine [N/m]; infinite where there is none.
    """

    kind: str
    value: xr.DataArray
    stiffness: xr.DataArray

    @property
    def changes(self) -> bool:
        """Whether it changes in time."""
        return "t" in self.value.dims


def control(dataset: xr.Dataset) -> Control:
    """What holds the sphere.

    Raises
    ------
    KeyError
        If the table ``[contact]`` is swept whole, so that the dataset does not tell.
    """
    for kind in _CONTROLS:
        try:
            value = setting(dataset, f"contact.{kind}")
        except KeyError:
            continue
        return Control(kind, value, _stiffness(dataset, kind))
    try:
        kind = next(name for name in _CONTROLS if told(dataset, "contact").get(name) is not None)
    except (KeyError, StopIteration):
        raise KeyError(
            "the dataset does not say what holds the sphere: a load, an indentation or a displacement"
        ) from None
    return Control(kind, _load(dataset) if kind == "load" else _first(dataset, kind), _stiffness(dataset, kind))


def _stiffness(dataset: xr.Dataset, kind: str) -> xr.DataArray:
    return setting(dataset, "contact.stiffness") if kind == "displacement" else xr.DataArray(np.inf)


def _first(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A recorded variable that is the same for all members."""
    variable = dataset[name if name in dataset else f"{name}_mean"].astype(float)
    return variable.isel({MEMBERS: 0}, drop=True) if MEMBERS in variable.dims else variable


def _load(dataset: xr.Dataset) -> xr.DataArray:
    """A load that changes: read off the members in contact, else off the scenario."""
    if "normal_load" in dataset:
        loads = dataset["normal_load"].astype(float).where(dataset["in_contact"] == 1)
        loads = loads.max(MEMBERS) if MEMBERS in loads.dims else loads
    else:  # an open contact counts with a load of zero
        closed = dataset["in_contact_mean"]
        loads = dataset["normal_load_mean"] / closed.where(closed > 0.0)
    return loads.fillna(_course(dataset, "contact.load"))


def _course(dataset: xr.Dataset, key: str) -> xr.DataArray:
    """A course or a table of the scenario at the recorded times; nan where the dataset does not tell."""
    times, unknown = dataset["t"], xr.full_like(dataset["t"], np.nan, dtype=float)
    try:
        said = told(dataset, key)
        if isinstance(said, dict) and "time" in said:
            return unknown.copy(data=np.interp(times, said["time"], said["value"]))
        start, stop, cycles = (setting(dataset, f"{key}.{name}") for name in ("from", "to", "cycles"))
    except KeyError:
        return unknown
    part = times / setting(dataset, "clock.duration")
    turn = 2.0 * cycles * part % 2.0
    part = xr.where(cycles > 0.0, xr.where(turn <= 1.0, turn, 2.0 - turn), part)
    straight = start + (stop - start) * part
    curved = start * np.abs(stop / start.where(start != 0.0)) ** part
    return xr.where(word(dataset, f"{key}.scale", "linear") == "log", curved, straight)


def stays_held(dataset: xr.Dataset) -> xr.DataArray:
    """Whether what holds the sphere stays the same in time, at every point of the sweep.

    Where the table ``[contact]`` is swept whole it is read off what was recorded: one of load,
    indentation and displacement stays.
    """
    try:
        held = control(dataset).value
    except KeyError:
        return _recorded_to_stay(dataset).broadcast_like(dataset["contact_modulus"])
    still = (held == held.isel(t=0)).all("t") if "t" in held.dims else xr.DataArray(True)
    return still.broadcast_like(dataset["contact_modulus"])


def _recorded_to_stay(dataset: xr.Dataset) -> xr.DataArray:
    stays = xr.DataArray(False)
    for kind in _CONTROLS:
        values = _load(dataset) if kind == "load" else _first(dataset, kind) if _has(dataset, kind) else None
        if values is not None:
            least, most = values.min("t"), values.max("t")
            stays = stays | (most - least <= 1e-6 * np.abs(most))  # what single precision leaves
    return stays


def _has(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset or f"{name}_mean" in dataset
