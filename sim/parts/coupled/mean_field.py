"""Rows of sliders and bonds through a clock step: elastic slips at its start, sub-steps, stick and slip."""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.parts.bonds.mean_field import regula_falsi
from sim.parts.coupled import mechanics, radau

# by name: numba inlines no attribute of a module
from sim.parts.coupled.radau import accept, try_sub_step
from sim.parts.coupled.step_end import ENDS, end_step
from sim.parts.drive import ENERGY

#: Slip over the cut-off stretch on which bonds are tried, and that within which they may slip at once.
_TRIED, NEAR = 1e-7, 1e-3


@device
def stored_in(row, time, slider, law, contact):
    """Return the elastic and kinetic energy of spring, body, contact and bonds."""
    _, area, _, _ = mechanics.area_or_last(row.bound, row.moment, time, row, contact)
    return radau.stored_with(row, area, slider, law)


@device
def _lacking(shift, row, time, slider, law, contact):
    """Return the missing force of the bonds after a displacement at once, or the missing displacement of the body.

    Also N, M, radius, area, u then, and the displacement of the body.
    """
    left, sense = math.exp(-math.fabs(shift) * law.cuts), math.copysign(1.0, row.moment)
    bound, moment = (
        row.bound * left,
        (row.moment * left + sense * row.bound * (1.0 - left) / law.cuts) * left,
    )
    radius, area, _, _ = mechanics.contact_area(
        bound, moment, time, row.radius, contact
    )
    yields, _ = mechanics.compliance(radius, slider)
    sheared = yields * area * moment
    body = shift + sheared - row.sheared
    lacks = sense * (row.spring_force - slider.stiffness * body - area * moment)
    if slider.mass + slider.damping > 0.0:
        lacks, body = -sense * body, 0.0
    return lacks, bound, moment, radius, area, sheared, body


@device
def slip_event(row, time, reach, slider, law, contact, nodes, energy):
    """Slip at once to where bonds bear the pull again, if slip breaks more than it stretches; return the contact then.

    The slip may begin within a ``reach`` in units of the cut-off stretch. The force of such bonds over the slip has one
    hump, so that there is one such place. A contact that loses its equilibrium on the way keeps its radius from there.
    """
    if not slider.stiffness + slider.mass + slider.damping > 0.0:
        return contact
    sense, high, limit = (
        math.copysign(1.0, row.moment),
        _TRIED / law.cuts,
        1.0 / law.cuts,
    )
    here, _, _, _, first, _, _ = _lacking(0.0, row, time, slider, law, contact)
    lacks = _lacking(sense * high, row, time, slider, law, contact)[0]
    while not lacks > max(here, 0.0):
        if high > reach * limit:
            return contact
        high *= 2.0
        lacks = _lacking(sense * high, row, time, slider, law, contact)[0]
    before = stored_in(row, time, slider, law, contact)
    for _ in range(2):
        while lacks > 0.0:
            high *= 2.0
            lacks = _lacking(sense * high, row, time, slider, law, contact)[0]
        low = 0.0
        for _ in range(64):
            middle = 0.5 * (low + high)
            over = _lacking(sense * middle, row, time, slider, law, contact)[0] > 0.0
            low, high = (middle, high) if over else (low, middle)
        _, bound, moment, radius, area, sheared, body = _lacking(
            sense * high, row, time, slider, law, contact
        )
        if area >= 0.0:
            break
        lacks, _, _, last_radius, _, _, _ = _lacking(
            sense * low, row, time, slider, law, contact
        )
        row.radius = last_radius if last_radius > 0.0 else row.radius
        contact = mechanics.later(contact, 0.0, 1.0)
    # in a slip ds the share ds/l of the bonds breaks, stretched by twice the mean: 3/2 n κ M²/(N l) is lost with it
    left, mean = math.exp(-high * law.cuts), sense * row.moment
    later = mean * left + row.bound * limit * (1.0 - left)
    broken = (
        0.25
        * (first + area)
        * (1.0 - left)
        * (mean * mean + mean * later + later * later)
        / row.bound
    )
    row.bound, row.moment, row.radius, row.sheared = bound, moment, radius, sheared
    mechanics.displace(row, sense * high, body, slider)
    energy.rupture += broken
    energy.snaps += before - stored_in(row, time, slider, law, contact) - broken
    row.next_step, nodes.last_step = 1e-6 * slider.length, 0.0
    return contact


@device
def break_all(row, time, brief, slider, law, contact, energy):
    """Break all bonds at once and slip, where nothing delays it, if they last less than a ``brief`` time.

    Bonds that are stretched the more the fewer are left break ever faster, all of them in no time. True if they broke.
    """
    _, _, _, _, k, _ = radau.kinetics(row.bound, row.moment, 0.0, law)
    if not (k * brief > 1.0 and mechanics.slips_free(row, slider)):
        return False
    before = stored_in(row, time, slider, law, contact)
    _, area, _, _ = mechanics.area_or_last(row.bound, row.moment, time, row, contact)
    broken = 0.5 * area * row.moment * row.moment / row.bound
    mechanics.slip_free(row, time, slider, contact)
    energy.rupture += broken
    energy.snaps += before - stored_in(row, time, slider, law, contact) - broken
    return True


#: Changes between stick and slip without any time between them after which there is no solution to go on with.
_STUCK = 100
#: Factor between neighbouring speeds at which a balance of forces is looked for, and the least of them.
_SLOWER, _SLOWEST = 0.95, 1e-12
#: Places in a piece at which a slider that sticks is looked at, and halvings that place when it leaves.
_PLACES, _HALVINGS = 32, 60
#: Shares of bonds and of a piece beyond which equilibrium is looked for where no sub-step is accepted.
_NEXT_TO = 1e-6
#: Force over that of damping and spring which is a rounding.
_NO_FORCE = 1e-12
#: Turns in which area and stress of a slider at rest settle.
_FEW_TURNS = 20


#: Sum of the stretches that is none where a sub-step ends at a change of its sign, over the tolerance and the bonds.
_NONE = 1e-3


@device
def _at_end(row, nodes, step, law):
    """Return what may not change its sign in a solved sub-step, positive at its start.

    It is the sum of the stretches, or the speed of bonds without a stretch.
    """
    if law.sense == 0.0:
        return (row.moment + nodes.moment[2]) * math.copysign(1.0, row.moment)
    return radau.sum_over(radau.RATES, 2, nodes.slip) / step * law.sense


@device
def _to_zero(row, start, step, none, slider, law, contact, nodes):
    """Shorten a solved sub-step to where ``_at_end`` is zero, but for ``none``; return its length, True if solved."""
    first = math.fabs(row.moment) if law.sense == 0.0 else row.speed * law.sense
    bracket = 0.0, first, step, _at_end(row, nodes, step, law), 0
    for _ in range(100):
        near, above, far, below, _ = bracket
        step = near + (far - near) * (above / (above - below))
        if not radau.newton(row, start, step, slider, law, contact, nodes):
            return step, False
        value = _at_end(row, nodes, step, law)
        if math.fabs(value) <= none or far - near <= 1e-15 * far:
            break
        bracket = regula_falsi(bracket, step, value)
    return step, True


@device
def _piece(line, slider, law, contact, nodes, books):
    """Go through one piece of a clock step. Return the time reached, before its end if the motion ends.

    A contact that loses its equilibrium in a sub-step keeps its radius to the end of the clock step: then the last
    number returned is 1, else 0.
    """
    start, length, row, energy = 0.0, slider.length, line[0], books[0]
    yields, _ = mechanics.compliance(row.radius, slider)
    brittle = (
        law.cuts > 0.0
        and slider.viscosity == 0.0
        and (slider.mass + slider.damping == 0.0 or yields > 0.0)
    )
    turns, checked = 0, 0.0
    while turns >= 0:
        turns, checked = mechanics.judged(turns, checked, start, length)
        left = length - start
        step = mechanics.next_step(row, left, length, math.inf)
        if not step > mechanics.LEAST * length:
            gone = break_all(
                row, start, mechanics.BRIEF * length, slider, law, contact, energy
            )
            if law.cuts == 0.0 and not gone:
                gone = mechanics.snap(
                    row,
                    row.moment * row.moment / row.bound,
                    start,
                    slider,
                    contact,
                    energy,
                )
            if contact.stays > 0.0 and not gone:
                return start, contact.stays
            contact = contact if gone else mechanics.later(contact, 0.0, 1.0)
            nodes.last_step, row.next_step = 0.0, 0.0
            continue
        contact = mechanics.following(contact, row, start, step)
        grows, accepted = try_sub_step(row, start, step, slider, law, contact, nodes)
        if not accepted:
            row.next_step = step * grows
            if brittle and step < mechanics.BRIEF * length:
                contact = slip_event(
                    row, start, NEAR, slider, law, contact, nodes, energy
                )
            continue
        ahead = max(row.next_step, step * grows) if step == left else step * grows
        none = _NONE * slider.tolerance * row.bound
        reverses = (
            law.softness > 0.0
            and math.fabs(row.moment) > none
            and _at_end(row, nodes, step, law) < 0.0
        )
        # there the rupture rate has a kink, which no sub-step leads across
        if reverses:
            step, solved = _to_zero(row, start, step, none, slider, law, contact, nodes)
            if not solved:
                row.next_step = 0.5 * step
                continue
        line[1], books[1] = row, energy
        before, after = accept(row, start, step, slider, law, contact, nodes, energy)
        is_lost = math.isnan(row.radius)  # at its end the contact has no equilibrium
        if is_lost or mechanics.misses(
            before, after, books[1], energy, row, slider, step
        ):
            line[0], books[0], nodes.last_step, row.next_step = (
                line[1],
                books[1],
                0.0,
                0.25 * step,
            )
            continue
        row.next_step = ahead
        if step <= mechanics.BRIEF * length and contact.stays == 0.0:
            mechanics.book_jump(line, after - before, books)
        if reverses:
            row.moment, nodes.last_step = 0.0, 0.0
        # it turns in vain where the force of the bonds falls
        reach = NEAR if line[1].speed * row.speed < 0.0 else 0.0
        if brittle:
            contact = slip_event(
                row, start + step, reach, slider, law, contact, nodes, energy
            )
        if step == left:
            return length, contact.stays
        start += step
    return start, contact.stays


@device
def _slips(time, start, row, slider, law, contact):
    """Return the pull beyond the strength of the bonds at a time, if nothing has moved since the start."""
    share = radau.share_after_rest(row.bound, time - start, law)
    _, area, _, _ = mechanics.area_or_last(share, share, time, row, contact)
    return math.fabs(mechanics.pull_on(time, start, 0.0, row, slider)) - area * share


@device
def _rest(row, start, settles, slider, law, contact, energy):
    """Stay at rest until the pull exceeds the strength of the bonds; return its time or the end.

    A slip that ``settles`` has come to rest where pull and strength are equal, and the strength grows faster.
    """
    length = slider.length
    end, before = length, start
    for k in range(1 if settles else 0, _PLACES + 1):
        time = start + (length - start) * (k / _PLACES)
        if _slips(time, start, row, slider, law, contact) > 0.0:
            low, end = before, time
            for _ in range(_HALVINGS):
                middle = 0.5 * (low + end)
                if _slips(middle, start, row, slider, law, contact) > 0.0:
                    end = middle
                else:
                    low = middle
            break
        before = time
    first, last = row.spring_force, mechanics.pull_on(end, start, 0.0, row, slider)
    if slider.forced == 0.0:
        energy.work += 0.5 * (last - first) * (last + first) / slider.stiffness
    moment, share = 0.0, radau.share_after_rest(row.bound, end - start, law)
    # the stress takes a little of the area, if adhesion pays for it
    for _ in range(_FEW_TURNS):
        radius, area, _, _ = mechanics.area_or_last(share, moment, end, row, contact)
        moment = last / area if area > 0.0 else 0.0
    row.spring_force, row.bound, row.radius, row.moment = last, share, radius, moment
    row.speed, row.body_speed = 0.0, 0.0
    if end > start:
        mechanics.remember(row, 0.0, 0.0, 0.0, end - start, contact)
    return end


@device
def _unbalanced(speed, row, time, slider, law, contact):
    """Return the resistance of a body without mass at a speed less the pull, and its slope over the speed."""
    damping, viscosity = slider.damping, slider.viscosity
    share = row.bound * radau.share_left(law.sense * speed, law)
    _, area, by_bound, by_moment = mechanics.area_or_last(
        share, share, time, row, contact
    )
    bears = damping + area * viscosity
    slope = bears - law.slows * share * share * (
        area + (by_bound + by_moment) * (share + viscosity * speed)
    )
    return bears * speed + area * share - math.fabs(row.spring_force), slope


@device
def _jump(row, time, slider, law, contact):
    """Return the speed at which a body without mass begins to slip: the highest in balance with the pull.

    Newton's method from above, because friction is convex in the speed at constant area. Bonds that carry adhesion
    change the area with the speed. The balance is then bracketed if a step goes past it, or if resistance falls with
    the speed.
    """
    _, area, _, _ = mechanics.area_or_last(0.0, 0.0, time, row, contact)
    bears = slider.damping + area * slider.viscosity
    if not bears > 0.0:  # an open contact
        return 0.0
    speed = high = math.fabs(row.spring_force) / bears
    for _ in range(100):
        over, slope = _unbalanced(speed, row, time, slider, law, contact)
        if math.fabs(over) <= 1e-15 * speed * math.fabs(slope):
            return speed
        if over < 0.0 or not slope > 0.0:
            break
        high, speed = speed, max(speed - over / slope, 0.0)
    return _below(high, row, time, slider, law, contact)


@device
def _below(high, row, time, slider, law, contact):
    """Return the highest speed below another one at which the resistance of a body without mass equals the pull."""
    while (
        high < math.inf and _unbalanced(high, row, time, slider, law, contact)[0] < 0.0
    ):
        high *= 2.0
    low, least = _SLOWER * high, _SLOWEST * high
    while low > least and _unbalanced(low, row, time, slider, law, contact)[0] > 0.0:
        high, low = low, _SLOWER * low
    if not low > least:  # the pull is the strength at rest but for a rounding
        return 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _unbalanced(middle, row, time, slider, law, contact)[0] > 0.0:
            high = middle
        else:
            low = middle
    return high


@device
def _set_off(row, time, slider, law, contact, nodes):
    """Give a slider at the start of a slip its speed, which is zero with a mass, and its bonds their share there."""
    row.bound = 1.0 if law.slows != 0.0 else row.bound
    speed = (
        law.sense * _jump(row, time, slider, law, contact)
        if slider.mass == 0.0
        else 0.0
    )
    # no guess from the slip before
    row.speed, row.body_speed, nodes.last_step = speed, speed, 0.0
    row.bound *= radau.share_left(speed, law)
    row.moment = law.sense * row.bound


@device
def _slide(line, start, slider, along, contact, nodes, books):
    """Slip until the speed comes to zero or the piece ends. Return the time reached, and False without a solution."""
    length, row, energy = slider.length, line[0], books[0]
    turns, checked = 0, start
    while turns >= 0:
        turns, checked = mechanics.judged(turns, checked, start, length)
        left = length - start
        step = mechanics.next_step(row, left, length, math.inf)
        if not step > mechanics.LEAST * length:
            row.next_step = 0.0
            bound, later = row.bound * (1.0 - _NEXT_TO), start + _NEXT_TO * length
            _, area, _, _ = mechanics.contact_area(
                bound, row.moment, later, row.radius, contact
            )
            if not area >= 0.0:  # lost: the radius stays for the rest of the clock step
                contact = mechanics.later(contact, 0.0, 1.0)
                if slider.mass == 0.0:
                    _set_off(row, start, slider, along, contact, nodes)
                continue
            return start, slider.mass == 0.0 or row.speed == 0.0
        contact = mechanics.following(contact, row, start, step)
        grows, accepted = try_sub_step(row, start, step, slider, along, contact, nodes)
        if not accepted:
            row.next_step = step * grows
            continue
        stops = _at_end(row, nodes, step, along) <= 0.0
        if stops and row.speed != 0.0:
            step, _ = _to_zero(
                row,
                start,
                step,
                1e-13 * math.fabs(row.speed),
                slider,
                along,
                contact,
                nodes,
            )
        # too long for a speed that grows from nearly zero
        if stops and not nodes.slip[2] * along.sense > 0.0:
            if not step > mechanics.LEAST * length:
                # the speed is a rounding of zero, and so is the slip
                row.speed = row.body_speed = row.next_step = 0.0
                return start, True
            row.next_step = 0.25 * step
            continue
        line[1], books[1] = row, energy
        before, after = accept(row, start, step, slider, along, contact, nodes, energy)
        is_lost = math.isnan(row.radius)  # at its end the contact has no equilibrium
        if is_lost or mechanics.misses(
            before, after, books[1], energy, row, slider, step
        ):
            line[0], books[0], nodes.last_step, row.next_step = (
                line[1],
                books[1],
                0.0,
                0.25 * step,
            )
            continue
        row.next_step = (
            max(row.next_step, step * grows) if step == left else step * grows
        )
        start = length if step == left else start + step
        if stops:
            row.speed, row.body_speed = 0.0, 0.0
        if stops or start >= length:
            return start, True
    return start, False


@device
def _is_rounding(force, slider):
    """True if a force is next to nothing beside those by which spring and damping may change it in a piece."""
    speed = max(math.fabs(slider.first), math.fabs(slider.last))
    change = speed * (slider.damping + slider.stiffness * slider.length)
    return math.fabs(force) <= _NO_FORCE * change


@device
def _directed(law, sense):
    """Return the numbers of bonds without a stretch over which the slider goes in a direction."""
    return mechanics.Law(
        rate=law.rate,
        softness=law.softness,
        cuts=law.cuts,
        binding=law.binding,
        scale=law.scale,
        sense=sense,
        slows=law.slows,
    )


@device
def _sticking_piece(line, slider, law, contact, nodes, books):
    """Go through one piece with bonds that bear any pull up to their strength at rest. Return the time reached."""
    start, length, row, energy = 0.0, slider.length, line[0], books[0]
    sense, going, stuck, turns, checked = 0.0, True, 0, 0, 0.0
    # a slip that begins next to the end of the piece has no time for a sub-step
    end = (1.0 - mechanics.LEAST) * length
    while going and start < end and turns >= 0 and stuck <= _STUCK:
        turns, checked = mechanics.judged(turns, checked, start, length)
        before = start
        contact, rests = mechanics.feeling(contact, row), row.speed == 0.0
        if rests:
            settles = sense * row.spring_force > 0.0
            start = _rest(row, start, settles, slider, law, contact, energy)
            if start >= end:
                break
        sense = math.copysign(1.0, row.spring_force if rests else row.speed)
        # the pull is a rounding, which may have the wrong sign
        if rests and stuck > 0 and not row.radius > 0.0:
            row.next_step = 0.0
            # whose sign may be the wrong one
            if stuck % 2 == 1 and _is_rounding(row.spring_force, slider):
                sense = -sense
        along = _directed(law, sense)
        if rests:
            felt, at_rest = row.felt, contact
            contact = mechanics.leaving_rest(contact, row)
            _set_off(row, start, slider, along, contact, nodes)
            if not mechanics.remember_first(row, slider, contact):
                row.felt, contact = felt, at_rest
                _set_off(row, start, slider, along, contact, nodes)
        start, going = _slide(line, start, slider, along, contact, nodes, books)
        if going and start < length:
            row.speed = row.body_speed = 0.0
        stuck = stuck + 1 if start == before else 0
    return length if start >= end else start


@device
def _clock_step(line, slider, law, contact, pieces, nodes, books):
    """Go through a clock step; return the time reached, and False if the motion ends there."""
    row, energy = line[0], books[0]
    is_open, time, going, stays = row.radius == 0.0, 0.0, True, contact.stays
    for p in range(len(pieces)):
        slider, reached, nodes.last_step = (
            mechanics.slider_in(slider, pieces[p]),
            0.0,
            0.0,
        )
        ahead = mechanics.later(mechanics.feeling(contact, row), time, stays)
        if (
            is_open
            and law.sense != 0.0
            and slider.mass + slider.damping + slider.forced == 0.0
        ):
            # as nothing else holds an open contact, it goes along with the stage
            slip, _ = mechanics.free_shifts(row, slider)
            mechanics.displace(row, slip, slip, slider)
            row.speed = row.body_speed = mechanics.driven(0.0, slider)[1]
            row.spring_force = 0.0
            if law.slows != 0.0:
                row.bound = 1.0 / (1.0 + law.slows * math.fabs(row.speed))
        jumps = mechanics.force_jumps(row, slider)
        if p == 0 or jumps:
            unslipped = energy.stored
            if jumps:
                unslipped = stored_in(
                    row, 0.0, slider, law, mechanics.drawn(ahead, row, p)
                )
            before, worked = energy.stored if p == 0 else unslipped, energy.work
            if law.sense == 0.0:
                going, ahead = mechanics.answer(row, p, slider, ahead, energy)
            elif slider.forced > 0.0:
                row.spring_force = mechanics.driven(0.0, slider)[1]
            lost = (
                energy.work - worked - stored_in(row, 0.0, slider, law, ahead) + before
            )
            mechanics.book_slip(lost, before - unslipped, jumps, energy)
        if going and law.sense == 0.0:
            reached, stays = _piece(line, slider, law, ahead, nodes, books)
        elif going:
            reached = _sticking_piece(line, slider, law, ahead, nodes, books)
        time += reached
        if not (going and reached == slider.length):
            return time, False
    row.lost = stays - contact.stays
    contact = mechanics.later(mechanics.settled(contact, row, slider), 0.0, stays)
    if law.sense != 0.0:
        # such bonds find the contact anew at each time, so that it is lost only if it is at the end
        _, area, _, _ = mechanics.contact_area(
            row.bound, row.moment, time, row.radius, contact
        )
        row.lost = 1.0 if math.isnan(area) else 0.0
    energy.stored = stored_in(row, time, slider, law, contact)
    return time, True


@kernel(f"void({mechanics.ARGUMENTS}, {ENDS})")
def advance_rows(inputs, numbers, outputs, ends):
    """Advance all rows and their energies through some clock steps, each row by itself.

    ``numbers``: those of ``Slider``, ``Law``, ``Contact`` and ``FieldLaw``. ``outputs``: columns and
    energies at the end of each step, shape (columns, steps, rows) and (steps, rows, energies). ``ends``: ``StepEnds``.
    Values of a row are missing once its motion has ended (``mechanics.end``).
    """
    rows, energies, pieces, clock, units, work = inputs
    slider, law, contact = (
        mechanics.Slider(*numbers[0]),
        mechanics.Law(*numbers[1]),
        mechanics.contact_of(numbers),
    )
    reached, spent = outputs
    both, nodes = (
        (np.empty(2 * mechanics.COLUMNS), np.empty(2 * mechanics.ENERGIES)),
        np.empty(1, radau.NODE_VALUES),
    )
    # as they are, and before the last sub-step
    line, books = both[0].view(mechanics.ROW), both[1].view(ENERGY)
    columns, booked, row = (
        both[0][: mechanics.COLUMNS],
        both[1][: mechanics.ENERGIES],
        line[0],
    )
    room = np.empty((2, ends[0][4].size))
    for m in range(len(rows)):
        stop = 0
        for k in range(len(clock)):
            start, stop = stop, mechanics.pieces_to(k, stop, pieces)
            mechanics.to_units(columns, booked, rows[m], energies[m], units, work)
            if law.sense != 0.0:
                row.moment = (
                    math.copysign(row.bound, row.speed) if row.speed != 0.0 else 0.0
                )
            if row.closed > 0.0 and law.sense == 0.0:
                row.moment = 0.0
            now = mechanics.contact_at(contact, clock[k], row)
            if not mechanics.has_ended(row):
                time, going = _clock_step(
                    line, slider, law, now, pieces[start:stop], nodes[0], books
                )
                if not going:
                    mechanics.end(row, booked, clock[k, 0] + time, slider)
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
            reached[:, k, m], spent[k, m] = rows[m], energies[m]
            end_step(row, rows[m], m, k, clock[k, 5], now, ends, room)
