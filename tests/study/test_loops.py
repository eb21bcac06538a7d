"""Measured loops: zeros, drifts and correlated noise of an instrument, found from synthetic files of its form."""

import functools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose
from scipy import stats

import sim
from sim.cli import cli
from sim.ensemble.steady import history_at_rest, jump_into_contact
from sim.scenario.files import written as toml
from sim.scenario.reader import load
from sim.study import likelihood, measurement
from sim.study.fit import fit, free_number, zero_figure
from sim.study.likelihood import minimum, problem_of
from sim.study.noise import Noise, noise_of
from sim.units.errors import BadInput

#: True values behind the loop, and the stiffness of its sensor [N/m].
TRUTH = {
    "solid.youngs_modulus": 0.8e6,
    "adhesion.work": 35e-3,
    "contact.front_speed": 30e-9,
    "contact.front_exponent": 0.4,
}
STIFFNESS, ZERO, ZERO_LOAD, DRIFT = 3.0, 2.5e-6, -1.5e-9, 2e-11
#: Noise of the load.
NOISE = Noise(0.7e-9, 0.3, 10.0)
#: Loops of the quick test and of the long one.
_FEW, _MANY = 5, 200
#: First row in contact and last one [s]; the pull-off is later.
FIRST, LAST = 300.0, 460.0
SCENE = {
    "name": "loop",
    "seed": 1,
    "clock": {"duration": "1 s", "step": "1 s"},
    "solid": {"youngs_modulus": "0.8 MPa"},
    "sphere": {"radius": "7.5 um"},
    "adhesion": {"work": "35 mJ/m^2"},
    "contact": {
        "model": "rate_dependent",
        "front_speed": "30 nm/s",
        "front_exponent": 0.4,
        "stiffness": STIFFNESS,
        "displacement": "0 um",
    },
    "instrument": {
        "marker": "eoh",
        "encoding": "latin-1",
        "decimal": ",",
        "columns": [
            "1: displacement [um]",
            "2: normal_load [nm * 3 N/m]",
            "3: t [s]",
        ],
        "stretch": [f"{FIRST - 0.1} s:{LAST + 0.1} s"],
        "baseline": ["0 s:295 s"],
        "every": 4,
    },
    "zero": {"displacement": "2.4 um"},
}
#: True zeros, and those to free with their bounds.
WHERE = {"zero.displacement": ZERO, "zero.load": ZERO_LOAD}
ZEROS = ["zero.displacement=2.2 um:2.8 um", "zero.load=-20 nN:20 nN"]


@functools.cache
def loads_of(deepest):
    """Return times, depths and loads of a loop without an instrument [SI]."""
    time = np.arange(0.0, LAST + 0.5)
    turn = 0.5 * (FIRST + LAST) - 20.0
    depth = deepest - 20e-9 * np.abs(time - turn)
    rows = time >= FIRST
    scene = load({k: v for k, v in SCENE.items() if k not in ("instrument", "zero")})
    inside = time[rows] - FIRST
    scene = scene.with_values(
        {
            "clock": {"duration": inside[-1], "step": 1.0},
            "contact.displacement": {"time": inside, "value": depth[rows]},
        }
    )
    load_of = np.zeros(len(time))
    load_of[rows] = sim.run(scene).normal_load.values
    return time, depth, load_of


def loop(zero=ZERO, deepest=1e-6, noise=None, seed=0, drift=DRIFT):
    """Return times, readings of the displacement and the load of a loop with its zeros, drift and noise [SI]."""
    time, depth, load_of = loads_of(deepest)
    load_of = load_of + ZERO_LOAD + drift * (time - FIRST)
    if noise is not None:
        load_of += noise.drawn(time, np.random.default_rng([77, seed]))
    return time, depth + zero, load_of


def written(path, time, displacement, load_of):
    """Write a loop as an instrument would: headings with wrong units, decimal commas, a degree sign in latin-1."""
    head = (
        "Measurement\n\nPiezo position[nm]\tMEMS displ.[nm]\tTime[ms]\tTemp [°C]\neoh\n"
    )
    columns = 1e6 * displacement, 1e9 * load_of / STIFFNESS, time
    rows = [
        "\t".join([f"{x:.12g}" for x in row] + ["22.1"])
        for row in zip(*columns, strict=True)
    ]
    text = head + "\n".join(rows).replace(".", ",") + "\n"
    path.write_bytes(text.encode("latin-1"))
    return path


def test_a_history_at_rest_is_the_run_of_its_course():
    scene = load({k: v for k, v in SCENE.items() if k not in ("instrument", "zero")})
    time, depth = np.array([0.0, 10.0, 40.0, 50.0]), np.array([0.0, 2e-7, -1e-7, 0.0])
    scene = scene.with_values(
        {
            "clock": {"duration": 50.0, "step": 10.0},
            "contact.displacement": {"time": time, "value": depth},
        }
    )
    run = sim.run(scene)
    course = history_at_rest(scene, run.t.values[:, np.newaxis])
    assert_allclose(course.radius[:, 0], run.contact_radius.values, rtol=1e-7)


def posed(path, keys, errors=(), **changes):
    """Return the problem of a loop in a file for some free keys, with its baseline."""
    scene = load(SCENE).with_values(changes)
    tables = [measurement.read(path, scene)]
    tables = measurement.with_stated_errors(tables, errors)
    return problem_of(scene, tables, [free_number(scene, key) for key in keys], {})


def test_zeros_and_a_drift_without_noise_are_found_with_all_that_they_move(tmp_path):
    path = written(tmp_path / "loop.txt", *loop())
    keys = [*TRUTH, *ZEROS, "zero.load_drift=-1 nN/s:1 nN/s"]
    start = {"adhesion.work": 33e-3, "zero.displacement": 2.47e-6}
    problem = posed(path, keys, ["normal_load=1 nN"], **start)
    best = minimum(problem, problem.start)
    drifts = {"zero.load_drift": DRIFT}
    errors = np.sqrt(np.diag(best.covariance))
    truth = [item.inner((TRUTH | WHERE | drifts)[item.name]) for item in problem.free]
    # the edge is integrated to 1e-8 of the load of 1 uN, and an error is 1 nN
    assert np.all(np.abs(best.x - truth) < 1e-2 * errors)
    assert best.chi_square < 1e-4
    # a zero is subtracted from the reading, and so moves the course by as much
    moved = posed(
        written(tmp_path / "other.txt", *loop(zero=ZERO + 3e-7)),
        keys,
        ["normal_load=1 nN"],
        **start,
    )
    there = np.array(truth)
    there[4] += 3e-7
    assert np.sum(moved.residuals(there) ** 2) < 1e-4


def test_loops_with_zeros_of_their_own_are_fitted_together_each_over_its_history(
    tmp_path,
):
    zeros, scene = {"shallow": ZERO, "deep": 2.65e-6}, load(SCENE)
    depths = {"shallow": 0.8e-6, "deep": 1.2e-6}
    scene = scene.with_values({"zero.load": ZERO_LOAD, "zero.load_drift": DRIFT})
    tables, free = [], [free_number(scene, key) for key in TRUTH]
    for k, (name, zero) in enumerate(zeros.items()):
        path = written(tmp_path / f"{name}.txt", *loop(zero, depths[name]))
        table = measurement.read(path, scene, place=(k, 2)).in_contact
        tables.append(table)
        item = free_number(scene, ZEROS[0])
        free.append(item._replace(key=f"{item.key} ({name})", table=k))
    tables = measurement.with_stated_errors(tables, ["1 nN"])
    problem = problem_of(scene, tables, free, {})
    truth = [item.inner(TRUTH[key]) for key, item in zip(TRUTH, free, strict=False)]
    start = np.array([*truth, 2.48e-6, 2.67e-6])
    best = minimum(problem, start + np.array([0.05, -0.05, 0.1, -0.05, 0.0, 0.0]))
    errors = np.sqrt(np.diag(best.covariance))
    assert np.all(np.abs(best.x - [*truth, *zeros.values()]) < 1e-2 * errors)


def least_sum(problem, keys=()):
    """Return the least chi^2, with some keys held at the truth."""
    truth = {**TRUTH, **WHERE, "zero.load_drift": DRIFT}
    free = [item for item in problem.free if item.name not in keys]
    place = np.array([item.inner(truth[item.name]) for item in free])
    held = replace(problem, free=free, fixed={key: truth[key] for key in keys})
    return minimum(held, place).chi_square


def test_the_truth_is_as_likely_as_it_should_be_with_the_noise_of_the_baseline_and_not_if_it_were_independent(
    tmp_path,
):
    rises, noise = np.zeros((_FEW, 2)), NOISE._replace(share=0.6, time=20.0)
    for seed in range(_FEW):
        drawn = loop(noise=noise, seed=seed, drift=0.0)
        problem = posed(written(tmp_path / "loop.txt", *drawn), [*TRUTH, *ZEROS])
        every = [*TRUTH, *WHERE]
        for k, each in enumerate((problem, replace(problem, whitening=()))):
            rises[seed, k] = least_sum(each, every) - least_sum(each)
    law = stats.chi2(_FEW * (len(TRUTH) + len(ZEROS)))
    sums = rises.sum(axis=0)
    assert law.ppf(1e-4) < sums[0] < law.ppf(1.0 - 1e-4), sums
    assert sums[1] > law.ppf(1.0 - 1e-4), sums


@pytest.mark.verify
@pytest.mark.parametrize(
    "keys", [[*TRUTH][:2], [*TRUTH][2:], [*WHERE, "zero.load_drift"]], ids=" ".join
)
def test_intervals_of_200_loops_with_hidden_zeros_drift_and_correlated_noise_hold_the_truth_in_88_to_99_of_100(
    tmp_path, keys
):
    inside = np.zeros(len(keys))
    # an interval of the profile likelihood holds a value whose rise is below this
    bound = stats.chi2.ppf(likelihood.LEVEL, 1)
    for seed in range(_MANY):
        path = written(tmp_path / "loop.txt", *loop(noise=NOISE, seed=1000 + seed))
        problem = posed(path, [*TRUTH, *ZEROS, "zero.load_drift=-1 nN/s:1 nN/s"])
        least = least_sum(problem)
        inside += [least_sum(problem, [key]) - least < bound for key in keys]
    assert np.all((inside >= 0.88 * _MANY) & (inside <= 0.995 * _MANY)), inside


def test_the_noise_of_a_baseline_is_found_with_its_correlation_whatever_its_zero_and_drift():
    time = np.arange(0.0, 300.0)
    laws = [NOISE, NOISE._replace(share=0.8)]
    for law in laws:
        drawn = [
            noise_of(
                time,
                law.drawn(time, np.random.default_rng([5, k])) + 1e-8 - 1e-11 * time,
            )
            for k in range(4)
        ]
        sigma, share, memory = np.median(drawn, axis=0)
        # variances of few memories in a baseline
        assert 0.75 < sigma / law.sigma < 1.25
        assert abs(share - law.share) < 0.15
        assert 0.4 < memory / law.time < 2.5
    white = noise_of(time, np.random.default_rng(3).standard_normal(len(time)))
    assert abs(white.sigma - 1.0) < 5.0 / np.sqrt(2 * len(time))
    assert white.share < 0.3


def test_the_command_prints_and_draws_the_profile_of_a_free_zero_and_says_that_it_decides(
    tmp_path,
):
    path = written(tmp_path / "loop.txt", *loop())
    scene = tmp_path / "loop.toml"
    scene.write_text(toml(SCENE), encoding="utf-8")
    command = ["fit", str(scene), str(path), "--free", "solid.youngs_modulus"]
    command += ["--free", ZEROS[0], "--errors", "5 nN", "-o", str(tmp_path / "out")]
    changes = ["--set", "zero.load=-1.5 nN", "--set", "instrument.every=16"]
    result = CliRunner().invoke(cli, [*command, *changes])
    assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "out_fit.json").read_text(encoding="utf-8"))
    (profile,) = found["zero_profiles"]
    sums, zeros = np.array(profile["chi_squares"]), np.array(profile["values"])
    least = np.argmin(sums)
    assert (
        abs(zeros[least] - ZERO)
        < 3 * found["numbers"]["zero.displacement"]["standard_error"]
    )
    assert_allclose(sums[least], found["chi_square"], atol=1e-3)
    assert np.all(np.diff(sums[: least + 1]) < 0) and np.all(np.diff(sums[least:]) > 0)
    # the scenario's zero is 0.1 um off
    held = zeros == 2.4e-6
    modulus = np.array(profile["numbers"]["solid.youngs_modulus"])
    assert held.sum() == 1 and abs(modulus[held] / 0.8e6 - 1.0) > 0.05
    (said,) = (text for text in found["remarks"] if "the zero decides" in text)
    assert "held at 2.4 µm, solid.youngs_modulus is" in said
    # between places of the profile its root is nearly straight
    low = found["numbers"]["zero.displacement"]["low"]
    left = (zeros <= zeros[least]) & (zeros > 2.4e-6)
    roots = np.sqrt(np.maximum(sums[left] - found["chi_square"], 0.0))
    end = np.interp(low, zeros[left], roots) ** 2
    assert_allclose(end, stats.chi2.ppf(0.95, 1), rtol=0.05)
    assert (tmp_path / "out_fit_zero.png").stat().st_size > 0
    fitted = load(tmp_path / "out_fit.toml")
    assert_allclose(fitted.zero.displacement, ZERO, rtol=1e-3)
    # twin: a held zero has no profile
    command[5:7] = []
    result = CliRunner().invoke(
        cli, [*command, *changes, "--set", "zero.displacement=2.5 um", "--force"]
    )
    found = json.loads((tmp_path / "out_fit.json").read_text(encoding="utf-8"))
    assert "zero_profiles" not in found
    assert not any("the zero decides" in text for text in found["remarks"])


def test_a_point_that_carries_chi_square_is_named_and_none_is_without_it(tmp_path):
    time, displacement, load_of = loop(noise=NOISE)
    path = tmp_path / "loop.txt"
    keys = ["solid.youngs_modulus=0.5 MPa:1 MPa"]
    held = {"zero.displacement": ZERO, "zero.load": ZERO_LOAD, "zero.load_drift": DRIFT}
    scene = load(SCENE).with_values(held)
    for off, count in ((0.0, 0), (2e-8, 1)):
        row = int(FIRST) + 40
        there = load_of.copy()
        there[row] += off
        written(path, time, displacement, there)
        result = fit(scene, [path], keys, errors=["1 nN"])
        heavy = [text for text in result.remarks if "few points" in text]
        assert len(heavy) == count
        assert not count or "normal_load: row 11 " in heavy[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"instrument.stretch": ["900 s:990 s"]}, "0 rows between 900 and 990 s"),
        ({"instrument.baseline": ["0 s:3 s"]}, "fewer than 30"),
        ({"instrument.baseline": ["0 s:350 s"]}, "must end before the stretch"),
        (
            {"instrument.columns": ["2: normal_load [nN]", "1: displacement [um]"]},
            "add a column t",
        ),
        ({"drive": {"model": "steady", "speed": "1 um/s"}}, "omit t, or these columns"),
    ],
)
def test_what_a_loop_lacks_is_one_message_with_the_file(tmp_path, changes, words):
    path = written(tmp_path / "loop.txt", *loop())
    with pytest.raises(BadInput) as refusal:
        measurement.read(path, load(SCENE).with_values(changes))
    (problem,) = refusal.value.problems
    assert "loop.txt: " in problem and words in problem, problem


def test_rows_are_thinned_but_the_turn_of_the_mount_stays(tmp_path):
    time, displacement, load_of = loop()
    path = written(tmp_path / "loop.txt", time, displacement, load_of)
    table = measurement.read(path, load(SCENE).with_values({"instrument.every": 7}))
    rows = table.in_contact.conditions
    assert_allclose(rows["mount"].max(), displacement.max(), rtol=1e-11)
    assert rows["t"][[0, -1]].tolist() == [FIRST, LAST]
    steps = np.diff(rows["t"])
    assert steps.max() == 7.0 and np.sum(steps < 7.0) <= 3


@pytest.mark.parametrize("kind", ["displacement", "indentation"])
def test_a_sphere_jumps_in_where_it_touches_in_jkr_theory_and_at_the_reach_of_a_range_of_adhesion(
    kind,
):
    work, radius, modulus, stress = 35e-3, 7.5e-6, 0.8e6 / 0.75, 2e5
    held = {kind: 0.0} | ({"stiffness": STIFFNESS} if kind == "displacement" else {})
    rest = {k: v for k, v in SCENE.items() if k not in ("instrument", "zero")}
    at = {"solid.youngs_modulus": 0.8e6, "adhesion.work": work}
    scene = load(rest | {"contact": {"model": "equilibrium"} | held}).with_values(at)
    displacement, load_after = jump_into_contact(scene)
    assert displacement == 0.0
    # at grips a = (2 pi w R^2/E*)^(1/3), where P = -2 E* a^3/(3R)
    a = (2.0 * np.pi * work * radius**2 / modulus) ** (1.0 / 3.0)
    if kind == "indentation":
        assert_allclose(load_after, -2.0 * modulus * a**3 / (3.0 * radius), rtol=1e-12)
    else:
        # a spring of 3 N/m is softer than the contact, so that the sphere sinks in
        (run,) = np.ravel(sim.run(scene).normal_load.values[..., :1])
        assert_allclose(load_after, run, rtol=1e-12)
        assert -2.0 * modulus * a**3 / (3.0 * radius) < load_after < 0.0
    ranged = {"model": "cohesive", "cohesive_stress": stress} | held
    scene = load(rest | {"contact": ranged}).with_values(at)
    displacement, load_after = jump_into_contact(scene)
    assert_allclose(displacement, -work / stress, rtol=1e-14)
    # just inside the reach the contact has jumped already
    inside = {f"contact.{kind}": displacement * (1.0 - 1e-9)}
    (run,) = np.ravel(sim.run(scene.with_values(inside)).normal_load.values[..., :1])
    assert_allclose(load_after, run, rtol=1e-7)
    assert load_after < 0.0


def test_a_jump_into_contact_adds_the_inverse_of_its_variance_to_that_of_the_zero(
    tmp_path,
):
    path, error = written(tmp_path / "loop.txt", *loop(noise=NOISE, drift=0.0)), 2e-9
    reading = {"displacement": [ZERO], "displacement_error": error}
    scene = load(SCENE | {"jump_in": reading}).with_values({**TRUTH, **WHERE})
    table = measurement.read(path, scene)
    free = [free_number(scene, key) for key in [*TRUTH, *ZEROS]]
    problems = [
        problem_of(scene, [each], free, {})
        for each in (table._replace(jumps=()), table)
    ]
    without, beside = problems
    assert beside.freedom == without.freedom + 1
    truth = np.array(
        [item.inner({**TRUTH, **WHERE}[item.name]) for item in beside.free]
    )
    # the truth has no deviation at the jump
    assert_allclose(beside.off_jumps(truth), 0.0, atol=1e-9)
    before, after = (likelihood.covariance_at(each, truth) for each in problems)
    # the reading depends on the zero alone: a step of Kalman's filter
    column = before[:, 4]
    expected = before - np.outer(column, column) / (error**2 + column[4])
    scale = np.sqrt(np.diag(expected))
    assert_allclose(
        after / scale / scale[:, None], expected / scale / scale[:, None], atol=1e-6
    )
    spans = []
    for each in problems:
        best = minimum(each, truth)
        low, high, *_ = likelihood.interval(each, best, 4)
        assert low < ZERO < high
        spans.append(high - low)
    assert spans[1] < 0.9 * spans[0], spans


def test_a_range_of_adhesion_moves_the_reading_of_the_jump_and_a_common_error_its_load():
    ranged = {
        "model": "cohesive",
        "cohesive_stress": 2e5,
        "stiffness": STIFFNESS,
        "displacement": "0 um",
    }
    table = {"displacement": ["2.3 um"], "displacement_error": "5 nm"}
    table |= {"load": ["-40 nN"], "load_error": "5 nN"}
    rest = {k: v for k, v in SCENE.items() if k != "instrument"}
    scene = load(rest | {"contact": ranged, "jump_in": table})
    time = np.array([0.0, 1.0, 2.0])
    points = measurement.Measured(
        path=Path("loop.csv"),
        mount="displacement",
        conditions={"t": time, "mount": np.array([2.4e-6, 2.5e-6, 2.4e-6])},
        curves=(measurement.Curve("normal_load", time, 1.0 + time),),
        jumps=scene.jump_in.readings(0, 1),
    )
    free = [free_number(scene, "zero.displacement=2 um:3 um")]
    problem = problem_of(scene, [points], free, {"normal_load": 0.1})
    x = np.array([2.4e-6, 0.5])
    _, load_after = jump_into_contact(scene)
    expected = [2.4e-6 - 35e-3 / 2e5, 1.05 * load_after]
    assert_allclose(problem.predicted_jumps(x), expected, rtol=1e-12)
    off = [(2.3e-6 - expected[0]) / 5e-9, (-40e-9 - expected[1]) / 5e-9]
    assert_allclose(problem.residuals(x)[3:5], off, rtol=1e-9)


def test_the_command_reports_the_jump_into_contact_and_one_that_the_model_misses(
    tmp_path,
):
    path = written(tmp_path / "loop.txt", *loop(noise=NOISE, drift=0.0))
    held = {"displacement": "2.5 um", "load": "-1.5 nN", "load_drift": "0 nN/s"}
    for reading, missed in ((2.5e-6, False), (2.3e-6, True)):
        table = {"displacement": [reading], "displacement_error": "5 nm"}
        scene = tmp_path / "loop.toml"
        text = toml(SCENE | {"zero": held, "jump_in": table})
        scene.write_text(text, encoding="utf-8")
        command = ["fit", str(scene), str(path), "--free", "solid.youngs_modulus"]
        command += ["-o", str(tmp_path / "out"), "--set", "instrument.every=16"]
        result = CliRunner().invoke(cli, [*command, "--force"])
        assert result.exit_code == 0, result.output
        found = json.loads((tmp_path / "out_fit.json").read_text(encoding="utf-8"))
        (jump,) = found["jumps_into_contact"]
        assert_allclose([jump["value"], jump["fit"]], [reading, 2.5e-6], rtol=1e-12)
        assert "reading" in result.output
        words = "the jump into contact is missed by 40 errors"
        assert any(words in text for text in found["remarks"]) == missed


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({}, "has no reading"),
        ({"displacement": ["2.5 um"]}, "displacement_error belong together"),
        ({"load_error": "2 nN", "displacement": ["2 um"]}, "belong together"),
    ],
)
def test_a_jump_without_a_reading_or_its_error_is_refused(table, words):
    with pytest.raises(BadInput) as refusal:
        load(SCENE | {"jump_in": table})
    assert "jump_in" in refusal.value.problems[0]
    assert words in refusal.value.problems[0]


def test_a_jump_is_refused_under_a_load_and_without_a_history_and_for_other_files(
    tmp_path,
):
    table = {"displacement": ["2.5 um", "2.4 um"], "displacement_error": "5 nm"}
    scene = load(SCENE | {"jump_in": table})
    path = written(tmp_path / "loop.txt", *loop())
    for place, faulty in (((0, 1), True), ((1, 2), False), ((0, 3), True)):
        if faulty:
            with pytest.raises(BadInput, match=f"2 readings for {place[1]} files"):
                measurement.read(path, scene, place=place)
        else:
            (jump,) = measurement.read(path, scene, place=place).jumps
            assert jump.value == 2.4e-6
    rest = {k: v for k, v in SCENE.items() if k != "instrument"}
    rest["jump_in"] = {**table, "displacement": ["2.5 um"]}
    held = {"model": "equilibrium", "load": "0 N"}
    plain = tmp_path / "plain.csv"
    plain.write_text(
        "t [s], normal_load [nN], contact_radius [um]\n0, 1, 1\n1, 2, 2\n",
        encoding="utf-8",
    )
    with pytest.raises(BadInput, match="jump_in: a contact under a load closes at"):
        measurement.read(plain, load(rest | {"contact": held}))
    plain.write_text("t [s], normal_load [nN]\n0, 1\n1, 2\n", encoding="utf-8")
    with pytest.raises(BadInput, match="jump_in: needs the history of a loop"):
        measurement.read(plain, load(rest))


@pytest.mark.verify
def test_the_made_up_loop_gives_the_numbers_with_which_it_was_made_and_draws_its_profiles():
    path = Path(__file__).parents[2] / "scenarios" / "measured_loop.toml"
    free = [*TRUTH, *ZEROS, "zero.load_drift=-1 nN/s:1 nN/s"]
    result = fit(load(path), [path.with_suffix(".txt")], free)
    for key, truth in (TRUTH | WHERE | {"zero.load_drift": 20e-12}).items():
        low, high = result.intervals[key]
        assert low < truth < high, key
    axes = np.reshape(zero_figure(result).axes, (1 + len(TRUTH), 3))
    for column, profile in zip(axes.T, result.profiles, strict=True):
        # the rows below that of chi^2 are those of the physical keys
        for k, panel in enumerate(column[1:]):
            drawn = panel.get_lines()[1].get_ydata()
            ratio = drawn / profile.numbers[:, k]
            assert_allclose(ratio, ratio[0], rtol=1e-12)
    spans = np.ptp([profile.numbers[:, 0] for profile in result.profiles], axis=1)
    assert spans[0] > 10.0 * spans[1:].max()  # the zero of the displacement decides
