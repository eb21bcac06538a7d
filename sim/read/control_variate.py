"""Means over the members with the known mean of ΔΓ as a control variate.

The energy ΔΓ of a field that does not feel the friction is a sum of gamma numbers, so its mean and its variance are
known in closed form. A sample of members has another mean of ΔΓ by chance. Contact area, radius, friction and lost area
follow ΔΓ, so their sample means are off together with it. A regression over the members on ΔΓ shows by how much, and
the corrected mean is that at the known mean of ΔΓ (Lavenberg & Welch, Manage. Sci. 27 (1981) 322).

A dataset has the known numbers only where they are the true ones: at a prescribed motion, and with an amplitude that
depends on the moment alone. Behind a spring the slip, and thus the renewal of the field, depends on the friction.
"""

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import xarray as xr
from scipy import special

from sim.read.correlation import Array
from sim.read.dataset import MEMBERS, STATISTIC

#: Fewest members whose regression has a useful error.
FEWEST = 8
#: Standard deviations above its mean up to which ΔΓ must leave adhesion. More than one in a hundred contacts may be
#: masked else (a single gamma number of shape 1 is larger with the probability e^−5), and masking bends the response.
_REACH = 4.0
#: Trajectories that are needed beside the values.
SOURCES = (
    "fluctuation_energy",
    "expected_energy",
    "in_contact",
    "work_of_adhesion",
)
_NAMES = ("contact_area", "contact_radius", "area_ratio", "friction_force")
#: Chance with which the square of ΔΓ is used in a response without curvature.
_FALSE_ALARM = 0.01
#: Bound of the standard deviation of a squared deviation of ΔΓ over its variance: √(2 + excess), and the excess
#: kurtosis of a sum of gamma numbers of shape 1 or more is at most 6.
_SQUARED_SPREAD = math.sqrt(8.0)


class Corrected(NamedTuple):
    """Means over members at the known mean of ΔΓ; each an array without the axis of the members.

    Attributes
    ----------
    mean, sem : array
        Mean and its standard error, nan where the regressor does not vary.
    freedom : array
        Degrees of freedom of the standard error.
    bias : array
        Bound of the bias of the mean, which falls as 1/members.
    """

    mean: Array
    sem: Array
    freedom: Array
    bias: Array


def corrected(values: Array, deviation: Array, square: Array) -> Corrected:
    """Return means over the last axis, corrected by regressors whose true mean is zero.

    Parameters
    ----------
    values : array, shape (..., members)
        An observable of each member.
    deviation, square : array, shape (..., members)
        ΔΓ/⟨ΔΓ⟩ − 1, and its square less the known variance of ΔΓ/⟨ΔΓ⟩; or the means over time of both.

    Notes
    -----
    With the regressor z of sample mean z̄ the corrected mean is ȳ − b z̄. Its variance is s² (1/n + z̄²/Σ(z − z̄)²) with
    the residual variance s² of n − 2 degrees of freedom; the second term is the *leverage*, the cost of an estimated
    slope. The square is a further regressor if its coefficient differs from zero at a level of 1 %. Then the residual
    is no noise but a function of ΔΓ, of which the sample shows little. So the change of the mean by the square is added
    to the error: intervals are then wider than nominal.

    The bias of the linear correction is −Cov(z², e)/(n Var z) for the residual e, to leading order in 1/n. By the
    inequality of Cauchy and Schwarz it is at most s √(2 + excess kurtosis)/(n − 3) [1], and the excess is at most 6.

    Examples
    --------
    A response that is linear in ΔΓ has its exact mean, whatever the sample:

    >>> energy = np.random.default_rng(1).gamma(25.0, 1.0 / 25.0, 16)
    >>> off = energy - 1.0
    >>> result = corrected(3.0 - 2.0 * energy, off, off**2 - 1.0 / 25.0)
    >>> print(f"{float(result.mean):.12f}", bool(result.sem < 1e-12))
    1.000000000000 True
    """
    count = values.shape[-1]
    mean, first, second = (
        each.mean(axis=-1, keepdims=True) for each in (values, deviation, square)
    )
    y, z, q = values - mean, deviation - first, square - second
    # nan is the answer where a regressor does not vary
    with np.errstate(invalid="ignore", divide="ignore"):
        along = _dot(z, z)
        y, at_zero = y - _dot(z, y) / along * z, mean - _dot(z, y) / along * first
        share = _dot(z, q) / along
        q, beyond = q - share * z, second - share * first
        curvature = _dot(q, y) / _dot(q, q)
        leverage = 1.0 / count + first**2 / along
        residual = y - curvature * q
        of_line, of_both = (
            _dot(y, y) / (count - 2),
            _dot(residual, residual) / (count - 3),
        )
        change = curvature * beyond
        critical = special.stdtrit(count - 3, 1.0 - 0.5 * _FALSE_ALARM)
        bends = curvature**2 * _dot(q, q) > critical**2 * of_both
        variance = np.where(
            bends,
            of_both * (leverage + beyond**2 / _dot(q, q)) + change**2,
            of_line * leverage,
        )
    numbers = (
        at_zero - np.where(bends, change, 0.0),
        np.sqrt(variance),
        np.where(bends, count - 3.0, count - 2.0),
        np.sqrt(of_line) * _SQUARED_SPREAD / (count - 3),
    )
    return Corrected(*(number[..., 0] for number in numbers))


def _dot(first: Array, second: Array) -> Array:
    return np.sum(first * second, axis=-1, keepdims=True)


class ControlVariate(NamedTuple):
    """The regressors of a dataset, per member and time, and the points and times at which they are used."""

    deviation: xr.DataArray
    square: xr.DataArray
    is_used: xr.DataArray

    def late(self) -> "ControlVariate":
        """Return the means over time, used where all times are."""
        return ControlVariate(
            self.deviation.mean("t"), self.square.mean("t"), self.is_used.all("t")
        )


def is_corrected(name: str) -> bool:
    """Return True for an observable whose mean the control variate corrects."""
    return name in _NAMES or name.startswith("lost_to")


def sources(names: Collection[str]) -> tuple[str, ...]:
    """Return the trajectories that are needed to correct observables."""
    return SOURCES if any(map(is_corrected, names)) else ()


def control_variate(dataset: xr.Dataset) -> ControlVariate | None:
    """Return the control variate of a dataset; None if its field has no known mean, or members are not recorded.

    It is used where ΔΓ varies, no member is open, and a contact whose ΔΓ is four standard deviations above its mean
    still has adhesion. The last condition follows from the known law, because a choice by the masked members of the
    sample would select samples and so bias the mean.
    """
    if not {*SOURCES, "energy_variation"} <= {*dataset.variables}:
        return None
    recorded = dataset["fluctuation_energy"]
    if STATISTIC in recorded.dims or dataset.sizes.get(MEMBERS, 1) < FEWEST:
        return None
    if MEMBERS not in recorded.dims:
        return None
    energy, variance = (
        recorded.astype(float, copy=False),
        dataset["energy_variation"] ** 2,
    )
    expected = dataset["expected_energy"]
    deviation = energy / expected.where(expected > 0.0) - 1.0

    def average(values: xr.DataArray) -> xr.DataArray:
        return values.mean(MEMBERS) if MEMBERS in values.dims else values

    work, mean = dataset["work_of_adhesion"].astype(float), average(deviation)
    off = deviation - mean
    slope = average(off * work) / average(off**2)
    beyond = average(work) + slope * (_REACH * variance**0.5 - mean)
    is_used = (
        (average(dataset["in_contact"].astype(float)) == 1.0)
        & (beyond > 0.0)
        & (variance > 0.0)
        & deviation.notnull().all(MEMBERS)
    )
    return ControlVariate(deviation, deviation**2 - variance, is_used)
