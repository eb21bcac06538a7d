"""Shares of masked contacts, mean areas and largest losses before a run, against closed forms and runs."""

import math

import numpy as np
import pytest
import scipy
from helpers.parts import Adhesion, Equilibrium, bonds, jkr, run, shear
from helpers.scenes import CONTACTS, scene
from numpy.testing import assert_allclose

from sim.ensemble.expected import StoredEnergy, expected, largest_losses
from sim.laws.reversible import radius_at_load_reversible
from sim.parts.drive import Ramp, Steady
from sim.parts.shear.process import Time
from sim.spectrum.families import SelfAffine

WORK, RADIUS, MODULUS, LOAD, CRITICAL = 42e-3, 2e-3, 6.4e6, 4e-3, 10e-3
#: The fluctuations of a review, in which 78 % of the time is masked at 30 mm/s although the mean energy masks nothing.
FIELD = SelfAffine(1e5, 0.8, 50e-6, 50e-6, 1e-6)
PAPER = bonds.Steady(critical_speed=CRITICAL, stress=0.3e6)


def masking(speed, members=1, steps=1, **parts):
    """The lens of the review at a speed."""
    field = shear.Banded(spectrum=FIELD, correlation=Time(time=20e-3))
    given = {"drive": Steady(speed=speed), "bonds": PAPER, "shear": field}
    return scene(members, steps, **given | parts)


def area(work, load=LOAD):
    return np.pi * jkr.radius_at_load(load, work, RADIUS, MODULUS) ** 2


@pytest.mark.parametrize("speed", [16e-3, 20e-3, 24e-3, 30e-3, 40e-3])
def test_masked_share_and_mean_area_are_integrals_over_the_gamma_law(speed):
    lens = masking(speed)
    law = StoredEnergy.of(lens)
    exact = scipy.stats.pearson3(law.skewness, law.mean, law.deviation)
    left = WORK / (1.0 + speed / CRITICAL)
    found = expected(lens)
    assert_allclose(found.masked, exact.sf(left), rtol=0, atol=2e-5)
    assert_allclose(found.masked_time, found.masked[0], rtol=1e-12)

    def ratio(energy):
        return area(left - energy) / area(WORK) * exact.pdf(energy)

    last = min(exact.ppf(1.0 - 1e-12), left)
    mean = scipy.integrate.quad(ratio, exact.ppf(1e-12), last, limit=200)[0]
    mean += exact.sf(left) * area(0.0) / area(WORK)
    # the area falls with the energy, so that the midpoint rule is off by half of the range over the 256 energies
    range_of_areas = float(area(left) - area(0.0)) / float(area(WORK))
    assert_allclose(found.area, mean, rtol=0, atol=range_of_areas / 512)
    assert_allclose(found.without[:2, 0], [1.0, area(left) / area(WORK)], rtol=1e-12)


def test_a_run_is_masked_as_often_as_is_expected_and_has_that_area():
    lens = masking(24e-3, members=4000)
    dataset = run(lens)
    found = expected(lens)
    ratios = np.asarray(dataset["contact_area"].isel(t=-1)) / area(WORK)
    masked = np.asarray(dataset["masked"].isel(t=-1))
    share = float(found.masked[0])
    assert_allclose(
        masked.mean(), share, atol=4.0 * math.sqrt(share * (1.0 - share) / 4000)
    )
    bound = 4.0 * ratios.std() / math.sqrt(4000)
    assert_allclose(ratios.mean(), found.area[0], atol=bound)
    # the area at the mean energy is another number
    at_mean = area(WORK / 3.4 - StoredEnergy.of(lens).mean) / area(WORK)
    assert abs(ratios.mean() - at_mean) > bound


def test_nothing_is_masked_that_adhesion_does_not_pay_for_or_that_is_slow():
    for lens in (
        masking(1e-3),
        masking(40e-3, shear=shear.Uniform()),
        masking(
            40e-3,
            shear=shear.Banded(
                spectrum=FIELD, correlation=Time(time=20e-3), paid_by_adhesion=0.0
            ),
        ),
    ):
        assert np.all(expected(lens).masked < 1e-12)
    # without any adhesion all contacts are Hertz's
    hertz = masking(1e-3, adhesion=Adhesion(work=0.0))
    assert expected(hertz).masked == 1.0


def test_a_ramp_is_masked_for_the_mean_share_along_it():
    lens = masking(0.0, drive=Ramp(start=10e-3, stop=50e-3))
    law = StoredEnergy.of(lens)
    exact = scipy.stats.pearson3(law.skewness, law.mean, law.deviation)

    def share(speed):
        return exact.sf(WORK / (1.0 + speed / CRITICAL))

    mean = scipy.integrate.quad(share, 10e-3, 50e-3)[0] / 40e-3
    found = expected(lens)
    # the trapezoidal rule over steps of 2 mm/s is off by their square over 12 times the largest curvature
    shares = [share(speed) for speed in np.linspace(10e-3, 50e-3, 2001)]
    curvature = np.max(np.abs(np.diff(shares, 2))) / 20e-6**2
    assert_allclose(found.masked_time, mean, rtol=0, atol=(2e-3) ** 2 / 12 * curvature)
    assert found.masked[0] < 1e-3 and found.masked[-1] > 0.999


def test_a_contact_under_tension_pulls_off_where_the_energy_leaves_too_little_work():
    pull = -0.1e-3
    lens = masking(CRITICAL, contact=Equilibrium(load=pull))
    law = StoredEnergy.of(lens)
    exact = scipy.stats.pearson3(law.skewness, law.mean, law.deviation)
    # pull-off at -3/2 pi w R
    needed = -pull / (1.5 * math.pi * RADIUS)
    left = WORK / 2.0
    found = expected(lens)
    # open and closed contacts are told apart between two of the 256 energies
    assert_allclose(found.lost, exact.sf(left - needed), atol=1.0 / 256)
    assert 0.05 < found.lost < 0.95 and found.masked == 0.0
    held = masking(CRITICAL, contact=Equilibrium(load=-pull))
    assert expected(held).lost == 0.0


@pytest.mark.parametrize("share", [1.0, 0.4, 0.0])
@pytest.mark.parametrize("load", [50e-3, 4e-3, 0.0, -0.1e-3])
def test_no_mechanism_takes_more_than_adhesion_holds_at_a_load(load, share):
    lens = scene(
        contact=Equilibrium(load=load),
        adhesion=Adhesion(work=WORK, bond_share=share),
        bonds=bonds.Unbroken(stress=30e3),
    )
    full = area(WORK, load)
    losses = largest_losses(lens)
    left = np.nan_to_num(area(WORK * (1.0 - share), load))
    assert_allclose(losses.bonds, 1.0 - left / full, rtol=1e-12, atol=1e-15)
    hertz = np.nan_to_num(area(0.0, load))
    assert_allclose(losses.waves, 1.0 - hertz / full, rtol=1e-12)
    radius = radius_at_load_reversible(load, WORK, 30e3, 1.0, RADIUS, MODULUS)
    stressed = np.nan_to_num(math.pi * radius**2)
    assert_allclose(losses.mean_stress, 1.0 - stressed / full, rtol=1e-12)
    assert (losses.waves == 1.0) == (load <= 0.0)


def test_the_largest_loss_at_an_indentation_is_that_to_the_sphere_that_cuts_the_plane():
    losses = largest_losses(scene(contact=CONTACTS["indentation"]))
    full = jkr.radius_at_indentation(2e-6, WORK, RADIUS, MODULUS)
    assert_allclose(losses.waves, 1.0 - RADIUS * 2e-6 / full**2, rtol=1e-12)
    assert np.all(largest_losses(scene(contact=CONTACTS["lifted"])).waves == 1.0)


def test_a_field_without_noise_masks_all_or_nothing():
    for rms, masked in ((1e5, 0.0), (3e5, 1.0)):
        field = shear.Mean(spectrum=SelfAffine(rms, 0.8, 50e-6, 50e-6, 1e-6))
        assert expected(masking(1e-3, shear=field)).masked == masked
        assert StoredEnergy.of(masking(1e-3, shear=field)).deviation == 0.0
