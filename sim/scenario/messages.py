"""Faults of a scenario in words: the place in the file, what is wrong, and the cure."""

import contextlib
import difflib
import functools
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar, cast, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, core_schema

from sim.scenario.declared import all_tables, declaration, keys, model, tables, with_models
from sim.scenario.toml_lines import key_lines
from sim.units.quantity import in_words
from sim.units.refusals import BadInput, renamed
from sim.units.terminal import one_line

Path = tuple[str | int, ...]
Tables = dict[str, type]
T = TypeVar("T")

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_MISSING = ("missing", "missing_argument")
_NO_TABLE = ("dataclass_type", "dataclass_exact_type", "model_attributes_type", "dict_type", "union_tag_not_found")
_BUILT_IN = frozenset(get_args(core_schema.ErrorType)) - {"value_error"}
_FILES = ("bad_table", "no_table", "file_unreadable", "file_not_text")
_EXCLUSIVE = ("control", "one_modulus")
#: What a value must be, by the beginning of the kind of its error.
_KINDS = {"bool": "true or false, without quotes", "string": "text in quotes", "tuple": "a list in brackets"}
#: Faults that are put in words; what is so wrong is put right some at a time.
_MOST = 100
_PLAIN_KEY = re.compile(r"[A-Za-z0-9_-]+")


class Fault(NamedTuple):
    """What is wrong at a key.

    ``kind`` is "unknown", "renamed", "foreign" (a key of another model), "missing", "exclusive" (one key of
    several) or "value"; ``near`` the key probably meant.
    """

    path: Path
    said: str
    kind: str = "value"
    near: Path = ()


class _Spot(NamedTuple):
    """A place in a scenario: its ``path`` and declaration, the tables ``admitted`` there and those ``chosen`` of them.

    ``around`` are the tables chosen around it.
    """

    path: Path
    field: FieldInfo | None
    admitted: Tables
    chosen: Tables
    around: Tables


def dotted(path: Path) -> str:
    """A key's path as it is written in a file, places in lists left out."""
    words = [word if _PLAIN_KEY.fullmatch(word) else f'"{word}"' for word in path if isinstance(word, str)]
    return ".".join(word[:60] for word in words)


def faults(root: type, invalid: ValidationError, document: dict[str, Any]) -> list[Fault]:
    """The errors that pydantic found in a document, in the words of a scenario; one for each place.

    A key that is missing because it was misspelt, or has another name now, is not a fault of its own.
    """
    errors = invalid.errors(include_url=False)
    more = len(errors) - _MOST
    errors = errors[:_MOST]
    found = [_unknown(root, error, document) if error["type"] in _UNKNOWN else _worded(root, error) for error in errors]
    meant = {fault.near for fault in found} | {fault.path for fault in found if fault.kind != "missing"}
    found = [fault for fault in found if fault.kind != "missing" or fault.path not in meant]
    return first_at_each(found) + ([Fault((), f"and {more:,} faults more", "more")] if more > 0 else [])


def first_at_each(found: list[Fault]) -> list[Fault]:
    """One fault for each place, the first."""
    return list({fault.path: fault for fault in reversed(found)}.values())[::-1]


@contextlib.contextmanager
def in_plain_words(root: type, document: dict[str, Any]) -> Iterator[None]:
    """A context in which what pydantic finds wrong with a document is raised as ``BadInput``."""
    try:
        yield
    except ValidationError as invalid:
        raise BadInput(Place("", "", {}).problems(faults(root, invalid, document))) from None


def plain_spoken(cls: type[T]) -> type[T]:
    """Let a class of a scenario's tables raise ``BadInput`` where its values cannot be used."""
    made: Callable[..., None] = cls.__init__

    @functools.wraps(made)
    def init(self: T, *args: Any, **values: Any) -> None:
        with in_plain_words(cls, values):
            made(self, *args, **with_models(cls, values))

    cls.__init__ = init  # type: ignore[method-assign, assignment]
    return cls


def _spot(root: type, location: tuple[str | int, ...]) -> _Spot:
    """The place that pydantic's location names, which holds the names of the tables passed."""
    spot = _Spot((), None, {"": root}, {"": root}, {})
    for word in location:
        known = _keys(spot.chosen)
        if len(spot.chosen) > 1 and word in spot.chosen:
            spot = spot._replace(chosen={str(word): spot.chosen[str(word)]})
        elif isinstance(word, int):
            spot = spot._replace(path=(*spot.path, word))
        elif word in known or "[" not in word:
            inner = tables(known[word].annotation) if word in known else {}
            spot = _Spot((*spot.path, word), known.get(word), inner, inner, spot.chosen)
    return spot


def _keys(options: Tables) -> dict[str, FieldInfo]:
    return {key: field for table in options.values() for key, field in keys(table).items()}


def _unknown(root: type, error: ErrorDetails, document: dict[str, Any]) -> Fault:
    """A key that its table does not have: an old name, a key of another model or table, or a misspelt one."""
    *outer, key = error["loc"]
    place = _spot(root, tuple(outer))
    path, known, word = (*place.path, str(key)), _keys(place.chosen), str(key)
    now = renamed(word)
    if now in _keys(place.admitted):
        return Fault(path, f'is now called "{now}"', "renamed", (*place.path, str(now)))
    having = [table for table in place.admitted.values() if word in keys(table)]
    if having:
        names = [model(table) for table in having]
        own = model(next(iter(place.chosen.values())))
        if own not in names:
            said = f'is not a key of model = "{own}"; remove it, or choose model = {_either(names)}'
            return Fault(path, said, "foreign")
        given: Any = functools.reduce(lambda table, step: table[step], place.path, cast(Any, document))
        other = next((name for name in given if name in known and name not in keys(having[0])), "model")
        return Fault(path, f"does not go with {other}; leave one of them out", "foreign")
    elsewhere: set[Path] = {table for table, field in all_tables(root) if word in _keys(tables(field.annotation))}
    closest = {table for table in elsewhere if table[:-1] == path[:-1] or path[: len(table)] == table} or elsewhere
    if len(closest) == 1:
        meant = (*closest.pop(), word)
        return Fault(path, f'is not a key here; did you mean "{dotted(meant)}"?', "unknown", meant)
    if near := _near(word, known):
        return Fault(path, f'is not a key; did you mean "{near}"?', "unknown", (*path[:-1], near))
    return Fault(path, f"is not a key; known: {', '.join(known)}", "unknown")


def _near(word: str, known: Iterable[str]) -> str:
    """The word that was probably meant; empty if none is near."""
    return next(iter(difflib.get_close_matches(word, list(known), 1, 0.6)), "")


def _worded(root: type, error: ErrorDetails) -> Fault:
    """A value that cannot be used, or a key that is missing."""
    kind, given = error["type"], error.get("input")
    spot = _spot(root, error["loc"])
    path, names = spot.path, [model(table) for table in spot.admitted.values()]
    if kind in _MISSING:
        if path[-1] != "file" and "file" in _keys(spot.around):
            said = 'is missing; name a CSV file such as file = "data.csv"'
            return Fault((*path[:-1], "file"), said, "missing")
        return Fault(path, f"is missing; add {_example(spot)}", "missing")
    if kind == "union_tag_not_found" and isinstance(given, dict):
        if misspelt := _near("model", map(str, given)):
            return Fault((*path, misspelt), 'is not a key; did you mean "model"?', "unknown", (*path, "model"))
        fitting = [model(table) for table in spot.admitted.values() if given.keys() <= keys(table).keys()]
        return Fault((*path, "model"), f"is missing; choose {_either(fitting or names)}", "missing")
    if kind == "union_tag_invalid":
        return Fault((*path, "model"), _choice(given.get("model") if isinstance(given, dict) else None, names))
    if kind == "literal_error":
        return Fault(path, _choice(given, re.findall(r"'([^']*)'", error["ctx"]["expected"])))
    if kind in _NO_TABLE:
        return Fault(path, _no_table(path, given, names))
    if kind in _FILES and "file" in _keys(spot.chosen):
        path = (*path, "file")
    return Fault(path, _value_fault(error), "exclusive" if kind in _EXCLUSIVE else "value")


def _value_fault(error: ErrorDetails) -> str:
    """What is wrong with a plain value; kinds that are not pydantic's own come with their words."""
    kind = error["type"]
    if kind == "string_too_long":
        return f"is longer than {error['ctx']['max_length']} characters; shorten it"
    if kind == "tuple_type" and isinstance(error["input"], str):
        return f"must be a list such as [{shown(error['input'])}], not text"
    if kind in _BUILT_IN and kind.partition("_")[0] in _KINDS:
        return f"must be {_KINDS[kind.partition('_')[0]]}, not {shown(error['input'])}"
    if kind in _BUILT_IN:
        return "has a value that cannot be used here; `sim schema` lists what can"
    return error["msg"].removeprefix("Value error, ")


def _example(spot: _Spot) -> str:
    """How a missing key may be added to a file."""
    name, options = spot.path[-1], list(spot.admitted.values())
    quantity = spot.field and declaration(spot.field)
    if quantity is not None:
        return f"for example {name} = {quantity.example}"
    if len(options) > 1:
        return f"the table [{dotted(spot.path)}] with model = {_either(list(map(model, options)))}"
    if options:
        needed = [key for key, field in keys(options[0]).items() if field.is_required()]
        return f"the table [{dotted(spot.path)}]" + (f" with {' and '.join(needed)}" if needed else "")
    return f'for example {name} = "..."'


def _no_table(path: Path, given: Any, models: list[str | None]) -> str:
    """What is wrong where a table is due."""
    if isinstance(given, str) and given in models:
        return f'must be a table, not text; write {path[-1]} = {{ model = "{given}" }}'
    if isinstance(given, list):
        return f"must be one table, not a list; write [{dotted(path)}] once, in single brackets"
    return f"must be a table, not {in_words(given)}; write [{dotted(path)}] and its keys below"


def shown(value: Any) -> str:
    """A value as it stands in a file, cut to a few words."""
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, str):
        return f'"{value[:40]}"' if len(value) <= 40 else f'"{value[:40]}..."'
    if isinstance(value, dict) and "model" in value:
        return f"{{ model = {shown(value['model'])} }}"
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value) if abs(value) < 10**40 else "a number of many digits"
    return in_words(value) if isinstance(value, bool | dict | list | tuple) or value is None else str(value)[:40]


def _either(names: list[str | None]) -> str:
    quoted = [f'"{name}"' for name in dict.fromkeys(names) if name is not None]
    return f"{', '.join(quoted[:-1])} or {quoted[-1]}" if len(quoted) > 1 else "".join(quoted)


def _choice(given: Any, known: list) -> str:
    """A word that is none of those known."""
    now = renamed(given) if isinstance(given, str) else None
    if now in known:
        return f'{shown(given)} is now called "{now}"'
    if isinstance(given, str) and (near := _near(given, filter(None, known))):
        return f'must not be {shown(given)}; did you mean "{near}"?'
    return f"must be {_either(known)}, not {shown(given)}"


@dataclass(frozen=True)
class Place:
    """Words faults with the line of their key in a TOML text, or with the override that set it.

    ``option`` is the option of a command that the overrides came by; without one they are an argument.
    """

    file: str
    text: str
    overrides: dict[tuple[str, ...], Any]
    option: str = ""

    def problems(self, faults: list[Fault]) -> list[str]:
        """One line for each fault, in the order of the file."""
        lines = key_lines(self.text.replace("\r\n", "\n"))
        ordered = sorted(faults, key=lambda fault: (fault.kind == "more", self._number(fault.path, lines) or 0))
        return list(dict.fromkeys(one_line(self._line(fault, lines)) for fault in ordered))

    def _line(self, fault: Fault, lines: dict[Path, int]) -> str:
        """``file:line: table.key: what is wrong``, or the override in place of the line."""
        at, place = dotted(fault.path), fault.path[-1] if fault.path else ""
        said = f"value {place + 1}: {fault.said}" if isinstance(place, int) and fault.path[0] != "sweep" else fault.said
        for words in self.overrides:
            if fault.path[: len(words)] == words:
                return f"{self._named(at)}: {said}{self._cure(words) if fault.kind == 'foreign' else ''}"
        inside = [words for words in self.overrides if words[: len(fault.path)] == fault.path and fault.path]
        if inside and fault.kind in ("unknown", "renamed") and fault.path not in lines:
            return f"{self._named(dotted(inside[0]))}: {at} {said}"
        number = self._number(fault.path, lines)
        where = f"{self.file}:{number}" if number else self.file
        cure = self._cure(inside[0]) if inside and fault.kind == "exclusive" else ""
        return ": ".join(filter(None, (where, at, f"{said}{cure}")))

    def _named(self, key: str) -> str:
        """An override as it was given."""
        return f"{self.option} {key}" if self.option else f'overrides["{key}"]'

    def _cure(self, words: tuple[str, ...]) -> str:
        """How to replace a whole table, where one of its keys was set beside others of the file."""
        if len(words) < 2 or words[0] == "sweep":
            return ""
        value, table = self.overrides[words], dotted(words[:-1])
        written = shown(value) if isinstance(value, str | int | float) else "..."
        inline = f"'{table}={{ {words[-1]} = {written} }}'"
        given = f"{self.option} {inline}" if self.option else f'overrides={{"{table}": {{"{words[-1]}": {written}}}}}'
        return f"; replace the whole table by {given}"

    def _number(self, path: Path, lines: dict[Path, int]) -> int | None:
        """The line of the key, else of the nearest table above it that the file names."""
        apart = tuple(word for whole in path for word in (whole.split(".") if isinstance(whole, str) else [whole]))
        for wanted in (path, apart, tuple(word for word in path if isinstance(word, str))):
            for length in range(len(wanted), 1 if wanted[:1] == ("sweep",) else 0, -1):
                if wanted[:length] in lines:
                    return lines[wanted[:length]]
        return lines.get(path[:1])
