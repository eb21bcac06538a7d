"""Contact of a sphere without adhesion, after Hertz."""

import math

from sim.numerics.jit import law
from sim.numerics.special import cube_root


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
