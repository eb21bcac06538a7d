"""A measured map as the field of a scene: carried on the plane, and passing under a disc."""

import math

import numpy as np
import pytest
from helpers.commands import LENS, sim as command
from helpers.discs import disc_energies
from helpers.printed import rows_of
from helpers.scenes import (
    BONDS,
    DRIVES,
    Band,
    Onset,
    RateDependent,
    Slip,
    Stress,
    drive,
    scene,
)
from numpy.testing import assert_allclose

import sim
from sim.laws import halfspace, jkr
from sim.numerics.grid import Grid
from sim.parts.bonds.models import Counted, Unbroken
from sim.parts.shear import Carried, Mapped
from sim.parts.shear.maps import DiscShares, Passing
from sim.scenario.scenario import Record
from sim.solid import HalfSpace
from sim.spectrum.families import Ripple
from sim.spectrum.measured import StressMap
from sim.spectrum.radial import disc_energy, marginal_energy
from sim.study.converge import converge
from sim.units.errors import BadInput
from tests.test_total import check_cuts, run

G = 1.6e6


def map_of(field, pixel=6e-6, **keys):
    field = np.ascontiguousarray(field, float)
    return StressMap(
        file="map.npy", pixel=pixel, values=field.tobytes(), shape=field.shape, **keys
    )


def patchy(nx=64, ny=48, seed=3, rms=1e5):
    """A map of patches some pixels wide."""
    noise = np.fft.rfft2(np.random.default_rng(seed).normal(size=(nx, ny)))
    q = np.hypot(np.fft.fftfreq(nx)[:, None], np.fft.rfftfreq(ny))
    field = np.fft.irfft2(noise * np.exp(-((20.0 * q) ** 2) / 4), (nx, ny))
    return rms * field / field.std()


def measured(field=None, contact="plane", pixel=6e-6, keys=None, **given):
    return Carried(
        field=map_of(patchy() if field is None else field, pixel, **(keys or {})),
        contact=contact,
        **given,
    )


def sliding(shear, steps=40, speed=1e-3, **parts):
    parts = {"bonds": Unbroken(stress=3e5), "drive": drive.Steady(speed=speed)} | parts
    return scene(members=parts.pop("members", 1), steps=steps, shear=shear, **parts)


def test_the_field_on_the_plane_has_the_energy_of_the_file_times_the_amplitude_at_every_step():
    field = patchy()
    dataset = sim.run(sliding(measured(field)))
    exact = halfspace.surface_energy(field, (64 * 6e-6, 48 * 6e-6), G)
    assert_allclose(dataset["fluctuation_energy"], exact, rtol=1e-12)
    assert_allclose(
        dataset["contact_radius"],
        jkr.radius_at_load(4e-3, 42e-3 - exact, 2e-3, 4 * G),
        rtol=1e-12,
    )
    parts = {
        "drive": drive.Ramp(start=1e-4, stop=1e-2),
        "record": Record(maps=(20e-3,)),
    }
    whole = sim.run(sliding(measured(), **parts))
    law = Onset(speed=2e-3, width=0.3, floor=0.1)
    dataset = sim.run(sliding(measured(amplitude=law), **parts))
    factor = law.factor(dataset["speed"].values, np.zeros(1))
    assert_allclose(
        dataset["fluctuation_energy"],
        factor**2 * whole["fluctuation_energy"],
        rtol=1e-13,
    )
    assert_allclose(dataset["shear_map"], factor[20] * whole["shear_map"], rtol=1e-13)


def test_a_map_moves_with_the_slider_and_its_shares_go_smoothly_from_pixel_to_pixel():
    field, pixel = (
        patchy() + 2e5 + np.random.default_rng(4).normal(scale=1e4, size=(64, 48)),
        6e-6,
    )
    record = Record(maps=(0.0, 12e-3, 15e-3))
    maps = sim.run(sliding(measured(field), record=record, speed=2.5 * pixel / 1e-3))[
        "shear_map"
    ].values[0]
    assert_allclose(maps[0], field - field.mean(), rtol=0.0, atol=1e-9 * 1e5)
    assert_allclose(maps[1], np.roll(maps[0], 30, axis=0), rtol=0.0, atol=1e-9 * 1e5)
    # half a pixel further: the Fourier series between the samples, here of one column
    between = Grid(1.0, 64)
    half = np.exp(-1j * between.wavevectors[0] * 0.5 / 64)
    half[32] = half[32].real
    moved = np.fft.ifft(
        np.fft.fft(np.roll(maps[0], 37, axis=0), axis=0) * half, axis=0
    ).real
    assert_allclose(maps[2], moved, rtol=0.0, atol=1e-9 * 1e5)
    shares = passing(patchy(), 20.0)
    radius = np.array([12.0])
    at = {
        x: shares.at(np.full((1, 1), x))(radius)[0, 0]
        for x in (0.0, 1.0, 1.0 + 1e-9, 1.5, 2.0)
    }
    assert_allclose(at[1.0], at[1.0 + 1e-9], rtol=1e-7)
    moved = passing(np.roll(patchy(), 1, axis=0), 20.0)  # the pattern one pixel further
    # but for what came in at the end of the map
    assert_allclose(at[1.0], moved(radius)[0], rtol=0.05)
    shifted = np.fft.irfft2(
        np.fft.rfft2(patchy())
        * np.exp(-2j * np.pi * np.fft.fftfreq(64) * 1.5)[:, None],
        (64, 48),
    )
    assert_allclose(at[1.5], passing(shifted, 20.0)(radius)[0], rtol=0.05)


def test_the_edge_pays_what_is_missing_of_the_work_of_adhesion_and_the_table_shows_it():
    # on a plane it pays all of the stored energy
    contacts = {"shear.contact": ["disc", "plane"]}
    dataset = sim.run(
        sliding(
            measured(patchy() + 2e5, "disc"), bonds=Unbroken(stress=2e5), sweep=contacts
        )
    )
    assert float(dataset["edge_energy"].max()) > 0.0
    assert_allclose(
        dataset["work_of_adhesion"] + dataset["edge_energy"], 42e-3, rtol=1e-12
    )
    assert any(heading.startswith("edge") for heading in rows_of(dataset)[0])


def test_a_map_that_was_drawn_saved_and_read_back_gives_the_same_trajectory(tmp_path):
    random = Mapped(
        spectrum=Band(1e5, 120e-6, 40e-6),
        cell=0.3e-3,
        points=24,
        correlation=Slip(length=1e30),
    )
    parts = {"record": Record(maps=(0.0, 30e-3)), "bonds": Unbroken(stress=3e5)}
    drawn = sim.run(sliding(random, **parts))
    drawn[["shear_map"]].isel(map_time=[0]).to_netcdf(tmp_path / "drawn.nc")
    carried = sim.run(
        sliding(Carried(field=StressMap(file=str(tmp_path / "drawn.nc"))), **parts)
    )
    for name in (
        "fluctuation_energy",
        "work_of_adhesion",
        "contact_radius",
        "friction_force",
    ):
        assert_allclose(carried[name], np.squeeze(drawn[name].values), rtol=1e-11)
    assert_allclose(carried["shear_map"], drawn["shear_map"], rtol=0.0, atol=1e-9 * 1e5)


def passing(field, widest, pixel=1.0, nu=0.5, **keys):
    discs = DiscShares(map_of(field, pixel, **keys), HalfSpace(1.0, nu), widest)
    return Passing(discs, np.zeros(1))


def test_uniform_stress_and_passing_waves_store_the_closed_forms_as_new_contact_adds_up():
    # half of the map is +1 and half -1, so that no mean is taken off; the disc stands on the first
    field = np.where(
        np.arange(64) < 16, -1.0, np.where(np.arange(64) < 48, 1.0, -1.0)
    ) * np.ones((40, 1))
    shares = passing(3.0 * field, 15.0)
    radius = np.array([6.0, 8.5, 11.5])
    whole = HalfSpace(1.0).stored_energy(shares.discs.field)
    exact = halfspace.disc_tangential_energy(radius, 3.0, 1.0) / (math.pi * radius**2)
    # what the soft edge costs falls as (pixel/a)²
    assert_allclose(whole * shares.mean(radius), exact, rtol=0.2 / 6.0**2)
    assert_allclose(whole * shares(radius), 1.5 * exact, rtol=0.2 / 6.0**2)
    small = np.array([0.0, 0.5, 2.0])
    assert_allclose(
        shares.mean(small), shares.mean(np.array([5.0])) * small / 5.0, rtol=1e-12
    )
    assert np.isnan(shares(np.array([np.nan, 3.0]))).tolist() == [True, False]
    for angle in [0.0, 0.5 * math.pi]:
        waves = np.cos(2 * math.pi / 12 * np.arange(96))
        field = (
            waves[:, None] * np.ones(96) if angle == 0.0 else waves * np.ones((96, 1))
        )
        wave, radius = Ripple(1.0, 12.0, angle), np.array([14.0, 18.0, 21.5])
        # a disc at twelve places of the wave: along x by sliding, across it by the map itself
        mean, new = np.zeros(3), np.zeros(3)
        for place in range(12):
            moved = field if angle == 0.0 else np.roll(field, place, axis=1)
            shares = passing(moved, 25.0).at(
                np.full((1, 1), float(place) if angle == 0.0 else 0.0)
            )
            mean += shares.mean(radius)[0] / 12
            new += shares(radius)[0] / 12
        whole = HalfSpace(1.0).stored_energy(passing(field, 25.0).discs.field)
        # the soft edge costs 0.65 (pixel/a)² for each wave on the diameter at most
        lost = 0.7 * np.max(2 * radius / 12 / radius**2)
        assert_allclose(
            whole * mean, disc_energy(wave, radius, HalfSpace(1.0).softness), rtol=lost
        )
        assert_allclose(
            whole * new,
            marginal_energy(wave, radius, HalfSpace(1.0).softness),
            rtol=lost,
        )
    shares = passing(patchy(), 20.0).at(np.array([[0.0], [2.3]]))
    nodes, weights = np.polynomial.legendre.leggauss(400)
    ends = 5.0, 19.0
    a = 0.5 * (ends[1] - ends[0]) * nodes + 0.5 * sum(ends)
    grown = (
        0.5
        * (ends[1] - ends[0])
        * (shares(np.tile(a, (2, 1))) * 2 * math.pi * a)
        @ weights
    )
    whole = [math.pi * end**2 * shares.mean(np.full((2, 1), end))[:, 0] for end in ends]
    # the second derivative of a cubic spline jumps at its knots, which a Gauss rule over them sees as 1/n³
    assert_allclose(grown, whole[1] - whole[0], rtol=1e-5)


def test_an_edge_or_equilibrium_follows_the_pattern_and_grows_where_contact_gives_energy_back():
    field = patchy(rms=4e4)
    shear = measured(field, "disc", keys={"start": 240e-6})
    dataset = sim.run(sliding(shear, steps=80, record=Record(maps=(0.0, 80e-3))))
    assert dataset["fluctuation_energy"].std() > 0.02 * halfspace.surface_energy(
        field, (64 * 6e-6, 48 * 6e-6), G
    )
    # the equilibrium holds at the edge: G = w - dE/dA of the pattern there, w of the dataset
    radius, work = dataset["contact_radius"].values, dataset["work_of_adhesion"].values
    assert_allclose(jkr.energy_release_rate(radius, 4e-3, 2e-3, 4 * G), work, rtol=1e-9)
    assert np.ptp(radius) > 1e-3 * radius.mean()
    # and the maps, which stand with the contact in the middle, store what is recorded
    maps = (
        dataset["shear_map"]
        .squeeze("map_member")
        .transpose("map_time", "x", "y")
        .to_numpy()[:, 8:56]
    )
    stored = disc_energies(
        maps,
        48 * 6e-6,
        dataset["contact_radius"].isel(t=[0, 80]).to_numpy(),
        HalfSpace(G),
    )
    assert_allclose(stored, dataset["fluctuation_energy"].isel(t=[0, 80]), rtol=0.01)
    x = 6e-6 * np.arange(-32, 32)
    radius = np.hypot(x[:, None], x)
    # an edge against its core
    field = np.where(radius < 110e-6, 8e4, np.where(radius < 170e-6, -8e4, 0.0))
    dataset = sim.run(sliding(measured(field, "disc"), steps=1, speed=0.0)).isel(t=0)
    assert float(dataset["work_of_adhesion"]) > 42e-3
    assert float(dataset["contact_radius"]) > 1.005 * float(dataset["jkr_radius"])
    shear = measured(patchy(rms=4e4), "disc")
    still = sliding(
        shear, steps=400, speed=0.0, contact=RateDependent(load=4e-3, front_speed=1e-3)
    )
    at_rest = sliding(shear, steps=1, speed=0.0)
    assert_allclose(
        sim.run(still)["contact_radius"][-1],
        sim.run(at_rest)["contact_radius"][-1],
        rtol=1e-6,
    )
    moving = sim.run(
        sliding(shear, steps=40, contact=RateDependent(load=4e-3, front_speed=1e-4))
    )
    assert np.all(moving["equilibrium_radius"] > 0.0)
    assert abs(moving["equilibrium_radius"] - moving["contact_radius"]).max() > 1e-8


def test_members_alone_restarts_and_few_records_agree_under_a_measured_map():
    for shear in (
        measured(),
        measured(patchy(rms=4e4), "disc", amplitude=Stress(reference=2e5)),
    ):
        bonds = Counted(critical_speed=1e-2, rebinding_rate=500.0, sites=40, stress=2e5)
        scenario = sliding(shear, steps=12, bonds=bonds, members=3)
        end, course = run(scenario, range(3), range(13))
        check_cuts(scenario, course, end)
        energy = sim.run(scenario)["fluctuation_energy"]
        assert ("member" in energy.dims) == (
            shear.contact == "disc" or shear.amplitude.reads_stress
        )


def test_a_scene_that_leaves_the_map_or_asks_for_a_correlation_or_convergence_is_refused():
    for keys, parts, cure in (
        ({"keys": {"start": 150e-6}}, {"speed": 3e-3}, "start"),
        ({}, {"speed": 1e-2}, "slip"),
        ({"field": patchy(64, 30)}, {}, "wide"),
        ({"contact": "plane", "keys": {"start": 1e-4}}, {}, "start"),
        ({"amplitude": Onset(speed=1e-3, width=0.3, relaxing=True)}, {}, "relaxing"),
        # the end of the map is unknown to a drive that feels the friction
        (
            {},
            {"drive": DRIVES["spring"], "bonds": BONDS["rate, bell"]},
            r"shear\.contact",
        ),
    ):
        with pytest.raises((BadInput, ValueError), match=cure):
            sliding(
                measured(**({"contact": "disc"} | keys)), **({"speed": 1e-3} | parts)
            )
    on_the_plane = sliding(
        measured(), drive=DRIVES["spring"], bonds=BONDS["rate, bell"]
    )
    assert np.all(sim.run(on_the_plane)["contact_radius"] > 0)
    with pytest.raises(BadInput, match=r"^shear\.field: "):
        converge(sliding(measured()), 1.0)
    table = {
        "model": "mapped",
        "field": {"file": "map.npy"},
        "correlation": {"model": "time", "time": 1.0},
    }
    with pytest.raises(BadInput, match="correlation"):
        sim.load({"shear": table, "clock": {"duration": 1.0, "step": 0.1}})


TOML = f"""{LENS}
[bonds]
model = "none"
stress = "0.3 MPa"
[shear]
model = "mapped"
field = {{ file = "map.csv", pixel = "6 um", noise = "1 kPa" }}
"""


def test_check_prints_the_energy_of_a_map(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(TOML)
    field = patchy() - patchy().mean()
    np.savetxt(tmp_path / "map.csv", field.T + 5e4, delimiter=",")
    answer = command("check", "scene.toml", "--members", "5")
    assert answer.exit_code == 0
    energy = halfspace.surface_energy(field, (64 * 6e-6, 48 * 6e-6), G)
    radial = float(HalfSpace(G).stored_energy(map_of(field).spectrum))
    numbers = (
        f"{energy:.4g} J/m^2",
        f"{100 * abs(energy / radial - 1):.2g} %",
        f"{np.sqrt(np.mean(field**2)):.4g} Pa",
    )
    assert [
        number
        for number in (*numbers, "64 × 48 points of 6e-06 m")
        if number not in answer.stdout
    ] == []
    assert "one member is enough" in answer.stdout
