"""From a TOML file or a dictionary to a scenario. Each fault is reported with its place and one cure."""

import copy
import os
import re
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from sim.scenario.files import Files, Source, parse, read_text
from sim.scenario.messages import Fault, dotted, faults, problems
from sim.scenario.scenario import Scenario
from sim.scenario.schema import keys, model, tables, with_models
from sim.scenario.sweep import Axis, read_sweep, set_key, without, written
from sim.units.errors import BadInput

__all__ = ["BadInput", "load"]

_SCENARIO = TypeAdapter(Scenario)


def load(
    scenario: str | os.PathLike[str] | dict[str, Any],
    overrides: dict[str, Any] | None = None,
    *,
    option: str = "",
) -> Scenario:
    """Read a scenario from a TOML file or a dictionary of the same tables and keys.

    Parameters
    ----------
    scenario : path or dict
        The file, or ``{"clock": {"duration": "1 s", ...}, ...}``.
    overrides : dict, optional
        Values by dotted key that replace those of the scenario, ``{"contact.load": "2 mN"}``.
    option : str
        The option of a command that gave the overrides, for messages; without it they are an argument.

    Returns
    -------
    Scenario
        The scenario; every point of its sweep is checked. ``source.notes`` tells what the overrides replaced.

    Raises
    ------
    BadInput
        With one syntax fault, or all faults of the values, or, if there are none, all faults of the sweep.
    """
    overrides = dict(overrides or {})
    if isinstance(scenario, dict):
        file, text, folder, document = "", "", Path(), copy.deepcopy(scenario)
    elif not isinstance(scenario, str | os.PathLike):
        kind = type(scenario).__name__
        raise BadInput(
            [f"a scenario is a file or a dictionary of tables, but is of type {kind}"]
        )
    else:
        file, text, folder = (
            str(scenario),
            read_text(Path(scenario)),
            Path(scenario).parent,
        )
        document = parse(text, file)
    words = {_words(key): value for key, value in overrides.items()}
    notes = override(document, overrides)
    wrong = [Fault(("source",), "is not a key")] if "source" in document else []
    for table in (key for axis in _axes(document) for key in axis.keys):
        inside = (
            path
            for path in words
            if path[: len(_words(table))] == _words(table) != path
        )
        wrong += [
            Fault(
                path,
                f"is part of {table}, which is swept as a whole: set sweep instead",
            )
            for path in inside
        ]
    files = Files(folder)
    source = Source(file, text, overrides, files.texts, notes=tuple(notes))
    document = with_models(Scenario, document) | {"source": source}
    try:
        scene = _SCENARIO.validate_python(
            document, context={"files": files}, by_alias=True, by_name=False
        )
    except ValidationError as invalid:
        wrong += faults(Scenario, invalid)
    if wrong:
        raise BadInput(problems(wrong, file, words, option))
    try:
        scene.points()
    except BadInput as fault:
        swept = (Fault(("sweep",), problem) for problem in fault.problems)
        raise BadInput(problems(swept, file, words, option)) from None
    return scene


def override(document: dict[str, Any], overrides: dict[str, Any]) -> list[str]:
    """Set dotted keys in the document of a scenario, and return a sentence on each thing that they replace.

    A value of a swept key replaces its sweep. A model replaces the keys of other models in its table.
    """
    paths = {_words(key): value for key, value in overrides.items()}
    dropped, notes = list[str](), list[str]()
    others = [
        (*path[:-1], key)
        for path, value in paths.items()
        for key in _of_other_models(path, value)
    ]
    for *above, key in others:
        table: Any = document
        for word in above:
            table = table.get(word) if isinstance(table, dict) else None
        if isinstance(table, dict) and table.pop(key, None) is not None:
            dropped.append(dotted((*above, key)))
    if dropped:
        notes.append(
            f"omitted, because the chosen model has no such key: {', '.join(dropped)}"
        )
    axes = () if ("sweep",) in paths else _axes(document)
    for swept, count in [(key, len(axis.values)) for axis in axes for key in axis.keys]:
        if any(_words(swept)[: len(path)] == path for path in (*paths, *others)):
            axes = without(axes, swept)
            document["sweep"] = written(axes)
            notes.append(
                f"{swept} is not swept over its {count} values, because its value or model is set"
            )
    for path, value in paths.items():
        set_key(document, path, value)
    return notes


def _axes(document: dict[str, Any]) -> tuple[Axis, ...]:
    """Return the axes of the sweep of a document; none of a sweep that cannot be read."""
    try:
        return read_sweep(document.get("sweep", {}))
    except PydanticCustomError:
        return ()


def _of_other_models(path: tuple[str, ...], value: Any) -> list[str]:
    """Return the keys that only other models than a new one have; none if the path is not that of a model."""
    admitted: list[type] = [Scenario]
    for word in path[:-1]:
        fields = [keys(table)[word] for table in admitted if word in keys(table)]
        admitted = [
            inner for field in fields for inner in tables(field.annotation).values()
        ]
    chosen = {key for table in admitted if model(table) == value for key in keys(table)}
    if path[-1] != "model" or not chosen:
        return []
    return list(
        dict.fromkeys(
            key for table in admitted for key in keys(table) if key not in chosen
        )
    )


def _words(key: str) -> tuple[str, ...]:
    """Return the words of a dotted key, some of which may be quoted."""
    return tuple(word.strip(' "') for word in re.findall(r'"[^"]*"|[^."]+', key)) or (
        key,
    )
