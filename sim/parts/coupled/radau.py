"""Equations of slider and bonds at the nodes of Radau IIA, order 5, with positions as the unknowns.

The unit of length is a stretch b. The unit of force is n κ b A0, the force of all sites at this stretch over a
reference area A0. Body X (mass m, damping c) and interface X_s = X − u obey

    m Ẍ = S − c Ẋ − F,   F = A (M + η Ẋ_s),   u = F/k_t,   Ṡ = K (V − Ẋ) or S = Q(t),
    Ṅ = k_on (1 − N) − N (k + |Ẋ_s|/l),   Ṁ = N Ẋ_s − M (k + 2|Ẋ_s|/l),   k = k0 exp(|M/N|),

where bonds without a stretch have M = ±N instead, with the sense of the sliding, and N = 1/(1 + |Ẋ_s|/V_c) if they
follow the speed at once. The area A is that of the equilibrium contact with the work of adhesion that these bonds
leave. Slip, u, N and M at the three nodes are the unknowns, error by Newton's method; speeds and accelerations follow
from the positions by the method itself. So the equations are solved directly, even if mass, damping, viscosity and
1/k_t are zero (then they are of index 2). A stiff spring costs no additional steps.
"""

import math

import numpy as np

from sim.numerics.jit import device, inlined
from sim.numerics.radau import NODES, PACE, RATES, SHARES
from sim.parts.coupled import mechanics

#: Second derivatives from the values at the nodes.
BENDS = np.array(
    [[sum(row[k] * RATES[k, j] for k in range(3)) for j in range(3)] for row in RATES]
)
_OFF = np.array([sum(row) for row in RATES])
#: Weights of the values at the nodes in the slope at the start of the polynomial through start and nodes.
START = np.array(
    [
        np.prod([-d for d in NODES if d != c])
        / (c * np.prod([c - d for d in NODES if d != c]))
        for c in NODES
    ]
)


#: Eigenvalue of ``RATES``, one of the complex pair; matrices that lead back to nodes and from them. The
#: last two columns are the real part and minus the imaginary part of the vector of the complex one (Hairer & Wanner
#: 1996, IV.8). Literal, as numbers of a linear-algebra library depend on the machine.
TURNING = 2.6810828736277523 + 3.05043019924741j
FORTH = np.array(
    [
        [0.09443876248897526, -0.14125529502095427, -0.030029194105147337],
        [0.2502131229653332, 0.20412935229380014, 0.38294211275726203],
        [1.0, 1.0, -0.0],
    ]
)
BACK = np.array(
    [
        [4.178718591551904, 0.3276828207610613, 0.5233764454994498],
        [-4.178718591551904, -0.3276828207610613, 0.4766235545005501],
        [-0.5028726349457834, 2.571926949855605, -0.5960392048282249],
    ]
)
_THREE = ("f8", 3)
#: Three nodes of a sub-step: the unknowns slip, u, N, M as ``values`` and by their names, their residuals, their values
#: in the last sub-step; contact radii, forces on a body that stays, areas, k_t; length and root of the error of the
#: last sub-step.
NODE_VALUES = np.dtype(
    {
        "names": [
            "values",
            "slip",
            "sheared",
            "bound",
            "moment",
            "residuals",
            "past",
            "radii",
            "pulls",
            "areas",
            "firms",
            "last_step",
            "last_root",
        ],
        "formats": [
            ("f8", (4, 3)),
            *4 * [_THREE],
            *2 * [("f8", (4, 3))],
            *4 * [_THREE],
            "f8",
            "f8",
        ],
        "offsets": [0, 0, 24, 48, 72, 96, 192, 288, 312, 336, 360, 384, 392],
    }
)


@device
def kinetics(bound, moment, speed, law):
    """Ṅ and slopes over N and M; Ṁ and slope over N; that over M, and over the speed; Ṅ's; k, \\|speed\\|/l."""
    rate, softness, cuts, binding, sense = (
        law.rate,
        law.softness,
        law.cuts,
        law.binding,
        law.sense,
    )
    stretch = moment / bound if bound > 0.0 else 0.0
    k = rate * math.exp(min(softness * math.fabs(stretch), 690.0))
    steeper = math.copysign(k * softness, stretch)
    travel, turn = math.fabs(speed) * cuts, math.copysign(cuts, speed)
    if sense != 0.0:  # smoothly through a speed of zero, where the sliding ends
        travel, turn = sense * speed * cuts, sense * cuts
    to_bound = (
        binding * (1.0 - bound) - (k + travel) * bound,
        -binding - k - travel + steeper * stretch,
        -steeper,
    )
    to_moment = (
        bound * speed - (k + 2.0 * travel) * moment,
        speed + steeper * stretch * stretch,
    )
    moment_turn = -(k + 2.0 * travel) - steeper * stretch, bound - 2.0 * turn * moment
    return to_bound, to_moment, moment_turn, -turn * bound, k, travel


@device
def share_left(speed, law):
    """Return the bond fraction of bonds without a stretch, continued smoothly through a speed of zero."""
    return 1.0 / (1.0 + law.slows * law.sense * speed)


@device
def share_after_rest(bound, time, law):
    """Return the bond fraction after some time at rest: 1 if bonds follow the speed at once."""
    return (
        1.0
        if law.slows != 0.0
        else bound - (1.0 - bound) * math.expm1(-law.binding * time)
    )


@device
def sum_over(weights, i, values):
    """Return the sum over the three nodes of values times a row of weights."""
    return (
        weights[i, 0] * values[0]
        + weights[i, 1] * values[1]
        + weights[i, 2] * values[2]
    )


@inlined
def equations(row, nodes, start, step, slider, law, contact):
    """Compute the residuals at the three nodes for slip, u, N, M there, and their slopes at the middle one.

    The slopes are those of the balance of forces over N, M and the speed, of u over the same, of Ṅ and of Ṁ. They are
    nan if there is no equilibrium.
    """
    stiffness, mass, damping, viscosity = (
        slider.stiffness,
        slider.mass,
        slider.damping,
        slider.viscosity,
    )
    over, gives = 1.0 / step, slider.yielding + slider.yielding_radius > 0.0
    radius, area, by_bound, by_moment = row.radius, 0.0, 0.0, 0.0
    if contact.stays > 0.0:
        area = math.pi * radius * radius / contact.area
    of_balance, of_u = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    of_bonds = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        bound, moment = row.bound + nodes.bound[i], row.moment + nodes.moment[i]
        if contact.stays == 0.0:
            now = start + NODES[i] * step
            radius, area, by_bound, by_moment = mechanics.contact_area(
                bound, moment, now, nodes.radii[i], contact
            )
            nodes.radii[i] = radius
        if not (bound >= 0.0 and area >= 0.0):
            return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        speed = sum_over(RATES, i, nodes.slip) * over
        body = speed + sum_over(RATES, i, nodes.sheared) * over if gives else speed
        stress = moment + viscosity * speed
        yields, softer = mechanics.compliance(radius, slider)
        shift = nodes.slip[i] + nodes.sheared[i]
        nodes.residuals[0, i] = (
            area * stress + damping * body - nodes.pulls[i] + stiffness * shift
        )
        if mass > 0.0:
            bend = (
                sum_over(BENDS, i, nodes.slip) + sum_over(BENDS, i, nodes.sheared)
            ) * over
            bend -= _OFF[i] * row.body_speed
            nodes.residuals[0, i] += mass * bend * over
        nodes.residuals[1, i] = row.sheared + nodes.sheared[i] - yields * area * stress
        of_bound, of_moment, on, turn, _, _ = kinetics(bound, moment, speed, law)
        nodes.residuals[2, i] = sum_over(RATES, i, nodes.bound) * over - of_bound[0]
        nodes.residuals[3, i] = sum_over(RATES, i, nodes.moment) * over - of_moment[0]
        if i == 1:
            of_bonds = of_bound[1], of_bound[2], turn, of_moment[1], on[0], on[1]
        if law.sense != 0.0:
            nodes.residuals[3, i] = moment - law.sense * bound
            if i == 1:
                of_bonds = of_bound[1], 0.0, turn, law.sense, -1.0, 0.0
        if law.slows != 0.0:
            left = share_left(speed, law)
            nodes.residuals[2, i] = bound - left
            if i == 1:
                of_bonds = (
                    -1.0,
                    0.0,
                    -law.slows * law.sense * left * left,
                    law.sense,
                    -1.0,
                    0.0,
                )
        if i == 1:
            of_balance = by_bound * stress, area + by_moment * stress, area * viscosity
            if yields > 0.0:
                softer *= contact.area / (2.0 * math.pi * radius) * area * stress
                u_bound, u_moment = (
                    -yields * of_balance[0] - softer * by_bound,
                    -yields * of_balance[1] - softer * by_moment,
                )
                of_u = u_bound, u_moment, -yields * of_balance[2]
    return of_balance + of_u + of_bonds


@device
def _over(number):
    """Return 1/number, with a single division if it is complex."""
    return number.conjugate() * (
        1.0 / (number.real * number.real + number.imag * number.imag)
    )


@device
def _resolved(rate, slopes, slider, law):
    """Return how slip, u, N, M take away residuals of a mode of the method, in which a derivative is a ``rate``.

    With the same slopes at all nodes each mode is solved by itself (Hairer & Wanner II, IV.8). The result has
    N and M over their residuals, and over the slip; u over the slip; the slip over all residuals.
    """
    to_bound, to_moment, thick, u_bound, u_moment, u_speed = slopes[:6]
    n_bound, n_moment, n_speed, m_bound, m_moment, m_speed = slopes[6:]
    n = (rate if law.slows == 0.0 else 0.0 * rate) - n_bound
    m = (rate if law.sense == 0.0 else 0.0 * rate) - m_moment
    scale = _over(n * m - n_moment * m_bound)
    nn, nm, mn, mm = m * scale, n_moment * scale, m_bound * scale, n * scale
    n_slip, m_slip = (
        rate * (nn * n_speed + nm * m_speed),
        rate * (mn * n_speed + mm * m_speed),
    )
    u_slip = -(u_speed * rate + u_bound * n_slip + u_moment * m_slip)
    firm = slider.stiffness + rate * (slider.damping + rate * slider.mass)
    yields = _over(
        firm * (1.0 + u_slip) + rate * thick + to_bound * n_slip + to_moment * m_slip
    )
    by_n, by_m = firm * u_bound - to_bound, firm * u_moment - to_moment
    slip = (
        yields,
        -firm * yields,
        (by_n * nn + by_m * mn) * yields,
        (by_n * nm + by_m * mm) * yields,
    )
    return (nn, nm, mn, mm, n_slip, m_slip, u_slip) + slip


@device
def _correction(mode, slopes, balance, yielding, bonds, stretches):
    """Return the changes of slip, u, N and M that remove the residuals of a mode."""
    nn, nm, mn, mm, n_slip, m_slip, u_slip, by_balance, by_u, by_n, by_m = mode
    bound, moment = nn * bonds + nm * stretches, mn * bonds + mm * stretches
    slip = by_balance * balance + by_u * yielding + by_n * bonds + by_m * stretches
    sheared = yielding - slopes[3] * bound - slopes[4] * moment + u_slip * slip
    return slip, sheared, bound + n_slip * slip, moment + m_slip * slip


@inlined
def correct(modes, slopes, slider, nodes):
    """Replace the residuals at the nodes by the changes that remove them."""
    balance, yielding, bonds, stretches = (
        nodes.residuals[0],
        nodes.residuals[1],
        nodes.residuals[2],
        nodes.residuals[3],
    )
    gives = slider.yielding + slider.yielding_radius > 0.0
    real = (
        sum_over(BACK, 0, balance),
        sum_over(BACK, 0, yielding) if gives else 0.0,
        sum_over(BACK, 0, bonds),
    )
    by_real = _correction(
        modes[0], slopes, real[0], real[1], real[2], sum_over(BACK, 0, stretches)
    )
    turned = _turned(yielding) if gives else complex(0.0, 0.0)
    by_pair = _correction(
        modes[1], slopes, _turned(balance), turned, _turned(bonds), _turned(stretches)
    )
    for i in range(3):
        first, second, third = FORTH[i, 0], FORTH[i, 1], FORTH[i, 2]
        for k in range(4):
            nodes.residuals[k, i] = (
                first * by_real[k] + second * by_pair[k].real + third * by_pair[k].imag
            )


@device
def _turned(residuals):
    """Return the part of an unknown's residuals in the complex modes."""
    return complex(sum_over(BACK, 1, residuals), sum_over(BACK, 2, residuals))


#: Share of a sub-step after which the defect of the equations is measured, between the first two nodes; there values
#: and slopes of the polynomials through the nodes and the start, that of the start last.
BETWEEN = 0.4
VALUES = np.array(
    [0.915959179422654, 0.5240408205773457, -0.07999999999999999, -0.3599999999999999]
)
SLOPES = np.array(
    [-2.9760883751542693, 2.576088375154268, -0.19999999999999984, 0.5999999999999996]
)
#: Most turns of Newton's method.
_TURNS = 12
#: Slopes, and solutions of the modes, before the first ones are known.
_UNKNOWN = (0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0)
_NO_MODES = (0.0,) * 11, (0.0j,) * 11
#: Correction over the last one above which the slopes are taken anew.
_SLOW = 0.1
#: Lagrange's denominators at the nodes, the polynomial through the start as well.
_BASE = np.array(
    [1.0 / np.prod([c - d for d in (0.0, *NODES) if d != c]) for c in NODES]
)


@inlined
def _ahead(row, nodes, step, law):
    """Guess slip, u, N, M at the nodes: the last sub-step's polynomial, or the slopes at the start."""
    of_bound, of_moment, _, _, _, _ = kinetics(row.bound, row.moment, row.speed, law)
    for i in range(3):
        if nodes.last_step > 0.0:
            x = 1.0 + NODES[i] * step / nodes.last_step
            first, second = x - NODES[0], x - NODES[1]
            early = x * second * (x - 1.0) * _BASE[0]
            middle = x * first * (x - 1.0) * _BASE[1]
            last = x * first * second * _BASE[2] - 1.0
            for k in range(4):
                nodes.values[k, i] = (
                    early * nodes.past[k, 0]
                    + middle * nodes.past[k, 1]
                    + last * nodes.past[k, 2]
                )
        else:
            time = NODES[i] * step
            nodes.slip[i], nodes.sheared[i], nodes.bound[i], nodes.moment[i] = (
                row.speed * time,
                0.0,
                0.0,
                0.0,
            )
            if law.slows == 0.0:
                nodes.bound[i] = of_bound[0] * time
                nodes.moment[i] = (
                    of_moment[0] * time
                    if law.sense == 0.0
                    else law.sense * nodes.bound[i]
                )
        nodes.bound[i] = max(nodes.bound[i], -0.5 * row.bound)


@device
def newton(row, start, step, slider, law, contact, nodes):
    """Solve for slip, u, N, M at the nodes, by Newton's method with the slopes at the middle node. True if solved.

    It ends where the next correction would be small, at the pace of the last two, and
    where the equations are linear within the last one: their remainder is its square. An
    unknown that starts at zero makes the first correction so large that the pace alone
    says nothing.
    """
    _ahead(row, nodes, step, law)
    for i in range(3):
        nodes.radii[i] = row.radius
        nodes.pulls[i] = mechanics.pull_on(
            start + NODES[i] * step, start, 0.0, row, slider
        )
    bound = min(row.bound, row.bound + nodes.bound[2]) + mechanics.FEW
    moment = min(math.fabs(row.moment), math.fabs(row.moment + nodes.moment[2]))
    of_slip, of_bound = 1.0 / (law.scale + math.fabs(nodes.slip[2])), 1.0 / bound
    of_moment = 1.0 / (law.scale * bound + moment)
    before, close = math.inf, min(1e-6, 0.1 * slider.tolerance)
    slopes, shrinks = _UNKNOWN, 0.5
    modes = _NO_MODES
    for turn in range(_TURNS):
        latest = equations(row, nodes, start, step, slider, law, contact)
        if math.isnan(latest[0]):
            return False
        if shrinks > _SLOW:
            slopes = latest
            turning = complex(TURNING.real / step, TURNING.imag / step)
            modes = (
                _resolved(PACE / step, slopes, slider, law),
                _resolved(turning, slopes, slider, law),
            )
        correct(modes, slopes, slider, nodes)
        part, change = 1.0, 0.0
        for i in range(3):
            bound = row.bound + nodes.bound[i]
            if bound - nodes.residuals[2, i] < 0.1 * bound:  # N stays above zero
                part = min(part, 0.9 * bound / nodes.residuals[2, i])
        for i in range(3):
            change = max(change, math.fabs(nodes.residuals[0, i]) * of_slip)
            change = max(change, math.fabs(nodes.residuals[2, i]) * of_bound)
            change = max(change, math.fabs(nodes.residuals[3, i]) * of_moment)
            for k in range(4):
                nodes.values[k, i] -= part * nodes.residuals[k, i]
        shrinks = change / before if turn > 0 else 0.5
        pace = min(1.0, shrinks / max(1.0 - shrinks, 1e-3))
        if change * max(pace, change) <= close:
            return True
        if not (part > 0.0 and change < 1e12) or (turn > 2 and shrinks > 1.0):
            return False
        before = change
    return False


@inlined
def error_of(row, start, step, slider, law, contact, nodes):
    """Return the defect of the equations between nodes, as an error of a stretch: of order 4, over its scale.

    The polynomials through start and nodes solve the equations at the nodes alone. What is missing between them of the
    balance of forces, of N, of M and, with a mass, of the speed is taken over what resists it.
    """
    stiffness, mass, damping, viscosity = (
        slider.stiffness,
        slider.mass,
        slider.damping,
        slider.viscosity,
    )
    slip, body, bound, moment = 0.0, 0.0, row.bound, row.moment
    speed, to_bound, to_moment, going = 0.0, 0.0, 0.0, 0.0
    pace, bend = VALUES[3] * row.body_speed, SLOPES[3] * row.body_speed / step
    for j in range(3):
        at_node = 0.0
        for k in range(3):
            at_node += RATES[j, k] * (nodes.slip[k] + nodes.sheared[k]) / step
        pace += VALUES[j] * at_node
        bend += SLOPES[j] * at_node / step
        slip += VALUES[j] * nodes.slip[j]
        body += VALUES[j] * (nodes.slip[j] + nodes.sheared[j])
        going += SLOPES[j] * (nodes.slip[j] + nodes.sheared[j]) / step
        speed += SLOPES[j] * nodes.slip[j] / step
        bound += VALUES[j] * nodes.bound[j]
        moment += VALUES[j] * nodes.moment[j]
        to_bound += SLOPES[j] * nodes.bound[j]
        to_moment += SLOPES[j] * nodes.moment[j]
    time = start + BETWEEN * step
    radius, area, _, _ = mechanics.contact_area(
        bound, moment, time, nodes.radii[0], contact
    )
    if not (area >= 0.0 and bound >= 0.0):
        return math.inf
    of_bound, of_moment, on, _, _, _ = kinetics(bound, moment, speed, law)
    pace = pace if mass > 0.0 else going
    balance = area * (moment + viscosity * speed) + damping * pace + mass * bend
    balance -= mechanics.pull_on(time, start, body, row, slider)
    bears = area * bound + (damping + area * viscosity) / step + mass / (step * step)
    scale = law.scale * (bound + mechanics.FEW) + math.fabs(moment)
    if law.sense != 0.0:
        to_moment = step * of_moment[0]
    if law.slows != 0.0:
        to_bound = step * of_bound[0] + bound - share_left(speed, law)
    error = max(
        math.fabs(to_bound - step * of_bound[0])
        / (1.0 + step * math.fabs(of_bound[1]))
        / (bound + mechanics.FEW),
        math.fabs(to_moment - step * of_moment[0])
        / (1.0 + step * math.fabs(on[0]))
        / scale,
    )
    # a mass between stiff springs rings within a small part of a stretch: as a force that is no small part
    yields, _ = mechanics.compliance(radius, slider)
    # in a slip that takes no time u leaves its polynomial first
    if contact.mean_stress > 0.0:
        sheared = yields * area * (moment + viscosity * speed)
        error = max(error, math.fabs(row.sheared + body - slip - sheared) / law.scale)
    stiffest = max(stiffness, mechanics.stiffness_of(radius, slider))
    firm = (
        max(1.0, stiffest / (area * (bound + mechanics.SOME)))
        if mass > 0.0 and area > 0.0
        else 1.0
    )
    # an open contact or the last bonds bear next to nothing: then the force that is missing displaces the spring
    bears += stiffness * mechanics.FEW / (area * bound + mechanics.FEW)
    error = (
        max(error, firm * math.fabs(balance) / bears / law.scale)
        if bears > 0.0
        else error
    )
    return (
        max(error, firm * step * math.fabs(going - pace) / law.scale)
        if mass > 0.0
        else error
    )


@inlined
def try_sub_step(row, start, step, slider, law, contact, nodes):
    """Solve for a sub-step; return the length of the next over that of this one, and True if this one is accepted.

    The error is measured to order 4 where the result is of order 5 or more, so that a power of it is held to the
    tolerance. It goes with the sixth power of the length; where it has grown since the last sub-step, the same growth
    is expected of the next (Gustafsson 1994).
    """
    if not newton(row, start, step, slider, law, contact, nodes):
        return 0.25, False
    error = error_of(row, start, step, slider, law, contact, nodes)
    error *= math.sqrt(error) / slider.tolerance
    if not error < math.inf:
        return 0.25, False
    within = mechanics.within_reach(nodes.slip[2], step, row, contact)
    if within < 1.0:
        return max(0.1, 0.9 * within), False
    root = max(error, 1e-6) ** (1.0 / 6.0)
    if not error <= 1.0:
        return max(0.1, 0.9 / root), False
    grows = 0.9 / root
    if nodes.last_step > 0.0:
        grows *= min(1.0, step / nodes.last_step * nodes.last_root / root)
    nodes.last_root = max(root, 0.5)
    return min(6.0, max(0.1, grows), 0.9 * within), True


@device
def stored_with(row, area, slider, law):
    """Return the elastic and kinetic energy of spring, body, contact of some area and bonds."""
    energy = (
        0.5 * slider.mass * row.body_speed * row.body_speed
        + mechanics.contact_energy(row, area, slider)
    )
    if slider.stiffness > 0.0:
        energy += 0.5 * row.spring_force * row.spring_force / slider.stiffness
    if row.bound > 0.0 and law.sense == 0.0:
        energy += 0.5 * area * row.moment * row.moment / row.bound
    return energy


@inlined
def accept(row, start, step, slider, law, contact, nodes, energy):
    """Add a sub-step to the row: integrals of the powers by the method, state at its end.

    Return the energy stored before and after it.
    """
    damping, viscosity = slider.damping, slider.viscosity
    shift, speed, body, going, passed = 0.0, 0.0, 0.0, row.speed, 0.0
    # the speed of the polynomial there: that before a jump of the force is another
    before_node = (
        START[0] * nodes.slip[0] + START[1] * nodes.slip[1] + START[2] * nodes.slip[2]
    ) / step
    # a contact that has lost its equilibrium keeps its area until it opens
    _, first, _, _ = mechanics.area_or_last(row.bound, row.moment, start, row, contact)
    firm = mechanics.stiffness_of(row.radius, slider)
    for i in range(3):
        bound, moment, time = (
            row.bound + nodes.bound[i],
            row.moment + nodes.moment[i],
            start + NODES[i] * step,
        )
        nodes.radii[i], nodes.areas[i], _, _ = mechanics.contact_area(
            bound, moment, time, nodes.radii[i], contact
        )
        nodes.firms[i] = mechanics.stiffness_of(nodes.radii[i], slider)
    before = stored_with(row, first, slider, law)
    for i in range(3):
        bound, moment, area = (
            row.bound + nodes.bound[i],
            row.moment + nodes.moment[i],
            nodes.areas[i],
        )
        speed, body, spreads, firms = 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            speed += RATES[i, j] * nodes.slip[j] / step
            body += RATES[i, j] * (nodes.slip[j] + nodes.sheared[j]) / step
            spreads += RATES[i, j] * (nodes.areas[j] - first)
            firms += RATES[i, j] * (nodes.firms[j] - firm)
        sheared = row.sheared + nodes.sheared[i]
        pull = nodes.pulls[i] - slider.stiffness * (nodes.slip[i] + nodes.sheared[i])
        drive_speed = (
            body
            if slider.forced > 0.0
            else mechanics.driven(start + NODES[i] * step, slider)[1]
        )
        _, _, _, _, k, travel = kinetics(bound, moment, speed, law)
        square = moment * moment / bound if bound > 0.0 and law.sense == 0.0 else 0.0
        fresh = law.binding * (1.0 - bound) * square / bound if bound > 0.0 else 0.0
        share = SHARES[i] * step
        energy.work += share * pull * drive_speed
        energy.damping += share * damping * body * body
        energy.viscosity += share * area * viscosity * speed * speed
        energy.rupture += share * 0.5 * area * (square * (k + 3.0 * travel) + fresh)
        if law.sense != 0.0:
            energy.rupture += share * area * moment * speed
        energy.area -= SHARES[i] * 0.5 * (square * spreads + sheared * sheared * firms)
        duration = (NODES[i] - passed) * step
        path = mechanics.path_of(nodes.slip[i] - shift, before_node, speed, duration)
        mechanics.remember(row, path, going, speed, duration, contact)
        shift, going, passed, before_node = nodes.slip[i], speed, NODES[i], speed
    row.spring_force = nodes.pulls[2] - slider.stiffness * (
        nodes.slip[2] + nodes.sheared[2]
    )
    row.body_speed, row.speed, row.radius = body, speed, nodes.radii[2]
    row.sheared += nodes.sheared[2]
    row.bound = min(row.bound + nodes.bound[2], 1.0)
    row.moment += nodes.moment[2]
    # the last bonds, which none replaces
    if law.binding == 0.0 and law.sense == 0.0 and row.bound < mechanics.FEW:
        energy.rupture += (
            0.5 * nodes.areas[2] * row.moment * row.moment / row.bound
            if row.bound > 0.0
            else 0.0
        )
        row.bound, row.moment = 0.0, 0.0
    row.position += nodes.slip[2] + nodes.sheared[2]
    row.slip += nodes.slip[2]
    row.substeps += 1.0
    for k in range(4):
        for i in range(3):
            nodes.past[k, i] = nodes.values[k, i]
    nodes.last_step = step
    return before, stored_with(row, nodes.areas[2], slider, law)
