"""Speeds at which area is lost, and the loss in both orders of charging: against curves and laws that are known."""

import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from helpers import lens
from helpers.lens import LOAD, MODULUS, RADIUS, WORK, scene
from helpers.parts import (
    Adhesion,
    Band,
    Clock,
    Equilibrium,
    RateDependent,
    Record,
    Time,
    bonds,
    drive,
    read,
    run,
    shear,
)
from helpers.statements import shares
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import PchipInterpolator

import sim
from sim.ensemble.steady_speed import speeds_of_areas
from sim.laws import jkr
from sim.read import dataset as dataset_module, over_speed
from sim.read.observables import charges, closed_observables
from sim.units.errors import BadInput

LONG = pytest.mark.verify
SPEEDS = np.geomspace(1e-3, 1e3, 61)
NAMES = (
    "speed_at_5_percent_lost",
    "speed_at_50_percent_lost",
    "speed_halfway_to_hertz",
)


def falling(speeds):
    """Falls by half at speed 1; straight lines over the speed's logarithm are off by far less than errors."""
    return 1.0 / (1.0 + speeds)


@pytest.mark.parametrize(
    ("groups", "count", "spread"),
    [
        (64, 61, 0.03),
        (8, 1201, 0.1),
        *(pytest.param(*each, marks=LONG) for each in ((64, 1201, 0.1), (8, 61, 0.03))),
    ],
)
def test_intervals_of_a_speed_hold_what_they_promise(groups, count, spread):
    """A spread of 0.03 is below the steps, one of 0.1 above. Half of the variance is shared along the curve."""
    rng, speeds, hits = np.random.default_rng(31), np.geomspace(1e-3, 1e3, count), []
    # what noise there is elsewhere changes nothing
    about = np.abs(np.log(speeds)) < 1.0
    for _ in range(1000):
        noise = np.zeros((groups, count))
        noise[:, about] = rng.normal(size=(groups, 1)) + rng.normal(
            size=(groups, about.sum())
        )
        means = falling(speeds) + spread * math.sqrt(groups / 64.0 / 2.0) * noise
        result = read.crossing(speeds, means, np.full(groups, 64.0 / groups), 0.5)
        hits.append(result.low <= 1.0 <= result.high)
    assert 0.92 < np.mean(hits) < 0.98


def jkr_area(work):
    return math.pi * jkr.radius_at_load(LOAD, work, RADIUS, MODULUS) ** 2


def speed_of_loss(loss):
    """At which steady bonds alone take a share of the area: w = W/(1 + V/V_c) with V_c = 10 mm/s."""
    works = np.linspace(0.0, WORK, 200_001)
    work = np.interp(1.0 - loss, jkr_area(works) / jkr_area(WORK), works)
    return 1e-2 * (WORK / work - 1.0)


def bonds_alone(speeds):
    """Share of JKR's area that steady bonds leave."""
    return jkr_area(WORK / (1.0 + np.asarray(speeds) / 1e-2)) / jkr_area(WORK)


@pytest.mark.parametrize("noise", [0.0, pytest.param(1e-3, marks=LONG), 5e-3])
@pytest.mark.parametrize(
    "count", [3, *(pytest.param(count, marks=LONG) for count in (4, 9, 25)), 5, 200]
)
def test_interpolated_speeds_hold_the_truth_however_many_speeds_there_are(count, noise):
    rng, hits, widths = np.random.default_rng(28), [], []
    for _ in range(200):
        speeds = np.geomspace(
            1.0, 10.0 ** rng.uniform(1.5, 4.0), count
        ) * 10.0 ** rng.uniform(-5.0, -3.5)
        loss = rng.uniform(0.01, 0.3)
        truth, common = speed_of_loss(loss), rng.normal(size=(6, 1))
        groups = bonds_alone(speeds) + noise * math.sqrt(3.0) * (
            common + rng.normal(size=(6, count))
        )
        mixed = rng.permutation(count)
        result = read.crossing(speeds[mixed], groups[:, mixed], np.ones(6), 1.0 - loss)
        assert result.reason or np.isfinite(result.speed)
        hits.append(not (result.low > truth or result.high < truth))
        widths.append(
            math.log(result.high / result.low)
            if np.isfinite(result.speed)
            else math.nan
        )
    assert np.mean(hits) >= 0.92
    if count == 200 and noise == 0.0:
        assert np.nanmedian(widths) < 1e-4


def test_shares_of_a_loss_add_up_in_both_orders_and_are_those_of_the_laws_there():
    field = shear.Mean(spectrum=Band(rms=1e5, longest=60e-6, shortest=24e-6))
    parts = {
        "bonds": bonds.Steady(critical_speed=1e-2),
        "shear": field,
        "clock": Clock(duration=0.02, step=0.01),
    }
    sweep = {"drive.speed": list(np.geomspace(1e-5, 1.0, 41))}
    dataset = run(scene(drive=drive.Steady(speed=1e-2), sweep=sweep, **parts))
    energy = float(dataset["fluctuation_energy"][0, 0])
    result = read.loss_speeds(dataset, ["20 %", 0.9, 1e-3])
    works = np.linspace(0.0, WORK, 200_001)
    left = np.interp(0.8, jkr_area(works) / jkr_area(WORK), works)
    speed = 1e-2 * (WORK / (left + energy) - 1.0)
    name = "at_20_percent_lost"
    assert (
        float(result[f"speed_{name}"].low)
        <= speed
        <= float(result[f"speed_{name}"].high)
    )
    assert_allclose(result[f"speed_{name}"].value, speed, rtol=1e-3)
    by_bonds, alone = (
        1.0 - bonds_alone(speed),
        1.0 - jkr_area(WORK - energy) / jkr_area(WORK),
    )
    law = {"lost_to_bonds": by_bonds, "lost_to_fluctuations": 0.2 - by_bonds}
    law |= {"lost_to_fluctuations_first": alone, "lost_to_bonds_last": 0.2 - alone}
    for share, truth in law.items():
        found = result[f"{share}_{name}"]
        low, value, high = map(float, (found.low, found.value, found.high))
        assert low - 1e-12 <= truth <= high + 1e-12 and abs(value - truth) < 1e-3
    for first, last in (
        ("lost_to_bonds", "lost_to_fluctuations"),
        ("lost_to_fluctuations_first", "lost_to_bonds_last"),
    ):
        assert_allclose(
            result[f"{first}_{name}"].value + result[f"{last}_{name}"].value,
            0.2,
            rtol=1e-12,
        )
    assert "never" in str(result["speed_at_90_percent_lost"].reason.values)
    assert_allclose(
        [
            result["speed_at_0.1_percent_lost"].value,
            result["speed_at_0.1_percent_lost"].high,
        ],
        [math.nan, 1e-5],
    )


def test_area_that_a_contact_loses_as_it_comes_off_is_no_loss_to_a_speed():
    """Steady bonds under tension let go where the pull-off load 3/2 π w R has fallen to it."""
    pulled = Equilibrium(
        load=-0.5 * 1.5 * math.pi * WORK * RADIUS, after_pull_off="stay_open"
    )
    parts = {
        "bonds": bonds.Steady(critical_speed=1e-2),
        "shear": shear.Uniform(),
        "clock": Clock(0.4, 1e-3),
    }
    result = read.loss_speeds(run(scene(contact=pulled, **parts)), ["10 %", "90 %"])
    assert math.isfinite(result["speed_at_10_percent_lost"].value)
    assert math.isnan(result["speed_at_90_percent_lost"].value)
    assert "detach before" in str(result["speed_at_90_percent_lost"].reason.values)
    # the pull-off is at the critical speed, where w = W/2
    last = float(result["speed_at_90_percent_lost"].low)
    assert last <= 1e-2 <= last * math.exp(math.log(1e4) / 400.0 * 1.001)


@pytest.mark.parametrize("duration", [2.0, 40.0])
def test_branches_of_a_course_lag_both_ways_and_the_steady_speed_is_that_of_the_law(
    duration,
):
    """Bonds with a rate of 5 1/s are late; the bonds left tell the speed at which they would be steady."""
    course = drive.Table(time=(0.0, duration / 2.0, duration), speed=(1e-5, 2e-2, 1e-5))
    late, clock = (
        bonds.Rate(critical_speed=5e-3, rebinding_rate=5.0),
        Clock(duration, duration / 2000),
    )
    result = read.loss_speeds(
        run(scene(drive=course, bonds=late, shear=shear.Uniform(), clock=clock))
    )
    branches = result["speed_halfway_to_hertz"].value
    assert branches["branch"].values.tolist() == [
        "increasing speed",
        "decreasing speed",
    ]
    hertz = jkr_area(0.0) / jkr_area(WORK)
    steady = 0.5 * speed_of_loss(0.5 * (1.0 - hertz))
    up, down = branches.values
    assert up > steady > down and up / down - 1.0 > 0.2 / duration
    assert_allclose(result["steady_speed_halfway_to_hertz"].value, steady, rtol=1e-8)
    early = result["steady_speed_at_5_percent_lost"].value
    assert_allclose(early, 0.5 * speed_of_loss(0.05), rtol=1e-8)
    for name in ("halfway_to_hertz", "at_5_percent_lost"):
        # on the way back more is lost at the lowest speed, or at a lower one
        assert all("lags" in reason for reason in result[f"speed_{name}"].reason.values)


def course(part, step, **parts):
    """Return the speeds of three losses along a ramp of four decades in 2 s, over the clock step."""
    ramp = drive.Ramp(start=1e-5, stop=0.1, scale="log")
    parts = {"drive": ramp, "shear": shear.Uniform()} | parts
    dataset = run(scene(bonds=part, clock=Clock(2.0, step), **parts))
    return read.loss_speeds(dataset, ["2 %", "5 %", "15 %"])


@pytest.mark.parametrize(
    ("part", "is_exact"),
    [
        *(
            (bonds.Rate(critical_speed=1e-2, rebinding_rate=rate), True)
            for rate in (5.0, 50.0, 500.0, 5000.0)
        ),
        (
            bonds.Cohort(
                rupture=bonds.Bell(zero_force_rate=50.0, bell_force=4e-12),
                bond_stiffness=4e-4,
                rebinding_rate=500.0,
                site_density=9e16,
            ),
            False,
        ),
    ],
)
def test_a_loss_along_a_ramp_is_at_the_speed_that_the_bonds_feel(part, is_exact):
    """Bonds have one speed in a clock step, here 5 %. At a hundredth of the step it makes 100 times less difference."""
    step, growth = 1e-2, math.log(1e4) / 2.0
    coarse, fine = course(part, step), course(part, step / 100.0)
    found = 0
    for name, at_steps in coarse.items():
        if not name.startswith("speed") or not np.isfinite(at_steps.value):
            continue
        value, bound = (float(each) for each in (at_steps.value, at_steps.bound))
        truth, rest = (float(each) for each in (fine[name].value, fine[name].bound))
        assert abs(value - truth) <= bound + rest, name
        assert float(at_steps.low) < truth + rest < float(at_steps.high) + 2.0 * rest
        if is_exact:  # to the second order of the change of the speed in a step
            assert bound < 1.2 * (growth * step) ** 2 * value
        found += 1
    assert found >= 1


@pytest.mark.parametrize("rate", [50.0, 5000.0])
def test_behind_a_spring_that_moves_with_a_ramp_bonds_are_not_late(rate):
    """The motion is solved within a clock step, so that a step of 5 % of the speed is as good as a fortieth of it."""
    part, step = (
        bonds.Rate(critical_speed=1e-2, rebinding_rate=rate, stress=0.3e6),
        1e-2,
    )
    stage = {"from": 1e-5, "to": 0.1, "scale": "log"}
    spring = drive.Spring(
        stage=stage, stiffness=2e4, damping=20.0, contact_stiffness="rigid"
    )
    coarse, fine = (course(part, each, drive=spring) for each in (step, step / 40.0))
    for name in ("speed_at_2_percent_lost", "speed_at_15_percent_lost"):
        change = math.log(1e4) / 2.0 * step
        assert_allclose(coarse[name].value, fine[name].value, rtol=change**2)


def test_what_fluctuates_beside_bonds_along_a_ramp_leaves_its_part_of_the_delay_open():
    """A delay of the bonds between nothing and half a step is within the bound, and its cause is named."""
    field = shear.Modal(
        spectrum=Band(rms=60e3, longest=60e-6, shortest=24e-6),
        correlation=Time(time=1.0),
        cell=0.2e-3,
    )
    part, step, growth = (
        bonds.Rate(critical_speed=1e-2, rebinding_rate=500.0),
        1e-2,
        math.log(1e4) / 2.0,
    )
    result = course(part, step, shear=field)["speed_at_5_percent_lost"]
    assert result.source == "step"
    least = 0.25 * growth * step * float(result.value)
    assert least < float(result.bound) < 2.5 * least


def test_a_course_that_nothing_delays_has_no_other_speed_if_steady():
    for part in (
        bonds.Steady(critical_speed=5e-3),
        bonds.Rate(critical_speed=5e-3, rebinding_rate=5e9),
    ):
        clock = Clock(0.4, 1e-5, 1e-4)
        parts = {"bonds": part, "shear": shear.Uniform(), "clock": clock}
        result = read.loss_speeds(run(scene(**parts)))
        assert math.isfinite(result["speed_halfway_to_hertz"].value)
        assert not any(str(name).startswith("steady") for name in result)
        assert "steady" not in result["speed_halfway_to_hertz"].reason.item()


def test_speeds_in_steady_sliding_are_those_of_the_mean_area_of_members_with_noise():
    """Own sum over 2,000 runs of a member's energy, drawn from the modes of the cell."""
    field = shear.Modal(
        spectrum=Band(rms=60e3, longest=60e-6, shortest=24e-6),
        correlation=Time(time=1.0),
        cell=0.2e-3,
    )
    late = bonds.Rate(critical_speed=5e-3, rebinding_rate=5.0)
    point = scene(bonds=late, shear=field)
    weight, shape, _, constant = point.process.gammas
    rng = np.random.default_rng(4)
    energy = constant + rng.gamma(shape, size=(200_000, len(weight))) @ weight
    share = 0.9
    ((result,), (is_stable,)) = speeds_of_areas(point, np.array([share]))
    speeds = result * np.geomspace(0.5, 2.0, 61)
    works = np.linspace(0.0, WORK, 20_001)
    areas = jkr_area(works) / jkr_area(WORK)

    def mean_area(speed):
        work = np.maximum(WORK / (1.0 + speed / 5e-3) - energy, 0.0)
        return np.interp(work, works, areas)

    curve = np.array([mean_area(speed).mean() for speed in speeds])
    assert curve[0] > share > curve[-1]
    exact = np.exp(np.interp(-share, -curve, np.log(speeds)))
    near = int(np.argmin(abs(speeds - exact)))
    slope = np.gradient(curve, np.log(speeds))[near]
    error = mean_area(exact).std() / math.sqrt(energy.size)
    assert is_stable and abs(math.log(result / exact) * slope) < 5.0 * error


@pytest.mark.parametrize(("stiffness", "is_stable"), [(2e3, False), (1.3e4, True)])
def test_a_speed_if_steady_is_absent_where_sliding_behind_the_spring_is_unstable(
    stiffness, is_stable
):
    """Own linear analysis: sliding at 1.522 and 3.575 mm/s is unstable below 10.51 and 12.22 kN/m."""
    machine = {
        "clock": {"duration": "8 s", "step": "1 ms", "record": "10 ms"},
        "solid": {"youngs_modulus": "1.8 MPa"},
        "sphere": {"radius": "9.42 mm"},
        "adhesion": {"work": "27 mJ/m^2"},
        "contact": {"load": "0.1 N"},
        "drive": {
            "model": "spring",
            "stage": {"from": "0.01 mm/s", "to": "10 mm/s", "scale": "log"},
            "stiffness": stiffness,
            "mass": "50 g",
            "damping": "1 N s/m",
            "contact_stiffness": "rigid",
        },
        "bonds": {
            "model": "cohort",
            "rupture": {
                "model": "bell",
                "bell_force": "4 pN",
                "critical_speed": "1 mm/s",
                "stress": "0.2 MPa",
            },
            "bond_stiffness": "0.8 uN/m",
            "rebinding_ratio": 10,
        },
    }
    lens = sim.load(machine)
    modulus = lens.solid.contact_modulus
    radii = (jkr.radius_at_load(0.1, work, 9.42e-3, modulus) for work in (0.0, 27e-3))
    hertz = np.divide(*radii) ** 2
    for springs, stable in ((1e4, [0, 0]), (1.1e4, [1, 0]), (1.3e4, [1, 1])):
        held = lens.with_values({"drive.stiffness": springs})
        is_held = speeds_of_areas(held, np.array([0.95, 0.5 * (1.0 + hertz)]))[1]
        assert_array_equal(is_held, stable)
    result = read.loss_speeds(run(lens))
    for name, exact in (
        ("at_5_percent_lost", 1.522e-3),
        ("halfway_to_hertz", 3.575e-3),
    ):
        reason = result[f"speed_{name}"].reason.item()
        assert ("unstable" in reason) is not is_stable
        assert (f"steady_speed_{name}" in result) is is_stable
        if is_stable:
            assert_allclose(result[f"steady_speed_{name}"].value, exact, rtol=2e-4)


def test_an_extreme_inside_a_sweep_is_named_and_one_at_its_end_or_within_the_errors_is_not():
    speeds, force = (
        np.array([0.1, 100.0, 1.0, 10.0]),
        np.array([0.416, 0.288, 1.034, 0.880]),
    )
    for error, named in ((0.01, True), (0.5, False)):
        columns = (
            xr.DataArray(values, {"V": speeds}, ["V"])
            for values in (force, force - error, force + error)
        )
        mean, low, high = columns
        result = read.extremes(read.Estimate(mean, low=low, high=high), "V")
        place = result["largest_at"]
        places = [float(end) for end in (place.value, place.low, place.high)]
        assert_array_equal(places, [1.0, 0.1, 10.0] if named else [math.nan] * 3)
        assert_array_equal(result["largest"].value, 1.034 if named else math.nan)
        assert (str(result["largest"].reason.values) == "") == named
        # at the highest speed
        assert math.isnan(result["least"].value) and str(result["least"].reason.values)


def test_cubics_between_speeds_are_the_monotone_ones_of_scipy():
    rng = np.random.default_rng(5)
    for count in (2, 3, 9):
        x, y = (
            np.cumsum(rng.uniform(0.5, 2.0, count)),
            rng.integers(-3, 4, (99, count)).astype(float),
        )
        expected = np.moveaxis(PchipInterpolator(x, y, axis=1).c, 1, 2)
        assert_allclose(
            over_speed.cubics(x, y),
            expected,
            rtol=0.0,
            atol=1e-14 * np.abs(expected).max(),
        )


def test_crossings_are_exact_on_straight_lines_and_a_ramp_is_read_in_pieces(
    monkeypatch,
):
    curve = 1.0 - 0.1 * np.log(SPEEDS / SPEEDS[0])
    result = read.crossing(SPEEDS, curve[None], np.ones(1), 0.55)
    assert_allclose(result.speed, SPEEDS[0] * math.exp(4.5), rtol=1e-12)
    assert_allclose([result.low, result.high], result.speed, rtol=1e-12)
    for level, low, high in ((1.5, math.nan, SPEEDS[0]), (-1.0, SPEEDS[-1], math.nan)):
        result = read.crossing(SPEEDS, curve[None], np.ones(1), level)
        assert math.isnan(result.speed) and result.reason
        assert_allclose([result.low, result.high], [low, high], rtol=1e-12)
    ramp, sizes = lens.ramp().isel(member=[0]), []
    whole = read.loss_speeds(ramp)
    monkeypatch.setattr(dataset_module, "ROOM", 500)

    def reading(some, names):
        sizes.append(some.sizes["t"])
        return closed_observables(some, names)

    monkeypatch.setattr(over_speed, "closed_observables", reading)
    for name, one in read.loss_speeds(ramp).items():
        xr.testing.assert_identical(one.value, whole[name].value)
    assert (
        len(sizes) > 1
        and sum(sizes) == ramp.sizes["t"]
        and math.isfinite(whole[NAMES[0]].value)
    )


def test_the_order_of_charging_changes_no_sum_and_fluctuations_alone_leave_the_area_of_their_work():
    for contact in [
        Equilibrium(load=LOAD),
        Equilibrium(indentation=1e-6),
        Equilibrium(displacement=2e-6, stiffness=2e3),
        Equilibrium(load=LOAD, reversible=0.2),
    ]:
        dataset = run(scene(contact=contact))
        taken = charges(dataset)
        bonds_first = taken["lost_to_bonds"] + taken["lost_to_fluctuations"]
        fluctuations_first = (
            taken["lost_to_fluctuations_first"] + taken["lost_to_bonds_last"]
        )
        assert_allclose(fluctuations_first - bonds_first, 0.0, rtol=0, atol=1e-14)
        assert float(abs(taken["order_of_charging"]).max()) > 1e-3
    shared, charged = shares(lens.ramp()), charges(lens.ramp())
    apart = np.hypot(
        shared["lost_to_fluctuations"].sem, shared["lost_to_fluctuations_first"].sem
    )
    differ = float(
        charged["order_of_charging"].isel(t=-8).std("member", ddof=1)
    ) / math.sqrt(6.0)
    assert_allclose(shared["order_of_charging"].sem[-8], differ, rtol=1e-9)
    assert differ < 0.9 * float(apart[-8])
    dataset = lens.ramp()
    left = jkr_area(WORK - dataset["fluctuation_energy"].to_numpy())
    result = charges(dataset)["lost_to_fluctuations_first"]
    assert_allclose(result, 1.0 - left / jkr_area(WORK), rtol=0, atol=1e-14)
    unbroken = run(scene(bonds=bonds.Unbroken()))
    assert_allclose(charges(unbroken)["order_of_charging"], 0.0, atol=1e-14)


def test_speeds_of_loss_of_what_stays_or_is_missing_are_refused_or_left_out():
    result = read.loss_speeds(lens.ramp())
    found = result[NAMES[0]]
    low, at, high = map(float, (found.low, found.value, found.high))
    assert 1e-5 < low < at < high < 1e-1
    pooled = read.loss_speeds(run(scene(record=Record(per_member=False))))
    # errors of neighbouring records count as in common
    of_statistics = pooled[NAMES[0]]
    assert_allclose(of_statistics.value, at, rtol=1e-3)
    width = float(of_statistics.high / of_statistics.low)
    assert high / low <= width < (high / low) ** 4
    with pytest.raises(ValueError, match="nor is swept"):
        read.loss_speeds(run(scene(drive=drive.Steady(speed=1e-2))), ["10 %"])
    with pytest.raises(ValueError, match="must be below 1"):
        read.loss_speeds(lens.ramp(), ["100 %"])
    assert not read.loss_speeds(run(scene(drive=drive.Steady(speed=1e-2))))
    assert "order_of_charging" not in shares(
        run(scene(record=Record(per_member=False)))
    )


def test_shares_of_a_sweep_are_those_of_its_points():
    for sweep in (
        {"contact.load": [1e-3, 1.6e-2]},
        [
            {"sphere.radius": 1e-3, "contact.load": 1e-3},
            {"sphere.radius": 4e-3, "contact.load": 8e-3},
        ],
        {"adhesion.work": [2e-2, 8e-2], "adhesion.bond_share": [0.3, 1.0]},
        {
            "contact": [
                {"model": "rate_dependent", "indentation": 1e-6, "front_speed": 1.0},
                {
                    "model": "equilibrium",
                    "load": {"from": 4e-3, "to": 1e-3},
                    "reversible": 0.02,
                },
            ]
        },
    ):
        swept = scene(sweep=sweep)
        dataset = run(swept)
        together, ratio = (
            read.share_observables(dataset),
            read.observables(dataset)["area_ratio"],
        )
        dims = [name for name in ratio.dims if name not in ("member", "t")]
        for k, point in enumerate(swept.points()):
            place = dict(
                zip(
                    dims,
                    np.unravel_index(k, [ratio.sizes[name] for name in dims]),
                    strict=True,
                )
            )
            alone = run(point)
            assert_array_equal(ratio.isel(place), read.observables(alone)["area_ratio"])
            shares = read.share_observables(alone)
            for name in together:  # a mechanism that a point lacks takes nothing there
                assert_array_equal(
                    together[name].isel(place) - shares.get(name, 0.0), 0.0
                )


def test_shares_and_what_is_left_add_up_to_one_and_are_unknown_without_contact_or_members(
    ramp,
):
    lost, left = (
        read.share_observables(ramp),
        read.observables(ramp)["area_ratio"],
    )
    total = lost["lost_to_bonds"] + lost["lost_to_fluctuations"] + left
    assert_allclose(total, 1.0, rtol=1e-15)
    assert lost["lost_to_fluctuations"].dims == ("member", "t")
    taken = shares(ramp)
    lost = read.share_observables(ramp)["lost_to_fluctuations"].to_numpy()
    assert_allclose(
        taken["lost_to_fluctuations"].sem,
        lost.std(axis=0, ddof=1) / math.sqrt(6),
        rtol=1e-10,
    )
    # a mean-field population does not fluctuate: nothing but rounding is left
    assert_allclose(taken["lost_to_bonds"].sem, 0.0, rtol=0, atol=1e-15)
    lifted = Equilibrium(load=1.5 * float(jkr.pull_off_load(WORK, RADIUS)))
    taken = shares(run(scene(contact=lifted, shear=shear.Uniform())))
    assert bool(taken["lost_to_bonds"].value.isnull().all())
    for parts in (
        {"bonds": bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=100)},
        {"contact": Equilibrium(load=LOAD, reversible=0.02)},
        {"contact": RateDependent(load=LOAD, front_speed=1e-3)},
    ):
        with pytest.raises(ValueError, match="per_member = true"):
            shares(run(scene(record=Record(per_member=False), **parts)))


def test_bonds_fluctuations_and_mean_stress_take_what_their_laws_say():
    masking = shear.Mean(spectrum=Band(rms=1e6, longest=60e-6, shortest=24e-6))
    taken = shares(
        run(scene(adhesion=Adhesion(work=WORK, bond_share=0.0), shear=masking))
    )
    hertz, full = (
        jkr.hertz_radius_at_load(LOAD, RADIUS, MODULUS),
        jkr.radius_at_load(LOAD, WORK, RADIUS, MODULUS),
    )
    assert_allclose(taken["lost_to_bonds"].value, 0.0, rtol=0, atol=1e-15)
    assert_allclose(
        taken["lost_to_fluctuations"].value, 1.0 - (hertz / full) ** 2, rtol=1e-13
    )
    for control, radius in (
        ({"load": LOAD}, lambda w: jkr.radius_at_load(LOAD, w, RADIUS, MODULUS)),
        (
            {"indentation": 2e-6},
            lambda w: jkr.radius_at_indentation(2e-6, w, RADIUS, MODULUS),
        ),
    ):
        field = shear.Mean(spectrum=Band(rms=80e3, longest=60e-6, shortest=24e-6))
        population = bonds.Steady(critical_speed=1e-2, stress=1e5)
        dataset = run(
            scene(
                contact=Equilibrium(**control, reversible=0.03),
                bonds=population,
                shear=field,
            )
        )
        taken = shares(dataset)
        bonded = WORK / (1.0 + np.geomspace(1e-5, 1e-1, 21) / 1e-2)
        areas = [
            radius(w) ** 2
            for w in (
                np.full(21, WORK),
                bonded,
                bonded - dataset["fluctuation_energy"].to_numpy(),
            )
        ]
        areas.append((dataset["contact_radius"].to_numpy()) ** 2)
        names = ("lost_to_bonds", "lost_to_fluctuations", "lost_to_mean_stress")
        for name, before, after in zip(names, areas[:-1], areas[1:], strict=True):
            # the work is put together again from its parts, near the fluctuations' onset of masking to 1e-12 of itself
            assert_allclose(
                taken[name].value,
                (before - after) / areas[0],
                rtol=1e-9,
                atol=1e-12,
            )
        assert 0.01 < float(taken["lost_to_mean_stress"].value.max()) < 0.5


def test_a_lagging_edge_loses_nothing_that_it_has_still_to_lose_and_has_its_own_equilibrium():
    # A jump of the speed breaks half of the bonds at once; the edge follows within a few records.
    jump = drive.Table(time=(0.0, 0.1, 0.1, 0.4), speed=(0.0, 0.0, 1e-2, 1e-2))
    part = RateDependent(load=LOAD, front_speed=1e-4)
    population = bonds.Steady(critical_speed=1e-2)
    taken = shares(
        run(scene(contact=part, drive=jump, bonds=population, shear=shear.Uniform()))
    )
    assert_allclose(taken["lost_to_fluctuations"].value, 0.0, rtol=0, atol=1e-13)
    lag, lost = (
        taken["lost_to_lag"].value.to_numpy(),
        taken["lost_to_bonds"].value.to_numpy(),
    )
    assert_allclose(lag[:5], 0.0, rtol=0, atol=1e-13)
    # the area is still there that the bonds no longer pay for
    assert lag.min() < -0.3 * lost[-1]
    assert np.all(np.diff(lag[6:]) > 0.0)
    assert "lost_to_lag" not in shares(run(scene(shear=shear.Uniform())))
    down = RateDependent(indentation={"from": -1e-5, "to": 1e-5}, front_speed=1e-3)
    dataset = run(
        scene(
            contact=down,
            bonds=bonds.Unbroken(),
            shear=shear.Uniform(),
            clock=Clock(0.4, 0.02),
        )
    )
    assert dataset["in_contact"].to_numpy()[9:12].tolist() == [0, 0, 1]
    lost = read.share_observables(dataset)
    assert_array_equal(lost["lost_to_lag"].isnull(), np.arange(21) < 10)
    assert float(lost["lost_to_lag"][10]) == 1.0
    assert_array_equal(lost["lost_to_fluctuations"][10:], 0.0)
    control = {"load": {"from": 4e-3, "to": 20e-3}, "reversible": 0.02}
    parts = {"bonds": bonds.Unbroken(stress=1e5), "shear": shear.Uniform()}
    lagging = run(scene(contact=RateDependent(front_speed=1e-7, **control), **parts))
    settled = run(scene(contact=Equilibrium(**control), **parts))
    assert_allclose(
        lagging["equilibrium_radius"], settled["contact_radius"], rtol=1e-14
    )
    assert float(lagging["contact_radius"][-1]) < 0.99 * float(
        settled["contact_radius"][-1]
    )


MOVED = {
    "load": {"load": {"from": 1e-3, "to": 8e-3, "scale": "log", "cycles": 2}},
    "load in a table": {
        "load": {"time": [0.0, 0.1, 0.4], "value": [1e-3, 8e-3, -0.2e-3]}
    },
    "indentation": {"indentation": {"from": 2e-6, "to": -0.4e-6, "cycles": 1}},
    "displacement": {
        "displacement": {"from": 3e-6, "to": -0.5e-6, "cycles": 3},
        "stiffness": 2e3,
    },
}


@pytest.mark.parametrize("control", MOVED)
@pytest.mark.parametrize(
    "records", [(0, 10, 17), pytest.param((0, 3, 10, 17, 20), marks=pytest.mark.verify)]
)
def test_shares_of_a_moved_sphere_are_those_at_its_present_place(records, control):
    """Each record of a course is the same as a run at its value: the parts react at once."""
    parts = {
        "bonds": bonds.Steady(critical_speed=1e-2),
        "drive": drive.Steady(speed=3e-3),
    }
    parts["shear"] = shear.Mean(spectrum=Band(rms=60e3, longest=60e-6, shortest=24e-6))
    moving = Equilibrium(**MOVED[control])
    dataset = run(scene(contact=moving, **parts))
    moved = read.share_observables(dataset)
    kind = next(
        name
        for name in ("load", "indentation", "displacement")
        if name in MOVED[control]
    )
    held = MOVED[control] | {
        kind: moving.course.at(dataset["t"].to_numpy(), 0.4).tolist()
    }
    for at in records:
        still = run(
            scene(
                contact=Equilibrium(**(held | {kind: float(held[kind][at])})), **parts
            )
        )
        lost = read.share_observables(still)
        for name in ("lost_to_bonds", "lost_to_fluctuations"):
            assert_allclose(moved[name][at], lost[name][0], rtol=1e-11, atol=1e-14)
        moving_ratio, ratio = (
            read.observables(each)["area_ratio"] for each in (dataset, still)
        )
        assert_allclose(moving_ratio[at], ratio[0], rtol=1e-12)


def test_a_moved_sphere_comes_off_by_its_policy():
    pulled = Equilibrium(load={"from": -0.1e-3, "to": -0.3e-3})
    dataset = run(
        scene(
            contact=pulled,
            bonds=bonds.Steady(critical_speed=1e-2),
            shear=shear.Uniform(),
        )
    )
    assert dataset["in_contact"].to_numpy()[[0, -1]].tolist() == [1, 0]
    assert_allclose(
        dataset["applied_load"], np.linspace(-0.1e-3, -0.3e-3, 21), rtol=1e-12
    )
    # it is lost to the detachment
    assert math.isnan(shares(dataset)["lost_to_bonds"].value[-1])
    assert float(read.observables(dataset)["area_ratio"][-1]) == 0.0
    course = {"from": 2e-6, "to": -3e-6, "cycles": 1}
    for policy, closes in (("stay_open", False), ("reattach", True), ("stop", False)):
        part = Equilibrium(indentation=course, after_pull_off=policy)
        dataset = run(
            scene(contact=part, bonds=bonds.Unbroken(), shear=shear.Uniform())
        )
        reference = read.reference_radii(dataset)["radius_jkr"].to_numpy()
        recorded = dataset["contact_radius"].to_numpy()
        assert_array_equal(np.isnan(reference), ~(recorded > 0.0))
        assert (reference[-1] > 0.0) == closes and np.isnan(reference[10])
        assert_allclose(
            reference[reference > 0.0], recorded[recorded > 0.0], rtol=1e-13
        )
    part = Equilibrium(indentation={"from": 1e-6, "to": -0.7e-6}, after_pull_off="stop")
    dataset = run(scene(contact=part, drive=drive.Steady(speed=3e-3)))
    gone = dataset["contact_area"].isnull()
    assert 0 < int(gone.sum()) < gone.size
    lost = read.share_observables(dataset)
    for name in lost:
        assert_array_equal(
            lost[name].isnull(),
            gone | read.reference_radii(dataset)["radius_jkr"].isnull(),
        )


def test_no_speed_is_stated_at_which_more_is_lost_than_can_be_nor_under_a_force():
    scenario = scene(
        shear=shear.Uniform(), adhesion=Adhesion(work=WORK, bond_share=0.3)
    )
    speeds = read.loss_speeds(run(scenario))
    # JKR's areas with 70 % of the work of adhesion and with all of it
    left, full = (
        jkr.radius_at_load(LOAD, share * WORK, RADIUS, MODULUS) ** 2
        for share in (0.7, 1.0)
    )
    assert 100.0 * (1.0 - left / full) < 50.0
    reason = f"never: at most {100 * (1 - left / full):.3g} % of the area can be lost"
    assert speeds["speed_at_50_percent_lost"].reason.item() == reason
    creeping = scene(
        shear=shear.Uniform(),
        drive=drive.Force(force=1e-3, contact_stiffness="rigid"),
        bonds=bonds.FirstMoment(
            rupture=bonds.Bell(zero_force_rate=5.0, bell_force=4e-12),
            bond_stiffness=8e-7,
            rebinding_rate=50.0,
            site_density=6.5e16,
        ),
    )
    assert not read.loss_speeds(run(creeping))
    with pytest.raises(BadInput, match="force"):
        read.loss_speeds(run(creeping), ["10 %"])


@pytest.mark.parametrize(("at_rest", "is_bound"), [(0.8, False), (0.98, True)])
def test_a_loss_that_rest_has_already_has_no_speed(at_rest, is_bound):
    speeds, left = np.array([0.0, 1e-3, 2e-3]), np.array([[at_rest, 0.79, 0.78]])
    result = read.crossing(speeds, left, np.ones(1), 0.95)
    assert math.isnan(result.speed) and math.isnan(result.low)
    assert_allclose(result.high, 1e-3 if is_bound else math.nan, rtol=1e-12)
    assert "at rest" in result.reason and "lowest" not in result.reason


def test_a_loss_that_was_reached_in_the_noise_has_no_bound_at_the_highest_speed():
    """The mean of two members is below the level at one speed, and surely above it at the highest one."""
    speeds, off = np.geomspace(1e-3, 1e-2, 9), np.full(9, 0.02)
    mean = np.full(9, 0.9)
    mean[5], off[5], off[-1] = 0.75, 0.2, 0.0
    result = read.crossing(speeds, np.stack([mean - off, mean + off]), np.ones(2), 0.8)
    assert math.isnan(result.speed) and not result.low > speeds[5]
    assert "noise" in result.reason
    calm = np.where(mean < 0.8, 0.9, mean)
    result = read.crossing(speeds, np.stack([calm - off, calm + off]), np.ones(2), 0.8)
    assert_allclose(result.low, speeds[-1], rtol=1e-12)
    assert "highest speed" in result.reason


@pytest.mark.parametrize("ends", [(2e-2, 1e-4), (1e-4, 2e-2)])
def test_a_bound_of_a_speed_is_one_of_the_run(ends):
    """Bonds are late along a ramp, but at its start they have felt no other speed."""
    start, stop = ends
    late = bonds.Rate(critical_speed=5e-2, rebinding_rate=100.0)
    ramp = drive.Ramp(start=start, stop=stop)
    clock = Clock(0.5, 5e-3)
    parts = {"drive": ramp, "bonds": late, "shear": shear.Uniform(), "clock": clock}
    result = read.loss_speeds(run(scene(**parts)), ["0.01 %", "30 %"])
    low, high = (result[f"speed_at_{loss}_percent_lost"] for loss in ("0.01", "30"))
    # a bound is above the lowest speed, or below the highest one, by the delay at the end of the ramp
    bound = high.low if start > stop else low.high
    assert_allclose(bound, start, rtol=1e-12)


def test_contacts_without_adhesion_or_that_never_close_have_no_speed_of_a_loss():
    """The loss of an open contact has no speed in steady sliding either."""
    late = bonds.Rate(critical_speed=5e-3, rebinding_rate=20.0)
    parts = {"bonds": late, "shear": shear.Uniform()}
    drawn = Equilibrium(indentation=-0.35e-6, after_pull_off="reattach")
    ramp = drive.Ramp(start=2e-2, stop=1e-4)
    absent = {
        "at most 0 %": {"adhesion": Adhesion(work=0.0)},
        "open": {"contact": drawn, "drive": ramp},
    }
    for words, changes in absent.items():
        dataset = run(scene(**parts, **changes))
        assert read.loss_speeds(dataset) == {}
        result = read.loss_speeds(dataset, ["10 %"])
        assert not [name for name in result if name.startswith("steady_speed")]
        assert words in result["speed_at_10_percent_lost"].reason.item()
        assert bool(result["speed_at_10_percent_lost"].is_missing)
    assert read.loss_speeds(run(scene(**parts)))


def test_below_the_maximum_of_friction_any_spring_slides_steadily():
    path = Path(sim.__file__).parents[1] / "scenarios" / "stick_slip.toml"
    point = sim.load(path).points()[0]
    # one speed on either side of the maximum
    curves = sim.steady_curves(point, [1e-3, 2.33e-3, 4e-3])
    friction = curves["friction_force"].to_numpy()
    assert friction[1] > max(friction[0], friction[2])
    curves = curves.isel(speed=[0, 2])
    speeds, stable = speeds_of_areas(point, curves["area_ratio"].to_numpy())
    assert_allclose(speeds, [1e-3, 4e-3], rtol=1e-6)
    # behind 25 N/m, where 1128 N/m are needed
    assert stable.tolist() == [True, False]


@pytest.mark.parametrize(
    ("low", "high", "lags"),
    [(math.nan, math.nan, True), (1e-6, 1e-4, False), (2e-5, 1e-4, True)],
)
def test_a_course_whose_noise_leaves_an_interval_lags_if_this_does_not_hold_the_steady_speed(
    low, high, lags
):
    steady, ends = 1e-5, (math.nan, low, high)
    speed = xr.DataArray(np.geomspace(1e-8, 1e-3, 20), dims="t")
    ends = [xr.DataArray(end) for end in ends]
    stated, _ = over_speed._lag(ends, xr.DataArray(steady), xr.DataArray(True), speed)
    assert bool(stated.notnull()) is lags
