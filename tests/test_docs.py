"""The documentation keeps up with the code."""

import importlib.util
import inspect
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def maker_of(page):
    """The script that makes a page."""
    spec = importlib.util.spec_from_file_location(f"make_{page}", ROOT / "docs" / f"make_{page}.py")
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    return maker


@pytest.mark.parametrize("page", ["keys", "api", "dataset"])
def test_a_page_made_from_the_code_is_up_to_date(page):
    found = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    assert found == maker_of(page).text(), f"run python docs/make_{page}.py"


def test_every_law_has_a_unit_on_its_page():
    api = maker_of("api")
    for name in (name for name in api.MODULES if name.startswith("sim.laws")):
        for law, thing in api._public(importlib.import_module(name)):
            assert inspect.isclass(thing) or api.units(thing), f"{name}.{law}: no unit in Returns or the first line"


@pytest.mark.parametrize("page", ["README.md", "docs/design.md", "docs/paper.md"])
def test_links_between_pages_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", text):
        assert (ROOT / page).parent.joinpath(target).exists(), target


@pytest.mark.parametrize("page", ["README.md", "docs/design.md"])
def test_names_of_code_in_the_pages_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in set(re.findall(r"`(sim(?:\.\w+)+)(?:\([^`]*\))?`", text)):
        module, found = name, None
        while found is None and module:
            try:
                found = importlib.import_module(module)
            except ModuleNotFoundError:
                module = module.rpartition(".")[0]
        for part in name[len(module) + 1 :].split(".") if name != module else []:
            assert hasattr(found, part), name
            found = getattr(found, part)
        assert found is not None, name
