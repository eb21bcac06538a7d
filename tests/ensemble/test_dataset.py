"""From parts to a dataset: names and units, equal bytes, and trouble with the disk."""

import json
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import netCDF4
import numpy as np
import pytest
import xarray as xr
from helpers.commands import SCENE, sim as command
from helpers.parts import Adhesion, Record, Slip, load, read, read_sweep, run, shear
from helpers.printed import rows_of
from helpers.scenes import BONDS, CELL, CONTACTS, DRIVES, SHEARS, SPECTRUM, march, scene
from numpy.testing import assert_allclose
from pydantic import TypeAdapter

import sim
from sim.ensemble import dataset as datasets, plan as plans, simulate as ensemble
from sim.ensemble.dataset import scenario_json, variable_name
from sim.ensemble.plan import Plan
from sim.ensemble.variables import LARGEST, VARIABLES
from sim.numerics import hdf5, lazy
from sim.numerics.files import HDF5, StoreTrouble
from sim.parts.drive import READINGS
from sim.quantities import ALWAYS, RECORDED
from sim.scenario.scenario import Scenario
from sim.scenario.schema import all_tables, keys, quantities, tables
from sim.units.errors import BadInput

MAPPED = shear.Mapped(
    spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=3e-6)
)


def sample(**parts):
    defaults = {
        "shear": SHEARS["modal, slip, onset"],
        "bonds": BONDS["rate"],
        "contact": CONTACTS["load"],
    }
    return scene(parts.pop("members", 5), parts.pop("steps", 6), **(defaults | parts))


def swept(sweep, **parts):
    return replace(sample(**parts), sweep=read_sweep(sweep))


def test_the_dataset_is_what_the_engine_marched_with_members_only_if_they_differ_and_are_recorded():
    scenario = sample()
    dataset = ensemble.run(scenario)
    for record, state in enumerate(march(scenario, np.arange(5))):
        for variable in Plan.of(scenario).variables:
            recorded = np.atleast_1d(dataset[variable.name].isel(t=record).values)
            marched = np.ravel(
                variable.read(scenario, scenario.stepper.trajectory_of(state))
            )
            np.testing.assert_array_equal(recorded, marched, err_msg=variable.name)
    pooled = ensemble.run(sample(record=Record(per_member=False)))
    assert "member" not in pooled.dims and pooled["bond_fraction"].dims == ("t",)


@pytest.mark.parametrize("drive", ["steady", "spring with mass", "force"])
@pytest.mark.parametrize(
    ("bonds", "field", "is_random"),
    [
        ("rate", "uniform", False),
        ("rate, carried", "mean", False),
        ("cohort", "mean, slip rate", False),
        ("cohort", "modal, time, constant", True),
        ("counted", "uniform", True),
    ],
)
def test_a_scene_has_a_dimension_of_members_if_and_only_if_a_part_is_random(
    drive, bonds, field, is_random
):
    parts = {
        "drive": DRIVES[drive],
        "bonds": BONDS[bonds],
        "shear": SHEARS[field],
        "contact": CONTACTS["load"],
    }
    scenario = scene(3, 4, **parts)
    dataset, single = ensemble.run(scenario), ensemble.run(scene(1, 4, **parts))
    assert ("member" in dataset.sizes) is is_random is bool(dataset["has_noise"])
    assert dataset.attrs["members"] == (3 if is_random else 1)
    assert ("speed" in dataset.coords) is (drive == "steady")
    if not is_random:
        pooled = ensemble.run(replace(scenario, record=Record(per_member=False)))
        xr.testing.assert_equal(dataset, pooled)
        requested = "ensemble_members"
        xr.testing.assert_equal(
            dataset.drop_vars(requested), single.drop_vars(requested)
        )
        printed = [*rows_of(dataset), *rows_of(dataset, read.highlights)]
        assert not any("(" in cell for row in printed for cell in row.values())


def test_members_of_a_sweep_are_equal_without_an_error_at_the_points_where_nothing_is_random():
    random = {
        "model": "modal",
        "spectrum": {
            "model": "band",
            "rms": "20 kPa",
            "shortest": "60 um",
            "longest": "120 um",
        },
        "cell": "0.24 mm",
        "correlation": {"model": "time", "time": "2 ms"},
    }
    scenario = swept(
        {"shear": [{"model": "uniform"}, random]},
        drive=DRIVES["spring"],
        bonds=BONDS["cohort"],
        contact=CONTACTS["load"],
    )
    dataset = ensemble.run(scenario)
    area = dataset["contact_area"]
    assert dataset.sizes["member"] == 5 and dataset.attrs["members"] == 5
    equal = (area == area.isel(member=0)).all(["member", "t"])
    assert equal.values.tolist() == [True, False]
    rows = rows_of(read.where(dataset, {"shear": "uniform"}))
    assert not any("(" in cell for row in rows for cell in row.values())


def test_recording_one_quantity_alone_gives_the_bits_of_the_whole_run():
    # the last is not of this scene
    chosen = ("fluctuation_energy", "jkr_radius", "peak_stress", "applied_load")
    names = {variable.name for variable in VARIABLES + LARGEST}
    for per_member in (True, False):
        whole = ensemble.run(sample(record=Record(per_member=per_member)))
        some = ensemble.run(
            sample(record=Record(per_member=per_member, quantities=chosen))
        )
        xr.testing.assert_equal(some, whole.drop_vars("speed")[list(some.variables)])
        assert names & {str(name).removesuffix("_mean") for name in some} == {
            "contact_radius",
            *chosen[:-1],
        }


def test_maps_are_those_of_the_members_and_times_asked_for(tmp_path):
    scenario = sample(shear=MAPPED, record=Record(maps=(4e-3, 1e-3), map_members=2))
    dataset = ensemble.run(scenario)
    assert dataset["shear_map"].dims == ("map_member", "map_time", "x", "y")
    assert_allclose(dataset["map_time"], [1e-3, 4e-3])
    states = list(march(scenario, np.arange(5)))
    for snapshot, step in enumerate((1, 4)):
        maps = scenario.process.maps(
            states[step].shear, np.full(2, states[step].drive.position[0]), 2
        )
        assert np.array_equal(dataset["shear_map"].isel(map_time=snapshot).values, maps)
    # reading one map reads one map
    with netCDF4.Dataset(ensemble.run(scenario, tmp_path / "out.nc")) as file:
        assert file["shear_map"].chunking() == [1, 1, 12, 12]


def test_a_detached_contact_is_zero_and_not_in_contact():
    tension = CONTACTS["tension"].__class__(load=-1e-3)
    dataset = ensemble.run(
        sample(contact=tension, shear=shear.Uniform(), bonds=BONDS["none"])
    )
    for name in (
        "contact_radius",
        "contact_area",
        "friction_force",
        "in_contact",
        "normal_load",
    ):
        assert np.all(dataset[name] == 0), name
    assert np.all(np.isnan(dataset["indentation"]))


def test_swept_models_are_labelled_and_zipped_sweeps_have_one_dimension_and_all_their_coordinates():
    spectrum = {"model": "gaussian", "rms": "1e5 Pa", "length": "5 um"}
    dataset = ensemble.run(
        swept(
            {"shear": [{"model": "uniform"}, {"model": "mean", "spectrum": spectrum}]}
        )
    )
    assert list(dataset["shear"].values) == ["uniform", "mean"]
    assert (
        dataset["fluctuation_energy"].isel(shear=0).max()
        == 0.0
        < dataset["fluctuation_energy"].isel(shear=1).min()
    )
    for radii in ([1e-3, 2e-3], [2e-3, 2e-3]):  # a key may keep one value
        rows = [
            {"contact.load": p, "sphere.radius": r}
            for p, r in zip((1e-3, 4e-3), radii, strict=True)
        ]
        dataset = ensemble.run(swept(rows))
        assert_allclose(dataset["contact_load"], [1e-3, 4e-3])
        assert dataset["contact_radius"].dims == ("contact_load", "member", "t")
        assert dataset["sphere_radius"].dims == ("contact_load",)
        assert_allclose(dataset["sphere_radius"], radii)


def test_a_file_in_parts_equals_the_run_in_memory_and_an_older_one_survives_a_failure(
    tmp_path, monkeypatch
):
    scenario = swept({"contact.load": [1e-3, 4e-3], "adhesion.bond_share": [0.0, 1.0]})
    whole = ensemble.run(scenario)
    with sim.open(ensemble.run(scenario, tmp_path / "small.nc")) as from_disk:
        assert from_disk["contact_radius"].dims == (
            "contact_load",
            "adhesion_bond_share",
            "member",
            "t",
        )
        assert from_disk["speed"].dims == ("contact_load", "adhesion_bond_share", "t")
        xr.testing.assert_identical(from_disk.load(), whole)
    assert [file.name for file in tmp_path.iterdir()] == ["small.nc"]
    monkeypatch.setattr(datasets, "IN_MEMORY", 0)
    monkeypatch.setattr(plans, "_GROUP", 2)
    monkeypatch.setattr(plans, "_PART_NUMBERS", 60)
    with sim.open(ensemble.run(scenario, tmp_path / "large.nc")) as large:
        xr.testing.assert_identical(large.load(), whole)
    monkeypatch.undo()
    path = ensemble.run(sample(), tmp_path / "out.nc")
    before = path.read_bytes()
    with (
        monkeypatch.context() as patched,
        pytest.raises(StoreTrouble, match="No space left"),
    ):
        patched.setattr(
            datasets, "_fill", Mock(side_effect=OSError(28, "No space left on device"))
        )
        ensemble.run(sample(seed=6), path, replace=True)
    assert path.read_bytes() == before and not list(tmp_path.glob(".out*"))


def test_datasets_can_be_computed_in_threads_and_pickled(tmp_path):
    scenarios = [sample(members=2, seed=seed) for seed in range(4)]
    alone = [ensemble.run(scenario) for scenario in scenarios]

    def whole(number):
        with sim.open(
            ensemble.run(scenarios[number], tmp_path / f"{number}.nc")
        ) as dataset:
            again = pickle.loads(pickle.dumps(dataset))
            try:
                return ensemble.run(scenarios[number]), dataset.load(), again.load()
            finally:
                again.close()

    with ThreadPoolExecutor(4) as pool:
        for expected, datasets_of_thread in zip(
            alone, pool.map(whole, range(4)), strict=True
        ):
            for dataset in datasets_of_thread:
                xr.testing.assert_identical(dataset, expected)
    xr.testing.assert_identical(pickle.loads(pickle.dumps(alone[0])), alone[0])


def test_a_path_has_letters_of_the_systems_code_page(tmp_path):
    path = tmp_path / "Müller µ" / "größe.nc"
    ensemble.run(sample(), path)
    with sim.open(path) as dataset:
        assert "größe.nc" in dataset.encoding["source"]
        lazy.save(dataset, beside := path.with_name("ñ.nc"))
        with hdf5.opened(beside) as file:
            assert file.filepath().endswith("ñ.nc")
            assert_allclose(
                file["contact_area"][:], dataset["contact_area"], rtol=0, atol=0
            )
    assert datasets.attributes_of(path)["sim_version"] == sim.__version__


def test_an_output_that_another_program_holds_open_is_published_by_resume(
    tmp_path, monkeypatch
):
    path, changed, replace_file = tmp_path / "out.nc", sample(seed=4), os.replace
    ensemble.run(sample(), path)
    content = path.read_bytes()

    def refusing(source, target):
        if Path(target) == path:
            raise PermissionError(
                13, "The file is used by another process", str(target)
            )
        replace_file(source, target)

    with monkeypatch.context() as patched, path.open("rb"):
        if os.name != "nt":  # which refuses by itself
            patched.setattr("os.replace", refusing)
        with pytest.raises(
            StoreTrouble, match=r"out\.nc cannot be replaced: close the program"
        ):
            ensemble.run(changed, path, replace=True)
        assert path.read_bytes() == content
    ensemble.run(changed, path, resume=True)
    assert not path.with_name("out.nc.parts").exists()
    with sim.open(path) as dataset:
        assert dataset.attrs["seed"] == "4"


def test_letters_that_the_code_page_lacks_are_refused_before_the_run_and_named_when_a_file_is_read(
    tmp_path, monkeypatch
):
    path = ensemble.run(sample(), tmp_path / "out.nc")
    if os.name != "nt":
        monkeypatch.setattr(hdf5, "ENCODING", "cp1252")
    other = tmp_path / "Δ µ" / "测试.nc"
    other.parent.mkdir()
    other.write_bytes(path.read_bytes())
    before = sorted(other.parent.iterdir())
    monkeypatch.setattr("sim.ensemble.simulate.simulate", None)  # computing would fail
    monkeypatch.setattr("sim.study.converge.converge", None)
    toml = tmp_path / "scene.toml"
    toml.write_text(SCENE, encoding="utf-8")
    for arguments in (
        ["run", toml, "-o", other, "--force"],
        ["run", toml, "-o", other.with_name("new.nc")],
        ["stats", other],
        ["converge", toml, "-o", other.with_name("new.nc")],
    ):
        done = command(*arguments)
        assert (
            done.exit_code == 2
            and "code page" in done.stderr
            and "damaged" not in done.stderr
        ), arguments
    with pytest.raises(BadInput, match="code page"):
        ensemble.run(sample(), other, replace=True)
    assert sorted(other.parent.iterdir()) == before


def test_no_file_is_read_or_written_while_another_thread_reads_through_xarray(tmp_path):
    path, lock = (
        ensemble.run(sample(), tmp_path / "out.nc"),
        xr.backends.netCDF4_.NETCDF4_PYTHON_LOCK,
    )
    # because Windows replaces no file that is open
    other = ensemble.run(sample(), tmp_path / "other.nc")
    writes = [
        lambda: ensemble.run(sample(), other, replace=True),
        lambda: datasets.attributes_of(path),
    ]
    with ThreadPoolExecutor(1) as pool, sim.open(path) as dataset:
        for work in (*writes, lambda: sim.open(path).close(), dataset.load):
            with lock:
                assert not HDF5.acquire(blocking=False)
                waiting = pool.submit(work)
                assert not wait([waiting], 0.3).done
            waiting.result(60)
        with HDF5, HDF5:
            assert all(each.locked() for each in lock.locks)
    # the lowest xarray's lock calls itself locked always
    assert not any(each.locked() for each in lock.locks)


def test_names_that_may_be_recorded_are_the_quantities_and_none_is_that_of_a_key():
    assert tuple(variable.name for variable in VARIABLES + LARGEST) == RECORDED
    mapped = sample(shear=MAPPED, record=Record(maps=(2e-3,)))
    numbers = {variable_name(key) for key in quantities(mapped)}
    names = {
        variable_name(".".join((*path, key)))
        for path, field in all_tables(Scenario)
        for table in tables(field.annotation).values()
        for key in keys(table)
    }
    assert len(names) > 50 and not names & (
        set(ensemble.run(mapped).variables) - numbers
    )


def test_six_digits_are_kept_if_asked_and_none_is_lost_otherwise(tmp_path):
    def written(compression):
        return ensemble.run(
            sample(record=Record(compression=compression)),
            tmp_path / f"{compression}.nc",
        )

    none, whole, digits = map(written, ("none", "zlib", "digits"))
    with (
        netCDF4.Dataset(none) as bare,
        netCDF4.Dataset(whole) as exact,
        netCDF4.Dataset(digits) as file,
    ):
        assert not bare["contact_radius"].filters()["zlib"]
        assert file["contact_radius"].quantization() == (20, "BitRound")
        for variable in VARIABLES:
            if variable.definition.exists_when is ALWAYS:
                values = exact[variable.name][:]
                assert np.array_equal(bare[variable.name][:], values, equal_nan=True), (
                    variable.name
                )
                assert_allclose(
                    file[variable.name][:], values, rtol=5e-7, err_msg=variable.name
                )
        assert not np.array_equal(file["contact_radius"][:], exact["contact_radius"][:])
        assert np.array_equal(file["masked"][:], exact["masked"][:])
        assert np.ptp(file["jkr_radius"][:]) == 0.0  # what is equal stays equal
        assert np.array_equal(file["t"][:], exact["t"][:]) and np.array_equal(
            file["peak_stress"], exact["peak_stress"]
        )


def test_every_variable_has_unit_and_long_name_and_stands_where_its_condition_holds():
    scenario = sample(shear=MAPPED, record=Record(maps=(2e-3,)))
    dataset = ensemble.run(scenario)
    page = (
        Path(__file__)
        .parents[2]
        .joinpath("docs", "dataset.md")
        .read_text(encoding="utf-8")
    )
    numbers = {variable_name(key) for key in quantities(scenario)}
    for name, variable in dataset.variables.items():
        assert name in numbers or f"| `{name}` |" in page, (
            f"{name}: declare it in sim.quantities"
        )
        assert variable.attrs["long_name"], name
        assert "units" in variable.attrs or "flag_values" in variable.attrs, name
    assert set(dataset.attrs) >= {
        "Conventions",
        "title",
        "history",
        "scenario_toml",
        "seed",
        "sim_version",
    }
    bell = {"bonds": BONDS["rate, bell"]}
    known = {"masked", "expected_energy"}  # with adhesion, and of a prescribed motion
    driven, stage, runaway = (
        {*READINGS, "masked"} - {"unresolved_time"},
        {"stage_position", "stage_speed"},
        {"runaway_time"},
    )
    scenes = [
        (known, sample()),
        (
            known | {"fluctuations_radius"},
            sample(contact=CONTACTS["partly reversible"]),
        ),
        (known | {"equilibrium_radius"}, sample(contact=CONTACTS["rate_dependent"])),
        (known | {"edge_energy"}, sample(shear=SHEARS["modal on a disc"])),
        (known | {"applied_load"}, sample(contact=CONTACTS["load there and back"])),
        (
            known | {"applied_load", "outer_radius"},
            sample(contact=CONTACTS["cohesive load there and back"]),
        ),
        (driven - runaway, sample(drive=DRIVES["spring"], **bell)),
        (driven - stage, sample(drive=DRIVES["force"], **bell)),
    ]
    some = set.union(*(names for names, _ in scenes))
    assert some == {
        variable.name
        for variable in VARIABLES
        if variable.definition.exists_when is not ALWAYS
    }
    for names, scenario in scenes:
        variables = set(ensemble.run(scenario).variables)
        assert variables & some == names
        assert {
            variable.name
            for variable in VARIABLES
            if variable.definition.exists_when is ALWAYS
        } <= variables


LENS = Path(__file__).parents[2] / "scenarios" / "pdms_lens.toml"
SHORT = {"clock": {"duration": "2 ms", "step": "1 ms"}, "ensemble.members": 2}


def reread(dataset, folder):
    """The scenario that the text and the overrides of a dataset give."""
    (folder / "again.toml").write_text(dataset.attrs["scenario_toml"], encoding="utf-8")
    return load(folder / "again.toml", json.loads(dataset.attrs["scenario_overrides"]))


def test_text_and_overrides_or_the_resolved_scenario_give_what_was_run(tmp_path):
    lens = load(LENS, SHORT)
    twice = lens.with_values({"contact.load": 1e-3}).with_values(
        {"contact": {"load": 2e-3}}
    )
    for scenario in (lens, lens.with_values({"adhesion.work": 0.03}), twice):
        dataset = run(scenario)
        assert dataset.attrs["scenario_toml"] == LENS.read_text(encoding="utf-8")
        assert scenario_json(reread(dataset, tmp_path)) == scenario_json(scenario)
    part_replaced = replace(lens, adhesion=Adhesion(work=0.03))
    swept = replace(lens, sweep=read_sweep({"contact.load": [1e-3, 2e-3]}))
    for scenario in (
        part_replaced.with_values({"contact.load": 1e-3}),
        swept,
        scene(members=2),
    ):
        dataset = run(scenario)
        assert (
            dataset.attrs["scenario_toml"],
            dataset.attrs["scenario_overrides"],
        ) == ("", "{}")
        again = TypeAdapter(Scenario).validate_python(
            json.loads(dataset.attrs["scenario_resolved"])
        )
        assert again.sweep == scenario.sweep
        xr.testing.assert_identical(run(again), dataset)
    swept = load(LENS, SHORT | {"sweep": {"contact.load": ["1 mN", "4 mN"]}})
    point = swept.points()[1]
    again = reread(run(point), tmp_path)
    assert (again.contact.load, again.sweep) == (4e-3, ())
    rows = [
        {"contact.load": "1 mN", "sphere.radius": "1 mm"},
        {"contact.load": "4 mN", "sphere.radius": "2 mm"},
    ]
    scenario = replace(scene(members=2), sweep=read_sweep(rows))
    assert json.loads(scenario_json(scenario))["sweep"] == rows


SCENARIOS = sorted((Path(__file__).parents[2] / "scenarios").glob("*.toml"))


def check(path):
    """No remark of the checker but one it must make.

    It takes every coordinate in units of pressure for a height, and recommends (the conventions require
    nothing there) that heights stand right of the time: a swept stress or modulus stands left of it.
    """
    checker = Path(sys.executable).with_name("compliance-checker")
    done = subprocess.run(
        [checker, "--test=cf:1.11", path], capture_output=True, text=True, timeout=600
    )
    assert "IOOS Compliance Checker Report" in done.stdout, done.stderr
    remarks = [line for line in done.stdout.splitlines() if line.startswith("* ")]
    assert [
        line for line in remarks if "recommended order T, Z, Y, X" not in line
    ] == []
    assert remarks or "All tests passed" in done.stdout


@pytest.mark.verify
@pytest.mark.parametrize("path", SCENARIOS, ids=lambda path: path.stem)
def test_every_scenario_gives_a_conforming_dataset(path, tmp_path):
    check(run(load(path, {"ensemble.members": 2}), tmp_path / "out.nc"))


@pytest.mark.verify
@pytest.mark.parametrize("per_member", [True, False])
def test_maps_labels_and_statistics_conform(per_member, tmp_path):
    mapped = shear.Mapped(
        spectrum=SPECTRUM, cell=CELL, points=12, correlation=Slip(length=3e-6)
    )
    record = Record(maps=(2e-3,), map_members=2, per_member=per_member)
    scenario = scene(3, shear=mapped, bonds=BONDS["counted"], record=record)
    tables = [{"model": "none"}, {"model": "steady", "critical_speed": "1 cm/s"}]
    sweep = read_sweep({"bonds": tables, "contact.load": [1e-3, 2e-3]})
    check(run(replace(scenario, sweep=sweep), tmp_path / "out.nc"))
