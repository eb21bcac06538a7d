"""Slider and bonds solved together, against closed forms, linear stability and trajectories of other integrators."""

import math

import numpy as np
import pytest
from helpers import driven
from helpers.cases import some
from helpers.driven import (
    AREA,
    HELD,
    STRETCH,
    UNIT,
    march,
    marched,
    pulled,
    reached,
    residual,
    scenario,
    spring,
    stuck,
)
from helpers.printed import lines_of
from helpers.scenes import follow
from numpy.testing import assert_allclose
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import sim
from sim.ensemble.diagnosis import slider_body
from sim.laws.schallamach import Body, first_moment_onset
from sim.parts.bonds.models import FirstMoment, Steady, Unbroken
from sim.parts.bonds.rupture import Constant, CutOff
from sim.parts.contact.models import Adhesion
from sim.parts.drive import Force
from sim.scenario.scenario import Scenario
from sim.solid import HalfSpace
from sim.step.state import MemberNoise
from sim.units.errors import BadInput

#: X, N, F at 1, 1.5, 2, 2.5 and 4 of a massless slider, by two integrators that agree to 2e-12.
MASSLESS = {
    2: (0.66078417052, 0.43706238159, 0.18678431659),
    3: (1.38296108241, 0.37378147709, 0.27234077835),
    4: (2.84992794049, 0.28217034178, 0.34300144119),
    5: (24.65242920427, 0.06015825135, 0.00695141591),
    8: (26.61555546465, 0.35027850732, 0.26768889071),
}


def test_a_slider_without_and_with_mass_and_damping_follows_its_reference():
    for steps in [8, 80]:
        states, read = marched(scenario(4.0, steps, spring(0.02, tolerance=1e-8)))
        for place, exact in MASSLESS.items():
            state = states[place * steps // 8]
            assert_allclose(
                reached([state], "position", "bound", "stretch")[0], exact, rtol=1e-6
            )
        assert_allclose(read["stage_position"][-1], 40.0 * STRETCH, rtol=1e-14)
        pulls = [state.bonding.stress[0] * AREA for state in states]
        assert_allclose(read["spring_force"], pulls, rtol=1e-9, atol=1e-9)
        assert residual(read) < 1e-7
    # X, v, N, M, A/A_rest and work, damping, rupture, area of a body whose area follows its bonds
    with_mass = {
        2: (0.6701109338, 1.2259073835, 0.4366280821, 0.1907491406, 0.9669729159)
        + (0.9452661342, 0.0005249635, 0.0326176631, 0.0006137312),
        4: (3.2414235908, 5.9325747346, 0.2575936680, 0.3601989198, 0.8700236014)
        + (3.6234681296, 0.0087401333, 0.5553065048, 0.0142207552),
        5: (11.0888440083, 33.3879670336, 0.0765254672, 0.2044020447, 0.7651500809)
        + (5.2703910602, 0.1646970381, 2.3568774747, 0.0473633380),
        8: (30.4992884103, -0.1735524184, 0.3522898786, 0.1875462974, 0.9220199073)
        + (6.9555296727, 0.8491728180, 5.1176020214, 0.0400760338),
    }
    states, read = marched(
        scenario(
            4.0, 8, spring(0.02, mass=1e-3, damping=1e-3, tolerance=1e-8), share=0.5
        )
    )
    parts = (
        "drive_work",
        "dissipated_by_damping",
        "dissipated_by_rupture",
        "dissipated_by_area",
    )
    found = []
    for place in with_mass:
        bonds = reached([states[place]], "position", "body_speed", "bound", "stretch")[
            0
        ]
        area = np.pi * states[place].contact.radius[0] ** 2 / AREA
        found.append(
            [*bonds, area, *(read[part][place] / driven.ENERGY for part in parts)]
        )
    exact = np.array(list(with_mass.values()))
    assert np.all(
        np.abs(np.array(found) - exact) < 1e-6 * np.max(np.abs(exact), axis=0)
    )
    assert residual(read) < 1e-7


def test_a_mean_stretch_that_changes_its_sign_costs_no_accuracy_at_any_tolerance():
    # there the rupture rate has a kink: the reference stops at it, and every sub-step errs by its tolerance at the most
    stiffness, pace, damping, times = 0.5, 10.0, 0.3, (0.0, 3.0, 3.0, 4.0)

    def rates(_, state, stage):
        bound, stretch, pull = state
        breaking, speed = math.exp(abs(stretch / bound)), (pull - stretch) / damping
        return [
            1.0 - bound - bound * breaking,
            bound * speed - stretch * breaking,
            stiffness * (stage - speed),
        ]

    def kink(_, state, stage):
        return state[1]

    kink.terminal = True
    exact, begin, fine = (
        [0.5, 0.0, 0.0],
        0.0,
        {"method": "DOP853", "rtol": 1e-13, "atol": 1e-15},
    )
    for stage, end, events in (pace, 3.0, None), (-pace, 4.0, kink), (-pace, 4.0, None):
        part = solve_ivp(
            rates, (begin, end), exact, args=(stage,), events=events, **fine
        )
        begin, exact = part.t[-1], part.y[:, -1]
    assert 3.0 < part.t[0] < 4.0
    course = {
        "time": times,
        "value": tuple(speed * STRETCH for speed in (pace, pace, -pace, -pace)),
    }
    for tolerance in (1e-6, 1e-8, 1e-9, 1e-10, 1e-12):
        drive = spring(stiffness, course, damping=damping, tolerance=tolerance)
        states, read = marched(scenario(4.0, 8, drive))
        errors = reached(states[-1:], "bound", "stretch")[0] - exact[:2]
        assert np.max(np.abs(errors)) < read["substeps"][-1] * tolerance


MASS, DAMPING, CONTACT = {"mass": 1e-3}, {"damping": 1e-3}, {"contact": 0.05}
KEYS = [
    {},
    MASS,
    DAMPING,
    MASS | DAMPING,
    CONTACT,
    CONTACT | MASS,
    CONTACT | MASS | DAMPING,
]


def growth_with(keys, frequency, steps=300, step=0.02, **lens):
    """Growth rate and frequency of the slowest mode of the bonds after a small jump of the speed, of a stiffness."""

    def growth(stiffness):
        drive = spring(
            stiffness,
            driven.jolted(10.0, step, 1.00001),
            start="steady",
            tolerance=1e-11,
            **keys,
        )
        scene = scenario(steps * step, steps, drive, start="steady", **lens)
        passed = follow(
            scene, MemberNoise.of(scene.seed, np.arange(1)), None, range(steps + 1)
        )[1]
        # there the body rings for long
        modes = 4 if {"contact", "mass"} <= keys.keys() else 2
        return driven.mode_of(passed.fraction[steps // 2 :, 0], step, frequency, modes)

    return growth


@pytest.mark.parametrize("keys", some(KEYS, KEYS[-1]))
def test_disturbances_neither_grow_nor_fade_at_the_onset_and_do_so_on_its_sides(keys):
    body = {
        "contact_stiffness" if name == "contact" else name: value
        for name, value in keys.items()
    }
    onset, frequency = (
        float(value)
        for value in first_moment_onset(10.0, *5 * [1.0], Body(1.0, **body))
    )
    driven.check_onset(growth_with(keys, frequency), onset, frequency, near=0.02)


@pytest.mark.parametrize(
    ("keys", "sites", "lens"),
    [
        ({"viscosity": 1e-3, "contact": "half_space"}, 0.3, {"share": 0.5}),
        ({"damping": 0.1}, 100.0, {"share": 0.5, "reversible": 0.1}),
    ],
)
def test_the_onset_that_is_shown_is_that_of_the_engine_with_all_that_delays_and_moves_the_slider(
    keys, sites, lens
):
    lens |= {
        "make": lambda **recipe: FirstMoment(
            **(recipe | {"site_density": sites * driven.DENSITY})
        )
    }
    scene, speed = (
        scenario(1.0, 4, spring(1.0, **keys), **lens),
        np.full(1, 10.0 * STRETCH),
    )
    body = slider_body(scene, speed)
    stiffness, frequency = (values[0] for values in scene.bonds.onset(speed, body))
    driven.check_onset(
        growth_with(keys, frequency, **lens),
        stiffness / driven.STIFF,
        frequency,
        near=0.02,
    )
    plain = scene.bonds.onset(
        speed, body._replace(contact_growth=0.0, stress_growth=0.0)
    ).stiffness[0]
    assert abs(plain / stiffness - 1.0) > 1e-3  # more than the engine is held to


def test_a_force_is_a_soft_spring_makes_creep_or_a_runaway_and_shears_a_half_space_and_viscous_bonds():
    for load, share, speed in (
        (0.2, 0.367052999629, 0.939593030185),
        (0.27, 0.265980949699, 2.80136714552),
    ):
        states, read = marched(scenario(200.0, 4, driven.force(load)))
        assert_allclose(reached(states[-1:], "bound")[0], share, rtol=1e-10)
        assert_allclose(states[-1].drive.speed / STRETCH, speed, rtol=1e-8)
        assert np.isnan(read["runaway_time"]).all()
        assert_allclose(
            read["energy_residual"], 0.0, atol=1e-6 * read["drive_work"][-1]
        )
    for load, time in (
        (0.28, 11.0634348789),
        (0.3, 2.52331513753),
        (0.4, 0.687585303603),
    ):
        states, read = marched(scenario(12.0, 12, driven.force(load, tolerance=1e-8)))
        assert_allclose(read["runaway_time"][-1], time, rtol=1e-7)
        ended = states[-1]
        assert np.isnan([ended.drive.position, ended.drive.speed]).all()
        assert np.isfinite([ended.bonds.bound, ended.contact.radius]).all()
    # K V stays as K falls: the force of the spring is that ramp but for what the body gives way
    ramp = {"from": 0.0, "to": 0.2 * UNIT}
    given = list(
        march(
            scenario(1.0, 10, Force(force=ramp, contact_stiffness="rigid")),
            np.arange(1),
        )
    )[-1]
    errors = []
    for stiffness in (1e-3, 1e-4, 1e-5):
        last = list(
            march(scenario(1.0, 10, spring(stiffness, 0.2 / stiffness)), np.arange(1))
        )[-1]
        errors.append(abs(last.drive.position[0] / given.drive.position[0] - 1.0))
    assert_allclose(np.divide(errors[:-1], errors[1:]), 10.0, rtol=0.02)
    for mass in [0.0, 0.05]:
        stiff, bonds = (
            HELD / STRETCH,
            Steady(critical_speed=STRETCH, stress=driven.COULOMB),
        )
        for load in (0.9, -0.9, 1.3, -1.3):
            keys = {
                "mass": mass * stiff,
                "damping": 0.5 * stiff,
                "contact_stiffness": "rigid",
            }
            states, read = marched(
                stuck(40.0, 8, bonds, Force(force=load * HELD, **keys))
            )
            speed = abs(states[-1].drive.speed[0]) / STRETCH
            if abs(load) < 1.0:
                assert speed == states[-1].drive.position[0] == 0.0
                assert_allclose(
                    states[-1].bonding.stress[0], load * driven.COULOMB, rtol=1e-14
                )
                assert states[-1].bonds.bound[0] == 1.0
            else:
                assert_allclose(0.5 * speed + 1.0 / (1.0 + speed), 1.3, rtol=1e-9)
                assert states[-1].drive.speed[0] * load > 0.0
                assert residual(read) < 1e-6
    # N stays; M' = N v − k M with η v + M = Q
    eta, load = 0.3, 0.2
    drive = driven.force(
        load, viscosity=eta * driven.DENSITY * driven.KAPPA, tolerance=1e-10
    )
    states, read = marched(scenario(2.0, 10, drive, rupture=Constant(rate=1.0)))
    time, rate = 0.2 * np.arange(11), 0.5 / eta + 1.0
    moment = 0.5 * load / eta / rate * -np.expm1(-rate * time)
    assert_allclose(reached(states, "stretch")[1:, 0], moment[1:], rtol=1e-8)
    assert_allclose(
        [state.drive.speed[0] / STRETCH for state in states[1:]],
        (load - moment[1:]) / eta,
        rtol=1e-8,
    )
    assert_allclose(
        [state.bonding.stress[0] * AREA / UNIT for state in states[1:]], load, rtol=1e-9
    )
    assert residual(read) < 1e-9
    # bonds that slip alone would break, far from it
    held = CutOff(stretch=1e6 * STRETCH)
    drive = driven.force(
        0.01,
        contact_stiffness="half_space",
        viscosity=1e-6 * driven.DENSITY * driven.KAPPA,
    )
    states, read = marched(scenario(1.0, 4, drive, rupture=held))
    firm = math.pi**2 * driven.MODULUS / 4.0 * math.sqrt(AREA / math.pi) / 2.0
    assert_allclose(
        states[-1].drive.position,
        0.01 * UNIT * (1.0 / firm + 1.0 / driven.STIFF),
        rtol=1e-7,
    )
    assert_allclose(states[-1].drive.sheared, 0.01 * UNIT / firm, rtol=1e-12)
    assert_allclose(
        1.6e6 * math.pi**2 * 0.12e-3 / 2.0,
        1.0 / drive.yields(HalfSpace(1.6e6))[1] * 0.12e-3,
        rtol=1e-14,
    )
    assert_allclose(
        read["stored_energy"][-1],
        0.5 * 0.01 * UNIT * states[-1].drive.position[0],
        rtol=1e-6,
    )


def test_a_drive_is_refused_with_bonds_it_cannot_be_solved_with_and_a_run_ends_at_a_runaway():
    lens = {
        name: getattr(scenario(1.0, 4, spring(1.0)), name)
        for name in ("clock", "solid", "sphere", "contact")
    }
    for bonds, keys, place, cure in (
        (Unbroken(stress=1e5), {}, "drive", "mass"),
        (
            Unbroken(stress=1e5),
            {"mass": 1e-3, "contact": 1.0},
            "drive.contact_stiffness",
            "rigid",
        ),
        (Unbroken(), {"mass": 1e-3}, "bonds.stress", "stress"),
    ):
        with pytest.raises(BadInput) as refused:
            Scenario(
                **lens,
                adhesion=Adhesion(work=driven.WORK),
                bonds=bonds,
                drive=spring(1.0, **keys),
            )
        assert any(
            place in problem and cure in problem for problem in refused.value.problems
        )
    with pytest.raises(BadInput, match=r"contact\.reversible.*mass"):
        scenario(1.0, 4, spring(1.0), reversible=0.01)
    dataset = sim.run(scenario(12.0, 12, driven.force(0.28), members=2))
    assert dataset["friction_force"].dims == ("t",)
    assert_allclose(dataset["runaway_time"].isel(t=-1), 11.0634348789, rtol=1e-5)
    for name in (
        "slider_position",
        "speed",
        "spring_force",
        "stored_energy",
        "contact_radius",
        "bond_fraction",
    ):
        assert np.isfinite(dataset[name].isel(t=11)).all(), name
        assert np.isnan(dataset[name].isel(t=12)).all(), name
    assert "stage_speed" not in dataset
    assert any(
        "1 of 1 trajectories end because the slider lost stability" in line
        for line in lines_of(dataset)
    )


def test_bonds_that_a_stretch_breaks_snap_at_the_fold_of_their_force_again_and_again():
    # all bound, unstretched and never remade, z = e^(−s/ℓ) of them are left and bear n κ ℓ z (1 − z)
    stiff = 0.05
    left = (1.0 + math.sqrt(1.0 - 8.0 * stiff)) / 4.0  # where K + 2 z² − z = 0
    before = -math.log(left)
    stage = before + left * (1.0 - left) / stiff

    def lacks(way, stage=stage):
        return stiff * (stage - way) - math.exp(-way) * (1.0 - math.exp(-way))

    after = brentq(lacks, before + 0.1, stage)
    lost = quad(lacks, before, after)[0]
    for share, snapped in ((1.0 - 1e-6, 0.0), (1.0 + 1e-6, lost), (2.0, lost)):
        recipe = {"rupture": CutOff(stretch=STRETCH), "rebinding": 1e-9}
        states, read = marched(
            scenario(share * stage, 7, spring(stiff, 1.0, tolerance=1e-8), **recipe)
        )
        assert_allclose(
            read["dissipated_by_snaps"][-1] / driven.ENERGY, snapped, rtol=1e-6
        )
        if snapped:
            rests = brentq(
                lambda way, end=share * stage: lacks(way, end), after, 2.0 * stage
            )
            assert_allclose(reached(states[-1:], "position")[0, 0], rests, rtol=1e-6)
        assert residual(read) < 1e-7
    for keys in [{}, {"contact": 0.2}, {"contact": 0.05, "mass": 1e-3, "damping": 0.1}]:
        drive = spring(0.02, 3.0, **keys)
        _, read = marched(
            scenario(25.0, 100, drive, share=0.3, rupture=CutOff(stretch=STRETCH))
        )
        assert np.sum(np.diff(read["dissipated_by_snaps"]) > 0.0) > 2
        assert residual(read) < 1e-5


def test_friction_that_follows_the_speed_at_once_makes_cycles_touches_rest_or_is_stable_if_damped():
    bonds = Steady(critical_speed=STRETCH, stress=driven.COULOMB)
    for damping, speed, sticks, slips, least in (
        (0.01, 0.5, 1.62, 0.0189864408745, 0.19),
        (0.04, 1.0, 0.64, 0.0546142733837, 0.36),
    ):
        drive = pulled(speed=speed, damping=damping, tolerance=1e-8)
        # the first slip begins where the spring has come to the strength, each further one a cycle later
        for cycles, after, left in (
            (0, 0.0, 1.0),
            (0, slips, least),
            (4, sticks, 1.0),
            (4, sticks + slips, least),
        ):
            duration = (
                1.0 / speed
                + (slips if cycles else 0.0)
                + max(0, cycles - 1) * (sticks + slips)
                + after
            )
            states, read = marched(stuck(duration, 5, bonds, drive))
            assert_allclose(read["spring_force"][-1] / HELD, left, rtol=1e-6)
            assert residual(read) < 1e-7
        assert max(state.bonding.stress[0] for state in states) <= driven.COULOMB * (
            1.0 + 1e-12
        )
    mass, speed, time = 0.01, 0.3, 10.3
    drive = pulled(speed=speed, mass=mass, tolerance=1e-10)
    states, read = marched(
        stuck(1.0 / speed + time, 7, Unbroken(stress=driven.COULOMB), drive)
    )
    turn = time / math.sqrt(mass)
    assert_allclose(
        states[-1].drive.speed[0] / STRETCH, speed * (1.0 - math.cos(turn)), rtol=1e-5
    )
    assert_allclose(
        read["spring_force"][-1] / HELD,
        1.0 + speed * math.sqrt(mass) * math.sin(turn),
        rtol=1e-6,
    )
    assert residual(read) < 1e-8
    assert_allclose(
        read["dissipated_by_rupture"][-1],
        HELD * states[-1].drive.position[0],
        rtol=1e-10,
    )
    for stiffness in [0.1, 10.0]:
        # m v'' + (c + F') v' + K v = 0 with F' = -V_c/(V_c + V)^2
        fall, mass, step = 1.0 / 4.0, 1.0, 0.05
        bonds = Steady(critical_speed=STRETCH, stress=driven.COULOMB)
        for damping in (0.9 * fall, 1.1 * fall):
            stage = driven.jolted(1.0, step, 1.00001)
            drive = pulled(
                stiffness, stage, mass, damping, start="steady", tolerance=1e-11
            )
            scene = stuck(400 * step, 400, bonds, drive)
            passed = follow(
                scene, MemberNoise.of(scene.seed, np.arange(1)), None, range(401)
            )[1]
            rate, _ = driven.mode_of(
                passed.speed[2:, 0] / STRETCH, step, math.sqrt(stiffness / mass), 2
            )
            assert_allclose(rate, 0.5 * (fall - damping) / mass, rtol=1e-3)
