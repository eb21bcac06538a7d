"""A bonded incompressible layer: compliances of waves beside a solution of the layered equations in 40 digits."""

import mpmath
import numpy as np
import pytest
from mpmath import mp
from numpy.testing import assert_allclose

from sim.laws import halfspace, layer

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
