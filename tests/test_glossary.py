"""The words and symbols of the pages are those of the glossary."""

import re
from pathlib import Path

from sim.scenario.scenario import Scenario
from sim.scenario.schema import all_tables, declaration, keys, tables

DOCS = Path(__file__).parent.parent / "docs"
GLOSSARY = (DOCS / "glossary.md").read_text(encoding="utf-8")
#: Pages that a program makes, and pages that show a file of the folder above or the interface of Python.
OTHERS = {"keys", "dataset", "commands", "api"}
OTHERS |= {"changelog", "contributing", "security", "conduct"}
#: Pages for developers and tables of sources, whose words are not those of the contact.
APART = {"design", "reliability", "speed", "speed_rows", "precision", "within_rows"}
APART |= {"literature"}


def defined():
    """Return the terms of the glossary."""
    block = GLOSSARY.partition(":::{glossary}\n:sorted:\n")[2].partition("\n:::\n")[0]
    return re.findall(r"^(\S.*)$", block, re.M)


def linked(text):
    """Return the terms that a page links to."""
    links = re.findall(r"\{term\}`([^`]+)`", " ".join(text.split()))
    return {re.sub(r".*<(.*)>", r"\1", link) for link in links}


def rows():
    """Return the cells of each row of the table of symbols."""
    lines = GLOSSARY.partition("## Symbols")[2].strip().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_a_term_has_one_definition_and_each_link_leads_to_one():
    terms = defined()
    assert len(terms) == len({*terms}) > 40
    for page in DOCS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        assert linked(text) <= {*terms}, page.name


def test_each_page_that_is_written_by_hand_links_its_first_terms():
    for page in DOCS.glob("*.md"):
        if page.stem not in OTHERS | APART:
            assert linked(page.read_text(encoding="utf-8")), page.name


def test_a_symbol_has_one_meaning_and_its_keys_and_variables_exist():
    symbols = [symbol for row in rows() for symbol in re.split(", | = ", row[0])]
    assert len(symbols) == len({*symbols}) > 40
    pages = [(DOCS / name).read_text("utf-8") for name in ("keys.md", "dataset.md")]
    known = {name for page in pages for name in re.findall(r"`(\w+)`", page)}
    known |= {"shear", "spectrum", "correlation"}  # tables
    for row in rows():
        for name in re.findall(r"`([\w.]+)`", row[3]):
            assert {*name.split(".")[-1:]} <= known, name


def declared():
    """Return keys and variables with their meanings and units, by their symbols as the glossary writes them."""
    result = {}
    letters = {"alpha": "α", "beta": "β", "nu": "ν", "rho": "ρ", "lambda": "λ"}
    for _, field in all_tables(Scenario):
        for table in tables(field.annotation).values():
            for key, declared_key in keys(table).items():
                quantity = declaration(declared_key)
                if quantity is not None and quantity.symbol:
                    symbol = letters.get(quantity.symbol, quantity.symbol)
                    result.setdefault(symbol, set()).add((key, quantity.unit))
    return result


def test_symbols_of_one_letter_have_one_meaning_in_glossary_and_registry():
    owners = {
        "h": {"thickness"},
        "n": {"front_exponent"},
        "β": {"bond_share"},
        "ρ": {"rebinding_ratio"},
        "n_s": {"site_density"},
    }
    found = declared()
    for symbol, owned in owners.items():
        assert {key for key, _ in found[symbol]} == owned, symbol
        (row,) = (row for row in rows() if symbol in re.split(", | = ", row[0]))
        assert any(name in row[3] for name in owned), row


def test_an_identifier_of_a_source_is_one_that_the_project_holds_or_a_preprint():
    text = (DOCS / "literature.md").read_text(encoding="utf-8")
    for shown, target in re.findall(
        r"\[doi:([^\]]+)\]\(https://doi.org/([^\s]+)\)", text
    ):
        assert shown == target.replace("%28", "(").replace("%29", ")")
