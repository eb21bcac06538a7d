"""The lives of single bonds within one step: the compiled loops behind ``tracked``.

Where all stretches of a row have the sign of the motion ``tracked_events`` steps its bonds together. Where the motion
turns, or a step spans too many Bell forces for the common clock, each bond is stepped by itself until all stretches
have the sign of the motion again; its ``due`` is then what is left of its threshold.
"""

import math

import numpy as np

from sim.numerics.jit import device, kernel
from sim.numerics.noise import exponential, unit_at, words_at
from sim.parts.bonds.rupture import rupture_integral, time_to_rupture
from sim.parts.bonds.tracked_events import (
    AT_ONCE,
    BOUND,
    CLOCK,
    COLUMNS,
    LIVES,
    PART,
    SENSE,
    SINGLY,
    SLIDER,
    SQUARES,
    STEPS,
    SUM,
    TIME,
    TINY,
    follow,
    lay_out,
    least,
    look_up,
    room,
    views,
)

#: What ``live`` returns instead of a number of steps: the state has been advanced already; a number is not finite.
SPENT, ENDLESS = -1, -2

_U = np.uint64
#: Lives of a site in one step beyond which the step ends in the stationary law of its speed.
CYCLES = 300.0
_FAR = 16.0  # Bell forces, cut-off stretches or natural lives after which a frame is set anew
_LEAP = 24.0  # Bell forces within a step above which bonds are stepped one by one, lest the clock overflow


@device
def _cycle(speed, rate, softness, limit, rebinding):
    """About the mean time from one birth to the next of a site: a fresh bond's life at ``speed`` and the wait.

    Exact for constant rupture laws, with or without a limit; for Bell's within a sixth,
    e^z E1(z) ~ ½ ln(1 + 2/z).
    """
    life = math.inf
    if rate > 0.0:
        amplitude = 2.0 * math.fabs(speed) * softness / rate
        life = (math.log1p(amplitude) / amplitude if amplitude > 0.0 else 1.0) / rate
    if speed != 0.0 and limit < math.inf:
        longest = limit / math.fabs(speed)
        life = longest if life == math.inf else -life * math.expm1(-longest / life)
    return life + (1.0 / rebinding if rebinding > 0.0 else math.inf)


@device
def _one_by_one(bonds, row, slip, duration, law, address):
    """One step of a row bond by bond, ``slip`` of any sign; True if all stretches then have the sign of the motion."""
    (birth, due, life), (seed, member), (rate, softness, limit, rebinding) = bonds, address, law
    x0, t0, speed = row[SLIDER], row[TIME], slip / duration
    bound, total, squares, lowest, highest = 0.0, 0.0, 0.0, math.inf, -math.inf
    for i in range(due.size):
        time = 0.0
        for _ in range(LIVES):
            left = duration - time
            if math.copysign(1.0, due[i]) > 0.0:
                stretch = x0 + speed * time - birth[i]
                spent = rupture_integral(stretch, speed * left, left, rate, softness)
                if spent < due[i] and math.fabs(stretch + speed * left) < limit:
                    due[i] -= spent
                    break
                lasts = time_to_rupture(stretch, speed, due[i], rate, softness, limit)
                time += min(lasts, left) if lasts > 0.0 else 0.0
                life[i] += np.uint32(1)
                one, two, _, _ = words_at(seed, PART, _U(i + 1), _U(life[i]), member, _U(0))
                birth[i] = exponential(one)
                due[i] = -max(t0 + time + exponential(two) / rebinding, TINY) if rebinding > 0.0 else -math.inf
            elif -due[i] > t0 + duration:
                break
            else:
                time = max(-due[i] - t0, 0.0)
                due[i], birth[i] = birth[i], x0 + speed * time
        if math.copysign(1.0, due[i]) > 0.0:
            bound += 1.0
            total += birth[i]
            squares += birth[i] * birth[i]
            lowest, highest = min(lowest, birth[i]), max(highest, birth[i])
    row[SLIDER], row[TIME] = x0 + slip, t0 + duration
    row[BOUND], row[SUM], row[SQUARES] = bound, total, squares
    return (slip > 0.0 and highest <= x0 + slip) or (slip < 0.0 and lowest >= x0 + slip)


@device
def _set(bonds, soonest, row, law, singly, turn):
    """Put the origin of a row's frame at the slider and at the present time, in which the sense may turn.

    Its bonds are then stepped one by one, ``singly``, or together. Sums and least dues are taken anew, so that
    roundings do not gather.
    """
    (birth, due, _), (_, softness, limit, _) = bonds, law
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
            due[i] = max(due[i] - clock, 0.0) * (math.exp(-softness * birth[i]) if singly else scale)
        elif not singly:
            due[i] *= math.exp(softness * x)
        birth[i] = x
        bound += 1.0
        total += x
        squares += x * x
    if not singly:
        soonest[2] = math.inf
        seen = views(due, soonest)
        for block in range(soonest.shape[1]):
            least(seen, birth, block, limit < math.inf)
    row[SLIDER], row[TIME], row[CLOCK], row[SENSE] = 0.0, 0.0, 0.0, sign * row[SENSE]
    row[SINGLY], row[BOUND], row[SUM], row[SQUARES] = 1.0 if singly else 0.0, bound, total, squares


#: Arrays of ``Tracks``.
TRACKS = "Tuple((float64[:,::1], float64[:,::1], uint32[:,::1], float64[:,:,::1], int64[::1], float64[:,::1]))"


@device
def _far(x, time, law):
    """Whether a frame is to be set anew with the slider at ``x`` after a ``time``."""
    rate, softness, limit, _ = law
    gone = math.fabs(x)
    return gone * softness > _FAR or gone > _FAR * limit or time * rate > _FAR


@device
def _together(row, slip, duration, law, space):
    """Lay out the steps that a row's bonds can follow together, up to one after which its frame is set anew; how many.

    ``slip`` and ``duration`` are those of the steps ahead.
    """
    x, time, clock, count = row[SLIDER], row[TIME], row[CLOCK], 0
    while count < min(duration.size, AT_ONCE) and not (count > 0 and _far(x, time, law)):
        along = row[SENSE] * slip[count]
        if along < 0.0 or law[1] * along > _LEAP:
            break
        clock = lay_out(count, along, duration[count], x, time, clock, law, space)
        x, time = x + along, time + duration[count]
        count += 1
    if count > 0:
        look_up(count, space)
    return count


@device
def _keep(row, slip, duration, count, space, frames):
    """Write the frames of a row after each of ``count`` steps that were followed together."""
    _, ends, changes, _, _ = space
    for k in range(count):
        row[SLIDER], row[TIME], row[CLOCK] = row[SLIDER] + row[SENSE] * slip[k], row[TIME] + duration[k], ends[0, k]
        row[BOUND] += changes[0, k]
        row[SUM] += changes[1, k]
        row[SQUARES] += changes[2, k]
        row[STEPS] += 1.0
        frames[:, k] = row


@device
def _advance(bonds, soonest, row, slip, duration, law, address, space, laid, shared, frames):
    """Some of the steps ahead of a row, and its frame after each of them; how many.

    ``laid`` is the frame of a row whose steps are laid out, and their number; these serve all rows of a ``shared`` slip
    that stand there.
    """
    count = 0
    if row[SINGLY] == 0.0:
        here = shared and row[STEPS] == laid[STEPS] and np.all(row[:SINGLY] == laid[:SINGLY])
        if not (here and laid[COLUMNS] <= duration.size):
            laid[:COLUMNS], laid[COLUMNS] = row, _together(row, slip, duration, law, space)
        count = np.int64(laid[COLUMNS])
    if count > 0:
        follow(bonds, soonest, count, law, address, space)
        _keep(row, slip, duration, count, space, frames)
    else:
        if row[SINGLY] == 0.0:
            _set(bonds, soonest, row, law, True, False)
        along, count = row[SENSE] * slip[0], 1
        if _one_by_one(bonds, row, along, duration[0], law, address):
            _set(bonds, soonest, row, law, False, along < 0.0)
        row[STEPS] += 1.0
    if _far(row[SLIDER], row[TIME], law):
        _set(bonds, soonest, row, law, row[SINGLY] > 0.0, False)
    frames[:, count - 1] = row
    return count


@device
def one_step(bonds, soonest, row, slip, duration, law, address, space, laid, frame):
    """Take a row through one step, of arrays of length one; ``laid`` and ``frame`` are room for what it is not kept."""
    laid[0] = math.nan
    _advance(bonds, soonest, row, slip, duration, law, address, space, laid, False, frame)


@kernel(
    f"int64({TRACKS}, float64[:,:], float64[:], float64, float64, float64, float64, uint64, uint64[:], int64,"
    " float64[:,:,::1])"
)
def live(tracks, slip, duration, rate, softness, limit, rebinding, seed, members, first, frames):
    """Advance all rows from step ``first`` on, in place; how many steps are done, or why none is.

    The frame is the new state's own copy; ``frames``, of shape (rows, columns, steps), get that after each step. A row
    in which a step is longer than some 300 lives of a site is left as it is before that step, its count of steps, too,
    and no row goes on beyond it. Nothing is touched when the state is spent or a number endless.
    """
    birth, due, life, soonest, stamp, frame = tracks
    law, rows, end = (rate, softness, limit, rebinding), len(due), first
    for m in range(rows):
        if stamp[m] != np.int64(frame[m, STEPS]):
            return SPENT
    long = np.zeros(rows, np.bool_)
    while end < duration.size and not long.any():
        if not (0.0 < duration[end] < math.inf and np.all(np.abs(slip[end]) < math.inf)):
            return ENDLESS
        for m in range(rows):
            speed = slip[end, m % slip.shape[1]] / duration[end]
            long[m] = duration[end] > CYCLES * _cycle(speed, rate, softness, limit, rebinding)
        end += 1
    space, laid, shared, start = room(), np.full(COLUMNS + 1, math.nan), slip.shape[1] == 1, first
    while start < end:
        stop = end
        for m in range(rows):
            bonds, address, k = (birth[m], due[m], life[m]), (seed, members[m]), start
            own = min(stop, end - 1 if long[m] else end)
            while k < own:
                ahead = slip[k:own, m % slip.shape[1]], duration[k:own]
                row, after = frame[m], frames[m, :, k:own]
                k += _advance(bonds, soonest[m], row, *ahead, law, address, space, laid, shared, after)
                if m == 0:  # what is laid out serves the other rows
                    own = stop = k
            stamp[m] = np.int64(frame[m, STEPS])
        start = stop
    return end


@kernel(
    f"void({TRACKS}, boolean[:], float64[:], float64[:], float64[:], float64, float64, float64, float64,"
    " uint64, uint64[:])"
)
def draw(tracks, chosen, speed, share, age, rate, softness, limit, rebinding, seed, members):
    """Draw chosen rows anew: a ``share`` of sites bound, their ages by the survival law of a bond of mean life ``age``.

    The density of ages S(t)/⟨T⟩ is log-concave with its mode at 0: rejection under
    min(1, e^(1 − t/⟨T⟩))/⟨T⟩ accepts every second proposal (Devroye, Non-Uniform Random Variate
    Generation, 1986, VII.2). Whatever its age, a bond has still an exponential threshold before it.
    """
    birth, due, life, soonest, stamp, frame = tracks
    for m in range(due.shape[0]):
        if not chosen[m % chosen.size]:
            continue
        v, mean, bonded = speed[m % speed.size], age[m % age.size], share[m % share.size]
        for i in range(due.shape[1]):
            life[m, i] += np.uint32(1)
            site, number = _U(i + 1), _U(life[m, i])
            one, two, three, _ = words_at(seed, PART, site, number, members[m], _U(1))
            birth[m, i] = exponential(two)
            due[m, i] = -max(exponential(three) / rebinding, TINY) if rebinding > 0.0 else -math.inf
            if unit_at(one) >= bonded:
                continue
            due[m, i], passed = birth[m, i], 0.0
            for lane in range(2, 256 if mean > 0.0 else 2):
                one, two, three, _ = words_at(seed, PART, site, number, members[m], _U(lane))
                tail = 1.0 + exponential(two) if unit_at(one) >= 0.5 else unit_at(two)
                passed, bar = tail * mean, exponential(three) + max(tail - 1.0, 0.0)
                spent = rupture_integral(0.0, v * passed, passed, rate, softness)
                if spent <= bar and math.fabs(v) * passed < limit:
                    break
            birth[m, i] = -v * passed
        row = frame[m]
        row[:STEPS] = 0.0
        row[SENSE], row[SINGLY] = 1.0, 1.0
        _set((birth[m], due[m], life[m]), soonest[m], row, (rate, softness, limit, rebinding), False, v < 0.0)
        row[STEPS] += 1.0
        stamp[m] = np.int64(row[STEPS])
