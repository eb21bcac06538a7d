"""The law of a contact's moving edge: its speed at an excess of energy release rate, and Hertz's contact as its bound.

A ``scene`` is a tuple of numbers: contact modulus, curvature of the sphere, stiffness; load, displacement and work of
adhesion at the start, each with its rate; the unit of the excess. A ``front`` has speed and power of an opening edge,
and those of a healing one.
"""

import math

import numpy as np

from sim.numerics.jit import device

#: Relative distance from equilibrium that rounding leaves.
ROUNDING = 1e-12


@device
def excess(t, a, scene):
    """The missing indentation y, the excess s = (G - w)/work, and the slopes of s with a and with t.

    Below Hertz's radius G goes on as -G: nothing else than a monotone continuation for the inner
    solver, which never ends there.
    """
    modulus, curvature, stiffness, load, load_rate, displacement, displacement_rate, work, work_rate, scale = scene
    if stiffness == math.inf:
        spring, yielding = 1.0, 0.0
    else:
        yielding = 1.0 / (stiffness + 2.0 * modulus * a)
        spring = stiffness * yielding
    hertz = a * a * curvature
    y = spring * (hertz - displacement - displacement_rate * t)
    y += yielding * (4.0 / 3.0 * modulus * a * hertz - load - load_rate * t)
    y_a = 2.0 * a * curvature - 2.0 * modulus * yielding * y
    y_t = -spring * displacement_rate - yielding * load_rate
    unit = modulus * abs(y) / (2.0 * math.pi * a * scale)
    s = unit * y - (work + work_rate * t) / scale
    return y, s, unit * (2.0 * y_a - y / a), 2.0 * unit * y_t - work_rate / scale


@device
def edge_speed(s, front):
    """da/dt at an excess s, and its slope with s.

    Closer to equilibrium than rounding resolves the law is a straight line, lest its slope end at 0 or infinity.
    """
    speed, power = (front[0], front[1]) if s > 0.0 else (front[2], front[3])
    near = ROUNDING if power >= 1.0 else 1e3 * ROUNDING
    if abs(s) < near:
        slope = -speed * math.pow(near, power - 1.0)
        return slope * s, slope
    rate = -math.copysign(speed * math.pow(abs(s), power), s)
    return rate, rate * power / s


@device
def bare_force(t, scene):
    """Force of the control on a contact of vanishing radius [N]; the indentation [m] if the stiffness is infinite."""
    _, _, stiffness, load, load_rate, displacement, displacement_rate, _, _, _ = scene
    if stiffness == math.inf:
        return displacement + displacement_rate * t
    return load + load_rate * t + stiffness * (displacement + displacement_rate * t)


@device
def hertz_force(a, scene):
    """The bare force that goes with Hertz's contact of radius a."""
    if scene[2] == math.inf:
        return a * a * scene[1]
    return a * a * scene[1] * (scene[2] + 4.0 / 3.0 * scene[0] * a)


@device
def hertz_radius(t, scene):
    """Hertz's radius under the control at t; 0 where nothing presses.

    The force grows with the radius and is convex, so Newton's steps from the right go left.
    """
    modulus, curvature, stiffness = scene[0], scene[1], scene[2]
    force = bare_force(t, scene)
    if not force > 0.0:
        return 0.0
    if stiffness == math.inf:
        return math.sqrt(force / curvature)
    a = np.cbrt(0.75 * force / (curvature * modulus))
    if stiffness > 0.0:
        a = min(a, math.sqrt(force / (curvature * stiffness)))
    for _ in range(60):
        lower = a - (hertz_force(a, scene) - force) / (a * curvature * (2.0 * stiffness + 4.0 * modulus * a))
        if not lower < a:
            break
        a = lower
    return a


@device
def pushed(t, scene, front):
    """True if Hertz's contact at t grows faster than the edge heals; and its radius."""
    a = hertz_radius(t, scene)
    modulus, curvature, stiffness, _, load_rate, _, displacement_rate, work, work_rate, scale = scene
    rate, _ = edge_speed(-(work + work_rate * t) / scale, front)
    if stiffness == math.inf:
        indenting = displacement_rate
    else:
        indenting = (load_rate + stiffness * displacement_rate) / (stiffness + 2.0 * modulus * a)
    return rate <= indenting / (2.0 * a * curvature), a
