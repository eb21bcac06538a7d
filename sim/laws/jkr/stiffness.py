"""Adhesive contact behind a spring of stiffness k: pull-off, load, indentation and energy release rate.

The displacement ``Delta = delta + P/k`` of the base is the indentation plus what the load shortens the
spring by. An infinite stiffness is an indentation; towards zero stiffness, with ``k Delta`` kept, it
becomes a load; at k = 0 no displacement can load the sphere, P = 0.

Let a_g be the radius at which the contact at fixed grips ends, h = a_g^2/R and b = 4 E* a_g/3. With
sqrt(a) = x sqrt(a_g) an equilibrium has ``delta = h (x^4 - 4x)`` and ``P = b h (x^6 - 6x^3)``, so that
with g = k/(k + b) the displacement is

    ``g Delta/h = F(x) = g (x^4 - 4x) + (1 - g) (x^6 - 6x^3)``

a sextic in sqrt(a) whose only parameter g runs from 0 at a load to 1 at fixed grips.
"""

import math
from typing import NamedTuple

import numpy as np

from sim.laws.jkr.scales import fold_radius, series_shares
from sim.numerics.jit import device, law


class PullOff(NamedTuple):
    """Last equilibrium before pull-off: radius [m], load [N], indentation [m]."""

    radius: np.ndarray
    load: np.ndarray
    indentation: np.ndarray


@device
def fold_root(grips, load):
    """Minimum over x > 0 of F for g = ``grips`` and 1 - g = ``load``: from 1 at grips to 3^(1/3) at a load.

    x is the root of ``2 g (x^3 - 1) + 3 (1 - g) x^2 (x^3 - 3)``: a rational function right to 5e-4, one
    step of Halley's method (1e-9) and one of Newton's. No branch and no call, for vector instructions.
    """
    x = (1.0001867 + load * (3.79243383 + 12.48194754 * load)) / (1.0 + load * (2.83851392 + 8.14055122 * load))
    cube = x * x * x
    value = 2.0 * grips * (cube - 1.0) + 3.0 * load * (x * x) * (cube - 3.0)
    slope = 6.0 * grips * (x * x) + 3.0 * load * x * (5.0 * cube - 6.0)
    bend = 12.0 * grips * x + 6.0 * load * (10.0 * cube - 3.0)
    x -= 2.0 * value * slope / (2.0 * slope * slope - value * bend)
    cube = x * x * x
    value = 2.0 * grips * (cube - 1.0) + 3.0 * load * (x * x) * (cube - 3.0)
    slope = 6.0 * grips * (x * x) + 3.0 * load * x * (5.0 * cube - 6.0)
    return x - value / slope


@device
def fold_level(root, grips, load):
    """F at the fold: from -9 at a load to -3 at fixed grips."""
    cube = root * root * root
    return grips * root * (cube - 4.0) + load * cube * (cube - 6.0)


@device
def _fold(stiffness, work, sphere_radius, modulus):
    """x_f and a_g of the last contact, with g and 1 - g; x_f is nan for a negative stiffness, 0 where w <= 0."""
    if not stiffness >= 0.0:
        return math.nan, 1.0, 1.0, 0.0
    if work <= 0.0:
        return 0.0, 1.0, 1.0, 0.0
    unit = fold_radius(work, sphere_radius, modulus)
    grips, load = series_shares(stiffness, 4.0 / 3.0 * modulus * unit)
    return fold_root(grips, load), unit, grips, load


@law
def pull_off_displacement(stiffness, work, sphere_radius, modulus):
    """Lowest displacement that an adhesive contact bears behind a spring [m]; 0 where w <= 0.

    Parameters
    ----------
    stiffness, work, sphere_radius, modulus : float or array
        k [N/m], 0 to inf, w [J/m^2], R [m], E* [Pa].

    Returns
    -------
    float or array
        Delta [m], the indentation plus load/k of ``pull_off_at_stiffness``; ``pull_off_indentation``
        at k = inf; -inf at k = 0, where no displacement can pull. ``radius_at_displacement`` is nan just below it.

    Examples
    --------
    The softer the spring, the further the base must go back, though the contact itself ends sooner:

    >>> stiff, soft = pull_off_displacement([1e4, 100.0], 0.042, 2e-3, 6.4e6)
    >>> print(f"{stiff:.2e} {soft:.2e}")
    -7.33e-07 -4.35e-06
    """
    root, unit, grips, load = _fold(stiffness, work, sphere_radius, modulus)
    return fold_level(root, grips, load) * (unit * (unit / sphere_radius) / grips) + 0.0  # no -0


@law
def _pull_off(stiffness, work, sphere_radius, modulus, which):
    """Field 0, 1 or 2 of ``PullOff``."""
    root, unit, _, _ = _fold(stiffness, work, sphere_radius, modulus)
    if which == 0.0:
        return unit * root * root
    cube = root * root * root
    if which == 1.0:
        return math.pi * work * sphere_radius * (cube * (cube - 6.0) / 6.0) + 0.0  # no -0
    return unit * (unit / sphere_radius) * (root * (cube - 4.0)) + 0.0


def pull_off_at_stiffness(stiffness, work, sphere_radius, modulus) -> PullOff:
    """Last equilibrium of a contact that is pulled off through a spring of given stiffness.

    Parameters
    ----------
    stiffness, work, sphere_radius, modulus : float or array
        k [N/m], 0 to inf, w [J/m^2], R [m], E* [Pa].

    Returns
    -------
    PullOff
        Its radius [m], load [N] and indentation [m]; all 0 where w <= 0, nan for a negative stiffness.

    Notes
    -----
    The displacement of the equilibrium with radius a is least where ``P'(a) + k delta'(a) = 0``. That is
    where the load is least (-3/2 pi w R) for k = 0, where the indentation is (5/9 of that load) for
    k = inf, and between the two otherwise.

    Examples
    --------
    At k = 5 (pi w R K^2)^(1/3), K = 4 E*/3, all three are rational in Maugis's units:

    >>> last = pull_off_at_stiffness(5.0, 1.0 / np.pi, 1.0, 0.75)
    >>> print("%.6f %.6f %.6f" % last)
    0.666667 -1.037037 -0.888889
    """
    return PullOff(*(_pull_off(stiffness, work, sphere_radius, modulus, which) for which in range(3)))


@law
def load_under_displacement(radius, displacement, stiffness, sphere_radius, modulus):
    """Load of any contact, in equilibrium or not, of given radius behind a spring [N].

    Parameters
    ----------
    radius, displacement, stiffness, sphere_radius, modulus : float or array
        a [m], Delta [m], k [N/m] from 0 (no load) to inf (an indentation), R [m], E* [Pa].

    Notes
    -----
    ``P = p (Delta - a^2/(3R))/(1 + p/k)``: a contact of fixed radius is a spring of stiffness
    p = 2 E* a, in series with the other one.

    Examples
    --------
    A spring as stiff as the contact takes half of the displacement:

    >>> print(f"{load_under_displacement(1.0, 1.0, [2.0, float('inf')], 1.0, 1.0).round(4)}")
    [0.6667 1.3333]
    """
    punch = 2.0 * modulus * radius
    if not stiffness >= 0.0:
        return math.nan
    if stiffness == 0.0:
        return 0.0 * displacement * punch
    return punch * (displacement - radius * (radius / sphere_radius) / 3.0) / (1.0 + punch / stiffness)


@law
def indentation_under_displacement(radius, displacement, stiffness, sphere_radius, modulus):
    """Indentation of any contact, in equilibrium or not, of given radius behind a spring [m].

    Parameters
    ----------
    radius, displacement, stiffness, sphere_radius, modulus : float or array
        a [m], Delta [m], k [N/m] from 0 to inf, R [m], E* [Pa].

    Notes
    -----
    ``delta = g Delta + (1 - g) a^2/(3R)`` with ``g = k/(k + 2 E* a)``: between the displacement and the
    depth to which an unloaded contact of that radius sinks, its value at k = 0.

    Examples
    --------
    >>> print(f"{indentation_under_displacement(1.0, 1.0, [2.0, float('inf')], 1.0, 1.0).round(4)}")
    [0.6667 1.    ]
    """
    grips, load = series_shares(stiffness, 2.0 * modulus * radius)
    if not stiffness >= 0.0:
        return math.nan
    return grips * displacement + load * (radius * (radius / sphere_radius) / 3.0)


@law
def energy_release_rate_at_displacement(radius, displacement, stiffness, sphere_radius, modulus):
    """Elastic energy released per area by a shrinking contact behind a spring [J/m^2].

    Parameters
    ----------
    radius, displacement, stiffness, sphere_radius, modulus : float or array
        a [m], Delta [m], k [N/m] from 0 to inf, R [m], E* [Pa].

    Notes
    -----
    ``E* (delta - a^2/R)^2/(2 pi a)`` as at an indentation, with the indentation of that displacement:
    ``a^2/R - delta = g (a^2/R - Delta) + (1 - g) 2a^2/(3R)``, g = k/(k + 2 E* a). The energy of the
    spring is included.

    Examples
    --------
    >>> a = 1e-4
    >>> between = energy_release_rate_at_displacement(a, 1e-6, [0.0, 1e3, float("inf")], 2e-3, 6.4e6)
    >>> print("%.3f %.3f %.3f" % tuple(between))
    0.113 0.134 0.163
    """
    grips, load = series_shares(stiffness, 2.0 * modulus * radius)
    if not stiffness >= 0.0:
        return math.nan
    hertz = radius * (radius / sphere_radius)
    missing = grips * (hertz - displacement) + load * (2.0 / 3.0 * hertz)
    return missing * modulus / (2.0 * math.pi * radius) * missing
