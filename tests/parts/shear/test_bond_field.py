"""The field that bonds make: its spectrum, its energy, what of it is frozen and what is forgotten."""

import itertools
import math

import numpy as np
import pytest
from helpers.fields import complex_amplitudes
from helpers.scenes import advanced
from numpy.testing import assert_allclose
from scipy.integrate import quad

from sim.laws.halfspace import surface_energy
from sim.numerics.noise import Noise
from sim.parts.exchange import Bonding, Motion
from sim.parts.shear.modes import SiteMean, SiteModes, modes
from sim.parts.shear.process import Constant, Time
from sim.solid import HalfSpace
from sim.spectrum.families import BondMade

B, G, CELL, POINTS = 1e-6, 1.6e6, 24e-6, 32
#: So many members in `make test`, and in `make verify`; bounds are five derived standard errors of either.
MEMBERS = [500, pytest.param(4000, marks=pytest.mark.verify)]
SPECTRUM = BondMade(footprint=B)


def moved(step, duration=0.0):
    still = np.zeros(1)
    return Motion(step, 0.0, duration, still, still, still, still)


def bonding(mean, spread):
    """Bonds of 1 site per m², mean force and its standard deviation [N]."""
    known = {"frozen": np.array([mean**2]), "varying": np.array([spread**2])}
    return Bonding(np.ones(1), np.array([mean]), np.array([abs(mean)]), **known)


def process():
    return SiteModes(
        modes(SPECTRUM, CELL, POINTS), HalfSpace(G), Time(time=1.0), Constant()
    )


def test_energy_variance_map_and_sign_of_the_field_of_discs():
    for poisson_ratio in [0.5, 0.3]:
        # the half-space's compliance under each bond: twice the energy of one disc of unit force
        exact = (2.0 - poisson_ratio) / (1.5 * math.pi**2 * G * B)
        assert_allclose(
            HalfSpace(G, poisson_ratio, coupling=0.0).stored_energy(SPECTRUM),
            exact,
            rtol=1e-14,
        )
        if poisson_ratio == 0.5:
            assert_allclose(exact, 1.0 / (math.pi**2 * G * B), rtol=1e-15)
    edges = np.linspace(0.0, 400.0, 801) / B
    radial = sum(
        quad(lambda q: q * SPECTRUM.radial_density(q), a, b)[0]
        for a, b in itertools.pairwise(edges)
    )
    assert_allclose(radial / (2 * math.pi), SPECTRUM.cumulative(edges[-1]), rtol=1e-9)
    line = sum(
        quad(SPECTRUM.radial_density, a, b)[0] for a, b in itertools.pairwise(edges)
    )
    # the tail beyond falls as 1/q²: 4/(pi x²) / 2 at x = 400
    assert_allclose(line, SPECTRUM.line_integral, rtol=1e-4)
    q = np.geomspace(1e-6, 1e3, 200) / B
    assert_allclose(
        SPECTRUM.cumulative(q) + SPECTRUM.beyond(q), SPECTRUM.variance, rtol=1e-14
    )
    slope = (SPECTRUM.cumulative(q * 1.0001) - SPECTRUM.cumulative(q / 1.0001)) / (
        q * (1.0001 - 1 / 1.0001)
    )
    low = q * B < 1.0
    assert_allclose(
        slope[low], (q * SPECTRUM.radial_density(q) / (2 * math.pi))[low], rtol=1e-6
    )
    state = SiteMean(HalfSpace(G).stored_energy(SPECTRUM), Constant()).start(
        moved(0), bonding(3.0, 2.0), None
    )
    assert_allclose(state.energy, 13.0 / (math.pi**2 * G * B), rtol=1e-14)
    field, noise = process(), Noise(2, "shear", np.arange(3))
    first = field.start(moved(0), bonding(0.8, 0.0), noise)
    back = advanced(field, first, moved(1, 1.0), bonding(-0.8, 0.0), noise)
    assert_allclose(
        complex_amplitudes(field, back), -complex_amplitudes(field, first), rtol=1e-14
    )
    field, noise = process(), Noise(3, "shear", np.arange(2))
    state = field.start(moved(0), bonding(0.8, 0.6), noise)
    maps = field.maps(state, np.zeros(1), 2)
    assert_allclose(
        [surface_energy(field_map, CELL, G) for field_map in maps],
        state.energy,
        rtol=1e-12,
    )


@pytest.mark.parametrize("members", MEMBERS)
def test_the_modes_hold_the_energy_of_frozen_and_varying_forces(members):
    field, noise = process(), Noise(1, "shear", np.arange(members))
    for forces in (bonding(1.0, 0.0), bonding(0.0, 1.0), bonding(-0.8, 0.6)):
        state = field.start(moved(0), forces, noise)
        for step in range(1, 4):
            state = advanced(field, state, moved(step, 0.7), forces, noise)
        error = 2.0 * math.sqrt(np.sum(field.weights**2) / members)
        assert abs(state.energy.mean() - 2.0 * np.sum(field.weights)) < 5.0 * error


@pytest.mark.parametrize("members", MEMBERS)
def test_forces_that_differ_are_forgotten_and_the_pattern_of_the_mean_force_is_not(
    members,
):
    # correlation of the amplitudes over one correlation time: (f² + Var e^-1)/(f² + Var), f² = 0.64, Var = 0.36
    field, noise = process(), Noise(2, "shear", np.arange(members))
    carried = bonding(-0.8, 0.6)
    first = field.start(moved(0), carried, noise)
    then = advanced(field, first, moved(1, 1.0), carried, noise)
    before, after = (complex_amplitudes(field, state) for state in (first, then))
    correlation = np.real(np.mean(before * after.conj())) / np.mean(np.abs(before) ** 2)
    assert abs(correlation - (0.64 + 0.36 * math.exp(-1.0))) < 5.0 / math.sqrt(
        before.size
    )
