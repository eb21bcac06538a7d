"""Each depth becomes its shallower neighbour in the limit that it names."""

import math

import numpy as np
from numpy.testing import assert_allclose
from scenes import CELL, SPECTRUM, scene

from sim.engine import march
from sim.laws import jkr
from sim.memory import Onset, Slip, Wave
from sim.parts import bonds, drive, shear
from sim.parts.contact import Equilibrium
from sim.scenario import Record
from sim.spectrum import Gaussian

RAMP = drive.Ramp(start=1e-4, stop=3e-2, scale="log")


def last(members=1, **parts):
    *_, state = march(scene(members, **({"drive": RAMP} | parts)), np.arange(members))
    return state


def test_steady_bonds_become_unbroken_as_the_critical_speed_grows():
    for factor in (1e3, 1e6, 1e12):
        fraction = last(bonds=bonds.Steady(critical_speed=3e-2 * factor)).bonds.bound
        assert_allclose(fraction, 1.0, rtol=1.0 / factor + 4e-16, atol=0)
    assert_allclose(fraction, last(bonds=bonds.Unbroken()).bonds.bound, rtol=1.1e-12)


def test_the_rate_equation_becomes_the_steady_law_as_healing_grows():
    # on the step's mean speed; the law at that speed is reached to the last digit
    steady = last(bonds=bonds.Steady(critical_speed=1e-2), drive=drive.Steady(speed=7e-3))
    for healing in (1e5, 1e9, 1e15):
        rate = bonds.Rate(critical_speed=1e-2, healing=healing, start_from="empty")
        found = last(bonds=rate, drive=drive.Steady(speed=7e-3))
        assert_allclose(found.bonds.bound, steady.bonds.bound, rtol=1e-14)


def test_counted_bonds_become_the_rate_equation_as_their_number_grows():
    recipe = {"critical_speed": 1e-2, "healing": 300.0, "start_from": "bonded"}
    exact = last(bonds=bonds.Rate(**recipe)).bonds.bound
    for sites in (10**2, 10**4, 10**6):
        fraction = last(400, bonds=bonds.Counted(**recipe, sites=sites)).bonds.bound / sites
        spread = np.sqrt(exact * (1.0 - exact) / sites)
        assert abs(fraction.mean() - exact) < 5.0 * spread / np.sqrt(400)
        assert abs(fraction.std() / spread - 1.0) < 5.0 / np.sqrt(2 * 400)


def test_mean_fluctuations_become_uniform_as_their_rms_vanishes():
    recipe = {"growth": Onset(speed=2e-3, width=0.3)}
    sizes = [last(shear=shear.Mean(spectrum=Gaussian(rms=rms, length=1e-5), **recipe)) for rms in (1e3, 1e1, 1e-1)]
    energies = np.array([state.shear.energy[0] for state in sizes])
    assert_allclose(energies[:-1] / energies[1:], 1e4, rtol=1e-12)
    assert_allclose(sizes[-1].contact.radius, last(shear=shear.Uniform()).contact.radius, rtol=1e-9)


def test_modal_fluctuations_become_the_mean_as_the_cell_grows():
    # a spectrum smooth through q = 0: the cell lacks 0.23278 C(0)/(G L), and its spread falls with the cell
    spectrum, shear_modulus = Gaussian(rms=1e5, length=1e-5), 1.6e6
    infinite = spectrum.surface_energy(shear_modulus)
    deficits, spreads = [], []
    for side in (2e-4, 4e-4, 8e-4):
        part = shear.Modal(spectrum=spectrum, cell=side, points=round(side / 3e-6), memory=Slip(length=1e-6))
        errors = scene(shear=part).process.known_errors()
        deficits.append(-errors["cell_error_energy"])
        spreads.append(errors["realization_spread_energy"])
        assert_allclose(deficits[-1], 0.2327799 * spectrum.density(0.0, 0.0) / (1.6e6 * side) / infinite, rtol=0.02)
    assert_allclose(np.divide(deficits[:-1], deficits[1:]), 2.0, rtol=0.02)
    assert np.all(np.diff(spreads) < 0.0)


def test_the_ensemble_mean_of_modal_energies_is_the_cells_own():
    part = shear.Modal(spectrum=SPECTRUM, cell=CELL, memory=Slip(length=5e-6))
    members = 2000
    state = last(members, shear=part)
    pairs = scene(shear=part).process.modes.energies(1.6e6)
    assert abs(state.shear.energy.mean() - pairs.sum()) < 5.0 * np.sqrt(np.sum(pairs**2) / members)


def test_banded_fluctuations_become_modal_as_the_tolerance_falls():
    # every cumulant tends to that of the sum over modes; the first two are exact at any tolerance
    recipe = {"spectrum": SPECTRUM, "cell": CELL, "memory": Wave(waves=2.0)}
    pairs = scene(shear=shear.Modal(**recipe)).process.modes.energies(1.6e6)
    exact = np.array([math.factorial(n - 1) * np.sum(pairs**n) for n in range(1, 7)])
    before = np.full(4, np.inf)
    for tolerance in (0.5, 0.1, 0.02, 0.004):
        bands = scene(shear=shear.Banded(**recipe, tolerance=tolerance)).process.bands
        found = [
            math.factorial(n - 1) * 0.5 * np.sum(bands.weight**n * bands.freedom) for n in range(1, 7)
        ]  # of ½ weight × chi-square
        errors = np.abs(found / exact - 1.0)
        assert np.all(errors[:2] < 1e-13)
        assert np.all(errors[2:4] <= tolerance)
        assert np.all(errors[2:] < before)
        before = errors[2:]


def test_auto_is_the_depth_that_it_chooses():
    recipe = {"spectrum": SPECTRUM, "cell": CELL, "memory": Slip(length=5e-6)}
    for auto, chosen in (
        (shear.Auto(spectrum=SPECTRUM), shear.Mean(spectrum=SPECTRUM)),
        (shear.Auto(**recipe), shear.Banded(**recipe)),
    ):
        assert scene(shear=auto).fluctuations == chosen
        assert np.array_equal(last(3, shear=auto).shear.energy, last(3, shear=chosen).shear.energy)
    maps = Record(maps=(2e-3,))
    assert scene(shear=shear.Auto(**recipe), record=maps).fluctuations == shear.Mapped(**recipe)
    assert scene(shear=shear.Auto(**recipe), record=maps).process.modes.points > 2


def test_modal_with_fixed_amplitudes_is_the_mean_with_the_cells_error():
    growth = Onset(speed=2e-3, width=0.3)
    part = shear.Modal(spectrum=SPECTRUM, cell=CELL, memory=Slip(length=5e-6), growth=growth, amplitudes="fixed")
    error = scene(shear=part).process.known_errors()["cell_error_energy"]
    mean = last(shear=shear.Mean(spectrum=SPECTRUM, growth=growth)).shear.energy
    assert_allclose(last(shear=part).shear.energy, mean * (1.0 + error), rtol=1e-12)


def test_energy_that_adhesion_does_not_pay_leaves_jkr_bit_for_bit():
    part = shear.Modal(spectrum=SPECTRUM, cell=CELL, memory=Slip(length=5e-6), paid_by_adhesion=0.0)
    found = last(4, shear=part).contact.radius
    assert np.array_equal(found, np.full(4, jkr.radius_at_load(4e-3, 42e-3, 2e-3, 6.4e6)))


def test_a_uniform_stress_of_any_size_changes_nothing():
    radii = [last(bonds=bonds.Unbroken(stress=stress)).contact.radius[0] for stress in (0.0, 1e3, 1e9)]
    assert radii[0] == radii[1] == radii[2] == jkr.radius_at_load(4e-3, 42e-3, 2e-3, 6.4e6)


def test_a_contact_at_the_indentation_of_a_load_is_the_contact_at_that_load():
    for load in (-0.35e-3, 0.0, 4e-3):
        at_load = last(contact=Equilibrium(load=load)).contact.radius
        depth = Equilibrium(load=load).depth(at_load, 2e-3, 6.4e6)[0]
        at_depth = Equilibrium(indentation=depth)
        radius = last(contact=at_depth).contact.radius
        assert_allclose(radius, at_load, rtol=1e-11)
        assert_allclose(at_depth.normal_load(radius, 2e-3, 6.4e6), load, rtol=1e-10, atol=1e-14)


def test_a_masked_contact_is_hertz():
    part = shear.Mean(spectrum=Gaussian(rms=1e6, length=1e-5))
    state = last(shear=part)
    assert state.contact.work[0] < 0.0
    assert_allclose(state.contact.radius, (3 * 4e-3 * 2e-3 / (4 * 6.4e6)) ** (1 / 3), rtol=1e-14)
