"""Statements over a swept key, with their intervals and bounds; size, ranges and times of figures."""

import numpy as np
import pytest
from helpers.lens import scene
from helpers.parts import drive, read, run, shear
from helpers.pictured import legend_of, simulated
from numpy.testing import assert_allclose

from sim.plots import kinds
from sim.plots.kinds import Choices


@pytest.fixture(scope="module")
def speeds():
    return run(
        scene(
            drive=drive.Steady(speed=1e-3),
            sweep={"drive.speed": ["10 mm/s", "1 mm/s", "3 mm/s"]},
        )
    )


def test_a_statement_is_drawn_over_the_sorted_sweep_with_its_interval(speeds):
    stated = read.Run(speeds).statements()
    figure = kinds.draw(speeds, "contact_area")
    (panel,) = figure.axes
    x, y = panel.lines[-1].get_data()
    order = [1, 2, 0]
    assert_allclose(x, [1.0, 3.0, 10.0], rtol=1e-12)
    assert panel.get_xscale() == "log" and "mm/s" in panel.get_xlabel()
    factor = y[0] / float(stated["contact_area"].value[1])
    assert_allclose(y, factor * stated["contact_area"].value[order], rtol=1e-12)
    (bars,) = panel.collections
    ends = np.array([segment[:, 1] for segment in bars.get_segments()])
    assert_allclose(ends[:, 0], factor * stated["contact_area"].low[order], rtol=1e-9)
    assert_allclose(ends[:, 1], factor * stated["contact_area"].high[order], rtol=1e-9)
    assert "second half of the run and 6 members" in legend_of(panel)[1].replace(
        "\n", " "
    )
    with pytest.raises(ValueError, match="no figure"):
        kinds.draw(simulated(), "contact_area")  # nothing is swept


def test_swept_courses_have_short_names_a_key_below_the_figure_and_their_rates_as_its_axis():
    courses = [{"from": "4 mN", "to": f"{end} mN"} for end in (1, 2)]
    dataset = run(
        scene(
            drive=drive.Steady(speed=1e-3),
            shear=shear.Uniform(),
            sweep={"contact.load": courses},
        )
    )
    assert dataset["contact_load"].to_numpy().tolist() == ["load 1", "load 2"]
    figure = kinds.draw(dataset, "sweep")
    assert (
        figure.get_supxlabel() == "load 1: from 4 mN to 1 mN\nload 2: from 4 mN to 2 mN"
    )
    # of the loads in mN, the slower one first
    rates = np.array([2.0, 3.0]) / float(dataset["t"][-1])
    assert_allclose(figure.axes[0].lines[0].get_xdata(), rates, rtol=1e-12)
    assert (
        figure.axes[-1].get_xlabel() == "rate of the last change of contact.load (mN/s)"
    )
    for bent in (
        {"time": ["0 s", "0.2 s", "9 s"], "value": ["4 mN", "3 mN", "0 N"]},
        courses[0] | {"scale": "log"},
    ):
        parts = {"drive": drive.Steady(speed=1e-3), "shear": shear.Uniform()}
        dataset = run(scene(**parts, sweep={"contact.load": [courses[1], bent]}))
        assert dataset["contact_load_rate"].values[1] == 0.0
        assert "rate" not in kinds.draw(dataset, "sweep").axes[-1].get_xlabel()


def test_size_range_and_time_of_a_figure_are_chosen(speeds):
    figure = kinds.draw(
        speeds, "contact_area", Choices(size="8.5 x 6cm", xlim="0.5:20")
    )
    assert_allclose(figure.get_size_inches(), [8.5 / 2.54, 6.0 / 2.54], rtol=1e-12)
    assert_allclose(figure.axes[0].get_xlim(), [0.5, 20.0], rtol=1e-12)
    panel = kinds.draw(simulated(), "time", Choices(start="100 ms", stop=0.2)).axes[0]
    assert_allclose(panel.lines[0].get_xdata()[[0, -1]], [100.0, 200.0], rtol=1e-9)
    cases = {
        "--size": Choices(size="big"),
        "--xlim": Choices(xlim="1"),
        "--from": Choices(start="0.39 s"),
    }
    for option, choices in cases.items():
        with pytest.raises(ValueError, match=option):
            kinds.draw(simulated(), "time", choices)
    with pytest.raises(ValueError, match="no choice of start"):
        kinds.draw(simulated(), "curve", Choices(start=0.1))


def test_a_statement_has_the_speed_or_any_swept_key_as_its_axis_and_another_as_its_curves():
    dataset = simulated(
        drive=drive.Steady(speed=1e-3),
        sweep={"contact.load": [4e-3, 1e-3], "drive.speed": [1e-2, 1e-3, 3e-3]},
    )
    stated = read.Run(dataset).statements()["contact_area"].value
    for x, order in (("speed", [1, 2, 0]), ("drive.speed", [1, 2, 0])):
        panel = kinds.draw(dataset, "contact_area", Choices(x=x)).axes[0]
        curves = [line.get_data() for line in panel.lines if line.get_marker() == "o"]
        assert "speed" in panel.get_xlabel() and len(curves) == 2
        for k, (speed, area) in enumerate(curves):
            assert_allclose(speed, [1.0, 3.0, 10.0], rtol=1e-12)
            assert_allclose(area, 1e6 * stated[k, order], rtol=1e-12)
        assert legend_of(panel)[0] == ["$P$ = 4 mN", "$P$ = 1 mN"]
    panel = kinds.draw(dataset, "contact_area", Choices(x="load")).axes[0]
    (load, _), *others = [
        line.get_data() for line in panel.lines if line.get_marker() == "o"
    ]
    assert_allclose(load, [1.0, 4.0], rtol=1e-12)
    assert len(others) == 2
    with pytest.raises(ValueError, match='no x axis "t"; choose a swept one: speed'):
        kinds.draw(dataset, "contact_area", Choices(x="t"))


def test_a_histogram_counts_the_members_and_has_an_area_of_one():
    dataset = simulated(drive=drive.Steady(speed=4e-3))
    panel = kinds.draw(dataset, "histogram", Choices(x="fluctuation_energy")).axes[0]
    (steps,) = panel.patches
    density, edges, _ = steps.get_data()
    late = dataset["fluctuation_energy"].isel(t=slice(dataset.sizes["t"] // 2, None))
    exact, _ = np.histogram(1e3 * late, edges)
    assert exact.sum() == late.size
    assert_allclose(density * np.diff(edges), exact / late.size, rtol=1e-12)
    assert legend_of(panel)[1] == "6 members, second half of the run"
    alone = simulated(drive=drive.Steady(speed=4e-3), shear=shear.Uniform())
    assert "histogram" not in kinds.drawable(alone)
    with pytest.raises(ValueError, match="members that differ"):
        kinds.draw(alone, "histogram")


def test_equal_members_have_no_histogram_and_the_first_quantity_that_differs_is_drawn():
    ends_masked = simulated()  # at the end of the ramp all contacts are Hertz's
    area = ends_masked["contact_area"].isel(t=-1)
    assert float(area.max() - area.min()) < 1e-12 * float(area.max())
    panel = kinds.draw(ends_masked, "histogram").axes[0]
    assert panel.get_xlabel().startswith("elastic energy")
    with pytest.raises(ValueError, match="contact_area is equal in all members"):
        kinds.draw(ends_masked, "histogram", Choices(x="contact_area"))


def test_a_survival_falls_at_each_event_and_there_is_none_without_an_event():
    dataset = simulated(drive=drive.Steady(speed=4e-3)).copy(deep=True)
    end = float(dataset["t"][-1])
    dataset["first_masked"][:] = np.array([0.5, 0.25, np.nan, 0.25, np.nan, 0.75]) * end
    panel = kinds.draw(dataset, "survival").axes[0]
    time, share = panel.lines[0].get_data()
    assert_allclose(time, 1e3 * end * np.array([0.0, 0.25, 0.5, 0.75, 1.0]), rtol=1e-12)
    assert_allclose(share, np.array([6, 4, 3, 2, 2]) / 6, rtol=1e-12)
    assert panel.get_ylabel() == "contacts not yet masked"
    dataset["first_masked"][:] = np.nan
    assert "survival" not in kinds.drawable(dataset)
    with pytest.raises(ValueError, match="no contact is masked or detached"):
        kinds.draw(dataset, "survival")


def test_the_range_of_the_y_axis_is_chosen(speeds):
    figure = kinds.draw(speeds, "curve", Choices(ylim="0.2:0.9"))
    assert_allclose(figure.axes[0].get_ylim(), [0.2, 0.9], rtol=1e-12)
    with pytest.raises(ValueError, match="--ylim"):
        kinds.draw(speeds, "curve", Choices(ylim="1"))
