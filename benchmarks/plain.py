"""The programs that a user of numpy would write for the same work, clear and without waste."""

import numpy as np
from scipy import fft


class TextbookModes:
    """An Ornstein-Uhlenbeck stress field on an n × n grid, as the textbooks give it.

    Hermitian noise of unit variance is the transform of real white noise; each mode keeps e^(−λdt)
    and gains the rest; the energy is the Green's function times the spectrum by Parseval.
    """

    def __init__(self, points, cell, density, shear_modulus, seed):
        self.points, self.random = points, np.random.default_rng(seed)
        qx = 2 * np.pi * np.fft.fftfreq(points, cell / points)[:, np.newaxis]
        qy = 2 * np.pi * np.fft.rfftfreq(points, cell / points)[np.newaxis, :]
        q = np.hypot(qx, qy)
        q[0, 0] = np.inf
        self.size = np.sqrt(density(q)) / cell * points  # of the transform of a field of this spectrum
        columns = np.where((qy > 0) & (qy < qy.max()), 2.0, 1.0)
        self.weight = 0.5 * columns * (1 + (qy / q) ** 2) / (2 * shear_modulus * q) / points**4
        self.modes = self.noise()

    def noise(self):
        return self.size * fft.rfft2(self.random.standard_normal((self.points, self.points)))

    def step(self, exponent):
        self.modes = np.exp(-exponent) * self.modes + np.sqrt(-np.expm1(-2 * exponent)) * self.noise()
        return np.sum(self.weight * (self.modes.real**2 + self.modes.imag**2))


class RealSpaceMap(TextbookModes):
    """The same, but with the energy of the map in real space: half the mean of stress times displacement."""

    def __init__(self, points, cell, density, shear_modulus, seed):
        super().__init__(points, cell, density, shear_modulus, seed)
        qx = 2 * np.pi * np.fft.fftfreq(points, cell / points)[:, np.newaxis]
        qy = 2 * np.pi * np.fft.rfftfreq(points, cell / points)[np.newaxis, :]
        q = np.hypot(qx, qy)
        q[0, 0] = np.inf
        self.compliance = (1 + (qy / q) ** 2) / (2 * shear_modulus * q)

    def step(self, exponent):
        self.modes = np.exp(-exponent) * self.modes + np.sqrt(-np.expm1(-2 * exponent)) * self.noise()
        shape = (self.points, self.points)
        stress = fft.irfft2(self.modes, s=shape)
        displacement = fft.irfft2(self.compliance * self.modes, s=shape)
        return 0.5 * np.mean(stress * displacement)


class HalfSpectrumModes:
    """The same process, drawing one complex number for each of the pairs ±q: no transform at all."""

    def __init__(self, points, cell, density, shear_modulus, seed):
        self.random = np.random.default_rng(seed)
        numbers = 2 * np.pi / cell * np.arange(-(points // 2) + 1, points // 2)
        qx, qy = (q.ravel() for q in np.meshgrid(numbers, numbers, indexing="ij"))
        half = ((qy > 0) | ((qy == 0) & (qx > 0))) & (density(np.hypot(qx, qy)) > 0)
        q = np.hypot(qx[half], qy[half])
        self.weight = (1 + (qy[half] / q) ** 2) / (2 * shear_modulus * q) * density(q) / cell**2
        self.modes = self.noise()

    def noise(self):
        return self.random.standard_normal((self.weight.size, 2)).view(complex)[:, 0] * np.sqrt(0.5)

    def step(self, exponent):
        self.modes = np.exp(-exponent) * self.modes + np.sqrt(-np.expm1(-2 * exponent)) * self.noise()
        return np.sum(self.weight * (self.modes.real**2 + self.modes.imag**2))
