"""Stability of steady sliding on bonds that sites make and lose, behind a spring: where oscillations set in.

A spring K holds a body whose friction answers a small slip ``e^(lambda t)`` of the interface with the impedance Z. On a
contact that yields with k_t the body goes ``1 + Z/k_t`` times as far, and with a mass m and a damping c the motion
neither grows nor fades where

    ``(K + lambda c + lambda^2 m) (1 + Z/k_t) + Z = 0``   at   ``lambda = i omega``.

By Nyquist's criterion every stiffer spring than the largest of these holds it, if k_t holds the interface alone.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Onset(NamedTuple):
    """Onset of oscillations behind a spring: its stiffness [N/m] and their frequency [rad/s], nan where none is."""

    stiffness: Array
    frequency: Array


class Body(NamedTuple):
    """Body behind a spring and its contact, each number a float or an array.

    Attributes
    ----------
    area : float or array
        A [m^2], at this speed.
    area_growth, stress_growth : float or array
        d ln A/d ln phi of a contact whose area follows the bonds, and d ln A/d ln tau of one that pays for their stress
        [1].
    mass, damping, viscosity : float or array
        m [kg] and c [N s/m] of the body; eta [Pa s/m] of the interface.
    contact_stiffness, contact_growth : float or array
        k_t between body and interface [N/m]; d ln k_t/d ln A, 1/2 of a half-space [1].
    """

    area: ArrayLike
    area_growth: ArrayLike = 0.0
    stress_growth: ArrayLike = 0.0
    mass: ArrayLike = 0.0
    damping: ArrayLike = 0.0
    viscosity: ArrayLike = 0.0
    contact_stiffness: ArrayLike = math.inf
    contact_growth: ArrayLike = 0.0


#: What bonds of a constant area answer to a slip ``e^(i omega t)`` at frequencies: stress [Pa/m], and d ln phi [1/m].
Answer = Callable[[Array], tuple[Complex, Complex]]
#: Frequencies at which a motion in balance is looked for between two, and steps of regula falsi that find it.
_LOOKS, _STEPS = 48, 12


def onset_behind(answer: Answer, speed: ArrayLike, stress: Array, between: tuple[Array, Array], body: Body) -> Onset:
    """Onset of oscillations of a body at a speed [m/s] on bonds of a stress [Pa], ``between`` two frequencies."""
    area, by_bonds, by_stress, mass, damping, viscosity, firm, firmer = (np.asarray(one, dtype=float) for one in body)
    bears = area * (stress + viscosity * np.abs(speed))

    def of_interface(frequency: Array) -> tuple[Complex, Complex]:
        """Z, and k_t times the way of the body beyond that of the interface."""
        stretched, bound = answer(frequency)
        spread = by_bonds * bound + by_stress * stretched / stress
        force = area * (stretched + 1j * frequency * viscosity) + bears * spread
        return force, force - bears * firmer * spread

    def needed(frequency: Array) -> Complex:
        force, ahead = of_interface(frequency)
        return frequency * (mass * frequency - 1j * damping) - force / (1.0 + ahead / firm)

    found = _stiffest(needed, *between)
    if np.all(np.isinf(firm)):
        return found
    alone = _stiffest(lambda frequency: -of_interface(frequency)[1], *between)
    jumps = alone.stiffness >= firm
    stiffness = np.where(jumps, math.inf, found.stiffness)
    return Onset(stiffness[()], np.where(jumps, alone.frequency, found.frequency)[()])


def _stiffest(needed: Callable[[Array], Complex], low: Array, high: Array) -> Onset:
    """The stiffest spring that a motion between two frequencies needs to stay as it is, above zero."""
    steps = np.linspace(0.0, 1.0, _LOOKS)
    tried = np.stack([needed(low * (high / low) ** step) for step in steps], axis=-1)
    turns = (tried.imag[..., 1:] < 0.0) != (tried.imag[..., :-1] < 0.0)
    larger = np.maximum(tried.real[..., 1:], tried.real[..., :-1])
    place = np.argmax(np.where(turns, larger, -math.inf), axis=-1)
    (before, off), (here, now) = (
        (
            low * (high / low) ** steps[place + k],
            np.take_along_axis(tried.imag, (place + k)[..., np.newaxis], -1)[..., 0],
        )
        for k in (0, 1)
    )
    with np.errstate(divide="ignore", invalid="ignore"):  # where none turns
        for _ in range(_STEPS):
            there = here - now * (here - before) / (now - off)
            after = needed(there).imag
            across = after * now < 0.0
            before, off = np.where(across, here, before), np.where(across, now, 0.5 * off)
            here, now = there, after
        stiffness = needed(here).real
    holds = turns.any(axis=-1) & (stiffness > 0.0)
    return Onset(np.where(holds, stiffness, np.nan)[()], np.where(holds, here, np.nan)[()])


#: Gauss's rule on panels of the age of bonds, and their number; integral of the rupture rate at the oldest.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS, _END = 16, 50.0
#: Frequencies times the mean life of a bond among which oscillations are looked for.
_SLOWEST, _FASTEST = 1e-3, 30.0


def resolved_onset(
    speed: ArrayLike, pathways: Sequence[tuple[float, float]], bond_stiffness: float, rebinding_rate: float,
    site_density: float, body: Body,
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
    body : Body
        The body behind the spring, and its contact.

    Returns
    -------
    Onset
        Stiffness [N/m], infinite where no spring is stiff enough, and frequency [rad/s]; nan where every spring is.

    Notes
    -----
    A displacement changes the survival S of a bond of the age s, whose stretch is V s, and with it the share N bound:

        ``d ln S = -sum_i k_i (kappa/f_i) [(e^(a_i s) - E)/(a_i + lambda) - E (e^(a_i s) - 1)/a_i]``,
        ``dN = b ∫S d ln S ds/(1 + k_on ∫E S ds)``,
        ``d tau = n kappa {b ∫[(1 - E) S + V s S d ln S] ds - k_on dN V ∫s E S ds}``,
        ``Z = A (d tau + lambda eta) + A (tau + eta V) (g dN/N + h d tau/tau)``

    with ``E = e^(-lambda s)``, ``a_i = kappa V/f_i``, ``b = k_on/(1 + k_on ∫S ds)`` and the growths g and h of the
    area: linear stability of the renewal equation (compare Srinivasan & Walcott 2009).

    Examples
    --------
    In mean field it is 0.0390, a third too stiff a spring:

    >>> print("%.6f %.4f" % resolved_onset(10.0, [(1.0, 1.0)], 1.0, 1.0, 1.0, Body(1.0)))
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

        def answer(frequency: Array) -> tuple[Complex, Complex]:
            turns = 1j * frequency[..., np.newaxis]
            back = np.exp(-turns * age)
            earlier = survival * -sum(
                rate * soft * ((np.exp(a * age) - back) / (a + turns) - back * np.expm1(a * age) / a)
                for rate, soft, a in rates
            )
            bound = births * np.sum(earlier, axis=-1) / (1.0 + rebinding_rate * np.sum(back * survival, axis=-1))
            found = births * np.sum((1.0 - back) * survival + pace * age * earlier, axis=-1)
            found -= rebinding_rate * bound * np.sum(pace * age * back * survival, axis=-1)
            return site_density * bond_stiffness * found, bound / (births * life)

        stress = site_density * bond_stiffness * births * way
        return onset_behind(answer, speed, stress, (_SLOWEST / life, _FASTEST / life), body)
