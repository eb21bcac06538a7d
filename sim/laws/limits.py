"""Numbers that tell if a soft adhesive contact is the one of Johnson, Kendall & Roberts."""

import numpy as np

#: A float or an array of floats.
Floats = float | np.ndarray

#: Tabor number from which on the theory of Johnson, Kendall & Roberts holds (Johnson & Greenwood 1997).
JKR_FROM = 5.0
#: Equilibrium distances of two surfaces between which those of most solids lie [m].
DISTANCES = 0.4e-9, 0.16e-9
#: Mean shear stress over the shear modulus from about which on finite strains reduce the contact area.
FINITE_STRAIN = 0.1


def tabor_number(
    work: Floats, sphere_radius: Floats, modulus: Floats, distance: Floats
) -> np.ndarray:
    """Return the Tabor number, the stretch of the edge at pull-off over the range of the attraction.

    Parameters
    ----------
    work, sphere_radius, modulus : float or array
        Δγ [J/m²], R [m], E* [Pa].
    distance : float or array
        z0, the equilibrium distance of the two surfaces [m].

    Notes
    -----
    ``mu = (R Δγ²/(E*² z0³))^(1/3)`` (Tabor 1977). Above about 5 the contact is that of Johnson, Kendall & Roberts.
    Below about 0.1 it is that of Derjaguin, Muller & Toporov.

    Examples
    --------
    A lens of PDMS is far above the limit, a stiff tip of an atomic force microscope is not:

    >>> print("%.0f %.2f" % (tabor_number(0.042, 2e-3, 6.4e6, 0.4e-9), tabor_number(0.4, 1e-7, 4.65e10, 0.4e-9)))
    1104 0.49
    """
    stretch = np.cbrt(np.square(np.divide(work, modulus)) * sphere_radius)
    return np.asarray(stretch / distance)


def elastocapillary_length(
    surface_tension: Floats, shear_modulus: Floats, poisson_ratio: Floats = 0.5
) -> np.ndarray:
    """Return the length below which surface tension holds a solid in shape rather than its elasticity [m].

    Parameters
    ----------
    surface_tension, shear_modulus, poisson_ratio : float or array
        gamma [N/m], G [Pa], nu [1].

    Notes
    -----
    ``gamma/E`` with ``E = 2 (1 + nu) G`` (Style et al. 2013). A contact of such a radius is wetted rather than
    adhesive.

    Examples
    --------
    A gel of 50 Pa whose surface is that of its water:

    >>> print(f"{1e3 * elastocapillary_length(0.072, 50.0):.2f} mm")
    0.48 mm
    """
    youngs_modulus = 2.0 * (1.0 + np.asarray(poisson_ratio)) * shear_modulus
    return np.asarray(surface_tension / youngs_modulus)
