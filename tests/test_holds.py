"""Slide-hold-slide: courses, ageing in holds, unloaded holds, and what is said of the growth of the peaks."""

import numpy as np
import pytest
from helpers.lens import scene
from helpers.parts import Adhesion, Bell, Clock, Spring, bonds, drive, run, shear
from helpers.statements import values_of
from numpy.testing import assert_allclose, assert_array_equal

import sim
from sim import read
from sim.parts.drive import StageHolds
from sim.read.peaks import _ageing
from sim.units.errors import BadInput

HOLDS = (0.1, 1.0, 10.0)


def held(holds, duration, step=1e-3, **changes):
    """Return a run of linear mean-field bonds that slide fast and hold, with adhesion that bonds leave alone."""
    made = {"critical_speed": 1e-3, "rebinding_rate": 0.3, "stress": 2e5}
    return run(
        scene(
            shear=shear.Uniform(),
            adhesion=Adhesion(work=42e-3, bond_share=0.0),
            bonds=bonds.Rate(**made | changes),
            drive=drive.Holds(speed=1e-2, slide=1.0, holds=holds),
            clock=Clock(duration, step),
        )
    )


def test_peaks_after_holds_follow_the_exponential_ageing_of_one_rebinding_rate():
    dataset = held(HOLDS, 15.1)
    peaks = read.peaks_after_holds(dataset)
    found = peaks["peak_after_hold"].to_numpy()
    known = np.isfinite(found)
    assert_allclose(peaks["time_held"].to_numpy()[known], HOLDS, rtol=1e-12)
    fraction = dataset["bond_fraction"].to_numpy().squeeze()
    time, area = dataset["t"].to_numpy(), dataset["contact_area"].to_numpy().ravel()[0]
    starts = peaks["start"].to_numpy()[known] - HOLDS
    before = fraction[np.searchsorted(time, starts - 1e-9)]
    aged = 1.0 - (1.0 - before) * np.exp(-0.3 * np.array(HOLDS))
    assert_allclose(found[known], 2e5 * area * aged, rtol=1e-12)
    result = values_of(read.events(dataset))
    slope = np.polyfit(np.log10(HOLDS), found[known], 1)[0]
    assert_allclose(result["hold_growth"], slope, rtol=1e-9)
    assert np.isnan(result["hold_saturation"])


def test_a_course_of_holds_is_the_table_of_its_rows():
    course = drive.Holds(speed=3e-3, slide=0.2, holds=(0.1, 0.4))
    times = [0.0, 0.2, 0.2, 0.3, 0.3, 0.5, 0.5, 0.9, 0.9, 1.1]
    table = drive.Table(time=times, speed=3e-3 * np.resize([1, 1, 0, 0], 10))
    ends = np.linspace(0.0, 1.5, 41)
    for own, other in zip(
        course.pieces(ends, 1.5), table.pieces(ends, 1.5), strict=True
    ):
        assert_allclose(own, other, rtol=1e-12, atol=1e-18)
    assert_allclose(course.lasts, 1.1, rtol=1e-15)


@pytest.mark.parametrize(
    "model",
    [bonds.FirstMoment, pytest.param(bonds.Tracked, marks=pytest.mark.verify)],
)
def test_an_unloaded_hold_has_no_force_and_balances_its_energy(model):
    made = {"bond_stiffness": 8e-7, "rebinding_rate": 5.0, "site_density": 6.5e16}
    extra = {"sites": 40} if model is bonds.Tracked else {}
    few = model(rupture=Bell(zero_force_rate=1.0, bell_force=4e-12), **made, **extra)
    stage = StageHolds(speed=4e-4, slide=0.1, holds=(0.2,), while_held="unloaded")
    dataset = run(
        scene(
            shear=shear.Uniform(),
            adhesion=Adhesion(work=42e-3),
            bonds=few,
            drive=Spring(stage=stage, stiffness=300.0),
            clock=Clock(0.4, 1e-3),
        )
    )
    time = dataset["t"].to_numpy()
    inside = (time > 0.1005) & (time < 0.3005)
    force, friction, stage, position, residual, work, bound = (
        dataset[name].transpose("t", ...).to_numpy()
        for name in (
            "spring_force",
            "friction_force",
            "stage_position",
            "slider_position",
            "energy_residual",
            "drive_work",
            "bond_fraction",
        )
    )
    assert_array_equal(force[inside], 0.0)
    # within the tolerance of the slider's motion
    assert np.all(np.abs(friction[inside]) < 1e-6 * np.max(friction))
    assert_array_equal(stage[inside], position[inside])
    assert np.max(np.abs(residual)) < 1e-6 * np.max(work)
    assert np.max(force[~inside]) > 0.0
    # the spring is relaxed when the stage moves again, so that its force begins at zero
    first = np.flatnonzero(time > 0.3005)[0]
    assert np.all(np.abs(force[first]) <= 300.0 * 4e-4 * 1.001e-3)
    if model is bonds.FirstMoment:
        # unstretched bonds age at the rate k_on + k_0 towards the bonds of rest
        rows = bound[inside][1:].squeeze()
        since = time[inside][1:] - time[inside][1]
        assert_allclose(1.0 - rows, (1.0 - rows[0]) * np.exp(-6.0 * since), rtol=1e-6)


def test_a_slope_is_given_only_of_peaks_that_still_grow_and_a_saturation_else():
    times = np.logspace(-2.0, 2.0, 9)
    logarithmic = 1.0 + 0.2 * np.log10(times)
    slope, saturation, _ = _ageing(logarithmic[np.newaxis], times)
    assert_allclose(slope, 0.2, rtol=1e-12)
    assert np.isnan(saturation)
    exponential = 1.0 - np.exp(-2.0 * times)
    slope, saturation, _ = _ageing(exponential[np.newaxis], times)
    first = exponential[2] - exponential[0]
    assert np.isnan(slope).all()
    expected = times[np.argmax(exponential[-1] - exponential < 0.1 * first)]
    assert_allclose(saturation, expected, rtol=1e-12)
    # peaks that fall, or of members that differ by more than what they gain, say nothing
    for peaks in (
        -logarithmic[np.newaxis],
        logarithmic + np.array([[0.0], [1.0]]) * times,
    ):
        slope, saturation, _ = _ageing(peaks, times)
        assert np.isnan([*slope, saturation]).all()
    # less than two decades
    assert "hold_growth" not in read.events(held((0.1, 0.3), 3.4))


def test_the_table_has_a_row_for_each_peak_and_the_figure_its_numbers():
    dataset = held(HOLDS, 15.1)
    peaks = read.peaks_after_holds(dataset)["peak_after_hold"].to_numpy().ravel()
    tables = read.tables_of(sim.Run(dataset))
    rows = next(table.rows for table in tables if "held before (s)" in table.rows[0])
    assert [float(row["held before (s)"]) for row in rows] == [*HOLDS]
    figure = sim.plot(dataset)
    (panel,) = figure.axes
    x, y = panel.lines[0].get_data()
    assert not panel.containers  # one member has no error
    assert_allclose(x, HOLDS, rtol=1e-12)
    assert_allclose(y, 1e3 * peaks[np.isfinite(peaks)], rtol=1e-12)
    assert any(
        "per decade" in text.get_text() for text in figure.legends[0].get_texts()
    )
    with pytest.raises(ValueError, match="holds"):
        sim.plot(held((0.1,), 2.2), "holds")


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"holds": []}, "holds"),
        ({"holds": ["0 s"]}, "holds"),
        ({"slide": "0 s"}, "slide"),
        ({"while_held": "up"}, "while_held"),
        ({"cycles": 2}, "cycles"),
    ],
)
def test_a_list_of_holds_that_cannot_be_is_refused_with_its_key(change, key):
    stage = {"speed": "1 mm/s", "slide": "1 s", "holds": ["1 s"]} | change
    pull = {"model": "spring", "stage": stage, "stiffness": "1 kN/m"}
    with pytest.raises(BadInput, match=key):
        sim.load("scenarios/slide_hold_slide.toml", {"drive": pull, "sweep": {}})


def test_a_run_that_ends_before_the_last_peak_is_remarked():
    changes = {"clock.duration": "8 s", "sweep": {}}
    for duration, is_short in ((changes, True), ({"sweep": {}}, False)):
        text = str(sim.check(sim.load("scenarios/slide_hold_slide.toml", duration)))
        assert ("48.41 s or more" in text) is is_short


@pytest.mark.parametrize("duration", ["1.5 s", "2.2 s", "2.25 s", "2.6 s", "3.25 s"])
def test_a_run_that_has_the_peak_after_the_last_hold_is_not_said_to_end_before_it(
    duration,
):
    stage = {"speed": "0.2 mm/s", "slide": "1 s", "holds": ["50 ms", "0.2 s"]}
    dataset = sim.run(
        {
            "clock": {"duration": duration, "step": "5 ms"},
            "solid": {"shear_modulus": "1.6 MPa"},
            "sphere": {"radius": "2 mm"},
            "adhesion": {"work": "42 mJ/m^2", "bond_share": 0.0},
            "contact": {"load": "4 mN"},
            "drive": {
                "model": "spring",
                "stage": stage,
                "stiffness": "2 kN/m",
                "damping": 1.0,
            },
            "bonds": {
                "model": "rate",
                "rupture": {
                    "model": "bell",
                    "zero_force_rate": 0.5,
                    "bell_force": "4 pN",
                },
                "bond_stiffness": "0.8 uN/m",
                "rebinding_rate": 2.0,
                "site_density": "6.5e16 1/m^2",
            },
        }
    )
    held = read.peaks_after_holds(dataset)
    has_peak = "peak_after_hold" in held and bool(
        (held["peak_after_hold"].notnull() & (held["time_held"] > 0.1)).any()
    )
    remarks = [text for text in read.remarks(dataset) if "clock.duration" in text]
    assert has_peak == (duration in ("2.6 s", "3.25 s"))
    assert len(remarks) == (duration != "3.25 s")
    assert all("3.25 s" in text for text in remarks)
    assert all(("before" in text) != has_peak for text in remarks)
