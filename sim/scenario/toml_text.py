"""From a TOML file to its document, and overrides on top of it."""

import errno
import json
import os
import re
import stat
import tomllib
from pathlib import Path
from typing import Any

from sim.scenario.messages import Fault, shown
from sim.units.refusals import BadInput
from sim.units.terminal import one_line

_MOST_BYTES = 2**20

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


def read_text(path: Path) -> str:
    """The text of a scenario file, which is UTF-8 and of at most 1 MiB."""
    try:
        with path.open("rb") as file:
            found = os.fstat(file.fileno())
            if stat.S_ISCHR(found.st_mode) or stat.S_ISBLK(found.st_mode):
                raise OSError(errno.EINVAL, "it is a device")
            plain = stat.S_ISREG(found.st_mode)  # and not a pipe: one without a size, as in /proc, may wait for ever
            content = file.read(min(found.st_size, _MOST_BYTES + 1) if plain else _MOST_BYTES + 1)
    except FileNotFoundError:
        raise _refusal(f"{path}: there is no such file; `sim new` writes a starter") from None
    except (OSError, ValueError) as trouble:
        reason = getattr(trouble, "strerror", None) or str(trouble)
        raise _refusal(f"{path}: cannot be read ({reason}); name a TOML file") from None
    if content.startswith((b"\x89HDF", b"CDF")):
        raise _refusal(f"{path}: is a dataset, not a scenario; name the TOML file that it came from")
    if len(content) > _MOST_BYTES:
        raise _refusal(f"{path}: is larger than 1 MiB; put long tables into CSV files and name those")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as fault:
        line = content[: fault.start].count(b"\n") + 1
        raise _refusal(f"{path}:{line}: is not UTF-8 text; save the file as UTF-8") from None


def parse(text: str, file: str) -> dict[str, Any]:
    """The document of a TOML text; a syntax fault with its line."""
    text = text.replace("\r\n", "\n")
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        found = re.search(r"\(at line (\d+), column (\d+)\)", str(fault))
        line = int(found[1]) if found else text.count("\n") + 1
        raise _refusal(f"{file}:{line}: is not TOML: {_syntax(str(fault))}") from None
    except (RecursionError, ValueError):
        said = "is nested too deeply, or holds a number too long, to be a scenario; a scenario nests four deep at most"
        raise _refusal(f"{file}: {said}") from None
    if not document:
        raise _refusal(f"{file}: is empty; `sim new` writes a starter scenario")
    return document


def toml(value: Any) -> str:
    """A value as TOML has it.

    >>> print(toml({"model": "steady", "speeds": [1e-3, True]}))
    {"model" = "steady", "speeds" = [0.001, true]}
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)} = {toml(inner)}' for key, inner in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else str(value)


def _refusal(problem: str) -> BadInput:
    return BadInput([one_line(problem)])


def _syntax(said: str) -> str:
    """A fault of the TOML parser's with a cure."""
    said = re.sub(r"\s*\(at .*\)$", "", said)
    cure = next((cure for start, cure in _CURES if said.startswith(start)), "")
    said = re.sub(r"\('(.*)',?\)", lambda path: path[1].replace("', '", "."), said)
    return f"{said[:1].lower()}{said[1:]}" + (f"; {cure}" if cure else "")


def put(document: dict[str, Any], overrides: dict[tuple[str, ...], Any]) -> list[Fault]:
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


def written(document: dict[str, Any], table: tuple[str, ...] = ()) -> str:
    """A document as TOML text: the values of a table first, then the tables in it.

    >>> print(written({"name": "lens", "shear": {"cell": "1 mm", "amplitude": {"width": 0.3}}}), end="")
    name = "lens"
    <BLANKLINE>
    [shear]
    cell = "1 mm"
    <BLANKLINE>
    [shear.amplitude]
    width = 0.3
    """
    values = {key: value for key, value in document.items() if not isinstance(value, dict)}
    text = "".join(f"{_key(key)} = {toml(value)}\n" for key, value in values.items())
    if table and (values or not document):
        text = f"\n[{'.'.join(map(_key, table))}]\n{text}"
    return text + "".join(written(document[key], (*table, key)) for key in document if key not in values)


def _key(word: str) -> str:
    return word if re.fullmatch(r"[A-Za-z0-9_-]+", word) else json.dumps(word, ensure_ascii=False)
