"""Number and mean stretch of a bond population in time, where every bond has the mean stretch.

With the share N of the sites that is bound, M = N × (mean stretch), a rebinding rate k_on, a rupture
rate k and a sliding speed V that is constant over a step,

    ``dN/dt = k_on (1 - N) - N k(|x|)``,    ``dM/dt = N V - M k(|x|)``,    ``x = M/N``

since new bonds are unstretched, every bond moves with the slider, and bonds that break take their stretch along. This
is exact if k does not depend on the stretch. If it does, this is a mean field, because the bonds of a population
differ. With Bell's rate it overpredicts the friction maximum by 27 to 47 %, for any time step.

A cut-off stretch l makes every bond break after the slip l. Its rates in this closure are ``V/l`` for N and twice as
large for M, because bonds of all stretches up to l are equally frequent. Bonds that break have the stretch l, twice the
mean. The stress of steady sliding is then that of the renewal of such bonds by k_on: κ (l/2) N with N = 1/(1 + V/(l
k_on)). A loss of the mean with every break would give κ l times N instead. As the speed goes to zero, the stress does
not vanish but keeps the sign of the speed. This is the Coulomb friction of bonds that break only by sliding.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.numerics.special import lambert_w
from sim.parts.bonds.rupture import RuptureRate
from sim.parts.exchange import Array

#: Largest error of N and of M that a sub-step under Bell's rate may make, by its embedded lower order, over N and M.
#: The fifth-order result is better; errors of sub-steps fade with the bonds that carry them.
LOCAL_ERROR = 1e-9

#: Most sub-steps, tries included, of one step; one that needs more gives nan. Jumps of speed over twenty decades
#: take less than a thousand.
MOST_STEPS = 10_000

# stretch in units of Bell's below which the rate is taken as constant: an error of N and M no larger
_SMALL = 1e-10
_NONE = 1e-290  # share below which no site is bound


def advance(
    bound, moment, slip, path, duration, rupture: RuptureRate, rebinding_rate
) -> tuple[Array, Array]:
    """Return the population after each of many steps of constant speed.

    Parameters
    ----------
    bound, moment : array, shape (1,) or (rows,)
        Share N of the sites that is bound [1], and N times the mean stretch of a bond, M [m].
    slip, path : array, shape (steps, 1) or (steps, rows)
        Displacement, signed, and distance slid over each step [m].
    duration : array, shape (steps,)
        Length of each step [s]; may be 0.
    rupture : RuptureRate
        Rupture rate of a bond; a softness and a finite limit together have no first-moment form here.
    rebinding_rate : float
        k_on [1/s], at least 0.

    Returns
    -------
    bound, moment : array, shape (steps, 1) or (steps, rows)
        N in [0, 1] and M at the end of each step; nan where more than ``MOST_STEPS`` sub-steps would be
        needed, as for mean stretches some 700 times Bell's.

    Notes
    -----
    Without softness a step of any length T is exact (see ``_linear``). Under Bell's rate it is
    made of steps of the Rosenbrock method Rodas5P (Steinebach, BIT 63, 27 (2023)): fifth order, L-stable, with
    the exact Jacobian, controlled to ``LOCAL_ERROR``. A steady state is a fixed point of it for any T.
    A step that would cross M = 0, where k has a kink, first goes there.

    Examples
    --------
    Under Bell's rate, a contact pulled at a hundred times the speed at which bonds begin to yield resists
    far more at first than later: static friction.

    >>> bell = RuptureRate(rate=1.0, softness=1.0, limit=np.inf)
    >>> slip, duration = np.full((300, 1), 0.2), np.full(300, 0.002)
    >>> _, force = advance(*steady(0.0, bell, 10.0), slip, slip, duration, bell, 10.0)
    >>> print(f"{force.max():.2f} {force[-1, 0]:.2f} {steady(100.0, bell, 10.0)[1][0]:.2f}")
    2.40 0.86 0.86
    """
    rows = max(bound.size, moment.size, slip.shape[1], path.shape[1])
    after = np.empty((2, len(duration), rows))
    law = rupture.rate, rupture.softness, rupture.limit, rebinding_rate
    _advance((bound, moment), (slip, path, duration), law, *after)
    return after[0], after[1]


def steady(speed, rupture: RuptureRate, rebinding_rate) -> tuple[Array, Array]:
    """Return the population of steady sliding.

    Parameters
    ----------
    speed : float or array
        V [m/s], either sign; 0 is a long rest.
    rupture, rebinding_rate
        As in ``advance``.

    Returns
    -------
    bound, moment : array, at least of shape (1,)
        N [1] and M [m]. Zero without rebinding. M is zero at rest, although bonds that only sliding breaks
        would keep any stretch.

    Notes
    -----
    ``N = k_on/(k_on + k)``, ``M = N V/k``. Under Bell's rate of softness s, ``k = k0 exp(W(eps))`` with
    ``eps = s V/k0`` and Lambert's W, the mean stretch being W/s; M is largest, W(k_on/(e k0))/s, at
    eps = (1 + W) exp(1 + W), W = W(k_on/(e k0)). With a cut-off k + V/l takes the place of k in N and k + 2V/l in M.

    Examples
    --------
    Friction has a maximum over speed, here at eps = 4.59:

    >>> bell = RuptureRate(rate=1.0, softness=1.0, limit=np.inf)
    >>> print(np.round(steady(np.array([0.1, 4.59, 1000.0]), bell, 1.0)[1], 4))
    [0.0436 0.2785 0.0274]
    """
    speed = np.array(speed, dtype=float, ndmin=1)
    pace = np.abs(speed)
    rate = rupture.rate
    if rupture.softness > 0.0 and rate > 0.0:
        rate = rate * np.exp(lambert_w(rupture.softness * pace / rate))
    travel = pace / rupture.limit
    bound = _ratio(rebinding_rate, rebinding_rate + rate + travel)
    return bound, bound * _ratio(speed, rate + 2.0 * travel)


def _ratio(part, whole):
    """Return part/whole, or 0 if the whole is 0."""
    return np.divide(part, whole, out=np.zeros(whole.shape), where=whole > 0.0)


@device
def mean_decay(x):
    """Return (1 - exp(-x))/x for x >= 0; 1 at zero."""
    return -math.expm1(-x) / x if x > 0.0 else 1.0


@device
def _second(x):
    """Return (exp(x) - 1 - x)/x² for -inf < x <= 1/2; 1/2 at zero."""
    if math.fabs(x) > 0.5:
        return (math.expm1(x) - x) / (x * x)
    total = 1.0
    for k in range(15, 2, -1):
        total = 1.0 + total * x / k
    return 0.5 * total


@device
def _young(low, gap, high):
    """Return ∫∫ over 0 < s < t < 1 of exp(-p s - q (1-t)) for {p, q} = {low, high}, gap = high - low >= 0.

    It is the divided difference of exp at 0, -p and -q; a sum of two positive terms.
    """
    if high == 0.0:
        return 0.5
    fade = math.exp(-low)
    first = (
        fade * low * _second(low)
        if low <= 0.5
        else (-math.expm1(-low) - low * fade) / low
    )
    return (first + fade * gap * _second(-gap)) / high


@device
def _linear(bound, moment, slip, binding, breaking, travel):
    """Return N and M after an exact step of the linear equations.

    ``binding``, ``breaking`` and ``travel`` are the numbers of events in a step: k_on T, k T and path/l.

    Notes
    -----
    With p = (k_on + k) T + path/l for N and q = k T + 2 path/l for M,

        ``N(T) = N e^-p + k_on T (1 - e^-p)/p``
        ``M(T) = M e^-q + slip (N e[-p,-q] + k_on T e[0,-p,-q])``

    in divided differences of the exponential, ``e[-p,-q] = (e^-p - e^-q)/(q - p)`` and
    ``e[0,-p,-q] = ((1 - e^-p)/p - (1 - e^-q)/q)/(q - p)``, in forms without cancellation.
    """
    p, q = binding + breaking + travel, breaking + 2.0 * travel
    low, high, gap = min(p, q), max(p, q), math.fabs(travel - binding)
    old = math.exp(-low) * mean_decay(gap)
    after = bound * math.exp(-p) + binding * mean_decay(p)
    return min(after, 1.0), moment * math.exp(-q) + slip * (
        bound * old + binding * _young(low, gap, high)
    )


def _lower(*rows: list[float]) -> Array:
    """Return the rows of a strictly lower triangle, filled up with zeros."""
    return np.array([row + [0.0] * (7 - len(row)) for row in rows])


# Rodas5P in the form without products of Jacobian and vector (Hairer & Wanner II, IV.7): row i is stage i
_GAMMA = 0.21193756319429014
_LAST = [
    -7.502846399306121,
    2.561846144803919,
    -11.627539656261098,
    -0.18268767659942256,
    0.030198172008377946,
]
_STATE = _lower(
    [],
    [3.0],
    [2.849394379747939, 0.45842242204463923],
    [-6.954028509809101, 2.489845061869568, -10.358996098473584],
    [2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641],
    _LAST,
    [*_LAST, 1.0],
    [*_LAST, 1.0, 1.0],
)
_SLOPE = _lower(
    [],
    [-14.155112264123755],
    [-17.97296035885952, -2.859693295451294],
    [147.12150275711716, -1.41221402718213, 71.68940251302358],
    [165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306],
    [
        24.854864614690072,
        -3.0009227002832186,
        47.4931110020768,
        5.5814197821558125,
        -0.6610691825249471,
    ],
    [30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783]
    + [-19.097331116725623, -28.087943162872662],
    [37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047]
    + [-40.06618937091002, -54.66780262877968, -9.48861652309627],
)


@device
def _rosenbrock(bound, moment, step, speed, rate, binding, work):
    """Return bound, moment and the larger of their relative errors after one step of Rodas5P.

    The rate is k = rate exp(moment/bound), moments are in units of Bell's stretch. The last stage adds the
    difference from the embedded fourth order, which is the error. A stage without bonds has an infinite error.
    """
    stretch = moment / bound
    k = rate * math.exp(stretch)
    diagonal = 1.0 / (_GAMMA * step)
    a, b = diagonal + binding + k - stretch * k, k
    c, d = -speed - stretch * stretch * k, diagonal + k + stretch * k
    scale = 1.0 / (a * d - b * c)
    n, m = bound, moment
    for i in range(8):
        n, m, fn, fm = bound, moment, 0.0, 0.0
        for j in range(i):
            n += _STATE[i, j] * work[j, 0]
            m += _STATE[i, j] * work[j, 1]
            fn += _SLOPE[i, j] * work[j, 0]
            fm += _SLOPE[i, j] * work[j, 1]
        if not n > 0.0:
            return bound, moment, math.inf
        k = rate * math.exp(m / n)
        fn = fn / step + binding * (1.0 - n) - n * k
        fm = fm / step + n * speed - m * k
        work[i, 0] = (d * fn - b * fm) * scale
        work[i, 1] = (a * fm - c * fn) * scale
    n, m = n + work[7, 0], m + work[7, 1]
    error = max(
        math.fabs(work[7, 0]) / max(bound, n),
        math.fabs(work[7, 1]) / max(moment, math.fabs(m)),
    )
    return n, m, error if n > 0.0 else math.inf


@device
def regula_falsi(bracket, place, value):
    """Return a bracket of a zero with another place in it, at which the value is known.

    A bracket is a place and a value above zero, a place and a value below, and the sign of the last value. The value of
    an end that stays a second time counts half (Illinois).
    """
    near, above, far, below, side = bracket
    if value > 0.0:
        return place, value, far, below * (0.5 if side > 0 else 1.0), 1
    return near, above * (0.5 if side < 0 else 1.0), place, value, -1


@device
def _to_zero(bound, moment, step, below, speed, rate, binding, work):
    """Return the part of ``step`` after which a moment above zero has come to zero, and bound then.

    After the whole step the moment is ``below`` zero.
    """
    bracket, part, after = (0.0, moment, step, below, 0), step, bound
    for _ in range(60):
        near, above, far, below, _ = bracket
        part = near + (far - near) * (above / (above - below))
        after, rest, _ = _rosenbrock(bound, moment, part, speed, rate, binding, work)
        if math.fabs(rest) <= 1e-13 * moment:
            break
        bracket = regula_falsi(bracket, part, rest)
    return part, after


@device
def _first_step(bound, moment, speed, rate, binding):
    """Return a fifth of the time in which bound, or the exponent of the rate, would change by one."""
    stretch = moment / bound
    gain, loss = binding * (1.0 - bound) / bound, rate * math.exp(stretch)
    return 0.2 / (math.fabs(gain - loss) + math.fabs(speed - stretch * gain))


@device
def _slow(speed, rate):
    """Return Bell's rate at the steady stretch of a speed that is zero or much smaller than ``rate``."""
    pace = math.fabs(speed)
    return rate * math.exp(pace / (rate + pace)) if pace > 0.0 else rate


@device
def _bell(bound, moment, speed, rate, binding, work):
    """Return bound and moment after a whole step under Bell's rate.

    The stretch is in units of Bell's and the time in units of the step. Sub-steps take the moment as positive and stop
    if it becomes zero. The error of a sub-step sets the length of the next, between a tenth and six times its own.
    """
    left, step, sign = 1.0, 0.0, 1.0
    if not math.isfinite(bound + moment + speed):
        return math.nan, math.nan
    for _ in range(MOST_STEPS):
        if bound <= _NONE:
            bound, moment, step = 0.0, 0.0, 0.0
        if sign * moment < 0.0 or (moment == 0.0 and sign * speed < 0.0):
            sign = -sign
        size, pull = sign * moment, sign * speed
        if size <= _SMALL * bound and math.fabs(pull) <= _SMALL * rate:
            return _linear(
                bound,
                moment,
                speed * left,
                binding * left,
                _slow(pull, rate) * left,
                0.0,
            )
        if bound == 0.0:
            # the first bonds are hardly stretched yet: the rate grows by rate × pull × time
            part = min(left, 0.1 * math.sqrt(LOCAL_ERROR / (rate * pull)), 1.0 / pull)
            bound, moment = _linear(
                bound, moment, speed * part, binding * part, rate * part, 0.0
            )
            left -= part
        else:
            step = (
                _first_step(bound, size, pull, rate, binding) if step == 0.0 else step
            )
            part = min(step, left)
            after, rest, error = _rosenbrock(
                bound, size, part, pull, rate, binding, work
            )
            error = error / LOCAL_ERROR if rest >= 0.0 or pull < 0.0 else math.inf
            step = (
                part * min(6.0, max(0.1, 0.9 * error**-0.2))
                if error >= 0.0
                else 0.1 * part
            )
            if error <= 1.0:
                if rest < 0.0:
                    part, after = _to_zero(
                        bound, size, part, rest, pull, rate, binding, work
                    )
                    rest = 0.0
                bound, moment, left = min(after, 1.0), sign * rest, left - part
        if left <= 0.0 or (bound == 0.0 and binding == 0.0):
            return bound, moment
    return math.nan, math.nan


@kernel(
    "void(UniTuple(f8[::1], 2), Tuple((f8[:,:], f8[:,:], f8[:])), UniTuple(f8, 4), f8[:,::1], f8[:,::1])"
)
def _advance(before, sliding, law, bound_after, moment_after):
    """Write N and M after all steps of every row, each row by itself."""
    (bound, moment), (slip, path, duration) = before, sliding
    rate, softness, limit, rebinding = law
    work = np.empty((8, 2))
    for i in range(bound_after.shape[1]):
        share, stretch = bound[i % bound.size], moment[i % moment.size]
        for k in range(duration.size):
            move, breaking, binding = (
                slip[k, i % slip.shape[1]],
                rate * duration[k],
                rebinding * duration[k],
            )
            stiff = (
                softness * math.fabs(stretch) <= _SMALL * share
                and softness * math.fabs(move) <= _SMALL * breaking
            )
            if stiff or softness == 0.0 or breaking == 0.0:
                events, travel = (
                    _slow(softness * move, breaking),
                    path[k, i % path.shape[1]] / limit,
                )
                share, stretch = _linear(share, stretch, move, binding, events, travel)
            else:
                share, rest = _bell(
                    share, softness * stretch, softness * move, breaking, binding, work
                )
                stretch = rest / softness
            bound_after[k, i], moment_after[k, i] = share, stretch
