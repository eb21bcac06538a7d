"""Binomial numbers for any number of trials, by rejection; the time does not grow with the number of trials."""

import math

import numpy as np

from sim.numerics.jit import device
from sim.numerics.noise import logarithm, uniform

#: ln n! less Stirling's formula for n = 1 to 15; unused at n = 0.
_STIRLING = np.array((
    0.0, 0.08106146679532726, 0.0413406959554093, 0.02767792568499834, 0.020790672103765093, 0.016644691189821193,
    0.013876128823070748, 0.01189670994589177, 0.010411265261972096, 0.009255462182712733, 0.00833056343336287,
    0.007573675487951841, 0.00694284010720953, 0.006408994188004207, 0.0059513701127588475, 0.005554733551962801,
))  # fmt: skip
_SPLIT = 2.0**30 + 1.0  # leaves 23 bits, so that their product with a number below 2^30 is exact
_FEW = 10.0  # mean up to which numbers are counted up; the constants of rejection hold from here


@device
def binomial(trials, chance, numbers):
    """A binomial number as a float, and the stream of random numbers after it.

    Parameters
    ----------
    trials : float
        n, a whole number from 0 to 1e9.
    chance : float
        p of a single success [1]; what is outside of [0, 1] is taken as its nearest end.
    numbers : tuple
        Stream of random numbers, as of ``sim.numerics.noise.stream``; nothing is drawn where the result is certain.

    Notes
    -----
    From a mean of ten by Hörmann's transformed rejection (BTRS; J. Stat. Comput. Simul. 46, 1993), where the chance
    is as Loader (2000) takes it, without a cancellation; below by counting up the distribution function. Where p is
    above 1/2 the failures are counted instead. nan where an argument is.
    """
    if not (trials == trials and chance == chance):
        return math.nan, numbers
    if trials <= 0.0 or chance <= 0.0:
        return 0.0, numbers
    if chance >= 1.0:
        return trials, numbers
    p = chance if chance <= 0.5 else 1.0 - chance
    number, numbers = _rejected(trials, p, numbers) if trials * p >= _FEW else _counted_up(trials, p, numbers)
    return (number if chance <= 0.5 else trials - number), numbers


@device
def _counted_up(n, p, numbers):
    """A binomial number of a mean below ten and p <= 1/2, the inverse of the distribution function."""
    left, numbers = uniform(numbers)
    k, term, odds = 0.0, math.exp(n * _log1p(-p)), p / (1.0 - p)
    while left >= term and k < min(n, 200.0):  # beyond, chances are below 1e-150
        left -= term
        term *= (n - k) * odds / (k + 1.0)
        k += 1.0
    return k, numbers


@device
def _hat(spread, p):
    """Hörmann's constants a, b, α and v_r for a standard deviation and p."""
    b = 1.15 + 2.53 * spread
    return 0.0248 * b + 0.01 * p - 0.0873, b, (2.83 + 5.1 / b) * spread, 0.92 - 4.2 / b


@device
def _rejected(n, p, numbers):
    """A binomial number of a mean of ten or more and p <= 1/2."""
    variance, most = n * p * (1.0 - p), math.floor((n + 1.0) * p)
    a, b, size, sure = _hat(math.sqrt(variance), p)
    while True:
        u, numbers = uniform(numbers)
        v, numbers = uniform(numbers)
        u, v = u - 0.5, 1.0 - v
        room = 0.5 - abs(u)
        if room == 0.0:
            continue
        k = math.floor((2.0 * a / room + b) * u + n * p + 0.5)
        if room >= 0.07 and v <= sure:
            return k, numbers
        if k < 0.0 or k > n:
            continue
        bar, off = logarithm(v * size / (a / (room * room) + b)), abs(k - most)
        if off < 0.5 * variance - 1.0:  # Kachitvichyanukul & Schmeiser's bounds (Comm. ACM 31, 1988)
            about = -0.5 * off * off / variance
            doubt = ((off * (off / 3.0 + 0.625) + 1.0 / 6.0) / variance + 0.5) * off / variance
            if bar < about - doubt:
                return k, numbers
            if bar > about + doubt:
                continue
        if bar <= _log_chance(k, n, p) - _log_chance(most, n, p):
            return k, numbers


@device
def _log1p(x):
    """ln(1 + x) for |x| <= 1/2."""
    return _log1p_less(x) + x


@device
def _log1p_less(x):
    """ln(1 + x) − x for |x| <= 1/2, by 2 artanh(x/(2 + x))."""
    r = x / (2.0 + x)
    y = r * r
    total = 1 / 21 + y * (1 / 23 + y * (1 / 25 + y * (1 / 27 + y * (1 / 29 + y * (1 / 31)))))
    total = 1 / 11 + y * (1 / 13 + y * (1 / 15 + y * (1 / 17 + y * (1 / 19 + y * total))))
    total = 1 / 3 + y * (1 / 5 + y * (1 / 7 + y * (1 / 9 + y * total)))
    return r * (2.0 * y * total - x)


@device
def _deviance(x, excess, mean):
    """x ln(x/mean) + mean − x of x = mean + excess, above zero."""
    e = excess / mean
    if math.fabs(e) <= 0.5:
        return mean * ((1.0 + e) * _log1p_less(e) + e * e)
    return x * logarithm(x / mean) - excess


@device
def _stirling(n):
    """ln n! less Stirling's formula, (n + 1/2) ln n − n + ln √(2π), for whole n above 0."""
    if n < 16.0:
        return _STIRLING[int(n)]
    y = 1.0 / (n * n)
    return (1 / 12 - y * (1 / 360 - y * (1 / 1260 - y * (1 / 1680 - y * (1 / 1188 - y * 691 / 360360))))) / n


@device
def _excess(k, n, p):
    """k − n p without rounding the product."""
    high = _SPLIT * p
    high = high - (high - p)
    return (k - n * high) - n * (p - high)


@device
def _log_chance(k, n, p):
    """Logarithm of the chance of k successes of n, 0 < p <= 1/2."""
    if k == 0.0:
        return n * _log1p(-p)
    if k == n:
        return n * logarithm(p)
    over = _excess(k, n, p)
    log = _stirling(n) - _stirling(k) - _stirling(n - k) - 0.5 * logarithm(2.0 * math.pi * k * (n - k) / n)
    return log - _deviance(k, over, n * p) - _deviance(n - k, -over, n * (1.0 - p))
