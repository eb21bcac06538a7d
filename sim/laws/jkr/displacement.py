"""Adhesive contact at a displacement behind a spring of any stiffness: one compiled solver."""

import math

import numpy as np

from sim.laws.jkr.scales import fold_radius, series_shares
from sim.laws.jkr.stiffness import fold_level, fold_root
from sim.numerics.jit import device, kernel
from sim.numerics.special import rough_cube_root

_BLOCK = 4096


@device
def _first_guess(excess, second, fourth, sixth, root, floor):
    """The root t >= 0 of F(root + t) - F(root) = excess, from 7 % too small to 12 % too large.

    The smaller of two numbers, times 0.97. The one is exact near the fold, where t^2 rules, and where t^4 does: of
    the left side f_2 t^2 + ... + f_6 t^6 it keeps the square of sqrt(f_2) t + sqrt(f_4) t^2. The other
    is right where x^6 prevails, and never below the root: x^4 - 4x is -3 at least.
    """
    level, linear, square = math.sqrt(excess), math.sqrt(second), math.sqrt(fourth)
    near = 2.0 * level / (linear + math.sqrt(second + 4.0 * square * level))
    shift = 3.0 if second > 0.0 else 0.0
    far = 1.0003 * rough_cube_root(shift + math.sqrt(excess + floor) / math.sqrt(sixth)) - root
    guess = 0.97 * (far if far < near else near)
    return guess if excess > 0.0 else 0.0


@device
def _sums(t, second, third, fourth, fifth, sixth):
    """f_2 t^2 + ... + f_6 t^6, and its slope times t."""
    square = t * t
    value = square * (second + t * (third + t * (fourth + t * (fifth + t * sixth))))
    slope = 2.0 * second + t * (3.0 * third + t * (4.0 * fourth + t * (5.0 * fifth + t * 6.0 * sixth)))
    return value, square * slope


@kernel("void(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1])")
def _solve(displacements, stiffnesses, works, sphere_radii, moduli, radii):
    """Radii for flat arrays, see ``radius_at_displacement``.

    No branch but selections, no call and no loop that ends early: the compiler turns the whole body into
    vector instructions, which makes it fourteen times faster.
    """
    for i in range(radii.size):
        displacement, stiffness, work, sphere_radius, modulus = (
            displacements[i], stiffnesses[i], works[i], sphere_radii[i], moduli[i],
        )  # fmt: skip
        unit = fold_radius(work, sphere_radius, modulus)
        depth = unit * (unit / sphere_radius)
        sticks = work > 0.0 and depth > 1e-300 and displacement / depth < 1e290  # else adhesion is lost in rounding
        unit = unit if sticks else sphere_radius
        depth = depth if sticks else sphere_radius
        contact = 4.0 / 3.0 * modulus * unit
        grips, load = series_shares(stiffness, contact)
        root = fold_root(grips, load)
        level = fold_level(root, grips, load) if sticks else 0.0
        root = root if sticks else 0.0
        last = level * (depth / grips)
        excess = (displacement - last) * (grips / depth) if last > -1e300 else grips * (displacement / depth) - level
        cube = root * root * root
        second = 6.0 * grips * root * root + load * root * (15.0 * cube - 18.0)
        third = 4.0 * grips * root + load * (20.0 * cube - 6.0) if sticks else 0.0
        fourth = grips + 15.0 * load * root * root
        fifth = 6.0 * load * root
        floor = level + 3.0 * grips + 9.0 * load + 1e-14 if sticks else 0.0  # >= 0 but for rounding
        t = _first_guess(excess, second, fourth, load, root, floor)
        value, slope = _sums(t, second, third, fourth, fifth, load)
        share = excess / value
        nearer = t * (((slope + value) * share + (slope - value)) / ((slope - value) * share + (slope + value)))
        t = nearer if nearer > 0.0 else t  # nan where t is 0 or infinite
        for _ in range(3):
            value, slope = _sums(t, second, third, fourth, fifth, load)
            nearer = t - t * ((value - excess) / slope)
            t = nearer if nearer > 0.0 else t
        known = excess >= 0.0 and stiffness >= 0.0 and sphere_radius > 0.0 and modulus > 0.0 and work < math.inf
        known = known and 1e-300 < contact < math.inf and (excess < math.inf or displacement == math.inf)
        known = known and (sticks or excess > 0.0 or displacement == 0.0 or stiffness == 0.0)
        radius = unit * (root + t) * (root + t)
        if load == 0.0 and not sticks:
            radius = math.sqrt(displacement) * math.sqrt(sphere_radius)  # of any size: no product leaves the numbers
        radii[i] = radius if known else math.nan


def radius_at_displacement(displacement, stiffness, work, sphere_radius, modulus):
    """Contact radius at a prescribed displacement behind a spring of given stiffness.

    Parameters
    ----------
    displacement : float or array
        Delta = delta + P/k [m]; below 0 the base pulls.
    stiffness : float or array
        k [N/m], 0 to inf.
    work : float or array
        Work of adhesion w [J/m^2].
    sphere_radius : float or array
        R [m].
    modulus : float or array
        E* [Pa].

    Returns
    -------
    float or array
        a [m]; nan below ``pull_off_displacement`` and for a negative stiffness. At k = inf the radius at the
        indentation Delta, at k = 0 the radius without load, for no displacement can then press or pull. Where
        w <= 0 Hertz's radius, the root of ``a^2/R + 4 E* a^3/(3 R k) = Delta``.

    Notes
    -----
    The sextic ``g (x^4 - 4x) + (1 - g) (x^6 - 6x^3) = g Delta/h`` in x = sqrt(a/a_g) has a_g =
    (pi w R^2/8 E*)^(1/3), h = a_g^2/R and g = k/(k + 4 E* a_g/3). Call its left side F.

    *One fold.* ``F' = 6 (1-g) x^5 + 4 g x^3 - 18 (1-g) x^2 - 4 g`` changes sign once in its coefficients, so
    by Descartes' rule it has one root x_f > 0 (between 1 and 3^(1/3)); F falls before and grows after it.
    The stable contact is the one root right of x_f, and exists if ``excess = g Delta/h - F(x_f) >= 0``.

    *Convex beyond it.* ``F'' = 6x [5 (1-g) x^3 + 2 g x - 6 (1-g)]`` has a growing bracket, thus changes sign
    at most once, from - to +. Up to there F' falls from ``-4g <= 0``, so x_f lies right of it.

    *Newton's method never fails.* Measured from the fold, x = x_f + t, the sextic ``f_2 t^2 + ... + f_6 t^6 =
    excess`` has no negative term: a step from any t > 0 ends right of the root or on it, and from there each goes
    left and none passes it. A first guess within 12 % for any g and excess, one step of third order that is exact for
    a power of t, and three of Newton's leave less than 1e-15; their number is fixed. Towards the fold only the excess
    cancels: at a relative distance d from it, a relative change e of an input moves the radius by about e/sqrt(d).

    Where w R, R/E*, a_g^3 or a_g^2/R leave the range of numbers, adhesion is left out or the answer is nan.

    Examples
    --------
    The same displacement pulls the sphere off behind a stiff spring, not behind a soft one:

    >>> a = radius_at_displacement(-9e-7, [100.0, 1e3, float("inf")], 0.042, 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    6.68e-05 3.83e-05 nan
    """
    given = displacement, stiffness, work, sphere_radius, modulus
    shape = np.broadcast(*given).shape
    if math.prod(shape) <= _BLOCK:
        small = np.empty((6, *shape))
        for row, value in enumerate(given):
            small[row] = value
        _solve(*small.reshape(6, -1))
        return small[5][()]
    arrays = [np.asarray(value, dtype=float) for value in given]
    flat = [array if array.size == 1 or array.shape == shape else np.broadcast_to(array, shape) for array in arrays]
    flat = [array.reshape(-1) for array in flat]
    radii = np.empty(math.prod(shape))
    block = np.empty((5, min(radii.size, _BLOCK)))
    for first in range(0, radii.size, _BLOCK):
        part = radii[first : first + _BLOCK]
        for row, array in zip(block, flat, strict=True):
            if array.size > 1:
                row[: part.size] = array[first : first + _BLOCK]
            elif first == 0:
                row[:] = array
        _solve(*block[:, : part.size], part)
    return radii.reshape(shape)[()]
