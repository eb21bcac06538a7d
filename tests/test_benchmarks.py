"""What the benchmarks compute: rows and their page, intervals of ratios, and lines of code."""

import ast
import json
import math
import random
import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers.cases import some
from helpers.parts import load
from numpy.testing import assert_allclose

from benchmarks import gate, page, precision, run, scenes, timing
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


def test_the_pages_of_speed_and_precision_are_those_of_the_results():
    for path, text in run.PAGES.items():
        found = path.read_text(encoding="utf-8")
        assert found == text(RESULTS), "run make bench"
    numbers = json.loads(precision.NUMBERS.read_text(encoding="utf-8"))
    assert precision.PAGE.read_text(encoding="utf-8") == precision.text(numbers)
    pictures = {path.stem for path in precision.FOLDER.iterdir()}
    assert pictures == {name for name, one in numbers.items() if "reason" not in one}
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
    assert long_lists(Path("parts", "drive.py"), tree) == ["many (9)"]
    assert long_lists(Path("laws", "jkr.py"), tree) == []
    assert called_once([tree]) == ["_once"]
    assert nested_conditionals(tree) == 1
    assert solids_as_floats(tree) == ["energy"]


COURSE = np.array([1e-3, 0.5, np.nan, -2.0])


def recorded(force, tolerance=None, **variables):
    """A dataset with a force over time, and the tolerance of a slider if there is one."""
    solved = {} if tolerance is None else {"drive_tolerance": tolerance}
    force = xr.Variable("t", force, {"units": "N"})
    return xr.Dataset({"clock_duration": 2.0, "force": force} | solved | variables)


def event(value, units):
    return xr.Variable((), value, {"units": units})


def class_of(old, new, loose=None):
    return gate.verdict_of(old, gate.compare(old, new, old if loose is None else loose))


def test_a_dataset_is_equal_to_its_copy_and_missing_values_to_missing_ones():
    assert class_of(recorded(COURSE), recorded(COURSE.copy())) == gate.EQUAL


@pytest.mark.parametrize(
    ("place", "change", "expected"),
    [
        (3, 1e-12, gate.ROUNDED),
        (3, 4e-12, gate.OUTSIDE),
        (0, 1e-12, gate.ROUNDED),
        (0, 1e-3, gate.OUTSIDE),
        (3, np.nan, gate.EVENTS),
        (2, 1.0, gate.EVENTS),
    ],
)
def test_a_closed_quantity_may_differ_by_1e_12_of_its_largest_value(
    place, change, expected
):
    new = np.where(np.isnan(COURSE) & (np.arange(4) == place), 0.0, COURSE)
    new[place] += change
    assert class_of(recorded(COURSE), recorded(new)) == expected


@pytest.mark.parametrize(
    ("change", "changed_loosely", "expected"),
    [
        (0.9e-5, 0.0, gate.WITHIN),
        (1.1e-5, 0.0, gate.OUTSIDE),
        (1.9e-3, 1e-3, gate.WITHIN),
        (2.1e-3, 1e-3, gate.OUTSIDE),
    ],
)
@pytest.mark.parametrize("name", ["force", "peak_friction", "slip_time"])
def test_a_slider_may_differ_by_ten_tolerances_or_by_twice_what_a_looser_one_changes(
    name, change, changed_loosely, expected
):
    def changed(by):
        force = 1.0 + by * (name == "force")
        peak = event(1.0 + by * (name == "peak_friction"), "N")
        # of the duration
        time = event(0.1 + 2.0 * by * (name == "slip_time"), "s")
        values = {"peak_friction": peak, "slip_time": time}
        return recorded(force * COURSE, 1e-6, **values)

    assert class_of(changed(0.0), changed(change), changed(changed_loosely)) == expected


def test_a_value_at_an_event_is_as_uncertain_as_the_course_that_it_is_read_from():
    def changed(force, peak):
        return recorded(force * COURSE, 1e-6, peak_friction=event(peak, "N"))

    old, new = changed(1.0, 1.0), changed(1.0, 1.0015)
    assert class_of(old, new, changed(1.001, 1.0)) == gate.WITHIN
    assert class_of(old, new, changed(1.0005, 1.0)) == gate.OUTSIDE


def test_a_small_energy_may_differ_by_the_roundings_of_the_largest():
    def changed(residual):
        work = xr.Variable("t", 1e-6 * COURSE, {"units": "J"})
        rest = xr.Variable("t", [0.0, residual, 0.0, 0.0], {"units": "J"})
        return recorded(COURSE, work=work, residual=rest)

    assert class_of(changed(1e-20), changed(2e-18)) == gate.ROUNDED
    assert class_of(changed(1e-20), changed(4e-18)) == gate.OUTSIDE


def of_members(values):
    return xr.Dataset({"clock_duration": 2.0, "area": (("member", "t"), values)})


def test_members_with_other_draws_may_differ_by_four_standard_errors_of_their_means():
    draws = np.random.default_rng(1).standard_normal((2, 2000, 3))
    draws -= draws.mean(axis=(1, 2), keepdims=True)
    error = np.sqrt(np.sum(draws.mean(axis=2).var(axis=1, ddof=1)) / 2000)
    old, new = draws
    for errors, expected in ((3.9, gate.WITHIN), (4.1, gate.OUTSIDE)):
        shifted = of_members(new + errors * error)
        # Student's distribution of 4,000 members is nearly normal
        found = gate.errors_between(
            *(one.variables["area"] for one in (of_members(old), shifted))
        )
        assert_allclose(found, errors, rtol=2e-3)
        assert class_of(of_members(old), shifted) == expected


def test_members_that_have_an_event_in_one_tree_only_are_outside():
    none, some_of_them, all_of_them = np.full((3, 8, 1), np.nan)
    some_of_them[:3], all_of_them[:] = 1.0, 1.0
    assert class_of(of_members(none), of_members(all_of_them)) == gate.OUTSIDE
    assert class_of(of_members(none), of_members(some_of_them)) == gate.WITHIN


def test_another_number_of_slip_events_is_reported_apart():
    def slips(count):
        times = xr.Variable("slip", 0.1 * np.arange(count), {"units": "s"})
        numbers = np.arange(1, count + 1)
        return recorded(COURSE, 1e-6, slip_time=times).assign_coords(slip=numbers)

    assert class_of(slips(2), slips(2)) == gate.EQUAL
    assert class_of(slips(2), slips(3)) == gate.EVENTS
    # the reference alone changes its number with its tolerance
    assert class_of(slips(2), slips(3), slips(3)) == gate.WITHIN


def test_the_place_of_a_largest_value_on_a_plateau_is_listed_only():
    old, new = (recorded(COURSE, phase_peak_time=event(at, "s")) for at in (0.1, 0.9))
    assert class_of(old, new) == gate.WITHIN
    assert "phase_peak_time 4.0e-01" in map(str, gate.compare(old, new, old))


def test_scenes_run_in_the_process_of_a_tree_which_may_refuse_them(tmp_path):
    lens = scenes.lens(2, 3, drive=scenes.RAMP, bonds=scenes.COUNTED)
    mine = {"a lens": (lens, {"ensemble.members": 4}), "none": (lens, {"solid": {}})}
    results = gate.run_tree(gate.ROOT, tmp_path / "new", mine)
    lens, none = results.values()
    assert lens.sizes["member"] == 4 and none.startswith("BadInput: ")
    assert gate.verdict_of(none, gate.compare(none, none, none)) == gate.REFUSED
    for pair in ((lens, none), (none, lens)):
        assert class_of(*pair) == gate.OUTSIDE
    line = gate.report("a lens", lens, gate.compare(lens, none, lens))
    assert "(ramp, counted, uniform, equilibrium)" in line and "solid" in line


@pytest.mark.parametrize("name", scenes.RARE)
def test_the_scenes_of_rare_models_are_not_refused(name):
    assert load(scenes.tables(name, scenes.RARE[name])).sweep


@pytest.mark.skipif(
    not (gate.ROOT / ".git").exists(), reason="a source archive has no commits"
)
def test_a_commit_is_checked_out_and_random_scenes_are_those_of_the_tests(tmp_path):
    tree = gate.check_out("HEAD", tmp_path)
    assert (tree / "sim" / "starter.toml").is_file()
    names = scenes.gathered(gate.ROOT, 3).keys()
    assert {"pdms_lens", "starter", "random 0", "corner 1", *scenes.RARE} <= names
    assert "random 1" not in names
