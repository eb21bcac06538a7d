"""Energy release rate of the contact, and the potentials of Menga, Carbone & Dini (MCD)."""

import math

from sim.numerics.jit import law


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
    where it is above. The sign of P_H - P is lost in the square: below P_H the edge is pulled open,
    above it the bodies would overlap at the edge.

    Examples
    --------
    >>> from sim.laws import jkr
    >>> a = jkr.radius_at_load(4e-3, 0.042, 2e-3, 6.4e6)
    >>> print(f"{energy_release_rate(a, 4e-3, 2e-3, 6.4e6):.6f}")
    0.042000
    """
    hertz = 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    missing = hertz - load
    return missing / (8.0 * math.pi * modulus * radius * radius) * (missing / radius)


@law
def energy_release_rate_at_indentation(radius, indentation, sphere_radius, modulus):
    """Elastic energy released per area at an indentation [J/m^2]; otherwise as ``energy_release_rate``.

    Notes
    -----
    ``E* (delta - a^2/R)^2 / (2 pi a)``: the same number as at the load that goes with it, whatever the control.

    Examples
    --------
    >>> from sim.laws import jkr
    >>> a = jkr.radius_at_indentation(1e-6, 0.042, 2e-3, 6.4e6)
    >>> print(f"{energy_release_rate_at_indentation(a, 1e-6, 2e-3, 6.4e6):.6f}")
    0.042000
    """
    missing = radius * (radius / sphere_radius) - indentation
    return missing * modulus / (2.0 * math.pi * radius) * missing


@law
def potential_at_indentation(separation, stress, radius, work, sphere_radius, modulus):
    """MCD's potential H of the contact at a fixed separation and uniform shear stress [J].

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
    """MCD's potential G at a fixed tractive force F = -P [J]; otherwise as ``potential_at_indentation``.

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
    """dH/da at fixed separation and stress [J/m]; arguments as for ``potential_at_indentation``.

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
    """dG/da at fixed load and stress [J/m]; arguments as for ``potential_at_load``.

    Notes
    -----
    ``(F + 4 E* a^3/(3R))^2/(4 E* a^2) - 12 tau^2 a^2/E* - 2 pi w a``.

    Examples
    --------
    >>> print(f"{potential_slope_at_load(0.0, 1.0, 1.0, 0.0, 1.0, 9.0):.4f}")
    2.6667
    """
    missing = tractive_force + 4.0 / 3.0 * modulus * radius * radius * (radius / sphere_radius)
    shear = 12.0 * stress * stress * radius * radius / modulus
    return missing / (4.0 * modulus * radius) * (missing / radius) - shear - 2.0 * math.pi * work * radius
