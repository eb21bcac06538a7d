"""Bonds between sliding surfaces, in closed form: their number and the force that they bear.

From the law of Menga, Carbone & Dini to more complete ones, each with its own assumption on rupture:

- linear: their fraction ``1/(1 + V/Vc)``, its rate equation and exact step;
- renewal: any rupture law, from three moments of the life of a bond; a constant rate;
- Bell: a rupture rate that grows exponentially with force; exact, with the friction maximum;
- first moment: the same in mean field, whose maximum is too high;
- cut-off: bonds that break at a stretch, whose limit without thermal rupture is the linear law;
- catch: bonds that force first strengthens and then breaks;
- loading: a Bell bond pulled once: rupture forces and the static peak;
- stability: the spring and the mass behind which bonds make a slider oscillate.

The linear law counts bonds relative to rest. The others start from sites: ``bound`` is a share of
the sites, ``*_fraction`` the number of bonds relative to rest.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sim.numerics.jit import device, law
from sim.numerics.special import lambert, lambert_w, reduced

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
    """Return the share of the sites that are bound at rest [1].

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
    return 1.0 / (1.0 + rupture_rate / rebinding_rate)


@law
def _bound(life, pull, rebinding_rate):
    # the pull only broadcasts
    return 1.0 / (1.0 + 1.0 / (life * rebinding_rate))


@law
def _reward(moment, reach, life, rebinding_rate):
    # bonds that break at once carry nothing, however fast they are stretched
    return (
        0.0
        if moment == 0.0 or reach == 0.0
        else reach * moment / (life + 1.0 / rebinding_rate)
    )


def renewal(life, half_square, third_cube, speed, bond_stiffness, rebinding_rate):
    """Return the bound share and force moments in steady sliding from the moments of a bond's life.

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
    """Return the bound share and force moments in steady sliding of bonds that break at a constant rate.

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
    return renewal(
        life, life * life, 2.0 * life**3, speed, bond_stiffness, rebinding_rate
    )


# Stability of steady sliding on bonds that sites make and lose, behind a spring: where oscillations set in.


Complex = NDArray[np.complex128]


class Onset(NamedTuple):
    """Onset of oscillations behind a spring: the stiffness below which they begin [N/m], and their frequency [rad/s].

    The stiffness is 0 where every spring holds the slider, infinite where none does, and nan where the onset is not
    known. Without an onset there is no frequency (nan).
    """

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


def _onset_behind(
    answer: Answer,
    speed: ArrayLike,
    stress: Array,
    between: tuple[Array, Array],
    body: Body,
) -> Onset:
    """Onset of oscillations of a body at a speed [m/s] on bonds of a stress [Pa], ``between`` two frequencies."""
    area, by_bonds, by_stress, mass, damping, viscosity, firm, firmer = (
        np.asarray(each, float) for each in body
    )
    bears = area * (stress + viscosity * np.abs(speed))
    # an area at rest does not answer to a small stress
    apart = np.where(stress == 0.0, math.inf, stress)

    def of_interface(frequency: Array) -> tuple[Complex, Complex]:
        """Return Z, and k_t times the way of the body beyond that of the interface."""
        stretched, bound = answer(frequency)
        spread = by_bonds * bound + by_stress * stretched / apart
        force = area * (stretched + 1j * frequency * viscosity) + bears * spread
        return force, force - bears * firmer * spread

    def needed(frequency: Array) -> Complex:
        force, ahead = of_interface(frequency)
        return frequency * (mass * frequency - 1j * damping) - force / (
            1.0 + ahead / firm
        )

    onset = _stiffest(needed, *between)
    if np.all(np.isinf(firm)):
        return onset
    alone = _stiffest(lambda frequency: -of_interface(frequency)[1], *between)
    jumps = alone.stiffness >= firm
    stiffness = np.where(jumps, math.inf, onset.stiffness)
    return Onset(stiffness[()], np.where(jumps, alone.frequency, onset.frequency)[()])


def _stiffest(needed: Callable[[Array], Complex], low: Array, high: Array) -> Onset:
    """The stiffest spring that a motion between two frequencies needs to stay as it is, above zero."""
    steps = np.linspace(0.0, 1.0, _LOOKS)
    tried = np.stack([needed(low * (high / low) ** step) for step in steps], axis=-1)
    turns = (tried.imag[..., 1:] < 0.0) != (tried.imag[..., :-1] < 0.0)
    larger = np.maximum(tried.real[..., 1:], tried.real[..., :-1])
    place = np.argmax(np.where(turns, larger, -math.inf), axis=-1)
    places = place, place + 1
    before, here = (low * (high / low) ** steps[k] for k in places)
    off, now = (
        np.take_along_axis(tried.imag, k[..., np.newaxis], -1)[..., 0] for k in places
    )
    with np.errstate(divide="ignore", invalid="ignore"):  # where none turns
        for _ in range(_STEPS):
            guess = here - now * (here - before) / (now - off)
            after = needed(guess).imag
            across = after * now < 0.0
            before, off = (
                np.where(across, here, before),
                np.where(across, now, 0.5 * off),
            )
            here, now = guess, after
        stiffness = needed(here).real
    begins = turns.any(axis=-1) & (stiffness > 0.0)
    unknown = np.isnan(tried).any(axis=-1)  # of an open contact
    return Onset(
        np.where(begins, stiffness, np.where(unknown, np.nan, 0.0))[()],
        np.where(begins, here, np.nan)[()],
    )


#: Gauss's rule on panels of the age of bonds, and their number; integral of the rupture rate at the oldest.
_AGE_NODES, _AGE_WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS, _OLDEST = 16, 50.0
#: Frequencies times the mean life of a bond among which oscillations are looked for.
_SLOWEST, _FASTEST = 1e-3, 30.0


def resolved_onset(
    speed: ArrayLike,
    pathways: Sequence[tuple[float, float]],
    bond_stiffness: float,
    rebinding_rate: float,
    site_density: float,
    body: Body,
) -> Onset:
    """Return the stiffness of a spring below which bonds of a density over their stretch oscillate at a speed.

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
        Stiffness [N/m], 0 where every spring is stiff enough and infinite where none is, and frequency [rad/s].

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
    rates = [
        (rate, bond_stiffness / force, bond_stiffness * pace / force)
        for rate, force in pathways
    ]
    last, _, grows = rates[-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        oldest, soonest = (
            np.log1p(grows * _OLDEST / last) / grows,
            0.1 / sum(rate + np.abs(a) for rate, _, a in rates),
        )
        edges = oldest * (soonest / oldest) ** np.linspace(1.0, 0.0, _PANELS)
        half = 0.5 * np.diff(edges, prepend=0.0)[..., np.newaxis]
        age = (edges[..., np.newaxis] + half * (_AGE_NODES - 1.0)).reshape(
            *edges.shape[:-1], -1
        )
        survival = np.exp(-sum(rate * np.expm1(a * age) / a for rate, _, a in rates))
        survival *= (half * _AGE_WEIGHTS).reshape(age.shape)
        life, way = np.sum(survival, axis=-1), np.sum(survival * pace * age, axis=-1)
        births = rebinding_rate / (1.0 + rebinding_rate * life)

        def answer(frequency: Array) -> tuple[Complex, Complex]:
            turns = 1j * frequency[..., np.newaxis]
            back = np.exp(-turns * age)
            earlier = survival * -sum(
                rate
                * soft
                * (
                    (np.exp(a * age) - back) / (a + turns)
                    - back * np.expm1(a * age) / a
                )
                for rate, soft, a in rates
            )
            bound = (
                births
                * np.sum(earlier, axis=-1)
                / (1.0 + rebinding_rate * np.sum(back * survival, axis=-1))
            )
            moment = births * np.sum(
                (1.0 - back) * survival + pace * age * earlier, axis=-1
            )
            moment -= (
                rebinding_rate * bound * np.sum(pace * age * back * survival, axis=-1)
            )
            return site_density * bond_stiffness * moment, bound / (births * life)

        stress = site_density * bond_stiffness * births * way
        return _onset_behind(
            answer, speed, stress, (_SLOWEST / life, _FASTEST / life), body
        )


# Linear law of the bond fraction: steady sliding, rate equation and its exact step.


@law
def steady_fraction(speed, critical_speed):
    """Return the bond fraction in steady sliding.

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


def linear_onset(
    speed, critical_speed, rebinding_rate, strength, damping, mass=0.0, area_growth=0.0
):
    """Return the stiffness of a spring below which a slider on bonds of the linear rate equation oscillates at a speed.

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
        Stiffness [N/m], infinite for a mass that nothing damps, and frequency [rad/s].

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
    falls = (
        (1.0 + area_growth)
        * strength
        * rebinding_rate
        / critical_speed
        * steady_fraction(speed, critical_speed)
    )
    with np.errstate(divide="ignore"):
        over = np.divide(falls - damping * pace, damping)
    frequency = np.sqrt(np.where(over > 0.0, pace * over, np.nan))
    over = np.maximum(over, 0.0)  # nan of an open contact stays
    return Onset(((damping + mass * pace) * over)[()], frequency[()])


@law
def relax_fraction(fraction, path, duration, critical_speed, rebinding_rate):
    """Return the bond fraction after a step: the exact solution of the linear rate equation.

    Parameters
    ----------
    fraction : float or array
        phi at the start of the step [1].
    path : float or array
        Distance slid in the step, integral of abs(V) dt [m], at least 0.
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
    """Return the body of ``relax_fraction``, for compiled loops."""
    total = duration + path / critical_speed
    if total == 0.0:
        return fraction
    z = rebinding_rate * total
    return fraction * math.exp(-z) - duration / total * math.expm1(-z)


def transition_probabilities(path, duration, critical_speed, rebinding_rate):
    """Return the transition probabilities of one site over a step, with rates h to close and h abs(V)/Vc to open.

    Parameters
    ----------
    path, duration, critical_speed, rebinding_rate : float or array
        Integral of abs(V) dt [m], length of the step [s], Vc [m/s], h [1/s].

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
    arguments = path, duration, critical_speed, rebinding_rate
    return relax_fraction(1.0, *arguments), relax_fraction(0.0, *arguments)


# Bonds whose rupture rate grows with force, ``k = k_0 e^(f/f_b)`` (Bell 1978), resolved in stretch: exact.


@device
def _pace(speed, zero_force_rate, bell_force, bond_stiffness):
    """z = k_0 f_b/(kappa |V|)."""
    return zero_force_rate * bell_force / (bond_stiffness * math.fabs(speed))


@law
def _life(speed, zero_force_rate, bell_force, bond_stiffness, order):
    n = int(order)
    moment = reduced(
        _pace(speed, zero_force_rate, bell_force, bond_stiffness), n
    ) / zero_force_rate ** (n + 1)
    return 2.0 * moment if n == 2 else moment


def bell_lives(speed, zero_force_rate, bell_force, bond_stiffness):
    """Return the moments of the life of a Bell bond that is born unstretched and pulled at a constant speed.

    Parameters
    ----------
    speed : float or array
        V [m/s], either sign.
    zero_force_rate : float or array
        k_0 [1/s], above 0: rupture rate of an unstretched bond.
    bell_force : float or array
        f_b [N], above 0: thermal energy over the length of the activation.
    bond_stiffness : float or array
        kappa [N/m].

    Returns
    -------
    Lives
        ``<T>`` [s], ``<T^2>/2`` [s^2], ``<T^3>/3`` [s^3]: 1/k_0, 1/k_0^2, 2/k_0^3 at rest, 0 at infinite speed.

    Notes
    -----
    With E the exponential integrals of order 0, 1, 2 at z = k_0 f_b/(kappa \\|V\\|)::

        <T> = z e^z E_0/k_0     <T^2>/2 = z^2 e^z E_1/k_0^2     <T^3>/3 = 2 z^3 e^z E_2/k_0^3

    Examples
    --------
    At z = 1, where bonds open by themselves as fast as the sliding loads them:

    >>> print("%.4f %.4f %.4f" % bell_lives(1.0, 1.0, 1.0, 1.0))
    0.5963 0.2660 0.1936
    """
    arguments = (speed, zero_force_rate, bell_force, bond_stiffness)
    return Lives(_life(*arguments, 0), _life(*arguments, 1), _life(*arguments, 2))


def bell_moments(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Return the bound share and force moments of Bell bonds in steady sliding.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness : float or array
        V [m/s], either sign; k_0 [1/s], above 0; f_b [N], above 0; kappa [N/m].
    rebinding_rate : float or array
        k_on [1/s], at least 0: closing rate of an open site.

    Returns
    -------
    SiteMoments
        Share of the sites that is bound [1], mean force [N] and mean square force [N^2] per site: no
        force at rest, no bonds at infinite speed; ``constant_moments`` where f_b is infinite.

    Notes
    -----
    ``renewal`` with ``bell_lives``, multiplied out so that no speed from 0 to infinity is special.

    Examples
    --------
    Where friction peaks (k_on = k_0), half of the bonds are gone and the rest are pulled at f_b:

    >>> bound, force, _ = bell_moments(4.50294, 1.0, 1.0, 1.0, 1.0)
    >>> print(f"{bound:.5f} {force:.6f} {force / bound:.2f}")
    0.23985 0.218485 0.91
    """
    lives = bell_lives(speed, zero_force_rate, bell_force, bond_stiffness)
    return renewal(*lives, speed, bond_stiffness, rebinding_rate)


@law
def bell_fraction(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Return the bond fraction of a Bell population in steady sliding: bonds over bonds at rest.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate : float or array
        As in ``bell_moments``.

    Returns
    -------
    float or array
        phi/phi_rest [1]: 1 at rest, 0 at infinite speed, even in the speed.

    Notes
    -----
    ``(1 + k_on/k_0) R/(1 + (k_on/k_0) R)`` with ``R = k_0 <T>``.

    Examples
    --------
    The half-way speed is no property of the bond: sites that rebind faster keep their bonds for longer.

    >>> print("%.3f %.3f %.3f" % tuple(bell_fraction(4.045, 1.0, 1.0, 1.0, [0.01, 1.0, 100.0])))
    0.336 0.500 0.981
    """
    life = reduced(_pace(speed, zero_force_rate, bell_force, bond_stiffness), 0)
    rupture, rebinding = (
        1.0 / (1.0 + rebinding_rate / zero_force_rate),
        1.0 / (1.0 + zero_force_rate / rebinding_rate),
    )
    return life / (rupture + rebinding * life)


def bell_stress(
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density
):
    """Return the shear stress of a Bell population in steady sliding [Pa]; odd in the speed.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate : float or array
        As in ``bell_moments``.
    site_density : float or array
        n [1/m^2]: sites, bound or not, per area.

    Notes
    -----
    ``n`` times the mean force per site. Slow: ``n phi_rest (kappa/k_0) V``, a viscous law. Fast: it
    falls as ``n f_b (k_on/k_0) z (ln z)^2/2``.

    Examples
    --------
    Friction rises and falls:

    >>> print("%.0f %.0f %.0f" % tuple(bell_stress([1e-6, 4.5e-6, 1e-4], 1.0, 1e-11, 1e-5, 1.0, 1e14)))
    167 218 87
    """
    moments = bell_moments(
        speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate
    )
    return np.multiply(site_density, moments.force)


@law
def _bell_peak_speed(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Speed at which the force is largest, by the root z of d ln(force)/d ln z.

    Derivatives of the integrals are integrals again, ``R_0' z = (1 + z) R_0 - z`` and ``(R_1/z)' z = (1 + z) R_1/z -
    R_0``. So the root is exact to rounding. It is at 0.384 for a long wait and tends to z = wait for a short one:
    within the bracket for every wait from 0 to infinity.
    """
    wait = zero_force_rate / rebinding_rate
    high = min(1.0, 2.0 * wait)
    low = 0.01 * high
    for _ in range(60):
        z = math.sqrt(low * high)
        life = reduced(z, 0)
        slope = (
            1.0 + z - z * life / reduced(z, 1) - ((1.0 + z) * life - z) / (wait + life)
        )
        if slope > 0.0:
            low = z
        else:
            high = z
    return zero_force_rate * bell_force / (bond_stiffness * high)


class BellNumbers(NamedTuple):
    """Numbers of Bell bonds: k_0 [1/s], k_on [1/s] and sites per area n [1/m^2]."""

    zero_force_rate: Array
    rebinding_rate: Array
    site_density: Array


def bell_peak(
    zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density
):
    """Return the friction maximum of a Bell population: the largest steady stress at any speed.

    Parameters
    ----------
    zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density : float or array
        As in ``bell_stress``.

    Returns
    -------
    Peak
        Speed [m/s] and stress [Pa] there; infinite for sites that rebind at once.

    Notes
    -----
    Below this speed friction grows with speed, above it falls: stick-slip is possible only above.

    Examples
    --------
    Sites that rebind a hundred times faster bear eight times the stress:

    >>> speed, stress = bell_peak(1.0, 1.0, 1.0, [1.0, 100.0], 1.0)
    >>> print("%.4f %.3f" % tuple(speed), "%.6f %.6f" % tuple(stress))
    4.5029 146.903 0.218485 1.794870
    """
    bonds = zero_force_rate, bell_force, bond_stiffness, rebinding_rate
    speed = _bell_peak_speed(*bonds)
    # without a wait for the next bond the stress grows with speed for ever
    return Peak(
        speed,
        np.where(np.isinf(speed), math.inf, bell_stress(speed, *bonds, site_density))[
            ()
        ],
    )


@law
def bell_critical_speed(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Return the speed at which half of the bonds of a Bell population are left [m/s].

    Parameters
    ----------
    zero_force_rate, bell_force, bond_stiffness, rebinding_rate : float or array
        k_0 [1/s], above 0; f_b [N], above 0; kappa [N/m]; k_on [1/s].

    Notes
    -----
    The root of ``bell_fraction = 1/2``, the counterpart of the critical speed of ``steady_fraction``; a
    Bell population loses its bonds over more decades of speed.

    Examples
    --------
    In units of k_0 f_b/kappa it grows with the rebinding rate, but not in proportion:

    >>> print("%.4f %.3f %.3f" % tuple(bell_critical_speed(1.0, 1.0, 1.0, [0.1, 1.0, 100.0])))
    1.8529 4.045 593.706
    """
    half = 1.0 / (rebinding_rate / zero_force_rate + 2.0)  # k_0 <T> at that speed
    low, high = half * half, half / (1.0 - half)  # z/(1 + z) < k_0 <T> < sqrt(z)
    for _ in range(64):
        z = math.sqrt(low * high)
        if reduced(z, 0) < half:
            low = z
        else:
            high = z
    return zero_force_rate * bell_force / (bond_stiffness * high)


def bell_numbers(critical_speed, stress, bell_force, bond_stiffness, rebinding_ratio):
    """Return the rates and site density of a Bell population that has a given critical speed and friction maximum.

    Parameters
    ----------
    critical_speed : float or array
        V_c [m/s], above 0: the speed at which half of the bonds are left in steady sliding.
    stress : float or array
        tau [Pa], above 0: the largest steady shear stress at any speed.
    bell_force, bond_stiffness : float or array
        f_b [N], above 0; kappa [N/m], above 0.
    rebinding_ratio : float or array
        beta = k_on/k_0 [1], above 0.

    Returns
    -------
    BellNumbers
        k_0 [1/s] and k_on = beta k_0 [1/s], both proportional to V_c; n [1/m^2], proportional to tau.

    Notes
    -----
    At a given beta a population depends on the speed by ``kappa V/(k_0 f_b)`` alone, so both follow from the population
    of k_0 = 1 and n = 1: ``k_0 = V_c/bell_critical_speed(1, f_b, kappa, beta)``,
    ``n = tau/bell_peak(1, f_b, kappa, beta, 1).stress``.

    Examples
    --------
    >>> numbers = bell_numbers(3e-3, 2e5, 4e-12, 8e-7, 10.0)
    >>> print("%.2f %.1f %.3e" % numbers)
    15.77 157.7 5.909e+16
    >>> print(f"{bell_critical_speed(numbers[0], 4e-12, 8e-7, numbers[1]):.4f}")
    0.0030
    """
    of_one = bell_critical_speed(1.0, bell_force, bond_stiffness, rebinding_ratio)
    rate, largest = (
        np.divide(critical_speed, of_one),
        bell_peak(1.0, bell_force, bond_stiffness, rebinding_ratio, 1.0),
    )
    return BellNumbers(
        rate, np.multiply(rebinding_ratio, rate), np.divide(stress, largest.stress)
    )


# Bell bonds in mean field, every bond at the mean stretch: closed forms by Lambert's W.


#: Frequencies over the sum of the rates among which oscillations are looked for.
_LOWEST_RATE, _HIGHEST_RATE = 1e-4, 30.0


@device
def steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness):
    """Return the steady stretch in units of f_b/kappa: W(eps)."""
    return lambert(bond_stiffness * math.fabs(speed) / (zero_force_rate * bell_force))


@law
def _steady_rate(speed, zero_force_rate, bell_force, bond_stiffness):
    """Rupture rate k of all bonds in steady sliding."""
    return zero_force_rate * math.exp(
        steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness)
    )


@law
def first_moment_stretch(speed, zero_force_rate, bell_force, bond_stiffness):
    """Return the mean stretch of the bonds of a mean-field Bell population in steady sliding [m].

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness : float or array
        V [m/s], either sign; k_0 [1/s], above 0; f_b [N], above 0; kappa [N/m].

    Notes
    -----
    ``(f_b/kappa) W(eps)`` with ``eps = kappa V/(k_0 f_b)``: the solution of x k(x) = V. Odd in the speed.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(first_moment_stretch([1.0, -1.0], 1.0, 1.0, 1.0)))
    0.5671 -0.5671
    """
    tilt = steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness)
    if tilt > 1.0:
        return math.copysign(tilt * bell_force / bond_stiffness, speed)
    # the same, also for an infinite Bell force
    return speed / zero_force_rate * math.exp(-tilt)


def first_moment_fraction(
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate
):
    """Return the bond fraction of a mean-field Bell population in steady sliding: bonds over bonds at rest [1].

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate : float or array
        As in ``first_moment_stretch``; k_on [1/s].

    Notes
    -----
    ``(k_on + k_0)/(k_on + k)`` with ``k = k_0 e^W(eps)``: 1 at rest, 0 at infinite speed.

    Examples
    --------
    Mean field loses bonds a little too early:

    >>> print("%.3f %.3f" % tuple(first_moment_fraction([1.0, 10.0], 1.0, 1.0, 1.0, 1.0)))
    0.724 0.297
    """
    rate = _steady_rate(speed, zero_force_rate, bell_force, bond_stiffness)
    return rest_share(rate, rebinding_rate) / rest_share(
        zero_force_rate, rebinding_rate
    )


def first_moment_stress(
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density
):
    """Return the shear stress of a mean-field Bell population in steady sliding [Pa]; odd in the speed.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate : float or array
        As in ``first_moment_fraction``.
    site_density : float or array
        n [1/m^2]: sites, bound or not, per area.

    Notes
    -----
    ``n f_b W/(1 + (k_0/k_on) e^W)`` with W = W(eps).

    Examples
    --------
    The exact population has 0.204 here:

    >>> print(f"{first_moment_stress(10.0, 1.0, 1.0, 1.0, 1.0, 1.0):.3f}")
    0.259
    """
    rate = _steady_rate(speed, zero_force_rate, bell_force, bond_stiffness)
    return np.multiply(
        site_density,
        constant_moments(speed, rate, bond_stiffness, rebinding_rate).force,
    )


def first_moment_peak(
    zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density
):
    """Return the friction maximum of a mean-field Bell population.

    Parameters
    ----------
    zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density : float or array
        As in ``first_moment_stress``.

    Returns
    -------
    Peak
        Speed [m/s] and stress [Pa] there.

    Notes
    -----
    ``n f_b W(beta/e)`` at ``eps = (1 + W) e^(1 + W)``, with beta = k_on/k_0. The stress is also the one at
    which Bell's cluster of bonds that share a given force equally comes apart.

    Examples
    --------
    The exact population has 0.218485 at 4.503:

    >>> print("%.3f %.6f" % first_moment_peak(1.0, 1.0, 1.0, 1.0, 1.0))
    4.591 0.278465
    """
    rate, force, stiffness, binding = np.broadcast_arrays(
        zero_force_rate, bell_force, bond_stiffness, rebinding_rate
    )
    beyond = lambert_w(binding / rate / math.e)
    speed = rate * force / stiffness * (1.0 + beyond) * np.exp(1.0 + beyond)
    return Peak(speed, np.multiply(site_density, force * beyond))


def first_moment_numbers(
    critical_speed, stress, bell_force, bond_stiffness, rebinding_ratio
):
    """Return the rates and site density of a mean-field Bell population of a given critical speed and friction maximum.

    Parameters
    ----------
    critical_speed, stress, bell_force, bond_stiffness, rebinding_ratio : float or array
        As in ``bell_numbers``.

    Returns
    -------
    BellNumbers
        k_0 [1/s], k_on [1/s] and n [1/m^2], of the mean field's own fraction and maximum.

    Notes
    -----
    Half of the bonds are left where ``e^W = 2 + beta``, so ``k_0 = kappa V_c/(f_b (2 + beta) ln(2 + beta))``. The
    maximum is that of ``first_moment_peak``, so ``n = tau/(f_b W(beta/e))``.

    Examples
    --------
    Fewer sites are needed than in ``bell_numbers``, because mean field has the higher maximum:

    >>> print("%.2f %.1f %.3e" % first_moment_numbers(3e-3, 2e5, 4e-12, 8e-7, 10.0))
    20.12 201.2 4.322e+16
    """
    most = 2.0 + np.asarray(rebinding_ratio)
    rate = np.divide(
        np.multiply(bond_stiffness, critical_speed), bell_force * most * np.log(most)
    )
    largest = first_moment_peak(
        1.0, bell_force, bond_stiffness, rebinding_ratio, 1.0
    ).stress
    return BellNumbers(
        rate, np.multiply(rebinding_ratio, rate), np.divide(stress, largest)
    )


def first_moment_onset(
    speed,
    zero_force_rate,
    bell_force,
    bond_stiffness,
    rebinding_rate,
    site_density,
    body,
):
    """Return the stiffness of a spring below which a mean-field Bell population oscillates at a speed.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density : float or array
        As in ``first_moment_stress``.
    body : Body
        The body behind the spring, and its contact.

    Returns
    -------
    Onset
        Stiffness [N/m], 0 where every spring is stiff enough and infinite where none is, and frequency [rad/s].

    Notes
    -----
    With the share N bound and x the stretch over x_b = f_b/kappa a slip answers

        ``d tau = n kappa N lambda (lambda + k_on + (1 - x) k)/D``,  ``d ln N = -k lambda/(D x_b)``,
        ``D = lambda^2 + (k_on + 2k) lambda + k (k_on + k) (1 + x)``

    from the eigenvalues of the closure. Massless and undamped, with s the growth of the area over the bonds and
    d = (1 + s) x k - k_on - k, the onset is ``K = n kappa A N d/(k_on + 2k)``, and a mass and k_t of their own make it
    ``m omega^2 + K k_t/(k_t - K)``.

    Examples
    --------
    In units of all sites, at ten times the speed at which bonds begin to yield:

    >>> from sim.laws.schallamach import Body
    >>> print("%.7f %.6f" % first_moment_onset(10.0, 1.0, 1.0, 1.0, 1.0, 1.0, Body(1.0)))
    0.0390213 4.691569
    """
    unit = np.divide(bell_force, bond_stiffness)
    tilt = np.abs(
        first_moment_stretch(speed, zero_force_rate, bell_force, bond_stiffness) / unit
    )
    rate = _steady_rate(speed, zero_force_rate, bell_force, bond_stiffness)
    bound = rest_share(rate, rebinding_rate)
    density = site_density * bond_stiffness * bound

    def answer(frequency):
        turns = 1j * frequency
        determinant = turns * (turns + rebinding_rate + 2.0 * rate) + rate * (
            rebinding_rate + rate
        ) * (1.0 + tilt)
        stretched = (
            density
            * turns
            * (turns + rebinding_rate + (1.0 - tilt) * rate)
            / determinant
        )
        return stretched, -rate * turns / determinant / unit

    pace = rebinding_rate + (1.0 + tilt) * rate
    return _onset_behind(
        answer,
        speed,
        density * tilt * unit,
        (_LOWEST_RATE * pace, _HIGHEST_RATE * pace),
        body,
    )


# Bonds that open at a constant rate and all break at a stretch l (after Chernyak & Leonov 1986).


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
    return (
        (bond_stiffness * stretch) ** n * _fast(a, n) / (_fast(a, 0) + wait / longest)
    )


def cut_off_moments(speed, rate, stretch, bond_stiffness, rebinding_rate):
    """Return the bound share and force moments of bonds that break at a stretch, in steady sliding.

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
    arguments = (speed, rate, stretch, bond_stiffness, rebinding_rate)
    bound, size, square = (_site(*arguments, power) for power in range(3))
    return SiteMoments(bound, np.sign(speed) * size, square)


def cut_off_fraction(speed, rate, stretch, rebinding_rate):
    """Return the bond fraction of bonds that break at a stretch, in steady sliding: bonds over bonds at rest [1].

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
    return _site(speed, rate, stretch, 1.0, rebinding_rate, 0) / rest_share(
        rate, rebinding_rate
    )


def cut_off_stress(speed, rate, stretch, bond_stiffness, rebinding_rate, site_density):
    """Return the shear stress of bonds that break at a stretch, in steady sliding [Pa].

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
    return np.multiply(
        site_density,
        cut_off_moments(speed, rate, stretch, bond_stiffness, rebinding_rate).force,
    )


# Catch bonds: two pathways of rupture, one that force slows down and one that it speeds up.


_CATCH_NODES, _CATCH_WEIGHTS = np.polynomial.legendre.leggauss(16)
#: ∫k dt at which lives are cut: e^-60 are left.
_CATCH_END = 60.0


def catch_lives(
    speed: ArrayLike,
    catch_rate: float,
    catch_force: float,
    slip_rate: float,
    slip_force: float,
    bond_stiffness: float,
) -> Lives:
    """Return the moments of the life of a catch bond that is pulled at constant speed.

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
    ratio, slip_time = growing * _CATCH_END / slip_rate, _CATCH_END / slip_rate
    longest = slip_time * np.divide(
        np.log1p(ratio), ratio, out=np.ones(ratio.shape), where=ratio > 0.0
    )
    shortest = 1e-3 / (catch_rate + slip_rate + easing + growing)
    share = np.linspace(0.0, 1.0, 193)
    edges = np.sort(
        np.concatenate(
            [longest * share, shortest * (longest / shortest) ** share], axis=-1
        ),
        axis=-1,
    )
    half = 0.5 * np.diff(edges, axis=-1)[..., np.newaxis]
    age = edges[..., :-1, np.newaxis] + half * (_CATCH_NODES + 1.0)
    lost = catch_rate * age * scipy.special.exprel(-easing[..., np.newaxis] * age)
    lost += slip_rate * age * scipy.special.exprel(growing[..., np.newaxis] * age)
    alive = half * _CATCH_WEIGHTS * np.exp(-lost)
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
    """Return the bound share and force moments in steady sliding of catch bonds.

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
    lives = catch_lives(
        speed, catch_rate, catch_force, slip_rate, slip_force, bond_stiffness
    )
    return renewal(*lives, speed, bond_stiffness, rebinding_rate)


# Bell bonds loaded once, at a constant rate, until they break: rupture forces and the static peak.


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
    """Return the mean force at which a Bell bond breaks under a force that grows at a constant rate [N].

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
    z = _pace(loading_rate, zero_force_rate, bell_force, 1.0)
    return loading_rate / zero_force_rate * reduced(z, 0) if z > 0.0 else loading_rate


@law
def start_up_force(time, speed, zero_force_rate, bell_force, bond_stiffness):
    """Return the mean force of bonds that were all unstretched when sliding began, none of which rebinds.

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


def start_up_peak(speed, zero_force_rate, bell_force, bond_stiffness):
    """Return the static peak: the largest force of bonds that were unstretched at the start, without rebinding.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness : float or array
        As in ``start_up_force``.

    Returns
    -------
    StartUpPeak
        Time of the peak [s] and force per bond of the start [N]: 1/k_0 and 0 at speed 0; at high
        speeds it grows like the logarithm of the speed.

    Notes
    -----
    At ``t = W(eps)/(eps k_0)`` with eps = kappa \\|V\\|/(k_0 f_b) and Lambert's W, the force is
    ``f_b W exp(1/eps - 1/W)``. It grows by ``f_b (1 - exp(-W)) exp(1/eps - 1/W)`` for a factor of e in the speed. The
    difference in the exponent is ``(e^-W - 1)/W``, which does not cancel. A population with a share phi_rest of its
    sites bound has phi_rest times this force per site.

    Examples
    --------
    A hundred times the speed adds less than ln 100 = 4.6 Bell forces:

    >>> print("%.4f %.4f" % tuple(start_up_peak([1e2, 1e4], 1.0, 1.0, 1.0).force))
    2.5451 6.2985
    """
    tilt = lambert_w(
        np.multiply(bond_stiffness, np.abs(speed))
        / np.multiply(zero_force_rate, bell_force)
    )
    steady_force = bond_stiffness * first_moment_stretch(
        speed, zero_force_rate, bell_force, bond_stiffness
    )
    return StartUpPeak(
        np.exp(-tilt) / zero_force_rate,
        steady_force * np.exp(-scipy.special.exprel(-tilt)),
    )
