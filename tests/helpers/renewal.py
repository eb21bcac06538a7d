"""The renewal equation of Bell bonds on a grid of ages, in units of 1/k0 and of the Bell force."""

import functools

import numpy as np


@functools.cache
def volterra(first, beta, eps, end, points):
    """Share bound and stretch per site at ``end`` after a start with a share ``first`` bound, unstretched.

    The equation F = 1 - first S - beta ∫F S by the trapezoidal rule, Richardson-extrapolated twice.
    """

    def solve(n):
        age = np.linspace(0.0, end, n + 1)
        alive, h = np.exp(-np.expm1(eps * age) / eps), end / n
        free = np.empty(n + 1)
        free[0] = 1.0 - first
        for i in range(1, n + 1):
            past = 0.5 * free[0] * alive[i] + np.dot(free[1:i], alive[i - 1 : 0 : -1])
            free[i] = (1.0 - first * alive[i] - beta * h * past) / (1.0 + 0.5 * beta * h)
        young = np.dot(free[1:-1], (age * alive)[-2:0:-1]) + 0.5 * free[0] * age[-1] * alive[-1]
        return np.array([1.0 - free[-1], eps * (first * end * alive[-1] + beta * h * young)])

    coarse, middle, fine = (solve(points * k) for k in (1, 2, 4))
    return (16 * (4 * fine - middle) / 3 - (4 * middle - coarse) / 3) / 15
