"""Statements of random scenes stay the same however a run is recorded, shown, swept, cut or continued."""

import functools
import itertools
import math
import re

import numpy as np
import pytest
import scipy
from helpers.parts import read, run
from helpers.random_scenes import random_scene
from helpers.statements import LATE, RUN, cells_of, parsed, statements_of

import sim
from sim.ensemble.plan import Plan
from sim.ensemble.store import Stopped
from sim.units.notation import in_units
from sim.units.quantity import Quantity

#: Scenes of each run of the tests, and of those under verify.
SHORT, ALL = 5, 100
MEMBERS = 16
#: Clock steps in place of those of a random scene, so that records can be thinned by 2 and 5.
STEPS = {12: 20, 48: 50, 192: 200}
#: Statements that are read off records, not made by the stepper.
OF_RECORDS = re.compile("loop_.*|peak_.*|.*_lost|.*_halfway_to_hertz|.*speed_at.*")
#: Peaks of the mean of members have the reason of their size.
PEAKS = {
    "peak_time": "peak_stress",
    "peak_speed": "peak_stress",
    "peak_friction_time": "peak_friction",
    "peak_friction_speed": "peak_friction",
}
#: Share of one normal number beyond four standard errors.
CHANCE = 2.0 * scipy.stats.norm.sf(4.0)
#: Numbers of a scene of which it is swept, each by turns.
KEYS = "adhesion.work", "sphere.radius", "solid.shear_modulus"
#: Units in place of those that tables choose.
UNITS = {
    "m/s": "mm/min",
    "m": "um",
    "m^2": "um^2",
    "N": "uN",
    "J": "nJ",
    "J/m^2": "uJ/m^2",
    "Pa": "hPa",
    "s": "min",
}


def scene_of(seed, members=MEMBERS, stride=1, **further):
    """Return the tables of a random scene whose records are a number of clock steps apart."""
    scene = random_scene(seed) | {"ensemble": {"members": members}} | further
    duration, step = scene["clock"]["duration"], scene["clock"]["step"]
    step = duration / STEPS[round(duration / step)]
    clock = {"duration": duration, "step": step, "record": stride * step}
    return scene | {"clock": clock}


@functools.lru_cache(maxsize=1)
def run_of(seed):
    try:
        scenario = sim.Scenario(**scene_of(seed))
        return read.Run(run(scenario))
    except ValueError as refused:
        pytest.skip(f"the scene is refused: {refused}")


@functools.lru_cache(maxsize=1)
def numbers_of(seed):
    return statements_of(run_of(seed))


def is_cheap(seed):
    """Return False for a body on single bonds, which rings for millions of sub-steps."""
    scene = random_scene(seed)
    return not (scene["bonds"]["model"] == "tracked" and "mass" in scene["drive"])


_CASES = [
    pytest.param(seed, marks=() if seed < SHORT else pytest.mark.verify)
    for seed in itertools.islice(filter(is_cheap, itertools.count()), ALL)
]


@pytest.fixture(scope="module", params=_CASES)
def seed(request):
    """Seeds of scenes: few of them in the short run; all tests of one are together."""
    return request.param


def compare(before, after, agree, common=None):
    """Assert that statements agree, and that none of them is lost without a reason."""
    keys = before.keys() & after.keys() if common is None else common
    assert keys
    wrong = []
    for key in keys:
        first, second = before[key], after[key]
        is_lost = math.isnan(first.value) != math.isnan(second.value)
        missing = first if math.isnan(first.value) else second
        of_peak = (PEAKS.get(key[0]), *key[1:])
        if is_lost and of_peak in before and not missing.reason:
            missing = max(before[of_peak], after[of_peak], key=lambda one: one.reason)
        if not (missing.is_explained if is_lost else agree(key, first, second)):
            wrong.append(f"{key}: {first} | {second}")
    assert not wrong, f"{len(wrong)} of {len(keys)}: " + "\n".join(sorted(wrong)[:8])


def is_equal(first, second, rtol=0.0, atol=0.0):
    """True if all numbers of two statements and their reasons are equal."""
    numbers = np.array([first[:-1], second[:-1]])
    is_close = np.allclose(*numbers, rtol, atol, equal_nan=True)
    return is_close and first.reason == second.reason


@pytest.mark.parametrize("stride", [2, 5])
def test_thinned_records_change_no_event_and_no_value_at_a_common_record(seed, stride):
    # the speed of a slider on single bonds is its displacement between two records
    is_of_records = "bonds_sites" in run_of(seed).dataset.variables

    def agree(key, first, second):
        if key[0] == "speed" and is_of_records:
            return True
        if key[2] == LATE or OF_RECORDS.fullmatch(key[0]):
            both = first.reason or second.reason or math.isnan(first.value)
            size = 1e-3 * abs(first.value)  # below it a course counts as settled
            return (
                both
                or abs(first.value - second.value) <= first.half + second.half + size
            )
        return is_equal(first, second)

    before = numbers_of(seed)
    thinned = statements_of(
        read.Run(run(sim.Scenario(**scene_of(seed, stride=stride))))
    )
    after = {}
    for (name, point, time, *further), number in thinned.items():
        record = time if isinstance(time, str) else stride * time
        after[name, point, record, *further] = number
    assert {key[0] for key in after} == {key[0] for key in before}
    compare(before, after, agree)


def plain(unit):
    """Return a printed unit as a scenario has it."""
    return unit.replace("²", "^2").replace("³", "^3").replace("µ", "u")


def test_a_table_prints_the_numbers_of_the_statements_in_any_unit(seed):
    one, numbers, wrong = run_of(seed), numbers_of(seed), []
    printed = cells_of(one)
    units = {unit for unit, _, _ in printed.values()}
    with in_units(sorted(UNITS[unit] for unit in units & UNITS.keys())):
        in_others = cells_of(one)
    assert printed.keys() == in_others.keys()
    for name, (base, unit, texts) in (*printed.items(), *in_others.items()):
        expected = [
            number
            for key, number in numbers.items()
            if key[0] == name and key[2] != LATE
        ]
        factor = Quantity(base, name).read(f"1 {plain(unit)}") if unit else 1.0
        sizes = [abs(number.value) for number in expected]
        largest = max(filter(math.isfinite, sizes), default=0.0)
        for text, number in zip(texts, expected, strict=True):
            numerals = parsed(text)
            if numerals is None:  # an end of an interval in place of a value
                is_right = math.isnan(number.value)
            else:
                value, error, bound, rounding = (factor * part for part in numerals)
                # a share of rounding is 0, and so is a value of rounding beside others of its column
                nothing = 1e-13 * float(base == "1")
                if value == 0.0 and not error > 0.0:
                    nothing = max(nothing, 1e-13 * largest)
                is_right = abs(value - number.value) <= 1.001 * rounding + nothing
                is_right &= not abs(error - number.error) > 1.001 * rounding + nothing
                is_right &= not abs(bound - number.bound) > 0.06 * number.bound
            wrong += [] if is_right else [f"{name}: {text} {unit} | {number}"]
    assert not wrong, "\n".join(wrong[:8])


def test_a_point_of_a_sweep_has_the_statements_of_the_scene_alone(seed):
    def agree(key, first, second):
        return is_equal(first, second, rtol=1e-12, atol=1e-30)

    key, scene = KEYS[seed % len(KEYS)], scene_of(seed)
    table, _, last = key.partition(".")
    value = scene[table][last]
    alone = numbers_of(seed)
    values = [value, 1.25 * value][:: 1 - 2 * (seed % 2)]
    swept = read.Run(run(sim.Scenario(**scene, sweep={key: values})))
    of_sweep = statements_of(swept)
    chosen = statements_of(read.Run(read.where(swept.dataset, {key: value})))
    place = (str(swept.dataset[swept.sweep[0]].to_numpy()[values.index(value)]),)
    of_point = {key: number for key, number in of_sweep.items() if key[1] == place}
    compare(of_point, chosen, agree)
    at_point = {(name, (), *rest): n for (name, _, *rest), n in of_point.items()}
    compare(alone, at_point, agree)


def test_a_run_that_was_stopped_and_continued_has_the_same_statements(
    seed, tmp_path, monkeypatch
):
    before, count = numbers_of(seed), itertools.count()
    # members of a group and clock steps of a block
    monkeypatch.setattr(Plan, "_pieces", (MEMBERS // 2, 10))
    scenario, path = sim.Scenario(**scene_of(seed)), tmp_path / "run.nc"
    with pytest.raises(Stopped):
        run(scenario, path, stop=lambda: next(count) >= 1)
    run(scenario, path, resume=True)
    with read.dataset.open(path) as dataset:
        after = statements_of(read.Run(dataset))
    assert after.keys() == before.keys()
    compare(before, after, lambda key, first, second: is_equal(first, second))


def test_twice_the_members_change_a_mean_by_four_standard_errors_at_most(seed):
    """The first half of the members are the same, so that the means differ by half the difference of both halves.

    With the spread within the halves its error has 2 (n - 1) degrees of freedom. Four
    standard errors are those of a normal number; the chance to be beyond them is that of
    all statements of a scene together.
    """
    before = numbers_of(seed)
    after = statements_of(read.Run(run(sim.Scenario(**scene_of(seed, 2 * MEMBERS)))))
    keys = before.keys() & after.keys()
    free = 2.0 * (MEMBERS - 1.0)
    limit = scipy.stats.t.isf(0.5 * CHANCE / len(keys), free)
    opens = any(key[0] == "fraction_detached" and n.value for key, n in after.items())

    def agree(key, first, second):
        difference = abs(second.value - first.value)
        if first.reason or second.reason or not difference > 1e-12 * abs(first.value):
            return True
        if key[2] == RUN and math.isnan(second.error):  # of medians and rates
            return difference <= first.half + second.half
        if opens and sim.quantities.QUANTITIES[key[0]].absent:
            return True  # of a part of the members
        total = second.error**2 * 2.0 * MEMBERS * (2.0 * MEMBERS - 1.0)
        within = max(total - 2.0 * MEMBERS * difference**2, 0.0)
        return difference <= limit * math.sqrt(within / free / (2.0 * MEMBERS))

    compare(before, after, agree)
