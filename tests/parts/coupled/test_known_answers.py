"""Driven sliders whose motion is known: bodies that ring on bonds, contacts that open or close behind a spring."""

import math

import numpy as np
import pytest
from helpers.corner_scenes import corner_scene
from helpers.scenes import follow
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

import sim
from sim.ensemble.diagnosis import stability
from sim.step.state import MemberNoise

LENS = {
    "solid": {"shear_modulus": 1e6},
    "sphere": {"radius": 1e-3},
    "adhesion": {"work": 0.03, "bond_share": 0.0},
}
BELL = {"model": "bell", "zero_force_rate": 5.0, "bell_force": 4e-12}
BONDS = {
    "rupture": BELL,
    "bond_stiffness": 1e-6,
    "rebinding_rate": 20.0,
    "site_density": 1e16,
}


def run(duration, step, **tables):
    return sim.run(
        sim.load(LENS | {"clock": {"duration": duration, "step": step}} | tables)
    ).squeeze()


@pytest.mark.parametrize(
    "bonds, body",
    [
        ({"model": "rate"}, {"contact_stiffness": 50.0}),
        ({"model": "rate"}, {"contact_stiffness": 50.0, "damping": 1e-2}),
        ({"model": "cohort"}, {"damping": 1e-2}),
        ({"model": "cohort"}, {"damping": 1e-2, "mass": 1e-5}),
        ({"model": "tracked", "sites": 30}, {"damping": 1e-2, "mass": 1e-5}),
    ],
)
def test_a_slider_whose_contact_came_off_lags_behind_the_stage_by_its_drag(bonds, body):
    """Long after the opening the spring bears the damping alone, so X = V(t − c/K)."""
    drive = {"model": "spring", "stage": 1e-5, "stiffness": 20.0} | body
    course = run(
        1.0,
        5e-3,
        drive=drive,
        bonds=BONDS | bonds,
        contact={"load": {"from": 1e-4, "to": -3e-4}},
    )
    assert course.in_contact.values[-1] == 0.0
    assert np.isnan(course.unresolved_time.values).all()
    assert_allclose(
        course.slider_position[-1],
        1e-5 * (1.0 - body.get("damping", 0.0) / 20.0),
        rtol=1e-6,
    )


@pytest.mark.parametrize("model", ["rate", "cohort"])
def test_a_slider_whose_contact_begins_open_follows_the_stage(model):
    drive = {
        "model": "spring",
        "stage": 1e-5,
        "stiffness": 20.0,
        "damping": 1e-2,
        "contact_stiffness": 50.0,
    }
    course = run(
        0.1, 5e-3, drive=drive, bonds=BONDS | {"model": model}, contact={"load": -3e-4}
    )
    assert_allclose(course.slider_position[-1], 1e-5 * (0.1 - 1e-2 / 20.0), rtol=1e-5)


def ringing(time, force, mass, stiffness, bonds):
    """Return the displacement of a body on bonds of a constant rupture rate, by an own solution of its equations.

    The share bound N and the sum of the stretches M per site obey N' = k_on (1 − N) − k_0 N and M' = N V − k_0 M. The
    interface follows the body at V = v − F'/k_t, with F = M × ``stiffness`` of all sites.
    """
    all_sites, yields = stiffness
    broken, binding = bonds

    def change(_, state):
        _, speed, bound, moment = state
        slip = (bound * speed - broken * moment) / (1.0 + bound * all_sites / yields)
        return [
            speed,
            (force - all_sites * moment) / mass,
            binding * (1.0 - bound) - broken * bound,
            slip,
        ]

    course = solve_ivp(
        change,
        (0.0, time[-1]),
        [0.0, 0.0, 1.0, 0.0],
        "DOP853",
        time,
        rtol=1e-11,
        atol=1e-18,
    )
    return course.y[0]


@pytest.mark.parametrize("model", ["rate", "cohort"])
@pytest.mark.parametrize("mass, step", [(1e-6, 1e-2), (1e-6, 1e-3), (1e-8, 1e-2)])
def test_a_body_rings_on_its_bonds_as_by_an_own_solution(model, mass, step):
    drive = {"model": "force", "force": 2e-4, "mass": mass, "contact_stiffness": 100.0}
    bonds = BONDS | {
        "model": model,
        "rupture": {"model": "constant", "rate": 0.3},
        "rebinding_rate": 0.003,
    }
    bonds |= {"site_density": 1e17, "start": "bonded"}
    course = run(2e-2, step, drive=drive, bonds=bonds, contact={"load": 1e-4})
    stiffness = 1e17 * 1e-6 * float(course.contact_area[0]), 100.0
    exact = ringing(course.t.values, 2e-4, mass, stiffness, (0.3, 0.003))
    assert_allclose(course.slider_position, exact, atol=0.01 * np.max(exact), rtol=0.0)
    largest = max(np.max(np.abs(course.drive_work)), np.max(course.stored_energy))
    assert np.max(np.abs(course.energy_residual)) < 1e-3 * largest


@pytest.mark.parametrize("model", ["rate", "steady", "counted"])
@pytest.mark.parametrize("step", [2e-3, 5e-4])
def test_no_peak_of_bonds_without_a_stretch_exceeds_their_strength(model, step):
    """A slider that comes to rest in a hold, and leaves it, has a kink of the stress over time at each of the two."""
    stage = {
        "time": [0.0, 0.4, 0.4, 0.6, 0.6, 1.0],
        "value": [5e-3, 5e-3, 0.0, 0.0, 5e-3, 5e-3],
    }
    drive = {
        "model": "spring",
        "stage": stage,
        "stiffness": 2e3,
        "damping": 1e-2,
        "contact_stiffness": "rigid",
    }
    bonds = {"model": model, "critical_speed": 1e-2, "stress": 1e5}
    bonds |= {"rebinding_rate": 20.0} if model != "steady" else {}
    bonds |= {"sites": 10**6} if model == "counted" else {}
    lens = {
        "solid": {"shear_modulus": 1.6e6},
        "sphere": {"radius": 2e-3},
        "adhesion": {"work": 42e-3},
    }
    course = run(1.0, step, drive=drive, bonds=bonds, contact={"load": 4e-3}, **lens)
    assert float(course.peak_stress) <= 1e5 * (1.0 + 1e-9)
    assert float(course.peak_friction) <= 1e5 * float(course.contact_area.max()) * (
        1.0 + 1e-9
    )


@pytest.mark.parametrize(
    "bonds",
    [{"model": "rate"}, {"model": "cohort"}, {"model": "tracked", "sites": 200}],
)
def test_the_largest_friction_of_a_slider_without_mass_and_damping_is_a_force_that_the_spring_bore(
    bonds,
):
    """The contact opens and closes again; the spring force rises by at most K V dt between two records."""
    rupture = {"model": "bell", "zero_force_rate": 1.0, "bell_force": 4e-12}
    bonds = BONDS | {"rupture": rupture, "rebinding_rate": 2.0} | bonds
    contact = {
        "indentation": {"from": 3e-6, "to": -4e-6, "cycles": 1},
        "after_pull_off": "reattach",
    }
    drive = {"model": "spring", "stage": 1e-5, "stiffness": 10.0}
    course = run(1.0, 1e-2, drive=drive, bonds=bonds, contact=contact)
    borne = float(np.abs(course.spring_force).max()) + 10.0 * 1e-5 * 1e-2
    assert math.isfinite(float(course.first_closing))
    assert float(course.peak_friction) <= borne


@pytest.mark.parametrize("bonds", [{"model": "rate"}, {"model": "cohort"}])
def test_friction_at_the_jump_of_a_load_is_too_large_by_the_growth_of_the_area_and_the_spring_force_is_not(
    bonds,
):
    """The limit that docs/limits.md states: spring force and friction balance but in the record of the jump."""
    load = {"time": [0.0, 1.0, 1.0, 2.0], "value": [2e-4, 2e-4, 4e-4, 4e-4]}
    drive = {"model": "spring", "stage": 1e-5, "stiffness": 50.0}
    course = run(2.0, 0.25, drive=drive, bonds=BONDS | bonds, contact={"load": load})
    area, force = course.contact_area.values, course.spring_force.values
    growth = np.ones(9)
    growth[4] = area[4] / area[3]
    assert growth[4] > 1.2
    assert_allclose(course.friction_force, growth * force, rtol=1e-5)


@pytest.mark.parametrize(
    "bonds", [{"model": "rate"}, {"model": "cohort"}, {"model": "tracked", "sites": 50}]
)
@pytest.mark.parametrize("viscosity", [0.0, 10.0])
def test_a_contact_that_closes_begins_with_bonds_without_a_stretch(bonds, viscosity):
    """Bonds that do not break are stretched by the displacement since the closing, so τ = n κ (X − X_closing) + η V."""
    rupture = {"model": "constant", "rate": 1e-9}
    bonds = (
        BONDS | bonds | {"rupture": rupture, "site_density": 1e13, "start": "bonded"}
    )
    contact = {
        "indentation": {"from": 3e-6, "to": -4e-6, "cycles": 1},
        "after_pull_off": "reattach",
    }
    drive = {
        "model": "spring",
        "stage": 1e-5,
        "stiffness": 10.0,
        "damping": 1e-2,
        "contact_stiffness": "rigid",
    }
    course = run(
        1.0, 1e-2, drive=drive | {"viscosity": viscosity}, bonds=bonds, contact=contact
    )
    after = course.isel(
        t=slice(int(np.argmax(course.t.values >= float(course.first_closing))), None)
    )
    assert after.sizes["t"] > 10 and (after.in_contact == 1.0).all()
    slid = after.slider_position - after.slider_position[0]
    bonded = 1e13 * 1e-6 * slid
    assert float(bonded[-1]) > 10.0 * viscosity * 1e-5
    assert_allclose(
        after.shear_stress,
        bonded + viscosity * after.speed,
        rtol=1e-6,
        atol=1e-6 * float(bonded[-1]),
    )
    assert float(course.dissipated_by_area.min()) >= 0.0


@pytest.mark.parametrize("sites", [5, 20])
def test_counted_bonds_never_push_a_slider_back_nor_give_back_what_they_dissipated(
    sites,
):
    """A strength that is drawn above the pull holds a slider that is pulled forwards; it does not move it."""
    drive = {
        "model": "spring",
        "stage": 1e-4,
        "stiffness": 100.0,
        "damping": 1.0,
        "contact_stiffness": "rigid",
    }
    bonds = {
        "model": "counted",
        "stress": 1e5,
        "critical_speed": 1e-3,
        "rebinding_rate": 100.0,
        "sites": sites,
    }
    bonds |= {"start": "empty"}
    course = run(
        0.2,
        1e-3,
        drive=drive,
        bonds=bonds,
        contact={"load": 1e-4},
        ensemble={"members": 8},
    )
    assert float(course.slider_position.diff("t").min()) >= 0.0
    assert float(course.dissipated_by_rupture.diff("t").min()) >= -1e-9 * float(
        course.drive_work.max()
    )


@pytest.mark.verify
@pytest.mark.parametrize("step", [2.0, 5e-2])
def test_a_clock_step_of_millions_of_ruptures_is_no_loss_of_stability(step):
    """30,000 tracked bonds break and bind several million times in each of the long clock steps."""
    rupture = {"model": "bell", "zero_force_rate": 25.0, "bell_force": 4e-12}
    bonds = {
        "model": "tracked",
        "rupture": rupture,
        "bond_stiffness": 0.8e-6,
        "rebinding_rate": 250.0,
    }
    bonds |= {"site_density": 6.5e16, "sites": 30000}
    lens = {"solid": {"shear_modulus": 1.6e6}, "sphere": {"radius": 2e-3}}
    lens["adhesion"] = {"work": 42e-3, "bond_share": 0.0}
    drive = {"model": "spring", "stage": 1e-3, "stiffness": 2e3}
    course = run(4.0, step, drive=drive, bonds=bonds, contact={"load": 4e-3}, **lens)
    assert np.isnan(course.unresolved_time.values).all()
    assert_allclose(course.friction_force[-1], 9.25e-3, rtol=0.02)


@pytest.mark.verify
def test_a_slider_whose_contact_is_lost_within_a_clock_step_goes_on_with_the_radius_that_it_had():
    """The interface slips ever faster as a fluctuation takes the contact away, since its stiffness falls with it."""
    bonds = {
        "model": "cohort",
        "rupture": {"model": "bell", "zero_force_rate": 30.0, "bell_force": 3.6e-12},
    }
    bonds |= {"bond_stiffness": 0.7e-6, "rebinding_rate": 220.0, "site_density": 7e16}
    drive = {
        "model": "spring",
        "stage": 8e-3,
        "stiffness": 100.0,
        "mass": 3e-5,
        "damping": 0.05,
        "start": "steady",
    }
    shear = {"model": "banded", "cell": 3e-4, "points": 256}
    shear |= {"spectrum": {"model": "gaussian", "rms": 1.2e5, "length": 9e-6}}
    shear |= {"correlation": {"model": "slip", "length": 6e-6}}
    shear |= {"amplitude": {"model": "slip_rate", "floor": 0.05, "relaxing": True}}
    lens = {
        "solid": {"shear_modulus": 1.6e6},
        "sphere": {"radius": 2e-3},
        "adhesion": {"work": 42e-3},
    }
    scene = lens | {
        "clock": {"duration": 0.38, "step": 62.5e-6},
        "drive": drive,
        "bonds": bonds,
        "shear": shear,
    }
    scenario = sim.load(scene | {"contact": {"load": 4e-3}, "seed": 7})
    state, course = follow(
        scenario,
        MemberNoise.of(7, np.array([2])),
        None,
        range(scenario.clock.steps + 1),
    )
    assert np.isnan(state.drive.unresolved_time).all()
    assert float(course.radius.min()) > 0.0


def test_a_body_that_turns_many_times_in_a_clock_step_comes_to_rest_by_dry_friction():
    """Dry friction F takes 2 F/K of the amplitude in each half period; the body rests where the spring bears less."""
    stiffness, mass, rest = 100.0, 2.5e-6, 0.1
    stage = {"time": [0.0, rest, rest, 3.0 * rest], "value": [1e-4, 1e-4, 0.0, 0.0]}
    drive = {
        "model": "spring",
        "stage": stage,
        "stiffness": stiffness,
        "mass": mass,
        "contact_stiffness": "rigid",
    }
    bonds = {"model": "none", "stress": 1.0}
    tables = {
        "drive": drive | {"start": "rest"},
        "bonds": bonds,
        "contact": {"load": 1e-4},
    }
    course = run(3.0 * rest, rest, **tables)
    friction = 1.0 * float(course.contact_area[0])
    lag = friction / stiffness
    behind = float(course.slider_position[1] - course.stage_position[1])
    speed, frequency = float(course.speed[1]), math.sqrt(stiffness / mass)
    # the spring is balanced this far behind the centre
    turn = math.copysign(lag, speed)
    where, halves = (
        math.copysign(math.hypot(behind + turn, speed / frequency), speed) - turn,
        0,
    )
    while abs(where) > lag:
        where, halves = -where + math.copysign(2.0 * lag, where), halves + 1
    assert halves > 100
    assert np.isnan(course.unresolved_time.values).all()
    assert_allclose(
        course.slider_position[2] - course.stage_position[2],
        where,
        atol=1e-5 * abs(behind) + lag,
    )
    assert float(course.speed[2]) == 0.0


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_slider_leaves_rest_at_a_speed_that_balances_the_pull_whatever_bonds_carry_of_adhesion(
    share,
):
    """The area shrinks with the bonds that the slip breaks; spring force and friction are equal at each record."""
    drive = {
        "model": "spring",
        "stage": 3.9e-9,
        "stiffness": 1180.0,
        "viscosity": 9.3e10,
        "contact_stiffness": "rigid",
    }
    bonds = {"model": "steady", "stress": 634.0, "critical_speed": 2.5e-10}
    lens = {
        "adhesion": {"work": 0.0125, "bond_share": share},
        "sphere": {"radius": 2e-2},
    }
    course = run(100.0, 1.0, drive=drive, bonds=bonds, contact={"load": 2.3e-4}, **lens)
    assert np.isnan(course.unresolved_time.values).all()
    assert float(course.speed[-1]) > 0.0
    assert_allclose(course.friction_force, course.spring_force, rtol=1e-5, atol=1e-12)


def test_a_slider_follows_its_stage_when_the_last_bonds_are_broken():
    """Nothing resists a slider without mass and damping whose bonds are not remade."""
    rupture = {"model": "bell", "zero_force_rate": 3.6e4, "bell_force": 4.8e-13}
    bonds = {
        "model": "rate",
        "rupture": rupture,
        "bond_stiffness": 4.2e-7,
        "rebinding_rate": 0.0,
    }
    bonds |= {"site_density": 6.6e13, "start": "bonded"}
    drive = {
        "model": "spring",
        "stage": 2.6e-7,
        "stiffness": 395.0,
        "contact_stiffness": "rigid",
    }
    course = run(2.0, 0.5, drive=drive, bonds=bonds, contact={"load": 2.8e-6})
    assert np.isnan(course.unresolved_time.values).all()
    assert_allclose(course.slider_position[1:], course.stage_position[1:], rtol=1e-6)


def test_a_body_under_a_force_drifts_when_its_contact_is_lost_within_a_clock_step():
    """The contact is sheared most where it comes off; then damping alone resists, and the speed is Q/c."""
    force, damping = -2.17e-12, 0.0132
    rupture = {"model": "cut_off", "stretch": 2.4e-8, "rate": 0.0}
    bonds = {
        "model": "rate",
        "rupture": rupture,
        "bond_stiffness": 4.3e-5,
        "rebinding_rate": 2.2e-7,
    }
    bonds |= {"site_density": 4.3e14, "start": "bonded"}
    contact = {
        "displacement": {"from": 8.9e-8, "to": -1.5e-7, "cycles": 1},
        "stiffness": 30.8,
    }
    lens = {"solid": {"shear_modulus": 1e7}, "sphere": {"radius": 3e-6}}
    lens["adhesion"] = {"work": 3.3e-3, "bond_share": 0.6}
    course = run(
        70.0,
        3.5,
        drive={"model": "force", "force": force, "damping": damping},
        bonds=bonds,
        contact=contact,
        **lens,
    )
    assert course.in_contact.values[-1] == 0.0
    assert np.isnan(course.unresolved_time.values).all()
    assert_allclose(course.speed[-1], force / damping, rtol=1e-9)


def test_cohorts_with_a_cut_off_slip_ahead_of_a_body_that_damping_holds_as_with_ever_less_viscosity():
    rupture = {"model": "cut_off", "rate": 0.0, "stretch": 1e-7}
    drive = {
        "model": "spring",
        "stage": 1e-5,
        "stiffness": 20.0,
        "damping": 1e-2,
        "contact_stiffness": 1.0,
    }
    positions = []
    for viscosity in (0.0, 1e2, 1e3):
        tables = {
            "drive": drive | {"viscosity": viscosity},
            "bonds": BONDS | {"model": "cohort", "rupture": rupture},
        }
        course = run(1.0, 1e-2, contact={"load": 1e-4}, **tables)
        assert np.isnan(course.unresolved_time.values).all()
        positions.append(course.slider_position[-1].item())
    none, less, more = positions
    assert abs(none - less) < 1e-5 * none
    assert abs(none - more) < 1e-4 * none


def test_a_contact_stays_as_it_was_when_the_slider_lost_stability_and_has_no_friction():
    # a force of 1 µN that no mass and no damping holds, on a sphere that is lifted off and comes back
    scenario = sim.load(corner_scene(65))
    steps = range(scenario.clock.steps + 1)
    state, course = follow(scenario, MemberNoise.of(7, np.arange(1)), None, steps)
    lost = float(state.drive.runaway_time[0])
    gone = course.time > lost
    assert np.isnan(course.radius[gone]).all()
    load = scenario.contact.course.at(course.time, scenario.clock.duration)
    assert np.any(gone & (load > 0.0))
    after = scenario.phases.starts.index(
        min(s for s in scenario.phases.starts if s > lost)
    )
    assert state.events.by_phase("friction")["largest"][0, 0] > 0.0
    assert np.all(state.events.by_phase("friction")["largest"][0, after:] == 0.0)


def test_friction_that_falls_at_once_with_the_speed_is_unstable_behind_any_spring():
    """The friction A τ/(1 + V/V_c) + c V falls below the speed V_c (√(A τ/(V_c c)) − 1), whatever the spring."""
    critical, stress, damping = 1e-3, 1e5, 0.1

    def scene(speed, stiffness=1e3):
        drive = {"stage": speed, "stiffness": stiffness, "damping": damping}
        return sim.load(
            LENS
            | {
                "clock": {"duration": 2.0, "step": 1e-3},
                "drive": {"model": "spring", "contact_stiffness": "rigid"} | drive,
                "bonds": {
                    "model": "steady",
                    "critical_speed": critical,
                    "stress": stress,
                },
                "contact": {"load": 1e-4},
            }
        )

    strength = stress * scene(1e-3).contact_area
    limit = critical * (math.sqrt(strength / (critical * damping)) - 1.0)
    for stiffness in (1.0, 1e5):
        found = stability(scene(limit, stiffness)).unstable
        assert_allclose(found, [(0.0, limit)], rtol=1e-3)
    assert stability(scene(0.9 * limit)).stiffness == math.inf
    assert stability(scene(1.1 * limit)).stiffness == 0.0
    slow, fast = (
        sim.run(scene(share * limit)).squeeze().speed.values[1000:]
        for share in (0.9, 1.1)
    )
    assert np.ptp(slow) > limit  # it sticks and slips
    assert_allclose(fast, 1.1 * limit, rtol=1e-5)
