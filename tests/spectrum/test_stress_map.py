"""A measured map as it is: its energy, its mean, its mask, and the faults of its files."""

import math
import os
import pickle
import tomllib

import numpy as np
import pytest
import xarray as xr
from helpers.commands import LENS
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError

from sim.laws import halfspace
from sim.scenario.files import Files
from sim.scenario.reader import load
from sim.solid import HalfSpace
from sim.spectrum.families import Ripple
from sim.spectrum.measured import Measured, StressMap
from sim.spectrum.radial import disc_energy

G, NU = 1.6e6, 0.3
FIELD = np.random.default_rng(7).normal(size=(24, 16)) * 1e5 + 4e4
PIXEL, PIXEL_Y = 5e-6, 7e-6


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path)


def read(files, **keys):
    return TypeAdapter(StressMap).validate_python(
        keys, context={"files": Files(files.folder)}
    )


def written(files, name, field=FIELD):
    """A file of a map (x, y), by the ending of its name; rows of text and npy are y."""
    path = files.folder / name
    if name.endswith(".npy"):
        np.save(path, field.T)
    elif name.endswith(".nc"):
        axes = {
            "x": np.arange(field.shape[0]) * PIXEL * 1e6,
            "y": np.arange(field.shape[1]) * PIXEL_Y * 1e6,
        }
        data = xr.Dataset({"shear_map": (("y", "x"), field.T * 1e-3, {"units": "kPa"})})
        data.assign_coords(
            {k: (k, v, {"units": "um"}) for k, v in axes.items()}
        ).to_netcdf(path)
    else:
        np.savetxt(path, field.T, delimiter=",", fmt="%.17g")
    return name


@pytest.mark.parametrize("name", ["map.csv", "map.npy", "map.nc"])
def test_the_energy_of_a_map_is_that_of_its_file(files, name):
    keys = {} if name.endswith(".nc") else {"pixel": "5 um", "pixel_y": "7 um"}
    result = read(files, file=written(files, name), **keys)
    exact = halfspace.surface_energy(FIELD, (24 * PIXEL, 16 * PIXEL_Y), G, NU)
    assert_allclose(
        HalfSpace(G, NU, coupling=0.0).stored_energy(result), exact, rtol=1e-12
    )
    assert_allclose(result.mean, FIELD.mean(), rtol=1e-12)
    assert_allclose(result.rms, FIELD.std(), rtol=1e-12)
    assert_allclose(result.field, FIELD - FIELD.mean(), rtol=0.0, atol=1e-9)
    # which exchanges x and y, where the file does not name them
    turned = read(files, file=name, rows="x", **keys)
    assert turned.shape == ((24, 16) if name.endswith(".nc") else (16, 24))
    again = TypeAdapter(StressMap).validate_python(
        TypeAdapter(StressMap).dump_python(result)
    )
    assert again == result and hash(again) == hash(result)
    # a digest, not the numbers
    assert len(TypeAdapter(StressMap).dump_python(result, mode="json")["values"]) == 64


def test_a_map_whose_arguments_go_by_position_is_that_by_their_names(files):
    path = str(files.folder / written(files, "map.csv"))
    by_name = StressMap(file=path, pixel=PIXEL, pixel_y=PIXEL_Y)
    assert by_name.shape == FIELD.shape
    assert StressMap(path, PIXEL, PIXEL_Y) == by_name


def test_a_map_has_the_unit_of_its_file_or_of_the_key_and_axes_without_units_the_pixels_of_the_key(
    files,
):
    kilo = FIELD * 1e-3
    for name, unit in (
        ("a.csv", "kPa"),
        ("a.npy", "kPa"),
        ("b.csv", ""),
        ("b.csv", "kPa"),
    ):
        written(files, name, kilo)
        if name == "b.csv":
            np.savetxt(
                files.folder / name,
                kilo.T,
                delimiter=",",
                fmt="%.17g",
                header="stress in kPa",
            )
        assert_allclose(
            read(files, file=name, pixel=PIXEL, unit=unit).mean,
            FIELD.mean(),
            rtol=1e-12,
        )
    for unit, fault in (
        ("MPa", "MPa and kPa"),
        ("mm", "not a unit of Pa"),
        (3, "string"),
    ):
        with pytest.raises(ValidationError, match=fault):
            read(files, file="b.csv", pixel=1e-6, unit=unit)
    data = xr.load_dataset(files.folder / written(files, "map.nc"))
    with pytest.raises(ValidationError, match="is in kPa, not in MPa"):
        read(files, file="map.nc", unit="MPa")
    data["shear_map"].attrs, axes = {}, {"x": np.arange(24.0), "y": np.arange(16.0)}
    data.assign_coords(axes).to_netcdf(files.folder / "bare.nc")
    with pytest.raises(ValidationError, match="no coordinates with units; give pixel"):
        read(files, file="bare.nc", unit="kPa")
    result = read(files, file="bare.nc", unit="kPa", pixel=PIXEL, pixel_y=PIXEL_Y)
    assert_allclose(
        HalfSpace(G, NU, coupling=0.0).stored_energy(result),
        HalfSpace(G, NU, coupling=0.0).stored_energy(read(files, file="map.nc")),
        rtol=1e-12,
    )
    np.savetxt(
        files.folder / "index.csv",
        np.c_[np.arange(16), kilo.T],
        delimiter=",",
        fmt="%.9g",
    )
    with pytest.raises(ValidationError, match="only numbers"):
        read(files, file="index.csv", pixel=1e-6)


@pytest.mark.parametrize("model", ["mapped", "mean"])
@pytest.mark.parametrize(("factor", "count"), [(1.0, 0), (1e-3, 1), (1e3, 1)])
def test_a_map_that_is_a_thousand_times_off_the_stress_of_the_bonds_is_remarked(
    tmp_path, model, factor, count
):
    np.save(tmp_path / "map.npy", FIELD.T * factor)
    shear = {"model": model, "paid_by_adhesion": 0.0}
    if model == "mean":
        shear |= {
            "spectrum": {
                "model": "measured",
                "file": str(tmp_path / "map.npy"),
                "spacing": PIXEL,
            }
        }
    else:
        shear |= {"field": {"file": str(tmp_path / "map.npy"), "pixel": PIXEL}}
    scene = load(
        tomllib.loads(LENS)
        | {"bonds": {"model": "none", "stress": "0.1 MPa"}, "shear": shear}
    )
    assert sum(".unit right?" in remark for remark in scene.remarks()) == count


def test_a_window_keeps_the_rms_and_takes_the_seam(files):
    x = (np.arange(64) + 0.5) / 64
    # which ends elsewhere than it begins
    ramp = (1e5 * (x - 0.5))[:, None] * np.ones(64) + 3e4
    name = written(files, "map.csv", ramp)
    plain, hann = (
        read(files, file=name, pixel=1e-6, window=window) for window in ("none", "hann")
    )
    weight = (1 - np.cos(2 * np.pi * x))[:, None] * (1 - np.cos(2 * np.pi * x))
    exact = (ramp - np.mean(ramp * weight)) * weight / math.sqrt(np.mean(weight**2))
    assert_allclose(
        HalfSpace(G).stored_energy(hann),
        halfspace.surface_energy(exact, 64e-6, G),
        rtol=1e-12,
    )
    assert_allclose(
        HalfSpace(G).stored_energy(plain),
        halfspace.surface_energy(ramp, 64e-6, G),
        rtol=1e-12,
    )
    assert_allclose(hann.mean, plain.mean, rtol=1e-12)


@pytest.mark.parametrize("pixels", [16, 32, 64])
def test_the_stress_of_a_contact_in_a_mask_is_that_of_a_free_disc(files, pixels):
    # q a = 3.8317 makes the mean of cos(qx) over the disc zero, so that no mean is taken off
    x = (np.arange(-pixels - 3, pixels + 3) + 0.5) / pixels
    inside = np.hypot(x[:, None], x) < 1.0
    energy = []
    for phase in (0.0, 0.5 * math.pi):
        wave = np.cos(3.831705970207512 * x + phase)[:, None] * np.ones(x.size)
        keys = {
            "file": written(files, "map.csv", np.where(inside, wave, np.nan)),
            "pixel": 1.0 / pixels,
            "mask": True,
        }
        result = read(files, **keys)
        assert_allclose(result.inside, inside.mean(), rtol=1e-12)
        assert np.all(result.field[~inside] == 0.0)
        energy.append(HalfSpace(1.0, NU, coupling=0.0).stored_energy(result))
    # pixels at the edge are inside or not: that shifts it by less than a fifth of a pixel, and E goes as a to 3 at most
    exact = disc_energy(
        Ripple(1.0, 2.0 * math.pi / 3.831705970207512),
        1.0,
        HalfSpace(1.0, NU, coupling=0.0).softness,
    )
    assert_allclose(np.mean(energy), exact, rtol=3 * 0.2 / pixels)


def test_the_noise_and_the_radial_spectrum_of_a_map_are_reported(files):
    result = read(files, file=written(files, "map.csv"), pixel="5 um", noise="2 kPa")
    assert HalfSpace(G).stored_energy(
        read(files, file="map.csv", pixel="5 um")
    ) == HalfSpace(G).stored_energy(result)
    exact = TypeAdapter(Measured).validate_python(
        {"file": "map.csv", "spacing": 5e-6}, context={"files": Files(files.folder)}
    )
    assert_allclose(result.spectrum.densities, exact.densities, rtol=1e-9)


class Payload:
    def __reduce__(self):
        return os.mkdir, ("was-executed",)


WRONG_ARRAYS = {
    "pickled": np.array([[Payload()] * 9] * 9, dtype=object),
    "complex": FIELD + 1j,
    "flat": np.arange(64.0),
    "empty": np.zeros((0, 9)),
    "many": np.stack([FIELD, FIELD]),
}


def test_an_array_that_is_no_map_is_refused_and_nothing_in_it_is_executed(
    files, monkeypatch
):
    monkeypatch.chdir(files.folder)
    for kind, array in WRONG_ARRAYS.items():
        np.save(files.folder / f"{kind}.npy", array, allow_pickle=True)
    np.save(files.folder / "whole.npy", FIELD)
    whole = (files.folder / "whole.npy").read_bytes()
    wrong_bytes = {
        "pickle": pickle.dumps(Payload()),
        "short": whole[:-8],
        "head": whole[:20],
        "vast": whole.replace(b"'shape': (24, 16), }   ", b"'shape': (99999999, 9)}"),
    }
    for kind, content in wrong_bytes.items():
        (files.folder / f"{kind}.npy").write_bytes(content)
    for kind in WRONG_ARRAYS | wrong_bytes:
        with pytest.raises(ValidationError, match=kind):
            read(files, file=f"{kind}.npy", pixel=1e-6)
        assert not (files.folder / "was-executed").exists()


def test_a_map_that_cannot_be_the_field_is_refused_with_the_cure(files):
    for field, keys, fault in [  # field, keys, fault
        (FIELD, {}, "give pixel"),
        (FIELD, {"pixel": "0 um"}, "above 0"),
        (FIELD, {"pixel": 1e-6, "window": "box"}, "'none' or 'hann'"),
        (np.where(FIELD < 0.0, np.nan, FIELD), {"pixel": 1e-6}, "gaps .* mask = true"),
        (FIELD, {"pixel": 1e-6, "mask": True, "window": "hann"}, "omit it with mask"),
        (FIELD, {"pixel": 1e-6, "mask": True, "pixel_y": 2e-6}, "square pixels"),
        (FIELD * np.inf, {"pixel": 1e-6, "mask": True}, "finite"),
        (FIELD * 0.0 + 3.0, {"pixel": 1e-6}, "the stress is uniform"),
        (FIELD[:7], {"pixel": 1e-6}, "too small"),
        (FIELD, {"pixel": 1e-6, "values": "YQ=="}, "values\n.* valid bytes"),
    ]:
        with pytest.raises(ValidationError, match=fault):
            read(files, file=written(files, "map.csv", field), **keys)
    whole = xr.load_dataset(files.folder / written(files, "map.nc"))
    for change, keys, fault in [
        (lambda data: data.rename(shear_map="heights"), {}, 'no variable "shear_map"'),
        (lambda data: data.expand_dims(member=2), {}, "2 maps"),
        (lambda data: data, {"pixel": "6 um"}, "5e-06 m apart, not 6e-06 m"),
    ]:
        change(whole).to_netcdf(files.folder / "changed.nc")
        with pytest.raises(ValidationError, match=fault):
            read(files, file="changed.nc", **keys)
