"""Bell bonds loaded once, at a constant rate, until they break: rupture forces and the static peak.

Evans & Ritchie (1997) for the forces. A population at rest that suddenly slides is many such bonds
loaded together, as long as sites do not rebind.
"""

import math
from typing import NamedTuple

from sim.laws.schallamach.first_moment import steady_tilt
from sim.laws.schallamach.renewal import Array
from sim.numerics.jit import device, law
from sim.numerics.special import reduced


class StartUpPeak(NamedTuple):
    """The static peak: when it comes [s] and the force per bond [N]."""

    time: Array
    force: Array


@device
def _growth(tilt):
    """(e^x - 1)/x for x >= 0."""
    return math.expm1(tilt) / tilt if tilt > 0.0 else 1.0


@law
def bell_rupture_force(loading_rate, zero_force_rate, bell_force):
    """Mean force at which a Bell bond breaks under a force that grows at a constant rate [N].

    Parameters
    ----------
    loading_rate : float or array
        r [N/s]; kappa V for a bond that slides. Odd in r.
    zero_force_rate, bell_force : float or array
        k_0 [1/s], f_b [N], both above 0.

    Notes
    -----
    ``f_b e^z E1(z)`` with ``z = k_0 f_b/r``: r/k_0 where the bond opens by itself, ``f_b (ln(1/z) - 0.577)``
    where it is torn off.

    Examples
    --------
    A decade of the loading rate adds ln 10 = 2.303 Bell forces:

    >>> print("%.4f %.4f" % tuple(bell_rupture_force([1e3, 1e4], 1.0, 1.0)))
    6.3379 8.6341
    """
    if loading_rate == 0.0:
        return 0.0
    z = zero_force_rate * bell_force / math.fabs(loading_rate)
    life = reduced(z, 0)
    if z >= 1.0:
        return loading_rate / zero_force_rate * life
    return math.copysign(bell_force * life / z, loading_rate) if z > 0.0 else loading_rate


@law
def bell_rupture_force_density(force, loading_rate, zero_force_rate, bell_force):
    """Probability density of the force at which a Bell bond breaks [1/N].

    Parameters
    ----------
    force : float or array
        f [N]; no bond breaks at a force below 0.
    loading_rate, zero_force_rate, bell_force : float or array
        r [N/s], k_0 [1/s], f_b [N], all above 0.

    Notes
    -----
    ``(k_0/r) exp(f/f_b - z (e^(f/f_b) - 1))`` with ``z = k_0 f_b/r``. It peaks at ``f_b ln(1/z)`` for z below
    1 and at 0 otherwise.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(bell_rupture_force_density([0.0, 1.0], 2.0, 1.0, 1.0)))
    0.5000 0.5756
    """
    if force < 0.0 or force == math.inf:
        return 0.0
    tilt = force / bell_force
    rate = zero_force_rate / loading_rate
    return rate * math.exp(tilt - rate * force * _growth(tilt))


@law
def start_up_force(time, speed, zero_force_rate, bell_force, bond_stiffness):
    """Mean force of bonds that were all unstretched when sliding began, none of which rebinds.

    Parameters
    ----------
    time : float or array
        t [s] since sliding began, at least 0.
    speed : float or array
        V [m/s] since then, either sign.
    zero_force_rate, bell_force, bond_stiffness : float or array
        k_0 [1/s], above 0; f_b [N], above 0; kappa [N/m].

    Returns
    -------
    float or array
        Force per bond of the start, broken ones counted with 0 [N]; odd in the speed.

    Notes
    -----
    ``kappa V t exp(-z (e^(k_0 t/z) - 1))`` with ``z = k_0 f_b/(kappa \\|V\\|)``.

    Examples
    --------
    >>> peak = start_up_peak(100.0, 1.0, 1.0, 1.0)
    >>> print("%.4f %.4f %.4f" % tuple(start_up_force([0.02, peak.time, 0.05], 100.0, 1.0, 1.0, 1.0)))
    1.8762 2.5451 1.1449
    """
    pull = bond_stiffness * speed * time
    alive = math.exp(-zero_force_rate * time * _growth(math.fabs(pull) / bell_force))
    return pull * alive if alive > 0.0 else 0.0


@law
def _peak_time(speed, zero_force_rate, bell_force, bond_stiffness):
    return math.exp(-steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness)) / zero_force_rate


@law
def _peak_force(speed, zero_force_rate, bell_force, bond_stiffness):
    tilt = steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness)
    lost = math.expm1(-tilt) / tilt if tilt > 0.0 else -1.0
    if tilt > 1.0:
        return math.copysign(bell_force * tilt * math.exp(lost), speed)
    return bond_stiffness * speed / zero_force_rate * math.exp(lost - tilt)


def start_up_peak(speed, zero_force_rate, bell_force, bond_stiffness):
    """Static peak: the largest force of bonds that were unstretched when sliding began, none of which rebinds.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness : float or array
        As in ``start_up_force``.

    Returns
    -------
    StartUpPeak
        Time of the peak [s] and force per bond of the start [N]: 1/k_0 and 0 at speed 0; grows like the
        logarithm of the speed.

    Notes
    -----
    At ``t = W(eps)/(eps k_0)`` with eps = kappa \\|V\\|/(k_0 f_b) and Lambert's W, the force is
    ``f_b W exp(1/eps - 1/W)``. The difference in the exponent is ``(e^-W - 1)/W``, which does not cancel. A
    population with a share phi_rest of its sites bound has phi_rest times this force per site.

    Examples
    --------
    A hundred times the speed adds less than ln 100 = 4.6 Bell forces:

    >>> print("%.4f %.4f" % tuple(start_up_peak([1e2, 1e4], 1.0, 1.0, 1.0).force))
    2.5451 6.2985
    """
    given = (speed, zero_force_rate, bell_force, bond_stiffness)
    return StartUpPeak(_peak_time(*given), _peak_force(*given))
