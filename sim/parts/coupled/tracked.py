"""Rows of sliders and bonds followed one by one through a clock step, from one rupture or binding to the next.

Between two events the number of bonds stays and their force is linear in the slip, so that a sub-step of the scheme in
``cohorts`` is tried on sums alone; the bonds, whose arrays are spent, then go its way once. It ends at the next
event. What does not hold the slider back is set right at once after an event: it slips as far as the bonds that are
left have it, and bond after bond where slip itself breaks them.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.bonds.tracked import (
    BOUND as BONDS,
    COLUMNS as FRAME,
    SENSE,
    SLIDER,
    SPENT,
    SQUARES,
    STEPS,
    SUM,
    TRACKS,
    next_cut,
    next_event,
    one_step,
    room,
)
from sim.parts.coupled.cohorts import (
    AT_AREA,
    AT_BOUND,
    AT_MOMENT,
    AT_RADIUS,
    AT_SHEARED,
    AT_SPEED,
    AT_SQUARE,
    AT_WAY,
    balance,
    before_node,
    bend_of,
    book_nodes,
    error_of_way,
    start_of,
    stored_energy,
)
from sim.parts.coupled.row import (
    BEND,
    BODY,
    BOUND,
    COLUMNS,
    ENDED,
    LEAST,
    MOMENT,
    MOST_STEPS,
    NEXT,
    PATH,
    POSITION,
    RADIUS,
    SHEARED,
    SLIP,
    SPEED,
    compliance,
    contact_area,
    elastic,
    later,
    put_down,
    take_up,
)
from sim.parts.drive import AREA, RUPTURE, SNAP, STORED, WORK

#: Slip over that to which bonds are stretched below which it is a rounding: back and forth it would have them turn.
_ROUNDING = 1e-13
#: Length over a clock step's in which bonds go a way at once.
_AT_ONCE = 1e-18
#: Turns in which a node or an event is found, and trials of a sub-step.
_TURNS, _TRIALS = 20, 200
#: Share of a sub-step before its end in which an event is at the end.
_NEAR = 1e-8


@device
def _sums(tracks, ground, node):
    """Share bound, sum of the stretches and of their squares over the sites, stretches over their unit."""
    frame, (unit, sites, _, _, _) = tracks[2], ground
    number, slider, births = frame[BONDS], frame[SLIDER], frame[SUM]
    node[AT_BOUND] = number / sites
    node[AT_MOMENT] = frame[SENSE] * (number * slider - births) / (sites * unit)
    squares = slider * (number * slider - 2.0 * births) + frame[SQUARES]
    node[AT_SQUARE] = max(squares, 0.0) / (sites * unit * unit)


@device
def _go(tracks, way, duration, ground):
    """Take the bonds a way of the slider in a time."""
    (bonds, soonest, frame), (unit, _, law, address, space) = tracks, ground
    events, ways, durations, laid, after = space
    ways[0], durations[0] = way * unit, duration
    one_step(bonds, soonest, frame, ways, durations, law, address, events, laid, after)


@device
def _same(node, bound, total):
    """Whether the bonds of a node are so many and so stretched, but for rounding."""
    return node[AT_BOUND] == bound and math.fabs(node[AT_MOMENT] - total) <= 1e-9 * (math.fabs(total) + bound)


@device
def _set_right(row, time, tracks, bare, slider, held, piece, ground, energy, node):
    """Slip at once to where bonds bear the pull, as far as nothing delays it; whether there is such a place."""
    trial, worked, unit, limit = np.empty(COLUMNS), energy[WORK], ground[0], ground[2][2]
    for _ in range(MOST_STEPS):
        energy[WORK] = worked
        _sums(tracks, ground, node)
        row[BOUND], row[MOMENT] = node[AT_BOUND], node[AT_MOMENT]
        trial[:] = row
        if not elastic(trial, time, bare, slider, held, piece, energy):
            return False
        slip, square = trial[SLIP] - row[SLIP], node[AT_SQUARE]
        if not math.fabs(slip) > _ROUNDING * (math.fabs(node[AT_MOMENT]) + node[AT_BOUND]):
            row[:] = trial
            return True
        nearest = next_cut(tracks, slip, limit) / unit if limit < math.inf else math.inf
        whole = nearest >= math.fabs(slip)
        slip = slip if whole else math.copysign(nearest * (1.0 + 1e-12) + 1e-12 * limit / unit, slip)
        _go(tracks, slip, _AT_ONCE * piece[0], ground)
        total, expected = row[MOMENT] + row[BOUND] * slip, square + slip * (2.0 * row[MOMENT] + row[BOUND] * slip)
        _, area, _, _ = contact_area(row[BOUND], row[MOMENT], time, row[RADIUS], bare, held)
        _sums(tracks, ground, node)
        broken = not _same(node, row[BOUND], total)
        if broken:
            energy[RUPTURE] += 0.5 * area * (expected - node[AT_SQUARE])
        if whole:
            row[:] = trial
            worked = energy[WORK]
            if not broken:
                return True
        else:
            row[SLIP] += slip
            row[PATH] += math.fabs(slip)
            row[SHEARED] -= slip
    return False


@device
def _try(nodes, at_start, start, step, row, bare, slider, held, piece):
    """Find the nodes of a sub-step in which no bond breaks or is made; whether there are any.

    The first guess is never taken: on the way to the next event, which may be as short as any, what is no slip may
    still be a speed.
    """
    for place in (1, 2):
        numbers = before_node(place, nodes, at_start, start, step, row, slider)
        before, after = nodes[place - 1], nodes[place]
        way, bound, found = numbers[6], before[AT_BOUND], False
        for turn in range(_TURNS):
            total = before[AT_MOMENT] + bound * way
            over, slope, none = balance(
                way, bound, total, before, after, numbers, start, row, bare, slider, held, piece
            )
            if not slope > 0.0:
                return False
            if turn > 0 and math.fabs(over / slope) <= none:
                after[AT_BOUND], after[AT_MOMENT] = bound, total
                after[AT_SQUARE] = before[AT_SQUARE] + way * (2.0 * before[AT_MOMENT] + bound * way)
                found = True
                break
            way -= over / slope
        if not found:
            return False
    return True


@device
def _after_event(row, time, tracks, bare, slider, held, piece, ground, energy, nodes):
    """Set right what a bond made or broken has changed; whether there is a way, with what holds the contact then."""
    node, area_before = nodes[0], nodes[2][AT_AREA]
    row[BEND] = 0.0
    _, area, _, _ = contact_area(row[BOUND], row[MOMENT], time, row[RADIUS], bare, held)
    area = area if area >= 0.0 else area_before  # else no equilibrium is left
    energy[AREA] -= 0.5 * node[AT_SQUARE] * (area - area_before)
    before, worked, lost = stored_energy(row, node[AT_SQUARE], bare, time, slider, held), energy[WORK], energy[RUPTURE]
    yields, _ = compliance(row[RADIUS], slider)
    if yields > 0.0 and slider[3] == 0.0:  # it is sheared as by the bonds before
        before += 0.5 * row[SHEARED] * (row[SHEARED] / yields - area * row[MOMENT])
    there = _set_right(row, time, tracks, bare, slider, held, piece, ground, energy, node)
    if not there and held[0] == 0.0:
        held = later(held, 0.0, 1.0)
        there = _set_right(row, time, tracks, bare, slider, held, piece, ground, energy, node)
    after = stored_energy(row, node[AT_SQUARE], bare, time, slider, held)
    energy[SNAP] += before - after + energy[WORK] - worked - (energy[RUPTURE] - lost)
    return there, held


@device
def _piece(row, tracks, bare, slider, held, piece, ground, nodes, energy):
    """Go through one piece of a clock step; the time after which it ends or there is no way on.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step.
    """
    start, length, (unit, _, law, _, _) = 0.0, piece[0], ground
    first, last = nodes[0], nodes[2]
    for _ in range(MOST_STEPS):
        left = length - start
        if left <= LEAST * length:
            return length
        _sums(tracks, ground, first)
        row[BOUND], row[MOMENT] = first[AT_BOUND], first[AT_MOMENT]
        first[AT_RADIUS], first[AT_AREA], _, _ = contact_area(
            first[AT_BOUND], first[AT_MOMENT], start, row[RADIUS], bare, held
        )
        first[AT_SHEARED] = row[SHEARED]
        yields, _ = compliance(first[AT_RADIUS], slider)
        at_start = start_of(row, first, yields, slider)
        step = row[NEXT] if row[NEXT] > 0.0 else 1e-3 * length
        step = left if step > 0.999 * left else min(step, 0.5 * left)
        whole, bend, grows, cut, turns = step, 0.0, 0.0, False, 0
        for _ in range(_TRIALS):
            if not step > LEAST * length:
                break
            if not _try(nodes, at_start, start, step, row, bare, slider, held, piece):
                step, cut = 0.25 * step, False
                continue
            bend = bend_of(nodes, step)
            error = error_of_way(bend, step, nodes, row, slider)
            grows = min(4.0, max(0.1, 0.9 * error ** (-1.0 / 3.0))) if error > 0.0 else 4.0
            if not error <= 1.0:
                step, cut = step * grows, False
                continue
            whole = step if not cut else whole
            soon = next_event(tracks, last[AT_WAY] * unit / step, whole, law)
            if turns < _TURNS and (soon < (1.0 - _NEAR) * step or (cut and soon > step)):
                cut, turns = soon < whole, turns + 1
                step = min(max(soon * (1.0 + 0.5 * _NEAR), 2.0 * LEAST * length), whole)
                continue
            break
        if not step > LEAST * length:
            if held[0] > 0.0:
                return start
            held = later(held, 0.0, 1.0)
            row[NEXT] = 0.0
            continue
        book_nodes(row, nodes, start, step, slider, piece, math.inf, energy)
        row[NEXT] = max(row[NEXT], step * grows) if cut or step == left else step * grows
        start = length if step == left else start + step
        _go(tracks, last[AT_WAY], step, ground)
        _sums(tracks, ground, first)
        row[BOUND], row[MOMENT], row[BEND] = first[AT_BOUND], first[AT_MOMENT], bend
        energy[RUPTURE] += 0.5 * last[AT_AREA] * (last[AT_SQUARE] - first[AT_SQUARE])
        if cut or not _same(first, last[AT_BOUND], last[AT_MOMENT]):
            there, held = _after_event(row, start, tracks, bare, slider, held, piece, ground, energy, nodes)
            if not there:
                return start
        if start == length:
            return length
    return start


@device
def _through(row, energy, bare, pieces, slider, held, tracks, ground, nodes):
    """Take a row and its bonds through the pieces of a clock step; the time reached, whether something holds."""
    is_open = not row[RADIUS] > 0.0
    row[RADIUS] = 0.0 if is_open else row[RADIUS]
    now, time, first = later(held, 0.0, 1.0 if is_open else held[0]), 0.0, nodes[0]
    for p in range(len(pieces)):
        piece = pieces[p, 1], pieces[p, 2], pieces[p, 3], pieces[p, 4]
        from_here, worked, before, lost = later(now, time, now[0]), energy[WORK], energy[STORED], energy[RUPTURE]
        _sums(tracks, ground, first)
        row[BOUND], row[MOMENT] = first[AT_BOUND], first[AT_MOMENT]
        if p > 0:
            before = stored_energy(row, first[AT_SQUARE], bare, 0.0, slider, from_here)
        if not _set_right(row, 0.0, tracks, bare, slider, from_here, piece, ground, energy, first):
            return time, False
        after = stored_energy(row, first[AT_SQUARE], bare, 0.0, slider, from_here)
        energy[AREA] += energy[WORK] - worked - after + before - (energy[RUPTURE] - lost)
        reached = _piece(row, tracks, bare, slider, from_here, piece, ground, nodes, energy)
        time += reached
        if reached != piece[0]:
            return time, False
    _sums(tracks, ground, first)
    row[BOUND], row[MOMENT] = first[AT_BOUND], first[AT_MOMENT]
    energy[STORED] = stored_energy(row, first[AT_SQUARE], bare, time, slider, now)
    return time, True


@kernel(
    "int64(float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64,"
    " UniTuple(float64, 8), UniTuple(float64, 11), float64[:, :, ::1], float64[:, :, ::1],"
    f" {TRACKS}, UniTuple(float64, 4), uint64, uint64[:], float64[:, :, ::1])"
)
def advance_tracks(
    rows, energies, bare, pieces, clock, units, work, slider, held, passed, spent, tracks, law, seed, members, frames
):
    """Advance all rows, their energies and their bonds, in place, through some clock steps, each row by itself.

    ``law``: rate, softness, limit and k_on; ``seed`` and ``members`` of the lives' draws; ``frames``, of shape (steps,
    rows, columns), get those of the bonds after each step. The rest as in ``mean_field.advance_rows``. What it
    returns is zero, or ``SPENT`` where the bonds have been advanced already.
    """
    birth, due, life, soonest, stamp, frame = tracks
    for m in range(len(rows)):
        if stamp[m] != np.int64(frame[m, STEPS]):
            return SPENT
    space = room(), np.empty(1), np.empty(1), np.empty(FRAME + 1), np.empty((FRAME, 1))
    nodes, row, energy = np.zeros((3, AT_SPEED + 1)), np.empty(COLUMNS), np.empty(energies.shape[1])
    for m in range(len(rows)):
        stop, own = 0, ((birth[m], due[m], life[m]), soonest[m], frame[m])
        ground = units[SLIP], np.float64(due.shape[1]), law, (seed, members[m]), space
        for k in range(len(clock)):
            start = stop
            while stop < len(pieces) and pieces[stop, 0] == k:
                stop += 1
            take_up(row, energy, rows[m], energies[m], units, work)
            if math.isnan(row[ENDED]):
                now = held[:3] + (clock[k, 1], clock[k, 2], clock[k, 3], clock[k, 4]) + held[7:]
                given = pieces[start:stop]
                time, going = _through(row, energy, bare[m], given, slider, now, own, ground, nodes)
                if not going:
                    row[ENDED], row[POSITION], row[SPEED], row[BODY] = clock[k, 0] + time, math.nan, math.nan, math.nan
                    energy[:] = math.nan
            put_down(row, energy, rows[m], energies[m], units, work, passed[:, k, m], spent[k, m])
            frames[k, m] = frame[m]
        stamp[m] = np.int64(frame[m, STEPS])
    return 0
