"""Fields across a contact: against textbook forms in fifty digits, and by the integrals they must give."""

import math

import mpmath
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from sim.laws import halfspace, jkr

LENS = {"sphere_radius": 2e-3, "modulus": 6.4e6}
# radius, indentation: the first is Hertz's
STATES = [(1.2e-4, 7.2e-6), (1.2e-4, 5.0e-6), (7e-5, 0.0), (5e-5, -7e-7)]


def lens_contact(load=4e-3, work=0.042):
    """Radius and indentation of a contact in equilibrium."""
    radius = float(jkr.radius_at_load(load, work, **LENS))
    return radius, float(jkr.indentation_under_load(radius, load, **LENS))


def over_the_contact(values_of, radius, points=64):
    """Integral of a function of r over the disc, by r = a sin(t): exact for a root at the edge or its inverse."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    t = 0.25 * math.pi * (nodes + 1.0)
    r = radius * np.sin(t)
    return (
        0.25
        * math.pi
        * np.sum(weights * 2.0 * math.pi * r * radius * np.cos(t) * values_of(r))
    )


def test_the_pressure_carries_the_load_works_as_the_elastic_energy_and_hertzs_is_johnsons():
    for radius, indentation in STATES:
        load = over_the_contact(
            lambda r: halfspace.pressure(r, radius, indentation, **LENS), radius
        )
        exact = jkr.load_under_indentation(radius, indentation, **LENS)
        # the largest part of the load is Hertz's; punch and quadrature add to it and may cancel to less
        size = jkr.load_under_indentation(
            radius, radius**2 / LENS["sphere_radius"], **LENS
        )
        assert abs(load - exact) < 1e-12 * size
    load, radius = 4e-3, float(jkr.hertz_radius_at_load(4e-3, **LENS))
    r = np.linspace(0.0, 0.99, 12) * radius
    peak = 1.5 * load / (math.pi * radius**2)
    exact = peak * np.sqrt(1.0 - (r / radius) ** 2)
    # the indentation a^2/R is rounded: that leaves a punch of a few 1e-16 of Hertz's, 7 times larger at 0.99
    computed = halfspace.pressure(r, radius, radius**2 / LENS["sphere_radius"], **LENS)
    assert_allclose(computed, exact, rtol=1e-13, atol=0)
    radius, indentation = lens_contact()

    def density(r):
        moved = halfspace.normal_displacement(r, radius, indentation, 2e-3)
        return 0.5 * halfspace.pressure(r, radius, indentation, **LENS) * moved

    energy = over_the_contact(density, radius)
    exact = jkr.potential_at_indentation(-indentation, 0.0, radius, 0.0, **LENS)
    # four parts of alternating sign, each below ten times the sum
    assert_allclose(energy, exact, rtol=1e-13, atol=0)


def test_the_edge_pulls_with_the_intensity_of_the_work_and_hertz_has_no_tension():
    radius, indentation = lens_contact()
    intensity = (
        LENS["modulus"]
        * (radius**2 / LENS["sphere_radius"] - indentation)
        / math.sqrt(math.pi * radius)
    )
    # a^2/R - delta is a twelfth of its terms here
    assert_allclose(intensity**2 / (2.0 * LENS["modulus"]), 0.042, rtol=1e-13, atol=0)
    for near in (1e-4, 1e-6):
        pull = halfspace.pressure(radius * (1.0 - near), radius, indentation, **LENS)
        # the next terms are near/4 and Hertz's 4 a^2/(a^2 - R delta) near = 13 near of this one
        assert_allclose(
            pull,
            -intensity / math.sqrt(2.0 * math.pi * near * radius),
            rtol=20.0 * near,
            atol=0,
        )
    assert halfspace.pressure(radius, radius, indentation, **LENS) == -math.inf
    radius, indentation = lens_contact()
    r = np.linspace(0.0, 0.999, 200) * radius
    assert np.all(
        halfspace.pressure(r, radius, radius**2 / LENS["sphere_radius"], **LENS) > 0.0
    )
    pulls = halfspace.pressure(r, radius, indentation, **LENS) < 0.0
    assert pulls[-1] and not pulls[0]
    assert np.count_nonzero(np.diff(pulls)) == 1
    assert_array_equal(
        halfspace.pressure([1.0001 * radius, 9.0], radius, indentation, **LENS), 0.0
    )


def exact_displacement(r, radius, indentation, sphere_radius):
    """Johnson's outer displacement in fifty digits."""
    with mpmath.workdps(50):
        r, a, delta, big = map(mpmath.mpf, (r, radius, indentation, sphere_radius))
        hertz = (
            (2 * a**2 - r**2) * mpmath.asin(a / r) + a * mpmath.sqrt(r**2 - a**2)
        ) / (mpmath.pi * big)
        punch = 2 / mpmath.pi * (delta - a**2 / big) * mpmath.asin(a / r)
        return hertz, punch, r**2 / (2 * big) - delta + hertz + punch


def test_displacement_and_gap_outside_against_fifty_digits_overlap_only_beyond_hertz():
    for ratio in [1.0 + 2.0**-40, 1.001, 1.019, 1.021, 1.5, 4.0, 9.0, 1e3, 1e6]:
        for radius, indentation in STATES[1:]:
            # 1.0198 is where the series of the gap ends, 4.04 where that of the displacement begins
            r = radius * ratio
            hertz, punch, opening = exact_displacement(r, radius, indentation, 2e-3)
            u = float(halfspace.normal_displacement(r, radius, indentation, 2e-3))
            assert abs(u - (hertz + punch)) < 3e-15 * (abs(hertz) + abs(punch))
            # sqrt(r^2 - a^2) is that of r - a, exact for this r; the series hold 1e-14 where they meet
            assert (
                abs(halfspace.gap(r, radius, indentation, 2e-3) / opening - 1) < 2e-14
            )
        if ratio <= 1e3:
            hertz_opening = exact_displacement(ratio, 1.0, 1.0, 1.0)[2]
            assert abs(halfspace.gap(ratio, 1.0, 1.0, 1.0) / hertz_opening - 1) < 2e-14
    rng = np.random.default_rng(6)
    radius = 10.0 ** rng.uniform(-9.0, -1.0, 4000)
    sphere_radius = radius * 10.0 ** rng.uniform(0.0, 4.0, 4000)
    indentation = radius**2 / sphere_radius * rng.uniform(-3.0, 1.0, 4000)
    r = radius * (1.0 + 10.0 ** rng.uniform(-15.0, 6.0, 4000))
    assert np.all(halfspace.gap(r, radius, indentation, sphere_radius) >= 0.0)
    assert halfspace.gap(1.001, 1.0, 1.5, 1.0) < 0.0


def test_the_surface_is_continuous_follows_the_sphere_inside_and_feels_the_load_far_away():
    for radius, indentation in STATES:
        inside = halfspace.normal_displacement(radius, radius, indentation, 2e-3)
        assert_allclose(inside, indentation - radius**2 / 4e-3, rtol=1e-15, atol=0)
        outside = halfspace.normal_displacement(
            radius * (1.0 + 1e-12), radius, indentation, 2e-3
        )
        # the punch leaves the edge as a square root: sqrt(2e-12) of a^2/R
        assert abs(outside - inside) < 2e-6 * radius**2 / 2e-3
        assert_array_equal(
            halfspace.gap(np.linspace(0.0, 1.0, 9) * radius, radius, indentation, 2e-3),
            0.0,
        )
    radius, indentation = lens_contact()
    r = 1e4 * radius
    far = float(halfspace.normal_displacement(r, radius, indentation, 2e-3))
    # the next term of the expansion is of relative order (a/r)^2 = 1e-8
    assert_allclose(far, 4e-3 / (math.pi * LENS["modulus"] * r), rtol=1e-7, atol=0)
