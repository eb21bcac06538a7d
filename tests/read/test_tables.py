"""Rows for the terminal and the CSV: what tells something, and nothing else."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import lens
from helpers.cases import posix
from helpers.lens import scene
from helpers.parts import (
    Adhesion,
    Bell,
    Clock,
    Ensemble,
    Equilibrium,
    Record,
    bonds,
    drive,
    read,
    run,
    shear,
)
from helpers.printed import rows_of
from helpers.statements import shares, statistics
from numpy.testing import assert_allclose, assert_array_equal

import sim
from sim.read import export, tables
from sim.read.observables import with_slips
from sim.units.errors import BadInput
from sim.units.notation import in_units


@pytest.mark.parametrize("per_member", [True, False])
def test_a_reduced_dataset_has_the_columns_that_it_can(per_member):
    recorded = ("fluctuation_energy", "speed")
    whole, some = (
        run(
            scene(
                drive=drive.Steady(speed=1e-2),
                record=Record(per_member=per_member, quantities=quantities),
            )
        )
        for quantities in (None, recorded)
    )
    rows = rows_of(some)
    assert "A/A_JKR (%)" not in rows[0] and {"a (µm)", "ΔΓ (mJ/m²)"} < set(rows[0])
    for full, row in zip(rows_of(whole), rows, strict=True):
        assert row.items() <= full.items()
    alone = run(scene(record=Record(per_member=per_member, quantities=())))
    assert [set(row) for row in rows_of(alone)] == 12 * [{"t (ms)", "a (µm)"}]
    assert rows_of(alone, read.highlights) == []
    assert "contact_radius" in sim.stats(alone)


def test_tables_have_a_dozen_rows_or_one_for_each_point(ramp):
    rows, result = rows_of(ramp), statistics(ramp)
    assert len(rows) == 12 and all(set(row) == set(rows[0]) for row in rows)
    assert [rows[0]["t (ms)"], rows[-1]["t (ms)"]] == ["0", "400"]
    for row, at in ((rows[0], 0), (rows[-1], -1)):
        mean = float(re.match(r"[\d.]+", row["a (µm)"])[0])
        # half a unit of the fourth digit, the least that is shown
        np.testing.assert_allclose(
            mean, 1e6 * float(result["contact_radius"].value[at]), rtol=5e-4
        )
    assert "open (%)" not in rows[0]
    # Wilson's bound of none in six: z²/(6 + z²) = 0.390
    assert {row["masked (%)"] for row in rows} == {"0 (<39)", "100 (>61)"}
    shares = read.tables_of(read.Run(ramp), show=["losses"])[1].rows[0]
    assert "lost to bonds (%)" in shares and "lost to fluct. (%)" in shares
    for loads, shares, rows in [(2, 1, 2), (30, 1, 12), (6, 5, 12)]:
        sweep = {
            "contact.load": list(np.linspace(1e-3, 9e-3, loads)),
            "adhesion.bond_share": list(np.linspace(0, 1, shares)),
        }
        dataset = run(
            scene(drive=drive.Steady(speed=1e-2), shear=shear.Uniform(), sweep=sweep)
        )
        table = rows_of(dataset)
        assert len(table) == rows and [
            row["contact_load (mN)"] for row in (table[0], table[-1])
        ] == ["1", "9"]
        assert not any(heading.startswith("t (") for heading in table[0])
    rows = rows_of(
        run(scene(sweep={"contact.load": ["1 mN", "4 mN"]}, shear=shear.Uniform()))
    )
    points = [(row["contact_load (mN)"], row["t (ms)"]) for row in rows]
    assert points == list(
        itertools.product(["1", "4"], ["0", "80", "160", "240", "320", "400"])
    )
    ripple = {"model": "ripple", "amplitude": 1e5, "wavelength": 24e-6}
    fields = {"shear": [{"model": "uniform"}, {"model": "mean", "spectrum": ripple}]}
    rows = rows_of(run(scene(drive=drive.Steady(speed=1e-2), sweep=fields)))
    assert [row["shear"] for row in rows] == ["uniform", "mean"]


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


def numbers_of(path):
    """Return the table of a CSV, each number by all of its digits: older versions of pandas round the last ones."""
    return pd.read_csv(path, dtype=str, keep_default_na=False).map(number)


@pytest.fixture(scope="module")
def long(ramp, tmp_path_factory):
    """The CSV of the ramp, as whoever has it reads it."""
    path = tmp_path_factory.mktemp("csv") / "out.csv"
    read.to_long_csv(read.Run(ramp), path)
    return numbers_of(path)


def of(long, quantity):
    return long[long["quantity"] == quantity]


def test_all_columns_leave_none_out_and_print_no_table_without_columns():
    swept = {"contact.load": [1e-3, 4e-3], "solid.shear_modulus": [1e6, 2e6]}
    lags = {"model": "rate_dependent", "front_speed": "0.1 mm/s", "reversible": 0.01}
    field = {"model": "mean", "spectrum": lens.FIELD["spectrum"]}
    lost = scene(contact=lags | {"load": 4e-3}, shear=field, sweep=swept)
    several = read.tables_of(sim.Run(run(lost)), show=["all"])
    assert max(len(each_table.columns) for each_table in several) > 6
    assert not any(each_table.left_out for each_table in several)
    still = scene(bonds=bonds.Unbroken(stress=1e5), shear=shear.Uniform())
    shown = read.tables_of(sim.Run(run(still)), show=["all"])
    assert shown and all(each_table.columns for each_table in shown)


def test_csv_reads_back_as_the_statistics_of_each_point_and_time(ramp, long, tmp_path):
    result, rows = statistics(ramp), of(long, "contact_radius")
    names = {"mean": "value", "error": "sem", "low": "low", "high": "high"}
    names["sd"] = "std"
    assert_array_equal(rows["t [s]"], ramp["t"])
    assert_array_equal(rows["speed [m/s]"], ramp["speed"])
    for column, kind in names.items():
        assert_array_equal(rows[column], getattr(result["contact_radius"], kind))
    assert_array_equal(
        rows["q95"], result["contact_radius"].quantile.sel(quantile=0.95)
    )
    assert_array_equal(
        rows["q50_low"], result["contact_radius"].quantile_low.sel(quantile=0.5)
    )
    lost = shares(ramp)["lost_to_fluctuations_first"].value
    assert_array_equal(of(long, "lost_to_fluctuations_first")["mean"], lost)
    assert (
        set(rows["unit"]) == {"m"}
        and set(rows["over"]) == {"6 members"}
        and next(iter(long)) == "t [s]"
    )
    (masked,) = of(long, "time_masked").to_dict("records")
    assert masked["mean"] == float(
        statistics(ramp)["time_masked"].value
    ) and math.isnan(masked["t [s]"])
    (dissipated,) = of(long, "total_dissipated").to_dict("records")
    assert dissipated["q95"] == 0.0 and dissipated["unit"] == "J"
    (speed,) = of(long, "speed_at_5_percent_lost").to_dict("records")
    result = read.loss_speeds(ramp)["speed_at_5_percent_lost"].low
    assert speed["low"] == float(result) and speed["unit"] == "m/s"
    sweep = {"contact.load": [1e-3, 4e-3], "adhesion.bond_share": [0.0, 0.5, 1.0]}
    dataset = run(scene(sweep=sweep, shear=shear.Uniform()))
    read.to_long_csv(read.Run(dataset), tmp_path / "out.csv")
    rows = of(numbers_of(tmp_path / "out.csv"), "contact_area")
    expected = itertools.product([1e-3, 4e-3], [0.0, 0.5, 1.0], dataset["t"].to_numpy())
    columns = rows[["contact_load [N]", "adhesion_bond_share", "t [s]"]].itertuples(
        index=False, name=None
    )
    assert list(columns) == list(expected)
    assert_array_equal(rows["mean"], dataset["contact_area"].to_numpy().ravel())
    text, how = (
        (tmp_path / "out.csv").read_bytes().decode(),
        {"index": False, "na_rep": "nan", "lineterminator": "\n"},
    )
    assert text == read.long(read.Run(dataset)).to_csv(
        header=text.partition("\n")[0].split(","), **how
    )


def test_a_large_csv_is_written_in_pieces_and_an_empty_one_has_no_rows(
    tmp_path, monkeypatch
):
    texts, lengths = export._texts, []
    monkeypatch.setattr(
        export, "_texts", lambda values: lengths.append(len(values)) or texts(values)
    )
    numbers = pd.DataFrame({"a": np.arange(70_000) / 7.0, "b": np.arange(70_000)})
    for rows in (numbers, pd.DataFrame()):
        rows.attrs["units"] = {}
        monkeypatch.setattr(export, "frame", lambda *_, rows=rows: rows)
        export.to_csv(None, tmp_path / "out.csv")
        text = (tmp_path / "out.csv").read_bytes().decode()
        assert text == (
            rows.to_csv(index=False, lineterminator="\n") if rows.size else "\n"
        )
    assert max(lengths) < 50_000 and sum(lengths) == numbers.size


def test_a_csv_has_a_row_for_each_point_or_record_in_the_units_that_are_chosen(
    tmp_path,
):
    path = tmp_path / "out.csv"
    units = {"contact_radius": ("mm", 1e3), "friction_force": ("mN", 1e3)}
    speeds, steady = {"drive.speed": [1e-3, 1e-2]}, drive.Steady(speed=1e-2)
    two = Ensemble(members=2)
    steadily = run(scene(drive=steady, sweep=speeds, ensemble=two))
    pulled = Equilibrium(load={"from": 4e-3, "to": 1e-3})
    changing = run(scene(drive=steady, sweep=speeds, ensemble=two, contact=pulled))
    for dataset, times in ((steadily, 1), (changing, changing.sizes["t"])):
        one = read.Run(dataset)
        with in_units(["mm/s", "mm", "mN", "mJ/m^2"]):
            read.to_csv(one, path)
        rows, long = pd.read_csv(path), read.long(one)
        long = long[long["t"].notna() == (times > 1)]
        assert_allclose(np.unique(rows["drive_speed [mm/s]"]), [1.0, 10.0], rtol=1e-15)
        assert len(rows) == 2 * times and ("t [s]" in rows) == (times > 1)
        for (name, (unit, factor)), kind in itertools.product(
            units.items(), ("mean", "error")
        ):
            column = f"{name}{f'_{kind}' * (kind != 'mean')} [{unit}]"
            assert_allclose(
                rows[column],
                factor * long.loc[long["quantity"] == name, kind],
                rtol=1e-15,
                atol=0,
            )
    read.to_csv(read.Run(run(scene(shear=shear.Uniform()))), path)
    # of one run without noise: no errors
    rows = pd.read_csv(path)
    assert "speed_at_5_percent_lost [m/s]" in rows
    assert not any("_error" in name for name in rows)
    with pytest.raises(BadInput, match=r"--units: .*kg"), in_units(["mm/s", "kg"]):
        assert {"drive_speed (mm/s)", "F (mN)"} < set(rows_of(steadily)[0])


def test_tables_leave_out_what_tells_nothing_and_say_how_steady_quantities_are_spread():
    dataset = run(scene(bonds=bonds.Unbroken(), shear=shear.Uniform()))
    rows = rows_of(dataset, rows=5)
    assert len(rows) == 5 and rows_of(dataset, read.highlights) == []
    assert list(rows[0]) == [
        "t (ms)",
        "V (mm/s)",
        "w (mJ/m²)",
        "a (µm)",
        "A/A_JKR (%)",
    ]
    cycle = Equilibrium(
        indentation={"from": 1e-6, "to": -2e-6, "cycles": 1}, after_pull_off="reattach"
    )
    still = {
        "bonds": bonds.Unbroken(),
        "shear": shear.Uniform(),
        "drive": drive.Steady(speed=0.0),
    }
    rows = rows_of(run(scene(contact=cycle, **still)), rows=5)
    assert [row["Δ (µm)"] for row in rows] == ["1", "-0.5", "-2", "-0.5", "1"]
    assert {heading.partition(" (")[0] for heading in rows[0]} >= {
        "t",
        "P",
        "W",
        "open",
    }
    pulled = Equilibrium(load={"from": 1e-3, "to": -1e-3})
    rows = rows_of(run(scene(contact=pulled, **still)), rows=3)
    # of the free sphere too
    assert [row["P (mN)"] for row in rows] == ["1", "0", "-1"]
    dataset = run(
        scene(
            drive=drive.Steady(speed=4e-3),
            clock=Clock(0.8, 2e-3),
            ensemble=Ensemble(members=20),
        )
    )
    result = {
        row["quantity"].partition(" (")[0]: row for row in rows_of(dataset, read.spread)
    }
    assert set(result) == {
        "ΔΓ",
        "w",
        "a",
        "A/A_JKR",
        "F",
        "t_c",
    }
    energy, law = result["ΔΓ"], read.distribution(dataset)
    assert list(energy) == [
        "quantity",
        "mean",
        "sd",
        "5 %",
        "50 %",
        "95 %",
        "free values",
    ]
    np.testing.assert_allclose(
        float(energy["sd"]), 1e3 * float(law["fluctuation_energy"].std), rtol=5e-3
    )
    free_values = float(law["fluctuation_energy"].number)
    np.testing.assert_allclose(float(energy["free values"]), free_values, rtol=5e-3)
    assert "(" in energy["mean"] and "(" in energy["95 %"]
    assert rows_of(lens.ramp(), read.spread) == []
    sweep = {"contact.load": [1e-3, 4e-3]}
    (low, high) = rows_of(run(scene(sweep=sweep)), read.losses)
    assert low["contact_load (mN)"] == "1" and high["contact_load (mN)"] == "4"
    slow, fast = (
        float(re.match(r"[\d.]+", row["5 % lost at V (mm/s)"])[0])
        for row in (low, high)
    )
    assert (
        slow < fast
        and rows_of(run(scene(drive=drive.Steady(speed=1e-3))), read.losses) == []
    )


@pytest.mark.parametrize("cycles", [0, 1])
def test_rows_of_the_whole_run_have_no_time_whether_or_not_a_loop_is_closed(cycles):
    course = Equilibrium(
        indentation={"from": 1e-6, "to": -2e-6, "cycles": cycles},
        after_pull_off="reattach",
    )
    quiet = {
        "bonds": bonds.Unbroken(),
        "shear": shear.Uniform(),
        "drive": drive.Steady(speed=0.0),
    }
    dataset = run(scene(contact=course, **quiet))
    rows = read.long(read.Run(dataset))
    of_run = rows["quantity"].isin([*read.Run(dataset).statements()])
    assert (
        ("loop_energy" in set(rows["quantity"])) == bool(cycles)
        and of_run.any()
        and not of_run.all()
    )
    assert rows["t"][of_run].isna().all() and rows["t"][~of_run].notna().all()


@posix
def test_csv_goes_through_a_link_to_where_it_points(ramp, tmp_path):
    (tmp_path / "out.csv").symlink_to(tmp_path / "far.csv")
    read.to_csv(read.Run(ramp), tmp_path / "out.csv")
    assert (tmp_path / "out.csv").is_symlink()
    assert (tmp_path / "far.csv").read_text(encoding="utf-8").startswith("t [s],")


def test_notes_say_what_is_averaged_how_many_rows_are_shown_and_what_symbols_mean(ramp):
    one = read.Run(ramp)
    notes = read.notes(one, [read.table(one)])
    assert notes.needed[0].startswith("mean over the 6 members; brackets: ")
    assert "12 of 21 rows shown" in notes.further[0] and "--where" in notes.further[0]
    assert any(line.startswith("A/A_JKR: contact area") for line in notes.headings)
    speeds = {"drive.speed": list(np.geomspace(1e-4, 1e-1, 16))}
    one = read.Run(run(scene(drive=drive.Steady(speed=1e-2), sweep=speeds)))
    table = read.table(one)
    notes = read.notes(one, [table])
    words = "mean over the second half of the run and 6 members"
    assert notes.needed[0].startswith(words)
    assert any(line.startswith("12 of 16 rows shown") for line in notes.further)
    assert [heading for heading in table.rows[0] if heading.endswith("(mm/s)")] == [
        "drive_speed (mm/s)"
    ]


def test_the_speed_of_a_slider_on_single_bonds_is_its_displacement_over_the_time_from_rest_on():
    rupture = Bell(zero_force_rate=5.0, bell_force=4e-12)
    numbers = {
        "bond_stiffness": 8e-7,
        "rebinding_rate": 50.0,
        "site_density": 6.5e16,
        "start_from": "bonded",
    }
    creeping = scene(
        clock=Clock(duration=0.4, step=0.002),
        shear=shear.Uniform(),
        bonds=bonds.Tracked(rupture, **numbers, sites=40),
        drive=drive.Force(force=4e-3, contact_stiffness="rigid"),
        adhesion=Adhesion(work=lens.WORK, bond_share=0.0),
    )
    dataset = run(creeping)
    position, time = (
        dataset["slider_position"].mean("member").to_numpy(),
        dataset["t"].to_numpy(),
    )
    shown = [float(re.match(r"[\d.]+", row["V (µm/s)"])[0]) for row in rows_of(dataset)]
    at = np.rint(np.linspace(0, 200, 12)).astype(int)[1:-1]
    speed = 1e6 * (position[at + 1] - position[at - 1]) / (2.0 * time[1])
    few = read.distribution(dataset.isel(t=[0, 100, 200]), ["speed"])["speed"].value
    np.testing.assert_allclose(
        few, (position[200] - position[100]) / (time[200] - time[100]), rtol=1e-9
    )
    # half of the last digit that an error of 10 leaves
    np.testing.assert_allclose(shown[1:-1], speed, atol=5.0)
    ends = with_slips(dataset.isel(t=[0, -1]))["speed"]
    assert_array_equal(ends[:, 0], 0.0)
    assert_allclose(
        ends[:, 1], dataset["slider_position"][:, -1] / time[-1], rtol=1e-12
    )


def test_a_missing_number_has_the_reason_of_the_registry_at_the_first_of_its_points():
    loads = {"contact.load": ["1 mN", "2 mN", "4 mN"]}
    quiet = {"drive": drive.Steady(speed=1e-3), "ensemble": Ensemble(members=4)}
    one = read.Run(run(scene(**quiet, sweep=loads)))
    # in one of three loads two members of four are masked
    times = one.dataset["first_masked"].copy(deep=True)
    times[...] = math.nan
    times[{"contact_load": 1, "member": slice(2)}] = 0.1
    one.dataset["first_masked"] = times
    table = read.highlights(one)
    shown = [row["half masked (ms)"] for row in table.rows]
    assert shown == ["–*", "100 (> 100)", "–*"]
    words = "fewer than half of the members were masked"
    line = f"* half masked: {words} (at contact_load = 1 mN, and 1 more point)"
    assert line in read.notes(one, [table]).needed
    frame = sim.stats(one.dataset)
    assert_array_equal(frame["half_masked_reason"], [words, "", words])


def test_the_unit_of_a_column_is_that_of_its_values_and_not_of_their_roundings():
    values = np.array([0.0, 4.1e-3, -2e-2, 4e-22, math.nan])
    unit, cells = tables._column_of("N", values)
    assert (unit, cells) == ("mN", ["0", "4.1", "-20", "0", "–"])
    # a wide column of true values keeps them all
    assert tables._column_of("N", np.array([1e-9, 1e-3]))[1] == ["0.001", "1000"]
    # in a unit of the largest value, if the least is next to nothing
    assert tables._column_of("N", np.array([1e-14, 2e-2]))[0] == "µN"
    zero = np.array([1e-2, 0.0]), (np.array([0.0, 1e-19]), np.nan, np.nan, 0.0)
    assert tables._column_of("N", *zero)[1] == ["10", "0"]


def test_a_stress_of_finite_strains_is_noted_where_friction_builds_up_alone():
    """Aged bonds bear 0.79 MPa before the slider moves, of which steady sliding leaves a tenth."""
    static = sim.load(Path(__file__).parents[2] / "scenarios/static_peak.toml")
    values = {"sweep": {}, "drive.rest": "4 s", "clock.duration": "4.4 s"}

    def noted(**keys):
        stated = sim.Run(sim.run(static.with_values(values | keys)))
        strains = [text for text in tables.notes(stated, []).needed if "strain" in text]
        return stated.dataset, strains

    dataset, strains = noted(**{"drive.speed": "10 um/s"})
    ratio = float(dataset["shear_stress"].max()) / 1.6e6
    assert ratio > 0.4 and len(strains) == 1
    assert f"reaches {ratio:.2g} times the shear modulus" in strains[0]
    assert "(at " not in strains[0]
    assert noted(**{"drive.speed": "30 nm/s"})[1] == []
    stiff = noted(**{"drive.speed": "10 um/s", "solid": {"youngs_modulus": "48 MPa"}})
    assert stiff[1] == [] and float(stiff[0]["shear_stress"].max()) > 0.1 * 1.6e6
    swept = {"drive.speed": "10 um/s", "sweep": {"drive.rest": ["1 s", "4 s"]}}
    assert "(at drive_rest = 4 s)" in noted(**swept)[1][0]
    # of two bodies it is the softer one that is strained most, and by less than both together
    bodies = {"shear_modulus": "9 MPa", "counter_body": {"shear_modulus": "1.6 MPa"}}
    dataset, strains = noted(**{"drive.speed": "10 um/s", "solid": bodies})
    ratio = float(dataset["shear_stress"].max()) / 1.6e6
    assert f"reaches {ratio:.2g} times the shear modulus" in strains[0]


def test_a_quantity_that_exists_without_a_mean_keeps_its_column_with_the_reason():
    """Sliding that has not settled yet has a kinetic friction, whose mean is not known; a slip event never came."""
    scenario = {
        "clock": {"duration": "1 s", "step": "2 ms"},
        "solid": {"shear_modulus": "1.6 MPa"},
        "sphere": {"radius": "2 mm"},
        "adhesion": {"work": "42 mJ/m^2"},
        "contact": {"load": "4 mN"},
        "drive": {
            "model": "spring",
            "stage": "0.4 mm/s",
            "stiffness": "300 N/m",
            "damping": "10 mN s/m",
        },
        "bonds": {
            "model": "cohort",
            "start": "empty",
            "rupture": {
                "model": "bell",
                "zero_force_rate": "1 1/s",
                "bell_force": "4 pN",
            },
            "bond_stiffness": "0.8 uN/m",
            "rebinding_rate": "5 1/s",
            "site_density": "6.5e16 1/m^2",
        },
    }
    run = sim.Run(sim.run(scenario))
    assert run.events["kinetic_friction"].reason == "not settled"
    printed = tables.tables_of(run)
    names = [column.name for one in printed for column in one.columns]
    assert "kinetic_friction" in names and "static_friction" not in names
    reasons = [reason for one in printed for reason in one.reasons]
    assert [
        reason.text for reason in reasons if reason.heading == "kinetic friction"
    ] == ["not settled"]
