"""Delay of what relaxes because its cause is constant during a clock step."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def delay_by_steps(step: ArrayLike, rate: ArrayLike) -> NDArray[np.float64]:
    """Return the delay of an exponential relaxation because its cause is constant during a clock step.

    Parameters
    ----------
    step : float or array
        Clock step dt [s], above 0. During a step the cause has its value at the middle of the step.
    rate : float or array
        Rate k of the relaxation [1/s], above 0, also infinite.

    Returns
    -------
    array
        ``L(x) dt/2`` [s] with ``x = k dt/2`` and Langevin's function ``L(x) = coth(x) - 1/x``.

    Notes
    -----
    What relaxes at a rate k follows a cause that changes linearly in time with a delay of 1/k. With one value of the
    cause in each step it has, at the end of a step, the delay ``sum over j of (j + 1/2) dt (1 - exp(-k dt)) exp(-j k
    dt) = dt/2 coth(x)``. The difference goes from k dt²/12 of short steps to dt/2 of long ones.

    Examples
    --------
    >>> print(delay_by_steps(1.0, [1e-6, 2.0, np.inf]).round(6))
    [0.       0.156518 0.5     ]
    """
    half = 0.5 * np.multiply(rate, step)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        langevin = 1.0 / np.tanh(half) - 1.0 / half
    # of short steps the difference cancels, and the next term of the series is below 1e-7
    return np.asarray(
        0.5 * np.asarray(step) * np.where(half > 1e-3, langevin, half / 3.0)
    )
