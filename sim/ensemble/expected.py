"""Contacts in steady sliding as their members are distributed, and the area that each mechanism can take at most."""

import functools
import math
from typing import NamedTuple

import numpy as np

from sim.ensemble.steady import changed, steady_course
from sim.numerics.gamma import GammaTable, gamma_table
from sim.parts.exchange import Array, Flags
from sim.scenario.scenario import Scenario

#: Times of a run at which it is judged; energies of a member, and those on a disc, whose equilibrium is slow to find.
TIMES, _ENERGIES, _ON_DISC = 21, 256, 32
#: Energies among which the one that masks a contact is searched, and the largest of them in standard deviations.
_SEARCHED, _LARGEST = 33, 12.0
#: Loss of area below which there is none but of rounding [1].
_ROUNDING = 1e-9


class StoredEnergy(NamedTuple):
    """Distribution of ΔΓ at amplitude 1 between members: a gamma number with an offset.

    Attributes
    ----------
    mean, deviation, skewness : float
        Mean and standard deviation [J/m²], skewness [1].
    """

    mean: float
    deviation: float
    skewness: float

    @classmethod
    def of(cls, point: Scenario) -> "StoredEnergy":
        """Return the distribution in the cell of a scenario."""
        weight, shape, _, constant = point.process.gammas
        mean = float(np.sum(weight * shape)) + constant
        deviation = math.sqrt(np.sum(weight**2 * shape))
        third = 2.0 * float(np.sum(weight**3 * shape))
        return cls(mean, deviation, third / deviation**3 if deviation else 0.0)

    @property
    def table(self) -> GammaTable:
        """Return the distribution, scaled to the mean 0 and the variance 1."""
        return _table(self.skewness)

    def values(self, count: int) -> Array:
        """Return equally likely energies, shape (count,) [J/m²]."""
        if not self.deviation:
            return np.full(1, self.mean)
        return np.asarray(self.mean + self.deviation * self.table.quantiles(count))

    def above(self, energy: Array) -> Array:
        """Return the probability of a larger energy [1]; the mean counts as larger if nothing fluctuates."""
        if not self.deviation:
            return np.where(energy <= self.mean, 1.0, 0.0)
        return self.table.above((energy - self.mean) / self.deviation)


# the points of a sweep have few distributions
_table = functools.lru_cache(maxsize=64)(gamma_table)


def energies_of(point: Scenario) -> int:
    """Return the number of energies at which the contact of a member is computed."""
    return _ENERGIES if point.margin is None else _ON_DISC


def along(point: Scenario) -> tuple[Array, Array]:
    """Return times [s] and absolute speeds [m/s] of a run, shape (times, 1); one of each if all are alike."""
    times = np.linspace(0.0, point.times.duration, TIMES)
    speeds = np.abs(point.speeds(TIMES))
    count = None if point.contact.changes or np.ptp(speeds) else 1
    return times[:count, np.newaxis], speeds[:count, np.newaxis]


def jkr_radius(point: Scenario, times: Array, share: float = 1.0) -> Array:
    """Return the radius with a share of the work of adhesion at times [s], shape (times, 1) [m]; nan if open."""
    control = point.contact.control(times, point.clock.duration)
    work = np.full(times.shape, share * point.adhesion.work)
    return control.radius(work, point.bodies)


def areas(
    point: Scenario, times: Array, speeds: Array, stored: Array | None = None
) -> Array:
    """Return A/A_JKR in steady sliding, arguments as of ``steady_course``; nan without a contact."""
    full = jkr_radius(point, times)
    radius = steady_course(point, times, speeds, stored).radius
    return np.asarray((radius / np.where(full > 0.0, full, np.nan)) ** 2)


class Expected(NamedTuple):
    """Steady sliding of the members of a scene along its run; arrays have the shape (times,).

    Attributes
    ----------
    speed : array
        Sliding speed [m/s].
    energy : array
        Mean ΔΓ [J/m²].
    masked, lost : array
        Share of the members whose contact is masked, and of those without an equilibrium, which pull off [1].
    without : array, shape (4, times)
        Mean A/A_JKR without bond rupture and fluctuations, without fluctuations, without bond rupture, and with both,
        over closed contacts.
    """

    speed: Array
    energy: Array
    masked: Array
    lost: Array
    without: Array

    @property
    def area(self) -> Array:
        """Return the mean A/A_JKR."""
        return np.asarray(self.without[3])

    @property
    def masked_time(self) -> float:
        """Return the share of the run in which a contact is masked, by the trapezoidal rule [1]."""
        shares = self.masked
        between = 0.5 * (shares[1:] + shares[:-1]) if len(shares) > 1 else shares
        return float(np.mean(between))


def expected(point: Scenario) -> Expected:
    """Return the steady sliding of the members of a scene, by the distribution of ΔΓ in its cell.

    The mean is that of the area, not the area at the mean ΔΓ. The noise of single bonds is left out.
    """
    times, speeds = along(point)
    law = StoredEnergy.of(point)
    likely = law.values(energies_of(point))
    # the rest of the range finds the energies that mask a contact although they are rare
    rare = law.mean + law.deviation * np.linspace(-_LARGEST, _LARGEST, _SEARCHED)
    stored = np.concatenate([likely, np.maximum(rare, 0.0)])
    course = steady_course(point, times, speeds, stored)
    order = np.argsort(stored, kind="stable")
    rows = zip(course.work[:, order], course.radius[:, order], strict=True)
    shares = [_masked_and_lost(law, stored[order], *row) for row in rows]
    masked, lost = np.array(shares).T
    whole, none = changed(point, {"adhesion.bond_share": 0.0}), np.zeros(1)
    means = []
    for scene, energies in (
        (whole, none),
        (point, none),
        (whole, likely),
        (point, likely),
    ):
        ratios = areas(scene, times, speeds, energies)
        is_closed = np.isfinite(ratios)
        total = np.sum(np.where(is_closed, ratios, 0.0), axis=-1)
        count = np.sum(is_closed, axis=-1)
        means.append(
            np.divide(total, count, np.full(len(total), np.nan), where=count > 0)
        )
    energy = np.mean(course.energy[:, : len(likely)], axis=-1)
    return Expected(speeds[:, 0], energy, masked, lost, np.array(means))


def _masked_and_lost(
    law: StoredEnergy, stored: Array, work: Array, radius: Array
) -> tuple[float, float]:
    """Return the shares of masked and of open contacts, from the work of adhesion left at increasing energies."""
    is_open = np.isnan(radius)
    lost = float(law.above(_first(stored, is_open, is_open - 0.5)))
    masked = float(law.above(_first(stored, work <= 0.0, -work)))
    # an open contact is not masked, because nothing touches
    return max(masked - lost, 0.0), lost


def _first(stored: Array, flags: Flags, rising: Array) -> Array:
    """Return the energy at which a flag is first true, between two energies by the zero of a ``rising`` number."""
    if not flags.any():
        return np.array(math.inf)
    place = int(np.argmax(flags))
    if place == 0:
        return np.asarray(stored[0])
    before, after = rising[place - 1], rising[place]
    share = before / (before - after)
    return np.asarray(stored[place - 1] + share * (stored[place] - stored[place - 1]))


class LargestLosses(NamedTuple):
    """Largest shares of the JKR area that mechanisms can take at the load of a run; arrays of shape (times,).

    Attributes
    ----------
    bonds, waves : array
        By the rupture of all bonds, and by fluctuations of any size that adhesion pays for [1]. They are 1 if the
        contact pulls off.
    mean_stress : array
        By the mean stress of the bonds in steady sliding if sliding is reversible [1]; nan if the contact knows none.
    """

    bonds: Array
    waves: Array
    mean_stress: Array


def largest_losses(point: Scenario) -> LargestLosses:
    """Return the largest loss of area by each mechanism at the load, the indentation or the displacement of a run.

    Each is 0 in the limit of a large load, where adhesion holds no area. It is nan without a contact.
    """
    times, speeds = along(point)
    full = jkr_radius(point, times)
    left: list[Array] = [
        jkr_radius(point, times, 1.0 - point.adhesion.bond_share),
        jkr_radius(point, times, 0.0),
    ]
    if point.contact.takes_mean_stress:
        changes = {"contact.reversible": 1.0, "adhesion.bond_share": 0.0}
        reversible = changed(point, changes)
        left.append(steady_course(reversible, times, speeds, np.zeros(1)).radius)
    # a cohesive sphere that is held within reach of the attraction may have no contact to lose
    full = np.where(full > 0.0, full, np.nan)
    losses = [1.0 - (np.nan_to_num(radius) / full)[:, 0] ** 2 for radius in left]
    losses = [np.where(np.abs(loss) < _ROUNDING, 0.0, loss) for loss in losses]
    if not point.contact.takes_mean_stress:
        losses.append(np.full(losses[0].shape, np.nan))
    return LargestLosses(*losses)
