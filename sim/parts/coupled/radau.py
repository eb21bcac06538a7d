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

import numpy as np

from sim.numerics.jit import device, inlined
from sim.parts.coupled.row import (
    BODY,
    BOUND,
    COUNT,
    FEW,
    FORCE,
    MOMENT,
    PATH,
    POSITION,
    RADIUS,
    SHEARED,
    SLIP,
    SOME,
    SPEED,
    SQUARE,
    compliance,
    contact_area,
    driven,
    pull_on,
)
from sim.parts.drive import AREA, DAMPING, RUPTURE, VISCOSITY, WORK
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
#: Rows of the room for a sub-step, each with what stands at its three nodes: first the unknowns slip, u, N, M, then
#: their residuals, the unknowns of the last sub-step, contact radii, forces on a body that stays, areas, k_t; and
#: length and root of the error of the last sub-step.
RIGHT, PAST, RADII, PULLS, AREAS, FIRMS, LAST, ROOM = 4, 8, 12, 13, 14, 15, 16, 17


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


#: Share of a sub-step after which the defect of the equations is measured, between the first two nodes.
_BETWEEN = 0.4


def _between() -> tuple[Array, Array]:
    """Values and slopes of the polynomials through start and nodes at ``_BETWEEN``, that of the start last."""
    places = np.append(NODES, 0.0)
    values, slopes = np.empty(4), np.empty(4)
    for j in range(4):
        others = np.delete(places, j)
        lagrange = np.poly1d(others, r=True) / np.prod(places[j] - others)
        values[j], slopes[j] = lagrange(_BETWEEN), lagrange.deriv()(_BETWEEN)
    return values, slopes


_VALUES, _SLOPES = _between()
#: Most turns of Newton's method.
_TURNS = 12
#: Slopes, and solutions of the modes, before the first ones are known.
_UNKNOWN = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0)
_NO_MODES = (0.0,) * 11, (0.0j,) * 11
#: Correction over the last one above which the slopes are taken anew.
_SLOW = 0.1
#: Lagrange's denominators at the nodes, the polynomial through the start as well.
_BASE = np.array([1.0 / np.prod([c - d for d in (0.0, *NODES) if d != c]) for c in NODES])


@inlined
def _ahead(row, room, step, law):
    """Guess slip, u, N, M at the nodes: the last sub-step's polynomial, or the slopes at the start."""
    of_bound, of_moment, _, _, _, _ = kinetics(row[BOUND], row[MOMENT], row[SPEED], law)
    for i in range(3):
        if room[LAST, 0] > 0.0:
            x = 1.0 + NODES[i] * step / room[LAST, 0]
            first, second = x - NODES[0], x - NODES[1]
            one = x * second * (x - 1.0) * _BASE[0]
            two = x * first * (x - 1.0) * _BASE[1]
            last = x * first * second * _BASE[2] - 1.0
            for k in range(4):
                room[k, i] = one * room[PAST + k, 0] + two * room[PAST + k, 1] + last * room[PAST + k, 2]
        else:
            time = NODES[i] * step
            room[0, i], room[1, i], room[2, i], room[3, i] = row[SPEED] * time, 0.0, 0.0, 0.0
            if law[6] == 0.0:
                room[2, i] = of_bound[0] * time
                room[3, i] = of_moment[0] * time if law[5] == 0.0 else law[5] * room[2, i]
        room[2, i] = max(room[2, i], -0.5 * row[BOUND])


@device
def newton(row, start, step, bare, slider, law, held, piece, room):
    """Solve for slip, u, N, M at the nodes, by Newton's method with the middle one's slopes; whether that worked.

    It ends where the next correction would be small, at the pace of the last two.
    """
    _ahead(row, room, step, law)
    for i in range(3):
        room[RADII, i] = row[RADIUS]
        room[PULLS, i] = pull_on(start + NODES[i] * step, start, 0.0, row, slider, piece)
    bound = min(row[BOUND], row[BOUND] + room[2, 2]) + FEW
    moment = min(math.fabs(row[MOMENT]), math.fabs(row[MOMENT] + room[3, 2]))
    of_slip, of_bound, of_moment = 1.0 / (law[4] + math.fabs(room[0, 2])), 1.0 / bound, 1.0 / (law[4] * bound + moment)
    before, close = math.inf, min(1e-6, 0.1 * slider[7])
    slopes, shrinks = _UNKNOWN, 0.5
    modes = _NO_MODES
    for turn in range(_TURNS):
        latest = equations(row, room, start, step, bare, slider, law, held)
        if math.isnan(latest[0]):
            return False
        if shrinks > _SLOW:
            slopes = latest
            modes = resolved(slopes, step, slider, law)
        correct(modes, slopes, slider, room)
        part, change = 1.0, 0.0
        for i in range(3):
            bound = row[BOUND] + room[2, i]
            if bound - room[RIGHT + 2, i] < 0.1 * bound:  # N stays above zero
                part = min(part, 0.9 * bound / room[RIGHT + 2, i])
        for i in range(3):
            change = max(change, math.fabs(room[RIGHT, i]) * of_slip)
            change = max(change, math.fabs(room[RIGHT + 2, i]) * of_bound, math.fabs(room[RIGHT + 3, i]) * of_moment)
            for k in range(4):
                room[k, i] -= part * room[RIGHT + k, i]
        shrinks = change / before if turn > 0 else 0.5
        if change * min(1.0, shrinks / max(1.0 - shrinks, 1e-3)) <= close:
            return True
        if not (part > 0.0 and change < 1e12) or (turn > 2 and shrinks > 1.0):
            return False
        before = change
    return False


@inlined
def error_of(row, start, step, bare, slider, law, held, piece, room):
    """Defect of the equations between nodes, as an error of a stretch: of order 4 in the sub-step, over its scale.

    The polynomials through start and nodes solve the equations at the nodes alone. What is missing between them of the
    balance of forces, of N, of M and, with a mass, of the speed is taken over what resists it.
    """
    stiffness, mass, damping, viscosity, _, _, _, _ = slider
    slip, body, bound, moment = 0.0, 0.0, row[BOUND], row[MOMENT]
    speed, to_bound, to_moment, going = 0.0, 0.0, 0.0, 0.0
    pace, bend = _VALUES[3] * row[BODY], _SLOPES[3] * row[BODY] / step
    for j in range(3):
        at_node = 0.0
        for k in range(3):
            at_node += RATES[j, k] * (room[0, k] + room[1, k]) / step
        pace += _VALUES[j] * at_node
        bend += _SLOPES[j] * at_node / step
        slip += _VALUES[j] * room[0, j]
        body += _VALUES[j] * (room[0, j] + room[1, j])
        going += _SLOPES[j] * (room[0, j] + room[1, j]) / step
        speed += _SLOPES[j] * room[0, j] / step
        bound += _VALUES[j] * room[2, j]
        moment += _VALUES[j] * room[3, j]
        to_bound += _SLOPES[j] * room[2, j]
        to_moment += _SLOPES[j] * room[3, j]
    time = start + _BETWEEN * step
    radius, area, _, _ = contact_area(bound, moment, time, room[RADII, 0], bare, held)
    if not (area >= 0.0 and bound >= 0.0):
        return math.inf
    of_bound, of_moment, on, _, _, _ = kinetics(bound, moment, speed, law)
    pace = pace if mass > 0.0 else going
    balance = area * (moment + viscosity * speed) + damping * pace + mass * bend
    balance -= pull_on(time, start, body, row, slider, piece)
    bears = area * bound + (damping + area * viscosity) / step + mass / (step * step)
    scale = law[4] * (bound + FEW) + math.fabs(moment)
    if law[5] != 0.0:
        to_moment = step * of_moment[0]
    if law[6] != 0.0:
        to_bound = step * of_bound[0] + bound - share_left(speed, law)
    found = max(
        math.fabs(to_bound - step * of_bound[0]) / (1.0 + step * math.fabs(of_bound[1])) / (bound + FEW),
        math.fabs(to_moment - step * of_moment[0]) / (1.0 + step * math.fabs(on[0])) / scale,
    )
    # a mass between stiff springs rings within a small part of a stretch: as a force that is no small part
    yields, _ = compliance(radius, slider)
    stiffest = max(stiffness, 1.0 / yields if yields > 0.0 else 0.0)
    firm = max(1.0, stiffest / (area * (bound + SOME))) if mass > 0.0 and area > 0.0 else 1.0
    # an open contact bears nothing: then what is missing from the spring counts
    found = max(found, firm * math.fabs(balance) / (bears if bears > 0.0 else stiffness) / law[4])
    return max(found, firm * step * math.fabs(going - pace) / law[4]) if mass > 0.0 else found


@inlined
def tried(row, start, step, bare, slider, law, held, piece, room):
    """Solve for a sub-step: length of the next over that of this one, and whether this one stands.

    The error is measured to order 4 where the result is of order 5 or more, so that a power of it is held to the
    tolerance. It goes with the sixth power of the length; where it has grown since the last sub-step, the same growth
    is expected of the next (Gustafsson 1994).
    """
    if not newton(row, start, step, bare, slider, law, held, piece, room):
        return 0.25, False
    error = error_of(row, start, step, bare, slider, law, held, piece, room)
    error *= math.sqrt(error) / slider[7]
    if not error < math.inf:
        return 0.25, False
    root = max(error, 1e-6) ** (1.0 / 6.0)
    if not error <= 1.0:
        return max(0.1, 0.9 / root), False
    grows = 0.9 / root
    if room[LAST, 0] > 0.0:
        grows *= min(1.0, step / room[LAST, 0] * room[LAST, 1] / root)
    room[LAST, 1] = max(root, 0.5)
    return min(6.0, max(0.1, grows)), True


@inlined
def book(row, start, step, bare, slider, law, held, piece, room, energy):
    """Take an accepted sub-step: integrals of the powers by the method's own shares, and the row at its end."""
    _, _, damping, viscosity, forced, _, _, _ = slider
    way, speed, body = 0.0, 0.0, 0.0
    follows = held[0] == 0.0
    first, firm = math.pi * row[RADIUS] * row[RADIUS] / held[10], 0.0
    if follows:
        _, first, _, _ = contact_area(row[BOUND], row[MOMENT], start, row[RADIUS], bare, held)
        yields, _ = compliance(row[RADIUS], slider)
        firm = 1.0 / yields if yields > 0.0 else 0.0
    for i in range(3):
        room[AREAS, i] = first
        if follows:
            bound, moment = row[BOUND] + room[2, i], row[MOMENT] + room[3, i]
            time = start + NODES[i] * step
            room[RADII, i], room[AREAS, i], _, _ = contact_area(bound, moment, time, room[RADII, i], bare, held)
            yields, _ = compliance(room[RADII, i], slider)
            room[FIRMS, i] = 1.0 / yields if yields > 0.0 else 0.0
    for i in range(3):
        bound, moment, area = row[BOUND] + room[2, i], row[MOMENT] + room[3, i], room[AREAS, i]
        speed, body, spreads, firms = 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            speed += RATES[i, j] * room[0, j] / step
            body += RATES[i, j] * (room[0, j] + room[1, j]) / step
            if follows:
                spreads += RATES[i, j] * (room[AREAS, j] - first)
                firms += RATES[i, j] * (room[FIRMS, j] - firm)
        sheared, pull = row[SHEARED] + room[1, i], room[PULLS, i] - slider[0] * (room[0, i] + room[1, i])
        given = body if forced > 0.0 else driven(start + NODES[i] * step, piece)[1]
        _, _, _, _, k, travel = kinetics(bound, moment, speed, law)
        square = moment * moment / bound if bound > 0.0 and law[5] == 0.0 else 0.0
        fresh = law[3] * (1.0 - bound) * square / bound if bound > 0.0 else 0.0
        share = SHARES[i] * step
        energy[WORK] += share * pull * given
        energy[DAMPING] += share * damping * body * body
        energy[VISCOSITY] += share * area * viscosity * speed * speed
        energy[RUPTURE] += share * 0.5 * area * (square * (k + 3.0 * travel) + fresh)
        if law[5] != 0.0:
            energy[RUPTURE] += share * area * moment * speed
        energy[AREA] -= SHARES[i] * 0.5 * (square * spreads + sheared * sheared * firms)
        row[SQUARE] += share * speed * speed
        row[PATH] += math.fabs(room[0, i] - way)
        way = room[0, i]
    row[FORCE], row[BODY], row[SPEED] = room[PULLS, 2] - slider[0] * (room[0, 2] + room[1, 2]), body, speed
    row[RADIUS] = room[RADII, 2]
    row[SHEARED] += room[1, 2]
    row[BOUND] = min(row[BOUND] + room[2, 2], 1.0)
    row[MOMENT] += room[3, 2]
    row[POSITION] += room[0, 2] + room[1, 2]
    row[SLIP] += room[0, 2]
    row[COUNT] += 1.0
    for k in range(4):
        for i in range(3):
            room[PAST + k, i] = room[k, i]
    room[LAST, 0] = step
