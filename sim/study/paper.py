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

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar

from sim.laws import halfspace, jkr, schallamach
from sim.numerics.grid import Grid
from sim.spectrum.families import Gaussian, Ripple

# the PDMS lens of the paper's example, on an assumed sphere of 2 mm, under an assumed mean stress
SHEAR, WORK, WIDTH, WAVES = 1.6e6, 0.042, 0.24e-3, 10
SPHERE, STRESS, RADIUS = 2e-3, 3e5, 1.2e-4
MODULUS = 4.0 * SHEAR
LOAD, DEPTH = 4e-3, 3e-6
HERTZ_AT_LOAD, HERTZ_AT_DEPTH = (
    (0.75 * LOAD * SPHERE / MODULUS) ** (1 / 3),
    math.sqrt(DEPTH * SPHERE),
)
LENS = {"work": WORK, "sphere_radius": SPHERE, "modulus": MODULUS}
DISC, TURN = (RADIUS, STRESS, SHEAR), np.pi * np.arange(64) / 32


class Check(NamedTuple):
    """One line of ``sim paper``: a computed value, the expected one, and their relative difference.

    Parameters
    ----------
    name, equation : str
        What is checked, and where it stands in the paper.
    computed, expected : float
        The package's value and the independent one.
    error : float
        Relative difference; the difference itself where the expected value is 0.
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
        """Line as a row of a table, by its headings."""
        numbers = {
            "computed": f"{self.computed:.9g}",
            "expected": f"{self.expected:.9g}",
        }
        errors = {"error": f"{self.error:.1e}", "allowed": f"{self.tolerance:.0e}"}
        return {
            "": "ok" if self.holds else "FAILS",
            "equation": self.equation,
            "what": self.name,
            **numbers,
            **errors,
        }


#: What ``_check`` takes: name, equation, computed and expected value or values, largest error unless 1e-12.
Row = tuple[Any, ...]


def _check(
    name: str,
    equation: str,
    computed: ArrayLike,
    expected: ArrayLike,
    tolerance: float = 1e-12,
) -> Check:
    """A line from numbers or arrays; of arrays the worst entry is shown."""
    value, wanted = (
        np.atleast_1d(values).astype(float)
        for values in np.broadcast_arrays(computed, expected)
    )
    errors = np.abs(value - wanted) / np.where(wanted == 0.0, 1.0, np.abs(wanted))
    worst = np.unravel_index(
        np.argmax(np.where(np.isnan(errors), np.inf, errors)), errors.shape
    )
    return Check(
        name,
        equation,
        float(value[worst]),
        float(wanted[worst]),
        float(errors[worst]),
        tolerance,
    )


def _kernel(x: ArrayLike, y: ArrayLike) -> np.ndarray:
    """(A1) of the paper at unit shear modulus."""
    r = np.hypot(x, y)
    return (1.0 + np.square(x) / r**2) / (4.0 * np.pi * r)


def _slope(function: Callable[[float], float], at: float, step: float) -> float:
    """Derivative by central differences of two steps, extrapolated: exact for quartics."""
    wide, narrow = (
        float(function(at + h) - function(at - h)) / (2.0 * h)
        for h in (step, step / 2.0)
    )
    return (4.0 * narrow - wide) / 3.0


def _transform(direction: float) -> float:
    """Transform of (A1) at unit wavenumber and shear modulus: of each harmonic J_n(r) is left, of integral 1."""
    ring = _kernel(np.cos(TURN), np.sin(TURN))  # the kernel falls as 1/r
    return float(
        2.0
        * np.pi
        * (
            ring.mean()
            - 2.0 * math.cos(2.0 * direction) * np.mean(ring * np.cos(2.0 * TURN))
        )
    )


def _convolved(x: float, y: float) -> float:
    """(A2): kernel summed over the unit disc in polar coordinates around the observed point."""
    angle = 2.0 * np.pi * np.arange(2000) / 2000
    reach = np.sqrt(1.0 - (x * np.sin(angle) - y * np.cos(angle)) ** 2) - (
        x * np.cos(angle) + y * np.sin(angle)
    )
    # the kernel falls as 1/r, so that it times r is constant along a ray
    return float(2.0 * np.pi * np.mean(reach * _kernel(np.cos(angle), np.sin(angle))))


def _potential_h(s: float, a: float, stress: float = STRESS) -> float:
    """(21) of the paper, for the lens."""
    normal = a + 2.0 / 3.0 * a**3 / (SPHERE * s) + 0.2 * a**5 / (SPHERE * s) ** 2
    return (
        MODULUS * s**2 * normal
        - 4.0 * stress**2 * a**3 / MODULUS
        - math.pi * WORK * a**2
    )


def _potential_g(force: float, a: float) -> float:
    """(30) of the paper, for the lens."""
    normal = (
        -(force**2) / (4.0 * MODULUS * a)
        + force * a**2 / (3.0 * SPHERE)
        + 4.0 / 45.0 * MODULUS * a**5 / SPHERE**2
    )
    return normal - 4.0 * STRESS**2 * a**3 / MODULUS - math.pi * WORK * a**2


def _reduced(hertz: float) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
    """(24): radii over Hertz's, the unit of energy, and the shear and adhesion terms at those radii."""
    x = np.linspace(0.9, 1.6, 5)
    tau = 2.0 * SPHERE * STRESS / (MODULUS * hertz)
    gamma = np.pi * SPHERE**2 * WORK / (MODULUS * hertz**3)
    return x, MODULUS * hertz**5 / SPHERE**2, tau**2 * x**2, gamma * x


def _point_force() -> Iterator[Row]:
    angle = np.array([0.0, 0.6, np.pi / 2])
    cerruti = 1.5 / (2.0 * np.pi * 3.0 * SHEAR * 3e-6) * (1.0 + np.cos(angle) ** 2)
    displacement = halfspace.point_displacement(
        3e-6 * np.cos(angle), 3e-6 * np.sin(angle), SHEAR
    )
    yield "displacement by a point force", "A1", displacement, cerruti
    for name, direction in (
        ("along sliding", 0.0),
        ("oblique", 0.6),
        ("across", math.pi / 2),
    ):
        computed = halfspace.compliance(math.cos(direction), math.sin(direction), 1.0)
        yield f"compliance, {name}", "40", computed, _transform(direction)


def _disc() -> Iterator[Row]:
    rho, theta = np.meshgrid(
        [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 0.97], [0.0, 0.4, 0.8, 1.2, np.pi / 2]
    )
    x, y = rho * np.cos(theta), rho * np.sin(theta)
    unit = STRESS * RADIUS / SHEAR
    x_ends, y_ends = RADIUS * np.eye(2, 3, 1)
    v = halfspace.disc_displacement(x_ends, y_ends, *DISC) / unit

    def field(r: float) -> NDArray:
        return halfspace.disc_displacement(
            r * np.cos(TURN), r * np.sin(TURN), 1.0, 1.0, 1.0
        )

    mean, _ = quad(lambda r: 2.0 * r * field(r).mean(), 0.0, 1.0, epsabs=1e-11)
    volume = np.pi * RADIUS**2 * halfspace.disc_mean_displacement(*DISC)
    displacement, direct = (
        halfspace.disc_displacement(x, y, 1.0, 1.0, 1.0),
        np.vectorize(_convolved)(x, y),
    )
    yield "displacement field, 40 points", "A8", displacement, direct
    yield "... at the centre, tau0 a/G", "A8", v[0], 3.0 / 4.0
    yield (
        "... at the edge, along",
        "A8",
        v[1],
        3.0 / (2.0 * np.pi) + 1.0 / (6.0 * np.pi),
    )
    yield (
        "... at the edge, across",
        "A8",
        v[2],
        3.0 / (2.0 * np.pi) - 1.0 / (6.0 * np.pi),
    )
    yield "mean of the field", "A9", mean, 2.0 / np.pi, 1e-10
    yield (
        "mean displacement, K = 2/pi",
        "14, A9",
        volume / (np.pi * RADIUS**2 * unit),
        2.0 / np.pi,
    )
    yield (
        "mean displacement by E*",
        "15",
        volume / (8.0 * STRESS * RADIUS**3 / MODULUS),
        1.0,
    )
    yield "mean along the edge", "9, 11", field(1.0).mean(), 6.0 / (4.0 * np.pi)


def _uniform_stress() -> Iterator[Row]:
    stored, edge = (
        halfspace.disc_tangential_energy(*DISC),
        halfspace.disc_edge_mean_displacement(*DISC),
    )
    grown = _slope(lambda a: 4.0 * STRESS**2 * a**3 / MODULUS, RADIUS, 1e-5)
    # work done on the contact's old area while it grows: tau dW/da less what the new rim displaces
    work = 2.0 * grown - 2.0 * np.pi * RADIUS * STRESS * edge
    bare, loaded = (
        jkr.potential_at_indentation(3e-6, stress, RADIUS, **LENS)
        for stress in (0.0, STRESS)
    )
    volume, per_area = (
        8.0 * STRESS * RADIUS**3 / MODULUS,
        6.0 * STRESS**2 * RADIUS / (np.pi * MODULUS),
    )
    yield (
        "elastic energy of the uniform stress, tau W/2",
        "1, 16",
        stored,
        STRESS * volume / 2.0,
    )
    yield (
        "its Legendre term in H, -tau W/2",
        "4, 5",
        loaded - bare,
        -STRESS * volume / 2.0,
        1e-11,
    )
    yield "slope of H by the uniform stress", "12", halfspace.edge_work(*DISC), -grown
    yield "cancellation: work done = energy stored", "7, 8, 10", work, grown, 1e-11
    yield (
        "energy per new area over Delta gamma",
        "11",
        STRESS * edge / WORK,
        per_area / WORK,
    )


def _fixed_separation() -> Iterator[Row]:
    s, a, hertz = -DEPTH, RADIUS, HERTZ_AT_DEPTH
    # (17)-(19): stress and displacement in the contact, integrated with r = a sin(t)
    first, second = (
        MODULUS / np.pi * (s / a + a / SPHERE),
        -MODULUS / np.pi * 2.0 * a / SPHERE,
    )

    def ring(t: float) -> float:
        return 2.0 * np.pi * a * a * math.sin(t) * (first + second * math.cos(t) ** 2)

    stressed, _ = quad(ring, 0.0, 0.5 * np.pi)
    stored, _ = quad(
        lambda t: 0.5 * ring(t) * (s + (a * math.sin(t)) ** 2 / (2.0 * SPHERE)),
        0.0,
        0.5 * np.pi,
    )
    force = -jkr.load_under_indentation(a, -s, SPHERE, MODULUS)
    x, unit, shear, adhesion = _reduced(hertz)
    reduced = x * (1.0 - 2.0 / 3.0 * x**2 + x**4 / 5.0 - shear - adhesion)
    steepness = 1.0 - 2.0 * x**2 + x**4 - 3.0 * shear - 2.0 * adhesion
    whole = jkr.potential_at_indentation(s, STRESS, x * hertz, **LENS)
    slopes = jkr.potential_slope_at_indentation(s, STRESS, x * hertz, **LENS)
    by_radius = [_slope(lambda a: _potential_h(s, a), y * hertz, 1e-6) for y in x]
    yield "force of the stress in the contact", "17-19, 22", force, stressed, 1e-11
    bare = jkr.potential_at_indentation(s, 0.0, a, 0.0, SPHERE, MODULUS)
    yield "normal elastic energy", "1, 21", bare, stored, 1e-11
    yield (
        "force = dH/ds",
        "13, 22",
        force,
        _slope(lambda s: _potential_h(s, a), s, 1e-6),
        1e-9,
    )
    yield "potential H, dimensionless", "23, 24", whole / unit, reduced, 1e-11
    yield "dH/da against differences", "12, 25", slopes, by_radius, 1e-7
    yield "dH/da, dimensionless", "25", slopes * hertz / unit, steepness, 1e-11


def _fixed_load() -> Iterator[Row]:
    force, a, hertz = -LOAD, RADIUS, HERTZ_AT_LOAD
    s = force / (2.0 * MODULUS * a) - a**2 / (3.0 * SPHERE)
    x, unit, shear, adhesion = _reduced(hertz)
    reduced = (
        -4.0 / (9.0 * x) - 4.0 * x**2 / 9.0 + 4.0 * x**5 / 45.0 - x * (shear + adhesion)
    )
    steepness = (
        4.0 / (9.0 * x**2)
        - 8.0 * x / 9.0
        + 4.0 * x**4 / 9.0
        - 3.0 * shear
        - 2.0 * adhesion
    )
    whole = jkr.potential_at_load(force, STRESS, a, **LENS)
    wholes = jkr.potential_at_load(force, STRESS, x * hertz, **LENS)
    slopes = jkr.potential_slope_at_load(force, STRESS, x * hertz, **LENS)
    by_radius = [_slope(lambda a: _potential_g(force, a), y * hertz, 1e-6) for y in x]
    yield (
        "separation under a load",
        "29",
        -jkr.indentation_under_load(a, LOAD, SPHERE, MODULUS),
        s,
    )
    yield (
        "Legendre transform G = H - F s",
        "27, 30",
        whole,
        _potential_g(force, a),
        1e-11,
    )
    yield "potential G, dimensionless", "31", wholes / unit, reduced, 1e-11
    yield "dG/da against differences", "28, 32", slopes, by_radius, 1e-7
    yield "dG/da, dimensionless", "32", slopes * hertz / unit, steepness, 1e-11


def _equilibrium() -> Iterator[Row]:
    gammas = np.array([0.1, 0.5, 1.0, 2.0])
    works = gammas / np.pi  # with R = E* = 1 and a Hertz radius of 1
    by_depth = [
        brentq(lambda x, g=g: (x * x - 1) ** 2 - 2 * g * x, 1.0, 4.0, xtol=1e-15)
        for g in gammas
    ]
    by_load = [
        brentq(lambda x, g=g: 2 * (x**3 - 1) ** 2 - 9 * g * x**3, 1.0, 4.0, xtol=1e-15)
        for g in gammas
    ]
    reach = 3.0 * np.pi * WORK * SPHERE
    johnson = (
        0.75
        * SPHERE
        / MODULUS
        * (LOAD + reach + math.sqrt(2.0 * reach * LOAD + reach**2))
    ) ** (1 / 3)
    radius = jkr.radius_at_load(LOAD, **LENS)
    indentation = jkr.indentation_under_load(radius, LOAD, SPHERE, MODULUS)
    lowest = minimize_scalar(
        lambda a: (
            4 * MODULUS * a**3 / (3 * SPHERE)
            - math.sqrt(8 * math.pi * WORK * MODULUS * a**3)
        ),
        bounds=(1e-6, 1e-4),
        method="bounded",
        options={"xatol": 1e-12},
    )
    yield (
        "JKR at a separation, dimensionless",
        "26",
        jkr.radius_at_indentation(1.0, works, 1.0, 1.0),
        by_depth,
    )
    yield (
        "JKR at a load, dimensionless",
        "32",
        jkr.radius_at_load(4.0 / 3.0, works, 1.0, 1.0),
        by_load,
    )
    yield "JKR at a load, as of 1971", "32", radius, johnson
    yield (
        "one state, two controls",
        "26, 32",
        jkr.radius_at_indentation(indentation, **LENS),
        johnson,
    )
    yield "pull-off load", "32", jkr.pull_off_load(WORK, SPHERE), lowest.fun, 1e-10


def _under_stress() -> Iterator[Row]:
    """The paper's result: with a uniform stress, and its work, the contact is that of JKR, never below Hertz."""
    stresses = np.array([1e4, STRESS, 3e6])

    def unbalanced(a: float, stress: float) -> float:
        pushed = 12.0 * stress**2 * a**2 / MODULUS  # (12): minus the work of the stress
        return _slope(lambda b: _potential_h(-DEPTH, b, stress), a, 1e-6) + pushed

    at_depth = [brentq(unbalanced, 8e-5, 3e-4, (stress,)) for stress in stresses]
    radius = jkr.radius_at_load(LOAD, **LENS)
    slopes = jkr.potential_slope_at_load(-LOAD, stresses, radius, **LENS)
    works = np.geomspace(1e-6, 10.0, 29)
    pressed = jkr.radius_at_load(LOAD, works, SPHERE, MODULUS) >= HERTZ_AT_LOAD
    sunk = jkr.radius_at_indentation(DEPTH, works, SPHERE, MODULUS) >= HERTZ_AT_DEPTH
    bare = (
        jkr.radius_at_load(LOAD, 0.0, SPHERE, MODULUS),
        jkr.radius_at_indentation(DEPTH, 0.0, SPHERE, MODULUS),
    )
    yield (
        "JKR under 10 kPa, 0.3 and 3 MPa",
        "6, 25",
        jkr.radius_at_indentation(DEPTH, **LENS),
        at_depth,
        1e-7,
    )
    yield (
        "slope of G = work of the stress",
        "28",
        slopes,
        -12.0 * stresses**2 * radius**2 / MODULUS,
        1e-8,
    )
    yield (
        "share of contacts no narrower than Hertz",
        "20",
        np.mean([pressed, sunk]),
        1.0,
    )
    yield "no adhesion: Hertz", "20", bare, [HERTZ_AT_LOAD, HERTZ_AT_DEPTH]


def _bonds() -> Iterator[Row]:
    speed, critical, rebinding_rate = np.array([1e-3, 2e-3, 3e-3]), 1e-2, 200.0
    # the model in which the law is exact: a life of stretch/speed, then a wait of 1/rebinding_rate
    life, wait = critical / rebinding_rate / speed, 1.0 / rebinding_rate
    slow, fast = schallamach.steady_fraction([1e-3, 1e-2], critical)
    fixed = schallamach.steady_fraction(speed, critical)
    yield "N/N0 at 1 mm/s", "Sec. 3", slow, 10.0 / 11.0
    yield "... as printed, about 0.9", "Sec. 3", slow, 0.9, 0.05 / 0.9
    yield "N/N0 at 10 mm/s", "Sec. 3", fast, 0.5
    yield (
        "N/N0 of bonds that break at one stretch",
        "Sec. 3",
        fixed,
        life / (life + wait),
    )


def _fluctuation() -> Iterator[Row]:
    length, rms = 4e-6, 1e5
    energy = np.asarray(Gaussian(rms, length).surface_energy(SHEAR), float)
    # r times the kernel, around the circle
    ring = 2.0 * np.pi * np.mean(_kernel(np.cos(TURN), np.sin(TURN))) / SHEAR
    correlated, _ = quad(
        lambda r: rms**2 * math.exp(-((r / length) ** 2)), 0.0, 8.0 * length
    )
    # q G_x, around the circle
    yielding = 2.0 * np.pi * np.mean(1.0 + np.sin(TURN) ** 2) / (2.0 * SHEAR)
    density, _ = quad(
        lambda q: np.pi * (length * rms) ** 2 * math.exp(-((q * length) ** 2) / 4.0),
        0.0,
        16.0 / length,
    )
    real, spectral = 0.5 * ring * correlated, yielding * density / (8.0 * np.pi**2)
    cell, points = 2e-4, 32
    stress = np.random.default_rng(1710).standard_normal((points, points)) * rms
    wave = 2.0 * np.pi * np.fft.fftfreq(points, cell / points)
    size = np.hypot(wave[:, None], wave)
    size[0, 0] = np.inf  # the mean stress moves nothing
    displacement = np.fft.ifft2(
        np.fft.fft2(stress) * (1.0 + (wave / size) ** 2) / (2.0 * SHEAR * size)
    ).real
    mapped = 0.5 * np.mean(stress * displacement)
    lifted = halfspace.surface_energy(stress + STRESS, cell, SHEAR)
    reduced = jkr.potential_at_indentation(
        -DEPTH, STRESS, RADIUS, WORK - mapped, SPHERE, MODULUS
    )
    total = _potential_h(-DEPTH, RADIUS) + mapped * np.pi * RADIUS**2
    radius = jkr.radius_at_indentation(DEPTH, WORK - energy, SPHERE, MODULUS)

    def balance(a: float) -> float:
        return (
            MODULUS * (a * a / SPHERE - DEPTH) ** 2 - 2.0 * math.pi * (WORK - real) * a
        )

    yield "Delta Gamma in real space, Gaussian", "39", energy, real, 1e-10
    yield "Delta Gamma in Fourier space, Gaussian", "45", energy, spectral, 1e-10
    yield (
        "<tau1 w1>/2 of a random map",
        "38, 44",
        halfspace.surface_energy(stress, cell, SHEAR),
        mapped,
    )
    yield "... with a mean stress on top", "33-38", lifted, mapped, 1e-11
    yield "total energy with Delta Gamma", "46, 47", reduced, total, 1e-11
    yield (
        "contact with Delta gamma - Delta Gamma",
        "47",
        radius,
        brentq(balance, 7.8e-5, 3e-4, xtol=1e-18),
        1e-10,
    )


def _ripple() -> Iterator[Row]:
    cell, points, amplitude = WIDTH, 64, 375e3
    q = 2.0 * np.pi * WAVES / cell
    phase = 2.0 * np.pi * WAVES * np.arange(points) / points
    along = amplitude * np.cos(phase + 0.3)[:, None] * np.ones(points)
    weight = (
        np.abs(Grid(cell, points).forward(along)[WAVES, 0]) ** 2
        / cell**2
        * (2.0 * np.pi / cell) ** 2
    )
    displacement = (
        np.max(np.abs(np.fft.rfft2(halfspace.displacement(along, cell, SHEAR))))
        * 2.0
        / points**2
    )
    closed = halfspace.ripple_energy(amplitude, q, 0.0, SHEAR)
    yield (
        "variance of a ripple",
        "48",
        Ripple(amplitude, cell / WAVES).variance,
        amplitude**2 / 2.0,
    )
    yield "weight of its two spectral lines", "49", weight, np.pi**2 * amplitude**2
    yield (
        "its displacement w1 = G_x tau1",
        "41",
        displacement,
        amplitude / (2.0 * SHEAR * q),
    )
    yield (
        "its energy, by its map",
        "50",
        halfspace.surface_energy(along, cell, SHEAR),
        amplitude**2 / (8.0 * SHEAR * q),
    )
    yield (
        "its energy, tau1^2 L/(16 pi G k)",
        "50",
        closed,
        amplitude**2 / (16 * np.pi * SHEAR) * WIDTH / WAVES,
    )


def _masking() -> Iterator[Row]:
    # a hair above, so that rounding cannot leave a trace of adhesion
    lens = halfspace.masking_amplitude(WORK, WIDTH / WAVES, SHEAR)
    masked = np.asarray(
        Ripple(1.000001 * lens, WIDTH / WAVES).surface_energy(SHEAR), float
    )
    contact = jkr.radius_at_load(LOAD, WORK - masked, SPHERE, MODULUS)
    for length, shear, width, printed in (
        ("0.24", SHEAR, WIDTH, 375.0),
        ("4", 0.5e6, 4e-3, 51.0),
    ):
        amplitude = halfspace.masking_amplitude(WORK, width / WAVES, shear)
        closed = 4.0 * math.sqrt(np.pi * WAVES * shear * WORK / width)
        yield f"masking amplitude, L = {length} mm", "Sec. 4", amplitude, closed
        yield (
            "... in kPa, as printed",
            "Sec. 4",
            amplitude / 1e3,
            printed,
            0.5 / printed,
        )
    yield "a masked contact is Hertz's", "47", contact, HERTZ_AT_LOAD


def checks() -> list[Check]:
    """All lines, in the order of the paper, its appendix first."""
    sections = (
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
    return [_check(*row) for section in sections for row in section()]
