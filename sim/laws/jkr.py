"""Adhesive contact of a sphere with an elastic half-space: Johnson, Kendall & Roberts, and Hertz.

Loads press: a load P above 0 pushes the sphere into the half-space, P = -F for the tractive force F
of Menga, Carbone & Dini (MCD); an indentation delta is -s for their separation s. ``modulus`` is
the contact modulus E* = E/(1 - nu^2) throughout. The contact with radius a and work of adhesion w
obeys ``energy_release_rate = w``; of its two solutions every law here returns the stable one, the
wider.

Where no equilibrium exists (pulled beyond the fold, or pulled at all without adhesion) the answer
is nan. A work of zero or below, as when stress fluctuations outweigh adhesion, leaves Hertz's
contact. A nan that the answer depends on makes it nan; nothing raises.
"""

import math

import numpy as np

from sim.jit import device, law
from sim.roots import cube_root


@device
def _pull(work, sphere_radius):
    """3 pi w R [N], twice the pull-off force."""
    return 3.0 * math.pi * work * sphere_radius


@device
def _fold_radius(work, sphere_radius, modulus):
    """Radius at which the contact at a given indentation ends: (pi w R^2 / 8 E*)^(1/3) [m]."""
    return np.cbrt(math.pi * work * sphere_radius * (sphere_radius / (8.0 * modulus)))


@device
def _fold_indentation(work, sphere_radius, modulus):
    """Indentation at which it ends: -3 a^2/R with a the radius there [m]."""
    a = _fold_radius(work, sphere_radius, modulus)
    return -3.0 * a * (a / sphere_radius)


@device
def _above_fold(excess):
    """The root t >= 0 of t^4 + 4 t^3 + 6 t^2 = 3 excess, for a finite excess >= 0.

    The left side grows and is convex, so Newton's steps from a point right of the root go left and
    never pass it; each of the three terms alone gives such a point. A step that no longer goes
    left is rounding, and ends the search.
    """
    t = min(math.sqrt(0.5 * excess), np.cbrt(0.75 * excess), math.sqrt(math.sqrt(3.0 * excess)))
    for _ in range(60):
        slope = 4.0 * t * (t * (t + 3.0) + 3.0)
        if slope <= 0.0:
            break
        lower = t - (t * t * (t * (t + 4.0) + 6.0) - 3.0 * excess) / slope
        if not lower < t:
            break
        t = lower
    return t


@law
def hertz_radius_at_load(load, sphere_radius, modulus):
    """Contact radius without adhesion at a load [m]: ``(3 P R / 4 E*)^(1/3)``; nan if pulled.

    Parameters
    ----------
    load, sphere_radius, modulus : float or array
        P [N], R [m], E* [Pa].

    Examples
    --------
    >>> print(f"{hertz_radius_at_load(4.0 / 3.0, 1.0, 1.0):.3f}")
    1.000
    """
    return cube_root(0.75 * (sphere_radius / modulus) * load)


@law
def hertz_radius_at_indentation(indentation, sphere_radius):
    """Contact radius without adhesion at an indentation [m]: ``sqrt(R delta)``; nan if lifted.

    Parameters
    ----------
    indentation, sphere_radius : float or array
        delta [m], R [m].

    Examples
    --------
    >>> print(f"{hertz_radius_at_indentation(4e-6, 1e-2):.1e}")
    2.0e-04
    """
    return math.sqrt(indentation) * math.sqrt(sphere_radius)


@law
def radius_at_load(load, work, sphere_radius, modulus):
    """Contact radius at a given load.

    Parameters
    ----------
    load : float or array
        P, compression positive [N].
    work : float or array
        Work of adhesion w [J/m^2].
    sphere_radius : float or array
        R [m].
    modulus : float or array
        E* [Pa].

    Returns
    -------
    float or array
        a [m]; nan below the pull-off load -3/2 pi w R; Hertz's radius where w <= 0.

    Notes
    -----
    ``a^3 = (3R/4E*) [P + c + sqrt(c (2P + c))]``, c = 3 pi w R (Johnson, Kendall & Roberts 1971; MCD
    at fixed load), with the square root of the product taken factor by factor lest it overflow.
    Towards the fold 2P + c cancels: at a relative distance d from it, a relative change e of the load
    or the work moves the radius by about e/sqrt(d).

    Examples
    --------
    Without load a sphere of 2 mm on PDMS still makes a contact, and pulling shrinks it by at most
    the factor (1/4)^(1/3) = 0.63:

    >>> rest = radius_at_load(0.0, 0.042, 2e-3, 6.4e6)
    >>> last = radius_at_load(pull_off_load(0.042, 2e-3), 0.042, 2e-3, 6.4e6)
    >>> print(f"{rest:.3e} {last / rest:.3f}")
    7.186e-05 0.630
    """
    # no branch but selections: the compiler turns them into vector instructions
    pull = 0.0 if work <= 0.0 else _pull(work, sphere_radius)
    root = 0.0 if pull == 0.0 else math.sqrt(pull) * math.sqrt(2.0 * load + pull)
    return cube_root(0.75 * (sphere_radius / modulus) * (load + pull + root))


@law
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

    The wider, stable contact is its one root t >= 0, for lifted and pressed spheres alike, found
    by Newton's method from the right. No scale can overflow in it, and its accuracy ends only
    where the excess itself cancels: at a relative distance d from the fold, a relative change e
    of an input moves the radius by about e/sqrt(d).

    Examples
    --------
    A sphere lifted above the surface keeps its contact up to a point:

    >>> a = radius_at_indentation([0.0, -6e-7, -8e-7], 0.042, 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    5.48e-05 3.44e-05 nan
    """
    if work <= 0.0:
        return math.sqrt(indentation) * math.sqrt(sphere_radius)
    fold = _fold_indentation(work, sphere_radius, modulus)
    if not indentation >= fold:
        return math.nan
    excess = (indentation - fold) / -fold
    if not excess < 1e300:  # adhesion is lost in rounding: its scale is below the smallest number
        return math.sqrt(indentation) * math.sqrt(sphere_radius)
    stretch = 1.0 + _above_fold(excess)
    return _fold_radius(work, sphere_radius, modulus) * stretch * stretch


@law
def load_at_radius(radius, work, sphere_radius, modulus):
    """Load of the equilibrium contact with a given radius [N]; Hertz's where w <= 0.

    Parameters
    ----------
    radius, work, sphere_radius, modulus : float or array
        a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``P = 4 E* a^3/(3R) - sqrt(8 pi w E* a^3)``.

    Examples
    --------
    >>> rest = radius_at_load(0.0, 0.042, 2e-3, 6.4e6)
    >>> print(f"{abs(load_at_radius(rest, 0.042, 2e-3, 6.4e6)) < 1e-15}")
    True
    """
    if not radius >= 0.0:
        return math.nan
    hertz = 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    if work <= 0.0:
        return hertz
    return hertz - radius * math.sqrt(8.0 * math.pi * work * modulus * radius)


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
def indentation_under_load(radius, load, sphere_radius, modulus):
    """Indentation of any contact, in equilibrium or not, of given radius and load [m].

    Parameters
    ----------
    radius, load, sphere_radius, modulus : float or array
        a [m], P [N], R [m], E* [Pa].

    Notes
    -----
    ``delta = P/(2 E* a) + a^2/(3R)``: MCD's ``s = F/(2 E* a) - a^2/(3R)`` with delta = -s.

    Examples
    --------
    >>> print(f"{indentation_under_load(1.0, 4.0 / 3.0, 1.0, 1.0):.4f}")
    1.0000
    """
    return load / (2.0 * modulus * radius) + radius * (radius / sphere_radius) / 3.0


@law
def energy_release_rate(radius, load, sphere_radius, modulus):
    """Elastic energy released per area by a shrinking contact at a load [J/m^2].

    Parameters
    ----------
    radius, load, sphere_radius, modulus : float or array
        a [m], P [N], R [m], E* [Pa].

    Notes
    -----
    ``(P_H - P)^2 / (8 pi E* a^3)`` with P_H = 4 E* a^3/(3R) the load that Hertz's contact of that
    radius needs. It equals w in equilibrium; the contact closes where it is below w, and opens
    where it is above. It does not know the sign of P_H - P: below P_H the edge is pulled open, above
    it the bodies would overlap at the edge.

    Examples
    --------
    >>> a = radius_at_load(4e-3, 0.042, 2e-3, 6.4e6)
    >>> print(f"{energy_release_rate(a, 4e-3, 2e-3, 6.4e6):.6f}")
    0.042000
    """
    hertz = 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    missing = hertz - load
    return missing / (8.0 * math.pi * modulus * radius * radius) * (missing / radius)


@law
def energy_release_rate_at_indentation(radius, indentation, sphere_radius, modulus):
    """Elastic energy released per area by a shrinking contact at an indentation [J/m^2].

    Parameters
    ----------
    radius, indentation, sphere_radius, modulus : float or array
        a [m], delta [m], R [m], E* [Pa].

    Notes
    -----
    ``E* (delta - a^2/R)^2 / (2 pi a)``: the same number as ``energy_release_rate`` at the load that
    goes with it, for the growth of area alone decides it, not the control.

    Examples
    --------
    >>> a = radius_at_indentation(1e-6, 0.042, 2e-3, 6.4e6)
    >>> print(f"{energy_release_rate_at_indentation(a, 1e-6, 2e-3, 6.4e6):.6f}")
    0.042000
    """
    missing = radius * (radius / sphere_radius) - indentation
    return missing * modulus / (2.0 * math.pi * radius) * missing


@law
def pull_off_load(work, sphere_radius):
    """Lowest load that an adhesive contact bears [N]: ``-3/2 pi w R``; 0 where w <= 0.

    Parameters
    ----------
    work, sphere_radius : float or array
        w [J/m^2], R [m]. The modulus does not matter.

    Examples
    --------
    >>> print(f"{pull_off_load(0.042, 2e-3):.3e}")
    -3.958e-04
    """
    if work <= 0.0:
        return 0.0
    return -0.5 * _pull(work, sphere_radius)


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
    return _fold_indentation(work, sphere_radius, modulus)


@law
def potential_at_indentation(separation, stress, radius, work, sphere_radius, modulus):
    """The paper's potential H of the contact at a fixed separation and uniform shear stress [J].

    Parameters
    ----------
    separation, stress, radius, work, sphere_radius, modulus : float or array
        s = -delta [m], tau [Pa], a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``H = E* (a s^2 + 2 a^3 s/(3R) + a^5/(5R^2)) - 4 tau^2 a^3/E* - pi w a^2``: normal elastic
    energy, then tau W/2 - tau W (elastic energy less the Legendre term of the uniform stress, at
    nu = 1/2), then adhesion. ``dH/ds`` is the tractive force.

    Examples
    --------
    >>> print(f"{potential_at_indentation(0.0, 1.0, 1.0, 0.0, 1.0, 1.0):.2f}")
    -3.80
    """
    a, s, curvature = radius, separation, 1.0 / sphere_radius
    normal = a * s * s + 2.0 / 3.0 * a**3 * s * curvature + 0.2 * a**5 * curvature * curvature
    return modulus * normal - 4.0 * stress * stress * a**3 / modulus - math.pi * work * a * a


@law
def potential_at_load(tractive_force, stress, radius, work, sphere_radius, modulus):
    """The paper's potential G of the contact at a fixed load and uniform shear stress [J].

    Parameters
    ----------
    tractive_force, stress, radius, work, sphere_radius, modulus : float or array
        F = -P [N], tau [Pa], a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``G = H - F s = -F^2/(4 E* a) + F a^2/(3R) + 4 E* a^5/(45 R^2) - 4 tau^2 a^3/E* - pi w a^2``.
    The sign of the second term is as the Legendre transform gives it.

    Examples
    --------
    >>> print(f"{potential_at_load(0.0, 0.0, 1.0, 0.0, 1.0, 45.0):.2f}")
    4.00
    """
    a, force, curvature = radius, tractive_force, 1.0 / sphere_radius
    normal = -force * force / (4.0 * modulus * a) + force * a * a * curvature / 3.0
    normal += 4.0 / 45.0 * modulus * a**5 * curvature * curvature
    return normal - 4.0 * stress * stress * a**3 / modulus - math.pi * work * a * a


@law
def potential_slope_at_indentation(separation, stress, radius, work, sphere_radius, modulus):
    """dH/da at fixed separation and stress [J/m].

    Parameters
    ----------
    separation, stress, radius, work, sphere_radius, modulus : float or array
        s = -delta [m], tau [Pa], a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``E* (s + a^2/R)^2 - 12 tau^2 a^2/E* - 2 pi w a``. In equilibrium it is not zero but equals the
    work of the uniform stress, ``-12 tau^2 a^2/E*``, which leaves ``energy_release_rate = w``.

    Examples
    --------
    >>> print(f"{potential_slope_at_indentation(0.0, 1.0, 1.0, 0.0, 1.0, 1.0):.1f}")
    -11.0
    """
    missing = separation + radius * (radius / sphere_radius)
    shear = 12.0 * stress * stress * radius * radius / modulus
    return modulus * missing * missing - shear - 2.0 * math.pi * work * radius


@law
def potential_slope_at_load(tractive_force, stress, radius, work, sphere_radius, modulus):
    """dG/da at fixed load and stress [J/m].

    Parameters
    ----------
    tractive_force, stress, radius, work, sphere_radius, modulus : float or array
        F = -P [N], tau [Pa], a [m], w [J/m^2], R [m], E* [Pa].

    Notes
    -----
    ``(F + 4 E* a^3/(3R))^2/(4 E* a^2) - 12 tau^2 a^2/E* - 2 pi w a``; see
    ``potential_slope_at_indentation``.

    Examples
    --------
    >>> print(f"{potential_slope_at_load(0.0, 1.0, 1.0, 0.0, 1.0, 9.0):.4f}")
    2.6667
    """
    missing = tractive_force + 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    shear = 12.0 * stress * stress * radius * radius / modulus
    return missing / (4.0 * modulus * radius) * (missing / radius) - shear - 2.0 * math.pi * work * radius
