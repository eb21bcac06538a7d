"""Linear law of the bond fraction: steady sliding, rate equation and its exact step.

The bond fraction phi is the number of bonds over the number of bonds *at rest*. The law of Menga,
Carbone & Dini (MCD, after Schallamach 1963) is ``phi = 1/(1 + |V|/Vc)``. It is not a general result:
it is exact only for bonds that never open by themselves and break at a fixed stretch l, while open
sites close at a rate h, so that ``Vc = h l``. Each bond then lives for the time l/|V| and each site
waits 1/h for the next. The friction of that very model, ``(kappa l N0/2)/(1 + |V|/Vc)`` for bonds of
stiffness kappa, falls with speed and has no maximum: a maximum needs thermally activated rupture.

Replacing the fixed life by a constant rupture rate |V|/l of the same mean gives the linear rate equation

    ``dphi/dt = h (1 - phi) - h (|V|/Vc) phi``

with the same steady state. Its coefficients depend on time through the speed alone, so one step of
any length at a mean speed is exact, for the mean and for the probabilities of a single site.
"""

import math

import numpy as np

from sim.laws.schallamach.stability import Onset
from sim.numerics.jit import device, law


@law
def steady_fraction(speed, critical_speed):
    """Bond fraction in steady sliding.

    Parameters
    ----------
    speed : float or array
        V [m/s], either sign.
    critical_speed : float or array
        Vc [m/s], above 0: the speed at which half of the bonds are left.

    Returns
    -------
    float or array
        ``phi = 1/(1 + |V|/Vc)`` [1]: 1 at rest, 0 at infinite speed.

    Examples
    --------
    At a tenth of the critical speed nine bonds of ten are left, as MCD note for 1 mm/s:

    >>> print("%.3f %.3f" % tuple(steady_fraction([1e-3, 1e-2], 1e-2)))
    0.909 0.500
    """
    return 1.0 / (1.0 + math.fabs(speed) / critical_speed)


def linear_onset(speed, critical_speed, rebinding_rate, strength, damping, mass=0.0, area_growth=0.0):
    """Stiffness of a spring below which a slider on bonds of the linear rate equation oscillates at a speed.

    Parameters
    ----------
    speed, critical_speed, rebinding_rate : float or array
        V [m/s], either sign; Vc [m/s], above 0; h [1/s].
    strength : float or array
        F_s, the friction with all bonds of rest bound over the area at this speed [N].
    damping, mass : float or array
        c [N s/m] and m [kg] of the body; one of them above 0.
    area_growth : float or array
        d ln A/d ln phi of a contact whose area follows the bonds [1].

    Returns
    -------
    Onset
        Stiffness [N/m], infinite for a mass that nothing damps, and frequency [rad/s]; nan where every spring holds.

    Notes
    -----
    With ``H = h (1 + V/Vc)`` and ``B = (1 + s) F_s h phi/Vc``, s the growth of the area,

        ``K_c = (c + m H) (B - c H)/c``,  ``omega^2 = K_c H/(c + m H) = H (B - c H)/c``.

    Examples
    --------
    >>> print("%.4f %.4f" % linear_onset(1.0, 0.5, 2.0, 1.0, 0.05, 0.01))
    2.2733 11.1355
    """
    pace = rebinding_rate * (1.0 + np.abs(speed) / critical_speed)
    falls = (1.0 + area_growth) * strength * rebinding_rate / critical_speed * steady_fraction(speed, critical_speed)
    with np.errstate(divide="ignore"):
        over = np.divide(falls - damping * pace, damping)
    over = np.where(over > 0.0, over, np.nan)
    return Onset(((damping + mass * pace) * over)[()], np.sqrt(pace * over)[()])


@law
def fraction_rate(fraction, speed, critical_speed, rebinding_rate):
    """Time derivative of the bond fraction [1/s].

    Parameters
    ----------
    fraction, speed, critical_speed, rebinding_rate : float or array
        phi [1], V [m/s], Vc [m/s], h [1/s].

    Notes
    -----
    ``h (1 - phi) - h (|V|/Vc) phi``.

    Examples
    --------
    >>> print(f"{fraction_rate(0.5, 1e-2, 1e-2, 200.0):.1f} {fraction_rate(1.0, 1e-2, 1e-2, 200.0):.1f}")
    0.0 -200.0
    """
    return rebinding_rate * (1.0 - fraction) - rebinding_rate * (math.fabs(speed) / critical_speed) * fraction


@law
def relax_fraction(fraction, path, duration, critical_speed, rebinding_rate):
    """Bond fraction after a step: the exact solution of the linear rate equation.

    Parameters
    ----------
    fraction : float or array
        phi at the start of the step [1].
    path : float or array
        Distance slid in the step, integral of |V| dt [m], at least 0.
    duration : float or array
        Length of the step [s], at least 0.
    critical_speed : float or array
        Vc [m/s], above 0.
    rebinding_rate : float or array
        h [1/s], at least 0.

    Returns
    -------
    float or array
        phi at the end [1]. A step of no duration and no path changes nothing; a jump by a path in no
        time leaves ``exp(-h path/Vc)`` of the bonds.

    Notes
    -----
    At the constant speed path/duration: ``phi' = phi e^-z + phi_inf (1 - e^-z)`` with ``z = h
    (duration + path/Vc)`` and ``phi_inf = duration/(duration + path/Vc)``. Both terms are positive
    and 1 - e^-z is taken by expm1, so nothing cancels for any z.

    Examples
    --------
    One step and two halves of it agree; a long step ends in the steady state:

    >>> once = relax_fraction(1.0, 2e-5, 2e-3, 1e-2, 200.0)
    >>> half = relax_fraction(1.0, 1e-5, 1e-3, 1e-2, 200.0)
    >>> twice = relax_fraction(half, 1e-5, 1e-3, 1e-2, 200.0)
    >>> print(f"{once:.6f} {twice:.6f} {relax_fraction(1.0, 1.0, 100.0, 1e-2, 200.0):.6f}")
    0.724664 0.724664 0.500000
    """
    return relaxed(fraction, path, duration, critical_speed, rebinding_rate)


@device
def relaxed(fraction, path, duration, critical_speed, rebinding_rate):
    """Body of ``relax_fraction``, for compiled loops."""
    total = duration + path / critical_speed
    if total == 0.0:
        return fraction
    z = rebinding_rate * total
    return fraction * math.exp(-z) - duration / total * math.expm1(-z)


def transition_probabilities(path, duration, critical_speed, rebinding_rate):
    """Transition probabilities of one site over a step, with rates h to close and h |V|/Vc to open.

    Parameters
    ----------
    path, duration, critical_speed, rebinding_rate : float or array
        Integral of |V| dt [m], length of the step [s], Vc [m/s], h [1/s].

    Returns
    -------
    stay_bound, become_bound : float or array
        Probability that a site is bound at the end of the step if it was bound, or open, at its
        start [1]. The site may have opened and closed any number of times in between.

    Notes
    -----
    A single site's probability of being bound obeys the rate equation of the fraction, so both are
    ``relax_fraction`` from 1 and from 0. Numbers of bound sites drawn binomially with them have the
    exact distribution of the two-state process for any step.

    Examples
    --------
    After a long time the start no longer matters:

    >>> print("%.3f %.3f" % transition_probabilities(1e-2, 1.0, 1e-2, 200.0))
    0.500 0.500
    """
    stay_bound = relax_fraction(1.0, path, duration, critical_speed, rebinding_rate)
    become_bound = relax_fraction(0.0, path, duration, critical_speed, rebinding_rate)
    return stay_bound, become_bound
