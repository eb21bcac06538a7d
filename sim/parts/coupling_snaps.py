"""What a slider does at once, in no time: elastic slips, snaps, and bonds that all let go, with their energies.

It serves the sub-steps of ``coupling_rows``; what takes time stands in ``coupling_step``.
"""

import math

from sim.numerics.jit import device
from sim.parts.coupling_equations import (
    BODY,
    BOUND,
    FORCE,
    MOMENT,
    PATH,
    POSITION,
    RADIUS,
    SHEARED,
    SLIP,
    SPEED,
    compliance,
    contact_area,
    driven,
    kinetics,
)
from sim.parts.coupling_step import FEW
from sim.parts.drive.driven import RUPTURE, SNAP, WORK

#: Way over the cut-off stretch on which bonds are tried, and that within which they may snap.
_TRIED, NEAR = 1e-7, 1e-3


@device
def area_kept(bound, moment, time, row, bare, held):
    """What ``contact_area`` gives for such bonds, and the area of the row where equilibrium was lost on the way."""
    radius, area, by_bound, by_moment = contact_area(bound, moment, time, row[RADIUS], bare, held)
    if area >= 0.0:
        return radius, area, by_bound, by_moment
    return row[RADIUS], math.pi * row[RADIUS] * row[RADIUS] / held[10], 0.0, 0.0


@device
def stored_in(row, bare, time, slider, law, held):
    """Elastic and kinetic energy of spring, body, contact and bonds."""
    _, area, _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    stiffness, mass, _, viscosity, _, _, _, _ = slider
    energy = 0.5 * mass * row[BODY] * row[BODY]
    energy += 0.5 * row[SHEARED] * area * (row[MOMENT] + viscosity * row[SPEED])
    if stiffness > 0.0:
        energy += 0.5 * row[FORCE] * row[FORCE] / stiffness
    if row[BOUND] > 0.0 and law[5] == 0.0:
        energy += 0.5 * area * row[MOMENT] * row[MOMENT] / row[BOUND]
    return energy


@device
def elastic(row, time, bare, slider, held, piece, energy):
    """Slip at once where the area or the force has jumped and neither mass, damping nor viscosity delays it.

    Behind a contact that yields the interface alone slips if the body cannot. What the elastic energies do not give
    back to the drive is booked to the area that has changed.
    """
    stiffness, mass, damping, viscosity, forced, _, _, _ = slider
    held_back = mass + damping > 0.0
    yields, _ = compliance(row[RADIUS], slider)
    row[FORCE] = driven(time, piece)[1] if forced > 0.0 else row[FORCE]
    if (viscosity > 0.0 and row[RADIUS] > 0.0) or (held_back and yields == 0.0):
        return True
    slip, bound, moment, way, radius, area = 0.0, row[BOUND], row[MOMENT], 0.0, row[RADIUS], 0.0
    for _ in range(40):
        radius, area, _, by_moment = contact_area(bound, moment + bound * slip, time, radius, bare, held)
        if not area >= 0.0:
            return False
        yields, _ = compliance(radius, slider)
        force = area * (moment + bound * slip)
        slope = (area + by_moment * (moment + bound * slip)) * bound
        way = 0.0 if held_back else slip + yields * force - row[SHEARED]
        over = slip + yields * force - row[SHEARED] if held_back else stiffness * way + force - row[FORCE]
        slope = 1.0 + yields * slope if held_back else stiffness * (1.0 + yields * slope) + slope
        if not slope > 0.0:
            return over == 0.0
        slip -= over / slope
        if math.fabs(over / slope) <= 1e-14 * (math.fabs(slip) + math.fabs(moment)):
            break
    moment += bound * slip
    row[MOMENT], row[SHEARED], row[RADIUS] = moment, yields * area * moment, radius
    row[POSITION] += way
    row[SLIP] += slip
    row[PATH] += math.fabs(slip)
    energy[WORK] += row[FORCE] * way if forced > 0.0 else 0.0
    row[FORCE] -= 0.0 if forced > 0.0 else stiffness * way
    return True


@device
def _lacking(way, row, time, bare, slider, law, held):
    """What the bonds lack along the pull once they have gone a way at once: force, or way where the body stays.

    Also N, M, radius, area, u then, and the way of the body.
    """
    stiffness, mass, damping, _, _, _, _, _ = slider
    left, sense = math.exp(-math.fabs(way) * law[2]), math.copysign(1.0, row[MOMENT])
    bound, moment = row[BOUND] * left, (row[MOMENT] * left + sense * row[BOUND] * (1.0 - left) / law[2]) * left
    radius, area, _, _ = contact_area(bound, moment, time, row[RADIUS], bare, held)
    yields, _ = compliance(radius, slider)
    sheared = yields * area * moment
    body = way + sheared - row[SHEARED]
    if mass + damping > 0.0:
        return -sense * body, bound, moment, radius, area, sheared, 0.0
    return sense * (row[FORCE] - stiffness * body - area * moment), bound, moment, radius, area, sheared, body


@device
def snap(row, time, reach, bare, slider, law, held, energy):
    """Slip at once to where bonds bear the pull again, if slip breaks more than it stretches; whether it does.

    That counts which does so within a ``reach`` in units of the cut-off stretch.

    The force of such bonds over the way has one hump, so that there is one such place.
    """
    if not slider[0] + slider[1] + slider[2] > 0.0:
        return False
    sense, high, limit = math.copysign(1.0, row[MOMENT]), _TRIED / law[2], 1.0 / law[2]
    here, _, _, _, first, _, _ = _lacking(0.0, row, time, bare, slider, law, held)
    lacks = _lacking(sense * high, row, time, bare, slider, law, held)[0]
    while not lacks > max(here, 0.0):
        if high > reach * limit:
            return False
        high *= 2.0
        lacks = _lacking(sense * high, row, time, bare, slider, law, held)[0]
    while lacks > 0.0:
        high *= 2.0
        lacks = _lacking(sense * high, row, time, bare, slider, law, held)[0]
    low = 0.5 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        over = _lacking(sense * middle, row, time, bare, slider, law, held)[0] > 0.0
        low, high = (middle, high) if over else (low, middle)
    _, bound, moment, radius, area, sheared, body = _lacking(sense * high, row, time, bare, slider, law, held)
    if not area >= 0.0:
        return False
    # on the way ds the share ds/l of the bonds breaks, stretched by twice the mean: 3/2 n κ M²/(N l) is lost with it
    left, mean = math.exp(-high * law[2]), sense * row[MOMENT]
    later = mean * left + row[BOUND] * limit * (1.0 - left)
    broken = 0.25 * (first + area) * (1.0 - left) * (mean * mean + mean * later + later * later) / row[BOUND]
    before = stored_in(row, bare, time, slider, law, held)
    row[BOUND], row[MOMENT], row[RADIUS], row[SHEARED] = bound, moment, radius, sheared
    row[FORCE] -= slider[0] * body
    row[POSITION] += body
    row[SLIP] += sense * high
    row[PATH] += high
    energy[RUPTURE] += broken
    energy[SNAP] += before - stored_in(row, bare, time, slider, law, held) - broken
    return True


@device
def slips_free(row, slider):
    """Whether a slip without bonds takes no time and has an end: behind a spring, or where a body stays behind."""
    yields, _ = compliance(row[RADIUS], slider)
    return slider[3] == 0.0 and (yields > 0.0 if slider[1] + slider[2] > 0.0 else slider[0] > 0.0)


@device
def free_ways(row, slider):
    """Ways of an interface without bonds, and of its body, to where nothing pulls them."""
    body = 0.0 if slider[1] + slider[2] > 0.0 else row[FORCE] / slider[0]
    return body + row[SHEARED], body


@device
def slip_free(row, time, bare, slider, held):
    """Slip at once, with next to no bonds, to where nothing pulls the interface."""
    slip, body = free_ways(row, slider)
    radius, area, _, _ = contact_area(FEW, 0.0, time, row[RADIUS], bare, held)
    row[BOUND], row[MOMENT], row[SHEARED], row[RADIUS] = FEW, 0.0, 0.0, radius if area >= 0.0 else row[RADIUS]
    row[FORCE] -= slider[0] * body
    row[POSITION] += body
    row[SLIP] += slip
    row[PATH] += math.fabs(slip)


@device
def let_go(row, time, brief, bare, slider, law, held, energy):
    """Break all bonds at once and slip, where nothing delays it, if they last less than a ``brief`` time.

    Bonds that are stretched the more the fewer are left break ever faster, all of them in no time; whether that is so.
    """
    _, _, _, _, k, _ = kinetics(row[BOUND], row[MOMENT], 0.0, law)
    if not (k * brief > 1.0 and slips_free(row, slider)):
        return False
    before = stored_in(row, bare, time, slider, law, held)
    _, area, _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    broken = 0.5 * area * row[MOMENT] * row[MOMENT] / row[BOUND]
    slip_free(row, time, bare, slider, held)
    energy[RUPTURE] += broken
    energy[SNAP] += before - stored_in(row, bare, time, slider, law, held) - broken
    return True
