"""Equations of slider and bonds at the nodes of Radau IIA, order 5, with positions as the unknowns.

In units of a stretch b, of the force n κ b A0 that all sites bear at it over a reference area A0, and of the time
as it is, body X (mass m, damping c) and interface X_s = X − u obey

    m Ẍ = S − c Ẋ − F,   F = A (M + η Ẋ_s),   u = F/k_t,   Ṡ = K (V − Ẋ) or S = Q(t),
    Ṅ = k_on (1 − N) − N (k + |Ẋ_s|/l),   Ṁ = N Ẋ_s − M (k + 2|Ẋ_s|/l),   k = k0 exp(|M/N|),

where bonds without a stretch have M = ±N instead, with the sense of the sliding, and N = 1/(1 + |Ẋ_s|/V_c) if they
follow the speed at once. The area A is that of the equilibrium contact with the work of adhesion that these bonds
leave. Slip, u, N and M at the three nodes are the unknowns, found by Newton's method; speeds and accelerations follow
from the positions by the method itself. So the equations are solved as they stand, whether mass, damping, viscosity
and 1/k_t are zero (then they are of index 2) or not, and a stiff spring costs no steps.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, inlined
from sim.parts.exchange import Array

_S6 = math.sqrt(6.0)
NODES = np.array([(4.0 - _S6) / 10.0, (4.0 + _S6) / 10.0, 1.0])
SHARES = np.array([(16.0 - _S6) / 36.0, (16.0 + _S6) / 36.0, 1.0 / 9.0])
#: Derivatives of what vanishes at the start, over the step, from the values at the nodes; and of those again.
RATES = np.array(
    [
        [2.0 + _S6 / 2.0, -1.2 + 29.0 * _S6 / 30.0, 0.4 - 4.0 * _S6 / 15.0],
        [-1.2 - 29.0 * _S6 / 30.0, 2.0 - _S6 / 2.0, 0.4 + 4.0 * _S6 / 15.0],
        [-1.0 + 8.0 * _S6 / 3.0, -1.0 - 8.0 * _S6 / 3.0, 5.0],
    ]
)
BENDS = np.array([[sum(row[k] * RATES[k, j] for k in range(3)) for j in range(3)] for row in RATES])
_OFF = np.array([sum(row) for row in RATES])


def _modes() -> tuple[float, complex, Array, Array]:
    """Eigenvalues of ``RATES``, one real and one of the complex pair; matrices that lead back to nodes and from them.

    The last two columns are the real part and minus the imaginary part of the vector of the complex one. In closed form
    (Hairer & Wanner 1996, IV.8), as numbers of a linear-algebra library depend on the machine.
    """
    root = 3.0 ** (1.0 / 3.0)
    real = 3.0 + root * root - root
    pair = 3.0 + 0.5 * (root - root * root) + 0.5j * math.sqrt(3.0) * (root + root * root)
    turning = _mode(pair)
    forth = np.array([[one.real for one in _mode(real)], [x.real for x in turning], [-x.imag for x in turning]])
    a, b, c = forth.tolist()
    back = np.array([_cross(b, c), _cross(c, a), _cross(a, b)])
    return real, pair, np.ascontiguousarray(forth.T), back / sum(x * y for x, y in zip(a, _cross(b, c), strict=True))


def _mode(value: complex) -> list[complex]:
    """The vector that ``RATES`` multiplies by a value."""
    (a, b, c), (d, e, f), _ = RATES.tolist()
    a, e = a - value, e - value
    return [(b * f - c * e) / (a * e - b * d), (c * d - a * f) / (a * e - b * d), 1.0]


def _cross(a: list[float], b: list[float]) -> list[float]:
    """Cross product of two vectors."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


PACE, TURNING, FORTH, BACK = _modes()
#: Columns of a row: spring force S, speed of the body, u, N, M, speed of the interface, displacement of the body,
#: slip and path of the clock step, contact radius, next sub-step, number of sub-steps, time of a runaway, integral of
#: the squared speed of the interface over the clock step, acceleration of the interface.
FORCE, BODY, SHEARED, BOUND, MOMENT, SPEED, POSITION, SLIP, PATH, RADIUS, NEXT, COUNT, ENDED, SQUARE, BEND = range(15)
COLUMNS = 15
#: Rows of the room for a sub-step, each with what stands at its three nodes: first the unknowns slip, u, N, M, then
#: their residuals, the unknowns of the last sub-step, contact radii, forces on a body that stays, areas, k_t; and
#: length and root of the error of the last sub-step.
RIGHT, PAST, RADII, PULLS, AREAS, FIRMS, LAST, ROOM = 4, 8, 12, 13, 14, 15, 16, 17


class Slider(NamedTuple):
    """Numbers of a drive: K, m, c, η, whether it prescribes the force, 1/k_t as constant + slope/a, tolerance."""

    stiffness: float
    mass: float
    damping: float
    viscosity: float
    forced: float
    yielding: float
    yielding_radius: float
    tolerance: float


class Law(NamedTuple):
    """Numbers of the bonds: k0, its growth with the stretch (1 or 0), 1/cut-off stretch, k_on, scale of a stretch.

    Bonds without a stretch have the ``sense`` of the sliding, 1 or -1, else 0; those that follow the speed at once a
    share 1/(1 + ``slows`` speed).
    """

    rate: float
    softness: float
    cuts: float
    binding: float
    scale: float
    sense: float = 0.0
    slows: float = 0.0


class Resting(NamedTuple):
    """Numbers of the contact during a step: whether its radius stays; work of adhesion per bond share N.

    ``taken``: energy that the mean stress takes over radius and M²; load, base and their rates; the stiffness
    behind the base; curvature, modulus, reference area.
    """

    stays: float
    bonded: float
    taken: float
    load: float
    load_rate: float
    base: float
    base_rate: float
    stiffness: float
    curvature: float
    modulus: float
    area: float


@device
def _missing(a, load, base, stiffness, curvature, modulus):
    """Depth of a contact of Hertz of this radius beyond what holds the sphere, and its slope over the radius."""
    hertz = a * a * curvature
    if stiffness == math.inf:
        return hertz - base, 2.0 * a * curvature
    series = stiffness + 2.0 * modulus * a
    missing = (stiffness * (hertz - base) + 4.0 / 3.0 * modulus * a * hertz - load) / series
    return missing, (2.0 * stiffness * a * curvature + 4.0 * modulus * hertz - 2.0 * modulus * missing) / series


@device
def contact_area(bound, moment, time, radius, bare, held):
    """Contact radius in equilibrium with these bonds, area over the reference's, its slopes over N and M.

    Newton's method on the energy release rate, convex in the radius, from the last one: from the right of the root
    it goes left. nan where there is none; Hertz's radius where adhesion does not pay for the mean stress there.
    """
    stays, bonded, taken, load, load_rate, base, base_rate, stiffness, curvature, modulus, unit = held
    if stays > 0.0:
        return radius, math.pi * radius * radius / unit, 0.0, 0.0
    work, tilt = bare + bonded * bound, taken * moment * moment
    load, base = load + load_rate * time, base + base_rate * time
    a, slope = radius, 1.0
    if work > 0.0 and tilt > 0.0 and load + base > 0.0:  # the edge can pull, not push
        for _ in range(60):
            missing, growth = _missing(a, load, base, stiffness, curvature, modulus)
            a -= min(missing / growth, 0.5 * a)
            if math.fabs(missing) <= 1e-14 * growth * a:
                break
        if not work - tilt * a > 0.0:
            return a, math.pi * a * a / unit, 0.0, 0.0
        a = max(a, radius)
    for _ in range(60):
        missing, growth = _missing(a, load, base, stiffness, curvature, modulus)
        if work > 0.0:
            over = 0.5 / math.pi * modulus * missing * missing / a - work + tilt * a
            slope = 0.5 / math.pi * modulus * missing / a * (2.0 * growth - missing / a) + tilt
            if missing < 0.0:
                over, slope = missing, growth
        else:
            over, slope = missing, growth
        if not slope > 0.0:
            return math.nan, math.nan, 0.0, 0.0
        change = min(over / slope, 0.5 * a)
        a -= change
        if math.fabs(change) <= 1e-14 * a:
            break
    if work <= 0.0:
        return a, math.pi * a * a / unit, 0.0, 0.0
    growth = 2.0 * math.pi * a / unit / slope
    return a, math.pi * a * a / unit, growth * bonded, -2.0 * growth * taken * moment * a


@device
def compliance(radius, slider):
    """1/k_t of the contact and its slope over the radius; 0 for an open one."""
    if slider[6] == 0.0 or not radius > 0.0:
        return slider[5], 0.0
    return slider[5] + slider[6] / radius, -slider[6] / (radius * radius)


@device
def kinetics(bound, moment, speed, law):
    """Ṅ and its slopes over N and M; Ṁ and its slope over N; that over M, and over the speed; Ṅ's; k, \\|speed\\|/l."""
    rate, softness, cuts, binding, _, sense, _ = law
    stretch = moment / bound if bound > 0.0 else 0.0
    k = rate * math.exp(min(softness * math.fabs(stretch), 690.0))
    steeper = math.copysign(k * softness, stretch)
    travel, turn = math.fabs(speed) * cuts, math.copysign(cuts, speed)
    if sense != 0.0:  # smoothly through a speed of zero, where the sliding ends
        travel, turn = sense * speed * cuts, sense * cuts
    to_bound = binding * (1.0 - bound) - (k + travel) * bound, -binding - k - travel + steeper * stretch, -steeper
    to_moment = bound * speed - (k + 2.0 * travel) * moment, speed + steeper * stretch * stretch
    moment_turn = -(k + 2.0 * travel) - steeper * stretch, bound - 2.0 * turn * moment
    return to_bound, to_moment, moment_turn, -turn * bound, k, travel


@device
def share_left(speed, law):
    """Bonds over those of rest of bonds without a stretch, continued smoothly through a speed of zero."""
    return 1.0 / (1.0 + law[6] * law[5] * speed)


@device
def rested(bound, time, law):
    """Bonds over those of rest after some time at rest: all of them, if they follow the speed at once."""
    return 1.0 if law[6] != 0.0 else bound - (1.0 - bound) * math.expm1(-law[3] * time)


@device
def driven(time, piece):
    """A prescribed value's integral from the start of its piece, and the value: a cubic through both ends."""
    length, first, last, integral = piece
    share = time / length
    cubic = (first + last) * length - 2.0 * integral
    square = integral - first * length - cubic
    value = first + (2.0 * square + 3.0 * cubic * share) * share / length
    return first * time + (square + cubic * share) * share * share, value


@device
def pull_on(time, start, way, row, slider, piece):
    """Spring force when the body has gone ``way`` since the ``start`` of a sub-step, or the force prescribed."""
    if slider[4] > 0.0:
        return driven(time, piece)[1]
    return row[0] + slider[0] * (driven(time, piece)[0] - driven(start, piece)[0] - way)


@device
def _sum(weights, i, values, k):
    """A row of weights times what stands at the three nodes of one unknown."""
    return weights[i, 0] * values[k, 0] + weights[i, 1] * values[k, 1] + weights[i, 2] * values[k, 2]


@inlined
def equations(row, room, start, step, bare, slider, law, held):
    """Residuals at the three nodes for slip, u, N, M there, and their slopes at the middle one.

    The slopes are those of the balance of forces over N, M and the speed, of u over the same, of Ṅ and of Ṁ; nan where
    there is no equilibrium.
    """
    stiffness, mass, damping, viscosity, _, _, _, _ = slider
    over, gives = 1.0 / step, slider[5] + slider[6] > 0.0
    radius, area, by_bound, by_moment = row[RADIUS], 0.0, 0.0, 0.0
    if held[0] > 0.0:
        area = math.pi * radius * radius / held[10]
    of_balance, of_u = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    of_bonds = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        bound, moment = row[BOUND] + room[2, i], row[MOMENT] + room[3, i]
        if held[0] == 0.0:
            now = start + NODES[i] * step
            radius, area, by_bound, by_moment = contact_area(bound, moment, now, room[RADII, i], bare, held)
            room[RADII, i] = radius
        if not (bound >= 0.0 and area >= 0.0):
            return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        speed = _sum(RATES, i, room, 0) * over
        body = speed + _sum(RATES, i, room, 1) * over if gives else speed
        stress = moment + viscosity * speed
        yields, softer = compliance(radius, slider)
        room[RIGHT, i] = area * stress + damping * body - room[PULLS, i] + stiffness * (room[0, i] + room[1, i])
        if mass > 0.0:
            bend = (_sum(BENDS, i, room, 0) + _sum(BENDS, i, room, 1)) * over - _OFF[i] * row[BODY]
            room[RIGHT, i] += mass * bend * over
        room[RIGHT + 1, i] = row[SHEARED] + room[1, i] - yields * area * stress
        of_bound, of_moment, on, turn, _, _ = kinetics(bound, moment, speed, law)
        room[RIGHT + 2, i] = _sum(RATES, i, room, 2) * over - of_bound[0]
        room[RIGHT + 3, i] = _sum(RATES, i, room, 3) * over - of_moment[0]
        if i == 1:
            of_bonds = of_bound[1], of_bound[2], turn, of_moment[1], on[0], on[1]
        if law[5] != 0.0:
            room[RIGHT + 3, i] = moment - law[5] * bound
            if i == 1:
                of_bonds = of_bound[1], 0.0, turn, law[5], -1.0, 0.0
        if law[6] != 0.0:
            left = share_left(speed, law)
            room[RIGHT + 2, i] = bound - left
            if i == 1:
                of_bonds = -1.0, 0.0, -law[6] * law[5] * left * left, law[5], -1.0, 0.0
        if i == 1:
            of_balance = by_bound * stress, area + by_moment * stress, area * viscosity
            if yields > 0.0:
                softer *= held[10] / (2.0 * math.pi * radius) * area * stress
                of_u = (
                    -yields * of_balance[0] - softer * by_bound,
                    -yields * of_balance[1] - softer * by_moment,
                    -yields * of_balance[2],
                )
    return of_balance + of_u + of_bonds


@device
def _over(number):
    """1/number, of a complex one with a single division."""
    return number.conjugate() * (1.0 / (number.real * number.real + number.imag * number.imag))


@device
def _resolved(rate, slopes, slider, law):
    """How slip, u, N, M take away residuals of a mode of the method, in which a derivative is a ``rate``.

    N and M over their residuals, and over the slip; u over the slip; the slip over all residuals.
    """
    to_bound, to_moment, thick, u_bound, u_moment, u_speed = slopes[:6]
    n_bound, n_moment, n_speed, m_bound, m_moment, m_speed = slopes[6:]
    n = (rate if law[6] == 0.0 else 0.0 * rate) - n_bound
    m = (rate if law[5] == 0.0 else 0.0 * rate) - m_moment
    scale = _over(n * m - n_moment * m_bound)
    nn, nm, mn, mm = m * scale, n_moment * scale, m_bound * scale, n * scale
    n_slip, m_slip = rate * (nn * n_speed + nm * m_speed), rate * (mn * n_speed + mm * m_speed)
    u_slip = -(u_speed * rate + u_bound * n_slip + u_moment * m_slip)
    firm = slider[0] + rate * (slider[2] + rate * slider[1])
    yields = _over(firm * (1.0 + u_slip) + rate * thick + to_bound * n_slip + to_moment * m_slip)
    by_n, by_m = firm * u_bound - to_bound, firm * u_moment - to_moment
    slip = yields, -firm * yields, (by_n * nn + by_m * mn) * yields, (by_n * nm + by_m * mm) * yields
    return (nn, nm, mn, mm, n_slip, m_slip, u_slip) + slip


@inlined
def resolved(slopes, step, slider, law):
    """Solutions of the method's modes, one real and two complex, with the same slopes at all nodes.

    So they are on their own (Hairer & Wanner II, IV.8).
    """
    turning = complex(TURNING.real / step, TURNING.imag / step)
    return _resolved(PACE / step, slopes, slider, law), _resolved(turning, slopes, slider, law)


@device
def _taken(mode, slopes, balance, yielding, bonds, stretches):
    """Slip, u, N and M that take residuals of a mode away."""
    nn, nm, mn, mm, n_slip, m_slip, u_slip, by_balance, by_u, by_n, by_m = mode
    bound, moment = nn * bonds + nm * stretches, mn * bonds + mm * stretches
    slip = by_balance * balance + by_u * yielding + by_n * bonds + by_m * stretches
    sheared = yielding - slopes[3] * bound - slopes[4] * moment + u_slip * slip
    return slip, sheared, bound + n_slip * slip, moment + m_slip * slip


@inlined
def correct(modes, slopes, slider, room):
    """Replace residuals at the nodes by what takes them away."""
    b, u, n, m = RIGHT, RIGHT + 1, RIGHT + 2, RIGHT + 3
    gives = slider[5] + slider[6] > 0.0
    real = _sum(BACK, 0, room, b), _sum(BACK, 0, room, u) if gives else 0.0, _sum(BACK, 0, room, n)
    one = _taken(modes[0], slopes, real[0], real[1], real[2], _sum(BACK, 0, room, m))
    turned = _turned(room, u) if gives else complex(0.0, 0.0)
    two = _taken(modes[1], slopes, _turned(room, b), turned, _turned(room, n), _turned(room, m))
    for i in range(3):
        first, second, third = FORTH[i, 0], FORTH[i, 1], FORTH[i, 2]
        for k in range(4):
            room[RIGHT + k, i] = first * one[k] + second * two[k].real + third * two[k].imag


@device
def _turned(room, k):
    """Part of an unknown's residuals in the complex modes."""
    return complex(_sum(BACK, 1, room, k), _sum(BACK, 2, room, k))
