"""Bonds whose rupture rate grows with force, ``k = k_0 e^(f/f_b)`` (Bell 1978), resolved in stretch: exact.

A bond of stiffness kappa that is stretched by V t outlives the age t with probability
``S = exp(-z (e^(t k_0/z) - 1))``, where ``z = k_0 f_b/(kappa |V|)``: at z above 1 bonds open by
themselves before the sliding pulls on them, below 1 the sliding tears them off. Friction is largest
at z = 0.38 if sites rebind slowly, near z = k_0/k_on if they rebind fast, and falls like (ln V)^2/V
after it.

Everything follows from the integrals ``R_j`` of ``sim.numerics.special`` at z, which run from 0 at z = 0
(infinite speed) to 1 at z = infinity (rest, or an infinite Bell force: a constant rate).
"""

import math

import numpy as np

from sim.laws.schallamach.renewal import Lives, Peak, SiteMoments
from sim.numerics.jit import device, law
from sim.numerics.special import reduced


@device
def _pace(speed, zero_force_rate, bell_force, bond_stiffness):
    """z = k_0 f_b/(kappa |V|)."""
    return zero_force_rate * bell_force / (bond_stiffness * math.fabs(speed))


@device
def _times_z(z, order):
    """R_j/z^j, by which forces are in units of f_b: 0 at z = 0 where R_j/z^j is 0/0."""
    return 0.0 if z == 0.0 else reduced(z, order) / z**order


@law
def _life(speed, zero_force_rate, bell_force, bond_stiffness, order):
    n = int(order)
    moment = reduced(_pace(speed, zero_force_rate, bell_force, bond_stiffness), n) / zero_force_rate ** (n + 1)
    return 2.0 * moment if n == 2 else moment


def bell_lives(speed, zero_force_rate, bell_force, bond_stiffness):
    """Moments of the life of a Bell bond that is born unstretched and pulled at a constant speed.

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
    given = (speed, zero_force_rate, bell_force, bond_stiffness)
    return Lives(_life(*given, 0), _life(*given, 1), _life(*given, 2))


@law
def _bound(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    life = reduced(_pace(speed, zero_force_rate, bell_force, bond_stiffness), 0)
    return life / (life + zero_force_rate / rebinding_rate)


@law
def _force(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, order):
    n = int(order)
    z = _pace(speed, zero_force_rate, bell_force, bond_stiffness)
    cycle = reduced(z, 0) + zero_force_rate / rebinding_rate
    if z >= 1.0:  # in units of kappa V/k_0: rest and an infinite Bell force are regular
        unit, moment = bond_stiffness * math.fabs(speed) / zero_force_rate, reduced(z, n)
    else:  # in units of the Bell force: infinite speed is regular
        unit, moment = bell_force, _times_z(z, n)
    if n == 2:
        return 2.0 * moment * unit * unit / cycle
    return math.copysign(moment * unit / cycle, speed)


def bell_moments(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Bound share and force moments of Bell bonds in steady sliding.

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
    given = (speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate)
    return SiteMoments(_bound(*given), _force(*given, 1), _force(*given, 2))


@law
def bell_fraction(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Bond fraction of a Bell population in steady sliding: bonds over bonds at rest.

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
    if rebinding_rate < zero_force_rate:
        beta = rebinding_rate / zero_force_rate
        return (1.0 + beta) * life / (1.0 + beta * life)
    wait = zero_force_rate / rebinding_rate
    return (1.0 + wait) * life / (wait + life)


def bell_stress(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density):
    """Shear stress of a Bell population in steady sliding [Pa]; odd in the speed.

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
    force = _force(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, 1)
    return np.multiply(site_density, force)


@device
def _peak_pace(wait):
    """z where the force is largest, for ``wait`` = k_0/k_on: the root of d ln(force)/d ln z.

    Derivatives of the integrals are integrals again, ``R_0' z = (1 + z) R_0 - z`` and
    ``(R_1/z)' z = (1 + z) R_1/z - R_0``, so the root is as sharp as the rounding. It is at 0.384 for a
    long wait and tends to z = wait for a short one: within the bracket for every wait from 0 to infinity.
    """
    high = min(1.0, 2.0 * wait)
    low = 0.01 * high
    for _ in range(60):
        z = math.sqrt(low * high)
        life = reduced(z, 0)
        slope = 1.0 + z - z * life / reduced(z, 1) - ((1.0 + z) * life - z) / (wait + life)
        if slope > 0.0:
            low = z
        else:
            high = z
    return high


@law
def _peak_speed(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    z = _peak_pace(zero_force_rate / rebinding_rate)
    return zero_force_rate * bell_force / (bond_stiffness * z)


@law
def _peak_force(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    wait = zero_force_rate / rebinding_rate
    if wait == 0.0:
        return math.inf
    z = _peak_pace(wait)
    return bell_force * _times_z(z, 1) / (wait + reduced(z, 0))


def bell_peak(zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density):
    """Friction maximum of a Bell population: the largest steady stress at any speed.

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
    given = (zero_force_rate, bell_force, bond_stiffness, rebinding_rate)
    return Peak(_peak_speed(*given), np.multiply(site_density, _peak_force(*given)))


@law
def bell_critical_speed(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Speed at which half of the bonds of a Bell population are left [m/s].

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
