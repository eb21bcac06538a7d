"""Scenario of a dataset: swept keys, numbers, words, and the control of the contact, read back from the file.

A number of the scenario is a variable, a swept one a coordinate; the resolved scenario is among the attributes.
"""

import contextlib
import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sim.numerics import files, hdf5
from sim.numerics.lazy import Refused, open_lazily
from sim.quantities import NUMBERS, OF_EACH_SLIP, RECORDED
from sim.units.errors import BadInput
from sim.units.notation import engineering
from sim.units.quantity import read_option
from sim.units.tables import decoded, same_line_ends

MEMBERS = "member"
#: Dimension of the statistics over the members that stand in place of these.
STATISTIC = "statistic"
#: Trajectories that are read and worked on at once [byte].
ROOM = 2**26
#: Quantities that every run records unless its scenario chooses some, and the statements that need them.
_STATEMENTS = {
    "contact_area": "contact area",
    "friction_force": "friction",
    "in_contact": "open contacts",
    "time_masked": "masked contacts",
    "first_detachment": "detachment",
    "jkr_radius": "area ratio",
    "bonds_radius": "area lost to bonds and fluctuations",
    "peak_stress": "peak of stress",
    "peak_friction": "peak of friction",
}
#: A missing variable in the words of xarray.
_MISSING = re.compile(r"(?:^|named ')(\w+?)(?:'|$)")
#: Numbers that every run derives from its scenario.
_DERIVED = (
    "contact_modulus",
    "effective_shear_modulus",
    "effective_poisson_ratio",
    "has_noise",
    "radius_at_rest",
    "radius_without_adhesion",
)
#: All numbers of each point of a sweep.
_NUMBERS = {row.name for row in NUMBERS}
#: Other numbers of a run, and the dimensions that a run has beside those of its sweep.
_RECORDED = {
    *RECORDED,
    *(f"{name}_count" for name in RECORDED),
    "t",
    MEMBERS,
    "slip",
    "phase",
    "phase_start",
    "phase_end",
    "shear_map",
    "map_member",
    "map_time",
    "x",
    "y",
    "error_speed",
    "member_spread_area",
}
#: Numbers of each slip event, and those of late ones at one speed of the stage, which are recorded together unless a
#: scenario chooses some, by the first of them.
_SLIPS = {
    "slip_time": [row.name for row in OF_EACH_SLIP],
    "slip_count_late": [name for name in RECORDED if name.startswith("late_")],
}
#: Begin of the versions whose events of these names had other definitions.
_FIRST = ("0.", "1.")
_OLD_EVENTS = re.compile(
    "(phase_)?(pull_off|closing|slip)_|kinetic_friction"
    "|late_(force_before|force_drop|amplitude|recurrence)_"
)
#: Names of systematic errors.
_ERRORS = re.compile("(cell|banded|step)_error_")
_DIMENSIONS = (
    STATISTIC,
    "t",
    "slip",
    "phase",
    "late",
    "map_member",
    "map_time",
    "x",
    "y",
)
_CONTROLS = ("load", "indentation", "displacement")


def open(path: str | os.PathLike[str]) -> xr.Dataset:
    """Open the dataset of a run lazily, with named dimensions and units.

    Raises
    ------
    BadInput
        If there is no such file, or no run wrote it.
    OSError
        If it cannot be read.
    sim.numerics.hdf5.Damaged
        Now or later, if a variable that is read is damaged.
    """
    is_name = isinstance(path, str | os.PathLike)  # a number is that of an open file
    if not is_name or not os.path.exists(path) or os.path.isdir(path):
        reason = "is a folder" if os.path.isdir(path) else "there is no such file"
        unfinished = os.path.isdir(f"{path}.parts")
        cure = (
            "the run is not complete; continue it with `sim run ... --resume`"
            if unfinished
            else "name a dataset"
        )
        raise BadInput([f"{path}: {reason}; {cure}"])
    try:
        dataset = open_lazily(path)
    except Refused as fault:
        reason = f"{fault}; run the scenario again"
        if str(path).endswith(".toml"):
            reason = "is a scenario; name the dataset that `sim run` writes"
        raise BadInput([f"{path}: {reason}"]) from None
    with contextlib.ExitStack() as refused:
        refused.callback(dataset.close)
        if not {"sim_version", "scenario_resolved"} & dataset.attrs.keys():
            raise BadInput(
                [f"{path}: was not written by `sim run`; name one of its outputs"]
            )
        if any(f"{name}_sem" in dataset.variables for name in RECORDED):
            reason = "holds the statistics of members in the form of version 1"
            raise BadInput([f"{path}: {reason}; run the scenario again"])
        if reason := _fault(dataset):
            raise BadInput(
                [
                    f"{path}: {reason}: it was changed after the run; run the scenario again"
                ]
            )
        dataset.attrs |= _joined(dataset)  # a copy would not close the file
        result = hdf5.located(_without_old_events(dataset))
        refused.pop_all()
    return result


def _joined(dataset: xr.Dataset) -> dict[str, Any]:
    """Return attributes of runs that were joined, or of selected members: their number, and in ``joined`` in words."""
    recorded, scenario = (
        int(dataset.attrs["members"]),
        hdf5.tables(dataset.attrs["scenario_resolved"]),
    )
    count, keys = (
        dataset.sizes.get(MEMBERS, recorded),
        {key.replace(".", "_") for key in _swept(scenario)},
    )
    texts = [f"joined along {name}" for name in sweep_dims(dataset) if name not in keys]
    if count != recorded:
        rest = (
            f"joined, {recorded} of one run" if count > recorded else f"of {recorded}"
        )
        texts.append(f"{count} members {rest}")
    return {"members": np.int32(count), "joined": "; ".join(texts)} if texts else {}


def _fault(dataset: xr.Dataset) -> str:
    """Return the first thing in which a dataset is not as a run writes it; "" if it is.

    This is the only check of what is read: each number of the scenario, and each derived one, is a variable over the
    sweep; each of these and of the recorded quantities holds numbers, and has no dimensions but those of a run.
    Variables and attributes of others are left alone. Numbers of tables that are swept whole need not be there.
    """
    attributes = {"members": np.integer, "sim_version": str, "scenario_resolved": str}
    for name, kind in attributes.items():
        if not isinstance(dataset.attrs.get(name), kind):
            return f"lacks the attribute {name}"
    if not (scenario := hdf5.tables(dataset.attrs["scenario_resolved"])):
        return "the attribute scenario_resolved does not hold a scenario"
    swept, numbers = (
        _swept(scenario),
        list(_numbers({key: scenario[key] for key in scenario if key != "sweep"})),
    )
    # tables that differ by point
    whole = {key.partition(".")[0] for key in swept if _label(dataset, key) is not None}
    varied = tuple(f"{name}." for name in swept)
    fixed = [
        key
        for key in numbers
        if key.partition(".")[0] not in whole and not f"{key}.".startswith(varied)
    ]
    keys = {key.replace(".", "_") for key in (*numbers, *swept)}
    for name in ("t", *_DERIVED, *(key.replace(".", "_") for key in fixed)):
        if name not in dataset.variables:
            return f"lacks the numbers {name}"
    chooses = bool((scenario.get("record") or {}).get("quantities"))
    for first, names in _SLIPS.items():
        for name in names if first in dataset and not chooses else ():
            if name not in dataset.variables:
                return f"lacks the numbers {name}"
    if dataset.variables["t"].dims != ("t",):
        return "the numbers t have other dimensions"
    # which are those of this variable; each has its values
    for name in sweep_dims(dataset):
        if name not in dataset.variables:
            return f"the variable contact_modulus has the unknown dimension {name}"
    for name, variable in (
        (str(name), variable) for name, variable in dataset.variables.items()
    ):
        over_sweep = name in keys or name in _NUMBERS
        is_recorded = name in _RECORDED or name.removeprefix("late_") in _RECORDED
        if not (over_sweep or is_recorded or _ERRORS.match(name)):
            continue
        allowed = "f" if over_sweep or name == "t" else "fiu"
        if name in keys and {*variable.dims[:1]} & {*dataset["contact_modulus"].dims}:
            allowed = "OUSTfiu"  # a label
        if variable.dtype.kind not in allowed:
            return f"the variable {name} has the type {variable.dtype}, which a run does not give it"
        if unknown := set(variable.dims) - {
            *sweep_dims(dataset),
            MEMBERS,
            *(() if over_sweep else _DIMENSIONS),
        }:
            return f"the variable {name} has the unknown dimension {min(map(str, unknown))}"
    return ""


def _swept(scenario: dict[str, Any]) -> set[str]:
    """Return the dotted keys that a scenario sweeps, along axes or in rows of several keys."""
    sweep = scenario.get("sweep", {})
    return {
        str(key)
        for row in (sweep if isinstance(sweep, list) else [sweep])
        for key in row
    }


def _numbers(table: dict[str, Any], path: str = "") -> Iterator[str]:
    """Give the dotted keys of the numbers in nested tables."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _numbers(value, f"{path}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{path}{key}"


def lacking(dataset: xr.Dataset) -> str:
    """Return which statements a dataset of an older version cannot make, in one sentence; "" if it makes all."""
    if (
        hdf5.tables(dataset.attrs["scenario_resolved"])
        .get("record", {})
        .get("quantities")
        is not None
    ):
        return ""
    # without adhesion there is none to mask, in any version
    has_none = dataset.get("adhesion_work", xr.DataArray(math.inf)) <= 0.0
    beside = {"time_masked"} if bool(has_none.all()) else set()
    lost = [
        words
        for name, words in _STATEMENTS.items()
        if name not in {*dataset.variables, *beside}
    ]
    version = str(dataset.attrs["sim_version"])
    if version.startswith(_FIRST):
        lost += ["pull-offs and slip events, which had other definitions"]
    text = f"made by sim {version}, which did not record all"
    return (
        f"{text}: no {', no '.join(lost)}; run the scenario again for these"
        if lost
        else ""
    )


def _without_old_events(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset of a version 1 without events that have another definition now under the same name."""
    if not str(dataset.attrs["sim_version"]).startswith(_FIRST):
        return dataset
    result = dataset.drop_vars(
        [name for name in dataset.data_vars if _OLD_EVENTS.match(str(name))]
    )
    result.set_close(dataset._close)
    return result


def with_trajectories(dataset: xr.Dataset, *names: str) -> xr.Dataset:
    """Return the dataset without its trajectories, except those named."""
    timed = [
        str(name)
        for name, variable in dataset.data_vars.items()
        if "t" in variable.dims
    ]
    return dataset.drop_vars([name for name in timed if name not in names])


def pieces(
    dataset: xr.Dataset, dims: Sequence[str]
) -> tuple[str, Iterator[xr.Dataset]]:
    """Return what a dataset is cut along, and its pieces in memory, so that little of a large file is there at once.

    Parameters
    ----------
    dataset : xarray.Dataset
        Opened lazily.
    dims : sequence of str
        Dimensions of which each value is worked on alone. The longest one is cut, at ends of chunks.
    """
    dataset = plain(dataset)
    sizes = {name: dataset.sizes[name] for name in dims if name in dataset.sizes}
    dim = max(sizes, key=sizes.__getitem__, default="t")
    timed = [
        variable
        for variable in dataset.variables.values()
        if {dim, "t"} <= set(variable.dims)
    ]
    chunk = max((_chunk(variable, dim) for variable in timed), default=1)
    size = dataset.sizes[dim]
    share = int(size * ROOM / max(ROOM, sum(variable.nbytes for variable in timed)))
    length = max(share // chunk, 1) * chunk
    starts = range(0, size, length)
    return dim, (
        dataset.isel({dim: slice(start, start + length)}).compute() for start in starts
    )


def in_pieces(
    dataset: xr.Dataset, dims: Sequence[str], reduce: Callable[[xr.Dataset], xr.Dataset]
) -> xr.Dataset:
    """Apply a function of a dataset in memory to ``pieces`` of a dataset, and join the results."""
    dim, parts = pieces(dataset, dims)
    first, *others = map(reduce, parts)
    if not others:
        return first
    how: Any = {"compat": "override", "join": "override"}
    how |= {"data_vars": "minimal", "coords": "minimal"}
    return xr.concat([first, *others], dim, **how)


def _chunk(variable: xr.Variable, dim: str) -> int:
    """Return the length of a file's chunks along a dimension; 1 for an array in memory."""
    chunks = variable.encoding.get("chunksizes") or ()
    # joined runs have other sizes
    return int(chunks[variable.dims.index(dim)]) if len(chunks) == variable.ndim else 1


def checked(dataset: object) -> xr.Dataset:
    """Return the dataset of a run, and refuse anything else.

    Raises
    ------
    BadInput
        With the type of what was given.
    """
    if isinstance(dataset, xr.Dataset) and "contact_modulus" in dataset.variables:
        return dataset
    kind = type(dataset).__name__
    cure = "give the dataset that sim.run or sim.open returns"
    raise BadInput([f"is of type {kind}, which no run has made; {cure}"])


def plain(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose speed is a variable, not a coordinate."""
    return dataset.reset_coords("speed") if "speed" in dataset.coords else dataset


def claim(
    dataset: xr.Dataset, path: Path, target: Path, replace: bool, *others: Path
) -> None:
    """Refuse a file to be made of the dataset at ``path`` and ``others``; errors as of ``files.claim``.

    Neither a dataset nor a file that this dataset was made from is replaced.
    """
    files.claim(target, replace, [path, *others])
    if not target.is_file() or target.is_relative_to("/dev"):
        return
    files_read = hdf5.tables(dataset.attrs.get("scenario_files")).values()
    texts = [str(entry.get("text")) for entry in files_read if isinstance(entry, dict)]
    texts.append(str(dataset.attrs.get("scenario_toml")))
    texts = [same_line_ends(text) for text in texts]  # of a dataset of an older version
    with target.open("rb") as file:
        # a mark, and line ends of two letters
        content = file.read(10 + 2 * max(len(text.encode()) for text in texts))
    text = decoded(content, "replace")
    if content.startswith((b"\x89HDF", b"CDF")):
        raise BadInput(
            [f"{target} is a dataset, which is never replaced; name another file"]
        )
    if content and text in texts:
        raise BadInput(
            [
                f"{target} is the scenario of this dataset, or a table of it; name another file"
            ]
        )


@contextlib.contextmanager
def answered() -> Iterator[None]:
    """Refuse a quantity that a dataset lacks with the key that records it.

    Raises
    ------
    BadInput
        With one sentence.
    """
    try:
        yield
    except KeyError as fault:
        name = match[1] if (match := _MISSING.search(str(fault.args[0]))) else ""
        if name not in RECORDED:
            raise
        raise BadInput(
            [
                f'{name} was not recorded; add "{name}" to record.quantities and run again'
            ]
        ) from None


@contextlib.contextmanager
def where_recorded() -> Iterator[None]:
    """Leave this context without a refusal if a dataset lacks a quantity."""
    with contextlib.suppress(BadInput), answered():
        yield


def sweep_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the names of the sweep's dimensions, outermost first."""
    return tuple(str(name) for name in dataset["contact_modulus"].dims)


def speed_name(dataset: xr.Dataset) -> str:
    """Return the name of the prescribed speed: that of the stage if it pulls through a spring."""
    return "stage_speed" if "stage_speed" in dataset else "speed"


def ensemble_mean(variable: xr.DataArray) -> xr.DataArray:
    """Return the mean over the members of a variable that holds their statistics, and any other one as it is."""
    if STATISTIC not in variable.dims:
        return variable
    return variable.isel({STATISTIC: 0}, drop=True)


def only_statistics(dataset: xr.Dataset) -> bool:
    """True if statistics over the members were recorded in place of these."""
    return STATISTIC in dataset.dims


def recorded_share(dataset: xr.Dataset, event: str) -> xr.DataArray | None:
    """Return the share of the members that have had an event, if statistics over these members were recorded.

    ``event`` is the name of its time, or of another number that only they have. None if members were recorded or agree.
    """
    if f"{event}_count" not in dataset:
        return None
    return dataset[f"{event}_count"] / float(dataset.attrs["members"])


def number_of_members(dataset: xr.Dataset) -> int:
    """Return the number of members of a run whose members differ, recorded or not; 1 if they agree."""
    differ = MEMBERS in dataset.sizes or only_statistics(dataset)
    recorded = dataset.sizes.get(MEMBERS, dataset.attrs.get("members", 1))
    return int(recorded) if differ else 1


def all_go_on(dataset: xr.Dataset) -> xr.DataArray | None:
    """True at records before the end of the first motion of all members; None if it is not known, or members agree.

    At a point of the sweep at which a motion ends before the first record it is True throughout.
    """
    going = None
    if STATISTIC in dataset.get("runaway_time", xr.DataArray(0.0)).dims:
        going = ensemble_mean(dataset["runaway_time"]).isnull()
    elif MEMBERS in dataset.get("slider_position", xr.DataArray(0.0)).dims:
        going = dataset["slider_position"].notnull().all(MEMBERS)
    return None if going is None else going | ~going.any("t")


def speed_of(dataset: xr.Dataset) -> xr.DataArray:
    """Return the prescribed speed of the slider or of the stage, which is the same for all members [m/s]."""
    speed = ensemble_mean(dataset[speed_name(dataset)])
    return speed.isel({MEMBERS: 0}, drop=True) if MEMBERS in speed.dims else speed


def steady_points(dataset: xr.Dataset) -> xr.DataArray:
    """True at the points of the sweep where the speed is constant in time; unrecorded, where the drive is steady."""
    if speed_name(dataset) not in dataset:
        return word(dataset, "drive.model", "") == "steady"
    speed = speed_of(dataset)
    # unknown after a runaway
    steady = ((speed == speed.isel(t=0)) | speed.isnull()).all("t")
    if "phase_name" in dataset:  # records may be too few to show a course
        driven = dataset["phase_name"].str.contains("speed|sliding|rest").any("phase")
        steady = steady & ~(driven & (dataset["phase_start"].count("phase") > 1))
    return steady


def is_steady(dataset: xr.Dataset) -> bool:
    """True if the speed is constant in time at every point of the sweep."""
    return bool(steady_points(dataset).all())


def is_stationary(dataset: xr.Dataset) -> bool:
    """True if the speed, or the force that pulls, and the contact's control are constant in time all over the sweep.

    Nothing is from which any trajectory runs away. Behind a spring the speed is that of the stage.
    """
    is_driven = is_steady(dataset)
    if "runaway_time" in dataset.variables:
        borne = bool(dataset["runaway_time"].isel(t=-1).isnull().all())
        forced = (word(dataset, "drive.model", "") == "force").all()
        by_force = "drive_force" in dataset.variables and bool(forced)
        is_driven = borne and (is_driven or by_force)
    return is_driven and bool(stays_held(dataset).all())


def setting(dataset: xr.Dataset, key: str) -> xr.DataArray:
    """Return a number of the scenario by its dotted key, with the sweep's dimensions if it is swept.

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
    """Return a word of the scenario, with the sweep's dimensions if it is swept.

    ``default`` where the scenario does not define it, or a table that holds it is swept whole.
    """
    table, _, last = key.rpartition(".")
    label = _label(dataset, key)
    if label is None and last == "model":
        # a table that is swept whole is labelled by its model
        label = _label(dataset, table)
    if label is not None:
        # labels that would be alike carry a number
        return label.copy(
            data=np.array([str(text).split(" ")[0] for text in label.to_numpy()])
        )
    with contextlib.suppress(KeyError):
        return xr.DataArray(str(resolved(dataset, key)))
    return xr.DataArray(default)


def reference_in_words(dataset: xr.Dataset) -> str:
    """Return the name of the contact at the full work of adhesion: JKR, unless the adhesion has a range."""
    model = word(dataset, "contact.model", "equilibrium")
    return "full adhesion" if bool((model == "cohesive").any()) else "JKR"


def resolved(dataset: xr.Dataset, key: str) -> Any:
    """Return the value of a dotted key in the resolved scenario: a number, a word, a table as a dict, or None.

    Raises
    ------
    KeyError
        If there is no such key, or it or a table that holds it is swept: the scenario is resolved for one point only.
    """
    words = key.split(".")
    if any(
        _label(dataset, ".".join(words[:count])) is not None
        for count in range(1, len(words) + 1)
    ):
        raise KeyError(f"{key} is swept")
    value = json.loads(dataset.attrs["scenario_resolved"])
    for name in words:
        if not isinstance(value, dict) or name not in value:
            raise KeyError(f"the scenario does not define {key}")
        value = value[name]
    return value


def _label(dataset: xr.Dataset, key: str) -> xr.DataArray | None:
    """Return the labels by which a key is swept; None if it is not swept."""
    name = key.replace(".", "_")
    swept = (
        name in dataset.variables
        and dataset[name].dtype.kind in "OUST"
        and dataset[name].ndim == 1
    )
    return dataset[name] if swept else None


class Control(NamedTuple):
    """Control of the contact: ``kind`` is ``"load"``, ``"indentation"`` or ``"displacement"``.

    ``stiffness`` [N/m] is that behind a displacement, with the sweep's dimensions; infinite without one.
    """

    kind: str
    stiffness: xr.DataArray


def control(dataset: xr.Dataset) -> Control:
    """Return the control of the contact.

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
            stiffness = (
                setting(dataset, "contact.stiffness")
                if kind == "displacement"
                else xr.DataArray(np.inf)
            )
            return Control(kind, stiffness)
    raise KeyError(
        "the dataset does not name the mount: a load, an indentation or a displacement"
    )


def has_noise(dataset: xr.Dataset) -> xr.DataArray:
    """True at the points of the sweep where something is random."""
    sweep = dataset["contact_modulus"]
    return dataset["has_noise"].broadcast_like(sweep).transpose(*sweep.dims) != 0.0


def stays_held(dataset: xr.Dataset) -> xr.DataArray:
    """True at the points of the sweep where the control of the contact is constant in time.

    It is not where the scenario gives one course for all points, nor where the contacts with all adhesion and with
    none change, which depend on nothing else.
    """
    still = xr.ones_like(dataset["contact_modulus"], bool)
    with contextlib.suppress(KeyError):
        still = still & (
            not isinstance(resolved(dataset, f"contact.{control(dataset).kind}"), dict)
        )
    for radius in (
        dataset.variables[name]
        for name in ("jkr_radius", "hertz_radius")
        if name in dataset
    ):
        still = still & (radius == radius.isel(t=0)).all("t")
    return still


#: How far from a swept value, in parts of it, one may be chosen: as far as rounding to three digits.
_NEAR = 5e-3


def where(dataset: xr.Dataset, chosen: Mapping[str, Any]) -> xr.Dataset:
    """Choose values of swept keys.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    chosen : dict
        Swept keys (``"contact.load"``, or ``"load"`` where that is one only), each with a value: a number in SI,
        a text with a unit (``"4 mN"``) or a name. The nearest swept value, within half a percent.

    Returns
    -------
    xarray.Dataset
        The dataset at these values; their dimensions stay, of length one.

    Raises
    ------
    BadInput
        If a key is not swept, or has no such value; the message lists those there are.
    """
    for key, value in chosen.items():
        dims = sweep_dims(dataset)
        full = key.replace(".", "_")
        fitting = [n for n in dims if n == full] or [
            n for n in dims if n.endswith(f"_{full}")
        ]
        if len(fitting) != 1:
            raise BadInput(
                [f"{key} is not swept; swept: {', '.join(dims) or 'nothing'}"]
            )
        name = fitting[0]
        swept = dataset[name]
        if swept.dtype.kind in "fi":
            unit = swept.attrs.get("units", "1")
            wanted = read_option(value, key, unit)
            off = np.abs(swept.to_numpy() - wanted)
            places = np.flatnonzero(off <= min(off.min(), _NEAR * abs(wanted)))
            known = [
                engineering(float(f"{number:.4g}"), unit) for number in swept.to_numpy()
            ]
        else:
            known = [str(text) for text in swept.to_numpy()]
            places = np.flatnonzero([text == value for text in known])
        if not places.size:
            raise BadInput(
                [f"{key} has no value {value}; there are: {', '.join(known)}"]
            )
        dataset = dataset.isel({name: places[:1]})
    return dataset
