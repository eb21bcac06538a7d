"""Laws that a slider on bonds of any model obeys: limits of the spring, balances, pull-off."""

import functools
import itertools
import math
import re

import numpy as np
import pytest
from helpers import driven
from helpers.driven import (
    AREA,
    STRETCH,
    UNIT,
    force,
    jkr,
    march,
    marched,
    pulled,
    residual,
    scenario,
    spring,
    stuck,
)
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

import sim
from sim.ensemble.diagnosis import stability
from sim.laws.reversible import mean_stress_energy, radius_at_load_reversible
from sim.parts.bonds.models import Cohort, FirstMoment, Rate, Steady, Tracked
from sim.parts.bonds.rupture import Bell
from sim.parts.drive import Start, Steady as AtSpeed
from sim.units.notation import engineering
from tests.test_total import check_cuts, run

MOMENT = FirstMoment
COHORTS = functools.partial(Cohort, tolerance=1e-4)
FINE = functools.partial(Cohort, tolerance=1e-6)
SITES, MANY = (functools.partial(Tracked, sites=sites) for sites in (100, 300))
BODY = {"mass": 1e-3, "damping": 1e-3}


@pytest.mark.parametrize(
    ("make", "tolerance"),
    [(MOMENT, 1e-6), (functools.partial(Cohort, tolerance=1e-8), 1e-8)],
)
def test_a_stage_that_begins_in_steady_sliding_keeps_the_stress_of_a_prescribed_speed(
    make, tolerance
):
    lens = {"share": 0.3, "start": "steady", "make": make}
    for keys in ({}, {"mass": 1e-3, "damping": 2e-3, "contact": 0.5}):
        drives = (
            spring(1.0, start="steady", tolerance=tolerance, **keys),
            AtSpeed(speed=10.0 * STRETCH),
        )
        one, other = (
            list(march(scenario(1.0, 4, drive, **lens), np.arange(1)))[-1]
            for drive in drives
        )
        assert_allclose(one.bonding.stress, other.bonding.stress, rtol=1e-8)
        assert_allclose(one.drive.speed, other.drive.speed, rtol=1e-8)


@pytest.mark.parametrize("make", [MOMENT, functools.partial(Cohort, tolerance=1e-7)])
def test_a_stiff_spring_becomes_the_prescribed_drive_as_one_over_its_stiffness(make):
    prescribed = scenario(1.0, 10, Start(rest=1e-12, speed=10.0 * STRETCH), make=make)
    exact, errors = (
        np.array(
            [state.bonding.stress[0] for state in march(prescribed, np.arange(1))]
        ),
        [],
    )
    for stiffness in (40.0, 4e2, 4e3):
        states, _ = marched(
            scenario(1.0, 10, spring(stiffness, tolerance=1e-8), make=make)
        )
        errors.append(
            np.max(np.abs([state.bonding.stress[0] for state in states] - exact))
            / max(exact)
        )
        assert errors[-1] < 10.0 / (stiffness / 0.0390213)
    assert_allclose(np.divide(errors[:-1], errors[1:]), 10.0, rtol=0.05)


@pytest.mark.parametrize("make", [MOMENT, FINE])
@pytest.mark.parametrize(
    ("x0", "time", "later"),
    [
        (0.5, 0.559773594776, ((5, 0.858292500361), (9, 1.90289022829))),
        (2.0, 0.0489005107, ()),
    ],
)
def test_bonds_that_are_not_remade_share_one_stretch_until_they_run_away(
    make, x0, time, later
):
    # E1(x(t)) = E1(x0) − k0 t
    scene = scenario(
        2.0 * time,
        20,
        force(x0, tolerance=1e-9),
        rebinding=0.0,
        start="bonded",
        make=make,
    )
    states = list(march(scene, np.arange(1)))
    assert_allclose(states[-1].drive.runaway_time, time, rtol=1e-7)
    for place, stretch in later:
        # the force is constant, so that the stretch is its share per bond
        bonding = states[place].bonding
        assert_allclose(x0 / bonding.fraction[0], stretch, rtol=1e-7)


@pytest.mark.parametrize("make", [MOMENT, COHORTS])
def test_springs_from_soft_to_stiff_keep_the_energies_balanced(make):
    for stiffness in (4e-8, 1.0, 4e4):
        for keys in ({}, {"damping": 1e-3}, {"mass": 1e-9}, {"contact": 1.0}):
            _, read = marched(
                scenario(20.0, 5, spring(stiffness, **keys), share=0.3, make=make)
            )
            assert residual(read) < 1e-5, (stiffness, keys)


@pytest.mark.parametrize(
    ("make", "keys"),
    [
        (MOMENT, {}),
        (MOMENT, {"contact": 0.2, "mass": 1e-4, "viscosity": 1e-3}),
        (COHORTS, BODY),
        (COHORTS, {"contact": 0.2, "viscosity": 1e-3}),
        (SITES, {}),
        (SITES, BODY),
    ],
)
def test_a_member_is_the_same_alone_resumed_in_the_middle_of_a_slip_and_with_few_records(
    make, keys
):
    scene = scenario(4.0, 200, spring(0.02, **keys), share=0.5, make=make, members=3)
    end, course = run(scene, range(3), range(201))
    way = np.diff(course.position[:, 0])
    assert np.max(way) > 3.0 * 0.2 * STRETCH  # three times as fast as the stage
    check_cuts(scene, course, end, cut=int(np.argmax(way)))


@pytest.mark.parametrize(
    ("make", "keys", "start"),
    [
        (MOMENT, {"damping": 1e-2}, "bonded"),
        (COHORTS, {}, "empty"),
        (COHORTS, BODY, "steady"),
        (MANY, {}, "bonded"),
    ],
)
def test_a_stage_that_rests_turns_and_stops_keeps_the_energies_balanced_and_the_signs(
    make, keys, start
):
    speeds = (10.0, 10.0, -10.0, -10.0, 0.0, 0.0)
    stage = {
        "time": (0.0, 2.0, 2.0, 4.0, 4.0, 9.0),
        "value": tuple(v * STRETCH for v in speeds),
    }
    drive = spring(0.2, stage, start_after=1.0, **keys)
    states, read = marched(
        scenario(
            8.0, 16, drive, share=0.0 if make is MANY else 0.5, make=make, start=start
        )
    )
    assert_allclose(
        read["stage_position"][[2, 6, 10, 16]] / STRETCH,
        [0.0, 20.0, 0.0, 0.0],
        atol=1e-12,
    )
    assert states[6].bonding.stress[0] > 0.0 > states[10].bonding.stress[0]
    assert abs(states[16].bonding.stress[0]) < 0.2 * abs(states[10].bonding.stress[0])
    assert residual(read) < 1e-5


CARRIED = functools.partial(Cohort, tolerance=1e-4, area="carried")


#: Bonds without a stretch.
STICKING = Rate(critical_speed=0.5 * STRETCH, rebinding_rate=2.0, stress=1e5)
COULOMB = Steady(critical_speed=STRETCH, stress=driven.COULOMB)
VISCOUS = {"viscosity": 0.1 * driven.COULOMB / STRETCH}


@pytest.mark.parametrize(
    ("make", "keys"),
    [
        *((make, {}) for make in (MOMENT, COHORTS, SITES, CARRIED)),
        (MOMENT, {"viscosity": 0.1}),
        *itertools.product(
            (STICKING, COULOMB), ({"damping": 0.1}, {"mass": 0.05}, VISCOUS)
        ),
    ],
)
def test_a_contact_that_is_pulled_off_lets_the_slider_go_and_takes_its_bonds_up_again(
    make, keys
):
    pull = driven.PULLED_OFF
    if make is SITES:  # a load at which pull-off is not left to chance
        load = pull["load"] | {
            "value": tuple(min(value, 2.0 * value) for value in pull["load"]["value"])
        }
        pull = pull | {"load": load}
    if callable(make):
        states, read = marched(
            scenario(3.0, 30, spring(1.0, **keys), share=0.5, make=make, **pull)
        )
    else:
        states, read = marched(
            stuck(3.0, 30, make, pulled(1.0, 1.0, **keys), share=0.5, **pull)
        )
    open_ = np.isnan([state.contact.radius[0] for state in states])
    assert open_[11 if callable(make) else 15 : 20].all() and not open_[21:].any()
    assert np.isnan(read["runaway_time"]).all() and residual(read) < 1e-5
    # neither its place nor its pull shows a push back
    if not callable(make) and "mass" not in keys:
        positions = np.array([state.drive.position[0] for state in states])
        assert np.min(np.diff(positions)[20:]) >= 0.0
        friction = [
            state.bonding.stress[0] * np.pi * state.contact.radius[0] ** 2
            for state in states
        ]
        pushed = np.where(open_, 0.0, friction - read["spring_force"])
        assert np.max(pushed) <= 1e-5 * np.max(read["spring_force"])
    # nothing bears the force in an open contact
    if not {"damping", "mass"} & keys.keys():
        assert_allclose(read["spring_force"][16:20], 0.0, atol=1e-12 * driven.UNIT)
        assert read["spring_force"][-1] > 0.05 * driven.UNIT
        # the friction of a closed contact is what the spring bears, at the record of its closing as well
        friction = [
            state.bonding.stress[0] * np.pi * state.contact.radius[0] ** 2
            for state in states
        ]
        missing = np.where(open_, 0.0, friction - read["spring_force"])
        # the motion has 1e-6
        assert_allclose(missing, 0.0, atol=1e-5 * np.max(read["spring_force"]))


@pytest.mark.parametrize(
    ("make", "keys"),
    [
        (MOMENT, {"mass": 0.1, "damping": 0.1}),
        (FINE, {"contact": 50.0, "viscosity": 1.0}),
        (MANY, {"mass": 0.1, "damping": 0.1}),
    ],
)
def test_a_contact_that_pays_for_its_mean_stress_shrinks_to_that_of_hertz_within_the_sub_steps(
    make, keys
):
    # strong bonds: at their peak the whole energy of the mean stress is more than adhesion can pay
    strong = {
        "make": lambda **recipe: make(
            **(recipe | {"site_density": 100.0 * driven.DENSITY})
        ),
        "share": 0.5,
    }
    states, read = marched(
        scenario(4.0, 80, spring(2.0, **keys), reversible=1.0, **strong)
    )
    radii = np.array([state.contact.radius[0] for state in states[1:]])
    assert_allclose([state.drive.radius[0] for state in states[1:]], radii, rtol=1e-12)
    hertz = jkr.radius_at_load(driven.LOAD, 0.0, driven.R, driven.MODULUS)
    assert_allclose(np.min(radii), hertz, rtol=1e-12)
    assert np.max(radii) > 1.5 * hertz
    assert residual(read) < 3e-5  # of 300 bonds each breaks at a step's end


#: A body that lags behind a contact much softer than the bonds, of which the interface alone slips.
LAGS = {"speed": 1000.0, "damping": 1e-3, "contact": 4e-3}
LIGHT = {"speed": 1000.0, "mass": 1e-6, "contact": 4e-3}


@pytest.mark.parametrize(
    ("make", "share", "duration", "stiffness", "keys", "delay", "most"),
    [
        (MOMENT, 0.0, 2.5, 2.5e-4, LIGHT, "viscosity", 1e-8),
        (MOMENT, 1.0, 2.5, 2.5e-4, LIGHT, "viscosity", 1e-8),
        (MOMENT, 0.5, 2.5, 2e-4, {"speed": 1000.0}, "damping", 1e-8),
        (Cohort, 0.5, 2.5, 2e-4, {"speed": 1000.0}, "damping", 1e-7),
        (Cohort, 0.0, 1.0, 2e-3, LAGS, "viscosity", 1e-7),
        (Cohort, 0.5, 1.0, 2e-3, LAGS | {"mass": 1e-4}, "viscosity", 1e-7),
    ],
)
def test_bonds_that_break_ever_faster_slip_at_once_which_is_the_limit_of_little_damping_or_viscosity(
    make, share, duration, stiffness, keys, delay, most
):
    # a soft spring stretches the last bonds to thousands of their unit, and e to that power is their rate
    courses = []
    for size in (0.0, 0.1, 1.0):
        drive = spring(stiffness, **keys, **{delay: size * most})
        states, read = marched(scenario(duration, 5, drive, share=share, make=make))
        assert np.isnan(read["runaway_time"]).all() and residual(read) < 1e-5
        assert (read["dissipated_by_snaps"][-1] > 0.0) == (size == 0.0)
        courses.append(
            np.stack(
                [
                    read["spring_force"] / driven.UNIT,
                    [state.bonding.fraction[0] for state in states],
                ]
            )
        )
    near, far = (np.max(np.abs(course - courses[0]), axis=1) for course in courses[1:])
    assert np.all(far < 0.01) and np.all(near < 0.3 * far)


def test_a_check_shows_below_which_spring_the_slider_oscillates():
    for scene, onset, frequency in (
        (scenario(1.0, 4, spring(1.0)), 0.0390213 * driven.STIFF, 4.691569),
        (
            scenario(1.0, 4, spring(1.0), make=COHORTS),
            0.0295565 * driven.STIFF,
            4.25784,
        ),
        (
            stuck(1.0, 4, STICKING, pulled(1.0, 1.0, 0.01, 0.05)),
            2.2733333 * driven.HELD / STRETCH,
            11.1355287,
        ),
    ):
        text = sim.check(scene).partition("\nslider\n")[2]
        rows = dict(
            re.split(" {2,}", line.strip(), maxsplit=1)
            for line in text.partition("\n\n")[0].splitlines()
        )
        assert rows["oscillates below"].startswith(f"{onset:.4g} N/m")
        ends = f"with {frequency / (2.0 * math.pi):.4g} Hz"
        assert rows["oscillates below"].endswith(ends)
    # first moments whose friction falls at once with the speed: no spring has a frequency there
    falling = {
        "clock": {"duration": "1 s", "step": "2 ms"},
        "solid": {"youngs_modulus": "30 kPa"},
        "sphere": {"radius": "0.5 mm"},
        "adhesion": {"work": "30 mJ/m^2", "bond_share": 0.3},
        "contact": {"load": "0.1 mN"},
        "drive": {"model": "spring", "stage": "1 mm/s", "stiffness": "2 N/m"},
        "bonds": {
            "model": "rate",
            "rupture": {
                "model": "bell",
                "critical_speed": "0.2 mm/s",
                "bell_force": "4 pN",
                "stress": "4 kPa",
            },
            "bond_stiffness": "1 uN/m",
            "rebinding_ratio": 10,
        },
    }
    assert re.search(
        r"oscillates below +inf N/m of the spring \(inf: with any spring\), at 1 mm/s\n",
        sim.check(falling),
    )
    assert re.search(
        f"oscillates below +0 N/m of the spring: with no spring, at {2.0 * STRETCH:.4g} m/s\n",
        sim.check(stuck(1.0, 4, STICKING, pulled(1.0, 2.0, damping=10.0))),
    )


def test_a_check_shows_the_speeds_that_are_unstable_behind_this_spring():
    mass, damping, rate, critical = 0.01, 0.05, 2.0, 0.5

    def excess(speed, stiffness):
        """K_c/K − 1 of bonds of the linear rate equation."""
        pace = rate * (1.0 + speed / critical)
        falls = rate / critical / (1.0 + speed / critical)
        onset = (damping + mass * pace) * (falls - damping * pace) / damping
        return onset / stiffness - 1.0

    for stiffness in (1.0, 3.0):
        scene = stuck(1.0, 4, STICKING, pulled(stiffness, 1.0, mass, damping))
        ((low, high),) = stability(scene).unstable
        last = brentq(excess, 1e-3, 10.0, args=(stiffness,))
        assert low == 0.0
        # the law is met to 1e-5 of the stiffness, and falls faster than the square root of the speed
        assert_allclose(high / STRETCH, last, rtol=2e-5)
        text = f"unstable if slow, and stable again above {engineering(high, 'm/s')}"
        assert text in sim.check(scene)
    firm = stuck(1.0, 4, STICKING, pulled(6.0, 1.0, mass, damping))
    assert stability(firm).unstable == []
    assert "unstable" not in sim.check(firm)


#: Stress of a unit of stretch; k_t is a fifth of the stiffness of all bonds, of which next to none break.
STRESS, SOFT = driven.DENSITY * driven.KAPPA * STRETCH, 5.0
LASTING = {
    "rupture": Bell(zero_force_rate=1e-30, bell_force=driven.BELL.bell_force),
    "reversible": 1.0,
}


def friction(slip, load=driven.LOAD):
    """Force of lasting bonds after a slip, in their units, where adhesion pays for all of the mean stress."""
    radius = radius_at_load_reversible(
        load, driven.WORK, STRESS * slip, 1.0, driven.R, driven.MODULUS
    )
    return slip * np.pi * radius**2 / AREA


def place(slip, softness=SOFT, load=driven.LOAD):
    """Place of the body in equilibrium with a slip; of the stage, if the spring is added to the ``softness``."""
    return slip + softness * friction(slip, load)


def cusp(load=driven.LOAD):
    """Slip from which on the contact is Hertz's."""
    hertz = jkr.radius_at_load(load, 0.0, driven.R, driven.MODULUS)
    return math.sqrt(driven.WORK / mean_stress_energy(hertz, STRESS, driven.MODULUS))


def held(speeds, make, load=driven.LOAD, **body):
    """States and readings of lasting bonds while the stage goes at each of four speeds for a second."""
    stage = {
        "time": (0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0),
        "value": tuple(np.repeat(speeds, 2) * STRETCH),
    }
    drive = spring(1.0, stage, contact=1.0 / SOFT, tolerance=1e-8, damping=1e-3, **body)
    return marched(scenario(4.0, 8, drive, make=make, load=load, **LASTING))


@pytest.mark.parametrize("make", [MOMENT, FINE, SITES])
@pytest.mark.parametrize("mass", [0.0, 1e-8])
def test_the_interface_slips_at_once_to_a_hertzian_contact_and_back_where_adhesion_pays_for_the_stress(
    make, mass
):
    # while the place rises the slip jumps at its maximum, while it falls at its minimum
    top, end = (
        minimize_scalar(
            lambda slip: -place(slip), bounds=(0.0, cusp()), method="bounded"
        ).x,
        10.0 * cusp(),
    )
    ahead = brentq(lambda slip: place(slip) - place(top), cusp(), end)
    behind = brentq(lambda slip: place(slip) - place(cusp()), 0.0, top)
    states, read = held([130.0, 0.0, -70.0, 0.0], make, mass=mass)
    lost = within = 0.0
    for k, stage, among, (first, last) in (
        (4, 130.0, (cusp(), end), (top, ahead)),
        (8, 60.0, (0.0, top), (cusp(), behind)),
    ):
        slip = brentq(lambda slip, stage=stage: place(slip, SOFT + 1.0) - stage, *among)
        assert_allclose(states[k].drive.position / STRETCH, place(slip), rtol=1e-6)
        assert_allclose(states[k].drive.spring_force / UNIT, friction(slip), rtol=1e-6)
        # 128 midpoints of the power are off by at most h²/8 times the total variation of its slope
        slips = np.linspace(first, last, 2001)
        lost += quad(
            lambda slip, at=first: (place(at) - place(slip)) / SOFT,
            first,
            last,
            points=[cusp()],
        )[0]
        bent = np.sum(np.abs(np.diff(np.gradient(place(slips) / SOFT, slips))))
        within += ((last - first) / 128.0) ** 2 / 8.0 * bent
        assert_allclose(
            read["dissipated_by_snaps"][k] / driven.ENERGY, lost, rtol=0.0, atol=within
        )
    assert residual(read) < 1e-7


@pytest.mark.parametrize("make", [MOMENT, FINE, SITES])
def test_a_load_that_halves_for_a_while_leaves_a_contact_hertzian(make):
    whole, half = driven.LOAD, 0.5 * driven.LOAD
    load = {
        "time": (0.0, 2.0, 2.0, 3.0, 3.0, 4.0),
        "value": (whole, whole, half, half, whole, whole),
    }
    states, read = held([106.0, 0.0, 0.0, 0.0], make, load)
    for k, at, low, high in (
        (3, whole, 0.0, 25.0),
        (5, half, cusp(half), 1e3),
        (8, whole, cusp(), 1e3),
    ):
        slip = brentq(
            lambda slip, at=at: place(slip, SOFT + 1.0, at) - 106.0, low, high
        )
        assert_allclose(
            states[k].drive.spring_force / UNIT, friction(slip, at), rtol=1e-6
        )
    assert residual(read) < 1e-7


def test_a_slip_to_a_hertzian_contact_is_the_limit_of_ever_less_viscosity_and_keeps_its_energies():
    # force at 89 and 100 ms by an integrator of the equations with viscosities of 10 and 1 Pa s/m, whose difference
    # falls as the viscosity to the power of 2/3: extrapolated to none
    rates = {
        "rupture": {"model": "constant", "rate": "24 1/s"},
        "rebinding_rate": "84 1/s",
    }
    bonds = {
        "model": "rate",
        "bond_stiffness": "0.6 uN/m",
        "site_density": "3.8e16 1/m^2",
    } | rates
    drive = {
        "model": "spring",
        "stage": "1.9 mm/s",
        "stiffness": "96 N/m",
        "mass": "1.07 g",
    }
    lens = {"solid": {"shear_modulus": "0.233 MPa"}, "sphere": {"radius": "0.309 mm"}}
    lens |= {
        "clock": {"duration": "0.1 s", "step": "1 ms"},
        "adhesion": {"work": "32.6 mJ/m^2", "bond_share": 0},
    }
    lens |= {"contact": {"load": "33 uN", "reversible": 0.0039}, "bonds": bonds}
    none, some, lost = [0.7890906e-3, 0.8940730e-3], [0.78909e-3, 0.8941e-3], []
    for viscosity, tolerance, exact, off in (
        (0.0, 1e-9, none, 1e-7),
        (1e2, 1e-6, some, 2e-4),
        (1e4, 1e-6, some, 2e-4),
    ):
        keys = {
            "contact_stiffness": "7.5 N/m",
            "viscosity": viscosity,
            "tolerance": tolerance,
        }
        dataset = sim.run(sim.load(lens | {"drive": drive | keys}))
        assert_allclose(dataset["friction_force"][[89, 100]], exact, rtol=off)
        assert (
            residual(
                {
                    name: dataset[name].to_numpy()
                    for name in driven.READINGS
                    if name in dataset
                }
            )
            < 10.0 * tolerance
        )
        lost.append(float(dataset["dissipated_by_area"][-1]))
    assert_allclose(lost[1], lost[2], rtol=1e-3)


@pytest.mark.parametrize("model", ["rate", "cohort", "tracked"])
def test_a_contact_stays_as_it_was_when_the_motion_ended_also_if_the_run_is_resumed(
    model,
):
    # nothing holds a body in an open contact against a force: its motion ends at once, and the mount goes on
    lens = {"model": model, "sites": 50} if model == "tracked" else {"model": model}
    scenario = sim.load(
        {
            "clock": {"duration": 0.2, "step": 1e-3},
            "solid": {"shear_modulus": 1.6e6},
            "sphere": {"radius": 2e-3},
            "adhesion": {"work": 42e-3},
            "contact": {"indentation": {"from": -5e-6, "to": 2e-6, "cycles": 1}},
            "drive": {"model": "force", "force": 1e-3},
            "bonds": lens
            | {
                "rupture": {
                    "model": "bell",
                    "zero_force_rate": 3.0,
                    "bell_force": 4e-12,
                },
                "bond_stiffness": 2e-6,
                "rebinding_rate": 20.0,
                "site_density": 7e13,
            },
            "ensemble": {"members": 2},
        }
    )
    noise, cut = driven.MemberNoise.of(scenario.seed, np.arange(2)), 40
    end, course = driven.follow(scenario, noise, None, range(201))
    middle, _ = driven.follow(scenario, noise, None, range(cut + 1))
    _, resumed = driven.follow(scenario, noise, middle, range(cut + 1, 201))
    assert np.all(end.drive.runaway_time == 0.0)
    assert np.isnan(course.radius).all() and np.isnan(resumed.radius).all()
    assert np.array_equal(course.work[cut + 1 :], resumed.work, equal_nan=True)
    assert (course.work == course.work[0]).all()


@pytest.mark.parametrize("edge", [{}, {"front_speed": 1.0, "model": "rate_dependent"}])
def test_a_slider_that_loses_stability_is_not_pulled_off(edge):
    # the amplitude follows the speed, which is unknown from then on, while a growing load presses the contact
    fluctuating = {
        "model": "modal",
        "cell": 2.4e-4,
        "spectrum": {"model": "band", "rms": 3e4, "longest": 120e-6, "shortest": 60e-6},
        "correlation": {"model": "time", "time": 2e-3},
        "amplitude": {"model": "onset", "speed": 1e-3, "width": 0.3, "floor": 0.1},
    }
    scenario = sim.load(
        {
            "clock": {"duration": 0.02, "step": 1e-3},
            "solid": {"shear_modulus": 1.6e6},
            "sphere": {"radius": 2e-3},
            "adhesion": {"work": 42e-3},
            "contact": {"load": {"from": 1e-3, "to": 2e-3}} | edge,
            "drive": {"model": "force", "force": {"from": 0.0, "to": 5e-3}},
            "bonds": {
                "model": "rate",
                "rupture": {
                    "model": "bell",
                    "zero_force_rate": 3.0,
                    "bell_force": 4e-12,
                },
                "bond_stiffness": 2e-6,
                "rebinding_rate": 20.0,
                "site_density": 7e13,
            },
            "shear": fluctuating,
        }
    )
    noise = driven.MemberNoise.of(scenario.seed, np.arange(2))
    end, course = driven.follow(scenario, noise, None, range(21))
    assert np.all(end.drive.runaway_time < 0.01)
    assert np.all(course.radius > 0.0) and np.isnan(course.detached).all()
