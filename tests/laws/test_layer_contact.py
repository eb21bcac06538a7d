"""A sphere on a bonded layer: its equilibria beside known states, a scan of all radii, and the half-space."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from sim.laws import equilibrium, jkr, layer
from sim.laws.layer_table import WIDEST
from sim.solid import HalfSpace, Layer

#: Thickness and work of adhesion at G = R = 1: pull-off load over -3/2 πwR, radius and depth there, and those at P = 0.
STATES = {
    (0.2, 1e-3): (1.05891445, 0.09805178, -2.151244e-4, 0.149105325, 0.00694235477),
    (0.05, 1e-4): (1.17537181, 0.04457987, 1.195922e-4, 0.0642967521, 0.00118741979),
    (0.05, 1e-3): (1.33357334, 0.08415857, 6.179361e-4, 0.116915404, 0.003531739),
}
#: What the last digits of these numbers leave; that of the radius at a distance of 1e-13 from pull-off is its root.
DIGITS = [6e-9, 1e-6, 1e-4, 4e-9, 2e-7]


@pytest.mark.parametrize("case", STATES)
def test_the_contact_without_a_load_and_at_pull_off_is_known(case):
    work, solid = case[1], Layer(1.0, case[0])
    lowest = solid.pull_off_load(work, 1.0)
    radius = solid.radius((lowest * (1.0 - 1e-13), 0.0, 0.0), work, 1.0)
    depth = solid.indentation(radius, (lowest, 0.0, 0.0), 1.0)
    at_rest = solid.radius((0.0, 0.0, 0.0), work, 1.0)
    values = lowest / (-1.5 * math.pi * work), radius, depth, at_rest
    values += (solid.indentation(at_rest, (0.0, 0.0, 0.0), 1.0),)
    for value, known, digits in zip(values, STATES[case], DIGITS, strict=True):
        assert_allclose(value, known, rtol=digits, atol=0)
    assert np.isnan(solid.radius((lowest * (1.0 + 1e-12), 0.0, 0.0), work, 1.0))


def test_a_layer_much_thicker_than_the_contact_is_wide_is_a_half_space():
    draws = np.random.default_rng(1)
    thick, half_space = Layer(1.6e6, 1e9), HalfSpace(1.6e6)
    works = 0.04 * np.append(draws.uniform(-0.5, 2.0, 200), 0.0)
    sphere_radius = 2e-3
    for spring in (0.0, 30.0, 1e3, math.inf):
        for value in draws.uniform(-0.5, 3.0, 30):
            load, base = (value * 1e-3, 0.0) if spring == 0.0 else (0.0, value * 1e-6)
            mount = load, base, spring
            radius = half_space.radius(mount, works, sphere_radius)
            fold = np.abs(radius / np.nanmin(radius) - 1.0) < 1e-3
            pairs = (
                (thick.radius(mount, works, sphere_radius), np.where(fold, 1, radius)),
                *(
                    (
                        getattr(thick, law)(radius, mount, sphere_radius),
                        getattr(half_space, law)(radius, mount, sphere_radius),
                    )
                    for law in ("load", "indentation")
                ),
            )
            first = np.where(fold, 1, pairs[0][0]), pairs[0][1]
            closed = ~np.isnan(radius)
            for value_on_layer, known in (first, *pairs[1:]):
                value_on_layer = np.broadcast_to(value_on_layer, works.shape)[closed]
                known = np.broadcast_to(known, works.shape)[closed]
                if not closed.any():
                    continue
                scale = np.nanmax(np.abs(known))
                assert_allclose(value_on_layer, known, rtol=1e-12, atol=1e-12 * scale)
    for work in (0.04, 0.0, -1.0):
        loads = (solid.pull_off_load(work, 2e-3) for solid in (thick, half_space))
        assert_allclose(next(loads), next(loads), rtol=1e-13, atol=0)


def equilibria(x, work, mount):
    """Return load or displacement of the base at which a contact of a/h = x is in equilibrium at h = R = E* = 1.

    From e_1, e_2, g_1 and g_2 without the solver: δ e_1 = a² e_2/R - √(2πaw/E*), P = 2E*(δ a g_1 - a³ g_2/R).
    """
    e1, e2, g1, g2 = (layer.contact_function(which, x) for which in (0, 2, 4, 5))
    depth = (x**2 * e2 - np.sqrt(2.0 * math.pi * x * work)) / e1
    load = 2.0 * (depth * x * g1 - x**3 * g2)
    return load if mount == 0.0 else depth + load / mount


def test_the_radius_is_the_largest_stable_one_of_a_scan_of_all_radii():
    draws, places = np.random.default_rng(5), np.geomspace(1e-5, 0.999 * WIDEST, 4000)
    partly, found = 0, 0
    for case in range(400):
        work = 10.0 ** draws.uniform(-7, 4)
        spring = (0.0, math.inf, 10.0 ** draws.uniform(-3, 5))[case % 3]
        if case % 6 == 2:  # two stable radii are possible
            work, spring = 10.0 ** draws.uniform(1.5, 4.5), 10.0 ** draws.uniform(1, 3)
        curve = equilibria(places, work, spring)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(curve)))) + 1
        level = curve[draws.integers(len(places) // 4, len(places))]
        if case % 2:  # just above and below the folds
            level = curve[turns[-1]] + draws.choice([-1, 1]) * 1e-3 * abs(
                curve[turns[-1]]
            )
        if level > curve[-1]:
            continue
        rises = np.flatnonzero((curve[:-1] <= level) & (curve[1:] > level))
        mount = (level, 0.0, 0.0) if spring == 0.0 else (0.0, level, spring)
        radius = equilibrium.radius_on_layer(*mount, work, 1.0, 1.0, 1.0)
        if not rises.size:
            assert np.isnan(radius)
            continue
        low, high = places[rises[-1]], places[rises[-1] + 1]
        known = brentq(
            lambda x, *rest: equilibria(x, *rest) - level,
            low,
            high,
            (work, spring),
            xtol=1e-15,
            rtol=1e-14,
        )
        assert_allclose(radius, known, rtol=1e-9, atol=0)
        found += 1
        partly += len(turns) > 1
    # of 400 cases most have an equilibrium, and some a curve with more than one fold
    assert found > 250 and partly > 10


@pytest.mark.parametrize("work", [0.0, 1e-3])
@pytest.mark.parametrize("thickness", [10.0, 1.0, 0.2, 0.1])
def test_the_radius_is_the_same_from_any_start_on_either_side(work, thickness):
    # the width of a bracket without its upper end had been taken for narrow
    body, depth = (1.0, 4.0, 1.0 / thickness), 0.3
    mount = (0.0, depth, math.inf)

    def missing(a):
        x = a / thickness
        e1, e2 = (layer.contact_function(float(k), x) for k in (layer.E_1, layer.E_2))
        return depth * e1 - a**2 * e2 + math.sqrt(math.pi * a * work / 2.0)

    exact = brentq(missing, 0.1, 3.0, xtol=1e-15, rtol=1e-14)
    starts = exact * np.geomspace(0.1, 10.0, 21)
    found = [equilibrium.largest_radius(a, work, 0.0, mount, body)[0] for a in starts]
    assert_allclose(found, exact, rtol=1e-12, atol=0)


def test_the_energy_of_a_contact_has_the_load_and_the_release_rate_as_its_slopes():
    solid, sphere_radius = Layer(1.3, 0.4), 7.0
    for radius in (1e-3, 0.1, 0.6, 4.0, 20.0):
        scale = radius**2 / sphere_radius
        for depth in (-0.4 * scale, 0.3 * scale, 2.0 * scale):
            mount = 0.0, depth, math.inf
            load = solid.load(radius, mount, sphere_radius)
            step = 1e-4 * scale
            energies = solid.contact_energy(
                radius, depth + np.array([-step, step]), sphere_radius
            )
            # quadratic in the depth
            slope = np.diff(energies)[0] / (2.0 * step)
            assert_allclose(slope, load, rtol=1e-9, atol=1e-9 * abs(energies[0] / step))
            sizes = radius * (1.0 + 1e-3 * np.array([-2.0, -1.0, 1.0, 2.0]))
            energies = solid.contact_energy(sizes, depth, sphere_radius)
            slope = energies @ [1.0, -8.0, 8.0, -1.0] / (12e-3 * radius)
            # the work of adhesion at which this contact is in equilibrium
            terms = equilibrium.punch(radius, (1.0 / sphere_radius, 5.2, 2.5))
            release = (terms[0] - depth) ** 2 / terms[5]
            assert_allclose(
                slope / (2.0 * math.pi * radius), release, rtol=1e-8, atol=0
            )


def test_a_thin_layer_bears_more_tension_than_the_theory_of_the_half_space_allows():
    loads = [Layer(1.0, h).pull_off_load(1e-3, 1.0) for h in (1e6, 0.2, 0.05, 0.01)]
    ratio = np.array(loads) / jkr.pull_off_load(1e-3, 1.0)
    assert_allclose(ratio[0], 1.0, rtol=1e-7)
    assert np.all(np.diff(ratio) > 0.0)
    assert_allclose(ratio[-1], 1.61, rtol=3e-3)
