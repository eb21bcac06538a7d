"""Systematic errors of a run, its diagnosis and its remarks, against closed forms and solutions of other codes."""

import itertools
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy
from helpers.parts import (
    Adhesion,
    Clock,
    Ensemble,
    Equilibrium,
    Time,
    jkr,
    load,
    read,
    read_sweep,
    run,
)
from helpers.scenes import BONDS, CONTACTS, DRIVES, SHEARS, scene as small
from numpy.testing import assert_allclose

import sim
from sim.ensemble.diagnosis import (
    _along_course,
    _behind,
    cure,
    diagnosis,
    remarks,
    stability,
    systematic_errors,
)
from sim.ensemble.expected import StoredEnergy
from sim.ensemble.plan import Plan
from sim.ensemble.preview import preview
from sim.ensemble.steady import sensitivities
from sim.parts.bonds.models import Steady, Unbroken
from sim.parts.drive import Steady as AtSpeed
from sim.parts.shear.models import Banded, Uniform
from sim.parts.shear.modes import modes
from sim.solid import HalfSpace
from sim.spectrum.families import (
    AnisotropicGaussian,
    Band,
    Gaussian,
    Ripple,
    SelfAffine,
)
from sim.units.notation import engineering

R, G, W, LOAD = 5e-3, 0.5e6, 45e-3, 1e-3
GAUSSIAN = {"model": "gaussian", "rms": "80 kPa", "length": "10 um"}
BASE = f"""
clock = {{ duration = "1 s", step = "1 ms", record = "0.5 s" }}
solid.shear_modulus = {G}
sphere.radius = {R}
adhesion.work = {W}
contact.load = {LOAD}
drive.speed = "1 um/s"
"""
LENS = {
    "model": "banded",
    "spectrum": GAUSSIAN,
    "points": 256,
    "correlation": {"model": "slip", "length": "10 um"},
}


@pytest.fixture
def scene(tmp_path):
    def made(**overrides):
        path = tmp_path / "scene.toml"
        path.write_text(BASE, encoding="utf-8")
        return load(path, overrides)

    return made


def area(work, load=LOAD):
    return np.pi * jkr.radius_at_load(load, work, R, 4.0 * G) ** 2


STORED = 3.0 * math.sqrt(math.pi) / 16.0 * 80e3**2 * 10e-6 / G


def test_sensitivities_are_the_exponents_of_the_laws(scene):
    bonds = {"model": "steady", "critical_speed": "4 um/s", "stress": "0.1 MPa"}
    parts = {
        "shear": {"model": "mean", "spectrum": GAUSSIAN},
        "bonds": bonds,
        "adhesion.bond_share": 0.0,
    }
    found = sensitivities(scene(**parts, **{"contact.load": "0 N"}), 0.5, 1e-6)
    # energies over the work that is left; 1 - N/N0
    fluctuating, broken = STORED / (W - STORED), 1.0 / 5.0
    for key, of_area, of_strength in (
        ("sphere.radius", 4 / 3, 0.0),
        ("adhesion.work", 2 / 3 * W / (W - STORED), 0.0),
        ("shear.spectrum.rms", -4 / 3 * fluctuating, 0.0),
        ("shear.spectrum.length", -2 / 3 * fluctuating, 0.0),
        ("shear.paid_by_adhesion", -2 / 3 * fluctuating, 0.0),
        ("solid.shear_modulus", -2 / 3 + 2 / 3 * fluctuating, 0.0),
        ("bonds.stress", 0.0, 1.0),
        ("speed", 0.0, -broken),
        ("bonds.critical_speed", 0.0, broken),
    ):
        # one-sided at its bound
        step = 1e-4 * 20 if key == "shear.paid_by_adhesion" else 1e-5
        assert_allclose(
            found.pop(key), [of_area, of_area + of_strength], rtol=step, atol=1e-6
        )
    assert found.keys() == {"solid.poisson_ratio"}


def test_the_share_of_long_waves_is_the_integral_of_the_spectrum():
    families = (
        SelfAffine(1e5, 0.3, 60e-6, 24e-6, 1e-6),
        AnisotropicGaussian(1e5, 3e-6, 9e-6, 0.4),
        Gaussian(1e5, 5e-6),
    )
    for family in families:
        for wavelength, ratio in ((50e-6, 0.5), (20e-6, 0.2), (8e-6, 0.0)):
            held = 0.25 / (1.0 - ratio)

            def density(angle, q, family=family, held=held):
                return family.density(q * math.cos(angle), q * math.sin(angle)) * (
                    1.0 - held * math.cos(angle) ** 2
                )

            ends = [
                q
                for q in (0.0, *(2 * math.pi / np.array([60e-6, 24e-6, wavelength])))
                if q * wavelength < 6.3
            ]
            pieces = [
                scipy.integrate.dblquad(density, *edges, 0, math.pi)[0]
                for edges in itertools.pairwise(ends)
            ]
            share = (
                sum(pieces)
                / (4.0 * math.pi**2)
                / float(HalfSpace(1.0, ratio).stored_energy(family))
            )
            assert_allclose(
                HalfSpace(1.0, ratio).share_of_long_waves(family, wavelength),
                share,
                rtol=1e-6,
                atol=1e-12,
            )
    # equal steps of q
    assert_allclose(
        HalfSpace(1.0).share_of_long_waves(Band(1.0, 60e-6, 20e-6), 30e-6),
        0.5,
        rtol=1e-12,
    )
    shares = [
        HalfSpace(1.0).share_of_long_waves(Ripple(1.0, 2.0), end) for end in (1.0, 3.0)
    ]
    assert_allclose(shares, [1.0, 0.0], rtol=1e-15)


STARTER = Path(sim.__file__).with_name("starter.toml")
RAMP = {"model": "ramp", "from": "10 um/s", "to": "100 mm/s", "scale": "log"}
BOUND = {"model": "rate", "critical_speed": "10 mm/s", "stress": "0.1 MPa"}
STRETCHED = {
    "model": "cohort",
    "rupture": {"model": "bell", "zero_force_rate": "1e3 1/s", "bell_force": "4 pN"},
    "bond_stiffness": "0.4 mN/m",
    "rebinding_rate": "1e4 1/s",
    "site_density": "1e15 1/m^2",
}


def on_a_ramp(bonds, shear):
    keys = {"clock": {"duration": "2 s", "step": "10 ms"}, "drive": RAMP}
    return load(tomllib.loads(BASE) | keys | {"bonds": bonds, "shear": shear})


@pytest.mark.parametrize(
    ("bonds", "off"),
    [
        (BOUND | {"rebinding_rate": "50 1/s"}, 0.0),
        (BOUND | {"rebinding_rate": "5000 1/s"}, 0.0),
        # the rate of relaxation may be another, which changes the delay by one over half a step's number of lives
        (STRETCHED, 1.0 / 50.0),
    ],
)
def test_the_error_of_the_clock_step_along_a_ramp_is_that_of_two_runs(bonds, off):
    """A run with a hundredth of the step has a hundredth of the error. Weak fluctuations give the scene a cell."""
    coarse = on_a_ramp(bonds, LENS | {"spectrum": GAUSSIAN | {"rms": "1 Pa"}})
    fine = coarse.with_values({"clock.step": 1e-4, "clock.record": 1e-2})
    runs = [run(each) for each in (coarse, fine)]
    ratio = [
        each["contact_area"].mean("member") / each["jkr_radius"] ** 2 for each in runs
    ]
    stated = systematic_errors(coarse)
    at = int(abs(runs[0]["speed"] - stated["error_speed"]).argmin("t"))
    assert stated["step_error_area"] > 1e-3
    # the change of the speed in a step, and a hundredth of the error in the fine run
    rtol = math.log(1e4) / 200 + 0.02 + off
    found = (ratio[0] - ratio[1])[at] / math.pi
    assert_allclose(stated["step_error_area"], found, rtol=rtol)


@pytest.mark.verify
def test_the_error_of_the_clock_step_leaves_out_fluctuations_that_are_not_late():
    """Their amplitude is that of the speed at the end of a step; with late fluctuations it would be 0.37 points."""
    scene = load(STARTER).with_values(
        {"ensemble.members": 20_000, "record.per_member": True}
    )
    stated, found = systematic_errors(scene), []
    for step in (1e-2, 1e-3):
        dataset = run(scene.with_values({"clock.step": step, "clock.record": 1e-2}))
        at = int(abs(dataset["speed"] - stated["error_speed"]).argmin("t"))
        near = dataset.isel(t=slice(at - 2, at + 3))
        found.append(read.Run(near).statistic("area_ratio").isel(t=2))
    off, error = (
        [float(each.sel(statistic=kind)) for each in found]
        for kind in ("mean", "standard error")
    )
    noise = math.hypot(*error)
    # and a tenth of the error in the fine run
    assert noise < 3e-4
    assert abs(0.9 * stated["step_error_area"] - (off[0] - off[1])) < 3.0 * noise


def test_the_systematic_error_covers_what_the_cell_leaves_out_and_its_cure_works(scene):
    lens = scene(shear=LENS, **{"ensemble.members": 64})
    stated, exact = systematic_errors(lens), float(area(W - STORED) / area(W))
    assert_allclose(exact, 0.413, atol=5e-4)
    cell = modes(
        lens.fluctuations.spectrum, lens.fluctuations.side(lens.setting.cell), 256
    )
    weights = cell.energies(HalfSpace(G, 0.5))
    drawn = np.random.default_rng(1).exponential(size=(2000, weights.size)) @ weights
    draws = (area(W - drawn) - area(W - drawn + np.sum(weights) - STORED)) / area(W)
    error = draws.std() / math.sqrt(draws.size)
    assert_allclose(stated["cell_error_area"], draws.mean(), atol=4.0 * error)
    spread = np.std(area(W - drawn)) / area(W)
    assert_allclose(
        stated["member_spread_area"], spread, rtol=4.0 / math.sqrt(2 * draws.size)
    )
    assert (
        "cell makes A/A_JKR up to 5.1 points and the friction 13 % too large"
        in "".join(remarks(Plan.of(lens)))
    )
    cured = lens.with_values(keys_of(cure(lens, stated)))
    assert cured.fluctuations.cell == 4e-3
    for scenario in (lens, cured):
        ratios = np.asarray(run(scenario)["contact_area"].isel(t=-1)) / area(W)
        known, error = (
            systematic_errors(scenario),
            ratios.std() / math.sqrt(ratios.size),
        )
        assert abs(ratios.mean() - exact) < abs(known["cell_error_area"]) + 2.0 * error
    assert abs(known["cell_error_area"]) < 0.12 * stated["cell_error_area"]
    assert known["member_spread_area"] < stated["member_spread_area"]


def test_bands_and_clock_steps_leave_out_a_skewness_and_add_a_variance(scene):
    calm = LENS | {"spectrum": GAUSSIAN | {"rms": "50 kPa"}, "tolerance": 0.3}
    lagging = {"model": "rate_dependent", "load": 0.0, "front_speed": "1 mm/s"}
    lens = scene(shear=calm, contact=lagging, **{"drive.speed": "2 mm/s"})
    stated, known = (
        systematic_errors(lens),
        lens.process.known_errors()["banded_error_third_cumulant"],
    )
    weights = modes(
        lens.fluctuations.spectrum, lens.fluctuations.side(lens.setting.cell), 256
    ).energies(HalfSpace(G, 0.5))
    left, third = 1.0 - np.sum(weights) / W, 2.0 * np.sum(weights**3) / W**3
    # third derivative of A/A_JKR over Delta Gamma, as A goes with w^(2/3)
    curvature = -8 / 27 * left ** (-7 / 3)
    # 256 energies have a tenth less of the third moment than all of them
    assert_allclose(
        stated["banded_error_area"], -known * third * curvature / 6.0, rtol=0.2
    )
    # variance of a/a_JKR
    spread = np.sum(weights**2) / W**2 * (left ** (1 / 3 - 1) / 3.0) ** 2
    half = 2e-6 / 10e-6  # of the energy's decay in a step, 2 V dt over the length
    assert_allclose(
        stated["step_error_area"], spread * (half / math.tanh(half) - 1.0), rtol=0.1
    )


def keys_of(cure):
    """The keys of a cure with their values."""
    document = tomllib.loads(cure.partition(" (")[0].replace(" and ", "\n"))
    return {
        f"{table}.{key}": value
        for table, keys in document.items()
        for key, value in keys.items()
    }


FINE = {
    "model": "modal",
    "cell": "0.6 mm",
    "points": 512,
    "spectrum": GAUSSIAN | {"length": "4 um", "rms": "126 kPa"},
}
LONG = {"spectrum": GAUSSIAN | {"model": "von_karman", "hurst": 0.5, "rms": "70 kPa"}}


@pytest.mark.parametrize(
    ("changes", "keys"),
    [
        ({"points": 16}, {"shear.points"}),
        (LONG, {"shear.cell", "shear.points"}),
        (FINE, {"shear.model"}),
    ],
)
def test_a_cure_names_the_key_that_leaves_something_out(scene, changes, keys):
    lens = scene(shear=LENS | changes)
    before = systematic_errors(lens)
    text = cure(lens, before)
    values = keys_of(text)
    assert values.keys() == keys
    # more points alone leave the energies of the waves that the cell has
    assert ("spread" in text) == (keys != {"shear.points"})
    if keys != {"shear.model"}:
        after = systematic_errors(lens.with_values(values))
        assert abs(after["cell_error_area"]) < 0.2 * abs(before["cell_error_area"])


def test_the_lag_along_a_ramp_is_that_of_the_rate_equation(scene):
    # d phi/dt = h (1 - phi) - h V/V_c phi, from 10 um/s to 20 mm/s in a second and in ten
    rate, critical, ends = 5.0, 5e-3, (10e-6, 20e-3)
    bonds = {
        "model": "rate",
        "critical_speed": critical,
        "rebinding_rate": rate,
        "stress": "0.2 MPa",
    }
    ramp = {"model": "ramp", "from": ends[0], "to": ends[1]}
    lens = scene(drive=ramp, bonds=bonds)
    very_slow = _along_course(lens, 1e6)
    first, last = (
        _behind(_along_course(lens, slower), very_slow) for slower in (1.0, 10.0)
    )
    for slower, lag in ((1.0, first), (10.0, last)):
        times = np.linspace(0.0, slower, 2001)
        speeds = ends[0] + (ends[1] - ends[0]) * times / slower

        def slope(time, bound, slower=slower):
            speed = ends[0] + (ends[1] - ends[0]) * time / slower
            return rate * (1.0 - bound) - rate * speed / critical * bound

        begin = [1.0 / (1.0 + ends[0] / critical)]
        bound = scipy.integrate.solve_ivp(
            slope, (0.0, slower), begin, t_eval=times, rtol=1e-9, atol=1e-12
        ).y[0]
        steady = 1.0 / (1.0 + speeds / critical)
        areas = [area(W * fraction) / area(W) for fraction in (bound, steady)]
        friction = [
            ratio * fraction
            for ratio, fraction in zip(areas, (bound, steady), strict=True)
        ]
        off = (
            np.max(np.abs(areas[0] - areas[1])),
            np.max(np.abs(friction[0] - friction[1])) / friction[1].max(),
        )
        # run and slow reference are half a step late at the most: 10 um/s of 5 mm/s each
        assert_allclose(lag[:2], off, atol=1.0 / 1000 * ends[1] / critical)
    (line,) = (
        text for text in diagnosis(Plan.of(lens)) if text.startswith("along the ramp")
    )
    shown = [float(number) for number in re.findall(r"([0-9.]+) (?:points|%)", line)]
    assert_allclose(shown, 100.0 * np.array([*first[:2], *last[:2]]), rtol=0.05)
    assert 'clock.duration = "10 s"' in line and first[0] > 3.0 * last[0]
    # a table of the same course has the same lag; at a jump there is no statement
    table = {"model": "table", "time": [0.0, 1.0], "speed": list(ends)}
    (same,) = (
        text
        for text in diagnosis(Plan.of(scene(drive=table, bonds=bonds)))
        if text.startswith("along the")
    )
    assert [
        float(number) for number in re.findall(r"([0-9.]+) (?:points|%)", same)
    ] == shown and "table" in same
    jump = {
        "model": "table",
        "time": [0.0, 0.5, 0.5, 1.0],
        "speed": [ends[0], ends[0], ends[1], ends[1]],
    }
    assert not any(
        text.startswith("along the")
        for text in diagnosis(Plan.of(scene(drive=jump, bonds=bonds)))
    )
    calm = scene(drive=ramp, bonds=bonds | {"rebinding_rate": "5000 1/s"})
    assert not any(
        text.startswith("along the ramp") for text in diagnosis(Plan.of(calm))
    )


def said(texts, start):
    """The sentences that begin with some words."""
    return [text for text in texts if text.startswith(start)]


#: A field of modes whose fifty thousand energies are drawn below, at three loads and behind bonds that break.
CALM = LENS | {"spectrum": GAUSSIAN | {"rms": "60 kPa"}}
BROKEN = {"model": "steady", "critical_speed": "9 um/s", "stress": "0.1 MPa"}


def drawn(lens, count=10_000):
    """Energies ΔΓ that a cell stores, as sums of one exponential number for each pair of modes."""
    cell = modes(
        lens.fluctuations.spectrum, lens.fluctuations.side(lens.setting.cell), 256
    )
    weights = cell.energies(HalfSpace(G, 0.5))
    return np.random.default_rng(4).exponential(size=(count, weights.size)) @ weights


def test_the_diagnosis_has_the_numbers_of_closed_forms_and_goes_with_the_dataset(scene):
    lens = scene(
        shear=CALM,
        bonds=BROKEN,
        sweep={"contact.load": ["1 mN", "5 mN", "20 mN"]},
    )
    texts = diagnosis(plan := Plan.of(lens))
    energies = drawn(plan.points[0])
    ratio = area(W - energies) / area(W)
    bonded = area(0.9 * W) / area(W)
    both = area(0.9 * W - energies) / area(W)
    (stored,) = said(texts, "stored energy")
    # the smallest cell, of the smallest load, stores least
    assert_allclose(
        float(re.search(r"sliding ([0-9.]+) mJ/m²", stored)[1]),
        1e3 * energies.mean(),
        atol=4e3 * energies.std() / math.sqrt(energies.size),
    )
    (mean,) = said(texts, "in steady sliding mean A/A_JKR")
    smallest, at, taken = re.fullmatch(
        r"in steady sliding mean A/A_JKR ([0-9.]+) to [0-9.]+ %, smallest at ([^:]*): points taken by"
        r" (.*) if fluctuations are subtracted first\)",
        mean,
    ).groups()
    assert at == "contact.load = 1 mN, 1 µm/s"
    points = [float(number) for number in re.findall("[0-9.]+", taken)]
    shares = 1.0 - bonded, bonded - both, ratio - both, 1.0 - ratio
    errors = [4.0 * np.std(share) / math.sqrt(ratio.size) for share in shares]
    for point, share, error in zip(points, shares, errors, strict=True):
        # two digits are printed
        digit = 10.0 ** (math.floor(math.log10(point)) - 1)
        assert_allclose(
            point, 100.0 * np.mean(share), rtol=0, atol=0.5 * digit + 100.0 * error
        )
    assert_allclose(float(smallest), 100.0 * both.mean(), atol=0.05 + 100.0 * errors[1])
    radius = math.sqrt(area(W, 1e-3) / math.pi)
    wide = math.sqrt(area(W, 20e-3) / math.pi)
    long = (100 * math.erf(math.pi * 10e-6 / (2 * size)) for size in (wide, radius))
    low, high = (f"{share:.2g}" for share in long)
    assert said(texts, "waves longer") == [
        f"waves longer than the contact store {low} to {high} % of the energy"
    ]
    q = 2 * math.pi / np.array([12e-6, 8e-6])
    (length,) = said(texts, "shear.spectrum.length")
    assert f"{math.sqrt(math.pi) / 4 * 10e-6 * q.sum():.2g} times less" in length
    dataset = run(lens)
    printed = preview(lens)
    assert read.remarks(dataset) == [*remarks(plan), *texts]
    assert all(text in printed for text in read.remarks(dataset))
    errors = {each.name: each for each in read.systematic_errors(dataset)}
    most = errors["cell_error_area"]
    assert_allclose(
        most.value, 100 * float(dataset["cell_error_area"].max()), rtol=1e-12
    )
    assert (most.unit, most.where) == (
        "points of A/A_JKR",
        "contact_load = 1 mN, 1 µm/s",
    )
    assert most.cure == cure(plan.points[0], systematic_errors(plan.points[0])) != ""


def test_remarks_on_a_dataset_need_no_file_but_a_measured_map(scene, tmp_path):
    table, stress_map = tmp_path / "psd.csv", tmp_path / "map.npy"
    table.write_text(
        "q [rad/m],C [Pa^2 m^2]\n1e4,1e-2\n1e5,1e-2\n1e6,1e-6\n", encoding="utf-8"
    )
    np.save(stress_map, 1e5 * np.random.default_rng(1).random((16, 16)))
    tabulated = {"model": "tabulated", "file": str(table)}
    of_table = scene(shear={"model": "mean", "spectrum": tabulated})
    mapped = scene(
        shear={"model": "mapped", "field": {"file": str(stress_map), "pixel": "50 um"}}
    )
    datasets, expected = (
        [run(of_table), run(mapped)],
        [*remarks(Plan.of(of_table)), *diagnosis(Plan.of(of_table))],
    )
    for path in (table, stress_map):
        path.unlink()
    assert read.remarks(datasets[0]) == expected != []
    (reason,) = read.remarks(datasets[1])
    assert "sim check" in reason and "shear.field" in reason


def test_a_contact_softer_than_the_onset_of_oscillations_lies_outside_the_rigid_slider(
    scene,
):
    spring = {"model": "spring", "stage": "10 mm/s", "stiffness": "100 N/m"}
    bonds = {
        "model": "rate",
        "rupture": {"model": "bell", "zero_force_rate": "20 1/s", "bell_force": "4 pN"},
    }
    bonds |= {
        "bond_stiffness": "0.8 uN/m",
        "rebinding_rate": "200 1/s",
        "start": "steady",
    }
    for density, outside in ((1.8e16, False), (2.2e16, True)):
        lens = scene(
            drive=spring,
            bonds=bonds | {"site_density": density},
            **{"adhesion.bond_share": 0.0},
        )
        # V = x k(x)
        x = scipy.optimize.brentq(
            lambda x: x * math.exp(x) - 10e-3 / 5e-6 / 20.0, 0.0, 9.0
        )
        k = 20.0 * math.exp(x)
        stiffness = density * 0.8e-6 * area(W) * 200.0 / (200.0 + k)
        needed = stiffness * (x * k - 200.0 - k) / (200.0 + 2.0 * k)
        own = math.pi**2 / 2 * G * lens.rest_radius
        assert (needed > own) == outside
        found = [
            text
            for text in remarks(Plan.of(lens))
            if "the model of a rigid slider does not hold" in text
        ]
        assert bool(found) == outside
    texts = (engineering(value, "N/m") for value in (needed, own))
    assert "needs {}, but the stiffness of the contact is {}".format(*texts) in found[0]


def test_the_speeds_at_which_a_spring_lets_the_slider_oscillate_are_roots_of_its_law(
    scene,
):
    rupture = {"model": "bell", "zero_force_rate": "20 1/s", "bell_force": "4 pN"}
    bonds = {
        "model": "rate",
        "rupture": rupture,
        "bond_stiffness": "0.8 uN/m",
        "rebinding_rate": "200 1/s",
        "site_density": 1.8e16,
        "start": "steady",
    }

    def spring(stiffness, stage):
        drive = {
            "model": "spring",
            "stage": stage,
            "stiffness": stiffness,
            "contact_stiffness": "rigid",
        }
        return scene(drive=drive, bonds=bonds, **{"adhesion.bond_share": 0.0})

    # V = x k(x) in stretches of 5 um, with the mean stretch x
    def speed(x):
        return 5e-6 * x * 20.0 * math.exp(x)

    def needed(x):
        k = 20.0 * math.exp(x)
        stiffness = 1.8e16 * 0.8e-6 * area(W) * 200.0 / (200.0 + k)
        return stiffness * (x * k - 200.0 - k) / (200.0 + 2.0 * k)

    peak = scipy.optimize.minimize_scalar(
        lambda x: -needed(x), bounds=(1.0, 9.0), method="bounded"
    ).x
    stiffness = 0.5 * needed(peak)
    # the law is met to 1e-5 of the stiffness, and is not flat
    width = 1e-4
    for stage in (0.2 * speed(peak), 2.0 * speed(peak)):
        ((low, high),) = stability(spring(stiffness, stage)).unstable
        for found, ends in ((low, (1.0, peak)), (high, (peak, 9.0))):
            root = scipy.optimize.brentq(lambda x: needed(x) - stiffness, *ends)
            assert_allclose(found, speed(root), rtol=width)
    plan = Plan.of(spring(stiffness, 2.0 * speed(peak)))
    low, high = (engineering(end, "m/s") for end in (low, high))
    text = f"unstable above {low}, and stable again above {high}, behind this spring"
    assert text in preview(plan.scenario)
    firm = spring(1.01 * needed(peak), speed(peak))
    assert "stable at any speed behind this spring" in preview(firm)
    assert "unstable" not in preview(firm)


def test_a_sweep_has_one_remark_with_the_range_of_its_values(scene):
    # the mean stress is 0.8 to 2 times the shear modulus; the first and the last of three values lie beyond 0.1
    stresses = [0.8 * G, 0.05 * G, 2.0 * G]
    found = remarks(
        Plan.of(
            scene(
                bonds={"model": "none", "stress": 0.05 * G},
                sweep={"bonds.stress": stresses},
            )
        )
    )
    (text,) = (text for text in found if "finite strains" in text)
    assert "is 0.8 to 2 times the shear modulus" in text
    assert text.endswith("(at bonds.stress = 400 kPa and 1 MPa, 2 of 3 points)")
    spring = {"model": "spring", "stage": "10 mm/s", "stiffness": "100 N/m"}
    bonds = {
        "model": "rate",
        "rupture": {"model": "bell", "zero_force_rate": "20 1/s", "bell_force": "4 pN"},
    }
    bonds |= {
        "bond_stiffness": "0.8 uN/m",
        "rebinding_rate": "200 1/s",
        "start": "steady",
        "site_density": 3e16,
    }
    plan = Plan.of(
        scene(drive=spring, bonds=bonds, sweep={"drive.stage": ["20 mm/s", "10 mm/s"]})
    )
    (text,) = (
        text
        for text in remarks(plan)
        if "the model of a rigid slider does not hold" in text
    )
    assert "at 10 mm/s to 20 mm/s stable" in text


#: Fluctuations that mask a lens at high speeds, in a review.
MASKS = Banded(
    spectrum=SelfAffine(1e5, 0.8, 50e-6, 50e-6, 1e-6), correlation=Time(time=20e-3)
)
MASKED = {"shear": MASKS, "bonds": Steady(critical_speed=10e-3, stress=0.3e6)}


def masked_share(lens, speed):
    law = StoredEnergy.of(lens)
    exact = scipy.stats.pearson3(law.skewness, law.mean, law.deviation)
    return 100.0 * exact.sf(42e-3 / (1.0 + speed / 10e-3))


def test_masking_is_told_with_its_share_and_its_points_and_not_where_there_is_none():
    speeds = ["12 mm/s", "20 mm/s", "24 mm/s", "30 mm/s"]
    sweep = read_sweep({"contact.load": ["4 mN", "32 mN"], "drive.speed": speeds})
    plan = Plan.of(small(sweep=sweep, **MASKED))
    (text,) = said(diagnosis(plan), "masked")
    low, high, most = re.fullmatch(
        r"masked for ([0-9.]+) to ([0-9.]+) % of the time in steady sliding at"
        r" drive.speed = 20 mm/s to 30 mm/s, 6 of 8 points; most at"
        r" contact.load = 32 mN, 30 mm/s: ([0-9.]+) % of the members at one time",
        text,
    ).groups()
    least, largest = (
        masked_share(plan.points[5], 20e-3),
        masked_share(plan.points[7], 30e-3),
    )
    # three digits are printed
    for shown, exact in ((low, least), (high, largest), (most, largest)):
        assert_allclose(float(shown), exact, rtol=5e-3)
    lens = small(drive=AtSpeed(speed=30e-3), **MASKED)
    (text,) = said(diagnosis(Plan.of(lens)), "masked")
    share = f"{masked_share(lens, 30e-3):.3g} %"
    assert share == "77.8 %"
    assert text == (
        f"masked for {share} of the time in steady sliding, as are {share} of the members at one time"
    )
    for calm in (
        small(drive=AtSpeed(speed=1e-3), **MASKED),
        small(
            drive=AtSpeed(speed=30e-3),
            **MASKED | {"shear": replace(MASKS, paid_by_adhesion=0.0)},
        ),
    ):
        assert not any("masked" in text for text in diagnosis(Plan.of(calm)))


def test_a_pull_off_by_fluctuations_is_told_and_not_under_a_load_that_holds():
    def pulled_off(load):
        contact = Equilibrium(load=load)
        lens = small(drive=AtSpeed(speed=10e-3), contact=contact, **MASKED)
        return said(diagnosis(Plan.of(lens)), "pulled off")

    (text,) = pulled_off(-0.1e-3)
    law = StoredEnergy.of(small(contact=Equilibrium(load=-0.1e-3), **MASKED))
    exact = scipy.stats.pearson3(law.skewness, law.mean, law.deviation)
    share = exact.sf(42e-3 / 2.0 - 0.1e-3 / (1.5 * math.pi * 2e-3))
    # open and closed contacts are told apart between two of 256 energies
    shown = float(re.search(r"up to ([0-9.]+) %", text)[1])
    assert_allclose(shown, 100.0 * share, atol=100.0 / 256)
    # new members exceed the limit later, and none of them closes again
    assert "add up" in text
    scene = small(
        contact=Equilibrium(load=-0.1e-3, after_pull_off="stay_open"),
        drive=AtSpeed(speed=10e-3),
        **MASKED,
    )
    scene = replace(scene, ensemble=Ensemble(members=200))
    opened = 1.0 - sim.run(scene)["in_contact"].mean("member")
    assert float(opened[-1]) > share + 5.0 * math.sqrt(share * (1.0 - share) / 200.0)
    assert pulled_off(0.1e-3) == []


@pytest.mark.parametrize("fluctuates", [True, False])
def test_a_contact_that_is_open_from_the_start_is_told_with_its_points(fluctuates):
    """Half of the adhesion holds 198 µN, and in the third point all of it does not."""
    parts = MASKED | {"drive": AtSpeed(speed=10e-3)}
    parts |= {"shear": replace(MASKS, cell=0.2e-3) if fluctuates else Uniform()}

    def told(*loads, **changes):
        sweep = read_sweep({"contact.load": [f"{load:g} N" for load in loads]})
        return diagnosis(Plan.of(small(sweep=sweep, **parts | changes)))

    texts = told(4e-3, -0.3e-3, -0.5e-3)
    (text,) = said(texts, "open for the whole run")
    assert "-300 µN and -500 µN, 2 of 3 points" in text
    # all others are of the point that is closed
    others = [each for each in texts if each != text]
    assert others and not [each for each in others if "-300 µN" in each]
    dataset = run(
        small(
            contact=Equilibrium(load=-0.3e-3, after_pull_off="reattach"),
            clock=Clock(0.1, 0.01),
            **parts,
        )
    )
    assert bool((dataset["in_contact"] == 0.0).all())
    alone = told(-0.3e-3)
    assert len(alone) == 1 and alone[0].startswith("open for the whole run")
    assert not said(told(4e-3, 0.0), "open")
    unbroken = told(-0.3e-3, bonds=Unbroken(stress=0.3e6))
    assert fluctuates or not said(unbroken, "open")


def test_the_largest_loss_answers_why_no_mechanism_takes_a_tenth_of_the_area():
    def losses(*loads, share=1.0, **parts):
        sweep = read_sweep({"contact.load": [f"{load:g} N" for load in loads]})
        adhesion = Adhesion(work=42e-3, bond_share=share)
        lens = small(sweep=sweep, adhesion=adhesion, **parts)
        (text,) = said(diagnosis(Plan.of(lens)), "largest loss")
        return text

    def lost(load, left=0.0):
        radii = jkr.radius_at_load(load, np.array([left, 42e-3]), 2e-3, 6.4e6)
        return f"{100.0 * (1.0 - (radii[0] / radii[1]) ** 2):.3g}"

    stress = "the mean stress of steady sliding if contact.reversible = 1"
    firm = losses(0.05, 1.0, bonds=Unbroken(stress=1e6))
    assert firm == (
        f"largest loss of area at this load (most at contact.load = 50 mN): {lost(1.0)} to {lost(0.05)} % by"
        f" broken bonds, by fluctuations, by {stress}, each alone"
    )
    half = losses(0.05, share=0.5)
    assert half == (
        f"largest loss of area at this load: {lost(0.05, 21e-3)} % by broken bonds; {lost(0.05)} % by fluctuations;"
        f" 0 % by {stress}"
    )
    strict = losses(0.05, shear=replace(MASKS, paid_by_adhesion=0.0))
    assert "fluctuations if shear.paid_by_adhesion = 1" in strict
    assert "100 % (a pull-off) by broken bonds" in losses(-1e-4)
    assert "pull-off" not in firm + half + strict


STRETCHED = {
    "model": "rate",
    "rupture": {"model": "bell", "zero_force_rate": "25 1/s", "bell_force": "4 pN"},
    "bond_stiffness": "0.8 uN/m",
    "rebinding_rate": "250 1/s",
    "site_density": "6.5e16 1/m^2",
}


def test_a_prescribed_force_has_a_mean_stress_although_its_speed_is_not_known(scene):
    def pulled(force, **changes):
        drive = {"model": "force", "force": force}
        return scene(drive=drive, bonds=STRETCHED, **changes)

    lens = pulled("10 mN")
    (text,) = said(diagnosis(Plan.of(lens)), "largest loss")
    assert "by broken bonds" in text and "mean stress" not in text
    (prescribed,) = said(diagnosis(Plan.of(scene(bonds=STRETCHED))), "largest loss")
    assert "the mean stress of steady sliding" in prescribed
    # the interface bears the force on the area at rest
    area = math.pi * jkr.radius_at_load(LOAD, W, R, 4.0 * G) ** 2
    assert limits(lens)["tau0/G"][0] == f"{10e-3 / area / G:.3g}"
    ramp = pulled({"from": "0 N", "to": "-20 mN"})
    assert limits(ramp)["tau0/G"][0] == f"{20e-3 / area / G:.3g}"
    (text,) = said(remarks(Plan.of(ramp)), "the mean stress is")
    assert f"is {20e-3 / area / G:.2g} times" in text
    assert not said(remarks(Plan.of(pulled("1 mN"))), "the mean stress is")


def test_steady_sliding_on_a_viscous_interface_bears_what_its_run_does(scene):
    stage, viscosity = "0.4 mm/s", 5e8
    spring = {"model": "spring", "stage": stage, "stiffness": "1 kN/m"}
    dry = scene(drive=spring | {"damping": "10 mN s/m"}, bonds=STRETCHED)
    wet = scene(drive=spring | {"viscosity": viscosity}, bonds=STRETCHED)
    of_bonds = float(dry.limits.strain) * G
    total = of_bonds + viscosity * 4e-4
    assert limits(wet)["tau0/G"][0] == f"{total / G:.3g}"
    result = sensitivities(wet, 0.0, 4e-4)
    area, friction = result["drive.viscosity"]
    assert area == 0.0
    assert_allclose(friction, 1.0 - of_bonds / total, rtol=1e-6)
    area, friction = result["bonds.site_density"]
    assert_allclose(friction - area, of_bonds / total, rtol=1e-6)
    assert "drive.viscosity" not in sensitivities(dry, 0.0, 4e-4)
    curves = sim.steady_curves(wet, np.array([4e-4]))
    stress = curves["friction_force"] / curves["contact_area"]
    assert_allclose(stress, total, rtol=1e-12)
    clock = {"clock.duration": "0.1 s", "clock.step": "1 ms", "clock.record": "10 ms"}
    course = sim.run(wet.with_values(clock | {"drive.start": "steady"}))
    # the run starts in steady sliding, as well as the tolerance of its motion keeps it
    tolerance = wet.drive.tolerance
    assert_allclose(course["shear_stress"], total, rtol=10.0 * tolerance)


def test_a_loss_of_rounding_is_printed_as_zero(scene):
    lens = {"solid.shear_modulus": 1.6e6, "sphere.radius": 2e-3, "adhesion.work": 42e-3}
    course = {"from": "2 um", "to": "-25 um"}
    mount = {"stiffness": "1 MN/m", "displacement": course}
    pulled = scene(
        **lens, contact=mount, **{"clock.record": "1 ms", "clock.duration": "2 s"}
    )
    (text,) = said(diagnosis(Plan.of(pulled)), "largest loss")
    assert "e-" not in text and "; 0 % by the mean stress" in text


TIP = {
    "solid": {"youngs_modulus": "60 GPa", "poisson_ratio": 0.1},
    "sphere.radius": "100 nm",
    "adhesion.work": "0.4 J/m^2",
}
GEL = {"solid.shear_modulus": "50 Pa", "adhesion.work": "10 mJ/m^2"}


def limits(lens):
    """The rows of the limits of a theory, each as name, value and meaning."""
    block = preview(lens).partition("\nlimits of the theory\n")[2].partition("\n\n")[0]
    rows = (re.split(" {2,}", line.strip()) for line in block.splitlines())
    return {name: words for name, *words in rows}


def test_a_scene_outside_of_the_theory_is_told_with_the_number_and_the_points(scene):
    tip = scene(**TIP, sweep={"contact.load": ["-160 nN", "1 nN", "400 nN"]})
    modulus = 60e9 / (1.0 - 0.01)
    near, far = (
        (1e-7 * 0.4**2 / modulus**2 / distance**3) ** (1 / 3)
        for distance in (0.4e-9, 0.16e-9)
    )
    assert limits(tip)["Tabor number"][0] == f"{near:.3g} to {far:.3g}"
    (text,) = said(remarks(Plan.of(tip)), "the Tabor number")
    assert f"is {near:.2g} for z0 = 0.4 nm and {far:.2g} for z0 = 0.16 nm" in text
    gel = scene(
        **GEL,
        bonds={"model": "none", "stress": "20 Pa"},
        sweep={"contact.load": ["1 uN", "1 mN"]},
    )
    found = remarks(Plan.of(gel))
    sizes = [jkr.radius_at_load(load, 10e-3, R, 200.0) for load in (1e-6, 1e-3)]
    (large,) = said(found, "the contact radius")
    ends = " to ".join(f"{size / R:.2g}" for size in sizes)
    assert f"reaches {ends} of the sphere's" in large
    assert limits(gel)["a/R"][0] == " to ".join(f"{size / R:.3g}" for size in sizes)
    (wet,) = said(found, "surface tension")
    ends = " to ".join(f"{0.072 / 150.0 / size:.2g}" for size in sizes[::-1])
    assert f"γ/E is {ends} of the contact radius if γ = 72 mN/m" in wet
    assert limits(gel)["gamma/E"][0] == f"{5e-3 / 150:.3g} to {0.072 / 150:.3g} m"
    assert limits(gel)["tau0/G"][0] == "0.4"
    firm = scene(bonds={"model": "none", "stress": 0.08 * G})
    assert remarks(Plan.of(firm)) == []
    assert limits(firm)["tau0/G"][0] == "0.08"
    # two bodies bear the same stress, which strains the softer one most, whichever is the sphere
    soft, hard = {"shear_modulus": G}, {"youngs_modulus": 9.0 * G, "poisson_ratio": 0.3}
    for bodies in (
        soft | {"counter_body": soft},
        soft | {"counter_body": hard},
        hard | {"counter_body": soft},
    ):
        pair = scene(solid=bodies, bonds={"model": "none", "stress": 0.08 * G})
        assert said(remarks(Plan.of(pair)), "the mean stress is") == []
        assert limits(pair)["tau0/G"][0] == "0.08"
        ends = f"{0.5 * W / 3.0 / G:.3g} to {0.072 / 3.0 / G:.3g} m"
        assert limits(pair)["gamma/E"][0] == ends
    # a sphere without adhesion is Hertz's, whatever its Tabor number
    hertz = scene(**TIP | {"adhesion.work": 0.0}, **{"contact.load": "1 nN"})
    assert said(remarks(Plan.of(hertz)), "the Tabor number") == []
    assert "Tabor number" not in limits(hertz)


def test_a_remark_on_a_swept_point_names_it_and_is_absent_without_it(scene):
    loads = ["-200 nN", "-190 nN", "1 nN"]
    swept = remarks(Plan.of(scene(**TIP, sweep={"contact.load": loads})))
    (text,) = said(swept, "the contact is open")
    assert text.endswith("(at contact.load = -200 nN and -190 nN, 2 of 3 points)")
    closed = remarks(Plan.of(scene(**TIP, sweep={"contact.load": loads[2:]})))
    assert said(closed, "the contact is open") == []
    wide = remarks(
        Plan.of(scene(**GEL, sweep={"solid.shear_modulus": ["50 Pa", "1 MPa"]}))
    )
    (text,) = said(wide, "the contact radius")
    assert text.endswith("(at solid.shear_modulus = 50 Pa, 1 of 2 points)")


@pytest.mark.parametrize("drive", ["steady", "spring", "force"])
@pytest.mark.parametrize(
    ("shear", "contact", "fluctuates"),
    [
        ("banded, slip, onset", "load", True),
        ("modal, time, constant", "load", True),
        ("uniform", "load", False),
        ("mean", "load", False),
        ("banded, slip, onset", "rate_dependent", False),
    ],
)
def test_a_carried_area_is_said_not_to_converge_only_if_fluctuations_move_it(
    drive, shear, contact, fluctuates
):
    lens = small(
        drive=DRIVES[drive],
        bonds=BONDS["rate, cut-off, carried"],
        shear=SHEARS[shear],
        contact=CONTACTS[contact],
    )
    assert (
        any("carried area does not converge" in text for text in lens.remarks())
        == fluctuates
    )
    free = (
        small(
            drive=DRIVES[drive],
            bonds=BONDS["rate, cut-off, carried"],
            contact=CONTACTS[contact],
            shear=replace(SHEARS[shear], paid_by_adhesion=0.0),
        )
        if fluctuates
        else lens
    )
    assert not any("carried area does not converge" in text for text in free.remarks())


@pytest.mark.parametrize(
    "slider", ["spring with mass", "start", "table", "linear ramp", "force"]
)
def test_a_run_has_as_many_speeds_as_asked_for_and_each_contact_has_a_diagnosis(slider):
    contacts, fields = (
        ("load", "lifted", "tension", "rate_dependent"),
        ("mean, slip rate", "modal, slip rate"),
    )
    for contact, field in itertools.product(contacts, fields):
        parts = {
            "contact": CONTACTS[contact],
            "bonds": BONDS["rate, bell"],
            "shear": SHEARS[field],
        }
        plan = Plan.of(small(2, drive=DRIVES[slider], **parts))
        assert plan.points[0].speeds(5).shape == (5,)
        assert not any(
            re.search("nan|inf ", text) for text in [*diagnosis(plan), *remarks(plan)]
        )


#: Bonds that lag behind a ramp through their critical speed.
SLOW = {
    "model": "rate",
    "critical_speed": "1 mm/s",
    "rebinding_rate": "5 1/s",
    "stress": "0.2 MPa",
}
QUICK = {"model": "ramp", "from": "0.1 mm/s", "to": "5 mm/s"}


def test_the_lag_along_a_ramp_is_that_of_the_point_of_a_sweep_that_lags_most(scene):
    rates = ["5 1/s", "5000 1/s", "6000 1/s"]
    lens = scene(drive=QUICK, bonds=SLOW, sweep={"bonds.rebinding_rate": rates})
    (line,) = said(diagnosis(Plan.of(lens)), "along the ramp")
    assert "at bonds.rebinding_rate = 5 1/s" in line


def test_the_smallest_area_is_told_with_the_mount_that_makes_it_and_a_largest_energy_as_one(
    scene,
):
    falling = scene(bonds=BROKEN, contact={"load": {"from": "4 mN", "to": "1 mN"}})
    (mean,) = said(diagnosis(Plan.of(falling)), "in steady sliding mean A/A_JKR")
    assert "smallest at 1 µm/s, contact.load = 1 mN:" in mean
    grows = {"model": "onset", "speed": "1 mm/s", "width": 0.2}
    for amplitude, changes in ((grows, True), ({"model": "constant"}, False)):
        lens = scene(drive=QUICK, bonds=BROKEN, shear=CALM | {"amplitude": amplitude})
        (stored,) = said(diagnosis(Plan.of(lens)), "stored energy")
        assert ("up to" in stored) is changes


def test_errors_of_an_amplitude_that_depends_on_the_motion_are_told_as_those_of_amplitude_1(
    scene,
):
    """In steady sliding the field has no amplitude, so that the cell has no error there."""
    spring = {"model": "spring", "stage": "1 mm/s", "stiffness": "500 N/m"}
    spring |= {"damping": "0.1 N s/m", "contact_stiffness": "rigid"}
    clock = {"duration": "10 ms", "step": "1 ms"}
    moved = {"model": "slip_rate", "memory_length": "20 um"}
    for amplitude, is_told in ((moved, True), ({"model": "constant"}, False)):
        parts = {"bonds": BROKEN | {"critical_speed": "9 mm/s"}, "clock": clock}
        lens = scene(drive=spring, shear=LENS | {"amplitude": amplitude}, **parts)
        text = str(preview(lens))
        assert ("1 mm/s, at amplitude 1" in text) is is_told
        errors = read.systematic_errors(run(lens))
        assert all(each.where.endswith("at amplitude 1") is is_told for each in errors)
        assert errors


PROBE = {
    "clock": {"duration": "1 ms", "step": "0.1 ms"},
    "solid": {"youngs_modulus": "60 GPa"},
    "sphere": {"radius": "100 nm"},
    "adhesion": {"work": "0.4 J/m^2"},
    "drive": {"speed": "1 um/s"},
}


def test_a_tip_that_never_comes_within_reach_or_hangs_too_heavy_is_open_for_the_whole_run():
    def told(**contact):
        contact |= {"model": "cohesive", "range": "0.3 nm"}
        plan = Plan.of(sim.Scenario(**PROBE | {"contact": contact}))
        return diagnosis(plan), remarks(plan)

    for contact, is_open in (
        ({"load": "-0.3 uN"}, True),
        ({"load": {"from": "-0.3 uN", "to": "0 N"}}, False),
        ({"indentation": {"from": "-5 nm", "to": "-1 nm"}}, True),
        ({"indentation": {"from": "-5 nm", "to": "-0.29 nm"}}, False),
    ):
        texts, notes = told(**contact)
        assert bool(said(texts, "open for the whole run")) is is_open, contact
        assert bool(said(notes, "the contact is open even")) is is_open, contact


def test_a_disc_is_proposed_to_a_contact_that_can_have_one_alone():
    field = {"model": "gaussian", "rms": "1 GPa", "length": "2 nm"}
    parts = PROBE | {"shear": {"model": "mean", "spectrum": field}}
    for model, is_known in (("cohesive", False), ("equilibrium", True)):
        contact = {"model": model, "load": "50 nN"}
        contact |= {"range": "0.3 nm"} if model == "cohesive" else {}
        texts = remarks(Plan.of(sim.Scenario(**parts | {"contact": contact})))
        (text,) = (each for each in texts if "of the plane per new area" in each)
        assert ("disc" in text) is is_known


def test_the_shear_of_a_layer_that_a_sphere_squeezes_is_that_of_its_flow_outwards(
    scene,
):
    thickness = 10e-6
    thin = scene(**{"solid.thickness": thickness})
    a = thin.widest
    r = np.linspace(0.0, a, 4001)
    # no volume leaves the layer under the contact
    sunk = a**2 / (4.0 * R) - r**2 / (2.0 * R)
    # the volume that is pressed out inside of r leaves through 2 pi r h, with no slip at the base alone
    outwards = scipy.integrate.cumulative_simpson(sunk * r, x=r, initial=0.0)[1:]
    strain = 3.0 * outwards / (r[1:] * thickness) / thickness
    rows = limits(thin)
    (name,) = (name for name in rows if "h²" in name)
    assert_allclose(float(rows[name][0]), strain.max(), rtol=5e-3)
    assert "strain of the solid" not in rows["a/R"][1]
    (text,) = said(remarks(Plan.of(thin)), "the sphere shears the base")
    assert f"about {strain.max():.2g}:" in text
    for others in ({}, {"solid.thickness": 10.0 * a}):
        wide = scene(**others)
        assert not any("h²" in name for name in limits(wide))
        assert "strain of the solid" in limits(wide)["a/R"][1]
        assert not said(remarks(Plan.of(wide)), "the sphere shears")
