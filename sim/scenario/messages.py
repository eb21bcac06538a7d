"""Faults of a scenario in words: what is wrong and the cure, in the terms of the file.

Two sources: the keys of the document are held against the JSON schema of scenarios, and the errors
that pydantic finds in the values are told without its vocabulary.
"""

import difflib
import re
from collections.abc import Iterator
from typing import Any, NamedTuple, get_args

from pydantic_core import core_schema

from sim.units.quantity import in_words

Path = tuple[str | int, ...]
Node = dict[str, Any]

_BUILT_IN = frozenset(get_args(core_schema.ErrorType)) - {"value_error"}
_TABLES = ("dataclass_type", "dataclass_exact_type", "model_attributes_type", "dict_type", "model_type")
_FILES = ("table", "bad_table", "no_table", "file_unreadable", "file_not_text")
_EXCLUSIVE = ("control", "one_modulus")
_WHOLE = ("int_type", "int_parsing", "int_from_float", "int_parsing_size", "finite_number")
_BOUNDS = {
    "greater_than_equal": ("at least", "ge"),
    "less_than_equal": ("at most", "le"),
    "greater_than": ("above", "gt"),
    "less_than": ("below", "lt"),
}
_PLAIN_KEY = re.compile(r"[A-Za-z0-9_-]+")


class Fault(NamedTuple):
    """What is wrong at a key.

    ``kind`` is "unknown", "foreign" (a key of another model), "missing", "exclusive" (one key of
    several) or "value"; ``near`` the key probably meant.
    """

    path: Path
    said: str
    kind: str = "value"
    near: Path = ()


def dotted(path: Path) -> str:
    """A key's path as it is written in a file, places in lists left out."""
    words = [word if _PLAIN_KEY.fullmatch(word) else f'"{word}"' for word in path if isinstance(word, str)]
    return ".".join(word[:60] for word in words)


class Shape:
    """The tables and keys that a scenario may have, from its JSON schema."""

    def __init__(self, schema: Node) -> None:
        self.schema = schema

    def faults(self, document: dict[str, Any]) -> Iterator[Fault]:
        """Unknown keys, and true or false where a number is due."""
        return self._walk([self.schema], document, ())

    def _walk(self, nodes: list[Node], value: Any, path: Path) -> Iterator[Fault]:
        options = self._options(nodes)
        if isinstance(value, bool) and _types(options) == {"integer"}:
            yield Fault(path, f"must be a whole number such as 64, not {in_words(value)}")
        if not isinstance(value, dict) or not any("properties" in option for option in options):
            return
        chosen = self._chosen(options, value)
        known = self._keys(chosen)
        for key, inner in value.items():
            if key in known:
                yield from self._walk(known[key], inner, (*path, key))
            else:
                yield self._unknown((*path, key), known, value, options, chosen)

    def _unknown(
        self, path: Path, known: dict[str, list[Node]], given: Node, options: list[Node], chosen: list[Node]
    ) -> Fault:
        key = str(path[-1])
        if key in self._keys(options):
            having = [option for option in options if key in option.get("properties", {})]
            model, others = _tag(chosen[0]), _either(list(map(_tag, having)))
            if model in map(_tag, having):
                other = next((name for name in given if name in known and name not in having[0]["properties"]), "model")
                return Fault(path, f"does not go with {other}; leave one of them out", "foreign")
            return Fault(path, f'is not a key of model = "{model}"; remove it, or choose model = {others}', "foreign")
        elsewhere = [table for table in self._tables() if key in self._keys(self._at(table))]
        closest = [table for table in elsewhere if table[:-1] == path[:-1] or path[: len(table)] == table] or elsewhere
        if len(closest) == 1:
            meant = (*closest[0], key)
            return Fault(path, f'is not a key here; did you mean "{dotted(meant)}"?', "unknown", meant)
        near = difflib.get_close_matches(key, self._keys(options) if _tag(chosen[0]) is None else known, 1, 0.6)
        if near:
            return Fault(path, f'is not a key; did you mean "{near[0]}"?', "unknown", (*path[:-1], near[0]))
        return Fault(path, f"is not a key; known: {', '.join(known)}", "unknown")

    def _tables(self) -> Iterator[Path]:
        """The paths of all tables, outer ones first."""
        waiting: list[Path] = [()]
        while waiting:
            path = waiting.pop(0)
            yield path
            inner = self._keys(self._at(path))
            waiting += [(*path, name) for name, nodes in inner.items() if self._keys(self._options(nodes))]

    def _at(self, path: Path) -> list[Node]:
        options = self._options([self.schema])
        for word in path:
            options = self._options(self._keys(options).get(str(word), []))
        return options

    def _place(self, location: tuple) -> tuple[Path, list[Node], list[Node]]:
        """The path in the file of a place in pydantic's terms, which name the models passed.

        With it the alternatives there and those of the table around it.
        """
        path: Path = ()
        around: list[Node] = []
        options = self._options([self.schema])
        for word in location:
            tagged = [option for option in options if _tag(option) == word]
            keys = self._keys(options)
            if tagged and len(options) > 1:
                options = tagged
            elif isinstance(word, int):
                path, around, options = (*path, word), options, []
            elif word in keys or not re.search(r"[\[\](]", word):
                path, around, options = (*path, word), options, self._options(keys.get(word, []))
        return path, options, around

    def _example(self, path: Path, options: list[Node]) -> str:
        """How a missing key may be added to a file."""
        for option in options:
            if option.get("examples"):
                value = option["examples"][0]
                written = f'"{value}"' if isinstance(value, str) else f"{value:g}"
                return f"for example {path[-1]} = {written}"
        models = [_tag(option) for option in options if _tag(option)]
        if len(models) > 1:
            return f"the table [{dotted(path)}] with model = {_either(models)}"
        if any("properties" in option for option in options):
            required = options[0].get("required", [])
            return f"the table [{dotted(path)}]" + (f" with {' and '.join(required)}" if required else "")
        simple = {"integer": "64", "boolean": "true", "array": "[...]", "string": '"..."'}
        return f"for example {path[-1]} = " + next((simple[kind] for kind in _types(options) if kind in simple), "...")

    def _options(self, nodes: list[Node]) -> list[Node]:
        """The alternatives of nodes, references and unions opened."""
        found: list[Node] = []
        for node in nodes:
            if "$ref" in node:
                found += self._options([self.schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]])
            elif "oneOf" in node or ("anyOf" in node and "properties" not in node):
                found += self._options(node.get("oneOf", []) + node.get("anyOf", []))
            elif node.get("type") != "null":
                found.append(node)
        return found

    def _chosen(self, options: list[Node], value: dict[str, Any]) -> list[Node]:
        """The alternative that a table's model names, all of them where it names none."""
        named = [option for option in options if _tag(option) == value.get("model", "")]
        if not named and "model" not in value:  # the model that a table without one is
            named = [option for option in options if _tag(option) and "model" not in option.get("required", ())]
        named = named or options
        if len({_tag(option) for option in named}) > 1:
            return named
        # several tables of one name: the one that takes most of the keys
        named = [option for option in named if "properties" in option] or named
        return [max(named, key=lambda option: len(option.get("properties", {}).keys() & value.keys()))]

    def _keys(self, options: list[Node]) -> dict[str, list[Node]]:
        keys: dict[str, list[Node]] = {}
        for option in options:
            for key, node in option.get("properties", {}).items():
                keys.setdefault(key, []).append(node)
        return keys

    def worded(self, error: Any) -> Fault:
        """One error of pydantic's in the terms of the file."""
        kind, context, given = error["type"], error.get("ctx", {}), error.get("input")
        path, options, around = self._place(error["loc"])
        if kind in ("missing", "missing_argument"):
            tables = [option["properties"] for option in around if "properties" in option]
            if path[-1] != "file" and any("file" in table and path[-1] in table for table in tables):
                said = 'is missing; name a CSV file such as file = "data.csv"'
                return Fault((*path[:-1], "file"), said, "missing")
            return Fault(path, f"is missing; add {self._example(path, options)}", "missing")
        models = [_tag(option) for option in options]
        if kind == "union_tag_not_found" and not isinstance(given, dict):
            return Fault(path, _no_table(path, given, models))
        if kind == "union_tag_not_found":
            return Fault((*path, "model"), f"is missing; choose {_either(models)}", "missing")
        if kind == "union_tag_invalid":
            return Fault((*path, "model"), _choice(given.get("model") if isinstance(given, dict) else None, models))
        if kind == "literal_error":
            return Fault(path, _choice(given, re.findall(r"'([^']*)'", context["expected"])))
        if kind in _TABLES:
            return Fault(path, _no_table(path, given, models))
        if kind in _FILES and "file" in self._keys(options):
            path = (*path, "file")
        said = _value_fault(kind, context, given, error["msg"])
        return Fault(path, said, "exclusive" if kind in _EXCLUSIVE else "value")


def _no_table(path: Path, given: Any, models: list[str | None]) -> str:
    """What is wrong where a table is due."""
    if given in models:
        return f'must be a table, not text; write {path[-1]} = {{ model = "{given}" }}'
    if isinstance(given, list):
        return f"must be one table, not a list; write [{dotted(path)}] once, in single brackets"
    return f"must be a table, not {in_words(given)}; write [{dotted(path)}] and its keys below"


def _value_fault(kind: str, context: dict[str, Any], given: Any, message: str) -> str:
    """What is wrong with a plain value."""
    if kind not in _BUILT_IN:
        return message.removeprefix("Value error, ")
    if kind in _WHOLE:
        return f"must be a whole number such as 64, not {shown(given)}"
    if kind in _BOUNDS:
        words, bound = _BOUNDS[kind]
        return f"must be {words} {context[bound]}, not {shown(given)}"
    if kind in ("bool_type", "bool_parsing"):
        return f"must be true or false, without quotes, not {shown(given)}"
    if kind in ("string_type", "string_unicode"):
        return f"must be text in quotes, not {shown(given)}"
    if kind == "string_too_long":
        return f"is longer than {context['max_length']} characters; shorten it"
    if kind in ("tuple_type", "list_type"):
        return f'must be a list such as ["1 s", "2 s"], not {shown(given)}'
    return "has a value that cannot be used here; `sim schema` tells what can"


def shown(value: Any) -> str:
    """A value as it stands in a file, cut to a few words."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, str):
        return f'"{value[:40]}"' if len(value) <= 40 else f'"{value[:40]}..."'
    if isinstance(value, dict) and "model" in value:
        return f"{{ model = {shown(value['model'])} }}"
    return in_words(value) if isinstance(value, bool | dict | list | tuple) or value is None else str(value)[:40]


def _types(options: list[Node]) -> set[str]:
    return {str(option.get("type")) for option in options}


def _tag(option: Node) -> str | None:
    return option.get("properties", {}).get("model", {}).get("const")


def _either(names: list[str | None]) -> str:
    quoted = [f'"{name}"' for name in dict.fromkeys(names) if name is not None]
    return f"{', '.join(quoted[:-1])} or {quoted[-1]}" if len(quoted) > 1 else "".join(quoted)


def _choice(given: Any, known: list) -> str:
    """A word that is none of those known."""
    near = difflib.get_close_matches(given, known, 1, 0.6) if isinstance(given, str) else []
    if near:
        return f'must not be {shown(given)}; did you mean "{near[0]}"?'
    return f"must be {_either(known)}, not {shown(given)}"
