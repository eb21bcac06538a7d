"""Slider and bonds whose stretches are resolved through one sub-step, over exact maps of the bonds.

In a sub-step h the slider goes straight to a node at γ h and straight on to one at h, γ = 2 − √2 (TR-BDF2): speeds and
accelerations at the nodes follow from the positions by the trapezoidal rule and by the second backward difference,
and one scalar equation a node, the balance of forces, gives the slip. So the scheme is L-stable and the same for mass,
damping, viscosity and 1/k_t of zero and of any size. What bonds survive on a straight way is exact; that the true way
bends is taken into their mean stretch on it, with the curvature of the sub-step before, whose change is the error.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.bonds.cohorts import carry, inside, read_row, rules_of, settle, steepen, sum_row, try_step, write_row
from sim.parts.bonds.rupture import hazard_integral, hazard_time, rate_at
from sim.parts.coupled.row import (
    BEND,
    BODY,
    BOUND,
    COLUMNS,
    COUNT,
    ENDED,
    FORCE,
    LEAST,
    MOMENT,
    MOST_STEPS,
    NEXT,
    PATH,
    POSITION,
    RADIUS,
    SHEARED,
    SLIP,
    SOME,
    SPEED,
    SQUARE,
    area_kept,
    compliance,
    contact_area,
    driven,
    elastic,
    later,
    pull_on,
    put_down,
    slip_free,
    slips_free,
    take_up,
)
from sim.parts.drive import AREA, DAMPING, RUPTURE, SNAP, STORED, VISCOSITY, WORK

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
#: Largest mean bend of a way [stretch].
_MOST_BENT = 0.2
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


#: Share of a piece below which a sub-step that fails may be an avalanche; share of a limit by which one is tried.
_BRIEF, _TRIED = 1e-9, 1e-7
#: Sub-steps within which bonds break that none leads over.
_AROUND = 8.0


@device
def _at_once(pool, count, way, unit, rules):
    """Share bound and sum of the stretches once all bonds have gone a way, and none is beyond the limit."""
    bound, moment, limit = 0.0, 0.0, rules.limit
    for i in range(count):
        x, half = pool[1, i] + unit * way, 0.5 * pool[2, i]
        pool[4, i] = pool[0, i] * inside(x, pool[2, i], limit)
        bound += pool[4, i]
        moment += pool[4, i] * 0.5 * (max(x - half, -limit) + min(x + half, limit))
    return bound, moment / unit


@device
def _lacking(way, pool, count, row, time, bare, slider, held, unit, rules):
    """Force that bonds lack, along the pull, once all have gone a way at once; area, shear and way of the body."""
    bound, moment = _at_once(pool, count, way, unit, rules)
    radius, area, _, _ = contact_area(bound, moment, time, row[RADIUS], bare, held)
    yields, _ = compliance(radius, slider)
    sheared = yields * area * moment
    body = way + sheared - row[SHEARED]
    lacks = row[FORCE] - slider[0] * body - area * moment
    return lacks if row[FORCE] > 0.0 else -lacks, area, radius, sheared, body


@device
def _snap(row, pool, count, time, bare, slider, held, unit, rules, node, energy):
    """Slip at once to where bonds bear the pull again, if an avalanche has begun; bonds left, below zero if none has.

    The first such place is looked for in steps of at most half the width to which stretches are resolved.
    """
    sense, step, limit = math.copysign(1.0, row[FORCE]), 0.5 * rules.cell / unit, rules.limit / unit
    here, area, _, _, _ = _lacking(0.0, pool, count, row, time, bare, slider, held, unit, rules)
    near, _, _, _, _ = _lacking(sense * _TRIED * limit, pool, count, row, time, bare, slider, held, unit, rules)
    if not (near > here or here > _TRIED * math.fabs(row[FORCE])):  # merged stretches reach a little beyond the limit
        return -1
    way, low, high, begun = 0.0, 0.0, _TRIED * limit, near > 0.0
    while high < 2.0 * limit:
        low, high = high, high + min(high, step)
        lacks, _, _, _, _ = _lacking(sense * high, pool, count, row, time, bare, slider, held, unit, rules)
        if begun and lacks <= 0.0:
            break
        begun = begun or lacks > 0.0
        if not begun and high > step:
            return -1
    if high < 2.0 * limit:
        for _ in range(60):
            middle = 0.5 * (low + high)
            lacks, _, _, _, _ = _lacking(sense * middle, pool, count, row, time, bare, slider, held, unit, rules)
            low, high = (middle, high) if lacks > 0.0 else (low, middle)
        way = sense * high
    elif slider[0] > 0.0:
        way = row[FORCE] / slider[0] + row[SHEARED]
    else:
        return -1
    _, after, radius, sheared, body = _lacking(way, pool, count, row, time, bare, slider, held, unit, rules)
    if not after >= 0.0:
        return -1
    stored, bound = stored_energy(row, node[AT_SQUARE], bare, time, slider, held), node[AT_BOUND]
    count = carry(pool, count, unit * way, 0.0, 0.0, 0.0, rules)
    sums_at(pool, count, unit, rules, node)
    row[RADIUS], row[SHEARED], row[BOUND], row[MOMENT] = radius, sheared, node[AT_BOUND], node[AT_MOMENT]
    row[FORCE] -= slider[0] * body
    row[POSITION] += body
    row[SLIP] += way
    row[PATH] += math.fabs(way)
    row[BEND] = 0.0
    broken = 0.25 * (area + after) * (bound - node[AT_BOUND]) * limit * limit
    energy[RUPTURE] += broken
    if slider[4] > 0.0:
        energy[WORK] += row[FORCE] * body
        stored += row[FORCE] * body
    energy[SNAP] += stored - stored_energy(row, node[AT_SQUARE], bare, time, slider, held) - broken
    return count


@device
def _shed(row, pool, count, time, reach, bare, slider, held, unit, rules, node, energy):
    """Break bonds of one stretch that are within a ``reach`` of its limit; bonds left, below zero if there are none.

    Their force falls in no time, so that no sub-step leads over it where something delays the slip.
    """
    left, gone, limit = 0, 0.0, rules.limit / unit
    for i in range(count):
        if math.fabs(pool[1, i]) / unit - 0.5 * pool[2, i] / unit >= limit - reach:
            gone += pool[0, i]
        else:
            pool[:3, left] = pool[:3, i]
            left += 1
    if left == count:
        return -1
    stored = stored_energy(row, node[AT_SQUARE], bare, time, slider, held)
    _, area, _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    sums_at(pool, left, unit, rules, node)
    row[BOUND], row[MOMENT], row[BEND] = node[AT_BOUND], node[AT_MOMENT], 0.0
    row[RADIUS], node[AT_AREA], _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    yields, _ = compliance(row[RADIUS], slider)
    row[SPEED], row[BODY], _ = start_of(row, node, yields, slider)
    broken = 0.5 * area * gone * limit * limit
    energy[RUPTURE] += broken
    energy[SNAP] += stored - stored_energy(row, node[AT_SQUARE], bare, time, slider, held) - broken
    return left


@device
def _let_go(row, pool, time, brief, bare, slider, held, unit, rules, node, energy):
    """Break all bonds at once and slip, where nothing delays the interface, if they last less than ``brief``."""
    k = rate_at(unit * node[AT_MOMENT] / node[AT_BOUND], rules.law) if node[AT_BOUND] > 0.0 else 0.0
    if not (k * brief > 1.0 and slips_free(row, slider)):
        return False
    stored = stored_energy(row, node[AT_SQUARE], bare, time, slider, held)
    _, area, _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    broken = 0.5 * area * node[AT_SQUARE]
    slip_free(row, time, bare, slider, held)
    pool[0, 0], pool[1, 0], pool[2, 0] = row[BOUND], 0.0, 0.0
    sums_at(pool, 1, unit, rules, node)
    row[BEND] = 0.0
    energy[RUPTURE] += broken
    energy[SNAP] += stored - stored_energy(row, 0.0, bare, time, slider, held) - broken
    return True


@device
def _piece(row, bonds, bare, slider, held, piece, unit, rules, room, energy):
    """Go through one piece of a clock step; the time after which it ends or there is no way on, and the bonds.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step.
    """
    pool, saved, nodes = room
    count, travelled, settled = bonds
    start, length = 0.0, piece[0]
    brittle = slider[1] + slider[2] + slider[3] == 0.0
    nodes[0, :] = 0.0
    sums_at(pool, count, unit, rules, nodes[0])
    for _ in range(MOST_STEPS):
        left = length - start
        step = row[NEXT] if row[NEXT] > 0.0 else 1e-3 * length
        step = min(step, longest(row, unit, rules))
        step = left if step > 0.999 * left else min(step, 0.5 * left)
        if left <= LEAST * length:
            return length, count, travelled, settled
        if not step > LEAST * length:
            slid, row[NEXT] = row[SLIP], 0.0
            if _let_go(row, pool, start, _BRIEF * length, bare, slider, held, unit, rules, nodes[0], energy):
                count = settled = 1
                travelled += unit * (row[SLIP] - slid)
            elif held[0] > 0.0:
                return start, count, travelled, settled
            else:
                held = later(held, 0.0, 1.0)
            continue
        saved[:, :count] = pool[:3, :count]
        first = nodes[0]
        first[AT_RADIUS], first[AT_AREA], _, _ = contact_area(
            first[AT_BOUND], first[AT_MOMENT], start, row[RADIUS], bare, held
        )
        first[AT_SHEARED] = row[SHEARED]
        yields, _ = compliance(first[AT_RADIUS], slider)
        at_start = start_of(row, first, yields, slider)
        found, factor = go_to_node(
            1, nodes, at_start, pool, count, start, step, row, bare, slider, held, piece, unit, rules
        )
        if found >= 0:
            found, other = go_to_node(
                2, nodes, at_start, pool, found, start, step, row, bare, slider, held, piece, unit, rules
            )
            factor = min(factor, other)
        way, bend, error = nodes[2, AT_WAY], 0.0, math.inf
        if found >= 0:
            bend = bend_of(nodes, step)
            error = error_of_way(bend, step, nodes, row, slider)
        grows = min(factor, 4.0, max(0.1, 0.9 * error ** (-1.0 / 3.0))) if error > 0.0 else min(factor, 4.0)
        if not (error <= 1.0 and factor >= 1.0):
            pool[:3, :count] = saved[:, :count]
            row[NEXT] = step * (grows if error < math.inf else 0.25)
            if rules.limit < math.inf and step < _BRIEF * length:
                slid, reach = row[SLIP], _AROUND * step * math.fabs(row[SPEED]) + _TRIED * rules.limit / unit
                if brittle:
                    found = _snap(row, pool, count, start, bare, slider, held, unit, rules, first, energy)
                else:
                    found = _shed(row, pool, count, start, reach, bare, slider, held, unit, rules, first, energy)
                if found >= 0:
                    count, row[NEXT] = found, 1e-6 * length
                    travelled += unit * (row[SLIP] - slid)
            continue
        book_nodes(row, nodes, start, step, slider, piece, rules.limit / unit, energy)
        count, row[BEND] = found, bend
        travelled += unit * way
        if count > 1.25 * settled + 16.0 or count + 4 > pool.shape[1]:
            direction = -1.0 if way < 0.0 else 1.0
            count = settled = settle(pool[0], pool[1], pool[2], count, direction, travelled, rules)
            sums_at(pool, count, unit, rules, first)
        else:
            first[AT_BOUND : AT_LOST + 1] = nodes[2, AT_BOUND : AT_LOST + 1]
        row[NEXT] = max(row[NEXT], step * grows) if step == left else step * grows
        if step == left:
            return length, count, travelled, settled
        start += step
    return start, count, travelled, settled


@device
def _through(row, energy, bare, pieces, slider, held, unit, share, rules, bonds, room):
    """Take a row and its cohorts through the pieces of a clock step; the time reached, whether something holds."""
    (weight, stretch, width, lattice), (pool, _, nodes) = bonds, room
    is_open = not row[RADIUS] > 0.0
    row[RADIUS] = 0.0 if is_open else row[RADIUS]
    now, time, going = later(held, 0.0, 1.0 if is_open else held[0]), 0.0, True
    count = read_row(pool, weight, stretch, width, share)
    travelled, settled = lattice[0], lattice[1]
    for p in range(len(pieces)):
        piece = pieces[p, 1], pieces[p, 2], pieces[p, 3], pieces[p, 4]
        from_here, reached, worked, slid = later(now, time, now[0]), 0.0, energy[WORK], row[SLIP]
        before = energy[STORED]
        sums_at(pool, count, unit, rules, nodes[0])
        if p > 0:
            before = stored_energy(row, nodes[0, AT_SQUARE], bare, 0.0, slider, from_here)
        row[BOUND], row[MOMENT] = nodes[0, AT_BOUND], nodes[0, AT_MOMENT]
        going = elastic(row, 0.0, bare, slider, from_here, piece, energy)
        if going:
            for i in range(count):
                pool[1, i] += unit * (row[SLIP] - slid)
            travelled += unit * (row[SLIP] - slid)
            sums_at(pool, count, unit, rules, nodes[0])
            left = stored_energy(row, nodes[0, AT_SQUARE], bare, 0.0, slider, from_here)
            energy[AREA] += energy[WORK] - worked - left + before
            reached, count, travelled, settled = _piece(
                row, (count, travelled, settled), bare, slider, from_here, piece, unit, rules, room, energy
            )
        time += reached
        going = going and reached == piece[0]
        if not going:
            break
    if going:
        sums_at(pool, count, unit, rules, nodes[0])
        energy[STORED] = stored_energy(row, nodes[0, AT_SQUARE], bare, time, slider, now)
    if count > weight.size:
        count = settle(pool[0], pool[1], pool[2], count, 1.0 if row[SLIP] >= 0.0 else -1.0, travelled, rules)
        settled = count
    if rules.cell < math.inf:
        travelled = travelled % (1048576.0 * rules.cell)
    write_row(pool, count, weight, stretch, width)
    lattice[0], lattice[1] = travelled, settled
    return time, going


@kernel(
    "void(float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64,"
    " UniTuple(float64, 8), UniTuple(float64, 11), float64[:, :, ::1], float64[:, :, ::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1])"
)
def advance_cohorts(
    rows, energies, bare, pieces, clock, units, work, slider, held, passed, spent, share, numbers,
    weight, stretch, width, lattice, sums,
):  # fmt: skip
    """Advance all rows, their energies and cohorts through some clock steps, each row by itself.

    ``share`` of each row's bonds that is left at the start; ``sums`` get those of the cohorts after each step. The rest
    as in ``mean_field.advance_rows``.
    """
    rules, most, unit = rules_of(numbers), weight.shape[1] + 520, units[SLIP]
    room = np.empty((9, most)), np.empty((3, most)), np.zeros((3, AT_SPEED + 1))
    row, energy = np.empty(COLUMNS), np.empty(energies.shape[1])
    for m in range(len(rows)):
        stop, left = 0, share[m % share.size]
        bonds = weight[m], stretch[m], width[m], lattice[m]
        for k in range(len(clock)):
            start = stop
            while stop < len(pieces) and pieces[stop, 0] == k:
                stop += 1
            take_up(row, energy, rows[m], energies[m], units, work)
            if math.isnan(row[ENDED]):
                now = held[:3] + (clock[k, 1], clock[k, 2], clock[k, 3], clock[k, 4]) + held[7:]
                given = pieces[start:stop]
                time, going = _through(row, energy, bare[m], given, slider, now, unit, left, rules, bonds, room)
                if not going:
                    row[ENDED], row[POSITION], row[SPEED], row[BODY] = clock[k, 0] + time, math.nan, math.nan, math.nan
                    energy[:] = math.nan
                left = 1.0
            put_down(row, energy, rows[m], energies[m], units, work, passed[:, k, m], spent[k, m])
            sum_row(weight[m], stretch[m], width[m], rules, room[0][4], sums[:, k, m])
