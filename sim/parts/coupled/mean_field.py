"""Rows of sliders and bonds through a clock step: what happens at once at its start, sub-steps, stick and slip."""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.coupled.radau import LAST, RATES, ROOM, book, kinetics, newton, rested, share_left, tried
from sim.parts.coupled.row import (
    BODY,
    BOUND,
    COLUMNS,
    ENDED,
    FORCE,
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
    area_kept,
    compliance,
    contact_area,
    driven,
    elastic,
    free_ways,
    later,
    pull_on,
    put_down,
    slip_free,
    slips_free,
    take_up,
)
from sim.parts.drive import AREA, RUPTURE, SNAP, STORED, WORK

#: Way over the cut-off stretch on which bonds are tried, and that within which they may snap.
_TRIED, NEAR = 1e-7, 1e-3


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


#: Share of a piece below which a rejected sub-step means that an avalanche may have begun.
_BRIEF = 1e-9
#: Places in a piece at which a slider that sticks is looked at, and halvings that place when it leaves.
_PLACES, _HALVINGS = 32, 60
#: Shares of bonds and of a piece beyond which equilibrium is looked for where there is no way on, and most changes
#: between stick and slip in a piece.
_NEXT_TO, _CHANGES = 1e-6, 10_000
#: Turns in which area and stress of a slider at rest settle.
_FEW_TURNS = 20


@device
def _piece(row, bare, slider, law, held, piece, room, energy):
    """Go through one piece of a clock step; the time after which it ends or there is no way on.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step.
    """
    start, length = 0.0, piece[0]
    yields, _ = compliance(row[RADIUS], slider)
    brittle = law[2] > 0.0 and slider[3] == 0.0 and (slider[1] + slider[2] == 0.0 or yields > 0.0)
    for _ in range(MOST_STEPS):
        left = length - start
        step = row[NEXT] if row[NEXT] > 0.0 else 1e-3 * length
        step = left if step > 0.999 * left else min(step, 0.5 * left)
        if not step > LEAST * length:
            gone = let_go(row, start, _BRIEF * length, bare, slider, law, held, energy)
            if held[0] > 0.0 and not gone:
                return start
            held, room[LAST, 0] = (held, 0.0) if gone else (later(held, 0.0, 1.0), room[LAST, 0])
            row[NEXT] = 0.0
            continue
        grows, stands = tried(row, start, step, bare, slider, law, held, piece, room)
        if not stands:
            row[NEXT] = step * grows
            if brittle and step < _BRIEF * length and snap(row, start, NEAR, bare, slider, law, held, energy):
                row[NEXT], room[LAST, 0] = 1e-6 * length, 0.0
            continue
        book(row, start, step, bare, slider, law, held, piece, room, energy)
        row[NEXT] = max(row[NEXT], step * grows) if step == left else step * grows
        if brittle and snap(row, start + step, 0.0, bare, slider, law, held, energy):
            row[NEXT], room[LAST, 0] = 1e-6 * length, 0.0
        if step == left:
            return length
        start += step
    return start


@device
def _slips(time, start, row, bare, slider, law, held, piece):
    """Pull beyond what the bonds bear at a time if nothing has moved since the start, over the unit of force."""
    share = rested(row[BOUND], time - start, law)
    _, area, _, _ = area_kept(share, share, time, row, bare, held)
    return math.fabs(pull_on(time, start, 0.0, row, slider, piece)) - area * share


@device
def _rest(row, start, settles, bare, slider, law, held, piece, energy):
    """Stay at rest until the pull is more than bonds bear; the time at which it is, or the end of the piece.

    A slip that ``settles`` has come to rest where pull and strength are equal, and the strength grows faster.
    """
    length = piece[0]
    end, before = length, start
    for k in range(1 if settles else 0, _PLACES + 1):
        time = start + (length - start) * (k / _PLACES)
        if _slips(time, start, row, bare, slider, law, held, piece) > 0.0:
            low, end = before, time
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + end)
                if _slips(middle, start, row, bare, slider, law, held, piece) > 0.0:
                    end = middle
                else:
                    low = middle
            break
        before = time
    first, last = row[FORCE], pull_on(end, start, 0.0, row, slider, piece)
    if slider[4] == 0.0:
        energy[WORK] += 0.5 * (last - first) * (last + first) / slider[0]
    moment, share = 0.0, rested(row[BOUND], end - start, law)
    for _ in range(_FEW_TURNS):  # the stress takes a little of the area, if adhesion pays for it
        radius, area, _, _ = area_kept(share, moment, end, row, bare, held)
        moment = last / area if area > 0.0 else 0.0
    row[FORCE], row[BOUND], row[RADIUS], row[MOMENT] = last, share, radius, moment
    row[SPEED], row[BODY] = 0.0, 0.0
    return end


@device
def _jump(row, time, bare, slider, law, held):
    """Speed at which a body without mass begins to slip: the highest at which friction and damping bear the pull.

    Newton's method from above: friction is convex in the speed.
    """
    _, _, damping, viscosity, _, _, _, _ = slider
    pull, speed = math.fabs(row[FORCE]), 0.0
    _, area, _, _ = area_kept(0.0, 0.0, time, row, bare, held)
    if not damping + area * viscosity > 0.0:  # an open contact
        return 0.0
    speed = pull / (damping + area * viscosity)
    for _ in range(100):
        share = row[BOUND] * share_left(law[5] * speed, law)
        _, area, by_bound, by_moment = area_kept(share, share, time, row, bare, held)
        bears = damping + area * viscosity
        slope = bears - law[6] * share * share * (area + (by_bound + by_moment) * (share + viscosity * speed))
        change = (bears * speed + area * share - pull) / slope
        if not (slope > 0.0 and change > 1e-15 * speed):
            break
        speed = max(speed - change, 0.0)
    return speed


@device
def _slide(row, start, bare, slider, along, held, piece, room, energy):
    """Slip until the speed comes to zero or the piece ends; the time reached, negative where there is no way on."""
    length, sense = piece[0], along[5]
    for _ in range(MOST_STEPS):
        left = length - start
        step = row[NEXT] if row[NEXT] > 0.0 else 1e-3 * length
        step = left if step > 0.999 * left else min(step, 0.5 * left)
        if not step > LEAST * length:
            row[NEXT] = 0.0
            left = row[BOUND] * (1.0 - _NEXT_TO), start + _NEXT_TO * length
            _, area, _, _ = contact_area(left[0], row[MOMENT], left[1], row[RADIUS], bare, held)
            if not area >= 0.0:  # lost: the radius stays for the rest of the clock step
                held = later(held, 0.0, 1.0)
                continue
            return start if slider[1] == 0.0 or row[SPEED] == 0.0 else -1.0
        grows, stands = tried(row, start, step, bare, slider, along, held, piece, room)
        if not stands:
            row[NEXT] = step * grows
            continue
        speed = _last_speed(room, step) * sense
        stops = speed <= 0.0
        if stops and row[SPEED] == 0.0:
            row[NEXT] = 0.25 * step
            continue
        if stops:
            near, above, far, below, side = 0.0, row[SPEED] * sense, step, speed, 0
            for _ in range(100):
                step = near + (far - near) * (above / (above - below))
                if not newton(row, start, step, bare, slider, along, held, piece, room):
                    break
                speed = _last_speed(room, step) * sense
                if math.fabs(speed) <= 1e-13 * math.fabs(row[SPEED]) or far - near <= 1e-15 * far:
                    break
                if speed > 0.0:
                    near, above = step, speed
                    below *= 0.5 if side > 0 else 1.0
                    side = 1
                else:
                    far, below = step, speed
                    above *= 0.5 if side < 0 else 1.0
                    side = -1
        book(row, start, step, bare, slider, along, held, piece, room, energy)
        row[NEXT] = max(row[NEXT], step * grows) if step == left else step * grows
        start = length if step == left else start + step
        if stops:
            row[SPEED], row[BODY] = 0.0, 0.0
        if stops or start >= length:
            return start
    return -1.0


@device
def _last_speed(room, step):
    """Speed of the interface at the end of a sub-step."""
    return (RATES[2, 0] * room[0, 0] + RATES[2, 1] * room[0, 1] + RATES[2, 2] * room[0, 2]) / step


@device
def _sticking_piece(row, bare, slider, law, held, piece, room, energy):
    """Go through one piece with bonds that bear any pull up to their strength at rest; the time reached."""
    start, length = 0.0, piece[0]
    stuck, sense = 0, 0.0
    for _ in range(_CHANGES):
        if start >= length:
            return length
        rests = row[SPEED] == 0.0
        if rests:
            before = start
            settles = law[3] > 0.0 and sense * row[FORCE] > 0.0
            start = _rest(row, start, settles, bare, slider, law, held, piece, energy)
            if start >= length:
                return length
            stuck = stuck + 1 if start == before else 0
            if stuck > 100:
                return start
        sense = math.copysign(1.0, row[FORCE] if rests else row[SPEED])
        along = law[0], law[1], law[2], law[3], law[4], sense, law[6]
        if rests:
            speed = sense * _jump(row, start, bare, slider, along, held) if slider[1] == 0.0 else 0.0
            row[SPEED] = row[BODY] = speed
            row[BOUND] *= share_left(speed, along)
            row[MOMENT] = sense * row[BOUND]
        start = _slide(row, start, bare, slider, along, held, piece, room, energy)
        if start < 0.0:
            return 0.0
        if start < length:
            row[SPEED] = row[BODY] = 0.0
    return start


@device
def _goes_along(row, slider, law, piece):
    """Go to where the spring is free, and along with the stage, as nothing else holds an open contact."""
    way, _ = free_ways(row, slider)
    row[SPEED] = row[BODY] = driven(0.0, piece)[1]
    row[FORCE], row[BOUND] = 0.0, row[BOUND] if law[6] == 0.0 else 1.0 / (1.0 + law[6] * math.fabs(row[SPEED]))
    row[POSITION] += way
    row[SLIP] += way
    row[PATH] += math.fabs(way)


@device
def _clock_step(row, bare, slider, law, held, pieces, room, energy):
    """Go through the pieces of a clock step; the time reached, and whether something holds the body still."""
    is_open = not row[RADIUS] > 0.0
    row[RADIUS] = 0.0 if is_open else row[RADIUS]
    now, time, worked, going = later(held, 0.0, 1.0 if is_open else held[0]), 0.0, energy[WORK], True
    for p in range(len(pieces)):
        piece = pieces[p, 1], pieces[p, 2], pieces[p, 3], pieces[p, 4]
        room[LAST, 0] = 0.0
        if is_open and law[5] != 0.0 and slider[1] + slider[2] + slider[4] == 0.0:
            _goes_along(row, slider, law, piece)
        if p == 0:
            if law[5] == 0.0:
                going = elastic(row, 0.0, bare, slider, now, piece, energy)
            elif slider[4] > 0.0:
                row[FORCE] = driven(0.0, piece)[1]
            energy[AREA] += energy[WORK] - worked - stored_in(row, bare, 0.0, slider, law, now) + energy[STORED]
        ahead, reached = later(now, time, now[0]), 0.0
        if going and law[5] == 0.0:
            reached = _piece(row, bare, slider, law, ahead, piece, room, energy)
        elif going:
            reached = _sticking_piece(row, bare, slider, law, ahead, piece, room, energy)
        time += reached
        if not (going and reached == piece[0]):
            return time, False
    energy[STORED] = stored_in(row, bare, time, slider, law, now)
    return time, True


@kernel(
    "void(float64[:, ::1], float64[:, ::1], float64[::1], float64[:, ::1], float64[:, ::1], float64[::1], float64,"
    " UniTuple(float64, 8), UniTuple(float64, 7), UniTuple(float64, 11), float64[:, :, ::1], float64[:, :, ::1])"
)
def advance_rows(rows, energies, bare, pieces, clock, units, work, slider, law, held, passed, spent):
    """Advance all rows and their energies through some clock steps, each row by itself.

    ``bare``: work of adhesion of each row without bonds. ``pieces``: number of the clock step, length, value of the
    drive at both ends and its integral. ``clock``: beginning of each step, load and its rate, base and its rate.
    ``units`` of the columns and of ``work``, by which rows differ from the numbers of slider, bonds and contact.
    ``passed``, ``spent``: columns and energies at the end of each step, shape (columns, steps, rows) and (steps, rows,
    energies). A row that nothing holds any longer ends there; its bonds and contact stay as they were.
    """
    room, row, energy = np.empty((ROOM, 3)), np.empty(COLUMNS), np.empty(energies.shape[1])
    for m in range(len(rows)):
        stop = 0
        for k in range(len(clock)):
            start = stop
            while stop < len(pieces) and pieces[stop, 0] == k:
                stop += 1
            take_up(row, energy, rows[m], energies[m], units, work)
            if law[5] != 0.0:
                row[MOMENT] = math.copysign(row[BOUND], row[SPEED]) if row[SPEED] != 0.0 else 0.0
            if math.isnan(row[ENDED]):
                now = held[:3] + (clock[k, 1], clock[k, 2], clock[k, 3], clock[k, 4]) + held[7:]
                time, going = _clock_step(row, bare[m], slider, law, now, pieces[start:stop], room, energy)
                if not going:
                    row[ENDED], row[POSITION], row[SPEED], row[BODY] = clock[k, 0] + time, math.nan, math.nan, math.nan
                    energy[:] = math.nan
            put_down(row, energy, rows[m], energies[m], units, work, passed[:, k, m], spent[k, m])
