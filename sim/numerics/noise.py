"""Counter-based random numbers: a draw depends only on (seed, part, member, step).

No generator is carried from step to step, so that a member draws the same numbers alone, in a batch, after a restart
or on another machine. The numbers of one address come from a stream of their own: xoshiro256++ (Blackman & Vigna,
ACM TOMS 47, 2021), whose state is four words of Philox4x64-10 (Salmon, Moraes, Dror & Shaw, SC11, 2011) at that
address, equal to numpy's ``Philox(...).random_raw``. Normals follow by the ziggurat (Marsaglia & Tsang, J. Stat. Softw.
5(8), 2000), gammas by Marsaglia & Tsang's rejection from normals (ACM TOMS 26, 2000).

Compiled loops draw where they use a number: ``number, numbers = normal(numbers)``. Scalar code of exactly rounded
operations, so the same bits with any vector instructions (but for gammas of shapes below 1 other than 0.5, which
take the library's exponential).
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
_STREAMS = _U(256)  # first lane of streams; those below belong to the lives of single bonds
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

    def uniforms(self, step: int, count: int) -> np.ndarray:
        """Uniform numbers in [0, 1), the first of lane 1 of a step, shape (members, count)."""
        numbers = np.empty((len(self.members), count))
        _uniforms(*self.at(step), numbers)
        return numbers


@device
def _high_product(a, b):
    """Upper 64 bits of a product of two 64-bit words."""
    a_low, a_high, b_low, b_high = a & _LOW_HALF, a >> _HALF, b & _LOW_HALF, b >> _HALF
    one, two = a_low * b_high, a_high * b_low
    middle = ((a_low * b_low) >> _HALF) + (one & _LOW_HALF) + (two & _LOW_HALF)
    return a_high * b_high + (one >> _HALF) + (two >> _HALF) + (middle >> _HALF)


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

    Philox words of the counter (step, 0, member, 256 + lane) under the key (seed, part) are the state of xoshiro256++,
    a tuple of four words that each draw takes and returns.
    """
    return words_at(seed, part, _U(step), _U(0), member, _STREAMS + _U(lane))


@device
def word(numbers):
    """A word of 64 bits, and the stream after it."""
    zero, one, two, three = numbers
    both = zero + three
    drawn = ((both << _U(23)) | (both >> _U(41))) + zero
    two, three, shifted = two ^ zero, three ^ one, one << _U(17)
    one, zero = one ^ two, zero ^ three
    return drawn, (zero, one, two ^ shifted, (three << _U(45)) | (three >> _U(19)))


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
    k = float_of((exponent + np.int64(1024)) | np.int64(0x4330000000000000)) - 4503599627371520.0
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    odd = 2.857142874366239149e-01 + w * (1.818357216161805012e-01 + w * 1.479819860510658591e-01)
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
        area, height = Decimal("0.0049286732339746553474"), Decimal("0.0012602859304985975641")
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
    """The normal number of a point that may lie beyond the curve, rejected points drawn again."""
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
        one, numbers = word(numbers)
        two, numbers = word(numbers)
        x = exponential(one) / _TAIL
        if 2.0 * exponential(two) > x * x:
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
        if u < 1.0 - 0.1986 * (c * x * x) * (c * x * x) or logarithm(u) < 0.5 * x * x + d * (1.0 - v + logarithm(v)):
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


@kernel("void(uint64, uint64, uint64[::1], int64, float64[:,::1])")
def _uniforms(seed, part, members, step, drawn):
    for m in range(members.size):
        numbers = stream(seed, part, members[m], step, 1)
        for k in range(drawn.shape[1]):
            drawn[m, k], numbers = uniform(numbers)
