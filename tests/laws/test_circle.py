"""A sphere with the profile of a circle: Sneddon's integrals, minima of the energy, and runs with every contact."""

import math

import mpmath
import numpy as np
import pytest
from mpmath import mp
from numpy.testing import assert_allclose

import sim
from sim.read.observables import radius_at_work
from sim.solid import HalfSpace, UnderCircle

#: G = 1/4, so that E* = R = 1.
SOLID = UnderCircle(0.25)
HALF_SPACE = HalfSpace(0.25)
FREE, HELD = (0.0, 0.0, 0.0), math.inf


def theta(s):
    """Return s times the integral of f'(r)/sqrt(s^2 - r^2) of the profile f = 1 - sqrt(1 - r^2), over r to s."""
    return s * mpmath.quad(
        lambda t: s * mpmath.sin(t) / mpmath.sqrt(1 - (s * mpmath.sin(t)) ** 2),
        [0, mp.pi / 2],
    )


def energy(a, depth):
    """Return the elastic energy by Sneddon's integral; the closed form of theta is tested beside it."""
    return mpmath.quad(lambda s: (depth - s * mpmath.atanh(s)) ** 2, [0, a])


@pytest.mark.parametrize("share", [1e-4, 0.05, 0.3, 0.33, 0.5, 0.9])
def test_depth_load_and_energy_are_sneddons_integrals(share):
    mp.dps = 30
    a, depth = mp.mpf(share), 0.4 * share**2
    hertz = a * mpmath.atanh(a)
    assert_allclose(float(theta(a) / hertz), 1.0, rtol=1e-15, atol=0)
    load = 2 * (a * hertz - mpmath.quad(lambda s: s * mpmath.atanh(s), [0, a]))
    reached = SOLID.indentation(share, (float(load), 0.0, 0.0), 1.0)
    assert_allclose(reached, float(hertz), rtol=1e-12, atol=0)
    mount = 0.0, float(hertz), HELD
    assert_allclose(SOLID.load(share, mount, 1.0), float(load), rtol=1e-12, atol=0)
    exact = float(energy(a, mp.mpf(depth)))
    assert_allclose(SOLID.contact_energy(share, depth, 1.0), exact, rtol=1e-12, atol=0)


def test_a_small_contact_is_that_of_a_parabola_and_differs_by_the_known_next_terms():
    shares = np.array([0.02, 0.04])
    depth = SOLID.radius((0.0, shares**2, HELD), 0.0, 1.0) / shares
    load = SOLID.radius((4.0 / 3.0 * shares**3, 0.0, 0.0), 0.0, 1.0) / shares
    # delta_H = s^2 (1 + s^2/3), P_H = 4/3 s^3 (1 + 2 s^2/5), to be solved for s
    for ratio, term in ((depth, 1.0 / 6.0), (load, 2.0 / 15.0)):
        terms = (1.0 - ratio) / shares**2
        # Richardson's extrapolation leaves the fourth order
        assert_allclose((4.0 * terms[0] - terms[1]) / 3.0, term, rtol=1e-5, atol=0)


@pytest.mark.parametrize("work", [0.01, 0.3])
def test_an_adhesive_circle_is_at_the_minimum_of_its_energy(work):
    mp.dps = 25
    for depth in (0.0, 0.3):
        radius = float(SOLID.radius((0.0, depth, HELD), work, 1.0))

        def slope(a, depth=depth):
            return mpmath.diff(
                lambda x: energy(x, mp.mpf(depth)) - mp.pi * x**2 * work, a, h=1e-9
            )

        low, high = radius * (1 - 1e-6), radius * (1 + 1e-6)
        assert slope(high) > 0 > slope(low)
        exact = mpmath.findroot(slope, (low, high), solver="anderson", tol=1e-32)
        assert_allclose(radius, float(exact), rtol=1e-12, atol=0)


@pytest.mark.parametrize("work", [1e-4, 0.01, 0.3, 30.0])
def test_an_adhesive_circle_pulls_off_at_the_lowest_load_of_its_equilibria(work):
    radii = np.linspace(1e-3, 1.0 - 1e-6, 200_001)
    turn = np.arctanh(radii)
    loads = (radii**2 + 1.0) * turn - radii - np.sqrt(8.0 * math.pi * work * radii**3)
    lowest = SOLID.pull_off_load(work, 1.0)
    # the scan misses the minimum by the square of half of its step
    assert_allclose(lowest, loads.min(), rtol=1e-6, atol=0)
    mounts = [(lowest * (1.0 + sign * 1e-10), 0.0, 0.0) for sign in (-1.0, 1.0)]
    assert np.isfinite(SOLID.radius(mounts[0], work, 1.0))
    assert np.isnan(SOLID.radius(mounts[1], work, 1.0))


def test_a_circle_is_never_wider_than_the_sphere_whatever_presses_or_pulls_it():
    draws = np.random.default_rng(3)
    mounts = [
        *((load, 0.0, 0.0) for load in 10.0 ** draws.uniform(-6, 3, 40)),
        *((0.0, base, HELD) for base in 10.0 ** draws.uniform(-6, 2, 40)),
        *((0.0, base, 10.0 ** (3 * base)) for base in draws.uniform(-0.5, 1.0, 40)),
    ]
    works = np.array([-1.0, 0.0, 1e-6, 1e-3, 1.0, 1e3])
    count = 0
    for mount in mounts:
        radius = SOLID.radius(mount, works, 1.0)
        closed = radius[np.isfinite(radius)]
        assert np.all(closed <= 1.0) and np.all(np.diff(closed) >= -1e-13)
        # where the radius has digits left below that of the sphere
        for a, work in zip(radius, np.maximum(works, 0.0), strict=True):
            if 0.0 < a < 0.999:
                depth = SOLID.indentation(a, mount, 1.0)
                missing = a * math.atanh(a) - depth
                scale = a * math.atanh(a) + abs(depth)
                exact = math.sqrt(2.0 * math.pi * a * work)
                assert_allclose(missing, exact, rtol=1e-9, atol=1e-12 * scale)
                count += 1
    assert count > 200


def test_the_surface_beside_a_circle_touches_it_and_is_far_away_that_under_a_point_load():
    radius, depth = 0.6, 0.1
    r = np.array([0.0, 0.3, radius, radius * (1.0 + 1e-9), 1e4])
    surface, sphere = SOLID.heights(r, radius, depth, 1.0)
    exact = 1.0 - np.sqrt(1.0 - r[:3] ** 2) - depth
    assert_allclose(surface[:3], exact, rtol=1e-12, atol=1e-15)
    assert_allclose(sphere[:3], exact, rtol=1e-12, atol=1e-15)
    # the neck of an adhesive edge is a root of the distance
    assert abs(surface[3] - surface[2]) < 1e-4
    load = SOLID.load(radius, (0.0, depth, HELD), 1.0)
    assert_allclose(surface[4], -load / (math.pi * r[4]), rtol=1e-7, atol=0)
    small = 1e-4 * r[:4]
    pair = (each.heights(small, 6e-5, 1e-9, 1.0)[0] for each in (SOLID, HALF_SPACE))
    assert_allclose(next(pair), next(pair), rtol=1e-7, atol=0)


# --- scenes ---

PROBE = {
    "clock": {"duration": 0.2, "step": 0.02},
    "solid": {"youngs_modulus": "10 kPa", "poisson_ratio": 0.4},
    "sphere": {"radius": 25e-6, "profile": "circle"},
    "adhesion": {"work": "1 mJ/m^2"},
    "bonds": {"model": "none", "stress": "100 Pa"},
    "drive": {"speed": "1 um/s"},
}
MODULUS = 10e3 / (1.0 - 0.4**2)
MOUNTS = {
    "load": {"load": "200 nN"},
    "indentation": {"indentation": {"from": "2 um", "to": "4 um"}},
    "displacement": {"displacement": "5 um", "stiffness": "0.1 N/m"},
    "lagging": {
        "model": "rate_dependent",
        "front_speed": "5 um/s",
        "front_exponent": 0.5,
        "indentation": {"from": "4 um", "to": "2 um"},
    },
}


@pytest.mark.parametrize("mount", MOUNTS)
def test_load_indentation_and_radius_of_a_run_are_those_of_a_circle(mount):
    contact = MOUNTS[mount]
    dataset = sim.run(sim.load({**PROBE, "contact": contact}))
    radius, load = (
        dataset[name].to_numpy().ravel() for name in ("contact_radius", "normal_load")
    )
    depth, share = dataset["indentation"].to_numpy().ravel(), radius / 25e-6
    missing = 25e-6 * share * np.arctanh(share) - depth
    hertz = MODULUS * 25e-6**2 * ((1.0 + share**2) * np.arctanh(share) - share)
    assert np.all(share > 0.3)
    exact = hertz - 2.0 * MODULUS * radius * missing
    assert_allclose(load, exact, rtol=1e-9, atol=0)
    release = MODULUS * missing**2 / (2.0 * math.pi * radius)
    if mount == "lagging":
        # the edge retracts, so that its energy release rate is above the work of adhesion
        assert np.all(release[2:] > 1.01e-3)
        return
    assert_allclose(release, 1e-3, rtol=1e-9, atol=0)
    again = radius_at_work(dataset, dataset["adhesion_work"])
    assert_allclose(np.ravel(again)[-1], radius[-1], rtol=1e-12, atol=0)


def test_circles_and_parabolas_of_one_sweep_are_read_as_they_were_computed():
    sweep = {"sphere.profile": ["parabola", "circle"]}
    scenes = {**PROBE, "contact": {"load": "200 nN"}, "sweep": sweep}
    dataset = sim.run(sim.load(scenes))
    radius = dataset["contact_radius"].isel(t=-1).to_numpy().ravel()
    solids = HalfSpace(10e3 / 2.8, 0.4), UnderCircle(10e3 / 2.8, 0.4)
    exact = [each.radius((200e-9, 0.0, 0.0), 1e-3, 25e-6) for each in solids]
    assert_allclose(radius, exact, rtol=1e-12, atol=0)
    again = radius_at_work(dataset, dataset["adhesion_work"]).to_numpy()
    assert_allclose(again.ravel(), radius, rtol=1e-12, atol=0)
    pulled = [each.pull_off_load(1e-3, 25e-6) for each in solids]
    assert_allclose(dataset["jkr_pull_off_load"], pulled, rtol=1e-12, atol=0)


@pytest.mark.parametrize(
    ("table", "cure"),
    [
        ({"solid": {"shear_modulus": 1e4, "thickness": 1e-3}}, "solid.thickness"),
        (
            {"solid": {"shear_modulus": 1e4, "counter_body": {"shear_modulus": 1e9}}},
            "solid.counter_body",
        ),
        (
            {"contact": {"model": "cohesive", "range": 1e-9, "load": 0.0}},
            "contact.model",
        ),
    ],
)
def test_a_circle_is_refused_by_name_where_it_is_not_known(table, cure):
    scene = {**PROBE, "contact": {"load": "200 nN"}, **table}
    with pytest.raises(sim.BadInput, match=rf"sphere.profile: .*{cure}"):
        sim.load(scene)
    sim.load({**scene, "sphere": {"radius": 25e-6}})


def test_a_check_states_the_error_of_the_parabola_for_a_large_contact_and_none_for_a_small():
    def known(depth, **tables):
        contact = {"indentation": depth * 25e-6}
        adhesion = {"work": 0.0}
        return sim.load({**PROBE, "contact": contact, "adhesion": adhesion, **tables})

    # the area at an indentation is 1 + s^2/3 times too large
    for profile in ("parabola", "circle"):
        scene = known(1e-4, sphere={"radius": 25e-6, "profile": profile})
        assert_allclose(scene.limits.parabola, 1e-4 / 3.0, rtol=1e-3, atol=0)
    words = "sphere.profile"
    for depth, is_large in ((0.04, False), (0.16, True)):
        scene = known(depth, sphere={"radius": 25e-6})
        assert any(words in remark for remark in scene.remarks()) == is_large
    layer = {"shear_modulus": 1e4, "thickness": 1e-3}
    assert math.isnan(
        known(0.01, solid=layer, sphere={"radius": 25e-6}).limits.parabola
    )


@pytest.mark.verify
@pytest.mark.parametrize("reversible", [0.0, 0.5])
def test_a_slider_behind_a_spring_feels_the_circle(reversible):
    # stiff and slow, so that no slip breaks nearly all bonds at once
    drive = {"model": "spring", "stage": "0.5 um/s", "stiffness": "10 N/m"}
    drive |= {"damping": 1e-3, "contact_stiffness": "rigid"}
    bonds = {"model": "rate", "critical_speed": "2 um/s", "rebinding_rate": "50 1/s"}
    scene = {
        **PROBE,
        "contact": {"load": "100 nN", "reversible": reversible},
        "drive": drive,
        "bonds": bonds | {"stress": "200 Pa"},
    }
    dataset = sim.run(sim.load(scene))
    names = "contact_radius", "indentation", "work_of_adhesion"
    radius, depth, work = (dataset[name].to_numpy().ravel() for name in names)
    missing = radius * np.arctanh(radius / 25e-6) - depth
    release = MODULUS * missing**2 / (2.0 * math.pi * radius)
    assert_allclose(release, work, rtol=1e-6, atol=0)
    assert work[-1] < 0.95 * work[0] and np.all(radius > 0.3 * 25e-6)
