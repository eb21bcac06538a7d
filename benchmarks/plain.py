"""The programs that a user of numpy and scipy would write for fields of shear stress, clear and without waste."""

import math

import numba
import numpy as np
from scipy import fft


def half_spectrum(points, cell):
    """Wavenumber along y and magnitude of the wavevector [rad/m] of ``rfft2``, inf at zero."""
    qx = 2 * np.pi * np.fft.fftfreq(points, cell / points)[:, np.newaxis]
    qy = 2 * np.pi * np.fft.rfftfreq(points, cell / points)[np.newaxis, :]
    q = np.hypot(qx, qy)
    q[0, 0] = np.inf
    return qy, q


def energy_weights(points, cell, shear_modulus):
    """Energy per area of the squared moduli of ``rfft2``: the Green's function by Parseval."""
    qy, q = half_spectrum(points, cell)
    columns = np.where((qy > 0) & (qy < qy.max()), 2.0, 1.0)
    return 0.5 * columns * (1 + (qy / q) ** 2) / (2 * shear_modulus * q) / points**4


class TextbookModes:
    """An Ornstein-Uhlenbeck stress field on an n × n grid, as the textbooks give it, and its energy.

    Hermitian noise of unit variance is the transform of real white noise; each mode keeps e^(−λdt)
    and gains the rest.
    """

    def __init__(self, points, cell, density, shear_modulus, seed):
        self.points, self.random = points, np.random.default_rng(seed)
        # of the transform of a field
        self.size = np.sqrt(density(half_spectrum(points, cell)[1])) / cell * points
        self.weights = energy_weights(points, cell, shear_modulus)
        self.modes = self.noise()

    def noise(self):
        return self.size * fft.rfft2(
            self.random.standard_normal((self.points, self.points))
        )

    def step(self, exponent):
        self.modes = (
            np.exp(-exponent) * self.modes
            + np.sqrt(-np.expm1(-2 * exponent)) * self.noise()
        )
        return np.sum(self.weights * (self.modes.real**2 + self.modes.imag**2))

    def map(self, exponent):
        self.modes = (
            np.exp(-exponent) * self.modes
            + np.sqrt(-np.expm1(-2 * exponent)) * self.noise()
        )
        return fft.irfft2(self.modes)


class HalfSpectrumModes:
    """The same process, drawing one complex number for each pair ±q that has power: no transform, arrays reused."""

    def __init__(self, points, cell, density, shear_modulus, seed):
        self.random = np.random.default_rng(seed)
        numbers = 2 * np.pi / cell * np.arange(-(points // 2) + 1, points // 2)
        qx, qy = (q.ravel() for q in np.meshgrid(numbers, numbers, indexing="ij"))
        half = ((qy > 0) | ((qy == 0) & (qx > 0))) & (density(np.hypot(qx, qy)) > 0)
        q = np.hypot(qx[half], qy[half])
        weights = (
            (1 + (qy[half] / q) ** 2) / (2 * shear_modulus * q) * density(q) / cell**2
        )
        # of real and imaginary parts of unit variance
        self.weights = 0.5 * np.repeat(weights, 2)
        self.parts, self.noise = self.random.standard_normal((2, self.weights.size))

    def step(self, exponent):
        self.random.standard_normal(out=self.noise)
        self.noise *= np.sqrt(-np.expm1(-2 * exponent))
        self.parts *= np.exp(-exponent)
        self.parts += self.noise
        np.multiply(self.parts, self.parts, out=self.noise)
        self.noise *= self.weights
        return np.sum(self.noise)


class HalfSpectrumMap:
    """An Ornstein-Uhlenbeck stress field whose map is made at each step, drawing the half spectrum: one transform.

    ``irfft2`` averages what stands for q and −q in the columns where both stand: hence their factor √2.
    """

    def __init__(self, points, cell, density, seed):
        self.points, self.random = points, np.random.default_rng(seed)
        self.size = (
            np.sqrt(0.5 * density(half_spectrum(points, cell)[1])) / cell * points**2
        )
        self.size[:, [0, -1]] *= np.sqrt(2)
        self.noise = np.empty((points, points // 2 + 1, 2))
        self.random.standard_normal(out=self.noise)
        self.modes = self.size * self.noise.view(complex)[..., 0]

    def map(self, exponent):
        self.random.standard_normal(out=self.noise)
        renewed = self.noise.view(complex)[..., 0]
        renewed *= self.size * np.sqrt(-np.expm1(-2 * exponent))
        self.modes *= np.exp(-exponent)
        self.modes += renewed
        return fft.irfft2(self.modes, s=(self.points, self.points))


@numba.njit(cache=True)
def renew_half(modes, size, weights, keep, renew, turns, moved, random):
    """Renew the modes that have power, write them as ``turns`` move them, and return their energy."""
    points, energy = len(modes), 0.0
    for i in range(points):
        for j in range(modes.shape[1]):
            if size[i, j] > 0.0:
                kick = renew * size[i, j]
                noise = complex(
                    kick * random.standard_normal(), kick * random.standard_normal()
                )
                modes[i, j] = keep * modes[i, j] + noise
                energy += weights[i, j] * (
                    modes[i, j].real ** 2 + modes[i, j].imag ** 2
                )
                moved[i, j] = modes[i, j] * turns[i]
    for i in range(1, (points + 1) // 2):  # the first column holds both of a pair
        moved[points - i, 0] = moved[i, 0].conjugate()
    return energy


class CompiledMap:
    """The field of ``HalfSpectrumMap``, renewed in a compiled loop, carried by a slider, with its ΔΓ."""

    def __init__(self, points, cell, density, shear_modulus, seed):
        (qy, q), self.random = half_spectrum(points, cell), np.random.default_rng(seed)
        self.qx = 2 * np.pi * np.fft.fftfreq(points, cell / points)
        drawn = (
            ((qy > 0) | (self.qx[:, np.newaxis] > 0))
            & (qy < qy.max())
            & (self.qx > self.qx.min())[:, np.newaxis]
        )
        self.size = np.where(drawn, np.sqrt(0.5 * density(q)) / cell * points**2, 0.0)
        self.weights = energy_weights(points, cell, shear_modulus) * np.where(
            qy > 0, 1.0, 2.0
        )
        self.modes, self.moved = np.zeros((2, *self.size.shape), complex)
        self.map(np.inf, 0.0)

    def map(self, exponent, position):
        factors = (
            np.exp(-exponent),
            np.sqrt(-np.expm1(-2 * exponent)),
            np.exp(-1j * self.qx * position),
        )
        energy = renew_half(
            self.modes, self.size, self.weights, *factors, self.moved, self.random
        )
        return energy, fft.irfft2(self.moved)


class BandsNumpy:
    """ΔΓ of the same bands as ours by numpy: each band a gamma number, renewed as the sum of squares that it is."""

    def __init__(self, members, weights, shapes, seed):
        self.random, self.weights, self.shapes = (
            np.random.default_rng(seed),
            weights,
            shapes - 0.5,
        )
        self.bands = self.random.standard_gamma(shapes, (members, shapes.size))

    def step(self, exponent):
        keep, renew = np.exp(-exponent), np.sqrt(-np.expm1(-2 * exponent))
        moved = keep * np.sqrt(2 * self.bands) + renew * self.random.standard_normal(
            self.bands.shape
        )
        self.bands = 0.5 * moved**2 + renew**2 * self.random.standard_gamma(
            self.shapes, self.bands.shape
        )
        return self.bands @ self.weights


@numba.njit(cache=True)
def bands_compiled(members, steps, weights, shapes, exponent, random):
    """The steps of ``BandsNumpy`` in compiled loops; ΔΓ of all members at all steps."""
    keep, renew = math.exp(-exponent), math.sqrt(-math.expm1(-2.0 * exponent))
    bands, energy = np.empty((members, weights.size)), np.zeros((steps, members))
    for m in range(members):
        for k in range(weights.size):
            bands[m, k] = random.standard_gamma(shapes[k])
    for step in range(steps):
        for m in range(members):
            for k in range(weights.size):
                moved = (
                    keep * math.sqrt(2.0 * bands[m, k])
                    + renew * random.standard_normal()
                )
                bands[m, k] = (
                    0.5 * moved * moved
                    + renew * renew * random.standard_gamma(shapes[k] - 0.5)
                )
                energy[step, m] += weights[k] * bands[m, k]
    return energy
