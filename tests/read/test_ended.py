"""Statements on motions that end before the run: no event and no share after the end, and the number of members."""

import functools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from helpers.driven import LOAD, UNIT, force, scenario
from helpers.parts import Record, bonds, read, run, shear
from numpy.testing import assert_allclose, assert_array_equal

from sim.parts.drive import Steady
from sim.plots import curves
from sim.read import tables
from sim.read.observables import with_slips
from sim.read.statistics import interval
from sim.spectrum.families import Ripple

#: Members of a run and its length [s], and forces over that at the unit of stretch from which some members lose
#: stability in it, and all of them in its first half.
MEMBERS, LASTS, SOME, ABOVE = 6, 8.0, 0.08, 0.5
#: A load that draws the sphere off after all motions have ended, and one that does so at once.
LATE = {"time": [0.0, 0.5 * LASTS, LASTS], "value": [LOAD, LOAD, -LOAD]}
EARLY = {"time": [0.0, 0.04, LASTS], "value": [LOAD, -2.0 * LOAD, -2.0 * LOAD]}
#: Fluctuations that leave no work of adhesion at any time.
STRONG = shear.Mean(spectrum=Ripple(amplitude=1e7, wavelength=24e-6))


def creeping(factor, per_member=True, **keys):
    """Few bonds, followed one by one, that carry the work of adhesion under a constant force."""
    make = functools.partial(bonds.Tracked, sites=10)
    options = {"share": 1.0, "members": MEMBERS, "make": make}
    scene = scenario(LASTS, 400, force(factor), **(options | keys))
    return replace(scene, record=Record(per_member=per_member))


@pytest.fixture(scope="module")
def ended():
    """A run in which every member loses stability, before its mount moves."""
    dataset = run(creeping(ABOVE, load=LATE))
    assert float(dataset["runaway_time"].isel(t=-1).max()) < 0.5 * LASTS
    return dataset


def test_no_event_of_the_contact_is_set_after_the_end_of_a_motion_and_each_is_that_comes_before(
    ended,
):
    # the breaking bonds leave no work of adhesion, and the mount then draws the sphere away
    for name in ("first_masked", "first_detachment", "pull_off_time", "lowest_load"):
        assert ended[name].isnull().all(), name
    assert_array_equal(ended["time_masked"], 0.0)
    assert_array_equal(ended["detachments"], 0.0)
    assert_array_equal(ended["in_contact"], 1)
    gone = ended["t"] >= ended["runaway_time"].isel(t=-1)
    assert_array_equal(ended["masked"].isnull(), gone.transpose(*ended["masked"].dims))
    opened = run(creeping(ABOVE, load=EARLY))
    assert_array_equal(opened["detachments"], 1.0)
    assert (opened["lowest_load"] < 0.0).all()
    masked = run(replace(creeping(ABOVE), shear=STRONG))
    assert_array_equal(masked["first_masked"], 0.0)
    assert_array_equal(masked["time_masked"], 1.0)
    assert np.isfinite(masked["runaway_time"].isel(t=-1)).all()


@pytest.fixture(scope="module")
def swept():
    """Runs at forces from which none, some and all of the members run away: of each member, and of statistics."""
    scene, at = creeping(ABOVE), [1e-3 * UNIT, SOME * UNIT, ABOVE * UNIT]
    scene = replace(scene, sweep={"drive.force": at})
    return run(scene), run(replace(scene, record=Record(per_member=False)))


def test_the_share_of_members_that_lost_stability_is_the_same_of_recorded_statistics(
    swept,
):
    each, pooled = (read.Run(dataset).events for dataset in swept)
    gone = swept[0]["runaway_time"].isel(t=-1).notnull().sum("member")
    none, some, all_of_them = gone.values
    assert none == 0 and 0 < some < MEMBERS and all_of_them == MEMBERS
    for name in ("ran_away", "runaway_after", "static_friction"):
        for field in ("value", "sem", "low", "high"):
            of_each, of_pooled = (getattr(one[name], field) for one in (each, pooled))
            assert_allclose(of_pooled, of_each, rtol=1e-9, atol=1e-30, err_msg=name)
        if name != "ran_away":
            assert_array_equal(pooled[name].reason, each[name].reason)
            assert [bool(text) for text in each[name].reason.values] == [1, 1, 0]
    assert_allclose(pooled["ran_away"].value, gone / MEMBERS, rtol=1e-14)
    for dataset in swept:
        notes = read.notes(read.Run(dataset), read.tables_of(read.Run(dataset))).needed
        lines = [line for line in notes if "lost stability" in line and " of " in line]
        assert any(line.startswith(f"{int(gone.sum())} of 18 ") for line in lines)


@pytest.mark.parametrize("name", ["ran_away", "ever_masked", "time_masked"])
def test_no_end_of_the_interval_of_a_share_is_below_none_or_above_all(name):
    means, errors = np.array([0.0, 0.05, 0.95, 1.0]), np.array([0.0, 0.2, 0.2, 0.0])
    low, high = interval(name, means, errors, 3)
    assert np.all((low >= 0.0) & (low <= means) & (means <= high) & (high <= 1.0))


def test_every_missing_cell_has_a_star_and_a_reason_after_the_end_of_a_motion(swept):
    run_of_each = read.Run(swept[0])
    shown = read.tables_of(run_of_each, show=["all"])
    missing = 0
    for table in shown:
        for row in table.rows:
            assert "–" not in row.values()
            missing += sum(cell == "–*" for cell in row.values())
        headings = {reason.heading for reason in table.reasons}
        for name in (each for row in table.rows for each in row if row[each] == "–*"):
            assert name.rpartition(" (")[0] in headings or name in headings
    assert missing
    assert "V" in {reason.heading for reason in shown[0].reasons}


def test_every_column_that_may_miss_a_value_has_a_reason_in_the_registry():
    # a share of all members and a time that states its own reason are never missing without one
    known = {"ever_masked", "ever_detached", "ran_away", "correlation_time"}
    columns = (*tables.MAIN, *tables.LOSSES, *tables.EVENTS, *tables.SLIPS)
    for column in (*columns, *tables.PHASES):
        assert column.definition.absent or column.name in known, column.name


def test_a_note_has_the_numbers_of_each_column_that_it_names():
    reasons = (
        tables.Reason("N/N0", "not settled: 0.76 → 0.72", "F = 9 mN"),
        tables.Reason("A/A_JKR", "not settled: 0.95 → 0.94", "F = 9 mN"),
        tables.Reason("w", "the contact is open", "F = 12 mN"),
        tables.Reason("a", "the contact is open", "F = 12 mN"),
        tables.Reason("a", "the contact is open", "F = 16 mN"),
        tables.Reason("F", "the contact is open", "F = 12 mN"),
    )
    dataset = run(scenario(1.0, 4, force(1e-3), members=1))
    shown = tables.Table([{"a": "–*"}], reasons=reasons)
    lines = read.notes(read.Run(dataset), [shown]).needed
    assert [line for line in lines if line.startswith("*")] == [
        "* N/N0: not settled: 0.76 → 0.72 (at F = 9 mN)",
        "* A/A_JKR: not settled: 0.95 → 0.94 (at F = 9 mN)",
        "* w, F: the contact is open (at F = 12 mN)",
        "* a: the contact is open (at F = 12 mN, and 1 more point)",
    ]


@pytest.mark.parametrize(
    ("cell", "ends", "others"),
    [("772 (> 400)", 1, 0), ("17 (<60)", 0, 1), ("1.5(2)", 0, 0), ("100 (>61)", 0, 1)],
)
def test_each_kind_of_bracket_is_explained_if_it_is_printed(cell, ends, others):
    dataset = run(scenario(1.0, 4, force(1e-3), members=1))
    shown = tables.Table([{"value": cell}])
    text = "; ".join(read.notes(read.Run(dataset), [shown]).needed)
    assert text.count("the only end of the 95 %") == ends
    assert text.count("near 0 and 100 %") == others


def sentences(dataset, *shown):
    """Notes on the sample of some tables of a run."""
    run_of_it = read.Run(dataset)
    return [
        line
        for line in read.notes(run_of_it, [make(run_of_it) for make in shown]).needed
        if "members" in line
    ]


def test_a_mean_over_fewer_members_names_their_number_in_tables_and_csv_files(
    swept, tmp_path
):
    each, pooled = swept
    whole = each.isel(drive_force=[0])
    assert not any(
        "have a value" in line for line in sentences(whole, read.table, read.highlights)
    )
    some = each.isel(drive_force=[1])
    left = int(some["slider_position"].isel(t=-1).notnull().sum())
    lines = sentences(some, read.table)
    assert "or those of them" in lines[0]
    (line,) = (line for line in lines if line.startswith(f"of the {MEMBERS} members"))
    assert f" {left} have a value of V, " in line
    assert any("or those of them" in line for line in sentences(pooled, read.table))
    read.to_long_csv(read.Run(some), tmp_path / "long.csv")
    rows = pd.read_csv(tmp_path / "long.csv")
    speeds = rows[rows["quantity"] == "speed"]
    assert speeds["over"].iloc[0] == f"{MEMBERS} members"
    assert f"{left} of the {MEMBERS} members" in speeds["over"].iloc[-1]


def test_the_number_of_members_of_an_event_is_that_of_those_that_had_it():
    early = {"time": [0.0, LASTS], "value": [LOAD, -0.9 * LOAD]}
    scene = replace(creeping(1e-3, load=early), drive=Steady(speed=1e-9))
    for per_member in (True, False):
        dataset = run(replace(scene, record=Record(per_member=per_member)))
        one = read.Run(dataset).events["pull_off_load"]
        count = int(one.members)
        assert 0 < count < MEMBERS
        lines = sentences(dataset, read.highlights)
        assert any(f" {count} have a value of pull-off load" in line for line in lines)


def test_the_mean_of_a_figure_over_time_ends_with_the_first_motion_that_ends(swept):
    for dataset in swept:
        some = dataset.isel(drive_force=[1])
        first = float(swept[0].isel(drive_force=1)["runaway_time"].isel(t=-1).min())
        scene = curves.scene_along(some, "t")
        assert "until the first of them ends" in scene.averaged
        position = scene.values("slider_position", scene.lines[0])
        assert_array_equal(np.isfinite(position), some["t"] < first)
        calm = curves.scene_along(dataset.isel(drive_force=[0]), "t")
        assert "ends" not in calm.averaged
        assert np.isfinite(calm.values("slider_position", calm.lines[0])).all()
        over = curves.scene_along(dataset, "drive_force")
        assert "those of them that have a value" in over.averaged


def test_the_speed_of_recorded_statistics_is_that_of_the_same_members_and_has_no_spread(
    swept,
):
    each, pooled = (with_slips(dataset) for dataset in swept)
    alive = each["slider_position"].notnull().all("member")
    mean, spread, error = pooled["speed"].transpose("statistic", ...)
    assert not alive.all() and alive.any()
    # a mean over the members that are left would go back
    later = each["t"] > each["t"][0]
    exact = each["speed"].mean("member").where(alive)
    assert_array_equal(mean.isnull(), exact.isnull())
    # at the last record the mean position has a difference to one side alone
    inside = later & (alive.shift(t=-1, fill_value=False) | alive.all("t"))
    assert_allclose(mean.where(inside), exact.where(inside), rtol=1e-9, atol=1e-15)
    assert spread.isnull().all() and error.isnull().all()
    # each motion has a speed to its last record
    assert_array_equal(each["speed"].isnull(), each["slider_position"].isnull())
