"""CSV tables: units in the header, and one clear error for each way to get them wrong."""

import re
from typing import Annotated

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError

from sim.scenario.files import Files
from sim.units import tables
from sim.units.errors import BadInput
from sim.units.quantity import Quantity
from sim.units.tables import (
    LISTED,
    TableError,
    columns,
    file_path,
    file_text,
    matrix,
    read_measured,
)

TIME = Quantity("s", "time", at_least=0)
SPEED = Quantity("m/s", "speed")
SHARE = Quantity("1", "share")
STRESS = Quantity("Pa", "stress")
WANTED = {"time": TIME, "speed": SPEED}


TEXTS = [
    "time [ms], speed [mm/s]\n0, 1\n250, -2.5e3\n",
    "time [ms],speed [mm/s]\r\n0,1\r\n250,-2.5e3\r\n",
    "\ufeff# of Monday\n\nspeed (mm/s), remark, time (ms)\n# rising\n1, a b, 0\n\n-2.5e3, c, 250",
    '"time [ms]","speed [mm/s]"\n"0","1"\n"250", "-2.5e3"',
    "time [s];speed [m/s]\n0;0,001\n0,25;-2,5\n",
    "speed [mm/s]\ttime [s]\t remark\n1\t0\t1.5,\n-2500\t0,25\t-\n",
    "time, speed\n0, 1e-3\n0.25, -2.5",
    "time [s] , speed [cm/s]\n 0 , .1\n 25e-2 , -2_50",
    # of a spreadsheet
    '\ufeffsep=;\r\n"time (ms)";"speed (mm/s)";\r\n"0";"1";\r\n"250,0";"-2500,0";\r\n;;\r\n',
    "# speed in mm/s;;\r\ntime;speed;\r\n0;0,001e3;\r\n0,25;-2500;\r\n",
    "# time in ms, speed in mm/s\n0 1\n250 -2.5e3",
]


def test_columns_come_in_si_units_whatever_separates_and_names_them():
    bare = [
        f"# of an instrument\n 0{sign}1 \n\n250{sign}-2.5e3"
        for sign in (" ", "  ", "\t", ";", ",", ", ")
    ]
    results = [columns(text, WANTED) for text in TEXTS]
    results += [columns(text, WANTED, "time [ms], speed [mm/s]") for text in bare]
    for result in results:
        assert (result["time"].tolist(), result["speed"].tolist()) == (
            [0.0, 0.25],
            [0.001, -2.5],
        )
    for text in bare:
        assert matrix(text, SPEED).tolist() == [[0.0, 1.0], [250.0, -2500.0]]


def test_a_cell_is_rounded_as_the_same_quantity_in_a_scenario():
    text = "time [ms]\n" + "\n".join(str(n) for n in range(1100))
    assert columns(text, {"time": TIME})["time"].tolist() == [
        TIME.read(f"{n} ms") for n in range(1100)
    ]


def test_units_of_pure_numbers_percents_products_and_angles_are_read():
    assert [
        columns(f"a{unit}\n5", {"a": SHARE})["a"][0]
        for unit in ("", " []", " [1]", " [ - ]")
    ] == [5.0] * 4
    assert columns("a (%)\n50", {"a": SHARE})["a"].tolist() == [0.5]
    assert columns("C [kPa^2 um^2]\n2", {"C": Quantity("Pa^2 m^2", "density")})[
        "C"
    ].tolist() == [2e6 * 1e-12]
    q = {"q": Quantity("rad/m", "wavenumber")}
    cycles = [
        columns(f"q [{unit}]\n2", q)["q"][0]
        for unit in ("rad/um", "cycles/um", "cycle um^-1")
    ]
    assert_allclose(cycles, [2e6, 4e6 * np.pi, 4e6 * np.pi], rtol=1e-15, atol=0)
    for unit in ("1/um", "um^-1", "um**-1"):
        with pytest.raises(TableError, match=r'"rad/um" .* "cycles/um"'):
            columns(f"q [{unit}]\n1", q)


def test_a_map_has_the_unit_of_its_comment_or_key_and_an_area_that_of_a_spreadsheet():
    for comment, unit, pascals in (
        ("# stress in kPa", "", 1e3),
        ("# stress [kPa], 5 um;;", "kPa", 1e3),
        ("# in June", "", 1.0),
        ("", "MPa", 1e6),
    ):
        assert np.array_equal(
            matrix(f"{comment}\n1;2\n3;4", STRESS, unit=unit),
            pascals * np.array([[1, 2], [3, 4]]),
        )
    with pytest.raises(TableError, match="MPa and kPa"):
        matrix("# stress in kPa\n1 2\n3 4", STRESS, unit="MPa")
    areas = [
        columns(f"a ({unit})\n2", {"a": Quantity("m^2", "area")})["a"][0]
        for unit in ("mm2", "mm²", "mm^2")
    ]
    assert areas == [2e-6] * 3


def test_measured_columns_are_all_named_at_once_with_proposals_and_without_units_the_largest_values(
    tmp_path, caplog
):
    units = {
        "speed": "m/s",
        "contact_area": "m^2",
        "friction_force": "N",
        "contact_load": "N",
        "t": "s",
    }
    known, path = (
        {name: Quantity(unit, name) for name, unit in units.items()},
        tmp_path / "measured.csv",
    )
    path.write_text(
        "V (mm/s),A (mm2),A_error (%),Load,contact_aera,t_error,x\n1,2,3,4,5,6,7\n",
        encoding="utf-8",
    )
    with pytest.raises(BadInput) as fault:
        read_measured(path, known, known)
    (line,) = fault.value.problems
    proposed = {
        "V": "speed",
        "A": "contact_area",
        "A_error": "contact_area_error",
        "Load": "contact_load",
    }
    assert dict(re.findall(r"(\S+) → (\w+)", line)) == proposed | {
        "contact_aera": "contact_area"
    }
    assert all(word in line for word in (str(path), "t_error", " x;"))
    path.write_bytes("\ufeffspeed;contact_area\r\n50,0;0,2\r\n-60;0,1\r\n".encode())
    result, remark = read_measured(path, known, known)
    assert (
        result["speed"].values.tolist() == [50.0, -60.0]
        and "speed reaches 60 m/s" in remark
    )
    assert re.search(
        r"speed reaches 60 m/s, contact_area reaches 0\.2 m\^2", caplog.text
    )
    caplog.clear()
    path.write_text("speed [m/s];contact_area [m2]\n50,0;0,2\n", encoding="utf-8")
    assert not read_measured(path, known, known)[1] and not caplog.records


def test_a_wrong_table_is_refused_with_place_and_cure():
    time_speed = "time [s], speed [m/s]\n"
    for text, header, words in (
        ("# only this\n\n", None, "empty"),
        (time_speed, None, "no rows"),
        (
            "time [s], sped [m/s]\n1,2",
            None,
            r'line 1: column "speed" .* "time \[s\], speed \[m/s\]"',
        ),
        (
            "time [s], time [ms], speed [m/s]\n1,2,3",
            None,
            'column "time" is there twice',
        ),
        ("time [s] speed [m/s]\n1 2", None, "line 1: "),
        ("#\ntime [s], speed [m]\n1,2", None, 'line 2: column "speed" .* unit of m/s'),
        (
            "time [s], speed [furlongs/blink]\n1,2",
            None,
            'column "speed" .*unknown unit',
        ),
        (f"{time_speed}1,2\n3", None, "line 3: 1 cells"),
        (f"{time_speed}1,2\n\n3,fast", None, "line 4: speed is not a number"),
        (f"{time_speed}1,", None, "line 2: speed .* omit the row"),
        (f"{time_speed}1,2\n1,nan", None, "line 3: speed must be finite"),
        (f"{time_speed}1,2\n-1,1", None, "line 3: time must be at least 0 s$"),
        (f'{time_speed}1,"2', None, "quotes"),
        ("time [s]; speed [m/s]\n1,5;2\n1.5;2", None, 'time .* "." and with ","'),
        (f'{time_speed}1,"2,5"', None, "line 2: speed is not a number"),
        ("1 2\n3 4", "", r'header = "time \[s\], speed \[m/s\]"'),
        ("1 2\n3 4", "time [s], speed [m]", 'header: column "speed" .* unit'),
        ("1 2\n3 4", "time, speed, other", "header: 3 names for 2 columns"),
        ("time, speed\n3, 4", "time, speed", "line 1: .* omit the key header"),
    ):
        with pytest.raises(TableError, match=words):
            columns(text, WANTED, header)
    for text, words in (
        ("", "empty"),
        ("1,2\n3", "line 2: 1 cells"),
        ("1,nan", "finite"),
        ("1,2\n1,x", "line 2: value"),
    ):
        with pytest.raises(TableError, match=words):
            matrix(text, STRESS)
    np.testing.assert_array_equal(
        matrix("1;nan\n2,5;4", STRESS, gaps=True), [[1.0, np.nan], [2.5, 4.0]]
    )


def test_an_array_is_checked_as_its_numbers_are():
    part = TypeAdapter(Annotated[tuple[Annotated[float, TIME], ...], LISTED])
    assert (
        part.validate_python(np.array([1.0, 2.0]))
        == part.validate_python([1.0, "2 s"])
        == (1.0, 2.0)
    )
    for wrong in (np.array([1.0, -1.0]), np.array([1.0, np.nan]), np.array([[1.0]])):
        with pytest.raises(ValidationError):
            part.validate_python(wrong)


def test_files_are_read_beside_the_scenario_and_otherwise_here(tmp_path, monkeypatch):
    (tmp_path / "a.csv").write_bytes("\ufeffwörds\r\n".encode())
    context = {"files": Files(tmp_path)}
    monkeypatch.chdir(tmp_path)
    assert file_text("a.csv", context) == file_text("a.csv", None) == "wörds\n"
    assert (file_path("a.csv", context), file_path("a.csv", {}).name) == (
        tmp_path / "a.csv",
        "a.csv",
    )


def test_a_file_that_cannot_be_read_is_named_with_a_cure(tmp_path, monkeypatch):
    (tmp_path / "folder").mkdir()
    (tmp_path / "long.csv").write_text("12345", encoding="utf-8")
    (tmp_path / "latin.csv").write_bytes(b"\xff\xfe")
    monkeypatch.setattr(tables, "_MOST_BYTES", 4)
    for name in ("missing.csv", "", "bad\0name", "folder", "long.csv", "latin.csv"):
        with pytest.raises(ValueError, match=r"(name a plain file|plain CSV in UTF-8)"):
            tables.file_columns(name, {"files": Files(tmp_path)}, WANTED)
