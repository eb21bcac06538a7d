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
#: Weights of the nodes in a mean slope.
WEIGHTS = np.array([1.0, 1.0, 1.0]) / 3.0


def _modes() -> tuple[float, complex, Array, Array]:
    """Eigenvalues of ``RATES``, one real and one of the complex pair; matrices that lead back to nodes and from them.

    The last two columns are the real part and minus the imaginary part of the vector of the complex one.
    """
    values, vectors = np.linalg.eig(RATES)
    real, pair = int(np.argmin(np.abs(values.imag))), int(np.argmax(values.imag))
    turning = vectors[:, pair]
    forth = np.stack([vectors[:, real].real, turning.real, -turning.imag], axis=1)
    return float(values[real].real), complex(values[pair]), forth, np.linalg.inv(forth)


PACE, TURNING, FORTH, BACK = _modes()
#: Columns of a row: spring force S, speed of the body, u, N, M, speed of the interface, displacement of the body,
#: slip and path of the clock step, contact radius, next sub-step, number of sub-steps, time of a runaway, integral of
#: the squared speed of the interface over the clock step, acceleration of the interface.
FORCE, BODY, SHEARED, BOUND, MOMENT, SPEED, POSITION, SLIP, PATH, RADIUS, NEXT, COUNT, ENDED, SQUARE, BEND = range(15)
COLUMNS = 15


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
def _sum(weights, i, values, k):
    """A row of weights times what stands at the three nodes of one unknown."""
    return weights[i, 0] * values[k, 0] + weights[i, 1] * values[k, 1] + weights[i, 2] * values[k, 2]


@device
def equations(row, z, start, step, bare, slider, law, held, piece, right, radii):
    """Residuals at the three nodes for slip, u, N, M there, and their slopes, a mean over the nodes.

    ``radii``: contact radii at the nodes, which the next ones are searched from. The slopes are those of the balance of
    forces over N, M and the speed, of u over the same, of Ṅ and of Ṁ; nan where there is no equilibrium.
    """
    _, mass, damping, viscosity, _, _, _, _ = slider
    balance = bending = thickness = u_bound = u_moment = u_speed = 0.0
    n_bound = n_moment = n_speed = m_bound = m_moment = m_speed = 0.0
    for i in range(3):
        time, bound, moment = start + NODES[i] * step, row[BOUND] + z[2, i], row[MOMENT] + z[3, i]
        speed = _sum(RATES, i, z, 0) / step
        body = speed + _sum(RATES, i, z, 1) / step
        radius, area, by_bound, by_moment = contact_area(bound, moment, time, radii[i], bare, held)
        if not (bound >= 0.0 and area >= 0.0):
            return math.nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        radii[i] = radius
        stress = moment + viscosity * speed
        yields, softer = compliance(radius, slider)
        softer *= held[10] / (2.0 * math.pi * radius) * area * stress if radius > 0.0 else 0.0
        to_bound, to_moment, thick = by_bound * stress, area + by_moment * stress, area * viscosity
        right[0, i] = area * stress + damping * body - pull_on(time, start, z[0, i] + z[1, i], row, slider, piece)
        if mass > 0.0:
            bend = (_sum(BENDS, i, z, 0) + _sum(BENDS, i, z, 1)) / step - _OFF[i] * row[BODY]
            right[0, i] += mass * bend / step
        right[1, i] = row[SHEARED] + z[1, i] - yields * area * stress
        share = WEIGHTS[i]
        balance += share * to_bound
        bending += share * to_moment
        thickness += share * thick
        u_bound -= share * (yields * to_bound + softer * by_bound)
        u_moment -= share * (yields * to_moment + softer * by_moment)
        u_speed -= share * yields * thick
        if law[5] != 0.0:  # bonds without a stretch follow the speed at once
            left = share_left(speed, law)
            right[2, i], right[3, i] = bound - left, moment - law[5] * bound
            n_bound -= share
            n_speed -= share * law[6] * law[5] * left * left
            m_bound += share * law[5]
            m_moment -= share
        else:
            of_bound, of_moment, on, turn, _, _ = kinetics(bound, moment, speed, law)
            right[2, i] = _sum(RATES, i, z, 2) / step - of_bound[0]
            right[3, i] = _sum(RATES, i, z, 3) / step - of_moment[0]
            n_bound += share * of_bound[1]
            n_moment += share * of_bound[2]
            n_speed += share * turn
            m_bound += share * of_moment[1]
            m_moment += share * on[0]
            m_speed += share * on[1]
    of_bonds = n_bound, n_moment, n_speed, m_bound, m_moment, m_speed
    return balance, bending, thickness, u_bound, u_moment, u_speed, *of_bonds


@device
def resolved(rate, slopes, slider, law, balance, yielding, bonds, stretches):
    """Slip, u, N and M that take the residuals away of a mode of the method, in which a derivative is a ``rate``."""
    n_bound, n_moment, n_speed, m_bound, m_moment, m_speed = slopes[6:]
    own = rate if law[5] == 0.0 else 0.0 * rate
    n, m = own - n_bound, own - m_moment
    scale = 1.0 / (n * m - n_moment * m_bound)
    bound, moment = (m * bonds + n_moment * stretches) * scale, (m_bound * bonds + n * stretches) * scale
    by_slip = rate * scale
    bound_slip, moment_slip = (m * n_speed + n_moment * m_speed) * by_slip, (m_bound * n_speed + n * m_speed) * by_slip
    sheared = yielding - slopes[3] * bound - slopes[4] * moment
    sheared_slip = -(slopes[5] * rate + slopes[3] * bound_slip + slopes[4] * moment_slip)
    firm = slider[0] + rate * (slider[2] + rate * slider[1])
    resists = firm * (1.0 + sheared_slip) + rate * slopes[2] + slopes[0] * bound_slip + slopes[1] * moment_slip
    slip = (balance - firm * sheared - slopes[0] * bound - slopes[1] * moment) / resists
    return slip, sheared + sheared_slip * slip, bound + bound_slip * slip, moment + moment_slip * slip


@device
def correct(slopes, step, slider, law, right):
    """Replace residuals by what takes them away, slopes being the same at all nodes.

    Then the method's modes, one real and two complex, are on their own (Hairer & Wanner II, IV.8).
    """
    ahead, turned = PACE / step, complex(TURNING.real / step, TURNING.imag / step)
    real = _sum(BACK, 0, right, 0), _sum(BACK, 0, right, 1), _sum(BACK, 0, right, 2), _sum(BACK, 0, right, 3)
    slip, sheared, bound, moment = resolved(ahead, slopes, slider, law, *real)
    pair = (
        complex(_sum(BACK, 1, right, 0), _sum(BACK, 2, right, 0)),
        complex(_sum(BACK, 1, right, 1), _sum(BACK, 2, right, 1)),
        complex(_sum(BACK, 1, right, 2), _sum(BACK, 2, right, 2)),
        complex(_sum(BACK, 1, right, 3), _sum(BACK, 2, right, 3)),
    )
    slips, sheareds, bounds, moments = resolved(turned, slopes, slider, law, *pair)
    for i in range(3):
        first, real_part, other = FORTH[i, 0], FORTH[i, 1], FORTH[i, 2]
        right[0, i] = first * slip + real_part * slips.real + other * slips.imag
        right[1, i] = first * sheared + real_part * sheareds.real + other * sheareds.imag
        right[2, i] = first * bound + real_part * bounds.real + other * bounds.imag
        right[3, i] = first * moment + real_part * moments.real + other * moments.imag
