"""Slider and bonds whose stretches are resolved through one sub-step, over exact maps of the bonds.

In a sub-step h the slider goes straight to a node at γ h and then to a node at h, γ = 2 − √2 (TR-BDF2). Speeds and
accelerations at the nodes follow from the positions by the trapezoidal rule and the second backward difference. At each
node the balance of forces, a scalar equation, gives the slip. So the scheme is L-stable and the same for mass, damping,
viscosity and 1/k_t of zero and of any size. The survival of bonds on a straight path is exact. The curvature of the
true path is included in their mean stretch, with the curvature of the previous sub-step. The change of the curvature is
the error.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.bonds.cohorts import (
    RULES,
    Rules,
    carry,
    inside,
    read_row,
    relax,
    settle,
    steepen,
    sum_row,
    try_step,
    write_row,
)
from sim.parts.bonds.rupture import hazard_integral, hazard_time, rate_at, rates_at
from sim.parts.coupled import mechanics
from sim.parts.coupled.step_end import ENDS, end_step
from sim.parts.drive import ENERGY
from sim.parts.exchange import record

GAMMA = 2.0 - math.sqrt(2.0)
_MIDDLE = 1.0 / (6.0 * GAMMA * (1.0 - GAMMA))
#: Places of start and nodes in a sub-step, and their shares in the integral of the parabola through all three.
PLACES = (0.0, GAMMA, 1.0)
PARTS = (0.5 + (GAMMA - 1.0) * _MIDDLE, _MIDDLE, 0.5 - GAMMA * _MIDDLE)
#: Start or node of a sub-step: slip and displacement of the body since its start, area, shear displacement, radius,
#: share bound, sum of the stretches, of their squares and of those times the rupture rate, share cut since the node
#: before, speed of a body with mass.
NODE = record("slip body area sheared radius bound moment square lost cut body_speed")
#: Turns of the secant method; share of the slope of a fresh elastic bond below which a sub-step is too long.
_TURNS, _FALLING = 25, 0.02
#: The same where slip alone breaks bonds: their force may hardly rise.
_FLAT = 1e-7
#: Turns after which two near trials give a slope, too, and their least distance over the tolerance of the slip. Bonds
#: that are cut in a sub-step change the slope, and the first one then hardly converges in the shortest sub-steps.
_SLOW, _RESOLVED = 3, 10.0
#: Largest mean bend of a path [stretch].
_MOST_BENT = 0.2
#: Least stretch by which errors are measured, for the first motion from a state without any.
_LEAST_SCALE = 1e-9
#: Share of a stretch by which the errors of a body that rings are measured.
_RINGING = 0.02
#: Births in a sub-step over the tolerance of the bonds below which its length is no matter to them.
_FEW_BIRTHS = 0.1


@device
def slopes(first, middle, last, step):
    """Return the slopes at start and nodes of the parabola through values there."""
    early, late = (
        (middle - first) / (GAMMA * step),
        (last - middle) / ((1.0 - GAMMA) * step),
    )
    bend = late - early
    return early - GAMMA * bend, early + GAMMA * bend, late + (1.0 - GAMMA) * bend


@device
def sums_at(pool, count, unit, rules, node):
    """Compute the sums over the bonds at a node, stretches over their ``unit``."""
    bound, moment, square, lost, rates = 0.0, 0.0, 0.0, 0.0, pool[8]
    rates_at(pool[1, :count], rules, rates)
    for i in range(count):
        w, x, d = pool[0, i], pool[1, i], pool[2, i]
        squared = w * (x * x + d * d / 12.0)
        bound += w
        moment += w * x
        square += squared
        lost += squared * rates[i]
    node.bound, node.moment = bound, moment / unit
    node.square, node.lost = square / (unit * unit), lost / (unit * unit)


@device
def _try_motion(pool, count, shift, duration, off, free, rules):
    """Return the bonds after a trial: their share, sum of stretches, births early and late, factor of the step.

    Below 1 the factor refuses the step, as births are not good to the tolerance of the bonds.
    """
    early, late, factor = try_step(
        pool, count, shift, shift / duration, duration, off, free, rules
    )
    limit, far = rules.limit, 2.0 / 3.0 * shift - 4.0 / 3.0 * off
    bound, moment = early + late, early * far
    if limit < math.inf:
        for i in range(count):
            low = max(pool[1, i] + shift - 0.5 * pool[2, i], -limit)
            high = min(pool[1, i] + shift + 0.5 * pool[2, i], limit)
            bound += pool[4, i]
            moment += pool[4, i] * 0.5 * (low + high)
        return bound, moment, early, late, factor
    for i in range(count):
        bound += pool[4, i]
        moment += pool[4, i] * (pool[1, i] + shift)
    return bound, moment, early, late, factor


@device
def _cut(pool, count, shift, duration, rules):
    """Return the share of the sites whose bonds reach the limit of their stretch in a displacement."""
    cut = 0.0
    for i in range(count):
        most = math.fabs(pool[1, i] + shift) + 0.5 * pool[2, i]
        if most > rules.limit:
            cut += (
                pool[0, i]
                * math.exp(-hazard_integral(pool[1, i], shift, duration, rules))
                - pool[4, i]
            )
    return max(cut, 0.0)


@device
def start_of(row, node, yields, slider):
    """Return the speeds of interface and body, and the force on the mass, at the start, by the balance of forces."""
    mass, damping = slider.mass, slider.damping
    speed, body, thick = row.speed, row.body_speed, node.area * slider.viscosity
    bears = node.area * node.moment
    if thick > 0.0 and yields > 0.0:
        speed = (row.sheared / yields - bears) / thick
    elif yields == 0.0 and mass == 0.0 and damping + thick > 0.0:
        speed = body = (row.spring_force - bears) / (damping + thick)
    elif yields == 0.0:
        speed = body = row.body_speed if mass > 0.0 else row.speed
    force = bears + thick * speed
    if mass == 0.0 and damping > 0.0 and yields > 0.0:
        body = (row.spring_force - force) / damping
    return speed, body, row.spring_force - damping * body - force if mass > 0.0 else 0.0


@device
def begin_sub_step(row, node, start, slider, contact):
    """Set the contact at the start of a sub-step, whose bonds are known, and return its ``start_of``."""
    node.radius, node.area, _, _ = mechanics.contact_area(
        node.bound, node.moment, start, row.radius, contact
    )
    node.sheared = row.sheared
    yields, _ = mechanics.compliance(node.radius, slider)
    return start_of(row, node, yields, slider)


class Approach(NamedTuple):
    """Way to a node: its duration and end; speeds as ``rate`` times a displacement less an offset; a first guess.

    ``momentum`` is the momentum over time that a body with mass brings along. The slip is found to a share of ``none``,
    its tolerance.
    """

    duration: float
    time: float
    rate: float
    offset: float
    body_offset: float
    momentum: float
    slip: float
    none: float


@device
def before_node(place, nodes, at_start, start, step, scale, row, slider):
    """Return the ``Approach`` to a node; ``scale`` is the stretch by which errors are measured."""
    none = scale * slider.tolerance
    mass, (speed, body_speed, force_on_mass) = slider.mass, at_start
    duration = (GAMMA if place == 1 else 1.0 - GAMMA) * step
    time, rate, share = (
        start + PLACES[place] * step,
        2.0 / (GAMMA * step),
        1.0 / (GAMMA * (1.0 - GAMMA) * step),
    )
    if place == 1:
        momentum = mass * rate * body_speed + force_on_mass
        slip = duration * (speed + 0.5 * row.acceleration * duration)
        return Approach(duration, time, rate, speed, body_speed, momentum, slip, none)
    before = nodes[1]
    momentum = mass * (rate * body_speed + share * (before.body_speed - body_speed))
    slip = duration * (before.slip / (GAMMA * step) + 0.5 * row.acceleration * step)
    return Approach(
        duration,
        time,
        rate,
        share * before.slip,
        share * before.body,
        momentum,
        slip,
        none,
    )


@device
def balance(shift, sums, nodes, approach, start, row, slider, contact):
    """Return the excess force at a node with some bonds, its slope if they stay, and the tolerance of the slip.

    ``sums``: share of bound sites, and sum of their stretches. ``nodes``: the node before, and this one, to which what
    belongs to the slip is written.
    """
    (bound, moment), (before, after) = sums, nodes
    stiffness, mass, damping, viscosity = (
        slider.stiffness,
        slider.mass,
        slider.damping,
        slider.viscosity,
    )
    time, rate, momentum, tolerance = (
        approach.time,
        approach.rate,
        approach.momentum,
        slider.tolerance,
    )
    radius, area, _, by_moment = mechanics.contact_area(
        bound, moment, time, row.radius, contact
    )
    if not area >= 0.0:
        return math.nan, math.nan, math.nan
    yields, softer = mechanics.compliance(radius, slider)
    slip = before.slip + shift
    stress = moment + viscosity * (rate * slip - approach.offset)
    force = area * stress
    body = slip + yields * force - row.sheared
    pull = mechanics.pull_on(time, start, body, row, slider)
    over = (
        force
        + (damping + mass * rate) * (rate * body - approach.body_offset)
        - momentum
        - pull
    )
    grows = area * (bound + viscosity * rate) + by_moment * stress * bound
    softer = bound * mechanics.softening(softer, radius, by_moment, contact) * force
    loads = stiffness + rate * (damping + mass * rate)
    after.slip, after.body, after.area, after.radius = slip, body, area, radius
    after.sheared = yields * force
    # by its momentum: differences of positions are roundings in the shortest sub-steps
    if mass > 0.0:
        after.body_speed = (momentum + pull - force) / (damping + mass * rate)
    firmest, bears = (
        max(stiffness, mechanics.stiffness_of(radius, slider)),
        area * (bound + mechanics.SOME),
    )
    firm = firmest / bears if area > 0.0 else 1.0
    none, slope = (
        1e-3 * approach.none / max(1.0, firm),
        grows + loads * (1.0 + softer + yields * grows),
    )
    # what is left of the forces is work on the body, whose displacement may be the longer
    if mass + damping > 0.0:
        none = min(
            none, 1e-3 * tolerance * (math.fabs(force) + math.fabs(pull)) / slope
        )
    # Roundings of the displacement of the body and of the forces matter less to a slip
    # that viscosity makes stiff. The force of bonds of both signs is a small difference.
    size = max(math.fabs(force), area * math.sqrt(bound * before.square))
    roundings = loads * (math.fabs(slip) + yields * size + math.fabs(row.sheared))
    roundings += size + math.fabs(pull)
    return over, slope, max(none, 1e-15 * (math.fabs(slip) + roundings / slope))


@device
def go_to_node(place, nodes, way, pool, count, row, around, law):
    """Find the slip to a node and move the bonds; return their number, and the factor of the step for births.

    ``way``: speeds and force at the start of the sub-step, its start and length, and the stretch by which errors are
    measured. ``around``: numbers of slider and contact. ``law``: unit of a stretch, and rules of the cohorts. The
    number is below zero if there is no balance of forces or its slope is not that of a short sub-step.
    """
    (at_start, start, step, scale), (slider, contact), (unit, rules) = way, around, law
    approach = before_node(place, nodes, at_start, start, step, scale, row, slider)
    duration, shift = approach.duration, approach.slip
    before, after = nodes[place - 1], nodes[place]
    bent = -row.acceleration * duration * duration / 12.0
    off = unit * min(max(bent, -_MOST_BENT), _MOST_BENT)
    free, ahead = max(0.0, 1.0 - before.bound), shift >= 0.0
    steepen(pool, count, shift, off, rules)
    last_shift, last_over, slope = 0.0, 0.0, 0.0
    for turn in range(_TURNS):
        if (shift >= 0.0) != ahead:
            ahead = shift >= 0.0
            steepen(pool, count, shift, off, rules)
        bound, moment, early, late, factor = _try_motion(
            pool, count, unit * shift, duration, off, free, rules
        )
        moment /= unit
        sums, ends = (bound, moment), (before, after)
        over, elasticity, none = balance(
            shift, sums, ends, approach, start, row, slider, contact
        )
        if turn == 0:
            slope = elasticity
        elif math.fabs(shift - last_shift) > (
            1e-9 * (1.0 + math.fabs(shift)) if turn < _SLOW else _RESOLVED * none
        ):
            slope = (over - last_over) / (shift - last_shift)
        if not slope > (_FALLING if rules.limit == math.inf else _FLAT) * elasticity:
            return -1, 0.0
        # else roundings of open contacts add up
        if math.fabs(over / slope) <= none and (turn > 0 or after.area > 0.0):
            after.cut = (
                _cut(pool, count, unit * shift, duration, rules)
                if rules.limit < math.inf
                else 0.0
            )
            count = carry(pool, count, unit * shift, off, early, late, rules)
            sums_at(pool, count, unit, rules, after)
            return count, factor
        last_shift, last_over = shift, over
        shift -= over / slope
    return -1, 0.0


@device
def accept_nodes(row, nodes, start, step, slider, contact, limit, energy):
    """Add an accepted sub-step to the row: integrals of the powers over it, and the row at its end."""
    damping, viscosity = slider.damping, slider.viscosity
    firms = np.empty(3)
    for i in range(3):
        firms[i] = mechanics.stiffness_of(nodes[i].radius, slider)
    speeds = slopes(nodes[0].slip, nodes[1].slip, nodes[2].slip, step)
    bodies = slopes(nodes[0].body, nodes[1].body, nodes[2].body, step)
    spreads = slopes(nodes[0].area, nodes[1].area, nodes[2].area, step)
    firmer = slopes(firms[0], firms[1], firms[2], step)
    for i in range(3):
        node, share, time = nodes[i], PARTS[i] * step, start + PLACES[i] * step
        pull = mechanics.pull_on(time, start, node.body, row, slider)
        energy.work += (
            share
            * pull
            * (bodies[i] if slider.forced > 0.0 else mechanics.driven(time, slider)[1])
        )
        energy.damping += share * damping * bodies[i] * bodies[i]
        energy.viscosity += share * node.area * viscosity * speeds[i] * speeds[i]
        energy.rupture += share * 0.5 * node.area * node.lost
        energy.area -= (
            share
            * 0.5
            * (node.square * spreads[i] + node.sheared * node.sheared * firmer[i])
        )
        if i > 0:
            if node.cut > 0.0:
                energy.rupture += (
                    0.25 * (nodes[i - 1].area + node.area) * node.cut * limit * limit
                )
            shift, share = node.slip - nodes[i - 1].slip, PLACES[i] - PLACES[i - 1]
            path = math.fabs(shift)
            mechanics.remember(
                row, path, speeds[i - 1], speeds[i], share * step, contact
            )
    last = nodes[2]
    row.spring_force = mechanics.pull_on(start + step, start, last.body, row, slider)
    row.speed, row.sheared, row.radius = speeds[2], last.sheared, last.radius
    row.body_speed = last.body_speed if slider.mass > 0.0 else bodies[2]
    row.bound, row.moment = last.bound, last.moment
    row.position += last.body
    row.slip += last.slip
    row.substeps += 1.0


@device
def longest(row, unit, rules):
    """Return the sub-step beyond which births are not resolved [s]."""
    if rules.rebinding == 0.0:
        return math.inf
    speed = math.fabs(row.speed) * unit
    life = hazard_time(0.0, speed, 1.0, rules)
    most = life * (7.0 * rules.tolerance) ** (1.0 / 3.0)
    most = min(most, 0.75 * rules.cell / speed) if speed > 0.0 else most
    few = _FEW_BIRTHS * rules.tolerance * (row.bound + mechanics.SOME) / rules.rebinding
    return max(most, few)


@device
def bend_of(nodes, step, scale, row, slider):
    """Return the acceleration of the interface in a sub-step, and the error of its slip by the change of that.

    The error is over the tolerance and over the larger of the slip and a ``scale`` of the stretch.
    """
    slip = nodes[2].slip
    early, late = nodes[1].slip / GAMMA, (slip - nodes[1].slip) / (1.0 - GAMMA)
    bend = 2.0 / step * (late - early) / step
    return bend, step * step / 24.0 * math.fabs(bend - row.acceleration) / (
        scale + math.fabs(slip)
    ) / slider.tolerance


@device
def stretch_scale(row, node, slider):
    """Return the stretch by which errors of a sub-step from a node are measured; at most 1, the unit.

    It is the stretch of the bonds at rest under the present pull and the present momentum, or their mean stretch if
    that is larger: a body may ring with a small part of the unit. The errors of a body that rings add up over many
    periods, so that a fiftieth of the stretch counts.
    """
    bears = node.area * node.bound + slider.stiffness
    part = (
        _RINGING if slider.damping * slider.damping < 4.0 * slider.mass * bears else 1.0
    )
    mean = node.moment / node.bound if node.bound > 0.0 else 0.0
    square = (
        row.spring_force * row.spring_force
        + bears * slider.mass * row.body_speed * row.body_speed
    )
    if not mean * mean * bears * bears + square < bears * bears:
        return part
    return part * max(math.sqrt(mean * mean + square / (bears * bears)), _LEAST_SCALE)


@device
def stored_energy(row, square, time, slider, contact):
    """Return the elastic and kinetic energy of spring, body, contact and bonds."""
    stiffness, mass = slider.stiffness, slider.mass
    _, area, _, _ = mechanics.area_or_last(row.bound, row.moment, time, row, contact)
    energy = 0.5 * mass * row.body_speed * row.body_speed + 0.5 * area * square
    energy += mechanics.contact_energy(row, area, slider)
    return (
        energy + 0.5 * row.spring_force * row.spring_force / stiffness
        if stiffness > 0.0
        else energy
    )


#: Share of a limit that is tried.
_TRIED = 1e-7
#: Sub-steps within which bonds break that none leads over.
_AROUND = 8.0


@device
def _at_once(pool, count, shift, unit, rules):
    """Return the share bound and the sum of the stretches after a displacement, without bonds beyond the limit."""
    bound, moment, limit = 0.0, 0.0, rules.limit
    for i in range(count):
        x, half = pool[1, i] + unit * shift, 0.5 * pool[2, i]
        pool[4, i] = pool[0, i] * inside(x, pool[2, i], limit)
        bound += pool[4, i]
        moment += pool[4, i] * 0.5 * (max(x - half, -limit) + min(x + half, limit))
    return bound, moment / unit


@device
def _lacking(shift, pool, count, row, time, slider, contact, law):
    """Return the missing force after a displacement at once; area, radius, u, displacement of the body.

    A body that mass or damping holds stays. Then the displacement that is missing is returned instead of the force.
    """
    bound, moment = _at_once(pool, count, shift, *law)
    radius, area, _, _ = mechanics.contact_area(
        bound, moment, time, row.radius, contact
    )
    yields, _ = mechanics.compliance(radius, slider)
    sheared = yields * area * moment
    body = shift + sheared - row.sheared
    if slider.mass + slider.damping > 0.0:
        return -math.copysign(body, body * row.moment), area, radius, sheared, 0.0
    lacks = row.spring_force - slider.stiffness * body - area * moment
    return lacks if row.spring_force > 0.0 else -lacks, area, radius, sheared, body


@device
def _slip_event(row, pool, count, place, slider, contact, law, books):
    """Slip at once to where bonds bear the pull, if an avalanche has begun; return the bonds left, else less than 0.

    ``place``: time, and the slip within which the force begins to fall. ``books``: the node there, and the energies.
    The first place where bonds bear the pull is looked for in steps of at most half the width to which stretches are
    resolved.
    """
    (time, ahead), (unit, rules), (node, energy) = place, law, books
    is_held, step, limit = (
        slider.mass + slider.damping > 0.0,
        0.5 * rules.cell / unit,
        rules.limit / unit,
    )
    sense = math.copysign(1.0, row.moment if is_held else row.spring_force)
    here, area, _, _, _ = _lacking(0.0, pool, count, row, time, slider, contact, law)
    near, _, _, _, _ = _lacking(
        sense * ahead, pool, count, row, time, slider, contact, law
    )
    # merged stretches reach a little beyond the limit
    least = min(ahead, _TRIED * limit)
    if not (
        near > here
        or here > (least if is_held else _TRIED * math.fabs(row.spring_force))
    ):
        return -1
    shift, low, high, begun = 0.0, 0.0, least, near > 0.0
    while high < 2.0 * limit:
        low, high = high, high + min(high, step)
        lacks, _, _, _, _ = _lacking(
            sense * high, pool, count, row, time, slider, contact, law
        )
        if begun and lacks <= 0.0:
            break
        begun = begun or lacks > 0.0
        if not begun and high > step:
            return -1
    if high < 2.0 * limit:
        for _ in range(60):
            middle = 0.5 * (low + high)
            lacks, _, _, _, _ = _lacking(
                sense * middle, pool, count, row, time, slider, contact, law
            )
            low, high = (middle, high) if lacks > 0.0 else (low, middle)
        shift = sense * high
    elif is_held:
        shift = row.sheared
    elif slider.stiffness > 0.0:
        shift = row.spring_force / slider.stiffness + row.sheared
    else:
        return -1
    _, after, radius, sheared, body = _lacking(
        shift, pool, count, row, time, slider, contact, law
    )
    if not after >= 0.0:
        return -1
    stored, bound = stored_energy(row, node.square, time, slider, contact), node.bound
    count = carry(pool, count, unit * shift, 0.0, 0.0, 0.0, rules)
    sums_at(pool, count, unit, rules, node)
    row.radius, row.sheared, row.bound, row.moment = (
        radius,
        sheared,
        node.bound,
        node.moment,
    )
    mechanics.displace(row, shift, body, slider)
    row.acceleration = 0.0
    broken = 0.25 * (area + after) * (bound - node.bound) * limit * limit
    energy.rupture += broken
    if slider.forced > 0.0:
        energy.work += row.spring_force * body
        stored += row.spring_force * body
    energy.snaps += (
        stored - stored_energy(row, node.square, time, slider, contact) - broken
    )
    return count


@device
def _break_stretched(row, pool, count, place, slider, contact, law, books):
    """Break bonds of one stretch within a reach of its limit; return the bonds left, less than 0 without such.

    ``place``: time and reach. ``books``: the node there, and the energies.

    Their force falls in no time, so that no sub-step leads over it where something delays the slip.
    """
    (time, reach), (unit, rules), (node, energy) = place, law, books
    left, gone, limit = 0, 0.0, rules.limit / unit
    for i in range(count):
        if math.fabs(pool[1, i]) / unit - 0.5 * pool[2, i] / unit >= limit - reach:
            gone += pool[0, i]
        else:
            pool[:3, left] = pool[:3, i]
            left += 1
    if left == count:
        return -1
    stored = stored_energy(row, node.square, time, slider, contact)
    _, area, _, _ = mechanics.area_or_last(row.bound, row.moment, time, row, contact)
    sums_at(pool, left, unit, rules, node)
    row.bound, row.moment, row.acceleration = node.bound, node.moment, 0.0
    row.radius, node.area, _, _ = mechanics.area_or_last(
        row.bound, row.moment, time, row, contact
    )
    yields, _ = mechanics.compliance(row.radius, slider)
    row.speed, row.body_speed, _ = start_of(row, node, yields, slider)
    broken = 0.5 * area * gone * limit * limit
    energy.rupture += broken
    energy.snaps += (
        stored - stored_energy(row, node.square, time, slider, contact) - broken
    )
    return left


@device
def _break_all(row, pool, place, slider, contact, law, books):
    """Break all bonds at once and slip, where nothing delays the interface, if they last less than a brief time.

    ``place``: time and brief time. ``books``: the node there, and the energies.
    """
    (time, brief), (unit, rules), (node, energy) = place, law, books
    k = rate_at(unit * node.moment / node.bound, rules) if node.bound > 0.0 else 0.0
    if not (k * brief > 1.0 and mechanics.slips_free(row, slider)):
        return False
    stored = stored_energy(row, node.square, time, slider, contact)
    _, area, _, _ = mechanics.area_or_last(row.bound, row.moment, time, row, contact)
    broken = 0.5 * area * node.square
    mechanics.slip_free(row, time, slider, contact)
    pool[0, 0], pool[1, 0], pool[2, 0] = row.bound, 0.0, 0.0
    sums_at(pool, 1, unit, rules, node)
    row.acceleration = 0.0
    energy.rupture += broken
    energy.snaps += stored - stored_energy(row, 0.0, time, slider, contact) - broken
    return True


@device
def _try_step(row, pool, count, way, nodes, around, law):
    """Take the nodes through a sub-step; ``way``: its start among them, its time, its length, and the unit of stretch.

    Return the bonds at its end, less than 0 without any; how the speed changes there; the error over the tolerance; the
    growth of the next step; and True if the step is good. ``around``: slider and contact.
    """
    (_, _, step, scale), (slider, contact) = way, around
    new_count, factor = go_to_node(1, nodes, way, pool, count, row, around, law)
    if new_count >= 0:
        new_count, other = go_to_node(2, nodes, way, pool, new_count, row, around, law)
        factor = min(factor, other)
    bend, error = 0.0, math.inf
    within = mechanics.within_reach(nodes[2].slip, step, row, contact)
    if new_count >= 0:
        bend, error = bend_of(nodes, step, scale, row, slider)
    grows = (
        min(factor, 4.0, max(0.1, 0.9 * error ** (-1.0 / 3.0)))
        if error > 0.0
        else min(factor, 4.0)
    )
    is_good = error <= 1.0 and factor >= 1.0 and within >= 1.0
    return new_count, bend, error, min(grows, 0.9 * within), is_good


@device
def _let_go(row, pool, count, place, slider, contact, law, books):
    """Let bonds go at their limit where a brief sub-step is refused; return the bonds left, less than 0 if none goes.

    ``place``: time, length of the sub-step, and the slip that is tried ahead.
    """
    (time, step, ahead), (unit, rules), new_count = place, law, -1
    is_held = slider.mass + slider.damping > 0.0
    if is_brittle(row, slider):
        new_count = _slip_event(
            row, pool, count, (time, ahead), slider, contact, law, books
        )
    if new_count < 0 and (is_held or slider.viscosity > 0.0):
        reach = _AROUND * step * math.fabs(row.speed) + _TRIED * rules.limit / unit
        new_count = _break_stretched(
            row, pool, count, (time, reach), slider, contact, law, books
        )
    return new_count


@device
def _slip_or_break(row, pool, count, place, slider, contact, law, books):
    """Let the interface slip, or bonds break, where no sub-step is short enough.

    Return the bonds left, less than 0 if nothing can go at once, and True if all of them have broken. ``place``: time,
    and the length of the piece. ``books``: the node there, and the energies.
    """
    (time, length), (unit, rules), (node, energy) = place, law, books
    slid, row.next_step = row.slip, 0.0
    # the speed grows beyond all bounds before the force falls by a stretch that is resolved
    if rules.limit < math.inf and is_brittle(row, slider):
        within_a_cell = time, 0.5 * rules.cell / unit
        left = _slip_event(row, pool, count, within_a_cell, slider, contact, law, books)
        if left >= 0:
            row.next_step = 1e-6 * length
            return left, False
    brief = time, mechanics.BRIEF * length
    if _break_all(row, pool, brief, slider, contact, law, books):
        return 1, True
    if rules.limit == math.inf and mechanics.snap(
        row, node.square, time, slider, contact, energy
    ):
        for i in range(count):
            pool[1, i] += unit * (row.slip - slid)
        sums_at(pool, count, unit, rules, node)
        row.acceleration = 0.0
        return count, False
    return -1, False


@device
def is_brittle(row, slider):
    """True if nothing delays a slip of the interface: neither viscosity, nor a body that is held and does not yield."""
    yields, _ = mechanics.compliance(row.radius, slider)
    is_held = slider.mass + slider.damping > 0.0
    return slider.viscosity == 0.0 and (yields > 0.0 or not is_held)


@device
def _piece(line, bonds, slider, contact, law, room, books):
    """Go through one piece of a clock step; return the time reached, before its end if the motion ends, and the bonds.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step: then the last
    number returned is 1, else 0.
    """
    (pool, saved, nodes), (unit, rules) = room, law
    row, energy = line[0], books[0]
    count, travelled, settled = bonds
    start, length, turns, checked = 0.0, slider.length, 0, 0.0
    # the energies of the bonds are good to their own tolerance
    balanced = mechanics.Slider(*slider[:-1], max(slider.tolerance, rules.tolerance))
    sums_at(pool, count, unit, rules, nodes[0])
    while turns >= 0:
        turns, checked = mechanics.judged(turns, checked, start, length)
        left, slid = length - start, row.slip
        step = mechanics.next_step(row, left, length, longest(row, unit, rules))
        if left <= mechanics.LEAST * length:
            return length, count, travelled, settled, contact.stays
        if not step > mechanics.LEAST * length:
            place, at_here = (start, length), (nodes[0], energy)
            new_count, all_break = _slip_or_break(
                row, pool, count, place, slider, contact, law, at_here
            )
            if new_count >= 0:
                count, settled = new_count, 1 if all_break else settled
                travelled += unit * (row.slip - slid)
            elif contact.stays > 0.0:
                return start, count, travelled, settled, contact.stays
            else:
                # the interface slips with the body from there on, however fast the contact was lost
                contact = mechanics.later(contact, 0.0, 1.0)
                row.speed, row.acceleration = row.body_speed, 0.0
            continue
        saved[:, :count] = pool[:3, :count]
        first, contact = nodes[0], mechanics.following(contact, row, start, step)
        at_start = begin_sub_step(row, first, start, slider, contact)
        way = at_start, start, step, stretch_scale(row, first, slider)
        new_count, bend, error, grows, is_good = _try_step(
            row, pool, count, way, nodes, (slider, contact), law
        )
        shift = nodes[2].slip
        if not is_good:
            pool[:3, :count] = saved[:, :count]
            row.next_step = step * (grows if error < math.inf else 0.25)
            if rules.limit < math.inf and step < mechanics.BRIEF * length:
                # a slip that stays as the step shrinks may be shorter than what is tried
                stays = 0.5 * math.fabs(shift) if error < math.inf else 1.0
                place = start, step, min(_TRIED * rules.limit / unit, stays)
                new_count = _let_go(
                    row, pool, count, place, slider, contact, law, (first, energy)
                )
                if new_count >= 0:
                    count, row.next_step = new_count, 1e-6 * length
                    travelled += unit * (row.slip - slid)
            continue
        line[1], books[1] = row, energy
        before = stored_energy(row, first.square, start, slider, contact)
        accept_nodes(
            row, nodes, start, step, slider, contact, rules.limit / unit, energy
        )
        after = stored_energy(row, nodes[2].square, start + step, slider, contact)
        if mechanics.misses(before, after, books[1], energy, row, balanced, step):
            pool[:3, :count] = saved[:, :count]
            line[0], books[0], row.next_step = line[1], books[1], 0.25 * step
            continue
        if step <= mechanics.BRIEF * length and contact.stays == 0.0:
            mechanics.book_jump(line, after - before, books)
        count, row.acceleration = new_count, bend
        travelled += unit * shift
        if count > 1.25 * settled + 16.0 or count + 4 > pool.shape[1]:
            direction = -1.0 if shift < 0.0 else 1.0
            count = settled = settle(
                pool[0], pool[1], pool[2], count, direction, travelled, rules
            )
            sums_at(pool, count, unit, rules, first)
        else:
            last = nodes[2]
            first.bound, first.moment, first.square, first.lost = (
                last.bound,
                last.moment,
                last.square,
                last.lost,
            )
        row.next_step = (
            max(row.next_step, step * grows) if step == left else step * grows
        )
        if step == left:
            return length, count, travelled, settled, contact.stays
        start += step
    return start, count, travelled, settled, contact.stays


@device
def _through(line, books, pieces, slider, contact, law, bonds, room):
    """Take a row and its cohorts through a clock step; return the time reached, and False if the motion ends there.

    ``bonds``: arrays of the cohorts, and the share of them that is left at the start.
    """
    (pool, _, nodes), (unit, rules), (bonds, share) = room, law, bonds
    row, energy = line[0], books[0]
    count = read_row(pool, bonds[0], bonds[1], bonds[2], share)
    time, going, travelled, settled, stays = (
        0.0,
        True,
        bonds[3][0],
        bonds[3][1],
        contact.stays,
    )
    for p in range(len(pieces)):
        slider = mechanics.slider_in(slider, pieces[p])
        from_here = mechanics.later(mechanics.feeling(contact, row), time, stays)
        reached, worked, slid, before = 0.0, energy.work, row.slip, energy.stored
        sums_at(pool, count, unit, rules, nodes[0])
        if p > 0:
            before = stored_energy(row, nodes[0].square, 0.0, slider, from_here)
        row.bound, row.moment = nodes[0].bound, nodes[0].moment
        jumps, unslipped = mechanics.force_jumps(row, slider), before
        if jumps:
            unslipped = stored_energy(
                row, nodes[0].square, 0.0, slider, mechanics.drawn(from_here, row, p)
            )
        going, from_here = mechanics.answer(row, p, slider, from_here, energy)
        if going:
            for i in range(count):
                pool[1, i] += unit * (row.slip - slid)
            travelled += unit * (row.slip - slid)
            sums_at(pool, count, unit, rules, nodes[0])
            left = stored_energy(row, nodes[0].square, 0.0, slider, from_here)
            mechanics.book_slip(
                energy.work - worked - left + before, before - unslipped, jumps, energy
            )
            of_bonds = count, travelled, settled
            reached, count, travelled, settled, stays = _piece(
                line, of_bonds, slider, from_here, law, room, books
            )
        time += reached
        going = going and reached == slider.length
        if not going:
            break
    if going:
        sums_at(pool, count, unit, rules, nodes[0])
        row.lost = stays - contact.stays
        contact = mechanics.later(mechanics.settled(contact, row, slider), 0.0, stays)
        energy.stored = stored_energy(row, nodes[0].square, time, slider, contact)
    write_row(pool, count, travelled, settled, row.slip, rules, bonds)
    return time, going


@kernel(
    f"void({mechanics.ARGUMENTS}, {ENDS}, float64[::1], {RULES},"
    " UniTuple(float64[:, ::1], 4), float64[:, :, ::1])"
)
def advance_cohorts(inputs, numbers, outputs, ends, share, rules, cohorts, sums):
    """Advance all rows, their energies and cohorts through some clock steps, each row by itself.

    ``share`` of each row's bonds that is left at the start; ``sums`` get those of the cohorts after each step. The rest
    as in ``mean_field.advance_rows``.
    """
    rows, energies, pieces, clock, units, work = inputs
    weight, stretch, width, lattice = cohorts
    slider, contact, (reached, spent) = (
        mechanics.Slider(*numbers[0]),
        mechanics.contact_of(numbers),
        outputs,
    )
    rules, most, unit = (
        Rules(*rules),
        weight.shape[1] + 520,
        units[mechanics.SLIP],
    )
    both, nodes = (
        (np.empty(2 * mechanics.COLUMNS), np.empty(2 * mechanics.ENERGIES)),
        np.zeros(3, NODE),
    )
    # as they are, and before the last sub-step
    line, books = both[0].view(mechanics.ROW), both[1].view(ENERGY)
    columns, booked, row = (
        both[0][: mechanics.COLUMNS],
        both[1][: mechanics.ENERGIES],
        line[0],
    )
    room, at_end = (
        (np.empty((9, most)), np.empty((3, most)), nodes),
        np.empty((2, ends[0][4].size)),
    )
    for m in range(len(rows)):
        stop, left = 0, share[m % share.size]
        bonds = weight[m], stretch[m], width[m], lattice[m]
        for k in range(len(clock)):
            start, stop = stop, mechanics.pieces_to(k, stop, pieces)
            mechanics.to_units(columns, booked, rows[m], energies[m], units, work)
            if row.closed > 0.0:
                relax(bonds)
            now = mechanics.contact_at(contact, clock[k], row)
            if not mechanics.has_ended(row):
                of_step, law = pieces[start:stop], (unit, rules)
                time, going = _through(
                    line, books, of_step, slider, now, law, (bonds, left), room
                )
                if not going:
                    mechanics.end(row, booked, clock[k, 0] + time, slider)
                left = 1.0
            mechanics.from_units(
                columns,
                booked,
                rows[m],
                energies[m],
                units,
                work,
                pieces[start:stop],
                slider.stiffness,
            )
            reached[:, k, m], spent[k, m] = rows[m], energies[m]
            sum_row(weight[m], stretch[m], width[m], rules, room[0][4], sums[:, k, m])
            if mechanics.has_ended(row):
                # no sub-step has summed its bonds, which stay as they are
                row.bound, row.moment = sums[0, k, m], sums[1, k, m] / unit
            end_step(row, rows[m], m, k, clock[k, 5], now, ends, at_end)
