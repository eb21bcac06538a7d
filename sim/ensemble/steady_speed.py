"""Speeds at which steady sliding has lost shares of the area, and its stability there."""

from typing import cast

import numpy as np
import scipy
from scipy import special

from sim.ensemble.diagnosis import slider_body
from sim.ensemble.steady import steady_course
from sim.parts.drive import Spring
from sim.parts.exchange import Array
from sim.quantities import LOST
from sim.scenario.scenario import Scenario

#: Speeds of the curve in which crossings are searched, decades beyond those of the
#: drive, and equally likely energies of a member.
_SPEEDS, _BEYOND, _ENERGIES = 241, 3.0, 128


def speeds_of_areas(scene: Scenario, shares: Array) -> tuple[Array, Array]:
    """Return the lowest speeds at which steady sliding has shares of the JKR area, and its stability.

    Parameters
    ----------
    scene : Scenario
        At one point of a sweep, with a mount that does not change.
    shares : array
        Shares of the area with all adhesion [1], the mean over the energies of members.

    Returns
    -------
    speeds : array
        In steady sliding [m/s]. They are nan if there is none within three decades of the
        speeds of the drive, where it is not known if sliding is stable, and of bonds that
        break by chance or a pattern that passes under the contact, whose mean area has no
        closed form.
    stable : array
        True if steady sliding is stable behind the spring of the scene, or prescribed.
    """
    speeds = np.full(shares.shape, np.nan)
    stable = np.ones(shares.shape, bool)
    driven = np.abs(scene.speeds(_SPEEDS))
    if scene.population.is_random or scene.margin is not None or not driven.any():
        return speeds, stable
    energies = _energies(scene)
    now = np.zeros((1, 1))
    control = scene.contact.control(now, scene.clock.duration)
    work = np.full((1, 1), scene.adhesion.work)
    full = control.radius(work, scene.bodies)[0, 0]

    def area(logarithms: Array) -> Array:
        speed = np.exp(logarithms)[:, np.newaxis]
        course = steady_course(scene, 0.0 * speed, speed, energies)
        return np.mean(np.nan_to_num(course.radius / full) ** 2, axis=-1)

    ends = np.log([driven[driven > 0.0].min(), driven.max()])
    beyond = _BEYOND * np.log(10.0)
    grid = np.linspace(ends[0] - beyond, ends[1] + beyond, _SPEEDS)
    curve = area(grid)
    for place, share in np.ndenumerate(shares):
        after = int(np.argmax(curve <= share))
        if curve[0] > share >= curve[after]:
            logarithm = scipy.optimize.brentq(
                lambda x, level=share: float(area(np.array([x]))[0]) - level,
                *grid[after - 1 : after + 1],
                xtol=1e-10,
            )
            speeds[place] = np.exp(logarithm)
    known = np.isfinite(speeds)
    if scene.drive.model == "spring" and known.any():
        needed = scene.population.onset(
            speeds[known], slider_body(scene, speeds[known])
        ).stiffness
        stable[known] = needed <= cast(Spring, scene.drive).stiffness
        speeds[known] = np.where(np.isnan(needed), np.nan, speeds[known])
    return speeds, stable


def steady_speeds(scene: Scenario) -> dict[str, float]:
    """Return the numbers of the registry at which steady sliding of a scene loses shares of JKR's area [m/s].

    Empty if nothing lags behind a speed that changes, so that a course has the same speeds.
    """
    if not scene.lags_behind_speed:
        return {}
    works = np.array([0.0, scene.adhesion.work])
    hertz, full = scene.contact.equilibrium_radius(works, scene.bodies)
    half = 0.5 * (1.0 + (hertz / full) ** 2)
    left = [half if share is None else 1.0 - share for share in LOST.values()]
    speeds, stable = speeds_of_areas(scene, np.array(left))
    numbers = {}
    for name, speed, is_stable in zip(LOST, speeds, stable, strict=True):
        numbers[f"steady_speed_{name}"] = speed if is_stable else np.nan
        numbers[f"unstable_speed_{name}"] = np.nan if is_stable else speed
    return numbers


def _energies(scene: Scenario) -> Array | None:
    """Return equally likely energies of a member at amplitude 1 [J/m²]; None for that of the plane.

    The energy of a cell is a gamma number with an offset, of the mean, variance and
    skewness of its modes.
    """
    if "cell_error_energy" not in scene.process.known_errors():
        return None
    weight, shape, _, constant = scene.process.gammas
    mean, variance = np.sum(weight * shape) + constant, np.sum(weight**2 * shape)
    if not variance > 0.0:
        return np.array([mean])
    skewness = 2.0 * np.sum(weight**3 * shape) / variance**1.5
    order = 4.0 / max(skewness, 1e-4) ** 2
    levels = (np.arange(_ENERGIES) + 0.5) / _ENERGIES
    scores = special.gammaincinv(order, levels)
    scores = (scores - np.mean(scores)) / np.std(scores)
    return np.asarray(mean + np.sqrt(variance) * scores)
