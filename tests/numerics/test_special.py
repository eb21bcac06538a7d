"""Exponential integrals, Lambert's W, roots and other special functions against digits of mpmath."""

import functools
import math

import mpmath as mp
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from sim.numerics import special
from sim.numerics.jit import law
from sim.numerics.special import cube_root

ORDERS = [0, 1, 2]


@functools.cache
def gamma_at_one(most):
    """Taylor coefficients of Gamma(1 + s) around s = 0."""
    with mp.workdps(60):
        return mp.taylor(mp.gamma, 1, most)


def by_residues(z, order):
    """e^z E(z) from the poles of Gamma(s)/s^(j + 1) z^-s: z up to 20, where 17 of 60 digits are lost."""
    with mp.workdps(60):
        z = mp.mpf(z)
        # of z^-s
        powers = ((-mp.log(z)) ** n / mp.factorial(n) for n in range(order + 1, -1, -1))
        at_zero = mp.fdot(gamma_at_one(order + 1), powers)
        poles = (
            z**n * (-1) ** n / mp.factorial(n) / mp.mpf(-n) ** (order + 1)
            for n in range(1, 150)
        )
        return mp.exp(z) * (at_zero + mp.fsum(poles))


def by_quadrature(z, order):
    """e^z E(z) from int (ln(1 + w/z))^j e^-w/(z + w) dw/j!, scaled to 1 for the absolute tolerance of mpmath."""
    with mp.workdps(30):
        z, edges = mp.mpf(z), [0, 1, 4, 12, 30, 70, 150]

        def scaled(w):
            return (z * mp.log1p(w / z)) ** order * mp.exp(-w) / (1 + w / z)

        return (
            mp.quad(scaled, edges, method="gauss-legendre")
            / mp.factorial(order)
            / z ** (order + 1)
        )


def test_the_exponential_integrals_to_thirty_digits_by_references_that_agree():
    for order in ORDERS:
        assert abs(by_residues(5, order) / by_quadrature(5, order) - 1) < 1e-28
    assert abs(by_residues(0.3, 0) / (mp.exp(0.3) * mp.expint(1, 0.3)) - 1) < 1e-14
    for order in ORDERS:
        # rounding: 1e-15 / E(1/2) in the series, 2e-14 in the weights of the quadrature
        small = np.array(
            [
                1e-300,
                1e-100,
                1e-9,
                1e-6,
                1e-3,
                0.07,
                0.3,
                0.4999,
                0.5001,
                0.9,
                2.0,
                6.0,
                20.0,
            ]
        )
        large = np.array([50.0, 700.0, 1e6, 1e9, 1e16, 1e18, 1e100])
        exact = [by_residues(z, order) for z in small] + [
            by_quadrature(z, order) for z in large
        ]
        for z, value in zip([*small, *large], exact, strict=True):
            with mp.workdps(50):
                whole = float(value * mp.mpf(z) ** (order + 1))
            assert_allclose(
                special.scaled_exponential_integral(z, order),
                float(value),
                rtol=5e-14,
                atol=0,
            )
            assert_allclose(
                special.reduced_exponential_integral(z, order),
                whole,
                rtol=5e-14,
                atol=1e-300,
            )
    for order in ORDERS:
        assert_array_equal(
            special.reduced_exponential_integral([0.0, math.inf], order), [0.0, 1.0]
        )
        assert_array_equal(
            special.scaled_exponential_integral([0.0, math.inf], order), [math.inf, 0.0]
        )
        # the next term is 3e-4 of this one at order 2
        large = 1.0 - special.reduced_exponential_integral(1e5, order)
        assert_allclose(large, (order + 1) * (order + 2) / 2e5, rtol=3e-4, atol=0)


def test_sine_integral_and_error_function_are_right_to_rounding():
    x = [0.0, 1e-9, 0.1, 1.0, 2.0, 2.999999, 3.0, 3.3, 5.0, 8.0, 20.0, 1e2, 1e3, 1e5]
    with mp.workdps(40):
        exact = [float(mp.si(mp.mpf(value))) for value in x]
    assert_allclose(
        special.sine_integral(x), exact, rtol=8 * np.finfo(float).eps, atol=0
    )
    low = np.array([-30.0, -9.0, -1.0, -0.1, 0.3, 8.0, 20.0])
    high = np.array([-20.0, -8.5, 2.0, 0.1, 0.4, 9.0, np.inf])
    with mp.workdps(450):
        exact = [float(mp.erf(h) - mp.erf(a)) for a, h in zip(low, high, strict=True)]
    assert_allclose(
        special.erf_between(low, high), exact, rtol=8 * np.finfo(float).eps, atol=0
    )


def test_lambert_w_to_fifty_digits_and_arguments_without_an_answer():
    x = np.array(
        [
            1e-300,
            1e-12,
            1e-6,
            1e-3,
            0.1,
            0.5,
            1.0,
            math.e,
            4.0,
            30.0,
            1e3,
            1e8,
            1e16,
            1e100,
            1e300,
        ]
    )
    with mp.workdps(50):
        exact = [float(mp.lambertw(mp.mpf(value)).real) for value in x]
    assert_allclose(special.lambert_w(x), exact, rtol=1e-15, atol=0)
    assert_array_equal(special.lambert_w([0.0, math.inf]), [0.0, math.inf])
    for function in (
        special.reduced_exponential_integral,
        special.scaled_exponential_integral,
    ):
        assert np.isnan(
            function([-1.0, math.nan, 1.0, 1.0], [0.0, 0.0, 3.0, 0.5])
        ).all()
    assert np.isnan(special.lambert_w([-1e-9, -math.inf, math.nan])).all()


def test_the_exponential_function_is_right_to_one_unit_in_the_last_place():
    points = np.concatenate(
        [
            np.linspace(-708.0, 709.0, 2001),
            np.linspace(-1.0, 1.0, 1001),
            [1e-300, -1e-17, 0.0],
        ]
    )
    for x in points:
        assert abs(mp.mpf(special.exp(x)) / mp.exp(mp.mpf(float(x))) - 1) <= 2.0**-52
    assert [special.exp(x) for x in (0.0, -709.0, -math.inf, 710.0, math.inf)] == [
        1.0,
        0.0,
        0.0,
        math.inf,
        math.inf,
    ]


@law
def root(x):
    return cube_root(x)


def test_the_cube_root_is_right_to_one_unit_in_the_last_place_and_exact_of_cubes():
    random = np.random.default_rng(1)
    numbers = np.concatenate(
        [
            10.0 ** random.uniform(-323, 308, 3000),
            [5e-324, 2.3e-308, 1e-280, 1e280, 1.7e308],
        ]
    )
    with mp.workdps(40):
        exact = [mp.cbrt(mp.mpf(float(x))) for x in numbers]
        errors = [
            abs(float(mp.mpf(float(r)) / e - 1))
            for r, e in zip(root(numbers), exact, strict=True)
        ]
    assert max(errors) < 2.3e-16
    assert_array_equal(
        root(np.array([0.0, np.inf, np.nan, -1.0, -np.inf])),
        [0.0, np.inf, np.nan, np.nan, np.nan],
    )
    # a cube of a float has its root exactly; numpy's own is a unit off at 27 on some machines
    assert_array_equal(root(np.array([1.0, 8.0, 27.0, 1e-3])), [1.0, 2.0, 3.0, 0.1])
