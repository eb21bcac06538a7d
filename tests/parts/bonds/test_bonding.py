"""What all bonds hand on: the sign of the friction, its slope over slip, and states that stay good."""

from copy import deepcopy
from itertools import product

import numpy as np
from helpers.scenes import (
    BELL,
    BONDS,
    CONTACTS,
    CUT_OFF,
    SHEARS,
    STRETCHED,
    drive,
    march,
    one_step,
    records,
    scene,
)
from numpy.testing import assert_allclose, assert_array_equal

from sim.numerics.noise import Noise
from sim.parts.bonds import models as bonds

MOTIONS = {
    "through zero": ((0.0, 16e-3), (-1e-3, 5e-3)),
    "forth and back": (
        (0.0, 4e-3, 4e-3, 8e-3, 8e-3, 12e-3, 12e-3, 16e-3),
        2 * (2e-3, 2e-3, -2e-3, -2e-3),
    ),
    "started": ((0.0, 3e-3, 3e-3, 16e-3), (0.0, 0.0, 4e-3, 4e-3)),
    "stopped": ((0.0, 4e-3, 4e-3, 16e-3), (3e-3, 3e-3, 0.0, 0.0)),
}


def motion(name, sense=1.0):
    time, speed = MOTIONS[name]
    return drive.Table(time=time, speed=tuple(sense * value for value in speed))


def recorded(names, members=3, steps=16, **parts):
    return records(scene(members, steps, **parts), *names)


def test_friction_is_odd_and_takes_work_and_energies_are_even_in_the_speed():
    parts = {
        "shear": SHEARS["modal, wave, relaxing stress"],
        "contact": CONTACTS["partly reversible"],
    }
    signs = dict.fromkeys(["shear_stress", "friction_force"], -1.0)
    signs |= dict.fromkeys(
        ["bond_fraction", "fluctuation_energy", "contact_radius"], 1.0
    )
    for name, part in product(MOTIONS, BONDS.values()):
        forward, mirrored = (
            recorded(signs, bonds=part, drive=motion(name, sense), **parts)
            for sense in (1.0, -1.0)
        )
        assert np.any(forward[0] != 0.0)
        # mirrored arithmetic is the same, but cohorts are merged on a lattice that starts elsewhere
        off = part.tolerance if part.model == "cohort" else 1e-11
        for sign, there, back in zip(signs.values(), forward, mirrored, strict=True):
            assert_allclose(
                back, sign * there, rtol=1e-11, atol=off * np.abs(there).max()
            )
    for part in BONDS.values():
        # the trapezoidal sum over the second cycle; 200 members where bonds are counted or tracked
        members = 200 if part.model in ("counted", "tracked", "auto") else 1
        names = ["friction_force", "slider_position"]
        force, position = recorded(
            names, members, bonds=part, drive=motion("forth and back")
        )
        assert_allclose(position[16], position[8], atol=1e-18)
        assert np.trapezoid(force[8:].mean(axis=1), position[8:, 0]) > 0.0


def test_bonds_without_a_stretch_bear_the_sign_of_the_last_slip_and_all_that_of_a_steady_speed():
    def signs(part, motion, steps=16):
        stress, speed = recorded(
            ["shear_stress", "speed"], 1, steps, bonds=part, drive=motion
        )
        return np.sign(stress[:, 0]).astype(int).tolist(), speed[:, 0]

    for part in (BONDS[name] for name in ("none", "steady", "rate", "counted")):
        assert signs(part, drive.Steady(speed=0.0))[0] == [0] * 17  # nothing has slid
        # at t = 0 that of the speed at the start
        assert signs(part, drive.Steady(speed=-1e-3))[0] == [-1] * 17
        assert signs(part, motion("started"), 8)[0] == [0, 0, 0, 0, 1, 1, 1, 1, 1]
        # it keeps the sign at rest
        assert signs(part, motion("stopped"), 8)[0] == [1] * 9
        turned, speed = signs(part, motion("through zero"), 8)
        assert (
            turned == np.sign(np.where(speed == 0.0, -1.0, speed)).astype(int).tolist()
        )
        # a step that ends at rest: the sign of its slip
        halting = drive.Table(
            time=(0.0, 1e-3, 1e-3, 2e-3), speed=(3e-3, 3e-3, -3e-3, 0.0)
        )
        assert signs(part, halting, 2)[0] == [1, 1, -1]
    speeds = np.array([-2e-3, 0.0, 2e-3])
    for part in (
        BONDS[name]
        for name in (
            "none",
            "steady",
            "rate",
            "counted",
            "rate, bell",
            "cohort",
            "tracked",
        )
    ):
        result = part.steady(speeds)
        assert_array_equal(np.sign(result.stress), [-1.0, 0.0, 1.0])
        assert_allclose(result.strength * np.sign(speeds), result.stress, rtol=1e-15)
        assert np.all(result.strength >= 0.0)
    # at rest they bear up to their strength
    assert bonds.Unbroken(stress=2e5).steady(speeds[1:2]).strength == 2e5


def rate_of_stress(name, speed, slip, duration):
    """Bonding in steady sliding, and the change of its stress in one more step."""
    scenario = scene(3, 40, bonds=BONDS[name], drive=drive.Steady(speed=speed))
    *_, state = march(scenario, np.arange(3))
    slip = np.full(1, slip)
    motions = one_step(
        41, 41e-3, duration, slip, np.abs(slip), slip / duration, slip / duration
    )
    noise = Noise(5, "bonds", np.arange(3))
    after = scenario.population.advance(
        deepcopy(state.bonds), motions, state.contact.radius, noise
    )[1].at(0)
    return state.bonding, after.stress - state.bonding.stress


def test_stiffness_and_relaxation_are_the_slopes_of_the_stress_less_what_breaks_at_a_cut_off():
    for name, speed in product(
        [name for name in BONDS if name not in ("steady", "cohort, cut-off")],
        [4e-3, -4e-3],
    ):
        # 0.1 nm within 1 as: rounding of the difference and the curvature over 1e-10/20e-6 of the cut-off
        slip = np.copysign(1e-10, speed)
        bonding, change = rate_of_stress(name, speed, slip, 1e-18)
        assert_allclose(
            np.broadcast_to(bonding.stiffness, change.shape), change / slip, rtol=3e-5
        )
    for name in [
        "rate, bell",
        "rate, cut-off, carried",
        "cohort",
        "cohort, cut-off",
        "cohort, carried",
    ]:
        # 1 ns: of the lives that rupture leaves, some 1e-6 pass, and rounding of the difference is below 1e-10
        bonding, change = rate_of_stress(name, 4e-3, 0.0, 1e-9)
        assert_allclose(
            np.broadcast_to(bonding.relaxation, change.shape), change / 1e-9, rtol=3e-5
        )
    for speed in [1e-3, 4e-3, -4e-3]:
        # steady: a density k_on (1 − N)/V e^(−k x/V) up to the limit l, by its mean over a cell of l/1000
        part, limit = (
            bonds.Cohort(rupture=CUT_OFF, **STRETCHED, tolerance=1e-6),
            CUT_OFF.stretch,
        )
        result = part.steady(np.array([speed]))
        bound, pace = (
            result.fraction * part.bound_at_rest,
            CUT_OFF.rate * limit / abs(speed),
        )
        breaking = (
            STRETCHED["rebinding_rate"]
            * float(1.0 - bound[0])
            * limit
            / abs(speed)
            * np.exp(-pace)
        )
        scale = STRETCHED["site_density"] * STRETCHED["bond_stiffness"]
        assert_allclose(
            result.stiffness,
            scale * (bound - breaking),
            rtol=0,
            atol=scale * breaking * (1e-3 * pace + 1e-5),
        )


def test_bonds_carried_with_the_area_need_the_contact_of_the_step_before_and_others_do_not():
    # under another load the bonds differ if and only if they feed back
    for name, part in (
        BONDS | {"cohort, bell": bonds.Cohort(rupture=BELL, **STRETCHED)}
    ).items():
        at_load, at_indentation = (
            recorded(
                ["bond_fraction"],
                bonds=part,
                contact=contact,
                shear=SHEARS["modal, time, constant"],
            )[0]
            for contact in (CONTACTS["load"], CONTACTS["indentation"])
        )
        assert (
            np.array_equal(at_load, at_indentation)
            != scene(bonds=part).population.feeds_back
        ), name
