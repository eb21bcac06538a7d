"""Closed forms of the bond populations: the linear law and its exact step, and what replaces it."""

import math

import mpmath as mp
import numpy as np
import pytest
from helpers.cases import some
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

from sim.laws.schallamach import (
    Body,
    bell_critical_speed,
    bell_fraction,
    bell_lives,
    bell_moments,
    bell_peak,
    bell_rupture_force,
    bell_rupture_force_density,
    bell_stress,
    catch_moments,
    cluster_lifetime,
    constant_moments,
    cut_off_fraction,
    cut_off_moments,
    cut_off_stress,
    first_moment_amplitude,
    first_moment_fraction,
    first_moment_onset,
    first_moment_peak,
    first_moment_stress,
    first_moment_stretch,
    fraction_rate,
    relax_fraction,
    renewal,
    resolved_onset,
    rest_share,
    start_up_force,
    start_up_peak,
    steady_fraction,
    transition_probabilities,
)

CRITICAL, HEALING = 1e-2, 200.0
EXPONENTS = 10.0 ** np.arange(-9, 10)  # rate x duration


def test_the_paper_s_fractions_at_one_and_ten_millimetres_per_second():
    assert_allclose(steady_fraction([1e-3, 1e-2], 1e-2), [10.0 / 11.0, 0.5], rtol=1e-15, atol=0)


def test_limits_of_the_steady_fraction():
    speed = np.array([0.0, -0.0, np.inf, -np.inf])
    assert_array_equal(steady_fraction(speed, 1e-2), [1.0, 1.0, 0.0, 0.0])
    assert steady_fraction(-3e-3, 1e-2) == steady_fraction(3e-3, 1e-2)
    assert np.isnan(steady_fraction(np.nan, 1e-2))
    assert steady_fraction(1.0, np.inf) == 1.0


def test_the_steady_fraction_is_where_the_rate_vanishes():
    for speed in [0.0, 1e-5, 1e-2, 10.0]:
        steady = steady_fraction(speed, CRITICAL)
        flow = HEALING * (1.0 - steady) + HEALING * speed / CRITICAL * steady
        assert abs(fraction_rate(steady, speed, CRITICAL, HEALING)) <= 4e-16 * max(flow, HEALING)


def test_the_step_solves_the_rate_equation():
    for speed in [0.0, 3e-3, 0.5]:
        duration = 4e-3
        exact = solve_ivp(
            lambda t, y: fraction_rate(y, speed, CRITICAL, HEALING), (0.0, duration), [0.3], rtol=1e-12, atol=1e-14
        )
        stepped = relax_fraction(0.3, speed * duration, duration, CRITICAL, HEALING)
        assert_allclose(stepped, exact.y[0, -1], rtol=1e-10, atol=0)


def test_one_step_equals_seven_steps_of_a_seventh():
    for start in [0.0, 0.3, 1.0]:
        for ratio in [0.0, 1e-6, 0.2, 1e9]:
            duration = EXPONENTS / (HEALING * (1.0 + ratio))
            path = ratio * CRITICAL * duration
            once = relax_fraction(start, path, duration, CRITICAL, HEALING)
            parts = np.full_like(once, start)
            for _ in range(7):
                parts = relax_fraction(parts, path / 7.0, duration / 7.0, CRITICAL, HEALING)
            # nothing is left of bonds that opened e^-z ago: compare above the smallest normal number
            alive = once > 1e-300
            assert_allclose(parts[alive], once[alive], rtol=1e-12, atol=0)


def test_a_step_keeps_the_steady_state_and_ends_in_it():
    for ratio in [0.0, 0.2, 1e9]:
        duration = EXPONENTS / HEALING
        path = ratio * CRITICAL * duration
        steady = steady_fraction(ratio * CRITICAL, CRITICAL)
        assert_allclose(relax_fraction(steady, path, duration, CRITICAL, HEALING), steady, rtol=1e-13, atol=0)
        late = relax_fraction([0.0, 1.0], path[-1], duration[-1], CRITICAL, HEALING)
        assert_allclose(late, steady, rtol=1e-13, atol=0)


def test_a_short_step_is_the_rate_times_the_duration():
    duration = 1e-9 / HEALING
    gained = relax_fraction(0.0, 1e-3 * duration, duration, CRITICAL, HEALING)
    # the next term of the exponential is 1e-9 of the first
    assert_allclose(gained, fraction_rate(0.0, 1e-3, CRITICAL, HEALING) * duration, rtol=1e-9, atol=0)


def test_special_steps():
    assert relax_fraction(0.37, 0.0, 0.0, CRITICAL, HEALING) == 0.37
    assert relax_fraction(0.37, 1.0, 1.0, CRITICAL, 0.0) == 0.37
    jump = relax_fraction(0.5, 1e-5, 0.0, CRITICAL, HEALING)
    assert_allclose(jump, 0.5 * np.exp(-HEALING * 1e-5 / CRITICAL), rtol=1e-14, atol=0)
    assert relax_fraction(0.5, np.inf, 1.0, CRITICAL, HEALING) == 0.0
    assert np.isnan(relax_fraction(np.nan, 1e-5, 1e-3, CRITICAL, HEALING))


def test_transitions_are_those_of_the_two_state_generator():
    path, duration = 3e-5, 2e-3
    closing, opening = HEALING, HEALING * path / duration / CRITICAL
    values, vectors = np.linalg.eig(np.array([[-opening, closing], [opening, -closing]]))
    flow = (vectors * np.exp(values * duration)) @ np.linalg.inv(vectors)  # columns: from bound, from open
    stay, become = transition_probabilities(path, duration, CRITICAL, HEALING)
    assert_allclose([stay, become], flow[0], rtol=1e-12, atol=0)


def test_transitions_compose_to_the_exact_step_of_the_mean():
    stay, become = transition_probabilities(3e-5, 2e-3, CRITICAL, HEALING)
    mean = 0.3 * stay + 0.7 * become
    assert_allclose(mean, relax_fraction(0.3, 3e-5, 2e-3, CRITICAL, HEALING), rtol=1e-14, atol=0)
    for probability in transition_probabilities(EXPONENTS * CRITICAL, EXPONENTS, CRITICAL, HEALING):
        assert np.all((probability >= 0.0) & (probability <= 1.0))


def test_the_share_at_rest():
    assert_array_equal(rest_share([0.0, 1.0, 3.0, 1.0], [2.0, 0.0, 1.0, math.inf]), [1.0, 0.0, 0.25, 1.0])


def test_equal_lives_are_the_law_of_the_paper():
    speed, stretch, rate, stiffness = np.array([1e-9, 1e-3, 1.0]), 1e-6, 200.0, 1e-3
    life = stretch / speed
    bound, force, square = renewal(life, life**2 / 2, life**3 / 3, speed, stiffness, rate)
    paper = steady_fraction(speed, stretch * rate)
    assert_allclose(bound, paper, rtol=1e-15, atol=0)
    assert_allclose(force, stiffness * stretch / 2 * paper, rtol=1e-14, atol=0)
    assert_allclose(square, (stiffness * stretch) ** 2 / 3 * paper, rtol=1e-14, atol=0)


def test_renewal_where_bonds_live_for_ever_or_not_at_all():
    assert_array_equal(renewal(math.inf, math.inf, math.inf, 0.0, 1.0, 1.0), [1.0, 0.0, 0.0])
    assert_array_equal(renewal(0.0, 0.0, 0.0, math.inf, 1.0, 1.0), [0.0, 0.0, 0.0])
    assert_array_equal(renewal(1.0, 0.5, 1 / 3, 1.0, 1.0, 0.0), [0.0, 0.0, 0.0])


#: (k_on/k_0, kappa V/(k_0 f_b)) -> bound share, force/f_b, mean square force/f_b^2: independent quadrature
RESOLVED = {
    (0.1, 0.01): (0.09009797352715528, 0.0008835627064094985, 1.7166030275923622e-05),
    (0.1, 0.1): (0.08388274971577493, 0.00711855003981832, 0.0011299724372534103),
    (0.1, 1.0): (0.05627857807338321, 0.02509972313460454, 0.018266733210913415),
    (0.1, 3.0): (0.03712851808552615, 0.028591252481551723, 0.03389765461985388),
    (0.1, 10.0): (0.019748562504892608, 0.023965209721999944, 0.04276607496874931),
    (0.1, 100.0): (0.004061944755289291, 0.008977767010273835, 0.02779238981479023),
    (0.1, 1000.0): (0.0006333859749778167, 0.0020866977599707055, 0.009421546694599329),
    (1.0, 0.01): (0.49753647880558, 0.004879184964336791, 9.479376643225906e-05),
    (1.0, 0.1): (0.4779794340422585, 0.04056281572507847, 0.006438792098158472),
    (1.0, 1.0): (0.37356992368836234, 0.16660871644210623, 0.12125221292440476),
    (1.0, 3.0): (0.27829204111941863, 0.21430206271425223, 0.2540755187586568),
    (1.0, 10.0): (0.16768227079679127, 0.20348523014324285, 0.3631207366130619),
    (1.0, 100.0): (0.0391868733218018, 0.08661137453584007, 0.2681220264170614),
    (1.0, 1000.0): (0.006297958403066702, 0.020748700178478446, 0.09368143836341707),
    (10.0, 0.01): (0.9082732256602626, 0.008907152048006834, 0.0001730499042333694),
    (10.0, 0.1): (0.9015392700093077, 0.07650741574600095, 0.01214450563034534),
    (10.0, 1.0): (0.8563935107524867, 0.3819435520586741, 0.2779656544284963),
    (10.0, 3.0): (0.7940700460445156, 0.611482987880054, 0.7249713576713309),
    (10.0, 10.0): (0.6682857137555887, 0.8109758510474531, 1.4471917603083821),
    (10.0, 100.0): (0.2896976331508459, 0.6402937534956319, 1.9821514161329326),
    (10.0, 1000.0): (0.059601286237244096, 0.19635715881929017, 0.8865625756270377),
}
#: k_on/k_0 -> eps, force/f_b, bound share, mean rupture force/f_b at the maximum; eps of half the bonds; sd of force
MAXIMUM = {
    0.01: (2.60622, 0.002965, 0.00410, 1.07216, 1.6602, 0.05759),
    0.1: (2.78696, 0.028610, 0.03837, 1.11204, 1.8529, 0.17927),
    0.3: (3.18114, 0.079877, 0.10114, 1.19314, 2.3002, 0.30081),
    1.0: (4.50294, 0.218485, 0.23985, 1.42079, 4.045, 0.50335),
    3.0: (8.0205, 0.459603, 0.40787, 1.84155, 10.121, 0.74550),
    10.0: (19.2929, 0.846126, 0.57055, 2.56316, 38.036, 1.04693),
    100.0: (146.903, 1.794870, 0.75179, 4.44954, 593.71, 1.65861),
    1000.0: (1311.05, 2.857712, 0.83443, 6.60717, 8487.1, 2.28567),
}


def some_bonds(count=12, seed=41):
    """Bonds in SI, of all kinds: k0 [1/s], f_b [N], kappa [N/m], k_on [1/s], and speeds from slow to fast [m/s]."""
    draw = np.random.default_rng(seed).uniform
    k0, force = 10.0 ** draw(-3, 3, count), 10.0 ** draw(-12, -9, count)
    stiffness, k_on = 10.0 ** draw(-4, 0, count), k0 * 10.0 ** draw(-2, 3, count)
    return k0, force, stiffness, k_on, k0 * force / stiffness * 10.0 ** draw(-3, 5, count)


def test_bell_populations_against_quadrature():
    for beta, eps in RESOLVED:
        # rounding of the 64 weights: 2e-14
        assert_allclose(bell_moments(eps, 1.0, 1.0, 1.0, beta), RESOLVED[beta, eps], rtol=1e-13, atol=0)


def test_bell_populations_at_equal_rates():
    eps = [1e-3, 1e-2, 0.1, 0.3, 1, 3, 10, 30, 100, 1e3, 1e4]
    bound = [0.49975037, 0.49753648, 0.47797943, 0.44481034, 0.37356992, 0.27829204]
    bound += [0.16768227, 0.08963676, 0.03918687, 0.00629796, 0.00086266]
    force = [0.00049875, 0.00487918, 0.04056282, 0.09093125, 0.16660872, 0.21430206]
    force += [0.20348523, 0.14986446, 0.08661137, 0.02074870, 0.00380587]
    got = bell_moments(eps, 1.0, 1.0, 1.0, 1.0)
    assert_allclose(got.bound, bound, rtol=0, atol=5.1e-9)  # eight printed decimals
    assert_allclose(got.force, force, rtol=0, atol=5.1e-9)


@pytest.mark.parametrize("eps", some([1e-6, 1e-3, 0.3, 1.0, 30.0, 1e4, 1e8], 1e-3, 1.0, 1e4))
def test_bell_lives_to_thirty_digits(eps):
    with mp.workdps(30):
        z = 1 / mp.mpf(eps)
        edges = [0, *(mp.mpf(10) ** k for k in range(-8, 0) if z < 1), 1, 4, 12, 30, 70, 150]
        for order, got in enumerate(bell_lives(eps, 1.0, 1.0, 1.0)):
            # z^(n + 1) int t^n S dt by the time t = ln(1 + w/z), scaled to 1 at rest
            def density(w, n=order):
                return (z * mp.log1p(w / z)) ** n * mp.exp(-w) / (1 + w / z)

            mean = mp.quad(density, edges, method="gauss-legendre")
            assert_allclose(got, float(mean), rtol=1e-12, atol=0)


def test_bell_lives_are_integrals_of_the_survival():
    k0, force, stiffness, _, speed = some_bonds()
    for i, lives in enumerate(zip(*bell_lives(speed, k0, force, stiffness), strict=True)):
        pace = stiffness[i] * speed[i] / force[i] / k0[i]  # in units of the life at rest
        last = math.log1p(40.0 * pace) / pace
        for n, life in enumerate(lives):
            whole, _ = quad(
                lambda t, n=n, pace=pace: t**n * math.exp(-math.expm1(pace * t) / pace), 0, last, epsabs=0, epsrel=1e-12
            )
            assert_allclose(life * k0[i] ** (n + 1), whole, rtol=1e-11, atol=0)


def test_bell_lives_are_those_of_drawn_bonds():
    eps, count = 30.0, 200_000
    drawn = np.log1p(eps * np.random.default_rng(7).exponential(size=count)) / eps
    for n, life in enumerate(bell_lives(eps, 1.0, 1.0, 1.0), start=1):
        sample = drawn**n / n
        assert abs(sample.mean() - life) < 5.0 * sample.std() / math.sqrt(count)


def test_bell_moments_are_the_renewal_of_bell_lives():
    k0, force, stiffness, k_on, speed = some_bonds()
    lives = bell_lives(speed, k0, force, stiffness)
    expected = renewal(*lives, speed, stiffness, k_on)
    assert_allclose(bell_moments(speed, k0, force, stiffness, k_on), expected, rtol=1e-14, atol=0)


def test_bell_bonds_of_infinite_bell_force_have_a_constant_rate():
    k0, _, stiffness, k_on, speed = some_bonds()
    constant = constant_moments(speed, k0, stiffness, k_on)
    assert_allclose(bell_moments(speed, k0, math.inf, stiffness, k_on), constant, rtol=1e-14, atol=0)
    stiff = 1e9 * stiffness * speed / k0  # eps = 1e-9; the next terms are eps, 3 eps, 6 eps of the first
    assert_allclose(bell_moments(speed, k0, stiff, stiffness, k_on), constant, rtol=6e-9, atol=0)
    assert_allclose(constant.bound, rest_share(k0, k_on), rtol=1e-15, atol=0)


def test_bell_bonds_at_rest_and_at_infinite_speed():
    k0, k_on = 20.0, 30.0
    assert_allclose(bell_lives(0.0, k0, 1e-11, 1e-3), [1 / k0, 1 / k0**2, 2 / k0**3], rtol=1e-15, atol=0)
    assert_allclose(bell_moments(0.0, k0, 1e-11, 1e-3, k_on), [0.6, 0.0, 0.0], rtol=1e-15, atol=0)
    for infinite in (math.inf, -math.inf):
        assert_array_equal(bell_lives(infinite, k0, 1e-11, 1e-3), [0.0, 0.0, 0.0])
        assert_array_equal(bell_moments(infinite, k0, 1e-11, 1e-3, k_on), [0.0, 0.0, 0.0])
    assert_array_equal(bell_fraction([0.0, math.inf], k0, 1e-11, 1e-3, k_on), [1.0, 0.0])
    assert np.isnan(bell_moments(math.nan, k0, 1e-11, 1e-3, k_on)).all()


def test_slow_sliding_is_viscous_and_fast_sliding_falls_with_the_square_of_the_logarithm():
    beta, eps = 2.0, 1e-7
    viscous = eps * beta / (1 + beta)
    assert_allclose(bell_stress(eps, 1.0, 1.0, 1.0, beta, 5.0), 5.0 * viscous, rtol=3 * eps, atol=0)
    eps = 1e8
    depth = math.log(eps) - np.euler_gamma
    torn = beta / eps * 0.5 * (depth**2 + math.pi**2 / 6) / (1 + beta * depth / eps)
    assert_allclose(bell_stress(eps, 1.0, 1.0, 1.0, beta, 1.0), torn, rtol=2 / eps, atol=0)  # next term z


def test_bond_fractions_count_from_rest():
    k0, force, stiffness, k_on, speed = some_bonds()
    bound = bell_moments(speed, k0, force, stiffness, k_on).bound
    fraction = bell_fraction(speed, k0, force, stiffness, k_on)
    assert_allclose(fraction, bound / rest_share(k0, k_on), rtol=1e-14, atol=0)
    life = bell_lives(1.0, 1.0, 1.0, 1.0).mean
    assert_allclose(bell_fraction(1.0, 1.0, 1.0, 1.0, [0.0, math.inf]), [life, 1.0], rtol=1e-14, atol=0)


def test_friction_maximum_of_bell_bonds():
    for beta in MAXIMUM:
        speed, stress, bound, rupture, half, spread = MAXIMUM[beta]
        peak = bell_peak(1.0, 1.0, 1.0, beta, 1.0)
        assert_allclose(peak.speed, speed, rtol=5e-6, atol=0)  # as many digits as are printed, here and below
        assert_allclose(peak.stress, stress, rtol=0, atol=5.1e-7)
        moments = bell_moments(peak.speed, 1.0, 1.0, 1.0, beta)
        assert_allclose(moments.bound, bound, rtol=0, atol=5.1e-6)
        assert_allclose(bell_rupture_force(peak.speed, 1.0, 1.0), rupture, rtol=0, atol=5.1e-6)
        assert_allclose(math.sqrt(moments.force_square - moments.force**2), spread, rtol=0, atol=5.1e-6)
        assert_allclose(bell_critical_speed(1.0, 1.0, 1.0, beta), half, rtol=5e-5, atol=0)


def test_no_speed_has_more_friction_than_the_peak():
    k0, force, stiffness, k_on, _ = some_bonds(6)
    peak = bell_peak(k0, force, stiffness, k_on, 1e16)
    at_peak = bell_stress(peak.speed, k0, force, stiffness, k_on, 1e16)
    assert_allclose(peak.stress, at_peak, rtol=1e-13, atol=0)
    for i in range(k0.size):
        bond = (k0[i], force[i], stiffness[i], k_on[i], 1e16)
        scale, top = peak.speed[i], peak.stress[i]
        found = minimize_scalar(
            lambda x, bond=bond, scale=scale, top=top: -bell_stress(scale * math.exp(x), *bond) / top,
            bounds=(-3.0, 3.0),
            method="bounded",
            options={"xatol": 1e-7},
        )
        # a search ends within about the root of the rounding of the top, which leaves the top itself to 1e-12
        assert_allclose(-found.fun, 1.0, rtol=1e-12, atol=0)
        assert abs(found.x) < 1e-6


def test_peak_and_half_population_over_all_rebinding_rates():
    beta = np.geomspace(1e-12, 1e12, 49)
    peak = bell_peak(1.0, 1.0, 1.0, beta, 1.0)
    for factor in (0.9, 1.1):
        assert np.all(bell_stress(factor * peak.speed, 1.0, 1.0, 1.0, beta, 1.0) < peak.stress)
    assert_allclose(
        bell_fraction(bell_critical_speed(1.0, 1.0, 1.0, beta), 1.0, 1.0, 1.0, beta), 0.5, rtol=1e-13, atol=0
    )
    assert_array_equal(bell_peak(1.0, 1.0, 1.0, [0.0, math.inf], 1.0).stress, [0.0, math.inf])
    assert bell_critical_speed(1.0, 1.0, 1.0, math.inf) == math.inf


#: (k_on/k_0, eps) -> bound share, force/f_b of the first-moment closure
MEAN_FIELD = {
    (0.1, 0.01): (0.09009409516824295, 0.0008920643267707173),
    (0.1, 0.1): (0.08364197789384635, 0.007634549267015908),
    (0.1, 1.0): (0.05367044572249673, 0.030438833184816508),
    (0.1, 3.0): (0.03381359019492402, 0.035501189116319574),
    (0.1, 10.0): (0.01715582037859866, 0.02994596488083351),
    (0.1, 100.0): (0.0033742063256543575, 0.011423814635692737),
    (0.1, 1000.0): (0.0005246848465334622, 0.002754387066973957),
    (1.0, 0.01): (0.4975246517624951, 0.004926227325970063),
    (1.0, 0.1): (0.4771966979727696, 0.04355685736358529),
    (1.0, 1.0): (0.3618962566348892, 0.20524703377489464),
    (1.0, 3.0): (0.2592425958691504, 0.2721811073565889),
    (1.0, 10.0): (0.14861213581317062, 0.25940664460899326),
    (1.0, 100.0): (0.03274758915427501, 0.11087122486254904),
    (1.0, 1000.0): (0.005222188437086488, 0.027414415315107857),
    (10.0, 0.01): (0.9082692841034944, 0.008993204559491519),
    (10.0, 0.1): (0.9012604373359236, 0.08226392278750304),
    (10.0, 1.0): (0.8501071637270363, 0.4821325740370802),
    (10.0, 3.0): (0.7777627800519148, 0.8165800609484656),
    (10.0, 10.0): (0.635771334693451, 1.1097566680472484),
    (10.0, 100.0): (0.25293020237422215, 0.8563281165478285),
    (10.0, 1000.0): (0.04987764998755822, 0.261837853645774),
}
#: k_on/k_0 -> eps and force/f_b of the friction maximum of the closure
MEAN_MAXIMUM = {
    0.1: (2.9165274173418823, 0.035504713848791766),
    1.0: (4.591121476668623, 0.2784645427610738),
    10.0: (18.644025568733642, 1.1568683966150044),
    100.0: (137.93723146922673, 2.635932990553525),
}


def test_mean_field_against_a_root_finder():
    for beta, eps in MEAN_FIELD:
        bound = rest_share(1.0, beta) * first_moment_fraction(eps, 1.0, 1.0, 1.0, beta)
        stress = first_moment_stress(eps, 1.0, 1.0, 1.0, beta, 1.0)
        assert_allclose([bound, stress], MEAN_FIELD[beta, eps], rtol=2e-15, atol=0)


def test_mean_field_is_where_the_closure_stands_still():
    k0, force, stiffness, k_on, speed = some_bonds()
    stretch = first_moment_stretch(speed, k0, force, stiffness)
    bound = rest_share(k0, k_on) * first_moment_fraction(speed, k0, force, stiffness, k_on)
    rupture = k0 * np.exp(stiffness * stretch / force)  # rounding of the exponent, up to 11
    assert_allclose(rupture * bound, k_on * (1 - bound), rtol=2e-13, atol=0)
    assert_allclose(stretch * rupture, speed, rtol=1e-14, atol=0)
    stress = first_moment_stress(speed, k0, force, stiffness, k_on, 1e16)
    assert_allclose(stress, 1e16 * bound * stiffness * stretch, rtol=1e-14, atol=0)


def test_friction_maximum_of_mean_field():
    for beta in MEAN_MAXIMUM:
        peak = first_moment_peak(1.0, 1.0, 1.0, beta, 1.0)
        assert_allclose(peak, MEAN_MAXIMUM[beta], rtol=1e-13, atol=0)
        assert_allclose(first_moment_stress(peak.speed, 1.0, 1.0, 1.0, beta, 1.0), peak.stress, rtol=1e-14, atol=0)
        for factor in (0.9, 1.1):
            assert first_moment_stress(factor * peak.speed, 1.0, 1.0, 1.0, beta, 1.0) < peak.stress


def test_mean_field_exaggerates_the_maximum():
    beta = [1.0, 10.0, 100.0]
    ratio = first_moment_peak(1.0, 1.0, 1.0, beta, 1.0).stress / bell_peak(1.0, 1.0, 1.0, beta, 1.0).stress
    assert_allclose(ratio, [1.27, 1.37, 1.47], rtol=0, atol=0.006)


def test_limits_of_mean_field():
    assert_array_equal(first_moment_fraction([0.0, math.inf], 1.0, 1.0, 1.0, 1.0), [1.0, 0.0])
    assert_array_equal(first_moment_stress([0.0, math.inf], 1.0, 1.0, 1.0, 1.0, 1.0), [0.0, 0.0])
    # an infinite Bell force is a constant rate, for which mean field is exact
    constant = constant_moments(3.0, 2.0, 0.5, 6.0)
    assert_allclose(first_moment_stress(3.0, 2.0, math.inf, 0.5, 6.0, 1.0), constant.force, rtol=1e-15, atol=0)
    assert first_moment_fraction(3.0, 2.0, math.inf, 0.5, 6.0) == 1.0
    eps = np.array([1e-6, 1e-4])  # mean field and the exact population differ from viscous by 2 eps and 3 eps here
    ratio = first_moment_stress(eps, 1.0, 1.0, 1.0, 1.0, 1.0) / bell_stress(eps, 1.0, 1.0, 1.0, 1.0, 1.0)
    assert_allclose((ratio - 1.0) / eps, 1.0, rtol=2e-3, atol=0)


def test_cut_off_without_rate_is_the_law_of_the_paper():
    speed = np.array([0.0, 1e-6, 1e-3, 1e-2, 1.0, math.inf])
    stretch, k_on = 5e-6, 200.0
    paper = steady_fraction(speed, stretch * k_on)
    bound, force, square = cut_off_moments(speed, 0.0, stretch, 1e-3, k_on)
    assert_allclose(cut_off_fraction(speed, 0.0, stretch, k_on), paper, rtol=1e-15, atol=0)
    assert_allclose(bound, paper, rtol=1e-15, atol=0)
    assert_allclose(force[1:], 2.5e-9 * paper[1:], rtol=1e-14, atol=0)
    assert_allclose(square, 25e-18 / 3 * paper, rtol=1e-14, atol=0)
    assert force[0] == 0.0  # between the two signs of sliding
    back = cut_off_stress(-1e-2, 0.0, stretch, 1e-3, k_on, 1e16)
    assert_allclose(back, -2.5e7 * steady_fraction(1e-2, 1e-3), rtol=1e-14, atol=0)


def test_cut_off_to_fifty_digits():
    for wait in [0.0, 0.1, 1.0, 10.0]:
        for u in np.concatenate([10.0 ** np.arange(-8, 9), [0.2, 0.33, 0.3334, 0.5, 2.0]]):
            with mp.workdps(50):
                a = 1 / mp.mpf(u)
                decay = mp.exp(-a)
                cycle = 1 + mp.mpf(wait) - decay
                force = (1 - (1 + a) * decay) / cycle / a
                square = (2 - (2 + 2 * a + a * a) * decay) / cycle / a**2
                exact = [float((1 - decay) / cycle), float(force), float(square)]
            k_on = 1 / wait if wait > 0.0 else math.inf
            assert_allclose(cut_off_moments(u, 1.0, 1.0, 1.0, k_on), exact, rtol=1e-14, atol=0)
            expected = 1.0 if wait == 0.0 else exact[0] * (1 + wait)
            assert_allclose(cut_off_fraction(u, 1.0, 1.0, k_on), expected, rtol=1e-14, atol=0)


def test_friction_maximum_of_the_cut_off():
    wait, at = np.array([0.1, 1.0, 10.0]), np.array([1.51372, 0.730401, 0.578097])
    stress = cut_off_stress(at, 1.0, 1.0, 1.0, 1.0 / wait, 1.0)
    assert_allclose(stress, [0.369018, 0.166299, 0.0275600], rtol=0, atol=5.1e-7)
    for factor in (0.99, 1.01):
        assert np.all(cut_off_stress(factor * at, 1.0, 1.0, 1.0, 1.0 / wait, 1.0) < stress)
    assert_allclose(cut_off_stress(1e8, 1.0, 1.0, 1.0, math.inf, 1.0), 0.5, rtol=1e-8, atol=0)  # the plateau


def test_cut_off_is_the_renewal_of_its_survival():
    k0, _, stiffness, k_on, _ = some_bonds(8)
    stretch, speed = 1e-6, k0 * 1e-6 * 10.0 ** np.linspace(-1.5, 2, 8)
    last = stretch / speed * k0  # in units of 1/k0; e^-32 is left of the slowest bonds
    lives = [
        [quad(lambda t, n=n: t**n * math.exp(-t), 0, x, epsabs=0, epsrel=1e-12)[0] for x in last] for n in range(3)
    ]
    lives = [life / k0 ** (n + 1) for n, life in enumerate(np.array(lives))]
    expected = renewal(*lives, speed, stiffness, k_on)
    assert_allclose(cut_off_moments(speed, k0, stretch, stiffness, k_on), expected, rtol=1e-11, atol=0)


def test_limits_of_the_cut_off():
    assert_array_equal(cut_off_moments(0.0, 2.0, 1.0, 1.0, 6.0), [0.75, 0.0, 0.0])
    assert_array_equal(cut_off_moments(math.inf, 2.0, 1.0, 1.0, 6.0), [0.0, 0.0, 0.0])
    assert_array_equal(cut_off_fraction([0.0, math.inf], [[0.0], [2.0]], 1.0, 6.0), [[1.0, 0.0], [1.0, 0.0]])
    far = cut_off_moments(3.0, 2.0, math.inf, 1.0, 6.0)
    assert_allclose(far, constant_moments(3.0, 2.0, 1.0, 6.0), rtol=1e-15, atol=0)


def test_rupture_forces_of_bell_and_evans():
    rate = 1.0 / np.array([2.0, 0.1, 1e-3])
    mean = bell_rupture_force(rate, 1.0, 1.0)
    assert_allclose(mean, [0.361329, 2.014643, 6.337874], rtol=0, atol=5.1e-7)
    variance = 2.0 * bell_lives(rate, 1.0, 1.0, 1.0).half_square * rate**2 - mean**2
    assert_allclose(variance, [0.080249, 0.830820, 1.591758], rtol=0, atol=5.1e-7)
    assert_array_equal(bell_rupture_force([0.0, -1.0], 1.0, 1.0), [0.0, -bell_rupture_force(1.0, 1.0, 1.0)])
    assert bell_rupture_force(3.0, 2.0, math.inf) == 1.5


def test_density_of_rupture_forces():
    for z in [5.0, 0.1, 1e-6]:
        rate = 2e-11 / z  # k0 = 2/s, f_b = 1e-11 N
        top = 1e-11 * math.log1p(40.0 / z)

        def density(x):
            return bell_rupture_force_density(top * x, rate, 2.0, 1e-11) * top

        whole, _ = quad(density, 0, 1, epsabs=0, epsrel=1e-12, limit=200)
        mean, _ = quad(lambda x: top * x * density(x), 0, 1, epsabs=0, epsrel=1e-12, limit=200)
        assert_allclose(whole, 1.0, rtol=1e-11, atol=0)
        assert_allclose(mean, bell_rupture_force(rate, 2.0, 1e-11), rtol=1e-11, atol=0)
        mode = 1e-11 * max(0.0, -math.log(z))
        near = bell_rupture_force_density(mode + 1e-13 * np.array([0.0, 1.0]), rate, 2.0, 1e-11)
        assert near[1] < near[0]
        assert_array_equal(bell_rupture_force_density([-1e-11, 1e-6, math.inf], rate, 2.0, 1e-11), [0.0, 0.0, 0.0])


def test_static_peak():
    eps = [1.0, 10.0, 100.0, 1e4]
    time, force = start_up_peak(eps, 1.0, 1.0, 1.0)
    exact_time = [0.5671432904097838, 0.17455280027406994, 0.0338563014029005, 0.0007231846038093373]
    exact_force = [0.26438044734963434, 1.0878078601534826, 2.54511046850994, 6.298534919025461]
    assert_allclose(time, exact_time, rtol=2e-15, atol=0)
    assert_allclose(force, exact_force, rtol=1e-15, atol=0)
    assert_allclose(start_up_force(time, eps, 1.0, 1.0, 1.0), force, rtol=1e-14, atol=0)


def test_static_peak_to_fifty_digits():
    for eps in 10.0 ** np.arange(-6, 9):
        with mp.workdps(50):
            tilt = mp.lambertw(mp.mpf(eps)).real
            exact = [float(tilt / mp.mpf(eps)), float(tilt * mp.exp(1 / mp.mpf(eps) - 1 / tilt))]
        # e^-W of W up to 16 rounds to 16 ulp
        assert_allclose(start_up_peak(eps, 1.0, 1.0, 1.0), exact, rtol=5e-15, atol=0)


def test_the_static_peak_is_the_largest_force_after_the_start():
    k0, force, stiffness, _, speed = some_bonds()
    peak = start_up_peak(speed, k0, force, stiffness)
    for factor in (0.9, 1.1):
        assert np.all(start_up_force(factor * peak.time, speed, k0, force, stiffness) < peak.force)


def test_a_start_is_elastic_first_and_forgotten_last():
    assert_allclose(start_up_force(1e-9, 3.0, 1.0, 1.0, 2.0), 6e-9, rtol=2e-9, atol=0)  # 1 - k0 t - ...
    assert_array_equal(start_up_force([0.0, 1e9, math.inf], 3.0, 1.0, 1.0, 2.0), [0.0, 0.0, 0.0])
    assert_allclose(start_up_force(0.5, 3.0, 2.0, math.inf, 1.0), 1.5 * math.exp(-1.0), rtol=1e-15, atol=0)
    assert_array_equal(start_up_peak(0.0, 4.0, 1.0, 1.0), [0.25, 0.0])
    assert_allclose(start_up_peak(3.0, 4.0, math.inf, 1.0), [0.25, 0.75 / math.e], rtol=1e-15, atol=0)


def test_lifetimes_of_clusters():
    cases = [(5, 0.0, 0.0, 137 / 60), (2, 0.0, 1.0, 2.0), (5, 2.0, 1.0, 1.1504943644695798)]
    cases += [(10, 5.0, 1.0, 0.8210570712132322), (10, 0.0, 0.5, 16.07684151785714)]
    for bonds, force, beta, exact in cases:
        assert_allclose(cluster_lifetime(bonds, force, 1.0, 1.0, beta), exact, rtol=1e-14, atol=0)


def test_lifetimes_solve_the_equations_of_first_passage():
    for bonds, force, beta in [(1, 3.0, 2.0), (7, 4.0, 0.3), (40, 30.0, 2.0), (40, 0.0, 3.0)]:
        i = np.arange(1, bonds + 1)
        with mp.workdps(60):
            up = [mp.mpf(beta) * int(bonds - k) for k in i]
            down = [int(k) * mp.exp(mp.mpf(force) / int(k)) for k in i]
            matrix = mp.zeros(bonds)
            for k in range(bonds):
                matrix[k, k] = up[k] + down[k]
                if k > 0:
                    matrix[k, k - 1] = -down[k]
                if k + 1 < bonds:
                    matrix[k, k + 1] = -up[k]
            exact = float(mp.lu_solve(matrix, mp.ones(bonds, 1))[bonds - 1])
        # three roundings a bond, and those of F/(i f_b) up to 30 in the exponent
        got = cluster_lifetime(bonds, force * 1e-11, 50.0, 1e-11, beta * 50.0)
        assert_allclose(got, exact / 50.0, rtol=3e-14, atol=0)


def test_large_clusters():
    n = np.arange(1, 3001)
    assert_allclose(cluster_lifetime(3000, 0.0, 1.0, 1.0, 0.0), math.fsum(1 / n), rtol=1e-13, atol=0)
    assert_allclose(cluster_lifetime(3000, 900.0, 1.0, 1.0, 0.0), math.fsum(np.exp(-900 / n) / n), rtol=1e-13, atol=0)
    # 2^3000 and more, also where the last bond has no time left
    assert_array_equal(cluster_lifetime(3000, [0.0, 800.0], 1.0, 1.0, [1.0, 5.0]), math.inf)
    assert 0.0 < cluster_lifetime(3000, 1e5, 1.0, 1.0, 1.0) < 1e-10
    assert np.isnan(cluster_lifetime([0.0, -1.0, 2.5, math.inf, math.nan], 0.0, 1.0, 1.0, 1.0)).all()


BOND = (2.0, 1e-11, 1e-3, 6.0)
IN_SPEED = {
    "bell_fraction": (1, lambda v: bell_fraction(v, *BOND)),
    "bell_stress": (-1, lambda v: bell_stress(v, *BOND, 1e16)),
    "first_moment_fraction": (1, lambda v: first_moment_fraction(v, *BOND)),
    "first_moment_stress": (-1, lambda v: first_moment_stress(v, *BOND, 1e16)),
    "first_moment_stretch": (-1, lambda v: first_moment_stretch(v, *BOND[:3])),
    "cut_off_fraction": (1, lambda v: cut_off_fraction(v, 2.0, 1e-8, 6.0)),
    "cut_off_stress": (-1, lambda v: cut_off_stress(v, 2.0, 1e-8, 1e-3, 6.0, 1e16)),
    "start_up_force": (-1, lambda v: start_up_force(0.1, v, *BOND[:3])),
    "start_up_peak": (-1, lambda v: start_up_peak(v, *BOND[:3]).force),
    "bell_rupture_force": (-1, lambda v: bell_rupture_force(1e-3 * v, *BOND[:2])),
}
MOMENTS = {
    "constant": lambda v: constant_moments(v, 2.0, 1e-3, 6.0),
    "bell": lambda v: bell_moments(v, *BOND),
    "cut_off": lambda v: cut_off_moments(v, 2.0, 1e-8, 1e-3, 6.0),
}


def test_fractions_are_even_and_forces_odd_in_the_speed():
    for name in IN_SPEED:
        sign, function = IN_SPEED[name]
        speed = 10.0 ** np.arange(-12.0, 3.0)
        forward = function(speed)
        assert_array_equal(function(-speed), sign * forward)
        assert np.all(np.isfinite(forward)) and np.all(forward >= 0.0)
        assert function(0.0) == (1.0 if sign == 1 else 0.0)


def test_moments_are_those_of_a_population():
    for name in MOMENTS:
        speed = 10.0 ** np.arange(-12.0, 3.0)
        bound, force, square = MOMENTS[name](speed)
        back = MOMENTS[name](-speed)
        assert_array_equal(back, [bound, -force, square])
        assert np.all(square * bound >= force**2 * (1 - 1e-14))  # of the bonds that are there
        assert np.all((bound > 0.0) & (bound <= 0.75 * (1 + 1e-15)))
        for part in (*MOMENTS[name](speed.reshape(5, 3)), *MOMENTS[name](list(speed.reshape(5, 3)))):
            assert part.shape == (5, 3)


def test_arguments_broadcast():
    speed, rate = np.ones((3, 1)), np.ones(4)
    assert all(part.shape == (3, 4) for part in bell_lives(speed, rate, 1.0, 1.0))
    assert all(part.shape == (3, 4) for part in bell_moments(speed, 1.0, 1.0, 1.0, rate))
    assert all(part.shape == (3, 4) for part in constant_moments(speed, 1.0, 1.0, rate))
    assert all(part.shape == (3, 4) for part in cut_off_moments(speed, 0.0, rate, 1.0, 1.0))
    assert all(part.shape == (3, 4) for part in start_up_peak(speed, rate, 1.0, 1.0))
    assert all(part.shape == (3, 4) for part in bell_peak(speed, 1.0, 1.0, rate, 1.0))
    assert all(part.shape == (3, 4) for part in first_moment_peak(1.0, 1.0, speed, rate, 1.0))
    assert bell_stress(speed, 1.0, 1.0, 1.0, 1.0, rate).shape == (3, 4)
    assert cluster_lifetime(5.0 * speed, rate, 1.0, 1.0, 1.0).shape == (3, 4)
    whole = bell_moments([1.0, 10.0], 1.0, 1.0, 1.0, 1.0).force
    assert_array_equal(whole, [bell_moments(v, 1.0, 1.0, 1.0, 1.0).force for v in (1.0, 10.0)])


def test_the_onset_of_oscillations_is_that_of_the_closures_eigenvalues():
    for speed, beta, stiffness, frequency in [
        (10.0, 1.0, 0.0390213, 4.691569),
        (20.0, 1.0, 0.0515158, 9.999753),
        (50.0, 10.0, 0.1823410, 24.876979),
        (100.0, 1.0, 0.0378665, 46.056227),
    ]:
        found = first_moment_onset(speed, 1.0, 1.0, 1.0, beta, 1.0, Body(1.0))
        assert_allclose(found, (stiffness, frequency), rtol=2e-6)
        assert np.isnan(first_moment_onset(0.5, 1.0, 1.0, 1.0, beta, 1.0, Body(1.0))).all()


def test_the_onset_of_bonds_resolved_by_stretch_is_that_of_the_characteristic_equation():
    for beta, speed, stiffness, frequency in [
        (0.1, 5.0, 0.00320497, 2.00008),
        (0.1, 20.0, 0.00436311, 8.59175),
        (1.0, 5.0, 0.00559440, 1.08232),
        (1.0, 10.0, 0.0295565, 4.25784),
        (1.0, 20.0, 0.0352161, 8.66919),
        (1.0, 100.0, 0.0205200, 36.2893),
        (10.0, 20.0, 0.00714525, 2.71580),
        (10.0, 100.0, 0.127572, 39.1448),
        (10.0, 1000.0, 0.0408748, 281.987),
    ]:
        found = resolved_onset([speed, -speed], [(1.0, 1.0)], 1.0, beta, 1.0, Body(1.0))
        assert_allclose(found, np.transpose([(stiffness, frequency)] * 2), rtol=5e-6)
        # of rates, forces and sites only ratios count
        assert_allclose(
            resolved_onset(6.0 * speed, [(2.0, 3.0)], 1.0, 2.0 * beta, 5.0, Body(0.2)).stiffness, stiffness, rtol=5e-6
        )


def test_oscillations_of_bonds_resolved_by_stretch_set_in_beyond_the_maximum_of_friction_alone():
    bell = bell_peak(1.0, 1.0, 1.0, 1.0, 1.0).speed
    assert np.array_equal(
        np.isnan(
            resolved_onset(bell * np.array([0.0, 0.5, 0.999, 1.001, 2.0]), [(1.0, 1.0)], 1.0, 1.0, 1.0, Body(1.0))
        ),
        [[True, True, True, False, False]] * 2,
    )
    catch = 1.0, 1.0, 1e-2, 1.0
    speed = np.geomspace(0.1, 100.0, 200)
    falls = np.gradient(catch_moments(speed, *catch, 1.0, 1.0).force, speed) < 0.0
    onset = resolved_onset(speed, [(1.0, -1.0), (1e-2, 1.0)], 1.0, 1.0, 1.0, Body(1.0)).stiffness
    assert np.sum(falls != np.isfinite(onset)) <= 1
    assert 10 < np.sum(falls) < 190
    yielding = Body(1.0, mass=1e-3, contact_stiffness=[math.inf, 0.05, 0.02])
    behind, alone = (resolved_onset(10.0, [(1.0, 1.0)], 1.0, 1.0, 1.0, body) for body in (yielding, Body(1.0)))
    swings = 1e-3 * alone.frequency**2
    series = alone.stiffness / (1.0 - alone.stiffness / 0.05)
    assert_allclose(behind.stiffness, (swings + alone.stiffness, swings + series, math.inf), rtol=1e-12)


def test_oscillations_set_in_gradually_at_high_speeds_and_suddenly_at_low_ones():
    def amplitude(speed, beta=1.0):
        return first_moment_amplitude(speed, 1.0, 1.0, 1.0, beta)

    assert_allclose(amplitude(100.0), 6.366370, rtol=1e-7)
    for beta, turn in ((0.1, 15.372886), (1.0, 20.372634), (10.0, 60.085501)):
        assert amplitude(turn * (1.0 + 1e-6), beta) > 100.0
        assert np.isnan(amplitude(turn * (1.0 - 1e-6), beta))
    assert np.isnan(amplitude([0.0, 0.5, -0.5, 10.0])).all()
    assert_allclose(amplitude([-100.0, 50.0]), [amplitude(100.0), amplitude(50.0)], rtol=1e-12)
    # of the rates and forces only ratios count
    assert_allclose(first_moment_amplitude(100.0, 3.0, 2.0, 6.0, 3.0), amplitude(100.0), rtol=1e-13)


def test_area_mass_and_a_contact_that_yields_raise_the_stiffness_at_the_onset():
    def onset(**body):
        return first_moment_onset(10.0, 1.0, 1.0, 1.0, 1.0, 1.0, Body(1.0, **body))

    massive, steps = [0.0, 1e-3], {"contact_stiffness": 0.05}
    assert_allclose(onset(area_growth=0.5), (0.0986672601, 6.4985274731), rtol=1e-9)
    assert_allclose(onset(mass=[1e-3, 1e-2]).stiffness, (0.0610321013, 0.2591294488), rtol=1e-8)
    assert_allclose(onset(mass=massive, **steps).stiffness, (0.1777133504, 0.1997241668), rtol=1e-8)
    assert_allclose(onset(mass=1e-2, contact_stiffness=0.2).stiffness, 0.2685882190, rtol=1e-8)
    assert onset(contact_stiffness=0.03).stiffness == math.inf


def test_damping_holds_softer_springs_and_so_does_a_viscous_interface_whose_contact_does_not_yield():
    def onset(**body):
        return first_moment_onset(10.0, 1.0, 1.0, 1.0, 1.0, 1.0, Body(**({"area": 1.0} | body)))

    assert_allclose(onset(damping=1e-3), (0.0319311178, 4.1845576357), rtol=1e-8)
    assert_allclose(onset(damping=2e-3), (0.0241019898, 3.5927135646), rtol=1e-8)
    assert_allclose(onset(mass=1e-3, damping=1e-3), (0.0494416404, 4.1845576357), rtol=1e-8)
    softer = onset(mass=1e-3, damping=1e-3, contact_stiffness=0.05)
    assert_allclose(softer, (0.1924327975, 4.6670599625), rtol=1e-8)
    assert_allclose(onset(area=2.0, viscosity=5e-4).stiffness, 2.0 * onset(damping=5e-4).stiffness, rtol=1e-12)
    assert np.isnan(onset(damping=10.0)).all() and np.isnan(onset(viscosity=10.0, contact_stiffness=0.03)).all()


def test_what_holds_a_spring_solves_the_characteristic_equation_with_all_its_terms():
    body = Body(2.0, 0.5, -0.1, 1e-3, 1e-3, 1e-4, 0.5, 0.5)
    stiffness, frequency = first_moment_onset(10.0, 1.0, 1.0, 1.0, 1.0, 1.0, body)
    # bonds N and stretches x of a site, slip and body: small motions of the equations of the closure themselves
    tilt = 1.7455280027406994  # x e^x = 10
    rate, turns = 10.0 / tilt, 1j * frequency
    bound = 1.0 / (1.0 + rate)
    rows = [[turns + 1.0 + rate, bound * rate], [tilt * turns / bound, turns + rate * (1.0 + tilt)]]
    more, stretched = np.linalg.solve(rows, [0.0, turns])
    moment = bound * stretched + tilt * more
    spread = 0.5 * more / bound - 0.1 * moment / (bound * tilt)
    force = 2.0 * (bound * tilt + 1e-3)
    pulls = 2.0 * (moment + 1e-4 * turns) + force * spread
    way = 1.0 + (pulls - 0.5 * force * spread) / 0.5
    assert abs((stiffness + 1e-3 * turns + 1e-3 * turns**2) * way + pulls) < 1e-12 * abs(pulls)
