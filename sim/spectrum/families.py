"""Power spectra of the fluctuating shear stress: density, variance and stored energy.

One convention throughout: ``C(q) = ∫ d²x <τ1(x) τ1(0)> e^{-iq·x}`` in Pa² m², so that
``<τ1²> = (1/4π²) ∫ d²q C = (1/2π) ∫ q C dq``. The density in Persson's papers is C / 4π². Every ``variance`` and
``over_wavenumber`` is a closed form on the infinite plane. The latter are the two integrals of which
``sim.solid.HalfSpace.stored_energy`` makes the energy ΔΓ that the stress stores.
"""

import functools
import itertools
import math
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
import scipy
from numpy.typing import ArrayLike
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from sim.laws.halfspace import energy_factors
from sim.spectrum.family import Array, Factors, Family, Weight, gaussian_boxes
from sim.spectrum.measured import Measured, Tabulated
from sim.spectrum.radial import Isotropic, PowerLaws, Rowed, Rows, Waves
from sim.units.quantity import Quantity, keyed

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(80)
#: Oscillations of the density of bonds that are integrated one by one.
_TURNS = 800
_PHASE, _WEIGHTS = 0.25 * math.pi * (1 + _NODES), 0.25 * math.pi * _WEIGHTS


@keyed()
class BondMade(Isotropic):
    """Field of bonds at random places, each pulling on a disc of radius ``footprint``; its size follows the bonds.

    Parameters
    ----------
    footprint : float
        b [m].

    Notes
    -----
    With n sites per area and a mean square force E[f²] per site ``C = n E[f²] (2 J1(qb)/(qb))²``: here for
    n E[f²] = 1 N²/m², so that the variance is 1/(πb²), and on a half-space ``ΔΓ = (2 − ν) n E[f²]/(1.5 π² G b)``,
    which is n E[f²]/(π² G b) for an incompressible one. That is the energy stored under the bonds themselves: a
    force f moves its disc by 2f/(π²Gb).

    Examples
    --------
    Bonds of 10 pN that make 1 MPa (1e17 per m²) on discs of 1 nm:

    >>> from sim.solid import HalfSpace
    >>> print(f"{1e17 * 1e-22 * 1e3 * HalfSpace(1.6e6).stored_energy(BondMade(footprint=1e-9)):.2f} mJ/m^2")
    0.63 mJ/m^2
    """

    footprint: Annotated[
        float,
        Quantity(
            "m", "radius of the disc that a bond pulls on", "b", above=0, typical="1 nm"
        ),
    ]
    model: Literal["bonds"] = "bonds"

    bond_made: ClassVar[bool] = True

    @property
    def turns(self) -> Array:  # type: ignore[override]
        """Wavenumbers [rad/m] between which the density oscillates once; beyond the last lies 1e-7 of the energy."""
        return np.arange(1.0, _TURNS) * (math.pi / self.footprint)

    def reach(self, radius: float) -> tuple[float, float]:
        """Return the wavenumbers [rad/m] between which the density varies."""
        return 0.25 / self.footprint, 1e6 / self.footprint

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²] for n E[f²] = 1 N²/m²."""
        return 1.0 / (math.pi * self.footprint**2)

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""
        return 16.0 / (3.0 * math.pi * self.footprint)

    def radial_density(self, q: ArrayLike) -> Array:
        """Return the density C at wavenumber q [rad/m], in Pa² m²."""
        x = np.asarray(q, float) * self.footprint
        return np.square(
            np.where(
                x == 0.0, 1.0, 2.0 * scipy.special.j1(x) / np.where(x == 0.0, 1.0, x)
            )
        )

    def cumulative(self, q: ArrayLike) -> Array:
        """Return the variance within wavenumber q [Pa²]: (1 − J0² − J1²)/(πb²), by its series where that cancels."""
        x = np.square(np.asarray(q, float) * self.footprint)
        series = x * (0.25 - x * (1.0 / 32.0 - x * (5.0 / 2304.0)))
        return self.variance * np.where(x < 1e-3, series, 1.0 - self._outside(q))

    def beyond(self, q: ArrayLike) -> Array:
        """Return the variance beyond wavenumber q [Pa²]."""
        return self.variance * self._outside(q)

    def integrals(self, factors: Factors, radius: float) -> tuple[float, float]:
        """Return the integrals over a disc in real space, because the field ends there and its spectrum oscillates.

        That of J0(qs) q C/2π over q is the autocorrelation, the overlap of two footprints.
        """
        least = min(self.footprint, radius)
        # half of it; the root at the end of the overlap becomes smooth
        distance = least * np.sin(_PHASE)
        u, v = distance / radius, distance / self.footprint
        disc = np.arccos(u) - (
            u * np.sqrt(1 - u * u) if factors is energy_factors else 0.0
        )
        bond = np.arccos(v) - v * np.sqrt(1 - v * v)
        return 16 / self.footprint**2 * float(
            np.sum(disc * bond * np.cos(_PHASE) * _WEIGHTS)
        ) * least, 0.0

    def _outside(self, q: ArrayLike) -> Array:
        x = np.asarray(q, float) * self.footprint
        return scipy.special.j0(x) ** 2 + scipy.special.j1(x) ** 2


Rms = Annotated[
    float, Quantity("Pa", "root mean square of the shear stress", "σ", above=0)
]
Length = Annotated[float, Quantity("m", "correlation length", "ξ", above=0)]
Longest = Annotated[float, Quantity("m", "longest wavelength", "λ_L", above=0)]
Shortest = Annotated[float, Quantity("m", "shortest wavelength", "λ_s", above=0)]
Angle = Annotated[float, Quantity("rad", "angle to the sliding direction", "θ")]


@keyed()
class Ripple(Family):
    """A single sinusoid, ``τ1 cos(q·x)``.

    Parameters
    ----------
    amplitude : float
        τ1 [Pa]; the variance is τ1²/2.
    wavelength : float
        2π/q [m].
    angle : float
        Direction of the wavevector from the sliding direction [rad].

    Examples
    --------
    The ripple that cancels 42 mJ/m² of adhesion at G = 1.6 MPa, ten wavelengths per 0.24 mm:

    >>> from sim.solid import HalfSpace
    >>> print(f"{HalfSpace(1.6e6).stored_energy(Ripple(375.158e3, 24e-6)):.6f}")
    0.042000
    """

    amplitude: Annotated[
        float, Quantity("Pa", "amplitude of the ripple", "τ1", at_least=0)
    ]
    wavelength: Annotated[
        float, Quantity("m", "wavelength of the ripple", "λ", above=0)
    ]
    angle: Angle = 0.0
    model: Literal["ripple"] = "ripple"

    @property
    def wavevector(self) -> tuple[float, float]:  # type: ignore[override]
        """(qx, qy) [rad/m] of the one pair ±q that holds all of the power."""
        q = 2 * math.pi / self.wavelength
        return q * math.cos(self.angle), q * math.sin(self.angle)

    @property
    def support(self) -> tuple[float, float]:  # type: ignore[override]
        """Its wavenumber [rad/m], twice."""
        q = 2 * math.pi / self.wavelength
        return q, q

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²]."""
        return self.amplitude**2 / 2

    def density(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Raise ValueError: a ripple has no density."""
        raise ValueError(
            "a ripple has no density: all its variance lies at ±wavevector; use those two"
        )

    def pixels(self, step: float, reach: int) -> Array:
        """Raise ValueError: a ripple has no density."""
        return self.density(step, reach)

    @property
    def over_wavenumber(self) -> tuple[float, float]:
        """Return the integrals of C/\\|q\\| and of C cos 2θ/\\|q\\| over d²q/4π² [Pa² m]."""
        level = self.variance / self.support[0]
        return level, level * math.cos(2 * self.angle)

    def total(self, weight: Weight, end: float = math.inf) -> float:
        """Return the variance times the weight of the one wave, 0 if it lies beyond ``end``."""
        inside = self.support[0] < end
        return self.variance * float(weight(*self.wavevector)) if inside else 0.0

    def on_disc(self, factors: Factors, radii: Array) -> tuple[Array, Array]:
        """Return the integrals over discs of the density's two peaks, see ``Family``."""
        q = self.support[0]
        mean, skew = factors(2 * q * radii)
        level = 2 * math.pi**2 * self.amplitude**2 / q
        return level * mean, level * math.cos(2 * self.angle) * skew


class _OfRms:
    """Attributes of spectra whose key ``rms`` is all that their variance depends on."""

    rms: float

    @property
    def variance(self) -> float:
        """Mean square of the stress [Pa²]."""
        return self.rms**2


def _ordered(*wavelengths: tuple[str, float]) -> None:
    """Refuse cut-off wavelengths that do not fall from the first to the last."""
    for (name, long), (other, short) in itertools.pairwise(wavelengths):
        if long < short:
            message = f"{name} ({long:g} m) is shorter than {other} ({short:g} m); exchange them or raise {name}"
            raise PydanticCustomError("cut_offs_out_of_order", message)
    (name, long), (other, short) = wavelengths[0], wavelengths[-1]
    if long * (1 - 1e-9) <= short:
        message = f"{name} and {other} are equal ({long:g} m), which leaves no band; make {name} longer, or use"
        raise PydanticCustomError(
            "empty_band", f'{message} model = "ripple" for a single wavelength'
        )


@keyed()
class Band(Rowed):
    """A flat spectrum between two wavelengths, zero outside.

    Parameters
    ----------
    rms : float
        Root mean square stress σ [Pa].
    longest, shortest : float
        Wavelengths [m] that bound the band, q1 = 2π/longest, q2 = 2π/shortest.

    Notes
    -----
    ``C = 4π σ² / (q2² - q1²)``; on a half-space of ν = 1/2 ``ΔΓ = 3 σ² / (4 G (q1 + q2))``.

    Examples
    --------
    >>> from sim.solid import HalfSpace
    >>> band = Band(rms=1e5, longest=60e-6, shortest=20e-6)
    >>> q1, q2 = band.support
    >>> print(round(HalfSpace(1.6e6).stored_energy(band) / (3e10 / (4 * 1.6e6 * (q1 + q2))), 12))
    1.0
    """

    rms: Rms
    longest: Longest
    shortest: Shortest
    model: Literal["band"] = "band"

    @model_validator(mode="after")
    def _check(self) -> Self:
        _ordered(("longest", self.longest), ("shortest", self.shortest))
        return self

    @functools.cached_property
    def rows(self) -> Rows:  # type: ignore[override]
        """Both ends of the band."""
        q = 2 * np.pi / np.array([self.longest, self.shortest])
        return Rows(
            q, np.full(2, 4 * np.pi * self.rms**2 / ((q[1] - q[0]) * (q[1] + q[0])))
        )


@keyed()
class SelfAffine(Rowed):
    """A plateau down to the roll-off, then a self-affine power law, cut at both ends.

    Parameters
    ----------
    rms : float
        Root mean square stress σ [Pa].
    hurst : float
        H [1], from 0 to 1: ``C ∝ q^(-2-2H)`` between roll-off and shortest wavelength.
    longest, rolloff, shortest : float
        Wavelengths [m], falling; without a plateau ``rolloff`` equals ``longest``.

    Notes
    -----
    With λ = rolloff/longest, ζ = rolloff/shortest and q_r = 2π/rolloff, on a half-space of ν = 1/2
    ``ΔΓ = (3 σ² / 4 G q_r) N / D``, ``N = 1 - λ + (1 - ζ^(-1-2H)) / (1 + 2H)``,
    ``D = 1 - λ² + (1 - ζ^(-2H)) / H``, with 2 ln ζ for the last term at H = 0.

    Examples
    --------
    Rough at small scales (H small) stores less energy than the same stress in long waves:

    >>> from sim.solid import HalfSpace
    >>> spectra = (SelfAffine(1e5, hurst, 60e-6, 24e-6, 1e-6) for hurst in (0.2, 0.8))
    >>> rough, smooth = map(HalfSpace(1e6).stored_energy, spectra)
    >>> print(f"{rough / smooth:.2f}")
    0.62
    """

    rms: Rms
    hurst: Annotated[float, Quantity("1", "Hurst exponent", "H", at_least=0, at_most=1)]
    longest: Longest
    rolloff: Annotated[
        float, Quantity("m", "wavelength at the end of the plateau", "λ_r", above=0)
    ]
    shortest: Shortest
    model: Literal["self_affine"] = "self_affine"

    @model_validator(mode="after")
    def _check(self) -> Self:
        _ordered(
            ("longest", self.longest),
            ("rolloff", self.rolloff),
            ("shortest", self.shortest),
        )
        return self

    @functools.cached_property
    def rows(self) -> Rows:  # type: ignore[override]
        """Ends of plateau and power law, scaled to the given rms."""
        waves = sorted({self.longest, self.rolloff, self.shortest}, reverse=True)
        q = 2 * np.pi / np.array(waves)
        level = np.maximum(q * self.rolloff / (2 * np.pi), 1.0) ** (-2 - 2 * self.hurst)
        return Rows(q, level * self.rms**2 / PowerLaws(Rows(q, level)).variance)


@keyed()
class Gaussian(_OfRms, Isotropic):
    """Correlation ``σ² exp(-r²/ξ²)``: smooth patches of one size.

    Parameters
    ----------
    rms : float
        Root mean square stress σ [Pa].
    length : float
        ξ [m]; with exp(-r²/2ℓ²) as correlation give ξ = √2 ℓ.

    Notes
    -----
    ``C = π ξ² σ² exp(-q²ξ²/4)``; on a half-space of ν = 1/2 ``ΔΓ = (3√π/16) σ² ξ / G``.

    Examples
    --------
    >>> from sim.solid import HalfSpace
    >>> print(f"{HalfSpace(1.0).stored_energy(Gaussian(rms=1.0, length=1.0)):.7f}")
    0.3323351
    """

    rms: Rms
    length: Length
    model: Literal["gaussian"] = "gaussian"

    def reach(self, radius: float) -> tuple[float, float]:
        """Return the wavenumbers [rad/m] between which the density varies."""
        return 0.25 / self.length, 14.0 / self.length

    def radial_density(self, q: ArrayLike) -> Array:
        """Return the density C at wavenumber q [rad/m], in Pa² m²."""
        return np.pi * (self.length * self.rms) ** 2 * self._decay(q)

    def cumulative(self, q: ArrayLike) -> Array:
        """Return the variance within wavenumber q [Pa²]."""
        return -self.variance * np.expm1(-((np.asarray(q) * self.length) ** 2) / 4)

    def beyond(self, q: ArrayLike) -> Array:
        """Return the variance beyond wavenumber q [Pa²]."""
        return self.variance * self._decay(q)

    def _decay(self, q: ArrayLike) -> Array:
        return np.exp(-((np.asarray(q, float) * self.length) ** 2) / 4)

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""
        return math.pi**1.5 * self.length * self.variance


@keyed()
class VonKarman(_OfRms, Isotropic):
    """The von Kármán (Matérn) family; H = 1/2 is the correlation ``σ² exp(-r/ξ)``.

    Parameters
    ----------
    rms : float
        Root mean square stress σ [Pa].
    length : float
        ξ [m].
    hurst : float
        H [1], above 0 and up to 1.

    Notes
    -----
    ``C = 4π H ξ² σ² (1 + q²ξ²)^(-1-H)``; on a half-space of ν = 1/2 ``ΔΓ = (3√π/8) Γ(H+½)/Γ(H) σ² ξ / G``.

    Examples
    --------
    >>> from sim.solid import HalfSpace
    >>> print(f"{HalfSpace(1.0).stored_energy(VonKarman(rms=1.0, length=1.0, hurst=0.5)):.7f}")
    0.3750000
    """

    rms: Rms
    length: Length
    hurst: Annotated[float, Quantity("1", "Hurst exponent", "H", above=0, at_most=1)]
    model: Literal["von_karman"] = "von_karman"

    def reach(self, radius: float) -> tuple[float, float]:
        """Wavenumbers [rad/m] between which the density varies and a disc of this radius [m] stores energy."""
        return 0.25 / self.length, 1e13 / min(self.length, radius)

    def radial_density(self, q: ArrayLike) -> Array:
        """Return the density C at wavenumber q [rad/m], in Pa² m²."""
        level = 4 * np.pi * self.hurst * (self.length * self.rms) ** 2
        return level * np.exp(-(1 + self.hurst) * self._log(q))

    def cumulative(self, q: ArrayLike) -> Array:
        """Return the variance within wavenumber q [Pa²]."""
        return -self.variance * np.expm1(-self.hurst * self._log(q))

    def beyond(self, q: ArrayLike) -> Array:
        """Return the variance beyond wavenumber q [Pa²]."""
        return self.variance * np.exp(-self.hurst * self._log(q))

    def _log(self, q: ArrayLike) -> Array:
        return np.log1p((np.asarray(q, float) * self.length) ** 2)

    @property
    def line_integral(self) -> float:
        """∫ C dq [Pa² m]."""
        ratio = scipy.special.poch(self.hurst, 0.5)  # Γ(H + ½) / Γ(H)
        return float(2 * math.pi**1.5 * self.length * self.variance * ratio)


@keyed()
class AnisotropicGaussian(_OfRms, Waves):
    """Correlation ``σ² exp(-x²/a² - y²/b²)`` along two axes, turned by an angle.

    Parameters
    ----------
    rms : float
        Root mean square stress σ [Pa].
    length_x, length_y : float
        a and b [m]: correlation lengths along the two axes.
    angle : float
        Direction of the first axis from the sliding direction [rad].

    Notes
    -----
    ``C = π a b σ² exp(-(a²qx² + b²qy²)/4)`` along its own axes. With Carlson's R_D the means of
    cos²/q and sin²/q are ``A = (σ² a b³ / 3√π) R_D(0, a², b²)`` and ``B = (σ² b a³ / 3√π) R_D(0, b², a²)``. On a
    half-space ``ΔΓ = (A + B - ν (A cos²θ + B sin²θ)) / 2G``.

    Examples
    --------
    Streaks across the sliding direction are stiffer than streaks along it:

    >>> from sim.solid import HalfSpace
    >>> streaks = (AnisotropicGaussian(1.0, a, b) for a, b in [(1, 3), (3, 1)])
    >>> across, along = map(HalfSpace(1.0).stored_energy, streaks)
    >>> print(f"{across:.7f} {along:.7f}")
    0.4888006 0.5811675
    """

    rms: Rms
    length_x: Length
    length_y: Length
    angle: Angle = 0.0
    model: Literal["anisotropic_gaussian"] = "anisotropic_gaussian"

    def density(self, qx: ArrayLike, qy: ArrayLike) -> Array:
        """Return the power spectral density C at wavevector (qx, qy) [rad/m], in Pa² m²."""
        level = np.pi * self.length_x * self.length_y * self.variance
        (xx, xy, yy), x, y = self._form, np.asarray(qx, float), np.asarray(qy, float)
        return level * np.exp(-(xx * x**2 + 2 * xy * x * y + yy * y**2))

    @property
    def over_wavenumber(self) -> tuple[float, float]:
        """Return the integrals of C/\\|q\\| and of C cos 2θ/\\|q\\| over d²q/4π² [Pa² m] (see Notes)."""
        a, b = self.length_x, self.length_y
        scale = self.variance * a * b / (3 * math.sqrt(math.pi))
        along = scale * b**2 * scipy.special.elliprd(0.0, a**2, b**2)
        across = scale * a**2 * scipy.special.elliprd(0.0, b**2, a**2)
        return along + across, (along - across) * math.cos(2 * self.angle)

    @functools.cached_property
    def _form(self) -> tuple[float, float, float]:
        """Coefficients of qx², 2 qx qy and qy² in minus the exponent of C."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        a, b = self.length_x**2 / 4, self.length_y**2 / 4
        return (
            a * cosine**2 + b * sine**2,
            (a - b) * cosine * sine,
            a * sine**2 + b * cosine**2,
        )

    def reach(self, radius: float) -> tuple[float, float]:
        """Return the wavenumbers [rad/m] between which the density varies."""
        return 0.25 / max(self.length_x, self.length_y), 14.0 / min(
            self.length_x, self.length_y
        )

    def harmonics(self, q: Array) -> tuple[Array, Array]:
        """Return ``∫ C dθ`` and ``∫ C cos 2θ dθ`` over the directions at wavenumber q [Pa² m²]."""
        a, b = self.length_x, self.length_y
        level = (
            2 * math.pi**2 * a * b * self.variance * np.exp(-((min(a, b) * q) ** 2) / 4)
        )
        bend = (a - b) * (a + b) / 8 * q**2
        return level * scipy.special.ive(0, bend), -level * scipy.special.ive(
            1, bend
        ) * math.cos(2 * self.angle)

    def pixels(self, step: float, reach: int) -> Array:
        """Return the variance in the pixels of a wavevector lattice [Pa²], see ``Family``."""
        level = self.variance * self.length_x * self.length_y / (4 * math.pi)
        edges = step * (np.arange(-reach, reach + 2) - 0.5)
        return level * gaussian_boxes(self._form, edges, edges[reach:])


#: Any spectrum, by the key ``model`` of a scenario.
Spectrum = Annotated[
    Ripple
    | Band
    | SelfAffine
    | Gaussian
    | AnisotropicGaussian
    | VonKarman
    | Tabulated
    | Measured
    | BondMade,
    Field(discriminator="model"),
]
