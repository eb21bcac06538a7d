"""Energy of a fluctuating shear stress on a finite disc: spectra, single waves and maps."""

import math

import mpmath
import numpy as np
import pytest
from helpers.discs import disc_energies
from numpy.testing import assert_allclose
from scipy import special

from sim.laws import halfspace
from sim.solid import HalfSpace
from sim.spectrum.families import (
    AnisotropicGaussian,
    Band,
    BondMade,
    Gaussian,
    Ripple,
    SelfAffine,
    VonKarman,
)
from sim.spectrum.measured import Tabulated
from sim.spectrum.radial import disc_energy, marginal_energy

RATIOS = [0.0, 0.3, 0.5]
SPECTRA = [
    Ripple(1.0, 0.3, 0.4),
    Band(1.0, 0.5, 0.2),
    Gaussian(1.0, 0.15),
    AnisotropicGaussian(1.0, 0.1, 0.4, 0.3),
    VonKarman(1.0, 0.15, 0.3),
    SelfAffine(1.0, 0.8, 0.5, 0.2, 0.01),
    Tabulated((5.0, 10.0, 20.0, 80.0), (0.0, 2.0, 1.0, 0.01)),
    BondMade(0.1),
]
NODES, WEIGHTS = np.polynomial.legendre.leggauss(20)
#: k waves on the diameter: E/(pi a^2) along x, across, and dE/dA, over the plane's, from direct overlap integrals.
TABLE = [
    (1, 1.2067868845072907, 0.9028233335802799, 0.90282),
    (2, 1.1019211152308137, 0.9499393397673098, 0.94994),
    (5, 1.04056905249316, 0.9797763423077571, 0.97978),
    (10, 1.020269354234092, 0.9898729991413905, 0.98987),
    (20, 1.0101327595014724, 0.9949345819551205, 0.99493),
]
PLANE = {0.0: 1.0 / 8.0, math.pi / 2: 1.0 / 4.0}


def overlap_integral(around, marginal=False, panels=400):
    """The overlap integral of a field per area of the unit disc, at unit modulus, in real space.

    ``around`` is the angular mean of kernel times s times correlation; with s = 2 sin(phi) the root at s = 2 is smooth.
    """
    edge = 0.5 * np.pi * np.linspace(0.0, 1.0, panels + 1) ** 3  # finer towards s = 0
    half = 0.5 * np.diff(edge)[:, None]
    phi = edge[:-1, None] + half * (1.0 + NODES)
    t = np.sin(phi)
    area = np.arccos(t) - (0.0 if marginal else t * np.cos(phi))
    return 4.0 * np.sum(half * WEIGHTS * np.cos(phi) * area * around(2.0 * t))


def isotropic(correlation, nu=0.5):
    return lambda s: (2.0 - nu) / (4.0 * np.pi) * correlation(s)


def jinc_correlation(band):
    """Autocorrelation of a flat band, sigma = 1."""
    q1, q2 = band.support
    return lambda s: (
        2.0
        * (q2 * special.j1(q2 * s) - q1 * special.j1(q1 * s))
        / ((q2**2 - q1**2) * s)
    )


def test_waves_along_and_across_a_disc_store_the_tabulated_energy():
    for k, along, across, marginal in TABLE:
        for angle, ratio in ((0.0, along), (math.pi / 2, across)):
            wave = Ripple(2.0, 2e-5 / k, angle)
            assert_allclose(
                disc_energy(wave, 1e-5, HalfSpace(1.6e6).softness)
                / HalfSpace(1.6e6).stored_energy(wave),
                ratio,
                rtol=1e-10,
                atol=0,
            )
            # the five digits given
            edge = marginal_energy(wave, 1e-5, HalfSpace(1.6e6).softness) / HalfSpace(
                1.6e6
            ).stored_energy(wave)
            assert_allclose(edge, marginal, rtol=5e-6 / 0.9, atol=0)


def test_factors_are_the_bessel_integrals_of_the_overlap():

    def of_disc(t):
        return mpmath.acos(t) - t * mpmath.sqrt(1 - t * t)

    for factors, area in (
        (halfspace.energy_factors, of_disc),
        (halfspace.marginal_factors, mpmath.acos),
    ):
        for x in (1e-3, 0.7, 2.999, 3.001, 9.0, 40.0):
            cuts = mpmath.linspace(0, 1, 2 + int(x / 3))
            mean = x * mpmath.quad(
                lambda t, x=x, area=area: area(t) * mpmath.besselj(0, x * t), cuts
            )
            skew = -x * mpmath.quad(
                lambda t, x=x, area=area: area(t) * mpmath.besselj(2, x * t), cuts
            )
            # P = q/(2 a^2) integral of A J0 ds; s = 2 a t. At x = 3 the closed form of S loses a digit
            assert_allclose(factors(x), [float(mean), float(skew)], rtol=3e-14, atol=0)


def test_gaussian_exponential_and_band_fields_obey_the_overlap_integral():
    for xi in [0.01, 0.1, 1.0, 30.0]:
        for nu in RATIOS:
            gaussian, exponential = Gaussian(1.0, xi), VonKarman(1.0, xi, 0.5)
            for marginal, energy in ((False, disc_energy), (True, marginal_energy)):
                exact = overlap_integral(
                    isotropic(lambda s: np.exp(-((s / xi) ** 2)), nu), marginal
                )
                assert_allclose(
                    energy(gaussian, 1.0, HalfSpace(1.0, nu, coupling=0.0).softness),
                    exact,
                    rtol=1e-12,
                    atol=0,
                )
                exact = overlap_integral(
                    isotropic(lambda s: np.exp(-s / xi), nu), marginal
                )
                assert_allclose(
                    energy(exponential, 1.0, HalfSpace(1.0, nu, coupling=0.0).softness),
                    exact,
                    rtol=1e-11,
                    atol=0,
                )
    for waves in [
        (50.0, 20.0),
        (1.0, 0.5),
        (0.1, 0.09),
        (0.02, 0.015),
        (0.002, 0.0018),
    ]:
        band = Band(1.0, *waves)
        for marginal, energy in ((False, disc_energy), (True, marginal_energy)):
            exact = overlap_integral(
                isotropic(jinc_correlation(band)),
                marginal,
                panels=400 + int(12.0 / waves[1]),
            )
            assert_allclose(
                energy(band, 1.0, HalfSpace(1.0).softness), exact, rtol=1e-11, atol=0
            )


def test_streaks_obey_the_overlap_integral_and_a_self_affine_field_is_the_sum_of_its_bands():
    for angle in [0.0, 0.6, math.pi / 2]:
        for nu in [0.0, 0.4]:
            spectrum, turn = (
                AnisotropicGaussian(1.0, 0.2, 0.7, angle),
                2 * np.pi * np.arange(256) / 256,
            )
            # falls as 1/s
            kernel = halfspace.point_displacement(np.cos(turn), np.sin(turn), 1.0, nu)
            squares = (np.cos(turn - angle) / 0.2) ** 2 + (
                np.sin(turn - angle) / 0.7
            ) ** 2
            for marginal, energy in ((False, disc_energy), (True, marginal_energy)):
                exact = overlap_integral(
                    lambda s: np.mean(
                        kernel * np.exp(-squares * s[..., np.newaxis] ** 2), axis=-1
                    ),
                    marginal,
                    40,
                )
                assert_allclose(
                    energy(spectrum, 1.0, HalfSpace(1.0, nu, coupling=0.0).softness),
                    exact,
                    rtol=1e-11,
                    atol=0,
                )
    spectrum = SelfAffine(1.0, 0.8, 0.8, 0.3, 0.01)
    q1, q2 = spectrum.support
    edge = np.geomspace(q1, q2, 4001)
    inner = np.sqrt(edge[1:] * edge[:-1])
    waves = Ripple(1.0, 1.0)
    ratio = 0.75 / (math.pi * inner) * halfspace.energy_factors(2.0 * inner)[0]
    # a ring's energy is the mean of its two principal waves; variance of each ring from the closed form
    rings = np.diff(spectrum.cumulative(edge)) * ratio / (2 * waves.variance)
    # 4000 rings a step of 1.5e-3 wide: the oscillation sin(x)/x^2, x up to 1200, turns by 0.1 to 1 rad a ring
    assert_allclose(
        disc_energy(spectrum, 1.0, HalfSpace(1.0).softness),
        np.sum(rings),
        rtol=1e-5,
        atol=0,
    )


def test_a_disc_of_many_waves_is_the_plane_and_below_every_wavelength_the_stress_is_uniform():
    for spectrum in SPECTRA:
        for nu in RATIOS:
            plane = HalfSpace(1.6e6, nu, coupling=0.0).stored_energy(spectrum)
            for energy in (disc_energy, marginal_energy):
                # the deficit is of first order in length/a or less, with a factor below 2
                assert_allclose(
                    energy(spectrum, 1e6, HalfSpace(1.6e6, nu, coupling=0.0).softness),
                    plane,
                    rtol=1e-6,
                    atol=0,
                )
                assert_allclose(
                    energy(
                        spectrum, np.inf, HalfSpace(1.6e6, nu, coupling=0.0).softness
                    ),
                    plane,
                    rtol=1e-14,
                    atol=0,
                )
                assert (
                    energy(spectrum, 0.0, HalfSpace(1.6e6, nu, coupling=0.0).softness)
                    == 0.0
                )
    spectrum = Gaussian(1.0, 1e-3)
    plane, deficit = (
        HalfSpace(1.0).stored_energy(spectrum),
        2 / np.pi * 1e-3 / math.sqrt(math.pi),
    )
    # 1 - (2/pi) xi/(sqrt(pi) a), and half of it for the margin; the next term is cubic in xi/a
    assert_allclose(
        1 - disc_energy(spectrum, 1.0, HalfSpace(1.0).softness) / plane,
        deficit,
        rtol=2e-6,
        atol=0,
    )
    assert_allclose(
        1 - marginal_energy(spectrum, 1.0, HalfSpace(1.0).softness) / plane,
        deficit / 2,
        rtol=2e-6,
        atol=0,
    )
    for spectrum in SPECTRA:
        for nu in RATIOS:
            a = 1e-7
            uniform = halfspace.disc_tangential_energy(
                a, math.sqrt(spectrum.variance), 1.0, nu
            ) / (np.pi * a * a)
            # a correlation that falls like s^(2H) is the slowest: 1.1 (a/xi)^0.6 at H = 0.3
            rtol = 2e-4 if spectrum.model == "von_karman" else 2e-5
            assert_allclose(
                disc_energy(spectrum, a, HalfSpace(1.0, nu, coupling=0.0).softness),
                uniform,
                rtol=rtol,
                atol=0,
            )
            assert_allclose(
                marginal_energy(spectrum, a, HalfSpace(1.0, nu, coupling=0.0).softness),
                1.5 * uniform,
                rtol=rtol,
                atol=0,
            )


def test_marginal_energy_is_the_derivative_of_the_energy():
    # d(a^2 e)/d(a^2), six-point central difference: error h^6, rounding 1e-15/h
    a, h = np.array([0.05, 0.37, 2.0]), 4e-3
    radius = a[:, None] * (1 + h * np.array([-3, -2, -1, 1, 2, 3]))
    weight = np.array([-1, 9, -45, 45, -9, 1]) / 60
    for spectrum in SPECTRA:
        total = radius**2 * disc_energy(
            spectrum, radius, HalfSpace(1.0, 0.3, coupling=0.0).softness
        )
        slope = np.sum(weight * total, axis=1) / (2 * h * a**2)
        # x = 2qa reaches 1200 for the largest disc; that part of E is a millionth, its h^6 term stays below 1e-7
        assert_allclose(
            slope,
            marginal_energy(spectrum, a, HalfSpace(1.0, 0.3, coupling=0.0).softness),
            rtol=2e-7,
            atol=0,
            err_msg=spectrum.model,
        )


def test_a_radius_that_is_no_length_is_refused():
    for spectrum in (Gaussian(1.0, 1.0), Ripple(1.0, 1.0)):
        with pytest.raises(ValueError, match="at least zero"):
            disc_energy(spectrum, np.nan, HalfSpace(1.0).softness)


def test_the_map_of_a_wave_converges_to_the_table_in_second_order():
    for k, along, across, _ in TABLE[:4]:
        for angle, ratio in ((0.0, along), (math.pi / 2, across)):
            exact = ratio * PLANE[angle] / (np.pi * k)
            coarse, fine = (
                np.mean(disc_energies(wave_maps(n, k, angle), 2.0, 1.0, HalfSpace(1.0)))
                for n in (128, 256)
            )
            # a quarter of the error, 0.24 k (pixel/a)^2 at most
            assert abs(coarse / exact - 1) < 0.3 * k * (2 / 128) ** 2
            assert 3.5 < (coarse - exact) / (fine - exact) < 4.8
            assert_allclose((4 * fine - coarse) / 3, exact, rtol=1e-5, atol=0)
    for nu in [0.0, 0.3]:  # oblique, at any Poisson ratio
        exact = disc_energy(
            Ripple(1.0, 2 / 3, 0.5), 0.77, HalfSpace(1.0, nu, coupling=0.0).softness
        )
        energy = np.mean(
            disc_energies(
                wave_maps(160, 3, 0.5), 2.0, 0.77, HalfSpace(1.0, nu, coupling=0.0)
            )
        )
        assert_allclose(energy, exact, rtol=0.3 * 3 * (2 / 160 / 0.77) ** 2, atol=0)
    # the disc has no images of itself: the cell around it does not matter
    small = disc_energies(np.ones((40, 40)), 1.0, 0.5, HalfSpace(1.0))
    assert_allclose(
        small,
        disc_energies(np.ones((120, 120)), 3.0, 0.5, HalfSpace(1.0)),
        rtol=1e-13,
        atol=0,
    )


def test_a_uniform_map_stores_its_energy():
    for nu in RATIOS:
        points, a = 96, 0.83
        exact = halfspace.disc_tangential_energy(a, 3.0, 2.0, nu) / (np.pi * a**2)
        field = np.full((points, points), 3.0)
        # the edge is blurred over a pixel: 0.1 (pixel/a)^2 relative
        rtol = 0.1 * (2.0 / points / a) ** 2
        assert_allclose(
            disc_energies(field, 2.0, a, HalfSpace(2.0, nu, coupling=0.0)),
            exact,
            rtol=rtol,
            atol=0,
        )


def wave_maps(points, k, angle, cell=2.0):
    """A wave and the same a quarter period on, whose energies average to the mean over all phases."""
    x = (np.arange(points) - points / 2) * cell / points
    phase = np.pi * k * (x[:, None] * math.cos(angle) + x * math.sin(angle))
    return np.stack([np.cos(phase), np.sin(phase)])


def gaussian_maps(members, points, cell, xi, seed):
    """Gaussian fields of correlation exp(-r^2/xi^2) on a periodic cell, the mean of the cell included."""
    rng = np.random.default_rng(seed)
    q = 2 * np.pi * np.fft.fftfreq(points, cell / points)
    density = np.pi * xi**2 * np.exp(-(xi**2) / 4 * (q[:, None] ** 2 + q**2))
    white = np.fft.fft2(rng.standard_normal((members, points, points)))
    return np.fft.ifft2(white * np.sqrt(density)).real * points / cell


def five_sigma_of_spread(sample):
    """Five standard errors of the standard deviation of a sample."""
    deviation = sample - sample.mean()
    fourth = np.mean(deviation**4) / np.mean(deviation**2) ** 2
    return 5 * sample.std() * math.sqrt((fourth - 1) / (4 * len(sample)))


def test_discs_of_random_maps_average_to_the_overlap_integral_that_is_expected():
    # a cell of 3 a: the ends of the disc are 1 a apart through the border, correlated by e^-44
    xi, members, pixel = 0.15, 2000, 0.05
    energy = disc_energies(
        gaussian_maps(members, 60, 3.0, xi, seed=11), 3.0, 1.0, HalfSpace(1.0)
    )
    exact, plane = (
        disc_energy(Gaussian(1.0, xi), 1.0, HalfSpace(1.0).softness),
        HalfSpace(1.0).stored_energy(Gaussian(1.0, xi)),
    )
    error = 5 * energy.std() / math.sqrt(members)
    assert abs(energy.mean() - exact) < error + 0.6 * pixel**2 * exact
    # known from another simulation to three digits: mean over the plane's 0.939, coefficient of variation 0.265
    assert abs(energy.mean() / plane - 0.939) < error / plane + 0.6 * pixel**2 + 0.0005
    assert (
        abs(energy.std() / energy.mean() - 0.265)
        < five_sigma_of_spread(energy) / energy.mean() + 0.0005
    )
    # and exactly, to the same two digits
    assert_allclose(exact / plane, 0.939, rtol=0.01, atol=0)
