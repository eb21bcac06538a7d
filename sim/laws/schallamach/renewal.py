"""Sites that bind and break repeatedly at a constant speed (a renewal process), for any rupture law.

A bond is born unstretched and stretched by V t until it breaks at the age T; its site then waits for
the time 1/k_on on average and binds afresh (renewal-reward; Schallamach 1963). Three moments of the
life T determine bound share, force and force fluctuations, whatever the rupture law. Numbers are per
*site* here: at rest a share ``k_on/(k_on + k_0)`` of the sites is bound, and only relative to that
share do the ``*_fraction`` functions give the bond fraction of Menga, Carbone & Dini.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.numerics.jit import law

Array = NDArray[np.float64]


class SiteMoments(NamedTuple):
    """Bound share and force moments per site of a population in steady sliding.

    Attributes
    ----------
    bound : float or array
        Share of the sites that are bound [1].
    force : float or array
        Mean force per site, open ones counted with 0 [N]; odd in the speed.
    force_square : float or array
        Mean square force per site [N^2]. N independent sites have a force of variance
        ``N (force_square - force^2)``, and a binomial number of bonds.
    """

    bound: Array
    force: Array
    force_square: Array


class Lives(NamedTuple):
    """Moments of the life T of a bond: ``<T>`` [s], ``<T^2>/2`` [s^2] and ``<T^3>/3`` [s^3]."""

    mean: Array
    half_square: Array
    third_cube: Array


class Peak(NamedTuple):
    """Friction maximum: speed [m/s] and shear stress [Pa]."""

    speed: Array
    stress: Array


@law
def rest_share(rupture_rate, rebinding_rate):
    """Share of the sites that are bound at rest [1].

    Parameters
    ----------
    rupture_rate, rebinding_rate : float or array
        k_0 and k_on [1/s], at least 0. Without rupture every site is bound; nan if both are 0.

    Notes
    -----
    ``k_on/(k_on + k_0)``, or beta/(1 + beta) with beta = k_on/k_0.

    Examples
    --------
    >>> print(f"{rest_share(2.0, 6.0):.2f}")
    0.75
    """
    if rebinding_rate == math.inf:
        return 1.0
    return rebinding_rate / (rebinding_rate + rupture_rate)


@law
def _bound(life, pull, rebinding_rate):
    # the pull only broadcasts
    if life == math.inf and rebinding_rate > 0.0:
        return 1.0
    return life / (life + 1.0 / rebinding_rate)


@law
def _reward(moment, reach, life, rebinding_rate):
    # bonds that break at once carry nothing, however fast they are stretched
    return 0.0 if moment == 0.0 or reach == 0.0 else reach * moment / (life + 1.0 / rebinding_rate)


def renewal(life, half_square, third_cube, speed, bond_stiffness, rebinding_rate):
    """Bound share and force moments in steady sliding from the moments of a bond's life.

    Parameters
    ----------
    life, half_square, third_cube : float or array
        ``<T>`` [s], ``<T^2>/2`` [s^2], ``<T^3>/3`` [s^3] at this speed.
    speed : float or array
        V [m/s], either sign.
    bond_stiffness : float or array
        kappa [N/m].
    rebinding_rate : float or array
        k_on [1/s] of an open site.

    Returns
    -------
    SiteMoments
        Share bound [1], mean force per site [N] and mean square force per site [N^2].

    Notes
    -----
    With S(t) the chance to live longer than t, the moments are the integrals of S, t S and t^2 S, and::

        bound        = <T>                       / (<T> + 1/k_on)
        force        = kappa V       (<T^2>/2)   / (<T> + 1/k_on)
        force_square = (kappa V)^2   (<T^3>/3)   / (<T> + 1/k_on)

    Only the mean of the waiting time enters.

    Examples
    --------
    Bonds of a fixed life of 1 s on sites that wait for 1 s: half are bound, on average half stretched:

    >>> bound, force, _ = renewal(1.0, 1 / 2, 1 / 3, 1.0, 1.0, 1.0)
    >>> print(f"{bound:.2f} {force / bound:.2f}")
    0.50 0.50
    """
    pull = np.multiply(bond_stiffness, speed)
    return SiteMoments(
        _bound(life, pull, rebinding_rate),
        _reward(half_square, pull, life, rebinding_rate),
        _reward(third_cube, pull * pull, life, rebinding_rate),
    )


def constant_moments(speed, rate, bond_stiffness, rebinding_rate):
    """Bound share and force moments in steady sliding of bonds that break at a constant rate.

    Parameters
    ----------
    speed, rate, bond_stiffness, rebinding_rate : float or array
        V [m/s], either sign; k_0 [1/s], above 0; kappa [N/m]; k_on [1/s].

    Returns
    -------
    SiteMoments
        Share bound [1], which does not depend on speed; mean force per site [N], proportional to the
        speed without end; mean square force per site [N^2].

    Notes
    -----
    Lives are exponential: ``<T> = 1/k_0``, ``<T^2>/2 = 1/k_0^2``, ``<T^3>/3 = 2/k_0^3``.

    Examples
    --------
    Ten times the speed, ten times the friction, and not a bond less:

    >>> bound, force, _ = constant_moments([1.0, 10.0], 1.0, 1.0, 3.0)
    >>> print(bound, force)
    [0.75 0.75] [0.75 7.5 ]
    """
    life = np.divide(1.0, rate)
    return renewal(life, life * life, 2.0 * life**3, speed, bond_stiffness, rebinding_rate)
