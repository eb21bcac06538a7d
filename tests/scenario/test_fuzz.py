"""Damaged scenario files: each is read or refused in plain lines, whatever the damage."""

import re
from pathlib import Path

import numpy as np
import pytest

from sim.scenario.reader import BadInput, load
from sim.scenario.scenario import Scenario

FOLDER = Path(__file__).parents[2] / "scenarios"
FILES = b"""
[clock]
duration = "1 s"
step = "0.1 s"
[solid]
youngs_modulus = "4.8 MPa"
counter_body = { shear_modulus = "1 GPa", poisson_ratio = 0.3 }
[sphere]
radius = "2 mm"
[adhesion]
work = "42 mJ/m^2"
[contact]
load = "4 mN"
[drive]
model = "table"
file = "speeds.csv"
[shear]
model = "modal"
points = 26
spectrum = { model = "tabulated", file = "psd.csv", normalization = "in_density" }
correlation = { model = "wave", waves = 2.0 }
amplitude = { model = "constant" }
[record]
per_member = false
precision = "float32"
[[sweep]]
"drive.file" = "speeds.csv"
"shear.spectrum" = { model = "measured", file = "map.csv", spacing = "8 um" }
[[sweep]]
"drive.file" = "speeds.csv"
"shear.spectrum" = { model = "von_karman", rms = "1 kPa", length = "10 um", hurst = 0.5 }
"""
BESIDE = {
    "speeds.csv": "time [s], speed [mm/s]\n0, 1\n1, 2\n",
    "psd.csv": "q [rad/m], C [Pa^2 m^2]\n1e5, 1\n2e5, 1\n",
    "map.csv": "\n".join(",".join(str((7 * i * i + 3 * i * j) % 11) for i in range(10)) for j in range(10)),
    **{path.name: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.csv"))},
}
STARTER = FOLDER.parent / "sim" / "starter.toml"
TEXTS = [*(path.read_bytes() for path in sorted(FOLDER.glob("*.toml"))), STARTER.read_bytes(), FILES]
NASTY = [
    *(
        "nan",
        "inf",
        "-inf",
        "-1",
        "0",
        "1e400",
        "1e-400",
        "1e59",
        "1e-59",
        "3e55",
        "-2.5e-58",
        "9" * 400,
        "true",
        "false",
    ),
    *("[]", "{}", "[[]]", '""', '"nan Pa"', '"-1 m"', '"1e300 kg"', '"2 MPa"', '"3 mm"', '"4 mN"', '"5 1/s"', "'x'"),
    *('"\\u0000"', '"\\u001b[2J"', '"a\\nb"', "1979-05-27", "07:32:00", "0x1fffffffffffffffff", "1_000", '"1,5 mm"'),
    *('{ model = "modal" }', "{ from = 1, to = 2, count = 3 }", '{ from = "1 mN", to = "2 mm", count = 99999999 }'),
    *('["1 mN", "2 kg", -3]', '[{ model = "none" }, { model = "rate" }]', '"' + "m^9" * 15 + '"', '"5 m^9^9^9^9"'),
    *('"modal"', '"mapped"', '"mean"', '"tabulated"', '"measured"', '"ripple"', '"von_karman"', '"counted"', '"table"'),
    *(
        '"../scenarios"',
        '"/dev/zero"',
        '"no.csv"',
        '"psd.csv"',
        "16384",
        "2",
        "3.5",
        "10000000",
        "1e-9",
        '"1 ns"',
        '"1 km"',
    ),
]
UNITS = [b"Pa", b"kPa", b"mN", b"um", b"mm", b"s", b"ms", b"m/s", b"J/m^2", b"1/s", b"kg", b"%", b"foo", b""]
MARKS = [b"[", b"]", b"{", b"}", b'"', b"'", b"=", b".", b",", b"#", b"\n", b"\\", b'"""', b"[[", b"\xff", b"\x00"]


def flip(text, draw):
    at = int(draw.integers(len(text)))
    return text[:at] + bytes([int(draw.integers(256))]) + text[at + 1 :]


def insert_mark(text, draw):
    at = int(draw.integers(len(text)))
    return text[:at] + MARKS[draw.integers(len(MARKS))] + text[at:]


def truncate(text, draw):
    return text[: int(draw.integers(len(text)))]


def remove_line(text, draw):
    lines = text.split(b"\n")
    del lines[draw.integers(len(lines))]
    return b"\n".join(lines)


def double_line(text, draw):
    lines = text.split(b"\n")
    lines.insert(int(draw.integers(len(lines))), lines[draw.integers(len(lines))])
    return b"\n".join(lines)


def swap_lines(text, draw):
    lines = text.split(b"\n")
    one, other = draw.integers(len(lines), size=2)
    lines[one], lines[other] = lines[other], lines[one]
    return b"\n".join(lines)


def replace_value(text, draw):
    places = list(re.finditer(rb"= *([^\n#]+)", text))
    if not places:
        return text
    place = places[draw.integers(len(places))]
    return text[: place.start(1)] + NASTY[draw.integers(len(NASTY))].encode() + text[place.end(1) :]


def misspell_key(text, draw):
    places = list(re.finditer(rb"(?m)^\"?([a-z_.]+)\"? *=", text))
    if not places:
        return text
    at = int(draw.integers(*places[draw.integers(len(places))].span(1)))
    return text[:at] + bytes([int(draw.integers(97, 123))]) + text[at + int(draw.integers(2)) :]


def misspell_table(text, draw):
    places = list(re.finditer(rb"(?m)^\[([a-z_.]+)\]", text))
    if not places:
        return text
    at = int(draw.integers(*places[draw.integers(len(places))].span(1)))
    return text[:at] + bytes([int(draw.integers(97, 123))]) + text[at + int(draw.integers(2)) :]


def swap_unit(text, draw):
    places = list(re.finditer(rb"\"-?[0-9.]+ ([^\"\n]+)\"", text))
    if not places:
        return text
    place = places[draw.integers(len(places))]
    return text[: place.start(1)] + UNITS[draw.integers(len(UNITS))] + text[place.end(1) :]


def scale_number(text, draw):
    places = list(re.finditer(rb"(?<![0-9.])[0-9]+(?:\.[0-9]+)?(?![0-9.])", text))
    if not places:
        return text
    place = places[draw.integers(len(places))]
    number = float(place[0]) * 10.0 ** int(draw.integers(-12, 13))
    written = str(int(number)) if number.is_integer() and draw.integers(2) else repr(number)
    return text[: place.start()] + written.encode() + text[place.end() :]


def merge_tables(text, draw):
    headers = list(re.finditer(rb"(?m)^\[[a-z_.]+\]\n", text))
    if not headers:
        return text
    header = headers[draw.integers(len(headers))]
    return text[: header.start()] + text[header.end() :]


def splice(text, draw):
    other = TEXTS[draw.integers(len(TEXTS))]
    return text[: int(draw.integers(len(text)))] + other[int(draw.integers(len(other))) :]


def move_table(text, draw):
    tables = re.split(rb"(?m)^(?=\[)", text)
    tables.append(tables.pop(int(draw.integers(len(tables)))))
    return b"".join(tables)


DAMAGES = [
    flip, insert_mark, truncate, remove_line, double_line, swap_lines, replace_value, replace_value, replace_value,
    misspell_key, misspell_table, swap_unit, scale_number, scale_number, merge_tables, splice, move_table,
]  # fmt: skip


def damaged(seed):
    """A scenario with one to four damages, each drawn from the seed's own stream."""
    draw = np.random.Generator(np.random.Philox(key=seed))
    text = TEXTS[draw.integers(len(TEXTS))]
    for _ in range(int(draw.integers(1, 5))):
        text = DAMAGES[draw.integers(len(DAMAGES))](text, draw) or b"x"
    return text


#: Words of the validator that no user of a scenario file should meet.
FOREIGN = re.compile(
    r"Input should|union_tag|dataclass|pydantic|function-|ctx|NoneType|Traceback|\bdict\b|\btuple\b|0x7f"
)


def check(seed, folder):
    for name, content in BESIDE.items():
        (folder / name).write_text(content, encoding="utf-8")
    path = folder / "x.toml"
    path.write_bytes(damaged(seed))
    try:
        assert isinstance(load(path), Scenario)
    except BadInput as refused:
        assert refused.problems
        assert len(set(refused.problems)) == len(refused.problems)
        for problem in refused.problems:
            assert problem.startswith(f"{path}:")
            assert problem.isprintable()
            assert not FOREIGN.search(problem.removeprefix(str(path))), problem


def test_without_damage_all_are_scenarios(tmp_path):
    for name, content in BESIDE.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    for text in TEXTS:
        (tmp_path / "x.toml").write_bytes(text)
        assert isinstance(load(tmp_path / "x.toml"), Scenario)


def test_100_damaged_files_are_read_or_refused_in_plain_lines(tmp_path):
    for seed in range(100):
        check(seed, tmp_path)


@pytest.mark.verify
def test_500_damaged_files_are_read_or_refused_in_plain_lines(tmp_path):
    for seed in range(100, 600):
        check(seed, tmp_path)
