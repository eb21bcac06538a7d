"""Bonds followed one by one: a finite number of sites per member, every stretch, exact rupture times.

Each site is free or bound. A bond is born unstretched, is stretched by the slider, and breaks when its integrated
rupture reaches an exponential threshold. The site then waits an exponential time and binds again, at the position of
the slider at that moment. None of this depends on the clock step, because steps only cut the motion into pieces of
constant speed. The same motion in other steps gives the same lives except for rounding. The numbers of each life have
an address of their own (seed, site, life, member). So members depend neither on the batch nor on restarts.

A row is one member. All sites follow one slider, so Bell's rupture separates. ∫k dt of bond i is e^(−s x_i) times a
common clock, Φ(t) = ∫ rate e^(s x) dt. Here s is the softness, x the slider position, and x_i the slider position at
the formation of the bond. Positions are counted along the motion from where the frame was last set. A bond therefore
breaks when Φ passes a number fixed at its birth, its ``due``. The cost of a step is its events: blocks of sites without
an event in all the steps are passed over by their least due.

If all stretches of a row have the sign of the motion, its bonds are stepped together. If the motion turns, or a step
spans too many Bell forces for the common clock, each bond is stepped separately. Its ``due`` is then the rest of its
threshold. This ends when all stretches have the sign of the motion again. Bonds whose rate is not one exponential have
no common clock, and are always stepped separately.

A driven slider slips back a little at once whenever a binding enlarges its contact. The few youngest bonds are then
ahead of the slider, and only they are followed separately, as *turned* bonds: their ``due`` is infinite, and a list at
the end of the frame has the rests of their thresholds. A turned bond joins the others when the slider has passed it. So
an event costs a time that grows with the logarithm of the sites. If a slip turns more bonds than the list has room for,
all are stepped separately, until half of the list has room for those ahead.

One array holds two kinds of due: a bound site's, never negative, and minus the time at which a free
site binds. Read as unsigned whole numbers, the bits of such floats have the first rupture as their
least; read as signed ones, the first binding. Whole numbers are compared by vector instructions. A
free site keeps the threshold of its next bond in its ``birth``.

Site after site lives through all the steps and adds each event to the sums of its step. So the sums of a step are in
the order of the sites, however many steps are made at once.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, inlined, kernel
from sim.numerics.noise import PARTS, exponential, logarithm, unit_at, words_at
from sim.numerics.special import (
    reduced_exponential_integral,
    scaled_exponential_integral,
)
from sim.parts.bonds import cohorts
from sim.parts.bonds.rupture import (
    RuptureRate,
    has_factor,
    hazard_integral,
    hazard_time,
)
from sim.parts.exchange import Array, record

#: Columns of a frame: slider, time and clock since the frame was set, sense of the motion (+1, -1), 1 if bonds
#: are stepped one by one, bound sites, sum of their births, of the births squared, number of ``turned`` bonds, number
#: of steps.
SLIDER, TIME, CLOCK, SENSE, SINGLY, BOUND, SUM, SQUARES, TURNED, STEPS = range(10)
COLUMNS = 10
#: Place in the frame of a driven row, after these columns, from which on it has the sites of ``turned`` bonds, each
#: followed by the rest of its threshold.
_LIST = COLUMNS

#: Sites of one block.
BLOCK = 16

#: Bonds of a row, at most, whose stretch is against the motion while all others are stepped together.
MOST_TURNED = 64

#: Steps made at once, at most.
AT_ONCE = 1024

_U = np.uint64
PART = _U(PARTS["bonds"])
#: Bits of the due of a turned bond, which is infinite.
_ENDLESS = np.float64(math.inf).view(np.int64)
# of one site in one step: a safeguard, because the rule for long steps comes first
LIVES = 4096
TINY = 2.2250738585072014e-308

#: A step: slider, time and clock at its beginning, the rate of a bond born at the frame's origin then and
#: its ratio to ``rate``, relative growth of that rate in unit time, length and speed.
_STEP = record("x time clock rate grown pace duration speed")
#: Rows of the ends of a step: bonds of less due, free sites of less time and bonds of less birth have had an event.
RUPTURE, BINDING, _CUT = range(3)
#: Rows of ``soonest`` beside the first two, and of the ``winners``.
_REAR, _FRONT, _FOREMOST = 2, 3, 2
#: Bits of a number that are left out where a step is looked up, 128 ranges for each power of two; most ranges.
_LEFT_OUT, _RANGES = np.int64(45), 4096


class SiteLaw(NamedTuple):
    """Law of the lives of a site: the numbers of ``LawNumbers``, the rate of rebinding [1/s], 1 if bonds may turn.

    Bonds turn if the slider slips back at once, because its contact grows.
    """

    rate: float
    softness: float
    limit: float
    catch: float
    relief: float
    table: float
    rebinding: float
    turns: float


#: Type of the numbers of ``SiteLaw`` in kernels.
SITE_LAW = f"UniTuple(float64, {len(SiteLaw._fields)})"


def site_law(
    rupture: RuptureRate, rebinding_rate: float, turns: bool = False
) -> tuple[float, ...]:
    """Return the numbers of ``SiteLaw``."""
    return *rupture.numbers, float(rebinding_rate), float(turns)


@device
def room():
    """Return work arrays: steps, their ends, changes of bound sites and their sums in each step, an index of ends.

    The last array is the number of the first range of the index.
    """
    steps, index = np.empty(AT_ONCE, _STEP), np.empty((2, _RANGES), np.int16)
    return (
        steps,
        np.empty((3, AT_ONCE)),
        np.empty((3, AT_ONCE)),
        index,
        np.empty(2, np.int64),
    )


@device
def views(due, soonest):
    """Return a row's due as signed and unsigned integers, and first binding, first rupture and ends of blocks."""
    whole = soonest.view(np.int64)
    return (
        due.view(np.int64),
        due.view(np.uint64),
        whole[1],
        soonest.view(np.uint64)[0],
        soonest[_REAR:],
    )


@inlined
def least(bits, birth, block, law):
    """Write the first binding, the first rupture, and the rearmost and foremost bond of a block anew."""
    signed, unsigned, binding, rupture, ends = bits
    first = _U(block) * _U(BLOCK)
    size = min(BLOCK, np.int64(_U(signed.size) - first))
    soonest, earliest = signed[first], unsigned[first]
    if size == BLOCK:  # of known length, for vector instructions
        for j in range(BLOCK):
            soonest = min(soonest, signed[first + _U(j)])
            earliest = min(earliest, unsigned[first + _U(j)])
    else:
        for j in range(size):
            soonest = min(soonest, signed[first + _U(j)])
            earliest = min(earliest, unsigned[first + _U(j)])
    binding[block], rupture[block] = soonest, earliest
    if law.limit < math.inf:
        least = math.inf
        for j in range(size):
            i = first + _U(j)
            least = birth[i] if signed[i] >= 0 and birth[i] < least else least
        ends[0, block] = least
    if law.turns > 0.0:
        front = math.inf
        for j in range(size):
            i = first + _U(j)
            front = (
                -birth[i] if 0 <= signed[i] < _ENDLESS and -birth[i] < front else front
            )
        ends[1, block] = front


@device
def lay_out(step, slip, duration, x, time, clock, law, space):
    """Write a step that begins with the slider at ``x`` and a ``time`` and ``clock``; return the clock at its end."""
    softness, (steps, ends, _, _, _) = law.softness, space
    grown, bell = math.exp(softness * x), softness * slip
    first, speed = law.rate * grown, slip / duration
    after = clock + first * duration * (math.expm1(bell) / bell if bell > 0.0 else 1.0)
    at = steps[step]
    at.x, at.time, at.clock, at.rate = x, time, clock, first
    at.grown, at.pace, at.duration, at.speed = grown, speed * softness, duration, speed
    ends[RUPTURE, step], ends[BINDING, step], ends[_CUT, step] = (
        after,
        time + duration,
        x + slip - law.limit,
    )
    return after


@device
def _range(value):
    """Return the number of the range that holds a positive number, by its leading bits."""
    return np.float64(value).view(np.int64) >> _LEFT_OUT


@device
def look_up(count, space):
    """Index ``count`` steps by their ends: write the first step that ends in each range of numbers, or later."""
    _, ends, _, index, lowest = space
    for row in range(2):
        lowest[row], filled = _range(ends[row, 0]), 0
        for k in range(count):
            last = min(_range(ends[row, k]) - lowest[row], _RANGES - 1)
            while filled <= last:
                index[row, filled] = k
                filled += 1


@device
def moment(clock, rate, pace, cut, duration):
    """Return the time within a step at which the clock has advanced by ``clock``, or a bond is cut, if earlier."""
    time = clock / rate
    u = 1.0 + pace * time  # ln u/(u - 1) takes back what the sum has rounded: log1p
    moment = time * (1.0 if u == 1.0 else logarithm(u) / (u - 1.0))
    moment = moment if moment < cut else cut
    return min(moment, duration) if moment > 0.0 else 0.0


@device
def follow(bonds, soonest, count, law, address, space):
    """Advance a row whose bonds all have the sign of the motion over the first ``count`` steps of the ``space``.

    ``bonds`` are its births, dues and lives, ``address`` seed and member of its draws. Arrays are not passed on from
    the loop over events: counting their references takes as long as an event.
    """
    (
        (birth, due, life),
        (steps, ends, changes, index, lowest),
    ) = bonds, space
    limit, rebinding = law.limit, law.rebinding
    bits, bounded, (seed, member) = views(due, soonest), limit < math.inf, address
    signed, unsigned, binding, rupture, sides = bits
    clock, time, cut = (
        ends[RUPTURE, count - 1],
        ends[BINDING, count - 1],
        ends[_CUT, count - 1],
    )
    clock_bits, time_bits = (
        np.float64(clock).view(np.uint64),
        np.float64(-time).view(np.int64),
    )
    changes[:, :count] = 0.0
    for block in range(rupture.size):
        if not (
            rupture[block] <= clock_bits
            or binding[block] <= time_bits
            or sides[0, block] <= cut
        ):
            continue
        for i in range(block * BLOCK, min((block + 1) * BLOCK, due.size)):
            if not (
                unsigned[i] <= clock_bits
                or signed[i] <= time_bits
                or (bounded and birth[i] <= cut)
            ):
                continue
            at, x, k, events, number = due[i], birth[i], 0, 0, life[i]
            bound = signed[i] >= 0
            while True:
                row, value, next_ = (
                    (RUPTURE if bound else BINDING),
                    math.fabs(at),
                    count,
                )
                if value <= ends[row, count - 1]:
                    place = min(max(_range(value) - lowest[row], 0), _RANGES - 1)
                    next_ = max(k, np.int64(index[row, place]))
                    while ends[row, next_] < value:
                        next_ += 1
                if bound and x <= cut:
                    by_cut = k
                    while ends[_CUT, by_cut] < x:
                        by_cut += 1
                    next_ = min(next_, by_cut)
                events = events + 1 if next_ == k else 1
                if events > LIVES:
                    next_, events = next_ + 1, 1
                k = next_
                if k >= count:
                    break
                step = steps[k]
                rate, pace, speed = step.rate, step.pace, step.speed
                if bound:
                    changes[0, k] -= 1.0
                    changes[1, k] -= x
                    changes[2, k] -= x * x
                    number += np.uint32(1)
                    first, second, _, _ = words_at(
                        seed, PART, _U(i + 1), _U(number), member, _U(0)
                    )
                    end = (
                        (x + limit - step.x) / speed
                        if bounded and speed > 0.0
                        else math.inf
                    )
                    elapsed = moment(at - step.clock, rate, pace, end, step.duration)
                    x, wait = exponential(first), exponential(second) / rebinding
                    at = (
                        -max(step.time + elapsed + wait, TINY)
                        if rebinding > 0.0
                        else -math.inf
                    )
                else:
                    elapsed = max(value - step.time, 0.0)
                    bell = pace * elapsed
                    more = math.expm1(bell)
                    clock = step.clock + rate * elapsed * (
                        more / bell if bell > 0.0 else 1.0
                    )
                    at, x = (
                        clock + x * step.grown * (1.0 + more),
                        step.x + speed * elapsed,
                    )
                    changes[0, k] += 1.0
                    changes[1, k] += x
                    changes[2, k] += x * x
                bound = not bound
            due[i], birth[i], life[i] = at, x, number
        least(bits, birth, block, law)


#: Results of ``live`` other than a number of steps: the state has been advanced already; a number is not finite.
SPENT, ENDLESS = -1, -2

#: Lives of a site in one step beyond which the step ends in the stationary law of its speed.
CYCLES = 300.0
# Bell forces, cut-off stretches or natural lives after which a frame is set anew
_FAR = 16.0
# Bell forces within a step above which bonds are stepped one by one, because the clock could overflow
_LEAP = 24.0


@device
def _cycle(speed, law):
    """Return roughly the mean time from one birth to the next of a site: a fresh bond's life at ``speed`` and the wait.

    It is exact for constant rupture laws, with or without a limit, and within a sixth for Bell's:
    e^z E1(z) ~ ½ ln(1 + 2/z). For a law without a common clock it is the time after which 1/e of the bonds are left.
    """
    rate, softness, limit, rebinding = law.rate, law.softness, law.limit, law.rebinding
    life = math.inf
    if not has_factor(law):
        life = hazard_time(0.0, speed, 1.0, law)
    elif rate > 0.0:
        amplitude = 2.0 * math.fabs(speed) * softness / rate
        life = (math.log1p(amplitude) / amplitude if amplitude > 0.0 else 1.0) / rate
    if speed != 0.0 and limit < math.inf:
        longest = limit / math.fabs(speed)
        life = longest if life == math.inf else -life * math.expm1(-longest / life)
    return life + (1.0 / rebinding if rebinding > 0.0 else math.inf)


@inlined
def _live_on(i, bonds, start, motion, law, address):
    """Advance one site by a step; its due is the rest of its threshold while it is bound.

    ``start``: slider and time at the beginning of the step. ``motion``: speed and duration.
    """
    (birth, due, _), (x0, t0), (speed, duration) = bonds, start, motion
    time = 0.0
    for _ in range(LIVES):
        left = duration - time
        if math.copysign(1.0, due[i]) > 0.0:
            stretch = x0 + speed * time - birth[i]
            spent = hazard_integral(stretch, speed * left, left, law)
            if spent < due[i] and math.fabs(stretch + speed * left) < law.limit:
                due[i] -= spent
                break
            lasts = hazard_time(stretch, speed, due[i], law)
            time += min(lasts, left) if lasts > 0.0 else 0.0
            _break(i, bonds, t0 + time, law, address)
        elif -due[i] > t0 + duration:
            break
        else:
            time = max(-due[i] - t0, 0.0)
            due[i], birth[i] = birth[i], x0 + speed * time


@inlined
def _break(i, bonds, time, law, address):
    """Begin the next life of a site whose bond breaks at a ``time``, by new draws of threshold and waiting time."""
    (birth, due, life), (seed, member), rebinding = bonds, address, law.rebinding
    life[i] += np.uint32(1)
    first, second, _, _ = words_at(seed, PART, _U(i + 1), _U(life[i]), member, _U(0))
    birth[i], wait = exponential(first), exponential(second) / rebinding
    due[i] = -max(time + wait, TINY) if rebinding > 0.0 else -math.inf


@device
def _one_by_one(tracks, slip, duration, law, address):
    """Advance a row by a step bond by bond; return the sense in which its bonds can then be stepped together, or 0.

    The sense is 1 if it is that of the frame, and -1 if it is the opposite one.
    """
    bonds, _, row = tracks
    birth, due, _ = bonds
    x0, t0, speed = row[SLIDER], row[TIME], slip / duration
    bound, total, squares, lowest, highest = 0.0, 0.0, 0.0, math.inf, -math.inf
    ahead = 0
    for i in range(due.size):
        _live_on(i, bonds, (x0, t0), (speed, duration), law, address)
        if math.copysign(1.0, due[i]) > 0.0:
            bound += 1.0
            total += birth[i]
            squares += birth[i] * birth[i]
            lowest, highest = min(lowest, birth[i]), max(highest, birth[i])
            ahead += birth[i] > x0 + slip
    row[SLIDER], row[TIME] = x0 + slip, t0 + duration
    row[BOUND], row[SUM], row[SQUARES] = bound, total, squares
    if slip == 0.0 or not has_factor(law):
        return 0.0
    if slip < 0.0 and lowest >= x0 + slip:
        return -1.0
    few = (_room_for(row) + 1) // 2 if law.turns > 0.0 else 0
    return 1.0 if ahead <= few and (slip > 0.0 or few > 0) else 0.0


@device
def _room_for(frame):
    """Return the number of turned bonds that a frame has room for."""
    return (frame.size - _LIST) // 2


@device
def _turned(k, frame):
    """Return the site of one of the turned bonds, and the rest of its threshold."""
    return np.int64(frame[_LIST + 2 * k]), frame[_LIST + 2 * k + 1]


@device
def _turn(i, rest, due, frame):
    """Add the bond of a site to the turned ones: it then has no due on the common clock."""
    k = _LIST + 2 * np.int64(frame[TURNED])
    frame[k], frame[k + 1], due[i] = i, rest, math.inf
    frame[TURNED] += 1.0


@device
def _drop(k, frame):
    """Take one of the turned bonds from their list."""
    frame[TURNED] -= 1.0
    last = _LIST + 2 * np.int64(frame[TURNED])
    frame[_LIST + 2 * k], frame[_LIST + 2 * k + 1] = frame[last], frame[last + 1]


@device
def _set(tracks, law, singly, turn):
    """Set the origin of a row's frame at the slider and at the present time; the sense may turn.

    Its bonds are then stepped together, or one by one if ``singly`` or if they have no common clock. Sums and least
    dues are computed anew, so that roundings do not add up. A bond ahead of the slider is a turned one if the others
    are stepped together.
    """
    (birth, due, _), soonest, row = tracks
    softness, singly = law.softness, singly or not has_factor(law)
    x0, t0, clock = row[SLIDER], row[TIME], row[CLOCK]
    scale = math.exp(-softness * x0)
    sign = -1.0 if turn else 1.0
    was_single = row[SINGLY] > 0.0
    bound, total, squares = 0.0, 0.0, 0.0
    for i in range(due.size):
        if math.copysign(1.0, due[i]) < 0.0:
            due[i] = -max(-due[i] - t0, TINY)
            continue
        x = sign * (birth[i] - x0)
        if not was_single:
            due[i] = max(due[i] - clock, 0.0) * (
                math.exp(-softness * birth[i]) if singly else scale
            )
        elif not singly and x > 0.0:
            _turn(i, due[i], due, row)
        elif not singly:
            due[i] *= math.exp(softness * x)
        birth[i] = x
        bound += 1.0
        total += x
        squares += x * x
    if singly:
        for k in range(np.int64(row[TURNED])):
            i, rest = _turned(k, row)
            due[i] = rest
        row[TURNED] = 0.0
    else:
        soonest[_REAR:] = math.inf
        bits = views(due, soonest)
        for block in range(soonest.shape[1]):
            least(bits, birth, block, law)
    row[SLIDER], row[TIME], row[CLOCK], row[SENSE] = 0.0, 0.0, 0.0, sign * row[SENSE]
    row[SINGLY], row[BOUND], row[SUM], row[SQUARES] = (
        1.0 if singly else 0.0,
        bound,
        total,
        squares,
    )


#: Arrays of ``Tracks``.
TRACKS = (
    "Tuple((float64[:,::1], float64[:,::1], uint32[:,::1], float64[:,:,::1], int64[::1], float64[:,::1],"
    " float64[:,::1]))"
)


@device
def _far(x, time, law):
    """True if a frame must be set anew with the slider at ``x`` after a ``time``."""
    distance = math.fabs(x)
    is_far = distance * law.softness > _FAR or distance > _FAR * law.limit
    return is_far or time * law.rate > _FAR


@device
def _together(row, slip, duration, law, space):
    """Lay out the steps that a row's bonds can follow together, and return their number.

    The last of these is a step after which the frame is set anew. ``slip`` and ``duration`` are those of the steps
    ahead.
    """
    x, time, clock, count = row[SLIDER], row[TIME], row[CLOCK], 0
    while count < min(duration.size, AT_ONCE) and not (
        count > 0 and _far(x, time, law)
    ):
        along = row[SENSE] * slip[count]
        if along < 0.0 or law.softness * along > _LEAP:
            break
        clock = lay_out(count, along, duration[count], x, time, clock, law, space)
        x, time = x + along, time + duration[count]
        count += 1
    if count > 0:
        look_up(count, space)
    return count


@device
def _follow_turned(tracks, slip, duration, law, address):
    """Advance the turned bonds of a row by a step that the others have followed together.

    Bonds that the slider has passed are then stepped together with the others.
    """
    bonds, soonest, row = tracks
    birth, due, _ = bonds
    along, bits = row[SENSE] * slip, views(due, soonest)
    start = row[SLIDER] - along, row[TIME] - duration
    for k in range(np.int64(row[TURNED]) - 1, -1, -1):
        i, rest = _turned(k, row)
        x, due[i] = birth[i], rest
        _live_on(i, bonds, start, (along / duration, duration), law, address)
        is_bound = math.copysign(1.0, due[i]) > 0.0
        after, number = (birth[i], 0.0) if is_bound else (0.0, -1.0)
        row[BOUND] += number
        row[SUM] += after - x
        row[SQUARES] += after * after - x * x
        if is_bound and after > row[SLIDER]:
            row[_LIST + 2 * k + 1], due[i] = due[i], math.inf
            continue
        if is_bound:
            due[i] = row[CLOCK] + due[i] * math.exp(law.softness * after)
        _drop(k, row)
        least(bits, birth, i // BLOCK, law)


@device
def _keep(row, slip, duration, count, space, frames):
    """Write the frames of a row after each of ``count`` steps that were followed together."""
    _, ends, changes, _, _ = space
    for k in range(count):
        row[SLIDER], row[TIME], row[CLOCK] = (
            row[SLIDER] + row[SENSE] * slip[k],
            row[TIME] + duration[k],
            ends[0, k],
        )
        row[BOUND] += changes[0, k]
        row[SUM] += changes[1, k]
        row[SQUARES] += changes[2, k]
        row[STEPS] += 1.0
        frames[:, k] = row[:COLUMNS]


@device
def _advance(tracks, ahead, law, address, space, laid, shared, frames):
    """Advance a row by some of the steps ahead, write its frame after each of them, and return their number.

    ``tracks``: bonds, the soonest of them, and frame of the row. ``ahead``: slips and durations of the steps. ``laid``
    is the frame of a row whose steps are laid out, and their number. They serve all rows of a ``shared`` slip with the
    same frame.
    """
    (bonds, soonest, row), (slip, duration), count = tracks, ahead, 0
    if row[SINGLY] == 0.0:
        here = (
            shared
            and row[STEPS] == laid[STEPS]
            and np.all(row[:SINGLY] == laid[:SINGLY])
        )
        if not (here and laid[COLUMNS] <= duration.size):
            laid[:COLUMNS], laid[COLUMNS] = (
                row[:COLUMNS],
                _together(row, slip, duration, law, space),
            )
        count = np.int64(laid[COLUMNS])
    if count > 0:
        follow(bonds, soonest, count, law, address, space)
        _keep(row, slip, duration, count, space, frames)
        if row[TURNED] > 0.0:
            _follow_turned(tracks, slip[0], duration[0], law, address)
    else:
        if row[SINGLY] == 0.0:
            _set(tracks, law, True, False)
        along, count = row[SENSE] * slip[0], 1
        sense = _one_by_one(tracks, along, duration[0], law, address)
        if sense != 0.0:
            _set(tracks, law, False, sense < 0.0)
        row[STEPS] += 1.0
    if _far(row[SLIDER], row[TIME], law):
        _set(tracks, law, row[SINGLY] > 0.0, False)
    frames[:, count - 1] = row[:COLUMNS]
    return count


#: Size of the work array of ``one_step``.
SCRATCH = 19 + 2 * COLUMNS + 1


@device
def one_step(tracks, slip, duration, law, address, scratch):
    """Advance a row by one step.

    All work arrays are parts of one, because a call copies each array that it passes on, which takes as long as an
    event.
    """
    space = (
        scratch[:8].view(_STEP),
        scratch[8:11].reshape(3, 1),
        scratch[11:14].reshape(3, 1),
        scratch[14:15].view(np.int16).reshape(2, 2),
        scratch[15:17].view(np.int64),
    )
    ahead, laid = (scratch[17:18], scratch[18:19]), scratch[19 : 20 + COLUMNS]
    ahead[0][0], ahead[1][0], laid[0] = slip, duration, math.nan
    frame = scratch[20 + COLUMNS :].reshape(COLUMNS, 1)
    _advance(tracks, ahead, law, address, space, laid, False, frame)


@kernel(
    f"int64({TRACKS}, float64[:,:], float64[:], {SITE_LAW}, uint64, uint64[:], int64, float64[:,:,::1])"
)
def live(tracks, slip, duration, law, seed, members, first, frames):
    """Advance all rows from step ``first`` on, in place; return the number of steps, ``SPENT`` or ``ENDLESS``.

    The new state has its own copy of the frame. ``frames``, of shape (rows, columns, steps), get the frame after each
    step. A row stops before a step that is longer than about 300 lives of a site, and its count of steps is returned.
    No row advances beyond this step. Nothing is touched if the state is spent or a number endless.
    """
    birth, due, life, soonest, stamp, _, frame = tracks
    rows, end, law = len(due), first, SiteLaw(*law)
    for m in range(rows):
        if stamp[m] != np.int64(frame[m, STEPS]):
            return SPENT
    long = np.zeros(rows, np.bool_)
    while end < duration.size and not long.any():
        if not (
            0.0 < duration[end] < math.inf and np.all(np.abs(slip[end]) < math.inf)
        ):
            return ENDLESS
        for m in range(rows):
            speed = slip[end, m % slip.shape[1]] / duration[end]
            long[m] = duration[end] > CYCLES * _cycle(speed, law)
        end += 1
    space, laid, shared, start = (
        room(),
        np.full(COLUMNS + 1, math.nan),
        slip.shape[1] == 1,
        first,
    )
    while start < end:
        stop = end
        for m in range(rows):
            bonds, address, k = (birth[m], due[m], life[m]), (seed, members[m]), start
            until = min(stop, end - 1 if long[m] else end)
            while k < until:
                ahead = slip[k:until, m % slip.shape[1]], duration[k:until]
                row, after = frame[m], frames[m, :, k:until]
                here = bonds, soonest[m], row
                k += _advance(here, ahead, law, address, space, laid, shared, after)
                if m == 0:  # the other rows use the same steps
                    until = stop = k
            stamp[m] = np.int64(frame[m, STEPS])
        start = stop
    return end


@device
def relax(tracks, law):
    """Take the stretch from all bonds of a row of ``Tracks``, in place.

    The rest of the threshold of a bond is exponential whatever its life was, so no number is drawn.
    """
    (birth, due, _), _, _ = tracks
    _set(tracks, law, True, False)
    for i in range(len(due)):
        if math.copysign(1.0, due[i]) > 0.0:
            birth[i] = 0.0
    _set(tracks, law, False, False)


@kernel(
    f"void({TRACKS}, boolean[:], float64[:], float64[:], float64[:], {SITE_LAW}, uint64, uint64[:])"
)
def draw(tracks, chosen, speed, share, age, law, seed, members):
    """Draw chosen rows anew: a ``share`` of sites bound, their ages by the survival law of a bond of mean life ``age``.

    The density of ages S(t)/⟨T⟩ is log-concave with its mode at 0: rejection under min(1, e^(1 − t/⟨T⟩))/⟨T⟩ accepts
    every second proposal (Devroye, Non-Uniform Random Variate Generation, 1986, VII.2). A bond of any age still has an
    exponential threshold ahead.
    """
    birth, due, life, soonest, stamp, _, frame = tracks
    law = SiteLaw(*law)
    limit, rebinding = law.limit, law.rebinding
    for m in range(due.shape[0]):
        if not chosen[m % chosen.size]:
            continue
        v, mean, bonded = (
            speed[m % speed.size],
            age[m % age.size],
            share[m % share.size],
        )
        for i in range(due.shape[1]):
            life[m, i] += np.uint32(1)
            site, number = _U(i + 1), _U(life[m, i])
            first, second, third, _ = words_at(
                seed, PART, site, number, members[m], _U(1)
            )
            birth[m, i] = exponential(second)
            due[m, i] = (
                -max(exponential(third) / rebinding, TINY)
                if rebinding > 0.0
                else -math.inf
            )
            if unit_at(first) >= bonded:
                continue
            due[m, i], elapsed = birth[m, i], 0.0
            for lane in range(2, 256 if mean > 0.0 else 2):
                first, second, third, _ = words_at(
                    seed, PART, site, number, members[m], _U(lane)
                )
                tail = (
                    1.0 + exponential(second)
                    if unit_at(first) >= 0.5
                    else unit_at(second)
                )
                elapsed, bar = tail * mean, exponential(third) + max(tail - 1.0, 0.0)
                spent = hazard_integral(0.0, v * elapsed, elapsed, law)
                if spent <= bar and math.fabs(v) * elapsed < limit:
                    break
            birth[m, i] = -v * elapsed
        row = frame[m]
        row[:STEPS] = 0.0
        row[SENSE], row[SINGLY] = 1.0, 1.0
        of_row = (birth[m], due[m], life[m]), soonest[m], row
        _set(of_row, law, False, v < 0.0)
        row[STEPS] += 1.0
        stamp[m] = np.int64(row[STEPS])


@inlined
def _rank_block(block, winners, soonest):
    """Write the first of each kind in a block at its place of the ``winners``."""
    place = block + winners.shape[1] // 2
    for row in range(2):
        soon = soonest[row, block]
        is_any = math.copysign(1.0, soon) == 1.0 - 2.0 * row and soon == soon
        winners[row, place] = math.fabs(soon) if is_any else math.inf
    if winners.shape[0] > _FOREMOST:
        winners[_FOREMOST, place] = soonest[_FRONT, block]


@inlined
def _rank_places(place, winners):
    """Write the first of each kind of two places of the ``winners`` at the place above them."""
    for row in range(winners.shape[0]):
        winners[row, place] = min(winners[row, 2 * place], winners[row, 2 * place + 1])


@device
def rank(tracks, law, winners):
    """Set the frame anew if it is far from its origin, and write the ``winners`` if they are not those of the frame.

    Place 1 has the first rupture and the first binding of all blocks, and minus the birth of the foremost bond that is
    not turned. Each place has the least of the two places at twice its number, so an event changes few of them. Place
    0 has the number of steps.
    """
    _, soonest, frame = tracks
    if _far(frame[SLIDER], frame[TIME], law):
        _set(tracks, law, False, False)
        winners[0, 0] = -1.0
    if winners[0, 0] != frame[STEPS]:
        half = winners.shape[1] // 2
        winners[:, half:] = math.inf
        for block in range(soonest.shape[1]):
            _rank_block(block, winners, soonest)
        for place in range(half - 1, 0, -1):
            _rank_places(place, winners)
        winners[0, 0] = frame[STEPS]


@device
def _refresh(block, tracks, law, winners):
    """Write a block that has changed anew, and its part in the ``winners``."""
    (birth, due, _), soonest, _ = tracks
    least(views(due, soonest), birth, block, law)
    _rank_block(block, winners, soonest)
    place = (block + winners.shape[1] // 2) // 2
    while place > 0:
        _rank_places(place, winners)
        place //= 2


@inlined
def _block_of(row, winners):
    """Return the block that has the first place in a ``row`` of the winners."""
    place = 1
    while place < winners.shape[1] // 2:
        place = (
            2 * place if winners[row, 2 * place] == winners[row, 1] else 2 * place + 1
        )
    return place - winners.shape[1] // 2


@device
def slip_back(tracks, along, law, winners):
    """Slip back at once by ``along``, below zero, if few bonds are ahead of the slider then; return True if so.

    No bond may break in the slip. Bonds ahead are turned. Each keeps the rest of its threshold, because the clock of
    the others is not its own.
    """
    (birth, due, _), _, frame = tracks
    rank(tracks, law, winners)
    x = frame[SLIDER] + along
    while -winners[_FOREMOST, 1] > x:
        if frame[TURNED] == _room_for(frame):
            return False
        block, front = _block_of(_FOREMOST, winners), -winners[_FOREMOST, 1]
        i = block * BLOCK
        while not (birth[i] == front and 0.0 <= due[i] < math.inf):
            i += 1
        rest = max(due[i] - frame[CLOCK], 0.0) * math.exp(-law.softness * birth[i])
        _turn(i, rest, due, frame)
        _refresh(block, tracks, law, winners)
    for k in range(np.int64(frame[TURNED])):
        i, _ = _turned(k, frame)
        if birth[i] - x >= law.limit:
            return False
    let_pass(frame, along, 0.0, frame[CLOCK], winners)
    return True


@device
def pass_turned(tracks, law, winners):
    """Step turned bonds that the slider has passed together with the others again."""
    (birth, due, _), _, frame = tracks
    for k in range(np.int64(frame[TURNED]) - 1, -1, -1):
        i, rest = _turned(k, frame)
        if birth[i] <= frame[SLIDER]:
            due[i] = frame[CLOCK] + rest * math.exp(law.softness * birth[i])
            _drop(k, frame)
            _refresh(i // BLOCK, tracks, law, winners)


@device
def first_turned(tracks, speed, most, law):
    """Return the time, at most ``most``, after which a turned bond breaks at a speed, and its place or -1."""
    (birth, _, _), _, frame = tracks
    x, along, first = frame[SLIDER], frame[SENSE] * speed, -1
    farthest, least_rest = 0.0, math.inf
    for k in range(np.int64(frame[TURNED])):
        i, rest = _turned(k, frame)
        farthest, least_rest = (
            max(farthest, math.fabs(x - birth[i])),
            min(least_rest, rest),
        )
    farthest += math.fabs(along) * most
    # by far the most motions are too short for any of them
    if law.rate * math.exp(law.softness * farthest) * most < least_rest and (
        farthest < law.limit
    ):
        return most, first
    for k in range(np.int64(frame[TURNED])):
        i, rest = _turned(k, frame)
        time = hazard_time(x - birth[i], along, rest, law)
        if time < most:
            most, first = time, k
    return most, first


@device
def spend_turned(tracks, speed, duration, law):
    """Reduce the thresholds of turned bonds by their ruptures in a time of constant speed that they survive."""
    (birth, _, _), _, frame = tracks
    slip = frame[SENSE] * speed * duration
    for k in range(np.int64(frame[TURNED])):
        i, rest = _turned(k, frame)
        spent = hazard_integral(frame[SLIDER] - birth[i], slip, duration, law)
        frame[_LIST + 2 * k + 1] = max(rest - spent, 0.0)


@device
def let_pass(frame, slip, duration, clock, winners):
    """Advance a row whose bonds are stepped together, by a slip and to a ``clock``, while nothing happens to them."""
    frame[SLIDER], frame[TIME], frame[CLOCK] = (
        frame[SLIDER] + slip,
        frame[TIME] + duration,
        clock,
    )
    frame[STEPS] += 1.0
    winners[0, 0] = frame[STEPS]


@device
def happen(tracks, event, law, address, winners):
    """Break the bond, or bind the site, that is first among the ``winners``: at the place and time of the frame."""
    (_, due, _), _, _ = tracks
    value = winners[event, 1]
    block = _block_of(event, winners)
    i, value = block * BLOCK, -value if event == BINDING else value
    while due[i] != value:
        i += 1
    if event == BINDING:
        _bind(i, tracks, law)
    else:
        _break_in(i, tracks, law, address)
    _refresh(block, tracks, law, winners)


@inlined
def _bind(i, tracks, law):
    """Bind a site at the place and time of the frame."""
    (birth, due, _), _, frame = tracks
    x = frame[SLIDER]
    due[i], birth[i] = frame[CLOCK] + birth[i] * math.exp(law.softness * x), x
    _count(1.0, x, frame)


@inlined
def _break_in(i, tracks, law, address):
    """Break the bond of a site at the place and time of the frame."""
    bonds, _, frame = tracks
    _count(-1.0, bonds[0][i], frame)
    _break(i, bonds, frame[TIME], law, address)


@inlined
def _count(sign, x, frame):
    """Add a bond of some birth to the sums of a frame, or take it from them."""
    frame[BOUND], frame[SUM], frame[SQUARES] = (
        frame[BOUND] + sign,
        frame[SUM] + sign * x,
        frame[SQUARES] + sign * x * x,
    )


@device
def break_turned(k, tracks, law, address, winners):
    """Break one of the turned bonds at the place and time of the frame."""
    _, _, frame = tracks
    i, _ = _turned(k, frame)
    _drop(k, frame)
    _break_in(i, tracks, law, address)
    _refresh(i // BLOCK, tracks, law, winners)


@device
def next_event(tracks, speed, most, law, winners):
    """Return the time to the next rupture or binding at a speed [m/s], at most ``most``."""
    (birth, due, _), soonest, frame = tracks
    rate, softness, limit = law.rate, law.softness, law.limit
    along = frame[SENSE] * speed
    if frame[TURNED] > 0.0:
        most, _ = first_turned(tracks, speed, most, law)
    if frame[SINGLY] == 0.0 and along >= 0.0:
        rank(tracks, law, winners)
        x, soon, first = (
            frame[SLIDER],
            min(most, winners[BINDING, 1] - frame[TIME]),
            winners[RUPTURE, 1],
        )
        if first < math.inf and rate > 0.0:
            grown = rate * math.exp(softness * x)
            soon = min(
                soon,
                moment(first - frame[CLOCK], grown, along * softness, math.inf, most),
            )
        if along > 0.0 and limit < math.inf:
            soon = min(soon, (np.min(soonest[_REAR]) + limit - x) / along)
        return max(soon, 0.0)
    x, clock = frame[SLIDER], frame[CLOCK]
    soon = most
    for i in range(due.size):
        if math.copysign(1.0, due[i]) < 0.0:
            soon = min(soon, -due[i] - frame[TIME])
        else:
            left = (
                due[i]
                if frame[SINGLY] > 0.0
                else (due[i] - clock) * math.exp(-softness * birth[i])
            )
            soon = min(
                soon,
                hazard_time(x - birth[i], along, max(left, 0.0), law),
            )
    return max(soon, 0.0)


@device
def next_cut(tracks, direction, limit):
    """Return the slip along a ``direction`` at which the next bond reaches the limit of its stretch [m]."""
    (birth, due, _), soonest, frame = tracks
    along, x = frame[SENSE] * direction, frame[SLIDER]
    nearest = math.inf
    if frame[SINGLY] == 0.0 and along >= 0.0:
        return max(np.min(soonest[_REAR]) + limit - x, 0.0)
    if frame[SINGLY] == 0.0:
        foremost = -np.min(soonest[_FRONT])
        for k in range(np.int64(frame[TURNED])):
            i, _ = _turned(k, frame)
            foremost = max(foremost, birth[i])
        return max(limit + x - foremost, 0.0)
    for i in range(due.size):
        if math.copysign(1.0, due[i]) > 0.0:
            stretch = x - birth[i] if along >= 0.0 else birth[i] - x
            nearest = min(nearest, limit - stretch)
    return max(nearest, 0.0)


#: Message about a state that is spent.
AGAIN = "these tracks have already been advanced: continue from the newest state, or from copies"


class Tracks(NamedTuple):
    """State of the bonds of all members; plain arrays, so that it can be written and read back.

    ``advance`` works in the large arrays themselves, which the states of a run share: only the newest
    state can go on, an older one raises an error. Each state has its own frame, so the moments of an older state
    stay right. Copies of all arrays make an independent state.

    Attributes
    ----------
    birth, due : array, shape (members, sites)
        Position of each bond's birth, and clock of its rupture or minus the time of its site's binding.
    life : array of uint32, shape (members, sites)
        Number of each site's life.
    soonest : array, shape (members, 4, blocks)
        First rupture, first binding, and births of the rearmost and (negative) of the foremost bond of each block of
        sites.
    stamp : array of int, shape (members,)
        Steps that the large arrays have seen.
    turned : array, shape (members, at most 128)
        Sites of bonds that are ahead of a slider which has slipped back, each followed by the rest of its threshold.
    frame : array, shape (members, columns)
        Slider, time, clock, sums and steps of each member.
    """

    birth: Array
    due: Array
    life: Array
    soonest: Array
    stamp: Array
    turned: Array
    frame: Array


def start(
    rupture: RuptureRate,
    rebinding_rate: float,
    sites: int,
    speed: Array,
    begin: str,
    seed: int,
    members: Array,
) -> Tracks:
    """Return the bonds at the start of a run.

    Parameters
    ----------
    rupture : RuptureRate
        Rupture rate of a bond against its stretch.
    rebinding_rate : float
        k_on [1/s] of a free site, at least 0.
    sites : int
        Sites of each member.
    speed : array, shape (1,) or (members,)
        V [m/s], either sign; needed by "steady" only.
    begin : str
        "steady": the stationary law at that speed. "bonded": every site is bound, unstretched. "empty": no
        site is bound.
    seed : int
        Seed of the run.
    members : array of int
        Absolute numbers of the members.

    Raises
    ------
    ValueError
        For "steady" sliding of bonds that never break, which has no stationary law.

    Examples
    --------
    At rest half of the sites are bound where bonds open as fast as they close; sliding takes them away:

    >>> law, still, fast = RuptureRate(1.0, 1e9, math.inf), np.zeros(1), np.array([1e-8])
    >>> for speed in still, fast:
    ...     tracks = start(law, 1.0, 10**5, speed, "steady", 1, np.arange(1))
    ...     share, mean, _ = moments(tracks.frame, 10**5)
    ...     print("%.2f of the sites, mean stretch %.2f nm" % (share[0], 1e9 * mean[0]))
    0.50 of the sites, mean stretch 0.00 nm
    0.17 of the sites, mean stretch 0.20 nm
    """
    rows, blocks = len(members), -(-sites // BLOCK)
    tracks = Tracks(
        birth=np.zeros((rows, sites)),
        due=np.zeros((rows, sites)),
        life=np.zeros((rows, sites), np.uint32),
        soonest=np.zeros((rows, 4, blocks)),
        stamp=np.zeros(rows, np.int64),
        turned=np.zeros((rows, 2 * min(sites, MOST_TURNED))),
        frame=np.zeros((rows, COLUMNS)),
    )
    _draw(
        tracks,
        np.ones(1, bool),
        begin,
        np.asarray(speed, dtype=float),
        rupture,
        rebinding_rate,
        seed,
        members,
    )
    return tracks


def advance(
    tracks: Tracks,
    slip: Array,
    duration: Array,
    rupture: RuptureRate,
    rebinding_rate: float,
    seed: int,
    members: Array,
) -> tuple[Tracks, Array]:
    """Return the bonds after steps of constant speed each, and their frames.

    Parameters
    ----------
    tracks : Tracks
        State before the steps; spent afterwards, but for its moments.
    slip : array, shape (steps, 1) or (steps, members)
        Displacement of the slider over each step, either sign [m].
    duration : array, shape (steps,)
        Length of each step [s], above 0.
    rupture, rebinding_rate, seed, members
        As at the start. Only the rates may have changed since.

    Returns
    -------
    tracks : Tracks
        State at the end.
    frames : array, shape (steps, members, columns)
        Frames after each step, of which ``moments`` reads; the same, bit for bit, however many steps are made at once.

    Raises
    ------
    RuntimeError
        If the state has been advanced already.
    ValueError
        If slip or duration are not finite, or duration is not positive.

    Notes
    -----
    The result is exact for any length of a step. After a step of more than about 300 lives of a site the bonds are
    drawn from the stationary law of its speed.
    """
    members, after = (
        np.asarray(members, dtype=np.uint64),
        tracks._replace(frame=tracks.frame.copy()),
    )
    frames, done = np.empty((*after.frame.shape, len(duration))), 0
    law = site_law(rupture, rebinding_rate)
    while done < len(duration):
        done = live(tuple(after), slip, duration, law, seed, members, done, frames)
        if done == SPENT:
            raise RuntimeError(AGAIN)
        if done == ENDLESS:
            raise ValueError(
                "slip and duration of a step must be finite, and its duration positive"
            )
        left = after.frame[:, STEPS] < tracks.frame[:, STEPS] + done
        if left.any():
            _draw(
                after,
                left,
                "steady",
                slip[done - 1] / duration[done - 1],
                rupture,
                rebinding_rate,
                seed,
                members,
            )
            frames[:, :, done - 1] = after.frame
    return after, frames.transpose(2, 0, 1)


def moments(frames: Array, sites: int) -> tuple[Array, Array, Array]:
    """Return the share of sites bound [1], mean stretch [m] and mean square stretch [m^2] per site.

    Frames of shape (..., columns) give arrays of shape (...).
    """
    number, slider, total, squares = (
        frames[..., column] for column in (BOUND, SLIDER, SUM, SQUARES)
    )
    square = np.maximum(slider * (number * slider - 2.0 * total) + squares, 0.0)
    return (
        number / sites,
        frames[..., SENSE] * (number * slider - total) / sites,
        square / sites,
    )


def mean_life(speed: Array, rupture: RuptureRate) -> Array:
    """Return the mean life of a bond born unstretched at constant speed.

    Parameters
    ----------
    speed : array
        V [m/s], either sign.
    rupture : RuptureRate
        Rupture rate of a bond against its stretch.

    Returns
    -------
    array
        ⟨T⟩ = ∫S dt [s], to 1e-12; infinite if bonds never break.

    Notes
    -----
    Bell's: z e^z E1(z)/k0 with z = k0/(softness \\|V\\|). That of a law that is not closed, or of Bell's with a limit,
    follows from the bound share of ``cohorts.steady``.

    Examples
    --------
    A bond lives shorter the faster it is pulled, but only by the logarithm:

    >>> lives = mean_life(np.array([0.0, 1e-8, 1e-6]), RuptureRate(1.0, 1e9, math.inf))
    >>> print("%.4f %.4f %.4f" % tuple(lives))
    1.0000 0.2015 0.0063
    """
    return np.array(
        [_mean_life(abs(v), rupture) for v in np.atleast_1d(speed).tolist()]
    )


def _mean_life(speed: float, rupture: RuptureRate) -> float:
    rate, softness, limit, *_ = rupture
    pace, longest = speed * softness, limit / speed if speed > 0.0 else math.inf
    if rate == 0.0:
        return longest
    if rupture.table.scale > 0.0 or (pace > 0.0 and longest < math.inf):
        share = float(cohorts.steady(rupture, rate, speed, 1e-4).weight.sum())
        return share / (1.0 - share) / rate
    if pace < 1e-16 * rate:
        return -math.expm1(-rate * longest) / rate
    z = max(rate / pace, 5e-324)
    if z > 1.0:
        return float(reduced_exponential_integral(z, 0.0)) / rate
    return float(scaled_exponential_integral(z, 0.0)) / pace


def _draw(tracks, chosen, begin, speed, rupture, rebinding_rate, seed, members) -> None:
    """Draw the chosen members anew, in place, from the law of a start.

    A site of steady bonds is bound with the chance ⟨T⟩/(⟨T⟩ + 1/k_on), which is 1 for bonds that never break.
    """
    age, share = np.zeros(1), np.array([1.0 if begin == "bonded" else 0.0])
    if begin == "steady":
        age = mean_life(speed, rupture)
        if np.any(np.isinf(age) & (speed != 0.0)):
            raise ValueError(
                "bonds that never break have no stationary stretch: start bonded or empty"
            )
        with np.errstate(invalid="ignore", over="ignore"):
            share = np.where(
                np.isinf(age), 1.0, rebinding_rate * age / (rebinding_rate * age + 1.0)
            )
    draw(
        tuple(tracks),
        chosen,
        speed,
        share,
        np.where(np.isinf(age), 0.0, age),
        site_law(rupture, rebinding_rate, turns=True),
        seed,
        np.asarray(members, dtype=np.uint64),
    )
