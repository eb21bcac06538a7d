"""Size of a package by folder, in lines of code and Python tokens: ``make lines``.

Lines of code are those without docstrings, blanks and comments. Tokens are counted too, because code can be made
denser without being made shorter.
"""

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

#: A module of about 600 lines of code is one noun; a module with more lines than this is listed.
MOST = 650
_LAYOUT = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}


def size(text: str) -> tuple[int, int]:
    """Return the lines of code of a module, without docstrings, and its tokens, without layout."""
    tokens = [token for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type not in _LAYOUT]
    lines = {line for token in tokens for line in range(token.start[0], token.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and type(first.value.value) is str:
                lines.difference_update(range(first.lineno, first.end_lineno + 1))
    return len(lines), len(tokens)


def main() -> None:
    """Print the size of each folder and of the whole package, and the modules that are too long."""
    package = Path(sys.argv[1] if len(sys.argv) > 1 else "sim")
    paths = {path.relative_to(package): path for path in sorted(package.rglob("*.py"))}
    sizes = {name: size(path.read_text(encoding="utf-8")) for name, path in paths.items()}
    lines, tokens = Counter(), Counter()
    for name, (of_lines, of_tokens) in sizes.items():
        folder = name.parts[0] + ("/" if len(name.parts) > 1 else "")
        lines[folder] += of_lines
        tokens[folder] += of_tokens
    for folder, count in lines.most_common():
        print(f"{count:7,} lines {tokens[folder]:8,} tokens  {folder}")
    modules = [name for name in sizes if name.name != "__init__.py"]
    print(
        f"{lines.total():7,} lines {tokens.total():8,} tokens  in all, {len(modules)} modules and their package faces"
    )
    for name, (count, _) in sizes.items():
        if count > MOST:
            print(f"{name}: {count} lines of code, more than {MOST}")


if __name__ == "__main__":
    main()
