"""Each depth becomes its shallower neighbour in the limit that it names."""

import math

import numpy as np
import pytest
from helpers.scenes import (
    BELL,
    BY_SLIP,
    CUT_OFF,
    SPECTRUM,
    STRETCHED,
    drive,
    march,
    scene,
    shear,
)
from numpy.testing import assert_allclose

from sim.parts.bonds import models as bonds, tracked as tracks
from sim.parts.bonds.rupture import Bell, Constant, CutOff
from sim.parts.contact.models import Solid
from sim.scenario.scenario import Record

RAMP = drive.Ramp(start=1e-4, stop=3e-2, scale="log")


def last(members=1, steps=8, **parts):
    *_, state = march(
        scene(members, steps, **({"drive": RAMP} | parts)), np.arange(members)
    )
    return state


STARTED = drive.Start(rest=2e-3, speed=4e-3)


@pytest.mark.parametrize(
    "sites", [10**2, 10**3, pytest.param(10**4, marks=pytest.mark.verify)]
)
@pytest.mark.parametrize("rupture", [BELL, CUT_OFF], ids=["bell", "cut-off"])
def test_tracked_bonds_become_cohorts_as_their_number_grows(rupture, sites):
    # sites are independent at all times: the spread of number and stress is that of one site over root N
    members, recipe = 400, {"rupture": rupture, **STRETCHED, "start_from": "bonded"}
    dense = bonds.Cohort(**recipe)
    exact = last(bonds=dense, drive=STARTED)
    share, stress = exact.bonds.cohorts.weight.sum(), exact.bonding.stress[0]
    varying = exact.bonding.varying[0]
    few = bonds.Tracked(**recipe, sites=sites)
    found = last(members, bonds=few, drive=STARTED)
    for values, mean, spread in (
        (
            tracks.moments(found.bonds.frame, sites)[0],
            share,
            math.sqrt(share * (1.0 - share) / sites),
        ),
        (
            found.bonding.stress,
            stress,
            math.sqrt(STRETCHED["site_density"] * varying / sites),
        ),
    ):
        # cohorts are good to 1e-4 themselves; one site's excess kurtosis is below 10, that of N below 10/N
        assert abs(values.mean() - mean) < 5.0 * spread / math.sqrt(
            members
        ) + 1e-4 * abs(mean)
        assert abs(values.std() / spread - 1.0) < 5.0 * math.sqrt(
            (2.0 + 10.0 / sites) / (4.0 * members)
        )


@pytest.mark.parametrize("depth", [bonds.Cohort, bonds.FirstMoment])
def test_bell_bonds_become_those_of_a_constant_rate_to_first_order_as_the_bell_force_grows(
    depth,
):
    fine = {"tolerance": 1e-8} if depth is bonds.Cohort else {}
    slid = {"drive": drive.Steady(speed=2e-3)}

    def found(rupture):
        part = depth(rupture=rupture, **STRETCHED, start_from="bonded", **fine)
        bonding = last(bonds=part, **slid).bonding
        return np.array([bonding.fraction[0], bonding.stress[0]])

    limit = found(Constant(rate=200.0))
    errors = [
        found(Bell(zero_force_rate=200.0, bell_force=factor * 4e-12)) / limit - 1.0
        for factor in (1e2, 1e3, 1e4)
    ]
    assert np.all(np.array(errors) < 0.0)  # force opens bonds
    # error = a/F + b/F^2 with b/a of order ten: from 1e2 to 1e3 the ratio is ten but for ten percent, then one
    assert_allclose(errors[0] / errors[1], 10.0, rtol=0.1)
    assert_allclose(errors[1] / errors[2], 10.0, rtol=0.01)


@pytest.mark.parametrize("speed", [1e-4, 8e-3, 1.0])
def test_bonds_that_only_a_stretch_breaks_are_the_papers_steady_law(speed):
    # N0/(1 + V/Vc) with Vc = l k_on, at once from the steady start and for ever; each bond half stretched on average
    recipe = {"rupture": CutOff(stretch=20e-6), **STRETCHED}
    law = bonds.Steady(critical_speed=20e-6 * STRETCHED["rebinding_rate"])
    steady = last(bonds=law, drive=drive.Steady(speed=speed))
    full = 0.5 * STRETCHED["site_density"] * STRETCHED["bond_stiffness"] * 20e-6
    # the slowest live for 0.2 s
    for start, steps in (("steady", 8), ("empty", 100))[: 1 if speed < 1e-3 else 2]:
        part = bonds.Cohort(**recipe, start_from=start)
        state = last(steps=steps, bonds=part, drive=drive.Steady(speed=speed)).bonding
        assert_allclose(state.fraction, steady.bonds.bound, rtol=1e-4)
        assert_allclose(state.stress, full * steady.bonds.bound, rtol=1e-4)


def test_a_layer_becomes_a_half_space_as_its_thickness_grows():
    def found(thickness):
        solid = {"shear_modulus": 1.6e6, "thickness": thickness}
        state = last(3, steps=20, solid=Solid(**solid), shear=shear.Banded(**BY_SLIP))
        return state.shear.energy, state.contact.radius

    (energy, radius), layers = found(None), [found(h) for h in (1e-3, 2e-3, 4e-3)]
    # third order in a/h under a load, because the terms before only shift the indentation
    errors = [of_layer[1] / radius - 1.0 for of_layer in layers]
    assert_allclose(errors[0] / errors[1], 8.0, rtol=0.02)
    assert_allclose(errors[1] / errors[2], 8.0, rtol=0.004)
    # the waves are much shorter than the thickness
    for of_layer in layers:
        assert_allclose(of_layer[0], energy, rtol=1e-14, atol=0)


def test_auto_is_the_depth_that_it_chooses():
    for auto, chosen in (
        (shear.Auto(spectrum=SPECTRUM), shear.Mean(spectrum=SPECTRUM)),
        (shear.Auto(**BY_SLIP), shear.Banded(**BY_SLIP)),
    ):
        assert scene(shear=auto).fluctuations == chosen
        assert np.array_equal(
            last(3, shear=auto).shear.energy, last(3, shear=chosen).shear.energy
        )
    mapped = scene(shear=shear.Auto(**BY_SLIP), record=Record(maps=(2e-3,)))
    assert mapped.fluctuations == shear.Mapped(**BY_SLIP)
    assert mapped.process.modes.points > 2
