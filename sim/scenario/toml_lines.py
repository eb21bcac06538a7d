"""On which line of a TOML text each key stands, which the standard parser does not tell."""

import re
import tomllib
from collections.abc import Iterator
from typing import NamedTuple

Path = tuple[str | int, ...]

_TOKEN = re.compile(
    r'(?P<text>"{3}(?:\\.|[^\\])*?"{3,5}'
    r"|'{3}.*?'{3,5}"
    r"""|"(?:\\.|[^"\\\n])*"|'[^'\n]*')"""
    r"|(?P<skip>[ \t\r]+|\#[^\n]*)"
    r"|(?P<newline>\n)"
    r"|(?P<mark>[\[\]{},=.])"
    r"|(?P<bare>[^\s\[\]{},=.\"'\#]+)",
    re.DOTALL,
)


class _Token(NamedTuple):
    kind: str
    text: str
    line: int


def key_lines(text: str) -> dict[Path, int]:
    """The line of every key, table and list item of a valid TOML text.

    Parameters
    ----------
    text : str
        A text that ``tomllib`` has accepted, nested no deeper than Python may recurse.

    Returns
    -------
    dict of tuple to int
        Line, counted from 1, by the path of keys; the place in a list is an int in the path.

    Examples
    --------
    >>> lines = key_lines('[shear]\\nmemory = { model = "slip",\\n  length = "5 um" }\\n')
    >>> lines["shear",], lines["shear", "correlation", "length"]
    (1, 3)
    """
    return _Reader(text).lines


def deep_line(text: str, deepest: int) -> int:
    """The line on which brackets and braces first nest deeper than ``deepest``; the last one if they do not."""
    depth, last = 0, 1
    for token in _tokens(text):
        depth += {"[": 1, "{": 1, "]": -1, "}": -1}.get(token.text, 0) if token.kind == "mark" else 0
        last = token.line
        if depth > deepest:
            break
    return last


class _Reader:
    """One pass over the tokens of a text."""

    def __init__(self, text: str) -> None:
        self.lines: dict[Path, int] = {}
        self.tables: dict[Path, int] = {}  # arrays of tables: the number of the last one
        self.tokens = list(_tokens(text))
        self.at = 0
        table: Path = ()
        while (token := self.peek()).kind != "end":
            if token.kind == "newline":
                self.at += 1
            elif token.text == "[" and token.kind == "mark":
                table = self.header()
            else:
                self.assignment(table)

    def peek(self) -> _Token:
        return self.tokens[min(self.at, len(self.tokens) - 1)]

    def take(self) -> _Token:
        token = self.peek()
        self.at += 1
        return token

    def next_is(self, marks: str) -> bool:
        token = self.peek()
        return token.kind == "mark" and token.text in marks

    def header(self) -> Path:
        """``[a.b]`` or ``[[a.b]]``: the path of its table."""
        line = self.take().line
        several = self.next_is("[")
        words = self.key()
        path: Path = ()
        for count, word in enumerate(words, 1):
            path = (*path, word)
            self.lines.setdefault(path, line)
            if several and count == len(words):
                self.tables[path] = self.tables.get(path, -1) + 1
            if path in self.tables:
                path = (*path, self.tables[path])
                self.lines.setdefault(path, line)
        while self.peek().kind not in ("newline", "end"):
            self.at += 1
        return path

    def key(self) -> list[str]:
        """The words of a dotted key, up to the mark that ends it."""
        words = []
        while not self.next_is("=]}") and self.peek().kind not in ("newline", "end"):
            token = self.take()
            if token.kind != "mark":
                words.append(_plain(token.text))
        return words

    def assignment(self, table: Path) -> None:
        """``a.b = value`` within a table."""
        line, path = self.peek().line, table
        for word in self.key():
            path = (*path, word)
            self.lines.setdefault(path, line)
        self.at += 1
        self.value(path)

    def value(self, path: Path) -> None:
        if self.next_is("["):
            self.items(path)
        elif self.next_is("{"):
            self.inline_table(path)
        else:
            self.at += 1
            while not self.next_is(",]}") and self.peek().kind not in ("newline", "end"):
                self.at += 1

    def items(self, path: Path) -> None:
        self.at += 1
        place = 0
        while not self.next_is("]") and self.peek().kind != "end":
            if self.peek().kind == "newline" or self.next_is(","):
                self.at += 1
                continue
            self.lines[(*path, place)] = self.peek().line
            self.value((*path, place))
            place += 1
        self.at += 1

    def inline_table(self, path: Path) -> None:
        self.at += 1
        while not self.next_is("}") and self.peek().kind != "end":
            if self.peek().kind == "newline" or self.next_is(","):
                self.at += 1
            else:
                self.assignment(path)
        self.at += 1


def _tokens(text: str) -> Iterator[_Token]:
    line = 1
    for match in _TOKEN.finditer(text):
        kind, found = str(match.lastgroup), match[0]
        if kind != "skip":
            yield _Token(kind, found, line)
        line += found.count("\n")
    yield _Token("end", "", line)


def _plain(word: str) -> str:
    """A key without its quotes."""
    return next(iter(tomllib.loads(f"{word}=0"))) if word[0] in "\"'" else word
