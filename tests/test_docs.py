"""The documentation keeps up with the code."""

import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def test_every_key_is_documented_as_it_is_declared():
    path = ROOT / "docs" / "make_keys.py"
    spec = importlib.util.spec_from_file_location("make_keys", path)
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    assert (ROOT / "docs" / "keys.md").read_text(encoding="utf-8") == maker.text(), "run python docs/make_keys.py"


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
