"""The stationary density of a sliding population, as cohorts."""

import math

import numpy as np

from sim.hazards import hazard_integral, time_to_rupture
from sim.numerics.jit import device

_POINTS = np.polynomial.legendre.leggauss(5)
_NODES = tuple((0.5 + 0.5 * _POINTS[0]).tolist())
_SHARES = tuple((0.5 * _POINTS[1]).tolist())


@device
def fill_steady(room, speed, rules):
    """Write the steady state at ``speed`` into room[0:3] (weight, stretch, width): (cohorts, ⟨T⟩, ⟨T²⟩/2).

    Notes
    -----
    Bonds of age a have survived with S(a) and are stretched by V a, so that weights are k_on F S(a)da, F = 1/(1 +
    k_on⟨T⟩). Five Gauss nodes on panels in which neither ln S nor the hazard changes by much.
    """
    oldest = time_to_rupture(0.0, speed, 42.0, rules.rate, rules.softness, rules.limit)
    panel = 0.7 * time_to_rupture(0.0, speed, 1.0, rules.rate, rules.softness, rules.limit)
    pace = math.fabs(speed) * rules.softness
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
            survivors = share * panel * math.exp(-hazard_integral(0.0, speed * age, age, rules.rate, rules.softness))
            mass += survivors
            mean += survivors * age
            spread += survivors * age * age
            if not segments and survivors > 0.0:
                room[0, count], room[1, count], room[2, count] = survivors, speed * age, 0.0
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
