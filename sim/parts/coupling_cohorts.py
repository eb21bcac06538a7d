"""Rows of sliders and cohorts of bonds through a clock step: sub-steps, avalanches that nothing delays.

The scheme of a sub-step stands in ``coupling_maps``.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.bonds.cohorts import carry, inside, read_row, rules_of, settle, sum_row, write_row
from sim.parts.bonds.rupture import rate_at
from sim.parts.coupling_equations import (
    BEND,
    BODY,
    BOUND,
    COLUMNS,
    ENDED,
    FORCE,
    MOMENT,
    NEXT,
    PATH,
    POSITION,
    RADIUS,
    SHEARED,
    SLIP,
    SPEED,
    compliance,
    contact_area,
)  # fmt: skip
from sim.parts.coupling_maps import (
    AT_AREA,
    AT_BOUND,
    AT_LOST,
    AT_MOMENT,
    AT_RADIUS,
    AT_SHEARED,
    AT_SPEED,
    AT_SQUARE,
    AT_WAY,
    bend_of,
    book_nodes,
    error_of_way,
    go_to_node,
    longest,
    start_of,
    stored_energy,
    sums_at,
)  # fmt: skip
from sim.parts.coupling_rows import LEAST, MOST_STEPS, later, put_down, take_up
from sim.parts.coupling_snaps import area_kept, elastic, slip_free, slips_free
from sim.parts.drive.driven import AREA, RUPTURE, SNAP, STORED, WORK

#: Share of a piece below which a sub-step that fails may be an avalanche; share of a limit by which one is tried.
_BRIEF, _TRIED = 1e-9, 1e-7
#: Sub-steps within which bonds break that none leads over.
_AROUND = 8.0


@device
def _at_once(pool, count, way, unit, rules):
    """Share bound and sum of the stretches once all bonds have gone a way, and none is beyond the limit."""
    bound, moment, limit = 0.0, 0.0, rules.limit
    for i in range(count):
        x, half = pool[1, i] + unit * way, 0.5 * pool[2, i]
        pool[4, i] = pool[0, i] * inside(x, pool[2, i], limit)
        bound += pool[4, i]
        moment += pool[4, i] * 0.5 * (max(x - half, -limit) + min(x + half, limit))
    return bound, moment / unit


@device
def _lacking(way, pool, count, row, time, bare, slider, held, unit, rules):
    """Force that bonds lack, along the pull, once all have gone a way at once; area, shear and way of the body."""
    bound, moment = _at_once(pool, count, way, unit, rules)
    radius, area, _, _ = contact_area(bound, moment, time, row[RADIUS], bare, held)
    yields, _ = compliance(radius, slider)
    sheared = yields * area * moment
    body = way + sheared - row[SHEARED]
    lacks = row[FORCE] - slider[0] * body - area * moment
    return lacks if row[FORCE] > 0.0 else -lacks, area, radius, sheared, body


@device
def _snap(row, pool, count, time, bare, slider, held, unit, rules, node, energy):
    """Slip at once to where bonds bear the pull again, if an avalanche has begun; bonds left, below zero if none has.

    The first such place is looked for in steps of at most half the width to which stretches are resolved.
    """
    sense, step, limit = math.copysign(1.0, row[FORCE]), 0.5 * rules.cell / unit, rules.limit / unit
    here, area, _, _, _ = _lacking(0.0, pool, count, row, time, bare, slider, held, unit, rules)
    near, _, _, _, _ = _lacking(sense * _TRIED * limit, pool, count, row, time, bare, slider, held, unit, rules)
    if not (near > here or here > _TRIED * math.fabs(row[FORCE])):  # merged stretches reach a little beyond the limit
        return -1
    way, low, high, begun = 0.0, 0.0, _TRIED * limit, near > 0.0
    while high < 2.0 * limit:
        low, high = high, high + min(high, step)
        lacks, _, _, _, _ = _lacking(sense * high, pool, count, row, time, bare, slider, held, unit, rules)
        if begun and lacks <= 0.0:
            break
        begun = begun or lacks > 0.0
        if not begun and high > step:
            return -1
    if high < 2.0 * limit:
        for _ in range(60):
            middle = 0.5 * (low + high)
            lacks, _, _, _, _ = _lacking(sense * middle, pool, count, row, time, bare, slider, held, unit, rules)
            low, high = (middle, high) if lacks > 0.0 else (low, middle)
        way = sense * high
    elif slider[0] > 0.0:
        way = row[FORCE] / slider[0] + row[SHEARED]
    else:
        return -1
    _, after, radius, sheared, body = _lacking(way, pool, count, row, time, bare, slider, held, unit, rules)
    if not after >= 0.0:
        return -1
    stored, bound = stored_energy(row, node[AT_SQUARE], bare, time, slider, held), node[AT_BOUND]
    count = carry(pool, count, unit * way, 0.0, 0.0, 0.0, rules)
    sums_at(pool, count, unit, rules, node)
    row[RADIUS], row[SHEARED], row[BOUND], row[MOMENT] = radius, sheared, node[AT_BOUND], node[AT_MOMENT]
    row[FORCE] -= slider[0] * body
    row[POSITION] += body
    row[SLIP] += way
    row[PATH] += math.fabs(way)
    row[BEND] = 0.0
    broken = 0.25 * (area + after) * (bound - node[AT_BOUND]) * limit * limit
    energy[RUPTURE] += broken
    if slider[4] > 0.0:
        energy[WORK] += row[FORCE] * body
        stored += row[FORCE] * body
    energy[SNAP] += stored - stored_energy(row, node[AT_SQUARE], bare, time, slider, held) - broken
    return count


@device
def _shed(row, pool, count, time, reach, bare, slider, held, unit, rules, node, energy):
    """Break bonds of one stretch that are within a ``reach`` of its limit; bonds left, below zero if there are none.

    Their force falls in no time, so that no sub-step leads over it where something delays the slip.
    """
    left, gone, limit = 0, 0.0, rules.limit / unit
    for i in range(count):
        if math.fabs(pool[1, i]) / unit - 0.5 * pool[2, i] / unit >= limit - reach:
            gone += pool[0, i]
        else:
            pool[:3, left] = pool[:3, i]
            left += 1
    if left == count:
        return -1
    stored = stored_energy(row, node[AT_SQUARE], bare, time, slider, held)
    _, area, _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    sums_at(pool, left, unit, rules, node)
    row[BOUND], row[MOMENT], row[BEND] = node[AT_BOUND], node[AT_MOMENT], 0.0
    row[RADIUS], node[AT_AREA], _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    yields, _ = compliance(row[RADIUS], slider)
    row[SPEED], row[BODY], _ = start_of(row, node, yields, slider)
    broken = 0.5 * area * gone * limit * limit
    energy[RUPTURE] += broken
    energy[SNAP] += stored - stored_energy(row, node[AT_SQUARE], bare, time, slider, held) - broken
    return left


@device
def _let_go(row, pool, time, brief, bare, slider, held, unit, rules, node, energy):
    """Break all bonds at once and slip, where nothing delays the interface, if they last less than ``brief``."""
    k = rate_at(unit * node[AT_MOMENT] / node[AT_BOUND], rules.law) if node[AT_BOUND] > 0.0 else 0.0
    if not (k * brief > 1.0 and slips_free(row, slider)):
        return False
    stored = stored_energy(row, node[AT_SQUARE], bare, time, slider, held)
    _, area, _, _ = area_kept(row[BOUND], row[MOMENT], time, row, bare, held)
    broken = 0.5 * area * node[AT_SQUARE]
    slip_free(row, time, bare, slider, held)
    pool[0, 0], pool[1, 0], pool[2, 0] = row[BOUND], 0.0, 0.0
    sums_at(pool, 1, unit, rules, node)
    row[BEND] = 0.0
    energy[RUPTURE] += broken
    energy[SNAP] += stored - stored_energy(row, 0.0, bare, time, slider, held) - broken
    return True


@device
def _piece(row, bonds, bare, slider, held, piece, unit, rules, room, energy):
    """Go through one piece of a clock step; the time after which it ends or there is no way on, and the bonds.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step.
    """
    pool, saved, nodes = room
    count, travelled, settled = bonds
    start, length = 0.0, piece[0]
    brittle = slider[1] + slider[2] + slider[3] == 0.0
    nodes[0, :] = 0.0
    sums_at(pool, count, unit, rules, nodes[0])
    for _ in range(MOST_STEPS):
        left = length - start
        step = row[NEXT] if row[NEXT] > 0.0 else 1e-3 * length
        step = min(step, longest(row, unit, rules))
        step = left if step > 0.999 * left else min(step, 0.5 * left)
        if left <= LEAST * length:
            return length, count, travelled, settled
        if not step > LEAST * length:
            slid, row[NEXT] = row[SLIP], 0.0
            if _let_go(row, pool, start, _BRIEF * length, bare, slider, held, unit, rules, nodes[0], energy):
                count = settled = 1
                travelled += unit * (row[SLIP] - slid)
            elif held[0] > 0.0:
                return start, count, travelled, settled
            else:
                held = later(held, 0.0, 1.0)
            continue
        saved[:, :count] = pool[:3, :count]
        first = nodes[0]
        first[AT_RADIUS], first[AT_AREA], _, _ = contact_area(
            first[AT_BOUND], first[AT_MOMENT], start, row[RADIUS], bare, held
        )
        first[AT_SHEARED] = row[SHEARED]
        yields, _ = compliance(first[AT_RADIUS], slider)
        at_start = start_of(row, first, yields, slider)
        found, factor = go_to_node(
            1, nodes, at_start, pool, count, start, step, row, bare, slider, held, piece, unit, rules
        )
        if found >= 0:
            found, other = go_to_node(
                2, nodes, at_start, pool, found, start, step, row, bare, slider, held, piece, unit, rules
            )
            factor = min(factor, other)
        way, bend, error = nodes[2, AT_WAY], 0.0, math.inf
        if found >= 0:
            bend = bend_of(nodes, step)
            error = error_of_way(bend, step, nodes, row, slider)
        grows = min(factor, 4.0, max(0.1, 0.9 * error ** (-1.0 / 3.0))) if error > 0.0 else min(factor, 4.0)
        if not (error <= 1.0 and factor >= 1.0):
            pool[:3, :count] = saved[:, :count]
            row[NEXT] = step * (grows if error < math.inf else 0.25)
            if rules.limit < math.inf and step < _BRIEF * length:
                slid, reach = row[SLIP], _AROUND * step * math.fabs(row[SPEED]) + _TRIED * rules.limit / unit
                if brittle:
                    found = _snap(row, pool, count, start, bare, slider, held, unit, rules, first, energy)
                else:
                    found = _shed(row, pool, count, start, reach, bare, slider, held, unit, rules, first, energy)
                if found >= 0:
                    count, row[NEXT] = found, 1e-6 * length
                    travelled += unit * (row[SLIP] - slid)
            continue
        book_nodes(row, nodes, start, step, slider, piece, rules.limit / unit, energy)
        count, row[BEND] = found, bend
        travelled += unit * way
        if count > 1.25 * settled + 16.0 or count + 4 > pool.shape[1]:
            direction = -1.0 if way < 0.0 else 1.0
            count = settled = settle(pool[0], pool[1], pool[2], count, direction, travelled, rules)
            sums_at(pool, count, unit, rules, first)
        else:
            first[AT_BOUND : AT_LOST + 1] = nodes[2, AT_BOUND : AT_LOST + 1]
        row[NEXT] = max(row[NEXT], step * grows) if step == left else step * grows
        if step == left:
            return length, count, travelled, settled
        start += step
    return start, count, travelled, settled


@device
def _through(row, energy, bare, pieces, slider, held, unit, share, rules, bonds, room):
    """Take a row and its cohorts through the pieces of a clock step; the time reached, whether something holds."""
    (weight, stretch, width, lattice), (pool, _, nodes) = bonds, room
    is_open = not row[RADIUS] > 0.0
    row[RADIUS] = 0.0 if is_open else row[RADIUS]
    now, time, going = later(held, 0.0, 1.0 if is_open else held[0]), 0.0, True
    count = read_row(pool, weight, stretch, width, share)
    travelled, settled = lattice[0], lattice[1]
    for p in range(len(pieces)):
        piece = pieces[p, 1], pieces[p, 2], pieces[p, 3], pieces[p, 4]
        from_here, reached, worked, slid = later(now, time, now[0]), 0.0, energy[WORK], row[SLIP]
        before = energy[STORED]
        sums_at(pool, count, unit, rules, nodes[0])
        if p > 0:
            before = stored_energy(row, nodes[0, AT_SQUARE], bare, 0.0, slider, from_here)
        row[BOUND], row[MOMENT] = nodes[0, AT_BOUND], nodes[0, AT_MOMENT]
        going = elastic(row, 0.0, bare, slider, from_here, piece, energy)
        if going:
            for i in range(count):
                pool[1, i] += unit * (row[SLIP] - slid)
            travelled += unit * (row[SLIP] - slid)
            sums_at(pool, count, unit, rules, nodes[0])
            left = stored_energy(row, nodes[0, AT_SQUARE], bare, 0.0, slider, from_here)
            energy[AREA] += energy[WORK] - worked - left + before
            reached, count, travelled, settled = _piece(
                row, (count, travelled, settled), bare, slider, from_here, piece, unit, rules, room, energy
            )
        time += reached
        going = going and reached == piece[0]
        if not going:
            break
    if going:
        sums_at(pool, count, unit, rules, nodes[0])
        energy[STORED] = stored_energy(row, nodes[0, AT_SQUARE], bare, time, slider, now)
    if count > weight.size:
        count = settle(pool[0], pool[1], pool[2], count, 1.0 if row[SLIP] >= 0.0 else -1.0, travelled, rules)
        settled = count
    if rules.cell < math.inf:
        travelled = travelled % (1048576.0 * rules.cell)
    write_row(pool, count, weight, stretch, width)
    lattice[0], lattice[1] = travelled, settled
    return time, going


@kernel(
    "void(float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64,"
    " UniTuple(float64, 8), UniTuple(float64, 11), float64[:, :, ::1], float64[:, :, ::1], float64[::1], float64[::1],"
    " float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[:, :, ::1])"
)
def advance_cohorts(
    rows, energies, bare, pieces, clock, units, work, slider, held, passed, spent, share, numbers,
    weight, stretch, width, lattice, sums,
):  # fmt: skip
    """Advance all rows, their energies and cohorts through some clock steps, each row by itself.

    ``share`` of each row's bonds that is left at the start; ``sums`` get those of the cohorts after each step. The rest
    as in ``coupling_rows.advance_rows``.
    """
    rules, most, unit = rules_of(numbers), weight.shape[1] + 520, units[SLIP]
    room = np.empty((9, most)), np.empty((3, most)), np.zeros((3, AT_SPEED + 1))
    row, energy = np.empty(COLUMNS), np.empty(energies.shape[1])
    for m in range(len(rows)):
        stop, left = 0, share[m % share.size]
        bonds = weight[m], stretch[m], width[m], lattice[m]
        for k in range(len(clock)):
            start = stop
            while stop < len(pieces) and pieces[stop, 0] == k:
                stop += 1
            take_up(row, energy, rows[m], energies[m], units, work)
            if math.isnan(row[ENDED]):
                now = held[:3] + (clock[k, 1], clock[k, 2], clock[k, 3], clock[k, 4]) + held[7:]
                given = pieces[start:stop]
                time, going = _through(row, energy, bare[m], given, slider, now, unit, left, rules, bonds, room)
                if not going:
                    row[ENDED], row[POSITION], row[SPEED], row[BODY] = clock[k, 0] + time, math.nan, math.nan, math.nan
                    energy[:] = math.nan
                left = 1.0
            put_down(row, energy, rows[m], energies[m], units, work, passed[:, k, m], spent[k, m])
            sum_row(weight[m], stretch[m], width[m], rules, room[0][4], sums[:, k, m])
