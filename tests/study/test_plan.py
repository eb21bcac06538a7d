"""Plans of measurements against closed forms, and against fits and verdicts of many simulated data sets."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from scipy import stats
from study.test_fit import BEHIND, LENS, SPRUNG, still

import sim
from sim.cli import cli
from sim.scenario.files import written
from sim.scenario.reader import load
from sim.study import fit as fits, likelihood, mechanisms, plan as planning
from sim.study.mechanisms import WHOLE
from sim.units.errors import BadInput

#: Keys of the curve of areas, and the same with the friction.
AREA_KEYS = ["adhesion.bond_share", "bonds.critical_speed", "shear.spectrum.rms"]
BOTH_KEYS = ["bonds.critical_speed", "bonds.stress", "shear.spectrum.rms"]
BELOW_ONSET, ACROSS = np.geomspace(1e-5, 9e-4, 8), np.geomspace(1e-5, 1e-2, 12)


def points(path, speeds, error, names=("contact_area",)):
    """Write a table of speeds with relative errors in percent."""
    header = ",".join(["speed [m/s]", *(f"{name}_error [%]" for name in names)])
    rows = [
        ",".join([f"{speed:.8g}", *[f"{error:g}"] * len(names)]) for speed in speeds
    ]
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def problem_of(scene, path, keys):
    table = planning._read(path, scene)
    return planning._predicted(
        scene, [table], [fits.free_number(scene, key) for key in keys], {}
    )


def drawn(problem, expected, count, seed):
    return itertools.islice(
        mechanisms.draws_of(problem, expected, np.random.default_rng([77, seed])), count
    )


def test_the_interval_to_expect_from_areas_at_rest_is_the_closed_form_of_jkr(tmp_path):
    # without load the area goes with the power 2/3 of the work of adhesion
    path = tmp_path / "rest.csv"
    path.write_text(
        "normal_load [N],contact_area_error [%]\n" + "0,1\n" * 9, encoding="utf-8"
    )
    result = sim.plan(still(), path, ["adhesion.work"], sims=50)
    (item,), spread = result.numbers, 1.5 * 0.01 / math.sqrt(9.0)
    ends = np.log([item.interval.low, item.interval.high]) - math.log(42e-3)
    # curved by the errors over 3
    assert_allclose(ends, 1.959964 * spread * np.array([-1.0, 1.0]), rtol=0.02)
    assert (
        item.low_open.probability
        == item.high_open.probability
        == 0.0
        < item.low_open.error
    )
    assert not result.probabilities and not result.points
    assert any("do not act" in remark for remark in result.remarks)
    assert any("no column has the speed" in remark for remark in result.remarks)


@pytest.fixture
def few_starts(monkeypatch):
    """Fewer starts of each search: what it misses without the others is seen in ``make verify``."""
    monkeypatch.setattr(mechanisms, "_STARTS", 2)


def test_measured_values_are_not_used_noise_is_said_and_errors_may_have_units(
    tmp_path, monkeypatch, few_starts
):
    bare, valued = (
        points(tmp_path / "bare.csv", BELOW_ONSET, 3.0),
        tmp_path / "valued.csv",
    )
    rows = [
        f"{speed:.8g},{area},3"
        for speed, area in zip(BELOW_ONSET, np.linspace(0.02, 0.07, 8), strict=True)
    ]
    valued.write_text(
        "speed [m/s],contact_area [mm^2],contact_area_error [%]\n" + "\n".join(rows),
        encoding="utf-8",
    )
    scene = load(SPRUNG | {"shear": {"model": "uniform"}})
    plain, other = (
        sim.plan(scene, path, ["bonds.critical_speed"], sims=50)
        for path in (bare, valued)
    )
    assert (
        plain.numbers == other.numbers and len(other.remarks) == len(plain.remarks) + 1
    )
    assert any("measured values are not used" in remark for remark in other.remarks)
    absolute = tmp_path / "absolute.csv"
    sigma = problem_of(scene, bare, ["bonds.critical_speed"]).sigma
    rows = [
        f"{speed:.8g},{1e6 * size:.12g}"
        for speed, size in zip(BELOW_ONSET, sigma, strict=True)
    ]
    absolute.write_text(
        "speed [m/s],contact_area_error [mm^2]\n" + "\n".join(rows), encoding="utf-8"
    )
    assert_allclose(
        problem_of(scene, absolute, ["bonds.critical_speed"]).sigma, sigma, rtol=1e-10
    )
    noisy = LENS["shear"] | {
        "model": "banded",
        "points": 64,
        "cell": "0.12 mm",
        "correlation": {"model": "slip", "length": "5 um"},
    }
    monkeypatch.setattr(planning, "_SPEEDS", 0)
    for shear, is_noisy in ((noisy, True), (LENS["shear"], False)):
        found = sim.plan(
            LENS | {"shear": shear}, bare, ["bonds.critical_speed"], sims=50
        )
        assert any("have noise" in remark for remark in found.remarks) == is_noisy


def test_points_without_errors_drives_with_a_slider_and_keys_without_effect_are_refused_in_one_line(
    tmp_path,
):
    path, two = (
        tmp_path / "bad.csv",
        "speed [m/s],contact_area_error [%]\n1e-3,1\n2e-3,1\n",
    )
    for text, key, scene, cure in (
        (
            "speed [m/s]\n1e-3\n2e-3\n",
            "bonds.stress",
            LENS,
            'contact_area has no standard errors.*"contact_area_error',
        ),
        (
            "speed [m/s],contact_area [m^2]\n1e-3,1\n",
            "bonds.stress",
            LENS,
            "contact_area has no standard errors",
        ),
        (
            two.replace(",1", ",0"),
            "bonds.stress",
            LENS,
            "line 2: contact_area_error must",
        ),
        ("contact_area_error [%]\n1\n2\n", "bonds.stress", LENS, 'add "t'),
        (two, "bonds.stress", SPRUNG, "has no effect"),
        (two, "drive.mass", BEHIND, "needs runs"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(BadInput, match=cure) as refused:
            sim.plan(scene, path, [key])
        (line,) = refused.value.problems
        assert "\n" not in line


def test_a_mechanism_that_has_none_of_the_free_keys_has_no_idle_ones(
    tmp_path, monkeypatch, few_starts
):
    monkeypatch.setattr(planning, "_SPEEDS", 0)
    (tmp_path / "points.csv").write_text(
        "speed [mm/s],contact_area_error [%]\n0.1,1\n1,1\n3,1\n", encoding="utf-8"
    )
    files = tmp_path / "points.csv", ["shear.spectrum.rms"]
    result = sim.plan("scenarios/pdms_lens.toml", *files, sims=50)
    assert set(result.probabilities) == {WHOLE, "bonds only", "fluctuations only"}


def test_points_that_two_standard_errors_do_not_tell_from_the_best_are_proposed_as_well():
    probabilities = [(0.9, 0.8), (0.86, 0.8), (0.8, 0.77), None]
    points = [
        planning.Point(
            {},
            str(k),
            {},
            {str(n): planning.Chance(p, 0.02) for n, p in enumerate(pair or ())},
        )
        for k, pair in enumerate(probabilities)
    ]
    # the error of a sum of two is 0.02 √2, and of a difference of two sums 0.04
    plan = planning.Plan(
        None,
        (),
        {"0": planning.Chance(0.84, 0.02), "1": planning.Chance(0.77, 0.02)},
        tuple(points),
        (),
    )
    assert [item.words for item in plan.best] == [
        "0",
        "1",
    ] and plan.advice == "measure next at 0 or 1"
    # 0.07 less, not 0.09
    near = {"0": planning.Chance(0.86, 0.02), "1": planning.Chance(0.77, 0.02)}
    assert "no candidate" in plan._replace(probabilities=near).advice
    assert planning.Plan(None, (), near, (), ()).advice == ""


def test_speeds_beyond_the_candidates_are_proposed_only_if_a_probability_can_still_rise(
    tmp_path, monkeypatch, few_starts
):
    monkeypatch.setattr(planning, "_SPEEDS", 2)
    for error, can_rise in ((1.0, False), (20.0, True)):
        path = points(tmp_path / "points.csv", ACROSS[::3], error)
        result = sim.plan(load(SPRUNG), path, ["shear.spectrum.rms"], sims=50)
        chances = result.best[0].probabilities.values()
        assert all(chance.probability == 1.0 for chance in chances) != can_rise
        assert any("speeds beyond" in text for text in result.remarks) == can_rise


def test_the_command_proposes_a_point_above_the_onset_and_draws_what_it_prints(
    tmp_path, monkeypatch, few_starts
):
    scenario, further = tmp_path / "lens.toml", tmp_path / "further.csv"
    scenario.write_text(written(SPRUNG), encoding="utf-8")
    path = points(tmp_path / "points.csv", BELOW_ONSET, 3.0)
    further.write_text("speed [mm/s]\n0.02\n3\n", encoding="utf-8")
    words = [
        "fit",
        scenario,
        path,
        "--plan",
        "--candidates",
        further,
        "--sims",
        50,
        "--seed",
        3,
    ]
    words += [word for key in AREA_KEYS[1:] for word in ("--free", key)]
    original, results = planning.plan, []
    monkeypatch.setattr(
        planning,
        "plan",
        lambda *given, **named: results.append(original(*given, **named)) or results[0],
    )
    done = CliRunner().invoke(cli, list(map(str, words)))
    assert done.exit_code == 0, done.output
    assert "measure next at V = 3 mm/s" in done.output and "(open)" in done.output
    numbers = json.loads((tmp_path / "lens_plan.json").read_text(encoding="utf-8"))
    best = numbers["points"][0]
    assert_allclose(best["conditions"]["speed"], 3e-3, rtol=1e-12)
    for truth in ("bonds only", "fluctuations only"):
        assert (
            best["probabilities"][truth]["probability"]
            > numbers["probabilities"][truth]["probability"]
        )
    assert (tmp_path / "lens_plan.png").read_bytes().startswith(b"\x89PNG")
    (result,) = results
    assert [point.probabilities for point in result.points] == [
        {
            truth: planning.Chance(**chance)
            for truth, chance in point["probabilities"].items()
        }
        for point in numbers["points"]
    ]
    (panel,) = planning.figure(result).axes
    bars = [bar.lines[0].get_data() for bar in panel.containers]
    probabilities = {
        chance.probability
        for point in result.points
        for chance in point.probabilities.values()
    }
    assert {float(y) for _, places in bars for y in places} == probabilities
    again = CliRunner().invoke(cli, list(map(str, [*words, "--compare"])))
    assert isinstance(again.exception, BadInput)


def test_the_search_of_a_verdict_leaves_the_minimum_of_the_fit_for_a_lower_one(
    tmp_path,
):
    """Curves of fluctuations alone, with errors for which few bonds that break early are better than all."""
    problem = problem_of(
        load(SPRUNG), points(tmp_path / "points.csv", ACROSS, 4.0), AREA_KEYS
    )
    expected = planning._Design(problem).expected["fluctuations only"]
    (values,) = itertools.islice(drawn(problem, expected, 103, 0), 102, None)
    data = replace(problem, values=values)
    best = likelihood.minimum(data, data.start)
    assert (
        mechanisms.Search(data, [best.x]).exact(values).chi_square
        < best.chi_square - 3.0
    )


@pytest.mark.verify
@pytest.mark.parametrize(
    ("truth", "error"), [("bonds only", 4.0), ("fluctuations only", 4.0), (WHOLE, 2.3)]
)
def test_probabilities_are_those_of_the_verdict_over_200_data_sets(
    tmp_path, truth, error
):
    scene, count = load(SPRUNG), 200
    problem = problem_of(
        scene, points(tmp_path / "points.csv", ACROSS, error), AREA_KEYS
    )
    design = planning._Design(problem)
    predicted = design.simulated(400, 1).probabilities[truth]
    hits = 0
    for seed, values in enumerate(drawn(problem, design.expected[truth], count, 0)):
        data = replace(problem, values=values)
        best = likelihood.minimum(data, data.start)
        hits += mechanisms.compare(data, best, seed).sufficient == truth
    observed = planning.Chance.of(np.arange(count) < hits)
    assert 0.1 < observed.probability < 0.95  # else nothing is tested
    assert abs(predicted.probability - observed.probability) <= 3.0 * math.hypot(
        predicted.error, observed.error
    )


def test_an_interval_reaches_to_values_that_another_explanation_leaves_possible(
    tmp_path,
):
    # fluctuations explain these areas best, and bonds alone nearly as well
    path = points(tmp_path / "points.csv", BELOW_ONSET, 3.0)
    problem = problem_of(load(SPRUNG), path, AREA_KEYS)
    (values,) = itertools.islice(drawn(problem, problem.values, 2, 1), 1, None)
    data, k = replace(problem, values=values), AREA_KEYS.index("shear.spectrum.rms")
    best, item = likelihood.lowest(data), problem.free[k]
    bonds = replace(data, free=data.free[:k], fixed={item.key: item.low})
    rise = likelihood.lowest(bonds).chi_square - best.chi_square
    level = stats.chi2.ppf(likelihood.LEVEL, 1)
    assert 0.0 < rise < level and item.outer(best.x[k]) > 1e3 * item.low
    result = likelihood.interval(data, best, k)
    assert result.low == item.low and result.low_open and not result.high_open
    # with errors half as large they are rejected
    sharp = replace(data, sigma=0.4 * data.sigma)
    best = likelihood.lowest(sharp)
    bonds = replace(bonds, sigma=sharp.sigma)
    assert likelihood.lowest(bonds).chi_square - best.chi_square > level
    assert not likelihood.interval(sharp, best, k).low_open


@pytest.mark.parametrize("draw", [15, 17, 31])
def test_an_interval_has_no_end_where_a_search_for_it_stops_on_its_way(tmp_path, draw):
    # its sum of squares rises steadily to the bound, by less than the level
    path = points(tmp_path / "points.csv", BELOW_ONSET, 3.0)
    problem = problem_of(load(SPRUNG), path, AREA_KEYS)
    (values,) = itertools.islice(
        drawn(problem, problem.values, draw + 1, 1), draw, None
    )
    data, k = replace(problem, values=values), AREA_KEYS.index("shear.spectrum.rms")
    best, item = likelihood.lowest(data), problem.free[k]
    bonds = replace(data, free=data.free[:k], fixed={item.key: item.low})
    rise = likelihood.lowest(bonds).chi_square - best.chi_square
    assert 0.0 < rise < stats.chi2.ppf(likelihood.LEVEL, 1)
    result = likelihood.interval(data, best, k)
    assert result.low == item.low and result.low_open and not result.high_open


@pytest.mark.verify
@pytest.mark.parametrize(
    ("changes", "speeds", "error", "names", "keys"),
    [
        ({}, ACROSS, 1.0, ["contact_area", "friction_force"], BOTH_KEYS[:1]),
        ({}, ACROSS, 1.0, ["contact_area", "friction_force"], BOTH_KEYS[:2]),
        ({}, ACROSS, 1.0, ["contact_area", "friction_force"], BOTH_KEYS),
        (
            {"adhesion.bond_share": 1.0},
            ACROSS,
            2.0,
            ["contact_area", "friction_force"],
            [AREA_KEYS[0], *BOTH_KEYS[:2]],
        ),
        ({"shear.spectrum.rms": 4e5}, ACROSS, 2.0, ["contact_area"], AREA_KEYS[1:]),
        ({}, BELOW_ONSET, 3.0, ["contact_area"], AREA_KEYS),
    ],
    ids=[
        "one key",
        "two keys",
        "three keys",
        "at a bound",
        "masked",
        "below the onset",
    ],
)
def test_intervals_to_expect_are_those_of_200_fits(
    tmp_path, changes, speeds, error, names, keys
):
    scene = load(SPRUNG).with_values(changes)
    path = points(tmp_path / "points.csv", speeds, error, names)
    result = sim.plan(scene, path, keys, sims=400)
    problem, rows = result.problem, []
    for values in drawn(problem, problem.values, 200, 1):
        data = replace(problem, values=values)
        best = likelihood.lowest(data)
        rows.append([likelihood.interval(data, best, k) for k in range(len(keys))])
    for item, ends in zip(result.numbers, zip(*rows, strict=True), strict=True):
        low, high, *is_open = np.transpose(ends)
        size = math.log if item.free.logarithmic else float
        width = size(item.interval.high) - size(item.interval.low)
        if width < 0.5 and not any(item.interval[2:]):
            scale = np.log if item.free.logarithmic else np.asarray
            assert_allclose(width, np.median(scale(high) - scale(low)), rtol=0.1)
            continue
        for predicted, flags in zip(item[2:], is_open, strict=True):
            observed = planning.Chance.of(flags == 1.0)
            error = math.hypot(predicted.error, observed.error)
            assert abs(predicted.probability - observed.probability) <= 3.0 * error, (
                item.free.key
            )


@pytest.mark.verify
def test_the_proposed_point_is_among_the_best_three_of_twenty_by_simulation(tmp_path):
    scene, path = load(SPRUNG), points(tmp_path / "points.csv", BELOW_ONSET, 3.0)
    best = sim.plan(scene, path, AREA_KEYS, sims=200).points[0]
    table, free = (
        planning._read(path, scene),
        [fits.free_number(scene, key) for key in AREA_KEYS],
    )
    problem = planning._predicted(scene, [table], free, {})
    means = {}
    for row in planning._speeds(table):
        tables = [table, planning._with_errors(row, problem)]
        design = planning._Design(planning._predicted(scene, tables, free, {}))
        probabilities = design.simulated(200, 9).probabilities
        means[float(row.conditions["speed"][0])] = sum(
            chance.probability for chance in probabilities.values()
        )
    assert best.conditions["speed"] in sorted(means, key=means.__getitem__)[-3:]
