"""Rows for the terminal and the CSV: what tells something, and nothing else."""

import csv
import itertools
import re

import numpy as np
import pytest
from helpers import lens
from helpers.lens import scene

import sim
from sim import analysis
from sim.ensemble.simulate import run
from sim.parts.bonds import models as bonds
from sim.parts.contact import Equilibrium
from sim.parts.drive import prescribed as drive
from sim.parts.shear import models as shear
from sim.scenario.clock import Record
from sim.units.quantity import Quantity
from sim.units.table import columns


@pytest.fixture(scope="module", name="ramp")
def _ramp():
    return lens.ramp()


def test_table_of_a_ramp_has_a_dozen_rows_from_start_to_end(ramp):
    rows, found = analysis.table(ramp), analysis.statistics(ramp)
    assert len(rows) == 12 and all(set(row) == set(rows[0]) for row in rows)
    assert [rows[0]["t\n(ms)"], rows[-1]["t\n(ms)"]] == ["0", "400"]
    for row, at in ((rows[0], 0), (rows[-1], -1)):
        mean = float(re.match(r"[\d.]+", row["a\n(µm)"])[0])
        # half a unit of the fourth digit, the least that is shown
        np.testing.assert_allclose(mean, 1e6 * float(found["contact_radius_mean"][at]), rtol=5e-4)
    assert "masked\n(%)" in rows[0] and "open\n(%)" not in rows[0]
    assert "lost to\nbonds (%)" in rows[0] and "lost to\nfluct. (%)" in rows[0]


def test_table_leaves_out_what_tells_nothing():
    rows = analysis.table(run(scene(bonds=bonds.Unbroken(), shear=shear.Uniform())), rows=5)
    assert len(rows) == 5
    assert list(rows[0]) == ["t\n(ms)", "V\n(mm/s)", "w\n(mJ/m²)", "a\n(µm)", "A/A_JKR\n(%)"]


@pytest.mark.parametrize("per_member", [True, False])
def test_a_reduced_dataset_has_the_columns_that_it_can(per_member):
    kept = ("fluctuation_energy", "speed")
    whole, some = (
        run(scene(drive=drive.Steady(speed=1e-2), record=Record(per_member=per_member, quantities=quantities)))
        for quantities in (None, kept)
    )
    rows = analysis.table(some)
    assert "A/A_JKR\n(%)" not in rows[0] and {"a\n(µm)", "ΔΓ\n(mJ/m²)"} < set(rows[0])
    for full, row in zip(analysis.table(whole), rows, strict=True):
        assert row.items() <= full.items()
    alone = run(scene(record=Record(per_member=per_member, quantities=())))
    assert [set(row) for row in analysis.table(alone)] == 12 * [{"t\n(ms)", "a\n(µm)"}]
    assert analysis.highlights(alone) == [] and "contact_radius_mean" in sim.stats(alone)


@pytest.mark.parametrize(("loads", "shares", "rows"), [(2, 1, 2), (5, 1, 5), (30, 1, 12), (3, 2, 6), (6, 5, 12)])
def test_table_of_a_steady_sweep_has_a_row_for_each_point(loads, shares, rows):
    sweep = {
        "contact.load": list(np.linspace(1e-3, 9e-3, loads)),
        "adhesion.bond_share": list(np.linspace(0, 1, shares)),
    }
    dataset = run(scene(drive=drive.Steady(speed=1e-2), shear=shear.Uniform(), sweep=sweep))
    table = analysis.table(dataset)
    assert len(table) == rows
    assert [row["contact_load\n(mN)"] for row in (table[0], table[-1])] == ["1", "9"]
    assert not any(heading.startswith("t\n") for heading in table[0])


def test_table_of_a_swept_ramp_shows_each_point_in_time():
    rows = analysis.table(run(scene(sweep={"contact.load": ["1 mN", "4 mN"]}, shear=shear.Uniform())))
    points = [(row["contact_load\n(mN)"], row["t\n(ms)"]) for row in rows]
    assert points == list(itertools.product(["1", "4"], ["0", "80", "160", "240", "320", "400"]))


def test_table_tells_a_swept_table_by_its_name():
    ripple = {"model": "ripple", "amplitude": 1e5, "wavelength": 24e-6}
    fields = {"shear": [{"model": "uniform"}, {"model": "mean", "spectrum": ripple}]}
    rows = analysis.table(run(scene(drive=drive.Steady(speed=1e-2), sweep=fields)))
    assert [row["shear"] for row in rows] == ["uniform", "mean"]


def test_csv_reads_back_as_the_statistics(ramp, tmp_path):
    analysis.to_csv(ramp, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    wanted = {
        "t": Quantity("s", "time"),
        "contact_radius_mean": Quantity("m", "radius"),
        "contact_radius_sem": Quantity("m", "its error"),
        "contact_radius_q95": Quantity("m", "95 % quantile"),
        "lost_to_fluctuations_mean": Quantity("1", "share"),
    }
    read, found = columns(text, wanted), analysis.statistics(ramp)
    np.testing.assert_array_equal(read["t"], ramp["t"])
    np.testing.assert_array_equal(read["contact_radius_mean"], found["contact_radius_mean"])
    np.testing.assert_array_equal(read["contact_radius_sem"], found["contact_radius_sem"])
    np.testing.assert_array_equal(read["contact_radius_q95"], found["contact_radius_quantile"].sel(quantile=0.95))
    np.testing.assert_array_equal(read["lost_to_fluctuations_mean"], analysis.shares(ramp)["lost_to_fluctuations_mean"])
    rows = list(csv.reader(text.splitlines()))  # the header is first, and every row is as long
    assert rows[0][0] == "t [s]" and {len(row) for row in rows} == {len(rows[0])} and len(rows) == 22


def test_csv_has_a_row_for_each_point_and_time(tmp_path):
    sweep = {"contact.load": [1e-3, 4e-3], "adhesion.bond_share": [0.0, 0.5, 1.0]}
    dataset = run(scene(sweep=sweep, shear=shear.Uniform()))
    analysis.to_csv(dataset, tmp_path / "out.csv")
    text = (tmp_path / "out.csv").read_text(encoding="utf-8")
    wanted = {
        "contact_load": Quantity("N", "load"),
        "adhesion_bond_share": Quantity("1", "share"),
        "t": Quantity("s", "time"),
    }
    read = columns(text, {**wanted, "contact_area_mean": Quantity("m^2", "area")})
    expected = itertools.product([1e-3, 4e-3], [0.0, 0.5, 1.0], dataset["t"].to_numpy())
    assert list(zip(*(read[name].tolist() for name in wanted), strict=True)) == list(expected)
    np.testing.assert_array_equal(read["contact_area_mean"], dataset["contact_area"].to_numpy().ravel())


def test_table_of_a_cycle_tells_what_holds_the_sphere():
    cycle = Equilibrium(indentation={"from": 1e-6, "to": -2e-6, "cycles": 1}, after_pull_off="reattach")
    still = {"bonds": bonds.Unbroken(), "shear": shear.Uniform(), "drive": drive.Steady(speed=0.0)}
    rows = analysis.table(run(scene(contact=cycle, **still)), rows=5)
    assert [row["Δ\n(µm)"] for row in rows] == ["1", "-0.5", "-2", "-0.5", "1"]
    assert {heading.partition("\n")[0] for heading in rows[0]} >= {"t", "P", "W", "open"}
    pulled = Equilibrium(load={"from": 1e-3, "to": -1e-3})
    rows = analysis.table(run(scene(contact=pulled, **still)), rows=3)
    assert [row["P\n(mN)"] for row in rows] == ["1", "0", "-1"]  # of the free sphere too


def test_table_of_a_swept_course_at_one_speed_shows_it_in_time():
    cycle = Equilibrium(load={"from": 4e-3, "to": 1e-3})
    dataset = run(scene(contact=cycle, drive=drive.Steady(speed=1e-3), sweep={"contact.load.to": [1e-3, 2e-3]}))
    assert [row["t\n(ms)"] for row in analysis.table(dataset, rows=6)] == ["0", "200", "400"] * 2


def test_highlights_tell_nothing_where_there_is_nothing():
    dataset = run(scene(bonds=bonds.Unbroken(), shear=shear.Uniform()))
    assert analysis.highlights(dataset) == []


def test_csv_holds_what_is_told_once_of_a_run(ramp, tmp_path):
    analysis.to_csv(ramp, tmp_path / "out.csv")
    wanted = {"time_masked_mean": Quantity("1", "share"), "total_dissipated_q95": Quantity("J", "energy")}
    read = columns((tmp_path / "out.csv").read_text(encoding="utf-8"), wanted)
    np.testing.assert_array_equal(read["time_masked_mean"], np.full(21, analysis.statistics(ramp)["time_masked_mean"]))
    np.testing.assert_array_equal(read["total_dissipated_q95"], 0.0)


def test_csv_in_trouble_leaves_an_older_file_as_it_was(ramp, tmp_path, monkeypatch):
    path = tmp_path / "out.csv"
    path.write_text("older")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(OSError, match="No space"):
        analysis.to_csv(ramp, path)
    assert path.read_text() == "older" and [item.name for item in tmp_path.iterdir()] == ["out.csv"]


def test_csv_goes_through_a_link_to_where_it_points(ramp, tmp_path):
    (tmp_path / "far.csv").write_text("older")
    (tmp_path / "out.csv").symlink_to(tmp_path / "far.csv")
    analysis.to_csv(ramp, tmp_path / "out.csv")
    assert (tmp_path / "out.csv").is_symlink() and (tmp_path / "far.csv").read_text().startswith("t [s],")


def test_notes_say_what_is_averaged_how_many_rows_are_shown_and_what_symbols_mean(ramp):
    rows = analysis.table(ramp)
    said = analysis.notes(ramp, rows, analysis.highlights(ramp))
    assert said[0] == "mean over the 6 members; in brackets the standard error in the last digits"
    assert said[1].startswith("12 of 21 rows shown") and "--where" in said[1] and "A/A_JKR: " in said[2]
    whole = analysis.table(ramp, rows=10**9)
    assert len(whole) == 21 and not any("shown" in line for line in analysis.notes(ramp, whole, []))


def test_steady_sweeps_say_that_the_second_half_counts_and_show_their_speed_once():
    dataset = run(scene(drive=drive.Steady(speed=1e-2), sweep={"drive.speed": list(np.geomspace(1e-4, 1e-1, 16))}))
    rows = analysis.table(dataset)
    assert analysis.notes(dataset, rows, [])[0].startswith("mean over the second half of the run and 6 members")
    assert analysis.notes(dataset, rows, [])[1].startswith("12 of 16 rows shown")
    assert [heading for heading in rows[0] if heading.endswith("(mm/s)")] == ["drive_speed\n(mm/s)"]


def test_a_value_of_a_swept_key_is_chosen_by_its_text_and_refused_with_what_there_is():
    sweep = {"contact.load": ["1 mN", "4 mN"], "bonds": [{"model": "none"}, {"model": "none", "stress": 3e5}]}
    dataset = run(scene(drive=drive.Steady(speed=1e-2), shear=shear.Uniform(), sweep=sweep))
    for key in ("load", "contact.load"):
        found = analysis.where(dataset, {key: "4 mN", "bonds": "none 2"})
        assert found.sizes["contact_load"] == found.sizes["bonds"] == 1 and float(found["contact_load"][0]) == 4e-3
    for chosen, words in (
        ({"load": "2 mN"}, "no value 2 mN; there are: 1 mN, 4 mN"),
        ({"load": "2 mm"}, "unit"),
        ({"radius": "2 mm"}, "not swept; swept: contact_load, bonds"),
        ({"bonds": "rate"}, "no value rate; there are: none"),
    ):
        with pytest.raises(ValueError, match=words):
            analysis.where(dataset, chosen)
