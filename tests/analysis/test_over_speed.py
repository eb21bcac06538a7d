"""Speeds at which area is lost, and the loss in both orders of charging: against curves and laws that are known."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers import lens
from helpers.lens import LOAD, MODULUS, RADIUS, WORK, scene

from sim import analysis
from sim.analysis import dataset as dataset_module, over_speed
from sim.analysis.observables import charges, observables
from sim.ensemble.simulate import run
from sim.laws import jkr
from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.contact import Equilibrium
from sim.parts.shear import models as shear
from sim.scenario.clock import Clock, Record

SPEEDS = np.geomspace(1e-3, 1e3, 61)
NAMES = ("speed_at_5_percent_lost", "speed_at_50_percent_lost", "speed_halfway_to_hertz")


def falling(speeds):
    """Falls by half at speed 1; straight lines over the speed's logarithm are off by far less than errors."""
    return 1.0 / (1.0 + speeds)


def test_a_crossing_is_exact_on_straight_lines_over_the_logarithm():
    curve = 1.0 - 0.1 * np.log(SPEEDS / SPEEDS[0])
    result = analysis.crossing(SPEEDS, curve[None], np.ones(1), 0.55)
    np.testing.assert_allclose(result.speed, SPEEDS[0] * math.exp(4.5), rtol=1e-12)
    assert math.isnan(result.low) and math.isnan(result.high)
    for level in (1.5, -1.0):  # there from the lowest speed on; never there
        assert math.isnan(analysis.crossing(SPEEDS, curve[None], np.ones(1), level).speed)


@pytest.mark.parametrize(("count", "spread"), [(61, 0.03), (1201, 0.1)], ids=["below the steps", "above the steps"])
@pytest.mark.parametrize("groups", [64, 8])
def test_intervals_of_a_speed_hold_what_they_promise(groups, count, spread):
    """Half of the variance is shared along the curve, as some of that of members at different speeds is."""
    rng, speeds, hits = np.random.default_rng(31), np.geomspace(1e-3, 1e3, count), []
    about = np.abs(np.log(speeds)) < 1.0  # what noise there is elsewhere changes nothing
    for _ in range(1000):
        noise = np.zeros((groups, count))
        noise[:, about] = rng.normal(size=(groups, 1)) + rng.normal(size=(groups, about.sum()))
        means = falling(speeds) + spread * math.sqrt(groups / 64.0 / 2.0) * noise
        result = analysis.crossing(speeds, means, np.full(groups, 64.0 / groups), 0.5)
        hits.append(result.low <= 1.0 <= result.high)
    assert 0.92 < np.mean(hits) < 0.98


def jkr_area(work):
    return math.pi * jkr.radius_at_load(LOAD, work, RADIUS, MODULUS) ** 2


def speed_of_loss(loss):
    """At which steady bonds alone take a share of the area: w = W/(1 + V/V_c) with V_c = 10 mm/s."""
    works = np.linspace(0.0, WORK, 200_001)
    work = np.interp(1.0 - loss, jkr_area(works) / jkr_area(WORK), works)
    return 1e-2 * (WORK / work - 1.0)


@pytest.mark.parametrize("swept", [True, False], ids=["sweep", "ramp"])
def test_speeds_of_bonds_that_break_are_those_of_the_law(swept):
    quiet = {"bonds": bonds.Steady(critical_speed=1e-2, stress=3e5), "shear": shear.Uniform()}
    if swept:
        speeds = {"drive.speed": list(np.geomspace(1e-4, 1.0, 161)), "contact.load": [LOAD, 2 * LOAD]}
        clock = Clock(duration=0.02, step=0.01)
        result = analysis.loss_speeds(run(scene(drive=drive.Steady(speed=1e-2), sweep=speeds, clock=clock, **quiet)))
        result = result.isel(contact_load=0)
    else:
        result = analysis.loss_speeds(
            run(
                scene(
                    drive=drive.Ramp(start=1e-4, stop=1.0, scale="log"), clock=Clock(duration=1.6, step=0.01), **quiet
                )
            )
        )
    hertz = jkr_area(0.0) / jkr_area(WORK)
    for name, loss in ((NAMES[0], 0.05), (NAMES[2], 0.5 * (1.0 - hertz))):
        # the largest curvature of the loss over log V is below one: (log step)^2/8 of it between speeds
        np.testing.assert_allclose(result[name], speed_of_loss(loss), rtol=2e-2)
    assert math.isnan(result[NAMES[1]])  # Hertz's area is two thirds
    assert result[NAMES[0]].attrs["units"] == "m/s"


@pytest.mark.parametrize("swept", [True, False], ids=["sweep", "ramp"])
def test_curves_over_the_speed_are_those_of_the_law(swept):
    """Steady bonds: the stress is 0.3 MPa/(1 + V/V_c), and friction is stress times area."""
    quiet = {"bonds": bonds.Steady(critical_speed=1e-2, stress=3e5), "clock": Clock(duration=0.4, step=0.01)}
    if swept:
        moved = {"drive": drive.Steady(speed=1e-2), "sweep": {"drive.speed": [1e-4, 1e-3, 1e-2]}}
    else:
        moved = {"drive": drive.Ramp(start=1e-4, stop=1e-2), "sweep": {"contact.load": [LOAD, 2.0 * LOAD]}}
    result = analysis.speed_curves(run(scene(**moved, **quiet)))
    assert result["contact_area_mean"].dims == (("speed",) if swept else ("contact_load", "speed"))
    assert result["speed"].attrs["units"] == "m/s" and float(result["speed"][-1]) == 1e-2
    law = 3e5 / (1.0 + result["speed"] / 1e-2)
    np.testing.assert_allclose(result["shear_stress_mean"], law.broadcast_like(result["shear_stress_mean"]), rtol=1e-12)
    np.testing.assert_allclose(result["friction_force_mean"], result["contact_area_mean"] * law, rtol=1e-12)
    assert float(result["contact_area_sem"].max()) > 0.0 and bool((result["friction_force_low"] > 0.0).all())


def test_curves_over_a_speed_that_stays_are_refused_and_those_of_what_is_missing_named():
    with pytest.raises(ValueError, match="nor is swept"):
        analysis.speed_curves(run(scene(drive=drive.Steady(speed=1e-2))))
    with pytest.raises(ValueError, match='add "friction_force" to record'):
        analysis.speed_curves(run(scene(record=Record(quantities=["speed", "contact_area"]))))
    (share,) = analysis.speed_curves(lens.ramp(), "lost_to_bonds")[["lost_to_bonds_mean"]].values()
    assert share.dims == ("speed",) and 0.0 < float(share[-1]) < 1.0


def test_a_ramp_is_read_in_pieces_of_its_time(monkeypatch):
    ramp, read = lens.ramp().isel(member=[0]), []
    whole = analysis.loss_speeds(ramp)
    monkeypatch.setattr(dataset_module, "ROOM", 500)
    monkeypatch.setattr(over_speed, "observables", lambda some: read.append(some.sizes["t"]) or observables(some))
    xr.testing.assert_identical(analysis.loss_speeds(ramp), whole)
    assert len(read) > 1 and sum(read) == ramp.sizes["t"] and math.isfinite(whole[NAMES[0]])


def test_speeds_of_fluctuating_members_have_an_error_and_statistics_alone_none():
    result = analysis.loss_speeds(lens.ramp())
    low, at, high = (float(result[NAMES[0] + end]) for end in ("_low", "", "_high"))
    assert 1e-5 < low < at < high < 1e-1
    assert not analysis.loss_speeds(run(scene(record=Record(per_member=False))))
    assert not analysis.loss_speeds(run(scene(drive=drive.Steady(speed=1e-2))))


@pytest.mark.parametrize(
    "contact",
    [
        Equilibrium(load=LOAD),
        Equilibrium(indentation=1e-6),
        Equilibrium(displacement=2e-6, stiffness=2e3),
        Equilibrium(load=LOAD, reversible=0.2),
    ],
    ids=["load", "indentation", "displacement", "reversible"],
)
def test_both_orders_of_charging_add_up_to_the_same_loss(contact):
    dataset = run(scene(contact=contact))
    shares = charges(dataset)
    bonds_first = shares["lost_to_bonds"] + shares["lost_to_fluctuations"]
    fluctuations_first = shares["lost_to_fluctuations_first"] + shares["lost_to_bonds_last"]
    np.testing.assert_allclose(fluctuations_first - bonds_first, 0.0, rtol=0, atol=1e-14)
    assert float(abs(shares["order_of_charging"]).max()) > 1e-3


def test_fluctuations_alone_leave_the_area_of_their_work():
    dataset = lens.ramp()
    left = jkr_area(WORK - dataset["fluctuation_energy"].to_numpy())
    result = charges(dataset)["lost_to_fluctuations_first"]
    np.testing.assert_allclose(result, 1.0 - left / jkr_area(WORK), rtol=0, atol=1e-14)
    unbroken = run(scene(bonds=bonds.Unbroken()))
    np.testing.assert_allclose(charges(unbroken)["order_of_charging"], 0.0, atol=1e-14)


def test_the_error_of_the_difference_of_orders_is_that_of_what_members_share():
    shared, charged = analysis.shares(lens.ramp()), charges(lens.ramp())
    apart = np.hypot(shared["lost_to_fluctuations_sem"], shared["lost_to_fluctuations_first_sem"])
    differ = float(charged["order_of_charging"].isel(t=-8).std("member", ddof=1)) / math.sqrt(6.0)
    np.testing.assert_allclose(shared["order_of_charging_sem"][-8], differ, rtol=1e-9)
    assert differ < 0.9 * float(apart[-8])


def test_where_the_other_order_is_not_known_it_is_left_out():
    assert "order_of_charging_mean" not in analysis.shares(run(scene(record=Record(per_member=False))))
