"""Files of a scenario: its TOML text, its origin, and the files that it names."""

import errno
import itertools
import json
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sim.units.errors import BadInput
from sim.units.tables import decoded, plain_text
from sim.units.terminal import one_line

_MOST_BYTES = 2**20

#: Cures of syntax faults, by the beginning of the parser's words.
_CURES = {
    "Expected newline": 'put a value with its unit in quotes, such as load = "4 mN"',
    "Invalid value": 'put text in quotes, such as model = "rate"',
    "Cannot": "a key or table appears twice; keep one",
    "Unescaped": "double the backslash or use single quotes",
    "Unterminated": "close the quotes",
    "Illegal character": "close the quotes on the same line",
    "Unclosed": "close the bracket and put commas between values",
}


def read_text(path: Path) -> str:
    """Return the text of a scenario file, which is UTF-8 and of at most 1 MiB."""
    try:
        if path.exists() and not (path.is_file() or path.is_fifo()):
            raise OSError(errno.EINVAL, "it is not a regular file")
        with path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except FileNotFoundError:
        raise _refusal(
            f"{path}: there is no such file; `sim new` writes a starter"
        ) from None
    except (OSError, ValueError) as fault:
        reason = getattr(fault, "strerror", None) or fault
        raise _refusal(f"{path}: cannot be read ({reason}); name a TOML file") from None
    if content.startswith((b"\x89HDF", b"CDF")):
        raise _refusal(
            f"{path}: is a dataset, not a scenario; name the TOML file that it came from"
        )
    if len(content) > _MOST_BYTES:
        raise _refusal(
            f"{path}: is larger than 1 MiB; put long tables into CSV files and name those"
        )
    try:
        return decoded(content)
    except UnicodeDecodeError:
        raise _refusal(f"{path}: is not UTF-8 text; save the file as UTF-8") from None


def parse(text: str, file: str) -> dict[str, Any]:
    """Return the document of a TOML text."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        cure = next(
            (
                f"; {cure}"
                for start, cure in _CURES.items()
                if str(fault).startswith(start)
            ),
            "",
        )
        raise _refusal(f"{file}: is not TOML: {fault}{cure}") from None
    except (RecursionError, ValueError):
        raise _refusal(
            f"{file}: is nested too deeply, or holds a number too long, to be a scenario"
        ) from None
    if not document:
        raise _refusal(f"{file}: is empty; `sim new` writes a starter scenario")
    return document


def toml(value: Any) -> str:
    """Return a value as TOML text.

    >>> print(toml({"model": "steady", "speeds": [1e-3, True]}))
    {"model" = "steady", "speeds" = [0.001, true]}
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {toml(inner)}' for key, inner in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return (
        json.dumps(value, ensure_ascii=False)
        if isinstance(value, str | bool)
        else str(value)
    )


def _refusal(problem: str) -> BadInput:
    return BadInput([one_line(problem)])


def written(document: dict[str, Any], table: tuple[str, ...] = ()) -> str:
    """Return a document as TOML text: the values of a table first, then the tables in it.

    >>> print(written({"name": "lens", "shear": {"cell": "1 mm", "amplitude": {"width": 0.3}}}), end="")
    name = "lens"
    <BLANKLINE>
    [shear]
    cell = "1 mm"
    <BLANKLINE>
    [shear.amplitude]
    width = 0.3
    """
    values = {
        key: value for key, value in document.items() if not isinstance(value, dict)
    }
    text = "".join(f"{_key(key)} = {toml(value)}\n" for key, value in values.items())
    if table and (values or not document):
        text = f"\n[{'.'.join(map(_key, table))}]\n{text}"
    return text + "".join(
        written(document[key], (*table, key)) for key in document if key not in values
    )


def _key(word: str) -> str:
    return (
        word
        if re.fullmatch(r"[A-Za-z0-9_-]+", word)
        else json.dumps(word, ensure_ascii=False)
    )


# Origin of a scenario: its text and the files it names.


@dataclass(frozen=True)
class Source:
    """Origin of a scenario: the file's text, what was changed on top, and every file it names.

    ``parts`` are those of the first scenario made from it, the one that text and overrides describe; ``notes`` are on
    what the overrides replaced.
    """

    path: str = ""
    text: str = ""
    overrides: dict[str, Any] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    parts: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def changed(self, values: dict[str, Any]) -> "Source":
        """Return the source with more overrides; they replace those of keys inside their own keys."""
        inside = tuple(f"{key}." for key in values)
        others = {
            key: value
            for key, value in self.overrides.items()
            if not key.startswith(inside)
        }
        return Source(self.path, self.text, others | values, self.files)


@dataclass(frozen=True)
class Files:
    """Files that a scenario names, relative to its own folder, and the text of each that was read."""

    folder: Path
    texts: dict[str, str] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """Return the path of a file."""
        return self.folder / name

    def text(self, name: str) -> str:
        """Return the text of a file, which the dataset keeps as its provenance."""
        if name not in self.texts:
            self.texts[name] = plain_text(self.path(name))
        return self.texts[name]


def question_of(text: str, made: str = "\n\n") -> tuple[str, list[str]]:
    """Return the question of a scenario's file and the lines of its first comment from a word ``made`` on.

    The question is the first paragraph of the comment. Lines for editors are no part of it.
    """
    comment = itertools.takewhile(lambda line: line.startswith("#"), text.splitlines())
    lines = [line[1:].strip() for line in comment if not line.startswith("#:")]
    before, made, after = "\n".join(lines).partition(made)
    question = " ".join(before.strip().partition("\n\n")[0].split())
    return question, (made + after).splitlines()
