"""The periodic cell: transforms, multiplicities, Parseval."""

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from sim.numerics.grid import Grid


def fields(points, *members):
    return np.random.default_rng(1).standard_normal((*members, points, points))


def test_a_half_spectrum_holds_its_field_and_every_wavevector_once_by_the_integral_over_the_cell():
    for points in [1, 2, 3, 4, 7, 16, 33, 64]:
        grid = Grid(cell=2.4e-4, points=points)
        field, back = fields(points), np.empty((points, points))
        spectrum = grid.forward(field) / grid.cell**2
        grid.superpose(spectrum, back)
        assert np.max(np.abs(back - field)) < 1e-13
        power = np.abs(grid.forward(field + 0.3)) ** 2
        assert_allclose(
            np.sum(grid.multiplicity * power) / grid.area**2,
            np.mean((field + 0.3) ** 2),
            rtol=1e-12,
            atol=0,
        )
        assert grid.multiplicity.sum() * points == points**2
        full = 2.0 * np.pi * np.fft.fftfreq(points, grid.spacing)
        exact = np.sum(np.cos(1e-5 * np.hypot(full[:, None], full[None, :])))
        assert_allclose(
            np.sum(grid.multiplicity * np.cos(1e-5 * np.hypot(*grid.wavevectors))),
            exact,
            rtol=1e-12,
            atol=0,
        )
    for points in [8, 9]:
        grid = Grid(cell=0.3, points=points)
        field = fields(points)
        qx, qy = grid.wavevectors
        x = grid.spacing * np.arange(points)
        for i, j in [(0, 0), (1, 2), (points - 2, 3)]:
            phase = np.exp(-1j * (qx[i, 0] * x[:, None] + qy[0, j] * x[None, :]))
            assert_allclose(
                grid.forward(field)[i, j],
                np.sum(field * phase) * grid.spacing**2,
                rtol=1e-12,
                atol=0,
            )


def test_members_have_the_same_bits_in_any_batch():
    for points in [31, 64]:
        grid = Grid(cell=1.0, points=points)
        spectra = grid.forward(fields(points, 13))
        for member in (0, 6, 12):
            assert_array_equal(
                grid.forward(fields(points, 13)[member]), spectra[member]
            )
