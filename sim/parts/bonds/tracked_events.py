"""Bonds whose stretch has the sign of the motion: the lives of a row of them over many steps, event by event.

A row is one member. All its sites follow one slider, so Bell's rupture separates: ∫k dt of bond i is
e^(−s x_i) times a clock common to all, Φ(t) = ∫ rate e^(s x) dt, with s the softness, x the position of
the slider and x_i that at the bond's birth, both counted along the motion from where the frame was
last set. A bond therefore breaks when Φ passes a number fixed at its birth, its ``due``: what a step costs is its
events, and blocks of sites without one in all the steps are passed over by their least due.

One array holds two kinds of due: a bound site's, never negative, and minus the time at which a free
site binds. Read as unsigned whole numbers, the bits of such floats have the first rupture as their
least; read as signed ones, the first binding: whole numbers are compared by vector instructions. A
free site keeps the threshold of its next bond in its ``birth``.

Site after site lives through all the steps and adds each event to the sums of its step. What a step adds up is thus in
the order of the sites, however many steps are made at once.
"""

import math

import numpy as np

from sim.numerics.jit import device
from sim.numerics.noise import PARTS, exponential, logarithm, words_at

#: Columns of a frame: slider, time and clock since the frame was set, sense of the motion (+1, -1), whether bonds
#: are stepped one by one, bound sites, sum of their births, of the births squared, steps done.
SLIDER, TIME, CLOCK, SENSE, SINGLY, BOUND, SUM, SQUARES, STEPS = range(9)
COLUMNS = 9

#: Sites of one block.
BLOCK = 16

#: Steps made at once, at most.
AT_ONCE = 1024

_U = np.uint64
PART = _U(PARTS["bonds"])
LIVES = 4096  # of one site in one step: a stop for nonsense, since the rule for long steps comes first
TINY = 2.2250738585072014e-308

#: Columns of a step: slider, time and clock at its beginning, the rate of a bond born at the frame's origin then and
#: its ratio to ``rate``, relative growth of that rate in unit time, length and speed.
_X, _T, _CLOCK, _RATE, _GROWN, _PACE, _DURATION, _SPEED = range(8)
_STEP_COLUMNS = 8
#: Rows of what has an event by the end of a step: bonds of less due, free sites of less time, bonds of less birth.
_RUPTURE, _BINDING, _CUT = range(3)
#: Bits of a number that are left out where a step is looked up, 128 ranges for each power of two; most ranges.
_LEFT_OUT, _RANGES = np.int64(45), 4096


@device
def room():
    """Arrays to work in: columns of steps, their ends, changes of bound sites and their sums in each, an index of ends.

    Beside the index stands the number of its first range.
    """
    steps, index = np.empty((AT_ONCE, _STEP_COLUMNS)), np.empty((2, _RANGES), np.int16)
    return steps, np.empty((3, AT_ONCE)), np.empty((3, AT_ONCE)), index, np.empty(2, np.int64)


@device
def views(due, soonest):
    """A row's due as signed and unsigned whole numbers, and the first binding, first rupture and rearmost of blocks."""
    whole = soonest.view(np.int64)
    return due.view(np.int64), due.view(np.uint64), whole[1], soonest.view(np.uint64)[0], soonest[2]


@device
def least(seen, birth, block, bounded):
    """Take anew the first binding, the first rupture and the rearmost bond of a block."""
    signed, unsigned, binding, rupture, rear = seen
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
    if bounded:
        least = math.inf
        for j in range(size):
            i = first + _U(j)
            least = birth[i] if signed[i] >= 0 and birth[i] < least else least
        rear[block] = least


@device
def lay_out(step, slip, duration, x, time, clock, law, space):
    """Write a step that begins with the slider at ``x`` and a ``time`` and ``clock``; clock at its end."""
    (rate, softness, limit, _), (steps, ends, _, _, _) = law, space
    grown, bell = math.exp(softness * x), softness * slip
    first, speed = rate * grown, slip / duration
    after = clock + first * duration * (math.expm1(bell) / bell if bell > 0.0 else 1.0)
    column = steps[step]
    column[_X], column[_T], column[_CLOCK], column[_RATE] = x, time, clock, first
    column[_GROWN], column[_PACE], column[_DURATION], column[_SPEED] = grown, speed * softness, duration, speed
    ends[_RUPTURE, step], ends[_BINDING, step], ends[_CUT, step] = after, time + duration, x + slip - limit
    return after


@device
def _range(value):
    """Number of the range that a positive number lies in, by its leading bits."""
    return np.float64(value).view(np.int64) >> _LEFT_OUT


@device
def look_up(count, space):
    """Index ``count`` steps by their ends: the first that ends in each range of numbers, or later."""
    _, ends, _, index, lowest = space
    for row in range(2):
        lowest[row], filled = _range(ends[row, 0]), 0
        for k in range(count):
            last = min(_range(ends[row, k]) - lowest[row], _RANGES - 1)
            while filled <= last:
                index[row, filled] = k
                filled += 1


@device
def moment(passed, rate, pace, cut, duration):
    """Time within a step at which the clock has passed so much, or a bond is cut; of ``duration`` at most."""
    time = passed / rate
    u = 1.0 + pace * time  # ln u/(u - 1) takes back what the sum has rounded: log1p
    moment = time * (1.0 if u == 1.0 else logarithm(u) / (u - 1.0))
    moment = moment if moment < cut else cut
    return min(moment, duration) if moment > 0.0 else 0.0


@device
def follow(bonds, soonest, count, law, address, space):
    """Lives of a row whose bonds all have the sign of the motion over the first ``count`` steps of the ``space``.

    ``bonds`` are its births, dues and lives, ``address`` seed and member of its draws. Arrays are not passed on from
    the loop over events: counting their references takes as long as an event.
    """
    (birth, due, life), (steps, ends, changes, index, lowest), (_, _, limit, rebinding) = bonds, space, law
    seen, bounded, (seed, member) = views(due, soonest), limit < math.inf, address
    signed, unsigned, binding, rupture, rear = seen
    clock, time, cut = ends[_RUPTURE, count - 1], ends[_BINDING, count - 1], ends[_CUT, count - 1]
    clock_bits, time_bits = np.float64(clock).view(np.uint64), np.float64(-time).view(np.int64)
    changes[:, :count] = 0.0
    for block in range(rear.size):
        if not (rupture[block] <= clock_bits or binding[block] <= time_bits or rear[block] <= cut):
            continue
        for i in range(block * BLOCK, min((block + 1) * BLOCK, due.size)):
            if not (unsigned[i] <= clock_bits or signed[i] <= time_bits or (bounded and birth[i] <= cut)):
                continue
            at, x, k, events, number = due[i], birth[i], 0, 0, life[i]
            bound = signed[i] >= 0
            while True:
                row, value, next_ = (_RUPTURE if bound else _BINDING), math.fabs(at), count
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
                rate, pace, speed = steps[k, _RATE], steps[k, _PACE], steps[k, _SPEED]
                if bound:
                    changes[0, k] -= 1.0
                    changes[1, k] -= x
                    changes[2, k] -= x * x
                    number += np.uint32(1)
                    one, two, _, _ = words_at(seed, PART, _U(i + 1), _U(number), member, _U(0))
                    end = (x + limit - steps[k, _X]) / speed if bounded and speed > 0.0 else math.inf
                    passed = moment(at - steps[k, _CLOCK], rate, pace, end, steps[k, _DURATION])
                    x, wait = exponential(one), exponential(two) / rebinding
                    at = -max(steps[k, _T] + passed + wait, TINY) if rebinding > 0.0 else -math.inf
                else:
                    passed = max(value - steps[k, _T], 0.0)
                    bell = pace * passed
                    more = math.expm1(bell)
                    clock = steps[k, _CLOCK] + rate * passed * (more / bell if bell > 0.0 else 1.0)
                    at, x = clock + x * steps[k, _GROWN] * (1.0 + more), steps[k, _X] + speed * passed
                    changes[0, k] += 1.0
                    changes[1, k] += x
                    changes[2, k] += x * x
                bound = not bound
            due[i], birth[i], life[i] = at, x, number
        least(seen, birth, block, bounded)
