"""What the benchmarks compute: rows and their page, intervals of ratios, and lines of code."""

import ast
import json
import math
import random
import re

import pytest
from helpers.cases import some

from benchmarks import page, run, timing
from benchmarks.compare import interval
from benchmarks.lines import (
    called_once,
    long_lists,
    nested_conditionals,
    size,
    solids_as_floats,
)

RESULTS = json.loads(run.RESULTS.read_text(encoding="utf-8"))


#: Groups that start many processes, or run many scenes.
LONG = {"commands", "statistics", "sweeps"}


@pytest.mark.parametrize("group", some(run.GROUPS, *run.GROUPS.keys() - LONG))
def test_every_row_runs_and_is_kept(group):
    rows = run.GROUPS[group](timing.Bench(quick=True))
    assert [row.ours for row in rows] == [row["ours"] for row in RESULTS[group]["rows"]]
    for row in rows:
        assert all(map(math.isfinite, row.result)), row.ours
        assert all(0.0 < time < math.inf for time in row.seconds or row.result), (
            row.ours
        )


def test_the_page_of_speed_is_that_of_the_results():
    found = run.PAGE.read_text(encoding="utf-8")
    assert found == page.text(RESULTS), "run make bench"
    assert list(RESULTS) == list(run.GROUPS)
    assert len(re.findall(r"\| (?:yes|\*\*no\*\*) \|", found)) == sum(
        row.met is not None for row in page.rows_of(RESULTS)
    )


def test_the_interval_of_twenty_ratios_reaches_from_the_sixth_to_the_fifteenth():
    # 1 - 2 (1 + 20 + 190 + 1140 + 4845 + 15504)/2^20 = 0.9586; one ratio further in it would be 0.8847
    ratios = [float(n) for n in range(1, 21)]
    random.Random(1).shuffle(ratios)
    assert interval(ratios) == (6.0, 15.0)
    assert interval(ratios, confidence=0.88) == (7.0, 14.0)
    assert interval([1.0] * 5) == (-math.inf, math.inf)
    assert interval([3.0, 1.0, 2.0, 5.0, 4.0, 6.0]) == (1.0, 6.0)


DENSE = '''"""A module."""

def radius(load, modulus): return {"load": load, "modulus": modulus}
'''
WIDE = '''"""A module whose docstring
has another length."""


def radius(
    load,
    modulus,
):
    """Return nothing of interest."""
    # a comment
    return {
        "load": load,
        "modulus": modulus,
    }
'''


def test_the_size_of_a_module_in_tokens_does_not_depend_on_its_layout_and_words():
    assert size(DENSE).tokens == size(WIDE).tokens > 15
    assert size(DENSE).lines == 1 < size(WIDE).lines


def test_places_that_make_code_hard_to_change_are_found():
    text = """
class Solid:
    def at(self, a, b, c, d, e, f, g, h): return _once(a)
    def many(self, a, b, c, d, e, f, g, h, i): return _twice(a) + _twice(b)

def _once(a): return 1 if a else 2 if a is None else 3
def _twice(a): return (1 if a else 2) + (3 if a else 4)
def energy(spectrum, shear_modulus, *, poisson_ratio): return spectrum
def stress(shear_modulus): return shear_modulus
"""
    tree = ast.parse(text)
    assert long_lists(tree) == ["many (9)"]
    assert called_once([tree]) == ["_once"]
    assert nested_conditionals(tree) == 1
    assert solids_as_floats(tree) == ["energy"]
