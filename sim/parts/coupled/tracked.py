"""Rows of sliders and bonds followed one by one through a clock step, from one rupture or binding to the next.

Between two events the number of bonds is constant and their force is linear in the slip. A sub-step of the scheme in
``cohorts`` therefore needs only sums. The bonds, whose arrays are spent, are displaced once it is accepted. A sub-step
ends at the next event. If nothing delays the slip, forces are balanced at once after an event. The slider slips as far
as the remaining bonds allow, and the slip may break further bonds one after the other.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.bonds import tracked
from sim.parts.coupled import mechanics
from sim.parts.coupled.cohorts import NODE, accept_nodes, balance, before_node, begin_sub_step, bend_of, stored_energy
from sim.parts.drive import ENERGY
from sim.parts.exchange import Array

#: Slip over that to which bonds are stretched below which it is a rounding: back and forth it would have them turn.
_ROUNDING = 1e-13
#: Length over a clock step's in which bonds are displaced at once.
_AT_ONCE = 1e-18
#: Turns in which a node or an event is found, and trials of a sub-step.
_TURNS, _TRIALS = 20, 200
#: Share of a sub-step before its end in which an event is at the end.
_NEAR = 1e-8


class Ground(NamedTuple):
    """Constants of a row's bonds: unit of a stretch, number of sites, law, address of their draws, and room."""

    unit: float
    sites: float
    law: tuple[float, ...]
    address: tuple[int, int]
    space: tuple[Array, ...]


@device
def _sums(tracks, ground, node):
    """Compute the share bound, sum of the stretches and of their squares over the sites, stretches over their unit."""
    frame, unit, sites = tracks[2], ground.unit, ground.sites
    number, slider, births = frame[tracked.BOUND], frame[tracked.SLIDER], frame[tracked.SUM]
    node.bound = number / sites
    node.moment = frame[tracked.SENSE] * (number * slider - births) / (sites * unit)
    squares = slider * (number * slider - 2.0 * births) + frame[tracked.SQUARES]
    node.square = max(squares, 0.0) / (sites * unit * unit)


@device
def _go(tracks, shift, duration, ground):
    """Advance the bonds by a displacement of the slider in a time."""
    (bonds, soonest, frame), (events, shifts, durations, laid, after) = tracks, ground.space
    shifts[0], durations[0] = shift * ground.unit, duration
    tracked.one_step(bonds, soonest, frame, shifts, durations, ground.law, ground.address, events, laid, after)


@device
def _same(node, bound, total):
    """True if number and stretch of the bonds of a node are these, except for rounding."""
    return node.bound == bound and math.fabs(node.moment - total) <= 1e-9 * (math.fabs(total) + bound)


@device
def _rebalance(line, time, tracks, slider, contact, ground, energy, node):
    """Slip at once to where bonds bear the pull, as far as nothing delays it; True if there is such a place."""
    row, trial, worked, unit, limit = line[0], np.empty(1, mechanics.ROW), energy.work, ground.unit, ground.law[2]
    for _ in range(mechanics.MOST_STEPS):
        energy.work = worked
        _sums(tracks, ground, node)
        row.bound, row.moment = node.bound, node.moment
        trial[0] = row
        if not mechanics.elastic(trial[0], time, slider, contact, energy):
            return False
        slip, square = trial[0].slip - row.slip, node.square
        if not math.fabs(slip) > _ROUNDING * (math.fabs(node.moment) + node.bound):
            line[0] = trial[0]
            return True
        nearest = tracked.next_cut(tracks, slip, limit) / unit if limit < math.inf else math.inf
        whole = nearest >= math.fabs(slip)
        slip = slip if whole else math.copysign(nearest * (1.0 + 1e-12) + 1e-12 * limit / unit, slip)
        _go(tracks, slip, _AT_ONCE * slider.length, ground)
        total, expected = row.moment + row.bound * slip, square + slip * (2.0 * row.moment + row.bound * slip)
        _, area, _, _ = mechanics.contact_area(row.bound, row.moment, time, row.radius, contact)
        _sums(tracks, ground, node)
        broken = not _same(node, row.bound, total)
        if broken:
            energy.rupture += 0.5 * area * (expected - node.square)
        if whole:
            line[0] = trial[0]
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
        approach = before_node(place, nodes, at_start, start, step, row, slider)
        before, after = nodes[place - 1], nodes[place]
        shift, bound, is_solved = approach.slip, before.bound, False
        for turn in range(_TURNS):
            total = before.moment + bound * shift
            over, slope, none = balance(shift, bound, total, before, after, approach, start, row, slider, contact)
            if not slope > 0.0:
                return False
            if turn > 0 and math.fabs(over / slope) <= none:
                after.bound, after.moment = bound, total
                after.square = before.square + shift * (2.0 * before.moment + bound * shift)
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
    radius, area, _, _ = mechanics.contact_area(row.bound, row.moment, time, row.radius, contact)
    area = area if area >= 0.0 else area_before  # else no equilibrium is left
    energy.area -= 0.5 * node.square * (area - area_before)
    if slider.viscosity > 0.0 and radius > 0.0:  # it holds the shear displacement, not the stiffness of the contact
        energy.area += mechanics.contact_energy(row, area, slider)
        row.radius = radius
        energy.area -= mechanics.contact_energy(row, area, slider)
    before, worked, lost = stored_energy(row, node.square, time, slider, contact), energy.work, energy.rupture
    yields, _ = mechanics.compliance(row.radius, slider)
    if yields > 0.0 and slider.viscosity == 0.0:  # it is sheared as by the bonds before
        before += 0.5 * row.sheared * (row.sheared / yields - area * row.moment)
    is_balanced = _rebalance(line, time, tracks, slider, contact, ground, energy, node)
    if not is_balanced and contact.stays == 0.0:
        contact = mechanics.later(contact, 0.0, 1.0)
        is_balanced = _rebalance(line, time, tracks, slider, contact, ground, energy, node)
    after = stored_energy(row, node.square, time, slider, contact)
    energy.snaps += before - after + energy.work - worked - (energy.rupture - lost)
    return is_balanced, contact


@device
def _piece(line, tracks, slider, contact, ground, nodes, books):
    """Go through one piece of a clock step; return the time of its end or of lost stability.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step: then the last
    number returned is 1, else 0.
    """
    start, length, unit, law = 0.0, slider.length, ground.unit, ground.law
    row, energy, first, last = line[0], books[0], nodes[0], nodes[2]
    for _ in range(mechanics.MOST_STEPS):
        left = length - start
        if left <= mechanics.LEAST * length:
            return length, contact.stays
        _sums(tracks, ground, first)
        row.bound, row.moment = first.bound, first.moment
        at_start = begin_sub_step(row, first, start, slider, contact)
        step = mechanics.next_step(row, left, length, math.inf)
        whole, bend, grows, cut, turns = step, 0.0, 0.0, False, 0
        for _ in range(_TRIALS):
            if not step > mechanics.LEAST * length:
                break
            contact = mechanics.following(contact, row, start, step)
            if not _try(nodes, at_start, start, step, row, slider, contact):
                step, cut = 0.25 * step, False
                continue
            within = mechanics.within_reach(last.slip, step, row, contact)
            bend, error = bend_of(nodes, step, row, slider)
            grows = min(4.0, max(0.1, 0.9 * error ** (-1.0 / 3.0))) if error > 0.0 else 4.0
            grows = min(grows, 0.9 * within)
            if not (error <= 1.0 and within >= 1.0):
                step, cut = step * grows, False
                continue
            whole = step if not cut else whole
            soon = tracked.next_event(tracks, last.slip * unit / step, whole, law)
            if turns < _TURNS and (soon < (1.0 - _NEAR) * step or (cut and soon > step)):
                cut, turns = soon < whole, turns + 1
                step = min(max(soon * (1.0 + 0.5 * _NEAR), 2.0 * mechanics.LEAST * length), whole)
                continue
            break
        if not step > mechanics.LEAST * length:
            slid, row.next_step = row.slip, 0.0
            if law[2] == math.inf and mechanics.snap(row, first.square, start, slider, contact, energy):
                _go(tracks, row.slip - slid, _AT_ONCE * length, ground)
                row.acceleration = 0.0
                continue
            if contact.stays > 0.0:
                return start, contact.stays
            contact = mechanics.later(contact, 0.0, 1.0)
            continue
        line[1], books[1] = row, energy
        before = stored_energy(row, first.square, start, slider, contact)
        accept_nodes(row, nodes, start, step, slider, contact, math.inf, energy)
        after = stored_energy(row, last.square, start + step, slider, contact)
        if mechanics.misses(before, after, books[1], energy, row, slider, step):
            line[0], books[0], row.next_step = line[1], books[1], 0.25 * step
            continue
        row.next_step = max(row.next_step, step * grows) if cut or step == left else step * grows
        start = length if step == left else start + step
        _go(tracks, last.slip, step, ground)
        _sums(tracks, ground, first)
        row.bound, row.moment, row.acceleration = first.bound, first.moment, bend
        energy.rupture += 0.5 * last.area * (last.square - first.square)
        if cut or not _same(first, last.bound, last.moment):
            is_balanced, contact = _after_event(line, start, tracks, slider, contact, ground, energy, nodes)
            if not is_balanced:
                return start, contact.stays
        if start == length:
            return length, contact.stays
    return start, contact.stays


@device
def _through(line, books, pieces, slider, contact, tracks, ground, nodes):
    """Take a row and its bonds through a clock step; return the time reached, and False if stability is lost."""
    energy, row, time, first, stays = books[0], line[0], 0.0, nodes[0], contact.stays
    for p in range(len(pieces)):
        slider = mechanics.slider_in(slider, pieces[p])
        from_here = mechanics.later(mechanics.feeling(contact, row), time, stays)
        worked, before, lost = energy.work, energy.stored, energy.rupture
        _sums(tracks, ground, first)
        row.bound, row.moment = first.bound, first.moment
        if p > 0:
            before = stored_energy(row, first.square, 0.0, slider, from_here)
        jumps, unslipped = mechanics.force_jumps(row, slider), before
        if jumps:
            unslipped = stored_energy(row, first.square, 0.0, slider, mechanics.drawn(from_here, row, p))
        going = _rebalance(line, 0.0, tracks, slider, from_here, ground, energy, first)
        if p == 0 and row.felt != row.drawn:  # the answer to what was drawn is no sliding
            path, row.felt, from_here = row.path, row.drawn, mechanics.drawn(from_here, row, p)
            going = _rebalance(line, 0.0, tracks, slider, from_here, ground, energy, first)
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
    _sums(tracks, ground, first)
    row.bound, row.moment = first.bound, first.moment
    contact = mechanics.later(mechanics.settled(contact, row, slider), 0.0, stays)
    energy.stored = stored_energy(row, first.square, time, slider, contact)
    return time, True


@kernel(f"int64({mechanics.ARGUMENTS}, {tracked.TRACKS}, UniTuple(float64, 4), uint64, uint64[:], float64[:, :, ::1])")
def advance_tracks(inputs, numbers, outputs, tracks, law, seed, members, frames):
    """Advance all rows, their energies and their bonds, in place, through some clock steps, each row by itself.

    ``law``: rate, softness, limit and k_on; ``seed`` and ``members`` of the lives' draws; ``frames``, of shape (steps,
    rows, columns), get those of the bonds after each step. The rest as in ``mean_field.advance_rows``. The result is
    zero, or ``SPENT`` if the bonds have been advanced already.
    """
    rows, energies, pieces, clock, units, work = inputs
    slider, contact, (reached, spent) = mechanics.Slider(*numbers[0]), mechanics.contact_of(numbers), outputs
    birth, due, life, soonest, stamp, frame = tracks
    for m in range(len(rows)):
        if stamp[m] != np.int64(frame[m, tracked.STEPS]):
            return tracked.SPENT
    space = tracked.room(), np.empty(1), np.empty(1), np.empty(tracked.COLUMNS + 1), np.empty((tracked.COLUMNS, 1))
    both, nodes = (np.empty(2 * mechanics.COLUMNS), np.empty(2 * mechanics.ENERGIES)), np.zeros(3, NODE)
    line, books = both[0].view(mechanics.ROW), both[1].view(ENERGY)  # as they are, and before the last sub-step
    columns, booked = both[0][: mechanics.COLUMNS], both[1][: mechanics.ENERGIES]
    for m in range(len(rows)):
        stop, bonds = 0, ((birth[m], due[m], life[m]), soonest[m], frame[m])
        ground = Ground(units[mechanics.SLIP], np.float64(due.shape[1]), law, (seed, members[m]), space)
        for k in range(len(clock)):
            start, stop = stop, mechanics.pieces_to(k, stop, pieces)
            mechanics.to_units(columns, booked, rows[m], energies[m], units, work)
            if math.isnan(line[0].runaway_time):
                now = mechanics.contact_at(contact, clock[k], line[0])
                time, going = _through(line, books, pieces[start:stop], slider, now, bonds, ground, nodes)
                if not going:
                    mechanics.run_away(line[0], booked, clock[k, 0] + time)
            mechanics.from_units(columns, booked, rows[m], energies[m], units, work)
            reached[:, k, m], spent[k, m], frames[k, m] = rows[m], energies[m], frame[m]
        stamp[m] = np.int64(frame[m, tracked.STEPS])
    return 0
