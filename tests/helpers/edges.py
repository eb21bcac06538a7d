"""The edges of many contacts moved over one clock step each, with numbers of their own."""

from typing import NamedTuple

import numpy as np

from sim.numerics.jit import kernel
from sim.parts.contact.front import moved_edge


class Hold(NamedTuple):
    """Control during a clock step, each number linear in time: P = load + stiffness (displacement - delta)."""

    load_before: float | np.ndarray = 0.0
    load_after: float | np.ndarray = 0.0
    displacement_before: float | np.ndarray = 0.0
    displacement_after: float | np.ndarray = 0.0
    stiffness: float | np.ndarray = 0.0


class Advance(NamedTuple):
    """Radius [m], time of detachment [s] and dissipated energy [J] of each member, see ``moved_edge``."""

    radius: np.ndarray
    detached_at: np.ndarray
    dissipated: np.ndarray


@kernel("void(float64[:,::1], float64[:,::1])")
def _advance(rows, out):
    for m in range(rows.shape[0]):
        a, w0, w1, load0, load1, base0, base1, stiffness = rows[m, :8]
        duration, scale, speed, exponent, heal_speed, heal_exponent, sphere_radius, modulus, least = rows[m, 8:]
        kinetics, bodies = (scale, speed, exponent, heal_speed, heal_exponent), (sphere_radius, modulus)
        out[m, 0], out[m, 1], out[m, 2] = moved_edge(
            a, (w0, w1), (load0, load1), (base0, base1), stiffness, duration, kinetics, bodies, least
        )


def advance(radius, work, hold, kinetics, duration, sphere_radius, modulus, detached_below=0.0):
    """Move the edge of each member's contact over one clock step; all broadcast against the radius."""
    radius = np.asarray(radius, dtype=float)
    columns = (radius, *work, *hold, duration, *kinetics, sphere_radius, modulus, detached_below)
    rows = np.empty((radius.size, len(columns)))
    for row, column in zip(rows.T, columns, strict=True):
        row[:] = column
    out = np.empty((radius.size, 3))
    _advance(rows, out)
    return Advance(*out.T.copy())
