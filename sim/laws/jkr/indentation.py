"""Adhesive contact at a given indentation ("fixed grips")."""

import math

import numpy as np

from sim.laws.jkr.displacement import radius_at_displacement
from sim.laws.jkr.scales import fold_indentation
from sim.numerics.jit import law


def radius_at_indentation(indentation, work, sphere_radius, modulus):
    """Contact radius at a given indentation ("fixed grips").

    Parameters
    ----------
    indentation : float or array
        delta [m]; below 0 the sphere is lifted and hangs by a neck.
    work : float or array
        Work of adhesion w [J/m^2].
    sphere_radius : float or array
        R [m].
    modulus : float or array
        E* [Pa].

    Returns
    -------
    float or array
        a [m]; nan below ``pull_off_indentation``; Hertz's radius where w <= 0.

    Notes
    -----
    ``a^2/R - delta = sqrt(2 pi w a/E*)`` is a quartic in sqrt(a), ``x^4 - c x - d = 0``, with a
    double root at the fold a_f, delta_f = -3 a_f^2/R. Measured from there, sqrt(a) = (1 + t)
    sqrt(a_f) and delta = delta_f (1 - excess), it holds no other parameter:

        ``t^2 (6 + 4 t + t^2) = 3 excess``

    The wider, stable contact is its one root t >= 0, for lifted and pressed spheres alike: that of
    ``radius_at_displacement`` behind an infinite stiffness. Its accuracy ends only where the excess itself
    cancels: at a relative distance d from the fold, a relative change e of an input moves the radius by
    about e/sqrt(d).

    Examples
    --------
    A sphere lifted above the surface keeps its contact up to a point:

    >>> a = radius_at_indentation([0.0, -6e-7, -8e-7], 0.042, 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    5.48e-05 3.44e-05 nan
    """
    return radius_at_displacement(indentation, np.inf, work, sphere_radius, modulus)


@law
def indentation_at_radius(radius, work, sphere_radius, modulus):
    """Indentation of the equilibrium contact with a given radius [m]; Hertz's where w <= 0.

    Parameters
    ----------
    radius, work, sphere_radius, modulus : float or array
        a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``delta = a^2/R - sqrt(2 pi w a/E*)``.

    Examples
    --------
    >>> print(f"{indentation_at_radius(1e-4, 0.0, 2e-3, 6.4e6):.1e}")
    5.0e-06
    """
    if not radius >= 0.0:
        return math.nan
    hertz = radius * (radius / sphere_radius)
    if work <= 0.0:
        return hertz
    return hertz - math.sqrt(2.0 * math.pi * work * (radius / modulus))


@law
def load_under_indentation(radius, indentation, sphere_radius, modulus):
    """Load of any contact, in equilibrium or not, of given radius and indentation [N].

    Parameters
    ----------
    radius, indentation, sphere_radius, modulus : float or array
        a [m], delta [m], R [m], E* [Pa].

    Notes
    -----
    ``P = 2 E* a (delta - a^2/(3R))``: MCD's ``F = E* (2 s a + 2 a^3/(3R))`` with P = -F.

    Examples
    --------
    Hertz's contact carries two thirds of what a flat punch of its radius would:

    >>> print(f"{load_under_indentation(1.0, 1.0, 1.0, 1.0):.4f}")
    1.3333
    """
    return 2.0 * modulus * radius * (indentation - radius * (radius / sphere_radius) / 3.0)


@law
def pull_off_indentation(work, sphere_radius, modulus):
    """Lowest indentation that an adhesive contact bears at fixed grips [m]; 0 where w <= 0.

    Parameters
    ----------
    work, sphere_radius, modulus : float or array
        w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``-3 a^2/R`` at ``a = (pi w R^2/(8 E*))^(1/3)``. The load there is 5/9 of the pull-off load.

    Examples
    --------
    >>> print(f"{pull_off_indentation(0.042, 2e-3, 6.4e6):.3e}")
    -7.105e-07
    """
    if work <= 0.0:
        return 0.0
    return fold_indentation(work, sphere_radius, modulus)
