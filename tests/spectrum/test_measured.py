"""Spectra from tables and stress maps: conventions, estimates, files and their faults."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers.fields import field_of
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError

from sim.numerics.grid import Grid
from sim.scenario.files import Files
from sim.solid import HalfSpace
from sim.spectrum import (
    Measured,
    SelfAffine,
    Spectrum,
    Tabulated,
    periodogram,
    radial_average,
)
from sim.spectrum.measured import estimate, tapered

TURN = 2 * math.pi


@pytest.fixture
def files(tmp_path):
    return Files(tmp_path)


def read(files, **keys):
    return TypeAdapter(Spectrum).validate_python(
        keys, context={"files": Files(files.folder)}
    )


def white_map(points, level, cell, seed=1):
    """A stress map whose density is ``level`` at every wavevector but zero, with random phases."""
    generator = np.random.default_rng(seed)
    grid = Grid(cell, points)
    half = grid.forward(generator.normal(size=(points, points)))
    half *= math.sqrt(level) * cell / np.abs(half)
    half[0, 0] = 0.0
    return field_of(grid, half)


def test_a_table_in_persson_s_convention_is_four_pi_squared_larger_and_may_fall():
    rows = (1.0, 2.0, 4.0), (3.0, 2.0, 0.5)
    plain, persson = Tabulated(*rows), Tabulated(*rows, normalization="in_density")
    factor = 4 * math.pi**2
    assert_allclose(
        persson.radial_density(1.7),
        factor * plain.radial_density(1.7),
        rtol=1e-15,
        atol=0,
    )
    assert_allclose(persson.variance, factor * plain.variance, rtol=1e-15, atol=0)
    assert_allclose(
        HalfSpace(1.0).stored_energy(persson),
        factor * HalfSpace(1.0).stored_energy(plain),
        rtol=1e-15,
        atol=0,
    )
    rows = np.array([1.0, 2.0, 4.0]), np.array([3.0, 2.0, 0.5])
    rising, falling = Tabulated(*rows), Tabulated(rows[0][::-1], rows[1][::-1])
    q = np.geomspace(1.0, 4.0, 9)
    assert np.array_equal(rising.radial_density(q), falling.radial_density(q))
    assert (rising.support, rising.variance) == (falling.support, falling.variance)


def test_a_table_is_read_from_csv_with_its_units_or_a_header_that_is_given(files):
    (files.folder / "psd.csv").write_text(
        "# rubber\nq [rad/mm], C [kPa^2 um^2]\n1, 2\n3, 4\n", encoding="utf-8"
    )
    table = read(files, model="tabulated", file="psd.csv", normalization="in_density")
    assert_allclose(table.wavenumbers, [1e3, 3e3], rtol=1e-15, atol=0)
    assert_allclose(table.densities, [2e-6, 4e-6], rtol=1e-15, atol=0)
    assert_allclose(
        table.radial_density(3e3), 4e-6 * 4 * math.pi**2, rtol=1e-13, atol=0
    )
    (files.folder / "psd.csv").unlink()  # which is not read again
    assert read(files, **TypeAdapter(Tabulated).dump_python(table)) == table
    q, density = np.geomspace(1.0, 4.0, 5), np.array([2.0, 1.0, 0.5, 0.2, 0.1])
    np.savetxt(
        files.folder / "psd.txt", np.c_[q, density], header="wavevector, density"
    )
    result = read(
        files, model="tabulated", file="psd.txt", header="q [cycles/um], C [kPa^2 um^2]"
    )
    assert_allclose(result.wavenumbers, q * TURN * 1e6, rtol=1e-15, atol=0)
    assert_allclose(result.densities, density * 1e-6, rtol=1e-15, atol=0)


def test_a_wrong_table_is_refused_with_file_line_and_cure(files):
    for text, fault in [
        ("q [rad/m], C [Pa^2 m^2]\n1, 2\n", "at least two rows"),
        ("q [rad/m], C [Pa^2 m^2]\n3, 1\n1, 1\n2, 1", "row 3 .* sort"),
        ("q [rad/m], C [Pa^2 m^2]\n1, 0\n2, 0\n", "every density is zero"),
        ("q [rad/m], C [Pa^2 m^2]\n1, 0\n2, 1\n3, 0\n4, 1\n5, 0", "row 3 is zero"),
        (
            "q [1/um], C [Pa^2 m^2]\n1, 1\n2, 1\n",
            'psd.csv: line 1: column "q" .* "rad/um"',
        ),
        ("q [rad/m], C [um^4]\n1, 1\n2, 1\n", 'column "C" .* spectrum of heights'),
        ("q [rad/m], C [kPa^2 um]\n1, 1\n2, 1\n", "spectrum of a line"),
    ]:
        (files.folder / "psd.csv").write_text(text)
        with pytest.raises(ValidationError, match=fault):
            read(files, model="tabulated", file="psd.csv")
    with pytest.raises(ValidationError, match=r'needs file = "psd.csv"'):
        read(files, model="tabulated")


def test_a_table_between_its_rows_is_a_power_law_or_linear_next_to_a_zero():
    law = SelfAffine(1.3, 0.7, longest=6.0, rolloff=6.0, shortest=0.2)
    low, high = law.support
    q = np.geomspace(low, high, 7)
    q[[0, -1]] = low, high
    table = Tabulated(q, law.radial_density(q))
    between = np.geomspace(low * 1.001, high * 0.999, 50)
    assert_allclose(
        table.radial_density(between), law.radial_density(between), rtol=1e-13, atol=0
    )
    assert_allclose(table.variance, law.variance, rtol=1e-13, atol=0)
    assert_allclose(
        HalfSpace(2.0, 0.3, coupling=0.0).stored_energy(table),
        HalfSpace(2.0, 0.3, coupling=0.0).stored_energy(law),
        rtol=1e-13,
        atol=0,
    )
    linear = Tabulated((1.0, 3.0, 4.0), (0.0, 4.0, 0.0)).radial_density(
        [1.0, 2.0, 3.0, 3.5, 4.0, 4.1]
    )
    assert_allclose(linear, [0, 2, 4, 2, 0, 0], rtol=1e-15, atol=0)
    assert 0.0 < Tabulated((1e-3, 1.0, 1e3), (1e-39, 1e39, 1e-39)).variance < math.inf


def test_periodogram_sums_to_the_mean_square_is_flat_for_white_noise_and_a_ripple_at_its_wavevector():
    for points in [15, 16]:
        field = np.random.default_rng(2).normal(size=(3, points, points)) + 7.0
        grid = Grid(2.0, points)
        total = (
            np.sum(grid.multiplicity * periodogram(field, 2.0), axis=(1, 2)) / 2.0**2
        )
        assert_allclose(total, np.var(field, axis=(1, 2)), rtol=1e-13, atol=0)
    with pytest.raises(ValueError, match='"none" or "hann"'):
        periodogram(np.ones((8, 8)), 1.0, "box")
    grid = Grid(2.0, 16)
    y = grid.spacing * np.arange(16)
    x = y[:, None]
    density = periodogram(np.cos(TURN * (3 * x - 2 * y) / 2.0), 2.0)
    place = np.unravel_index(np.argmax(density), density.shape)
    assert place == (16 - 3, 2)
    assert_allclose(density[place], 2.0**2 / 4, rtol=1e-13, atol=0)
    for points in [15, 16]:
        for window in ["none", "hann"]:
            cell, count = 3.0, 400
            grid = Grid(cell, points)
            field = np.random.default_rng(4).normal(size=(count, points, points))
            density = np.mean(periodogram(field, cell, window), axis=0)
            level = grid.spacing**2  # unit variance spread over (2π/spacing)²
            inner = density[2:-2, 2:-2] / level  # away from what the mean takes with it
            # Hann correlates neighbouring amplitudes by 2/3 and 1/6, powers by the squares, in each direction
            clumps = (
                (1 + 2 * (2 / 3) ** 2 + 2 * (1 / 6) ** 2) ** 2
                if window == "hann"
                else 1.0
            )
            assert abs(np.mean(inner) - 1) < 5 * math.sqrt(
                clumps / (count * inner.size)
            )
            assert np.all(np.abs(inner - 1) < 5 / math.sqrt(count))
            assert density[0, 0] == 0.0


def test_rings_hold_every_mode_once_with_the_standard_error_of_exponential_scatter():
    for points in [15, 16]:
        grid = Grid(2.0, points)
        ring = radial_average(np.ones((points, points // 2 + 1)), grid)
        reach = (points - 1) // 2
        n = np.arange(-reach - 1, reach + 2)
        radius = np.hypot(n[:, None], n)
        for k in range(1, reach + 1):
            inside = (radius >= k - 0.5) & (radius < k + 0.5)
            assert ring.pairs[k - 1] == inside.sum() / 2
            assert_allclose(
                ring.q[k - 1], np.mean(radius[inside]) * TURN / 2.0, rtol=1e-14, atol=0
            )
        assert len(ring.q) == reach
        assert_allclose(ring.density, 1.0, rtol=1e-14, atol=0)
        assert np.max(ring.standard_error) < 1e-15
    grid = Grid(1.0, 101)
    ring = radial_average(
        periodogram(np.random.default_rng(3).normal(size=(101, 101)), 1.0), grid
    )
    # one for an exponential law
    ratio = (ring.standard_error * np.sqrt(ring.pairs) / ring.density)[20:]
    # scatter over mean of n exponential numbers has variance (2 + 1 - 2)/n: that of s, of m, their covariance
    error = 1 / math.sqrt(np.sum(ring.pairs[20:]))
    assert abs(np.average(ratio, weights=ring.pairs[20:]) - 1) < 5 * error
    level = grid.spacing**2
    assert np.all(np.abs(ring.density - level) < 5 * level / np.sqrt(ring.pairs))


def rough_map(kind, nx, ny):
    """Maps whose density is not smooth, and a smooth one."""
    generator = np.random.default_rng(5)
    x, y = np.arange(nx)[:, None] / nx, np.arange(ny) / ny
    waves = 5.0 * np.sin(TURN * 3 * x) + 3.0 * np.cos(TURN * 4 * y)
    return {
        "two waves": waves,
        "waves and noise": waves + 0.1 * generator.normal(size=(nx, ny)),
        "noise": generator.normal(size=(nx, ny)),
        "longest wave": np.cos(TURN * x) * np.ones(ny),
        "shortest wave": np.cos(np.pi * (np.arange(nx)[:, None] + np.arange(ny))),
        "slope": 2.0 * x + y,
    }[kind]


@pytest.mark.parametrize("window", ["none", "hann"])
@pytest.mark.parametrize("sides", [(64, 64), (48, 31), (12, 90)])
@pytest.mark.parametrize(
    "kind",
    [
        "two waves",
        "waves and noise",
        "noise",
        "longest wave",
        "shortest wave",
        "slope",
    ],
)
def test_a_measured_spectrum_has_the_variance_and_the_mean_energy_of_its_map(
    files, kind, sides, window
):
    field, spacing, (modulus, poisson_ratio) = rough_map(kind, *sides), 0.1, (1.7, 0.3)
    np.save(files.folder / "map.npy", field)
    result = read(
        files, model="measured", file="map.npy", spacing=spacing, window=window
    )
    taper = tapered(field, window)
    assert_allclose(result.variance, np.mean(taper**2), rtol=1e-12, atol=0)
    assert_allclose(result.rms_of_map, math.sqrt(np.mean(taper**2)), rtol=1e-12)
    # the energy of each wave, at the mean of the compliance over the directions
    qx, qy = (TURN * np.fft.fftfreq(points, spacing) for points in sides)
    q = np.hypot(qx[:, None], qy)
    q[0, 0] = math.inf
    power = np.abs(np.fft.fft2(taper) / field.size) ** 2
    exact = 0.5 * np.sum(power / q) * (1.0 - 0.5 * poisson_ratio) / modulus
    solid = HalfSpace(modulus, poisson_ratio, coupling=0.0)
    assert_allclose(solid.stored_energy(result), exact, rtol=1e-12, atol=0)


def test_the_pixels_of_a_measured_spectrum_hold_the_variance_of_its_map(files):
    np.save(files.folder / "map.npy", rough_map("waves and noise", 32, 24))
    result = read(files, model="measured", file="map.npy", spacing=0.1)
    step = TURN / 4.1
    pixels = result.pixels(step, math.ceil(result.support[1] / step))
    multiplicity = np.where(np.arange(pixels.shape[1]) == 0, 1.0, 2.0)
    assert_allclose(np.sum(multiplicity * pixels), result.variance, rtol=1e-12, atol=0)


@pytest.mark.parametrize("points", [63, 64])
@pytest.mark.parametrize(("hurst", "rolloff"), [(0.8, 0.9), (0.3, 0.9), (1.0, 0.1)])
def test_a_measured_spectrum_is_that_of_a_rough_surface_within_the_scatter_of_a_map(
    points, hurst, rolloff
):
    grid = Grid(1.0, points)
    law = SelfAffine(1.0, hurst, longest=0.9, rolloff=rolloff, shortest=0.5 / points)
    half = grid.forward(white_map(points, 1.0, 1.0))
    field = field_of(grid, half * np.sqrt(law.density(*grid.wavevectors)))
    q, density = estimate(field[np.newaxis], 1.0, "none")
    # what rings of 2πk waves with random amplitudes leave undecided, from the third row to the Nyquist wavenumber
    k = np.arange(3, points // 2 - 1)
    off = density[k] / law.radial_density(q[k]) - 1.0
    assert np.all(np.abs(off) < 1.0 / np.sqrt(math.pi * k))
    slope = 2.0 + 2.0 * hurst if rolloff == 0.9 else 0.0
    smoothed = slope * (slope + 1.0) / (12.0 * k**2)
    is_steady = (q[k] < 0.8 * TURN / rolloff) | (slope > 0.0)
    # lattice points up to 0.1/√k, and the next order of the division
    bound = 0.1 / np.sqrt(k) + smoothed**2
    assert np.all(np.abs(off - smoothed)[is_steady] < bound[is_steady])


@pytest.mark.parametrize("points", [31, 32])
def test_a_measured_map_is_a_table_of_its_own_density(files, points):
    level, spacing = 2.5, 0.1
    np.savetxt(
        files.folder / "map.csv",
        white_map(points, level, points * spacing),
        delimiter=",",
        header="Pa",
    )
    result = read(files, model="measured", file="map.csv", spacing="10 cm")
    # up to Nyquist: the lattice points near a row are not quite 2πk
    k = np.arange(2, points // 2 - 1)
    assert_allclose(np.array(result.wavenumbers)[k] / (TURN / points / spacing), k)
    off = np.array(result.densities)[k] / level - 1.0
    assert np.all(np.abs(off) < 0.1 / np.sqrt(k))
    between = result.radial_density(0.5 * np.add(*result.wavenumbers[4:6]))
    assert_allclose(between, 0.5 * np.add(*result.densities[4:6]), rtol=1e-13)
    (files.folder / "map.csv").unlink()  # which is not read again
    assert read(files, **TypeAdapter(Measured).dump_python(result)) == result


def test_a_map_that_is_not_square_is_used_whole(files):
    field = np.random.default_rng(3).normal(size=(48, 30))
    np.savetxt(files.folder / "a.csv", field, delimiter=";")
    np.save(files.folder / "b.npy", np.asfortranarray(field.T))
    a, b = (
        read(files, model="measured", file=name, spacing=0.1)
        for name in ("a.csv", "b.npy")
    )
    assert_allclose(a.densities, b.densities, rtol=1e-12, atol=0)  # exchange of x and y
    step = TURN / 4.8
    corner = math.hypot(24 * step, 15 * TURN / 3.0)
    assert corner < a.support[1] < corner + 2.0 * step
    assert_allclose(a.wavenumbers[1], step, rtol=1e-15, atol=0)


def test_a_spectrum_keeps_its_shape_at_another_rms(files):
    np.savetxt(files.folder / "map.txt", white_map(16, 1.0, 1.6))
    rows, q = ((1.0, 2.0, 4.0), (3.0, 2.0, 0.5)), np.geomspace(1.0, 4.0, 5)
    for spectrum in (
        Tabulated(*rows),
        Tabulated(*rows, normalization="in_density"),
        read(files, model="measured", file="map.txt", spacing=0.1),
    ):
        dumped = TypeAdapter(type(spectrum)).dump_python(spectrum)
        for rms in (2e4, 1e-3):
            scaled = TypeAdapter(Spectrum).validate_python(dumped | {"rms": rms})
            factor = rms**2 / spectrum.variance
            assert_allclose(scaled.variance, rms**2, rtol=1e-14, atol=0)
            assert_allclose(
                scaled.radial_density(q),
                factor * spectrum.radial_density(q),
                rtol=1e-13,
                atol=0,
            )
            assert_allclose(
                HalfSpace(1.0).stored_energy(scaled),
                factor * HalfSpace(1.0).stored_energy(spectrum),
                rtol=1e-13,
                atol=0,
            )


def test_a_table_of_a_file_remarks_on_the_other_normalization_and_on_a_plateau(files):
    (files.folder / "psd.csv").write_text("q [rad/m], C [Pa^2 m^2]\n1e5, 2\n3e5, 2\n")
    keys = {"model": "tabulated", "file": "psd.csv"}
    normalization, plateau = read(files, **keys).remarks
    assert (
        "1.13e+05 Pa" in normalization
        and "7.09e+05 Pa" in normalization
        and "39.5" in normalization
    )
    assert "plateau" in plateau and "50%" in plateau  # of ∫ C dq
    normalization, _ = read(files, **keys, normalization="in_density").remarks
    assert "7.09e+05 Pa" in normalization and "1.13e+05 Pa" in normalization
    normalization, _ = read(files, **keys, rms="0.7 MPa").remarks
    assert 'normalization = "in_density"' in normalization
    # falls as q^-0.63
    (files.folder / "psd.csv").write_text("q [rad/m], C [Pa^2 m^2]\n1e5, 2\n3e5, 1\n")
    assert read(files, **keys, rms="400 kPa").remarks == ()
    assert Tabulated((1.0, 2.0), (1.0, 1.0)).remarks == ()


def dataset(
    fields, spacing, units="Pa", metre=1.0, unit="m", dims=("member", "x", "y")
):
    position = np.arange(fields.shape[-1]) * spacing / metre
    data = xr.DataArray(fields, dims=dims, attrs={"units": units})
    coordinates = {axis: (axis, position, {"units": unit}) for axis in ("x", "y")}
    return xr.Dataset({"shear_map": data}).assign_coords(coordinates)


def test_netcdf_maps_give_units_spacing_or_take_that_of_the_key_and_average_over_members(
    files,
):
    fields = np.stack(
        [white_map(16, level, 1.6, seed=int(level)) for level in (1.0, 3.0)]
    )
    dataset(fields * 1e-3, 0.1, "kPa", 1e-3, "mm").to_netcdf(files.folder / "maps.nc")
    result = read(files, model="measured", file="maps.nc")
    assert_allclose(result.spacing, 0.1, rtol=1e-12, atol=0)
    exact = np.mean(np.var(fields, axis=(1, 2)))
    assert_allclose(result.variance, exact, rtol=1e-12, atol=0)
    assert read(files, **TypeAdapter(Measured).dump_python(result)) == result
    xr.Dataset({"tau": (("row", "column"), white_map(16, 1.0, 1.6))}).to_netcdf(
        files.folder / "maps.nc"
    )
    keys = {"model": "measured", "file": "maps.nc"}
    assert_allclose(
        read(files, **keys, variable="tau", spacing="10 cm").variance,
        np.var(white_map(16, 1.0, 1.6)),
        rtol=1e-12,
        atol=0,
    )
    with pytest.raises(ValidationError, match="give spacing"):
        read(files, **keys, variable="tau")
    with pytest.raises(ValidationError, match='no variable "tua"'):
        read(files, **keys, variable="tua", spacing=0.1)


def rescaled(data, x, y, attrs=None):
    """A dataset with other coordinates, in metres or without units."""
    axes = {"x": x * data.x.to_numpy(), "y": y * data.y.to_numpy()}
    return data.assign_coords(
        {
            name: (name, axis, {"units": "m"} if attrs is None else attrs)
            for name, axis in axes.items()
        }
    )


WRONG_DATASETS = [
    (
        lambda data: data.assign_coords(x=data.x.to_numpy() ** 2),
        "not spaced by one step",
    ),
    (lambda data: rescaled(data, 2.0, 2.0), "0.2 m apart, not 0.1 m"),
    (lambda data: rescaled(data, 2.0, 1.0, {}), "no units"),
    (lambda data: data.where(data.x > 0.05), "gaps"),
    (lambda data: data * 0.0, "every density is zero"),
    (lambda data: data.isel(x=slice(5)), "too small"),
    (lambda data: data.isel(x=0, member=0), "in two dimensions"),
    (
        lambda data: data.assign(shear_map=data.shear_map.assign_attrs(units="N")),
        "not a unit of Pa",
    ),
]


def test_a_wrong_map_is_refused_with_the_cure(files):
    whole = dataset(white_map(16, 1.0, 1.6)[None], 0.1)
    for number, (change, fault) in enumerate(WRONG_DATASETS):
        change(whole).to_netcdf(files.folder / f"{number}.nc")
        with pytest.raises(ValidationError, match=fault):
            read(files, model="measured", file=f"{number}.nc", spacing=0.1)
    np.savetxt(files.folder / "a.csv", white_map(8, 1.0, 1.0), delimiter=",")
    (files.folder / "a.nc").write_text("no netCDF")
    rescaled(whole, 1.0, 2.0).to_netcdf(files.folder / "long.nc")
    for keys, fault in [
        ({"file": "a.csv"}, "give spacing"),
        ({"file": "long.nc"}, "x and y are not spaced by one step"),
        ({"file": "a.nc", "spacing": 1}, "a.nc: "),
        ({"file": "a.csv", "spacing": 1, "window": "box"}, "'none' or 'hann'"),
    ]:
        with pytest.raises(ValidationError, match=fault):
            read(files, model="measured", **keys)


def test_a_hann_window_keeps_the_border_of_a_steep_map_from_leaking():
    # A quarter of a periodic map is not periodic: its jump at the borders leaks as 1/q², far above
    # a density that falls as q⁻⁴. The window's own bias is C'' times its width: (2 + 2H)² / (6 k²).
    points, count = 128, 40
    generator = np.random.default_rng(8)
    law = SelfAffine(1.0, 1.0, longest=0.5, rolloff=0.5, shortest=2.2 / points)
    grid = Grid(1.0, points)
    density = law.density(*grid.wavevectors)
    white = grid.forward(generator.normal(size=(count, points, points))) / grid.spacing
    fields = field_of(grid, white * np.sqrt(density))[:, : points // 2, : points // 2]
    part = Grid(0.5, points // 2)
    density_of_part = law.density(*part.wavevectors)
    density_of_part[density_of_part == 0.0] = np.inf
    rings = slice(11, 23)
    ratio = {}
    for window in ("none", "hann"):
        ring = radial_average(
            np.mean(periodogram(fields, part.cell, window), axis=0) / density_of_part,
            part,
        )
        ratio[window] = np.average(ring.density[rings], weights=ring.pairs[rings])
        pairs = np.sum(ring.pairs[rings])
    # about four neighbours share their numbers under Hann
    error = math.sqrt(4 / (count * pairs))
    assert abs(ratio["hann"] - 1) < 5 * error + 16 / (6 * 12**2)
    assert ratio["none"] > 1.5
