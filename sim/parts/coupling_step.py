"""Slider and bonds together through one clock step, in sub-steps that each row chooses for itself.

The equations stand in ``coupling_equations``, rows of sub-steps in ``coupling_rows``. A sub-step's error is what the
equations lack between their nodes.
"""

import math

import numpy as np

from sim.numerics.jit import device, inlined
from sim.parts.coupling_equations import (
    AREAS,
    BODY,
    BOUND,
    COUNT,
    FIRMS,
    FORCE,
    LAST,
    MOMENT,
    NODES,
    PAST,
    PATH,
    POSITION,
    PULLS,
    RADII,
    RADIUS,
    RATES,
    RIGHT,
    SHARES,
    SHEARED,
    SLIP,
    SPEED,
    SQUARE,
    compliance,
    contact_area,
    correct,
    driven,
    equations,
    kinetics,
    pull_on,
    resolved,
    share_left,
)
from sim.parts.drive.driven import AREA, DAMPING, RUPTURE, VISCOSITY, WORK
from sim.parts.exchange import Array

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
#: Shares of sites bound below which their relative error is no matter, and below which forces are those of so many.
FEW, _SOME = 1e-12, 0.1
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
    firm = max(1.0, stiffest / (area * (bound + _SOME))) if mass > 0.0 and area > 0.0 else 1.0
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
