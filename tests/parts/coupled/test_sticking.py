"""Sliders on bonds without a stretch that take time: a linear rate equation, and a finite number of them."""

import math

import numpy as np
import pytest
from helpers import driven
from helpers.cases import some
from helpers.driven import (
    COULOMB,
    HELD,
    STRETCH,
    Force,
    MemberNoise,
    follow,
    march,
    marched,
    pulled,
    residual,
    stuck,
)
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import sim
from sim.laws.reversible import radius_at_load_reversible
from sim.laws.schallamach import linear_onset
from sim.parts.bonds.models import Counted, Rate, Steady, Unbroken
from sim.parts.drive import READINGS

#: Rate at which free sites bind, and critical speed in stretches a second.
BINDING, CRITICAL = 2.0, 0.5
LINEAR = {
    "critical_speed": CRITICAL * STRETCH,
    "rebinding_rate": BINDING,
    "stress": COULOMB,
}


def renewed(start="bonded", **keys):
    """Bonds of the linear rate equation."""
    return Rate(**LINEAR, start_from=start, **keys)


def reached(states):
    """Way of the slider, share of bonds and speed in the units of the bonds, one row a state."""
    return np.array(
        [
            (
                state.drive.position[0] / STRETCH,
                state.bonds.bound[0],
                state.drive.speed[0] / STRETCH,
            )
            for state in states
        ]
    )


def reference(times, stiffness, speed, mass, damping):
    """Way, share and speed from rest with all bonds, by a general integrator between stops and starts."""
    way, share, now, found = 0.0, 1.0, 0.0, []

    def pull(t):
        return stiffness * (speed * t - way)

    while now < times[-1]:
        since, before = now, share

        def healed(t, since=since, before=before):
            return 1.0 - (1.0 - before) * math.exp(-BINDING * (t - since))

        first = now + 1e-9 if now > 0.0 else 0.0
        now = brentq(
            lambda t, healed=healed: pull(t) - healed(t),
            first,
            times[-1] + 10.0,
            xtol=1e-15,
        )
        found += [(t, way, healed(t), 0.0) for t in times if since <= t < now]

        def slides(t, y):
            rate = (
                (stiffness * (speed * t - y[0]) - y[1] - damping * y[2]) / mass
                if mass
                else 0.0
            )
            v = y[2] if mass else (stiffness * (speed * t - y[0]) - y[1]) / damping
            return v, BINDING * (1.0 - y[1]) - BINDING * v / CRITICAL * y[1], rate

        def stops(t, y):
            return slides(t, y)[0]

        stops.terminal, stops.direction = True, -1.0
        keys = {
            "method": "DOP853",
            "rtol": 1e-12,
            "atol": 1e-13,
            "events": stops,
            "dense_output": True,
        }
        slid = solve_ivp(
            slides, (now, times[-1] + 10.0), (way, healed(now), 0.0), **keys
        )
        found += [
            (t, *slid.sol(t)[:2], slides(t, slid.sol(t))[0])
            for t in times
            if now <= t < slid.t[-1]
        ]
        now, (way, share, _) = slid.t[-1], slid.y[:, -1]
    return np.array(found)[:, 1:]


@pytest.mark.parametrize("mass", [0.0, 0.01])
def test_bonds_that_heal_at_rest_stick_and_slip_as_a_general_integrator_has_it(mass):
    times, off = np.linspace(0.0, 12.0, 241), []
    exact = reference(times, 1.0, 0.3, mass, 0.05)
    assert np.sum(np.diff(exact[:, 2] > 0.0)) > 3  # several slips
    for tolerance in (1e-9, 1e-11):
        states, read = marched(
            stuck(
                12.0, 240, renewed(), pulled(1.0, 0.3, mass, 0.05, tolerance=tolerance)
            )
        )
        off.append(np.max(np.abs(reached(states)[:, :2] - exact[:, :2])))
    assert off[1] < 0.1 * off[0] < 1e-7
    assert_allclose(read["spring_force"] / HELD, 0.3 * times - exact[:, 0], atol=1e-7)


@pytest.mark.parametrize(
    ("mass", "damping", "onset", "frequency"),
    [
        (0.01, 0.05, 2.2733333, 11.1355287),
        (0.1, 0.1, 5.1333333, 6.6332496),
        (0.0, 0.1, 0.7333333, 6.6332496),
    ],
)
def test_disturbances_neither_grow_nor_fade_at_the_onset_and_do_so_on_its_sides(
    mass, damping, onset, frequency
):
    # K_c = (c + m H)(B - c H)/c, w_c^2 = K_c H/(c + m H), H = h (1 + V/V_c), B = F_s h N/V_c
    law = linear_onset([1.0, -1.0, 1e9], CRITICAL, BINDING, 1.0, damping, mass)
    assert_allclose(
        law, ([onset, onset, 0.0], [frequency, frequency, math.nan]), rtol=1e-7
    )
    steps, step = 200, 2.0 * math.pi / frequency / 25.0

    def growth(stiffness):
        drive = pulled(
            stiffness,
            driven.jolted(1.0, step, 1.00001),
            mass,
            damping,
            start="steady",
            tolerance=1e-11,
        )
        scene = stuck(steps * step, steps, renewed("steady"), drive)
        passed = follow(
            scene, MemberNoise.of(scene.seed, np.arange(1)), None, range(steps + 1)
        )[1]
        return driven.mode_of(
            passed.fraction[steps // 3 :, 0], step, frequency, 3 if mass else 2
        )

    driven.check_onset(growth, onset, frequency)


def test_a_force_moves_a_body_after_a_rest_where_it_exceeds_the_strength_that_has_healed():
    for keys in [{"mass": 0.01}, {"damping": 0.01}]:
        heavy = {name: value * HELD / STRETCH for name, value in keys.items()}
        for wait in (0.1, 1.0, 3.0):
            for above in (-1e-9, 1e-9):
                load = HELD * (-math.expm1(-BINDING * wait) + above)
                table = {
                    "time": (0.0, wait, wait, 10.0),
                    "value": (0.0, 0.0, load, load),
                }
                drive = Force(force=table, contact_stiffness="rigid", **heavy)
                states, _ = marched(stuck(1.1 * wait, 11, renewed("empty"), drive))
                moved = states[-1].drive.position[0]
                assert moved == 0.0 if above < 0.0 else moved > 0.0


def test_a_stage_that_turns_leaves_a_slider_at_rest():
    turns = {
        "time": (0.0, 4.0, 4.0, 8.0, 8.0, 99.0),
        "value": tuple(v * STRETCH for v in (1.0, 1.0, -2.0, -2.0, 0, 0)),
    }
    states, read = marched(stuck(12.0, 48, renewed(), pulled(1.0, turns, damping=0.1)))
    ways = reached(states)
    assert ways[16, 2] > 0.0 > ways[32, 2]
    assert np.all(ways[40:, 2] == 0.0)
    assert_allclose(states[-1].bonds.bound, 1.0, atol=1e-3)
    assert (
        np.max(np.abs(read["spring_force"])) <= HELD * (1.0 + 1e-9) + 0.1 * HELD * 2.0
    )
    assert residual(read) < 1e-5


@pytest.mark.parametrize(
    "bonds",
    [
        renewed(),
        Steady(critical_speed=STRETCH, stress=COULOMB),
        Unbroken(stress=COULOMB),
    ],
)
def test_a_contact_that_pays_for_its_mean_stress_follows_it_within_the_sub_steps(bonds):
    for keys in [{"damping": 0.05}, {"mass": 0.01, "damping": 0.05}]:
        # at rest with all its strength the stress takes this of the work of adhesion
        share = (
            6.0
            * COULOMB**2
            * math.sqrt(driven.AREA / math.pi)
            / (math.pi * driven.MODULUS)
            / driven.WORK
        )
        missing = []
        for tolerance in (1e-5, 1e-8):
            scene = stuck(
                12.0,
                240,
                bonds,
                pulled(1.0, 0.3, tolerance=tolerance, **keys),
                reversible=0.3 / share,
            )
            states, read = marched(scene)
            radii = np.array([state.contact.radius[0] for state in states[1:]])
            assert_allclose(
                [state.drive.radius[0] for state in states[1:]], radii, rtol=1e-9
            )
            missing.append(residual(read))
            assert missing[-1] < tolerance
        stress = np.abs([state.bonding.stress[0] for state in states[1:]])
        exact = radius_at_load_reversible(
            driven.LOAD, driven.WORK, stress, 0.3 / share, driven.R, driven.MODULUS
        )
        assert_allclose(radii, exact, rtol=1e-9)
        assert np.min(radii) < 0.97 * np.max(radii)
        assert missing[1] < missing[0]


def counted(sites, start="bonded"):
    """A finite number of bonds with the rates of the linear equation."""
    return Counted(**LINEAR, sites=sites, start_from=start)


@pytest.mark.parametrize(
    "keys", some([{"damping": 0.3}, {"mass": 0.05, "damping": 0.3}], {"damping": 0.3})
)
def test_very_many_counted_bonds_move_as_the_rate_equation_to_first_order_in_the_clock_step(
    keys,
):
    def force(bonds, steps):
        return (
            marched(stuck(4.0, steps, bonds, pulled(1.0, 0.5, **keys)))[1][
                "spring_force"
            ][:: steps // 40]
            / HELD
        )

    exact = force(renewed(), 40)
    off = [
        np.max(np.abs(force(counted(10**9), steps) - exact))
        for steps in (320, 640, 1280)
    ]
    assert off[0] < 0.03
    assert_allclose(np.divide(off[:-1], off[1:]), 2.0, rtol=0.15)


def test_counted_bonds_of_a_slider_fluctuate_as_independent_sites_in_steady_sliding():
    # held by a stiff spring and much damping the speed is that of the stage; each site is bound with 1/(1 + V/V_c)
    sites, members = 50, 400
    scene = stuck(
        20.0,
        200,
        counted(sites, "steady"),
        pulled(50.0, 1.0, damping=50.0, start="steady"),
    )
    passed = follow(
        scene, MemberNoise.of(scene.seed, np.arange(members)), None, range(201)
    )[1]
    share, bound = 1.0 / 3.0, passed.fraction[100:]
    assert abs(np.mean(bound[-1]) - share) < 4.0 * math.sqrt(
        share * (1.0 - share) / sites / members
    )
    assert_allclose(
        np.var(bound[-1]),
        share * (1.0 - share) / sites,
        rtol=4.0 * math.sqrt(2.0 / members),
    )


def test_counted_bonds_at_rest_carry_the_pull_up_to_their_strength():
    scene = stuck(
        6.0, 240, counted(40), pulled(1.0, 0.5, damping=0.05), share=0.5, members=8
    )
    straight = list(march(scene, np.arange(8)))
    force, later = (
        np.array([getattr(state.drive, name) for state in straight[1:]])
        for name in ("spring_force", "speed")
    )
    course = follow(scene, MemberNoise.of(scene.seed, np.arange(8)), None, range(241))[
        1
    ]
    bound, areas, rest = (
        course.fraction[1:],
        np.pi * course.radius[1:] ** 2,
        course.speed[1:] == 0.0,
    )
    assert 0.3 < np.mean(rest) < 1.0
    # bonds that have become stronger than the pull hold a slider that slid until then
    sticks = force <= COULOMB * bound * areas
    assert np.count_nonzero(sticks & ~rest) > 10
    assert np.all(later[sticks] == 0.0) and np.all(later[~sticks & ~rest] > 0.0)
    # within a step that begins and ends at rest nothing has moved, and bonds of its start bear the pull
    still = rest[1:] & (later[:-1] == 0.0)
    assert np.all(
        force[1:][still] <= (COULOMB * bound * areas)[:-1][still] * (1.0 + 1e-9)
    )
    residuals = scene.parts.drive.readings(straight[-1].drive)
    assert np.all(np.abs(residuals[:, 10]) < 1e-5 * residuals[:, 3])


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_counted_bonds_never_push_a_slider_back_and_bear_no_more_than_the_spring_gives(
    share,
):
    damping = 0.2 * HELD / STRETCH
    scene = stuck(
        20.0, 400, counted(20), pulled(5.0, 1.0, damping=0.2), share=share, members=8
    )
    course = follow(scene, MemberNoise.of(scene.seed, np.arange(8)), None, range(401))[
        1
    ]
    read = dict(zip(READINGS, np.moveaxis(course.driven, -1, 0), strict=True))
    assert np.count_nonzero(np.diff(course.fraction, axis=0) > 0.0) > 500
    assert np.min(np.diff(course.position, axis=0)) >= 0.0
    lost = np.diff(read["dissipated_by_rupture"], axis=0)
    assert np.min(lost) >= -1e-12 * np.max(read["drive_work"])
    friction, balance = (
        course.stress * np.pi * course.radius**2,
        read["spring_force"] - damping * course.speed,
    )
    rounding = 1e-14 * np.max(read["spring_force"])
    assert np.all(friction[1:] <= balance[1:] + rounding)
    if share == 0.0:  # the draw does not change the area
        assert_allclose(friction[1:], balance[1:], rtol=0.0, atol=rounding)


@pytest.mark.parametrize("steps", [500, 2000])
@pytest.mark.parametrize("bonds", ["rate", "steady", "counted"])
def test_the_largest_stress_is_the_strength_at_the_end_of_a_stick_phase_whatever_the_clock_step(
    bonds, steps
):
    """A stage moves for 0.4 s, stops for 0.2 s and moves again; bonds heal at rest from their share in sliding."""
    strength, binding, critical, speed, stiffness = 1e5, 20.0, 1e-2, 5e-3, 2e3
    keys = {
        "rate": {"rebinding_rate": binding},
        "steady": {},
        "counted": {"rebinding_rate": binding, "sites": 10**9},
    }
    stage = {
        "time": [0.0, 0.4, 0.4, 0.6, 0.6, 1.0],
        "value": [speed, speed, 0.0, 0.0, speed, speed],
    }
    dataset = sim.run(
        {
            "clock": {"duration": 1.0, "step": 1.0 / steps},
            "solid": {"shear_modulus": 1.6e6},
            "sphere": {"radius": 2e-3},
            "adhesion": {"work": 42e-3, "bond_share": 0.0},
            "contact": {"load": 4e-3},
            "drive": {
                "model": "spring",
                "stage": stage,
                "stiffness": stiffness,
                "damping": 1e-2,
                "contact_stiffness": "rigid",
            },
            "bonds": {
                "model": bonds,
                "stress": strength,
                "critical_speed": critical,
                **keys[bonds],
            },
        }
    ).squeeze()
    held = strength * float(dataset["contact_area"][0])
    assert float(dataset["peak_stress"]) <= strength

    def healed(time):
        return (
            1.0 - speed / (speed + critical) * math.exp(-binding * time)
            if bonds != "steady"
            else 1.0
        )

    def lacks(time):
        return (
            held * healed(0.2 + time)
            - held * critical / (speed + critical)
            - stiffness * speed * time
        )

    top = held * healed(0.2 + brentq(lacks, 0.0, 1e-2))
    # the share of bonds in sliding is no more exact than a clock step of counted bonds has it
    assert_allclose(
        float(dataset["phase_peak_friction"][2]),
        top,
        rtol=1e-4 if bonds == "counted" else 1e-6,
    )


@pytest.mark.parametrize("parts", [1, 6, 7, 8, 9, 10, 14, 64])
def test_a_slider_that_leaves_rest_never_slides_against_its_pull_however_long_the_clock_step(
    parts,
):
    """Where bonds break a million times faster than they are loaded, a long sub-step has a solution that goes back."""
    step = 0.010513783203699044 / parts
    scene = {
        "clock": {"duration": 24 * parts * step, "step": step},
        "solid": {"shear_modulus": "0.32 MPa"},
        "sphere": {"radius": "0.57 mm"},
        "adhesion": {"work": "0.1 J/m^2", "bond_share": 0.0},
        "contact": {"indentation": "8 um"},
        "bonds": {
            "model": "rate",
            "stress": 2888.5,
            "critical_speed": "12 um/s",
            "rebinding_rate": 49.0,
            "start": "empty",
        },
        "drive": {
            "model": "spring",
            "stage": 1.1177e-4,
            "stiffness": 5.6166,
            "viscosity": 172.7,
            "contact_stiffness": "rigid",
            "damping": 2.58e-4,
            "tolerance": 1e-6,
        },
    }
    _, course = follow(
        sim.Scenario(**scene),
        MemberNoise.of(0, np.arange(1)),
        None,
        range(24 * parts + 1),
    )
    assert np.max(course.position) > 1e-5  # it has slipped
    assert np.min(np.diff(course.position[:, 0])) >= 0.0
