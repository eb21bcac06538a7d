"""A bonded incompressible layer: compliances of waves beside a solution of the layered equations in 40 digits."""

import mpmath
import numpy as np
import pytest
from helpers.layer_punch import contact, yielding
from mpmath import mp
from numpy.testing import assert_allclose

from sim.laws import halfspace, layer
from sim.laws.layer_table import WIDEST

#: Wavenumber times thickness, on both sides of the place at which the series end.
PLACES = [1e-4, 0.01, 0.3, 0.999, 1.001, 2.0, 7.0, 30.0]
#: Rows of ``fields``.
TANGENTIAL, NORMAL, SHEAR, TENSION = range(4)


def fields(z):
    """Return tangential and normal displacement, shear and normal stress of four solutions at a height z.

    The solutions are those of G∇²u = ∇p with ∇·u = 0 at G = 1 and a wave exp(ix). Their displacement is (iU, W), their
    pressure p. For s = ±1 they are U = s, W = 1, p = 0 and U = sz, W = z - s, p = 2, each times exp(sz). The stresses
    are U' + W and 2W' - p.
    """
    columns = []
    for s in (1, -1):
        fade = mpmath.exp(s * z)
        for values in (
            [s, 1, 2, 2 * s],
            [s * z, z - s, 2 * z, 2 * (s * z - 1)],
        ):
            columns.append([fade * value for value in values])
    return mpmath.matrix(columns).T


def surface(thickness, kept, shear):
    """Return both displacements of the surface at a shear stress, and at 1 - ``shear`` of what is ``kept`` besides."""
    top, base = fields(mpmath.mpf(0)), fields(-mpmath.mpf(thickness))
    rows = [base[TANGENTIAL, :], base[NORMAL, :], top[SHEAR, :], top[kept, :]]
    system = mpmath.matrix([list(row) for row in rows])
    weights = mpmath.lu_solve(system, mpmath.matrix([0, 0, shear, 1 - shear]))
    moved = top * weights
    return moved[TANGENTIAL], moved[NORMAL]


@pytest.mark.parametrize("x", PLACES)
def test_the_compliances_of_a_layer_solve_its_equations(x):
    with mp.workdps(40):
        free, risen = surface(x, TENSION, 1)
        held, still = surface(x, NORMAL, 1)
        drawn, lifted = surface(x, TENSION, 0)
        across = mpmath.tanh(mpmath.mpf(x))
        assert abs(still) < 1e-25 * held and abs(risen - drawn) < 1e-25 * held
        # the normal stress under the sphere takes away the displacement that it couples to
        assert abs(free - risen * drawn / lifted - held) < 1e-20 * held
    for law, value in (
        (layer.along_free, free),
        (layer.along_held, held),
        (layer.normal, lifted),
        (layer.across, across),
    ):
        assert_allclose(law(x), float(value), rtol=1e-14, atol=0)


def test_a_layer_is_a_half_space_under_short_waves_and_sheared_as_a_whole_under_long_ones():
    q = np.geomspace(20.0, 1e150, 60)
    qx, qy = 0.6 * q, -0.8 * q
    thick = layer.compliance(qx, qy, 1.0, 3.0)
    assert_allclose(thick, halfspace.compliance(qx, qy, 3.0), rtol=1e-14, atol=0)
    assert layer.compliance(0.0, 0.0, 1.0, 3.0) == 0.0
    # h/G across the wave; along it h/(4G), because what moves at the surface flows back below it
    thin = layer.compliance([1e-6, 0.0, 6e-7], [0.0, 1e-6, 8e-7], 2.0, 3.0)
    assert_allclose(thin, [1 / 6, 2 / 3, 0.36 / 6 + 0.64 * 2 / 3], rtol=1e-10, atol=0)


#: e_1, e_2, g_1 and g_2 at a/h, on which five discretisations of Fredholm's equation agree.
KNOWN = {
    0.0: (1.0, 1.0, 1.0, 1.0 / 3.0),
    0.1: (1.12508943403, 1.04157919393, 1.12598726745, 0.375209130905),
    0.25: (1.35400626014, 1.11616204626, 1.36947015845, 0.454403101666),
    0.5: (1.80467379042, 1.25649746179, 1.93293437085, 0.626527820868),
    1.0: (2.77210138427, 1.55075644191, 3.61873584896, 1.08404342249),
    2.0: (4.83714884188, 2.20043265647, 9.1494504521, 2.43003021019),
    3.0: (7.16076267584, 2.91785655067, 18.1573993806, 4.49215040165),
    5.0: (12.5621664435, 4.51138413694, 50.1397379684, 11.3755492164),
    8.0: (22.3075626955, 7.25285046803, 146.320433719, 30.8122914458),
}


def functions(x):
    """Return e_1, e_2, g_1, g_2 and g_3 of the table."""
    return np.array(
        [
            layer.contact_function(which, x)
            for which in (layer.E_1, layer.E_2, layer.G_1, layer.G_2, layer.G_3)
        ]
    )


def test_the_contact_functions_have_their_known_values():
    values = functions(np.array(list(KNOWN)))[:4].T
    assert_allclose(values, list(KNOWN.values()), rtol=1e-11, atol=0)


# 1e-10 is what a user is told; the numbers of both sides carry some 2e-11 at the end of the table
@pytest.mark.parametrize(
    "x", [1e-8, 1e-3, 0.04, 0.7, 1.7, 3.3, 6.1, 14.0, 33.0, 61.0, 79.9]
)
def test_the_contact_functions_solve_fredholms_equation(x):
    assert_allclose(functions(x), contact(x), rtol=5e-11 if x > 20 else 1e-11, atol=0)


@pytest.mark.parametrize("x", [1e-6, 0.02, 0.4, 1.3, 5.5, 17.0, 44.0, 79.0])
def test_a_disc_under_a_uniform_stress_moves_as_the_waves_of_its_stress_do(x):
    share, change = yielding(x)
    assert_allclose(layer.contact_function(layer.M, x), share, rtol=2e-11, atol=0)
    exact = share + change / 3.0
    assert_allclose(layer.contact_function(layer.N, x), exact, rtol=2e-11, atol=0)
    assert_allclose(
        layer.contact_function(layer.M_SLOPE, x), change / x, rtol=1e-8, atol=0
    )
    step = 1e-3 * x * np.array([-2.0, -1.0, 1.0, 2.0])
    slope = (
        layer.contact_function(layer.N, x + step) @ [1.0, -8.0, 8.0, -1.0] / (12e-3 * x)
    )
    known = layer.contact_function(layer.N_SLOPE, x)
    assert_allclose(slope, known, rtol=1e-9, atol=1e-11 * exact / x)


def test_a_thin_layer_is_sheared_as_a_whole_and_stores_half_of_the_square_of_the_stress():
    # 1/k_t = h/(πGa²), and dU/dA = τ²h/(2G) beside 3τ²a/(2πG) of a half-space
    for which, limit in ((layer.M, np.pi / 2.0), (layer.N, np.pi / 3.0)):
        excess = (
            layer.contact_function(which, np.array([40.0, 80.0])) * [40, 80] / limit
        )
        # an edge of the layer's thickness yields more, in proportion to h/a
        assert_allclose(1.0 - excess[0], 2.0 * (1.0 - excess[1]), rtol=0.1)
    for which in (layer.M, layer.N):
        beyond, end = layer.contact_function(
            which, np.array([80.0 * (1 + 1e-14), 80.0])
        )
        assert_allclose(beyond, end, rtol=2e-4 if which == layer.N else 1e-12, atol=0)


def test_a_contact_much_wider_than_the_layer_is_that_of_a_thin_film():
    x = np.linspace(20.0, WIDEST, 200)
    film = 3.0 * np.pi / 64.0 * x**3 * (1.0 + 1.458 / x) ** 4
    assert_allclose(layer.contact_function(layer.G_1, x), film, rtol=5e-4, atol=0)
    # under a sphere without adhesion the pressure of a film vanishes at the edge with its slope: e_2/e_1 = 1/4
    excess = (
        layer.contact_function(layer.E_2, x) / layer.contact_function(layer.E_1, x)
        - 0.25
    )
    assert np.all((excess * x > 0.6) & (excess * x < 0.8))


def test_the_energy_that_a_growing_contact_releases_is_the_slope_of_what_it_stores():
    for x in (0.01, 0.3, 1.0, 4.0, 20.0, 70.0, 90.0, 300.0):
        e1, e2 = functions(x)[:2]
        for which, power, slope in (
            (layer.G_1, 1, e1 * e1),
            (layer.G_2, 3, x**2 * e1 * e2),
            (layer.G_3, 5, x**4 * e2 * e2),
        ):
            step = 1e-3 * x * np.array([-2.0, -1.0, 1.0, 2.0])
            values = (x + step) ** power * layer.contact_function(which, x + step)
            # four points: an error of (1e-3)⁴/30 of the fifth derivative
            difference = values @ [1.0, -8.0, 8.0, -1.0] / (12e-3 * x)
            assert_allclose(difference, slope, rtol=1e-9, atol=0)
        for which in (layer.E_1, layer.E_2):
            values = layer.contact_function(which, x + step)
            difference = values @ [1.0, -8.0, 8.0, -1.0] / (12e-3 * x)
            known = layer.contact_function(which + 1, x)
            assert_allclose(difference, known, rtol=1e-9, atol=1e-12 * values[0] / x)
    beyond, end = (functions(x) for x in (np.nextafter(WIDEST, 99.0), WIDEST))
    assert_allclose(beyond, end, rtol=1e-13, atol=0)
