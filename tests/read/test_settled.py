"""Means that are means of something: settled or not, of closed contacts, with one standard error."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers.cases import some
from helpers.draws import ornstein_uhlenbeck
from helpers.lens import FIELD, scene
from helpers.parts import (
    Bell,
    Clock,
    Ensemble,
    Equilibrium,
    Record,
    Time,
    bonds,
    drive,
    read,
    run,
    shear,
)
from helpers.printed import rows_of
from helpers.statements import shares, statistics
from numpy.testing import assert_allclose

import sim
from sim.ensemble import plan as plans
from sim.parts.contact.models import Adhesion
from sim.read.late import settlements
from sim.read.observables import closed_only
from sim.read.peaks import peak_of_mean
from tests.read.test_invariance import SCENES

ENSEMBLES, LEAST, MOST = 1000, 0.92, 0.98
TIME = np.linspace(0.0, 1.0, 400)


def settlement(values, sem=math.nan, freedom=math.nan, noisy=True):
    return settlements(
        values[np.newaxis], *(np.array([number]) for number in (sem, freedom, noisy))
    ).at(0)


def series(rng, members, times):
    """Gaussian series of five records a correlation time."""
    return ornstein_uhlenbeck(rng, (ENSEMBLES, members, 5 * times), math.exp(-0.2))


@pytest.mark.parametrize(
    ("members", "times"), some([(2, 5), (4, 2), (6, 20), (40, 5)], (2, 5), (4, 2))
)
def test_settled_series_are_so_in_99_of_100_cases_and_their_intervals_hold_while_a_drift_is_seen(
    members, times
):
    values = series(np.random.default_rng(31), members, times)
    results = [read.over_time(each) for each in values]
    means, lows, highs, errors = (
        np.array([each[k] for each in results]) for k in ("value", "low", "high", "sem")
    )
    free = math.nan if members < 4 else members - 1.0
    settled = np.array(
        [
            settlement(*each, free).verdict == ""
            for each in zip(values, errors, strict=True)
        ]
    )
    assert 0.98 < settled.mean() < 1.0
    assert LEAST < np.mean((lows <= 0.0) & (highs >= 0.0), where=settled) < MOST
    # the error is that of the members' means, however they are recorded
    if members >= 4:
        assert_allclose(
            errors,
            values.mean(axis=-1).std(axis=1, ddof=1) / math.sqrt(members),
            rtol=1e-12,
        )
    # a drift that all members share: ten errors of the ensemble's drift are seen by four members and more
    drift = 10.0 * 2.0 * np.std(means) * np.linspace(-1.0, 1.0, values.shape[-1])
    drifting = [settlement(each + drift, np.nan).verdict for each in values[:100]]
    assert members == 2 or drifting.count("not settled") > 90


def test_a_run_without_noise_settles_to_the_end_or_to_whole_cycles_without_an_error():
    relaxing = settlement(
        153.5e-6 - 40e-6 * np.exp(-3.0 * TIME)[np.newaxis], noisy=False
    )
    assert (
        relaxing.reason("m/s", "the second half")
        == "not settled: 113.5 → 151.5 µm/s over the second half"
    )
    assert_allclose(relaxing.value, 153.5e-6 - 40e-6 * math.exp(-3.0), rtol=1e-12)
    assert settlement(1.0 + 0.5e-3 * TIME[np.newaxis], noisy=False)[:4] == (
        "",
        1.0005,
        1.0,
        1.0005,
    )
    assert settlement(np.zeros((1, 5)), noisy=False).verdict == ""
    # a saw-tooth of 11.3 cycles has the mean of a whole one, to half a record of its ends
    saw = (11.3 * TIME) % 1.0
    cycle = settlement(saw[np.newaxis], noisy=False)
    assert cycle.verdict == "" and abs(cycle.value - 0.5) < 11.3 / 400 / 11
    assert settlement((saw + TIME)[np.newaxis], noisy=False).verdict != ""
    assert settlement(((2.3 * TIME) % 1.0)[np.newaxis], noisy=False).verdict.startswith(
        "too short"
    )
    # three of forty come off, one by one
    opens = np.where(np.arange(40) < 3, 20 + 10 * np.arange(40), 1000)
    assert (
        settlement((np.arange(60) >= opens[:, None]).astype(float)).verdict
        == "not settled"
    )
    one = settlement(np.random.default_rng(3).normal(size=(1, 5)).cumsum()[np.newaxis])
    assert one.verdict.startswith("too short")


PULLED = SCENES["lives"] | {
    "clock": Clock(duration=0.6, step=2e-3),
    "shear": shear.Uniform(),
}
FLUCTUATING = {
    "clock": Clock(duration=0.4, step=4e-3),
    "drive": drive.Steady(speed=4e-3),
    "shear": shear.Modal(correlation=Time(time=0.01), **FIELD),
    "sweep": {"contact.load": [1e-3, 4e-3]},
}


@pytest.mark.parametrize(
    "parts", [PULLED, FLUCTUATING], ids=["contacts come off", "a sweep"]
)
def test_a_mean_has_one_error_with_and_without_members_and_in_any_division_into_blocks(
    parts, monkeypatch
):
    each = run(scene(**parts))
    expected = read.distribution(each)
    # blocks that end within the second half
    monkeypatch.setattr(plans, "_BLOCK_SECONDS", 2e-3)
    monkeypatch.setattr(plans, "_GROUP", 5)
    pooled = read.distribution(run(scene(**parts, record=Record(per_member=False))))
    for name in (
        "contact_area",
        "area_ratio",
        "work_of_adhesion",
        "fraction_detached",
        "bond_fraction",
    ):
        for kind in ("value", "sem", "low", "high"):
            assert_allclose(
                getattr(pooled[name], kind),
                getattr(expected[name], kind),
                rtol=1e-6,
                err_msg=name,
            )
        xr.testing.assert_equal(pooled[name].reason, expected[name].reason)
    # by hand: each member's mean while it is closed
    late = each.isel(t=slice(each.sizes["t"] // 2, None))
    means = late["contact_area"].where(late["in_contact"] > 0).mean("t")
    assert_allclose(expected["contact_area"].value, means.mean("member"), rtol=1e-12)
    error = means.std("member", ddof=1) / np.sqrt(means.count("member"))
    assert_allclose(expected["contact_area"].sem, error, rtol=1e-10)


def test_contacts_that_come_off_lose_no_area_to_bonds_and_too_few_or_those_that_close_again_have_no_mean():
    dataset = run(scene(**PULLED))
    result = read.distribution(dataset)
    gone = dataset["in_contact"].to_numpy() == 0
    assert 10 < gone[:, -1].sum() < 35
    assert result["fraction_detached"].reason.item().startswith("not settled")
    assert abs(result["lost_to_bonds"].value - 1.0 + result["area_ratio"].value) < 1e-12
    # as the bonds are all there on average, closed contacts have nearly JKR's area
    assert (
        abs(result["area_ratio"].value - 1.0) < 0.1
        and 0.0 < result["area_ratio"].sem < 0.05
    )
    assert_allclose(
        shares(dataset)["lost_to_bonds"].value
        + statistics(closed_only(dataset))["area_ratio"].value,
        1.0,
    )
    lasting = np.flatnonzero(~gone[:, -1])[:2]
    few = dataset.isel(member=[*lasting, *np.flatnonzero(gone[:, -1])])
    result = read.distribution(few)
    reason = (
        f"2 of {few.sizes['member']} contacts are closed at the end of the second half"
    )
    assert result["contact_area"].reason == reason and math.isnan(
        result["contact_area"].value
    )
    again = dataset["in_contact"].copy()
    again[0, 200], again[0, 201:] = 0, 1
    result = read.distribution(dataset.assign(in_contact=again))
    assert (
        result["friction_force"].reason
        == "1 of 40 contacts close again in the second half"
    )


def test_a_peak_of_noisy_members_is_that_of_their_mean_or_none_and_its_intervals_hold():
    rng, times, at, records = np.random.default_rng(33), np.arange(150.0), 20.0, 150
    mean = 1.0 + 2.0 * times / at * np.exp(1.0 - times / at)
    noise = series(rng, 1, records // 5)[:, 0]  # a thousand members
    peaks, calm = [], []
    for _ in range(200):
        members = 0.8 * noise[rng.integers(ENSEMBLES, size=40)]
        peaks.append(peak_of_mean(mean + members, times))
        calm.append(peak_of_mean(1.0 + members, times).reason)
    assert 179 <= sum(peak.low <= 3.0 <= peak.high for peak in peaks) <= 200
    assert 179 <= sum(peak.first <= at <= peak.last for peak in peaks) <= 200
    assert sum(reason.startswith("no peak is certain") for reason in calm) >= 190
    sparse = peak_of_mean((mean + members)[:, ::15], times[::15])
    assert sparse.reason.startswith(
        "too few records to resolve the peak"
    ) and math.isnan(sparse.value)
    exact = peak_of_mean(np.tile(mean, (5, 1)), times)
    assert_allclose([exact.value, exact.time, exact.sem], [3.0, at, 0.0], rtol=1e-12)


def test_a_wide_peak_late_in_a_run_is_found():
    times, rng = np.arange(160.0), np.random.default_rng(5)
    noise = rng.normal(size=(40, 1)) * np.cos(times / 40.0 + rng.uniform(0, 6, (40, 1)))
    mean = 4.0 - ((times - 110.0) / 60.0) ** 2
    peak = peak_of_mean(mean + 0.1 * noise, times)
    assert peak.low <= 4.0 <= peak.high and peak.first <= 110.0 <= peak.last


def test_the_peak_after_a_rest_does_not_grow_with_the_time_of_sliding():
    start = drive.Start(rest=0.1, speed=3e-6)
    parts = {
        "drive": start,
        "bonds": bonds.Tracked(
            sites=20,
            rupture=Bell(zero_force_rate=10.0, bell_force=4e-12),
            bond_stiffness=0.4e-3,
            rebinding_rate=10.0,
            site_density=1e16,
            start_from="empty",
        ),
        "shear": shear.Uniform(),
        "ensemble": Ensemble(members=40),
        "adhesion": Adhesion(work=42e-3, bond_share=0.0),
    }
    clocks = (Clock(duration=duration, step=1e-3) for duration in (0.3, 1.0))
    results = [
        read.Run(run(scene(**parts, clock=clock))).statements() for clock in clocks
    ]
    for name in ("peak_stress", "peak_friction", "peak_time", "peak_friction_time"):
        assert_allclose(*(result[name].value for result in results), rtol=1e-6)
    # bond by bond, in 400 ensembles of another code: 32.1 kPa
    peak = results[0]["peak_stress"]
    assert peak.low < 32.1e3 < peak.high and peak.reason == ""


@pytest.mark.parametrize("members", [1, 2, 6])
def test_a_difference_along_a_sweep_has_the_error_of_the_members_differences(members):
    loads = {"contact.load": [4e-3, 4.2e-3]}
    dataset = run(
        scene(
            **FLUCTUATING
            | {
                "sweep": loads,
                "clock": Clock(duration=4.0, step=4e-3),
                "ensemble": Ensemble(members=members),
            }
        )
    )
    alone, change = (
        read.distribution(dataset),
        read.distribution(dataset, minus={"contact.load": 4e-3}),
    )
    area, late = (of["contact_area"].value for of in (change, alone))
    assert_allclose(area[1], late[1] - late[0], rtol=1e-9)
    assert area[0] == 0.0 and change["contact_area"].reason[1] == ""
    apart = math.hypot(*alone["contact_area"].sem)
    assert 0.0 < change["contact_area"].sem[1] < 0.3 * apart
    if members > 2:
        each = (
            dataset["contact_area"]
            .isel(t=slice(dataset.sizes["t"] // 2, None))
            .mean("t")
            .diff("contact_load")
        )
        error = each.std("member", ddof=1).item() / math.sqrt(members)
        assert_allclose(change["contact_area"].sem[1], error, rtol=1e-9)


def test_joined_runs_are_described_as_what_they_are(tmp_path):
    parts = {key: value for key, value in FLUCTUATING.items() if key != "sweep"}
    several = [
        run(scene(**parts, contact=Equilibrium(load=load))) for load in (1e-3, 4e-3)
    ]
    joined = xr.concat(
        [each.set_coords("contact_load") for each in several],
        "contact_load",
        data_vars="all",
    )
    joined.to_netcdf(tmp_path / "loads.nc")
    swept = run(scene(**FLUCTUATING))
    with sim.open(tmp_path / "loads.nc") as dataset:
        assert dataset.attrs["joined"] == "joined along contact_load"
        assert rows_of(dataset) == rows_of(swept)
    seeds = [run(scene(**parts, seed=seed)) for seed in (1, 2)]
    how = {"data_vars": "minimal", "coords": "minimal", "compat": "override"}
    both = xr.concat(seeds, "member", **how)
    both.to_netcdf(tmp_path / "seeds.nc")
    with sim.open(tmp_path / "seeds.nc") as dataset:
        assert (
            dataset.attrs["members"] == 12
            and dataset.attrs["joined"] == "12 members joined, 6 of one run"
        )
        error = read.distribution(dataset)["contact_area"].sem
        halves = (
            both["contact_area"].isel(t=slice(dataset.sizes["t"] // 2, None)).mean("t")
        )
        assert_allclose(
            error, halves.std("member", ddof=1) / math.sqrt(12.0), rtol=1e-10
        )
    run(scene(**parts), to=tmp_path / "one.nc")
    with sim.open(tmp_path / "one.nc") as dataset:
        assert "joined" not in dataset.attrs


def test_two_records_one_of_which_is_the_start_have_no_mean_but_the_value_at_the_end():
    parts = {"drive": drive.Steady(speed=4e-3), "ensemble": Ensemble(members=20)}
    dataset = run(scene(**parts, clock=Clock(0.8, 2e-3)))
    ends = read.distribution(dataset.isel(t=[0, -1]))
    for name in ("contact_area", "friction_force"):
        assert_allclose(ends[name].value, dataset[name].isel(t=-1).mean(), rtol=1e-12)
        assert math.isnan(ends[name].sem) and ends[name].reason.item().startswith(
            "too few records"
        )
    assert read.distribution(dataset.isel(t=[0, 10, -1]))["contact_area"].reason == ""
    pooled = read.distribution(
        run(
            scene(
                **parts,
                record=Record(per_member=False),
                clock=Clock(0.8, 2e-3, record=0.8),
            )
        )
    )
    assert_allclose(
        pooled["contact_area"].value,
        dataset["contact_area"].isel(t=-1).mean(),
        rtol=1e-12,
    )
    assert pooled["contact_area"].reason.item().startswith(
        "too few records"
    ) and math.isnan(pooled["contact_area"].sem)
