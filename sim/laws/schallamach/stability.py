"""Stability of steady sliding on bonds that sites make and lose, behind a spring: where oscillations set in.

A spring K holds a slider whose friction answers a small displacement ``e^(lambda t)`` with the impedance Z(lambda). It
neither grows nor fades where ``K + Z(i omega) = 0``. A mass m and a contact that yields with k_t change the stiffness,
``K = m omega^2 + K_0 k_t/(k_t - K_0)``, but not the frequency.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Onset(NamedTuple):
    """Onset of oscillations behind a spring: its stiffness [N/m] and their frequency [rad/s], nan where none is."""

    stiffness: Array
    frequency: Array


def behind(alone: Array, square: Array, mass: ArrayLike, contact_stiffness: ArrayLike) -> Onset:
    """Onset with a mass [kg] and a contact stiffness [N/m], from the stiffness without them and omega^2.

    Mass raises the stiffness that is needed, and so does a contact that yields; where it is no stiffer than that the
    contact itself oscillates, and no spring is stiff enough.
    """
    yields = alone / np.asarray(contact_stiffness, dtype=float)
    series = np.divide(alone, 1.0 - yields, out=np.full(np.shape(yields), np.inf), where=yields < 1.0)
    stiffness = np.where(np.isnan(alone), np.nan, np.multiply(mass, square) + series)
    return Onset(stiffness[()], np.sqrt(square)[()])


#: Gauss's rule on panels of the age of bonds, and their number; integral of the rupture rate at the oldest.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS, _END = 16, 50.0
#: Frequencies times the mean life of a bond among which oscillations are looked for, and halvings that find them.
_SLOWEST, _FASTEST, _HALVINGS = 1e-3, 30.0, 40


def resolved_onset(
    speed: ArrayLike, pathways: Sequence[tuple[float, float]], bond_stiffness: float, rebinding_rate: float,
    site_density: float, area: ArrayLike, area_growth: ArrayLike = 0.0, mass: ArrayLike = 0.0,
    contact_stiffness: ArrayLike = math.inf,
) -> Onset:  # fmt: skip
    """Stiffness of a spring below which bonds of a density over their stretch oscillate at a speed.

    Parameters
    ----------
    speed : float or array
        V [m/s], either sign.
    pathways : sequence of (rate, force)
        Pathways of rupture, at zero force with the rate [1/s], which grows with the force [N] on a bond over theirs, or
        falls where theirs is negative; the last one grows.
    bond_stiffness, rebinding_rate, site_density : float
        kappa [N/m]; k_on [1/s]; n [1/m^2].
    area, area_growth, mass, contact_stiffness : float or array
        As in ``first_moment_onset``.

    Returns
    -------
    Onset
        Stiffness [N/m], infinite where no spring is stiff enough, and frequency [rad/s]; nan where friction does not
        fall with speed.

    Notes
    -----
    A displacement changes the survival S of a bond of the age s, whose stretch is V s, and with it the share N bound:

        ``d ln S = -sum_i k_i (kappa/f_i) [(e^(a_i s) - E)/(a_i + lambda) - E (e^(a_i s) - 1)/a_i]``,
        ``dN = b ∫S d ln S ds/(1 + k_on ∫E S ds)``,
        ``Z = n kappa A {b ∫[(1 - E) S + V s S d ln S] ds - k_on dN V ∫s E S ds + g (M/N) dN}``

    with ``E = e^(-lambda s)``, ``a_i = kappa V/f_i``, ``b = k_on/(1 + k_on ∫S ds)``, the mean stretch M of a site and
    the growth g of the area: linear stability of the renewal equation (compare Srinivasan & Walcott 2009).

    Examples
    --------
    In mean field it is 0.0390, a third too stiff a spring:

    >>> print("%.6f %.4f" % resolved_onset(10.0, [(1.0, 1.0)], 1.0, 1.0, 1.0, 1.0))
    0.029557 4.2578
    """
    pace = np.abs(np.asarray(speed, dtype=float))[..., np.newaxis]
    rates = [(rate, bond_stiffness / force, bond_stiffness * pace / force) for rate, force in pathways]
    last, _, grows = rates[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        oldest, soonest = np.log1p(grows * _END / last) / grows, 0.1 / sum(rate + np.abs(a) for rate, _, a in rates)
        edges = oldest * (soonest / oldest) ** np.linspace(1.0, 0.0, _PANELS)
        half = 0.5 * np.diff(edges, prepend=0.0)[..., np.newaxis]
        age = (edges[..., np.newaxis] + half * (_NODES - 1.0)).reshape(*edges.shape[:-1], -1)
        survival = np.exp(-sum(rate * np.expm1(a * age) / a for rate, _, a in rates))
        survival *= (half * _WEIGHTS).reshape(age.shape)
        life, way = np.sum(survival, axis=-1), np.sum(survival * pace * age, axis=-1)
        births = rebinding_rate / (1.0 + rebinding_rate * life)

        def impedance(frequency: Array) -> NDArray[np.complex128]:
            turns = 1j * frequency[..., np.newaxis]
            back = np.exp(-turns * age)
            earlier = survival * -sum(
                rate * soft * ((np.exp(a * age) - back) / (a + turns) - back * np.expm1(a * age) / a)
                for rate, soft, a in rates
            )
            bound = births * np.sum(earlier, axis=-1) / (1.0 + rebinding_rate * np.sum(back * survival, axis=-1))
            found = births * np.sum((1.0 - back) * survival + pace * age * earlier, axis=-1)
            found += bound * (area_growth * way / life - rebinding_rate * np.sum(pace * age * back * survival, axis=-1))
            return site_density * bond_stiffness * np.asarray(area) * found

        low, high = _SLOWEST / life, _FASTEST / life
        falls = impedance(low).imag < 0.0
        for _ in range(_HALVINGS):
            middle = np.sqrt(low * high)
            below = impedance(middle).imag < 0.0
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        alone = np.where(falls, -impedance(high).real, np.nan)
        return behind(alone, np.where(falls, high**2, np.nan), mass, contact_stiffness)
