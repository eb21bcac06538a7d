"""The drawings of the documentation are those of their script."""

import importlib.util
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
from numpy.testing import assert_allclose

ROOT = Path(__file__).parent.parent
_SPEC = importlib.util.spec_from_file_location(
    "make_drawings", ROOT / "docs" / "make_drawings.py"
)
MAKER = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(MAKER)
NUMBER = re.compile(r"(?<![#\w])-?\d+(?:\.\d+)?(?!\w)")


def test_each_drawing_has_its_function_and_a_page_that_shows_it():
    assert {path.stem for path in MAKER.FOLDER.iterdir()} == {*MAKER.DRAWINGS}
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "".join(page.read_text(encoding="utf-8") for page in pages)
    assert {*re.findall(r"drawings/(\w+)\.svg", text)} == {*MAKER.DRAWINGS}


@pytest.mark.parametrize("name", MAKER.DRAWINGS)
def test_a_drawing_is_made_again_to_the_last_digit_of_its_coordinates(name):
    """Coordinates have one decimal, so that roundings of another system move them by 0.1 at most."""
    stored = (MAKER.FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    made = MAKER.DRAWINGS[name]().svg() + "\n"
    assert NUMBER.sub("", made) == NUMBER.sub("", stored), (
        "run python docs/make_drawings.py"
    )
    numbers = (map(float, NUMBER.findall(text)) for text in (made, stored))
    made_numbers, stored_numbers = map(list, numbers)
    assert_allclose(made_numbers, stored_numbers, rtol=0, atol=0.101)


@pytest.mark.parametrize("name", MAKER.DRAWINGS)
def test_a_drawing_has_a_title_and_takes_all_colours_from_the_page(name):
    stored = (MAKER.FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    root = ElementTree.fromstring(stored)
    space = "{http://www.w3.org/2000/svg}"
    assert root.find(f"{space}title").text
    shapes = "".join(stored.split("</style>")[1:])
    assert not re.search(r"#[0-9a-f]{3,6}\b|\b(?:fill|stroke)=", shapes)


def test_the_site_switches_the_colours_of_drawings_with_its_theme():
    css = (ROOT / "docs" / "_static" / "site.css").read_text(encoding="utf-8")
    for theme, colours in (("light", MAKER.LIGHT), ("dark", MAKER.DARK)):
        (rule,) = re.findall(rf'body\[data-theme="{theme}"\] {{([^}}]*)}}', css)
        pairs = dict(re.findall(r"--drawing-(\w+): (#\w+);", rule))
        assert pairs == colours
