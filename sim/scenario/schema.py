"""Keys of a scenario: tables, models, values with their units, the JSON schema, a starter file."""

import functools
import json
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple, cast, get_args

from pydantic import Tag, TypeAdapter
from pydantic.fields import FieldInfo
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import SchemaValidator, core_schema

from sim.numerics.files import OutputExists
from sim.units.quantity import Quantity


@functools.cache
def keys(table: type) -> dict[str, FieldInfo]:
    """Return the keys of a table as they are written in a file, with their declarations."""
    declared: dict[str, FieldInfo] = getattr(table, "__pydantic_fields__", {})
    # marks a field that is read from a file that a table names
    read = cast(type, SkipJsonSchema)
    written = {
        name: field
        for name, field in declared.items()
        if not any(isinstance(n, read) for n in field.metadata)
    }
    return {
        field.alias or name: field
        for name, field in written.items()
        if not field.exclude
    }


@functools.cache
def model(table: type) -> str | None:
    """Return the name of a table's model; None if there is only one."""
    return keys(table)["model"].default if "model" in keys(table) else None


def tables(annotation: Any, tag: str = "") -> dict[str, type]:
    """Return the tables that an annotation admits, by the name that pydantic gives each; "" if there is only one."""
    tag = next(
        (
            note.tag
            for note in getattr(annotation, "__metadata__", ())
            if isinstance(note, Tag)
        ),
        tag,
    )
    if isinstance(annotation, type) and is_dataclass(annotation):
        return {tag or model(annotation) or "": annotation}
    return {
        name: table
        for option in get_args(annotation)
        for name, table in tables(option, tag).items()
    }


@functools.cache
def _inner(table: type) -> dict[str, list[type]]:
    """Return the tables that the keys of a table admit."""
    admitted = {
        key: list(tables(field.annotation).values())
        for key, field in keys(table).items()
    }
    return {key: options for key, options in admitted.items() if options}


@functools.cache
def all_tables(root: type) -> list[tuple[tuple[str, ...], FieldInfo]]:
    """Return the path and declaration of every table in a scenario, outer ones first."""
    result: list[tuple[tuple[str, ...], FieldInfo]] = [((), FieldInfo(annotation=root))]
    for path, field in result:  # grows on the way
        inner = {
            key: keys(table)[key]
            for table in tables(field.annotation).values()
            for key in _inner(table)
        }
        result += [((*path, key), declared) for key, declared in inner.items()]
    return result


def with_models(table: type, document: Any) -> Any:
    """Return the document of a table, with the simplest model in each inner table that omits its model.

    No model is added to an inner table with a key that belongs to other models only: no model is guessed from keys.
    """
    if not isinstance(document, dict):
        return document
    result = dict(document)
    for key, admitted in _inner(table).items():
        inner, simplest = document.get(key), keys(table)[key].default_factory
        if not isinstance(inner, dict):
            continue
        if (
            len(admitted) > 1
            and "model" not in inner
            and isinstance(simplest, type)
            and simplest in admitted
        ):
            others = {word for option in admitted for word in keys(option)} - keys(
                simplest
            ).keys()
            inner = (
                inner if others & inner.keys() else {"model": model(simplest), **inner}
            )
        chosen = [option for option in admitted if model(option) == inner.get("model")]
        result[key] = with_models(chosen[0], inner) if chosen else inner
    return result


class Entry(NamedTuple):
    """A value of a scenario by its dotted ``key``, with its declaration if it is a number or a column of them."""

    key: str
    value: Any
    quantity: Quantity | None


def entries(part: Any, prefix: str = "") -> Iterator[Entry]:
    """Yield every value of a scenario or one of its parts, table by table; the model of a table comes first."""
    for name, key, quantity in _listed(cast(Hashable, type(part))):
        value = getattr(part, name)
        if is_dataclass(value):
            yield from entries(value, f"{prefix}{key}.")
        else:
            number = value[0] if isinstance(value, tuple) and value else value
            number = isinstance(number, int | float) and not isinstance(number, bool)
            yield Entry(prefix + key, value, quantity if number else None)


def distinct(points: Iterable[Any]) -> Iterator[tuple[str, Any]]:
    """Yield name and table of each scenario among points of a sweep; a table that points share comes once."""
    shared: dict[int, Any] = {}  # keeps each alive, so that no other gets its number
    for point in points:
        for name in _inner(cast(Hashable, type(point))):
            part = getattr(point, name)
            if id(part) not in shared:
                shared[id(part)] = part
                yield name, part


@functools.cache
def _listed(table: type) -> list[tuple[str, str, Quantity]]:
    """Return name, key and declaration as a number of each field of a table that a file gives."""
    listed = []
    for name, field in sorted(
        getattr(table, "__pydantic_fields__", {}).items(),
        key=lambda item: item[0] != "model",
    ):
        if (key := field.alias or name) in keys(table):
            meaning = field.description or name.replace("_", " ")
            listed.append((name, key, declaration(field) or Quantity("1", meaning)))
    return listed


def files_read(scenario: Any) -> list[Path]:
    """Return the file of a scenario and all files that it and its sweep name."""
    values = [(key, value) for key, value, _ in entries(scenario)]
    for axis in scenario.sweep:
        values += [
            pair for row in axis.values for pair in zip(axis.keys, row, strict=True)
        ]
    for key, value in values:  # grows on the way
        values += (
            [(f"{key}.{name}", inner) for name, inner in value.items()]
            if isinstance(value, dict)
            else []
        )
    names = {
        value
        for key, value in values
        if key.rpartition(".")[2] == "file" and isinstance(value, str) and value
    }
    path = Path(scenario.source.path)
    files = [path.parent / name for name in sorted(names.union(scenario.source.files))]
    return [path, *files] if scenario.source.path else files


def quantities(part: Any) -> dict[str, tuple[Quantity, float]]:
    """Return every number of a scenario with its declaration, by its dotted key in a scenario file."""
    listed = entries(part)
    return {
        key: (quantity, value)
        for key, value, quantity in listed
        if quantity and not isinstance(value, tuple)
    }


def changed(part: Any, values: Mapping[str, Any]) -> Any:
    """Return a scenario or a part with some numbers changed within their bounds; unchecked, because this is quick."""
    build, names, aliases = _unchecked(cast(Hashable, type(part)))
    document = {name: getattr(part, name) for name in names}
    for key, value in values.items():
        first, _, rest = key.partition(".")
        name = aliases.get(first, first)
        document[name] = changed(document[name], {rest: value}) if rest else value
    return build(document)


@functools.cache
def _unchecked(
    table: Any,
) -> tuple[Callable[[dict[str, Any]], Any], list[str], dict[str, str]]:
    """Return a function that makes a table of any values, their names, and those by the key of a file if it differs."""
    names = [item.name for item in fields(table)]
    anything = [
        core_schema.dataclass_field(name, core_schema.any_schema()) for name in names
    ]
    values = core_schema.dataclass_args_schema(table.__name__, anything)
    schema = core_schema.dataclass_schema(table, values, names)
    declared = getattr(table, "__pydantic_fields__", {})
    aliases = {item.alias: name for name, item in declared.items() if item.alias}
    return SchemaValidator(schema).validate_python, names, aliases


def declaration(declared: Any) -> Quantity | None:
    """Return the declaration of a key as a quantity; None if it is none."""
    notes = (*declared.metadata, *_noted(declared.annotation))
    return next((item for item in notes if isinstance(item, Quantity)), None)


def _noted(annotation: Any) -> Iterator[Any]:
    """Yield the notes of the alternatives of an annotation; a number comes before tables."""
    yield from getattr(annotation, "__metadata__", ())
    for option in getattr(annotation, "__args__", ()):
        if not is_dataclass(option):
            yield from _noted(option)


def write_starter(name: Path) -> Path:
    """Write a commented starter scenario, if there is no such file yet; return its path.

    Its first line names a schema beside it, by which an editor completes keys.
    """
    target = name if name.suffix else name.with_suffix(".toml")
    text = files("sim").joinpath("starter.toml").read_text(encoding="utf-8")
    try:
        with target.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        raise OutputExists(f"{target} exists; name another file") from None
    return target


def write_schema(path: Path, root: type) -> None:
    """Write the JSON schema of scenario files to a path, if there is no other file."""
    text = json.dumps(json_schema(root), indent=2) + "\n"
    try:
        with path.open("x", encoding="utf-8", newline="\n") as file:
            file.write(text)
    except FileExistsError:
        if path.read_bytes() != text.encode():
            stays = f"{path} is another file and stays"
            cure = "`sim schema` prints the schema of this version"
            raise OutputExists(f"{stays}; {cure}") from None


def json_schema(root: type) -> dict[str, Any]:
    """Return the JSON schema of a scenario file; ``root`` is the class of scenarios."""
    schema = TypeAdapter(root).json_schema(by_alias=True, mode="validation")
    simplest = [
        field.default_factory or next(iter(tables(field.annotation).values()))
        for _, field in all_tables(root)
    ]
    optional = [
        (model(table), keys(table).keys())
        for table in simplest
        if isinstance(table, type)
    ]
    for table in schema["$defs"].values():
        properties = table["properties"]
        if "file" in properties and "file" not in table.get("required", ()):
            columns = [
                name for name, each in properties.items() if each.get("type") == "array"
            ]
            table["anyOf"] = [
                {"required": ["file"]},
                {"required": table.pop("required", columns)},
            ]
        word = properties.get("model", {}).get("const")
        # only the simplest table may leave its model out
        if word and (word, properties.keys()) not in optional:
            table["required"] = ["model", *table.get("required", ())]
    schema["properties"].pop("source", None)
    schema["properties"]["sweep"] = {
        "description": "keys with lists of values (outer product), or a list of tables (zipped)",
        "anyOf": [{"type": "object"}, {"type": "array", "items": {"type": "object"}}],
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "sim scenario",
    }
