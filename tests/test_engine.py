"""The engine: restart, batch and recording leave every bit as it was; parts know nothing of each other."""

import math

import numpy as np
import pytest
from helpers.scenes import BONDS, CONTACTS, DRIVES, SHEARS, scene
from numpy.testing import assert_allclose

from sim.engine import march, pack, unpack

DEPTHS = {"drive": DRIVES, "bonds": BONDS, "shear": SHEARS, "contact": CONTACTS}


def full_product():
    """Every depth with every depth."""
    cases = [{}]
    for part, depths in DEPTHS.items():
        cases = [{**case, part: name} for case in cases for name in depths]
    return cases


def pairwise_covering():
    """Few cases that hold every pair of depths: greedily the case with most pairs not seen yet."""
    left = {
        frozenset([(one, a), (two, b)])
        for one in DEPTHS
        for two in DEPTHS
        if one < two
        for a in DEPTHS[one]
        for b in DEPTHS[two]
    }
    chosen, cases = [], full_product()
    while left:
        best = max(cases, key=lambda case: len(pairs_of(case) & left))
        chosen.append(best)
        left -= pairs_of(best)
    return chosen


def pairs_of(case):
    items = sorted(case.items())
    return {frozenset([one, two]) for i, one in enumerate(items) for two in items[i + 1 :]}


def same(one, two):
    """Whether two states agree to the last bit, nan equal to nan."""
    left, right = pack(one), pack(two)
    return left.keys() == right.keys() and all(np.array_equal(left[k], right[k], equal_nan=True) for k in left)


def rows(state, row, members):
    """The arrays of one member of a state."""
    return {k: (v[row : row + 1] if v.ndim and v.shape[0] == members else v) for k, v in pack(state).items()}


def check_case(case, members=3, steps=6):
    scenario = scene(members, steps, **{part: DEPTHS[part][name] for part, name in case.items()})
    straight = list(march(scenario, np.arange(members)))
    assert len(straight) == steps + 1
    restarted = list(march(scenario, np.arange(members), unpack(pack(straight[2]))))
    assert all(same(one, two) for one, two in zip(straight[3:], restarted, strict=True))
    alone = list(march(scenario, np.array([1])))
    for together, single in zip(straight, alone, strict=True):
        found = rows(together, 1, members)
        assert all(np.array_equal(found[k], v, equal_nan=True) for k, v in pack(single).items())
    for state in straight:
        check_waist(scenario, state, members)


def check_waist(scenario, state, members):
    """Shapes follow from the classes; w is the balance of its parts; no contact is smaller than Hertz."""
    values = {
        "bonds": scenario.population.fraction(state.bonds),
        "shear": state.shear.energy,
        "contact": state.contact.radius,
    }
    for part, value in values.items():
        assert value.shape == ((members,) if scenario.varies[part] else (1,)), part
    work = balance_of(scenario, state)
    assert_allclose(state.contact.work, np.broadcast_to(work, state.contact.work.shape), rtol=1e-13, atol=1e-16)
    grip = scenario.contact.grip(scenario.clock.time(state.step), scenario.clock.duration)
    hertz = grip.radius(np.zeros(1), np.zeros(1), 0.0, scenario.bodies)
    closed = np.isfinite(state.contact.radius)
    if np.isfinite(hertz[0]):
        assert np.all(state.contact.radius[closed] >= hertz * (1 - 1e-12))


def balance_of(scenario, state):
    """w = Δγ φ − χ ΔΓ − α 6 τ0² a/(π E*), an open contact's at a = 0; on a disc ΔΓ is what its amplitude costs."""
    radius = np.nan_to_num(state.contact.radius, nan=0.0)
    stress = scenario.population.shear_stress(state.bonds)
    share = 1.0 if scenario.margin is None else scenario.margin(radius)
    paid = scenario.fluctuations.paid_by_adhesion * share * state.shear.energy
    mean = scenario.contact.reversible * 6.0 * stress**2 * radius / (np.pi * scenario.solid.contact_modulus)
    return 42e-3 * scenario.population.fraction(state.bonds) - paid - mean


@pytest.mark.parametrize("case", pairwise_covering(), ids=lambda case: "; ".join(case.values()))
def test_any_depth_runs_with_any_depth(case):
    check_case(case)


@pytest.mark.verify
@pytest.mark.parametrize("case", full_product(), ids=lambda case: "; ".join(case.values()))
def test_every_depth_runs_with_every_depth(case):
    check_case(case)


def test_the_covering_holds_every_pair_of_depths():
    wanted = {pair for case in full_product() for pair in pairs_of(case)}
    assert wanted == {pair for case in pairwise_covering() for pair in pairs_of(case)}


def test_time_is_never_accumulated():
    scenario = scene(1, 1000)
    assert scenario.clock.time(1000) == scenario.clock.duration
    assert math.isclose(scenario.clock.time(333), 0.333, rel_tol=1e-15)


@pytest.mark.parametrize("steps", [1000, pytest.param(1_000_000, marks=pytest.mark.verify)])
def test_long_marches_do_not_drift(steps):
    scenario = scene(1, steps, drive=DRIVES["steady"], bonds=BONDS["rate"])
    *_, last = march(scenario, np.arange(1))
    rate = 500.0 * (1.0 + 2e-3 / 1e-2)
    exact = 1.0 / 1.2 + (1.0 - 1.0 / 1.2) * math.exp(-rate * scenario.clock.duration)
    assert_allclose(last.bonds.bound, exact, rtol=1e-12)
    assert_allclose(last.position, 2e-3 * scenario.clock.duration, rtol=1e-16 * steps + 1e-14)


def test_a_detached_contact_stays_open():
    # a ripple that grows past what tension allows and falls back again
    from sim.parts.drive import prescribed as drive
    from sim.parts.shear import models as shear
    from sim.parts.shear.amplitude import Onset
    from sim.parts.shear.correlation import Time
    from sim.spectrum.families import Ripple

    part = shear.Modal(
        spectrum=Ripple(amplitude=4e5, wavelength=24e-6),
        correlation=Time(time=1.0),
        amplitude=Onset(speed=1e-3, width=0.1),
        mode_amplitudes="fixed",
    )
    pulse = drive.Table(time=(0.0, 0.003, 0.004, 0.005, 0.1), speed=(1e-5, 1e-5, 1e-1, 1e-5, 1e-5))
    scenario = scene(1, 8, shear=part, drive=pulse, contact=CONTACTS["tension"])
    radii = [state.contact.radius[0] for state in march(scenario, np.arange(1))]
    assert np.isfinite(radii[:4]).all()
    assert np.isnan(radii[4:]).all()
