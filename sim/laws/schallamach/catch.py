"""Catch bonds: two pathways of rupture, one that force slows down and one that it speeds up.

The rate is ``k = catch_rate e^(-f/catch_force) + slip_rate e^(f/slip_force)`` (the two-pathway model of Pereverzev
and others, Biophys. J. 89, 2005): a bond lives longest under some force. There is no closed form of its life in
steady pulling; the renewal integrals are done by quadrature.
"""

import numpy as np
from numpy.typing import ArrayLike

from sim.laws.schallamach.renewal import Array, Lives, SiteMoments, renewal

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
#: ∫k dt at which lives are cut: e^-60 are left.
_END = 60.0


def catch_lives(
    speed: ArrayLike, catch_rate: float, catch_force: float, slip_rate: float, slip_force: float, bond_stiffness: float
) -> Lives:
    """Moments of the life of a catch bond that is pulled at constant speed.

    Parameters
    ----------
    speed : float or array
        V [m/s], either sign.
    catch_rate, slip_rate : float
        Rates of the two pathways at no force [1/s]; the second above 0.
    catch_force, slip_force : float
        Forces that divide the first rate and multiply the second by e [N].
    bond_stiffness : float
        kappa [N/m].

    Returns
    -------
    Lives
        ``<T>`` [s], ``<T^2>/2`` [s^2] and ``<T^3>/3`` [s^3], to 1e-12.

    Notes
    -----
    ``<T^n>/n = ∫ t^(n-1) S dt`` with the survival ``S = exp(-k_c t E(-a t) - k_s t E(b t))``,
    ``E(z) = (e^z - 1)/z``, a and b the rates ``kappa V/catch_force`` and ``kappa V/slip_force``: Gauss's rule on panels
    that are short beside the age and beside the whole.

    Examples
    --------
    Pulled slowly a bond breaks before it feels a force, pulled faster force holds it, and too fast breaks it:

    >>> slow, held, fast = catch_lives([1e-3, 1.0, 30.0], 1.0, 1.0, 1e-3, 1.0, 1.0).mean
    >>> print(f"{slow:.2f} {held:.2f} {fast:.2f}")
    1.00 2.81 0.31
    """
    pace = bond_stiffness * np.abs(np.asarray(speed, float))[..., np.newaxis]
    easing, growing = pace / catch_force, pace / slip_force
    longest = _slip_time(_END, slip_rate, growing)
    shortest = 1e-3 / (catch_rate + slip_rate + easing + growing)
    share = np.linspace(0.0, 1.0, 193)
    edges = np.sort(np.concatenate([longest * share, shortest * (longest / shortest) ** share], axis=-1), axis=-1)
    half = 0.5 * np.diff(edges, axis=-1)[..., np.newaxis]
    age = edges[..., :-1, np.newaxis] + half * (_NODES + 1.0)
    lost = catch_rate * age * _mean_exponential(-easing[..., np.newaxis] * age)
    lost += slip_rate * age * _mean_exponential(growing[..., np.newaxis] * age)
    alive = half * _WEIGHTS * np.exp(-lost)
    return Lives(*(np.sum(age**n * alive, axis=(-2, -1)) for n in range(3)))


def catch_moments(
    speed: ArrayLike,
    catch_rate: float,
    catch_force: float,
    slip_rate: float,
    slip_force: float,
    bond_stiffness: float,
    rebinding_rate: float,
) -> SiteMoments:
    """Bound share and force moments in steady sliding of catch bonds.

    Parameters
    ----------
    speed, catch_rate, catch_force, slip_rate, slip_force, bond_stiffness
        As in ``catch_lives``.
    rebinding_rate : float
        k_on [1/s] of an open site.

    Returns
    -------
    SiteMoments
        Share bound [1], mean force per site [N], odd in the speed, and mean square force per site [N^2].

    Notes
    -----
    ``renewal`` with the moments of ``catch_lives``; without a catch pathway Bell's ``bell_moments``.

    Examples
    --------
    Sliding first binds more sites, as force holds the bonds, and then fewer:

    >>> bound = catch_moments([0.0, 1.0, 30.0], 1.0, 1.0, 1e-3, 1.0, 1.0, 1.0).bound
    >>> print(np.round(bound, 2))
    [0.5  0.74 0.24]
    """
    lives = catch_lives(speed, catch_rate, catch_force, slip_rate, slip_force, bond_stiffness)
    return renewal(*lives, speed, bond_stiffness, rebinding_rate)


def _slip_time(lost: float, rate: float, growing: Array) -> Array:
    """Age at which the slip pathway alone has lost so much [s]: ln(1 + lost b/rate)/b."""
    ratio = growing * lost / rate
    return lost / rate * np.divide(np.log1p(ratio), ratio, out=np.ones(ratio.shape), where=ratio > 0.0)


def _mean_exponential(z: Array) -> Array:
    """(e^z − 1)/z, 1 at z = 0."""
    return np.divide(np.expm1(z), z, out=np.ones(z.shape), where=z != 0.0)
