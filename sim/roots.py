"""Compiled elementary functions that the compiler can turn into vector instructions."""

import math

import numpy as np

from sim.jit import device

_LOW = np.uint64(0xFFFFFFFF00000000)
_THIRD = np.uint64(0x55555556)  # of 2**32
_OFFSET = np.uint64(715094163 << 32)
_HALF_WORD = np.uint64(32)


@device
def cube_root(x):
    """Cube root of x >= 0, right to one unit in the last place; nan below zero.

    A third of the exponent is a first guess good to 6 %; two of Halley's steps and one of Newton's
    finish it. Without branches or calls it runs several times faster over arrays than the library's.
    """
    small = x < 1e-280
    large = x > 1e280
    scaled = x * 2.0**300 if small else x
    scaled = x * 2.0**-300 if large else scaled
    exponent = np.uint64(np.float64(scaled).view(np.int64)) >> _HALF_WORD
    root = np.uint64(((exponent * _THIRD) & _LOW) + _OFFSET).view(np.float64)
    for _ in range(2):
        cube = root * root * root
        root = root * ((cube + 2.0 * scaled) / (2.0 * cube + scaled))
    root -= (root * root * root - scaled) / (3.0 * root * root)
    root = root * 2.0**-100 if small else root
    root = root * 2.0**100 if large else root
    special = x == 0.0 or x == math.inf
    root = x if special else root
    return root if x >= 0.0 else math.nan
