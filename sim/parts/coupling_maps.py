"""Slider and bonds whose stretches are resolved through one sub-step, over exact maps of the bonds.

In a sub-step h the slider goes straight to a node at γ h and straight on to one at h, γ = 2 − √2 (TR-BDF2): speeds and
accelerations at the nodes follow from the positions by the trapezoidal rule and by the second backward difference,
and one scalar equation a node, the balance of forces, gives the slip. So the scheme is L-stable and the same for mass,
damping, viscosity and 1/k_t of zero and of any size. What bonds survive on a straight way is exact; that the true way
bends is taken into their mean stretch on it, with the curvature of the sub-step before, whose change is the error.
"""

import math

import numpy as np

from sim.numerics.jit import device
from sim.parts.bonds.cohorts import carry, steepen, try_step
from sim.parts.bonds.rupture import hazard_integral, hazard_time, rate_at
from sim.parts.coupling_equations import (
    BEND,
    BODY,
    BOUND,
    COUNT,
    FORCE,
    MOMENT,
    PATH,
    POSITION,
    RADIUS,
    SHEARED,
    SLIP,
    SPEED,
    SQUARE,
    compliance,
    contact_area,
    driven,
    pull_on,
)  # fmt: skip
from sim.parts.drive.driven import AREA, DAMPING, RUPTURE, VISCOSITY, WORK

GAMMA = 2.0 - math.sqrt(2.0)
_MIDDLE = 1.0 / (6.0 * GAMMA * (1.0 - GAMMA))
#: Places of start and nodes in a sub-step, and their shares in the integral of the parabola through all three.
PLACES = (0.0, GAMMA, 1.0)
PARTS = (0.5 + (GAMMA - 1.0) * _MIDDLE, _MIDDLE, 0.5 - GAMMA * _MIDDLE)
#: Columns of a node: slip and displacement of the body since the start of the sub-step, area, shear displacement,
#: radius, share bound, sum of the stretches, of their squares and of those times the rupture rate, share cut since
#: the node before, speed of a body with mass.
AT_WAY, AT_BODY, AT_AREA, AT_SHEARED, AT_RADIUS, AT_BOUND, AT_MOMENT, AT_SQUARE, AT_LOST, AT_CUT, AT_SPEED = range(11)
#: Turns of the secant method; share of the slope of a fresh elastic bond below which a sub-step is too long.
_TURNS, _FALLING = 25, 0.02
#: The same where slip alone breaks bonds: their force may hardly rise.
_FLAT = 1e-7
#: Shares of sites bound below which their forces are those of so many; largest mean bend of a way [stretch].
SOME, _MOST_BENT = 0.1, 0.2
#: Births in a sub-step over the tolerance of the bonds below which its length is no matter to them.
_FEW_BIRTHS = 0.1


@device
def slopes(first, middle, last, step):
    """Slopes at start and nodes of the parabola through values there."""
    early, late = (middle - first) / (GAMMA * step), (last - middle) / ((1.0 - GAMMA) * step)
    bend = late - early
    return early - GAMMA * bend, early + GAMMA * bend, late + (1.0 - GAMMA) * bend


@device
def sums_at(pool, count, unit, rules, node):
    """Sums over the bonds at a node, stretches over their ``unit``."""
    bound, moment, square, lost, rates = 0.0, 0.0, 0.0, 0.0, pool[8]
    for i in range(count):
        rates[i] = rate_at(pool[1, i], rules.law)
    for i in range(count):
        w, x, d = pool[0, i], pool[1, i], pool[2, i]
        squared = w * (x * x + d * d / 12.0)
        bound += w
        moment += w * x
        square += squared
        lost += squared * rates[i]
    node[AT_BOUND], node[AT_MOMENT] = bound, moment / unit
    node[AT_SQUARE], node[AT_LOST] = square / (unit * unit), lost / (unit * unit)


@device
def _tried(pool, count, way, duration, off, free, rules):
    """Bonds after a motion tried: their share, the sum of their stretches, births early and late, factor of the step.

    Below 1 the factor refuses the step, as births are not good to the tolerance of the bonds.
    """
    one, two, factor = try_step(pool, count, way, way / duration, duration, off, free, rules)
    limit, far = rules.limit, 2.0 / 3.0 * way - 4.0 / 3.0 * off
    bound, moment = one + two, one * far
    if limit < math.inf:
        for i in range(count):
            low = max(pool[1, i] + way - 0.5 * pool[2, i], -limit)
            high = min(pool[1, i] + way + 0.5 * pool[2, i], limit)
            bound += pool[4, i]
            moment += pool[4, i] * 0.5 * (low + high)
        return bound, moment, one, two, factor
    for i in range(count):
        bound += pool[4, i]
        moment += pool[4, i] * (pool[1, i] + way)
    return bound, moment, one, two, factor


@device
def _cut(pool, count, way, duration, rules):
    """Share of the sites whose bonds reach the limit of their stretch on a way."""
    cut = 0.0
    for i in range(count):
        most = math.fabs(pool[1, i] + way) + 0.5 * pool[2, i]
        if most > rules.limit:
            cut += pool[0, i] * math.exp(-hazard_integral(pool[1, i], way, duration, rules.law)) - pool[4, i]
    return max(cut, 0.0)


@device
def start_of(row, node, yields, slider):
    """Speeds of interface and body, and the force on the mass, at the start of a sub-step, by the balance of forces."""
    _, mass, damping, viscosity, _, _, _, _ = slider
    speed, body, thick = row[SPEED], row[BODY], node[AT_AREA] * viscosity
    bears = node[AT_AREA] * node[AT_MOMENT]
    if thick > 0.0 and yields > 0.0:
        speed = (row[SHEARED] / yields - bears) / thick
    elif yields == 0.0 and mass == 0.0 and damping + thick > 0.0:
        speed = body = (row[FORCE] - bears) / (damping + thick)
    elif yields == 0.0:
        speed = body = row[BODY] if mass > 0.0 else row[SPEED]
    force = bears + thick * speed
    if mass == 0.0 and damping > 0.0 and yields > 0.0:
        body = (row[FORCE] - force) / damping
    return speed, body, row[FORCE] - damping * body - force if mass > 0.0 else 0.0


@device
def before_node(place, nodes, at_start, start, step, row, slider):
    """Numbers of the way to a node: its duration and end, the rate of speeds, what they lack of it, a first guess."""
    mass, (speed, body_speed, force_on_mass) = slider[1], at_start
    duration = (GAMMA if place == 1 else 1.0 - GAMMA) * step
    time, rate, share = start + PLACES[place] * step, 2.0 / (GAMMA * step), 1.0 / (GAMMA * (1.0 - GAMMA) * step)
    if place == 1:
        heavy = mass * rate * body_speed + force_on_mass
        way = duration * (speed + 0.5 * row[BEND] * duration)
        return duration, time, rate, speed, body_speed, heavy, way
    before = nodes[1]
    heavy = mass * (rate * body_speed + share * (before[AT_SPEED] - body_speed))
    way = duration * (before[AT_WAY] / (GAMMA * step) + 0.5 * row[BEND] * step)
    return duration, time, rate, share * before[AT_WAY], share * before[AT_BODY], heavy, way


@device
def balance(way, bound, moment, before, after, numbers, start, row, bare, slider, held, piece):
    """Force in excess at a node with these bonds, its slope if they stay, how small a slip is none; nan without any.

    What belongs to the slip is written to the node.
    """
    stiffness, mass, damping, viscosity, _, _, _, tolerance = slider
    _, time, rate, gone, body_gone, heavy, _ = numbers
    radius, area, _, by_moment = contact_area(bound, moment, time, row[RADIUS], bare, held)
    if not area >= 0.0:
        return math.nan, math.nan, math.nan
    yields, _ = compliance(radius, slider)
    slip = before[AT_WAY] + way
    stress = moment + viscosity * (rate * slip - gone)
    force = area * stress
    body = slip + yields * force - row[SHEARED]
    pull = pull_on(time, start, body, row, slider, piece)
    over = force + (damping + mass * rate) * (rate * body - body_gone) - heavy - pull
    grows, loads = (
        area * (bound + viscosity * rate) + by_moment * stress * bound,
        stiffness + rate * (damping + mass * rate),
    )
    after[AT_WAY], after[AT_BODY], after[AT_AREA], after[AT_RADIUS] = slip, body, area, radius
    after[AT_SHEARED] = yields * force
    if mass > 0.0:  # by its momentum: differences of positions are roundings in the shortest sub-steps
        after[AT_SPEED] = (heavy + pull - force) / (damping + mass * rate)
    firm = max(stiffness, 1.0 / yields if yields > 0.0 else 0.0) / (area * (bound + SOME)) if area > 0.0 else 1.0
    none, slope = 1e-3 * tolerance / max(1.0, firm), grows + loads * (1.0 + yields * grows)
    if mass + damping > 0.0:  # what is left of the forces is work on the body, whose way may be the longer
        none = min(none, 1e-3 * tolerance * (math.fabs(force) + math.fabs(pull)) / slope)
    roundings = math.fabs(slip) + yields * math.fabs(force) + math.fabs(row[SHEARED])
    return over, slope, max(none, 1e-15 * roundings)


@device
def go_to_node(place, nodes, at_start, pool, count, start, step, row, bare, slider, held, piece, unit, rules):
    """Find the slip to a node and take the bonds there; their number, and the factor of the step for births.

    A number below zero where there is no balance of forces or its slope is not that of a short sub-step.
    """
    numbers = before_node(place, nodes, at_start, start, step, row, slider)
    duration, way = numbers[0], numbers[6]
    before, after = nodes[place - 1], nodes[place]
    bent = -row[BEND] * duration * duration / 12.0
    off = unit * min(max(bent, -_MOST_BENT), _MOST_BENT)
    free, ahead = max(0.0, 1.0 - before[AT_BOUND]), way >= 0.0
    steepen(pool, count, way, off, rules)
    last_way, last_over, slope = 0.0, 0.0, 0.0
    for turn in range(_TURNS):
        if (way >= 0.0) != ahead:
            ahead = way >= 0.0
            steepen(pool, count, way, off, rules)
        bound, moment, one, two, factor = _tried(pool, count, unit * way, duration, off, free, rules)
        over, elasticity, none = balance(
            way, bound, moment / unit, before, after, numbers, start, row, bare, slider, held, piece
        )
        if turn == 0:
            slope = elasticity
        elif math.fabs(way - last_way) > 1e-9 * (1.0 + math.fabs(way)):
            slope = (over - last_over) / (way - last_way)
        if not slope > (_FALLING if rules.limit == math.inf else _FLAT) * elasticity:
            return -1, 0.0
        if math.fabs(over / slope) <= none:
            after[AT_CUT] = _cut(pool, count, unit * way, duration, rules) if rules.limit < math.inf else 0.0
            count = carry(pool, count, unit * way, off, one, two, rules)
            sums_at(pool, count, unit, rules, after)
            return count, factor
        last_way, last_over = way, over
        way -= over / slope
    return -1, 0.0


@device
def book_nodes(row, nodes, start, step, slider, piece, limit, energy):
    """Take an accepted sub-step: integrals of the powers over it, and the row at its end."""
    _, _, damping, viscosity, forced, _, _, _ = slider
    firms = np.empty(3)
    for i in range(3):
        yields, _ = compliance(nodes[i, AT_RADIUS], slider)
        firms[i] = 1.0 / yields if yields > 0.0 else 0.0
    speeds = slopes(nodes[0, AT_WAY], nodes[1, AT_WAY], nodes[2, AT_WAY], step)
    bodies = slopes(nodes[0, AT_BODY], nodes[1, AT_BODY], nodes[2, AT_BODY], step)
    spreads = slopes(nodes[0, AT_AREA], nodes[1, AT_AREA], nodes[2, AT_AREA], step)
    firmer = slopes(firms[0], firms[1], firms[2], step)
    for i in range(3):
        node, share, time = nodes[i], PARTS[i] * step, start + PLACES[i] * step
        pull = pull_on(time, start, node[AT_BODY], row, slider, piece)
        energy[WORK] += share * pull * (bodies[i] if forced > 0.0 else driven(time, piece)[1])
        energy[DAMPING] += share * damping * bodies[i] * bodies[i]
        energy[VISCOSITY] += share * node[AT_AREA] * viscosity * speeds[i] * speeds[i]
        energy[RUPTURE] += share * 0.5 * node[AT_AREA] * node[AT_LOST]
        energy[AREA] -= share * 0.5 * (node[AT_SQUARE] * spreads[i] + node[AT_SHEARED] * node[AT_SHEARED] * firmer[i])
        row[SQUARE] += share * speeds[i] * speeds[i]
        if i > 0:
            if node[AT_CUT] > 0.0:
                energy[RUPTURE] += 0.25 * (nodes[i - 1, AT_AREA] + node[AT_AREA]) * node[AT_CUT] * limit * limit
            row[PATH] += math.fabs(node[AT_WAY] - nodes[i - 1, AT_WAY])
    last = nodes[2]
    row[FORCE] = pull_on(start + step, start, last[AT_BODY], row, slider, piece)
    row[SPEED], row[SHEARED], row[RADIUS] = speeds[2], last[AT_SHEARED], last[AT_RADIUS]
    row[BODY] = last[AT_SPEED] if slider[1] > 0.0 else bodies[2]
    row[BOUND], row[MOMENT] = last[AT_BOUND], last[AT_MOMENT]
    row[POSITION] += last[AT_BODY]
    row[SLIP] += last[AT_WAY]
    row[COUNT] += 1.0


@device
def longest(row, unit, rules):
    """Sub-step beyond which births are not resolved [s]."""
    if rules.rebinding == 0.0:
        return math.inf
    speed = math.fabs(row[SPEED]) * unit
    life = hazard_time(0.0, speed, 1.0, rules.law)
    most = life * (7.0 * rules.tolerance) ** (1.0 / 3.0)
    most = min(most, 0.75 * rules.cell / speed) if speed > 0.0 else most
    few = _FEW_BIRTHS * rules.tolerance * (row[BOUND] + SOME) / rules.rebinding
    return max(most, few)


@device
def bend_of(nodes, step):
    """Acceleration of the interface in a sub-step."""
    early, late = nodes[1, AT_WAY] / GAMMA, (nodes[2, AT_WAY] - nodes[1, AT_WAY]) / (1.0 - GAMMA)
    return 2.0 / step * (late - early) / step


@device
def error_of_way(bend, step, nodes, row, slider):
    """Error of a sub-step's way by the change of its acceleration, over the tolerance."""
    return step * step / 24.0 * math.fabs(bend - row[BEND]) / (1.0 + math.fabs(nodes[2, AT_WAY])) / slider[7]


@device
def stored_energy(row, square, bare, time, slider, held):
    """Elastic and kinetic energy of spring, body, contact and bonds."""
    stiffness, mass, _, viscosity, _, _, _, _ = slider
    _, area, _, _ = contact_area(row[BOUND], row[MOMENT], time, row[RADIUS], bare, held)
    if not area >= 0.0:  # equilibrium was lost on the way
        area = math.pi * row[RADIUS] * row[RADIUS] / held[10]
    energy = 0.5 * mass * row[BODY] * row[BODY] + 0.5 * area * square
    energy += 0.5 * row[SHEARED] * area * (row[MOMENT] + viscosity * row[SPEED])
    return energy + 0.5 * row[FORCE] * row[FORCE] / stiffness if stiffness > 0.0 else energy
