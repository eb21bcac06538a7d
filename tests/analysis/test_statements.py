"""Statements: one place, whose values tables, CSV and report print."""

import math

import numpy as np
from helpers.lens import scene
from helpers.parts import analysis, drive, run, shear

from sim.analysis.statements import Statement, reasons


def test_a_statement_prints_its_error_its_bounds_or_its_reason():
    nan = math.nan
    cases = {
        "1.57(2) mm/s": (1.57e-3, 2e-5, 1.53e-3, 1.61e-3, ""),
        "> 50 mm/s": (nan, nan, 0.05, nan, ""),
        "< 200 µm/s": (nan, nan, nan, 2e-4, ""),
        "0.3 to 3 mm/s; 5 speeds: add some here": (nan, nan, 3e-4, 3e-3, "5 speeds: add some here"),
        "105 µm/s; not settled": (105e-6, nan, nan, nan, "not settled"),
        "no member is closed": (nan, nan, nan, nan, "no member is closed"),
    }
    for text, (*numbers, reason) in cases.items():
        assert str(Statement("speed", "speed", "m/s", *numbers, "", reason, {})) == text


def test_table_csv_and_statements_have_the_same_numbers_and_samples():
    speeds = ["1 mm/s", "3 mm/s", "10 mm/s"]
    dataset = run(scene(drive=drive.Steady(speed=1e-3), sweep={"drive.speed": speeds}))
    stated = analysis.statements(dataset)
    assert stated["contact_area_mean"].attrs["over"] == "second half of the run and 6 members"
    assert stated["speed_at_5_percent_lost_mean"].attrs["over"] == "6 members"
    rows = analysis.tidy(dataset).set_index("quantity")
    whole_run = rows[rows["t"].isna()]
    for statement in analysis.each(stated):
        row = whole_run.loc[[statement.name]]
        at = row if "drive_speed" not in statement.at else row[row["drive_speed"] == statement.at["drive_speed"]]
        np.testing.assert_array_equal(at["mean"], statement.value)
        assert set(at["over"]) == {statement.over or "one run"}
    areas = [s.value for s in analysis.each(stated) if s.name == "area_ratio"]
    np.testing.assert_array_equal(areas, stated["area_ratio_mean"])
    assert analysis.table(dataset) == analysis.table(dataset, stated=stated)


def test_a_reason_marks_its_cell_and_is_a_note_of_the_table():
    dataset = run(scene(drive=drive.Steady(speed=1e-3), shear=shear.Uniform(), sweep={"contact.load": [1e-3, 4e-3]}))
    stated = analysis.statements(dataset)
    stated = stated.assign(area_ratio_reason=("contact_load", np.array(["", "not settled"], object)))
    rows = analysis.table(dataset, stated=stated)
    marked = [row["A/A_JKR\n(%)"].endswith("*") for row in rows]
    assert marked == [False, True] and reasons(stated) == {"not settled": ["area_ratio"]}
    assert "* A/A_JKR: not settled" in analysis.notes(dataset, rows, [], stated)
