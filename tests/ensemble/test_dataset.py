"""From parts to a dataset: names and units, equal bytes, and trouble with the disk."""

import pickle
import sys
import typing
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from helpers.scenes import BONDS, CELL, CONTACTS, DRIVES, SHEARS, SPECTRUM, scene
from numpy.testing import assert_allclose

import sim
from sim import cli
from sim.engine import march, trajectory_of
from sim.ensemble import dataset as datasets, plan as plans, simulate as ensemble
from sim.ensemble.dataset import variable_name
from sim.ensemble.plan import Plan
from sim.ensemble.variables import LARGEST, VARIABLES
from sim.numerics.files import StoreTrouble
from sim.parts.drive import READINGS
from sim.parts.shear import models as shear
from sim.parts.shear.process import Slip
from sim.scenario.clock import Clock, Record
from sim.scenario.scenario import Scenario, read_sweep
from sim.scenario.schema import all_tables, keys, quantities, tables
from sim.units.notation import Recorded

MAPPED = shear.Mapped(spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=3e-6))


def sample(**parts):
    defaults = {"shear": SHEARS["modal, slip, onset"], "bonds": BONDS["rate"], "contact": CONTACTS["load"]}
    return scene(parts.pop("members", 5), parts.pop("steps", 6), **(defaults | parts))


def test_the_dataset_is_what_the_engine_marched():
    scenario = sample()
    dataset = ensemble.run(scenario)
    for record, state in enumerate(march(scenario, np.arange(5))):
        for variable in Plan.of(scenario).variables:
            recorded = np.atleast_1d(dataset[variable.name].isel(t=record).values)
            marched = np.ravel(variable.read(scenario, trajectory_of(scenario, state)))
            np.testing.assert_array_equal(recorded, marched, err_msg=variable.name)


def test_every_variable_has_unit_and_long_name_and_stands_on_its_page():
    scenario = sample(shear=MAPPED, record=Record(maps=(2e-3,)))
    dataset = ensemble.run(scenario)
    page = Path(__file__).parents[2].joinpath("docs", "dataset.md").read_text(encoding="utf-8")
    numbers = {variable_name(key) for key in quantities(scenario)}
    for name, variable in dataset.variables.items():
        assert name in numbers or f"| `{name}` |" in page, f"{name}: declare it in sim.ensemble.variables"
        assert variable.attrs["long_name"], name
        assert "units" in variable.attrs or "flag_values" in variable.attrs, name
    assert set(dataset.attrs) >= {"Conventions", "title", "history", "scenario_toml", "seed", "sim_version"}


def swept(sweep, **parts):
    return replace(sample(**parts), sweep=read_sweep(sweep))


def test_a_file_written_at_once_or_in_parts_equals_the_run_in_memory(tmp_path, monkeypatch):
    scenario = swept({"contact.load": [1e-3, 4e-3], "adhesion.bond_share": [0.0, 1.0]})
    whole = ensemble.run(scenario)
    with sim.open(ensemble.run(scenario, tmp_path / "small.nc")) as from_disk:
        assert from_disk["contact_radius"].dims == ("contact_load", "adhesion_bond_share", "member", "t")
        assert from_disk["speed"].dims == ("contact_load", "adhesion_bond_share", "t")
        xr.testing.assert_identical(from_disk.load(), whole)
    assert [file.name for file in tmp_path.iterdir()] == ["small.nc"]
    monkeypatch.setattr(datasets, "_IN_MEMORY", 0)
    monkeypatch.setattr(plans, "_GROUP", 2)
    monkeypatch.setattr(plans, "_PART_NUMBERS", 60)
    with sim.open(ensemble.run(scenario, tmp_path / "large.nc")) as large:
        xr.testing.assert_identical(large.load(), whole)


def test_recording_seldom_gives_the_same_numbers():
    often = ensemble.run(sample(clock=Clock(duration=6e-3, step=1e-3)))
    seldom = ensemble.run(sample(clock=Clock(duration=6e-3, step=1e-3, record=3e-3)))
    for variable in Plan.of(sample()).variables:
        np.testing.assert_array_equal(often[variable.name].isel(t=[0, 3, 6]), seldom[variable.name])


def test_statistics_in_place_of_members_are_those_of_the_members(monkeypatch):
    each = ensemble.run(sample())
    monkeypatch.setattr(plans, "_GROUP", 2)
    pooled = ensemble.run(sample(record=Record(per_member=False)))
    assert "member" not in pooled.dims
    for name in ("contact_radius", "fluctuation_energy", "friction_force"):
        values = each[name].transpose("member", "t").values
        assert_allclose(pooled[f"{name}_mean"], values.mean(0), rtol=1e-13)
        assert_allclose(pooled[f"{name}_std"], values.std(0, ddof=1), rtol=1e-11)
        assert_allclose(pooled[f"{name}_sem"], values.std(0, ddof=1) / np.sqrt(5), rtol=1e-11)
    assert pooled["bond_fraction"].dims == ("t",)
    assert "member" not in ensemble.run(sample(members=64, shear=shear.Uniform())).dims  # members do not differ


def test_names_that_may_be_recorded_are_the_quantities():
    assert typing.get_args(Recorded) == tuple(variable.name for variable in VARIABLES + LARGEST)


def test_a_quantity_that_is_kept_alone_has_the_bits_of_the_whole_run():
    chosen = ("fluctuation_energy", "jkr_radius", "peak_stress", "applied_load")  # the last is not of this scene
    names = {variable.name for variable in VARIABLES + LARGEST}
    for per_member in (True, False):
        whole = ensemble.run(sample(record=Record(per_member=per_member)))
        some = ensemble.run(sample(record=Record(per_member=per_member, quantities=chosen)))
        xr.testing.assert_equal(some, whole.drop_vars("speed")[list(some.variables)])
        assert names & {str(name).removesuffix("_mean") for name in some} == {"contact_radius", *chosen[:-1]}


def test_maps_are_those_of_the_members_and_times_asked_for(tmp_path):
    scenario = sample(shear=MAPPED, record=Record(maps=(4e-3, 1e-3), map_members=2))
    dataset = ensemble.run(scenario)
    assert dataset["shear_map"].dims == ("map_member", "map_time", "x", "y")
    assert_allclose(dataset["map_time"], [1e-3, 4e-3])
    states = list(march(scenario, np.arange(5)))
    for snapshot, step in enumerate((1, 4)):
        maps = scenario.process.maps(states[step].shear, np.full(2, states[step].drive.position[0]), 2)
        assert np.array_equal(dataset["shear_map"].isel(map_time=snapshot).values, maps)
    with netCDF4.Dataset(ensemble.run(scenario, tmp_path / "out.nc")) as file:  # reading one map reads one map
        assert file["shear_map"].chunking() == [1, 1, 12, 12]


def test_a_detached_contact_is_zero_and_not_in_contact():
    tension = CONTACTS["tension"].__class__(load=-1e-3)
    dataset = ensemble.run(sample(contact=tension, shear=shear.Uniform(), bonds=BONDS["none"]))
    for name in ("contact_radius", "contact_area", "friction_force", "in_contact", "normal_load"):
        assert np.all(dataset[name] == 0), name
    assert np.all(np.isnan(dataset["indentation"]))


def test_swept_models_are_labelled():
    spectrum = {"model": "gaussian", "rms": "1e5 Pa", "length": "5 um"}
    dataset = ensemble.run(swept({"shear": [{"model": "uniform"}, {"model": "mean", "spectrum": spectrum}]}))
    assert list(dataset["shear"].values) == ["uniform", "mean"]
    assert dataset["fluctuation_energy"].isel(shear=0).max() == 0.0 < dataset["fluctuation_energy"].isel(shear=1).min()


def test_zipped_sweeps_have_one_dimension_and_all_their_coordinates():
    for radii in ([1e-3, 2e-3], [2e-3, 2e-3]):  # a key may keep one value
        rows = [
            {"contact.load": load, "sphere.radius": radius} for load, radius in zip((1e-3, 4e-3), radii, strict=True)
        ]
        dataset = ensemble.run(swept(rows))
        assert_allclose(dataset["contact_load"], [1e-3, 4e-3])
        assert dataset["contact_radius"].dims == ("contact_load", "member", "t")
        assert dataset["sphere_radius"].dims == ("contact_load",)
        assert_allclose(dataset["sphere_radius"], radii)


def test_an_older_output_is_kept_unless_it_is_replaced_by_a_run_that_succeeds(tmp_path, monkeypatch):
    path = ensemble.run(sample(), tmp_path / "out.nc")
    before = path.read_bytes()
    with pytest.raises(ensemble.OutputExists):
        ensemble.run(sample(seed=6), path)

    def broken(*arguments):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched, pytest.raises(StoreTrouble, match="No space left"):
        patched.setattr(datasets, "_fill", broken)
        ensemble.run(sample(seed=6), path, replace=True)
    assert path.read_bytes() == before
    assert not list(tmp_path.glob(".out*"))
    ensemble.run(sample(seed=6), path, replace=True)
    with sim.open(path) as dataset:
        assert dataset.attrs["seed"] == "6"


def test_a_full_disk_is_told_with_its_reason(tmp_path, room, monkeypatch, capsys):
    lens, output = Path(__file__).parents[2] / "scenarios/pdms_lens.toml", tmp_path / "o.nc"
    monkeypatch.setattr(sys, "argv", ["sim", "run", str(lens), "--members", "2", "-o", str(output), "--quiet"])
    with room(20_000), pytest.raises(SystemExit) as done:
        cli.main()
    message = capsys.readouterr().err
    assert done.value.code == 74, message
    assert "File too large" in message and len(message.splitlines()) == 1
    assert not output.exists()


def test_threads_give_the_datasets_of_one_after_the_other_and_datasets_can_be_pickled(tmp_path):
    scenarios = [sample(members=2, seed=seed) for seed in range(4)]
    alone = [ensemble.run(scenario) for scenario in scenarios]

    def whole(number):
        with sim.open(ensemble.run(scenarios[number], tmp_path / f"{number}.nc")) as dataset:
            again = pickle.loads(pickle.dumps(dataset))
            try:
                return ensemble.run(scenarios[number]), dataset.load(), again.load()
            finally:
                again.close()

    with ThreadPoolExecutor(4) as pool:
        for expected, datasets_of_thread in zip(alone, pool.map(whole, range(4)), strict=True):
            for dataset in datasets_of_thread:
                xr.testing.assert_identical(dataset, expected)
    xr.testing.assert_identical(pickle.loads(pickle.dumps(alone[0])), alone[0])


def test_runs_join_along_a_key_by_xarrays_own_means():
    scenario = swept({"contact.load": [1e-3, 2e-3, 4e-3]})
    names, whole = [variable.name for variable in Plan.of(scenario).variables], ensemble.run(scenario)
    runs = [ensemble.run(point).set_coords("contact_load") for point in scenario.points()]
    joined = xr.concat(runs, "contact_load", data_vars="minimal")[names]
    assert joined["speed"].dims == ("t",)  # all runs have the same
    xr.testing.assert_equal(joined.drop_vars("speed"), whole[names].drop_vars("speed"))
    two = ensemble.run(swept({"contact.load": [1e-3, 2e-3]}))
    datasets_to_join = [runs[2][names].expand_dims("contact_load"), two[names]]
    joined = xr.combine_by_coords(datasets_to_join, combine_attrs="drop_conflicts")
    xr.testing.assert_equal(joined, whole[names])


def test_no_variable_that_is_recorded_has_the_name_of_a_key():
    mapped = sample(shear=MAPPED, record=Record(maps=(2e-3,)))
    numbers = {variable_name(key) for key in quantities(mapped)}
    names = {
        variable_name(".".join((*path, key)))
        for path, field in all_tables(Scenario)
        for table in tables(field.annotation).values()
        for key in keys(table)
    }
    assert len(names) > 50 and not names & (set(ensemble.run(mapped).variables) - numbers)


def test_six_digits_are_kept_in_a_plain_file(tmp_path):
    def written(compression):
        return ensemble.run(sample(record=Record(compression=compression)), tmp_path / f"{compression}.nc")

    none, whole, digits = map(written, ("none", "zlib", "digits"))
    with netCDF4.Dataset(none) as bare, netCDF4.Dataset(whole) as exact, netCDF4.Dataset(digits) as file:
        assert not bare["contact_radius"].filters()["zlib"]
        assert file["contact_radius"].quantization() == (20, "BitRound")
        for variable in VARIABLES:
            if not variable.condition:
                values = exact[variable.name][:]
                assert np.array_equal(bare[variable.name][:], values, equal_nan=True), variable.name
                assert_allclose(file[variable.name][:], values, rtol=5e-7, err_msg=variable.name)
        assert not np.array_equal(file["contact_radius"][:], exact["contact_radius"][:])
        assert np.array_equal(file["masked"][:], exact["masked"][:])
        assert np.ptp(file["jkr_radius"][:]) == 0.0  # what is equal stays equal
        assert np.array_equal(file["t"][:], exact["t"][:]) and np.array_equal(file["peak_stress"], exact["peak_stress"])


def test_a_flipped_byte_of_any_variable_with_a_dimension_is_an_error(tmp_path):
    path = ensemble.run(sample(record=Record(compression="none")), tmp_path / "out.nc")
    content = path.read_bytes()
    with netCDF4.Dataset(path) as file:
        arrays = {name: variable[:].tobytes() for name, variable in file.variables.items() if variable.ndim}
    plain = [stored for stored in arrays.values() if content.count(stored) and len(set(stored)) > 8]
    assert len(plain) > 5
    for stored in plain:
        place = content.index(stored) + len(stored) // 2
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with netCDF4.Dataset(path) as file, pytest.raises(RuntimeError, match="NetCDF: HDF error"):
            for other in arrays:  # equal arrays are stored more than once
                file[other][:]
        with sim.open(path) as dataset, pytest.raises(RuntimeError, match=r"variable \w+ is damaged"):
            dataset.load()


def test_a_variable_is_there_where_its_condition_holds():
    bell = {"bonds": BONDS["rate, bell"]}
    driven, stage = set(READINGS), {"stage_position", "stage_speed"}
    scenes = [
        (set(), sample()),
        ({"fluctuations_radius"}, sample(contact=CONTACTS["partly reversible"])),
        ({"equilibrium_radius"}, sample(contact=CONTACTS["rate_dependent"])),
        ({"applied_load"}, sample(contact=CONTACTS["load there and back"])),
        (driven, sample(drive=DRIVES["spring"], **bell)),
        (driven - stage, sample(drive=DRIVES["force"], **bell)),
    ]
    some = set.union(*(names for names, _ in scenes))
    assert some == {variable.name for variable in VARIABLES if variable.condition}
    for names, scenario in scenes:
        variables = set(ensemble.run(scenario).variables)
        assert variables & some == names
        assert {variable.name for variable in VARIABLES if not variable.condition} <= variables
