"""Bonds with a stretch in whole scenes: static peaks, ageing, reversal, area, and the field that they make."""

import contextlib
import functools
import math
from itertools import product

import numpy as np
import pytest
from helpers.scenes import (
    BELL,
    BONDS,
    CELL,
    STRETCHED,
    Time,
    bonds,
    drive,
    march,
    one_step,
    records,
    scene,
    shear,
)
from numpy.testing import assert_allclose

from sim.laws.schallamach import start_up_peak
from sim.numerics.noise import Noise
from sim.parts.bonds.rupture import Constant
from sim.scenario.scenario import Clock
from sim.solid import HalfSpace
from sim.spectrum.families import Band, BondMade
from sim.units.errors import BadInput

RATES = BELL.zero_force_rate, BELL.bell_force, STRETCHED["bond_stiffness"]
SITES, BINDING = STRETCHED["site_density"], STRETCHED["rebinding_rate"]
REST = BINDING / (BINDING + BELL.zero_force_rate)
# where a life at rest stretches by f_b
PACE = BELL.zero_force_rate * BELL.bell_force / STRETCHED["bond_stiffness"]
COHORT = bonds.Cohort(rupture=BELL, **STRETCHED, tolerance=1e-4)
FIELD = BondMade(footprint=1e-5)
CELLED = {"spectrum": FIELD, "cell": CELL, "points": 32, "correlation": Time(time=2e-3)}


@functools.cache
def volterra(first, beta, eps, end, points):
    """Share bound and stretch per site at ``end`` after a start with a share ``first`` bound, unstretched.

    F = 1 - first S - beta ∫F S, times in 1/k0, by the trapezoidal rule, Richardson-extrapolated twice.
    """

    def solve(n):
        age = np.linspace(0.0, end, n + 1)
        alive, h = np.exp(-np.expm1(eps * age) / eps), end / n
        free = np.empty(n + 1)
        free[0] = 1.0 - first
        for i in range(1, n + 1):
            past = 0.5 * free[0] * alive[i] + np.dot(free[1:i], alive[i - 1 : 0 : -1])
            free[i] = (1.0 - first * alive[i] - beta * h * past) / (
                1.0 + 0.5 * beta * h
            )
        young = (
            np.dot(free[1:-1], (age * alive)[-2:0:-1])
            + 0.5 * free[0] * age[-1] * alive[-1]
        )
        return np.array(
            [1.0 - free[-1], eps * (first * end * alive[-1] + beta * h * young)]
        )

    coarse, middle, fine = (solve(points * k) for k in (1, 2, 4))
    return (16 * (4 * fine - middle) / 3 - (4 * middle - coarse) / 3) / 15


def last(members=1, **parts):
    scenario = scene(members, **parts)
    *_, state = march(scenario, np.arange(members))
    return scenario, state


def test_static_friction_ages_as_the_bonds_of_an_empty_contact_come_and_saturate():
    for rest in [0.5e-3, 2e-3, 8e-3, 40e-3]:
        # at rest the share is REST (1 - exp(-(k_on + k_0) t)), all unstretched: the renewal equation from there
        speed, sliding = 10.0 * PACE, 1e-3
        empty = bonds.Cohort(rupture=BELL, **STRETCHED, start_from="empty")
        steps = round((rest + sliding) / 0.25e-3)
        parts = {"bonds": empty, "drive": drive.Start(rest=rest, speed=speed)}
        parts["clock"] = Clock(duration=rest + sliding, step=(rest + sliding) / steps)
        fraction, stress = np.array(
            records(scene(1, **parts), "bond_fraction", "shear_stress")
        )[..., 0]
        started = steps - 4
        aged = -math.expm1(-(BINDING + BELL.zero_force_rate) * rest)
        assert_allclose(fraction[started], aged, rtol=1e-4)
        assert np.all(stress[: started + 1] == 0.0)
        for k in (1, 2, 4):
            exact = volterra(
                REST * aged, BINDING / RATES[0], 10.0, RATES[0] * k * 0.25e-3, 400
            )[1]
            assert_allclose(
                stress[started + k], SITES * BELL.bell_force * exact, rtol=1e-4
            )


def test_without_rebinding_every_site_starts_bound_and_outlives_a_force_as_of_bell_and_evans():
    # loaded at the rate κV from zero, a bond outlives the force f with the chance exp(−k0 f_b/(κV) (e^(f/f_b) − 1))
    eps, sites, members = 30.0, 500, 20
    times = start_up_peak(eps * PACE, *RATES).time * np.arange(41) / 20.0
    alive = np.exp(-np.expm1(eps * RATES[0] * times) / eps)
    force = STRETCHED["bond_stiffness"] * eps * PACE * times
    parts = {
        "drive": drive.Steady(speed=eps * PACE),
        "clock": Clock(duration=times[-1], step=times[1]),
    }
    # with as good as none a fraction of 1 means the few bonds of rest
    for rebinding in (0.0, 1e-9):
        recipe = (
            {"rupture": BELL, "start_from": "bonded"}
            | STRETCHED
            | {"rebinding_rate": rebinding}
        )
        of_rest = rebinding / (rebinding + RATES[0]) if rebinding else 1.0
        for part in (bonds.FirstMoment(**recipe), bonds.Cohort(**recipe)):
            fraction, stress = records(
                scene(1, bonds=part, **parts), "bond_fraction", "shear_stress"
            )
            assert_allclose(fraction[:, 0] * of_rest, alive, rtol=1e-6, atol=1e-8)
            assert_allclose(
                stress[:, 0],
                SITES * force * alive,
                rtol=1e-6,
                atol=1e-8 * SITES * force[-1],
            )
        tracked = scene(members, bonds=bonds.Tracked(**recipe, sites=sites), **parts)
        bound = records(tracked, "bond_fraction")[0].mean(axis=1) * of_rest
        assert np.all(
            np.abs(bound - alive)
            <= 5.0 * np.sqrt(alive * (1.0 - alive) / (members * sites))
        )
    # else there is never a bond
    with pytest.raises(BadInput, match=r'bonds\.start.*"bonded"'):
        scene(bonds=bonds.Cohort(rupture=BELL, **STRETCHED | {"rebinding_rate": 0.0}))


@pytest.mark.parametrize(
    ("kind", "more"),
    [("rate", {}), ("cohort", {"tolerance": 1e-6}), ("tracked", {"sites": 400})],
)
def test_bonds_of_a_critical_speed_and_a_stress_lose_half_of_them_there_and_reach_the_stress_on_a_ramp(
    kind, more
):
    rupture = {
        "model": "bell",
        "bell_force": "4 pN",
        "critical_speed": "3 mm/s",
        "stress": "0.2 MPa",
    }
    table = {
        "model": kind,
        "rupture": rupture,
        "bond_stiffness": "0.8 uN/m",
        "rebinding_ratio": 10.0,
    } | more
    # a ramp so slow that its bonds are steady: their memory is below 0.1 s
    slow = Clock(duration=200.0, step=0.5)
    members = 20 if kind == "tracked" else 1
    lens = scene(
        members,
        bonds=table,
        drive=drive.Steady(speed=3e-3),
        clock=Clock(duration=2.0, step=0.02),
    )
    fraction = records(lens, "bond_fraction")[0][50:].mean(axis=0)
    error = fraction.std() / math.sqrt(members) if members > 1 else 2e-6
    assert abs(fraction.mean() - 0.5) < 5.0 * error
    if kind != "tracked":
        ramp = drive.Ramp(start=2e-4, stop=2e-3, scale="log")
        stress = records(scene(bonds=table, drive=ramp, clock=slow), "shear_stress")[0]
        # of two records the nearer lies within 0.0029 of the top in ln V, whose curvature is below 1
        assert_allclose(stress.max(), 2e5, rtol=2e-4)
    changed = lens.with_values(
        {"bonds.rupture.critical_speed": 6e-3, "bonds.rupture.stress": 1e5}
    )
    rates = (
        "bonds.rupture.zero_force_rate",
        "bonds.rebinding_rate",
        "bonds.site_density",
    )
    ratios = [changed.derived[key][1] / lens.derived[key][1] for key in rates]
    # all rates scale with the speed, the sites with the stress
    assert_allclose(ratios, [2.0, 2.0, 0.5], rtol=1e-13)
    assert not lens.with_values({"bonds": BONDS["rate, bell"]}).derived


def test_sites_that_are_followed_are_compared_with_density_times_area():
    per_site = math.pi * scene().rest_radius ** 2
    tracked = {"rupture": BELL, "sites": 5} | STRETCHED
    fewer = scene(
        bonds=bonds.Tracked(**tracked | {"site_density": 6.3 / per_site})
    ).remarks()
    (remark,) = (text for text in fewer if "sites" in text)
    assert all(number in remark for number in ("5 sites", "6.3", "1.26"))
    equal = scene(
        bonds=bonds.Tracked(**tracked | {"site_density": 5.0 / per_site})
    ).remarks()
    assert not any("sites" in text for text in equal)


DEAD = Constant(rate=1e-9)
LASTING = STRETCHED | {"rebinding_rate": 0.0}
CARRIED = {
    "rate": bonds.Rate(
        critical_speed=1e9,
        rebinding_rate=1e-9,
        stress=2e5,
        start_from="bonded",
        area="carried",
    ),
    "first moment": bonds.FirstMoment(
        rupture=DEAD, **LASTING, start_from="bonded", area="carried"
    ),
    "cohort": bonds.Cohort(
        rupture=DEAD, **LASTING, start_from="bonded", area="carried"
    ),
}


def over(part, state, radius):
    """The population over a contact of this radius, no time passing."""
    still = np.zeros(1)
    motions = one_step(1, 0.0, 0.0, still, still, still, still)
    return part.advance(
        state, motions, np.array([radius]), Noise(5, "bonds", np.arange(1))
    )[0]


def test_bonds_thin_with_every_growth_of_the_contact_and_shrinkage_takes_them_along():
    for name in CARRIED:
        part = CARRIED[name]
        _, state = last(1, steps=1, bonds=part, drive=drive.Steady(speed=1e-3))
        full, stress, *_ = state.bonding
        held = over(part, state.bonds, 1e-4)
        before = part.bonding(held).fraction
        for radius in (1.1e-4, 1.7e-4, 1.7e-4, 5e-4):
            held = over(part, held, radius)
            diluted = part.bonding(held)
            # n A phi
            assert_allclose(diluted.fraction * radius**2, before * 1e-8, rtol=1e-14)
            assert_allclose(
                diluted.stress / stress, diluted.fraction / full, rtol=1e-14
            )
        shrunk = over(part, held, 2e-4)
        assert np.array_equal(part.bonding(shrunk).fraction, diluted.fraction)
        opened = over(part, shrunk, np.nan)
        assert part.bonding(opened).fraction == 0.0  # an open contact has no bonds
        assert part.bonding(over(part, opened, 1e-4)).fraction == 0.0
    for name in [*CARRIED, "present"]:
        # nothing binds or breaks: the share that is left is that of all growths, which follow the radius by one step
        part = CARRIED.get(
            name, bonds.FirstMoment(rupture=DEAD, **LASTING, start_from="bonded")
        )
        breathing = shear.Modal(
            spectrum=Band(rms=50e3, longest=120e-6, shortest=60e-6),
            cell=CELL,
            correlation=Time(time=2e-3),
        )
        states = list(
            march(scene(5, steps=12, bonds=part, shear=breathing), np.arange(5))
        )
        radii = np.array([state.contact.radius for state in states])
        assert np.sum(np.diff(radii, axis=0) > 1e-8) > 10
        grown = np.maximum(radii[1:-1] / radii[:-2], 1.0)
        expected = np.concatenate(
            [np.ones((2, 5)), 1.0 / np.cumprod(grown, axis=0) ** 2]
        )
        fraction = np.array([state.bonding.fraction for state in states])
        if name == "present":
            assert fraction.shape == (13, 1)
            expected = np.ones((13, 1))
        assert_allclose(fraction, expected, rtol=1e-10)


def test_a_few_bonds_give_each_member_its_own_field():
    scenario, state = last(
        4,
        bonds=BONDS["tracked"],
        shear=shear.Mean(spectrum=FIELD),
        drive=drive.Steady(speed=PACE),
    )
    assert scenario.varies["shear"] and len(np.unique(state.shear.energy)) == 4
    bonding = state.bonding
    assert_allclose(
        state.shear.energy,
        (bonding.frozen + bonding.varying) * HalfSpace(1.6e6).stored_energy(FIELD),
        rtol=1e-14,
    )


def test_the_members_mean_energy_is_that_of_the_mean_on_their_own_cell():
    for kind, motion in product(
        [shear.Modal, shear.Mapped],
        [drive.Steady(speed=PACE), drive.Start(rest=4e-3, speed=5 * PACE)],
    ):
        members, part = 600, kind(**CELLED)
        scenario, state = last(members, bonds=COHORT, shear=part, drive=motion)
        errors = scenario.process.known_errors()
        _, mean = last(bonds=COHORT, shear=shear.Mean(spectrum=FIELD), drive=motion)
        cells = mean.shear.energy[0] * (1.0 + errors["cell_error_energy"])
        spread = errors["member_spread_energy"] * cells
        assert state.shear.energy.shape == (members,)
        assert abs(state.shear.energy.mean() - cells) < 5.0 * spread / math.sqrt(
            members
        )
        weights = scenario.process.weights
        # of a sum of exponentials
        kurtosis = 6.0 * np.sum(weights**4) / np.sum(weights**2) ** 2
        assert abs(state.shear.energy.std() / spread - 1.0) < 5.0 * math.sqrt(
            (2.0 + kurtosis) / (4.0 * members)
        )


def test_a_field_of_bonds_without_forces_or_stiffer_than_the_half_space_is_refused():
    for name in ("none", "rate", "counted", "rate, bell"):
        with pytest.raises(BadInput, match="force of each bond"):
            scene(bonds=BONDS[name], shear=shear.Mean(spectrum=FIELD))
    limit = 0.5 * math.pi**2 * 1.6e6 * 1e-9
    for stiffness, expected in (
        (limit, contextlib.nullcontext()),
        (1.0001 * limit, pytest.raises(BadInput, match="N/m")),
    ):
        stiff = bonds.Cohort(
            rupture=BELL, **(STRETCHED | {"bond_stiffness": stiffness})
        )
        with expected:
            scene(bonds=stiff, shear=shear.Mean(spectrum=BondMade(footprint=1e-9)))
