"""Bands of mode pairs: their exact moments, their errors, and cells too large to list.

The truth is here always the sum over all modes of the cell, by formulas of this file's own:
cumulants κn = (n − 1)! Σ w^n, autocorrelation Σ w² e^(−2λt) / Σ w², integral time ½ Σ w²/λ / Σ w².
"""

import functools
import math
import tracemalloc
from itertools import product

import numpy as np
import pytest
from helpers.cases import some
from numpy.testing import assert_allclose
from pydantic_core import PydanticCustomError

from sim.numerics import disk_cache
from sim.parts.shear import models as shear
from sim.parts.shear.bands import Pairs, cell_pairs, group
from sim.parts.shear.modes import modes
from sim.parts.shear.process import Diffusion, Slip, Time, Wave
from sim.solid import HalfSpace
from sim.spectrum import (
    AnisotropicGaussian,
    Band,
    Gaussian,
    Measured,
    Ripple,
    SelfAffine,
    Tabulated,
    VonKarman,
)

G, CELL, RMS = 1.6e6, 100e-6, 150e3
FAMILIES = {
    "band": Band(RMS, longest=50e-6, shortest=7e-6),
    "gaussian": Gaussian(RMS, 8e-6),
    "anisotropic, turned": AnisotropicGaussian(RMS, 5e-6, 11e-6, angle=0.4),
    "von karman 0.3": VonKarman(RMS, 8e-6, 0.3),
    "von karman 0.8": VonKarman(RMS, 8e-6, 0.8),
    "von karman 1": VonKarman(RMS, 8e-6, 1.0),
    "self-affine 0": SelfAffine(
        RMS, 0.0, longest=50e-6, rolloff=20e-6, shortest=5.6e-6
    ),
    "self-affine 0.8": SelfAffine(
        RMS, 0.8, longest=50e-6, rolloff=20e-6, shortest=5.6e-6
    ),
    "self-affine 1": SelfAffine(
        RMS, 1.0, longest=100e-6, rolloff=100e-6, shortest=5.6e-6
    ),
    "tabulated": Tabulated((1e5, 2e5, 3e5, 5e5, 9e5), (0.0, 3.0, 3.0, 0.2, 0.0)),
    "measured": Measured(
        "map.csv", 1e-6, wavenumbers=(6e4, 3e5, 1e6), densities=(3.0, 4.0, 0.1)
    ),
    "ripple": Ripple(RMS, 20e-6, 0.3),
}
MEMORIES = {
    "time": (Time(time=1e-3), 0),
    "slip": (Slip(length=5e-6), 0),
    "wave": (Wave(waves=2.0), 1),
    "diffusion": (Diffusion(diffusivity=1e-9), 2),
}
TOLERANCES = [0.3, 0.1, 0.03, 0.01, 0.003]


def variance_of(bands):
    return float(np.sum(0.5 * bands.weight**2 * bands.freedom))


def listed(spectrum, points=41, poisson_ratio=0.5):
    """Weights w [J/m^2] and wavenumbers of all mode pairs of a cell."""
    pairs = modes(spectrum, CELL, points)
    return pairs.energies(HalfSpace(G, poisson_ratio)), np.hypot(pairs.qx, pairs.qy)


def relative_errors(weights, rates, bands, power):
    """Relative deficit of the bands in κ3, κ4 and the integral time; squares and rates of the bands."""
    own_rates = (bands.wavenumber / 1e5) ** power
    lacks = {}
    for order, name in ((3, "third"), (4, "fourth")):
        exact = math.factorial(order - 1) * math.fsum(weights**order)
        # κn of ½ W chi-square(k) is ½ (n − 1)! k W^n
        banded = (
            0.5
            * math.factorial(order - 1)
            * math.fsum(bands.freedom * bands.weight**order)
        )
        lacks[f"banded_error_{name}_cumulant"] = 1.0 - banded / exact
    squares = 0.5 * bands.weight**2 * bands.freedom
    exact = math.fsum(weights**2 / (2.0 * rates))
    lacks["banded_error_correlation_time"] = (
        1.0 - math.fsum(squares / (2.0 * own_rates)) / exact
    )
    return lacks, squares, own_rates


def test_mean_and_variance_are_those_of_all_modes_which_small_cells_list_pair_by_pair():
    cases = [
        *product(FAMILIES, ["wave"], [41], [0.3]),
        *product(["gaussian"], MEMORIES, [42], [0.5]),
    ]
    for (name, correlation, points, poisson_ratio), tolerance in product(
        cases, (0.3, 0.01)
    ):
        weights, _ = listed(FAMILIES[name], points, poisson_ratio)
        recipe = shear.Banded(
            spectrum=FAMILIES[name],
            correlation=MEMORIES[correlation][0],
            cell=CELL,
            points=points,
            tolerance=tolerance,
        )
        process, sums = (
            recipe.process(HalfSpace(G, poisson_ratio), 1.0),
            (math.fsum(weights), math.fsum(weights**2)),
        )
        bands, spread = process.bands, process.known_errors()["member_spread_energy"]
        assert_allclose(
            [bands.mean, variance_of(bands), spread],
            [*sums, sums[1] ** 0.5 / sums[0]],
            rtol=1e-12,
            atol=0,
        )
        assert np.all(bands.freedom >= 2.0)
    cells = [
        *product(
            [12, 13, 256, 257],
            ["von karman 0.3", "anisotropic, turned", "ripple"],
            [0.5, 0.3],
        )
    ]
    for points, name, poisson_ratio in [
        *cells,
        (512, "von karman 0.3", 0.3),
        (513, "von karman 0.3", 0.3),
    ]:
        pairs = cell_pairs(FAMILIES[name], CELL, points, HalfSpace(G, poisson_ratio))
        weights, wavenumbers = listed(FAMILIES[name], points, poisson_ratio)
        assert np.all(pairs.count == 1.0)
        assert_allclose(np.sort(pairs.weight), np.sort(weights), rtol=1e-13, atol=0)
        assert_allclose(
            np.sort(pairs.wavenumber), np.sort(wavenumbers), rtol=1e-13, atol=0
        )


@pytest.mark.parametrize(
    ("name", "power"),
    some(
        list(product(FAMILIES, (0, 1, 2))),
        *((name, 2) for name in FAMILIES),
        ("tabulated", 0),
        ("anisotropic, turned", 1),
    ),
)
def test_every_other_error_is_the_one_told_and_within_the_tolerance(name, power):
    weights, wavenumbers = listed(FAMILIES[name])
    rates, ones = (wavenumbers / 1e5) ** power, np.ones(len(weights))
    spread = math.log(rates.max() / rates.min())
    lags = np.concatenate(
        [[0.0], np.geomspace(1e-3 / rates.max(), 100.0 / rates.min(), 1000)]
    )
    # between two of the lags, h apart in the logarithm, a largest value is missed by h² of it at the most, as
    # |d²/du² (x e^-x)^2| is below 8 times its largest, x = e^u; rates fall into 4000 classes
    missed, merged = math.log(lags[2] / lags[1]) ** 2, (spread / 4000) ** 2
    numbers = []
    for tolerance in TOLERANCES:
        bands = group(Pairs(weights, wavenumbers, ones), power, tolerance)
        lacks, squares, own_rates = relative_errors(weights, rates, bands, power)
        for kind, lack in lacks.items():
            assert_allclose(bands.errors[kind], lack, rtol=0, atol=1e-6 * tolerance)
            assert -1e-14 < lack <= tolerance
        exact = np.exp(-2.0 * np.multiply.outer(lags, rates)) @ weights**2
        banded = np.exp(-2.0 * np.multiply.outer(lags, own_rates)) @ squares
        lack = (exact - banded) / math.fsum(weights**2)
        assert lack.min() > -1e-14
        known = bands.errors["banded_error_autocorrelation"]
        assert_allclose(lack.max(), known, rtol=missed, atol=merged + 1e-14)
        assert known <= tolerance
        assert set(bands.errors) == {*lacks, "banded_error_autocorrelation"}
        numbers.append(len(bands.weight))
    assert numbers == sorted(numbers)


@pytest.mark.parametrize(
    ("name", "power"), [("band", 0), ("von karman 0.3", 1), ("self-affine 0", 2)]
)
def test_under_amplitude_that_relaxes_the_mean_follows_all_modes(name, power):
    weights, wavenumbers = listed(FAMILIES[name])
    pairs, rates = (
        Pairs(weights, wavenumbers, np.ones(len(weights))),
        (wavenumbers / 1e5) ** power,
    )
    lags = np.geomspace(1e-3 / rates.max(), 100.0 / rates.min(), 2000)
    for tolerance in TOLERANCES:
        bands = group(pairs, power, tolerance, relaxing=True)
        _, _, own_rates = relative_errors(weights, rates, bands, power)
        exact = np.exp(-2.0 * np.multiply.outer(lags, rates)) @ weights
        banded = np.exp(-2.0 * np.multiply.outer(lags, own_rates)) @ (
            0.5 * bands.weight * bands.freedom
        )
        lack = np.max(np.abs(exact - banded)) / math.fsum(weights)
        # rates in 4000 classes, largest value between lags as above
        known = bands.errors.get("banded_error_relaxing_mean", 0.0)
        assert_allclose(
            known,
            lack,
            rtol=1e-4,
            atol=(math.log(rates.max() / rates.min()) / 4000) ** 2 + 1e-14,
        )
        assert max(bands.errors.values()) <= tolerance
        assert ("banded_error_relaxing_mean" in bands.errors) == (power > 0)


def scattered(rng):
    """Pairs of any weights, rates and counts, some of them equal."""
    size = int(rng.integers(1, 120))
    weights = 10.0 ** rng.uniform(-rng.uniform(0.0, 12.0), 0.0, size)
    wavenumbers = 10.0 ** rng.uniform(-rng.uniform(0.0, 4.0), 0.0, size)
    if rng.random() < 0.3:
        weights = rng.choice(weights, size)
    if rng.random() < 0.3:
        wavenumbers = rng.choice(wavenumbers[:3], size)
    count = rng.integers(1, 1000, size) if rng.random() < 0.5 else np.ones(size)
    return Pairs(1e-9 * weights, 1e6 * wavenumbers, count.astype(float))


@pytest.mark.parametrize("seed", some([0, 1, 2, 3], 0))
def test_any_pairs_are_grouped_within_the_tolerance(seed):
    rng = np.random.default_rng(seed)
    for _ in range(2000 if seed == 3 else 40):
        pairs, power, tolerance = (
            scattered(rng),
            int(rng.integers(0, 3)),
            10.0 ** rng.uniform(-4.0, -0.01),
        )
        bands = group(pairs, power, tolerance)
        weights, counts = pairs.weight, pairs.count
        assert_allclose(bands.mean, math.fsum(counts * weights), rtol=1e-12, atol=0)
        assert_allclose(
            variance_of(bands), math.fsum(counts * weights**2), rtol=1e-12, atol=0
        )
        assert np.all(bands.freedom >= 2.0)
        assert max(bands.errors.values()) <= tolerance
        assert min(bands.errors.values()) >= 0.0
        slowest, fastest = (
            pairs.wavenumber.min() * (1 - 1e-12),
            pairs.wavenumber.max() * (1 + 1e-12),
        )
        assert power == 0 or np.all(
            (bands.wavenumber >= slowest) & (bands.wavenumber <= fastest)
        )


def test_equal_pairs_are_one_band_a_ripple_one_of_two_degrees_and_any_within_a_tolerance_of_zero_single():
    for correlation, _ in MEMORIES.values():
        process = shear.Banded(
            spectrum=FAMILIES["ripple"], correlation=correlation, cell=CELL
        ).process(HalfSpace(G, 0.5), 1.0)
        assert process.bands.freedom.tolist() == [2.0]
        assert set(process.bands.errors.values()) == {0.0}
        assert_allclose(
            process.bands.weight,
            HalfSpace(G).stored_energy(FAMILIES["ripple"]),
            rtol=1e-14,
            atol=0,
        )
        assert_allclose(process.bands.wavenumber, 2 * np.pi / 20e-6, rtol=1e-14, atol=0)
    many = Pairs(np.full(700, 3e-7), np.full(700, 2e5), np.ones(700))
    counted = Pairs(np.array([3e-7]), np.array([2e5]), np.array([700.0]))
    for power in (0, 1, 2):
        for pairs in (many, counted):
            bands = group(pairs, power, 1e-6)
            assert_allclose(bands.freedom, [1400.0], rtol=1e-13, atol=0)
            assert_allclose(bands.weight, [3e-7], rtol=1e-13, atol=0)
            # one less a ratio of sums: a few roundings
            assert max(bands.errors.values()) < 1e-14
    weights, wavenumbers = np.array([1e-7, 2e-7, 4e-7]), np.array([1e5, 2e5, 3e5])
    bands = group(Pairs(weights, wavenumbers, np.ones(3)), 1, 1e-9)
    assert bands.freedom.tolist() == [2.0, 2.0, 2.0]
    assert_allclose(np.sort(bands.weight), weights, rtol=1e-15, atol=0)
    assert_allclose(np.sort(bands.wavenumber), wavenumbers, rtol=1e-15, atol=0)


def sums(weights, wavenumbers, count=1.0):
    """Σw, Σw², Σw³, Σw⁴ and Σw²/q over pairs."""
    powers = [math.fsum(count * weights**n) for n in (1, 2, 3, 4)]
    return np.array([*powers, math.fsum(count * weights**2 / wavenumbers)])


def counted_and_listed(spectrum, points):
    """Sums over the pairs that are counted, relative to those over all pairs, less one."""
    pairs = cell_pairs(spectrum, CELL, points, HalfSpace(G, 0.3))
    weights, wavenumbers = listed(spectrum, points, 0.3)
    assert len(pairs.weight) < len(weights)
    return (
        sums(pairs.weight, pairs.wavenumber, pairs.count) / sums(weights, wavenumbers)
        - 1.0
    )


#: Cells with weight where pairs are counted; a wavelength that the grid just holds, or a share of it.
COUNTED = {
    "self-affine 0.8": lambda fine: SelfAffine(RMS, 0.8, 50e-6, 20e-6, fine),
    "self-affine 0": lambda fine: SelfAffine(RMS, 0.0, 50e-6, 20e-6, fine),
    "von karman, short": lambda fine: VonKarman(RMS, 0.2e-6, 0.05),
    "gaussian, beyond the grid": lambda fine: Gaussian(RMS, 0.03e-6),
    "anisotropic, turned": lambda fine: AnisotropicGaussian(RMS, 0.1e-6, 8e-6, 0.4),
    "wide band": lambda fine: Band(RMS, 50e-6, fine),
    "high band": lambda fine: Band(RMS, 1.1 * fine, fine),
    "narrow high band": lambda fine: Band(RMS, 1.01 * fine, fine),
}


@pytest.mark.parametrize(
    ("name", "points"),
    some(
        list(product(COUNTED, (704, 1500))),
        ("anisotropic, turned", 704),
        ("narrow high band", 704),
    ),
)
def test_counted_cells_have_the_mean_and_variance_of_all_modes(name, points):
    off = counted_and_listed(COUNTED[name](CELL / ((points - 1) // 2 - 0.6)), points)
    assert np.all(np.abs(off[:2]) < (5e-9, 3e-7))
    # w varies within a block; a band a few pixels wide has pairs at its ends that hold any share of a full one
    assert np.all(
        np.abs(off[2:])
        < {"narrow high band": 0.1, "high band": 1e-2, "wide band": 1e-5}.get(
            name, 1e-6
        )
    )
    assert np.all(off[2:4] < 1e-6)  # and like banding, blocks can but lower κ3 and κ4


def test_a_cliff_in_a_table_is_counted_to_a_few_parts_in_ten_thousand():
    # the density falls to zero within less than two pixels, 320 from the origin, and rises again
    q = 2 * np.pi / CELL * np.array([160.0, 240.0, 318.0, 319.6, 342.0])
    off = counted_and_listed(
        Measured("map.csv", wavenumbers=tuple(q), densities=(0.0, 1.0, 1.0, 0.0, 1.0)),
        700,
    )
    assert np.all(np.abs(off[:2]) < (1e-6, 3e-4))
    assert np.all(np.abs(off[2:]) < 3e-3)


@pytest.mark.verify
def test_a_hundred_million_pairs_are_counted_in_bounded_memory():
    cell = 0.24e-3
    spectrum = SelfAffine(RMS, 0.8, longest=60e-6, rolloff=24e-6, shortest=cell / 8000)
    tracemalloc.start()
    pairs = cell_pairs(spectrum, cell, None, HalfSpace(G, 0.5))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    low, high = (limit * cell / (2 * np.pi) for limit in spectrum.support)
    assert_allclose(
        pairs.count.sum(), 0.5 * np.pi * (high**2 - low**2), rtol=1e-3, atol=0
    )
    assert len(pairs.weight) < 1e6
    assert peak < 256e6
    # the lattice near q = 0 is the same as in a cell that can be listed
    listable = SelfAffine(RMS, 0.8, 60e-6, 24e-6, cell / 256)
    coarse = cell_pairs(listable, cell, None, HalfSpace(G, 0.5))
    infinite, short = (
        float(HalfSpace(G).stored_energy(s)) for s in (spectrum, listable)
    )
    per_variance = [s.radial_density(2e5) for s in (spectrum, listable)]
    lattice = math.fsum(pairs.weight * pairs.count) - infinite
    assert_allclose(
        lattice / per_variance[0],
        (math.fsum(coarse.weight) - short) / per_variance[1],
        rtol=1e-4,
        atol=0,
    )


@pytest.mark.parametrize(
    "waves",
    [
        (2000, 2200),
        *(
            pytest.param(w, marks=pytest.mark.verify)
            for w in [(7000, 8000), (7_000_000, 7_070_000)]
        ),
    ],
)
def test_far_from_the_origin_a_band_holds_the_energy_of_the_infinite_plane(waves):
    spectrum = Band(RMS, CELL / waves[0], CELL / waves[1])
    pairs = cell_pairs(spectrum, CELL, None, HalfSpace(G, 0.5))
    # blocks narrower than 1/85 of their wavenumber in 3 × 3 squares: (1/85/3)² / 24 = 6e-7 at the most
    assert_allclose(
        math.fsum(pairs.weight * pairs.count),
        HalfSpace(G).stored_energy(spectrum),
        rtol=6e-7,
        atol=0,
    )
    assert_allclose(
        pairs.count.sum(),
        0.5 * np.pi * (waves[1] ** 2 - waves[0] ** 2),
        rtol=5e-3,
        atol=0,
    )


def test_a_longest_wave_beyond_the_cell_costs_the_cells_error_and_a_cell_without_modes_is_refused():
    spectrum = Band(RMS, longest=4 * CELL, shortest=10e-6)
    recipe = functools.partial(
        shear.Banded, spectrum=spectrum, correlation=Slip(length=1e-6)
    )
    short, long = (
        recipe(cell=side).process(HalfSpace(G, 0.5), 1.0) for side in (CELL, 40 * CELL)
    )
    exact = float(HalfSpace(G).stored_energy(spectrum))
    errors = [process.known_errors()["cell_error_energy"] for process in (short, long)]
    assert_allclose(
        errors,
        [process.bands.mean / exact - 1.0 for process in (short, long)],
        rtol=1e-9,
        atol=0,
    )
    assert errors[0] < -0.01 and abs(errors[1]) < 1e-4
    for spectrum, points, cure in (
        (Band(RMS, 300e-6, 250e-6), None, "make the cell longer"),
        (Band(RMS, 50e-6, 7e-6), 20, "give more points"),
        (Gaussian(RMS, 8e-6), None, "give points"),
    ):
        with pytest.raises(PydanticCustomError, match=cure):
            cell_pairs(spectrum, CELL, points, HalfSpace(G, 0.5))


def test_bands_from_the_disk_are_those_grouped_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("SIM_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(disk_cache, "_WORTH", -1.0)
    spectra = [
        SelfAffine(1.0, 0.8, 60e-6, 24e-6, 4e-6),
        SelfAffine(1.0, 0.7, 60e-6, 24e-6, 4e-6),
    ]
    cell = 240e-6, None, HalfSpace(1.0), (1, 0.01, False)
    for spectrum in spectra:
        bands, errors = shear._grouped_anew(spectrum, *cell)
        for _ in range(2):  # stored, then read
            shear._grouped.cache_clear()
            again, errors_again = shear._grouped(spectrum, *cell)
            assert errors_again == errors and again.errors == bands.errors
            for name in ("weight", "freedom", "wavenumber"):
                assert_allclose(getattr(again, name), getattr(bands, name), rtol=0)
    assert len(list(tmp_path.rglob("found/*"))) == 2
    shear._grouped.cache_clear()
