"""Profiles of stress and displacement across one contact.

Normal fields (Johnson, Contact Mechanics 3.4 and 5.5; Maugis): a contact of radius a and
indentation delta, in equilibrium or not, is Hertz's contact of that radius, indented by a^2/R, plus
a flat punch of that radius lifted by the difference, a^2/R - delta. The punch makes the tension at
the edge. At a load, ``jkr.indentation_under_load`` gives delta. Lengths along the normal
point into the half-space, pressure presses; the sphere is the paraboloid r^2/(2R).

Tangential fields: the uniform shear stress of sliding and its displacement,
``halfspace.disc_displacement``. Normal and tangential fields are uncoupled at nu = 1/2; for another
Poisson ratio their coupling is neglected.
"""

import math

import numpy as np

from sim.laws.halfspace import disc_displacement
from sim.numerics.jit import device, law


@device
def _lever(turn):
    """sin(turn) - turn cos(turn), without cancellation where it is turn^3/3."""
    if turn > 0.5:
        return math.sin(turn) - turn * math.cos(turn)
    square = turn * turn
    term = turn * square / 3.0
    total = 0.0
    for k in range(1, 9):  # terms fall as (turn^2/2k)^k: the ninth is below 1e-19 of the first
        total += term
        term *= -square / (2.0 * k * (2.0 * k + 3.0))
    return total


@device
def _opening(t):
    """t + (t^2 - 1) atan t, without cancellation where it is 4 t^3/3."""
    if t > 0.2:
        return t + (t * t - 1.0) * math.atan(t)
    square = t * t
    power = t * square
    total = 0.0
    for k in range(1, 14):  # 0.04^13 is below 1e-18
        total += power * 4.0 * k / (4.0 * k * k - 1.0)
        power *= -square
    return total


@device
def _slant(r, radius):
    """sqrt(r^2 - a^2) outside, sqrt(a^2 - r^2) inside."""
    return math.sqrt(abs(r - radius)) * math.sqrt(r + radius)


@law
def pressure(r, radius, indentation, sphere_radius, modulus):
    """Normal stress between sphere and half-space.

    Parameters
    ----------
    r : float or array
        Distance from the axis [m], at least 0.
    radius : float or array
        a [m].
    indentation : float or array
        delta [m].
    sphere_radius, modulus : float or array
        R [m], E* [Pa].

    Returns
    -------
    float or array
        p [Pa], below 0 in tension; 0 outside; at the edge itself -inf where adhesion pulls, 0 in Hertz's
        contact.

    Notes
    -----
    ``p = (2 E*/(pi R)) sqrt(a^2 - r^2) - (E*/pi) (a^2/R - delta)/sqrt(a^2 - r^2)``. Its integral is
    ``jkr.load_under_indentation``, its singularity at the edge ``-edge_intensity/sqrt(2 pi (a - r))``.

    Examples
    --------
    A contact without load presses in the middle and pulls at its edge:

    >>> p = pressure([0.0, 0.9, 1.1], 1.0, 1.0 / 3.0, 1.0, 1.0)
    >>> print("%.3f %.3f %.3f" % tuple(p))
    0.424 -0.209 0.000
    """
    if r > radius:
        return 0.0
    slant = _slant(r, radius)
    missing = radius * (radius / sphere_radius) - indentation
    hertz = 2.0 * modulus / math.pi * (slant / sphere_radius)
    return hertz if missing == 0.0 else hertz - modulus / math.pi * (missing / slant)


@law
def normal_displacement(r, radius, indentation, sphere_radius):
    """Displacement of the surface of the half-space along the normal, into it.

    Parameters
    ----------
    r, radius, indentation, sphere_radius : float or array
        Distance from the axis [m], a [m], delta [m], R [m]. The modulus does not matter.

    Returns
    -------
    float or array
        u_z [m]; below 0 the surface is raised.

    Notes
    -----
    Inside ``delta - r^2/(2R)``; outside, with a/r = sin(psi),

        ``u_z = (r^2/(2 pi R)) [sin 2 psi - 2 psi cos 2 psi] + (2/pi) (delta - a^2/R) psi``

    which is Johnson's ``(1/(pi R)) [(2a^2 - r^2) asin(a/r) + a sqrt(r^2 - a^2)]`` for Hertz, in a form
    that does not cancel far away, where it tends to P/(pi E* r).

    Examples
    --------
    The neck of a lifted sphere draws the surface up:

    >>> print(f"{normal_displacement(1.0, 1.0, -0.5, 1.0):.2f} {normal_displacement(2.0, 1.0, -0.5, 1.0):.2f}")
    -1.00 -0.28
    """
    if r <= radius:
        return indentation - 0.5 * r * (r / sphere_radius)
    turn = math.atan2(radius, _slant(r, radius))  # asin would lose half its digits at the edge
    punch = indentation - radius * (radius / sphere_radius)
    return 0.5 / math.pi * r * (r / sphere_radius) * _lever(2.0 * turn) + 2.0 / math.pi * punch * turn


@law
def gap(r, radius, indentation, sphere_radius):
    """Distance between the surfaces of sphere and half-space along the normal.

    Parameters
    ----------
    r, radius, indentation, sphere_radius : float or array
        Distance from the axis [m], a [m], delta [m], R [m].

    Returns
    -------
    float or array
        g [m]; 0 inside; never below 0 where delta <= a^2/R, that is where the edge pulls or is Hertz's.

    Notes
    -----
    ``r^2/(2R) - delta + u_z`` written without cancellation at the edge: with t = sqrt(r^2 - a^2)/a

        ``g = (a^2/(pi R)) [t + (t^2 - 1) atan t] + (2/pi) (a^2/R - delta) atan t``

    Beside the edge of a Hertzian contact it opens as (r - a)^(3/2), of an adhesive one as (r - a)^(1/2).

    Examples
    --------
    >>> print("%.2e %.2e" % tuple(gap(1.0001, 1.0, [1.0, 0.9], 1.0)))
    1.20e-06 9.01e-04
    """
    if r <= radius:
        return 0.0
    t = _slant(r, radius) / radius
    hertz = radius * (radius / sphere_radius)
    return hertz / math.pi * _opening(t) + 2.0 / math.pi * (hertz - indentation) * math.atan(t)


@law
def edge_intensity(radius, indentation, sphere_radius, modulus):
    """Stress intensity factor of the tension at the edge [Pa m^(1/2)].

    Parameters
    ----------
    radius, indentation, sphere_radius, modulus : float or array
        a [m], delta [m], R [m], E* [Pa].

    Notes
    -----
    ``K_I = E* (a^2/R - delta)/sqrt(pi a) = (P_H - P)/(2 sqrt(pi a^3))``, and ``K_I^2/(2 E*)`` is the
    energy release rate.

    Examples
    --------
    >>> print(f"{edge_intensity(1.0, 0.0, 1.0, 1.0):.4f}")
    0.5642
    """
    return modulus * (radius * (radius / sphere_radius) - indentation) / math.sqrt(math.pi * radius)


@law
def shear_stress(r, radius, stress):
    """The uniform shear stress of sliding: tau inside the contact, 0 outside [Pa].

    Parameters
    ----------
    r, radius, stress : float or array
        Distance from the axis [m], a [m], tau [Pa].

    Examples
    --------
    >>> print("%.0f %.0f" % tuple(shear_stress([0.5, 1.5], 1.0, 3e5)))
    300000 0
    """
    if r <= radius:
        return stress
    return 0.0 if r > radius else math.nan


def tangential_profiles(distance, radius, stress, shear_modulus, poisson_ratio=0.5):
    """Mean tangential displacement of a sliding contact along its two axes.

    Parameters
    ----------
    distance : float or array
        Signed distance from the centre [m].
    radius, stress, shear_modulus, poisson_ratio : float or array
        a [m], tau [Pa], G [Pa], nu [1].

    Returns
    -------
    along, across : float or array
        v(distance, 0) and v(0, distance) [m]; x is the direction of the stress.

    Examples
    --------
    The two agree in the centre and differ most outside, by a factor of two far away:

    >>> along, across = tangential_profiles([0.0, 1.0, 100.0], 1.0, 1.0, 1.0)
    >>> print("%.3f %.3f %.3f" % tuple(along / across))
    1.000 1.250 2.000
    """
    distance = np.asarray(distance, dtype=float)
    zero = np.zeros_like(distance)
    rest = (radius, stress, shear_modulus, poisson_ratio)
    return disc_displacement(distance, zero, *rest), disc_displacement(zero, distance, *rest)


def tangential_map(radius, stress, shear_modulus, poisson_ratio=0.5, points=129, extent=2.0):
    """Mean tangential displacement of a sliding contact on a square around it.

    Parameters
    ----------
    radius, stress, shear_modulus, poisson_ratio : float
        a [m], tau [Pa], G [Pa], nu [1].
    points : int
        Points on a side; an odd number has the centre among them.
    extent : float
        Half the side, in contact radii.

    Returns
    -------
    x : array, shape (points,)
        Positions along either axis [m].
    v : array, shape (points, points)
        Displacement along x [m]; axis 0 is x, axis 1 is y.

    Examples
    --------
    >>> x, v = tangential_map(1.0, 1.0, 1.0, points=5)
    >>> print(f"{x[2]:.1f} {v[2, 2]:.2f} {v[4, 2] > v[2, 4]}")
    0.0 0.75 True
    """
    x = extent * radius * np.linspace(-1.0, 1.0, points)
    return x, disc_displacement(x[:, None], x[None, :], radius, stress, shear_modulus, poisson_ratio)
