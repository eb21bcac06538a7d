"""Statistics: exact on numbers known beforehand, consistent with the laws on real runs."""

import math
import shutil

import netCDF4
import numpy as np
import pytest
import xarray as xr
from helpers.lens import FIELD, RADIUS, scene
from helpers.parts import (
    Band,
    Clock,
    Ensemble,
    Equilibrium,
    RateDependent,
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
from sim.parts.drive import Steady
from sim.read import dataset as dataset_module
from sim.read.dataset import lacking, word


@pytest.fixture(scope="module")
def known(ramp):
    """Five members whose work of adhesion is 1 ... 5 times the time, closed in four, masked in one."""
    five = ramp.isel(member=slice(0, 5))
    numbers = np.arange(1.0, 6.0)[:, None] * five["t"].to_numpy()
    numbers[0] -= 10.0
    closed = np.ones(numbers.shape, "i1")
    closed[4] = 0
    dims = ("member", "t")
    masked = (dims, ((numbers <= 0.0) & (closed == 1)).astype(float))
    return five.assign(
        work_of_adhesion=(dims, numbers, ramp["work_of_adhesion"].attrs),
        in_contact=(dims, closed),
        masked=masked,
    )


@pytest.mark.verify  # dask comes with its extra
def test_runs_joined_as_the_page_says_have_the_table_of_a_sweep(tmp_path):
    parts = {"drive": Steady(speed=1e-2), "record": Record(quantities=["contact_area"])}
    loads = [
        run(scene(contact=Equilibrium(load=load), **parts), to=tmp_path / f"{load}.nc")
        for load in (2e-3, 4e-3)
    ]
    key = {
        "concat_dim": "contact_load",
        "preprocess": lambda dataset: dataset.set_coords("contact_load"),
    }
    with xr.open_mfdataset(loads, combine="nested", **key) as runs:
        swept = run(scene(sweep={"contact.load": [2e-3, 4e-3]}, **parts))
        assert rows_of(runs) == rows_of(swept)


def test_statistics_of_known_numbers_few_members_and_missing_values(known, ramp):
    result, t = statistics(known), known["t"].to_numpy()
    sorted_numbers = np.stack([t - 10.0, 2.0 * t, 3.0 * t, 4.0 * t, 5.0 * t])
    mean = 3.0 * t - 2.0
    deviation = np.sqrt(np.sum((sorted_numbers - mean) ** 2, axis=0) / 4.0)
    assert_allclose(result["work_of_adhesion"].value, mean, rtol=1e-14)
    assert_allclose(result["work_of_adhesion"].std, deviation, rtol=1e-13)
    assert_allclose(
        result["work_of_adhesion"].sem, deviation / math.sqrt(5.0), rtol=1e-13
    )
    # five sorted numbers: the 5 % quantile lies a fifth of the way from the first to the second
    fifth = 0.8 * sorted_numbers[0] + 0.2 * sorted_numbers[1]
    assert_allclose(
        result["work_of_adhesion"].quantile.sel(quantile=0.05), fifth, rtol=1e-13
    )
    assert_allclose(
        result["work_of_adhesion"].quantile.sel(quantile=0.5), 3.0 * t, rtol=1e-13
    )
    assert result["work_of_adhesion"].value.attrs["units"] == "J/m^2"
    result = statistics(known)
    assert_allclose(result["fraction_detached"].value, 0.2, rtol=1e-14)
    assert_allclose(
        result["fraction_detached"].sem, math.sqrt(0.2 * 0.8 / 4.0), rtol=1e-14
    )
    # member 0 has no work left, at t = 0 all four that are closed have none
    assert_allclose(
        result["fraction_masked"].value,
        [1.0] + [0.25] * (known.sizes["t"] - 1),
        rtol=1e-14,
    )
    assert_allclose(
        result["fraction_masked"].sem[1:], math.sqrt(0.25 * 0.75 / 3.0), rtol=1e-14
    )
    result = statistics(ramp)
    np.testing.assert_array_equal(result["speed"].value, ramp["speed"])
    assert np.all(result["speed"].sem == 0.0)
    assert np.all(result["speed"].quantile.sel(quantile=0.95) == ramp["speed"])
    result = statistics(ramp.isel(member=[0]))
    np.testing.assert_array_equal(
        result["contact_radius"].value, ramp["contact_radius"][0]
    )
    assert bool(result["contact_radius"].sem.isnull().all())
    np.testing.assert_array_equal(
        result["contact_radius"].quantile.sel(quantile=0.05), ramp["contact_radius"][0]
    )
    depth = ramp["indentation"].copy()
    depth[0] = math.nan
    result = statistics(ramp.assign(indentation=depth))
    rest = statistics(ramp.isel(member=slice(1, None)))
    for kind in ("value", "std", "sem", "quantile"):
        of_all, of_rest = (getattr(of["indentation"], kind) for of in (result, rest))
        assert_allclose(of_all, of_rest, rtol=1e-12)
    depth[:, :3] = math.nan
    none = statistics(ramp.assign(indentation=depth))
    assert bool(none["indentation"].value[:3].isnull().all()) and bool(
        none["indentation"].value[3:].notnull().all()
    )
    dims = ("member", "t")
    levels = np.array([1.0, 2.0, 4.0, 4.0, 5.0, 8.0])[:, None] * np.ones(
        ramp.sizes["t"]
    )
    levels[:, : ramp.sizes["t"] // 2] = 1e9  # a start-up that must not count
    members = xr.Dataset({"level": (dims, levels)}, {"t": ramp["t"]})
    result = read.summary(read.settled(members))
    assert result["level"].value.dims == ("t",) and result["level"].value.size == 1
    assert_allclose(result["level"].value, 4.0, rtol=1e-14)
    assert_allclose(result["level"].sem, math.sqrt(30.0 / 5.0 / 6.0), rtol=1e-14)


def are_identical(group, other):
    """Assert that all statistics of two groups are the same numbers."""
    assert group.keys() == other.keys()
    for name, one in group.items():
        for values, expected in zip(one, other[name], strict=True):
            assert (values is None) is (expected is None)
            if values is not None:
                xr.testing.assert_identical(values, expected)


@pytest.mark.parametrize("rule", ["stop", "stay_open", "reattach"])
def test_a_masked_share_is_that_of_closed_contacts_and_missing_without_any(rule):
    """A lagging edge bears a tension for a while in a masked contact, which an equilibrium contact cannot."""
    load = {"time": [0.0, 0.1, 0.1, 0.4], "value": [1e-3, 1e-3, -5e-4, -5e-4]}
    edge = {"front_speed": 5e-5, "front_exponent": 0.5}
    waves = FIELD | {"spectrum": Band(rms=2e5, longest=60e-6, shortest=24e-6)}
    members, recorded = (
        run(
            scene(
                clock=Clock(duration=0.4, step=2e-3),
                contact=RateDependent(load=load, after_pull_off=rule, **edge),
                shear=shear.Modal(correlation=Time(time=0.05), **waves),
                drive=Steady(speed=1e-2),
                record=Record(per_member=per_member),
                ensemble=Ensemble(members=20),
            )
        )
        for per_member in (True, False)
    )
    flags, closed = (members[name] for name in ("masked", "in_contact"))
    xr.testing.assert_equal(flags.isnull(), closed == 0)
    count = closed.sum("member")
    assert bool((count == 0).any()) and bool((count == 20).any())
    expected = (flags == 1.0).sum("member") / count.where(count > 0)
    spread = (expected * (1.0 - expected) / (count - 1.0).where(count > 1)) ** 0.5
    some = (count > 0) & (count < 20)
    assert bool(((expected > 0.0) & some).any())
    for dataset in (members, recorded):
        result = statistics(dataset)["fraction_masked"]
        assert_allclose(result.value, expected, rtol=1e-12)
        assert_allclose(result.sem, spread, rtol=1e-12)


def test_recorded_statistics_and_those_of_files_and_pieces_are_those_of_the_members(
    ramp, tmp_path, monkeypatch
):
    result, recorded = (
        statistics(ramp),
        statistics(run(scene(record=Record(per_member=False)))),
    )
    for name in (
        "contact_radius",
        "fluctuation_energy",
        "fraction_detached",
        "fraction_masked",
        "area_ratio",
    ):
        for kind in ("value", "std", "sem"):
            # deviations cancel: what is left is rounding of the mean
            rounding = 1e-14 * float(np.max(np.abs(result[name].value)))
            assert_allclose(
                getattr(recorded[name], kind),
                getattr(result[name], kind),
                rtol=1e-12,
                atol=rounding,
            )
    assert recorded["contact_radius"].quantile is None
    pooled, each = (
        shares(run(scene(record=Record(per_member=False)))),
        shares(ramp),
    )
    for kind in ("value", "sem"):
        both = (getattr(of["lost_to_fluctuations"], kind) for of in (pooled, each))
        assert_allclose(*both, rtol=1e-10, atol=1e-14)
    path = run(scene(), to=tmp_path / "out.nc")
    with xr.open_dataset(path) as opened:
        are_identical(statistics(opened), statistics(ramp))
    path = run(
        scene(record=Record(quantities=["friction_force", "masked"])),
        to=tmp_path / "some.nc",
    )
    cycles = run(
        scene(contact=Equilibrium(load={"from": 4e-3, "to": 1e-3, "cycles": 2}))
    )
    results = []
    for room in (2**27, 1000):
        monkeypatch.setattr(dataset_module, "ROOM", room)
        with xr.open_dataset(path) as opened:
            results.append((statistics(opened), read.loop_energy(cycles)))
    (whole, of_cycles), (pieces, of_pieces) = results
    are_identical(pieces, whole)
    xr.testing.assert_identical(of_pieces, of_cycles)


def test_words_and_settings_are_known_whether_swept_or_not_and_a_run_that_is_stationary():
    dataset = run(scene(sweep={"contact.load": [1e-3, 4e-3]}, shear=shear.Uniform()))
    assert read.setting(dataset, "contact.load").to_numpy().tolist() == [1e-3, 4e-3]
    assert float(read.setting(dataset, "sphere.radius")) == RADIUS
    with pytest.raises(KeyError, match=r"contact\.indentation"):
        read.setting(dataset, "contact.indentation")
    contact = Equilibrium(indentation={"from": 1e-6, "to": 2e-6})
    dataset = run(
        scene(
            contact=contact,
            shear=shear.Uniform(),
            sweep={"contact.after_pull_off": ["stop", "reattach"]},
        )
    )
    assert word(dataset, "contact.after_pull_off", "").to_numpy().tolist() == [
        "stop",
        "reattach",
    ]
    rows = [
        {"contact.after_pull_off": "reattach", "contact.load": load}
        for load in (1e-3, 2e-3)
    ]
    dataset = run(scene(shear=shear.Uniform(), sweep=rows))
    assert word(dataset, "contact.after_pull_off", "").to_numpy().tolist() == [
        "reattach",
        "reattach",
    ]
    drives = [
        {"model": "ramp", "from": 1e-5, "to": 1e-2},
        {"model": "start", "rest": 0.1, "speed": 1e-2},
    ]
    dataset = run(scene(shear=shear.Uniform(), sweep={"drive": drives}))
    assert word(dataset, "drive.model", "").to_numpy().tolist() == ["ramp", "start"]
    steady = {"drive": drive.Steady(speed=1e-3), "shear": shear.Uniform()}
    assert read.is_stationary(run(scene(**steady)))
    ended = run(scene(**steady))
    # as after a runaway
    ended["speed"] = ended["speed"].where(ended["t"] < ended["t"][2])
    assert read.is_steady(ended) and not read.is_stationary(
        run(scene(shear=shear.Uniform()))
    )
    moved = run(scene(contact=Equilibrium(load={"from": 1e-3, "to": 2e-3}), **steady))
    assert read.is_steady(moved) and not read.is_stationary(moved)
    pulled = {"bonds": bonds.Steady(critical_speed=1e-2, stress=2e5)}
    pulled |= {"shear": shear.Uniform(), "clock": Clock(duration=0.1, step=1e-2)}
    force = drive.Force(force=1e-4, damping=1.0, contact_stiffness="rigid")
    borne = run(scene(drive=force, **pulled))
    assert not borne["speed"].any() and read.is_stationary(borne)
    # as if it ran away at the end
    borne["runaway_time"][{"t": -1}] = 0.1
    assert not read.is_stationary(borne)


def test_events_of_a_version_with_other_definitions_are_left_out_with_one_sentence(
    tmp_path,
):
    pulled = Equilibrium(load={"from": 4e-3, "to": -1e-3})
    still = {"drive": drive.Steady(speed=0.0), "shear": shear.Uniform()}
    path, old = tmp_path / "new.nc", tmp_path / "old.nc"
    sim.run(scene(contact=pulled, **still), path).close()
    shutil.copy(path, old)
    with netCDF4.Dataset(old, "a") as file:
        file.sim_version = "1.3.1"
    with sim.open(path) as new, sim.open(old) as opened:
        left_out = set(new.data_vars) - set(opened.data_vars)
        assert {"pull_off_load", "pull_off_time"} <= left_out
        assert not {"contact_area", "first_detachment", "jkr_radius"} & left_out
        assert lacking(new) == ""
        words = "no pull-offs and slip events, which had other definitions"
        assert words in lacking(opened) and "run the scenario again" in lacking(opened)
        assert not [name for name in sim.stats(opened) if name.startswith("pull_off")]
    # nothing holds it any longer
    with netCDF4.Dataset(old, "a"):
        pass
