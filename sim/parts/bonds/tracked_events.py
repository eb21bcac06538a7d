"""Bonds whose stretch has the sign of the motion: one step of a row of them, touching only those that break or bind.

A row is one member. All its sites follow one slider, so Bell's rupture separates: ∫k dt of bond i is
e^(−s x_i) times a clock common to all, Φ(t) = ∫ rate e^(s x) dt, with s the softness, x the position of
the slider and x_i that at the bond's birth, both counted along the motion from where the frame was
last set. A bond therefore breaks when Φ passes a number fixed at its birth, its ``due``, and a step
looks only at the least due of each block of sites.

One array holds two kinds of due: a bound site's, never negative, and minus the time at which a free
site binds. Read as unsigned whole numbers, the bits of such floats have the first rupture as their
least; read as signed ones, the first binding: whole numbers are compared by vector instructions. A
free site keeps the threshold of its next bond in its ``birth``.

Events are processed in batches of a few hundred, one array pass per operation, so that memory latency and vector
arithmetic overlap.
"""

import math

import numpy as np

from sim.numerics.jit import device
from sim.numerics.noise import PARTS, exponential, fill_words, logarithm

#: Columns of a frame: slider, time and clock since the frame was set, sense of the motion (+1, -1), whether bonds
#: are stepped one by one, bound sites, sum of their births, of the births squared, steps done.
SLIDER, TIME, CLOCK, SENSE, SINGLY, BOUND, SUM, SQUARES, STEPS = range(9)
COLUMNS = 9

#: Sites of one block, whose events are the bits of one number: at most 62.
BLOCK = 16

_U = np.uint64
PART = _U(PARTS["bonds"])
LIVES = 4096  # of one site in one step: a stop for nonsense, since the rule for long steps comes first
TINY = 2.2250738585072014e-308
_AT_ONCE = 512  # events in hand from which they are done
_PIECE = 32  # blocks looked at together, also bits of one number
HANDS = _AT_ONCE + _PIECE * BLOCK + 1  # most events in hand


@device
def views(due, soonest):
    """A row's due as signed and unsigned whole numbers, and the first binding, first rupture and rearmost of blocks."""
    whole = soonest.view(np.int64)
    return due.view(np.int64), due.view(np.uint64), whole[1], soonest.view(np.uint64)[0], soonest[2]


@device
def least(seen, birth, blocks, count, bounded):
    """Take anew the first binding, the first rupture and the rearmost bond of the first ``count`` blocks named."""
    signed, unsigned, binding, rupture, rear = seen
    for e in range(count):
        first = blocks[e] * _U(BLOCK)
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
        binding[blocks[e]], rupture[blocks[e]] = soonest, earliest
        if bounded:
            least = math.inf
            for j in range(size):
                i = first + _U(j)
                least = birth[i] if signed[i] >= 0 and birth[i] < least else least
            rear[blocks[e]] = least


@device
def _lowest(bits):
    """Number of the lowest bit that is set: the exponent of that bit as a float."""
    return _U((np.float64(bits & -bits).view(np.int64) >> 52) - 1023)


@device
def _find(seen, birth, known, count, clock_bits, time_bits, bounded, cut, work, hands):
    """Add the sites of blocks ``known`` to ``count`` that break or bind to those in ``hands``, which counts both."""
    signed, unsigned, _, _, _ = seen
    breaking, starting, blocks = work[0], work[1], work[2]
    breaks, starts = hands[0], hands[1]
    for e in range(known, count):
        first = blocks[e] * _U(BLOCK)
        size = min(BLOCK, np.int64(_U(signed.size) - first))
        found = np.int64(0)
        for j in range(size):
            i = first + _U(j)
            found |= np.int64((unsigned[i] <= clock_bits) | (signed[i] <= time_bits)) << np.int64(j)
        if bounded:
            for j in range(size):
                i = first + _U(j)
                found |= np.int64((signed[i] >= 0) & (birth[i] <= cut)) << j
        while found:
            i = first + _lowest(found)
            found &= found - 1
            free = signed[i] < 0
            breaking[breaks], starting[starts] = i, i
            breaks += 0 if free else 1
            starts += 1 if free else 0
    hands[0], hands[1] = breaks, starts


@device
def _break(sites, count, bonds, row, step, address, drawn, words):
    """Break the bonds of the first ``count`` sites, exactly in time; how many bind again in this step, put first."""
    (birth, due, life), (seed, member) = bonds, address
    x0, t0, clock, first, _, pace, duration, speed, limit, rebinding = step
    for e in range(count):  # fetch all before the first is needed
        i = sites[e]
        number = life[i] + np.uint32(1)
        life[i] = number
        words[2, e], words[3, e] = i + _U(1), _U(number)
        drawn[2, e], drawn[3, e] = due[i] - clock, birth[i]
    fill_words(seed, PART, words[2], words[3], member, _U(0), count, words)
    for e in range(count):
        drawn[0, e], drawn[1, e] = exponential(words[0, e]), exponential(words[1, e])
        time = drawn[2, e] / first
        u = 1.0 + pace * time  # ln u/(u - 1) takes back what the sum has rounded: log1p
        drawn[2, e] = time * (1.0 if u == 1.0 else logarithm(u) / (u - 1.0))
    again, end = 0, t0 + duration
    bound, total, squares = 0.0, 0.0, 0.0
    for e in range(count):
        i, moment, x = sites[e], drawn[2, e], drawn[3, e]
        if speed > 0.0 and limit < math.inf:
            cut = (x + limit - x0) / speed
            moment = moment if moment < cut else cut
        moment = min(moment, duration) if moment > 0.0 else 0.0
        bound += 1.0
        total += x
        squares += x * x
        binding = max(t0 + moment + drawn[1, e] / rebinding, TINY) if rebinding > 0.0 else math.inf
        birth[i], due[i] = drawn[0, e], -binding
        sites[again] = i
        again += 1 if binding <= end else 0
    row[BOUND] -= bound
    row[SUM] -= total
    row[SQUARES] -= squares
    return again


@device
def _bind(sites, count, bonds, row, step, last_clock, cut, drawn):
    """Bind the first ``count`` sites, exactly in place; how many of them break again in this step, put first."""
    birth, due, _ = bonds
    x0, t0, clock, first, amplitude, pace, _, speed, _, _ = step
    again = 0
    bound, total, squares = 0.0, 0.0, 0.0
    for e in range(count):
        drawn[0, e], drawn[1, e] = max(-due[sites[e]] - t0, 0.0), birth[sites[e]]
    for e in range(count):
        i, time = sites[e], drawn[0, e]
        x = x0 + speed * time
        bell = pace * time
        more = math.expm1(bell)
        clock_there = clock + first * time * (more / bell if bell > 0.0 else 1.0)
        breaks = clock_there + drawn[1, e] * amplitude * (1.0 + more)
        due[i], birth[i] = breaks, x
        bound += 1.0
        total += x
        squares += x * x
        sites[again] = i
        again += 1 if breaks <= last_clock or x <= cut else 0
    row[BOUND] += bound
    row[SUM] += total
    row[SQUARES] += squares
    return again


@device
def _live_on(work, hands, bonds, row, step, last_clock, cut, address, drawn, words):
    """Break and bind the sites in hand again and again, until the next event of each is in a later step."""
    breaking, starting = work[0], work[1]
    breaks, starts = hands[0], hands[1]
    for _ in range(LIVES):
        more = _bind(starting, starts, bonds, row, step, last_clock, cut, drawn)
        for e in range(more):
            breaking[breaks + e] = starting[e]
        starts = _break(breaking, breaks + more, bonds, row, step, address, drawn, words)
        if starts == 0:
            break
        breaks = 0
        starting, breaking = breaking, starting


@device
def follow(bonds, soonest, row, slip, duration, law, address, space):
    """One step of a row whose bonds all have the sign of the motion; ``slip`` >= 0 along it.

    ``bonds`` are its births, dues and lives, ``address`` seed and member of its draws, ``space`` arrays to work in.
    """
    (birth, due, _), (work, drawn, words, hands), (rate, softness, limit, rebinding) = bonds, space, law
    seen = views(due, soonest)
    _, _, binding, rupture, rear = seen
    x0, t0, clock = row[SLIDER], row[TIME], row[CLOCK]
    amplitude, bell = math.exp(softness * x0), softness * slip
    first, speed = rate * amplitude, slip / duration
    step = (x0, t0, clock, first, amplitude, speed * softness, duration, speed, limit, rebinding)
    last_clock = clock + first * duration * (math.expm1(bell) / bell if bell > 0.0 else 1.0)
    end, cut = t0 + duration, x0 + slip - limit
    clock_bits, time_bits = np.float64(last_clock).view(np.uint64), np.float64(-end).view(np.int64)
    touched = work[2]
    blocks, bounded = rear.size, limit < math.inf
    hands[:], touches = 0, 0
    for piece in range(0, blocks, _PIECE):
        known, first, hits = touches, _U(piece), np.int64(0)
        for j in range(min(_PIECE, blocks - piece)):
            k = first + _U(j)
            hits |= np.int64((rupture[k] <= clock_bits) | (binding[k] <= time_bits) | (rear[k] <= cut)) << np.int64(j)
        while hits:
            touched[touches] = first + _lowest(hits)
            hits &= hits - 1
            touches += 1
        _find(seen, birth, known, touches, clock_bits, time_bits, bounded, cut, work, hands)
        if touches > 0 and (hands[0] + hands[1] > _AT_ONCE or piece + _PIECE >= blocks):
            _live_on(work, hands, bonds, row, step, last_clock, cut, address, drawn, words)
            least(seen, birth, touched, touches, bounded)
            hands[:], touches = 0, 0
    row[SLIDER], row[TIME], row[CLOCK] = x0 + slip, end, last_clock
