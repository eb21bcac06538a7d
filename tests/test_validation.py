"""Comparisons of docs/validation.md with results that are not our own."""

import importlib.util
from pathlib import Path

import pytest

DOCS = Path(__file__).parent.parent / "docs"


def script():
    place = importlib.util.spec_from_file_location(
        "make_validation", DOCS / "make_validation.py"
    )
    module = importlib.util.module_from_spec(place)
    place.loader.exec_module(module)
    return module


SCRIPT = script()


@pytest.mark.verify
@pytest.mark.parametrize("compare", SCRIPT.COMPARISONS, ids=lambda item: item.__name__)
def test_a_comparison_of_the_page_holds_and_has_its_row(compare):
    try:
        result = compare()
    except ImportError as fault:
        pytest.skip(f"{fault.name}: make verify installs it")
    assert result.holds, (result.difference, result.error)
    page = (DOCS / "validation.md").read_text(encoding="utf-8")
    assert f"| {result.against} | {result.quantity} |" in page


def test_an_edge_without_a_lag_does_not_agree_with_one_that_lags(monkeypatch):
    # the comparison would see a wrong edge law
    monkeypatch.setattr(SCRIPT, "WORK", 0.99 * SCRIPT.WORK)
    assert not SCRIPT.fast_pull_off().holds
