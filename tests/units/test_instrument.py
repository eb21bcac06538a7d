"""Files of instruments: read as they are written, and one message with line, column and cure for each fault."""

import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from sim.units.errors import BadInput
from sim.units.instrument import Instrument
from sim.units.quantity import Quantity
from sim.units.tables import read_measured

KNOWN = {
    "displacement": Quantity("m", "displacement"),
    "normal_load": Quantity("N", "load"),
    "t": Quantity("s", "time", at_least=0),
}
#: Head of an instrument whose headings have wrong units, in which µ and ° are single bytes.
HEAD = "Routine of µN\n16.09.2022\n\nPiezo[nm]\tSensor[nm]\tTime[ms]\tTemp [°C]\neoh\n"
ROWS = "0,5\t-2,0\t1,0\t22,1\n1,5\t4,0\t1,1\t22,1\n"
COLUMNS = (
    "1: displacement [um]",
    "2: normal_load [nm * 3.01 N/m]",
    "3: t [s]",
)
FORM = {
    "marker": "eoh",
    "encoding": "latin-1",
    "decimal": ",",
    "columns": COLUMNS,
}


def read(path, content, **form):
    path.write_bytes(content)
    result, remark = read_measured(
        path, KNOWN, KNOWN, instrument=Instrument(**form) if form else None
    )
    assert remark == ""
    return {name: points.values for name, points in result.items()}


def test_a_file_is_read_as_its_instrument_wrote_it_in_the_units_that_are_stated(
    tmp_path,
):
    text = HEAD + ROWS
    wanted = {
        "displacement": [0.5e-6, 1.5e-6],
        "normal_load": [-6.02e-9, 12.04e-9],
        "t": [1.0, 1.1],
    }
    texts = {
        "latin-1": text,
        "utf-16": text,
        "utf-8": "\ufeff" + text.replace("\n", "\r\n"),
    }
    for encoding, written in texts.items():
        form = FORM | {"encoding": encoding}
        result = read(tmp_path / "loop.txt", written.encode(encoding), **form)
        for name, values in wanted.items():
            assert_allclose(result[name], values, rtol=1e-14)
    for separator, sign in (("semicolon", ";"), ("blank", "  "), ("comma", ",")):
        rows = ROWS.replace(",", ".").replace("\t", sign)
        form = FORM | {"separator": separator, "decimal": "."}
        result = read(tmp_path / "loop.txt", (HEAD + rows).encode("latin-1"), **form)
        assert_allclose(result["normal_load"], wanted["normal_load"], rtol=1e-14)
    # lines of a head without a marker, a sign, and a table that has a header below its head
    form = {"skip": 6, "encoding": "latin-1", "decimal": ","}
    form["columns"] = ("1: displacement [um * -1]",)
    skipped = HEAD + "units of the rows\n" + ROWS
    result = read(tmp_path / "loop.txt", skipped.encode("latin-1"), **form)
    assert_allclose(result["displacement"], [-0.5e-6, -1.5e-6], rtol=1e-14)
    headed = "measured\n***\ndisplacement [um], t [s]\n0.5, 1.0\n1.5, 1.1\n"
    result = read(tmp_path / "loop.txt", headed.encode(), marker="**")
    assert_allclose(result["displacement"], wanted["displacement"], rtol=1e-14)


@pytest.mark.parametrize(
    ("changes", "rows", "words"),
    [
        ({"marker": "end"}, ROWS, 'marker "end"; write'),
        ({"encoding": "utf-8"}, ROWS, "line 1: is no text in utf-8; give"),
        ({"decimal": "."}, ROWS, 'line 6, column 1 (displacement): decimal = ","'),
        ({"separator": "semicolon"}, ROWS, "line 6, column 3 (t): the line has 1"),
        (
            {"columns": (*COLUMNS, "9: indentation [nm]")},
            ROWS,
            "line 6, column 9 the line has 4",
        ),
        ({}, ROWS + "\n\nstopped\t1\t2\n", "line 10, column 1 (displacement) omit"),
        ({}, ROWS + "1\t\t2\n", "line 8, column 2 (normal_load) no finite number"),
        ({}, ROWS + "1\t1\t-2\n", "line 8: t must be at least 0 s"),
        ({}, ROWS + "1\t1.234,5\t2\n", "line 8, column 2 (normal_load) no finite"),
        ({"columns": ("1: displacement [kg]",)}, ROWS, 'displacement" has the unit'),
        ({"columns": ("1: displacment [um]",)}, ROWS, "→ displacement"),
    ],
)
def test_a_fault_of_a_file_is_one_message_with_file_line_column_and_cure(
    tmp_path, changes, rows, words
):
    with pytest.raises(BadInput) as refusal:
        read(
            tmp_path / "loop.txt",
            (HEAD + rows).encode("latin-1"),
            **(FORM | changes),
        )
    (problem,) = refusal.value.problems
    assert "loop.txt: " in problem and problem.count("\n") == 0
    for word in words.split():
        assert word in problem, problem


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("columns", ("displacement [um]",), "write its number from 1"),
        ("columns", ("0: t [s]",), "write its number from 1"),
        ("columns", ("1: t [s]", "1: load [N]"), "twice"),
        ("columns", ("1: t [s]", "2: t [s]"), "twice"),
        ("encoding", "latin-99", 'write for example "utf-8"'),
        ("stretch", ("9 s:1 s",), "the earlier one first"),
        ("baseline", ("9:1",), "without a unit"),
        ("every", 0, "at least 1"),
    ],
)
def test_a_key_of_an_instrument_that_cannot_be_used_is_refused_with_a_cure(
    key, value, words
):
    with pytest.raises(ValidationError, match=words):
        Instrument(**{key: value})


def test_each_file_has_its_own_stretch_or_all_have_one():
    one, two = (
        Instrument(stretch=("1 s:2 s",)),
        Instrument(stretch=("1 s:2 s", "3 s:4 s")),
    )
    assert one.times("stretch", 1, 3) == (1.0, 2.0)
    assert two.times("stretch", 1, 2) == (3.0, 4.0)
    assert one.times("baseline", 0, 1) is None
    with pytest.raises(ValueError, match="one for each file"):
        two.times("stretch", 0, 3)
