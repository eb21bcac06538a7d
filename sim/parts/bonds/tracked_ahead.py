"""What bonds followed one by one do next on a way of the slider: ruptures, births, bonds that reach their limit."""

import math

from sim.numerics.jit import device
from sim.parts.bonds.rupture import time_to_rupture
from sim.parts.bonds.tracked_events import CLOCK, SENSE, SINGLY, SLIDER, TIME, moment


@device
def next_event(tracks, speed, most, law):
    """Time to the next rupture or binding at a speed [m/s], at most ``most``."""
    ((birth, due, _), soonest, frame), (rate, softness, limit, _) = tracks, law
    along, x, clock, time = frame[SENSE] * speed, frame[SLIDER], frame[CLOCK], frame[TIME] + most
    if frame[SINGLY] == 0.0 and along >= 0.0:
        first, rearmost = math.inf, math.inf
        for block in range(soonest.shape[1]):
            rupture, binding = soonest[0, block], soonest[1, block]
            if math.copysign(1.0, rupture) > 0.0:
                first = min(first, rupture)
            if math.copysign(1.0, binding) < 0.0:
                time = min(time, -binding)
            rearmost = min(rearmost, soonest[2, block])
        soon = time - frame[TIME]
        if first < math.inf and rate > 0.0:
            grown = rate * math.exp(softness * x)
            soon = min(soon, moment(first - clock, grown, along * softness, math.inf, most))
        if along > 0.0 and rearmost < math.inf:
            soon = min(soon, (rearmost + limit - x) / along)
        return max(soon, 0.0)
    soon = most
    for i in range(due.size):
        if math.copysign(1.0, due[i]) < 0.0:
            soon = min(soon, -due[i] - frame[TIME])
        else:
            left = due[i] if frame[SINGLY] > 0.0 else (due[i] - clock) * math.exp(-softness * birth[i])
            soon = min(soon, time_to_rupture(x - birth[i], along, max(left, 0.0), rate, softness, limit))
    return max(soon, 0.0)


@device
def next_cut(tracks, way, limit):
    """Slip along a ``way`` to where the next bond reaches the limit of its stretch [m]."""
    (birth, due, _), soonest, frame = tracks
    along, x = frame[SENSE] * way, frame[SLIDER]
    nearest = math.inf
    if frame[SINGLY] == 0.0 and along >= 0.0:
        for block in range(soonest.shape[1]):
            nearest = min(nearest, soonest[2, block] + limit - x)
        return max(nearest, 0.0)
    for i in range(due.size):
        if math.copysign(1.0, due[i]) > 0.0:
            stretch = x - birth[i] if along >= 0.0 else birth[i] - x
            nearest = min(nearest, limit - stretch)
    return max(nearest, 0.0)
