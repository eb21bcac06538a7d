"""The half-space under shear: kernel and compliance, the uniform disc, energies of waves and maps."""

import math

import mpmath
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad

from sim.laws import halfspace
from sim.numerics.grid import Grid

RATIOS = [0.0, 0.3, 0.5]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(60)


def disc_nodes(radius=1.0, turns=96):
    """Positions and weights that integrate smooth functions over a disc."""
    r = 0.5 * radius * (1.0 + NODES)
    angle = 2.0 * np.pi * (np.arange(turns) + 0.5) / turns
    x, y = r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)
    weight = 0.5 * radius * (WEIGHTS * r)[:, None] * np.full(turns, 2.0 * np.pi / turns)
    return x, y, weight


def test_the_moduli_of_one_body_and_of_two_and_the_compliance_and_kernel_of_the_paper():
    x, y = np.random.default_rng(1).standard_normal((2, 50)) * 1e5
    r = np.hypot(x, y)
    assert_allclose(
        halfspace.compliance(x, y, 1.6e6),
        (1.0 + y**2 / r**2) / (2.0 * 1.6e6 * r),
        rtol=1e-14,
        atol=0,
    )
    point = (1.0 + x**2 / r**2) / (4.0 * np.pi * 1.6e6 * r)
    assert_allclose(
        halfspace.point_displacement(x, y, 1.6e6), point, rtol=1e-14, atol=0
    )
    assert halfspace.point_displacement(0.0, 0.0, 1.0) == np.inf
    for nu in RATIOS:
        young = 2.0 * 1e6 * (1.0 + nu)
        assert_allclose(
            halfspace.contact_modulus(1e6, nu),
            young / (1.0 - nu**2),
            rtol=1e-15,
            atol=0,
        )
    soft, hard = (1.6e6, 0.5), (40e6, 0.2)
    series = halfspace.in_series(*soft, *hard)
    qx, qy = np.random.default_rng(3).standard_normal((2, 30)) * 1e5
    total = halfspace.compliance(qx, qy, *soft) + halfspace.compliance(qx, qy, *hard)
    assert_allclose(halfspace.compliance(qx, qy, *series), total, rtol=1e-14, atol=0)
    normal = 1.0 / halfspace.contact_modulus(*soft) + 1.0 / halfspace.contact_modulus(
        *hard
    )
    assert_allclose(
        1.0 / halfspace.contact_modulus(*series), normal, rtol=1e-14, atol=0
    )
    assert_allclose(halfspace.in_series(*soft, math.inf, 0.3), soft, rtol=1e-15, atol=0)


def test_energy_means_and_edge_of_a_disc_belong_together():
    a, tau, shear = 1.3, 0.7, 2.1
    for nu in RATIOS:
        energy = halfspace.disc_tangential_energy(a, tau, shear, nu)
        mean = halfspace.disc_mean_displacement(a, tau, shear, nu)
        edge = halfspace.disc_edge_mean_displacement(a, tau, shear, nu)
        slope = 3.0 * energy / a  # of a cube
        modulus = halfspace.contact_modulus(shear, nu)
        assert_allclose(energy, 0.5 * tau * np.pi * a**2 * mean, rtol=1e-14, atol=0)
        assert_allclose(tau * edge, slope / (2.0 * np.pi * a), rtol=1e-14, atol=0)
        assert_allclose(
            halfspace.edge_work(a, tau, shear, nu), -slope, rtol=1e-14, atol=0
        )
        assert_allclose(
            edge,
            2 * (2 - nu) / (1 - nu) * tau * a / (np.pi * modulus),
            rtol=1e-14,
            atol=0,
        )
    # the paper's, at one half
    assert_allclose(
        halfspace.disc_tangential_energy(a, tau, shear),
        tau**2 * a**3 / shear,
        rtol=1e-14,
        atol=0,
    )
    for nu in RATIOS:
        x, y, weight = disc_nodes()
        v = halfspace.disc_displacement(x, y, 1.0, 1.0, 1.0, nu)
        # the field ends at the edge as (1 - rho) log(1 - rho): the quadrature holds about 1e-7
        assert_allclose(
            np.sum(weight * v) / np.pi,
            halfspace.disc_mean_displacement(1.0, 1.0, 1.0, nu),
            rtol=1e-6,
            atol=0,
        )
        angle = 2.0 * np.pi * np.arange(16) / 16
        edge = np.mean(
            halfspace.disc_displacement(np.cos(angle), np.sin(angle), 1.0, 1.0, 1.0, nu)
        )
        assert_allclose(
            edge,
            halfspace.disc_edge_mean_displacement(1.0, 1.0, 1.0, nu),
            rtol=1e-14,
            atol=0,
        )


def test_ripples_across_the_sliding_store_twice_that_along_it_and_that_of_masking_the_work():
    angle = np.array([0.0, 0.3, 1.0, np.pi / 2])
    exact = 9e10 / (8 * 1.6e6 * 2e5) * (1.0 + np.sin(angle) ** 2)
    assert_allclose(
        halfspace.ripple_energy(3e5, 2e5, angle, 1.6e6), exact, rtol=1e-14, atol=0
    )
    angle = np.linspace(0.0, np.pi, 7)
    for nu in RATIOS:
        tau = halfspace.masking_amplitude(0.042, 24e-6, 1.6e6, angle, nu)
        assert_allclose(
            halfspace.ripple_energy(tau, 2 * np.pi / 24e-6, angle, 1.6e6, nu),
            0.042,
            rtol=1e-14,
            atol=0,
        )
    assert np.isnan(halfspace.masking_amplitude(-1.0, 24e-6, 1.6e6))
    lenses = halfspace.masking_amplitude(
        0.042, np.array([0.24e-3, 4e-3]) / 10.0, np.array([1.6e6, 0.5e6]), 0.0
    )
    # the paper's
    assert_allclose(lenses, [375157.7679867801, 51370.593037412235], rtol=1e-12, atol=0)


def test_compliance_is_even_and_the_transform_of_the_point_kernel():
    for nu in RATIOS:
        assert halfspace.compliance(3e4, -4e4, 1e6, nu) == halfspace.compliance(
            -3e4, -4e4, 1e6, nu
        )
        assert halfspace.compliance(-3e4, 4e4, 1e6, nu) == halfspace.compliance(
            -3e4, -4e4, 1e6, nu
        )
        assert halfspace.compliance(0.0, 0.0, 1e6, nu) == 0.0
    assert np.isnan(halfspace.compliance(np.nan, 1.0, 1e6))
    # q^2 would underflow or overflow here
    assert_allclose(halfspace.compliance(0.0, 1e-200, 1e6), 1e194, rtol=1e-14, atol=0)
    assert_allclose(halfspace.compliance(1e200, 0.0, 1e6), 0.5e-206, rtol=1e-14, atol=0)
    for nu in RATIOS:
        for direction in [0.0, 0.7, math.pi / 2]:
            # both sides weighted by a Gaussian of unit width, which makes either integral smooth:
            # integral of G(x) e^{-r^2/2} cos(q.x) = integral of G(k) 2 pi e^{-|k-q|^2/2} / (2 pi)^2
            q = 1.5
            r = 20.0 * 0.5 * (1.0 + NODES)
            weight = 20.0 * 0.5 * WEIGHTS * r
            angle = 2.0 * np.pi * np.arange(200) / 200
            x, y = r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)
            phase = q * (x * math.cos(direction) + y * math.sin(direction))
            kernel = (
                halfspace.point_displacement(x, y, 1.0, nu)
                * np.exp(-0.5 * r[:, None] ** 2)
                * np.cos(phase)
            )
            real = np.sum(weight @ kernel) * 2.0 * np.pi / 200
            away = (x - q * math.cos(direction)) ** 2 + (
                y - q * math.sin(direction)
            ) ** 2
            spread = halfspace.compliance(x, y, 1.0, nu) * np.exp(-0.5 * away)
            assert_allclose(real, np.sum(weight @ spread) / 200, rtol=1e-10, atol=0)


def exact_inside(rho, theta):
    """(A8) of the paper in units of tau0 a/G, with fifty digits."""
    with mpmath.workdps(50):
        rho, theta = mpmath.mpf(rho), mpmath.mpf(theta)
        e, k = mpmath.ellipe(rho**2), mpmath.ellipk(rho**2)
        skew = (2 - rho**2) / rho**2 * e / 6 - (1 - rho**2) / rho**2 * k / 3
        return float((1.5 * e + skew * mpmath.cos(2 * theta)) / mpmath.pi)


def test_displacement_of_a_disc_is_the_papers_and_the_integral_of_the_point_kernel():
    for rho in [1e-8, 1e-4, 0.03, 0.3, 0.7, 0.94, 0.95, 0.999, 1.0 - 1e-9]:
        for theta in (0.0, 0.4, 1.1, math.pi / 2):
            computed = halfspace.disc_displacement(
                rho * math.cos(theta), rho * math.sin(theta), 1.0, 1.0, 1.0
            )
            # near the edge the elliptic integrals amplify the rounding of rho by the logarithm of 1 - rho
            assert_allclose(computed, exact_inside(rho, theta), rtol=3e-14, atol=0)
    v = halfspace.disc_displacement(
        [0.0, 2e-4, 0.0], [0.0, 0.0, 2e-4], 2e-4, 3e5, 1.6e6
    )
    unit = 3e5 * 2e-4 / 1.6e6
    assert_allclose(
        v / unit,
        [0.75, (1.5 + 1.0 / 6.0) / math.pi, (1.5 - 1.0 / 6.0) / math.pi],
        rtol=1e-14,
        atol=0,
    )
    x, y, a = 3e3, -4e3, 2.0
    force = np.pi * a**2 * 0.7
    exact = force * halfspace.point_displacement(x, y, 1.3, 0.4)
    # the next term of the multipole series is of order (a/r)^2
    assert_allclose(
        halfspace.disc_displacement(x, y, a, 0.7, 1.3, 0.4),
        exact,
        rtol=(a / 5e3) ** 2,
        atol=0,
    )
    angle = np.linspace(0.0, 2.0 * np.pi, 50)
    inner, outer = (
        halfspace.disc_displacement(s * np.cos(angle), s * np.sin(angle), 1.0, 1.0, 1.0)
        for s in (1.0 - 1e-12, 1.0 + 1e-12)
    )
    # the slope at the edge grows as the logarithm of the distance, about 30 here
    assert np.max(np.abs(inner - outer)) < 2e-12 * 30.0
    for nu in RATIOS:
        for x, y in [(0.0, 0.0), (0.3, 0.0), (0.2, -0.5), (-0.1, 0.9)]:
            # the kernel falls as 1/r: along a ray from the point its integral is the ray's length
            def ray(angle):
                c, s = math.cos(angle), math.sin(angle)
                length = -(x * c + y * s) + math.sqrt(1.0 - (x * s - y * c) ** 2)
                return length * halfspace.point_displacement(c, s, 1.0, nu)

            exact, _ = quad(
                ray, 0.0, 2.0 * math.pi, epsabs=1e-13, epsrel=1e-13, limit=200
            )
            assert_allclose(
                halfspace.disc_displacement(x, y, 1.0, 1.0, 1.0, nu),
                exact,
                rtol=1e-11,
                atol=0,
            )
        for x, y in [(1.5, 0.0), (0.0, 1.5), (-1.3, 1.1), (6.0, -2.0)]:
            at_x, at_y, weight = disc_nodes()
            exact = np.sum(
                weight * halfspace.point_displacement(x - at_x, y - at_y, 1.0, nu)
            )
            assert_allclose(
                halfspace.disc_displacement(x, y, 1.0, 1.0, 1.0, nu),
                exact,
                rtol=1e-12,
                atol=0,
            )


def stress_map(points, members=(), seed=4):
    return 2e5 + 1e5 * np.random.default_rng(seed).standard_normal(
        (*members, points, points)
    )


def test_surface_energy_is_the_sum_over_the_full_spectrum_and_of_a_ripple_the_closed_form():
    for points in [6, 7]:
        cell, field = 3.0, stress_map(points)
        q = 2.0 * np.pi * np.fft.fftfreq(points, cell / points)
        power = np.abs(np.fft.fft2(field) * (cell / points) ** 2) ** 2
        exact = (
            0.5
            * np.sum(halfspace.compliance(q[:, np.newaxis], q, 1.3) * power)
            / cell**4
        )
        assert_allclose(
            halfspace.surface_energy(field, cell, 1.3), exact, rtol=1e-12, atol=0
        )
    cell, waves = 2.4e-4, np.array([(3, 0), (0, 3), (2, 5), (-4, 1)])
    qx, qy = 2.0 * np.pi * waves.T[:, :, np.newaxis, np.newaxis] / cell
    exact = halfspace.ripple_energy(
        3e5, np.hypot(qx, qy), np.arctan2(qy, qx), 1.6e6, 0.4
    ).ravel()
    for points in [31, 32]:
        x = cell * np.arange(points) / points
        field = 4e5 + 3e5 * np.cos(qx * x[:, np.newaxis] + qy * x + 0.4)
        assert_allclose(
            halfspace.surface_energy(field, cell, 1.6e6, 0.4), exact, rtol=1e-12, atol=0
        )
        assert_allclose(
            halfspace.surface_energy(field + 1e8, cell, 1.6e6, 0.4),
            exact,
            rtol=1e-10,
            atol=0,
        )
        assert (
            halfspace.surface_energy(np.full((points, points), 0.3e6), cell, 1.6e6)
            < 1e-30 * exact.min()
        )


def test_energy_and_displacement_of_a_rectangle_and_of_members_belong_together():
    for points, sides in [
        ((12, 7), (3.0, 1.4)),
        ((8, 8), (1.0, 2.0)),
        ((9, 16), (2.0, 2.0)),
        ((33, 33), (5.0, 5.0)),
    ]:
        field = np.random.default_rng(5).standard_normal((3, *points)) + 2.0
        for nu in RATIOS:
            moved = halfspace.displacement(field, sides, 2.0, nu)
            energy = halfspace.surface_energy(field, sides, 2.0, nu)
            assert np.max(np.abs(moved.mean(axis=(-2, -1)))) < 1e-14 * np.max(
                np.abs(moved)
            )
            assert_allclose(
                energy, 0.5 * np.mean(field * moved, axis=(-2, -1)), rtol=1e-12, atol=0
            )
            # the same field in a cell twice as wide
            twice = np.concatenate([field, field], axis=-1)
            wide = halfspace.surface_energy(twice, (sides[0], 2.0 * sides[1]), 2.0, nu)
            assert_allclose(wide, energy, rtol=1e-12, atol=0)
        turned = halfspace.surface_energy(
            np.swapaxes(field, -1, -2), sides[::-1], 2.0, 0.0
        )
        # at nu = 0 x is as y
        assert_allclose(
            turned, halfspace.surface_energy(field, sides, 2.0, 0.0), rtol=1e-12
        )
    field = stress_map(16, (4,))
    shear = np.array([1e6, 2e6, 3e6, 4e6])
    together = halfspace.surface_energy(field, 1e-4, shear)
    moved = halfspace.displacement(field, 1e-4, shear)
    for member in range(4):
        assert (
            halfspace.surface_energy(field[member], 1e-4, shear[member])
            == together[member]
        )
        assert_array_equal(
            halfspace.displacement(field[member], 1e-4, shear[member]), moved[member]
        )


def test_white_noise_of_pixels_seems_to_store_a_closed_form():
    exact = 3 * mpmath.asinh(1) / (4 * mpmath.pi)
    assert_allclose(
        halfspace.noise_energy(3.0, 2.0, 5.0),
        float(exact) * 9.0 * 2.0 / 5.0,
        rtol=1e-15,
    )
    assert_allclose(float(exact), 0.210412, rtol=5e-6)
    # a periodic cell of n pixels lacks 0.23278/n of it, as the pixel of q = 0 is left out; the rest falls as 1/n²
    for n in (31, 101):
        grid = Grid(float(n), n)
        mean = (
            0.5
            * np.sum(grid.multiplicity * halfspace.compliance(*grid.wavevectors, 1.0))
            / grid.cell**2
        )
        assert_allclose(
            n * (mean - float(exact)), -3 / (16 * math.pi) * 3.900265, atol=1.0 / n
        )
        weight = 0.5 * halfspace.compliance(*grid.wavevectors, 1.0) / grid.cell**2
    noise = np.random.default_rng(6).standard_normal((50, n, n))
    spread = math.sqrt(
        2.0 * float(np.sum(grid.multiplicity * weight**2)) / len(noise)
    )  # each of a pair ±q has the same square
    assert (
        abs(np.mean(halfspace.surface_energy(noise, float(n), 1.0)) - mean)
        < 5.0 * spread
    )
