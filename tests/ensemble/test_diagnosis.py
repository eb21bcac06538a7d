"""Systematic errors of a run, its diagnosis and its remarks, against closed forms and solutions of other codes."""

import itertools
import math
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import scipy
from helpers.parts import jkr, load, read, run
from helpers.scenes import BONDS, CONTACTS, DRIVES, SHEARS, scene as small
from numpy.testing import assert_allclose

from sim.ensemble.diagnosis import (
    _along_course,
    _behind,
    cure,
    diagnosis,
    remarks,
    systematic_errors,
)
from sim.ensemble.plan import Plan
from sim.ensemble.preview import preview
from sim.ensemble.steady import sensitivities
from sim.parts.shear.modes import modes
from sim.spectrum.families import (
    AnisotropicGaussian,
    Band,
    Gaussian,
    Ripple,
    SelfAffine,
)
from sim.spectrum.radial import share_of_long_waves
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

            def density(angle, q, family=family, ratio=ratio):
                return family.density(q * math.cos(angle), q * math.sin(angle)) * (
                    1.0 - ratio * math.cos(angle) ** 2
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
                / float(family.surface_energy(1.0, ratio))
            )
            assert_allclose(
                share_of_long_waves(family, wavelength, ratio),
                share,
                rtol=1e-6,
                atol=1e-12,
            )
    # equal steps of q
    assert_allclose(
        share_of_long_waves(Band(1.0, 60e-6, 20e-6), 30e-6), 0.5, rtol=1e-12
    )
    assert [share_of_long_waves(Ripple(1.0, 2.0), end) for end in (1.0, 3.0)] == [
        1.0,
        0.0,
    ]


def test_the_systematic_error_covers_what_the_cell_leaves_out_and_its_cure_works(scene):
    lens = scene(shear=LENS, **{"ensemble.members": 64})
    stated, exact = systematic_errors(lens), float(area(W - STORED) / area(W))
    assert_allclose(exact, 0.413, atol=5e-4)
    cell = modes(
        lens.fluctuations.spectrum, lens.fluctuations.side(lens.setting.cell), 256
    )
    weights = cell.energies(G, 0.5)
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
    cured = lens.with_values(
        flat(tomllib.loads(cure(lens, stated).replace(" and ", "\n")))
    )
    assert cured.fluctuations.cell == 4e-3
    for scenario in (lens, cured):
        ratios = np.asarray(run(scenario)["contact_area"].isel(t=-1)) / area(W)
        known, error = (
            systematic_errors(scenario),
            ratios.std() / math.sqrt(ratios.size),
        )
        assert abs(ratios.mean() - exact) < abs(known["cell_error_area"]) + 2.0 * error
    assert abs(known["cell_error_area"]) < 0.12 * stated["cell_error_area"]


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
    ).energies(G, 0.5)
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


def flat(document):
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
    values = flat(tomllib.loads(cure(lens, before).replace(" and ", "\n")))
    assert values.keys() == keys
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


def test_the_diagnosis_has_the_numbers_of_closed_forms_and_goes_with_the_dataset(scene):
    bonds = {"model": "steady", "critical_speed": "9 um/s", "stress": "0.1 MPa"}
    calm = GAUSSIAN | {"rms": "60 kPa"}
    lens = scene(
        shear=LENS | {"spectrum": calm},
        bonds=bonds,
        sweep={"contact.load": ["1 mN", "5 mN", "20 mN"]},
    )
    texts = diagnosis(plan := Plan.of(lens))
    stored = STORED * (60 / 80) ** 2
    full = area(W, 5e-3)
    rest, bonded, waves, both = (
        100 * float(area(w, 5e-3) / full)
        for w in (W, 0.9 * W, W - stored, 0.9 * W - stored)
    )
    energy, long, length, mechanisms, strict, *_ = texts
    assert energy.startswith(
        f"stored energy in steady sliding {1e3 * stored:.4g} mJ/m², {100 * stored / W:.2g} % of"
    )
    fast = bonds | {"critical_speed": "0.1 um/s"}
    fast = Plan.of(
        scene(shear=LENS, bonds=fast, sweep={"contact.load": ["1 mN", "5 mN"]})
    )
    assert (
        "masked throughout the run at contact.load = 5 mN, 1 µm/s" in diagnosis(fast)[0]
    )
    radius = math.sqrt(full / math.pi)
    assert f"store {100 * math.erf(math.pi * 10e-6 / (2 * radius)):.2g} %" in long
    q = 2 * math.pi / np.array([12e-6, 8e-6])
    assert (
        f"{math.sqrt(math.pi) / 4 * 10e-6 * q.sum():.2g} times less" in length
        and "5.8" in length
    )
    taken = rest - bonded, bonded - both, waves - both, rest - waves
    assert mechanisms == (
        f"the mean A/A_JKR at contact.load = 5 mN, 1 µm/s is {both:.3g} %: bonds take {taken[0]:.2g} points,"
        f" fluctuations {taken[1]:.2g} ({taken[2]:.2g} and {taken[3]:.2g} if fluctuations are subtracted first)"
    )
    assert strict.endswith(f"(shear.paid_by_adhesion = 0) A/A_JKR is {bonded:.3g} %")
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


def test_a_sweep_has_one_remark_with_the_range_of_its_values(scene):
    # the mean stress is 0.8 to 2 times the shear modulus; the first and the last of three values lie beyond 0.5
    stresses = [0.8 * G, 0.1 * G, 2.0 * G]
    found = remarks(
        Plan.of(
            scene(
                bonds={"model": "none", "stress": 0.1 * G},
                sweep={"bonds.stress": stresses},
            )
        )
    )
    (text,) = (text for text in found if "linear elasticity" in text)
    assert "is 0.8 to 2 times the shear modulus" in text
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
        ("mean, slip rate", "modal, fixed"),
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
