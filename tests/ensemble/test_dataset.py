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
            found = dataset[variable.name].isel(t=record).values
            assert np.array_equal(
                np.atleast_1d(found), np.ravel(variable.read(scenario, trajectory_of(scenario, state))), equal_nan=True
            ), variable.name


def test_every_variable_has_unit_and_long_name_and_stands_on_its_page():
    scenario = sample(shear=MAPPED, record=Record(maps=(2e-3,)))
    dataset = ensemble.run(scenario)
    page = Path(__file__).parents[2].joinpath("docs", "dataset.md").read_text(encoding="utf-8")
    given = {variable_name(key) for key in quantities(scenario)}
    for name, variable in dataset.variables.items():
        assert name in given or f"| `{name}` |" in page, f"{name}: declare it in sim.ensemble.variables"
        assert variable.attrs["long_name"], name
        assert "units" in variable.attrs or "flag_values" in variable.attrs, name
    assert set(dataset.attrs) >= {"Conventions", "title", "history", "scenario_toml", "seed", "sim_version"}


def test_the_file_opens_lazily_and_equals_the_run_in_memory(tmp_path):
    scenario = replace(sample(), sweep=read_sweep({"contact.load": [1e-3, 4e-3], "adhesion.bond_share": [0.0, 1.0]}))
    path = ensemble.run(scenario, tmp_path / "out.nc")
    with sim.open(path) as from_disk:
        assert from_disk["contact_radius"].dims == ("contact_load", "adhesion_bond_share", "member", "t")
        assert from_disk["speed"].dims == ("contact_load", "adhesion_bond_share", "t")
        xr.testing.assert_identical(from_disk.load(), ensemble.run(scenario))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.nc"]


def test_a_large_dataset_is_written_by_another_process_with_the_same_content(tmp_path, monkeypatch):
    path = ensemble.run(sample(), tmp_path / "small.nc")
    monkeypatch.setattr(datasets, "_IN_MEMORY", 0)
    with sim.open(path) as small, sim.open(ensemble.run(sample(), tmp_path / "large.nc")) as large:
        xr.testing.assert_identical(small, large)


def test_parts_of_any_shape_give_the_same_numbers(monkeypatch):
    whole = ensemble.run(sample())
    monkeypatch.setattr(plans, "_GROUP", 2)
    monkeypatch.setattr(plans, "_PART_NUMBERS", 60)
    pieces = ensemble.run(sample())
    xr.testing.assert_identical(whole, pieces)


def test_recording_seldom_gives_the_same_numbers():
    often = ensemble.run(sample(clock=Clock(duration=6e-3, step=1e-3)))
    seldom = ensemble.run(sample(clock=Clock(duration=6e-3, step=1e-3, record=3e-3)))
    for variable in Plan.of(sample()).variables:
        assert np.array_equal(
            often[variable.name].isel(t=[0, 3, 6]).values, seldom[variable.name].values, equal_nan=True
        )


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
    dataset = ensemble.run(
        sample(contact=CONTACTS["tension"].__class__(load=-1e-3), shear=shear.Uniform(), bonds=BONDS["none"])
    )
    for name in ("contact_radius", "contact_area", "friction_force", "in_contact", "normal_load"):
        assert np.all(dataset[name] == 0), name
    assert np.all(np.isnan(dataset["indentation"]))


def test_swept_models_are_labelled():
    scenario = replace(
        sample(),
        sweep=read_sweep(
            {
                "shear": [
                    {"model": "uniform"},
                    {"model": "mean", "spectrum": {"model": "gaussian", "rms": "1e5 Pa", "length": "5 um"}},
                ]
            }
        ),
    )
    dataset = ensemble.run(scenario)
    assert list(dataset["shear"].values) == ["uniform", "mean"]
    assert dataset["fluctuation_energy"].isel(shear=0).max() == 0.0 < dataset["fluctuation_energy"].isel(shear=1).min()


def test_zipped_sweeps_have_one_dimension_and_all_their_coordinates():
    scenario = replace(
        sample(),
        sweep=read_sweep(
            [{"contact.load": "1 mN", "sphere.radius": "1 mm"}, {"contact.load": "4 mN", "sphere.radius": "2 mm"}]
        ),
    )
    dataset = ensemble.run(scenario)
    assert_allclose(dataset["contact_load"], [1e-3, 4e-3])
    assert dataset["sphere_radius"].dims == ("contact_load",)
    assert_allclose(dataset["sphere_radius"], [1e-3, 2e-3])
    rows = [{"sphere.radius": 2e-3, "contact.load": load} for load in (1e-3, 4e-3)]  # a key may keep one value
    dataset = ensemble.run(replace(sample(), sweep=read_sweep(rows)))
    assert dataset["contact_radius"].dims == ("sphere_radius", "member", "t")
    assert_allclose(dataset["sphere_radius"], [2e-3, 2e-3])


def test_an_existing_output_is_kept(tmp_path):
    path = tmp_path / "out.nc"
    path.write_text("precious", encoding="utf-8")
    with pytest.raises(ensemble.OutputExists, match="replace"):
        ensemble.run(sample(), path)
    assert path.read_text(encoding="utf-8") == "precious"
    ensemble.run(sample(), path, replace=True)
    assert xr.open_dataset(path).attrs["sim_version"]


def test_a_run_that_fails_leaves_the_older_output(tmp_path, monkeypatch):
    path = ensemble.run(sample(), tmp_path / "out.nc")
    before = path.read_bytes()

    def broken(*arguments):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(datasets, "_fill", broken)
    with pytest.raises(StoreTrouble, match="No space left"):
        ensemble.run(sample(seed=6), path, replace=True)
    assert path.read_bytes() == before
    assert not list(tmp_path.glob(".out*"))


def test_a_full_disk_is_told_with_its_reason(tmp_path, room, monkeypatch, capsys):
    lens, output = Path(__file__).parents[2] / "scenarios/pdms_lens.toml", tmp_path / "o.nc"
    monkeypatch.setattr(sys, "argv", ["sim", "run", str(lens), "--members", "2", "-o", str(output), "--quiet"])
    with room(20_000), pytest.raises(SystemExit) as done:
        cli.main()
    said = capsys.readouterr().err
    assert done.value.code == 74, said
    assert "File too large" in said
    assert len(said.splitlines()) == 1
    assert not output.exists()


def test_threads_give_the_datasets_of_one_after_the_other(tmp_path):
    scenarios = [sample(members=2, seed=seed) for seed in range(4)]
    alone = [ensemble.run(scenario) for scenario in scenarios]

    def whole(number):
        with sim.open(ensemble.run(scenarios[number], tmp_path / f"{number}.nc")) as dataset:
            return ensemble.run(scenarios[number]), dataset.load()

    with ThreadPoolExecutor(4) as pool:
        for expected, found in zip(alone, pool.map(whole, range(4)), strict=True):
            for dataset in found:
                xr.testing.assert_identical(dataset, expected)


def test_datasets_can_be_pickled(tmp_path):
    dataset = ensemble.run(sample())
    xr.testing.assert_identical(pickle.loads(pickle.dumps(dataset)), dataset)
    with sim.open(ensemble.run(sample(), tmp_path / "out.nc")) as lazy:
        again = pickle.loads(pickle.dumps(lazy))
        xr.testing.assert_identical(again.load(), dataset)
        again.close()


def test_runs_join_along_a_key_by_xarrays_own_means():
    base, names = sample(), [variable.name for variable in Plan.of(sample()).variables]
    swept = replace(base, sweep=read_sweep({"contact.load": [1e-3, 2e-3, 4e-3]}))
    whole = ensemble.run(swept)
    runs = [ensemble.run(point).set_coords("contact_load") for point in swept.points()]
    joined = xr.concat(runs, "contact_load", data_vars="minimal")[names]
    assert joined["speed"].dims == ("t",)  # all runs have the same
    xr.testing.assert_equal(joined.drop_vars("speed"), whole[names].drop_vars("speed"))
    two = ensemble.run(replace(base, sweep=read_sweep({"contact.load": [1e-3, 2e-3]})))
    joined = xr.combine_by_coords(
        [runs[2][names].expand_dims("contact_load"), two[names]], combine_attrs="drop_conflicts"
    )
    xr.testing.assert_equal(joined, whole[names])


def test_no_variable_that_is_recorded_has_the_name_of_a_key():
    mapped = sample(shear=MAPPED, record=Record(maps=(2e-3,)))
    own = {variable_name(key) for key in quantities(mapped)}
    found = {
        variable_name(".".join((*path, key)))
        for path, field in all_tables(Scenario)
        for table in tables(field.annotation).values()
        for key in keys(table)
    }
    assert len(found) > 50 and not found & (set(ensemble.run(mapped).variables) - own)


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
    felt = {"bonds": BONDS["rate, bell"]}
    driven, stage = set(READINGS), {"stage_position", "stage_speed"}
    scenes = [
        (set(), sample()),
        ({"fluctuations_radius"}, sample(contact=CONTACTS["partly reversible"])),
        ({"equilibrium_radius"}, sample(contact=CONTACTS["rate_dependent"])),
        ({"applied_load"}, sample(contact=CONTACTS["load there and back"])),
        (driven, sample(drive=DRIVES["spring"], **felt)),
        (driven - stage, sample(drive=DRIVES["force"], **felt)),
    ]
    some = set.union(*(names for names, _ in scenes))
    assert some == {variable.name for variable in VARIABLES if variable.condition}
    for names, scenario in scenes:
        found = set(ensemble.run(scenario).variables)
        assert found & some == names
        assert {variable.name for variable in VARIABLES if not variable.condition} <= found
