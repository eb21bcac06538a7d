"""Energy of a map of the shear stress on a disc, whose pixels at the edge count by the share that the disc covers."""

import functools
import math

import numpy as np
import scipy.ndimage

from sim.laws.halfspace import free_energy_of_map


def _quarter(x, y):
    """Area of the unit disc to the left of x and below y."""

    def segment(u):
        return 0.5 * (u * np.sqrt(1.0 - u * u) + np.arcsin(u))

    x, y = np.clip(x, -1.0, 1.0), np.clip(y, -1.0, 1.0)
    half = np.sqrt(1.0 - y * y)
    inner = np.clip(x, -half, half)
    band = segment(inner) + segment(half)
    below = band + y * (inner + half)
    ends = segment(np.minimum(x, -half)) + segment(np.maximum(x, half)) - segment(half)
    above = segment(x) + 0.5 * math.pi + ends + y * (inner + half)
    return np.where(y < 0.0, below, above)


@functools.lru_cache(maxsize=16)
def _coverage(points, radius):
    """Samples around a centred disc and the weight of each: the share of its pixel that is covered.

    Lengths in pixels; rows and columns are the same set, and may step over the border of the cell by two pixels.
    The shares are the disc smoothed over a pixel. Taking 1/24 of their second differences away undoes that smoothing
    to second order, so that the weights integrate smooth functions up to the edge.
    """
    middle = 0.5 * points
    index = np.arange(
        math.ceil(middle - radius - 0.5) - 1, math.floor(middle + radius + 0.5) + 2
    )
    corner = (np.append(index, index[-1] + 1) - 0.5 - middle) / radius
    area = radius**2 * _quarter(corner[:, None], corner)
    weight = np.clip(np.diff(np.diff(area, axis=0), axis=1), 0.0, 1.0)
    for axis in (0, 1):
        weight = (
            weight
            - scipy.ndimage.correlate1d(weight, [1.0, -2.0, 1.0], axis, mode="constant")
            / 24.0
        )
    weight.flags.writeable = False
    return index % points, weight


def disc_energies(maps, cell, radii, solid):
    """Energies per area of stress maps, shape (..., points, points), on discs of radii a in the middle of a cell.

    For a uniform stress it is low by 0.07 (pixel/a)², for k waves on the diameter by 0.2 k (pixel/a)², relative.
    """
    pixel = cell / maps.shape[-1]

    def energy(field, radius):
        index, share = _coverage(field.shape[-1], radius / pixel)
        held = field[index[:, None], index] * share
        per_area = free_energy_of_map(
            held, pixel, solid.shear_modulus, solid.poisson_ratio
        )
        return per_area * held.size * pixel**2 / (math.pi * radius**2)

    return np.vectorize(energy, otypes=[float], signature="(x,y),()->()")(maps, radii)
