"""The modes of a periodic cell: exact pixel variances, which modes there are, realisations."""

import itertools
import math
from itertools import product

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import integrate, special

from sim.parts.shear.modes import _spread, modes
from sim.solid import HalfSpace
from sim.spectrum.families import (
    AnisotropicGaussian,
    Band,
    Gaussian,
    Ripple,
    SelfAffine,
    Tabulated,
    VonKarman,
)

TURN = 2 * math.pi

AFFINE = SelfAffine(1.3, 0.8, longest=1 / 2.2, rolloff=1 / 4.3, shortest=1 / 9.1)
STEEP = Tabulated(
    tuple(TURN * n for n in (0.3, 1.9, 2.0, 5.3, 5.4, 8.0)),
    (0.0, 1.0, 1e-6, 1e-6, 3e-2, 1e-9),
)
CUT_OFF = {
    "self_affine": AFFINE,
    "band": Band(1.3, longest=1 / 2.2, shortest=1 / 9.1),
    "thin_band": Band(1.3, longest=1 / 3.2, shortest=1 / 3.3),
    "wider_than_the_cell": SelfAffine(
        1.3, 1.0, longest=5.0, rolloff=4.0, shortest=1 / 7.3
    ),
    "h0": SelfAffine(1.3, 0.0, longest=1 / 2.2, rolloff=1 / 2.2, shortest=1 / 9.1),
    "h1": SelfAffine(1.3, 1.0, longest=1 / 2.2, rolloff=1 / 4.3, shortest=1 / 9.1),
    "steep_table": STEEP,
}
SMOOTH = {
    "gaussian": Gaussian(1.3, 0.11),
    "von_karman": VonKarman(1.3, 0.2, 0.3),
    "anisotropic": AnisotropicGaussian(1.3, 0.11, 0.23),
    "turned": AnisotropicGaussian(1.3, 0.11, 0.23, angle=0.4),
    "turned_over": AnisotropicGaussian(1.3, 0.23, 0.11, angle=2.0),
    "long_streaks": AnisotropicGaussian(1.3, 0.05, 3.0, angle=0.1),
}


def pixel_by_quadrature(spectrum, ix, iy):
    """The density integrated over one pixel of the unit cell / 4π², y inside x, split at the breaks."""
    circles = np.asarray(getattr(spectrum, "breaks", ())) / TURN
    left, right, low, high = ix - 0.5, ix + 0.5, iy - 0.5, iy + 0.5

    def across(x):
        cuts = [math.sqrt(c * c - x * x) for c in circles if c > abs(x)]
        cuts = sorted(
            {low, high} | {s * y for y in cuts for s in (-1, 1) if low < s * y < high}
        )
        return math.fsum(
            integrate.quad(
                lambda y: float(spectrum.density(TURN * x, TURN * y)),
                a,
                b,
                epsabs=0,
                epsrel=1e-11,
            )[0]
            for a, b in itertools.pairwise(cuts)
        )

    corners = {
        s * math.sqrt(max(c * c - y * y, 0.0))
        for c in circles
        for y in (low, high, 0.0)
        for s in (-1, 1)
    }
    cuts = sorted({left, right} | {x for x in corners if left < x < right})
    return math.fsum(
        integrate.quad(
            across, a, b, epsabs=1e-15 * spectrum.variance, epsrel=1e-10, limit=200
        )[0]
        for a, b in itertools.pairwise(cuts)
    )


@pytest.mark.parametrize(
    ("name", "pixels"),
    [
        ("self_affine", [(0, 2), (3, 3), (4, 2), (6, 7)]),
        ("thin_band", [(0, 3), (2, 2), (3, 1)]),
        ("wider_than_the_cell", [(1, 0), (3, 4)]),
        ("steep_table", [(1, 0), (1, 2), (6, 6)]),
        pytest.param(
            "self_affine",
            [(2, 1), (0, 4), (9, 0), (9, 2), (5, 5)],
            marks=pytest.mark.verify,
        ),
        pytest.param(
            "wider_than_the_cell", [(0, 0), (1, 1), (7, 2)], marks=pytest.mark.verify
        ),
        pytest.param(
            "steep_table",
            [(0, 0), (2, 0), (5, 0), (4, 4), (3, 4), (8, 0)],
            marks=pytest.mark.verify,
        ),
    ],
)
def test_a_pixel_cut_by_the_cut_offs_has_the_integral_of_the_density(name, pixels):
    # inner end points with a square root leave quad with 1e-9 at worst
    exact = [pixel_by_quadrature(CUT_OFF[name], *pixel) for pixel in pixels]
    ix, iy = np.transpose(pixels)
    variances = CUT_OFF[name].pixels(TURN, 9)[9 + ix, iy]
    assert_allclose(variances, exact, rtol=1e-9, atol=1e-13 * CUT_OFF[name].variance)


def test_a_pixel_of_a_smooth_spectrum_near_or_far_has_the_integral_of_the_density():
    pixels = [(0, 0), (1, 0), (-1, 1), (0, 2), (-3, 2), (7, 7), (-7, 6)]
    ix, iy = np.transpose(pixels)
    for spectrum in SMOOTH.values():
        exact = [pixel_by_quadrature(spectrum, *pixel) for pixel in pixels]
        assert_allclose(
            spectrum.pixels(TURN, 7)[7 + ix, iy],
            exact,
            rtol=1e-9,
            atol=1e-14 * spectrum.variance,
        )
    for length in [0.03, 0.3, 1.0, 3.0, 30.0]:
        reach = 6
        pixels = Gaussian(1.3, length).pixels(TURN, reach)
        edges = TURN * length / 2 * (np.arange(-reach, reach + 2) - 0.5)
        across = (
            np.where(
                edges[:-1] > 0,
                -np.diff(special.erfc(edges)),
                np.diff(special.erf(edges)),
            )
            / 2
        )
        exact = 1.3**2 * across[:, None] * across[reach:]
        assert_allclose(pixels, exact, rtol=0, atol=1e-15)
        # where erfc keeps its digits: sums differ by 2e-16 of the variance from halved ones
        positive = edges[:-1] > 0
        assert_allclose(pixels[positive], exact[positive], rtol=1e-11, atol=1e-18)
    for name in ["gaussian", "von_karman"]:
        spectrum, reach = SMOOTH[name], 60
        pixels = spectrum.pixels(TURN, reach)
        node, weight = np.polynomial.legendre.leggauss(20)
        for ix, iy in [(20, 5), (30, 0)]:
            x, y = TURN * (ix + node[:, None] / 2), TURN * (iy + node / 2)
            exact = weight @ spectrum.density(x, y) @ weight / 4
            assert_allclose(pixels[reach + ix, iy], exact, rtol=1e-11, atol=0)


def whole_plane(pixels):
    return math.fsum(pixels[:, 1:].ravel()) * 2 + math.fsum(pixels[:, 0])


def test_all_pixels_hold_the_variance_but_that_around_zero_and_energies_are_compliance_times_density():
    for spectrum in CUT_OFF.values():
        assert_allclose(
            whole_plane(spectrum.pixels(TURN, 10)),
            spectrum.variance,
            rtol=1e-13,
            atol=0,
        )
    for spectrum in (CUT_OFF | SMOOTH).values():
        large = spectrum.pixels(TURN * 9, 0)[0, 0]
        assert_allclose(
            whole_plane(spectrum.pixels(TURN, 4)), large, rtol=1e-12, atol=0
        )
    pairs = modes(Gaussian(2.0, 0.1), 1.0, 64)
    lost = special.erf(math.pi * 0.1 / 2) ** 2
    assert_allclose(
        pairs.errors(HalfSpace(1.0))["cell_error_variance"], -lost, rtol=1e-12, atol=0
    )
    assert abs(modes(AFFINE, 1.0).errors(HalfSpace(1.0))["cell_error_variance"]) < 1e-14
    assert_allclose(_spread(np.full(10, 0.3)), 1 / math.sqrt(10), rtol=1e-15, atol=0)
    pairs = modes(Band(1.3, longest=1 / 4, shortest=1 / 12), 2.5)
    nu, modulus = 0.3, 1.7
    inside = np.hypot(pairs.ix, pairs.iy) / 2.5
    inside = (inside > 4.4) & (inside < 11.6)  # pixels of constant density
    q = np.hypot(pairs.qx, pairs.qy)
    compliance = (1 - nu + nu * (pairs.qy / q) ** 2) / (modulus * q)
    exact = compliance * pairs.spectrum.density(pairs.qx, pairs.qy) / 2.5**2
    assert_allclose(
        pairs.energies(HalfSpace(modulus, nu, coupling=0.0))[inside],
        exact[inside],
        rtol=1e-11,
        atol=0,
    )


def test_modes_are_one_of_each_pair_of_pixels_that_meet_the_annulus_without_nyquist_and_zero():
    pairs = modes(AFFINE, 1.0)
    lattice = list(zip(pairs.ix.tolist(), pairs.iy.tolist(), strict=True))
    low, high = AFFINE.support[0] / TURN, AFFINE.support[1] / TURN
    meeting = set()
    for ix, iy in itertools.product(range(-11, 12), range(12)):
        nearest = math.hypot(max(abs(ix) - 0.5, 0), max(iy - 0.5, 0))
        if (
            nearest < high
            and math.hypot(abs(ix) + 0.5, iy + 0.5) > low
            and (iy > 0 or ix > 0)
        ):
            meeting.add((ix, iy))
    assert sorted(lattice) == sorted(meeting)
    assert np.all(np.diff(pairs.ix**2 + pairs.iy**2) >= 0)
    assert_allclose(
        np.hypot(pairs.qx, pairs.qy),
        TURN * np.hypot(pairs.ix, pairs.iy),
        rtol=1e-15,
        atol=0,
    )
    assert np.all(pairs.variance > 0.0)
    for points in [16, 17]:
        pairs = modes(VonKarman(1.0, 0.2, 0.5), 1.0, points)
        reach = (points - 1) // 2
        assert len(pairs.ix) == ((2 * reach + 1) ** 2 - 1) // 2
        assert np.max(np.abs(pairs.ix)) == np.max(pairs.iy) == reach
    corner = math.hypot(1.5, 0.5)  # of pixel (1, 0)
    touched = modes(Band(1.0, longest=1 / corner, shortest=1 / 4.5), 1.0)
    assert touched.points == 10
    assert np.max(touched.iy) == 4
    assert (1, 0) not in zip(touched.ix, touched.iy, strict=True)
    assert (1, 1) in zip(touched.ix, touched.iy, strict=True)
    for name in ["self_affine", "h0", "wider_than_the_cell"]:
        spectrum = CUT_OFF[name]
        waves = spectrum.longest, spectrum.rolloff, spectrum.shortest
        small, large = (
            modes(SelfAffine(rms, spectrum.hurst, *waves), 1.0) for rms in (1e-6, 1e9)
        )
        assert np.array_equal(small.ix, large.ix)
        assert_allclose(small.variance, large.variance * 1e-30, rtol=1e-11, atol=0)


def test_energy_of_a_spectrum_converges_with_the_cell_and_loses_that_around_zero():
    # -(2 - ν)/(8π) 3.900265 C(0)/(G L); the pixel's curvature adds a term in 1/L²
    beta = (mpmath.zeta(0.5, 0.25) - mpmath.zeta(0.5, 0.75)) / 2
    constant = float(-4 * mpmath.zeta(0.5) * beta)  # minus the lattice sum of 1/|n|
    for nu, spectrum in product(
        [0.5, 0.3], [Gaussian(1.3, 1.0), AnisotropicGaussian(1.3, 1.0, 1.6, angle=0.7)]
    ):
        deficit = (
            (2 - nu) / (8 * math.pi) * constant * float(spectrum.density(0.0, 0.0))
        )
        exact, rest = HalfSpace(1.0, nu, coupling=0.0).stored_energy(spectrum), []
        for cell in (40.0, 80.0):
            pairs = modes(spectrum, cell, int(6 * cell))
            error = np.sum(pairs.energies(HalfSpace(1.0, nu, coupling=0.0))) - exact
            assert_allclose(
                pairs.errors(HalfSpace(1.0, nu, coupling=0.0))["cell_error_energy"],
                error / exact,
                rtol=1e-9,
                atol=0,
            )
            rest.append(error + deficit / cell)
            assert abs(rest[-1]) < 0.05 * deficit / cell * (40.0 / cell)
        assert 3.5 < rest[0] / rest[1] < 4.5  # second order
    spectrum = SelfAffine(1.3, 0.8, longest=1.0, rolloff=0.5, shortest=0.1)
    errors = [
        abs(modes(spectrum, cell).errors(HalfSpace(1.0))["cell_error_energy"])
        for cell in (2.0, 8.0)
    ]
    # second order would be 16, less the lattice's own irregularity
    assert errors[1] < errors[0] / 8


def test_a_ripple_is_one_pair_with_the_energy_of_the_ripple_whether_it_fits_or_not():
    pairs = modes(Ripple(3.0, 0.25, angle=math.pi), 1.0)
    assert (pairs.ix.tolist(), pairs.iy.tolist(), pairs.on_lattice) == ([4], [0], True)
    assert pairs.variance.tolist() == [4.5]
    assert set(modes(Ripple(0.0, 0.25), 1.0).errors(HalfSpace(1.0)).values()) == {0.0}
    for wavelength, angle, nu in product(
        [0.25, 0.26], [0.0, 0.3, 1.2, math.pi / 2, 2.5, -0.4, math.pi], [0.5, 0.3]
    ):
        ripple = Ripple(3.0, wavelength, angle)
        pairs = modes(ripple, 1.0)
        assert not pairs.on_lattice or wavelength == 0.25
        assert pairs.errors(HalfSpace(1.0))["cell_error_variance"] == 0.0
        assert pairs.qy[0] > 0.0 or (pairs.qy[0] == 0.0 and pairs.qx[0] > 0.0)
        assert_allclose(
            pairs.energies(HalfSpace(1.7, nu, coupling=0.0)).sum(),
            HalfSpace(1.7, nu, coupling=0.0).stored_energy(ripple),
            rtol=1e-14,
            atol=0,
        )
        assert_allclose(
            pairs.qx**2 + pairs.qy**2, (TURN / wavelength) ** 2, rtol=1e-14, atol=0
        )


def test_the_smallest_even_grid_holds_the_spectrum_and_a_cell_without_modes_is_refused():
    for spectrum in [AFFINE, Band(1.0, 1 / 2, 1 / 8), Ripple(1.0, 0.25)]:
        pairs = modes(spectrum, 1.0)
        assert pairs.points % 2 == 0
        assert max(np.max(np.abs(pairs.ix)), np.max(pairs.iy)) == pairs.points // 2 - 1
        smaller = modes(spectrum, 1.0, pairs.points - 1)  # odd, and just as far
        assert np.array_equal(smaller.variance, pairs.variance)
        with pytest.raises(ValueError, match=f"at least {pairs.points - 1} points"):
            modes(spectrum, 1.0, pairs.points - 2)
    for spectrum, cell, points, cure in (
        (Gaussian(1.0, 0.1), 1.0, None, "give points"),
        (Band(1.0, longest=9.0, shortest=8.0), 1.0, None, "make the cell longer"),
        (
            AnisotropicGaussian(1.0, 1.0, 2000.0, angle=0.8),
            1.0,
            8,
            "make the cell longer",
        ),
        (Gaussian(1.0, 0.1), 1.0, 2, "at least 3"),
        (AFFINE, 0.0, None, "positive length"),
    ):
        with pytest.raises(ValueError, match=cure):
            modes(spectrum, cell, points)
