"""Rows of sliders and bonds followed one by one through a clock step, from one rupture or binding to the next.

Between two events the number of bonds is constant and their force is linear in the slip. A massless slider goes to the
next event in closed form. Otherwise a sub-step of the scheme in ``cohorts`` needs only sums. The bonds, whose arrays
are spent, are displaced once it is accepted. A sub-step ends at the next event. If nothing delays the slip, forces are
balanced at once after an event. The slider slips as far as the remaining bonds allow, and the slip may break further
bonds one after the other.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import borrowed, device, kernel
from sim.parts.bonds import tracked
from sim.parts.bonds.mean_field import mean_decay
from sim.parts.coupled import mechanics
from sim.parts.coupled.cohorts import (
    NODE,
    accept_nodes,
    balance,
    before_node,
    begin_sub_step,
    bend_of,
    stored_energy,
)
from sim.parts.coupled.step_end import ENDS, end_step
from sim.parts.drive import ENERGY
from sim.parts.exchange import Array

#: Slip over that to which bonds are stretched below which it is a rounding: back and forth it would have them turn.
_ROUNDING = 1e-13
#: Length over a clock step's in which bonds are displaced at once.
_AT_ONCE = 1e-18
#: Places and shares of Gauss's rule in a unit of time; largest growth of a rate and relaxation of a speed within it.
_GAUSS = np.polynomial.legendre.leggauss(6)
_PLACES, _SHARES, _MOST = 0.5 * (1.0 + _GAUSS[0]), 0.5 * _GAUSS[1], 2.0
#: Force over those that balance, and change of a speed or a rate of force over it, below which each is a rounding.
_BALANCED, _STEADY = 1e-14, 1e-9
#: Change of a time over it after which Newton's method, whose error is then of the order of its square, has converged.
_LAST_TURN = 1e-5
#: Turns in which a node or an event is found, and trials of a sub-step.
_TURNS, _TRIALS = 20, 200
#: Turns beyond one for each site in which forces are balanced at once.
_SETTLING = 1000
#: Share of a sub-step before its end in which an event is at the end.
_NEAR = 1e-8


class Ground(NamedTuple):
    """Constants of a row's bonds: unit of a stretch, number of sites, law, address of their draws, and room."""

    unit: float
    sites: float
    law: tracked.SiteLaw
    address: tuple[int, int]
    scratch: Array
    winners: Array


@device
def _sums(frame, unit, sites, node):
    """Compute the share bound, sum of the stretches and of their squares over the sites, stretches over their unit."""
    number, slider, births = (
        frame[tracked.BOUND],
        frame[tracked.SLIDER],
        frame[tracked.SUM],
    )
    node.bound = number / sites
    node.moment = frame[tracked.SENSE] * (number * slider - births) / (sites * unit)
    squares = slider * (number * slider - 2.0 * births) + frame[tracked.SQUARES]
    node.square = max(squares, 0.0) / (sites * unit * unit)


@device
def _go(tracks, shift, duration, ground):
    """Advance the bonds by a displacement of the slider in a time."""
    tracked.one_step(
        tracks,
        shift * ground.unit,
        duration,
        ground.law,
        ground.address,
        ground.scratch,
    )


@device
def _go_at_once(tracks, shift, length, ground):
    """Displace the slider in no time; bonds whose stretch is limited may break."""
    frame, along, law = (
        tracks[2],
        tracks[2][tracked.SENSE] * shift * ground.unit,
        ground.law,
    )
    turns = along < 0.0 and law.turns > 0.0 and frame[tracked.SINGLY] == 0.0
    if turns and tracked.slip_back(tracks, along, law, ground.winners):
        return
    if frame[tracked.SINGLY] > 0.0 or along < 0.0 or law.limit < math.inf:
        _go(tracks, shift, _AT_ONCE * length, ground)
        return
    tracked.rank(tracks, law, ground.winners)
    tracked.let_pass(frame, along, 0.0, frame[tracked.CLOCK], ground.winners)
    if frame[tracked.TURNED] > 0.0:
        tracked.pass_turned(tracks, law, ground.winners)


@device
def _same(node, bound, total):
    """True if number and stretch of the bonds of a node are these, except for rounding."""
    return node.bound == bound and math.fabs(node.moment - total) <= 1e-9 * (
        math.fabs(total) + bound
    )


@device
def _rebalance(line, time, tracks, slider, contact, ground, energy, node):
    """Slip at once to where bonds bear the pull, as far as nothing delays it; True if there is such a place."""
    row, trial, worked, unit, limit = (
        line[0],
        line[2],
        energy.work,
        ground.unit,
        ground.law.limit,
    )
    # each turn but the last ones breaks a bond
    for _ in range(_SETTLING + int(ground.sites)):
        energy.work = worked
        _sums(tracks[2], ground.unit, ground.sites, node)
        row.bound, row.moment = node.bound, node.moment
        line[2] = row
        if not mechanics.elastic(trial, time, slider, contact, energy):
            return False
        slip, square = trial.slip - row.slip, node.square
        if not math.fabs(slip) > _ROUNDING * (math.fabs(node.moment) + node.bound):
            line[0] = trial
            return True
        nearest = (
            tracked.next_cut(tracks, slip, limit) / unit
            if limit < math.inf
            else math.inf
        )
        whole = nearest >= math.fabs(slip)
        slip = (
            slip
            if whole
            else math.copysign(nearest * (1.0 + 1e-12) + 1e-12 * limit / unit, slip)
        )
        _go_at_once(tracks, slip, slider.length, ground)
        total, expected = (
            row.moment + row.bound * slip,
            square + slip * (2.0 * row.moment + row.bound * slip),
        )
        _sums(tracks[2], ground.unit, ground.sites, node)
        broken = not _same(node, row.bound, total)
        if broken:
            _, area, _, _ = mechanics.contact_area(
                row.bound, row.moment, time, row.radius, contact
            )
            energy.rupture += 0.5 * area * (expected - node.square)
        if whole:
            line[0] = trial
            worked = energy.work
            if not broken:
                return True
        else:
            row.slip += slip
            row.path += math.fabs(slip)
            row.sheared -= slip
    return False


@device
def _try(nodes, at_start, start, step, row, slider, contact):
    """Find the nodes of a sub-step in which no bond breaks or is made; True if there are any.

    The first guess is never taken: before the next event, which may be as short as any, what is no slip may
    still be a speed.
    """
    for place in (1, 2):
        approach = before_node(place, nodes, at_start, start, step, 1.0, row, slider)
        before, after = nodes[place - 1], nodes[place]
        shift, bound, is_solved = approach.slip, before.bound, False
        for turn in range(_TURNS):
            total = before.moment + bound * shift
            sums, ends = (bound, total), (before, after)
            over, slope, none = balance(
                shift, sums, ends, approach, start, row, slider, contact
            )
            if not slope > 0.0:
                return False
            if turn > 0 and math.fabs(over / slope) <= none:
                after.bound, after.moment = bound, total
                after.square = before.square + shift * (
                    2.0 * before.moment + bound * shift
                )
                is_solved = True
                break
            shift -= over / slope
        if not is_solved:
            return False
    return True


@device
def _after_event(line, time, tracks, slider, contact, ground, energy, nodes):
    """Balance the forces after a bond has formed or broken; return True if possible, and the contact then."""
    row, node, area_before = line[0], nodes[0], nodes[2].area
    row.acceleration = 0.0
    radius, area, _, _ = mechanics.contact_area(
        row.bound, row.moment, time, row.radius, contact
    )
    area = area if area >= 0.0 else area_before  # else no equilibrium is left
    energy.area -= 0.5 * node.square * (area - area_before)
    # it holds the shear displacement, not the stiffness of the contact
    if slider.viscosity > 0.0 and radius > 0.0:
        energy.area += mechanics.contact_energy(row, area, slider)
        row.radius = radius
        energy.area -= mechanics.contact_energy(row, area, slider)
    before, worked, lost = (
        stored_energy(row, node.square, time, slider, contact),
        energy.work,
        energy.rupture,
    )
    yields, _ = mechanics.compliance(radius if radius > 0.0 else row.radius, slider)
    # it is sheared as by the bonds before, in the area that there is now
    if yields > 0.0 and slider.viscosity == 0.0:
        before += 0.5 * row.sheared * (row.sheared / yields - area * row.moment)
        energy.area -= (
            0.5
            * row.sheared
            * row.sheared
            * (1.0 / yields - mechanics.stiffness_of(row.radius, slider))
        )
    is_balanced = _rebalance(line, time, tracks, slider, contact, ground, energy, node)
    if not is_balanced and contact.stays == 0.0:
        contact = mechanics.later(contact, 0.0, 1.0)
        is_balanced = _rebalance(
            line, time, tracks, slider, contact, ground, energy, node
        )
    after = stored_energy(row, node.square, time, slider, contact)
    energy.snaps += before - after + energy.work - worked - (energy.rupture - lost)
    return is_balanced, contact


@device
def _is_closed(slider, contact, limit):
    """True if the motion between events has a closed form: pull linear in time, area constant, stretch not limited."""
    first, last, mean = slider.first, slider.last, slider.integral / slider.length
    bends = math.fabs(mean - 0.5 * (first + last)) + (
        0.0 if slider.forced > 0.0 else math.fabs(last - first)
    )
    is_linear = bends <= _STEADY * (math.fabs(first) + math.fabs(last))
    changes = (
        contact.load_rate != 0.0
        or contact.base_rate != 0.0
        or contact.mean_stress != 0.0
    )
    is_held = contact.field.length == math.inf and (contact.stays > 0.0 or not changes)
    return (
        is_linear
        and is_held
        and slider.mass + slider.viscosity == 0.0
        and limit == math.inf
    )


@device
def _clock(time, motion, pace):
    """Return the integral of e^(pace slip) over a time, by Gauss's rule, and the last of the values.

    A ``motion`` is the first speed of the interface, the one to which it relaxes, and the rate of that.
    """
    first, last, rate = motion
    mean = 0.0
    for i in range(len(_PLACES)):
        part = _PLACES[i] * time
        mean += _SHARES[i] * math.exp(
            pace * part * (last + (first - last) * mean_decay(rate * part))
        )
    return time * mean, math.exp(
        pace * time * (last + (first - last) * mean_decay(rate * time))
    )


@device
def _time_of(value, most, whole, grown, motion, pace):
    """Return the time at which the clock has a value, by Newton's method; ``whole`` and ``grown``: as at ``most``.

    The first guess is a cubic in the clock, by its slopes at both ends.
    """
    share, left = value / whole, 1.0 - value / whole
    time = (
        share * share * (most * (1.0 + 2.0 * left) - whole / grown * left)
        + share * left * left * whole
    )
    for _ in range(_TURNS):
        passed, slope = _clock(time, motion, pace)
        change = (value - passed) / slope
        time = min(max(time + change, 0.0), most)
        if math.fabs(change) <= _LAST_TURN * time:
            break
    return time


@device
def _to_event(row, start, left, tracks, slider, ground, energy, node):
    """Advance row and bonds in closed form to the next event, or as far as Gauss's rule is exact.

    Return the time that has passed, below zero if the closed form does not apply, and the event, or -1.
    """
    frame, law, winners, event = tracks[2], ground.law, ground.winners, -1
    if frame[tracked.SINGLY] > 0.0 or not node.area >= 0.0:
        return -1.0, event
    pull, bears = (
        mechanics.pull_on(start, start, 0.0, row, slider),
        node.area * node.bound,
    )
    body, force = (
        1.0 + mechanics.compliance(node.radius, slider)[0] * bears,
        node.area * node.moment,
    )
    growth = (
        slider.last - slider.first
        if slider.forced > 0.0
        else slider.stiffness * slider.integral
    ) / slider.length
    # of the slip: it moves the body more
    stiffness, damping = slider.stiffness * body + bears, slider.damping * body
    last = growth / stiffness if stiffness > 0.0 else 0.0
    first, relaxes, sense = last, 0.0, frame[tracked.SENSE]
    if damping > 0.0:
        over, relaxes = pull - force, stiffness / damping
        first = (
            over / damping
            if math.fabs(over) > _BALANCED * (math.fabs(pull) + math.fabs(force))
            else 0.0
        )
        last = last if stiffness > 0.0 else first
    if (
        sense * first < 0.0
        or sense * last < 0.0
        or (stiffness == 0.0 and (damping == 0.0 or growth != 0.0))
        or (frame[tracked.TURNED] > 0.0 and first != last)
    ):
        return -1.0, event
    tracked.rank(tracks, law, winners)
    motion, bent = (first, last, relaxes), first - last
    clock, pace = frame[tracked.CLOCK], law.softness * ground.unit * sense
    binding, rupture = (
        max(winners[tracked.BINDING, 1] - frame[tracked.TIME], 0.0),
        winners[tracked.RUPTURE, 1],
    )
    time, fastest = (
        min(left, binding),
        math.fabs(pace) * max(math.fabs(first), math.fabs(last)),
    )
    time = time if fastest * time <= _MOST else _MOST / fastest
    # the error of the rule is of order 13 in the time, and of first order in this change
    if relaxes * time > _MOST:
        change = min(max(math.fabs(pace * bent) / relaxes, 1e-16), 1.0)
        time = min(time, _MOST * change ** (-1.0 / 13.0) / relaxes)
    event = tracked.BINDING if time == binding else event
    grown, (whole, slope) = (
        law.rate * math.exp(law.softness * frame[tracked.SLIDER]),
        _clock(time, motion, pace),
    )
    waits, clock = rupture - clock, clock + grown * whole
    if rupture <= clock:
        time = (
            _time_of(waits / grown, time, whole, slope, motion, pace)
            if waits > 0.0
            else 0.0
        )
        event, clock = tracked.RUPTURE, rupture
    turned = -1
    if frame[tracked.TURNED] > 0.0:
        time, turned = tracked.first_turned(tracks, last * ground.unit, time, law)
        if turned >= 0:
            event = tracked.RUPTURE
            clock = frame[tracked.CLOCK] + grown * _clock(time, motion, pace)[0]
        tracked.spend_turned(tracks, last * ground.unit, time, law)
    x = relaxes * time
    early, twice = mean_decay(x), mean_decay(2.0 * x)
    late = (
        (1.0 - early) / x
        if x > 1e-3
        else 0.5 - x / 6.0 + x * x / 24.0 - x * x * x / 120.0
    )
    slip, travelled = (
        time * (last + bent * early),
        body * time * time * (0.5 * last + bent * late),
    )
    if slider.forced > 0.0:
        energy.work += body * slip * (pull + growth * time) - growth * travelled
    else:
        pulled = time * (pull + 0.5 * growth * time) - slider.stiffness * travelled
        energy.work += slider.integral / slider.length * pulled
    energy.damping += (
        damping
        * body
        * time
        * (last * (last + 2.0 * bent * early) + bent * bent * twice)
    )
    row.spring_force = mechanics.pull_on(start + time, start, 0.0, row, slider)
    mechanics.displace(row, slip, body * slip, slider)
    row.speed, row.acceleration = (
        last + bent * (1.0 - x * early),
        -relaxes * bent * (1.0 - x * early),
    )
    row.body_speed, row.sheared, row.substeps = (
        body * row.speed,
        row.sheared + (body - 1.0) * slip,
        row.substeps + 1.0,
    )
    row.radius = node.radius
    tracked.let_pass(frame, math.fabs(slip) * ground.unit, time, clock, winners)
    if turned >= 0:
        tracked.break_turned(turned, tracks, law, ground.address, winners)
    elif event >= 0:
        tracked.happen(tracks, event, law, ground.address, winners)
    if frame[tracked.TURNED] > 0.0:
        tracked.pass_turned(tracks, law, winners)
    return time, event


@device
def _piece(line, tracks, slider, contact, ground, nodes, books):
    """Go through one piece of a clock step; return the time reached, before its end if the motion ends.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step: then the last
    number returned is 1, else 0.
    """
    start, length, unit, law = 0.0, slider.length, ground.unit, ground.law
    row, energy, first, last = line[0], books[0], nodes[0], nodes[2]
    is_closed = _is_closed(slider, contact, law.limit)
    turns, checked = 0, 0.0
    while turns >= 0:
        turns, checked = mechanics.judged(turns, checked, start, length)
        left = length - start
        if left <= mechanics.LEAST * length:
            return length, contact.stays
        _sums(tracks[2], ground.unit, ground.sites, first)
        row.bound, row.moment = first.bound, first.moment
        at_start = begin_sub_step(row, first, start, slider, contact)
        if is_closed:
            slid = row.slip
            time, event = _to_event(
                row, start, left, tracks, slider, ground, energy, first
            )
            if time >= 0.0:
                start = length if event < 0 and time == left else start + time
                slip, last.area = row.slip - slid, first.area
                square = first.square + slip * (2.0 * first.moment + first.bound * slip)
                _sums(tracks[2], ground.unit, ground.sites, first)
                row.bound, row.moment = first.bound, first.moment
                if event == tracked.RUPTURE:
                    energy.rupture += 0.5 * last.area * (square - first.square)
                if event == tracked.RUPTURE or (
                    event >= 0 and contact.stays == 0.0 and contact.bonded != 0.0
                ):
                    is_balanced, contact = _after_event(
                        line, start, tracks, slider, contact, ground, energy, nodes
                    )
                    if not is_balanced:
                        return start, contact.stays
                continue
        step = mechanics.next_step(row, left, length, math.inf)
        whole, bend, grows, cut, cuts = step, 0.0, 0.0, False, 0
        for _ in range(_TRIALS):
            if not step > mechanics.LEAST * length:
                break
            contact = mechanics.following(contact, row, start, step)
            if not _try(nodes, at_start, start, step, row, slider, contact):
                step, cut = 0.25 * step, False
                continue
            within = mechanics.within_reach(last.slip, step, row, contact)
            bend, error = bend_of(nodes, step, 1.0, row, slider)
            grows = (
                min(4.0, max(0.1, 0.9 * error ** (-1.0 / 3.0))) if error > 0.0 else 4.0
            )
            grows = min(grows, 0.9 * within)
            if not (error <= 1.0 and within >= 1.0):
                step, cut = step * grows, False
                continue
            whole = step if not cut else whole
            soon = tracked.next_event(
                tracks, last.slip * unit / step, whole, law, ground.winners
            )
            if cuts < _TURNS and (soon < (1.0 - _NEAR) * step or (cut and soon > step)):
                cut, cuts = soon < whole, cuts + 1
                step = min(
                    max(soon * (1.0 + 0.5 * _NEAR), 2.0 * mechanics.LEAST * length),
                    whole,
                )
                continue
            break
        if not step > mechanics.LEAST * length:
            slid, row.next_step = row.slip, 0.0
            if law.limit == math.inf and mechanics.snap(
                row, first.square, start, slider, contact, energy
            ):
                _go_at_once(tracks, row.slip - slid, length, ground)
                row.acceleration = 0.0
                continue
            if contact.stays > 0.0:
                return start, contact.stays
            # the interface slips with the body from there on, however fast the contact was lost
            contact, row.speed, row.acceleration = (
                mechanics.later(contact, 0.0, 1.0),
                row.body_speed,
                0.0,
            )
            continue
        line[1], books[1] = row, energy
        before = stored_energy(row, first.square, start, slider, contact)
        accept_nodes(row, nodes, start, step, slider, contact, math.inf, energy)
        after = stored_energy(row, last.square, start + step, slider, contact)
        if mechanics.misses(before, after, books[1], energy, row, slider, step):
            line[0], books[0], row.next_step = line[1], books[1], 0.25 * step
            continue
        row.next_step = (
            max(row.next_step, step * grows) if cut or step == left else step * grows
        )
        start = length if step == left else start + step
        _go(tracks, last.slip, step, ground)
        _sums(tracks[2], ground.unit, ground.sites, first)
        row.bound, row.moment, row.acceleration = first.bound, first.moment, bend
        energy.rupture += 0.5 * last.area * (last.square - first.square)
        if cut or not _same(first, last.bound, last.moment):
            is_balanced, contact = _after_event(
                line, start, tracks, slider, contact, ground, energy, nodes
            )
            if not is_balanced:
                return start, contact.stays
        if start == length:
            return length, contact.stays
    return start, contact.stays


@device
def _through(line, books, pieces, slider, contact, tracks, ground, nodes):
    """Take a row and its bonds through a clock step; return the time reached, and False if the motion ends there."""
    energy, row, time, first, stays = books[0], line[0], 0.0, nodes[0], contact.stays
    for p in range(len(pieces)):
        slider = mechanics.slider_in(slider, pieces[p])
        from_here = mechanics.later(mechanics.feeling(contact, row), time, stays)
        worked, before, lost = energy.work, energy.stored, energy.rupture
        _sums(tracks[2], ground.unit, ground.sites, first)
        row.bound, row.moment = first.bound, first.moment
        if p > 0:
            before = stored_energy(row, first.square, 0.0, slider, from_here)
        jumps, unslipped = mechanics.force_jumps(row, slider), before
        if jumps:
            unslipped = stored_energy(
                row, first.square, 0.0, slider, mechanics.drawn(from_here, row, p)
            )
        going = _rebalance(line, 0.0, tracks, slider, from_here, ground, energy, first)
        # the answer to what was drawn is no sliding
        if p == 0 and row.felt != row.drawn:
            path, row.felt, from_here = (
                row.path,
                row.drawn,
                mechanics.drawn(from_here, row, p),
            )
            going = _rebalance(
                line, 0.0, tracks, slider, from_here, ground, energy, first
            )
            row.path = path
        if not going:
            return time, False
        after = stored_energy(row, first.square, 0.0, slider, from_here)
        slipped = energy.work - worked - after + before - (energy.rupture - lost)
        mechanics.book_slip(slipped, before - unslipped, jumps, energy)
        reached, stays = _piece(line, tracks, slider, from_here, ground, nodes, books)
        time += reached
        if reached != slider.length:
            return time, False
    _sums(tracks[2], ground.unit, ground.sites, first)
    row.bound, row.moment = first.bound, first.moment
    row.lost = stays - contact.stays
    contact = mechanics.later(mechanics.settled(contact, row, slider), 0.0, stays)
    energy.stored = stored_energy(row, first.square, time, slider, contact)
    return time, True


@kernel(
    f"int64({mechanics.ARGUMENTS}, {ENDS}, {tracked.TRACKS}, {tracked.SITE_LAW}, Tuple((uint64, uint64[:])),"
    " float64[:, :, ::1])"
)
def advance_tracks(inputs, numbers, outputs, ends, tracks, law, address, frames):
    """Advance all rows, their energies and their bonds, in place, through some clock steps, each row by itself.

    ``law``: numbers of ``SiteLaw``; ``address``: seed and members of the lives' draws; ``frames``, of shape (steps,
    rows, columns), get those of the bonds after each step. The rest as in ``mean_field.advance_rows``. The result is
    zero, or ``SPENT`` if the bonds have been advanced already.
    """
    rows, energies, pieces, clock, units, work = inputs
    seed, members = address
    slider, contact, (reached, spent) = (
        mechanics.Slider(*numbers[0]),
        mechanics.contact_of(numbers),
        outputs,
    )
    birth, due, life, soonest, stamp, turned, frame = tracks
    law = tracked.SiteLaw(*law)
    for m in range(len(rows)):
        if stamp[m] != np.int64(frame[m, tracked.STEPS]):
            return tracked.SPENT
    width = 2 << np.int64(math.ceil(math.log2(soonest.shape[2])))
    at_end = np.empty((2, ends[0][4].size))
    rooms = (
        np.empty(3 * mechanics.COLUMNS),
        np.empty(2 * mechanics.ENERGIES),
        np.zeros(3, NODE),
        np.empty(tracked.SCRATCH),
        np.empty(tracked.COLUMNS + turned.shape[1]),
        np.empty((3 if law.turns > 0.0 else 2, width)),
    )
    for m in range(len(rows)):
        columns, booked, nodes, scratch, framed, winners = borrowed(rooms)
        framed[: tracked.COLUMNS], framed[tracked.COLUMNS :] = frame[m], turned[m]
        # as they are, before a sub-step, in a trial
        line, books = columns.view(mechanics.ROW), booked.view(ENERGY)
        stop, bonds = (
            0,
            borrowed(((birth[m], due[m], life[m]), soonest[m], framed)),
        )
        ground = Ground(
            units[mechanics.SLIP],
            np.float64(due.shape[1]),
            law,
            (seed, members[m]),
            scratch,
            winners,
        )
        columns, booked, winners[0, 0] = (
            columns[: mechanics.COLUMNS],
            booked[: mechanics.ENERGIES],
            -1.0,
        )
        for k in range(len(clock)):
            start, stop = stop, mechanics.pieces_to(k, stop, pieces)
            mechanics.to_units(columns, booked, rows[m], energies[m], units, work)
            if line[0].closed > 0.0:
                tracked.relax(bonds, law)
            now = mechanics.contact_at(contact, clock[k], line[0])
            if not mechanics.has_ended(line[0]):
                time, going = _through(
                    line, books, pieces[start:stop], slider, now, bonds, ground, nodes
                )
                if not going:
                    mechanics.end(line[0], booked, clock[k, 0] + time, slider)
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
            reached[:, k, m], spent[k, m], frames[k, m] = (
                rows[m],
                energies[m],
                framed[: tracked.COLUMNS],
            )
            if mechanics.has_ended(line[0]):
                # no sub-step has summed its bonds, which stay as they are
                _sums(bonds[2], ground.unit, ground.sites, nodes[0])
                line[0].bound, line[0].moment = nodes[0].bound, nodes[0].moment
            end_step(line[0], rows[m], m, k, clock[k, 5], now, ends, at_end)
        frame[m], turned[m] = framed[: tracked.COLUMNS], framed[tracked.COLUMNS :]
        stamp[m] = np.int64(frame[m, tracked.STEPS])
    return 0
