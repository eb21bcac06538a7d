"""A population of bonds resolved by stretch: cohorts of equal stretch, carried with the slider.

A density n(x, t) per site of bonds stretched by x follows dn/dt + V dn/dx = −k(\\|x\\|) n + k_on F δ(x), where F is the
share of free sites. A cohort moves with the slider and dies by its exact rupture integral. So there is no numerical
diffusion and no limit to the step. Only births and the merging of cohorts err, each within a tolerance.

Merging makes few cohorts of many: groups of nearly equal stretch become two, with the same first four moments. The
groups are cells of a lattice that is carried with the slider, so a cell keeps its bonds for life. Cohorts that are
merged twice are merged within the same cell, and errors do not add up.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from sim.numerics.jit import device, kernel
from sim.numerics.special import exp
from sim.parts.bonds.rupture import (
    RuptureRate,
    fresh_integral,
    growth,
    hazard_integral,
    hazard_time,
    rates_at,
)
from sim.parts.exchange import Array


@device
def settle(weight, stretch, width, count, direction, travelled, rules):
    """Merge ``count`` cohorts in place until at most ``rules.most`` are left, and return the number left.

    If plain merging does not suffice, sharp fronts within a cell are merged, too, and then the lattice is made coarser.
    """
    _sort(weight, stretch, width, count, direction)
    finest, cell, fronts = 64, rules.cell, rules.limit < math.inf
    pool = weight, stretch, width
    count = _merge(pool, count, travelled, cell, finest, fronts, rules)
    while count > rules.most:
        if finest > 1:
            finest //= 2
        elif fronts:
            fronts = False
        else:
            cell *= 2.0
        count = _merge(pool, count, travelled, cell, finest, fronts, rules)
    return count


@device
def _sort(weight, stretch, width, count, direction):
    """Sort cohorts in place, farthest along ``direction`` first; oldest first is almost that order."""
    for i in range(1, count):
        w, x, b = weight[i], stretch[i], width[i]
        j = i
        while j > 0 and (x - stretch[j - 1]) * direction > 0.0:
            weight[j], stretch[j], width[j] = (
                weight[j - 1],
                stretch[j - 1],
                width[j - 1],
            )
            j -= 1
        weight[j], stretch[j], width[j] = w, x, b


@device
def _merge(pool, count, travelled, cell, finest, fronts, rules):
    """Merge sorted cohorts cell by cell, and return the number left.

    A cell of many bonds is halved until its width times its share is below ``rules.heavy``. A cell
    that comes back through zero, where the rupture has a kink, then errs by less than the tolerance.
    """
    weight, stretch, _ = pool
    whole = 0.0
    for i in range(count):
        whole += weight[i]
    first, left = 0, 0
    while first < count:
        place = math.floor((stretch[first] - travelled) / cell)
        last, inside = first, 0.0
        while last < count and math.floor((stretch[last] - travelled) / cell) == place:
            inside += weight[last]
            last += 1
        parts = 1
        while (
            parts < finest
            and cell * rules.steepness * inside > rules.heavy * whole * parts * parts
        ):
            parts *= 2
        span = first, last, left
        left = _merge_cell(pool, span, travelled, cell / parts, fronts, rules)
        first = last
    return left


@device
def _merge_cell(pool, span, travelled, cell, fronts, rules):
    """Merge cohorts in cells of one width; return the end. ``span``: the first, the last, and where to write them."""
    (weight, stretch, width), (first, last, left) = pool, span
    while first < last:
        place = math.floor((stretch[first] - travelled) / cell)
        end = first + 1
        while end < last and math.floor((stretch[end] - travelled) / cell) == place:
            if fronts and not _alike(weight, width, end - 1, end):
                break
            end += 1
        left += _gauss(weight, stretch, width, first, end, left, rules.limit < math.inf)
        first = end
    return left


@device
def _alike(weight, width, i, j):
    """True if two neighbouring segments have about the same density, so that merging them smears no sharp front."""
    density, beyond = weight[i] * width[j], weight[j] * width[i]
    return density <= 4.0 * beyond and beyond <= 4.0 * density


@device
def _gauss(weight, stretch, width, first, end, left, segments):
    """Write the cohorts ``first`` to ``end`` as two points, or one segment, of equal moments, and return their number.

    Two points are the Gauss rule of the group: positive weights, inside its hull, moments 0 to 3
    exact. A segment has moments 0 to 2 exact.
    """
    if end - first <= (1 if segments else 2):
        for i in range(end - first):
            w, x, b = weight[first + i], stretch[first + i], width[first + i]
            weight[left + i], stretch[left + i], width[left + i] = w, x, b
        return end - first
    total, start, mean = 0.0, stretch[first], 0.0
    for i in range(first, end):
        total += weight[i]
        mean += weight[i] * (stretch[i] - start)
    mean = start + mean / total
    square, cube = 0.0, 0.0
    for i in range(first, end):
        off = stretch[i] - mean
        square += weight[i] * (off * off + width[i] * width[i] / 12.0)
        cube += weight[i] * off * off * off
    square /= total
    if segments or square == 0.0:
        weight[left], stretch[left], width[left] = total, mean, math.sqrt(12.0 * square)
        return 1
    lean = 0.5 * cube / total / square
    reach = math.sqrt(lean * lean + square)
    below = reach + math.fabs(lean)
    # the nearer node's distance from the mean, without cancellation
    above = square / below
    if lean > 0.0:
        above, below = below, above
    weight[left], stretch[left], width[left] = (
        total * (below / (above + below)),
        mean + above,
        0.0,
    )
    weight[left + 1], stretch[left + 1], width[left + 1] = (
        total * (above / (above + below)),
        mean - below,
        0.0,
    )
    return 2


class Rules(NamedTuple):
    """Constants that all rows of a population share: those of ``LawNumbers``, and more."""

    rate: float
    softness: float
    limit: float
    catch: float
    relief: float
    table: float
    steepness: float  # largest relative change of the rupture rate per stretch [1/m]
    rebinding: float
    tolerance: float
    cell: float  # width of a merging cell [m]
    heavy: float  # width × share of a cell allowed, in units of 1/steepness
    most: float  # cohorts left by merging


#: Type of the numbers of ``Rules`` in kernels.
RULES = f"UniTuple(float64, {len(Rules._fields)})"


@device
def inside(stretch, width, limit):
    """Return the share of a segment that lies between ± ``limit`` [1]."""
    if width == 0.0:
        return 1.0 if math.fabs(stretch) < limit else 0.0
    over = max(0.0, stretch + 0.5 * width - limit) + max(
        0.0, -limit - stretch + 0.5 * width
    )
    return max(0.0, 1.0 - over / width)


@device
def survive(pool, count, move, speed, step, off, rules):
    """Return the share of bonds that outlive a third of a step and all of it, and write each cohort's to pool[4].

    ``off`` is the mean deviation of their stretch from that of a motion at constant speed [m].
    """
    weight, stretch, width, steepness, survivors, survivors_early = (
        pool[0],
        pool[1],
        pool[2],
        pool[3],
        pool[4],
        pool[8],
    )
    early, short = step / 3.0, move / 3.0
    soon, late = (
        fresh_integral(early, speed, rules),
        fresh_integral(step, speed, rules),
    )
    for i in range(count):
        survivors_early[i] = weight[i] * exp(-steepness[i] * soon)
        survivors[i] = weight[i] * exp(-steepness[i] * late)
    at_early, at_end = 0.0, 0.0
    for i in range(count):
        if steepness[i] == 0.0:
            survivors_early[i] = weight[i] * math.exp(
                -hazard_integral(stretch[i] + off, short, early, rules)
            )
            survivors[i] = weight[i] * math.exp(
                -hazard_integral(stretch[i] + off, move, step, rules)
            )
        if rules.limit < math.inf:
            survivors_early[i] *= inside(stretch[i] + short, width[i], rules.limit)
            survivors[i] *= inside(stretch[i] + move, width[i], rules.limit)
        at_early += survivors_early[i]
        at_end += survivors[i]
    return at_early, at_end


@device
def steepen(pool, count, slip, off, rules):
    """Write ∫k dt of each bond over that of a fresh one to pool[3], or 0 if no such factor exists."""
    for i in range(count):
        pool[3, i] = growth(pool[1, i] + off, slip, rules)


@device
def births(free, early, late, step, speed, rules):
    """Return the births of a step by Radau IIA: weights at its third and at its end, free sites then, and the error.

    F(t) = 1 − R(t) − ∫k_on F(s) S(t − s)ds at t = h/3 and h, R = ``early`` and ``late``, the integral by the two-stage
    rule. It is of third order, and stable for any k_on h. The error is the distance to the trapezoidal rule.
    """
    z = rules.rebinding * step
    before = math.exp(-fresh_integral(-2.0 / 3.0 * step, speed, rules))
    after = math.exp(-fresh_integral(2.0 / 3.0 * step, speed, rules))
    a, b, c, d = (
        1.0 + 5.0 / 12.0 * z,
        -z / 12.0 * before,
        0.75 * z * after,
        1.0 + 0.25 * z,
    )
    p, q = max(0.0, 1.0 - early), max(0.0, 1.0 - late)
    whole = a * d - b * c
    first, last = (p * d - b * q) / whole, (a * q - c * p) / whole
    other = 0.5 * z * free * math.exp(-fresh_integral(step, speed, rules))
    error = math.fabs(other + 0.25 * z * last - c * first)
    if min(first, last) >= 0.0:
        return c * first, 0.25 * z * last, 0.0, error
    # only roundings, or a step too short to refuse, end with these
    born = min(max(q - last, 0.0), q)
    return (
        (born if first > 0.0 else 0.0),
        (0.0 if first > 0.0 else born),
        min(first, last),
        error,
    )


@device
def carry(pool, count, move, off, born_early, born_late, rules):
    """Accept a step: move the survivors, drop negligible cohorts, add the births, and return the new count."""
    weight, stretch, width, survivors = pool[0], pool[1], pool[2], pool[4]
    whole = born_early + born_late
    for i in range(count):
        whole += survivors[i]
    left = 0
    for i in range(count):
        if survivors[i] > 1e-18 * whole:
            weight[left], stretch[left], width[left] = (
                survivors[i],
                stretch[i] + move,
                width[i],
            )
            if rules.limit < math.inf:
                low = max(stretch[left] - 0.5 * width[i], -rules.limit)
                high = min(stretch[left] + 0.5 * width[i], rules.limit)
                stretch[left], width[left] = 0.5 * (low + high), high - low
            left += 1
    if born_early + born_late <= 1e-18 * whole:
        return left
    far = 2.0 / 3.0 * move - 4.0 / 3.0 * off
    if rules.limit < math.inf or far == 0.0:
        share = born_early / (born_early + born_late)
        weight[left], stretch[left], width[left] = (
            born_early + born_late,
            share * far,
            0.0,
        )
        width[left] = math.sqrt(12.0 * share * (1.0 - share)) * math.fabs(far)
        return left + 1
    weight[left], stretch[left], width[left] = born_early, far, 0.0
    weight[left + 1], stretch[left + 1], width[left + 1] = born_late, 0.0, 0.0
    return left + (2 if born_late > 0.0 else 1)


@device
def try_step(pool, count, move, speed, step, off, free, rules):
    """Try a step; return births at its two stages, and the factor by which the step should change (< 1 refuses it)."""
    early, late = survive(pool, count, move, speed, step, off, rules)
    if rules.rebinding == 0.0:
        return 0.0, 0.0, 4.0
    born_early, born_late, lowest, error = births(free, early, late, step, speed, rules)
    if lowest < -1e-14:
        return born_early, born_late, 0.2
    bound, rounding = (
        late + born_early + born_late + 1e-9 * (1.0 - free),
        1e-15 * (1.0 + rules.rebinding * step),
    )
    allowed = rules.tolerance / 3.0 * bound + rounding
    factor = 4.0 if error <= 0.0 else (allowed / error) ** (1.0 / 3.0)
    if factor < 1.0:
        return born_early, born_late, max(0.02, 0.85 * factor)
    return born_early, born_late, min(4.0, max(1.0, 0.9 * factor))


@device
def _forgets(pool, other, count, speed, duration, rules):
    """Return the number of cohorts of the steady state, written to ``other``, if a step forgets its start, else 0."""
    depth = math.log(100.0 / rules.tolerance)
    if rules.rebinding == 0.0 or not duration > depth * hazard_time(
        0.0, speed, 1.0, rules
    ):
        return 0
    steady_count, life, square = fill_steady(other, speed, rules)
    pause = 1.0 / rules.rebinding
    cycle = life + pause
    spread = (
        max(0.0, 2.0 * square / life / life - 1.0) * (life / cycle) ** 2
        + (pause / cycle) ** 2
    )
    lives = min(300.0, depth / min(1.0, 2.0 * math.pi**2 * spread))
    rest = duration - lives * life
    if rest <= 0.0:
        return 0
    _, left = survive(pool, count, speed * rest, speed, rest, 0.0, rules)
    return steady_count if left <= 1e-3 * rules.tolerance * (life / cycle) else 0


@device
def _step_row(pool, count, travelled, settled, slip, duration, rules):
    """Advance a population by a clock step in sub-steps; return its cohorts, slider position and settled number."""
    speed = min(max(slip / duration, -1e200), 1e200) if duration > 0.0 else 0.0
    direction = -1.0 if slip < 0.0 else 1.0
    steepen(pool, count, slip, 0.0, rules)
    steady_count = _forgets(pool, pool[5:], count, speed, duration, rules)
    if steady_count > 0:
        for k in range(3):
            pool[k, :steady_count] = pool[5 + k, :steady_count]
        left = settle(pool[0], pool[1], pool[2], steady_count, direction, 0.0, rules)
        return left, 0.0, left
    typical = hazard_time(0.0, speed, 1.0, rules)
    longest = typical * (7.0 * rules.tolerance) ** (1.0 / 3.0)
    shortest = 1e-13 * duration
    if speed != 0.0:
        longest = min(longest, 0.75 * rules.cell / math.fabs(speed))
        if rules.limit < math.inf:
            shortest = max(shortest, 1e-15 * rules.limit / math.fabs(speed))
    if rules.rebinding == 0.0:
        longest = math.inf
    done, step, going = 0.0, duration, True
    while going:
        step = min(step, longest)
        remaining = duration - done
        going = step < 0.999 * remaining
        step = min(step, 0.5 * remaining) if going else remaining
        bound = 0.0
        for i in range(count):
            bound += pool[0, i]
        move = speed * step if done > 0.0 or going else slip
        born_early, born_late, factor = try_step(
            pool, count, move, speed, step, 0.0, max(0.0, 1.0 - bound), rules
        )
        if factor < 1.0 and step > shortest:
            step, going = max(step * factor, shortest), True
            continue
        count = carry(pool, count, move, 0.0, born_early, born_late, rules)
        travelled += move
        done += step
        step *= max(factor, 1.0)
        if count > 1.25 * settled + 16.0 or count + 2 > pool.shape[1]:
            count = settle(
                pool[0], pool[1], pool[2], count, direction, travelled, rules
            )
            settled = count
        if going:
            steepen(pool, count, slip, 0.0, rules)
    return count, travelled, settled


#: Arrays of ``Cohorts``.
_COHORTS = "UniTuple(float64[:,::1], 4)"


@device
def read_row(pool, weight, stretch, width, share):
    """Read a ``share`` of each cohort of a row into a pool, without empty places, and return their number."""
    count = 0
    for i in range(weight.size):
        if weight[i] * share > 0.0:
            pool[0, count], pool[1, count] = weight[i] * share, stretch[i]
            pool[2, count] = width[i] if width.size > 1 else 0.0
            count += 1
    return count


@kernel(
    f"void({_COHORTS}, float64[:], float64[:,:], float64[:], {RULES}, {_COHORTS}, float64[:,:,::1])"
)
def step_rows(before, share, slip, duration, numbers, after, sums):
    """Advance all rows by all steps, each row from a ``share`` of its bonds, and write its sums after each step."""
    (
        (weight, stretch, width, lattice),
        (new_weight, new_stretch, new_width, new_lattice),
    ) = before, after
    rules = Rules(*numbers)
    pool = np.empty((9, new_weight.shape[1] + 520))
    for m in range(len(new_weight)):
        old = m % len(weight)
        count = read_row(
            pool, weight[old], stretch[old], width[old], share[m % share.size]
        )
        travelled, settled = lattice[old, 0], lattice[old, 1]
        row = new_weight[m], new_stretch[m], new_width[m], new_lattice[m]
        for k in range(duration.size):
            moved = slip[k, m % slip.shape[1]]
            count, travelled, settled = _step_row(
                pool, count, travelled, settled, moved, duration[k], rules
            )
            count = write_row(pool, count, travelled, settled, moved, rules, row)
            travelled, settled = row[3][0], row[3][1]
            sum_row(
                new_weight[m, :count],
                new_stretch[m],
                new_width[m],
                rules,
                pool[4],
                sums[:, k, m],
            )
            count = read_row(pool, new_weight[m], new_stretch[m], new_width[m], 1.0)


@device
def write_row(pool, count, travelled, settled, slip, rules, row):
    """Write the first ``count`` cohorts of a pool into a row of ``Cohorts``, with its lattice; merge too many ones.

    Return the number written.
    """
    weight, stretch, width, lattice = row
    if count > weight.size:
        count = settle(
            pool[0],
            pool[1],
            pool[2],
            count,
            -1.0 if slip < 0.0 else 1.0,
            travelled,
            rules,
        )
        settled = count
    lattice[0] = (
        travelled % (1048576.0 * rules.cell) if rules.cell < math.inf else travelled
    )
    lattice[1] = settled
    weight[:count], stretch[:count] = pool[0, :count], pool[1, :count]
    weight[count:], stretch[count:] = 0.0, 0.0
    if width.size > 1:
        width[:count], width[count:] = pool[2, :count], 0.0
    return count


@device
def sum_row(weight, stretch, width, rules, rates, sums):
    """Write the sums over the cohorts of a row, as of ``moments``; ``rates`` is a work array."""
    sums[:] = 0.0
    rates_at(stretch[: weight.size], rules, rates)
    limit, cell = rules.limit, rules.cell
    for i in range(weight.size):
        w, x, d = weight[i], stretch[i], (width[i] if width.size > 1 else 0.0)
        if not w > 0.0:
            continue
        sums[0] += w
        sums[1] += w * x
        sums[2] += w * (x * x + d * d / 12.0)
        if d > 0.0 and limit < math.inf:
            size, half = math.fabs(x), 0.5 * d
            outermost = min(size + half, limit) - max(size - half, limit - cell)
            sums[3] += limit / cell * w * (max(outermost, 0.0) / d)
        sums[4] += w * x * rates[i]


@kernel(
    f"void(float64[:,::1], float64[:,::1], float64[:,::1], {RULES}, float64[:,::1])"
)
def sum_rows(weight, stretch, width, numbers, sums):
    """Write the sums over the cohorts of each row, shape (5, rows)."""
    rules, rates = Rules(*numbers), np.empty(weight.shape[1])
    for m in range(len(weight)):
        sum_row(weight[m], stretch[m], width[m], rules, rates, sums[:, m])


@kernel(
    f"void(float64, {RULES}, float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1])"
)
def settle_steady(speed, numbers, weight, stretch, width, lattice):
    """Write the merged steady state of one row."""
    rules = Rules(*numbers)
    pool = np.empty((3, weight.shape[1] + 520))
    count, _, _ = fill_steady(pool, min(max(speed, -1e200), 1e200), rules)
    count = settle(
        pool[0], pool[1], pool[2], count, math.copysign(1.0, speed), 0.0, rules
    )
    write_row(
        pool,
        count,
        0.0,
        count,
        speed,
        rules,
        (weight[0], stretch[0], width[0], lattice[0]),
    )


_POINTS = np.polynomial.legendre.leggauss(5)
_NODES, _SHARES = (
    tuple((0.5 + 0.5 * _POINTS[0]).tolist()),
    tuple((0.5 * _POINTS[1]).tolist()),
)


@device
def fill_steady(room, speed, rules):
    """Write the steady state at ``speed`` into room[0:3] (weight, stretch, width); return (cohorts, ⟨T⟩, ⟨T²⟩/2).

    Notes
    -----
    Bonds of age a have survived with S(a) and are stretched by V a, so that weights are k_on F S(a)da, F = 1/(1 +
    k_on⟨T⟩). Five Gauss nodes on panels in which neither ln S nor the rupture changes by much.
    """
    oldest = hazard_time(0.0, speed, 42.0, rules)
    panel = 0.7 * hazard_time(0.0, speed, 1.0, rules)
    pace = math.fabs(speed) * rules.steepness
    segments = rules.limit < math.inf
    if pace > 0.0:
        panel = min(panel, 0.5 / pace)
    if segments and speed != 0.0:
        panel = min(panel, rules.cell / math.fabs(speed))
    panels = min(math.ceil(oldest / panel), room.shape[1] // (1 if segments else 5))
    panel = oldest / panels
    count, life, square = 0, 0.0, 0.0
    for k in range(panels):
        mass, mean, spread = 0.0, 0.0, 0.0
        for node, share in zip(_NODES, _SHARES):  # noqa: B905 - compiled
            age = (k + node) * panel
            survivors = (
                share * panel * math.exp(-hazard_integral(0.0, speed * age, age, rules))
            )
            mass += survivors
            mean += survivors * age
            spread += survivors * age * age
            if not segments and survivors > 0.0:
                room[0, count], room[1, count], room[2, count] = (
                    survivors,
                    speed * age,
                    0.0,
                )
                count += 1
        if segments and mass > 0.0:
            centre = mean / mass
            variance = max(0.0, spread / mass - centre * centre)
            room[0, count], room[1, count] = mass, speed * centre
            room[2, count] = math.fabs(speed) * math.sqrt(12.0 * variance)
            count += 1
        life += mass
        square += mean
    for i in range(count):
        room[0, i] *= rules.rebinding / (1.0 + rules.rebinding * life)
    return count, life, square


class Cohorts(NamedTuple):
    """State of bond populations, one in each row.

    Attributes
    ----------
    weight : array, shape (rows, capacity)
        Share of the sites that hold a bond of this cohort [1]; 0 in empty places, which come last.
    stretch : array, shape (rows, capacity)
        Stretch [m], or its mean in a cohort of some width.
    width : array, shape (rows, capacity), or (rows, 1) of zeros without a cut-off
        Range of stretch [m] over which the cohort is uniform.
    lattice : array, shape (rows, 2)
        Slip of the lattice on which cohorts are merged [m], and their number after the last merging.
    """

    weight: Array
    stretch: Array
    width: Array
    lattice: Array


@device
def relax(row):
    """Take the stretch from all bonds of a ``row`` of ``Cohorts``, in place: they become one cohort."""
    weight, stretch, width, lattice = row
    bound = weight.sum()
    weight[:], stretch[:], width[:] = 0.0, 0.0, 0.0
    weight[0], lattice[1] = bound, 1.0


def unstretched(rupture: RuptureRate, tolerance: float, share: float) -> Cohorts:
    """Return a population with an unstretched bond at a ``share`` of the sites."""
    capacity = 5 * _most(rupture, tolerance) // 4 + 32
    weight = np.zeros((1, capacity))
    weight[0, 0] = share
    width = np.zeros((1, capacity if rupture.limit < math.inf else 1))
    return Cohorts(weight, np.zeros((1, capacity)), width, np.zeros((1, 2)))


def steady(
    rupture: RuptureRate, rebinding_rate: float, speed: float, tolerance: float
) -> Cohorts:
    """Return a population in steady sliding at ``speed`` [m/s], of any sign.

    Notes
    -----
    After a long rest the share k_on/(k_on + k0) is bound, all unstretched. In sliding bonds
    of age a are stretched by V a and number k_on F S(a) da, F = 1/(1 + k_on⟨T⟩), S the survival of a fresh
    bond and ⟨T⟩ its mean life: quadrature over the age, good to 1e-9 before it is merged within the tolerance.

    Examples
    --------
    At a speed that stretches a bond by its Bell force in its life at rest, one bond in four is missing:

    >>> bell = RuptureRate(rate=1.0, softness=1.0, limit=math.inf)
    >>> moving = steady(bell, rebinding_rate=1.0, speed=1.0, tolerance=1e-4)
    >>> print(f"{moving.weight.sum():.3f} of {steady(bell, 1.0, 0.0, 1e-4).weight.sum():.1f}")
    0.374 of 0.5
    """
    at_rest = (
        rebinding_rate / (rebinding_rate + rupture.at_rest)
        if rebinding_rate > 0.0
        else 0.0
    )
    result = unstretched(rupture, tolerance, at_rest)
    if rebinding_rate > 0.0 and speed != 0.0:
        settle_steady(
            float(speed), numbers_of(rupture, rebinding_rate, tolerance), *result
        )
    return result


def advance(
    cohorts: Cohorts,
    slip: Array,
    duration: Array,
    rupture: RuptureRate,
    rebinding_rate: float,
    tolerance: float,
    share: Array,
) -> tuple[Cohorts, Array]:
    """Return the populations after steps of constant speed each, and their moments.

    Parameters
    ----------
    cohorts : Cohorts
        Of one row or of as many as slips; one row and many slips give many rows.
    slip : array, shape (steps, 1) or (steps, rows)
        Slip of each row in each step [m], of any sign.
    duration : array, shape (steps,)
        Length of each step [s]; the speed in it is slip/duration.
    rupture : RuptureRate
        Rupture rate; the same one in all calls, as is the tolerance.
    rebinding_rate : float
        k_on of a free site [1/s], not negative.
    tolerance : float
        Relative error allowed in the number of bonds.
    share : array, shape (1,) or (rows,)
        Share of each row's bonds that is left before the first step [1]; the other sites are free.

    Returns
    -------
    cohorts : Cohorts
        The populations at the end. A row depends, bit for bit, on its own state and slips alone.
    sums : array, shape (5, steps, rows)
        Their ``moments`` after each step.

    Notes
    -----
    Each row takes the whole duration at once if that is accurate, else sub-steps. In a step
    of length h the free sites solve F(t) = 1 − R(t) − ∫k_on F(s) S(t − s) ds with R and S, the survival of old and
    of fresh bonds, exact: two-stage Radau IIA collocation at h/3 and h (third order, and stable for any k_on h).
    The births make two new cohorts, so bonds and free sites add up to one. A step that no bond
    outlives ends in the steady state.
    """
    rows = max(slip.shape[1], len(cohorts.weight), len(share))
    after, sums = (
        tuple(np.zeros((rows, a.shape[1])) for a in cohorts),
        np.empty((5, len(duration), rows)),
    )
    step_rows(
        tuple(cohorts),
        share,
        slip,
        duration,
        numbers_of(rupture, rebinding_rate, tolerance),
        after,
        sums,
    )
    return Cohorts(*after), sums


def moments(cohorts: Cohorts, rupture: RuptureRate, tolerance: float) -> Array:
    """Return sums over the cohorts per site, shape (5, rows).

    - Share of the sites bound [1].
    - Stretch [m], the sum of w x.
    - Square stretch [m^2], with the spread within the width of a cohort.
    - Density of the stretch at the limit of the rupture times that limit [1], ℓ ρ(ℓ); 0 without a limit. It is the mean
      over the outermost of the merged cells, because the tolerance resolves no more.
    - Stretch that thermal rupture takes in unit time [m/s], the sum of w x k(|x|).
    """
    sums = np.empty((5, len(cohorts.weight)))
    sum_rows(
        cohorts.weight,
        cohorts.stretch,
        cohorts.width,
        numbers_of(rupture, 0.0, tolerance),
        sums,
    )
    return sums


def _most(rupture: RuptureRate, tolerance: float) -> int:
    """Return the largest number of cohorts left by merging."""
    if rupture.limit < math.inf:
        return int(min(4096.0, 2.2 / math.sqrt(tolerance) + 64.0))
    if rupture.steepness == 0.0:
        return 8
    cell = (432.0 * tolerance) ** 0.25
    return int(
        min(4096.0, 40.0 / cell + 2.0 * math.sqrt(10.0 / (_KINK * tolerance)) + 16.0)
    )


_KINK = 66.0


@functools.lru_cache(maxsize=256)
def numbers_of(
    rupture: RuptureRate, rebinding_rate: float, tolerance: float
) -> tuple[float, ...]:
    """Return the numbers of ``Rules``.

    A two-point Gauss rule over a cell of width d errs by d⁴/4320 of the cell's bonds, a uniform segment
    by d²/8 of them. A cell that contains zero averages a rupture with a kink and errs by 0.015 of its
    width times its share at most.
    """
    cell = math.inf
    if rupture.limit < math.inf:
        cell = rupture.limit * max(math.sqrt(tolerance), 1.0 / 1800.0)
    elif rupture.steepness > 0.0:
        cell = (432.0 * tolerance) ** 0.25 / rupture.steepness
    return (
        *rupture.numbers,
        *map(float, (rupture.steepness, rebinding_rate, tolerance, cell)),
        _KINK * tolerance,
        float(_most(rupture, tolerance)),
    )
