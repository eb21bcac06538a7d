"""Bond populations as a user of numpy would step them: clear, vectorised, without waste."""

import math

import numba
import numpy as np
from scipy.integrate import solve_ivp


class TrackedNumpy:
    """Bonds under Bell's rupture in fixed steps: in each, a bond breaks and a free site binds by chance.

    First order in the step. A free site keeps the stretch 0; a bond breaks when an exponential number
    is below its rupture times the step, which needs one exponential function less than its chance.
    """

    def __init__(self, shape, rate, softness, rebinding_rate, random):
        self.rate, self.softness, self.rebinding_rate, self.random = rate, softness, rebinding_rate, random
        self.stretch, self.bound = np.zeros(shape), np.zeros(shape, bool)
        self.rupture, self.threshold = np.empty(shape), np.empty(shape)

    def step(self, slip, duration):
        """One step; share of sites bound, mean stretch and mean square stretch per site."""
        np.multiply(self.stretch, self.softness, out=self.rupture)
        np.exp(self.rupture, out=self.rupture)
        self.rupture *= self.rate * duration
        self.random.standard_exponential(out=self.threshold)
        breaks = self.threshold < self.rupture
        binds = self.threshold < self.rebinding_rate * duration
        self.bound = np.where(self.bound, ~breaks, binds)
        self.stretch += slip
        self.stretch *= self.bound
        stretch = self.stretch.ravel()
        return self.bound.mean(), stretch.mean(), np.einsum("i,i->", stretch, stretch) / stretch.size


def mean_stretch_in_steps(slip, duration, rate, softness, rebinding_rate):
    """Mean stretch per site that the steps of ``TrackedNumpy`` lead to: a bond outlives a step with e^(−k(s) dt)."""
    stretch = slip * np.arange(1, 1 + round(50.0 / (softness * slip)))
    survival = np.exp(-rate * duration * np.concatenate([[0.0], np.cumsum(np.exp(softness * stretch[:-1]))]))
    free = 1.0 / -np.expm1(-rebinding_rate * duration)
    return np.sum(survival * stretch) / (np.sum(survival) + free)


@numba.njit(cache=True)
def renewal(sites, outputs, step, speed, rate, softness, rebinding_rate, random):
    """Bonds under Bell's rupture in steady sliding, one after the other and life by life: exact, compiled.

    A life ends where its integrated rupture k0 (e^(gt) − 1)/g, g = softness × speed, reaches an exponential number.
    """
    sums, growth, end = np.zeros((3, outputs)), softness * speed, outputs * step
    for _ in range(sites):
        birth = random.standard_exponential() / rebinding_rate
        while birth < end:
            life = math.log1p(random.standard_exponential() * growth / rate) / growth
            for k in range(int(birth / step), min(int((birth + life) / step), outputs)):
                stretch = speed * ((k + 1) * step - birth)
                sums[0, k] += 1.0
                sums[1, k] += stretch
                sums[2, k] += stretch * stretch
            birth += life + random.standard_exponential() / rebinding_rate
    return sums


def pulled_slider(times, stiffness, speed, method, tolerance):
    """Positions of a massless slider that a spring pulls over bonds under Bell's rupture, by scipy's ``solve_ivp``.

    Parameters
    ----------
    times : array
        At which the position is wanted, in bonds' lives at rest, beginning at 0.
    stiffness, speed : float
        Of the spring over that of all sites, n κ A; of the stage, in Bell's stretches a life.
    method : str
        "LSODA", "Radau", ...
    tolerance : float
        Relative; the absolute one is a tenth of it.

    Returns
    -------
    array
        Positions in Bell's stretches.

    Notes
    -----
    The balance of forces gives the sum of stretches, and its time derivative the speed. Rebinding is as fast as rupture
    at rest, half the sites are bound at the start, and the spring is relaxed.
    """

    def slopes(time, state):
        position, bound = state
        moment = stiffness * (speed * time - position)
        rupture = math.exp(moment / bound)
        return (stiffness * speed + rupture * moment) / (stiffness + bound), 1.0 - bound - rupture * bound

    tolerances = {"rtol": tolerance, "atol": 0.1 * tolerance}
    return solve_ivp(slopes, times[[0, -1]], [0.0, 0.5], method, t_eval=times, **tolerances).y[0]
