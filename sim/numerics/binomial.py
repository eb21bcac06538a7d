"""Binomial numbers by inversion at one uniform number each, for any number of trials.

An expansion of the inverse gives the number where its error cannot change it; elsewhere the
distribution function is evaluated, once and near the result. The time does not grow with the number of
trials. The result is exact but for rounding of the distribution function: a number differs from the
true inverse with a probability of about 1e-14 times its standard deviation.
"""

import math

import numpy as np
import scipy.special

from sim.numerics.jit import device, kernel

_LARGE = 200.0  # variance from which a tail is an integral instead of a sum
#: Gauss's rule of 24 points over (0, 1); the second half of the weights mirrors the first.
_NODES = np.array((
    0.00240639000148932, 0.012635722014345251, 0.030862723998633622, 0.056792236497799485, 0.08999900701304854,
    0.12993790421072282, 0.17595317403151223, 0.22728926430558022, 0.2831032461869774, 0.3424786601519183,
    0.40444056626319186, 0.4679715535686972, 0.5320284464313028, 0.5955594337368082, 0.6575213398480817,
    0.7168967538130225, 0.7727107356944197, 0.8240468259684878, 0.8700620957892772, 0.9100009929869515,
    0.9432077635022005, 0.9691372760013663, 0.9873642779856547, 0.9975936099985107,
))  # fmt: skip
_WEIGHTS = np.array((
    0.0061706148999936, 0.014265694314466832, 0.022138719408709904, 0.02964929245771839, 0.03667324070554015,
    0.04309508076597664, 0.04880932605205694, 0.05372213505798282, 0.0577528340268628, 0.060835236463901696,
    0.06291872817341415, 0.06396909767337608,
))  # fmt: skip
_WEIGHTS = np.concatenate([_WEIGHTS, _WEIGHTS[::-1]])
_END = 40.0  # of the exponent, where the integral may end
#: ln n! less Stirling's formula for n = 1 to 15; unused at n = 0.
_STIRLING = np.array((
    0.0, 0.08106146679532726, 0.0413406959554093, 0.02767792568499834, 0.020790672103765093, 0.016644691189821193,
    0.013876128823070748, 0.01189670994589177, 0.010411265261972096, 0.009255462182712733, 0.00833056343336287,
    0.007573675487951841, 0.00694284010720953, 0.006408994188004207, 0.0059513701127588475, 0.005554733551962801,
))  # fmt: skip
_SURE = 30.0  # variance from which the expansion decides where it can
#: Its error is below 0.0018 (1 + z²)³/variance² up to |z| = 8.3, as far as numbers of 53 bits reach: six times that.
_DOUBT, _ROUNDING = 0.011, 2e-15
_SPLIT = 2.0**30 + 1.0  # leaves 23 bits, so that their product with a number below 2^30 is exact


def binomial_numbers(uniform, trials, chance) -> np.ndarray:
    """Binomial numbers by inversion: the least k whose distribution function reaches ``uniform``.

    Parameters
    ----------
    uniform : array
        u in (0, 1); 0 and less give 0, 1 and more all the trials.
    trials : array of whole floats
        n, from 0 to 1e9.
    chance : array
        p of a single success [1]; what is outside of [0, 1] is taken as its nearest end.

    Returns
    -------
    array
        Whole floats from 0 to n; nan where an argument is. Arguments broadcast against each other.

    Notes
    -----
    ``F(k) = sum over j <= k of binom(n, j) p^j (1 - p)^(n - j)``. Cornish & Fisher's expansion gives k to a
    known error; where that leaves two candidates, the smaller of F and 1 − F decides, as a sum or as

        ``F(k) = f(k) (n - k) p ∫ over s > 0 of exp((k + 1) s - (n + 1) ln(1 + p (e^s - 1))) ds``

    (s < 0 for 1 − F), the incomplete beta function in terms of the logit, by Gauss's rule; f(k) as Loader
    (2000) takes it, without a cancellation. Where p is above 1/2 the failures are counted instead.

    Examples
    --------
    The median of a billion fair coins, and what one run in ten thousand stays below:

    >>> [int(number) for number in binomial_numbers([0.5, 1e-4], 1e9, 0.5)]
    [500000000, 499941197]
    """
    uniform, trials, chance = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (uniform, trials, chance)))
    drawn = np.empty(uniform.shape)
    normal = scipy.special.ndtri(uniform)
    _draw(uniform.ravel(), normal.ravel(), trials.ravel(), chance.ravel(), drawn.reshape(-1))
    return drawn


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
def _exp_less(s):
    """e^s − 1 − s for |s| < 1, by its series."""
    total = 1.0 + s * (1 / 15) * (1.0 + s * (1 / 16) * (1.0 + s * (1 / 17) * (1.0 + s * (1 / 18))))
    total = 1.0 + s * (1 / 11) * (1.0 + s * (1 / 12) * (1.0 + s * (1 / 13) * (1.0 + s * (1 / 14) * total)))
    total = 1.0 + s * (1 / 7) * (1.0 + s * (1 / 8) * (1.0 + s * (1 / 9) * (1.0 + s * (1 / 10) * total)))
    total = 1.0 + s * (1 / 3) * (1.0 + s * (1 / 4) * (1.0 + s * (1 / 5) * (1.0 + s * (1 / 6) * total)))
    return 0.5 * s * s * total


@device
def _deviance(x, excess, mean):
    """x ln(x/mean) + mean − x of x = mean + excess, above zero."""
    e = excess / mean
    if math.fabs(e) <= 0.5:
        return mean * ((1.0 + e) * _log1p_less(e) + e * e)
    return x * math.log(x / mean) - excess


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
def _chance(k, n, p):
    """Chance of k successes of n, 0 < p <= 1/2."""
    q = 1.0 - p
    if k == 0.0:
        return math.exp(n * math.log1p(-p))
    if k == n:
        return math.exp(n * math.log(p))
    over = _excess(k, n, p)
    log = _stirling(n) - _stirling(k) - _stirling(n - k) - _deviance(k, over, n * p) - _deviance(n - k, -over, n * q)
    return math.exp(log) * math.sqrt(n / (2.0 * math.pi * k * (n - k)))


@device
def _exponent(s, slope, n, p):
    """(n + 1) (ln(1 + p (e^s − 1)) − p s) − slope s, the exponent of the integral; grows with |s| on its side."""
    more = _exp_less(s)
    return (n + 1.0) * (_log1p_less(p * (more + s)) + p * more) - slope * s


@device
def _tail_integral(slope, n, p, side, work):
    """∫e^(−exponent) over s > 0 (``side`` 1) or s < 0 (−1), where the slope is downhill or nearly so."""
    steep, bend = math.fabs(slope), (n + 1.0) * p * (1.0 - p)
    end = 2.0 * _END / (steep + math.sqrt(steep * steep + 2.0 * _END * bend))
    short = _END - _exponent(side * end, slope, n, p)
    if short > 0.0:  # the exponent is convex: Newton's step goes beyond
        end += short / (steep + bend * end * math.exp(-end))
    for i in range(_NODES.size):  # a pass of its own, for vector instructions
        work[i] = _exponent(side * end * _NODES[i], slope, n, p)
    total = 0.0
    for i in range(_NODES.size):
        total += _WEIGHTS[i] * math.exp(-work[i])
    return end * total


@device
def _tails(k, n, p, here, work):
    """F(k) and 1 − F(k) where k has the chance ``here``: the smaller one is taken, the other is the rest."""
    if k >= n:
        return 1.0, 0.0
    odds = p / (1.0 - p)
    slope = _excess(k + 1.0, n + 1.0, p)
    if n * p * (1.0 - p) >= _LARGE:
        side = -1.0 if slope > 0.0 else 1.0
        part = here * (n - k) * p * _tail_integral(slope, n, p, side, work)
        return (1.0 - part, part) if slope > 0.0 else (part, 1.0 - part)
    term = part = 0.0
    if slope > 0.0:
        term = part = here * (n - k) * odds / (k + 1.0)
        j = k + 1.0
        while term > 1e-17 * part and j < n:
            term *= (n - j) * odds / (j + 1.0)
            part += term
            j += 1.0
        return 1.0 - part, part
    term = part = here
    j = k
    while term > 1e-17 * part and j > 0.0:
        term *= j / ((n - j + 1.0) * odds)
        part += term
        j -= 1.0
    return part, 1.0 - part


@device
def _expansion(z, n, p):
    """Place at which F continued between whole numbers, less 1/2, is the normal distribution function at z.

    Cornish & Fisher's expansion to the sixth cumulant. That of a lattice with its continuity correction is
    that of a smooth law whose even cumulants are less by those of a uniform number in (−1/2, 1/2).
    """
    pq, lean = p * (1.0 - p), 1.0 - 2.0 * p
    whole = n * pq
    variance = whole - 1.0 / 12.0
    spread = math.sqrt(variance)
    one, two = whole * lean / (variance * spread), (whole * (1.0 - 6.0 * pq) + 1.0 / 120.0) / (variance * variance)
    three = whole * lean * (1.0 - 12.0 * pq) / (variance * variance * spread)
    four = (whole * (1.0 - 30.0 * pq + 120.0 * pq * pq) - 1.0 / 252.0) / (variance * variance * variance)
    h2 = z * z - 1.0
    h3 = z * h2 - 2.0 * z
    h4 = z * h3 - 3.0 * h2
    h5 = z * h4 - 4.0 * h3
    x = z + one * h2 / 6.0 + two * h3 / 24.0 - one * one * (2.0 * h3 + z) / 36.0
    x += three * h4 / 120.0 - one * two * (h4 + h2) / 24.0 + one * one * one * (12.0 * h4 + 19.0 * h2) / 324.0
    x += four * h5 / 720.0 - two * two * (3.0 * h5 + 6.0 * h3 + 2.0 * z) / 384.0
    x += one * one * two * (14.0 * h5 + 37.0 * h3 + 8.0 * z) / 288.0 - one * three * (2.0 * h5 + 3.0 * h3) / 180.0
    x -= one * one * one * one * (252.0 * h5 + 832.0 * h3 + 227.0 * z) / 7776.0
    return n * p + spread * x - 0.5


@device
def _inverse(low, high, z, strict, n, p, work):
    """Least k with F(k) >= low, or > low if strict; ``high`` is 1 − low, which decides in the upper half.

    The normal distribution function is ``low`` at z.
    """
    variance, size = n * p * (1.0 - p), 1.0 + z * z
    if variance < _SURE:
        k = n * p + math.sqrt(variance) * z + (1.0 - 2.0 * p) * (z * z - 1.0) / 6.0 - 0.5
    else:
        k = _expansion(z, n, p)
        doubt = _DOUBT * size * size * size / (variance * variance) + _ROUNDING * k
        if math.ceil(k - doubt) == math.ceil(k + doubt):
            return math.ceil(k)
    return _searched(min(max(math.ceil(k), 0.0), n), low, high, strict, n, p, work)


@device
def _searched(k, low, high, strict, n, p, work):
    """The inverse by the distribution function itself, searched from the guess k."""
    odds, upper = p / (1.0 - p), low > 0.5
    here = _chance(k, n, p)
    below, above = _tails(k, n, p, here, work)
    exact = above if upper else below
    going = 0
    while True:
        off = high - above if upper else below - low
        reached = off > 0.0 or (off == 0.0 and not strict) or k >= n
        if reached and going > 0:
            return k
        if reached and k <= 0.0:
            return 0.0
        if not reached and going < 0:
            return k + 1.0
        if reached:
            going = -1
            below, above = below - here, above + here
            here *= k / ((n - k + 1.0) * odds)
            k -= 1.0
        else:
            going = 1
            here *= (n - k) * odds / (k + 1.0)
            k += 1.0
            below, above = below + here, above - here
        held = above if upper else below
        if held < 0.25 * exact:  # too much was taken away
            here = _chance(k, n, p)
            below, above = _tails(k, n, p, here, work)
            held = above if upper else below
            exact = held


@device
def _number(u, z, n, p, work):
    if not (u == u and n == n and p == p):
        return math.nan
    if n <= 0.0 or p <= 0.0 or u <= 0.0:
        return 0.0
    if p >= 1.0 or u >= 1.0:
        return n
    if p <= 0.5:
        return _inverse(u, 1.0 - u, z, False, n, p, work)
    return n - _inverse(1.0 - u, u, -z, True, n, 1.0 - p, work)


@kernel("void(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1])")
def _draw(uniform, normal, trials, chance, drawn):
    work = np.empty(_NODES.size)
    for i in range(drawn.size):
        drawn[i] = _number(uniform[i], normal[i], trials[i], chance[i], work)
