"""Pull-offs, lowest loads, jumps into contact and masking: named if they happen, with the values of their definition.

The detector of this file reads dense records alone, and its JKR theory is its own: nothing of ``sim`` judges ``sim``.
"""

import math
import warnings
from copy import deepcopy

import numpy as np
import pytest
from helpers.corner_scenes import corner_scene
from helpers.statements import statistics
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import sim
from sim import read
from sim.read.statistics import over_members
from sim.read.tables import at_records
from sim.reports.methods import errors

WORK, RADIUS, SHEAR_MODULUS = 0.05, 10e-6, 0.75e6
MODULUS = 4.0 * SHEAR_MODULUS
DEAD = -1.5 * math.pi * WORK * RADIUS
PROBE = {
    "name": "colloidal probe",
    "seed": 3,
    "clock": {"duration": "20 s", "step": "20 ms"},
    "solid": {"shear_modulus": SHEAR_MODULUS},
    "sphere": {"radius": RADIUS},
    "adhesion": {"work": WORK},
}
LENS = {
    "name": "lens",
    "seed": 3,
    "clock": {"duration": "1 s", "step": "2 ms"},
    "solid": {"shear_modulus": "1.6 MPa"},
    "sphere": {"radius": "2 mm"},
    "adhesion": {"work": "42 mJ/m^2"},
}
FLUCTUATIONS = {
    "drive": {"model": "ramp", "from": "10 um/s", "to": "3 mm/s"},
    "bonds": {"model": "steady", "stress": "0.1 MPa", "critical_speed": "10 mm/s"},
    "shear": {
        "model": "banded",
        "spectrum": {
            "model": "self_affine",
            "rms": "80 kPa",
            "hurst": 0.8,
            "longest": "60 um",
            "rolloff": "30 um",
            "shortest": "2 um",
        },
        "correlation": {"model": "slip", "length": "20 um"},
    },
    "ensemble": {"members": 24},
}


def ran(base, contact, **tables):
    return sim.run(deepcopy(base) | {"contact": contact} | tables)


def jkr_load(a):
    return 4.0 * MODULUS * a**3 / (3.0 * RADIUS) - math.sqrt(
        8.0 * math.pi * MODULUS * WORK * a**3
    )


def jkr_depth(a):
    return a**2 / RADIUS - math.sqrt(2.0 * math.pi * a * WORK / MODULUS)


def fold(stiffness):
    """Load and displacement of the mount at the last equilibrium behind a spring: dP/da + k dδ/da = 0."""

    def slope(a):
        load = 4.0 * MODULUS * a**2 / RADIUS
        load -= 1.5 * math.sqrt(8.0 * math.pi * MODULUS * WORK * a)
        depth = 2.0 * a / RADIUS - 0.5 * math.sqrt(2.0 * math.pi * WORK / MODULUS / a)
        return load / stiffness + depth

    a = brentq(slope, 1e-8, 1e-5, xtol=1e-18)
    return jkr_load(a), jkr_depth(a) + jkr_load(a) / stiffness


def energy_release(a, displacement, stiffness):
    missing = stiffness * (a**2 / RADIUS - displacement)
    missing += 4.0 / 3.0 * MODULUS * a**3 / RADIUS
    missing /= stiffness + 2.0 * MODULUS * a
    return MODULUS * missing**2 / (2.0 * math.pi * a), missing


def openings(dataset):
    """For each member the least and largest load at its first opening, by dense records; nan without.

    Under a load it is between two records. Else it goes like the root of the time that is left before the fold.
    """
    loads, closed = dataset["normal_load"].values, dataset["in_contact"].values == 1.0
    result = np.full((2, len(closed)), np.nan)
    for m, row in enumerate(closed):
        opens = np.flatnonzero(row[:-1] & ~row[1:])
        if not opens.size:
            continue
        k = opens[0]
        last = loads[m, k]
        slack = 3.0 * np.ptp(loads[m, max(k - 20, 0) : k + 1])
        result[:, m] = last - slack, last + slack
        if "applied_load" in dataset:
            after = dataset["applied_load"].values[..., k + 1].ravel()[0]
            result[:, m] = sorted((last, after))
    return result


def jumps_in(dataset):
    """True for each member that closes at once to the radius that it then keeps for a while."""
    radius = dataset["contact_radius"].values
    result = np.zeros(len(radius), bool)
    for m, row in enumerate(radius):
        for k in np.flatnonzero(~(row[:-2] > 0.0) & (row[1:-1] > 0.0)):
            result[m] |= row[k + 2] < 1.2 * row[k + 1]
    return result


def members(dataset):
    return dataset if "member" in dataset.dims else dataset.expand_dims("member")


BACK = {"from": "0.5 mN", "cycles": 1}
#: Contacts, scenes of fluctuations or not, and the events that occur in some member: pull-off, jump into contact.
PAIRS = {
    "a load above JKR's limit": ({"load": BACK | {"to": "-0.1 mN"}}, {}, ""),
    "a load below JKR's limit": ({"load": BACK | {"to": "-0.5 mN"}}, {}, "off"),
    "a load below JKR's limit and back": (
        {"load": BACK | {"to": "-0.5 mN"}, "after_pull_off": "reattach"},
        {},
        "off in",
    ),
    "a small indentation": ({"indentation": {"from": "1 um", "to": "-0.3 um"}}, {}, ""),
    "a large indentation": (
        {"indentation": {"from": "1 um", "to": "-2 um"}},
        {},
        "off",
    ),
    "a soft spring": (
        {
            "displacement": {"from": "1 um", "to": "-9 um", "cycles": 1},
            "stiffness": "100 N/m",
            "after_pull_off": "reattach",
        },
        {},
        "off in",
    ),
    "no adhesion": (
        {
            "displacement": {"from": "1 um", "to": "-0.9 um", "cycles": 1},
            "stiffness": "100 N/m",
            "after_pull_off": "reattach",
        },
        {"adhesion": {"work": 0.0}},
        "off",
    ),
    "a slow edge": (
        {
            "model": "rate_dependent",
            "front_speed": "1 um/s",
            "load": BACK | {"to": "-0.5 mN"},
        },
        {},
        "",
    ),
    "a fast edge": (
        {
            "model": "rate_dependent",
            "front_speed": "10 mm/s",
            "load": BACK | {"to": "-0.5 mN"},
        },
        {},
        "off",
    ),
    "a held load and fluctuations": ({"load": "-0.225 mN"}, FLUCTUATIONS, "off"),
    "a held load and small fluctuations": (
        {"load": "-0.225 mN"},
        FLUCTUATIONS | {"drive": {"model": "steady", "speed": "10 um/s"}},
        "",
    ),
    "a held load that presses": ({"load": "0.1 mN"}, FLUCTUATIONS, ""),
    "held grips and fluctuations": (
        {"indentation": "-0.55 um", "after_pull_off": "reattach"},
        FLUCTUATIONS,
        "off",
    ),
}


@pytest.mark.parametrize("case", PAIRS)
def test_an_event_has_a_value_if_and_only_if_dense_records_show_it(case):
    contact, tables, expected = PAIRS[case]
    made = ran(LENS, contact, **tables)
    dataset = members(made)
    loads = openings(dataset)
    opened = np.isfinite(loads[0])
    assert opened.any() == ("off" in expected)
    pull_off = dataset.get("pull_off_load", dataset["detachments"] * np.nan)
    assert_array_equal(np.isfinite(pull_off), opened)
    rounding = 1e-9 * abs(DEAD)
    assert np.all(pull_off.values[opened] <= loads[1, opened] + rounding)
    assert np.all(pull_off.values[opened] >= loads[0, opened] - rounding)
    assert_array_equal(dataset["first_detachment"].notnull(), opened)
    jumped = jumps_in(dataset)
    assert jumped.any() == ("in" in expected)
    jump_in = dataset.get("jump_in_load", dataset["detachments"] * np.nan)
    assert_array_equal(np.isfinite(jump_in), jumped)
    if "lowest_load" in dataset:
        recorded = dataset["normal_load"].min("t").values
        lowest = dataset["lowest_load"].fillna(0.0).values
        assert np.all(lowest <= np.minimum(recorded, 0.0) + rounding)
        assert np.all(lowest <= np.nan_to_num(pull_off.values, nan=0.0))
    headings = [
        key for row in read.highlights(read.Run(made), show=["all"]).rows for key in row
    ]
    assert any("pull-off" in key for key in headings) == ("off" in expected)
    assert any("jump-in" in key for key in headings) == ("in" in expected)


@pytest.mark.parametrize("stiffness", [0.2, 1.0, 5.0, 50.0, 500.0])
@pytest.mark.parametrize("step", ["20 ms", "0.5 s"])
def test_the_load_at_pull_off_is_that_at_the_fold_at_any_clock_step(stiffness, step):
    course = {"displacement": {"from": "5 um", "to": "-15 um"}, "stiffness": stiffness}
    dataset = ran(PROBE, course, clock=PROBE["clock"] | {"step": step})
    load, displacement = fold(stiffness)
    assert_allclose(dataset["pull_off_load"], load, rtol=1e-5)
    assert_allclose(dataset["pull_off_displacement"], displacement, rtol=1e-9)
    assert_allclose(dataset["pull_off_time"], 5.0 - 1e6 * displacement, rtol=1e-9)
    if step == "20 ms":
        assert_allclose(dataset["lowest_load"], DEAD, rtol=1e-3)
    if stiffness == 500.0:  # where the load is not the lowest one
        assert_allclose(dataset["pull_off_load"], -1.3308e-6, rtol=1e-4)


@pytest.mark.parametrize("held", ["load", "displacement", "indentation"])
def test_the_fold_has_no_error_by_the_clock_step_if_adhesion_depends_on_the_radius(
    held,
):
    course = {
        "load": {"load": {"from": "0.5 mN", "to": "-0.5 mN"}},
        "displacement": {
            "displacement": {"from": "1 um", "to": "-9 um"},
            "stiffness": "500 N/m",
        },
        "indentation": {"indentation": {"from": "1 um", "to": "-1.5 um"}},
    }[held]
    sliding = {
        "drive": {"model": "steady", "speed": "3 mm/s"},
        "bonds": FLUCTUATIONS["bonds"] | {"stress": "20 kPa"},
    }
    spectrum = {"model": "gaussian", "rms": "150 kPa", "length": "20 um"}
    on_disc = {"shear": {"model": "mean", "contact": "disc", "spectrum": spectrum}}
    for share, tables in ((1.0, sliding), (0.0, sliding | on_disc)):
        coarse, fine, without = (
            ran(
                LENS,
                course | {"reversible": part},
                clock={"duration": "1 s", "step": step},
                **others,
            )["pull_off_load"]
            for step, part, others in (
                ("50 ms", share, tables),
                ("1 ms", share, tables),
                ("1 ms", 0.0, sliding),
            )
        )
        assert_allclose(coarse, fine, rtol=1e-6)
        assert abs(fine) < 0.97 * abs(without)


def test_the_load_at_pull_off_is_the_applied_one_whatever_opens_the_contact():
    ramp = {"load": {"from": "1 uN", "to": "-5 uN"}}
    dataset = ran(PROBE, ramp, clock={"duration": "2 s", "step": "0.25 s"})
    assert_allclose(dataset["pull_off_load"], DEAD, rtol=1e-12)
    assert_allclose(dataset["lowest_load"], DEAD, rtol=1e-12)
    jump = {"load": {"time": [0.0, 1.0, 1.0, 2.0], "value": [1e-6, 1e-6, -4e-6, -4e-6]}}
    edge = {"model": "rate_dependent", "front_speed": "10 um/s"}
    for model in ({}, edge):
        for step in ("0.1 s", "80 ms"):  # at the end of a step, or within one
            dataset = ran(PROBE, jump | model, clock={"duration": "2 s", "step": step})
            assert_allclose(dataset["pull_off_load"], -4e-6, rtol=1e-12)
            if not model:
                assert_allclose(dataset["pull_off_time"], 1.0, rtol=1e-8)
    held = ran(LENS, {"load": "-0.225 mN"}, **FLUCTUATIONS)
    pull_off = held["pull_off_load"]
    assert 2 < pull_off.count() < 24
    assert_allclose(pull_off.values[pull_off.notnull()], -0.225e-3, rtol=1e-12)


def test_in_held_grips_the_indentation_alone_sets_the_load_at_the_fold():
    """Fluctuations lower the work of adhesion to that of which the indentation is the limit, δ = −3 a²/R."""
    contact, tables, _ = PAIRS["held grips and fluctuations"]
    dataset = ran(LENS, contact, **tables)
    pull_off = dataset["pull_off_load"]
    assert pull_off.count() > 12
    a = math.sqrt(0.55e-6 * 2e-3 / 3.0)
    exact = -20.0 / 3.0 * 6.4e6 * a**3 / 2e-3
    assert_allclose(pull_off.values[pull_off.notnull()], exact, rtol=1e-5)


def test_a_contact_without_adhesion_bears_nothing_as_it_opens():
    contact, tables, _ = PAIRS["no adhesion"]
    dataset = ran(LENS, contact, **tables)
    assert dataset["pull_off_load"] == 0.0 and np.isnan(dataset["lowest_load"])
    assert_allclose(dataset["pull_off_time"], 0.5 / 1.9, rtol=1e-9)
    dataset = ran(LENS, {"load": {"from": "0.5 mN", "to": "-0.4 mN"}}, **tables)
    assert dataset["pull_off_load"] == 0.0 and np.isnan(dataset["lowest_load"])
    edge = {"model": "rate_dependent", "front_speed": "1 mm/s"}
    dataset = ran(LENS, contact | edge, adhesion={"work": 1e-12})
    assert abs(dataset["pull_off_load"]) < 1e-12


@pytest.mark.parametrize("step", ["1 ms", "50 ms"])
@pytest.mark.parametrize(
    "speed, stiffness", [(1e-6, 0.2), (1e-4, 0.2), (1e-6, 500.0), (1e-4, 500.0)]
)
def test_a_lagging_edge_pulls_off_at_the_lowest_load_since_it_is_unstable(
    speed, stiffness, step
):
    """Own integration of the edge's motion; the contact is unstable where G rises as the radius falls."""
    edge = {"model": "rate_dependent", "front_speed": speed, "front_exponent": 0.6}
    course = {"displacement": {"from": "1 um", "to": "-19 um"}, "stiffness": stiffness}
    clock = {"duration": "20 s", "step": step}
    dataset = ran(PROBE, edge | course, clock=clock)

    def shrinking(time, radius):
        excess = (
            energy_release(radius[0], 1e-6 - 1e-6 * time, stiffness)[0] / WORK - 1.0
        )
        return [-speed * np.sign(excess) * abs(excess) ** (1.0 / 0.6)]

    def opens(time, radius):
        return radius[0] - 5e-9

    opens.terminal = True
    hertz = brentq(lambda a: energy_release(a, 1e-6, stiffness)[1], 1e-7, 1e-5)
    first = brentq(lambda a: energy_release(a, 1e-6, stiffness)[0] - WORK, hertz, 1e-5)
    course = solve_ivp(
        shrinking,
        (0.0, 20.0),
        [first],
        method="LSODA",
        rtol=1e-10,
        atol=1e-14,
        events=opens,
        max_step=2e-3,
    )
    a, displacement = course.y[0], 1e-6 - 1e-6 * course.t
    missing = energy_release(a, displacement, stiffness)[1]
    load = 2.0 * MODULUS * a * (2.0 * a**2 / (3.0 * RADIUS) - missing)
    rises = energy_release((1.0 - 1e-5) * a, displacement, stiffness)[0]
    rises -= energy_release((1.0 + 1e-5) * a, displacement, stiffness)[0]
    unstable = int(np.argmax(rises > 0.0))
    lowest = load[unstable:].min()
    error = float(dataset["pull_off_error"])
    assert abs(float(dataset["pull_off_load"]) - lowest) < error + 1e-4 * abs(lowest)
    assert float(dataset["lowest_load"]) <= lowest + error
    when = course.t[unstable:][load[unstable:].argmin()]
    slack = float(step.split()[0]) * 1e-3 + 0.02
    assert abs(float(dataset["pull_off_time"]) - when) < slack


def test_a_jump_into_contact_has_the_load_of_jkr_where_the_sphere_touches():
    course = {"from": "-3 um", "to": "2 um"}
    for step in ("20 ms", "0.7 s"):
        clock = {"duration": "7 s", "step": step}
        dataset = ran(PROBE, {"displacement": course, "stiffness": 5.0}, clock=clock)
        a = brentq(lambda a: jkr_depth(a) + jkr_load(a) / 5.0, 5e-7, 4e-6, xtol=1e-18)
        assert_allclose(dataset["jump_in_load"], jkr_load(a), rtol=1e-9)
        assert_allclose(dataset["jump_in_time"], 4.2, rtol=1e-9)
        assert abs(dataset["jump_in_displacement"]) < 1e-15
        assert_allclose(dataset["lowest_load"], jkr_load(a), rtol=1e-9)
    pressed = {"load": {"from": "-4 uN", "to": "1 uN"}}
    dataset = ran(PROBE, pressed)
    assert abs(dataset["jump_in_load"]) < 1e-15
    # a lagging edge closes with a vanishing radius
    edge = {"model": "rate_dependent", "front_speed": "1 mm/s"}
    dataset = ran(PROBE, pressed | edge)
    assert "jump_in_load" not in dataset and np.isfinite(dataset["first_closing"])


def test_thinned_records_and_single_steps_change_no_event():
    names = [f"{event}_load" for event in ("pull_off", "jump_in", "lowest")]
    names = [*names[:2], "lowest_load", "pull_off_time", "jump_in_time"]
    names += ["pull_off_displacement", "lowest_load_time", "first_masked"]
    for case in ("a soft spring", "held grips and fluctuations", "a fast edge"):
        contact, tables, _ = PAIRS[case]
        dense, seldom = (
            ran(LENS, contact, **tables, clock=LENS["clock"] | {"record": record})
            for record in ("2 ms", "0.5 s")
        )
        assert dense["pull_off_load"].notnull().any()
        for name in set(names) & {*dense}:
            assert_array_equal(seldom[name], dense[name])


def test_the_time_of_a_pull_off_has_no_mean_if_it_comes_after_the_run_in_some_members():
    contact, tables, _ = PAIRS["a held load and fluctuations"]
    every, pooled = (
        ran(LENS, contact, **tables, record={"per_member": per_member})
        for per_member in (True, False)
    )
    share = float(every["first_detachment"].notnull().mean())
    assert 0.0 < share < 1.0
    for dataset in (every, pooled):
        result = statistics(dataset)
        assert_allclose(result["ever_detached"].value, share, rtol=1e-12)
        assert_allclose(result["pull_off_load"].value, -0.225e-3, rtol=1e-12)
        assert np.isnan(result["pull_off_time"].value)
        assert not {"first_detachment", "first_masked"} & {*result}
    statements = read.Run(every).statements()
    assert "every member" in str(statements["pull_off_time"].reason.values)


def test_recorded_statistics_of_a_mount_have_the_energies_and_bounds_of_their_members():
    contact, tables, _ = PAIRS["held grips and fluctuations"]
    every, pooled = (
        ran(LENS, contact, **tables, record={"per_member": per_member})
        for per_member in (True, False)
    )
    assert bool(every["pull_off_load"].notnull().all())
    of_members, recorded = statistics(every), statistics(pooled)
    for name in ("pull_off_load", "total_dissipated"):
        assert_allclose(recorded[name].value, of_members[name].value, rtol=1e-12)
        assert recorded[name].bound.dims == ()
        # of the mean load instead of the mean over the loads
        assert_allclose(recorded[name].bound, of_members[name].bound, rtol=0.05)
    assert len(sim.stats(pooled))


def test_the_share_that_is_left_has_the_survival_and_the_interval_of_scipy():
    contact, tables, _ = PAIRS["a held load and fluctuations"]
    dataset = ran(LENS, contact, **tables)
    result = read.survival(dataset, "first_detachment")
    times = dataset["first_detachment"].values
    happened = np.isfinite(times)
    sample = stats.CensoredData(times[happened], right=np.ones(np.sum(~happened)))
    curve = stats.ecdf(sample).sf
    with np.errstate(all="ignore"), warnings.catch_warnings(action="ignore"):
        interval = curve.confidence_interval(0.95, method="log-log")
    inner = (result["time"].values > 0.0) & (result["time"].values < 1.0)
    at = result["time"].values[inner]
    assert len(at) > 2
    assert_allclose(result["survival"][inner], curve.evaluate(at), rtol=1e-12)
    assert_allclose(result["low"][inner], interval.low.evaluate(at), rtol=1e-9)
    assert_allclose(result["high"][inner], interval.high.evaluate(at), rtol=1e-9)
    assert_allclose(result["survival"][-1], np.mean(~happened), rtol=1e-12)
    none = read.survival(dataset, "first_masked")
    assert_array_equal(none["survival"], 1.0)
    for each in (none.isel(time=-1), result.isel(time=0)):
        assert_allclose([each["low"], each["high"]], binomial(0, len(times)))


@pytest.mark.parametrize("happened", [[0.2, 0.4, 0.7], [0.5, *3 * [math.nan]]])
def test_a_share_of_1_or_0_or_after_one_event_has_a_binomial_interval(happened):
    contact, tables, _ = PAIRS["a held load and fluctuations"]
    few = ran(LENS, contact, **tables).isel(member=slice(0, len(happened)))
    few = few.assign(first_detachment=("member", happened))
    last = read.survival(few, "first_detachment").isel(time=-1)
    gone = int(np.isfinite(happened).sum())
    assert_allclose(last["survival"], 1.0 - gone / len(happened), rtol=1e-12)
    assert_allclose([last["low"], last["high"]], binomial(gone, len(happened)))


def binomial(gone, members):
    """The 95 % interval of the share that is left, by scipy."""
    result = stats.binomtest(members - gone, members)
    return list(result.proportion_ci(0.95, "exact"))


def test_a_median_beyond_the_run_is_bounded_by_its_end_and_no_mean_of_the_masked_is_given():
    """The first masking of members in a run that masks less than half of them."""
    lens = deepcopy(LENS) | deepcopy(FLUCTUATIONS) | {"contact": {"load": "4 mN"}}
    lens["drive"] = {"model": "steady"}
    lens["shear"]["spectrum"]["rms"] = "120 kPa"
    lens["shear"]["correlation"] = {"model": "time", "time": "20 ms"}
    lens["ensemble"]["members"] = 100
    dataset = sim.run(lens | {"sweep": {"drive.speed": [5e-3, 12e-3, 20e-3]}})
    share = dataset["first_masked"].notnull().mean("member").values
    assert share[0] == 0.0 and 0.0 < share[1] < 0.4 and share[2] > 0.5
    result = read.Run(dataset).statements()
    assert_allclose(result["ever_masked"].value, share, rtol=1e-12)
    assert "first_masked" not in result
    assert np.isnan(result["half_masked"].value.values[:2]).all()
    assert_allclose(result["half_masked"].low.values[:2], 1.0, rtol=1e-12)
    rows = read.highlights(read.Run(dataset)).rows
    texts = [text for row in rows for key, text in row.items() if "half" in key]
    assert texts[:2] == ["> 1", "> 1"]


def test_a_lowest_load_that_is_the_pull_off_has_its_bound_and_another_one_has_none():
    def both(contact, **tables):
        found = statistics(ran(PROBE, contact, **tables))
        return found["pull_off_load"], found["lowest_load"]

    lagging = {
        "model": "rate_dependent",
        "front_speed": "1 um/s",
        "after_pull_off": "stay_open",
    }
    detached, lowest = both(lagging | {"load": {"from": "2 uN", "to": "-20 uN"}})
    assert_array_equal(lowest.value, detached.value)
    assert float(detached.bound) > 0.0
    assert_array_equal(lowest.bound, detached.bound)
    # behind a stiff spring the equilibrium contact bears less at its pull-off than before
    still = {"model": "equilibrium", "displacement": {"from": "0.1 um", "to": "-1 um"}}
    detached, lowest = both(still | {"stiffness": "1 kN/m"})
    assert float(lowest.value) < float(detached.value)
    assert lowest.bound is None
    # a load that stays above the pull-off has a lowest value without an error of the step
    _, lowest = both(lagging | {"load": {"from": "2 uN", "to": "-1 uN"}})
    assert lowest.bound is None or not np.isfinite(lowest.bound)


@pytest.mark.parametrize("per_member", [True, False])
def test_a_mean_of_closed_contacts_that_are_too_few_names_their_number(per_member):
    pulled = {"model": "equilibrium", "load": {"from": "1 mN", "to": "-0.5 mN"}}
    sliding = FLUCTUATIONS | {"drive": {"model": "steady", "speed": "1 mm/s"}}
    dataset = ran(LENS, pulled, **sliding, record={"per_member": per_member})
    each = ran(LENS, pulled, **sliding) if not per_member else dataset
    closed = each["in_contact"].sum("member").to_numpy()
    assert {1, 2} & {*closed.tolist()}
    radius = over_members(dataset, ["contact_radius"])["contact_radius"]
    assert radius.reason is not None
    for count, value, reason in zip(closed, radius.value, radius.reason, strict=True):
        text = str(reason.item())
        if count > 2:
            assert np.isfinite(value) and text == ""
        elif count:
            assert np.isnan(value) and text.startswith(f"{count:.0f} of 24 contacts ")
        else:
            assert np.isnan(value) and "of 24" not in text
    # the load of an open contact is the applied one, and nothing is missing
    load = at_records(dataset, ["normal_load"])["normal_load"]
    assert bool(load.value.notnull().all()) and bool((load.reason == "").all())


@pytest.mark.parametrize("per_member", [True, False])
def test_the_error_of_the_load_at_pull_off_is_named_with_it_and_only_after_one(
    per_member,
):
    def words(lowest):
        pulled = {"model": "equilibrium", "load": {"from": "1 mN", "to": lowest}}
        sliding = FLUCTUATIONS | {"drive": {"model": "steady", "speed": "1 mm/s"}}
        dataset = ran(LENS, pulled, **sliding, record={"per_member": per_member})
        return [text for text in errors(dataset) if "µN" in text]

    (text,) = words("-0.5 mN")
    assert "load at pull-off" in text
    assert words("0.5 mN") == []


#: A load that is lowered at once and then held, over an edge that lags.
LOWERED = {
    "model": "rate_dependent",
    "load": {
        "time": ["0 s", "0.5 s", "0.5 s", "1 s"],
        "value": ["1 mN", "1 mN", "-0.5 mN", "-0.5 mN"],
    },
    "front_speed": "50 um/s",
    "front_exponent": 0.5,
    "after_pull_off": "stop",
}
WAVES = {
    "drive": {"model": "steady", "speed": "1 mm/s"},
    "bonds": {"model": "steady", "stress": "0.2 MPa", "critical_speed": "5 mm/s"},
    "shear": {
        "model": "modal",
        "points": 32,
        "spectrum": {"model": "gaussian", "rms": "0.2 MPa", "length": "20 um"},
        "correlation": {"model": "slip", "length": "50 um"},
    },
    "ensemble": {"members": 10},
}
#: A start from rest, in which each member has bonds of its own.
STARTED = {
    "drive": {"model": "start", "rest": "0.5 s", "speed": "2 mm/s"},
    "bonds": {
        "model": "tracked",
        "sites": 50,
        "rupture": {"model": "bell", "zero_force_rate": "1 1/s", "bell_force": "4 pN"},
        "bond_stiffness": "0.8 uN/m",
        "rebinding_rate": "5 1/s",
        "site_density": "6.5e16 1/m^2",
    },
    "shear": {"model": "uniform"},
    "ensemble": {"members": 4},
}


@pytest.mark.parametrize("per_member", [True, False])
@pytest.mark.parametrize(
    ("contact", "tables"),
    [
        (LOWERED, {}),
        (LOWERED | {"load": {"from": "1 mN", "to": "-1 mN"}}, {}),
        (LOWERED | {"load": {"from": "1 mN", "to": "-1 mN", "cycles": 2}}, {}),
        ({"load": "4 mN"}, STARTED),
    ],
)
def test_no_field_of_an_event_has_members_or_their_statistics(
    contact, tables, per_member
):
    record = {"record": {"per_member": per_member}}
    run = sim.Run(ran(LENS, contact, **WAVES | tables | record))
    for name, one in run.events.items():
        for field, values in zip(one._fields, one, strict=True):
            dims = set() if values is None else {*values.dims}
            assert not dims & {"member", "statistic"}, (name, field)
    assert read.tables.tables_of(run)


@pytest.mark.parametrize("per_member", [True, False])
def test_a_load_that_is_borne_before_the_pull_off_has_no_error_of_the_step(per_member):
    """Each member bears the lowest load for a while; on a falling load the pull-off is the lowest one."""
    record = {"record": {"per_member": per_member}}
    held = ran(LENS, LOWERED, **WAVES | record)
    waits = held["pull_off_time"] - held["lowest_load_time"]
    assert (waits if per_member else waits[0]).min() > 2e-3
    stated = sim.Run(held).events
    assert_allclose(stated["lowest_load"].value, -0.5e-3, rtol=1e-12)
    assert not stated["lowest_load"].bound.fillna(0.0).any()
    falling = {"load": {"from": "1 mN", "to": "-1 mN"}}
    stated = sim.Run(ran(LENS, LOWERED | falling, **WAVES | record)).events
    bounds = [stated[name].bound for name in ("lowest_load", "pull_off_load")]
    assert_allclose(*bounds, rtol=1e-12)
    assert float(bounds[0]) > 0.0


@pytest.mark.parametrize("late", [0.0, 0.006, 0.014])
@pytest.mark.parametrize(
    "drive",
    [{"speed": "1 um/s"}, {"model": "spring", "stage": "1 um/s", "stiffness": 10.0}],
    ids=["prescribed", "spring"],
)
def test_a_pull_off_that_the_jump_of_a_load_makes_is_in_the_phase_that_it_begins(
    drive, late
):
    """The load jumps at or between the ends of clock steps beyond the pull-off, and back to a press."""
    down, up = 10.0 + late, 15.0 + late
    times, press, pull = [0.0, down, down, up, up, 20.0], -DEAD, 3.0 * DEAD
    load = {"time": times, "value": [press, press, pull, pull, press, press]}
    rupture = {"model": "bell", "zero_force_rate": 1.0, "bell_force": 4e-12}
    bonds = {
        "model": "rate",
        "rupture": rupture,
        "bond_stiffness": 1e-6,
        "rebinding_rate": 10.0,
        "site_density": 1e16,
    }
    contact = {"load": load, "after_pull_off": "reattach"}
    dataset = sim.run(PROBE | {"contact": contact, "drive": drive, "bonds": bonds})
    assert_allclose(dataset["phase_start"], [0.0, down, up], rtol=1e-12)
    assert_allclose(dataset["phase_pull_off_time"], [np.nan, down, np.nan], rtol=1e-8)
    assert_allclose(dataset["pull_off_time"], down, rtol=1e-8)
    assert_allclose(dataset["jump_in_time"], up, atol=0.02)
    assert dataset["phase_peak_friction"].values.ravel()[1] == 0.0  # it is open


def test_the_lowest_load_has_its_displacement_if_the_contact_opens_in_the_next_step():
    """The load of a lagging edge jumps at the end of a clock step, to where the edge runs in within the next step."""
    scene = corner_scene(122)
    lowest = min(scene["contact"]["load"]["value"])
    dataset = sim.run(scene | {"ensemble": {"members": 1}})
    assert_allclose(dataset["lowest_load"], lowest, rtol=1e-12)
    assert_allclose(dataset["lowest_load_time"], dataset["phase_start"][1], rtol=1e-8)
    assert np.isfinite(dataset["lowest_load_displacement"]).all()
