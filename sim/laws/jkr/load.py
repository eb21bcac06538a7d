"""Adhesive contact at a given load."""

import math

from sim.laws.jkr.scales import twice_pull_off
from sim.numerics.jit import law
from sim.numerics.special import cube_root


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
    A sphere of 2 mm on PDMS makes a contact without load, and pulling shrinks it by at most the
    factor (1/4)^(1/3) = 0.63:

    >>> rest = radius_at_load(0.0, 0.042, 2e-3, 6.4e6)
    >>> last = radius_at_load(pull_off_load(0.042, 2e-3), 0.042, 2e-3, 6.4e6)
    >>> print(f"{rest:.3e} {last / rest:.3f}")
    7.186e-05 0.630
    """
    # no branch but selections: the compiler turns them into vector instructions
    pull = 0.0 if work <= 0.0 else twice_pull_off(work, sphere_radius)
    root = 0.0 if pull == 0.0 else math.sqrt(pull) * math.sqrt(2.0 * load + pull)
    return cube_root(0.75 * (sphere_radius / modulus) * (load + pull + root))


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
    return -0.5 * twice_pull_off(work, sphere_radius)
