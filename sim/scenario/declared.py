"""Quantities that the parts of a scenario declare."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from sim.scenario.source import Source
from sim.units.quantity import Quantity


def quantities(part: Any, prefix: str = "") -> dict[str, tuple[Quantity, float]]:
    """Every number of a scenario with its declaration, by its dotted key in a scenario file."""
    found: dict[str, tuple[Quantity, float]] = {}
    for item in fields(part):
        value = getattr(part, item.name)
        declared = getattr(type(part), "__pydantic_fields__", {}).get(item.name)
        key = prefix + ((declared and declared.alias) or item.name)
        if is_dataclass(value) and not isinstance(value, type) and not isinstance(value, Source):
            found |= quantities(value, f"{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool) and declared is not None:
            meaning = declared.description or item.name.replace("_", " ")
            found[key] = (declaration(declared) or Quantity("1", meaning), value)
    return found


def declaration(declared: Any) -> Quantity | None:
    """What a field of a part is declared to be, None where it is no quantity."""
    notes = (*declared.metadata, *_noted(declared.annotation))
    return next((item for item in notes if isinstance(item, Quantity)), None)


def _noted(annotation: Any) -> Iterator[Any]:
    """What the alternatives of an annotation are annotated with; a number comes before the tables it may be."""
    yield from getattr(annotation, "__metadata__", ())
    for option in getattr(annotation, "__args__", ()):
        if not is_dataclass(option):
            yield from _noted(option)
