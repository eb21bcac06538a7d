"""Closed forms of the bond populations: the linear law and its exact step, and what replaces it."""

import math

import mpmath as mp
import numpy as np
import pytest
from helpers.cases import some
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

from sim.laws import schallamach as law

CRITICAL, HEALING = 1e-2, 200.0
EXPONENTS = 10.0 ** np.arange(-9, 10)  # rate x duration


def test_the_onset_of_mean_field_is_that_of_the_eigenvalues_and_moves_with_mass_yielding_and_damping():
    for speed, beta, stiffness, frequency in (
        (10.0, 1.0, 0.0390213, 4.691569),
        (20.0, 1.0, 0.0515158, 9.999753),
        (50.0, 10.0, 0.1823410, 24.876979),
        (100.0, 1.0, 0.0378665, 46.056227),
    ):
        onset = law.first_moment_onset(speed, 1.0, 1.0, 1.0, beta, 1.0, law.Body(1.0))
        assert_allclose(onset, (stiffness, frequency), rtol=2e-6)
        slow = law.first_moment_onset(0.5, 1.0, 1.0, 1.0, beta, 1.0, law.Body(1.0))
        assert slow.stiffness == 0.0
    for body in (
        law.Body(1.0),
        law.Body(1.0, area_growth=0.5),
        law.Body(1.0, mass=1e-2),
        law.Body(1.0, damping=2e-3),
        law.Body(1.0, mass=1e-3, contact_stiffness=0.05),
        law.Body(2.0, viscosity=5e-4),
        law.Body(1.0, mass=1e-3, damping=1e-3, contact_stiffness=0.05),
        law.Body(2.0, 0.5, -0.1, 1e-3, 1e-3, 1e-4, 0.5, 0.5),
    ):
        stiffness, frequency = law.first_moment_onset(
            10.0, 1.0, 1.0, 1.0, 1.0, 1.0, body
        )
        # bonds N and stretches x of a site, slip and body: small motions of the equations of the closure themselves
        tilt = 1.7455280027406994  # x e^x = 10
        rate, turns = 10.0 / tilt, 1j * frequency
        bound = 1.0 / (1.0 + rate)
        rows = [
            [turns + 1.0 + rate, bound * rate],
            [tilt * turns / bound, turns + rate * (1.0 + tilt)],
        ]
        more, stretched = np.linalg.solve(rows, [0.0, turns])
        moment = bound * stretched + tilt * more
        spread = body.area_growth * more / bound + body.stress_growth * moment / (
            bound * tilt
        )
        force = body.area * (bound * tilt + 10.0 * body.viscosity)
        pulls = body.area * (moment + body.viscosity * turns) + force * spread
        slip = (
            1.0
            + (pulls - body.contact_growth * force * spread) / body.contact_stiffness
        )
        spring = stiffness + body.damping * turns + body.mass * turns**2
        assert abs(spring * slip + pulls) < 1e-12 * abs(pulls), body

    def onset(area=1.0, **body):
        return law.first_moment_onset(
            10.0, 1.0, 1.0, 1.0, 1.0, 1.0, law.Body(area, **body)
        )

    assert_allclose(
        onset(mass=[1e-3, 1e-2]).stiffness, (0.0610321013, 0.2591294488), rtol=1e-8
    )
    assert_allclose(
        onset(mass=[0.0, 1e-3], contact_stiffness=0.05).stiffness,
        (0.1777133504, 0.1997241668),
        rtol=1e-8,
    )
    assert_allclose(
        onset(damping=[1e-3, 2e-3]).stiffness, (0.0319311178, 0.0241019898), rtol=1e-8
    )
    assert_allclose(
        onset(area=2.0, viscosity=5e-4).stiffness,
        2.0 * onset(damping=5e-4).stiffness,
        rtol=1e-12,
    )
    assert onset(contact_stiffness=0.03).stiffness == math.inf
    for held in onset(damping=10.0), onset(viscosity=10.0, contact_stiffness=0.03):
        assert held.stiffness == 0.0
        assert np.isnan(held.frequency)
    with np.errstate(invalid="ignore"):
        assert np.isnan(onset(area=math.nan)).all()  # of an open contact


def test_a_step_solves_the_rate_equation_and_transitions_are_those_of_its_generator():
    for speed in [0.0, 3e-3, 0.5]:
        duration = 4e-3
        exact = solve_ivp(
            lambda t, y: HEALING * (1.0 - y - speed / CRITICAL * y),
            (0.0, duration),
            [0.3],
            rtol=1e-12,
            atol=1e-14,
        )
        stepped = law.relax_fraction(0.3, speed * duration, duration, CRITICAL, HEALING)
        assert_allclose(stepped, exact.y[0, -1], rtol=1e-10, atol=0)
    # the next term of the exponential is 1e-9 of the first
    assert_allclose(
        law.relax_fraction(0.0, 5e-15, 1e-9 / HEALING, CRITICAL, HEALING),
        1e-9,
        rtol=1e-9,
        atol=0,
    )
    for start in [0.0, 0.3, 1.0]:
        for ratio in [0.0, 1e-6, 0.2, 1e9]:
            duration = EXPONENTS / (HEALING * (1.0 + ratio))
            path = ratio * CRITICAL * duration
            once = law.relax_fraction(start, path, duration, CRITICAL, HEALING)
            parts = np.full_like(once, start)
            for _ in range(7):
                parts = law.relax_fraction(
                    parts, path / 7.0, duration / 7.0, CRITICAL, HEALING
                )
            # nothing is left of bonds that opened e^-z ago: compare above the smallest normal number
            alive = once > 1e-300
            assert_allclose(parts[alive], once[alive], rtol=1e-12, atol=0)
    for ratio in [0.0, 0.2, 1e9]:
        duration = EXPONENTS / HEALING
        path = ratio * CRITICAL * duration
        steady = law.steady_fraction(ratio * CRITICAL, CRITICAL)
        assert_allclose(
            law.relax_fraction(steady, path, duration, CRITICAL, HEALING),
            steady,
            rtol=1e-13,
            atol=0,
        )
        late = law.relax_fraction([0.0, 1.0], path[-1], duration[-1], CRITICAL, HEALING)
        assert_allclose(late, steady, rtol=1e-13, atol=0)
    assert law.relax_fraction(0.37, 0.0, 0.0, CRITICAL, HEALING) == 0.37
    assert law.relax_fraction(0.37, 1.0, 1.0, CRITICAL, 0.0) == 0.37
    jump = law.relax_fraction(0.5, 1e-5, 0.0, CRITICAL, HEALING)
    assert_allclose(jump, 0.5 * np.exp(-HEALING * 1e-5 / CRITICAL), rtol=1e-14, atol=0)
    assert law.relax_fraction(0.5, np.inf, 1.0, CRITICAL, HEALING) == 0.0
    assert np.isnan(law.relax_fraction(np.nan, 1e-5, 1e-3, CRITICAL, HEALING))
    path, duration = 3e-5, 2e-3
    closing, opening = HEALING, HEALING * path / duration / CRITICAL
    values, vectors = np.linalg.eig(
        np.array([[-opening, closing], [opening, -closing]])
    )
    # columns: from bound, from open
    flow = (vectors * np.exp(values * duration)) @ np.linalg.inv(vectors)
    stay, become = law.transition_probabilities(path, duration, CRITICAL, HEALING)
    assert_allclose([stay, become], flow[0], rtol=1e-12, atol=0)
    mean = law.relax_fraction(0.3, path, duration, CRITICAL, HEALING)
    assert_allclose(0.3 * stay + 0.7 * become, mean, rtol=1e-14, atol=0)
    for probability in law.transition_probabilities(
        EXPONENTS * CRITICAL, EXPONENTS, CRITICAL, HEALING
    ):
        assert np.all((probability >= 0.0) & (probability <= 1.0))
    speed = np.array([1e-3, 1e-2, -1e-2, 0.0, -0.0, np.inf, -np.inf])
    assert_allclose(
        law.steady_fraction(speed, 1e-2),
        [10 / 11, 0.5, 0.5, 1.0, 1.0, 0.0, 0.0],
        rtol=1e-15,
        atol=0,
    )
    assert np.isnan(law.steady_fraction(np.nan, 1e-2))
    assert law.steady_fraction(1.0, np.inf) == 1.0


def test_populations_have_their_limits_in_lives_force_and_speed():
    assert_array_equal(
        law.rest_share([0.0, 1.0, 3.0, 1.0], [2.0, 0.0, 1.0, math.inf]),
        [1.0, 0.0, 0.25, 1.0],
    )
    assert_array_equal(
        law.renewal(math.inf, math.inf, math.inf, 0.0, 1.0, 1.0), [1.0, 0.0, 0.0]
    )
    assert_array_equal(law.renewal(0.0, 0.0, 0.0, math.inf, 1.0, 1.0), [0.0, 0.0, 0.0])
    assert_array_equal(law.renewal(1.0, 0.5, 1 / 3, 1.0, 1.0, 0.0), [0.0, 0.0, 0.0])
    speed, stretch, rate, stiffness = np.array([1e-9, 1e-3, 1.0]), 1e-6, 200.0, 1e-3
    life = stretch / speed
    bound, force, square = law.renewal(
        life, life**2 / 2, life**3 / 3, speed, stiffness, rate
    )
    paper = law.steady_fraction(speed, stretch * rate)
    assert_allclose(bound, paper, rtol=1e-15, atol=0)
    assert_allclose(force, stiffness * stretch / 2 * paper, rtol=1e-14, atol=0)
    assert_allclose(square, (stiffness * stretch) ** 2 / 3 * paper, rtol=1e-14, atol=0)
    k0, force, stiffness, k_on, speed = some_bonds()
    lives = law.bell_lives(speed, k0, force, stiffness)
    units = k0 ** -np.array([[1.0], [2.0], [3.0]])
    scaled = law.bell_lives(stiffness * speed / force / k0, 1.0, 1.0, 1.0)
    assert_allclose(lives, units * scaled, rtol=1e-12, atol=0)
    moments = law.bell_moments(speed, k0, force, stiffness, k_on)
    assert_allclose(
        moments, law.renewal(*lives, speed, stiffness, k_on), rtol=1e-14, atol=0
    )
    k0, _, stiffness, k_on, speed = some_bonds()
    constant = law.constant_moments(speed, k0, stiffness, k_on)
    assert_allclose(
        law.bell_moments(speed, k0, math.inf, stiffness, k_on),
        constant,
        rtol=1e-14,
        atol=0,
    )
    # eps = 1e-9; the next terms are eps, 3 eps, 6 eps of the first
    stiff = 1e9 * stiffness * speed / k0
    assert_allclose(
        law.bell_moments(speed, k0, stiff, stiffness, k_on), constant, rtol=6e-9, atol=0
    )
    assert_allclose(constant.bound, law.rest_share(k0, k_on), rtol=1e-15, atol=0)
    k0, k_on = 20.0, 30.0
    assert_allclose(
        law.bell_lives(0.0, k0, 1e-11, 1e-3),
        [1 / k0, 1 / k0**2, 2 / k0**3],
        rtol=1e-15,
        atol=0,
    )
    assert_allclose(
        law.bell_moments(0.0, k0, 1e-11, 1e-3, k_on),
        [0.6, 0.0, 0.0],
        rtol=1e-15,
        atol=0,
    )
    for infinite in (math.inf, -math.inf):
        assert_array_equal(law.bell_lives(infinite, k0, 1e-11, 1e-3), [0.0, 0.0, 0.0])
        assert_array_equal(
            law.bell_moments(infinite, k0, 1e-11, 1e-3, k_on), [0.0, 0.0, 0.0]
        )
    assert_array_equal(
        law.bell_fraction([0.0, math.inf], k0, 1e-11, 1e-3, k_on), [1.0, 0.0]
    )
    assert np.isnan(law.bell_moments(math.nan, k0, 1e-11, 1e-3, k_on)).all()
    k0, force, stiffness, k_on, speed = some_bonds()
    bound = law.bell_moments(speed, k0, force, stiffness, k_on).bound
    fraction = law.bell_fraction(speed, k0, force, stiffness, k_on)
    assert_allclose(fraction, bound / law.rest_share(k0, k_on), rtol=1e-14, atol=0)
    life = law.bell_lives(1.0, 1.0, 1.0, 1.0).mean
    assert_allclose(
        law.bell_fraction(1.0, 1.0, 1.0, 1.0, [0.0, math.inf]),
        [life, 1.0],
        rtol=1e-14,
        atol=0,
    )


@pytest.mark.parametrize(
    "eps", some([1e-6, 1e-3, 0.3, 1.0, 30.0, 1e4, 1e8], 1e-3, 1.0, 1e4)
)
def test_bell_lives_to_thirty_digits_and_their_populations(eps):
    lives = []
    with mp.workdps(30):
        z = 1 / mp.mpf(eps)
        edges = [
            0,
            *(mp.mpf(10) ** k for k in range(-8, 0) if z < 1),
            1,
            4,
            12,
            30,
            70,
            150,
        ]
        for order in range(3):
            # z^(n + 1) int t^n S dt by the time t = ln(1 + w/z), scaled to 1 at rest
            def density(w, n=order):
                return (z * mp.log1p(w / z)) ** n * mp.exp(-w) / (1 + w / z)

            lives.append(float(mp.quad(density, edges, method="gauss-legendre")))
    assert_allclose(law.bell_lives(eps, 1.0, 1.0, 1.0), lives, rtol=1e-12, atol=0)
    beta = np.array([0.1, 1.0, 10.0])
    exact = [life * eps**n / (lives[0] + 1 / beta) for n, life in enumerate(lives)]
    assert_allclose(
        law.bell_moments(eps, 1.0, 1.0, 1.0, beta), exact, rtol=1e-13, atol=0
    )


def some_bonds(count=12, seed=41):
    """Bonds in SI, of all kinds: k0 [1/s], f_b [N], kappa [N/m], k_on [1/s], and speeds from slow to fast [m/s]."""
    draw = np.random.default_rng(seed).uniform
    k0, force = 10.0 ** draw(-3, 3, count), 10.0 ** draw(-12, -9, count)
    stiffness, k_on = 10.0 ** draw(-4, 0, count), k0 * 10.0 ** draw(-2, 3, count)
    return (
        k0,
        force,
        stiffness,
        k_on,
        k0 * force / stiffness * 10.0 ** draw(-3, 5, count),
    )


def test_no_speed_has_more_friction_than_the_peak_and_half_the_bonds_are_left_at_the_critical_speed():
    k0, force, stiffness, k_on, _ = some_bonds(6)
    for peak_of, stress_of in (
        (law.bell_peak, law.bell_stress),
        (law.first_moment_peak, law.first_moment_stress),
    ):
        peak = peak_of(k0, force, stiffness, k_on, 1e16)
        assert_allclose(
            peak.stress,
            stress_of(peak.speed, k0, force, stiffness, k_on, 1e16),
            rtol=1e-13,
            atol=0,
        )
        for *bond, speed, stress in zip(k0, force, stiffness, k_on, *peak, strict=True):
            highest = minimize_scalar(
                lambda x: -stress_of(speed * math.exp(x), *bond, 1e16) / stress,
                bounds=(-3.0, 3.0),
                method="bounded",
                options={"xatol": 1e-7},
            )
            # a search ends within about the root of the rounding of the top, which leaves the top itself to 1e-12
            assert_allclose(-highest.fun, 1.0, rtol=1e-12, atol=0)
            assert abs(highest.x) < 1e-6
    beta = np.geomspace(1e-12, 1e12, 49)
    peak = law.bell_peak(1.0, 1.0, 1.0, beta, 1.0)
    for factor in (0.9, 1.1):
        assert np.all(
            law.bell_stress(factor * peak.speed, 1.0, 1.0, 1.0, beta, 1.0) < peak.stress
        )
    critical = law.bell_critical_speed(1.0, 1.0, 1.0, beta)
    assert_allclose(
        law.bell_fraction(critical, 1.0, 1.0, 1.0, beta), 0.5, rtol=1e-13, atol=0
    )
    assert_array_equal(
        law.bell_peak(1.0, 1.0, 1.0, [0.0, math.inf], 1.0).stress, [0.0, math.inf]
    )
    assert law.bell_critical_speed(1.0, 1.0, 1.0, math.inf) == math.inf
    beta = [1.0, 10.0, 100.0]
    ratio = (
        law.first_moment_peak(1.0, 1.0, 1.0, beta, 1.0).stress
        / law.bell_peak(1.0, 1.0, 1.0, beta, 1.0).stress
    )
    assert_allclose(ratio, [1.27, 1.37, 1.47], rtol=0, atol=0.006)


@pytest.mark.parametrize("beta", [0.1, 10.0, 1e3])
def test_bonds_of_a_critical_speed_and_a_largest_stress_have_both_to_ten_digits(beta):
    wanted, force, stiffness = (3e-3, 2e5), 4e-12, 8e-7

    # share bound and mean force in units of f_b, by integrals over the age s = k0 t
    def of_density(z):
        last = z * math.log1p(60.0 / z)
        life, moment = (
            quad(
                lambda s, n=n: s**n * math.exp(-z * math.expm1(s / z)),
                0.0,
                last,
                epsabs=0.0,
                epsrel=1e-12,
                limit=200,
            )[0]
            for n in (0, 1)
        )
        return life / (life + 1.0 / beta), moment / z / (life + 1.0 / beta)

    def of_mean(z):
        tilt = float(mp.lambertw(1.0 / mp.mpf(z)).real)
        share = beta / (beta + math.exp(tilt))
        return share, tilt * share

    for numbers, population in (
        (law.bell_numbers, of_density),
        (law.first_moment_numbers, of_mean),
    ):
        k0, k_on, sites = numbers(*wanted, force, stiffness, beta)
        z = k0 * force / (stiffness * wanted[0])
        assert_allclose(
            [k_on / k0, population(z)[0] * (1.0 + beta) / beta], [beta, 0.5], rtol=1e-10
        )
        ends = math.log(1e-3 * z), math.log(1e3 * z)
        top = minimize_scalar(
            lambda x: -population(math.exp(x))[1],
            bounds=ends,
            method="bounded",
            options={"xatol": 1e-6},
        )
        assert_allclose(-top.fun * sites * force, wanted[1], rtol=1e-10)


def test_mean_field_is_the_closure_to_fifty_digits_with_its_limits():
    eps, beta = (
        np.array([0.01, 0.1, 1.0, 3.0, 10.0, 100.0, 1e3]),
        np.array([[0.1], [1.0], [10.0], [100.0]]),
    )
    with mp.workdps(50):
        # x e^x = eps
        stretch = np.array([mp.lambertw(mp.mpf(value)).real for value in eps])
        bound = beta / (beta + np.array([mp.exp(x) for x in stretch]))
        at_peak = np.array(
            [1 + mp.lambertw(mp.mpf(value) / mp.e).real for value in beta[:, 0]]
        )
        # x b/(b + e^x) is largest at x
        rupture = np.array([mp.exp(x) for x in at_peak])
        peak = at_peak * [rupture, beta[:, 0] / (beta[:, 0] + rupture)]
        exact = (
            stretch.astype(float),
            bound.astype(float),
            (bound * stretch).astype(float),
        )
    assert_allclose(
        law.first_moment_stretch(eps, 1.0, 1.0, 1.0), exact[0], rtol=2e-15, atol=0
    )
    fraction = law.rest_share(1.0, beta) * law.first_moment_fraction(
        eps, 1.0, 1.0, 1.0, beta
    )
    assert_allclose(fraction, exact[1], rtol=2e-15, atol=0)
    assert_allclose(
        law.first_moment_stress(eps, 1.0, 1.0, 1.0, beta, 1.0),
        exact[2],
        rtol=2e-15,
        atol=0,
    )
    assert_allclose(
        law.first_moment_peak(1.0, 1.0, 1.0, beta[:, 0], 1.0),
        peak.astype(float),
        rtol=1e-13,
        atol=0,
    )
    k0, bell_force, stiffness, k_on, speed = some_bonds()
    stretch = law.first_moment_stretch(speed, k0, bell_force, stiffness)
    rupture = k0 * np.exp(stiffness * stretch / bell_force)
    assert_allclose(stretch * rupture, speed, rtol=1e-14, atol=0)
    stress = law.first_moment_stress(speed, k0, bell_force, stiffness, k_on, 1e16)
    # rounding of the exponent, up to 11
    assert_allclose(
        stress, 1e16 * k_on / (k_on + rupture) * stiffness * stretch, rtol=2e-13, atol=0
    )
    assert_array_equal(
        law.first_moment_fraction([0.0, math.inf], 1.0, 1.0, 1.0, 1.0), [1.0, 0.0]
    )
    assert_array_equal(
        law.first_moment_stress([0.0, math.inf], 1.0, 1.0, 1.0, 1.0, 1.0), [0.0, 0.0]
    )
    # an infinite Bell force is a constant rate, for which mean field is exact
    constant = law.constant_moments(3.0, 2.0, 0.5, 6.0)
    assert_allclose(
        law.first_moment_stress(3.0, 2.0, math.inf, 0.5, 6.0, 1.0),
        constant.force,
        rtol=1e-15,
        atol=0,
    )
    assert law.first_moment_fraction(3.0, 2.0, math.inf, 0.5, 6.0) == 1.0
    # mean field and the exact population differ from viscous by 2 eps and 3 eps here
    eps = np.array([1e-6, 1e-4])
    ratio = law.first_moment_stress(eps, 1.0, 1.0, 1.0, 1.0, 1.0) / law.bell_stress(
        eps, 1.0, 1.0, 1.0, 1.0, 1.0
    )
    assert_allclose((ratio - 1.0) / eps, 1.0, rtol=2e-3, atol=0)


def test_cut_off_is_the_law_of_the_paper_to_fifty_digits_with_its_limits_and_maximum():
    speed = np.array([0.0, 1e-6, 1e-3, 1e-2, 1.0, math.inf])
    stretch, k_on = 5e-6, 200.0
    paper = law.steady_fraction(speed, stretch * k_on)
    bound, force, square = law.cut_off_moments(speed, 0.0, stretch, 1e-3, k_on)
    assert_allclose(
        law.cut_off_fraction(speed, 0.0, stretch, k_on), paper, rtol=1e-15, atol=0
    )
    assert_allclose(bound, paper, rtol=1e-15, atol=0)
    assert_allclose(force[1:], 2.5e-9 * paper[1:], rtol=1e-14, atol=0)
    assert_allclose(square, 25e-18 / 3 * paper, rtol=1e-14, atol=0)
    assert force[0] == 0.0  # between the two signs of sliding
    back = law.cut_off_stress(-1e-2, 0.0, stretch, 1e-3, k_on, 1e16)
    assert_allclose(back, -2.5e7 * law.steady_fraction(1e-2, 1e-3), rtol=1e-14, atol=0)
    assert_array_equal(law.cut_off_moments(0.0, 2.0, 1.0, 1.0, 6.0), [0.75, 0.0, 0.0])
    assert_array_equal(
        law.cut_off_moments(math.inf, 2.0, 1.0, 1.0, 6.0), [0.0, 0.0, 0.0]
    )
    assert_array_equal(
        law.cut_off_fraction([0.0, math.inf], [[0.0], [2.0]], 1.0, 6.0),
        [[1.0, 0.0], [1.0, 0.0]],
    )
    far = law.cut_off_moments(3.0, 2.0, math.inf, 1.0, 6.0)
    assert_allclose(far, law.constant_moments(3.0, 2.0, 1.0, 6.0), rtol=1e-15, atol=0)
    wait, peak = np.array([0.1, 1.0, 10.0]), np.array([1.51372, 0.730401, 0.578097])
    stress = law.cut_off_stress(
        [[0.99], [1.0], [1.01]] * peak, 1.0, 1.0, 1.0, 1.0 / wait, 1.0
    )
    assert_allclose(stress[1], [0.369018, 0.166299, 0.0275600], rtol=0, atol=5.1e-7)
    assert np.all(stress[[0, 2]] < stress[1])
    # the plateau
    assert_allclose(
        law.cut_off_stress(1e8, 1.0, 1.0, 1.0, math.inf, 1.0), 0.5, rtol=1e-8, atol=0
    )
    for wait in [0.0, 0.1, 1.0, 10.0]:
        for u in np.concatenate(
            [10.0 ** np.arange(-8, 9), [0.2, 0.33, 0.3334, 0.5, 2.0]]
        ):
            with mp.workdps(50):
                a = 1 / mp.mpf(u)
                decay = mp.exp(-a)
                cycle = 1 + mp.mpf(wait) - decay
                force = (1 - (1 + a) * decay) / cycle / a
                square = (2 - (2 + 2 * a + a * a) * decay) / cycle / a**2
                exact = [float((1 - decay) / cycle), float(force), float(square)]
            k_on = 1 / wait if wait > 0.0 else math.inf
            assert_allclose(
                law.cut_off_moments(u, 1.0, 1.0, 1.0, k_on), exact, rtol=1e-14, atol=0
            )
            expected = 1.0 if wait == 0.0 else exact[0] * (1 + wait)
            assert_allclose(
                law.cut_off_fraction(u, 1.0, 1.0, k_on), expected, rtol=1e-14, atol=0
            )


def test_rupture_forces_have_their_mean_and_a_start_its_peak_to_fifty_digits():
    rate = 1.0 / np.array([2.0, 0.1, 1e-3])
    mean = law.bell_rupture_force(rate, 1.0, 1.0)
    assert_allclose(mean, [0.361329, 2.014643, 6.337874], rtol=0, atol=5.1e-7)
    variance = 2.0 * law.bell_lives(rate, 1.0, 1.0, 1.0).half_square * rate**2 - mean**2
    assert_allclose(variance, [0.080249, 0.830820, 1.591758], rtol=0, atol=5.1e-7)
    assert_array_equal(
        law.bell_rupture_force([0.0, -1.0], 1.0, 1.0),
        [0.0, -law.bell_rupture_force(1.0, 1.0, 1.0)],
    )
    assert law.bell_rupture_force(3.0, 2.0, math.inf) == 1.5
    # z = k0 f_b/r: force over f_b, whose share of bonds not broken yet is integrated
    for z in [5.0, 0.1, 1e-6]:
        rest, _ = quad(
            lambda x: math.exp(-z * math.expm1(x)),
            0,
            math.log1p(40.0 / z),
            epsabs=0,
            epsrel=1e-12,
            limit=200,
        )
        assert_allclose(
            law.bell_rupture_force(2e-11 / z, 2.0, 1e-11),
            1e-11 * rest,
            rtol=1e-11,
            atol=0,
        )
    for eps in 10.0 ** np.arange(-6, 9):
        with mp.workdps(50):
            tilt = mp.lambertw(mp.mpf(eps)).real
            exact = [
                float(tilt / mp.mpf(eps)),
                float(tilt * mp.exp(1 / mp.mpf(eps) - 1 / tilt)),
            ]
        # e^-W of W up to 16 rounds to 16 ulp
        assert_allclose(
            law.start_up_peak(eps, 1.0, 1.0, 1.0), exact, rtol=5e-15, atol=0
        )
    k0, force, stiffness, _, speed = some_bonds()
    peak = law.start_up_peak(speed, k0, force, stiffness)
    at_peak = law.start_up_force(
        [[0.9], [1.0], [1.1]] * peak.time, speed, k0, force, stiffness
    )
    assert_allclose(at_peak[1], peak.force, rtol=1e-14, atol=0)
    assert np.all(at_peak[[0, 2]] < peak.force)
    # 1 - k0 t - ...
    assert_allclose(
        law.start_up_force(1e-9, 3.0, 1.0, 1.0, 2.0), 6e-9, rtol=2e-9, atol=0
    )
    assert_array_equal(
        law.start_up_force([0.0, 1e9, math.inf], 3.0, 1.0, 1.0, 2.0), [0.0, 0.0, 0.0]
    )
    assert_allclose(
        law.start_up_force(0.5, 3.0, 2.0, math.inf, 1.0),
        1.5 * math.exp(-1.0),
        rtol=1e-15,
        atol=0,
    )
    assert_array_equal(law.start_up_peak(0.0, 4.0, 1.0, 1.0), [0.25, 0.0])
    assert_allclose(
        law.start_up_peak(3.0, 4.0, math.inf, 1.0),
        [0.25, 0.75 / math.e],
        rtol=1e-15,
        atol=0,
    )


def test_fractions_are_even_and_forces_odd_in_the_speed():
    speed = 10.0 ** np.arange(-12.0, 3.0)
    for sign, function in [  # the sign under reversal, and the law
        (1, lambda v: law.bell_fraction(v, 2.0, 1e-11, 1e-3, 6.0)),
        (-1, lambda v: law.bell_stress(v, 2.0, 1e-11, 1e-3, 6.0, 1e16)),
        (1, lambda v: law.first_moment_fraction(v, 2.0, 1e-11, 1e-3, 6.0)),
        (-1, lambda v: law.first_moment_stress(v, 2.0, 1e-11, 1e-3, 6.0, 1e16)),
        (-1, lambda v: law.first_moment_stretch(v, 2.0, 1e-11, 1e-3)),
        (1, lambda v: law.cut_off_fraction(v, 2.0, 1e-8, 6.0)),
        (-1, lambda v: law.cut_off_stress(v, 2.0, 1e-8, 1e-3, 6.0, 1e16)),
        (-1, lambda v: law.start_up_force(0.1, v, 2.0, 1e-11, 1e-3)),
        (-1, lambda v: law.start_up_peak(v, 2.0, 1e-11, 1e-3).force),
        (-1, lambda v: law.bell_rupture_force(1e-3 * v, 2.0, 1e-11)),
    ]:
        forward = function(speed)
        assert_array_equal(function(-speed), sign * forward)
        assert np.all(np.isfinite(forward)) and np.all(forward >= 0.0)
        assert function(0.0) == (1.0 if sign == 1 else 0.0)
    for function, *rest in [
        (law.constant_moments, 2.0, 1e-3, 6.0),
        (law.bell_moments, 2.0, 1e-11, 1e-3, 6.0),
        (law.cut_off_moments, 2.0, 1e-8, 1e-3, 6.0),
    ]:
        bound, force, square = function(speed, *rest)
        assert_array_equal(function(-speed, *rest), [bound, -force, square])
        assert np.all(square * bound >= force**2 * (1 - 1e-14))  # of the bound bonds
        assert np.all((bound > 0.0) & (bound <= 0.75 * (1 + 1e-15)))
        assert all(
            part.shape == (5, 3) for part in function(list(speed.reshape(5, 3)), *rest)
        )
    whole = law.bell_moments([1.0, 10.0], 1.0, 1.0, 1.0, 1.0).force
    assert_array_equal(
        whole, [law.bell_moments(v, 1.0, 1.0, 1.0, 1.0).force for v in (1.0, 10.0)]
    )


def test_the_onset_of_resolved_bonds_lies_beyond_the_maximum_of_friction():
    for beta, speed, *exact in (
        (0.1, 5.0, 0.00320497, 2.00008),
        (0.1, 20.0, 0.00436311, 8.59175),
        (1.0, 5.0, 0.00559440, 1.08232),
        (1.0, 10.0, 0.0295565, 4.25784),
        (1.0, 100.0, 0.0205200, 36.2893),
        (10.0, 20.0, 0.00714525, 2.71580),
        (10.0, 1000.0, 0.0408748, 281.987),
    ):
        onset = law.resolved_onset(
            [speed, -speed], [(1.0, 1.0)], 1.0, beta, 1.0, law.Body(1.0)
        )
        assert_allclose(onset, np.transpose([exact] * 2), rtol=5e-6)
        # of rates, forces and sites only ratios count
        scaled = law.resolved_onset(
            6.0 * speed, [(2.0, 3.0)], 1.0, 2.0 * beta, 5.0, law.Body(0.2)
        )
        assert_allclose(scaled.stiffness, exact[0], rtol=5e-6)
    speeds = law.bell_peak(1.0, 1.0, 1.0, 1.0, 1.0).speed * np.array(
        [1e-6, 0.5, 0.999, 1.001, 2.0]
    )
    onset = law.resolved_onset(speeds, [(1.0, 1.0)], 1.0, 1.0, 1.0, law.Body(1.0))
    assert np.array_equal(onset.stiffness == 0.0, [True, True, True, False, False])
    assert np.array_equal(np.isnan(onset.frequency), onset.stiffness == 0.0)
    catch = 1.0, 1.0, 1e-2, 1.0
    speed = np.geomspace(0.1, 100.0, 200)
    falls = np.gradient(law.catch_moments(speed, *catch, 1.0, 1.0).force, speed) < 0.0
    onset = law.resolved_onset(
        speed, [(1.0, -1.0), (1e-2, 1.0)], 1.0, 1.0, 1.0, law.Body(1.0)
    ).stiffness
    assert np.sum(falls != (onset > 0.0)) <= 1
    assert 10 < np.sum(falls) < 190
    yielding = law.Body(1.0, mass=1e-3, contact_stiffness=[math.inf, 0.05, 0.02])
    behind, alone = (
        law.resolved_onset(10.0, [(1.0, 1.0)], 1.0, 1.0, 1.0, body)
        for body in (yielding, law.Body(1.0))
    )
    swings = 1e-3 * alone.frequency**2
    series = alone.stiffness / (1.0 - alone.stiffness / 0.05)
    assert_allclose(
        behind.stiffness,
        (swings + alone.stiffness, swings + series, math.inf),
        rtol=1e-12,
    )
