"""Faults of a scenario in words: the path of the key, the fault, and one cure."""

import contextlib
import difflib
import functools
import re
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails
from pydantic_core.core_schema import ErrorType

from sim.scenario.schema import (
    all_tables,
    declaration,
    keys,
    model,
    tables,
    with_models,
)
from sim.units.errors import BadInput
from sim.units.terminal import one_line

Path = tuple[str | int, ...]
T = TypeVar("T")

_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_MISSING = ("missing", "missing_argument")
_NO_TABLE = (
    "dataclass_type",
    "dataclass_exact_type",
    "model_attributes_type",
    "dict_type",
    "union_tag_not_found",
)
#: Faults by their names in pydantic, in our words; any other of pydantic's is one.
_IN_OUR_WORDS = {
    "string_type": "must be text in quotes",
    "string_too_long": "must have at most {max_length} letters",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "tuple_type": "must be a list in square brackets",
}
_UNUSABLE = dict.fromkeys(
    get_args(ErrorType), "has a value of a kind that it cannot have"
)
#: Keys that earlier versions had, with the cure.
_GONE = {
    "mode_amplitudes": 'is not a key any more; remove it (model = "mean" has an energy that does not fluctuate)',
}
#: Faults that are reported at once.
_MOST = 100
_PLAIN_KEY = re.compile(r"[A-Za-z0-9_-]+")


class Fault(NamedTuple):
    """A fault of the key at ``path``; ``meant`` is the path of the key that was probably meant."""

    path: Path
    message: str
    meant: Path = ()


class _Place(NamedTuple):
    """A place in a scenario: its path and declaration, and the tables that it admits by the name of their model."""

    path: Path
    field: FieldInfo | None
    admitted: dict[str, type]
    chosen: dict[str, type]

    @property
    def keys(self) -> dict[str, FieldInfo]:
        return {
            key: field
            for table in self.chosen.values()
            for key, field in keys(table).items()
        }


def dotted(path: Path) -> str:
    """Return a path as it is written in a file, without places in lists."""
    words = [
        word if _PLAIN_KEY.fullmatch(word) else f'"{word}"'
        for word in path
        if isinstance(word, str)
    ]
    return ".".join(word[:60] for word in words)


def faults(root: type, invalid: ValidationError) -> list[Fault]:
    """Return the errors that pydantic reports as faults, one for each path.

    A key that is missing because it was misspelt is no fault of its own.
    """
    errors = invalid.errors(include_url=False)
    result = [_fault(root, error) for error in errors[:_MOST]]
    misspelt = {fault.meant for fault in result}
    result = [
        fault
        for fault in result
        if not (fault.path in misspelt and fault.message.startswith("is missing"))
    ]
    if len(errors) > _MOST:
        result.append(Fault((), f"and {len(errors) - _MOST:,} faults more"))
    return list({fault.path: fault for fault in reversed(result)}.values())[::-1]


def problems(
    faults: Iterable[Fault],
    file: str = "",
    overrides: Iterable[Path] = (),
    option: str = "",
) -> list[str]:
    """Return a line for each fault: the file or the override that caused it, the key, the fault.

    ``option`` is the option of a command that gave the overrides; without it they are an argument.
    """
    lines = []
    for fault in faults:
        length = len(fault.path)
        cause = next(
            (
                words
                for words in overrides
                if length and words[:length] == fault.path[: len(words)]
            ),
            None,
        )
        origin, key = file, dotted(fault.path)
        if cause is not None:
            changed = dotted(cause)
            origin = f"{option} {changed}" if option else f'overrides["{changed}"]'
            key = "" if key == changed else key
        lines.append(one_line(": ".join(filter(None, (origin, key, fault.message)))))
    return list(dict.fromkeys(lines))


@contextlib.contextmanager
def in_plain_words(root: type) -> Iterator[None]:
    """Raise errors of pydantic as ``BadInput``."""
    try:
        yield
    except ValidationError as invalid:
        raise BadInput(problems(faults(root, invalid))) from None


def plain_spoken(cls: type[T]) -> type[T]:
    """Let a class of a scenario's tables raise ``BadInput`` for values that cannot be used."""
    initialize: Callable[..., None] = cls.__init__

    @functools.wraps(initialize)
    def init(self: T, *args: Any, **values: Any) -> None:
        with in_plain_words(cls):
            initialize(self, *args, **with_models(cls, values))

    cls.__init__ = init  # type: ignore[method-assign, assignment]
    return cls


def _place(root: type, location: Path) -> _Place:
    """Return the place of pydantic's location, which also holds the names of chosen models."""
    place = _Place((), None, {"": root}, {"": root})
    for word in location:
        if len(place.chosen) > 1 and word in place.chosen:
            place = place._replace(chosen={str(word): place.chosen[str(word)]})
        elif isinstance(word, int):
            place = place._replace(path=(*place.path, word))
        elif word in place.keys or "[" not in word:
            field = place.keys.get(word)
            place = _Place((*place.path, word), field, _inner(field), _inner(field))
    return place


def _fault(root: type, error: ErrorDetails) -> Fault:
    """Return the fault of one error."""
    kind, place = error["type"], _place(root, error["loc"])
    if kind in _UNKNOWN:
        return _unknown(root, _place(root, error["loc"][:-1]), str(error["loc"][-1]))
    if kind in _MISSING:
        return _missing(place)
    if kind == "union_tag_invalid" or (
        kind == "union_tag_not_found" and isinstance(error["input"], dict)
    ):
        models = [name for option in place.admitted.values() if (name := model(option))]
        return Fault(
            (*place.path, "model"), _choice(error["input"].get("model"), models)
        )
    if kind == "literal_error":
        return Fault(
            place.path,
            _choice(error["input"], re.findall(r"'([^']*)'", error["ctx"]["expected"])),
        )
    if kind in _NO_TABLE:
        return Fault(
            place.path,
            f"must be a table; write [{dotted(place.path)}] and its keys below",
        )
    last = place.path[-1] if place.path else ""
    value = f"value {last + 1}: " if isinstance(last, int) else ""
    words = (_UNUSABLE | _IN_OUR_WORDS).get(kind)
    text = words.format(**error.get("ctx", {})) if words else error["msg"]
    return Fault(place.path, value + text)


def _unknown(root: type, table: _Place, key: str) -> Fault:
    """Return the fault of a key that its table does not have."""
    path = (*table.path, key)
    if key in _GONE:
        return Fault(path, _GONE[key])
    chosen = {model(option) for option in table.chosen.values()}
    others = [
        name
        for kind in table.admitted.values()
        if key in keys(kind) and (name := model(kind)) not in chosen
    ]
    if others and len(chosen) == 1:
        return Fault(
            path,
            f"is not a key of this model; remove it, or choose model = {_either(others)}",
        )
    if near := difflib.get_close_matches(key, table.keys, 1):
        return Fault(
            path, f'is not a key; did you mean "{near[0]}"?', (*table.path, near[0])
        )
    elsewhere = [
        above
        for above, field in all_tables(root)
        if any(key in keys(t) for t in _inner(field).values())
    ]
    # zeros and readings have the names of what they are zeros and readings of
    readings = ("zero",), ("jump_in",)
    elsewhere = [above for above in elsewhere if above not in readings] or elsewhere
    if len(elsewhere) == 1:
        return Fault(
            path,
            f'is not a key here; did you mean "{dotted((*elsewhere[0], key))}"?',
            (*elsewhere[0], key),
        )
    return Fault(path, f"is not a key; known: {', '.join(table.keys)}")


def _missing(place: _Place) -> Fault:
    """Return the fault of a key that is missing, with an example of it."""
    name = place.path[-1]
    quantity = place.field and declaration(place.field)
    if quantity is not None:
        return Fault(
            place.path, f"is missing; add for example {name} = {quantity.example}"
        )
    if not place.admitted:
        return Fault(place.path, f'is missing; add for example {name} = "..."')
    choice = (
        f" with model = {_either(map(model, place.admitted.values()))}"
        if len(place.admitted) > 1
        else ""
    )
    return Fault(
        place.path, f"is missing; add the table [{dotted(place.path)}]{choice}"
    )


def _inner(field: FieldInfo | None) -> dict[str, type]:
    """Return the tables that a key admits."""
    return tables(field.annotation) if field else {}


def _choice(word: Any, options: Iterable[str]) -> str:
    """Return the words that may stand in place of a word: those that begin with it, else the nearest one, else all."""
    options = [*options]
    if not isinstance(word, str):
        return f"must be {_either(options)}"
    near = [option for option in options if option.startswith(word)] if word else []
    near = near or difflib.get_close_matches(word, options, 1)
    if not near:
        return f"must be {_either(options)}"
    return f'"{word}" is not known; did you mean {_either(near)}?'


def _either(names: Iterable[str | None]) -> str:
    """Return names as alternatives."""
    *first, last = dict.fromkeys(f'"{name}"' for name in names)
    return f"{', '.join(first)} or {last}" if first else last
