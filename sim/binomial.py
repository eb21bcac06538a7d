"""Binomial numbers by inversion at one uniform number each, for any number of trials.

The distribution function is evaluated once, near the answer, and the last steps are single
probabilities; the time does not grow with the number of trials. All is exact but for some roundings of
the distribution function, so a number differs from the true inverse with a chance of about 1e-15 times
its own spread.
"""

import math

import numpy as np

from sim.jit import device, kernel

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
_HALF_LOG_2PI = 0.5 * math.log(2.0 * math.pi)
_SPLIT = 2.0**30 + 1.0  # leaves 23 bits, so that their product with a number below 2^30 is exact


def binomial_numbers(uniform, trials, chance) -> np.ndarray:
    """Numbers of successes: the least k whose distribution function reaches ``uniform``.

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
    ``F(k) = sum over j <= k of binom(n, j) p^j (1 - p)^(n - j)``. A guess by Cornish & Fisher's expansion is
    put right by the smaller of F and 1 − F there: with q = 1 − p

        ``F(k) = f(k) (n - k) p ∫ over s > 0 of exp((k + 1) s - (n + 1) ln(1 + p (e^s - 1))) ds``

    (s < 0 for 1 − F), the incomplete beta function in terms of the logit, by Gauss's rule; f(k) as Loader
    (2000) takes it, without a cancellation. Where p is above 1/2 the failures are counted instead.

    Examples
    --------
    The median of a billion fair coins, and what one run in ten thousand stays below:

    >>> [int(number) for number in binomial_numbers([0.5, 1e-4], 1e9, 0.5)]
    [500000000, 499941198]
    """
    uniform, trials, chance = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (uniform, trials, chance)))
    drawn = np.empty(uniform.shape)
    _draw(uniform.ravel(), trials.ravel(), chance.ravel(), drawn.reshape(-1))
    return drawn


def binomial_tails(number, trials, chance) -> tuple[float, float]:
    """Chance of at most, and of more than, ``number`` successes, each to some 1e-14 of itself.

    >>> least, more = binomial_tails(0, 10, 0.5)
    >>> print(f"{1024 * least:.6f} {1024 * more:.6f}")
    1.000000 1023.000000
    """
    told = np.empty(2)
    _tell(float(number), float(trials), float(chance), told)
    return float(told[0]), float(told[1])


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
def _deviance(excess, mean):
    """x ln(x/mean) + mean − x of x = mean + excess, zero or more."""
    e = excess / mean
    if e <= -1.0:
        return mean
    less = _log1p_less(e) if math.fabs(e) <= 0.5 else math.log1p(e) - e
    return mean * ((1.0 + e) * less + e * e)


@device
def _stirling(n):
    """ln n! less Stirling's formula, (n + 1/2) ln n − n + ln √(2π), for whole n above 0."""
    if n < 16.0:
        return math.lgamma(n + 1.0) - (n + 0.5) * math.log(n) + n - _HALF_LOG_2PI
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
    log = _stirling(n) - _stirling(k) - _stirling(n - k) - _deviance(over, n * p) - _deviance(-over, n * q)
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
def _deviate(u):
    """Standard normal number below which u <= 1/2 lies, to 1e-6 (Wichura, AS 241, 1988)."""
    d = u - 0.5
    if math.fabs(d) <= 0.425:
        r = 0.180625 - d * d
        top = ((59.109374720 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179
        return d * top / (((67.187563600 * r + 78.757757664) * r + 17.895169469) * r + 1.0)
    r = math.sqrt(-math.log(u))
    if r <= 5.0:
        r -= 1.6
        top = ((0.17023821103 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777
        return -top / ((0.12021132975 * r + 0.73700164250) * r + 1.0)
    r -= 5.0
    top = ((0.017337203997 * r + 0.42868294337) * r + 3.0812263860) * r + 6.6579051150
    return -top / ((0.012258202635 * r + 0.24197894225) * r + 1.0)


@device
def _guess(low, high, n, p):
    """About the least k with F(k) >= low = 1 − high, by Cornish & Fisher."""
    z = _deviate(low) if low <= 0.5 else -_deviate(high)
    pq = p * (1.0 - p)
    spread, lean = math.sqrt(n * pq), 1.0 - 2.0 * p
    x = n * p + spread * z + lean * (z * z - 1.0) / 6.0
    x += z * ((z * z - 3.0) * (1.0 - 6.0 * pq) / 24.0 - (2.0 * z * z - 5.0) * lean * lean / 36.0 - pq / 24.0) / spread
    return min(max(math.ceil(x - 0.5), 0.0), n)


@device
def _inverse(low, high, strict, n, p, work):
    """Least k with F(k) >= low, or > low if strict; ``high`` is 1 − low, which decides in the upper half."""
    odds, upper = p / (1.0 - p), low > 0.5
    k = _guess(low, high, n, p)
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
def _number(u, n, p, work):
    if not (u == u and n == n and p == p):
        return math.nan
    if n <= 0.0 or p <= 0.0 or u <= 0.0:
        return 0.0
    if p >= 1.0 or u >= 1.0:
        return n
    if p <= 0.5:
        return _inverse(u, 1.0 - u, False, n, p, work)
    return n - _inverse(1.0 - u, u, True, n, 1.0 - p, work)


@kernel("void(float64[::1], float64[::1], float64[::1], float64[::1])")
def _draw(uniform, trials, chance, drawn):
    work = np.empty(_NODES.size)
    for i in range(drawn.size):
        drawn[i] = _number(uniform[i], trials[i], chance[i], work)


@kernel("void(float64, float64, float64, float64[::1])")
def _tell(k, n, p, told):
    work = np.empty(_NODES.size)
    if p <= 0.5:
        told[0], told[1] = _tails(k, n, p, _chance(k, n, p), work)
    elif k >= n:
        told[0], told[1] = 1.0, 0.0
    else:  # at most k successes are n − k failures or more
        told[1], told[0] = _tails(n - k - 1.0, n, 1.0 - p, _chance(n - k - 1.0, n, 1.0 - p), work)
