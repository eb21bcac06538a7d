"""From a TOML file to its document, and from faults in it to lines with file, line, key and cure."""

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim.scenario.messages import Fault, dotted, shown
from sim.scenario.toml_lines import deep_line, key_lines

_MOST_BYTES = 2**20
_DEEPEST = 16
_LARGEST_INTEGER = 2**1000
# A dotted key of this many words takes the TOML parser a time that grows with their square.
_LONG_KEY = re.compile(r"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){40}")

_CURES = (
    ("Expected newline or end of document", 'put a value with its unit in quotes, such as load = "4 mN"'),
    ("Invalid value", 'put text in quotes, such as model = "rate"'),
    ("Cannot overwrite a value", "the key is there twice, so keep one"),
    ("Cannot declare", "the table is there twice, so merge both"),
    ("Expected '='", "write key = value, or [table]"),
    ("Invalid statement", "write key = value, or [table]"),
    ("Invalid initial character for a key", "write key = value, or [table]"),
    ("Expected ']", "close the bracket"),
    ("Unclosed array", "close its bracket ] and put commas between values"),
    ("Unclosed inline table", "close its brace } on the same line and put commas between keys"),
    ("Unterminated string", "close its quotes"),
    ('Expected "\'"', "close its quotes"),
    ("Illegal character '\\n'", "close the quotes on the same line"),
    ("Unescaped '\\'", "double the backslash or use single quotes"),
)

Words = tuple[str | int, ...]


class BadInput(ValueError):
    """A scenario that cannot be used; ``problems`` holds one line for each fault."""

    def __init__(self, problems: list[str]):
        super().__init__("\n".join(problems))
        self.problems = problems


def read_text(path: Path) -> str:
    try:
        with path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except FileNotFoundError:
        raise BadInput([_one_line(f"{path}: there is no such file; `sim new` writes a starter")]) from None
    except (OSError, ValueError) as trouble:
        reason = getattr(trouble, "strerror", None) or str(trouble)
        raise BadInput([_one_line(f"{path}: cannot be read ({reason}); name a TOML file")]) from None
    if len(content) > _MOST_BYTES:
        raise BadInput([_one_line(f"{path}: is larger than 1 MiB; put long tables into CSV files and name those")])
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = content[: fault.start].count(b"\n") + 1
        raise BadInput([_one_line(f"{path}:{line}: is not UTF-8 text; save the file as UTF-8")]) from None


def parse(text: str, file: str) -> dict[str, Any]:
    """The document of a TOML text; a syntax fault with its line."""
    text = text.replace("\r\n", "\n")
    long_key = _LONG_KEY.search(text)
    if long_key:
        line = text.count("\n", 0, long_key.start()) + 1
        raise BadInput([_one_line(f"{file}:{line}: has a key of 40 words or more; a scenario needs four at most")])
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(fault))
        line = int(found[1]) if found else text.count("\n") + 1
        raise BadInput([_one_line(f"{file}:{line}: is not TOML: {_syntax(str(fault))}")]) from None
    except RecursionError:
        line = deep_line(text, _DEEPEST)
        raise BadInput(
            [_one_line(f"{file}:{line}: is nested too deeply; a scenario nests four deep at most")]
        ) from None
    except ValueError:  # an integer of more digits than Python reads
        found = re.search(r"[\d_]{4000,}", text)
        line = text.count("\n", 0, found.start()) + 1 if found else 1
        raise BadInput([_one_line(f"{file}:{line}: holds a number of thousands of digits; shorten it")]) from None
    if not document:
        raise BadInput([_one_line(f"{file}: is empty; `sim new` writes a starter scenario")])
    return document


def _syntax(said: str) -> str:
    """A fault of the TOML parser's with a cure."""
    said = re.sub(r"\s*\(at .*\)$", "", said)
    cure = next((cure for start, cure in _CURES if said.startswith(start)), "")
    said = re.sub(r"\('(.*)',?\)", lambda path: path[1].replace("', '", "."), said)
    return f"{said[:1].lower()}{said[1:]}" + (f"; {cure}" if cure else "")


def words_of(key: str) -> Words:
    """The words of a dotted key, of which some may be quoted."""
    words: list[str] = []
    try:
        inside = tomllib.loads(f"{key} = 0")
        while isinstance(inside, dict) and len(inside) == 1:
            ((word, inside),) = inside.items()
            words.append(word)
    except (ValueError, RecursionError):
        return tuple(key.split("."))
    return tuple(words) if inside == 0 else (key,)


def put(document: dict[str, Any], overrides: dict[Words, Any]) -> list[Fault]:
    """Set the overrides in the document; faults of those that find no table."""
    faults = []
    for words, value in overrides.items():
        table: Any = document
        for word in words[:-1]:
            table = table.setdefault(word, {})
            if not isinstance(table, dict):
                faults.append(Fault(words, f'needs a table, but "{word}" is {shown(table)} in the file'))
                break
        else:
            table[words[-1]] = value
    return faults


def monsters(document: dict[str, Any]) -> list[Fault]:
    """Values that no scenario holds and that would choke the checks: nested deeply, or of thousands of digits."""
    found: list[tuple[Words, Any]] = [((), document)]
    while found:
        path, value = found.pop()
        if len(path) > _DEEPEST:
            return [
                Fault(
                    tuple(str(word) for word in path[:4] if isinstance(word, str)),
                    "is nested too deeply; a scenario nests four deep at most",
                )
            ]
        if isinstance(value, int) and abs(value) > _LARGEST_INTEGER:
            return [Fault(path, "is a number of hundreds of digits; shorten it")]
        if isinstance(value, dict):
            found += [((*path, key), inner) for key, inner in value.items()]
        elif isinstance(value, list):
            found += [((*path, place), inner) for place, inner in enumerate(value)]
    return []


@dataclass(frozen=True)
class Place:
    """Finds the line of a key in a TOML text, and words a fault there."""

    file: str
    text: str
    overrides: dict[Words, Any]

    def problems(self, faults: list[Fault]) -> list[str]:
        """One line for each fault, in the order of the file."""
        lines = key_lines(self.text.replace("\r\n", "\n"))
        numbered = [(self._number(fault.path, lines), fault) for fault in faults]
        numbered.sort(key=lambda pair: pair[0] or 0)
        return list(dict.fromkeys(_one_line(self._line(number, fault)) for number, fault in numbered))

    def _line(self, number: int | None, fault: Fault) -> str:
        """``file:line: table.key: what is wrong``, or --set in place of the line for an override."""
        at, place = dotted(fault.path), fault.path[-1] if fault.path else ""
        said = f"value {place + 1}: {fault.said}" if isinstance(place, int) and fault.path[0] != "sweep" else fault.said
        for words in self.overrides:
            if fault.path[: len(words)] == words:
                return f"--set {at}: {said}{self._cure(words) if fault.kind == 'foreign' else ''}"
        inside = [words for words in self.overrides if words[: len(fault.path)] == fault.path and fault.path]
        if inside and fault.kind == "unknown" and not number:
            return f"--set {dotted(inside[0])}: {at} {said}"
        where = f"{self.file}:{number}" if number else self.file
        cure = self._cure(inside[0]) if inside and fault.kind == "exclusive" else ""
        return f"{where}: {at}: {said}{cure}" if at else f"{where}: {said}{cure}"

    def _cure(self, words: Words) -> str:
        """How to replace a whole table, where one of its keys was set beside others of the file."""
        if len(words) < 2 or words[0] == "sweep":
            return ""
        value = self.overrides[words]
        written = shown(value) if isinstance(value, str | int | float) else "..."
        return f"; replace the whole table by --set '{dotted(words[:-1])}={{ {words[-1]} = {written} }}'"

    def _number(self, path: Words, lines: dict[Words, int]) -> int | None:
        """The line of the key, else of the nearest table above it that the file names."""
        apart = tuple(word for whole in path for word in (whole.split(".") if isinstance(whole, str) else [whole]))
        for wanted in (path, apart, tuple(word for word in path if isinstance(word, str))):
            for length in range(len(wanted), 1 if wanted[:1] == ("sweep",) else 0, -1):
                if wanted[:length] in lines:
                    return lines[wanted[:length]]
        return lines.get(path[:1])


def _one_line(problem: str) -> str:
    """A problem on one line that no terminal takes for a command."""
    return "".join(c if c.isprintable() else "?" if c.isspace() else repr(c)[1:-1] for c in problem)
