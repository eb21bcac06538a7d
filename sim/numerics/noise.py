"""Counter-based random numbers: a draw depends only on (seed, part, member, step).

No generator is carried along, so that a member draws the same numbers alone, in a batch, after a
restart or on another machine.

The words are those of Philox4x64-10 (Salmon, Moraes, Dror & Shaw, SC11, 2011), equal to numpy's
``Philox(...).random_raw``; normals follow by Box & Muller. Both are written without branches or
calls, so that the compiler uses vector instructions: about three times as fast as numpy's own
normals, and the same bits on every machine, since only exactly rounded operations occur (but for
gammas of shapes between 0.5 and 1, which take the library's exponential).
"""

import math
from dataclasses import dataclass, field

import numpy as np

from sim.numerics.jit import device, inlined, kernel

#: Fixed integer of each part that draws; part of the address, so never renumbered.
PARTS = {"bonds": 1, "shear": 2, "drive": 3, "contact": 4}

#: Most numbers that one noise block may hold for one member (one step may hold more).
BLOCK_NUMBERS = 2**13

_U = np.uint64
_FACTORS = _U(0xD2E7470EE14C6C93), _U(0xCA5A826395121157)
_WEYL = _U(0x9E3779B97F4A7C15), _U(0xBB67AE8584CAA73B)
_LOW_HALF, _HALF = _U(0xFFFFFFFF), _U(32)
_RUN = 1024


def steps_per_block(count: int) -> int:
    """Steps in one noise block when each step needs ``count`` numbers: a power of two.

    A function of the count alone, never of batch, memory or recording: it is part of the address.
    """
    return 2 ** max(0, (BLOCK_NUMBERS // max(count, 1)).bit_length() - 1)


@dataclass(frozen=True)
class Noise:
    """Random numbers of one part for the members of one batch.

    Parameters
    ----------
    seed : int
        Seed of the run, 0 to 2**64 - 1.
    part : str
        The part that draws, a key of ``PARTS``.
    members : array of int, shape (members,)
        Absolute numbers of the members in this batch.

    Notes
    -----
    A member's block has the key (seed, part) and the counters (1, 2, ...; block, member, lane); step 0
    is the draw of the start. The lane is 256 × count plus 0 for normals, 1 for uniforms, 2 and more for
    gammas: numbers of another law, or laid out otherwise, are independent. The block in use is kept, which
    changes no number; the result is a view into it, valid until the next step is drawn.

    Examples
    --------
    >>> alone, batch = Noise(1, "shear", np.array([5])), Noise(1, "shear", np.arange(8))
    >>> bool(np.all(alone.normals(3, 4)[0] == batch.normals(3, 4)[5]))
    True
    """

    seed: int
    part: str
    members: np.ndarray
    _kept: dict = field(default_factory=dict, repr=False, compare=False)

    def address(self) -> tuple[int, np.ndarray]:
        """Seed and members, for compiled loops whose draws depend on a state: they address words by themselves."""
        return self.seed, self.members

    def normals(self, step: int, count: int) -> np.ndarray:
        """Standard normals of one step, shape (members, count)."""
        return self._numbers(_normals, step, count)

    def uniforms(self, step: int, count: int) -> np.ndarray:
        """Uniform numbers in [0, 1) of one step, shape (members, count)."""
        return self._numbers(_uniforms, step, count)

    def gammas(self, step: int, shapes: np.ndarray) -> np.ndarray:
        """Standard gamma numbers of given ``shapes`` >= 0.5, the same at all steps; shape (members, shapes)."""
        return self._numbers(_gammas, step, len(shapes), shapes)

    def _numbers(self, fill, step: int, count: int, *laws: np.ndarray) -> np.ndarray:
        steps = steps_per_block(count)
        block, row = divmod(step, steps)
        kept_block, numbers = self._kept.get((fill, count), (None, None))
        if kept_block != block:
            if numbers is None:
                numbers = np.empty((len(self.members), steps * count))
            address = _U(self.seed), _U(PARTS[self.part]), _U(block), self.members.astype(_U), _U(256 * count)
            fill(*address, *laws, numbers)
            self._kept[fill, count] = (block, numbers)
        return numbers[:, row * count : (row + 1) * count]


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
def _words(seed, part, block, member, lane, first, words):
    """Philox words of the counters after ``first`` of one block and lane, shape (4, counters)."""
    zero, one, two, three = words[0], words[1], words[2], words[3]
    for i in range(words.shape[1]):
        zero[i], one[i], two[i], three[i] = words_at(seed, part, first + _U(i) + _U(1), block, member, lane)


@device
def _unit(word):
    """A float in [1, 2) from the upper 52 bits of a word."""
    return _U((word >> _U(12)) | _U(0x3FF0000000000000)).view(np.float64)


@device
def logarithm(x):
    """ln x for normal x > 0, to one unit in the last place; the minimax polynomial of fdlibm's ``log``."""
    bits = np.float64(x).view(np.int64)
    exponent = (bits - np.int64(0x3FE6A09E00000000)) >> np.int64(52)
    f = np.int64(bits - (exponent << np.int64(52))).view(np.float64) - 1.0
    # the integer exponent as a float, by its bits
    k = np.int64((exponent + np.int64(1024)) | np.int64(0x4330000000000000)).view(np.float64) - 4503599627371520.0
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
def _cosine_and_sine(turn):
    """cos and sin of 2 pi ``turn`` for 0 <= turn < 1, each to a few units in the last place of 1."""
    shifted = 4.0 * turn + 6755399441055744.0  # rounds to quarters of a turn, which its bits then hold
    quarter = np.float64(shifted).view(np.int64)
    x = (turn - 0.25 * (shifted - 6755399441055744.0)) * (2.0 * math.pi)
    z = x * x
    s = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    s = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * s)
    s = x + x * z * (-1.66666666666666324348e-01 + z * s)
    c = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    c = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * c)
    c = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02 + z * c))
    odd = (quarter & np.int64(1)) != 0
    cosine, sine = (s if odd else c), (c if odd else s)
    cosine = -cosine if ((quarter + np.int64(1)) & np.int64(2)) != 0 else cosine
    sine = -sine if (quarter & np.int64(2)) != 0 else sine
    return cosine, sine


@device
def _box_muller(words_u, words_v, x, y):
    """Two standard normals from each two words; the largest is 8.5."""
    for i in range(words_u.size):
        radius = math.sqrt(-2.0 * logarithm(2.0 - _unit(words_u[i])))
        cosine, sine = _cosine_and_sine(_unit(words_v[i]) - 1.0)
        x[i] = radius * cosine
        y[i] = radius * sine


@kernel("void(uint64, uint64, uint64, uint64[::1], uint64, float64[:,::1])")
def _normals(seed, part, block, members, lane, numbers):
    """Fill rows of standard normals, shape (members, numbers of a block)."""
    count = numbers.shape[1]
    for m in range(members.size):
        for first in range(0, count, 4 * _RUN):
            run = min(_RUN, (count - first + 3) // 4)
            words, drawn = np.empty((4, run), np.uint64), np.empty((4, run))
            _words(seed, part, block, members[m], lane, _U(first // 4), words)
            _box_muller(words[0], words[1], drawn[0], drawn[1])
            _box_muller(words[2], words[3], drawn[2], drawn[3])
            some = min(4 * run, count - first)
            numbers[m, first : first + some] = drawn.ravel()[:some]


@kernel("void(uint64, uint64, uint64, uint64[::1], uint64, float64[:,::1])")
def _uniforms(seed, part, block, members, lane, numbers):
    """Fill rows of uniform numbers in [0, 1), shape (members, numbers of a block)."""
    count = numbers.shape[1]
    for m in range(members.size):
        for first in range(0, count, 4 * _RUN):
            run = min(_RUN, (count - first + 3) // 4)
            words = np.empty((4, run), np.uint64)
            _words(seed, part, block, members[m], lane + _U(1), _U(first // 4), words)
            flat = words.ravel()
            for i in range(min(4 * run, count - first)):
                numbers[m, first + i] = _unit(flat[i]) - 1.0


@device
def _gamma(d, c, x, word):
    """Marsaglia & Tsang's gamma number of shape d + 1/3 from a normal x and a word; -1 where they reject it.

    ``c`` is 1/(3 sqrt d). Without branches, so that the compiler can use vector instructions.
    """
    v = 1.0 + c * x
    v = v * v * v
    positive = v if v > 0.0 else 1.0
    bound = 0.5 * x * x + d * (1.0 - v + logarithm(positive))
    accepted = (logarithm(2.0 - _unit(word)) < bound) & (v > 0.0)
    return d * v if accepted else -1.0


@kernel("void(uint64, uint64, uint64, uint64[::1], uint64, float64[::1], float64[:,::1])")
def _gammas(seed, part, block, members, lane, shapes, numbers):
    """Fill rows of standard gamma numbers, shape (members, steps of a block × shapes).

    Number i takes the words of counter i + 1 in lane 2; while it is rejected, in lanes 3, 4, ... A
    shape a below 1 is that of a + 1 times u^(1/a).
    """
    count, kinds = numbers.shape[1], shapes.size
    words, x, y = np.empty((4, _RUN), np.uint64), np.empty(_RUN), np.empty(_RUN)
    law, d, c = np.empty(_RUN), np.empty(_RUN), np.empty(_RUN)
    again, z, rest = np.empty((4, 1), np.uint64), np.empty(1), np.empty(1)
    for m in range(members.size):
        kind = 0
        for first in range(0, count, _RUN):
            run = min(_RUN, count - first)
            _words(seed, part, block, members[m], lane + _U(2), _U(first), words)
            _box_muller(words[0], words[1], x, y)
            for i in range(run):
                law[i] = shapes[kind]
                kind = kind + 1 if kind + 1 < kinds else 0
            for i in range(run):
                d[i] = (law[i] if law[i] >= 1.0 else law[i] + 1.0) - 1.0 / 3.0
                c[i] = 1.0 / (3.0 * math.sqrt(d[i]))
                y[i] = _gamma(d[i], c[i], x[i], words[2, i])
            for i in range(run):
                other = lane + _U(2)
                while y[i] < 0.0:
                    other += _U(1)
                    _words(seed, part, block, members[m], other, _U(first + i), again)
                    _box_muller(again[0], again[1], z, rest)
                    y[i] = _gamma(d[i], c[i], z[0], again[2, 0])
                u = 2.0 - _unit(words[3, i])
                if law[i] == 0.5:
                    y[i] *= u * u
                elif law[i] < 1.0:
                    y[i] *= math.exp(logarithm(u) / law[i])
                numbers[m, first + i] = y[i]


@device
def exponential(word):
    """A standard exponential number from a word, 0 to 36.04."""
    return -logarithm(2.0 - _unit(word))


@device
def unit_at(word):
    """A uniform number in [0, 1) from a word."""
    return _unit(word) - 1.0


@device
def fill_words(seed, part, first, second, member, lane, count, words):
    """Two words of each of ``count`` counters (first[i], second[i], member, lane), shape (2, at least count)."""
    one, two = words[0], words[1]
    for i in range(count):
        one[i], two[i], _, _ = words_at(seed, part, first[i], second[i], member, lane)
