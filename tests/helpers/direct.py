"""Sliders on few or many sites behind a spring, by own programs that go through all sites at each event.

The slider has no mass, and the contact is rigid. The contact area depends on the number of bonds alone. Units are
Bell's stretch, the life of a bond at rest, which is the mean time of a rebinding, and the force of all sites at the
unit of stretch over the area at rest.
"""

import math

import numpy as np
from helpers.driven import LOAD, WORK, R
from numba import njit


def areas(sites, share):
    """Contact area over that at rest for each number of bonds, which carry a ``share`` of the work of adhesion.

    JKR's radius cubed is in proportion to this sum. At rest half of the sites are bound.
    """
    bonds = np.append(2.0 * np.arange(sites + 1) / sites, 1.0)
    pull = 3.0 * math.pi * R * WORK * (1.0 - share + share * bonds)
    cubed = LOAD + pull + np.sqrt(2.0 * pull * LOAD + pull**2)
    return (cubed[:-1] / cubed[-1]) ** (2.0 / 3.0)


@njit
def gillespie(stiffness, speed, area, times, noise):
    """Position and number of bonds at some times, by the direct method with thinning; all sites are bound at first."""
    sites = area.size - 1
    stretch, bound, count = np.zeros(sites), np.ones(sites, np.bool_), sites
    positions, numbers = np.empty(times.size), np.empty(times.size)
    time, x, k = 0.0, 0.0, 0
    while True:
        total = 0.0
        for i in range(sites):
            total += stretch[i] if bound[i] else 0.0
        stiff = stiffness + area[count] * count / sites
        slip = (stiffness * (speed * time - x) - area[count] * total / sites) / stiff
        x += slip
        v = stiffness * speed / stiff
        window = 0.1 / v
        most = 0.0
        for i in range(sites):
            if bound[i]:
                stretch[i] += slip
                most += math.exp(abs(stretch[i]) + v * window)
        binds = sites - count
        wait = noise.exponential() / (most + binds)
        step = min(wait, window)
        while times[k] <= time + step:
            positions[k], numbers[k] = x + v * (times[k] - time), count
            k += 1
            if k == times.size:
                return positions, numbers
        time, x = time + step, x + v * step
        for i in range(sites):
            stretch[i] += v * step
        if wait > window:
            continue
        pick = noise.random() * (most + binds) - binds
        if pick < 0.0:
            free = noise.integers(0, sites - count)
            for i in range(sites):
                if not bound[i]:
                    if free == 0:
                        bound[i], stretch[i] = True, 0.0
                        break
                    free -= 1
            count += 1
            continue
        for i in range(sites):
            if bound[i]:
                weight = math.exp(abs(stretch[i] - v * step) + v * window)
                pick -= weight
                if pick < 0.0:
                    if noise.random() * weight < math.exp(abs(stretch[i])):
                        bound[i] = False
                        count -= 1
                    break


def _time_to(rest, along, speed):
    """Time in which e^|stretch| adds up to ``rest`` at a speed; ``along``: stretches along the motion."""
    if speed == 0.0:
        return rest * np.exp(-np.abs(along))
    against = np.maximum(-along, 0.0)
    before_zero = np.expm1(against) / speed
    shrinks = rest < before_zero
    slows = -np.log1p(-np.where(shrinks, rest, 0.0) * speed * np.exp(-against))
    left = np.where(shrinks, 0.0, rest - before_zero)
    grows = against + np.log1p(left * speed * np.exp(-np.maximum(along, 0.0)))
    return np.where(shrinks, slows, grows) / speed


def _spent(along, speed, time):
    """Sum of e^|stretch| over a time."""
    if speed == 0.0:
        return time * np.exp(np.abs(along))
    after = along + speed * time
    ends = [np.sign(u) * np.expm1(np.abs(u)) for u in (along, after)]
    return (ends[1] - ends[0]) / speed


def replay(stiffness, stage, area, draw, times):
    """Position and number of bonds at some times, with given draws; all sites are bound at first.

    ``stage``: ends of its pieces and their speeds. ``draw``: thresholds of all sites for a number of their lives, and
    the waiting times before them, which the first life has not.
    """
    ends, speeds = stage
    life = np.ones(len(draw(1)[0]), int)
    rest, wait = draw(1)[0].copy(), np.full(life.size, np.inf)
    stretch, bound, time, x, pulled = np.zeros(life.size), life > 0, 0.0, 0.0, 0.0
    positions, numbers, piece = [], [], 0
    while True:
        count = int(bound.sum())
        stiff = stiffness + area[count] * count / life.size
        force = area[count] * stretch[bound].sum() / life.size
        slip = (stiffness * (pulled - x) - force) / stiff
        x, stretch = x + slip, stretch + slip
        v = stiffness * speeds[piece] / stiff
        sense = math.copysign(1.0, v)
        lasts = np.where(bound, _time_to(rest, sense * stretch, abs(v)), wait - time)
        site = int(np.argmin(lasts))
        step = min(max(lasts[site], 0.0), ends[piece] - time)
        while times[len(positions)] <= time + step:
            positions.append(x + v * (times[len(positions)] - time))
            numbers.append(count)
            if len(positions) == len(times):
                return np.array(positions), np.array(numbers)
        rest = np.where(bound, rest - _spent(sense * stretch, abs(v), step), rest)
        time, x, stretch = time + step, x + v * step, stretch + v * step
        pulled += speeds[piece] * step
        if time >= ends[piece]:
            piece += 1
        elif bound[site]:
            life[site] += 1
            threshold, waits = (values[site] for values in draw(life[site]))
            bound[site], rest[site], wait[site] = False, threshold, time + waits
        else:
            bound[site], stretch[site] = True, 0.0
