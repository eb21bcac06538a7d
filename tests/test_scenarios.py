"""Every scenario of the repository runs, and says what it says it shows."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest
from helpers.parts import jkr, load, read, run
from helpers.statements import shares
from numpy.testing import assert_allclose
from scipy.optimize import curve_fit

from sim import fit
from sim.laws import schallamach as law
from sim.read.slips import unresolved_slips

FOLDER = Path(__file__).parent.parent / "scenarios"
NAMES = sorted(path.stem for path in FOLDER.glob("*.toml"))
#: What is left out of a long scene where its claim needs less; the whole scene is run by make verify.
SHORT = {
    "static_peak": {
        "clock.duration": "0.7 s",
        "clock.step": "1 ms",
        "sweep": {
            "drive.rest": ["0.1 s", "0.5 s"],
            "drive.speed": ["300 nm/s", "1 um/s", "10 um/s"],
        },
    },
    "pull_off": {"clock.step": "8 ms", "clock.record": "8 ms"},
    "peeling": {"clock.step": "20 ms"},
    "motor_clutch": {
        "clock.duration": "120 s",
        "sweep": {"drive.contact_stiffness": ["0.1 pN/nm", "10 pN/nm"]},
    },
    "stability_map": {
        "clock.duration": "3.2 s",
        "sweep": {"drive.stiffness": ["100 N/m", "500 N/m", "1600 N/m"]},
    },
    "pdms_lens_spring": {
        "clock.duration": "0.4 s",
        "sweep": {"drive.stage": ["2 mm/s", "3 mm/s"]},
    },
}
WHOLE = [pytest.param(f"whole {name}", marks=pytest.mark.verify) for name in SHORT]
#: Mean contact area [m^2] and friction [N] of four members, only to notice an unintended change of the numbers.
#: A slider that feels its friction is solved to a tolerance and has none.
GOLDEN = {
    "afm_tip": (3.346317389611426e-16, 3.0116856506502844e-07),
    "bond_noise": (4.1409205484494964e-08, 0.007437060452744728),
    "decomposition": (4.303852355076199e-08, 0.009838144173897688),
    "fixed_grips": (1.7007233155381927e-08, 0.003998478821274799),
    "friction_maximum": (4.12663152393395e-08, 0.004502167913896796),
    "jkr_test": (3.278041210714769e-08, 0.0),
    "masking": (3.8870006327848614e-08, 0.0),
    "measured_lens": (4.274467968726667e-08, 0.009729651119650897),
    "pdms_lens": (4.0232986563229426e-08, 0.009507511588392243),
    "peeling": (3.44730056493401e-09, 0.0),
    "whole peeling": (3.343116994589865e-09, 0.0),
    "own_map": (4.089592347724291e-08, 0.00817918469544858),
    "own_psd": (4.0183248953834534e-08, 0.016073299581533813),
    "pull_off": (4.146672494615672e-09, 0.0),
    "whole pull_off": (4.140449021877637e-09, 0.0),
    "theories": (3.920687657963458e-08, 0.002787734357697382),
    "soft_lens": (1.1643866279338594e-05, 0.5292666490608452),
    "static_peak": (3.5753868919814446e-08, 0.0008909207055409984),
    "whole static_peak": (3.7680708417553426e-08, 0.0012383130676348923),
    "ten_wavelengths": (4.033500042885014e-08, 0.0),
    "uniform_stress": (3.849406592790275e-08, 0.013472923074765964),
}


def at(name, **overrides):
    return run(load(FOLDER / f"{name}.toml", overrides))


@pytest.fixture(scope="module", params=NAMES + WHOLE)
def name(request):
    """The name of each scenario; its tests follow one another in one process, which runs it once."""
    return request.param


def test_the_statistics_of_every_scenario_have_sixty_columns_at_most(name):
    one = read.Run(four(name))
    assert len(read.frame(one).columns) <= 60
    tables = read.tables_of(one)
    assert all(len(table.rows[0]) <= 10 for table in tables)
    # a column whose number is missing says why, in a note or in the registry
    assert read.notes(one, tables).headings


@functools.cache
def four(name):
    """A scenario with four members, short or whole, run once for all tests."""
    return at(
        name.removeprefix("whole "), **{"ensemble.members": 4} | SHORT.get(name, {})
    )


def test_every_scenario_opens_with_its_question_and_runs(name):
    text = (FOLDER / f"{name.removeprefix('whole ')}.toml").read_text(encoding="utf-8")
    assert text.startswith("# ") and "?" in text.partition("\n\n")[0]
    dataset = four(name)
    going = dataset["runaway_time"].isnull() if "runaway_time" in dataset else True
    assert (np.isfinite(dataset["contact_radius"]) == going).all() and dataset[
        "contact_radius"
    ].max() > 0.0
    # a change that moves them on purpose is listed in the changelog under "Numbers changed"
    if name in GOLDEN:
        means = (
            float(dataset["contact_area"].mean()),
            float(dataset["friction_force"].mean()),
        )
        assert_allclose(means, GOLDEN[name], rtol=1e-10, atol=0)


def test_the_lens_shows_the_papers_finding():
    dataset = at("pdms_lens", **{"ensemble.members": 64})
    area, speed = dataset["contact_area"], dataset["speed"].values
    share = (
        (area / (np.pi * dataset["radius_at_rest"] ** 2))
        .transpose("member", "t")
        .values
    )
    slow = speed <= 1e-3
    assert abs(share.mean(0)[slow] - 1.0).max() < 0.03
    at_one, at_ten = (share[:, np.argmin(abs(speed - v))] for v in (1e-3, 1e-2))
    assert at_one.mean() - at_ten.mean() > 0.15
    assert np.all(
        dataset["contact_radius"] >= dataset["radius_without_adhesion"] * (1.0 - 1e-12)
    )
    # the bond law alone costs 1.85 % of the area at 1 mm/s
    alone = jkr.radius_at_load(4e-3, 42e-3 / 1.1, 2e-3, 6.4e6) / jkr.radius_at_load(
        4e-3, 42e-3, 2e-3, 6.4e6
    )
    assert_allclose(1.0 - alone**2, 0.0185, atol=5e-5)
    # between 2 and 3 mm/s each mechanism's share of the lost area is larger than its standard error
    middle = np.argmin(abs(speed - 2.5e-3))
    bonded = jkr.radius_at_load(
        4e-3, 42e-3 * float(dataset["bond_fraction"][middle]), 2e-3, 6.4e6
    )
    to_bonds = 1.0 - (bonded / float(dataset["radius_at_rest"])) ** 2
    to_fluctuations = 1.0 - to_bonds - share[:, middle]
    error = to_fluctuations.std(ddof=1) / np.sqrt(len(to_fluctuations))
    assert to_bonds > error and to_fluctuations.mean() > error


def test_masking_is_the_closed_form_and_a_uniform_stress_changes_nothing():
    dataset = at("masking").isel(t=-1)
    hertz = dataset["radius_without_adhesion"].values
    masked = dataset["shear_spectrum_amplitude"].values >= 375.158e3
    assert_allclose(dataset["contact_radius"].values[masked], hertz[masked], rtol=1e-13)
    assert np.all(
        dataset["contact_radius"].values[~masked] > hertz[~masked] * (1.0 + 1e-4)
    )
    work = float(dataset["work_of_adhesion"].sel(shear_spectrum_amplitude=375e3))
    assert_allclose(work, 42e-3 * (1 - (375 / 375.157768) ** 2), rtol=1e-6)
    radii = four("uniform_stress")["contact_radius"]
    assert np.all(radii == radii.isel(bonds_stress=0))


def test_the_made_up_jkr_test_gives_the_work_and_modulus_with_which_it_was_made():
    found = fit(
        FOLDER / "jkr_fit.toml",
        FOLDER / "jkr_fit.csv",
        ["adhesion.work", "solid.youngs_modulus"],
        steady=True,
    )
    loads, radii, _ = np.loadtxt(
        FOLDER / "jkr_fit.csv", delimiter=",", skiprows=1, unpack=True
    )

    def radius_at(load, work, modulus):
        return 1e6 * jkr.radius_at_load(1e-3 * load, work, 2e-3, modulus)

    own, covariance = curve_fit(
        radius_at, loads, radii, [45e-3, 2e6], 0.01 * radii, absolute_sigma=True
    )
    for item, scale, value, variance, truth in zip(
        found.numbers,
        (1.0, 4.0 / 3.0),
        own,
        np.diag(covariance),
        (45e-3, 2e6),
        strict=True,
    ):
        assert_allclose(scale * item.value, value, rtol=1e-4)
        assert_allclose(scale * item.error, math.sqrt(variance), rtol=0.02)
        assert item.interval.low < truth / scale < item.interval.high


def test_a_jkr_test_with_a_slow_edge_reads_two_works_of_adhesion():
    dataset = at("jkr_test")
    held = np.flatnonzero(
        np.isclose(dataset["normal_load"].isel(contact_front_speed=0), 1e-3, rtol=1e-9)
    )
    half = dataset.sizes["t"] // 2
    radius = dataset["contact_radius"].isel(t=[held[held < half][-1], held[-1]])
    loading, unloading = jkr.energy_release_rate(
        radius.transpose("t", ...).values, 1e-3, 2e-3, 6.4e6
    )
    assert np.all(loading < 42e-3) and np.all(unloading > 42e-3)
    assert np.all(np.diff(loading) > 0.0) and np.all(np.diff(unloading) < 0.0)


def bell(dataset):
    """Rates, force and stiffness of a scenario's bonds, as the laws take them."""
    names = (
        "rupture_zero_force_rate",
        "rupture_bell_force",
        "bond_stiffness",
        "rebinding_rate",
    )
    return tuple(float(dataset[f"bonds_{name}"]) for name in names)


def mean_field(dataset):
    """Numbers of ``bell`` and the density of the sites."""
    return *bell(dataset), float(dataset["bonds_site_density"])


@pytest.mark.parametrize(
    "name", ["static_peak", pytest.param("whole static_peak", marks=pytest.mark.verify)]
)
def test_the_static_peak_ages_to_an_end_and_grows_with_the_logarithm_of_the_speed(name):
    dataset = four(name)
    rate, force, stiffness, binding = bell(dataset)
    stress = dataset["shear_stress"] / (dataset["bonds_site_density"] * force)
    for rest in dataset["drive_rest"].values:
        bound = binding / (binding + rate) * -math.expm1(-(binding + rate) * rest)
        for speed in dataset["drive_speed"].values:
            found = stress.sel(drive_rest=rest, drive_speed=speed).values
            sliding = np.maximum(dataset["t"].values - rest, 0.0)
            # the bonds of the rest, all unstretched, and at the most what would rebind if every site were free
            held = (
                bound
                * law.start_up_force(sliding, speed, rate, force, stiffness)
                / force
            )
            reborn = (
                binding
                * stiffness
                * speed
                / force
                * law.bell_lives(speed, rate, force, stiffness).half_square
            )
            assert np.all(found >= held * (1.0 - 1e-4)) and np.all(
                found <= (held + reborn) * (1.0 + 1e-4)
            )
            assert (
                found.max()
                > 1.05
                * law.bell_moments(speed, rate, force, stiffness, binding).force
                / force
            )
    peaks = stress.max("t").transpose("drive_rest", "drive_speed").values
    assert np.all(np.diff(peaks, axis=0) > 0.0) and np.all(np.diff(peaks, axis=1) > 0.0)
    # at 10 um/s rebinding adds 0.021 of a Bell force a site at the most: the peak is the number that came at rest
    came = -np.expm1(-2.0 * dataset["drive_rest"].values)
    assert_allclose(
        peaks[:, -1] / peaks[-1, -1], came / came[-1], atol=0.021 / peaks[-1, -1]
    )


def strengths(dataset, name="shear_stress"):
    """Magnitude of the stress, and that of steady sliding at the speed of the moment."""
    stress = abs(dataset[name])
    return stress, stress.copy(
        data=law.first_moment_stress(abs(dataset["speed"].values), *mean_field(dataset))
    )


def test_stick_slip_sets_in_beyond_the_friction_maximum():
    dataset = four("stick_slip")
    peak, slips = (
        law.first_moment_peak(*mean_field(dataset)),
        read.slips(dataset),
    )
    force = dataset["spring_force"].values
    began = int(np.argmax(force < 0.5 * np.maximum.accumulate(force)))
    assert slips.sizes["slip"] > 10 and unresolved_slips(dataset) == []
    assert peak.speed < float(dataset["stage_speed"][began]) < 2.0 * peak.speed
    stress, steady = strengths(dataset.isel(t=slice(0, began - 125)))
    # the ramp is slow beside the bonds: 0.75 decades a second against 25/s
    assert_allclose(stress, steady, rtol=0.02)
    assert np.all(slips["force_drop"][1:] > 0.5 * slips["static_friction"][1:])


def test_the_area_falls_with_the_square_of_the_force_and_more_under_a_smaller_load():
    dataset = four("incipient_shear")
    lost = []
    for place in range(dataset.sizes["contact_load"]):
        own = dataset.isel(contact_load=place)
        rises = slice(0, int(own["spring_force"].argmax("t")) + 1)
        force, area = (
            own["spring_force"].values[rises],
            own["contact_area"].values[rises],
        )
        assert np.all(np.diff(force) > 0.0) and np.all(np.diff(area) < 0.0)
        share = 1.0 - area / area[0]
        middle = slice(*np.searchsorted(force, [0.2 * force[-1], 0.5 * force[-1]]))
        slope = np.polyfit(np.log(force[middle]), np.log(share[middle]), 1)[0]
        assert 1.6 < slope < 2.2
        lost.append(share[-1])
    assert lost[0] > lost[1] > lost[2] > 0.05


@pytest.mark.parametrize(
    "name",
    [
        "pdms_lens_spring",
        pytest.param("whole pdms_lens_spring", marks=pytest.mark.verify),
    ],
)
def test_at_the_onset_of_stick_slip_fluctuations_take_more_area_than_the_bonds_give_back(
    name,
):
    found = shares(four(name))

    def change(share):
        value = found[share].value
        late = value.isel(t=slice(value.sizes["t"] // 2, None)).mean("t")
        return float(late.sel(drive_stage=3e-3) - late.sel(drive_stage=2e-3))

    bonds, noise = change("lost_to_bonds"), change("lost_to_fluctuations")
    assert -0.04 < bonds < -0.015 and 0.05 < noise < 0.075
    slips = read.stick_slip(four(name))["slip_count"].value
    assert np.all(slips.sel(drive_stage=2e-3) == 0.0) and np.all(
        slips.sel(drive_stage=3e-3) > 1.0
    )


#: Mean traction of 50 clutches [pN] on some substrates [pN/nm], and what it is off by: stepped from event to event with
#: loads that stand still meanwhile, as published code does, and on the stiffest by short steps of time.
STEPPED = {
    0.01: (28.81, 0.0),
    0.1: (38.49, 0.01),
    0.316: (31.26, 0.03),
    1.0: (16.25, 0.08),
    1000.0: (11.25, 0.01),
}


def traction(dataset):
    """Mean traction of the clutches over the second half of the run [pN] and its standard error over the members."""
    late = 1e12 * dataset["friction_force"].isel(
        t=slice(dataset.sizes["t"] // 2, None)
    ).mean("t")
    return late.mean("member"), late.std("member", ddof=1) / math.sqrt(
        late.sizes["member"]
    )


def test_clutches_pull_hardest_on_a_substrate_that_is_softer_than_they_are():
    mean, error = traction(four("motor_clutch"))
    soft, stiff = mean
    assert soft - stiff > 5.0 * float(np.hypot(*error))


@pytest.mark.verify
def test_clutches_bear_what_programs_by_event_or_time_have_and_settle_where_motors_and_bonds_agree():
    mean, error = traction(at("motor_clutch"))
    for stiffness, (exact, off) in STEPPED.items():
        found, spread = (
            float(values.sel(drive_contact_stiffness=1e-3 * stiffness))
            for values in (mean, error)
        )
        assert abs(found - exact) < 4.0 * spread + off * exact
    # F = n F_1(V) with V = 120 nm/s (1 - F/100 pN), F_1 of bonds that are renewed at a constant speed
    bonds = load(FOLDER / "motor_clutch.toml").bonds
    assert_allclose(
        50.0 * law.bell_stress(109e-9, 0.1, 2e-12, 0.8e-3, 0.3, 1.0),
        10.596e-12,
        rtol=1e-4,
    )
    same = {
        name: getattr(bonds, name)
        for name in ("bond_stiffness", "rebinding_rate", "site_density")
    }
    many = {"model": "cohort", "start": "empty"} | same
    many["rupture"] = {"model": "bell", "zero_force_rate": 0.1, "bell_force": 2e-12}
    rigid = {
        "drive.contact_stiffness": "rigid",
        "sweep": {},
        "ensemble.members": 1,
        "bonds": many,
    }
    last = at("motor_clutch", **rigid, **{"clock.duration": "60 s"}).isel(t=-1)
    assert_allclose(1e12 * last["friction_force"], 10.7105709537, rtol=1e-4)
    assert_allclose(1e9 * last["speed"], 107.147314856, rtol=1e-5)
