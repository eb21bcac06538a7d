"""Faults of a scenario: each is reported once, at its key, with one cure.

The tests hold the key of a fault and the words that carry its kind and cure, parted by ``...``.
"""

import os
import re
from pathlib import Path

import pytest
from helpers import commands
from hypothesis import HealthCheck, given, settings, strategies as st

from sim.scenario.reader import BadInput, load
from sim.scenario.scenario import Scenario

FOLDER = Path(__file__).parents[2] / "scenarios"
LENS = (
    commands.LENS.replace('"a scene"', '"lens"\nseed = 7')
    .replace('"1 s"', '"2 s"')
    .replace('"0.1 s"', '"5 ms"')
)
LENS += """\
[drive]
model = "ramp"
from = "10 um/s"
to = "100 mm/s"
scale = "log"

[bonds]
model = "rate"
critical_speed = "10 mm/s"
rebinding_rate = "500 1/s"

[shear]
model = "modal"
cell = "0.24 mm"
points = 32

[shear.spectrum]
model = "self_affine"
rms = "150 kPa"
hurst = 0.8
longest = "60 um"
rolloff = "24 um"
shortest = "16 um"

[shear.correlation]
model = "slip"
length = "5 um"

[ensemble]
members = 4
"""
BELL = """model = "cohort"
rupture = { model = "bell", zero_force_rate = "200 1/s", bell_force = "4 pN" }
bond_stiffness = "0.4 uN/m"
rebinding_rate = "400 1/s"
site_density = "1e17 1/m^2"
"""
BY_SPEED = """model = "cohort"
rupture = { model = "bell", bell_force = "4 pN", critical_speed = "3 mm/s", stress = "0.2 MPa" }
bond_stiffness = "0.8 uN/m"
rebinding_ratio = 10
"""
BY_NONE = BY_SPEED.replace(', critical_speed = "3 mm/s", stress = "0.2 MPa"', "")
CATCH = (
    BELL.replace(
        '"bell", zero_force_rate = "200 1/s", bell_force = "4 pN"',
        '"catch", slip_rate = "9 1/s", slip_force = "8 pN", catch_force = "{}", catch_rate = "{}"',
    )
    .replace("{ model", "{{ model")
    .replace(" }\n", " }}\n")
)
#: Lines of the lens that the cases replace.
RATE = 'model = "rate"\ncritical_speed = "10 mm/s"\nrebinding_rate = "500 1/s"\n'
RAMP = 'model = "ramp"\nfrom = "10 um/s"\nto = "100 mm/s"\nscale = "log"'
SHEAR = re.search(r"(?s)\[shear\].*?(?=\[ensemble\])", LENS)[0]
LOAD = 'load = "4 mN"'


@pytest.fixture
def refusal(tmp_path, monkeypatch):
    """Load the lens with parts replaced, or another text; give the problems without the name of the file."""
    monkeypatch.chdir(tmp_path)

    def refused(*edits, text=LENS, overrides=None):
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        Path("x").write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(BadInput) as fault:
            load("x", overrides, option="--set")
        assert [path.name for path in tmp_path.iterdir() if path.suffix != ".csv"] == [
            "x"
        ]
        assert all(problem.isprintable() for problem in fault.value.problems)
        return [problem.removeprefix("x: ") for problem in fault.value.problems]

    return refused


def agrees(problem, key, words):
    """True if a problem begins with a key and holds all words that are parted by dots."""
    return problem.startswith(f"{key}: " if key else "") and all(
        word in problem for word in words.split("...")
    )


UNKNOWN = [
    ('rms = "150 kPa"', 'rsm = "150 kPa"', "shear.spectrum.rsm", 'did you mean "rms"'),
    ("[sphere]", "[shpere]", "shpere", 'did you mean "sphere"'),
    (
        "points = 32",
        'points = 32\nmode_amplitudes = "fixed"',
        "shear.mode_amplitudes",
        'remove it...model = "mean"',
    ),
    (
        "[solid]",
        '[solid]\ncounter_body = { youngs_modulus = "1 GPa", poison = 0.3 }',
        "solid.counter_body.poison",
        'did you mean "poisson_ratio"',
    ),
    ("[solid]", '[solid]\nload = "1 mN"', "solid.load", 'did you mean "contact.load"'),
    ("members = 4", "members = 4\nxyz = 1", "ensemble.xyz", "known: members"),
    ("seed = 7", '"" = 7', '""', "known: clock"),
    ("seed = 7", '"\\u001b[31m\\n" = 7', "", "not a key"),
    (
        'model = "rate"',
        'model = "steady"',
        "bonds.rebinding_rate",
        'choose model = "rate", "cohort"',
    ),
]
MISSING = [
    ('[sphere]\nradius = "2 mm"', "[sphere]", "sphere.radius", 'add...radius = "2 mm"'),
    ('[sphere]\nradius = "2 mm"', "", "sphere", "add the table [sphere]"),
    (
        "members = 4",
        'members = 4\n[shear.amplitude]\nmodel = "onset"\nspeed = 1',
        "shear.amplitude.width",
        "add",
    ),
    (RAMP, 'model = "table"', "drive", 'file = "data.csv"'),
    ('model = "modal"\n', "", "shear.model", '"banded", "modal"'),
]
TABLES = [
    ('[sphere]\nradius = "2 mm"', "[[sphere]]", "sphere", "must be a table...[sphere]"),
    (RATE, BELL.replace('model = "bell", ', ""), "bonds.rupture.model", '"bell"'),
    ('model = "modal"', 'model = "modl"', "shear.model", 'did you mean "modal"'),
    (
        "[clock]",
        '[record]\nquantities = ["friction"]\n\n[clock]',
        "record.quantities",
        '"friction" is not known; did you mean "friction_force"',
    ),
    (
        'model = "slip"',
        "model = 3",
        "shear.correlation.model",
        'must be "time", "slip", "wave" or "diffusion"',
    ),
]
VALUES = [
    (
        'work = "42 mJ/m^2"',
        'work = "42 mJ"',
        "adhesion.work",
        '"mJ"...J/m^2...for example "42 mJ/m^2"',
    ),
    ("seed = 7", "seed = 18446744073709551616", "seed", "at most 18446744073709551615"),
    ('name = "lens"', "name = 5", "name", "text in quotes"),
    ('name = "lens"', f"name = '{'x' * 201}'", "name", "at most 200 letters"),
    (
        "members = 4",
        "members = 4\n[record]\nper_member = 'maybe'",
        "record.per_member",
        "true or false",
    ),
    ('from = "10 um/s"', "from = 1e-200", "drive.from", "too small"),
    (
        'rebinding_rate = "500 1/s"',
        "rebinding_rate = 5e-324",
        "bonds.rebinding_rate",
        "too small",
    ),
    ("rebinding_rate", "stress = 1e-300\nrebinding_rate", "bonds.stress", "too small"),
    ("members = 4", 'members = 4\n[record]\nmaps = "1 s"', "record.maps", "list"),
    (
        "members = 4",
        'members = 4\n[record]\nmaps = ["1 s", "2 kg"]',
        "record.maps",
        'value 2...unit "kg"',
    ),
    (
        "members = 4",
        'members = 4\n[record]\nquantities = ["contact_aria"]',
        "record.quantities",
        '"contact_area"',
    ),
    (
        LOAD,
        'load = { time = [0, 1], value = [1, "2 kg"] }',
        "contact.load.value",
        'value 2...unit "kg"',
    ),
]
TOGETHER = [
    (LOAD, f'{LOAD}\nindentation = "1 um"', "contact", "load...indentation...omit one"),
    (LOAD, "stiffness = 3", "contact", "give a load"),
    (LOAD, 'displacement = "1 um"', "contact", "stiffness"),
    (LOAD, 'load = "4 MN"', "contact.load", "check its unit"),
    (
        LOAD,
        "load = { from = 0, to = 0.004, cycles = 999 }",
        "contact.load.cycles",
        "fewer cycles",
    ),
    ('shear_modulus = "1.6 MPa"', "", "solid", "exactly one modulus"),
    ('step = "5 ms"', 'step = "3 ms"', "clock", "whole multiple...1.998 s or 2.001 s"),
    (
        'step = "5 ms"',
        'step = "5 ms"\nrecord = "3 s"',
        "clock",
        "record (3 s) is longer than duration",
    ),
    ('step = "5 ms"', 'step = "1 ns"', "clock", "1,000,000,000 steps"),
    ("points = 32", "points = 8", "shear", "at least 31 points"),
    ('cell = "0.24 mm"\npoints = 32\n', 'cell = "24 mm"\n', "shear", "modes"),
    ('cell = "0.24 mm"', 'cell = "1 um"', "shear", "no wave"),
    (
        "[sphere]",
        'thickness = "10 um"\npoisson_ratio = 0.49\n[sphere]',
        "solid",
        "incompressible...omit poisson_ratio",
    ),
    (
        "[sphere]",
        'thickness = "10 um"\ncounter_body = { youngs_modulus = 1e9 }\n[sphere]',
        "solid",
        "rigid sphere...omit counter_body",
    ),
    (
        "[sphere]",
        'thickness = "30 nm"\n[sphere]',
        "solid.thickness",
        "exceeds 80 times...thicker",
    ),
    (
        'longest = "60 um"',
        'longest = "6 um"',
        "shear.spectrum",
        "longest (6e-06 m) is shorter than rolloff",
    ),
    ('from = "10 um/s"', "from = 0", "drive", "logarithmic...zero"),
    (
        LOAD,
        "load = { time = [0, 1], value = [1] }",
        "contact.load",
        "as many values as times",
    ),
    (
        LOAD,
        "load = { time = [0, 2, 1], value = [1, 1, 1] }",
        "contact.load",
        "times must start at 0 s",
    ),
    (
        LOAD,
        "load = { time = [0, 1], value = [0, 0] }",
        "contact.load",
        "clock.duration (2 s)",
    ),
    (
        RATE,
        f"{BELL}critical_speed = 1\n",
        "bonds.critical_speed",
        'choose model = "steady"',
    ),
    (
        RATE,
        BY_SPEED + 'site_density = "1e17 1/m^2"\n',
        "bonds",
        "give either...given are...site_density",
    ),
    (
        RATE,
        BY_SPEED.replace("rebinding_ratio = 10", ""),
        "bonds",
        "give either...given are rupture.critical",
    ),
    (RATE, BY_NONE, "bonds", "give either...given are rebinding_ratio"),
    (
        RATE,
        BELL + "rebinding_ratio = 10\n",
        "bonds",
        "give either...given are...rebinding_ratio",
    ),
    (
        RATE,
        BELL.replace('site_density = "1e17 1/m^2"', ""),
        "bonds.site_density",
        "add...1e17 1/m^2",
    ),
    (
        RATE,
        BY_NONE.replace("cohort", "auto").replace("bond_stiff", "#"),
        "bonds",
        "bond_stiffness is missing",
    ),
    (
        RATE,
        BELL.replace("cohort", "auto") + 'critical_speed = "1 mm/s"\n',
        "bonds",
        "either critical_speed",
    ),
    (
        RATE,
        BELL.replace("cohort", "auto") + 'stress = "1 MPa"\n',
        "bonds",
        "omit stress",
    ),
    (
        RATE,
        RATE.replace("500", "0").replace("rate", "auto", 1),
        "bonds",
        "rebinding_rate...above 0",
    ),
    (
        RATE,
        CATCH.format("7.9 fN", "100 1/s"),
        "bonds.rupture.catch_force",
        "at least 8e-15 N...catch_rate",
    ),
    (
        SHEAR,
        '[shear]\nmodel = "mean"\nspectrum = { model = "bonds", footprint = "10 um" }\n',
        "shear.spectrum",
        'bonds.model = "cohort" or "tracked"',
    ),
    (
        "members = 4",
        'members = 4\n[shear.amplitude]\nmodel = "stress"\nreference = 1',
        "shear.amplitude",
        "bonds.stress",
    ),
    (
        "members = 4",
        "members = 4\n[record]\nmaps = [1]",
        "record.maps",
        'shear.model = "mapped"',
    ),
]


@pytest.mark.parametrize(
    "cases",
    [UNKNOWN, MISSING + TABLES, VALUES, TOGETHER],
    ids=["key", "lack", "value", "both"],
)
def test_a_fault_is_reported_once_at_its_key_with_a_cure(refusal, cases):
    for old, new, key, words in cases:
        problems = refusal((old, new))
        assert len(problems) == 1 and agrees(problems[0], key, words), (new, problems)


@pytest.mark.parametrize(
    "catch", [("8.1 fN", "100 1/s"), ("1 aN", "0 1/s")], ids=["resolved", "no catch"]
)
def test_a_weak_catch_is_read_if_it_is_resolved_or_never_opens_a_bond(tmp_path, catch):
    (tmp_path / "x").write_text(
        LENS.replace(RATE, CATCH.format(*catch)), encoding="utf-8"
    )
    assert load(tmp_path / "x").bonds.rupture.model == "catch"


def test_all_faults_of_values_come_in_one_pass(refusal):
    edits = [
        ("[drive]", "[drvie]"),
        ('rms = "150 kPa"', "rms = nan"),
        ("members = 4", "members = 0"),
    ]
    keys = [problem.split(": ")[0] for problem in refusal(*edits)]
    assert keys == ["shear.spectrum.rms", "ensemble.members", "drvie"]
    many = refusal(text="".join(f"a{number} = 1\n" for number in range(900)) + LENS)
    assert len(many) == 101 and many[-1] == "and 800 faults more"


TABLE = (RAMP, 'model = "table"\nfile = "v.csv"')


def test_a_file_that_cannot_be_used_is_named(refusal, tmp_path):
    for content, words in (
        (None, "cannot be read...relative to the scenario"),
        (b"time [s], speed [m/s]\n0, 1\n1, 1\n", "ends at 1 s...clock.duration (2 s)"),
    ):
        if content is not None:
            (tmp_path / "v.csv").write_bytes(content)
        (problem,) = refusal(TABLE)
        assert agrees(problem, "drive", words)
    (problem,) = refusal((RAMP, 'model = "table"\nfile = "."'))
    assert agrees(problem, "drive", "cannot be read")


SWEEPS = [
    ('"contact.lod" = ["1 mN"]', 'contact.lod...did you mean "load"'),
    ('"contact.load" = ["1 mN", "1 mN"]', "contact.load...twice"),
    ('"contact.load" = []', 'contact.load...["1 mN", "4 mN"]'),
    (
        '"contact.load" = { from = "1 mN", to = "2 um", count = 3 }',
        "contact.load...one dimension",
    ),
    ('"contact.load" = { from = 1, to = nan, count = 3 }', "contact.load...finite"),
    ('"contact.load" = { from = 1, to = 2 }', "contact.load...count ="),
    (
        '"contact.load" = { from = 0, to = 2, count = 3, scale = "log" }',
        "contact.load...above zero",
    ),
    ("seed = [1, 2]", "seed...ensemble.members"),
    ('"clock.duration" = ["1 s"]', "clock.duration...once for each value"),
    (
        '"bonds.model" = ["none", "rate"]',
        'bonds.model...whole table: "bonds" = [{ model',
    ),
    (
        'bonds = [{ model = "none" }]\n"bonds.stress" = [1]',
        "bonds.stress...swept twice",
    ),
    ('"clock.step" = ["5 ms", "10 ms"]', "different records...clock.record"),
    (
        'drive = [{ model = "steady", speed = "1 mm/s" }, { model = "force", force = "1 mN",'
        ' contact_stiffness = "rigid", damping = "1 mN s/m" }]\n"bonds.stress" = ["0.1 MPa"]',
        "sweep: some drives prescribe the speed...run them apart",
    ),
    (
        'bonds = [{ model = "none" }, { model = "steady" }]',
        "bonds.critical_speed...missing",
    ),
    (
        '"contact.load" = { from = "1 kg", to = "2 kg", count = 50 }',
        'contact.load...unit "kg"',
    ),
    ('"shear.cell" = ["0.24 mm", "0.3 mm"]', "shear...shortest wavelength"),
    (
        '"drive.to" = { from = 1, to = 2, count = 999 }\n"contact.load" = { from = 1, to = 2, count = 999 }',
        "20,000",
    ),
]


def test_a_fault_of_a_sweep_is_reported_at_its_key_with_a_cure(refusal):
    for text, words in SWEEPS:
        (problem,) = refusal(text=f"{LENS}[sweep]\n{text}")
        assert agrees(problem, "sweep", words), problem
    for sweep in (
        "5",
        "[]",
        "[1]",
        "[{}]",
        '[{ "contact.load" = 1 }, { "contact.lad" = 1 }]',
    ):
        (problem,) = refusal(text=f"sweep = {sweep}\n{LENS}")
        assert agrees(problem, "sweep", "must be a ")
    one, two = refusal(
        text=f'{LENS}[sweep]\n"shear.spectrum.rms" = ["1 kPa", "2 kg", -3, "4 kPa"]'
    )
    assert agrees(one, "sweep", 'shear.spectrum.rms...unit "kg"') and agrees(
        two, "sweep", "shear.spectrum.rms...above"
    )
    mapped = (
        LENS.replace('model = "modal"', 'model = "mapped"') + "[record]\nmaps = [1]\n"
    )
    (problem,) = refusal(text=f'{mapped}[sweep]\n"shear.points" = [32, 40]\n')
    assert agrees(problem, "sweep", "different maps")
    numbers = ", ".join(f"{-number}.5" for number in range(1, 301))
    assert (
        len(refusal(text=f'{LENS}[sweep]\n"solid.shear_modulus" = [1e6, {numbers}]'))
        == 100
    )


def test_a_fault_of_an_override_names_the_override(refusal):
    for key, value, words in (
        ("contact.lod", 1, 'did you mean "load"'),
        ("nope.x.y", 3, "nope: is not a key; known: clock, "),
        ("contact", 5, "must be a table"),
        ('""', 1, "is not a key"),
        (
            "contact.indentation",
            "1 um",
            "contact: a load and an indentation exclude each other",
        ),
        ('sweep."contact.load"', [1, "2 mm"], 'contact.load...unit "mm"'),
    ):
        (problem,) = refusal(overrides={key: value})
        assert agrees(problem, f"--set {key}", words)
    with pytest.raises(BadInput) as fault:
        load("x", {key: value})
    assert agrees(fault.value.problems[0], f'overrides["{key}"]', words)


def test_a_file_that_is_no_scenario_is_refused_in_one_line(refusal):
    for text, words in (
        ("# nothing but a question?\n", "`sim new`"),
        (b"\x89HDF\r\n\x1a\n", "dataset"),
        (LENS.encode("utf-16"), "UTF-8"),
        (LENS.replace('"4 mN"', "4 mN"), "TOML...line 13...in quotes"),
        (LENS.replace('"rate"', "rate"), "TOML...line 21...in quotes"),
        (LENS + "[clock]\n", "TOML...twice"),
        (LENS.replace('"lens"', '"lens'), "TOML...quotes"),
        ("a = [1, 2\n", "TOML...bracket"),
        ("a = " + "[" * 10_000, "nested too deeply"),
        ("y = " + "1" * 5000, "too long"),
        ("#" * 2**21, "1 MiB"),
    ):
        (problem,) = refusal(text=text)
        assert agrees(problem, "", words)
    for text in (
        "a = " + "[" * 100 + "]" * 100,
        "\n[" + "a." * 300 + "a]\n",
        "y = 0x" + "1" * 5000,
    ):
        # which the parser takes
        assert any("is not a key" in problem for problem in refusal(text=text))


def test_a_missing_file_a_folder_and_a_broken_name_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, words in (
        ("nope.toml", "no such file...`sim new`"),
        (".", "cannot be read"),
        ("a\0b", "a\\x00b...cannot be read"),
        ("x" * 300, "cannot be read" if os.name == "posix" else "no such file"),
    ):
        with pytest.raises(BadInput) as fault:
            load(name)
        assert agrees(*fault.value.problems, "", words)
    assert not list(tmp_path.iterdir())


BESIDE = {
    "speeds.csv": "time [s], speed [mm/s]\n0, 1\n1, 2\n",
    "psd.csv": "q [rad/m], C [Pa^2 m^2]\n1e5, 1\n2e5, 1\n",
    "map.csv": "\n".join(
        ",".join(str((7 * i * i + 3 * i * j) % 11) for i in range(10))
        for j in range(10)
    ),
    **{
        path.name: path.read_text(encoding="utf-8")
        for path in sorted(FOLDER.glob("*.csv"))
    },
}
FILES = """
[drive]
model = "table"
file = "speeds.csv"
[shear]
model = "modal"
points = 50
spectrum = { model = "tabulated", file = "psd.csv", normalization = "in_density" }
correlation = { model = "wave", waves = 2.0 }
[[sweep]]
"shear.spectrum" = { model = "measured", file = "map.csv", spacing = "8 um" }
[[sweep]]
"shear.spectrum" = { model = "von_karman", rms = "1 kPa", length = "10 um", hurst = 0.5 }
"""
TEXTS = [path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.toml"))]
TEXTS.append(
    re.sub(r"(?s)\[drive\].*?(?=\[ensemble\])", "", LENS).replace('"2 s"', '"1 s"')
    + FILES
)
VALUE, KEY, TITLE = r"(?m)(?<== )[^\n#]+", r"(?m)^\w+(?= =)", r"(?m)^\[.*\]$"
NASTY = [
    "nan",
    "-1",
    "0",
    "1e400",
    "1e-59",
    "9" * 400,
    "true",
    "[]",
    "{}",
    '""',
    '"-1 m"',
    '"1e300 kg"',
    '"2 MPa"',
    "x",
    '"\\u001b[2J"',
    "1979-05-27",
    '{ model = "modal" }',
    "{ from = 1, to = 2, count = 3 }",
    '["1 mN", "2 kg", -3]',
    '"m^9^9^9"',
    '"mapped"',
    '"counted"',
    '"/dev/zero"',
    '"no.csv"',
    '"psd.csv"',
    "10000000",
    '"1 ns"',
    '"1 km"',
    "a",
    "load",
    "model",
    "[clock]",
    "[[sweep]]",
    "",
    "\x00",
    "\n",
]
DAMAGE = st.tuples(
    st.sampled_from([VALUE, KEY, TITLE, ".", r"\d+"]),
    st.floats(0, 1),
    st.sampled_from(NASTY),
)


@settings(
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(st.sampled_from([*TEXTS, *BESIDE.values()]), st.lists(DAMAGE, max_size=4))
def test_a_damaged_scenario_or_table_is_read_or_refused_in_plain_lines(
    tmp_path, text, damages
):
    damaged = text
    for pattern, share, word in damages:
        if places := list(re.finditer(pattern, damaged)):
            place = places[int(share * (len(places) - 1))]
            damaged = damaged[: place.start()] + word + damaged[place.end() :]
    for name, content in BESIDE.items():
        (tmp_path / name).write_text(
            damaged if content == text else content, encoding="utf-8"
        )
    path = tmp_path / "x.toml"
    path.write_text(damaged if text in TEXTS else TEXTS[-1], encoding="utf-8")
    try:
        assert isinstance(load(path), Scenario)
    except BadInput as refused:
        assert damages and refused.problems
        assert all(
            problem.startswith(f"{path}: ") and problem.isprintable()
            for problem in refused.problems
        )
