"""Isotropic spectra, and the mean energy of the fluctuating shear stress on a finite disc of contact.

A spectrum of rows (a band, a self-affine law with cut-offs, a table, a measurement) is a chain of power laws. Their
integrals over a circle are closed forms.

The energy of the infinite plane is right for a contact of very many wavelengths. On a disc of radius a every wave
counts with the share that ``laws.halfspace`` gives in closed form, so that

``E/(pi a^2) = 1/(4 pi^3) integral of [level C0(q) P(2qa) - swing C2(q) S(2qa)] dq``,

``level`` and ``swing`` the ``Softness`` of the half-space, C0 and C2 the integrals of C and of C cos(2 theta) over the
directions theta from the sliding direction. This is
the overlap integral over the autocorrelation in another order, and one-dimensional for anisotropic spectra, too.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sim.laws.halfspace import energy_factors, marginal_factors
from sim.numerics.jit import device, kernel
from sim.numerics.special import erf_between, si
from sim.spectrum.family import (
    Array,
    Factors,
    Family,
    Radial,
    Stress,
    Weight,
    radial_quadrant,
)

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)

#: P and S oscillate like cos(x)/x: followed within this distance of x = 0 and of each break of the spectrum, and
#: faded out beyond over a length so large that nothing of a smooth spectrum is left of the oscillation.
_FOLLOWED, _FADING = 60.0, 10.0
#: Half-octaves below the wavenumbers of a spectrum that are integrated one by one, for weights that vary there.
_BELOW = 64
#: Beyond this x only the two ends of a spectrum are followed, not the kinks of its rows.
_LAST_KINK = 3000.0

#: Points of the splines over ln a, from 1e-4 to 1 sphere radii. Good to 1e-8 for smooth spectra, 1e-5 for a broad
#: power law, 3e-5 for a band and 3e-3 for one a few per cent wide: its share oscillates with the waves in the contact.
_POINTS, _DECADES = 513, 4


#: Inputs of ``share_of`` at a position of the slider: wave, ends and cubics; a wave without strength means cubics.
Terms = tuple[tuple[float, float, float], tuple[float, float, float], Array]
_NONE = 0.0, 0.0, 0.0
#: Those of a contact on the whole plane, whose share is 1.
PLANE: Terms = _NONE, _NONE, np.empty((0, 4))


class Softness(NamedTuple):
    """Compliance of a half-space at a wavevector times \\|q\\|, ``level + swing cos 2θ`` [1/Pa], of one or of many."""

    level: float | Array
    swing: float | Array

    def energy(self, stress: Stress) -> float | Array:
        """Return the mean energy per area of the infinite plane under a fluctuating stress [J/m²]."""
        mean, lean = stress.over_wavenumber
        return 0.5 * (self.level * mean + self.swing * lean)


class Waves(Family, Protocol):
    """Base of the families with a density, whose integrals over discs are quadratures."""

    #: Wavenumbers [rad/m] at which quadratures are divided because the density oscillates.
    turns: ClassVar[Array] = np.empty(0)

    def reach(self, radius: float) -> tuple[float, float]:
        """Wavenumbers [rad/m] below which nothing varies, and beyond which a disc of this radius [m] stores nothing."""
        return self.support

    def harmonics(self, q: Array) -> tuple[Array, Array]:
        """Return ``∫ C dθ`` and ``∫ C cos 2θ dθ`` over the directions at wavenumber q [Pa² m²]."""

    def total(self, weight: Weight, end: float = math.inf) -> float:
        """Return the integral of C times a weight, by quadrature over the wavenumbers; 1e-12 for smooth weights."""
        low, high = self.reach(math.inf)
        high = min(high, end)
        if self.breaks.size and high <= low:
            return 0.0
        start = low if self.breaks.size else min(low, high) * 2.0 ** (-0.5 * _BELOW)
        edges = [*_half_octaves(self, start, high), self.turns]
        q, step = _gauss([edge[edge <= high] for edge in edges])
        level, lean = self.harmonics(q)
        along, across = weight(q, 0.0), weight(0.0, q)
        sums = q * step * (level * (along + across) + lean * (along - across))
        return float(np.sum(sums)) / (8 * math.pi**2)

    def on_disc(self, factors: Factors, radii: Array) -> tuple[Array, Array]:
        """Return the integrals over discs of any radius, see ``Family``."""

        def sums(radius: float) -> tuple[float, float]:
            if radius == 0.0:
                return 0.0, 0.0
            if math.isinf(radius):
                level, lean = self.over_wavenumber
                return 2 * math.pi**3 * level, -2 * math.pi**3 * lean
            return self.integrals(factors, radius)

        mean, skew = np.vectorize(sums, otypes=[float, float])(radii)
        return mean, skew

    def integrals(self, factors: Factors, radius: float) -> tuple[float, float]:
        """``∫ C0 P dq`` and ``∫ C2 S dq`` for a radius between 0 and infinity, by quadrature over the wavenumbers."""
        q, step = _nodes(self, radius)
        x = 2 * radius * q
        followed = _window(self, radius, x)
        mean, skew = factors(x)
        # without its oscillation P is pi/2 and S, beyond its slow part, -pi/2
        limit = 4.0 / x if factors is energy_factors else 2.0 / x
        mean = followed * mean + (1.0 - followed) * (0.5 * math.pi)
        skew = followed * skew + (1.0 - followed) * (limit - 0.5 * math.pi)
        level, lean = self.harmonics(q)
        return float(np.sum(level * mean * step)), float(np.sum(lean * skew * step))


def disc_energy(spectrum: Family, radius: ArrayLike, softness: Softness) -> Array:
    """Return the mean elastic energy per area that a fluctuating shear stress stores on a disc of contact.

    Parameters
    ----------
    spectrum : Family
        Any family of ``sim.spectrum``.
    radius : float or array
        a [m]; 0 stores nothing, inf is the infinite plane.
    softness : Softness
        That of the half-space; its numbers broadcast with the radius.

    Returns
    -------
    float or array
        ``E/(pi a^2)`` [J/m^2]: the energy of the plane for a disc of many wavelengths, ``(2 - nu) 2 a
        sigma^2/(3 pi G)`` on one much smaller than any of them.

    Raises
    ------
    ValueError
        If a radius is negative or nan.

    Notes
    -----
    Relative accuracy 1e-12, or 1e-9 for tables whose rows scatter widely at hundreds of waves per contact. A
    spectrum that is smooth through q = 0 lacks the share ``(2/pi) xi/(sqrt(pi) a)`` of the plane's energy (of
    ``Gaussian``); without waves as long as the disc hardly anything is missing.

    Examples
    --------
    Patches of a tenth of the radius store 3.6 % less than on the infinite plane:

    >>> from sim.solid import HalfSpace
    >>> from sim.spectrum import Gaussian
    >>> patches, softness = Gaussian(rms=1.0, length=0.1), HalfSpace(1.0).softness
    >>> print(f"{disc_energy(patches, 1.0, softness) / softness.energy(patches):.5f}")
    0.96410
    """
    return _on_disc(energy_factors, spectrum, radius, softness)


def marginal_energy(spectrum: Family, radius: ArrayLike, softness: Softness) -> Array:
    """Return the mean energy that a unit of new contact area stores at the edge of a growing disc: dE/dA.

    Parameters
    ----------
    spectrum, radius, softness
        As for ``disc_energy``.

    Returns
    -------
    float or array
        ``(1/(2 pi a)) dE/da`` [J/m^2], the exact derivative of the overlap integral; 0 at a = 0, the energy of the
        plane at a = inf.

    Notes
    -----
    This, not the mean over the disc, enters the energy balance at the contact's edge.

    Examples
    --------
    The deficit of the whole disc comes from its edge; a unit of new area lacks half of it:

    >>> from sim.solid import HalfSpace
    >>> from sim.spectrum import Gaussian
    >>> patches, softness = Gaussian(rms=1.0, length=0.1), HalfSpace(1.0).softness
    >>> print(f"{1 - marginal_energy(patches, 1.0, softness) / softness.energy(patches):.4f}")
    0.0180
    """
    return _on_disc(marginal_factors, spectrum, radius, softness)


def _on_disc(
    factors: Factors,
    spectrum: Family,
    radius: ArrayLike,
    softness: Softness,
) -> Array:
    radii = np.asarray(radius, float)
    if not np.all(radii >= 0.0):
        raise ValueError(
            "the radius of a disc must be at least zero; give detached contacts the radius 0"
        )
    mean, skew = spectrum.on_disc(factors, radii)
    return (softness.level * mean - softness.swing * skew) / (4 * math.pi**3)


def _nodes(spectrum: Waves, radius: float) -> tuple[Array, Array]:
    """Wavenumbers and steps of a composite Gauss-Legendre sum over all q that matter."""
    low, high = spectrum.reach(radius)
    start = low if spectrum.breaks.size else min(low, 0.5 / radius)
    edges = _half_octaves(spectrum, start, high)
    for begin, end in _followed(spectrum, radius):
        begin, end = max(begin - 6 * _FADING, 0.0), end + 6 * _FADING
        count = math.ceil((end - begin) / (2 * math.pi))
        turns = np.linspace(begin, end, count + 1) / (2 * radius)
        edges.append(turns[(turns > start) & (turns < high)])
    return _gauss(edges)


def _half_octaves(spectrum: Waves, start: float, high: float) -> list[Array]:
    """Edges of intervals in which a spectrum is smooth, from ``start`` to ``high``, and from 0 if it begins there."""
    count = math.ceil(2 * math.log2(high / start))
    halves = start * 2.0 ** (0.5 * np.arange(count))
    first = [high] if spectrum.breaks.size else [0.0, high]
    return [spectrum.breaks, halves, np.array(first)]


def _gauss(edges: list[Array]) -> tuple[Array, Array]:
    """Nodes and steps of Gauss-Legendre sums between neighbouring edges."""
    edge: Array = np.unique(np.concatenate(edges))
    half = 0.5 * np.diff(edge)[:, None]
    return (edge[:-1, None] + half * (1 + _NODES)).ravel(), (half * _WEIGHTS).ravel()


def _followed(spectrum: Waves, radius: float) -> list[tuple[float, float]]:
    """Intervals of x = 2qa in which the oscillation of P and S is followed, increasing and apart."""
    x = 2 * radius * spectrum.breaks
    near = np.concatenate([[0.0], x[x < _LAST_KINK], x[:1], x[-1:]])
    intervals: list[tuple[float, float]] = []
    for begin, end in zip(
        np.sort(near) - _FOLLOWED, np.sort(near) + _FOLLOWED, strict=True
    ):
        if intervals and begin - intervals[-1][1] < 12 * _FADING:
            begin = intervals.pop()[0]
        intervals.append((begin, end))
    return intervals


def _window(spectrum: Waves, radius: float, x: Array) -> Array:
    """1 where the oscillation of P and S is followed, falling smoothly to 0 elsewhere."""
    followed = np.zeros_like(x)
    for number, (begin, end) in enumerate(_followed(spectrum, radius)):
        rise = erf_between((begin - x) / _FADING, math.inf) if number else 2.0
        followed += 0.25 * rise * erf_between((x - end) / _FADING, math.inf)
    return followed


class Margin:
    """Share of ΔΓ that a growing contact of finite radius pays, dE/dA over ΔΓ of the plane [1].

    1 for many waves in the contact, 0 for a vanishing one. A spline over ln a, made once for a scene; closed form
    for a ripple.
    """

    #: No wave gives energy back, on average over its phases.
    least = 0.0

    def __init__(
        self, spectrum: Family, softness: Softness, sphere_radius: float
    ) -> None:
        self.spectrum, self.softness = spectrum, softness
        self._ends = sphere_radius * 10.0**-_DECADES, sphere_radius
        self._splines: dict[Callable[..., Array], scipy.interpolate.CubicSpline] = {}

    def __call__(self, radius: Array) -> Array:
        """Share at contact radii [m]; nan at nan."""
        shares = np.empty(radius.size)
        _shares(np.ravel(radius), *self.each[0], shares)
        return shares.reshape(radius.shape)

    def mean(self, radius: Array) -> Array:
        """Return the mean of the share over the area of the disc: E/(πa²) over ΔΓ of the plane [1]."""
        if self.spectrum.wavevector is not None and self._plane > 0.0:
            share = (
                disc_energy(self.spectrum, np.nan_to_num(radius), self.softness)
                / self._plane
            )
            return np.where(np.isnan(radius), np.nan, share)
        low, high = self._ends
        share = self._spline(disc_energy)(np.log(np.clip(radius, low, high)))
        return np.where(radius < low, share * np.maximum(radius, 0.0) / low, share)

    def at(self, position: Array) -> "Margin":
        """Return the same share at any position of the slider."""
        return self

    @cached_property
    def each(self) -> list[Terms]:
        """Inputs of ``share_of``, once for all steps: the wave of a ripple, or places and cubics of a spline."""
        (low, high), whole = self._ends, math.pi * self._plane
        if self.spectrum.wavevector is not None and whole > 0.0:
            mean, lean = self.spectrum.over_wavenumber
            level = float(self.softness.level * mean / whole)
            swing = float(-self.softness.swing * lean / whole)
            wave = 2.0 * self.spectrum.support[0], level, swing
            return [(wave, _NONE, np.zeros((1, 4)))]
        count, spline = _POINTS - 1, self._spline(marginal_energy)
        step = math.log(high / low) / count
        cubics = np.ascontiguousarray(spline.c.T * step ** np.arange(3, -1, -1))
        return [(_NONE, (low, math.log(low), 1.0 / step), cubics)]

    @cached_property
    def _plane(self) -> float:
        return float(self.softness.energy(self.spectrum))

    def _spline(self, law: Callable[..., Array]) -> "scipy.interpolate.CubicSpline":
        if law not in self._splines:
            radii = np.geomspace(*self._ends, _POINTS)
            energies = law(self.spectrum, radii, self.softness)
            self._splines[law] = scipy.interpolate.CubicSpline(
                np.log(radii), energies / (self._plane or 1.0)
            )
        return self._splines[law]


@device
def share_of(radius, wave, ends, cubics):
    """Return ``Margin`` in compiled loops at a radius above 0, given its ``terms``."""
    double, level, lean = wave
    if double > 0.0:
        x = double * radius
        integral, half = si(x), math.sin(0.5 * x)
        return level * integral + lean * (4.0 * half * half / x - integral)
    low, begin, rate = ends
    place = min(rate * (math.log(max(radius, low)) - begin), float(len(cubics)))
    i = min(int(max(place, 0.0)), len(cubics) - 1)
    s = place - i
    share = ((cubics[i, 0] * s + cubics[i, 1]) * s + cubics[i, 2]) * s + cubics[i, 3]
    return share if radius >= low else share * radius / low


@kernel(
    "void(float64[:], UniTuple(float64, 3), UniTuple(float64, 3), float64[:, ::1], float64[::1])"
)
def _shares(radii, wave, ends, cubics, shares):
    """Write ``share_of`` many radii; 0 and nan stay as they are."""
    for i in range(radii.size):
        shares[i] = (
            share_of(radii[i], wave, ends, cubics) if radii[i] > 0.0 else radii[i]
        )


# Isotropic spectra: a radial density, the variance within a circle, the energy.


class Isotropic(Waves, Radial, Protocol):
    """Base of the families whose density depends on the length of the wavevector only."""

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""

    def radial_density(self, q: ArrayLike) -> Array:
        """Return the density C at wavenumber q [rad/m], in Pa² m²; zero outside ``support``."""

    def harmonics(self, q: Array) -> tuple[Array, Array]:
        """Return ``∫ C dθ`` and ``∫ C cos 2θ dθ`` over the directions at wavenumber q [Pa² m²]."""
        return 2 * math.pi * self.radial_density(q), np.zeros(())

    def density(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Return the power spectral density C at wavevector (qx, qy) [rad/m], in Pa² m²."""
        return self.radial_density(np.hypot(qx, qy))

    @property
    def over_wavenumber(self) -> tuple[float, float]:
        """Return the integrals of C/\\|q\\| and of C cos 2θ/\\|q\\| over d²q/4π² [Pa² m]; the latter is 0."""
        return self.line_integral / (2 * math.pi), 0.0

    def pixels(self, step: float, reach: int) -> Array:
        """Return the variance in the pixels of a wavevector lattice [Pa²], see ``Family``."""
        quadrant = radial_quadrant(self, step, reach)
        return np.concatenate([quadrant[:0:-1], quadrant])


def _decay(x: Array) -> Array:
    """(1 - e^-x) / x for x >= 0, one at x = 0."""
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, -np.expm1(-safe) / safe)


class Rows(NamedTuple):
    """Rows of a radial density: wavenumbers [rad/m], positive and increasing, and C there [Pa² m²], at least zero."""

    q: Array
    density: Array


class Rowed(Isotropic, Protocol):
    """Base of isotropic spectra that are a power law between neighbouring rows, next to a zero linear, zero outside."""

    rows: Rows

    def radial_density(self, q: ArrayLike) -> Array:
        """Return C(q), zero outside the rows."""
        inside = (np.asarray(q) >= self.rows.q[0]) & (np.asarray(q) <= self.rows.q[-1])
        return np.where(inside, self._value(*self._locate(q)), 0.0)

    def cumulative(self, q: ArrayLike) -> Array:
        """Return the variance within the circle of radius q: ``(1/2 pi) ∫ C q dq`` from 0 to q [Pa²]."""
        q, row = self._locate(q)
        held = np.concatenate([[0.0], np.cumsum(self._moments(1))])
        return (
            held[row] + self._piece(1, self.rows.q[row], self.rows.density[row], q, row)
        ) / (2 * np.pi)

    def beyond(self, q: ArrayLike) -> Array:
        """Return the variance outside the circle of radius q [Pa²], without cancellation at large q."""
        q, row = self._locate(q)
        left = np.concatenate([np.cumsum(self._moments(1)[::-1])[::-1], [0.0]])
        return (
            left[row + 1]
            + self._piece(1, q, self._value(q, row), self.rows.q[row + 1], row)
        ) / (2 * np.pi)

    @functools.cached_property
    def line_integral(self) -> float:
        """∫ C dq over all q [Pa² m]."""
        return float(np.sum(self._moments(0)))

    @property
    def variance(self) -> float:
        """Variance within all rows [Pa²]."""
        return float(self.cumulative(self.rows.q[-1]))

    @property
    def support(self) -> tuple[float, float]:  # type: ignore[override]
        """Wavenumbers [rad/m] between which the density may differ from zero."""
        return float(self.rows.q[0]), float(self.rows.q[-1])

    @property
    def breaks(self) -> Array:  # type: ignore[override]
        """Wavenumbers [rad/m] where the density jumps or kinks."""
        return self.rows.q

    def _moments(self, power: int) -> Array:
        """∫ q^power C dq of each piece."""
        rows = np.arange(len(self.rows.q) - 1)
        return self._piece(
            power, self.rows.q[:-1], self.rows.density[:-1], self.rows.q[1:], rows
        )

    def _locate(self, q: ArrayLike) -> tuple[Array, NDArray[np.intp]]:
        """q brought into the rows, and the piece it lies in."""
        q = np.clip(q, self.rows.q[0], self.rows.q[-1])
        return q, np.minimum(
            np.searchsorted(self.rows.q, q, side="right") - 1, len(self.rows.q) - 2
        )

    def _is_linear(self) -> NDArray[np.bool_]:
        """Return True for each piece that is linear: no power law ends at zero."""
        return (self.rows.density[1:] == 0.0) | (self.rows.density[:-1] == 0.0)

    @functools.cached_property
    def _slopes(self) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Exponent where a piece is a power law, gradient where it is linear, and which it is."""
        linear = self._is_linear()
        logs = np.log(np.where(self.rows.density > 0.0, self.rows.density, 1.0))
        exponent = np.where(linear, 0.0, np.diff(logs) / np.diff(np.log(self.rows.q)))
        gradient = np.where(
            linear, np.diff(self.rows.density) / np.diff(self.rows.q), 0.0
        )
        return exponent, gradient, linear

    def _value(self, q: Array, row: NDArray[np.intp]) -> Array:
        """C at q by the law of its piece."""
        exponent, gradient, linear = self._slopes
        # seen from there a power law only falls: no overflow
        larger = row + (exponent[row] > 0.0)
        power = self.rows.density[larger] * np.exp(
            exponent[row] * np.log(q / self.rows.q[larger])
        )
        straight = self.rows.density[row] + gradient[row] * (q - self.rows.q[row])
        return np.where(linear[row], np.maximum(straight, 0.0), power)

    def _piece(
        self, power: int, low: Array, level: Array, high: Array, row: NDArray[np.intp]
    ) -> Array:
        """∫ q^power C dq from ``low``, where C = ``level``, to ``high`` in the same piece."""
        exponent, gradient, linear = self._slopes
        stretch = np.log(high / low)
        amplitude = (exponent[row] + power + 1) * stretch
        # from the end where q^(power+1) C is larger, so that steep rows cannot overflow
        lower = level * low ** (power + 1)
        upper = self._value(high, row) * high ** (power + 1)
        powered = (
            np.where(amplitude > 0.0, upper, lower)
            * stretch
            * _decay(np.abs(amplitude))
        )
        d, slope = high - low, gradient[row]
        straight = level * d + slope * d**2 / 2
        if power == 1:
            straight = low * straight + level * d**2 / 2 + slope * d**3 / 3
        return np.where(linear[row], straight, powered)


class LinearRows(Rowed, Protocol):
    """Base of isotropic spectra that are linear between neighbouring rows, zero outside."""

    def _is_linear(self) -> NDArray[np.bool_]:
        """Return True for each piece."""
        return np.ones(len(self.rows.q) - 1, bool)


@dataclass(frozen=True, eq=False)
class PowerLaws(Rowed):
    """A radial density of some rows.

    Examples
    --------
    A flat spectrum between 1 and 2 rad/m holds (4 - 1)/(4 pi) times its level:

    >>> flat = PowerLaws(Rows(np.array([1.0, 2.0]), np.array([1.0, 1.0])))
    >>> print(round(4 * np.pi * float(flat.cumulative(9.0)), 12))
    3.0
    """

    rows: Rows


@dataclass(frozen=True, eq=False)
class Lines(LinearRows):
    """A radial density of some rows, linear between them.

    Examples
    --------
    A density that falls from 3 Pa² m² to zero over 1 rad/m has ``∫ C dq`` = 3/2:

    >>> print(Lines(Rows(np.array([1.0, 2.0]), np.array([3.0, 0.0]))).line_integral)
    1.5
    """

    rows: Rows
