"""The page of ``sim explore``: curves of steady sliding, sliders, what is taken away, and messages."""

import base64
import csv
import io
import itertools
import math
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest
from helpers.commands import LENS as MOUNTED, sim as command
from numpy.testing import assert_allclose
from PIL import Image

import sim
from sim.ensemble.diagnosis import slider_body
from sim.explorer import take
from sim.explorer.drawing import contact, picture
from sim.explorer.figures import contact_to_scale, rings
from sim.explorer.job import ensemble, fitted, planned
from sim.explorer.page import Page, Refused, previews
from sim.explorer.server import Server, state_of
from sim.laws import jkr
from sim.parts.shear import models
from sim.study import mechanisms, plan
from sim.study.curves import curves, speeds_of_loss
from sim.study.likelihood import problem_of
from sim.units.notation import engineering

SCENARIOS = (
    "pdms_lens",
    "friction_maximum",
    "masking",
    "stick_slip",
    "motor_clutch",
    "pull_off",
    "afm_tip",
    "jkr_fit",
)
#: A lens on bonds alone, some of whose numbers have comments.
LENS = (
    MOUNTED.replace('"1.6 MPa"', '"1.6 MPa"  # of PDMS')
    + """\
[drive]
model = "steady"
speed = "1 mm/s"
[bonds]
model = "steady"
critical_speed = "10 mm/s"  # assumed
stress = "0.3 MPa"
"""
)
WAVES = """\
[shear]
model = "mean"
spectrum = { model = "gaussian", rms = "60 kPa", length = "4 um" }
"""


@pytest.fixture
def lens(tmp_path):
    path = tmp_path / "lens.toml"
    path.write_text(LENS + WAVES, encoding="utf-8")
    return path


def scene(text):
    return sim.load(tomllib.loads(text))


def test_curves_of_steady_sliding_are_the_closed_forms():
    speeds = np.geomspace(1e-4, 1.0, 9)
    found = sim.steady_curves(scene(LENS), speeds)
    fraction = 1.0 / (1.0 + speeds / 1e-2)
    radius = jkr.radius_at_load(4e-3, 42e-3 * fraction, 2e-3, 6.4e6)
    assert_allclose(found["bond_fraction"], fraction, rtol=1e-12)
    assert_allclose(found["contact_radius"], radius, rtol=1e-12)
    assert_allclose(
        found["friction_force"], 3e5 * fraction * np.pi * radius**2, rtol=1e-12
    )
    full = jkr.radius_at_load(4e-3, 42e-3, 2e-3, 6.4e6)
    assert_allclose(
        found["lost_to_bonds"], 1.0 - (radius / full) ** 2, rtol=1e-9, atol=1e-12
    )
    assert (
        found["contact_area"].attrs["units"] == "m^2"
        and found["speed"].attrs["units"] == "m/s"
    )
    for wrong in ([0.0], [-1e-3], [[1e-3]], [math.nan]):
        with pytest.raises(sim.BadInput, match="speeds"):
            sim.steady_curves(scene(LENS), wrong)


@pytest.mark.parametrize(
    "text",
    [
        LENS,
        LENS + WAVES,
        LENS.replace('load = "4 mN"', 'load = "4 mN"\nreversible = 0.3'),
    ],
)
def test_the_shares_of_the_area_add_up_to_one_in_either_order(text):
    found = curves(scene(text), np.geomspace(1e-4, 1.0, 7))
    stress = found.get("lost_to_mean_stress", 0.0)
    for bonds, waves in (
        ("lost_to_bonds", "lost_to_fluctuations"),
        ("lost_to_bonds_last", "lost_to_fluctuations_first"),
    ):
        assert_allclose(
            found["area_ratio"] + found[bonds] + found[waves] + stress, 1.0, rtol=1e-12
        )
    alone = curves(
        scene(text).with_values(
            {"adhesion.bond_share": 0.0, "contact.reversible": 0.0}
        ),
        np.array([1.0]),
    )
    assert_allclose(
        found["lost_to_fluctuations_first"][-1],
        1.0 - alone["area_ratio"][0],
        rtol=1e-9,
        atol=1e-12,
    )


def test_the_speed_of_a_loss_is_solved():
    # without load a^3 is proportional to the work, so the area goes with its power 2/3
    free = scene(LENS.replace('"4 mN"', '"0 mN"'))
    (speed,) = speeds_of_loss(free, 0.1, np.geomspace(1e-4, 1.0, 5))
    assert_allclose(speed, 1e-2 * (0.9**-1.5 - 1.0), rtol=1e-10)
    assert speeds_of_loss(free, 0.999, np.geomspace(1e-4, 1e-2, 5)) == []


@pytest.mark.parametrize("name", SCENARIOS)
def test_sliders_are_numbers_that_change_a_curve_between_ends_within_their_bounds(name):
    page = Page(sim.load(f"scenarios/{name}.toml"))
    assert page.sliders and sum(slider.marked for slider in page.sliders) <= 3
    for slider in page.sliders:
        assert slider.low <= slider.value <= slider.high and slider.low < slider.high
        for end in (slider.low, slider.high):
            try:
                page.answer({slider.key: end}, 0.1)
            except Refused as refused:
                # an end may not go with other numbers, but is a number of its key
                assert set(refused.faults) == {""}
        if slider.logarithmic:
            assert slider.low > 0.0
    keys = {slider.key for slider in page.sliders}
    assert not {
        key for key in keys if key.startswith(("clock", "ensemble", "record", "seed"))
    }
    moves = "motion" in page.figures
    assert any(key.startswith("drive.") for key in keys) == moves
    assert ("bonds.critical_speed" in keys) == (
        name in ("pdms_lens", "masking") and name != "masking"
    )


def test_a_value_that_cannot_be_used_is_refused_with_its_key(lens):
    page = Page(sim.load(lens))
    for value, reason in (
        ("3 kg", "kg"),
        ("x", "cannot be read"),
        (-1.0, "above 0"),
        ("5", "without a unit"),
    ):
        with pytest.raises(Refused) as refused:
            page.read({"sphere.radius": value})
        assert (
            list(refused.value.faults) == ["sphere.radius"]
            and reason in refused.value.faults["sphere.radius"]
        )
    with pytest.raises(Refused) as refused:
        page.read({"__class__": 1.0})
    assert refused.value.faults == {"__class__": "is no slider of this page"}
    assert page.read({"sphere.radius": "3 mm"}).sphere.radius == 3e-3


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, ""),
        ({"contact.load": {"from": "4 mN", "to": "1 mN"}}, "changes in time"),
        (
            {"drive": {"model": "table", "time": [0.0, 1.0], "speed": [1e-3, 2e-3]}},
            "a course",
        ),
    ],
)
def test_a_page_states_why_its_curves_are_a_preview_alone(lens, changes, reason):
    assert [reason in text for text in previews(sim.load(lens, changes))] == [
        True
    ] * bool(reason)


def test_a_saved_scenario_has_its_comments_and_the_numbers_of_the_page(lens):
    values = {
        "sphere.radius": "3 mm",
        "bonds.critical_speed": 0.123456789,
        "shear.spectrum.rms": "70 kPa",
    }
    for changes in ({}, {"seed": 7}, {"sweep": {"contact.load": ["1 mN", "2 mN"]}}):
        page = Page(sim.load(lens, changes))
        text = page.toml(values)
        saved = lens.with_name("saved.toml")
        saved.write_text(text, encoding="utf-8")
        assert "# of PDMS" in text and "# assumed" in text and 'radius = "3 mm"' in text
        again = sim.load(saved)
        assert not again.sweep and again.seed == changes.get("seed", 0)
        for name, column in curves(page.read(values), page.speeds).items():
            assert_allclose(curves(again, page.speeds)[name], column, rtol=1e-14)
    made = Page(scene(LENS))  # in Python, from no file
    saved.write_text(made.toml({"contact.load": 3e-3}), encoding="utf-8")
    assert sim.load(saved).contact.load == 3e-3


def test_values_of_the_page_are_those_of_a_run_of_the_saved_scenario(lens):
    page = Page(sim.load(lens))
    values = {
        "sphere.radius": "2.7 mm",
        "shear.spectrum.length": "3.3 um",
        "contact.load": -1e-4,
    }
    answer = page.answer(values, 0.1)
    saved = lens.with_name("saved.toml")
    saved.write_text(page.toml(values), encoding="utf-8")
    for place in (0, 60, 120):
        run = sim.run(sim.load(saved, {"drive.speed": answer["x"][place]}))
        for name in (
            "contact_area",
            "friction_force",
            "fluctuation_energy",
            "work_of_adhesion",
        ):
            assert_allclose(
                answer["curves"][name][place], float(run[name][-1]), rtol=1e-12
            )


@pytest.mark.parametrize("name", ["own_psd", "soft_lens", "ten_wavelengths"])
def test_values_of_the_page_lie_within_the_error_of_the_scenarios_own_models(name):
    # the interval is of 95 %: twice its half are four standard errors
    page = Page(sim.load(f"scenarios/{name}.toml").points()[0])
    own = ensemble(page.scenes({}, 64), lambda message: None)
    found = curves(page.scenario, np.array(own["speed"]))
    for quantity in ("contact_area", "friction_force"):
        mean, low, high = (
            np.array(own["curves"][quantity][kind]) for kind in ("mean", "low", "high")
        )
        assert np.all(np.abs(found[quantity] - mean) <= high - low)
        assert np.all(high > low) or found[quantity] == 0.0


def test_curves_are_taken_away_as_a_table(lens):
    page = Page(sim.load(lens))
    rows = list(csv.reader(io.StringIO(take.table(page.scenario, page.speeds))))
    column = rows[0].index("contact_area [m^2]")
    assert_allclose(
        [float(row[column]) for row in rows[1:]],
        curves(page.scenario, page.speeds)["contact_area"],
        rtol=0,
    )


def test_curves_and_their_comparison_with_a_table_need_no_process_of_the_fluctuations(
    monkeypatch,
):
    models._grouped.cache_clear()
    scene = sim.load("scenarios/pdms_lens.toml")
    # a new spectrum takes half a second
    monkeypatch.setattr(models.disk_cache, "cached", None)
    page = Page(scene)
    table = page.add(
        "speed [mm/s],contact_area [mm^2],contact_area_error [%]\n0.1,0.045,1\n1,0.044,1\n",
        "x.csv",
    )
    answer = page.answer({"shear.spectrum.hurst": 0.7}, 0.1, table=table)
    assert (
        answer["data"]["count"] == 2 and answer["values"]["shear.spectrum.hurst"] == 0.7
    )


def test_measured_curves_are_compared_with_the_curves(lens):
    page = Page(sim.load(lens))
    text = "speed [mm/s];contact_area [mm^2];contact_area_error [%]\n1,0;0,0445;1\n10,0;0,0350;1\n"
    data = page.answer({}, 0.1, table=page.add(text, "own.csv"))["data"]
    exact = curves(page.scenario, np.array([1e-3, 1e-2]))["contact_area"]
    off = (np.array([4.45e-8, 3.5e-8]) - exact) / (0.01 * np.array([4.45e-8, 3.5e-8]))
    assert_allclose(data["chi_square"], np.sum(off**2), rtol=1e-9)
    assert_allclose(data["points"]["contact_area"]["residuals"], off, rtol=1e-9)
    assert data["count"] == 2 and data["name"] == "own.csv"


def test_a_table_that_is_too_large_or_cannot_be_read_is_refused_by_its_own_name(lens):
    page = Page(sim.load(lens))
    heading = "speed [mm/s],contact_area [mm^2]\n"
    for text, reason in (
        (heading + "1,0.04\n" * 5001, "5000 rows"),
        ("x" * 2_000_001, "2 MB"),
        ("<img onerror=alert(1)> [mm]\n1\n", "heading"),
        ("", ""),
    ):
        with pytest.raises(sim.BadInput) as fault:
            page.add(text, "<b>.csv")
        assert str(fault.value).startswith("<b>.csv") and reason in str(fault.value)


def test_the_drawing_has_the_contact_to_scale(lens):
    found = contact(sim.load(lens), 1e-3)
    exact = curves(sim.load(lens), np.array([1e-3]))
    assert_allclose(found["radius"], exact["contact_radius"][0], rtol=1e-14)
    x, sphere, surface = (np.array(found[name]) for name in ("x", "sphere", "surface"))
    inside = np.abs(x) < found["radius"]
    assert_allclose(sphere[inside], surface[inside], rtol=0, atol=1e-15)
    outside = np.abs(x) > 1.01 * found["radius"]
    assert np.all(sphere[outside] > surface[outside])
    # the parabola of 2 mm
    assert_allclose(sphere - sphere[80], x**2 / 4e-3, rtol=1e-6, atol=1e-15)
    stress = np.array(found["stress"])
    assert_allclose(stress.mean(), exact["shear_stress"][0], rtol=0.05)
    # waves shorter than two pixels are left out, so the map has at most the rms of the spectrum
    assert 0.2 * 6e4 < stress.std() < 1.1 * 6e4


def test_the_contact_is_drawn_in_one_unit_with_its_circle_and_its_map(lens):
    scene = sim.load(lens)
    found, drawn = contact(scene, 1e-3), contact_to_scale(scene, 1e-3)
    cut, above = drawn["panels"]
    half = cut["x"]["high"]
    assert above["x"]["low"] == above["y"]["low"] == -half == -above["y"]["high"]
    assert_allclose(cut["marks"][0]["y"], 1e6 * np.array(found["surface"]), rtol=1e-12)
    image, circle, dotted = above["marks"]
    assert image["kind"] == "image" and image["x"] == image["y"] == [-half, half]
    for mark, name in ((circle, "radius"), (dotted, "jkr_radius")):
        assert_allclose(np.hypot(mark["x"], mark["y"]), 1e6 * found[name], rtol=1e-12)
    assert_allclose(2e-6 * half, found["side"], rtol=1e-12)
    assert drawn["waves"]["energy"] == found["fluctuation_energy"] > 0.0
    ripple = sim.load("scenarios/masking.toml").with_values({})
    short = ripple.with_values({"shear.spectrum.wavelength": 1e-6})
    without = contact_to_scale(short, 3e-3)
    assert without["waves"] is None and len(without["panels"][1]["marks"]) == 2
    lifted = contact_to_scale(scene.with_values({"contact.load": -1.0}), 1e-3)
    assert lifted["panels"] == [] and "open" in lifted["words"]


def test_curves_measured_values_and_contact_wait_for_no_noise_of_members(monkeypatch):
    page = Page(sim.load("scenarios/pdms_lens.toml"))
    table = page.add("speed [mm/s],contact_area [mm^2]\n1,0.04\n9,0.03", "own.csv")

    def refused(shear, solid, cell):
        raise AssertionError("the process is built, which takes a second")

    monkeypatch.setattr(type(page.scenario.fluctuations), "process", refused)
    values = {"shear.spectrum.hurst": 0.7}
    assert page.answer(values, 0.1, "speed", table)["data"]["points"]
    assert page.figure(values, "data", table)["panels"]
    assert contact_to_scale(page.read(values, built=False), 1e-3)["panels"]


def test_a_picture_of_a_map_is_blue_below_zero_and_its_second_axis_points_upwards():
    values = np.zeros((3, 3))
    values[2, 0], values[0, 2] = -2.0, 2.0
    content = picture(values).removeprefix("data:image/png;base64,")
    image = Image.open(io.BytesIO(base64.b64decode(content))).convert("RGB")
    assert image.getpixel((2, 2)) == (33, 102, 172)
    assert image.getpixel((0, 0)) == (178, 24, 43)
    assert image.getpixel((1, 1)) == (255, 255, 255)


def test_a_band_that_takes_too_long_is_not_begun(lens):
    short, long = (
        Page(sim.load(lens, {"clock.duration": seconds})) for seconds in (1.0, 1e5)
    )
    assert short.band({})["along"] == "speed" and "too long" in long.band({})["reason"]


def test_a_busy_machine_hides_no_band(lens, monkeypatch):
    page, now = Page(sim.load(lens)), itertools.count(0.0, 1.0)
    monkeypatch.setattr(time, "monotonic", lambda: next(now))
    stub = lambda scenes, say: {"along": "speed"}  # noqa: E731
    monkeypatch.setattr("sim.explorer.job.ensemble", stub)
    for _ in range(4):
        assert page.band({})["along"] == "speed"


def test_the_sentence_says_so_if_a_share_is_lost_everywhere_or_the_contact_is_open(
    lens,
):
    page = Page(sim.load(lens))

    def words(values, share=0.1):
        return page.answer(values, share)["level"]["words"]

    masked = {"shear.spectrum.rms": 1e7}
    lost = 100.0 * (1.0 - curves(page.read(masked), page.speeds)["area_ratio"])
    # Hertz's contact at all speeds, so that both ends are the same number
    assert np.ptp(lost) < 1e-9
    place = "10 % or more of the area is lost at every speed shown"
    everywhere = "; adhesion is masked everywhere in this figure"
    assert words(masked) == f"{place}: {lost.min():.3g} %{everywhere}"
    wide = {"shear.spectrum.rms": 1.3e5}
    lost = 100.0 * (1.0 - curves(page.read(wide), page.speeds)["area_ratio"])
    assert words(wide, 0.05).startswith(
        place.replace("10", "5", 1) + f": {lost.min():.3g} to {lost.max():.3g} %"
    )
    assert "open everywhere" in words({"contact.load": -0.1})
    alone = {"shear.paid_by_adhesion": 0.0, "adhesion.bond_share": 0.0}
    assert words(alone) == "With these numbers no area is lost at any speed shown"
    most = 100.0 * (1.0 - np.nanmin(curves(page.scenario, page.speeds)["area_ratio"]))
    assert f"at most {most:.3g} %" in words({}, 0.9)


def test_marks_rank_numbers_by_the_drawn_share_of_the_area():
    page = Page(sim.load("scenarios/pdms_lens.toml"))
    before, effects = curves(page.scenario, page.speeds)["area_ratio"], {}
    for slider in page.sliders:
        size = 0.1 * (slider.value or 1.0)
        other = slider.value + size * (1 if slider.value == 0.0 else -1)
        after = curves(page.read({slider.key: other}), page.speeds)["area_ratio"]
        effects[slider.key] = float(np.max(np.abs(after - before)))
    marked = {slider.key for slider in page.sliders if slider.marked}
    assert "shear.spectrum.rms" in marked and "sphere.radius" not in marked
    assert min(effects[key] for key in marked) > effects["sphere.radius"]


def test_a_figure_over_a_sweep_has_the_curves_of_its_points():
    page = Page(sim.load("scenarios/masking.toml"))
    assert page.figures == ["sweep", "speed", "data"]
    answer = page.answer({}, 0.1, "sweep")
    assert len(answer["x"]) == 41 and answer["axis"]["unit"][1] == "kPa"
    for place in (0, 20, 40):
        at = {"shear.spectrum.amplitude": answer["x"][place]}
        exact = curves(page.read(at), np.array([3e-3]))["area_ratio"][0]
        assert_allclose(answer["curves"]["area_ratio"][place], exact, rtol=1e-12)
    # 10 % is between the two neighbours that the sentence names
    ratio = np.array(answer["curves"]["area_ratio"])
    first = int(np.flatnonzero(ratio <= 0.9)[0])
    low, high = (1e-3 * answer["x"][k] for k in (first - 1, first))
    assert f"between {low:.4g} kPa and {high:.4g} kPa" in answer["level"]["words"]


@pytest.mark.parametrize(
    ("name", "figure"),
    [
        ("stick_slip", "motion"),
        ("pull_off", "motion"),
        ("jkr_test", "motion"),  # its table is the course of the load
        ("own_map", "motion"),
        ("stability_map", "map"),
        ("jkr_fit", "data"),
        ("incipient_fit", "data"),
        ("own_psd", "sweep"),
        ("ten_wavelengths", "spread"),
        ("pdms_lens", "speed"),
    ],
)
def test_a_page_opens_with_the_figure_of_what_its_scenario_computes(name, figure):
    page = Page(sim.load(f"scenarios/{name}.toml"))
    start = page.start()
    assert start["figures"][0] == figure and start["question"].endswith("?")


def test_a_table_beside_its_scenario_is_drawn_over_what_varies_with_its_residuals():
    page = Page(sim.load("scenarios/jkr_fit.toml"))
    work, modulus, radius = 45e-3, 1.5e6, 2e-3
    start = page.start()
    values = {"adhesion.work": work, "solid.youngs_modulus": modulus}
    answer = page.figure(values, "data", start["data"])
    curves, residuals = (panel["marks"] for panel in answer["panels"])
    model, points = curves
    load, size = 1e-3 * np.array(model["x"]), 1e-6 * np.array(model["y"])
    # JKR's load of a contact radius, and the residuals of the measured radii
    reduced = modulus / 0.75
    exact = 4.0 * reduced * size**3 / (3.0 * radius)
    exact -= np.sqrt(8.0 * np.pi * work * reduced * size**3)
    assert_allclose(load, exact, rtol=1e-9, atol=1e-9 * load.max())
    off = np.array(residuals[0]["y"])
    errors = np.array(points["high"])
    at = 1e-3 * np.array(points["x"])
    predicted = 1e6 * np.interp(at, load, size)  # the curve is bent between its places
    measured = np.array(points["y"])
    assert_allclose(off * errors, measured - predicted, atol=1e-3 * size.max() * 1e6)
    compared = page.answer(values, 0.1, table=start["data"])["data"]
    assert f"χ² = {compared['chi_square']:.4g} for 14" in answer["words"]
    assert_allclose(np.sum(off**2), compared["chi_square"], rtol=1e-9)
    assert "tick the numbers" not in answer["words"]
    assert "tick the numbers" in page.figure({}, "data", start["data"])["words"]


def test_a_table_without_errors_has_no_residuals(lens):
    page = Page(sim.load(lens))
    table = page.add("speed [mm/s],contact_area [mm^2]\n1,0.04\n9,0.03\n", "own.csv")
    answer = page.figure({}, "data", table)
    assert len(answer["panels"]) == 1 and "no χ²" in answer["words"]
    assert page.figure({}, "data", None)["panels"] == []


def test_the_spread_of_the_members_is_that_of_runs_of_the_sweep():
    scene = sim.load("scenarios/ten_wavelengths.toml", {"ensemble.members": 200})
    answer = Page(scene).figure({}, "spread")
    run = sim.run(scene).isel(t=-1)
    share = 100.0 * run["contact_area"] / (np.pi * run["jkr_radius"] ** 2)
    for mean, width in zip(
        share.mean("member").to_numpy(),
        share.std("member", ddof=1).to_numpy(),
        strict=True,
    ):
        assert f"{mean:.3g} ± {width:.2g} %" in answer["words"]
    for mark in answer["panels"][0]["marks"]:
        x, y = np.array(mark["x"]), np.array(mark["y"])
        # the whole of the members is below each curve
        assert_allclose(np.sum(np.diff(x) * y[:-1]), 100.0, rtol=1e-12)


def test_the_map_of_stability_has_the_swings_of_runs_and_plays_their_moments():
    changes = {"sweep": {"drive.stiffness": ["50 N/m", "1600 N/m"]}}
    scene = sim.load("scenarios/stability_map.toml", changes)
    page = Page(scene)
    assert page.figure({}, "map")["more"]
    answer = page.figure({}, "map")
    assert not answer["more"]
    # between which two springs the motion changes, and the boundary of sim check
    for word in ("at K = 50 N/m", "from 1.6 kN/m on", "below 1.128 kN/m at 10 mm/s"):
        assert word in answer["words"]
    run = sim.run(scene)
    *legs, scale = answer["panels"]
    *grows, theory = legs[0]["marks"]
    assert len(legs) == 2 and len(grows) == 48
    drawn = np.array([theory["x"], theory["y"]], float)
    speeds, limit = drawn[:, np.isfinite(drawn[1])]
    body = slider_body(scene, 1e-3 * speeds)
    needed = scene.population.onset(1e-3 * speeds, body).stiffness
    assert_allclose(limit, needed, rtol=1e-9)
    shades = [mark["opacity"] for mark in scale["marks"]]
    assert shades == sorted(shades)
    rows = np.array(answer["table"]["rows"], float)
    for mark in grows:
        play = answer["plays"][mark["name"]]
        at = run.sel(drive_stiffness=play["values"]["drive.stiffness"])
        at = at.isel(t=slice(0, at.sizes["t"] // 2 + 1))
        low, high = (1e-3 * x for x in mark["x"])
        here = at.isel(t=(at["stage_speed"] >= low) & (at["stage_speed"] < high))
        force = here["spring_force"].to_numpy()
        swing = 1.0 - force.min() / force.max()
        assert_allclose(mark["opacity"], max(0.02, 0.9 * swing), atol=0.02)
        # the table has the cell's swing, in the row of its speed
        (row,) = rows[(rows[:, 0] > mark["x"][0]) & (rows[:, 0] < mark["x"][1])]
        of_spring = play["words"].partition(",")[0] + ", V grows (%)"
        shown = row[answer["table"]["head"].index(of_spring)]
        assert_allclose(max(0.02, 0.009 * shown), mark["opacity"], rtol=1e-12)
        assert (
            low * 0.999 <= float(at["stage_speed"].sel(t=play["time"])) <= high * 1.001
        )
    hard = [
        m for m in grows if answer["plays"][m["name"]]["values"]["drive.stiffness"] > 60
    ]
    assert (
        max(mark["opacity"] for mark in hard) < 0.45 < max(m["opacity"] for m in grows)
    )
    assert Page(sim.load("scenarios/stick_slip.toml")).figures[0] == "motion"


def test_the_map_names_no_limit_of_stability_where_each_spring_holds():
    slow = {"from": "1 um/s", "to": "10 um/s", "scale": "log", "cycles": 1}
    changes = {
        "drive.stage": slow,
        "sweep": {"drive.stiffness": ["50 N/m", "1600 N/m"]},
    }
    page = Page(sim.load("scenarios/stability_map.toml", changes))
    while (answer := page.figure({}, "map"))["more"]:
        pass
    assert "unstable" not in answer["words"] and "half" not in answer["words"]
    assert not any(y for panel in answer["panels"] for y in panel["marks"][-1]["y"][2:])


def test_motions_at_other_points_of_the_sweep_keep_the_extremes_of_their_runs():
    scene = sim.load("scenarios/pull_off.toml")
    others = Page(scene).others({}, "motion")["others"]
    run = sim.run(
        sim.load("scenarios/pull_off.toml", {"clock.record": scene.clock.step})
    )
    assert [one["label"] for one in others] == [
        "k = 34 N/m",
        "k = 3.4 kN/m",
        "k = 34 kN/m",
    ]
    for one, stiffness in zip(others, (34.0, 3400.0, 34000.0), strict=True):
        load = np.array(one["columns"]["normal_load"])
        exact = run["normal_load"].sel(contact_stiffness=stiffness)
        assert_allclose([load.min(), load.max()], [exact.min(), exact.max()], rtol=1e-5)
        assert len(load) < 3000
    # the present point has no twin, and a number that is no point leaves all of them
    labels = [
        one["label"]
        for one in Page(scene).others({"contact.stiffness": 34.0}, "motion")["others"]
    ]
    assert "k = 34 N/m" not in labels and "k = 340 N/m" in labels
    # many slips of several points are no lines any more
    clutch = Page(sim.load("scenarios/motor_clutch.toml")).others({}, "motion")[
        "others"
    ]
    assert len(clutch) == 7
    for one in clutch:
        assert "slider_position" in one["columns"]
        assert "friction_force" not in one["columns"]
    bead = Page(sim.load("scenarios/soft_bead.toml")).others({}, "motion")["others"]
    assert [one["label"] for one in bead] == ["profile = circle"]


def test_the_sentence_names_where_adhesion_is_masked_and_friction_is_largest():
    def words(name, values=()):
        return Page(sim.load(f"scenarios/{name}.toml")).answer(dict(values), 0.1)[
            "level"
        ]["words"]

    page = Page(sim.load("scenarios/masking.toml"))
    answer = page.answer({}, 0.1, "sweep")
    work = np.array(answer["curves"]["work_of_adhesion"])
    first = int(np.flatnonzero(work <= 0.0)[0])
    low, high = (1e-3 * answer["x"][k] for k in (first - 1, first))
    assert (
        f"masked between {low:.4g} kPa and {high:.4g} kPa" in answer["level"]["words"]
    )
    assert "masked" not in words("fixed_grips")
    scene = sim.load("scenarios/friction_maximum.toml")
    speeds = np.geomspace(1e-4, 1e-1, 20001)
    force = curves(scene, speeds)["friction_force"]
    assert f"{1e3 * force.max():.4g} mN" in words("friction_maximum")
    assert f"about {1e3 * speeds[force.argmax()]:.2g} mm/s" in words("friction_maximum")
    assert "largest" not in words("pdms_lens")


def test_the_band_of_a_fit_holds_its_curve_and_is_as_wide_as_its_errors():
    page = Page(sim.load("scenarios/measured_lens.toml"))
    table = page.tables[page.start()["data"]]
    free = ["bonds.critical_speed", "bonds.stress"]
    answer = fitted(page.scenario, table, free, lambda message: None)
    values = {key: number["value"] for key, number in answer["numbers"].items()}
    shown = page.figure(values, "data", page.start()["data"])["panels"]
    for band in answer["marks"]:
        (panel,) = (one for one in shown if one.get("of") == band["of"])
        line = panel["marks"][0]
        low, middle, high = (np.array(y) for y in (band["y"], line["y"], band["high"]))
        assert_allclose(band["x"], line["x"], rtol=1e-9)
        assert np.all(low <= middle) and np.all(middle <= high)
    # at low speed friction is the stress times an area that the fit leaves as it is
    result = sim.fit(
        "scenarios/measured_lens.toml", "scenarios/measured_lens.csv", free
    )
    error = result.errors["bonds.stress"] / result.values["bonds.stress"]
    force = answer["marks"][1]
    width = (force["high"][0] - force["y"][0]) / force["y"][0] / error
    # the range of 30 normal draws is 4.09(69) standard deviations
    assert abs(width - 4.09) < 4.0 * 0.69


def test_rings_of_a_plan_are_on_the_curves_at_their_conditions():
    page = Page(sim.load("scenarios/measured_lens.toml"))
    problem = problem_of(page.scenario, [page.tables[page.start()["data"]]], [], {})
    marks = rings(problem, [{"speed": 3e-3}])
    exact = curves(page.scenario, np.array([3e-3]))
    factors = {"contact_area": 1e6, "friction_force": 1e3}
    assert [mark["of"] for mark in marks] == [*factors]
    for mark in marks:
        assert_allclose(mark["x"], [3.0], rtol=1e-12)
        assert_allclose(mark["y"], factors[mark["of"]] * exact[mark["of"]], rtol=1e-9)


def test_a_plan_takes_relative_errors_of_what_it_predicts_as_the_command_does(tmp_path):
    path, free = tmp_path / "masking.csv", ["shear.spectrum.wavelength"]
    # values far from the scenario's, which decide nothing
    text = "speed [mm/s],contact_area [mm^2],contact_area_error [%]\n1,3,1\n3,2,1\n"
    path.write_text(text, encoding="utf-8")
    scene = sim.load("scenarios/masking.toml")
    page = Page(scene)
    said = planned(page.read({}), page.planned(page.add(path, "own")), free, print)
    result = sim.plan(scene, path, free, sims=100)
    (row,), _ = result.rows
    for heading, words in row.items():
        assert f"{heading}: {words}" in said["text"]


def test_a_table_of_errors_alone_serves_a_plan(monkeypatch):
    # fewer starts of each search, and no further speeds
    monkeypatch.setattr(mechanisms, "_STARTS", 2)
    monkeypatch.setattr(plan, "_SPEEDS", 2)
    page = Page(sim.load("scenarios/pdms_lens.toml"))
    text = "speed [mm/s],contact_area_error [%]\n0.01,0.7\n0.9,0.7\n"
    key = page.add(text, "points.csv")
    assert key not in page.tables
    assert "plan" in page.answer({}, 0.1, table=key)["data"]["words"]
    assert page.figure({}, "data", key)["panels"] == []
    table = page.planned(key)
    found = planned(page.read({}), table, ["bonds.critical_speed"], print, sims=50)
    assert "P(told apart)" in found["text"] and found["marks"] == []
    # a table without errors is refused by the words of a fit
    with pytest.raises(sim.BadInput, match="measured"):
        page.add("speed [mm/s]\n1\n2\n", "none.csv")


def test_chi_square_of_a_table_is_stated_over_a_sweep_too():
    page = Page(sim.load("scenarios/masking.toml"))
    text = (
        "speed [mm/s],contact_area [mm^2],contact_area_error [%]\n1,0.03,1\n3,0.03,1\n"
    )
    key = page.add(text, "own.csv")
    over_sweep, over_speed = (
        page.answer({}, 0.1, figure, key)["data"] for figure in ("sweep", "speed")
    )
    assert "χ²" in over_sweep["words"] and over_sweep["words"] == over_speed["words"]
    assert over_speed["points"] and not over_sweep["points"]


def test_a_wave_has_four_pixels_or_no_picture():
    scene = sim.load("scenarios/masking.toml").with_values({})
    found = contact(scene, 3e-3)
    stress = np.array(found["stress"])
    assert found["side"] / len(stress) <= 24e-6 / 4.0
    # all crests are seen: none is missed by more than half a pixel
    row = stress[:, 0]
    inner = (row[1:-1] > row[:-2]) & (row[1:-1] >= row[2:])
    phase = np.pi * found["side"] / len(stress) / 24e-6
    assert np.all(row[1:-1][inner] >= 0.999 * 375e3 * np.cos(phase))
    assert abs(inner.sum() - found["side"] / 24e-6) <= 1.0
    short = scene.with_values({"shear.spectrum.wavelength": 1e-6})
    assert contact(short, 3e-3)["stress"] is None


def test_the_diagnosis_over_a_sweep_names_the_number_that_it_is_for():
    page = Page(sim.load("scenarios/masking.toml"))
    for amplitude in (375e3, 200e3):
        first, *_ = page.words({"shear.spectrum.amplitude": amplitude})["diagnosis"]
        assert engineering(amplitude, "Pa") in first
    lens = Page(sim.load("scenarios/pdms_lens.toml"))
    assert not any("its slider" in line for line in lens.words({})["diagnosis"])


def test_numbers_are_written_back_after_their_difference_and_the_page_follows_the_file(
    tmp_path,
):
    path = tmp_path / "lens.toml"
    text = LENS + '\n[sweep]\n"contact.load" = ["1 mN", "4 mN"]\n'
    path.write_text(text, encoding="utf-8")
    page = Page(sim.load(path))
    with pytest.raises(sim.BadInput, match="already"):
        page.difference({})
    shown = page.difference({"sphere.radius": 3e-3})["difference"].splitlines()
    changed = [line for line in shown if line[0] in "+-" and line[1] not in "+-"]
    assert [line[0] for line in changed] == ["-", "+"] and "3 mm" in changed[1]
    assert path.read_text(encoding="utf-8") == text
    with pytest.raises(sim.BadInput, match="has changed meanwhile"):
        page.write({"sphere.radius": 3e-3}, "1")
    table = page.add("speed,contact_radius\n1,1.1e-4\n2,1e-4\n", "own.csv")
    page.write({"sphere.radius": 3e-3}, page.stamp)
    new = page.renewed()
    assert new.scenario.sphere.radius == 3e-3 and len(new.start()["points"]) == 2
    assert new.stamp != page.stamp and table in new.tables
    with pytest.raises(sim.BadInput, match="no file of yours"):
        Page(sim.load(tomllib.loads(LENS))).difference({"sphere.radius": 3e-3})


def test_other_curves_are_those_of_the_other_points_of_a_sweep_and_of_other_loads():
    page = Page(sim.load("scenarios/temperature.toml"))
    assert len(page.others({})["others"]) == 4
    load = page.scenario.contact.load
    *_, last = page.others({}, loads=True)["others"]
    exact = curves(page.read({"contact.load": 4.0 * load}), page.speeds)
    assert_allclose(last["curves"]["contact_area"], exact["contact_area"], rtol=1e-12)
    assert last["label"].startswith("P = ")


def test_a_table_without_units_says_so_and_one_of_radii_has_points(lens):
    page = Page(sim.load(lens))
    text = "speed,contact_radius,contact_radius_error\n1,1.1e-4,1e-6\n2,1e-4,1e-6\n"
    answer = page.answer({}, 0.1, table=page.add(text, "radii.csv"))
    assert "SI" in answer["data"]["words"]
    points = answer["data"]["points"]["contact_area"]
    assert_allclose(points["values"], np.pi * np.array([1.1e-4, 1e-4]) ** 2, rtol=1e-12)
    assert_allclose(
        points["errors"], 2e-6 * np.pi * np.array([1.1e-4, 1e-4]), rtol=1e-12
    )
    assert answer["x"][-1] >= 2.0


@pytest.mark.parametrize(
    "link",
    [
        "http://127.0.0.1:1/#sphere.radius=0.003&share=0.2&token=x",
        "sphere.radius=0.003&share=0.2",
    ],
)
def test_the_numbers_of_an_address_are_taken_and_its_token_is_not(lens, link):
    assert state_of(link, Page(sim.load(lens))) == "sphere.radius=0.003&share=0.2"


@pytest.mark.parametrize(
    "link",
    [
        "#sphere.radius=<img>",
        "#__proto__=1",
        "#sphere.radius=inf",
        "#sphere.radius=-1",
        "#path=/etc",
        "#figure=../x",
        "#a=" * 300,
    ],
)
def test_an_address_of_anything_but_numbers_is_refused(lens, link):
    with pytest.raises(sim.BadInput, match="--state"):
        state_of(link, Page(sim.load(lens)))


def test_the_command_refuses_what_it_cannot_use_in_one_line_before_it_serves(
    lens, monkeypatch
):
    with Server(sim.load(lens))._socket as taken:
        port = taken.getsockname()[1]
        for arguments, message in (
            (("nothing.toml",), "there is no such file"),
            ((lens, "--port", port), "the port is in use"),
            ((lens, "--port", 70000), "70000"),
            ((lens, "--data", "nothing.csv"), "nothing.csv"),
            ((lens, "--data", lens), "lens.toml"),
            ((lens, "--state", "#x=y"), "--state"),
        ):
            done = command("explore", *arguments, "--no-browser")
            assert done.exit_code == 2 and message in done.stderr.splitlines()[-1], (
                arguments
            )


@pytest.mark.parametrize(
    "arguments", [["--help"], ["check", "scenarios/pdms_lens.toml"]]
)
def test_another_command_imports_nothing_of_the_page(arguments):
    code = "import atexit, sys\natexit.register(lambda: print(*sys.modules, file=sys.stderr))\n"
    code += f"import sim.cli\nsys.argv[1:] = {arguments}\nsim.cli.main()"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    modules = done.stderr.split()
    assert "sim.cli" in modules and done.stdout
    assert not [
        n
        for n in modules
        if n.startswith(("sim.explorer", "starlette", "uvicorn", "tomlkit"))
    ]


def test_the_command_names_the_extra_that_is_missing_and_a_browser_that_is(
    lens, monkeypatch
):
    monkeypatch.setattr("webbrowser.open", lambda link: False)
    monkeypatch.setattr(Server, "run", lambda self: self._socket.close())
    done = command("explore", lens)
    assert (
        done.exit_code == 0 and "no browser was found" in done.stdout.splitlines()[-1]
    )
    for name in [name for name in sys.modules if name.startswith("sim.explorer")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "lmfit" else name
    )
    done = command("explore", "nothing.toml")
    assert done.exit_code == 2 and len(done.stderr.splitlines()) == 1
    assert "lmfit" in done.stderr and "[explore]" in done.stderr
