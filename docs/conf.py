"""Configuration of the documentation site: ``make docs``."""

import importlib
import inspect
import re
import types
from html import escape
from importlib import metadata
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

project, author, project_copyright = (
    "sliding-sim",
    "The sliding-sim developers",
    "The sliding-sim developers",
)
release = metadata.version("sliding-sim")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_click",
    "sphinx_copybutton",
]
exclude_patterns, templates_path = ["_build", "_templates"], ["_templates"]
html_theme, html_title = "furo", f"sliding-sim {release}"
html_static_path, html_css_files = ["_static"], ["site.css"]
html_math_renderer = "mathml"
html_theme_options: dict[str, Any] = {"top_of_page_buttons": []}

# Markdown as code hosts show it: formulas between dollars or in fenced blocks, anchors of headings
myst_enable_extensions = ["colon_fence", "dollarmath", "html_image"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # outputs are stored, and a test executes the notebook

default_role = "code"  # of docstrings: `sim run` is a command
autosummary_generate = True
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
copybutton_prompt_text, copybutton_prompt_is_regexp = r">>> |\.\.\. ", True
smartquotes = False  # two dashes of an option stay two dashes

#: Names that have a page elsewhere.
ELSEWHERE = {"sim.read": {"Run"}, "sim.solid": {"Mount"}}


def _face(module: str) -> dict[str, list[str]]:
    """Return the public functions and classes of a module: those that it hands on, or else its own."""
    face = importlib.import_module(module)
    handed_on = getattr(face, "__all__", None)
    own = (name for name in vars(face) if not name.startswith("_"))
    result: dict[str, list[str]] = {"functions": [], "classes": []}
    for name in sorted({*(handed_on or own)} - ELSEWHERE.get(module, set())):
        item = getattr(face, name)
        if handed_on is None and getattr(item, "__module__", "") != module:
            continue
        # an alias of a type is neither
        if callable(item) and not isinstance(item, types.GenericAlias):
            result["classes" if inspect.isclass(item) else "functions"].append(name)
    return result


_MODULES = re.findall(
    r"^   (sim[\w.]*)$", Path(__file__).with_name("api.md").read_text("utf-8"), re.M
)
autosummary_context = {"faces": {module: _face(module) for module in _MODULES}}

#: Pages of the site that are files of the folder above, each with its name here.
ABOVE = {
    "changelog": "CHANGELOG.md",
    "contributing": "CONTRIBUTING.md",
    "security": "SECURITY.md",
    "conduct": "CODE_OF_CONDUCT.md",
}


def setup(app: Any) -> None:
    """Write formulas as MathML, because browsers show it without a script from the network."""

    def visit(as_block: bool) -> Any:
        def write(writer: Any, node: Any) -> None:
            formula = tex2mathml(node.astext(), as_block=as_block)
            if as_block:  # a long one scrolls in a box, also by keys
                formula = f'<div class="formula" tabindex="0">{formula}</div>'
            writer.body.append(formula)
            raise nodes.SkipNode

        return write, None

    app.add_html_math_renderer("mathml", visit(False), visit(True))
    app.connect("sphinx-click-process-epilog", _add_kinds)
    app.connect("doctree-resolved", _put_drawings_into_the_page)
    app.connect("source-read", _read_files_above)
    app.connect("build-finished", _complete_landmarks)
    app.connect("autodoc-skip-member", _skip_fields)


#: Parts of the theme's pages, each with what a screen reader or a keyboard needs.
COMPLETED = {
    '<p class="caption" role="heading">': '<p class="caption" role="heading" aria-level="2">',
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="Pages">',
    '<aside class="toc-drawer': '<aside aria-label="On this page" class="toc-drawer',
    '<div class="table-wrapper': '<div tabindex="0" class="table-wrapper',
    "<pre>": '<pre tabindex="0">',
}


def _complete_landmarks(app: Any, error: Exception | None) -> None:
    """Name the regions of each page, and let the keyboard scroll tables and code."""
    for page in Path(app.outdir).rglob("*.html") if error is None else ():
        text = before = page.read_text(encoding="utf-8")
        for part, complete in COMPLETED.items():
            text = text.replace(part, complete)
        if text != before:
            page.write_text(text, encoding="utf-8")


def _read_files_above(app: Any, page: str, source: list[str]) -> None:
    """Show a file of the folder above as a page, with links that lead to pages of the site."""
    if page in ABOVE:
        path = Path(app.srcdir).parent / ABOVE[page]
        app.env.note_dependency(str(path))
        text = path.read_text(encoding="utf-8").replace("](docs/", "](")
        for name, file in ABOVE.items():
            text = text.replace(f"]({file}", f"]({name}.md")
        source[0] = text


def _put_drawings_into_the_page(app: Any, doctree: nodes.document, page: str) -> None:
    """Replace the images of docs/drawings by the drawings themselves, whose colours then follow the page."""
    for image in list(doctree.findall(nodes.image)):
        if image["uri"].startswith("drawings/"):
            drawing = (Path(app.srcdir) / image["uri"]).read_text(encoding="utf-8")
            label = f'aria-label="{escape(image["alt"])}" role="img"'
            image.replace_self(
                nodes.raw("", drawing.replace('role="img"', label, 1), format="html")
            )


def _skip_fields(
    app: Any, what: str, name: str, member: Any, skip: bool, options: Any
) -> bool | None:
    """Leave out the fields of a record, which its docstring has with their meanings."""
    text = getattr(member, "__doc__", None) or ""
    return True if text.startswith("Alias for field number") else None


def _add_kinds(app: Any, context: Any, lines: list[str]) -> None:
    """Add what the help of a command lists below its options: the kinds of figures."""
    formatter = context.make_formatter()
    context.command.format_epilog(context, formatter)
    if formatter.getvalue() and not context.command.epilog:
        below = formatter.getvalue().strip().splitlines()
        lines += ["::", "", *(f"   {line}" for line in below)]
