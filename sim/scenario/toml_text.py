"""From a TOML file to its document, and overrides on top of it."""

import errno
import json
import re
import tomllib
from pathlib import Path
from typing import Any

from sim.units.errors import BadInput
from sim.units.terminal import one_line

_MOST_BYTES = 2**20

#: Cures of syntax faults, by the beginning of the parser's words.
_CURES = {
    "Expected newline": 'put a value with its unit in quotes, such as load = "4 mN"',
    "Invalid value": 'put text in quotes, such as model = "rate"',
    "Cannot": "a key or table is there twice, so keep one",
    "Unescaped": "double the backslash or use single quotes",
    "Unterminated": "close the quotes",
    "Illegal character": "close the quotes on the same line",
    "Unclosed": "close the bracket and put commas between values",
}


def read_text(path: Path) -> str:
    """Return the text of a scenario file, which is UTF-8 and of at most 1 MiB."""
    try:
        if path.exists() and not (path.is_file() or path.is_fifo()):
            raise OSError(errno.EINVAL, "it is no plain file")
        with path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except FileNotFoundError:
        raise _refusal(f"{path}: there is no such file; `sim new` writes a starter") from None
    except (OSError, ValueError) as fault:
        raise _refusal(
            f"{path}: cannot be read ({getattr(fault, 'strerror', None) or fault}); name a TOML file"
        ) from None
    if content.startswith((b"\x89HDF", b"CDF")):
        raise _refusal(f"{path}: is a dataset, not a scenario; name the TOML file that it came from")
    if len(content) > _MOST_BYTES:
        raise _refusal(f"{path}: is larger than 1 MiB; put long tables into CSV files and name those")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise _refusal(f"{path}: is not UTF-8 text; save the file as UTF-8") from None


def parse(text: str, file: str) -> dict[str, Any]:
    """Return the document of a TOML text."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as fault:
        cure = next((f"; {cure}" for start, cure in _CURES.items() if str(fault).startswith(start)), "")
        raise _refusal(f"{file}: is not TOML: {fault}{cure}") from None
    except (RecursionError, ValueError):
        raise _refusal(f"{file}: is nested too deeply, or holds a number too long, to be a scenario") from None
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
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str | bool) else str(value)


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
    values = {key: value for key, value in document.items() if not isinstance(value, dict)}
    text = "".join(f"{_key(key)} = {toml(value)}\n" for key, value in values.items())
    if table and (values or not document):
        text = f"\n[{'.'.join(map(_key, table))}]\n{text}"
    return text + "".join(written(document[key], (*table, key)) for key in document if key not in values)


def _key(word: str) -> str:
    return word if re.fullmatch(r"[A-Za-z0-9_-]+", word) else json.dumps(word, ensure_ascii=False)
