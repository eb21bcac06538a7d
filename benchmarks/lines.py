"""Lines of code of a package, without docstrings, blanks and comments, by folder: ``make lines``."""

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

#: More code than this in one file is listed.
MOST = 300
_LAYOUT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def code_lines(text: str) -> int:
    """Lines of a module on which something stands that is neither a comment nor part of a docstring."""
    held: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _LAYOUT:
            held.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and type(first.value.value) is str:
                held.difference_update(range(first.lineno, first.end_lineno + 1))
    return len(held)


def counted(folder: Path) -> dict[Path, int]:
    """Lines of code of every module below a folder."""
    return {path.relative_to(folder): code_lines(path.read_text()) for path in sorted(folder.rglob("*.py"))}


def main() -> None:
    """Print the lines of each folder, of the whole package, and of the files that are too long."""
    package = Path(sys.argv[1] if len(sys.argv) > 1 else "sim")
    files, folders = counted(package), Counter()
    for path, lines in files.items():
        folders[path.parts[0] + ("/" if len(path.parts) > 1 else "")] += lines
    for name, lines in sorted(folders.items(), key=lambda item: -item[1]):
        print(f"{lines:7,}  {name}")
    print(f"{sum(files.values()):7,}  in all, {len(files)} files")
    for path, lines in files.items():
        if lines > MOST:
            print(f"{path}: {lines} lines of code, more than {MOST}")


if __name__ == "__main__":
    main()
