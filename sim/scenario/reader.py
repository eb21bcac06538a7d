"""From a TOML file or a dictionary to a scenario. Every fault in one pass, each with its place and the cure."""

import contextlib
import copy
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from sim.scenario.checks import CHECKED, faults_across
from sim.scenario.declared import with_models
from sim.scenario.messages import Fault, Place, dotted, faults, first_at_each, shown
from sim.scenario.scenario import Scenario, table_adapter
from sim.scenario.source import Files, Source
from sim.scenario.sweep import Axis, set_key, sweep_axes
from sim.scenario.toml_lines import words_of
from sim.scenario.toml_text import parse, put, read_text
from sim.units.quantity import number_and_unit
from sim.units.refusals import BadInput

__all__ = ["BadInput", "load"]

_DECLARED: dict[str, Any] = getattr(Scenario, "__pydantic_fields__", {})
_SCENARIO = TypeAdapter(Scenario)
#: Rows of a sweep whose faults are put in words.
_MOST_TRIED = 100
Words = tuple[str | int, ...]


def load(
    scenario: str | os.PathLike[str] | dict[str, Any], overrides: dict[str, Any] | None = None, *, option: str = ""
) -> Scenario:
    """Read a scenario from a TOML file or a dictionary of the same tables and keys.

    Parameters
    ----------
    scenario : path or dict
        The file, or ``{"clock": {"duration": "1 s", ...}, ...}``.
    overrides : dict, optional
        Values by dotted key that replace those of the scenario, ``{"contact.load": "2 mN"}``.
    option : str
        Other arguments: the option of a command by which the overrides came, for messages.

    Returns
    -------
    Scenario
        Checked throughout, every point of its sweep included.

    Raises
    ------
    BadInput
        With every fault: one syntax fault, or all faults of the values.
    """
    overrides = dict(overrides or {})
    if isinstance(scenario, dict):
        file, text, folder, document = "", "", Path(), copy.deepcopy(scenario)
    else:
        file, text, folder = str(scenario), read_text(Path(scenario)), Path(scenario).parent
        document = parse(text, file)
    place = Place(file, text, {words_of(key): value for key, value in overrides.items()}, option)
    astray = put(document, place.overrides)
    files = Files(folder)
    sweep = document.pop("sweep", {})
    axes, unfit = sweep_axes(sweep)
    source = Source(file, text, overrides, files.texts)
    found, wrong = _validated(document, files, axes, source)
    wrong = astray + _under_new_models(wrong, place.overrides)
    wrong += [Fault(("sweep", *where), said) for where, said in unfit]
    if found is None or wrong or (wrong := _point_faults(found)):  # then the values that are wrong in themselves
        rows = _row_faults(document, files, axes, wrong, zipped=isinstance(sweep, list))
        wrong = rows if found is not None and rows else wrong + rows
    if found is None or wrong:
        raise BadInput(place.problems(wrong))
    return found


def _validated(
    document: dict[str, Any], files: Files, axes: tuple[Axis, ...] = (), source: Source | None = None
) -> tuple[Scenario | None, list[Fault]]:
    """The scenario of a document, or all faults of its keys and values."""
    document = with_models(Scenario, document)
    strange = [Fault(("source",), "is not a key", "unknown")] if "source" in document else []
    made = {**document, "sweep": axes, "source": source or Source()}
    try:
        scenario = _SCENARIO.validate_python(made, context={"files": files}, by_alias=True, by_name=False)
    except ValidationError as invalid:
        found = strange + faults(Scenario, invalid, document)
        if not any(error["type"] == "across" for error in invalid.errors(include_url=False)):
            found += _faults_between_sound_parts(document, files)
        return None, first_at_each(found)
    return scenario, strange


def _under_new_models(faults: list[Fault], overrides: dict[tuple[str, ...], Any]) -> list[Fault]:
    """One fault for all keys of the file that a model chosen by an override does not take."""
    for words in (words for words in overrides if words[-1:] == ("model",)):
        others = [fault for fault in faults if fault.kind == "foreign" and fault.path[:-1] == words[:-1]]
        if others:
            keys = ", ".join(str(fault.path[-1]) for fault in others)
            said = f"{dotted(words[:-1])} holds keys that this model does not take ({keys})"
            faults = [fault for fault in faults if fault not in others] + [Fault(words, said, "foreign")]
    return faults


def _faults_between_sound_parts(document: dict[str, Any], files: Files) -> list[Fault]:
    """What does not go together between those parts that are sound in themselves."""
    parts: dict[str, Any] = {}
    how: dict[str, Any] = {"context": {"files": files}, "by_alias": True, "by_name": False}
    for name in CHECKED:
        with contextlib.suppress(ValidationError):
            if name in document:
                parts[name] = table_adapter(name).validate_python(document[name], **how)
            elif not _DECLARED[name].is_required():
                parts[name] = _DECLARED[name].get_default(call_default_factory=True)
    return [Fault(path, said) for path, said in faults_across(parts)]


def _row_faults(
    document: dict[str, Any], files: Files, axes: Iterable[Axis], known: list[Fault], zipped: bool
) -> list[Fault]:
    """Each swept value on its own, so that every bad one is named once."""
    meant = {fault.near for fault in known if fault.near}
    found: list[Fault] = []
    for axis in axes:
        places: dict[Fault, list[int]] = {}
        suspects = _suspects(document, files, axis)
        for place in (suspects or range(len(axis.values)))[:_MOST_TRIED]:
            for fault in _validated(_with_row(document, axis, place), files)[1]:
                # a table whose name is misspelt lacks its keys: that is one fault
                lacking = any(fault.path[:length] in meant for length in range(1, len(fault.path) + 1))
                if fault not in known and not lacking:
                    places.setdefault(fault, []).append(place)
        found += [_swept(fault, axis, several, zipped) for fault, several in places.items()]
        if len(suspects) > _MOST_TRIED:
            said = f"{len(suspects) - _MOST_TRIED:,} more values cannot be used"
            found.append(Fault(("sweep", axis.keys[0]), said, "more"))
    return found


def _with_row(document: dict[str, Any], axis: Axis, place: int) -> dict[str, Any]:
    """The document at one row of an axis."""
    changed = dict(document)
    for key, value in zip(axis.keys, axis.values[place], strict=True):
        set_key(changed, key, value)
    return changed


def _suspects(document: dict[str, Any], files: Files, axis: Axis) -> list[int]:
    """Rows of an axis at which one of its tables cannot be read by itself."""
    names, found = {key.partition(".")[0] for key in axis.keys}, []
    how: dict[str, Any] = {"context": {"files": files}, "by_alias": True, "by_name": False}
    for place in range(len(axis.values)):
        row = _with_row(document, axis, place)
        tables = with_models(Scenario, {name: row[name] for name in names})
        try:
            for name in names:
                table_adapter(name).validate_python(tables[name], **how)
        except (ValidationError, KeyError):
            found.append(place)
    return found


def _swept(fault: Fault, axis: Axis, places: list[int], zipped: bool) -> Fault:
    """A fault of some values of a sweep, placed at the first of them."""
    paths = {key: tuple(key.split(".")) for key in axis.keys}
    near = [key for key, path in paths.items() if all(a == b for a, b in zip(path, fault.path, strict=False))]
    key = near[0] if near else axis.keys[0]
    if fault.kind in ("unknown", "renamed") and paths[key][: len(fault.path)] == fault.path:
        meant = dotted((*fault.near, *paths[key][len(fault.path) :]))
        said = f'is now called "{meant}"' if fault.kind == "renamed" else f'is not a key; did you mean "{meant}"?'
        return Fault(("sweep", key), said if fault.near else fault.said, fault.kind)
    value = axis.values[places[0]][axis.keys.index(key)]
    split = number_and_unit(value)
    written = f"{split[0]:g} {split[1]}".strip() if split else shown(value)
    others = f" and {len(places) - 1} more" if len(places) > 1 else ""
    said = fault.said if fault.path == paths[key] else f"{dotted(fault.path)}: {fault.said}"
    path: Words = ("sweep", places[0], key) if zipped else ("sweep", key, places[0])
    return Fault(path, f"value {places[0] + 1} ({written}){others}: {said}")


def _point_faults(scenario: Scenario) -> list[Fault]:
    """What goes wrong only where values of several axes meet."""
    try:
        scenario.points()
    except BadInput as fault:
        return [Fault(("sweep",), said) for said in fault.problems]
    return []
