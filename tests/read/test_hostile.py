"""Damaged and foreign datasets and maps get one clear message; no message shows what stands in a file elsewhere."""

import os
import re
import shutil
import tomllib
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from helpers.cases import posix
from helpers.commands import SCENE as SCENE_OF_A_SECOND, sim

import sim as package
from sim.numerics.lazy import Damaged

SCENE = SCENE_OF_A_SECOND.replace('"1 s"', '"0.4 s"')
MAP = """
[shear]
model = "mean"
spectrum = { model = "measured", file = "map.nc", spacing = "5 um" }
"""


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A dataset as a run writes it."""
    path = tmp_path_factory.mktemp("sound") / "out.nc"
    package.run(tomllib.loads(SCENE), path).close()
    return path


@pytest.fixture
def folder(sound, tmp_path, monkeypatch):
    """A folder with a dataset, its scenario and a scenario with a map."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(sound, "out.nc")
    Path("scene.toml").write_text(SCENE, encoding="utf-8")
    Path("mapped.toml").write_text(SCENE + MAP, encoding="utf-8")
    return tmp_path


def edited(change):
    def edit():
        with netCDF4.Dataset("out.nc", "a") as file:
            change(file)

    return edit


def cut_short():
    Path("out.nc").write_bytes(Path("out.nc").read_bytes()[:5000])


FAULTS = {
    "text": lambda: Path("out.nc").write_text("a, b\n1, 2\n", encoding="utf-8"),
    "cut short": cut_short,
    "foreign": lambda: xr.Dataset({"x": ("y", np.ones(3))}).to_netcdf("out.nc"),
    "no scenario": edited(
        lambda file: file.setncattr("scenario_resolved", "[" * 100_000)
    ),
    "no members": edited(lambda file: file.delncattr("members")),
    "no times": edited(lambda file: file.renameVariable("t", "other")),
}


@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_a_damaged_or_foreign_dataset_is_refused_in_one_line_by_every_command(
    folder, fault
):
    fault()
    with pytest.raises(package.BadInput) as refused:
        package.open("out.nc")
    (message,) = refused.value.problems
    assert (
        message.startswith("out.nc: ") and message.isprintable() and len(message) < 200
    )
    for command in ("stats", "plot", "report"):
        done = sim(command, "out.nc")
        assert (done.exit_code, done.stdout, done.stderr.strip()) == (2, "", message)
    assert sim("run", "scene.toml", "-o", "out.nc", "--resume").exit_code in (2, 73)


@posix
def test_pipes_are_not_waited_for(folder):
    os.mkfifo("map.nc")
    for command, name in (("stats", "map.nc"), ("check", "mapped.toml")):
        done = sim(command, name)
        assert done.exit_code == 2 and re.search(
            "is no plain file|is not a regular file", done.stderr
        )


def flipped(path, name):
    """Copies of a file, each with one byte changed in the numbers of a variable."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path) as file:
        place = file[name].id.get_chunk_info(0)
    content = Path(path).read_bytes()
    for at in range(
        place.byte_offset, place.byte_offset + place.size, max(1, place.size // 20)
    ):
        Path("flipped.nc").write_bytes(
            content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]
        )
        yield Path("flipped.nc")


def test_a_changed_byte_of_a_recorded_variable_or_a_checksummed_map_is_named_and_never_read(
    folder,
):
    for compression in ("none", "zlib"):
        written = tomllib.loads(SCENE) | {"record": {"compression": compression}}
        with package.run(written, f"{compression}.nc") as dataset:
            dataset.load()
        for path in flipped(f"{compression}.nc", "contact_area"):
            with package.open(path) as damaged:
                with pytest.raises(
                    Damaged, match=r"^flipped\.nc: variable contact_area is damaged"
                ):
                    damaged["contact_area"].load()
                xr.testing.assert_equal(
                    damaged["contact_radius"].load(), dataset["contact_radius"]
                )
    done = sim("stats", "flipped.nc")
    assert (done.exit_code, done.stdout) == (2, "")
    assert (
        done.stderr.startswith("flipped.nc: variable contact_area is damaged")
        and done.stderr.count("\n") == 1
    )
    noise = np.random.Generator(np.random.Philox(key=1)).standard_normal((16, 16))
    maps = xr.Dataset({"shear_map": (("row", "column"), noise)})
    maps.to_netcdf(
        "sound.nc", encoding={"shear_map": {"fletcher32": True, "zlib": True}}
    )
    shutil.copy("sound.nc", "map.nc")
    assert sim("check", "mapped.toml").exit_code == 0
    shutil.copy(next(flipped("sound.nc", "shear_map")), "map.nc")
    done = sim("check", "mapped.toml")
    assert (
        done.exit_code == 2
        and "map.nc" in done.stderr
        and "shear_map is damaged" in done.stderr
    )


def test_maps_of_netcdf_in_its_formats_are_read_and_other_files_are_refused(
    folder, monkeypatch
):
    noise = np.random.Generator(np.random.Philox(key=1)).standard_normal((16, 16))
    maps = xr.Dataset({"shear_map": (("row", "column"), noise)})
    packed = {
        "shear_map": {
            "dtype": "i2",
            "scale_factor": 1e-3,
            "add_offset": 0.1,
            "_FillValue": -9999,
            "zlib": True,
        }
    }
    for options in ({}, {"format": "NETCDF3_CLASSIC"}, {"encoding": packed}):
        maps.to_netcdf("map.nc", **options)
        assert sim("check", "mapped.toml").exit_code == 0
    with monkeypatch.context() as patched:
        patched.setattr("sim.spectrum.measured._MOST", 255)
        assert '"shear_map" has more than' in sim("check", "mapped.toml").stderr
    Path("map.nc").write_bytes(Path("map.nc").read_bytes()[:2000])
    assert "map.nc: is not a netCDF file" in sim("check", "mapped.toml").stderr


def test_statistics_without_members_are_read_from_a_file_and_those_of_version_1_are_refused(
    folder,
):
    alone = {"record.per_member": False, "ensemble.members": 3}
    package.run(package.load("scene.toml", alone), "alone.nc").close()
    with package.open("alone.nc") as dataset:
        assert dataset["contact_area"].sizes["statistic"] == 3
        old = dataset.load().drop_dims("statistic")
        for kind, values in zip(
            ("mean", "std", "sem"), dataset["contact_area"], strict=True
        ):
            old[f"contact_area_{kind}"] = values.drop_vars("statistic")
        old.to_netcdf("old.nc")
    for command in (["stats"], ["report", "--force"], ["plot", "time", "--force"]):
        done = sim(command[0], "alone.nc", *command[1:])
        assert done.exit_code == 0, done.stderr
    done = sim("stats", "old.nc")
    assert done.exit_code == 2 and "form of version 1; run the scenario" in done.stderr


def test_a_dataset_of_an_older_version_says_what_it_lacks(folder):
    with package.open("out.nc") as dataset:
        dataset.load().drop_vars(["peak_friction", "bonds_radius"]).to_netcdf("old.nc")
    for command in (["stats"], ["plot", "time"]):
        done = sim(command[0], "old.nc", *command[1:])
        assert done.exit_code == 0 and done.stderr.count("\n") == 1
        assert all(
            words in done.stderr
            for words in ("old.nc", "lost to bonds", "peak of friction")
        )
        assert "masked" not in done.stderr
    assert sim("stats", "out.nc").stderr == ""


def test_a_dataset_without_adhesion_lacks_nothing(folder):
    with package.open("out.nc") as dataset:
        lacks_masking = dataset.load().drop_vars(["time_masked", "masked"])
    lacks_masking.to_netcdf("old.nc")
    assert "masked" in sim("stats", "old.nc").stderr
    changes = ["--set", 'adhesion.work="0 J/m^2"', "-o", "bare.nc", "--no-table"]
    assert sim("run", "scene.toml", *changes).exit_code == 0
    for command in (["stats"], ["report"], ["plot", "time"]):
        done = sim(command[0], "bare.nc", *command[1:])
        assert done.exit_code == 0 and done.stderr == ""


@pytest.mark.parametrize(
    "text",
    ["alice,hunter2\nbob,swordfish\n", "time [s], speed [m/s]\n-31415,hunter2\n"],
)
def test_no_message_shows_what_stands_in_a_file_elsewhere(folder, text):
    outside = folder / "secret.csv"
    outside.write_text(text, encoding="utf-8")
    spectrum = 'model = "mean"\nspectrum = {{ model = "measured", file = "{}", spacing = "1 um" }}\n'
    (folder / "in").mkdir()
    scenario = folder / "in" / "scene.toml"
    head, rest = SCENE.split('model = "ramp"\nfrom = "1 mm/s"\nto = "20 mm/s"\n')
    for name in (outside.as_posix(), "../secret.csv"):
        for drive in (
            f'model = "table"\nfile = "{name}"\n',
            f'model = "steady"\nspeed = 1\n[shear]\n{spectrum}',
        ):
            scenario.write_text(head + drive.format(name) + rest, encoding="utf-8")
            message = sim("check", scenario).stderr.replace(str(folder), "")
            assert message and not any(
                word in message for word in ("alice", "hunter2", "swordfish", "31415")
            )


def test_files_of_a_scenario_without_texts_do_not_keep_an_output_from_being_replaced(
    folder,
):
    edited(lambda file: file.setncattr("scenario_files", '{"map.csv": 1}'))()
    Path("rows.csv").write_text("a, b\n", encoding="utf-8")
    result = sim("stats", "out.nc", "--csv", "rows.csv", "--force")
    assert result.exit_code == 0 and Path("rows.csv").stat().st_size > 100
