"""What a scenario file can get wrong: each fault once, at its line and key, with the cure.

The tests hold a fault's place and the words that carry its kind and cure; the sentences themselves are golden
only in GOLDEN.
"""

import os
import re
from pathlib import Path

import pytest

from sim.scenario.reader import BadInput, load

LENS = """\
name = "lens"
seed = 7

[clock]
duration = "2 s"
step = "5 ms"

[solid]
shear_modulus = "1.6 MPa"

[sphere]
radius = "2 mm"

[adhesion]
work = "42 mJ/m^2"

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

[contact]
load = "4 mN"

[ensemble]
members = 4
"""
LINES = LENS.splitlines()
END = len(LINES)


def line_of(text):
    """Where a line of the lens stands."""
    return LINES.index(text) + 1


@pytest.fixture
def refusal(tmp_path, monkeypatch):
    """Load the lens with parts replaced, or another text, and give the problems with "x" for the file."""
    monkeypatch.chdir(tmp_path)

    def refused(*edits, text=LENS, overrides=None):
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        before = set(tmp_path.iterdir())
        Path("x").write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(BadInput) as fault:
            load("x", overrides, option="--set")
        assert set(tmp_path.iterdir()) == before | {tmp_path / "x"}
        return fault.value.problems

    return refused


def told(problem, line, key, words):
    """Whether a problem is told at a line and key with some words, parted by `...`."""
    start = f"x:{line}: {key}: " if line else f"{key}: "
    return problem.startswith(start) and all(word in problem[len(start) :] for word in words.split("..."))


# --- some sentences as they are ---

GOLDEN = [
    ('rms = "150 kPa"', 'rsm = "150 kPa"', 'shear.spectrum.rsm: is not a key; did you mean "rms"?'),
    ('load = "4 mN"', 'load = "4 MN"', "contact.load: makes a contact of 0.0979 m on a sphere of 0.002 m radius, for "
     "which no theory holds; check its unit, and those of sphere, adhesion and solid"),
    ('step = "5 ms"', 'step = "5 ms"\nload = 1', 'clock.load: is not a key here; did you mean "contact.load"?'),
    ("members = 4", "members = 4\nxyz = 1", "ensemble.xyz: is not a key; known: members"),
    ('rebinding_rate = "500 1/s"', 'healing = "500 1/s"', 'bonds.healing: is now called "rebinding_rate"'),
    ('model = "rate"', 'model = "steady"', 'bonds.rebinding_rate: is not a key of model = "steady"; remove it, or '
     'choose model = "rate", "cohort", "counted", "tracked" or "auto"'),
    ('model = "modal"', 'model = "modl"', 'shear.model: must not be "modl"; did you mean "modal"?'),
    ('model = "slip"', 'model = "magnetic"', 'shear.correlation.model: must be "time", "slip", "wave" or "diffusion", '
     'not "magnetic"'),
    ('work = "42 mJ/m^2"', 'work = "42 mJ"', 'adhesion.work: has the unit "mJ", which is not a unit of J/m^2; write '
     'for example "42 mJ/m^2"'),
    ('radius = "2 mm"', 'radius = "9.4"', 'sphere.radius: is text without a unit; write for example "2 mm", or '
     "a bare number in m"),
    ('radius = "2 mm"', 'radius = "-2 mm"', "sphere.radius: must be above 0 m, not -0.002 m"),
    ('[sphere]\nradius = "2 mm"', "[sphere]", 'sphere.radius: is missing; add for example radius = "2 mm"'),
    ("members = 4", "members = 4.5", "ensemble.members: must be a whole number such as 64, not 4.5"),
    ('step = "5 ms"', 'step = "3 ms"', "clock: duration (2 s) must be a whole multiple of step (0.003 s), such as "
     "1.998 s or 2.001 s"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), GOLDEN, ids=[row[2].split(":")[0] for row in GOLDEN])
def test_a_fault_is_one_sentence_with_place_and_cure(refusal, old, new, said):
    (problem,) = refusal((old, new))
    assert re.fullmatch(r"x:\d+: " + re.escape(said), problem), problem


# --- keys ---


@pytest.mark.parametrize(
    ("line", "wrong", "key", "meant"),
    [
        ('step = "5 ms"', 'stpe = "5 ms"', "clock.stpe", "step"),
        ("seed = 7", "sede = 7", "sede", "seed"),
        ('critical_speed = "10 mm/s"', 'crit_speed = "10 mm/s"', "bonds.crit_speed", "critical_speed"),
        ("[sphere]", "[shpere]", "shpere", "sphere"),
        ("[shear.correlation]", "[shear.corelation]", "shear.corelation", "correlation"),
        ("members = 4", "member = 4", "ensemble.member", "members"),
        ('model = "slip"', 'modle = "slip"', "shear.correlation.modle", "model"),
        ('model = "ramp"', 'modle = "ramp"', "drive.modle", "model"),
        ('model = "ramp"\nfrom', 'model = "ramp"\nfrm', "drive.frm", "from"),
    ],
)
def test_a_misspelt_key_is_told_once_with_the_one_meant(refusal, line, wrong, key, meant):
    (problem,) = refusal((line, wrong))
    at = line_of(line.split("\n")[-1]) if "\n" not in line else line_of('from = "10 um/s"')
    assert told(problem, at, key, f'did you mean "{meant}"')


@pytest.mark.parametrize(
    ("added", "key", "meant"),
    [
        ('counter_body = { youngs_modulus = "1 GPa", poison = 0.3 }', "solid.counter_body.poison", "poisson_ratio"),
        ('load = "1 mN"', "solid.load", "contact.load"),
        ("members = 3", "solid.members", "ensemble.members"),
        ('rms = "1 kPa"', "solid.rms", "shear.spectrum.rms"),
        ('cell = "1 mm"', "solid.cell", "shear.cell"),
    ],
)
def test_a_key_of_another_table_or_of_an_inline_one_is_told_with_the_one_meant(refusal, added, key, meant):
    (problem,) = refusal(("[solid]", f"[solid]\n{added}"))
    assert told(problem, line_of("[solid]") + 1, key, f'did you mean "{meant}"')


def test_strange_keys_stay_on_one_line_and_reach_no_terminal(refusal):
    found = refusal(text='"" = 1\n"a b" = 2\n"\\u001b[31m" = 3\n"x\\ny" = 4\nsource = 5\n' + LENS)
    assert len(found) == 5
    assert all(problem.isprintable() for problem in found)


#: Every name of 0.1.0 that a scenario could hold: what it stood in, and its present name.
OLD = [
    ('rebinding_rate = "500 1/s"', 'healing = "500 1/s"', "bonds.healing", "rebinding_rate"),
    ("[shear.correlation]", "[shear.memory]", "shear.memory", "correlation"),
    ("[contact]", '[shear.growth]\nmodel = "constant"\n[contact]', "shear.growth", "amplitude"),
    ("points = 32", 'amplitudes = "fixed"', "shear.amplitudes", "mode_amplitudes"),
    ('load = "4 mN"', 'load = "4 mN"\non_detach = "stop"', "contact.on_detach", "after_pull_off"),
    ('load = "4 mN"', 'travel = "1 um"\nstiffness = 1', "contact.travel", "displacement"),
    ('load = "4 mN"', "load = { from = 1, to = 2, trips = 2 }", "contact.load.trips", "cycles"),
    ('load = "4 mN"', 'load = 1\nmodel = "lagging"', "contact.model", "rate_dependent"),
    ('critical_speed = "10 mm/s"', 'hazard = { model = "bell" }', "bonds.hazard", "rupture"),
    ('rms = "150 kPa"\nhurst = 0.8\nlongest = "60 um"\nrolloff = "24 um"\nshortest = "16 um"',
     'wavenumbers = [1, 2]\ndensities = [1, 1]\nconvention = "menga"', "shear.spectrum.convention", "normalization"),
    ('rms = "150 kPa"\nhurst = 0.8\nlongest = "60 um"\nrolloff = "24 um"\nshortest = "16 um"',
     'wavenumbers = [1, 2]\ndensities = [1, 1]\nnormalization = "persson"', "shear.spectrum.normalization",
     "in_density"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "key", "now"), OLD, ids=[row[2] for row in OLD])
def test_an_old_key_or_word_is_answered_with_its_present_name(refusal, old, new, key, now):
    edits = [('model = "self_affine"', 'model = "tabulated"')] if "wavenumbers" in new else []
    problems = refusal(*edits, (old, new))
    (problem,) = [problem for problem in problems if "is now called" in problem]
    text = LENS.replace(*edits[0]) if edits else LENS
    lines = text.replace(old, new, 1).splitlines()
    at = int(problem.split(":")[1])
    assert told(problem, at, key, f'is now called "{now}"')
    assert re.search(rf"\b{key.split('.')[-1]}\b", lines[at - 1])
    assert not any(f".{now}: is missing" in other for other in problems)


def test_an_old_key_of_a_sweep_or_of_an_override_is_answered_too(refusal):
    (problem,) = refusal(text=LENS + '[sweep]\n"contact.travel" = [1, 2]\n')
    assert told(problem, END + 2, 'sweep."contact.travel"', 'is now called "contact.displacement"')
    (problem,) = refusal(overrides={"shear.memory.length": 1})
    assert told(problem, 0, "--set shear.memory.length", 'shear.memory is now called "correlation"')


# --- missing ---


def test_missing_keys_and_tables_are_told_with_an_example(refusal):
    text = '[clock]\nduration = "1 s"\n[solid]\n[contact]\nload = 0\n'
    text += '[bonds]\nmodel = "counted"\n[shear]\nmodel = "modal"\n'
    found = refusal(text=text)
    for line, key, words in (
        (0, "sphere", "is missing...[sphere] with radius"),
        (0, "adhesion", "is missing...[adhesion] with work"),
        (1, "clock.step", 'is missing...step = "10 ms"'),
        (3, "solid", 'shear_modulus = "1.6 MPa" or youngs_modulus = "4.8 MPa"'),
        (6, "bonds.rebinding_rate", 'is missing...rebinding_rate = "500 1/s"'),
        (6, "bonds.sites", "is missing...sites = 64"),
        (8, "shear.spectrum", 'is missing...[shear.spectrum] with model = "ripple", '),
        (8, "shear.correlation", 'is missing...model = "time", "slip", "wave" or "diffusion"'),
    ):
        key = key if line else f"x: {key}"
        assert any(told(problem, line, key, words) for problem in found), key


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ('[bonds]\nmodel = "rate"', "[bonds]", "bonds.model", 'choose "rate", "counted" or "auto"'),
        ('model = "ramp"\n', "", "drive.model", 'choose "ramp"'),
        ('model = "modal"\n', "", "shear.model", 'choose "banded", "modal", "mapped" or "auto"'),
        ('model = "slip"\n', "", "shear.correlation.model", 'choose "slip"'),
        ('model = "self_affine"\n', "", "shear.spectrum.model", 'choose "self_affine"'),
    ],
)
def test_a_model_that_cannot_be_known_is_told_with_those_that_have_the_keys(refusal, old, new, key, words):
    (problem,) = refusal((old, new))
    assert told(problem, line_of(f"[{key.removesuffix('.model')}]"), key, f"is missing...{words}")


def test_a_table_of_text_is_told_how_it_is_written(refusal):
    text = 'drive = "steady"\n' + re.sub(r"(?s)\[drive\].*?\n\n", "", LENS)
    (problem,) = refusal(text=text)
    assert told(problem, 1, "drive", 'must be a table...drive = { model = "steady" }')
    for old, new, words in (
        ('[sphere]\nradius = "2 mm"', 'sphere = "2 mm"', "must be a table...[sphere]"),
        ("[ensemble]\nmembers = 4", "ensemble = 4", "must be a table...[ensemble]"),
    ):
        (problem,) = refusal(text=f"{new}\n{LENS.replace(old, '')}")
        assert told(problem, 1, new.split(" ")[0], words)
    (problem,) = refusal(("[sphere]", "[[sphere]]"))
    assert told(problem, line_of("[sphere]"), "sphere", "one table...[sphere]")


# --- values ---


@pytest.mark.parametrize(
    ("line", "wrong", "words"),
    [
        ('work = "42 mJ/m^2"', 'work = "42 mJx/m^2"', 'unknown unit "mJx/m^2"...did you mean "mJ/m^2"'),
        ('radius = "2 mm"', 'radius = "2 MPa"', 'unit "MPa"...not a unit of m'),
        ('radius = "2 mm"', 'radius = "0"', "without a unit"),
        ('radius = "2 mm"', "radius = nan", "finite"),
        ('radius = "2 mm"', "radius = -inf", "finite"),
        ('radius = "2 mm"', "radius = 0", "above 0 m"),
        ('radius = "2 mm"', 'radius = ""', 'such as "2 mm"'),
        ('radius = "2 mm"', "radius = true", "must be a number...not true"),
        ('radius = "2 mm"', "radius = [2]", "must be a number...not a list"),
        ('radius = "2 mm"', "radius = { a = 1 }", "must be a number...not a table"),
        ('radius = "2 mm"', "radius = 1979-05-27", "must be a number...not a date"),
        ('radius = "2 mm"', "radius = 0x" + "1" * 5000, "too large"),
        ("hurst = 0.8", "hurst = 1.5", "at most 1"),
        ("hurst = 0.8", "hurst = false", "must be a number...not false"),
        ("members = 4", "members = 0", "at least 1"),
        ("members = 4", 'members = "many"', 'whole number...not "many"'),
        ("members = 4", "members = true", "whole number...not true"),
        ("members = 4", "members = 0x" + "1" * 5000, "at most 10000000"),
        ("points = 32", "points = true", "whole number...not true"),
        ("seed = 7", "seed = -1", "at least 0"),
        ("seed = 7", "seed = 18446744073709551616", "at most 18446744073709551615, not 18446744073709551616"),
        ('name = "lens"', "name = 5", "text in quotes...not 5"),
        ('name = "lens"', "name = 0x" + "1" * 5000, "text in quotes...many digits"),
        ('name = "lens"', f'name = "{"x" * 201}"', "longer than 200 characters"),
        ('scale = "log"', 'scale = "logarithmic"', 'must be "linear" or "log"'),
        ('scale = "log"', 'scale = "lin"', 'did you mean "linear"'),
    ],
)
def test_a_bad_value_is_told_with_its_key_and_the_cure(refusal, line, wrong, words):
    (problem,) = refusal((line, wrong))
    table = next((text for text in reversed(LINES[: line_of(line)]) if text.startswith("[")), "")
    key = ".".join(filter(None, (table.strip("[]"), wrong.partition(" ")[0])))
    assert told(problem, line_of(line), key, words)


@pytest.mark.parametrize(
    "zero", ["duration", "step", "shear_modulus", "radius", "critical_speed", "rebinding_rate", "length"]
)
def test_nothing_that_divides_may_be_zero(refusal, zero):
    line = next(line for line in LINES if line.startswith(f"{zero} = "))
    (problem,) = refusal((line, f"{zero} = 0"))
    assert f"{zero}: must be above 0 " in problem


def test_lists_and_choices_of_the_record_are_checked(refusal):
    text = '[record]\nper_member = "maybe"\nmaps = "1 s"\nprecision = "double"\nmap_members = 0\n'
    found = refusal(text=LENS + text)
    for line, (key, words) in enumerate(
        (
            ("per_member", "true or false"),
            ("maps", 'a list such as ["1 s"]'),
            ("precision", '"float64" or "float32"'),
            ("map_members", "at least 1"),
        ),
        start=END + 2,
    ):
        assert told(found[line - END - 2], line, f"record.{key}", words)
    (problem,) = refusal(text=LENS + '[record]\nquantities = "speed"\n')
    assert told(problem, END + 2, "record.quantities", 'a list such as ["speed"]')
    (problem,) = refusal(text=LENS + "[record]\nmaps = 1.0\n")
    assert told(problem, END + 2, "record.maps", "a list")
    (problem,) = refusal(text=LENS + '[record]\nmaps = ["1 s", "2 kg"]\n')
    assert told(problem, END + 2, "record.maps", 'value 2: ...unit "kg"')
    (problem,) = refusal(text=LENS + '[record]\nquantities = ["speed", "contact_aria"]\n')
    assert told(problem, END + 2, "record.quantities", 'value 2: ..."contact_aria"...did you mean "contact_area"')


# --- what does not go together ---


@pytest.mark.parametrize(
    ("edits", "table", "words"),
    [
        ([('load = "4 mN"', 'load = "4 mN"\nindentation = "1 um"')], "contact", "load...indentation...leave one"),
        ([('load = "4 mN"', "")], "contact", "load...indentation...give"),
        ([('shear_modulus = "1.6 MPa"', "")], "solid", "exactly one modulus...none is"),
        ([('shear_modulus = "1.6 MPa"', "shear_modulus = 1\nyoungs_modulus = 1")], "solid", "one modulus...both are"),
        ([('step = "5 ms"', 'step = "5 ms"\nrecord = "7 ms"')], "clock", "record...whole multiple of step"),
        ([('step = "5 ms"', 'step = "5 ms"\nrecord = "0.3 s"')], "clock", "duration...multiple of record...1.8 s"),
        ([('step = "5 ms"', 'step = "3 s"')], "clock", "step (3 s) is longer than duration (2 s)...shorten"),
        ([('step = "5 ms"', 'step = "5 ms"\nrecord = "3 s"')], "clock", "record (3 s) is longer than duration"),
        ([('step = "5 ms"', 'step = "1 s"\nrecord = "0.5 s"')], "clock", "record (0.5 s)...multiple of step...1 s"),
        ([('step = "5 ms"', 'step = "1 ns"')], "clock", "1,000,000,000 steps...longer"),
        ([('step = "5 ms"', 'step = "100 ns"')], "clock", "10,000,000 records...record"),
        ([("points = 32", "points = 8")], "shear", "at least 31 points...more points"),
        ([('cell = "0.24 mm"', 'cell = "24 mm"'), ("points = 32\n", "")], "shear", "modes...2.1e+06"),
        ([('cell = "0.24 mm"', 'cell = "240 km"'), ("points = 32\n", "")], "shear", "waves along a side"),
        ([('cell = "0.24 mm"', 'cell = "1 um"')], "shear", "no wave...cell"),
        ([('longest = "60 um"', 'longest = "6 um"')], "shear.spectrum", "longest (6e-06 m) is shorter than rolloff"),
        ([('from = "10 um/s"', "from = 0")], "drive", "logarithmic...zero"),
    ],
)
def test_what_does_not_go_together_is_told_at_its_table(refusal, edits, table, words):
    (problem,) = refusal(*edits)
    assert told(problem, line_of(f"[{table}]"), table, words)


def test_faults_between_parts_are_told_beside_those_of_values(refusal):
    text = LENS.replace('"42 mJ/m^2"', '"42 mJ"') + '[record]\nmaps = ["1 s"]\nmap_members = 5\n'
    one, two, three = refusal(text=text)
    assert told(one, line_of("[adhesion]") + 1, "adhesion.work", 'unit "mJ"')
    assert told(two, END + 2, "record.maps", 'shear.model = "mapped"')
    assert told(three, END + 3, "record.map_members", "ensemble.members (4)")


def test_maps_are_drawn_at_recorded_times_only(refusal):
    text = LENS.replace('model = "modal"', 'model = "mapped"') + '[record]\nmaps = ["1 s", "3 ms"]\n'
    (problem,) = refusal(text=text)
    assert told(problem, END + 2, "record.maps", "0.003 s...whole multiples of 0.005 s up to 2 s")


def test_an_amplitude_with_the_stress_needs_a_stress(refusal):
    (problem,) = refusal(text=LENS + '[shear.amplitude]\nmodel = "stress"\nreference = "1 MPa"\n')
    assert told(problem, END + 1, "shear.amplitude", "bonds.stress")


def test_all_faults_come_in_one_pass_in_the_order_of_the_file(refusal):
    found = refusal(
        ('duration = "2 s"', 'duration = "2 m"'),
        ('shear_modulus = "1.6 MPa"', "shear_modulus = -1"),
        ("[drive]", "[drvie]"),
        ('rms = "150 kPa"', "rms = nan"),
        ('length = "5 um"', 'lenght = "5 um"'),
        ('load = "4 mN"', 'load = "4 mN"\nindentation = "1 um"'),
        ("members = 4", "members = 0"),
    )
    keys = [problem.split(": ")[1] for problem in found]
    wanted = ["clock.duration", "solid.shear_modulus", "drvie", "shear.spectrum.rms", "shear.correlation.lenght"]
    assert keys == [*wanted, "contact", "ensemble.members"]
    numbers = [int(problem.split(":")[1]) for problem in found]
    assert numbers == sorted(numbers)


@pytest.mark.parametrize(
    ("held", "words"),
    [('load = "-1 N"', "beyond pull-off of -0.000396 N...shear.cell"), ('indentation = "-1 mm"', "beyond pull-off")],
)
def test_a_contact_that_is_open_at_rest_is_blamed_on_what_holds_it(refusal, held, words):
    (problem,) = refusal(('cell = "0.24 mm"\n', ""), ('load = "4 mN"', held))
    assert told(problem, line_of('load = "4 mN"') - 1, f"contact.{held.split(' ')[0]}", words)


# --- bonds with a stretch ---

BELL = 'rupture = { model = "bell", zero_force_rate = "200 1/s", bell_force = "4 pN" }'
STRETCHED = [BELL, 'bond_stiffness = "0.4 uN/m"', 'rebinding_rate = "400 1/s"', 'site_density = "1e17 1/m^2"']
LINEAR = ['critical_speed = "10 mm/s"', 'rebinding_rate = "500 1/s"']
BONDS = line_of("[bonds]")


def bonded(model, *lines, shear=None):
    """The lens with other bonds, whose lines begin two below their table, and another shear part."""
    text = LENS.replace("\n".join(['model = "rate"', *LINEAR]), "\n".join([f'model = "{model}"', *lines]))
    if shear is not None:
        text = re.sub(r"(?s)\[shear\].*?(?=\[contact\])", "[shear]\n" + "\n".join(shear) + "\n\n", text)
    return text


@pytest.mark.parametrize("model", ["rate", "cohort", "tracked"])
def test_bonds_with_a_stretch_are_told_which_keys_they_lack(refusal, model):
    sites = ["sites = 50"] if model == "tracked" else []
    (problem,) = refusal(text=bonded(model, *STRETCHED[1:], *sites))
    assert told(problem, BONDS, "bonds.rupture", 'is missing...[bonds.rupture]..."bell"')
    found = refusal(text=bonded(model, BELL, *sites))
    lacking = ("bond_stiffness", "rebinding_rate", "site_density")
    assert all(told(said, BONDS, f"bonds.{key}", "is missing") for said, key in zip(found, lacking, strict=True))


@pytest.mark.parametrize(
    ("rupture", "key", "words"),
    [
        ('{ model = "bel", bell_force = 1 }', "rupture.model", 'did you mean "bell"'),
        ('{ model = "arrhenius" }', "rupture.model", '"constant"..."bell"..."cut_off"'),
        ("{ rate = 1 }", "rupture.model", 'is missing; choose "constant" or "cut_off"'),
        ('"bell"', "rupture", 'must be a table...rupture = { model = "bell" }'),
        ('{ model = "bell", zero_force_rate = 1 }', "rupture.bell_force", "is missing"),
        ('{ model = "constant" }', "rupture.rate", "is missing"),
        ('{ model = "cut_off" }', "rupture.stretch", "is missing"),
        ('{ model = "bell", zero_force_rate = 1, bell_force = "4 pN/m" }', "rupture.bell_force", "not a unit of N"),
        ('{ model = "bell", zero_force_rate = 0, bell_force = 1 }', "rupture.zero_force_rate", "above 0"),
        ('{ model = "cut_off", stretch = "-1 nm" }', "rupture.stretch", "above 0"),
        ('{ model = "cut_off", stretch = 1, rate = -1 }', "rupture.rate", "at least 0"),
        ('{ model = "bell", zero_force_rate = 1, bell_force = 1, stretch = 1 }', "rupture.stretch",
         'not a key of model = "bell"..."cut_off"'),
    ],
)  # fmt: skip
@pytest.mark.parametrize("model", ["rate", "cohort", "auto"])
def test_a_bad_rupture_is_told_with_its_key_and_the_cure(refusal, model, rupture, key, words):
    (problem,) = refusal(text=bonded(model, f"rupture = {rupture}", *STRETCHED[1:]))
    assert told(problem, BONDS + 2, f"bonds.{key}", words)


@pytest.mark.parametrize(
    ("model", "added", "words"),
    [
        ("rate", 'critical_speed = "1 mm/s"', "does not go with rupture"),
        ("rate", 'stress = "1 MPa"', "does not go with rupture"),
        ("rate", "tolerance = 0.1", 'not a key of model = "rate"..."cohort"'),
        ("cohort", 'critical_speed = "1 mm/s"', 'not a key of model = "cohort"..."rate"'),
        ("cohort", 'stress = "1 MPa"', 'not a key of model = "cohort"'),
        ("cohort", "sites = 5", 'not a key of model = "cohort"..."tracked"'),
        ("cohort", "tolerance = 0", "at least 1e-12"),
        ("cohort", "tolerance = 0.1", "below 0.1"),
        ("cohort", 'area = "carry"', 'did you mean "carried"'),
        ("cohort", 'area = "old"', '"present" or "carried"'),
        ("cohort", 'start = "resting"', '"steady", "bonded" or "empty"'),
        ("tracked", "sites = 0", "at least 1"),
        ("tracked", "sites = 10_000_000", "at most 1000000"),
        ("tracked", "sites = 2.5", "whole number"),
        ("auto", "sites = 0", "at least 1"),
        ("auto", "tolerance = 0", "above 0"),
        ("auto", "tolerance = 1", "below 1"),
    ],
)
def test_a_bad_key_of_bonds_with_a_stretch_is_told_with_the_cure(refusal, model, added, words):
    (problem,) = refusal(text=bonded(model, *STRETCHED, added))
    assert told(problem, BONDS + 6, f"bonds.{added.split(' ')[0]}", words)


def test_tracked_bonds_without_a_number_or_with_an_area_are_told(refusal):
    (problem,) = refusal(text=bonded("tracked", *STRETCHED))
    assert told(problem, BONDS, "bonds.sites", "is missing...sites = 64")
    (problem,) = refusal(text=bonded("tracked", *STRETCHED, "sites = 5", 'area = "carried"'))
    assert told(problem, BONDS + 7, "bonds.area", 'not a key of model = "tracked"')


EITHER = "either critical_speed and rebinding_rate, or rupture, bond_stiffness, rebinding_rate and site_density"


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], EITHER),
        (["sites = 3"], EITHER),
        ([LINEAR[0], *STRETCHED], EITHER),
        ([LINEAR[0], STRETCHED[1]], EITHER),
        (LINEAR[:1], "rebinding_rate is missing"),
        (LINEAR[1:], EITHER),
        (STRETCHED[:3], "site_density is missing"),
        ([*STRETCHED, 'stress = "1 MPa"'], "leave stress out"),
    ],
)
def test_bonds_left_open_take_the_keys_of_one_kind(refusal, lines, words):
    (problem,) = refusal(text=bonded("auto", *lines))
    assert told(problem, BONDS, "bonds", words)


MADE = ['model = "mean"', 'spectrum = { model = "bonds", footprint = "10 um" }']
CELLED = [MADE[1], 'correlation = { model = "time", time = "1 ms" }', 'cell = "0.24 mm"']


@pytest.mark.parametrize(
    ("shear", "key", "words"),
    [
        ([MADE[0], 'spectrum = { model = "bonds" }'], "shear.spectrum.footprint", "is missing"),
        ([MADE[0], 'spectrum = { model = "bonds", footprint = 0 }'], "shear.spectrum.footprint", "above 0 m"),
        ([MADE[0], 'spectrum = { model = "bonds", footprint = "1 um", rms = 1 }'], "shear.spectrum.rms",
         'not a key of model = "bonds"'),
        ([*MADE, 'amplitude = { model = "onset", speed = 1, width = 0.1 }'], "shear", "leave amplitude out"),
        (['model = "banded"', *CELLED], "shear", "bonds...bands"),
        (['model = "modal"', *CELLED, "points = 32", 'mode_amplitudes = "fixed"'], "shear", '"gaussian"'),
        (['model = "modal"', *CELLED], "shear", "shortest wavelength...give points"),
        ([MADE[0], 'spectrum = { model = "bonds", footprint = "10 fm" }'], "bonds.bond_stiffness",
         "7.9e-08 N/m...shear.spectrum.footprint"),
    ],
)  # fmt: skip
def test_a_field_that_bonds_cannot_make_is_told(refusal, shear, key, words):
    (problem,) = refusal(text=bonded("cohort", *STRETCHED, shear=shear))
    assert told(problem, int(problem.split(":")[1]), key, words)


@pytest.mark.parametrize(
    ("model", "lines"),
    [
        ("none", ['stress = "1 MPa"']),
        ("rate", [*LINEAR, 'stress = "1 MPa"']),
        ("counted", [*LINEAR, 'stress = "1 MPa"', "sites = 5"]),
        ("auto", [*LINEAR, 'stress = "1 MPa"']),
        ("rate", STRETCHED),
    ],
)
def test_a_field_of_bonds_whose_forces_are_not_known_is_told_with_the_models_that_know(refusal, model, lines):
    (problem,) = refusal(text=bonded(model, *lines, shear=MADE))
    assert told(problem, int(problem.split(":")[1]), "shear.spectrum", 'bonds.model = "cohort" or "tracked"')


@pytest.mark.parametrize(
    ("lines", "at", "key", "words"),
    [
        (['rest = "-1 s"', "speed = 1"], 2, "rest", "at least 0 s"),
        (["rest = 1", 'speed = "1 N"'], 3, "speed", "not a unit of m/s"),
        (["speed = 1"], 0, "rest", "is missing"),
        (["rest = 1", "speed = 1", "to = 3"], 4, "to", 'not a key of model = "start"..."ramp"'),
    ],
)
def test_a_bad_start_is_told(refusal, lines, at, key, words):
    drive = "\n".join(["[drive]", 'model = "start"', *lines, "", ""])
    (problem,) = refusal(text=re.sub(r"(?s)\[drive\].*?(?=\[bonds\])", drive, LENS))
    assert told(problem, line_of("[drive]") + at, f"drive.{key}", words)


# --- files that a scenario names ---

TABLE = ('model = "ramp"\nfrom = "10 um/s"\nto = "100 mm/s"\nscale = "log"', 'model = "table"\nfile = "v.csv"')


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read (No such file or directory)...relative to the scenario"),
        ("", "the table is empty...header"),
        ("time [s]\n0\n", 'line 1: column "speed" is missing...header'),
        ("time [s], speed [kg]\n0, 1\n", 'line 1: column "speed"...not a unit of m/s'),
        ("time [s], speed [m/s]\n0, 1\n2, fast\n", "line 3: speed is not a number...plain number"),
        ("time [s], speed [m/s]\n0, 1\n2\n", "line 3: 1 cells...2"),
        (b"time [s], speed [m/s]\n0, \xff\n", "UTF-8"),
    ],
)
def test_a_broken_table_is_told_with_its_file_and_line(refusal, tmp_path, content, words):
    if content is not None:
        (tmp_path / "v.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    (problem,) = refusal(TABLE)
    assert told(problem, line_of("[drive]") + 2, "drive.file", f"v.csv...{words}")


def test_times_of_a_table_cover_the_run_in_order(refusal, tmp_path):
    for content, words in (
        ("time [s], speed [m/s]\n0, 1\n1, 1\n", "ends at 1 s...clock.duration (2 s)"),
        ("time [s], speed [m/s]\n2, 1\n1, 1\n", "start at 0 s"),
    ):
        (tmp_path / "v.csv").write_text(content)
        (problem,) = refusal(TABLE)
        assert told(problem, line_of("[drive]"), "drive", words)


def test_a_table_without_its_file_is_told(refusal):
    (problem,) = refusal((TABLE[0], 'model = "table"'))
    assert told(problem, line_of("[drive]"), "drive.file", 'is missing...file = "data.csv"')
    (problem,) = refusal((TABLE[0], 'model = "table"\nfile = 5'))
    assert told(problem, line_of("[drive]") + 2, "drive.file", "text in quotes")


@pytest.mark.parametrize("name", ["/dev/zero", ".", "a\\u0000b"])
def test_only_plain_files_are_read(refusal, name):
    (problem,) = refusal((TABLE[0], f'model = "table"\nfile = "{name}"'))
    assert "cannot be read (" in problem


# --- sweeps ---

LOAD = 'sweep."contact.load"'


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        ('"contact.lod" = ["1 mN"]', 'sweep."contact.lod"', 'did you mean "contact.load"'),
        ('"contcat.load" = ["1 mN"]', 'sweep."contcat.load"', 'did you mean "contact.load"'),
        ('contact.lod = ["1 mN"]', 'sweep."contact.lod"', 'did you mean "contact.load"'),
        ('"contact.load" = ["1 mN", "2 mN", "1 mN"]', LOAD, "1 mN twice...once"),
        ('"contact.load" = []', LOAD, 'empty list...["1 mN", "4 mN"]'),
        ('"contact.load" = "1 mN"', LOAD, 'list of values...["1 mN", "4 mN"]'),
        ('"contact.load" = { from = "1 mN", to = "2 um", count = 3 }', LOAD, '"mN" to "um"...one dimension'),
        ('"contact.load" = { from = "1 mN", to = "2 uF", count = 3 }', LOAD, '"mN" to "uF"...one dimension'),
        ('"contact.load" = { from = 1, to = "2 uN", count = 3 }', LOAD, 'no unit to "uN"...one dimension'),
        ('"contact.load" = { from = "1", to = "2", count = 2 }', LOAD, "value 1 (1) and 1 more...without a unit"),
        ('"contact.load" = { from = 1, to = 2 }', LOAD, "lacks count"),
        ('"contact.load" = { from = 1, to = 2, cout = 3 }', LOAD, '"cout"...from, to, count'),
        ('"contact.load" = { from = 1, to = nan, count = 3 }', LOAD, "finite numbers"),
        ('"contact.load" = { from = 1, to = 2, count = 1 }', LOAD, "count...whole number"),
        ('"contact.load" = { from = 1, to = 2, count = 2.5 }', LOAD, "count...whole number"),
        ('"contact.load" = { from = 1, to = 2, count = 3, scale = "ln" }', LOAD, '"linear" or "log"'),
        ('"contact.load" = { from = 0, to = 2, count = 3, scale = "log" }', LOAD, "above zero"),
        ("seed = [1, 2]", "sweep.seed", "ensemble.members"),
        ('name = ["a"]', "sweep.name", "cannot be swept...once for each value"),
        ('"clock.duration" = ["1 s"]', 'sweep."clock.duration"', "cannot be swept"),
        ('"ensemble.members" = [1]', 'sweep."ensemble.members"', "cannot be swept"),
        ('"bonds.model" = ["none", "rate"]', 'sweep."bonds.model"', 'whole table: "bonds" = [{ model'),
        ('bonds = [{ model = "none" }]\n"bonds.stress" = [1]', 'sweep."bonds.stress"', "swept twice"),
        ('"clock.step" = ["5 ms", "10 ms"]', "sweep", "different records...clock.record"),
    ],
)
def test_a_sweep_that_cannot_be_is_told_with_the_cure(refusal, text, key, words):
    (problem,) = refusal(text=f"{LENS}[sweep]\n{text}")
    at = END + 1 if key == "sweep" else END + 1 + len(text.splitlines())
    assert told(problem, at, key, words)


def test_a_bad_value_of_a_sweep_is_told_with_its_place(refusal):
    one, two = refusal(text=LENS + '[sweep]\n"shear.spectrum.rms" = ["1 kPa", "2 kg", -3, "4 kPa"]')
    assert told(one, END + 2, 'sweep."shear.spectrum.rms"', 'value 2 (2 kg): ...unit "kg"')
    assert told(two, END + 2, 'sweep."shear.spectrum.rms"', "value 3 (-3): ...above 0 Pa")


def test_a_fault_shared_by_many_values_is_told_once(refusal):
    (problem,) = refusal(text=LENS + '[sweep]\n"contact.load" = { from = "1 kg", to = "2 kg", count = 50 }')
    assert told(problem, END + 2, LOAD, 'value 1 (1 kg) and 49 more: ...unit "kg"')


def test_of_many_faults_the_first_are_put_in_words(refusal):
    numbers = ", ".join(f"{-number}.5" for number in range(1, 301))
    values = refusal(text=LENS + f'[sweep]\n"solid.shear_modulus" = [1e6, {numbers}]')
    assert len(values) == 101
    assert told(values[0], END + 2, 'sweep."solid.shear_modulus"', "value 2 (-1.5): ...above 0 Pa")
    assert told(values[-1], END + 2, 'sweep."solid.shear_modulus"', "200 more values cannot be used")
    keys = refusal(text="".join(f"a{number} = 1\n" for number in range(900)) + LENS)
    assert len(keys) == 101
    assert told(keys[0], 1, "a0", "is not a key")
    assert keys[-1] == "x: and 800 faults more"


def test_a_sweep_of_tables_is_told_what_each_lacks(refusal):
    one, two = refusal(
        text=LENS + '[sweep]\nbonds = [{ model = "none" }, { model = "steady" }, { modle = "rate" }, { stress = 1 }]'
    )
    assert told(one, END + 2, "sweep.bonds", 'value 2 ({ model = "steady" }): bonds.critical_speed: is missing')
    assert told(two, END + 2, "sweep.bonds", 'value 3 (a table): bonds.modle: ...did you mean "model"')


def test_zipped_tables_have_the_same_keys(refusal):
    rows = '[[sweep]]\n"contact.load" = 1\n[[sweep]]\n"contact.lad" = 1\n'
    (problem,) = refusal(text=LENS + rows)
    assert told(problem, END + 3, "sweep", '"contact.lad"...same keys')
    rows = '[[sweep]]\n"contact.load" = 1\n"solid.poisson_ratio" = 0.4\n'
    rows += '[[sweep]]\n"contact.load" = "1 kg"\n"solid.poisson_ratio" = 0.8\n'
    one, two = refusal(text=LENS + rows)
    assert told(one, END + 5, LOAD, 'value 2 (1 kg): ...unit "kg"')
    assert told(two, END + 6, 'sweep."solid.poisson_ratio"', "value 2 (0.8): ...at most 0.5")


@pytest.mark.parametrize("sweep", ["5", '"x"', "[]", "[1]", "[{}]"])
def test_what_is_no_sweep_is_told(refusal, sweep):
    (problem,) = refusal(text=f"sweep = {sweep}\n{LENS}")
    assert told(problem, 1, "sweep", "must be a ")


def test_a_sweep_is_checked_even_where_other_tables_are_faulty(refusal):
    text = LENS.replace('"2 mm"', '"2 kg"') + '[sweep]\n"contact.load" = ["1 mN", "1 s"]\n"clock.stp" = [1]\n'
    assert [problem.split(": ")[1] for problem in refusal(text=text)] == [
        "sphere.radius",
        'sweep."contact.load"',
        'sweep."clock.stp"',
    ]


def test_values_of_two_axes_that_do_not_go_together_are_told(refusal):
    text = LENS.replace("points = 32", "points = 40")
    sweep = '[sweep]\n"shear.cell" = ["0.2 mm", "0.3 mm"]\n"shear.points" = [32, 40]\n'
    (problem,) = refusal(text=text + sweep)
    assert told(problem, END + 1, "sweep", "do not go together: shear: ...shortest wavelength")


def test_points_whose_maps_differ_in_size_do_not_fit_into_one_dataset(refusal):
    text = LENS.replace('model = "modal"', 'model = "mapped"') + '[record]\nmaps = ["1 s"]\n'
    (problem,) = refusal(text=text + '[sweep]\n"shear.points" = [32, 40]\n')
    assert told(problem, END + 3, "sweep", "different maps...run once for each cell and number of points")


def test_a_sweep_of_far_too_many_points_is_refused_before_it_is_made(refusal):
    rows = "".join(f'"{key}" = {{ from = 1, to = 2, count = 9999 }}\n' for key in ("drive.to", "contact.load"))
    (problem,) = refusal(text=f"{LENS}[sweep]\n{rows}")
    assert told(problem, END + 1, "sweep", "20,000 points")


# --- overrides ---


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"contact.lod": 1}, 'did you mean "load"'),
        ({"nope.x.y": 3}, "nope is not a key; known: clock, "),
        ({"contact.load": "1 kg"}, 'unit "kg"'),
        ({"contact": 5}, "must be a table"),
        ({"seed": True}, "whole number"),
        ({"name.x": 1}, 'needs a table, but "name" is "lens"'),
        ({'""': 1}, "is not a key; known: clock"),
        ({"shear.spectrum.rsm": 1}, 'did you mean "rms"'),
        ({'sweep."contact.load"': [1, "2 mm"]}, 'value 2 (2 mm): ...unit "mm"'),
    ],
)
def test_a_bad_override_is_told_by_the_way_it_came(refusal, tmp_path, overrides, words):
    (key,) = overrides
    (problem,) = refusal(overrides=overrides)
    assert told(problem, 0, f"--set {key}", words)
    with pytest.raises(BadInput) as fault:
        load("x", overrides)
    assert told(fault.value.problems[0], 0, f'overrides["{key}"]', words)


def test_an_override_that_contradicts_the_file_is_told_how_to_replace_the_table(refusal):
    (problem,) = refusal(overrides={"contact.indentation": "1 um"})
    assert told(problem, line_of("[contact]"), "contact", """--set 'contact={ indentation = "1 um" }'""")
    with pytest.raises(BadInput, match=r'overrides=\{"contact": \{"indentation": "1 um"\}\}'):
        load("x", {"contact.indentation": "1 um"})


def test_a_model_chosen_by_an_override_is_told_which_keys_are_in_its_way(refusal):
    (problem,) = refusal(overrides={"shear.model": "uniform"})
    words = """(cell, points, spectrum, correlation)...--set 'shear={ model = "uniform" }'"""
    assert told(problem, 0, "--set shear.model", words)


# --- files that are no scenarios ---

TOO_MUCH = "nested too deeply, or holds a number too long"


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", 0, "is empty; `sim new`"),
        ("# nothing but a question?\n", 0, "is empty; `sim new`"),
        (b"\x00" * 40, 1, "is not TOML"),
        (b"PK\x03\x04\x14\x00", 1, "is not TOML"),
        (b"\x89HDF\r\n\x1a\n" + b"\x00" * 99, 0, "is a dataset"),
        (LENS.encode("utf-16"), 1, "is not UTF-8 text"),
        (LENS.encode() + b"\n# caf\xe9\n", END + 2, "is not UTF-8 text"),
        (LENS.replace("[drive]", "[drive"), 17, "is not TOML...close the bracket"),
        (LENS.replace('"4 mN"', "4 mN"), 46, 'is not TOML...unit in quotes, such as load = "4 mN"'),
        (LENS.replace('"rate"', "rate"), 24, 'is not TOML...text in quotes, such as model = "rate"'),
        (LENS.replace("seed = 7", "seed 7"), 2, "is not TOML...write key = value"),
        (LENS + "[clock]\n", END + 1, "is not TOML...merge both"),
        ("seed = 1\n" + LENS, 3, "is not TOML...twice, so keep one"),
        (LENS.replace('"lens"', '"lens'), 1, "is not TOML...close the quotes on the same line"),
        (LENS + 'text = """never closed\n', END + 2, "is not TOML...close its quotes"),
        ("a = [1, 2\n", 2, "is not TOML...close its bracket"),
        ("a = 2024-02-31\n", 1, "is not TOML"),
        ("a = " + "[" * 10_000, 0, TOO_MUCH),
        ("a = " + "{ b = " * 10_000 + "1" + " }" * 10_000, 0, TOO_MUCH),
        ("x = 1\n\ny = " + "1" * 5000, 0, TOO_MUCH),
        ("#" * 2**21, 0, "larger than 1 MiB"),
    ],
)
def test_what_is_no_scenario_is_told_in_one_line(refusal, text, line, words):
    (problem,) = refusal(text=text)
    start = f"x:{line}: " if line else "x: "
    assert problem.startswith(start)
    assert all(word in problem for word in words.split("..."))


@pytest.mark.parametrize("text", ["a = " + "[" * 100 + "]" * 100, "\n[" + "a." * 300 + "a]\n", "y = 0x" + "1" * 5000])
def test_a_monster_that_the_parser_takes_is_an_unknown_key(refusal, text):
    found = refusal(text=text)
    assert "is not a key" in found[-1]


def test_a_missing_file_a_folder_and_a_broken_name_are_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, words in (
        ("nope.toml", "no such file...`sim new`"),
        (".", "cannot be read (Is a directory)"),
        ("a\0b", "a\\x00b: cannot be read"),
        ("x" * 300, "cannot be read (File name too long)"),
    ):
        with pytest.raises(BadInput) as fault:
            load(name)
        (problem,) = fault.value.problems
        assert all(word in problem for word in words.split("..."))
    assert not os.listdir(tmp_path)


def test_a_path_without_end_is_read_no_further_than_a_scenario_can_be_long():
    with pytest.raises(BadInput, match="it is a device"):
        load("/dev/zero")
