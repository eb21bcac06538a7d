"""An incompressible elastic layer bonded to a rigid base: surface displacement under waves of stress.

The layer has the thickness h and the shear modulus G. Under a wave of stress with wavenumber q every compliance is
``f(q h)/(G q)``. A stress across its own wave leaves the normal displacement at zero. A stress along its own wave moves
the surface along the normal as well, because an incompressible layer that is pushed together becomes thicker. Two
cases follow.

- The normal stress is zero, so that the surface is free to rise. This holds for the mean displacement of a contact
  under a uniform shear stress.
- The normal displacement is held by a smooth rigid sphere, and a wave of normal stress develops. This holds for the
  fluctuations of the shear stress inside of a contact. The compliance is ``C_tt - C_tn^2/C_nn`` of those without
  constraint. It is a quarter of the free one for long waves, and equal to it for short ones.

All functions of ``x = q h`` are written in exp(-2x), so that nothing overflows.
"""

import math

import numpy as np

from sim.numerics.jit import device, law

#: x below which the compliance at held normal displacement is a quotient of power series, whose terms are positive.
_SERIES_BELOW, _TERMS = 1.0, 14


@device
def _fades(x):
    """Return exp(-2x), and 1 + 2x^2."""
    return math.exp(-2.0 * x), 1.0 + 2.0 * x * x


@law
def across(x):
    """Return ``G q`` times the displacement per shear stress across its wave at ``x = q h``: tanh x.

    Parameters
    ----------
    x : float or array
        Wavenumber times thickness [1], at least 0.

    Returns
    -------
    float or array
        [1], x for long waves, which shear the layer as a whole, and 1 for short ones.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(across([0.01, 10.0])))
    0.0100 1.0000
    """
    return math.tanh(x)


@law
def along_free(x):
    """Return ``G q`` times the displacement per shear stress along its wave without normal stress, at ``x = q h``.

    Parameters
    ----------
    x : float or array
        Wavenumber times thickness [1], at least 0.

    Returns
    -------
    float or array
        [1], x for long waves, 1/2 for short ones, as on an incompressible half-space.

    Notes
    -----
    ``(sinh 2x + 2x)/(2 (cosh 2x + 1 + 2x^2))``.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(along_free([0.01, 10.0])))
    0.0100 0.5000
    """
    fade, growth = _fades(x)
    above = -math.expm1(-4.0 * x) + 4.0 * x * fade
    return 0.5 * above / (1.0 + fade * fade + 2.0 * fade * growth)


@law
def along_held(x):
    """Return ``G q`` times the displacement per shear stress along its wave at zero normal displacement.

    Parameters
    ----------
    x : float or array
        Wavenumber times thickness [1], at least 0.

    Returns
    -------
    float or array
        [1], x/4 for long waves, 1/2 for short ones.

    Notes
    -----
    ``(cosh 2x - 1 - 2x^2)/(2 (sinh 2x - 2x))``. Long waves meet four times the stiffness of ``along_free``, because
    the layer cannot rise, so that as much of it flows back below the surface as the stress moves at the surface.

    Examples
    --------
    >>> print("%.4f %.4f" % tuple(along_held([0.01, 10.0])))
    0.0025 0.5000
    """
    if x < _SERIES_BELOW:
        # sum of (2x)^(2n)/(2n + 4)! over the sum of (2x)^(2n)/(2n + 3)!, n from 0
        square, term, above, below = 4.0 * x * x, 1.0 / 6.0, 0.0, 0.0
        for n in range(_TERMS):
            below += term
            above += term / (2.0 * n + 4.0)
            term *= square / ((2.0 * n + 4.0) * (2.0 * n + 5.0))
        return x * above / below
    fade, growth = _fades(x)
    above = 1.0 + fade * fade - 2.0 * fade * growth
    return 0.5 * above / (1.0 - fade * fade - 4.0 * x * fade)


@law
def normal(x):
    """Return ``G q`` times the normal displacement per normal stress, without shear stress, at ``x = q h``.

    Parameters
    ----------
    x : float or array
        Wavenumber times thickness [1], at least 0.

    Returns
    -------
    float or array
        [1], x^3/3 for long waves, 1/2 for short ones.

    Notes
    -----
    ``(sinh 2x - 2x)/(2 (cosh 2x + 1 + 2x^2))``.

    Examples
    --------
    >>> print("%.1e %.4f" % tuple(normal([0.01, 10.0])))
    3.3e-07 0.5000
    """
    fade, growth = _fades(x)
    if x < _SERIES_BELOW:
        square, term, above = 4.0 * x * x, 8.0 / 6.0, 0.0
        for n in range(_TERMS):
            above += term
            term *= square / ((2.0 * n + 4.0) * (2.0 * n + 5.0))
        above *= 2.0 * x * x * x * fade
    else:
        above = 1.0 - fade * fade - 4.0 * x * fade
    return 0.5 * above / (1.0 + fade * fade + 2.0 * fade * growth)


def compliance(qx, qy, thickness, shear_modulus):
    """Return the surface displacement along x per shear stress along x at held normal displacement, at wavevector q.

    Parameters
    ----------
    qx, qy : float or array
        Wavevector components [rad/m].
    thickness, shear_modulus : float or array
        h [m], G [Pa].

    Returns
    -------
    float or array
        [m/Pa], even in q; zero at q = 0, where the answer depends on the size of the contact.

    Notes
    -----
    ``(along_held(qh) cos^2 theta + across(qh) sin^2 theta)/(G q)``.

    Examples
    --------
    A layer hardly stores energy under waves much longer than its thickness:

    >>> long, short = compliance([1e3, 1e7], 0.0, 1e-5, 1e6)
    >>> print(f"{long:.1e} {short:.1e}")
    2.5e-12 5.0e-14
    """
    q = np.hypot(qx, qy)
    size = np.where(q > 0.0, q, 1.0)
    x, cosine, sine = q * thickness, qx / size, qy / size
    level = along_held(x) * cosine**2 + across(x) * sine**2
    return level / (shear_modulus * size)
