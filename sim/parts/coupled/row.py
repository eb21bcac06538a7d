"""Row of slider and bonds in the units of a step; the contact that it stands on; elastic slips that take no time."""

import math
from typing import NamedTuple

from sim.numerics.jit import device
from sim.parts.drive import STORED, WORK

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
    """Numbers of the bonds: k0, its growth with the stretch (1 or 0), 1/cut-off stretch, k_on, scale of a stretch.

    Bonds without a stretch have the ``sense`` of the sliding, 1 or -1, else 0; those that follow the speed at once a
    share 1/(1 + ``slows`` speed).
    """

    rate: float
    softness: float
    cuts: float
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
def _missing(a, load, base, stiffness, curvature, modulus):
    """Depth of a contact of Hertz of this radius beyond what holds the sphere, and its slope over the radius."""
    hertz = a * a * curvature
    if stiffness == math.inf:
        return hertz - base, 2.0 * a * curvature
    series = stiffness + 2.0 * modulus * a
    missing = (stiffness * (hertz - base) + 4.0 / 3.0 * modulus * a * hertz - load) / series
    return missing, (2.0 * stiffness * a * curvature + 4.0 * modulus * hertz - 2.0 * modulus * missing) / series


@device
def contact_area(bound, moment, time, radius, bare, held):
    """Contact radius in equilibrium with these bonds, area over the reference's, its slopes over N and M.

    Newton's method on the energy release rate, convex in the radius, from the last one: from the right of the root
    it goes left. nan where there is none; Hertz's radius where adhesion does not pay for the mean stress there.
    """
    stays, bonded, taken, load, load_rate, base, base_rate, stiffness, curvature, modulus, unit = held
    if stays > 0.0:
        return radius, math.pi * radius * radius / unit, 0.0, 0.0
    work, tilt = bare + bonded * bound, taken * moment * moment
    load, base = load + load_rate * time, base + base_rate * time
    a, slope = radius, 1.0
    if work > 0.0 and tilt > 0.0 and load + base > 0.0:  # the edge can pull, not push
        for _ in range(60):
            missing, growth = _missing(a, load, base, stiffness, curvature, modulus)
            a -= min(missing / growth, 0.5 * a)
            if math.fabs(missing) <= 1e-14 * growth * a:
                break
        if not work - tilt * a > 0.0:
            return a, math.pi * a * a / unit, 0.0, 0.0
        a = max(a, radius)
    for _ in range(60):
        missing, growth = _missing(a, load, base, stiffness, curvature, modulus)
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


#: Shares of sites bound below which their relative error is no matter, and below which forces are those of so many.
FEW, SOME = 1e-12, 0.1
#: Share of a clock step below which a sub-step means that there is no solution to go on with.
LEAST = 1e-13
MOST_STEPS = 2_000_000


@device
def later(held, time, stays):
    """The contact's numbers some time later, its radius as it is from there on if it ``stays``."""
    _, bonded, taken, load, load_rate, base, base_rate, stiffness, curvature, modulus, area = held
    load, base = load + load_rate * time, base + base_rate * time
    return stays, bonded, taken, load, load_rate, base, base_rate, stiffness, curvature, modulus, area


@device
def take_up(row, energy, given, gained, units, work):
    """Lay out a row and its energies for a clock step, in the units of the equations."""
    for c in range(COLUMNS):
        row[c] = given[c] / units[c]
    row[POSITION], row[SLIP], row[PATH], row[SQUARE], row[COUNT] = 0.0, 0.0, 0.0, 0.0, 0.0
    energy[:] = 0.0
    energy[STORED] = gained[STORED] / work


@device
def put_down(row, energy, given, gained, units, work, passed, spent):
    """Take back a row and its energies after a clock step, and write what has been reached."""
    position, count = given[POSITION], given[COUNT]
    for c in range(COLUMNS):
        given[c] = row[c] * units[c]
    given[POSITION] += position
    given[COUNT] += count
    for c in range(COLUMNS):
        passed[c] = given[c]
    for c in range(STORED):
        gained[c] += energy[c] * work
    gained[STORED] = energy[STORED] * work
    spent[:] = gained


@device
def area_kept(bound, moment, time, row, bare, held):
    """What ``contact_area`` gives for such bonds, and the area of the row where equilibrium was lost on the way."""
    radius, area, by_bound, by_moment = contact_area(bound, moment, time, row[RADIUS], bare, held)
    if area >= 0.0:
        return radius, area, by_bound, by_moment
    return row[RADIUS], math.pi * row[RADIUS] * row[RADIUS] / held[10], 0.0, 0.0


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
