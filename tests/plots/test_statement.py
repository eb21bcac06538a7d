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
