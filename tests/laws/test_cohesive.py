"""Maugis & Dugdale's contact beside its equations in forty digits, beside a peer, and in both of its limits.

R = E* = w = 1 unless another is said: Maugis's number is then the cohesive stress times ``SCALE``.
"""

import importlib.metadata
import importlib.util
import math

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import integrate

from sim.laws import cohesive, jkr
from sim.laws.limits import tabor_number

SCALE = (4.5 / math.pi) ** (1 / 3)
BODY = 1.0, 1.0
NUMBERS = [0.05, 0.1, 0.3, 0.7, 0.937, 0.939, 1.5, 5.0, 50.0, 1e3]
SHORT_OF_NO_CONTACT = [0.1, 0.3, 0.7]


def touch(load, base, stiffness, number):
    return cohesive.equilibrium(load, base, stiffness, 1.0, number / SCALE, *BODY)


def fold(stiffness, number):
    return cohesive.pull_off(stiffness, 1.0, number / SCALE, *BODY)


def of_maugis(a, number):
    """Return outer radius, load and indentation by Maugis's equations in m = c/a, in forty digits."""
    unit = (3 * mpmath.pi / 4) ** (mpmath.mpf(1) / 3)
    number, reduced = mpmath.mpf(number), a / unit

    def excess(
        root,
    ):  # of sqrt(m^2 - 1), which the equations have as the tangent of an angle
        m, angle = mpmath.sqrt(1 + root**2), mpmath.atan(root)
        first = number * reduced**2 / 2 * (root + (m**2 - 2) * angle)
        second = 4 * number**2 * reduced / 3 * (root * angle - m + 1)
        return first + second - 1

    low, high = mpmath.mpf(0), mpmath.mpf(1)
    while excess(high) < 0:
        low, high = high, 4 * high
    for _ in range(140):
        root = (low + high) / 2
        low, high = (root, high) if excess(root) < 0 else (low, root)
    m, angle = mpmath.sqrt(1 + root**2), mpmath.atan(root)
    load = reduced**3 - number * reduced**2 * (root + m**2 * angle)
    depth = reduced**2 - 4 * number * reduced * root / 3
    return m * a, mpmath.pi * load, depth * unit**2


def assert_close(found, exact, size, tolerance):
    """Two arrays differ by less than a share of a size that differs from element to element."""
    assert_allclose((found - exact) / size, 0.0 * exact, atol=tolerance)


@pytest.mark.parametrize("number", NUMBERS)
def test_stable_contacts_are_those_of_maugis_equations(number):
    """The indentation is rounded, which moves the radius by that over its slope, so that the fold is no exception."""
    last, rounding = fold(math.inf, number), 2.0**-50
    for factor in (1.0001, 1.01, 1.3, 3.0, 20.0):
        with mpmath.workdps(40):
            a = mpmath.mpf(float(max(last.inner, 0.01))) * factor
            exact = outer, load, depth = of_maugis(a, number)
            further = of_maugis(a * (1 + mpmath.mpf(1e-15)), number)
            moved = rounding * (2 * a**2 - depth) / (further[2] - depth) * 1e-15
            slopes = [(x - y) / 1e-15 for x, y in zip(further, exact, strict=True)]
        outer, load, depth = map(float, exact)
        found = touch(0.0, depth, math.inf, number)
        share, sizes = float(moved) + 2.0**-48, [abs(float(x)) for x in slopes]
        assert_allclose(found.inner, float(a), rtol=share)
        assert_allclose(found.outer, outer, rtol=2.0**-48 + share * sizes[0] / outer)
        size = float(abs(load) + 2.0 * a**3)
        assert_close(found.load, load, size, 2.0**-48 + share * sizes[1] / size)


@pytest.mark.parametrize("number", NUMBERS)
def test_the_branch_is_that_of_maugis_equations_on_its_unstable_side_too(number):
    found = cohesive.branch(10.0 ** np.arange(-6, 7), 1.0, number / SCALE, *BODY)
    with mpmath.workdps(40):
        exact = [of_maugis(mpmath.mpf(float(a)), number) for a in found.inner]
    outer, load, depth = np.array(exact, dtype=float).T
    assert_allclose(found.outer, outer, rtol=1e-13)
    assert_close(found.load, load, np.abs(load) + 2.0 * found.inner**3, 1e-12)
    assert_close(found.indentation, depth, np.abs(depth) + 2.0 * found.inner**2, 1e-12)


@pytest.mark.verify
@pytest.mark.parametrize("tabor", np.geomspace(0.05, 10.0, 9))
def test_contacts_are_those_of_the_package_adhesion(tabor):
    try:
        package = importlib.metadata.distribution("Adhesion")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("needs the extra peers, or Adhesion without its dependencies")
    file = package.locate_file("Adhesion/ReferenceSolutions/MaugisDugdale.py")
    place = importlib.util.spec_from_file_location("maugis_dugdale", str(file))
    peer = importlib.util.module_from_spec(place)
    place.loader.exec_module(peer)
    stress = cohesive.stress_of_range(1.0, 1.0 / tabor)
    last = cohesive.pull_off(math.inf, 1.0, stress, *BODY).inner
    radii = np.geomspace(max(1.01 * float(last), 0.05), 10.0, 7)
    load, depth = peer.load_and_displacement(radii, 1.0, 1.0, 1.0, float(stress))
    found = cohesive.equilibrium(0.0, depth, math.inf, 1.0, stress, *BODY)
    assert_allclose(found.inner, radii, rtol=1e-8)
    assert_close(found.load, load, np.abs(load) + radii**3, 1e-8)


@pytest.mark.parametrize("number", SHORT_OF_NO_CONTACT)
def test_without_contact_the_gap_is_that_of_a_uniform_stress_over_the_outer_radius(
    number,
):
    """Elliptic integrals give the surface under a uniform stress; the gap is positive inside, the reach at c."""
    stress, first = number / SCALE, cohesive.branch(0.0, 1.0, number / SCALE, *BODY)
    last = fold(math.inf, number)
    assert last.inner == 0.0
    assert last.outer < first.outer
    depths = np.linspace(last.indentation * 0.999, first.indentation, 6)[:-1]
    found = touch(0.0, depths, math.inf, number)
    assert_allclose(found.inner, 0.0, atol=0)
    for c, load, depth in zip(found.outer, found.load, depths, strict=True):
        with mpmath.workdps(40):

            def gap(r, c=c, depth=depth):
                rise = (
                    4 * mpmath.mpf(stress) * c / mpmath.pi * mpmath.ellipe((r / c) ** 2)
                )
                return r**2 / 2 - depth - rise

            assert_allclose(float(gap(c)), 1.0 / stress, rtol=1e-12)
            assert min(gap(c * share) for share in (0.0, 0.3, 0.6, 0.9)) > 0.0
        assert_allclose(load, -math.pi * stress * c**2, rtol=1e-14)
        # the wider of the two radii with this indentation
        assert c > 4.0 * stress / math.pi


def test_the_branch_turns_into_that_without_contact_at_known_loads():
    # computed apart: loads over pi w R at a = 0
    found = cohesive.branch(0.0, 1.0, np.array([0.3, 0.7]) / SCALE, *BODY)
    assert_allclose(found.load / math.pi, [-1.74, -1.22], atol=0.005)
    assert fold(math.inf, 0.9379).inner == 0.0 < fold(math.inf, 0.9381).inner


@pytest.mark.parametrize("stiffness", [0.0, 1e-3, 1.0, 30.0, 1e4, math.inf])
def test_contacts_hold_their_mount_up_to_the_fold_and_none_is_found_beyond(stiffness):
    numbers = np.geomspace(1e-3, 1e5, 41)[:, np.newaxis]
    last = fold(stiffness, numbers)

    def pushed(contact):
        at_load = stiffness == 0.0
        return (
            contact.load if at_load else contact.indentation + contact.load / stiffness
        )

    edge, above = pushed(last), np.array([1e-9, 1e-5, 1e-2, 1.0, 1e2, 1e6])
    wanted = edge + np.abs(edge) * above
    mount = (wanted, 0.0) if stiffness == 0.0 else (0.0, wanted)
    found = touch(*mount, stiffness, numbers)
    assert_close(pushed(found), wanted, np.abs(edge) + np.abs(wanted), 1e-14)
    assert np.all(np.diff(found.outer, axis=1) > 0.0)
    assert np.all(found.outer > last.outer * (1.0 - 1e-12))
    beyond = edge - 1e-9 * np.abs(edge)
    mount = (beyond, 0.0) if stiffness == 0.0 else (0.0, beyond)
    assert np.all(np.isnan(touch(*mount, stiffness, numbers).inner))


@pytest.mark.parametrize("stiffness", [0.0, 1e-4, 1e-2, 1.0, 1e2, 1e4, math.inf])
def test_the_branch_has_one_fold_and_is_convex_on_its_stable_side(stiffness):
    """The solver rests on this, for which there is no proof."""
    v = np.geomspace(1e-5, 1e7, 20001)
    for number in np.geomspace(1e-3, 1e5, 33):
        contact = cohesive.branch(v, 1.0, number / SCALE, *BODY)
        pushed = contact.load
        if stiffness > 0.0:
            pushed = contact.indentation + contact.load / stiffness
        slope = np.diff(pushed) / np.diff(v)
        assert np.count_nonzero(np.diff(np.sign(slope))) <= 1
        right = slope[np.argmin(pushed) :]
        assert np.all(np.diff(right) > -1e-8 * np.abs(right[1:]))


@pytest.mark.parametrize("stiffness", [0.5, 30.0, math.inf])
@pytest.mark.parametrize("number", NUMBERS)
def test_the_area_of_a_loop_is_the_difference_of_the_energies_at_both_jumps(
    number, stiffness
):
    stress, last = number / SCALE, fold(stiffness, number)
    start, end = -1.0 / stress, float(last.indentation + last.load / stiffness)

    def energy(contact):
        return float(contact.energy + 0.5 * contact.load**2 / stiffness)

    # the root at the fold is taken out
    def load(t):
        at = end + (start - end) * t * t
        return 2.0 * t * float(touch(0.0, at, stiffness, number).load)

    area = -integrate.quad(load, 0.0, 1.0, epsabs=0, epsrel=1e-12, limit=500)[0]
    area *= start - end
    both = energy(last) - energy(touch(0.0, start, stiffness, number))
    assert_allclose(both, area, rtol=1e-10)


@pytest.mark.parametrize("base", [-0.5, 0.0, 2.0])
def test_a_short_range_is_jkr_but_for_terms_of_the_inverse_square_of_the_number(base):
    numbers = np.array([1e2, 1e3, 1e4])
    radius = jkr.radius_at_displacement(base, 10.0, 1.0, *BODY)
    load = jkr.load_under_displacement(radius, base, 10.0, *BODY)
    found = touch(0.0, base, 10.0, numbers)
    pulled = cohesive.pull_off([[0.0], [math.inf]], 1.0, numbers / SCALE, *BODY)
    for values, exact in (
        (found.inner, radius),
        (found.outer, radius),
        (found.load, load),
        (pulled.load[0], jkr.pull_off_load(1.0, 1.0)),
        (pulled.indentation[1], jkr.pull_off_indentation(1.0, *BODY)),
    ):
        off = np.abs(values / exact - 1.0)
        assert np.all(off < 2.0 * numbers**-2.0)
        assert_allclose(off[1:] / off[:-1], 0.01, rtol=0.1)


def test_a_long_range_is_hertz_under_twice_pi_w_r_more():
    load = np.array([-0.5, 0.0, 3.0, 100.0])
    exact = jkr.hertz_radius_at_load(load + 2.0 * math.pi, *BODY)
    for number in (1e-3, 1e-4, 1e-5):
        assert_allclose(touch(load, 0.0, 0.0, number).inner, exact, rtol=2.0 * number)
        lost = fold(0.0, number).load
        assert_allclose(lost, -2.0 * math.pi, rtol=number**1.5)


def test_without_work_of_adhesion_the_contact_is_hertz():
    for work in (0.0, -0.3):
        found = cohesive.equilibrium([-1.0, 0.0, 2.0], 0.0, 0.0, work, 1.0, 2.0, 3.0)
        assert_allclose(
            found.inner, jkr.hertz_radius_at_load([-1.0, 0.0, 2.0], 2.0, 3.0)
        )
        base = np.array([-1e-3, 0.0, 0.5])
        found = cohesive.equilibrium(0.0, base, 7.0, work, 1.0, 2.0, 3.0)
        exact = jkr.radius_at_displacement(base, 7.0, 0.0, 2.0, 3.0)
        assert_allclose(found.inner, exact, rtol=1e-14)
        assert_allclose(
            found.load[1:], 7.0 * (base - found.indentation)[1:], atol=1e-14
        )
    unknown = cohesive.equilibrium(1.0, 0.0, 0.0, math.nan, 1.0, 1.0, 1.0)
    assert np.all(np.isnan(unknown))
    assert np.isnan(cohesive.pull_off(0.0, 0.0, 1.0, 1.0, 1.0).load)


def test_a_vanishing_work_of_adhesion_leaves_hertz_whichever_of_range_and_stress_is_held():
    work = np.array([1e-6, 1e-12, 1e-30, 1e-200])
    for stress in (np.full(4, 0.7), cohesive.stress_of_range(work, 0.5)):
        for mount in ((1.0, 0.0, 0.0), (0.0, 1.0, math.inf), (0.0, 1.0, 3.0)):
            found = cohesive.equilibrium(*mount, work, stress, *BODY)
            exact = cohesive.equilibrium(*mount, 0.0, 0.0, *BODY)
            assert_allclose(found.inner, np.full(4, exact.inner), rtol=1e-2)
            assert_allclose(found.inner[2:], np.full(2, exact.inner), rtol=1e-12)


def test_a_contact_depends_on_its_number_alone_in_other_units():
    """A tip in nanonewtons and a lens in millinewtons, beside the contact of the same number in units of one."""
    for work, sphere_radius, modulus in ((0.4, 1e-7, 4.65e10), (0.042, 2e-3, 6.4e6)):
        stress = cohesive.stress_of_range(work, 0.3e-9)
        number = cohesive.maugis_number(work, stress, sphere_radius, modulus)
        tabor = tabor_number(work, sphere_radius, modulus, 0.3e-9)
        assert_allclose(number / tabor, 1.157, rtol=1e-4)
        unit = np.cbrt(work * sphere_radius**2 / modulus)
        body = work, stress, sphere_radius, modulus
        for load in (-1.0, 0.0, 10.0):
            found = cohesive.equilibrium(load * work * sphere_radius, 0.0, 0.0, *body)
            plain = touch(load, 0.0, 0.0, number)
            assert_allclose(found.inner, plain.inner * unit, rtol=1e-13)
            assert_allclose(found.energy, plain.energy * work * unit**2, rtol=1e-11)


@pytest.mark.parametrize("number", [0.3, 1.5, 20.0])
def test_the_surface_touches_the_sphere_and_leaves_it_by_the_reach_at_the_outer_radius(
    number,
):
    """Without tension at the inner edge, so that the gap opens there with a horizontal tangent."""
    stress = number / SCALE
    for base in (-0.9 / stress, 0.0, 2.0):
        contact = touch(0.0, base, math.inf, number)
        a, c = contact.inner, contact.outer
        r = np.append(np.linspace(0.0, c, 41), 1.2 * a)

        def gap(r, contact=contact):
            moved = cohesive.normal_displacement(r, contact, stress, *BODY)
            return moved + 0.5 * r**2 - contact.indentation

        assert_allclose(gap(np.array(c)), 1.0 / stress, rtol=1e-6)
        if a > 0.0:
            assert_allclose(gap(r[r <= a]), 0.0, atol=1e-13 * (1.0 + c**2))
        assert np.all(np.diff(gap(np.linspace(a, 3.0 * c, 50))) > 0.0)
        if a > 0.0:
            near = np.array([1e-4, 1e-3]) * (c - a)
            opened = gap(a + near)
            assert opened[0] < 0.05 * opened[1]
    far = cohesive.normal_displacement(1e6, contact, stress, *BODY)
    assert_allclose(far, contact.load / (math.pi * 1e6), rtol=1e-8)
