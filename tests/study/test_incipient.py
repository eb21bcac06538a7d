"""The empirical law of the area before sliding, its fit over several loads, and theories beside it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import sim
from sim.laws import jkr, theories
from sim.laws.incipient import Incipient
from sim.study import measurement
from sim.study.likelihood import interval, minimum
from sim.study.mechanisms import others
from sim.units.errors import BadInput

SCENARIO = Path(__file__).parents[2] / "scenarios" / "incipient_fit.toml"
TABLE = SCENARIO.with_suffix(".csv")
#: Numbers with which the table was made: alpha at 0.3 mm², and its power.
HIDDEN = 2e-4, 1.5
FREE = "incipient.shrinkage", "incipient.exponent"


def table(path, rows, head="normal_load [N], tangential_force [N], contact_area [m^2]"):
    """Write a table of measured areas."""
    lines = [head, *(", ".join(map(repr, map(float, row))) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def areas(load, force, exponent=1.5):
    """Return areas by the law, from its own formula with beta in m^5/N^2 at an exponent of 3/2."""
    scenario = sim.load(SCENARIO)
    size, modulus, _ = scenario.bodies.numbers
    at_rest = np.pi * jkr.radius_at_load(load, 0.03, size, modulus) ** 2
    beta = 2e-4 * 3e-7**exponent
    return at_rest - beta * at_rest**-exponent * force**2


def test_the_law_is_that_of_the_source_whatever_the_area_that_states_it():
    for area in (1e-7, 5e-6):
        law = Incipient(shrinkage=2e-4 * (area / 3e-7) ** -1.5, area=area)
        assert_allclose(law.coefficient, 2e-4 * 3e-7**1.5, rtol=1e-12)
        found = law.area_at([2e-7, 8e-7], [5e-3, 1e-2])
        beta, at_rest = law.coefficient, np.array([2e-7, 8e-7])
        expected = at_rest - beta * at_rest**-1.5 * np.array([5e-3, 1e-2]) ** 2
        assert_allclose(found, expected, rtol=1e-12)
    assert float(law.area_at(1e-7, 1.0)) == 0.0


def test_exact_areas_at_three_loads_give_the_numbers_that_made_them(tmp_path):
    rows = [
        (load, force, areas(load, force), 1e-9)
        for load, most in ((2e-3, 8e-3), (1e-2, 1.8e-2), (5e-2, 5e-2))
        for force in np.linspace(0.0, most, 5)
    ]
    head = "normal_load [N], tangential_force [N], contact_area [m^2], contact_area_error [m^2]"
    result = sim.fit(SCENARIO, table(tmp_path / "exact.csv", rows, head), FREE)
    assert_allclose([*result.values.values()], HIDDEN, rtol=1e-6)


@pytest.mark.parametrize("name", ["savkoor_briggs", "shear_share"])
def test_a_theory_beside_the_law_has_its_own_radius_at_the_force(name):
    problem = sim.fit(SCENARIO, TABLE, FREE).problem
    other = next(other for _, other in others(problem) if other.theory == name)
    x = [0.3] * len(other.free)
    size, modulus, ratio = sim.load(SCENARIO).bodies.numbers
    conditions = problem.tables[0].conditions
    load, force = conditions["mount"], conditions["tangential_force"]
    share = {"savkoor_briggs": 1.0, "shear_share": 0.3}[name]
    # full stick at the force times the root of the share
    radius = theories.savkoor_briggs_at_load(
        load, 0.03, np.sqrt(share) * force, size, modulus, ratio
    )
    assert_allclose(other.steady(np.array(x)), np.pi * radius**2, rtol=1e-12)
    assert not [item.key for item in other.free if item.key.startswith("incipient")]


def test_one_load_cannot_tell_the_power(tmp_path):
    rows = [(1e-2, force, areas(1e-2, force)) for force in np.linspace(0.0, 2e-2, 6)]
    with pytest.raises(BadInput, match="only together"):
        sim.fit(SCENARIO, table(tmp_path / "one.csv", rows), FREE)


@pytest.mark.parametrize(
    ("changes", "head", "cure"),
    [
        ({"drive.speed": 1e-3}, "", "at rest"),
        ({}, "speed [m/s], tangential_force [N], contact_area [m^2]", "omit t and"),
        ({}, "normal_load [N], tangential_force [N], bond_fraction", "contact_area"),
    ],
)
def test_what_does_not_go_with_a_tangential_force_is_refused(
    tmp_path, changes, head, cure
):
    rows = [(1e-3, force, 1e-7) for force in (1e-3, 2e-3, 3e-3)]
    path = table(tmp_path / "bad.csv", rows, *([head] if head else []))
    with pytest.raises(BadInput, match=cure):
        sim.fit(sim.load(SCENARIO, changes), path, FREE[:1])


def test_the_numbers_of_the_law_have_no_default_and_a_scene_without_it_no_column():
    for key in ("shrinkage", "area"):
        left = {"shrinkage": 1e-4, "area": 1e-7}
        del left[key]
        with pytest.raises(BadInput, match=f"incipient.*{key}"):
            sim.load(SCENARIO, {"incipient": left})
    scenario = sim.load(SCENARIO.with_name("creep.toml"))
    assert "tangential_force" not in measurement.conditions_of(scenario)


@pytest.mark.verify
@pytest.mark.timeout(3600)
def test_intervals_of_95_percent_hold_the_hidden_numbers_as_often_as_they_say():
    """Of 200 repetitions between 88 and 99.5 % hold: beyond four standard errors of a share of 95 %."""
    problem = sim.fit(SCENARIO, TABLE, FREE).problem
    hidden = np.array(
        [item.inner(x) for item, x in zip(problem.free, HIDDEN, strict=True)]
    )
    expected = problem.predicted(hidden)
    rng, held = np.random.default_rng(0), np.zeros((200, 2))
    for row in held:
        drawn = expected + problem.sigma * rng.standard_normal(len(expected))
        repeated = replace(problem, values=drawn)
        best = minimum(repeated, repeated.start)
        for k, value in enumerate(HIDDEN):
            span = interval(repeated, best, k)
            row[k] = span.low <= value <= span.high
    assert np.all((held.mean(axis=0) >= 0.88) & (held.mean(axis=0) <= 0.995))
