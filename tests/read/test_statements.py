"""Statements: one place, whose values tables, CSV and report print."""

import math

import numpy as np
import xarray as xr
from helpers.lens import scene
from helpers.parts import Bell, bonds, drive, read, run, shear
from helpers.printed import rows_of
from helpers.statements import each

from sim.quantities import QUANTITIES
from sim.read.errors import SystematicError
from sim.units.notation import concise


def test_a_number_prints_its_error_its_bounds_or_its_reason():
    nan = math.nan
    cases = {
        "1.570(20) mm/s": (1.57e-3, 2e-5, 1.53e-3, 1.61e-3, nan, ""),
        "1.570(20) ± 0.031 (step) mm/s": (1.57e-3, 2e-5, 1.53e-3, 1.61e-3, 3.1e-5, ""),
        "> 50 mm/s": (nan, nan, 0.05, nan, nan, ""),
        "< 200 µm/s": (nan, nan, nan, 2e-4, nan, ""),
        "0.3 to 3 mm/s; too few speeds": (nan, nan, 3e-4, 3e-3, nan, "too few speeds"),
        "105 µm/s; not settled": (105e-6, nan, nan, nan, nan, "not settled"),
        "no member is closed": (nan, nan, nan, nan, nan, "no member is closed"),
    }
    for text, (value, *errors, reason) in cases.items():
        sem, low, high, bound = map(xr.DataArray, errors)
        speed = xr.DataArray(value, attrs={"units": "m/s"})
        bound = bound.assign_attrs(source="step")
        one = read.Estimate(speed, sem, low, high, bound, reason=xr.DataArray(reason))
        assert read.tables.figure(one, QUANTITIES["speed"]) == text


def test_table_csv_and_statements_have_the_same_numbers_and_samples():
    speeds = ["1 mm/s", "3 mm/s", "10 mm/s"]
    dataset = run(scene(drive=drive.Steady(speed=1e-3), sweep={"drive.speed": speeds}))
    stated = read.Run(dataset).statements()
    assert (
        stated["contact_area"].value.attrs["over"]
        == "second half of the run and 6 members"
    )
    assert stated["speed_at_5_percent_lost"].value.attrs["over"] == "6 members"
    rows = read.long(read.Run(dataset)).set_index("quantity")
    whole_run = rows[rows["t"].isna()]
    for statement in each(stated):
        row = whole_run.loc[[statement.name]]
        at = (
            row
            if "drive_speed" not in statement.at
            else row[row["drive_speed"] == statement.at["drive_speed"]]
        )
        np.testing.assert_array_equal(at["mean"], statement.value)
        assert set(at["over"]) == {
            stated[statement.name].value.attrs.get("over") or "one run"
        }
    areas = [s.value for s in each(stated) if s.name == "area_ratio"]
    np.testing.assert_array_equal(areas, stated["area_ratio"].value)
    (first, *_), frame = rows_of(dataset), read.frame(read.Run(dataset))
    assert first["A/A_JKR (%)"] == concise(
        100.0 * frame["area_ratio"][0], 100.0 * frame["area_ratio_error"][0]
    )
    np.testing.assert_array_equal(frame["area_ratio"], areas)


def test_key_figures_have_the_errors_of_the_table():
    one = read.Run(run(scene(drive=drive.Steady(speed=1e-3))))
    values = {row[""]: row["value"].split()[0] for row in read.tables.key_figures(one)}
    rows = {
        row["quantity"].partition(" (")[0]: row["mean"] for row in read.spread(one).rows
    }
    assert {"ΔΓ", "w", "a", "A/A_JKR"} <= rows.keys()
    shown = {name: values[name] for name in ("ΔΓ", "w", "a", "A/A_JKR")}
    assert shown.items() <= rows.items()


def test_a_reason_marks_its_cell_and_is_a_note_of_the_table_with_its_point():
    loads = {"contact.load": ["1 mN", "4 mN"]}
    held = {"drive": drive.Steady(speed=1e-3), "shear": shear.Uniform()}
    one = read.Run(run(scene(**held, sweep=loads)))
    late = one.late(column.name for column in read.tables.main_columns(one))
    reason = np.array(["", "not settled: 1 → 2"], object)
    reason = xr.DataArray(reason, dims="contact_load")
    late["area_ratio"] = late["area_ratio"]._replace(reason=reason)
    (table,) = read.tables_of(one)
    marked = [row["A/A_JKR (%)"].endswith("*") for row in table.rows]
    assert marked == [False, True]
    needed = read.notes(one, [table]).needed
    assert "* A/A_JKR: not settled: 1 → 2 (at contact_load = 4 mN)" in needed


def test_a_maximum_inside_a_sweep_and_a_systematic_error_are_notes():
    bond = {
        "rupture": Bell(zero_force_rate=20.0, bell_force=4e-12),
        "bond_stiffness": 4e-7,
        "rebinding_rate": 200.0,
    }
    stretched = bonds.FirstMoment(**bond, site_density=1e16)
    speeds = ["100 mm/s", "0.1 mm/s", "4 mm/s"]
    scenario = scene(
        drive=drive.Steady(speed=1e-3),
        bonds=stretched,
        shear=shear.Uniform(),
        sweep={"drive.speed": speeds},
    )
    dataset = run(scenario)
    friction = dataset["friction_force"].isel(t=-1).to_numpy()
    assert friction[2] > friction.max(initial=0.0, where=[True, True, False])
    one = read.Run(dataset)
    lines = read.notes(one, []).further
    (line,) = [line for line in lines if line.startswith("friction force is largest")]
    assert line.endswith("at drive_speed = 4 mm/s (between 100 µm/s and 100 mm/s)")
    # it falls all the way
    assert not [line for line in lines if "contact area is" in line]
    late = one.late(("contact_area", "friction_force"))
    reason = np.array(["", "not settled", ""], object)
    reason = xr.DataArray(reason, dims="drive_speed")
    late["friction_force"] = late["friction_force"]._replace(reason=reason)
    lines = read.notes(one, []).further
    assert not [line for line in lines if "friction force is" in line]
    error = SystematicError(
        "cell_error_area",
        5.13,
        "points of A/A_JKR",
        "contact_load = 1 mN",
        'shear.cell = "4 mm"',
    )
    words = 'the mean ΔΓ of the cell adds +5.1 points of A/A_JKR at contact_load = 1 mN; cure: shear.cell = "4 mm"'
    assert str(error) == words and error.matters
