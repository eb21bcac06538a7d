"""Readability of README, pages, docstrings and messages: ``python docs/readability.py``.

The table has words per sentence (median, 95th percentile, number above 35) and Flesch's reading ease of each page and
kind of text. A list follows of the sentences above 35 words and of the docstrings that open with a question word. A
sentence ends at a full stop, a question mark or an exclamation mark; semicolons and colons do not end it. The script
fails on no text, because only a reader can tell if a long sentence is clear.
"""

import ast
import itertools
import re
import statistics
from collections.abc import Iterator
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parent.parent
#: Pages of tables that a program writes.
TABLES = {"docs/keys.md", "docs/api.md", "docs/dataset.md"}
#: Sentences of more words are listed.
LONG = 35
_QUESTION = re.compile(r"(What|Where|Who|Whose|Whether|How)\b")
_ENDS = re.compile(r"(?<=[.!?])[)\]*\"'”]*\s+(?=[\[(*\"'“]*[A-ZΑ-ω∫0-9`])")
_ABBREVIATION = re.compile(r"\b(e\.g|i\.e|cf|vs|Fig|Eq|al|etc|[A-Z])\.")


def prose(markdown: str) -> list[str]:
    """Return the paragraphs and list items of a page, without tables, headings and blocks of code.

    A backtick marks code within a sentence, because a sentence may start with a name in lower case.
    """
    tokens, texts, table = (
        MarkdownIt().enable("table").parse(markdown),
        list[str](),
        False,
    )
    for before, token in itertools.pairwise(tokens):
        table = (table or token.type == "table_open") and token.type != "table_close"
        if token.type == "inline" and before.type == "paragraph_open" and not table:
            marks = {"softbreak": " ", "hardbreak": " ", "code_inline": "`"}
            texts.append(
                "".join(
                    marks.get(child.type, "") + child.content
                    for child in token.children or ()
                )
            )
    return texts


def strings(tree: ast.AST) -> Iterator[str]:
    """Yield the text constants of a module of five words and more that are no docstrings: messages and labels."""
    documented = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, documented)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    inside = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in node.values
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            text = "".join(
                part.value if isinstance(part, ast.Constant) else "X"
                for part in node.values
            )
        elif (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in docstrings | inside
        ):
            text = node.value
        else:
            continue
        if len(re.findall(r"[A-Za-z]{2,}", text)) >= 5 and " " in text:
            yield text


def docstrings(tree: ast.AST) -> Iterator[str]:
    """Yield the prose of each docstring: without sections that list arguments, examples, formulas and tables."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (
            text := ast.get_docstring(node)
        ):
            text = re.split(r"\n\n[A-Z][A-Za-z ]+\n-{3,}\n|>>>", text)[0]
            yield re.sub(r"(?ms)^=+ [= ]+$.*^=+ [= ]+$|^    .*?$", "", text)


def sentences(text: str) -> list[str]:
    """Return the sentences of a paragraph or of several."""
    flat = (" ".join(part.split()) for part in re.split(r"\n\s*\n|\n(?=\s*- )", text))
    result = (
        sentence
        for part in flat
        for sentence in _ENDS.split(_ABBREVIATION.sub(r"\1", part))
    )
    return [sentence for sentence in result if len(sentence.split()) > 1]


def syllables(word: str) -> int:
    """Return about the number of syllables of an English word: groups of vowels, without a final e."""
    return max(1, len(re.findall(r"[aeiouy]+", re.sub(r"e\b", "", word.lower()))))


def is_long(sentence: str) -> bool:
    """Return True if a sentence is to be read again, because it has very many words."""
    return len(sentence.split()) > LONG


def figures(texts: list[str]) -> tuple[int, float, float, int, float]:
    """Return words, median and 95th percentile of words per sentence, number of long ones, and reading ease."""
    each = [sentence for text in texts for sentence in sentences(text)]
    lengths = sorted(len(sentence.split()) for sentence in each)
    words = re.findall(r"[A-Za-z]+", " ".join(each))
    ease = (
        206.835
        - 1.015 * len(words) / len(each)
        - 84.6 * sum(map(syllables, words)) / len(words)
    )
    high = lengths[int(0.95 * (len(lengths) - 1))]
    return sum(lengths), statistics.median(lengths), high, sum(map(is_long, each)), ease


def main() -> None:
    """Print a row for each page and kind of text, then what is to be read again."""
    paths = [
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted((ROOT / "docs").glob("*.md")),
    ]
    markdown = {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8")
        for path in paths
    }
    gallery = sorted((ROOT / "docs" / "gallery").glob("*.md"))
    markdown["docs/gallery"] = "\n".join(
        path.read_text(encoding="utf-8") for path in gallery
    )
    trees = [
        ast.parse(path.read_text(encoding="utf-8"))
        for path in sorted((ROOT / "sim").rglob("*.py"))
    ]
    texts = {name: prose(page) for name, page in markdown.items() if name not in TABLES}
    texts["docstrings"] = [text for tree in trees for text in docstrings(tree)]
    texts["messages"] = [text for tree in trees for text in strings(tree)]
    print(f"{'':32}{'words':>7}{'median':>8}{'95 %':>6}{f'> {LONG}':>6}{'ease':>6}")
    for name, text in texts.items():
        if not any(map(sentences, text)):
            continue
        words, median, high, above, ease = figures(text)
        print(f"{name:32}{words:7}{median:8g}{high:6}{above:6}{ease:6.0f}")
    for name, text in texts.items():
        for sentence in filter(
            is_long,
            (sentence for paragraph in text for sentence in sentences(paragraph)),
        ):
            print(f"\n{name}, {len(sentence.split())} words: {sentence}")
    for text in filter(_QUESTION.match, texts["docstrings"]):
        print(f"\ndocstring that opens with a question word: {sentences(text)[0]}")


if __name__ == "__main__":
    main()
