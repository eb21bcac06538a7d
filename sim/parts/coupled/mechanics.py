"""Mechanics of slider and contact in the units of a step: their records, the contact area, slips that take no time."""

import math
from typing import NamedTuple

from sim.laws.equilibrium import largest_radius, stress_reach
from sim.laws.layer import shear_functions
from sim.numerics.jit import device
from sim.parts.drive import ENERGY
from sim.parts.exchange import Array, FieldLaw, record
from sim.parts.shear.process import remembered, unsteadiness

#: Row of slider and bonds: spring force S, speed of the body, u, N, M, speed of the interface, displacement of the
#: body, slip and path of the clock step, contact radius, next sub-step, number of sub-steps, times at which stability
#: was lost and from which on the motion is not resolved, acceleration of the interface. Then ``Memory``, and the path
#: of the clock step up to which it reaches; the share of ΔΓ that adhesion pays, the energy it pays in the sub-steps,
#: and that after the draw at the start of the clock step. Then the work since the start of the run, the energy that
#: is missing, and the time: at the start of the clock step. Last 1 if the contact has pulled off before, if it has
#: closed at the end of the step before, and if it was lost within the clock step, else 0.
ROW = record(
    "spring_force body_speed sheared bound moment speed position slip path radius "
    "next_step substeps runaway_time unresolved_time acceleration "
    "weight mean spread renewed energy recalled paid felt drawn worked missed elapsed "
    "parted closed lost"
)
COLUMNS = len(ROW.names or ())
SLIP, RADIUS = (ROW.names or ()).index("slip"), (ROW.names or ()).index("radius")
ENERGIES = len(ENERGY.names or ())
_STORED = (ENERGY.names or ()).index("stored")
#: Types of ``Inputs``, of the numbers of slider, bonds, contact and fluctuations, and of rows and energies at the end
#: of each step.
ARGUMENTS = (
    "Tuple((float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], float64)), "
    "Tuple((UniTuple(float64, 13), UniTuple(float64, 7), UniTuple(float64, 13), UniTuple(float64, 7))), "
    "Tuple((float64[:, :, ::1], float64[:, :, ::1]))"
)


class Slider(NamedTuple):
    """Numbers of a drive during a piece: its length, the value prescribed at both ends, and the integral of it.

    Then K, m, c, η, 1 if the force is prescribed, 1/k_t as constant + slope/a, 1/h of a layer, tolerance.
    """

    length: float
    first: float
    last: float
    integral: float
    stiffness: float
    mass: float
    damping: float
    viscosity: float
    forced: float
    yielding: float
    yielding_radius: float
    inverse_thickness: float
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


class Contact(NamedTuple):
    """Numbers of the contact: work of adhesion without bonds; load and base with their rates; 1 if its radius stays.

    Then work of adhesion per bond share N; energy that the mean stress takes, over radius and M²; stiffness behind the
    base; curvature, modulus and inverse thickness of the bodies, reference area; energy that fluctuations take, with
    its rate; numbers of the fluctuations.
    """

    bare: float
    load: float
    load_rate: float
    base: float
    base_rate: float
    stays: float
    bonded: float
    mean_stress: float
    stiffness: float
    curvature: float
    modulus: float
    inverse_thickness: float
    area: float
    fluctuating: float
    fluctuating_rate: float
    field: FieldLaw


class Inputs(NamedTuple):
    """State and course of some clock steps, for all rows.

    ``rows`` and ``energies`` have the columns of ``ROW`` and ``ENERGY`` and are advanced in place. ``pieces``: number
    of the clock step, then the first four of ``Slider``. ``clock``: beginning of each step, load and its rate, base and
    its rate, duration. ``units`` of the columns and of ``work``: the equations have none.
    """

    rows: Array
    energies: Array
    pieces: Array
    clock: Array
    units: Array
    work: float


@device
def contact_area(bound, moment, time, radius, contact):
    """Return the contact radius in equilibrium with these bonds, area over the reference's, its slopes over N and M.

    The search begins at a ``radius``, the last one. The result is nan if there is no equilibrium, as for an open
    contact, and the Hertz radius if adhesion is too weak for the mean stress there.
    """
    unit, tilt = contact.area, contact.mean_stress * moment * moment
    if contact.stays > 0.0:
        return radius, math.pi * radius * radius / unit, 0.0, 0.0
    fluctuating = contact.fluctuating + contact.fluctuating_rate * time
    load = contact.load + contact.load_rate * time
    base = contact.base + contact.base_rate * time
    a, slope = largest_radius(
        radius,
        contact.bare - fluctuating + contact.bonded * bound,
        tilt,
        (load, base, contact.stiffness),
        (contact.curvature, contact.modulus, contact.inverse_thickness),
    )
    if not a > 0.0:
        return math.nan, math.nan, 0.0, 0.0
    growth = 2.0 * math.pi * a / unit / slope
    reach, _ = stress_reach(a, contact.inverse_thickness)
    by_moment = -2.0 * growth * contact.mean_stress * moment * reach
    return a, math.pi * a * a / unit, growth * contact.bonded, by_moment


@device
def compliance(radius, slider):
    """Return 1/k_t of the contact and its slope over the radius; both are 0 if it is open, as nothing shears it."""
    if not radius > 0.0:
        return 0.0, 0.0
    if slider.yielding_radius == 0.0:
        return slider.yielding, 0.0
    shear = slider.yielding_radius / radius
    if slider.inverse_thickness <= 0.0:
        return slider.yielding + shear, -slider.yielding_radius / (radius * radius)
    m, m_slope, _, _ = shear_functions(radius * slider.inverse_thickness)
    slope = shear * (m_slope * slider.inverse_thickness - m / radius)
    return slider.yielding + shear * m, slope


@device
def stiffness_of(radius, slider):
    """Return k_t of the contact, or 0 if the contact does not yield."""
    yields, _ = compliance(radius, slider)
    return 1.0 / yields if yields > 0.0 else 0.0


@device
def softening(slope, radius, by_moment, contact):
    """Return the slope of 1/k_t over M from that over the radius and that of the area."""
    return (
        slope * by_moment * contact.area / (2.0 * math.pi * radius)
        if by_moment != 0.0
        else 0.0
    )


@device
def driven(time, slider):
    """Return the integral of a prescribed value from the start of its piece, a cubic in time, and the value."""
    length, first, last, integral = (
        slider.length,
        slider.first,
        slider.last,
        slider.integral,
    )
    share = time / length
    cubic = (first + last) * length - 2.0 * integral
    square = integral - first * length - cubic
    value = first + (2.0 * square + 3.0 * cubic * share) * share / length
    return first * time + (square + cubic * share) * share * share, value


@device
def pull_on(time, start, shift, row, slider):
    """Return the spring force after a displacement ``shift`` of the body since ``start``, or the prescribed force."""
    if slider.forced > 0.0:
        return driven(time, slider)[1]
    return row.spring_force + slider.stiffness * (
        driven(time, slider)[0] - driven(start, slider)[0] - shift
    )


#: Shares of sites bound below which their relative error is no matter, and below which forces are those of so many.
FEW, SOME = 1e-12, 0.1
#: Share of a clock step below which a sub-step means that there is no solution to go on with.
LEAST = 1e-13
#: Slip in a sub-step over the length that fluctuations remember; difference of speeds that are one; time of a slip at
#: once, over the piece's.
_MOST_SLID, _STEADY, _NO_TIME = 0.5, 1e-3, 1e-6
#: Path over the length of a memory with which the memory begins.
_FIRST_PATH = 1e-9
#: Share of the error of the last estimates of ΔΓ that a sub-step corrects, over its part of the memory.
_CORRECTED = 4.0
#: Turns after which the progress of a loop over sub-steps is judged, and the share of a piece that is too little then.
_TURNS, _PROGRESS = 2_000_000, 1e-4


@device
def contact_of(numbers):
    """Return the numbers of the contact, without load and base of the mount."""
    return Contact(*numbers[2], 0.0, 0.0, FieldLaw(*numbers[3]))


@device
def contact_at(contact, clock, row):
    """Return the numbers of the contact from the beginning of a clock step on; an open one stays open during it."""
    row.elapsed, row.lost = clock[0], 0.0
    is_open = not row.radius > 0.0
    if is_open:
        row.radius = 0.0
    stays = 1.0 if is_open else contact.stays
    return Contact(
        contact.bare, clock[1], clock[2], clock[3], clock[4], stays, *contact[6:]
    )


@device
def later(contact, time, stays):
    """Return the numbers of the contact some time later; its radius is fixed from there on if it ``stays``."""
    load, base = (
        contact.load + contact.load_rate * time,
        contact.base + contact.base_rate * time,
    )
    fluctuating = contact.fluctuating + contact.fluctuating_rate * time
    of_mount = load, contact.load_rate, base, contact.base_rate
    return Contact(
        contact.bare,
        *of_mount,
        stays,
        *contact[6:13],
        fluctuating,
        contact.fluctuating_rate,
        contact.field,
    )


@device
def _fluctuating_by(contact, energy, rate):
    """Return the numbers of the contact with another energy of the fluctuations, and its rate."""
    return Contact(*contact[:13], energy, rate, contact.field)


@device
def feeling(contact, row):
    """Return the numbers of the contact with the energy of the fluctuations that the row has reached."""
    return _fluctuating_by(contact, row.felt, 0.0)


@device
def drawn(contact, row, piece):
    """Return the numbers of the contact at the start of a piece: at that of a clock step ΔΓ has been drawn."""
    fluctuating = row.drawn if piece == 0 else row.felt
    return _fluctuating_by(contact, fluctuating, 0.0)


@device
def _after(row, path, duration, spread, field):
    """Return the memory of the amplitude after a part of a sub-step, and g² before and after it."""
    before = row.weight, row.mean, row.spread
    after = remembered(before, path, duration, spread, field.length)
    first, last = (
        unsteadiness(before[0], before[1], before[2]),
        unsteadiness(after[0], after[1], after[2]),
    )
    return (
        after,
        field.floor + (1.0 - field.floor) * first,
        field.floor + (1.0 - field.floor) * last,
    )


@device
def following(contact, row, start, step):
    """Return the numbers of the contact for a sub-step, in which it follows the conditional mean of ΔΓ.

    Its change in the sub-step is estimated by the speed at the start. It is linear in time, so that the slip of the
    sub-step does not act on it. The error of the last estimates is corrected by a share that grows with the sub-step:
    a correction in next to no time would be a jump.
    """
    field = contact.field
    if field.follows == 0.0:
        return contact
    path = math.fabs(row.speed) * step
    exponent = 2.0 * (field.by_slip * path + field.by_time * step)
    lost, share = (
        -math.expm1(-exponent),
        min(1.0, _CORRECTED * (exponent + path / field.length)),
    )
    _, first, last = _after(row, path, step, 0.0, field)
    renewed, first, last = (
        (0.5 * (first + last), 1.0, 1.0) if field.relaxing > 0.0 else (1.0, first, last)
    )
    mean, change = (
        row.paid * first * row.energy,
        lost * (renewed * field.energy - row.energy),
    )
    rate = (
        row.paid * last * (row.energy + change) - mean + share * (mean - row.felt)
    ) / step
    return _fluctuating_by(contact, row.felt - rate * start, rate)


@device
def within_reach(slip, step, row, contact):
    """Return the slip that a sub-step may have for the memory of the fluctuations, over that which it has.

    A memory of one speed alone is exact in a sub-step of that speed, however far it goes.
    """
    field, slip = contact.field, math.fabs(slip)
    is_steady = unsteadiness(row.weight, row.mean, row.spread) < _STEADY * _STEADY
    is_steady = is_steady and math.fabs(slip / step - row.mean) < _STEADY * row.mean
    shortest = max(0.0 if is_steady else 1.0 / field.length, field.by_slip)
    return _MOST_SLID / (slip * shortest) if slip > 0.0 else math.inf


@device
def path_of(slip, first_speed, last_speed, duration):
    """Return the path of a slip in some time, in which the speed is a parabola in time with these ends.

    It is longer than the slip if the speed changes its sign on the way, as that of a body which rings.
    """
    bend = 3.0 * (2.0 * slip - (first_speed + last_speed) * duration)
    linear, start = (last_speed - first_speed) * duration + bend, first_speed * duration
    # the speed is start + linear s - bend s² at a share s of the time, over it
    path, before = 0.0, 0.0
    under = linear * linear + 4.0 * bend * start
    if under > 0.0:
        root = 0.5 * (linear + math.copysign(math.sqrt(under), linear))
        one, two = root / bend if bend != 0.0 else 1.0, -start / root
        for turn in (min(one, two), max(one, two)):
            if 0.0 < turn < 1.0:
                at = turn * (start + turn * (0.5 * linear - turn * bend / 3.0))
                path += math.fabs(at - before)
                before = at
    return path + math.fabs(slip - before)


@device
def remember(row, path, first_speed, last_speed, duration, contact):
    """Add a part of an accepted sub-step, between two of its nodes, to path and memory of the fluctuations.

    In it the speed is a parabola in time, and g² is linear in the path. Slip that took no time since the last part
    belongs to it.
    """
    field = contact.field
    row.path += path
    row.felt += contact.fluctuating_rate * duration
    if field.length == math.inf:
        return
    sliding = row.path - row.recalled
    change = math.fabs(last_speed) - math.fabs(first_speed)
    bend = 0.5 * (math.fabs(first_speed) + math.fabs(last_speed)) - path / duration
    spread = duration * (change * change / 12.0 + bend * bend / 5.0)
    after, first, last = _after(row, sliding, duration, spread, field)
    row.weight, row.mean, row.spread = after
    row.recalled = row.path
    exponent = 2.0 * (field.by_slip * sliding + field.by_time * duration)
    lost = -math.expm1(-exponent)
    size = lost
    if field.relaxing > 0.0:
        of_first = lost / exponent - (1.0 - lost) if exponent > 0.0 else 0.0
        size = first * of_first + last * (lost - of_first)
    row.renewed += size - lost * row.renewed
    row.energy += size * field.energy - lost * row.energy


@device
def _has_slipped(row, contact):
    """True if the memory of the fluctuations holds any slip, or if fluctuations need none."""
    field = contact.field
    return (
        row.mean > 0.0
        or field.follows == 0.0
        or field.relaxing > 0.0
        or field.length == math.inf
    )


@device
def leaving_rest(contact, row):
    """Return the numbers of the contact at the first slip of all, however short.

    The amplitude of fluctuations that remember slip alone jumps there from its floor to its largest, because all of
    the remembered path is new.
    """
    if _has_slipped(row, contact):
        return contact
    row.felt = row.paid * row.energy
    return feeling(contact, row)


@device
def remember_first(row, slider, contact):
    """Begin the memory of the fluctuations with a slip that is next to nothing; False if it takes too long for that.

    A slip that begins slowly begins the memory in its sub-steps.
    """
    if _has_slipped(row, contact):
        return True
    path, speed = _FIRST_PATH * contact.field.length, math.fabs(row.speed)
    if not path < _NO_TIME * slider.length * speed:
        return False
    before = row.weight, row.mean, row.spread
    row.weight, row.mean, row.spread = remembered(
        before, path, path / speed, 0.0, contact.field.length
    )
    return True


@device
def settled(contact, row, slider):
    """Return the numbers of the contact at the end of a clock step.

    Slip that took no time there is added to the memory of the fluctuations as if it took next to none.
    """
    contact = feeling(contact, row)
    if row.path > row.recalled:
        remember(row, 0.0, 0.0, 0.0, _NO_TIME * slider.length, contact)
    return contact


@device
def slider_in(slider, piece):
    """Return the numbers of the drive during a piece of a clock step."""
    return Slider(piece[1], piece[2], piece[3], piece[4], *slider[4:])


@device
def next_step(row, left, length, most):
    """Return the next sub-step: at most ``most``, and all or at most half of what is ``left`` of a piece."""
    step = min(row.next_step if row.next_step > 0.0 else 1e-3 * length, most)
    return left if step > 0.999 * left else min(step, 0.5 * left)


@device
def displace(row, slip, body, slider):
    """Move the interface and the body at once against the spring."""
    row.spring_force -= slider.stiffness * body
    row.position += body
    row.slip += slip
    row.path += math.fabs(slip)


@device
def judged(turns, checked, start, length):
    """Return the turns of a loop over sub-steps since its progress was judged, and the time reached then.

    The number of sub-steps in a piece has no limit. The turns are negative if the loop hardly advances: at its pace a
    piece would take more than ``_TURNS / _PROGRESS`` turns, which takes hours or never ends.
    """
    if turns < _TURNS:
        return turns + 1, checked
    return (0 if start - checked > _PROGRESS * length else -1), start


@device
def pieces_to(step, start, pieces):
    """Return the end of the pieces of a clock step that begin at ``start``."""
    stop = start
    while stop < len(pieces) and pieces[stop, 0] == step:
        stop += 1
    return stop


@device
def retained(energy):
    """Return the work less all that is dissipated."""
    return (
        energy.work
        - energy.damping
        - energy.viscosity
        - energy.rupture
        - energy.snaps
        - energy.area
    )


@device
def to_units(columns, spent, state, totals, units, work):
    """Convert a row and its energies to the units of the equations, at the start of a clock step."""
    # loops, because array expressions fetch memory
    for i in range(len(columns)):
        columns[i] = state[i] / units[i]
    row = columns.view(ROW)[0]
    row.position, row.slip, row.path, row.recalled, row.renewed, row.substeps = (
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
        0.0,
    )
    spent[:] = 0.0
    spent[_STORED] = totals[_STORED] / work
    total = totals.view(ENERGY)[0]
    row.worked, row.missed = (
        total.work / work,
        (retained(total) - (total.stored - total.first)) / work,
    )


@device
def from_units(columns, spent, state, totals, units, work, pieces, stiffness):
    """Convert a row and its energies from the units of the equations, after a clock step of some ``pieces``.

    The displacement of a body that goes farther than its spring is stretched follows from stage and spring, because a
    sum over millions of sub-steps rounds. That of a body that hardly moves is the sum, which has no difference.
    """
    before, row = state.view(ROW)[0], columns.view(ROW)[0]
    position, substeps, units_of = before.position, before.substeps, units.view(ROW)[0]
    if stiffness > 0.0 and math.fabs(row.position) * stiffness > math.fabs(
        row.spring_force
    ):
        lengthened = (
            row.spring_force - before.spring_force / units_of.spring_force
        ) / stiffness
        row.position = pieces[:, 4].sum() - lengthened
    for i in range(len(columns)):
        state[i] = columns[i] * units[i]
    before.position += position
    before.substeps += substeps
    for i in range(_STORED):
        totals[i] += spent[i] * work
    totals[_STORED] = spent[_STORED] * work


@device
def has_ended(row):
    """True if the motion of a row has lost stability or is not resolved any longer."""
    return not (math.isnan(row.runaway_time) and math.isnan(row.unresolved_time))


@device
def end(row, spent, time, slider):
    """End the motion of a row at a time; bonds and contact stay as they are.

    A slider loses stability only under a prescribed force, and only if neither mass, damping nor the viscosity of a
    closed contact limits its speed. In all other scenes the equations have a solution, which has not been found.
    """
    is_limited = slider.mass + slider.damping > 0.0 or (
        slider.viscosity > 0.0 and row.radius > 0.0
    )
    if slider.forced > 0.0 and not is_limited:
        row.runaway_time = time
    else:
        row.unresolved_time = time
    row.position, row.speed, row.body_speed = math.nan, math.nan, math.nan
    spent[:] = math.nan


@device
def area_or_last(bound, moment, time, row, contact):
    """Return ``contact_area`` for these bonds; if there is no equilibrium, radius and area of the row."""
    radius, area, by_bound, by_moment = contact_area(
        bound, moment, time, row.radius, contact
    )
    if area >= 0.0:
        return radius, area, by_bound, by_moment
    return row.radius, math.pi * row.radius * row.radius / contact.area, 0.0, 0.0


#: Share of a missing slip that is tried first; shares of the mean stretch within which a force that falls is looked
#: for; places at which the power of a slip at once is taken.
_GUESS, _TRIED, _REACH, _PARTS = 1e-6, 1e-7, 1e-3, 128


@device
def _missing_slip(slip, row, time, slider, contact):
    """Return the force of the contact beyond that of the bonds, times 1/k_t, after a slip at once.

    The body stays and no bond breaks. Also return 1/k_t, the sum of the stretches, u, radius and area then.
    """
    moment = row.moment + row.bound * slip
    radius, area, _, _ = contact_area(row.bound, moment, time, row.radius, contact)
    yields, _ = compliance(radius, slider)
    sheared = yields * area * moment
    return row.sheared - slip - sheared, yields, moment, sheared, radius, area


@device
def slip_from(first, row, time, slider, contact):
    """Slip at once ahead of a body that stays, from a first slip on to where forces balance; True if possible.

    Also return the energy that the slip dissipates, that of ever less viscosity, and the area then.
    """
    sense, low, high, lost = math.copysign(1.0, first), 0.0, math.fabs(first), 0.0
    while sense * _missing_slip(sense * high, row, time, slider, contact)[0] > 0.0:
        low, high = high, 2.0 * high
    for _ in range(60):
        middle = 0.5 * (low + high)
        goes_on = (
            sense * _missing_slip(sense * middle, row, time, slider, contact)[0] > 0.0
        )
        low, high = (middle, high) if goes_on else (low, middle)
    slip = sense * high
    _, _, moment, sheared, radius, area = _missing_slip(
        slip, row, time, slider, contact
    )
    if not area >= 0.0:
        return False, 0.0, area
    for i in range(_PARTS):
        missing, yields, _, _, _, _ = _missing_slip(
            (i + 0.5) / _PARTS * slip, row, time, slider, contact
        )
        lost += missing / yields * slip / _PARTS
    row.moment, row.sheared, row.radius = moment, sheared, radius
    displace(row, slip, 0.0, slider)
    return True, lost, area


@device
def snap(row, square, time, slider, contact, energy):
    """Slip at once where the force of the bonds is about to fall, as adhesion pays for their stress. True if so.

    The area shrinks with the stress down to that of a Hertzian contact, and comes back with less of it. ``square``: sum
    of the squared stretches. No bond breaks in a slip that nothing delays.
    """
    here, yields, moment, _, _, area = _missing_slip(0.0, row, time, slider, contact)
    stretch, stored, slid = (
        moment / row.bound,
        area * (square + row.sheared * moment),
        row.slip,
    )
    held_back = (
        slider.viscosity == 0.0 and slider.mass + slider.damping > 0.0 and yields > 0.0
    )
    if not (
        held_back
        and contact.stays == 0.0
        and contact.mean_stress * math.fabs(stretch) > 0.0
    ):
        return False
    for sense in (1.0, -1.0):
        part, least = sense * _TRIED, max(0.0, sense * here / stretch)
        while math.fabs(part) < _REACH:
            if (
                sense
                * _missing_slip(part * stretch, row, time, slider, contact)[0]
                / stretch
                > least
            ):
                slipped, lost, area = slip_from(
                    part * stretch, row, time, slider, contact
                )
                square += (row.moment + moment) * (row.slip - slid)
                energy.snaps += lost
                energy.area += (
                    0.5 * (stored - area * (square + row.sheared * row.moment)) - lost
                )
                return slipped
            part *= 2.0
    return False


@device
def contact_energy(row, area, slider):
    """Return the elastic energy of a contact of some area.

    With a viscosity it follows from the shear displacement, which a jump of the area leaves as it is; the speed jumps.
    """
    yields, _ = compliance(row.radius, slider)
    if slider.viscosity > 0.0:
        return 0.5 * row.sheared * row.sheared / yields if yields > 0.0 else 0.0
    return 0.5 * row.sheared * area * row.moment


#: Share of a clock step below which a sub-step is not cut for its energies; energy missing since the start, over the
#: tolerance of work or stored energy, above which a sub-step adds few; rounding over the energies.
BRIEF, _MISSED, _FEW, _ROUNDED = 1e-9, 3.0, 1e-2, 1e-14


@device
def misses(before, after, last, energy, row, slider, step):
    """True if a sub-step misses more energy than the tolerance of what is stored. ``last``: energies before it.

    A stored energy below the tolerance is as good as none: all sites at the unit of stretch store 1/2. If much is
    missing already, the tolerance is of what is dissipated, and of what is stored by the share of the time so far.
    """
    tolerance, size, retains = slider.tolerance, max(before, after), retained(energy)
    missing = retains - retained(last) - (after - before)
    # of the sums since the start of the clock step, of which next to nothing may be stored by now
    rounding = _ROUNDED * (math.fabs(energy.work) + math.fabs(retains))
    if (
        step > BRIEF * slider.length
        and math.fabs(missing)
        > tolerance * max(size, math.fabs(energy.work), tolerance) + rounding
    ):
        return True
    size, total = (
        max(size, math.fabs(row.worked + energy.work)),
        row.missed + retains - after + energy.stored,
    )
    rounding = _ROUNDED * (size + slider.stiffness * row.position * row.position)
    excess = math.fabs(total) - _MISSED * tolerance * size - rounding
    if step <= 1e2 * LEAST * slider.length or total * missing <= 0.0 or excess <= 0.0:
        return False
    turned = math.fabs(energy.work - last.work - retains + retained(last))
    turned += 4.0 * step / (row.elapsed + slider.length) * size
    room = max(0.0, _MISSED * tolerance * size - excess) * _FEW
    return math.fabs(missing) > tolerance * turned + room + rounding


#: Change of a radius over it, in a sub-step that is next to nothing, above which the area has jumped.
_JUMPED = 1e-6


@device
def book_jump(line, gained, books):
    """Book the energy that the last sub-step misses to the area, if the area has jumped in next to no time.

    ``gained``: change of the stored energy.
    """
    row, before, energy = line[0], line[1], books[0]
    if math.fabs(row.radius - before.radius) > _JUMPED * before.radius:
        energy.area += retained(energy) - retained(books[1]) - gained


#: Change of a force over it below which it is rounding.
_JUMPS = 1e-9


@device
def force_jumps(row, slider):
    """True if the prescribed force is another at the start of a piece than at the end of that before."""
    force = driven(0.0, slider)[1]
    return slider.forced > 0.0 and math.fabs(
        force - row.spring_force
    ) > _JUMPS * math.fabs(force)


@device
def book_slip(lost, by_area, jumps, energy):
    """Book energy ``lost`` at the start of a piece: to the area, if the force ``jumps`` no more than ``by_area``."""
    energy.area += by_area if jumps else lost
    energy.snaps += lost - by_area if jumps else 0.0


@device
def _come_off(row, slider):
    """Slip at once at an open contact to where no force acts on the interface; True if anything stops the body.

    Mass and damping hold the body, a spring without them pulls it to where the spring is relaxed.
    """
    is_held = slider.mass + slider.damping > 0.0
    if not is_held and slider.stiffness == 0.0:
        return row.spring_force == 0.0
    slip, body = free_shifts(row, slider)
    row.moment += row.bound * slip
    row.sheared = 0.0
    displace(row, slip, body, slider)
    return True


@device
def elastic(row, time, slider, contact, energy):
    """Slip at once where the area or the force has jumped and neither mass, damping nor viscosity delays it.

    Behind a contact that yields the interface alone slips if the body cannot, and the body alone if viscosity holds the
    interface.
    """
    stiffness, forced, held_back = (
        slider.stiffness,
        slider.forced,
        slider.mass + slider.damping > 0.0,
    )
    yields, _ = compliance(row.radius, slider)
    row.spring_force = driven(time, slider)[1] if forced > 0.0 else row.spring_force
    if not row.radius > 0.0:
        return _come_off(row, slider)
    if slider.viscosity > 0.0:
        if forced > 0.0 or slider.yielding_radius > 0.0:
            row.radius, _, _, _ = area_or_last(
                row.bound, row.moment, time, row, contact
            )
            yields, _ = compliance(row.radius, slider)
            shift = (
                0.0
                if held_back
                else (row.spring_force * yields - row.sheared)
                / (1.0 + stiffness * yields)
            )
            row.sheared += shift
            row.position += shift
            energy.work += row.spring_force * shift if forced > 0.0 else 0.0
            row.spring_force -= stiffness * shift
        return True
    if held_back and yields == 0.0:
        return True
    slip, bound, moment, shift, radius, area, by_moment = (
        0.0,
        row.bound,
        row.moment,
        0.0,
        row.radius,
        0.0,
        0.0,
    )
    for turn in range(40):
        # the area depends on the slip by the mean stress alone
        if turn == 0 or contact.mean_stress != 0.0:
            radius, area, _, by_moment = contact_area(
                bound, moment + bound * slip, time, radius, contact
            )
        if not area >= 0.0:
            return False
        yields, softer = compliance(radius, slider)
        force = area * (moment + bound * slip)
        slope = (area + by_moment * (moment + bound * slip)) * bound
        softer = bound * softening(softer, radius, by_moment, contact) * force
        shift = 0.0 if held_back else slip + yields * force - row.sheared
        over = (
            slip + yields * force - row.sheared
            if held_back
            else stiffness * shift + force - row.spring_force
        )
        slope = (
            1.0 + softer + yields * slope
            if held_back
            else stiffness * (1.0 + softer + yields * slope) + slope
        )
        if not slope > 0.0:
            first = _GUESS * _missing_slip(0.0, row, time, slider, contact)[0]
            return over == 0.0 or (
                held_back and slip_from(first, row, time, slider, contact)[0]
            )
        slip -= over / slope
        if math.fabs(over / slope) <= 1e-14 * (math.fabs(slip) + math.fabs(moment)):
            break
    moment += bound * slip
    row.moment, row.sheared, row.radius = moment, yields * area * moment, radius
    row.position += shift
    row.slip += slip
    row.path += math.fabs(slip)
    energy.work += row.spring_force * shift if forced > 0.0 else 0.0
    row.spring_force -= 0.0 if forced > 0.0 else stiffness * shift
    return True


@device
def _held_up(row, slider, contact, energy):
    """Return ``elastic`` at the start of a piece, and the contact; one that is lost by that keeps its radius.

    Bonds that an area dilutes, or a draw of ΔΓ, may leave no equilibrium. As within a piece, the interface goes on to
    the end of the clock step, where the contact opens.
    """
    going = elastic(row, 0.0, slider, contact, energy)
    if not going and contact.stays == 0.0:
        contact = later(contact, 0.0, 1.0)
        going = elastic(row, 0.0, slider, contact, energy)
    return going, contact


@device
def answer(row, piece, slider, contact, energy):
    """Slip at once at the start of a piece; return True if possible, and the contact then.

    At the start of a clock step ΔΓ has been drawn: the answer to the difference from its mean is no sliding path.
    """
    going, held = _held_up(row, slider, contact, energy)
    if piece == 0 and row.felt != row.drawn:
        path, row.felt = row.path, row.drawn
        # what the mean of the draws does not hold, the draw may
        going, held = _held_up(row, slider, drawn(contact, row, piece), energy)
        row.path = path
    return going, held


@device
def slips_free(row, slider):
    """True if a slip without bonds takes no time and has an end: behind a spring, or ahead of a body that stays."""
    yields, _ = compliance(row.radius, slider)
    return slider.viscosity == 0.0 and (
        yields > 0.0 if slider.mass + slider.damping > 0.0 else slider.stiffness > 0.0
    )


@device
def free_shifts(row, slider):
    """Return the displacements of an interface without bonds, and of its body, to where no force acts."""
    body = (
        0.0
        if slider.mass + slider.damping > 0.0
        else row.spring_force / slider.stiffness
    )
    return body + row.sheared, body


@device
def slip_free(row, time, slider, contact):
    """Slip at once, with next to no bonds, to where no force acts on the interface."""
    slip, body = free_shifts(row, slider)
    radius, area, _, _ = contact_area(FEW, 0.0, time, row.radius, contact)
    row.bound, row.moment, row.sheared, row.radius = (
        FEW,
        0.0,
        0.0,
        radius if area >= 0.0 else row.radius,
    )
    displace(row, slip, body, slider)
