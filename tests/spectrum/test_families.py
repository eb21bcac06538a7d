"""The spectrum families: variance, closed-form energy, cut-offs, checks and round cycles."""

import itertools
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError
from scipy import integrate

from sim.solid import HalfSpace
from sim.spectrum import (
    AnisotropicGaussian,
    Band,
    Gaussian,
    Ripple,
    SelfAffine,
    Spectrum,
    VonKarman,
)
from sim.spectrum.measured import Measured, Tabulated

TURN = 2 * math.pi

ISOTROPIC = {
    "band": Band(1.3, longest=5.0, shortest=0.7),
    "gaussian": Gaussian(1.3, 0.8),
    "von_karman_rough": VonKarman(1.3, 0.8, 0.1),
    "exponential": VonKarman(1.3, 0.8, 0.5),
    "von_karman_smooth": VonKarman(1.3, 0.8, 1.0),
    "self_affine": SelfAffine(1.3, 0.8, longest=5.0, rolloff=2.0, shortest=0.1),
    "self_affine_no_plateau": SelfAffine(
        1.3, 0.3, longest=5.0, rolloff=5.0, shortest=0.1
    ),
    "self_affine_plateau_only": SelfAffine(
        1.3, 0.3, longest=5.0, rolloff=0.1, shortest=0.1
    ),
    "self_affine_h0": SelfAffine(1.3, 0.0, longest=5.0, rolloff=2.0, shortest=0.1),
    "self_affine_h1": SelfAffine(1.3, 1.0, longest=5.0, rolloff=2.0, shortest=0.1),
    "tabulated": Tabulated((1.0, 2.0, 3.0, 5.0, 9.0), (0.0, 3.0, 3.0, 0.2, 0.0)),
}
ANISOTROPIC = {
    "across": AnisotropicGaussian(1.3, 0.5, 1.1),
    "along": AnisotropicGaussian(1.3, 1.1, 0.5),
    "turned": AnisotropicGaussian(1.3, 0.5, 1.1, angle=0.4),
}
WITH_DENSITY = ISOTROPIC | ANISOTROPIC
ALL = WITH_DENSITY | {
    "ripple": Ripple(2.0, 3.0, 0.3),
    "measured": Measured(
        "map.csv", 0.1, "hann", wavenumbers=(1.0, 2.0), densities=(3.0, 4.0)
    ),
}


def along_ray(spectrum, angle, power):
    """∫ q^power C dq along a direction, by quadrature in log q between the breaks."""
    edges = [math.log(q) for q in getattr(spectrum, "breaks", ())]
    edges = edges or [-30.0, 0.0, 10.0, 130.0]  # H = 0.1 then lacks e^-26

    def integrand(u):
        q = math.exp(u)
        return q ** (power + 1) * float(
            spectrum.density(q * math.cos(angle), q * math.sin(angle))
        )

    pieces = [
        integrate.quad(integrand, a, b, epsabs=0.0, epsrel=1e-11, limit=400)[0]
        for a, b in itertools.pairwise(edges)
        if b <= 10.0 or isinstance(spectrum, VonKarman)  # a Gaussian has nothing there
    ]
    return math.fsum(pieces)


def angular_mean(spectrum, power, weight):
    """Mean over directions of weight(θ) ∫ q^power C dq; the trapezium rule is exact for smooth periods."""
    count = 4 if hasattr(spectrum, "radial_density") else 64
    angles = TURN * (np.arange(count) + 0.5) / count
    if hasattr(spectrum, "radial_density"):
        return np.mean(weight(angles)) * along_ray(spectrum, 0.3, power)
    return np.mean([weight(t) * along_ray(spectrum, t, power) for t in angles])


def test_variance_and_energy_are_the_integrals_of_the_density_and_the_square_of_the_rms():
    for spectrum in WITH_DENSITY.values():
        assert_allclose(
            spectrum.variance,
            angular_mean(spectrum, 1, np.ones_like) / TURN,
            rtol=1e-9,
            atol=0,
        )
    for spectrum in [
        s for s in ALL.values() if s.model != "tabulated" and s.model != "measured"
    ]:
        exact = (
            spectrum.amplitude**2 / 2 if spectrum.model == "ripple" else spectrum.rms**2
        )
        assert_allclose(spectrum.variance, exact, rtol=2e-15, atol=0)  # a few roundings
    for poisson_ratio in [0.5, 0.3, 0.0]:
        for spectrum in WITH_DENSITY.values():
            modulus = 1.7
            mean = angular_mean(
                spectrum, 0, lambda t: 1 - poisson_ratio * np.cos(t) ** 2
            )
            energy = HalfSpace(modulus, poisson_ratio, coupling=0.0).stored_energy(
                spectrum
            )
            assert_allclose(energy, mean / (2 * TURN * modulus), rtol=1e-8, atol=0)


def test_variance_within_a_circle_grows_as_the_density_says_between_the_cut_offs():
    for spectrum in ISOTROPIC.values():
        low, high = spectrum.support
        q = np.geomspace(max(low, 1e-2), min(high, 1e2), 23)[1:-1]
        q = q[
            np.min(np.abs(q[:, None] / np.append(spectrum.breaks, np.inf) - 1), axis=1)
            > 1e-3
        ]
        step = 1e-4
        slope = (
            spectrum.cumulative(q * (1 + step)) - spectrum.cumulative(q * (1 - step))
        ) / (2 * step * q)
        # central differences: second order, a few 1e-8 times the second derivative of a steep piece,
        # and rounding of the difference 1e-16 variance / (step q² C)
        assert_allclose(
            slope,
            q * spectrum.radial_density(q) / TURN,
            rtol=1e-6,
            atol=1e-11 * spectrum.variance,
        )
    for spectrum in ISOTROPIC.values():
        q = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 61), spectrum.breaks])
        assert_allclose(
            spectrum.cumulative(q) + spectrum.beyond(q),
            spectrum.variance,
            rtol=1e-14,
            atol=0,
        )
        assert spectrum.cumulative(0.0) == 0.0
        assert np.all(np.diff(spectrum.cumulative(np.sort(q))) >= 0.0)
    for name in ["band", "self_affine", "tabulated"]:
        spectrum = ISOTROPIC[name]
        low, high = spectrum.support
        assert spectrum.radial_density(low * (1 - 1e-12)) == 0.0
        assert spectrum.radial_density(high * (1 + 1e-12)) == 0.0
        assert spectrum.cumulative(low) == 0.0
        assert spectrum.beyond(high) == 0.0


def test_density_broadcasts_is_even_and_has_an_anisotropic_first_length_along_the_angle():
    qx, qy = np.linspace(-3, 3, 5)[:, None], np.linspace(-2, 2, 4)
    for spectrum in WITH_DENSITY.values():
        density = spectrum.density(qx, qy)
        assert density.shape == (5, 4)
        assert_allclose(density, density[::-1, ::-1], rtol=1e-14, atol=0)
    a, b, angle, q = 0.5, 2.0, 0.4, np.array([0.3, 1.0, 2.0])
    spectrum = AnisotropicGaussian(1.3, a, b, angle)
    for direction, length in [(angle, a), (angle + math.pi / 2, b)]:
        exact = math.pi * a * b * 1.3**2 * np.exp(-((q * length) ** 2) / 4)
        density = spectrum.density(q * math.cos(direction), q * math.sin(direction))
        assert_allclose(density, exact, rtol=1e-14, atol=0)
    equal, isotropic = AnisotropicGaussian(1.3, 0.8, 0.8, 2.0), Gaussian(1.3, 0.8)
    assert_allclose(
        HalfSpace(1.0, 0.3, coupling=0.0).stored_energy(equal),
        HalfSpace(1.0, 0.3, coupling=0.0).stored_energy(isotropic),
        rtol=1e-14,
        atol=0,
    )
    assert_allclose(
        equal.density(1.0, 2.0), isotropic.density(1.0, 2.0), rtol=1e-14, atol=0
    )


def test_energies_have_their_known_coefficients_and_textbook_limits():
    for spectrum, exact in [
        (Gaussian(1.0, 1.0), 0.33233509704478426),
        (Gaussian(1.0, math.sqrt(2.0)), 0.4699928014933126),
        (VonKarman(1.0, 1.0, 0.5), 0.375),
        (Band(1.0, TURN / 2.0, TURN / 3.0), 3 / 20),
        (Ripple(1.0, TURN), 1 / 8),
        (Ripple(1.0, TURN, math.pi / 2), 1 / 4),
        (Ripple(1.0, TURN, 0.7), (1 + math.sin(0.7) ** 2) / 8),
    ]:
        assert_allclose(
            HalfSpace(1.0).stored_energy(spectrum), exact, rtol=1e-15, atol=0
        )
    assert_allclose(
        HalfSpace(1.5, 0.3, coupling=0.0).stored_energy(Ripple(2.0, 3.0)),
        0.7 * 4.0 / (4 * 1.5 * TURN / 3.0),
        rtol=1e-15,
        atol=0,
    )
    with pytest.raises(ValueError, match="no density"):
        Ripple(1.0, 1.0).density(0.0, 0.0)
    for hurst in [0.3, 0.8, 1.0]:
        longest, rolloff, shortest = 60e-6, 24e-6, 1e-6
        ratio, reach, q = rolloff / longest, rolloff / shortest, TURN / rolloff
        upper = 1 - ratio + (1 - reach ** (-1 - 2 * hurst)) / (1 + 2 * hurst)
        lower = 1 - ratio**2 + (1 - reach ** (-2 * hurst)) / hurst
        exact = 3 * 150e3**2 / (4 * 1.6e6 * q) * upper / lower
        energy = HalfSpace(1.6e6).stored_energy(
            SelfAffine(150e3, hurst, longest, rolloff, shortest)
        )
        assert_allclose(energy, exact, rtol=1e-14, atol=0)

    def energy(hurst):
        return HalfSpace(1.0).stored_energy(SelfAffine(1.0, hurst, 5.0, 2.0, 0.1))

    rises = [energy(h) - energy(0.0) for h in (1e-6, 1e-8)]
    # linear in H; 1e-16 / 1e-8 of rounding
    assert_allclose(rises[0] / rises[1], 100.0, rtol=1e-4, atol=0)
    assert_allclose(energy(1e-15), energy(0.0), rtol=1e-13, atol=0)
    q = np.array([0.0, 0.5, 3.0, 100.0])
    exact = TURN * 0.8**2 * 1.3**2 * (1 + (0.8 * q) ** 2) ** -1.5
    assert_allclose(
        ISOTROPIC["exponential"].radial_density(q), exact, rtol=1e-14, atol=0
    )
    assert_allclose(
        HalfSpace(1.0).stored_energy(Band(1.0, TURN / 2.0, TURN / 2.0002)),
        3 / (8 * 2.0001),
        rtol=1e-11,
        atol=0,
    )
    energies = [
        HalfSpace(1.0).stored_energy(AnisotropicGaussian(1.0, 1.0, b))
        for b in (1e4, 1e6, 1e8)
    ]
    assert_allclose(np.diff(energies)[1], np.diff(energies)[0], rtol=1e-6, atol=0)


def test_a_spectrum_survives_dumping_and_reading_and_a_wrong_one_is_refused():
    for spectrum in ALL.values():
        for reader in (TypeAdapter(type(spectrum)), TypeAdapter(Spectrum)):
            again = reader.validate_python(reader.dump_python(spectrum))
            assert again == spectrum
            assert reader.validate_json(reader.dump_json(spectrum)) == spectrum
            assert hash(again) == hash(spectrum)
    ripple = {
        "model": "ripple",
        "amplitude": "3 kPa",
        "wavelength": "2 mm",
        "angle": "180 deg",
    }
    assert TypeAdapter(Spectrum).validate_python(ripple) == Ripple(
        3000.0, 0.002, math.pi
    )
    self_affine = {
        "model": "self_affine",
        "rms": 1,
        "hurst": 1,
        "longest": 5,
        "rolloff": 3,
        "shortest": 1,
    }
    for keys, fault in [
        (
            {"model": "band", "rms": 1, "longest": 1, "shortest": 2},
            "longest .* is shorter than shortest",
        ),
        (self_affine | {"shortest": 4}, "rolloff .* is shorter than shortest"),
        (self_affine | {"longest": 1, "rolloff": 1}, "no band"),
    ]:
        with pytest.raises(ValidationError, match=fault):
            TypeAdapter(Spectrum).validate_python(keys)
