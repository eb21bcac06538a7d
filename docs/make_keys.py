"""Writes docs/keys.md, every key of a scenario file, from the declarations in the code."""

import sys
import typing
from pathlib import Path

from pydantic_core import PydanticUndefined

from sim.quantity import Quantity
from sim.scenario import Scenario

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
        if name == "model" or name in skip or list(_classes(field.annotation)):
            continue
        quantity = _quantity(field)
        unit = quantity.unit if quantity else ""
        meaning = quantity.meaning if quantity else (field.description or name.replace("_", " "))
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


def _quantity(field: typing.Any) -> Quantity | None:
    found = [item for item in field.metadata if isinstance(item, Quantity)]
    for option in (field.annotation, *typing.get_args(field.annotation)):
        found += [item for item in getattr(option, "__metadata__", ()) if isinstance(item, Quantity)]
    return found[0] if found else None


def _classes(annotation: typing.Any) -> typing.Iterator[type]:
    """Our own dataclasses inside an annotation."""
    if hasattr(annotation, "__pydantic_fields__"):
        yield annotation
    for option in typing.get_args(annotation):
        yield from _classes(option)


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
