"""Counter-based random numbers: a draw depends only on (seed, part, member, step).

No generator is carried from step to step, so that a member draws the same numbers alone, in a batch, after a restart or
on another machine. The numbers of each address come from a separate stream of xoshiro256++ (Blackman & Vigna, ACM TOMS
47, 2021). Its state is four words of Philox4x64-10 (Salmon, Moraes, Dror & Shaw, SC11, 2011) at that address. These
words are equal to ``Philox(...).random_raw`` of numpy. Normals follow by the ziggurat (Marsaglia & Tsang, J. Stat.
Softw. 5(8), 2000), gammas by Marsaglia & Tsang's rejection from normals (ACM TOMS 26, 2000), binomials by transformed
rejection.

Compiled loops draw where they use a number: ``number, numbers = normal(numbers)``. Scalar code of exactly rounded
operations, so the bits are the same with any vector instructions. An exception are gammas of shapes below 1 other than
0.5, which use the library's exponential.
"""

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from functools import cached_property

import numpy as np

from sim.numerics.jit import bits_of, device, float_of, inlined, kernel

#: Fixed integer of each part that draws; part of the address, so never renumbered.
PARTS = {"bonds": 1, "shear": 2, "drive": 3, "contact": 4}


_U = np.uint64
_FACTORS = _U(0xD2E7470EE14C6C93), _U(0xCA5A826395121157)
_WEYL = _U(0x9E3779B97F4A7C15), _U(0xBB67AE8584CAA73B)
# first lane of streams; those below belong to the lives of single bonds
_STREAMS = _U(256)
_LOW_HALF, _HALF = _U(0xFFFFFFFF), _U(32)


@dataclass(frozen=True)
class Noise:
    """Address of the random numbers of one part for the members of one batch.

    Parameters
    ----------
    seed : int
        Seed of the run, 0 to 2**64 - 1.
    part : str
        The part that draws, a key of ``PARTS``.
    members : array of int, shape (members,)
        Absolute numbers of the members in this batch.

    Examples
    --------
    >>> alone, batch = Noise(1, "shear", np.array([5])), Noise(1, "shear", np.arange(8))
    >>> bool(np.all(alone.normals(3, 4)[0] == batch.normals(3, 4)[5]))
    True
    """

    seed: int
    part: str
    members: np.ndarray

    @cached_property
    def _address(self) -> tuple[np.uint64, np.uint64, np.ndarray]:
        return _U(self.seed), _U(PARTS[self.part]), self.members.astype(_U)

    def at(self, step: int) -> tuple[np.uint64, np.uint64, np.ndarray, int]:
        """Seed, number of the part, members and step, of which compiled loops make each member's ``stream``."""
        return *self._address, step

    def normals(self, step: int, count: int) -> np.ndarray:
        """Standard normals, the first of lane 0 of a step, shape (members, count)."""
        numbers = np.empty((len(self.members), count))
        _normals(*self.at(step), numbers)
        return numbers


@device
def _high_product(a, b):
    """Upper 64 bits of a product of two 64-bit words."""
    a_low, a_high, b_low, b_high = a & _LOW_HALF, a >> _HALF, b & _LOW_HALF, b >> _HALF
    first, second = a_low * b_high, a_high * b_low
    middle = ((a_low * b_low) >> _HALF) + (first & _LOW_HALF) + (second & _LOW_HALF)
    return a_high * b_high + (first >> _HALF) + (second >> _HALF) + (middle >> _HALF)


@inlined
def words_at(seed, part, c0, c1, c2, c3):
    """Four Philox words of one counter under the key (seed, part)."""
    k0, k1 = seed, part
    for _ in range(10):
        high0, low0 = _high_product(_FACTORS[0], c0), _FACTORS[0] * c0
        high1, low1 = _high_product(_FACTORS[1], c2), _FACTORS[1] * c2
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
        k0, k1 = k0 + _WEYL[0], k1 + _WEYL[1]
    return c0, c1, c2, c3


@device
def stream(seed, part, member, step, lane):
    """The numbers of one member and step at their beginning; a ``lane`` of its own for each law of a part.

    Philox words of the counter (step, 0, member, 256 + lane) under the key (seed, part) are the state of xoshiro256++.
    Each draw takes and returns this tuple of four words.
    """
    return words_at(seed, part, _U(step), _U(0), member, _STREAMS + _U(lane))


@device
def word(numbers):
    """Return a word of 64 bits, and the stream after it."""
    s0, s1, s2, s3 = numbers
    total = s0 + s3
    drawn = ((total << _U(23)) | (total >> _U(41))) + s0
    s2, s3, shifted = s2 ^ s0, s3 ^ s1, s1 << _U(17)
    s1, s0 = s1 ^ s2, s0 ^ s3
    return drawn, (s0, s1, s2 ^ shifted, (s3 << _U(45)) | (s3 >> _U(19)))


@device
def _unit(word):
    """A float in [1, 2) from the upper 52 bits of a word."""
    return float_of((word >> _U(12)) | _U(0x3FF0000000000000))


@device
def unit_at(word):
    """A uniform number in [0, 1) from a word."""
    return _unit(word) - 1.0


@device
def uniform(numbers):
    """A uniform number in [0, 1), and the stream after it."""
    drawn, numbers = word(numbers)
    return unit_at(drawn), numbers


@device
def logarithm(x):
    """ln x for normal x > 0, to one unit in the last place; the minimax polynomial of fdlibm's ``log``."""
    bits = bits_of(x)
    exponent = (bits - np.int64(0x3FE6A09E00000000)) >> np.int64(52)
    f = float_of(bits - (exponent << np.int64(52))) - 1.0
    # the integer exponent as a float, by its bits
    k = (
        float_of((exponent + np.int64(1024)) | np.int64(0x4330000000000000))
        - 4503599627371520.0
    )
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (
        3.999999999940941908e-01
        + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01)
    )
    odd = 2.857142874366239149e-01 + w * (
        1.818357216161805012e-01 + w * 1.479819860510658591e-01
    )
    odd = z * (6.666666666666735130e-01 + w * odd)
    half = 0.5 * f * f
    rest = s * (half + odd + even) + k * 1.90821492927058770002e-10
    return k * 6.93147180369123816490e-01 - ((half - rest) - f)


@device
def exponential(word):
    """A standard exponential number from a word, 0 to 36.04."""
    return -logarithm(2.0 - _unit(word))


def _layers() -> tuple[np.ndarray, np.ndarray]:
    """Half widths and heights of 256 layers of equal area under exp(−x²/2), rounded from twenty digits.

    The lowest layer is the base, whose tail beyond the first width is drawn apart; its own width is that of a
    rectangle of the same area.
    """
    with localcontext(prec=20):
        area, height = (
            Decimal("0.0049286732339746553474"),
            Decimal("0.0012602859304985975641"),
        )
        widths, heights = [area / height], [Decimal(0), height]
        while len(widths) < 256:
            widths.append((-2 * heights[-1].ln()).sqrt())
            heights.append(heights[-1] + area / widths[-1])
        return np.array(widths, dtype=float), np.array(heights, dtype=float)


_WIDTHS, _HEIGHTS = _layers()
_TAIL = _WIDTHS[1]  # where it begins
_SCALES = _WIDTHS * 2.0**-53
#: Whole numbers below which a point of the layer lies under the curve in any case.
_INSIDE = (np.append(_WIDTHS[1:], 0.0) / _WIDTHS * 2.0**53).astype(np.int64)


@device
def _candidate(numbers):
    """Layer, place along it as a whole number of 54 bits, and the stream after them."""
    drawn, numbers = word(numbers)
    return drawn & _U(255), np.int64(drawn) >> np.int64(10), numbers


@device
def normal(numbers):
    """A standard normal number, and the stream after it; the ziggurat of 256 layers."""
    layer, place, numbers = _candidate(numbers)
    x = place * _SCALES[layer]
    if abs(place) < _INSIDE[layer]:
        return x, numbers
    return _edge(layer, place, x, numbers)


@device
def _edge(layer, place, x, numbers):
    """The normal number of a point that may lie beyond the curve, rejected points drawn again.

    A function of its own, because ``normal`` without a loop is inlined: a third of the time.
    """
    while True:
        if layer == 0:
            return _beyond(place, numbers)
        share, numbers = uniform(numbers)
        height = _HEIGHTS[layer] + (_HEIGHTS[layer + _U(1)] - _HEIGHTS[layer]) * share
        if logarithm(height) < -0.5 * x * x:
            return x, numbers
        layer, place, numbers = _candidate(numbers)
        x = place * _SCALES[layer]
        if abs(place) < _INSIDE[layer]:
            return x, numbers


@device
def _beyond(place, numbers):
    """A normal number in the tail, by Marsaglia's rejection, with the sign of ``place``."""
    while True:
        first, numbers = word(numbers)
        second, numbers = word(numbers)
        x = exponential(first) / _TAIL
        if 2.0 * exponential(second) > x * x:
            return (x + _TAIL if place >= 0 else -x - _TAIL), numbers


@device
def gamma(shape, numbers):
    """A standard gamma number of ``shape`` >= 0.5, and the stream after it.

    A shape a below 1 is that of a + 1 times u^(1/a).
    """
    d = (shape if shape >= 1.0 else shape + 1.0) - 1.0 / 3.0
    c = 1.0 / (3.0 * math.sqrt(d))
    while True:
        x, numbers = normal(numbers)
        drawn, numbers = word(numbers)
        v = 1.0 + c * x
        if v <= 0.0:
            continue
        v, u = v * v * v, 2.0 - _unit(drawn)
        if u < 1.0 - 0.1986 * (c * x * x) * (c * x * x) or logarithm(
            u
        ) < 0.5 * x * x + d * (1.0 - v + logarithm(v)):
            break
    if shape >= 1.0:
        return d * v, numbers
    drawn, numbers = word(numbers)
    if shape == 0.5:
        u = 2.0 - _unit(drawn)
        return d * v * u * u, numbers
    return d * v * math.exp(-exponential(drawn) / shape), numbers


@kernel("void(uint64, uint64, uint64[::1], int64, float64[:,::1])")
def _normals(seed, part, members, step, drawn):
    for m in range(members.size):
        numbers = stream(seed, part, members[m], step, 0)
        for k in range(drawn.shape[1]):
            drawn[m, k], numbers = normal(numbers)


# Binomial numbers for any number of trials, by rejection; the time does not grow with the number of trials.


#: ln n! less Stirling's formula for n = 1 to 15; unused at n = 0.
_STIRLING = np.array(
    (
        0.0,
        0.08106146679532726,
        0.0413406959554093,
        0.02767792568499834,
        0.020790672103765093,
        0.016644691189821193,
        0.013876128823070748,
        0.01189670994589177,
        0.010411265261972096,
        0.009255462182712733,
        0.00833056343336287,
        0.007573675487951841,
        0.00694284010720953,
        0.006408994188004207,
        0.0059513701127588475,
        0.005554733551962801,
    )
)
# leaves 23 bits, so that their product with a number below 2^30 is exact
_SPLIT = 2.0**30 + 1.0
# mean up to which numbers are counted up; the constants of rejection hold from here
_FEW = 10.0


@device
def success(chance):
    """Return the constants of a ``chance`` of a single success, which all binomial numbers with this chance share.

    These are the chance p [1], the smaller one of p and 1 − p, the logarithm of the larger one, and their ratio.
    """
    p = chance if chance <= 0.5 else 1.0 - chance
    return chance, p, _log1p(-p), p / (1.0 - p)


@device
def binomial(trials, constants, numbers):
    """A binomial number as a float, and the stream of random numbers after it.

    Parameters
    ----------
    trials : float
        n, a whole number from 0 to 1e9.
    constants : tuple
        The ``success`` of the chance p; what is outside of [0, 1] is taken as its nearest end.
    numbers : tuple
        Stream of random numbers, as of ``sim.numerics.noise.stream``; nothing is drawn where the result is certain.

    Notes
    -----
    From a mean of ten by Hörmann's transformed rejection (BTRS; J. Stat. Comput. Simul. 46, 1993), where the chance
    is as Loader (2000) takes it, without a cancellation; below by counting up the distribution function. Where p is
    above 1/2 the failures are counted instead. nan where an argument is.
    """
    chance, p, log, odds = constants
    if not (trials == trials and chance == chance):
        return math.nan, numbers
    if trials <= 0.0 or chance <= 0.0:
        return 0.0, numbers
    if chance >= 1.0:
        return trials, numbers
    number, numbers = (
        _rejected(trials, p, numbers)
        if trials * p >= _FEW
        else _counted_up(trials, log, odds, numbers)
    )
    return (number if chance <= 0.5 else trials - number), numbers


@device
def _counted_up(n, log, odds, numbers):
    """A binomial number of a mean below ten and p <= 1/2, the inverse of the distribution function.

    ``log`` is ln(1 − p), ``odds`` p/(1 − p).
    """
    left, numbers = uniform(numbers)
    k, term = 0.0, math.exp(n * log)
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
        # Kachitvichyanukul & Schmeiser's bounds (Comm. ACM 31, 1988)
        if off < 0.5 * variance - 1.0:
            about = -0.5 * off * off / variance
            doubt = (
                ((off * (off / 3.0 + 0.625) + 1.0 / 6.0) / variance + 0.5)
                * off
                / variance
            )
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
    total = 1 / 21 + y * (
        1 / 23 + y * (1 / 25 + y * (1 / 27 + y * (1 / 29 + y * (1 / 31))))
    )
    total = 1 / 11 + y * (
        1 / 13 + y * (1 / 15 + y * (1 / 17 + y * (1 / 19 + y * total)))
    )
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
    return (
        1 / 12
        - y
        * (
            1 / 360
            - y * (1 / 1260 - y * (1 / 1680 - y * (1 / 1188 - y * 691 / 360360)))
        )
    ) / n


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
    log = (
        _stirling(n)
        - _stirling(k)
        - _stirling(n - k)
        - 0.5 * logarithm(2.0 * math.pi * k * (n - k) / n)
    )
    return log - _deviance(k, over, n * p) - _deviance(n - k, -over, n * (1.0 - p))
