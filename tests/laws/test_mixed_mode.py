"""Mixed-mode theories: states, folds and limits against G_n + G_s = w f(psi) as it stands, in fifty digits.

Tolerances: u = 2^-53. A radius is good to a few roundings of load or indentation, amplified by the slope of that
over the radius; away from folds by less than ten.
"""

import itertools
import math

import mpmath
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from sim.laws import jkr, theories

U = 2.0**-53
#: R, w and E* at which Maugis' units are m, N and m: pi w R = 1 N, 3 pi w R^2/(4 E*) = 1 m^3.
WORK, MODULUS = 1.0 / math.pi, 0.75
LAWS = {
    "scaled_angle": (
        theories.scaled_angle_at_load,
        theories.scaled_angle_at_indentation,
    ),
    "shear_share": (theories.shear_share_at_load, theories.shear_share_at_indentation),
    "scaled_tangent": (
        theories.scaled_tangent_at_load,
        theories.scaled_tangent_at_indentation,
    ),
}
#: f(psi) of each law.
EXCESS = {
    "scaled_angle": lambda psi, mixity: 1 + mpmath.tan((1 - mixity) * psi) ** 2,
    "shear_share": lambda psi, mixity: 1 / (1 + (mixity - 1) * mpmath.sin(psi) ** 2),
    "scaled_tangent": lambda psi, mixity: 1 + (1 - mixity) * mpmath.tan(psi) ** 2,
}


def radius(name, level, force, mixity, at_load=True, poisson_ratio=0.5):
    """Radius by the law under test, in Maugis' units."""
    return LAWS[name][0 if at_load else 1](
        level, WORK, force, mixity, 1.0, MODULUS, poisson_ratio
    )


def left(name, a, level, force, mixity, at_load):
    """w f(psi) - G_n - G_s over w at a radius, in digits of mpmath: above zero where the contact grows."""
    normal = (
        (a**3 - level) ** 2 / (6 * a**3)
        if at_load
        else mpmath.mpf(3) / 8 * (level - a**2) ** 2 / a
    )
    shear = force**2 / (4 * a**3)
    return (
        EXCESS[name](mpmath.atan(mpmath.sqrt(shear / normal)), mixity) - normal - shear
    )


def exact_radius(name, level, force, mixity, at_load=True):
    """The widest radius of equilibrium, looked for from JKR's inward, in fifty digits; None without one."""
    with mpmath.workdps(50):
        level, force, mixity = map(mpmath.mpf, (level, force, mixity))
        if at_load:
            high = mpmath.cbrt(level + 3 + mpmath.sqrt(6 * level + 9))
            hertz = mpmath.cbrt(max(level, mpmath.mpf(10) ** -6))
        else:
            high = mpmath.findroot(
                lambda a: a**2 - level - mpmath.sqrt(8 * a / 3),
                2 + mpmath.sqrt(abs(level)),
            )
            hertz = mpmath.sqrt(max(level, mpmath.mpf(10) ** -6))
        # inward of JKR's radius G_n + G_s falls short of w f where the contact is wider than in equilibrium
        steps = [high - (high - hertz) * k / 200 for k in range(1, 200)]
        wider = high
        for a in steps:
            if left(name, a, level, force, mixity, at_load) > 0:
                return mpmath.findroot(
                    lambda a: left(name, a, level, force, mixity, at_load),
                    (a, wider),
                    solver="anderson",
                    tol=1e-80,
                )
            wider = a
        return None


def test_the_radius_closes_the_balance_in_fifty_digits():
    for name, mixity in itertools.product(LAWS, [0.05, 0.5, 0.79, 0.99]):
        for at_load, levels in (
            (True, (-1.2, 0.0, 0.3, 30.0)),
            (False, (-0.2, 0.0, 0.3, 8.0)),
        ):
            for level, force in zip(levels, (0.3, 1.5, 2.5, 9.0), strict=True):
                exact = exact_radius(name, level, force, mixity, at_load)
                computed = float(radius(name, level, force, mixity, at_load))
                if exact is None:
                    hertz = np.cbrt(level) if at_load else np.sqrt(level)
                    assert_allclose(
                        computed,
                        hertz if level >= 0.0 else math.nan,
                        rtol=4 * U,
                        atol=0,
                    )
                else:
                    assert_allclose(computed, float(exact), rtol=1e-12, atol=0)


def test_a_branch_ends_at_its_fold_in_a_jump_or_reaches_hertz_smoothly():
    # Law, control, level, lambda, and radius and force at the end of its branch.
    for name, at_load, level, mixity, last, force in [
        ("scaled_angle", True, 1.0, 0.2, 1.34802289496, 7.17595030009),
        ("scaled_angle", True, 1.0, 0.5, 1.53887977112, 3.86459513208),
        ("scaled_tangent", True, -1.0, 0.5, 1.15000201199, 2.55910723392),
        ("shear_share", True, 1.0, 0.2, 4.0 ** (1 / 3), 7.07106781187),
        ("shear_share", True, 1.0, 0.5, 4.0 ** (1 / 3), 4.472135955),
        ("scaled_angle", False, 1.65429912029112, 0.2, 1.33719207122, 9.46740735087),
        ("scaled_angle", False, 1.65429912029112, 0.5, 1.56813713305, 4.58120835551),
        ("shear_share", False, 1.65429912029112, 0.2, 1.63701359433, 8.16091481802),
        ("shear_share", False, 1.65429912029112, 0.5, 1.63701359433, 5.16141572311),
    ]:
        after = radius(name, level, force * (1.0 + 1e-10), mixity, at_load)
        hertz = (
            jkr.hertz_radius_at_load(level, 1.0, MODULUS)
            if at_load
            else math.sqrt(level)
        )
        assert after == hertz if level > 0.0 else math.isnan(after)
        # towards the fold the radius goes as the root of what is missing of the force: its series, to the fifth order
        missing = 1e-3 * np.arange(1, 7)
        radii = radius(name, level, force * (1.0 - missing**2), mixity, at_load)
        assert_allclose(
            np.polynomial.Polynomial.fit(missing, radii, 5)(0.0),
            last,
            rtol=1e-8,
            atol=0,
        )
        assert np.all(np.diff(radii) > 0.0)
    # a contact under a large load reaches Hertz's radius smoothly, at this force
    limit = 2.0 * math.sqrt(100.0) / math.sin(0.1 * math.pi)
    before, after = (
        float(radius("scaled_angle", 100.0, limit * (1.0 + off), 0.2))
        for off in (-1e-9, 1e-9)
    )
    assert (
        after
        == jkr.hertz_radius_at_load(100.0, 1.0, MODULUS)
        < before
        < after * (1.0 + 1e-8)
    )


def test_limits_of_the_mixity_and_the_share_of_adhesion_that_the_scaled_tangent_keeps():
    for at_load in [True, False]:
        for name in LAWS:
            rng = np.random.default_rng(71)
            work, sphere_radius, modulus = 10.0 ** rng.uniform(-6.0, 3.0, (3, 400))
            poisson_ratio = rng.uniform(0.0, 0.5, 400)
            pull = np.pi * work * sphere_radius
            level = pull * rng.uniform(-1.2, 30.0, 400)
            if not at_load:
                level = jkr.indentation_at_radius(
                    jkr.radius_at_load(level, work, sphere_radius, modulus),
                    work,
                    sphere_radius,
                    modulus,
                )
            plain = jkr.radius_at_load if at_load else jkr.radius_at_indentation
            stuck = (
                theories.savkoor_briggs_at_load
                if at_load
                else theories.savkoor_briggs_at_indentation
            )
            law, rest = LAWS[name][0 if at_load else 1], (sphere_radius, modulus)
            force = pull * rng.uniform(0.0, 0.3, 400)  # well before any fold
            assert_array_equal(
                law(level, work, force, 0.0, *rest, poisson_ratio),
                plain(level, work, *rest),
            )
            assert_array_equal(
                law(level, work, 0.0, 0.4, *rest, poisson_ratio),
                plain(level, work, *rest),
            )
            exact = stuck(level, work, force, *rest, poisson_ratio)
            assert np.all(np.isfinite(exact)) and np.all(
                exact < plain(level, work, *rest)
            )
            assert_allclose(
                law(level, work, -force, 1.0, *rest, poisson_ratio),
                exact,
                rtol=1e-12,
                atol=0,
            )
            # the second is Savkoor & Briggs' at the force times the root of lambda, up to the jump
            far = pull * 10.0 ** rng.uniform(-3.0, 2.0, 400)
            for mixity in (0.05, 0.7):
                share = LAWS["shear_share"][0 if at_load else 1](
                    level, work, far, mixity, *rest, poisson_ratio
                )
                exact = stuck(
                    level, work, math.sqrt(mixity) * far, *rest, poisson_ratio
                )
                # an error of one rounding of the force moves radii near a fold by its root
                assert_allclose(share, exact, rtol=1e-7, atol=0)
                assert np.nanmedian(np.abs(share / exact - 1.0)) < 1e-14
                assert 20 < np.sum(exact > np.fmax(plain(level, 0.0, *rest), 0.0)) < 400
    load = np.array([-0.7, 0.0, 1.0, 40.0])
    # what is left falls as 1/T^2
    computed = radius("scaled_tangent", load, 1e7, 0.5)
    assert_allclose(
        computed, jkr.radius_at_load(load, 0.5 * WORK, 1.0, MODULUS), rtol=1e-12, atol=0
    )
    assert (
        np.isnan(radius("scaled_tangent", -0.76, 1e7, 0.5))
        and radius("scaled_tangent", -0.76, 0.1, 0.5) > 1.0
    )
    assert np.all(computed[1:] > np.cbrt(load[1:]))


def test_a_small_force_costs_its_share_of_savkoor_briggs_loss_and_no_mixity_more():
    for mixity in [0.1, 0.6]:
        for name in LAWS:
            with mpmath.workdps(50):
                a, lam = mpmath.mpf(2), mpmath.mpf(mixity)
                small = mpmath.mpf(10) ** -12
                # G_n that balances at a given radius and force, to second order in T: w - share G_s
                shear = small**2 / (4 * a**3)
                normal = mpmath.findroot(
                    lambda g: (
                        EXCESS[name](mpmath.atan(mpmath.sqrt(shear / g)), lam)
                        - g
                        - shear
                    ),
                    1,
                )
                share = (1 - normal) / shear
                expected = lam * (2 - lam) if name == "scaled_angle" else lam
                assert abs(share - expected) < 1e-20
            full = float(theories.savkoor_briggs_shrinkage(1.0, WORK, 1.0, MODULUS))
            force = 1e-3
            loss = (
                math.pi
                * (
                    radius(name, 1.0, 0.0, mixity) ** 2
                    - radius(name, 1.0, force, mixity) ** 2
                )
                / force**2
            )
            # the next order is of relative size T^2 = 1e-6; the loss, 1e-6 of the area, has ten digits
            assert_allclose(loss, float(expected) * full, rtol=2e-6, atol=0)
    assert np.isnan(radius("scaled_angle", 1.0, 1.0, 1.1)) and np.isnan(
        radius("shear_share", 1.0, 1.0, -0.1)
    )


def test_random_states_are_the_widest_in_balance():
    for at_load in [True, False]:
        for name in LAWS:
            rng = np.random.default_rng(72)
            level = (
                rng.uniform(-1.45, 12.0, 3000)
                if at_load
                else rng.uniform(-0.4, 5.0, 3000)
            )
            force, mixity = (
                10.0 ** rng.uniform(-2.0, 1.5, 3000),
                rng.uniform(0.0, 1.0, 3000),
            )
            mixity[::3] = 1.0 - 10.0 ** rng.uniform(-6.0, -1.0, 1000)
            computed = radius(name, level, force, mixity, at_load)
            widest = (
                jkr.radius_at_load(level, WORK, 1.0, MODULUS)
                if at_load
                else jkr.radius_at_indentation(level, WORK, 1.0, MODULUS)
            )
            hertz = (
                np.cbrt(np.fmax(level, 0.0))
                if at_load
                else np.sqrt(np.fmax(level, 0.0))
            )
            on = computed > hertz * (1.0 + 1e-12)
            assert 500 < on.sum() < 3000 and np.all(
                computed[on] <= widest[on] * (1.0 + 4 * U)
            )
            low = np.where(on, computed, hertz + 1e-9)

            def over(a):
                normal = (
                    (a**3 - level) ** 2 / (6.0 * a**3)
                    if at_load
                    else 0.375 * (level - a**2) ** 2 / a
                )
                shear = force**2 / (4.0 * a**3)
                psi = np.arctan2(np.sqrt(shear), np.sqrt(normal))
                tan2 = np.tan(psi) ** 2
                limit = {
                    "scaled_angle": lambda: 1.0 + np.tan((1.0 - mixity) * psi) ** 2,
                    "shear_share": lambda: (
                        1.0 / (1.0 + (mixity - 1.0) * np.sin(psi) ** 2)
                    ),
                    "scaled_tangent": lambda: 1.0 + (1.0 - mixity) * tan2,
                }[name]()
                return (normal + shear) / limit - 1.0

            assert np.all(np.abs(over(computed)[on]) < 1e-9)
            for share in np.linspace(0.0, 1.0, 101)[1:]:  # wider contacts would open
                assert np.all(over(low + share * (widest - low)) > -1e-9)


def test_compared_at_a_stress_each_law_has_the_force_of_its_own_radius():
    stress = np.linspace(0.0, 10.0, 101)
    for compare, level, number in [
        (theories.compare_at_load, 5.0, 0),
        (theories.compare_at_indentation, 1.0, 1),
    ]:
        radii = compare(stress, level, 1.0, 1.0, 4.0, 0.3, mixity=0.4)
        for name, laws in LAWS.items():
            adhesive = radii[name] > radii["hertz"]
            force = np.pi * radii[name][adhesive] ** 2 * stress[adhesive]
            ratio = (
                laws[number](level, 1.0, force, 0.4, 1.0, 4.0, 0.3)
                / radii[name][adhesive]
            )
            # forces hold 2^-40 of JKR's; near a fold the radius goes as the root of what is missing of the force
            assert np.max(np.abs(ratio - 1.0)) < 1e-6
            assert np.median(np.abs(ratio - 1.0)) < 1e-11
            assert (
                adhesive[0]
                and adhesive.sum() > 10
                and np.all(np.diff(radii[name]) < 1e-10)
            )
            assert np.all(adhesive) == (name == "scaled_tangent")
