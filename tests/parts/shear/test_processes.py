"""Fluctuations: stationarity, correlation, amplitude, and the energy of their own map."""

from itertools import product

import numpy as np
import pytest
from helpers.fields import complex_amplitudes
from helpers.scenes import (
    CELL,
    ON_CELL,
    SPECTRUM,
    Clock,
    Equilibrium,
    Ripple,
    bonds,
    drive,
    march,
    scene,
    shear,
)
from numpy.testing import assert_allclose

from sim.laws import halfspace
from sim.parts.shear.process import Constant, Diffusion, Onset, Slip, Stress, Time, Wave
from sim.scenario.scenario import Record
from sim.solid import HalfSpace

G = 1.6e6
MEMORIES = {
    "time": Time(time=1e-3),
    "slip": Slip(length=2e-6),
    "wave": Wave(waves=0.025),
    "diffusion": Diffusion(diffusivity=1e-7),
}


def states(part, members, clock, motion=None):
    motion = motion or drive.Steady(speed=2e-3)
    scenario = scene(
        shear=part, drive=motion, bonds=bonds.Unbroken(stress=2e5), clock=clock
    )
    return scenario, list(march(scenario, np.arange(members)))


def energies(*arguments):
    scenario, course = states(*arguments)
    return scenario.process, np.array([state.shear.energy for state in course])


def test_modes_are_stationary_for_any_step_and_forget_with_twice_the_rate_of_the_amplitudes():
    for ratio, name in product([1e-6, 1e-3, 1.0, 1e3, 1e6], MEMORIES):
        step, members = ratio * 1e-3, 400
        part = shear.Modal(spectrum=SPECTRUM, cell=CELL, correlation=MEMORIES[name])
        process, energy = energies(part, members, Clock(duration=4 * step, step=step))
        pairs = process.modes.energies(HalfSpace(G))
        assert np.all(
            np.abs(energy.mean(axis=1) - pairs.sum())
            < 5.0 * np.sqrt(np.sum(pairs**2) / members)
        )
        # the relative error of a variance of these sums of exponentials is below sqrt((kurtosis - 1)/members)
        assert np.all(
            np.abs(energy.var(axis=1) / np.sum(pairs**2) - 1.0)
            < 5.0 * np.sqrt(8.0 / members)
        )
    for name in MEMORIES:
        members, step = 4000, 0.4e-3
        part = shear.Modal(spectrum=SPECTRUM, cell=CELL, correlation=MEMORIES[name])
        process, energy = energies(part, members, Clock(duration=2 * step, step=step))
        pairs = process.modes.energies(HalfSpace(G))
        rates = {
            "time": 1e3 * np.ones_like(process.wavenumber),
            "slip": 2e-3 / 2e-6 * np.ones_like(process.wavenumber),
            "wave": 2e-3 * process.wavenumber / (2 * np.pi * 0.025),
            "diffusion": 1e-7 * process.wavenumber**2,
        }[name]
        for lag in (1, 2):
            expected = np.sum(pairs**2 * np.exp(-2.0 * rates * lag * step))
            products = (energy[0] - pairs.sum()) * (energy[lag] - pairs.sum())
            assert abs(products.mean() - expected) < 5.0 * products.std() / np.sqrt(
                members
            )


def test_a_contact_at_rest_keeps_its_pattern_and_the_floor_of_its_amplitude():
    part = shear.Mapped(spectrum=SPECTRUM, cell=CELL, correlation=Slip(length=1e-6))
    scenario, course = states(
        part, 2, Clock(duration=3e-3, step=1e-3), drive.Steady(speed=0.0)
    )
    first, last = (
        scenario.process.maps(s.shear, s.drive.position, 2)
        for s in (course[0], course[-1])
    )
    assert np.array_equal(first, last)
    for amplitude, floor in (
        (Onset(speed=1e-3, width=0.3, floor=0.05), 0.05),
        (Constant(), 1.0),
    ):
        assert_allclose(amplitude.factor(np.zeros(1), np.zeros(1)), floor, rtol=1e-15)
    assert Stress(reference=1e5).factor(np.zeros(1), np.zeros(1)) == 0.0


def test_recorded_maps_on_a_grid_with_a_large_prime_factor_are_remarked_with_the_next_good_size():
    for points, maps, expected in (
        (106, (1e-3,), 108),
        (106, (), 0),
        (104, (1e-3,), 0),
    ):
        part = shear.Mapped(**ON_CELL, points=points, correlation=Slip(length=3e-6))
        remarks = [
            text
            for text in scene(shear=part, record=Record(maps=maps)).remarks()
            if "prime" in text
        ]
        assert [text.rpartition(" ")[2] for text in remarks] == [str(expected)] * bool(
            expected
        )


def test_a_map_is_the_sum_of_its_waves_and_stores_the_energy_of_the_modes_by_the_greens_function():
    for points in (12, 13):
        recipe = {
            "correlation": Slip(length=3e-6),
            "amplitude": Onset(speed=2e-3, width=0.3),
        }
        part = shear.Mapped(**ON_CELL, **recipe, points=points)
        scenario, course = states(
            part, 2, Clock(duration=4e-3, step=1e-3), drive.Ramp(start=1e-3, stop=5e-3)
        )
        process, position = scenario.process, np.array([0.37, -5.3]) * CELL
        x = np.arange(points) * CELL / points
        for state in course:
            turned = complex_amplitudes(process, state.shear) * np.exp(
                -1j * position[:, np.newaxis] * process.modes.qx
            )
            along, across = (
                np.exp(1j * np.multiply.outer(q, x))
                for q in (process.modes.qx, process.modes.qy)
            )
            expected = 2.0 * np.einsum("mk,kx,ky->mxy", turned, along, across).real
            maps = process.maps(state.shear, position, 2)
            assert_allclose(maps, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
            stored = halfspace.surface_energy(maps, CELL, G)
            assert_allclose(stored, np.broadcast_to(state.shear.energy, 2), rtol=1e-12)
            displacement = halfspace.displacement(maps, CELL, G)
            assert_allclose(
                0.5 * np.mean(maps * displacement, axis=(1, 2)), stored, rtol=1e-12
            )
    recipe = {
        "spectrum": SPECTRUM,
        "cell": CELL,
        "points": 12,
        "correlation": Slip(length=3e-6),
    }
    clock = Clock(duration=5e-3, step=1e-3)
    _, modal = energies(shear.Modal(**recipe), 3, clock)
    _, mapped = energies(shear.Mapped(**recipe), 3, clock)
    assert np.array_equal(modal, mapped)


def test_the_mode_of_a_ripple_stores_the_papers_energy_in_the_mean():
    wavelength, amplitude = 24e-6, 375.158e3
    for angle, share in ((0.0, 1.0), (np.pi / 2, 2.0)):
        ripple = Ripple(amplitude=amplitude, wavelength=wavelength, angle=angle)
        part = shear.Modal(spectrum=ripple, correlation=Slip(length=1e-6))
        exact = share * amplitude**2 * wavelength / (16.0 * np.pi * G)
        assert_allclose(part.process(HalfSpace(G), CELL).mean, exact, rtol=1e-12)


@pytest.mark.parametrize(
    "angle", [0.0, np.pi - 1e-10, np.pi + 1e-10, -1e-10, 6.283185307]
)
def test_a_map_shows_a_ripple_along_the_sliding_whatever_the_rounding_of_its_angle(
    angle,
):
    ripple = Ripple(amplitude=1e5, wavelength=CELL / 10.0, angle=angle)
    part = shear.Mapped(
        spectrum=ripple,
        cell=CELL,
        points=32,
        correlation=Slip(length=1e-6),
    )
    scenario, course = states(part, 1, Clock(duration=1e-3, step=1e-3))
    (pattern,) = scenario.process.maps(course[-1].shear, np.zeros(1), 1)
    size = np.abs(complex_amplitudes(scenario.process, course[-1].shear)).item()
    assert_allclose(pattern.std(), np.sqrt(2.0) * size, rtol=1e-12)


def test_relaxing_amplitude_follows_the_exact_second_moment():
    # with g constant after a jump of the speed, the mean energy relaxes as 1 + (g^2 - 1) (1 - exp(-2 t/t_m))
    onset = Onset(speed=1e-3, width=0.05, floor=0.5, relaxing=True)
    part = shear.Modal(**ON_CELL, correlation=Time(time=1e-3), amplitude=onset)
    motion = drive.Table(
        time=(0.0, 0.5e-3, 0.5e-3, 2.5e-3), speed=(1e-5, 1e-5, 1.0, 1.0)
    )
    members, step = 3000, 0.5e-3
    process, energy = energies(
        part, members, Clock(duration=5 * step, step=step), motion
    )
    pairs = process.modes.energies(HalfSpace(G))
    expected = [0.25, 0.25]
    for _ in range(4):  # a jump at a clock time is seen exactly, whatever the step
        expected.append(1.0 + (expected[-1] - 1.0) * np.exp(-2.0 * step / 1e-3))
    error = np.sqrt(np.sum(pairs**2) / members)
    assert np.all(
        np.abs(energy.mean(axis=1) - np.array(expected) * pairs.sum()) < 5.0 * error
    )


def test_depths_that_do_not_go_together_are_refused():
    timed = {"spectrum": SPECTRUM, "cell": CELL, "correlation": Time(time=1.0)}
    ripple = timed | {"spectrum": Ripple(amplitude=1.0, wavelength=25e-6)}
    for make, cure in (
        (
            lambda: shear.Mean(
                spectrum=SPECTRUM, amplitude=Onset(speed=1.0, width=1.0, relaxing=True)
            ),
            "modal",
        ),
        (
            lambda: scene(shear=shear.Mapped(**ripple, points=64)),
            "whole number of wavelengths",
        ),
        (
            lambda: scene(
                shear=shear.Mapped(**timed, points=12, contact="disc"),
                contact=Equilibrium(load=-1.0),
            ),
            r'shear\.contact: .*no contact at rest.*\[contact\].*"plane"',
        ),
        (
            lambda: scene(
                shear=shear.Modal(**timed, amplitude=Stress(reference=1.0)),
                bonds=bonds.Unbroken(),
            ),
            "stress",
        ),
    ):
        with pytest.raises(ValueError, match=cure):
            make()
