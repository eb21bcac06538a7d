"""Contacts on a bonded layer by Fredholm's equation and by waves; as a program it prints ``sim.laws.layer_table``.

With a = 1, x = a/h and H(y) = 1 - 2 N(y), N the normal compliance ``layer.normal``, Abel's inversion of the condition
on the displacement is

    f(s) - (2/pi) int_0^1 K(s, t) f(t) dt = 1 or s^2,   K(s, t) = x int_0^inf H(y) cos(xys) cos(xyt) dy.

The right side 1 is a flat punch (f_1), s^2 the sphere's profile (f_2). The contact needs e_i = f_i(1),
g_1 = int f_1, g_2 = int f_2 and g_3 = int s^2 f_2.

A uniform shear stress on a disc moves it by the mean of the compliances of its waves, f(qh)/(Gq) without normal stress:
``1/k_t = (2/(pi a G)) int_0^inf f(y/x) (J_1(y)/y)^2 dy``, which is 2/(pi^2 G a) times a number m on a half-space.
"""

import math
import sys

import numpy as np
import scipy
from numpy.polynomial import chebyshev

from sim.laws.layer_table import TURN, WIDEST

#: Nodes of a panel: few, because numpy's nodes lose digits if they are many.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)
#: y beyond which H is below 1e-17.
_LAST = 24.0


def panels(end, count):
    """Return nodes and weights of Gauss-Legendre sums over equal panels from 0 to ``end``."""
    edges, half = np.linspace(0.0, end, count + 1), 0.5 * end / count
    return (edges[:-1, None] + half * (1.0 + _NODES)).ravel(), np.tile(
        half * _WEIGHTS, count
    )


def missing(y):
    """Return H(y), without cancellation where it is small."""
    fade = np.exp(-2.0 * y)
    above = 2.0 * fade * (1.0 + 2.0 * y + 2.0 * y * y + fade)
    return above / (1.0 + fade * fade + 2.0 * fade * (1.0 + 2.0 * y * y))


def contact(x, finer=1.0):
    """Return e_1, e_2, g_1, g_2, g_3 at x = a/h > 0, with ``finer`` times as many panels as 1e-12 needs."""
    s, weight = panels(1.0, math.ceil(finer * (4.0 + 0.25 * x)))
    y, step = panels(_LAST, math.ceil(finer * (24.0 + 0.25 * _LAST * x)))
    strength = 2.0 / math.pi * x * missing(y) * step
    waves, edge = np.cos(x * np.outer(s, y)), np.cos(x * y)
    matrix = np.eye(s.size) - (waves * strength) @ waves.T * weight
    right = np.stack([np.ones_like(s), s * s], axis=1)
    f = np.linalg.solve(matrix, right)
    e = 1.0 + ((edge * strength) @ waves.T * weight) @ f
    return np.array([*e, *(weight @ f), weight @ (s * s * f[:, 1])])


def yielding(x):
    """Return m and its slope times x at x = a/h > 0: 1/k_t of a disc under a uniform stress over the half-space's."""
    y, step = panels(_LAST * x, math.ceil(8.0 + _LAST * x))
    z = y / x
    fade = np.exp(-2.0 * z)
    # mean of along_free and tanh, less 3/4 of the half-space
    below = 1.0 + fade * fade + 2.0 * fade * (1.0 + 2.0 * z * z)
    above = fade * (2.0 * z - 1.0 - 2.0 * z * z - fade)
    lacks = 0.5 * above / below - fade / (1.0 + fade)
    below_slope = -4.0 * fade * fade - 4.0 * fade * (1.0 - 2.0 * z + 2.0 * z * z)
    above_slope = -2.0 * above + fade * (2.0 - 4.0 * z + 2.0 * fade)
    slope = 0.5 * (above_slope - above * below_slope / below) / below
    slope += 2.0 * fade / (1.0 + fade) ** 2
    waves = math.pi * (scipy.special.j1(y) / y) ** 2 * step
    return 1.0 + lacks @ waves, -(z * slope) @ waves


def coefficients(terms):
    """Return the Chebyshev coefficients of the functions of ``layer_table``, shape (terms, 7)."""
    place = 0.5 * (1.0 - np.cos(math.pi * (np.arange(terms) + 0.5) / terms))
    u = place * WIDEST / (WIDEST + TURN)
    x = TURN * u / (1.0 - u)
    size = (1.0 + x) ** 1.5
    values = np.array([contact(each) for each in x]).T
    values /= np.array([size, size, size**2, size**2, size**2])
    shear, change = np.array([yielding(each) for each in x]).T
    values = np.array([*values, shear * (1.0 + x), (shear + change / 3.0) * (1.0 + x)])
    fitted = chebyshev.chebfit(2.0 * place - 1.0, values.T, terms - 1)
    # those of a half-space at a/h = 0
    first = np.array([1.0, 1.0, 1.0, 1.0 / 3.0, 0.2, 1.0, 1.0])
    fitted[0] += first - chebyshev.chebval(-1.0, fitted)
    return fitted


if __name__ == "__main__":
    for row in coefficients(int(sys.argv[1])).tolist():
        print(f"{row},")
