"""Configuration of the documentation site: ``make docs``."""

from importlib import metadata
from typing import Any

from docutils.nodes import SkipNode
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
html_theme, html_title = "furo", "sliding-sim"
html_static_path, html_css_files = ["_static"], ["site.css"]
html_math_renderer = "mathml"

# Markdown as code hosts show it: formulas between dollars or in fenced blocks, anchors of headings
myst_enable_extensions = ["dollarmath", "html_image"]
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


def setup(app: Any) -> None:
    """Write formulas as MathML, because browsers show it without a script from the network."""

    def visit(as_block: bool) -> Any:
        def write(writer: Any, node: Any) -> None:
            writer.body.append(tex2mathml(node.astext(), as_block=as_block))
            raise SkipNode

        return write, None

    app.add_html_math_renderer("mathml", visit(False), visit(True))
    app.connect("sphinx-click-process-epilog", _add_kinds)


def _add_kinds(app: Any, context: Any, lines: list[str]) -> None:
    """Add what the help of a command lists below its options: the kinds of figures."""
    formatter = context.make_formatter()
    context.command.format_epilog(context, formatter)
    if formatter.getvalue() and not context.command.epilog:
        below = formatter.getvalue().strip().splitlines()
        lines += ["::", "", *(f"   {line}" for line in below)]
