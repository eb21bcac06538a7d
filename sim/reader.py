"""From a TOML file to a scenario. Every fault in one pass, each with file, line, key and cure."""

import difflib
import re
import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import PydanticCustomError

from sim.scenario import Scenario, Source, read_sweep, set_key

_KEY = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
_HEADER = re.compile(rf"\s*\[\[?\s*({_KEY}(?:\s*\.\s*{_KEY})*)\s*\]\]?")
_ASSIGNMENT = re.compile(rf"\s*({_KEY}(?:\s*\.\s*{_KEY})*)\s*=")
_MOST_BYTES = 2**20


class BadInput(ValueError):
    """A scenario that cannot be used; ``problems`` holds one line for each fault."""

    def __init__(self, problems: list[str]):
        super().__init__("\n".join(problems))
        self.problems = problems


@dataclass(frozen=True)
class Files:
    """The files that a scenario names, relative to its own folder; remembers the text of each."""

    folder: Path
    texts: dict[str, str] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """Where the file is."""
        return self.folder / name

    def text(self, name: str) -> str:
        """The file's text, kept for the dataset's provenance."""
        self.texts[name] = self.path(name).read_text(encoding="utf-8")
        return self.texts[name]


def load(path: str | Path, overrides: dict[str, Any] | None = None) -> Scenario:
    """Read a scenario from a TOML file.

    Parameters
    ----------
    path : path
        The file.
    overrides : dict, optional
        Values by dotted key that replace those of the file, ``{"contact.load": "2 mN"}``.

    Returns
    -------
    Scenario
        Checked throughout, every point of its sweep included.

    Raises
    ------
    BadInput
        With every fault of the file: one syntax fault, or all faults of its values.
    """
    overrides = dict(overrides or {})
    text = _text(Path(path))
    document = _parse(text, str(path))
    for key, value in overrides.items():
        set_key(document, key, value)
    return _validated(document, _Place(str(path), text, frozenset(overrides)), overrides, Path(path).parent)


def _validated(document: dict[str, Any], place: "_Place", overrides: dict[str, Any], folder: Path) -> Scenario:
    files = Files(folder)
    sweep = document.pop("sweep", ())
    document.pop("source", None) if isinstance(document.get("source"), Source) else None
    problems: list[str] = []
    try:
        scenario = TypeAdapter(Scenario).validate_python(document, context={"files": files})
    except ValidationError as faults:
        problems += [place.problem(fault, document) for fault in faults.errors(include_url=False)]
        scenario = None
    try:
        axes = read_sweep(sweep) if sweep != () else ()
    except PydanticCustomError as fault:
        raise BadInput([*problems, place.line(("sweep",), fault.message())]) from None
    if scenario is None:
        raise BadInput(list(dict.fromkeys(problems)))
    source = Source(place.file, place.text, overrides, files.texts)
    scenario = replace(scenario, sweep=axes, source=source)
    _check_points(scenario, axes, place)
    return scenario


def _check_points(scenario: Scenario, axes: tuple, place: "_Place") -> None:
    """Each swept value on its own, then all points, so that every bad value is named once."""
    problems: list[str] = []
    for axis in axes:
        for row in axis.values:
            values = dict(zip(axis.keys, row, strict=True))
            try:
                scenario.with_values(values)
            except ValidationError as faults:
                shown = ", ".join(f"{key} = {value!r:.60}" for key, value in values.items())
                for fault in faults.errors(include_url=False):
                    said = place.said(fault, {})
                    problems.append(place.line(("sweep",), f"at {shown}: {_dotted(fault['loc'])}{said}", axis.keys[0]))
            except (TypeError, AttributeError, RecursionError):
                problems.append(place.line(("sweep",), f"{axis.keys[0]} cannot be swept", axis.keys[0]))
    if problems:
        raise BadInput(list(dict.fromkeys(problems)))
    try:
        scenario.points()
    except ValidationError as faults:
        raise BadInput(
            [place.line(("sweep",), f"values together: {_dotted(f['loc'])}{f['msg']}") for f in faults.errors()]
        ) from None


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise BadInput([f"{path}: is larger than 1 MiB; that is no scenario"])
        content = path.read_bytes()
    except FileNotFoundError:
        raise BadInput([f"{path}: there is no such file; `sim new {path}` writes a starter"]) from None
    except OSError as trouble:
        raise BadInput([f"{path}: cannot be read: {trouble.strerror}"]) from None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = content[: fault.start].count(b"\n") + 1
        raise BadInput([f"{path}:{line}: is not UTF-8 text; save the file as UTF-8"]) from None


def _parse(text: str, file: str) -> dict[str, Any]:
    try:
        document = tomllib.loads(text.replace("\r\n", "\n"))
    except tomllib.TOMLDecodeError as fault:
        found = re.search(r"\(at line (\d+), column \d+\)", str(fault))
        line = int(found[1]) if found else text.count("\n") + 1
        said = re.sub(r"\s*\(at .*\)$", "", str(fault))
        raise BadInput([f"{file}:{line}: is not TOML: {said}"]) from None
    except RecursionError:
        raise BadInput([f"{file}: is nested too deeply to be a scenario"]) from None
    except ValueError as fault:  # an integer of more digits than Python reads, an impossible date
        raise BadInput([f"{file}: holds a value that cannot be read: {str(fault).partition(';')[0]}"]) from None
    if not document:
        raise BadInput([f"{file}: is empty; `sim new` writes a starter scenario"])
    return document


def _dotted(location: tuple) -> str:
    words = [str(word) for word in location if not isinstance(word, int)]
    return ".".join(words) + ": " if words else ""


@dataclass(frozen=True)
class _Place:
    """Finds the line of a key in a TOML text, and words a fault there."""

    file: str
    text: str
    overridden: frozenset[str]

    def line(self, location: tuple, said: str, key: str = "") -> str:
        """``file:line: table.key: what is wrong``, or --set in place of the line for an override."""
        dotted = ".".join(str(word) for word in location) + (f'."{key}"' if key else "")
        if any(dotted == name or dotted.startswith(f"{name}.") for name in self.overridden):
            return f"--set {dotted}: {said}"
        number = self._number((*location, key) if key else location)
        where = f"{self.file}:{number}" if number else self.file
        return f"{where}: {dotted}: {said}" if dotted else f"{where}: {said}"

    def problem(self, fault: Any, document: dict[str, Any]) -> str:
        """One line for one fault of pydantic's."""
        location = _without_tags(fault["loc"], document)
        return self.line(location, self.said(fault, document))

    def said(self, fault: Any, document: dict[str, Any]) -> str:
        """What is wrong and the cure."""
        kind, context = fault["type"], fault.get("ctx", {})
        if kind in ("extra_forbidden", "unexpected_keyword_argument"):
            known = _known_keys(fault["loc"][:-1])
            near = difflib.get_close_matches(str(fault["loc"][-1]), known, 1, 0.5)
            return f'is not a key; did you mean "{near[0]}"?' if near else f"is not a key; known: {', '.join(known)}"
        if kind in ("missing", "missing_argument"):
            return "is missing"
        if kind == "union_tag_not_found":
            return (
                f"needs a model, one of {context['expected_tags']}" if "expected_tags" in context else "needs a model"
            )
        if kind == "union_tag_invalid":
            known = re.findall(r"'([^']*)'", context["expected_tags"])
            near = difflib.get_close_matches(str(context["tag"]), known, 1, 0.4)
            hint = f'did you mean "{near[0]}"?' if near else f"known: {', '.join(known)}"
            return f'has no model "{str(context["tag"])[:40]}"; {hint}'
        if kind == "literal_error":
            return f"must be one of {context['expected']}"
        if kind in ("dataclass_type", "dataclass_exact_type", "model_attributes_type"):
            return "must be a table"
        message = fault["msg"].removeprefix("Input ").removeprefix("Value error, ")
        return message[:1].lower() + message[1:] if message[:6] == "Should" else message

    def _number(self, location: tuple) -> int | None:
        """The line of the key, else of the nearest table above it that the file names."""
        lines = self._lines()
        words = tuple(str(word) for word in location if not isinstance(word, int))
        for length in range(len(words), 0, -1):
            if words[:length] in lines:
                return lines[words[:length]]
        return None

    def _lines(self) -> dict[tuple[str, ...], int]:
        found: dict[tuple[str, ...], int] = {}
        table: tuple[str, ...] = ()
        for number, line in enumerate(self.text.splitlines(), 1):
            header, assignment = _HEADER.match(line), _ASSIGNMENT.match(line)
            if header:
                table = _words(header[1])
                found.setdefault(table, number)
                rest, assignment = line[header.end() :], _ASSIGNMENT.match(line[header.end() :])
                line = rest
            if assignment:
                key = table + _words(assignment[1])
                found.setdefault(key, number)
                for inner in re.finditer(rf"[{{,]\s*({_KEY})\s*=", line):
                    found.setdefault(key + _words(inner[1]), number)
        return found


def _words(key: str) -> tuple[str, ...]:
    return tuple(word.strip().strip("\"'") for word in re.findall(_KEY, key))


def _without_tags(location: tuple, document: Any) -> tuple:
    """A pydantic location without the tags of unions and the numbers of list items: the key's own path."""
    path: list[Any] = []
    inside = document
    for index, word in enumerate(location):
        if isinstance(inside, dict) and word not in inside and inside.get("model") == word and index < len(location):
            continue
        if isinstance(word, int):
            continue
        if isinstance(word, str) and re.search(r"[\[\](]", word):
            continue
        path.append(word)
        inside = inside.get(word) if isinstance(inside, dict) else None
    return tuple(path)


def _known_keys(location: tuple) -> list[str]:
    """Keys of the table at a pydantic location, by walking the JSON schema."""
    schema = scenario_schema()
    node: Any = schema
    for word in location:
        if isinstance(word, int):
            continue
        node = _inner(schema, node, word)
    node = _resolved(schema, node)
    return [key for key in node.get("properties", {}) if key != "source"]


def _resolved(schema: dict[str, Any], node: Any) -> dict[str, Any]:
    while isinstance(node, dict) and "$ref" in node:
        node = schema["$defs"][node["$ref"].rsplit("/", 1)[-1]]
    return node if isinstance(node, dict) else {}


def _inner(schema: dict[str, Any], node: Any, word: Any) -> Any:
    node = _resolved(schema, node)
    if word in node.get("properties", {}):
        return node["properties"][word]
    for option in node.get("oneOf", []) + node.get("anyOf", []):
        inside = _resolved(schema, option)
        tag = inside.get("properties", {}).get("model", {}).get("const")
        if word == tag:
            return inside
        if word in inside.get("properties", {}):
            return inside["properties"][word]
    return node


def scenario_schema() -> dict[str, Any]:
    """The JSON schema of a scenario file."""
    schema = TypeAdapter(Scenario).json_schema(by_alias=True, mode="validation")
    schema["properties"].pop("source", None)
    schema["title"] = "sim scenario"
    schema["properties"]["sweep"] = {
        "description": "keys with lists of values (outer product), or a list of tables (zipped)",
        "anyOf": [{"type": "object"}, {"type": "array", "items": {"type": "object"}}],
    }
    return schema
