"""Readability of README, pages, docstrings and messages: ``python docs/readability.py``.

Words per sentence (median, 95th percentile, share above 25), Flesch's reading ease and docstrings that open with a
question word. A sentence ends at a full stop, a question mark or an exclamation mark; semicolons and colons do not end
it. With ``--check`` the script fails if lengths, openings or sizes exceed the goals; the reading ease is only reported.
With ``--long`` it prints the sentences above the goal.
"""

import ast
import itertools
import re
import statistics
import sys
from collections.abc import Iterator
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parent.parent
#: Pages of tables that a program writes, and pages of prose that a program writes with its numbers.
TABLES = {"docs/keys.md", "docs/api.md", "docs/dataset.md"}
WITH_NUMBERS = {"docs/speed.md", "docs/gallery"}
MOST_MEDIAN, MOST_LENGTH, LONG = 16, 28, 25
#: Largest numbers of words, as counted by ``wc -w``: of README, and of the pages in docs that no program writes.
MOST_README, MOST_PAGES = 1_000, 15_000
_QUESTION = re.compile(r"(What|Where|Who|Whose|Whether|How)\b")
_ENDS = re.compile(r"(?<=[.!?])[)\]*\"'”]*\s+(?=[\[(*\"'“]*[A-ZΑ-ω∫0-9`])")
_ABBREVIATION = re.compile(r"\b(e\.g|i\.e|cf|vs|Fig|Eq|al|etc|[A-Z])\.")


def prose(markdown: str) -> list[str]:
    """Return the paragraphs and list items of a page, without tables, headings and blocks of code.

    A backtick marks code within a sentence, because a sentence may start with a name in lower case.
    """
    tokens, texts, table = MarkdownIt().enable("table").parse(markdown), list[str](), False
    for before, token in itertools.pairwise(tokens):
        table = (table or token.type == "table_open") and token.type != "table_close"
        if token.type == "inline" and before.type == "paragraph_open" and not table:
            marks = {"softbreak": " ", "hardbreak": " ", "code_inline": "`"}
            texts.append("".join(marks.get(child.type, "") + child.content for child in token.children or ()))
    return texts


def strings(tree: ast.AST) -> Iterator[str]:
    """Yield the text constants of a module of five words and more that are no docstrings: messages and labels."""
    documented = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
    docstrings = {id(node.body[0].value) for node in ast.walk(tree)
                  if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr)}  # fmt: skip
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            text = "".join(part.value if isinstance(part, ast.Constant) else "X" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings | inside:
            text = node.value
        else:
            continue
        if len(re.findall(r"[A-Za-z]{2,}", text)) >= 5 and " " in text:
            yield text


def docstrings(tree: ast.AST) -> Iterator[str]:
    """Yield the prose of each docstring: without sections that list arguments, examples, formulas and tables."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
            text = re.split(r"\n\n[A-Z][A-Za-z ]+\n-{3,}\n|>>>", text)[0]
            yield re.sub(r"(?ms)^=+ [= ]+$.*^=+ [= ]+$|^    .*?$", "", text)


def sentences(text: str) -> list[str]:
    """Return the sentences of a paragraph or of several."""
    flat = (" ".join(part.split()) for part in re.split(r"\n\s*\n|\n(?=\s*- )", text))
    result = (sentence for part in flat for sentence in _ENDS.split(_ABBREVIATION.sub(r"\1", part)))
    return [sentence for sentence in result if len(sentence.split()) > 1]


def syllables(word: str) -> int:
    """Return about the number of syllables of an English word: groups of vowels, without a final e."""
    return max(1, len(re.findall(r"[aeiouy]+", re.sub(r"e\b", "", word.lower()))))


def figures(texts: list[str]) -> tuple[int, float, float, float, float]:
    """Return words, median and 95th percentile of words per sentence, share of long ones, and reading ease."""
    each = [sentence for text in texts for sentence in sentences(text)]
    lengths = sorted(len(sentence.split()) for sentence in each)
    words = re.findall(r"[A-Za-z]+", " ".join(each))
    ease = 206.835 - 1.015 * len(words) / len(each) - 84.6 * sum(map(syllables, words)) / len(words)
    above = sum(length > LONG for length in lengths) / len(lengths)
    return sum(lengths), statistics.median(lengths), lengths[int(0.95 * (len(lengths) - 1))], above, ease


def main() -> None:
    """Print a row for each page and kind of text; with ``--check`` fail if one exceeds a goal."""
    paths = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
    markdown = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    gallery = sorted((ROOT / "docs" / "gallery").glob("*.md"))
    markdown["docs/gallery"] = "\n".join(path.read_text(encoding="utf-8") for path in gallery)
    trees = [ast.parse(path.read_text(encoding="utf-8")) for path in sorted((ROOT / "sim").rglob("*.py"))]
    texts = {name: prose(page) for name, page in markdown.items() if name not in TABLES}
    texts["docstrings"] = [text for tree in trees for text in docstrings(tree)]
    texts["messages"] = [text for tree in trees for text in strings(tree)]
    openings = sum(bool(_QUESTION.match(text)) for text in texts["docstrings"])
    print(f"{'':32}{'words':>7}{'median':>8}{'95 %':>6}{'> 25':>7}{'ease':>6}")
    faults = list[str]()
    for name, text in texts.items():
        words, median, high, above, ease = figures(text)
        if median > MOST_MEDIAN or high > MOST_LENGTH:
            faults.append(f"the sentences of {name} are too long")
        print(f"{name:32}{words:7}{median:8g}{high:6}{100.0 * above:6.1f}%{ease:6.0f}")
        if "--long" in sys.argv:
            print(*(f"    {s}" for t in text for s in sentences(t) if len(s.split()) > MOST_LENGTH), sep="\n")
    sizes = {name: len(page.split()) for name, page in markdown.items() if name not in TABLES | WITH_NUMBERS}
    readme = sizes.pop("README.md")
    pages = sum(size for name, size in sizes.items() if name.startswith("docs/"))
    print(f"{openings} docstrings open with a question word")
    print(f"{readme} words in README (at most {MOST_README}), {pages} in pages written by hand (at most {MOST_PAGES})")
    faults += ["docstrings open with a question word"] * (openings > 0)
    faults += ["README has too many words"] * (readme > MOST_README)
    faults += ["the pages have too many words in sum"] * (pages > MOST_PAGES)
    if "--check" in sys.argv and faults:
        sys.exit("\n".join(faults))


if __name__ == "__main__":
    main()
