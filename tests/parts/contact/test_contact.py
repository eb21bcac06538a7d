"""The contact in scenes: its control in time, pull-off and return, dissipation, masking, discs."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from helpers.parts import run
from helpers.scenes import (
    Adhesion,
    Clock,
    Onset,
    Scenario,
    Solid,
    Sphere,
    bonds,
    drive,
    march,
    records,
    scene,
    shear,
)
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import brentq

import sim
from sim.laws import jkr
from sim.parts.contact import Equilibrium, RateDependent, front
from sim.parts.contact.balance import elastic_energy
from sim.solid import HalfSpace
from sim.spectrum.families import (
    AnisotropicGaussian,
    Band,
    Gaussian,
    Ripple,
    SelfAffine,
    VonKarman,
)
from sim.spectrum.radial import Margin, disc_energy, marginal_energy
from sim.units.errors import BadInput

WORK = 1.0 / math.pi


def maugis(contact, steps=100, duration=1.0, **parts):
    """A scene in Maugis's units: R, pi w and K = 4 E*/3 are 1."""
    return Scenario(
        clock=Clock(duration=duration, step=duration / steps),
        solid=Solid(shear_modulus=0.1875),
        sphere=Sphere(radius=1.0),
        adhesion=Adhesion(work=WORK),
        contact=contact,
        **parts,
    )


def course(scenario, *names):
    """Recorded quantities of the first member at every step."""
    return [values[:, 0] for values in records(scenario, *names)]


HELD = {
    "load": ({}, "normal_load"),
    "indentation": ({}, "indentation"),
    "displacement": ({"stiffness": 2.0}, "displacement"),
}


def test_the_control_takes_the_values_of_its_course_at_the_clock_times():
    table = {
        "time": [-1.0, 0.0, 0.4, 0.4, 0.8, 1.0],
        "value": [9.0, 1.0, 2.0, 0.5, 1.5, 1.5],
    }
    courses = [
        ({"from": 0.3, "to": 2.7}, 13, np.linspace(0.3, 2.7, 14)),
        (
            {"from": 3.0, "to": 1.0, "cycles": 2},
            8,
            [3.0, 2.0, 1.0, 2.0, 3.0, 2.0, 1.0, 2.0, 3.0],
        ),
        (
            {"from": 1e-3, "to": 10.0, "scale": "log"},
            8,
            10.0 ** (-3.0 + np.arange(9) / 2.0),
        ),
        (table, 5, [1.0, 1.5, 0.5, 1.0, 1.5, 1.5]),
    ]
    for (control, (more, variable)), (held, steps, exact) in product(
        HELD.items(), courses
    ):
        (values,) = course(
            maugis(Equilibrium(**{control: held}, **more), steps), variable
        )
        assert_allclose(values, exact, rtol=1e-14, atol=0)


def on_the_branch(a, stiffness):
    """Load, indentation and displacement of an equilibrium."""
    load, depth = a**3 - math.sqrt(6.0 * a**3), a**2 - 2.0 / 3.0 * math.sqrt(6.0 * a)
    return load, depth, depth + (load / stiffness if stiffness else math.nan)


def fold(stiffness):
    """Radius of the last contact: P'(a) + k delta'(a) = 0."""

    def slope(a):
        load = 3.0 * a**2 - 1.5 * math.sqrt(6.0 * a)
        depth = 2.0 * a - math.sqrt(6.0 * a) / (3.0 * a)
        return depth if math.isinf(stiffness) else load + stiffness * depth

    return brentq(slope, 0.5, 1.2, xtol=1e-15)


def test_the_contact_opens_between_the_last_step_before_the_limit_and_the_next():
    displaced = [("displacement", k) for k in (0.1, 1.0, 5.0, 100.0)]
    for control, stiffness in [("load", 0.0), ("indentation", math.inf), *displaced]:
        a = fold(stiffness)
        last = on_the_branch(a, stiffness)[list(HELD).index(control)]
        values = np.linspace(last + 3e-12, last - 3e-12, 13)
        machine = {"stiffness": stiffness} if control == "displacement" else {}
        scenario = maugis(
            Equilibrium(**{control: {"from": values[0], "to": values[-1]}}, **machine),
            12,
            6.0,
        )
        radius, when = course(scenario, "contact_radius", "detachment_time")
        first_open = int(np.argmax(radius == 0.0))
        assert values[first_open] - 1e-13 <= last <= values[first_open - 1] + 1e-13
        assert_allclose(radius[first_open - 1], a, rtol=1e-5)
        assert np.all(radius[first_open:] == 0.0)
        assert np.isnan(when[:first_open]).all()
        assert np.all(when[first_open:] == scenario.times.at(first_open))


#: Exact in binary at 128 steps; zero on the way back comes after 24 and 56 of 64.
BACK = {"from": 1.0, "to": -3.0, "cycles": 2}


def test_cycles_through_pull_off_are_alike_and_a_free_sphere_jumps_in_where_it_touches():
    for held, radius in [
        ({"indentation": BACK}, (8.0 / 3.0) ** (1.0 / 3.0)),
        ({"load": BACK}, 6.0 ** (1.0 / 3.0)),
        ({"displacement": BACK, "stiffness": 2.0}, None),
    ]:
        scenario = maugis(Equilibrium(**held, after_pull_off="reattach"), 128)
        recorded, when = course(scenario, "contact_radius", "detachment_time")
        returns = np.nonzero((recorded[:-1] == 0.0) & (recorded[1:] > 0.0))[0] + 1
        assert returns.tolist() == [56, 120]
        assert_allclose(recorded[returns], radius or touching(2.0), rtol=1e-13)
        assert len(set(when[~np.isnan(when)])) == 2
    for policy, cycles in [("stay_open", 8), ("reattach", 128), ("stop", 8)]:
        held = {"indentation": {"from": 1.0, "to": -2.0, "cycles": cycles}}
        scenario = maugis(Equilibrium(**held, after_pull_off=policy), cycles * 32)
        radius, lost = course(scenario, "contact_radius", "dissipated_energy")
        if policy == "reattach":
            each = radius[:-1].reshape(cycles, 32)
            assert_array_equal(each, np.broadcast_to(each[0], each.shape))
            assert_allclose(
                lost[32::32], lost[32] * np.arange(1, cycles + 1), rtol=1e-13
            )
        else:
            assert lost[-1] == lost[32] > 0.0


def test_a_contact_that_begins_out_of_touch_jumps_in_whatever_follows_a_pull_off():
    for policy, model, control in product(
        ["stay_open", "reattach", "stop"], [Equilibrium, RateDependent], HELD
    ):
        held = {control: {"from": -4.0, "to": 4.0, "cycles": 1}} | HELD[control][0]
        edge = {"front_speed": 1e3} if model is RateDependent else {}
        scenario = maugis(model(**held, **edge, after_pull_off=policy), 64)
        radius, closed, when = course(
            scenario, "contact_radius", "in_contact", "detachment_time"
        )
        assert_array_equal(radius[:16], 0.0)
        # its edge begins to run where the sphere touches
        late = 1 if model is RateDependent else 0
        assert_array_equal(closed[16 + late : 49], 1.0)
        assert_array_equal(closed[56:], 0.0)
        assert np.isnan(when[:49]).all()
        assert np.isfinite(when[-1])
        assert_array_equal(np.isnan(radius[56:]), policy == "stop")


def touching(stiffness):
    """Radius at a displacement of zero."""
    return brentq(lambda a: on_the_branch(a, stiffness)[2], 1.3, 2.0, xtol=1e-15)


def released(a, stiffness):
    """Energy of an equilibrium over that of the open contact at the same displacement."""
    load, depth, _ = on_the_branch(a, stiffness)
    return (
        elastic_energy(a, depth, maugis(Equilibrium(load=1.0)).bodies)
        + load**2 / (2.0 * stiffness)
        - a**2
    )


@pytest.mark.parametrize("stiffness", [0.3, 5.0, math.inf])
@pytest.mark.parametrize("steps", [400, pytest.param(4000, marks=pytest.mark.verify)])
def test_the_loop_of_load_and_displacement_holds_what_is_dissipated(steps, stiffness):
    """Each jump is taken at its own place in the step, up to the root of a rounding at the fold. The trapezoidal rule
    takes half of either jump, at which at most the pull-off load of 1.5 acts, and is of second order elsewhere but at
    the fold, where the load has a square root: of order 3/2."""
    last = fold(stiffness)
    exact = released(last, stiffness) - released(touching(stiffness), stiffness)
    reach = (
        2.0 - 2.0 * on_the_branch(last, stiffness)[2]
        if math.isfinite(stiffness)
        else 3.0
    )
    held = {"from": 1.0, "to": 1.0 - reach, "cycles": 1}
    control = (
        {"indentation": held}
        if math.isinf(stiffness)
        else {"displacement": held, "stiffness": stiffness}
    )
    scenario = maugis(Equilibrium(**control, after_pull_off="reattach"), steps)
    load, displacement, lost = course(
        scenario, "normal_load", "displacement", "dissipated_energy"
    )
    loop = float(np.sum(0.5 * (load[1:] + load[:-1]) * np.diff(displacement)))
    width = 2.0 * reach / steps
    assert lost[-1] > 0.5
    assert_allclose(lost[-1], exact, rtol=1e-7)
    assert_allclose(loop, lost[-1], rtol=0.0, atol=6.0 * width)


def test_a_partly_reversible_contact_comes_off_at_its_own_fold_and_keeps_the_energy_of_its_stress():
    """The energy of adhesion is the integral of the work left: -w0 A + alpha 4 tau^2 a^3/E*."""
    alpha = 0.2
    for fall, control in product([0.1, 0.5, 1.0], ["load", "indentation"]):
        # w = w0 (1 - c a): the stress at which alpha 6 tau^2/(pi E*) = c w0; the fold on a fine scan of radii
        tau = math.sqrt(fall * WORK * math.pi * 0.75 / (6.0 * alpha))
        a = np.linspace(1e-3, 0.999 / fall if fall > 0.5 else 1.5, 400_001)
        depth = a**2 - np.sqrt(2.0 * math.pi * WORK * (1.0 - fall * a) * a / 0.75)
        values = {"load": 2.0 * 0.75 * a * (depth - a**2 / 3.0), "indentation": depth}[
            control
        ]
        place = int(np.argmin(values))
        ends = {"from": values[place] + 6e-8, "to": values[place] - 6e-8}
        scenario = maugis(
            Equilibrium(**{control: ends}, reversible=alpha),
            12,
            bonds=bonds.Unbroken(stress=tau),
        )
        names = "contact_radius", "work_of_adhesion", "normal_load", "dissipated_energy"
        radius, work, load, lost = course(scenario, *names)
        assert_array_equal(radius[8:], 0.0)
        closed = radius[:5]
        assert np.all(closed > 0.0)
        assert_allclose(work[:5], WORK * (1.0 - fall * closed), rtol=1e-13)
        assert_allclose(
            (closed**3 - load[:5]) ** 2 / (6.0 * closed**3) * WORK, work[:5], rtol=1e-12
        )
        if control == "indentation":
            adhesive = (
                math.pi * a[place] ** 2 * WORK
                - alpha * 4.0 * tau**2 * a[place] ** 3 / 0.75
            )
            exact = elastic_energy(a[place], values[place], scenario.bodies) - adhesive
            assert lost[0] == 0.0
            assert_allclose(lost[-1], exact, rtol=2e-5)


def test_a_fast_edge_or_a_free_sphere_jumps_in_where_equilibrium_does_and_dissipates_the_same():
    back = {"from": 1.0, "to": -3.0, "cycles": 1}
    names = "contact_radius", "detachment_time", "dissipated_energy"

    def equilibrium_and_edge(steps, speed, **control):
        contacts = Equilibrium(**control), RateDependent(**control, front_speed=speed)
        return (
            course(maugis(replace(contact, after_pull_off="reattach"), steps), *names)
            for contact in contacts
        )

    settled, fast = equilibrium_and_edge(128, 1e12, load=back)
    # the sphere touches at the end of one step, and at the fold itself nothing drives the edge
    late = np.isin(np.arange(129), (40, 112))
    assert settled[0][112] > 0.0
    assert_allclose(fast[0][~late], settled[0][~late], rtol=1e-6)
    assert_allclose(fast[1][-1], settled[1][-1], rtol=0.0, atol=1.0 / 128.0)
    # adhesion's energy of a spot at the touch, and the change of load within that step
    assert_allclose(np.ptp(fast[2][111:]), np.ptp(settled[2][111:]), rtol=0.05)

    settled, fast = equilibrium_and_edge(800, 1e9, displacement=back, stiffness=3.0)
    # within two steps' work of the pull-off load at most; the edge itself loses little
    assert_allclose(fast[2][-1], settled[2][-1], rtol=0.0, atol=2.0 * 1.5 * 8.0 / 800)
    assert_allclose(fast[1][-1], settled[1][-1], rtol=0.0, atol=2.0 / 800)
    # w A + P delta less the elastic energy, of the contact of no load: a = 6^(1/3), delta = 6^(2/3)/3.
    a, depth = 6.0 ** (1.0 / 3.0), 6.0 ** (2.0 / 3.0) / 3.0
    exact = a**2 - elastic_energy(a, depth, maugis(Equilibrium(load=1.0)).bodies)
    table = {"time": [0.0, 0.3, 0.6, 1.0], "value": [0.0, -2.0, 0.0, 0.0]}
    lost = course(
        maugis(Equilibrium(load=table, after_pull_off="reattach"), 10),
        "dissipated_energy",
    )[0]
    assert_allclose(lost[-1] - lost[5], exact, rtol=1e-12)


KNOTS = {
    "turns of a displacement": {
        "displacement": {"from": 1.0, "to": -1.2, "cycles": 3},
        "stiffness": 3.0,
    },
    "turns of a load": {"load": {"from": 2.0, "to": -1.0, "cycles": 3}},
    "rows of a table": {
        "indentation": {
            "time": [0.0, 0.333, 0.338, 0.777, 1.0],
            "value": [1.0, -0.5, 2.0, 0.3, 0.5],
        }
    },
    "a jump": {
        "displacement": {
            "time": [0.0, 0.555, 0.555, 1.0],
            "value": [1.0, 0.0, 2.0, 1.0],
        },
        "stiffness": 3.0,
    },
    "a jump at a step": {
        "indentation": {"time": [0.0, 0.5, 0.5, 1.0], "value": [1.0, 0.0, 1.0, 0.5]}
    },
}


def test_an_edge_follows_turns_of_its_control_and_opens_at_a_time_of_its_own_within_a_clock_step():
    for knots in KNOTS.values():
        # the edge is good to some 1e-8 of the radius, whatever the step
        contact = RateDependent(
            **knots, front_speed=5.0, heal_speed=2.0, heal_exponent=0.5
        )
        (coarse, lost), (fine, fine_lost) = (
            course(maugis(contact, steps), "contact_radius", "dissipated_energy")
            for steps in (100, 1000)
        )
        assert np.ptp(coarse) > 0.1
        assert_allclose(coarse, fine[::10], rtol=1e-6)
        assert_allclose(lost, fine_lost[::10], rtol=1e-6, atol=1e-9)
    contact = RateDependent(load={"from": 1.0, "to": -3.0}, front_speed=5.0)
    few, many = (
        course(maugis(contact, steps), "detachment_time")[0][-1] for steps in (5, 500)
    )
    assert_allclose(few, many, rtol=1e-6)


def test_all_that_is_stored_is_dissipated_once_an_edge_is_open_or_at_rest():
    """The control jumps far off or to a light touch, then stays: nothing goes in or out any more."""
    cases = [
        *product([0.3, 5.0, math.inf], [0.1, 30.0], [(0.5, -6.0)]),
        *product([0.5, math.inf], [5.0], [(-9.0, 0.02)]),
    ]
    for stiffness, front_speed, (before, after) in cases:
        opens, rigid = after < 0.0, math.isinf(stiffness)
        after = -40.0 if opens and not rigid else after
        table = {
            "time": [0.0, 0.5, 0.5, 100.0],
            "value": [before, before, after, after],
        }
        held = (
            {"indentation": table}
            if rigid
            else {"displacement": table, "stiffness": stiffness}
        )
        scenario = maugis(RateDependent(**held, front_speed=front_speed), 200, 100.0)
        radius, lost, depth = course(
            scenario, "contact_radius", "dissipated_energy", "indentation"
        )
        a = radius[0] if opens else radius[-1]
        settled = (
            (stiffness * after + 0.5 * a**3) / (stiffness + 1.5 * a)
            if not rigid
            else after
        )
        depth = settled if opens else depth[-1]
        assert (
            (radius[-1] == 0.0) if opens else (radius[0] == lost[0] == 0.0 and a > 1.0)
        )
        spring = 0.0 if rigid else 0.5 * stiffness * (after - depth) ** 2
        stored = (
            elastic_energy(a, depth, scenario.bodies) + spring - math.pi * a**2 * WORK
        )
        assert_allclose(lost[-1], stored if opens else -stored, rtol=1e-7)


def test_a_fast_edge_stays_in_equilibrium_with_the_share_of_the_mean_stress():
    parts = {"bonds": bonds.Unbroken(stress=2e5), "drive": drive.Steady(speed=1e-3)}
    still, fast = (
        Equilibrium(load=4e-3, reversible=0.02),
        RateDependent(load=4e-3, reversible=0.02, front_speed=1e3),
    )
    settled, edge = (
        course(scene(1, 20, contact=contact, **parts), "contact_radius")[0]
        for contact in (still, fast)
    )
    assert settled[-1] < 0.95 * course(scene(1, 1), "contact_radius")[0][-1]
    assert_allclose(edge, settled, rtol=1e-7)


def pulse(contact, paid=1.0, steps=400, on="plane"):
    """The lens with fluctuations that grow beyond what adhesion can pay, and fall back."""
    field = {
        "spectrum": Gaussian(rms=3e5, length=24e-6),
        "amplitude": Onset(speed=5e-2, width=0.5),
    }
    part = shear.Mean(**field, paid_by_adhesion=paid, contact=on)
    table = drive.Table(
        time=(0.0, 0.5e-3 * steps, 1e-3 * steps), speed=(1e-5, 1e-1, 1e-5)
    )
    return scene(1, steps, shear=part, drive=table, contact=contact)


def test_work_that_falls_through_zero_or_none_at_all_makes_hertzs_contact():
    for held in [
        {"load": 4e-3},
        {"indentation": 2e-6},
        {"displacement": 2e-6, "stiffness": 2e3},
    ]:
        scenario = pulse(Equilibrium(**held))
        radius, work, masked = course(
            scenario, "contact_radius", "work_of_adhesion", "masked"
        )
        bodies = scenario.bodies
        hertz = scenario.contact.control(0.0, 1.0).radius(np.zeros(1), bodies)[0]
        assert_array_equal(masked, work <= 0.0)
        assert 10 < masked.sum() < 390
        assert_array_equal(radius[work <= 0.0], hertz)
        assert np.all(radius[work > 0.0] >= hertz)
        # continuous in the work: near Hertz's radius it grows like its root, a - a_H <= C sqrt(w) with C at 42 mJ/m^2
        wide = scenario.contact.control(0.0, 1.0).radius(np.array([0.042]), bodies)[0]
        assert np.all(
            radius - hertz
            <= 1.5 * (wide - hertz) * np.sqrt(np.maximum(work, 0.0) / 0.042) + 1e-18
        )
        assert radius[0] == radius[-1] > 1.2 * hertz
    radius, work, masked = course(
        pulse(Equilibrium(indentation=-1e-8)),
        "contact_radius",
        "work_of_adhesion",
        "masked",
    )
    assert np.all(radius[np.argmax(work <= 0.0) :] == 0.0)
    # an open contact is not Hertz's
    assert_array_equal(masked, np.where(radius > 0.0, 0.0, np.nan))
    back = {"from": 1e-3, "to": -1e-3, "cycles": 1}
    part = shear.Mean(spectrum=Gaussian(rms=1e6, length=24e-6))
    scenario = scene(
        1, 40, shear=part, contact=Equilibrium(load=back, after_pull_off="reattach")
    )
    radius, load, when = course(
        scenario, "contact_radius", "normal_load", "detachment_time"
    )
    pressed = load > 1e-9
    assert_array_equal(
        radius[pressed], jkr.hertz_radius_at_load(load[pressed], 2e-3, 6.4e6)
    )
    assert np.all(radius[~pressed] < 1e-6)
    assert np.isfinite(when[-1])


#: With how far the spline over ln a may be off: smooth spectra are smooth there, too; a wave's share oscillates
#: with the number of waves in the contact, faster than any spline follows.
SPECTRA = {
    "gaussian": (Gaussian(rms=1e5, length=5e-6), 1e-8),
    "long": (Gaussian(rms=1e5, length=1e-4), 1e-8),
    "von karman": (VonKarman(rms=1e5, length=1e-5, hurst=0.3), 1e-8),
    "streaks": (
        AnisotropicGaussian(rms=1e5, length_x=1e-5, length_y=1e-3, angle=0.5),
        1e-8,
    ),
    "self-affine": (
        SelfAffine(rms=1e5, hurst=0.8, longest=60e-6, rolloff=24e-6, shortest=1e-6),
        1e-5,
    ),
    "band": (Band(rms=1e5, longest=60e-6, shortest=16e-6), 3e-5),
    "narrow band": (Band(rms=1e5, longest=60e-6, shortest=59e-6), 3e-3),
    "ripple": (Ripple(amplitude=1e5, wavelength=24e-6, angle=0.7), 1e-12),
    "short ripple": (Ripple(amplitude=1e5, wavelength=1e-6), 1e-12),
}


def test_the_share_that_a_disc_pays_is_its_marginal_energy():
    for name in SPECTRA:
        spectrum, claim = SPECTRA[name]
        radius = 2e-3 * 10.0 ** np.random.default_rng(3).uniform(-4.0, 0.0, 60)
        exact = marginal_energy(
            spectrum, radius, HalfSpace(1.6e6, 0.5).softness
        ) / float(HalfSpace(1.6e6, 0.5).stored_energy(spectrum))
        margin = Margin(spectrum, HalfSpace(1.6e6, 0.5).softness, 2e-3)
        assert_allclose(margin(radius), exact, rtol=0.0, atol=claim)
        assert_array_equal(margin(np.array([0.0, math.nan])), [0.0, math.nan])


def test_a_disc_is_where_its_release_rate_is_the_work_that_its_amplitude_leaves_and_dissipates_that():
    for held, paid in product(
        [
            {"load": 4e-3},
            {"load": -2e-4},
            {"indentation": -4e-7},
            {"displacement": 1e-6, "stiffness": 2e3},
        ],
        [1.0, 0.4],
    ):
        scenario = pulse(Equilibrium(**held), paid, 60, on="disc")
        names = (
            "contact_radius",
            "work_of_adhesion",
            "fluctuation_energy",
            "indentation",
        )
        radius, work, energy, depth = course(scenario, *names)
        closed = (radius > 0.0) & (work > 0.0)
        assert closed.sum() > 8
        a = radius[closed]
        assert_allclose(
            work[closed],
            42e-3 - paid * energy[closed] * scenario.margin(a),
            rtol=0.0,
            atol=1e-15,
        )
        rate = jkr.energy_release_rate_at_indentation(a, depth[closed], 2e-3, 6.4e6)
        assert_allclose(rate, work[closed], rtol=1e-12, atol=42e-3 * 1e-12)
    # -int w dA = -w0 A + DeltaGamma int dE: the mean over the disc, not its edge, enters the energy.
    spectrum = Gaussian(rms=0.05, length=0.3)
    plane = float(HalfSpace(0.1875).stored_energy(spectrum))
    part = shear.Mean(spectrum=spectrum, contact="disc")
    scenario = maugis(
        Equilibrium(indentation={"from": 0.0, "to": -2.0}), 400, shear=part
    )
    last = run(scenario).isel(t=-1)
    depth, load = float(last["pull_off_displacement"]), float(last["pull_off_load"])
    # Maugis: P = 3a(δ - a²/3)/2, which falls with a where δ < 0
    a = brentq(lambda a: 1.5 * a * (depth - a**2 / 3.0) - load, 0.0, 3.0, xtol=1e-14)
    assert plane > 1e-3
    assert_allclose(
        last["dissipated_energy"],
        elastic_energy(a, depth, scenario.bodies)
        - math.pi
        * a**2
        * (WORK - disc_energy(spectrum, a, HalfSpace(0.1875).softness)),
        rtol=1e-7,
    )


@pytest.mark.parametrize("steps", [400, pytest.param(2000, marks=pytest.mark.verify)])
def test_what_a_rate_dependent_edge_dissipates_under_a_load_is_no_matter_of_the_least_radius(
    monkeypatch, steps
):
    # below the radius at pull-off the falling load gains energy like 1/radius; that is not the edge's
    pulled = RateDependent(load={"from": 1e-3, "to": -1e-3}, front_speed=1e-3)
    result = []
    for spot in (1e-3, 1e-2):
        monkeypatch.setattr(front, "_SPOT", spot)
        *_, last = march(scene(1, steps, contact=pulled), np.arange(1))
        assert np.isnan(last.contact.radius[0])
        result.append(last.contact.dissipated[0])
    assert_allclose(result[0], result[1], rtol=1e-12)
    adhesive = 42e-3 * np.pi * 1.2e-4**2
    assert 0.0 < result[0] < 10.0 * adhesive


def test_a_contact_that_closes_again_starts_without_the_bonds_it_carried():
    held = Equilibrium(
        displacement={"from": 1e-6, "to": -1.6e-5, "cycles": 2},
        stiffness=340.0,
        after_pull_off="reattach",
    )
    sites = bonds.Rate(critical_speed=1e-2, rebinding_rate=2.0, area="carried")
    states = list(march(scene(1, 2000, contact=held, bonds=sites), np.arange(1)))
    radius = np.array([state.contact.radius[0] for state in states])
    fraction = np.array([state.bonding.fraction[0] for state in states])
    closing = np.flatnonzero(np.isnan(radius[:-1]) & ~np.isnan(radius[1:])) + 1
    assert closing.size == 2
    # one step of healing from nothing, and nothing again once the area is seen
    assert np.all(fraction[closing] <= 2.0 * 1e-3 * (1.0 + 1e-9))
    assert np.all(radius[closing] < 0.5 * np.nanmax(radius))


def test_a_contact_remarks_on_a_start_out_of_touch():
    for held, word in (
        ({"load": 4e-3}, ""),
        ({"load": -1e-3}, "contact.load"),
        (
            {"displacement": {"from": -1e-4, "to": 1e-6}, "stiffness": 1e3},
            "begins open",
        ),
        ({"load": 40.0}, ""),
    ):
        scenario = scene(1, 2, contact=Equilibrium(**held))
        remarks = scenario.contact.remarks(scenario.setting)
        assert len(remarks) == bool(word)
        assert all(word in remark for remark in remarks)


def test_a_loop_by_its_speeds_is_the_table_of_its_times_bit_for_bit():
    by_speed = {"from": -4.5, "to": 1.1, "approach": 3.7, "retraction": 0.9}
    way = abs(by_speed["to"] - by_speed["from"])
    there, back = way / by_speed["approach"], way / by_speed["retraction"]
    table = {"time": [0.0, there, there + back], "value": [-4.5, 1.1, -4.5]}
    table = {name: [*column, column[-1]] for name, column in table.items()}
    table["time"][-1] = 8.0
    edge = {"front_speed": 1.0, "heal_speed": 10.0}
    for held in ({}, {"stiffness": 2.0}):
        kind = "displacement" if held else "indentation"
        for model, own in ((Equilibrium, {}), (RateDependent, edge)):
            first, second = (
                course(
                    maugis(model(**{kind: each}, **held, **own), 400, 8.0),
                    *("contact_radius", "normal_load", "displacement"),
                )
                for each in (by_speed, table)
            )
            for ours, theirs in zip(first, second, strict=True):
                assert_array_equal(ours, theirs)
            assert first[0][0] == first[0][-1] == 0.0 and first[0].max() > 1.0


def test_pull_off_grows_with_the_speed_of_retraction_as_the_law_of_the_edge_says():
    # an edge that heals at once presses to equilibrium, from where the numbers of ``test_front`` begin; there the
    # lowest loads are those of LSODA at 1e-11, with work (v/v0)^0.6 and v0 = 1 on a hard machine
    rest = jkr.indentation_at_radius(6.0 ** (1.0 / 3.0), WORK, 1.0, 0.75)
    loop = {"from": rest - 3.9, "to": rest, "approach": 100.0, "retraction": 0.1}
    edge = {"front_speed": 1.0, "front_exponent": 0.6, "heal_speed": 1e12}
    speeds = {0.1: -1.775354520, 1.0: None, 10.0: -4.560522114}
    scene = maugis(RateDependent(indentation=loop, **edge), 40_000, 40.0)
    key = "contact.indentation.retraction"
    dataset = sim.run(scene.with_values({"sweep": {key: [*speeds]}}))
    lowest = []
    for speed, known in speeds.items():
        row = dataset.sel(contact_indentation_retraction=speed)
        load = np.ravel(row.normal_load)
        low = int(np.nanargmin(load))
        lowest.append(load[low])
        # the lowest of samples is at most 1/8 of their second difference above the least value
        bend = np.diff(load[low - 1 : low + 2], 2)[0] / 8.0
        if known is not None:
            assert known - 1e-5 < load[low] < known + bend + 1e-5
    assert np.all(np.diff(lowest) < 0.0)


def test_a_loop_that_the_run_or_its_steps_cut_short_is_named_and_a_faulty_one_refused():
    loop = {"from": -1.0, "to": 1.0, "approach": 4.0, "retraction": 1.0}
    for duration, is_short in ((2.5, False), (2.4, True)):
        scene = maugis(Equilibrium(indentation=loop), 100, duration)
        words = "the run ends before the loop of contact.indentation does"
        assert (words in sim.check(scene)) == is_short
        assert not is_short or "clock.duration to 2.5 s" in sim.check(scene)
    with pytest.raises(BadInput, match=r"takes 0\.5 s, less than a clock step"):
        maugis(Equilibrium(indentation=loop), 2, 2.0).with_values({})
    for fault, words in (
        ({"to": -1.0}, "needs a way"),
        ({"approach": 0.0}, "approach"),
        ({"retraction": "1 s"}, "retraction"),
    ):
        held = {"model": "equilibrium", "indentation": loop | fault}
        with pytest.raises(BadInput, match=words):
            maugis(Equilibrium(indentation=1.0)).with_values({"contact": held})
    # a load has neither loops nor holds
    for other, words in ((loop, "approach"), ({"holds": [1.0]}, "holds")):
        held = {"model": "equilibrium", "load": other}
        with pytest.raises(BadInput, match=f"{words}: is not a key"):
            maugis(Equilibrium(indentation=1.0)).with_values({"contact": held})
