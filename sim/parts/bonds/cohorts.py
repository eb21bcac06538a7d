"""A population of bonds resolved by stretch: cohorts of equal stretch, carried with the slider.

A density n(x, t) per site of bonds stretched by x follows dn/dt + V dn/dx = −k(\\|x\\|) n + k_on F δ(x), F the share
of free sites. A cohort moves with the slider and dies by its exact rupture integral, so there is no
numerical diffusion and no limit to the step; only births and the merging of cohorts err, both within
a tolerance.
"""

import functools
import math
from typing import NamedTuple

import numpy as np

from sim.parts.bonds.cohort_step import settle_steady, step_rows, sum_rows
from sim.parts.bonds.rupture import RuptureRate
from sim.parts.exchange import Array

#: Share of the bonds that stay where none are lost.
_ALL = np.ones(1)


class Cohorts(NamedTuple):
    """State of bond populations, one in each row.

    Attributes
    ----------
    weight : array, shape (rows, capacity)
        Share of the sites that hold a bond of this cohort [1]; 0 in empty places, which come last.
    stretch : array, shape (rows, capacity)
        Stretch [m], or its mean in a cohort of some width.
    width : array, shape (rows, capacity), or (rows, 1) of zeros without a cut-off
        Range of stretch [m] over which the cohort is uniform.
    lattice : array, shape (rows, 2)
        Slip of the lattice on which cohorts are merged [m], and their number after the last merging.
    """

    weight: Array
    stretch: Array
    width: Array
    lattice: Array


def empty(rupture: RuptureRate, tolerance: float) -> Cohorts:
    """One population without a bond."""
    _check(rupture, tolerance)
    capacity = 5 * _most(rupture, tolerance) // 4 + 32
    blank = np.zeros((1, capacity))
    width = np.zeros((1, capacity if rupture.limit < math.inf else 1))
    return Cohorts(blank, blank.copy(), width, np.zeros((1, 2)))


def resting(rupture: RuptureRate, rebinding_rate: float, tolerance: float) -> Cohorts:
    """One population after a long rest: the share k_on/(k_on + k0) is bound, all unstretched.

    Examples
    --------
    >>> half = resting(RuptureRate(rate=2.0, softness=1e9, limit=math.inf), rebinding_rate=2.0, tolerance=1e-4)
    >>> float(bound(half)[0])
    0.5
    """
    rest = empty(rupture, tolerance)
    if rebinding_rate > 0.0:
        rest.weight[0, 0] = rebinding_rate / (rebinding_rate + rupture.at_rest)
    return rest


def steady(rupture: RuptureRate, rebinding_rate: float, speed: float, tolerance: float) -> Cohorts:
    """One population that has slid at ``speed`` [m/s], of any sign, for ever.

    Notes
    -----
    Bonds of age a are stretched by V a and number k_on F S(a) da, F = 1/(1 + k_on⟨T⟩), S the survival of a fresh
    bond and ⟨T⟩ its mean life: quadrature over the age, good to 1e-9 before it is merged within the tolerance.

    Examples
    --------
    At a speed that stretches a bond by its Bell force in its life at rest, one bond in four is missing:

    >>> bell = RuptureRate(rate=1.0, softness=1.0, limit=math.inf)
    >>> moving = steady(bell, rebinding_rate=1.0, speed=1.0, tolerance=1e-4)
    >>> print(f"{bound(moving)[0]:.3f} of {bound(steady(bell, 1.0, 0.0, 1e-4))[0]:.1f}")
    0.374 of 0.5
    """
    if rebinding_rate == 0.0 or speed == 0.0:
        return resting(rupture, rebinding_rate, tolerance)
    found = empty(rupture, tolerance)
    numbers = numbers_of(rupture, rebinding_rate, tolerance, math.inf)
    settle_steady(float(speed), numbers, found.weight, found.stretch, found.width, found.lattice)
    return found


def advance(
    cohorts: Cohorts,
    slip: Array,
    duration: Array,
    rupture: RuptureRate,
    rebinding_rate: float,
    tolerance: float,
    largest: float = math.inf,
    share: Array = _ALL,
) -> tuple[Cohorts, Array]:
    """The populations after steps of constant speed each.

    Parameters
    ----------
    cohorts : Cohorts
        Of one row or of as many as slips; one row and many slips give many rows.
    slip : array, shape (steps, 1) or (steps, rows)
        Slip of each row in each step [m], of any sign.
    duration : array, shape (steps,)
        Length of each step [s]; the speed in it is slip/duration.
    rupture : RuptureRate
        Rupture rate; the same one in all calls, as is the tolerance.
    rebinding_rate : float
        k_on of a free site [1/s], not negative.
    tolerance : float
        Relative error allowed in the number of bonds.
    largest : float
        Bound on the steps that a row makes by itself within a duration [s].
    share : array, shape (1,) or (rows,)
        Share of each row's bonds that is left before the first step [1]; the other sites are free.

    Returns
    -------
    cohorts : Cohorts
        Those at the end. A row depends, bit for bit, on its own state and slips alone.
    sums : array, shape (5, steps, rows)
        Their ``moments`` after each step.

    Notes
    -----
    Each row takes the whole duration at once where that is accurate and else steps of its own. In a step
    of length h the free sites solve F(t) = 1 − R(t) − ∫k_on F(s) S(t − s) ds with R and S, the survival of old and
    of fresh bonds, exact: two-stage Radau IIA collocation at h/3 and h (third order, and stable for any k_on h).
    What it gives as births are two new cohorts, so bonds and free sites add up to one. A step that nothing
    outlives ends in the steady state.
    """
    lengths = {slip.shape[1], len(cohorts.weight), len(share)}
    rows = max(lengths)
    if lengths - {1, rows}:
        raise ValueError(
            f"{slip.shape[1]} slips do not fit {len(cohorts.weight)} populations: give one of either, or as many"
        )
    before = cohorts.weight, cohorts.stretch, cohorts.width, cohorts.lattice
    after, sums = [np.zeros((rows, array.shape[1])) for array in before], np.empty((5, len(duration), rows))
    step_rows(*before, share, slip, duration, numbers_of(rupture, rebinding_rate, tolerance, largest), *after, sums)
    return Cohorts(*after), sums


def bound(cohorts: Cohorts) -> Array:
    """Share of the sites that is bound [1], shape (rows,)."""
    return np.sum(cohorts.weight, axis=1)


def moments(cohorts: Cohorts, rupture: RuptureRate, tolerance: float) -> Array:
    """Sums over the cohorts per site, shape (5, rows).

    Share of the sites bound [1]; stretch [m], the sum of w x; square stretch [m^2], that within the width of a cohort
    included; density of the stretch at the rupture's limit times that limit [1], ℓ ρ(ℓ), 0 without a limit; stretch
    that thermal rupture takes in unit time [m/s], the sum of w x k(|x|). The density is the mean over the outermost of
    the cells that are merged, which is what the tolerance resolves.
    """
    found = np.empty((5, len(cohorts.weight)))
    sum_rows(cohorts.weight, cohorts.stretch, cohorts.width, numbers_of(rupture, 0.0, tolerance, math.inf), found)
    return found


def _check(rupture: RuptureRate, tolerance: float) -> None:
    if not 1e-12 <= tolerance <= 0.1:
        raise ValueError(f"a tolerance of {tolerance:g} is out of range: give 1e-12 to 0.1")
    if rupture.limit < math.inf and rupture.steepness != 0.0:
        raise ValueError("a rupture that grows with the stretch and ends at a limit is not built: leave out one")


def _most(rupture: RuptureRate, tolerance: float) -> int:
    """Cohorts left by merging, at most."""
    if rupture.limit < math.inf:
        return int(min(4096.0, 2.2 / math.sqrt(tolerance) + 64.0))
    if rupture.steepness == 0.0:
        return 8
    cell = (432.0 * tolerance) ** 0.25
    return int(min(4096.0, 40.0 / cell + 2.0 * math.sqrt(10.0 / (_KINK * tolerance)) + 16.0))


_KINK = 66.0


@functools.lru_cache(maxsize=256)
def numbers_of(rupture: RuptureRate, rebinding_rate: float, tolerance: float, largest: float) -> Array:
    """``Rules`` as an array.

    A two-point Gauss rule over a cell of width d errs by d⁴/4320 of the cell's bonds, a uniform segment
    by d²/8 of them. A cell that contains zero averages a rupture with a kink and errs by 0.015 of its
    width times its share at most.
    """
    cell, most = _cell(rupture, tolerance), _most(rupture, tolerance)
    heavy = _KINK * tolerance
    own = rupture.limit, rupture.steepness, rebinding_rate, tolerance, largest, cell, heavy, most
    return np.array([*own, *rupture], dtype=float)


def _cell(rupture: RuptureRate, tolerance: float) -> float:
    """Width of the cells within which cohorts are merged [m]."""
    if rupture.limit < math.inf:
        return rupture.limit * max(math.sqrt(tolerance), 1.0 / 1800.0)
    return (432.0 * tolerance) ** 0.25 / rupture.steepness if rupture.steepness > 0.0 else math.inf
