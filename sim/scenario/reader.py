"""From a TOML file to a scenario. Every fault in one pass, each with file, line, key and cure."""

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from sim.scenario.checks import CHECKED, faults_across
from sim.scenario.messages import Fault, dotted, shown
from sim.scenario.scenario import Scenario
from sim.scenario.schema import scenario_shape
from sim.scenario.source import Files, Source
from sim.scenario.sweep import Axis, set_key, sweep_axes
from sim.scenario.toml_text import BadInput, Place, Words, monsters, parse, put, read_text, words_of
from sim.units.quantity import number_and_unit

_DECLARED: dict[str, Any] = getattr(Scenario, "__pydantic_fields__", {})
_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")


def load(path: str | Path, overrides: dict[str, Any] | None = None) -> Scenario:
    """Read a scenario from a TOML file.

    Parameters
    ----------
    path : path
        The file.
    overrides : dict, optional
        Values by dotted key that replace those of the file, ``{"contact.load": "2 mN"}``.

    Returns
    -------
    Scenario
        Checked throughout, every point of its sweep included.

    Raises
    ------
    BadInput
        With every fault of the file: one syntax fault, or all faults of its values.
    """
    overrides = dict(overrides or {})
    text = read_text(Path(path))
    document = parse(text, str(path))
    place = Place(str(path), text, {words_of(key): value for key, value in overrides.items()})
    astray = put(document, place.overrides)
    if choking := monsters(document):
        raise BadInput(place.problems(choking))
    files = Files(Path(path).parent)
    sweep = document.pop("sweep", {})
    axes, unfit = sweep_axes(sweep)
    source = Source(str(path), text, overrides, files.texts)
    scenario, faults = _validated(document, files, axes, source)
    faults = astray + _under_new_models(faults, place.overrides)
    faults += [Fault(("sweep", *where), said) for where, said in unfit]
    faults += _row_faults(document, files, axes, faults, zipped=isinstance(sweep, list))
    if scenario is not None and not faults:
        faults = _point_faults(scenario)
    if scenario is None or faults:
        raise BadInput(place.problems(faults))
    return scenario


def _validated(
    document: dict[str, Any], files: Files, axes: tuple[Axis, ...] = (), source: Source | None = None
) -> tuple[Scenario | None, list[Fault]]:
    """The scenario of a document, or all faults of its keys and values."""
    shape = scenario_shape()
    faults = list(shape.faults(document))
    more = {"sweep": axes, "source": source or Source()}
    try:
        return _scenario_type().validate_python({**document, **more}, context={"files": files}), faults
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
    unknown = {fault.path for fault in faults if fault.kind in ("unknown", "foreign")}
    wrong = [shape.worded(error) for error in errors if error["type"] not in _UNKNOWN]
    meant = {fault.near for fault in faults} | {fault.path for fault in wrong if fault.kind != "missing"}
    for fault in wrong:
        told = any(fault.path[:length] in unknown for length in range(1, len(fault.path) + 1))
        if not told and not (fault.kind == "missing" and fault.path in meant):
            faults.append(fault)
    if not any(error["type"] == "across" for error in errors):
        faults += _faults_between_sound_parts(document, files)
    return None, list({fault.path: fault for fault in reversed(faults)}.values())[::-1]


def _under_new_models(faults: list[Fault], overrides: dict[Words, Any]) -> list[Fault]:
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
    parts = {}
    for name in CHECKED:
        declared = _DECLARED[name]
        try:
            if name in document:
                parts[name] = _part_type(name).validate_python(document[name], context={"files": files})
            elif not declared.is_required():
                parts[name] = declared.get_default(call_default_factory=True)
        except ValidationError:
            continue
    return [Fault(path, said) for path, said in faults_across(parts)]


def _row_faults(
    document: dict[str, Any], files: Files, axes: Iterable[Axis], known: list[Fault], zipped: bool
) -> list[Fault]:
    """Each swept value on its own, so that every bad one is named once."""
    meant = {fault.near for fault in known if fault.near}
    found: list[Fault] = []
    for axis in axes:
        places: dict[Fault, list[int]] = {}
        for place, row in enumerate(axis.values):
            changed = dict(document)
            for key, value in zip(axis.keys, row, strict=True):
                set_key(changed, key, value)
            for fault in _validated(changed, files)[1]:
                # a table whose name is misspelt lacks its keys: that has been told
                told = any(fault.path[:length] in meant for length in range(1, len(fault.path) + 1))
                if fault not in known and not told:
                    places.setdefault(fault, []).append(place)
        found += [_swept(fault, axis, several, zipped) for fault, several in places.items()]
    return found


def _swept(fault: Fault, axis: Axis, places: list[int], zipped: bool) -> Fault:
    """A fault of some values of a sweep, told where the first of them stands."""
    paths = {key: tuple(key.split(".")) for key in axis.keys}
    inside = (
        key for key, path in paths.items() if fault.path[: len(path)] == path or path[: len(fault.path)] == fault.path
    )
    key = next(inside, axis.keys[0])
    if fault.kind == "unknown" and paths[key][: len(fault.path)] == fault.path:
        meant = (*fault.near, *paths[key][len(fault.path) :])
        said = f'is not a key; did you mean "{dotted(meant)}"?' if fault.near else fault.said
        return Fault(("sweep", key), said, "unknown")
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
    except ValidationError as errors:
        return [
            Fault(("sweep",), f"some values do not go together: {dotted(fault.path)}: {fault.said}")
            for fault in map(scenario_shape().worded, errors.errors(include_url=False))
        ]
    except PydanticCustomError as fault:
        return [Fault(("sweep",), fault.message())]
    return []


@functools.cache
def _scenario_type() -> TypeAdapter:
    return TypeAdapter(Scenario)


@functools.cache
def _part_type(name: str) -> TypeAdapter:
    declared = _DECLARED[name]
    kind: Any = declared.annotation
    return TypeAdapter(Annotated[kind, Field(discriminator=declared.discriminator)] if declared.discriminator else kind)
