"""Writes docs/keys.md, every key of a scenario file, from the declarations in the code."""

import sys
import typing
from pathlib import Path

from pydantic_core import PydanticUndefined

from sim.scenario.declared import declaration
from sim.scenario.scenario import Scenario

TARGET = Path(__file__).with_name("keys.md")
HEAD = """# Every key of a scenario file

Made by `python docs/make_keys.py` from the declarations in the code. A quantity is a string with a unit (`"4 mN"`) or a
bare number in the unit given here. A table that is left out means its first model. `[sweep]` takes any of these keys
with a list of values, or `{from, to, count, scale}`; several keys form the outer product, a list of tables is one axis.
"""


def text() -> str:
    """The page."""
    _DONE.clear()
    lines = [HEAD, *_rows("top of the file", Scenario, skip={"source", "sweep"})]
    for name, field in Scenario.__pydantic_fields__.items():
        for part in _classes(field.annotation):
            if name not in ("source", "sweep"):
                lines += _table(f"[{name}]", part)
    return "\n".join(lines) + "\n"


def _table(title: str, part: type) -> list[str]:
    model = part.__pydantic_fields__.get("model")
    named = f" model = `{model.default}`" if model is not None else ""
    meaning = " ".join((part.__doc__ or "").split("\n\n")[0].split()).replace("\\", "")
    lines = [f"\n## {title}{named}\n", f"{meaning}\n", *_rows(title, part)]
    for name, field in part.__pydantic_fields__.items():
        for inner in _classes(field.annotation):
            heading = f"{title[:-1]}.{name}]"
            if heading in _DONE and inner in _DONE[heading]:
                continue
            _DONE.setdefault(heading, []).append(inner)
            lines += _table(heading, inner)
    return lines


_DONE: dict[str, list[type]] = {}


def _rows(title: str, part: type, skip: typing.Collection[str] = ()) -> list[str]:
    rows = []
    for name, field in part.__pydantic_fields__.items():
        quantity = declaration(field)
        tables = list(_classes(field.annotation))
        if name == "model" or name in skip or (tables and quantity is None):
            continue
        unit = quantity.unit if quantity else ""
        meaning = quantity.meaning if quantity else (field.description or name.replace("_", " "))
        words = _words(field.annotation)
        meaning += f": {', '.join(words)}" if words else ""
        meaning += "; or a table, see below" if tables else ""
        rows.append(f"| `{field.alias or name}` | {unit} | {meaning} | {_default(field)} |")
    return ["| key | unit | meaning | default |", "| --- | --- | --- | --- |", *rows] if rows else []


def _default(field: typing.Any) -> str:
    if field.default_factory is not None:
        return "its first model"
    if field.default is PydanticUndefined:
        return "needed"
    if field.default is None:
        return "not given"
    return f"`{str(field.default).lower() if isinstance(field.default, bool) else field.default}`"


def _words(annotation: typing.Any) -> list[str]:
    """The words that a key may take."""
    if typing.get_origin(annotation) is typing.Literal:
        return [f"`{word}`" for word in typing.get_args(annotation)]
    return [word for option in typing.get_args(annotation) for word in _words(option)]


def _classes(annotation: typing.Any) -> typing.Iterator[type]:
    """Our own dataclasses inside an annotation."""
    if hasattr(annotation, "__pydantic_fields__"):
        yield annotation
    for option in typing.get_args(annotation):
        yield from _classes(option)


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
