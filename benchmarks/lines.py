"""Size and density of a package: ``python benchmarks/lines.py [FOLDER]``, or ``make lines``.

Size is counted in tokens of code, because a module can be made denser without being made shorter. Docstrings,
comments, layout and trailing commas do not count, so that a formatter leaves the size as it is. Lines are those with
code; their number shows the density together with the tokens. Below the table stand the places that make code hard
to change: functions of many parameters, conditional expressions within each other, private functions with a single
caller, booleans by which parts and scenarios choose algorithms, and functions that take a solid as two floats.
"""

import ast
import io
import itertools
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

#: A function with more parameters is listed, unless it is a public law, whose parameters are the symbols of a formula.
MOST_PARAMETERS = 8
LAWS = "laws"
#: Functions that may have more of them, which every call names.
BY_NAME = {
    ("cli.py", "run"),  # click hands over each option of a command by name
    ("ensemble/simulate.py", "run"),  # settings of a run, all keyword-only
}
#: Parameters that together are a half-space.
SOLID = {"shear_modulus", "poisson_ratio"}
#: Folders and modules whose booleans choose algorithms.
CHOOSERS = ("parts", "scenario")
_LAYOUT = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}
_CLOSING = {")", "]", "}"}

Function = ast.FunctionDef | ast.AsyncFunctionDef


class Size(NamedTuple):
    """Lines of code and tokens of a module."""

    lines: int
    tokens: int


def size(text: str) -> Size:
    """Return the size of a module without docstrings, comments, layout and trailing commas."""
    places = docstring_lines(ast.parse(text))
    stream = tokenize.generate_tokens(io.StringIO(text).readline)
    code = [
        token
        for token in stream
        if token.type not in _LAYOUT and token.start[0] not in places
    ]
    lines = set[int]()
    for token in code:
        lines.update(range(token.start[0], token.end[0] + 1))
    pairs = itertools.zip_longest(code, code[1:])
    trailing = sum(is_trailing_comma(token, following) for token, following in pairs)
    return Size(len(lines), len(code) - trailing)


def is_trailing_comma(
    token: tokenize.TokenInfo, following: tokenize.TokenInfo | None
) -> bool:
    """Return True if a token is a comma before a closing bracket.

    The comma of a tuple of one element counts as trailing, too, which makes no difference between two layouts.
    """
    return (
        token.string == "," and following is not None and following.string in _CLOSING
    )


def docstring_lines(tree: ast.Module) -> set[int]:
    """Return the lines that docstrings occupy."""
    lines = set[int]()
    for node in ast.walk(tree):
        if not isinstance(node, ast.Module | ast.ClassDef | Function) or not node.body:
            continue
        match node.body[0]:
            case ast.Expr(value=ast.Constant(value=str())) as docstring:
                lines.update(
                    range(
                        docstring.lineno, (docstring.end_lineno or docstring.lineno) + 1
                    )
                )
    return lines


def parameters(function: Function) -> list[str]:
    """Return the names of the parameters of a function, without the object of a method."""
    arguments = function.args
    positional = [*arguments.posonlyargs, *arguments.args]
    names = [argument.arg for argument in (*positional, *arguments.kwonlyargs)]
    return names[1:] if names[:1] in (["self"], ["cls"]) else names


def functions(tree: ast.Module) -> Iterator[Function]:
    """Yield all functions and methods of a module."""
    for node in ast.walk(tree):
        if isinstance(node, Function):
            yield node


def may_be_long(path: Path, name: str) -> bool:
    """Return True if a function may have any number of parameters."""
    is_public_law = path.parts[0] == LAWS and not name.startswith("_")
    return is_public_law or (path.as_posix(), name) in BY_NAME


def long_lists(path: Path, tree: ast.Module) -> list[str]:
    """Return the functions of a module with too many parameters, each with their number."""
    counts = {function.name: len(parameters(function)) for function in functions(tree)}
    return [
        f"{name} ({count})"
        for name, count in counts.items()
        if count > MOST_PARAMETERS and not may_be_long(path, name)
    ]


def nested_conditionals(tree: ast.Module) -> int:
    """Return the number of conditional expressions that contain another one as a branch or condition."""
    outer = (node for node in ast.walk(tree) if isinstance(node, ast.IfExp))
    branches = ((node.test, node.body, node.orelse) for node in outer)
    return sum(any(isinstance(part, ast.IfExp) for part in parts) for parts in branches)


def solids_as_floats(tree: ast.Module) -> list[str]:
    """Return the functions that take a half-space as two floats."""
    return [
        function.name
        for function in functions(tree)
        if set(parameters(function)) >= SOLID
    ]


def booleans(tree: ast.Module) -> int:
    """Return the number of methods and class variables of type ``bool``."""
    methods = sum(
        isinstance(function.returns, ast.Name) and function.returns.id == "bool"
        for function in functions(tree)
    )
    annotated = (
        node.annotation for node in ast.walk(tree) if isinstance(node, ast.AnnAssign)
    )
    return methods + sum(
        ast.unparse(annotation) == "ClassVar[bool]" for annotation in annotated
    )


def called_once(trees: Iterable[ast.Module]) -> list[str]:
    """Return the private functions of modules whose name is used at one place of their module."""
    names = []
    for tree in trees:
        own = [node.name for node in tree.body if isinstance(node, Function)]
        uses = Counter(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
        names += [name for name in own if name.startswith("_") and uses[name] == 1]
    return names


def folder_of(path: Path) -> str:
    """Return the first folder of a path with a slash, or the name of a module beside the folders."""
    return path.parts[0] + ("/" if len(path.parts) > 1 else "")


def main() -> None:
    """Print the size of each folder and of the whole package, and the places that make it hard to change."""
    package = Path(sys.argv[1] if len(sys.argv) > 1 else "sim")
    texts = {
        path.relative_to(package): path.read_text(encoding="utf-8")
        for path in sorted(package.rglob("*.py"))
    }
    trees = {path: ast.parse(text) for path, text in texts.items()}
    lines, tokens = Counter[str](), Counter[str]()
    for path, text in texts.items():
        lines[folder_of(path)] += size(text).lines
        tokens[folder_of(path)] += size(text).tokens
    for folder, count in tokens.most_common():
        print(f"{count:8,} tokens {lines[folder]:7,} lines  {folder}")
    density = tokens.total() / max(lines.total(), 1)
    print(
        f"{tokens.total():8,} tokens {lines.total():7,} lines  in all, {density:.1f} tokens a line"
    )
    listed = {path: long_lists(path, tree) for path, tree in trees.items()}
    crowded = {path: names for path, names in listed.items() if names}
    print(
        f"{sum(map(len, crowded.values()))} functions with more than {MOST_PARAMETERS} parameters"
    )
    for path, names in crowded.items():
        print(f"    {path}: {', '.join(names)}")
    print(
        f"{sum(map(nested_conditionals, trees.values()))} conditional expressions with another one inside"
    )
    print(
        f"{len(called_once(trees.values()))} private functions with one caller in their module"
    )
    solids = [
        name
        for path, tree in trees.items()
        if path.parts[0] != "laws"
        for name in solids_as_floats(tree)
    ]
    print(
        f"{len(solids)} functions outside of laws that take a half-space as two floats"
    )
    choosers = [tree for path, tree in trees.items() if path.parts[0] in CHOOSERS]
    print(f"{sum(map(booleans, choosers))} booleans of {' and '.join(CHOOSERS)}")


if __name__ == "__main__":
    main()
