"""Elastic energy of a fluctuating shear stress on one finite disc of contact: of a wave, of a map.

On an infinite plane a wave stores ``sigma^2 G_x(q)/2`` per area. A disc of radius a cuts it off: the
stress is zero outside, and its energy is the overlap integral

``E = 1/2 integral of G_x(s) R(s) A(s) d2s``,   ``A(s) = 2 a^2 (arccos t - t sqrt(1 - t^2))``, t = s/2a,

R the autocorrelation and A the area that the disc shares with itself moved by s. ``E/(pi a^2)`` is the
energy per area of the disc; ``dE/dA = (1/(2 pi a)) dE/da``, the *marginal* energy, is what a unit of
new contact costs. As elsewhere the coupling to normal displacement at nu other than 1/2 is neglected.
"""

import functools
import math

import numpy as np
import scipy

from sim.laws.halfspace import angular_compliance, disc_displacement
from sim.numerics.grid import Grid
from sim.numerics.special import sine_integral

#: A disc smaller than this many pixels stores nothing that a number could hold.
_LEAST_RADIUS = 1e-12
#: Width of a soft edge, and how far it reaches [pixels].
_BLUR, _EDGE = 0.75, 4.5
# Below this argument the closed forms cancel, above it their power series do; 16 terms are exact there.
_SERIES_END = 3.0
_TERM = np.arange(16)
_MEAN_SERIES = 0.5 * np.sqrt(np.pi) * (-1.0) ** _TERM / (2 * _TERM + 1)
_MEAN_SERIES /= [math.factorial(n) * math.gamma(n + 2.5) for n in range(len(_TERM))]
_SKEW_SERIES = -0.5 * np.sqrt(np.pi) * (-1.0) ** _TERM / ((_TERM + 2) * (2 * _TERM + 3))
_SKEW_SERIES /= [math.factorial(n) * math.gamma(n + 3.5) for n in range(len(_TERM))]


def _series(x, mean_growth, skew_growth):
    """Both factors by their power series in x/2, each term raised by its share in the derivative."""
    z = 0.5 * np.minimum(x, _SERIES_END)
    mean = z * np.polynomial.polynomial.polyval(z * z, _MEAN_SERIES * mean_growth)
    skew = z**3 * np.polynomial.polynomial.polyval(z * z, _SKEW_SERIES * skew_growth)
    return mean, skew


def energy_factors(x):
    """Energy of a wave on a disc: its mean over directions, and the part that goes with cos 2 theta.

    Parameters
    ----------
    x : array
        2 q a [1], at least 0; inf is the infinite plane.

    Returns
    -------
    mean, skew : array
        [1] ``P`` and ``S`` of ``E/(pi a^2) = (sigma^2/(G q)) (1/pi) [(1 - nu/2) P + (nu/2) cos(2 theta) S]``, from 0 at
        x = 0 to pi/2 and -pi/2 at infinity.

    Notes
    -----
    The angular means of kernel and wave leave ``integral of A(s) J0(qs) ds = (2 a^2/q) P`` and
    ``integral of A(s) J2(qs) ds = -(2 a^2/q) S``, of which the powers of q sum to

    ``P = Si(x) + cos(x)/x - sin(x)/x^2``  and  ``S = 4/x - 3 sin(x)/x^2 - cos(x)/x - Si(x)``.

    Examples
    --------
    A wave along x with two wave halves on the diameter, and the same wave across:

    >>> mean, skew = energy_factors(2 * np.pi)
    >>> print(f"{4 / np.pi * (0.75 * mean + 0.25 * skew):.5f} {2 / np.pi * (0.75 * mean - 0.25 * skew):.5f}")
    1.20679 0.90282
    """
    x = np.asarray(x, dtype=float)
    near = _series(x, 2.0, 2.0)
    far = np.clip(x, _SERIES_END, 1e300)
    sine, cosine, integral = np.sin(far) / far, np.cos(far), sine_integral(far)
    mean = integral + (cosine - sine) / far
    skew = (4.0 - 3.0 * sine - cosine) / far - integral
    return np.where(x < _SERIES_END, near[0], mean), np.where(x < _SERIES_END, near[1], skew)


def marginal_factors(x):
    """Factors as of ``energy_factors`` for dE/dA, the energy of a unit of new contact at the edge.

    Parameters
    ----------
    x : array
        2 q a [1], at least 0; inf is the infinite plane.

    Returns
    -------
    mean, skew : array
        [1]

    Notes
    -----
    ``dA/da = 4 a arccos t`` gives, exactly, ``P = Si(x)`` and ``S = 2 (1 - cos x)/x - Si(x)``.

    Examples
    --------
    On whole numbers of waves the direction does not matter relative to the infinite plane:

    >>> mean, skew = marginal_factors(2 * np.pi * np.arange(1, 4))
    >>> print(np.round(mean + skew, 12) + 0.0)
    [0. 0. 0.]
    """
    x = np.asarray(x, dtype=float)
    near = _series(x, 2 * _TERM + 3.0, 2 * _TERM + 5.0)
    far = np.clip(x, _SERIES_END, 1e300)
    integral = sine_integral(far)
    skew = 4.0 * np.sin(0.5 * far) ** 2 / far - integral
    return np.where(x < _SERIES_END, near[0], integral), np.where(x < _SERIES_END, near[1], skew)


def _ripple(factors, amplitude, wavenumber, angle, radius, shear_modulus, poisson_ratio):
    amplitude, q, nu = (np.asarray(number, float) for number in (amplitude, wavenumber, poisson_ratio))
    mean, skew = factors(2.0 * q * np.asarray(radius, float))
    level, swing = angular_compliance(nu)
    turned = level * mean - swing * np.cos(2.0 * np.asarray(angle, float)) * skew
    return amplitude**2 / (2.0 * math.pi * np.asarray(shear_modulus, float) * q) * turned


def ripple_energy(amplitude, wavenumber, angle, radius, shear_modulus, poisson_ratio=0.5):
    """Elastic energy per area of a sinusoidal shear stress on a disc, its phase averaged.

    Parameters
    ----------
    amplitude : float or array
        tau1 of ``tau1 cos(q.x + phase)`` [Pa].
    wavenumber : float or array
        q [rad/m], above 0.
    angle : float or array
        theta from the sliding direction to the wavevector [rad].
    radius : float or array
        a of the disc [m]; inf is the infinite plane, ``halfspace.ripple_energy``.
    shear_modulus, poisson_ratio : float or array
        G [Pa], nu [1].

    Returns
    -------
    float or array
        E/(pi a^2) [J/m^2]; towards a = 0 half of what a uniform stress of this amplitude stores.

    Examples
    --------
    Ten waves along a diameter of 2: the disc stores 2 % more than the plane, and 1 % less if they run across:

    >>> for angle, plane in (0.0, 0.125), (math.pi / 2, 0.25):
    ...     print(f"{ripple_energy(1.0, 10 * math.pi, angle, 1.0, 1.0) * 10 * math.pi / plane:.5f}")
    1.02027
    0.98987
    """
    return _ripple(energy_factors, amplitude, wavenumber, angle, radius, shear_modulus, poisson_ratio)


def ripple_marginal_energy(amplitude, wavenumber, angle, radius, shear_modulus, poisson_ratio=0.5):
    """Energy of a unit of new contact under a sinusoidal shear stress: dE/dA = (1/(2 pi a)) dE/da [J/m^2].

    Arguments as for ``ripple_energy``.

    Examples
    --------
    >>> print(f"{ripple_marginal_energy(1.0, 10 * math.pi, 0.0, 1.0, 1.0) * 80 * math.pi:.5f}")
    0.98987
    """
    return _ripple(marginal_factors, amplitude, wavenumber, angle, radius, shear_modulus, poisson_ratio)


def _quarter(x, y):
    """Area of the unit disc to the left of x and below y."""

    def segment(u):
        return 0.5 * (u * np.sqrt(1.0 - u * u) + np.arcsin(u))

    x, y = np.clip(x, -1.0, 1.0), np.clip(y, -1.0, 1.0)
    half = np.sqrt(1.0 - y * y)
    inner = np.clip(x, -half, half)
    band = segment(inner) + segment(half)
    below = band + y * (inner + half)
    ends = segment(np.minimum(x, -half)) + segment(np.maximum(x, half)) - segment(half)
    above = segment(x) + 0.5 * math.pi + ends + y * (inner + half)
    return np.where(y < 0.0, below, above)


@functools.lru_cache(maxsize=16)
def _coverage(points, radius):
    """Samples around a centred disc, their positions and the weight of each: the share of its pixel that is covered.

    Lengths in pixels; rows and columns are the same set, and may step over the border of the cell by two pixels.
    The shares are the disc smoothed over a pixel. Taking 1/24 of their second differences away undoes that smoothing
    to second order, so that the weights integrate smooth functions up to the edge.
    """
    middle = 0.5 * points
    index = np.arange(math.ceil(middle - radius - 0.5) - 1, math.floor(middle + radius + 0.5) + 2)
    corner = (np.append(index, index[-1] + 1) - 0.5 - middle) / radius
    area = radius**2 * _quarter(corner[:, None], corner)
    weight = np.clip(np.diff(np.diff(area, axis=0), axis=1), 0.0, 1.0)
    for axis in (0, 1):
        around = np.pad(weight, [(1, 1) if one == axis else (0, 0) for one in (0, 1)])
        weight = weight - np.diff(around, 2, axis=axis) / 24.0
    weight.flags.writeable = False
    return index % points, index - middle, weight


@functools.lru_cache(maxsize=8)
def _free_kernel(points, poisson_ratio):
    """Grid of ``points`` unit pixels and the transform of the kernel cut at half of it, at unit modulus.

    A sum over this periodic grid is the free-space convolution of all that fits in half of it. With J0 and J2
    integrated up to T = points/2 the transform is ``(1/q) [(1 - nu/2) j0(qT) - (nu/2) cos(2 theta) j2(qT)]``.
    """
    grid = Grid(cell=float(points), points=points)
    qx, qy = grid.wavevectors
    q = np.hypot(qx, qy)
    q[0, 0] = 1.0
    x = 0.5 * points * q
    j1, h0, h1 = scipy.special.j1(x), scipy.special.struve(0, x), scipy.special.struve(1, x)
    mean = x * scipy.special.j0(x) + 0.5 * math.pi * x * (j1 * h0 - scipy.special.j0(x) * h1)
    skew = (qx**2 - qy**2) / q**2 * (mean - 2.0 * j1)
    level, swing = angular_compliance(poisson_ratio)
    kernel = (level * mean + swing * skew) / q
    kernel[0, 0] = level * 0.5 * points
    kernel.flags.writeable = False
    return grid, kernel


def _padded_size(radius):
    """Side of the padded grid in pixels for a disc of ``radius`` pixels; few values, so that kernels are kept."""
    least = 2.0 * (2.0 * radius + 4.0)
    step = 2.0 ** (math.ceil(math.log2(least)) - 3)
    return max(16, scipy.fft.next_fast_len(2 * math.ceil(0.5 * step * math.ceil(least / step)), real=True))


def _each(energy, field, cell, radius, poisson_ratio):
    """An energy of each map on the disc of its radius, at unit modulus; 0 without contact."""
    field = np.asarray(field, dtype=float)
    shape = np.broadcast_shapes(field.shape[:-2], np.shape(radius))
    maps = np.broadcast_to(field, shape + field.shape[-2:]).reshape(-1, *field.shape[-2:])
    radii = np.broadcast_to(np.asarray(radius, float), shape).ravel()
    if np.any(2.0 * radii > cell):
        raise ValueError(
            f"a disc of radius {np.max(radii):g} m does not fit in a cell of {cell:g} m; "
            "make the cell at least twice the radius"
        )
    pixel, nu = cell / field.shape[-1], float(poisson_ratio)
    pairs = zip(maps, radii, strict=True)
    found = [energy(one, pixel, a, nu) if a > _LEAST_RADIUS * pixel else 0.0 * a for one, a in pairs]
    return np.reshape(found, shape)[()]


def disc_energy_of_map(field, cell, radius, shear_modulus, poisson_ratio=0.5):
    """Elastic energy per area of one shear-stress map on a disc at the middle of its cell.

    Parameters
    ----------
    field : array, shape (..., points, points)
        tau1 along x [Pa]; axis -2 is x, axis -1 is y. Used as it is: no mean is removed over the disc.
    cell : float
        Side of the periodic cell [m]; sample i stands at i cell/points, the disc at cell/2.
    radius : float or array, shape (...)
        a [m], at most cell/2; 0 is no contact and gives 0.
    shear_modulus : float or array, shape (...)
        G [Pa].
    poisson_ratio : float
        nu [1].

    Returns
    -------
    float or array, shape (...)
        ``1/(2 pi a^2) integral of tau1 w1`` [J/m^2], w1 the displacement by the stress on the disc alone, without
        periodic images.

    Raises
    ------
    ValueError
        If a disc does not fit in the cell.

    Notes
    -----
    A pixel at the edge counts with the share of it that the disc covers. The sum over the padded grid uses the
    kernel of free space cut at a length beyond the diameter (Vico, Greengard & Ferrando, J. Comput. Phys. 323,
    2016, 191), exact for every wave that the grid carries. What remains is the edge: for a uniform stress the
    energy is low by 0.07 (pixel/a)^2, for k waves on the diameter by 0.2 k (pixel/a)^2, relative. A disc of less than
    about five pixels is not resolved. Each map is summed alone, so its result does not depend on the batch.

    Examples
    --------
    A uniform stress on a disc stores (2/3)(2 - nu) tau^2 a^3/G, here 1/pi per area:

    >>> print(f"{disc_energy_of_map(np.ones((64, 64)), 2.0, 1.0, 1.0) * math.pi:.3f}")
    1.000
    """
    return _each(_energy, field, cell, radius, poisson_ratio) / np.asarray(shear_modulus, dtype=float)


def disc_energies_of_map(field, pixel, radii, shear_modulus, poisson_ratio=0.5, discs=None):
    """Elastic energies per area of one shear-stress map on discs of several radii at its middle, smooth in the radius.

    Parameters
    ----------
    field : array, shape (points, points)
        tau1 along x [Pa], axis 0 is x, axis 1 is y; the middle is sample points//2. Beyond it there is no stress.
    pixel : float
        Distance of neighbouring points [m].
    radii : array, shape (discs,)
        a [m], above 0; the widest disc ends 5 pixels before the map.
    shear_modulus, poisson_ratio : float
        G [Pa], nu [1].
    discs : sequence of array, optional
        ``soft_disc`` of each radius, to be used again.

    Returns
    -------
    array, shape (discs,)
        [J/m^2], as of ``disc_energy_of_map``. The soft edge changes them by 0.16 (pixel/a)^2 for a uniform stress and
        by 0.65 k (pixel/a)^2 for k waves on the diameter, relative, and their derivatives no more.

    Examples
    --------
    >>> energies = disc_energies_of_map(np.ones((80, 80)), 1 / 32, np.array([0.5, 1.0]), 1.0)
    >>> print(np.round(energies * math.pi, 3))
    [0.5 1. ]
    """
    held = np.asarray(radii, float) / pixel
    grid, kernel = _free_kernel(_padded_size(np.max(held) + _EDGE), float(poisson_ratio))
    found = np.empty(held.shape)
    for place, radius in enumerate(held):
        disc = soft_disc(radius) if discs is None else discs[place]
        first = field.shape[0] // 2 - len(disc) // 2
        inside = slice(first, first + len(disc))
        found[place] = grid.weighted_power(field[inside, inside] * disc, kernel) / radius**2
    return 0.5 * pixel / (math.pi * grid.points**2 * shear_modulus) * found


def soft_disc(radius):
    """Weights [1] of the samples around the middle of a disc of ``radius`` pixels: lattices do not feel its edge.

    The disc smoothed by a Gaussian, less the second moment that smoothing brings: sums over samples are those over
    the plane but for some 1e-5, whatever the radius, so that they can be differentiated over it.
    """
    half = math.ceil(radius + _EDGE)
    place = np.arange(-half, half + 1)
    out = np.hypot(place[:, None], place) - radius
    bell = np.exp(-0.5 * (out / _BLUR) ** 2) / (_BLUR * math.sqrt(2.0 * math.pi))
    return 0.5 * (scipy.special.erfc(out / (_BLUR * math.sqrt(2.0))) - out * bell)


def _energy(field, pixel, radius, poisson_ratio):
    index, _, share = _coverage(field.shape[-1], radius / pixel)
    grid, kernel = _free_kernel(_padded_size(radius / pixel), poisson_ratio)
    power = grid.weighted_power(field[index[:, None], index] * share, kernel)
    return 0.5 * pixel**3 * power / (grid.points**2 * math.pi * radius**2)


def free_energy_of_map(field, pixel, shear_modulus, poisson_ratio=0.5):
    """Elastic energy of a shear-stress map in a free half-space, per area of the map.

    Parameters
    ----------
    field : array, shape (nx, ny)
        tau1 along x [Pa]; axis 0 is x, axis 1 is y; 0 outside of the contact. Beyond the map there is no stress.
    pixel : float
        Distance of neighbouring points [m].
    shear_modulus, poisson_ratio : float
        G [Pa], nu [1].

    Returns
    -------
    float
        ``1/(2 A) integral of tau1 w1`` [J/m^2], A the area of the map, without periodic images: these would lower it
        by 0.23278 C(0)/(G L) (nu = 1/2), C(0) L^2 being the square of the force.

    Examples
    --------
    Of a disc of uniform stress, a quarter of the map wide, with pixels of 1/32 of its radius:

    >>> x = np.arange(-64, 64) / 32 + 1 / 64
    >>> disc = (np.hypot(x[:, None], x) < 1.0).astype(float)
    >>> print(f"{free_energy_of_map(disc, 1 / 32, 1.0) * 4.0**2:.1f}")
    1.0
    """
    reach = scipy.fft.next_fast_len(math.ceil(math.hypot(*field.shape)), real=True)
    grid, kernel = _free_kernel(2 * reach, float(poisson_ratio))
    power = grid.weighted_power(field, kernel)
    return 0.5 * pixel * power / (grid.points**2 * field.size * shear_modulus)


def cross_energy_of_map(field, cell, radius, mean_stress, shear_modulus, poisson_ratio=0.5):
    """Energy per area that a shear-stress map shares with the uniform stress on its disc.

    Parameters
    ----------
    field, cell, radius, shear_modulus, poisson_ratio
        As for ``disc_energy_of_map``.
    mean_stress : float or array, shape (...)
        tau0 [Pa].

    Returns
    -------
    float or array, shape (...)
        ``1/(pi a^2) integral of tau1 w0`` [J/m^2], w0 from ``halfspace.disc_displacement``; of either sign, mean 0.

    Notes
    -----
    The energy of tau0 + tau1 is that of tau0, plus this, plus that of tau1, for by reciprocity the integrals of
    tau1 w0 and tau0 w1 are equal.
    For patches of any size far below a its standard deviation is ``1.93 (tau0/sigma)`` times the energy of tau1
    (correlation ``exp(-r^2/xi^2)``, nu = 1/2): as large, but paid by the drive like the energy of tau0 itself.

    Examples
    --------
    With itself a uniform stress shares twice its energy:

    >>> print(f"{cross_energy_of_map(np.ones((64, 64)), 2.0, 1.0, 1.0, 1.0) * math.pi:.3f}")
    2.000
    """
    stress, modulus = np.asarray(mean_stress, dtype=float), np.asarray(shear_modulus, dtype=float)
    return _each(_cross, field, cell, radius, poisson_ratio) * stress / modulus


def _cross(field, pixel, radius, poisson_ratio):
    index, weight = _cross_weight(field.shape[-1], radius / pixel, poisson_ratio)
    return pixel * (field[index[:, None], index] * weight).ravel().sum() * (pixel / radius) ** 2 / math.pi


@functools.lru_cache(maxsize=16)
def _cross_weight(points, radius, poisson_ratio):
    """Samples of the disc and, for each, covered share times displacement by a unit stress; lengths in pixels."""
    index, position, share = _coverage(points, radius)
    away = position[position >= 0.0]  # the displacement is the same in the four quarters
    mirror = np.searchsorted(away, np.abs(position))
    quarter = disc_displacement(away[:, None], away, radius, 1.0, 1.0, poisson_ratio)
    weight = share * quarter[mirror[:, None], mirror]
    weight.flags.writeable = False
    return index, weight
