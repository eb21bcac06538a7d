"""CSV tables: units in the header, and one clear error for each way to get them wrong."""

import os
from typing import Annotated

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from sim.units import table
from sim.units.quantity import Quantity
from sim.units.table import TableError, at_once, columns, file_path, file_text, matrix

TIME = Quantity("s", "time", at_least=0)
SPEED = Quantity("m/s", "speed")
WANTED = {"time": TIME, "speed": SPEED}


def test_columns_come_in_si_units_whatever_the_header_says():
    table = columns("time [ms], speed [mm/s]\n0, 1\n250, -2.5e3\n", WANTED)
    assert table["time"].tolist() == [0.0, 0.25]
    assert table["speed"].tolist() == [0.001, -2.5]


def test_a_cell_is_rounded_as_the_same_quantity_in_a_scenario():
    text = "time [ms]\n" + "\n".join(str(n) for n in range(1100))
    assert columns(text, {"time": TIME})["time"].tolist() == [TIME.read(f"{n} ms") for n in range(1100)]


def test_a_column_without_brackets_is_si_already():
    assert columns("time,speed\n1,2", WANTED)["speed"].tolist() == [2.0]


@pytest.mark.parametrize("header", ["share", "share [1]", "share []", "share [-]", "share [ 1 ]"])
def test_a_pure_number_needs_no_unit(header):
    assert columns(f"{header}\n0.5", {"share": Quantity("1", "share")})["share"].tolist() == [0.5]


def test_percent_is_a_unit_of_a_pure_number():
    assert columns("share [percent]\n50", {"share": Quantity("1", "share")})["share"].tolist() == [0.5]


def test_comments_blank_lines_other_columns_order_and_a_byte_order_mark_do_not_matter():
    text = "\ufeff# recorded on Monday\n\nspeed [m/s], remark, time [s]\n# rising\n3, fast, 1\r\n\n4, faster, 2\n"
    table = columns(text, WANTED)
    assert table["time"].tolist() == [1.0, 2.0]
    assert table["speed"].tolist() == [3.0, 4.0]


@pytest.mark.parametrize("sign", [", ", ";", "; ", "\t", " \t "])
def test_commas_semicolons_or_tabs_stand_between_cells(sign):
    text = f"speed [mm/s]{sign}remark{sign}time [s]\n1{sign}a b{sign}2\n3{sign}c{sign}4\n"
    found = columns(text, WANTED)
    assert found["time"].tolist() == [2.0, 4.0]
    assert found["speed"].tolist() == [0.001, 0.003]
    assert matrix(f"# Pa\n1{sign}2\n3{sign}4\n", SPEED).tolist() == [[1.0, 2.0], [3.0, 4.0]]


@pytest.mark.parametrize("sign", [" ", "\t", ";", ","])
def test_numbers_without_a_header_are_read_by_one_that_is_given(sign):
    text = f"# of an instrument\n0{sign}1\n\n250{sign}-2.5e3"
    found = columns(text, WANTED, "time [ms], speed [mm/s]")
    assert found["time"].tolist() == [0.0, 0.25]
    assert found["speed"].tolist() == [0.001, -2.5]


@pytest.mark.parametrize(
    ("text", "header", "words"),
    [
        ("1 2\n3 4", "", r'line 1: the columns have no header; .* header = "time \[s\], speed \[m/s\]"'),
        ("1 2\n3 4", "time [s], sped", 'header: column "speed" is missing'),
        ("1 2\n3 4", "time [s], speed [m]", 'header: column "speed" has a unit that is not'),
        ("1 2\n3 4", "time, speed, other", "line 1: 2 cells where the header has 3"),
        ("1 2\n3 4 5", "time, speed", "line 2: 3 cells where the header has 2"),
        ("time, speed\n3, 4", "time, speed", "line 1: the columns have a header of their own; leave the key header"),
    ],
)
def test_a_header_that_does_not_fit_its_columns_is_refused(text, header, words):
    with pytest.raises(TableError, match=words):
        columns(text, WANTED, header)


@pytest.mark.parametrize("unit", ["1/um", "um^-1", "1 / um", "um**-1"])
def test_a_wavenumber_that_may_count_radians_or_cycles_is_refused_with_both_spellings(unit):
    wavenumber = Quantity("rad/m", "wavenumber")
    with pytest.raises(TableError, match=r'"rad/um" where .* "cycles/um" where'):
        columns(f"q [{unit}]\n1", {"q": wavenumber})
    with pytest.raises(ValueError, match=r'"rad/um" where .* "cycles/um" where'):
        wavenumber.read(f"2 {unit}")


@pytest.mark.parametrize(
    ("unit", "factor"), [("rad/um", 1e6), ("cycles/um", 2e6 * np.pi), ("cycle um^-1", 2e6 * np.pi)]
)
def test_a_wavenumber_counts_what_its_unit_says(unit, factor):
    found = columns(f"q [{unit}]\n2", {"q": Quantity("rad/m", "wavenumber")})
    np.testing.assert_allclose(found["q"], 2.0 * factor, rtol=1e-15)


def test_quoted_cells_are_read():
    assert columns('"time [s]","speed [m/s]"\n"1","2"', WANTED)["time"].tolist() == [1.0]


def test_units_of_more_than_one_word_are_read():
    density = {"C": Quantity("Pa^2 m^2", "density")}
    assert columns("C [kPa^2 um^2]\n2", density)["C"].tolist() == [2e6 * 1e-12]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", r'the table is empty; begin with a header such as "time \[s\], speed \[m/s\]"'),
        ("# only this\n\n", "the table is empty"),
        ("time [s], speed [m/s]\n", "line 1: no rows follow the header"),
        ("time [s], sped [m/s]\n1,2", r'line 1: column "speed" is missing; write the header'),
        ("time [s] speed [m/s]\n1 2", 'line 1: a header cell cannot be read; write the header as "time'),
        ("time [s]; speed [m/s]\n1,5;2", "line 2: time is not a number; .* decimals with a point"),
        ("time [s]\tspeed [m/s]\n1,2", "line 2: 1 cells where the header has 2"),
        ("1, 2\n3, 4", 'line 1: column "time" is missing'),
        ("time [s], time [ms], speed [m/s]\n1,2,3", 'column "time" is there twice'),
        ("#\ntime [s], speed [m]\n1,2", r'line 2: column "speed" has a unit that is not a unit of m/s; .*\['),
        ("time [s], speed [furlongs/blink]\n1,2", "not a unit of m/s"),
        ("time [s], speed [1]\n1,2", "not a unit of m/s"),
        ("time [s], speed []\n1,2", "not a unit of m/s"),
        ("time [s], speed [m/s\n1,2", "header cell cannot be read"),
        ("time [s], speed [m/s]\n1,2\n3", "line 3: 1 cells where the header has 2"),
        ("time [s], speed [m/s]\n1,2,3", "line 2: 3 cells where the header has 2; .* decimals with a point"),
        ("time [s], speed [m/s]\n1,2\n\n3,fast", "line 4: speed is not a number; write a plain number"),
        ("time [s], speed [m/s]\n1,", "line 2: speed is an empty cell"),
        ("time [s], speed [m/s]\n1,nan", "line 2: speed is nan"),
        ("time [s], speed [m/s]\n1,-inf", "line 2: speed must be finite"),
        ("time [s], speed [m/s]\n1,1e999", "line 2: speed must be finite"),
        ("time [s], speed [m/s]\n-1,1", "line 2: time must be at least 0 s$"),
        ("time [s], speed [m/s]\n1,2 m/s", "speed is not a number"),
        ('time [s], speed [m/s]\n1,"2', "line 2"),
    ],
)
def test_a_wrong_table_is_refused_with_line_and_cure(text, words):
    with pytest.raises(TableError, match=words):
        columns(text, WANTED)


def test_a_matrix_is_read_row_by_row():
    assert matrix("# Pa\n1, 2, 3\n4, 5, 6\n", Quantity("Pa", "stress")).tolist() == [[1, 2, 3], [4, 5, 6]]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("1,2\n3", "line 2: 1 cells where the first row has 2"),
        ("1,nan", "is nan"),
        ("1,x", "line 1: value is not a number"),
    ],
)
def test_a_wrong_matrix_is_refused_with_line_and_cure(text, words):
    with pytest.raises(TableError, match=words):
        matrix(text, Quantity("Pa", "stress"))


def test_a_long_table_is_read_in_blocks_and_not_cell_by_cell(monkeypatch):
    monkeypatch.setattr(table, "_AT_ONCE", 3000)
    times = [f"{0.1 * number!r}" for number in range(999)]
    rows = [f"{time}, 'remark', {7.0 * n:.4e}" for n, time in enumerate(times)]
    rows[500:500] = ["", "# a note", f'"{times[500]}","quoted, or not", " 1.5 "', "\t"]
    text = "\r\n".join(["\ufefftime [ms], remark, speed [in/min]", *rows])
    read, reads = Quantity.read, []
    monkeypatch.setattr(Quantity, "read", lambda self, value: reads.append(value) or read(self, value))
    found = columns(text, WANTED)
    assert len(reads) < 0.1 * len(rows)
    times.insert(500, times[500])
    assert found["time"].tolist() == [read(TIME, f"{time} ms") for time in times]
    speeds = [7.0 * n for n in range(999)]
    speeds.insert(500, 1.5)
    expected = [read(SPEED, f"{float(f'{speed:.4e}')!r} in/min") for speed in speeds]
    assert found["speed"].tolist() == expected
    stresses = matrix("\n".join(",".join([time] * 3) for time in times), Quantity("Pa", "stress"))
    assert stresses.tolist() == [[float(time)] * 3 for time in times]


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("1", "line 901: 1 cells where the header has 2"),
        ("1, x", "line 901: speed is not a number"),
        ("-1, 1", "line 901: time must be at least 0 s"),
        ("1, 1e308", "line 901: speed must be finite"),
        ('1, "2', "line 901: cannot be read"),
        ("1, nan", "line 901: speed is nan"),
    ],
)
def test_a_fault_far_down_is_named_with_its_line(monkeypatch, row, said):
    monkeypatch.setattr(table, "_AT_ONCE", 300)
    rows = ["# a comment", "", "time [s], speed [km/s]", *(f"{n}, 2" for n in range(3, 900)), row, "5, 5"]
    with pytest.raises(TableError, match=said):
        columns("\n".join(rows), WANTED)


def test_a_line_without_an_end_is_refused(monkeypatch):
    monkeypatch.setattr(table, "_LONGEST_LINE", 1000)
    with pytest.raises(TableError, match="line after line 1 is longer than 1,000 characters"):
        matrix("1," * 600, Quantity("Pa", "stress"))


def test_an_array_is_checked_as_its_numbers_are():
    part = TypeAdapter(Annotated[tuple[Annotated[float, TIME], ...], at_once(TIME)])
    assert part.validate_python(np.array([1.0, 2.0])) == part.validate_python([1.0, "2 s"]) == (1.0, 2.0)
    assert part.validate_python(np.array([1, 2])) == (1.0, 2.0)
    for wrong in (np.array([1.0, -1.0]), np.array([1.0, np.nan]), np.array([[1.0]])):
        with pytest.raises(ValidationError) as fault:
            part.validate_python(wrong)
        with pytest.raises(ValidationError) as other:
            part.validate_python(wrong.tolist())
        assert [error["loc"] for error in fault.value.errors()] == [error["loc"] for error in other.value.errors()]


class Files:
    """Reads beside a scenario, as the reader's object does."""

    def __init__(self, folder):
        self.folder = folder

    def path(self, name):
        return self.folder / name

    def text(self, name):
        return self.path(name).read_text(encoding="utf-8")


def test_files_are_read_beside_the_scenario_and_otherwise_here(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_text("words")
    context = {"files": Files(tmp_path)}
    assert file_text("a.csv", context) == "words"
    assert file_path("a.csv", context) == tmp_path / "a.csv"
    monkeypatch.chdir(tmp_path)
    assert file_text("a.csv", None) == "words"
    assert file_path("a.csv", {}).read_text() == "words"


@pytest.mark.parametrize("read", [file_text, file_path])
@pytest.mark.parametrize("name", ["missing.csv", "", "bad\0name"])
def test_a_file_that_is_not_there_is_named_with_a_cure(tmp_path, read, name):
    for context in ({"files": Files(tmp_path)}, None):
        with pytest.raises(ValueError, match=r"cannot be read .*; give a path relative to the scenario"):
            read(name, context)


def test_what_never_ends_is_no_table(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe.csv")
    for name in ("/dev/zero", str(tmp_path / "pipe.csv")):
        with pytest.raises(ValueError, match="it is no plain file"):
            file_text(name, None)
    assert file_text("/proc/self/status", None) == ""  # as /proc/kmsg, which waits for the kernel's next word
    monkeypatch.setattr(table, "_MOST_BYTES", 3)
    (tmp_path / "long.csv").write_text("1234")
    with pytest.raises(ValueError, match="it is larger than 0 MiB"):
        file_text(str(tmp_path / "long.csv"), None)


def test_a_file_that_is_not_text_is_refused(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="csv is not UTF-8 text; save it"):
        file_text("a.csv", {"files": Files(tmp_path)})
