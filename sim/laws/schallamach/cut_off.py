"""Bonds that open at a constant rate and all break at a stretch l (after Chernyak & Leonov 1986).

A bond lives until l/|V| at the longest. Without the rate, ``k_0 = 0``, lives are all equal and the
fraction is the law of Menga, Carbone & Dini, ``1/(1 + |V|/Vc)`` with ``Vc = l k_on``; its friction then is
largest at the slightest speed, and anything between plus and minus that value at rest.
"""

import math

import numpy as np

from sim.laws.schallamach.renewal import SiteMoments
from sim.numerics.jit import device, law

#: Where the moments pass from the series in a = k_0 l/|V| to the closed form: neither cancels there.
_SWITCH = 3.0


@device
def _slow(a, power):
    """``int_0^a x^n e^-x dx`` of a above the switch."""
    rest = math.exp(-a)
    total, lost = 1.0 - rest, rest
    for n in range(1, power + 1):
        lost *= a
        total = n * total - lost
    return total


@device
def _fast(a, power):
    """``int_0^1 y^n e^(-a y) dy`` of a below the switch; all terms are positive."""
    term = 1.0 / (power + 1)
    total = term
    for n in range(power + 2, power + 36):
        term *= a / n
        total += term
    return math.exp(-a) * total


@law
def _site(speed, rate, stretch, bond_stiffness, rebinding_rate, power):
    """Mean of (force)^n per site, force taken positive: ``(kappa V)^n int t^n S dt / (<T> + 1/k_on)``."""
    n = int(power)
    wait = 1.0 / rebinding_rate
    longest = stretch / math.fabs(speed)
    a = min(rate * longest, 1e4) if rate > 0.0 else 0.0  # e^-1e4 is 0
    if a > _SWITCH:  # in units of k_0
        pull = bond_stiffness * math.fabs(speed) / rate
        return pull**n * _slow(a, n) / (_slow(a, 0) + rate * wait)
    return (bond_stiffness * stretch) ** n * _fast(a, n) / (_fast(a, 0) + wait / longest)


def cut_off_moments(speed, rate, stretch, bond_stiffness, rebinding_rate):
    """Bound share and force moments of bonds that break at a stretch, in steady sliding.

    Parameters
    ----------
    speed : float or array
        V [m/s], either sign.
    rate : float or array
        k_0 = 1/t_0 [1/s], at least 0: rupture rate below the stretch.
    stretch : float or array
        l [m], above 0: stretch at which a bond breaks.
    bond_stiffness, rebinding_rate : float or array
        kappa [N/m]; k_on [1/s], above 0.

    Returns
    -------
    SiteMoments
        Share of the sites that is bound [1], mean force [N] and mean square force [N^2] per site. At
        rest with ``rate`` 0 the force is any between -kappa l/2 and kappa l/2 (0 is returned) and its
        square the limit of small speeds, (kappa l)^2/3.

    Notes
    -----
    Lives of survival ``e^(-k_0 t)`` up to t = l/\\|V\\| in ``renewal``. With ``u = V/(k_0 l)`` and
    ``m = k_0/k_on``: ``force = kappa l u (1 - (1 + 1/u) e^(-1/u))/(1 + m - e^(-1/u))``.

    Examples
    --------
    The friction maximum at m = 1:

    >>> bound, force, _ = cut_off_moments(0.730401, 1.0, 1.0, 1.0, 1.0)
    >>> print(f"{bound:.4f} {force:.6f}")
    0.4272 0.166299
    """
    given = (speed, rate, stretch, bond_stiffness, rebinding_rate)
    bound, size, square = (_site(*given, power) for power in range(3))
    return SiteMoments(bound, np.sign(speed) * size, square)


@law
def cut_off_fraction(speed, rate, stretch, rebinding_rate):
    """Bond fraction of bonds that break at a stretch, in steady sliding: bonds over bonds at rest [1].

    Parameters
    ----------
    speed, rate, stretch, rebinding_rate : float or array
        As in ``cut_off_moments``.

    Returns
    -------
    float or array
        1 at rest, 0 at infinite speed; ``1/(1 + |V|/(l k_on))`` where ``rate``
        is 0.

    Examples
    --------
    Bonds that open by themselves, too, lose a smaller share by sliding:

    >>> print("%.3f %.3f" % tuple(cut_off_fraction(1.0, [0.0, 1.0], 1.0, 1.0)))
    0.500 0.775
    """
    if rebinding_rate == math.inf:
        return 1.0
    longest = stretch / math.fabs(speed)
    a = min(rate * longest, 1e4) if rate > 0.0 else 0.0
    if a > _SWITCH:
        life = _slow(a, 0)
        return life * (rebinding_rate + rate) / (rebinding_rate * life + rate)
    life = _fast(a, 0)
    return life * (rebinding_rate + rate) / (rebinding_rate * life + 1.0 / longest)


def cut_off_stress(speed, rate, stretch, bond_stiffness, rebinding_rate, site_density):
    """Shear stress of bonds that break at a stretch, in steady sliding [Pa].

    Parameters
    ----------
    speed, rate, stretch, bond_stiffness, rebinding_rate : float or array
        As in ``cut_off_moments``.
    site_density : float or array
        n [1/m^2]: sites, bound or not, per area.

    Notes
    -----
    ``n`` times the mean force per site; odd in the speed. Without the rate: ``(n kappa l/2)/(1 + V/(l k_on))``,
    which falls with speed from the first.

    Examples
    --------
    >>> print("%.3f %.3f" % tuple(cut_off_stress([1e-6, 1.0], 0.0, 1.0, 1.0, 1.0, 1.0)))
    0.500 0.250
    """
    given = (speed, rate, stretch, bond_stiffness, rebinding_rate)
    return np.multiply(site_density, np.sign(speed) * _site(*given, 1))
