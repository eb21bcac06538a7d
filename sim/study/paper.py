"""The equations and numbers of Menga, Carbone & Dini recomputed, for ``sim paper``.

N. Menga, G. Carbone, D. Dini, "Do uniform tangential interfacial stresses enhance adhesion?", J. Mech. Phys. Solids 112
(2018) 145 with the corrigendum 133 (2019) 103744, in the corrected text of arXiv:1710.06506. Equation numbers count its
numbered displays. Each line compares a value of the package with an independent one. This is a closed number, the
formula of the paper, or a quadrature or root by numpy and scipy alone.

What the paper does not settle, or settles twice (``docs/paper.md`` has the details):

- the spectrum is written with the whole stress where only its fluctuation can be meant;
- the Hertz radius at a load is the real cube root of a negative force. The dimensionless forms do not exist for pulled
  or lifted spheres, and the same symbols have two scales;
- the thresholds of 375 and 51 kPa are amplitudes of the cheapest direction. A ripple across the sliding needs 265 and
  36 kPa, a ring of directions 306 and 42 kPa.
- G = 1.6 MPa may have been a Young's modulus;
- nothing here can push the contact below Hertz's, and broken bonds alone are too few at 2-3 mm/s;
- N0/(1 + V/Vc) belongs to one bond model without a friction maximum, and no Delta gamma(N) is given;
- the balance that cancels the uniform stress cancels the fluctuation just as well: that adhesion
  pays for Delta Gamma is an assumption (``paid_by_adhesion``);
- the mean stress stores some eighty times Delta gamma, so that a hundredth of it would matter
  (``contact.reversible``);
- Delta Gamma is that of an infinite plane.
"""

from collections.abc import Callable, Iterator
from functools import partial
from math import cos, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad

from sim.laws import halfspace, jkr, schallamach
from sim.numerics.grid import Grid
from sim.solid import HalfSpace
from sim.spectrum.families import Gaussian, Ripple

# the PDMS lens of the paper's example, on an assumed sphere of 2 mm, under an assumed mean stress
SHEAR, WORK, WIDTH, WAVES = 1.6e6, 0.042, 0.24e-3, 10
SPHERE, STRESS, RADIUS = 2e-3, 3e5, 1.2e-4
MODULUS = 4.0 * SHEAR
LOAD, DEPTH = 4e-3, 3e-6
HERTZ_AT_LOAD = (0.75 * LOAD * SPHERE / MODULUS) ** (1 / 3)
HERTZ_AT_DEPTH = sqrt(DEPTH * SPHERE)
BODY = {"sphere_radius": SPHERE, "modulus": MODULUS}
LENS = {"work": WORK} | BODY
DISC = RADIUS, STRESS, SHEAR
#: Angles around a circle, over which means are exact to rounding, and their cosines and sines.
TURN = pi * np.arange(64) / 32
ALONG, ACROSS = np.cos(TURN), np.sin(TURN)
#: Radii over Hertz's at which dimensionless forms are compared.
RATIOS = np.linspace(0.9, 1.6, 5)


class Check(NamedTuple):
    """One line of ``sim paper``: a computed value, the expected one, and their relative difference.

    Parameters
    ----------
    name, equation : str
        Checked quantity, and its place in the paper.
    computed, expected : float
        The package's value and the independent one.
    error : float
        Relative difference.
    tolerance : float
        Largest error that passes.
    """

    name: str
    equation: str
    computed: float
    expected: float
    error: float
    tolerance: float

    @property
    def holds(self) -> bool:
        """True if the error is within the tolerance; False for nan."""
        return self.error <= self.tolerance

    @property
    def row(self) -> dict[str, str]:
        """Return the line as a row of a table, by its headings."""
        return {
            "": "ok" if self.holds else "FAILS",
            "equation": self.equation,
            "what": self.name,
            "computed": f"{self.computed:.9g}",
            "expected": f"{self.expected:.9g}",
            "error": f"{self.error:.1e}",
            "allowed": f"{self.tolerance:.0e}",
        }


#: A function of the radius.
Law = Callable[[Any], Any]
#: Arguments of ``_check`` for each line.
Rows = Iterator[tuple[Any, ...]]


def _check(
    name: str,
    equation: str,
    computed: ArrayLike,
    expected: ArrayLike,
    tolerance: float = 1e-11,
) -> Check:
    """Return a line from numbers or arrays; of arrays the worst entry is shown.

    The tolerance is that of roundings in sums of terms that nearly cancel.
    """
    value, wanted = np.broadcast_arrays(computed, expected)
    errors = np.abs(value / wanted - 1.0)
    worst = errors.argmax()  # a nan counts as the largest
    numbers = [float(each.flat[worst]) for each in (value, wanted, errors)]
    return Check._make([name, equation, *numbers, tolerance])


def _kernel(x: NDArray, y: NDArray) -> NDArray:
    """Return (A1) of the paper at unit shear modulus."""
    r = np.hypot(x, y)
    return (1.0 + x**2 / r**2) / (4.0 * pi * r)


def _slope(function: Law, at: Any) -> Any:
    """Return the derivative of an analytic function by a complex step, which is exact but for rounding."""
    return np.imag(function(at + 1e-30j)) / 1e-30


def _transform(direction: NDArray) -> NDArray:
    """Return the transform of (A1) at unit wavenumber and modulus: each harmonic leaves J_n(r), of integral 1."""
    ring = _kernel(ALONG, ACROSS)  # the kernel falls as 1/r
    second = np.mean(ring * np.cos(2.0 * TURN))
    return 2.0 * pi * (ring.mean() - 2.0 * np.cos(2.0 * direction) * second)


@np.vectorize
def _convolved(x: float, y: float) -> Any:
    """Return (A2): the kernel summed over the unit disc in polar coordinates around the observed point."""
    angle = 2.0 * pi * np.arange(2000) / 2000
    along, across = np.cos(angle), np.sin(angle)
    reach = np.sqrt(1.0 - (x * across - y * along) ** 2) - (x * along + y * across)
    # the kernel falls as 1/r, so that it times r is constant along a ray
    return 2.0 * pi * np.mean(reach * _kernel(along, across))


def _potential_h(s: Any, a: Any, stress: Any = STRESS) -> Any:
    """Return (21) of the paper, for the lens."""
    normal = a + 2.0 / 3.0 * a**3 / (SPHERE * s) + 0.2 * a**5 / (SPHERE * s) ** 2
    shear = 4.0 * stress**2 * a**3 / MODULUS
    return MODULUS * s**2 * normal - shear - pi * WORK * a**2


def _potential_g(force: float, a: Any) -> Any:
    """Return (30) of the paper, for the lens."""
    normal = -(force**2) / (4.0 * MODULUS * a) + force * a**2 / (3.0 * SPHERE)
    normal += 4.0 / 45.0 * MODULUS * a**5 / SPHERE**2
    return normal - 4.0 * STRESS**2 * a**3 / MODULUS - pi * WORK * a**2


def _point_force() -> Rows:
    angle = np.array([0.0, 0.6, pi / 2])
    x, y = np.cos(angle), np.sin(angle)
    cerruti = (1.0 + x**2) / (4.0 * pi * SHEAR * 3e-6)
    displacement = halfspace.point_displacement(3e-6 * x, 3e-6 * y, SHEAR)
    compliance = halfspace.compliance(x, y, 1.0)
    yield "displacement by a point force", "A1", displacement, cerruti
    yield "compliance, 3 directions", "40", compliance, _transform(angle)


def _disc() -> Rows:
    unit = STRESS * RADIUS / SHEAR

    def field(x: Any, y: Any) -> NDArray:
        return halfspace.disc_displacement(RADIUS * x, RADIUS * y, *DISC) / unit

    def ring(r: float) -> float:
        return field(r * ALONG, r * ACROSS).mean()

    rho = np.array([0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97])
    theta = np.array([[0.0], [0.4], [0.8], [1.2], [pi / 2]])
    x, y = rho * np.cos(theta), rho * np.sin(theta)
    closed = 3.0 / 4.0, 5.0 / (3.0 * pi), 4.0 / (3.0 * pi)
    mean, _ = quad(lambda r: 2.0 * r * ring(r), 0.0, 1.0, epsabs=1e-11)
    moved = halfspace.disc_mean_displacement(*DISC)
    by_modulus = 8.0 * STRESS * RADIUS / (pi * MODULUS)
    yield "displacement field, 40 points", "A8", field(x, y), _convolved(x, y)
    yield "... at the centre and the edge", "A8", field(*np.eye(2, 3, 1)), closed
    yield "mean of the field", "A9", mean, 2.0 / pi
    yield "mean displacement, K = 2/pi", "14, A9", moved / unit, 2.0 / pi
    yield "mean displacement by E*", "15", moved, by_modulus
    yield "mean along the edge", "9, 11", ring(1.0), 3.0 / (2.0 * pi)


def _uniform_stress() -> Rows:
    stored = halfspace.disc_tangential_energy(*DISC)
    edge = halfspace.disc_edge_mean_displacement(*DISC)
    grown = 12.0 * STRESS**2 * RADIUS**2 / MODULUS
    # work done on the contact's old area while it grows: tau dW/da less what the new rim displaces
    work = 2.0 * grown - 2.0 * pi * RADIUS * STRESS * edge
    potential = partial(jkr.potential_at_indentation, 3e-6, radius=RADIUS, **LENS)
    term = potential(stress=STRESS) - potential(stress=0.0)
    half = 4.0 * STRESS**2 * RADIUS**3 / MODULUS  # tau W/2
    per_area = 6.0 * STRESS**2 * RADIUS / (pi * MODULUS * WORK)
    yield "elastic energy of the uniform stress, tau W/2", "1, 16", stored, half
    yield "its Legendre term in H, -tau W/2", "4, 5", term, -half
    yield "slope of H by the uniform stress", "12", halfspace.edge_work(*DISC), -grown
    yield "cancellation: work done = energy stored", "7, 8, 10", work, grown
    yield "energy per new area over Delta gamma", "11", STRESS * edge / WORK, per_area


def _dimensionless(
    name: str,
    equations: tuple[str, str, str],
    hertz: float,
    laws: tuple[Law, Law, Law],
    normal: tuple[NDArray, NDArray],
) -> Rows:
    """Yield a potential and its slope at some radii, in units of the energy at Hertz's.

    ``laws`` are the package's potential and slope and the paper's potential by the radius. ``normal`` are the
    dimensionless terms of the potential and its slope without stress and adhesion.
    """
    potential, slope, by_paper = laws
    energy, radii = MODULUS * hertz**5 / SPHERE**2, RATIOS * hertz
    shear = (2.0 * SPHERE * STRESS / (MODULUS * hertz)) ** 2 * RATIOS**2
    adhesion = pi * SPHERE**2 * WORK / (MODULUS * hertz**3) * RATIOS
    reduced = normal[0] - RATIOS * (shear + adhesion)
    steepness = normal[1] - 3.0 * shear - 2.0 * adhesion
    slopes = slope(radii)
    yield (
        f"potential {name}, dimensionless",
        equations[0],
        potential(radii) / energy,
        reduced,
    )
    differences = _slope(by_paper, radii)
    yield f"d{name}/da by the potential", equations[1], slopes, differences
    yield f"d{name}/da, dimensionless", equations[2], slopes * hertz / energy, steepness


def _fixed_separation() -> Rows:
    s, a, x = -DEPTH, RADIUS, RATIOS

    # (17)-(19): stress and displacement in the contact, integrated with r = a sin(t)
    def ring(t: float) -> float:
        stress = (s / a + a / SPHERE) - 2.0 * a / SPHERE * cos(t) ** 2
        return 2.0 * a * a * MODULUS * sin(t) * stress

    def energy(t: float) -> float:
        return 0.5 * ring(t) * (s + (a * sin(t)) ** 2 / (2.0 * SPHERE))

    stressed, stored = (quad(of, 0.0, 0.5 * pi)[0] for of in (ring, energy))
    force = -jkr.load_under_indentation(a, -s, **BODY)
    bare = jkr.potential_at_indentation(s, 0.0, a, 0.0, **BODY)
    differences = _slope(lambda s: _potential_h(s, a), s)
    yield "force of the stress in the contact", "17-19, 22", force, stressed
    yield "normal elastic energy", "1, 21", bare, stored
    yield "force = dH/ds", "13, 22", force, differences
    yield from _dimensionless(
        "H",
        ("23, 24", "12, 25", "25"),
        HERTZ_AT_DEPTH,
        (
            partial(jkr.potential_at_indentation, s, STRESS, **LENS),
            partial(jkr.potential_slope_at_indentation, s, STRESS, **LENS),
            partial(_potential_h, s),
        ),
        (x - 2.0 / 3.0 * x**3 + x**5 / 5.0, 1.0 - 2.0 * x**2 + x**4),
    )


def _fixed_load() -> Rows:
    force, a, x = -LOAD, RADIUS, RATIOS
    s = force / (2.0 * MODULUS * a) - a**2 / (3.0 * SPHERE)
    separation = -jkr.indentation_under_load(a, LOAD, **BODY)
    potential: Law = partial(jkr.potential_at_load, force, STRESS, **LENS)
    slope = partial(jkr.potential_slope_at_load, force, STRESS, **LENS)
    transformed = _potential_g(force, a)
    yield "separation under a load", "29", separation, s
    yield "Legendre transform G = H - F s", "27, 30", potential(a), transformed
    yield from _dimensionless(
        "G",
        ("31", "28, 32", "32"),
        HERTZ_AT_LOAD,
        (potential, slope, partial(_potential_g, force)),
        (
            -4.0 / (9.0 * x) - 4.0 * x**2 / 9.0 + 4.0 * x**5 / 45.0,
            4.0 / (9.0 * x**2) - 8.0 * x / 9.0 + 4.0 * x**4 / 9.0,
        ),
    )


def _equilibrium() -> Rows:
    # with R = E* = 1 and a Hertz radius of 1
    gammas = np.array([0.1, 0.5, 1.0, 2.0])
    x = jkr.radius_at_indentation(1.0, gammas / pi, 1.0, 1.0)
    y = jkr.radius_at_load(4.0 / 3.0, gammas / pi, 1.0, 1.0)
    at_depth, at_load = np.sqrt(2.0 * gammas * x), np.sqrt(4.5 * gammas * y**3)
    reach = 3.0 * pi * WORK * SPHERE
    force = LOAD + reach + sqrt(2.0 * reach * LOAD + reach**2)
    johnson = (0.75 * SPHERE / MODULUS * force) ** (1 / 3)
    radius = jkr.radius_at_load(LOAD, **LENS)
    yield "JKR at a separation, dimensionless", "26", x**2, 1.0 + at_depth
    yield "JKR at a load, dimensionless", "32", y**3, 1.0 + at_load
    yield "JKR at a load, as of 1971", "32", radius, johnson


def _under_stress() -> Rows:
    """Yield the paper's result: with a uniform stress and its work a contact is that of JKR, never below Hertz."""
    stresses = np.array([1e4, STRESS, 3e6])
    work = 12.0 * stresses**2 / MODULUS  # (12), over the square of the radius
    sunk = jkr.radius_at_indentation(DEPTH, **LENS)
    pressed = jkr.radius_at_load(LOAD, **LENS)
    at_depth = _slope(partial(_potential_h, -DEPTH, stress=stresses), sunk)
    at_load = jkr.potential_slope_at_load(-LOAD, stresses, pressed, **LENS)
    works = np.append(0.0, np.geomspace(1e-6, 10.0, 29))
    by_depth = jkr.radius_at_indentation(DEPTH, works, **BODY) / HERTZ_AT_DEPTH
    by_load = jkr.radius_at_load(LOAD, works, **BODY) / HERTZ_AT_LOAD
    bare = by_depth[0], by_load[0]
    wide = np.mean(np.minimum(by_depth, by_load)[1:] >= 1.0)
    yield "JKR under 10 kPa, 0.3 and 3 MPa", "6, 25", at_depth, -work * sunk**2
    yield "slope of G = work of the stress", "28", at_load, -work * pressed**2
    yield "share of contacts no narrower than Hertz", "20", wide, 1.0
    yield "no adhesion: radius over Hertz's", "20", bare, 1.0


def _bonds() -> Rows:
    speed, critical, rate = np.array([1e-3, 2e-3, 3e-3]), 1e-2, 200.0
    # the model in which the law is exact: a life of stretch/speed, then a wait of 1/rate
    life, wait = critical / rate / speed, 1.0 / rate
    slow, fast = schallamach.steady_fraction([1e-3, 1e-2], critical)
    fixed = schallamach.steady_fraction(speed, critical)
    bonded = life / (life + wait)
    yield "N/N0 at 1 mm/s", "Sec. 3", slow, 10.0 / 11.0
    yield "... as printed, about 0.9", "Sec. 3", slow, 0.9, 0.05 / 0.9
    yield "N/N0 at 10 mm/s", "Sec. 3", fast, 0.5
    yield "N/N0 of bonds that break at one stretch", "Sec. 3", fixed, bonded


def _fluctuation() -> Rows:
    length, rms = 4e-6, 1e5
    energy = HalfSpace(SHEAR).stored_energy(Gaussian(rms, length))
    # r times the kernel and q G_x, around the circle
    ring = 2.0 * pi * np.mean(_kernel(ALONG, ACROSS)) / SHEAR
    yielding = 2.0 * pi * np.mean(1.0 + ACROSS**2) / (2.0 * SHEAR)
    # integrals of the correlation over r and of the density over q
    correlated, density = rms**2 * length * sqrt(pi) / 2.0, pi**1.5 * length * rms**2
    real, spectral = 0.5 * ring * correlated, yielding * density / (8.0 * pi**2)
    cell, points = 2e-4, 32
    stress = np.random.default_rng(1710).standard_normal((points, points)) * rms
    wave = 2.0 * pi * np.fft.fftfreq(points, cell / points)
    size = np.hypot(wave[:, None], wave)
    size[0, 0] = np.inf  # the mean stress moves nothing
    yielded = (1.0 + (wave / size) ** 2) / (2.0 * SHEAR * size)
    displacement = np.fft.ifft2(np.fft.fft2(stress) * yielded).real
    mapped = 0.5 * np.mean(stress * displacement)
    plain, lifted = (
        halfspace.surface_energy(stress + mean, cell, SHEAR) for mean in (0.0, STRESS)
    )
    state = -DEPTH, STRESS, RADIUS
    reduced = jkr.potential_at_indentation(*state, WORK - mapped, **BODY)
    total = _potential_h(-DEPTH, RADIUS) + mapped * pi * RADIUS**2
    radius = jkr.radius_at_indentation(DEPTH, WORK - energy, **BODY)
    deeper = sqrt(2.0 * pi * (WORK - real) * radius / MODULUS)
    yield "Delta Gamma in real space, Gaussian", "39", energy, real
    yield "Delta Gamma in Fourier space, Gaussian", "45", energy, spectral
    yield "<tau1 w1>/2 of a random map", "38, 44", plain, mapped
    yield "... with a mean stress on top", "33-38", lifted, mapped
    yield "total energy with Delta Gamma", "46, 47", reduced, total
    yield (
        "contact with Delta gamma - Delta Gamma",
        "47",
        radius**2 / SPHERE,
        DEPTH + deeper,
    )


def _ripple() -> Rows:
    points, amplitude, wavelength = 64, 375e3, WIDTH / WAVES
    q = 2.0 * pi / wavelength
    phase = q * WIDTH * np.arange(points) / points
    along = amplitude * np.cos(phase + 0.3)[:, None] * np.ones(points)
    line = np.abs(Grid(WIDTH, points).forward(along)[WAVES, 0])
    weight = (2.0 * pi * line / WIDTH**2) ** 2
    moved = halfspace.displacement(along, WIDTH, SHEAR).std()
    expected = amplitude / (2.0 * SHEAR * q) / sqrt(2.0)
    energy = amplitude**2 * wavelength / (16.0 * pi * SHEAR)
    closed = halfspace.ripple_energy(amplitude, q, 0.0, SHEAR)
    yield (
        "variance of a ripple",
        "48",
        Ripple(amplitude, wavelength).variance,
        amplitude**2 / 2.0,
    )
    yield "weight of its two spectral lines", "49", weight, pi**2 * amplitude**2
    yield "its displacement w1 = G_x tau1, rms", "41", moved, expected
    yield "its energy, tau1^2 L/(16 pi G k)", "50", closed, energy


def _masking() -> Rows:
    for length, shear, width, printed in (
        ("0.24", SHEAR, WIDTH, 375e3),
        ("4", 0.5e6, 4e-3, 51e3),
    ):
        amplitude = halfspace.masking_amplitude(WORK, width / WAVES, shear)
        closed = 4.0 * sqrt(pi * WAVES * shear * WORK / width)
        yield f"masking amplitude, L = {length} mm", "Sec. 4", amplitude, closed
        yield "... as printed, in kPa", "Sec. 4", amplitude, printed, 500.0 / printed
    amplitude = halfspace.masking_amplitude(WORK, WIDTH / WAVES, SHEAR)
    # a hair above, so that rounding cannot leave a trace of adhesion
    wave = Ripple(1.000001 * amplitude, WIDTH / WAVES)
    masked = HalfSpace(SHEAR).stored_energy(wave)
    contact = jkr.radius_at_load(LOAD, WORK - masked, **BODY)
    yield "a masked contact is Hertz's", "47", contact, HERTZ_AT_LOAD


SECTIONS = (
    _point_force,
    _disc,
    _uniform_stress,
    _fixed_separation,
    _fixed_load,
    _equilibrium,
    _under_stress,
    _bonds,
    _fluctuation,
    _ripple,
    _masking,
)


def checks() -> list[Check]:
    """Return all lines, in the order of the paper, its appendix first."""
    return [_check(*row) for section in SECTIONS for row in section()]
