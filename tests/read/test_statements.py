"""Statements: one place, whose values tables, CSV and report print."""

import math

import numpy as np
import pytest
import xarray as xr
from helpers.draws import ornstein_uhlenbeck
from helpers.lens import scene
from helpers.parts import Bell, Clock, Ensemble, bonds, drive, read, run, shear
from helpers.printed import rows_of
from numpy.testing import assert_allclose

from sim.read.errors import SystematicError
from sim.read.statements import Statement
from sim.units.notation import concise


def test_a_statement_prints_its_error_its_bounds_or_its_reason():
    nan = math.nan
    cases = {
        "1.570(20) mm/s": (1.57e-3, 2e-5, 1.53e-3, 1.61e-3, nan, ""),
        "1.570(20) ± 0.031 (step) mm/s": (1.57e-3, 2e-5, 1.53e-3, 1.61e-3, 3.1e-5, ""),
        "> 50 mm/s": (nan, nan, 0.05, nan, nan, ""),
        "< 200 µm/s": (nan, nan, nan, 2e-4, nan, ""),
        "0.3 to 3 mm/s; 5 speeds: add some here": (
            nan,
            nan,
            3e-4,
            3e-3,
            nan,
            "5 speeds: add some here",
        ),
        "105 µm/s; not settled": (105e-6, nan, nan, nan, nan, "not settled"),
        "no member is closed": (nan, nan, nan, nan, nan, "no member is closed"),
    }
    for text, (*numbers, reason) in cases.items():
        statement = Statement("speed", "speed", "m/s", *numbers, "step", "", reason, {})
        assert str(statement) == text


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
    for statement in read.each(stated):
        row = whole_run.loc[[statement.name]]
        at = (
            row
            if "drive_speed" not in statement.at
            else row[row["drive_speed"] == statement.at["drive_speed"]]
        )
        np.testing.assert_array_equal(at["mean"], statement.value)
        assert set(at["over"]) == {statement.over or "one run"}
    areas = [s.value for s in read.each(stated) if s.name == "area_ratio"]
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


@pytest.mark.parametrize(
    ("count", "least", "most"),
    [(40, 32, 40), pytest.param(200, 179, 198, marks=pytest.mark.verify)],
)
def test_a_relaxation_time_is_that_of_the_rate_equation_with_an_interval_by_members_or_a_reason(
    count, least, most
):
    rates, still = (
        {"critical_speed": 3e-3, "rebinding_rate": 5.0, "stress": 2e5},
        {"shear": shear.Uniform()},
    )
    lens = still | {
        "drive": drive.Steady(speed=1e-3),
        "clock": Clock(duration=2.0, step=0.01),
    }
    exact = 1.0 / (5.0 * (1.0 + 1.0 / 3.0))  # dN/dt = h (N0 - N) - h (V/Vc) N
    found = read.relaxation(
        run(scene(bonds=bonds.Rate(**rates, start_from="empty"), **lens)),
        "shear_stress",
    )
    assert_allclose(found.value, exact, rtol=1e-9)
    # no noise, no interval
    assert math.isnan(found.error) and math.isnan(found.low) and not found.reason
    counted = bonds.Counted(**rates, start_from="empty", sites=50)
    found = read.relaxation(
        run(scene(bonds=counted, ensemble=Ensemble(members=40), **lens)), "shear_stress"
    )
    assert found.low < exact < found.high and found.error < 0.1 * exact
    time, rng = np.linspace(0.0, 5.0, 101), np.random.default_rng(27)

    def course(mean, members=10):
        # of a correlation time of 0.5 s
        noise = ornstein_uhlenbeck(rng, (members, time.size), math.exp(-0.05 / 0.5))
        return xr.Dataset({"x": (("member", "t"), mean + 0.1 * noise)}, {"t": time})

    intervals = [
        read.relaxation(course(1.0 - np.exp(-time / 0.63)), "x") for _ in range(count)
    ]
    # a band of 99.9 %
    assert least <= sum(each.low < 0.63 < each.high for each in intervals) <= most
    rests = xr.Dataset(
        {"x": ("t", np.exp(-np.maximum(time - 1.0, 0.0) / 0.4))}, {"t": time}
    )
    later = read.relaxation(rests, "x", 1.0)
    assert_allclose(later.value, 0.4, rtol=1e-9)
    cases = {
        "not exponential": np.exp(-np.sqrt(time)),
        "too long for the run": np.exp(-time / 8.0),
        "not change": 0.0 * time,
    }
    for words, mean in cases.items():
        refused = read.relaxation(xr.Dataset({"x": ("t", mean)}, {"t": time}), "x")
        assert words in refused.reason and math.isnan(refused.value)
    of_noise = [
        read.relaxation(course(0.0 * time), "x").reason for _ in range(count // 4)
    ]
    assert of_noise.count("") <= 2


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
    words = 'the cell adds +5.1 points of A/A_JKR at contact_load = 1 mN; cure: shear.cell = "4 mm"'
    assert str(error) == words and error.matters
