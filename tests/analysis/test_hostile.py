"""Datasets and maps of somebody else: nothing of other files comes out of them, and each is read or refused."""

import os
import shutil
import tomllib
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr
from helpers.commands import SCENE as SCENE_OF_A_SECOND, sim

import sim as package
from sim.plots import field

SCENE = SCENE_OF_A_SECOND.replace('"1 s"', '"0.4 s"')
MAP = """
[shear]
model = "mean"
spectrum = { model = "measured", file = "map.nc", spacing = "5 um" }
"""
SECRET = 271828.1828


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A dataset as a run writes it."""
    path = tmp_path_factory.mktemp("sound") / "out.nc"
    package.run(tomllib.loads(SCENE), path)
    return path


@pytest.fixture
def here(sound, tmp_path, monkeypatch):
    """A folder with a dataset, its scenario, a scenario with a map, and secrets in other files."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(sound, "out.nc")
    Path("scene.toml").write_text(SCENE)
    Path("mapped.toml").write_text(SCENE + MAP)
    np.full(400, SECRET).tofile("secret.bin")
    with h5py.File("secret.h5", "w") as file:
        file["secret"] = np.full((20, 20), SECRET)
    return tmp_path


# --- bytes of other files ---


def external(file, name, shape):
    return file.create_dataset(name, shape, "f8", external=[("secret.bin", 0, 8 * int(np.prod(shape)))])


def virtual(file, name, shape):
    layout = h5py.VirtualLayout(shape, "f8")
    layout[...] = h5py.VirtualSource("secret.h5", "secret", (20, 20))[: shape[0], : shape[1]]
    return file.create_virtual_dataset(name, layout)


def linked(file, name, shape):
    file[name] = h5py.ExternalLink("secret.h5", "secret")


def linked_softly(file, name, shape):
    file["behind"] = h5py.ExternalLink("secret.h5", "secret")
    file[name] = h5py.SoftLink("/behind")


def linked_in_a_group(file, name, shape):
    file.create_group("inner")["behind"] = h5py.ExternalLink("secret.h5", "secret")
    file[name] = h5py.SoftLink("/inner/behind")


LEAKS = [external, virtual, linked, linked_softly, linked_in_a_group]


@pytest.mark.parametrize("leak", LEAKS)
def test_no_bytes_of_another_file_come_out_of_a_dataset(here, leak):
    with h5py.File("out.nc", "a") as file:
        del file["shear_stress"]
        made = leak(file, "shear_stress", (3, 5))
        for place, name in enumerate(("member", "t") if made else ()):
            made.dims[place].attach_scale(file[name])
    for arguments in (["stats", "out.nc", "--csv", "all.csv"], ["plot", "out.nc", "time"], ["report", "out.nc"]):
        done = sim(*arguments)
        assert (done.exit_code, done.stdout) == (2, "")
        assert done.stderr.startswith("out.nc: ") and len(done.stderr.splitlines()) == 1
    with pytest.raises(package.BadInput, match=r"^out\.nc: .*(other files|groups)"):
        package.open("out.nc")
    resumed = sim("run", "scene.toml", "-o", "out.nc", "--resume")
    assert resumed.exit_code == 2 and "271828" not in resumed.output
    assert not Path("all.csv").exists() and not list(here.glob("*.png")) and not Path("out.html").exists()


@pytest.mark.parametrize("leak", LEAKS)
def test_no_bytes_of_another_file_come_out_of_a_map(here, leak):
    with h5py.File("map.nc", "w") as file:
        leak(file, "shear_map", (20, 20))
    done = sim("check", "mapped.toml")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "shear.spectrum.file: map.nc: " in done.stderr


def test_a_dataset_makes_no_figure_read_a_file_it_names(here):
    """A spectrum in the scenario of a dataset may name a file, whose rows are beside it."""
    table = {"model": "tabulated", "file": "secret.csv", "normalization": "in_integral"}
    Path("secret.csv").write_text("q [rad/m], C [Pa^2 m^2]\n1e5, 1\n3e5, 1\n")
    for spectrum in (table, {"model": "measured", "file": "secret.csv", "spacing": 1.0}):
        with pytest.raises(ValueError, match="names a file"):
            field._spectrum(spectrum)


# --- damaged and lying datasets ---


def changed(**attributes):
    def change(file):
        file.setncatts(attributes)

    return change


def described(name, **attributes):
    def change(file):
        file[name].setncatts(attributes)

    return change


def renamed(name):
    return lambda file: file.renameVariable(name, "other")


def lacking(name):
    return lambda file: file.delncattr(name)


def added(name, kind, dims, values):
    def change(file):
        file.createVariable(name, kind, dims)[...] = values

    return change


def compound(file):
    kind = file.createCompoundType(np.dtype([("a", "f8"), ("b", "i4")]), "pair")
    file.createVariable("odd", kind, ("t",))


def enumerated(file):
    kind = file.createEnumType("i1", "flag", {"no": 0, "yes": 1})
    file.createVariable("odd", kind, ("t",))


def ragged(file):
    file.createVariable("odd", file.createVLType("f8", "ragged"), ("t",))


def declared_only(file):
    file.createDimension("big", 10**10)
    file.createVariable("odd", "f8", ("big",), zlib=True, chunksizes=(10**6,))


def along_nothing(file):
    file.createDimension("n", 3)
    file.createVariable("odd", "f8", ("n",))[...] = 1.0


DEEP = "[" * 100_000
NESTED = '{"a":' * 400 + "1" + "}" * 400
CHANGES = {
    "no JSON": changed(scenario_resolved="x"),
    "nested lists": changed(scenario_resolved=DEEP),
    "nested tables": changed(scenario_resolved=NESTED),
    "a number for a scenario": changed(scenario_resolved="1"),
    "numbers for a scenario": changed(scenario_resolved=3),
    "a list for a scenario": changed(scenario_resolved="[]"),
    "a list for a table": changed(scenario_resolved='{"contact": []}'),
    "a number for names": changed(scenario_resolved='{"record": {"quantities": 3}}'),
    "no scenario": lacking("scenario_resolved"),
    "no members": lacking("members"),
    "members in words": changed(members="many"),
    "a long attribute": changed(comment="x" * 100_000),
    "long units": described("t", units="m" * 60_000),
    "units of two lines": described("t", units="m\nm"),
    "units of numbers": described("t", units=3.0),
    "escapes in a symbol": described("t", symbol="\x1b]0;x\x07"),
    "a factor in words": described("contact_area", scale_factor="x"),
    "an offset in words": described("contact_area", add_offset="x"),
    "no modulus": renamed("contact_modulus"),
    "no times": renamed("t"),
    "no work": renamed("adhesion_work"),
    "no load": renamed("contact_load"),
    "text for a modulus": added("contact_front_speed", str, ("t",), np.array(["x"] * 5, object)),
    "numbers along nothing": along_nothing,
    "times and members exchanged": added("odd", "f8", ("t", "member"), 1.0),
    "compound": compound,
    "enum": enumerated,
    "ragged": ragged,
    "declared only": declared_only,
    "a group": lambda file: file.createGroup("inner"),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_changed_dataset_is_refused_in_one_line(here, change):
    with netCDF4.Dataset("out.nc", "a") as file:
        change(file)
    with pytest.raises(package.BadInput) as refused:
        package.open("out.nc")
    (said,) = refused.value.problems
    assert said.startswith("out.nc: ") and said.isprintable() and len(said) < 200


def test_a_changed_dataset_ends_every_command_with_2(here):
    with netCDF4.Dataset("out.nc", "a") as file:
        file.scenario_resolved = NESTED
    commands = (
        ["stats", "out.nc"],
        ["plot", "out.nc"],
        ["report", "out.nc"],
        ["run", "scene.toml", "-o", "out.nc", "--resume"],
    )
    for arguments in commands:
        done = sim(*arguments)
        assert (done.exit_code, done.stdout) == (2, "")
        assert "out.nc" in done.stderr.splitlines()[-1] and len(done.stderr) < 1000


@pytest.mark.verify
def test_a_dataset_lacks_any_variable_and_every_command_has_an_answer(here, sound):
    with netCDF4.Dataset(sound) as file:
        names = list(file.variables)
    for name in names:
        shutil.copy(sound, "less.nc")
        with netCDF4.Dataset("less.nc", "a") as file:
            file.renameVariable(name, "other")
        drawn = [["plot", kind, "--force"] for kind in ("time", "curve")]
        for arguments in (["stats"], ["stats", "--all"], *drawn, ["report", "--force"]):
            done = sim(arguments[0], "less.nc", *arguments[1:])
            assert done.exit_code in (0, 2), (name, arguments, done.exception)
            assert done.exit_code == 0 or done.stderr.count("\n") == 1


@pytest.mark.parametrize("path", ["pipe", "/dev/zero"])
def test_pipes_and_devices_are_not_waited_for(here, path):
    os.mkfifo("pipe")
    assert sim("stats", path).stderr == f"{path}: is no plain file; run the scenario again\n"
    Path("map.toml").write_text((SCENE + MAP).replace("map.nc", path + ".nc"))
    os.symlink(path, "link.nc")
    Path("map.toml").write_text((SCENE + MAP).replace("map.nc", "link.nc"))
    assert "link.nc: is no plain file" in sim("check", "map.toml").stderr


# --- maps ---


def mapped(change, **how):
    """A map of white noise, changed."""
    field = np.random.Generator(np.random.Philox(key=1)).standard_normal((16, 16))
    xr.Dataset({"shear_map": (("row", "column"), field)}).to_netcdf("map.nc", **how)
    with netCDF4.Dataset("map.nc", "a") as file:
        change(file)
    return sim("check", "mapped.toml")


def test_a_map_without_a_change_is_read(here):
    assert mapped(lambda file: None).exit_code == 0
    assert mapped(lambda file: None, format="NETCDF3_CLASSIC").exit_code == 0
    packed = {"shear_map": {"dtype": "i2", "scale_factor": 1e-3, "add_offset": 0.1, "_FillValue": -9999, "zlib": True}}
    assert mapped(lambda file: None, encoding=packed).exit_code == 0


@pytest.mark.parametrize("name", ["scale_factor", "add_offset", "missing_value", "valid_min"])
def test_a_map_whose_numbers_are_scaled_by_words_is_refused(here, name):
    done = mapped(described("shear_map", **{name: "x"}))
    assert done.exit_code == 2
    assert f"map.nc: holds an attribute that must be a number: {name}" in done.stderr


@pytest.mark.parametrize("side", [8192, 20_000, 10**6])
def test_a_map_that_is_declared_and_not_there_is_refused(here, side):
    def declared(file):
        file.createDimension("x", side)
        file.createVariable("large", "f8", ("x", "x"), zlib=True, chunksizes=(512, 512))[0, 0] = 1.0

    Path("mapped.toml").write_text((SCENE + MAP).replace("file =", 'variable = "large", file ='))
    done = mapped(declared)
    assert done.exit_code == 2
    assert "map.nc: declares more numbers" in done.stderr


def test_a_map_of_many_numbers_is_refused_before_it_is_read(here, monkeypatch):
    monkeypatch.setattr("sim.spectrum.map_file._MOST", 255)
    assert '"shear_map" has more than' in mapped(lambda file: None).stderr


def test_a_list_without_an_end_is_refused(here):
    """HDF5 reads it for ever."""
    mapped(lambda file: None)
    content = bytearray(Path("map.nc").read_bytes())
    at = content.index(b"GCOL") + 16
    content[at : at + 16] = b"\xff" * 16
    Path("map.nc").write_bytes(content)
    assert "map.nc: is not a netCDF file" in sim("check", "mapped.toml").stderr


def test_classic_netcdf_that_declares_more_than_its_file_is_refused(here):
    mapped(lambda file: None, format="NETCDF3_CLASSIC")
    content = bytearray(Path("map.nc").read_bytes())
    at = content.index((16).to_bytes(4, "big"))
    content[at : at + 4] = (2**28).to_bytes(4, "big")
    Path("map.nc").write_bytes(content)
    done = sim("check", "mapped.toml")
    assert done.exit_code == 2 and "map.nc: " in done.stderr


# --- what messages show of a file ---

HIDDEN = {
    "shadow": "root:*:20228:0:99999:7:::\ndaemon:*:20228:0:99999:7:::\n",
    "token": "ghp_0123456789abcdefghij\n",
    "environment": "API_KEY=abc\0HOME=/root\n",
    "password": "hunter2\n1\n",
    "columns": "alice,hunter2\nbob,swordfish\n",
    "numbers": "time [s], speed [m/s]\n0,1\n1,hunter2\n",
    "unit": "time [s], speed [hunter2]\n0,1\n",
    "negative": "time [s], speed [m/s]\n-31415,1\n",
}


@pytest.mark.parametrize("text", HIDDEN.values(), ids=HIDDEN)
def test_no_message_shows_what_stands_in_a_file_elsewhere(here, text):
    outside = here / "secret.csv"
    outside.write_text(text)
    (here / "in").mkdir()
    os.symlink(outside, here / "in" / "link.csv")
    for name in (str(outside), "../secret.csv", "link.csv"):
        for drive in (f'model = "table"\nfile = "{name}"\n', f'model = "steady"\nspeed = 1\n[shear]\n{spectrum(name)}'):
            scenario = here / "in" / "scene.toml"
            head, rest = SCENE.split('model = "ramp"\nfrom = "1 mm/s"\nto = "20 mm/s"\n')
            scenario.write_text(head + drive + rest)
            said = sim("check", scenario).stderr
            assert said
            for word in ("root", "ghp", "abc", "HOME", "hunter2", "alice", "swordfish", "31415"):
                assert word not in said.replace(str(here), "")


def spectrum(name):
    return f'model = "mean"\nspectrum = {{ model = "measured", file = "{name}", spacing = "1 um" }}\n'


def test_names_of_columns_are_shown_of_a_table_beside_the_scenario(here):
    Path("v.csv").write_text("time [s], sped [m/s], x=3\n0,1,2\n")
    Path("scene.toml").write_text(
        SCENE.replace('model = "ramp"\nfrom = "1 mm/s"\nto = "20 mm/s"', 'model = "table"\nfile = "v.csv"')
    )
    assert "(found: time, sped)" in sim("check", "scene.toml").stderr
