"""The paragraph of methods names what a run was made of, and its references are those of the project."""

import json
import re
from pathlib import Path

import pytest
from helpers.parts import Clock, Ensemble, shear
from helpers.pictured import STEADY, simulated

import sim

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def noisy():
    return simulated(seed=23, clock=Clock(duration=0.04, step=0.002))


def test_methods_name_version_models_numbers_members_seed_clock_step_and_errors(noisy):
    text = sim.methods(noisy).text
    document = json.loads(noisy.attrs["scenario_resolved"])
    for part in ("contact", "drive", "bonds", "shear"):
        assert f'"{document[part]["model"]}" for [{part}]' in text
    for words in (
        f"sliding-sim {sim.__version__}",
        "radius of the sphere, 2 mm",
        "work of adhesion at rest, 42 mJ/m²",
        "clock step was 2 ms in a run of 40 ms",
        f"{noisy.sizes['member']} independent members, whose noise has the seed 23",
        "largest standard error of the mean area over JKR's",
    ):
        assert words in text
    assert "\n" not in text and "  " not in text
    known = sim.read.systematic_errors(noisy)
    assert known
    for error in known:
        assert (str(error._replace(cure="")) in text) is error.matters


def test_methods_of_a_sweep_without_noise_name_its_range_and_no_seed():
    dataset = simulated(
        drive=STEADY,
        shear=shear.Uniform(),
        ensemble=Ensemble(members=3),
        clock=Clock(duration=0.04, step=0.02),
        sweep={"contact.load": [1e-3, 2e-3, 4e-3]},
    )
    text = sim.methods(dataset).text
    assert "normal load, compression positive, 1 mN to 4 mN" in text
    assert "The key contact_load was swept over 3 values." in text
    assert "Nothing was random" in text and "seed" not in text
    assert "swept" not in sim.methods(dataset, where={"load": "2 mN"}).text


def test_the_references_are_those_of_the_citation_file(noisy):
    bibtex = sim.methods(noisy).bibtex
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    software, paper = bibtex.split("@article")
    for name, key in (("title", "title"), ("version", "version")):
        (value,) = re.findall(rf'^{key}: "?(.*?)"?$', citation, re.MULTILINE)
        assert re.search(rf"{name} = {{+{re.escape(value)}}}+", software)
    (_, article, _) = citation.split("  - type: article")
    for key in ("title", "journal", "volume", "year", "doi"):
        (value,) = re.findall(rf"^    {key}: (.*)$", article, re.MULTILINE)
        assert f"{key} = {{{value}}}" in paper
    first, last = (re.findall(rf"{key}: (\d+)", article)[0] for key in ("start", "end"))
    assert f"pages = {{{first}--{last}}}" in paper
    assert re.findall("doi: (.*)", citation)[1] in paper  # the corrigendum
    assert bibtex.count("{") == bibtex.count("}")
    assert str(sim.methods(noisy)).endswith(bibtex)


def test_methods_of_one_member_name_a_standard_error_over_time_or_none():
    def bracket(**keys):
        clock = Clock(duration=0.04, step=0.002)
        text = sim.methods(simulated(seed=23, clock=clock, **keys)).text
        return [each for each in text.split(". ") if "standard error" in each]

    one = Ensemble(members=1)
    for keys, has, lacks in (
        ({"ensemble": one, "drive": STEADY}, "in time", "members"),
        ({"ensemble": one}, "no standard error", "members"),
        ({"ensemble": Ensemble(members=2), "drive": STEADY}, "in time", "One"),
        ({"ensemble": Ensemble(members=2)}, "over the members", "in time"),
    ):
        sentence = bracket(**keys)[0]
        assert has in sentence and lacks not in sentence
