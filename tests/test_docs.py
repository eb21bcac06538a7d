"""The documentation keeps up with the code."""

import doctest
import importlib.util
import inspect
import json
import re
import shlex
from pathlib import Path

import pytest
from helpers.cases import posix
from numpy.testing import assert_allclose

from sim.cli import _values, cli
from sim.plots.kinds import KINDS
from sim.scenario.reader import load

ROOT = Path(__file__).parent.parent
PAGES = sorted(str(path.relative_to(ROOT)) for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")))


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


@pytest.mark.parametrize("page", PAGES)
def test_links_between_pages_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\((?!https?:)([^)#]+)", text):
        assert (ROOT / page).parent.joinpath(target).exists(), target


@pytest.mark.parametrize("page", sorted({*PAGES} - {"CHANGELOG.md"}))  # which has former names, too
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


def commands(page):
    """The commands that a page shows, in lines of their own or between words, each as its words after ``sim``."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found = re.findall(r"^    (sim .*?)(?: {2,}#.*)?$|`(sim\s[^`]*)`", text, re.M)
    return sorted({tuple(shlex.split("".join(one))[1:]) for one in found})


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_that_a_page_shows_exist_with_their_options_kinds_and_keys(page):
    for name, *words in commands(page):
        command = cli.commands[name]
        known = {option for one in command.params for option in one.opts} | {"--help"}
        assert {word for word in words if word.startswith("-")} <= known, (name, *words)
        given = command.make_context(name, words, resilient_parsing=True).params  # what is left out is no matter
        assert given.get("kind") in (None, *KINDS), (name, *words)
        assert all((ROOT / word).exists() for word in words if word.startswith("scenarios/")), words
        if given.get("changes"):
            scenario = ROOT / given["scenario"]
            load(scenario if scenario.exists() else ROOT / "sim" / "starter.toml", _values(given["changes"], "--set"))


def test_the_page_for_newcomers_shows_what_its_code_gives():
    assert doctest.testfile(str(ROOT / "docs" / "jkr_only.md"), module_relative=False).failed == 0


GALLERY = maker_of("gallery")
NUMBERS = GALLERY.stored_numbers()


def test_every_scenario_has_its_question_in_the_gallery():
    there = {path.stem for path in (ROOT / "scenarios").glob("*.toml")}
    missing = there - {entry.scenario for entry in GALLERY.ENTRIES}
    assert not missing, "give it an entry in docs/make_gallery.py, then make gallery"


def test_the_gallery_shows_the_numbers_that_were_computed():
    found = GALLERY.PAGE.read_text(encoding="utf-8")
    assert found == GALLERY.text(NUMBERS), "run make gallery"
    for entry in GALLERY.ENTRIES:  # and no number is typed
        typed = re.sub(r"\{.*?\}|`.*?`|\]\(.*?\)|[χα] = [01]|theory of 2018", "", entry.answer)
        assert not re.search(r"\d", typed), entry.name
        assert 0 < (GALLERY.FOLDER / f"{entry.name}.png").stat().st_size < GALLERY.MOST_BYTES


@pytest.mark.verify
@pytest.mark.parametrize("entry", GALLERY.ENTRIES, ids=lambda entry: entry.name)
def test_an_answer_of_the_gallery_is_found_again(entry):
    found = entry.numbers(entry.run())
    assert found.keys() == NUMBERS[entry.name].keys()
    for name, number in found.items():
        assert_allclose(number, NUMBERS[entry.name][name], rtol=1e-6, atol=1e-9, err_msg=name)


@posix
@pytest.mark.verify
def test_the_python_of_the_readme_makes_its_scenes_and_figures(tmp_path, monkeypatch):
    code = re.search(r"In Python:\n\n```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.S)[1]
    (tmp_path / "scenarios").symlink_to(ROOT / "scenarios")
    monkeypatch.chdir(tmp_path)
    exec(code.replace('sim.open("outputs/pdms_lens.nc")', "dataset"), {})
    assert (tmp_path / "first.png").stat().st_size > 1000


def test_the_notebook_is_kept_without_its_results():
    cells = json.loads((ROOT / "docs" / "first_steps.ipynb").read_text(encoding="utf-8"))["cells"]
    assert all(not cell.get("outputs") and cell.get("execution_count") is None for cell in cells)


@pytest.mark.verify
@pytest.mark.filterwarnings("default")  # those of the notebook's own packages
def test_the_notebook_runs_to_its_end():
    nbclient, nbformat = (pytest.importorskip(name, reason="in the extra verify") for name in ("nbclient", "nbformat"))
    notebook = nbformat.read(ROOT / "docs" / "first_steps.ipynb", 4)
    where = {"metadata": {"path": str(ROOT / "docs")}}
    nbclient.NotebookClient(notebook, timeout=600, kernel_name="python3", resources=where).execute()
    results = [one for cell in notebook.cells for one in cell.get("outputs", [])]
    assert sum("image/png" in one.get("data", {}) for one in results) == 3
    assert [one for one in results if one.get("name") == "stderr"] == []
