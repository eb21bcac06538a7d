"""Statistics: exact on numbers known beforehand, consistent with the laws on real runs."""

import itertools
import math
import re

import numpy as np
import pytest
import xarray as xr

from sim import analysis
from sim.bodies import Adhesion, Solid, Sphere
from sim.ensemble import run
from sim.laws import jkr
from sim.memory import Onset, Time
from sim.parts import bonds, drive, shear
from sim.parts.contact import Equilibrium
from sim.quantity import Quantity
from sim.scenario import Clock, Ensemble, Record, Scenario
from sim.spectrum import Band
from sim.table import columns

RADIUS, WORK, MODULUS, LOAD = 2e-3, 42e-3, 6.4e6, 4e-3
FIELD = {"spectrum": Band(rms=150e3, longest=60e-6, shortest=24e-6), "cell": 0.24e-3, "points": 32}


def scene(**changes):
    parts = {
        "clock": Clock(duration=0.4, step=0.02),
        "solid": Solid(shear_modulus=1.6e6),
        "sphere": Sphere(radius=RADIUS),
        "adhesion": Adhesion(work=WORK),
        "contact": Equilibrium(load=LOAD),
        "drive": drive.Ramp(start=1e-5, stop=1e-1, scale="log"),
        "bonds": bonds.Rate(critical_speed=1e-2, healing=500.0, stress=3e5),
        "shear": shear.Modal(memory=Time(time=0.01), growth=Onset(speed=2.5e-3, width=0.3), **FIELD),
        "ensemble": Ensemble(members=6),
        "seed": 2003,
    }
    return Scenario(**{**parts, **changes})


@pytest.fixture(scope="module")
def ramp():
    return run(scene())


@pytest.fixture(scope="module")
def known(ramp):
    """Five members whose work of adhesion is 1 ... 5 times the time, closed in four, masked in one."""
    five = ramp.isel(realization=slice(0, 5))
    numbers = np.arange(1.0, 6.0)[:, None] * five["t"].to_numpy()
    numbers[0] -= 10.0
    closed = np.ones(numbers.shape, "i1")
    closed[4] = 0
    dims = ("realization", "t")
    return five.assign(work_of_adhesion=(dims, numbers, ramp["work_of_adhesion"].attrs), in_contact=(dims, closed))


def test_statistics_of_known_numbers(known):
    found, t = analysis.statistics(known), known["t"].to_numpy()
    sorted_numbers = np.stack([t - 10.0, 2.0 * t, 3.0 * t, 4.0 * t, 5.0 * t])
    mean = 3.0 * t - 2.0
    deviation = np.sqrt(np.sum((sorted_numbers - mean) ** 2, axis=0) / 4.0)
    np.testing.assert_allclose(found["work_of_adhesion_mean"], mean, rtol=1e-14)
    np.testing.assert_allclose(found["work_of_adhesion_std"], deviation, rtol=1e-13)
    np.testing.assert_allclose(found["work_of_adhesion_sem"], deviation / math.sqrt(5.0), rtol=1e-13)
    # five sorted numbers: the 5 % quantile lies a fifth of the way from the first to the second
    fifth = 0.8 * sorted_numbers[0] + 0.2 * sorted_numbers[1]
    np.testing.assert_allclose(found["work_of_adhesion_quantile"].sel(quantile=0.05), fifth, rtol=1e-13)
    np.testing.assert_allclose(found["work_of_adhesion_quantile"].sel(quantile=0.5), 3.0 * t, rtol=1e-13)
    assert found["work_of_adhesion_mean"].attrs["units"] == "J/m^2"


def test_fractions_count_open_and_masked_contacts(known):
    found = analysis.statistics(known)
    np.testing.assert_allclose(found["fraction_detached_mean"], 0.2, rtol=1e-14)
    np.testing.assert_allclose(found["fraction_detached_sem"], math.sqrt(0.2 * 0.8 / 4.0), rtol=1e-14)
    # member 0 has no work left, at t = 0 all that are closed have none
    np.testing.assert_allclose(found["fraction_masked_mean"], [0.8] + [0.2] * (known.sizes["t"] - 1), rtol=1e-14)


def test_a_variable_without_members_has_no_spread(ramp):
    found = analysis.statistics(ramp)
    np.testing.assert_array_equal(found["speed_mean"], ramp["speed"])
    assert np.all(found["speed_sem"] == 0.0)
    assert np.all(found["speed_quantile"].sel(quantile=0.95) == ramp["speed"])


def test_a_single_member_has_no_standard_error(ramp):
    found = analysis.statistics(ramp.isel(realization=[0]))
    np.testing.assert_array_equal(found["contact_radius_mean"], ramp["contact_radius"][0])
    assert bool(found["contact_radius_sem"].isnull().all())
    np.testing.assert_array_equal(found["contact_radius_quantile"].sel(quantile=0.05), ramp["contact_radius"][0])


def test_members_without_a_value_are_left_out(ramp):
    depth = ramp["indentation"].copy()
    depth[0] = math.nan
    found = analysis.statistics(ramp.assign(indentation=depth))
    rest = analysis.statistics(ramp.isel(realization=slice(1, None)))
    for kind in ("mean", "std", "sem", "quantile"):
        np.testing.assert_allclose(found[f"indentation_{kind}"], rest[f"indentation_{kind}"], rtol=1e-12)
    depth[:, :3] = math.nan
    none = analysis.statistics(ramp.assign(indentation=depth))
    assert bool(none["indentation_mean"][:3].isnull().all()) and bool(none["indentation_mean"][3:].notnull().all())


def test_recorded_statistics_are_those_of_the_members(ramp):
    found, recorded = analysis.statistics(ramp), analysis.statistics(run(scene(record=Record(per_member=False))))
    for name in ("contact_radius", "fluctuation_energy", "fraction_detached", "area_ratio"):
        for kind in ("mean", "std", "sem"):
            # deviations cancel: what is left is rounding of the mean
            rounding = 1e-14 * float(np.max(np.abs(found[f"{name}_mean"])))
            np.testing.assert_allclose(recorded[f"{name}_{kind}"], found[f"{name}_{kind}"], rtol=1e-12, atol=rounding)
    assert "fraction_masked_mean" not in recorded and "contact_radius_quantile" not in recorded
    for kind in ("mean", "sem"):
        name = f"lost_to_fluctuations_{kind}"
        np.testing.assert_allclose(
            analysis.shares(run(scene(record=Record(per_member=False))))[name],
            analysis.shares(ramp)[name],
            rtol=1e-10,
            atol=1e-14,
        )


def test_a_file_gives_the_same_statistics_as_memory(ramp, tmp_path):
    path = run(scene(), to=tmp_path / "out.nc")
    with xr.open_dataset(path) as opened:
        xr.testing.assert_identical(analysis.statistics(opened).load(), analysis.statistics(ramp))


def test_averaging_the_second_half_keeps_the_members_error(ramp):
    dims = ("realization", "t")
    levels = np.array([1.0, 2.0, 4.0, 4.0, 5.0, 8.0])[:, None] * np.ones(ramp.sizes["t"])
    levels[:, : ramp.sizes["t"] // 2] = 1e9  # a start-up that must not count
    stated = xr.Dataset({"level": (dims, levels)}, {"t": ramp["t"]})
    found = analysis.summary(analysis.settled(stated))
    assert found["level_mean"].dims == ("t",) and found.sizes["t"] == 1
    np.testing.assert_allclose(found["level_mean"], 4.0, rtol=1e-14)
    np.testing.assert_allclose(found["level_sem"], math.sqrt(30.0 / 5.0 / 6.0), rtol=1e-14)


# -- shares -----------------------------------------------------------------------------------


def test_shares_and_what_is_left_add_up_to_one_in_every_member(ramp):
    lost, left = analysis.share_observables(ramp), analysis.observables(ramp)["area_ratio"]
    total = lost["lost_to_bonds"] + lost["lost_to_fluctuations"] + left
    np.testing.assert_allclose(total, 1.0, rtol=1e-15)
    assert lost["lost_to_fluctuations"].dims == ("realization", "t")


def test_bonds_alone_take_what_their_work_takes():
    found = analysis.shares(run(scene(shear=shear.Uniform(), bonds=bonds.Steady(critical_speed=1e-2))))
    speed = np.geomspace(1e-5, 1e-1, 21)
    area = [jkr.radius_at_load(LOAD, w, RADIUS, MODULUS) ** 2 for w in (WORK, WORK / (1.0 + speed / 1e-2))]
    # the loss is a difference of areas: its rounding is that of one
    np.testing.assert_allclose(found["lost_to_bonds_mean"], 1.0 - area[1] / area[0], rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(found["lost_to_fluctuations_mean"], 0.0)


def test_fluctuations_alone_take_all_of_adhesion_when_they_mask_it():
    masking = shear.Mean(spectrum=Band(rms=1e6, longest=60e-6, shortest=24e-6))
    found = analysis.shares(run(scene(adhesion=Adhesion(work=WORK, bond_share=0.0), shear=masking)))
    hertz, full = jkr.hertz_radius_at_load(LOAD, RADIUS, MODULUS), jkr.radius_at_load(LOAD, WORK, RADIUS, MODULUS)
    np.testing.assert_allclose(found["lost_to_bonds_mean"], 0.0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found["lost_to_fluctuations_mean"], 1.0 - (hertz / full) ** 2, rtol=1e-13)
    np.testing.assert_allclose(found["area_ratio_hertz"], (hertz / full) ** 2, rtol=1e-13)
    np.testing.assert_allclose([found["radius_jkr"], found["radius_hertz"]], [full, hertz], rtol=1e-13)


def test_standard_error_of_a_share_is_that_of_its_members(ramp):
    found, lost = analysis.shares(ramp), analysis.share_observables(ramp)["lost_to_fluctuations"].to_numpy()
    np.testing.assert_allclose(found["lost_to_fluctuations_sem"], lost.std(axis=0, ddof=1) / math.sqrt(6), rtol=1e-10)
    # a mean-field population does not fluctuate: nothing but rounding is left
    np.testing.assert_allclose(found["lost_to_bonds_sem"], 0.0, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("contact", "sweep"),
    [
        (Equilibrium(load=LOAD), {"contact.load": [1e-3, 1.6e-2]}),
        (Equilibrium(indentation=1e-6), {"contact.indentation": [1e-6, 4e-6]}),
        (Equilibrium(load=LOAD), [{"sphere.radius": 1e-3, "contact.load": 1e-3},
                                  {"sphere.radius": 4e-3, "contact.load": 8e-3}]),
        (Equilibrium(load=LOAD), {"adhesion.work": [2e-2, 8e-2], "adhesion.bond_share": [0.3, 1.0]}),
    ],
    ids=["load", "indentation", "zipped", "product"],
)  # fmt: skip
def test_shares_of_a_sweep_are_those_of_its_points(contact, sweep):
    swept = scene(contact=contact, sweep=sweep)
    together = analysis.shares(run(swept))
    for k, point in enumerate(swept.points()):
        alone, dims = analysis.shares(run(point)), together["radius_jkr"].dims
        where = dict(zip(dims, np.unravel_index(k, [together.sizes[name] for name in dims]), strict=True))
        for name in ("lost_to_bonds_mean", "lost_to_fluctuations_mean", "lost_to_fluctuations_sem", "radius_jkr"):
            np.testing.assert_array_equal(together[name].isel(where), alone[name])


def test_a_contact_that_its_bonds_let_go_stays_their_loss():
    """Pulled at half of its pull-off load, run up and stopped: it stays open though its bonds heal."""
    there_and_back = drive.Table(time=(0.0, 0.2, 0.4), speed=(0.0, 0.1, 0.0))
    lifted = Equilibrium(load=0.5 * float(jkr.pull_off_load(WORK, RADIUS)))
    dataset = run(scene(contact=lifted, drive=there_and_back, shear=shear.Uniform()))
    assert dataset["in_contact"].to_numpy()[[0, -1]].tolist() == [1, 0]
    assert float(dataset["bond_fraction"].min()) < 0.5 < float(dataset["bond_fraction"][-1])
    found = analysis.shares(dataset)
    np.testing.assert_array_equal(found["lost_to_fluctuations_mean"], 0.0)
    assert float(found["lost_to_bonds_mean"][-1]) == 1.0
    assert float(analysis.statistics(dataset)["fraction_detached_mean"][-1]) == 1.0


def test_shares_are_unknown_where_there_is_no_contact_at_rest():
    lifted = Equilibrium(load=1.5 * float(jkr.pull_off_load(WORK, RADIUS)))
    found = analysis.shares(run(scene(contact=lifted, shear=shear.Uniform())))
    assert bool(found["lost_to_bonds_mean"].isnull().all()) and math.isnan(found["area_ratio_hertz"])


def test_shares_that_cannot_be_told_name_the_cure():
    few = scene(bonds=bonds.Counted(critical_speed=1e-2, healing=500.0, sites=100), record=Record(per_member=False))
    with pytest.raises(ValueError, match="per_member = true"):
        analysis.shares(run(few))
    controls = {"contact": [{"model": "equilibrium", "load": 1e-3}, {"model": "equilibrium", "indentation": 1e-6}]}
    dataset = run(scene(sweep=controls))
    with pytest.raises(ValueError, match=r"neither contact.load nor contact.indentation.*sweep its number"):
        analysis.shares(dataset)
    assert len(analysis.table(dataset)) == 12  # the rest can be told


def test_a_setting_is_found_whether_it_is_swept_or_not():
    dataset = run(scene(sweep={"contact.load": [1e-3, 4e-3]}, shear=shear.Uniform()))
    assert analysis.setting(dataset, "contact.load").to_numpy().tolist() == [1e-3, 4e-3]
    assert float(analysis.setting(dataset, "sphere.radius")) == RADIUS
    with pytest.raises(KeyError, match=r"contact\.indentation"):
        analysis.setting(dataset, "contact.indentation")


# -- correlation time -------------------------------------------------------------------------


def squared_ornstein_uhlenbeck(rng, members, records, keep, pairs=5):
    """Energies of modes whose amplitudes keep a share from record to record: correlation keep^(2 lag)."""
    weights = 1.0 / np.arange(1.0, pairs + 1.0)
    state, energy = rng.normal(size=(members, pairs, 2)), np.empty((members, records))
    for k in range(records):
        if k:
            state = keep * state + math.sqrt(1.0 - keep**2) * rng.normal(size=state.shape)
        energy[:, k] = np.einsum("mpc,p->m", state**2, weights)
    return energy


def exact_time(keep, step):
    """Trapezoidal integral of keep^(2 lag)."""
    return step * 0.5 * (1.0 + keep**2) / (1.0 - keep**2)


@pytest.mark.parametrize(
    ("members", "records", "keep"), [(1, 8000, 0.9), (2, 4000, 0.9), (64, 400, 0.8), (16384, 60, 0.8)]
)
def test_correlation_time_is_within_five_of_its_standard_errors(members, records, keep):
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(7), members, records, keep)
    time, sem = analysis.integral_time(energy, step=0.01)
    assert abs(time - exact_time(keep, 0.01)) < 5.0 * sem
    assert sem < 0.3 * time


def test_two_members_tell_as_much_as_their_difference():
    difference = squared_ornstein_uhlenbeck(np.random.default_rng(9), 1, 2000, 0.8)[0]
    difference -= difference.mean()
    shared = np.random.default_rng(10).normal(size=2000)
    pair = np.stack([shared + difference / 2.0, shared - difference / 2.0])
    alone = analysis.integral_time(difference[np.newaxis], 1.0)
    np.testing.assert_allclose(analysis.integral_time(pair, 1.0), alone, rtol=1e-9)


def test_correlation_time_does_not_see_a_drift_that_members_share():
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(8), 64, 400, 0.8)
    drift = np.linspace(0.0, 100.0, 400)
    np.testing.assert_allclose(
        analysis.integral_time(energy + drift, 1.0), analysis.integral_time(energy, 1.0), rtol=1e-9
    )


@pytest.mark.parametrize(
    "energy",
    [
        np.ones((4, 100)),
        np.full((4, 100), 0.1) * (1.0 + 1e-14 * np.random.default_rng(1).normal(size=(4, 100))),
        np.ones((4, 100)) * np.arange(1.0, 5.0)[:, None],
        np.random.default_rng(2).normal(size=(64, 1000)),
        np.ones((4, 1)),
        np.full((4, 100), math.nan),
    ],
    ids=["constant", "rounding", "frozen", "white", "one record", "nan"],
)
def test_there_is_no_correlation_time_where_nothing_decays_visibly(energy):
    assert all(math.isnan(number) for number in analysis.integral_time(energy, 0.1))


def test_a_run_shorter_than_its_memory_has_no_correlation_time():
    energy = squared_ornstein_uhlenbeck(np.random.default_rng(3), 256, 20, 0.99)
    assert math.isnan(analysis.integral_time(energy, 1.0).time)


def test_energy_forgets_twice_as_fast_as_its_amplitudes():
    """Amplitudes forget over the memory time, energies over half of it."""
    field = shear.Modal(memory=Time(time=0.02), **FIELD)
    steady = scene(drive=drive.Steady(speed=1e-3), shear=field, clock=Clock(duration=0.4, step=0.001),
                   ensemble=Ensemble(members=128))  # fmt: skip
    found = analysis.statistics(run(steady))
    # the trapezoidal sum over steps of a tenth of the time adds 1/1200, far below the error
    assert abs(float(found["correlation_time"]) - 0.01) < 5.0 * float(found["correlation_time_sem"])
    assert float(found["correlation_time_sem"]) < 1e-3


def test_a_ramp_has_no_correlation_time(ramp):
    assert math.isnan(analysis.correlation_time(ramp)["correlation_time"])


@pytest.mark.verify
def test_scores_of_the_correlation_time_are_standard_normal():
    scores = []
    for seed in range(300):
        energy = squared_ornstein_uhlenbeck(np.random.default_rng(seed), 16, 500, 0.9)
        time, sem = analysis.integral_time(energy, 1.0)
        scores.append((time - exact_time(0.9, 1.0)) / sem)
    # the window cuts e^-6 off and the error is Gaussian theory: mean and spread to a third of a unit
    assert abs(np.mean(scores)) < 0.33 and 0.67 < np.std(scores) < 1.33


# -- for readers ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (1.203e-4, "m", "120.3 µm"),
        (42e-3, "J/m^2", "42 mJ/m²"),
        (4.55e-8, "m^2", "0.0455 mm²"),
        (3.1e-16, "m^2", "310 nm²"),
        (-1.5e-7, "N", "-150 nN"),
        (1.6e6, "Pa", "1.6 MPa"),
        (999.96e-6, "m", "1 mm"),
        (0.0, "m/s", "0 m/s"),
        (math.nan, "N", "nan N"),
        (0.25, "1", "0.25"),
        (1e5, "rad/m", "1e+05 rad/m"),
        (500.0, "1/s", "500 1/s"),
    ],
)
def test_a_number_is_told_in_the_prefix_that_suits_it(value, unit, text):
    assert analysis.engineering(value, unit) == text


@pytest.mark.parametrize("unit", ["m", "m/s", "J/m^2", "m^2", "N", "Pa"])
@pytest.mark.parametrize("exponent", range(-14, 12))
def test_told_numbers_read_back_to_what_they_were(unit, exponent):
    text = analysis.engineering(3.25 * 10.0**exponent, unit)
    read = Quantity(unit, "number").read(text.replace("²", "^2"))
    np.testing.assert_allclose(read, 3.25 * 10.0**exponent, rtol=1e-12)


@pytest.mark.parametrize(
    ("mean", "sem", "text"),
    [
        (118.2312, 0.0423, "118.23(4)"),
        (0.5, 0.013, "0.500(13)"),
        (-0.3, 3.0, "0(3)"),
        (1234.0, 56.0, "1230(60)"),
        (12.5, 0.0, "12.5"),
        (12.5, math.nan, "12.5"),
        (math.nan, math.nan, "–"),
        (9.999, 0.0999, "10.00(10)"),
        (120.27993, 0.00013, "120.28(0)"),
        (0.0, 0.00013, "0.00000(13)"),
        (123456.0, 0.4, "123460(0)"),
    ],
)
def test_a_mean_carries_its_standard_error_in_brackets(mean, sem, text):
    assert analysis.concise(mean, sem) == text


def test_table_of_a_ramp_has_a_dozen_rows_from_start_to_end(ramp):
    rows, found = analysis.table(ramp), analysis.statistics(ramp)
    assert len(rows) == 12 and all(set(row) == set(rows[0]) for row in rows)
    assert [rows[0]["t\n(ms)"], rows[-1]["t\n(ms)"]] == ["0", "400"]
    for row, at in ((rows[0], 0), (rows[-1], -1)):
        mean = float(re.match(r"[\d.]+", row["a\n(µm)"])[0])
        # half a unit of the fourth digit, the least that is shown
        np.testing.assert_allclose(mean, 1e6 * float(found["contact_radius_mean"][at]), rtol=5e-4)
    assert "masked\n(%)" in rows[0] and "open\n(%)" not in rows[0]
    assert "lost to\nbonds (%)" in rows[0] and "lost to\nfluct. (%)" in rows[0]


def test_table_leaves_out_what_tells_nothing():
    rows = analysis.table(run(scene(bonds=bonds.Unbroken(), shear=shear.Uniform())), rows=5)
    assert len(rows) == 5
    assert list(rows[0]) == ["t\n(ms)", "V\n(mm/s)", "w\n(mJ/m²)", "a\n(µm)", "A/A_JKR\n(%)"]


@pytest.mark.parametrize(("loads", "shares", "rows"), [(2, 1, 2), (5, 1, 5), (30, 1, 12), (3, 2, 6), (6, 5, 12)])
def test_table_of_a_steady_sweep_has_a_row_for_each_point(loads, shares, rows):
    sweep = {
        "contact.load": list(np.linspace(1e-3, 9e-3, loads)),
        "adhesion.bond_share": list(np.linspace(0, 1, shares)),
    }
    dataset = run(scene(drive=drive.Steady(speed=1e-2), shear=shear.Uniform(), sweep=sweep))
    table = analysis.table(dataset)
    assert len(table) == rows
    assert [row["load\n(mN)"] for row in (table[0], table[-1])] == ["1", "9"]
    assert not any(heading.startswith("t\n") for heading in table[0])


def test_table_of_a_swept_ramp_shows_each_point_in_time():
    rows = analysis.table(run(scene(sweep={"contact.load": ["1 mN", "4 mN"]}, shear=shear.Uniform())))
    points = [(row["load\n(mN)"], row["t\n(ms)"]) for row in rows]
    assert points == list(itertools.product(["1", "4"], ["0", "80", "160", "240", "320", "400"]))


def test_table_tells_a_swept_table_by_its_name():
    ripple = {"model": "ripple", "amplitude": 1e5, "wavelength": 24e-6}
    fields = {"shear": [{"model": "uniform"}, {"model": "mean", "spectrum": ripple}]}
    rows = analysis.table(run(scene(drive=drive.Steady(speed=1e-2), sweep=fields)))
    assert [row["shear"] for row in rows] == ["uniform", "mean"]


def test_csv_reads_back_as_the_statistics(ramp, tmp_path):
    analysis.to_csv(ramp, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    wanted = {
        "t": Quantity("s", "time"),
        "contact_radius_mean": Quantity("m", "radius"),
        "contact_radius_sem": Quantity("m", "its error"),
        "contact_radius_q95": Quantity("m", "95 % quantile"),
        "lost_to_fluctuations_mean": Quantity("1", "share"),
    }
    read, found = columns(text, wanted), analysis.statistics(ramp)
    np.testing.assert_array_equal(read["t"], ramp["t"])
    np.testing.assert_array_equal(read["contact_radius_mean"], found["contact_radius_mean"])
    np.testing.assert_array_equal(read["contact_radius_sem"], found["contact_radius_sem"])
    np.testing.assert_array_equal(read["contact_radius_q95"], found["contact_radius_quantile"].sel(quantile=0.95))
    np.testing.assert_array_equal(read["lost_to_fluctuations_mean"], analysis.shares(ramp)["lost_to_fluctuations_mean"])
    first = text.splitlines()[0]
    assert first.startswith("# sliding contact; sliding-sim ") and first.endswith("seed 2003")


def test_csv_has_a_row_for_each_point_and_time(tmp_path):
    sweep = {"contact.load": [1e-3, 4e-3], "adhesion.bond_share": [0.0, 0.5, 1.0]}
    dataset = run(scene(sweep=sweep, shear=shear.Uniform()))
    analysis.to_csv(dataset, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    wanted = {"load": Quantity("N", "load"), "bond_share": Quantity("1", "share"), "t": Quantity("s", "time")}
    read = columns(text, {**wanted, "contact_area_mean": Quantity("m^2", "area")})
    expected = itertools.product([1e-3, 4e-3], [0.0, 0.5, 1.0], dataset["t"].to_numpy())
    assert list(zip(*(read[name].tolist() for name in wanted), strict=True)) == list(expected)
    np.testing.assert_array_equal(read["contact_area_mean"], dataset["contact_area"].to_numpy().ravel())
