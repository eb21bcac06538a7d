"""Scales that adhesion sets: twice the pull-off load, the last contact at fixed grips; two springs in series."""

import math

from sim.numerics.jit import device
from sim.numerics.special import cube_root


@device
def twice_pull_off(work, sphere_radius):
    """3 pi w R [N], twice the pull-off force."""
    return 3.0 * math.pi * work * sphere_radius


@device
def fold_radius(work, sphere_radius, modulus):
    """Radius at which the contact at a given indentation ends: (pi w R^2 / 8 E*)^(1/3) [m]; nan for w < 0."""
    return cube_root(math.pi * work * sphere_radius * (sphere_radius / (8.0 * modulus)))


@device
def fold_indentation(work, sphere_radius, modulus):
    """Indentation at which it ends: -3 a^2/R with that radius [m]."""
    a = fold_radius(work, sphere_radius, modulus)
    return -3.0 * (a * (a / sphere_radius))


@device
def series_shares(stiffness, contact):
    """k/(k + b) and b/(k + b) for the stiffness k of the spring and b of the contact, each from 0 to inf."""
    stiffness = stiffness + 0.0  # no -0
    stiffer = stiffness > contact
    high = stiffness if stiffer else contact
    low = contact if stiffer else stiffness
    larger = 1.0 / (1.0 + low / high)
    smaller = low / high * larger
    return (larger if stiffer else smaller), (smaller if stiffer else larger)
