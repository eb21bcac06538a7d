"""What the tables of a scenario declare: their keys, their models, and the values of a scenario with their units."""

import functools
import html
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast, get_args

from pydantic import Tag
from pydantic.fields import FieldInfo
from pydantic.json_schema import SkipJsonSchema

from sim.scenario.source import Source
from sim.units.quantity import Quantity


@functools.cache
def keys(table: type) -> dict[str, FieldInfo]:
    """The keys of a table as they are written in a file, with their declarations."""
    declared: dict[str, FieldInfo] = getattr(table, "__pydantic_fields__", {})
    return {field.alias or name: field for name, field in declared.items() if not (field.exclude or _read(field))}


def _read(field: FieldInfo) -> bool:
    """Whether a key is none of a file but what was read from one: it is left out of the schema."""
    return any(isinstance(note, cast(type, SkipJsonSchema)) for note in field.metadata)


@functools.cache
def model(table: type) -> str | None:
    """The name of a table's model; None where there is only one."""
    return keys(table)["model"].default if "model" in keys(table) else None


def tables(annotation: Any, tag: str = "") -> dict[str, type]:
    """The tables that an annotation admits, by the name that pydantic gives each; "" where there is only one."""
    tag = next((note.tag for note in getattr(annotation, "__metadata__", ()) if isinstance(note, Tag)), tag)
    if isinstance(annotation, type) and is_dataclass(annotation):
        return {tag or model(annotation) or "": annotation}
    return {name: table for option in get_args(annotation) for name, table in tables(option, tag).items()}


@functools.cache
def options(table: type) -> dict[str, list[type]]:
    """The tables that each key of a table admits."""
    return {key: list(tables(field.annotation).values()) for key, field in keys(table).items()}


@functools.cache
def all_tables(root: type) -> list[tuple[tuple[str, ...], FieldInfo]]:
    """The path and declaration of every table in a scenario, outer ones first."""
    found: list[tuple[tuple[str, ...], FieldInfo]] = [((), FieldInfo(annotation=root))]
    for path, field in found:  # grows on the way
        inner = {key: held for table in tables(field.annotation).values() for key, held in keys(table).items()}
        found += [((*path, key), held) for key, held in inner.items() if tables(held.annotation)]
    return found


def with_models(table: type, given: Any) -> Any:
    """A table as given, with the model of each inner table that leaves it out.

    That is the simplest model, unless a key that is there belongs to other models only: no model is guessed from keys.
    """
    if not isinstance(given, dict):
        return given
    found = dict(given)
    for key, admitted in options(table).items():
        inner, simplest = given.get(key), keys(table)[key].default_factory
        if not isinstance(inner, dict):
            continue
        if len(admitted) > 1 and "model" not in inner and isinstance(simplest, type) and simplest in admitted:
            others = {word for option in admitted for word in keys(option)} - keys(simplest).keys()
            inner = inner if others & inner.keys() else {"model": model(simplest), **inner}
        chosen = [option for option in admitted if model(option) == inner.get("model")]
        found[key] = with_models(chosen[0], inner) if chosen else inner
    return found


class Entry(NamedTuple):
    """A value of a scenario by its dotted ``key``, with its declaration if it is a number or a column of them."""

    key: str
    value: Any
    quantity: Quantity | None


def entries(part: Any, prefix: str = "") -> Iterator[Entry]:
    """Every value of a scenario or one of its parts, table by table; the model of a table comes first."""
    for name, key, quantity in _listed(cast(Hashable, type(part))):
        value = getattr(part, name)
        if is_dataclass(value):
            yield from () if isinstance(value, Source) else entries(value, f"{prefix}{key}.")
        elif quantity is not None:
            number = value[0] if isinstance(value, tuple) and value else value
            number = isinstance(number, int | float) and not isinstance(number, bool)
            yield Entry(prefix + key, value, quantity if number else None)


def distinct(points: Iterable[Any]) -> Iterator[tuple[str, Any]]:
    """Name and table of each scenario among points of a sweep, those that several share once."""
    kept: dict[int, Any] = {}  # so that no other gets the number of one that is gone
    for point in points:
        for name in _tables_of(cast(Hashable, type(point))):
            part = getattr(point, name)
            if id(part) not in kept:
                kept[id(part)] = part
                yield name, part


@functools.cache
def _tables_of(root: type) -> list[str]:
    return [key for key, admitted in options(root).items() if admitted]


@functools.cache
def _listed(table: type) -> list[tuple[str, str, Quantity | None]]:
    """Name, key and declaration as a number of each field of a table, None for one that no file gives."""
    listed = []
    for item in sorted(fields(table), key=lambda item: item.name != "model"):
        field = getattr(table, "__pydantic_fields__", {}).get(item.name)
        meaning = (field and field.description) or item.name.replace("_", " ")
        quantity = None if field is None or _read(field) else declaration(field) or Quantity("1", meaning)
        listed.append((item.name, (field and field.alias) or item.name, quantity))
    return listed


def files_read(scenario: Any) -> list[Path]:
    """The file of a scenario and all that it and its sweep name."""
    source, named = scenario.source, [(key, value) for key, value, _ in entries(scenario)]
    for axis in scenario.sweep:
        named += [pair for row in axis.values for pair in zip(axis.keys, row, strict=True)]
    names = {*source.files, *(name for key, value in named for name in _files_named(key, value))}
    return [*([Path(source.path)] if source.path else ()), *(Path(source.path).parent / name for name in sorted(names))]


def _files_named(key: str, value: Any) -> Iterator[str]:
    """Names of files in a value of a dotted key."""
    if isinstance(value, dict):
        for inner, held in value.items():
            yield from _files_named(inner, held)
    elif isinstance(value, str) and value and key.rpartition(".")[2] == "file":
        yield value


def as_html(title: str, listed: Iterable[Entry]) -> str:
    """A table of keys with their values, units and meanings; what is left out is left out."""
    rows = []
    for key, value, quantity in listed:
        unit = "" if quantity is None or quantity.unit == "1" else quantity.unit
        shown = f"{len(value)} values" if isinstance(value, tuple) else f"{value} {unit}"
        if value not in (None, "", ()):
            cells = (key, shown, quantity.meaning if quantity else "")
            rows.append("".join(f"<td style='text-align:left'>{html.escape(cell)}</td>" for cell in cells))
    return f"<b>{html.escape(title)}</b><table>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"


def quantities(part: Any) -> dict[str, tuple[Quantity, float]]:
    """Every number of a scenario with its declaration, by its dotted key in a scenario file."""
    listed = entries(part)
    return {key: (quantity, value) for key, value, quantity in listed if quantity and not isinstance(value, tuple)}


def declaration(declared: Any) -> Quantity | None:
    """What a key is declared to be, None where it is no quantity."""
    notes = (*declared.metadata, *_noted(declared.annotation))
    return next((item for item in notes if isinstance(item, Quantity)), None)


def _noted(annotation: Any) -> Iterator[Any]:
    """What the alternatives of an annotation are annotated with; a number comes before the tables it may be."""
    yield from getattr(annotation, "__metadata__", ())
    for option in getattr(annotation, "__args__", ()):
        if not is_dataclass(option):
            yield from _noted(option)
