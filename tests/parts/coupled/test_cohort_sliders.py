"""Slider and bonds resolved by stretch, solved together, against renewal theory, Volterra's equation, closed forms."""

import functools
import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import driven
from helpers.driven import (
    AREA,
    ENERGY,
    STRETCH,
    UNIT,
    force,
    march,
    marched,
    residual,
    scenario,
    spring,
)
from numpy.testing import assert_allclose

from sim.laws.schallamach import Body
from sim.parts.bonds.models import Cohort
from sim.parts.bonds.rupture import Catch, Constant, CutOff
from sim.parts.shear import Mean
from sim.spectrum.families import BondMade

#: Way, share bound and force a site of a massless slider, from a collocation that agrees with itself to 5e-14.
MASSLESS = {
    1: (0.24906095818, 0.48098883322, 0.09501878084),
    2: (0.68088419038, 0.43430069113, 0.18638231619),
    3: (1.56682763855, 0.35697313147, 0.26866344723),
    4: (4.68048270968, 0.19621361549, 0.30639034581),
    5: (21.94669882582, 0.25170252458, 0.06106602348),
    6: (22.50223838418, 0.36122338140, 0.14995523232),
    8: (25.32320859919, 0.25646688168, 0.29353582802),
}


def cohorts(duration, steps, drive, tolerance, **keys):
    """A lens whose bonds are cohorts held to a tolerance."""
    return scenario(
        duration,
        steps,
        drive,
        make=functools.partial(Cohort, tolerance=tolerance),
        **keys,
    )


def reached(states):
    """Way of the slider, share bound and force a site over the area at rest, in the units of the bonds."""
    return np.array(
        [
            (
                state.drive.position[0] / STRETCH,
                0.5 * state.bonding.fraction[0],
                state.bonding.stress[0] * AREA / UNIT,
            )
            for state in states
        ]
    )


def off(states):
    """Largest errors of way, share and force of a massless slider."""
    found = reached([states[place] for place in MASSLESS])
    return np.max(np.abs(found - np.array(list(MASSLESS.values()))), axis=0)


def test_a_massless_slider_follows_its_reference_through_a_slip_from_the_static_peak_on():
    states, read = marched(cohorts(4.0, 8, spring(0.02, tolerance=1e-8), 1e-5))
    assert np.all(off(states) < 1e-6)
    assert_allclose(
        read["spring_force"],
        [state.bonding.stress[0] * AREA for state in states],
        rtol=1e-8,
        atol=1e-9,
    )
    assert residual(read) < 1e-7
    time = 1.92453394
    before, peak, after = (
        reached(
            marched(cohorts(time + late, 1, spring(0.02, tolerance=1e-8), 1e-6))[0][-1:]
        )[0, 2]
        for late in (-0.01, 0.0, 0.01)
    )
    assert_allclose(peak, 0.3102332895, rtol=1e-8)
    assert max(before, after) < peak


def test_the_missing_energy_of_a_body_that_lags_falls_with_the_tolerance():
    missing = []
    for tolerance in (1e-4, 1e-6, 1e-8):
        drive = spring(
            2.5e-4, 1000.0, mass=1e-6, contact=4e-3, viscosity=1e-6, tolerance=tolerance
        )
        _, read = marched(cohorts(1.8, 5, drive, 1e-4))
        assert read["dissipated_by_viscosity"][-1] > 0.1 * read["drive_work"][-1]
        missing.append(residual(read))
    assert np.all(np.array(missing) < 10.0 * np.array([1e-4, 1e-6, 1e-8]))
    assert missing[2] < missing[1] < missing[0]


def test_bonds_of_a_constant_rupture_rate_move_as_their_first_moment_does():
    every = {"contact": 0.2, "mass": 1e-3, "damping": 0.1, "viscosity": 0.03}
    for keys in (
        {},
        {"mass": 1e-3, "damping": 1e-3},
        {"viscosity": 0.1},
        {"contact": 0.2},
        every,
    ):
        # no closure: the first moment of such bonds is exact, and its slider is solved by another method
        clock, recipe = (1.0, 4), {"rupture": Constant(rate=1.0)}
        exact, _ = marched(
            scenario(*clock, spring(0.2, tolerance=1e-11, **keys), **recipe)
        )
        errors, missing = [], []
        for tolerance in (1e-5, 1e-8):
            states, read = marched(
                cohorts(
                    *clock,
                    spring(0.2, tolerance=tolerance, **keys),
                    tolerance,
                    **recipe,
                )
            )
            errors.append(np.max(np.abs(reached(states) - reached(exact))))
            missing.append(residual(read))
        assert missing[1] < 0.1 * missing[0] < 1e-5
        # a method of order 2, whose sub-steps each have an error of the tolerance
        assert (
            math.log(errors[0] / errors[1]) / math.log(1e-5 / 1e-8) > 0.95 * 2.0 / 3.0
        )


def test_the_field_that_bonds_make_needs_no_law_of_its_size_under_drives_that_feel_the_friction():
    # n E[f²]/(π² G b): 0.36312074 n (κ b)² in steady sliding at ten stretches a life; under a force n N κ² x², N x = Q
    unit = (
        driven.DENSITY
        * (driven.KAPPA * STRETCH) ** 2
        / (math.pi**2 * 0.25 * driven.MODULUS * 1e-9)
    )
    field = Mean(spectrum=BondMade(footprint=1e-9), paid_by_adhesion=0.0)
    sliding = cohorts(
        0.2, 2, spring(1.0, start="steady", damping=1e-3), 1e-6, start="steady"
    )
    states, _ = marched(replace(sliding, shear=field))
    assert_allclose(states[-1].shear.energy, 0.36312074 * unit, rtol=1e-5)
    creeping = cohorts(
        0.559773594776, 20, force(0.25, tolerance=1e-9), 1e-6, rebinding=1e-13
    )
    creeping = replace(creeping, shear=field)
    first = next(march(creeping, np.arange(1)))
    first.bonds.cohorts.weight[0, 0] = 0.5
    states = list(march(creeping, np.arange(1), first))
    for place, stretch in ((10, 0.858292500361), (18, 1.90289022829)):
        assert_allclose(
            states[place - 1].shear.energy, 0.25 * stretch * unit, rtol=1e-7
        )


#: Speed, stiffness of the spring at the onset of oscillations of bonds resolved by stretch at k_on = k0, frequency.
ONSETS = (
    (10.0, 0.0295565, 4.25784),
    (20.0, 0.0352161, 8.66919),
    (100.0, 0.02052, 36.2893),
)


def growth_at(speed, frequency, steps=240, share=0.0):
    """Growth rate and frequency of the mode of that frequency after a small jump of the speed, of a stiffness."""
    step = 2.0 * math.pi / frequency / 25.0

    def growth(stiffness):
        drive = spring(
            stiffness, driven.jolted(speed, step), start="steady", tolerance=1e-8
        )
        states, _ = marched(
            cohorts(steps * step, steps, drive, 1e-5, start="steady", share=share)
        )
        return driven.mode_of(reached(states)[steps // 3 :, 2], step, frequency, 4)

    return growth


@pytest.mark.parametrize(("speed", "stiffness", "frequency"), ONSETS[::2])
def test_disturbances_neither_grow_nor_fade_at_the_onset_alone(
    speed, stiffness, frequency
):
    driven.check_onset(growth_at(speed, frequency), stiffness, frequency, rtol=1e-3)


@pytest.mark.verify
@pytest.mark.parametrize(
    ("distance", "duration", "expected"), [(0.06, 300.0, 1.7165), (0.03, 500.0, 1.7672)]
)
def test_oscillations_of_stretches_that_differ_set_in_gradually_where_those_of_the_mean_do_suddenly(
    distance, duration, expected
):
    speed, stiffness, frequency = ONSETS[0]
    step = 2.0 * math.pi / frequency / 40.0
    jolt = {
        "time": (0.0, step, step, 2.0 * step, 2.0 * step, duration),
        "value": tuple(speed * STRETCH * v for v in (1.0, 1.0, 10.0, 10.0, 1.0, 1.0)),
    }
    steps = int(duration / step)
    drive = spring((1.0 - distance) * stiffness, jolt, start="steady", tolerance=1e-6)
    found = reached(
        marched(cohorts(steps * step, steps, drive, 1e-4, start="steady"))[0]
    )[:, 2]
    swing = 0.5 * np.ptp(found[-steps // 4 :]) / found[0] / distance**0.5
    # the records lie up to an eightieth of a period beside the extremes
    assert_allclose(swing, expected, rtol=0.5 * (math.pi / 40.0) ** 2)


def test_an_area_that_follows_the_bonds_raises_the_onset_as_linear_stability_has_it():
    scene = cohorts(1.0, 4, spring(1.0), 1e-9, share=0.5)
    bound = scene.bonds.steady(np.full(1, 10.0 * STRETCH)).fraction[0]
    works = scene.adhesion.work_of_bonds(bound * np.array([0.999, 1.0, 1.001]))
    less, area, more = (
        np.pi * scene.contact.equilibrium_radius(works, scene.bodies) ** 2
    )
    onset = scene.bonds.onset(
        np.full(1, 10.0 * STRETCH), Body(area, (more - less) / 2e-3 / area)
    )
    stiffness, frequency = onset.stiffness[0] / driven.STIFF, onset.frequency[0]
    assert stiffness > 1.2 * 0.0295565 * area / AREA
    driven.check_onset(
        growth_at(10.0, frequency, share=0.5), stiffness, frequency, rtol=1e-3
    )


def test_a_force_makes_creep_at_the_speed_of_steady_sliding_and_above_all_steady_bonds_a_runaway():
    # 0.16660872 a site is the friction at a speed of 1 stretch a mean life
    states, read = marched(cohorts(40.0, 4, force(0.16660871, tolerance=1e-6), 1e-6))
    assert_allclose(states[-1].drive.speed / STRETCH, 1.0, rtol=1e-5)
    assert_allclose(reached(states[-1:])[0, 1], 0.37356992, rtol=1e-5)
    assert np.isnan(read["runaway_time"]).all()
    for load, runs in ((0.99 * 0.218485, False), (1.05 * 0.218485, True)):
        _, read = marched(cohorts(60.0, 2, force(load, tolerance=1e-5), 1e-5))
        assert np.isfinite(read["runaway_time"][-1]) == runs


def test_bonds_that_only_a_stretch_breaks_snap_together_unless_something_delays_the_slip():
    # all unstretched at first, they bear n κ ℓ and break together: theirs is ½ n κ ℓ², what the spring has the snap's
    cut = CutOff(stretch=3.0 * STRETCH)
    states, read = marched(
        cohorts(20.0, 40, spring(0.02, 10.0), 1e-4, rupture=cut, rebinding=1e-9)
    )
    force = reached(states)[:, 2]
    falls = 3.0 * 1.02 / 0.02 / 10.0
    held = np.linspace(0.0, 20.0, 41) < falls
    assert_allclose(
        force[held], 10.0 * 0.02 / 1.02 * np.linspace(0.0, 20.0, 41)[held], rtol=1e-6
    )
    assert np.all(force[~held] < 1e-6)
    assert_allclose(
        read["dissipated_by_snaps"][-1] / ENERGY, 0.5 * 9.0 / 0.02, rtol=1e-6
    )
    assert_allclose(read["dissipated_by_rupture"][-1] / ENERGY, 0.5 * 9.0, rtol=1e-6)
    assert residual(read) < 1e-9
    for delay in ["damping", "viscosity"]:
        # (K + 1) X + c X' = K V t until X is the stretch at which they break; then the spring relaxes to c V
        stiffness, speed, slow, most = 0.02, 10.0, 0.1, 3.0
        drive = spring(stiffness, speed, tolerance=1e-8, **{delay: slow})
        _, read = marched(
            cohorts(
                20.0,
                40,
                drive,
                1e-4,
                rupture=CutOff(stretch=most * STRETCH),
                rebinding=1e-9,
            )
        )
        times, rate = np.linspace(0.0, 20.0, 41), (stiffness + 1.0) / slow
        way = (
            stiffness
            * speed
            / (stiffness + 1.0)
            * (times + np.expm1(-rate * times) / rate)
        )
        broken = most * (stiffness + 1.0) / stiffness / speed + 1.0 / rate
        fades = np.exp(-stiffness / slow * (times - broken))
        relaxed = (
            slow * speed + (stiffness * (speed * broken - most) - slow * speed) * fades
        )
        force = np.where(times < broken, stiffness * (speed * times - way), relaxed)
        assert_allclose(read["spring_force"] / UNIT, force, rtol=1e-6, atol=1e-9)
        assert_allclose(
            read["dissipated_by_rupture"][-1] / ENERGY, 0.5 * most**2, rtol=1e-6
        )
        assert residual(read) < 1e-7


def test_bonds_of_many_stretches_snap_again_and_again_and_catch_bonds_feel_a_drive():
    cut = CutOff(stretch=STRETCH)
    for stiffness, speed, often in (
        (0.05, 1.0, True),
        (0.05, 2.0, True),
        (20.0, 1.0, False),
    ):
        _, read = marched(
            cohorts(200.0, 50, spring(stiffness, speed), 1e-4, rupture=cut)
        )
        assert (
            np.sum(np.diff(read["dissipated_by_snaps"]) > 1e-6 * read["drive_work"][-1])
            > 5
        ) == often
        assert residual(read) < 1e-6
    catch = Catch(
        catch_rate=1.0,
        catch_force=STRETCH * 4e-4,
        slip_rate=0.2,
        slip_force=STRETCH * 4e-4,
    )
    states, read = marched(cohorts(4.0, 8, spring(0.02), 1e-5, rupture=catch))
    assert residual(read) < 1e-5
    assert np.all(np.diff(reached(states)[:4, 2]) > 0.0)
