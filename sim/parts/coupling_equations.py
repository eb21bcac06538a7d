"""Equations of slider and bonds at the nodes of Radau IIA, order 5, with positions as the unknowns.

In units of a stretch b, of the force n κ b A0 that all sites bear at it over a reference area A0, and of the time
as it is, body X (mass m, damping c) and interface X_s = X − u obey

    m Ẍ = S − c Ẋ − F,   F = A (M + η Ẋ_s),   u = F/k_t,   Ṡ = K (V − Ẋ) or S = Q(t),
    Ṅ = k_on (1 − N) − N (k + |Ẋ_s|/l),   Ṁ = N Ẋ_s − M (k + 2|Ẋ_s|/l),   k = k0 exp(|M/N|),

and the area A is that of the equilibrium contact with the work of adhesion that these bonds leave. Slip, u, N and M
at the three nodes are the unknowns, found by Newton's method; speeds and accelerations follow from the positions by
the method itself. So the equations are solved as they stand, whether mass, damping, viscosity and 1/k_t are zero
(then they are of index 2) or not, and a stiff spring costs no steps.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device

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
#: Columns of a row: spring force S, speed of the body, u, N, M, speed of the interface, displacement of the body,
#: slip and path of the clock step, contact radius, next sub-step, number of sub-steps, time of a runaway.
FORCE, BODY, SHEARED, BOUND, MOMENT, SPEED, POSITION, SLIP, PATH, RADIUS, NEXT, COUNT, ENDED = range(13)
COLUMNS = 13


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
    """Numbers of the bonds: k0, its growth with the stretch (1 or 0), cut-off stretch, k_on, scale of a stretch.

    Bonds without a stretch have the ``sense`` of the sliding, 1 or -1, else 0, and a share 1/(1 + ``slows`` speed).
    """

    rate: float
    softness: float
    limit: float
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
def contact_area(bound, moment, time, radius, bare, held):
    """Contact radius in equilibrium with these bonds, area over the reference's, its slopes over N and M.

    Newton's method on the energy release rate, convex in the radius, from the last one: from the right of the root
    it goes left. nan where there is none.
    """
    stays, bonded, taken, load, load_rate, base, base_rate, stiffness, curvature, modulus, unit = held
    if stays > 0.0:
        return radius, math.pi * radius * radius / unit, 0.0, 0.0
    work, tilt = bare + bonded * bound, taken * moment * moment
    load, base = load + load_rate * time, base + base_rate * time
    a, slope = radius, 1.0
    for _ in range(60):
        hertz = a * a * curvature
        if stiffness == math.inf:
            missing, growth = hertz - base, 2.0 * a * curvature
        else:
            series = stiffness + 2.0 * modulus * a
            missing = (stiffness * (hertz - base) + 4.0 / 3.0 * modulus * a * hertz - load) / series
            growth = (2.0 * stiffness * a * curvature + 4.0 * modulus * hertz - 2.0 * modulus * missing) / series
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
    rate, softness, limit, binding, _, _, _ = law
    stretch = moment / bound if bound > 0.0 else 0.0
    k = rate * math.exp(min(softness * math.fabs(stretch), 690.0))
    steeper = math.copysign(k * softness, stretch)
    travel, turn = math.fabs(speed) / limit, math.copysign(1.0 / limit, speed)
    to_bound = binding * (1.0 - bound) - (k + travel) * bound, -binding - k - travel + steeper * stretch, -steeper
    to_moment = bound * speed - (k + 2.0 * travel) * moment, speed + steeper * stretch * stretch
    moment_turn = -(k + 2.0 * travel) - steeper * stretch, bound - 2.0 * turn * moment
    return to_bound, to_moment, moment_turn, -turn * bound, k, travel


@device
def share_left(speed, law):
    """Bonds over those of rest of bonds without a stretch, continued smoothly through a speed of zero."""
    return 1.0 / (1.0 + law[6] * law[5] * speed)


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
def solve(matrix, right):
    """Gaussian elimination in place with row exchange; whether there is a solution, which replaces ``right``."""
    n = right.size
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if math.fabs(matrix[i, k]) > math.fabs(matrix[best, k]):
                best = i
        if not math.fabs(matrix[best, k]) > 0.0:
            return False
        if best != k:
            for j in range(k, n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, n):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k + 1, n):
                    matrix[i, j] -= share * matrix[k, j]
                right[i] -= share * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
    return True


@device
def equations(row, z, start, step, bare, slider, law, held, piece, right, matrix):
    """Residuals and their matrix at the three nodes for slip, u, N, M there; whether there are any."""
    _, mass, damping, viscosity, _, _, _, _ = slider
    matrix[:] = 0.0
    for i in range(3):
        time, b = start + NODES[i] * step, 4 * i
        slip, body, bend, bound, moment = (
            0.0,
            0.0,
            -_OFF[i] * row[BODY] / step,
            row[BOUND] + z[2, i],
            row[MOMENT] + z[3, i],
        )
        for j in range(3):
            slip += RATES[i, j] * z[0, j] / step
            body += RATES[i, j] * (z[0, j] + z[1, j]) / step
            bend += BENDS[i, j] * (z[0, j] + z[1, j]) / (step * step)
        if not bound >= 0.0:
            return False
        radius, area, by_bound, by_moment = contact_area(bound, moment, time, row[RADIUS], bare, held)
        if not area >= 0.0:
            return False
        of_bound, of_moment, on, turn, _, _ = kinetics(bound, moment, slip, law)
        stress = moment + viscosity * slip
        to_bound, to_moment, thick = by_bound * stress, area + by_moment * stress, area * viscosity
        yields, softer = compliance(radius, slider)
        softer *= held[10] / (2.0 * math.pi * radius) if radius > 0.0 else 0.0
        pull = pull_on(time, start, z[0, i] + z[1, i], row, slider, piece)
        right[b] = area * stress + damping * body + mass * bend - pull
        right[b + 1] = row[SHEARED] + z[1, i] - yields * area * stress
        right[b + 2] = -step * of_bound[0]
        right[b + 3] = -step * of_moment[0]
        matrix[b, b] += slider[0]
        matrix[b, b + 1] += slider[0]
        matrix[b, b + 2] += to_bound
        matrix[b, b + 3] += to_moment
        matrix[b + 1, b + 1] += 1.0
        matrix[b + 1, b + 2] -= yields * to_bound + softer * by_bound * area * stress
        matrix[b + 1, b + 3] -= yields * to_moment + softer * by_moment * area * stress
        matrix[b + 2, b + 2] -= step * of_bound[1]
        matrix[b + 2, b + 3] -= step * of_bound[2]
        matrix[b + 3, b + 2] -= step * of_moment[1]
        matrix[b + 3, b + 3] -= step * on[0]
        for j in range(3):
            d, rate = 4 * j, RATES[i, j]
            heavy = damping * rate / step + mass * BENDS[i, j] / (step * step)
            right[b + 2] += rate * z[2, j]
            right[b + 3] += rate * z[3, j]
            matrix[b, d] += heavy + thick * rate / step
            matrix[b, d + 1] += heavy
            matrix[b + 1, d] -= yields * thick * rate / step
            matrix[b + 2, d + 2] += rate
            matrix[b + 3, d + 3] += rate
            matrix[b + 2, d] -= turn * rate
            matrix[b + 3, d] -= on[1] * rate
        if law[5] != 0.0:  # bonds without a stretch follow the speed at once
            share = share_left(slip, law)
            right[b + 2], right[b + 3] = bound - share, moment - law[5] * bound
            matrix[b + 2 : b + 4, :] = 0.0
            matrix[b + 2, b + 2], matrix[b + 3, b + 2], matrix[b + 3, b + 3] = 1.0, -law[5], 1.0
            for j in range(3):
                matrix[b + 2, 4 * j] = law[6] * law[5] * share * share * RATES[i, j] / step
    return True
