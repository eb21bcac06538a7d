"""Special functions of the laws: exponential integrals and Lambert's W for Bell's rupture law, the cube root.

The generalised exponential integral of order j is

    ``E(z) = 1/j! int_1^inf (ln u)^j/u e^(-z u) du``

(Milgram, Math. Comp. 44, 443 (1985)); order 0 is the ordinary E1. It decays like e^-z and grows like a power of ln z at
small z. The product with ``e^z z^(j + 1)`` increases from 0 at z = 0 to 1 at z = infinity without overflow. It is
computed for any z, and the rest follows from it.
"""

import math

import numpy as np

from sim.numerics.jit import bits_of, device, float_of, law

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)
#: The integrand is dropped where its exponential has fallen to e^-44: 1e-16 of the integral at order 2.
_SPAN = 44.0
#: Below this the series, which loses a factor 1/E to cancellation (10 at order 2); above it quadrature.
_SWITCH = 0.5
_EULER = 0.57721566490153286061
_ZETA2, _ZETA3 = 1.64493406684822643647, 1.20205690315959428540
#: Of a cube root's first guess: upper half of a word, a third of 2^32, what the exponent's bias leaves.
_HIGH_HALF, _HALF = np.uint64(0xFFFFFFFF00000000), np.uint64(32)
_THIRD, _OFFSET = np.uint64(0x55555556), np.uint64(715094163 << 32)


@device
def _series(z, order):
    """E(z) of small z: the residues of its Mellin transform Gamma(s)/s^(j + 1) at s = 0, -1, -2, ..."""
    log = -math.log(z) - _EULER
    if order == 0:
        total = log
    elif order == 1:
        total = 0.5 * (log * log + _ZETA2)
    else:
        total = log * (log * log / 6.0 + 0.5 * _ZETA2) - _ZETA3 / 3.0
    power = 1.0
    for n in range(1, 20):
        power *= -z / n
        total += power / (-n) ** (order + 1)
    return total


@device
def reduced(z, order):
    """``e^z z^(j + 1)`` times the exponential integral of order j = 0, 1, 2: from 0 at z = 0 to 1 at z = infinity.

    Notes
    -----
    With u = e^(x/z) it is the mean of ``x^j/j! exp(x - z (e^(x/z) - 1))`` over exponential x: an entire
    positive integrand, so that 64 Gauss-Legendre nodes give it to rounding from z = 1/2 up.
    """
    if z < _SWITCH:
        if z <= 0.0:
            return 0.0 if z == 0.0 else math.nan
        return z ** (order + 1) * math.exp(z) * _series(z, order)
    if z > 1e17:
        return 1.0  # 1/z is below rounding
    half = 0.5 * z * math.log1p(_SPAN / z)
    total = 0.0
    for i in range(_NODES.size):
        x = half * (1.0 + _NODES[i])
        total += _WEIGHTS[i] * x**order * math.exp(-z * math.expm1(x / z))
    return half * total / (2.0 if order == 2 else 1.0)


@device
def lambert(x):
    """The solution W >= 0 of ``W e^W = x`` for x >= 0; relative accuracy of rounding."""
    if not x > 0.0 or x == math.inf:
        return x if x >= 0.0 else math.nan
    root = math.log1p(x)
    root *= 1.0 - math.log1p(root) / (2.0 + root)
    # the guess is within 2 %; each round squares the error (Iacono & Boyd 2017)
    for _ in range(4):
        root *= (1.0 + math.log(x / root)) / (1.0 + root)
    return root


@device
def si(x):
    """``∫ sin(t)/t dt`` from 0 to x >= 0, to rounding: its series, beyond 3 the continued fraction of E1(ix)."""
    if x < 3.0:
        term = total = x
        for k in range(1, 16):
            term *= -x * x / (2 * k * (2 * k + 1))
            total += term / (2 * k + 1)
        return total
    # in real numbers, of which numba makes code many times sooner than of complex ones
    under = 1.0 / (1.0 + x * x)
    inverse_real, inverse_imag = under, -x * under
    real, imag = inverse_real, inverse_imag
    over_real = over_imag = 0.0
    # Lentz's method: the product of the ratios of numerators and denominators
    for k in range(1, 200):
        below, square = 2.0 * k + 1.0, float(k * k)
        lower_real, lower_imag = (
            below - square * inverse_real,
            x - square * inverse_imag,
        )
        upper_real, upper_imag = below - square * over_real, x - square * over_imag
        under = 1.0 / (lower_real * lower_real + lower_imag * lower_imag)
        inverse_real, inverse_imag = lower_real * under, -lower_imag * under
        under = 1.0 / (upper_real * upper_real + upper_imag * upper_imag)
        over_real, over_imag = upper_real * under, -upper_imag * under
        change = upper_real * inverse_real - upper_imag * inverse_imag
        turn = upper_real * inverse_imag + upper_imag * inverse_real
        real, imag = real * change - imag * turn, real * turn + imag * change
        if abs(change - 1.0) + abs(turn) < 3e-16:
            break
    return 0.5 * math.pi + imag * math.cos(x) - real * math.sin(x)


@device
def exp(x):
    """e^x to one unit in the last place, for loops that become vector instructions; 0 below x = -708.

    The rational form of fdlibm's ``exp`` in exactly rounded operations: the same bits on any machine.
    """
    inside = min(max(x, -708.0), 709.0)
    # a whole number in the last bits
    shifted = inside * 1.44269504088896338700 + 6755399441055744.0
    whole = shifted - 6755399441055744.0
    high, low = (
        inside - whole * 6.93147180369123816490e-01,
        whole * 1.90821492927058770002e-10,
    )
    r = high - low
    t = r * r
    odd = 6.61375632143793436117e-05 + t * (
        -1.65339022054652515390e-06 + t * 4.13813679705723846039e-08
    )
    c = r - t * (
        1.66666666666666019037e-01 + t * (-2.77777777770155933842e-03 + t * odd)
    )
    near = 1.0 - ((low - r * c / (2.0 - c)) - high)
    value = float_of(bits_of(near) + (bits_of(shifted) << np.int64(52)))
    value = math.inf if x > 709.0 else value
    return 0.0 if x < -708.0 else value


@device
def mean_growth(x):
    """Return (e^x − 1)/x, the mean of e^y from zero to x; 1 at zero."""
    return math.expm1(x) / x if x != 0.0 else 1.0


@device
def rough_cube_root(x):
    """Cube root of a normal x > 0 to 2e-4: a third of the exponent, good to 6 %, and one of Halley's steps."""
    exponent = np.uint64(bits_of(x)) >> _HALF
    root = float_of(((exponent * _THIRD) & _HIGH_HALF) + _OFFSET)
    cube = root * root * root
    return root * ((cube + 2.0 * x) / (2.0 * cube + x))


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
    root = rough_cube_root(scaled)
    cube = root * root * root
    root = root * ((cube + 2.0 * scaled) / (2.0 * cube + scaled))
    root -= (root * root * root - scaled) / (3.0 * root * root)
    root = root * 2.0**-100 if small else root
    root = root * 2.0**100 if large else root
    root = x if x == 0.0 or x == math.inf else root
    return root if x >= 0.0 else math.nan


@law
def reduced_exponential_integral(z, order):
    """Exponential integral times ``e^z z^(j + 1)``: from 0 at z = 0 to 1 at z = infinity.

    Parameters
    ----------
    z : float or array
        Argument [1], at least 0; infinity is allowed.
    order : float or array
        j = 0, 1 or 2: power of the logarithm.

    Returns
    -------
    float or array
        ``z^(j + 1) e^z/j! int_1^inf (ln u)^j/u e^(-z u) du`` [1]: ``1 - (j + 1)(j + 2)/(2 z)`` at large z;
        nan for other orders and negative z.

    Examples
    --------
    The life of a Bell bond in units of its life at rest, at z = inf, 100, 1, 0.01:

    >>> print("%.4f %.4f %.4f %.4f" % tuple(reduced_exponential_integral([float("inf"), 100.0, 1.0, 0.01], 0)))
    1.0000 0.9902 0.5963 0.0408
    """
    if order != 0.0 and order != 1.0 and order != 2.0:
        return math.nan
    return reduced(z, int(order))


@law
def scaled_exponential_integral(z, order):
    """Exponential integral times e^z, without overflow or underflow.

    Parameters
    ----------
    z : float or array
        Argument [1], at least 0; infinity is allowed.
    order : float or array
        j = 0, 1 or 2: power of the logarithm.

    Returns
    -------
    float or array
        ``e^z/j! int_1^inf (ln u)^j/u e^(-z u) du`` [1]: infinite at z = 0, 0 at infinity; order 0 is
        ``e^z E1(z)``; nan for other orders and negative z.

    Examples
    --------
    >>> print("%.6f %.6f" % tuple(scaled_exponential_integral([1.0, 1e6], 0) * [1.0, 1e6]))
    0.596347 0.999999
    """
    if order != 0.0 and order != 1.0 and order != 2.0:
        return math.nan
    if z > _SWITCH:
        return reduced(z, int(order)) / z ** (order + 1.0)
    if z > 0.0:
        return math.exp(z) * _series(z, int(order))
    return math.inf if z == 0.0 else math.nan


@law
def lambert_w(x):
    """Lambert's W: the solution of ``W e^W = x`` [1].

    Parameters
    ----------
    x : float or array
        At least 0 [1]; infinity is allowed. Below 0 the answer is nan.

    Examples
    --------
    >>> print(f"{lambert_w(1.0):.6f}")
    0.567143
    """
    return lambert(x)


@law
def erf_between(low, high):
    """``erf(high) - erf(low)``, without cancellation in either tail.

    Parameters
    ----------
    low, high : float or array
        Ends [1]; they broadcast.

    Returns
    -------
    float or array
        [1]; of 0 and infinity 1.

    Examples
    --------
    >>> erf_between(0.0, math.inf).item()
    1.0
    """
    if low > 0.0:
        low, high = -high, -low
    return (
        math.erfc(-high) - math.erfc(-low)
        if high < 0.0
        else math.erf(high) - math.erf(low)
    )


@law
def sine_integral(x):
    """``Si(x)``, the integral of ``sin(t)/t`` from 0 to x.

    Parameters
    ----------
    x : float or array
        Upper end [1], at least 0.

    Returns
    -------
    float or array
        [1]; 0 at 0, π/2 at infinity.

    Examples
    --------
    >>> print(f"{sine_integral(math.pi):.12f}")
    1.851937051982
    """
    return si(x)
