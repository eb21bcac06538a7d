"""Slider and bonds together through one clock step, in sub-steps that each row chooses for itself.

The equations stand in ``coupling_equations``, rows of sub-steps in ``coupling_rows``. A sub-step's error is what the
equations lack between their nodes.
"""

import math

import numpy as np

from sim.numerics.jit import device
from sim.parts.coupling_equations import (
    BODY,
    BOUND,
    COUNT,
    FORCE,
    MOMENT,
    NODES,
    PATH,
    POSITION,
    RADIUS,
    RATES,
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
_FEW, _SOME = 1e-12, 0.1
#: Most turns of Newton's method.
_TURNS = 12
#: Lagrange's denominators at the nodes, the polynomial through the start as well.
_BASE = np.array([1.0 / np.prod([c - d for d in (0.0, *NODES) if d != c]) for c in NODES])


@device
def _ahead(row, z, past, gone, step, law):
    """Guess slip, u, N, M at the nodes: the last sub-step's polynomial, ``gone`` long, or the slopes at the start."""
    of_bound, of_moment, _, _, _, _ = kinetics(row[BOUND], row[MOMENT], row[SPEED], law)
    for i in range(3):
        if gone > 0.0:
            x = 1.0 + NODES[i] * step / gone
            first, second = x - NODES[0], x - NODES[1]
            one = x * second * (x - 1.0) * _BASE[0]
            two = x * first * (x - 1.0) * _BASE[1]
            last = x * first * second * _BASE[2] - 1.0
            for k in range(4):
                z[k, i] = one * past[k, 0] + two * past[k, 1] + last * past[k, 2]
        else:
            time = NODES[i] * step
            z[0, i], z[1, i], z[2, i], z[3, i] = row[SPEED] * time, 0.0, of_bound[0] * time, of_moment[0] * time
            if law[5] != 0.0:
                z[2, i], z[3, i] = 0.0, 0.0
        z[2, i] = max(z[2, i], -0.5 * row[BOUND])


@device
def newton(row, start, step, bare, slider, law, held, piece, room):
    """Solve for slip, u, N, M at the nodes, by Newton's method with a mean of the slopes; whether that worked."""
    z, right, radii, past, gone = room
    _ahead(row, z, past, gone[0], step, law)
    radii[:] = row[RADIUS]
    before, close = math.inf, min(1e-7, 0.01 * slider[7])
    for turn in range(_TURNS):
        slopes = equations(row, z, start, step, bare, slider, law, held, piece, right, radii)
        if math.isnan(slopes[0]):
            return False
        correct(slopes, step, slider, law, right)
        part, change = 1.0, 0.0
        for i in range(3):
            bound = row[BOUND] + z[2, i]
            if bound - right[2, i] < 0.1 * bound:  # N stays above zero
                part = min(part, 0.9 * bound / right[2, i])
        for i in range(3):
            bound, moment = row[BOUND] + z[2, i] + _FEW, row[MOMENT] + z[3, i]
            change = max(change, math.fabs(right[0, i]) / (law[4] + math.fabs(z[0, i])))
            change = max(change, math.fabs(right[2, i]) / bound)
            change = max(change, math.fabs(right[3, i]) / (law[4] * bound + math.fabs(moment)))
            for k in range(4):
                z[k, i] -= part * right[k, i]
        shrinks = change / before if turn > 0 else 0.5
        if change * min(1.0, shrinks / max(1.0 - shrinks, 1e-3)) <= close:
            return True
        if not (part > 0.0 and change < 1e12) or (turn > 2 and shrinks > 1.0):
            return False
        before = change
    return False


@device
def error_of(row, start, step, bare, slider, law, held, piece, room):
    """Defect of the equations between nodes, as an error of a stretch: of order 4 in the sub-step, over its scale.

    The polynomials through start and nodes solve the equations at the nodes alone. What is missing between them of the
    balance of forces, of N, of M and, with a mass, of the speed is taken over what resists it.
    """
    stiffness, mass, damping, viscosity, _, _, _, _ = slider
    z, _, radii, _, _ = room
    slip, body, bound, moment = 0.0, 0.0, row[BOUND], row[MOMENT]
    speed, to_bound, to_moment, going = 0.0, 0.0, 0.0, 0.0
    pace, bend = _VALUES[3] * row[BODY], _SLOPES[3] * row[BODY] / step
    for j in range(3):
        at_node = 0.0
        for k in range(3):
            at_node += RATES[j, k] * (z[0, k] + z[1, k]) / step
        pace += _VALUES[j] * at_node
        bend += _SLOPES[j] * at_node / step
        slip += _VALUES[j] * z[0, j]
        body += _VALUES[j] * (z[0, j] + z[1, j])
        going += _SLOPES[j] * (z[0, j] + z[1, j]) / step
        speed += _SLOPES[j] * z[0, j] / step
        bound += _VALUES[j] * z[2, j]
        moment += _VALUES[j] * z[3, j]
        to_bound += _SLOPES[j] * z[2, j]
        to_moment += _SLOPES[j] * z[3, j]
    time = start + _BETWEEN * step
    radius, area, _, _ = contact_area(bound, moment, time, radii[0], bare, held)
    if not (area >= 0.0 and bound >= 0.0):
        return math.inf
    of_bound, of_moment, on, _, _, _ = kinetics(bound, moment, speed, law)
    pace = pace if mass > 0.0 else going
    balance = area * (moment + viscosity * speed) + damping * pace + mass * bend
    balance -= pull_on(time, start, body, row, slider, piece)
    bears = area * bound + (damping + area * viscosity) / step + mass / (step * step)
    scale = law[4] * (bound + _FEW) + math.fabs(moment)
    if law[5] != 0.0:
        to_bound, to_moment = step * of_bound[0] + bound - share_left(speed, law), step * of_moment[0]
    found = max(
        math.fabs(to_bound - step * of_bound[0]) / (1.0 + step * math.fabs(of_bound[1])) / (bound + _FEW),
        math.fabs(to_moment - step * of_moment[0]) / (1.0 + step * math.fabs(on[0])) / scale,
    )
    # a mass between stiff springs rings within a small part of a stretch: as a force that is no small part
    yields, _ = compliance(radius, slider)
    stiffest = max(stiffness, 1.0 / yields if yields > 0.0 else 0.0)
    firm = max(1.0, stiffest / (area * (bound + _SOME))) if mass > 0.0 and area > 0.0 else 1.0
    # an open contact bears nothing: then what is missing from the spring counts
    found = max(found, firm * math.fabs(balance) / (bears if bears > 0.0 else stiffness) / law[4])
    return max(found, firm * step * math.fabs(going - pace) / law[4]) if mass > 0.0 else found


@device
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
    grows, last = 0.9 * max(error, 1e-6) ** (-1.0 / 6.0), room[4]
    if not error <= 1.0:
        return max(0.1, grows), False
    if last[0] > 0.0:
        grows *= min(1.0, step / last[0] * (last[1] / max(error, 1e-6)) ** (1.0 / 6.0))
    last[1] = max(error, 1e-2)
    return min(6.0, max(0.1, grows)), True


@device
def book(row, start, step, bare, slider, law, held, piece, room, at_nodes, energy):
    """Take an accepted sub-step: integrals of the powers by the method's own shares, and the row at its end."""
    _, _, damping, viscosity, forced, _, _, _ = slider
    z, _, radii, past, gone = room
    way, speed, body = 0.0, 0.0, 0.0
    for i in range(3):
        bound, moment = row[BOUND] + z[2, i], row[MOMENT] + z[3, i]
        radius, area, _, _ = contact_area(bound, moment, start + NODES[i] * step, radii[i], bare, held)
        yields, _ = compliance(radius, slider)
        at_nodes[0, i], at_nodes[1, i], at_nodes[2, i] = area, 1.0 / yields if yields > 0.0 else 0.0, radius
    _, first, _, _ = contact_area(row[BOUND], row[MOMENT], start, row[RADIUS], bare, held)
    yields, _ = compliance(row[RADIUS], slider)
    firm = 1.0 / yields if yields > 0.0 else 0.0
    for i in range(3):
        bound, moment, area = row[BOUND] + z[2, i], row[MOMENT] + z[3, i], at_nodes[0, i]
        speed, body, spreads, firms = 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            speed += RATES[i, j] * z[0, j] / step
            body += RATES[i, j] * (z[0, j] + z[1, j]) / step
            spreads += RATES[i, j] * (at_nodes[0, j] - first)
            firms += RATES[i, j] * (at_nodes[1, j] - firm)
        time, sheared = start + NODES[i] * step, row[SHEARED] + z[1, i]
        pull = pull_on(time, start, z[0, i] + z[1, i], row, slider, piece)
        _, _, _, _, k, travel = kinetics(bound, moment, speed, law)
        square = moment * moment / bound if bound > 0.0 and law[5] == 0.0 else 0.0
        fresh = law[3] * (1.0 - bound) * square / bound if bound > 0.0 else 0.0
        share = SHARES[i] * step
        energy[WORK] += share * pull * (body if forced > 0.0 else driven(time, piece)[1])
        energy[DAMPING] += share * damping * body * body
        energy[VISCOSITY] += share * area * viscosity * speed * speed
        energy[RUPTURE] += share * 0.5 * area * (square * (k + 3.0 * travel) + fresh)
        if law[5] != 0.0:
            energy[RUPTURE] += share * area * moment * speed
        energy[AREA] -= SHARES[i] * 0.5 * (square * spreads + sheared * sheared * firms)
        row[SQUARE] += share * speed * speed
        row[PATH] += math.fabs(z[0, i] - way)
        way = z[0, i]
    pull = pull_on(start + step, start, z[0, 2] + z[1, 2], row, slider, piece)
    row[FORCE], row[BODY], row[SPEED], row[RADIUS] = pull, body, speed, at_nodes[2, 2]
    row[SHEARED] += z[1, 2]
    row[BOUND] = min(row[BOUND] + z[2, 2], 1.0)
    row[MOMENT] += z[3, 2]
    row[POSITION] += z[0, 2] + z[1, 2]
    row[SLIP] += z[0, 2]
    row[COUNT] += 1.0
    past[:], gone[0] = z, step
