"""What a scenario file can get wrong about what holds the sphere: told once, with line, key and cure."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers.commands import LENS

from sim.scenario.reader import BadInput, load

HEAD = LENS.removesuffix('load = "4 mN"\n')
TABLE = HEAD.count("\n")
FIRST = TABLE + 1

FILES = {
    "loads.csv": "time [s], load [mN], displacement [um], indentation [nm]\n0, 4, 1, 2\n1, -2, -1, 5\n",
    "force.csv": "time [s], force [mN]\n0, 4\n1, 2\n",
    "mass.csv": "time [s], load [kg]\n0, 4\n1, 2\n",
    "order.csv": "time [s], load [mN]\n0, 4\n1, 2\n0.5, 1\n",
    "late.csv": "time [s], load [mN]\n0.5, 4\n1, 2\n",
    "one.csv": "time [s], load [mN]\n0, 4\n",
    "words.csv": "time [s], load [mN]\n0, four\n1, 2\n",
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text)
    return tmp_path


def problems(lines):
    Path("x").write_text(HEAD + lines + "\n")
    with pytest.raises(BadInput) as fault:
        load("x")
    return fault.value.problems


def sound(lines):
    Path("x").write_text(HEAD + lines + "\n")
    return load("x").contact


NOTHING = 'nothing holds the sphere; give a load such as "4 mN", an indentation such as "2 um", '
NOTHING += "or a displacement with a stiffness"


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("", NOTHING),
        ('model = "equilibrium"', NOTHING),
        ('stiffness = "1 kN/m"', NOTHING),
        ('load = "4 mN"\nindentation = "1 um"', "a load and an indentation cannot both hold the sphere; leave one"),
        (
            "load = 1\ndisplacement = 1\nstiffness = 1",
            "a load and a displacement cannot both hold the sphere; leave one of them",
        ),
        ('displacement = "1 um"', 'a displacement needs the stiffness between base and sphere, such as "1 kN/m"'),
        (
            'load = "4 mN"\nstiffness = 3',
            "a stiffness belongs to a displacement; give contact.displacement, or leave it out",
        ),
    ],
)
def test_one_thing_holds_the_sphere(folder, lines, said):
    (told,) = problems(lines)
    assert told.startswith(f"x:{TABLE}: contact: {said}")


@pytest.mark.parametrize(
    ("lines", "key", "said"),
    [
        ('load = "4 kg"', "load", 'has the unit "kg", which is not a unit of N; write for example "4 mN"'),
        ("load = [1, 2]", "load", 'must be a number or text with a unit such as "4 mN", not a list'),
        ("load = true", "load", 'must be a number or text with a unit such as "4 mN", not true'),
        ("load = inf", "load", 'must be finite; write for example "4 mN"'),
        ('load = ""', "load", 'cannot be read: ""; write a number and a unit, such as "4 mN"'),
        ('load = { from = "1 um", to = 1 }', "load.from", 'has the unit "um", which is not a unit of N; write for'),
        ("load = { from = nan, to = 1 }", "load.from", 'must be finite; write for example "4 mN"'),
        ("load = { from = [1], to = 2 }", "load.from", "must be a number or text with a unit"),
        ('load = { from = -1, to = 1, scale = "log" }', "load", "a logarithmic course cannot reach or pass zero; give"),
        ('indentation = { from = 0, to = 1, scale = "log" }', "indentation", "a logarithmic course cannot reach or"),
        ("load = { from = 0, to = 1, cycles = -1 }", "load.cycles", "must be at least 0, not -1"),
        ("load = { from = 0, to = 1, cycles = 0.5 }", "load.cycles", "must be a whole number such as 64, not 0.5"),
        ("load = { from = 0, to = 1, cycles = 1000001 }", "load.cycles", "must be at most 1000000, not 1000001"),
        ('load = { from = 0, to = 1, scale = "lgo" }', "load.scale", 'must not be "lgo"; did you mean "log"?'),
        ("load = { from = 0 }", "load.to", "is missing; add for example to = "),
        ("load = { from = 0, to = 1, cyclles = 1 }", "load.cyclles", 'is not a key; did you mean "cycles"?'),
        ("load = { form = 0, to = 1 }", "load.form", 'is not a key; did you mean "from"?'),
        ("load = { from = 0, too = 1 }", "load.too", 'is not a key; did you mean "to"?'),
        ('load = { file = "loads.csv", from = 1 }', "load.f", "does not go with f"),
        ('load = { file = "loads.csv", cycles = 2 }', "load.", "does not go with "),
        ('load = { file = "none.csv" }', "load.file", "none.csv cannot be read (No such file or directory); give a"),
        ("load = { file = 3 }", "load.file", "must be text in quotes, not 3"),
        (
            'load = { file = "force.csv" }',
            "load.file",
            'column "load" is missing; write the header as "time [s], load [N]" (found: time, force)',
        ),
        (
            'load = { file = "mass.csv" }',
            "load.file",
            'mass.csv: line 1: column "load" has a unit that is not a unit of N;',
        ),
        ('load = { file = "words.csv" }', "load.file", "words.csv: line 2: load is not a number; write a plain"),
        ('load = { file = "order.csv" }', "load", "times must start at 0 s or before and never decrease"),
        ('load = { file = "late.csv" }', "load", "times must start at 0 s or before and never decrease"),
        ('load = { file = "one.csv" }', "load", "a table needs two rows or more"),
        ("load = { time = [0, 1], value = [1, 2, 3] }", "load", "a table needs "),
        ("load = { time = [0, 0.5, 0.2], value = [1, 1, 1] }", "load", "times must start at 0 s or before and never"),
        ('load = { time = [0, 1], value = [1, "2 kg"] }', "load.value", 'value 2: has the unit "kg", which is not a'),
        ('load = 1\nafter_pull_off = "reatach"', "after_pull_off", 'must not be "reatach"; did you mean "reattach"?'),
        ("load = 1\nreversible = 2", "reversible", "must be at most 1, not 2"),
        ("load = 1\nreversible = -0.1", "reversible", "must be at least 0, not -0.1"),
        ("displacement = 1\nstiffness = 0", "stiffness", "must be above 0 N/m, not 0 N/m"),
        ("displacement = 1\nstiffness = -1", "stiffness", "must be above 0 N/m, not -1 N/m"),
        ("displacement = 1\nstiffness = inf", "stiffness", 'must be finite; write for example "1 N/m"'),
        ('displacement = 1\nstiffness = "1 N"', "stiffness", 'has the unit "N", which is not a unit of N/m; write for'),
        ("lode = 1", "lode", 'is not a key; did you mean "load"?'),
        (
            "load = 1\nfront_speed = 1",
            "front_speed",
            'is not a key of model = "equilibrium"; remove it, or choose model',
        ),
        ('load = 1\nmodel = "rate_dependnt"', "model", 'must not be "rate_dependnt"; did you mean "rate_dependent"?'),
        ("model = 3\nload = 1", "model", 'must be "equilibrium" or "rate_dependent", not 3'),
    ],
)
def test_what_is_wrong_is_told_once_with_its_line_and_the_cure(folder, lines, key, said):
    (told,) = problems(lines)
    line = next(number for number, text in enumerate(lines.splitlines(), FIRST) if text.startswith(key.split(".")[0]))
    assert told.startswith(f"x:{line}: contact.{key}"), told
    assert said in told


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("load = {}", ("from", "to")),
        ('load = { fiel = "loads.csv" }', ("fiel",)),
        ('load = { table = "loads.csv" }', ("table",)),
        ("load = { start = 0, stop = 1 }", ("start", "stop")),
        ("load = { value = [1, 2] }", ("load",)),
        ("load = { time = [0, 1] }", ("load",)),
    ],
)
def test_a_table_of_the_wrong_keys_names_each_of_them(folder, lines, words):
    told = problems(lines)
    assert told
    assert all(text.startswith(f"x:{FIRST}: contact.load") for text in told)
    assert all(any(word in text for text in told) for word in words)
    assert not any(re.search(r"known: *$", text) for text in told)


@pytest.mark.parametrize("key", ["front_speed", "front_exponent", "heal_speed", "heal_exponent"])
def test_an_edge_that_cannot_move_is_refused(folder, key):
    more = "" if key == "front_speed" else "front_speed = 1\n"
    (told,) = problems(f'model = "rate_dependent"\nload = 1\n{more}{key} = 0')
    assert re.match(rf"x:\d+: contact\.{key}: must be above 0( m/s)?, not 0", told)


def test_an_edge_needs_its_speed(folder):
    assert problems('model = "rate_dependent"\nload = 1') == [
        f'x:{TABLE}: contact.front_speed: is missing; add for example front_speed = "1 mm/s"'
    ]


def test_every_way_of_holding_a_sphere_is_read(folder):
    half = np.float64(0.5)
    assert sound('load = "4 mN"').load == 4e-3
    assert sound('load = { from = "4 mN", to = "-1 mN" }').load.at(half, 1.0) == 1.5e-3
    assert sound('load = { from = "4 mN", to = "-1 mN", cycles = 2 }').load.at(half, 1.0) == 4e-3
    assert sound('load = { file = "loads.csv" }').load.at(half, 1.0) == 1e-3
    assert sound('indentation = { file = "loads.csv" }').indentation.at(2.0 * half, 1.0) == 5e-9
    contact = sound('displacement = { file = "loads.csv" }\nstiffness = "1 kN/m"')
    assert (contact.displacement.at(half, 1.0), contact.stiffness) == (0.0, 1e3)
    assert sound('load = { time = ["0 s", "1000 ms"], value = ["1 mN", "2 mN"] }').load.at(half, 1.0) == 1.5e-3
    assert -1.0001e-4 < sound('load = { from = -1e-3, to = -1e-5, scale = "log" }').load.at(half, 1.0) < -0.9999e-4
