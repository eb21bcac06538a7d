"""Delay of the bonds along a course of the speed, because they have one speed during a clock step."""

import contextlib
import math
from typing import NamedTuple

import numpy as np
import xarray as xr

from sim.numerics.delay import delay_by_steps
from sim.read.dataset import MEMBERS, ensemble_mean, resolved, setting, word

#: Relaxation rate times half a clock step from which on bonds have forgotten the step before.
_FORGOTTEN = 10.0
#: Models of bonds without a memory, and those whose bonds relax exponentially.
_AT_ONCE, _EXPONENTIAL = ("none", "steady"), ("rate", "counted")


class Delay(NamedTuple):
    """Delay of bonds by the clock step, and by how much it may be off [s]."""

    time: xr.DataArray
    bound: xr.DataArray


def of_maxima(dataset: xr.Dataset, when: xr.DataArray, change: xr.DataArray) -> Delay:
    """Return by how much the clock step delays a maximum that is found at a time [s].

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    when : xarray.DataArray
        The time.
    change : xarray.DataArray
        Relative change of the speed in a second.

    Notes
    -----
    During a clock step dt bonds have the mean speed of the step, which is that at its
    middle, but time and speed of a sample are those at its end. Bonds without a memory
    are therefore found dt/2 late, and bonds that relax exponentially at a rate k by less
    (``sim.numerics.delay.delay_by_steps``). The rate k is that of rebinding over the
    share of bonds that is left, as in a rate equation.

    Two errors remain. In other models k may differ by a factor, which changes the delay
    by about 1/k. The maximum between samples is that of a parabola, whose vertex is off
    by dt² f'''/(6 f''). Over the logarithm of the speed the third derivative of the stress
    is at most about three times the second, and a linear ramp adds three. With the
    relative change h of the speed in a step the vertex is therefore off by at most h dt.
    Bonds that remember a step (k dt/2 < 10) are sought by their slopes at the speed of the
    samples, and their maximum is only known to a step.
    """
    step, rate = setting(dataset, "clock.step"), _relaxation(dataset, when)
    bound = step * step * change + 1.0 / rate
    forget = 0.5 * rate * step >= _FORGOTTEN
    late = xr.apply_ufunc(delay_by_steps, step, rate)
    return Delay(late, bound.where(forget, step))


def of_course(dataset: xr.Dataset, change: xr.DataArray) -> Delay:
    """Return by how much the clock step delays the contact along a course of the speed.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.
    change : xarray.DataArray
        Relative change of the speed in a second, over time.

    Notes
    -----
    See ``of_maxima``. Bonds that the speed sets at once have that at the end of the step:
    no delay. Behind a spring there is none either, because the motion is solved within
    the step. If the area depends on bonds that relax exponentially and on nothing else
    that changes, their delay is known to the second order of the change h of the speed in
    a step. Any other memory that only fades, such as that of bonds with a stretch or of an
    amplitude that relaxes, delays by 0 to dt/2, and what has no memory beside it not at
    all.
    """
    step = setting(dataset, "clock.step")
    bonds = word(dataset, "bonds.model", "none")
    remembers, fluctuates = ~bonds.isin(_AT_ONCE), _fluctuates(dataset)
    # models of the same name whose bonds stretch have no critical speed
    decays = bonds.isin(_EXPONENTIAL) & ("bonds_critical_speed" in dataset)
    is_late = remembers | (fluctuates & _relaxes(dataset))
    is_late = is_late & (word(dataset, "drive.model", "") != "spring")
    half = 0.5 * step
    late = xr.apply_ufunc(delay_by_steps, step, _relaxation(dataset, dataset["t"]))
    late = late.where(remembers, 0.0)
    bound = xr.where(decays & ~fluctuates, 0.0, np.maximum(late, half - late))
    bound = bound + step * step * change
    return Delay(late.where(is_late, 0.0), bound.where(is_late, 0.0))


def _relaxes(dataset: xr.Dataset) -> bool:
    """Return True if the amplitude of the fluctuations relaxes, or may do so at some points of a sweep."""
    try:
        return bool(resolved(dataset, "shear.amplitude").get("relaxing"))
    except KeyError:
        return True


def _fluctuates(dataset: xr.Dataset) -> xr.DataArray:
    """Return True where adhesion pays for fluctuations of the shear stress."""
    with contextlib.suppress(KeyError):
        return setting(dataset, "shear.paid_by_adhesion") > 0.0
    return xr.DataArray(False)


def _relaxation(dataset: xr.Dataset, when: xr.DataArray) -> xr.DataArray:
    """Return the relaxation rate of the bonds at a time [1/s], infinite if it is not known."""
    rate = xr.DataArray(math.inf)
    with contextlib.suppress(KeyError):
        rate = setting(dataset, "bonds.rebinding_rate")
        with contextlib.suppress(KeyError):
            rate = setting(dataset, "bonds.rebinding_rate_at_temperature")
        if "bond_fraction" in dataset:
            left = ensemble_mean(dataset["bond_fraction"])
            left = left.mean(MEMBERS) if MEMBERS in left.dims else left
            at = when.fillna(0.0)
            rate = rate / left.sel(t=at, method="nearest").drop_vars("t")
    return rate
