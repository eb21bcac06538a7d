"""Known answers by closed forms and integrals of their own, which share no code with the package.

Lengths, forces and energies are in SI. The bodies are a rigid sphere on an incompressible
half-space unless a function takes the contact modulus E* = 4G itself.
"""

from typing import NamedTuple

import numpy as np
from scipy import integrate, optimize, special


class Lens(NamedTuple):
    """A sphere on a half-space: its radius [m], contact modulus E* [Pa], and work of adhesion [J/m²]."""

    radius: float
    modulus: float
    work: float

    def at_load(self, load, work=None):
        """Return the contact radius at a load [m]: a³ = 3R/(4E*) (P + 3πwR + √(6πwRP + (3πwR)²)).

        Hertz's at a work of adhesion that is not positive; 0 below the load of pull-off.
        """
        pull = 3.0 * np.pi * np.maximum(self._work(work), 0.0) * self.radius
        root = 2.0 * pull * load + pull**2
        bracket = load + pull + np.sqrt(np.maximum(root, 0.0))
        cube = 0.75 * self.radius / self.modulus * bracket
        return np.where(root < 0.0, 0.0, np.cbrt(np.maximum(cube, 0.0)))

    def load_of(self, radius, work=None):
        """Return the load of a contact radius [N]: 4E*a³/(3R) − √(8πwE*a³)."""
        hertz = 4.0 * self.modulus * radius**3 / (3.0 * self.radius)
        work = np.maximum(self._work(work), 0.0)
        return hertz - np.sqrt(8.0 * np.pi * work * self.modulus * radius**3)

    def indentation_of(self, radius, work=None):
        """Return the indentation of a contact radius [m]: a²/R − √(2πaw/E*)."""
        work = np.maximum(self._work(work), 0.0)
        adhesive = np.sqrt(2.0 * np.pi * radius * work / self.modulus)
        return radius**2 / self.radius - adhesive

    def displacement_of(self, radius, stiffness=np.inf, work=None):
        """Return the displacement of a mount behind a stiffness [m]: δ + P/k."""
        indentation = self.indentation_of(radius, work)
        return indentation + self.load_of(radius, work) / stiffness

    def limit(self, stiffness=np.inf, work=None):
        """Return the least radius that is stable under a displacement [m]: there dΔ/da = 0."""
        unit = (
            np.pi * self._work(work) * self.radius**2 / (4.0 * self.modulus / 3.0)
        ) ** (1.0 / 3.0)

        def slope(radius):
            step = 1e-4 * radius
            sides = self.displacement_of(
                radius + np.array([-step, step]), stiffness, work
            )
            return sides[1] - sides[0]

        coarse = optimize.brentq(slope, 0.3 * unit, 1.3 * unit, xtol=1e-14 * unit)
        bounds = 0.9 * coarse, 1.1 * coarse
        fold = optimize.minimize_scalar(
            lambda radius: self.displacement_of(radius, stiffness, work),
            bounds=bounds,
            method="bounded",
            options={"xatol": 1e-13 * unit},
        )
        return fold.x

    def at_displacement(self, displacement, stiffness=np.inf, work=None):
        """Return the stable contact radius at a displacement of the mount [m]."""
        return optimize.brentq(
            lambda a: self.displacement_of(a, stiffness, work) - displacement,
            self.limit(stiffness, work),
            self.radius,
            xtol=1e-18,
            rtol=1e-14,
        )

    def release_rate(self, load, radius):
        """Return the energy release rate G of a load and a radius [J/m²]."""
        hertz = 4.0 * self.modulus * radius**3 / (3.0 * self.radius)
        return (hertz - load) ** 2 / (8.0 * np.pi * self.modulus * radius**3)

    def jump(self, stiffness, first, last):
        """Return the energy that a jump of the radius dissipates [J]: ∫(G − w) dA at a fixed displacement."""
        displacement = self.displacement_of(first, stiffness)

        def excess(radius):
            hertz = 4.0 * self.modulus * radius**3 / (3.0 * self.radius)
            punch = 2.0 * self.modulus * radius
            # δ = a²/R − (P_H − P)/(2E*a), and δ + P/k is given
            above = (radius**2 / self.radius - displacement) + hertz / stiffness
            defect = above / (1.0 / punch + 1.0 / stiffness)
            rate = defect**2 / (8.0 * np.pi * self.modulus * radius**3)
            return (rate - self.work) * 2.0 * np.pi * radius

        return integrate.quad(excess, last, first, epsabs=0.0, epsrel=1e-11)[0]

    def _work(self, work):
        return self.work if work is None else np.asarray(work, float)


class GammaSum:
    """The law of Σ wᵢXᵢ with independent exponential Xᵢ of mean 1, from its characteristic function.

    Parameters
    ----------
    weights : array
        The wᵢ, in the unit of the sum.
    """

    def __init__(self, weights):
        self.weights = np.sort(np.asarray(weights, float))[::-1]
        count, reach = 2**16, self.mean + 30.0 * self.std
        self.values = reach * np.arange(count) / count
        frequency = 2.0 * np.pi / reach * np.arange(count // 2 + 1)
        spectrum = np.ones(count // 2 + 1, complex)
        for weight in self.weights:
            spectrum /= 1.0 + 1j * frequency * weight
        self.density = np.fft.irfft(spectrum, count) * count / reach
        mass = integrate.cumulative_simpson(self.density, x=self.values, initial=0.0)
        self.mass = mass / mass[-1]

    @property
    def mean(self):
        return float(np.sum(self.weights))

    @property
    def std(self):
        return float(np.sqrt(np.sum(self.weights**2)))

    @property
    def skewness(self):
        return float(2.0 * np.sum(self.weights**3) / self.std**3)

    def expected(self, function):
        """Return the mean of a function of the sum."""
        values = function(self.values) * self.density
        return float(np.trapezoid(values, self.values))

    def above(self, level):
        """Return the probability that the sum exceeds a level."""
        return float(1.0 - np.interp(level, self.values, self.mass))

    def quantile(self, level):
        return float(np.interp(level, self.mass, self.values))


def gaussian_cell(stress, length, cell, points, shear_modulus):
    """Return the mode pairs of a Gaussian field on a periodic cell: mean energies [J/m²], wavenumbers [rad/m].

    The correlation is σ² exp(−r²/ξ²). Each wave stands for the pixel of the wavevector plane around it,
    over which the spectrum has an integral of error functions. Its energy is ½G_x(q) times its variance,
    with G_x = (1/2Gq)(1 + q_y²/q²), and ±q are one pair.
    """
    step, reach = 2.0 * np.pi / cell, (points - 1) // 2
    index = np.arange(-reach, reach + 1)
    ends = special.erf(0.5 * length * step * (index[:, np.newaxis] + [-0.5, 0.5]))
    share = 0.5 * (ends[:, 1] - ends[:, 0])
    x, y = np.meshgrid(index, index, indexing="ij")
    is_half = (y > 0) | ((y == 0) & (x > 0))
    variance = 2.0 * stress**2 * np.outer(share, share)[is_half]
    qx, qy = step * x[is_half], step * y[is_half]
    q = np.hypot(qx, qy)
    return 0.5 * variance * (1.0 + (qy / q) ** 2) / (2.0 * shear_modulus * q), q


def bell_moments(ratio):
    """Return k0⟨T⟩ and k0²⟨T²⟩/2 of Bell bonds that are stretched at a steady speed, ratio = κV/(k0 f_b).

    A bond of the age t has survived with the probability exp(−(e^{εt} − 1)/ε), t in 1/k0.
    """

    def survival(age):
        return np.exp(-np.expm1(ratio * age) / ratio)

    end = np.log1p(750.0 * ratio) / ratio
    exact = {"epsabs": 0.0, "epsrel": 1e-12, "limit": 200}
    life = integrate.quad(survival, 0.0, end, **exact)[0]
    return life, integrate.quad(lambda t: t * survival(t), 0.0, end, **exact)[0]


class RelaxationCycle(NamedTuple):
    """The cycle of a massless slider behind a spring, with friction F_s/(1 + V/V_c) and a dashpot.

    It sticks until the spring bears F_s, jumps to the speed F_s/c − V_c, slows down while the force falls to its
    least value 2√(F_s V_c c) − cV_c, and sticks again.
    """

    strength: float
    critical: float
    damping: float
    stiffness: float
    stage: float

    @property
    def least(self):
        """Spring force at which the slider sticks again [N]."""
        product = self.strength * self.critical * self.damping
        return 2.0 * np.sqrt(product) - self.damping * self.critical

    def _while_slipping(self, function):
        """Return the integral of a function of the speed over the time of a slip."""
        fast = self.strength / self.damping - self.critical
        slow = np.sqrt(self.strength * self.critical / self.damping) - self.critical

        def weighted(speed):
            fall = self.strength * self.critical / (self.critical + speed) ** 2
            # K (V − v) = (c − F_s V_c/(V_c + v)²) dv/dt
            time = (self.damping - fall) / (self.stiffness * (speed - self.stage))
            return function(speed) * time

        return integrate.quad(weighted, slow, fast, epsrel=1e-12)[0]

    @property
    def slip_duration(self):
        return self._while_slipping(lambda speed: 1.0)

    @property
    def stick_duration(self):
        return (self.strength - self.least) / (self.stiffness * self.stage)

    @property
    def recurrence(self):
        return self.stick_duration + self.slip_duration

    @property
    def mean_force(self):
        """Mean of the spring force over a cycle [N]."""

        def force(speed):
            friction = self.strength * self.critical / (self.critical + speed)
            return friction + self.damping * speed

        stuck = 0.5 * (self.strength + self.least) * self.stick_duration
        slipping = self._while_slipping(force)
        return (stuck + slipping) / self.recurrence
