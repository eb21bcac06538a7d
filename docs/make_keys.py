"""Write docs/keys.md, every key of a scenario file, from the declarations in the code."""

import re
import sys
import typing
from pathlib import Path

from sim.scenario.scenario import Scenario
from sim.scenario.schema import all_tables, declaration, keys, model, tables

TARGET = Path(__file__).with_name("keys.md")
HEAD = """# Every key of a scenario file

This page lists every key of a scenario with its unit, its meaning and its default. The shortest example:

```toml
contact.load = "4 mN"
```

- **Quantities** are text with a unit, or a bare number in the unit given here. A unit of 1 is a pure number.
- **Models** of a table go from simple to full. If a table or its `model` is omitted, the first model is used. The last
  column names the models that have a key; it is empty if all have it.
- **Sweeps**: `[sweep]` takes any of these keys with a list of values, or `{from, to, count, scale}`. Several keys form
  the outer product. A list of tables is one axis. `--set 'sweep={}'` runs a scenario without its sweep.
- **Editors** complete keys by the JSON schema that `sim new` writes beside the starter, as `sim.schema.json`. The
  first line of the starter, `#:schema ./sim.schema.json`, names it. `sim schema` prints the same schema.

Made by `python docs/make_keys.py` from the declarations in the code.
"""
#: A key with more words refers to the page that has them, because a cell would be a screen high.
MOST_WORDS = 30
#: Keys of the file itself that stand before its tables.
_FIRST = ("name", "seed")

#: What is taken for a key that is not given, where its meaning does not say it.
OMITTED = {
    "[clock.record]": "the clock step",
    "[shear.cell]": "√π times the contact radius at rest",
    "[shear.points]": "as many as the spectrum needs",
}


def text() -> str:
    """Return the page."""
    sections: dict[tuple, tuple[list[str], dict[str, type]]] = {}
    for path, field in all_tables(Scenario):
        options = tables(field.annotation)
        same = (path[-1:], *map(_form, options))
        same += tuple(key for table in options.values() for key in keys(table))
        sections.setdefault(same, ([], options))[0].append(
            f"[{'.'.join(path)}]" if path else "top of the file"
        )
    lines = [HEAD]
    for titles, options in sections.values():
        lines += _section(titles, options)
    return "\n".join(lines) + "\n"


def _section(titles: list[str], options: dict[str, type]) -> list[str]:
    lines = [f"\n## {', '.join(titles)}\n"]
    if len(options) > 1:
        lines += [
            f"- {_form(name)}: {_meaning(table)}" for name, table in options.items()
        ]
        lines.append("")
    elif titles != ["top of the file"]:
        lines += [f"{_meaning(*options.values())}\n"]
    rows: dict[tuple[str, ...], list[str]] = {}
    for name, table in options.items():
        for key, field in sorted(
            keys(table).items(),
            key=lambda item: table is Scenario and item[0] not in _FIRST,
        ):
            if key not in ("model", "sweep"):
                rows.setdefault((f"`{key}`", *_row(key, field, titles)), []).append(
                    _form(name)
                )
    has_models = len(options) > 1
    lines += [
        "| key | unit | meaning | default |" + (" models |" if has_models else "")
    ]
    lines += ["| --- | --- | --- | --- |" + (" --- |" if has_models else "")]
    for row, having in rows.items():
        shown = (
            [*row, "" if len(having) == len(options) else ", ".join(having)]
            if has_models
            else row
        )
        lines.append(f"| {' | '.join(shown)} |")
    return lines if rows else lines[:-2]


def _row(key: str, field: typing.Any, titles: list[str]) -> tuple[str, str, str]:
    """Return unit, meaning and default of a key."""
    quantity, inner = declaration(field), tables(field.annotation)
    place = (
        f"[{titles[0].strip('[]')}.{key}]" if titles[0].startswith("[") else f"[{key}]"
    )
    default = f"`{str(field.default).lower() if isinstance(field.default, bool) else field.default}`"
    if field.is_required():
        default = "needed"
    elif field.default_factory is not None:
        simplest = model(field.default_factory)
        default = f"`{simplest}`" if simplest else "its defaults"
    elif field.default in (None, "", ()):
        default = OMITTED.get(place, "not given")
    if quantity is None and inner:
        return "", f"the table {place}", default
    meaning = quantity.meaning if quantity else field.description
    words = _words(field.annotation)
    if len(words) > MOST_WORDS:
        meaning += "; each variable of [a dataset](dataset.md) has its name there"
    elif words:
        meaning += f": {', '.join(words)}"
    meaning += f"; or the table {place}" if inner else ""
    return (
        ("" if quantity is None or quantity.whole else quantity.unit),
        meaning,
        default,
    )


def _form(name: str) -> str:
    """Return the name of a model, or of a form without a model."""
    model, _, form = name.partition("[")
    return (
        f"`{model}`" + (f" with a {form[:-1]}" if form else "")
        if model
        else f"a {form[:-1]}"
    )


def _meaning(table: type) -> str:
    """Return the first paragraph of the description of a table."""
    return re.sub(
        r"`+", "`", " ".join((table.__doc__ or "").split("\n\n")[0].split())
    ).replace("\\", "")


def _words(annotation: typing.Any) -> list[str]:
    """Return the words that a key may take."""
    if typing.get_origin(annotation) is typing.Literal:
        return [f"`{word}`" for word in typing.get_args(annotation)]
    return [word for option in typing.get_args(annotation) for word in _words(option)]


if __name__ == "__main__":
    TARGET.write_text(text(), encoding="utf-8")
    sys.stdout.write(f"{TARGET}\n")
