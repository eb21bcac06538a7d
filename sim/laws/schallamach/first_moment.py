"""Bell bonds in mean field, every bond at the mean stretch: closed forms by Lambert's W.

The first-moment closure of a population follows the bound share phi and the mean stretch x,

    ``dphi/dt = k_on (1 - phi) - k phi``,  ``dx/dt = V - x k_on (1 - phi)/phi``,  ``k = k_0 e^(kappa x/f_b)``

and neglects that stretched bonds break first. Its friction maximum is too high, by 24 to 55 %
for k_on/k_0 from 0.1 to 1000 (``bell_peak`` is exact), at a speed right to 7 %. These are the steady
states of that closure, not of bonds; for those see ``bell_moments``.
"""

import math

import numpy as np

from sim.laws.schallamach.renewal import Peak
from sim.laws.schallamach.stability import onset_behind
from sim.numerics.jit import device, law
from sim.numerics.special import lambert

#: Frequencies over the sum of the rates among which oscillations are looked for.
_SLOWEST, _FASTEST = 1e-4, 30.0


@device
def steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness):
    """Steady stretch in units of f_b/kappa: W(eps)."""
    return lambert(bond_stiffness * math.fabs(speed) / (zero_force_rate * bell_force))


@device
def _stretch(tilt, speed, zero_force_rate, bell_force, bond_stiffness):
    """x = W f_b/kappa, or what is the same, V/k: the second also for an infinite Bell force."""
    if tilt > 1.0:
        return math.copysign(tilt * bell_force / bond_stiffness, speed)
    return speed / zero_force_rate * math.exp(-tilt)


@law
def first_moment_stretch(speed, zero_force_rate, bell_force, bond_stiffness):
    """Mean stretch of the bonds of a mean-field Bell population in steady sliding [m].

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
    return _stretch(tilt, speed, zero_force_rate, bell_force, bond_stiffness)


@law
def first_moment_fraction(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Bond fraction of a mean-field Bell population in steady sliding: bonds over bonds at rest [1].

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
    if rebinding_rate == math.inf:
        return 1.0
    growth = math.exp(steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness))
    return (rebinding_rate + zero_force_rate) / (rebinding_rate + zero_force_rate * growth)


@law
def _force(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    tilt = steady_tilt(speed, zero_force_rate, bell_force, bond_stiffness)
    wait = zero_force_rate / rebinding_rate
    if tilt == math.inf and wait > 0.0:
        return 0.0
    stretch = _stretch(tilt, speed, zero_force_rate, bell_force, bond_stiffness)
    return bond_stiffness * stretch / (1.0 + wait * math.exp(tilt))


def first_moment_stress(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density):
    """Shear stress of a mean-field Bell population in steady sliding [Pa]; odd in the speed.

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
    return np.multiply(site_density, _force(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate))


@law
def _peak_speed(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    tilt = 1.0 + lambert(rebinding_rate / zero_force_rate / math.e)
    return zero_force_rate * bell_force / bond_stiffness * tilt * math.exp(tilt)


@law
def _peak_force(zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    # the stiffness only broadcasts
    return bell_force * lambert(rebinding_rate / zero_force_rate / math.e)


def first_moment_peak(zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density):
    """Friction maximum of a mean-field Bell population.

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
    given = (zero_force_rate, bell_force, bond_stiffness, rebinding_rate)
    return Peak(_peak_speed(*given), np.multiply(site_density, _peak_force(*given)))


def first_moment_onset(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density, body):
    """Stiffness of a spring below which a mean-field Bell population oscillates at a speed.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate, site_density : float or array
        As in ``first_moment_stress``.
    body : Body
        The body behind the spring, and its contact.

    Returns
    -------
    Onset
        Stiffness [N/m], infinite where no spring is stiff enough, and frequency [rad/s]; nan where every spring is.

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
    tilt = np.abs(first_moment_stretch(speed, zero_force_rate, bell_force, bond_stiffness) / unit)
    rate = zero_force_rate * np.exp(tilt)
    bound = rebinding_rate / (rebinding_rate + rate)
    density = site_density * bond_stiffness * bound

    def answer(frequency):
        turns = 1j * frequency
        own = turns * (turns + rebinding_rate + 2.0 * rate) + rate * (rebinding_rate + rate) * (1.0 + tilt)
        stretched = density * turns * (turns + rebinding_rate + (1.0 - tilt) * rate) / own
        return stretched, -rate * turns / own / unit

    pace = rebinding_rate + (1.0 + tilt) * rate
    return onset_behind(answer, speed, density * tilt * unit, (_SLOWEST * pace, _FASTEST * pace), body)


def first_moment_amplitude(speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate):
    """Growth of the oscillations of a mean-field Bell population behind a spring beyond their onset.

    Parameters
    ----------
    speed, zero_force_rate, bell_force, bond_stiffness, rebinding_rate : float or array
        As in ``first_moment_stress``.

    Returns
    -------
    float or array
        Amplitude of friction over its mean [1], divided by sqrt(1 - K/K_c) for a spring K just below that of the onset;
        nan where oscillations set in suddenly, with an amplitude that does not vanish with K_c - K, and where there
        is no onset.

    Notes
    -----
    Without mass, behind a contact of constant area that does not yield,

        ``N' = k_on (1 - N) - k N``,  ``x' = K (V - k x)/(K + N) - k_on x (1 - N)/N + k x``,  ``k = k_0 e^x``

    for the share N bound and x the stretch over f_b/kappa. The oscillations' complex amplitude z grows at the onset
    with ``z' = (sigma + i omega) z + c z |z|^2`` (Kuznetsov, Elements of Applied Bifurcation Theory, 3.5): gradually if
    the real part of c is negative, then to |z|^2 = -sigma/Re c. It changes its sign at 20.37 times the speed
    k_0 f_b/kappa if k_on = k_0.

    Examples
    --------
    Fast sliding begins to oscillate gradually, slow sliding suddenly:

    >>> print("%.4f %.4f" % tuple(first_moment_amplitude([100.0, 10.0], 1.0, 1.0, 1.0, 1.0)))
    6.3664 nan
    """
    x = np.abs(bond_stiffness * first_moment_stretch(speed, zero_force_rate, bell_force, bond_stiffness) / bell_force)
    binding = np.divide(rebinding_rate, zero_force_rate)
    falls = (x - 1.0) * np.exp(x) > binding
    x = np.where(falls, x, 1.0)
    k = np.exp(x)
    n = binding / (binding + k)
    share = np.where(falls, (x * k - binding - k) / ((1.0 + x) * k), 0.5)  # K/(K + n) at the onset
    # derivatives, by the letters: of K/(K + n), of -k_on (1/n - 1), and of V - k x over x
    q_n, r_n, p_x = (share - 1.0) * share / n, binding / n**2, -(1.0 + x) * k
    q_nn, r_nn, r_nnn = 2.0 * q_n**2 / share, -2.0 * r_n / n, 6.0 * r_n / n**2
    by_n, by_x = (-binding - k, x * r_n), (-k * n, x * k + p_x * share)
    turns = np.sqrt(np.where(falls, by_n[0] * by_x[1] - by_x[0] * by_n[1], 1.0))
    right, left = (1.0, (1j * turns - by_n[0]) / by_x[0]), (1.0, (1j * turns - by_n[0]) / by_n[1])
    back, scale = tuple(map(np.conj, right)), left[0] * right[0] + left[1] * right[1]

    def projected(of_bound, of_stretch):
        return (left[0] * of_bound + left[1] * of_stretch) / scale

    def second(u, v):
        crossed, curved = u[0] * v[1] + u[1] * v[0], u[1] * v[1]
        of_stretch = x * r_nn * u[0] * v[0] + (p_x * q_n + r_n) * crossed + (2.0 + x) * k * (1.0 - share) * curved
        return projected(-k * (n * curved + crossed), of_stretch)

    def third(u, v, w):
        once = u[0] * v[1] * w[1] + u[1] * v[0] * w[1] + u[1] * v[1] * w[0]
        twice = u[0] * v[0] * w[1] + u[0] * v[1] * w[0] + u[1] * v[0] * w[0]
        curved = u[1] * v[1] * w[1]
        of_stretch = x * r_nnn * u[0] * v[0] * w[0] + (p_x * q_nn + r_nn) * twice
        of_stretch = of_stretch - (2.0 + x) * k * q_n * once + (3.0 + x) * k * (1.0 - share) * curved
        return projected(-k * (n * curved + once), of_stretch)

    bends = np.real(0.5j * second(right, right) * second(right, back) / turns + 0.5 * third(right, right, back))
    grows = -0.5 * p_x * share * (1.0 - share)
    size = np.sqrt(grows / np.where(falls & (bends < 0.0), -bends, np.nan))
    return (2.0 * size * np.abs(x * right[0] + n * right[1]) / (n * x))[()]
