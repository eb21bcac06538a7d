"""Scenario of a dataset: swept keys, numbers, words, and the control of the contact, read back from the file.

A number of the scenario is a variable, a swept one a coordinate; the resolved scenario is among the attributes.
"""

import contextlib
import functools
import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar, get_args

import numpy as np
import xarray as xr

from sim.numerics import files, hdf5
from sim.units.recorded import Recorded
from sim.units.refusals import BadInput, refuse_old

Given = ParamSpec("Given")
T = TypeVar("T")

MEMBERS = "member"
#: What is said of a file that cannot be read.
BROKEN = f"{hdf5.BROKEN}; run the scenario again"
#: What every dataset has: attributes with their kinds, and numbers at each point of the sweep.
_ATTRIBUTES = {"sim_version": str, "scenario_resolved": str, "members": np.integer}
_NUMBERS = ("contact_modulus", "effective_shear_modulus", "effective_poisson_ratio", "radius_at_rest")
#: Longest unit, name and symbol of a variable.
_LONGEST = 300
#: A missing variable in the words of xarray, without the ending of a statistic.
_MISSING = re.compile(r"(?:^|named ')(\w+?)(?:_mean|_std|_sem)?(?:'|$)")
_STATISTIC = re.compile("_(mean|std|sem)$")
#: Tables of a scenario that are read here.
_TABLES = ("contact", "drive", "record", "shear")
_CONTROLS = ("load", "indentation", "displacement")
_MOST_BYTES = 2**28


def open(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open the dataset of a run lazily, with named dimensions and units.

    Raises
    ------
    BadInput
        If there is no such file, or it is none of our datasets: what analysis reads of one is checked here, once.
    OSError
        If it cannot be read.
    """
    if not os.path.exists(path) or os.path.isdir(path):
        what = "is a folder" if os.path.isdir(path) else "there is no such file"
        raise BadInput([f"{path}: {what}; name a dataset"])
    try:
        dataset = hdf5.lazily(path)
    except hdf5.Refused as fault:
        said = f"{fault}; run the scenario again"
        if str(path).endswith(".toml"):
            said = "is a scenario; name the dataset that `sim run` makes of it"
        raise BadInput([f"{path}: {said}"]) from None
    with contextlib.ExitStack() as refused:
        refused.callback(dataset.close)
        if "sim_version" not in dataset.attrs:
            raise BadInput([f"{path}: was not written by `sim run`; name one of its outputs"])
        refuse_old(path, [*dataset.variables, *dataset.dims])
        if changed := _fault(dataset):
            raise BadInput([f"{path}: {changed}: it was changed after its run; run the scenario again"])
        refused.pop_all()
    return hdf5.located(dataset)


def plain(dataset: xr.Dataset) -> xr.Dataset:
    """A dataset whose speed is a variable like others, as statistics need it."""
    return dataset.reset_coords("speed") if "speed" in dataset.coords else dataset


def of_dataset(function: Callable[Given, T]) -> Callable[Given, T]:
    """Let a function of a dataset take one whose speed is a coordinate, too."""

    @functools.wraps(function)
    def taking(*given: Given.args, **named: Given.kwargs) -> T:
        first: Any = plain(given[0]) if given and isinstance(given[0], xr.Dataset) else None
        return function(*given, **named) if first is None else function(first, *given[1:], **named)  # type: ignore[arg-type]

    return taking


def _fault(dataset: xr.Dataset) -> str:
    """What makes a dataset none that `sim run` writes; "" for nothing."""
    for name, kind in _ATTRIBUTES.items():
        if not isinstance(dataset.attrs.get(name), kind):
            return f"lacks the attribute {name}"
    scenario = hdf5.tables(dataset.attrs["scenario_resolved"])
    if not _sound(scenario):
        return "the attribute scenario_resolved is no scenario"
    for name in (*_NUMBERS, "t"):
        if name not in dataset.variables or dataset[name].dtype.kind != "f":
            return f"lacks the numbers {name}"
    sweep, time = sweep_dims(dataset), dataset["t"]
    if time.dims != ("t",) or not time.size or not np.all(np.diff(time.to_numpy()) > 0.0):
        return "its times t do not increase"
    orders = (*sweep, MEMBERS, "t"), (*sweep, "map_member", "map_time", "x", "y")
    for key, variable in dataset.variables.items():
        name, dims = str(key), variable.dims
        label = variable.dtype.kind in "OUST"
        if not any(dims == tuple(one for one in order if one in dims) for order in orders) or 0 in variable.shape:
            return f"its variable {name[:40]} has dimensions of another kind of dataset"
        if variable.dtype.kind not in "fiuOUST" or (label and not (len(dims) == 1 and dims[0] in sweep)):
            return f"its variable {name[:40]} is neither a number nor a label"
        whole = _STATISTIC.sub("", name) in get_args(Recorded) or name in _NUMBERS
        if whole and (label or dims[: len(sweep)] != sweep):
            return f"its variable {name[:40]} does not follow the sweep"
        for text in (variable.attrs.get(name, "") for name in ("units", "long_name", "symbol")):
            if not isinstance(text, str) or len(text) > _LONGEST or not text.isprintable():
                return f"its variable {name[:40]} is described by no plain words"
    if missing := [name for name in sweep if name not in dataset.variables]:
        return f"lacks the swept values of {missing[0][:40]}"
    missing = [key for key in _numbers(scenario) if not _there(dataset, key)]
    return f"lacks the number {missing[0][:80]}" if missing else ""


def _sound(scenario: dict[str, Any]) -> bool:
    """Whether these are the tables of a scenario as far as they are read here."""
    if not scenario or not all(isinstance(scenario.get(name, {}), dict) for name in _TABLES):
        return False
    names = scenario.get("record", {}).get("quantities")
    return names is None or (isinstance(names, list) and set(map(str, names)) <= set(get_args(Recorded)))


def _numbers(tables: dict[str, Any], within: str = "") -> Iterator[str]:
    """Dotted keys of the numbers of a scenario but those of its sweep."""
    for name, value in tables.items():
        if isinstance(value, dict) and name != "sweep":
            yield from _numbers(value, f"{within}{name}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{within}{name}"


def _there(dataset: xr.Dataset, key: str) -> bool:
    """Whether a number of the scenario is a variable, or may be none as keys of its table are swept."""
    table = key.split(".")[0]
    if any(name == table or name.startswith(f"{table}_") for name in sweep_dims(dataset)):
        return True
    with contextlib.suppress(KeyError):
        return not np.any(np.isnan(setting(dataset, key).to_numpy()))
    return False


def claim(dataset: xr.Dataset, path: Path, target: Path, replace: bool, *others: Path) -> None:
    """Refuse a file to be made of the dataset at ``path`` and ``others``; errors as of ``files.claim``."""
    files.claim(target, replace, [path, *others], guard=functools.partial(_guard, dataset))


def _guard(dataset: xr.Dataset, path: Path) -> None:
    """Refuse to replace a dataset, or a file that this dataset was made from."""
    with path.open("rb") as file:
        content = file.read(_MOST_BYTES)
    text = content.decode("utf-8-sig", "replace").replace("\r\n", "\n")
    if content.startswith((b"\x89HDF", b"CDF")):
        raise BadInput([f"{path} is a dataset, which is not replaced; name another file"])
    told = str(dataset.attrs.get("scenario_files")), dataset.attrs.get("scenario_toml")
    if content and (hashlib.sha256(text.encode()).hexdigest() in told[0] or text == told[1]):
        raise BadInput([f"{path} is the scenario of this dataset, or a table of it; name another file"])


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


def speed_name(dataset: xr.Dataset) -> str:
    """Name of the speed that is prescribed: that of the stage where it pulls through a spring."""
    return "stage_speed" if "stage_speed" in dataset else "speed"


def speed_of(dataset: xr.Dataset) -> xr.DataArray:
    """The speed that is prescribed, of the slider or of the stage, which is the same for all members [m/s]."""
    speed = dataset[speed_name(dataset)]
    return speed.isel({MEMBERS: 0}, drop=True) if MEMBERS in speed.dims else speed


def steady_points(dataset: xr.Dataset) -> xr.DataArray:
    """True at the points of the sweep where the speed is constant in time; unrecorded, where the drive is steady."""
    if speed_name(dataset) not in dataset:
        return word(dataset, "drive.model", "") == "steady"
    speed = speed_of(dataset)
    return ((speed == speed.isel(t=0)) | speed.isnull()).all("t")  # unknown after a runaway


def is_steady(dataset: xr.Dataset) -> bool:
    """True if the speed is constant in time at every point of the sweep."""
    return bool(steady_points(dataset).all())


def is_stationary(dataset: xr.Dataset) -> bool:
    """True if the speed, or the force that pulls, and the contact's control are constant in time all over the sweep.

    Under a force from which any trajectory runs away nothing is.
    """
    return (is_steady(dataset) or _is_borne(dataset)) and bool(stays_held(dataset).all())


def _is_borne(dataset: xr.Dataset) -> bool:
    """Whether one force pulls all the time, and no trajectory ends in a runaway."""
    if "drive_force" not in dataset or "runaway_time" not in dataset:
        return False
    return bool((word(dataset, "drive.model", "") == "force").all() & dataset["runaway_time"].isel(t=-1).isnull().all())


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


def may_stop(dataset: xr.Dataset) -> bool:
    """Whether trajectories may stop at a pull-off, nan from there on."""
    return bool((word(dataset, "contact.after_pull_off", "stop") == "stop").any())


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
