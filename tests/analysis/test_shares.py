"""Shares: what each mechanism takes of JKR's area adds up, whatever holds the sphere."""

import math

import numpy as np
import pytest
from helpers import lens
from helpers.lens import LOAD, MODULUS, RADIUS, WORK, scene

from sim import analysis
from sim.ensemble.simulate import run
from sim.laws import jkr, reversible
from sim.parts import drive
from sim.parts.bonds import models as bonds
from sim.parts.contact import Equilibrium, RateDependent
from sim.parts.contact.models import Adhesion
from sim.parts.shear import models as shear
from sim.scenario.clock import Clock, Record
from sim.spectrum.families import Band


@pytest.fixture(scope="module", name="ramp")
def _ramp():
    return lens.ramp()


def test_shares_and_what_is_left_add_up_to_one_in_every_member(ramp):
    lost, left = analysis.share_observables(ramp), analysis.observables(ramp)["area_ratio"]
    total = lost["lost_to_bonds"] + lost["lost_to_fluctuations"] + left
    np.testing.assert_allclose(total, 1.0, rtol=1e-15)
    assert lost["lost_to_fluctuations"].dims == ("member", "t")


def test_bonds_alone_take_what_their_work_takes():
    shares = analysis.shares(run(scene(shear=shear.Uniform(), bonds=bonds.Steady(critical_speed=1e-2))))
    speed = np.geomspace(1e-5, 1e-1, 21)
    area = [jkr.radius_at_load(LOAD, w, RADIUS, MODULUS) ** 2 for w in (WORK, WORK / (1.0 + speed / 1e-2))]
    # the loss is a difference of areas: its rounding is that of one
    np.testing.assert_allclose(shares["lost_to_bonds_mean"], 1.0 - area[1] / area[0], rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(shares["lost_to_fluctuations_mean"], 0.0)


def test_fluctuations_alone_take_all_of_adhesion_when_they_mask_it():
    masking = shear.Mean(spectrum=Band(rms=1e6, longest=60e-6, shortest=24e-6))
    shares = analysis.shares(run(scene(adhesion=Adhesion(work=WORK, bond_share=0.0), shear=masking)))
    hertz, full = jkr.hertz_radius_at_load(LOAD, RADIUS, MODULUS), jkr.radius_at_load(LOAD, WORK, RADIUS, MODULUS)
    np.testing.assert_allclose(shares["lost_to_bonds_mean"], 0.0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(shares["lost_to_fluctuations_mean"], 1.0 - (hertz / full) ** 2, rtol=1e-13)
    np.testing.assert_allclose(shares["area_ratio_hertz"], (hertz / full) ** 2, rtol=1e-13)
    np.testing.assert_allclose([shares["radius_jkr"], shares["radius_hertz"]], [full, hertz], rtol=1e-13)


def test_standard_error_of_a_share_is_that_of_its_members(ramp):
    shares, lost = analysis.shares(ramp), analysis.share_observables(ramp)["lost_to_fluctuations"].to_numpy()
    np.testing.assert_allclose(shares["lost_to_fluctuations_sem"], lost.std(axis=0, ddof=1) / math.sqrt(6), rtol=1e-10)
    # a mean-field population does not fluctuate: nothing but rounding is left
    np.testing.assert_allclose(shares["lost_to_bonds_sem"], 0.0, rtol=0, atol=1e-15)


def test_shares_of_a_sweep_are_those_of_its_points():
    for sweep in (
        {"contact.load": [1e-3, 1.6e-2]},
        [{"sphere.radius": 1e-3, "contact.load": 1e-3}, {"sphere.radius": 4e-3, "contact.load": 8e-3}],
        {"adhesion.work": [2e-2, 8e-2], "adhesion.bond_share": [0.3, 1.0]},
        {"contact": [{"model": "rate_dependent", "indentation": 1e-6, "front_speed": 1.0},
                     {"model": "equilibrium", "load": {"from": 4e-3, "to": 1e-3}, "reversible": 0.02}]},
    ):  # fmt: skip
        swept = scene(sweep=sweep)
        dataset = run(swept)
        together, ratio = analysis.share_observables(dataset), analysis.observables(dataset)["area_ratio"]
        dims = [name for name in ratio.dims if name not in ("member", "t")]
        for k, point in enumerate(swept.points()):
            place = dict(zip(dims, np.unravel_index(k, [ratio.sizes[name] for name in dims]), strict=True))
            alone = run(point)
            np.testing.assert_array_equal(ratio.isel(place), analysis.observables(alone)["area_ratio"])
            shares = analysis.share_observables(alone)
            for name in together:  # a mechanism that a point lacks takes nothing there
                np.testing.assert_array_equal(together[name].isel(place) - shares.get(name, 0.0), 0.0)


def test_shares_are_unknown_where_there_is_no_contact_at_rest():
    lifted = Equilibrium(load=1.5 * float(jkr.pull_off_load(WORK, RADIUS)))
    shares = analysis.shares(run(scene(contact=lifted, shear=shear.Uniform())))
    assert bool(shares["lost_to_bonds_mean"].isnull().all()) and math.isnan(shares["area_ratio_hertz"])


def test_shares_of_what_differs_between_members_need_each_member():
    for parts in (
        {"bonds": bonds.Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=100)},
        {"contact": Equilibrium(load=LOAD, reversible=0.02)},
        {"contact": RateDependent(load=LOAD, front_speed=1e-3)},
    ):
        with pytest.raises(ValueError, match="per_member = true"):
            analysis.shares(run(scene(record=Record(per_member=False), **parts)))


# -- what the mean stress takes -------------------------------------------------------------------


def test_mean_stress_is_charged_after_bonds_and_fluctuations():
    for control, radius in (
        ({"load": LOAD}, lambda w: jkr.radius_at_load(LOAD, w, RADIUS, MODULUS)),
        ({"indentation": 2e-6}, lambda w: jkr.radius_at_indentation(2e-6, w, RADIUS, MODULUS)),
    ):
        field = shear.Mean(spectrum=Band(rms=80e3, longest=60e-6, shortest=24e-6))
        population = bonds.Steady(critical_speed=1e-2, stress=1e5)
        dataset = run(scene(contact=Equilibrium(**control, reversible=0.03), bonds=population, shear=field))
        shares = analysis.shares(dataset)
        bonded = WORK / (1.0 + np.geomspace(1e-5, 1e-1, 21) / 1e-2)
        areas = [radius(w) ** 2 for w in (np.full(21, WORK), bonded, bonded - dataset["fluctuation_energy"].to_numpy())]
        areas.append((dataset["contact_radius"].to_numpy()) ** 2)
        names = ("lost_to_bonds", "lost_to_fluctuations", "lost_to_mean_stress")
        for name, before, after in zip(names, areas[:-1], areas[1:], strict=True):
            # the work is put together again from its parts, near the fluctuations' onset of masking to 1e-12 of itself
            np.testing.assert_allclose(shares[f"{name}_mean"], (before - after) / areas[0], rtol=1e-9, atol=1e-12)
        assert 0.01 < float(shares["lost_to_mean_stress_mean"].max()) < 0.5


def test_mean_stress_alone_takes_what_the_reversible_law_says():
    part = Equilibrium(load=LOAD, reversible=0.02)
    shares = analysis.shares(run(scene(contact=part, bonds=bonds.Unbroken(stress=3e5), shear=shear.Uniform())))
    full = jkr.radius_at_load(LOAD, WORK, RADIUS, MODULUS)
    left = reversible.radius_at_load_reversible(LOAD, WORK, 3e5, 0.02, RADIUS, MODULUS)
    np.testing.assert_allclose(shares["lost_to_mean_stress_mean"], 1.0 - (left / full) ** 2, rtol=1e-11)
    for name in ("lost_to_bonds_mean", "lost_to_fluctuations_mean"):
        np.testing.assert_allclose(shares[name], 0.0, rtol=0, atol=1e-13)


def test_the_equilibrium_of_a_lagging_edge_is_at_its_own_radius():
    """Under a growing load, where the mean stress takes a share that depends on the radius."""
    control = {"load": {"from": 4e-3, "to": 20e-3}, "reversible": 0.02}
    parts = {"bonds": bonds.Unbroken(stress=1e5), "shear": shear.Uniform()}
    lagging = run(scene(contact=RateDependent(front_speed=1e-7, **control), **parts))
    settled = run(scene(contact=Equilibrium(**control), **parts))
    np.testing.assert_allclose(lagging["equilibrium_radius"], settled["contact_radius"], rtol=1e-14)
    assert float(lagging["contact_radius"][-1]) < 0.99 * float(settled["contact_radius"][-1])


def test_what_a_rate_dependent_edge_has_still_to_lose_is_no_ones_loss():
    """A jump of the speed breaks half of the bonds at once; the edge follows within a few records."""
    jump = drive.Table(time=(0.0, 0.1, 0.1, 0.4), speed=(0.0, 0.0, 1e-2, 1e-2))
    part = RateDependent(load=LOAD, front_speed=1e-4)
    population = bonds.Steady(critical_speed=1e-2)
    shares = analysis.shares(run(scene(contact=part, drive=jump, bonds=population, shear=shear.Uniform())))
    np.testing.assert_allclose(shares["lost_to_fluctuations_mean"], 0.0, rtol=0, atol=1e-13)
    lag, lost = shares["lost_to_lag_mean"].to_numpy(), shares["lost_to_bonds_mean"].to_numpy()
    np.testing.assert_allclose(lag[:5], 0.0, rtol=0, atol=1e-13)
    assert lag.min() < -0.3 * lost[-1]  # the area is still there that the bonds no longer pay for
    assert np.all(np.diff(lag[6:]) > 0.0)
    assert "lost_to_lag_mean" not in analysis.shares(run(scene(shear=shear.Uniform())))


def test_an_edge_that_has_still_to_close_is_its_lags_loss():
    """A sphere laid down with a slow edge, without fluctuations: only the lag takes area, also where it touches."""
    down = RateDependent(indentation={"from": -1e-5, "to": 1e-5}, front_speed=1e-3)
    dataset = run(
        scene(contact=down, bonds=bonds.Unbroken(), shear=shear.Uniform(), clock=Clock(duration=0.4, step=0.02))
    )
    assert dataset["in_contact"].to_numpy()[9:12].tolist() == [0, 0, 1]
    lost = analysis.share_observables(dataset)
    np.testing.assert_array_equal(lost["lost_to_lag"].isnull(), np.arange(21) < 10)
    assert float(lost["lost_to_lag"][10]) == 1.0
    np.testing.assert_array_equal(lost["lost_to_fluctuations"][10:], 0.0)


# -- a sphere that is moved -----------------------------------------------------------------------

MOVED = {
    "load": {"load": {"from": 1e-3, "to": 8e-3, "scale": "log", "cycles": 2}},
    "load in a table": {"load": {"time": [0.0, 0.1, 0.4], "value": [1e-3, 8e-3, -0.2e-3]}},
    "indentation": {"indentation": {"from": 2e-6, "to": -0.4e-6, "cycles": 1}},
    "displacement": {"displacement": {"from": 3e-6, "to": -0.5e-6, "cycles": 3}, "stiffness": 2e3},
}


def test_a_moved_sphere_with_all_its_adhesion_loses_nothing():
    for control in MOVED:
        dataset = run(scene(contact=Equilibrium(**MOVED[control]), bonds=bonds.Unbroken(), shear=shear.Uniform()))
        assert np.ptp(dataset["contact_area"].to_numpy()) > 0.5 * float(dataset["contact_area"].max())
        np.testing.assert_allclose(analysis.observables(dataset)["area_ratio"], 1.0, rtol=1e-13)
        shares = analysis.shares(dataset)
        for name in ("lost_to_bonds_mean", "lost_to_fluctuations_mean"):
            np.testing.assert_allclose(shares[name], 0.0, rtol=0, atol=1e-13)
        np.testing.assert_allclose(shares["radius_jkr"], dataset["contact_radius"], rtol=1e-13)


@pytest.mark.parametrize("control", MOVED)
@pytest.mark.parametrize("records", [(0, 10, 17), pytest.param((0, 3, 10, 17, 20), marks=pytest.mark.verify)])
def test_shares_of_a_moved_sphere_are_those_at_its_present_place(records, control):
    """Each record of a course is the same as a run at its value: the parts react at once."""
    parts = {"bonds": bonds.Steady(critical_speed=1e-2), "drive": drive.Steady(speed=3e-3)}
    parts["shear"] = shear.Mean(spectrum=Band(rms=60e3, longest=60e-6, shortest=24e-6))
    moving = Equilibrium(**MOVED[control])
    dataset = run(scene(contact=moving, **parts))
    moved = analysis.share_observables(dataset)
    kind = next(name for name in ("load", "indentation", "displacement") if name in MOVED[control])
    held = MOVED[control] | {kind: moving.course.at(dataset["t"].to_numpy(), 0.4).tolist()}
    for at in records:
        still = run(scene(contact=Equilibrium(**(held | {kind: float(held[kind][at])})), **parts))
        lost = analysis.share_observables(still)
        for name in ("lost_to_bonds", "lost_to_fluctuations"):
            np.testing.assert_allclose(moved[name][at], lost[name][0], rtol=1e-11, atol=1e-14)
        np.testing.assert_allclose(
            analysis.observables(dataset)["area_ratio"][at], analysis.observables(still)["area_ratio"][0], rtol=1e-12
        )


def test_jkrs_contact_comes_off_and_closes_by_the_same_policy():
    course = {"from": 2e-6, "to": -3e-6, "cycles": 1}
    for policy, closes in (("stay_open", False), ("reattach", True), ("stop", False)):
        part = Equilibrium(indentation=course, after_pull_off=policy)
        dataset = run(scene(contact=part, bonds=bonds.Unbroken(), shear=shear.Uniform()))
        reference = analysis.reference_radii(dataset)["radius_jkr"].to_numpy()
        recorded = dataset["contact_radius"].to_numpy()
        np.testing.assert_array_equal(np.isnan(reference), ~(recorded > 0.0))
        assert (reference[-1] > 0.0) == closes and np.isnan(reference[10])
        np.testing.assert_allclose(reference[reference > 0.0], recorded[recorded > 0.0], rtol=1e-13)


def test_a_sphere_that_its_bonds_let_go_under_a_changing_load_stays_their_loss():
    """If no member is in contact, no variable records the load; the scenario states it."""
    pulled = Equilibrium(load={"from": -0.1e-3, "to": -0.3e-3})
    for record in (Record(), Record(per_member=False)):
        parts = {"bonds": bonds.Steady(critical_speed=1e-2), "shear": shear.Uniform(), "record": record}
        dataset = run(scene(contact=pulled, **parts))
        assert dataset["in_contact"].to_numpy()[[0, -1]].tolist() == [1, 0]
        np.testing.assert_allclose(dataset["applied_load"], np.linspace(-0.1e-3, -0.3e-3, 21), rtol=1e-12)
        rows = analysis.table(dataset, 3)
        (name,) = (name for name in rows[0] if name.startswith("P\n"))
        assert [float(row[name]) for row in rows] == [-100.0, -200.0, -300.0]
    dataset = run(scene(contact=pulled, **(parts | {"record": Record()})))
    assert float(analysis.shares(dataset)["lost_to_bonds_mean"][-1]) == 1.0
    assert float(analysis.observables(dataset)["area_ratio"][-1]) == 0.0


def test_shares_end_where_a_trajectory_stops():
    part = Equilibrium(indentation={"from": 1e-6, "to": -0.7e-6}, after_pull_off="stop")
    dataset = run(scene(contact=part, drive=drive.Steady(speed=3e-3)))
    gone = dataset["contact_area"].isnull()
    assert 0 < int(gone.sum()) < gone.size
    lost = analysis.share_observables(dataset)
    for name in lost:
        np.testing.assert_array_equal(
            lost[name].isnull(), gone | analysis.reference_radii(dataset)["radius_jkr"].isnull()
        )
