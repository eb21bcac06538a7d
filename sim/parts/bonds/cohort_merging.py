"""Few cohorts for many: groups of nearly equal stretch become two, with the same first four moments.

The groups are cells of a lattice that is carried with the slider, so a cell keeps its bonds for life:
what is merged twice is merged within the same cell, and errors do not add up.
"""

import math

from sim.numerics.jit import device


@device
def settle(weight, stretch, width, count, direction, travelled, rules):
    """Merge ``count`` cohorts in place until at most ``rules.most`` are left; the number left.

    If that is not enough, sharp fronts within a cell are given up, and then the lattice is made coarser.
    """
    _sort(weight, stretch, width, count, direction)
    finest, cell, fronts = 64, rules.cell, rules.limit < math.inf
    count = _merge(weight, stretch, width, count, travelled, cell, finest, fronts, rules)
    while count > rules.most:
        if finest > 1:
            finest //= 2
        elif fronts:
            fronts = False
        else:
            cell *= 2.0
        count = _merge(weight, stretch, width, count, travelled, cell, finest, fronts, rules)
    return count


@device
def _sort(weight, stretch, width, count, direction):
    """Farthest along ``direction`` first; cohorts come almost in that order, oldest first."""
    for i in range(1, count):
        w, x, b = weight[i], stretch[i], width[i]
        j = i
        while j > 0 and (x - stretch[j - 1]) * direction > 0.0:
            weight[j], stretch[j], width[j] = weight[j - 1], stretch[j - 1], width[j - 1]
            j -= 1
        weight[j], stretch[j], width[j] = w, x, b


@device
def _merge(weight, stretch, width, count, travelled, cell, finest, fronts, rules):
    """Merge sorted cohorts cell by cell; the number left.

    A cell of many bonds is halved until its width times its share is below ``rules.heavy``: a cell
    that comes back through zero, where the rupture has a kink, then errs by less than the tolerance.
    """
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
        while parts < finest and cell * rules.steepness * inside > rules.heavy * whole * parts * parts:
            parts *= 2
        segments = rules.limit < math.inf
        left = _merge_cell(weight, stretch, width, first, last, left, travelled, cell / parts, segments, fronts)
        first = last
    return left


@device
def _merge_cell(weight, stretch, width, first, last, left, travelled, cell, segments, fronts):
    """Merge the cohorts ``first`` to ``last`` in cells of one width, writing from ``left`` on; where writing ends."""
    while first < last:
        place = math.floor((stretch[first] - travelled) / cell)
        end = first + 1
        while end < last and math.floor((stretch[end] - travelled) / cell) == place:
            if fronts and not _alike(weight, width, end - 1, end):
                break
            end += 1
        left += _gauss(weight, stretch, width, first, end, left, segments)
        first = end
    return left


@device
def _alike(weight, width, one, other):
    """True if two neighbouring segments have about the same density: a sharp front between others is not smeared."""
    here, there = weight[one] * width[other], weight[other] * width[one]
    return here <= 4.0 * there and there <= 4.0 * here


@device
def _gauss(weight, stretch, width, first, end, left, segments):
    """Write the cohorts ``first`` to ``end`` as two points (or one segment) of equal moments; how many.

    Two points are the Gauss rule of the group: positive weights, inside its hull, moments 0 to 3
    exact. A segment keeps moments 0 to 2.
    """
    if end - first <= (1 if segments else 2):
        for i in range(end - first):
            weight[left + i], stretch[left + i], width[left + i] = (
                weight[first + i],
                stretch[first + i],
                width[first + i],
            )
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
    above = square / (reach + math.fabs(lean))  # the nearer node's distance from the mean, without cancellation
    below = reach + math.fabs(lean)
    if lean > 0.0:
        above, below = below, above
    weight[left], stretch[left], width[left] = total * (below / (above + below)), mean + above, 0.0
    weight[left + 1], stretch[left + 1], width[left + 1] = total * (above / (above + below)), mean - below, 0.0
    return 2
