"""Bond populations against their exact laws."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from helpers.draws import fits
from helpers.scenes import (
    BELL,
    STRETCHED,
    Clock,
    Constant,
    bonds,
    drive,
    march,
    scene,
    shear,
)
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom

import sim
from sim.spectrum.families import BondMade

STEPPED = drive.Table(
    time=(0.0, 0.7, 0.7, 1.4, 1.4, 2.1), speed=(1e-5, 1e-5, 8e-2, 8e-2, 2e-3, 2e-3)
)


def fractions(population, motion, steps, members=1, seed=5, duration=2.1):
    scenario = scene(
        bonds=population,
        drive=motion,
        clock=Clock(duration=duration, step=duration / steps),
        seed=seed,
    )
    # 2500 members at a time: each draws the numbers of 4096 steps ahead
    batches = [
        np.arange(first, min(first + 2500, members))
        for first in range(0, members, 2500)
    ]
    marched = [
        [state.bonding.fraction for state in march(scenario, batch)]
        for batch in batches
    ]
    return np.concatenate(marched, axis=1)


def test_the_rate_equation_has_no_step_error_at_steady_speeds_and_one_of_second_order_under_a_ramp():
    for motion, start in product(
        [drive.Steady(speed=3e-3), STEPPED], ["steady", "bonded", "empty"]
    ):
        rate = bonds.Rate(critical_speed=1e-2, rebinding_rate=3.0, start_from=start)
        coarse, fine = fractions(rate, motion, 21), fractions(rate, motion, 147)
        assert_allclose(fine[::7], coarse, rtol=1e-12, atol=0)
    rate, ramp = (
        bonds.Rate(critical_speed=1e-2, rebinding_rate=3.0),
        drive.Ramp(start=1e-3, stop=5e-2),
    )
    steps = np.diff(
        [fractions(rate, ramp, steps)[-1, 0] for steps in (32, 64, 128, 256)]
    )
    assert_allclose(np.log2(steps[:-1] / steps[1:]), 2.0, atol=0.1)


@pytest.mark.parametrize(
    "members", [2_000, pytest.param(20_000, marks=pytest.mark.verify)]
)
@pytest.mark.parametrize("start", ["bonded", "empty"])
def test_counted_bonds_have_the_exact_distribution_at_every_time(members, start):
    # sites are independent, so their number is binomial at all times, with the probability of the rate equation
    sites = 6
    rate = bonds.Rate(critical_speed=1e-2, rebinding_rate=3.0, start_from=start)
    counted = bonds.Counted(
        critical_speed=1e-2, rebinding_rate=3.0, sites=sites, start_from=start
    )
    expected = fractions(rate, STEPPED, 9)[:, 0]
    numbers = np.rint(sites * fractions(counted, STEPPED, 9, members)).astype(int)
    # broken bonds, for more than a single cell
    enough = members * sites * (1.0 - expected) > 25.0
    enough[0] = False  # at the start all are in one cell
    assert enough.sum() > 5
    for probability, bound in zip(expected[enough], numbers[enough], strict=True):
        fits(
            np.bincount(bound, minlength=sites + 1),
            members * binom.pmf(np.arange(sites + 1), sites, probability),
        )


def test_counted_bonds_remember_with_the_rate_of_the_population():
    # correlation over one step of a stationary two-state site: exp(-(h + h V/Vc) dt)
    sites, members, rebinding_rate, step = 30, 5_000, 3.0, 0.1
    counted = bonds.Counted(
        critical_speed=1e-2, rebinding_rate=rebinding_rate, sites=sites
    )
    values = fractions(counted, drive.Steady(speed=1e-2), 3, members, duration=3 * step)
    expected = np.exp(-2.0 * rebinding_rate * step)
    assert abs(np.corrcoef(values[1], values[2])[0, 1] - expected) < 5.0 * (
        1.0 - expected**2
    ) / np.sqrt(members)


LINEAR = {"critical_speed": 1e-2, "rebinding_rate": 3.0}
FIELD = shear.Mean(spectrum=BondMade(footprint=1e-5))


def test_the_depth_left_open_is_chosen_by_noise_rupture_and_the_number_of_sites():
    for auto, depth in [
        (bonds.Auto(**LINEAR), bonds.Rate),
        (bonds.Auto(**LINEAR, sites=9_999), bonds.Counted),
        (bonds.Auto(**LINEAR, sites=10_000), bonds.Rate),
        (bonds.Auto(**LINEAR, sites=10_000, tolerance=5e-3), bonds.Counted),
        (bonds.Auto(rupture=BELL, **STRETCHED), bonds.Cohort),
        (bonds.Auto(rupture=BELL, **STRETCHED, sites=64), bonds.Tracked),
        (bonds.Auto(rupture=BELL, **STRETCHED | {"site_density": 1e11}), bonds.Tracked),
        (bonds.Auto(rupture=BELL, **STRETCHED, sites=10_000), bonds.Cohort),
        (bonds.Auto(rupture=Constant(rate=9.0), **STRETCHED, sites=64), bonds.Tracked),
        (bonds.Auto(rupture=Constant(rate=9.0), **STRETCHED), bonds.FirstMoment),
    ]:
        scenario = scene(bonds=auto)
        assert type(scenario.population) is depth
        assert scenario.varies["bonds"] == (depth in (bonds.Counted, bonds.Tracked))
        assert (
            scene(bonds=replace(auto, start_from="empty")).population.start_from
            == "empty"
        )
    assert (
        scene(bonds=bonds.Auto(**LINEAR, area="carried")).population.area == "carried"
    )
    # at a constant rate, but the force of each is needed
    read = bonds.Auto(rupture=Constant(rate=9.0), **STRETCHED)
    assert type(scene(bonds=read, shear=FIELD).population) is bonds.Cohort
    area = math.pi * scene().rest_radius ** 2
    by_density = bonds.Auto(rupture=BELL, **STRETCHED | {"site_density": 1e11})
    assert (
        by_density.number(area)
        == scene(bonds=by_density).population.sites
        == round(1e11 * area)
    )
    assert bonds.Auto(rupture=BELL, **STRETCHED, sites=12).number(area) == 12
    assert by_density.number(1e-15) == 1.0  # the smallest contact holds one
    assert (
        by_density.number(0.0)
        == by_density.number(math.nan)
        == bonds.Auto(**LINEAR).number(area)
        == math.inf
    )
    for tolerance, cohorts in [(0.5, 1e-4), (1e-2, 1e-4), (1e-4, 1e-5)]:
        auto = bonds.Auto(rupture=BELL, **STRETCHED, tolerance=tolerance)
        assert_allclose(scene(bonds=auto).population.tolerance, cohorts, rtol=1e-15)


def test_a_contact_carries_no_bonds_while_it_is_open_and_jumps_in_without_them():
    """Closed form of a free sphere that touches, a³ = 2π w R²/E* with the work of adhesion w without bonds."""
    for step in ("1 ms", "4 ms"):
        scenario = sim.load(
            {
                "clock": {"duration": "2 s", "step": step},
                "solid": {"shear_modulus": "1 MPa"},
                "sphere": {"radius": "2 mm"},
                "adhesion": {"work": "40 mJ/m^2", "bond_share": 0.5},
                "contact": {
                    "model": "equilibrium",
                    "indentation": {"from": "2 um", "to": "-5 um", "cycles": 1},
                    "after_pull_off": "reattach",
                },
                "drive": {"model": "steady", "speed": "1 um/s"},
                "bonds": {
                    "model": "rate",
                    "critical_speed": "10 um/s",
                    "rebinding_rate": "20 1/s",
                    "area": "carried",
                },
            }
        )
        dataset = sim.run(scenario)
        radius, bound = (
            dataset[name].values.ravel() for name in ("contact_radius", "bond_fraction")
        )
        opened, closed = np.flatnonzero(np.diff(1 * (radius > 0.0))) + 1
        assert bound[0] > 0.9 and radius[-1] > 0.0
        assert_array_equal(bound[opened + 1 : closed + 1], 0.0)
        modulus = 2.0 * 1e6 / (1.0 - scenario.solid.poisson_ratio)
        alone = (2.0 * math.pi * 20e-3 * 2e-3**2 / modulus) ** (1.0 / 3.0)
        # the sphere is pressed further in the step in which it touches
        assert alone <= radius[closed] < 1.03 * alone
