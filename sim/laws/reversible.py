"""JKR contact whose adhesion also pays a share alpha of the elastic energy of the mean shear stress.

A contact that grows by dA under a uniform stress tau stores ``6 tau^2 a/(pi E*) dA`` (at nu = 1/2,
``mean_stress_energy``). In Menga, Carbone & Dini (MCD) the drive supplies all of it, alpha = 0. At alpha = 1 sliding is
reversible and adhesion supplies all of it. With G the energy release rate of the normal load alone
(``jkr.energy_release_rate``) the contact obeys ``G(a) = w - alpha 6 tau^2 a/(pi E*)``.

The right side is a straight line in a, so ``sim.laws.equilibrium`` finds the radius. It is Hertz's where adhesion does
not pay for the shear even there, under a load or an indentation of at least zero. A contact under tension detaches
beyond the last adhesive state, and the result is nan.
"""

import math

import numpy as np

from sim.laws import jkr
from sim.laws.equilibrium import largest_radius
from sim.numerics.jit import device, law

__all__ = [
    "mean_stress_energy",
    "radius_at_displacement_reversible",
    "radius_at_indentation_reversible",
    "radius_at_load_reversible",
]


@device
def compressible(poisson_ratio):
    """Return the shear energy at a given stress and modulus E*, over that at nu = 1/2: (2 - nu)/(3 (1 - nu))."""
    return (2.0 - poisson_ratio) / (3.0 * (1.0 - poisson_ratio))


@device
def energy_per_radius(stress, modulus, poisson_ratio):
    """Return ``mean_stress_energy`` over the radius [J/m^3]."""
    return 6.0 / math.pi * compressible(poisson_ratio) * (stress * stress) / modulus


@law
def mean_stress_energy(radius, stress, modulus, poisson_ratio=0.5):
    """Return the elastic energy of the mean shear stress per area of new contact [J/m^2].

    Parameters
    ----------
    radius, stress, modulus, poisson_ratio : float or array
        a [m], tau [Pa], E* [Pa], nu [1].

    Notes
    -----
    ``2 (2 - nu)/(1 - nu) tau^2 a/(pi E*)``, 6 tau^2 a/(pi E*) at nu = 1/2: the stress times
    ``halfspace.disc_edge_mean_displacement``. Over the whole disc its mean is two thirds of it.

    Examples
    --------
    At 0.3 MPa the contact of a PDMS lens stores 77 times a work of adhesion of 42 mJ/m^2:

    >>> print(f"{mean_stress_energy(1.2e-4, 3e5, 6.4e6) / 0.042:.1f}")
    76.7
    """
    return energy_per_radius(stress, modulus, poisson_ratio) * radius


@law
def tilt_of_stress(stress, reversible, modulus, poisson_ratio):
    """Return the energy of the mean stress that adhesion pays, over the radius [J/m^3]; 0 if alpha is 0."""
    if reversible == 0.0 or stress == 0.0:
        return 0.0
    return reversible * energy_per_radius(stress, modulus, poisson_ratio)


@law
def shrunk(jkr, hertz, push, stiffness, work, tilt, held, sphere_radius, modulus):
    """Return the contact radius with a tilted work of adhesion, from those of JKR and Hertz.

    Parameters
    ----------
    jkr, hertz : float or array
        Radii without the tilt, with the work of adhesion and with none [m].
    push, stiffness : float or array
        Displacement [m] behind the stiffness k [N/m], or load [N] if k = 0.
    work, tilt : float or array
        w [J/m^2], and how much less of it is left per radius [J/m^3], ``tilt_of_stress``.
    held : float
        0 if the stress stays the same as the edge moves, 4 if the tangential force does.
    sphere_radius, modulus : float or array
        R [m], E* [Pa].

    Returns
    -------
    float or array
        a [m]; ``jkr`` bit for bit without a tilt, ``hertz`` where adhesion does not pay; nan where a pulled contact
        has no equilibrium.
    """
    if tilt == 0.0 or work <= 0.0 or not jkr > 0.0 or jkr == math.inf:
        return jkr
    if not tilt > 0.0:
        return math.nan
    mount = (0.0, push, stiffness) if stiffness > 0.0 else (push, 0.0, 0.0)
    body = 1.0 / sphere_radius, modulus, 0.0
    radius, slope = largest_radius(jkr, work, tilt, mount, body)
    if push >= 0.0:
        return max(radius, hertz) if held * tilt <= slope < math.inf else hertz
    return radius if slope >= held * tilt else math.nan


def radius_at_load_reversible(
    load, work, stress, reversible, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at a load when adhesion pays a share of the energy of the mean stress.

    Parameters
    ----------
    load : float or array
        P, compression positive [N].
    work : float or array
        w [J/m^2].
    stress : float or array
        tau [Pa], the same while the contact grows or shrinks.
    reversible : float or array
        alpha [1], at least 0; MCD's is 0.
    sphere_radius, modulus, poisson_ratio : float or array
        R [m], E* [Pa], nu [1].

    Returns
    -------
    float or array
        a [m]: the wider, stable contact; bit for bit ``jkr.radius_at_load`` at alpha = 0; Hertz's radius
        where adhesion does not pay there; nan where a pulled contact has no equilibrium, or alpha < 0.

    Notes
    -----
    ``G(a) = w - alpha mean_stress_energy(a)``. As ``P(X)`` with X = 4 E* a^3/(3R) this is
    ``X - sqrt(6 pi R X (w - b a))``, convex in X, hence with one fold.

    Examples
    --------
    At 0.3 MPa a hundredth of the energy takes a sixth of the area, three hundredths all of adhesion:

    >>> a = radius_at_load_reversible(4e-3, 0.042, 3e5, [0.0, 0.01, 0.03], 2e-3, 6.4e6)
    >>> print("%.3f %.3f" % tuple((a[1:] / a[0]) ** 2))
    0.831 0.662
    """
    adhesive = jkr.radius_at_load(load, work, sphere_radius, modulus)
    hertz = jkr.hertz_radius_at_load(load, sphere_radius, modulus)
    tilt = tilt_of_stress(stress, reversible, modulus, poisson_ratio)
    return shrunk(adhesive, hertz, load, 0.0, work, tilt, 0.0, sphere_radius, modulus)


def radius_at_indentation_reversible(
    indentation, work, stress, reversible, sphere_radius, modulus, poisson_ratio=0.5
):
    """Return the contact radius at an indentation [m]; otherwise as ``radius_at_load_reversible``.

    Notes
    -----
    ``delta(a) = a^2/R - sqrt(2 pi a (w - b a)/E*)`` is convex in a: a root of a concave parabola is
    subtracted. So here, too, there is one fold.

    Examples
    --------
    A lifted sphere comes off earlier:

    >>> a = radius_at_indentation_reversible(-6e-7, 0.042, 1e5, [0.0, 0.1, 0.2], 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    3.44e-05 2.57e-05 nan
    """
    rest = (sphere_radius, modulus, poisson_ratio)
    return radius_at_displacement_reversible(
        indentation, math.inf, work, stress, reversible, *rest
    )


def radius_at_displacement_reversible(
    displacement,
    stiffness,
    work,
    stress,
    reversible,
    sphere_radius,
    modulus,
    poisson_ratio=0.5,
):
    """Return the contact radius at a displacement behind a spring [m]; otherwise as ``radius_at_load_reversible``.

    Examples
    --------
    >>> a = radius_at_displacement_reversible(-6e-7, 1e4, 0.042, 1e5, [0.0, 0.1, 0.2], 2e-3, 6.4e6)
    >>> print("%.2e %.2e %.2e" % tuple(a))
    3.64e-05 2.76e-05 nan
    """
    adhesive = jkr.radius_at_displacement(
        displacement, stiffness, work, sphere_radius, modulus
    )
    hertz = jkr.radius_at_displacement(
        displacement, stiffness, 0.0, sphere_radius, modulus
    )
    push = np.where(np.equal(stiffness, 0.0), 0.0, displacement)
    tilt = tilt_of_stress(stress, reversible, modulus, poisson_ratio)
    return shrunk(
        adhesive, hertz, push, stiffness, work, tilt, 0.0, sphere_radius, modulus
    )
