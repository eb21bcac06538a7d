"""Means at the known mean of ΔΓ: exact answers, where they are used, and where they must not be."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import special

import sim
from sim.read.control_variate import FEWEST, control_variate, corrected
from sim.read.statistics import over_members


def _regressors(energy, variance):
    off = energy - 1.0
    return off, off**2 - variance


@pytest.mark.parametrize("members", [FEWEST, 20])
def test_a_linear_response_has_its_exact_mean_and_no_error(members):
    energy = np.random.default_rng(3).gamma(4.0, 0.25, (5, members))
    result = corrected(3.0 - 2.0 * energy, *_regressors(energy, 0.25))
    assert_allclose(result.mean, 1.0, rtol=1e-13)
    assert np.all(result.sem < 1e-13)


def test_a_quadratic_response_has_its_exact_mean():
    """E (ΔΓ − 2)² = var + 1 of ΔΓ with mean 1."""
    energy = np.random.default_rng(3).gamma(4.0, 0.25, (5, 12))
    result = corrected((energy - 2.0) ** 2, *_regressors(energy, 0.25))
    assert_allclose(result.mean, 1.25, rtol=1e-12)


def test_the_error_of_a_noisy_response_is_that_of_a_regression_at_a_point():
    """The textbook's prediction error of a line: s² (1/n + (x0 − x̄)²/Sxx) with n − 2 degrees of freedom."""
    rng = np.random.default_rng(5)
    energy, noise = rng.gamma(25.0, 0.04, 16), rng.normal(size=16)
    values = 2.0 + energy + noise
    result = corrected(values, *_regressors(energy, 0.04))
    slope, level = np.polyfit(energy, values, 1)
    residual = values - level - slope * energy
    spread = np.sum((energy - energy.mean()) ** 2)
    error = np.sum(residual**2) / 14 * (1 / 16 + (1.0 - energy.mean()) ** 2 / spread)
    assert result.freedom == 14
    assert_allclose(result.mean, level + slope, rtol=1e-12)
    assert_allclose(result.sem, np.sqrt(error), rtol=1e-12)


def test_a_regressor_that_does_not_vary_gives_no_answer():
    values, none = np.random.default_rng(1).normal(size=16), np.zeros(16)
    assert np.isnan(corrected(values, none, none).sem)


@pytest.fixture(scope="module")
def lens():
    changes = {"ensemble.members": 24, "clock.duration": "1.6 s"}
    return sim.run(sim.load("scenarios/pdms_lens.toml", changes))


def test_the_known_mean_and_spread_of_the_energy_are_those_of_many_members():
    changes = {
        "ensemble.members": 4000,
        "clock.duration": "20 ms",
        "clock.record": "20 ms",
    }
    many = sim.run(sim.load("scenarios/pdms_lens.toml", changes))
    off = many["fluctuation_energy"] / many["expected_energy"] - 1.0
    spread = float(many["energy_variation"])
    assert np.all(abs(off.mean("member")) < 4.0 * spread / np.sqrt(4000))
    assert_allclose(off.std("member") / spread, 1.0, atol=4.0 / np.sqrt(8000))


def test_the_mean_area_is_corrected_and_the_plain_mean_stands_beside_it(lens):
    one = over_members(lens, ["contact_area"])["contact_area"]
    assert_allclose(one.plain, lens["contact_area"].mean("member"), rtol=1e-12)
    falling = {"t": slice(190, 230)}  # of the area, before members are masked
    plain_error = lens["contact_area"].std("member", ddof=1) / np.sqrt(24)
    factor = (plain_error.isel(falling) / one.sem.isel(falling)) ** 2
    assert float(factor.median()) > 20.0
    factors = ((one.high - one.value) / one.sem).isel(falling).to_numpy()
    students = special.stdtrit(np.array([21.0, 22.0]), 0.975)
    assert np.all(np.isclose(factors[:, np.newaxis], students, rtol=1e-9).any(axis=1))


def test_shares_of_the_lost_area_still_add_up(lens):
    names = ["area_ratio", "lost_to_bonds", "lost_to_fluctuations"]
    shares = over_members(lens, names)
    assert_allclose(sum(shares[name].value for name in names), 1.0, rtol=1e-12)


def test_the_csv_has_the_plain_mean_beside_the_corrected_one(lens):
    run = sim.Run(lens)
    rows = run.dataset.sizes["t"]
    area = sim.read.long(run).query("quantity == 'contact_area'")
    assert len(area) == rows
    assert (area["plain_mean"] != area["mean"]).any()
    assert (area["bias_bound"] > 0.0).any()


def test_the_mean_over_the_second_half_is_corrected():
    changes = {"drive": {"model": "steady", "speed": "4 mm/s"}}
    changes |= {"ensemble.members": 24, "clock.duration": "0.2 s"}
    run = sim.Run(sim.run(sim.load("scenarios/pdms_lens.toml", changes)))
    area = run.late(["contact_area"])["contact_area"]
    late = run.dataset["contact_area"].isel(t=slice(run.dataset.sizes["t"] // 2, None))
    means = late.mean("t")
    assert_allclose(area.plain, means.mean(), rtol=1e-12)
    assert float(area.sem) < 0.3 * float(means.std(ddof=1)) / np.sqrt(24)


@pytest.mark.parametrize(
    "changes",
    [
        {"ensemble.members": FEWEST - 1},
        {"shear.amplitude.relaxing": True, "ensemble.members": 8},
        {"shear.amplitude": {"model": "slip_rate"}, "ensemble.members": 8},
        {"shear": {"model": "uniform"}, "ensemble.members": 8},
        {"record.per_member": False, "ensemble.members": 8},
    ],
)
def test_without_a_known_mean_there_is_no_control_variate(changes):
    scene = sim.load("scenarios/pdms_lens.toml", changes | {"clock.duration": "50 ms"})
    dataset = sim.run(scene)
    assert control_variate(dataset) is None


def test_behind_a_spring_there_is_none():
    """There the mean of ΔΓ is another one, because the friction decides how long a member stays at a value."""
    changes = {"ensemble.members": 8, "clock.duration": "50 ms"}
    dataset = sim.run(sim.load("scenarios/pdms_lens_spring.toml", changes))
    assert "expected_energy" not in dataset
    assert control_variate(dataset) is None
    assert over_members(dataset, ["contact_area"])["contact_area"].plain is None


def test_where_masking_is_likely_it_is_off_whatever_the_sample(lens):
    one = over_members(lens, ["contact_area"])["contact_area"]
    masked, used = lens["masked"].mean("member"), one.bias.notnull()
    assert used.any() and (masked > 0.0).any()
    assert not used.where(masked > 0.0, False).any()
    assert (one.value == one.plain).where(~used, True).all()
    changes = {"ensemble.members": 24, "clock.duration": "1.6 s", "seed": 5}
    other = sim.run(sim.load("scenarios/pdms_lens.toml", changes))
    control, again = control_variate(lens), control_variate(other)
    assert (control.is_used == again.is_used).all()


#: Contacts that slide steadily: the response is a function of ΔΓ, or the bonds are random as well.
SLIDING = {"clock.duration": "10 ms", "clock.record": "10 ms"}
COUNTED = {
    "model": "counted",
    "critical_speed": "10 mm/s",
    "rebinding_rate": "500 1/s",
    "stress": "0.3 MPa",
}
RIPPLE = {
    "model": "modal",
    "cell": "0.24 mm",
    "correlation": {"model": "slip", "length": "5 um"},
    "spectrum": {"model": "ripple", "amplitude": "150 kPa", "wavelength": "24 um"},
}


def _at(speed, **more):
    drive = {"drive": {"model": "steady", "speed": speed}}
    return "scenarios/pdms_lens.toml", SLIDING | drive | more


#: Scenes with the least factor of the variance at 64 members, true where the response is a function of ΔΓ alone.
REPEATED = {
    "pdms_lens": (*_at("4 mm/s"), 1e4),
    "near masking": (*_at("6 mm/s"), 1e3),
    "ten_wavelengths": ("scenarios/ten_wavelengths.toml", {"sweep": {}}, 1e3),
    "masking": ("scenarios/masking.toml", {"sweep": {}, "shear": RIPPLE}, 20.0),
    "many sites": (*_at("4 mm/s", bonds=COUNTED | {"sites": 30000}), 20.0),
    "sites": (*_at("3 mm/s", bonds=COUNTED | {"sites": 3000}), 2.0),
    "few sites": (*_at("3 mm/s", bonds=COUNTED | {"sites": 300}), 1.0),
}


@pytest.mark.verify
def test_intervals_hold_over_a_thousand_repetitions_and_the_bias_is_below_its_bound():
    """Intervals of 68 % (Student's) with noise beside ΔΓ; of a function of ΔΓ alone they are wider than that."""
    pooled = []
    for name, (path, changes, least) in REPEATED.items():
        many = sim.run(sim.load(path, changes | {"ensemble.members": 64000}))
        last = many.isel(t=-1)
        off = (last["fluctuation_energy"] / last["expected_energy"] - 1.0).to_numpy()
        area = last["contact_area"].to_numpy()
        known = area, *_regressors(1.0 + off, float(many["energy_variation"]) ** 2)
        truth = float(corrected(*known).mean)
        for members in (8, 16, 64):
            rows = (each[: 1000 * members].reshape(1000, members) for each in known)
            result = corrected(*rows)
            half = special.stdtrit(result.freedom, special.ndtr(1.0)) * result.sem
            held = float(np.mean(abs(result.mean - truth) < half))
            bias = abs(result.mean.mean() - truth)
            assert bias < result.bias.mean() + 4.0 * result.mean.std() / np.sqrt(1000)
            error = 3.5 * np.sqrt(0.683 * 0.317 / 1000)
            if "sites" in name:
                pooled.append(held)
                assert abs(held - 0.683) < error, (name, members, held)
            else:
                assert held > 0.683 - error, (name, members, held)
        factor = area.var() / members / np.mean((result.mean - truth) ** 2)
        assert factor > least, (name, factor)
    assert 0.66 < np.mean(pooled) < 0.70
