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

**Normal contact.** A rigid frictionless punch that touches a disc of radius a solves Fredholm's equation

    ``f(s) - (2/pi) int_0^a K(s, t) f(t) dt = 1 or s^2``,  ``K(s, t) = int_0^inf (1 - 2 normal(qh)) cos qs cos qt dq``

with 1 for a flat punch (f_1) and s^2 for the profile of a sphere (f_2). Its pressure near the edge is
``(4G/pi)(delta f_1(a) - f_2(a)/R)/sqrt(a^2 - r^2)``. At a = 1 the contact needs the edge values e_1 and e_2 of the two
functions and three integrals: g_1 of f_1, g_2 of f_2 and g_3 of s^2 f_2. They depend on x = a/h alone, and
``layer_table`` has them. A half-space has e_1 = e_2 = g_1 = 1, g_2 = 1/3 and g_3 = 1/5. Load, energy release rate and
elastic energy at an indentation delta are then

    ``P = 8G (delta a g_1 - a^3 g_2/R)``,  ``(2G/(pi a)) (delta e_1 - a^2 e_2/R)^2``  and
    ``U = 4G (delta^2 a g_1 - 2 delta a^3 g_2/R + a^5 g_3/R^2)``.

**A uniform shear stress** on the disc moves it by 1/k_t times its force. This is m(x) times the compliance
``2/(pi^2 G a)`` of a half-space, without normal stress. The energy ``U = (pi a^2 tau)^2/(2 k_t)`` per new area is that
of a half-space times n(x) = m + x m'/3. In a thin film m = pi/(2x) and n = pi/(3x).

What is released is no longer stored, so that the slopes over x of x g_1, x^3 g_2 and x^5 g_3 are e_1^2, x^2 e_1 e_2 and
x^4 e_2^2.
"""

import math

import numpy as np

from sim.laws.layer_table import TABLE, TURN, WIDEST
from sim.numerics.jit import apart, device, law

#: Numbers of g_1 and others in ``contact_function``.
E_1, E_1_SLOPE, E_2, E_2_SLOPE, G_1, G_2, G_3, M, M_SLOPE, N, N_SLOPE = range(11)
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


@device
def growth(x):
    """Return about how e_1 and e_2 grow with x = a/h, (1 + x)^(3/2), which the table leaves out."""
    return (1.0 + x) * math.sqrt(1.0 + x)


@device
def _tabulated(x):
    """Return e_1, its slope over x, e_2, its slope, g_1, g_2 and g_3 at x = a/h up to ``WIDEST``; Clenshaw's sums."""
    apart()
    reach = 2.0 * (WIDEST + TURN) / WIDEST
    t, t_x = reach * x / (x + TURN) - 1.0, reach * TURN / ((x + TURN) * (x + TURN))
    a = b = c = d = e = 0.0
    a_last = b_last = c_last = d_last = e_last = 0.0
    a_slope = b_slope = a_slope_last = b_slope_last = 0.0
    for k in range(TABLE.shape[0] - 1, 0, -1):
        a_slope, a_slope_last = 2.0 * (a + t * a_slope) - a_slope_last, a_slope
        b_slope, b_slope_last = 2.0 * (b + t * b_slope) - b_slope_last, b_slope
        a, a_last = TABLE[k, 0] + 2.0 * t * a - a_last, a
        b, b_last = TABLE[k, 1] + 2.0 * t * b - b_last, b
        c, c_last = TABLE[k, 2] + 2.0 * t * c - c_last, c
        d, d_last = TABLE[k, 3] + 2.0 * t * d - d_last, d
        e, e_last = TABLE[k, 4] + 2.0 * t * e - e_last, e
    a_slope = t_x * (a + t * a_slope - a_slope_last)
    b_slope = t_x * (b + t * b_slope - b_slope_last)
    a = TABLE[0, 0] + t * a - a_last
    b = TABLE[0, 1] + t * b - b_last
    c = TABLE[0, 2] + t * c - c_last
    d = TABLE[0, 3] + t * d - d_last
    e = TABLE[0, 4] + t * e - e_last
    size, bend = growth(x), 1.5 / (1.0 + x)
    cube = size * size
    return (
        size * a,
        size * (a_slope + bend * a),
        size * b,
        size * (b_slope + bend * b),
        cube * c,
        cube * d,
        cube * e,
    )


@device
def contact_functions(x):
    """Return e_1, its slope over x, e_2, its slope, g_1, g_2 and g_3 at x = a/h.

    They are good to 1e-10 up to ``WIDEST``. Beyond, e_1 and e_2 are continued by powers of x and the integrals follow
    from them, so that a search which passes there finds its way back. No result is given there.
    """
    if not x > WIDEST:
        return _tabulated(x)
    e1, e1_slope, e2, e2_slope, g1, g2, g3 = _tabulated(WIDEST)
    p, q, ratio = WIDEST * e1_slope / e1, WIDEST * e2_slope / e2, x / WIDEST
    first, mixed, last = 2.0 * p + 1.0, p + q + 3.0, 2.0 * q + 5.0
    g1 = (g1 + e1 * e1 * (ratio**first - 1.0) / first) / ratio
    g2 = (g2 + e1 * e2 * (ratio**mixed - 1.0) / mixed) / ratio**3
    g3 = (g3 + e2 * e2 * (ratio**last - 1.0) / last) / ratio**5
    e1, e2 = e1 * ratio**p, e2 * ratio**q
    return e1, p * e1 / x, e2, q * e2 / x, g1, g2, g3


@device
def sphere(radius, curvature, modulus, inverse_thickness):
    """Return the terms of a sphere on a layer at a contact radius, as ``sim.laws.equilibrium.punch``."""
    apart()
    x = radius * inverse_thickness
    e1, e1_slope, e2, e2_slope, g1, g2, _ = contact_functions(x)
    share = e2 / e1
    share_slope = (e2_slope - share * e1_slope) / e1 * inverse_thickness
    depth = radius * radius * curvature * share
    growth = radius * curvature * (2.0 * share + radius * share_slope)
    flat = 2.0 * modulus * radius
    load = flat * (depth * g1 - radius * radius * curvature * g2)
    rise, toll_slope = 2.0 * modulus * e1 * e1, 2.0 * math.pi / (modulus * e1 * e1)
    bend = 1.0 - 2.0 * x * e1_slope / e1
    return (
        depth,
        growth,
        load,
        flat * g1,
        rise,
        toll_slope * radius,
        toll_slope * bend,
    )


@device
def shear_functions(x):
    """Return m, its slope over x, n and its slope at x = a/h; powers of x beyond ``WIDEST``."""
    apart()
    place = min(x, WIDEST)
    reach = 2.0 * (WIDEST + TURN) / WIDEST
    t = reach * place / (place + TURN) - 1.0
    t_x = reach * TURN / ((place + TURN) * (place + TURN))
    a = b = a_last = b_last = 0.0
    a_slope = b_slope = a_slope_last = b_slope_last = 0.0
    for k in range(TABLE.shape[0] - 1, 0, -1):
        a_slope, a_slope_last = 2.0 * (a + t * a_slope) - a_slope_last, a_slope
        b_slope, b_slope_last = 2.0 * (b + t * b_slope) - b_slope_last, b_slope
        a, a_last = TABLE[k, 5] + 2.0 * t * a - a_last, a
        b, b_last = TABLE[k, 6] + 2.0 * t * b - b_last, b
    a_slope = t_x * (a + t * a_slope - a_slope_last)
    b_slope = t_x * (b + t * b_slope - b_slope_last)
    fade = 1.0 / (1.0 + place)
    m = fade * (TABLE[0, 5] + t * a - a_last)
    n = fade * (TABLE[0, 6] + t * b - b_last)
    m_slope, n_slope = fade * (a_slope - m), fade * (b_slope - n)
    if not x > WIDEST:
        return m, m_slope, n, n_slope
    p, ratio = -WIDEST * m_slope / m, WIDEST / x
    m *= math.pow(ratio, p)
    n = m * (1.0 - p / 3.0)
    return m, -p * m / x, n, -p * n / x


@law
def tangential_compliance(radius, shear_modulus, thickness):
    """Return the mean displacement of a disc under a uniform shear stress over its force, 1/k_t, on a layer.

    Parameters
    ----------
    radius, shear_modulus, thickness : float or array
        a [m], G [Pa], h [m].

    Returns
    -------
    float or array
        [m/N], without normal stress. ``2/(pi^2 G a)`` on a thick layer, ``h/(pi G a^2)`` on a thin one.

    Examples
    --------
    >>> ratio = tangential_compliance(1.0, 1.0, [1e9, 1e-2]) * [math.pi**2 / 2, math.pi / 1e-2]
    >>> print("%.2f %.2f" % tuple(ratio))
    1.00 0.99
    """
    m, _, _, _ = shear_functions(radius / thickness)
    return 2.0 * m / (math.pi * math.pi * shear_modulus * radius)


@law
def mean_stress_energy(radius, stress, shear_modulus, thickness):
    """Return the elastic energy of a uniform shear stress per area of new contact on a layer [J/m^2].

    Parameters
    ----------
    radius, stress, shear_modulus, thickness : float or array
        a [m], tau [Pa], G [Pa], h [m].

    Notes
    -----
    ``dU/dA`` of ``U = (pi a^2 tau)^2/(2 k_t)``: 3 tau^2 a/(2 pi G) on a thick layer, tau^2 h/(2G) on a thin one.

    Examples
    --------
    >>> print("%.3f %.4f" % tuple(mean_stress_energy(1.0, 1.0, 1.0, [1e9, 1e-2])))
    0.477 0.0050
    """
    _, _, n, _ = shear_functions(radius / thickness)
    return 1.5 * stress * stress * radius * n / (math.pi * shear_modulus)


@law
def contact_function(which, x):
    """Return one of the functions of a contact on a layer.

    Parameters
    ----------
    which : float or array
        ``E_1`` for e_1, ``E_1_SLOPE`` for its slope over x, and so on: a whole number.
    x : float or array
        a/h [1], at least 0.

    Examples
    --------
    A flat punch as wide as a layer is thick is 3.6 times as stiff as on a half-space:

    >>> print(f"{contact_function(G_1, 1.0):.4f}")
    3.6187
    """
    if which < 7.0:
        return contact_functions(x)[int(which)]
    return shear_functions(x)[int(which) - 7]
