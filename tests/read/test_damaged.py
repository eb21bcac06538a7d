"""A dataset with one variable or attribute that no run writes is read, or refused in one line that names it."""

import gc
import itertools
import shutil
import tomllib
from pathlib import Path

import netCDF4
import numpy as np
import psutil
import pytest
import xarray as xr
from helpers.commands import LENS, SCENE, sim

import sim as package
from sim.numerics.lazy import open_lazily

SHORT = SCENE.replace('"1 s"', '"0.4 s"')
PULLED = """\
[drive]
model = "spring"
stage = "1 mm/s"
stiffness = "1 kN/m"
damping = "10 N s/m"
contact_stiffness = "rigid"
[bonds]
model = "rate"
critical_speed = "10 mm/s"
rebinding_rate = "500 1/s"
stress = "0.3 MPa"
"""
MAPPED = """\
[shear]
model = "modal"
points = 32
[shear.spectrum]
model = "gaussian"
rms = "50 kPa"
length = "10 um"
[shear.correlation]
model = "slip"
length = "5 um"
[record]
quantities = ["contact_area", "friction_force", "fluctuation_energy"]
[sweep]
"contact.load" = ["2 mN", "4 mN"]
"""
SCENES = {
    "ramp": SHORT,
    "spring": LENS.replace('"1 s"', '"0.4 s"').replace('"0.1 s"', '"20 ms"') + PULLED,
    "sweep": SHORT + MAPPED,
}
#: Ways in which a variable is not as it was written.
KINDS = ("removed", "renamed", "shape", "type", "text")
#: Attributes that are given to variables, and what a run writes as attributes of the file.
ATTRIBUTES = {
    "scale_factor": "two",
    "add_offset": "none",
    "units": "furlong",
    "long_name": 5,
}
OTHERWISE = {
    "no attribute": None,
    "another text": "some text",
    "no text": np.array([1.5, 2.5]),
}
OF_THE_FILE = (
    "members",
    "scenario_resolved",
    "scenario_toml",
    "scenario_files",
    "sim_version",
    "seed",
    "title",
)


def damaged(dataset, name, kind):
    """The dataset with a variable changed in one way."""
    values = dataset.variables[name]
    if kind == "removed":
        return dataset.drop_vars(name)
    if kind == "renamed":
        return dataset.rename_vars({name: f"{name}_x"})
    if kind == "shape":
        changed = xr.Variable(
            ("other", *values.dims),
            values.to_numpy()[np.newaxis].repeat(2, 0),
            values.attrs,
        )
    elif kind == "text":
        texts = np.full(values.shape, "some text")
        changed = xr.Variable(values.dims, texts, {})
    else:
        is_text = values.dtype.kind in "OU"
        changed = xr.Variable(
            values.dims, np.ones(values.shape, "f8" if is_text else "i4"), values.attrs
        )
    return dataset.drop_vars(name).assign({name: changed})


def cases(datasets):
    """Every variable of each dataset, each in one way that differs between the datasets, and the attributes."""
    for shift, (scene, dataset) in enumerate(datasets.items()):
        for place, name in enumerate(dataset.variables):
            yield scene, name, KINDS[(place + shift) % len(KINDS)]
        for attribute, name in itertools.product(
            ATTRIBUTES, ("t", "contact_modulus", "contact_radius")
        ):
            yield scene, name, attribute
        for name, kind in itertools.product(OF_THE_FILE, OTHERWISE):
            yield scene, name, kind


def write(dataset, scene, name, kind, path):
    """Write the dataset of a scene with one variable or attribute changed."""
    if kind in KINDS:
        damaged(dataset, name, kind).to_netcdf(path)
        return
    shutil.copy(f"{scene}.nc", path)
    with netCDF4.Dataset(path, "a") as file:
        if kind in ATTRIBUTES:
            file[name].setncattr(kind, ATTRIBUTES[kind])
        elif OTHERWISE[kind] is None:
            file.delncattr(name)
        else:
            file.setncattr(name, OTHERWISE[kind])


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """The datasets as runs write them, in the present folder."""
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(tmp_path_factory.mktemp("datasets"))
        result = {}
        for scene, text in SCENES.items():
            package.run(tomllib.loads(text), f"{scene}.nc").close()
            with xr.open_dataset(
                f"{scene}.nc", decode_times=False, decode_coords=False
            ) as dataset:
                result[scene] = dataset.load()
        yield result


@pytest.fixture
def uncollected():
    """Leave objects that refer to each other where they are, so that none of them closes its file by chance."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def is_open(name):
    """True if this process has a file open."""
    return str(Path(name).absolute()) in {
        file.path for file in psutil.Process().open_files()
    }


@pytest.mark.parametrize("command", ["stats", "plot", "report"])
@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("t", "scale_factor"),
        ("t", "removed"),
        ("contact_modulus", "shape"),
        ("members", "no attribute"),
    ],
)
def test_a_dataset_that_is_refused_is_closed_so_that_windows_lets_it_be_deleted(
    datasets, uncollected, command, name, kind
):
    write(datasets["sweep"], "sweep", name, kind, "refused.nc")
    assert sim(command, "refused.nc").exit_code == 2 and not is_open("refused.nc")
    Path("refused.nc").unlink()


def test_a_file_with_a_variable_that_netcdf_does_not_read_is_closed(
    datasets, uncollected
):
    h5py = pytest.importorskip("h5py")
    with h5py.File("opaque.nc", "w") as file:
        file["opaque"] = np.zeros(2, "V5")
    with pytest.raises(UserWarning, match="opaque"):
        open_lazily("opaque.nc")
    assert not is_open("opaque.nc")
    with open_lazily("ramp.nc"):
        assert is_open("ramp.nc")
    assert not is_open("ramp.nc")


@pytest.mark.parametrize("apart", [61, pytest.param(1, marks=pytest.mark.verify)])
@pytest.mark.parametrize("command", ["stats", "plot", "report"])
def test_a_changed_variable_or_attribute_is_done_without_or_refused_in_one_line_that_names_it(
    datasets, command, apart
):
    wrong, refusals = [], 0
    for number, (scene, name, kind) in enumerate(
        itertools.islice(cases(datasets), 0, None, apart)
    ):
        path = Path(f"{command}-{apart}-{number}.nc")
        write(datasets[scene], scene, name, kind, path)
        done = sim(command, path)
        message = done.stderr.strip().splitlines()
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            wrong.append((scene, name, kind, repr(done.exception)))
        elif done.exit_code:
            refusals += 1
            if (
                done.exit_code != 2
                or not message
                or (str(path) not in done.stderr and name not in done.stderr)
            ):
                wrong.append((scene, name, kind, done.exit_code, message))
        path.unlink()
    assert not wrong and refusals


def test_a_flipped_byte_of_a_coordinate_is_named(datasets):
    h5py = pytest.importorskip("h5py")
    with h5py.File("sweep.nc") as file:
        place = file["t"].id.get_chunk_info(0)
    content = bytearray(Path("sweep.nc").read_bytes())
    content[place.byte_offset] ^= 1
    Path("flipped.nc").write_bytes(content)
    for command in ("stats", "plot", "report"):
        done = sim(command, "flipped.nc")
        assert (done.exit_code, done.stdout) == (2, "")
        assert (
            done.stderr.startswith("flipped.nc: variable t is damaged")
            and done.stderr.count("\n") == 1
        )
