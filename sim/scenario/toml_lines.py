"""The line of each key of a TOML text, found by a scan of its lines."""

import re
import tomllib

Path = tuple[str | int, ...]

_WORD = r"""(?:[\w-]+|"(?:\\.|[^"\\\n])*"|'[^'\n]*')"""
_KEY = rf"{_WORD}(?:[ \t]*\.[ \t]*{_WORD})*"
_HEADER = re.compile(rf"[ \t]*(\[\[?)[ \t]*({_KEY})[ \t]*\]")
_ASSIGNMENT = re.compile(rf"[ \t]*({_KEY})[ \t]*=")
_TEXT = re.compile(
    r'(?P<long>"{3}(?:\\.|[^\\])*?"{3,5}' r"|'{3}.*?'{3,5})" r'|"(?:\\.|[^"\\\n])*"' r"|'[^'\n]*'|\#[^\n]*", re.DOTALL
)


def key_lines(text: str) -> dict[Path, int]:
    """The line of every table and key that begins a line of a valid TOML text.

    Parameters
    ----------
    text : str
        A text that ``tomllib`` has accepted.

    Returns
    -------
    dict of tuple to int
        Line, counted from 1, by the path of keys; the place of a ``[[table]]`` is an int in the path. Keys of inline
        tables and items of lists are not there: they stand on the line of their key, or below it.

    Examples
    --------
    >>> key_lines('[shear]\\ncorrelation = { model = "slip" }\\n')
    {('shear',): 1, ('shear', 'correlation'): 2}
    """
    lines: dict[Path, int] = {}
    last: dict[Path, int] = {}  # the place of the last table of each [[name]]
    table: Path = ()
    plain = _TEXT.sub(lambda part: "\n" * part[0].count("\n") if part["long"] else part[0], text)
    depth = 0  # brackets open at the start of a line: what stands in them is a value
    for number, line in enumerate(plain.split("\n"), start=1):
        inside, bare = depth > 0, _TEXT.sub("", line)
        depth += sum((mark in "[{") - (mark in "]}") for mark in bare)
        if inside:
            continue
        if header := _HEADER.match(line):
            table = ()
            for word in words_of(header[2]):
                if table in last:
                    table = (*table, last[table])
                table = (*table, word)
                lines.setdefault(table, number)
            if header[1] == "[[":
                last[table] = last.get(table, -1) + 1
            if table in last:
                table = (*table, last[table])
                lines.setdefault(table, number)
        elif assignment := _ASSIGNMENT.match(line):
            path = table
            for word in words_of(assignment[1]):
                path = (*path, word)
                lines.setdefault(path, number)
    return lines


def words_of(key: str) -> tuple[str, ...]:
    """The words of a dotted key, of which some may be quoted.

    >>> words_of('sweep."contact.load"')
    ('sweep', 'contact.load')
    """
    words: list[str] = []
    try:
        inside = tomllib.loads(f"{key} = 0")
        while isinstance(inside, dict) and len(inside) == 1:
            ((word, inside),) = inside.items()
            words.append(word)
    except (ValueError, RecursionError):
        return tuple(key.split("."))
    return tuple(words) if inside == 0 else (key,)
